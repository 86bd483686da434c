# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of temperatures as PNG files, with a colour bar if wanted. Works without a window."""

from __future__ import annotations

from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np

from ..solver.system.files import replacing
from .colour_bar import BACKGROUND, INK, ColourBar
from .palette import display
from .temperature_scale import TemperatureScale, TemperatureUnit

LEAST_HEIGHT = 160  # pixels, so that the bar can be read beside a very small picture
LEAST_TEXT, TEXT_SHARE = 13, 1 / 40  # height of the text: pixels, and share of the picture's height
FONT = 0  # Blender's own


def write_picture(
    path: Path, temperature: np.ndarray, scale: TemperatureScale, unit: TemperatureUnit, colour_bar: bool = True
) -> None:
    """Write temperatures (h, w), K, row 0 at the bottom, in the colours of a scale to a PNG; no view transform applies.

    colour_bar: add one at the right, labelled in the unit. A small picture is then extended at the bottom.
    Raises OSError naming the path if it cannot be written; an older file is replaced once the new one is complete.
    """
    scale = scale.fitted(temperature)
    picture = display(scale.colours(temperature)) / np.float32(255.0)
    bar = None
    if colour_bar:
        height, width = temperature.shape
        text = max(LEAST_TEXT, round(TEXT_SHARE * height))
        bar = ColourBar(scale, unit, width, 0, max(height, LEAST_HEIGHT), text)
        picture = _beside(picture, bar)
    with replacing(path, "the picture") as unfinished:
        _save(unfinished, picture)
        if bar is not None:
            _write_labels(unfinished, bar)


def _beside(picture: np.ndarray, bar: ColourBar) -> np.ndarray:
    """The picture (h, w, 3) with the bar, but for its labels, at its right."""
    height, width, _ = picture.shape
    canvas = np.empty((bar.height, width + bar.panel_width(bar.text), 3), np.float32)
    canvas[...] = BACKGROUND
    canvas[bar.height - height :, :width] = picture
    left, bottom, across, up = bar.bar
    canvas[bottom : bottom + up, left : left + across] = (display(bar.colours()) / 255.0)[:, None]
    for start, end, y in bar.ticks():
        row = min(int(y), bottom + up - 1)  # the uppermost tick may lie on the bar's upper edge
        canvas[row, round(start) : round(end)] = INK
    return canvas


def _save(path: Path, picture: np.ndarray) -> None:
    """Write sRGB (h, w, 3) 0..1 as an 8-bit PNG as it is. Raises RuntimeError if that fails."""
    height, width, _ = picture.shape
    image = bpy.data.images.new("Infrared picture", width, height, alpha=False)
    try:
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., :3] = picture
        image.pixels.foreach_set(pixels.ravel())
        image.file_format, image.filepath_raw = "PNG", str(path)
        image.save()
    finally:
        bpy.data.images.remove(image)


def _write_labels(path: Path, bar: ColourBar) -> None:
    """Write the labels of a bar into a PNG that is there. Raises OSError if that fails."""
    buffer = imbuf.load(str(path))
    try:
        blf.size(FONT, bar.text)
        blf.color(FONT, *INK, 1.0)
        with blf.bind_imbuf(FONT, buffer):
            for x, y, label in bar.labels():
                blf.position(FONT, x, y, 0.0)
                blf.draw_buffer(FONT, label)
        imbuf.write(buffer, filepath=str(path))
    finally:
        buffer.free()
