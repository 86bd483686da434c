# SPDX-License-Identifier: GPL-3.0-or-later
"""Free space around points on surfaces: how wide a disk of photons may be before it reaches a wall, and where that is.

A disk that reached beyond a wall would count light from its other side, and close to other surfaces light changes
quickly (Ward's harmonic distance says the same). Short rays along the surface feel for them. What hangs low over the
surface is a wall, too, where its rim hangs. A disk cannot be as small as the space beside a wall; then the wall cuts
it. One bounce later the change matters less than the noise of few photons: there the nearest wall cuts the disk, and
others limit it.
"""

import math
from typing import NamedTuple

import numpy as np

from ..sampling.warps import to_world, turn
from ..system.kernels import KERNEL, njit
from .surfaces import Surfaces, Tracer, facing_side, point, put_ray, unit_normal

_TURNS = 8  # ways to go
_RISES = (0.02, 0.1)  # of two feelers each way, over length: the low one feels low steps, too, and what is close above
_BEYOND = 4.0  # how far they go, over the largest radius: one that comes in under a rim may meet what hangs there later
_FEELERS = _TURNS * len(_RISES)
_HALF = math.sqrt(0.5)
_NEAREST = math.cos(math.pi / 8) ** 2  # a straight wall stands at most 22.5 degrees away from the nearest feeler,
_OTHERS = 0.5  # and, where that one ends at another wall before it, 45 degrees from the next
_ALONG = 0.9  # share of the way to the nearest wall from which on a feeler's end counts as on it
_STEEP = 0.5  # least sine of a wall's angle to the surface: a lower one does not end what lies beyond its line
_RIM_STEPS = 64  # triangles of an overhang that are walked over to its rim
LEAST_FREE = 1.0 / 36.0  # share of the largest disk's area that photons may fill however close the walls


class FreeSpace(NamedTuple):
    """The space around n points.

    radius2: (n,) float32, m2, of the disk that no wall reaches. cut2: (n,) float32, m2, of that which only the nearest
    wall reaches. wall: (n, 3) float32, 1 / m: what lies at p beyond the nearest wall from the point x has
    (p - x) . wall > 1; zeros where there is none.
    """

    radius2: np.ndarray
    cut2: np.ndarray
    wall: np.ndarray


def unlimited(count: int, reach2: float) -> FreeSpace:
    """The free space around so many points without walls."""
    return FreeSpace(*np.full((2, count), reach2, np.float32), np.zeros((count, 3), np.float32))


def free_space(
    tracer: Tracer,
    surfaces: Surfaces,
    reach2: float,
    place: np.ndarray,
    code: np.ndarray,
    turns: np.ndarray,
    felt: np.ndarray | None = None,
) -> FreeSpace:
    """The free space around points, of at most sqrt(reach2) m.

    place: (n, 3) float64, m. code: (n,) int32, 2 triangle + side that they lie on. turns: (n,) float64 in [0, 1),
    where the feelers start to go round. felt: indices of the points around which it is asked for, the others count as
    free; None for all.
    """
    if felt is not None:
        space = unlimited(len(place), reach2)
        for column, known in zip(
            space, free_space(tracer, surfaces, reach2, place[felt], code[felt], turns[felt]), strict=True
        ):
            column[felt] = known
        return space
    origin, direction = np.empty((2, _FEELERS * len(place), 3), np.float32)
    start_feelers(surfaces, place, code, turns, origin, direction)
    reach = np.full(len(origin), _BEYOND * math.sqrt(reach2), np.float32)
    space = unlimited(len(place), reach2)
    shortest_feelers(surfaces, code, *tracer.trace(origin, direction, reach), origin, direction, space)
    return space


@njit(**KERNEL)
def start_feelers(surfaces, place, code, turns, origin, direction):
    """Fill _FEELERS rays for each point."""
    for i in range(code.size):
        t = code[i] >> 1
        x, y, z = place[i]
        nx, ny, nz = unit_normal(surfaces, t, code[i] & 1)
        c, s = turn(turns[i])
        row = _FEELERS * i
        for _ in range(_TURNS):
            for rise in _RISES:
                dx, dy, dz = to_world(c, s, rise, nx, ny, nz)
                put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, row)
                row += 1
            c, s = _HALF * (c - s), _HALF * (c + s)  # by 45 degrees


def shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space):
    """Narrow the space (n points), unlimited so far, to what feelers meet. Of a hollow surface they meet itself: that
    is no wall."""
    ways = np.empty((_FEELERS, 3))  # along the surface, to what the feelers meet
    _shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space, ways)


