# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflection: gathers ask the photons around them, ends of final gathers recall irradiance from the cache, and shadow
rays find the direct light of lamps, lights and surroundings."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.free_space import FreeSpace, largest_disk, wall_of
from ..geometry.interaction import interact
from ..geometry.point_tree import empty_walk
from ..geometry.stage import diffuse_reflectance_at, leave_out, lobe_reflectance_at, lobes_at
from ..geometry.surfaces import sheet_of, unit_normal
from ..photons.irradiance_cache import recalled
from ..photons.photon_map import Disk, gather, irradiance, neighbours_room, query_at
from ..physics.lobes import (
    DIFFUSE,
    diffuse_share,
    evaluate_diffuse,
    evaluate_glossy,
    follows_fresnel,
    is_glossy,
)
from ..planning.pilot import SKY_RAYS
from ..planning.splitting import recall_chance
from ..sampling.heuristics import CANDIDATES, SINGLE_RAY, Looking, looking_from
from ..sampling.rng import uniform
from ..sampling.vectors import dot, vector
from ..system.kernels import FAST_KERNEL, njit
from .gathers import Gathers, empty_gathers, first_gathers
from .rays import largest_throughput, shares_by_lobe
from .shadow_rays import LampRoom, Receiver, Shadows, empty_shadows, send_shadow, send_sky
from .streams import LAMP_NUMBERS, LAMPS, RECALLING

_SURE, _LATE_SURVIVAL = 8, 15.0 / 16.0  # after so many bounces a path survives with at most this chance
_GRAZING = 0.01  # least cosine of a photon in a rough lobe over a diffuse one, as next to nothing of it gets below
_FAR = 4.0  # largest squared distance to a cached point that is recalled, over the squared radius of the largest disk


class Asking(NamedTuple):
    """Gathers that ask the photons around them. space: the free space around each. are_ends: whether to answer diffuse
    reflection for gathers at the ends of final gathers alone, or else for all other gathers alone."""

    gathers: Gathers
    space: FreeSpace
    are_ends: bool


def reflect(stage, photon_map, estimate, bounce, asking, image) -> None:
    """Add to the image what the photons around gathers reflect. asking: see Asking."""
    if len(asking.gathers.ray) == 0:  # as often late in a tile, and a call of a kernel with so many arrays takes long
        return
    bands = stage.radiometry.reference.size
    rooms = neighbours_room(estimate.neighbours), np.empty(image.shape[1]), np.empty(bands, np.float32)
    _reflect(stage, photon_map, estimate, bounce, asking, image, rooms)


@njit(**FAST_KERNEL)
def _reflect(stage, photon_map, estimate, bounce, asking, image, rooms):
    (room, value, row), guess, (gathers, space, are_ends) = rooms, estimate.reach2, asking
    rays, photons = bounce.rays, photon_map.photons
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        only_caustic = gathers.rays[g] > 0  # the rays of the gather find all other light
        if only_caustic and photons.caustic.size == 0:
            continue
        at = interact(stage.surfaces, bounce.hits, i, rays.direction)
        lobes, rho, out = lobes_at(stage, at), diffuse_reflectance_at(stage, at, row), image[rays.pixel[i]]
        by_lobe = is_glossy(lobes) and estimate.straight and not rays.final[i]
        is_diffuse = lobes.flags & DIFFUSE != 0 and rays.final[i] == are_ends
        if not (is_diffuse or by_lobe):
            continue
        k = estimate.few if only_caustic else estimate.neighbours
        reach2 = largest_disk(space.radius2[g], estimate) * (k / estimate.neighbours)
        disk = Disk(k, reach2, estimate.shrink2, wall_of(space, g), only_caustic)
        kept, area, guess = gather(photon_map, stage.surfaces, at.side_id, at.point, disk, guess, room)
        if kept == 0:
            continue
        if is_diffuse:
            irradiance(photon_map, room, kept, area, value)
            scale = gathers.weight[g] * diffuse_share(lobes) / math.pi
            for layer in range(estimate.layers):
                first = layer * rho.size
                for b in range(rho.size):
                    out[first + b] += rays.throughput[i, b] * rho[b] * scale * value[first + b]
        if by_lobe:
            scale = gathers.weight[g] * lobes.specular / area
            _add_straight(stage, photons, room.index[:kept], at, scale, rays.throughput[i], (out, row))


@njit(inline="always")
def _add_straight(stage, photons, index, at, scale, throughput, rooms):
    """Add the reflection, in a rough lobe, of photons straight from lights, as no camera path can hit a light. Photons
    were stored with what they are worth to a diffuse lobe (see evaluate_diffuse): here they count as they are."""
    lobes, (out, room) = lobes_at(stage, at), rooms
    for j in range(index.size):
        photon = index[j]
        towards = vector(photons.incoming, photon)
        if dot(towards, at.normal) > 0.0:
            f = evaluate_glossy(lobes, at, towards) * scale / max(evaluate_diffuse(at, towards), 1e-3)
            rho = lobe_reflectance_at(stage, at, lobes, towards, room)
            if follows_fresnel(lobes):  # the photon's power is what gets below the lobe
                normal = unit_normal(stage.surfaces, photons.surface[photon])
                leave_out(stage, at, max(_GRAZING, dot(towards, normal)), rho)
            for b in range(rho.size):  # lights add to the first layer
                out[b] += throughput[b] * rho[b] * f * photons.power[photon, b]


