# SPDX-License-Identifier: GPL-3.0-or-later
"""How triangles are connected: which coincide, which share an edge, and the sheets of surface that they form."""

import numpy as np

from ..system.kernels import INLINED, njit
from .sorting import first_alike, radix_sort

# Least cosine between two oriented normals that belong to one surface: of a photon and the point that gathers it, or of
# two neighbours in a sheet.
SAME_SURFACE = 0.8


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
    seams and separate objects. Points are compared by a hash, as in `distinct`."""
    bits, hashes = (vertices + np.float32(0.0)).view(np.uint32), np.empty(vertices.shape[0], np.uint64)  # -0 is 0
    for i in range(hashes.size):
        hashes[i] = _hash(bits[i, 0], bits[i, 1], bits[i, 2])
    return first_alike(hashes)


@njit(cache=True, nogil=True)
def distinct(triangles, first):
    """(m,) bool, which triangles (m, 3) int32 are the first with their three corners. They are compared by a hash of 64
    bits: among ten million different triangles two have the same hash with a chance of 3e-6."""
    hashes = np.empty(triangles.shape[0], np.uint64)
    for t in range(hashes.size):
        a, b, c = first[triangles[t, 0]], first[triangles[t, 1]], first[triangles[t, 2]]
        low, high = min(a, b, c), max(a, b, c)
        hashes[t] = _hash(low, a ^ b ^ c ^ low ^ high, high)
    return first_alike(hashes) == np.arange(hashes.size)


@njit(cache=True, nogil=True)
def find_neighbours(triangles, first):
    """Adjacency over edges whose ends coincide, see Surfaces. first: (n,) int32, see first_at_point."""
    neighbours = np.full((triangles.shape[0], 3), -1, np.int32)
    order, keys = radix_sort(_edge_keys(triangles, first))
    i = 0
    while i < order.size:
        j = i + 1
        while j < order.size and keys[j] == keys[i]:
            j += 1
        if j - i == 2:  # an edge of three or more faces is treated as a border: a sheet has one neighbour at each edge
            e, f = order[i], order[i + 1]
            same = first[triangles[e // 3, e % 3]] == first[triangles[f // 3, f % 3]]
            neighbours[e // 3, e % 3] = 2 * (f // 3) + (1 if same else 0)
            neighbours[f // 3, f % 3] = 2 * (e // 3) + (1 if same else 0)
        i = j
    return neighbours


@njit(cache=True, nogil=True)
def _edge_keys(triangles, first):
    """(3 m,) uint64 keys of edges; number 3 t + i runs from corner i to i + 1. A key holds both vertices."""
    bits = 1
    while first.size >> bits > 0:
        bits += 1
    keys = np.empty(3 * triangles.shape[0], np.uint64)
    for t in range(triangles.shape[0]):
        for i in range(3):
            a, b = first[triangles[t, i]], first[triangles[t, (i + 1) % 3]]
            keys[3 * t + i] = (np.uint64(min(a, b)) << np.uint64(bits)) | np.uint64(max(a, b))
    return keys


@njit(cache=True, nogil=True)
def label_sheets(plane, neighbours):
    """Label (m, 2) int32 of the sheet to which each side of each triangle belongs. Labels count from 0.

    A sheet is connected surface without creases, which a gather would not cross. Found by union-find.
    """
    parent = np.arange(2 * neighbours.shape[0]).astype(np.int32)

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
    label, count = np.empty_like(parent), 0
    for i in range(parent.size):
        root = find(i)  # the first side of its sheet
        label[i] = count if root == i else label[root]
        count += root == i
    return label.reshape((neighbours.shape[0], 2))
