# SPDX-License-Identifier: GPL-3.0-or-later
"""The irradiance cache: the nearest point on a sheet answers where it tells the light, right in the mean."""

import math

import numpy as np
import pytest
from numba import njit

from addon.solver import Material
from addon.solver.camera.rays import Estimate
from addon.solver.geometry.free_space import unlimited
from addon.solver.geometry.point_tree import empty_walk
from addon.solver.geometry.surfaces import build_surfaces, unit_normal
from addon.solver.photons.irradiance_cache import (
    _RESOLVED,
    FARTHEST,
    Vicinity,
    VisiblePoints,
    build_irradiance_cache,
    cache_points,
    look_around,
    ray_ends,
    recalled,
)
from addon.solver.photons.photon_map import query_at
from addon.solver.planning.sheets import dark_sheets
from addon.solver.planning.splitting import Splitting
from addon.solver.planning.survey import Cells
from tests.helpers.photon_maps import photon_map, side_under, square
from tests.helpers.scenes import box, join, look, make_scene, quad

EDGES = np.array([8.0, 12.0])

SHEETS = 16  # at most, of the surfaces here
NO_RAYS = Splitting(
    dark_sheets(SHEETS), Cells(np.zeros(0, np.int64), *np.zeros((6, 0)), np.zeros(0, np.int64), np.zeros(0)),
    np.zeros(0, np.int32), np.zeros(0), math.inf,
)  # fmt: skip


def choices(neighbours, reach2, shrink2):
    """Of the solver's own types: kernels are kept for them, and others that load the kernels must know them."""
    return Estimate(neighbours, neighbours, reach2, shrink2, True, False, NO_RAYS)


@njit
def recall_all(cache, surfaces, side_id, points, reach2):
    walk = empty_walk()
    index = np.empty(len(points), np.int64)
    for i in range(len(points)):
        x, y, z = points[i]
        index[i] = recalled(cache, query_at(surfaces, side_id, (x, y, z)), reach2, walk)
    return index


def seen_by(reach2, distance=FARTHEST, direct=0.0, wall=(0.0, 0.0, 0.0)):
    """What is around all points: at so many m, with this direct light beside that of photons, and this wall."""

    def look(point, side_id, first):
        count = len(side_id)
        space = unlimited(count, reach2)._replace(wall=np.tile(np.float32(wall), (count, 1)))
        return Vicinity(space, np.tile((distance, 0.0, 0.0, 0.0), (count, 1))), np.full((count, 1), direct, np.float32)

    return look


def scattered(rng, count):
    return (rng.random((count, 3)) * (1, 1, 0) - (0.5, 0.5, 0)).astype(np.float32)


@pytest.mark.parametrize("mean_photons", [60, 1000])
def test_what_is_recalled_is_unbiased(mean_photons):
    """Against the density of Poisson points; at points among those counted themselves it would be 5 % too high at 20
    neighbours, and more where fewer are within reach (60). 3 standard errors."""
    rng = np.random.default_rng(4)
    surfaces = square(10)
    estimate = choices(20, 9.0 / 1000, 0.5)
    ratios = []
    for _ in range(600):
        points = scattered(rng, rng.poisson(mean_photons))
        built = photon_map(points, surfaces, side_under(points, 10))
        known = scattered(rng, 64)
        known = known, side_under(known, 10).astype(np.int32)
        cache = build_irradiance_cache(built.photons, surfaces, estimate, known, seen_by(estimate.reach2))
        chosen = recall_all(cache, surfaces, 0, scattered(rng, 8), 1.0)
        assert np.all(chosen >= 0)
        ratios.append(cache.value[chosen, 0].mean() / mean_photons)
    mean, error = np.mean(ratios), np.std(ratios, ddof=1) / math.sqrt(len(ratios))
    assert error < 0.02
    assert abs(mean - 1) < 3 * error


