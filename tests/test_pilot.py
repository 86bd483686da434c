# SPDX-License-Identifier: GPL-3.0-or-later
"""The look at a scene before the first pass finds what the image can depend on, and how much, in scenes that one can
compute by hand.

Shares of the pilot's 4096 paths are binomial: tolerances are four standard deviations. The pilot's random numbers are
always the same, so a test that passes does so again.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

from addon.solver import Material
from addon.solver.geometry.eye import build_eye
from addon.solver.geometry.stage import Stage
from addon.solver.geometry.surfaces import Surfaces, build_surfaces
from addon.solver.geometry.triangles import centroids, scene_radius
from addon.solver.physics.radiometry import grey_radiometry, typical_emissivity
from addon.solver.planning.pilot import _LEAST_DENSITY, _LEAST_ERROR, DEFENSIVE, Pilot, explore
from tests.helpers.scenes import box, join, look, make_scene, quad

EDGES = np.array([8.0, 12.0])
PATHS = 4096
BLACK, GREY, MIRROR = Material("black", 1.0), Material("grey", 0.5), Material("mirror", 0.4, specular=1.0)
NADIR = look((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), tangent=1e-3)  # sees a point of the floor


class Explored(NamedTuple):
    """What the pilot found; its triangles, whose centre is where `centre` was in the scene."""

    pilot: Pilot
    surfaces: Surfaces
    centre: np.ndarray

    def of_sides(self, name):
        """(t, 2) what the pilot says of each side by its sheet."""
        return getattr(self.pilot, name)[self.surfaces.sheet]

    @property
    def importance(self):
        """(t,) share of the light in the image that comes from each triangle."""
        met, share = self.pilot.met, self.pilot.importance
        return np.bincount(met[met >= 0], share[met >= 0], len(self.surfaces.sheet))

    def faces(self, point):
        """(t, 2) bool, sides that face a point of the scene."""
        towards = np.sum((point - self.centre - centroids(self.surfaces.corners)) * self.surfaces.plane[:, :3], axis=1)
        return np.column_stack((towards > 0, towards < 0))


def explored(parts, camera, materials=(GREY, BLACK, MIRROR)):
    """The pilot of parts (vertices, triangles, material), all at 300 K."""
    vertices, triangles, temperature, material = join(*((*mesh, 300.0, index) for *mesh, index in parts))
    scene = make_scene(vertices, triangles, temperature, materials, camera, EDGES, material)
    surfaces, tracer, centre = build_surfaces(scene)
    emissivity = typical_emissivity(scene.materials, scene.band_edges, surfaces.temperature)
    stage = Stage(surfaces, grey_radiometry(scene.materials, emissivity.mean(axis=1)))
    eye = build_eye(scene.camera, centre, scene_radius(surfaces.corners))
    return Explored(explore(stage, tracer, eye), surfaces, centre)


def sigma(share, paths=PATHS):
    """Standard deviation of a share of so many independent paths."""
    return math.sqrt(share * (1.0 - share) / paths)


def rectangle_factor(a, b, height):
    """View factor from a point to a parallel rectangle 2 a x 2 b centred above it (Howell, B-3 four times)."""
    x, y = a / height, b / height
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return 2 / math.pi * (x / p * math.atan(y / p) + y / q * math.atan(x / q))


def squares_factor(side, height):
    """View factor between two equal squares opposite to each other (Howell, C-11)."""
    x = side / height
    p = math.sqrt(1 + x * x)
    log = math.log((1 + x * x) ** 2 / (1 + 2 * x * x)) / 2
    return 2 / (math.pi * x * x) * (log + 2 * x * p * math.atan(x / p) - 2 * x * math.atan(x))


def floor_and_plate(half, height, material=1):
    """A square on the ground and an equal one above it, that sends nothing back if it is black."""
    return (
        (*quad((0, 0, 0), (half, 0, 0), (0, half, 0)), 0),
        (*quad((0, 0, height), (half, 0, 0), (0, half, 0)), material),
    )


# Which sides matter ---------------------------------------------------------------------------------------------------


def two_rooms(gap=0.0):
    """Two cubes that share a wall at x = 1 m, which ends so far below the ceiling, and nothing of which is in one
    surface with the walls that it meets."""
    near, (corners, triangles) = box(), box()
    partition = quad((1, 0.5, 0.5 - gap / 2), (0, 0.5, 0), (0, 0, 0.5 - gap / 2))
    far = (corners + (1, 0, 0), triangles[2:], 0)  # without its wall at x = 1
    return (near[0], np.delete(near[1], (2, 3), axis=0), 0), far, (*partition, 0)


EYE = (0.4, 0.5, 0.6)  # in the near room
INTO_THE_NEAR_ROOM = look(EYE, (0.0, 0.4, 0.3))


def test_what_a_partition_hides_does_not_matter():
    """Just the insides of the room that the camera is in do: not those of the next one, nor what faces outwards."""
    seen = explored(two_rooms(), INTO_THE_NEAR_ROOM)
    near = np.all(seen.surfaces.corners.of()[..., 0] + seen.centre[0] < 1 + 1e-6, axis=1)
    expected = seen.faces(EYE) & near[:, None]
    assert expected.sum() == 12  # triangles of six walls
    np.testing.assert_array_equal(seen.of_sides("reachable"), expected)
    weight, arrival = seen.of_sides("weight"), seen.of_sides("arrival")
    assert np.all(weight[~expected] == DEFENSIVE) and np.all(arrival[~expected] == DEFENSIVE)
    assert weight[expected].min() >= _LEAST_DENSITY
    assert not seen.importance[~near].any()


def test_a_gap_in_the_partition_lets_the_next_room_matter():
    seen = explored(two_rooms(gap=0.2), INTO_THE_NEAR_ROOM)
    inside = seen.faces(EYE) | seen.faces((1.6, 0.5, 0.6))
    np.testing.assert_array_equal(seen.of_sides("reachable"), inside)
    assert inside.sum() == 2 * 10 + 4  # both sides of the partition


def test_what_no_path_meets_matters_if_it_sees_what_matters():
    """A plate of a square millimetre, 3 m above the ground: its view factor from there is 4e-8. Only its lower side."""
    tiny = quad((0.5, 0, 3), (5e-4, 0, 0), (0, 5e-4, 0))
    seen = explored(((*quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), 0), (*tiny, 0)), NADIR)
    assert not np.any(seen.pilot.met >= 2)  # the ground has two triangles
    np.testing.assert_array_equal(seen.of_sides("reachable"), seen.faces((0.5, 0.0, 1.0)))


# How much they matter -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("half, height", [(1.0, 1.0), (0.5, 1.5), (4.0, 0.8)])
def test_importance_is_the_view_factor(half, height):
    """From the point of the floor that the camera sees; the rest is the sky's. Both halves of the plate alike."""
    factor = rectangle_factor(half, half, height)
    seen = explored(floor_and_plate(half, height), NADIR)
    pilot = seen.pilot
    assert seen.importance[2:].sum() == pytest.approx(factor, abs=4 * sigma(factor))
    np.testing.assert_allclose(seen.importance[2:], factor / 2, rtol=0, atol=4 * sigma(factor / 2))
    assert not seen.importance[:2].any()
    assert pilot.sky == pytest.approx(1 - factor, abs=4 * sigma(factor))
    assert not pilot.open.any()


