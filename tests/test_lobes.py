# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes: each sampler against its density, each density against its textbook form, and what lobes reflect and emit.

Chi-square tests use fixed seeds, so they always give the same verdict; they reject at P_VALUE, which a correct sampler
falls below for one seed in ten thousand.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.stats import chi2

from addon.solver import Material
from addon.solver.geometry.interaction import Interaction
from addon.solver.physics.lobes import (
    ALBEDO_NODES,
    DIFFUSE,
    GLOSSY,
    SPECULAR,
    WIDE,
    Lobes,
    build_lobe_table,
    diffuse_share,
    emitted_complement,
    evaluate_ggx,
    evaluate_glossy,
    ggx_density,
    interpolate_albedo,
    is_glossy,
    is_specular,
    is_wide,
    lobes_of,
    sample_diffuse,
    sample_ggx,
    sample_specular,
)
from addon.solver.sampling.rng import PHOTONS, pass_key, path_key, uniform

P_VALUE = 1e-4
SAMPLES = 200_000
ALPHAS = [0.02, 0.1, 0.4, 1.0]
COSINES = [1.0, 0.9, 0.5, 0.1]
NORMAL = (0.48, -0.6, -0.64)
AZIMUTH = 0.7  # of what comes in, so that it is not along an axis of the frame
CELLS = 24  # of a histogram, in the cosine and in the azimuth
NODES = 24  # of the quadrature over a cell, on each axis: as many as narrow lobes at grazing angles need

cosines = st.floats(0.02, 1.0)
azimuths = st.floats(0.0, 2.0 * math.pi)
alphas = st.floats(0.01, 1.0)
numbers = st.floats(0.0, 1.0, exclude_max=True)


def direction_at(cosine, azimuth=AZIMUTH):
    """Local unit direction."""
    sine = math.sqrt(1.0 - cosine**2)
    return sine * math.cos(azimuth), sine * math.sin(azimuth), cosine


def interaction(incident, normal=NORMAL):
    """The Interaction of a ray that comes from a local direction of the frame that `frame` gives the normal."""
    incoming = -(np.array(incident) @ frame(normal))
    cosine = float(incident[2])
    return Interaction(0, 0, (0.0, 0.0, 0.0), normal, normal, 1.0, 0, 0.2, 0.3, tuple(incoming), cosine, cosine, 1.0)


def frame(normal):
    """(3, 3) rows of an orthonormal frame whose third is the normal, another than the solver's."""
    tangent = np.cross(normal, (0.36, 0.48, 0.8))
    tangent /= np.linalg.norm(tangent)
    return np.array([tangent, np.cross(normal, tangent), normal])


# Kernels: the functions under test, called for many numbers


@njit
def random_numbers(key, count):
    result = np.empty((count, 2))
    for i in range(count):
        path = path_key(key, i)
        result[i, 0], result[i, 1] = uniform(path, 0), uniform(path, 1)
    return result


@njit
def diffuse_samples(normal, random):
    result = np.empty((len(random), 3))
    for i in range(len(random)):
        result[i] = sample_diffuse(normal, random[i, 0], random[i, 1])
    return result


@njit
def ggx_samples(incident, alpha, random):
    """Local directions and their weights, (n, 4)."""
    result = np.empty((len(random), 4))
    for i in range(len(random)):
        (result[i, 0], result[i, 1], result[i, 2]), result[i, 3] = sample_ggx(
            incident, alpha, random[i, 0], random[i, 1]
        )
    return result


@njit
def specular_samples(lobes, at, random):
    """Directions and their weights, (n, 4)."""
    result = np.empty((len(random), 4))
    for i in range(len(random)):
        (result[i, 0], result[i, 1], result[i, 2]), result[i, 3] = sample_specular(
            lobes, at, random[i, 0], random[i, 1]
        )
    return result


@njit
def ggx_values(incident, directions, alpha):
    result = np.empty(len(directions))
    for i in range(len(directions)):
        x, y, z = directions[i]
        result[i] = evaluate_ggx(incident, (x, y, z), alpha)
    return result


@njit
def ggx_densities(incident, directions, alpha):
    result = np.empty(len(directions))
    for i in range(len(directions)):
        x, y, z = directions[i]
        result[i] = ggx_density(incident, (x, y, z), alpha)
    return result


