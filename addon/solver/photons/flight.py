# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight: what happens to photons between surfaces, where there are media.

Photons from surfaces and lights lose what media absorb, and in media that scatter they walk at random until they meet a
surface. Photons from the surroundings, and from the media themselves, are sent backwards from where they arrive: their
ray, and in scattering media their walk, collects what media emit on the way, and at its end the surroundings.
"""

import math

import numpy as np

from ..geometry.segments import Hits, Tracer, fly, glow, scatterer, transmit, ways
from ..physics.media import deflect
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import put_vector, scaled, vector
from ..system.kernels import KERNEL, njit
from .wave import Wave

_FLIGHT = 1 << 20  # first dimension of a photon's random numbers in media, _NUMBERS for each segment
_NUMBERS = 8
_SURE = 1.0 - 1.0 / 4096.0  # largest chance with which a walk goes on after being scattered, so that each ends


def fly_photons(tracer: Tracer, hits: Hits, wave: Wave, keys: tuple[np.uint64, int], scattered: Wave) -> int:
    """Take from the photons of a wave what media take on their way to these hits. Those that are scattered have no
    power left there, and continue as the first photons of `scattered`; returns how many.

    keys: of the photons' random numbers, and number of the bounce.
    """
    count = len(hits.triangle)
    air = tracer.cross(wave.origin[:count], wave.direction[:count], ways(hits))
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
    key, bounce = keys
    found = np.int64(0)
    for i in range(air.length.size):
        if wave.arrival[i] >= 0:
            continue
        path, first = path_key(key, wave.photon[i]), _FLIGHT + _NUMBERS * bounce
        for b in range(wave.power.shape[1]):
            scattered.power[found, b] = wave.power[i, b]
        if not _scatter(air, i, (wave.origin, wave.direction), scattered, found, (path, first)):
            for b in range(wave.power.shape[1]):
                wave.power[i, b] = scattered.power[found, b]
            continue
        wave.power[i, :] = np.float32(0.0)
        scattered.photon[found], scattered.aimed[found] = wave.photon[i], 0.0
        scattered.chain[found], scattered.arrival[found] = 0, -1
        if wave.layer.size:
            scattered.layer[found] = wave.layer[i]
        found += scattered.power[found, 0] == scattered.power[found, 0] and _goes_on(scattered.power[found])
    return found


@njit(inline="always")
def _goes_on(power):
    total = 0.0
    for b in range(power.size):
        total += abs(power[b])
    return total > 0.0
