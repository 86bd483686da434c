# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved mirrors: where a ray would meet the surface that a smooth-shaded triangle stands for.

A mirror shows where its surface is: a ray that meets a flat triangle on its way to the curved surface, or behind it,
meets it at another place, and there the normal is another one. The more it grazes the surface, the further away.

The normals n_i at the corners p_i tell how the surface curves. Above a point p of the triangle, with the barycentric
coordinates b_i, the corners' tangent planes rise by (p_i - p) . n_i. In the mean with the weights b_i this is the rise
of Phong tessellation (Boubekeur and Alexa, ACM Trans. Graph. 27 (2008), 141). A curve of second order lies half as far
from its chord as its tangents do there, so here the surface rises by half of that:

    h(p) = 1/2 sum over i of  b_i (p_i - p) . n_i

Along a ray that goes back by s from the triangle, p moves by s along the triangle and the b_i change in proportion. So
the ray, which rises by s times its cosine, meets the surface where a quadratic in s is 0. The surface's normal there is
that between the corners' normals, beyond the triangle, too.

It depends on where the ray comes from. That is right for rays from the camera, which bring back what they find. Photons
would have to go by the reverse of this map and its Jacobian; they keep the shading normal of the point that they meet.
"""

from __future__ import annotations

import math

import numpy as np

from ..sampling.vectors import difference, dot, moved, scaled, vector
from ..system.kernels import INLINED, njit
from .interaction import LEAST_COSINE, Interaction
from .surfaces import LEAST_LEAN
from .triangles import barycentric, corner

_FURTHEST = -1.0  # least barycentric coordinate: the surface is told as far beyond an edge as the triangle reaches


@njit(**INLINED)
def reflecting(surfaces, lobes, at):
    """The Interaction by which a surface reflects a camera's ray specularly: another one at mirrors that are shaded
    smooth. Their shading normal is that of the curved surface where the ray meets it."""
    if lobes.alpha > 0.0 or surfaces.smooth.size == 0 or surfaces.smooth[at.triangle] < 0:
        return at
    normal = _normal_ahead(surfaces, at)
    cosine = max(LEAST_COSINE, -dot(normal, at.incoming))
    return Interaction(
        at.triangle, at.side_id, at.point, at.normal, normal, min(1.0, dot(normal, at.normal)), at.material, at.u, at.v,
        at.incoming, cosine, at.geometric_cosine, at.distance,
    )  # fmt: skip


@njit(**INLINED)
def _normal_ahead(surfaces, at):
    """Unit normal where the ray of an Interaction meets the curved surface; its shading normal where that cannot be
    told, as the triangle's normals fit no surface that the ray meets near by."""
    t, normals = at.triangle, surfaces.corner_normal[surfaces.smooth[at.triangle]]
    sign = 1.0 - 2.0 * (at.side_id & 1)
    along = moved(at.incoming, at.geometric_cosine, at.normal)  # the ray's way along the triangle
    u, v = np.float64(at.u), np.float64(at.v)
    behind = barycentric(surfaces.corners, t, difference(at.point, along))
    weight, change = (1.0 - u - v, u, v), (u + v - behind[0] - behind[1], behind[0] - u, behind[1] - v)
    constant = linear = square = 0.0
    for i in range(3):
        n = scaled(vector(normals, i), sign)
        rise, slope = dot(difference(corner(surfaces.corners, t, i), at.point), n), dot(along, n)
        constant += 0.5 * weight[i] * rise
        linear += 0.5 * (weight[i] * slope + change[i] * rise)
        square += 0.5 * change[i] * slope
    half = at.geometric_cosine - linear
    root = half * half - 4.0 * square * constant
    if not (half > 0.0 and root >= 0.0):
        return at.shading_normal
    back = 2.0 * constant / (half + math.sqrt(root))
    b0, b1, b2 = weight[0] + back * change[0], weight[1] + back * change[1], weight[2] + back * change[2]
    if min(b0, b1, b2) < _FURTHEST:
        return at.shading_normal
    normal = moved(scaled(vector(normals, 0), sign * b0), sign * b1, vector(normals, 1))
    normal = moved(normal, sign * b2, vector(normals, 2))
    length = math.sqrt(dot(normal, normal))
    if not (dot(normal, at.normal) >= LEAST_LEAN * length and dot(normal, at.incoming) < 0.0):
        return at.shading_normal
    return scaled(normal, 1.0 / length)
