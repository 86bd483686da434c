# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of measuring tools on a picture: their shapes, and drawing them into pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LIGHT, DARK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)  # sRGB of an outline and of its edge, to be seen on any colour
CORNERS = 64  # of what an ellipse is drawn as
ARM, GAP = 0.7, 0.2  # of a spot's cross, in heights of the text


class Mark(NamedTuple):
    """A tool on a picture. kind: as in measuring.regions. points: (x, y) in pixels from the picture's lower left
    corner, of a box and an ellipse two opposite corners. label: what stands beside it.
    """

    kind: str
    points: tuple[tuple[float, float], ...]
    label: str


def outline(mark: Mark, text: float) -> list[np.ndarray]:
    """The lines of a mark, (n, 2) each, in pixels; a spot is a cross. text: height of the text beside it."""
    points = np.asarray(mark.points, np.float64).reshape(-1, 2)
    if mark.kind == "SPOT":
        arms = np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
        return [points[0] + np.outer((GAP * text, ARM * text), arm) for arm in arms]
    if mark.kind == "LINE":
        return [points]
    if mark.kind == "POLYGON":
        return [np.vstack((points, points[:1]))]
    low, high = points.min(axis=0), points.max(axis=0)
    if mark.kind == "BOX":
        return [np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])]
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    circle = np.column_stack((np.cos(angle), np.sin(angle)))
    return [0.5 * (low + high) + 0.5 * (high - low) * circle]


def label_place(mark: Mark, text: float, width: float, picture: tuple[float, float]) -> tuple[float, float]:
    """Lower left corner of a mark's label, right of its uppermost point, of a spot right of it, or left of it where
    there is no room.

    text, width: height and width of the label. picture: width and height, in which the label stays. All in pixels.
    """
    lines = np.vstack(outline(mark, text))
    by = -lines[:, 1] if mark.kind != "SPOT" else np.abs(lines[:, 1] - lines[:, 1].mean())
    x, y = lines[np.lexsort((-lines[:, 0], by))[0]]
    away = 0.6 * text
    if x + away + width > picture[0]:
        x = x - 2.0 * away - width
    least = np.minimum((picture[0] - width, picture[1] - text), (x + away, y - 0.4 * text))
    return float(max(least[0], 0.0)), float(max(least[1], 0.0))


def draw_marks(picture: np.ndarray, marks, text: float) -> None:
    """Draw the outlines of marks into a picture (h, w, 3), float32 sRGB 0..1, row 0 at the bottom."""
    line = max(1.0, text / 13.0)
    for mark in marks:
        lines = outline(mark, text)
        for width, colour in ((3.0 * line, DARK), (line, LIGHT)):
            for points in lines:
                for start, end in zip(points[:-1], points[1:], strict=True):
                    _draw_line(picture, start, end, width, colour)


def _draw_line(picture: np.ndarray, start: np.ndarray, end: np.ndarray, width: float, colour) -> None:
    """Draw a straight line with smooth edges: a pixel is covered by how near its middle is to the line."""
    reach = 0.5 * width + 1.0
    size = np.array(picture.shape[1::-1])
    low = np.clip(np.floor(np.minimum(start, end) - reach), 0, size).astype(int)
    high = np.clip(np.ceil(np.maximum(start, end) + reach), 0, size).astype(int)
    x, y = np.arange(low[0], high[0]) + 0.5, (np.arange(low[1], high[1]) + 0.5)[:, None]
    along = end - start
    length = float(along @ along)
    share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length if length else 0.0
    share = np.clip(share, 0.0, 1.0)
    away = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
    cover = np.clip(0.5 * width + 0.5 - away, 0.0, 1.0)[..., None].astype(np.float32)
    part = picture[low[1] : high[1], low[0] : high[0]]
    part += cover * (np.asarray(colour, np.float32) - part)
