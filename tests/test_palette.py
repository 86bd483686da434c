# SPDX-License-Identifier: GPL-3.0-or-later
"""Palettes, the scale from temperatures to colours, ticks of its bar, units and readings."""

import numpy as np
import pytest

from addon.output.palette import PALETTES, display, linear, thermal
from addon.output.temperature_scale import (
    CELSIUS,
    FAHRENHEIT,
    KELVIN,
    Isotherm,
    TemperatureScale,
    reading,
    ticks,
)

RED = (1.0, 0.0, 0.0)
GREEN = (0.0, 1.0, 0.0)


def lab(colours):
    """(n, 3) CIE L*a*b* of linear Rec.709, from the primaries' chromaticities in Rec.709 and the formulas of CIE 15."""
    red, green, blue, white = (np.array([x, y, 1 - x - y]) / y for x, y in
                               ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290)))  # fmt: skip
    primaries = np.column_stack((red, green, blue))
    xyz = colours @ (primaries * np.linalg.solve(primaries, white)).T / white
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.stack((116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])), axis=-1)


# palettes


@pytest.mark.parametrize("palette", ["IRON", "WHITE_HOT", "VIRIDIS", "INFERNO"])
def test_hotter_is_brighter(palette):
    assert np.diff(lab(PALETTES[palette].astype(float))[:, 0]).min() > 0


def test_hotter_is_darker_in_black_hot():
    assert np.diff(lab(PALETTES["BLACK_HOT"].astype(float))[:, 0]).max() < 0


def test_the_rainbow_promises_no_order():
    """So that nobody reads a promise into the list above: its lightness rises and falls."""
    steps = np.diff(lab(PALETTES["RAINBOW"].astype(float))[:, 0])
    assert steps.min() < 0 < steps.max()


@pytest.mark.parametrize("palette", ["VIRIDIS", "INFERNO", "WHITE_HOT", "BLACK_HOT"])
def test_equal_steps_look_equally_large(palette):
    """64 steps: each is one distance in L*a*b*, but for the corners of the way, which a step cuts, and for rounding of
    the matrix between XYZ and Rec.709 in IEC 61966-2-1. An eye tells about 1 apart, the smallest step here is 1.6."""
    colours = thermal(np.linspace(0, 1, 65), 0, 1, palette).astype(float)
    steps = np.linalg.norm(np.diff(lab(colours), axis=0), axis=1)
    assert np.abs(steps - np.median(steps)).max() < 0.5


@pytest.mark.parametrize("palette", ["WHITE_HOT", "BLACK_HOT"])
def test_greys_are_grey_and_reach_black_and_white(palette):
    colours = display(PALETTES[palette]).astype(int)
    assert np.ptp(colours, axis=1).max() <= 1  # a rounding of the matrix may tip one channel
    assert {int(colours[0, 0]), int(colours[-1, 0])} == {0, 255}


def test_viridis_and_inferno_go_through_the_published_colours():
    """matplotlib's colours at both ends and in between; a way in 1024 steps passes each within half a step."""
    for palette, published in (("VIRIDIS", "440154 26828e fde725"), ("INFERNO", "000004 a52c60 fcffa4")):
        way = lab(PALETTES[palette].astype(float))
        step = np.linalg.norm(np.diff(way, axis=0), axis=1).max()
        for code in published.split():
            point = lab(linear(np.array([list(bytes.fromhex(code))]) / 255))
            assert np.linalg.norm(way - point, axis=1).min() <= step
    assert display(PALETTES["VIRIDIS"][-1]).tolist() == [0xFD, 0xE7, 0x25]


def test_linear_undoes_display():
    codes = np.arange(256)
    np.testing.assert_array_equal(display(linear(codes / 255)), codes)


# scale


def test_one_colour_may_be_painted_over():
    """An isotherm on a single temperature: the palette stays as it is."""
    colour = thermal(0.3, 0, 1)
    before = colour.copy()
    colour[...] = 7.0
    assert np.array_equal(thermal(0.3, 0, 1), before)


def test_a_fixed_range_gives_its_ends_to_everything_outside():
    scale = TemperatureScale("VIRIDIS", 290.0, 310.0)
    colours = scale.colours(np.array([200.0, 290.0, 310.0, 500.0]))
    np.testing.assert_array_equal(colours, PALETTES["VIRIDIS"][[0, 0, -1, -1]])
    assert scale.fitted(np.array([0.0, 1000.0])) == scale


