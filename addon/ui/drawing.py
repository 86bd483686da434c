# SPDX-License-Identifier: GPL-3.0-or-later
"""Rectangles, lines and text over an editor's picture, in the region's pixels. Colours are sRGB and opacity, 0..1."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..output.colour_bar import BACKGROUND, INK
from ..output.heat_picture import FONT, text_width

TEXT = 13  # pixels at a scale of 1: height of the text
PANEL_OPACITY = 0.9
LIGHT, DARK = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)

Rectangle = tuple[float, float, float, float, tuple[float, float, float, float]]


def text_height() -> int:
    """Of the text over pictures, in pixels, at the scale of Blender's interface."""
    return round(TEXT * bpy.context.preferences.system.ui_scale)


def as_on_screen(srgb: np.ndarray) -> np.ndarray:
    """The sRGB colours to draw with so that the screen shows these, 0..1, to the last bit: Blender brings what is drawn
    over editors onto the screen by the power of 1 / 2.2, and not by sRGB's own curve, which differs in the dark."""
    light = np.asarray(srgb) ** 2.2
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def draw_rectangles(rectangles: Iterable[Rectangle]) -> None:
    """Draw (left, bottom, width, height, colour) rectangles."""
    table = np.array([(*place, *colour) for *place, colour in rectangles], np.float32).reshape(-1, 8)
    x, y, width, height = table[:, :4].T
    corners = np.zeros((len(table), 6, 3), np.float32)
    corners[:, :, 0] = x[:, None] + width[:, None] * (0.0, 1.0, 1.0, 0.0, 1.0, 0.0)
    corners[:, :, 1] = y[:, None] + height[:, None] * (0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
    colours = np.repeat(table[:, 4:], 6, axis=0)
    shader = gpu.shader.from_builtin("FLAT_COLOR")
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "TRIS", {"pos": corners.reshape(-1, 3), "color": colours}).draw(shader)
    gpu.state.blend_set("NONE")


def draw_line(points: Sequence[Sequence[float]], width: float, colour, closed: bool = False) -> None:
    """Draw a line from point to point (x, y), so many pixels wide; closed: back to the first."""
    places = [(x, y, 0.0) for x, y in points]
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("color", colour)
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "LINE_STRIP", {"pos": places + places[:1] if closed else places}).draw(shader)
    gpu.state.blend_set("NONE")


def draw_text(x: float, y: float, text: str, size: int) -> None:
    """Draw a line of text whose lower left corner is given, in pixels."""
    blf.size(FONT, size)
    blf.color(FONT, *INK, 1.0)
    blf.position(FONT, x, y, 0.0)
    blf.draw(FONT, text)


def draw_label(x: float, y: float, text: str, size: int, from_right: bool = False) -> None:
    """Draw a line of text on a background, in pixels; from_right: x is its right end."""
    width = text_width(text, size)
    left, pad = x - width - 0.5 * size if from_right else x, 0.5 * size
    draw_rectangles([(left - pad, y - pad, width + 2 * pad, size + pad, (*BACKGROUND, PANEL_OPACITY))])
    draw_text(left, y, text, size)


def draw_cross(x: float, y: float, size: float, colour=LIGHT) -> None:
    """Draw a cross, open in its middle, around a pixel. size: height of the text beside it."""
    arm, gap = 0.7 * size, 0.2 * size
    for thick, ink in ((3.0, DARK), (1.0, colour)):  # to be seen on any colour
        half, long = 0.5 * thick, arm - gap + (thick - 1.0)
        start = gap - 0.5 * (thick - 1.0)
        draw_rectangles(
            [
                (x + start, y - half, long, thick, ink),
                (x - start - long, y - half, long, thick, ink),
                (x - half, y + start, thick, long, ink),
                (x - half, y - start - long, thick, long, ink),
            ]
        )
