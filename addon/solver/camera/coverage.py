# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage: how much of each pixel shows something, and not the surroundings or a hole in the picture.

Rays go straight on from the camera until nothing of them is left: thin sheets and gases take their part, everything
else what remains. Mirrors are something, whatever they show. That is alpha as Cycles has it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, build_eye, empty_eye_rays, eye_rays
from ..geometry.interaction import interact, mixed_at, pass_on
from ..geometry.media import radius_of_media
from ..geometry.segments import ENDLESS, RayBatch, Tracer
from ..geometry.surfaces import Geometry, Surfaces, build_geometry, build_surfaces
from ..geometry.triangles import scene_radius
from ..moments import at_moment
from ..physics.radiometry import mean_transmittance
from ..sampling.rng import ALL_PASSES, CAMERA, pass_key
from ..sampling.vectors import dot, vector
from ..scene import Scene
from ..system.kernels import KERNEL, njit
from .transmittance import Transmittance

_FEW, _MANY = 16, 256  # rays of a pixel: of each, and of those in which, or beside which, these see different things
_CHUNK = 1 << 18  # rays that are one piece of work
_SAME = 1.0 / 256.0  # difference of alpha up to which two values are taken for one
_FAINT = 1e-4  # share of a ray from which on what is left of it does not count


def coverage_image(
    scene: Scene,
    transparent: bool,
    geometry: Geometry | None = None,
    threads: int = 1,
    cancelled: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """Alpha, (height, width) float32, 0..1: share of what a pixel sees that is something. Row 0 is the bottom row.

    Surfaces of the scene's holdout are nothing, though they hide what is behind them. transparent: whether the
    surroundings are nothing, too. If the scene moves, alpha is the mean over its moments. At edges the standard error
    is about 1 / 256, without any dependence on the seed or the number of threads. geometry: of the scene, see
    `build_geometry`. cancelled: as in `render`; unfinished pixels then are 1.
    """
    geometry = build_geometry(scene, geometry)
    if scene.moments:
        at_times = (at_moment(scene, moment) for moment in scene.moments)
        images = (coverage_image(each, transparent, geometry, threads, cancelled) for each in at_times)
        return sum(images) / np.float32(len(scene.moments))
    surfaces, tracer, centre = build_surfaces(scene, geometry)
    through = Transmittance(scene, tracer, centre) if scene.media else None
    radius = max(scene_radius(surfaces.corners), radius_of_media(scene.media, centre))
    holdout = np.zeros(len(scene.triangles), np.bool_) if scene.holdout is None else scene.holdout
    held = geometry.taken(holdout)
    sight = _Sight(
        build_eye(scene.camera, centre, radius),
        tracer.camera,
        surfaces,
        mean_transmittance(scene.materials, scene.band_edges),
        held,
        through,
        transparent,
    )
    x0, y0, x1, y1 = scene.camera.pixels
    image = np.ones((y1 - y0) * (x1 - x0), np.float32)
    mixed = np.zeros(len(image), np.bool_)

    with ThreadPoolExecutor(threads) as pool:

        def look(pixels: np.ndarray, count: int) -> None:
            def part(some: np.ndarray) -> None:
                if not cancelled():
                    alpha = _look(sight, some, count)
                    image[some], mixed[some] = alpha.mean(axis=1), np.ptp(alpha, axis=1) > _SAME

            list(pool.map(part, np.array_split(pixels, max(1, -(-len(pixels) * count // _CHUNK)))))

        look(np.arange(len(image)), _FEW)
        look(np.flatnonzero(_beside_others(image.reshape(y1 - y0, x1 - x0)).ravel() | mixed), _MANY)
    return image.reshape(y1 - y0, x1 - x0)


def _beside_others(image: np.ndarray) -> np.ndarray:
    """(h, w) bool, pixels that differ from one of the eight around them."""
    wide = np.pad(image, 1, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(wide, (3, 3))
    return np.ptp(around, axis=(2, 3)) > _SAME


class _Sight(NamedTuple):
    """What coverage hangs on. tracer: of camera rays, without holes. transmittance: (materials,) float64, in the mean
    over the bands. held: (t,) bool, triangles that are nothing. through: None without media. transparent: see
    coverage_image."""

    eye: Eye
    tracer: Tracer
    surfaces: Surfaces
    transmittance: np.ndarray
    held: np.ndarray
    through: Transmittance | None
    transparent: bool


def _look(sight: _Sight, pixels: np.ndarray, count: int) -> np.ndarray:
    """(n, count) float64 alpha of count rays through each of n pixels: those with which the passes begin."""
    whole = count * len(pixels)
    origin, direction, reach = empty_eye_rays(whole)
    key = pass_key(0, ALL_PASSES, CAMERA)
    eye_rays(sight.eye, key, 0, np.full(len(pixels), count, np.uint16), pixels, origin, direction, reach)
    ray, rays, left, alpha = np.arange(whole), RayBatch(origin, direction), np.ones(whole), np.zeros(whole)
    optics, found = (sight.transmittance, sight.held), (left, alpha)
    while len(ray):
        hits = sight.tracer.trace(*rays, reach.copy())
        if sight.through:
            passed = left[ray] * sight.through.of(*rays, hits)
            alpha[ray] += left[ray] - passed
            left[ray] = passed
        onward = RayBatch(*map(np.empty_like, rays))
        kept = _go_on(sight.surfaces, optics, hits, rays, (ray, reach), found, onward)
        ray, reach, rays = ray[:kept], reach[:kept], RayBatch(*(column[:kept] for column in onward))
    return (alpha if sight.transparent else alpha + left).reshape(len(pixels), count)


@njit(**KERNEL)
def _go_on(surfaces, optics, hits, rays, ends, found, onward):
    """Add to alpha what n rays meet, and lower what is left of them. Those of which anything is left go on behind the
    surface, in onward; returns how many.

    optics: transmittance and held, see _Sight. ends: numbers of the rays and their reach (n,), moved as the rays are.
    found: left and alpha, of all rays by their number.
    """
    (transmittance, held), (ray, reach), (left, alpha), kept = optics, ends, found, np.int64(0)
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0:
            continue
        at, of, way = interact(surfaces, hits, i, rays.direction), ray[i], vector(rays.direction, i)
        (other, share), own = mixed_at(surfaces, at), transmittance[surfaces.material[at.triangle]]
        passed = left[of] * (own + share * (transmittance[other] - own))
        if not held[at.triangle]:
            alpha[of] += left[of] - passed
        left[of] = passed
        if passed > _FAINT:
            remaining = (reach[i] - hits.distance[i]) * np.float32(np.sqrt(dot(way, way)))
            reach[kept] = remaining if reach[i] < ENDLESS else ENDLESS
            pass_on(surfaces, at, onward, kept)
            ray[kept] = of
            kept += 1
    return kept
