# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice between photons and rays is the one that lowers noise times time."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.planning.sheets import FALL, dark_sheets
from addon.solver.planning.splitting import (
    _EQUAL,
    _EQUAL_MOST,
    _FEWEST,
    _GATHER,
    _LEAST_CHANCE,
    _MOST,
    _RECALL,
    _SHARING,
    NEAR,
    Splitting,
    Spread,
    gather_chance,
    rays_beside,
    recall_chance,
)
from addon.solver.planning.survey import Cells

noises = st.floats(1e-12, 1e12)


def splitting_of(price, **sheet):
    """On one sheet, which has these values."""
    known = {name: np.full(1, value) for name, value in sheet.items() if name != "evenness"}
    sheets = dark_sheets(1)._replace(**sheet | known)
    cells = Cells(np.zeros(0, np.int64), *np.zeros((5, 0)), np.zeros(0, np.int64), np.zeros(0))
    return Splitting(sheets, cells, np.zeros(0, np.int32), np.zeros(0), price)


class Disk(NamedTuple):
    """Where a pixel gathers: the share of its light that this brings, the free disk, and how far disks have shrunk."""

    contribution: float
    free2: float
    shrink2: float


spreads = st.builds(Spread, st.floats(0.1, 10.0), noises, st.floats(1e-2, 1e2), st.floats(0.0, 4000.0))
disks = st.builds(Disk, st.floats(1e-3, 1.0), st.floats(1e-6, 1e3), st.floats(0.01, 1.0))


@settings(deadline=None)  # the first call compiles
@given(noises, st.floats(1e-12, 1e12), spreads, disks)
def test_the_cheapest_is_chosen(photon_noise, price, spread, disk):
    """Variance and its price in time together, over photons and every number of rays. The number that is best is
    rounded to a power of two: by half an octave, x = 2^(1/2) or its inverse, which costs (x^-FALL / FALL + x) / (1 /
    FALL + 1) - 1 < 7.9 %.
    """
    splitting = splitting_of(price, density=1e4, photon_noise=photon_noise, span=1e9, evenness=2.0)
    (bright, ray_noise, closeness, density), (contribution, free2, shrink2) = spread, disk
    rays, variance = rays_beside(splitting, 0, spread, contribution, free2, 50, shrink2)
    area = min(math.pi * free2, 50 / (bright * 1e4)) * shrink2
    by_photons = contribution**2 * bright * photon_noise / area + price * _GATHER
    shared = min(_SHARING * area, math.pi * (NEAR / closeness) ** 2 * shrink2)
    ray = 2.0 * contribution**2 * ray_noise / max(1.0, min(_EQUAL_MOST, _EQUAL * density * shared))
    by_rays = {n: ray * n**-FALL + price * n for n in range(_FEWEST, _MOST + 1)}
    spent = variance + price * (rays or _GATHER)
    assert spent <= 1.079 * min(by_photons, *by_rays.values())
    assert spent == pytest.approx(by_rays[rays] if rays else by_photons, rel=1e-5)


@settings(deadline=None)
@pytest.mark.parametrize("chance, time", [(recall_chance, _RECALL), (gather_chance, _GATHER)])
@given(st.floats(1e-6, 1e6), st.floats(1e-12, 1e12), st.floats(1e-6, 1.0))
def test_roulette_at_the_ends_of_rays_is_as_strict_as_pays(chance, time, recalled, price, throughput):
    """Variance that roulette adds and the price of what is done, together, over all chances allowed."""
    splitting = splitting_of(price, reflected=0.6 * recalled, photon_noise=(0.8 * recalled) ** 2, disk=1.0)
    brings = throughput * recalled
    chances = np.append(np.linspace(_LEAST_CHANCE, 1.0, 100), chance(splitting, 0, throughput))
    spent = brings**2 * (1 / chances - 1) + price * time * chances
    assert spent[-1] <= spent.min() * (1 + 1e-9) + 1e-12 * brings**2
