# SPDX-License-Identifier: GPL-3.0-or-later
"""The photon map: photons sorted along a Morton curve under an implicit tree of boxes, and the radiance estimate.

Sixteen photons make a leaf, sixteen children a node, and both lie side by side in memory, so either is tested with a
few vector instructions. Unlike a grid this does not care how unevenly photons lie (caustics, hot spots); unlike a
kd-tree it is built by one sort (tests/benchmarks/photon_index.py compares it with scipy's cKDTree).
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from .surfaces import SAME_SURFACE, normal, patch_in_ball

_WIDTH = 16  # photons in a leaf, children of a node: one vector register of float32
_DIGIT = 11  # bits that one round of the radix sort looks at
_MORTON_BITS = 21  # per axis
MAX_PHOTONS = 2**31 - 1
_GUESS = 1.3  # on the squared radius of the last search, for the next: small costs repeats, large costs candidates
_FAR = np.float32(1e30)  # coordinate of the padding in the last leaf
_BINS = 64  # of squared distance, to find the k-th nearest


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


class PhotonStore:
    """Room for the photons of one pass that grows as needed and is used again by the next pass."""

    def __init__(self, bands: int, directed: bool):
        """directed: whether photons carry the direction they came from."""
        self.count = 0
        self._room = _photon_arrays(0, bands, directed)
        self._bands, self._directed = bands, directed

    @property
    def photons(self) -> Photons:
        """The photons stored so far, without a copy."""
        return Photons(*(array[: self.count] for array in self._room))

    def append(self, batch: Photons) -> None:
        """Copy a batch behind what is there."""
        end = self.count + len(batch.surface)
        if end > MAX_PHOTONS:
            raise MemoryError(f"Over {MAX_PHOTONS} photons stored in one pass: lower the photons per pass")
        if end > len(self._room.surface):
            larger = _photon_arrays(end + end // 4, self._bands, self._directed)
            for old, new in zip(self._room, larger, strict=True):
                new[: min(self.count, len(new))] = old[: self.count]
            self._room = larger
        for array, values in zip(self._room, batch, strict=True):
            array[self.count : self.count + len(values)] = values
        self.count = end

    def clear(self) -> None:
        """Forget the photons, keep the room."""
        self.count = 0


def _photon_arrays(count: int, bands: int, directed: bool) -> Photons:
    return Photons(
        np.empty((count, 3), np.float32),
        np.empty(count, np.int32),
        np.empty((count, bands), np.float32),
        np.empty((count if directed else 0, 3), np.float32),
    )


class PhotonMap(NamedTuple):
    """Photons in Morton order with their tree.

    leaves: (l, 6, w) float32, position and oriented normal of w photons a leaf. nodes: (sum of levels, 6, w) float32,
    boxes of the children (lower x, y, z, upper x, y, z). starts: (levels + 1,) int64, first node of each level, level 0
    right above the leaves.
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
def _morton_keys(position, low, scale, keys):
    """Morton code of every photon."""
    top = float((1 << _MORTON_BITS) - 1)
    for i in range(position.shape[0]):
        code = np.uint64(0)
        for axis in range(3):
            cell = np.uint64(min(top, max(0.0, (position[i, axis] - low[axis]) * scale)))
            code |= _spread(cell) << np.uint64(axis)
        keys[i] = code


@njit(cache=True, nogil=True)
def _radix_ranks(keys):
    """Place of every key in ascending order, equal keys in the order they came (least significant digit first).

    Overwrites the keys.
    """
    n = keys.size
    rounds = (3 * _MORTON_BITS + _DIGIT - 1) // _DIGIT
    buckets = 1 << _DIGIT
    mask = np.uint64(buckets - 1)
    histogram = np.zeros((rounds, buckets), np.int32)
    for i in range(n):
        for r in range(rounds):
            histogram[r, (keys[i] >> np.uint64(r * _DIGIT)) & mask] += 1
    order, other = np.arange(n).astype(np.int32), np.empty(n, np.int32)
    other_keys = np.empty_like(keys)
    for r in range(rounds):
        shift = np.uint64(r * _DIGIT)
        if n == 0 or histogram[r, (keys[0] >> shift) & mask] == n:
            continue  # all alike in this digit
        total = 0
        for bucket in range(buckets):
            size = histogram[r, bucket]
            histogram[r, bucket] = total
            total += size
        for i in range(n):
            bucket = (keys[i] >> shift) & mask
            place = histogram[r, bucket]
            histogram[r, bucket] = place + 1
            other_keys[place] = keys[i]
            other[place] = order[i]
        order, other = other, order
        keys, other_keys = other_keys, keys
    for i in range(n):
        other[order[i]] = i
    return other


