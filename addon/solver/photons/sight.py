# SPDX-License-Identifier: GPL-3.0-or-later
"""Sight: which surfaces photons meet where some are hidden from some rays (scene.Hidden).

What is hidden is said of rays from the eye: of those that a diffuse lobe reflected, a specular one, or that look for a
light object. A photon goes the other way. So the lobe that reflects it where it arrives decides what it has met on its
way, and whether it could come from there at all: what the photon has left must not be hidden from this lobe's rays.

Mostly the lobes agree. Where they do not, and both let the photon arrive, one of the two is drawn, and its power
doubles: each lobe gets as much, in the mean, as if it alone were there.
"""

from collections.abc import Iterator

import numpy as np

from ..geometry.segments import FROM_DIFFUSE, FROM_GLOSSY, TO_LIGHT, Hits, Tracer
from ..sampling.rng import path_key, uniform
from ..scene import Hidden
from ..system.kernels import KERNEL, njit
from .wave import MIRRORED, OF_LIGHT, ONLY_DIFFUSE, ONLY_GLOSSY, Wave

_DRAWING = (1 << 20) - 2  # dimension of the number that draws a lobe before the first bounce, see walk
_MEETING = 1 << 19  # first of those that draw one in each bounce
_FLAGS = int(Hidden.DIFFUSE), int(Hidden.GLOSSY)


def choose_lobes(wave: Wave, key: np.uint64) -> None:
    """Draw, for the photons of a new wave that arrive from afar, the lobe that reflects them: what lies on their way is
    known only later, see collect and let_through. key: of the photons' random numbers."""
    _choose_lobes(wave, key)


@njit(**KERNEL)
def _choose_lobes(wave, key):
    for i in range(wave.lobe.size):
        if wave.arrival[i] >= 0:
            _draw(wave, i, uniform(path_key(key, wave.photon[i]), _DRAWING))


@njit(inline="always")
def _draw(wave, i, number):
    """Let one of the lobes reflect photon i, by a number in [0, 1)."""
    wave.lobe[i] = ONLY_DIFFUSE if number < 0.5 else ONLY_GLOSSY
    for b in range(wave.power.shape[1]):
        wave.power[i, b] *= np.float32(2.0)


def kind_of(wave: Wave, photon: np.ndarray) -> np.ndarray:
    """(n,) uint8, kind of the rays to photons (n,) of the wave for which choose_lobes has drawn a lobe."""
    return np.where(wave.lobe[photon] == ONLY_DIFFUSE, FROM_DIFFUSE, FROM_GLOSSY).astype(np.uint8)


def parts_of(tracer: Tracer, wave: Wave, photon: np.ndarray) -> Iterator[tuple[Tracer, np.ndarray]]:
    """The tracers that photons (n,) of the wave ask, as choose_lobes has drawn, and which of them; the tracer itself
    for all if it hides nothing."""
    if not tracer.hides:
        yield tracer, photon
        return
    kind = kind_of(wave, photon)
    for each in (FROM_DIFFUSE, FROM_GLOSSY):
        yield tracer.seen_from(each), photon[kind == each]


def meet_unhidden(tracer: Tracer, wave: Wave, count: int, keys: tuple[np.uint64, int]) -> Hits:
    """The Hits of the first `count` photons of a wave with what is not hidden from the lobe that reflects them; sets
    wave.lobe. keys: of the photons' random numbers, and number of the bounce.

    A photon straight from a light object meets what rays to lights do, whatever lobe reflects it.
    """
    origin, direction = wave.origin[:count], wave.direction[:count]
    hits = tracer.seen_from(FROM_DIFFUSE).trace_uncut(origin, direction)
    others = tracer.seen_from(FROM_GLOSSY).trace_uncut(origin, direction)
    straight = np.flatnonzero(wave.chain[:count] & (OF_LIGHT | MIRRORED) == OF_LIGHT)
    if len(straight):
        seen = tracer.seen_from(TO_LIGHT).trace_uncut(origin[straight], direction[straight])
        for found in (hits, others):
            for column, values in zip(found, seen, strict=True):
                column[straight] = values
    _agree(tracer.hidden, wave, keys, hits, others)
    return hits


@njit(**KERNEL)
def _agree(hidden, wave, keys, hits, others):
    """Set which lobes reflect photons, and in hits what those meet. hits, others: what rays to the diffuse lobe and to
    the specular one meet."""
    (key, bounce), (of_diffuse, of_glossy), nothing = keys, _FLAGS, np.int32(-1)
    for i in range(hits.triangle.size):
        backwards, start, lobe = wave.arrival[i] >= 0, wave.start[i], wave.lobe[i]
        flags = 0 if start < 0 else hidden[start]
        diffuse = lobe != ONLY_GLOSSY and flags & of_diffuse == 0 and (hits.triangle[i] < 0) == backwards
        glossy = lobe != ONLY_DIFFUSE and flags & of_glossy == 0 and (others.triangle[i] < 0) == backwards
        if diffuse and glossy and (backwards or hits.triangle[i] == others.triangle[i]):
            continue
        if diffuse and glossy:
            _draw(wave, i, uniform(path_key(key, wave.photon[i]), _MEETING + bounce))
            diffuse = wave.lobe[i] == ONLY_DIFFUSE
        elif diffuse or glossy:
            wave.lobe[i] = ONLY_DIFFUSE if diffuse else ONLY_GLOSSY
        else:  # it arrives nowhere
            hits.triangle[i] = np.int32(0) if backwards else nothing
            continue
        if not diffuse:
            hits.triangle[i], hits.distance[i] = others.triangle[i], others.distance[i]
            hits.u[i], hits.v[i] = others.u[i], others.v[i]
