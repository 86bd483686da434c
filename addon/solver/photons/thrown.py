# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of light objects that mirrors throw into gas that scatters.

No ray can meet a light, and no shadow ray finds it in a mirror; its photons find the mirror. So where a camera path is
scattered, photons tell how much of that light falls there, as those of caustics do on a surface. Each photon of a light
that has met nothing but specular surfaces leaves points on its way: w T(t) / p(t) W m, with w its power, T(t) the
transmittance up to there and p(t), 1/m, the density of its points (balance heuristic). Over the volume of a ball, the
sum of those in it is the fluence there, W m-2 (photon points by expected values: Jensen and Christensen 1998; Krivanek
et al. 2014).

Half of the points lie anywhere on the way, in gas or not, half where the gas scatters, by the probability of the
photon's own flight. So a ball that reaches beyond a small puff, or into a hole of it, misses nothing. Nor does one that
reaches behind a mirror or a wall: ways go on there, as if light came through the mirror, and went on through the wall,
and each point counts only on this side of both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..geometry.flight import advance, pick_band
from ..geometry.point_tree import FAR, WIDTH, PointTree, build_tree, morton_order
from ..geometry.segments import Air, Hits, Tracer, measure_depth
from ..geometry.surfaces import Surfaces
from ..physics.media import phase
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import difference, dot, put_vector, scaled, vector
from ..scene import Medium
from ..system.kernels import FAST_KERNEL, KERNEL, njit
from .photon_map import Neighbours, Query, neighbours_room, search
from .wave import MIRRORED, OF_LIGHT, STRAIGHT_FROM_LIGHT, Wave

_EACH = 2  # points that a photon leaves anywhere on each of its ways, and as many where the gas scatters
_NUMBERS = 4 * _EACH  # random numbers of a way
_LEAVING = 1 << 22  # first dimension of them
_STEEP = 0.25  # cosine to a surface below which ways go on behind it no farther
_JUDGED = 256  # points by which the largest ball is chosen
# The largest ball holds k points where they lie half as dense as in the middle of all: most have k, few a fixed radius.
_WIDER = 2.0


class Thrown(NamedTuple):
    """n points. position: (n, 3) float32, m. direction: (n, 3) float32, of unit length, in which light travels. power:
    (n, b) float32, W m. straight: (n,) bool, whether the photon has met nothing but mirrors. normal: (n, 2, 3) float32,
    of the surfaces where the way begins and ends, towards the way, 0 for none; height: (n, 2) float32, m, of the point
    over both."""

    position: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    straight: np.ndarray
    normal: np.ndarray
    height: np.ndarray


