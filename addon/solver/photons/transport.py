# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons travel: Embree traces a wave of rays, a kernel stores and scatters them, until roulette has ended all."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..geometry.surfaces import Surfaces, Tracer, point, put_ray, unit_normal
from ..physics.radiometry import ALL, STRAIGHT, Radiometry
from ..sampling.rng import path_key, uniform
from ..sampling.warps import cosine_direction, mirror, reflect_in_lobe, to_world
from ..system.kernels import FAST_KERNEL, njit
from .emission import Emitters, emit
from .photon_map import Photons, photon_arrays
from .wave import LIT_BY_LAMP, LIT_BY_LIGHT, arrived, empty_wave

# No photon survives a bounce with more than this chance, so that facing mirrors end: its weight makes up for it.
MAX_SURVIVAL = 1.0 - 1.0 / 4096.0
_DIMENSIONS = 4  # random numbers of one bounce


class Optics(NamedTuple):
    """What the walk needs to know beside the tables. band_share: (b,) float32, of a band's width in the range.

    power_roulette: survival by power (else by the band average). keep_incoming: store directions of photons straight
    from lights. keep_caustic: store which photons are part of a caustic. keep_layer: store their layers.
    """

    band_share: np.ndarray
    power_roulette: bool
    keep_incoming: bool
    keep_caustic: bool
    keep_layer: bool


def trace_photons(
    tracer: Tracer,
    surfaces: Surfaces,
    radiometry: Radiometry,
    emitters: Emitters,
    optics: Optics,
    key: int,
    first: int,
    count: int,
    total: int,
    cancelled=lambda: False,
    on_hits=None,
) -> Iterator[Photons]:
    """Trace photons first..first+count-1 of the `total` of a pass; yields what they store, one batch a bounce.

    on_hits(triangle, u, v, wave) is called before every bounce with what the rays of the wave met.
    """
    wave = empty_wave(count, radiometry.reference.size, optics.keep_layer)
    emit(emitters, surfaces, radiometry, key, first, total, wave)
    bounce = 0
    while count and not cancelled():
        triangle, u, v = tracer.trace(wave.origin[:count], wave.direction[:count])
        if on_hits:
            on_hits(triangle, u, v, wave)
        marks = optics.keep_incoming, optics.keep_caustic, optics.keep_layer
        stored = photon_arrays(count, radiometry.reference.size, *marks)
        kept, count = scatter(surfaces, radiometry, optics, key, bounce, triangle, u, v, wave, stored)
        if kept:
            few = 2 * kept < len(triangle)  # whoever keeps these should not keep the room for all
            yield Photons(*(array[:kept].copy() if few else array[:kept] for array in stored))
        bounce += 1


@njit(**FAST_KERNEL)
def scatter(surfaces, radiometry, optics, key, bounce, triangle, u, v, wave, stored):
    """Store the photons that hit, play roulette with them and send the survivors on, moved to the front of the wave.

    Returns the number stored and the number that survived.
    """
    bands = radiometry.reference.size
    kept = alive = 0
    for i in range(triangle.size):
        t, pu, pv, dx, dy, dz = arrived(wave, i, triangle[i], u[i], v[i])
        if t < 0:
            continue
        nx, ny, nz = unit_normal(surfaces, t)
        cosine = -(dx * nx + dy * ny + dz * nz)
        side = 0
        if cosine < 0.0:
            side, cosine, nx, ny, nz = 1, -cosine, -nx, -ny, -nz
        material = surfaces.material[t]
        rho = radiometry.reflectance[material]
        alpha = float(radiometry.alpha[material])
        specular = float(radiometry.specular[material])
        x, y, z = point(surfaces.corners, t, pu, pv)
        # power that a bounce would keep, against what arrives; float32, so that a register holds 16 bands
        reflected = arriving = np.float32(0.0)
        if optics.power_roulette:
            for b in range(bands):
                weight = abs(wave.power[i, b])
                arriving += weight
                reflected += weight * rho[b]
        else:
            arriving = np.float32(1.0)
            for b in range(bands):
                reflected += optics.band_share[b] * rho[b]
        if not reflected > 0.0:
            continue
        straight = wave.chain[i] == LIT_BY_LIGHT and alpha > 0.0
        stores = radiometry.stores[material]
        if (stores == ALL or (straight and stores == STRAIGHT)) and not wave.direct[i]:
            stored.position[kept, 0], stored.position[kept, 1], stored.position[kept, 2] = x, y, z
            stored.surface[kept] = 2 * t + side
            for b in range(bands):
                stored.power[kept, b] = wave.power[i, b]
            if optics.keep_incoming:
                sign = -1.0 if straight else 0.0
                stored.incoming[kept, 0] = sign * dx
                stored.incoming[kept, 1] = sign * dy
                stored.incoming[kept, 2] = sign * dz
            if optics.keep_caustic:
                stored.caustic[kept] = wave.chain[i] != 0
            if optics.keep_layer:
                stored.layer[kept] = wave.layer[i]
            kept += 1
        survival = min(MAX_SURVIVAL, reflected / arriving)
        path = path_key(key, wave.photon[i])
        choice = uniform(path, _DIMENSIONS * bounce + 8)
        if choice >= survival:
            continue
        s = uniform(path, _DIMENSIONS * bounce + 9)
        w = uniform(path, _DIMENSIONS * bounce + 10)
        scale = 1.0 / survival
        chain = 0
        if choice < survival * specular:
            if alpha == 0.0:
                chain = wave.chain[i]
                ox, oy, oz = mirror(dx, dy, dz, nx, ny, nz, cosine)
            else:
                ox, oy, oz, weight = reflect_in_lobe(dx, dy, dz, nx, ny, nz, max(1e-6, cosine), alpha, s, w)
                if weight <= 0.0:
                    continue
                scale *= weight
                chain = wave.chain[i] if wave.chain[i] == LIT_BY_LAMP else 0
        else:
            lx, ly, lz = cosine_direction(s, w)
            ox, oy, oz = to_world(lx, ly, lz, nx, ny, nz)
        put_ray(surfaces, t, x, y, z, nx, ny, nz, ox, oy, oz, wave.origin, wave.direction, alive)
        factor = np.float32(scale)
        for b in range(bands):
            wave.power[alive, b] = wave.power[i, b] * rho[b] * factor
        wave.photon[alive] = wave.photon[i]
        wave.direct[alive] = False
        wave.chain[alive] = chain
        wave.arrival[alive] = -1
        if optics.keep_layer:
            wave.layer[alive] = wave.layer[i]
        alive += 1
    return kept, alive
