# SPDX-License-Identifier: GPL-3.0-or-later
"""Small geometric and BRDF functions that the kernels share. Vectors are three floats; normals have unit length."""

import math

import numpy as np

from ..system.kernels import INLINED, njit

_HALF_SQRT2 = 0.7071067811865476


@njit(**INLINED)
def turn(u):
    """Cosine and sine of u turns, 0 <= u < 1, to 1e-11: several times faster than libm and without branches."""
    x = 4.0 * u
    quarter = int(x)
    x = (x - quarter - 0.5) * (0.5 * math.pi)  # within pi/4 of the middle of its quarter
    x2 = x * x
    s = x * (1.0 + x2 * (-1 / 6 + x2 * (1 / 120 + x2 * (-1 / 5040 + x2 * (1 / 362880 - x2 / 39916800)))))
    c = 1.0 + x2 * (-0.5 + x2 * (1 / 24 + x2 * (-1 / 720 + x2 * (1 / 40320 + x2 * (-1 / 3628800 + x2 / 479001600)))))
    mx = -_HALF_SQRT2 if quarter == 1 or quarter == 2 else _HALF_SQRT2
    my = -_HALF_SQRT2 if quarter >= 2 else _HALF_SQRT2
    return c * mx - s * my, s * mx + c * my


@njit(**INLINED)
def basis(nx, ny, nz):
    """Two unit vectors that complete a right-handed frame with the normal (Duff et al. 2017)."""
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@njit(**INLINED)
def to_world(x, y, z, nx, ny, nz):
    """Vector with local coordinates (x, y, z) in the frame of the normal."""
    tx, ty, tz, bx, by, bz = basis(nx, ny, nz)
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz


@njit(**INLINED)
def cosine_direction(u, v):
    """Local direction with density cos(theta) / pi (Malley's method)."""
    r = math.sqrt(u)
    c, s = turn(v)
    return r * c, r * s, math.sqrt(max(0.0, 1.0 - u))


@njit(inline="always")
def cosine_stratum(stratum, side, u, v):
    """cosine_direction in one of side by side strata of equal chance, numbered from 0."""
    return cosine_direction((stratum % side + u) / side, (stratum // side + v) / side)


@njit(**INLINED)
def cone_direction(u, v, cos_min):
    """Local direction uniform in the cone around +z with cosine above cos_min."""
    z = 1.0 - u * (1.0 - cos_min)
    r = math.sqrt(max(0.0, 1.0 - z * z))
    c, s = turn(v)
    return r * c, r * s, z


@njit(**INLINED)
def triangle_point(u, v):
    """Barycentric coordinates of corners 1 and 2, uniform over the area."""
    r = math.sqrt(u)
    return r * (1.0 - v), r * v


@njit(**INLINED)
def _lambda(alpha, z):
    """Smith's auxiliary function of GGX for a direction with cosine z > 0 (Heitz 2014, eq. 72)."""
    tan2 = max(0.0, 1.0 - z * z) / (z * z)
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * tan2) - 1.0)


@njit(**INLINED)
def sample_lobe(x, y, z, alpha, u, v):
    """Reflect the local direction (x, y, z), z > 0, at a microfacet of the GGX normals visible from it (Heitz 2018).

    Returns local direction and weight f cos / pdf = G2 / G1 <= 1; weight 0 where the facet points into the surface.
    """
    # stretch to the hemisphere configuration
    hx, hy, hz = alpha * x, alpha * y, z
    inverse = 1.0 / math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * inverse, hy * inverse, hz * inverse
    square = hx * hx + hy * hy
    if square > 1e-24:
        inverse = 1.0 / math.sqrt(square)
        ax, ay = -hy * inverse, hx * inverse
    else:
        ax, ay = 1.0, 0.0
    bx, by, bz = -hz * ay, hz * ax, hx * ay - hy * ax
    r = math.sqrt(u)
    c, s = turn(v)
    p, q = r * c, r * s
    s = 0.5 * (1.0 + hz)
    q = (1.0 - s) * math.sqrt(max(0.0, 1.0 - p * p)) + s * q
    n = math.sqrt(max(0.0, 1.0 - p * p - q * q))
    mx, my, mz = p * ax + q * bx + n * hx, p * ay + q * by + n * hy, q * bz + n * hz
    mx, my, mz = alpha * mx, alpha * my, max(1e-12, mz)
    inverse = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = mx * inverse, my * inverse, mz * inverse
    twice = 2.0 * (x * mx + y * my + z * mz)
    ox, oy, oz = twice * mx - x, twice * my - y, twice * mz - z
    if oz <= 1e-9:
        return ox, oy, oz, 0.0
    lambda_in = _lambda(alpha, z)
    return ox, oy, oz, (1.0 + lambda_in) / (1.0 + lambda_in + _lambda(alpha, oz))