@njit
def glossy_values(lobes, at, directions):
    result = np.empty(len(directions))
    for i in range(len(directions)):
        x, y, z = directions[i]
        result[i] = evaluate_glossy(lobes, at, (x, y, z))
    return result


@njit
def interpolated_albedo(table, cosine):
    result = np.empty(cosine.size)
    for i in range(cosine.size):
        result[i] = interpolate_albedo(table, 0, cosine[i])
    return result


def random(pass_index=0, count=SAMPLES):
    """Pairs of numbers as a path has them."""
    return random_numbers(pass_key(11, pass_index, PHOTONS), count)


# Chi-square tests


def polar(directions):
    """Cosines, and azimuths seen from the mirror's direction of AZIMUTH, -pi..pi."""
    azimuth = np.arctan2(directions[:, 1], directions[:, 0]) - AZIMUTH
    return directions[:, 2], azimuth % (2 * np.pi) - np.pi


def equal_parts(values):
    """Edges of CELLS intervals that hold about as many of some values each, all but one in a thousand on each side."""
    return np.quantile(values, np.linspace(0.001, 0.999, CELLS + 1))


def expected_shares(density, cosine_edges, azimuth_edges):
    """(CELLS, CELLS) integrals of a density (function of (n, 3) directions) over the solid angle of cells."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    x, w = 0.5 * (x + 1), 0.5 * w
    z = (cosine_edges[:-1, None] + np.diff(cosine_edges)[:, None] * x)[:, None, :, None]
    azimuth = (azimuth_edges[:-1, None] + np.diff(azimuth_edges)[:, None] * x)[None, :, None, :]
    z, azimuth = np.broadcast_arrays(z, azimuth + AZIMUTH + np.pi)
    sine = np.sqrt(1 - z**2)
    directions = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), z), axis=-1).reshape(-1, 3)
    mean = (density(directions).reshape(z.shape) * np.outer(w, w)).sum(axis=(2, 3))
    return mean * np.outer(np.diff(cosine_edges), np.diff(azimuth_edges))


def p_value(directions, density):
    """Of Pearson's chi-square test of directions (n, 3) against a density, sr^-1, in cells of solid angle.

    The cells divide what other samples, the first quarter, say is likely; all else, and what lies below the surface, is
    one more. Cells that expect fewer than 5 are pooled, as the test's asymptotics demand; at least 50 are left.
    """
    few, many = np.array_split(directions, [len(directions) // 4])
    cosine_edges, azimuth_edges = (equal_parts(values) for values in polar(few[few[:, 2] > 0]))
    share = expected_shares(density, cosine_edges, azimuth_edges)
    counts = np.histogram2d(*polar(many), [cosine_edges, azimuth_edges])[0]
    share = np.append(share, 1 - share.sum())
    counts, expected = np.append(counts, len(many) - counts.sum()), share * len(many)
    assert len(many) >= 100_000 and expected.min() > 0.0
    pooled = expected < 5
    counts = np.append(counts[~pooled], counts[pooled].sum())
    expected = np.append(expected[~pooled], expected[pooled].sum())
    if expected[-1] < 5:  # what is pooled is little, too
        counts, expected = (np.append(values[:-2], values[-2] + values[-1]) for values in (counts, expected))
    assert len(counts) >= 50 and expected.min() >= 5
    return chi2.sf(np.sum((counts - expected) ** 2 / expected), len(counts) - 1)


def cosine_density(directions):
    return np.maximum(directions[:, 2], 0.0) / np.pi


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), NORMAL, (0.0, 0.0, -1.0)])
def test_diffuse_directions_have_the_density_of_the_cosine(normal):
    directions = diffuse_samples(normal, random())
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-10)  # turn is exact to 1e-11
    assert p_value(directions @ frame(normal).T, cosine_density) > P_VALUE


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_ggx_directions_have_their_density(cosine, alpha):
    incident = direction_at(cosine)
    sample = ggx_samples(incident, alpha, random())
    # Nearer to 1 than the function resolves where a facet turns the direction by little
    np.testing.assert_allclose(np.linalg.norm(sample[:, :3], axis=1), 1, atol=1e-9)
    assert np.array_equal(sample[:, 3] == 0, sample[:, 2] <= 1e-9)
    assert p_value(sample[:, :3], lambda directions: ggx_densities(incident, directions, alpha)) > P_VALUE


def test_chi_square_rejects_wrong_densities():
    """The test of the tests: G2 in place of G1, which lacks but 1.5 % of the lobe here; a lobe wider by 5 %; and an
    even hemisphere in place of the cosine."""
    incident, alpha = direction_at(0.5), 0.1
    sample = ggx_samples(incident, alpha, random())[:, :3]
    assert 0.01 < np.mean(sample[:, 2] > 0) - mean_weight(0.5, alpha) < 0.02
    with_g2 = lambda directions: ggx_values(incident, directions, alpha) * directions[:, 2]  # noqa: E731
    assert p_value(sample, with_g2) < P_VALUE
    assert p_value(sample, lambda directions: ggx_densities(incident, directions, 1.05 * alpha)) < P_VALUE
    diffuse = diffuse_samples((0.0, 0.0, 1.0), random())
    assert p_value(diffuse, lambda directions: np.full(len(directions), 0.5 / np.pi)) < P_VALUE


# Textbook forms of the GGX lobe, to compare with (Walter et al. 2007, Heitz 2014)


def facet_density(alpha, z):
    """D of microfacet normals with cosine z, sr^-1 (Walter eq. 33)."""
    tan2 = (1 - z**2) / z**2
    return alpha**2 / (np.pi * z**4 * (alpha**2 + tan2) ** 2)


def masking(alpha, z):
    """Smith's G1 (Walter eq. 34)."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - z**2) / z**2))


