# SPDX-License-Identifier: GPL-3.0-or-later
"""The pass loop of multi-pass spectral photon mapping (Boudet et al. 2004, section 4).

look at the scene: what can matter, reference temperature, tables, emitters
for every pass:
    emit photons, trace them, store their hits          (emission, transport)
    sort them into a photon map                         (photon_map)
    estimate the irradiance at some points              (irradiance_cache)
    follow camera paths and gather photons at their ends (eye_paths)
    add the image to the running mean                   (film)
"""

from __future__ import annotations

import itertools
import logging
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from .camera.eye_paths import Estimate, render_pixels
from .camera.lamps import Lamps, build_lamps, choose_lamps, lamp_points
from .geometry.eye import Eye, build_eye
from .geometry.free_space import free_space
from .geometry.surfaces import Geometry, Surfaces, Tracer, areas, build_surfaces, scene_radius, sheet_count
from .image.film import Film
from .image.tiles import tiles
from .memory import check_memory, keep_freed_memory, memory_beforehand, memory_of_passes
from .photons.emission import Emitters, build_emitters, chosen_numbers, side_power
from .photons.guide import GatherPlaces, add_scores, build_gather_places, build_guide
from .photons.irradiance_cache import IrradianceCache, Places, build_irradiance_cache, cache_points, ray_ends
from .photons.photon_map import PhotonMap, Photons, PhotonStore, build_photon_map
from .photons.transport import Optics, trace_photons
from .physics.layers import Layer, layer_factors, scene_layers, sky_layer, trace_apart, traced_temperature
from .physics.radiometry import ALL, STRAIGHT, Radiometry, build_radiometry, emission_range, typical_emissivity
from .physics.sensors import band_weights
from .planning.antialiasing import choose_samples, least_price
from .planning.pilot import explore, gather_reach
from .planning.reference import Sources, choose_reference, gather_sources, typical_source
from .planning.sheets import Trial, dark_sheets, measure_sheets
from .planning.splitting import Splitting, most_rays, plan_splitting
from .planning.survey import look_at_pixels
from .sampling.rng import CACHE, CAMERA, LAMPS, PHOTONS, PILOT, TRIAL, pass_key, uniforms
from .scene import Scene
from .settings import Settings

log = logging.getLogger(__name__)

# Work is cut into pieces of fixed size, whatever the number of threads, so that results never depend on it.
PHOTON_CHUNK = 16384  # photons: a wave of 16 bands stays within the second-level cache
_RADIUS_ALPHA = 2.0 / 3.0  # Knaus and Zwicker 2011: variance falls as m^-a, squared bias as m^-2(1-a)
_TRIAL_PHOTONS = (1024, 8192, 16384, 65536)  # a glance says whether a guide would help
_KNOWN = 512  # photons that mattered, after which no larger trial is made
_PLAN_PHOTONS = 8192
_ENOUGH = 0.15  # share of photons that matter above which unequal weights would cost more than a guide brings
_WORTHWHILE = 1.2  # reduction of the noise for which a guide is kept and refined
_ALL_PIXELS = 2**32 - 1  # in place of a pass index: the camera's sequence that all passes share


