# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of emission and reflectance: against Planck's law, and against each other (Kirchhoff)."""

import math

import numpy as np
import pytest
from numba import njit

from addon.solver import Material
from addon.solver.physics.lobes import interpolate_albedo, sample_ggx
from addon.solver.physics.radiometry import build_radiometry, emission_range, excess, typical_emissivity
from addon.solver.physics.spectrum import C2, band_emissivity, band_radiance

EDGES = np.array([7.5, 8.0, 9.5, 9.6, 14.0])
CURVE = np.array([[8.2, 0.9], [8.8, 0.2], [9.4, 0.7], [12.0, 0.05]])
MATERIALS = (
    Material("black", 1.0),
    Material("grey", 0.6),
    Material("spectral", CURVE),
    Material("mirror", 0.1, specular=1.0),
    Material("rough", CURVE, specular=0.7, roughness=0.6),
    Material("white", 0.0),
)
RANGE = (200.0, 420.0)


def tables(edges=EDGES, temperatures=RANGE, weighting=300.0, reference=0.0):
    return build_radiometry(MATERIALS, edges, temperatures, weighting, reference)


def excess_of(radiometry, material, temperature, cosine=1.0):
    out = np.full(radiometry.reference.size, np.nan)
    excess(radiometry, material, float(temperature), cosine, out)
    return out


def emitted(material, temperature, edges=EDGES):
    """Radiance that a surface emits in each band, by quadrature and not from tables."""
    return band_radiance(edges, temperature, MATERIALS[material].curve)


def reflectance(material, weighting=300.0, edges=EDGES, reference=0.0):
    lit = emitted(material, weighting, edges) - emitted(material, reference, edges)
    return 1 - lit / (band_radiance(edges, weighting) - band_radiance(edges, reference))


diffuse = pytest.mark.parametrize("material", [0, 1, 2, 3, 5], ids=lambda i: MATERIALS[i].name)


# Tables


def test_reflectance_is_one_minus_emissivity():
    """Kirchhoff, averaged over a band with the excess of the blackbody that the surface receives; float32."""
    radiometry, subtracting = tables(), tables(reference=340.0)
    for material in range(len(MATERIALS)):
        np.testing.assert_allclose(radiometry.reflectance[material], reflectance(material), atol=6e-8)
        np.testing.assert_allclose(subtracting.reflectance[material], reflectance(material, reference=340.0), atol=6e-8)
    assert radiometry.lobes.specular.tolist() == pytest.approx([0, 0, 0, 1, 0.7, 0])
    assert radiometry.lobes.alpha.tolist() == pytest.approx([0, 0, 0, 0, 0.36, 0])
    assert np.all(radiometry.lobes.albedo[[0, 1, 2, 3, 5]] == 1)


def test_band_emissivity_where_the_band_holds_no_radiance():
    """At 3 K a band near 8 um holds e^-600 of the radiance: its long-wave end alone counts then."""
    edges, curve = np.array([7.9, 8.1]), (np.array([7.9, 8.1]), np.array([0.2, 0.8]))
    cold = band_emissivity(edges, 3.0, curve)
    assert 0.7 < cold[0] < 0.8
    assert band_emissivity(edges, 0.0, curve) == cold
    assert band_emissivity(edges, 5000.0, curve)[0] == pytest.approx(0.5, abs=0.01)


@diffuse
def test_emission_table_interpolates_plancks_law(material):
    radiometry = tables()
    temperatures = np.concatenate((np.linspace(*RANGE, 1003), np.float32(np.linspace(*RANGE, 7))))
    table = np.array([excess_of(radiometry, material, t) for t in temperatures])
    # cubic Hermite in ln T with step 0.004 errs by (0.004 x)^4 / 384, 4e-9 at x = c2 / (lambda T) = 9.6
    np.testing.assert_allclose(table, emitted(material, temperatures), rtol=1e-7)


@pytest.mark.parametrize("low, high, wavelength", [(0.5, 5.0, 800.0), (40.0, 400.0, 18.0), (400.0, 6000.0, 2.0)])
def test_emission_table_over_wide_ranges(low, high, wavelength):
    """Down to x = c2 / (lambda T) = 40, where the table's error is largest."""
    edges = np.array([1.0, 1.1]) * wavelength
    radiometry = tables(edges, (low, high))
    temperature = np.geomspace(max(low, C2 / (40 * wavelength)), high, 503)
    table = np.array([excess_of(radiometry, 0, t) for t in temperature])
    x = C2 / (wavelength * temperature)
    error = np.maximum((0.004 * x) ** 4 / 384, 1e-12)
    assert np.all(np.abs(table / band_radiance(edges, temperature) - 1).max(axis=1) < 1.5 * error + 1e-11)


