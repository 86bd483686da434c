# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes with ever smaller disks tell of their blur."""

import numpy as np
import pytest

from addon.solver.image.film import Film
from addon.solver.image.regression import Regression
from addon.solver.image.trend import blur, shrink_factor

EDGES = np.array([8.0, 12.0])
SIZE, PASSES = 24, 64
INDEPENDENT = (81.0 / 19.0) ** 2  # pixels: neighbours weigh 1, 2, 3, 2, 1 over 9 along both axes


def film_of(values, areas, first=0):
    """A Film of passes of values (passes, SIZE^2)."""
    film = Film(SIZE, SIZE, EDGES, 300.0, first_pass=first)
    film.follow_disks()
    for row, area in zip(values, areas, strict=True):
        film.add_pass(row[:, None].astype(np.float32), np.zeros(SIZE**2, np.float32), 0, area=area)
    return film


@pytest.fixture(scope="module")
def areas():
    return np.array([shrink_factor(i) for i in range(PASSES)])


def white(seed, passes=PASSES):
    return 10.0 + np.random.default_rng(seed).normal(size=(passes, SIZE**2))


def test_disks_shrink_as_progressive_photon_mapping_asks():
    """The product of (i + a) / (i + 1), a = 2/3 (Knaus and Zwicker 2011)."""
    product = np.cumprod([1.0, *((i + 2 / 3) / (i + 1) for i in range(1, 40))])
    np.testing.assert_allclose([shrink_factor(i) for i in range(40)], product, rtol=1e-12)


@pytest.mark.parametrize("slope", [1.0, -2.0])
def test_blur_is_stated(areas, slope):
    """A pixel that is off by slope times the area states, on top of its noise, the mean of that over its passes. Of
    400 pixels the pooled square is known to 1 %, less what noise is allowed."""
    values = white(1) + slope * areas[:, None]
    film, sharp = film_of(values, areas), film_of(white(1), areas)
    squares = film.noise()[2:-2, 2:-2].astype(float) ** 2 / sharp.noise()[2:-2, 2:-2].astype(float) ** 2 - 1.0
    bias, variance = slope * areas.mean(), 1.0 / PASSES
    by_noise = areas.mean() ** 2 / np.sum((areas - areas.mean()) ** 2)
    allowed = 2.0 * np.sqrt(2.0 / INDEPENDENT) * by_noise
    expected = (bias**2 - allowed) / variance
    # each of 400 pixels is of variance 2 v^2 + 4 b^2 v
    error = np.sqrt((2 * by_noise**2 + 4 * bias**2 * by_noise) / 400) / variance
    assert abs(squares.mean() - expected) < 4 * error + 0.02 * expected


def test_noise_alone_is_hardly_blur(areas):
    """What is stated beyond two standard errors is that of a chi-squared law of as many degrees as windows have
    independent pixels; 8 films of 576 pixels are 250 such windows, of which few count: known to a third."""
    states = [film_of(white(seed), areas) for seed in range(8)]
    even = [film_of(white(seed), np.ones(PASSES)) for seed in range(8)]
    ratio = np.array([a.noise() ** 2 / b.noise() ** 2 for a, b in zip(states, even, strict=True)])[:, 2:-2, 2:-2]
    squares = np.random.default_rng(9).chisquare(INDEPENDENT, 1_000_000) / INDEPENDENT
    beyond = np.maximum(squares - 1.0 - 2.0 * np.sqrt(2.0 / INDEPENDENT), 0.0).mean()
    expected = beyond * areas.mean() ** 2 / np.sum((areas - areas.mean()) ** 2) * PASSES
    assert abs(ratio.mean() - 1.0 - expected) < expected


def test_equal_disks_blur_nothing():
    areas = Regression(16, np.zeros(1))
    for i in range(8):
        areas.add(np.arange(16.0) * i, np.ones(1))
    assert not blur(areas, np.ones((4, 4))).any()


def test_two_passes_tell_nothing_of_blur(areas):
    """Any two points lie on a line."""
    film, even = film_of(white(3, 2), areas[:2]), film_of(white(3, 2), np.ones(2))
    np.testing.assert_allclose(film.noise(), even.noise(), rtol=1e-6)


@pytest.mark.parametrize("first, count", [(0, 15), (100, 25), (1000, 300)])
def test_passes_with_disks_alike_tell_nothing_of_blur(first, count):
    """Fewer than the first 16, or late ones alone: to what disks of no size show is too far from all of theirs."""
    areas = np.array([shrink_factor(first + i) for i in range(count)])
    values = white(2, count) + 3.0 * areas[:, None]
    sharp = film_of(values, np.ones(count))
    np.testing.assert_array_equal(film_of(values, areas, first).noise(), sharp.noise())


def test_parts_of_a_render_tell_the_same(areas):
    values = white(4) + 2.0 * areas[:, None]
    whole = film_of(values, areas)
    parts = [film_of(values[a:b], areas[a:b], a) for a, b in ((0, 9), (9, 10), (10, PASSES))]
    joined = parts[2].merge(parts[0]).merge(parts[1])
    np.testing.assert_allclose(joined.noise(), whole.noise(), rtol=1e-5)
    kept = Film.from_state(joined.state())
    assert np.array_equal(kept.noise(), joined.noise())
