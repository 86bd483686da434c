# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays behind temperatures over a surface: ranges, images, files of points and the means between points."""

import re

import numpy as np
import pytest

from addon.reading.temperature_fields import (
    TemperatureError,
    check_kelvin,
    inverse_distance,
    pick_channel,
    read_points,
    sample_image,
    spread,
)
from addon.solver.scene import EXTENSIONS


def test_shares_become_a_range_to_the_last_bit_at_its_ends():
    assert spread(np.array([0.0, 0.25, 1.0]), 280.0, 320.0).tolist() == [280.0, 290.0, 320.0]
    assert spread(np.float32([300.5]), 0.0, 1.0).tolist() == [300.5]  # an image that holds kelvin
    assert spread(np.array([0.1]), 300.0, 300.0) == pytest.approx(300.0, rel=1e-15)


@pytest.mark.parametrize("value", [np.nan, np.inf, -12.5, 2e6])
def test_nonsense_is_named(value):
    """By the rule that the engine has, with the value."""
    with pytest.raises(TemperatureError, match=f"Plate: temperature {re.escape(f'{value:g}')} K"):
        check_kelvin(np.array([300.0, value, 0.0]), "Plate")
    check_kelvin(np.array([0.0, 1e6]), "Plate")
    check_kelvin(np.array([]), "Plate")


def test_channels():
    colours = np.array([[1.0, 0.5, 0.25, 0.125]], np.float32)
    assert [pick_channel(colours, channel)[0] for channel in "RGBA"] == [1.0, 0.5, 0.25, 0.125]
    # ITU-R BT.709; float32 rounds each of the three terms
    luminance = 0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25
    assert pick_channel(colours, "LUMINANCE")[0] == pytest.approx(luminance, rel=5e-7)
    grey = colours[:, 1:2]
    assert [pick_channel(grey, channel)[0] for channel in ("LUMINANCE", "R", "A")] == [0.5, 0.5, 1.0]


def ramp(width, height):
    """Values 3 x + 5 y of the pixels' numbers, row 0 at the bottom."""
    return (3.0 * np.arange(width) + 5.0 * np.arange(height)[:, None]).astype(np.float32)


def test_a_linear_image_is_linear_between_its_pixel_centres():
    """Bilinear interpolation reproduces it exactly; float64 arithmetic rounds a few times."""
    width, height = 7, 4
    rng = np.random.default_rng(1)
    pixel = rng.uniform(0.0, 1.0, (200, 2)) * (width - 1, height - 1)
    uv = (pixel + 0.5) / (width, height)
    for extension in EXTENSIONS:
        found = sample_image(ramp(width, height), uv, extension)
        np.testing.assert_allclose(found, 3.0 * pixel[:, 0] + 5.0 * pixel[:, 1], rtol=0, atol=1e-13)


def test_outside_an_image():
    pixels = np.array([[1.0, 2.0, 5.0, 9.0]], np.float32)
    u = np.array([-2.0, 0.0, 1.0, 3.0, 0.125 + 2.0, 0.375 - 7.0])
    uv = np.column_stack((u, np.full(len(u), 0.3)))
    assert sample_image(pixels, uv, "EXTEND").tolist() == [1.0, 1.0, 9.0, 9.0, 9.0, 1.0]
    # at whole numbers half-way between the last pixel and the first
    assert sample_image(pixels, uv, "REPEAT").tolist() == [5.0, 5.0, 5.0, 5.0, 1.0, 2.0]
    # there and back again: the middle of the first pixel two images on, that of the second seven images back
    assert sample_image(pixels, uv, "MIRROR").tolist() == [1.0, 1.0, 9.0, 9.0, 1.0, 5.0]
    clipped = sample_image(pixels, uv, "CLIP")
    assert clipped[1:3].tolist() == [1.0, 9.0] and np.isnan(np.delete(clipped, (1, 2))).all()


