# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions, lobes and random numbers against their densities.

Chi-square tests use fixed seeds, so they always give the same verdict; they reject at P_VALUE, which a correct sampler
falls below for one seed in ten thousand.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.stats import chi2, chisquare

from addon.solver import Material, sampling
from addon.solver.physics.radiometry import build_radiometry
from addon.solver.sampling import rng
from addon.solver.sampling.rng import PATH_PIXELS, PILOT, pass_key, strata

P_VALUE = 1e-4
SAMPLES = 200_000
ALPHAS = [0.02, 0.1, 0.4, 1.0]
COSINES = [1.0, 0.9, 0.5, 0.1]

cosines = st.floats(0.02, 1.0)
azimuths = st.floats(0.0, 2.0 * math.pi)
alphas = st.floats(0.01, 1.0)


def uniforms(count=SAMPLES, seed=1):
    return np.random.default_rng(seed).random((count, 2))


def incoming(cosine):
    """Local direction at this cosine, not along an axis of the frame."""
    sine = math.sqrt(1.0 - cosine**2)
    return sine * math.cos(0.7), sine * math.sin(0.7), cosine


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
        result[i] = sampling.turn(u[i])
    return result


@njit
def cosine_directions(random):
    result = np.empty((len(random), 3))
    for i in range(len(random)):
        result[i] = sampling.cosine_direction(random[i, 0], random[i, 1])
    return result


@njit
def cone_directions(random, cos_min):
    result = np.empty((len(random), 3))
    for i in range(len(random)):
        result[i] = sampling.cone_direction(random[i, 0], random[i, 1], cos_min)
    return result


@njit
def triangle_points(random):
    result = np.empty((len(random), 2))
    for i in range(len(random)):
        result[i] = sampling.triangle_point(random[i, 0], random[i, 1])
    return result


@njit
def lobe_samples(x, y, z, alpha, random):
    result = np.empty((len(random), 4))
    for i in range(len(random)):
        result[i] = sampling.sample_lobe(x, y, z, alpha, random[i, 0], random[i, 1])
    return result


@njit
def lobe_values(x, y, z, directions, alpha):
    result = np.empty(len(directions))
    for i in range(len(directions)):
        ox, oy, oz = directions[i]
        result[i] = sampling.lobe_brdf(x, y, z, ox, oy, oz, alpha)
    return result


@njit
def interpolated_albedo(table, cosine):
    result = np.empty(cosine.size)
    for i in range(cosine.size):
        result[i] = sampling.interpolate_albedo(table, 0, cosine[i])
    return result


@njit
def frames(normals):
    result = np.empty((len(normals), 6))
    for i in range(len(normals)):
        result[i] = sampling.basis(normals[i, 0], normals[i, 1], normals[i, 2])
    return result


@njit
def random_numbers(key, paths, dimensions):
    result = np.empty((paths, dimensions))
    for i in range(paths):
        path = rng.path_key(key, i)
        for j in range(dimensions):
            result[i, j] = rng.uniform(path, j)
    return result


# Textbook forms of the GGX lobe, to compare with (Walter et al. 2007, Heitz 2014)


def ggx_density(alpha, z):
    """D of microfacet normals with cosine z, sr^-1 (Walter eq. 33)."""
    tan2 = (1 - z**2) / z**2
    return alpha**2 / (np.pi * z**4 * (alpha**2 + tan2) ** 2)