@dataclass(frozen=True)
class Model:
    """A scene made ready to render."""

    surfaces: Surfaces
    tracer: Tracer
    radiometry: Radiometry
    emitters: Emitters
    lamps: Lamps
    optics: Optics
    eye: Eye
    samples: np.ndarray  # rays of every pixel in a pass
    reach2: float
    places: Places  # where camera paths gather
    splitting: Splitting | None  # None without photons
    reference_temperature: float
    weights: np.ndarray  # (b,) response of the sensor in each band
    layers: tuple[Layer, ...]  # temperature groups that the image keeps apart
    layer_weights: np.ndarray  # (layers, b) by which their bands count in what the sensor sees
    photons_per_pass: int
    hits_per_photon: float  # that are stored, of trial photons
    rays_per_pixel: float  # that are under way at once, where most are


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
    cancelled is asked many times a pass, and before the first one; once it is true the unfinished pass is dropped and
    the film returned.
    film: of the first passes of this render, to which the others are added: the result is that of a render without a
    break. Only the time limit does not count what it took.
    image_copies: float32 copies of all images that the caller holds, which need memory too.
    geometry: of an earlier scene, kept if it is the same (see build_geometry); the image is the same either way.
    Raises SceneError if the scene cannot be rendered or needs more memory than there is, ValueError if the film is not
    of this render.
    """
    check_memory(memory_beforehand(scene, image_copies))
    model = prepare(scene, settings, geometry, cancelled)
    x0, y0, x1, y1 = scene.camera.pixels
    size, numbers = (x1 - x0, y1 - y0), (settings.seed, settings.pass_offset)
    if model is None:
        return Film(*size, scene.band_edges, 0.0, *numbers) if film is None else film
    check_memory(memory_of_passes(scene, settings, image_copies, model.hits_per_photon, model.rays_per_pixel))
    empty = Film(*size, scene.band_edges, model.reference_temperature, *numbers, model.weights, model.layers)
    if film is None:
        film = empty
    film.check_same_kind(empty)
    if len(film.ranges) > 1 or film.ranges[0][:2] != empty.ranges[0][:2]:
        raise ValueError("The film does not hold the first passes of this render")
    film.correction = settings.correction
    image = np.empty(((x1 - x0) * (y1 - y0), empty.layer_weights.size), np.float32)
    seen = np.empty(len(image), np.float32)
    store = photon_store(scene.band_count, model.optics)
    keep_freed_memory()
    started = time.monotonic()
    with ThreadPoolExecutor(settings.workers) as pool:
        while not (_is_complete(film, settings, time.monotonic() - started) or cancelled()):
            if not render_pass(
                model, settings, settings.pass_offset + film.passes, store, image, seen, pool, cancelled
            ):
                break
            film.add_pass(image, seen, model.photons_per_pass)
            if on_pass:
                on_pass(film)
    log.info("%d passes, %d photons, %.2f s", film.passes, film.photons, time.monotonic() - started)
    return film


def _is_complete(film: Film, settings: Settings, seconds: float) -> bool:
    """Whether a stop condition holds after so many seconds. No image is empty: the first pass has to be there."""
    if film.passes == 0:
        return False
    if 0 < settings.passes <= film.passes or 0 < settings.time_limit <= seconds:
        return True
    if settings.target_noise == 0 or not _is_checked(film.passes):
        return False
    return bool(np.percentile(film.noise(), 95) < settings.target_noise)


def _is_checked(passes: int) -> bool:
    """Whether the noise is looked at after so many passes: 8, and then ever more rarely, as a look takes time."""
    check = 8
    while check < passes:
        check = math.ceil(1.1 * check)
    return check == passes


def prepare(
    scene: Scene,
    settings: Settings,
    geometry: Geometry | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Model | None:
    """Build what the passes need, and only what this scene needs; the log says what that is. None if it was cancelled.

    geometry: of an earlier scene, kept if it is the same.
    """
    layers, layer = scene_layers(scene)
    surfaces, tracer, centre = build_surfaces(scene, geometry, layer)
    eye = build_eye(scene.camera, centre, scene_radius(surfaces.corners))
    emissivity = typical_emissivity(scene.materials, scene.band_edges, surfaces.temperature)
    specular = np.array([material.specular for material in scene.materials])
    is_mirror = np.array([material.alpha == 0.0 for material in scene.materials])
    area = areas(surfaces.corners)
    pilot = explore(surfaces, tracer, eye, 1.0 - emissivity.mean(axis=1), specular, is_mirror, area)
    sources = gather_sources(scene, surfaces, pilot, emissivity)
    reference = _reference_temperature(settings, sources)
    weighting = typical_source(sources, scene.band_edges, reference)
    layers = trace_apart(layers, reference)
    surfaces = surfaces._replace(temperature=traced_temperature(surfaces.temperature, surfaces.layer, layers))
    sky = sky_layer(scene, layers)
    radiometry = build_radiometry(
        scene.materials, scene.band_edges, emission_range(surfaces.temperature), weighting, reference
    )
    power = side_power(surfaces, radiometry, area)
    lit = float(np.sum(pilot.importance * power / area))
    lamp = choose_lamps(
        surfaces, tracer, power, pilot.matters, pilot.place, pilot.facing, pilot.code, lit, pass_key(0, 12, PILOT)
    )
    emitters = build_emitters(
        scene, surfaces, radiometry, centre, pilot.matters, pilot.weight, pilot.arrival, pilot.openness, area, power,
        lamp, pilot.open, layers[sky].traced if sky else scene.world_temperature, sky,
    )  # fmt: skip
    lamps = build_lamps(emitters, surfaces, power, lamp)
    reach2 = gather_reach(area, pilot, settings.photons_per_pass, settings.neighbours)
    optics, storing = _choose_optics(scene, settings, surfaces, radiometry, lamps, len(layers))
    photons = settings.photons_per_pass if emitters.cumulative[-1] > 0.0 and storing else 0
    _log_needs(scene, surfaces, radiometry, reference if settings.reference_subtraction else None, photons)
    if cancelled():
        return None
    if photons and len(pilot.place):
        gathers = build_gather_places(pilot.place, pilot.facing, reach2)
        emitters = learn_guide(tracer, surfaces, radiometry, emitters, optics, gathers, cancelled)
    sheets, hits = dark_sheets(sheet_count(surfaces)), 0.0
    if photons:
        trial = trial_pass(tracer, surfaces, radiometry, emitters, optics, cancelled)
        hits = len(trial.code) / trial.photons
        sheets = measure_sheets(
            surfaces, tracer, radiometry, emitters.surroundings, lamps.shines, pilot, trial, area, reach2,
            settings.neighbours, photons, pass_key(0, 11, PILOT),
        )  # fmt: skip
    looks = look_at_pixels(
        surfaces, tracer, radiometry, emitters.surroundings, lamps.shines, emitters.open, sheets, eye, scene.band_edges,
        pass_key(0, 10, PILOT), settings.workers, cancelled,
    )  # fmt: skip
    if cancelled():
        return None
    splitting = plan_splitting(sheets, looks, reach2, settings.neighbours, photons) if photons else None
    price = max(splitting.price if splitting else 0.0, least_price(looks.variance))
    samples = choose_samples(looks.variance, looks.unknown, price)
    log.info("%.1f camera rays a pixel and pass", samples.mean())
    weights = band_weights(scene.response, scene.band_edges)
    return Model(
        surfaces=surfaces,
        tracer=tracer,
        radiometry=radiometry,
        emitters=emitters,
        lamps=lamps,
        optics=optics,
        eye=eye,
        samples=samples,
        reach2=reach2,
        places=Places(pilot.place, pilot.facing, pilot.code, np.cumsum(pilot.carried)),
        splitting=splitting,
        reference_temperature=reference,
        weights=weights,
        layers=layers,
        layer_weights=layer_factors(layers, scene.band_edges, reference) * weights,
        photons_per_pass=photons,
        hits_per_photon=hits,
        rays_per_pixel=most_rays(splitting, samples, looks.unknown, reach2, settings.neighbours)
        if splitting
        else float(samples.max()),
    )


def _reference_temperature(settings: Settings, sources: Sources) -> float:
    """T0 in K, 0 for none; in float32 as surfaces' temperatures are, so that those that equal it emit no photons."""
    if not settings.reference_subtraction:
        return 0.0
    given = settings.reference_temperature
    return float(np.float32(choose_reference(sources) if given is None else given))


