# SPDX-License-Identifier: GPL-3.0-or-later
"""What the image misses where rays recall irradiance: the render finds it, and its noise states it."""

import numpy as np
import pytest

from addon.solver import Settings, render
from addon.solver.image.film import Film
from addon.solver.image.self_check import GRID, region_means, regions, significant
from tests.benchmarks.families import comb
from tests.benchmarks.speed_scenes import SCENES
from tests.helpers.paper_estimator import ALWAYS_RECALL, changed

pytestmark = pytest.mark.once

EDGES = np.array([9.0, 10.0])


@pytest.mark.parametrize(("width", "height"), [(64, 48), (5, 7), (4, 4), (2, 1)])
def test_regions_cover_the_image_evenly(width, height):
    """Rectangles in rows from the bottom. A pixel more or less along each side; none where there are too few pixels."""
    region = regions(width, height).reshape(height, width)
    assert region[0, 0] == 0 and region.min() >= 0 and region.max() < GRID**2
    assert np.all(np.diff(region, axis=1) >= 0) and np.all(np.diff(region, axis=0) >= 0)
    sides = [np.unique(line, return_counts=True)[1] for line in (region[0] % GRID, region[:, 0] // GRID)]
    assert all(np.ptp(side) <= 1 for side in sides)
    values = np.random.default_rng(1).normal(size=(height, width))
    expected = [values[region == i].mean() if np.any(region == i) else 0.0 for i in range(GRID**2)]
    np.testing.assert_allclose(region_means(values.ravel(), region.ravel()), expected, atol=1e-12)


def test_noise_alone_is_seldom_significant():
    """One region in 1.7 million by chance, so none of 1600 but once in 1000."""
    passes, random = 400, np.random.default_rng(3)
    values = random.normal(size=(passes, 100 * GRID**2))
    found = significant(values.mean(axis=0), np.sum((values - values.mean(axis=0)) ** 2, axis=0), passes)
    assert not found.any()


def test_what_is_significant_is_stated():
    """A bias of twenty standard errors in one region, and nothing in the others: Noise grows in that region alone,
    where pixels are noisy, and its root mean square there is at least the bias."""
    width, height, passes, random = 16, 12, 32, np.random.default_rng(4)
    film, region = Film(width, height, EDGES), regions(width, height)
    kinds = np.where(np.arange(width * height) % 3 == 0, 0.0, 0.01).astype(np.float32)  # every third one is exact
    bias = np.where(region == 5, 0.02, 0.0)
    film.estimated[:] = kinds > 0.0
    quiet = Film(width, height, EDGES)
    quiet.estimated[:] = film.estimated
    for _ in range(passes):
        excess = (10.0 + kinds * random.normal(size=len(kinds)).astype(np.float32))[:, None].astype(np.float32)
        missed = (bias + 0.001 * np.sqrt(passes * 12) * random.normal(size=len(kinds))).astype(np.float32)
        nothing = np.zeros(len(kinds), np.float32)
        film.add_pass(excess, nothing, 0, missed)
        quiet.add_pass(excess, nothing, 0)
    stated, without = film.noise().ravel(), quiet.noise().ravel()
    elsewhere = (region != 5) | (kinds == 0.0)
    np.testing.assert_array_equal(stated[elsewhere], without[elsewhere])
    assert np.all(stated[~elsewhere] > 2.0 * without[~elsewhere])
    # kelvin of 1 W m-2 sr-1
    film.correction, slope = quiet.correction, without[~elsewhere].mean()
    variance = quiet._squares / (passes * (passes - 1))
    slope /= np.sqrt(variance[~elsewhere]).mean()
    added = np.sqrt(np.mean(stated[region == 5].astype(float) ** 2 - without[region == 5].astype(float) ** 2)) / slope
    mean, error = film.missed()
    expected = np.sqrt(mean[1, 1] ** 2 - 25.0 * error[1, 1] ** 2)
    # at least: pixels that are noisier than the mean take more than it; and 5 %, as the slope is a mean
    assert 0.95 * expected < added < 1.5 * expected


def test_films_merge_with_their_checks():
    """To rounding: the film of all passes in one go."""
    random = np.random.default_rng(5)
    films = [Film(8, 8, EDGES, seed=i) for i in range(2)]
    whole = Film(8, 8, EDGES, seed=2)
    for i in range(7):
        excess, missed = random.normal(size=(64, 1)).astype(np.float32), random.normal(size=64).astype(np.float32)
        for film in (films[i > 2], whole):
            film.add_pass(excess, np.zeros(64, np.float32), 0, missed)
    merged = films[0].merge(films[1])
    for found, expected in zip(merged.missed(), whole.missed(), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    again = Film.from_state(whole.state())
    np.testing.assert_array_equal(again.missed(), whole.missed())


@pytest.mark.long
def test_it_finds_nothing_where_recalls_are_right():
    """A room, whose walls are far apart: the root mean square of 16 regions, each over its error, is 1, to 4 standard
    errors of that (1 / sqrt(32))."""
    film = render(SCENES["room"](), Settings(passes=16, photons_per_pass=20_000))
    missed, error = film.missed()
    ratio = np.sqrt(np.mean((missed / error) ** 2))
    print("missed over its error", ratio)
    assert ratio < 1.0 + 4.0 / np.sqrt(32)


@pytest.mark.long
def test_it_finds_what_is_recalled_between_plates():
    """Plates 5 mm apart, with disks of photons that are wider: all is recalled, and the image is wrong by what the
    check says. It follows one more step of a path, so it tells all of the error but what the next ends recall: with a
    reflectance of 0.7 of the plates and 0.5 of the base at least the share 1 - 0.7 of it.

    4 standard errors, of the spread of the passes of both images and of the check.
    """
    scene, settings = comb(), Settings(passes=144, photons_per_pass=20_000)
    right = render(scene, settings)
    with changed(ALWAYS_RECALL):
        wrong = render(scene, settings)
    missed, error = wrong.missed()
    region = regions(right.width, right.height)
    short = region_means((right.radiance() - wrong.radiance()).ravel(), region).reshape(GRID, GRID)
    worst = np.unravel_index(np.argmax(np.abs(short)), short.shape)
    print(f"short {short[worst]:.4f}, check {missed[worst]:.4f} +- {error[worst]:.4f}")
    assert abs(missed[worst]) > 4 * error[worst]
    told, uncertain = missed[worst] / short[worst], 4 * error[worst] / abs(short[worst])
    assert 0.3 - uncertain < told < 1.0 + uncertain and uncertain < 0.6
    # the image that goes on there states no such error
    known, its_error = right.missed()
    assert abs(known[worst]) < max(4 * its_error[worst], 0.2 * abs(missed[worst]))
