# SPDX-License-Identifier: GPL-3.0-or-later
"""A thermal picture with a colour bar in kelvin and degrees Celsius."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from addon.output.palette import display, robust_range, thermal

ZERO_CELSIUS = 273.15  # K
BACKGROUND, INK = (24, 24, 28), (225, 225, 225)
TEXT, GAP, BAR, TICK = 13, 14, 18, 4  # pixels: height of text, margins, width of the bar, length of a tick
MARGIN = 130  # pixels at the right for the bar and its labels
LEAST = 160  # pixels of height, so that the bar can be read beside a very small image


def thermal_picture(temperature: np.ndarray) -> Image.Image:
    """The picture of a (h, w) image in K whose row 0 is the bottom, with a colour bar at its right."""
    low, high = robust_range(temperature)
    width, height = temperature.shape[1], max(temperature.shape[0], LEAST)
    picture = Image.new("RGB", (width + MARGIN, height), BACKGROUND)
    picture.paste(Image.fromarray(display(thermal(temperature, low, high))[::-1]), (0, 0))
    left, top, bottom = width + MARGIN // 2 - BAR // 2, 2 * GAP + TEXT, height - 2 * GAP
    scale = np.linspace(high, low, bottom - top)
    colours = np.repeat(display(thermal(scale, low, high))[:, None], BAR, axis=1)
    picture.paste(Image.fromarray(colours), (left, top))

    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(TEXT)
    for unit, offset, x, outwards, anchor in (
        ("K", 0.0, left, -1, "r"),
        ("°C", ZERO_CELSIUS, left + BAR, 1, "l"),
    ):
        draw.text((x + outwards * 2 * TICK, GAP), unit, INK, font, anchor + "t")
        for value in ticks(low - offset, high - offset):
            y = bottom - (value + offset - low) / (high - low) * (bottom - top)
            draw.line((x, y, x + outwards * TICK, y), INK)
            draw.text((x + outwards * 2 * TICK, y), f"{value:g}", INK, font, anchor + "m")
    return picture


def ticks(low: float, high: float, most: int = 8) -> Iterator[float]:
    """At most `most` round values from low to high: multiples of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return
    step = next(
        step
        for exponent in range(int(np.floor(np.log10(high - low))) - 2, 40)
        for step in (1.0 * 10.0**exponent, 2.0 * 10.0**exponent, 5.0 * 10.0**exponent)
        if (high - low) / step <= most - 1
    )
    for multiple in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1):
        yield multiple * step
