# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths: what a ray meets emits exactly, its specular lobe is followed to the next surface, and its diffuse
reflection comes from the photon map or from a final gather, whose rays ask for photons one bounce later."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.eye import eye_rays
from ..geometry.free_space import free_space, largest_disk, unlimited
from ..geometry.point_tree import empty_walk
from ..geometry.surfaces import (
    PATCH_LIMIT,
    facing_side,
    inverse_distance,
    layer_of,
    point,
    put_ray,
    temperature_at,
    unit_normal,
)
from ..photons.irradiance_cache import recalled
from ..photons.photon_map import gather, irradiance, neighbours_room
from ..photons.transport import MAX_SURVIVAL
from ..physics.radiometry import NONE, excess
from ..planning.antialiasing import MOST
from ..planning.splitting import Splitting, gather_chance, recall_chance
from ..sampling.low_discrepancy import lattice_point
from ..sampling.rng import path_key, uniform
from ..sampling.warps import basis, cosine_direction, lobe_brdf, mirror, reflect_in_lobe, to_world
from ..system.kernels import FAST_INLINED, FAST_KERNEL, KERNEL, njit
from .final_gather import choose_splits, largest_throughput, open_finals, share
from .lamps import CANDIDATES, SKY_RAYS, add_unshadowed, empty_shadows, send_shadow, send_sky

_DIMENSIONS = 4  # random numbers of one bounce
_RECALLING, _GATHERING, _FEELING, _LAMPS, _SPLITTING, _AGAIN = (1 << k for k in range(17, 23))  # where others start
_SURE = 8  # bounces before which only weak paths end: a view in a mirror has no noise from roulette
_LITTLE = 1.0 / 32.0  # of a pixel: roulette decides on gathers that carry less
_FAR = 4.0  # squared distance up to which ends recall, over the squared radius of the largest disk
_EXCESSES, _PER_KELVIN = 64, 17.0  # slots; and how far apart a material's temperatures lie in them
_WEAK = 1.0 / 16.0  # of a camera ray: roulette starts where its path carries less


class Estimate(NamedTuple):
    """Choices of the radiance estimate in one pass.

    neighbours: k. reach2: m2, squared radius of the largest disk. shrink2: factor on r^2 in this pass.
    photons: whether passes have any, though one may store none. straight: whether rough lobes need photons straight
    from lights.
    splitting: what decides between photons and rays. layers: of the image (see layers).
    """

    neighbours: int
    reach2: float
    shrink2: float
    photons: bool
    straight: bool
    splitting: Splitting
    layers: int = 1


class Rays(NamedTuple):
    """Camera paths on their way, n of them, those of a pixel one behind the other.

    origin, direction: (n, 3) float32. throughput: (n, b) float32. pixel: (n,) int32, row of the image that they add to.
    path: (n,) uint64 key of the random numbers. gathered: (n,) bool, whether it is part of a final gather. again: (n,)
    bool, whether it goes on from the end of a ray of one.
    """

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    pixel: np.ndarray
    path: np.ndarray
    gathered: np.ndarray
    again: np.ndarray


