# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids: which cells of a medium's grid a ray crosses, and what is in them.

A ray is straight in the index space of a grid, too, and has the same parameter there. It goes from cell to cell over
the nearest of the next three planes between cells (Amanatides and Woo 1987), and over the box of 8 x 8 x 8 cells of a
missing leaf in one step. Which leaf is where tells an index of all places for leaves in the box around the grid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..physics.heat import HeatTable, steps_from_anchor
from ..scene import LEAF, Medium
from ..system.kernels import INLINED, KERNEL, njit

_BITS = 3  # 2^3 is LEAF
_MISSING, _OUTSIDE = -1, -2
AHEAD = -1.0  # amount in a stretch that a ray has not reached


class GridTable(NamedTuple):
    """The g grids of m media.

    number: (m,) int64, the grid of each medium, -1 for none. to_index: (g, 3, 4) float64, from the scene's space to
    index space. low: (g, 3) int64, lowest leaf coordinates. count: (g, 3) int64, places for leaves along each axis.
    first: (g,) int64, where the places of each grid begin in leaf. leaf: (p,) int32, number of the leaf at a place, the
    last axis fastest, -1 where there is none. cells: (n, 512, 2) float32, density and temperature of the cells of each
    leaf, the last axis fastest; temperature as steps_from_anchor. In grids of media with components (see Medium) the
    density is 1 where there is any gas. heat: of all temperatures. amounts: (q,) float32, of the c components, cell by
    cell as in cells. begin: (c,) int64, where those of each component begin, less the number of its grid's first cell.
    """

    number: np.ndarray
    to_index: np.ndarray
    low: np.ndarray
    count: np.ndarray
    first: np.ndarray
    leaf: np.ndarray
    cells: np.ndarray
    heat: HeatTable
    amounts: np.ndarray
    begin: np.ndarray


class March(NamedTuple):
    """Where rays are on the stretches of their segments, see segments.Air: s stretches, or none without grids.

    amount: (s,) float64, factor on the medium's coefficients here, 0 behind the stretch, AHEAD before it. until: (s,)
    float64, distance at which it changes next. steps: (s,) float64, the temperature, see steps_from_anchor.
    In grids: place (s,) int64, number of the cell here among all cells.
    In index space, of stretches in grids: cell (s, 3) int64, the one that comes next; leaf (s,) int64, the one that
    holds it; crossing (s, 3) float64, distance of the next plane between cells on each axis; origin, inverse (s, 3)
    float64, of the ray, inverse of its direction.
    """

    amount: np.ndarray
    until: np.ndarray
    steps: np.ndarray
    place: np.ndarray
    leaf: np.ndarray
    cell: np.ndarray
    crossing: np.ndarray
    origin: np.ndarray
    inverse: np.ndarray


def empty_march(count: int, grids: bool) -> March:
    """Room for count stretches."""
    inside = count if grids else 0
    return March(
        *np.empty((3, count)),
        *np.empty((2, inside), np.int64),
        np.empty((inside, 3), np.int64),
        *np.empty((3, inside, 3)),
    )


def place_grids(media: tuple[Medium, ...], centre: np.ndarray) -> GridTable:
    """The GridTable of media, without cells. centre: (3,) m, subtracted from world coordinates."""
    number, grids = np.full(len(media), -1), [medium.grid for medium in media if medium.grid is not None]
    number[[medium.grid is not None for medium in media]] = np.arange(len(grids))
    boxes = [grid.box for grid in grids]
    places = [int(count.prod()) for _, count in boxes]
    leaf = np.full(sum(places), _MISSING, np.int32)
    first = np.concatenate(([0], np.cumsum(places, dtype=np.int64)))
    starts = _first_leaves(media)
    for grid, (low, count), begin, start in zip(grids, boxes, first[:-1], starts, strict=True):
        place = np.ravel_multi_index((grid.leaves - low).T, count)
        leaf[begin + place] = start + np.arange(len(grid.leaves))
    move = np.eye(4)
    move[:3, 3] = centre
    to_index = [(np.linalg.inv(grid.matrix) @ move)[:3] for grid in grids]
    low, count = (np.array([box[i] for box in boxes], np.int64).reshape(-1, 3) for i in (0, 1))
    no_heat = HeatTable(np.zeros((2, 1)), np.zeros((2, 1)), 1.0, 0)
    cells = np.empty((0, LEAF**3, 2), np.float32)
    to_index = np.array(to_index).reshape(-1, 3, 4)
    nothing = np.empty(0, np.float32), np.empty(0, np.int64)
    return GridTable(number, to_index, low, count, first[:-1], leaf, cells, no_heat, *nothing)


