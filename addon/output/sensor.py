# SPDX-License-Identifier: GPL-3.0-or-later
"""From a sensor's radiance to its temperature in arithmetic that compositor nodes can do as well.

Planck's law is inverted at one wavelength, T = (C2 / lambda) / v with v = ln(1 + scale / radiance), which is exact for
a narrow band; for wide ones the constant C2 / lambda becomes a polynomial in ln v, fitted to the sensor's view of
blackbodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from ..solver.physics.spectrum import C1, sensor_radiance

COLDEST, HOTTEST = 200.0, 2000.0  # K: between them the polynomial is fitted
DEGREE = 9
_SAMPLES = 400
_FAINT = 0.01  # of the largest response: bands with less do not count for the wavelength, whose choice is free


@dataclass(frozen=True)
class Calibration:
    """Radiance to temperature: T = P(x) / v, v = ln(1 + scale / radiance), x = slope ln v + offset within 0..1.

    scale: W m-2 sr-1. coefficients: of P, K, constant first.
    """

    scale: float
    slope: float
    offset: float
    coefficients: tuple[float, ...]


def calibrate(edges: np.ndarray, weights: np.ndarray) -> Calibration:
    """The Calibration of a sensor with these responses (b,) in bands with these edges (b + 1,), um."""
    kelvin = np.geomspace(COLDEST, HOTTEST, _SAMPLES)
    radiance = sensor_radiance(edges, weights, kelvin)
    seen = np.flatnonzero(weights > _FAINT * weights.max())
    wavelength = np.sqrt(edges[seen[0]] * edges[seen[-1] + 1])
    scale = C1 / wavelength**5 * (weights @ np.diff(edges))
    v = np.log1p(scale / radiance)
    ends = np.log(v[[0, -1]])
    slope = 1.0 / (ends[1] - ends[0])
    x = slope * (np.log(v) - ends[0])
    fit = Chebyshev.fit(x, kelvin * v, DEGREE, domain=(0.0, 1.0), w=1.0 / (kelvin * v))
    return Calibration(scale, slope, -slope * ends[0], tuple(fit.convert(kind=Polynomial).coef))