def empty_rays(count: int, bands: int) -> Rays:
    """Room for count rays."""
    return Rays(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint64),
        np.empty(count, np.bool_),
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
    samples,
    photon_map,
    cache,
    estimate,
    keys,
    index,
    pixels,
    weights,
    cancelled,
):
    """Estimate the excess radiance of a tile of pixels in one pass.

    samples: (n,) uint16, rays of every pixel in a pass. keys: of the camera stream (of the seed, of this pass). index:
    of the pass. pixels: (h, w) int64, numbers in the window. weights: (layers * b,) float32, by which each band of each
    layer counts in the radiance over all. Returns image (h w, layers * b) float32, W m-2 sr-1, and seen (h w,) float32:
    the part of the radiance over all bands that the surfaces send straight into the camera.
    """
    samples, bands = samples[pixels.ravel()], radiometry.reference.size
    count = int(samples.sum())
    rays = empty_rays(count, bands)
    reach = np.empty(count, np.float32)
    eye_rays(eye, keys[0], index, samples, pixels.ravel(), rays.origin, rays.direction, reach)
    start_paths(keys[1], samples, pixels.ravel(), rays)
    image = np.zeros((pixels.size, weights.size), np.float32)  # and behind it, rows for what final gathers meet
    closeness = np.zeros(pixels.size)  # by row: sum of 1 / m to what their rays meet
    seen = np.zeros(pixels.size, np.float32)
    finals = []
    disks = near_disks(estimate)
    bounce = 0
    while count and not cancelled():
        hits = tracer.trace(rays.origin[:count], rays.direction[:count], reach)
        near, again = np.zeros(count, np.bool_), np.zeros(count, np.float32)
        gathers = meet(
            surfaces, radiometry, emitters, lamps, estimate.straight, disks, bounce, *hits, rays, near, closeness, image
        )
        if bounce == 0:
            np.einsum("pb,b->p", image, weights, out=seen)  # not by a library that has threads of its own
        split = 0
        if estimate.photons:
            found = len(gathers.ray)
            place, code, turns = np.empty((found, 3)), np.empty(found, np.int32), np.empty(found)
            locate_gathers(surfaces, bounce, *hits, rays, gathers, place, code, turns)
            numbers, space = pixels.ravel(), unlimited(found, estimate.reach2)
            of_gathers = surfaces, radiometry, estimate, numbers, place, code, rays, gathers
            split = choose_splits(*of_gathers, space.radius2, np.arange(found))
            felt = asking_photons(rays, gathers, photon_map, estimate)
            if len(felt):
                space = free_space(tracer, surfaces, estimate.reach2, place, code, turns, felt)
                split = choose_splits(*of_gathers, space.radius2, felt)
            reflect(surfaces, radiometry, photon_map, estimate, False, *hits, rays, gathers, space, image)
            if bounce > 0:
                lost = recall(surfaces, radiometry, cache, estimate, bounce, *hits, rays, near, again, image)
                anywhere = unlimited(len(lost.ray), estimate.reach2)
                reflect(surfaces, radiometry, photon_map, estimate, True, *hits, rays, lost, anywhere, image)
        if split:
            finals.append(open_finals(surfaces, radiometry, estimate, place, code, rays, gathers, len(image)))
            image = np.concatenate((image, np.zeros((len(finals[-1].pixel), weights.size), np.float32)))
            closeness = np.concatenate((closeness, np.zeros(len(finals[-1].pixel))))
        shadows = empty_shadows((1 + SKY_RAYS) * len(gathers.ray), bands)
        sent = send_shadows(
            surfaces, radiometry, emitters, lamps, lamp_points, bounce, *hits, rays, gathers, near, shadows
        )
        if sent:
            blocker, _, _ = tracer.trace(shadows.origin[:sent], shadows.direction[:sent], shadows.reach[:sent])
            add_unshadowed(blocker, shadows, image)
        onward = empty_rays(count + split + np.count_nonzero(again), bands)
        count = follow(surfaces, radiometry, bounce, *hits, rays, samples, gathers, again, onward)
        rays = onward
        reach = np.full(count, 1e37, np.float32)
        bounce += 1
    for final in finals:
        share(surfaces, final, estimate.shrink2, *pixels.shape, closeness, image)
    return image[: pixels.size], seen


@njit(**KERNEL)
def start_paths(key, samples, pixels, rays):
    """Camera rays carry an even share of their pixel."""
    row = 0
    for i in range(pixels.size):
        for sample in range(samples[i]):
            rays.pixel[row], rays.gathered[row], rays.again[row] = i, False, False
            rays.path[row] = path_key(key, MOST * pixels[i] + sample)
            rays.throughput[row, :] = np.float32(1.0) / samples[i]
            row += 1


