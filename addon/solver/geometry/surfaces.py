# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces: the triangles of a scene for the kernels, how they are connected, and the tracer for rays."""

import logging
import math
from typing import NamedTuple

import numpy as np

from ..physics.radiometry import stored_photons
from ..sampling.vectors import dot, scaled
from ..sampling.warps import triangle_point
from ..scene import Scene, SceneError
from ..system.kernels import INLINED, KERNEL, njit
from .mesh import distinct, find_neighbours, first_at_point, label_sheets
from .point_tree import WIDTH, PointTree, build_tree, empty_leaves, morton_order
from .segments import Tracer
from .textures import MATERIAL, TextureTable, build_textures, grain, mixed_share, row_of, temperature_in_image
from .triangles import areas, centroid, centroids, longest_edge, normal, planes, point

log = logging.getLogger(__name__)

_FLAT = 1.0 - 1e-6  # cosine from which on a normal is the triangle's own: 0.08 degrees, beyond float32's rounding
# Least cosine between normal and shading normal. Where normals lean more, as custom ones may, they tell nothing of the
# surface: it is shaded flat.
LEAST_LEAN = 0.1
_TYPICAL = 8  # points along each axis of the unit square that tell a triangle's mean temperature
LONGEST = 9  # row of a leaf of triangles that holds the length of the longest edge


class Surfaces(NamedTuple):
    """Geometry in solver coordinates (world minus `centre`).

    corners: (m, 3, 3) float32, m. material: (m,) int32. temperature: (m, 1) or (m, 3) float32, K; the mean where an
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
    mesh: tree over the triangles; the leaves hold centroid, normal, area, the sheets of both sides and the length of
        the longest edge. leaf_triangle: (m,) int32, the triangle in each slot of the leaves.

    A side of a triangle has the number side_id = 2 t + side; side 0 is the front.
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
    smooth: np.ndarray
    corner_normal: np.ndarray
    textures: TextureTable


class Geometry(NamedTuple):
    """All that depends on the triangles of a scene alone: not on temperatures, and of materials only on `stores`.

    vertices, triangles, hidden: of the Scene. stores: (triangles,) uint8, which photons a triangle stores, see
    `stored_photons`. kept: (m,) indices of the triangles that are not left out.
    centre: (3,) float64, m, subtracted from the vertices, so that float32 resolves small detail.
    tracer: see Tracer. The other fields: see Surfaces.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    stores: np.ndarray
    hidden: np.ndarray | None
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
    corners = vertices[triangles]
    counts, extended = distinct(triangles, first), areas(corners) > 0.0
    twice = np.count_nonzero(extended & ~counts)
    if twice:
        log.warning("%d triangles lie exactly on others and are left out", twice)
    kept = np.flatnonzero(counts & extended)
    if len(kept) == 0:
        raise SceneError("No triangle of the scene has an area")
    if len(kept) < len(triangles):
        triangles, corners = triangles[kept], corners[kept]
    neighbours = find_neighbours(triangles, first)
    neighbours[stores[kept][neighbours >> 1] != stores[kept][:, None]] = -1
    plane = planes(corners)
    sheet = label_sheets(plane, neighbours)
    leaf_triangle = morton_order(centroids(corners))
    leaves = empty_leaves(len(corners), LONGEST + 1)
    _fill_leaves(corners, sheet, leaf_triangle, leaves)
    return Geometry(
        vertices=scene.vertices,
        triangles=scene.triangles,
        stores=stores,
        hidden=scene.hidden,
        kept=kept,
        centre=centre,
        tracer=Tracer(vertices, triangles, None if scene.hidden is None else scene.hidden[kept]),
        corners=corners,
        neighbours=neighbours,
        sheet=sheet,
        mesh=build_tree(leaves, LONGEST),
        leaf_triangle=leaf_triangle,
        plane=plane,
    )


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


def _middle(vertices, triangles):
    """The middle (3,) float64, m, of the box around all vertices that are corners of triangles."""
    used = np.zeros(len(vertices), np.bool_)
    used[triangles] = True
    if not used.all():
        vertices = vertices[used]
    return 0.5 * (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0))


def build_surfaces(
    scene: Scene, geometry: Geometry | None = None, layer: np.ndarray | None = None
) -> tuple[Surfaces, Tracer, np.ndarray]:
    """The Surfaces of a scene, the Tracer, and the centre (3,) float64, m, that was subtracted.

    geometry: of an earlier scene, see build_geometry. layer: (triangles,) uint8, of each triangle of the scene, None if
    there is but one layer.
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
        **_smooth(scene, geometry),
        textures=build_textures(scene.textures, kept, len(scene.triangles)),
    )
    if scene.images_of_temperature:
        _fill_typical(surfaces.textures, surfaces.temperature)
    return surfaces, geometry.tracer, geometry.centre


def _smooth(scene: Scene, geometry: Geometry) -> dict:
    """smooth and corner_normal of Surfaces: without the rows of triangles whose normals are all their own."""
    if scene.corner_normals is None:
        return {"smooth": np.empty(0, np.int32), "corner_normal": np.empty((0, 3, 3), np.float32)}
    normals = scene.corner_normals[geometry.kept]
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = np.divide(
        normals, length, out=np.broadcast_to(geometry.plane[:, None, :3], normals.shape).copy(), where=length > 0.0
    )
    curved = np.flatnonzero(np.einsum("mij,mj->mi", normals, geometry.plane[:, :3]).min(axis=1) < _FLAT)
    smooth = np.full(len(normals) if len(curved) else 0, -1, np.int32)
    smooth[curved] = np.arange(len(curved))
    return {"smooth": smooth, "corner_normal": np.ascontiguousarray(normals[curved], np.float32)}


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
def _fill_leaves(corners, sheet, leaf_triangle, leaves):
    """Put the triangles into the leaves of their tree."""
    for i in range(leaf_triangle.size):
        t, leaf, slot = leaf_triangle[i], i // WIDTH, i % WIDTH
        n, double_area = normal(corners, t)
        leaves[leaf, 0, slot], leaves[leaf, 1, slot], leaves[leaf, 2, slot] = centroid(corners, t)
        leaves[leaf, 3, slot], leaves[leaf, 4, slot], leaves[leaf, 5, slot] = n
        leaves[leaf, 6, slot] = 0.5 * double_area
        # float32 tells 2^24 labels apart; with more sheets, which only loose triangles can be, two may count as one
        # here
        leaves[leaf, 7, slot], leaves[leaf, 8, slot] = sheet[t, 0], sheet[t, 1]
        leaves[leaf, LONGEST, slot] = longest_edge(corners, t)


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
    between = point(surfaces.corner_normal, row, u, v)
    sign = 1.0 - 2.0 * (side_id & 1)
    length = math.sqrt(dot(between, between))
    if not sign * dot(between, n) >= LEAST_LEAN * length or length == 0.0:
        return n
    return scaled(between, sign / length)


@njit(**INLINED)
def material_at(surfaces, t, u, v):
    """Index of the material at (u, v) of triangle t: of a mixed one, that of the grain there, see textures."""
    own, table = surfaces.material[t], surfaces.textures
    row = row_of(table, t)
    if row < 0 or table.mixed[row] < 0:
        return own
    return table.mixed[row] if grain(t, u, v, MATERIAL) < mixed_share(table, row, u, v) else own


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
