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
from ..physics.mixtures import place_among_nodes
from ..scene import LEAF, Medium
from ..system.kernels import INLINED, KERNEL, njit

_BITS = 3  # 2^3 is LEAF
_MISSING, _OUTSIDE = -1, -2
AHEAD = -1.0  # amount in a stretch that a ray has not reached
# Cells that a ray looks at before it asks what they do to each band: so many come from memory at once, where each alone
# would be waited for. Rays in all directions then take 22 % less time; 16 brought 13 %, 64 16 %.
_CELLS_AHEAD = 32


class GridTable(NamedTuple):
    """The g grids of m media.

    number: (m,) int64, the grid of each medium, -1 for none. to_index: (g, 3, 4) float64, from the scene's space to
    index space. low: (g, 3) int64, lowest leaf coordinates. count: (g, 3) int64, places for leaves along each axis.
    first: (g,) int64, where the places of each grid begin in leaf. leaf: (p,) int32, number of the leaf at a place, the
    last axis fastest, -1 where there is none. cells: (n,) float32, of each cell its density and its temperature as
    steps_from_anchor; where its medium has components (see Medium), the density is 1 if there is any gas, and that of
    the temperature among the nodes of the mixture and the amounts of the components follow. Cell by cell, the last axis
    fastest, leaf by leaf, grid by grid. begin: (g,) int64, where those of each grid begin. width: (g,) int64, values of
    a cell. heat: of all temperatures.
    """

    number: np.ndarray
    to_index: np.ndarray
    low: np.ndarray
    count: np.ndarray
    first: np.ndarray
    leaf: np.ndarray
    cells: np.ndarray
    begin: np.ndarray
    width: np.ndarray
    heat: HeatTable


class Line(NamedTuple):
    """A ray in the index space of a grid: its origin, and the inverse of its direction, infinite where that is 0."""

    x: float
    y: float
    z: float
    inverse_x: float
    inverse_y: float
    inverse_z: float


class Cell(NamedTuple):
    """The cell of a grid that a ray comes to next.

    x, y, z: int64, its coordinates. leaf: int64, the one that holds it, _MISSING if none does, _OUTSIDE the box of the
    grid. plane_x, plane_y, plane_z: distance at which the ray meets the next plane between cells on each axis.
    """

    x: int
    y: int
    z: int
    leaf: int
    plane_x: float
    plane_y: float
    plane_z: float


class Gas(NamedTuple):
    """What a ray finds where it is. amount: factor on the medium's coefficients. until: distance at which it changes.
    steps: the temperature, see steps_from_anchor. place: int64, where the values of the cell begin among all cells."""

    amount: float
    until: float
    steps: float
    place: int


class Ahead(NamedTuple):
    """The next cells of a ray that hold gas: amount (n,) float64, of gas in each, in m of amount 1 as far as the ray's
    direction has unit length; steps (n,) float64 and place (n,) int64, see Gas."""

    amount: np.ndarray
    steps: np.ndarray
    place: np.ndarray


class March(NamedTuple):
    """Where rays are on the stretches of their segments, see segments.Air: s stretches, or none without grids. What is
    alone on its segment is followed without.

    amount: (s,) float64, factor on the medium's coefficients here, 0 behind the stretch, AHEAD before it. until: (s,)
    float64, distance at which it changes next. steps (s,) float64, place (s,) int64: see Gas.
    Of stretches in grids: line (s, 6) float64, a Line. cell (s, 4) int64 and planes (s, 3) float64: a Cell.
    """

    amount: np.ndarray
    until: np.ndarray
    steps: np.ndarray
    place: np.ndarray
    line: np.ndarray
    cell: np.ndarray
    planes: np.ndarray


def empty_march(count: int, grids: bool) -> March:
    """Room for count stretches."""
    inside = count if grids else 0
    return March(
        *np.empty((3, count)),
        np.empty(inside, np.int64),
        np.empty((inside, 6)),
        np.empty((inside, 4), np.int64),
        np.empty((inside, 3)),
    )


def empty_ahead() -> Ahead:
    """Room for _CELLS_AHEAD cells."""
    return Ahead(*np.empty((2, _CELLS_AHEAD)), np.empty(_CELLS_AHEAD, np.int64))


