# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light by shadow rays: lights and small hot parts, which photons would show with the noise of their number.

A wall that spans half the sky is the photon map's business. A source that is small against its distance is not: one
shadow ray says nearly all about it, while k photons still err by 1 / sqrt(k). Its photons are then kept only from
their second surface on (Jensen 2001, section 7.4; docs/estimators.md).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .emission import ELLIPSE, POINT, RECTANGLE, SPOT, SUN, Emitters, spot_brightness
from .radiometry import excess
from .rng import uniform
from .sampling import basis, cone_direction, lobe_brdf, to_world, triangle_point, turn
from .surfaces import Surfaces, normal, point, temperature_at

_MOST = 64  # surfaces that may become lamps: those of most power
_COMPACT = 0.3  # radius over distance, in the mean over what it lights, up to which a surface is a lamp
_MATTERS = 0.03  # share of the light in the picture above which a surface is a lamp
CANDIDATES = 8  # points on lamps that compete for a shadow ray
_DIMENSIONS = 3  # random numbers of a candidate


class Lamps(NamedTuple):
    """What shadow rays are sent to, as entries of one discrete distribution, lights last.

    cumulative: (e + 1,) float64, from 0 to 1. code: (n,) int32, 2 triangle + side of entries 0..n-1.
    light, light_power, radius: as in Emitters. power: W, of all entries. candidates: per shadow ray.
    """

    cumulative: np.ndarray
    code: np.ndarray
    light: np.ndarray
    light_power: np.ndarray
    radius: float
    power: float
    candidates: int


def choose_lamps(
    surfaces: Surfaces, side_power: np.ndarray, place: np.ndarray, facing: np.ndarray, lit: float
) -> np.ndarray:
    """Sheets of surface that are lamps: small against their distance and a good part of the light in the picture.

    side_power: (t,) float64 |excess| power of one side of each triangle, W. place, facing: (r, 3) float64 points that
    camera paths gather at and their normals. lit: W m-2, mean irradiance there from all surfaces, as far as known.
    Returns (m, 2) bool, which sides of triangles belong to a lamp.
    """
    sheet = surfaces.sheet
    power = np.bincount(sheet.ravel(), np.repeat(side_power, 2), sheet.size)
    chosen = np.zeros(sheet.size, np.bool_)
    if len(place) == 0:
        return chosen[sheet]
    labels = np.argsort(-power, kind="stable")[:_MOST]
    labels = labels[power[labels] > 0]
    irradiance, compact = np.zeros(labels.size), np.zeros(labels.size, np.bool_)
    for i, label in enumerate(labels):
        members = np.flatnonzero((sheet == label).any(axis=1))
        corners = surfaces.corners[members].reshape(-1, 3).astype(np.float64)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        radius2 = float(np.max(np.sum((corners - centre) ** 2, axis=1)))
        towards = centre - place
        distance2 = np.maximum(np.sum(towards**2, axis=1), radius2)
        cosine = np.maximum(np.sum(towards * facing, axis=1), 0.0) / np.sqrt(distance2)
        received = power[label] * cosine / (4.0 * math.pi * distance2)
        irradiance[i] = received.mean()
        if irradiance[i] > 0:
            compact[i] = np.average(np.sqrt(radius2 / distance2), weights=received) < _COMPACT
    matters = irradiance > _MATTERS * max(lit, irradiance[compact].sum())
    chosen[labels[compact & matters]] = True
    return chosen[sheet]


def build_lamps(emitters: Emitters, side_power: np.ndarray) -> Lamps:
    """The emitters that shadow rays are sent to: those marked as lamps, and all lights."""
    code = emitters.surface[emitters.lamp]
    light_total = emitters.light_power.sum(axis=1)
    is_sun = emitters.light[:, 0] == SUN
    light_total = light_total * np.where(is_sun, math.pi * emitters.radius**2, 1.0)
    power = np.concatenate((side_power[code >> 1], light_total))
    cumulative = np.concatenate(([0.0], np.cumsum(power)))
    total = float(cumulative[-1])
    point_like = code.size == 0 and len(light_total) == 1 and emitters.light[0, 11] == 0.0
    point_like = point_like and emitters.light[0, 0] in (POINT, SPOT)
    return Lamps(
        cumulative / total if total > 0 else cumulative,
        code,
        emitters.light,
        emitters.light_power,
        emitters.radius,
        total,
        1 if point_like else CANDIDATES,
    )


class Shadows(NamedTuple):
    """Shadow rays, n of them: origin, direction (n, 3), to the lamp where the ray's parameter is reach (n,); what
    arrives in the pixel if nothing is between, radiance (n, b); all float32. pixel: (n,) int32.
    """

    origin: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    radiance: np.ndarray
    pixel: np.ndarray


