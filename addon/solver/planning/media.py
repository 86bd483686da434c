# SPDX-License-Identifier: GPL-3.0-or-later
"""What media do to light, as far as the plan has to know: how much of the light in the image is theirs, and what they
emit, take and scatter of rays that survey the image."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..geometry.flight import ARRIVED, walk
from ..geometry.media import Atmosphere
from ..geometry.segments import Hits, RayBatch, empty_ray_batch, glow, traverse, ways
from ..geometry.surfaces import Surfaces
from ..photons.irradiance_cache import LOOKS, start_looks
from ..physics.media import mean_phase
from ..physics.spectrum import band_radiance
from ..sampling.heuristics import SINGLE_RAY
from ..sampling.rng import PILOT, THROUGH_MEDIA, pass_key
from ..sampling.vectors import difference, dot, vector
from ..scene import Medium
from ..system.kernels import KERNEL, njit, thinned
from .pilot import Pilot
from .reference import Sources

_POINTS = 512  # at most, from which rays look through media
# Weight of the excess of media against that of surfaces. Rays and photons collect all that media on their way emit, but
# meet single points of surfaces. In a room full of hot gas (tests/benchmarks/gas_reference.py) T0 is best at the
# walls up to where the gas takes 65 % of the light, or 3.7 times as much as is left to the walls.
_COLLECTED = 0.25


def add_media(sources: Sources, media: tuple[Medium, ...], shares: np.ndarray, edges: np.ndarray) -> Sources:
    """The Sources of a scene with its media: each takes its part (m, b) of the light of all others, and sends its own
    in its place (Kirchhoff's law), which counts less."""
    kelvin = np.array([medium.typical_temperature for medium in media])
    return Sources(
        np.append(sources.temperature, kelvin),
        np.vstack((sources.share * (1.0 - shares.sum(axis=0)), _COLLECTED * shares)),
        np.vstack((sources.radiance, band_radiance(edges, kelvin))),
    )


def absorbed_shares(
    tracer: Atmosphere, surfaces: Surfaces, pilot: Pilot, media: tuple[Medium, ...], absorption: np.ndarray
) -> np.ndarray:
    """(m, b) share that media absorb of the light which comes to where camera paths gather; at most 1 together.

    absorption: (m, b) 1/m. Gas in grids is taken as even over their box.
    """
    step = max(1, len(pilot.point) // _POINTS)
    point, side_id, weight = thinned((pilot.point, pilot.side_id, pilot.throughput), step)
    shares = np.zeros_like(absorption)
    if not weight.sum() > 0.0:
        return shares
    rays = empty_ray_batch(LOOKS * len(side_id))
    start_looks(surfaces, point, side_id, pass_key(0, THROUGH_MEDIA, PILOT), 0, rays)
    air = tracer.cross(*rays, ways(tracer.trace(*rays)))
    ray = np.repeat(np.arange(len(air.length)), np.diff(air.first))
    metres = (air.end - air.begin) * air.length[ray]
    mean = absorption * [[1.0 if medium.grid is None else medium.grid.mean_density] for medium in media]
    taken = -np.expm1(-metres[:, None] * mean[air.medium])
    np.add.at(shares, air.medium, taken * np.repeat(weight / weight.sum() / LOOKS, LOOKS)[ray, None])
    return shares / np.maximum(shares.sum(axis=0), 1.0)


class Scattered(NamedTuple):
    """n rays that media scattered, and how they go on.

    ray: int64, index of the ray. origin, direction: (n, 3) float32. throughput: float64, of the path. flown: float64,
    m, from the ray's origin. density: float32, see Rays.
    """

    ray: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    flown: np.ndarray
    density: np.ndarray


def cross_samples(
    tracer: Atmosphere, hits: Hits, rays: RayBatch, throughput: np.ndarray, numbers: tuple, seen: np.ndarray
) -> Scattered:
    """Add to seen (n,) what media emit along rays, in all bands together, and take from the rays' throughput (n,), the
    mean over the bands, what media take. Rays that are scattered or lost meet nothing any more.

    numbers: keys (n,) of random numbers, and the first dimension, see flight.walk.
    """
    count, air = len(throughput), tracer.cross(*rays, ways(hits))
    scattered = Scattered(
        np.empty(count, np.int64), *empty_ray_batch(count), *np.empty((2, count)), np.empty(count, np.float32)
    )
    room = np.empty((3, air.share.shape[1]), np.float32)
    found = _cross_samples(air, tracer.scatters, hits, (throughput, *numbers), seen, scattered, room)
    return Scattered(*(column[:found] for column in scattered))


@njit(**KERNEL)
def _cross_samples(air, scatters, hits, paths, seen, scattered, room):
    """room: (3, b), of weights before and after, and of radiance."""
    throughput, path, first = paths
    found, (weight, onward, radiance) = np.int64(0), (room[0], room[1], room[2])
    for i in range(throughput.size):
        weight[:], radiance[:] = throughput[i], 0.0
        if scatters:
            glow(air, i, weight, radiance)
            out = scattered.origin, scattered.direction, found, onward
            end = walk(air, i, (air.rays.origin, air.rays.direction), weight, (path[i], first), out)
            if end >= 0:
                flown = difference(vector(scattered.origin, found), vector(air.rays.origin, i))
                cosine = dot(vector(air.rays.direction, i), vector(scattered.direction, found)) / air.length[i]
                scattered.ray[found], scattered.throughput[found] = i, onward.mean()
                scattered.flown[found] = math.sqrt(dot(flown, flown))
                scattered.density[found] = SINGLE_RAY * mean_phase(air.table.anisotropy[end], weight, cosine)
                found += 1
            if end != ARRIVED:
                hits.triangle[i], weight[:] = -1, 0.0
        else:
            traverse(air, i, weight, radiance)
        seen[i] += radiance.sum()
        throughput[i] = weight.mean()
    return found