def test_importance_falls_with_every_reflection():
    """Between wide plates of reflectance 1/2, from the lower one: the upper one is met after 1, 3, 5 and 7 reflections,
    the lower one after 2, 4 and 6, and each halves what is carried. That is all that is followed."""
    seen = explored(floor_and_plate(1e3, 1.0, material=0), NADIR)
    assert seen.importance[2:].sum() == pytest.approx(85 / 127, rel=1e-3)  # of 4096 paths hardly one leaves
    assert seen.importance[:2].sum() == pytest.approx(42 / 127, rel=1e-3)
    assert seen.pilot.sky < 1e-3


def test_all_light_in_a_closed_room_is_its_own():
    seen = explored([(*box(), 0)], look((0.5, 0.5, 0.9), (0.5, 0.5, 0.0)))
    assert seen.importance.sum() == pytest.approx(1.0) and seen.importance.min() > 0.0
    assert seen.pilot.sky == 0.0 and seen.pilot.openness == 0.0


def test_density_is_that_of_paths_per_area():
    """Half of what matters, by area, sends all light to the image: twice the mean density; the other half gets the
    least. What arrives from the sky arrives at the floor alone. The mean of few paths is drawn to 1 by four."""
    seen = explored(floor_and_plate(1.0, 0.6), NADIR)
    lower, upper = seen.faces((0, 0, 0.3)), ~seen.faces((0, 0, 0.3))
    weight, arrival = seen.of_sides("weight"), seen.of_sides("arrival")
    np.testing.assert_allclose(weight[2:][lower[2:]], 2.0, rtol=4 / (PATHS / 2))
    assert np.all(weight[:2][lower[:2]] == _LEAST_DENSITY)
    np.testing.assert_allclose(arrival[:2][lower[:2]], 2.0, rtol=4 / (PATHS / 2))
    assert np.all(arrival[2:][lower[2:]] == _LEAST_DENSITY)
    assert np.all(weight[upper] == DEFENSIVE)


