# SPDX-License-Identifier: GPL-3.0-or-later
"""Interactions: where a ray meets a surface, and where light leaves a surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import difference, dot, put_vector, scaled, vector
from ..system.kernels import INLINED, njit
from .surfaces import clear_of, facing_side, material_at, other_material, shading_normal, unit_normal
from .textures import mixed_share, row_of
from .triangles import barycentric, point

LEAST_COSINE = 1e-6  # least cosine of an Interaction, so that nothing is divided by 0 at grazing rays


class Interaction(NamedTuple):
    """Where a ray met what. All kernels use it: those of photons, of the camera, and of the planning.

    triangle: index. side_id: 2 triangle + side, the side from which the ray came. point: m. normal: geometric unit
    normal of that side. shading_normal: unit normal around which lobes are turned; another one where the surface is
    shaded smooth. lean: cosine between the two normals, 1 exactly where they are the same. material: index, at that
    side. u, v: barycentric coordinates of corners 1 and 2. incoming: unit direction of the ray, towards the surface.
    cosine: of the angle between the reversed ray and the shading normal; geometric_cosine: and the normal, which solid
    angles and areas go by; both at least LEAST_COSINE. distance: m, length of the ray from its origin to the point.
    """

    triangle: int
    side_id: int
    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    shading_normal: tuple[float, float, float]
    lean: float
    material: int
    u: float
    v: float
    incoming: tuple[float, float, float]
    cosine: float
    geometric_cosine: float
    distance: float


@njit(**INLINED)
def interact(surfaces, hits, i, direction):
    """The Interaction of ray i, which met a triangle. direction: (n, 3) float32 of all rays."""
    return interact_at(
        surfaces, np.int64(hits.triangle[i]), hits.u[i], hits.v[i], vector(direction, i), hits.distance[i]
    )


@njit(**INLINED)
def interact_at(surfaces, triangle, u, v, direction, length):
    """The Interaction of a ray with a triangle at (u, v). length: of the ray, in units of the direction's length."""
    norm = math.sqrt(dot(direction, direction))
    incoming = scaled(direction, 1.0 / norm)
    side_id = facing_side(surfaces, triangle, direction)
    n = unit_normal(surfaces, side_id)
    geometric_cosine = max(LEAST_COSINE, -dot(incoming, n))
    ns, lean, cosine = _shaded(surfaces, side_id, (u, v), scaled(incoming, -1.0), n, geometric_cosine)
    at, material = point(surfaces.corners, triangle, u, v), material_at(surfaces, triangle, u, v)
    return Interaction(
        triangle, side_id, at, n, ns, lean, material, u, v, incoming, cosine, geometric_cosine, length * norm
    )


@njit(**INLINED)
def mixed_at(surfaces, at):
    """Of a mixed material at an Interaction: the material that is mixed in, and its share; else its own, and 0."""
    other = other_material(surfaces, at.triangle)
    if other < 0:
        return surfaces.material[at.triangle], 0.0
    return other, mixed_share(surfaces.textures, row_of(surfaces.textures, at.triangle), at.u, at.v)


@njit(**INLINED)
def _shaded(surfaces, side_id, at, direction, n, cosine):
    """Shading normal at (u, v) of a side, its cosine with the normal n, and with a direction whose cosine with n is
    this."""
    if surfaces.smooth.size == 0 or surfaces.smooth[side_id >> 1] < 0:
        return n, 1.0, cosine
    ns = shading_normal(surfaces, side_id, at[0], at[1])
    return ns, min(1.0, dot(ns, n)), max(LEAST_COSINE, dot(ns, direction))


@njit(**INLINED)
def emit_at(surfaces, side_id, u, v, cosine):
    """The Interaction at (u, v) of a side that emits in any direction with this cosine, where it does not matter which
    one it is. There is no ray that arrives, so incoming is the reversed normal and distance is 0."""
    n, triangle = unit_normal(surfaces, side_id), np.int64(side_id >> 1)
    at, material = point(surfaces.corners, triangle, u, v), material_at(surfaces, triangle, u, v)
    return Interaction(triangle, np.int32(side_id), at, n, n, 1.0, material, u, v, scaled(n, -1.0), cosine, cosine, 0.0)


@njit(**INLINED)
def emit_towards(surfaces, side_id, u, v, direction, cosine):
    """The Interaction at (u, v) of a side that emits in a unit direction, with this cosine; see emit_at."""
    n, triangle = unit_normal(surfaces, side_id), np.int64(side_id >> 1)
    ns, lean, shaded = _shaded(surfaces, side_id, (u, v), direction, n, cosine)
    at, material = point(surfaces.corners, triangle, u, v), material_at(surfaces, triangle, u, v)
    incoming = scaled(direction, -1.0)
    return Interaction(triangle, np.int32(side_id), at, n, ns, lean, material, u, v, incoming, shaded, cosine, 0.0)


@njit(**INLINED)
def stand_at(surfaces, side_id, point):
    """The Interaction at a point of a side, seen from straight above: for light that arrives there, whichever way it
    goes on. distance is 0."""
    n, triangle, u, v = unit_normal(surfaces, side_id), np.int64(side_id >> 1), 0.0, 0.0
    if surfaces.smooth.size > 0 or surfaces.textures.row.size > 0:
        u, v = barycentric(surfaces.corners, triangle, point)
    ns, lean, cosine = _shaded(surfaces, side_id, (u, v), n, n, 1.0)
    material = material_at(surfaces, triangle, u, v)
    return Interaction(
        triangle, np.int32(side_id), point, n, ns, lean, material, u, v, scaled(n, -1.0), cosine, 1.0, 0.0
    )


@njit(inline="always")  # as rays are tuples of many types
def leave(surfaces, side_id, point, direction, rays, i):
    """Start ray i at a point of a side, clear of the surface (see clear_of), in a direction. rays: any named tuple with
    origin and direction (n, 3) float32."""
    put_vector(clear_of(surfaces, side_id, point), rays.origin, i)
    put_vector(direction, rays.direction, i)


@njit(inline="always")
def pass_on(surfaces, at, rays, i):
    """Let the ray of an Interaction go straight on through the surface, as ray i; see leave."""
    leave(surfaces, at.side_id ^ 1, at.point, at.incoming, rays, i)


@njit(inline="always")
def pass_towards(surfaces, at, end, rays, i):
    """As pass_on, but towards the point where the ray ends, which is one length of ray i's direction away. Else the
    ray would end as far beyond as it starts behind the surface, and a shadow ray would meet the lamp that it ends at.
    """
    start = clear_of(surfaces, at.side_id ^ 1, at.point)
    put_vector(start, rays.origin, i)
    put_vector(difference(end, start), rays.direction, i)
