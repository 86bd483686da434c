# SPDX-License-Identifier: GPL-3.0-or-later
"""The pass loop of multi-pass spectral photon mapping (Boudet et al. 2004, section 4).

prepare the scene: what the image can depend on, reference temperature, tables, emitters  (planning.preparation)
for every pass:
    if the scene moves, prepare it as it is at the time of the pass                         (moments)
    draw what molecules absorb                           (physics.molecules)
    emit photons, trace them, store their hits           (photons.emission, photons.transport)
    sort them into a photon map                          (photons.photon_map)
    estimate the irradiance at some points               (photons.irradiance_cache)
    follow camera paths and gather photons at their ends (camera.eye_paths)
    add the image to the running mean                    (image.film)
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .camera.eye_paths import CameraPass, render_pixels
from .camera.rays import Estimate
from .camera.shadow_rays import Lighting, direct_irradiance, lamp_distances, lamp_points
from .geometry.segments import hidden_from_lobes
from .geometry.surfaces import Geometry, build_geometry
from .image.film import Film
from .image.tiles import tiles
from .image.trend import shrink_factor
from .memory import check_memory, keep_freed_memory, memory_beforehand, memory_of_passes
from .moments import at_moment, step_of, wave_count, waves
from .photons.emission import Batch
from .photons.irradiance_cache import IrradianceCache, build_irradiance_cache, cache_points, look_around, ray_ends
from .photons.photon_map import PhotonMap, Photons, PhotonStore, build_photon_map, few_neighbours
from .photons.thrown import Thrown, ThrownMap, build_thrown_map, empty_thrown
from .photons.transport import trace_photons
from .planning.preparation import Model, photon_store, prepare
from .sampling.rng import ALL_PASSES, CACHE, CAMERA, LAMPS, PHOTONS, pass_key
from .scene import Scene
from .settings import Settings

log = logging.getLogger(__name__)

# Work is cut into pieces of fixed size, whatever the number of threads, so that results never depend on it.
PHOTON_CHUNK = 16384  # photons: a wave of 16 bands stays within the second-level cache
_MOST_DRAWS = 4096  # passes whose error of quadrature is told; more err less


def render(
    scene: Scene,
    settings: Settings,
    on_pass: Callable[[Film], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
    film: Film | None = None,
    image_copies: int = 0,
    geometry: Geometry | None = None,
) -> Film:
    """Render a scene until a stop condition of the settings holds.

    on_pass is called after every pass, in this thread, with the film so far (which the next pass changes).
    cancelled is called before the first pass and many times in a pass; once it returns true the unfinished pass is
    dropped and the film returned.
    film: with the first passes of this render, to which the others are added. The result is the same as of a render
    without a break; but the time limit counts from this call on.
    image_copies: number of float32 copies of all images that the caller holds, as these need memory, too.
    geometry: of an earlier scene, reused if it is the same (see build_geometry); the image is the same either way.
    Raises SceneError if the scene cannot be rendered or needs more memory than there is, ValueError if the film is not
    of this render.
    """
    check_memory(memory_beforehand(scene, image_copies), media=scene.media)
    if scene.moments:
        geometry = build_geometry(scene, geometry)  # for the moments at which nothing but temperatures differs
    model = prepare(scene, settings, geometry, cancelled)
    x0, y0, x1, y1 = scene.camera.pixels
    size, numbers = (x1 - x0, y1 - y0), (settings.seed, settings.pass_offset)
    if model is None:
        return Film(*size, scene.band_edges, 0.0, *numbers) if film is None else film
    check_memory(memory_of_passes(scene, settings, image_copies, model.hits_per_photon, model.rays_per_pixel))
    empty = Film(*size, scene.band_edges, model.reference_temperature, *numbers, model.weights, model.layers)
    if (expected := _expected_numbers(model, scene)).size:
        empty.follow(expected)
    if model.optics.keep_caustic:
        empty.follow_disks()
    empty.moments = len(scene.moments)
    if film is None:
        film = empty
    film.check_same_kind(empty)
    if len(film.ranges) > 1 or film.ranges[0][:2] != empty.ranges[0][:2]:
        raise ValueError("The film does not hold the first passes of this render")
    film.correction, film.openness = settings.correction, model.openness
    film.estimated, film.expected = model.estimated, model.expected
    if scene.moments:  # at another time other pixels may show what has to be estimated
        film.estimated = np.ones_like(model.estimated)
    image = np.empty(((x1 - x0) * (y1 - y0), empty.layer_weights.size), np.float32)
    seen, missed = np.empty((2, len(image)), np.float32)
    store = photon_store(scene.band_count, model.optics)
    keep_freed_memory()
    started = time.monotonic()
    with ThreadPoolExecutor(settings.workers) as pool:
        while not (_is_complete(film, settings, time.monotonic() - started) or cancelled()):
            index = settings.pass_offset + film.passes
            present = model_of_pass(scene, settings, (model, geometry), index, cancelled)
            if present is None:
                break
            room = store if present is model else photon_store(scene.band_count, present.optics)
            if not render_pass(present, settings, index, Work(room, pool, cancelled), (image, seen, missed)):
                break
            known = _numbers_of_pass(model, scene, settings.seed, index)
            film.add_pass(image, seen, present.photons_per_pass, missed, known, disk_area(settings, index))
            if on_pass:
                on_pass(film)
    log.info("%d passes, %d photons, %.2f s", film.passes, film.photons, time.monotonic() - started)
    _log_check(film)
    if model.molecular is not None and film.passes and not cancelled():
        _log_quadrature(scene, model, film)
    return film


def _expected_numbers(model: Model, scene: Scene) -> np.ndarray:
    """(j,) mean over endless passes of _numbers_of_pass."""
    of_draws = [] if model.molecular is None else model.molecular.exact_probes(model.diameter, model.weights)
    return np.concatenate((of_draws, np.zeros(wave_count(len(scene.moments)))))


def _numbers_of_pass(model: Model, scene: Scene, seed: int, index: int) -> np.ndarray:
    """(j,) what is known of a pass and moves its picture: what it draws of spectra, and its time."""
    of_draws, moments = [], len(scene.moments)
    if model.molecular is not None:
        of_draws = model.molecular.probes(np.array([index]), model.diameter, model.weights)[0]
    of_time = waves(step_of(index, seed, moments), moments) if moments else []
    return np.concatenate((of_draws, of_time))


def model_of_pass(
    scene: Scene,
    settings: Settings,
    planned: tuple[Model, Geometry | None],
    index: int,
    cancelled: Callable[[], bool],
) -> Model | None:
    """The Model of the scene at the time of pass `index`: that by which was planned if nothing differs. None if
    cancelled. planned: this model and its geometry."""
    model, geometry = planned
    moment = scene.moments[step_of(index, settings.seed, len(scene.moments))] if scene.moments else ()
    if not moment:
        return model
    same_reference = replace(settings, reference_temperature=model.reference_temperature)
    return prepare(at_moment(scene, moment), same_reference, geometry, cancelled, model)


def _log_check(film: Film) -> None:
    """Log what the image misses where rays recall, in the region that misses most over its standard error."""
    missed, error = film.missed()
    if film.passes > 1 and error.any():
        worst = np.unravel_index(np.argmax(np.abs(missed) / np.maximum(error, 1e-300)), missed.shape)
        log.info(
            "what is recalled misses %.2g +- %.2g W m-2 sr-1 in column %d, row %d of 4 x 4 regions, "
            "the most of all over its error",
            missed[worst], error[worst], worst[1] + 1, worst[0] + 1,
        )  # fmt: skip


def _log_quadrature(scene: Scene, model: Model, film: Film) -> None:
    """Log how far the image is off because a finite number of passes stands for the spectra of gases: an error that all
    pixels share, whatever their noise."""
    _, first, stop = film.ranges[0]
    surroundings = [scene.world_temperature] if model.openness > 0.0 else []
    kelvin = np.append(scene.temperature_range, surroundings)
    sensor, passes = (scene.band_edges, model.weights), min(stop - first, _MOST_DRAWS)
    error = model.molecular.quadrature_error(first, passes, model.diameter, (kelvin.min(), kelvin.max()), sensor)
    log.info(
        "quadrature over the spectra of gases: %d passes are off by at most %.2g K on straight ways through the scene",
        passes, error,
    )  # fmt: skip


def _is_complete(film: Film, settings: Settings, seconds: float) -> bool:
    """Whether a stop condition holds after so many seconds. Never before the first pass, so that no image is empty."""
    if film.passes == 0:
        return False
    if 0 < settings.passes <= film.passes or 0 < settings.time_limit <= seconds:
        return True
    if settings.target_noise == 0 or not _is_checked(film.passes):
        return False
    return bool(np.percentile(film.noise(), 95) < settings.target_noise)


def _is_checked(passes: int) -> bool:
    """Whether the noise is checked after so many passes: first after 8, then ever more rarely, as it takes time."""
    check = 8
    while check < passes:
        check = math.ceil(1.1 * check)
    return check == passes


def disk_area(settings: Settings, index: int) -> float:
    """Area of the disks of pass `index`, in which photons are counted, over that of the first pass."""
    return shrink_factor(index) if settings.shrink else 1.0


class Work(NamedTuple):
    """What passes work with. store: room for the photons of a pass. pool: threads. cancelled: called many times in a
    pass; true means to stop."""

    store: PhotonStore
    pool: ThreadPoolExecutor
    cancelled: Callable[[], bool]


def render_pass(model: Model, settings: Settings, index: int, work: Work, rendered: tuple[np.ndarray, ...]) -> bool:
    """Render pass `index` into what render_pixels returns, here of all pixels. Returns False if the pass was
    cancelled."""
    if model.molecular is not None:
        model.tracer.fill(model.molecular.table(index))
    photons, thrown = shoot_photons(model, pass_key(settings.seed, index, PHOTONS), work)
    if work.cancelled():
        return False
    photon_map = build_photon_map(photons, model.stage.surfaces, work.pool.map)
    estimate = Estimate(
        settings.neighbours,
        few_neighbours(settings.neighbours),
        model.reach2,
        disk_area(settings, index),
        model.splitting is not None,  # known beforehand: a choice by the photons of the pass would change the mean
        model.optics.keep_incoming,
        model.splitting,
        len(model.layers),
    )
    surroundings = model.emitters.surroundings
    points = lamp_points(model.lamps, model.stage, surroundings, pass_key(settings.seed, index, LAMPS))
    lighting = Lighting(
        surroundings, model.lamps, points, model.looking, len(model.layers), hidden_from_lobes(model.tracer)
    )
    cache = None
    if estimate.photons:
        key = pass_key(settings.seed, index, CACHE)
        cache = cache_irradiance(model, photon_map, estimate, lighting, key, work)
    shared = CameraPass(
        tracer=model.tracer,
        stage=model.stage,
        lighting=lighting,
        eye=model.eye,
        samples=model.samples,
        photon_map=photon_map,
        cache=cache,
        estimate=estimate,
        keys=(pass_key(settings.seed, ALL_PASSES, CAMERA), pass_key(settings.seed, index, CAMERA)),
        index=index,
        weights=model.layer_weights.astype(np.float32).ravel(),
        thrown=map_thrown(model, thrown, estimate),
    )

    def render_tile(pixels: np.ndarray):
        if not work.cancelled():
            parts = render_pixels(shared, pixels, work.cancelled)
            for whole, part in zip(rendered, parts, strict=True):
                whole[pixels.ravel()] = part

    of_window = tiles(model.eye.window, index, shared.keys[0])
    longest_first = sorted(of_window, key=lambda pixels: -int(model.samples[pixels].sum()))
    for _ in work.pool.map(render_tile, longest_first):  # longest first, so that all threads end at about the same time
        pass
    return not work.cancelled()


def shoot_photons(model: Model, key: np.uint64, work: Work) -> tuple[Photons, Thrown]:
    """The stored Photons of a pass, in work.store, and what mirrors throw into gas. key: of the pass's photons."""
    total, traced = model.photons_per_pass, (model.tracer, model.stage, model.emitters, model.optics)
    thrown = [empty_thrown(0, model.stage.radiometry.reference.size)]

    def trace(first: int):
        left = []
        if work.cancelled():
            return [], left
        throwing = model.throwing._replace(left=left) if model.throwing else None
        batch = Batch(key, first, min(PHOTON_CHUNK, total - first), total)
        return list(trace_photons(*traced, batch, work.cancelled, thrown=throwing)), left

    work.store.clear()
    for chunk, left in work.pool.map(trace, range(0, total, PHOTON_CHUNK)):
        for hits in chunk:
            work.store.append(hits)
        thrown += left
    return work.store.photons, Thrown(*map(np.concatenate, zip(*thrown, strict=True)))