# How open the scene is ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("height", [0.3, 1.0, 3.0])
def test_openness_is_what_the_opening_leaves(height):
    """Between two squares of 1 m: each sees the other by the view factor, and else the sky."""
    away = 1 - squares_factor(1.0, height)
    pilot = explored(floor_and_plate(0.5, height), look((0, 0, 0.2), (0, 0, 0), tangent=1e-3)).pilot
    assert pilot.openness == pytest.approx(away, abs=4 * sigma(away))


def test_openness_is_the_mean_over_the_area():
    """A plate of 0.1 m, 1 m over a square of 2 m: by reciprocity each takes the same from the other's opening."""
    factor = rectangle_factor(1.0, 1.0, 1.0)  # of the plate's middle; its rim's is within 1 %
    closed = 2 * 0.01 * factor / (4 + 0.01)
    pilot = explored((floor_and_plate(1.0, 0.0)[0], floor_and_plate(0.05, 1.0)[1]), NADIR).pilot
    assert pilot.openness == pytest.approx(1 - closed, abs=4 * sigma(closed))


def test_open_ground_sees_the_sky_and_little_depends_on_it():
    """Rays say exactly what the sky sends there; the least weight that the pilot gives it is left."""
    seen = explored([(*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0)], NADIR)
    assert seen.pilot.openness == 1.0 and not seen.importance.any()
    np.testing.assert_array_equal(seen.of_sides("open"), seen.faces((0, 0, 1)))
    assert seen.pilot.sky == pytest.approx(_LEAST_ERROR)


# What paths carry and where -------------------------------------------------------------------------------------------


def test_a_mirror_is_passed_and_takes_its_share():
    """The camera sees the ground by way of a mirror of reflectance 0.6 at 45 degrees; the ground reflects 1/2 of it."""
    mirror = quad((0, 0, 1), (0.5, 0, 0.5), (0, 0.5, 0))
    ground = quad((0, 0, 0), (3, 0, 0), (0, 3, 0))
    camera = look((2, 0, 1), (0, 0, 1), tangent=1e-3)
    seen = explored(((*ground, 0), (*mirror, 2)), camera)
    pilot = seen.pilot
    np.testing.assert_allclose(pilot.throughput, 0.6 * 0.5, rtol=1e-6)
    assert len(pilot.point) == PATHS
    np.testing.assert_allclose(pilot.point + seen.centre, np.zeros((PATHS, 3)), atol=4e-3)  # 1e-3 of 3 m of way
    np.testing.assert_allclose(pilot.normal, np.broadcast_to((0, 0, 1), (PATHS, 3)), atol=1e-6)
    assert set(pilot.side_id >> 1) <= {0, 1} and seen.faces((0, 0, 1))[pilot.side_id >> 1, pilot.side_id & 1].all()
    # all leave the mirror for the ground
    labels = seen.surfaces.sheet[2:][seen.faces((2, 0, 1))[2:]]
    assert np.count_nonzero(np.isin(pilot.left[:PATHS], labels)) == PATHS and set(pilot.met[:PATHS]) <= {0, 1}


@pytest.mark.parametrize("distance", [0.5, 20.0])
def test_view_is_the_width_of_the_picture_where_it_meets_the_scene(distance):
    camera = look((0, 0, distance), (0, 0, 0), tangent=0.01)
    seen = explored([(*quad((0, 0, 0), (5, 0, 0), (0, 5, 0)), 0)], camera)
    assert seen.pilot.view == pytest.approx(0.02 * distance, rel=1e-4)  # the cosine at the picture's rim


def test_the_background_is_the_share_of_camera_rays_that_meet_nothing():
    """A square of 2 m, seen from 10 m above by a camera whose frame is 8 m wide and 6 m high there."""
    seen = explored([(*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0)], look((0, 0, 10), (0, 0, 0), tangent=0.4))
    assert seen.pilot.background == pytest.approx(1 - 4 / 48, abs=4 * sigma(4 / 48))


def test_a_camera_that_sees_nothing_needs_nothing():
    seen = explored([(*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0)], look((0, 0, 1), (0, 0, 2)))
    assert seen.pilot.view == math.inf and seen.pilot.openness == 0.0 and seen.pilot.background == 1.0
    assert not seen.pilot.reachable.any() and not seen.importance.any() and len(seen.pilot.point) == 0
