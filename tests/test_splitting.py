# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of rays and the roulette at their ends are those that lower noise times time."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.planning.sheets import dark_sheets
from addon.solver.planning.splitting import (
    _ALONE,
    _END,
    _EQUAL,
    _EQUAL_MOST,
    _FEWEST,
    _GATHER,
    _LEAST_CHANCE,
    _LITTLE,
    _RECALL,
    _SHARING,
    NEAR,
    Splitting,
    Spread,
    choose_rays,
    end_chance,
    plan_looking,
    recall_chance,
)
from addon.solver.planning.survey import Cells
from addon.solver.sampling.low_discrepancy import LATTICES

noises = st.floats(1e-12, 1e12)


def splitting_of(price, **sheet):
    """On one sheet, which has these values."""
    known = {name: np.full(1, value) for name, value in sheet.items() if name not in ("evenness", "fall")}
    sheets = dark_sheets(1)._replace(**sheet | known)
    return Splitting(sheets, cells_of(), np.zeros(0, np.int32), np.zeros(0), price)


def cells_of(key=(), closeness=(), count=()):
    """Cells with these keys, closenesses and numbers of gathers."""
    empty = np.zeros((6, len(key)))
    cells = Cells(np.array(key, np.int64), *empty, np.array(count, np.int64), np.zeros(len(key)))
    return cells._replace(closeness=np.array(closeness, float))


class Disk(NamedTuple):
    """Where a pixel gathers: the share of its light that this brings, and the part of it that is reflected diffusely;
    the largest disk, and how far disks have shrunk."""

    whole: float
    diffuse: float
    reach2: float
    shrink2: float


spreads = st.builds(
    Spread, st.floats(0.1, 10.0), noises, st.floats(-1e3, 1e3), st.floats(1e-2, 1e2), st.floats(0.0, 4000.0)
)
disks = st.builds(Disk, st.floats(1e-4, 1.0), st.floats(0.01, 1.0), st.floats(1e-6, 1e3), st.floats(0.01, 1.0))


def told_by_photons(square):
    """Values of a sheet for which photons tell a light with this mean square."""
    return {"reflected": 0.6 * math.sqrt(square), "photon_noise": 0.64 * square, "disk": 1.0}


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-12, 1e12), spreads, disks, st.floats(0.0, 1e6))
def test_the_cheapest_is_chosen(price, spread, where, square):
    """Variance and its price in time together, over every number of rays and every chance allowed: the more a gather
    makes up of a pixel the more surely, and 8 rays and surely above 1/32. Fewer than 8 rays share none."""
    splitting = splitting_of(price, density=1e4, span=1e9, evenness=2.0, fall=1.4, **told_by_photons(square))
    (bright, ray_noise, met, closeness, density), (whole, diffuse, reach2, shrink2) = spread, where
    found = choose_rays(splitting, 0, spread, (whole * diffuse, whole), reach2, 50, shrink2)
    area = min(math.pi * reach2, 50 / (bright * 1e4)) * shrink2
    area = min(_SHARING * area, math.pi * (NEAR / closeness) ** 2 * shrink2)
    shared = max(1.0, min(_EQUAL_MOST, _EQUAL * density * area))
    light2, noise = whole**2 * (square + met**2), 2.0 * (whole * diffuse) ** 2 * ray_noise

    def spent(rays, chance):
        left = noise * rays**-1.4 / (shared if rays >= 8 else 1.0)
        variance = left / chance + light2 * (1 / chance - 1)
        return variance + price * chance * (_GATHER + rays), variance

    surely = min(1.0, whole / _LITTLE)
    chances = np.append(np.linspace(surely, 1.0, 100), found[1])
    cost, variance = spent(*found[:2])
    assert found[0] >= 8 * surely and found[1] >= surely
    assert found[2] == pytest.approx(variance, rel=1e-9, abs=1e-9 * light2)
    assert cost <= (1 + 1e-9) * min(spent(rays, chances)[0].min() for rays in LATTICES if rays >= 8 * surely)


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(1e-12, 1e12), st.floats(1e-6, 1.0), st.floats(-1e6, 1e6))
def test_roulette_at_the_ends_of_rays_is_as_strict_as_pays(recalled, price, throughput, met):
    """Variance that roulette adds and the price of what is done, together, over all chances allowed: where the end
    recalls what photons tell, and where it looks for more by shadow rays."""
    splitting = splitting_of(price, met=met, **told_by_photons(recalled**2))
    for choose, light2, time, least in (
        (recall_chance, recalled**2, _RECALL, _LEAST_CHANCE),
        (end_chance, recalled**2 + met**2, _END, min(1.0, throughput / _LITTLE)),
    ):
        brings2 = throughput**2 * light2
        chances = np.append(np.linspace(least, 1.0, 100), choose(splitting, 0, throughput))
        spent = brings2 * (1 / chances - 1) + price * time * chances
        assert spent[-1] <= spent.min() * (1 + 1e-9) + 1e-12 * brings2


def test_what_is_near_is_one_distance_for_a_sheet():
    """A quarter of the harmonic mean distance over all gathers on the sheet, in whatever block of pixels they are: of
    10 gathers at 1 m and 30 at 4 m, 40 / (10 / 1 + 30 / 4) m. Where nothing is known everything is far."""
    sheets = 3
    cells = cells_of(
        key=(0 * sheets + 1, 5 * sheets + 1, 5 * sheets + 2), closeness=(1.0, 0.25, 0.5), count=(10, 30, 7)
    )
    known = dark_sheets(sheets)._replace(disk=np.ones(sheets))
    splitting = Splitting(known, cells, np.zeros(0, np.int32), np.zeros(0), 1.0)
    near, alone, together = plan_looking(splitting, 1.0, 30)
    assert near.dtype == np.float32 and near[0] > 1e20
    assert np.all(alone >= _FEWEST) and np.all(together >= alone)
    np.testing.assert_allclose(near[1:], np.multiply(_ALONE, (40 / 17.5, 2.0)), rtol=1e-6)
