# SPDX-License-Identifier: GPL-3.0-or-later
"""The photon map: photons in a tree of points, and irradiance from the density of the nearest photons."""

import functools
import math
from typing import NamedTuple

import numpy as np

from ..geometry.area import (
    PATCH_LIMIT,
    Ball,
    beyond,
    in_slab,
    is_cut_off,
    is_small,
    patch_in_ball,
    region_area,
)
from ..geometry.mesh import SAME_SURFACE
from ..geometry.point_tree import (
    FAR,
    WIDTH,
    PointTree,
    Walk,
    build_tree,
    empty_leaves,
    empty_walk,
    morton_order,
    open_node,
    start_walk,
)
from ..geometry.surfaces import Surfaces, layer_of, sheet_of, unit_normal
from ..geometry.triangles import longest_edge
from ..sampling.vectors import difference, dot, vector
from ..system.kernels import FAST_KERNEL, INLINED, KERNEL, njit

MAX_PHOTONS = 2**31 - 1
# Factor on the squared radius of the last search, for the first try of the next one: a small factor costs repeated
# searches, a large one superfluous candidates.
_GUESS = 1.3
# See few_neighbours. Fewer photons blur less and are noisier. With 1, edges of caustics are further off than they
# state; with 0.2, a ring full of its caustic takes 1.7 times the time of 0.4 to one error (docs/accuracy.md).
_FEWER = 0.4


class Photons(NamedTuple):
    """Stored hits of one pass, n of them.

    position: (n, 3) float32, m. surface: (n,) int32, side_id. power: (n, b) float32, W per band.
    incoming: (n, 3) float32 unit vector back along the path for photons straight from a light (mirrors on the way count
        as straight), zeros for other photons; (0, 3) where the scene has no use for it.
    caustic: (n,) bool, whether the photon comes from a lamp or light by way of specular surfaces alone; (0,) where the
        scene has no caustics.
    layer: (n,) uint8, the layer of the image that it adds to (see layers); (0,) if there is but one.
    """

    position: np.ndarray
    surface: np.ndarray
    power: np.ndarray
    incoming: np.ndarray
    caustic: np.ndarray
    layer: np.ndarray