# Excess over the reference


@diffuse
@pytest.mark.parametrize("reference, weighting", [(290.0, 290.0), (310.0, 300.0), (500.0, 300.0)])
def test_excess_is_emission_less_that_of_the_reference(material, reference, weighting):
    radiometry = tables(weighting=weighting, reference=reference)
    for temperature in (200.0, 289.0, 291.0, 333.25, 420.0):
        expected = emitted(material, temperature) - emitted(material, reference)
        scale = band_radiance(EDGES, max(temperature, reference))
        # 1e-7 of either term: the reference is float32
        assert np.all(np.abs(excess_of(radiometry, material, temperature) - expected) <= 1.2e-7 * scale)


@pytest.mark.parametrize("material", range(len(MATERIALS)), ids=lambda i: MATERIALS[i].name)
@pytest.mark.parametrize("weighting", [293.15, 330.0])
def test_at_the_reference_nothing_is_in_excess(material, weighting):
    """Exactly, to spare photons, whatever the reflectance is weighted with."""
    radiometry = tables(weighting=weighting, reference=293.15)
    for cosine in (1.0, 0.3, 0.01):
        assert np.all(excess_of(radiometry, material, 293.15, cosine) == 0)
        assert (material == 5) == np.all(excess_of(radiometry, material, np.float32(293.2), cosine) == 0)


@diffuse
@pytest.mark.parametrize("reference, temperature", [(0.0, 300.0), (290.0, 340.0), (333.0, 250.0)])
def test_an_enclosure_at_one_temperature_is_black_in_excess_of_any_reference(material, reference, temperature):
    """What is emitted and what is reflected of black walls: dE + rho (B(T) - B(T0)) = B(T) - B(T0) in every band."""
    radiometry = tables(weighting=temperature, reference=reference)
    arriving = band_radiance(EDGES, temperature) - band_radiance(EDGES, reference)
    leaving = excess_of(radiometry, material, temperature) + radiometry.reflectance[material] * arriving
    scale = band_radiance(EDGES, max(temperature, reference))
    assert np.all(np.abs(leaving - arriving) <= 1.2e-7 * scale)  # reflectance and reference are float32


@diffuse
def test_reflectance_at_one_temperature_is_weighted_with_plancks_derivative(material):
    """In a scene of nearly one temperature what arrives is dB/dT; 0.1 % of that temperature is the difference used."""
    radiometry = tables(weighting=300.0, reference=300.0)
    body = band_radiance(EDGES, 300.0, MATERIALS[material].curve, derivative=True)
    expected = 1 - body / band_radiance(EDGES, 300.0, derivative=True)
    # the weights change by about x 0.001 / 2 between both temperatures, x = c2 / (lambda T) < 6.4
    np.testing.assert_allclose(radiometry.reflectance[material], expected, rtol=0, atol=6.4 * 0.001 / 2)


@diffuse
def test_at_zero_kelvin_only_the_reference_is_missing(material):
    radiometry = tables(temperatures=(0.42, 420.0), reference=300.0)
    black = band_radiance(EDGES, 300.0)
    expected = -emitted(material, 300.0) / black  # the reference is float32
    np.testing.assert_allclose(excess_of(radiometry, material, 0.0) / black, expected, rtol=0, atol=6e-8)
    assert np.all(excess_of(tables(temperatures=(0.42, 420.0)), material, 0.0) == 0)


def test_below_the_table_counts_as_zero_kelvin():
    radiometry = tables(temperatures=(0.42, 420.0), reference=300.0)
    for temperature in (1e-30, 0.1, 0.4):
        assert np.array_equal(excess_of(radiometry, 1, temperature), excess_of(radiometry, 1, 0.0))


def test_a_scene_at_zero_kelvin():
    radiometry = tables(temperatures=(0.0, 0.0))
    assert np.all(excess_of(radiometry, 2, 0.0) == 0)


# The specular lobe


