# SPDX-License-Identifier: GPL-3.0-or-later
"""From a Scene to a Model: tables, emitters, and all that is learnt before the first pass.

Each step needs the results of those before. The pilot follows grey camera paths and finds what the image can depend on.
From the pilot follows the reference temperature, and with it how much each surface emits in excess. From the emission
follow the lamps and the probabilities with which photons are emitted. A few trial photons then say how
light lies on the sheets, and a survey of the pixels says how many rays each pixel needs.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..geometry.eye import Eye, build_eye
from ..geometry.media import Atmosphere, radius_of_media
from ..geometry.see_through import with_holes
from ..geometry.segments import Tracer
from ..geometry.stage import Stage
from ..geometry.surfaces import Geometry, Surfaces, build_surfaces, sheet_count, used_materials
from ..geometry.triangles import scene_radius
from ..photons.emission import (
    Batch,
    Emitters,
    Reach,
    build_emitters,
    build_surroundings,
    fill_surroundings,
    find_emission,
)
from ..photons.irradiance_cache import VisiblePoints
from ..photons.lights import build_light_table
from ..photons.photon_map import Photons, PhotonStore
from ..photons.thrown import Throwing, choose_reach, prepare_throwing
from ..photons.transport import Optics, trace_photons
from ..physics.fresnel import FresnelTable, build_fresnel_table, in_one_band
from ..physics.heat import build_heat_table
from ..physics.layers import Layer, layer_factors, scene_layers, sky_layer, trace_apart, traced_temperature
from ..physics.lobes import FRESNEL, GLOSSY, SPECULAR, WIDE
from ..physics.media import build_medium_table
from ..physics.molecules import MolecularMedia, build_molecular_media, warn_of_temperatures
from ..physics.radiometry import (
    ALL,
    STRAIGHT,
    build_radiometry,
    emission_range,
    grey_radiometry,
    mean_transmittance,
    typical_emissivity,
)
from ..physics.sensors import band_weights
from ..physics.spectrum import faintest
from ..sampling.heuristics import Looking, typical_looking
from ..sampling.rng import PILOT, SHEETS, TRIAL, pass_key
from ..scene import MOLECULES, Scene
from ..settings import Settings
from .antialiasing import choose_samples, least_price
from .caustics import choose_caustic_lamps
from .lamps import Lamps, build_lamps
from .media import absorbed_shares, add_media
from .pilot import explore, gather_reach
from .reference import Sources, choose_reference, gather_sources, typical_source
from .sheets import Excess, Gathering, Trial, dark_sheets, measure_sheets
from .specks import what_to_expect
from .splitting import Splitting, most_rays, plan_looking, plan_splitting
from .survey import Survey, survey_pixels

log = logging.getLogger(__name__)

_PLAN_PHOTONS = 8192  # of the trial pass by which splitting is planned
_LARGEST_BALL = 1.0 / 8.0  # radius of a ball in gas, over that of the scene


@dataclass(frozen=True)
class Model:
    """A scene made ready to render.

    throwing: how photons tell what mirrors throw into gas; None if they throw nothing. samples: (pixels,) uint16,
    camera rays of each pixel in a pass. reach2: m2, squared radius of the largest disk.
    estimated: (pixels,) bool, see Survey. expected: see Film. visible: where camera paths gather. splitting: None
    without photons. looking: from each sheet. reference_temperature: K. weights: (b,) response of the sensor in each
    band. layers: temperature groups that the image keeps apart; layer_weights: (layers, b) by which the bands of each
    layer count in the sensor's signal. hits_per_photon: mean number of stored hits of a trial photon. rays_per_pixel:
    rays under way at once, in the tile where they are most. openness: share of the rays that leave the scene, of those
    from the camera or of those from what the image depends on, whichever is larger. molecular: media whose coefficients
    each pass draws, None if there are none. diameter: of the scene, in its units. worth: how many rays a shadow ray
    counts as. survey: what the moments of the scene need of it; None if it has none.
    """

    tracer: Tracer
    stage: Stage
    emitters: Emitters
    lamps: Lamps
    optics: Optics
    throwing: Throwing | None
    eye: Eye
    samples: np.ndarray
    reach2: float
    estimated: np.ndarray
    expected: np.ndarray
    visible: VisiblePoints
    splitting: Splitting | None
    looking: Looking
    reference_temperature: float
    weights: np.ndarray
    layers: tuple[Layer, ...]
    layer_weights: np.ndarray
    photons_per_pass: int
    hits_per_photon: float
    rays_per_pixel: float
    openness: float
    molecular: MolecularMedia | None
    diameter: float
    worth: float
    survey: Survey | None


def prepare(
    scene: Scene,
    settings: Settings,
    geometry: Geometry | None = None,
    cancelled: Callable[[], bool] = lambda: False,
    planned: Model | None = None,
) -> Model | None:
    """The Model of a scene, with nothing that this scene does not need; the log says what is needed. None if cancelled.

    geometry: of an earlier scene, reused if it is the same.
    planned: of a scene of which this one is a moment. Its camera rays and what it knows of the pixels and of shadow
    rays count, as all passes share one sequence of camera rays, and as to find out takes most of the time.
    """
    layers, layer = scene_layers(scene)
    surfaces, tracer, centre = build_surfaces(scene, geometry, layer)
    transmittance = mean_transmittance(scene.materials, scene.band_edges)
    rendering = with_holes(tracer, surfaces, np.floor(transmittance), certain=True)  # the tracer of passes
    tracer = with_holes(tracer, surfaces, transmittance)
    if scene.media:
        tracer = Atmosphere(tracer, scene.media, centre, scene.world_depth)
    radius = scene_radius(surfaces.corners)
    eye = build_eye(scene.camera, centre, max(radius, radius_of_media(scene.media, centre)))
    emissivity = typical_emissivity(scene.materials, scene.band_edges, surfaces.temperature)
    grey = Stage(surfaces, grey_radiometry(scene.materials, emissivity.mean(axis=1), _typical_fresnel(scene)))
    pilot = explore(grey, tracer, eye)
    sources = gather_sources(scene, surfaces, pilot, emissivity)
    if scene.media:
        if planned is None:
            warn_of_temperatures(scene.media)
            for name in tracer.flat:
                log.warning("Medium '%s': its mesh is flat, so there is no gas in it", name)
        sources = _with_media(scene, settings, sources, (tracer, surfaces, pilot), 2.0 * radius)
    reference = _reference_temperature(settings, sources)
    layers = trace_apart(layers, reference)
    weighting = typical_source(sources, scene.band_edges, reference)
    stage = _build_stage(scene, grey, layers, reference, weighting)
    emission = find_emission(stage)
    lit = float(np.sum(pilot.importance * emission.exitance[pilot.met], where=pilot.met >= 0))
    caustic = choose_caustic_lamps(surfaces, emission.power, pilot, lit)
    sky = sky_layer(scene, layers)
    kelvin = layers[sky].traced if sky else scene.world_temperature
    surroundings = build_surroundings(scene, stage, pilot.open, sky, kelvin)
    lights = build_light_table(scene.lights, scene.band_edges, centre, radius)
    reach = Reach(pilot.reachable, pilot.weight, pilot.arrival, pilot.extent, pilot.openness)
    worth = None if planned is None else planned.worth
    lamps, worth = build_lamps(stage, tracer, pilot, emission, (lights, surroundings), caustic, worth)
    molecular = None
    if scene.media:
        radiometry = stage.radiometry
        table = build_medium_table(scene.media, scene.band_edges, radiometry.quiet, radiometry.reference)
        molecular = build_molecular_media(scene.media, table, scene.band_edges, weighting, settings.seed)
        heat = build_heat_table(scene.media, scene.band_edges, radiometry.quiet, radiometry.reference)
        tracer.fill(table if molecular is None else molecular.typical_table(2.0 * radius), heat)
        reach = reach._replace(arrival=pilot.weight, openness=1.0)  # from media light arrives everywhere
        outlines = [medium.outline - centre for medium in scene.media if medium.outline is not None]
        surroundings = fill_surroundings(surroundings, tracer, stage, lights, reach, lamps, outlines)
    emitters = build_emitters(stage, surroundings, lights, reach, emission, lamps)
    optics, storing = _choose_optics(scene, settings, stage, lamps, len(layers))
    throws = optics.keep_caustic and len(scene.lights) > 0 and tracer.scatters
    throwing = prepare_throwing(surfaces, radius, scene.media, centre) if throws else None
    photons = settings.photons_per_pass if emitters.light_end[-1] > 0.0 and (storing or throws) else 0
    reach2 = gather_reach(pilot, settings.photons_per_pass, settings.neighbours)
    gathering = Gathering(reach2, settings.neighbours, photons)
    if planned is None:
        _log_needs(scene, stage, reference if settings.reference_subtraction else None, photons)
    if cancelled():
        return None
    excess, sheets, hits = Excess(surroundings, lamps), dark_sheets(sheet_count(surfaces)), 0.0
    if photons:
        trial = trial_pass(tracer, stage, emitters, optics, cancelled, throwing)
        hits = len(trial.side_id) / trial.photons
        if throwing:
            hits += sum(len(each.straight) for each in throwing.left) / trial.photons
            k, share = settings.neighbours, trial.photons / photons
            throwing = throwing._replace(reach=choose_reach(throwing.left, k, share, _LARGEST_BALL * radius), left=[])
        sheets = measure_sheets(stage, tracer, excess, pilot, trial, gathering, pass_key(0, SHEETS, PILOT))
    if planned is not None and _alike(planned, surfaces, photons):
        survey = planned.survey
    else:
        survey = survey_pixels(stage, tracer, excess, sheets, eye, scene.band_edges, settings.workers, cancelled)
    if cancelled():
        return None
    splitting = plan_splitting(sheets, survey, reach2, settings.neighbours, photons) if photons else None
    looking = (
        plan_looking(splitting, reach2, settings.neighbours) if splitting else typical_looking(sheet_count(surfaces))
    )
    if planned is None:
        price = max(splitting.price if splitting else 0.0, least_price(survey.variance, survey.in_fog))
        samples = choose_samples(survey.variance, survey.unknown, price, survey.in_fog)
        log.info("%.1f camera rays a pixel and pass", samples.mean())
    else:
        samples = planned.samples
    weights = band_weights(scene.response, scene.band_edges)
    rays = most_rays(splitting, samples, survey.unknown, reach2, settings.neighbours) if splitting else samples.max()
    return Model(
        tracer=tracer.between(rendering) if scene.media else rendering,
        stage=stage,
        emitters=emitters,
        lamps=lamps,
        optics=optics,
        throwing=throwing,
        eye=eye,
        samples=samples,
        reach2=reach2,
        estimated=survey.estimated,
        expected=what_to_expect(survey.specks, survey.own, samples, weights),
        visible=VisiblePoints(pilot.point, pilot.normal, pilot.side_id, np.cumsum(pilot.throughput)),
        splitting=splitting,
        looking=looking,
        reference_temperature=reference,
        weights=weights,
        layers=layers,
        layer_weights=layer_factors(layers, scene.band_edges, reference) * weights,
        photons_per_pass=photons,
        hits_per_photon=hits,
        rays_per_pixel=float(rays),
        openness=max(pilot.openness, pilot.background),
        molecular=molecular,
        diameter=2.0 * radius,
        worth=worth,
        survey=survey if scene.moments else None,
    )


def _alike(planned: Model, surfaces: Surfaces, photons: int) -> bool:
    """Whether a survey holds for surfaces at another time: its cells are those of sheets, and of photons."""
    same_sheets = np.array_equal(planned.stage.surfaces.sheet, surfaces.sheet)
    return same_sheets and (planned.photons_per_pass > 0) == (photons > 0)


def _typical_fresnel(scene: Scene) -> FresnelTable:
    """The FresnelTable for the pilot: means over the bands, in the light of a blackbody as warm as the surfaces."""
    mean = float(np.mean(scene.temperature, dtype=np.float64))
    kelvin = max(mean, faintest(float(scene.band_edges[0])))
    return in_one_band(build_fresnel_table(scene.materials, scene.band_edges, (kelvin, kelvin), kelvin, 0.0))


def _with_media(scene: Scene, settings: Settings, sources: Sources, seen: tuple, length: float) -> Sources:
    """The Sources of a scene with media. seen: tracer, surfaces and pilot. length: m, typical way through media.

    The table of molecules here is not that of the passes: at which wavenumbers these draw depends on what lights the
    scene, and that on what media take. It costs a few hundredths of a second.
    """
    edges, nothing = scene.band_edges, np.zeros(scene.band_count)
    table = build_medium_table(scene.media, edges, 0.0, nothing)
    weighting = typical_source(sources, edges, _reference_temperature(settings, sources))
    molecular = build_molecular_media(scene.media, table, edges, weighting, settings.seed)
    table = table if molecular is None else molecular.typical_table(length)
    seen[0].fill(table)
    return add_media(sources, scene.media, absorbed_shares(*seen, scene.media, table.absorption), edges)


def _reference_temperature(settings: Settings, sources: Sources) -> float:
    """T0 in K, 0 for none. In float32, as surfaces' temperatures are, so that surfaces at T0 emit no photons at all."""
    if not settings.reference_subtraction:
        return 0.0
    given = settings.reference_temperature
    return float(np.float32(choose_reference(sources) if given is None else given))


