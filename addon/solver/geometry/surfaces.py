# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces: the triangles of a scene for the kernels, how they are connected, and the tracer for rays."""

import logging
import math
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..physics.radiometry import stored_photons
from ..sampling.vectors import dot, put_vector, scaled, vector
from ..sampling.warps import triangle_point
from ..scene import Scene, SceneError
from ..system.kernels import INLINED, KERNEL, njit
from .mesh import distinct, find_neighbours, first_at_point, label_sheets
from .point_tree import WIDTH, PointTree, build_tree, empty_leaves, morton_order
from .segments import Tracer
from .textures import MATERIAL, TextureTable, build_textures, grain, mixed_share, row_of, temperature_in_image
from .triangles import Corners, area_of, centroid, centroids, extended, longest_edge, planes

log = logging.getLogger(__name__)

_FLAT = 1.0 - 1e-6  # cosine from which on a normal is the triangle's own: 0.08 degrees, beyond float32's rounding
# Least cosine between normal and shading normal. Where normals lean more, as custom ones may, they tell nothing of the
# surface: it is shaded flat.
LEAST_LEAN = 0.1
_SAMPLED = 1 << 16  # triangles, about, whose corners tell where most of a scene is
_TYPICAL = 8  # points along each axis of the unit square that tell a triangle's mean temperature
AREA, LONGEST = 3, 4  # rows of a leaf of triangles that hold the area and the length of the longest edge
NORMAL_UNIT = 32767.0  # of the normals in leaf_facing


class Surfaces(NamedTuple):
    """Geometry in solver coordinates (world minus `centre`).

    corners: see Corners. material: (m,) int32. temperature: (m, 1) or (m, 3) float32, K; the mean where an
        image of the textures says it.
    neighbours: (m, 3) int32, 2 t + flip, t the triangle across the edge from corner i to i + 1, -1 for none; flip is 1
        where the two triangles wind differently.
    sheet: (m, 2) int32, label of the sheet to which each side belongs: connected surface without creases. Labels count
        from 0, without gaps.
    plane: (m, 4) float32, unit normal and clearance (m, see `offset`), side by side as every hit needs both.
    layer: (m,) uint8, the layer of the image to which emission adds (see layers); (0,) if there is but one layer.
    smooth: (m,) int32, row of corner_normal (s, 3, 3) float32, unit normals at the corners of the front of triangles
        that are shaded smooth; -1 for flat ones; (0,) if all are flat.
    textures: what varies over triangles besides `temperature`, see TextureTable.
    mesh: tree over the triangles; the leaves hold centroid, area and the length of the longest edge. leaf_facing: (l,
        5, w) int16, in each leaf the unit normals times NORMAL_UNIT, and the labels of the sheets of both sides, as far
        as 16 bits hold them: with more sheets, two that are near each other may count as one, once in 65536 times.
        leaf_triangle: (m,) int32, the triangle in each slot of the leaves.

    A side of a triangle has the number side_id = 2 t + side; side 0 is the front.
    """

    corners: Corners
    material: np.ndarray
    temperature: np.ndarray
    neighbours: np.ndarray
    sheet: np.ndarray
    mesh: PointTree
    leaf_facing: np.ndarray
    leaf_triangle: np.ndarray
    plane: np.ndarray
    layer: np.ndarray
    smooth: np.ndarray
    corner_normal: np.ndarray
    textures: TextureTable


class Geometry(NamedTuple):
    """All that depends on the triangles of a scene alone: not on temperatures, and of materials only on `stores`.

    vertices, triangles, hidden: of the Scene. stores: (triangles,) uint8, which photons a triangle stores, see
    `stored_photons`. kept: (m,) int32, indices of the triangles that are not left out; None if all are there.
    centre: (3,) float64, m, subtracted from the vertices, so that float32 resolves small detail.
    tracer: see Tracer. The other fields: see Surfaces.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    stores: np.ndarray
    hidden: np.ndarray | None
    kept: np.ndarray | None
    centre: np.ndarray
    tracer: Tracer
    corners: Corners
    neighbours: np.ndarray
    sheet: np.ndarray
    mesh: PointTree
    leaf_facing: np.ndarray
    leaf_triangle: np.ndarray
    plane: np.ndarray

    def taken(self, values: np.ndarray) -> np.ndarray:
        """Values (triangles, ...) of the scene's triangles, of those that are not left out; the same if all are."""
        return values if self.kept is None else values[self.kept]

    def row(self, triangle: np.ndarray) -> np.ndarray:
        """Indices (n,) in the scene of triangles (n,) that are not left out."""
        return triangle if self.kept is None else self.kept[triangle]