def textbook_density(incident, directions, alpha):
    """Density, sr^-1, of reflection at the visible microfacet normals: G1 D / (4 cos) (Heitz 2018, eq. 17 and 19)."""
    half = incident + directions
    z = half[:, 2] / np.linalg.norm(half, axis=1)
    return masking(alpha, incident[2]) * facet_density(alpha, z) / (4 * incident[2])


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_density_and_weight_are_those_of_the_textbook(cosine, alpha):
    """The density, and the weight as brdf times cosine over it, at directions that the lobe draws."""
    incident = direction_at(cosine)
    sample = ggx_samples(incident, alpha, random(count=1000))
    sample = sample[sample[:, 2] > 1e-3]
    directions = np.ascontiguousarray(sample[:, :3])
    # 1 - cos^2 of the facet is known to 1e-16, and D divides by alpha^2 plus that
    rounding = 1e-14 / alpha**2 + 1e-12
    density = textbook_density(np.array(incident), directions, alpha)
    np.testing.assert_allclose(ggx_densities(incident, directions, alpha), density, rtol=rounding)
    brdf = ggx_values(incident, directions, alpha)
    np.testing.assert_allclose(sample[:, 3], brdf * sample[:, 2] / density, rtol=rounding)
    assert sample[:, 3].max() <= 1


@settings(deadline=None)  # the first call compiles
@given(cosines, azimuths, alphas, numbers, numbers)
def test_weight_is_brdf_times_cosine_over_density(cosine, azimuth, alpha, u, v):
    incident = direction_at(cosine, azimuth)
    direction, weight = sample_ggx(incident, alpha, u, v)
    assert 0 <= weight <= 1
    if direction[2] > 1e-3:
        reflected = evaluate_ggx(incident, direction, alpha) * direction[2]
        assert reflected == pytest.approx(weight * ggx_density(incident, direction, alpha), rel=1e-12)


@settings(deadline=None)
@given(cosines, azimuths, cosines, azimuths, alphas)
def test_lobe_is_reciprocal(z1, a1, z2, a2, alpha):
    first, second = direction_at(z1, a1), direction_at(z2, a2)
    forth, back = evaluate_ggx(first, second, alpha), evaluate_ggx(second, first, alpha)
    assert forth == pytest.approx(back, rel=1e-13)  # rounding of a sum in another order
    assert forth >= 0


def test_lobe_ends_at_the_horizon():
    for of in (evaluate_ggx, ggx_density):
        assert of((0.6, 0.0, 0.8), (1.0, 0.0, 0.0), 0.3) == 0
        assert of((0.6, 0.0, 0.8), (0.6, 0.0, -0.8), 0.3) == 0
        assert of((1.0, 0.0, 0.0), (0.6, 0.0, 0.8), 0.3) == 0


# Integrals over the hemisphere


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
    return np.mean(ggx_samples(direction_at(cosine), alpha, numbers)[:, 3] * weights)


