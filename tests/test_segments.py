# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments: where rays end and how long they are, against plane geometry; a vacuum costs nothing."""

import numpy as np
import pytest

from addon.solver import Material, PointLight, Settings, render
from addon.solver.geometry.segments import Tracer
from addon.solver.geometry.surfaces import build_surfaces
from tests.helpers.scenes import box, look, make_scene

MATERIALS = (Material(),)


@pytest.fixture(scope="module")
def scattered():
    """Surfaces, Tracer of 100 triangles at random in a cube of 2 m."""
    rng = np.random.default_rng(1)
    corners = rng.uniform(-1, 1, (100, 1, 3)) + 0.3 * rng.normal(size=(100, 3, 3))
    triangles = np.arange(300).reshape(-1, 3)
    scene = make_scene(
        corners.reshape(-1, 3), triangles, 300.0, MATERIALS, look((0, 0, 9), (0, 0, 0)), [8.0, 12.0]
    )  # fmt: skip
    surfaces, tracer, _ = build_surfaces(scene)
    return surfaces, tracer


def random_rays(rng, count):
    """Rays within the cube, whose directions have any length."""
    direction = rng.normal(size=(count, 3)) * 10 ** rng.uniform(-2, 2, (count, 1))
    return rng.uniform(-1, 1, (count, 3)).astype(np.float32), direction.astype(np.float32)


def crossings(corners, origin, direction):
    """Parameter of each ray where it crosses the plane of each triangle, (n, m), and how far inside the triangle that
    is: the least of its barycentric coordinates. float64."""
    a, b, c = corners.astype(float).transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    origin, direction = origin.astype(float), direction.astype(float)
    parameter = (np.sum(a * normal, axis=1) - origin @ normal.T) / (direction @ normal.T)
    point = origin[:, None] + parameter[..., None] * direction[:, None]
    inside = np.min(
        [np.sum(np.cross(q - p, point - p) * normal, axis=2) for p, q in ((a, b), (b, c), (c, a))], axis=0
    ) / np.sum(normal**2, axis=1)
    return parameter, inside


def first_crossings(corners, origin, direction):
    """Of each ray: the triangle that it meets first, -1 for none, the parameter there, and whether both are sure, as no
    rim is so near that rounding might decide."""
    parameter, inside = crossings(corners, origin, direction)
    ahead = parameter > 0
    parameter = np.where(ahead & (inside > 0), parameter, np.inf)
    sure = np.all((np.abs(inside) > 1e-4) | ~ahead, axis=1)
    triangle = parameter.argmin(axis=1)
    distance = parameter.min(axis=1)
    return np.where(np.isfinite(distance), triangle, -1), distance, sure


def test_distance_is_that_of_the_plane(scattered):
    """In units of the direction's length, to the triangle that comes first of all."""
    surfaces, tracer = scattered
    origin, direction = random_rays(np.random.default_rng(2), 5000)
    hits = tracer.trace(origin, direction)
    triangle, distance, sure = first_crossings(surfaces.corners.of(), origin, direction)
    assert sure.mean() > 0.9
    assert np.array_equal(hits.triangle[sure], triangle[sure])
    met = sure & (triangle >= 0)
    assert 0.2 < met.mean() < 0.8
    # float32 coordinates of 2 m at most err by 2^-23 m, and along the ray by that over its cosine
    front = surfaces.plane[triangle[met], :3]
    length = np.linalg.norm(direction[met], axis=1)
    cosine = np.abs(np.sum(direction[met] * front, axis=1)) / length
    assert np.all(np.abs(hits.distance[met] - distance[met]) * length * cosine < 16 * 2.0**-23)
    assert np.all(hits.distance[met] > 0) and np.ptp(np.log10(distance[met])) > 3


def test_rays_end_where_they_reach(scattered):
    """A ray that ends short of what it would meet meets nothing, and its distance is what it reaches; one that ends
    behind it does."""
    surfaces, tracer = scattered
    origin, direction = random_rays(np.random.default_rng(3), 5000)
    whole = tracer.trace(origin, direction)
    met = whole.triangle >= 0
    for factor in (0.999, 1.001):
        reach = (factor * whole.distance[met]).astype(np.float32)
        hits = tracer.trace(origin[met], direction[met], reach.copy())
        if factor < 1:
            assert np.all(hits.triangle == -1) and np.array_equal(hits.distance, reach)
        else:
            assert np.array_equal(hits.triangle, whole.triangle[met])
            assert np.array_equal(hits.distance, whole.distance[met])
    assert np.all(whole.distance[~met] > 1e30)


def test_visible_is_where_nothing_is_met(scattered):
    """Between pairs of points: the way is free unless a triangle crosses it before its end."""
    surfaces, tracer = scattered
    rng = np.random.default_rng(4)
    start, end = (rng.uniform(-1, 1, (5000, 3)).astype(np.float32) for _ in range(2))
    parameter, inside = crossings(surfaces.corners.of(), start, end - start)
    blocks = (parameter > 0) & (parameter < 1) & (inside > 0)
    near = (np.abs(parameter) < 1e-4) | (np.abs(parameter - 1) < 1e-4) | (np.abs(inside) < 1e-4)
    sure = ~np.any(near, axis=1)
    free = tracer.visible(start, end - start, np.ones(5000, np.float32))
    assert free.dtype == np.bool_ and sure.mean() > 0.9 and 0.2 < free.mean() < 0.8
    assert np.array_equal(free[sure], ~np.any(blocks, axis=1)[sure])


# A vacuum


def test_a_vacuum_asks_for_no_media(monkeypatch):
    """Between surfaces alone nobody asks what a segment crosses: photons, camera paths, shadow rays."""

    def asked(*_):
        pytest.fail("a segment in a vacuum was asked for its media")

    monkeypatch.setattr(Tracer, "cross", asked, raising=False)
    vertices, triangles = box((2.0, 2.0, 2.0))
    temperature = np.repeat([300.0, 310.0, 290.0, 300.0, 350.0, 300.0], 2)
    materials = (Material("paint", 0.6), Material("metal", 0.3, 0.8, 0.4))
    camera = look((0.3, 0.3, 1.0), (1.5, 1.6, 0.8), 8, 6)
    scene = make_scene(
        vertices, triangles, temperature, materials, camera, [8.0, 12.0], np.repeat([0, 1, 0, 0, 0, 1], 2),
        lights=(PointLight(np.array([1.0, 1.0, 1.8]), 10.0),),
    )  # fmt: skip
    film = render(scene, Settings(passes=2, photons_per_pass=2000))
    assert film.photons == 4000 and np.isfinite(film.temperature()).all()
