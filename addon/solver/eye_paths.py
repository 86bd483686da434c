# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths: what a ray meets emits exactly, its diffuse reflection comes from the photon map, its specular lobe is
followed to the next surface."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .camera import eye_rays, sobol_points
from .lamps import add_unshadowed, empty_shadows, send_shadow
from .photon_map import gather, irradiance, neighbours_room
from .radiometry import excess
from .rng import path_key, uniform
from .sampling import FAST, basis, lobe_brdf, mirror, reflect_in_lobe
from .surfaces import PATCH_LIMIT, facing_side, normal, point, temperature_at
from .transport import MAX_SURVIVAL

# Rays of a pixel in one pass. What they meet first costs a fraction of a gather and is all there is to see at
# silhouettes; rays of a pixel that meet one surface share a gather.
CAMERA_SAMPLES = 8
_SHARE = np.float32(1.0 / CAMERA_SAMPLES)
_DIMENSIONS = 4  # random numbers of one bounce
_LAMPS = 1 << 20  # the random numbers of shadow rays lie behind all others
_SURE = 8  # bounces before which only weak paths end: a view in a mirror has no noise from roulette
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


class Rays(NamedTuple):
    """Camera paths on their way, n of them, those of a pixel one behind the other.

    origin, direction: (n, 3) float32. throughput: (n, b) float32. number: (n,) int32 in the chunk, which says the pixel.
    """

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    number: np.ndarray


def render_pixels(
    tracer,
    surfaces,
    radiometry,
    surroundings,
    lamps,
    eye,
    photon_map,
    estimate,
    keys,
    index,
    first,
    image,
    seen,
    cancelled,
):
    """Estimate the excess radiance of pixels first..first+n-1 of the window in one pass into image (n, b) float32.

    keys: of the camera stream (of the seed, of this pass). index: of the pass. seen: (n,) float32, filled with the part
    of the radiance over all bands that the surfaces send straight into the camera.
    """
    count = CAMERA_SAMPLES * len(image)
    rays = Rays(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.ones((count, image.shape[1]), np.float32),
        np.arange(count, dtype=np.int32),
    )
    reach = np.empty(count, np.float32)
    points = sobol_points(CAMERA_SAMPLES * index, CAMERA_SAMPLES)
    eye_rays(eye, keys[0], points, np.arange(first, first + len(image)), rays.origin, rays.direction, reach)
    shadows = empty_shadows(count if lamps.power > 0.0 else 0, image.shape[1])
    image[:] = 0.0
    bounce = 0
    while count and not cancelled():
        triangle, u, v = tracer.trace(rays.origin[:count], rays.direction[:count], reach[:count])
        count, sent = shade(
            surfaces, radiometry, surroundings, lamps, photon_map, estimate, keys[1], bounce, first,
            triangle, u, v, rays, image, seen, shadows,
        )  # fmt: skip
        if sent:
            blocker, _, _ = tracer.trace(shadows.origin[:sent], shadows.direction[:sent], shadows.reach[:sent])
            add_unshadowed(blocker, shadows, image)
        reach[:count] = 1e37
        bounce += 1


class Hit(NamedTuple):
    """Where a ray meets a surface: the point, the unit normal that faces the ray, the ray's unit direction."""

    triangle: int
    side: int
    x: float
    y: float
    z: float
    nx: float
    ny: float
    nz: float
    dx: float
    dy: float
    dz: float
    cosine: float


@njit(inline="always")
def _hit(surfaces, rays, i, t, u, v):
    dx, dy, dz = float(rays.direction[i, 0]), float(rays.direction[i, 1]), float(rays.direction[i, 2])
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
    nx, ny, nz, _ = normal(surfaces.corners, t)
    cosine = -(dx * nx + dy * ny + dz * nz)
    side = 0
    if cosine < 0.0:
        side, cosine, nx, ny, nz = 1, -cosine, -nx, -ny, -nz
    x, y, z = point(surfaces.corners, t, u, v)
    return Hit(t, side, x, y, z, nx, ny, nz, dx, dy, dz, max(1e-6, cosine))