@njit(cache=True, nogil=True)
def _fill_leaves(photons, corners, ranks, leaves):
    """Put positions and normals to their places in the leaves."""
    for i in range(ranks.size):
        leaf, slot = ranks[i] // _WIDTH, ranks[i] % _WIDTH
        code = photons.surface[i]
        nx, ny, nz, _ = normal(corners, code >> 1)
        sign = 1.0 if code & 1 == 0 else -1.0
        for axis in range(3):
            leaves[leaf, axis, slot] = photons.position[i, axis]
        leaves[leaf, 3, slot], leaves[leaf, 4, slot], leaves[leaf, 5, slot] = sign * nx, sign * ny, sign * nz


@njit(cache=True, nogil=True)
def _sort_in_place(photons, ranks):
    """Swap every photon to its place; leaves ranks as 0, 1, 2 ... Needs no second copy of the powers."""
    directed = photons.incoming.shape[0] > 0
    for i in range(ranks.size):
        while ranks[i] != i:
            j = ranks[i]
            ranks[i], ranks[j] = ranks[j], j
            photons.surface[i], photons.surface[j] = photons.surface[j], photons.surface[i]
            for axis in range(3):
                swap = photons.position[i, axis]
                photons.position[i, axis], photons.position[j, axis] = photons.position[j, axis], swap
                if directed:
                    swap = photons.incoming[i, axis]
                    photons.incoming[i, axis], photons.incoming[j, axis] = photons.incoming[j, axis], swap
            for b in range(photons.power.shape[1]):
                swap = photons.power[i, b]
                photons.power[i, b] = photons.power[j, b]
                photons.power[j, b] = swap


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


