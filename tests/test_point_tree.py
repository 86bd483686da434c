# SPDX-License-Identifier: GPL-3.0-or-later
"""Orders of points: nothing is lost, and what a node of the tree holds lies together."""

import numpy as np
import pytest

from addon.solver.geometry.point_tree import WIDTH, kd_order


@pytest.mark.parametrize("count", [0, 1, WIDTH, WIDTH + 1, WIDTH**2, WIDTH**2 + 1, 5000])
@pytest.mark.parametrize("distinct", [1, 3, 10**6])
def test_every_point_is_in_the_order_once(count, distinct):
    """Also where many or all points coincide."""
    points = np.random.default_rng(1).integers(distinct, size=(count, 3)).astype(np.float32)
    given = points.copy()
    order = kd_order(points)
    assert np.array_equal(np.sort(order), np.arange(count))
    assert np.array_equal(points, given)


@pytest.mark.parametrize("count", [WIDTH + 1, 300, WIDTH**2 + 1, 6250])
def test_nodes_do_not_overlap(count):
    """Of two nodes of a level one lies wholly to one side of the other, along some axis, as halving cut them apart."""
    points = np.random.default_rng(2).random((count, 3), np.float32)
    ordered = points[kd_order(points)]
    size = WIDTH
    while size < count:
        firsts = np.arange(0, count, size)
        low = np.minimum.reduceat(ordered, firsts)
        high = np.maximum.reduceat(ordered, firsts)
        overlap = np.all((low[:, None] < high[None]) & (low[None] < high[:, None]), axis=2)
        assert np.array_equal(overlap, np.eye(len(firsts), dtype=bool) & (high > low).all(axis=1))
        size *= WIDTH