def map_thrown(model: Model, thrown: Thrown, estimate: Estimate) -> ThrownMap | None:
    """The ThrownMap of a pass; None where no gas scatters."""
    if not model.tracer.scatters:
        return None
    reach = model.throwing.reach if model.throwing else 0.0
    return build_thrown_map(thrown, estimate.neighbours, reach, estimate.shrink2)


def cache_irradiance(
    model: Model, photon_map: PhotonMap, estimate: Estimate, lighting: Lighting, key: np.uint64, work: Work
) -> IrradianceCache:
    """The IrradianceCache of a pass, for the ends of final gathers. key: of the rays whose ends are its points."""
    surfaces, tracer = model.stage.surfaces, model.tracer
    points = ray_ends(tracer, surfaces, model.visible, key, cache_points(model.photons_per_pass, estimate.shrink2))

    def look(point, side_id, first):
        direct = direct_irradiance(model.stage, tracer, lighting, (point, side_id), key, first)
        around = look_around(tracer, surfaces, model.reach2, (point, side_id), key, first)
        lamps = lamp_distances(surfaces, lighting, (point, side_id), key, first)
        return around._replace(near=np.where(lamps[:, :1] < around.near[:, :1], lamps, around.near)), direct

    return build_irradiance_cache(photon_map, surfaces, estimate, points, look, work.pool.map, work.cancelled)
