# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths: the emission of what a ray meets is exact, the specular lobe there is followed to the next surface, and
the diffuse reflection comes from the photon map, or from a final gather, whose rays use photons one bounce later."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, eye_rays
from ..geometry.free_space import free_space, unlimited
from ..geometry.segments import ENDLESS, Tracer, trace_by_kind
from ..geometry.stage import Stage, transmits_anywhere
from ..photons.irradiance_cache import IrradianceCache
from ..photons.photon_map import PhotonMap
from ..photons.thrown import ThrownMap
from .final_gather import choose_splits, open_finals, share
from .gathers import asking_photons, locate_gathers, meet, part_near
from .media import cross_media
from .onward import follow
from .passing import pass_through
from .rays import Bounce, Estimate, Rows, empty_rays, empty_rows, join, start_paths
from .reflection import Asking, recall, reflect, shadow_rays
from .shadow_rays import Lighting, add_unshadowed


class CameraPass(NamedTuple):
    """All that the tiles of one pass share.

    samples: (pixels,) uint16, camera rays of each pixel in a pass. photon_map, cache: of the pass. keys: two keys of
    the camera stream, of the seed and of this pass. index: of the pass. weights: (layers * b,) float32, by which each
    band of each layer counts in the radiance over all bands. thrown: see photons.thrown; None if no gas scatters.
    """

    tracer: Tracer
    stage: Stage
    lighting: Lighting
    eye: Eye
    samples: np.ndarray
    photon_map: PhotonMap
    cache: IrradianceCache | None
    estimate: Estimate
    keys: tuple[np.uint64, np.uint64]
    index: int
    weights: np.ndarray
    thrown: ThrownMap | None = None


def render_pixels(
    shared: CameraPass, pixels: np.ndarray, cancelled: Callable[[], bool]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimate the excess radiance of a tile of pixels in one pass.

    pixels: (h, w) int64, numbers in the window. Returns image (h w, layers * b) float32, W m-2 sr-1, and two parts of
    the radiance over all bands, (h w,) float32: seen, what steady rays meet (see Rays); and missed, what continued rays
    find in place of what is recalled, less the latter. It is not in the image, tells of few rays and thus little of a
    single pixel.
    """
    tracer, stage, lighting, estimate = shared.tracer, shared.stage, shared.lighting, shared.estimate
    bands, numbers = stage.radiometry.reference.size, pixels.ravel()
    samples = shared.samples[numbers]
    rays, reach = _camera_rays(shared, samples, numbers)
    # the pixels, and two rows for each that check what is recalled, see follow
    rows = empty_rows(np.zeros((3 * pixels.size, shared.weights.size), np.float32))
    steady, finals = np.zeros((pixels.size, shared.weights.size), np.float32), []
    count, number, passes = len(rays.origin), 0, transmits_anywhere(stage)
    while count and not cancelled():
        limit = reach.copy() if passes else reach  # a trace overwrites it
        hits = _trace(tracer, number, rays, count, reach)
        bounce = Bounce(number, rays, hits, np.zeros(count, np.bool_), np.zeros(count, np.float32))
        # what passes a sheet is not parted here, but where it ends
        whole = rays._replace(pixel=rays.pixel.copy(), density=rays.density.copy()) if passes else rays
        if estimate.photons and number > 0:
            part_near(bounce, rows)
        scattered = (
            cross_media(tracer, stage, lighting, bounce, (rows.image, steady), shared.thrown)
            if tracer.holds_media
            else None
        )
        if passes:
            passed, left = pass_through(stage, bounce._replace(rays=whole), samples, limit)
        if estimate.photons and number > 0:
            _recall(shared, bounce, rows.image)
        gathers = meet(stage, lighting, bounce, rows, steady)
        if estimate.photons:
            gathers = choose_splits(stage, estimate, numbers, bounce, gathers)
            rows = _ask_photons(shared, bounce, gathers, rows, finals)
        shadows = shadow_rays(stage, lighting, bounce, samples, gathers)
        if len(shadows.reach):
            add_unshadowed(tracer, stage, shadows, rows.image)
        room = count + int(gathers.rays.sum()) + 2 * np.count_nonzero(gathers.rays) + np.count_nonzero(bounce.goes_on)
        rays = empty_rays(room, bands, passes)
        count, number = follow(stage, lighting.looking.together, bounce, samples, gathers, rays), number + 1
        if scattered is not None:
            rays, count = join(rays, count, scattered)
        reach = np.full(count, ENDLESS, np.float32)
        if passes:
            (rays, count), reach = join(rays, count, passed), np.concatenate((reach, left))
    for final in finals:
        share(stage.surfaces, final, estimate.shrink2, pixels.shape, rows)
    image, goes_on, recalls, *_ = np.split(rows.image, (pixels.size, 2 * pixels.size, 3 * pixels.size))
    # einsum, as numpy leaves matrix products to a library with threads of its own
    seen, missed = (np.einsum("pb,b->p", of, shared.weights) for of in (steady, goes_on - recalls))
    return image + steady, seen, missed


def _trace(tracer, number, rays, count, reach):
    """The Hits of the first `count` rays of a bounce, which pass what is hidden from their kind."""
    batch = rays.origin[:count], rays.direction[:count]
    if number > 0 and (tracer.hides or tracer.camera is not tracer):
        return trace_by_kind(tracer, rays.kind[:count], batch, reach)
    return (tracer if number else tracer.camera).trace(*batch, reach)


def _camera_rays(shared, samples, numbers):
    """The camera rays of some pixels, and their reach, (n,) float32, see eye_rays."""
    count = int(samples.sum())
    stage = shared.stage
    rays = empty_rays(count, stage.radiometry.reference.size, transmits_anywhere(stage))
    reach = np.empty(count, np.float32)
    eye_rays(shared.eye, shared.keys[0], shared.index, samples, numbers, rays.origin, rays.direction, reach)
    start_paths(shared.keys[1], samples, numbers, not shared.tracer.scatters, rays)
    return rays, reach


def _recall(shared, bounce, image):
    """Add the diffuse reflection of the ends of final gathers: from the cache, and caustics where rays go on."""
    continued = recall(shared.stage, shared.lighting.surroundings.open, shared.cache, shared.estimate, bounce, image)
    anywhere = Asking(continued, unlimited(len(continued.ray), shared.estimate.reach2), True)
    reflect(shared.stage, shared.photon_map, shared.estimate, bounce, anywhere, image)


def _ask_photons(shared, bounce, gathers, rows, finals):
    """Add the diffuse reflection of gathers, from the photons around them. Append gathers that send rays instead to
    `finals`. Returns the rows, with further rows for the radiance that those rays will meet."""
    stage, estimate, photon_map = shared.stage, shared.estimate, shared.photon_map
    points = locate_gathers(stage, bounce, gathers)
    space = unlimited(len(gathers.ray), estimate.reach2)
    felt = asking_photons(bounce, gathers, photon_map, estimate)
    if len(felt):
        space = free_space(shared.tracer, stage.surfaces, estimate.reach2, *points, felt)
    reflect(stage, photon_map, estimate, bounce, Asking(gathers, space, False), rows.image)
    if not gathers.rays.any():
        return rows
    finals.append(open_finals(stage, shared.lighting, bounce, gathers, len(rows.image)))
    count = len(finals[-1].pixel)
    further = empty_rows(np.zeros((2 * count, rows.image.shape[1]), np.float32))
    further.near[:count], further.fewer[:count] = finals[-1].near, finals[-1].fewer
    further.apart[:count] = count
    return Rows(*map(np.concatenate, zip(rows, further, strict=True)))
