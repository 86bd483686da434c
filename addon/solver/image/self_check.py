# SPDX-License-Identifier: GPL-3.0-or-later
"""How much light the image misses because rays recall irradiance, as the render itself finds it.

Some rays of final gathers go on from where they recall, see camera.onward. What they find more, or less, is added up
over large regions of the image, where the noise of these few rays averages out. Where the mean over the passes is
beyond its own noise, the recalled light is wrong by about that, and the image states it as an error.
"""

from __future__ import annotations

import numpy as np

GRID = 4  # regions along each side of the image
# Standard errors. Where light is rare, the few rays that look for it mostly find less than is recalled: of 240 regions
# of 15 scenes of tests/benchmarks/families.py after 64 passes 5 are between 3 and 4.6 standard errors off, while the
# image is off by 0.3 of that at most.
_SIGNIFICANT = 5.0
_FEWEST = 16  # passes, as the spread of fewer says little of the standard error


def regions(width: int, height: int) -> np.ndarray:
    """(height * width,) int64 number of the region of each pixel, of GRID x GRID."""
    rows, columns = GRID * np.arange(height) // height, GRID * np.arange(width) // width
    return (GRID * rows[:, None] + columns).ravel()


def region_means(values: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(GRID^2,) float64 mean of values (pixels,) over each region; 0 where a region has no pixels."""
    count = np.bincount(region, minlength=GRID**2)
    return np.bincount(region, values, GRID**2) / np.maximum(count, 1)


def significant(missed: np.ndarray, squares: np.ndarray, passes: int) -> np.ndarray:
    """(GRID^2,) float64 of what regions miss, W m-2 sr-1, the part that its noise does not explain: the root of the
    squared mean less the squared limit.

    missed: mean over the passes. squares: sum of squared deviations.
    """
    if passes < _FEWEST:
        return np.zeros(len(missed))
    variance = squares / (passes * (passes - 1))
    return np.sqrt(np.maximum(missed**2 - _SIGNIFICANT**2 * variance, 0.0))


def spread_out(bias: np.ndarray, error: np.ndarray, region: np.ndarray) -> np.ndarray:
    """(pixels,) float64 share of the bias of its region (GRID^2,) that each pixel states: in proportion to its standard
    error (pixels,), as nothing tells where in the region light is missed, but pixels that show no reflected light miss
    none."""
    mean = region_means(error, region)
    return bias[region] * error / np.maximum(mean, 1e-300)[region]
