# SPDX-License-Identifier: GPL-3.0-or-later
"""Antialiasing: how many camera rays each pixel sends in a pass. It is more where radiance varies within the pixel.

With n rays the variance from an edge in the pixel falls as n^-3/2, as only n^1/2 of n strata lie on the edge (Mitchell
1996). Where media scatter, what a ray meets is chance, and the variance falls as 1 / n. A further camera ray pays where
it saves as much variance as a further ray of a final gather does (see splitting). The camera rays of all passes are one
sequence, so m passes lower the variance from edges by m^-3/2, and all other variance by 1 / m. Edges are therefore
weighed as they are after a few passes.
"""

from bisect import bisect_left

import numpy as np

FEWEST, UNKNOWN, MOST = 4, 16, 512  # camera rays of a pixel in a pass; powers of two, so that each pass is stratified
# Number of passes after which the variance from edges is weighed. With 32, as in the price, squared error times rays is
# 0.86 in the street and the same elsewhere (docs/estimators.md), but after four passes the true errors of balls that
# fill a tenth of their pixels are 1.21 of the stated ones in place of 1.18 (tests/test_specks.py, 48 seeds).
_PASSES = 4.0
_MEAN = 32.0  # camera rays of a pixel, at most, in the mean of the image
# The same where media scatter, and what a path meets is chance: 1 / (noise^2 x time) is then, over that with 32, 1.8 in
# a room full of fog (1.4 with 64, 1.7 with 200), 1.26 before a plume in a grid (1.14 with 64), 1.5 before steam and .9
# in a street in thin mist (the latter two with 20,000 photons a pass): python -m tests.benchmarks.fog_rays
_MEAN_IN_FOG = 100.0


def least_price(variance: np.ndarray, in_fog: bool) -> float:
    """The least price of a ray at which pixels of this variance (p,), see Survey, send at most _MEAN on average, or
    _MEAN_IN_FOG."""
    prices = max(variance.max(), 1e-300) * np.geomspace(1e-9, 1.0, 100)
    most = _MEAN_IN_FOG if in_fog else _MEAN
    found = bisect_left(prices[:-1], -most, key=lambda price: -_samples(variance, price, in_fog).mean())
    return float(prices[found])


def choose_samples(variance: np.ndarray, unknown: np.ndarray, price: float, in_fog: bool) -> np.ndarray:
    """(p,) uint16 camera rays of each pixel in a pass. variance, unknown, in_fog: see Survey. price: variance that a
    ray should save."""
    samples = _samples(variance, price, in_fog)
    return np.where(unknown, np.maximum(samples, UNKNOWN), samples)


def camera_variance(variance: np.ndarray, samples: np.ndarray, in_fog: bool, passes: float) -> np.ndarray:
    """(p,) variance, times the number of passes, that is left in a pixel with so many samples (p,) in each pass."""
    fall = _fall(in_fog)
    return variance * samples.astype(np.float64) ** -fall * passes ** (1.0 - fall)


def _fall(in_fog: bool) -> float:
    """The variance from what a pixel shows falls as the number of camera rays to the power of minus this."""
    return 1.0 if in_fog else 1.5


def _samples(variance: np.ndarray, price: float, in_fog: bool) -> np.ndarray:
    """(p,) uint16 rays at which a further ray saves as much as it costs: the slope of camera_variance is -price.
    Rounded to powers of two."""
    fall = _fall(in_fog)
    best = (fall * variance * _PASSES ** (1.0 - fall) / max(price, 1e-300)) ** (1.0 / (1.0 + fall))
    return (2 ** np.rint(np.log2(np.clip(best, FEWEST, MOST)))).astype(np.uint16)
