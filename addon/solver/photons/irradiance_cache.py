# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance at some points, found once a pass, for the many ends of final gathers (Christensen 1999).

Where a ray of a final gather ends, the irradiance at the nearest cached point stands for the irradiance there. Cached
points lie where a few such rays end. So they are dense where rays end, and not denser where it is bright: if irradiance
were kept at photons, the nearest photon would too often be in a bright spot. From pass to pass the points lie closer,
so that the blur of the cache vanishes as the blur of the photon map does.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..geometry.free_space import LEAST_FREE, FreeSpace, free_space, largest_disk, wall_of
from ..geometry.interaction import interact, leave
from ..geometry.point_tree import WIDTH, PointTree, build_tree, empty_leaves, kd_order, open_node, start_walk
from ..geometry.segments import Tracer, empty_ray_batch
from ..geometry.surfaces import Surfaces, sheet_of, unit_normal
from ..physics.lobes import sample_diffuse
from ..sampling.low_discrepancy import lattice_point
from ..sampling.rng import path_key, uniform, uniforms
from ..sampling.vectors import moved, put_vector, scaled, vector
from ..system.kernels import FAST_KERNEL, INLINED, KERNEL, njit
from .photon_map import Disk, PhotonMap, gather, irradiance, leaf_distances, neighbours_room

_SHARE = 1.0 / 16.0  # rays that find the points of the cache, over photons, in the first pass
_CHUNK = 512  # points that are one piece of work
_LOOKING = 8  # first of the two random numbers of a point that turn these rays
LOOKS = 8  # rays from each point that tell how far away its surroundings are
# Largest radius r of a disk that tells the light at its centre, over h, with 1 / h^2 the mean of the inverse squared
# distances d to what is around: what changes the irradiance by r / d across a disk (Ward et al. 1988) cancels in it,
# and what is left goes with (r / d)^2. By the mean of 1 / d, and with 0.25, what is near but fills little of the view
# counts for too little: under the open sky the street's car reflects 0.03 K too much after 16 passes, now 0.01 +- 0.01
# K. Squared error times rays is 1 % more than then in the geometric mean of tests/benchmarks/speed_scenes.py, and what
# the mean of louvres 1 of tests/benchmarks/families.py is off by is the same. With 0.35 these are 3 % less and 1.7
# times as much.
_RESOLVED = 0.28
FARTHEST = 1e15  # m, of what is around a point, and of nothing: float32 holds its square


class IrradianceCache(NamedTuple):
    """Irradiance at n points: a tree whose leaves hold positions, normals, labels of sheets (see PhotonMap) and walls
    (see FreeSpace); value (n, layers * b) float32, W m-2 per layer and band; and resolved (n, 5) float32, of
    each point the near of its Vicinity times _RESOLVED, and the radius of its disk, m."""

    tree: PointTree
    value: np.ndarray
    resolved: np.ndarray


def cache_points(photons: int, shrink2: float) -> int:
    """Number of rays whose ends become the points of the cache, in a pass with so many photons and this shrink factor.

    The area of a disk shrinks with shrink2, the area for each point with the square root of shrink2: fast enough for
    the blur to vanish, slow enough to be affordable for many passes.
    """
    return max(1, min(photons, round(photons * _SHARE / math.sqrt(shrink2))))


class Vicinity(NamedTuple):
    """What is around n points. space: the FreeSpace along the surface. near: (n, 4) float64, m, h and its change per m
    along x, y, z, with 1 / h^2 the mean of the inverse squared distances to what tells on the light: what
    cosine-distributed rays meet, or lamps if these are closer; FARTHEST, without a change, where nothing is."""

    space: FreeSpace
    near: np.ndarray


class VisiblePoints(NamedTuple):
    """The n points where camera paths gather: point, normal (n, 3) float64, side_id (n,) int32 as in Pilot, and
    cumulative (n,) float64, the running sum of their throughputs."""

    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    cumulative: np.ndarray