@njit
def reflected(alpha, cosine, nodes):
    """Share of the light from a direction that the lobe reflects: mean weight of its samples, dense at the horizon."""
    sine = math.sqrt(1.0 - cosine * cosine)
    total = 0.0
    for i in range(nodes):
        g = 1.0 - (i + 0.5) / nodes
        for j in range(nodes):
            total += 2.0 * g * sample_ggx((sine, 0.0, cosine), alpha, 1.0 - g * g, (j + 0.5) / nodes)[1]
    return total / (nodes * nodes)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2, 0.05])
def test_what_a_lobe_does_not_reflect_it_emits(cosine):
    """Directional Kirchhoff: emissivity towards a direction and reflectance from there make 1, in every band."""
    radiometry = tables(weighting=300.0)
    rho, share = reflectance(4), float(radiometry.lobes.specular[4])
    emissivity = excess_of(radiometry, 4, 300.0, cosine) / band_radiance(EDGES, 300.0)
    albedo = rho * ((1 - share) + share * reflected(0.36, cosine, 400))
    np.testing.assert_allclose(emissivity + albedo, 1, rtol=0, atol=3e-4)  # quadrature of the albedo's table


def test_excess_of_a_rough_lobe():
    """eps(theta) = eps + rho specular (1 - albedo(theta)), with its own spectrum at each temperature."""
    reference, temperature, cosine = 310.0, 350.0, 0.3
    radiometry = tables(weighting=300.0, reference=reference)
    lost = float(radiometry.lobes.specular[4]) * (1 - interpolate_albedo(radiometry.lobes.albedo, 4, cosine))
    assert 0.05 < lost < 0.3
    body = emitted(4, temperature) - emitted(4, reference)
    black = band_radiance(EDGES, temperature) - band_radiance(EDGES, reference)
    expected = body + lost * (black - body)
    np.testing.assert_allclose(excess_of(radiometry, 4, temperature, cosine), expected, rtol=1e-6)


# Range of the table


@pytest.mark.parametrize(
    "temperature, expected",
    [
        ([[300.0], [300.0]], (300.0, 300.0)),
        ([[250.0], [330.0]], (250.0, 330.0)),
        ([[0.0], [250.0], [330.0]], (250.0, 330.0)),
        ([[0.3], [250.0], [330.0]], (250.0, 330.0)),  # below 1 K counts as 0 K beside warmer surfaces
        ([[1.5], [1e6]], (1.5, 1e6)),
        ([[0.4], [0.5]], (0.4, 0.5)),
        ([[0.0], [0.5]], (0.5, 0.5)),
        ([[0.0], [0.0]], (0.0, 0.0)),
        ([[250.0, 260.0, 330.0]], (250.0, 330.0)),
        ([[0.0, 260.0, 330.0]], (1.0, 330.0)),  # everything between occurs on the triangle
        ([[0.0, 0.0, 0.0]], (0.0, 0.0)),
    ],
)
def test_emission_range(temperature, expected):
    assert emission_range(np.array(temperature, np.float32)) == pytest.approx(expected)


@pytest.mark.parametrize("coldest", [2.0, 293.15, 1e6])
def test_rounding_below_the_coldest_surface_keeps_its_emission(coldest):
    """Float32 interpolation over a triangle ends up to 1e-6 below the coldest corner; that is not 0 K."""
    edges = np.array([8.0, 1000.0])
    radiometry = build_radiometry((Material("black", 1.0),), edges, (coldest, coldest), coldest, 0.0)
    value = np.empty(1)
    below = coldest * (1 - 1e-6)
    excess(radiometry, 0, below, 1.0, value)
    np.testing.assert_allclose(value, band_radiance(edges, below), rtol=1e-7)


@pytest.mark.parametrize(("low", "high", "bands"), [(7.5, 14.0, 3), (7.5, 14.0, 6), (0.9, 1.7, 4)])
def test_a_curve_of_1_is_no_more_than_1(low, high, bands):
    """The quadrature of its bands may round to 1 + 4e-16, and what then is reflected would be less than nothing."""
    materials = (Material("black", np.array([[8.0, 1.0]])),)
    emissivity = typical_emissivity(materials, np.linspace(low, high, bands + 1), np.array([300.0]))
    assert emissivity.max() <= 1.0 and emissivity == pytest.approx(1.0, rel=1e-15)
