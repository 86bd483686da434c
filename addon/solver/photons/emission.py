# SPDX-License-Identifier: GPL-3.0-or-later
"""Emission: photons leave surfaces, surroundings and lights, each class in proportion to its excess power."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import LEAST_COSINE, emit_at, emit_towards, leave
from ..geometry.segments import Tracer
from ..geometry.stage import Stage, emission_at, fill_emission, layer_at, nothing_emitted
from ..geometry.surfaces import sheet_count, sheet_of, unit_normal
from ..geometry.textures import row_of
from ..geometry.triangles import area_of
from ..physics.radiometry import absolute_sum
from ..physics.sky import (
    SkyCells,
    build_sky_cells,
    build_sky_table,
    choose_direction,
    density_towards,
    mean_excess,
    no_sky_cells,
    radiance_from,
)
from ..physics.spectrum import band_radiance
from ..sampling.rng import AFAR, PILOT, pass_key, path_key, uniform
from ..sampling.vectors import dot, put_vector
from ..sampling.warps import cosine_direction, to_world, triangle_point
from ..scene import Scene
from ..system.kernels import FAST_INLINED, FAST_KERNEL, INLINED, KERNEL, njit
from .cells import EmissionCells, build_cells, choose_point, no_cells
from .lights import SUN, LightTable, light_ray, light_totals, no_lights
from .side_table import SideTable, build_side_table, first_found, found_from, number_in
from .walk import collect
from .wave import CAUSTIC, EITHER, FORWARDS, FROM_SUN, OF_LIGHT, STRAIGHT_FROM_LIGHT, empty_wave

# Where the scene seems closed: photons from the surroundings, over all other photons.
_SKY_DEFENSIVE = 1.0 / 64.0
_AFAR = 4096  # photons that tell how much arrives from media and surroundings
_LINES = 64  # through each medium, at most, that tell the same of small ones
_GOLDEN, _PLASTIC = 0.6180339887498949, 0.7548776662466927  # whose multiples are even in 0..1; and its square, both
# Most photons from surfaces that seem out of the image's reach, over all other photons. A furnace that is closed has so
# much power that it would take nearly all photons even with the small chance that such surfaces have.
_HIDDEN = 1.0 / 16.0


class Batch(NamedTuple):
    """Photons number first to first + count - 1 of the `total` photons of a pass. key: of the pass's photons."""

    key: np.uint64
    first: int
    count: int
    total: int


class Surroundings(NamedTuple):
    """What rays that leave the scene see.

    radiance: (b,) float64, excess radiance, W m-2 sr-1; the mean of a sky that depends on the direction. sky: (rows,
    columns, b) float64, that of such a sky, see build_sky_table; else (0, 0, b). sent: (b,) float64, radiance with
    which photons start; 1 where there are media, as only their segment tells what photons bring; (0,) of a sky, whose
    photons bring what it has in their direction. cells: directions in which shadow rays and photons look for a sky of
    which a small part is bright. flux: W m-2, what typically arrives on a surface from directions in which it sees
    surroundings. layer: of the image, to which this radiance adds (see layers). open: (labels,) bool, sheets from
    which shadow rays are sent to the surroundings, so that photons that come from there are not stored there.
    """

    radiance: np.ndarray
    sky: np.ndarray
    sent: np.ndarray
    cells: SkyCells
    flux: float
    layer: int
    open: np.ndarray


class Reach(NamedTuple):
    """What the image can depend on, as far as the pilot knows, by label of the sheet; see Pilot.

    reachable: (labels,) bool, sheets that the image can depend on. weight: (labels,) float64, factor on the probability
    that a sheet emits. arrival: (labels,) float64, factor on the probability that photons from the surroundings arrive
    on a sheet. extent: (labels,) float64, m2. openness: share of the directions from reachable sides that leave the
    scene, 0..1.
    """

    reachable: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    extent: np.ndarray
    openness: float


