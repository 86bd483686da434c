# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles for the kernels: corners, adjacency, ray tracing, and the surface area inside a ball."""

import logging
import math
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ..physics.radiometry import stored_photons
from ..sampling.warps import to_world
from ..scene import Scene, SceneError
from ..system.kernels import FAST_KERNEL, INLINED, KERNEL, njit
from .point_tree import WIDTH, PointTree, build_tree, empty_leaves, morton_order, open_node, start_walk
from .sorting import first_alike, radix_sort

log = logging.getLogger(__name__)

# Cosine between two oriented normals below which a photon does not belong to the surface that gathers it.
SAME_SURFACE = 0.8
# Triangles whose area inside the gather disk is summed exactly; in finer meshes the disk counts as plane.
PATCH_LIMIT = 64
# Disk area over twice the area of a triangle and its neighbours, above which a disk touches more than PATCH_LIMIT.
_TOO_FINE = 6.0
CLEAR = 2.0**-20  # distance from a plane that float32 tells for sure, over the largest length that takes part
_LONGEST = 9  # row of a leaf of triangles with the length of the longest edge


class Surfaces(NamedTuple):
    """Geometry in solver coordinates (world minus `centre`).

    corners: (m, 3, 3) float32, m. material: (m,) int32. temperature: (m, 1) or (m, 3) float32, K.
    neighbours: (m, 3) int32, code 2 t + flip of the triangle across the edge from corner i to i + 1, -1 for none;
        flip is 1 where the two triangles wind differently.
    sheet: (m, 2) int32, label (from 0, none left out) of the connected surface without creases that each side belongs
        to.
    plane: (m, 4) float32, unit normal and clearance (m, see `offset`): what every hit asks for lies in one place.
    layer: (m,) uint8, the layer of the image that it emits into (see layers); (0,) if there is but one.
    mesh: tree over the triangles; its leaves hold centroid, normal, area, the sheets of both sides and the length of
        the longest edge. leaf_triangle: (m,) int32, which triangle is in each place of the leaves.
    """

    corners: np.ndarray
    material: np.ndarray
    temperature: np.ndarray
    neighbours: np.ndarray
    sheet: np.ndarray
    mesh: PointTree
    leaf_triangle: np.ndarray
    plane: np.ndarray
    layer: np.ndarray


class Tracer:
    """Embree's BVH over the triangles. Embree starts rays at 0, so origins must be off their surface (see `offset`)."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        """vertices (n, 3) float32, triangles (m, 3) int32. Builds the BVH at once, so threads never race for it."""
        self._scene = EmbreeScene()  # robust: no ray slips between two triangles that share an edge
        TriangleMesh(self._scene, vertices, triangles)
        self.trace(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None):
        """First hits of (n, 3) float32 rays: triangle (n,) int32 (-1 for none), u (n,), v (n,) float32.

        reach: (n,) float32 in units of the direction's length, overwritten. Releases the GIL.
        """
        hits = self._scene.run(origin, direction, reach, output=True)
        return hits["primID"], hits["u"], hits["v"]


class Geometry(NamedTuple):
    """What the triangles of a scene alone say, whatever their temperatures, and of their materials little.

    vertices, triangles: those of the Scene. stores: (triangles,) uint8, which photons they store, see `stored_photons`.
    kept: (m,) indices of the triangles that count.
    centre: (3,) float64, m, subtracted from the vertices, so that float32 resolves small detail.
    tracer: see Tracer. The others: see Surfaces.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    stores: np.ndarray
    kept: np.ndarray
    centre: np.ndarray
    tracer: Tracer
    corners: np.ndarray
    neighbours: np.ndarray
    sheet: np.ndarray
    mesh: PointTree
    leaf_triangle: np.ndarray
    plane: np.ndarray


