# SPDX-License-Identifier: GPL-3.0-or-later
"""What the image owes to the size of the disks in which photons are counted, as its own passes tell.

Disks blur: what they add to a pixel, or take from it, grows with their area. Camera paths count photons of caustics
alone, so only scenes with caustics ask for this. But disks shrink from pass to pass, and by a known factor. So a
straight line through the values of the passes, over the area, tells what a pixel would show with disks of no size, and
how far the mean of its passes is from that. For one pixel this is hardly above its noise; of a pixel and its neighbours
together it tells where edges of caustics are blurred. The image is not corrected by it, as its noise would grow; the
error says it.
"""

from __future__ import annotations

import math

import numpy as np

from .pooling import REACH, sum_around
from .regression import Regression

_ALPHA = 2.0 / 3.0  # Knaus and Zwicker 2011: variance falls as m^-a, squared bias as m^-2(1-a)
# The mean squared bias of a square of neighbours, over the variance that noise gives it, is 1 if it is nothing but
# noise, with a standard error of the root of 2 over their number (chi-squared): what is two of these beyond counts.
_BY_NOISE = 1.0 + 2.0 * math.sqrt(2.0) / (2 * REACH + 1)


# Passes. In the demo (160 x 120 pixels, 100,000 photons a pass), where blur is stated, the true error is 0.4 of the
# stated one after 8 passes, 0.7 after 16, 1.0 after 32 and 0.9 after 64; without the statement 1.8, 2.6, 3.3 and 3.0.
_FEWEST = 16


def shrink_factor(index: int) -> float:
    """Squared radius of disks in pass `index` (from 0) over that of the first: the product of (i + a) / (i + 1) for
    i = 1 .. index."""
    a = _ALPHA
    return math.exp(math.lgamma(index + 1 + a) - math.lgamma(1 + a) - math.lgamma(index + 2))


def blur(areas: Regression, variance: np.ndarray) -> np.ndarray:
    """(height, width) float64, the squared error from blur over the variance of the mean that passes tell, at least 0.

    areas: of the pixels' values on the area of disks, in any unit; without disks it is 0. variance: (height, width)
    float64 of the passes at each pixel.
    """
    if areas.passes < _FEWEST:
        return np.zeros(variance.shape)
    bias = areas.bias().reshape(variance.shape)
    beyond = sum_around(bias**2 - _BY_NOISE * areas.leverage() * variance, REACH)
    known = sum_around(variance / areas.passes, REACH)
    return np.divide(np.maximum(beyond, 0.0), known, out=np.zeros(variance.shape), where=known > 0.0)
