# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps: where shadow rays are sent to.

Everything that emits is a lamp. The direct light of a lamp is shared by multiple importance sampling (Veach 1997)
between shadow rays and rays that meet the lamp by chance (see camera.shadow_rays). So how often shadow rays are sent
to which lamp costs or saves noise, and never changes the mean. They are sent where they are needed: to lamps that are
small against their distance, which other rays seldom meet, and that are seldom hidden.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import emit_at, leave
from ..geometry.segments import FROM_DIFFUSE, Tracer, empty_ray_batch
from ..geometry.stage import Stage, fill_emission
from ..geometry.surfaces import clear_of, sheet_of
from ..geometry.triangles import CLEAR, area_of, areas, corner
from ..photons.cells import EmissionCells, choose_point, concentration, density_at
from ..photons.emission import Emission, Surroundings
from ..photons.lights import SUN, LightTable, light_totals, with_sky
from ..photons.side_table import (
    SideTable,
    build_side_table,
    first_found,
    found_from,
    number_in,
    power_of,
    side_at,
    unweighted,
)
from ..physics.radiometry import absolute_sum
from ..physics.sky import SkyCells, choose_direction, density_towards, mean_excess
from ..sampling.heuristics import BEST, CANDIDATES, TYPICAL_RAYS, balance
from ..sampling.low_discrepancy import unevenness
from ..sampling.rng import CANDIDATE_CHOICE, LAMP_CHOICE, PILOT, pass_key, path_key, uniform, uniforms
from ..sampling.vectors import difference, dot, moved, put_vector, vector
from ..sampling.warps import triangle_point
from ..system.kernels import INLINED, KERNEL, njit, thinned
from .pilot import Pilot

_RECEIVERS, _FEWEST_RECEIVERS = 512, 32  # points at which lamps are judged
_PAIRS = 1 << 20  # of lamps and such points, about
_SKY = -2  # in place of the label of a sheet
_SKY_WAYS = 64  # directions by which a sky is judged
_AIMED = 8192  # trial shadow rays between such pairs
_TYPICAL_COSINE = 2.0 / 3.0  # mean of cosine-distributed directions
# that a shadow ray may count as
_WORTHS = tuple(float(BEST / 2.0**i) for i in range(12))
# Time that a gather takes besides its TYPICAL_RAYS rays, over theirs. Of 256, 64, 16 and 4 the worth that is next to
# the chosen one was best, or within 3 % of the best error times root of time, in room, ring, engine, street, office and
# bay of tests/benchmarks/speed_scenes.py; in cavity it costs 12 %.
_BESIDES = 1.0 / 8.0
_LEAST_NEED = 1.0 / 64.0  # least need of a lamp, over the mean, as the points say little of others


class Lamps(NamedTuple):
    """What shadow rays are sent to: sides of triangles, then lights.

    sides: of sheets that can light the image. lights: see LightTable. light_end: (l + 1,) float64, sum of the weights
    of all sides and of the lights before each; last that of all lamps, 0 where nothing shines. visible: (labels,)
    float64, share of a sheet's light that no surface hides. light_power: (l,) float64, W. share: (labels,) float64,
    W-1, lamp points that compete for a shadow ray on a side of the sheet, in the mean, over what it emits; cells tell
    how they lie on sides that emit unevenly. afar: points that compete in all directions of the sky together; cells of
    the Surroundings tell how they lie. found: (labels,) float64, share of a sheet's direct light that is left to rays
    of final gathers, in the mean. caustic: (labels,) bool, sheets whose light in specular lobes photons find, see
    choose_caustic_lamps.
    """

    sides: SideTable
    lights: LightTable
    light_end: np.ndarray
    visible: np.ndarray
    light_power: np.ndarray
    share: np.ndarray
    afar: float
    found: np.ndarray
    caustic: np.ndarray
    cells: EmissionCells


