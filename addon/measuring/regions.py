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
    """Pixels of an image, in runs along its rows.

    row, start, stop: (n,) int, the row of each run, its first column and the one after its last.
    """

    row: np.ndarray
    start: np.ndarray
    stop: np.ndarray

    def values(self, image: np.ndarray) -> np.ndarray:
        """(n,) values of an image (h, w) in these pixels, row by row from the bottom, of a line from its start."""
        runs = zip(self.row.tolist(), self.start.tolist(), self.stop.tolist(), strict=True)
        return np.concatenate([np.empty(0, image.dtype), *(image[row, start:stop] for row, start, stop in runs)])

    def pixel(self, index: int) -> tuple[int, int]:
        """(row, column) of one of the `values` by its index."""
        ends = np.cumsum(self.stop - self.start)
        run = int(np.searchsorted(ends, index, "right"))
        return int(self.row[run]), int(self.stop[run] - ends[run] + index)


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
    if kind == "BOX":
        return _box(places, window.shape)
    return (_ellipse if kind == "ELLIPSE" else _polygon)(places, window.shape)


def _listed(pixels: np.ndarray, shape: tuple[int, int]) -> Region:
    """Those of pixels (n, 2), row and column, that are in an image."""
    inside = ((pixels >= 0) & (pixels < shape)).all(axis=1)
    row, column = pixels[inside].T
    return Region(row, column, column + 1)


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


def _box(places: np.ndarray, shape: tuple[int, int]) -> Region:
    """The pixels whose middles lie from the least to below the largest of places (n, 2), x and y."""
    first, stop = (_first_middle(corner, shape[::-1]) for corner in (places.min(axis=0), places.max(axis=0)))
    row = np.arange(first[1], stop[1])
    return _runs(row, np.full(len(row), first[0]), np.full(len(row), stop[0]))


def _first_middle(place: np.ndarray, size) -> np.ndarray:
    """The first pixels, along an axis of so many, whose middles are not below a place; the size if there is none."""
    return np.clip(np.ceil(place - 0.5), 0, size).astype(np.intp)


def _runs(row: np.ndarray, start: np.ndarray, stop: np.ndarray) -> Region:
    """A Region of those runs that are not empty."""
    filled = start < stop
    return Region(row[filled], start[filled], stop[filled])


def _ellipse(places: np.ndarray, shape: tuple[int, int]) -> Region:
    """The pixels whose middles an ellipse holds, in the rectangle between the first two places."""
    middle, half = places[:2].mean(axis=0), np.maximum(np.abs(places[1] - places[0]) / 2.0, 1e-9)
    row = np.arange(shape[0])
    across = 1.0 - ((row + 0.5 - middle[1]) / half[1]) ** 2
    row, reach = row[across >= 0.0], half[0] * np.sqrt(across[across >= 0.0])
    stop = np.clip(np.floor(middle[0] + reach - 0.5) + 1.0, 0, shape[1]).astype(np.intp)  # its outline belongs to it
    return _runs(row, _first_middle(middle[0] - reach, shape[1]), stop)


def _polygon(places: np.ndarray, shape: tuple[int, int]) -> Region:
    """The pixels whose middles a polygon holds, with corners at places (n, 2): a row goes in where it crosses the
    outline for the first time, out at the second time, and so on."""
    crossings = []
    for (x0, y0), (x1, y1) in zip(places, np.roll(places, -1, axis=0), strict=True):
        row = np.arange(*_first_middle(np.array([min(y0, y1), max(y0, y1)]), shape[0]))  # one of two sides has a corner
        at = x0 + (row + 0.5 - y0) * ((x1 - x0) / (y1 - y0) if y1 != y0 else 0.0)
        crossings.append(np.stack((row, _first_middle(at, shape[1])), axis=1))
    row, column = np.concatenate(crossings).T
    order = np.lexsort((column, row))
    row, column = row[order], column[order]
    return _runs(row[::2], column[::2], column[1::2])
