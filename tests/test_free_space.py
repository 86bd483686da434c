# SPDX-License-Identifier: GPL-3.0-or-later
"""Free space: what feelers find of walls, wherever they start to go round."""

import math

import numpy as np
import pytest

from addon.solver import Material
from addon.solver.geometry.area import disk_before
from addon.solver.geometry.free_space import free_space
from addon.solver.geometry.surfaces import build_surfaces
from tests.helpers.scenes import join, look, make_scene, quad, sphere

REACH2 = 0.2**2
TURNS = np.linspace(0, 1, 40, endpoint=False)


def space_around(point, *parts):
    """Free space around a point (3,) of the first triangle of the first part, for feelers in 40 turns."""
    *mesh, material = join(*((*part, 300.0, 0) for part in parts))
    scene = make_scene(*mesh, [Material()], look((0, 0, 5), (0, 0, 0)), [8.0, 12.0], material)
    surfaces, tracer, centre = build_surfaces(scene)
    points = np.tile(np.asarray(point, float) - centre, (len(TURNS), 1))
    t = next(t for t in range(len(surfaces.sheet)) if surfaces.sheet[t, 0] == surfaces.sheet[0, 0])
    return free_space(tracer, surfaces, REACH2, points, np.full(len(TURNS), 2 * t, np.int32), TURNS)


def grid(corner, u, v, cells=1):
    """A parallelogram from a corner of cells by cells pairs of triangles."""
    i, j = np.divmod(np.arange((cells + 1) ** 2), cells + 1)
    vertices = np.asarray(corner) + np.outer(i / cells, u) + np.outer(j / cells, v)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    triangles = first[:, None, None] + np.array([[0, cells + 1, cells + 2], [0, cells + 2, 1]])
    return vertices, triangles.reshape(-1, 3)


FLOOR = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))


@pytest.mark.parametrize("lean", [-50, 0, 50])  # degrees, over the floor and away from it
def test_steep_walls(lean):
    """The position of the wall's foot, along the surface, whichever feeler met it. They rise by a tenth at most: so one
    meets a wall that leans by 50 degrees at most an eighth nearer or further away than its foot."""
    up = np.array((-math.sin(math.radians(lean)), 0.0, math.cos(math.radians(lean))))
    space = space_around((0.0, 0.0, 0.0), FLOOR, quad(np.array((0.1, 0, 0)) + 0.5 * up, 0.5 * up, (0, 1, 0)))
    distance = 1 / np.linalg.norm(space.wall, axis=1)
    np.testing.assert_allclose(space.wall * distance[:, None], np.tile((1, 0, 0), (len(TURNS), 1)), atol=1e-6)
    np.testing.assert_allclose(distance, 0.1, atol=1e-5)
    assert np.all(space.radius2 <= (0.1 / 0.88) ** 2) and np.all(space.radius2 >= 0.85 * (0.1 / 1.12) ** 2)


def test_the_nearest_of_two_walls():
    walls = quad((0.1, 0, 0.5), (0, 1, 0), (0, 0, 0.5)), quad((0, -0.05, 0.5), (1, 0, 0), (0, 0, 0.5))
    space = space_around((0.0, 0.0, 0.0), FLOOR, *walls)
    np.testing.assert_allclose(space.wall, np.tile((0, -20, 0), (len(TURNS), 1)), rtol=1e-3, atol=1e-3)
    assert np.all(space.cut2 <= 0.1**2 * 1.01) and np.all(space.cut2 >= 0.5 * 0.1**2 * 0.99)  # which the other ends


def test_one_wall_cuts_what_others_do_not_reach():
    """Met by one feeler or two, beside its foot or far along it, it alone does not limit the disk that it cuts."""
    space = space_around((0.0, 0.0, 0.0), FLOOR, quad((0.05, 0, 0.5), (0, 1, 0), (0, 0, 0.5)))
    assert np.all(space.cut2 == np.float32(REACH2)) and np.all(space.radius2 <= 0.05**2 * 1.01)