def test_the_nearest_point_of_the_sheet_answers():
    """Brute force finds the same; beyond the reach, from the other side and on another sheet there is none."""
    rng = np.random.default_rng(5)
    surfaces = square()
    point = scattered(rng, 300)
    side_id = side_under(point, 1).astype(np.int32)
    built = photon_map(point, surfaces, side_id)
    cache = build_irradiance_cache(built.photons, surfaces, choices(20, 0.01, 1.0), (point, side_id), seen_by(0.01))
    kept = np.swapaxes(cache.tree.leaves[:, :3], 1, 2).reshape(-1, 3)[:300]
    queries = scattered(rng, 200)
    distance2 = ((queries[:, None] - kept) ** 2).sum(axis=2)
    assert np.array_equal(recall_all(cache, surfaces, 0, queries, 1.0), distance2.argmin(axis=1))
    within = distance2.min(axis=1) < 1e-4
    assert 0 < within.sum() < 200
    assert np.array_equal(recall_all(cache, surfaces, 0, queries, 1e-4) >= 0, within)
    assert np.all(recall_all(cache, surfaces, 1, queries, 1.0) == -1)
    above = surfaces._replace(sheet=surfaces.sheet + 2)
    assert np.all(recall_all(cache, above, 0, queries, 1.0) == -1)


def test_what_shadow_rays_find_is_added_to_what_photons_tell():
    """Both parts of the direct light: without photons a point knows what shadow rays found, with photons more."""
    surfaces, rng = square(), np.random.default_rng(6)
    point = scattered(rng, 40)
    side_id = side_under(point, 1).astype(np.int32)
    photons = scattered(rng, 500)
    some = photon_map(photons, surfaces, side_under(photons, 1))
    estimate = choices(20, 0.01, 1.0)
    values = [
        build_irradiance_cache(some.photons, surfaces, estimate, (point, side_id), seen_by(0.01, direct=light)).value
        for light in (0.0, 7.0)
    ]
    np.testing.assert_allclose(values[1] - values[0], 7.0, rtol=1e-5)
    assert np.all(values[0] > 0)


@pytest.mark.parametrize("near", [FARTHEST, 1.0, 0.5, 0.05])
def test_only_light_that_is_resolved_is_recalled(near):
    """Up to the distance that, with the radius of the disk, makes 0.28 of the distance to what is around. Shrunk by a
    quarter, the radius of the disk that holds all within 0.2 m is 0.1 m."""
    surfaces = square()
    point, side_id = np.zeros((1, 3), np.float32), np.zeros(1, np.int32)
    built = photon_map(np.array([(0.1, 0.0, 0.0)]), surfaces)
    look, estimate = seen_by(0.04, near), choices(20, 0.04, 0.25)
    cache = build_irradiance_cache(built.photons, surfaces, estimate, (point, side_id), look)
    distances = np.linspace(0.0, 0.45, 200)
    queries = np.column_stack((distances, 0 * distances, 0 * distances))
    found = recall_all(cache, surfaces, 0, queries, 0.16) >= 0
    assert np.array_equal(found, distances < min(_RESOLVED * near - 0.1, 0.4))
    assert found.any() == (near > 0.05)


