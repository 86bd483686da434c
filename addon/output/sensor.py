# SPDX-License-Identifier: GPL-3.0-or-later
"""A sensor with a response over wavelength: what it makes of band images, in arithmetic that nodes can do as well.

radiance = sum of weight_b L_b, with the response's integral over band b (um) as weight_b. Temperature inverts Planck's
law at one wavelength, T = (C2 / lambda) / v with v = ln(1 + scale / radiance), which is exact for a narrow band;
for wide ones the constant C2 / lambda becomes a polynomial in ln v, fitted to the sensor's view of blackbodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from ..solver.spectrum import C1, band_radiance

COLDEST, HOTTEST = 200.0, 2000.0  # K: between them the polynomial is fitted
DEGREE = 9
_SAMPLES = 400


def band_weights(edges: np.ndarray, response: np.ndarray | None = None) -> np.ndarray:
    """(b,) um: integral of a response over each band. edges: (b + 1,) um.

    response: (n, 2) wavelength (um, ascending) and response, linear between points and constant outside; None is 1.
    """
    edges = np.asarray(edges, np.float64)
    if response is None:
        return np.diff(edges)
    wavelength, value = np.asarray(response, np.float64).T
    points = np.union1d(edges, wavelength[(wavelength > edges[0]) & (wavelength < edges[-1])])
    values = np.interp(points, wavelength, value)
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(points))))
    return np.diff(np.interp(edges, points, integral))


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
    """The Calibration of a sensor with these weights (b,), um, for band images with these edges (b + 1,), um."""
    kelvin = np.geomspace(COLDEST, HOTTEST, _SAMPLES)
    radiance = band_radiance(edges, kelvin) @ (weights / np.diff(edges))
    wavelength = np.sqrt(edges[0] * edges[-1])
    scale = C1 / wavelength**5 * weights.sum()
    v = np.log1p(scale / radiance)
    ends = np.log(v[[0, -1]])
    slope = 1.0 / (ends[1] - ends[0])
    x = slope * (np.log(v) - ends[0])
    fit = Chebyshev.fit(x, kelvin * v, DEGREE, domain=(0.0, 1.0), w=1.0 / (kelvin * v))
    return Calibration(scale, slope, -slope * ends[0], tuple(fit.convert(kind=Polynomial).coef))
