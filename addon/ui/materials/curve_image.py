# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of an emissivity curve, made with numpy alone: thumbnails and the curve over the scene's bands."""

from __future__ import annotations

import numpy as np

BACKGROUND = (0.10, 0.10, 0.11, 1.0)
BAND = (0.17, 0.19, 0.23, 1.0), (0.22, 0.25, 0.30, 1.0)  # neighbouring bands differ
GRID = (0.40, 0.40, 0.42, 1.0)
CURVE = (1.0, 0.62, 0.20, 1.0)
HELD = (0.62, 0.62, 0.62, 1.0)  # outside the points, where the nearest value is held


def draw_curve(
    points: np.ndarray, low: float, high: float, size: tuple[int, int], edges: np.ndarray | None = None
) -> np.ndarray:
    """The curve from `low` to `high` um and from 0 to 1: (h, w, 4) float32 RGBA 0..1, row 0 at the bottom.

    points: (n, 2) [wavelength um, emissivity], ascending; linear between them, constant outside. size: (w, h) pixels.
    edges: (b + 1,) um, band edges to shade; None shades nothing.
    """
    width, height = size
    border = np.linspace(low, high, width + 1)  # um at the borders of the columns
    middle = 0.5 * (border[:-1] + border[1:])
    image = np.empty((height, width, 4), dtype=np.float32)
    image[:] = BACKGROUND
    if edges is not None:
        band = np.searchsorted(edges, middle, side="right") - 1
        for parity, colour in enumerate(BAND):
            image[:, (band >= 0) & (band < len(edges) - 1) & (band % 2 == parity)] = colour
    margin, thickness = 0.04 * height, max(3.0, height / 60.0)
    for value in (0.0, 0.5, 1.0):
        image[int(margin + value * (height - 1 - 2 * margin))] = GRID
    # The line covers, in each column, all values that the curve takes there, so that steep slopes have no gaps.
    at_border = np.interp(border, points[:, 0], points[:, 1])
    lowest, highest = np.minimum(at_border[:-1], at_border[1:]), np.maximum(at_border[:-1], at_border[1:])
    inner = np.searchsorted(border, points[:, 0]) - 1
    inside = (inner >= 0) & (inner < width)
    np.minimum.at(lowest, inner[inside], points[inside, 1])
    np.maximum.at(highest, inner[inside], points[inside, 1])
    bottom = margin + lowest * (height - 2 * margin) - 0.5 * thickness
    top = margin + highest * (height - 2 * margin) + 0.5 * thickness
    row = np.arange(height)[:, None]
    cover = np.clip(np.minimum(row + 1, top) - np.maximum(row, bottom), 0.0, 1.0)[..., None]
    cover[:, 1:] = np.maximum(cover[:, 1:], cover[:, :-1])  # so that steep slopes are no hair lines
    known = (middle >= points[0, 0]) & (middle <= points[-1, 0])
    colour = np.where(known[:, None], CURVE, HELD)
    image += cover * (colour - image)
    return image
