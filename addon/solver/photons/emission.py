# SPDX-License-Identifier: GPL-3.0-or-later
"""Emission: photons leave surfaces, surroundings and lights, each class in proportion to its excess power."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import LEAST_COSINE, emit_at, emit_towards, leave
from ..geometry.segments import Tracer
from ..geometry.stage import Stage, emission_at, fill_emission, layer_at, nothing_emitted
from ..geometry.surfaces import unit_normal
from ..geometry.textures import row_of
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
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, put_vector
from ..sampling.warps import cosine_direction, to_world, triangle_point
from ..scene import Scene
from ..system.kernels import FAST_INLINED, FAST_KERNEL, INLINED, njit
from .cells import EmissionCells, build_cells, choose_point, no_cells
from .lights import SUN, LightTable, light_ray, light_totals, no_lights
from .walk import collect
from .wave import CAUSTIC, FORWARDS, FROM_SUN, OF_LIGHT, STRAIGHT_FROM_LIGHT, empty_wave

# Where the scene seems closed: photons from the surroundings, over all other photons.
_SKY_DEFENSIVE = 1.0 / 64.0
_AFAR = 4096  # photons that tell how much arrives from media and surroundings
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
    surroundings. layer: of the image, to which this radiance adds (see layers). open: (t, 2) bool, sides from which
    shadow rays are sent to the surroundings, so that photons that come from there are not stored there.
    """

    radiance: np.ndarray
    sky: np.ndarray
    sent: np.ndarray
    cells: SkyCells
    flux: float
    layer: int
    open: np.ndarray


class Reach(NamedTuple):
    """What the image can depend on, as far as the pilot knows; see Pilot.

    reachable: (t, 2) bool, sides that the image can depend on. weight: (t, 2) float64, factor on the probability that a
    side emits. arrival: (t, 2) float64, factor on the probability that photons from the surroundings arrive on a side.
    openness: share of the directions from reachable sides that leave the scene, 0..1.
    """

    reachable: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    openness: float


class Emitters(NamedTuple):
    """Everything that emits, as entries of one discrete distribution: surface sides, surroundings, lights.

    cumulative: (e + 1,) float64, from 0 to 1, the cumulative probability of the entries; zeros where nothing emits.
    surface: (n,) int32, side_ids of the sides that emit: entries 0..n-1. caustic: (n,) bool, whether photons find the
        caustics of such a side. aimed: (n,) float32, m-2, points on it that compete for a shadow ray, in the mean.
        aimed_afar: see Lamps.
    sky: (m,) int32, side_ids of the sides on which photons from the surroundings arrive: entries n..n+m-1.
    area: (t,) float64, of the triangles, m2.
    cells: where photons start on sides that vary by textures. surroundings: see Surroundings. lights: see LightTable;
        entries from n + m on. Lights add to the first layer.
    """

    cumulative: np.ndarray
    surface: np.ndarray
    caustic: np.ndarray
    aimed: np.ndarray
    aimed_afar: float
    sky: np.ndarray
    area: np.ndarray
    cells: EmissionCells
    surroundings: Surroundings
    lights: LightTable


def side_power(stage: Stage, area: np.ndarray) -> tuple[np.ndarray, EmissionCells]:
    """(t,) float64 |excess| power of one side of each triangle, over all bands, W, and the cells of those over which it
    varies by textures. Of others it is the mean over corners and centre."""
    power, cells = _side_power(stage, area), build_cells(stage)
    if len(cells.edge):
        varies = np.flatnonzero((cells.row >= 0) & (cells.edge[cells.row] > 0))
        power[varies] = math.pi * area[varies] * cells.mean[cells.row[varies]]
    return power, cells


@njit(cache=True, nogil=True)
def _side_power(stage, area):
    surfaces, power = stage.surfaces, np.empty(area.size)
    value = np.empty(stage.radiometry.reference.size)
    samples = 4 if surfaces.temperature.shape[1] == 3 else 1
    before, total = -1, 0.0  # the triangle whose emission in all bands is known, and that emission
    for t in range(area.size):
        if before < 0 or samples > 1 or not _emit_alike(surfaces, before, t):
            total = 0.0
            for sample in range(samples):
                u = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 2 else 0.0)
                v = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 3 else 0.0)
                fill_emission(stage, emit_at(surfaces, 2 * t, u, v, 2.0 / 3.0), value)
                for b in range(value.size):
                    total += abs(value[b])
            before = t
        power[t] = math.pi * area[t] * total / samples
    return power


@njit(**INLINED)
def _emit_alike(surfaces, s, t):
    """Whether two triangles of one temperature each surely emit the same: neighbours in a mesh mostly do."""
    textures = surfaces.textures
    same = surfaces.material[s] == surfaces.material[t] and surfaces.temperature[s, 0] == surfaces.temperature[t, 0]
    return same and row_of(textures, s) < 0 and row_of(textures, t) < 0


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
    area: np.ndarray,
    lamps,
    key: np.uint64,
) -> Surroundings:
    """The Surroundings of a scene with media: photons that arrive from media belong to them, and their flux is the root
    mean square of what some photons bring, for which a number of photons has the least variance.

    area: (t,) float64, m2. lamps: see planning.lamps. key: of the photons' random numbers.
    """
    afar = surroundings._replace(
        sent=np.ones_like(surroundings.radiance), flux=1.0, open=np.zeros_like(surroundings.open)
    )
    dark = np.zeros_like(area), no_cells()
    emitters = build_emitters(stage, afar, no_lights(lights), reach, area, dark, lamps)
    wave = empty_wave(_AFAR, len(afar.radiance), False)
    emit(emitters, stage, Batch(key, 0, _AFAR, _AFAR), wave)
    collect(tracer, stage, wave, key, surroundings)
    power = np.abs(wave.power).sum(axis=1, dtype=np.float64)
    return afar._replace(flux=float(np.sqrt(np.mean(power**2))) * _AFAR / float((area[:, None] * reach.arrival).sum()))


