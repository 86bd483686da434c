# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera's optics and detector make of finished images, against optics, radiometry and statistics."""

import dataclasses

import numpy as np
import pytest
from scipy import integrate, special

from addon.solver import Camera, Correction, SceneError
from addon.solver.image.detector import STATED, Detector, expose
from addon.solver.physics import sensors
from addon.solver.physics.spectrum import apparent_temperature, band_radiance, sensor_radiance, uniform_edges

EDGES = uniform_edges(7.5, 14.0, 4)
WIDTHS = np.diff(EDGES)
WEIGHTS = sensors.band_weights(sensors.microbolometer(), EDGES)
ROUNDING = 2.0**-22  # of a few float32 results
TEN = np.array([9.95, 10.05])  # um, one band
FLAT = np.ones(1)
PIXELS = 160


def blackbody(kelvin):
    """(b, h, w) image of blackbodies, W m-2 sr-1 um-1. kelvin: (h, w)."""
    return np.moveaxis(band_radiance(EDGES, kelvin) / WIDTHS, -1, 0).astype(np.float32)


def uniform(kelvin=300.0):
    return blackbody(np.full((PIXELS, PIXELS), kelvin))


def photograph(image, detector, edges=EDGES, weights=WEIGHTS, **options):
    height, width = image[0].shape
    return expose(image, edges, weights, detector, Camera(width=width, height=height), **options)


def blurred(image, detector):
    """A single band at 10 um through the optics, (h, w) in the image's unit."""
    return photograph([image], detector, TEN, FLAT).signal / np.diff(TEN)


# Nothing is asked for


def test_an_ideal_camera_changes_nothing():
    kelvin = np.linspace(200.0, 400.0, 12).reshape(3, 4)
    signal, temperature, clipped = photograph(blackbody(kelvin), Detector())
    np.testing.assert_allclose(signal, sensor_radiance(EDGES, WEIGHTS, kelvin), rtol=ROUNDING)
    np.testing.assert_allclose(temperature, kelvin, rtol=ROUNDING)
    assert clipped == 0 and signal.dtype == temperature.dtype == np.float32


def test_temperatures_are_corrected_as_the_films_are():
    correction = Correction(0.8, 280.0)
    seen = 0.8 * blackbody(np.full((2, 2), 330.0)) + 0.2 * blackbody(np.full((2, 2), 280.0))
    temperature = photograph(seen, Detector(), correction=correction).temperature
    np.testing.assert_allclose(temperature, 330.0, rtol=ROUNDING)


# Optics


def overlap(v):
    """Area that two unit disks at a distance 2 v share, over their area: the transfer of a circular aperture."""
    return 4.0 / np.pi * integrate.quad(lambda t: np.sqrt(1.0 - t * t), v, 1.0)[0] if v < 1.0 else 0.0


@pytest.mark.parametrize("f_number", [0.7, 1.0, 2.5])
def test_waves_lose_the_contrast_that_the_aperture_takes(f_number):
    """Waves along x, y and both, of 1 to 24 half waves over the image; one is beyond the cutoff of f/2.5."""
    pitch, (height, width) = (12.0, 15.0), (20, 24)
    detector = Detector(f_number=f_number, pitch=pitch)
    for i, j in ((0, 1), (0, 12), (0, 23), (5, 0), (19, 0), (9, 7)):
        along_x = np.cos(np.pi * j * (np.arange(width) + 0.5) / width)
        wave = np.cos(np.pi * i * (np.arange(height) + 0.5) / height)[:, None] * along_x
        frequency = np.hypot(0.5 * j / width / pitch[0], 0.5 * i / height / pitch[1])  # cycles/um
        contrast = overlap(10.0 * f_number * frequency)
        np.testing.assert_allclose(blurred(1.0 + 0.5 * wave, detector), 1.0 + 0.5 * contrast * wave, rtol=1e-6)