@pytest.mark.parametrize("slope", [6, 20])  # degrees
def test_low_ramps(slope):
    """What lies behind its foot is beyond it, whether it ends there or goes on under the floor. Feelers start
    2e-6 m above it (CLEAR of the scene's 2 m), that over tan 6 degrees is 2e-3 of the distance."""
    up = np.array((math.cos(math.radians(slope)), 0.0, math.sin(math.radians(slope))))
    for below in (0.0, 0.3):
        foot = np.array((0.01, 0, 0)) + (0.5 - below) * up
        space = space_around((0.0, 0.0, 0.0), FLOOR, quad(foot, 0.5 * up, (0, 1, 0)))
        np.testing.assert_allclose(space.wall, np.tile((100, 0, 0), (len(TURNS), 1)), rtol=3e-3, atol=1e-3)


@pytest.mark.parametrize("cells", [1, 7])
@pytest.mark.parametrize("lean", [-1.0, 0.0, 0.5])  # degrees, down to the floor behind and up from it
def test_overhangs(cells, lean):
    """A panel 5 mm above the floor, which feelers meet from below, some 5 cm and some 25 cm away, hides the floor from
    its rim on; around a point that it hides itself it narrows the space alone."""
    along = np.array((math.cos(math.radians(lean)), 0.0, math.sin(math.radians(lean))))
    panel = grid(np.array((0.05, -1, 0.005)), 0.4 * along, (0, 2, 0), cells)
    space = space_around((0.0, 0.0, 0.0), FLOOR, panel)
    np.testing.assert_allclose(space.wall, np.tile((20, 0, 0), (len(TURNS), 1)), rtol=1e-3, atol=1e-3)
    hidden = space_around((0.25, 0.0, 0.0), FLOOR, panel)
    assert np.all(hidden.wall == 0) and np.all(hidden.cut2 < REACH2)


def test_the_rim_of_an_overhang_runs_aslant():
    space = space_around((0.27, 0.0, 0.0), FLOOR, grid((0.05, -1, 0.005), (1, 0, 0), (0.5, 2, 0)))
    across = np.array((2, -0.5, 0)) / math.hypot(2, 0.5)
    expected = across / (0.03 * across[0])  # the rim passes through (0.3, 0)
    np.testing.assert_allclose(space.wall, np.tile(expected, (len(TURNS), 1)), rtol=1e-3, atol=1e-3)


def test_nothing_in_reach():
    space = space_around((0.0, 0.0, 0.0), FLOOR, quad((0.3, 0, 0.5), (0, 1, 0), (0, 0, 0.5)))
    assert np.all(space.wall == 0) and np.all(space.radius2 == np.float32(REACH2))


def test_a_hollow_surface_is_no_wall_to_itself():
    vertices, triangles = sphere(3, 0.1)
    inward = vertices, triangles[:, ::-1]
    space = space_around(vertices[triangles[0]].mean(axis=0), inward)
    assert np.all(space.wall == 0) and np.all(space.radius2 == np.float32(REACH2))


@pytest.mark.parametrize("near", [1e-6, 0.3, 0.999])
def test_area_before_a_wall(near):
    """Against the integral over chords."""
    x = np.linspace(-1, near, 2_000_001)
    chord = 2 * np.sqrt(1 - x * x)
    expected = 0.25 * (chord[1:] + chord[:-1]).sum() / 2 * (x[1] - x[0])
    wall = np.array((0.0, 2.0 / near, 0.0), np.float32)
    assert disk_before(wall, 0.25) == pytest.approx(expected, rel=1e-5)


def test_a_wall_that_only_touches():
    """Rounding may put it beyond the disk after all: it then takes nothing away, and the area is a number."""
    for r2 in np.random.default_rng(5).uniform(1e-12, 1e12, 1000):
        wall = np.array((1 / math.sqrt(r2), 0.0, 0.0), np.float32)
        assert disk_before(wall, r2) == pytest.approx(math.pi * r2, rel=1e-6)
