# SPDX-License-Identifier: GPL-3.0-or-later
"""Where camera paths meet surfaces: what these emit is added to the image, and rays are grouped into gathers, which ask
for what is reflected."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import interact
from ..geometry.segments import glow, transmit
from ..geometry.stage import emission_at, layer_at, nothing_emitted, reflectance_at, stored_at
from ..geometry.surfaces import sheet_of
from ..physics.radiometry import NONE
from ..sampling.rng import uniform
from ..sampling.vectors import put_vector
from ..system.kernels import FAST_KERNEL, KERNEL, njit
from .rays import largest_throughput
from .streams import DIMENSIONS, FEELING, GATHERING, GROUPING

_LITTLE = 1.0 / 32.0  # of a pixel: roulette decides on gathers that carry less


class Gathers(NamedTuple):
    """Gathers, each for a group of rays: the index of the ray that stands for all where photons are asked (n,) int64,
    and a factor on its throughput, (n,) float32.

    carried: (n,) float64, throughput of all rays of the group together. contribution: (n,) float64, share of the pixel
    that their diffuse reflection makes up, times its sensitivity (see Survey). rays: (n,) int32, a power of two, how
    many a final gather sends, from the ends of all rays of the group; 0 where it asks photons. radius2: (n,) float64,
    m2, of the disk within which final gathers share rays. is_cut: (n,) bool, whether a rim cuts it. row: (n,) int32,
    the row of the image that these add to. of: (camera rays,) int32, the gather of a ray, or -1.
    """

    ray: np.ndarray
    weight: np.ndarray
    carried: np.ndarray
    contribution: np.ndarray
    rays: np.ndarray
    radius2: np.ndarray
    is_cut: np.ndarray
    row: np.ndarray
    of: np.ndarray


def empty_gathers(count: int) -> Gathers:
    """Room for the gathers of count rays."""
    return Gathers(
        np.empty(count, np.int64),
        np.empty(count, np.float32),
        np.empty(count),
        np.zeros(count),
        np.zeros(count, np.int32),
        np.zeros(count),
        np.zeros(count, np.bool_),
        np.empty(count, np.int32),
        np.full(count, -1, np.int32),
    )


def first_gathers(gathers: Gathers, count: int) -> Gathers:
    """The first so many gathers."""
    return Gathers(*(column[:count] for column in gathers[:-1]), gathers.of)


class NearDisks(NamedTuple):
    """Areas of the disks of one estimate, (sheets,) float64 m2, and the factor on them in this pass, 0 without photons:
    rays of final gathers that end nearer to their start than the radius of such a disk do not recall.

    The light there changes within the disk, as what they start from stands beside it: in corners. So they go on, once,
    and the next end recalls, where the same blur counts less (Jensen 2001). Caustics, which no ray finds, they ask of
    the photons where they are.
    """

    area: np.ndarray
    shrink2: float


def near_disks(estimate) -> NearDisks:
    """The NearDisks of an Estimate."""
    if not estimate.photons:
        return NearDisks(np.empty(0), 0.0)
    return NearDisks(estimate.splitting.sheets.disk, estimate.shrink2)


def meet(stage, lighting, disks, bounce, rows) -> Gathers:
    """Add to the rows what the surfaces that rays meet emit; return the gathers that ask for what they reflect.

    Rays of a pixel that meet one sheet of one material, with throughputs in one proportion, share a gather. Roulette
    decides on those that would carry little. Rays of final gathers leave lamps to shadow rays. disks: see NearDisks.
    """
    count = len(bounce.hits.triangle)
    gathers, emitted = empty_gathers(count), nothing_emitted(stage.radiometry.reference.size)
    kept = _meet(stage, lighting, disks, bounce, rows, gathers, emitted, np.empty(count, np.int32))
    return first_gathers(gathers, kept)


@njit(**FAST_KERNEL)
def _meet(stage, lighting, disks, bounce, rows, gathers, emitted, kept_as):
    hits, rays, surroundings, lamps = bounce.hits, bounce.rays, lighting.surroundings, lighting.lamps
    sky, bands = surroundings.layer * surroundings.radiance.size, surroundings.radiance.size
    found = newest = np.int64(0)  # no literal, see kernels
    pixel = -1
    for i in range(hits.triangle.size):
        if rays.pixel[i] != pixel:
            pixel, newest = rays.pixel[i], found
        origin, direction, throughput = rays.origin[i], rays.direction[i], rays.throughput[i]
        glow(stage, origin, direction, hits.distance[i], throughput, rows.image[pixel])
        transmit(stage, origin, direction, hits.distance[i], throughput)
        if hits.triangle[i] < 0:
            for b in range(bands):
                rows.image[pixel, sky + b] += throughput[b] * surroundings.radiance[b]
            continue
        at = interact(stage.surfaces, hits, i, rays.direction)
        side = at.side_id & 1
        if rays.final[i] and not rays.continued[i]:
            inverse = 1.0 / max(at.distance, 1e-15)
            rows.closeness[pixel] += inverse
            if disks.shrink2 > 0.0:
                area = disks.area[sheet_of(stage.surfaces, at.side_id)] * disks.shrink2
                bounce.near[i] = inverse * inverse * area > math.pi
        if not (rays.final[i] and lamps.shines[at.triangle, side]):
            radiance, first = emission_at(stage, at, emitted), bands * layer_at(stage, at)
            for b in range(bands):
                rows.image[pixel, first + b] += throughput[b] * radiance[b]
        if stored_at(stage, at) == NONE:
            continue
        asks_sky = surroundings.open[at.triangle, side] and not bounce.near[i]
        if rays.final[i] and not (lamps.power > 0.0 or asks_sky):
            continue  # what it reflects is recalled, or another ray brings it
        carried = largest_throughput(throughput, reflectance_at(stage, at))
        if carried == 0.0:
            continue
        g = newest
        while g < found and not _is_alike(stage, bounce, at, i, gathers.ray[g]):
            g += 1
        if g == found:
            gathers.carried[g] = 0.0
            found += 1
        # each ray of a group stands for it with a chance in proportion to what it carries: the mean is that of a gather
        # for every ray
        gathers.of[i] = g
        gathers.carried[g] += carried
        if uniform(rays.path[i], DIMENSIONS * bounce.number + GROUPING) * gathers.carried[g] < carried:
            gathers.ray[g] = i
    return _roulette(stage, bounce, gathers, found, kept_as)


@njit(inline="always")
def _is_alike(stage, bounce, at, i, other):
    """Whether ray i, which met `at`, can share the gather of another ray: of one sheet, material, kind and colour."""
    rays, there = bounce.rays, interact(stage.surfaces, bounce.hits, other, bounce.rays.direction)
    return (
        sheet_of(stage.surfaces, there.side_id) == sheet_of(stage.surfaces, at.side_id)
        and there.material == at.material
        and rays.final[other] == rays.final[i]
        and bounce.near[other] == bounce.near[i]
        and (bounce.number == 0 or _in_proportion(rays.throughput[i], rays.throughput[other]))
    )


@njit(**FAST_KERNEL)
def _roulette(stage, bounce, gathers, found, kept_as):
    """Keep of the gathers found those that carry much, and some of the others; returns their number."""
    rays, kept = bounce.rays, 0
    for g in range(found):
        i, kept_as[g] = gathers.ray[g], -1
        chance = min(1.0, gathers.carried[g] / _LITTLE)
        if uniform(rays.path[i], GATHERING + bounce.number) < chance:
            rho = reflectance_at(stage, interact(stage.surfaces, bounce.hits, i, rays.direction))
            carried = largest_throughput(rays.throughput[i], rho)
            gathers.ray[kept], gathers.weight[kept] = i, gathers.carried[g] / (carried * chance)
            gathers.carried[kept], kept_as[g] = gathers.carried[g], kept
            kept += 1
    for i in range(bounce.hits.triangle.size):
        if gathers.of[i] >= 0:
            gathers.of[i] = kept_as[gathers.of[i]]
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


class GatherPoints(NamedTuple):
    """Where gathers are: point (n, 3) float64, m; side_id (n,) int32; turns (n,) float64, where their feelers start to
    go round, see free_space."""

    point: np.ndarray
    side_id: np.ndarray
    turns: np.ndarray


def locate_gathers(stage, bounce, gathers) -> GatherPoints:
    """The GatherPoints of the gathers."""
    found = len(gathers.ray)
    points = GatherPoints(np.empty((found, 3)), np.empty(found, np.int32), np.empty(found))
    _locate_gathers(stage.surfaces, bounce, gathers, points)
    return points


@njit(**KERNEL)
def _locate_gathers(surfaces, bounce, gathers, points):
    for g in range(gathers.ray.size):
        at = interact(surfaces, bounce.hits, gathers.ray[g], bounce.rays.direction)
        put_vector(at.point, points.point, g)
        points.side_id[g] = at.side_id
        points.turns[g] = uniform(bounce.rays.path[gathers.ray[g]], FEELING + bounce.number)


def asking_photons(bounce, gathers, photon_map, estimate) -> np.ndarray:
    """Indices of the gathers that may ask photons, so that the free space around them has to be known.

    Walls raise the variance of photons at least as much as that of rays: what sends rays in the open does so beside
    them, too, and asks for caustics at most.
    """
    caustics, ends = len(photon_map.photons.caustic) > 0, bounce.rays.final[gathers.ray]
    return np.flatnonzero(estimate.straight | (~ends & (caustics | (gathers.rays == 0))))