class Emission(NamedTuple):
    """What surfaces emit.

    exitance: (t,) float32, |excess| of all bands that each m2 of either side of a triangle emits, W m-2. power:
    (labels,) float64, that of each sheet, W. cells: of the triangles over which it varies by textures.
    """

    exitance: np.ndarray
    power: np.ndarray
    cells: EmissionCells


class Emitters(NamedTuple):
    """Everything that emits, as entries of one discrete distribution: surface sides, surroundings, lights.

    surface: sides that emit. sky: sides on which photons from the surroundings arrive. light_end: (l + 1,) float64, sum
        of the weights of all sides and of the lights before each; last of all that emits, 0 where nothing does.
    caustic: (labels,) bool, whether photons find the caustics of a sheet. aimed: (labels,) float64, W-1, lamp
        points that compete for a shadow ray on a side, in the mean, over what it emits. aimed_afar: see Lamps.
    cells: where photons start on sides that vary by textures. surroundings: see Surroundings. lights: see LightTable.
        Lights add to the first layer.
    """

    surface: SideTable
    sky: SideTable
    light_end: np.ndarray
    caustic: np.ndarray
    aimed: np.ndarray
    aimed_afar: float
    cells: EmissionCells
    surroundings: Surroundings
    lights: LightTable


def find_emission(stage: Stage) -> Emission:
    """The Emission of a stage. What varies over a triangle other than by textures is the mean over corners and
    centre."""
    surfaces, cells = stage.surfaces, build_cells(stage)
    exitance, power = np.empty(len(surfaces.sheet), np.float32), np.zeros(sheet_count(surfaces))
    _fill_exitance(stage, np.empty(stage.radiometry.reference.size), exitance)
    if len(cells.edge):
        varies = np.flatnonzero((cells.row >= 0) & (cells.edge[cells.row] > 0))
        exitance[varies] = math.pi * cells.mean[cells.row[varies]]
    _add_power(surfaces, exitance, power)
    return Emission(exitance, power, cells)


@njit(**KERNEL)
def _fill_exitance(stage, value, exitance):
    """Fill exitance (t,). value: room for (b,) float64."""
    surfaces = stage.surfaces
    samples = 4 if surfaces.temperature.shape[1] == 3 else 1
    before, total = -1, 0.0  # the triangle whose emission in all bands is known, and that emission
    for t in range(exitance.size):
        if before < 0 or samples > 1 or not _emit_alike(surfaces, before, t):
            total = 0.0
            for sample in range(samples):
                u = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 2 else 0.0)
                v = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 3 else 0.0)
                fill_emission(stage, emit_at(surfaces, 2 * t, u, v, 2.0 / 3.0), value)
                total += absolute_sum(value)
            before = t
        exitance[t] = math.pi * total / samples


@njit(**INLINED)
def _emit_alike(surfaces, s, t):
    """Whether two triangles of one temperature each surely emit the same: neighbours in a mesh mostly do."""
    textures = surfaces.textures
    same = surfaces.material[s] == surfaces.material[t] and surfaces.temperature[s, 0] == surfaces.temperature[t, 0]
    return same and row_of(textures, s) < 0 and row_of(textures, t) < 0


@njit(**KERNEL)
def _add_power(surfaces, exitance, power):
    """Add to power (labels,) what both sides of all triangles emit, W."""
    for t in range(exitance.size):
        if exitance[t] > 0.0:
            for side in range(2):
                power[surfaces.sheet[t, side]] += area_of(surfaces.corners, t) * exitance[t]


