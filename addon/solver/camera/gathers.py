# SPDX-License-Identifier: GPL-3.0-or-later
"""Gathers: where camera paths meet surfaces. The surfaces' emission is added to the image, and rays that can be
answered together are grouped into one gather, which asks for the light that is reflected."""

from typing import NamedTuple

import numpy as np

from ..geometry.interaction import interact
from ..geometry.stage import asked_at, emission_at, layer_at, lobes_at, nothing_emitted, reflectance_at
from ..geometry.surfaces import sheet_of
from ..physics.lobes import follows_fresnel
from ..physics.radiometry import NONE
from ..physics.sky import radiance_from
from ..planning.lamps import share_of_ray, share_of_sky
from ..sampling.heuristics import ALONE, shared_part
from ..sampling.rng import uniform
from ..sampling.vectors import put_vector, vector
from ..system.kernels import FAST_KERNEL, KERNEL, njit
from .rays import BLIND, largest_throughput, shares_by_lobe
from .streams import DIMENSIONS, FEELING, GROUPING, PARTING

# Largest relative difference of the cosines of rays that share a gather, where Fresnel's law holds: what they reflect
# then differs by about as much.
_TURNED = 0.1


class Gathers(NamedTuple):
    """n gathers, each for a group of rays.

    ray: (n,) int64, index of the ray that stands for the group where photons are asked. weight: (n,) float32, factor on
    the throughput of that ray. throughput: (n,) float64, of all rays of the group together, after the reflection.
    contribution: (n,) float64, share of the pixel that the group's diffuse reflection makes up, times the pixel's
    sensitivity (see Survey). rays: (n,) int32, how many rays a final gather sends from the points of all rays of the
    group, a power of two; 0 where the gather asks photons. radius2: (n,) float64, m2, squared radius of the disk within
    which final gathers share rays. is_cut: (n,) bool, whether a rim cuts this disk. row: (n,) int32, row of the image
    to which the rays of a final gather add. of: (camera rays,) int32, index of a ray's gather, or -1.
    """

    ray: np.ndarray
    weight: np.ndarray
    throughput: np.ndarray
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
    """The first `count` gathers."""
    return Gathers(*(column[:count] for column in gathers[:-1]), gathers.of)


@njit(**KERNEL)
def part_near(bounce, rows):
    """Add up the closeness of what rays of final gathers meet, and give rays that meet something near to a row of their
    own, see Rows: all or some of them, in the mean as much as is not shared."""
    rays, hits = bounce.rays, bounce.hits
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0 or not rays.final[i] or rays.continued[i]:
            continue
        row, distance = rays.pixel[i], max(hits.distance[i], np.float32(1e-15))
        if rays.passed.size:
            distance += rays.passed[i]
        rows.closeness[row] += 1.0 / distance
        if 0.0 <= rays.density[i] < ALONE:  # negative after a medium has scattered the ray
            shared = shared_part(float(rows.near[row]), float(distance))
            rays.density[i] *= rows.fewer[row] + shared * (1.0 - rows.fewer[row])
            if uniform(rays.path[i], PARTING + bounce.number) >= shared:
                rays.pixel[i] = row + rows.apart[row]


def meet(stage, lighting, bounce, rows, steady) -> Gathers:
    """Add to the rows what surfaces emit where rays meet them; return the gathers that ask for the reflected light.
    What steady rays meet is added to an image (pixels, layers * b) float32 of its own.

    Rays of a pixel that meet the same sheet and material, with throughputs in the same proportion of bands, share a
    gather. What rays meet counts as far as it is not left to shadow rays, or to photons of caustics.
    """
    count = len(bounce.hits.triangle)
    gathers, emitted = empty_gathers(count), nothing_emitted(stage.radiometry.reference.size)
    bands = stage.radiometry.reference.size
    rooms = np.empty(bands, np.float32), np.empty(bands)
    found = _meet(stage, lighting, bounce, (rows.image, steady), gathers, emitted, rooms)
    return first_gathers(gathers, found)