class Gathers(NamedTuple):
    """Gathers, each for a group of rays: the index of the ray that stands for all where photons are asked (n,) int32,
    and a factor on its throughput, (n,) float32.

    carried: (n,) float64, what all rays of the group carry together. brought: (n,) float64, share of the pixel that
    their diffuse reflection makes up, times its sensitivity (see Looks). rays: (n,) int32, a power of two, how many a
    final gather sends, from the ends of all rays of the group; 0 where it asks photons. radius2: (n,) float64, m2, of
    the disk within which final gathers share rays. is_cut: (n,) bool, whether a rim cuts it. row: (n,) int32, the row
    of the image that these add to. of: (camera rays,) int32, the gather of a ray, or -1.
    """

    ray: np.ndarray
    weight: np.ndarray
    carried: np.ndarray
    brought: np.ndarray
    rays: np.ndarray
    radius2: np.ndarray
    is_cut: np.ndarray
    row: np.ndarray
    of: np.ndarray


def empty_gathers(count):
    """Room for the gathers of count rays."""
    return Gathers(
        np.empty(count, np.int32),
        np.empty(count, np.float32),
        np.empty(count),
        np.zeros(count),
        np.zeros(count, np.int32),
        np.zeros(count),
        np.zeros(count, np.bool_),
        np.empty(count, np.int32),
        np.full(count, -1, np.int32),
    )


def first_gathers(gathers, count):
    """The first so many gathers."""
    return Gathers(*(column[:count] for column in gathers[:-1]), gathers.of)


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


@njit(**FAST_INLINED)
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


class Excesses(NamedTuple):
    """What surfaces of one material and temperature emit, of those met last: scenes have few, and rays meet them again
    and again. Each has one slot that it can be in.

    material: (_EXCESSES,) int32, -1 for none. kelvin: (_EXCESSES,) float64. radiance: (_EXCESSES, b) float32, excess, W
    m-2 sr-1.
    """

    material: np.ndarray
    kelvin: np.ndarray
    radiance: np.ndarray


def _empty_excesses(bands):
    return Excesses(np.full(_EXCESSES, -1, np.int32), np.empty(_EXCESSES), np.empty((_EXCESSES, bands), np.float32))


def near_disks(estimate):
    """Areas of the disks of one estimate, (labels,) float64 m2 by sheet, and the factor on them in this pass, 0 without
    photons: rays of final gathers that end nearer to their start than the radius of such a disk do not recall.

    The light there changes within the disk, as what they start from stands beside it: in corners. So they go on, once,
    and the next end recalls, where the same blur counts less (Jensen 2001). Caustics, which no ray finds, they ask of
    the photons where they are.
    """
    return (estimate.splitting.sheets.disk, estimate.shrink2) if estimate.photons else (np.empty(0), 0.0)


def meet(
    surfaces, radiometry, emitters, lamps, straight, disks, bounce, triangle, u, v, rays, near, closeness, image
):  # fmt: skip
    """Add to the image what the surfaces that the rays meet emit; return the rays that gather what they reflect.

    Rays of a pixel that meet one sheet of one material, with throughputs in one proportion, share a gather. Roulette
    decides on those that would carry little. Rays of final gathers leave lamps to shadow rays. straight: see Estimate.
    disks: see near_disks. near: (n,) bool, set for rays that end too near to recall. closeness: see share.
    """
    gathers, bands = empty_gathers(len(triangle)), radiometry.reference.size
    kept = _meet(
        surfaces, radiometry, emitters, lamps, straight, *disks, bounce, triangle, u, v, rays, near, closeness, image,
        gathers, _empty_excesses(bands), np.empty(bands), np.empty(len(triangle), np.int32),
    )  # fmt: skip
    return first_gathers(gathers, kept)