def _build_stage(scene: Scene, grey: Stage, layers: tuple[Layer, ...], reference: float, weighting: float) -> Stage:
    """The stage of the passes: surfaces at the temperatures at which their layers are traced, and tables in all bands.

    grey: the stage of the pilot, with the same surfaces. reference: T0, K. weighting: K, temperature of what lights the
    surfaces.
    """
    surfaces = grey.surfaces
    temperature = traced_temperature(surfaces.temperature, surfaces.layer, layers)
    span = emission_range(temperature, scene.images_of_temperature)
    radiometry = build_radiometry(scene.materials, scene.band_edges, span, weighting, reference)
    return Stage(surfaces._replace(temperature=temperature), radiometry)


def _choose_optics(scene: Scene, settings: Settings, stage: Stage, lamps: Lamps, layers: int) -> tuple[Optics, bool]:
    """The Optics of a scene, and whether any hit stores a photon."""
    used = used_materials(stage.surfaces)
    flags = stage.radiometry.lobes.flags[used]
    throws = (flags & SPECULAR > 0) | (flags & (GLOSSY | WIDE) == GLOSSY)
    caustic = bool(lamps.caustic.any() or len(scene.lights)) and bool(np.any(throws))
    straight = bool(np.any(flags & GLOSSY)) and len(scene.lights) > 0  # by way of a mirror; shadow rays find the rest
    stored = stage.radiometry.stores[used]
    widths = np.diff(scene.band_edges)
    optics = Optics(
        (widths / widths.sum()).astype(np.float32), settings.roulette == "POWER", straight, caustic, layers > 1
    )
    return optics, bool(np.any(stored == ALL) or (straight and np.any(stored == STRAIGHT)))