def build_surroundings(scene: Scene, stage: Stage, is_open: np.ndarray, layer: int, kelvin: float) -> Surroundings:
    """The Surroundings of a scene. is_open, layer: see there. kelvin: the temperature at which they are traced, K."""
    reference = stage.radiometry.reference
    sky, radiance = build_sky_table(scene.sky, scene.band_edges, reference), np.zeros_like(reference)
    if sky.size:
        flux = math.pi * float(mean_excess(np.abs(sky)).sum())
        return Surroundings(mean_excess(sky), sky, np.empty(0), build_sky_cells(sky), flux, layer, is_open)
    if kelvin != stage.radiometry.quiet:  # else photons would carry the rounding of the reference and nothing else
        radiance = band_radiance(scene.band_edges, kelvin) - reference
    flux = math.pi * float(np.abs(radiance).sum())
    return Surroundings(radiance, sky, radiance, no_sky_cells(), flux, layer, is_open)


def fill_surroundings(
    surroundings: Surroundings,
    tracer: Tracer,
    stage: Stage,
    lights: LightTable,
    reach: Reach,
    lamps,
    outlines: list[np.ndarray],
) -> Surroundings:
    """The Surroundings of a scene with media: photons that arrive from media belong to them, and their flux is the root
    mean square of what some photons bring, for which a number of photons has the least variance.

    lamps: see planning.lamps. outlines: (n, 3) m each, points around which media lie that have an end.
    """
    key = pass_key(0, AFAR, PILOT)
    afar = surroundings._replace(
        sent=np.ones_like(surroundings.radiance), flux=1.0, open=np.zeros_like(surroundings.open)
    )
    dark = Emission(np.zeros(len(stage.surfaces.sheet), np.float32), np.zeros_like(reach.extent), no_cells())
    emitters = build_emitters(stage, afar, no_lights(lights), reach, dark, lamps)
    wave = empty_wave(_AFAR, len(afar.radiance), False, hides=tracer.hides)
    emit(emitters, stage, Batch(key, 0, _AFAR, _AFAR), wave)
    collect(tracer, stage, wave, key, surroundings)
    power = np.abs(wave.power).sum(axis=1, dtype=np.float64)
    area = float(reach.extent @ reach.arrival)
    flux2 = np.mean(power**2) * (_AFAR / area) ** 2
    return afar._replace(flux=math.sqrt(flux2 + _overlooked(tracer, stage, outlines, surroundings, area, key)))


