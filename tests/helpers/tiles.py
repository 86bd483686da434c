# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of a wall of black tiles, one for each pixel of a render, for both sides of a test in real Blender."""

import numpy as np

COLUMNS, ROWS = 59, 45
LOW, HIGH = 280.0, 340.0  # K

kelvin = np.random.default_rng(7).uniform(LOW, HIGH, (ROWS, COLUMNS))  # of the tiles, row 0 at the bottom


def measured(kind: str, places: list[list[float]]) -> np.ndarray:
    """Temperatures, K, of the tiles that a measuring tool has, one by one: the one under a spot, or those whose middle
    is inside an area. places: its points, (u, v) of each."""
    if kind == "SPOT":
        ((u, v),) = places
        return np.array([kelvin[int(v * ROWS), int(u * COLUMNS)]])
    every = ((row, column) for row in range(ROWS) for column in range(COLUMNS))
    return np.array([kelvin[at] for at in every if _holds(kind, places, (at[1] + 0.5) / COLUMNS, (at[0] + 0.5) / ROWS)])


def _holds(kind: str, places: list[list[float]], u: float, v: float) -> bool:
    """Whether a place (u, v) is inside an area; of a polygon if a ray from it crosses the outline an odd number of
    times."""
    if kind == "POLYGON":
        crossings = 0
        for (a, b), (c, d) in zip(places, places[1:] + places[:1], strict=True):
            crossings += (b <= v) != (d <= v) and u < a + (v - b) * (c - a) / (d - b)
        return crossings % 2 == 1
    (u0, v0), (u1, v1) = places
    if kind == "BOX":
        return min(u0, u1) <= u < max(u0, u1) and min(v0, v1) <= v < max(v0, v1)
    return ((2.0 * u - u0 - u1) / (u1 - u0)) ** 2 + ((2.0 * v - v0 - v1) / (v1 - v0)) ** 2 <= 1.0
