# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells: where on a triangle photons start, and where shadow rays go, if what it emits varies over it by textures.

The unit square, from which points of a triangle are warped evenly, is cut into cells of one size. A cell is chosen in
proportion to the power that some of its points tell, or that those around it have, as its points may have missed a part
of a bright texel, or now and then evenly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.interaction import emit_at
from ..geometry.stage import Stage, emission_at, nothing_emitted
from ..geometry.textures import TextureTable
from ..physics.radiometry import absolute_sum
from ..sampling.warps import triangle_point
from ..scene import Textures
from ..system.kernels import INLINED, KERNEL, njit

# shares of the photons of a triangle that start next to a cell, and in any cell alike
_NEXT_TO, _EVENLY = 1.0 / 8.0, 1.0 / 16.0
_FEWEST_CELLS = 256  # of a triangle, as its edges and those of texels cut cells in two
_MOST_CELLS, _MOST_POINTS = 1 << 21, 1 << 22  # of all triangles
_POINTS = 8  # most points in a cell, along each axis of the square
_COSINE = 2.0 / 3.0  # mean of cosine-distributed directions


class EmissionCells(NamedTuple):
    """The cells of r triangles, in the order of the rows of the TextureTable.

    row: (t,) int32, which of them a triangle is, -1 for none; (0,) if none is. edge: (r,) int64, cells along each axis
        of the unit square; 0 of a triangle without cells. first: (r,) int64, where its cells begin.
    mean: (r,) float64, W m-2 sr-1, mean over the triangle of the excess radiance, all bands' absolute values.
    cumulative: (cells,) float64, probability of the cells of a triangle up to and with each.
    """

    row: np.ndarray
    edge: np.ndarray
    first: np.ndarray
    mean: np.ndarray
    cumulative: np.ndarray


def build_cells(stage: Stage) -> EmissionCells:
    """The EmissionCells of a stage."""
    table = stage.surfaces.textures
    texels = _texels_under(table)
    edge = np.ceil(np.sqrt(texels * min(1.0, _MOST_CELLS / max(texels.sum(), 1.0)))).astype(np.int64)
    count = edge**2
    cells = EmissionCells(table.row, edge, np.cumsum(count) - count, np.zeros(len(edge)), np.empty(int(count.sum())))
    if len(cells.cumulative):
        side = int(np.clip(np.sqrt(_MOST_POINTS / len(cells.cumulative)), 2, _POINTS))
        emitted = nothing_emitted(stage.radiometry.reference.size, np.float64)
        told, triangle = np.empty(len(cells.cumulative)), np.flatnonzero(table.row >= 0)
        _fill_told(stage, triangle, side, cells, emitted, told)
        _fill_chances(triangle, cells, told)
    return cells


def no_cells() -> EmissionCells:
    """The EmissionCells if nothing varies."""
    return EmissionCells(np.empty(0, np.int32), *np.empty((2, 0), np.int64), *np.empty((2, 0)))


def bytes_of_textures(textures: Textures | None) -> float:
    """Bytes of the textures of a scene, as kernels have them, and of cells, see memory."""
    if textures is None:
        return 0.0
    texels, rows = sum(image.values.size for image in textures.images), len(textures.triangle)
    return 4.0 * texels + 16.0 * min(_MOST_CELLS, _FEWEST_CELLS * rows + texels) + 80.0 * rows


