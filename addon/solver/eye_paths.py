# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths: what a ray meets emits exactly, its specular lobe is followed to the next surface, and its diffuse
reflection comes from the photon map or, beside walls, from a final gather whose rays ask the map one bounce later."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .camera import eye_rays, sobol_points
from .lamps import CANDIDATES, SKY_RAYS, add_unshadowed, empty_shadows, send_shadow, send_sky
from .photon_map import gather, irradiance, neighbours_room
from .radiometry import excess
from .rng import path_key, uniform
from .sampling import FAST, basis, cosine_stratum, lobe_brdf, mirror, reflect_in_lobe, to_world, turn
from .surfaces import PATCH_LIMIT, facing_side, point, put_ray, temperature_at, unit_normal
from .transport import MAX_SURVIVAL

# Rays of a pixel in one pass. What they meet first costs a fraction of a gather and is all there is to see at
# silhouettes; rays of a pixel that meet one surface share a gather.
CAMERA_SAMPLES = 16
_SIDE = 6
_SPLIT = _SIDE * _SIDE  # rays of a final gather, stratified
_DIMENSIONS = 4  # random numbers of one bounce
_GATHERING, _FEELING, _LAMPS, _SPLITTING = 1 << 18, 1 << 19, 1 << 20, 1 << 21  # where others start
_SURE = 8  # bounces before which only weak paths end: a view in a mirror has no noise from roulette
_FEELERS = 4
_FEELER_SINE = 0.05  # they rise little, to feel low steps too
_FEELER_COSINE = math.sqrt(1.0 - _FEELER_SINE**2)
_LEAST_FREE = 1.0 / 36.0  # share of the largest disk's area that photons may fill however close the walls
_FEWEST = 8  # neighbours at the ends of a final gather, whose noise is the mean of many
_LITTLE = 1.0 / 32.0  # of a pixel: roulette decides on gathers that carry less
_FULL = 0.25  # roulette starts where less than this is left of a path: below it a path matters little


class Estimate(NamedTuple):
    """Choices of the radiance estimate in one pass.

    neighbours: k. reach2: m2, squared radius of the largest disk. shrink2: factor on r^2 in this pass.
    photons: whether the map holds any. straight: whether rough lobes need photons straight from lights.
    density: (2 t,) float32, m-2, photons expected in a disk of unit squared radius on each sheet, by label.
    """

    neighbours: int
    reach2: float
    shrink2: float
    photons: bool
    straight: bool
    density: np.ndarray


class Rays(NamedTuple):
    """Camera paths on their way, n of them, those of a pixel one behind the other.

    origin, direction: (n, 3) float32. throughput: (n, b) float32. pixel: (n,) int32 in the chunk. path: (n,) uint64 key
    of the random numbers. gathered: (n,) bool, whether it is part of a final gather.
    """

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    pixel: np.ndarray
    path: np.ndarray
    gathered: np.ndarray


def empty_rays(count: int, bands: int) -> Rays:
    """Room for count rays."""
    return Rays(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint64),
        np.empty(count, np.bool_),
    )


