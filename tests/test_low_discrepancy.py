# SPDX-License-Identifier: GPL-3.0-or-later
"""The scrambled Sobol' sequence: as even as it should be, and in an order of its own for every path."""

import numpy as np
import pytest
from numba import njit

from addon.solver.low_discrepancy import scrambled, shuffled
from addon.solver.rng import path_key


@njit
def points(key, count):
    path = path_key(key, 0)
    found, index = np.empty((count, 2)), np.empty(count, np.int64)
    for i in range(count):
        index[i] = shuffled(i, count, path, 2)
        found[i] = scrambled(index[i], path, 0), scrambled(index[i], path, 1)
    return found, index


@pytest.mark.parametrize("count", [1, 2, 16, 32, 128])
def test_shuffled_points_are_those_of_a_net(count):
    """In every way to cut the square in `count` equal boxes of powers of two, each box holds one point."""
    orders = set()
    for key in range(20):
        found, index = points(np.uint64(key), count)
        assert np.array_equal(np.sort(index), np.arange(count))
        orders.add(tuple(index))
        for power in range(count.bit_length()):
            columns, rows = 2**power, count // 2**power
            box = np.floor(found * (columns, rows)).astype(int)
            assert len(np.unique(box[:, 0] * rows + box[:, 1])) == count
    assert len(orders) == (20 if count > 16 else len(orders)) and (count == 1 or len(orders) > 1)


def test_order_says_nothing_of_place():
    """Halves of the order and halves of the square are independent over paths: the count of early points on the left
    has the mean of chance. 4 standard errors."""
    share = [np.mean(points(np.uint64(key), 2)[0][0] < 0.5, axis=0) for key in range(2000)]
    assert abs(np.mean(share) - 0.5) < 4 * 0.5 / np.sqrt(2 * len(share))