@njit(**FAST_KERNEL)
def _meet(
    surfaces, radiometry, emitters, lamps, straight, disk, shrink2, bounce, triangle, u, v, rays, near, closeness,
    image, gathers, excesses, emitted, place,
):  # fmt: skip
    shadowed = lamps.power > 0.0 or straight
    surroundings, sky = emitters.surroundings, emitters.sky_layer * emitters.surroundings.size
    bands = radiometry.reference.size
    found = newest = 0
    pixel = -1
    for i in range(triangle.size):
        if rays.pixel[i] != pixel:
            pixel, newest = rays.pixel[i], found
        t = triangle[i]
        if t < 0:
            for b in range(bands):
                image[pixel, sky + b] += rays.throughput[i, b] * surroundings[b]
            continue
        material = surfaces.material[t]
        side = facing_side(surfaces, t, rays.direction, i)
        if rays.gathered[i] and not rays.again[i]:
            inverse = inverse_distance(surfaces, t, u[i], v[i], rays.origin[i])
            closeness[pixel] += inverse
            near[i] = shrink2 > 0.0 and inverse * inverse * disk[surfaces.sheet[t, side]] * shrink2 > math.pi
        rough = radiometry.alpha[material] > 0.0
        if not (rays.gathered[i] and lamps.shines[t, side]):
            kelvin = temperature_at(surfaces.temperature, t, u[i], v[i])
            slot = (material + int(_PER_KELVIN * kelvin)) % _EXCESSES
            if rough or material != excesses.material[slot] or kelvin != excesses.kelvin[slot]:
                cosine = _hit(surfaces, rays, i, t, u[i], v[i]).cosine if rough else 1.0
                excess(radiometry, material, kelvin, cosine, emitted)
                excesses.material[slot], excesses.kelvin[slot] = -1 if rough else material, kelvin
                for b in range(bands):
                    excesses.radiance[slot, b] = emitted[b]
            first = bands * layer_of(surfaces.layer, t)
            for b in range(bands):
                image[pixel, first + b] += rays.throughput[i, b] * excesses.radiance[slot, b]
        if radiometry.stores[material] == NONE:
            continue
        asks_sky = emitters.open[t, side] and not near[i]
        if rays.gathered[i] and not (shadowed or asks_sky):  # what it reflects is recalled, or another ray brings it
            continue
        carried = largest_throughput(rays.throughput[i], radiometry.reflectance[material])
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
                and near[other] == near[i]
                and (bounce == 0 or _in_proportion(rays.throughput[i], rays.throughput[other]))
            ):
                break
            g += 1
        if g == found:
            gathers.carried[g] = 0.0
            found += 1
        # each ray of a group stands for it with a chance in proportion to what it carries: the mean is that of a gather
        # for every ray
        gathers.of[i] = g
        gathers.carried[g] += carried
        if uniform(rays.path[i], _DIMENSIONS * bounce + 3) * gathers.carried[g] < carried:
            gathers.ray[g] = i
    kept = 0
    for g in range(found):
        i, place[g] = gathers.ray[g], -1
        chance = min(1.0, gathers.carried[g] / _LITTLE)
        if uniform(rays.path[i], _GATHERING + bounce) < chance:
            carried = largest_throughput(rays.throughput[i], radiometry.reflectance[surfaces.material[triangle[i]]])
            gathers.ray[kept], gathers.weight[kept] = i, gathers.carried[g] / (carried * chance)
            gathers.carried[kept], place[g] = gathers.carried[g], kept
            kept += 1
    for i in range(triangle.size):
        if gathers.of[i] >= 0:
            gathers.of[i] = place[gathers.of[i]]
    return kept


@njit(inline="always")
def _in_proportion(a, b):
    """Whether two throughputs differ by a factor alone, but for float32's rounding on the way."""
    largest = 0
    for band in range(a.size):
        largest = band if a[band] > a[largest] else largest
    for band in range(a.size):
        if abs(a[band] * b[largest] - b[band] * a[largest]) > np.float32(1e-5) * a[largest] * b[largest]:
            return False
    return True


@njit(**KERNEL)
def locate_gathers(surfaces, bounce, triangle, u, v, rays, gathers, place, code, turns):
    """Where gathers are, place (n, 3) and code (n,), and where their feelers start, turns (n,): see free_space."""
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        place[g, 0], place[g, 1], place[g, 2] = point(surfaces.corners, triangle[i], u[i], v[i])
        code[g] = 2 * triangle[i] + facing_side(surfaces, triangle[i], rays.direction, i)
        turns[g] = uniform(rays.path[i], _FEELING + bounce)


def asking_photons(rays, gathers, photon_map, estimate):
    """Indices of the gathers that may ask photons, so that the free space around them has to be known.

    Walls raise the variance of photons at least as much as that of rays: what sends rays in the open does so beside
    them, too, and asks for caustics at most.
    """
    caustics, ends = len(photon_map.photons.caustic) > 0, rays.gathered[gathers.ray]
    return np.flatnonzero(estimate.straight | (~ends & (caustics | (gathers.rays == 0))))