def place_grids(media: tuple[Medium, ...], centre: np.ndarray) -> GridTable:
    """The GridTable of media, without values of cells. centre: (3,) m, subtracted from world coordinates."""
    number, grids = np.full(len(media), -1), [medium.grid for medium in media if medium.grid is not None]
    number[[medium.grid is not None for medium in media]] = np.arange(len(grids))
    boxes = [grid.box for grid in grids]
    places = [int(count.prod()) for _, count in boxes]
    leaf = np.full(sum(places), _MISSING, np.int32)
    first = np.concatenate(([0], np.cumsum(places, dtype=np.int64)))
    for grid, (low, count), begin in zip(grids, boxes, first[:-1], strict=True):
        leaf[begin + np.ravel_multi_index((grid.leaves - low).T, count)] = np.arange(len(grid.leaves))
    move = np.eye(4)
    move[:3, 3] = centre
    to_index = [(np.linalg.inv(grid.matrix) @ move)[:3] for grid in grids]
    low, count = (np.array([box[i] for box in boxes], np.int64).reshape(-1, 3) for i in (0, 1))
    no_heat = HeatTable(np.zeros((2, 1)), np.zeros((2, 1)), 1.0, 0)
    to_index = np.array(to_index).reshape(-1, 3, 4)
    cells = np.empty(0, np.float32), *np.empty((2, 0), np.int64)
    return GridTable(number, to_index, low, count, first[:-1], leaf, *cells, no_heat)


def _content(medium: Medium) -> tuple:
    """What tells whether the grids of two media have the same cells: their arrays, or their own temperature."""
    grid = medium.grid
    hot = medium.temperature if grid.temperature is None else id(grid.temperature)
    fractions = bool(medium.components), *map(id, grid.fractions.values())
    return id(grid.leaves), id(grid.density), grid.temperature is None, hot, fractions


def fill_cells(grids: GridTable, media: tuple[Medium, ...], heat: HeatTable) -> GridTable:
    """A GridTable with the values of its cells; instances of one grid share them."""
    with_grids = [medium for medium in media if medium.grid is not None]
    one_of = {_content(medium): medium for medium in with_grids}
    shapes = [(len(medium.grid.leaves), LEAF, LEAF, LEAF, _width(medium)) for medium in one_of.values()]
    ends = np.cumsum([math.prod(shape) for shape in shapes])
    cells = np.empty(ends[-1], np.float32)
    for medium, shape, of_grid in zip(one_of.values(), shapes, np.split(cells, ends[:-1]), strict=True):
        _write_cells(of_grid.reshape(shape), medium, heat)
    starts = dict(zip(one_of, (0, *ends[:-1]), strict=True))
    begin, width = np.array([(starts[_content(medium)], _width(medium)) for medium in with_grids], np.int64).T.copy()
    return grids._replace(cells=cells, begin=begin, width=width, heat=heat)


def _width(medium: Medium) -> int:
    """Values of a cell, see GridTable."""
    return 3 + len(medium.components) if medium.components else 2


def _write_cells(cells: np.ndarray, medium: Medium, heat: HeatTable) -> None:
    """Fill cells (n, 8, 8, 8, width) float32 of a medium's grid, see GridTable."""
    grid = medium.grid
    density = 1.0 if grid.density is None else grid.density
    cells[..., 0] = grid.holds if medium.components else density
    cells[..., 1] = steps_from_anchor(heat, medium)
    if medium.components:
        cells[..., 2] = place_among_nodes(medium)
    for place, component in enumerate(medium.components, 3):
        amounts = grid.amounts(component)
        cells[..., place] = 1.0 if amounts is None else amounts


def memory_of_grids(media: tuple[Medium, ...]) -> dict[str, float]:
    """Bytes that fill_cells takes at its peak for the cells of each medium with a grid, by name, beyond the grids
    themselves. Media that share the cells of another have no more than an index of leaves of their own.

    Each value of a cell takes 4, and 16 more do while its temperature is converted.
    """
    needed, filled = {}, set()
    for medium in media:
        if medium.grid is not None:
            needed[medium.name] = needed.get(medium.name, 0.0) + 4.0 * float(medium.grid.box[1].prod())
            if _content(medium) not in filled:
                filled.add(_content(medium))
                needed[medium.name] += (4.0 * _width(medium) + 16.0) * LEAF**3 * len(medium.grid.leaves)
    return needed


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
def enter_grid(grids, g, ray, t):
    """The Line of a ray in the index space of grid g, and the Cell where it is at t. ray: origin and direction (3,)."""
    m, (origin, direction) = grids.to_index, ray
    line = Line(
        _to_index(m, g, 0, origin, 1.0),
        _to_index(m, g, 1, origin, 1.0),
        _to_index(m, g, 2, origin, 1.0),
        _inverse(_to_index(m, g, 0, direction, 0.0)),
        _inverse(_to_index(m, g, 1, direction, 0.0)),
        _inverse(_to_index(m, g, 2, direction, 0.0)),
    )
    low, count = grids.low, grids.count
    x = _seat(line.x, line.inverse_x, t, LEAF * low[g, 0], LEAF * (low[g, 0] + count[g, 0]) - 1)
    y = _seat(line.y, line.inverse_y, t, LEAF * low[g, 1], LEAF * (low[g, 1] + count[g, 1]) - 1)
    z = _seat(line.z, line.inverse_z, t, LEAF * low[g, 2], LEAF * (low[g, 2] + count[g, 2]) - 1)
    return line, _cell_at(grids, g, line, x, y, z)


