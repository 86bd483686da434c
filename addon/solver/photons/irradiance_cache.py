# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance at some points, found once a pass, for the many ends of final gathers (Christensen 1999).

The nearest point stands for what a ray meets. Points lie where a few such rays end, so they are as dense as they are
needed, and in bright places no denser than in dark ones: were they photons, the nearest would too often be a bright
one. From pass to pass they come closer, so that what this blurs vanishes as the blur of the photon map does.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..geometry.free_space import FreeSpace, largest_disk
from ..geometry.point_tree import WIDTH, PointTree, build_tree, empty_leaves, kd_order, open_node, start_walk
from ..geometry.surfaces import PATCH_LIMIT, Surfaces, Tracer, facing_side, point, put_ray, unit_normal
from ..sampling.rng import path_key, uniform
from ..sampling.warps import cosine_direction, to_world
from ..system.kernels import FAST_KERNEL, KERNEL, njit
from .photon_map import PhotonMap, gather, irradiance, leaf_distances, neighbours_room

_SHARE = 1.0 / 16.0  # rays that find points, over photons, in the first pass
_CHUNK = 512  # points


class IrradianceCache(NamedTuple):
    """Irradiance at n points: a tree whose leaves hold positions, normals and labels of sheets (see PhotonMap), and
    value (n, layers * b) float32, W m-2 per layer and band."""

    tree: PointTree
    value: np.ndarray


def cache_points(photons: int, shrink2: float) -> int:
    """Rays that are traced to say where the points lie, in a pass with so many photons and this shrink factor.

    As the area of disks shrinks, that between points shrinks like its root: soon enough, and affordable for long.
    """
    return max(1, min(photons, round(photons * _SHARE / math.sqrt(shrink2))))


class Places(NamedTuple):
    """Where camera paths gather, n of them: place, facing (n, 3) float64, code (n,) int32 as in Pilot, and the running
    sum of what they carry, carried (n,) float64."""

    place: np.ndarray
    facing: np.ndarray
    code: np.ndarray
    carried: np.ndarray


def ray_ends(
    tracer: Tracer, surfaces: Surfaces, places: Places, key: np.uint64, total: int
) -> tuple[np.ndarray, np.ndarray]:
    """Where `total` rays end that final gathers at these places might send: position (n, 3) float32, m, and code (n,)
    int32, 2 triangle + side, of those that meet a surface. key: of their random numbers."""
    origin, direction = np.empty((2, total if len(places.place) else 0, 3), np.float32)
    _start_rays(surfaces, places, key, origin, direction)
    return _ends(surfaces, *tracer.trace(origin, direction), direction)


@njit(**KERNEL)
def _start_rays(surfaces, places, key, origin, direction):
    for i in range(len(origin)):
        path = path_key(key, i)
        chosen = places.carried[-1] * ((i + uniform(path, 0)) / len(origin))
        j = min(np.searchsorted(places.carried, chosen), places.carried.size - 1)
        x, y, z = places.place[j]
        nx, ny, nz = places.facing[j]
        lx, ly, lz = cosine_direction(uniform(path, 1), uniform(path, 2))
        dx, dy, dz = to_world(lx, ly, lz, nx, ny, nz)
        put_ray(surfaces, places.code[j] >> 1, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, i)


@njit(cache=True, nogil=True)
def _ends(surfaces, triangle, u, v, direction):
    met = np.flatnonzero(triangle >= 0)
    place, code = np.empty((met.size, 3), np.float32), np.empty(met.size, np.int32)
    for n in range(met.size):
        i = met[n]
        place[n, 0], place[n, 1], place[n, 2] = point(surfaces.corners, triangle[i], u[i], v[i])
        code[n] = 2 * triangle[i] + facing_side(surfaces, triangle[i], direction, i)
    return place, code


def build_irradiance_cache(
    photon_map: PhotonMap,
    surfaces: Surfaces,
    estimate,
    place: np.ndarray,
    code: np.ndarray,
    feel: Callable[[np.ndarray, np.ndarray, int], FreeSpace],
    run=map,
    cancelled: Callable[[], bool] = lambda: False,
) -> IrradianceCache:
    """The cache of a pass.

    estimate: see Estimate. place: (n, 3) float32, m, code: (n,) int32, 2 triangle + side: the points. feel(place, code,
    first): the free space around points first, first + 1, ... run: map, or a pool's. cancelled: once it is true the
    cache stays unfinished.
    """
    order = kd_order(place)
    place, code = place[order], code[order]
    leaves = empty_leaves(len(code), 7)
    value = np.empty((len(code), estimate.layers * photon_map.photons.power.shape[1]), np.float32)

    def fill(first):
        if cancelled():
            return
        chosen = slice(first, first + _CHUNK)
        space = feel(place[chosen], code[chosen], first)
        fill_cache(photon_map, surfaces, estimate, place[chosen], code[chosen], space, first, leaves, value)

    list(run(fill, range(0, len(code), _CHUNK)))
    return IrradianceCache(build_tree(leaves), value)


def fill_cache(photon_map, surfaces, estimate, place, code, space, first, leaves, value):
    """Fill points first, first + 1, ... with what is at place (n, 3) on code (n,). space: around them."""
    room, patch = neighbours_room(estimate.neighbours), np.empty(PATCH_LIMIT, np.int32)
    out = np.empty(value.shape[1])
    _fill_cache(photon_map, surfaces, estimate, place, code, space, first, leaves, value, room, patch, out)


@njit(**FAST_KERNEL)
def _fill_cache(photon_map, surfaces, estimate, place, code, space, first, leaves, value, room, patch, out):
    guess = estimate.reach2
    for i in range(code.size):
        t, side = code[i] >> 1, code[i] & 1
        kept, area, guess = gather(
            photon_map, surfaces, t, side, float(place[i, 0]), float(place[i, 1]), float(place[i, 2]), space.wall[i],
            estimate.neighbours, largest_disk(space.cut2[i], estimate), estimate.shrink2, False, guess, room, patch,
        )  # fmt: skip
        irradiance(photon_map, room, kept, area, out)
        leaf, slot = (first + i) // WIDTH, (first + i) % WIDTH
        for axis in range(3):
            leaves[leaf, axis, slot] = place[i, axis]
        nx, ny, nz = unit_normal(surfaces, t, side)
        leaves[leaf, 3, slot], leaves[leaf, 4, slot], leaves[leaf, 5, slot] = nx, ny, nz
        leaves[leaf, 6, slot] = surfaces.sheet[t, side]
        for b in range(out.size):
            value[first + i, b] = out[b]


@njit(inline="always")
def recalled(cache, sheet, x, y, z, nx, ny, nz, reach2, walk):
    """Index of the nearest point on a sheet that faces the same way, nearer than sqrt(reach2) m, or -1.

    walk: room, see Walk.
    """
    tree, bound = cache.tree, np.float32(reach2)
    near = walk.near
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    nx, ny, nz, sheet = np.float32(nx), np.float32(ny), np.float32(nz), np.float32(sheet)
    best = -1
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, x, y, z, bound)
        for c in range(children - 1, -1, -1):
            if walk.apart[depth + c] >= bound:
                continue
            leaf = walk.stack[depth + c]
            leaf_distances(tree.leaves[leaf], sheet, x, y, z, nx, ny, nz, bound, near)
            for j in range(WIDTH):
                if near[j] < bound:
                    best, bound = leaf * WIDTH + j, near[j]
    return best