@njit(**INLINED)
def mirror(dx, dy, dz, nx, ny, nz, cosine):
    """Direction of a ray with direction d after a mirror whose normal it meets under `cosine` > 0."""
    return dx + 2.0 * cosine * nx, dy + 2.0 * cosine * ny, dz + 2.0 * cosine * nz


@njit(**INLINED)
def reflect_in_lobe(dx, dy, dz, nx, ny, nz, cosine, alpha, u, v):
    """Direction of a ray with direction d after a rough surface, and its weight (see `sample_lobe`)."""
    tx, ty, tz, bx, by, bz = basis(nx, ny, nz)
    lx, ly = -(dx * tx + dy * ty + dz * tz), -(dx * bx + dy * by + dz * bz)
    lx, ly, lz, weight = sample_lobe(lx, ly, cosine, alpha, u, v)
    ox, oy, oz = to_world(lx, ly, lz, nx, ny, nz)
    return ox, oy, oz, weight


@njit(inline="always")
def lobe_brdf(ix, iy, iz, ox, oy, oz, alpha):
    """GGX BRDF without Fresnel factor, sr^-1, for two local directions: D G2 / (4 cos cos)."""
    if iz <= 1e-9 or oz <= 1e-9:
        return 0.0
    mx, my, mz = ix + ox, iy + oy, iz + oz
    square = mx * mx + my * my + mz * mz
    cos2 = mz * mz / square
    alpha2 = alpha * alpha
    d = cos2 * (alpha2 - 1.0) + 1.0
    return alpha2 / (math.pi * d * d * (1.0 + _lambda(alpha, iz) + _lambda(alpha, oz)) * 4.0 * iz * oz)


ALBEDO_NODES = 64


@njit(cache=True, nogil=True)
def lobe_albedo(alpha, samples):
    """Albedo of the GGX lobe, (ALBEDO_NODES,) float64, at cosines (i / (n - 1))^2: the mean weight of sample_lobe.

    It falls below 1 where facets shadow each other; the surface emits what the lobe loses. samples: per axis.
    """
    albedo = np.empty(ALBEDO_NODES)
    for i in range(ALBEDO_NODES):
        z = max(1e-4, (i / (ALBEDO_NODES - 1.0)) ** 2)
        x = math.sqrt(max(0.0, 1.0 - z * z))
        total = 0.0
        for j in range(samples):
            g = 1.0 - (j + 0.5) / samples  # u = 1 - g^2: dense where facets stand steep and most is lost
            for k in range(samples):
                total += 2.0 * g * sample_lobe(x, 0.0, z, alpha, 1.0 - g * g, (k + 0.5) / samples)[3]
        albedo[i] = total / (samples * samples)
    return albedo


@njit(inline="always")
def interpolate_albedo(albedo, row, cosine):
    """Lobe albedo of a material (row of the table) at a cosine, linear between the nodes."""
    position = math.sqrt(min(1.0, max(0.0, cosine))) * (ALBEDO_NODES - 1.0)
    i = min(int(position), ALBEDO_NODES - 2)
    t = position - i
    return (1.0 - t) * albedo[row, i] + t * albedo[row, i + 1]
