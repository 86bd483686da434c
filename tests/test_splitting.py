# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of rays and the roulette at their ends are those that lower noise times time."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.planning.sheets import FALL, dark_sheets
from addon.solver.planning.splitting import (
    _ALONE,
    _EQUAL,
    _EQUAL_MOST,
    _FEWEST,
    _LEAST_CHANCE,
    _MOST,
    _RECALL,
    _SHARING,
    NEAR,
    Splitting,
    Spread,
    plan_looking,
    rays_alone,
    recall_chance,
)
from addon.solver.planning.survey import Cells

noises = st.floats(1e-12, 1e12)


def splitting_of(price, **sheet):
    """On one sheet, which has these values."""
    known = {name: np.full(1, value) for name, value in sheet.items() if name != "evenness"}
    sheets = dark_sheets(1)._replace(**sheet | known)
    return Splitting(sheets, cells_of(), np.zeros(0, np.int32), np.zeros(0), price)


def cells_of(key=(), closeness=(), count=()):
    """Cells with these keys, closenesses and numbers of gathers."""
    empty = np.zeros((5, len(key)))
    cells = Cells(np.array(key, np.int64), *empty, np.array(count, np.int64), np.zeros(len(key)))
    return cells._replace(closeness=np.array(closeness, float))


class Disk(NamedTuple):
    """Where a pixel gathers: the share of its light that this brings, the largest disk, and how far disks have
    shrunk."""

    contribution: float
    reach2: float
    shrink2: float


spreads = st.builds(Spread, st.floats(0.1, 10.0), noises, st.floats(1e-2, 1e2), st.floats(0.0, 4000.0))
disks = st.builds(Disk, st.floats(1e-3, 1.0), st.floats(1e-6, 1e3), st.floats(0.01, 1.0))


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-12, 1e12), spreads, disks)
def test_the_cheapest_is_chosen(price, spread, disk):
    """Variance and its price in time together, over every number of rays. The best number is rounded to a power of two:
    by half an octave, x = 2^(1/2) or its inverse, which costs (x^-FALL / FALL + x) / (1 / FALL + 1) - 1 < 7.9 %.
    """
    splitting = splitting_of(price, density=1e4, span=1e9, evenness=2.0)
    (bright, ray_noise, closeness, density), (contribution, reach2, shrink2) = spread, disk
    rays, variance = rays_alone(splitting, 0, spread, contribution, reach2, 50, shrink2)
    area = min(math.pi * reach2, 50 / (bright * 1e4)) * shrink2
    shared = min(_SHARING * area, math.pi * (NEAR / closeness) ** 2 * shrink2)
    ray = 2.0 * contribution**2 * ray_noise / max(1.0, min(_EQUAL_MOST, _EQUAL * density * shared))
    by_rays = {n: ray * n**-FALL + price * n for n in range(_FEWEST, _MOST + 1)}
    spent = variance + price * rays
    assert spent <= 1.079 * min(by_rays.values())
    assert spent == pytest.approx(by_rays[rays], rel=1e-5)


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(1e-12, 1e12), st.floats(1e-6, 1.0))
def test_roulette_at_the_ends_of_rays_is_as_strict_as_pays(recalled, price, throughput):
    """Variance that roulette adds and the price of what is done, together, over all chances allowed."""
    splitting = splitting_of(price, reflected=0.6 * recalled, photon_noise=(0.8 * recalled) ** 2, disk=1.0)
    brings = throughput * recalled
    chances = np.append(np.linspace(_LEAST_CHANCE, 1.0, 100), recall_chance(splitting, 0, throughput))
    spent = brings**2 * (1 / chances - 1) + price * _RECALL * chances
    assert spent[-1] <= spent.min() * (1 + 1e-9) + 1e-12 * brings**2


def test_what_is_near_is_one_distance_for_a_sheet():
    """A quarter of the harmonic mean distance over all gathers on the sheet, in whatever block of pixels they are: of
    10 gathers at 1 m and 30 at 4 m, 40 / (10 / 1 + 30 / 4) m. Where nothing is known everything is far."""
    sheets = 3
    cells = cells_of(
        key=(0 * sheets + 1, 5 * sheets + 1, 5 * sheets + 2), closeness=(1.0, 0.25, 0.5), count=(10, 30, 7)
    )
    splitting = Splitting(dark_sheets(sheets), cells, np.zeros(0, np.int32), np.zeros(0), 1.0)
    near, alone, together = plan_looking(splitting, 1.0, 30)
    assert near.dtype == np.float32 and near[0] > 1e20
    assert np.all(alone >= _FEWEST) and np.all(together >= alone)
    np.testing.assert_allclose(near[1:], np.multiply(_ALONE, (40 / 17.5, 2.0)), rtol=1e-6)