def ggx_masking(alpha, z):
    """Smith's G1 (Walter eq. 34)."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - z**2) / z**2))


def lobe_density(incident, directions, alpha):
    """Density, sr^-1, of reflection at the visible microfacet normals: G1 D / (4 cos) (Heitz 2018, eq. 17 and 19)."""
    half = incident + directions
    z = half[:, 2] / np.linalg.norm(half, axis=1)
    return ggx_masking(alpha, incident[2]) * ggx_density(alpha, z) / (4 * incident[2])


def gauss_cells(shape, nodes):
    """Directions and solid-angle weights of Gauss-Legendre nodes in every cell of `histogram`, cells first."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1), 0.5 * w
    z = ((np.arange(shape[0])[:, None] + x) / shape[0])[:, None, :, None]
    azimuth = (2 * np.pi * (np.arange(shape[1])[:, None] + x) / shape[1])[None, :, None, :]
    z, azimuth = np.broadcast_arrays(z, azimuth)
    sine = np.sqrt(1 - z**2)
    directions = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), z), axis=-1)
    weights = np.outer(w, w) * 2 * np.pi / (shape[0] * shape[1])
    return directions.reshape(-1, 3), weights


def grid(nodes):
    """Numbers (nodes^2, 2) in the unit square and weights of mean 1: a midpoint rule, dense near 1 on the first axis.

    There lie the grazing facets, where a lobe's integrand falls off within alpha^2 of the border.
    """
    s = (np.arange(nodes) + 0.5) / nodes
    numbers = np.stack(np.meshgrid(1 - (1 - s) ** 2, s, indexing="ij"), axis=-1).reshape(-1, 2)
    return numbers, np.repeat(2 * (1 - s), nodes)


GRID = 700  # quadrature error below 1e-5 of the mean weight, 2e-5 of the reflected share, at the angles here


def mean_weight(cosine, alpha):
    numbers, weights = grid(GRID)
    return np.mean(lobe_samples(*incoming(cosine), alpha, numbers)[:, 3] * weights)


