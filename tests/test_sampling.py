# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions and random numbers against their densities.

Chi-square tests use fixed seeds, so they always give the same verdict; they reject at P_VALUE, which a correct sampler
falls below for one seed in ten thousand.
"""

import numpy as np
import pytest
from numba import njit
from scipy.stats import chi2, chisquare

from addon.solver.sampling import rng, warps
from addon.solver.sampling.rng import PATH_PIXELS, PILOT, pass_key, strata

P_VALUE = 1e-4
SAMPLES = 200_000


def uniforms(count=SAMPLES, seed=1):
    return np.random.default_rng(seed).random((count, 2))


def check_counts(counts, expected):
    """Pearson's chi-square test; cells that expect fewer than 5 are pooled, as the test's asymptotics demand."""
    few = expected < 5
    counts = np.append(counts[~few], counts[few].sum())
    expected = np.append(expected[~few], expected[few].sum())
    used = expected > 0
    assert np.all(counts[~used] == 0)
    counts, expected = counts[used], expected[used]
    statistic = np.sum((counts - expected) ** 2 / expected)
    assert chi2.sf(statistic, len(counts) - 1) > P_VALUE


def histogram(direction, shape):
    """Counts of directions in cells of equal width in cosine and azimuth."""
    azimuth = np.arctan2(direction[:, 1], direction[:, 0]) % (2 * np.pi)
    return np.histogram2d(direction[:, 2], azimuth, shape, [[0, 1], [0, 2 * np.pi]])[0]


# Kernels: the functions under test, called for many numbers


@njit
def turns(u):
    result = np.empty((u.size, 2))
    for i in range(u.size):
        result[i] = warps.turn(u[i])
    return result


@njit
def cosine_directions(random):
    result = np.empty((len(random), 3))
    for i in range(len(random)):
        result[i] = warps.cosine_direction(random[i, 0], random[i, 1])
    return result


@njit
def cone_directions(random, cos_min):
    result = np.empty((len(random), 3))
    for i in range(len(random)):
        result[i] = warps.cone_direction(random[i, 0], random[i, 1], cos_min)
    return result


@njit
def triangle_points(random):
    result = np.empty((len(random), 2))
    for i in range(len(random)):
        result[i] = warps.triangle_point(random[i, 0], random[i, 1])
    return result


@njit
def frames(normals):
    result = np.empty((len(normals), 2, 3))
    for i in range(len(normals)):
        result[i, 0], result[i, 1] = warps.basis((normals[i, 0], normals[i, 1], normals[i, 2]))
    return result


@njit
def random_numbers(key, paths, dimensions):
    result = np.empty((paths, dimensions))
    for i in range(paths):
        path = rng.path_key(key, i)
        for j in range(dimensions):
            result[i, j] = rng.uniform(path, j)
    return result


# Directions


def test_turn_is_accurate():
    u = np.concatenate((np.linspace(0, 1, 100_001)[:-1], np.arange(4) / 4, np.nextafter([0.25, 0.5, 0.75, 1.0], 0)))
    exact = np.column_stack((np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)))
    # 1e-11 is what turn promises (and about the first term that its series leave out)
    np.testing.assert_allclose(turns(u), exact, rtol=0, atol=1e-11)


def test_basis_completes_the_normal():
    normals = np.random.default_rng(2).normal(size=(10_000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[:6] = np.concatenate((np.eye(3), -np.eye(3)))
    normals[6:8] = (0, 1, -0.0), (1e-9, 0, -1)
    matrix = np.concatenate((frames(normals), normals[:, None]), axis=1)
    # float64: a few units in the last place
    np.testing.assert_allclose(matrix @ matrix.transpose(0, 2, 1), np.broadcast_to(np.eye(3), matrix.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(matrix), 1, rtol=1e-14)


def test_to_world_turns_up_into_the_normal():
    normal = (0.48, -0.6, -0.64)
    np.testing.assert_allclose(warps.to_world((0.0, 0.0, 1.0), normal), normal)
    world = warps.to_world((0.48, 0.64, 0.6), normal)
    assert np.dot(world, normal) == pytest.approx(0.6)
    np.testing.assert_allclose(warps.to_local(world, normal), (0.48, 0.64, 0.6))


def test_cosine_direction_has_its_density():
    shape = (20, 32)
    direction = cosine_directions(uniforms())
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-10)
    share = np.diff(np.linspace(0, 1, shape[0] + 1) ** 2)  # integral of cos / pi over a ring
    check_counts(histogram(direction, shape), np.repeat(share[:, None], shape[1], axis=1) * SAMPLES / shape[1])


def test_cone_direction_is_uniform_in_its_cone():
    cos_min = 0.7
    direction = cone_directions(uniforms(), cos_min)
    assert direction[:, 2].min() >= cos_min - 1e-15
    counts = histogram(np.column_stack((direction[:, :2], (direction[:, 2] - cos_min) / (1 - cos_min))), (16, 16))
    check_counts(counts, np.full(counts.shape, SAMPLES / counts.size))


def test_triangle_point_is_uniform():
    u, v = triangle_points(uniforms()).T
    assert u.min() >= 0 and v.min() >= 0 and (u + v).max() <= 1 + 1e-15
    n = 8  # each axis in n strips: n^2 congruent triangles
    i, j, upper = (u * n).astype(int), (v * n).astype(int), u * n % 1 + v * n % 1 > 1
    _, counts = np.unique(np.column_stack((i, j, upper)), axis=0, return_counts=True)
    assert len(counts) == n * n
    check_counts(counts, np.full(n * n, SAMPLES / n**2))


# Random numbers


def test_uniform_covers_the_unit_interval():
    numbers = random_numbers(rng.pass_key(3, 5, rng.PHOTONS), 1000, 200)
    assert numbers.min() >= 0 and numbers.max() < 1
    for axis in (0, 1):  # along the paths of one dimension, along the dimensions of one path
        first = np.moveaxis(numbers, axis, 0)[:, :50]
        assert chisquare(np.histogram(first, 100, (0, 1))[0]).pvalue > P_VALUE
    assert chisquare(np.histogram(numbers, 1000, (0, 1))[0]).pvalue > P_VALUE


def check_independent(a, b):
    """Pairs are uniform over the unit square."""
    counts = np.histogram2d(a.ravel(), b.ravel(), 40, [[0, 1], [0, 1]])[0]
    assert chisquare(counts.ravel()).pvalue > P_VALUE


def test_dimensions_paths_passes_and_streams_are_independent():
    numbers = random_numbers(rng.pass_key(3, 5, rng.PHOTONS), 5000, 20)
    for lag in (1, 2, 4, 8):
        check_independent(numbers[:, lag:], numbers[:, :-lag])
        check_independent(numbers[lag:], numbers[:-lag])
    for key in (
        rng.pass_key(4, 5, rng.PHOTONS),
        rng.pass_key(3, 6, rng.PHOTONS),
        rng.pass_key(5, 3, rng.PHOTONS),
        rng.pass_key(3, 5, rng.CAMERA),
    ):
        check_independent(numbers, random_numbers(key, 5000, 20))


def test_pass_keys_differ():
    keys = {
        int(rng.pass_key(seed, index, stream))
        for seed in (0, 1, 2, 2**31 - 1)
        for index in (*range(500), 2**32 - 1)
        for stream in (rng.PHOTONS, rng.CAMERA, rng.PILOT)
    }
    assert len(keys) == 4 * 501 * 3
    assert rng.pass_key(7, 8, rng.CAMERA) == rng.pass_key(7, 8, rng.CAMERA)


@pytest.mark.parametrize("width, height", [(640, 512), (1024, 1024), (4096, 4096), (1, 5000), (24, 18)])
def test_strata_have_no_period(width, height):
    """Pixels that are looked at before the first pass lie in all columns, whatever divides the width: 4096 numbers at
    random meet all but exp(-4096 / width) of them. As many lie in each part of the picture."""
    numbers = strata(pass_key(0, PATH_PIXELS, PILOT), 4096, width * height)
    assert numbers[0] >= 0 and numbers[-1] < width * height and np.all(np.diff(numbers) >= 0)
    part = np.bincount(numbers * 8 // (width * height))
    assert len(part) == 8 and np.all(np.abs(part - 512) <= 1)
    columns = len(np.unique(numbers % width))
    assert columns > 0.95 * width * (1.0 - np.exp(-4096 / width))
