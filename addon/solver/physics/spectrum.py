# SPDX-License-Identifier: GPL-3.0-or-later
"""Planck's law integrated over bands, with an emissivity inside the integral, and its inverse.

With x = c2 / (lambda T) the radiance of a blackbody between two wavelengths is
    L = C1 T^4 / C2^4  *  integral of x^3 / (e^x - 1) dx
(Modest, Radiative Heat Transfer, eq. 1.21-1.25). The integrand is analytic but for poles at multiples of 2 pi i, so
Gauss-Legendre panels of bounded width in x reach machine precision for every band and temperature.

The inner loops are in spectrum_kernels, which is loaded when a function here first needs it: Numba is large, and
Blender's panels need no more than the edges of the bands.
"""

from __future__ import annotations

from functools import cache, lru_cache
from types import ModuleType

import numpy as np

from ..scene import SceneError, check_band_edges
from .constants import C1, C2

LIBRARY_MISSING = "A library of the solver is missing: {}. Install the extension from its zip file again"

MAX_PASS_NAME = 63  # characters Blender keeps of a render pass name (4.5 and 5.2; a 64th is cut off)


def planck(wavelength: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """Spectral radiance B(lambda, T) of a blackbody, W m-2 sr-1 um-1; wavelength in um, temperature in K > 0."""
    x = C2 / (np.asarray(wavelength, np.float64) * temperature)
    return C1 / np.asarray(wavelength, np.float64) ** 5 * np.exp(-x) / -np.expm1(-x)


def faintest(wavelength: float) -> float:
    """Temperature (K) of a blackbody whose radiance at a wavelength (um) is still well inside float64: x = 300."""
    return C2 / (300.0 * wavelength)


@cache
def _kernels() -> ModuleType:
    """The module spectrum_kernels. Raises SceneError, with a message in plain words, if Numba is missing."""
    try:
        from . import spectrum_kernels
    except ImportError as error:
        raise SceneError(LIBRARY_MISSING.format(error)) from error
    return spectrum_kernels


def band_radiance(
    edges: np.ndarray,
    temperature: float | np.ndarray,
    curve: tuple[np.ndarray, np.ndarray] | None = None,
    derivative: bool = False,
) -> np.ndarray:
    """Radiance that a surface emits in each band: integral of eps(lambda) B(lambda, T), W m-2 sr-1.

    edges: (b + 1,) um, ascending. temperature: K >= 0, any shape s; 0 K gives exactly 0.
    curve: wavelengths (n,) um and emissivities (n,), linear between points and constant outside; None is a blackbody.
    derivative: return d/d(ln T) of it instead.
    Returns s + (b,) float64. Relative error below 1e-10 (see tests/test_spectrum.py).
    """
    edges = np.asarray(edges, dtype=np.float64)
    flat = np.atleast_1d(np.asarray(temperature, dtype=np.float64)).ravel()
    result = np.zeros((edges.size - 1, flat.size))
    warm = flat > 0
    if warm.any():
        kelvin, integrals = flat[warm], np.zeros((edges.size - 1, np.count_nonzero(warm)))
        wavelengths, values = (np.array([1.0]), np.array([1.0])) if curve is None else curve
        inner = wavelengths[(wavelengths > edges[0]) & (wavelengths < edges[-1])]
        points = np.union1d(edges, inner)
        emissivity = np.interp(points, wavelengths, values)
        band = np.searchsorted(edges, points[:-1], side="right") - 1
        _kernels().integrate(points, emissivity, band, kelvin, derivative, integrals)
        result[:, warm] = integrals
    return np.ascontiguousarray(result.T).reshape(np.shape(temperature) + (edges.size - 1,))


def band_emissivity(edges: np.ndarray, temperature: float, curve: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(b,) emissivity of each band, weighted with a blackbody's spectrum at temperature (K).

    A temperature so low that the band holds no radiance in float64 is raised to where x = c2 / (lambda T) is 300.
    """
    temperature = max(temperature, faintest(float(edges[0])))
    return band_radiance(edges, temperature, curve) / band_radiance(edges, temperature)


def sensor_radiance(
    edges: np.ndarray, weights: np.ndarray, temperature: float | np.ndarray, derivative: bool = False
) -> np.ndarray:
    """Signal of a sensor in front of a blackbody, W m-2 sr-1: the sum over bands of weight times radiance.

    edges: (b + 1,) um. weights: (b,) response in each band. temperature: K, any shape, which the result has.
    derivative: return d/d(ln T) of it instead.
    """
    return (band_radiance(edges, temperature, derivative=derivative) * weights).sum(axis=-1)


@lru_cache(maxsize=8)
def _calibration(edges: tuple[float, ...], weights: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """ln L, ln T and d ln T / d ln L over all temperatures whose sensor_radiance L is a normal float64."""
    log_t = np.arange(np.log(0.5), np.log(2e6), 0.002)
    temperature = np.exp(log_t)
    radiance = sensor_radiance(edges, weights, temperature)
    known = radiance > 1e-290
    slope = sensor_radiance(edges, weights, temperature[known], derivative=True) / radiance[known]
    return np.log(radiance[known]), log_t[known], 1.0 / slope


def apparent_temperature(radiance: np.ndarray, edges: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Temperature (K) of the blackbody with this sensor_radiance (W m-2 sr-1): the inverse of a sensor's calibration.

    Any shape; float64. weights: (b,) response in each band; None counts all alike.
    Radiance of 0 or below (a noisy pixel of a cold scene) has no temperature and gives 0 K.
    Cubic Hermite interpolation of ln T over ln L; error below 1e-9 relative.
    """
    radiance = np.ascontiguousarray(radiance, dtype=np.float64)
    edges = np.asarray(edges, dtype=np.float64)
    weights = np.ones(len(edges) - 1) if weights is None else np.asarray(weights, dtype=np.float64)
    change = np.flatnonzero(np.diff(weights)) + 1  # adjacent bands of the same weight count as one band
    calibration = _calibration(tuple(edges[[0, *change, -1]].tolist()), tuple(weights[[0, *change]].tolist()))
    result = np.empty_like(radiance)
    _kernels().invert(radiance.ravel(), *calibration, result.ravel())
    return result


def uniform_edges(low: float, high: float, count: int) -> np.ndarray:
    """(count + 1,) band edges of equal width from low to high, um."""
    edges = np.linspace(low, high, count + 1)
    check_band_edges(edges)
    return edges


def band_names(edges: np.ndarray) -> list[str]:
    """Pass names such as '7.50-7.90um', with as many decimals as make all edges differ, two at least.

    Raises SceneError if a name is longer than Blender keeps.
    """
    edges = np.asarray(edges, dtype=np.float64)
    for decimals in range(2, 64):
        labels = [f"{edge:.{decimals}f}" for edge in edges]
        if len(set(labels)) == len(labels):
            break
    names = [f"{low}-{high}um" for low, high in zip(labels[:-1], labels[1:], strict=True)]
    longest = max(names, key=len)
    if len(longest) > MAX_PASS_NAME:
        raise SceneError(f"Band name '{longest}' has {len(longest)} characters, Blender's passes hold {MAX_PASS_NAME}")
    return names
