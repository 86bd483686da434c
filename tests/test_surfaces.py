# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry: area inside a ball, adjacency, and rays that neither meet the surface they leave nor slip through."""

import math

import numpy as np
import pytest
from numba import njit

from addon.solver import Material, SceneError
from addon.solver.geometry.area import NO_WALL, PATCH_LIMIT, Ball, area_in_ball, patch_in_ball
from addon.solver.geometry.interaction import emit_at, leave
from addon.solver.geometry.segments import empty_ray_batch
from addon.solver.geometry.stage import Stage, temperature_at
from addon.solver.geometry.surfaces import build_surfaces, sheet_count
from addon.solver.geometry.triangles import areas, normal, point
from addon.solver.physics.radiometry import grey_radiometry
from addon.solver.sampling.warps import cosine_direction, to_world, triangle_point
from tests.helpers.scenes import box, cylinder, join, look, loose, make_scene, sphere

RIGHT_TRIANGLE = np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]], np.float32)


def build(vertices, triangles):
    """Surfaces and Tracer of a mesh."""
    vertices, triangles = np.asarray(vertices), np.array(triangles, np.int32)
    scene = make_scene(vertices, triangles, 300.0, [Material()], look((0, 0, 9), (0, 0, 0)), [8.0, 12.0])
    return build_surfaces(scene)


def random_rotation(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def points_on(corners, rng, count):
    """(m, count, 3) points, uniform on each triangle, float64."""
    u, v = rng.random((2, len(corners), count, 1))
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    a, b, c = corners.astype(float).transpose(1, 0, 2)[:, :, None]
    return a + u * (b - a) + v * (c - a)


def patch(surfaces, triangle, center, r2, side=0):
    """Side_ids of the patch around a point of a side, and its area."""
    side_ids = np.empty(PATCH_LIMIT, np.int32)
    x, y, z = (float(c) for c in center)
    count, area = patch_in_ball(surfaces, np.int32(2 * triangle + side), Ball((x, y, z), r2, NO_WALL), side_ids)
    return side_ids[:count].tolist(), area


# Triangles


def test_normal_area_and_points():
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(100, 3, 3)).astype(np.float32)
    a, b, c = corners.astype(float).transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    corners = loose(corners)
    np.testing.assert_allclose(areas(corners), 0.5 * length, rtol=1e-12)
    for t in range(10):
        direction, double_area = normal(corners, t)
        np.testing.assert_allclose(direction, cross[t] / length[t], atol=1e-12)
        assert double_area == pytest.approx(length[t], rel=1e-12)
        np.testing.assert_allclose(point(corners, t, 0.2, 0.3), 0.5 * a[t] + 0.2 * b[t] + 0.3 * c[t], atol=1e-6)
    assert normal(loose(np.zeros((1, 3, 3), np.float32)), 0) == ((0, 0, 0), 0)  # no NaN from a triangle without area


def test_temperature_is_linear_between_the_corners():
    surfaces, _, _ = build(RIGHT_TRIANGLE[0], [(0, 1, 2)])

    def temperature(kelvin, u, v):
        stage = Stage(
            surfaces._replace(temperature=np.array([kelvin], np.float32)), grey_radiometry((Material(),), np.ones(1))
        )
        return temperature_at(stage, emit_at(surfaces, 0, u, v, 1.0))

    corners = 300, 310, 330
    assert temperature(corners, 0.0, 0.0) == 300
    assert temperature(corners, 1.0, 0.0) == 310
    assert temperature(corners, 0.25, 0.5) == pytest.approx(0.25 * 300 + 0.25 * 310 + 0.5 * 330)
    assert temperature([287], 0.3, 0.3) == 287


# Area inside a ball


