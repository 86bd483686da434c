# SPDX-License-Identifier: GPL-3.0-or-later
"""How many camera rays a pixel sends in a pass: more where what it sees differs within.

The error of an edge falls as n^-3/2 in variance, as only n^1/2 of n strata lie on it (Mitchell 1996); a further ray
pays where it saves as much variance as one of a final gather does (see splitting). As all passes together are one
sequence, m passes lower it by m^-3/2, and all other noise by 1 / m. So it counts as after a few passes.
"""

import numpy as np

FEWEST, UNKNOWN, MOST = 4, 16, 512  # rays of a pixel in a pass; powers of two: each pass is stratified
_PASSES = 4.0  # after which noise is weighed: edges trouble the first ones most
_MEAN = 32.0  # of a pixel at most, where little but edges is noisy


def least_price(variance: np.ndarray) -> float:
    """The price of a ray below which pixels of this variance (p,), see Survey, would send more than 32 on average."""
    prices = max(variance.max(), 1e-300) * np.geomspace(1e-9, 1.0, 30)
    return float(next((each for each in prices if _samples(variance, each).mean() <= _MEAN), prices[-1]))


def choose_samples(variance: np.ndarray, unknown: np.ndarray, price: float) -> np.ndarray:
    """(p,) uint16 rays of every pixel in a pass. variance, unknown: (p,), see Survey. price: variance that a ray should
    save."""
    samples = _samples(variance, price)
    return np.where(unknown, np.maximum(samples, UNKNOWN), samples)


def edge_variance(variance: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """(p,) variance, times the number of passes, that so many rays (p,) of each pass leave in a pixel."""
    return variance * samples.astype(np.float64) ** -1.5 / np.sqrt(_PASSES)


def _samples(variance: np.ndarray, price: float) -> np.ndarray:
    """Rays n at which a further one saves what it costs: the slope of edge_variance is -price; to powers of two."""
    best = (1.5 * variance / np.sqrt(_PASSES) / max(price, 1e-300)) ** 0.4
    return (2 ** np.rint(np.log2(np.clip(best, FEWEST, MOST)))).astype(np.uint16)