def _log_needs(scene: Scene, stage: Stage, reference: float | None, photons: int) -> None:
    """Log what this scene needs. reference: K, None for no subtraction. photons: of a pass."""
    used = used_materials(stage.surfaces)
    flags = np.bitwise_or.reduce(stage.radiometry.lobes.flags[used])
    log.info(
        "%d triangles, %d bands, %d materials (%s), %d lights, reference temperature %s, %s",
        len(stage.surfaces.material),
        scene.band_count,
        len(used),
        ("rough specular" if flags & GLOSSY else "specular" if flags & SPECULAR else "diffuse")
        + (" with Fresnel's law" if flags & FRESNEL else ""),
        len(scene.lights),
        "off" if reference is None else f"{reference:g} K",
        f"{photons} photons a pass"
        if photons
        else "no photons needed: nothing differs from the reference or nothing reflects diffusely",
    )
    if scene.media:
        molecules = [name for name in MOLECULES if any(name in medium.molecules for medium in scene.media)]
        log.info(
            "%d media with gas, of which %d scatter, %s",
            len(scene.media),
            sum(medium.scatters for medium in scene.media),
            f"lines of {', '.join(molecules)}" if molecules else "no molecules",
        )


def photon_store(bands: int, optics: Optics) -> PhotonStore:
    """Room for the photons of a pass."""
    return PhotonStore(bands, optics.keep_incoming, optics.keep_caustic, optics.keep_layer)


def trial_pass(
    tracer: Tracer,
    stage: Stage,
    emitters: Emitters,
    optics: Optics,
    cancelled: Callable[[], bool],
    throwing: Throwing | None,
) -> Trial:
    """The Trial by which splitting is planned: what a pass of _PLAN_PHOTONS stores. throwing: see trace_photons."""

    def told(hits: Photons):
        caustic = hits.caustic if optics.keep_caustic else np.zeros(len(hits.surface), np.bool_)
        return hits.position, hits.surface, hits.power.sum(axis=1, dtype=np.float64), caustic

    count = _PLAN_PHOTONS
    batch = Batch(pass_key(0, 0, TRIAL), 0, count, count)
    nothing = photon_store(stage.radiometry.reference.size, optics).photons
    batches = trace_photons(tracer, stage, emitters, optics, batch, cancelled, thrown=throwing)
    parts = zip(*map(told, itertools.chain([nothing], batches)), strict=True)
    return Trial(count, *map(np.concatenate, parts))