def reflected_share(cosine, alpha):
    """Integral of lobe_brdf cos over the hemisphere, over microfacet normals of density D cos, where it is smooth."""
    numbers, weights = grid(GRID)
    tan2 = alpha**2 * numbers[:, 0] / (1 - numbers[:, 0])
    z, azimuth = 1 / np.sqrt(1 + tan2), 2 * np.pi * numbers[:, 1]
    sine = np.sqrt(1 - z**2)
    half = np.column_stack((sine * np.cos(azimuth), sine * np.sin(azimuth), z))
    incident = np.array(incoming(cosine))
    along = half @ incident
    directions = 2 * along[:, None] * half - incident
    directions[along <= 0, 2] = -1  # facets that face away
    brdf = lobe_values(*incident, directions, alpha)
    jacobian = 4 * along / (ggx_density(alpha, z) * z)
    return np.mean(brdf * np.maximum(directions[:, 2], 0) * jacobian * weights)


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
    frame = frames(normals)
    matrix = np.stack((frame[:, :3], frame[:, 3:], normals), axis=1)
    # float64: a few units in the last place
    np.testing.assert_allclose(matrix @ matrix.transpose(0, 2, 1), np.broadcast_to(np.eye(3), matrix.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(matrix), 1, rtol=1e-14)


def test_to_world_turns_up_into_the_normal():
    normal = np.array([0.48, -0.6, -0.64])
    np.testing.assert_allclose(sampling.to_world(0.0, 0.0, 1.0, *normal), normal)
    assert np.dot(sampling.to_world(0.8, 0.0, 0.6, *normal), normal) == pytest.approx(0.6)


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


# The specular lobe


@pytest.mark.parametrize("alpha", ALPHAS[1:])
@pytest.mark.parametrize("cosine", COSINES)
def test_sample_lobe_has_the_density_of_visible_normals(cosine, alpha):
    incident = np.array(incoming(cosine))
    sample = lobe_samples(*incident, alpha, uniforms())
    # Nearer to 1 than the function resolves where a facet turns the direction by little
    np.testing.assert_allclose(np.linalg.norm(sample[:, :3], axis=1), 1, atol=1e-9)
    assert np.array_equal(sample[:, 3] == 0, sample[:, 2] <= 1e-9)
    shape, nodes = (24, 24), 24
    directions, weights = gauss_cells(shape, nodes)
    share = lobe_density(incident, directions, alpha).reshape(*shape, nodes, nodes)
    share = (share * weights).sum(axis=(2, 3))
    above = sample[:, 2] > 0
    counts = np.append(histogram(sample[above, :3], shape), np.count_nonzero(~above))
    check_counts(counts, np.append(share, max(0.0, 1 - share.sum())) * SAMPLES)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_weight_is_brdf_times_cosine_over_density(cosine, alpha):
    incident = np.array(incoming(cosine))
    sample = lobe_samples(*incident, alpha, uniforms(1000))
    sample = sample[sample[:, 2] > 1e-3]
    brdf = lobe_values(*incident, np.ascontiguousarray(sample[:, :3]), alpha)
    expected = brdf * sample[:, 2] / lobe_density(incident, sample[:, :3], alpha)
    # 1 - cos^2 of the facet is known to 1e-16, and D divides by alpha^2 plus that
    np.testing.assert_allclose(sample[:, 3], expected, rtol=1e-14 / alpha**2 + 1e-12)
    assert sample[:, 3].max() <= 1


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_mean_weight_is_the_reflected_share(cosine, alpha):
    mean = mean_weight(cosine, alpha)
    assert mean == pytest.approx(reflected_share(cosine, alpha), abs=5e-5)  # error of both quadratures
    assert mean <= 1


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_reflected_share_in_solid_angle(alpha):
    """The same integral without any knowledge of the lobe, for lobes wide enough."""
    directions, weights = gauss_cells((40, 40), 12)
    brdf = lobe_values(*incoming(0.6), directions, alpha)
    integral = np.sum((brdf * directions[:, 2]).reshape(-1, *weights.shape) * weights)
    assert integral == pytest.approx(reflected_share(0.6, alpha), abs=1e-4)


@settings(deadline=None)  # the first call compiles
@given(cosines, azimuths, cosines, azimuths, alphas)
def test_lobe_is_reciprocal(z1, a1, z2, a2, alpha):
    s1, s2 = math.sqrt(1 - z1**2), math.sqrt(1 - z2**2)
    first = s1 * math.cos(a1), s1 * math.sin(a1), z1
    second = s2 * math.cos(a2), s2 * math.sin(a2), z2
    forth, back = sampling.lobe_brdf(*first, *second, alpha), sampling.lobe_brdf(*second, *first, alpha)
    assert forth == pytest.approx(back, rel=1e-13)  # rounding of a sum in another order
    assert forth >= 0


def test_lobe_ends_at_the_horizon():
    assert sampling.lobe_brdf(0.6, 0.0, 0.8, 1.0, 0.0, 0.0, 0.3) == 0
    assert sampling.lobe_brdf(0.6, 0.0, 0.8, 0.6, 0.0, -0.8, 0.3) == 0
    assert sampling.lobe_brdf(1.0, 0.0, 0.0, 0.6, 0.0, 0.8, 0.3) == 0


@pytest.mark.parametrize("alpha", [0.02, 0.05, 0.1, 0.4, 1.0])
def test_lobe_albedo_table(alpha):
    """The solver's table at its nodes and between them, against fine quadrature.

    What the table errs is energy made or lost at every bounce, so it has to be small beside 1 - rho of a shiny metal.
    The tolerance is that of linear interpolation between 64 nodes.
    """
    material = Material(specular=1.0, roughness=math.sqrt(alpha))
    table = build_radiometry((material,), np.array([8.0, 12.0]), (300.0, 300.0), 300.0, 0.0).albedo
    assert np.all((table > 0) & (table <= 1))
    node = (np.arange(sampling.ALBEDO_NODES) / (sampling.ALBEDO_NODES - 1)) ** 2
    np.testing.assert_allclose(interpolated_albedo(table, node), table[0], atol=1e-12)
    cosine = np.concatenate((node[7::14], [0.03, 0.2, 0.55, 0.93, 1.0]))
    fine = [mean_weight(z, alpha) for z in cosine]
    np.testing.assert_allclose(interpolated_albedo(table, cosine), fine, rtol=0, atol=6e-4)


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