def integral_over_facets(cosine, alpha, of):
    """Integral over the hemisphere of a function of directions, over microfacet normals of density D cos, where that of
    a lobe is smooth."""
    numbers, weights = grid(GRID)
    tan2 = alpha**2 * numbers[:, 0] / (1 - numbers[:, 0])
    z, azimuth = 1 / np.sqrt(1 + tan2), 2 * np.pi * numbers[:, 1]
    sine = np.sqrt(1 - z**2)
    half = np.column_stack((sine * np.cos(azimuth), sine * np.sin(azimuth), z))
    incident = np.array(direction_at(cosine))
    along = half @ incident
    directions = 2 * along[:, None] * half - incident
    directions[along <= 0, 2] = -1  # facets that face away
    jacobian = 4 * along / (facet_density(alpha, z) * z)
    return np.mean(of(directions) * jacobian * weights)


def reflected_share(cosine, alpha):
    incident = direction_at(cosine)
    return integral_over_facets(
        cosine, alpha, lambda directions: ggx_values(incident, directions, alpha) * np.maximum(directions[:, 2], 0)
    )


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_mean_weight_is_the_reflected_share(cosine, alpha):
    mean = mean_weight(cosine, alpha)
    assert mean == pytest.approx(reflected_share(cosine, alpha), abs=5e-5)  # error of both quadratures
    assert mean <= 1


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_density_leaves_out_what_is_drawn_below_the_surface(cosine, alpha):
    """It integrates to one minus the share of such samples, to 4 standard errors of that and the quadrature's error."""
    incident = direction_at(cosine)
    above = integral_over_facets(cosine, alpha, lambda directions: ggx_densities(incident, directions, alpha))
    drawn = np.mean(ggx_samples(incident, alpha, random(1))[:, 2] <= 1e-9)
    assert abs(above + drawn - 1) < 4 * math.sqrt(drawn * (1 - drawn) / SAMPLES) + 5e-5
    if alpha == 1.0 and cosine >= 0.5:
        assert drawn > 0.3  # so a density that integrates to one would be told


@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_reflected_share_in_solid_angle(alpha):
    """The same integral without any knowledge of the lobe, for lobes wide enough."""
    incident, edges = direction_at(0.6), np.linspace(0, 1, 61)
    share = expected_shares(
        lambda directions: ggx_values(incident, directions, alpha) * directions[:, 2], edges, (2 * edges - 1) * np.pi
    )
    assert share.sum() == pytest.approx(reflected_share(0.6, alpha), abs=1e-4)


# Lobes at an Interaction


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cosine", COSINES)
def test_glossy_lobe_at_a_tilted_surface(cosine, alpha):
    """As sample_ggx and evaluate_ggx in a local frame, another than the solver's: the lobe turns with what comes in."""
    incident = np.array(direction_at(cosine))
    at, lobes = interaction(incident), Lobes(GLOSSY, 1.0, alpha)
    few = random(2, 1000)
    sample = specular_samples(lobes, at, few)
    local = sample[:, :3] @ frame(NORMAL).T
    expected = ggx_samples(tuple(incident), alpha, few)
    along = slice(3) if cosine < 1.0 else slice(2, 3)  # no azimuth stands out of what comes in along the normal
    np.testing.assert_allclose(local[:, along], expected[:, along], atol=1e-9)
    np.testing.assert_allclose(sample[:, 3], expected[:, 3], rtol=1e-6, atol=1e-12)
    values = glossy_values(lobes, at, np.ascontiguousarray(sample[:, :3]))
    np.testing.assert_allclose(
        values, ggx_values(tuple(incident), np.ascontiguousarray(local), alpha), rtol=1e-13 / alpha**2 + 1e-11
    )
    if alpha >= 0.1:
        many = specular_samples(lobes, at, random(3))[:, :3] @ frame(NORMAL).T
        assert p_value(many, lambda directions: ggx_densities(tuple(incident), directions, alpha)) > P_VALUE


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), NORMAL])
@pytest.mark.parametrize("cosine", COSINES)
def test_mirrors_reflect_exactly(cosine, normal):
    """d - 2 (d n) n, of weight 1, whatever the numbers; and no given direction is met."""
    at, lobes = interaction(direction_at(cosine), normal), Lobes(SPECULAR, 1.0, 0.0)
    incoming, n = np.array(at.incoming), np.array(normal)
    for u, v in ((0.0, 0.0), (0.3, 0.9)):
        sample = sample_specular(lobes, at, u, v)
        np.testing.assert_allclose(sample.direction, incoming - 2 * (incoming @ n) * n, atol=1e-15)
        assert sample.weight == 1.0
        assert evaluate_glossy(lobes, at, sample.direction) == 0.0