def test_what_recalls_could_change_places():
    """On a plane below a small lamp recalls are right in the mean, though those close to the lamp are not resolved: 400
    points, 8000 ends, 60 times. Were points judged by their own distance to the lamp, 0.5 % would be missing. Three
    standard errors, and 0.04 %, as ends at the border of the plane have points on one side alone."""
    surfaces, rng, height, estimate = square(), np.random.default_rng(8), 0.1, choices(20, 9e-4, 1.0)
    built = photon_map(np.zeros((0, 3)), surfaces)

    def below(point):
        """Way from the lamp, distance, and irradiance."""
        way = point.astype(float) - (0.0, 0.0, height)
        distance = np.linalg.norm(way, axis=1)
        return way, distance, height / distance**3

    def look(point, side_id, first):
        way, distance, light = below(point)
        near = np.column_stack((distance, way / distance[:, None]))
        return Vicinity(unlimited(len(point), estimate.reach2), near), light[:, None].astype(np.float32)

    off = []
    for _ in range(60):
        known, ends = scattered(rng, 400), scattered(rng, 8000)
        sides = side_under(known, 1).astype(np.int32)
        cache = build_irradiance_cache(built.photons, surfaces, estimate, (known, sides), look)
        found, truth = recall_all(cache, surfaces, 0, ends, 1.0), below(ends)[2]
        known = found >= 0
        assert 0.1 < known.mean() < 0.99
        off.append((cache.value[found[known], 0] - truth[known]).sum() / truth.sum())
    error = np.std(off, ddof=1) / math.sqrt(len(off))
    assert error < 5e-4  # else it would say little
    assert abs(np.mean(off)) < 3 * error + 4e-4


def test_a_point_beyond_a_wall_is_not_recalled():
    """The point is at x = -0.05 and its wall at x = 0: beyond it others answer, or nobody does."""
    surfaces = square()
    point, side_id = np.array([(-0.05, 0.0, 0.0)], np.float32), np.zeros(1, np.int32)
    built = photon_map(np.array([(-0.1, 0.0, 0.0)]), surfaces)
    look = seen_by(0.04, wall=(20.0, 0.0, 0.0))  # 1 / m: 0.05 m away
    cache = build_irradiance_cache(built.photons, surfaces, choices(20, 0.04, 1.0), (point, side_id), look)
    x = np.array([-0.3, -0.1, -0.01, 0.01, 0.1, 0.3])
    queries = np.column_stack((x, 0 * x + 0.1, 0 * x))
    assert np.array_equal(recall_all(cache, surfaces, 0, queries, 1.0) >= 0, x < 0)


def two_rooms():
    """A floor that goes on below a wall at x = 0, and the parts of a scene: (surfaces, tracer, centre)."""
    floor, wall = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), quad((0, 0, 0.5), (0, 1, 0), (0, 0, 0.5))
    vertices, triangles, kelvin, material = join((*floor, 300.0, 0), (*wall, 300.0, 0))
    camera = look((0.5, 0.5, 0.5), (0.5, 0.5, 0))
    return build_surfaces(make_scene(vertices, triangles, kelvin, (Material(),), camera, EDGES, material))


def test_a_wall_parts_what_is_recalled():
    """On the floor at both sides of a wall: each point of a cache that knows what is around it answers on its side
    alone, however near the other side is. 5 mm are as many as the point's clearance of the wall."""
    surfaces, tracer, centre = two_rooms()
    rng = np.random.default_rng(7)
    x = rng.uniform(0.005, 0.1, 64) * np.where(np.arange(64) % 2, -1.0, 1.0)
    point = np.column_stack((x, rng.uniform(-0.3, 0.3, 64), 0 * x)) - centre
    corners = surfaces.corners.of(slice(2)).astype(float)
    up = int(np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])[2] < 0)
    on_second = point[:, 1] > point[:, 0]
    side_id = (2 * on_second + up).astype(np.int32)
    built = photon_map(np.zeros((0, 3)), surfaces)

    def around(points, sides, first):
        vicinity = look_around(tracer, surfaces, 0.04, (points, sides), np.uint64(5), first)
        assert np.all(np.any(vicinity.space.wall != 0.0, axis=1))
        return seen_by(0.04)(points, sides, first)[0]._replace(space=vicinity.space), np.zeros(
            (len(sides), 1), np.float32
        )

    cache = build_irradiance_cache(
        built.photons, surfaces, choices(20, 0.04, 1.0), (point.astype(np.float32), side_id), around
    )
    kept = np.swapaxes(cache.tree.leaves[:, :3], 1, 2).reshape(-1, 3)[:64] + centre
    asked = np.column_stack((rng.uniform(-0.1, 0.1, 200), rng.uniform(-0.3, 0.3, 200), np.zeros(200)))
    found = recall_all(cache, surfaces, int(up), asked - centre, 1.0)
    assert np.all(found >= 0)
    assert np.array_equal(kept[found, 0] > 0, asked[:, 0] > 0)


