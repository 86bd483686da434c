# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths: what a ray meets emits exactly, its diffuse reflection comes from the photon map, its specular lobe is
followed to the next surface."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .camera import eye_rays, sobol_point
from .photon_map import gather, irradiance, neighbours_room
from .radiometry import excess
from .rng import path_key, uniform
from .sampling import FAST, basis, lobe_brdf, mirror, reflect_in_lobe
from .surfaces import PATCH_LIMIT, normal, point, temperature_at
from .transport import MAX_SURVIVAL

_DIMENSIONS = 4  # random numbers of one bounce
_FULL = 0.25  # roulette starts where less than this is left of a path: below it a path matters little


class Estimate(NamedTuple):
    """Choices of the radiance estimate in one pass.

    neighbours: k. reach2: m2, squared radius of the largest disk. shrink2: factor on r^2 in this pass.
    photons: whether the map holds any. straight: whether rough lobes need photons straight from lights.
    """

    neighbours: int
    reach2: float
    shrink2: float
    photons: bool
    straight: bool


def render_pixels(
    tracer, surfaces, radiometry, surroundings, eye, photon_map, estimate, keys, index, first, image, cancelled
):
    """Estimate the excess radiance of pixels first..first+n-1 of the window in one pass into image (n, b) float32.

    keys: of the camera stream (of the seed, of this pass). index: of the pass.
    """
    count = len(image)
    origin, direction = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    reach = np.empty(count, np.float32)
    throughput, pixel = np.ones(image.shape, np.float32), np.arange(count, dtype=np.int32)
    image[:] = 0.0
    eye_rays(eye, keys[0], sobol_point(index), first, origin, direction, reach)
    bounce = 0
    while count and not cancelled():
        triangle, u, v = tracer.trace(origin[:count], direction[:count], reach[:count])
        count = shade(
            surfaces, radiometry, surroundings, photon_map, estimate, keys[1], bounce, first,
            triangle, u, v, origin, direction, throughput, pixel, image,
        )  # fmt: skip
        reach[:count] = 1e37
        bounce += 1


@njit(cache=True, nogil=True, fastmath=FAST)
def shade(
    surfaces,
    radiometry,
    surroundings,
    photon_map,
    estimate,
    key,
    bounce,
    first,
    triangle,
    u,
    v,
    origin,
    direction,
    throughput,
    pixel,
    image,
):
    """Add what the rays meet to the image and send on those that meet a specular surface, moved to the front.

    Returns the number of rays that go on.
    """
    bands = image.shape[1]
    room = neighbours_room(estimate.neighbours)
    patch = np.empty(PATCH_LIMIT, np.int32)
    value = np.empty(bands)
    guess = estimate.reach2
    alive = 0
    for i in range(triangle.size):
        t, row = triangle[i], pixel[i]
        if t < 0:
            for b in range(bands):
                image[row, b] += throughput[i, b] * surroundings[b]
            continue
        dx, dy, dz = float(direction[i, 0]), float(direction[i, 1]), float(direction[i, 2])
        inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
        nx, ny, nz, _ = normal(surfaces.corners, t)
        cosine = -(dx * nx + dy * ny + dz * nz)
        side = 0
        if cosine < 0.0:
            side, cosine, nx, ny, nz = 1, -cosine, -nx, -ny, -nz
        cosine = max(1e-6, cosine)
        material = surfaces.material[t]
        rho = radiometry.reflectance[material]
        alpha = float(radiometry.alpha[material])
        specular = float(radiometry.specular[material])
        kelvin = temperature_at(surfaces.temperature, t, u[i], v[i])
        excess(radiometry, material, kelvin, cosine, value)
        for b in range(bands):
            image[row, b] += throughput[i, b] * value[b]
        largest = 0.0
        for b in range(bands):
            largest = max(largest, float(throughput[i, b] * rho[b]))
        if largest == 0.0:
            continue
        x, y, z = point(surfaces.corners, t, u[i], v[i])
        rough = specular > 0.0 and alpha > 0.0
        if estimate.photons and (specular < 1.0 or (rough and estimate.straight)):
            kept, area, guess = gather(
                photon_map, surfaces, t, side, x, y, z,
                estimate.neighbours, estimate.reach2, estimate.shrink2, guess, room, patch,
            )  # fmt: skip
            if kept > 0:
                irradiance(photon_map, room, kept, area, value)
                diffuse = (1.0 - specular) / math.pi
                for b in range(bands):
                    image[row, b] += throughput[i, b] * rho[b] * diffuse * value[b]
                if rough and estimate.straight:
                    _add_straight(
                        photon_map, room, kept, specular / area, alpha, dx, dy, dz, nx, ny, nz,
                        throughput[i], rho, image[row],
                    )  # fmt: skip
        if specular == 0.0:
            continue
        # the specular lobe: follow one direction
        path = path_key(key, first + row)
        scale = specular
        if alpha == 0.0:
            ox, oy, oz = mirror(dx, dy, dz, nx, ny, nz, cosine)
        else:
            s, w = uniform(path, _DIMENSIONS * bounce), uniform(path, _DIMENSIONS * bounce + 1)
            ox, oy, oz, weight = reflect_in_lobe(dx, dy, dz, nx, ny, nz, cosine, alpha, s, w)
            if weight <= 0.0:
                continue
            scale *= weight
        survival = MAX_SURVIVAL
        if largest * scale < _FULL:
            survival = min(survival, largest * scale / _FULL)
        if uniform(path, _DIMENSIONS * bounce + 2) >= survival:
            continue
        scale /= survival
        clear = surfaces.clearance[t]
        origin[alive, 0], origin[alive, 1], origin[alive, 2] = x + clear * nx, y + clear * ny, z + clear * nz
        direction[alive, 0], direction[alive, 1], direction[alive, 2] = ox, oy, oz
        for b in range(bands):
            throughput[alive, b] = throughput[i, b] * rho[b] * scale
        pixel[alive] = row
        alive += 1
    return alive


@njit(inline="always")
def _add_straight(photon_map, room, count, scale, alpha, dx, dy, dz, nx, ny, nz, throughput, rho, out):
    """Reflect photons straight from lights in a rough lobe: lights are not there for a camera path to hit."""
    photons = photon_map.photons
    tx, ty, tz, bx, by, bz = basis(nx, ny, nz)
    ox, oy, oz = -(dx * tx + dy * ty + dz * tz), -(dx * bx + dy * by + dz * bz), -(dx * nx + dy * ny + dz * nz)
    for j in range(count):
        photon = room.index[j]
        px, py, pz = photons.incoming[photon, 0], photons.incoming[photon, 1], photons.incoming[photon, 2]
        iz = px * nx + py * ny + pz * nz
        if iz > 0.0:
            ix, iy = px * tx + py * ty + pz * tz, px * bx + py * by + pz * bz
            f = lobe_brdf(ix, iy, iz, ox, oy, oz, alpha) * scale
            for b in range(out.size):
                out[b] += throughput[b] * rho[b] * f * photons.power[photon, b]
