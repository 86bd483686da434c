# SPDX-License-Identifier: GPL-3.0-or-later
"""How triangles are connected: which coincide, which share an edge, and the sheets of surface that they form."""

import numpy as np

from ..system.kernels import INLINED, njit
from .sorting import first_alike

# Least cosine between two oriented normals that belong to one surface: of a photon and the point that gathers it, or of
# two neighbours in a sheet.
SAME_SURFACE = 0.8
_FEW = 64  # triangles or edges at a vertex that are compared in pairs; more are sorted


@njit(**INLINED)
def _hash(a, b, c):
    """64-bit hash of three words of 32 bits."""
    h = np.uint64(0xCBF29CE484222325)
    for word in (np.uint64(a), np.uint64(b), np.uint64(c)):
        h = (h ^ word) * np.uint64(0x9E3779B97F4A7C15)
        h ^= h >> np.uint64(29)
    return h


@njit(cache=True, nogil=True)
def first_at_point(vertices):
    """(n,) int32, for each vertex the first one at the same point. So surfaces stay connected over split normals, UV
    seams and separate objects. Points are compared by a hash of 64 bits: among five million different points two have
    the same hash with a chance of 7e-7."""
    bits, hashes = (vertices + np.float32(0.0)).view(np.uint32), np.empty(vertices.shape[0], np.uint64)  # -0 is 0
    for i in range(hashes.size):
        hashes[i] = _hash(bits[i, 0], bits[i, 1], bits[i, 2])
    return first_alike(hashes)


@njit(**INLINED)
def _sorted(triangles, first, t):
    """First vertices at the corners of triangle t, the lowest number first."""
    a, b, c = first[triangles[t, 0]], first[triangles[t, 1]], first[triangles[t, 2]]
    low, high = min(a, b, c), max(a, b, c)
    return low, a ^ b ^ c ^ low ^ high, high


@njit(cache=True, nogil=True)
def distinct(triangles, first):
    """(m,) bool, which triangles (m, 3) int32 are the first with their three corners. first: (n,) int32, see
    first_at_point. Those with the same lowest vertex are compared with each other."""
    begin, is_first = np.zeros(first.size + 1, np.int32), np.ones(triangles.shape[0], np.bool_)
    for t in range(triangles.shape[0]):
        begin[_sorted(triangles, first, t)[0]] += 1
    _end_buckets(begin)
    members = np.empty(triangles.shape[0], np.int32)
    for t in range(triangles.shape[0] - 1, -1, -1):  # backwards, so that each bucket is in order
        low = _sorted(triangles, first, t)[0]
        begin[low] -= 1
        members[begin[low]] = t
    room = np.empty(_FEW, np.uint64)
    for vertex in range(first.size):
        bucket = members[begin[vertex] : begin[vertex + 1]]
        keys = room if bucket.size <= _FEW else np.empty(bucket.size, np.uint64)
        for i in range(bucket.size):
            _, middle, high = _sorted(triangles, first, bucket[i])
            keys[i] = (np.uint64(middle) << np.uint64(32)) | np.uint64(high)
        if bucket.size <= _FEW:
            for i in range(1, bucket.size):
                for j in range(i):
                    if keys[i] == keys[j]:
                        is_first[bucket[i]] = False
        else:
            order = np.argsort(keys, kind="mergesort")
            for i in range(1, bucket.size):
                if keys[order[i]] == keys[order[i - 1]]:
                    is_first[bucket[order[i]]] = False
    return is_first


@njit(**INLINED)
def _end_buckets(begin):
    """Turn the sizes of buckets into where each ends; the last entry is the number of all members."""
    total = 0
    for i in range(begin.size):
        total += begin[i]
        begin[i] = total