def test_how_near_the_surroundings_are_is_the_root_mean_square_of_inverse_distances():
    """On the floor, close to the middle of a wall of 2 m x 1 m at a distance d: rays towards it, at the angle a from
    its normal and the height angle b, go d / (cos a cos b). The mean over cosine-distributed rays is by quadrature, and
    so is how it changes away from the wall, if what they meet stays where it is; eight rays from each of 4096 points
    know both to 4 standard errors."""
    surfaces, tracer, centre = two_rooms()
    distance = 0.1
    point = np.tile(np.array((distance, 0.0, 0.0)) - centre, (4096, 1)).astype(np.float32)
    corners = surfaces.corners.of(slice(1)).astype(float)
    up = int(np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])[2] < 0)
    side_id = np.full(len(point), up, np.int32)
    h, *change = look_around(tracer, surfaces, 0.04, (point, side_id), np.uint64(5), 0).near.T
    y, z = np.meshgrid(*((np.arange(1000) + 0.5) / 1000,) * 2)
    y = 2.0 * y - 1.0
    square = distance**2 + y**2 + z**2
    density = 2.0 * z * distance / (np.pi * square**3)  # of cos cos' / (pi d^2) / d^2 over 2 m2
    for found, expected in ((h**-2, density.mean()), (change[0] * h**-3, (density * distance / square).mean())):
        error = found.std(ddof=1) / math.sqrt(len(found))
        assert error < 0.03 * expected
        assert abs(found.mean() - expected) < 4 * error


def test_points_come_closer_as_disks_shrink():
    """Else the blur between them would stay when that of the disks is gone."""
    counts = [cache_points(100_000, shrink2) for shrink2 in (1.0, 0.25, 0.01)]
    assert counts == sorted(counts) and counts[-1] >= 10 * counts[0] * 0.99
    assert cache_points(100, 1e-6) == 100 and cache_points(1, 1.0) == 1


def test_points_lie_where_rays_of_final_gathers_end():
    """From the middle of a cube's floor: the ceiling's share is its view factor, of a parallel square above, 4 times
    that of a corner's (Howell, factor B-3 with X = Y = 1 / 2). Points that carry nothing send none. 4 standard errors.
    """
    vertices, triangles, kelvin, material = join((*box((1.0, 1.0, 1.0)), 300.0, 0))
    scene = make_scene(
        vertices, triangles, kelvin, (Material(),), look((0.5, 0.5, 0.5), (0.5, 0.5, 0)), EDGES, material
    )
    surfaces, tracer, centre = build_surfaces(scene)
    floor = np.flatnonzero(np.all(surfaces.corners.of()[:, :, 2] < -0.49, axis=1))[0]
    inside = int(unit_normal(surfaces, 2 * floor)[2] < 0)
    point = np.array([(0.5, 0.5, 0.0), (0.5, 0.5, 1.0)]) - centre
    normal, side_id = np.array([(0, 0, 1.0), (0, 0, 1.0)]), np.full(2, 2 * floor + inside, np.int32)
    total = 20_000
    visible = VisiblePoints(point, normal, side_id, np.array([1.0, 1.0]))
    found, at = ray_ends(tracer, surfaces, visible, np.uint64(3), total)
    assert len(found) == len(at) == total
    share = np.mean(found[:, 2] > 0.49)
    x = 0.5
    root = math.sqrt(1 + x * x)
    expected = 4 * (x / root * math.atan(x / root) * 2) / (2 * math.pi)
    assert abs(share - expected) < 4 * math.sqrt(expected * (1 - expected) / total)
    assert ray_ends(tracer, surfaces, visible._replace(point=point[:0]), np.uint64(3), 100)[0].shape == (0, 3)
