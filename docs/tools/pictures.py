# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of thermal images for the pages: with a title, with a colour bar, several side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from addon.output.palette import display, robust_range, thermal
from addon.output.temperature_scale import ticks

BACKGROUND, INK = (24, 24, 28), (225, 225, 225)
WIDTH, TITLE, MARGIN, BAR, GAP = 320, 24, 70, 14, 8  # pixels: of a picture, above and beside it, of the bar, between


def titled(shown: Image.Image, title: str, height: int = TITLE, font: int = 13, margin: int = 0) -> Image.Image:
    """A picture with a title above. height: of the title, font: of its letters, margin: on the right; all in pixels."""
    result = Image.new("RGB", (shown.width + margin, height + shown.height), BACKGROUND)
    result.paste(shown, (0, height))
    ImageDraw.Draw(result).text((GAP, height / 2), title, INK, ImageFont.load_default(font), "lm")
    return result


def resized(shown: Image.Image) -> Image.Image:
    """A picture WIDTH pixels wide."""
    return shown.resize((WIDTH, WIDTH * shown.height // shown.width), Image.Resampling.LANCZOS)


def labelled(image: np.ndarray, title: str) -> Image.Image:
    """An image (height, width), row 0 at the top, in thermal colours, with a title and a colour bar."""
    low, high = robust_range(image)
    result = titled(resized(Image.fromarray(display(thermal(image, low, high)))), title, margin=MARGIN)
    left, top, bottom = WIDTH + GAP, TITLE + GAP, result.height - GAP
    scale = display(thermal(np.linspace(high, low, bottom - top), low, high))
    result.paste(Image.fromarray(np.repeat(scale[:, None], BAR, axis=1)), (left, top))
    draw, font = ImageDraw.Draw(result), ImageFont.load_default(13)
    for value in ticks(low, high):
        y = bottom - (value - low) / (high - low) * (bottom - top)
        draw.line((left + BAR, y, left + BAR + 4, y), INK)
        draw.text((left + BAR + 7, y), f"{value:g}", INK, font, "lm")
    return result


def tiled(pictures: Sequence[Image.Image], columns: int, gap: int = GAP, background="white") -> Image.Image:
    """Pictures of one size in rows of so many, `gap` pixels apart."""
    across, down = pictures[0].width + gap, pictures[0].height + gap
    rows = -(-len(pictures) // columns)
    result = Image.new("RGB", (columns * across - gap, rows * down - gap), background)
    for i, picture in enumerate(pictures):
        result.paste(picture, (i % columns * across, i // columns * down))
    return result