@njit(**INLINED)
def _inverse(d):
    return 1.0 / d if d != 0.0 else np.inf


@njit(**INLINED)
def _seat(o, inverse, t, low, high):
    """One coordinate of the cell where a ray is at t, known to be from low to high."""
    at = o + t / inverse if abs(inverse) < np.inf else o
    return min(max(np.int64(math.floor(at)), low), high)


@njit(**INLINED)
def _cell_at(grids, g, line, x, y, z):
    """The Cell at these coordinates."""
    plane_x = _plane(line.x, line.inverse_x, x, 1)
    plane_y = _plane(line.y, line.inverse_y, y, 1)
    plane_z = _plane(line.z, line.inverse_z, z, 1)
    return Cell(x, y, z, _leaf_at(grids, g, x, y, z), plane_x, plane_y, plane_z)


@njit(**INLINED)
def _plane(o, inverse, low, size):
    """Distance at which a ray leaves what lies from low to low + size on an axis."""
    plane = low + (size if inverse > 0.0 else 0)
    return (plane - o) * inverse if abs(inverse) < np.inf else np.inf


@njit(**INLINED)
def _leaf_at(grids, g, x, y, z):
    """Number of the leaf that holds a cell, _MISSING if there is none there, _OUTSIDE the box of the grid."""
    low, count = grids.low, grids.count
    i, j, k = (x >> _BITS) - low[g, 0], (y >> _BITS) - low[g, 1], (z >> _BITS) - low[g, 2]
    if i < 0 or j < 0 or k < 0 or i >= count[g, 0] or j >= count[g, 1] or k >= count[g, 2]:
        return np.int64(_OUTSIDE)
    return np.int64(grids.leaf[grids.first[g] + (i * count[g, 1] + j) * count[g, 2] + k])


@njit(**INLINED)
def _nearest(x, y, z):
    """The axis on which the next plane is nearest."""
    return 0 if x <= y and x <= z else (1 if y <= z else 2)


@njit(**INLINED)
def _step(grids, g, line, cell):
    """The next Cell of a ray. All that is known of it stays in registers."""
    x, y, z, leaf, plane_x, plane_y, plane_z = cell
    over = _nearest(plane_x, plane_y, plane_z)
    if over == 0:
        here, there = x, x + (1 if line.inverse_x > 0.0 else -1)
        x, plane_x = there, plane_x + abs(line.inverse_x)
    elif over == 1:
        here, there = y, y + (1 if line.inverse_y > 0.0 else -1)
        y, plane_y = there, plane_y + abs(line.inverse_y)
    else:
        here, there = z, z + (1 if line.inverse_z > 0.0 else -1)
        z, plane_z = there, plane_z + abs(line.inverse_z)
    if here >> _BITS != there >> _BITS:
        leaf = _leaf_at(grids, g, x, y, z)
    return Cell(x, y, z, leaf, plane_x, plane_y, plane_z)


@njit(**INLINED)
def _step_over_leaf(grids, g, line, cell, t):
    """The first Cell of the next leaf, and the distance of that, at least t."""
    x, y, z = cell.x & -LEAF, cell.y & -LEAF, cell.z & -LEAF  # the leaf's lowest
    plane_x = _plane(line.x, line.inverse_x, x, LEAF)
    plane_y = _plane(line.y, line.inverse_y, y, LEAF)
    plane_z = _plane(line.z, line.inverse_z, z, LEAF)
    over, t = _nearest(plane_x, plane_y, plane_z), max(t, min(plane_x, plane_y, plane_z))
    next_x = _across(x, line.inverse_x) if over == 0 else _seat(line.x, line.inverse_x, t, x, x + LEAF - 1)
    next_y = _across(y, line.inverse_y) if over == 1 else _seat(line.y, line.inverse_y, t, y, y + LEAF - 1)
    next_z = _across(z, line.inverse_z) if over == 2 else _seat(line.z, line.inverse_z, t, z, z + LEAF - 1)
    return _cell_at(grids, g, line, next_x, next_y, next_z), t


