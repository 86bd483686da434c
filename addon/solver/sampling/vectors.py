# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors: tuples of three floats, which the compiler keeps in registers."""

import numpy as np

from ..system.kernels import INLINED, njit


@njit(**INLINED)
def vector(rows, i):
    """Row i of (n, 3), float64 (numba's float() would keep float32)."""
    return np.float64(rows[i, 0]), np.float64(rows[i, 1]), np.float64(rows[i, 2])


@njit(**INLINED)
def put_vector(a, rows, i):
    """Write a vector into row i of (n, 3)."""
    rows[i, 0], rows[i, 1], rows[i, 2] = a


@njit(**INLINED)
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**INLINED)
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(**INLINED)
def difference(a, b):
    """a - b: the way from point b to point a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(**INLINED)
def scaled(a, factor):
    """A vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


@njit(**INLINED)
def moved(a, distance, direction):
    """Point a, moved by a distance along a direction."""
    return a[0] + distance * direction[0], a[1] + distance * direction[1], a[2] + distance * direction[2]