@njit(cache=True, nogil=True, fastmath=FAST)
def shade(
    surfaces,
    radiometry,
    surroundings,
    lamps,
    photon_map,
    estimate,
    key,
    bounce,
    first,
    triangle,
    u,
    v,
    rays,
    image,
    seen,
    shadows,
):
    """Add what the rays meet to the image and send on those that meet a specular surface, moved to the front.

    Returns the number of rays that go on and the number of shadow rays sent.
    """
    bands = image.shape[1]
    room = neighbours_room(estimate.neighbours)
    patch = np.empty(PATCH_LIMIT, np.int32)
    emitted, gathered = np.empty(bands), np.empty(bands)
    known, known_kelvin = -1, -1.0  # material and temperature whose excess `emitted` holds
    group_sheet, group_material = np.empty(CAMERA_SAMPLES, np.int32), np.empty(CAMERA_SAMPLES, np.int32)
    group_size, group_ray = np.empty(CAMERA_SAMPLES, np.int32), np.empty(CAMERA_SAMPLES, np.int64)
    guess = estimate.reach2
    alive = sent = start = 0
    while start < triangle.size:
        pixel = rays.number[start] // CAMERA_SAMPLES
        end, groups = start, 0
        while end < triangle.size and rays.number[end] // CAMERA_SAMPLES == pixel:
            i = end
            end += 1
            t = triangle[i]
            if t < 0:
                for b in range(bands):
                    image[pixel, b] += _SHARE * rays.throughput[i, b] * surroundings[b]
                continue
            material = surfaces.material[t]
            kelvin = temperature_at(surfaces.temperature, t, u[i], v[i])
            rough = radiometry.alpha[material] > 0.0
            if rough or material != known or kelvin != known_kelvin:
                cosine = _hit(surfaces, rays, i, t, u[i], v[i]).cosine if rough else 1.0
                excess(radiometry, material, kelvin, cosine, emitted)
                known, known_kelvin = -1 if rough else material, kelvin
            for b in range(bands):
                image[pixel, b] += _SHARE * rays.throughput[i, b] * emitted[b]
            side = facing_side(surfaces.corners, t, rays.direction, i)
            sheet = surfaces.sheet[t, side]
            g = 0
            while g < groups and not (group_sheet[g] == sheet and group_material[g] == material):
                g += 1
            if g == groups:
                group_sheet[g], group_material[g], group_size[g] = sheet, material, 0
                groups += 1
            # each ray of a group stands for it with the same chance, so the mean is that of a gather for every ray
            group_size[g] += 1
            choice = uniform(path_key(key, CAMERA_SAMPLES * first + rays.number[i]), _DIMENSIONS * bounce + 3)
            if choice * group_size[g] < 1.0:
                group_ray[g] = i
        if bounce == 0:
            total = 0.0
            for b in range(bands):
                total += image[pixel, b]
            seen[pixel] = total
        for g in range(groups):
            i = group_ray[g]
            rho, specular = radiometry.reflectance[group_material[g]], radiometry.specular[group_material[g]]
            rough = specular > 0.0 and radiometry.alpha[group_material[g]] > 0.0
            if _largest(rays.throughput[i], rho) == 0.0 or (specular == 1.0 and not rough):
                continue
            hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
            share = _SHARE * group_size[g]
            if estimate.photons and (specular < 1.0 or estimate.straight):
                guess = _add_reflection(
                    surfaces, radiometry, photon_map, estimate, hit, rays.throughput[i], share, guess, room, patch,
                    gathered, image[pixel],
                )  # fmt: skip
            if lamps.power > 0.0:
                path = path_key(key, CAMERA_SAMPLES * first + rays.number[i])
                sent += send_shadow(
                    lamps, surfaces, radiometry, hit, rays.throughput[i], share, path, _LAMPS + 256 * bounce, gathered,
                    pixel, shadows, sent,
                )  # fmt: skip
        for i in range(start, end):
            if triangle[i] >= 0 and radiometry.specular[surfaces.material[triangle[i]]] > 0.0:
                hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
                path = path_key(key, CAMERA_SAMPLES * first + rays.number[i])
                alive += _follow(surfaces, radiometry, hit, path, bounce, i, alive, rays)
        start = end
    return alive, sent