def build_geometry(scene: Scene, earlier: Geometry | None = None) -> Geometry:
    """The geometry of a scene; that of an earlier scene itself, if all vertices, triangles and what they store are the
    same.

    Of triangles with the same corners only the first counts: a surface that is there twice does not emit twice. Those
    without an area emit nothing and cannot be hit; they are left out, as their edges would cut sheets in two. Sheets
    end where other photons are stored: the area that a gather divides by must be that on which its photons can lie.
    Raises SceneError if no triangle has an area.
    """
    stores = stored_photons(scene.materials, scene.band_edges)[scene.material]
    mine = scene.vertices, scene.triangles, stores
    if earlier and all(np.array_equal(old, new) for old, new in zip(earlier[:3], mine, strict=True)):
        return earlier
    triangles = np.ascontiguousarray(scene.triangles, dtype=np.int32)
    centre = _middle(scene.vertices, triangles)
    vertices = (scene.vertices - centre).astype(np.float32)
    place = _places(vertices)
    corners = vertices[triangles]
    first, extended = _distinct(triangles, place), areas(corners) > 0.0
    twice = np.count_nonzero(extended & ~first)
    if twice:
        log.warning("%d triangles lie exactly on others and are left out", twice)
    kept = np.flatnonzero(first & extended)
    if len(kept) == 0:
        raise SceneError("No triangle of the scene has an area")
    if len(kept) < len(triangles):
        triangles, corners = triangles[kept], corners[kept]
    neighbours = _neighbours(triangles, place)
    neighbours[stores[kept][neighbours >> 1] != stores[kept][:, None]] = -1
    plane = _planes(corners)
    sheet = _sheets(plane, neighbours)
    leaf_triangle = morton_order(centroids(corners))
    leaves = empty_leaves(len(corners), _LONGEST + 1)
    _fill_leaves(corners, sheet, leaf_triangle, leaves)
    return Geometry(
        vertices=scene.vertices,
        triangles=scene.triangles,
        stores=stores,
        kept=kept,
        centre=centre,
        tracer=Tracer(vertices, triangles),
        corners=corners,
        neighbours=neighbours,
        sheet=sheet,
        mesh=build_tree(leaves, _LONGEST),
        leaf_triangle=leaf_triangle,
        plane=plane,
    )


def _middle(vertices, triangles):
    """The middle (3,) float64, m, of the box around the vertices that triangles have."""
    used = np.zeros(len(vertices), np.bool_)
    used[triangles] = True
    if not used.all():
        vertices = vertices[used]
    return 0.5 * (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0))


def build_surfaces(
    scene: Scene, geometry: Geometry | None = None, layer: np.ndarray | None = None
) -> tuple[Surfaces, Tracer, np.ndarray]:
    """Surfaces, Tracer and the centre (3,) float64 that was subtracted.

    geometry: of an earlier scene, see above. layer: of each of the scene's triangles, None if there is but one.
    """
    geometry = build_geometry(scene, geometry)
    kept = geometry.kept
    surfaces = Surfaces(
        corners=geometry.corners,
        material=np.ascontiguousarray(scene.material[kept], dtype=np.int32),
        temperature=np.ascontiguousarray(scene.temperature[kept].reshape(len(kept), -1), dtype=np.float32),
        neighbours=geometry.neighbours,
        sheet=geometry.sheet,
        mesh=geometry.mesh,
        leaf_triangle=geometry.leaf_triangle,
        plane=geometry.plane,
        layer=np.empty(0, np.uint8) if layer is None else np.ascontiguousarray(layer[kept], np.uint8),
    )
    return surfaces, geometry.tracer, geometry.centre


@njit(**KERNEL)
def _fill_leaves(corners, sheet, leaf_triangle, leaves):
    """Put the triangles into the leaves of their tree."""
    for place in range(leaf_triangle.size):
        t, leaf, slot = leaf_triangle[place], place // WIDTH, place % WIDTH
        nx, ny, nz, double_area = normal(corners, t)
        leaves[leaf, 0, slot], leaves[leaf, 1, slot], leaves[leaf, 2, slot] = centroid(corners, t)
        leaves[leaf, 3, slot], leaves[leaf, 4, slot], leaves[leaf, 5, slot] = nx, ny, nz
        leaves[leaf, 6, slot] = 0.5 * double_area
        # float32 tells 2^24 labels apart; of more sheets, which only loose triangles are, two count as one here
        leaves[leaf, 7, slot], leaves[leaf, 8, slot] = sheet[t, 0], sheet[t, 1]
        leaves[leaf, _LONGEST, slot] = longest_edge(corners, t)


