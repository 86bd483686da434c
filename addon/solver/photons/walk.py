# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons in media, between surfaces.

Photons from surfaces and lights lose what media absorb, and where media scatter they walk at random until they meet a
surface. Photons from the surroundings, and from the media themselves, are sent backwards from where they arrive: their
ray, and in media that scatter their walk, collects what media emit on the way, and at its end the surroundings. Where
shadow rays look for a sky of which a small part is bright, so do walks: where one is scattered, a shadow ray in a
direction chosen by the sky shares that light with the walk.

A sun's light has lost what the depth of the world's air takes, wherever it is met, as shadow rays to suns say. So
photons of suns lose all of it at once, and then the world's air scatters them, and takes nothing more, until they meet
something.
"""

from typing import NamedTuple

import numpy as np

from ..geometry.flight import ARRIVED, LOST, NUMBERS, walk
from ..geometry.interaction import interact, pass_on
from ..geometry.see_through import unshadowed
from ..geometry.segments import (
    ENDLESS,
    Hits,
    RayBatch,
    Tracer,
    empty_ray_batch,
    glow,
    trace_by_kind,
    transmit,
    ways,
)
from ..geometry.stage import Stage, lobes_met, shine_through
from ..physics.lobes import transmits
from ..physics.media import mean_phase, phase
from ..physics.sky import choose_direction, density_towards, radiance_from
from ..sampling.heuristics import balance
from ..sampling.rng import path_key, path_keys, uniform
from ..sampling.vectors import dot, put_vector, scaled, vector
from ..system.kernels import KERNEL, njit
from .sight import choose_lobes, kind_of
from .thrown import Throwing, leave_points
from .wave import FORWARDS, FROM_SUN, Wave

_WALKING, _COLLECTING = 1 << 20, 1 << 24  # first dimensions of a photon's random numbers in media
_PASSED = 0  # end of a walk's segment at a thin sheet: like that of one that a medium scatters, it goes on
_CHOOSING = (1 << 20) - 1  # dimension of the number that chooses what a photon brings
_SEEKING = 1 << 27  # first of two for each segment, of directions towards the sky


def fly_photons(
    tracer: Tracer,
    hits: Hits,
    wave: Wave,
    keys: tuple[np.uint64, int],
    scattered: Wave,
    thrown: Throwing | None = None,
) -> int:
    """Take from the photons of a wave what media take on their way to these hits. Those that are scattered arrive there
    without power, and go on as the first photons of `scattered`; returns how many do.

    keys: of the photons' random numbers, and number of the bounce. thrown: see trace_photons.
    """
    count = len(hits.triangle)
    from_sun = wave.arrival[:count] == FROM_SUN
    air = tracer.cross(wave.origin[:count], wave.direction[:count], ways(hits), from_sun if from_sun.any() else None)
    if thrown is not None:
        leave_points(tracer, hits, air, wave, keys, thrown)
    if tracer.scatters:
        return _walk(air, wave, keys, scattered)
    _absorb(air, wave)
    return 0


@njit(**KERNEL)
def _absorb(air, wave):
    for i in range(air.length.size):
        if wave.arrival[i] < 0:
            transmit(air, i, wave.power[i])


@njit(**KERNEL)
def _walk(air, wave, keys, scattered):
    (key, bounce), found = keys, np.int64(0)
    for i in range(air.length.size):
        if wave.arrival[i] >= 0:
            continue
        numbers, rays = (path_key(key, wave.photon[i]), _WALKING + NUMBERS * bounce), (wave.origin, wave.direction)
        out = scattered.origin, scattered.direction, found, scattered.power[found]
        end = walk(air, i, rays, wave.power[i], numbers, out)
        if end == ARRIVED:
            continue
        if end >= 0:
            scattered.photon[found], scattered.aimed[found] = wave.photon[i], 0.0
            scattered.chain[found], scattered.arrival[found] = 0, FORWARDS
            if wave.layer.size:
                scattered.layer[found] = wave.layer[i]
            found += 1
        wave.power[i, :] = np.float32(0.0)
    return found


def append(wave: Wave, count: int, more: Wave, extra: int) -> int:
    """Put the first `extra` photons of another wave behind the first `count` of this one; returns the new count."""
    for column, added in zip(wave, more, strict=True):
        if len(column):
            column[count : count + extra] = added[:extra]
    return count + extra


class _Light(NamedTuple):
    """What n walks bring, (n, b) float32 each. weight: of light that reaches their end now. of_media: what media emit.
    of_sky: of the surroundings, and straight: the part of it that no medium has scattered. Where nobody has to tell
    them apart, these are one array. turned: (n,) float64, sr-1, density with which the direction was chosen that the
    walk has since a medium scattered it; 0 before."""

    weight: np.ndarray
    of_media: np.ndarray
    of_sky: np.ndarray
    straight: np.ndarray
    turned: np.ndarray


class _Seeking(NamedTuple):
    """n shadow rays towards the sky. origin, direction: (n, 3) float32. radiance: (n, b) float32, what the walk number
    `of` (n,), int64, gets if nothing is in the way. (0,...) where nothing is sought."""

    origin: np.ndarray
    direction: np.ndarray
    radiance: np.ndarray
    of: np.ndarray


def collect(tracer: Tracer, stage: Stage, wave: Wave, key: np.uint64, surroundings) -> None:
    """Give the photons of a new wave that arrive from afar the power that they bring: those of suns what the depth of
    the world's air leaves, the others what they have times the excess radiance that reaches their origin, also through
    thin sheets. surroundings: see emission.Surroundings.

    A photon brings one kind of light where kinds count differently: with layers that of the media, which is in the
    first layer, or that of the surroundings; where shadow rays look for the sky, what comes straight from there, or the
    rest.
    """
    if tracer.hides:
        choose_lobes(wave, key)
    wave.power[wave.arrival == FROM_SUN] *= np.exp(-tracer.before_scene).astype(np.float32)
    photon, bands = np.flatnonzero(wave.arrival >= 0), len(surroundings.radiance)
    rays, count, segment = RayBatch(wave.origin[photon], wave.direction[photon]), len(photon), 0
    index, path, sought = np.arange(count), path_keys(key, wave.photon[photon]), surroundings.cells.cumulative.size > 0
    of_media = np.zeros((count, bands), np.float32)
    of_sky = np.zeros_like(of_media) if wave.layer.size or sought else of_media
    straight = np.zeros_like(of_media) if sought else of_sky
    light = _Light(np.ones_like(of_media), of_media, of_sky, straight, np.zeros(count))
    room = np.empty(bands), np.empty((2, bands), np.float32)
    while count:
        batch = RayBatch(*(column[:count] for column in rays))
        if tracer.hides:
            hits = trace_by_kind(tracer, kind_of(wave, photon[index[:count]]), batch, uncut=True)
        else:
            hits = tracer.trace_uncut(*batch)
        air = tracer.cross(*batch, ways(hits))
        numbers = index, path, (_COLLECTING + NUMBERS * segment, _SEEKING + 2 * segment)
        shadows = count if sought and tracer.scatters else 0
        seeking = _Seeking(
            *empty_ray_batch(shadows), np.empty((shadows, bands), np.float32), np.empty(shadows, np.int64)
        )
        count, sent = _collect(air, stage, hits, rays, numbers, light, (surroundings, seeking, room))
        if sent:
            _add_sky(tracer, stage, _Seeking(*(column[:sent] for column in seeking)), of_sky)
        segment += 1
    if sought and not wave.layer.size:
        of_media += of_sky
        of_sky[:] = 0.0
    if of_sky is not of_media:
        _choose(path, photon, light, wave, sought)
    wave.power[photon] *= of_media


@njit(**KERNEL)
def _collect(air, stage, hits, rays, numbers, light, surroundings):
    """Let walks cross a segment more; those that are scattered, or pass a thin sheet, move to the front of all arrays;
    returns how many, and how many shadow rays to the sky they send."""
    (index, path, (first, seeking_first)), kept, sent = numbers, np.int64(0), np.int64(0)
    around, seeking, (room, weights) = surroundings
    onward, before = weights[0], weights[1]
    for i in range(hits.triangle.size):
        j, way = index[i], vector(rays.direction, i)
        weight = light.weight[j]
        glow(air, i, weight, light.of_media[j])
        out = rays.origin, rays.direction, kept, onward
        end = walk(air, i, (rays.origin, rays.direction), weight, (path[j], first), out)
        if end >= 0:
            for b in range(weight.size):
                before[b], weight[b] = weight[b], onward[b]
            if seeking.of.size:
                along, g = scaled(way, 1.0 / air.length[i]), air.table.anisotropy[end]
                vertex = (vector(rays.origin, kept), along, g)
                sent += _seek(around, vertex, before, (path[j], seeking_first), (seeking, room), (j, sent))
                light.turned[j] = mean_phase(g, before, dot(along, vector(rays.direction, kept)))
        if end == ARRIVED and hits.triangle[i] < 0:
            radiance, share = radiance_from(around, way, room), 1.0
            brought = light.straight[j]
            if light.turned[j] > 0.0:
                share, brought = balance(light.turned[j], density_towards(around.cells, way)), light.of_sky[j]
            for b in range(radiance.size):
                brought[b] += weight[b] * (share * radiance[b])
        elif end == ARRIVED and transmits(lobes_met(stage, hits, i)):
            at = interact(stage.surfaces, hits, i, rays.direction)
            end = _PASSED if shine_through(stage, at, weight) else LOST
            pass_on(stage.surfaces, at, rays, kept)
        if end >= 0:
            index[kept] = j
            kept += 1
    return kept, sent


@njit(inline="always")
def _seek(around, vertex, weight, numbers, rooms, row):
    """Fill a shadow ray towards the sky from where a walk with these weights (b,) is scattered; returns 1, or 0 if it
    would bring nothing. vertex: point, direction before, of unit length, and anisotropy. row: number of the walk, and
    of the shadow ray."""
    (point, along, g), (path, first), (seeking, room), (j, n) = vertex, numbers, rooms, row
    way = choose_direction(around.cells, uniform(path, first), uniform(path, first + 1))
    density, cosine = density_towards(around.cells, way), dot(along, way)
    mean = mean_phase(g, weight, cosine)
    if not density > 0.0 or not mean > 0.0:
        return 0
    radiance, share = radiance_from(around, way, room), balance(density, mean) / density
    put_vector(point, seeking.origin, n)
    put_vector(way, seeking.direction, n)
    for b in range(weight.size):
        seeking.radiance[n, b] = weight[b] * (phase(g[b if g.size > 1 else 0], cosine) * share * radiance[b])
    seeking.of[n] = j
    return 1


def _add_sky(tracer: Tracer, stage: Stage, seeking: _Seeking, of_sky: np.ndarray) -> None:
    """Add to of_sky (n, b) what shadow rays bring that meet nothing, less what thin sheets and media take."""
    rays, reach = RayBatch(seeking.origin, seeking.direction), np.full(len(seeking.of), ENDLESS)
    _add(unshadowed(tracer, stage, rays, reach, seeking.radiance), seeking, of_sky)


@njit(**KERNEL)
def _add(arrives, seeking, of_sky):
    for i in range(arrives.size):
        if arrives[i]:
            for b in range(of_sky.shape[1]):
                of_sky[seeking.of[i], b] += seeking.radiance[i, b]


@njit(**KERNEL)
def _choose(path, photon, light, wave, sought):
    """Let each photon bring one kind of light, in proportion to how much each is, so that the sum over all is kept:
    moves it to light.of_media. sought: whether shadow rays look for what comes straight from the sky: only that is left
    to them in part."""
    of_media, of_sky, straight = light.of_media, light.of_sky, light.straight
    for j in range(photon.size):
        media, sky, seen = 0.0, 0.0, 0.0
        for b in range(of_media.shape[1]):
            media += abs(of_media[j, b])
            sky += abs(of_sky[j, b])
            if sought:
                seen += abs(straight[j, b])
        total = media + sky + seen
        pick = uniform(path[j], _CHOOSING) * total
        if pick < sky:
            scale, brought = total / sky, of_sky
        elif pick < sky + seen:
            scale, brought = total / seen, straight
        else:
            scale, brought = total / media if total > 0.0 else 0.0, of_media
            if wave.layer.size:
                wave.layer[photon[j]] = 0
        if sought and not sky <= pick < sky + seen:
            wave.aimed[photon[j]] = 0.0
        for b in range(of_media.shape[1]):
            of_media[j, b] = scale * brought[j, b]
