# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tools of tests/real_blender/bench.py must read in its wall of tiles, by hand: pixel by pixel."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from addon.solver.physics.spectrum import sensor_radiance, uniform_edges
from tests.helpers.tiles import COLUMNS, ROWS, kelvin

EDGES = uniform_edges(7.5, 14.0, 2)


def tiles_in(kind: str, places: list[tuple[float, float]]) -> np.ndarray:
    """Temperatures, K, of the tiles that a tool measures: under a spot, or with their middle inside an area."""
    (u0, v0), (u1, v1) = places[0], places[-1]
    if kind == "SPOT":
        return np.array([kelvin[int(v0 * ROWS), int(u0 * COLUMNS)]])
    inside = [
        kelvin[row, column]
        for row in range(ROWS)
        for column in range(COLUMNS)
        if _holds(kind, places, (u0, v0, u1, v1), (column + 0.5) / COLUMNS, (row + 0.5) / ROWS)
    ]
    return np.array(inside)


def _holds(kind: str, places, ends, u: float, v: float) -> bool:
    u0, v0, u1, v1 = ends
    if kind == "BOX":
        return min(u0, u1) <= u < max(u0, u1) and min(v0, v1) <= v < max(v0, v1)
    if kind == "ELLIPSE":
        x, y = (2.0 * u - u0 - u1) / (u1 - u0), (2.0 * v - v0 - v1) / (v1 - v0)
        return x * x + y * y <= 1.0
    corners, crossings = list(zip(places, places[1:] + places[:1], strict=True)), 0
    for (a, b), (c, d) in corners:
        if (b <= v) != (d <= v) and u < a + (v - b) * (c - a) / (d - b):
            crossings += 1
    return crossings % 2 == 1


def seen_as(seen: np.ndarray, emissivity: float, reflected: float) -> np.ndarray:
    """What a camera makes of black tiles, K, if it takes them for grey: S(T) = e S(result) + (1 - e) S(reflected)."""

    def signal(at: float) -> float:
        return float(sensor_radiance(EDGES, np.ones(2), np.array([at]))[0])

    wanted = [(signal(each) - (1.0 - emissivity) * signal(reflected)) / emissivity for each in seen]
    return np.array([brentq(lambda at, s=s: signal(at) - s, 100.0, 900.0, xtol=1e-6) for s in wanted])
