# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: mean and standard error over passes are those of numpy, and do not care how passes are spread."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver import Camera, Film
from addon.solver.geometry.eye import build_eye, eye_rays
from addon.solver.physics.spectrum import apparent_temperature, band_radiance
from addon.solver.sampling.rng import CAMERA, pass_key

EDGES = np.array([8.0, 9.0, 11.0, 14.0])
WIDTH, HEIGHT = 5, 3
REFERENCE = 290.0
BLACK = band_radiance(EDGES, REFERENCE)
NOTHING = np.zeros(HEIGHT * WIDTH, np.float32)  # seen directly


def random_passes(count, spread=0.05, mean=0.1, seed=1):
    """Excess radiance (count, pixels, bands) float32, correlated between bands as photons are."""
    rng = np.random.default_rng(seed)
    common = rng.normal(size=(count, HEIGHT * WIDTH, 1))
    return (BLACK * (mean + spread * (common + 0.3 * rng.normal(size=(count, HEIGHT * WIDTH, 3))))).astype(np.float32)


def film_of(passes, reference=REFERENCE, seed=0, first=0):
    film = Film(WIDTH, HEIGHT, EDGES, reference, seed, first)
    for excess in passes:
        film.add_pass(excess, NOTHING, 1000)
    return film


def spread(values):
    """(pixels,) in which each value is spread evenly over its pixel and those around, two on each side."""
    total = np.zeros((HEIGHT, WIDTH))
    for pixel, value in enumerate(values):
        y, x = divmod(pixel, WIDTH)
        around = total[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
        around += value / around.size
    return total.ravel()


def pooled(total):
    """(pixels,) variance of passes (n, pixels), of which two events share out half: see addon.solver.image.pooling."""
    squares, fourths = (np.sum((total - total.mean(axis=0)) ** power, axis=0) for power in (2, 4))
    share = 2 / (squares**2 / fourths + 2)
    return (squares * (1 - share) + spread(squares * share)) / (len(total) - 1)


def expected_radiance(passes, reference=REFERENCE):
    """Mean and standard error (pixels,) of the radiance over all bands, by numpy."""
    total = passes.sum(axis=2, dtype=np.float64)
    error = np.sqrt(pooled(total) / len(passes))
    return total.mean(axis=0) + band_radiance(EDGES, reference).sum(), error


ROUNDING = 1.3e-7  # the image and the reference in it are rounded to float32, 6e-8 each


def image(values):
    return np.asarray(values).reshape(HEIGHT, WIDTH)


@pytest.mark.parametrize("count", [1, 2, 3, 100])
def test_images_are_means_over_the_passes(count):
    passes = random_passes(count)
    film = film_of(passes)
    assert (film.passes, film.photons, film.width, film.height) == (count, 1000 * count, WIDTH, HEIGHT)
    mean = passes.mean(axis=0, dtype=np.float64) + BLACK
    for band in range(3):
        expected = mean[:, band] / (EDGES[band + 1] - EDGES[band])
        np.testing.assert_allclose(film.band_radiance(band), image(expected), rtol=ROUNDING)
    np.testing.assert_allclose(film.radiance(), image(mean.sum(axis=1)), rtol=ROUNDING)
    np.testing.assert_allclose(film.temperature(), image(apparent_temperature(mean.sum(axis=1), EDGES)), rtol=ROUNDING)
    assert {film.radiance().dtype, film.temperature().dtype, film.band_radiance(0).dtype} == {np.dtype(np.float32)}


def test_band_radiances_add_up_to_the_radiance():
    film = film_of(random_passes(4))
    total = sum(film.band_radiance(band) * np.float32(EDGES[band + 1] - EDGES[band]) for band in range(3))
    np.testing.assert_allclose(total, film.radiance(), rtol=1e-6)


def test_rows_go_up_and_columns_right():
    excess = np.arange(HEIGHT * WIDTH * 3, dtype=np.float32).reshape(-1, 3)
    film = film_of([excess], reference=0.0)
    assert film.radiance().shape == (HEIGHT, WIDTH)
    assert film.radiance()[2, 1] == excess[2 * WIDTH + 1].sum()


@pytest.mark.parametrize("count", [2, 3, 50])
def test_noise_is_the_standard_error_of_the_temperature(count):
    passes = random_passes(count)
    mean, error = expected_radiance(passes)
    half = 0.5 * (apparent_temperature(mean + error, EDGES) - apparent_temperature(mean - error, EDGES))
    np.testing.assert_allclose(film_of(passes).noise(), image(half), rtol=1e-5)


def test_noise_is_that_of_small_errors():
    """For small errors the noise is error / (dL / dT), to second order in the error."""
    passes = random_passes(10, spread=0.003)
    mean, error = expected_radiance(passes)
    temperature = apparent_temperature(mean, EDGES)
    slope = band_radiance(EDGES, temperature, derivative=True).sum(axis=1) / temperature
    np.testing.assert_allclose(film_of(passes).noise(), image(error / slope), rtol=1e-4)


def test_noise_falls_with_the_root_of_the_passes():
    passes = random_passes(1600)
    ratio = film_of(passes[:100]).noise().mean() / film_of(passes).noise().mean()
    # the standard deviation of 100 passes is known to 1 / sqrt(200), on 15 pixels to 1.8 %
    assert ratio == pytest.approx(4, rel=3 * 0.018)


def test_noise_covers_the_truth():
    """The spread of independent films of few passes is what each says of itself."""
    films = [film_of(random_passes(8, seed=seed)) for seed in range(200)]
    spread = np.std([film.temperature() for film in films], axis=0, ddof=1)
    claimed = np.sqrt(np.mean([film.noise() ** 2 for film in films], axis=0, dtype=np.float64))
    # the standard deviation of 200 films is known to 5 %, on 15 pixels to 1.3 %
    assert np.mean(spread / claimed) == pytest.approx(1, abs=3 * 0.013)


def test_one_pass_knows_nothing_of_its_error():
    film = film_of(random_passes(1))
    assert np.array_equal(film.noise(), film.temperature())


def test_no_pass_shows_the_reference():
    film = film_of([])
    np.testing.assert_allclose(film.temperature(), REFERENCE, rtol=1e-6)
    assert film.passes == 0 and np.all(np.isfinite(film.noise()))


def test_many_passes_with_little_spread_keep_their_digits():
    """Welford's update: the spread is 1e-4 of the mean, a sum of squares in float32 would lose it."""
    passes = random_passes(5000, spread=1e-4, mean=1.0)
    mean, error = expected_radiance(passes)
    half = 0.5 * (apparent_temperature(mean + error, EDGES) - apparent_temperature(mean - error, EDGES))
    film = film_of(passes)
    np.testing.assert_allclose(film.noise(), image(half), rtol=1e-4)
    np.testing.assert_allclose(film.radiance(), image(mean), rtol=ROUNDING)


# What is seen directly


def seen_film(passes, share):
    """Film of passes of which this share of the deviation is seen directly. Neighbours have no say."""
    film = Film(WIDTH, HEIGHT, EDGES, REFERENCE)
    film.estimated[:] = False
    for excess in passes:
        film.add_pass(excess, share * excess.sum(axis=1), 1000)
    return film


@pytest.mark.parametrize("count", [16, 64, 256])
def test_noise_of_what_is_seen_falls_faster(count):
    """As n^-3/4 where the rest falls as n^-1/2 (Mitchell 1996): a ratio of n^-1/4, to the order of 1 / n; 16: 3 %. All
    passes tell of the edge, and deviate alike."""
    passes = (BLACK * (0.1 + 0.05 * (-1.0) ** np.arange(count)[:, None, None])).repeat(HEIGHT * WIDTH, axis=1)
    ratio = seen_film(passes, 1.0).noise() / seen_film(passes, 0.0).noise()
    np.testing.assert_allclose(ratio, count**-0.25, rtol=0.5 / count + 1e-4)


def test_noise_of_both_parts_adds_up_in_squares():
    """Where both deviate alike, half and half, each counts a quarter."""
    passes = random_passes(32, spread=0.003)
    parts = [seen_film(passes, share).noise() for share in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(parts[1] ** 2, (parts[0] ** 2 + parts[2] ** 2) / 4, rtol=1e-3)


@pytest.mark.parametrize(
    "slope, count",
    [(slope, count) for slope in (0.6, 1.0, 2.3, 7.0) for count in (8, 32, 128)],
)
def test_noise_of_an_edge_is_its_error(slope, count):
    """An edge across many pixels, each with samples of its own: the root mean square of true over stated error.

    400 pixels know it to 1 / sqrt(800), 4 %; 15 % more for an edge that ends in some of the pixels.
    """
    pixels = 400
    camera = Camera(pixels, 1, np.eye(4), "ORTHOGRAPHIC", frame=(0.0, pixels, 0.0, 1.0))
    eye, film = build_eye(camera, np.zeros(3), np.inf), Film(pixels, 1, EDGES, 0.0)
    middle = np.random.default_rng(8).uniform(0.25, 0.75, pixels)  # where the edge crosses half the height
    samples = np.full(pixels, 16, np.uint16)
    origin, direction = np.empty((2, samples.sum(), 3), np.float32)
    reach = np.empty(samples.sum(), np.float32)
    for index in range(count):
        eye_rays(eye, pass_key(3, 0, CAMERA), index, samples, np.arange(pixels), origin, direction, reach)
        x, y = origin.reshape(pixels, samples[0], 3).transpose(2, 0, 1)[:2]
        behind = (x - np.arange(pixels)[:, None] - middle[:, None]) * slope < y - 0.5
        excess = (BLACK * (1.0 + 0.1 * behind.mean(axis=1, keepdims=True))).astype(np.float32)
        film.add_pass(excess, excess.sum(axis=1), 0)
    y = (np.arange(100_000) + 0.5) / 100_000
    area = np.array([np.clip(m + (y - 0.5) / slope, 0.0, 1.0).mean() for m in middle])
    truth = apparent_temperature(BLACK.sum() * (1.0 + 0.1 * area), EDGES)
    error = np.sqrt(np.mean((film.temperature()[0] - truth) ** 2))
    stated = np.sqrt(np.mean(film.noise() ** 2, dtype=float))
    print(f"{error / stated:.3f}")
    assert error < (1 + 3 * 0.04 + 0.15) * stated
    assert error > 0.4 * stated  # smaller is better than said


# Merging


@pytest.mark.parametrize("parts", [(7, 13), (1, 19), (0, 20), (20, 0), (5, 5, 5, 5)])
def test_merged_films_are_the_film_of_all_passes(parts):
    passes = random_passes(20)
    whole = film_of(passes)
    merged, start = film_of([]), 0
    for size in parts:
        merged = merged.merge(film_of(passes[start : start + size], first=start))
        start += size
    assert (merged.passes, merged.photons) == (whole.passes, whole.photons)
    for name in ("radiance", "temperature", "noise"):
        np.testing.assert_allclose(getattr(merged, name)(), getattr(whole, name)(), rtol=1e-6)
    for band in range(3):
        np.testing.assert_allclose(merged.band_radiance(band), whole.band_radiance(band), rtol=1e-6)


def test_merged_films_know_what_was_seen():
    """The noise of both parts is that of all passes in one film."""
    rng = np.random.default_rng(9)
    passes = random_passes(20)
    seen = (passes.sum(axis=2) * rng.random((20, HEIGHT * WIDTH))).astype(np.float32)
    films = []
    for first, last in ((0, 20), (0, 7), (7, 20)):
        film = Film(WIDTH, HEIGHT, EDGES, REFERENCE, first_pass=first)
        for i in range(first, last):
            film.add_pass(passes[i], seen[i], 1000)
        films.append(film)
    np.testing.assert_allclose(films[1].merge(films[2]).noise(), films[0].noise(), rtol=1e-6)


def test_merging_leaves_both_as_they_were():
    first, second = film_of(random_passes(3)), film_of(random_passes(4, seed=2), seed=2)
    before = first.radiance(), second.noise()
    first.merge(second)
    assert np.array_equal(first.radiance(), before[0]) and np.array_equal(second.noise(), before[1])
    assert (first.passes, second.passes) == (3, 4)


def test_merging_commutes():
    first, second = film_of(random_passes(3)), film_of(random_passes(4, seed=2), seed=2)
    np.testing.assert_allclose(first.merge(second).noise(), second.merge(first).noise(), rtol=1e-6)


def test_empty_films_merge():
    assert film_of([]).merge(film_of([])).passes == 0


def test_a_pass_cannot_be_merged_twice():
    """Not even in part, nor after other merges; passes of another seed are others."""
    passes = random_passes(10)
    film = film_of(passes[:2]).merge(film_of(passes[6:], first=6))
    assert film.ranges == [(0, 0, 2), (0, 6, 10)]
    for other in (film, film_of(passes[:1]), film_of(passes[1:3], first=1), film_of(passes[5:7], first=5)):
        for pair in ((film, other), (other, film)):
            with pytest.raises(ValueError, match=r"hold pass \d of seed 0"):
                pair[0].merge(pair[1])
    whole = film.merge(film_of(passes[2:6], first=2))
    assert whole.ranges == [(0, 0, 10)]
    assert whole.merge(film_of(passes, seed=1)).ranges == [(0, 0, 10), (1, 0, 10)]


@pytest.mark.parametrize(
    "other, message",
    [
        (Film(WIDTH, HEIGHT + 1, EDGES, REFERENCE), "size"),
        (Film(HEIGHT, WIDTH, EDGES, REFERENCE), "size"),
        (Film(WIDTH, HEIGHT, EDGES + 0.1, REFERENCE), "bands"),
        (Film(WIDTH, HEIGHT, EDGES[:3], REFERENCE), "bands"),
        (Film(WIDTH, HEIGHT, EDGES, 291.0), "290 K and 291 K"),
    ],
)
def test_films_of_different_images_do_not_merge(other, message):
    with pytest.raises(ValueError, match=message):
        film_of([]).merge(other)


def test_films_that_follow_other_numbers_do_not_merge():
    """Both of a scene that moves, one of them with molecules: passes tell of more numbers there."""
    films = film_of([]), film_of([])
    for film, numbers in zip(films, (4, 6), strict=True):
        film.moments = 8
        film.follow(np.zeros(numbers))
    with pytest.raises(ValueError, match="with and without molecules"):
        films[0].merge(films[1])


# Robustness


def test_memory_does_not_grow_with_the_passes():
    passes = random_passes(1)[0]
    film = film_of([passes])
    size = len(pickle.dumps(film))
    for _ in range(3000):
        film.add_pass(passes, NOTHING, 1000)
    assert len(pickle.dumps(film)) - size < 16  # bytes: the counters have more digits


def test_negative_radiance_has_no_temperature():
    """A noisy pixel of a cold scene: no NaN, 0 K, and a noise that says how far it may be from that."""
    passes = random_passes(10, spread=0.5, mean=-3.0)
    film = film_of(passes)
    assert np.all(film.radiance() < 0)
    assert np.all(film.temperature() == 0)
    assert np.all(np.isfinite(film.noise())) and np.all(film.noise() >= 0)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.floats(-(2.0**100), 2.0**100, width=32), min_size=1, max_size=6), st.sampled_from([0.0, 3.0, 290.0]))
def test_no_nan_from_any_finite_pass(values, reference):
    film = film_of([np.full((HEIGHT * WIDTH, 3), value, np.float32) for value in values], reference)
    for result in (film.radiance(), film.temperature(), film.noise(), film.band_radiance(1)):
        assert np.all(np.isfinite(result))
    assert np.all(film.temperature() >= 0) and np.all(film.noise() >= 0)


def test_equal_passes_have_no_noise():
    assert np.all(film_of([random_passes(1)[0]] * 7).noise() == pytest.approx(0, abs=1e-6))
