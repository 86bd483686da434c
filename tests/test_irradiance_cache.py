# SPDX-License-Identifier: GPL-3.0-or-later
"""The irradiance cache: the nearest point on a sheet answers, and the answer is right in the mean."""

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
    VisiblePoints,
    build_irradiance_cache,
    cache_points,
    ray_ends,
    recalled,
)
from addon.solver.photons.photon_map import query_at
from addon.solver.planning.sheets import dark_sheets
from addon.solver.planning.splitting import Splitting
from addon.solver.planning.survey import Cells
from tests.helpers.photon_maps import photon_map, side_under, square
from tests.helpers.scenes import box, join, look, make_scene

EDGES = np.array([8.0, 12.0])

NO_RAYS = Splitting(
    dark_sheets(1), Cells(np.zeros(0, np.int64), *np.zeros((5, 0)), np.zeros(0, np.int64), np.zeros(0)),
    np.zeros(0, np.int32), np.zeros(0), math.inf,
)  # fmt: skip


def choices(neighbours, reach2, shrink2):
    """Of the solver's own types: kernels are kept for them, and others that load the kernels must know them."""
    return Estimate(neighbours, reach2, shrink2, True, False, NO_RAYS)


@njit
def recall_all(cache, surfaces, side_id, points, reach2):
    walk = empty_walk()
    index = np.empty(len(points), np.int64)
    for i in range(len(points)):
        x, y, z = points[i]
        index[i] = recalled(cache, query_at(surfaces, side_id, (x, y, z)), reach2, walk)
    return index


def free(reach2):
    return lambda point, side_id, first: unlimited(len(side_id), reach2)


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
        cache = build_irradiance_cache(built.photons, surfaces, estimate, known, free(estimate.reach2))
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
    cache = build_irradiance_cache(built.photons, surfaces, choices(20, 0.01, 1.0), (point, side_id), free(0.01))
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
    floor = np.flatnonzero(np.all(surfaces.corners[:, :, 2] < -0.49, axis=1))[0]
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