@njit(cache=True, nogil=True)
def find_neighbours(triangles, first):
    """Adjacency over edges whose ends coincide, see Surfaces. first: (n,) int32, see first_at_point.

    Edges with the same lower vertex are compared with each other. Edge 3 t + i runs from corner i of triangle t to the
    next.
    """
    neighbours, begin = np.full((triangles.shape[0], 3), -1, np.int32), np.zeros(first.size + 1, np.int32)
    for t in range(triangles.shape[0]):
        a, b, c = first[triangles[t, 0]], first[triangles[t, 1]], first[triangles[t, 2]]
        begin[min(a, b)] += 1
        begin[min(b, c)] += 1
        begin[min(c, a)] += 1
    _end_buckets(begin)
    edge, other = np.empty(3 * triangles.shape[0], np.int32), np.empty(3 * triangles.shape[0], np.int32)
    for t in range(triangles.shape[0]):
        a, b, c = first[triangles[t, 0]], first[triangles[t, 1]], first[triangles[t, 2]]
        _put_edge(a, b, 3 * t, begin, edge, other)
        _put_edge(b, c, 3 * t + 1, begin, edge, other)
        _put_edge(c, a, 3 * t + 2, begin, edge, other)
    for vertex in range(first.size):
        start, stop = begin[vertex], begin[vertex + 1]
        if stop - start <= _FEW:
            _join_few(edge[start:stop], other[start:stop], neighbours)
        else:
            _join_many(edge[start:stop], other[start:stop], neighbours)
    return neighbours


@njit(**INLINED)
def _put_edge(a, b, e, begin, edge, other):
    """Put an edge from vertex a to vertex b into the bucket of the lower one: its number and twice the other vertex,
    plus 1 if it runs towards that."""
    low = min(a, b)
    begin[low] -= 1
    edge[begin[low]], other[begin[low]] = e, 2 * max(a, b) + (1 if a < b else 0)


@njit(**INLINED)
def _join_few(edge, other, neighbours):
    """Make neighbours over the edges (k,) of a bucket that have the same other end (k,), see _put_edge; overwrites it.

    An edge of three or more faces is treated as a border: a sheet has one neighbour at each edge.
    """
    for i in range(edge.size):
        if other[i] < 0:
            continue
        faces, partner, same = 1, i, 0
        for j in range(i + 1, edge.size):
            if other[j] >> 1 == other[i] >> 1:
                faces, partner, same = faces + 1, j, 1 if other[j] == other[i] else 0
                other[j] = -1
        if faces == 2:
            _join(edge[i], edge[partner], same, neighbours)


@njit(cache=True, nogil=True)
def _join_many(edge, other, neighbours):
    """As _join_few, by sorting."""
    order = np.argsort(other, kind="mergesort")
    i = 0
    while i < order.size:
        j = i + 1
        while j < order.size and other[order[j]] >> 1 == other[order[i]] >> 1:
            j += 1
        if j - i == 2:
            same = 1 if other[order[i]] == other[order[i + 1]] else 0
            _join(edge[order[i]], edge[order[i + 1]], same, neighbours)
        i = j


@njit(**INLINED)
def _join(e, f, same, neighbours):
    """Make two triangles neighbours over their edges e and f. same: 1 if these run from the same vertex, else 0."""
    neighbours[e // 3, e % 3] = 2 * (f // 3) + same
    neighbours[f // 3, f % 3] = 2 * (e // 3) + same


@njit(cache=True, nogil=True)
def label_sheets(plane, neighbours):
    """Label (m, 2) int32 of the sheet to which each side of each triangle belongs. Labels count from 0.

    A sheet is connected surface without creases, which a gather would not cross. Found by union-find.
    """
    parent = np.empty(2 * neighbours.shape[0], np.int32)
    for i in range(parent.size):
        parent[i] = i

    def find(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for t in range(neighbours.shape[0]):
        for i in range(3):
            other, flip = neighbours[t, i] >> 1, neighbours[t, i] & 1
            if other > t:  # each pair of neighbours once
                facing = plane[t, 0] * plane[other, 0] + plane[t, 1] * plane[other, 1] + plane[t, 2] * plane[other, 2]
                if (-facing if flip else facing) < SAME_SURFACE:
                    continue
                for side in range(2):
                    a, b = find(2 * t + side), find(2 * other + (side ^ flip))
                    if a < b:
                        parent[b] = a
                    else:
                        parent[a] = b
    for i in range(parent.size):  # then each side knows the first of its sheet
        parent[i] = parent[parent[i]]
    count = 0
    for i in range(parent.size):  # in place: -1 - label, as no number of a side is below 0
        if parent[i] == i:
            parent[i] = -1 - count
            count += 1
        else:
            parent[i] = parent[parent[i]]
    for i in range(parent.size):
        parent[i] = -1 - parent[i]
    return parent.reshape((neighbours.shape[0], 2))
