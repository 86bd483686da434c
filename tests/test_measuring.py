# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring tools without Blender: their pixels against geometry done pixel by pixel, their readings against sums."""

import math

import numpy as np
import pytest

from addon.measuring.correcting import Sensor, corrected, corrected_noise
from addon.measuring.regions import AREAS, FEWEST_POINTS, KINDS, Window, region_of
from addon.measuring.statistics import Histogram, difference, histogram, measure, share_in
from addon.output.temperature_scale import Isotherm
from addon.solver import Correction, Film
from addon.solver.physics.spectrum import band_radiance

WHOLE = Window((17, 11), (0, 0), (11, 17))
BORDER = Window((17, 11), (4, 3), (5, 9))  # a part of the same picture


def pixels(region, shape):
    """{(row, column)} of a region, and that it has each once."""
    flat = np.arange(math.prod(shape)).reshape(shape)
    found = region.values(flat).tolist()
    assert len(set(found)) == len(found)
    assert [region.pixel(i) for i in range(len(found))] == [divmod(each, shape[1]) for each in found]
    return {divmod(each, shape[1]) for each in found}


def inside(kind, points, x, y):
    """Is a place inside the outline? Points in pixels. A polygon by the angle that it winds around the place."""
    (x0, y0), (x1, y1) = np.min(points, axis=0), np.max(points, axis=0)
    if kind == "BOX":
        return x0 <= x < x1 and y0 <= y < y1
    if kind == "ELLIPSE":
        return ((2 * x - x0 - x1) / (x1 - x0)) ** 2 + ((2 * y - y0 - y1) / (y1 - y0)) ** 2 <= 1.0
    angles = [math.atan2(v - y, u - x) for u, v in points]
    turns = [math.remainder(b - a, math.tau) for a, b in zip(angles, [*angles[1:], angles[0]], strict=True)]
    return round(sum(turns) / math.tau) % 2 == 1


def random_points(kind, seed):
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.2 * (seed % 2), 1.0 + 0.2 * (seed % 2), (rng.integers(3, 9) if kind == "POLYGON" else 2, 2))


@pytest.mark.parametrize("window", [WHOLE, BORDER], ids=["whole", "border"])
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("kind", AREAS)
def test_an_area_has_the_pixels_whose_middle_is_inside(kind, seed, window):
    points = random_points(kind, seed)
    region = region_of(kind, points, window)
    places = points * window.size - window.origin
    rows, columns = window.shape
    expected = {(r, c) for r in range(rows) for c in range(columns) if inside(kind, places, c + 0.5, r + 0.5)}
    assert pixels(region, window.shape) == expected


def test_a_whole_picture_is_a_box():
    image = np.random.default_rng(0).random(WHOLE.shape)
    np.testing.assert_array_equal(region_of("BOX", [(1.0, 0.0), (0.0, 1.0)], WHOLE).values(image), image.ravel())


