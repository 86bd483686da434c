# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of temperatures as PNG files, with measuring tools, a colour bar and a table if wanted. Works without a
window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np

from ..solver.system.files import replacing
from .colour_bar import BACKGROUND, INK, ColourBar
from .marks import Mark, draw_marks, label_place
from .palette import display
from .temperature_scale import TemperatureScale, TemperatureUnit

LEAST_HEIGHT = 160  # pixels, so that the bar can be read beside a very small picture
LEAST_WIDTH = 320  # pixels of a picture with tools
LEAST_TEXT, TEXT_SHARE = 13, 1 / 40  # height of the text: pixels, and share of the picture's height
LINE, COLUMN_GAP = 1.7, 1.5  # of the table: from row to row, and between columns, in heights of the text
FONT = 0  # Blender's own

Text = tuple[float, float, str]  # x and y of the lower left corner, pixels, and what it says


@dataclass(frozen=True)
class Beside:
    """What a picture shows beside its temperatures. colour_bar: at the right, labelled in the unit; a small picture is
    then extended at the bottom. marks: outlines of measuring tools and their labels; pixels of a small picture become
    squares of pixels, so that these have room. table: rows of cells below the picture, the titles first; none without
    rows.
    """

    colour_bar: bool = True
    marks: Sequence[Mark] = ()
    table: Sequence[Sequence[str]] = ()


def write_picture(
    path: Path, temperature: np.ndarray, scale: TemperatureScale, unit: TemperatureUnit, beside: Beside | None = None
) -> None:
    """Write temperatures (h, w), K, row 0 at the bottom, in the colours of a scale to a PNG; no view transform applies.

    beside: what else it shows; None is a colour bar alone.
    Raises OSError naming the path if it cannot be written; an older file is replaced once the new one is complete.
    """
    beside = beside or Beside()
    scale = scale.fitted(temperature)
    picture = display(scale.colours(temperature)) / np.float32(255.0)
    larger = -(-LEAST_WIDTH // picture.shape[1]) if beside.marks else 1
    picture = picture.repeat(larger, axis=0).repeat(larger, axis=1)
    marks = [mark.enlarged(larger) for mark in beside.marks]
    height, width, _ = picture.shape
    size = max(LEAST_TEXT, round(TEXT_SHARE * height))
    draw_marks(picture, marks, size)
    labels = _draw_label_panels(picture, marks, size)
    table, table_width, below = _table(beside.table, size)
    bar, tall = None, height
    if beside.colour_bar:
        tall = max(height, LEAST_HEIGHT)
        bar = ColourBar(scale, unit, width, below, tall, size)
    canvas_size = below + tall, max(width + (bar.panel_width(size) if bar else 0), table_width)
    if canvas_size != (height, width):
        canvas = np.empty((*canvas_size, 3), np.float32)
        canvas[...] = BACKGROUND
        canvas[below + tall - height :, :width] = picture
        picture = canvas
    if bar:
        _draw_bar(picture, bar)
    lift = below + tall - height  # of the temperatures over the lower edge
    texts = [(x, y + lift, text) for x, y, text in labels] + table + (list(bar.labels()) if bar else [])
    with replacing(path, "the picture") as unfinished:
        _save(unfinished, picture)
        if texts:
            _write_texts(unfinished, texts, size)


def _draw_label_panels(picture: np.ndarray, marks: Sequence[Mark], size: int) -> list[Text]:
    """Darken a picture (h, w, 3) behind the labels of marks; returns these."""
    texts, (height, width, _) = [], picture.shape
    for mark in marks:
        long = text_width(mark.label, size)
        x, y = label_place(mark, size, long, (width, height))
        left, low = max(0, round(x - 0.3 * size)), max(0, round(y - 0.35 * size))
        part = picture[low : round(y + 1.05 * size), left : round(x + long + 0.3 * size)]
        part += np.float32(0.7) * (np.asarray(BACKGROUND, np.float32) - part)
        texts.append((x, y, mark.label))
    return texts


def _table(rows: Sequence[Sequence[str]], size: int) -> tuple[list[Text], int, int]:
    """The texts of a table whose lower left corner is at (0, 0), and its width and height, pixels."""
    if not rows:
        return [], 0, 0
    gap, step = COLUMN_GAP * size, LINE * size
    widths = [max(text_width(cell, size) for cell in column) for column in zip(*rows, strict=True)]
    starts = np.cumsum([size, *(width + gap for width in widths)])
    height = int(step * len(rows) + size)
    texts = [
        (float(x), height - (line + 1) * step, cell)
        for line, cells in enumerate(rows)
        for x, cell in zip(starts, cells, strict=False)
        if cell
    ]
    return texts, int(starts[-1] - gap + size), height


def text_width(text: str, size: int) -> float:
    """In pixels, of a line of text of this height."""
    blf.size(FONT, size)
    return blf.dimensions(FONT, text)[0]


def _draw_bar(canvas: np.ndarray, bar: ColourBar) -> None:
    """Draw a bar, but for its labels, into a picture (h, w, 3)."""
    left, bottom, across, up = bar.bar
    canvas[bottom : bottom + up, left : left + across] = (display(bar.colours()) / 255.0)[:, None]
    for start, end, y in bar.ticks():
        row = min(int(y), bottom + up - 1)  # the uppermost tick may lie on the bar's upper edge
        canvas[row, round(start) : round(end)] = INK


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


def _write_texts(path: Path, texts: Sequence[Text], size: int) -> None:
    """Write lines of text of this height into a PNG that is there. Raises OSError if that fails."""
    buffer = imbuf.load(str(path))
    try:
        blf.size(FONT, size)
        blf.color(FONT, *INK, 1.0)
        with blf.bind_imbuf(FONT, buffer):
            for x, y, text in texts:
                blf.position(FONT, x, y, 0.0)
                blf.draw_buffer(FONT, text)
        imbuf.write(buffer, filepath=str(path))
    finally:
        buffer.free()