def render_pixels(
    tracer,
    surfaces,
    radiometry,
    emitters,
    lamps,
    lamp_points,
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
    count, bands = CAMERA_SAMPLES * len(image), image.shape[1]
    rays = empty_rays(count, bands)
    reach = np.empty(count, np.float32)
    points = sobol_points(CAMERA_SAMPLES * index, CAMERA_SAMPLES)
    eye_rays(eye, keys[0], points, np.arange(first, first + len(image)), rays.origin, rays.direction, reach)
    start_paths(keys[1], first, rays)
    image[:] = 0.0
    bounce = 0
    while count and not cancelled():
        gathers = Gathers(np.empty(count, np.int32), np.empty(count, np.float32), np.zeros(count, np.float32))
        hits = tracer.trace(rays.origin[:count], rays.direction[:count], reach)
        found = meet(surfaces, radiometry, emitters.surroundings, lamps.shines, bounce, *hits, rays, image, gathers)
        if bounce == 0:
            np.sum(image, axis=1, out=seen)
        split = 0
        if estimate.photons:
            free2 = _feel(tracer, surfaces, estimate, bounce, hits, rays, gathers, found)
            split = choose_splits(surfaces, estimate, hits[0], rays, gathers, found, free2)
            reflect(surfaces, radiometry, photon_map, estimate, *hits, rays, gathers, found, free2, image)
        shadows = empty_shadows((1 + SKY_RAYS) * found, bands)
        sent = send_shadows(
            surfaces, radiometry, emitters, lamps, lamp_points, bounce, *hits, rays, gathers, found, shadows
        )
        if sent:
            blocker, _, _ = tracer.trace(shadows.origin[:sent], shadows.direction[:sent], shadows.reach[:sent])
            add_unshadowed(blocker, shadows, image)
        onward = empty_rays(count + _SPLIT * split, bands)
        count = follow(surfaces, radiometry, bounce, *hits, rays, gathers.split, onward)
        rays = onward
        reach = np.full(count, 1e37, np.float32)
        bounce += 1


@njit(cache=True, nogil=True)
def start_paths(key, first, rays):
    """Camera rays carry an even share of their pixel."""
    for i in range(rays.pixel.size):
        rays.pixel[i] = i // CAMERA_SAMPLES
        rays.path[i] = path_key(key, CAMERA_SAMPLES * first + i)
        rays.gathered[i] = False
        rays.throughput[i, :] = 1.0 / CAMERA_SAMPLES


class Gathers(NamedTuple):
    """Rays that gather: their indexes (n,) int32, and a factor on the throughput of each, which stands for others too,
    (n,) float32. split: (rays,) float32, that factor for rays that gather by rays of their own, else 0.
    """

    ray: np.ndarray
    weight: np.ndarray
    split: np.ndarray


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
    nx, ny, nz = unit_normal(surfaces, t)
    cosine = -(dx * nx + dy * ny + dz * nz)
    side = 0
    if cosine < 0.0:
        side, cosine, nx, ny, nz = 1, -cosine, -nx, -ny, -nz
    x, y, z = point(surfaces.corners, t, u, v)
    return Hit(t, side, x, y, z, nx, ny, nz, dx, dy, dz, max(1e-6, cosine))


@njit(cache=True, nogil=True, fastmath=FAST)
def meet(surfaces, radiometry, surroundings, shines, bounce, triangle, u, v, rays, image, gathers):
    """Add to the image what the surfaces that the rays meet emit; list the rays that gather what they reflect.

    Rays of a pixel that meet one sheet of one material share a gather, and roulette decides on those that would carry
    little. Returns how many gather. shines: see Lamps; final gathers leave lamps to shadow rays.
    """
    bands = image.shape[1]
    emitted = np.empty(bands)
    known, known_kelvin = -1, -1.0  # material and temperature whose excess `emitted` holds
    found = newest = 0
    pixel = -1
    for i in range(triangle.size):
        if rays.pixel[i] != pixel:
            pixel, newest = rays.pixel[i], found
        t = triangle[i]
        if t < 0:
            for b in range(bands):
                image[pixel, b] += rays.throughput[i, b] * surroundings[b]
            continue
        material = surfaces.material[t]
        side = facing_side(surfaces, t, rays.direction, i)
        rough = radiometry.alpha[material] > 0.0
        if not (rays.gathered[i] and shines[t, side]):
            kelvin = temperature_at(surfaces.temperature, t, u[i], v[i])
            if rough or material != known or kelvin != known_kelvin:
                cosine = _hit(surfaces, rays, i, t, u[i], v[i]).cosine if rough else 1.0
                excess(radiometry, material, kelvin, cosine, emitted)
                known, known_kelvin = -1 if rough else material, kelvin
            for b in range(bands):
                image[pixel, b] += rays.throughput[i, b] * emitted[b]
        if radiometry.specular[material] == 1.0 and not rough:
            continue
        carried = _largest(rays.throughput[i], radiometry.reflectance[material])
        if carried == 0.0:
            continue
        sheet = surfaces.sheet[t, side]
        g = newest
        while g < found:
            other = gathers.ray[g]
            if (
                surfaces.sheet[triangle[other], facing_side(surfaces, triangle[other], rays.direction, other)] == sheet
                and surfaces.material[triangle[other]] == material
                and rays.gathered[other] == rays.gathered[i]
            ):
                break
            g += 1
        if g == found:
            gathers.weight[g] = 0.0
            found += 1
        # each ray of a group stands for it with a chance in proportion to what it carries: the mean is that of a gather
        # for every ray. Until the end of this loop `weight` is the sum of what they carry.
        gathers.weight[g] += carried
        if uniform(rays.path[i], _DIMENSIONS * bounce + 3) * gathers.weight[g] < carried:
            gathers.ray[g] = i
    kept = 0
    for g in range(found):
        i = gathers.ray[g]
        chance = min(1.0, gathers.weight[g] / _LITTLE)
        if uniform(rays.path[i], _GATHERING + bounce) < chance:
            carried = _largest(rays.throughput[i], radiometry.reflectance[surfaces.material[triangle[i]]])
            gathers.ray[kept], gathers.weight[kept] = i, gathers.weight[g] / (carried * chance)
            kept += 1
    return kept


@njit(cache=True, nogil=True)
def choose_splits(surfaces, estimate, triangle, rays, gathers, found, free2):
    """Mark the gathers around which too few photons are expected; they send rays instead. Returns their number.

    What is expected is known before the pass, so the choice does not depend on its photons and leaves the mean alone.
    """
    split = 0
    for g in range(found):
        i = gathers.ray[g]
        t = triangle[i]
        if rays.gathered[i] or free2[g] >= np.float32(estimate.reach2):
            continue
        expected = estimate.density[surfaces.sheet[t, facing_side(surfaces, t, rays.direction, i)]] * free2[g]
        if expected < estimate.neighbours:
            gathers.split[i] = gathers.weight[g]
            split += 1
    return split


def _feel(tracer, surfaces, estimate, bounce, hits, rays, gathers, found):
    """Squared radius (m2) of the free space around each gather, (found,) float32, at most that of the largest disk.

    Short rays along the surface feel for walls: a disk that reached beyond one would count light from its other side,
    and close to other surfaces light changes quickly (Ward's harmonic distance says the same).
    """
    origin, direction = np.empty((2, _FEELERS * found, 3), np.float32)
    start_feelers(surfaces, bounce, *hits, rays, gathers, found, origin, direction)
    length = math.sqrt(estimate.reach2) / _FEELER_COSINE
    blocker, u, v = tracer.trace(origin, direction, np.full(len(origin), length, np.float32))
    return shortest_feelers(surfaces, hits[0], rays, gathers, blocker, u, v, origin, direction, estimate.reach2, found)


@njit(cache=True, nogil=True)
def start_feelers(surfaces, bounce, triangle, u, v, rays, gathers, found, origin, direction):
    for g in range(found):
        i = gathers.ray[g]
        hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
        c, s = turn(uniform(rays.path[i], _FEELING + bounce))
        for feeler in range(_FEELERS):
            row = _FEELERS * g + feeler
            dx, dy, dz = to_world(_FEELER_COSINE * c, _FEELER_COSINE * s, _FEELER_SINE, hit.nx, hit.ny, hit.nz)
            c, s = -s, c
            put_ray(
                surfaces, hit.triangle, hit.x, hit.y, hit.z, hit.nx, hit.ny, hit.nz, dx, dy, dz, origin, direction, row
            )  # fmt: skip


@njit(cache=True, nogil=True)
def shortest_feelers(surfaces, triangle, rays, gathers, blocker, u, v, origin, direction, reach2, found):
    """Of a hollow surface feelers meet itself: that is no wall."""
    free2 = np.empty(found, np.float32)
    for g in range(found):
        nearest2 = reach2
        t = triangle[gathers.ray[g]]
        own = surfaces.sheet[t, facing_side(surfaces, t, rays.direction, gathers.ray[g])]
        for row in range(_FEELERS * g, _FEELERS * (g + 1)):
            t = blocker[row]
            if t >= 0 and surfaces.sheet[t, facing_side(surfaces, t, direction, row)] != own:
                x, y, z = point(surfaces.corners, t, u[row], v[row])
                dx, dy, dz = x - origin[row, 0], y - origin[row, 1], z - origin[row, 2]
                # a wall may stand 45 degrees away from the nearest feeler
                nearest2 = min(nearest2, 0.5 * _FEELER_COSINE * _FEELER_COSINE * (dx * dx + dy * dy + dz * dz))
        free2[g] = nearest2
    return free2


@njit(inline="always")
def end_neighbours(k):
    """Neighbours that the ends of a final gather ask for: no more than k, which a search has room for."""
    return min(k, max(_FEWEST, k // 4))


@njit(cache=True, nogil=True, fastmath=FAST)
def reflect(surfaces, radiometry, photon_map, estimate, triangle, u, v, rays, gathers, found, free2, image):
    """Add to the image what the photons around the hits reflect. free2: (found,) m2, free space around."""
    room = neighbours_room(estimate.neighbours)
    patch = np.empty(PATCH_LIMIT, np.int32)
    value = np.empty(image.shape[1])
    guess = estimate.reach2
    for g in range(found):
        i = gathers.ray[g]
        split = gathers.split[i] > 0.0
        if split and photon_map.photons.caustic.size == 0:
            continue
        hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
        material = surfaces.material[hit.triangle]
        specular = float(radiometry.specular[material])
        rough = specular > 0.0 and radiometry.alpha[material] > 0.0 and estimate.straight
        if specular == 1.0 and not rough:
            continue
        k = end_neighbours(estimate.neighbours) if rays.gathered[i] else estimate.neighbours
        reach2 = min(estimate.reach2, max(free2[g] / estimate.shrink2, _LEAST_FREE * estimate.reach2))
        kept, area, guess = gather(
            photon_map, surfaces, hit.triangle, hit.side, hit.x, hit.y, hit.z,
            k, reach2, estimate.shrink2, split, guess, room, patch,
        )  # fmt: skip
        if kept == 0:
            continue
        rho, out = radiometry.reflectance[material], image[rays.pixel[i]]
        irradiance(photon_map, room, kept, area, value)
        diffuse = gathers.weight[g] * (1.0 - specular) / math.pi
        for b in range(value.size):
            out[b] += rays.throughput[i, b] * rho[b] * diffuse * value[b]
        if rough:
            alpha, scale = float(radiometry.alpha[material]), gathers.weight[g] * specular / area
            _add_straight(photon_map, room, kept, scale, alpha, hit, rays.throughput[i], rho, out)


@njit(cache=True, nogil=True, fastmath=FAST)
def send_shadows(
    surfaces, radiometry, emitters, lamps, lamp_points, bounce, triangle, u, v, rays, gathers, found, shadows
):  # fmt: skip
    """Shadow rays of the gathers, to lamps and, from open sides, to the surroundings; returns their number."""
    value, weight = np.empty(radiometry.reference.size), np.empty(CANDIDATES)
    sky = False
    for b in range(value.size):
        sky |= emitters.surroundings[b] != 0.0
    sent = 0
    for g in range(found):
        i = gathers.ray[g]
        hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
        if sky and emitters.open[hit.triangle, hit.side] and gathers.split[i] == 0.0:
            send_sky(
                surfaces, radiometry, emitters.surroundings, hit, rays.throughput[i], gathers.weight[g], rays.path[i],
                _LAMPS + 16 * bounce + 2, rays.pixel[i], shadows, sent,
            )  # fmt: skip
            sent += SKY_RAYS
        if lamps.power > 0.0:
            sent += send_shadow(
                lamps, lamp_points, surfaces, radiometry, hit, rays.throughput[i], gathers.weight[g], rays.path[i],
                _LAMPS + 16 * bounce, weight, value, rays.pixel[i], shadows, sent,
            )  # fmt: skip
    return sent


@njit(cache=True, nogil=True, fastmath=FAST)
def follow(surfaces, radiometry, bounce, triangle, u, v, rays, split, onward):
    """Send on the rays that meet a specular surface, and those of final gathers; returns their number."""
    sent = 0
    for i in range(triangle.size):
        if triangle[i] < 0:
            continue
        is_specular = radiometry.specular[surfaces.material[triangle[i]]] > 0.0
        if is_specular or split[i] > 0.0:
            hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
            if is_specular:
                sent += _follow(surfaces, radiometry, hit, bounce, i, rays, sent, onward)
            if split[i] > 0.0:
                _split(surfaces, radiometry, hit, split[i], i, rays, sent, onward)
                sent += _SPLIT
    return sent


@njit(inline="always")
def _split(surfaces, radiometry, hit, weight, i, rays, sent, onward):
    """Send the rays of a final gather, cosine-distributed and stratified."""
    material = surfaces.material[hit.triangle]
    rho = radiometry.reflectance[material]
    scale = np.float32(weight * (1.0 - radiometry.specular[material]) / _SPLIT)
    for stratum in range(_SPLIT):
        row = sent + stratum
        path = path_key(rays.path[i], _SPLITTING + stratum)
        lx, ly, lz = cosine_stratum(stratum, _SIDE, uniform(path, 0), uniform(path, 1))
        dx, dy, dz = to_world(lx, ly, lz, hit.nx, hit.ny, hit.nz)
        _leave(surfaces, hit, dx, dy, dz, rays.pixel[i], path, row, onward)
        onward.gathered[row] = True
        for b in range(rho.size):
            onward.throughput[row, b] = rays.throughput[i, b] * rho[b] * scale


@njit(inline="always")
def _leave(surfaces, hit, dx, dy, dz, pixel, path, row, onward):
    put_ray(
        surfaces, hit.triangle, hit.x, hit.y, hit.z, hit.nx, hit.ny, hit.nz, dx, dy, dz,
        onward.origin, onward.direction, row,
    )  # fmt: skip
    onward.pixel[row], onward.path[row] = pixel, path


@njit(inline="always")
def _largest(throughput, rho):
    """Largest throughput of any band after a reflection."""
    largest = np.float32(0.0)
    for b in range(rho.size):
        largest = max(largest, throughput[b] * rho[b])
    return float(largest)


@njit(inline="always")
def _follow(surfaces, radiometry, hit, bounce, i, rays, sent, onward):
    """Send ray i on in one direction of the specular lobe, as ray `sent`; returns whether roulette let it live."""
    path = rays.path[i]
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
    left = scale * CAMERA_SAMPLES * _largest(rays.throughput[i], rho)
    survival = min(MAX_SURVIVAL if bounce >= _SURE else 1.0, left / _FULL)
    if left <= 0.0 or uniform(path, _DIMENSIONS * bounce + 2) >= survival:
        return 0
    _leave(surfaces, hit, ox, oy, oz, rays.pixel[i], path, sent, onward)
    onward.gathered[sent] = rays.gathered[i]
    for b in range(rho.size):
        onward.throughput[sent, b] = rays.throughput[i, b] * rho[b] * (scale / survival)
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