def build_emitters(
    stage: Stage,
    surroundings: Surroundings,
    lights: LightTable,
    reach: Reach,
    area: np.ndarray,
    emission: tuple[np.ndarray, EmissionCells],
    lamps,
) -> Emitters:
    """The Emitters.

    area: (t,) float64, m2. emission: see side_power. lamps: see planning.lamps.
    """
    power, cells = emission
    sky_power, sky = np.empty(0), np.empty(0, np.int32)
    if surroundings.flux > 0:
        sky_power = (area[:, None] * reach.arrival).ravel()
        sky = np.flatnonzero(sky_power > 0).astype(np.int32)
        sky_power = surroundings.flux * sky_power[sky]
    light_total = light_totals(lights)
    surface_power, reachable = power[:, None] * reach.weight, reach.reachable
    hidden, others = surface_power[~reachable].sum(), surface_power[reachable].sum() + light_total.sum()
    if hidden > _HIDDEN * others > 0.0:
        surface_power[~reachable] *= _HIDDEN * others / hidden
    surface_power = surface_power.ravel()
    surface = np.flatnonzero(surface_power > 0).astype(np.int32)
    # Of the photons from the surroundings only the share `openness` arrives. The variance at a given number of photons
    # is least where a class is chosen in proportion to power / sqrt(share that arrives) (by a Lagrange multiplier).
    # Some photons come from the surroundings even where the scene seems closed: the pilot may have missed a hole.
    others = surface_power.sum() + light_total.sum()
    if reach.openness > 0:
        sky_chosen = sky_power * math.sqrt(reach.openness)
    else:
        sky_chosen = sky_power * (_SKY_DEFENSIVE * others / sky_power.sum() if others > 0 and sky.size else 1.0)
    cumulative = np.zeros(len(surface) + len(sky) + len(light_total) + 1)
    chosen = cumulative[1:]
    np.concatenate((surface_power[surface], sky_chosen, light_total), out=chosen)
    np.cumsum(chosen, out=chosen)
    if cumulative[-1] > 0:
        cumulative /= cumulative[-1]
    caustic, aimed = lamps.caustic.ravel()[surface], lamps.density.ravel()[surface]
    return Emitters(cumulative, surface, caustic, aimed, lamps.afar, sky, area, cells, surroundings, lights)


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
    surroundings, lights = emitters.surroundings, emitters.lights
    shift = uniform(batch.key, 0)
    surface_end = emitters.surface.size
    sky_end = surface_end + emitters.sky.size
    last = emitters.cumulative.size - 2
    entry = min(last, np.searchsorted(emitters.cumulative, (batch.first + shift) / batch.total, side="right") - 1)
    for i in range(wave.photon.size):
        photon = batch.first + i
        number, path = (photon + shift) / batch.total, path_key(batch.key, photon)
        s0, s1, s2, s3 = uniform(path, 0), uniform(path, 1), uniform(path, 2), uniform(path, 3)
        while entry < last and emitters.cumulative[entry + 1] <= number:
            entry += 1
        probability = emitters.cumulative[entry + 1] - emitters.cumulative[entry]
        share = 1.0 / (batch.total * probability)
        caustic, layer = entry < surface_end and emitters.caustic[entry], 0
        wave.photon[i], wave.arrival[i] = photon, FORWARDS
        wave.chain[i] = STRAIGHT_FROM_LIGHT | OF_LIGHT if entry >= sky_end else CAUSTIC if caustic else 0
        wave.aimed[i] = np.inf if entry >= sky_end else 0.0
        if entry >= sky_end:
            light = entry - sky_end
            origin, direction, brightness = light_ray(lights, light, (s0, s1, s2, s3))
            put_vector(origin, wave.origin, i)
            put_vector(direction, wave.direction, i)
            if lights.kind[light] == SUN:
                wave.arrival[i] = FROM_SUN
            _set_power(wave, i, lights.power[light], brightness * share)
        else:
            side_id = emitters.surface[entry] if entry < surface_end else emitters.sky[entry - surface_end]
            (u, v), density = triangle_point(s0, s1), 1.0
            if entry < surface_end:
                u, v, density = choose_point(emitters.cells, side_id >> 1, s0, s1)
            normal = unit_normal(stage.surfaces, side_id)
            if entry >= surface_end and surroundings.cells.cumulative.size:
                direction, cosine, density = _towards_sky(surroundings.cells, normal, s2, s3)
            else:
                local = cosine_direction(s2, s3)
                direction, cosine = to_world(local, normal), local[2]
            at = emit_towards(stage.surfaces, side_id, u, v, direction, cosine)
            scale = math.pi * emitters.area[at.triangle] * share / density
            if entry < surface_end:
                layer = layer_at(stage, at)
                wave.aimed[i] = emitters.aimed[entry] * density / max(cosine, LEAST_COSINE)
                _set_power(wave, i, emission_at(stage, at, emitted), scale)
            else:
                layer = surroundings.layer
                wave.arrival[i], wave.u[i], wave.v[i] = side_id, u, v
                wave.aimed[i] = emitters.aimed_afar * density_towards(surroundings.cells, direction)
                if surroundings.open[at.triangle, side_id & 1]:
                    wave.aimed[i] = np.inf
                if surroundings.sent.size > 0:
                    _set_power(wave, i, surroundings.sent, scale)
                else:
                    _set_power(wave, i, radiance_from(surroundings, direction, room), scale)
            leave(stage.surfaces, side_id, at.point, direction, wave, i)
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