@njit(inline="always")
def _add_reflection(surfaces, radiometry, photon_map, estimate, hit, throughput, share, guess, room, patch, value, out):
    """Add what the photons around a hit reflect into the ray; returns the next guess of the squared radius."""
    material = surfaces.material[hit.triangle]
    specular = float(radiometry.specular[material])
    rho = radiometry.reflectance[material]
    rough = specular > 0.0 and radiometry.alpha[material] > 0.0 and estimate.straight
    kept, area, guess = gather(
        photon_map, surfaces, hit.triangle, hit.side, hit.x, hit.y, hit.z,
        estimate.neighbours, estimate.reach2, estimate.shrink2, guess, room, patch,
    )  # fmt: skip
    if kept > 0:
        irradiance(photon_map, room, kept, area, value)
        diffuse = share * (1.0 - specular) / math.pi
        for b in range(out.size):
            out[b] += throughput[b] * rho[b] * diffuse * value[b]
        if rough:
            alpha = float(radiometry.alpha[material])
            _add_straight(photon_map, room, kept, share * specular / area, alpha, hit, throughput, rho, out)
    return guess


@njit(inline="always")
def _largest(throughput, rho):
    """Largest throughput of any band after a reflection."""
    largest = np.float32(0.0)
    for b in range(rho.size):
        largest = max(largest, throughput[b] * rho[b])
    return float(largest)


@njit(inline="always")
def _follow(surfaces, radiometry, hit, path, bounce, i, alive, rays):
    """Send ray i on in one direction of the specular lobe, as ray `alive`; returns whether roulette let it live."""
    material = surfaces.material[hit.triangle]
    rho = radiometry.reflectance[material]
    alpha = float(radiometry.alpha[material])
    scale = float(radiometry.specular[material])
    if alpha == 0.0:
        ox, oy, oz = mirror(hit.dx, hit.dy, hit.dz, hit.nx, hit.ny, hit.nz, hit.cosine)
    else:
        s, w = uniform(path, _DIMENSIONS * bounce), uniform(path, _DIMENSIONS * bounce + 1)
        ox, oy, oz, weight = reflect_in_lobe(
            hit.dx, hit.dy, hit.dz, hit.nx, hit.ny, hit.nz, hit.cosine, alpha, s, w
        )  # fmt: skip
        scale *= weight
    left = scale * _largest(rays.throughput[i], rho)
    survival = min(MAX_SURVIVAL if bounce >= _SURE else 1.0, left / _FULL)
    if left <= 0.0 or uniform(path, _DIMENSIONS * bounce + 2) >= survival:
        return 0
    clear = surfaces.clearance[hit.triangle]
    rays.origin[alive, 0] = hit.x + clear * hit.nx
    rays.origin[alive, 1] = hit.y + clear * hit.ny
    rays.origin[alive, 2] = hit.z + clear * hit.nz
    rays.direction[alive, 0], rays.direction[alive, 1], rays.direction[alive, 2] = ox, oy, oz
    for b in range(rho.size):
        rays.throughput[alive, b] = rays.throughput[i, b] * rho[b] * (scale / survival)
    rays.number[alive] = rays.number[i]
    return 1


@njit(inline="always")
def _add_straight(photon_map, room, count, scale, alpha, hit, throughput, rho, out):
    """Reflect photons straight from lights in a rough lobe: lights are not there for a camera path to hit."""
    photons = photon_map.photons
    dx, dy, dz, nx, ny, nz = hit.dx, hit.dy, hit.dz, hit.nx, hit.ny, hit.nz
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