def build_geometry(scene: Scene, earlier: Geometry | None = None) -> Geometry:
    """The Geometry of a scene. If vertices, triangles, stored photons and what is hidden are as in an earlier scene,
    the earlier Geometry itself.

    Of triangles with the same corners all but the first are left out: a surface that is there twice does not emit
    twice. Triangles without an area emit nothing and cannot be hit; they are left out, too, as their edges would cut
    sheets in two. Sheets end where the kind of stored photons changes: a gather must divide by the area on which its
    photons can lie.
    Raises SceneError if no triangle has an area.
    """
    stores = _stores(scene)
    mine = scene.vertices, scene.triangles, stores, scene.hidden
    if earlier and all(np.array_equal(old, new) for old, new in zip(earlier[:4], mine, strict=True)):
        return earlier
    triangles = np.ascontiguousarray(scene.triangles, dtype=np.int32)
    centre = _middle(scene.vertices, triangles)
    vertices = (scene.vertices - centre).astype(np.float32)
    first = first_at_point(vertices)
    counts, has_area = distinct(triangles, first), extended(Corners(vertices, triangles))
    twice = np.count_nonzero(has_area & ~counts)
    if twice:
        log.warning("%d triangles lie exactly on others and are left out", twice)
    counts &= has_area
    if not counts.any():
        raise SceneError("No triangle of the scene has an area")
    kept = None if counts.all() else np.flatnonzero(counts).astype(np.int32)
    stored, hidden = stores, scene.hidden
    if kept is not None:
        triangles, stored = triangles[kept], stores[kept]
        hidden = None if hidden is None else hidden[kept]
    corners = Corners(vertices, triangles)
    with ThreadPoolExecutor(1) as pool:
        connected = pool.submit(_connect, corners, first, stored)
        tracer = Tracer(vertices, triangles, hidden)  # before the tree, as Embree needs most memory while it builds
    neighbours, plane, sheet = connected.result()
    leaf_triangle = morton_order(centroids(corners))
    leaves = empty_leaves(len(triangles), LONGEST + 1)
    leaf_facing = np.zeros((len(leaves), 5, WIDTH), np.int16)
    _fill_leaves((corners, plane, sheet), leaf_triangle, leaves, leaf_facing)
    return Geometry(
        vertices=scene.vertices,
        triangles=scene.triangles,
        stores=stores,
        hidden=scene.hidden,
        kept=kept,
        centre=centre,
        tracer=tracer,
        corners=corners,
        neighbours=neighbours,
        sheet=sheet,
        mesh=build_tree(leaves, LONGEST),
        leaf_facing=leaf_facing,
        leaf_triangle=leaf_triangle,
        plane=plane,
    )