@njit(**FAST_KERNEL)
def _meet(stage, lighting, bounce, images, gathers, emitted, rooms):
    (room, from_sky), (image, steady) = rooms, images
    hits, rays, surroundings, lamps = bounce.hits, bounce.rays, lighting.surroundings, lighting.lamps
    sky, bands = surroundings.layer * surroundings.radiance.size, surroundings.radiance.size
    found = newest = np.int64(0)  # no literal, see kernels
    pixel = -1
    for i in range(hits.triangle.size):
        if rays.pixel[i] != pixel:
            pixel, newest = rays.pixel[i], found
        throughput, out = rays.throughput[i], steady[pixel] if rays.steady[i] else image[pixel]
        if hits.triangle[i] < 0:
            way = vector(rays.direction, i)
            around, share = radiance_from(surroundings, way, from_sky), np.float32(1.0)
            if rays.density[i] < ALONE:
                share = np.float32(share_of_sky(abs(rays.density[i]), lamps, surroundings, way))
            for b in range(bands):
                out[sky + b] += throughput[b] * (share * around[b])
            continue
        at = interact(stage.surfaces, hits, i, rays.direction)
        label, share = sheet_of(stage.surfaces, at.side_id), np.float32(1.0)
        if rays.density[i] < ALONE:
            share = np.float32(share_of_ray(abs(rays.density[i]), lamps, stage.surfaces, at))
        elif rays.density[i] == BLIND and lamps.caustic[label]:
            share = np.float32(0.0)
        if share > 0.0:
            radiance, first = emission_at(stage, at, emitted), bands * layer_at(stage, at)
            for b in range(bands):
                out[first + b] += throughput[b] * (share * radiance[b])
        if asked_at(stage, at) == NONE:
            continue
        asks_sky = surroundings.open[label] and not bounce.unresolved[i]
        if rays.final[i] and not (bounce.goes_on[i] > 0.0 or asks_sky or shares_by_lobe(lobes_at(stage, at), True)):
            continue  # the reflected light is recalled from the cache, or roulette has ended the path
        alone = reflected = largest_throughput(throughput, reflectance_at(stage, at, room))
        if bounce.goes_on[i] > 0.0:
            reflected *= bounce.goes_on[i]
        if reflected == 0.0:
            continue
        g = newest
        while g < found and not _is_alike(stage, bounce, at, i, gathers.ray[g]):
            g += 1
        if g == found:
            gathers.throughput[g] = 0.0
            found += 1
        # each ray of a group may stand for the group, with a chance in proportion to its throughput: the mean is then
        # the same as with a gather for every ray
        gathers.of[i] = g
        gathers.throughput[g] += reflected
        if uniform(rays.path[i], DIMENSIONS * bounce.number + GROUPING) * gathers.throughput[g] < reflected:
            gathers.ray[g], gathers.weight[g] = i, alone
    for g in range(found):
        gathers.weight[g] = gathers.throughput[g] / gathers.weight[g]
    return found


@njit(inline="always")
def _is_alike(stage, bounce, at, i, other):
    """Whether ray i, which met `at`, can share the gather of another ray: same sheet, material, kind and colour."""
    rays, there = bounce.rays, interact(stage.surfaces, bounce.hits, other, bounce.rays.direction)
    return (
        sheet_of(stage.surfaces, there.side_id) == sheet_of(stage.surfaces, at.side_id)
        and there.material == at.material
        and rays.final[other] == rays.final[i]
        and bounce.unresolved[other] == bounce.unresolved[i]
        and (bounce.number == 0 or _in_proportion(rays.throughput[i], rays.throughput[other]))
        and (not follows_fresnel(lobes_at(stage, at)) or abs(there.cosine - at.cosine) < _TURNED * at.cosine)
    )


@njit(inline="always")
def _in_proportion(a, b):
    """Whether two throughputs (b,) differ by no more than a common factor and the rounding of float32."""
    largest = 0
    for band in range(a.size):
        largest = band if a[band] > a[largest] else largest
    for band in range(a.size):
        if abs(a[band] * b[largest] - b[band] * a[largest]) > np.float32(1e-5) * a[largest] * b[largest]:
            return False
    return True


class GatherPoints(NamedTuple):
    """Where gathers are. point: (n, 3) float64, m. side_id: (n,) int32. turns: (n,) float64, angle, in turns, of the
    first feeler around the point, see free_space."""

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
    """Indices of the gathers that ask photons, so that the free space around them has to be known: those that send rays
    ask for caustics alone, ends of final gathers for nothing here."""
    caustics, ends = len(photon_map.photons.caustic) > 0, bounce.rays.final[gathers.ray]
    return np.flatnonzero(~ends & (estimate.straight | caustics | (gathers.rays == 0)))