# Materials

MATERIALS = {
    DIFFUSE: Material("diffuse", 0.3),
    SPECULAR: Material("mirror", 0.3, specular=1.0),
    GLOSSY | WIDE: Material("rough metal", 0.3, specular=1.0, roughness=0.6),
    DIFFUSE | SPECULAR: Material("varnish", 0.3, specular=0.25),
    DIFFUSE | GLOSSY | WIDE: Material("paint", 0.3, specular=0.25, roughness=0.6),
}


def test_materials_have_the_lobes_that_they_need():
    """Roughness counts where there is a specular lobe alone; one too sharp for GGX in float32 is a mirror."""
    further = (Material("dull", 0.3, roughness=0.6), Material("smooth", 0.3, specular=1.0, roughness=1e-9))
    further += (Material("satin", 0.3, specular=1.0, roughness=0.1),)
    table = build_lobe_table((*MATERIALS.values(), *further))
    flags = [*MATERIALS, DIFFUSE, SPECULAR, GLOSSY]
    assert table.flags.tolist() == flags
    assert table.specular.tolist() == [0, 1, 1, 0.25, 0.25, 0, 1, 1]
    assert table.alpha.tolist() == pytest.approx([0, 0, 0.36, 0, 0.36, 0, 0, 0.01])
    for i, kinds in enumerate(flags):
        lobes = lobes_of(table, i)
        assert lobes == Lobes(kinds, table.specular[i], table.alpha[i])
        assert diffuse_share(lobes) == 1 - table.specular[i] and (diffuse_share(lobes) > 0) == (kinds & DIFFUSE != 0)
        assert is_glossy(lobes) == (kinds & GLOSSY != 0) and is_wide(lobes) == (kinds & WIDE != 0)
        assert is_specular(lobes) == (kinds & (GLOSSY | SPECULAR) != 0)
    assert np.all(table.albedo[[0, 1, 3, 5, 6]] == 1)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2, 0.05])
@pytest.mark.parametrize("kinds", MATERIALS)
def test_what_lobes_do_not_reflect_is_emitted(kinds, cosine):
    """Shares of the reflectance: of the diffuse lobe, of the specular one as it is drawn, and the complement make 1.

    The tolerance is that of the albedo's table, see below.
    """
    table = build_lobe_table(tuple(MATERIALS.values()))
    i = list(MATERIALS).index(kinds)
    lobes, complement = lobes_of(table, i), emitted_complement(table, i, cosine)
    sampled = mean_weight(cosine, lobes.alpha) if is_glossy(lobes) else 1.0
    assert diffuse_share(lobes) + lobes.specular * sampled + complement == pytest.approx(1, abs=6e-4)
    assert complement >= 0 and (is_glossy(lobes) or complement == 0)
    if is_glossy(lobes) and cosine == 0.2:
        assert complement > 0.05 * lobes.specular


@pytest.mark.parametrize("alpha", [0.02, 0.05, 0.1, 0.4, 1.0])
def test_albedo_table(alpha):
    """The solver's table at its nodes and between them, against fine quadrature.

    What the table errs is energy made or lost at every bounce, so it has to be small beside 1 - rho of a shiny metal.
    The tolerance is that of linear interpolation between 64 nodes.
    """
    table = build_lobe_table((Material(specular=1.0, roughness=math.sqrt(alpha)),)).albedo
    assert np.all((table > 0) & (table <= 1))
    node = (np.arange(ALBEDO_NODES) / (ALBEDO_NODES - 1)) ** 2
    np.testing.assert_allclose(interpolated_albedo(table, node), table[0], atol=1e-12)
    cosine = np.concatenate((node[7::14], [0.03, 0.2, 0.55, 0.93, 1.0]))
    fine = [mean_weight(z, alpha) for z in cosine]
    np.testing.assert_allclose(interpolated_albedo(table, cosine), fine, rtol=0, atol=6e-4)