def reflect(surfaces, radiometry, photon_map, estimate, ends, triangle, u, v, rays, gathers, space, image):
    """Add to the image what the photons around the gathers reflect.

    ends: whether those count that are ends of final gathers, which recall their irradiance if they can, or the others.
    space: around the gathers.
    """
    _reflect(
        surfaces, radiometry, photon_map, estimate, ends, triangle, u, v, rays, gathers, space, image,
        neighbours_room(estimate.neighbours), np.empty(PATCH_LIMIT, np.int32), np.empty(image.shape[1]),
    )  # fmt: skip


@njit(**FAST_KERNEL)
def _reflect(
    surfaces, radiometry, photon_map, estimate, ends, triangle, u, v, rays, gathers, space, image, room, patch, value
):  # fmt: skip
    guess = estimate.reach2
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        split = gathers.rays[g] > 0
        if split and photon_map.photons.caustic.size == 0:
            continue
        hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
        material = surfaces.material[hit.triangle]
        specular = float(radiometry.specular[material])
        rough = specular > 0.0 and radiometry.alpha[material] > 0.0 and estimate.straight and not ends
        is_diffuse = specular < 1.0 and rays.gathered[i] == ends
        if not (is_diffuse or rough):
            continue
        reach2 = largest_disk(space.radius2[g], estimate)
        kept, area, guess = gather(
            photon_map, surfaces, hit.triangle, hit.side, hit.x, hit.y, hit.z, space.wall[g],
            estimate.neighbours, reach2, estimate.shrink2, split, guess, room, patch,
        )  # fmt: skip
        if kept == 0:
            continue
        rho, out = radiometry.reflectance[material], image[rays.pixel[i]]
        if is_diffuse:
            irradiance(photon_map, room, kept, area, value)
            diffuse = gathers.weight[g] * (1.0 - specular) / math.pi
            for layer in range(estimate.layers):
                first = layer * rho.size
                for b in range(rho.size):
                    out[first + b] += rays.throughput[i, b] * rho[b] * diffuse * value[first + b]
        if rough:
            alpha, scale = float(radiometry.alpha[material]), gathers.weight[g] * specular / area
            _add_straight(photon_map, room, kept, scale, alpha, hit, rays.throughput[i], rho, out)


def recall(surfaces, radiometry, cache, estimate, bounce, triangle, u, v, rays, near, again, image):
    """Add to the image what the ends of final gathers reflect, of the irradiance in the cache.

    near: see meet. again: (n,) float32, set to the factor on the throughput of those of them that go on.
    Returns those that have to ask photons, as gathers: ends far from the cache's points, where there are few photons to
    count, and those that go on, for caustics alone, as rays bring the rest.
    """
    lost = empty_gathers(len(triangle))
    found = _recall(
        surfaces, radiometry, cache, estimate, bounce, triangle, u, v, rays, near, again, image, lost.ray, lost.weight,
        lost.rays, empty_walk(),
    )  # fmt: skip
    return first_gathers(lost, found)


@njit(**FAST_KERNEL)
def _recall(
    surfaces, radiometry, cache, estimate, bounce, triangle, u, v, rays, near, again, image, lost, weight, sent,
    walk,
):  # fmt: skip
    found = 0
    for i in range(triangle.size):
        t = triangle[i]
        if t < 0 or not rays.gathered[i]:
            continue
        material = surfaces.material[t]
        rho = radiometry.reflectance[material]
        carried = (1.0 - float(radiometry.specular[material])) * largest_throughput(rays.throughput[i], rho)
        if carried == 0.0:
            continue
        side = facing_side(surfaces, t, rays.direction, i)
        sheet = surfaces.sheet[t, side]
        chance, choice = recall_chance(estimate.splitting, sheet, carried), uniform(rays.path[i], _RECALLING + bounce)
        if choice >= chance:
            continue
        if near[i]:
            again[i] = 1.0 / chance
            lost[found], weight[found], sent[found] = i, 1.0 / chance, 1
            found += 1
            continue
        x, y, z = point(surfaces.corners, t, u[i], v[i])
        nx, ny, nz = unit_normal(surfaces, t, side)
        known = recalled(cache, sheet, x, y, z, nx, ny, nz, _FAR * estimate.shrink2 * estimate.reach2, walk)
        out = image[rays.pixel[i]]
        if known >= 0:
            scale = np.float32((1.0 - radiometry.specular[material]) / (math.pi * chance))
            for layer in range(estimate.layers):
                first = layer * rho.size
                for b in range(rho.size):
                    out[first + b] += rays.throughput[i, b] * rho[b] * (scale * cache.value[known, first + b])
            continue
        chance = gather_chance(estimate.splitting, sheet, carried)
        if choice >= chance:
            continue
        lost[found], weight[found] = i, 1.0 / chance
        found += 1
    return found