@njit(**KERNEL)
def _shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space, ways):
    for i in range(code.size):
        nx, ny, nz = unit_normal(surfaces, code[i] >> 1, code[i] & 1)
        own = surfaces.sheet[code[i] >> 1, code[i] & 1]
        nearest = math.inf  # m, to the plane of a wall
        met, reach2 = 0, float(space.radius2[i])
        for row in range(_FEELERS * i, _FEELERS * (i + 1)):
            t = blocker[row]
            if t < 0 or surfaces.sheet[t, facing_side(surfaces, t, direction, row)] == own:
                continue
            x, y, z = point(surfaces.corners, t, u[row], v[row])
            dx, dy, dz = x - origin[row, 0], y - origin[row, 1], z - origin[row, 2]
            share, wx, wy, wz, away = _wall(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz)
            height = dx * nx + dy * ny + dz * nz
            ax, ay, az = share * (dx - height * nx), share * (dy - height * ny), share * (dz - height * nz)
            if ax * ax + ay * ay + az * az > reach2:
                continue
            ways[met, 0], ways[met, 1], ways[met, 2] = ax, ay, az
            met += 1
            if 0.0 < abs(away) < nearest:
                nearest = abs(away)
                space.wall[i, 0], space.wall[i, 1], space.wall[i, 2] = wx / away, wy / away, wz / away
        others = _OTHERS if nearest < math.inf else _NEAREST
        for each in range(met):
            dx, dy, dz = ways[each]
            length2 = dx * dx + dy * dy + dz * dz
            space.radius2[i] = min(space.radius2[i], np.float32(_NEAREST * length2))
            if dx * space.wall[i, 0] + dy * space.wall[i, 1] + dz * space.wall[i, 2] < _ALONG:
                space.cut2[i] = min(space.cut2[i], np.float32(others * length2))


@njit(**KERNEL)
def _wall(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz):
    """The wall that a feeler (dx, dy, dz), which met triangle t at (x, y, z), tells of on a surface of this normal.

    Returns the share of the feeler's way that is free, the unit normal along the surface of the upright plane in which
    it stands or hangs, and that plane's distance, m, negative where the normal points back; 0 if there is none.
    """
    if _is_steep(surfaces, t, nx, ny, nz):
        wx, wy, wz = unit_normal(surfaces, t)
        upright, across = wx * nx + wy * ny + wz * nz, dx * wx + dy * wy + dz * wz
        sine = math.sqrt(1.0 - upright * upright)
        wx, wy, wz = (wx - upright * nx) / sine, (wy - upright * ny) / sine, (wz - upright * nz) / sine
        return 1.0, wx, wy, wz, across / sine
    share, wx, wy, wz = _rim(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz)
    return share, wx, wy, wz, share * (dx * wx + dy * wy + dz * wz)


@njit(**KERNEL)
def _rim(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz):
    """Where a feeler (dx, dy, dz) came in under the low overhang or ramp whose triangle t it met at (x, y, z).

    Walks back over its triangles, as seen along the normal (nx, ny, nz) of the surface below, to its rim or to where it
    stands on that surface. Returns the share of the feeler's way that leads there, and the unit normal, along the
    surface, of the line that is crossed; 1 and zeros where it reaches back over the feeler's start.
    """
    height = dx * nx + dy * ny + dz * nz
    bx, by, bz = height * nx - dx, height * ny - dy, height * nz - dz  # back along the surface, as long as the feeler
    cx, cy, cz = ny * bz - nz * by, nz * bx - nx * bz, nx * by - ny * bx
    length2 = max(bx * bx + by * by + bz * bz, 1e-30)
    begin = 0.0  # on the way back, of the feeler's length
    for _ in range(_RIM_STEPS):
        edge, end, edge_along, edge_across = -1, begin, 0.0, 0.0
        for k in range(3):
            px, py, pz = _corner_from(surfaces, t, k, x, y, z)
            qx, qy, qz = _corner_from(surfaces, t, (k + 1) % 3, x, y, z)
            across, after = px * cx + py * cy + pz * cz, qx * cx + qy * cy + qz * cz
            if (across < 0.0) != (after < 0.0):
                along, on = (px * bx + py * by + pz * bz) / length2, (qx * bx + qy * by + qz * bz) / length2
                met = along + (on - along) * across / (across - after)
                if met >= end:
                    edge, end, edge_along, edge_across = k, met, on - along, (after - across) / length2
        if edge < 0:
            break
        ux, uy, uz = unit_normal(surfaces, t)
        u, v = ux * bx + uy * by + uz * bz, ux * cx + uy * cy + uz * cz
        fall = u / (ux * nx + uy * ny + uz * nz)  # of its height, over the feeler's length
        if fall > 0.0 and height < fall * (end - begin):
            end, edge = begin + height / fall, -1
        height -= fall * (end - begin)
        if end >= 1.0:
            break
        onward = surfaces.neighbours[t, edge] if edge >= 0 else -1
        if onward < 0 or _is_steep(surfaces, onward >> 1, nx, ny, nz):
            if edge >= 0:
                u, v = edge_across, -edge_along
            scale = 1.0 / math.sqrt(max((u * u + v * v) * length2, 1e-300))
            return 1.0 - end, (u * bx + v * cx) * scale, (u * by + v * cy) * scale, (u * bz + v * cz) * scale
        begin, t = end, onward >> 1
    return 1.0, 0.0, 0.0, 0.0


@njit(inline="always")
def _corner_from(surfaces, t, k, x, y, z):
    """The way from a point to corner k of triangle t."""
    corners = surfaces.corners
    return corners[t, k, 0] - x, corners[t, k, 1] - y, corners[t, k, 2] - z


@njit(inline="always")
def _is_steep(surfaces, t, nx, ny, nz):
    """Whether triangle t stands so steep on a surface of this normal that it ends what lies beyond its line."""
    ux, uy, uz = unit_normal(surfaces, t)
    return 1.0 - (ux * nx + uy * ny + uz * nz) ** 2 >= _STEEP * _STEEP


@njit(inline="always")
def largest_disk(free2, estimate):
    """Squared radius (m2) of the largest disk to search in free space of this squared radius, before it shrinks."""
    return min(estimate.reach2, max(float(free2) / estimate.shrink2, LEAST_FREE * estimate.reach2))
