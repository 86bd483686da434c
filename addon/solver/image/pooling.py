# SPDX-License-Identifier: GPL-3.0-or-later
"""The variance of a pixel, told by its own passes and by its neighbours.

n passes tell a variance well if all of them differ alike. Where light comes from rare events, such as rays that meet
something small and hot, few passes tell of it, and a pixel that has met nothing yet seems to have no variance at all.
So each pixel counts its events: as many as equal deviations would be with the same second and fourth moments. What few
events tell might as well have happened next door, so it is shared out to the pixels around. What many events tell stays
where it was met: neighbours of the same kind would have met as many.
"""

from __future__ import annotations

import numpy as np

REACH = 2  # pixels on each side that are neighbours: 25 together meet what is 25 times as rare
# Events of which a pixel shares out half of its variance. With 2, twelve members of seven families (comb, fins,
# grooves, louvres, rough, terrain and tube of tests/benchmarks/families.py) have 1.1 % of their pixels beyond five
# stated errors after 64 passes, with 8 1.0 %, without sharing 1.9 %.
_FEW = 2.0
# n normal deviations count as n / 3 events, so that an edge of which every pass tells has as many as there are passes.
# A spot that k strata meet has a rim across 4.5 k^1/2 of them (2 (pi k)^1/2 times 4 / pi), where the variance is 1/6 on
# average: 0.75 k^1/2 in all. Three events for each hit make it k / (3 k)^1/2 = 0.58 k^1/2: the error is 12 % larger.
_ROUND = 3.0
# Beside a pixel with an edge another is cut at its corner, by less than one of N strata, as often as N^-1/2. The square
# of what it then misses is up to 6 N^-1/2 of the edge's variance, N^-3/2 / 6, a fifth of that on average. A share of
# 0.08 N^-1/2 makes four stated errors of the average, and nine of the most; more would show in the noise of all pixels
# beside edges. N is taken as 16 rays in each pass. As an edge goes through three of nine pixels, each gives a third.
_CORNER = 0.02


def pooled_variance(squares: np.ndarray, fourths: np.ndarray, estimated: np.ndarray, passes: int) -> np.ndarray:
    """(height, width) float64 variance of the passes at each pixel; its sum over pixels is that without pooling.

    squares, fourths: (height, width) float64, sums over the passes of squared deviations and of their squares.
    estimated: (height, width) bool, pixels that receive what others share out, see Film. passes: at least 2.
    """
    shared = squares * (_FEW / (_events(squares, fourths) + _FEW))
    # each pixel counts among those that receive its share, so that one alone keeps it
    share = shared / (sum_around(estimated, REACH) + ~estimated)
    received = np.where(estimated, sum_around(share, REACH), share)
    return (squares - shared + received) / (passes - 1)


def variance_of_edges(
    squares: np.ndarray, fourths: np.ndarray, planned: np.ndarray | None, resolved: np.ndarray, passes: int
) -> np.ndarray:
    """(height, width) float64 variance of what is seen, times the number of passes. squares, fourths, passes: see
    pooled_variance. planned: (height, width) float64, variance of a pass that the plan expects, which counts as that of
    one pass more: few passes may agree by chance; None if nothing was planned. resolved: likewise, how many events
    count at most.

    Passes are not independent here: all camera rays of a pixel are one stratified sequence. n rays that tell an edge
    leave a variance as n^-3/2, as only the n^1/2 strata on the edge err (Mitchell 1996): m passes leave 1 / m^1/2 of
    what they would if they were independent. But rays that seldom meet what is small in a pixel are as good as
    independent until they have met it: then the square root of the hits counts, not that of the passes. So events
    count, see _ROUND, and at most the passes. A line has many hits before the strata are as narrow as it is: of these
    count as many as would meet a square of its width.

    What few events of many passes tell is shared out, as in pooled_variance, but nobody gives it away: what neighbours
    see, such as the rest of a wire, is no substitute for an edge of one's own. An edge that all passes meet is no news
    to pixels around it, but may cut a corner of those beside it.
    """
    events = _events(squares, fourths)
    expected, known = (squares, passes - 1) if planned is None else (squares + planned, passes)
    own = expected / np.sqrt(np.clip(_ROUND * np.minimum(events, resolved), 1.0, passes))
    shared = own * (_FEW / (events + _FEW)) * np.maximum(1.0 - _ROUND * events / passes, 0.0)
    corners = _CORNER / passes**0.5 * sum_around(own, 1) / 3.0
    return np.maximum(own, np.maximum(sum_around(shared, REACH) / (2 * REACH + 1) ** 2, corners)) / known


def _events(squares, fourths):
    """(sum of d^2)^2 / (sum of d^4) is the number of deviations d if they are equal, and the others 0."""
    return np.divide(squares**2, fourths, out=np.full(squares.shape, np.inf), where=fourths > 0.0)


def sum_around(values: np.ndarray, reach: int) -> np.ndarray:
    """(h, w) float64 sums of values (h, w) over the square of so many pixels on each side around each pixel."""
    padded = np.pad(values.astype(np.float64), reach)
    return _window_sums(_window_sums(padded, 2 * reach + 1).T, 2 * reach + 1).T


def _window_sums(values: np.ndarray, length: int) -> np.ndarray:
    """Sums of so many rows of values (n, m), from each row on. Of sums of 1, 2, 4, ... rows those are added that make
    up the length: few additions, and no differences of large sums."""
    count, total, first, size = len(values) - length + 1, 0.0, 0, 1
    while True:
        if length & size:
            total, first = total + values[first : first + count], first + size
        if 2 * size > length:
            return total
        values, size = values[:-size] + values[size:], 2 * size