def recall(stage, is_open, cache, estimate, bounce, image) -> Gathers:
    """Add to the image what the ends of final gathers reflect, with the irradiance in the cache where it resolves the
    light.

    It does not where no cached point lies near on this side of all walls, or where the disk of the nearest point is not
    small against the distance to what is around it. Rays that end there are continued, in one direction of the diffuse
    lobe: sets bounce.unresolved and bounce.goes_on. Returns gathers for the ends of continued rays, which ask photons
    for caustics alone, as the continued ray finds all other light. is_open: see Surroundings.
    """
    continued = empty_gathers(len(bounce.hits.triangle))
    rooms = empty_walk(), np.empty(stage.radiometry.reference.size, np.float32)
    return first_gathers(continued, _recall(stage, is_open, cache, estimate, bounce, image, continued, rooms))


@njit(**FAST_KERNEL)
def _recall(stage, is_open, cache, estimate, bounce, image, continued, rooms):
    rays, splitting, found, (walk, room) = bounce.rays, estimate.splitting, np.int64(0), rooms
    for i in range(bounce.hits.triangle.size):
        if bounce.hits.triangle[i] < 0 or not rays.final[i]:
            continue
        at = interact(stage.surfaces, bounce.hits, i, rays.direction)
        rho, diffuse = diffuse_reflectance_at(stage, at, room), diffuse_share(lobes_at(stage, at))
        reflected = diffuse * largest_throughput(rays.throughput[i], rho)
        if reflected == 0.0:
            continue
        sheet = sheet_of(stage.surfaces, at.side_id)
        chance = min(recall_chance(splitting, sheet, reflected), 1.0 if bounce.number < _SURE else _LATE_SURVIVAL)
        survives = uniform(rays.path[i], RECALLING + bounce.number) < chance
        if not survives and not is_open[sheet]:
            continue
        query = query_at(stage.surfaces, at.side_id, at.point)
        known = recalled(cache, query, _FAR * estimate.shrink2 * estimate.reach2, walk)
        bounce.unresolved[i] = known < 0 or rays.doubts[i]
        if not survives:
            continue
        if bounce.unresolved[i]:
            bounce.goes_on[i] = 1.0 / chance
            continued.ray[found], continued.weight[found], continued.rays[found] = i, 1.0 / chance, 1
            found += 1
            continue
        out, scale = image[rays.pixel[i]], np.float32(diffuse / (math.pi * chance))
        for layer in range(estimate.layers):
            first = layer * rho.size
            for b in range(rho.size):
                out[first + b] += rays.throughput[i, b] * rho[b] * (scale * cache.value[known, first + b])
    return found


def shadow_rays(stage, lighting, bounce, samples, gathers) -> Shadows:
    """The shadow rays of the gathers, to lamps and lights and, from open sides, to the surroundings.

    samples: (pixels,), camera rays of each pixel. Where rays meet a rough surface, each sends a ray of its own in the
    lobe, and shares the light of lamps with the one shadow ray of the gather.
    """
    bands = stage.radiometry.reference.size
    if len(gathers.ray) == 0:
        return empty_shadows(0, bands)
    shadows = empty_shadows((1 + SKY_RAYS) * len(gathers.ray), bands)
    room = LampRoom(np.empty(CANDIDATES), np.empty(bands)), np.empty(bands, np.float32)
    sent = _send_shadows(stage, lighting, bounce, samples, gathers, shadows, room)
    return Shadows(*(column[:sent] for column in shadows))


@njit(**FAST_KERNEL)
def _send_shadows(stage, lighting, bounce, samples, gathers, shadows, rooms):
    room, row = rooms
    surroundings, rays, sky = lighting.surroundings, bounce.rays, lighting.surroundings.sky.size > 0
    for b in range(surroundings.radiance.size):
        sky |= surroundings.radiance[b] != 0.0
    sent, lit = np.int64(0), lighting.points.side_id.size > 0
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        at = interact(stage.surfaces, bounce.hits, i, rays.direction)
        label = sheet_of(stage.surfaces, at.side_id)
        lobes, dimension = lobes_at(stage, at), LAMPS + LAMP_NUMBERS * bounce.number
        in_lobe, lobe_weight = SINGLE_RAY if shares_by_lobe(lobes, rays.final[i]) else 0.0, 1.0
        if rays.final[i]:
            single = SINGLE_RAY if bounce.goes_on[i] > 0.0 else 0.0
            looking = Looking(0.0, single, single)
            if bounce.goes_on[i] > 0.0:  # the gather's weight makes up for roulette, which plays for the diffuse lobe
                lobe_weight = 1.0 / bounce.goes_on[i]
        else:
            looking = looking_from(lighting.looking, label)
            in_lobe *= samples[rays.pixel[i]]
        receiver = Receiver(
            at, lobes, diffuse_reflectance_at(stage, at, row), looking, (in_lobe, lobe_weight), rays.throughput[i],
            gathers.weight[g], rays.path[i], dimension, rays.pixel[i],
        )  # fmt: skip
        if sky and surroundings.open[label] and gathers.rays[g] == 0 and not bounce.unresolved[i]:
            send_sky(lighting, stage, receiver, room, shadows, sent)
            sent += SKY_RAYS
        if lit and (looking.together > 0.0 or receiver.in_lobe[0] > 0.0):
            sent += send_shadow(lighting, stage, receiver, room, shadows, sent)
    return sent
