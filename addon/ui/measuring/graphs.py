# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a line's profile and of an area's histogram for the sidebar, made with numpy alone."""

from __future__ import annotations

import math

import numpy as np

from ...measuring.statistics import histogram
from ...output.palette import display
from ...output.temperature_scale import TemperatureScale
from ..materials.curve_image import BACKGROUND, draw_curve
from ..materials.curve_previews import image_icon

SIZE = 256, 256  # pixels
MOST_BINS = 64
MOST_VALUES = 100_000  # that a histogram is drawn of
_MARGIN = 0.04  # share of the height, at both ends, as of a curve
_SHADE = 0.25  # of the isotherm's colour over the background


def profile_image(values: np.ndarray, scale: TemperatureScale) -> np.ndarray:
    """The temperatures (n,), K, along a line from left to right, from the least at the bottom to the largest at the
    top: (h, w, 4) float32 sRGB, row 0 at the bottom. The isotherm of the scale is a stripe."""
    low, high = _ends(values)
    known = np.isfinite(values)
    points = np.column_stack((_shares(len(values)), (values - low) / (high - low)))[known]
    image = draw_curve(points, 0.0, 1.0, SIZE)
    if scale.isotherm is not None:
        rows = low + (high - low) * (np.arange(SIZE[1]) / (SIZE[1] - 1) - _MARGIN) / (1.0 - 2.0 * _MARGIN)
        first, last = sorted((scale.isotherm.low, scale.isotherm.high))
        free = (image[..., :3] == np.float32(BACKGROUND[:3])).all(axis=2) & ((rows >= first) & (rows <= last))[:, None]
        image[free, :3] += _SHADE * (np.array(scale.isotherm.colour, np.float32) - image[free, :3])
    return image


def _shares(count: int) -> np.ndarray:
    """(n,) from 0 to 1: where the values of a profile stand; a single one stands over all."""
    return np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1)


def histogram_image(values: np.ndarray, scale: TemperatureScale, ends: tuple[float, float]) -> np.ndarray:
    """How many of the temperatures (n,), K, are how warm, from the cold end at the left to the warm one, each in its
    colour of a scale whose ends are known: (h, w, 4) float32 sRGB, row 0 at the bottom."""
    count = int(np.clip(2.0 * math.sqrt(values.size), 8, MOST_BINS))
    counts, edges = histogram(values, count, ends)
    width, height = SIZE
    image = np.empty((height, width, 4), np.float32)
    image[:] = BACKGROUND
    bins = np.arange(width) * count // width
    colours = display(scale.colours(0.5 * (edges[:-1] + edges[1:]))) / np.float32(255.0)
    colours = np.maximum(colours, 0.22)  # so that black shows on the background
    top = np.rint(counts / max(counts.max(), 1) * (1.0 - 2.0 * _MARGIN) * height).astype(int)
    filled = np.arange(height)[:, None] < top[bins]
    image[filled, :3] = np.broadcast_to(colours[bins], (height, width, 3))[filled]
    return image


def _ends(values: np.ndarray) -> tuple[float, float]:
    """Least and largest of temperatures, half a kelvin to both sides of a single one."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def graph_icon(kind: str, values: np.ndarray, scale: TemperatureScale) -> int:
    """The number of the icon of a tool's graph for a layout: of a line its profile, else its histogram."""
    name = "graph of a measuring tool"
    if kind == "LINE":
        return image_icon(name, (kind, values.tobytes(), scale), lambda: profile_image(values, scale))
    values = values[np.isfinite(values)]
    ends = _ends(values) if values.size else (0.0, 1.0)
    some = values[:: max(1, values.size // MOST_VALUES)]  # a picture of 256 columns tells no difference
    return image_icon(name, (kind, some.tobytes(), ends, scale), lambda: histogram_image(some, scale, ends))