@pytest.mark.parametrize(
    "center, r, expected",
    [
        ((0.25, 0.25, 0), 0.1, math.pi * 0.01),  # a disk within the triangle
        ((0.5, 0, 0), 0.1, math.pi * 0.01 / 2),  # centre on an edge
        ((0.5, 0.5, 0), 0.1, math.pi * 0.01 / 2),  # on the slanting edge
        ((0, 0, 0), 0.1, math.pi * 0.01 / 4),  # in the corner of 90 degrees
        ((1, 0, 0), 0.1, math.pi * 0.01 / 8),  # in a corner of 45 degrees
        ((0.5, -0.05, 0), 0.1, 0.01 * (math.pi / 3 - math.sqrt(3) / 4)),  # segment beyond half the radius
        ((0.25, 0.25, 0.06), 0.1, math.pi * 0.0064),  # off the plane: a smaller disk
        ((0.25, 0.25, -0.06), 0.1, math.pi * 0.0064),
        ((0.25, 0.25, 0.1), 0.1, 0),
        ((0.3, 0.3, 0), 10, 0.5),  # all of the triangle
        ((0.5, -0.2, 0), 0.1, 0),  # none of it
        ((2, 0, 0), 1, 0),  # touches a corner
    ],
)
def test_area_in_ball(center, r, expected):
    for corners in (RIGHT_TRIANGLE, RIGHT_TRIANGLE[:, ::-1].copy()):  # either winding
        area = area_in_ball(loose(corners), 0, Ball(tuple(float(c) for c in center), float(r * r), NO_WALL))
        assert abs(area) == pytest.approx(expected, abs=1e-9)  # float64; points are exact to 1e-16


