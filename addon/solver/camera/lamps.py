# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light by shadow rays: lights and small hot parts, which photons would show with the noise of their number.

A wall that spans half the sky is the photon map's business. A source that is small against its distance is not: one
shadow ray says nearly all about it, while k photons still err by 1 / sqrt(k). Its photons are then kept only from
their second surface on (Jensen 2001, section 7.4; docs/estimators.md).
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.point_tree import morton_order
from ..geometry.surfaces import (
    CLEAR,
    Surfaces,
    Tracer,
    centroids,
    clear_of,
    layer_of,
    normal,
    point,
    put_ray,
    temperature_at,
    unit_normal,
)
from ..photons.emission import (
    ELLIPSE,
    RECTANGLE,
    SPOT,
    SUN,
    Emitters,
    area_light_normal,
    area_light_point,
    light_totals,
    spot_brightness,
)
from ..physics.radiometry import excess
from ..sampling.rng import path_key, uniform
from ..sampling.warps import basis, cone_direction, cosine_stratum, lobe_brdf, to_world, triangle_point
from ..system.kernels import KERNEL, njit

_MOST = 64  # surfaces that may become lamps: those of most power
_RECEIVERS = 512  # points at which they are judged
_COMPACT = 0.3  # radius over distance, in the mean over what it lights, up to which a surface is a lamp
_MATTERS = 0.03  # share of the light in the picture above which a surface is a lamp
_TOGETHER = 0.3  # share of all lamps below which shadow rays do not pay
_AIMED, _AIMED_FROM = 8, 256  # points on a lamp to which rays are tried, and of how many receivers
_UNSURE = 0.05  # see _unsureness: what is hidden in part more often is shown better by photons and rays
_SIDE = 2
SKY_RAYS = _SIDE * _SIDE  # to the surroundings, of a gather
POINTS = 4096  # on lamps, in one pass
CANDIDATES = 32  # of them that compete for a shadow ray


class Lamps(NamedTuple):
    """What shadow rays are sent to, as entries of one discrete distribution, lights last.

    cumulative: (e + 1,) float64, from 0 to 1. code: (n,) int32, 2 triangle + side of entries 0..n-1.
    light, light_power, radius: as in Emitters. power: W, of all entries. shines: (t, 2) bool, sides of triangles that
    shadow rays are sent to.
    """

    cumulative: np.ndarray
    code: np.ndarray
    light: np.ndarray
    light_power: np.ndarray
    radius: float
    power: float
    shines: np.ndarray


