# SPDX-License-Identifier: GPL-3.0-or-later
"""The photon map: photons sorted along a Morton curve under an implicit tree of boxes, and the radiance estimate.

Eight photons make a leaf, eight children a node, and both lie side by side in memory, so a node is tested with a few
vector instructions. Unlike a grid this does not care how unevenly photons lie (caustics, hot spots); unlike a kd-tree
it is built by one sort (tests/benchmarks/photon_index.py compares it with scipy's cKDTree).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .surfaces import PATCH_LIMIT, SAME_SURFACE, normal, patch_in_ball

_WIDTH = 8  # photons in a leaf, children of a node
_MORTON_BITS = 13  # per axis; the other 25 bits of a key hold the photon's number, which makes keys unique
MAX_PHOTONS = 1 << (64 - 3 * _MORTON_BITS)
_FAR = np.float32(1e30)  # coordinate of the padding in the last leaf


class Photons(NamedTuple):
    """Stored hits of one pass, n of them.

    position: (n, 3) float32, m. surface: (n,) int32, code 2 triangle + side. power: (n, b) float32, W per band.
    incoming: (n, 3) float32 unit vector back along the path for photons straight from a light (mirrors between count
        as straight), zeros for others; (0, 3) where the scene has no use for it.
    """

    position: np.ndarray
    surface: np.ndarray
    power: np.ndarray
    incoming: np.ndarray


class PhotonMap(NamedTuple):
    """Photons in Morton order with their tree.

    leaves: (n / 8, 3, 8) float32 positions. nodes: (sum of levels, 6, 8) float32, boxes of the children (lower x, y, z,
    upper x, y, z). starts: (levels + 1,) int64, first node of each level, level 0 right above the leaves.
    """

    leaves: np.ndarray
    nodes: np.ndarray
    starts: np.ndarray
    photons: Photons


@njit(inline="always")
def _spread(v):
    """Put two zero bits between the lower 21 bits of v."""
    v &= np.uint64(0x1FFFFF)
    v = (v | (v << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    v = (v | (v << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    v = (v | (v << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (v | (v << np.uint64(2))) & np.uint64(0x1249249249249249)


@njit(cache=True, nogil=True)
def _morton_keys(position, first, low, scale, keys):
    """Keys of the photons of one batch, whose first has the number `first`."""
    top = float((1 << _MORTON_BITS) - 1)
    for i in range(position.shape[0]):
        code = np.uint64(0)
        for axis in range(3):
            cell = np.uint64(min(top, max(0.0, (position[i, axis] - low[axis]) * scale)))
            code |= _spread(cell) << np.uint64(axis)
        keys[first + i] = (code << np.uint64(64 - 3 * _MORTON_BITS)) | np.uint64(first + i)


@njit(cache=True, nogil=True)
def _ranks(keys, ranks):
    """Place of every photon in the sorted order."""
    mask = np.uint64(MAX_PHOTONS - 1)
    for i in range(keys.size):
        ranks[keys[i] & mask] = i


@njit(cache=True, nogil=True)
def _place(batch, ranks, leaves, sorted_photons):
    """Move the photons of one batch to their places."""
    bands = batch.power.shape[1]
    directed = batch.incoming.shape[0] > 0
    for i in range(batch.position.shape[0]):
        rank = ranks[i]
        for axis in range(3):
            sorted_photons.position[rank, axis] = batch.position[i, axis]
            leaves[rank // _WIDTH, axis, rank % _WIDTH] = batch.position[i, axis]
        sorted_photons.surface[rank] = batch.surface[i]
        for b in range(bands):
            sorted_photons.power[rank, b] = batch.power[i, b]
        if directed:
            for axis in range(3):
                sorted_photons.incoming[rank, axis] = batch.incoming[i, axis]


@njit(cache=True, nogil=True)
def _build_nodes(leaves, nodes, starts):
    """Boxes of every level from the level below."""
    for level in range(starts.size - 1):
        below = leaves.shape[0] if level == 0 else starts[level] - starts[level - 1]
        for node in range(starts[level], starts[level + 1]):
            for c in range(_WIDTH):
                child = (node - starts[level]) * _WIDTH + c
                for axis in range(3):
                    low, high = _FAR, -_FAR
                    if child < below:
                        for j in range(_WIDTH):
                            if level == 0:
                                x = leaves[child, axis, j]
                                low = min(low, x)
                                high = max(high, x if x < _FAR else -_FAR)
                            else:
                                low = min(low, nodes[starts[level - 1] + child, axis, j])
                                high = max(high, nodes[starts[level - 1] + child, 3 + axis, j])
                    nodes[node, axis, c] = low
                    nodes[node, 3 + axis, c] = high if low < _FAR else low


def build_photon_map(batches: list[Photons], bands: int, bounds: tuple[np.ndarray, np.ndarray]) -> PhotonMap:
    """Photon map of the batches (with `bands` bands), which are taken out of the list one by one as their photons are placed.

    bounds: lowest and highest corner (3,) of the scene. The result depends on the batches' order alone.
    """
    sizes = [len(batch.surface) for batch in batches]
    n = sum(sizes)
    if n >= MAX_PHOTONS:
        raise MemoryError(f"{n} photons stored in one pass; at most {MAX_PHOTONS} are possible. Lower photons per pass.")
    firsts = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
    keys = np.empty(n, np.uint64)
    low = np.asarray(bounds[0], np.float64)
    scale = ((1 << _MORTON_BITS) - 1) / max(float(np.max(bounds[1] - bounds[0])), 1e-30)
    for batch, first in zip(batches, firsts[:-1], strict=True):
        _morton_keys(batch.position, first, low, scale, keys)
    keys.sort()
    ranks = np.empty(n, np.int64)
    _ranks(keys, ranks)
    directed = n if batches and batches[0].incoming.shape[0] else 0
    photons = Photons(
        np.empty((n, 3), np.float32),
        np.empty(n, np.int32),
        np.empty((n, bands), np.float32),
        np.empty((directed, 3), np.float32),
    )
    leaf_count = max(1, -(-n // _WIDTH))
    leaves = np.full((leaf_count, 3, _WIDTH), _FAR, np.float32)
    for first in firsts[:-1]:
        batch = batches.pop(0)
        _place(batch, ranks[first : first + len(batch.surface)], leaves, photons)
    counts = [-(-leaf_count // _WIDTH)]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // _WIDTH))
    starts = np.concatenate(([0], np.cumsum(counts))).astype(np.int64)
    nodes = np.empty((starts[-1], 6, _WIDTH), np.float32)
    _build_nodes(leaves, nodes, starts)
    return PhotonMap(leaves, nodes, starts, photons)


class Neighbours(NamedTuple):
    """Room for one search: numbers and squared distances of candidates, and the stack of nodes still to visit."""

    index: np.ndarray
    distance2: np.ndarray
    stack: np.ndarray
    near: np.ndarray


@njit(cache=True, nogil=True)
def neighbours_room(k):
    """Room for searches of k neighbours."""
    return Neighbours(
        np.empty(max(4 * k, 64) + _WIDTH, np.int32),
        np.empty(max(4 * k, 64) + _WIDTH, np.float32),
        np.empty(16 * _WIDTH, np.int64),
        np.empty(_WIDTH, np.float32),
    )


@njit(inline="always")
def _select(index, distance2, count, k):
    """Reorder the first count candidates so that the k nearest come first (Hoare's quickselect)."""
    low, high = 0, count - 1
    while low < high:
        pivot = distance2[(low + high) >> 1]
        i, j = low, high
        while i <= j:
            while distance2[i] < pivot:
                i += 1
            while distance2[j] > pivot:
                j -= 1
            if i <= j:
                distance2[i], distance2[j] = distance2[j], distance2[i]
                index[i], index[j] = index[j], index[i]
                i += 1
                j -= 1
        if k - 1 <= j:
            high = j
        elif k - 1 >= i:
            low = i
        else:
            break


@njit(inline="always")
def _search(photon_map, corners, k, x, y, z, nx, ny, nz, bound, room):
    """Collect the photons nearer than sqrt(bound) that face the normal's way; at most k of them, the nearest.

    Returns their number and the squared distance within which all are known: that of the k-th, or bound if fewer.
    """
    leaves, nodes, starts = photon_map.leaves, photon_map.nodes, photon_map.starts
    surface = photon_map.photons.surface
    index, distance2, stack, near = room.index, room.distance2, room.stack, room.near
    limit = max(4 * k, 64)
    count = 0
    top = starts.size - 2
    stack[0] = starts[top]
    depth = 1
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    last, facing = -1, False  # neighbouring photons mostly lie on one surface
    while depth > 0:
        depth -= 1
        node = stack[depth]
        level = 0
        while node >= starts[level + 1]:
            level += 1
        box = nodes[node]
        for c in range(_WIDTH):
            dx = max(max(box[0, c] - x, x - box[3, c]), np.float32(0.0))
            dy = max(max(box[1, c] - y, y - box[4, c]), np.float32(0.0))
            dz = max(max(box[2, c] - z, z - box[5, c]), np.float32(0.0))
            near[c] = dx * dx + dy * dy + dz * dz
        base = (node - starts[level]) * _WIDTH
        if level > 0:
            base += starts[level - 1]
            for c in range(_WIDTH):
                if near[c] < bound:
                    stack[depth] = base + c
                    depth += 1
            continue
        for c in range(_WIDTH):
            if near[c] >= bound:
                continue
            leaf = base + c
            p = leaves[leaf]
            for j in range(_WIDTH):
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                d2 = dx * dx + dy * dy + dz * dz
                if d2 < bound:
                    photon = leaf * _WIDTH + j
                    if surface[photon] != last:
                        last = surface[photon]
                        mx, my, mz, _ = normal(corners, last >> 1)
                        cosine = nx * mx + ny * my + nz * mz
                        facing = (cosine if last & 1 == 0 else -cosine) > SAME_SURFACE
                    if facing:
                        index[count] = photon
                        distance2[count] = d2
                        count += 1
            if count > limit:
                _select(index, distance2, count, k)
                count = k
                bound = distance2[0]
                for j in range(1, k):
                    bound = max(bound, distance2[j])
    if count >= k:
        _select(index, distance2, count, k)
        count = k
        bound = distance2[0]
        for j in range(1, k):
            bound = max(bound, distance2[j])
    return count, bound


@njit(cache=True, nogil=True)
def gather(photon_map, surfaces, t, side, x, y, z, k, reach2, shrink2, guess, room, patch):
    """Find the photons around a point on one side of triangle t, and the surface area they fell on.

    The disk is that of the k-th neighbour, or of radius sqrt(reach2) where fewer than k photons lie in it, and then
    shrunk: r^2 = shrink2 r_k^2. Of k neighbours the k-th is left out. Both together estimate the density without bias:
    for k neighbours E[(k - 1) / (density area)] = 1, and the fixed disk adds exactly what the limit cuts off that mean.
    Near edges the area is that of the surface really inside the disk, and only its photons count (patch_in_ball).

    guess: squared radius to try first; it changes the time, not the result.
    Returns the number of photons, listed first in room.index, the area (m2) and the squared distance for the next guess.
    """
    corners = surfaces.corners
    nx, ny, nz, _ = normal(corners, t)
    if side == 1:
        nx, ny, nz = -nx, -ny, -nz
    bound = np.float32(min(guess, reach2))
    limit = np.float32(reach2)
    while True:
        count, r2 = _search(photon_map, corners, k, x, y, z, nx, ny, nz, bound, room)
        if count >= k or bound >= limit:
            break
        bound = min(np.float32(4.0) * bound, limit)
    next_guess = 1.5 * r2
    disk2 = max(np.float32(shrink2 * r2), np.float32(1e-12) * limit)  # photons that all coincide still get an area
    members, area = patch_in_ball(corners, surfaces.neighbours, t, side, x, y, z, float(disk2), patch)
    kept = 0
    for i in range(count):
        if room.distance2[i] >= disk2:
            continue
        photon = room.index[i]
        code = photon_map.photons.surface[photon]
        inside = members > 0 and code == patch[0]
        if not inside:
            for j in range(1, members):
                inside |= patch[j] == code
            if members == 0:  # a mesh finer than the disk: what lies close to the tangent plane is the surface
                p = photon_map.photons.position[photon]
                height = (p[0] - x) * nx + (p[1] - y) * ny + (p[2] - z) * nz
                inside = 16.0 * height * height < disk2
        if inside:
            room.index[kept] = photon
            kept += 1
    return kept, area, next_guess


@njit(inline="always")
def irradiance(photon_map, room, count, area, out):
    """Fill out (b,) float64 with the irradiance of the gathered photons, W m-2 per band."""
    power = photon_map.photons.power
    out[:] = 0.0
    for i in range(count):
        row = power[room.index[i]]
        for b in range(out.size):
            out[b] += row[b]
    for b in range(out.size):
        out[b] /= area