def build_photon_map(photons: Photons, corners: np.ndarray, bounds: tuple[np.ndarray, np.ndarray]) -> PhotonMap:
    """Photon map of photons, which are sorted in place.

    corners: of the surfaces. bounds: lowest and highest corner (3,) of the scene.
    """
    n = len(photons.surface)
    low = np.asarray(bounds[0], np.float64)
    scale = ((1 << _MORTON_BITS) - 1) / max(float(np.max(bounds[1] - bounds[0])), 1e-30)
    keys = np.empty(n, np.uint64)
    _morton_keys(photons.position, low, scale, keys)
    ranks = _radix_ranks(keys)
    leaf_count = max(1, -(-n // _WIDTH))
    leaves = np.empty((leaf_count, 6, _WIDTH), np.float32)
    leaves[-1] = _FAR  # the last leaf may have room to spare
    _fill_leaves(photons, corners, ranks, leaves)
    _sort_in_place(photons, ranks)
    counts = [-(-leaf_count // _WIDTH)]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // _WIDTH))
    starts = np.concatenate(([0], np.cumsum(counts))).astype(np.int64)
    nodes = np.empty((starts[-1], 6, _WIDTH), np.float32)
    _build_nodes(leaves, nodes, starts)
    return PhotonMap(leaves, nodes, starts, photons)


class Neighbours(NamedTuple):
    """Room for one search: numbers and squared distances of candidates, the stack of nodes still to visit, squared
    distances of a node's children or a leaf's photons, and a histogram."""

    index: np.ndarray
    distance2: np.ndarray
    stack: np.ndarray
    near: np.ndarray
    histogram: np.ndarray


@njit(cache=True, nogil=True)
def neighbours_room(k):
    """Room for searches of k neighbours."""
    return Neighbours(
        np.empty(4 * k + 65 + _WIDTH, np.int32),
        np.empty(4 * k + 65 + _WIDTH, np.float32),
        np.empty(8 * _WIDTH, np.int64),
        np.empty(_WIDTH, np.float32),
        np.empty(_BINS + 1, np.int32),
    )


@njit(cache=True, nogil=True)  # without fast-math, so that both loops put a value into the same bin
def _kth_smallest(values, count, k, top, histogram):
    """The k-th smallest (from 1) of the first count values, of which at least k are not above top.

    Squared distances within a disk are about evenly spread, so a histogram leaves a few to compare; where it does not
    (coincident photons) it is applied again to the bin, and in the end the bin's values are counted off one by one.
    """
    low, high, wanted = np.float32(0.0), np.nextafter(np.float32(top), np.float32(np.inf)), k
    for _ in range(8):
        scale = np.float32(_BINS) / (high - low)
        histogram[:] = 0
        for i in range(count):
            if low <= values[i] < high:
                histogram[min(np.int32((values[i] - low) * scale), _BINS)] += 1
        bin_ = 0
        while histogram[bin_] < wanted:
            wanted -= histogram[bin_]
            bin_ += 1
        smallest, largest = high, low  # of the values in the bin
        for i in range(count):
            if low <= values[i] < high and min(np.int32((values[i] - low) * scale), _BINS) == bin_:
                smallest, largest = min(smallest, values[i]), max(largest, values[i])
        if histogram[bin_] == 1 or smallest == largest:
            return smallest
        if wanted == 1:
            return smallest
        if wanted == histogram[bin_]:
            return largest
        low, high = smallest, np.nextafter(largest, np.float32(np.inf))
    while True:
        same, following = 0, high
        for i in range(count):
            if values[i] == low:
                same += 1
            elif low < values[i] < following:
                following = values[i]
        if same >= wanted:
            return low
        wanted -= same
        low = following


@njit(inline="always")
def _search(photon_map, k, x, y, z, nx, ny, nz, bound, room):
    """List the photons nearer than sqrt(bound) that face the normal's way, and some more, in room.

    Returns how many, and the squared distance within which all are known: that of the k-th, or bound if fewer.
    """
    leaves, nodes, starts = photon_map.leaves, photon_map.nodes, photon_map.starts
    index, distance2, stack, near = room.index, room.distance2, room.stack, room.near
    limit = 4 * k + 64
    count = 0
    stack[0] = starts[starts.size - 2]
    depth = 1
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
    nx, ny, nz = np.float32(nx), np.float32(ny), np.float32(nz)
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
        children = 0
        for c in range(_WIDTH):
            if near[c] < bound:
                stack[depth + children] = base + c
                children += 1
        for c in range(children):
            leaf = stack[depth + c]
            p = leaves[leaf]
            for j in range(_WIDTH):
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                cosine = p[3, j] * nx + p[4, j] * ny + p[5, j] * nz
                d2 = dx * dx + dy * dy + dz * dz
                near[j] = d2 if cosine > np.float32(SAME_SURFACE) else _FAR
            for j in range(_WIDTH):  # no branch: which photons lie inside is as good as random
                index[count] = leaf * _WIDTH + j
                distance2[count] = near[j]
                count += 1 if near[j] < bound else 0
            if count > limit:
                bound = _kth_smallest(distance2, count, k, bound, room.histogram)
                kept = 0
                for j in range(count):
                    if distance2[j] <= bound and kept < limit:  # many may lie at exactly one distance
                        index[kept], distance2[kept] = index[j], distance2[j]
                        kept += 1
                count = kept
    if count >= k:
        bound = _kth_smallest(distance2, count, k, bound, room.histogram)
    return count, bound


@njit(cache=True, nogil=True)
def gather(photon_map, surfaces, t, side, x, y, z, k, reach2, shrink2, guess, room, patch):
    """Find the photons around a point on one side of triangle t, and the surface area they fell on.

    The disk is that of the k-th neighbour, or of radius sqrt(reach2) where fewer than k photons lie in it, and then
    shrunk: r^2 = shrink2 r_k^2. Of k neighbours the k-th is left out. Both together estimate the density without bias:
    for k neighbours E[(k - 1) / (density area)] = 1, and the fixed disk adds exactly what the limit cuts off that mean.
    Near edges the area is that of the surface really inside the disk, and only its photons count (patch_in_ball).

    guess: squared radius to try first; it changes the time, not the result.
    Returns the number of photons, listed first in room.index, the area (m2) and the next guess (m2).
    """
    corners = surfaces.corners
    nx, ny, nz, _ = normal(corners, t)
    if side == 1:
        nx, ny, nz = -nx, -ny, -nz
    bound = np.float32(min(guess, reach2))
    limit = np.float32(reach2)
    while True:
        count, r2 = _search(photon_map, k, x, y, z, nx, ny, nz, bound, room)
        if count >= k or bound >= limit:
            break
        bound = min(np.float32(4.0) * bound, limit)
    next_guess = _GUESS * r2
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