def _choose_optics(
    scene: Scene, settings: Settings, surfaces: Surfaces, radiometry: Radiometry, lamps: Lamps, layers: int
) -> tuple[Optics, bool]:
    """What hits of photons need, and whether any hit stores one."""
    used = np.unique(surfaces.material)
    rough = bool(np.any(radiometry.alpha[used] > 0))
    caustic = lamps.power > 0 and bool(np.any(radiometry.specular[used] > 0))
    straight = rough and len(scene.lights) > 0  # by way of a mirror; shadow rays bring the rest
    stored = radiometry.stores[used]
    widths = np.diff(scene.band_edges)
    optics = Optics(
        (widths / widths.sum()).astype(np.float32), settings.roulette == "POWER", straight, caustic, layers > 1
    )
    return optics, bool(np.any(stored == ALL) or (straight and np.any(stored == STRAIGHT)))


def _log_needs(scene: Scene, surfaces: Surfaces, radiometry: Radiometry, reference: float | None, photons: int) -> None:
    """Tell what this scene needs. reference: K, None for no subtraction. photons: of a pass."""
    used = np.unique(surfaces.material)
    rough, specular = (bool(np.any(of[used] > 0)) for of in (radiometry.alpha, radiometry.specular))
    log.info(
        "%d triangles, %d bands, %d materials (%s), %d lights, reference temperature %s, %s",
        len(surfaces.corners),
        scene.band_count,
        len(used),
        "rough specular" if rough else "specular" if specular else "diffuse",
        len(scene.lights),
        "off" if reference is None else f"{reference:g} K",
        f"{photons} photons a pass"
        if photons
        else "no photons needed: nothing differs from the reference or nothing reflects diffusely",
    )