def sheet_count(surfaces: Surfaces) -> int:
    """How many sheets there are; each side of a triangle belongs to one."""
    return int(surfaces.sheet.max()) + 1


@njit(cache=True, nogil=True)
def scene_radius(corners):
    """Radius (m) of a sphere around the origin that holds (m, 3, 3) triangles."""
    most = 0.0
    for t in range(corners.shape[0]):
        for i in range(3):
            x, y, z = np.float64(corners[t, i, 0]), np.float64(corners[t, i, 1]), np.float64(corners[t, i, 2])
            most = max(most, x * x + y * y + z * z)
    return math.sqrt(most)


@njit(cache=True, nogil=True)
def areas(corners):
    """(m,) float64 areas of (m, 3, 3) triangles, m2."""
    area = np.empty(corners.shape[0])
    for t in range(corners.shape[0]):
        area[t] = 0.5 * normal(corners, t)[3]
    return area


@njit(cache=True, nogil=True)
def centroids(corners):
    """(m, 3) float32 centroids of (m, 3, 3) triangles, m."""
    middle = np.empty((corners.shape[0], 3), np.float32)
    for t in range(corners.shape[0]):
        middle[t, 0], middle[t, 1], middle[t, 2] = centroid(corners, t)
    return middle


@njit(**INLINED)
def centroid(corners, t):
    """Centroid of triangle t, m, float64."""
    third = 1.0 / 3.0
    return point(corners, t, third, third)


@njit(**INLINED)
def normal(corners, t):
    """Unit normal of triangle t and twice its area, float64 (numba's float() would keep float32)."""
    x, y, z = np.float64(corners[t, 0, 0]), np.float64(corners[t, 0, 1]), np.float64(corners[t, 0, 2])
    ax, ay, az = corners[t, 1, 0] - x, corners[t, 1, 1] - y, corners[t, 1, 2] - z
    bx, by, bz = corners[t, 2, 0] - x, corners[t, 2, 1] - y, corners[t, 2, 2] - z
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    inverse = 1.0 / length if length > 0.0 else 0.0
    return nx * inverse, ny * inverse, nz * inverse, length


@njit(**INLINED)
def unit_normal(surfaces, t, side=0):
    """Unit normal of a side of triangle t, float64 with the precision of float32."""
    sign = 1.0 - 2.0 * side
    plane = surfaces.plane
    return sign * plane[t, 0], sign * plane[t, 1], sign * plane[t, 2]


@njit(**INLINED)
def facing_side(surfaces, t, direction, i):
    """Side of triangle t that a ray meets."""
    plane = surfaces.plane
    towards = direction[i, 0] * plane[t, 0] + direction[i, 1] * plane[t, 1] + direction[i, 2] * plane[t, 2]
    return 1 if towards > 0.0 else 0


@njit(**INLINED)
def point(corners, t, u, v):
    """Point of triangle t with barycentric coordinates u, v of corners 1 and 2."""
    w = 1.0 - u - v
    return (
        w * corners[t, 0, 0] + u * corners[t, 1, 0] + v * corners[t, 2, 0],
        w * corners[t, 0, 1] + u * corners[t, 1, 1] + v * corners[t, 2, 1],
        w * corners[t, 0, 2] + u * corners[t, 1, 2] + v * corners[t, 2, 2],
    )


@njit(**INLINED)
def temperature_at(temperature, t, u, v):
    """Temperature on triangle t, linear between its corners, K."""
    if temperature.shape[1] == 1:
        return float(temperature[t, 0])
    return (1.0 - u - v) * temperature[t, 0] + u * temperature[t, 1] + v * temperature[t, 2]


@njit(**INLINED)
def layer_of(layer, i):
    """Entry i of an array of layers, which is empty if there is but one."""
    return int(layer[i]) if layer.size else 0


@njit(**INLINED)
def _edge(corners, t, i):
    """Length of the edge of triangle t from corner i to the next, m, float64."""
    square = 0.0
    for axis in range(3):
        edge = np.float64(corners[t, (i + 1) % 3, axis]) - corners[t, i, axis]
        square += edge * edge
    return math.sqrt(square)


@njit(**INLINED)
def longest_edge(corners, t):
    """Length of the longest edge of triangle t, m, float64."""
    return max(_edge(corners, t, 0), _edge(corners, t, 1), _edge(corners, t, 2))