def ray_ends(
    tracer: Tracer, surfaces: Surfaces, visible: VisiblePoints, key: np.uint64, total: int
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of `total` rays, as final gathers at visible points might send: point (n, 3) float32, m, and side_id (n,)
    int32 of the n rays that meet a surface. key: of the rays' random numbers."""
    rays = empty_ray_batch(total if len(visible.point) else 0)
    _start_rays(surfaces, visible, key, rays)
    return _ends(surfaces, tracer.trace(*rays), rays)


@njit(**KERNEL)
def _start_rays(surfaces, visible, key, rays):
    for i in range(len(rays.origin)):
        path = path_key(key, i)
        chosen = visible.cumulative[-1] * ((i + uniform(path, 0)) / len(rays.origin))
        j = min(np.searchsorted(visible.cumulative, chosen), visible.cumulative.size - 1)
        direction = sample_diffuse(vector(visible.normal, j), uniform(path, 1), uniform(path, 2))
        leave(surfaces, visible.side_id[j], vector(visible.point, j), direction, rays, i)


@njit(cache=True, nogil=True)
def _ends(surfaces, hits, rays):
    met = np.flatnonzero(hits.triangle >= 0)
    point, side_id = np.empty((met.size, 3), np.float32), np.empty(met.size, np.int32)
    for n in range(met.size):
        at = interact(surfaces, hits, met[n], rays.direction)
        put_vector(at.point, point, n)
        side_id[n] = at.side_id
    return point, side_id


def build_irradiance_cache(
    photon_map: PhotonMap,
    surfaces: Surfaces,
    estimate,
    points: tuple[np.ndarray, np.ndarray],
    look: Callable[[np.ndarray, np.ndarray, int], tuple[Vicinity, np.ndarray]],
    run=map,
    cancelled: Callable[[], bool] = lambda: False,
) -> IrradianceCache:
    """The cache of a pass.

    estimate: see Estimate. points: (n, 3) float32, m, and side_ids (n,) int32, see ray_ends. look(point, side_id,
    first): gives the Vicinity of points, which are number first, first + 1, ..., and the part of their direct light
    that photons do not find, W m-2, as in value. run: map, or a pool's. cancelled: once it returns true the cache stays
    unfinished.
    """
    order = kd_order(points[0])
    point, side_id = (column[order] for column in points)
    leaves, resolved = empty_leaves(len(side_id), 10), np.empty((len(side_id), 5), np.float32)
    value = np.empty((len(side_id), estimate.layers * photon_map.photons.power.shape[1]), np.float32)

    def fill(first):
        if cancelled():
            return
        chosen = slice(first, first + _CHUNK)
        vicinity, direct = look(point[chosen], side_id[chosen], first)
        fill_values(photon_map, surfaces, estimate, (point[chosen], side_id[chosen]), vicinity.space, value[chosen])
        value[chosen] += direct
        radius2 = _expected_radius2(surfaces, estimate, side_id[chosen], vicinity.space)
        resolved[chosen, :4], resolved[chosen, 4] = _RESOLVED * vicinity.near, np.sqrt(radius2)
        _fill_leaves(surfaces, point[chosen], side_id[chosen], vicinity.space.wall, first, leaves)

    list(run(fill, range(0, len(side_id), _CHUNK)))
    return IrradianceCache(build_tree(leaves), value, resolved)


@njit(**KERNEL)
def _fill_leaves(surfaces, point, side_id, wall, first, leaves):
    """Put points (n, 3) on sides (n,) into the leaves, as points number first, first + 1, ... wall: see FreeSpace."""
    for i in range(side_id.size):
        leaf, slot = (first + i) // WIDTH, (first + i) % WIDTH
        for axis in range(3):
            leaves[leaf, axis, slot] = point[i, axis]
        leaves[leaf, 3, slot], leaves[leaf, 4, slot], leaves[leaf, 5, slot] = unit_normal(surfaces, side_id[i])
        leaves[leaf, 6, slot] = sheet_of(surfaces, side_id[i])
        for axis in range(3):
            leaves[leaf, 7 + axis, slot] = wall[i, axis]


def _expected_radius2(surfaces: Surfaces, estimate, side_id: np.ndarray, space: FreeSpace) -> np.ndarray:
    """(n,) float64, m2, squared radii that the disks around points on sides (n,) are expected to have.

    It goes by the photons of the trial pass. If it went by those of this pass, points where many fell by chance would
    be recalled rather than others, and the image would be too bright.
    """
    sheet = surfaces.sheet[side_id >> 1, side_id & 1]
    free2 = np.maximum(space.cut2 / estimate.shrink2, LEAST_FREE * estimate.reach2)
    radius2 = estimate.neighbours / (math.pi * np.maximum(estimate.splitting.sheets.density[sheet], 1e-300))
    return estimate.shrink2 * np.minimum(np.minimum(free2, estimate.reach2), radius2)


def fill_values(photon_map, surfaces, estimate, points, space, value) -> None:
    """Fill value (n, layers * b) float32 with the irradiance at points (n, 3) on sides (n,). space: see FreeSpace."""
    rooms = neighbours_room(estimate.neighbours), np.empty(value.shape[1])
    _fill_values(photon_map, surfaces, estimate, points, space, value, rooms)


@njit(**FAST_KERNEL)
def _fill_values(photon_map, surfaces, estimate, points, space, value, rooms):
    guess, (point, side_id), (room, out) = estimate.reach2, points, rooms
    for i in range(side_id.size):
        reach2 = largest_disk(space.cut2[i], estimate)
        disk = Disk(estimate.neighbours, reach2, estimate.shrink2, wall_of(space, i), False)
        kept, area, guess = gather(photon_map, surfaces, side_id[i], vector(point, i), disk, guess, room)
        irradiance(photon_map, room, kept, area, out)
        for b in range(out.size):
            value[i, b] = out[b]


@njit(inline="always")
def recalled(cache, query, reach2, walk):
    """Index of the cached point nearest to a Query, -1 if none is nearer than sqrt(reach2) m or if that point does not
    tell the light here. A point does not count from beyond its wall, where other light falls. walk: room, see Walk."""
    tree, bound = cache.tree, np.float32(reach2)
    near = walk.near
    best = -1
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, query.point, bound)
        for c in range(children - 1, -1, -1):
            if walk.apart[depth + c] >= bound:
                continue
            leaf = walk.stack[depth + c]
            leaf_distances(tree.leaves[leaf], query, bound, near)
            for j in range(WIDTH):
                if near[j] < bound and not _is_beyond_wall(tree.leaves[leaf], j, query.point):
                    best, bound = leaf * WIDTH + j, near[j]
    return best if best >= 0 and _resolves(cache, best, query.point, bound) else -1


