# SPDX-License-Identifier: GPL-3.0-or-later
"""The inner loops of the module spectrum."""

import math

import numpy as np

from ..system.kernels import KERNEL, njit
from .constants import C1, C2

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS  # on 0..1
_REACH = 50.0  # width in x beyond which the rest of the integral, e^-50 of it, is below the resolution of float64
_PANEL = 6.25  # width in x of a panel, in which 16 nodes err by less than 1e-16 (the nearest pole is 2 pi away)


@njit(**KERNEL)
def _add_segment(low, high, at_low, at_high, temperature, derivative, result):
    """Add to result (n,) the integral over low..high um of eps(lambda) B(lambda, T), eps linear between its ends.

    temperature: (n,) K > 0. derivative: whether to integrate the derivative d/d(ln T) instead; d B / d ln T = B x / (1
    - e^-x).
    """
    slope = (at_high - at_low) / (high - low)
    for i in range(temperature.size):
        kelvin = temperature[i]
        start = C2 / (high * kelvin)  # x at the long end
        span = min(C2 * (high - low) / (high * low) / kelvin, _REACH)
        panels = max(1, math.ceil(span / _PANEL))
        integral = 0.0
        for panel in range(panels):
            for node in range(_NODES.size):
                above = span * ((panel + _NODES[node]) / panels)  # x - start: keeps narrow bands exact
                x = start + above
                emissivity = at_high - slope * (high - C2 / (x * kelvin))
                rest = -math.expm1(-x)
                value = emissivity * x * x * x * math.exp(-above) / rest
                integral += _WEIGHTS[node] * (value * x / rest if derivative else value)
        integral *= span / panels * (C1 / C2**4) * kelvin**4
        if integral > 0.0:  # e^-start joins the logarithm so that the product is exact down to the smallest float64
            result[i] += math.exp(math.log(integral) - start)


@njit(**KERNEL)
def integrate(points, emissivity, band, temperature, derivative, result):
    """Add to result (b, n) the integrals of eps(lambda) B(lambda, T) between neighbouring points (um), for each T.

    emissivity: at the points, linear between them. band: row of the result for each pair of neighbours.
    """
    for i in range(band.size):
        ends = points[i], points[i + 1], emissivity[i], emissivity[i + 1]
        _add_segment(*ends, temperature, derivative, result[band[i]])


@njit(**KERNEL)
def invert(radiance, log_l, log_t, slope, temperature):
    """Fill temperature (n,) by cubic Hermite interpolation of ln T over ln L, clamped to the table at its upper end."""
    i = 0
    for n in range(radiance.size):
        if not radiance[n] > 0.0 or math.log(radiance[n]) <= log_l[0]:
            temperature[n] = 0.0
            continue
        wanted = min(math.log(radiance[n]), log_l[-1])
        if not log_l[i] < wanted <= log_l[i + 1]:  # neighbouring pixels mostly lie in one interval
            i = min(max(np.searchsorted(log_l, wanted) - 1, 0), log_l.size - 2)
        step = log_l[i + 1] - log_l[i]
        t = (wanted - log_l[i]) / step
        temperature[n] = math.exp(
            (1 + 2 * t) * (1 - t) ** 2 * log_t[i]
            + t**2 * (3 - 2 * t) * log_t[i + 1]
            + step * (t * (1 - t) ** 2 * slope[i] + t**2 * (t - 1) * slope[i + 1])
        )
