# SPDX-License-Identifier: GPL-3.0-or-later
"""Media: what clear gases absorb and emit in each band."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..scene import Medium
from .spectrum import band_radiance

_COLD = 200.0  # K: below, the blackbody that weighs the absorption in a band is taken at this temperature


class MediumTable(NamedTuple):
    """m media in b bands. absorption: (m, b) float64, 1/m. excess: (m, b) float64, W m-2 sr-1, radiance of a blackbody
    at a medium's temperature over that at T0."""

    absorption: np.ndarray
    excess: np.ndarray


def build_medium_table(
    media: tuple[Medium, ...], edges: np.ndarray, quiet: float, reference: np.ndarray
) -> MediumTable:
    """The MediumTable of media. quiet: T0, K, 0 for none. reference: (b,) W m-2 sr-1, radiance of a blackbody at T0."""
    absorption = np.array([band_absorption(medium, edges) for medium in media]).reshape(-1, len(edges) - 1)
    excess = np.zeros_like(absorption)
    for i, medium in enumerate(media):
        if medium.temperature != quiet:  # else light would carry the rounding of the reference and nothing else
            excess[i] = band_radiance(edges, medium.temperature) - reference
    return MediumTable(absorption, excess)


def band_absorption(medium: Medium, edges: np.ndarray) -> np.ndarray:
    """(b,) float64 absorption coefficient in each band, 1/m: the mean over the band, weighted with what a blackbody at
    the medium's temperature emits (Planck mean: exact for the emission of a thin medium; Modest, section 10.8)."""
    wavelengths, values = medium.curve
    if len(wavelengths) == 1:
        return np.full(len(edges) - 1, values[0])
    kelvin = max(medium.temperature, _COLD)
    largest = max(float(values.max()), 1e-300)  # the integral takes curves from 0 to 1
    return largest * band_radiance(edges, kelvin, (wavelengths, values / largest)) / band_radiance(edges, kelvin)
