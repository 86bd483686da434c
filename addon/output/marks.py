# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of measuring tools on a picture: their shapes, and drawing them into pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

LIGHT, DARK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)  # sRGB of an outline and of its edge, to be seen on any colour
LINE, EDGE = 1.6, 4.0  # widths of both, pixels at a text of 13: seen wherever a line lies between pixels
ROUND = 64  # corners of an ellipse as it is drawn
ARM, GAP = 0.7, 0.2  # of a spot's cross, in heights of the text

Place = tuple[float, float]


class Mark(NamedTuple):
    """A tool on a picture. kind: as in measuring.regions. points: (x, y) in pixels from the picture's lower left
    corner, of a box and an ellipse two opposite corners. label: what stands beside it.
    """

    kind: str
    points: tuple[Place, ...]
    label: str

    def enlarged(self, factor: float) -> Mark:
        """The same on a picture that is so many times as large."""
        return self._replace(points=tuple((factor * x, factor * y) for x, y in self.points))


def outline(kind: str, places: Sequence[Place]) -> list[Place]:
    """The corners of a tool's outline; that of a line is open, of a spot only its place."""
    if kind in ("BOX", "ELLIPSE") and len(places) > 1:
        (x0, y0), (x1, y1) = places[:2]
        if kind == "BOX":
            return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        angle = np.arange(ROUND) * (2.0 * math.pi / ROUND)
        x = 0.5 * (x0 + x1) + 0.5 * (x1 - x0) * np.cos(angle)
        y = 0.5 * (y0 + y1) + 0.5 * (y1 - y0) * np.sin(angle)
        return list(zip(x.tolist(), y.tolist(), strict=True))
    return list(places)


def is_closed(kind: str) -> bool:
    """Whether an outline goes back to its first corner."""
    return kind in ("BOX", "ELLIPSE", "POLYGON")


def lines(mark: Mark, text: float) -> list[np.ndarray]:
    """What is drawn of a mark, (n, 2) corners of each line, in pixels; a spot is a cross. text: height of the text."""
    if mark.kind == "SPOT":
        arms = np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
        return [np.array(mark.points[0]) + np.outer((GAP * text, ARM * text), arm) for arm in arms]
    corners = outline(mark.kind, mark.points)
    return [np.array([*corners, *corners[:1]] if is_closed(mark.kind) else corners)]


def label_place(mark: Mark, text: float, width: float, picture: tuple[float, float]) -> tuple[float, float]:
    """Lower left corner of a mark's label, right of its uppermost point, of a spot right of it, or left of it where
    there is no room.

    text, width: height and width of the label. picture: width and height, in which the label stays. All in pixels.
    """
    corners = np.vstack(lines(mark, text))
    by = -corners[:, 1] if mark.kind != "SPOT" else np.abs(corners[:, 1] - corners[:, 1].mean())
    x, y = corners[np.lexsort((-corners[:, 0], by))[0]]
    away = 0.6 * text
    if x + away + width > picture[0]:
        x = x - 2.0 * away - width
    least = np.minimum((picture[0] - width, picture[1] - text), (x + away, y - 0.4 * text))
    return float(max(least[0], 0.0)), float(max(least[1], 0.0))


def draw_marks(picture: np.ndarray, marks, text: float) -> None:
    """Draw the outlines of marks into a picture (h, w, 3), float32 sRGB 0..1, row 0 at the bottom."""
    line = max(1.0, text / 13.0)
    for mark in marks:
        drawn = lines(mark, text)
        for width, colour in ((EDGE * line, DARK), (LINE * line, LIGHT)):
            for points in drawn:
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