@njit(inline="always")
def offset(corners, t):
    """Distance along the normal (m) that takes a ray's origin clear of triangle t in float32.

    The plane of a triangle is known to a few units in the last place of its coordinates, and Embree computes with
    differences between origin and corners, so the error grows with the largest coordinate. Its normal is the cross
    product of a short edge a and a long one c. That errs by a c units, which is a c / (2 A) of its length and moves the
    plane by a c^2 / (2 A) at the far end: with a + b >= c, at most 4 times the circumradius a b c / (4 A). So right
    needles, such as the sides of a pipe, are as exact as other triangles, obtuse ones are not (tests/test_surfaces.py).
    """
    reach = 0.0
    for i in range(3):
        for axis in range(3):
            reach = max(reach, abs(corners[t, i, axis]))
    double_area = normal(corners, t)[3]
    if double_area > 0.0:
        reach = max(reach, _edge(corners, t, 0) * _edge(corners, t, 1) * _edge(corners, t, 2) / (2.0 * double_area))
    return reach * CLEAR


@njit(cache=True, nogil=True)
def _planes(corners):
    plane = np.empty((corners.shape[0], 4), np.float32)
    for t in range(corners.shape[0]):
        plane[t, 0], plane[t, 1], plane[t, 2], _ = normal(corners, t)
        plane[t, 3] = offset(corners, t)
    return plane


@njit(**INLINED)
def clear_of(surfaces, t, x, y, z, nx, ny, nz):
    """Point of triangle t, moved along the normal of one side to where a ray may start or end (see `offset`)."""
    clear = surfaces.plane[t, 3]
    return x + clear * nx, y + clear * ny, z + clear * nz


@njit(**INLINED)
def put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, i):
    """Put ray i into origin and direction (n, 3): from a point of triangle t, clear of the side with the normal."""
    origin[i, 0], origin[i, 1], origin[i, 2] = clear_of(surfaces, t, x, y, z, nx, ny, nz)
    direction[i, 0], direction[i, 1], direction[i, 2] = dx, dy, dz


@njit(**INLINED)
def start_ray(surfaces, code, u, v, lx, ly, lz, origin, direction, i):
    """Put ray i into origin and direction (n, 3): from a point of side `code` (2 t + side) in a local direction."""
    t = code >> 1
    nx, ny, nz = unit_normal(surfaces, t, code & 1)
    x, y, z = point(surfaces.corners, t, u, v)
    dx, dy, dz = to_world(lx, ly, lz, nx, ny, nz)
    put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, i)


@njit(**INLINED)
def inverse_distance(surfaces, t, u, v, origin):
    """1 / m from a ray's origin to where it meets triangle t."""
    x, y, z = point(surfaces.corners, t, u, v)
    return 1.0 / math.sqrt(max((x - origin[0]) ** 2 + (y - origin[1]) ** 2 + (z - origin[2]) ** 2, 1e-30))


@njit(**INLINED)
def _hash(a, b, c):
    """64-bit hash of three words of 32 bits."""
    h = np.uint64(0xCBF29CE484222325)
    for word in (np.uint64(a), np.uint64(b), np.uint64(c)):
        h = (h ^ word) * np.uint64(0x9E3779B97F4A7C15)
        h ^= h >> np.uint64(29)
    return h


@njit(cache=True, nogil=True)
def _places(vertices):
    """(n,) int32, the first vertex in the place of each, by a hash as in _distinct: split normals, UV seams and
    separate objects still join."""
    bits, hashes = (vertices + np.float32(0.0)).view(np.uint32), np.empty(vertices.shape[0], np.uint64)  # -0 is 0
    for i in range(hashes.size):
        hashes[i] = _hash(bits[i, 0], bits[i, 1], bits[i, 2])
    return first_alike(hashes)


@njit(cache=True, nogil=True)
def _distinct(triangles, place):
    """(m,) bool, which triangles (m, 3) int32 are the first with their three corners, by a hash of 64 bits: two of ten
    million that differ share one with a chance of 3e-6."""
    hashes = np.empty(triangles.shape[0], np.uint64)
    for t in range(hashes.size):
        a, b, c = place[triangles[t, 0]], place[triangles[t, 1]], place[triangles[t, 2]]
        low, high = min(a, b, c), max(a, b, c)
        hashes[t] = _hash(low, a ^ b ^ c ^ low ^ high, high)
    return first_alike(hashes) == np.arange(hashes.size)