def empty_thrown(count: int, bands: int) -> Thrown:
    """Room for count points."""
    return Thrown(
        *np.empty((2, count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.bool_),
        np.empty((count, 2, 3), np.float32),
        np.empty((count, 2), np.float32),
    )


class Throwing(NamedTuple):
    """What is needed to find what mirrors throw. surfaces: that photons meet. radius: m, of a sphere around the origin
    that holds the scene. centre, around: m, of one that holds all that scatters but the world's gas; (3,). reach: m,
    radius of the largest ball, and how far ways go on behind surfaces. left: gets the points."""

    surfaces: Surfaces
    radius: float
    centre: np.ndarray
    around: float
    reach: float
    left: list[Thrown]


def prepare_throwing(surfaces: Surfaces, radius: float, media: tuple[Medium, ...], centre: np.ndarray) -> Throwing:
    """The Throwing of a trial, whose balls have no size. radius: see Throwing. centre: (3,) m, subtracted."""
    outlines = [each.outline for each in media if each.scatters and each.outline is not None]
    points = np.concatenate([np.zeros((0, 3)), *outlines]) - centre
    if len(points) == 0:
        return Throwing(surfaces, radius, np.zeros(3), 0.0, 0.0, [])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return Throwing(surfaces, radius, middle, float(np.linalg.norm(points - middle, axis=1).max()), 0.0, [])


class ThrownMap(NamedTuple):
    """The points of a pass in the order of their tree, and how they are searched. tree: its leaves hold what those of a
    PhotonMap do, as if all lay on one plane. neighbours: k. reach: m, radius of the largest ball. shrink2: factor on
    the squared radius in this pass."""

    tree: PointTree
    points: Thrown
    neighbours: int
    reach: float
    shrink2: float


def build_thrown_map(points: Thrown, neighbours: int, reach: float, shrink2: float) -> ThrownMap:
    """The ThrownMap of some points, none too. neighbours: k. reach, shrink2: see ThrownMap."""
    order = morton_order(points.position)
    points, count = Thrown(*(column[order] for column in points)), len(order)
    room = np.full((max(1, -(-count // WIDTH)) * WIDTH, 7), FAR)
    room[:count] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    room[:count, :3] = points.position
    tree = build_tree(np.ascontiguousarray(room.reshape(-1, WIDTH, 7).transpose(0, 2, 1)))
    return ThrownMap(tree, points, neighbours, reach, shrink2)


def choose_reach(left: list[Thrown], neighbours: int, share: float, most: float) -> float:
    """Radius, m, of the largest ball of k neighbours, see _WIDER, and no more than `most`; by what trial photons have
    left, of which there are a `share` of those of a pass. Where these are few, a nearer one stands for the k-th."""
    count = sum(len(points.straight) for points in left)
    if count < 2:
        return most
    near = min(neighbours, count // 2)
    trial = build_thrown_map(Thrown(*map(np.concatenate, zip(*left, strict=True))), near, 0.0, 1.0)
    found = np.empty(min(_JUDGED, count))
    _fill_reach2(trial, near, neighbours_room(near), found)
    return min(most, float(np.median(found)) ** 0.5 * (_WIDER * share * neighbours / near) ** (1.0 / 3.0))


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


def leave_points(tracer: Tracer, hits: Hits, air: Air, wave: Wave, keys: tuple[np.uint64, int], thrown: Throwing):
    """Append to thrown.left the points that photons of a wave leave on their ways to these hits. keys: of the photons'
    random numbers, and number of the bounce."""
    of_light = np.flatnonzero(wave.chain[: len(air.length)] & (OF_LIGHT | MIRRORED) == OF_LIGHT | MIRRORED)
    if len(of_light) == 0:
        return
    direction = wave.direction[of_light] / air.length[of_light, None]
    behind = tracer.trace_uncut(wave.origin[of_light], -wave.direction[of_light]).triangle
    rise, begins = _towards_way(thrown.surfaces, behind, direction)
    fall, ends = _towards_way(thrown.surfaces, hits.triangle[of_light], -direction)
    stop = np.where(hits.triangle >= 0, hits.distance * air.length, np.inf)[of_light]
    low, high = _ranges(air, wave.origin[of_light], direction, of_light, stop, thrown)
    low = np.maximum(low, -thrown.reach / np.maximum(rise, _STEEP))
    high = np.minimum(high, stop + thrown.reach / np.maximum(fall, _STEEP))
    some = np.flatnonzero(low < high)
    ways = _Ways(of_light[some], low[some], high[some], stop[some], np.stack((begins, ends), axis=1)[some])
    bands = wave.power.shape[1]
    points = empty_thrown(2 * _EACH * len(some), bands)
    found = _leave_points(air, wave, ways, keys, np.empty((2, bands)), points)
    thrown.left.append(Thrown(*(column[:found] for column in points)))


def _towards_way(surfaces: Surfaces, triangle: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosines (n,) of directions (n, 3) with surfaces, by triangle (n,) or -1, and their normals (n, 3) on the side of
    the direction. Without a surface 1, and 0."""
    met = triangle >= 0
    normal = np.where(met[:, None], surfaces.plane[triangle, :3], 0.0)
    cosine = np.einsum("ri,ri->r", normal, direction)
    return np.where(met, np.abs(cosine), 1.0), normal * np.sign(cosine)[:, None]


def _ranges(air, origin, direction, of_light, stop, thrown) -> tuple[np.ndarray, np.ndarray]:
    """Where rays (n,) have points anywhere, from and to, (n,) each, m: around what scatters on them; beside this, in
    the sphere around it. Those that leave the scene have none beyond."""
    ray, scatters = np.repeat(np.arange(len(air.length)), np.diff(air.first)), air.table.scattering.any(axis=1)
    lit = np.flatnonzero(scatters[air.medium])
    first, last = np.full(len(air.length), np.inf), np.full(len(air.length), -np.inf)
    np.minimum.at(first, ray[lit], (air.begin * air.length[ray])[lit])
    np.maximum.at(last, ray[lit], (air.end * air.length[ray])[lit])
    first, last = first[of_light], last[of_light]
    _, leaving = _chord(origin, direction, np.zeros(3), thrown.radius)
    last = np.where(stop < np.inf, last, np.minimum(last, np.maximum(leaving, 0.0)))
    begin, end = _chord(origin, direction, thrown.centre, thrown.around + thrown.reach)
    beside = first == np.inf
    return np.where(beside, begin, first - thrown.reach), np.where(beside, end, last + thrown.reach)


def _chord(origin, direction, centre, radius) -> tuple[np.ndarray, np.ndarray]:
    """Where rays of unit directions enter and leave a sphere, m, or would if they began earlier; the middle twice where
    they miss it."""
    middle = np.einsum("ri,ri->r", centre - origin, direction)
    nearest = origin + middle[:, None] * direction - centre
    half = np.sqrt(np.maximum(radius * radius - np.einsum("ri,ri->r", nearest, nearest), 0.0))
    return middle - half, middle + half


class _Ways(NamedTuple):
    """Ways of n photons. row: int64, of the wave. low, high, stop: float64, m, where points may lie anywhere, and where
    the way ends. normal: (n, 2, 3) float64, see Thrown."""

    row: np.ndarray
    low: np.ndarray
    high: np.ndarray
    stop: np.ndarray
    normal: np.ndarray


@njit(**KERNEL)
def _leave_points(air, wave, ways, keys, rooms, points):
    """rooms: (2, b), for the depth of scattering of the whole way, and |w| of bands that are scattered on it."""
    (key, bounce), (whole, weight), bands, found = keys, (rooms[0], rooms[1]), air.bands, np.int64(0)
    for row in range(ways.row.size):
        i, low, high = ways.row[row], ways.low[row], ways.high[row]
        path, way, start = path_key(key, wave.photon[i]), vector(wave.direction, i), vector(wave.origin, i)
        along, total = scaled(way, 1.0 / air.length[i]), _measure(air, i, wave.power[i], whole, weight)
        for n in range(2 * _EACH if total > 0.0 else _EACH):
            dimension = _LEAVING + _NUMBERS * bounce + 2 * n
            u, c, sought, goal = (n % _EACH + uniform(path, dimension)) / _EACH, np.int64(0), np.inf, np.inf
            if n < _EACH:
                goal = (low + u * (high - low)) / air.length[i]
            else:
                c = pick_band(weight, uniform(path, dimension + 1) * total)
                sought = -math.log1p(u * math.expm1(-whole[c]))
            t, _ = advance(air, i, c, sought, goal)
            metres = t * air.length[i]
            density = _EACH / (high - low) if n < _EACH or low < metres < high else 0.0
            for b in range(weight.size):
                if weight[b] > 0.0:
                    chance = weight[b] / total / -math.expm1(-whole[b])
                    density += _EACH * chance * bands.scattering[b] * math.exp(-bands.scattered[b])
            put_vector((start[0] + t * way[0], start[1] + t * way[1], start[2] + t * way[2]), points.position, found)
            put_vector(along, points.direction, found)
            for b in range(weight.size):
                points.power[found, b] = wave.power[i, b] * math.exp(-bands.depth[b]) / max(density, 1e-30)
            points.straight[found] = wave.chain[i] & STRAIGHT_FROM_LIGHT != 0
            for end in range(2):
                normal, far = vector(ways.normal[row], end), metres if end == 0 else metres - ways.stop[row]
                put_vector(normal, points.normal[found], end)
                rise = dot(along, normal)
                points.height[found, end] = far * rise if rise != 0.0 else 1.0
            found += 1
    return found


@njit(inline="always")
def _measure(air, i, power, whole, weight):
    """Fill whole (b,) with the depth of scattering of segment i, and weight (b,) with |power| where there is any;
    returns the sum of the latter."""
    total = 0.0
    measure_depth(air, i, air.table.scattering, whole)
    for b in range(weight.size):
        weight[b] = abs(power[b]) if whole[b] > 0.0 else 0.0
        total += weight[b]
    return total


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
    k, points, bound = thrown.neighbours, thrown.points, np.float32(thrown.reach * thrown.reach)
    count, r2 = search(thrown, _query(receiver.point), k, bound, room)
    r2 *= np.float32(thrown.shrink2)
    volume, g = 4.0 / 3.0 * math.pi * max(float(r2), 1e-30) ** 1.5, receiver.anisotropy
    for n in range(count):
        j = room.index[n]
        if not room.distance2[n] < r2 or (receiver.straight and not points.straight[j]):
            continue
        away, beyond = difference(receiver.point, vector(points.position, j)), False
        for end in range(2):
            beyond |= dot(away, vector(points.normal[j], end)) + points.height[j, end] < 0.0
        if beyond:
            continue
        cosine = -dot(receiver.along, vector(points.direction, j))
        value = phase(g[0], cosine) / volume
        for b in range(receiver.throughput.size):
            if g.size > 1:
                value = phase(g[b], cosine) / volume
            out[b] += receiver.throughput[b] * points.power[j, b] * value
