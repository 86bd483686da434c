# SPDX-License-Identifier: GPL-3.0-or-later
"""Choosing sides of triangles at random, in proportion to what they emit or to what arrives on them.

A table of the running sum over all sides would take more memory than their triangles. What a side weighs follows from
the area of its triangle, what each m2 of it emits, and a factor of its sheet. So only the sums before blocks of
triangles are kept, and those of the sides of a block are made when one of them is chosen.
"""

from typing import NamedTuple

import numpy as np

from ..geometry.surfaces import Surfaces
from ..geometry.triangles import area_of
from ..system.kernels import INLINED, KERNEL, njit

_BLOCK = 16  # triangles
_BELOW_ONE = 1.0 - 2.0**-53  # the largest float64 below 1


class SideTable(NamedTuple):
    """A discrete distribution over the sides of all triangles. A side weighs area * exitance * factor.

    order: (t,) int32, triangles in the order in which they are added up; (0,) as they are numbered. exitance: (t,)
    float32, W m-2, of either side of a triangle; (0,) counts as 1. factor: (labels,) float64, of each sheet.
    before: (blocks + 1,) float64, sum of all weights before each block of _BLOCK triangles, last that of all.
    """

    order: np.ndarray
    exitance: np.ndarray
    factor: np.ndarray
    before: np.ndarray


class Found(NamedTuple):
    """A side in a SideTable. entry: 2 n + side, the triangle being the n-th of the order. low, high: sum of the weights
    before it and with it: it is chosen by numbers from low to below high."""

    entry: int
    low: float
    high: float


def build_side_table(
    surfaces: Surfaces, factor: np.ndarray, exitance: np.ndarray | None = None, order: np.ndarray | None = None
) -> SideTable:
    """The SideTable of these factors, exitances and this order; None stands for an empty array."""
    order = np.empty(0, np.int32) if order is None else order
    exitance = np.empty(0, np.float32) if exitance is None else exitance
    blocks = -(-len(surfaces.sheet) // _BLOCK)
    table = SideTable(order, exitance, np.ascontiguousarray(factor, np.float64), np.zeros(blocks + 1))
    _add_up(surfaces, table)
    return table


def unweighted(exitance: np.ndarray) -> SideTable:
    """A SideTable that tells of the power of sides alone, in the order of their numbers."""
    return SideTable(np.empty(0, np.int32), exitance, np.empty(0), np.zeros(1))


@njit(**KERNEL)
def _add_up(surfaces, table):
    """Fill in the sums before the blocks."""
    total, triangles = 0.0, surfaces.sheet.shape[0]
    for place in range(triangles):
        total += weight_of(surfaces, table, 2 * place)
        total += weight_of(surfaces, table, 2 * place + 1)
        if (place + 1) % _BLOCK == 0 or place + 1 == triangles:
            table.before[place // _BLOCK + 1] = total


@njit(**INLINED)
def side_at(table, entry):
    """The side_id of entry 2 n + side."""
    return entry if table.order.size == 0 else 2 * np.int64(table.order[entry >> 1]) + (entry & 1)


@njit(**INLINED)
def power_of(surfaces, table, t):
    """What either side of triangle t weighs without the factor of its sheet: W, its power, where exitance is known."""
    area = area_of(surfaces.corners, t)
    return area * table.exitance[t] if table.exitance.size else area


@njit(**INLINED)
def weight_of(surfaces, table, entry):
    """The weight of an entry."""
    side_id = side_at(table, entry)
    factor = table.factor[surfaces.sheet[side_id >> 1, side_id & 1]]
    return factor * power_of(surfaces, table, side_id >> 1) if factor > 0.0 else 0.0


@njit(**INLINED)
def number_in(share, total):
    """A number below the total, by a share of it in [0, 1]."""
    return min(share, _BELOW_ONE) * total


@njit(**INLINED)
def first_found(table, number):
    """Where to begin to look for the side that a number chooses, see `found_from`."""
    low, high = np.int64(0), np.int64(table.before.size - 2)
    while low < high:
        middle = (low + high) // 2
        if table.before[middle + 1] <= number:
            low = middle + 1
        else:
            high = middle
    return Found(2 * _BLOCK * low - 1, table.before[low], table.before[low])


@njit(**INLINED)
def found_from(surfaces, table, number, found):
    """The side that a number below the sum of all weights chooses. found: what a smaller number has chosen, or where to
    begin."""
    entry, low, high = found
    while high <= number:
        entry += 1
        if entry % (2 * _BLOCK) == 0:
            block = entry // (2 * _BLOCK)
            while table.before[block + 1] <= number:  # nothing in there
                block += 1
            entry, high = 2 * _BLOCK * block, table.before[block]
        low = high
        high = low + weight_of(surfaces, table, entry)
    return Found(entry, low, high)
