# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of light objects that mirrors throw into gas that scatters.

No ray can meet a light, and no shadow ray finds it in a mirror; its photons find the mirror. So where a camera path is
scattered, photons tell how much of that light falls there, as those of caustics do on a surface. Each photon of a light
that has met nothing but specular surfaces leaves POINTS points on its way through gas: w T(t) / (POINTS p(t)) W m, with
w its power, T(t) the transmittance up to there and p(t), 1/m, the density with which the point was chosen. Over the
volume of a ball, the sum of those in it is the fluence there, W m-2 (photon points by expected values: Jensen and
Christensen 1998; Krivanek et al. 2014).

Half of the points lie anywhere on the way, half where the gas scatters, by the probability of the photon's own flight.
So a ball that reaches beyond a small puff, or into a hole of it, misses nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..geometry.flight import pick_band, scattering_in
from ..geometry.point_tree import FAR, WIDTH, PointTree, build_tree, morton_order
from ..geometry.segments import Air, add_depth, go_on, set_out
from ..physics.media import phase
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, put_vector, scaled, vector
from ..system.kernels import FAST_KERNEL, KERNEL, njit
from .photon_map import Neighbours, Query, neighbours_room, search
from .wave import MIRRORED, OF_LIGHT, STRAIGHT_FROM_LIGHT, Wave

POINTS = 4  # that a photon leaves on each of its ways; even
_NUMBERS = 2 * POINTS  # random numbers of a way
_LEAVING = 1 << 22  # first dimension of them
_JUDGED = 256  # points by which the largest ball is chosen
# The largest ball holds k points where they lie half as dense as in the middle of all: most have k, few a fixed radius.
_WIDER = 2.0


class Thrown(NamedTuple):
    """n points. position: (n, 3) float32, m. direction: (n, 3) float32, of unit length, in which light travels. power:
    (n, b) float32, W m. straight: (n,) bool, whether the photon has met nothing but mirrors."""

    position: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    straight: np.ndarray


def empty_thrown(count: int, bands: int) -> Thrown:
    """Room for count points."""
    return Thrown(*np.empty((2, count, 3), np.float32), np.empty((count, bands), np.float32), np.empty(count, np.bool_))


class ThrownMap(NamedTuple):
    """The points of a pass in the order of their tree, and how they are searched. tree: its leaves hold what those of a
    PhotonMap do, as if all lay on one plane. neighbours: k. reach2: m2, squared radius of the largest ball. shrink2:
    factor on the squared radius in this pass."""

    tree: PointTree
    points: Thrown
    neighbours: int
    reach2: float
    shrink2: float


