# SPDX-License-Identifier: GPL-3.0-or-later
"""What a length of gas lets through at each wavelength: curves to look at. Renders draw lines instead (see molecules).

Nothing here needs Numba, so that Blender's panels can draw such curves.
"""

from __future__ import annotations

import numpy as np

from ..scene import ATMOSPHERE, SOOT, Medium
from .continuum import water_continuum
from .narrow_bands import COLDEST, coefficient_and_overlap
from .soot import soot_curve


def transmittance(medium: Medium, wavelengths: np.ndarray, length: float) -> np.ndarray:
    """(n,) float64 share of the light that a length (units of the scene) of a medium lets through without scattering
    it, at wavelengths (n,) um: of molecules the mean over the narrow band there, by Malkmus' law."""
    depth = sum(np.interp(wavelengths, *medium.curve(quantity)) for quantity in ("absorption", "scattering"))
    depth = depth + medium.metres * medium.gas.get(SOOT, 0.0) * np.interp(wavelengths, *soot_curve())
    through = np.exp(-depth * length)
    for name in medium.molecules:
        through = through * _molecule(medium, name, 1e4 / wavelengths, length * medium.metres)
    return through


def _molecule(medium: Medium, name: str, wavenumber: np.ndarray, length: float) -> np.ndarray:
    """(n,) share of the light at wavenumbers (n,), cm-1, that a length (m) of one molecule of a mixture lets through:
    exp(-2 a (sqrt(1 + k s / a) - 1)), a the half-width of lines over their distance, k s the mean optical depth."""
    mixture, atm = medium.molecules, medium.pressure / ATMOSPHERE
    kelvin = np.array([max(medium.temperature, COLDEST)])
    (mean,), (overlap,) = coefficient_and_overlap(name, wavenumber, kelvin, atm, mixture)
    depth = mean * mixture[name] * length
    # the same without the difference of two numbers that are nearly equal
    through = np.exp(-2.0 * depth / (1.0 + np.sqrt(1.0 + depth / np.maximum(overlap, 1e-12))))
    if name == "H2O":
        through *= np.exp(-water_continuum(wavenumber, kelvin, atm, mixture[name]) * mixture[name] * length)
    return through