def empty_shadows(count: int, bands: int) -> Shadows:
    """Room for count shadow rays."""
    return Shadows(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
    )


@njit(inline="always")
def _candidate(lamps, surfaces, hit, entry, s, w):
    """A point on a lamp, (x, y, z), or for suns one far towards it; the weight of this choice; and u, v on a triangle.

    The weight is the irradiance that the lamp would cause at the hit if it were free, over the density of the choice
    per unit of the whole power: points are chosen in proportion to power.
    """
    if entry < lamps.code.size:
        t = lamps.code[entry] >> 1
        u, v = triangle_point(s, w)
        x, y, z = point(surfaces.corners, t, u, v)
        nx, ny, nz, _ = normal(surfaces.corners, t)
        sign = 1.0 if lamps.code[entry] & 1 == 0 else -1.0
        clear = surfaces.clearance[t]
        nx, ny, nz = sign * nx, sign * ny, sign * nz
        x, y, z = x + clear * nx, y + clear * ny, z + clear * nz
        dx, dy, dz = x - hit.x, y - hit.y, z - hit.z
        d2 = dx * dx + dy * dy + dz * dz
        cos_lamp = -(dx * nx + dy * ny + dz * nz)
        cos_hit = dx * hit.nx + dy * hit.ny + dz * hit.nz
        if cos_lamp <= 0.0 or cos_hit <= 0.0 or d2 <= 0.0:
            return x, y, z, 0.0, u, v
        return x, y, z, cos_lamp * cos_hit / (math.pi * d2 * d2), u, v
    light = entry - lamps.code.size
    row = lamps.light[light]
    kind = int(row[0])
    x, y, z = row[1], row[2], row[3]
    if kind == SUN:
        lx, ly, lz = cone_direction(s, w, row[10])
        dx, dy, dz = to_world(lx, ly, lz, row[4], row[5], row[6])
        far = 4.0 * lamps.radius
        cos_hit = -(dx * hit.nx + dy * hit.ny + dz * hit.nz)
        weight = cos_hit / (math.pi * lamps.radius * lamps.radius)
        return hit.x - far * dx, hit.y - far * dy, hit.z - far * dz, max(0.0, weight), 0.0, 0.0
    if kind == RECTANGLE or kind == ELLIPSE:
        a, b = 2.0 * s - 1.0, 2.0 * w - 1.0
        if kind == ELLIPSE:
            r = math.sqrt(s)
            a, b = turn(w)
            a, b = r * a, r * b
        x, y, z = x + a * row[4] + b * row[7], y + a * row[5] + b * row[8], z + a * row[6] + b * row[9]
        nx = row[8] * row[6] - row[9] * row[5]
        ny = row[9] * row[4] - row[7] * row[6]
        nz = row[7] * row[5] - row[8] * row[4]
        inverse = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        dx, dy, dz = x - hit.x, y - hit.y, z - hit.z
        d2 = dx * dx + dy * dy + dz * dz
        cos_lamp = -(dx * nx + dy * ny + dz * nz) * inverse
        cos_hit = dx * hit.nx + dy * hit.ny + dz * hit.nz
        weight = cos_lamp * cos_hit / (math.pi * d2 * d2) if cos_lamp > 0.0 and cos_hit > 0.0 else 0.0
        return x, y, z, weight, 0.0, 0.0
    # a sphere of even radiance, sampled in its cone; photons start on the disk through its centre
    dx, dy, dz = x - hit.x, y - hit.y, z - hit.z
    d2 = dx * dx + dy * dy + dz * dz
    distance = math.sqrt(d2)
    if distance <= 0.0:
        return x, y, z, 0.0, 0.0, 0.0
    dx, dy, dz = dx / distance, dy / distance, dz / distance
    along, solid_angle, sphere = distance, 1.0, 1.0 / d2
    radius = row[11]
    if radius > 0.0:
        cos_cone = math.sqrt(1.0 - radius * radius / d2) if d2 > radius * radius else -1.0
        lx, ly, lz = cone_direction(s, w, cos_cone)
        dx, dy, dz = to_world(lx, ly, lz, dx, dy, dz)
        along = distance * lz
        # 1 - cos without cancellation for far spheres
        solid_angle = 2.0 * math.pi * (radius * radius / d2 / (1.0 + cos_cone) if cos_cone > 0.0 else 1.0 - cos_cone)
        sphere = 1.0 / (math.pi * radius * radius)
    x, y, z = hit.x + along * dx, hit.y + along * dy, hit.z + along * dz
    cos_hit = dx * hit.nx + dy * hit.ny + dz * hit.nz
    if cos_hit <= 0.0 or along <= 0.0:
        return x, y, z, 0.0, 0.0, 0.0
    weight = cos_hit * sphere * solid_angle / (2.0 * math.pi * (1.0 - row[10]))
    if kind == SPOT:
        weight *= spot_brightness(row, -(dx * row[4] + dy * row[5] + dz * row[6]))
    return x, y, z, weight, 0.0, 0.0