class PhotonStore:
    """Room for the photons of one pass, which grows as needed and is reused by the next pass."""

    def __init__(self, bands: int, incoming: bool, caustic: bool, layer: bool = False):
        """incoming, caustic, layer: see photon_arrays."""
        self.count = 0
        self._new = functools.partial(photon_arrays, bands=bands, incoming=incoming, caustic=caustic, layer=layer)
        self._room = self._new(0)

    @property
    def photons(self) -> Photons:
        """The photons stored so far, without a copy."""
        return Photons(*(array[: self.count] for array in self._room))

    def append(self, batch: Photons) -> None:
        """Copy a batch behind the photons that are there."""
        end = self.count + len(batch.surface)
        if end > MAX_PHOTONS:
            raise MemoryError(f"Over {MAX_PHOTONS} photons stored in one pass: lower the photons per pass")
        if end > len(self._room.surface):
            larger = self._new(end + end // 4)
            for old, new in zip(self._room, larger, strict=True):
                new[: min(self.count, len(new))] = old[: self.count]
            self._room = larger
        for array, values in zip(self._room, batch, strict=True):
            array[self.count : self.count + len(values)] = values
        self.count = end

    def clear(self) -> None:
        """Forget the photons, keep the room."""
        self.count = 0


def photon_arrays(count: int, bands: int, incoming: bool, caustic: bool, layer: bool) -> Photons:
    """Room for count photons. incoming, caustic, layer: whether photons store these, see Photons."""
    return Photons(
        np.empty((count, 3), np.float32),
        np.empty(count, np.int32),
        np.empty((count, bands), np.float32),
        np.empty((count if incoming else 0, 3), np.float32),
        np.empty(count if caustic else 0, np.bool_),
        np.empty(count if layer else 0, np.uint8),
    )


class PhotonMap(NamedTuple):
    """Photons in Morton order; the tree's leaves hold positions, oriented normals and labels of sheets.

    Labels are kept as float32, which tells 2^24 apart.
    """

    tree: PointTree
    photons: Photons


@njit(**KERNEL)
def _fill_leaves(photons, plane, sheet, leaves):
    """Put positions, normals and sheets of sorted photons into the leaves."""
    for i in range(photons.surface.size):
        leaf, slot = i // WIDTH, i % WIDTH
        side_id = photons.surface[i]
        sign = np.float32(1.0 if side_id & 1 == 0 else -1.0)
        for axis in range(3):
            leaves[leaf, axis, slot] = photons.position[i, axis]
            leaves[leaf, 3 + axis, slot] = sign * plane[side_id >> 1, axis]
        leaves[leaf, 6, slot] = sheet[side_id >> 1, side_id & 1]


@njit(cache=True, nogil=True)
def _cycles(order):
    """The cycles of the permutation i -> order[i], one behind the other, (n,) int32; ~i marks the start of a cycle.

    With the cycles known beforehand the processor can load rows ahead of time, as it knows where the next rows lie.
    """
    walk, n = np.empty(order.size, np.int32), 0
    seen = np.zeros(order.size, np.bool_)
    for i in range(order.size):
        j = i
        while not seen[j]:
            seen[j] = True
            walk[n] = ~j if j == i else j
            n += 1
            j = order[j]
    return walk


@njit(cache=True, nogil=True)
def _permute(rows, walk):
    """Fill every row of (n, c) with the next row of its cycle, without a second array. walk: see _cycles."""
    kept = np.empty(rows.shape[1], rows.dtype)
    for n in range(walk.size):
        i = walk[n]
        if i < 0:
            i = ~i
            for b in range(kept.size):
                kept[b] = rows[i, b]
        if n + 1 < walk.size and walk[n + 1] >= 0:
            for b in range(kept.size):
                rows[i, b] = rows[walk[n + 1], b]
        else:  # the end of a cycle is filled with its start
            for b in range(kept.size):
                rows[i, b] = kept[b]


@njit(cache=True, nogil=True)
def _coincident(position):
    """How many of sorted photons, position (n, 3), coincide with the photon before."""
    count = 0
    for i in range(1, len(position)):
        same = True
        for axis in range(3):
            same &= position[i, axis] == position[i - 1, axis]
        count += same
    return count


def _merged(photons: Photons) -> Photons:
    """Sorted photons, with photons at one point, on one side and of one layer merged into one.

    Where k photons or more coincide, the disk of the nearest k would have no radius and hold none. Merged into one
    photon, their power is spread over the largest disk and nothing is lost. If they came from different directions, the
    direction of the first stands for all.
    """
    starts = np.ones(len(photons.surface), np.bool_)
    starts[1:] = np.any(photons.position[1:] != photons.position[:-1], axis=1)
    for mark in (photons.surface, photons.caustic, photons.layer):
        if len(mark):
            starts[1:] |= mark[1:] != mark[:-1]
    first = np.flatnonzero(starts)
    firsts = Photons(*(array[first] if len(array) else array for array in photons))
    return firsts._replace(power=np.add.reduceat(photons.power, first))


def build_photon_map(photons: Photons, surfaces: Surfaces, run=map) -> PhotonMap:
    """Photon map of photons on the surfaces. The photons are sorted in their own arrays. run: map, or a pool's."""
    walk = _cycles(morton_order(photons.position))
    leaves = empty_leaves(len(walk), 7)

    def sort(power: bool):  # two jobs of about equal length
        marks = photons.caustic[:, None], photons.layer[:, None]
        others = (photons.position, photons.surface[:, None], photons.incoming, *marks)
        for rows in (photons.power,) if power else others:
            if len(rows):
                _permute(rows, walk)
        if not power:
            _fill_leaves(photons, surfaces.plane, surfaces.sheet, leaves)

    list(run(sort, (True, False)))
    if _coincident(photons.position):
        photons = _merged(photons)
        leaves = empty_leaves(len(photons.surface), 7)
        _fill_leaves(photons, surfaces.plane, surfaces.sheet, leaves)
    return PhotonMap(build_tree(leaves), photons)


class Neighbours(NamedTuple):
    """Room for one search: index (c,) int32 and distance2 (c,) float32, m2, of candidates; walk; edge (1,) float32, see
    _kth_smallest; patch (PATCH_LIMIT,) int32, side_ids of the triangles that the disk lies on."""

    index: np.ndarray
    distance2: np.ndarray
    walk: Walk
    edge: np.ndarray
    patch: np.ndarray


@njit(cache=True, nogil=True)
def neighbours_room(k):
    """Room for searches of k neighbours."""
    return Neighbours(
        np.empty(4 * k + 65 + WIDTH, np.int32),
        np.empty(4 * k + 65 + WIDTH, np.float32),
        empty_walk(),
        np.empty(1, np.float32),
        np.empty(PATCH_LIMIT, np.int32),
    )


class Query(NamedTuple):
    """What a search is for: points near a point (m), on the same sheet, with nearly the same normal. All float32."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    sheet: float


@njit(**INLINED)
def query_at(surfaces, side_id, point):
    """The Query of a point on a side."""
    n, sheet = unit_normal(surfaces, side_id), np.float32(sheet_of(surfaces, side_id))
    return Query(_single(point), _single(n), sheet)


@njit(**INLINED)
def _single(a):
    """A vector in float32."""
    return np.float32(a[0]), np.float32(a[1]), np.float32(a[2])


class Disk(NamedTuple):
    """How a gather chooses its disk.

    neighbours: k. reach2: m2, squared radius of the largest disk. shrink2: factor on the squared radius in this pass.
    wall: (3,) floats, 1 / m, see Ball. only_caustic: whether only the photons of caustics count.
    """

    neighbours: int
    reach2: float
    shrink2: float
    wall: tuple[float, float, float]
    only_caustic: bool


def few_neighbours(neighbours: int) -> int:
    """k of disks in which photons of caustics alone count, where others look for `neighbours`."""
    return max(2, round(_FEWER * neighbours))


@njit(**KERNEL)
def _kth_smallest(values, count, k, top, edge):
    """The k-th smallest (from 1) of the first count values, all >= 0, of which at least k are not above top.

    Squared distances within a disk are spread about evenly. So interpolation between a lower and an upper edge closes
    in on the k-th value within a few steps; the last few values are counted off from the nearer edge. Each step is a
    pass without branches over the values' bits, whose order as integers is the order of the values. edge: room, (1,)
    float32.
    """
    bits, edge_bits = values.view(np.int32), edge.view(np.int32)
    low, high = np.float32(0.0), np.nextafter(np.float32(top), np.float32(np.inf))
    below, under = 0, count  # how many values lie under each edge
    for _ in range(6):
        if k - below <= 3 or under - k <= 2:
            break
        edge[0] = low + (high - low) * np.float32((k - below - 0.5) / (under - below))
        if not low < edge[0] < high:
            break
        lower = np.int32(0)
        for i in range(count):
            lower += np.int32(bits[i] < edge_bits[0])
        if lower >= k:
            high, under = edge[0], lower
        else:
            low, below = edge[0], lower
    none_left = np.int32(0x7FFFFFFF)
    if k - below <= under - k + 1:
        edge[0] = low
        while True:
            least, same = none_left, np.int32(0)
            for i in range(count):
                least = min(least, bits[i] if bits[i] >= edge_bits[0] else none_left)
            for i in range(count):
                same += np.int32(bits[i] == least)
            below += same
            edge_bits[0] = least
            if below >= k:
                return edge[0]
            edge_bits[0] += np.int32(1)
    edge[0] = high
    while True:
        most, same = np.int32(-1), np.int32(0)
        for i in range(count):
            most = max(most, bits[i] if bits[i] < edge_bits[0] else np.int32(-1))
        for i in range(count):
            same += np.int32(bits[i] == most)
        under -= same
        edge_bits[0] = most
        if under < k:
            return edge[0]


@njit(inline="always")
def leaf_distances(leaf, query, other, near):
    """Fill near (WIDTH,) float32 with the squared distances, m2, of a leaf's points (see PhotonMap) from a Query.

    Points on other sheets, and points whose normal differs too much, get the value `other` instead. All float32.
    """
    (x, y, z), (nx, ny, nz) = query.point, query.normal
    for j in range(WIDTH):
        dx, dy, dz = leaf[0, j] - x, leaf[1, j] - y, leaf[2, j] - z
        cosine = leaf[3, j] * nx + leaf[4, j] * ny + leaf[5, j] * nz
        d2 = dx * dx + dy * dy + dz * dz
        near[j] = d2 if (cosine > np.float32(SAME_SURFACE)) & (leaf[6, j] == query.sheet) else other


@njit(inline="always")
def search(photon_map, query, k, bound, room):
    """List the photons of a Query that are nearer than sqrt(bound), and perhaps some others, in room.

    Returns how many are listed, and the squared distance within which all are listed: that of the k-th photon, or bound
    if there are fewer than k.
    """
    tree = photon_map.tree
    index, distance2, walk, near = room.index, room.distance2, room.walk, room.walk.near
    limit = 4 * k + 64
    count = np.int64(0)  # no literal, see kernels
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, query.point, bound)
        for c in range(children - 1, -1, -1):
            if walk.apart[depth + c] >= bound:
                continue
            leaf = walk.stack[depth + c]
            leaf_distances(tree.leaves[leaf], query, FAR, near)
            for j in range(WIDTH):  # no branch: which photons lie inside is as good as random
                index[count] = leaf * WIDTH + j
                distance2[count] = near[j]
                count += 1 if near[j] < bound else 0
            if count > limit:
                bound = _kth_smallest(distance2, count, k, bound, room.edge)
                kept = 0
                for j in range(count):
                    # many photons may lie at exactly the same distance: they must not push out nearer ones
                    if distance2[j] < bound or (distance2[j] == bound and kept < 2 * k):
                        index[kept], distance2[kept] = index[j], distance2[j]
                        kept += 1
                count = kept
    if count >= k:
        bound = _kth_smallest(distance2, count, k, bound, room.edge)
    return count, bound


@njit(inline="always")
def gather(photon_map, surfaces, side_id, point, disk, guess, room):
    """Find the photons around a point on a side, and the area of the surface on which they fell.

    The disk reaches to the k-th nearest photon, or to sqrt(reach2) where fewer than k photons lie within that radius,
    and then shrinks: r^2 = shrink2 r_k^2. The photon on the rim, the k-th, does not count. Together this estimates the
    density of photons without bias: for k neighbours E[(k - 1) / (density area)] = 1, and the disk of fixed radius adds
    exactly what the limit cuts off that mean. Near edges the area is that of the surface inside the disk, and only
    photons on that surface count (see patch_in_ball); beside a wall only the part on this side of the wall counts.

    disk: see Disk. guess: m2, about the squared distance to the k-th photon, such as that of a gather near by; it
    changes the time, not the result. Returns the number of photons, listed first in room.index, the area (m2) and the
    squared distance (m2) to the k-th photon, or reach2 where that is less.
    """
    x, y, z = point
    wx, wy, wz = disk.wall
    return _gather(
        photon_map, surfaces, np.int32(side_id), (np.float64(x), np.float64(y), np.float64(z)),
        Disk(disk.neighbours, np.float64(disk.reach2), np.float64(disk.shrink2), (wx, wy, wz), bool(disk.only_caustic)),
        np.float64(guess), room,
    )  # fmt: skip


@njit(**FAST_KERNEL)
def _gather(photon_map, surfaces, side_id, point, disk, guess, room):
    """gather, with one type for each argument whoever calls, so that it is compiled once."""
    k, photons = disk.neighbours, photon_map.photons
    query = query_at(surfaces, side_id, point)
    limit = np.float32(disk.reach2)
    smallest = np.float32(1e-12) * limit  # photons that all coincide still get an area
    bound = max(np.float32(min(_GUESS * guess, disk.reach2)), smallest)
    while True:
        count, r2 = search(photon_map, query, k, bound, room)
        if count >= k or bound >= limit:
            break
        bound = min(np.float32(4.0) * bound, limit)
    disk2 = max(np.float32(disk.shrink2 * r2), smallest)
    ball = Ball(point, np.float64(disk2), disk.wall)
    members, area = patch_in_ball(surfaces, side_id, ball, room.patch)
    if members == 0:  # a mesh much finer than the disk
        area = region_area(surfaces, side_id, ball, room.walk)
    if area <= 0.0:  # at a wall's foot float32 puts points beyond the rim, where nothing lies before the wall
        return 0, math.pi * disk2, r2
    index = room.index
    near = np.int64(0)
    for i in range(count):  # no branch here and below: the order is as good as random
        index[near] = index[i]
        near += 1 if room.distance2[i] < disk2 else 0
    if is_cut_off(disk.wall, disk2):
        before = 0
        for i in range(near):
            way = difference(vector(photons.position, index[i]), point)
            index[before] = index[i]
            before += 1 if beyond(disk.wall, way) <= 0.0 else 0
        near = before
    if disk.only_caustic:
        marked = 0
        for i in range(near):
            index[marked] = index[i]
            marked += 1 if photons.caustic[index[i]] else 0
        near = marked
    return _on_patch(photons, surfaces, side_id, ball, members, near, room), area, r2


@njit(**FAST_KERNEL)
def _on_patch(photons, surfaces, side_id, ball, members, near, room):
    """Keep, of the first `near` photons in room.index, the photons on the patch whose area is counted; returns how
    many.

    members: number of triangles of the patch, in room.patch; 0 where region_area measured the area.
    """
    index, patch, surface, kept = room.index, room.patch, photons.surface, 0
    if members == 1:
        for i in range(near):
            index[kept] = index[i]
            kept += 1 if surface[index[i]] == patch[0] else 0
        return kept
    sheet, n = sheet_of(surfaces, side_id), unit_normal(surfaces, side_id)
    disk2 = np.float32(ball.radius2)
    for i in range(near):
        photon, inside = index[i], False
        for j in range(members):
            inside |= patch[j] == surface[photon]
        if members == 0 and sheet_of(surfaces, surface[photon]) == sheet:
            height = dot(difference(vector(photons.position, photon), ball.center), n)
            small = is_small(np.float32(longest_edge(surfaces.corners, surface[photon] >> 1)), disk2)
            inside = in_slab(np.float32(height), disk2) if small else True
        if inside:
            index[kept] = photon
            kept += 1
    return kept


@njit(**FAST_KERNEL)
def irradiance(photon_map, room, count, area, out):
    """Fill out (layers * b,) float64 with the irradiance of the gathered photons, W m-2 per layer and band."""
    power, layer, index = photon_map.photons.power, photon_map.photons.layer, room.index
    bands = power.shape[1]
    out[:] = 0.0
    whole = 0 if layer.size else count - count % 4
    for i in range(0, whole, 4):  # four rows at a time: the sum is read and written a quarter as often
        p, q, r, s = power[index[i]], power[index[i + 1]], power[index[i + 2]], power[index[i + 3]]
        for b in range(bands):
            out[b] += (p[b] + q[b]) + (r[b] + s[b])
    for i in range(whole, count):
        row, first = power[index[i]], bands * layer_of(layer, index[i])
        for b in range(bands):
            out[first + b] += row[b]
    for b in range(out.size):
        out[b] /= area
