# SPDX-License-Identifier: GPL-3.0-or-later
"""The variance of a pixel, told by its own passes and by its neighbours.

n passes tell a variance well if all of them differ alike. Where light comes from rare events, such as rays that meet
something small and hot, few passes tell of it, and a pixel that has met nothing yet seems to have no variance at all.
So each pixel counts its events: as many as equal deviations would be with the same second and fourth moments. And the
mean variance of its neighbours counts like a few further events. The more a pixel knows itself, the less its neighbours
matter.
"""

from __future__ import annotations

import numpy as np

from ..system.kernels import KERNEL, njit

_REACH = 2  # pixels on each side that are neighbours: 25 together meet what is 25 times as rare
# Events that the neighbours count as: with 2, the families of tests/benchmarks have 0.10 % of their pixels beyond five
# stated errors after 64 passes, with 8 0.08 %, without neighbours 0.38 %.
_EVENTS = 2.0


def pooled_variance(squares: np.ndarray, fourths: np.ndarray, passes: int) -> np.ndarray:
    """(height, width) float64 variance of the passes at each pixel.

    squares, fourths: (height, width) float64, sums over the passes of squared deviations and of their squares. passes:
    at least 2.
    """
    around, events = np.empty((2, *squares.shape))
    _look_around(squares, fourths, float(passes), around, events)
    return (events * squares + _EVENTS * around) / ((events + _EVENTS) * (passes - 1))


@njit(**KERNEL)
def _look_around(squares, fourths, passes, around, events):
    """Fill around (h, w) with the mean of squares, and events (h, w) with (sum of d^2)^2 / (sum of d^4), which is the
    number of deviations d if they are equal and the others 0, from the means around each pixel."""
    height, width = squares.shape
    for y in range(height):
        for x in range(width):
            total, product, fourth, count = 0.0, 0.0, 0.0, 0
            for row in range(max(0, y - _REACH), min(height, y + _REACH + 1)):
                for column in range(max(0, x - _REACH), min(width, x + _REACH + 1)):
                    total += squares[row, column]
                    product += squares[row, column] * squares[row, column]
                    fourth += fourths[row, column]
                    count += 1
            around[y, x] = total / count
            events[y, x] = min(passes, max(1.0, product / fourth)) if fourth > 0.0 else passes
