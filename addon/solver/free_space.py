# SPDX-License-Identifier: GPL-3.0-or-later
"""Free space around points on surfaces: how wide a disk of photons may be before it reaches a wall, and where that is.

A disk that reached beyond a wall would count light from its other side, and close to other surfaces light changes
quickly (Ward's harmonic distance says the same). Short rays along the surface feel for them. A disk cannot be as small
as the space beside a wall; then the wall cuts it. One bounce later the change matters less than the noise of few
photons: there the nearest wall cuts the disk, and others limit it.
"""

import math
from typing import NamedTuple

import numpy as np

from .kernels import KERNEL, njit
from .sampling import to_world, turn
from .surfaces import Surfaces, Tracer, facing_side, point, put_ray, unit_normal

_FEELERS = 8
_SINE = 0.05  # they rise little, to feel low steps too
_COSINE = math.sqrt(1.0 - _SINE**2)
_HALF = math.sqrt(0.5)
_NEAREST = math.cos(math.pi / 8) ** 2  # a straight wall stands at most 22.5 degrees away from the nearest feeler,
_OTHERS = 0.5  # and, where that one ends at another wall before it, 45 degrees from the next
_ALONG = 0.9  # share of the way to the nearest wall from which on a feeler's end counts as on it
_STEEP = 0.5  # least sine of a wall's angle to the surface: a lower one does not end what lies beyond its line
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
    tracer: Tracer, surfaces: Surfaces, reach2: float, place: np.ndarray, code: np.ndarray, turns: np.ndarray
) -> FreeSpace:
    """The free space around points, of at most sqrt(reach2) m.

    place: (n, 3) float64, m. code: (n,) int32, 2 triangle + side that they lie on. turns: (n,) float64 in [0, 1),
    where the feelers start to go round.
    """
    origin, direction = np.empty((2, _FEELERS * len(place), 3), np.float32)
    start_feelers(surfaces, place, code, turns, origin, direction)
    reach = np.full(len(origin), math.sqrt(reach2) / _COSINE, np.float32)
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
        for row in range(_FEELERS * i, _FEELERS * (i + 1)):
            dx, dy, dz = to_world(_COSINE * c, _COSINE * s, _SINE, nx, ny, nz)
            c, s = _HALF * (c - s), _HALF * (c + s)  # by 45 degrees
            put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, row)


def shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space):
    """Narrow the space (n points) to what feelers meet. Of a hollow surface they meet itself: that is no wall."""
    ways = np.empty((_FEELERS, 3))  # to what the feelers meet
    _shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space, ways)


@njit(**KERNEL)
def _shortest_feelers(surfaces, code, blocker, u, v, origin, direction, space, ways):
    for i in range(code.size):
        nx, ny, nz = unit_normal(surfaces, code[i] >> 1, code[i] & 1)
        own = surfaces.sheet[code[i] >> 1, code[i] & 1]
        nearest = math.inf  # m, to the plane of a wall
        met = 0
        for row in range(_FEELERS * i, _FEELERS * (i + 1)):
            t = blocker[row]
            if t < 0 or surfaces.sheet[t, facing_side(surfaces, t, direction, row)] == own:
                continue
            x, y, z = point(surfaces.corners, t, u[row], v[row])
            dx, dy, dz = x - origin[row, 0], y - origin[row, 1], z - origin[row, 2]
            ways[met, 0], ways[met, 1], ways[met, 2] = dx, dy, dz
            met += 1
            wx, wy, wz = unit_normal(surfaces, t)
            upright = wx * nx + wy * ny + wz * nz
            wx, wy, wz = wx - upright * nx, wy - upright * ny, wz - upright * nz  # along the surface
            sine = math.sqrt(wx * wx + wy * wy + wz * wz)
            away = (dx * wx + dy * wy + dz * wz) / max(sine, _STEEP)
            if sine >= _STEEP and 0.0 < abs(away) < nearest:
                nearest = abs(away)
                scale = 1.0 / (sine * away)
                space.wall[i, 0], space.wall[i, 1], space.wall[i, 2] = wx * scale, wy * scale, wz * scale
        others = _OTHERS if nearest < math.inf else _NEAREST
        for each in range(met):
            dx, dy, dz = ways[each]
            length2 = _COSINE * _COSINE * (dx * dx + dy * dy + dz * dz)  # m2, along the surface
            space.radius2[i] = min(space.radius2[i], np.float32(_NEAREST * length2))
            if dx * space.wall[i, 0] + dy * space.wall[i, 1] + dz * space.wall[i, 2] < _ALONG:
                space.cut2[i] = min(space.cut2[i], np.float32(others * length2))


@njit(inline="always")
def largest_disk(free2, estimate):
    """Squared radius (m2) of the largest disk to search in free space of this squared radius, before it shrinks."""
    return min(estimate.reach2, max(float(free2) / estimate.shrink2, LEAST_FREE * estimate.reach2))