@njit(cache=True, nogil=True)
def _neighbours(triangles, place):
    """Adjacency over edges whose ends coincide, see Surfaces. place: (n,) int32, see _places."""
    neighbours = np.full((triangles.shape[0], 3), -1, np.int32)
    order, keys = radix_sort(_edge_keys(triangles, place))
    i = 0
    while i < order.size:
        j = i + 1
        while j < order.size and keys[j] == keys[i]:
            j += 1
        if j - i == 2:  # where three or more faces meet the surface is not one sheet: treat the edge as a border
            e, f = order[i], order[i + 1]
            same = place[triangles[e // 3, e % 3]] == place[triangles[f // 3, f % 3]]
            neighbours[e // 3, e % 3] = 2 * (f // 3) + (1 if same else 0)
            neighbours[f // 3, f % 3] = 2 * (e // 3) + (1 if same else 0)
        i = j
    return neighbours


@njit(cache=True, nogil=True)
def _edge_keys(triangles, place):
    """(3 m,) uint64 keys of the edges from corner i to i + 1, 3 t + i: the places of their ends, in few bits."""
    bits = 1
    while place.size >> bits > 0:
        bits += 1
    keys = np.empty(3 * triangles.shape[0], np.uint64)
    for t in range(triangles.shape[0]):
        for i in range(3):
            a, b = place[triangles[t, i]], place[triangles[t, (i + 1) % 3]]
            keys[3 * t + i] = (np.uint64(min(a, b)) << np.uint64(bits)) | np.uint64(max(a, b))
    return keys


@njit(cache=True, nogil=True)
def _sheets(plane, neighbours):
    """Label (m, 2) int32 of the sheet that each side of each triangle belongs to: connected, without a crease that a
    gather would not cross (union-find). Labels count from 0.
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
            if other > t:  # both know of each other
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
        root = find(i)  # the first of its sheet
        label[i] = count if root == i else label[root]
        count += root == i
    return label.reshape((neighbours.shape[0], 2))


@njit(**KERNEL)
def _wedge(ax, ay, bx, by, r2):
    """Signed area of the disk around the origin inside the triangle (origin, a, b)."""
    cross = ax * by - ay * bx
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0 or cross == 0.0:
        return 0.0
    along = -(ax * dx + ay * dy) / length2  # parameter of the point nearest to the origin
    gap2 = cross * cross / length2  # its squared distance
    if gap2 >= r2:
        return 0.5 * r2 * math.atan2(cross, ax * bx + ay * by)
    half = math.sqrt((r2 - gap2) / length2)
    t0, t1 = max(0.0, along - half), min(1.0, along + half)
    if t0 >= t1:
        return 0.5 * r2 * math.atan2(cross, ax * bx + ay * by)
    px, py, qx, qy = ax + t0 * dx, ay + t0 * dy, ax + t1 * dx, ay + t1 * dy
    area = 0.5 * (px * qy - py * qx)
    if t0 > 0.0:
        area += 0.5 * r2 * math.atan2(ax * py - ay * px, ax * px + ay * py)
    if t1 < 1.0:
        area += 0.5 * r2 * math.atan2(qx * by - qy * bx, qx * bx + qy * by)
    return area


NO_WALL = (np.float32(0.0),) * 3


@njit(**INLINED)
def beyond(wall, x, y, z):
    """How far beyond a wall a place (m) lies, as a share of the wall's distance: negative on this side.

    wall: (3,) float32, 1 / m, towards a plane at the distance 1 / |wall| from the origin, see FreeSpace.
    """
    return x * wall[0] + y * wall[1] + z * wall[2] - np.float32(1.0)


@njit(**INLINED)
def _reach2(wall, r2):
    """Squared radius of a disk over the squared distance of a wall, from this squared radius (m2)."""
    return (wall[0] * wall[0] + wall[1] * wall[1] + wall[2] * wall[2]) * r2


@njit(**INLINED)
def is_cut_off(wall, r2):
    """Whether a wall cuts the disk of this squared radius (m2) around the origin."""
    return _reach2(wall, r2) > 1.0


@njit(**INLINED)
def disk_before(wall, r2):
    """Area (m2) of the disk of this squared radius (m2) on this side of a wall: all but a segment."""
    if not is_cut_off(wall, r2):
        return math.pi * r2
    near = 1.0 / math.sqrt(_reach2(wall, r2))  # distance over the radius
    return r2 * (math.pi - math.acos(near) + near * math.sqrt(1.0 - near * near))


@njit(**KERNEL)
def area_in_ball(corners, t, x, y, z, r2, wall):
    """Area of triangle t inside the ball of squared radius r2 around (x, y, z), on this side of a wall, m2; exact."""
    nx, ny, nz, double_area = normal(corners, t)
    if double_area == 0.0:
        return 0.0
    ax, ay, az = corners[t, 0, 0] - x, corners[t, 0, 1] - y, corners[t, 0, 2] - z
    bx, by, bz = corners[t, 1, 0] - x, corners[t, 1, 1] - y, corners[t, 1, 2] - z
    cx, cy, cz = corners[t, 2, 0] - x, corners[t, 2, 1] - y, corners[t, 2, 2] - z
    height = ax * nx + ay * ny + az * nz
    r2 -= height * height
    if r2 <= 0.0:
        return 0.0
    # coordinates in the plane, along the first edge and across it
    ex, ey, ez = bx - ax, by - ay, bz - az
    inverse = 1.0 / math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex * inverse, ey * inverse, ez * inverse
    fx, fy, fz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
    a = (ax * ex + ay * ey + az * ez, ax * fx + ay * fy + az * fz, beyond(wall, ax, ay, az))
    b = (bx * ex + by * ey + bz * ez, bx * fx + by * fy + bz * fz, beyond(wall, bx, by, bz))
    c = (cx * ex + cy * ey + cz * ez, cx * fx + cy * fy + cz * fz, beyond(wall, cx, cy, cz))
    area, out, back = 0.0, a, a  # where the outline leaves this side of the wall and comes back
    for p, q in ((a, b), (b, c), (c, a)):
        if p[2] > 0.0 and q[2] > 0.0:
            continue
        if (p[2] > 0.0) != (q[2] > 0.0):
            s = p[2] / (p[2] - q[2])
            at = (p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), 0.0)
            if p[2] > 0.0:
                p = back = at
            else:
                q = out = at
        area += _wedge(p[0], p[1], q[0], q[1], r2)
    return area + _wedge(out[0], out[1], back[0], back[1], r2)


@njit(**INLINED)
def _edge_distance2(corners, t, i, x, y, z):
    """Squared distance of a point from edge i of triangle t."""
    j = (i + 1) % 3
    ax, ay, az = float(corners[t, i, 0]), float(corners[t, i, 1]), float(corners[t, i, 2])
    dx, dy, dz = corners[t, j, 0] - ax, corners[t, j, 1] - ay, corners[t, j, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    length2 = dx * dx + dy * dy + dz * dz
    s = min(1.0, max(0.0, (px * dx + py * dy + pz * dz) / length2)) if length2 > 0.0 else 0.0
    px, py, pz = px - s * dx, py - s * dy, pz - s * dz
    return px * px + py * py + pz * pz


@njit(**KERNEL)
def patch_in_ball(corners, neighbours, t, side, x, y, z, r2, wall, patch):
    """The sheet of surface around a point of triangle t that a gather in the ball may count.

    Walks from t over shared edges to the triangles that reach into the ball and face the same way. Fills patch
    (PATCH_LIMIT,) int32 with codes 2 t + side and returns their number and their area inside the ball on this side of a
    wall, m2. A mesh that is too fine for that, or may be, as triangle t and its neighbours are small and none of its
    edges is a rim, returns 0 members: there `region_area` measures.
    """
    nx, ny, nz, around = normal(corners, t)
    if side == 1:
        nx, ny, nz = -nx, -ny, -nz
    patch[0] = 2 * t + side
    disk = disk_before(wall, r2)
    crossed = False
    for i in range(3):
        crossed |= _edge_distance2(corners, t, i, x, y, z) < r2
    if not crossed:
        return 1, disk
    rim = False
    for i in range(3):
        rim |= neighbours[t, i] < 0
        if neighbours[t, i] >= 0:
            mx, my, mz, double_area = normal(corners, neighbours[t, i] >> 1)
            rim |= abs(nx * mx + ny * my + nz * mz) < SAME_SURFACE
            around += double_area
    if not rim and math.pi * r2 > _TOO_FINE * around:  # do not walk PATCH_LIMIT triangles to find them too many
        return 0, disk
    count, done, area = 1, 0, 0.0
    while done < count:
        current, current_side = patch[done] >> 1, patch[done] & 1
        done += 1
        area += area_in_ball(corners, current, x, y, z, r2, wall)
        for i in range(3):
            code = neighbours[current, i]
            if code < 0 or _edge_distance2(corners, current, i, x, y, z) >= r2:
                continue
            code ^= current_side  # 2 t + side of the same side of the sheet
            mx, my, mz, _ = normal(corners, code >> 1)
            facing = nx * mx + ny * my + nz * mz
            if (facing if code & 1 == 0 else -facing) < SAME_SURFACE:
                continue
            known = False
            for j in range(count):
                known |= patch[j] == code
            if not known:
                if count == PATCH_LIMIT:
                    return 0, disk
                patch[count] = code
                count += 1
    return count, abs(area)


@njit(inline="always")
def is_small(longest, disk2):
    """Whether a triangle with this longest edge (m) is so small against a disk of this squared radius (m2) that its
    centroid says whether it is inside. Needles are not, whatever their area. All float32.
    """
    return np.float32(8.0) * longest * longest <= disk2


@njit(inline="always")
def in_slab(height, disk2):
    """Whether a point of a small triangle at this height (m) over the tangent plane counts to the surface around.

    Photons and area are measured over the same region, so that their ratio is unbiased whatever the region. float32.
    """
    return np.float32(16.0) * height * height < disk2


@njit(**FAST_KERNEL)
def region_area(surfaces, t, side, x, y, z, r2, wall, walk):
    """Area (m2) inside the ball around a point of triangle t, on this side of a wall, of the triangles of the side's
    sheet that face the same way.

    Most are small here and count as a whole if their centroid is inside: that errs by a few percent at random, not in
    the mean. Of larger ones the part inside is exact. It is no less than what triangle t has inside. walk: room, see
    Walk.
    """
    tree, near = surfaces.mesh, walk.near
    place = (x, y, z, r2, wall)
    nx, ny, nz = unit_normal(surfaces, t, side)
    sheet, least = surfaces.sheet[t, side], abs(area_in_ball(surfaces.corners, t, *place))
    x, y, z, r2 = np.float32(x), np.float32(y), np.float32(z), np.float32(r2)
    nx, ny, nz = np.float32(nx), np.float32(ny), np.float32(nz)
    sheet, facing = np.float32(sheet), np.float32(SAME_SURFACE)
    total = 0.0
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, x, y, z, r2)
        for c in range(children):
            leaf = walk.stack[depth + c]
            p = tree.leaves[leaf]
            part, large = np.float32(0.0), np.int32(0)
            for j in range(WIDTH):  # no branch, so that a register holds the leaf
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                cosine = p[3, j] * nx + p[4, j] * ny + p[5, j] * nz
                height = dx * nx + dy * ny + dz * nz
                front = (cosine > facing) & (p[7, j] == sheet)
                back = (cosine < -facing) & (p[8, j] == sheet)
                small = is_small(p[_LONGEST, j], r2)
                inside = small & (dx * dx + dy * dy + dz * dz < r2) & in_slab(height, r2)
                inside &= beyond(wall, dx, dy, dz) <= np.float32(0.0)
                part += p[6, j] if (front | back) & inside else np.float32(0.0)
                near[j] = np.float32((front | back) & ~small)
                large += np.int32((front | back) & ~small)
            total += part
            for j in range(WIDTH if large else 0):
                if near[j]:
                    total += area_in_ball(surfaces.corners, np.int64(surfaces.leaf_triangle[leaf * WIDTH + j]), *place)
    return max(total, least)