def _overlooked(
    tracer: Tracer, stage: Stage, outlines: list[np.ndarray], surroundings: Surroundings, area: float, key: np.uint64
) -> float:
    """Mean square (W2 m-4) of the flux from media which all of _AFAR photons may have missed, as these are small.

    Of lines that are even over surfaces of an area (m2), the share 4 pi r^2 / area goes through a sphere of radius r,
    at most; a share of which _AFAR lines show nothing is below 3 / _AFAR (with 95 %: Hanley and Lippman-Hand 1983).
    What comes along such a line, others tell that set out on the sphere. outlines: see fill_surroundings.
    """
    if not outlines:
        return 0.0
    lines = max(4, min(_LINES, _AFAR // len(outlines)))
    ends = [(0.5 * (points.min(axis=0) + points.max(axis=0)), points) for points in outlines]
    radius = np.array([np.linalg.norm(points - middle, axis=1).max() for middle, points in ends])
    number = np.arange(lines) + 0.5
    outward = _on_sphere(number / lines, number * _GOLDEN)
    inward = _on_sphere((number * _PLASTIC) % 1.0, number * _PLASTIC**2) - outward  # distributed by the cosine
    wave = empty_wave(lines * len(ends), len(surroundings.radiance), False, hides=tracer.hides)
    for i, (middle, _) in enumerate(ends):
        wave.origin[i * lines : (i + 1) * lines] = middle + radius[i] * outward
        wave.direction[i * lines : (i + 1) * lines] = inward / np.linalg.norm(inward, axis=1, keepdims=True)
    wave.photon[:], wave.arrival[:], wave.u[:], wave.v[:], wave.power[:] = np.arange(len(wave.photon)), 0, 0.0, 0.0, 1.0
    nothing = np.zeros_like(surroundings.radiance)
    dark = surroundings._replace(radiance=nothing, sky=np.zeros((0, 0, len(nothing))), cells=no_sky_cells())
    collect(tracer, stage, wave, key, dark)
    flux = math.pi * np.abs(wave.power).sum(axis=1, dtype=np.float64).reshape(len(ends), lines)
    share = np.minimum(4.0 * math.pi * radius**2 / area, 3.0 / _AFAR)
    return float(share @ np.mean(flux**2, axis=1))


def _on_sphere(height: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(n, 3) points of the unit sphere, even if height (n,), 0..1, and turn (n,), of which 1 goes round, are."""
    z, angle = 1.0 - 2.0 * height, 2.0 * math.pi * turn
    across = np.sqrt(1.0 - z * z)
    return np.column_stack((across * np.cos(angle), across * np.sin(angle), z))


def build_emitters(
    stage: Stage, surroundings: Surroundings, lights: LightTable, reach: Reach, emission: Emission, lamps
) -> Emitters:
    """The Emitters. lamps: see planning.lamps."""
    surfaces, weight, light_total = stage.surfaces, reach.weight, light_totals(lights)
    power = emission.power * weight
    hidden, others = power[~reach.reachable].sum(), power[reach.reachable].sum() + light_total.sum()
    if hidden > _HIDDEN * others > 0.0:
        weight = np.where(reach.reachable, weight, weight * (_HIDDEN * others / hidden))
        hidden = _HIDDEN * others
    # Of the photons from the surroundings only the share `openness` arrives. The variance at a given number of photons
    # is least where a class is chosen in proportion to power / sqrt(share that arrives) (by a Lagrange multiplier).
    # Some photons come from the surroundings even where the scene seems closed: the pilot may have missed a hole.
    arriving, others = surroundings.flux * float(reach.extent @ reach.arrival), hidden + others
    if reach.openness > 0.0:
        chosen = math.sqrt(reach.openness)
    else:
        chosen = _SKY_DEFENSIVE * others / arriving if others > 0.0 and arriving > 0.0 else 1.0
    surface = build_side_table(surfaces, weight, emission.exitance)
    sky = build_side_table(surfaces, reach.arrival * (surroundings.flux * chosen))
    light_end = surface.before[-1] + sky.before[-1] + np.concatenate(([0.0], np.cumsum(light_total)))
    return Emitters(
        surface, sky, light_end, lamps.caustic, lamps.share, lamps.afar, emission.cells, surroundings, lights
    )


def emit(emitters: Emitters, stage: Stage, batch: Batch, wave) -> None:
    """Fill the wave with the photons of a batch."""
    bands = stage.radiometry.reference.size
    _emit(emitters, stage, batch, wave, nothing_emitted(bands, np.float64), np.empty(bands))


@njit(**FAST_KERNEL)
def _emit(emitters, stage, batch, wave, emitted, room):
    # One random shift spreads all photons evenly over the emitters (systematic sampling).
    # Positions and directions are independent random numbers: the estimate from the k nearest photons assumes that
    # photons lie at random. A low-discrepancy sequence lays them out evenly, and the estimate then counts half a photon
    # of the k too few (measured under a point light).
    surfaces, surroundings, lights = stage.surfaces, emitters.surroundings, emitters.lights
    shift = uniform(batch.key, 0)
    of_surfaces, of_sides, total = emitters.surface.before[-1], emitters.light_end[0], emitters.light_end[-1]
    surface, sky, light = first_found(emitters.surface, 0.0), first_found(emitters.sky, 0.0), np.int64(0)
    for i in range(wave.photon.size):
        photon = batch.first + i
        number, path = number_in((photon + shift) / batch.total, total), path_key(batch.key, photon)
        s0, s1, s2, s3 = uniform(path, 0), uniform(path, 1), uniform(path, 2), uniform(path, 3)
        wave.photon[i], wave.arrival[i], layer = photon, FORWARDS, 0
        if wave.start.size:
            wave.lobe[i], wave.start[i] = EITHER, -1
        of_sky = min(number - of_surfaces, number_in(1.0, emitters.sky.before[-1]))
        if i == 0:
            surface, sky = first_found(emitters.surface, number), first_found(emitters.sky, max(of_sky, 0.0))
        if number >= of_sides:
            while emitters.light_end[light + 1] <= number:
                light += 1
            share = total / (batch.total * (emitters.light_end[light + 1] - emitters.light_end[light]))
            origin, direction, brightness = light_ray(lights, light, (s0, s1, s2, s3))
            put_vector(origin, wave.origin, i)
            put_vector(direction, wave.direction, i)
            wave.chain[i], wave.aimed[i] = STRAIGHT_FROM_LIGHT | OF_LIGHT, np.inf
            if lights.kind[light] == SUN:
                wave.arrival[i] = FROM_SUN
            _set_power(wave, i, lights.power[light], brightness * share)
        else:
            is_surface = number < of_surfaces
            if is_surface:
                surface = found_from(surfaces, emitters.surface, number, surface)
            else:
                sky = found_from(surfaces, emitters.sky, of_sky, sky)
            found = surface if is_surface else sky
            side_id, share = np.int32(found.entry), total / (batch.total * (found.high - found.low))
            (u, v), density = triangle_point(s0, s1), 1.0
            if is_surface:
                u, v, density = choose_point(emitters.cells, side_id >> 1, s0, s1)
            normal = unit_normal(surfaces, side_id)
            if not is_surface and surroundings.cells.cumulative.size:
                direction, cosine, density = _towards_sky(surroundings.cells, normal, s2, s3)
            else:
                local = cosine_direction(s2, s3)
                direction, cosine = to_world(local, normal), local[2]
            at, label = emit_towards(surfaces, side_id, u, v, direction, cosine), sheet_of(surfaces, side_id)
            scale = math.pi * area_of(surfaces.corners, at.triangle) * share / density
            wave.chain[i] = CAUSTIC if is_surface and emitters.caustic[label] else 0
            if is_surface:
                layer = layer_at(stage, at)
                if wave.start.size:
                    wave.start[i] = at.triangle
                aimed = emitters.aimed[label] * emitters.surface.exitance[at.triangle]
                wave.aimed[i] = aimed * density / max(cosine, LEAST_COSINE)
                _set_power(wave, i, emission_at(stage, at, emitted), scale)
            else:
                layer = surroundings.layer
                wave.arrival[i], wave.u[i], wave.v[i] = side_id, u, v
                wave.aimed[i] = emitters.aimed_afar * density_towards(surroundings.cells, direction)
                if surroundings.open[label]:
                    wave.aimed[i] = np.inf
                if surroundings.sent.size > 0:
                    _set_power(wave, i, surroundings.sent, scale)
                else:
                    _set_power(wave, i, radiance_from(surroundings, direction, room), scale)
            leave(surfaces, side_id, at.point, direction, wave, i)
        if wave.layer.size:
            wave.layer[i] = layer


@njit(**FAST_INLINED)
def _towards_sky(cells, normal, s, w):
    """A direction from a side, by two numbers in [0, 1): cosine-distributed one time in two, else that of a SkyCells;
    its cosine; and its density over that of the cosine distribution, infinite behind the side."""
    by_cosine = to_world(cosine_direction(2.0 * min(s, 0.5), w), normal)
    direction = by_cosine if s < 0.5 else choose_direction(cells, 2.0 * s - 1.0, w)
    cosine = dot(direction, normal)
    if cosine <= 0.0:
        return direction, LEAST_COSINE, np.inf
    return direction, cosine, 0.5 + 0.5 * density_towards(cells, direction) * math.pi / cosine


@njit(**FAST_INLINED)
def _set_power(wave, i, value, scale):
    """Set the power of photon i in each band to value (b,) times scale."""
    for b in range(value.size):
        wave.power[i, b] = value[b] * scale