def test_the_closest_pixel():
    pixels = np.array([[1.0, 2.0], [5.0, 9.0]], np.float32)
    uv = np.array([[0.0, 0.49], [0.49, 0.51], [0.51, 0.0], [0.99, 0.99], [1.25, 0.25]])
    assert sample_image(pixels, uv, "REPEAT", closest=True).tolist() == [1.0, 5.0, 2.0, 9.0, 1.0]
    assert sample_image(pixels, uv, "MIRROR", closest=True)[4] == 2.0


def test_uv_coordinates_that_are_no_numbers_give_none():
    uv = np.array([[np.nan, 0.5], [0.5, np.inf], [0.5, 0.5]])
    assert np.isfinite(sample_image(ramp(2, 2), uv, "REPEAT")).tolist() == [False, False, True]


def test_inverse_distance_weights():
    """Weights by hand: 1/1 and 1/4 for distances 1 and 2 at power 2, 1 and 1/2 at power 1."""
    distances, values = np.array([[1.0, 2.0]]), np.array([[300.0, 310.0]])
    assert inverse_distance(distances, values, 2.0, np.inf, 0.0)[0] == pytest.approx(302.0, rel=1e-15)
    assert inverse_distance(distances, values, 1.0, np.inf, 0.0)[0] == pytest.approx(910.0 / 3.0, rel=1e-15)


def test_a_point_at_the_vertex_counts_alone_and_those_out_of_reach_not_at_all():
    distances = np.array([[0.0, 0.0, 1.0], [1e-200, 1.0, 1.0], [1.0, 2.0, 3.0], [2.5, 3.0, 4.0]])
    values = np.array([[300.0, 302.0, 900.0], [300.0, 900.0, 900.0], [300.0, 320.0, 900.0], [1.0, 1.0, 1.0]])
    assert inverse_distance(distances, values, 2.0, 2.0, 277.0).tolist() == [301.0, 300.0, 304.0, 277.0]


POINTS = [[0.0, 1.0, 2.5, 300.0], [1.0, -1.0, 0.0, 310.5]]


@pytest.mark.parametrize(
    "text",
    [
        "0,1,2.5,300\n1,-1,0,310.5\n",
        "\ufeffx,y,z,temperature\r\n0,1,2.5,300\r\n1,-1,0,310.5",
        "Temperature [K],z (m),y (m),x (m)\n300,2.5,1,0\n310.5,0,-1,1\n",
        '"T","Points:0","Points:1","Points:2"\n300,0,1,2.5\n310.5,1,-1,0\n',
        "# two points\n0 1   2.5 300\n\n% and more\n1 -1 0 310.5\n",
        "x (m)  y (m)  z (m)  T (K)\n0 1 2.5 300\n1 -1 0 310.5\n",
        "a;b;c;d;e\n0;1;2,5;300;9\n1;-1;0;310,5;9\n",
        "0\t1\t2.5\t3e2\n1\t-1\t0\t310.5\n",
    ],
    ids=["bare", "named", "any order", "ParaView", "spaces", "spaces and units", "decimal comma", "tabs"],
)
def test_files_of_points(tmp_path, text):
    path = tmp_path / "points.csv"
    path.write_bytes(text.encode())
    points, temperatures = read_points(path)
    assert np.column_stack((points, temperatures)).tolist() == POINTS


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "holds no values"),
        ("x,y,z,temperature\n", "header but no values"),
        ("x,y,temperature\n1,2,3\n", "no column z: x, y, temperature"),
        ("node,px,py,pz,temp\n1,2,3,4,5\n", "no column x and no y and no z"),
        ("1,2,3\n", "line 1: 3 columns, expected 4"),
        ("1,2,3,4\n\n1,2,3\n", "line 3: 3 columns, expected 4"),
        ("1,2,3,300\n1,2,warm,300\n", "line 2: 'warm' is no number"),
        ("1,2,nan,300\n1,2,3,300\n", "1 of 2 positions are not finite"),
        ("1,2,3,300\n\x00\xff", "cannot be read as text"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, text, message):
    path = tmp_path / "points.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(TemperatureError, match=f"File 'points.csv'.*{message}"):
        read_points(path)


def test_a_missing_file(tmp_path):
    with pytest.raises(TemperatureError, match="File 'none.csv' cannot be read"):
        read_points(tmp_path / "none.csv")