@njit(**INLINED)
def _resolves(cache, i, point, distance2):
    """Whether cached point i tells the light at a point so far (m2, squared) away.

    h is that of the middle between both, so that they could change places. Then what one loses another gains: judged by
    the h of the cached point, those where it is bright, close to lamps, would be passed over for those behind. With h'
    how h changes, as if a single thing were near, h^2 changes over a way x by 2 h h' x + h'^2 x^2.
    """
    leaf, j, near = cache.tree.leaves[i // WIDTH], i % WIDTH, cache.resolved[i]
    along = change2 = np.float32(0.0)
    for axis in range(3):
        along += near[1 + axis] * (point[axis] - leaf[axis, j])
        change2 += near[1 + axis] * near[1 + axis]
    middle2 = near[0] * near[0] + near[0] * along + np.float32(0.25) * change2 * distance2
    away = math.sqrt(distance2) + near[4]
    return away * away < middle2


@njit(**INLINED)
def _is_beyond_wall(leaf, j, point):
    """Whether a point lies beyond the wall of point j of a leaf, see FreeSpace."""
    across = np.float32(0.0)
    for axis in range(3):
        across += (point[axis] - leaf[axis, j]) * leaf[7 + axis, j]
    return across > np.float32(1.0)


def look_around(
    tracer: Tracer, surfaces: Surfaces, reach2: float, points: tuple[np.ndarray, np.ndarray], key: np.uint64, first: int
) -> Vicinity:
    """The Vicinity of points: (n, 3) float32, m, on sides (n,) int32, with free space of at most sqrt(reach2) m.

    key: of the random numbers of the points, which are number first, first + 1, ...
    """
    point, side_id = points[0].astype(np.float64), points[1]
    space = free_space(tracer, surfaces, reach2, point, side_id, uniforms(key, first, len(side_id)))
    rays, near = empty_ray_batch(LOOKS * len(side_id)), np.empty((len(side_id), 4))
    start_looks(surfaces, point, side_id, key, first, rays)
    _measure_near(tracer.trace(*rays), rays.direction, near)
    return Vicinity(space, near)


@njit(**KERNEL)
def start_looks(surfaces, point, side_id, key, first, rays):
    """Fill rays, LOOKS cosine-distributed ones from each of points (n, 3) on sides (n,), see look_around."""
    for i in range(side_id.size):
        path = path_key(key, first + i)
        n, u, v = unit_normal(surfaces, side_id[i]), uniform(path, _LOOKING), uniform(path, _LOOKING + 1)
        for look in range(LOOKS):
            direction = sample_diffuse(n, *lattice_point(look, LOOKS, u, v))
            leave(surfaces, side_id[i], vector(point, i), direction, rays, LOOKS * i + look)


@njit(**KERNEL)
def _measure_near(hits, direction, near):
    """Fill near, see Vicinity, from LOOKS rays of each point. All directions are of unit length."""
    for i in range(len(near)):
        mean2, change = 0.0, (0.0, 0.0, 0.0)
        for ray in range(LOOKS * i, LOOKS * (i + 1)):
            if hits.triangle[ray] >= 0:
                inverse = 1.0 / max(float(hits.distance[ray]), 1e-15)
                mean2 += inverse * inverse / LOOKS
                change = moved(change, inverse**3 / LOOKS, vector(direction, ray))
        put_near(mean2, change, near, i)


@njit(**INLINED)
def put_near(mean2, change, near, i):
    """Put h and its change into row i of near, see Vicinity. mean2: 1 / m2, the mean of 1 / d^2. change: 1 / m3, the
    mean of x / d^4, with x the way to what is at the distance d: half of how mean2 changes."""
    h = 1.0 / math.sqrt(max(mean2, FARTHEST**-2))
    near[i, 0] = h
    near[i, 1], near[i, 2], near[i, 3] = scaled(change, -h * h * h)