@pytest.mark.parametrize("seed", range(20))
def test_neighbouring_polygons_share_no_pixel_and_leave_none_out(seed):
    """A triangle's three parts about a place in it, at corners and middles of pixels, where rounding could decide."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 2 * np.array(WHOLE.size) + 1, (3, 2)) / (2 * np.array(WHOLE.size))
    middle = corners.mean(axis=0)
    parts = [np.stack((corners[i], corners[i - 1], middle)) for i in range(3)]
    found = [pixels(region_of("POLYGON", part, WHOLE), WHOLE.shape) for part in parts]
    assert sum(map(len, found)) == len(set.union(*found))
    assert set.union(*found) == pixels(region_of("POLYGON", corners, WHOLE), WHOLE.shape)


@pytest.mark.parametrize("seed", range(30))
def test_a_line_has_one_pixel_for_each_step_from_its_start_to_its_end(seed):
    start, end = np.random.default_rng(seed).uniform(0.0, 1.0, (2, 2)) * WHOLE.size
    region = region_of("LINE", np.stack((start, end)) / WHOLE.size, WHOLE)
    listed = [region.pixel(i) for i in range(len(region.values(np.zeros(WHOLE.shape))))]
    first, last = (tuple(map(math.floor, place[::-1])) for place in (start, end))
    steps = np.abs(np.diff(listed, axis=0))
    assert len(listed) == max(abs(last[0] - first[0]), abs(last[1] - first[1])) + 1
    assert (steps.max(axis=1) == 1).all() if len(steps) else True  # beside each other, or at a corner
    for row, column in listed:  # the pixel's middle is within half a diagonal of the line
        middle, along = np.array((column, row)) + 0.5, end - start
        share = np.clip((middle - start) @ along / (along @ along), 0.0, 1.0)
        assert np.linalg.norm(start + share * along - middle) <= math.sqrt(0.5) + 1e-9
    axis = int(np.argmax(np.abs(end - start)))
    assert [listed[0][1 - axis], listed[-1][1 - axis]] == [first[1 - axis], last[1 - axis]]


def test_a_spot_is_the_pixel_that_it_is_in():
    assert pixels(region_of("SPOT", [(4.3 / 17, 5.9 / 11)], WHOLE), WHOLE.shape) == {(5, 4)}
    assert pixels(region_of("SPOT", [(4.3 / 17, 5.9 / 11)], BORDER), BORDER.shape) == {(2, 0)}
    assert pixels(region_of("SPOT", [(3.3 / 17, 5.9 / 11)], BORDER), BORDER.shape) == set()


@pytest.mark.parametrize("kind", KINDS)
def test_an_unfinished_or_senseless_tool_measures_nothing(kind):
    values = np.ones(WHOLE.shape)
    for points in ([], [(0.5, 0.5)] * (FEWEST_POINTS[kind] - 1), [(math.nan, 0.5)] * 4, [(2.0, 2.0), (3.0, 3.0)] * 2):
        assert region_of(kind, points, WHOLE).values(values).size == 0
        assert measure(values, values, region_of(kind, points, WHOLE)) is None


# Readings


def images(seed=0):
    rng = np.random.default_rng(seed)
    temperature = rng.normal(300.0, 10.0, WHOLE.shape).astype(np.float32)
    return temperature, rng.uniform(0.01, 0.2, WHOLE.shape).astype(np.float32)


@pytest.mark.parametrize("kind", AREAS)
def test_readings_are_those_of_the_pixels(kind):
    temperature, noise = images()
    points = [(0.1, 0.2), (0.9, 0.8), (0.2, 0.9)][: 3 if kind == "POLYGON" else 2]
    region = region_of(kind, points, WHOLE)
    chosen = sorted(pixels(region, WHOLE.shape))
    values = [float(temperature[pixel]) for pixel in chosen]
    read = measure(temperature, noise, region, Isotherm(310.0, 295.0, (1.0, 0.0, 0.0)))
    mean = math.fsum(values) / len(values)
    assert (read.minimum, read.maximum, read.count) == (min(values), max(values), len(values))
    assert read.mean == pytest.approx(mean, rel=1e-12)
    deviation = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / len(values))
    assert read.deviation == pytest.approx(deviation, rel=1e-6)  # squares are float32
    assert read.area == len(values) / temperature.size
    assert temperature[read.place_of_minimum] == min(values) and noise[read.place_of_minimum] == read.error_of_minimum
    assert temperature[read.place_of_maximum] == max(values) and noise[read.place_of_maximum] == read.error_of_maximum
    errors = math.fsum(float(noise[pixel]) ** 2 for pixel in chosen)
    assert read.error_of_mean == pytest.approx(math.sqrt(errors) / len(values), rel=1e-6)
    assert read.in_isotherm == sum(295.0 <= v <= 310.0 for v in values) / len(values)


def test_readings_by_hand():
    temperature = np.array([[300.0, 310.0], [320.0, 290.0]], np.float32)
    noise = np.array([[0.3, 0.4], [1.2, 0.0]], np.float32)
    read = measure(temperature, noise, region_of("BOX", [(0.0, 0.0), (1.0, 1.0)], Window((2, 2), (0, 0), (2, 2))))
    assert (read.minimum, read.maximum, read.mean) == (290.0, 320.0, 305.0)
    assert read.deviation == pytest.approx(math.sqrt(125.0))  # deviations of 5, 5, 15 and 15 K
    assert (read.place_of_minimum, read.place_of_maximum, read.count, read.area) == ((1, 1), (1, 0), 4, 1.0)
    assert read.error_of_mean == pytest.approx(1.3 / 4)  # 0.3, 0.4 and 1.2 are the sides of a box of diagonal 1.3
    assert read.in_isotherm is None


def test_the_error_of_a_mean_is_that_of_means_of_noisy_pictures():
    """Of 4000 pictures with the stated noise; the standard deviation of so many is known to 1.1 %, four of which are
    allowed."""
    rng = np.random.default_rng(1)
    temperature, noise = images()
    region = region_of("ELLIPSE", [(0.1, 0.1), (0.9, 0.9)], WHOLE)
    means = [measure(rng.normal(temperature, noise), noise, region).mean for _ in range(4000)]
    assert np.std(means) == pytest.approx(measure(temperature, noise, region).error_of_mean, rel=0.045)


def test_an_unknown_error_stays_unknown():
    """After a single pass the engine gives the temperature itself as error. What shows 0 K has no error."""
    temperature, whole = np.array([[300.0, 0.0]]), region_of("BOX", [(0, 0), (1, 1)], Window((2, 1), (0, 0), (1, 2)))
    read = measure(temperature, temperature, whole)
    assert (read.error_of_minimum, read.error_of_maximum, read.error_of_mean) == (0.0, math.inf, math.inf)


def test_a_difference_is_of_means_and_its_error_of_both():
    temperature, noise = images()
    first, second = (
        measure(temperature, noise, region_of("BOX", points, WHOLE))
        for points in ([(0.0, 0.0), (0.5, 1.0)], [(0.5, 0.0), (1.0, 1.0)])
    )
    assert difference(first, second) == (
        first.mean - second.mean,
        math.sqrt(first.error_of_mean**2 + second.error_of_mean**2),
    )


def test_a_histogram_counts_every_pixel():
    temperature, _ = images()
    counts, edges = histogram(temperature.ravel(), 16)
    assert counts.sum() == temperature.size and len(edges) == 17
    assert (edges[0], edges[-1]) == (temperature.min(), temperature.max())
    assert counts[3] == np.count_nonzero((temperature >= edges[3]) & (temperature < edges[4]))
    assert histogram(np.full(5, 300.0), 4).counts.sum() == 5
    assert isinstance(histogram(np.empty(0)), Histogram) and histogram(np.empty(0)).counts.sum() == 0


def test_both_ends_of_an_isotherm_belong_to_it():
    assert share_in(np.array([1.0, 2.0, 3.0, 4.0]), Isotherm(2.0, 3.0, (0.0, 0.0, 0.0))) == 0.5


# Another correction


EDGES, WEIGHTS = np.array([8.0, 10.0, 14.0]), np.array([0.7, 1.0])
SENSOR = Sensor(EDGES, WEIGHTS)


def film_of(passes, spread=0.2):
    """A film of noisy passes around 300 K, whose last pixels show the cold of a clear sky."""
    film = Film(12, 8, EDGES, 300.0, weights=WEIGHTS)
    rng = np.random.default_rng(3)
    cold = band_radiance(EDGES, 200.0) - band_radiance(EDGES, 300.0)
    for _ in range(passes):
        excess = rng.normal(0.0, spread, (96, 2))
        excess[-12:] += cold
        film.add_pass(excess.astype(np.float32), np.zeros(96, np.float32), 100)
    return film


def of_film(film, correction):
    """(temperature, noise) of a film with a correction."""
    film.correction = correction
    return film.temperature(), film.noise()


CORRECTIONS = Correction(), Correction(0.8, 280.0), Correction(0.5, 310.0)


@pytest.mark.parametrize("before", CORRECTIONS, ids=str)
@pytest.mark.parametrize("after", CORRECTIONS, ids=str)
def test_another_correction_gives_what_a_render_with_it_gives(before, after):
    """Temperatures to the last digits of float32 radiance, whose resolution is 6e-8; 20 to 60 K for a share of 1 of the
    radiance. Noise to its first order: here it is below 0.3 % of the temperature."""
    film = film_of(400)
    old, expected = of_film(film, before), of_film(film, after)
    temperature = corrected(film.radiance(), SENSOR, after)
    np.testing.assert_allclose(temperature, expected[0], atol=1e-4)
    warm = (old[0] > 0.0) & (expected[0] > 0.0)
    noise = corrected_noise(old, temperature, SENSOR, (before, after))
    assert warm.any()
    np.testing.assert_allclose(noise[warm], expected[1][warm], rtol=0.01)
    lost = old[0] == 0.0  # what was seen there is known, but not how well
    np.testing.assert_array_equal(noise[lost], temperature[lost])
    np.testing.assert_array_equal(noise[expected[0] == 0.0], 0.0)


def test_large_pictures_are_corrected_piece_by_piece():
    radiance = np.random.default_rng(0).uniform(20.0, 60.0, (300, 500)).astype(np.float32)
    whole = corrected(radiance, SENSOR, Correction(0.8, 280.0))
    rows = [corrected(row, SENSOR, Correction(0.8, 280.0)) for row in radiance]
    np.testing.assert_array_equal(whole, rows)


def test_an_unknown_error_stays_unknown_with_another_correction():
    film = film_of(1)
    old = of_film(film, Correction())
    temperature = corrected(film.radiance(), SENSOR, Correction(0.9, 290.0))
    changes = Correction(), Correction(0.9, 290.0)
    np.testing.assert_array_equal(corrected_noise(old, temperature, SENSOR, changes), temperature)