def _middle(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(3,) float64, m: the median of the triangles' corners, where most of the scene is. Float32 resolves what is there
    best, however far away a few others are."""
    step = max(1, len(triangles) // _SAMPLED)
    return np.median(vertices[triangles[::step].ravel()].astype(np.float64), axis=0)


@njit(cache=True, nogil=True)
def _connect(corners, first, stored):
    """neighbours, plane and sheet of Surfaces. first: see first_at_point. stored: (m,) uint8, see Geometry.

    One kernel, as embreex copies a mesh without releasing the GIL: meanwhile no Python could go on to a second one.
    """
    neighbours = find_neighbours(corners.triangles, first)
    for t in range(stored.size):
        for i in range(3):
            if neighbours[t, i] >= 0 and stored[neighbours[t, i] >> 1] != stored[t]:
                neighbours[t, i] = -1
    plane = planes(corners)
    return neighbours, plane, label_sheets(plane, neighbours)


def _stores(scene: Scene) -> np.ndarray:
    """(triangles,) uint8, which photons each triangle of a scene stores: of a mixed one those that either material
    does."""
    of_material = stored_photons(scene.materials, scene.band_edges)
    stores = of_material[scene.material]
    if scene.textures is not None:
        mixed = scene.textures.mixed >= 0
        triangle = scene.textures.triangle[mixed]
        stores[triangle] = np.maximum(stores[triangle], of_material[scene.textures.mixed[mixed]])
    return stores


def build_surfaces(
    scene: Scene, geometry: Geometry | None = None, layer: np.ndarray | None = None
) -> tuple[Surfaces, Tracer, np.ndarray]:
    """The Surfaces of a scene, the Tracer, and the centre (3,) float64, m, that was subtracted.

    geometry: of an earlier scene, see build_geometry. layer: (triangles,) uint8, of each triangle of the scene, None if
    there is but one layer.
    """
    geometry = build_geometry(scene, geometry)
    temperature = geometry.taken(scene.temperature.reshape(len(scene.triangles), -1))
    surfaces = Surfaces(
        corners=geometry.corners,
        material=np.ascontiguousarray(geometry.taken(scene.material), dtype=np.int32),
        temperature=np.ascontiguousarray(temperature, dtype=np.float32),
        neighbours=geometry.neighbours,
        sheet=geometry.sheet,
        mesh=geometry.mesh,
        leaf_facing=geometry.leaf_facing,
        leaf_triangle=geometry.leaf_triangle,
        plane=geometry.plane,
        layer=np.empty(0, np.uint8) if layer is None else np.ascontiguousarray(geometry.taken(layer), np.uint8),
        **_smooth(scene, geometry),
        textures=build_textures(scene.textures, geometry.kept, len(scene.triangles)),
    )
    if scene.images_of_temperature:
        surfaces = surfaces._replace(temperature=surfaces.temperature.copy())  # the scene's may be the same array
        _fill_typical(surfaces.textures, surfaces.temperature)
    return surfaces, geometry.tracer, geometry.centre


def _smooth(scene: Scene, geometry: Geometry) -> dict:
    """smooth and corner_normal of Surfaces: without the rows of triangles whose normals are all their own."""
    if scene.corner_normals is None:
        return {"smooth": np.empty(0, np.int32), "corner_normal": np.empty((0, 3, 3), np.float32)}
    normals = np.ascontiguousarray(geometry.taken(scene.corner_normals), np.float32)
    smooth = np.empty(len(normals), np.int32)
    corner_normal = np.empty((_number_curved(normals, geometry.plane, smooth), 3, 3), np.float32)
    _fill_normals(normals, geometry.plane, smooth, corner_normal)
    return {"smooth": smooth if len(corner_normal) else smooth[:0], "corner_normal": corner_normal}


@njit(**INLINED)
def _unit_at(normals, plane, t, i):
    """Unit normal at corner i of triangle t, its own where none is given."""
    n = vector(normals[t], i)
    length = math.sqrt(dot(n, n))
    return scaled(n, 1.0 / length) if length > 0.0 else vector(plane, t)


@njit(**KERNEL)
def _number_curved(normals, plane, smooth):
    """Fill smooth (m,), see Surfaces; returns how many triangles are curved."""
    count = np.int32(0)
    for t in range(smooth.size):
        least = 1.0
        for i in range(3):
            least = min(least, dot(_unit_at(normals, plane, t, i), vector(plane, t)))
        smooth[t] = count if least < _FLAT else -1
        count += 1 if least < _FLAT else 0
    return count


@njit(**KERNEL)
def _fill_normals(normals, plane, smooth, corner_normal):
    """Fill in corner_normal, see Surfaces."""
    for t in range(smooth.size):
        if smooth[t] >= 0:
            for i in range(3):
                put_vector(_unit_at(normals, plane, t, i), corner_normal[smooth[t]], i)


@njit(**KERNEL)
def _fill_typical(table, temperature):
    """Where an image says the temperature all over a triangle, let the triangle's own be the mean over some points of
    it: for all that is planned before the first pass."""
    for t in range(temperature.shape[0]):
        total = 0.0
        for i in range(_TYPICAL * _TYPICAL):
            u, v = triangle_point((i // _TYPICAL + 0.5) / _TYPICAL, (i % _TYPICAL + 0.5) / _TYPICAL)
            kelvin = temperature_in_image(table, row_of(table, t), u, v)
            if kelvin < 0.0:
                break
            total += kelvin / (_TYPICAL * _TYPICAL)
        else:
            temperature[t, :] = np.float32(total)


@njit(**KERNEL)
def _fill_leaves(triangles, leaf_triangle, leaves, leaf_facing):
    """Put the triangles into the leaves of their tree. triangles: Corners, plane and sheet, see Surfaces."""
    corners, plane, sheet = triangles
    for i in range(leaf_triangle.size):
        t, leaf, slot = leaf_triangle[i], i // WIDTH, i % WIDTH
        leaves[leaf, 0, slot], leaves[leaf, 1, slot], leaves[leaf, 2, slot] = centroid(corners, t)
        leaves[leaf, AREA, slot], leaves[leaf, LONGEST, slot] = area_of(corners, t), longest_edge(corners, t)
        for axis in range(3):
            leaf_facing[leaf, axis, slot] = np.int16(round(NORMAL_UNIT * plane[t, axis]))
        for side in range(2):
            leaf_facing[leaf, 3 + side, slot] = np.int16(sheet[t, side])


def used_materials(surfaces: Surfaces) -> np.ndarray:
    """(n,) ascending indices of the materials that surfaces have, also in part."""
    mixed = surfaces.textures.mixed
    used = np.zeros(max(surfaces.material.max(), mixed.max(initial=-1)) + 1, np.bool_)
    used[mixed[mixed >= 0]] = True
    _mark(surfaces.material, used)
    return np.flatnonzero(used)


@njit(**KERNEL)
def _mark(material, used):
    for t in range(material.size):
        used[material[t]] = True


def sheet_count(surfaces: Surfaces) -> int:
    """How many sheets there are; each side of a triangle belongs to one."""
    return int(surfaces.sheet.max()) + 1


@njit(**INLINED)
def unit_normal(surfaces, side_id):
    """Unit normal of a side, float64 with the precision of float32."""
    sign = 1.0 - 2.0 * (side_id & 1)
    plane, t = surfaces.plane, side_id >> 1
    return sign * plane[t, 0], sign * plane[t, 1], sign * plane[t, 2]


@njit(**INLINED)
def shading_normal(surfaces, side_id, u, v):
    """Unit shading normal at (u, v) of a side of a triangle that is shaded smooth: between the normals at its corners
    (Phong 1975)."""
    n, row = unit_normal(surfaces, side_id), surfaces.smooth[side_id >> 1]
    normals, w = surfaces.corner_normal[row], 1.0 - u - v
    between = (
        w * normals[0, 0] + u * normals[1, 0] + v * normals[2, 0],
        w * normals[0, 1] + u * normals[1, 1] + v * normals[2, 1],
        w * normals[0, 2] + u * normals[1, 2] + v * normals[2, 2],
    )
    sign = 1.0 - 2.0 * (side_id & 1)
    length = math.sqrt(dot(between, between))
    if not sign * dot(between, n) >= LEAST_LEAN * length or length == 0.0:
        return n
    return scaled(between, sign / length)


@njit(**INLINED)
def material_at(surfaces, t, u, v):
    """Index of the material at (u, v) of triangle t: of a mixed one, that of the grain there, see textures."""
    own, other, table = surfaces.material[t], other_material(surfaces, t), surfaces.textures
    if other < 0:
        return own
    return other if grain(t, u, v, MATERIAL) < mixed_share(table, row_of(table, t), u, v) else own


@njit(**INLINED)
def other_material(surfaces, t):
    """Index of the material that is mixed into that of triangle t, -1 if none is."""
    row = row_of(surfaces.textures, t)
    return surfaces.textures.mixed[row] if row >= 0 else np.int32(-1)


@njit(inline="always")
def sheet_of(surfaces, side_id):
    """Label of the sheet to which a side belongs."""
    return surfaces.sheet[side_id >> 1, side_id & 1]


@njit(**INLINED)
def facing_side(surfaces, t, direction):
    """side_id of the side of triangle t that a ray of this direction meets."""
    plane = surfaces.plane
    towards = direction[0] * plane[t, 0] + direction[1] * plane[t, 1] + direction[2] * plane[t, 2]
    return np.int32(2 * t + (1 if towards > 0.0 else 0))


@njit(**INLINED)
def clear_of(surfaces, side_id, point):
    """A point on a side, moved along the side's normal to where a ray may start or end (see triangles.offset)."""
    n, clear = unit_normal(surfaces, side_id), surfaces.plane[side_id >> 1, 3]
    return point[0] + clear * n[0], point[1] + clear * n[1], point[2] + clear * n[2]


@njit(**INLINED)
def layer_of(layer, i):
    """Entry i of an array of layers, which is empty if there is but one layer."""
    return int(layer[i]) if layer.size else 0
