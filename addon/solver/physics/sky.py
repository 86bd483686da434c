# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies: surroundings whose radiance depends on the direction, as a table over all directions."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..scene import Sky
from ..system.kernels import INLINED, njit
from .spectrum import band_radiance

_ROWS = 720  # of a table by zenith angle: a quarter of a degree, between which radiance is linear
_PARTS = 32  # of a band, in each of which a spectral sky has one apparent temperature
_NODES = 4096  # temperatures at which an image's radiance is worked out; between them it is linear, to 1e-6


def sky_size(sky: Sky | None, bands: int) -> int:
    """Bytes of the table of a sky."""
    if sky is None:
        return 0
    return 8 * bands * (sky.kelvin.size if sky.zenith is None else _ROWS)


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


def mean_excess(table: np.ndarray) -> np.ndarray:
    """(b,) mean excess radiance over all directions, of a table with at least one row."""
    rows = len(table)
    ends = np.cos(np.pi * np.arange(rows + 1) / rows)  # of the rows' polar angles
    return np.tensordot(ends[:-1] - ends[1:], table.mean(axis=1), 1) / 2.0


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
