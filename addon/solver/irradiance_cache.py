# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance at some points, found once a pass, for the many ends of final gathers (Christensen 1999).

The nearest point stands for what a ray meets. Points lie where a few photons of their own would, independent of those
that are gathered: at a stored photon the density of photons is not what it is elsewhere. They lie about as far apart
as half a gather's radius, and come closer as it shrinks from pass to pass, so that what this blurs vanishes as the blur
of the photon map does.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit

from .free_space import largest_disk
from .photon_map import PhotonMap, gather, irradiance, neighbours_room
from .point_tree import WIDTH, PointTree, build_tree, empty_leaves, morton_ranks, open_node
from .sampling import FAST
from .surfaces import PATCH_LIMIT, SAME_SURFACE, Surfaces, unit_normal

_SHARE = 1.0 / 16.0  # points over photons in the first pass
_CHUNK = 512  # points


class IrradianceCache(NamedTuple):
    """Irradiance at n points: a tree whose leaves hold positions, normals and labels of sheets (see PhotonMap), and
    value (n, b) float32, W m-2 per band."""

    tree: PointTree
    value: np.ndarray


def cache_points(photons: int, shrink2: float) -> int:
    """Photons that are traced to say where the points lie, of a pass with so many photons and this shrink factor.

    As the area of disks shrinks, that between points shrinks like its root: soon enough, and affordable for long.
    """
    return max(1, min(photons, round(photons * _SHARE / math.sqrt(shrink2))))


def build_irradiance_cache(
    photon_map: PhotonMap,
    surfaces: Surfaces,
    estimate,
    place: np.ndarray,
    code: np.ndarray,
    feel: Callable[[np.ndarray, np.ndarray, int], np.ndarray],
    run=map,
    cancelled: Callable[[], bool] = lambda: False,
) -> IrradianceCache:
    """The cache of a pass.

    estimate: see Estimate. place: (n, 3) float32, m, code: (n,) int32, 2 triangle + side: the points. feel(place, code,
    first): squared radius (m2) of the free space around points first, first + 1, ..., (n,) float32. run: map, or a
    pool's. cancelled: once it is true the cache stays unfinished.
    """
    order = np.argsort(morton_ranks(place), kind="stable")
    place, code = place[order], code[order]
    leaves = empty_leaves(len(code), 7)
    value = np.empty((len(code), photon_map.photons.power.shape[1]), np.float32)

    def fill(first):
        if cancelled():
            return
        chosen = slice(first, first + _CHUNK)
        free2 = feel(place[chosen], code[chosen], first)
        fill_cache(photon_map, surfaces, estimate, place[chosen], code[chosen], free2, first, leaves, value)

    list(run(fill, range(0, len(code), _CHUNK)))
    return IrradianceCache(build_tree(leaves), value)


@njit(cache=True, nogil=True, fastmath=FAST)
def fill_cache(photon_map, surfaces, estimate, place, code, free2, first, leaves, value):
    """Fill points first, first + 1, ... with what is at place (n, 3) on code (n,). free2: (n,) m2."""
    room = neighbours_room(estimate.neighbours)
    patch = np.empty(PATCH_LIMIT, np.int32)
    out = np.empty(value.shape[1])
    guess = estimate.reach2
    for i in range(code.size):
        t, side = code[i] >> 1, code[i] & 1
        kept, area, guess = gather(
            photon_map, surfaces, t, side, float(place[i, 0]), float(place[i, 1]), float(place[i, 2]),
            estimate.neighbours, largest_disk(free2[i], estimate), estimate.shrink2, False, guess, room, patch,
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
def recalled(cache, sheet, x, y, z, nx, ny, nz, reach2, room):
    """Index of the nearest point on a sheet that faces the same way, nearer than sqrt(reach2) m, or -1.

    room: of a search, see neighbours_room.
    """
    tree, bound = cache.tree, np.float32(reach2)
    stack, near = room.stack, room.near
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    nx, ny, nz, sheet = np.float32(nx), np.float32(ny), np.float32(nz), np.float32(sheet)
    best = -1
    stack[0] = tree.starts[tree.starts.size - 2]
    depth = 1
    while depth > 0:
        depth, children = open_node(tree, stack, depth, x, y, z, bound, near)
        for c in range(children - 1, -1, -1):
            leaf = stack[depth + c]
            p = tree.leaves[leaf]
            for j in range(WIDTH):
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                cosine = p[3, j] * nx + p[4, j] * ny + p[5, j] * nz
                d2 = dx * dx + dy * dy + dz * dz
                near[j] = d2 if (cosine > np.float32(SAME_SURFACE)) & (p[6, j] == sheet) else bound
            for j in range(WIDTH):
                if near[j] < bound:
                    best, bound = leaf * WIDTH + j, near[j]
    return best
