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

from .pooling import sum_around
from .regression import Regression

_ALPHA = 2.0 / 3.0  # Knaus and Zwicker 2011: variance falls as m^-a, squared bias as m^-2(1-a)
# Pixels share the photons of a disk, so they are no independent witnesses of its blur. Neighbours reach as far as the
# largest disk does (see gather_reach) on both sides together, whatever the number of pixels: a 32nd of the width. They
# count less the further they are, as two means over half of that do, one after the other, so that no square is seen.
_HALF_REACH = 1.0 / 64.0
# The mean squared bias of all neighbours, over the variance that noise gives it, is 1 if it is nothing but noise, with
# a standard error of the root of 2 over the number of independent ones (chi-squared): what is two of these beyond
# counts. They are taken as those of a picture 64 pixels wide, of whose disks few are wider than a pixel: 1 over the sum
# of squares of the weights 1, 2, 3, 2, 1 over 9, along both axes.
_BY_NOISE = 1.0 + 2.0 * math.sqrt(2.0) * 19.0 / 81.0
# Variance of a bias that is nothing but noise, over that of the mean of the passes, up to which blur is stated: it is
# below 15 for the first 16 passes of a render, or more. In the demo (160 x 120 pixels, 100,000 photons a pass), where
# blur is stated, the true error is 1.0 of the stated one after 16 passes, 1.2 after 32 and 1.0 after 64; without the
# statement 2.6, 3.1 and 2.8. Of 8 passes, pooled over 5 x 5 pixels, it was 0.4. Later passes by themselves, such as
# 100 to 125, differ too little in their areas to tell anything (2200).
_NOISIEST = 15.0


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
    leverage = areas.leverage()
    if leverage * areas.passes > _NOISIEST:
        return np.zeros(variance.shape)
    bias = areas.bias().reshape(variance.shape)
    beyond = _around(bias**2 - _BY_NOISE * leverage * variance)
    known = _around(variance / areas.passes)
    return np.divide(np.maximum(beyond, 0.0), known, out=np.zeros(variance.shape), where=known > 0.0)


def _around(values: np.ndarray) -> np.ndarray:
    """(h, w) sums of values (h, w) over neighbours, by weight."""
    reach = max(1, round(_HALF_REACH * values.shape[1]))
    return sum_around(sum_around(values, reach), reach)