def concentration(cells: EmissionCells) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (n,) over which emission varies, and the mean (n,) float64, over what each emits, of its radiance over
    that of the whole triangle: 1 where it is even, k where all comes from a k-th of it."""
    if not cells.cumulative.size:
        return np.empty(0, np.int64), np.empty(0)
    chance = np.diff(cells.cumulative, prepend=0.0)
    chance[cells.first[cells.edge > 0]] = cells.cumulative[cells.first[cells.edge > 0]]
    row = np.repeat(np.arange(len(cells.edge)), cells.edge**2)
    mean = np.bincount(row, chance**2, len(cells.edge)) * cells.edge**2
    varies = np.flatnonzero(cells.row >= 0)
    return varies, np.maximum(mean[cells.row[varies]], 1.0)


def _texels_under(table: TextureTable) -> np.ndarray:
    """(r,) float64, how many texels of the larger of its images lie under each triangle; 0 where nothing varies."""
    if not len(table.uv):
        return np.zeros(0)
    (ax, ay), (bx, by) = (np.moveaxis(table.uv[:, i] - table.uv[:, 0], -1, 0).astype(np.float64) for i in (1, 2))
    size = np.append(table.size.prod(axis=1), 0)  # last of no image
    images = np.maximum(size[table.temperature_image], np.where(table.mixed >= 0, size[table.share_image], 0))
    texels = np.maximum(0.5 * np.abs(ax * by - ay * bx) * images, _FEWEST_CELLS)
    varies = (images > 0) | ((table.mixed >= 0) & (np.ptp(table.share, axis=1) > 0.0))
    return np.where(varies, texels, 0.0)


@njit(**KERNEL)
def _fill_told(stage, triangle, side, cells, emitted, told):
    """Fill told (cells,) with the mean radiance, all bands' absolute values, at side x side points of each cell of the
    triangles (n,)."""
    for t in triangle:
        row = cells.row[t]
        edge, first = cells.edge[row], cells.first[row]
        for c in range(edge * edge):
            total = 0.0
            for p in range(side * side):
                s = (c // edge + (p // side + 0.5) / side) / edge
                w = (c % edge + (p % side + 0.5) / side) / edge
                u, v = triangle_point(s, w)
                radiance = emission_at(stage, emit_at(stage.surfaces, np.int32(2 * t), u, v, _COSINE), emitted)
                total += absolute_sum(radiance)
            told[first + c] = total / (side * side)


@njit(**KERNEL)
def _fill_chances(triangle, cells, told):
    """Fill the cumulative probabilities and the mean. told: see _fill_told."""
    for t in triangle:
        row = cells.row[t]
        edge, first, total, around, before = cells.edge[row], cells.first[row], 0.0, 0.0, 0.0
        for c in range(edge * edge):
            total += told[first + c]
            around += _around(told, first, edge, c)
        if edge > 0:
            cells.mean[row] = total / (edge * edge)
        for c in range(edge * edge):
            chance = 1.0 / (edge * edge)
            if total > 0.0:
                chance *= _EVENLY
                chance += (1.0 - _EVENLY - _NEXT_TO) * told[first + c] / total
                chance += _NEXT_TO * _around(told, first, edge, c) / around
            before += chance
            cells.cumulative[first + c] = before


@njit(**INLINED)
def _around(told, first, edge, c):
    """Sum over the 3 x 3 cells around cell c of a triangle, as far as these are in the square."""
    total = 0.0
    for i in range(max(c // edge - 1, 0), min(c // edge + 2, edge)):
        for j in range(max(c % edge - 1, 0), min(c % edge + 2, edge)):
            total += told[first + i * edge + j]
    return total


@njit(**INLINED)
def choose_point(cells, t, s, w):
    """A point (u, v) of triangle t, by two numbers in [0, 1), and its probability density over that of even points."""
    row = cells.row[t] if cells.row.size else np.int32(-1)
    edge = cells.edge[row] if row >= 0 else np.int64(0)
    if edge == 0:
        u, v = triangle_point(s, w)
        return u, v, 1.0
    first, low, high = cells.first[row], np.int64(0), edge * edge - 1
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


@njit(**INLINED)
def mean_radiance(cells, t):
    """Mean radiance of triangle t, see EmissionCells; 0 where it has no cells."""
    row = cells.row[t] if cells.row.size else np.int32(-1)
    return cells.mean[row] if row >= 0 else 0.0


@njit(**INLINED)
def density_at(cells, t, u, v):
    """Probability density of the point (u, v) of triangle t, see choose_point."""
    row = cells.row[t] if cells.row.size else np.int32(-1)
    edge = cells.edge[row] if row >= 0 else np.int64(0)
    if edge == 0:
        return 1.0
    root, last = u + v, edge - 1  # the warp backwards
    across = v / root if root > 0.0 else 0.0
    cell = min(last, np.int64(root * root * edge)) * edge + max(np.int64(0), min(last, np.int64(across * edge)))
    before = cells.cumulative[cells.first[row] + cell - 1] if cell > 0 else 0.0
    return (cells.cumulative[cells.first[row] + cell] - before) * (edge * edge)