def photon_store(bands: int, optics: Optics) -> PhotonStore:
    """Room for the photons of a pass."""
    return PhotonStore(bands, optics.keep_incoming, optics.keep_caustic, optics.keep_layer)


def trial_pass(
    tracer: Tracer,
    surfaces: Surfaces,
    radiometry: Radiometry,
    emitters: Emitters,
    optics: Optics,
    cancelled: Callable[[], bool],
) -> Trial:
    """What a pass of _PLAN_PHOTONS stores, to plan splitting by."""

    def told(hits: Photons):
        caustic = hits.caustic if optics.keep_caustic else np.zeros(len(hits.surface), np.bool_)
        return hits.position, hits.surface, hits.power.sum(axis=1, dtype=np.float64), caustic

    key, count = pass_key(0, len(_TRIAL_PHOTONS), TRIAL), _PLAN_PHOTONS
    nothing = photon_store(radiometry.reference.size, optics).photons
    batches = trace_photons(tracer, surfaces, radiometry, emitters, optics, key, 0, count, count, cancelled)
    parts = zip(*map(told, itertools.chain([nothing], batches)), strict=True)
    return Trial(count, *map(np.concatenate, parts))


def learn_guide(
    tracer: Tracer,
    surfaces: Surfaces,
    radiometry: Radiometry,
    emitters: Emitters,
    optics: Optics,
    gathers: GatherPlaces,
    cancelled: Callable[[], bool],
) -> Emitters:
    """The emitters with a guide towards what the image gathers, if photons of a few trial passes say that it helps."""
    for trial, count in enumerate(_TRIAL_PHOTONS):
        key = pass_key(0, trial, TRIAL)
        score = np.zeros(count)

        def add(triangle, u, v, wave, score=score):
            add_scores(gathers, surfaces, radiometry, triangle, u, v, wave, score)

        for _ in trace_photons(tracer, surfaces, radiometry, emitters, optics, key, 0, count, count, cancelled, add):
            pass  # what they store is of no use
        numbers, density = chosen_numbers(emitters.guide, key, count)
        guide, gain = build_guide(numbers, score * density * count, density)
        mattered = np.count_nonzero(score)
        log.info(
            "%d of %d trial photons matter to the image; guide of %d cells, gain %.2f",
            mattered, count, len(guide.density), gain,
        )  # fmt: skip
        if mattered > _ENOUGH * count:
            break
        if gain >= _WORTHWHILE:
            emitters = emitters._replace(guide=guide)
        if mattered > _KNOWN:
            break
    return emitters