class Receivers(NamedTuple):
    """r points at which lamps are judged: point, normal (r, 3) float64; side_id (r,) int32."""

    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray

    def thinned(self, most: int) -> "Receivers":
        """About `most` of these receivers."""
        return Receivers(*thinned(self, max(1, len(self.point) // most)))


@njit(cache=True, nogil=True)
def spheres(corners, sheet, row, count):
    """Centre (n, 3) and radius (n,) of spheres around sheets. row: (labels,) int32, sphere of a label or -1."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    at = corner(corners, t, i)
                    for axis in range(3):
                        low[n, axis] = min(low[n, axis], at[axis])
                        high[n, axis] = max(high[n, axis], at[axis])
    centre, square = 0.5 * (low + high), np.zeros(count)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    way = difference(corner(corners, t, i), vector(centre, n))
                    square[n] = max(square[n], dot(way, way))
    return centre, np.sqrt(square)


def build_lamps(
    stage: Stage,
    tracer: Tracer,
    pilot: Pilot,
    emission: Emission,
    afar: tuple[LightTable, Surroundings],
    caustic: np.ndarray,
    worth: float | None = None,
) -> tuple[Lamps, float]:
    """The Lamps of a scene: all sides that emit and can light the image, all lights, and a sky of which a small part is
    bright; and how many rays a shadow ray counts as.

    pilot: tells which sides can light the image, and where camera paths gather. afar: lights and surroundings. caustic:
    see Lamps. worth: how many rays a shadow ray counts as; None looks for what costs least.
    """
    surfaces, (lights, surroundings) = stage.surfaces, afar
    shines = surroundings.cells.cumulative.size > 0
    if shines:
        bright = mean_excess(np.abs(surroundings.sky))
        lights = with_sky(lights, 4.0 * math.pi * surroundings.cells.mean * bright / bright.sum())
    # in the order of a Morton curve: points at equal steps along this curve lie all around a lamp
    sides = unweighted(emission.exitance)
    power = np.where(pilot.reachable, emission.power, 0.0)
    need, visible, met, hidden = _need(stage, tracer, (emission, power), sides, pilot)
    sides = build_side_table(surfaces, np.where(pilot.reachable, need, 0.0), emission.exitance, surfaces.leaf_triangle)
    light_power = light_totals(lights)
    of_lights = light_power * _light_need(lights, surroundings.cells, pilot)
    light_end = sides.before[-1] + np.concatenate(([0.0], np.cumsum(of_lights)))
    of_sheet = power * need / max(light_end[-1], 1e-300)
    disk = math.pi * lights.scene_radius**2
    chances = _Chances(sides, light_end, of_sheet, light_power, visible, emission.cells, surroundings.cells, disk)
    best = _best_worth(stage, pilot, chances, hidden) if worth is None else worth
    share = best * sides.factor / max(light_end[-1], 1e-300)
    # the power heuristic, as in balance
    found = np.where(power > 0.0, met**2 / np.maximum(met**2 + (best * of_sheet) ** 2, 1e-300), 1.0)
    of_sky = best * float(of_lights[-1] / max(light_end[-1], 1e-300)) if shines else 0.0
    return Lamps(sides, lights, light_end, visible, light_power, share, of_sky, found, caustic, emission.cells), best


def _need(stage, tracer, emission, sides, pilot) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """By label of the sheet, (labels,) float64 each: how much irradiance, m-2, that rays of final gathers seldom find
    each W of the sheet's power brings to where camera paths gather; the share of that which no surface hides; and how
    many of those rays meet the sheet, in the mean over its light. And the variance, see _variance.

    emission: and the power of each sheet that can light the image, (labels,) float64 W. sides: see `unweighted`.
    """
    surfaces, (emission, power) = stage.surfaces, emission
    labels, emitting = len(power), np.flatnonzero(power > 0.0)
    need, visible, met = np.ones(labels), np.ones(labels), np.ones(labels)
    if len(pilot.point) == 0 or len(emitting) == 0:
        return need, visible, met, 0.0
    receivers = Receivers(pilot.point, pilot.normal, pilot.side_id)
    receivers = receivers.thinned(min(_RECEIVERS, max(_FEWEST_RECEIVERS, _PAIRS // len(emitting))))
    row = np.full(labels, -1, np.int32)
    row[emitting] = np.arange(len(emitting))
    centre, radius = spheres(surfaces.corners, surfaces.sheet, row, len(emitting))
    radius /= np.sqrt(_spots(surfaces, emission)[emitting])
    brought, weight = np.zeros(len(emitting)), np.zeros((len(emitting), len(receivers.point)))
    _bring(centre, radius, receivers, brought, weight)
    seldom, choice = weight.sum(axis=1), _Sheets(sides, row, power[emitting])
    weight *= power[emitting, None]
    visible[emitting] = _visibility(surfaces, tracer, choice, weight, receivers)
    weight *= visible[emitting, None]
    gain = _signs(stage, sides, row, len(emitting)) / visible[emitting]
    variance = _variance(surfaces, tracer, choice, weight, receivers, gain)
    mean = seldom / len(receivers.point) * visible[emitting]
    # never far below the mean, as few receivers tell of all
    need[emitting] = np.maximum(mean, _LEAST_NEED * mean.mean())
    met[emitting] = brought / np.maximum(seldom, 1e-300) - 1.0
    return need, visible, met, variance


def _spots(surfaces, emission) -> np.ndarray:
    """(labels,) float64, at least 1: a sheet that emits in spots is met as seldom as one that is so much smaller."""
    varies, more = concentration(emission.cells)
    if not len(varies):
        return np.ones(len(emission.power))
    power, label = areas(surfaces.corners)[varies] * emission.exitance[varies], surfaces.sheet[varies].ravel()
    further = np.bincount(label, np.repeat(power * (more - 1.0), 2), len(emission.power))
    return 1.0 + further / np.maximum(emission.power, 1e-300)


def _signs(stage, sides, row, count) -> np.ndarray:
    """(n,) of n sheets, -1 for those that are colder than the reference in the mean over what they emit, else 1. row:
    see spheres."""
    warmer = np.zeros(count)
    _add_signs(stage, sides, row, warmer)
    return np.where(warmer < 0.0, -1.0, 1.0)


@njit(**KERNEL)
def _add_signs(stage, sides, row, warmer):
    surfaces, quiet = stage.surfaces, stage.radiometry.quiet
    for t in range(surfaces.sheet.shape[0]):
        excess = -quiet
        for i in range(surfaces.temperature.shape[1]):
            excess += surfaces.temperature[t, i] / surfaces.temperature.shape[1]
        for side in range(2):
            n = row[surfaces.sheet[t, side]]
            if n >= 0 and excess != 0.0:
                warmer[n] += math.copysign(power_of(surfaces, sides, t), excess)


@njit(**KERNEL)
def _bring(centre, radius, receivers, brought, seldom):
    """Add to brought (n,), m-2, the irradiance that 1 W of each of n spheres brings to all receivers, as if visible.
    Fill seldom (n, r) with the part of it, at each receiver, that shadow rays are needed for: a sphere that takes the
    share F of the cosine-weighted view is met by TYPICAL_RAYS F rays of a final gather."""
    for k in range(radius.size):
        c, r2 = vector(centre, k), radius[k] * radius[k]
        for i in range(receivers.side_id.size):
            way = difference(c, vector(receivers.point, i))
            d2 = max(dot(way, way), r2)
            cosine = min(1.0, max(0.0, dot(way, vector(receivers.normal, i)) + radius[k]) / math.sqrt(d2))
            here = cosine / (4.0 * math.pi * d2)
            brought[k] += here
            seldom[k, i] = here / (1.0 + TYPICAL_RAYS * cosine * r2 / d2)


class _Sheets(NamedTuple):
    """n sheets that emit. sides: see _need. row: see spheres. power: (n,) float64, W."""

    sides: SideTable
    row: np.ndarray
    power: np.ndarray


def _choose_sides(surfaces, sheets, sheet, share) -> np.ndarray:
    """(k,) int32 side_ids of sides of emitting sheets (k,), chosen by power: each where this share (k,), in [0, 1), of
    the sheet's power lies on sides before it."""
    order, wanted = np.lexsort((share, sheet)), share * sheets.power[sheet]
    first = np.searchsorted(sheet[order], np.arange(len(sheets.power) + 1))
    chosen, found = np.empty(len(sheet), np.int32), np.empty(len(sheet), np.int32)
    last = np.empty(len(sheets.power), np.int32)
    _find_sides(surfaces, sheets, wanted[order], first, (np.zeros(len(last)), last), found)
    chosen[order] = found
    return chosen


@njit(**KERNEL)
def _find_sides(surfaces, sheets, wanted, first, room, found):
    """Fill found (k,): the sides at which the sum of a sheet's power exceeds wanted (k,), ascending for each sheet.

    first: (n + 1,) int64, where those of each sheet begin; overwritten. room: (n,) zeros, and (n,) int32.
    """
    passed, last = room
    for n in range(last.size):
        last[n] = first[n + 1]
    for entry in range(2 * surfaces.sheet.shape[0]):
        side_id = side_at(sheets.sides, entry)
        n = sheets.row[surfaces.sheet[side_id >> 1, side_id & 1]]
        if n < 0 or first[n] == last[n]:
            continue
        power = power_of(surfaces, sheets.sides, side_id >> 1)
        if power > 0.0:
            passed[n] += power
            for i in range(first[n], last[n]):
                found[i] = side_id  # this one if by rounding the sum ends below what is wanted
                if wanted[i] >= passed[n]:
                    break
                first[n] = i + 1


def _visibility(surfaces, tracer, sheets, weight, receivers) -> np.ndarray:
    """(n,) float64 share of the light of n sheets that no surface hides, of that which faces the receivers at all; told
    by rays between pairs of sheets and receivers that are chosen in proportion to weight (n, r)."""
    key, cumulative = pass_key(0, LAMP_CHOICE, PILOT), np.cumsum(weight.ravel())
    picks = (np.arange(_AIMED) + uniforms(key, 0, _AIMED)) / _AIMED * cumulative[-1]
    pair = np.minimum(np.searchsorted(cumulative, picks, side="right"), cumulative.size - 1)
    sheet, receiver = np.divmod(pair, weight.shape[1])
    chosen = _choose_sides(surfaces, sheets, sheet, uniforms(key, _AIMED, _AIMED))
    seen, faces = _aimed(surfaces, tracer, chosen, (receiver, receivers), key)
    tried, met, seen = (np.bincount(sheet, some, len(weight)) for some in (np.ones(_AIMED), faces, seen))
    # of a sheet that faces nothing, such as the back of a plate, nothing is seen
    return (seen + 1.0) / (np.where(met > 0.0, met, tried) + 1.0)


def _variance(surfaces, tracer, sheets, weight, receivers, gain) -> float:
    """Variance of a shadow ray over the square of the light that it looks for, as a mean over the receivers.

    The choice of a lamp leaves what it cannot know: whether the lamp is hidden. And cold lamps take light away. weight:
    (n, r), in proportion to which sheets are chosen at a receiver. gain: (n,) what a ray to a sheet brings if it meets
    nothing, over the mean.
    """
    key, total, receiver = pass_key(1, LAMP_CHOICE, PILOT), weight.sum(axis=0), np.arange(weight.shape[1])
    cumulative, each = np.cumsum(weight.T, axis=1, out=np.empty(weight.shape[::-1])), max(8, _AIMED // receiver.size)
    keys = [pass_key(2 + ray, LAMP_CHOICE, PILOT) for ray in range(each)]
    picks = [(ray + uniforms(key, ray * receiver.size, receiver.size)) / each * total for ray in range(each)]
    chosen = [np.searchsorted(*of, side="right") for of in zip(cumulative, np.transpose(picks), strict=True)]
    sheet = np.minimum(np.transpose(chosen), len(weight) - 1)
    share = np.concatenate([uniforms(key, receiver.size, receiver.size) for key in keys])
    sides = _choose_sides(surfaces, sheets, sheet.ravel(), share).reshape(sheet.shape)
    aimed = [_aimed(surfaces, tracer, some, (receiver, receivers), key) for some, key in zip(sides, keys, strict=True)]
    seen, faces = np.swapaxes(aimed, 0, 1)
    brought, count = seen * gain[sheet], np.maximum(faces.sum(axis=0), 1.0)
    mean = brought.sum(axis=0) / count
    variance = np.sum(faces * (brought - mean) ** 2, axis=0) / np.maximum(count - 1.0, 1.0)
    return float(np.sum(total**2 * variance) / max(np.sum(total**2), 1e-300))


def _aimed(surfaces, tracer, chosen, receiver, key) -> tuple[np.ndarray, np.ndarray]:
    """For sides (n,) and receivers (numbers of these, (n,), and the Receivers): whether a point of the side is visible,
    (n,) bool, and whether it faces the receiver at all, (n,) bool. key: of the random numbers."""
    rays, faces = empty_ray_batch(len(chosen)), np.zeros(len(chosen), np.bool_)
    _aim(surfaces, chosen, *receiver, key, rays, faces)
    clear = tracer.seen_from(FROM_DIFFUSE).visible(*rays, np.ones(len(chosen), np.float32))
    return faces & clear, faces


@njit(**KERNEL)
def _aim(surfaces, chosen, receiver, receivers, key, rays, faces):
    """Fill rays (n) from receivers with these indices (n,) to points on the chosen sides (n,), and faces (n,): whether
    both face each other."""
    for i in range(faces.size):
        path, j = path_key(key, 2 * faces.size + i), receiver[i]
        u, v = triangle_point(uniform(path, 0), uniform(path, 1))
        lamp = emit_at(surfaces, chosen[i], u, v, 1.0)
        point, side_id, n = vector(receivers.point, j), receivers.side_id[j], vector(receivers.normal, j)
        way = difference(clear_of(surfaces, chosen[i], lamp.point), clear_of(surfaces, side_id, point))
        faces[i] = dot(way, n) > 0.0 and dot(way, lamp.normal) < 0.0
        # the ray ends a little beyond the point, or the lamp would hide its own point: see send_shadow
        leave(surfaces, side_id, point, moved(way, CLEAR * math.sqrt(dot(way, way)), lamp.normal), rays, i)


class _Chances(NamedTuple):
    """How shadow rays choose among sides and lights. sides, light_end, light_power, visible, cells: see Lamps.
    of_sheet: (labels,) float64, chance of all sides of a sheet. sky: see Surroundings; the last of the lights, if it
    has cells. disk: m2, across which the sky's power falls, see light_totals."""

    sides: SideTable
    light_end: np.ndarray
    of_sheet: np.ndarray
    light_power: np.ndarray
    visible: np.ndarray
    cells: EmissionCells
    sky: SkyCells
    disk: float


class _Found(NamedTuple):
    """Room for what CANDIDATES lamp points bring to a receiver, twice. side_id: (2, CANDIDATES) int32, or -1 - i for
    light i. chance: (2, CANDIDATES) float64. emitted: (b,) float64. sums: (2, 3) float64, see _try_candidates. sheet:
    (CANDIDATES,) int32, label, -1 for lights, _SKY. taken: float64, share of the receiver's cosine-weighted view that
    the sheet takes, as this point tells it. left: float64, variance of single random rays."""

    side_id: np.ndarray
    chance: np.ndarray
    emitted: np.ndarray
    sums: np.ndarray
    sheet: np.ndarray
    taken: np.ndarray
    left: np.ndarray


def _best_worth(stage, pilot, chances, hidden) -> float:
    """How many rays a shadow ray should count as in the heuristic: of some numbers the one that costs least, in the sum
    over where camera paths gather.

    hidden: see _variance.
    """
    if len(pilot.point) == 0 or chances.light_end[-1] == 0.0:
        return _WORTHS[0]
    receivers = Receivers(pilot.point, pilot.normal, pilot.side_id).thinned(_RECEIVERS)
    worths, cost, emitted = np.array(_WORTHS), np.zeros(len(_WORTHS)), np.empty(stage.radiometry.reference.size)
    chosen = np.empty((2, CANDIDATES), np.int32), np.empty((2, CANDIDATES))
    room = _Found(*chosen, emitted, np.empty((2, 3)), np.empty(CANDIDATES, np.int32), *np.empty((2, CANDIDATES)))
    _add_costs(stage, receivers, chances, (hidden, pass_key(0, CANDIDATE_CHOICE, PILOT)), room, worths, cost)
    return _WORTHS[int(np.argmin(cost))]


@njit(**KERNEL)
def _add_costs(stage, receivers, chances, choice, room, worths, cost):
    """Add to cost (n,) the standard error of direct irradiance times the root of the time, summed over the receivers,
    for each of these worths (n,) of a shadow ray. choice: variance of what such a ray finds by what is hidden, and key
    of the random numbers.

    With m times as many rays the variance is a + b / m, and the time in proportion to _BESIDES + m. The product is
    least at m = (_BESIDES b / a)^(1/2): ((_BESIDES a)^(1/2) + b^(1/2))^2.
    """
    (hidden, key), sums = choice, room.sums
    for i in range(receivers.side_id.size):
        path, n = path_key(key, i), vector(receivers.normal, i)
        here = clear_of(stage.surfaces, receivers.side_id[i], vector(receivers.point, i))
        # two sets of candidates, as their strata differ less than single candidates do
        for row in range(2):
            _choose_candidates(stage.surfaces, chances, path_key(path, row), room.side_id[row], room.chance[row])
        for w in range(worths.size):
            for row in range(2):
                _try_candidates(stage, (here, n), chances, (worths[w], path_key(path, row), row), room, sums[row])
            mean = 0.5 * (sums[0, 0] + sums[1, 0])
            of_shadows = 0.5 * (sums[0, 0] - sums[1, 0]) ** 2 + hidden * mean * mean
            of_shadows += mean * 0.5 * (sums[0, 1] + sums[1, 1])
            cost[w] += math.sqrt(_BESIDES * of_shadows) + math.sqrt(0.5 * (sums[0, 2] + sums[1, 2]))


@njit(**KERNEL)
def _choose_candidates(surfaces, chances, path, side_id, chance):
    """Choose CANDIDATES sides or lights. Fills side_id and chance (CANDIDATES,), see _Found."""
    total = chances.light_end[-1]
    for c in range(CANDIDATES):
        number = number_in((c + uniform(path, 3 * c)) / CANDIDATES, total)
        if number < chances.light_end[0]:
            found = found_from(surfaces, chances.sides, number, first_found(chances.sides, number))
            side_id[c], chance[c] = side_at(chances.sides, found.entry), (found.high - found.low) / total
        else:
            light = np.searchsorted(chances.light_end, number, side="right") - 1
            side_id[c] = -1 - light
            chance[c] = (chances.light_end[light + 1] - chances.light_end[light]) / total


@njit(**KERNEL)
def _try_candidates(stage, receiver, chances, choice, room, sums):
    """Fill sums with what CANDIDATES lamp points bring to a receiver (point and normal), if nothing hides them, as far
    as it is left to shadow rays; the part of it from points brighter or darker than their triangle, times the square of
    the difference; and the variance of what is left to TYPICAL_RAYS rays."""
    (here, n), (worth, path, row) = receiver, choice
    sums[:], room.sheet[:], room.taken[:], room.left[:] = 0.0, -1, 0.0, 0.0
    for c in range(CANDIDATES):
        side_id, chance = np.int64(room.side_id[row, c]), room.chance[row, c]
        s, w = uniform(path, 3 * c + 1), uniform(path, 3 * c + 2)
        if side_id < 0:
            light = -1 - side_id
            if light == chances.light_power.size - 1 and chances.sky.cumulative.size:
                sought = worth * chance, chances.light_power[light] / chances.disk / chance
                _try_sky(n, chances.sky, sought, (s, w), (room, c), sums)
            continue
        t = side_id >> 1
        power = power_of(stage.surfaces, chances.sides, t)
        u, v, dense = choose_point(chances.cells, t, s, w)
        lamp = emit_at(stage.surfaces, side_id, u, v, _TYPICAL_COSINE)
        room.sheet[c] = sheet_of(stage.surfaces, lamp.side_id)
        way = difference(lamp.point, here)
        distance = math.sqrt(max(dot(way, way), 1e-30))
        cosine, lamp_cosine = dot(way, n) / distance, -dot(way, lamp.normal) / distance
        if cosine <= 0.0 or lamp_cosine <= 0.0:
            continue
        area = area_of(stage.surfaces.corners, t) / dense  # as if all emitted as much as the point
        view = lamp_cosine / (distance * distance)
        shared = balance(worth * chance / area, TYPICAL_RAYS * cosine / math.pi * view)
        brought = cosine * view * chances.visible[room.sheet[c]] * power / chance / CANDIDATES
        fill_emission(stage, lamp, room.emitted)
        sums[0] += shared * brought
        sums[1] += shared * brought * (math.pi * area * absolute_sum(room.emitted) / power - 1.0) ** 2
        room.taken[c] = cosine * view * area / math.pi * chances.of_sheet[room.sheet[c]] / chance
        room.left[c] = (1.0 - shared) ** 2 * brought * math.pi * power / area / TYPICAL_RAYS
    for c in range(CANDIDATES):
        if room.left[c] > 0.0:
            sums[2] += room.left[c] * unevenness(TYPICAL_RAYS * _taken(room, room.sheet[c]))


@njit(inline="always")
def _try_sky(n, cells, sought, numbers, candidate, sums):
    """As _try_candidates, with a direction of the sky, by two numbers in [0, 1), as candidate c of the room. sought:
    the worth of shadow rays there, and the sky's W m-2 over the chance."""
    (points, flux), (room, c) = sought, candidate
    way = choose_direction(cells, *numbers)
    cosine, density = dot(way, n), density_towards(cells, way)
    if cosine > 0.0:
        shared = balance(points * density, TYPICAL_RAYS * cosine / math.pi)
        brought = math.pi * cosine * flux / CANDIDATES
        sums[0] += shared * brought
        room.sheet[c], room.taken[c] = _SKY, cosine / (math.pi * density)
        room.left[c] = (1.0 - shared) ** 2 * brought * math.pi**2 * density * flux / TYPICAL_RAYS


@njit(**INLINED)
def _taken(room, sheet):
    """Share of the view that a sheet takes, as the candidates on it tell."""
    taken, count = 0.0, 0
    for c in range(CANDIDATES):
        if room.sheet[c] == sheet:
            taken, count = taken + room.taken[c], count + 1
    return taken / count


def _light_need(lights: LightTable, cells: SkyCells, pilot: Pilot) -> np.ndarray:
    """(l,) float64 irradiance, m-2, that each W of the lights brings, in the mean over where camera paths gather; of
    the sky the part that rays of final gathers seldom find."""
    if len(pilot.point) == 0:
        return np.ones(len(lights.kind))
    receivers = Receivers(pilot.point, pilot.normal, pilot.side_id).thinned(_RECEIVERS)
    way = lights.position[:, None] - receivers.point
    distance2 = np.maximum(np.sum(way**2, axis=2), 1e-300)
    cosine = np.maximum(np.sum(way * receivers.normal, axis=2), 0.0) / np.sqrt(distance2)
    near = np.mean(cosine / (4.0 * math.pi * distance2), axis=1)
    sun = np.mean(np.maximum(-lights.axis @ receivers.normal.T, 0.0), axis=1) / (math.pi * lights.scene_radius**2)
    need = np.where(lights.kind == SUN, sun, near)
    if cells.cumulative.size:
        need[-1] = _sky_need(cells, receivers) / (math.pi * lights.scene_radius**2)
    return np.maximum(need, _LEAST_NEED * (need.mean() if need.size else 0.0))


def _sky_need(cells: SkyCells, receivers: Receivers) -> float:
    """Mean cosine under which the receivers get the light of a sky, as far as rays of final gathers seldom find it: see
    _bring, with the directions in which all light would come if it were as bright as there."""
    ways, density = np.empty((_SKY_WAYS, 3)), np.empty(_SKY_WAYS)
    _choose_directions(cells, pass_key(1, CANDIDATE_CHOICE, PILOT), ways, density)
    cosine = np.maximum(np.einsum("ri,wi->rw", receivers.normal, ways), 0.0)
    return float(np.mean(cosine / (1.0 + TYPICAL_RAYS * cosine / (math.pi * density))))


@njit(**KERNEL)
def _choose_directions(cells, key, ways, density):
    for i in range(density.size):
        path = path_key(key, i)
        way = choose_direction(cells, (i + uniform(path, 0)) / density.size, uniform(path, 1))
        put_vector(way, ways, i)
        density[i] = density_towards(cells, way)


@njit(inline="always")
def share_of_sky(density, lamps, surroundings, direction):
    """Share of the light of the sky in a direction that is left to a ray, see share_of_ray."""
    return balance(density, lamps.afar * density_towards(surroundings.cells, direction))


@njit(inline="always")
def lamp_density(lamps, surfaces, side_id):
    """Lamp points that compete for a shadow ray on each m2 of a side, in the mean over it, m-2."""
    return lamps.share[sheet_of(surfaces, side_id)] * lamps.sides.exitance[side_id >> 1]


@njit(inline="always")
def share_of_ray(density, lamps, surfaces, at):
    """Share of the light of the lamp that a ray meets which is left to such rays, and not to shadow rays.

    density: sr-1, of the rays. at: the Interaction of the ray with the lamp.
    """
    points = lamp_density(lamps, surfaces, at.side_id) * density_at(lamps.cells, at.triangle, at.u, at.v)
    return balance(density * at.geometric_cosine, points * at.distance * at.distance)
