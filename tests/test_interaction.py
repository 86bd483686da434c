# SPDX-License-Identifier: GPL-3.0-or-later
"""Interactions: rays from both sides of tilted triangles against plane geometry, and what leaves and arrives."""

import numpy as np
import pytest
from numba import njit

from addon.solver import Material
from addon.solver.geometry.interaction import LEAST_COSINE, emit_at, interact, interact_at, leave
from addon.solver.geometry.segments import RayBatch, empty_ray_batch
from addon.solver.geometry.surfaces import build_surfaces
from addon.solver.photons.wave import arrive, empty_wave, has_arrived
from tests.helpers.scenes import look, make_scene

COUNT = 200  # triangles
# Corners, normals and rays are float32, within a metre or two of the origin: a unit in the last place is 2^-23 of that.
POSITION = 16 * 2.0**-23


@pytest.fixture(scope="module")
def tilted():
    """Surfaces, Tracer of triangles of about 10 cm at random, each of another material."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-1, 1, (COUNT, 1, 3)) + 0.1 * rng.normal(size=(COUNT, 3, 3))
    materials = [Material(f"material {i}", 0.5) for i in range(COUNT)]
    triangles = np.arange(3 * COUNT).reshape(-1, 3)
    scene = make_scene(
        corners.reshape(-1, 3), triangles, 300.0, materials, look((0, 0, 5), (0, 0, 0)), [8.0, 12.0],
        rng.permutation(COUNT),
    )  # fmt: skip
    surfaces, tracer, _ = build_surfaces(scene)
    assert len(surfaces.sheet) == COUNT
    return surfaces, tracer


def front_normals(surfaces):
    """(m, 3) float64 unit normals of the fronts."""
    a, b, c = surfaces.corners.of().astype(float).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def points_at(surfaces, triangle, uv):
    """(n, 3) float64 points with barycentric coordinates (n, 2) of corners 1 and 2."""
    a, b, c = surfaces.corners.of(triangle).astype(float).transpose(1, 0, 2)
    u, v = uv.T[:, :, None]
    return a + u * (b - a) + v * (c - a)


@njit
def interactions(surfaces, hits, direction):
    """Integers (n, 3): triangle, side_id, material; vectors (n, 4, 3): point, both normals, incoming; numbers (n, 4):
    u, v, cosine, distance."""
    integers, vectors = np.empty((len(hits.triangle), 3), np.int64), np.empty((len(hits.triangle), 4, 3))
    numbers = np.empty((len(hits.triangle), 4))
    for i in range(len(hits.triangle)):
        at = interact(surfaces, hits, i, direction)
        integers[i, 0], integers[i, 1], integers[i, 2] = at.triangle, at.side_id, at.material
        vectors[i, 0], vectors[i, 1], vectors[i, 2], vectors[i, 3] = at.point, at.normal, at.shading_normal, at.incoming
        numbers[i, 0], numbers[i, 1], numbers[i, 2], numbers[i, 3] = at.u, at.v, at.cosine, at.distance
    return integers, vectors, numbers


def test_rays_from_both_sides(tilted):
    """Of rays whose directions have any length, aimed at points of triangles, those that meet nothing before."""
    surfaces, tracer = tilted
    rng = np.random.default_rng(2)
    aimed = np.repeat(np.arange(COUNT), 100)
    uv = rng.dirichlet((1, 1, 1), aimed.size)[:, 1:]
    front = front_normals(surfaces)
    way = rng.normal(size=(aimed.size, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    slope = np.sum(way * front[aimed], axis=1)
    steep = np.abs(slope) > 0.1  # a grazing ray's point is that much less sure
    aimed, uv, way, slope = aimed[steep], uv[steep], way[steep], slope[steep]
    distance, length = rng.uniform(0.01, 1.0, aimed.size), 10 ** rng.uniform(-3, 3, aimed.size)
    target = points_at(surfaces, aimed, uv)
    rays = RayBatch(
        (target - distance[:, None] * way).astype(np.float32), (length[:, None] * way).astype(np.float32)
    )  # fmt: skip
    hits = tracer.trace(*rays)
    integers, vectors, numbers = interactions(surfaces, hits, rays.direction)
    met = hits.triangle == aimed
    assert met.sum() > 0.5 * aimed.size and 0.2 < np.mean(slope[met] > 0) < 0.8
    (triangle, side_id, material), (point, normal, shading, incoming) = integers[met].T, vectors[met].swapaxes(0, 1)
    u, v, cosine, came = numbers[met].T
    assert np.array_equal(triangle, aimed[met])
    assert np.array_equal(side_id, 2 * triangle + (slope[met] > 0))  # a ray against the normal comes from the front
    assert np.array_equal(material, surfaces.material[triangle])
    assert len(np.unique(material)) > COUNT // 2
    facing = np.where(slope[met] > 0, -1, 1)[:, None] * front[triangle]
    np.testing.assert_allclose(normal, facing, atol=2.0**-22)  # float32
    assert np.array_equal(normal, shading)
    np.testing.assert_allclose(incoming, way[met], atol=2.0**-22)
    np.testing.assert_allclose(np.linalg.norm(incoming, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(cosine, np.abs(slope[met]), atol=2.0**-21)
    np.testing.assert_allclose(point, target[met], atol=10 * POSITION)  # over 0.1, the least cosine here
    np.testing.assert_allclose(points_at(surfaces, triangle, np.column_stack((u, v))), point, atol=POSITION)
    np.testing.assert_allclose(came, distance[met], atol=10 * POSITION)


def test_grazing_rays_count_as_meeting_a_surface(tilted):
    """In the plane of the triangle the cosine is nothing but the rounding of float32, and taken as LEAST_COSINE."""
    surfaces, _ = tilted
    corners = surfaces.corners.of().astype(float)
    for t in range(COUNT):
        along = corners[t, 1] - corners[t, 0]
        at = interact_at(surfaces, t, 0.2, 0.3, tuple(along), 2.0)
        assert at.cosine == LEAST_COSINE > 2.0**-22 and at.triangle == at.side_id >> 1 == t
        assert at.distance == pytest.approx(2.0 * np.linalg.norm(along), rel=1e-12)


@pytest.mark.parametrize("side", [0, 1])
def test_emission_starts_at_a_side(tilted, side):
    surfaces, _ = tilted
    front = front_normals(surfaces)
    for t in range(COUNT):
        at = emit_at(surfaces, 2 * t + side, 0.2, 0.3, 0.7)
        assert (at.triangle, at.side_id, at.material) == (t, 2 * t + side, surfaces.material[t])
        assert (at.u, at.v, at.cosine, at.distance) == (0.2, 0.3, 0.7, 0.0)
        expected = front[t] * (-1 if side else 1)
        np.testing.assert_allclose(at.normal, expected, atol=2.0**-22)
        assert at.normal == at.shading_normal and np.array_equal(np.negative(at.normal), at.incoming)
        (point,) = points_at(surfaces, np.array([t]), np.array([(0.2, 0.3)]))
        np.testing.assert_allclose(at.point, point, atol=POSITION)


@njit
def leave_all(surfaces, side_ids, points, directions, rays):
    for i in range(len(side_ids)):
        x, y, z = points[i]
        dx, dy, dz = directions[i]
        leave(surfaces, side_ids[i], (x, y, z), (dx, dy, dz), rays, i)


@pytest.mark.parametrize("side", [0, 1])
def test_what_leaves_starts_clear_of_its_side(tilted, side):
    """On the side's own side of the plane, at its foot, and not in reach of what it left: directions along the surface
    and into its own side included. Directions stay as they are."""
    surfaces, tracer = tilted
    rng = np.random.default_rng(3)
    triangle = np.repeat(np.arange(COUNT), 50)
    points = points_at(surfaces, triangle, rng.dirichlet((1, 1, 1), triangle.size)[:, 1:])
    normal = front_normals(surfaces)[triangle] * (-1 if side else 1)
    directions = rng.normal(size=points.shape)
    height = np.sum(directions * normal, axis=1)
    directions += (rng.choice([0.0, 1.0, 100.0], height.size) - height)[:, None] * normal
    rays = empty_ray_batch(triangle.size)
    leave_all(surfaces, 2 * triangle + side, points, directions, rays)
    moved = rays.origin - points
    above = np.sum(moved * normal, axis=1)
    clear = surfaces.plane[triangle, 3]
    np.testing.assert_allclose(above, clear, atol=POSITION)
    assert np.all(above > 0) and np.all(clear > 0)
    assert np.abs(moved - above[:, None] * normal).max() < POSITION
    assert np.array_equal(rays.direction, directions.astype(np.float32))
    assert np.count_nonzero(tracer.trace(*rays).triangle == triangle) == 0


@njit
def arrivals(surfaces, hits, wave):
    """Whether each photon is anywhere, its side_id (-1 if not), and vectors (n, 3, 3): point, normal, incoming."""
    anywhere, side_id = np.empty(len(hits.triangle), np.bool_), np.full(len(hits.triangle), -1)
    vectors = np.empty((len(hits.triangle), 3, 3))
    for i in range(len(hits.triangle)):
        anywhere[i] = has_arrived(wave, i, hits.triangle[i])
        if anywhere[i]:
            at = arrive(surfaces, hits, i, wave)
            side_id[i] = at.side_id
            vectors[i, 0], vectors[i, 1], vectors[i, 2] = at.point, at.normal, at.incoming
    return anywhere, side_id, vectors


def test_photons_on_their_way_and_from_the_surroundings():
    """Two squares, one over the other. Photons on their way are where they meet something; those from the surroundings
    where they start, on their way back to these, unless they meet something."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    vertices = np.array([(x, y, z) for z in (-1, 1) for x, y in corners], float)
    triangles = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    scene = make_scene(vertices, triangles, 300.0, [Material()], look((0, 0, 5), (0, 0, 0)), [8.0, 12.0])
    surfaces, tracer, _ = build_surfaces(scene)
    below, up, down = (0.5, -0.25, -1.0), (0.3, 0.2, 2.0), (0.3, 0.2, -2.0)
    u, v = 0.125, 0.375  # of the first triangle: (-1, -1) + u (2, 0) + v (2, 2) = (0, -0.25), in every digit
    foot = (0.0, -0.25, -1.0)
    photons = [  # origin, direction, side_id of arrival; then where it is: side_id, point, incoming; None for gone
        ((0.0, 0.0, 0.0), down, -1, (0, (0.15, 0.1, -1.0), down)),
        ((0.0, 0.0, 0.0), up, -1, (2 * 2 + 1, (0.15, 0.1, 1.0), up)),
        ((0.0, 0.0, 2.0), up, -1, None),  # past the scene
        (below, up, 0, None),  # the upper square hides the surroundings
        (foot, down, 1, (1, foot, (-0.3, -0.2, 2.0))),
        (foot, (5.0, 0.1, 0.1), 0, (0, foot, (-5.0, -0.1, -0.1))),
    ]
    wave = empty_wave(len(photons), 1, False)
    wave.u[:], wave.v[:] = u, v
    for i, (origin, direction, arrival, _) in enumerate(photons):
        wave.arrival[i] = arrival
        if arrival < 0:
            wave.origin[i], wave.direction[i] = origin, direction
        else:
            leave(surfaces, arrival, origin, direction, wave, i)
    anywhere, side_id, vectors = arrivals(surfaces, tracer.trace(wave.origin, wave.direction), wave)
    assert anywhere.tolist() == [expected is not None for *_, expected in photons]
    for i, (*_, expected) in enumerate(photons):
        if expected is not None:
            side, point, incoming = expected
            assert side_id[i] == side
            np.testing.assert_allclose(vectors[i, 0], point, atol=POSITION)
            np.testing.assert_allclose(vectors[i, 1], (0, 0, -np.sign(incoming[2])), atol=2.0**-22)
            np.testing.assert_allclose(vectors[i, 2], incoming / np.linalg.norm(incoming), atol=2.0**-22)