def test_area_in_ball_adds_up():
    """A triangle cut in four has the area of its parts, wherever the ball is."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        a, b, c = rng.integers(-64, 64, (3, 3)) / 8  # halves are exact in float32
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.array([(a, b, c), (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)], np.float32)
        corners = loose(corners)
        x, y, z = (a + b + c) / 3 + rng.normal(size=3)
        r2 = rng.exponential(20.0)
        whole, *parts = [area_in_ball(corners, t, Ball((x, y, z), r2, NO_WALL)) for t in range(5)]
        assert whole == pytest.approx(sum(parts), abs=1e-9)
        assert -1e-9 <= whole <= areas(corners)[0] + 1e-9


@pytest.mark.parametrize("nearest", [np.inf, 0.5])  # distance of walls, m
def test_area_in_ball_against_monte_carlo(nearest):
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(200, 3, 3)).astype(np.float32)
    centre, r2 = rng.normal(size=(200, 3)), rng.exponential(2.0, 200)
    towards = rng.normal(size=(200, 3))
    walls = towards / np.linalg.norm(towards, axis=1, keepdims=True) / (nearest * rng.random((200, 1)))
    walls = [tuple(wall) for wall in walls.astype(np.float32)]
    balls = [Ball(*ball) for ball in zip(map(tuple, centre), r2, walls, strict=True)]
    share = np.array([area_in_ball(loose(corners), t, balls[t]) for t in range(200)]) / areas(loose(corners))
    count = 20_000
    ways = points_on(corners, rng, count) - centre[:, None]
    before = np.einsum("tij,tj->ti", ways, np.array(walls)) <= 1
    inside = np.mean((np.sum(ways**2, axis=-1) < r2[:, None]) & before, axis=1)
    cut = (share > 0.01) & (share < 0.99)  # binomial, nearly normal
    deviation = (inside[cut] - share[cut]) / np.sqrt(share[cut] * (1 - share[cut]) / count)
    assert cut.sum() > 50
    assert np.abs(deviation).max() < 4.5 and deviation.std() < 1.3
    np.testing.assert_allclose(inside[~cut], share[~cut], atol=0.01)


# The patch of surface that a gather may count


def unit_box():
    vertices, triangles = box()
    return build(vertices - 0.5, triangles)[0]


def test_patch_on_a_box():
    surfaces, r = unit_box(), 0.1
    floor, floor_sides = 8, [16, 18]  # triangles 8 and 9 are the floor, z = -0.5
    assert patch(surfaces, floor, (-0.3, 0.1, -0.5), r * r) == ([16], pytest.approx(math.pi * r * r))
    for triangles, center, share in (
        ((8, 9), (0.0, 0.0, -0.5), 1.0),  # on the diagonal that two triangles share
        ((8, 9), (-0.5, -0.5, -0.5), 0.25),  # in a corner of the face
        ((8, 9), (0.5, 0.5, -0.5), 0.25),
        ((8,), (0.0, 0.5, -0.5), 0.5),  # at an edge of the box: the wall is another surface
        ((8,), (0.0, 0.45, -0.5), 1 - (math.pi / 3 - math.sqrt(3) / 4) / math.pi),
    ):
        for triangle in triangles:
            for side in (0, 1):
                side_ids, area = patch(surfaces, triangle, center, r * r, side)
                assert set(side_ids) <= {front + side for front in floor_sides}
                assert area == pytest.approx(share * math.pi * r * r, rel=1e-6)  # float32 corners


def test_patch_of_everything_has_all_its_area():
    side_ids, area = patch(unit_box(), 8, (0.1, 0.1, -0.5), 100.0)
    assert sorted(side_ids) == [16, 18] or side_ids == []  # a disk so large that the face counts as fine mesh
    assert area == pytest.approx(1.0) or area == pytest.approx(math.pi * 100)


QUAD = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
WINDINGS = {
    "alike": [(0, 1, 2), (0, 2, 3)],
    "flipped": [(0, 1, 2), (0, 3, 2)],
    "split vertices": [(0, 1, 2), (4, 5, 3)],
    "split and flipped": [(0, 1, 2), (5, 4, 3)],
}


@pytest.mark.parametrize("name", WINDINGS)
@pytest.mark.parametrize("side", [0, 1])
def test_patch_crosses_edges_whatever_the_winding(name, side):
    surfaces, _, _ = build(np.array([*QUAD, QUAD[0], QUAD[2]], float), WINDINGS[name])
    flip = int("flipped" in name)
    assert surfaces.neighbours[0].tolist() == [-1, -1, 2 + flip]
    side_ids, area = patch(surfaces, 0, (0.1, -0.05, 0.0), 0.25, side)
    assert side_ids == [side, 2 + (side ^ flip)]  # the second triangle's side that faces the same way
    assert area == pytest.approx(math.pi * 0.25, rel=1e-6)


@pytest.mark.parametrize("bend, joined", [(10, True), (30, True), (45, False), (90, False), (180, False)])
def test_patch_ends_at_a_sharp_edge(bend, joined):
    """SAME_SURFACE = 0.8 is 37 degrees between the normals; what bends more is another surface."""
    angle = math.radians(bend)
    vertices = [(0, -1, 0), (0, 1, 0), (-2, 0, 0), (2 * math.cos(angle), 0, 2 * math.sin(angle))]
    surfaces, _, _ = build(np.array(vertices), [(0, 1, 2), (1, 0, 3)])
    a, b = surfaces.corners.of(0)[:2]
    middle = 0.5 * (a + b)
    side_ids, area = patch(surfaces, 0, middle, 0.01)
    assert side_ids == ([0, 2] if joined else [0])
    assert area == pytest.approx(math.pi * 0.01 * (1.0 if joined else 0.5), rel=1e-5)


def test_edge_of_three_faces_is_a_border():
    vertices = [(0, -1, 0), (0, 1, 0), (-2, 0, 0), (2, 0, 0.01), (2, 0, 0.5)]
    surfaces, _, _ = build(np.array(vertices), [(0, 1, 2), (1, 0, 3), (1, 0, 4)])
    assert np.all(surfaces.neighbours == -1)
    side_ids, area = patch(surfaces, 0, surfaces.corners.of(0)[:2].mean(axis=0), 0.01)
    assert side_ids == [0] and area == pytest.approx(math.pi * 0.01 / 2, rel=1e-5)


def test_fine_mesh_counts_as_plane():
    vertices, triangles = sphere(4)
    surfaces, _, _ = build(vertices, triangles)
    center = surfaces.corners.of(7).mean(axis=0)
    assert patch(surfaces, 7, center, 0.25) == ([], pytest.approx(math.pi * 0.25))
    side_ids, area = patch(surfaces, 7, center, 0.01)
    assert 1 < len(side_ids) <= PATCH_LIMIT
    assert area == pytest.approx(
        math.pi * 0.01, rel=0.01
    )  # of a sphere of radius 1, a ball holds pi r^2 of its surface


# Adjacency


def test_adjacency_is_mutual_on_a_closed_mesh():
    vertices, triangles = sphere(2)
    triangles[::3] = triangles[::3, ::-1]  # some wind the other way
    surfaces, _, _ = build(vertices, triangles)
    assert np.all(surfaces.neighbours >= 0)
    for t in range(len(triangles)):
        for neighbour in surfaces.neighbours[t]:
            other, flip = divmod(int(neighbour), 2)
            assert 2 * t + flip in surfaces.neighbours[other]
            assert flip == ((t % 3 == 0) != (other % 3 == 0))


def test_minus_zero_is_zero():
    vertices = np.array([*QUAD, (-1, -1, -0.0), (1, 1, -0.0)], float)
    surfaces, _, _ = build(vertices, WINDINGS["split vertices"])
    assert surfaces.neighbours[0].tolist() == [-1, -1, 2]


def test_sheets_of_closed_and_open_surfaces():
    vertices, triangles = box()
    two = np.concatenate((triangles, triangles + 8))
    surfaces, _, _ = build(np.concatenate((vertices, vertices + 3)), two)
    label = surfaces.sheet
    assert len(np.unique(label)) == 24  # six faces inside and outside of two boxes: a crease divides
    assert all(len(np.unique(label[t : t + 2, side])) == 1 for t in range(0, 24, 2) for side in (0, 1))
    surfaces, _, _ = build(*sphere(2))
    assert len(np.unique(surfaces.sheet[:, 0])) == len(np.unique(surfaces.sheet[:, 1])) == 1
    surfaces, _, _ = build(np.array(QUAD, float), WINDINGS["flipped"])
    label = surfaces.sheet
    assert len(np.unique(label)) == 2  # a border does not join front and back
    assert label[0, 0] == label[1, 1] and label[0, 1] == label[1, 0]


def test_sheets_are_numbered_without_gaps():
    """Tables have one row a sheet, so that a number left out would be a row of nothing, and one too large none at all.

    Balls, boxes, and triangles by themselves: what stands first in the mesh is not what has the first sheets.
    """
    rng = np.random.default_rng(10)
    singles = rng.normal(size=(30, 3)), np.arange(30).reshape(-1, 3)
    meshes = sphere(1), box(), singles, sphere(0), box((2.0, 1.0, 1.0))
    parts = [(vertices + 5.0 * i, triangles, 300.0, 0) for i, (vertices, triangles) in enumerate(meshes)]
    vertices, triangles, _, _ = join(*parts)
    surfaces, _, _ = build(vertices, rng.permutation(triangles))
    assert np.array_equal(np.unique(surfaces.sheet), np.arange(sheet_count(surfaces)))
    # a ball of 80 faces has two sheets and a box twelve; faces of one of 20 bend by 42 degrees, so each is one, as the
    # ten triangles are
    assert sheet_count(surfaces) == 2 + 12 + 2 * 10 + 2 * 20 + 12


def test_of_triangles_that_coincide_the_first_counts(caplog):
    """Whatever their winding, their first corner, and whether they share vertices: it keeps its temperature and its
    material, and the log says how many were left out."""
    again = [(2, 0, 1), (2, 1, 0), (4, 5, 6), (6, 5, 4)]
    triangles = np.array([(0, 1, 2), *again, (0, 2, 3), (3, 2, 0)], np.int32)
    vertices = np.array([*QUAD, QUAD[0], (1, -1, -0.0), QUAD[2]], float)
    scene = make_scene(
        vertices, triangles, 300.0 + np.arange(7), [Material()] * 7, look((0, 0, 9), (0, 0, 0)), [8.0, 12.0], range(7)
    )
    surfaces, _, _ = build_surfaces(scene)
    assert surfaces.temperature.ravel().tolist() == [300.0, 305.0]
    assert surfaces.material.tolist() == [0, 5]
    assert surfaces.neighbours[0].tolist() == [-1, -1, 2]  # what was left out does not make the edge one of three faces
    assert [record.getMessage() for record in caplog.records] == ["5 triangles lie exactly on others and are left out"]


@pytest.mark.parametrize("corners", [(0, 2, 2), (0, 4, 2)])  # two corners at one point; all three in one line
def test_faces_without_area_do_not_cut_a_sheet(corners):
    surfaces, _, _ = build([*QUAD, (0, 0, 0)], [(0, 1, 2), (0, 2, 3), corners])
    assert surfaces.sheet.tolist() == [[0, 1], [0, 1]]


def test_a_scene_of_faces_without_area_is_an_error():
    with pytest.raises(SceneError, match="No triangle of the scene has an area"):
        build(QUAD, [(0, 0, 2), (1, 1, 1)])


def test_vertices_without_faces_do_not_move_the_centre():
    """They would cost precision: rays start further off a surface the further it is from the centre."""
    surfaces, _, centre = build(np.array([*QUAD, (1e5, 0, 0)]), [(0, 1, 2), (0, 2, 3)])
    assert np.all(centre == 0.0)
    assert np.all(surfaces.plane[:, 3] == build(QUAD, [(0, 1, 2), (0, 2, 3)])[0].plane[:, 3])


def test_moebius_strip_has_one_side():
    turns = np.arange(120) / 120 * 2 * math.pi
    across = np.array([-0.3, 0.3])[None, :, None]
    spoke = np.column_stack((np.cos(turns), np.sin(turns), 0 * turns))[:, None]
    width = np.cos(turns / 2)[:, None, None] * spoke + np.sin(turns / 2)[:, None, None] * np.array([0, 0, 1])
    vertices = (spoke + across * width).reshape(-1, 3)
    quads = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(119)] + [(238, 239, 0, 1)]
    surfaces, _, _ = build(vertices, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    assert len(np.unique(surfaces.sheet)) == 1


# Rays


@njit
def leave_all(surfaces, side_ids, random, steepness, rays):
    """Rays from random points of sides, as photons and camera paths start; steepness 0 is tangential."""
    for i in range(side_ids.size):
        u, v = triangle_point(random[i, 0], random[i, 1])
        at = emit_at(surfaces, side_ids[i], u, v, 1.0)
        x, y, z = cosine_direction(random[i, 2], random[i, 3])
        leave(surfaces, at.side_id, at.point, to_world((x, y, z * steepness), at.normal), rays, i)


def start_rays(surfaces, side_ids, rng, steepness=1.0):
    rays = empty_ray_batch(len(side_ids))
    leave_all(surfaces, side_ids, rng.random((len(side_ids), 4)), steepness, rays)
    return rays


def scattered_triangles(rng, count, aspect):
    """Triangles with corners around centres in the unit cube, squeezed along a random direction each."""
    shape = rng.normal(size=(count, 3, 3)) * (1, aspect, aspect)
    turned = np.array([s @ random_rotation(rng) for s in shape])
    size = 10 ** rng.uniform(-4, 0.5, (count, 1, 1))
    return rng.uniform(-0.5, 0.5, (count, 1, 3)) + size * turned


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("shift", [0.0, 1e5], ids=["near", "far"])
@pytest.mark.parametrize("steepness", [1.0, 1e-3], ids=["", "grazing"])
@pytest.mark.parametrize(
    "aspect",
    [
        pytest.param(1.0, id=""),
        pytest.param(1e-3, id="needles"),
    ],
)
def test_rays_do_not_meet_the_surface_they_leave(scale, shift, steepness, aspect):
    """Triangles of sizes 1e-4 to 3 in a scene of size 1, at several scales and far from the world's origin."""
    rng = np.random.default_rng(4)
    corners = (scattered_triangles(rng, 200, aspect) + shift) * scale
    surfaces, tracer, _ = build(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    start = np.repeat(np.arange(200), 500)
    rays = start_rays(surfaces, 2 * start + np.arange(start.size) % 2, rng, steepness)
    assert np.count_nonzero(tracer.trace(*rays).triangle == start) == 0


def test_small_objects_far_apart():
    """Boxes of 1 cm, 2 km from each other: what float32 leaves of their coordinates is 0.1 mm."""
    vertices, triangles = box((0.01, 0.01, 0.01))
    surfaces, tracer, _ = build(
        np.concatenate((vertices - 1000.0, vertices + 1000.0)), np.concatenate((triangles, triangles + 8))
    )
    start = np.repeat(np.arange(24), 5000)
    rays = start_rays(surfaces, 2 * start + np.arange(start.size) % 2, np.random.default_rng(5))
    assert np.count_nonzero(tracer.trace(*rays).triangle == start) == 0


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e5])
def test_closed_box_lets_no_ray_escape(scale):
    """Rays at random, and at the edges and corners, where two triangles meet."""
    rng = np.random.default_rng(6)
    size = np.array([1.0, 0.8, 0.6])
    vertices, triangles = box(size)
    rotation = random_rotation(rng)
    surfaces, tracer, centre = build((vertices @ rotation + 10) * scale, triangles)
    inside = rng.uniform(0.01, 0.99, (200_000, 3)) * size
    origin = ((inside @ rotation + 10) * scale - centre).astype(np.float32)
    direction = rng.normal(size=origin.shape).astype(np.float32)
    assert np.all(tracer.trace(origin, direction).triangle >= 0)
    a, b = rng.integers(0, 3, (2, len(origin)))
    triangle = rng.integers(0, 12, len(origin))
    along = rng.integers(0, 5, (len(origin), 1)) / 4  # corners, middles and quarters of edges and diagonals
    corners, each = surfaces.corners.of(triangle), np.arange(len(origin))
    target = corners[each, a] * (1 - along) + corners[each, b] * along
    assert np.all(tracer.trace(origin, (target - origin).astype(np.float32)).triangle >= 0)