def _first_leaves(media: tuple[Medium, ...]) -> list[int]:
    """Number of the first leaf of each grid among those of all; grids of the same content share them."""
    starts, count = {}, 0
    contents = [(_content(medium), len(medium.grid.leaves)) for medium in media if medium.grid is not None]
    for content, leaves in contents:
        if content not in starts:
            starts[content] = count
            count += leaves
    return [starts[content] for content, _ in contents]


def _content(medium: Medium) -> tuple:
    """What tells whether the grids of two media have the same cells: their arrays, or their own temperature."""
    grid = medium.grid
    hot = medium.temperature if grid.temperature is None else id(grid.temperature)
    fractions = bool(medium.components), *map(id, grid.fractions.values())
    return id(grid.leaves), id(grid.density), grid.temperature is None, hot, fractions


def fill_cells(grids: GridTable, media: tuple[Medium, ...], heat: HeatTable) -> GridTable:
    """A GridTable with its cells; instances of one grid share them."""
    filled, parts = set(), []
    for medium in media:
        if medium.grid is not None and _content(medium) not in filled:
            filled.add(_content(medium))
            cells = np.empty((len(medium.grid.leaves), LEAF**3, 2), np.float32)
            of_leaf = cells.reshape(-1, LEAF, LEAF, LEAF, 2)
            density = 1.0 if medium.grid.density is None else medium.grid.density
            of_leaf[..., 0] = medium.grid.holds if medium.components else density
            of_leaf[..., 1] = steps_from_anchor(heat, medium)
            parts.append(cells)
    amounts, begin = _amounts(media)
    cells = parts[0] if len(parts) == 1 else np.concatenate(parts)
    return grids._replace(cells=cells, heat=heat, amounts=amounts, begin=begin)


def memory_of_grids(media: tuple[Medium, ...]) -> dict[str, float]:
    """Bytes that fill_cells takes at its peak for the cells of each medium with a grid, by name, beyond the grids
    themselves. Media that share the cells of another have no more than an index of leaves of their own.

    Density and temperature of a cell take 8, and 12 more while the temperature is converted. Later each component takes
    4, and as much again while those of all grids are joined.
    """
    needed, filled = {}, set()
    for medium in media:
        if medium.grid is not None:
            needed[medium.name] = needed.get(medium.name, 0.0) + 4.0 * float(medium.grid.box[1].prod())
            if _content(medium) not in filled:
                filled.add(_content(medium))
                each = max(20.0, 8.0 + 8.0 * len(medium.components))
                needed[medium.name] += each * LEAF**3 * len(medium.grid.leaves)
    return needed


def _amounts(media: tuple[Medium, ...]) -> tuple[np.ndarray, np.ndarray]:
    """`amounts` and `begin` of GridTable; grids that share an array share what is made of it."""
    found, parts, begin, count = {}, [np.empty(0, np.float32)], [], 0
    with_grids = [medium for medium in media if medium.grid is not None]
    for medium, leaf in zip(with_grids, _first_leaves(media), strict=True):
        for component in medium.components:
            values = medium.grid.amounts(component)
            key = id(medium.grid.leaves), id(values)
            if key not in found:
                given = np.asarray(1.0 if values is None else values, np.float32)
                parts.append(np.broadcast_to(given, (len(medium.grid.leaves), LEAF, LEAF, LEAF)).ravel())
                found[key], count = count, count + parts[-1].size
            begin.append(found[key] - leaf * LEAF**3)
    return np.concatenate(parts), np.array(begin, np.int64)


@njit(**KERNEL)
def cross_boxes(grids, g, rays, limit, ray, ends):
    """Fill ray (n,) and ends (n, 2) with the stretches of rays, origin and direction (n, 3), inside the box around the
    leaves of grid g, up to a limit (n,); returns how many."""
    (origin, direction), found = rays, np.int64(0)
    for r in range(limit.size):
        begin, end = 0.0, float(limit[r])
        for axis in range(3):
            o = _to_index(grids.to_index, g, axis, origin[r], 1.0)
            d = _to_index(grids.to_index, g, axis, direction[r], 0.0)
            low = float(LEAF * grids.low[g, axis])
            high = low + LEAF * grids.count[g, axis]
            if d != 0.0:
                near, far = (low - o) / d, (high - o) / d
                begin, end = max(begin, min(near, far)), min(end, max(near, far))
            elif not low <= o < high:
                end = -1.0
        if begin < end:
            ray[found], ends[found, 0], ends[found, 1] = r, begin, end
            found += 1
    return found


@njit(**INLINED)
def _to_index(matrix, g, axis, vector, point):
    """One coordinate of a point (1) or direction (0) in index space."""
    m = matrix[g, axis]
    return m[0] * vector[0] + m[1] * vector[1] + m[2] * vector[2] + m[3] * point


