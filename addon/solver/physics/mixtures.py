# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixtures: gas in grids whose spectrum changes from cell to cell, with its temperature and its composition.

What a cell absorbs is a sum over the components of its medium (see Medium.components) of how much there is of each,
times the coefficient of the component at the temperature of the cell. That coefficient is tabulated at the temperatures
of the data of molecules (narrow_bands.KELVIN), where it has kinks, and linear in T between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..scene import Medium
from .heat import cell_temperatures, temperature_range

_STEP = 25.0  # K, that of the data
_HOTTEST = 5000.0  # K; hotter cells absorb as at this temperature


class MixtureTable(NamedTuple):
    """c components of m media; media whose spectrum is one everywhere have none.

    first: (m + 1,) int64, where the components of each medium begin. kelvin: (m, t) float64, ascending, where their
    coefficients are known; behind the last, a medium repeats it. absorption: (c, t, b) float64, 1/m, of a unit of each
    in b bands.
    """

    first: np.ndarray
    kelvin: np.ndarray
    absorption: np.ndarray


def empty_mixtures(media: tuple[Medium, ...], bands: int) -> MixtureTable:
    """The MixtureTable of media, whose components absorb nothing yet."""
    first = np.concatenate(([0], np.cumsum([len(medium.components) for medium in media], dtype=np.int64)))
    nodes = [_nodes(medium) if medium.components else np.zeros(1) for medium in media]
    most = max(2, *map(len, nodes))  # so that every node has a next one
    kelvin = np.array([np.pad(each, (0, most - len(each)), "edge") for each in nodes])
    return MixtureTable(first, kelvin, np.zeros((first[-1], most, bands)))


def _nodes(medium: Medium) -> np.ndarray:
    """(t,) float64, K: the lowest temperature of a medium's grid, multiples of _STEP in between, and the highest."""
    low, high = np.minimum(temperature_range(medium), _HOTTEST)
    between = _STEP * np.arange(math.floor(low / _STEP) + 1, math.ceil(high / _STEP))
    return np.unique([low, *between, high])


def place_among_nodes(medium: Medium) -> np.ndarray:
    """(n, 8, 8, 8) float64, where the temperatures of the cells of a medium's grid are among its nodes: 2.25 is a
    quarter of the way from node 2 to the next. What is beyond all nodes is at the last."""
    nodes = _nodes(medium)
    return np.interp(cell_temperatures(medium), nodes, np.arange(len(nodes)))
