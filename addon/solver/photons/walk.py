# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons in media, between surfaces.

Photons from surfaces and lights lose what media absorb, and where media scatter they walk at random until they meet a
surface. Photons from the surroundings, and from the media themselves, are sent backwards from where they arrive: their
ray, and in media that scatter their walk, collects what media emit on the way, and at its end the surroundings.

A sun's light has lost what the depth of the world's air takes, wherever it is met, as shadow rays to suns say. So
photons of suns lose all of it at once, and then the world's air scatters them, and takes nothing more, until they meet
something.
"""

import numpy as np

from ..geometry.flight import ARRIVED, LOST, NUMBERS, walk
from ..geometry.interaction import interact, pass_on
from ..geometry.segments import Hits, RayBatch, Tracer, glow, transmit, ways
from ..geometry.stage import Stage, lobes_met, shine_through
from ..physics.lobes import transmits
from ..physics.sky import radiance_from
from ..sampling.rng import path_key, path_keys, uniform
from ..sampling.vectors import vector
from ..system.kernels import KERNEL, njit
from .wave import FORWARDS, FROM_SUN, Wave

_WALKING, _COLLECTING = 1 << 20, 1 << 24  # first dimensions of a photon's random numbers in media
_PASSED = 0  # end of a walk's segment at a thin sheet: like that of one that a medium scatters, it goes on
_CHOOSING = (1 << 20) - 1  # dimension of the number that chooses what a photon brings


def fly_photons(tracer: Tracer, hits: Hits, wave: Wave, keys: tuple[np.uint64, int], scattered: Wave) -> int:
    """Take from the photons of a wave what media take on their way to these hits. Those that are scattered arrive there
    without power, and go on as the first photons of `scattered`; returns how many do.

    keys: of the photons' random numbers, and number of the bounce.
    """
    count = len(hits.triangle)
    from_sun = wave.arrival[:count] == FROM_SUN
    air = tracer.cross(wave.origin[:count], wave.direction[:count], ways(hits), from_sun if from_sun.any() else None)
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


def collect(tracer: Tracer, stage: Stage, wave: Wave, key: np.uint64, surroundings) -> None:
    """Give the photons of a new wave that arrive from afar the power that they bring: those of suns what the depth of
    the world's air leaves, the others what they have times the excess radiance that reaches their origin, also through
    thin sheets. surroundings: see emission.Surroundings.

    With layers the photon brings either the surroundings' light, or that of the media, which is in the first layer.
    """
    wave.power[wave.arrival == FROM_SUN] *= np.exp(-tracer.before_scene).astype(np.float32)
    photon = np.flatnonzero(wave.arrival >= 0)
    rays, count, segment = RayBatch(wave.origin[photon], wave.direction[photon]), len(photon), 0
    weight, room = np.ones((count, len(surroundings.radiance)), np.float32), np.empty(len(surroundings.radiance))
    brought, index = np.zeros_like(weight), np.arange(count)
    sky = np.zeros_like(brought) if wave.layer.size else brought
    path = path_keys(key, wave.photon[photon])
    while count:
        hits = tracer.trace_uncut(*(column[:count] for column in rays))
        air = tracer.cross(*(column[:count] for column in rays), ways(hits))
        first, light = _COLLECTING + NUMBERS * segment, (weight, brought, sky)
        count = _collect(air, stage, hits, rays, (index, path, first), light, (surroundings, room))
        segment += 1
    if wave.layer.size:
        _choose(path, photon, brought, sky, wave.layer)
    wave.power[photon] *= brought


@njit(**KERNEL)
def _collect(air, stage, hits, rays, numbers, light, surroundings):
    """Let walks cross a segment more; those that are scattered, or pass a thin sheet, move to the front of all arrays;
    returns how many."""
    (index, path, first), (weight, brought, sky), kept = numbers, light, np.int64(0)
    around, room = surroundings
    for i in range(hits.triangle.size):
        j, way = index[i], vector(rays.direction, i)
        glow(air, i, weight[j], brought[j])
        out = rays.origin, rays.direction, kept, weight[j]
        end = walk(air, i, (rays.origin, rays.direction), weight[j], (path[j], first), out)
        if end == ARRIVED and hits.triangle[i] < 0:
            radiance = radiance_from(around, way, room)
            for b in range(radiance.size):
                sky[j, b] += weight[j, b] * radiance[b]
        elif end == ARRIVED and transmits(lobes_met(stage, hits, i)):
            at = interact(stage.surfaces, hits, i, rays.direction)
            end = _PASSED if shine_through(stage, at, weight[j]) else LOST
            pass_on(stage.surfaces, at, rays, kept)
        if end >= 0:
            index[kept] = j
            kept += 1
    return kept


@njit(**KERNEL)
def _choose(path, photon, brought, sky, layer):
    """Let each photon bring one of two kinds of light, in proportion to how much each is, so that the sum over both is
    kept. brought, sky: (n, b), of the media, where the choice is left, and of the surroundings. layer: of the photons'
    wave, that of the surroundings before."""
    for j in range(photon.size):
        of_media, of_sky = 0.0, 0.0
        for b in range(brought.shape[1]):
            of_media += abs(brought[j, b])
            of_sky += abs(sky[j, b])
        total = of_media + of_sky
        chosen = uniform(path[j], _CHOOSING) * total < of_sky
        scale = total / (of_sky if chosen else of_media) if total > 0.0 else 0.0
        if not chosen:
            layer[photon[j]] = 0
        for b in range(brought.shape[1]):
            brought[j, b] = scale * (sky[j, b] if chosen else brought[j, b])
