# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of the light in the image comes from media, as far as the choice of T0 has to know."""

from __future__ import annotations

import numpy as np

from ..geometry.media import Atmosphere
from ..geometry.segments import empty_ray_batch, ways
from ..geometry.surfaces import Surfaces
from ..photons.irradiance_cache import LOOKS, start_looks
from ..physics.spectrum import band_radiance
from ..sampling.rng import PILOT, THROUGH_MEDIA, pass_key
from ..scene import Medium
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
    some = slice(None, None, max(1, len(pilot.point) // _POINTS))
    point, side_id, weight = pilot.point[some], pilot.side_id[some], pilot.throughput[some]
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
