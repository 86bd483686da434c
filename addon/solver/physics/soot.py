# SPDX-License-Identifier: GPL-3.0-or-later
"""Soot: particles so small against the wavelength that they absorb by their volume and hardly scatter."""

from __future__ import annotations

import math

import numpy as np

_RANGE = 0.4, 30.0  # um, of the refractive index; the coefficient is held constant outside


def soot_curve() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,) um and absorption coefficients (n,) per unit of volume fraction, 1/m.

    Rayleigh's limit, 36 pi n k / ((n^2 - k^2 + 2)^2 + 4 n^2 k^2) / wavelength (Modest, eq. 12.123).
    """
    wavelength = np.geomspace(*_RANGE, 200)
    index = soot_index(wavelength)
    n, k = index.real, index.imag
    form = n * k / ((n * n - k * k + 2.0) ** 2 + 4.0 * (n * k) ** 2)
    return wavelength, 36.0 * math.pi * form / (1e-6 * wavelength)


def soot_index(wavelength: np.ndarray) -> np.ndarray:
    """Refractive index n + i k of flame soot at wavelengths (um, in _RANGE), complex (Chang and Charalampopoulos 1990,
    Proc. R. Soc. A 430, 577)."""
    x = np.log(wavelength)
    n = 1.811 + 0.1263 * x + 0.0270 * x**2 + 0.0417 * x**3
    k = 0.5821 + 0.1213 * x + 0.2309 * x**2 - 0.0100 * x**3
    return n + 1j * k
