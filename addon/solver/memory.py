# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory a render needs, estimated before its first pass, and how much there is.

With P pixels, b bands, l layers, m triangles, t threads and h stored hits in a pass, in bytes:

    film       P (12 l b + 144)               mean in float64, one pass in float32, sixteen more values for the noise,
                                              six results of the survey
               P (4 l b + 8 b)                where l > 1: their sum, and what their file is written from
               P (16 + 24 j)                  with molecules or motion: what follows the j numbers that tell of
                                              their draws and times
    images     P (4 c (b + 7) + 64)           c float32 copies of all passes, and what the noise is computed with
    frame      20 F                           of F pixels around a render region: Combined, and as a screen shows it
    photons    1.25 h (2 (4 b + 29) + 30)     twice while the store grows, then sorted into the map, as are points of
                                              what mirrors throw into gas, which count as hits; a quarter as many
                                              in the irradiance cache, which holds fewer for the first 4000 passes
               h (l - 1) b                    its further layers
    rays       (4 b + 90) min(P, 1024 t) n    of the tile of each thread: for each of 1024 pixels n rays, camera rays
                                              and those of final gathers, as many as where most are planned
    geometry   240 m                          vertices, adjacency, trees of our own and Embree's, what they emit (of
                                              closed meshes about 180; every sheet of loose triangles takes more)
               200 m                          where some are hidden from rays: Embree's tree of the others, for each
                                              kind of rays that sees others
               44 m                           where some are shaded smooth: unit normals at corners, and their rows
    tables     16 (n + 1) t b                 what n materials and a blackbody emit at t temperatures, and its slope
               1024 (6 + 10 r) f b            what f materials that follow Fresnel's law reflect and emit at 256
                                              angles; e^r is the ratio of the highest to the lowest temperature
    textures   4 x + 16 min(2^21, 256 r + x) + 80 r   of x texels over r triangles: the texels, cells from which photons
                                              leave, coordinates
    grids      max(20, 8 + 8 c) v + 4 p       of v cells with c components, in p places for leaves (see geometry.grids)
    sky        8 b n                          of n pixels of an image, or 720 zenith angles
    moments    all from geometry on a second time, if the scene moves: as it is planned by, and as a pass sees it

Trial photons tell how many hits a photon stores (see preparation): 1 / (1 - rho) in a closed room of reflectance rho,
and far fewer where photons leave the scene, or come from lamps, whose first hits are not stored.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .geometry.grids import memory_of_grids
from .image.tiles import TILE
from .moments import wave_count
from .photons.cells import bytes_of_textures
from .physics.fresnel import bytes_of_fresnel
from .physics.layers import scene_layers
from .physics.molecules import probe_count
from .physics.radiometry import emission_range, table_rows
from .physics.sky import sky_size
from .scene import Hidden, Medium, Scene, SceneError
from .settings import Settings

_GIGABYTE = 1e9
_KEPT = 31 << 20  # bytes; glibc's thresholds follow freed blocks of up to 32 MB
# Name of each part in messages, and what to lower to make it smaller.
_PARTS = {
    "film": ("the sums for every pixel and band", "the resolution or the number of bands or temperature groups"),
    "images": ("the images of every band", "the resolution, the number of bands or of view layers"),
    "frame": ("the pixels around the render region", "the resolution, or crop to the render region"),
    "photons": ("the photons of a pass", "the photons per pass or the number of bands"),
    "rays": ("the rays under way", "the number of threads or of bands"),
    "geometry": ("the triangles", "the subdivision of the meshes"),
    "tables": ("the tables of what materials emit", "the number of materials or of bands"),
    "textures": ("the images over surfaces", "the resolution of the images"),
    "grids": ("the cells of volumes", "the resolution of the volumes"),
    "sky": ("the radiance of the sky", "the resolution of its image or the number of bands"),
    "moments": ("what moves, at all times of the picture,", "the motion steps"),
}


def memory_of_images(pixels: float, bands: int, copies: float = 0, layers: int = 1, around: float = 0) -> dict:
    """Bytes of the film and of all images, by part, known before anything of the scene is read.

    copies: see memory_beforehand. layers: of temperature groups. around: number of pixels of the frame that lie around
    the render region and are shown with it.
    """
    film = 12 * layers * bands + 144 + (4 * layers * bands + 8 * bands if layers > 1 else 0)
    parts = {"film": float(pixels) * film, "images": float(pixels) * (4 * copies * (bands + 7) + 64)}
    return parts | ({"frame": 20.0 * around} if around else {})