def test_one_end_may_be_fixed_and_the_other_automatic():
    scale = TemperatureScale(low=280.0).fitted(np.full((4, 4), 300.0))
    assert (scale.low, scale.high) == (280.0, pytest.approx(300.0))


def test_an_automatic_range_is_that_of_the_image():
    image = np.linspace(280, 300, 10001, dtype=np.float32).reshape(73, 137)
    scale = TemperatureScale().fitted(image)
    assert (scale.low, scale.high) == (pytest.approx(280.02), pytest.approx(299.98))  # without 0.1 % at each end
    np.testing.assert_array_equal(scale.colours(image), thermal(image))


def backed(kelvin, size=40):
    """A square of rows from 290 K to 310 K before a background, with a mixture of both at its edge."""
    image = np.full((size, size), kelvin, np.float32)
    image[9:-9, 9:-9] = 0.5 * (kelvin + 290.0)
    image[10:-10, 10:-10] = np.linspace(290, 310, size - 20)[:, None]
    return image


@pytest.mark.parametrize("turned", [False, True])
def test_an_automatic_range_leaves_a_background_at_0_k_out(turned):
    image = backed(0.0).T if turned else backed(0.0)
    scale = TemperatureScale().fitted(image)
    assert (scale.low, scale.high) == (pytest.approx(290.0), pytest.approx(310.0))
    np.testing.assert_array_equal(TemperatureScale().colours(image), scale.colours(image))  # nor do colours count it
    np.testing.assert_array_equal(TemperatureScale().colours(image)[0, 0], PALETTES["IRON"][0])


def test_any_other_background_counts():
    """However cold: somebody gave it this temperature."""
    scale = TemperatureScale().fitted(backed(2.7))
    assert (scale.low, scale.high) == (pytest.approx(2.7), pytest.approx(310.0))


def test_what_is_only_edges_keeps_its_range():
    """A wire before the background: its pixels are all there is; beside a plate it still gives the hot end."""
    image = np.zeros((60, 60), np.float32)
    image[:, 4] = np.linspace(400.0, 500.0, 60)
    scale = TemperatureScale().fitted(image)
    assert (scale.low, scale.high) == (pytest.approx(400.0, abs=1.0), pytest.approx(500.0, abs=1.0))
    image[10:50, 20:40] = 300.0
    scale = TemperatureScale().fitted(image)
    assert (scale.low, scale.high) == (pytest.approx(300.0), pytest.approx(500.0, abs=5.0))


def test_one_end_may_be_fixed_above_a_background_at_0_k():
    scale = TemperatureScale(high=320.0).fitted(backed(0.0))
    assert (scale.low, scale.high) == (pytest.approx(290.0), 320.0)


def test_a_range_given_upside_down_is_turned():
    assert TemperatureScale(low=310.0, high=290.0).fitted(np.array(300.0)) == TemperatureScale(low=290.0, high=310.0)


@pytest.mark.parametrize("image", [np.full((2, 2), np.nan), np.full((2, 2), 300.0), np.zeros((2, 2)), np.empty((0, 3))])
def test_any_image_fits_a_scale_with_a_bar(image):
    scale = TemperatureScale().fitted(image)
    assert scale.high > scale.low and np.isfinite(scale.bar(10)).all() and scale.ticks(CELSIUS)


def test_the_isotherm_paints_its_band_and_nothing_else():
    image = np.array([[289.0, 295.0, 299.0], [300.0, 300.1, np.nan]])
    plain = TemperatureScale("INFERNO", 280.0, 320.0)
    band = TemperatureScale("INFERNO", 280.0, 320.0, Isotherm(295.0, 300.0, GREEN))
    inside = np.array([[False, True, True], [True, False, False]])
    colours = band.colours(image)
    np.testing.assert_array_equal(colours[inside], np.tile(GREEN, (3, 1)))
    np.testing.assert_array_equal(colours[~inside], plain.colours(image)[~inside])


def test_the_isotherms_colour_is_what_a_screen_shows():
    colours = TemperatureScale("IRON", 280, 320, Isotherm(0, 1e4, (0.25, 0.5, 0.75))).colours(np.array([300.0]))
    np.testing.assert_array_equal(display(colours), np.rint([[0.25 * 255, 0.5 * 255, 0.75 * 255]]))