@njit(**INLINED)
def _across(low, inverse):
    """The coordinate of the first cell behind a leaf that begins at low."""
    return low + LEAF if inverse > 0.0 else low - 1


@njit(**INLINED)
def _inside_leaf(cell):
    """Number of a cell in its leaf."""
    x, y, z = cell.x & (LEAF - 1), cell.y & (LEAF - 1), cell.z & (LEAF - 1)
    return (x << 2 * _BITS) | (y << _BITS) | z


@njit(**INLINED)
def _place(grids, g, cell):
    """Where the values of a cell of grid g begin, -1 if no leaf holds it."""
    return grids.begin[g] + grids.width[g] * (cell.leaf * LEAF**3 + _inside_leaf(cell)) if cell.leaf >= 0 else -1


@njit(**INLINED)
def _density(grids, place):
    return 0.0 if place < 0 else float(grids.cells[place])


@njit(**INLINED)
def next_cell(grids, g, line, cell, t, end):
    """The Gas in the Cell of a ray that is at t, and the Cell that comes behind it. Empty cells count as one. end: of
    the ray."""
    place, amount, steps = _place(grids, g, cell), 0.0, 0.0
    density = _density(grids, place)
    if density > 0.0:
        amount, steps = density, float(grids.cells[place + 1])
        t = max(t, min(cell.plane_x, cell.plane_y, cell.plane_z))
        cell = _step(grids, g, line, cell)
    while density == 0.0 and t < end and cell.leaf != _OUTSIDE:
        if cell.leaf == _MISSING:
            cell, t = _step_over_leaf(grids, g, line, cell, t)
        else:
            t = max(t, min(cell.plane_x, cell.plane_y, cell.plane_z))
            cell = _step(grids, g, line, cell)
        density = _density(grids, _place(grids, g, cell))
    until = end if amount == 0.0 == density else min(t, end)
    return Gas(amount, until, steps, place), cell


@njit(**INLINED)
def look_ahead(grids, g, line, cell, ends, ahead):
    """Fill ahead with the next cells that hold gas; returns how many, the Cell behind them, and the distance there.
    ends: distance where the ray is, and where it ends."""
    (t, end), n = ends, 0
    while t < end and n < ahead.amount.size:
        gas, cell = next_cell(grids, g, line, cell, t, end)
        ahead.amount[n], ahead.steps[n], ahead.place[n] = gas.amount * (gas.until - t), gas.steps, gas.place
        t = gas.until
        n += 1 if gas.amount > 0.0 else 0
    return n, cell, t


@njit(**INLINED)
def begin_march(grids, g, march, s, ray, t):
    """Put stretch s into grid g, where its ray is at t. ray: origin and direction (3,)."""
    line, cell = enter_grid(grids, g, ray, t)
    _keep(march, s, cell)
    march.line[s, 0], march.line[s, 1], march.line[s, 2] = line.x, line.y, line.z
    march.line[s, 3], march.line[s, 4], march.line[s, 5] = line.inverse_x, line.inverse_y, line.inverse_z


@njit(**INLINED)
def march_on(grids, g, march, s, t, end):
    """Bring stretch s, which is at t, to what comes next in grid g. end: of the stretch."""
    a, n, p = march.line, march.cell, march.planes
    line = Line(a[s, 0], a[s, 1], a[s, 2], a[s, 3], a[s, 4], a[s, 5])
    cell = Cell(n[s, 0], n[s, 1], n[s, 2], n[s, 3], p[s, 0], p[s, 1], p[s, 2])
    gas, cell = next_cell(grids, g, line, cell, t, end)
    march.amount[s], march.until[s], march.steps[s], march.place[s] = gas
    _keep(march, s, cell)


@njit(**INLINED)
def _keep(march, s, cell):
    n, p = march.cell, march.planes
    n[s, 0], n[s, 1], n[s, 2], n[s, 3] = cell.x, cell.y, cell.z, cell.leaf
    p[s, 0], p[s, 1], p[s, 2] = cell.plane_x, cell.plane_y, cell.plane_z
