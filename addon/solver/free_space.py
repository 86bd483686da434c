# SPDX-License-Identifier: GPL-3.0-or-later
"""Free space around points on surfaces: how wide a disk of photons may be before it reaches a wall.

A disk that reached beyond a wall would count light from its other side, and close to other surfaces light changes
quickly (Ward's harmonic distance says the same). Short rays along the surface feel for them.
"""

import math

import numpy as np
from numba import njit

from .kernels import KERNEL
from .sampling import to_world, turn
from .surfaces import Surfaces, Tracer, facing_side, point, put_ray, unit_normal

_FEELERS = 4
_SINE = 0.05  # they rise little, to feel low steps too
_COSINE = math.sqrt(1.0 - _SINE**2)
LEAST_FREE = 1.0 / 36.0  # share of the largest disk's area that photons may fill however close the walls


def free_space(
    tracer: Tracer, surfaces: Surfaces, reach2: float, place: np.ndarray, code: np.ndarray, turns: np.ndarray
) -> np.ndarray:
    """Squared radius (m2) of the free space around points, (n,) float32, at most reach2.

    place: (n, 3) float64, m. code: (n,) int32, 2 triangle + side that they lie on. turns: (n,) float64 in [0, 1),
    where the feelers start to go round.
    """
    origin, direction = np.empty((2, _FEELERS * len(place), 3), np.float32)
    start_feelers(surfaces, place, code, turns, origin, direction)
    reach = np.full(len(origin), math.sqrt(reach2) / _COSINE, np.float32)
    free2 = np.empty(len(place), np.float32)
    shortest_feelers(surfaces, code, *tracer.trace(origin, direction, reach), origin, direction, reach2, free2)
    return free2


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
            c, s = -s, c
            put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, row)


@njit(**KERNEL)
def shortest_feelers(surfaces, code, blocker, u, v, origin, direction, reach2, free2):
    """Fill free2 (n,). Of a hollow surface feelers meet itself: that is no wall."""
    for i in range(code.size):
        nearest2 = reach2
        own = surfaces.sheet[code[i] >> 1, code[i] & 1]
        for row in range(_FEELERS * i, _FEELERS * (i + 1)):
            t = blocker[row]
            if t >= 0 and surfaces.sheet[t, facing_side(surfaces, t, direction, row)] != own:
                x, y, z = point(surfaces.corners, t, u[row], v[row])
                dx, dy, dz = x - origin[row, 0], y - origin[row, 1], z - origin[row, 2]
                # a wall may stand 45 degrees away from the nearest feeler
                nearest2 = min(nearest2, 0.5 * _COSINE * _COSINE * (dx * dx + dy * dy + dz * dz))
        free2[i] = nearest2


@njit(inline="always")
def largest_disk(free2, estimate):
    """Squared radius (m2) of the largest disk to search in free space of this squared radius, before it shrinks."""
    return min(estimate.reach2, max(float(free2) / estimate.shrink2, LEAST_FREE * estimate.reach2))