def choose_lamps(
    surfaces: Surfaces,
    tracer: Tracer,
    side_power: np.ndarray,
    matters: np.ndarray,
    place: np.ndarray,
    facing: np.ndarray,
    code: np.ndarray,
    lit: float,
    key: np.uint64,
) -> np.ndarray:
    """Sheets of surface that are lamps: small against their distance, a good part of the light in the picture, and
    hidden or not, but seldom in part.

    side_power: (t,) float64 |excess| power of one side of each triangle, W. matters: (t, 2) bool, sides that can light
    the image (the inside of a closed lamp cannot). place, facing (r, 3) float64, code (r,) int32: points that camera
    paths gather at, see Pilot. lit: W m-2, mean irradiance there from all surfaces, as far as known. key: of the random
    numbers.
    Returns (m, 2) bool, which sides of triangles belong to a lamp.
    """
    sheet = surfaces.sheet
    power = np.bincount(sheet.ravel(), (side_power[:, None] * matters).ravel())
    chosen = np.zeros(power.size, np.bool_)
    labels = np.argsort(-power, kind="stable")[:_MOST]
    labels = labels[power[labels] > 0]
    if len(place) == 0 or len(labels) == 0:
        return chosen[sheet]
    some = slice(None, None, max(1, len(place) // _RECEIVERS))
    place, facing, code = place[some], facing[some], code[some]
    row = np.full(power.size, -1, np.int32)
    row[labels] = np.arange(labels.size)
    centre, radius = _spheres(surfaces.corners, sheet, row, labels.size)
    towards = centre[:, None] - place
    distance = np.maximum(np.linalg.norm(towards, axis=2), radius[:, None])
    cosine = np.maximum(np.sum(towards * facing, axis=2), 0.0) / distance
    received = power[labels, None] * cosine / (4.0 * math.pi * distance**2)
    irradiance = received.mean(axis=1)
    nearness = np.sum(received * radius[:, None] / distance, axis=1) / np.maximum(received.sum(axis=1), 1e-300)
    compact = (irradiance > 0) & (nearness < _COMPACT)
    lit = max(lit, irradiance[compact].sum())
    compact &= irradiance > _MATTERS * lit
    some = slice(None, None, max(1, len(place) // _AIMED_FROM))
    receivers = place[some], facing[some], code[some]
    for lamp in np.flatnonzero(compact):
        compact[lamp] = _unsureness(surfaces, tracer, side_power, labels[lamp], *receivers, key) < _UNSURE
    if irradiance[compact].sum() > _TOGETHER * lit:
        chosen[labels[compact]] = True
    return chosen[sheet]


def _unsureness(surfaces, tracer, side_power, label, place, facing, code, key) -> float:
    """Variance that shadow rays to one sheet have as other things hide a part of it, over the mean square of what they
    bring to the places.

    A shadow ray goes to a point in proportion to what it would cause (see send_shadow). With G the mean of that, and E
    that of the points from which the way is free, it brings G with the chance E / G: a variance of E (G - E).
    """
    sides = np.flatnonzero(surfaces.sheet.ravel() == label)
    cumulative = np.cumsum(side_power[sides >> 1])
    origin, direction = np.empty((2, _AIMED * len(place), 3), np.float32)
    caused = np.empty(len(origin))
    _aim(surfaces, sides, cumulative / cumulative[-1], place, facing, code, key, origin, direction, caused)
    blocker, _, _ = tracer.trace(origin, direction, np.ones(len(origin), np.float32))
    caused = caused.reshape(-1, _AIMED)
    free = (blocker < 0).reshape(caused.shape)
    unhidden, seen = caused.mean(axis=1), (caused * free).mean(axis=1)
    total = float(np.sum(seen**2))
    return float(np.sum(seen * (unhidden - seen))) / total if total > 0.0 else math.inf


@njit(inline="always")
def _point_on(surfaces, code, s, w):
    """Barycentric coordinates, place and normal of a point on side `code` (2 triangle + side), uniform over its area
    and clear of it."""
    t = code >> 1
    nx, ny, nz = unit_normal(surfaces, t, code & 1)
    u, v = triangle_point(s, w)
    x, y, z = point(surfaces.corners, t, u, v)
    x, y, z = clear_of(surfaces, t, x, y, z, nx, ny, nz)
    return u, v, x, y, z, nx, ny, nz


@njit(**KERNEL)
def _aim(surfaces, sides, cumulative, place, facing, code, key, origin, direction, caused):
    """Rays from each place to _AIMED points on a sheet, and the irradiance, m-2, for 1 W of its power, that they would
    cause. sides: (n,) codes of the sheet. cumulative: (n,) float64, of their power, up to 1."""
    for i in range(caused.size):
        path, receiver = path_key(key, i), i // _AIMED
        chosen = sides[min(np.searchsorted(cumulative, uniform(path, 0)), sides.size - 1)]
        _, _, x, y, z, nx, ny, nz = _point_on(surfaces, chosen, uniform(path, 1), uniform(path, 2))
        fx, fy, fz = facing[receiver]
        px, py, pz = place[receiver]
        ox, oy, oz = clear_of(surfaces, code[receiver] >> 1, px, py, pz, fx, fy, fz)
        dx, dy, dz = x - ox, y - oy, z - oz
        cos_hit, cos_lamp = dx * fx + dy * fy + dz * fz, -(dx * nx + dy * ny + dz * nz)  # times the distance
        d2 = dx * dx + dy * dy + dz * dz
        caused[i] = max(0.0, cos_hit) * max(0.0, cos_lamp) / (math.pi * d2 * d2)
        further = CLEAR * math.sqrt(d2)  # or the lamp's own surface hides it, see send_shadow
        dx, dy, dz = dx + further * nx, dy + further * ny, dz + further * nz
        put_ray(surfaces, code[receiver] >> 1, px, py, pz, fx, fy, fz, dx, dy, dz, origin, direction, i)


@njit(cache=True, nogil=True)
def _spheres(corners, sheet, row, count):
    """Centre (n, 3) and radius (n,) of spheres that hold sheets. row: (labels,) int32, the sphere of a label or -1."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    for axis in range(3):
                        low[n, axis] = min(low[n, axis], corners[t, i, axis])
                        high[n, axis] = max(high[n, axis], corners[t, i, axis])
    centre, square = 0.5 * (low + high), np.zeros(count)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    distance2 = 0.0
                    for axis in range(3):
                        distance2 += (corners[t, i, axis] - centre[n, axis]) ** 2
                    square[n] = max(square[n], distance2)
    return centre, np.sqrt(square)


def build_lamps(emitters: Emitters, surfaces: Surfaces, side_power: np.ndarray, shines: np.ndarray) -> Lamps:
    """The emitters that shadow rays are sent to: those marked as lamps, and all lights. shines: see Lamps."""
    code = emitters.surface[emitters.lamp]
    # in the order of a curve through space: points at equal steps along it lie all around a lamp
    code = code[morton_order(centroids(surfaces.corners[code >> 1]))]
    light_total = light_totals(emitters.light, emitters.light_power, emitters.radius)
    cumulative = np.concatenate(([0.0], np.cumsum(np.concatenate((side_power[code >> 1], light_total)))))
    total = float(cumulative[-1])
    if total > 0:
        cumulative /= total
    return Lamps(cumulative, code, emitters.light, emitters.light_power, emitters.radius, total, shines)


class LampPoints(NamedTuple):
    """Points on lamps in proportion to power, n of them in the order of the lamps, for one pass.

    position, normal: (n, 3) float64; for suns the direction towards them instead of a position, and no normal for
    points of no extent. entry: (n,) int32, of the lamp. u, v: (n,) float64, on a triangle.
    """

    position: np.ndarray
    normal: np.ndarray
    entry: np.ndarray
    u: np.ndarray
    v: np.ndarray


@njit(cache=True, nogil=True)
def lamp_points(lamps, surfaces, key):
    """The POINTS lamp points of a pass. key: of the pass's lamps."""
    count = POINTS if lamps.power > 0.0 else 0
    points = LampPoints(
        np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count, np.int32), np.zeros(count), np.zeros(count)
    )
    last = lamps.cumulative.size - 2
    entry = 0
    for i in range(count):
        path = path_key(key, i)
        pick = (i + uniform(path, 0)) / count
        while entry < last and lamps.cumulative[entry + 1] <= pick:
            entry += 1
        points.entry[i] = entry
        s, w = uniform(path, 1), uniform(path, 2)
        if entry < lamps.code.size:
            u, v, x, y, z, nx, ny, nz = _point_on(surfaces, lamps.code[entry], s, w)
            points.position[i, 0], points.position[i, 1], points.position[i, 2] = x, y, z
            points.normal[i, 0], points.normal[i, 1], points.normal[i, 2] = nx, ny, nz
            points.u[i], points.v[i] = u, v
            continue
        row = lamps.light[entry - lamps.code.size]
        kind = int(row[0])
        if kind == SUN:
            lx, ly, lz = cone_direction(s, w, row[10])
            dx, dy, dz = to_world(lx, ly, lz, row[4], row[5], row[6])
            points.position[i, 0], points.position[i, 1], points.position[i, 2] = -dx, -dy, -dz
            continue
        if kind in (RECTANGLE, ELLIPSE):
            x, y, z = area_light_point(row, s, w)
            nx, ny, nz = area_light_normal(row)
        else:  # a sphere of even radiance, or a point
            nx = ny = nz = 0.0
            if row[11] > 0.0:
                nx, ny, nz = cone_direction(s, w, -1.0)
            x, y, z = row[1] + row[11] * nx, row[2] + row[11] * ny, row[3] + row[11] * nz
        points.position[i, 0], points.position[i, 1], points.position[i, 2] = x, y, z
        points.normal[i, 0], points.normal[i, 1], points.normal[i, 2] = nx, ny, nz
    return points


@njit(inline="always")
def _received(lamps, points, i, hit):
    """Irradiance at a hit from a lamp point that nothing hides, m-2, for 1 W of power of its lamp."""
    px, py, pz = points.position[i]
    nx, ny, nz = points.normal[i]
    entry = points.entry[i]
    kind = RECTANGLE
    if entry >= lamps.code.size:
        kind = int(lamps.light[entry - lamps.code.size, 0])
    if kind == SUN:
        return max(0.0, px * hit.nx + py * hit.ny + pz * hit.nz) / (math.pi * lamps.radius * lamps.radius)
    dx, dy, dz = px - hit.x, py - hit.y, pz - hit.z
    d2 = dx * dx + dy * dy + dz * dz
    cos_hit = dx * hit.nx + dy * hit.ny + dz * hit.nz  # both cosines times the distance
    cos_lamp = -(dx * nx + dy * ny + dz * nz)
    if cos_hit <= 0.0:
        return 0.0
    if kind in (RECTANGLE, ELLIPSE):
        return max(0.0, cos_lamp) * cos_hit / (math.pi * d2 * d2)
    row = lamps.light[entry - lamps.code.size]
    inverse = 1.0 / math.sqrt(d2)
    intensity = 1.0 / (2.0 * math.pi * (1.0 - row[10]))
    if kind == SPOT:
        intensity *= spot_brightness(row, -(dx * row[4] + dy * row[5] + dz * row[6]) * inverse)
    if row[11] > 0.0:  # a sphere shows each direction the disk pi r^2 of its 4 pi r^2
        intensity *= 4.0 * max(0.0, cos_lamp) * inverse
    return intensity * cos_hit * inverse / d2


class Shadows(NamedTuple):
    """Shadow rays, n of them: origin, direction (n, 3), to the lamp where the ray's parameter is reach (n,); what
    arrives in the pixel if nothing is between, radiance (n, b); all float32. pixel: (n,) int32. layer: (n,) uint8, of
    the image (see layers).
    """

    origin: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    radiance: np.ndarray
    pixel: np.ndarray
    layer: np.ndarray


def empty_shadows(count: int, bands: int) -> Shadows:
    """Room for count shadow rays."""
    return Shadows(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint8),
    )


@njit(inline="always")
def send_shadow(
    lamps, points, surfaces, radiometry, hit, throughput, share, path, dimension, weight, value, pixel, shadows, count
):
    """Choose a point on a lamp for the hit and fill shadow ray `count`; returns 1, or 0 if no lamp shines there.

    Of a few points, spread evenly over the lamps' power, one is chosen in proportion to the irradiance it would cause
    (resampled importance sampling, Talbot et al. 2005): unbiased, and most of what is left to chance is whether
    something is between. path, dimension: of the random numbers. weight, value: room for (CANDIDATES,), (b,) float64.
    """
    material = surfaces.material[hit.triangle]
    specular = float(radiometry.specular[material])
    alpha = float(radiometry.alpha[material])
    stride = POINTS // CANDIDATES
    offset = int(stride * uniform(path, dimension))
    total = 0.0
    for c in range(CANDIDATES):
        total += _received(lamps, points, offset + stride * c, hit)
        weight[c] = total
    if total <= 0.0:
        return 0
    pick = total * uniform(path, dimension + 1)
    c = 0
    while c < CANDIDATES - 1 and weight[c] <= pick:
        c += 1
    i = offset + stride * c
    chosen, u, v = points.entry[i], points.u[i], points.v[i]
    x, y, z = points.position[i]
    ox, oy, oz = clear_of(surfaces, hit.triangle, hit.x, hit.y, hit.z, hit.nx, hit.ny, hit.nz)
    dx, dy, dz, reach = x - ox, y - oy, z - oz, 1.0
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    probability = lamps.cumulative[chosen + 1] - lamps.cumulative[chosen]
    factor = share * total / (CANDIDATES * probability)
    diffuse = (1.0 - specular) / math.pi
    if chosen < lamps.code.size:
        t = lamps.code[chosen] >> 1
        layer = layer_of(surfaces.layer, t)
        nx, ny, nz, double_area = normal(surfaces.corners, t)
        excess(
            radiometry, surfaces.material[t], temperature_at(surfaces.temperature, t, u, v),
            abs(dx * nx + dy * ny + dz * nz) / distance, value,
        )  # fmt: skip
        factor *= 0.5 * double_area * math.pi
        brdf = diffuse  # camera paths find the lamp in the specular lobe themselves
    else:
        light, layer = chosen - lamps.code.size, 0
        for b in range(value.size):
            value[b] = lamps.light_power[light, b]
        if int(lamps.light[light, 0]) == SUN:
            factor *= math.pi * lamps.radius * lamps.radius  # its power is per square metre
            dx, dy, dz, reach = x, y, z, 1e37
        brdf = diffuse
        if alpha > 0.0 and specular > 0.0:
            brdf += specular * _lobe(hit, dx, dy, dz, alpha)
    # so long a ray must end further from the lamp, or its own surface, or one that it is flush with, hides it
    ux, uy, uz = points.normal[i]
    dx, dy, dz = dx + CLEAR * distance * ux, dy + CLEAR * distance * uy, dz + CLEAR * distance * uz
    _start(surfaces, hit, dx, dy, dz, reach, pixel, layer, shadows, count)
    rho = radiometry.reflectance[material]
    for b in range(value.size):
        shadows.radiance[count, b] = throughput[b] * rho[b] * (value[b] * brdf * factor)
    return 1


@njit(inline="always")
def send_sky(surfaces, radiometry, emitters, hit, throughput, share, path, dimension, pixel, shadows, count):
    """Fill SKY_RAYS shadow rays from `count` on towards the surroundings, cosine-distributed and stratified."""
    material = surfaces.material[hit.triangle]
    rho = radiometry.reflectance[material]
    scale = share * (1.0 - radiometry.specular[material]) / SKY_RAYS
    for stratum in range(SKY_RAYS):
        s, w = uniform(path, dimension + 2 * stratum), uniform(path, dimension + 2 * stratum + 1)
        lx, ly, lz = cosine_stratum(stratum, _SIDE, s, w)
        dx, dy, dz = to_world(lx, ly, lz, hit.nx, hit.ny, hit.nz)
        _start(surfaces, hit, dx, dy, dz, 1e37, pixel, emitters.sky_layer, shadows, count + stratum)
        for b in range(rho.size):
            shadows.radiance[count + stratum, b] = throughput[b] * rho[b] * (emitters.surroundings[b] * scale)


@njit(inline="always")
def _start(surfaces, hit, dx, dy, dz, reach, pixel, layer, shadows, count):
    put_ray(
        surfaces, hit.triangle, hit.x, hit.y, hit.z, hit.nx, hit.ny, hit.nz, dx, dy, dz,
        shadows.origin, shadows.direction, count,
    )  # fmt: skip
    shadows.reach[count] = reach
    shadows.pixel[count], shadows.layer[count] = pixel, layer


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


@njit(**KERNEL)
def add_unshadowed(triangle, shadows, image):
    """Add to the image (n, layers * b) what shadow rays bring that met nothing (triangle < 0)."""
    bands = shadows.radiance.shape[1]
    for i in range(triangle.size):
        if triangle[i] < 0:
            row, first = image[shadows.pixel[i]], bands * shadows.layer[i]
            for b in range(bands):
                row[first + b] += shadows.radiance[i, b]
