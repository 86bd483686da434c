# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of points: points in an order that keeps neighbours together, under an implicit tree of boxes.

Sixteen points make a leaf and sixteen children make a node. The points of a leaf lie side by side in memory, as do the
children of a node, so that each is tested with a few vector instructions. Unlike a grid, such a tree stays fast however
unevenly points lie (caustics, hot spots). The order is that of a Morton curve, which takes one sort
(tests/benchmarks/photon_index.py compares it with scipy's cKDTree). For points that are searched far more often than
their number, it is the order of a kd-tree: this takes longer to find, and then a search for the nearest point opens
fewer leaves (docs/estimators.md).
"""

from typing import NamedTuple

import numpy as np

from ..system.kernels import FAST_INLINED, KERNEL, njit
from .sorting import radix_sort

WIDTH = 16  # points in a leaf, children of a node: one vector register of float32
FAR = np.float32(1e30)  # coordinate of the padding in the last leaf
_STACK = 10 * WIDTH  # room for the nodes that wait while another is open; enough for 16^8 points
_MORTON_BITS = 21  # per axis
_HALVES = 128  # room for the parts that wait to be halved: two of each size, 64 sizes


class PointTree(NamedTuple):
    """A tree of points.

    leaves: (l, c, w) float32, in each leaf c values of w points, x, y, z first. nodes: (nodes of all levels, 6, w)
    float32, boxes of the children: lower x, y, z, then upper x, y, z. starts: (levels + 1,) int64, first node of each
    level; level 0 is right above the leaves.
    """

    leaves: np.ndarray
    nodes: np.ndarray
    starts: np.ndarray


class Walk(NamedTuple):
    """Room for a walk through a tree. stack: (n,) int64, nodes that wait to be opened, the last one first. apart: (n,)
    float32, squared distances of these nodes. near: (w,) float32, a value for each child of a node or point of a
    leaf."""

    stack: np.ndarray
    apart: np.ndarray
    near: np.ndarray


@njit(cache=True, nogil=True)
def empty_walk():
    """Room for a walk."""
    return Walk(np.empty(_STACK, np.int64), np.empty(_STACK, np.float32), np.empty(WIDTH, np.float32))


def morton_order(position: np.ndarray) -> np.ndarray:
    """(n,) int32 numbers of (n, 3) float32 points in the order of a Morton curve; equal points stay in order."""
    keys = np.empty(len(position), np.uint64)
    _morton_keys(position, keys)
    return radix_sort(keys)[0]


@njit(cache=True, nogil=True)
def kd_order(position):
    """(n,) int32 numbers of (n, 3) float32 points in the order of a kd-tree (Bentley 1975) with WIDTH points a leaf.

    The points are halved along the axis of their largest extent, and each half likewise, down to the leaves. Every cut
    lies between two nodes of the tree.
    """
    points, order = position.copy(), np.arange(len(position)).astype(np.int32)
    waiting = np.empty((_HALVES, 2), np.int64)
    waiting[0] = 0, len(points)
    parts = 1
    while parts > 0:
        parts -= 1
        first, stop = waiting[parts]
        if stop - first <= WIDTH:
            continue
        unit = WIDTH  # points below a child of the smallest node that holds them all
        while unit * WIDTH < stop - first:
            unit *= WIDTH
        middle = first + max(1, int(0.5 * (stop - first) / unit + 0.5)) * unit
        _part(points, order, first, stop, middle, _longest_axis(points[first:stop]))
        waiting[parts], waiting[parts + 1] = (middle, stop), (first, middle)
        parts += 2
    return order


@njit(**KERNEL)
def _longest_axis(points):
    """The axis along which points extend furthest."""
    longest, furthest = 0, np.float32(-1.0)
    for axis in range(3):
        low = high = points[0, axis]
        for i in range(len(points)):
            low, high = min(low, points[i, axis]), max(high, points[i, axis])
        if high - low > furthest:
            longest, furthest = axis, high - low
    return longest


@njit(**KERNEL)
def _part(points, order, first, stop, middle, axis):
    """Reorder points first to stop - 1 so that, along an axis, those before `middle` are not above those behind (Hoare
    1961).

    order: (n,) int32, reordered with the points.
    """
    last = stop - 1
    while first < last:
        pivot = points[(first + last) >> 1, axis]
        i, j = first, last
        while i <= j:
            while points[i, axis] < pivot:
                i += 1
            while points[j, axis] > pivot:
                j -= 1
            if i <= j:
                for each in range(3):
                    points[i, each], points[j, each] = points[j, each], points[i, each]
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            return


def empty_leaves(count: int, values: int) -> np.ndarray:
    """Room for the leaves of count points with so many values each; the rest of the last leaf is padding."""
    leaves = np.empty((max(1, -(-count // WIDTH)), values, WIDTH), np.float32)
    leaves[-1] = FAR
    return leaves


def build_tree(leaves: np.ndarray, extent: int = -1) -> PointTree:
    """Tree over filled leaves. extent: row of the leaves that tells how far a thing reaches around its point, so that
    the boxes hold the whole thing; -1 for mere points.
    """
    counts = [-(-len(leaves) // WIDTH)]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // WIDTH))
    starts = np.concatenate(([0], np.cumsum(counts))).astype(np.int64)
    nodes = np.empty((starts[-1], 6, WIDTH), np.float32)
    _build_nodes(leaves, nodes, starts, extent)
    return PointTree(leaves, nodes, starts)


@njit(inline="always")
def _spread(v):
    """Put two zero bits between the lower 21 bits of v."""
    v = np.uint64(v) & np.uint64(0x1FFFFF)
    v = (v | (v << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    v = (v | (v << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    v = (v | (v << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (v | (v << np.uint64(2))) & np.uint64(0x1249249249249249)


@njit(**KERNEL)
def _morton_keys(position, keys):
    """Morton code of every point in the cube that holds them all."""
    lx, ly, lz, hx, hy, hz = FAR, FAR, FAR, -FAR, -FAR, -FAR
    for i in range(position.shape[0]):
        x, y, z = position[i, 0], position[i, 1], position[i, 2]
        lx, ly, lz = min(lx, x), min(ly, y), min(lz, z)
        hx, hy, hz = max(hx, x), max(hy, y), max(hz, z)
    top = np.float32((1 << _MORTON_BITS) - 1)
    scale = top / max(hx - lx, hy - ly, hz - lz, np.float32(1e-30))
    for i in range(position.shape[0]):
        x = np.uint32(min(top, (position[i, 0] - lx) * scale))
        y = np.uint32(min(top, (position[i, 1] - ly) * scale))
        z = np.uint32(min(top, (position[i, 2] - lz) * scale))
        keys[i] = _spread(x) | (_spread(y) << np.uint64(1)) | (_spread(z) << np.uint64(2))


@njit(**KERNEL)
def _build_nodes(leaves, nodes, starts, extent):
    """Fill the boxes of every level from the level below."""
    for level in range(starts.size - 1):
        below = leaves.shape[0] if level == 0 else starts[level] - starts[level - 1]
        for node in range(starts[level], starts[level + 1]):
            for c in range(WIDTH):
                child = (node - starts[level]) * WIDTH + c
                for axis in range(3):
                    low, high = FAR, -FAR
                    if child < below:
                        for j in range(WIDTH):
                            if level == 0:
                                x = leaves[child, axis, j]
                                around = leaves[child, extent, j] if extent >= 0 and x < FAR else np.float32(0.0)
                                low = min(low, x - around)
                                high = max(high, x + around if x < FAR else -FAR)
                            else:
                                low = min(low, nodes[starts[level - 1] + child, axis, j])
                                high = max(high, nodes[starts[level - 1] + child, 3 + axis, j])
                    nodes[node, axis, c] = low
                    nodes[node, 3 + axis, c] = high


@njit(inline="always")
def start_walk(tree, walk):
    """Put the root on the stack; returns the depth of the stack."""
    walk.stack[0], walk.apart[0] = tree.starts[tree.starts.size - 2], np.float32(0.0)
    return np.int64(1)  # no literal, see kernels


@njit(**FAST_INLINED)
def open_node(tree, walk, depth, point, bound):
    """Take the last node off the stack and open it, unless it is no nearer than sqrt(bound) any more.

    The children nearer than sqrt(bound) go on the stack. The nearest child goes last, so that it is opened first and a
    search can lower its bound soon. Returns the new depth of the stack, and how many leaves lie on the stack above that
    depth, the nearest last.
    """
    stack, apart, near = walk.stack, walk.apart, walk.near
    x, y, z = point
    depth -= 1
    if apart[depth] >= bound:
        return depth, 0
    node = stack[depth]
    level = 0
    while node >= tree.starts[level + 1]:
        level += 1
    box = tree.nodes[node]
    for c in range(WIDTH):
        dx = max(max(box[0, c] - x, x - box[3, c]), np.float32(0.0))
        dy = max(max(box[1, c] - y, y - box[4, c]), np.float32(0.0))
        dz = max(max(box[2, c] - z, z - box[5, c]), np.float32(0.0))
        near[c] = dx * dx + dy * dy + dz * dz
    base = (node - tree.starts[level]) * WIDTH
    if level > 0:
        base += tree.starts[level - 1]
    children, best, nearest = 0, 0, bound
    for c in range(WIDTH):  # no branch: which children are near is as good as random
        stack[depth + children], apart[depth + children] = base + c, near[c]
        best = children if near[c] < nearest else best
        nearest = near[c] if near[c] < nearest else nearest
        children += 1 if near[c] < bound else 0
    if children > 1:
        best, last = depth + best, depth + children - 1
        stack[best], stack[last] = stack[last], stack[best]
        apart[best], apart[last] = apart[last], apart[best]
    if level > 0:
        return depth + children, 0
    return depth, children