def test_a_point_is_an_airy_pattern():
    """Encircled energy 1 - J0^2 - J1^2 (Rayleigh), 83.8 % within the first dark ring at 1.22 lambda N.

    Pixels of a twelfth of lambda N: the sums over pixels miss an edge of half a pixel at most, where the pattern is
    dark or faint: 0.5 %.
    """
    size, scale = 257, 12.0
    point = np.zeros((size, size))
    point[size // 2, size // 2] = 1.0
    pattern = blurred(point, Detector(f_number=1.2, pitch=(1.0, 1.0)))
    distance = np.hypot(*(np.mgrid[:size, :size] - size // 2))
    for dark in (1.2197, 2.2331):
        x = np.pi * dark
        expected = 1.0 - special.j0(x) ** 2 - special.j1(x) ** 2
        assert pattern[distance <= dark * scale].sum() == pytest.approx(expected, abs=5e-3)
    assert 1.0 - special.j0(np.pi * 1.2197) ** 2 == pytest.approx(0.838, abs=5e-4)
    assert pattern.sum() == pytest.approx(1.0, rel=1e-6)


def test_longer_waves_blur_more():
    edge = np.repeat([[0.0, 1.0]], 20, axis=1)
    steps = [
        np.diff(photograph([edge], Detector(f_number=1.0), np.array([um - 0.1, um + 0.1]), FLAT).signal[0]).max()
        for um in (4.0, 8.0, 12.0)
    ]
    assert steps[0] > 1.1 * steps[1] > 1.2 * steps[2]


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (6, 1), (5, 8)])
def test_a_uniform_image_stays_uniform(shape):
    image = blackbody(np.full(shape, 310.0))
    optics = photograph(image, Detector(f_number=1.4, fill_factor=0.6))
    np.testing.assert_allclose(optics.signal, photograph(image, Detector()).signal, rtol=ROUNDING)


def test_nothing_comes_in_from_the_opposite_edge():
    """The image goes on as its mirror image: it is the half of an image that shows both."""
    image = np.random.default_rng(1).random((9, 14))
    detector = Detector(f_number=3.0)
    both = np.concatenate((image, image[:, ::-1]), axis=1)
    np.testing.assert_allclose(blurred(image, detector), blurred(both, detector)[:, :14], rtol=1e-6)
    assert blurred(image, detector).mean() == pytest.approx(image.mean(), rel=1e-6)  # no energy is lost


def test_the_pixels_own_area_counts_once():
    """A full fill factor is in the image already; a smaller one sharpens what the aperture blurs, and nothing else."""
    wave = np.cos(np.pi * 11 * (np.arange(20) + 0.5) / 20)[None]
    full, half = (
        (blurred(1.0 + 0.5 * wave, Detector(f_number=1.0, fill_factor=factor)) - 1.0)[0, 0] / (0.5 * wave[0, 0])
        for factor in (1.0, 0.5)
    )
    frequency = 11 / 40  # cycles a pixel
    assert full == pytest.approx(overlap(10.0 / 12.0 * frequency), rel=1e-5)
    assert half / full == pytest.approx(np.sinc(np.sqrt(0.5) * frequency) / np.sinc(frequency), rel=1e-5)
    sharp = Detector(f_number=0.05, fill_factor=0.1)
    np.testing.assert_allclose(blurred(1.0 + 0.5 * wave, sharp), 1.0 + 0.5 * wave, rtol=1e-6)
    np.testing.assert_array_equal(
        blurred(1.0 + 0.5 * wave, Detector(fill_factor=0.1)), blurred(1.0 + 0.5 * wave, Detector())
    )


# Noise: of n normal numbers the standard deviation errs by 1 / sqrt(2 n) of itself; four of these are allowed

SPREAD = 4.0 / np.sqrt(2.0 * PIXELS**2)


def test_the_noise_is_the_netd():
    temperature = photograph(uniform(), Detector(netd=0.08)).temperature.astype(float)
    assert temperature.std() == pytest.approx(0.08, rel=SPREAD)
    assert temperature.mean() == pytest.approx(300.0, abs=4.0 * 0.08 / PIXELS)


@pytest.mark.parametrize("photon_noise", [False, True])
def test_hotter_pixels_have_the_same_noise_or_that_of_more_photons(photon_noise):
    detector = Detector(netd=0.08, photon_noise=photon_noise)
    noise = [photograph(uniform(kelvin), detector).signal.std(dtype=float) for kelvin in (300.0, 400.0)]
    cold, hot = sensor_radiance(EDGES, WEIGHTS, np.array([300.0, 400.0]))
    assert noise[1] / noise[0] == pytest.approx(np.sqrt(hot / cold) if photon_noise else 1.0, rel=1e-4)


def test_every_frame_has_its_noise_and_every_camera():
    images = [
        photograph(uniform(), Detector(netd=0.05, seed=seed), frame=frame).signal.astype(float)
        for seed, frame in ((0, 0), (0, 1), (1, 0), (0, -1))
    ]
    correlation = np.corrcoef([image.ravel() for image in images])
    assert np.abs(correlation - np.eye(4)).max() < 4.5 / PIXELS  # of six; independent ones have 1 / sqrt(n)
    again = photograph(uniform(), Detector(netd=0.05), frame=1).signal
    np.testing.assert_array_equal(images[1], again)


def test_the_fixed_pattern_stays_from_frame_to_frame():
    detector = Detector(gain_spread=0.002, offset_spread=0.05)
    first = photograph(uniform(), detector, frame=1).signal
    np.testing.assert_array_equal(first, photograph(uniform(), detector, frame=2).signal)
    other = photograph(uniform(), dataclasses.replace(detector, seed=1)).signal
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 4.0 / PIXELS


def test_gains_and_offsets_spread_as_told():
    plain = photograph(uniform(350.0), Detector()).signal.astype(float)
    gain = photograph(uniform(350.0), Detector(gain_spread=0.01)).signal / plain - 1.0
    assert gain.std() == pytest.approx(0.01, rel=SPREAD)
    offset = photograph(uniform(), Detector(offset_spread=0.1)).temperature.astype(float)
    assert offset.std() == pytest.approx(0.1, rel=SPREAD)
    hot = photograph(uniform(350.0), Detector(offset_spread=0.1)).signal - plain
    per_kelvin = sensor_radiance(EDGES, WEIGHTS, STATED, derivative=True) / STATED
    assert hot.std() == pytest.approx(0.1 * per_kelvin, rel=SPREAD)


def test_gains_offsets_and_noise_are_independent():
    one = {"netd": 0.05}, {"offset_spread": 0.05}, {"gain_spread": 0.01}
    images = [photograph(uniform(), Detector(**options)).signal.ravel() for options in one]
    assert np.abs(np.corrcoef(images) - np.eye(3)).max() < 4.5 / PIXELS


def test_a_part_of_the_frame_has_its_own_pixels():
    detector = Detector(netd=0.05, gain_spread=0.002, offset_spread=0.05)
    whole = photograph(uniform(), detector).signal
    part = Camera(width=PIXELS, height=PIXELS, window=(20, 5, 90, 40))
    image = uniform()[:, 5:40, 20:90]
    np.testing.assert_array_equal(expose(image, EDGES, WEIGHTS, detector, part).signal, whole[5:40, 20:90])


# Digital numbers


def test_digital_numbers_are_within_half_a_step():
    kelvin = np.linspace(250.0, 350.0, 500)[None]
    detector = Detector(bits=14, range=(250.0, 350.0))
    numbers, temperature, clipped = photograph(blackbody(kelvin), detector)
    low, high = sensor_radiance(EDGES, WEIGHTS, np.array([250.0, 350.0]))
    step = (high - low) / (2**14 - 1)
    np.testing.assert_array_equal(numbers, np.rint(numbers))
    assert (numbers.min(), numbers.max(), clipped) == (0, 2**14 - 1, 0)
    signal = sensor_radiance(EDGES, WEIGHTS, kelvin)
    assert np.abs(low + numbers * step - signal).max() <= 0.5 * step + ROUNDING * high
    # what is shown is the temperature of the number, to float32
    exact = apparent_temperature(low + numbers * step, EDGES, WEIGHTS)
    np.testing.assert_allclose(temperature, exact, rtol=ROUNDING)
    assert len(np.unique(photograph(blackbody(kelvin), dataclasses.replace(detector, bits=4)).signal)) == 16


def test_what_is_outside_the_range_is_clipped_and_counted():
    kelvin = np.array([[200.0, 240.0, 300.0, 400.0, 500.0, 600.0]])
    numbers, temperature, clipped = photograph(blackbody(kelvin), Detector(bits=8, range=(233.15, 423.15)))
    assert clipped == 3
    np.testing.assert_array_equal(numbers[0, [0, 4, 5]], [0, 255, 255])
    np.testing.assert_allclose(temperature[0, [0, 4, 5]], [233.15, 423.15, 423.15], rtol=ROUNDING)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"f_number": -1.0}, "f_number is -1, expected"),
        ({"netd": np.nan}, "netd is nan K"),
        ({"gain_spread": np.inf}, "gain_spread is inf"),
        ({"offset_spread": -0.1}, "offset_spread is -0.1 K"),
        ({"pitch": (0.0, 12.0)}, "pixel pitch is 0 um"),
        ({"fill_factor": 0.0}, "fill_factor is 0"),
        ({"fill_factor": 1.1}, "fill_factor is 1.1"),
        ({"bits": 25}, "25 bits, expected 0 to 24"),
        ({"range": (300.0, 300.0)}, "range from 300 K to 300 K"),
        ({"range": (-1.0, 300.0)}, "range from -1 K to 300 K"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_senseless_values_are_told(options, message):
    with pytest.raises(SceneError, match=message):
        Detector(**options)


def test_a_range_that_the_sensor_cannot_see_is_told():
    with pytest.raises(SceneError, match="the same from 0.5 K and from 1 K"):
        photograph(uniform(), Detector(bits=8, range=(0.5, 1.0)))
