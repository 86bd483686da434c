# SPDX-License-Identifier: GPL-3.0-or-later
"""Sides are chosen in proportion to area, exitance and the factor of their sheet, whatever the order of the triangles,
as a table of the running sum over all sides would choose them."""

from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from addon.solver.geometry.surfaces import Surfaces
from addon.solver.geometry.triangles import areas
from addon.solver.photons.side_table import build_side_table, first_found, found_from, number_in, side_at
from tests.helpers.scenes import loose

SHEETS = 12


def table_of(count, ordered, lit):
    """Surfaces of `count` loose triangles, a SideTable over them, and what each of its entries weighs. lit: whether
    triangles have exitances, of which a tenth is 0; a third of the sheets has the factor 0."""
    rng = np.random.default_rng(count)
    corners = loose(rng.normal(size=(count, 3, 3)).astype(np.float32))
    sheet = rng.integers(0, SHEETS, (count, 2)).astype(np.int32)
    surfaces = Surfaces(*[None] * len(Surfaces._fields))._replace(corners=corners, sheet=sheet)
    factor = np.where(np.arange(SHEETS) % 3 == 0, 0.0, rng.exponential(size=SHEETS))
    order = rng.permutation(count).astype(np.int32) if ordered else None
    exitance = (rng.exponential(size=count) * (rng.random(count) > 0.1)).astype(np.float32) if lit else None
    weight = areas(corners)[:, None] * factor[sheet]
    weight = weight * exitance[:, None] if lit else weight
    weight = (weight[order] if ordered else weight).ravel()
    table = build_side_table(surfaces, factor, exitance, order)
    return SimpleNamespace(surfaces=surfaces, table=table, weight=weight, order=order)


@njit
def choose(surfaces, table, shares, one_by_one):
    """(n,) side_ids and (n, 2) low and high, see Found, chosen by ascending shares (n,) of the sum of all weights."""
    side_id, between = np.empty(shares.size, np.int64), np.empty((shares.size, 2))
    found = first_found(table, 0.0)
    for i in range(shares.size):
        number = number_in(shares[i], table.before[-1])
        found = found_from(surfaces, table, number, first_found(table, number) if one_by_one else found)
        side_id[i], between[i, 0], between[i, 1] = side_at(table, found.entry), found.low, found.high
    return side_id, between


@pytest.mark.parametrize("count", [1, 15, 16, 17, 500])
@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("lit", [False, True])
def test_sides_are_chosen_as_by_a_table_of_all(count, ordered, lit):
    of = table_of(count, ordered, lit)
    shares = np.sort(np.append(np.random.default_rng(0).random(2000), (0.0, 1.0)))
    total = np.append(0.0, np.cumsum(of.weight))
    if total[-1] == 0.0:
        assert of.table.before[-1] == 0.0
        return
    for one_by_one in (False, True):
        side_id, between = choose(of.surfaces, of.table, shares, one_by_one)
        entry = np.searchsorted(total, np.minimum(shares, 1.0 - 1e-15) * total[-1], side="right") - 1
        triangle = of.order[entry >> 1] if ordered else entry >> 1
        np.testing.assert_array_equal(side_id, 2 * triangle + (entry & 1))
        np.testing.assert_allclose(between, np.column_stack((total[entry], total[entry + 1])), rtol=1e-12)
        assert np.all(between[:, 0] < between[:, 1])
