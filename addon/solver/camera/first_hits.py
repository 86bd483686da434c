# SPDX-License-Identifier: GPL-3.0-or-later
"""First hits: temperature, emissivity, position and more of the surface that the middle of each pixel sees.

One ray passes through the middle of the pixel and of the lens. So each value is that of a single surface, without a
mixture over edges, without blur out of focus, and without noise.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..geometry.eye import build_eye, empty_eye_rays, rays_through
from ..geometry.interaction import interact
from ..geometry.media import radius_of_media
from ..geometry.see_through import with_holes
from ..geometry.segments import Hits, RayBatch
from ..geometry.surfaces import Geometry, build_geometry, build_surfaces
from ..geometry.textures import mixed_share, row_of, temperature_in_image
from ..geometry.triangles import scene_radius
from ..physics.radiometry import Radiometry, build_radiometry, excess, mean_transmittance
from ..physics.sensors import band_weights
from ..physics.spectrum import faintest
from ..sampling.vectors import put_vector
from ..scene import Material, Scene
from ..system.kernels import KERNEL, njit
from .transmittance import Transmittance

# name -> channels
QUANTITIES = {"surface_temperature": 1, "emissivity": 1, "depth": 1, "normal": 3, "position": 3, "transmittance": 1}
FAR = 1e10  # m, depth of the surroundings, as Cycles has it
_NOTHING = {"depth": FAR, "transmittance": 1.0}  # where no surface is seen and no gas; everything else is 0 there
_CHUNK = 1 << 14  # pixels that are one piece of work


def first_hit_images(
    scene: Scene,
    names: Collection[str],
    labels: Mapping[str, np.ndarray] | None = None,
    geometry: Geometry | None = None,
    threads: int = 1,
    cancelled: Callable[[], bool] = lambda: False,
) -> dict[str, np.ndarray]:
    """Images of what the middle of each pixel sees, by name: (height, width) float32, or (height, width, 3).

    names: some of QUANTITIES:
        surface_temperature: K, of the surface itself.
        emissivity: 0..1, towards the camera: radiance of the surface over that of a blackbody at its temperature, of
            all bands through the sensor's response.
        depth: m, along the view axis; in a panorama the distance.
        normal: unit shading normal, on the side that is seen, in world space.
        position: m, world space.
        transmittance: 0..1, of the media on the way to the surface, or to the end of the world's medium where the
            surroundings are seen: see Transmittance. 1 without media.
    labels: further images by name, each from a number for each triangle of the scene, (triangles,).
    Where the surroundings are seen, depth is FAR and all else but the transmittance 0. Row 0 is the bottom row. The
    images are the same for any number of threads. cancelled: as in `render`; unfinished pixels then show the values of
    the surroundings without gas.
    geometry: of the scene, see `build_geometry`.
    """
    geometry = build_geometry(scene, geometry)
    surfaces, tracer, centre = build_surfaces(scene, geometry)
    holes = np.floor(mean_transmittance(scene.materials, scene.band_edges))
    tracer = with_holes(tracer, surfaces, holes).camera
    through = Transmittance(scene, tracer, centre) if "transmittance" in names and scene.media else None
    radius = max(scene_radius(surfaces.corners), radius_of_media(scene.media, centre) if through else 0.0)
    pinhole = build_eye(scene.camera, centre, radius)._replace(lens_radius=0.0)
    radiometry = _radiometry(scene) if "emissivity" in names else None
    x0, y0, x1, y1 = scene.camera.pixels
    count = (x1 - x0) * (y1 - y0)
    images = {name: np.full((count, QUANTITIES[name]), _NOTHING.get(name, 0.0), np.float32) for name in names}
    images |= {name: np.zeros((count, 1), np.float32) for name in labels or {}}
    of_surfaces = [name for name in images if name != "transmittance"]

    def see(first: int) -> None:
        if cancelled():
            return
        pixels = np.arange(first, min(first + _CHUNK, count))
        origin, direction, reach = empty_eye_rays(len(pixels))
        x, y = pixels % (x1 - x0) + (x0 + 0.5), pixels // (x1 - x0) + (y0 + 0.5)
        rays_through(pinhole, x, y, origin, direction, reach)
        hits = tracer.trace(origin, direction, reach)
        if through:
            images["transmittance"][pixels, 0] = through.of(origin, direction, hits)
        met = np.flatnonzero(hits.triangle >= 0)
        rays, hits = RayBatch(origin[met], direction[met]), Hits(*(column[met] for column in hits))
        normal, cosine = np.empty((len(met), 3), np.float32), np.empty(len(met))
        looked_up = _LookedUp(np.empty(len(met)), np.empty(len(met), np.int32), np.empty(len(met)))
        _meet(surfaces, hits, rays, normal, cosine, looked_up)
        seen = _Seen(scene, radiometry, geometry.row(hits.triangle), hits, normal, cosine, looked_up)
        for name in of_surfaces:
            image = images[name]
            values = getattr(seen, name) if name in QUANTITIES else labels[name][seen.row]
            image[pixels[met]] = values.reshape(len(values), image.shape[1])

    with ThreadPoolExecutor(threads) as pool:
        deque(pool.map(see, range(0, count, _CHUNK)), 0)
    shape = (y1 - y0, x1 - x0)
    return {name: image.reshape(shape if image.shape[1] == 1 else (*shape, 3)) for name, image in images.items()}


class _LookedUp(NamedTuple):
    """What textures say where n rays meet triangles. kelvin: (n,) float64, -1 where no image says it. mixed: (n,)
    int32, material that is mixed in, -1 for none. share: (n,) float64, how much of it."""

    kelvin: np.ndarray
    mixed: np.ndarray
    share: np.ndarray


@njit(**KERNEL)
def _meet(surfaces, hits, rays, normal, cosine, looked_up):
    """Fill in, for n rays that meet triangles, the shading normal (n, 3) of the side that faces the ray, the cosine
    (n,) between that and the ray, and what textures say."""
    table = surfaces.textures
    for i in range(cosine.size):
        at = interact(surfaces, hits, i, rays.direction)
        put_vector(at.shading_normal, normal, i)
        row, cosine[i] = row_of(table, at.triangle), at.cosine
        looked_up.kelvin[i] = temperature_in_image(table, row, at.u, at.v)
        looked_up.mixed[i] = table.mixed[row] if row >= 0 else -1
        looked_up.share[i] = mixed_share(table, row, at.u, at.v)


@dataclass(frozen=True)
class _Seen:
    """What n rays see. `normal` and the properties are the QUANTITIES, (n,) or (n, 3). Positions and temperatures are
    computed from the scene's own arrays in float64.

    radiometry: see _radiometry. row: (n,) rows of the triangles in the scene. hits: see Hits. normal: (n, 3)
    float32. cosine: (n,) float64, between the normal and the ray. looked_up: see _LookedUp.
    """

    scene: Scene
    radiometry: Radiometry | None
    row: np.ndarray
    hits: Hits
    normal: np.ndarray
    cosine: np.ndarray
    looked_up: _LookedUp

    def _interpolate(self, corners: np.ndarray) -> np.ndarray:
        """Interpolate values (n, 3[, d]) at the corners of triangles to the hits: (n[, d]) float64."""
        u, v = self.hits.u.astype(np.float64), self.hits.v.astype(np.float64)
        return np.einsum("nc,nc...->n...", np.column_stack((1.0 - u - v, u, v)), corners)

    @cached_property
    def surface_temperature(self) -> np.ndarray:
        kelvin, in_image = self.scene.temperature[self.row], self.looked_up.kelvin
        return np.where(in_image >= 0.0, in_image, kelvin if kelvin.ndim == 1 else self._interpolate(kelvin))

    @cached_property
    def position(self) -> np.ndarray:
        return self._interpolate(self.scene.vertices[self.scene.triangles[self.row]])

    @cached_property
    def depth(self) -> np.ndarray:
        matrix = self.scene.camera.matrix
        offset = self.position - matrix[:3, 3]
        if self.scene.camera.kind == "PANORAMA":
            return np.linalg.norm(offset, axis=1)
        return np.einsum("nd,d->n", offset, -matrix[:3, 2])

    @cached_property
    def emissivity(self) -> np.ndarray:
        kelvin = np.maximum(self.surface_temperature, faintest(float(self.scene.band_edges[0])))
        weights = band_weights(self.scene.response, self.scene.band_edges)
        own, (_, mixed, share) = np.empty(len(kelvin)), self.looked_up
        _emissivities(self.radiometry, weights, self.scene.material[self.row], kelvin, self.cosine, own)
        if not share.any():
            return own
        other = np.empty(len(kelvin))
        _emissivities(self.radiometry, weights, np.where(share > 0.0, mixed, 0), kelvin, self.cosine, other)
        return own + share * (other - own)


def _radiometry(scene: Scene) -> Radiometry:
    """The tables of the materials in each band, without a reference temperature; the last material is a blackbody.

    Surfaces colder than `faintest` emit next to nothing in any band: they are taken to be as warm as that.
    """
    cold = faintest(float(scene.band_edges[0]))
    low, high = (max(kelvin, cold) for kelvin in scene.temperature_range)
    return build_radiometry((*scene.materials, Material(emissivity=1.0)), scene.band_edges, (low, high), high, 0.0)


@njit(cache=True, nogil=True)
def _emissivities(radiometry, weights, material, kelvin, cosine, values):
    """Fill values (n,) with the emissivity of materials (n,) at temperatures (n,), K, towards directions (n,)."""
    black = radiometry.lobes.alpha.size - 1
    emitted, most = np.empty(weights.size), np.empty(weights.size)
    for i in range(values.size):
        excess(radiometry, material[i], kelvin[i], cosine[i], emitted)
        excess(radiometry, black, kelvin[i], 1.0, most)
        values[i] = np.sum(weights * emitted) / np.sum(weights * most)