def shrink_factor(index: int) -> float:
    """r^2 of pass `index` (from 0) over that of the first: the product of (i + a) / (i + 1) for i = 1 .. index."""
    a = _RADIUS_ALPHA
    return math.exp(math.lgamma(index + 1 + a) - math.lgamma(1 + a) - math.lgamma(index + 2))


def render_pass(
    model: Model,
    settings: Settings,
    index: int,
    store: PhotonStore,
    image: np.ndarray,
    seen: np.ndarray,
    pool: ThreadPoolExecutor,
    cancelled: Callable[[], bool],
) -> bool:
    """Render pass `index` into image (pixels, layers * b) float32, with store as room; False if it was cancelled on the
    way."""
    m = model
    total = m.photons_per_pass
    photon_key = pass_key(settings.seed, index, PHOTONS)

    def trace(first: int):
        if cancelled():
            return []
        count = min(PHOTON_CHUNK, total - first)
        return list(
            trace_photons(
                m.tracer, m.surfaces, m.radiometry, m.emitters, m.optics, photon_key, first, count, total, cancelled
            )
        )

    store.clear()
    for chunk in pool.map(trace, range(0, total, PHOTON_CHUNK)):
        for batch in chunk:
            store.append(batch)
    if cancelled():
        return False
    photon_map = build_photon_map(store.photons, m.surfaces, pool.map)
    estimate = Estimate(
        settings.neighbours,
        m.reach2,
        shrink_factor(index) if settings.shrink else 1.0,
        m.splitting is not None,  # planned before: what depends on the photons of the pass would change the mean
        m.optics.keep_incoming,
        m.splitting,
        len(m.layers),
    )
    cache = None
    if estimate.photons:
        cache = cache_irradiance(m, photon_map, estimate, pass_key(settings.seed, index, CACHE), pool, cancelled)
    shining = lamp_points(m.lamps, m.surfaces, pass_key(settings.seed, index, LAMPS))
    weights = m.layer_weights.astype(np.float32).ravel()
    keys = (pass_key(settings.seed, _ALL_PIXELS, CAMERA), pass_key(settings.seed, index, CAMERA))

    def gather(pixels: np.ndarray):
        if not cancelled():
            image[pixels.ravel()], seen[pixels.ravel()] = render_pixels(
                m.tracer, m.surfaces, m.radiometry, m.emitters, m.lamps, shining, m.eye, m.samples, photon_map, cache,
                estimate, keys, index, pixels, weights, cancelled,
            )  # fmt: skip

    longest_first = sorted(tiles(m.eye.window, index, keys[0]), key=lambda pixels: -int(m.samples[pixels].sum()))
    for _ in pool.map(gather, longest_first):  # so that threads end together
        pass
    return not cancelled()


def cache_irradiance(
    m: Model,
    photon_map: PhotonMap,
    estimate: Estimate,
    key: np.uint64,
    pool: ThreadPoolExecutor,
    cancelled: Callable[[], bool],
) -> IrradianceCache:
    """What the ends of final gathers will ask for in this pass. key: of the rays that say where."""
    total = cache_points(m.photons_per_pass, estimate.shrink2)
    place, code = ray_ends(m.tracer, m.surfaces, m.places, key, total)

    def feel(place, code, first):
        return free_space(
            m.tracer, m.surfaces, m.reach2, place.astype(np.float64), code, uniforms(key, first, len(code))
        )

    return build_irradiance_cache(photon_map, m.surfaces, estimate, place, code, feel, pool.map, cancelled)
