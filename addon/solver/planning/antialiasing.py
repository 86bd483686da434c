# SPDX-License-Identifier: GPL-3.0-or-later
"""Antialiasing: how many camera rays each pixel sends in a pass. It is more where radiance varies within the pixel.

With n rays the variance from an edge in the pixel falls as n^-3/2, as only n^1/2 of n strata lie on the edge (Mitchell
1996). A further camera ray pays where it saves as much variance as a further ray of a final gather does (see
splitting). The camera rays of all passes are one sequence, so m passes lower the variance from edges by m^-3/2, and all
other variance by 1 / m. Edges are therefore weighed as they are after a few passes.
"""

import numpy as np

FEWEST, UNKNOWN, MOST = 4, 16, 512  # camera rays of a pixel in a pass; powers of two, so that each pass is stratified
_PASSES = 4.0  # number of passes after which the variance from edges is weighed
_MEAN = 32.0  # camera rays of a pixel, at most, in the mean of the image
# The same where media scatter, and what a path meets is chance: 1 / (noise^2 x time) is then, over that with 32, 1.8 in
# a room full of fog (1.4 with 64, 1.7 with 200), 1.26 before a plume in a grid (1.14 with 64), 1.5 before steam and .9
# in a street in thin mist (the latter two with 20,000 photons a pass): python -m tests.benchmarks.fog_rays
_MEAN_IN_FOG = 100.0


def least_price(variance: np.ndarray, in_fog: bool) -> float:
    """The least price of a ray at which pixels of this variance (p,), see Survey, send at most _MEAN on average, or
    _MEAN_IN_FOG."""
    prices = max(variance.max(), 1e-300) * np.geomspace(1e-9, 1.0, 30)
    most = _MEAN_IN_FOG if in_fog else _MEAN
    return float(next((each for each in prices if _samples(variance, each).mean() <= most), prices[-1]))


def choose_samples(variance: np.ndarray, unknown: np.ndarray, price: float) -> np.ndarray:
    """(p,) uint16 camera rays of each pixel in a pass. variance, unknown: (p,), see Survey. price: variance that a ray
    should save."""
    samples = _samples(variance, price)
    return np.where(unknown, np.maximum(samples, UNKNOWN), samples)


def edge_variance(variance: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """(p,) variance, times the number of passes, that edges leave in a pixel with so many samples (p,) in each pass."""
    return variance * samples.astype(np.float64) ** -1.5 / np.sqrt(_PASSES)


def _samples(variance: np.ndarray, price: float) -> np.ndarray:
    """(p,) uint16 rays at which a further ray saves as much as it costs: the slope of edge_variance is -price. Rounded
    to powers of two."""
    best = (1.5 * variance / np.sqrt(_PASSES) / max(price, 1e-300)) ** 0.4
    return (2 ** np.rint(np.log2(np.clip(best, FEWEST, MOST)))).astype(np.uint16)
