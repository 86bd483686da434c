# SPDX-License-Identifier: GPL-3.0-or-later
"""The choice between photons and rays is the one that lowers noise times time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.splitting import (
    _EQUAL,
    _FEWEST,
    _GATHER,
    _LEAST_CHANCE,
    _MOST,
    _RECALL,
    _SHARING,
    _STRATIFIED,
    Splitting,
    rays_beside,
    recall_chance,
)

noises = st.floats(1e-12, 1e12)


@settings(deadline=None)  # the first call compiles
@given(
    noises,
    noises,
    st.floats(1e-12, 1e12),
    st.floats(1e-3, 1.0),
    st.floats(1e-6, 1e3),
    st.floats(0.01, 1.0),
    st.floats(0.0, 4000.0),
)
def test_the_cheapest_is_chosen(photon_noise, ray_noise, price, carried, free2, shrink2, gathers):
    """Variance and its price in time together, over photons and every number of rays. The number that is best is
    rounded to a power of two: by half an octave, which costs (x + 1 / x) / 2 - 1 < 6.1 %, x = 2^(1/2).
    """
    tables = [np.full(1, value, np.float32) for value in (1e4, photon_noise, ray_noise, 1e9, gathers, 0.0, 0.0)]
    splitting = Splitting(*tables, price)
    rays, variance = rays_beside(splitting, 0, carried, free2, 50, shrink2)
    area = min(math.pi * free2, 50 / 1e4) * shrink2
    by_photons = carried**2 * float(tables[1][0]) / area + price * _GATHER
    ray = _STRATIFIED * carried**2 * float(tables[2][0]) / max(1.0, _EQUAL * _SHARING * area * float(tables[4][0]))
    by_rays = {n: ray / n + price * n for n in range(_FEWEST, _MOST + 1)}
    spent = variance + price * (rays or _GATHER)
    assert spent <= 1.061 * min(by_photons, *by_rays.values())
    assert spent == pytest.approx(by_rays[rays] if rays else by_photons, rel=1e-5)


@settings(deadline=None)
@given(st.floats(1e-6, 1e6), st.floats(1e-12, 1e12), st.floats(1e-6, 1.0))
def test_roulette_on_recalls_is_as_strict_as_pays(recalled, price, carried):
    """Variance that roulette adds and the price of the recalls that are made, together, over all chances allowed."""
    splitting = Splitting(*np.zeros((6, 1), np.float32), np.full(1, recalled, np.float32), price)
    brings = carried * float(splitting.recalled[0])
    chances = np.append(np.linspace(_LEAST_CHANCE, 1.0, 100), recall_chance(splitting, 0, carried))
    spent = brings**2 * (1 / chances - 1) + price * _RECALL * chances
    assert spent[-1] <= spent.min() * (1 + 1e-9) + 1e-12 * brings**2