def send_shadows(
    surfaces, radiometry, emitters, lamps, lamp_points, bounce, triangle, u, v, rays, gathers, near, shadows
):  # fmt: skip
    """Shadow rays of the gathers, to lamps and, from open sides, to the surroundings; returns their number."""
    return _send_shadows(
        surfaces, radiometry, emitters, lamps, lamp_points, bounce, triangle, u, v, rays, gathers, near, shadows,
        np.empty(CANDIDATES), np.empty(radiometry.reference.size),
    )  # fmt: skip


@njit(**FAST_KERNEL)
def _send_shadows(
    surfaces, radiometry, emitters, lamps, lamp_points, bounce, triangle, u, v, rays, gathers, near, shadows, weight,
    value,
):  # fmt: skip
    sky = False
    for b in range(value.size):
        sky |= emitters.surroundings[b] != 0.0
    sent = 0
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
        if sky and emitters.open[hit.triangle, hit.side] and gathers.rays[g] == 0 and not near[i]:
            send_sky(
                surfaces, radiometry, emitters, hit, rays.throughput[i], gathers.weight[g], rays.path[i],
                _LAMPS + 16 * bounce + 2, rays.pixel[i], shadows, sent,
            )  # fmt: skip
            sent += SKY_RAYS
        if lamps.power > 0.0:
            sent += send_shadow(
                lamps, lamp_points, surfaces, radiometry, hit, rays.throughput[i], gathers.weight[g], rays.path[i],
                _LAMPS + 16 * bounce, weight, value, rays.pixel[i], shadows, sent,
            )  # fmt: skip
    return sent


def follow(surfaces, radiometry, bounce, triangle, u, v, rays, samples, gathers, again, onward):
    """Send on the rays that meet a specular surface, those of final gathers, and those that go on (see recall); returns
    their number. samples: (pixels,), camera rays of each."""
    shares = np.zeros(len(gathers.ray))  # of the rays of a final gather that those before had, of all groups
    first = np.empty(len(gathers.ray), np.int64)  # of the rays of each
    return _follow(surfaces, radiometry, bounce, triangle, u, v, rays, samples, gathers, again, onward, shares, first)


@njit(**FAST_KERNEL)
def _follow(surfaces, radiometry, bounce, triangle, u, v, rays, samples, gathers, again, onward, shares, first):
    sent = 0
    for i in range(triangle.size):
        if triangle[i] >= 0 and radiometry.specular[surfaces.material[triangle[i]]] > 0.0:
            hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
            # of a final gather each ray carries little, so what counts is what the mirror leaves of that
            full = _largest(rays.throughput[i]) if rays.gathered[i] else _WEAK / samples[rays.pixel[i]]
            sent += _mirror(surfaces, radiometry, hit, bounce, i, full, rays, sent, onward)
        if again[i] > 0.0:
            hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
            _go_on(surfaces, radiometry, hit, bounce, i, again[i], rays, sent, onward)
            sent += 1
    for g in range(first.size):  # those of a gather lie one behind the other, whichever rays of its group send them
        first[g] = sent
        sent += gathers.rays[g]
    for i in range(triangle.size):
        g = gathers.of[i]
        if g >= 0 and gathers.rays[g] > 0:
            hit = _hit(surfaces, rays, i, triangle[i], u[i], v[i])
            material, before = surfaces.material[hit.triangle], shares[g]
            shares[g] += largest_throughput(rays.throughput[i], radiometry.reflectance[material])
            leader, total = gathers.ray[g], gathers.carried[g]
            _split(
                surfaces, hit, gathers.brought[g], gathers.rays[g], before / total, shares[g] / total, gathers.row[g],
                path_key(rays.path[leader], _SPLITTING + bounce), first[g], onward,
            )  # fmt: skip
    return sent