def test_what_is_outside_the_isotherm_can_be_grey():
    image = np.linspace(280, 320, 41)
    colours = TemperatureScale("RAINBOW", 280.0, 320.0, Isotherm(310.0, 300.0, RED, grey=True)).colours(image)
    np.testing.assert_array_equal(colours[20:31], np.tile(RED, (11, 1)))
    rest = np.r_[0:20, 31:41]
    np.testing.assert_array_equal(colours[rest], thermal(image[rest], 280, 320, "WHITE_HOT"))


def test_the_bar_shows_palette_and_isotherm():
    scale = TemperatureScale("IRON", 300.0, 310.0, Isotherm(302.0, 304.0, GREEN))
    bar = scale.bar(100)
    np.testing.assert_array_equal(bar[20:40], np.tile(GREEN, (20, 1)))
    np.testing.assert_array_equal(bar[40:], scale.colours(np.arange(304.05, 310.0, 0.1)))


# ticks


@pytest.mark.parametrize(
    "low, high, expected",
    [
        (275.0, 320.0, [280, 290, 300, 310, 320]),
        (0.0, 0.34, [0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3]),
        (-12.0, 3.0, [-10, -5, 0]),
        (5.0, 5.0, []),
    ],
)
def test_ticks_are_round_and_few(low, high, expected):
    assert list(ticks(low, high)) == pytest.approx(expected)


@pytest.mark.parametrize("unit", [KELVIN, CELSIUS, FAHRENHEIT])
@pytest.mark.parametrize("most", [3, 8])
def test_ticks_are_round_in_their_own_unit(unit, most):
    """Steps of 1, 2 or 5 times a power of ten, all inside the bar, in any range; labels say the values exactly."""
    rng = np.random.default_rng(1)
    for low, span in zip(rng.uniform(0, 2000, 200), 10 ** rng.uniform(-2, 3, 200), strict=True):
        scale = TemperatureScale(low=low, high=low + span)
        marks = scale.ticks(unit, most)
        values = np.array([float(label) for _, label in marks])
        places = np.array([place for place, _ in marks])
        assert len(marks) <= most and (places > -1e-9).all() and (places < 1 + 1e-9).all()
        # A label is the value but for the rounding of kelvin in float64, 2e-13 K here: against the span below 1e-9.
        np.testing.assert_allclose(unit.in_kelvin(values), low + places * span, atol=1e-9 * span)
        if len(marks) > 1:
            step = np.diff(values).mean()
            np.testing.assert_allclose(np.diff(values), step, rtol=1e-6)
            assert round(step / 10 ** np.floor(np.log10(step) + 1e-6), 5) in (1, 2, 5)
            np.testing.assert_allclose(values / step, np.rint(values / step), atol=1e-6)


# units and readings


@pytest.mark.parametrize("unit, ice, steam", [(KELVIN, 273.15, 373.15), (CELSIUS, 0, 100), (FAHRENHEIT, 32, 212)])
def test_units(unit, ice, steam):
    assert [unit.of_kelvin(273.15), unit.of_kelvin(373.15)] == pytest.approx([ice, steam])
    assert unit.in_kelvin(unit.of_kelvin(300.0)) == pytest.approx(300.0)


@pytest.mark.parametrize(
    "kelvin, noise, unit, expected",
    [
        (304.57, 0.05, CELSIUS, "31.42 ± 0.05 °C"),
        (304.57, 0.05, FAHRENHEIT, "88.56 ± 0.09 °F"),
        (304.57, 0.05, KELVIN, "304.57 ± 0.05 K"),
        (304.57, 0.4, KELVIN, "304.6 ± 0.4 K"),
        (304.57, 12.0, CELSIUS, "31 ± 12 °C"),
        (304.57, 1e-5, CELSIUS, "31.420 ± 0.000 °C"),
        (304.57, 0.0, CELSIUS, "31.42 ± 0.00 °C"),
        (0.0, 0.0, KELVIN, "0.00 ± 0.00 K"),
        (304.57, 304.57, CELSIUS, "31.42 °C (error unknown)"),  # what Noise is after one pass
        (float("nan"), 0.1, CELSIUS, "no value (nan)"),
    ],
)
def test_readings(kelvin, noise, unit, expected):
    assert reading(kelvin, noise, unit) == expected
