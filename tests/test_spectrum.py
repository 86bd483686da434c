# SPDX-License-Identifier: GPL-3.0-or-later
"""Planck integrals against an independent high-precision integral (mpmath), and their inverse."""

import mpmath
import numpy as np
import pytest

from addon.solver.physics.spectrum import C1, C2, apparent_temperature, band_names, band_radiance, planck
from addon.solver.scene import SceneError


def exact(low, high, temperature, eps=lambda wavelength: 1):
    """Band radiance by mpmath: tanh-sinh quadrature with 20 digits in ln(lambda), independent of ours in every step."""
    with mpmath.workdps(20):
        t = mpmath.mpf(temperature)
        h, c, k = mpmath.mpf("6.62607015e-34"), mpmath.mpf(299792458), mpmath.mpf("1.380649e-23")
        c1, c2 = 2 * h * c**2 * mpmath.mpf(10) ** 24, h * c / k * 10**6

        def integrand(u):
            wavelength = mpmath.exp(u)
            return eps(wavelength) * c1 / wavelength**4 / mpmath.expm1(c2 / (wavelength * t))

        a, b = mpmath.log(mpmath.mpf(low)), mpmath.log(mpmath.mpf(high))
        drop = c2 / t * (mpmath.exp(-a) - mpmath.exp(-b))  # e-folds over the band: at most two in one piece
        pieces = min(400, max(4, int(drop / 2)))
        nodes = [a + (b - a) * i / pieces for i in range(pieces + 1)]
        return mpmath.quad(integrand, nodes)


BANDS = [(10, 10 * (1 + 1e-6)), (3, 3 * (1 + 1e-6)), (7.5, 7.9), (3, 5), (8, 14), (0.1, 1000), (0.1, 1), (100, 1000)]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("low, high", BANDS)
@pytest.mark.parametrize("temperature", [1.0, 3.0, 77.0, 300.0, 1000.0, 5772.0, 1e5])
def test_band_radiance_to_ten_digits(low, high, temperature):
    reference = exact(low, high, temperature)
    value = band_radiance(np.array([low, high]), temperature)[0]
    if reference < mpmath.mpf("1e-300"):  # below normal float64: no digits to compare
        assert 0 <= value < 1e-299
    else:
        assert abs(value / reference - 1) < 1e-10


@pytest.mark.filterwarnings("error")
def test_zero_kelvin_is_exactly_zero():
    assert np.all(band_radiance(np.array([0.1, 5, 1000]), np.array([0.0, 0.0])) == 0)


def test_emissivity_is_inside_the_integral():
    curve = (np.array([8.0, 9.0, 11.0]), np.array([0.9, 0.2, 0.8]))
    value = band_radiance(np.array([7.5, 12.0]), 320.0, curve)[0]
    pieces = [(7.5, 8, lambda w: 0.9), (8, 9, lambda w: 0.9 - 0.7 * (w - 8)), (9, 11, lambda w: 0.2 + 0.3 * (w - 9))]
    pieces.append((11, 12, lambda w: 0.8))
    reference = sum(exact(low, high, 320.0, lambda w, eps=eps: mpmath.mpf(1) * eps(w)) for low, high, eps in pieces)
    assert abs(value / reference - 1) < 1e-10


def test_reference_values():
    """Digits of an independent table of the blackbody fraction F(0 - lambda T) and B(lambda, T)."""
    sigma = 5.670374419e-8
    fractions = {
        1000: 0.000321, 2000: 0.066730, 2897.772: 0.250055, 3000: 0.273229, 4000: 0.480865, 5000: 0.633726,
        6000: 0.737789, 8000: 0.856251, 10_000: 0.914157, 20_000: 0.985554, 50_000: 0.998904,
    }  # fmt: skip
    for product, fraction in fractions.items():
        value = np.pi * band_radiance(np.array([1e-3, product / 1000.0]), 1000.0)[0] / (sigma * 1000.0**4)
        assert value == pytest.approx(fraction, abs=5.1e-7)
    assert planck(10.0, 300.0) == pytest.approx(9.924033, rel=1e-7)
    assert planck(4.0, 300.0) == pytest.approx(0.7219764, rel=1e-7)
    assert planck(10.0, 1000.0) == pytest.approx(370.4026, rel=2e-7)
    assert pytest.approx(14387.768775, rel=1e-9) == C2
    assert pytest.approx(1.191042972e8, rel=1e-9) == C1


def test_derivative_matches_a_difference():
    edges, step = np.array([3.0, 5.0, 14.0]), 1e-5
    difference = (band_radiance(edges, 300 * np.exp(step)) - band_radiance(edges, 300 * np.exp(-step))) / (2 * step)
    # central difference: truncation (step^2 / 6) x^2 and rounding 1e-16 / step, both below 1e-8
    np.testing.assert_allclose(band_radiance(edges, 300.0, derivative=True), difference, rtol=1e-8)


@pytest.mark.parametrize("low, high", [(0.9, 1.7), (3, 5), (7.5, 14)])
def test_apparent_temperature_inverts_the_band(low, high):
    edges = np.array([low, 0.5 * (low + high), high])
    temperature = np.array([200.0, 293.15, 300.0, 1000.0, 2000.0, 5772.0])
    recovered = apparent_temperature(band_radiance(edges, temperature).sum(axis=1), edges)
    np.testing.assert_allclose(recovered, temperature, rtol=1e-9)


def test_apparent_temperature_of_no_radiance():
    assert np.all(apparent_temperature(np.array([0.0, -1.0]), np.array([8.0, 12.0])) == 0)


def test_band_names():
    assert band_names(np.array([7.5, 7.9, 8.3])) == ["7.50-7.90um", "7.90-8.30um"]
    assert len(set(band_names(np.array([10, 10 * (1 + 1e-6), 10 * (1 + 2e-6)])))) == 2
    with pytest.raises(SceneError, match="characters"):
        band_names(np.array([1.0, np.nextafter(1.0, 2.0)]) * 1e-30)
