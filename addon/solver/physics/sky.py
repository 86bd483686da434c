# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies: surroundings whose radiance depends on the direction, as a table over all directions."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from ..scene import Sky
from ..system.kernels import INLINED, njit
from .spectrum import band_radiance

_ROWS = 720  # of a table by zenith angle: a quarter of a degree, between which radiance is linear
_PARTS = 32  # of a band, in each of which a spectral sky has one apparent temperature
# Mean square of the radiance over the square of its mean, from which on directions are chosen by the sky. By
# tests/benchmarks/hot_sky.py 1 / (noise^2 x time) is then, over that without, among diffuse surfaces and with a rough
# wall: 157 and 132 for a spot of 1.5 degrees radius (2375), 97 and 38 for 3 degrees (830), 7.3 and 4.5 for 6 degrees
# (275), 7.5 and 2.8 for a less hot one (125), 1.2 and .57 for 12 degrees (66), .14 and .16 for 20 degrees (25).
_CONCENTRATED = 100.0
_NODES = 4096  # temperatures at which an image's radiance is worked out; between them it is linear, to 1e-6


def sky_size(sky: Sky | None, bands: int) -> int:
    """Bytes of the table of a sky, and of its cells."""
    if sky is None:
        return 0
    return 8 * (bands + 1) * (sky.kelvin.size if sky.zenith is None else _ROWS)