def build_thrown_map(points: Thrown, neighbours: int, shrink2: float) -> ThrownMap:
    """The ThrownMap of some points, none too. neighbours: k. shrink2: see ThrownMap."""
    order = morton_order(points.position)
    points, count = Thrown(*(column[order] for column in points)), len(order)
    room = np.full((max(1, -(-count // WIDTH)) * WIDTH, 7), FAR)
    room[:count] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    room[:count, :3] = points.position
    tree = build_tree(np.ascontiguousarray(room.reshape(-1, WIDTH, 7).transpose(0, 2, 1)))
    found = ThrownMap(tree, points, neighbours, 0.0, shrink2)
    return found._replace(reach2=_choose_reach2(found)) if count else found


def _choose_reach2(thrown: ThrownMap) -> float:
    """Squared radius, m2, of the largest ball, see _WIDER. Where points are few, the k-th nearest is told by a nearer
    one."""
    count = len(thrown.points.straight)
    near = max(1, min(thrown.neighbours, count // 2))
    found = np.empty(min(_JUDGED, count))
    _fill_reach2(thrown, near, neighbours_room(near), found)
    return float(np.median(found)) * (_WIDER * thrown.neighbours / near) ** (2.0 / 3.0)


@njit(**KERNEL)
def _fill_reach2(thrown, near, room, found):
    """Fill found (n,) with the squared distances, m2, from n of the points to their neighbour number `near`."""
    count = thrown.points.straight.size
    for i in range(found.size):
        at = vector(thrown.points.position, i * count // found.size)
        found[i] = search(thrown, _query(at), near, FAR, room)[1]


@njit(inline="always")
def _query(point):
    """The Query of a point in gas: nothing but the distance counts."""
    one, zero = np.float32(1.0), np.float32(0.0)
    return Query((np.float32(point[0]), np.float32(point[1]), np.float32(point[2])), (one, zero, zero), zero)


def leave_points(air: Air, wave: Wave, keys: tuple[np.uint64, int], left: list[Thrown]) -> None:
    """Append to `left` the points that photons of a wave leave on their ways. keys: of the photons' random numbers, and
    number of the bounce."""
    bands, count = wave.power.shape[1], len(air.length)
    of_light = np.flatnonzero(wave.chain[:count] & (OF_LIGHT | MIRRORED) == OF_LIGHT | MIRRORED)
    if len(of_light):
        points = empty_thrown(POINTS * len(of_light), bands)
        found = _leave_points(air, wave, of_light, keys, np.empty((2, bands)), points)
        left.append(Thrown(*(column[:found] for column in points)))


@njit(**KERNEL)
def _leave_points(air, wave, of_light, keys, rooms, points):
    """rooms: (2, b), for the depth of scattering of the whole way, and |w| of bands that are scattered on it."""
    (key, bounce), (whole, weight), found = keys, (rooms[0], rooms[1]), np.int64(0)
    bands = air.bands
    for i in of_light:
        metres, total = _measure(air, i, wave.power[i], whole, weight) * air.length[i], 0.0
        for b in range(weight.size):
            total += weight[b]
        if not total > 0.0:
            continue
        path = path_key(key, wave.photon[i])
        way, start = vector(wave.direction, i), vector(wave.origin, i)
        for n in range(POINTS):
            u, v = uniform(path, _LEAVING + _NUMBERS * bounce + 2 * n), 0.0
            u = (n // 2 + u) / (POINTS // 2)
            c, sought = np.int64(0), np.inf
            if n % 2 == 1:
                v = uniform(path, _LEAVING + _NUMBERS * bounce + 2 * n + 1)
                c = pick_band(weight, v * total)
                sought = -math.log1p(u * math.expm1(-whole[c]))
            t = _advance(air, i, c, (sought, u * metres / air.length[i] if n % 2 == 0 else np.inf))
            density = 0.0
            for b in range(weight.size):
                if weight[b] > 0.0:
                    chance = weight[b] / total / -math.expm1(-whole[b])
                    density += chance * bands.scattering[b] * math.exp(-bands.scattered[b])
            density = 0.5 / metres + 0.5 * density
            put_vector((start[0] + t * way[0], start[1] + t * way[1], start[2] + t * way[2]), points.position, found)
            put_vector(scaled(way, 1.0 / air.length[i]), points.direction, found)
            for b in range(weight.size):
                points.power[found, b] = wave.power[i, b] * math.exp(-bands.depth[b]) / (POINTS * density)
            points.straight[found] = wave.chain[i] & STRAIGHT_FROM_LIGHT != 0
            found += 1
    return found


@njit(inline="always")
def _measure(air, i, power, whole, weight):
    """Fill whole (b,) with the depth of scattering of segment i, and weight (b,) with |power| where there is any;
    returns the distance to the end of the last medium, in units of the direction's length."""
    t, stop = 0.0, set_out(air, i)
    whole[:] = 0.0
    while stop < np.inf:
        add_depth(air, i, air.table.scattering, stop - t, whole)
        t, stop = stop, go_on(air, i, stop)
    for b in range(weight.size):
        weight[b] = abs(power[b]) if whole[b] > 0.0 else 0.0
    return t


@njit(inline="always")
def _advance(air, i, c, sought):
    """Go along segment i up to a depth of scattering in band c, or a distance, in units of the direction's length,
    whichever comes first; returns the distance. air.bands then tell depth, scattered and scattering, 1/m, there."""
    (left, goal), bands, t, stop = sought, air.bands, 0.0, set_out(air, i)
    bands.depth[:], bands.scattered[:], bands.scattering[:] = 0.0, 0.0, 0.0
    arrived = False
    while stop < np.inf and not arrived:
        of_c, end = scattering_in(air, i, c) * air.length[i], stop
        if of_c * (stop - t) > left:
            end, arrived = t + left / of_c, True
        if goal <= end:
            end, arrived = goal, True
        left -= of_c * (end - t)
        add_depth(air, i, air.table.extinction, end - t, bands.depth)
        add_depth(air, i, air.table.scattering, end - t, bands.scattered)
        t = end
        if arrived:
            add_depth(air, i, air.table.scattering, 1.0 / air.length[i], bands.scattering)
        else:
            stop = go_on(air, i, stop)
    return t


class Receiver(NamedTuple):
    """Where a camera path is scattered. point: (3,) floats, m. along: unit direction before. anisotropy: of the medium,
    (b,) or (1,). throughput: (b,) float32, before it is deflected. straight: whether light by mirrors alone counts, and
    no other."""

    point: tuple
    along: tuple
    anisotropy: np.ndarray
    throughput: np.ndarray
    straight: bool


@njit(**FAST_KERNEL)
def add_thrown(thrown: ThrownMap, receiver: Receiver, room: Neighbours, out: np.ndarray) -> None:
    """Add to out (b,) the light around a Receiver that its medium scatters along the path."""
    k, points, bound = thrown.neighbours, thrown.points, np.float32(thrown.reach2)
    count, r2 = search(thrown, _query(receiver.point), k, bound, room)
    r2 *= np.float32(thrown.shrink2)
    volume, g = 4.0 / 3.0 * math.pi * max(float(r2), 1e-30) ** 1.5, receiver.anisotropy
    for n in range(count):
        j = room.index[n]
        if not room.distance2[n] < r2 or (receiver.straight and not points.straight[j]):
            continue
        cosine = -dot(receiver.along, vector(points.direction, j))
        value = phase(g[0], cosine) / volume
        for b in range(receiver.throughput.size):
            if g.size > 1:
                value = phase(g[b], cosine) / volume
            out[b] += receiver.throughput[b] * points.power[j, b] * value