def inner_sides(surfaces):
    """(m,) int64, which side of each triangle of a convex body around the origin is the inner one."""
    centroid = surfaces.corners.of().mean(axis=1)
    return np.array([np.dot(normal(surfaces.corners, t)[0], centroid[t]) > 0 for t in range(len(centroid))], np.int64)


def test_paths_stay_in_a_closed_room():
    """Bounce after bounce off the walls of a sphere: nothing leaks, at grazing angles neither."""
    vertices, triangles = sphere(3)
    surfaces, tracer, _ = build(vertices, triangles)
    inner = inner_sides(surfaces)
    rng = np.random.default_rng(7)
    triangle = np.repeat(np.arange(len(triangles)), 100)
    for steepness in (1.0, 1e-3, 1.0, 1e-2):
        rays = start_rays(surfaces, 2 * triangle + inner[triangle], rng, steepness)
        triangle = tracer.trace(*rays).triangle.astype(np.int64)
        assert np.all(triangle >= 0)


@pytest.mark.parametrize("length", [1.0, 10.0])
@pytest.mark.parametrize("steepness", [1.0, 1e-2], ids=["", "grazing"])
def test_paths_stay_in_a_long_pipe(length, steepness):
    """1 mm in radius: from its wall every ray meets the inside of the wall or of the caps."""
    rng = np.random.default_rng(8)
    vertices, triangles = cylinder(32, 1e-3, length)
    vertices -= (0.0, 0.0, 0.5 * length)
    surfaces, tracer, _ = build(vertices @ random_rotation(rng), triangles)
    inner = inner_sides(surfaces)
    start = rng.integers(0, 64, 100_000)  # on the sides
    rays = start_rays(surfaces, 2 * start + inner[start], rng, steepness)
    hit = tracer.trace(*rays).triangle
    assert np.all(hit >= 0)
    assert np.all((np.sum(rays.direction * surfaces.plane[hit, :3], axis=1) > 0) == inner[hit])


def test_trace_returns_the_nearest_hit_within_reach():
    vertices = np.array([(-1, -1, z) for z in (-1, 0, 1)] + [(3, -1, z) for z in (-1, 0, 1)], float)
    vertices = np.concatenate((vertices, [(-1, 3, z) for z in (-1, 0, 1)]))
    surfaces, tracer, centre = build(vertices, [(0, 3, 6), (1, 4, 7), (2, 5, 8)])
    origin = np.tile(np.float32(np.array([0.5, 0.25, 5.0]) - centre), (3, 1))
    direction = np.array([(0, 0, -1), (0, 0, -1), (0, 0, 1)], np.float32)
    hits = tracer.trace(origin, direction, np.array([1e30, 3.5, 1e30], np.float32))
    assert hits.triangle.tolist() == [2, -1, -1]
    met = point(surfaces.corners, 2, hits.u[0], hits.v[0])
    np.testing.assert_allclose(met, np.array([0.5, 0.25, 1.0]) - centre, atol=1e-6)
