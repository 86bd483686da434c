# SPDX-License-Identifier: GPL-3.0-or-later
"""Interactions: where a ray meets a surface, and where light leaves one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import dot, put_vector, scaled, vector
from ..system.kernels import INLINED, njit
from .surfaces import clear_of, facing_side, unit_normal
from .triangles import point

LEAST_COSINE = 1e-6  # under which a ray counts as meeting a surface, so that a grazing one does not divide by zero


class Interaction(NamedTuple):
    """Where a ray meets what, as all kernels say it: photons', the camera's, those that plan.

    triangle: index. side_id: 2 triangle + side, the side that the ray comes from. point: m. normal: the geometric unit
    normal of that side. shading_normal: by which lobes are turned, the same for now. material: index, at that side.
    u, v: barycentric coordinates of corners 1 and 2. incoming: unit direction of the ray, towards the surface. cosine:
    of the angle between the ray and the shading normal, at least LEAST_COSINE. distance: m that the ray came.
    """

    triangle: int
    side_id: int
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    shading_normal: tuple[float, float, float]
    material: int
    u: float
    v: float
    incoming: tuple[float, float, float]
    cosine: float
    distance: float


@njit(**INLINED)
def interact(surfaces, hits, i, direction):
    """The Interaction of ray i, which met a triangle. direction: (n, 3) float32 of all rays."""
    return interact_at(
        surfaces, np.int64(hits.triangle[i]), hits.u[i], hits.v[i], vector(direction, i), hits.distance[i]
    )


@njit(**INLINED)
def interact_at(surfaces, triangle, u, v, direction, length):
    """The Interaction with triangle at (u, v) of a ray of this direction, and so many of the direction's lengths."""
    norm = math.sqrt(dot(direction, direction))
    incoming = scaled(direction, 1.0 / norm)
    side_id = facing_side(surfaces, triangle, direction)
    n = unit_normal(surfaces, side_id)
    cosine = max(LEAST_COSINE, -dot(incoming, n))
    at, material = point(surfaces.corners, triangle, u, v), np.int32(surfaces.material[triangle])
    return Interaction(triangle, side_id, at, n, n, material, u, v, incoming, cosine, length * norm)


@njit(**INLINED)
def emit_at(surfaces, side_id, u, v, cosine):
    """The Interaction at (u, v) of a side that emits in a direction of this cosine. Nothing has come there, so the
    incoming direction is that of the normal backwards and the distance 0."""
    n, triangle = unit_normal(surfaces, side_id), np.int64(side_id >> 1)
    at, material = point(surfaces.corners, triangle, u, v), np.int32(surfaces.material[triangle])
    return Interaction(triangle, np.int32(side_id), at, n, n, material, u, v, scaled(n, -1.0), cosine, 0.0)


@njit(inline="always")  # as rays are tuples of many types
def leave(surfaces, side_id, point, direction, rays, i):
    """Make ray i one that starts at a point of a side, clear of it, in a direction. rays: what has origin and direction
    (n, 3) float32."""
    put_vector(clear_of(surfaces, side_id, point), rays.origin, i)
    put_vector(direction, rays.direction, i)
