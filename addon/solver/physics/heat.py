# SPDX-License-Identifier: GPL-3.0-or-later
"""Heat: what a blackbody emits in excess of one at T0, as a table over temperature, for gas whose temperature varies.

The nodes of the table are even in ln T, and T0 is one of them, where the excess is exactly 0: gas at T0 emits nothing.
A temperature is kept as its distance from T0 in steps between nodes, a float32 that is the more precise the nearer it
is to T0, as the excess is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..scene import LEAF, Medium
from ..system.kernels import INLINED, njit
from .radiometry import COLDEST
from .spectrum import band_radiance

# In ln T. Cubic Hermite then errs by less than 1e-5 of the excess up to x = c2 / (lambda T) = 25, see test_grids.
_STEP = 1.0 / 256.0


class HeatTable(NamedTuple):
    """Excess radiance at t temperatures in b bands, W m-2 sr-1.

    excess: (t, b) float64. slope: (t, b) float64, its derivative by ln T times the step. anchor: K, T0, or the highest
    temperature if there is none. coldest: number of the first node, at most 0, counted from the anchor.
    """

    excess: np.ndarray
    slope: np.ndarray
    anchor: float
    coldest: int


def build_heat_table(
    media: tuple[Medium, ...], edges: np.ndarray, quiet: float, reference: np.ndarray
) -> HeatTable | None:
    """The HeatTable of all temperatures in grids; None if there are none. quiet: T0, K, 0 for none. reference: (b,) W
    m-2 sr-1, radiance of a blackbody at T0."""
    ranges = [temperature_range(medium) for medium in media if medium.grid is not None]
    if not ranges:
        return None
    low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
    anchor = quiet if quiet > 0.0 else high
    coldest = min(0, math.floor(math.log(low / anchor) / _STEP))
    hottest = max(1, math.ceil(math.log(high / anchor) / _STEP))
    kelvin = anchor * np.exp(_STEP * np.arange(coldest, hottest + 1))
    excess = band_radiance(edges, kelvin) - reference
    if quiet > 0.0:
        excess[-coldest] = 0.0  # else it would hold the rounding of the reference
    return HeatTable(excess, _STEP * band_radiance(edges, kelvin, derivative=True), anchor, coldest)


def steps_from_anchor(heat: HeatTable, medium: Medium) -> np.ndarray:
    """(n, 8, 8, 8) float32, how far the cells of a medium's grid are from the anchor, in steps of ln T. Colder than
    COLDEST counts as that, where no band holds radiance to speak of."""
    kelvin = cell_temperatures(medium)
    steps = np.maximum(kelvin, COLDEST, dtype=np.float64)  # float32 would be too coarse near the anchor
    steps /= heat.anchor  # in place, as grids may be large
    np.log(steps, out=steps)
    steps /= _STEP
    return steps.astype(np.float32)


def cell_temperatures(medium: Medium) -> np.ndarray:
    """(n, 8, 8, 8) float32 K of the cells of a medium's grid."""
    given, cells = medium.grid.temperature, (len(medium.grid.leaves), LEAF, LEAF, LEAF)
    return np.broadcast_to(np.float32(medium.temperature), cells) if given is None else given


def temperature_range(medium: Medium) -> tuple[float, float]:
    """Lowest and highest temperature, K, of the cells of a medium's grid that hold gas, not below COLDEST."""
    kelvin, holds = cell_temperatures(medium), medium.grid.holds
    low = np.min(kelvin, where=holds, initial=np.inf)
    if low == np.inf:
        return COLDEST, COLDEST
    return max(float(low), COLDEST), max(float(np.max(kelvin, where=holds, initial=0.0)), COLDEST)


@njit(**INLINED)
def between_nodes(heat, steps):
    """Row of the table below a temperature, see steps_from_anchor, and the four weights of cubic Hermite there: of
    excess and slope in this row, and in the next."""
    below = math.floor(steps)
    row = min(max(int(below) - heat.coldest, 0), heat.excess.shape[0] - 2)
    t = steps - (row + heat.coldest)
    return row, ((1.0 + 2.0 * t) * (1.0 - t) ** 2, t * (1.0 - t) ** 2, t * t * (3.0 - 2.0 * t), t * t * (t - 1.0))
