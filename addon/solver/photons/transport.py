# SPDX-License-Identifier: GPL-3.0-or-later
"""Transport: Embree traces a wave of photons, a kernel stores and scatters them, until roulette has ended all."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import leave, pass_on
from ..geometry.see_through import let_through
from ..geometry.segments import ENDLESS, Hits, RayBatch, Tracer
from ..geometry.stage import (
    Stage,
    diffuse_reflectance_at,
    enter,
    lobe_reflectance_at,
    lobes_at,
    reflectance_at,
    stored_at,
    transmits_anywhere,
    transmittance_at,
)
from ..geometry.surfaces import other_material
from ..physics.lobes import (
    adjoint,
    diffuse_share,
    evaluate_diffuse,
    follows_fresnel,
    is_glossy,
    is_wide,
    sample_diffuse,
    sample_specular,
    transmits,
)
from ..physics.radiometry import ALL, STRAIGHT
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, put_vector, scaled
from ..system.kernels import FAST_INLINED, FAST_KERNEL, njit
from .emission import Batch, Emitters, emit
from .photon_map import Photons, photon_arrays
from .sight import choose_lobes, meet_unhidden, parts_of
from .thrown import Throwing
from .walk import append, collect, fly_photons
from .wave import (
    CAUSTIC,
    EITHER,
    FORWARDS,
    MIRRORED,
    OF_LIGHT,
    ONLY_DIFFUSE,
    ONLY_GLOSSY,
    STRAIGHT_FROM_LIGHT,
    Wave,
    arrive,
    empty_wave,
    has_arrived,
    stored_share,
)

# Largest chance with which a photon survives a bounce, so that a path between two facing mirrors ends, too. The weight
# of the survivors makes up for it.
MAX_SURVIVAL = 1.0 - 1.0 / 4096.0
_DIMENSIONS = 4  # random numbers of one bounce
# dimensions in the first bounce: of the survival, the first of two for the new direction, and of storing the photon
_ROULETTE, _LOBE, _STORING = 8, 9, 11


class Optics(NamedTuple):
    """Choices of the photons' transport.

    band_share: (b,) float32, width of each band over the width of all bands. power_roulette: whether survival depends
    on the photon's power in each band (else on the mean reflectance of the bands). keep_incoming: whether to store
    directions of photons straight from lights; keep_caustic: which photons are part of a caustic; keep_layer: layers.
    """

    band_share: np.ndarray
    power_roulette: bool
    keep_incoming: bool
    keep_caustic: bool
    keep_layer: bool


def trace_photons(
    tracer: Tracer,
    stage: Stage,
    emitters: Emitters,
    optics: Optics,
    batch: Batch,
    cancelled: Callable[[], bool] = lambda: False,
    on_hits: Callable[[Hits, Wave], None] | None = None,
    thrown: Throwing | None = None,
) -> Iterator[Photons]:
    """Trace a batch of photons; yields the stored photons of each bounce.

    on_hits(hits, wave) is called before every bounce with the Hits of the wave's rays. thrown: gets what mirrors throw
    into gas that scatters; None where nothing needs it.
    """
    bands = stage.radiometry.reference.size
    passes = transmits_anywhere(stage)
    wave, count, bounce = empty_wave(batch.count, bands, optics.keep_layer, passes, tracer.hides), batch.count, 0
    emit(emitters, stage, batch, wave)
    rooms = np.empty(bands, np.float32), np.empty(bands, np.float32)
    scattered, flying = None, 0
    if tracer.hides and passes and not tracer.holds_media:
        choose_lobes(wave, batch.key)
    if tracer.holds_media:
        collect(tracer, stage, wave, batch.key, emitters.surroundings)
        scattered = empty_wave(count, bands, optics.keep_layer, passes)
    while count and not cancelled():
        if tracer.hides:
            hits = meet_unhidden(tracer, wave, count, (batch.key, bounce))
        else:
            hits = tracer.trace_uncut(wave.origin[:count], wave.direction[:count])
        if passes and not tracer.holds_media:
            # rays of photons from the surroundings lead back to them
            back = np.flatnonzero((wave.arrival[:count] >= 0) & (hits.triangle >= 0))
            rays, reach = RayBatch(wave.origin, wave.direction), np.full(count, ENDLESS)
            for part, among in parts_of(tracer, wave, back):
                let_through(part.trace_uncut, stage, hits, (rays, reach), wave.power, among)
        if tracer.holds_media:
            hits.triangle[wave.arrival[:count] >= 0] = -1  # they have arrived, whatever their ray met
            flying = fly_photons(tracer, hits, wave, (batch.key, bounce), scattered, thrown)
        if on_hits:
            on_hits(hits, wave)
        stored = photon_arrays(count, bands, optics.keep_incoming, optics.keep_caustic, optics.keep_layer)
        kept, alive = scatter(stage, optics, batch.key, bounce, hits, wave, (stored, rooms))
        if kept:
            few = 2 * kept < count  # a copy, so that whoever keeps few photons does not keep the room for all
            yield Photons(*(array[:kept].copy() if few else array[:kept] for array in stored))
        count, bounce = append(wave, alive, scattered, flying) if flying else alive, bounce + 1


@njit(**FAST_KERNEL)
def scatter(stage, optics, key, bounce, hits, wave, out):
    """Store the photons that hit a surface, play roulette, and send the survivors on, moved to the front of the wave.

    out: where to store them, and two rooms (b,) float32 for reflectances. Returns the number of stored photons and the
    number of survivors.
    """
    kept = alive = np.int64(0)  # no literal, see kernels
    stored, rooms = out
    for i in range(hits.triangle.size):
        if not has_arrived(wave, i, hits.triangle[i]):
            continue
        at = arrive(stage.surfaces, hits, i, wave)
        rho, lobes = reflectance_at(stage, at, rooms[0]), lobes_at(stage, at)
        share, through = _reflected_share(optics, wave.power[i], rho), np.float32(0.0)
        # what is behind a thin sheet gets the light of the surroundings by photons of its own
        if transmits(lobes) and wave.arrival[i] < 0:
            through = _reflected_share(optics, wave.power[i], transmittance_at(stage, at))
        goes_on = share > 0.0 or through > 0.0
        if not (goes_on or other_material(stage.surfaces, at.triangle) >= 0):
            continue
        diffuse = evaluate_diffuse(at, scaled(at.incoming, -1.0))
        straight, stores = wave.chain[i] & STRAIGHT_FROM_LIGHT != 0 and is_glossy(lobes), stored_at(stage, at)
        path, lobe = path_key(key, wave.photon[i]), wave.lobe[i] if wave.lobe.size else EITHER
        if stores == ALL:
            kept_share = stored_share(wave, i, at)
            is_stored = kept_share >= 1.0 or uniform(path, _DIMENSIONS * bounce + _STORING) < kept_share
        else:
            is_stored = straight and stores == STRAIGHT and wave.aimed[i] == 0.0
        if is_stored and lobe != ONLY_GLOSSY:
            _store(optics, at, straight, diffuse, wave, i, stored, kept)
            enter(stage, at, at.cosine, stored.power[kept])
            if optics.keep_caustic:
                stored.caustic[kept] = wave.chain[i] & MIRRORED != 0
            kept += 1
        if not goes_on:
            continue
        choice = uniform(path, _DIMENSIONS * bounce + _ROULETTE)
        s, w = uniform(path, _DIMENSIONS * bounce + _LOBE), uniform(path, _DIMENSIONS * bounce + _LOBE + 1)
        if follows_fresnel(lobes):
            numbers = choice, s, w, uniform(path, _DIMENSIONS * bounce + _STORING)
            direction, scale, is_mirrored = _reflect_or_enter(stage, optics, at, wave.power[i], share, numbers, rooms)
            if scale == 0.0:
                continue
        else:
            survival = min(MAX_SURVIVAL, share)
            if choice >= survival:
                passing = min(1.0 - survival, through)
                if choice < survival + passing:
                    _pass(stage, optics, at, passing, wave, i, alive)
                    alive += 1
                continue
            scale, is_mirrored = 1.0 / survival, choice < survival * lobes.specular
            if is_mirrored:
                direction, weight = sample_specular(lobes, at, s, w)
                if weight <= 0.0:
                    continue
                scale *= weight
            else:
                direction = sample_diffuse(at.normal, s, w)
        scale *= adjoint(at, direction) if is_mirrored else diffuse
        if scale == 0.0 or lobe == (ONLY_DIFFUSE if is_mirrored else ONLY_GLOSSY):
            continue
        chain = 0
        if is_mirrored:
            # A light's photon is straight as long as it meets mirrors alone, and part of a caustic after rough lobes,
            # too. What a wide lobe reflects straight from its source, shadow rays find there.
            chain = wave.chain[i]
            if chain != 0:
                wide_first = is_wide(lobes) and chain & MIRRORED == 0
                chain = 0 if wide_first else MIRRORED | (CAUSTIC | chain & OF_LIGHT if is_glossy(lobes) else chain)
        leave(stage.surfaces, at.side_id, at.point, direction, wave, alive)
        factor = np.float32(scale)
        for b in range(rho.size):
            wave.power[alive, b] = wave.power[i, b] * rho[b] * factor
        wave.photon[alive], wave.aimed[alive] = wave.photon[i], 0.0
        wave.chain[alive], wave.arrival[alive] = chain, FORWARDS
        if optics.keep_layer:
            wave.layer[alive] = wave.layer[i]
        if wave.passed.size:
            wave.passed[alive] = 0.0
        if wave.start.size:
            wave.lobe[alive], wave.start[alive] = EITHER, at.triangle
        alive += 1
    return kept, alive


@njit(inline="always")
def _pass(stage, optics, at, passing, wave, i, to):
    """Let photon i of the wave pass the thin sheet at an Interaction, as photon number `to`, as it does with a chance
    of `passing`. What it is to what it meets does not change."""
    tau, factor = transmittance_at(stage, at), np.float32(1.0 / passing)
    pass_on(stage.surfaces, at, wave, to)
    for b in range(tau.size):
        wave.power[to, b] = wave.power[i, b] * tau[b] * factor
    wave.photon[to], wave.aimed[to], wave.chain[to] = wave.photon[i], wave.aimed[i], wave.chain[i]
    wave.arrival[to], wave.passed[to] = wave.arrival[i], wave.passed[i] + np.float32(at.distance)
    if optics.keep_layer:
        wave.layer[to] = wave.layer[i]
    if wave.start.size:
        wave.lobe[to], wave.start[to] = wave.lobe[i], wave.start[i]


@njit(inline="always")
def _reflect_or_enter(stage, optics, at, power, share, numbers, rooms):
    """Roulette under Fresnel's law: a facet of the specular lobe reflects a photon, or lets it through to the diffuse
    lobe, which reflects or absorbs it. So no photon's power (b,) grows, whatever lobe it met.

    If the lobes were chosen first, by their albedos, powers would grow where a rough lobe loses samples, by factors
    whose variance has no bound where surfaces are bright.

    share: of its power that is reflected in all. numbers: four, in [0, 1). rooms: two of (b,), the first of which gets
    the reflectance that the power is to be multiplied by. Returns the direction, a factor on the power, 0 if the photon
    is absorbed, and whether the specular lobe reflects it.
    """
    lobes, (choice, s, w, other), (row, below) = lobes_at(stage, at), numbers, rooms
    diffuse = diffuse_share(lobes) * _reflected_share(optics, power, diffuse_reflectance_at(stage, at, below))
    direction, weight = sample_specular(lobes, at, s, w)
    mirrored = lobe_reflectance_at(stage, at, lobes, direction, row)
    chance = max(0.0, min(MAX_SURVIVAL, lobes.specular * weight * _reflected_share(optics, power, mirrored)))
    if choice < chance:
        return direction, lobes.specular * weight / chance, True
    # A rough lobe lets through what its facets do in the mean; the chance of diffuse reflection is `diffuse` then.
    through = 1.0 - chance if lobes.alpha == 0.0 else 1.0 - (share - diffuse)
    left, survival = (choice - chance) / (1.0 - chance), min(1.0, diffuse / max(through, 1e-9))
    if left >= survival:
        return direction, 0.0, False
    direction = sample_diffuse(at.normal, left / survival, other)
    enter(stage, at, dot(direction, at.shading_normal), diffuse_reflectance_at(stage, at, row))
    return direction, diffuse_share(lobes) / diffuse, False


@njit(**FAST_INLINED)
def _reflected_share(optics, power, rho):
    """Share of a photon's power (b,) that is reflected; without power_roulette the mean reflectance over the bands."""
    reflected = arriving = np.float32(0.0)  # float32, so that a register holds 16 bands
    if optics.power_roulette:
        for b in range(rho.size):
            weight = abs(power[b])
            arriving += weight
            reflected += weight * rho[b]
    else:
        arriving = np.float32(1.0)
        for b in range(rho.size):
            reflected += optics.band_share[b] * rho[b]
    return reflected / arriving if reflected > np.float32(0.0) else np.float32(0.0)


@njit(**FAST_INLINED)
def _store(optics, at, straight, diffuse, wave, i, stored, kept):
    """Store photon i of the wave at an Interaction as number `kept`, with its power times `diffuse`, see
    evaluate_diffuse. straight: whether straight from a light."""
    put_vector(at.point, stored.position, kept)
    stored.surface[kept] = at.side_id
    for b in range(stored.power.shape[1]):
        stored.power[kept, b] = wave.power[i, b] * np.float32(diffuse)
    if optics.keep_incoming:
        put_vector(scaled(at.incoming, -1.0 if straight else 0.0), stored.incoming, kept)
    if optics.keep_layer:
        stored.layer[kept] = wave.layer[i]