@njit(inline="always")
def send_shadow(lamps, surfaces, radiometry, hit, throughput, share, path, dimension, value, pixel, shadows, count):
    """Choose a point on a lamp for the hit and fill shadow ray `count`; returns 1, or 0 if no lamp shines there.

    Of a few candidates, spread evenly over the lamps' power, one is chosen in proportion to the irradiance it would
    cause (resampled importance sampling, Talbot et al. 2005): unbiased, and most of what is left to chance is whether
    something is between. path, dimension: of the random numbers. value: room for (b,) float64.
    """
    material = surfaces.material[hit.triangle]
    specular = float(radiometry.specular[material])
    alpha = float(radiometry.alpha[material])
    total = 0.0
    chosen = -1
    x = y = z = u = v = 0.0
    for c in range(lamps.candidates):
        d = dimension + _DIMENSIONS * c
        pick = (c + uniform(path, d)) / lamps.candidates
        entry = min(np.searchsorted(lamps.cumulative, pick, side="right") - 1, lamps.cumulative.size - 2)
        cx, cy, cz, weight, cu, cv = _candidate(lamps, surfaces, hit, entry, uniform(path, d + 1), uniform(path, d + 2))
        if weight <= 0.0:
            continue
        total += weight
        if uniform(path, dimension + 128 + c) * total < weight:
            chosen, x, y, z, u, v = entry, cx, cy, cz, cu, cv
    if chosen < 0:
        return 0
    clear = surfaces.clearance[hit.triangle]
    ox, oy, oz = hit.x + clear * hit.nx, hit.y + clear * hit.ny, hit.z + clear * hit.nz
    dx, dy, dz = x - ox, y - oy, z - oz
    probability = lamps.cumulative[chosen + 1] - lamps.cumulative[chosen]
    factor = share * total / (lamps.candidates * probability)
    diffuse = (1.0 - specular) / math.pi
    if chosen < lamps.code.size:
        t = lamps.code[chosen] >> 1
        nx, ny, nz, double_area = normal(surfaces.corners, t)
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        excess(
            radiometry, surfaces.material[t], temperature_at(surfaces.temperature, t, u, v),
            abs(dx * nx + dy * ny + dz * nz) * inverse, value,
        )  # fmt: skip
        factor *= 0.5 * double_area * math.pi
        brdf = diffuse  # camera paths find the lamp in the specular lobe themselves
    else:
        light = chosen - lamps.code.size
        for b in range(value.size):
            value[b] = lamps.light_power[light, b]
        if int(lamps.light[light, 0]) == SUN:
            factor *= math.pi * lamps.radius * lamps.radius  # its power is per square metre
        brdf = diffuse
        if alpha > 0.0 and specular > 0.0:
            brdf += specular * _lobe(hit, dx, dy, dz, alpha)
    shadows.origin[count, 0], shadows.origin[count, 1], shadows.origin[count, 2] = ox, oy, oz
    shadows.direction[count, 0], shadows.direction[count, 1], shadows.direction[count, 2] = dx, dy, dz
    shadows.reach[count] = 1.0
    shadows.pixel[count] = pixel
    rho = radiometry.reflectance[material]
    for b in range(value.size):
        shadows.radiance[count, b] = throughput[b] * rho[b] * (value[b] * brdf * factor)
    return 1


@njit(inline="always")
def _lobe(hit, dx, dy, dz, alpha):
    """BRDF of the rough lobe between the ray that hit and the direction (dx, dy, dz), sr^-1."""
    tx, ty, tz, bx, by, bz = basis(hit.nx, hit.ny, hit.nz)
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
    return lobe_brdf(
        dx * tx + dy * ty + dz * tz, dx * bx + dy * by + dz * bz, dx * hit.nx + dy * hit.ny + dz * hit.nz,
        -(hit.dx * tx + hit.dy * ty + hit.dz * tz), -(hit.dx * bx + hit.dy * by + hit.dz * bz), hit.cosine, alpha,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def add_unshadowed(triangle, shadows, image):
    """Add to the image (n, b) what shadow rays bring that met nothing (triangle < 0)."""
    for i in range(triangle.size):
        if triangle[i] < 0:
            row = image[shadows.pixel[i]]
            for b in range(row.size):
                row[b] += shadows.radiance[i, b]