def build_sky_table(sky: Sky | None, edges: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(rows, columns, b) float64 radiance of a sky in excess of the reference (b,), W m-2 sr-1; (0, 0, b) without one.

    Row 0 looks straight down, the last one up, column 0 towards -x and on by way of +y, as in Blender's
    equirectangular images; values lie in the middles of rows and columns.
    """
    if sky is None:
        return np.empty((0, 0, len(reference)))
    if sky.zenith is None:
        return _radiance_of(sky.kelvin, edges) - reference
    angle = 180.0 - (np.arange(_ROWS) + 0.5) * 180.0 / _ROWS
    columns = sky.kelvin.reshape(len(sky.zenith), -1).T
    kelvin = np.column_stack([np.interp(angle, sky.zenith, column) for column in columns])
    if sky.wavelengths is None:
        return (_radiance_of(kelvin[:, 0], edges) - reference)[:, None]
    return (_spectral_radiance(kelvin, sky.wavelengths, edges) - reference)[:, None]


class SkyCells(NamedTuple):
    """Directions to be chosen in proportion to the brightness of a sky above its mean: cells, one for each value of its
    table. What is darker than the mean is left to rays in all directions (Karlik et al., MIS Compensation, 2019).

    cumulative: (rows * columns,) float64, probability of the cells up to and with each, row by row; (0,) where no
        directions are chosen so.
    rows, columns: of the table.
    mean: W m-2 sr-1, mean over all directions of what the absolute values of all bands' excess radiance are above their
        mean.
    """

    cumulative: np.ndarray
    rows: int
    columns: int
    mean: float


def no_sky_cells() -> SkyCells:
    """The SkyCells of a sky of which no direction is better than others."""
    return SkyCells(np.empty(0), 0, 0, 0.0)


def build_sky_cells(table: np.ndarray) -> SkyCells:
    """The SkyCells of a table, see build_sky_table; none for a sky that is even enough for rays in all directions."""
    if table.size == 0:
        return no_sky_cells()
    bright = np.abs(table).sum(axis=2)
    solid = np.broadcast_to(np.diff(_row_ends(len(table)))[:, None] / (2.0 * table.shape[1]), bright.shape)
    mean, square = float(np.sum(bright * solid)), float(np.sum(bright**2 * solid))
    if square <= _CONCENTRATED * mean * mean:
        return no_sky_cells()
    # the light of a cell is linear between its own value and those around it
    spread = 0.5 * bright + 0.25 * (np.roll(bright, 1, 1) + np.roll(bright, -1, 1))
    below, above = np.vstack((spread[:1], spread[:-1])), np.vstack((spread[1:], spread[-1:]))
    cumulative = np.cumsum(np.maximum(0.5 * spread + 0.25 * (below + above) - mean, 0.0) * solid)
    return SkyCells(cumulative / cumulative[-1], *bright.shape, float(cumulative[-1]))


def _row_ends(rows: int) -> np.ndarray:
    """(rows + 1,) heights, sines of the elevation, between the rows of a table."""
    return -np.cos(np.pi * np.arange(rows + 1) / rows)


@njit(**INLINED)
def choose_direction(cells, s, w):
    """A direction, by two numbers in [0, 1), with the density of density_towards."""
    cell = np.searchsorted(cells.cumulative, s, side="right")  # below the last, which is 1
    before = cells.cumulative[cell - 1] if cell > 0 else 0.0
    inside = (s - before) / (cells.cumulative[cell] - before)
    row, column = cell // cells.columns, cell % cells.columns
    bottom, top = -math.cos(math.pi * row / cells.rows), -math.cos(math.pi * (row + 1) / cells.rows)
    z, turn = bottom + w * (top - bottom), math.pi * (1.0 - 2.0 * (column + inside) / cells.columns)
    across = math.sqrt(max(0.0, 1.0 - z * z))
    return across * math.cos(turn), across * math.sin(turn), z


@njit(**INLINED)
def density_towards(cells, direction):
    """Density, sr-1, with which choose_direction finds a direction (any length); 0 without cells."""
    if cells.cumulative.size == 0:
        return 0.0
    x, y, z = direction
    v = (math.atan2(z, math.hypot(x, y)) / math.pi + 0.5) * cells.rows
    u = (0.5 - math.atan2(y, x) / (2.0 * math.pi)) * cells.columns
    row = np.int64(min(max(v, 0.0), cells.rows - 1.0))
    cell = row * cells.columns + np.int64(min(max(u, 0.0), cells.columns - 1.0))
    height = math.cos(math.pi * row / cells.rows) - math.cos(math.pi * (row + 1) / cells.rows)
    before = cells.cumulative[cell - 1] if cell > 0 else 0.0
    return (cells.cumulative[cell] - before) * cells.columns / (2.0 * math.pi * height)


def mean_excess(table: np.ndarray) -> np.ndarray:
    """(b,) mean excess radiance over all directions, of a table with at least one row."""
    return np.tensordot(np.diff(_row_ends(len(table))), table.mean(axis=1), 1) / 2.0


def _radiance_of(kelvin: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(..., b) radiance of blackbodies at temperatures (...), by interpolation if there are many."""
    if kelvin.size <= _NODES:
        return band_radiance(edges, kelvin.ravel().astype(np.float64)).reshape(*kelvin.shape, -1)
    nodes = np.linspace(float(kelvin.min()), float(kelvin.max()), _NODES)
    known = band_radiance(edges, nodes)
    return np.stack([np.interp(kelvin, nodes, of_band) for of_band in known.T], axis=-1)


def _spectral_radiance(kelvin: np.ndarray, wavelengths: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n, b) radiance of apparent temperatures (n, m) at wavelengths (m,), of each band in parts of one temperature."""
    share = np.arange(_PARTS + 1) / _PARTS
    radiance = np.zeros((len(kelvin), len(edges) - 1))
    for band in range(len(edges) - 1):
        fine = edges[band] + share * (edges[band + 1] - edges[band])
        for low, high in itertools.pairwise(fine):
            of_part = np.array([np.interp(0.5 * (low + high), wavelengths, row) for row in kelvin])
            radiance[:, band] += band_radiance(np.array([low, high]), of_part)[:, 0]
    return radiance


@njit(**INLINED)
def fill_sky(table, direction, out):
    """Fill out (b,) with the excess radiance of a sky in a direction (any length), linear between values."""
    x, y, z = direction
    rows, columns = table.shape[0], table.shape[1]
    v = (math.atan2(z, math.hypot(x, y)) / math.pi + 0.5) * rows - 0.5
    u = (0.5 - math.atan2(y, x) / (2.0 * math.pi)) * columns - 0.5
    v = min(max(v, 0.0), rows - 1.0)
    row, column = min(int(v), max(rows - 2, 0)), int(math.floor(u))
    above, right = v - row, u - column
    next_row, here, beside = min(row + 1, rows - 1), column % columns, (column + 1) % columns
    for b in range(out.size):
        low = (1.0 - right) * table[row, here, b] + right * table[row, beside, b]
        high = (1.0 - right) * table[next_row, here, b] + right * table[next_row, beside, b]
        out[b] = (1.0 - above) * low + above * high


@njit(inline="always")  # as it returns a row, see kernels
def radiance_from(surroundings, direction, room):
    """(b,) float64 excess radiance in a direction (any length), W m-2 sr-1: a row of the Surroundings (see
    photons.emission), or the room (b,) float64."""
    row = surroundings.radiance
    if surroundings.sky.size > 0:
        fill_sky(surroundings.sky, direction, room)
        row = room
    return row
