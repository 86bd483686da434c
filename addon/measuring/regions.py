# SPDX-License-Identifier: GPL-3.0-or-later
"""From the shape of a measuring tool to the pixels of a picture that it measures.

Points are (u, v), shares of the picture's width and height from its lower left corner. The pixel in row r and column c
of a picture of (h, w) pixels covers u from c / w to (c + 1) / w and v from r / h to (r + 1) / h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

KINDS = ("SPOT", "LINE", "BOX", "ELLIPSE", "POLYGON")
FEWEST_POINTS = {"SPOT": 1, "LINE": 2, "BOX": 2, "ELLIPSE": 2, "POLYGON": 3}
AREAS = ("BOX", "ELLIPSE", "POLYGON")  # kinds that measure the pixels whose middle is inside


class Window(NamedTuple):
    """How images lie in the picture: size is (width, height) of the picture, origin (column, row) its pixel that pixel
    (0, 0) of the images is, shape (rows, columns) that of the images, smaller with a render border. In a viewport size
    and origin are no whole numbers.
    """

    size: tuple[float, float]
    origin: tuple[float, float]
    shape: tuple[int, int]


@dataclass(frozen=True)
class Region:
    """Pixels of an image. rows, columns: slices, together with a mask (bool, of their shape) if not all of them count;
    or index arrays (n,), as of a line in its order.
    """

    rows: slice | np.ndarray
    columns: slice | np.ndarray
    mask: np.ndarray | None = None

    def values(self, image: np.ndarray) -> np.ndarray:
        """(n,) values of an image (h, w) in these pixels, row by row from the bottom, of a line from its start."""
        part = image[self.rows, self.columns]
        return part.ravel() if self.mask is None else part[self.mask]

    def pixel(self, index: int) -> tuple[int, int]:
        """(row, column) of one of the `values` by its index."""
        if isinstance(self.rows, np.ndarray):
            return int(self.rows[index]), int(self.columns[index])
        width = self.columns.stop - self.columns.start
        flat = index if self.mask is None else np.flatnonzero(self.mask)[index]
        row, column = divmod(int(flat), width)
        return self.rows.start + row, self.columns.start + column


def region_of(kind: str, points: Sequence[Sequence[float]], window: Window) -> Region:
    """The pixels of a tool: of a spot the one it is in, of a line those along it, one for each step of its longer side,
    of an area those whose middle is inside. None of them if the tool has too few points or lies outside.

    kind: one of KINDS. points: (n, 2), of a box and of an ellipse two opposite corners of the rectangle that it fills.
    """
    places = np.asarray(points, np.float64).reshape(-1, 2) * window.size - window.origin  # (x, y) in pixels
    if len(places) < FEWEST_POINTS[kind] or not np.isfinite(places).all():
        return _listed(np.empty((0, 2), np.intp), window.shape)
    if kind == "SPOT":
        return _listed(np.floor(places[:1, ::-1]).astype(np.intp), window.shape)
    if kind == "LINE":
        return _line(places[0], places[1], window.shape)
    rows, columns = _middles_between(places.min(axis=0), places.max(axis=0), window.shape)
    if kind == "BOX":
        return Region(rows, columns)
    x, y = (np.arange(part.start, part.stop) + 0.5 for part in (columns, rows))
    return Region(rows, columns, _ellipse(places[:2], x, y) if kind == "ELLIPSE" else _polygon(places, x, y))


def _listed(pixels: np.ndarray, shape: tuple[int, int]) -> Region:
    """Those of pixels (n, 2), row and column, that are in an image."""
    inside = ((pixels >= 0) & (pixels < shape)).all(axis=1)
    return Region(*pixels[inside].T)


def _line(start: np.ndarray, end: np.ndarray, shape: tuple[int, int]) -> Region:
    """The pixels that a line from (x, y) to (x, y) meets in the middle of each column, or row if it is steep."""
    first, last = np.floor(start), np.floor(end)
    axis = int(np.argmax(np.abs(end - start)))
    count = int(abs(last[axis] - first[axis])) + 1
    along = first[axis] + np.sign(last[axis] - first[axis]) * np.arange(count)
    length = end[axis] - start[axis]
    share = np.clip((along + 0.5 - start[axis]) / length, 0.0, 1.0) if length else np.zeros(count)
    across = np.floor(start[1 - axis] + share * (end[1 - axis] - start[1 - axis]))
    columns, rows = (along, across) if axis == 0 else (across, along)
    return _listed(np.stack((rows, columns), axis=1).astype(np.intp), shape)


def _middles_between(low: np.ndarray, high: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice]:
    """Slices of the rows and of the columns whose middles lie from low (x, y) to below high (x, y)."""
    size = shape[::-1]
    first, stop = (np.clip(np.ceil(corner - 0.5), 0, size).astype(int).tolist() for corner in (low, high))
    return slice(first[1], max(first[1], stop[1])), slice(first[0], max(first[0], stop[0]))


def _ellipse(corners: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(rows, columns) whether the ellipse in a rectangle (2, 2) holds the places at x (columns,) and y (rows,)."""
    middle, half = corners.mean(axis=0), np.maximum(np.abs(corners[1] - corners[0]) / 2.0, 1e-9)
    return ((x - middle[0]) / half[0]) ** 2 + (((y - middle[1]) / half[1]) ** 2)[:, None] <= 1.0


def _polygon(corners: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(rows, columns) whether a polygon (n, 2) holds the places at x (columns,), evenly 1 apart, and y (rows,).

    A place is inside if a ray from it crosses the outline an odd number of times.
    """
    flips = np.zeros((len(y), len(x) + 1), np.uint8)  # where a row goes in or out, from there on to the right
    if not len(x) or not len(y):
        return flips[:, :-1].astype(bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crossed = np.flatnonzero((y >= min(y0, y1)) & (y < max(y0, y1)))  # a corner is met once by both its sides
        at = x0 + (y[crossed] - y0) * ((x1 - x0) / (y1 - y0) if y1 != y0 else 0.0)
        flips[crossed, np.clip(np.ceil(at - x[0]), 0, len(x)).astype(int)] ^= 1
    return np.bitwise_xor.accumulate(flips[:, :-1], axis=1).astype(bool)
