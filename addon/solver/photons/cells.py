# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells: where on a triangle photons start, if what it emits varies over it by textures.

The unit square, from which points of a triangle are warped evenly, is cut into cells of one size. A cell is chosen in
proportion to the power that some of its points tell, or now and then evenly, as these may have missed a bright texel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.interaction import emit_at
from ..geometry.stage import Stage, emission_at, nothing_emitted
from ..geometry.textures import TextureTable
from ..sampling.warps import triangle_point
from ..system.kernels import INLINED, KERNEL, njit

_EVENLY = 1.0 / 16.0  # share of the photons of a triangle that start in any of its cells alike
_MOST_CELLS, _MOST_POINTS = 1 << 21, 1 << 22  # of all triangles
_POINTS = 8  # largest number of points in a cell, along each axis of the square
_COSINE = 2.0 / 3.0  # mean of cosine-distributed directions


class EmissionCells(NamedTuple):
    """The cells of r triangles, in the order of the rows of the TextureTable.

    edge: (r,) int64, cells along each axis of the unit square; 0 of a triangle without cells. first: (r,) int64, where
    its cells begin. cumulative: (cells,) float64, probability of the cells of a triangle up to and with each.
    """

    edge: np.ndarray
    first: np.ndarray
    cumulative: np.ndarray


def build_cells(stage: Stage) -> tuple[EmissionCells, np.ndarray]:
    """The EmissionCells of a stage, and the mean of the absolute excess radiance of all bands over each of these
    triangles, (r,) float64, W m-2 sr-1; NaN where a triangle has no cells."""
    table = stage.surfaces.textures
    texels = _texels_under(table)
    edge = np.ceil(np.sqrt(texels * min(1.0, _MOST_CELLS / max(texels.sum(), 1.0)))).astype(np.int64)
    count = edge**2
    first, mean = np.cumsum(count) - count, np.full(len(edge), np.nan)
    cells = EmissionCells(edge, first, np.empty(int(count.sum())))
    if len(cells.cumulative):
        points = np.sqrt(np.minimum(texels, _MOST_POINTS / count.sum() * count) / np.maximum(count, 1))
        points = np.clip(np.ceil(points), 2, _POINTS).astype(np.int64)
        emitted = nothing_emitted(stage.radiometry.reference.size, np.float64)
        _fill_cells(stage, np.flatnonzero(table.row >= 0), points, cells, emitted, mean)
    return cells, mean


def no_cells(stage: Stage) -> EmissionCells:
    """The EmissionCells of a stage if nothing emits."""
    rows = len(stage.surfaces.textures.uv)
    return EmissionCells(np.zeros(rows, np.int64), np.zeros(rows, np.int64), np.empty(0))


def _texels_under(table: TextureTable) -> np.ndarray:
    """(r,) float64, how many texels of the larger of its images lie under each triangle; 0 where nothing varies."""
    if not len(table.uv):
        return np.zeros(0)
    (ax, ay), (bx, by) = (np.moveaxis(table.uv[:, i] - table.uv[:, 0], -1, 0).astype(np.float64) for i in (1, 2))
    size = np.append(table.size.prod(axis=1), 0)  # last of no image
    images = np.maximum(size[table.temperature_image], np.where(table.mixed >= 0, size[table.share_image], 0))
    texels = np.maximum(0.5 * np.abs(ax * by - ay * bx) * images, 1.0)
    varies = (images > 0) | ((table.mixed >= 0) & (np.ptp(table.share, axis=1) > 0.0))
    return np.where(varies, texels, 0.0)


@njit(**KERNEL)
def _fill_cells(stage, triangle, points, cells, emitted, mean):
    """Fill the cumulative probabilities, and mean (r,). triangle: (n,) int64. points: (r,) int64, on each axis."""
    row = stage.surfaces.textures.row
    for i in range(triangle.size):
        t = triangle[i]
        r = row[t]
        edge, first, side, total = cells.edge[r], cells.first[r], points[r], 0.0
        for c in range(edge * edge):
            power = 0.0
            for p in range(side * side):
                s = (c // edge + (p // side + 0.5) / side) / edge
                w = (c % edge + (p % side + 0.5) / side) / edge
                u, v = triangle_point(s, w)
                radiance = emission_at(stage, emit_at(stage.surfaces, np.int32(2 * t), u, v, _COSINE), emitted)
                for b in range(radiance.size):
                    power += abs(radiance[b])
            total += power
            cells.cumulative[first + c] = total
        if edge > 0:
            mean[r] = total / (edge * edge * side * side)
            for c in range(edge * edge):
                told = cells.cumulative[first + c] / total if total > 0.0 else (c + 1.0) / (edge * edge)
                cells.cumulative[first + c] = (1.0 - _EVENLY) * told + _EVENLY * (c + 1.0) / (edge * edge)


@njit(**INLINED)
def choose_point(cells, r, s, w):
    """A point (u, v) of the triangle in row r of the textures, by two numbers in [0, 1), and its probability density
    over that of even points."""
    edge = cells.edge[r] if r >= 0 else np.int64(0)
    if edge == 0:
        u, v = triangle_point(s, w)
        return u, v, 1.0
    first, low, high = cells.first[r], np.int64(0), edge * edge - 1
    while low < high:
        middle = (low + high) // 2
        if cells.cumulative[first + middle] <= s:
            low = middle + 1
        else:
            high = middle
    before = cells.cumulative[first + low - 1] if low > 0 else 0.0
    chance = cells.cumulative[first + low] - before
    inside = min(max((s - before) / chance, 0.0), 1.0 - 1e-9)
    u, v = triangle_point((low // edge + inside) / edge, (low % edge + w) / edge)
    return u, v, chance * (edge * edge)