def memory_beforehand(scene: Scene, copies: float = 0) -> dict[str, float]:
    """Bytes that a render needs beyond the scene before its photons are known, by part (the formulae above).

    copies: number of float32 copies of all images that are held at once beside the film.
    """
    temperatures = emission_range(scene.temperature.reshape(len(scene.triangles), -1), scene.images_of_temperature)
    rows, angular = table_rows(temperatures), bytes_of_fresnel(scene.materials, temperatures, scene.band_count)
    triangles = len(scene.triangles), scene.corner_normals is not None, _parts(scene.hidden)
    parts = {
        "geometry": memory_of_triangles(*triangles),
        "tables": 16.0 * (len(scene.materials) + 1) * rows * scene.band_count + angular,
        "textures": bytes_of_textures(scene.textures),
        "grids": sum(memory_of_grids(scene.media).values()),
        "sky": float(sky_size(scene.sky, scene.band_count)),
    }
    again = {"moments": sum(parts.values())} if scene.moments else {}
    return _images_of(scene, copies) | parts | again


def memory_of_triangles(count: int, smooth: bool = False, parts: int = 0) -> float:
    """Bytes of the geometry of so many triangles. smooth: whether some are shaded smooth. parts: in which rays of some
    kinds do not see all."""
    return (240.0 + 44.0 * smooth + 200.0 * parts) * count


def _parts(hidden: np.ndarray | None) -> int:
    """How many different parts of the triangles rays see that do not see all. hidden: see Scene."""
    return 0 if hidden is None else len({(hidden & flag).tobytes() for flag in Hidden if (hidden & flag).any()})


def memory_of_passes(
    scene: Scene, settings: Settings, copies: float, hits_per_photon: float, rays_per_pixel: float
) -> dict[str, float]:
    """Bytes that the passes need once the geometry is there, by part. hits_per_photon: mean number of stored hits of a
    photon. rays_per_pixel: rays under way at once, in the tile where they are most."""
    hits, bands = settings.photons_per_pass * hits_per_photon, scene.band_count
    further = len(scene_layers(scene)[0]) - 1
    return _images_of(scene, copies) | {
        "photons": hits * (1.25 * (2 * (4 * bands + 29) + 30) + further * bands),
        "rays": (4.0 * bands + 90.0) * min(_pixels(scene), TILE**2 * settings.workers) * rays_per_pixel,
    }


def _pixels(scene: Scene) -> float:
    x0, y0, x1, y1 = scene.camera.pixels
    return float(x1 - x0) * (y1 - y0)


def _images_of(scene: Scene, copies: float) -> dict[str, float]:
    parts = memory_of_images(_pixels(scene), scene.band_count, copies, len(scene_layers(scene)[0]))
    numbers = probe_count(scene.media) + wave_count(len(scene.moments))
    return parts | ({"film": parts["film"] + _pixels(scene) * (16 + 24 * numbers)} if numbers else {})


def check_memory(required: dict[str, float], render: str = "This render", media: tuple[Medium, ...] = ()) -> None:
    """Raise SceneError, naming the largest part, if more bytes are required than available.

    required: by part. render: what the message calls what needs them. media: of the scene; if grids need most, the
    message names the one with the largest of these.
    """
    total, available = sum(required.values()), available_memory()
    if available is None or total <= available:
        return
    name = max(required, key=required.get)
    what, remedy = _PARTS[name]
    of_grids = memory_of_grids(media)
    if name == "grids" and of_grids:
        what += f", '{max(of_grids, key=of_grids.get)}' above all,"
    raise SceneError(
        f"{render} needs about {total / _GIGABYTE:,.1f} GB of memory, {available / _GIGABYTE:.1f} GB are available. "
        f"{what[0].upper()}{what[1:]} need most, {required[name] / _GIGABYTE:,.1f} GB: lower {remedy}"
    )


def keep_freed_memory() -> None:
    """Let malloc keep the memory of arrays for the next ones.

    The malloc of glibc hands freed memory back to the system, and then has to ask for it anew, unless a larger block
    has been freed before (mallopt(3), M_MMAP_THRESHOLD). For the arrays of every tile this would take time.
    """
    np.empty(_KEPT, np.uint8)  # freed here, never touched


def available_memory(root: Path = Path("/")) -> int | None:
    """Bytes that this process may still take: free memory and swap, or what is left of a control group's limit.

    None where it is unknown, which is everywhere but on Linux. root: of the file system, for tests.
    """
    try:
        words = [line.split() for line in (root / "proc/meminfo").read_text().splitlines()]
        kibibytes = {line[0]: int(line[1]) for line in words}
        free = 1024 * (kibibytes["MemAvailable:"] + kibibytes["SwapFree:"])
        group = (root / "proc/self/cgroup").read_text().partition("0::/")[2].strip()
    except (OSError, KeyError, ValueError, IndexError):
        return None
    folder = root / "sys/fs/cgroup" / group
    return min([free, *(left for each in (folder, *folder.parents) if (left := _left_in_group(each)) is not None)])


def _left_in_group(folder: Path) -> int | None:
    """Bytes left of the memory limit of a control group (version 2), None without a limit. Cached files are free."""
    try:
        limit, used = (int((folder / f"memory.{name}").read_text()) for name in ("max", "current"))
        counts = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return max(0, limit - used + int(counts["file"]))
    except (OSError, ValueError, KeyError):  # no such file, or "max"
        return None