@njit(inline="always")
def _split(surfaces, hit, carried, count, before, after, row, path, first, onward):
    """Send a ray's share of the `count` rays of a final gather, cosine-distributed, as those from `first` on.

    carried: by all of them together. before, after: share of all rays that fall to rays before this one, without and
    with it, in [0, 1]: each gets those between, by a random start for all (systematic resampling). The directions of
    all are points of one lattice, and those of a ray points that follow one another. They add to a row.
    """
    start, shift_u, shift_v = uniform(path, 0), uniform(path, 1), uniform(path, 2)
    for ray in range(_resampled(before, count, start), _resampled(after, count, start)):
        u, v = lattice_point(ray, count, shift_u, shift_v)
        lx, ly, lz = cosine_direction(u, v)
        dx, dy, dz = to_world(lx, ly, lz, hit.nx, hit.ny, hit.nz)
        _leave(surfaces, hit, dx, dy, dz, row, path_key(path, 3 + ray), first + ray, onward)
        onward.gathered[first + ray], onward.again[first + ray] = True, False
        onward.throughput[first + ray, :] = np.float32(carried / count)


@njit(inline="always")
def _resampled(share, count, start):
    """How many of `count` fall to a share, start in [0, 1); all fall to all of it, whatever sums of shares round to."""
    return min(count, int(share * count + start)) if share < 1.0 - 1e-9 else count


@njit(inline="always")
def _leave(surfaces, hit, dx, dy, dz, pixel, path, row, onward):
    put_ray(
        surfaces, hit.triangle, hit.x, hit.y, hit.z, hit.nx, hit.ny, hit.nz, dx, dy, dz,
        onward.origin, onward.direction, row,
    )  # fmt: skip
    onward.pixel[row], onward.path[row] = pixel, path


@njit(inline="always")
def _go_on(surfaces, radiometry, hit, bounce, i, factor, rays, sent, onward):
    """Send ray i of a final gather on in one diffuse direction, as ray `sent`. factor: on its throughput."""
    material, path = surfaces.material[hit.triangle], path_key(rays.path[i], _AGAIN + bounce)
    lx, ly, lz = cosine_direction(uniform(path, 0), uniform(path, 1))
    dx, dy, dz = to_world(lx, ly, lz, hit.nx, hit.ny, hit.nz)
    _leave(surfaces, hit, dx, dy, dz, rays.pixel[i], path, sent, onward)
    onward.gathered[sent] = onward.again[sent] = True
    diffuse = np.float32((1.0 - radiometry.specular[material]) * factor)
    for b in range(rays.throughput.shape[1]):
        onward.throughput[sent, b] = rays.throughput[i, b] * radiometry.reflectance[material, b] * diffuse


@njit(inline="always")
def _largest(throughput):
    largest = np.float32(0.0)
    for b in range(throughput.size):
        largest = max(largest, throughput[b])
    return float(largest)


@njit(inline="always")
def _mirror(surfaces, radiometry, hit, bounce, i, full, rays, sent, onward):
    """Send ray i on in one direction of the specular lobe, as ray `sent`; returns whether roulette let it live, which
    but after many bounces it does for sure if as much is left as `full`."""
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
    left = scale * largest_throughput(rays.throughput[i], rho)
    survival = min(MAX_SURVIVAL if bounce >= _SURE else 1.0, left / full)
    if left <= 0.0 or uniform(path, _DIMENSIONS * bounce + 2) >= survival:
        return 0
    _leave(surfaces, hit, ox, oy, oz, rays.pixel[i], path, sent, onward)
    onward.gathered[sent], onward.again[sent] = rays.gathered[i], rays.again[i]
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
            for b in range(rho.size):  # lights add to the first layer
                out[b] += throughput[b] * rho[b] * f * photons.power[photon, b]