@njit(**INLINED)
def enter_grid(grids, g, march, s, ray, t):
    """Put stretch s into the cell of grid g where its ray is at t. ray: origin and direction (3,)."""
    for axis in range(3):
        march.origin[s, axis] = _to_index(grids.to_index, g, axis, ray[0], 1.0)
        d = _to_index(grids.to_index, g, axis, ray[1], 0.0)
        march.inverse[s, axis] = 1.0 / d if d != 0.0 else np.inf
        low = LEAF * grids.low[g, axis]
        _seat(march, s, axis, t, low, low + LEAF * grids.count[g, axis] - 1)
    march.leaf[s] = _leaf_at(grids, g, march.cell, s)
    march.until[s] = t


@njit(**INLINED)
def _seat(march, s, axis, t, low, high):
    """Set one coordinate of the cell in which stretch s is at t, known to be from low to high."""
    o, inverse = march.origin[s, axis], march.inverse[s, axis]
    at = o + t / inverse if abs(inverse) < np.inf else o
    march.cell[s, axis] = min(max(int(math.floor(at)), low), high)
    _aim(march, s, axis, march.cell[s, axis] + (1 if inverse > 0.0 else 0))


@njit(**INLINED)
def _aim(march, s, axis, plane):
    """Set the distance of the next plane on an axis."""
    inverse = march.inverse[s, axis]
    march.crossing[s, axis] = (plane - march.origin[s, axis]) * inverse if abs(inverse) < np.inf else np.inf


@njit(**INLINED)
def _nearest(crossing, s):
    """The axis on which the next plane is nearest."""
    x, y, z = crossing[s, 0], crossing[s, 1], crossing[s, 2]
    return (0 if x <= z else 2) if x <= y else (1 if y <= z else 2)


@njit(**INLINED)
def _leaf_at(grids, g, cell, s):
    """Number of the leaf that holds the cell of stretch s, MISSING if there is none there, OUTSIDE the box of the
    grid."""
    place = np.int64(0)
    for axis in range(3):
        at = (cell[s, axis] >> _BITS) - grids.low[g, axis]
        if at < 0 or at >= grids.count[g, axis]:
            return np.int64(_OUTSIDE)
        place = place * grids.count[g, axis] + at
    return np.int64(grids.leaf[grids.first[g] + place])


@njit(**INLINED)
def _step(grids, g, march, s):
    """Go to the next cell."""
    over = _nearest(march.crossing, s)
    inverse, here, t = march.inverse[s, over], march.cell[s, over], march.crossing[s, over]
    there = here + 1 if inverse > 0.0 else here - 1
    march.cell[s, over], march.crossing[s, over] = there, t + abs(inverse)
    march.until[s] = max(march.until[s], t)
    if here >> _BITS != there >> _BITS:
        march.leaf[s] = _leaf_at(grids, g, march.cell, s)


@njit(**INLINED)
def _step_over_leaf(grids, g, march, s):
    """Go to the first cell of the next leaf."""
    for axis in range(3):
        corner = march.cell[s, axis] & -LEAF
        _aim(march, s, axis, corner + (LEAF if march.inverse[s, axis] > 0.0 else 0))
    over = _nearest(march.crossing, s)
    march.until[s] = max(march.until[s], march.crossing[s, over])
    for axis in range(3):
        low = march.cell[s, axis] & -LEAF
        high = low + LEAF - 1
        if axis == over:
            low = high = high + 1 if march.inverse[s, axis] > 0.0 else low - 1
        _seat(march, s, axis, march.until[s], low, high)
    march.leaf[s] = _leaf_at(grids, g, march.cell, s)


@njit(**INLINED)
def _inside_leaf(cell, s):
    """Number of the cell of stretch s in its leaf."""
    x, y, z = cell[s, 0] & (LEAF - 1), cell[s, 1] & (LEAF - 1), cell[s, 2] & (LEAF - 1)
    return (x << 2 * _BITS) | (y << _BITS) | z


@njit(**INLINED)
def _density(grids, march, s):
    """Density in the cell of stretch s."""
    leaf = march.leaf[s]
    return 0.0 if leaf < 0 else float(grids.cells[leaf, _inside_leaf(march.cell, s), 0])


@njit(**INLINED)
def next_cell(grids, g, march, s, end):
    """Set amount and temperature to those of the cell that stretch s comes to, and until to where it leaves it. Empty
    cells count as one. end: of the stretch."""
    density = _density(grids, march, s)
    march.amount[s] = density
    if density > 0.0:
        inside = _inside_leaf(march.cell, s)
        march.steps[s], march.place[s] = grids.cells[march.leaf[s], inside, 1], march.leaf[s] * LEAF**3 + inside
        _step(grids, g, march, s)
    while density == 0.0 and march.until[s] < end and march.leaf[s] != _OUTSIDE:
        if march.leaf[s] == _MISSING:
            _step_over_leaf(grids, g, march, s)
        else:
            _step(grids, g, march, s)
        density = _density(grids, march, s)
    march.until[s] = end if march.amount[s] == 0.0 == density else min(march.until[s], end)
