# SPDX-License-Identifier: GPL-3.0-or-later
"""What media let through between the camera and the first surface, as a sensor sees it."""

from __future__ import annotations

import math

import numpy as np

from ..geometry.media import Atmosphere
from ..geometry.segments import Hits, Tracer, ways
from ..physics.media import build_medium_table
from ..physics.molecules import MolecularMedia, Sampler
from ..physics.sensors import WEIGHTING, band_weights
from ..physics.spectrum import band_radiance
from ..scene import Scene
from ..system.kernels import KERNEL, njit

_EVALUATED, _FEWEST = 1024, 64  # coefficients of a ray, of all bands and draws; draws at least
_SEED = 0  # of the draws: the pass is a property of the scene, and not of the render's random numbers


class Transmittance:
    """The transmittance of ways through the media of a scene, by the signal of a blackbody at WEIGHTING."""

    def __init__(self, scene: Scene, tracer: Tracer, centre: np.ndarray):
        """tracer, centre: see build_surfaces. scene: with media."""
        edges = scene.band_edges
        table = build_medium_table(scene.media, edges, 0.0, np.zeros(scene.band_count))
        self._extinction = table.extinction[:, None]  # (media, draws, b)
        if any(medium.molecules for medium in scene.media):
            molecular = MolecularMedia(scene.media, table, Sampler(edges, WEIGHTING, _SEED))
            self._extinction = molecular.extinctions(max(_FEWEST, _EVALUATED // scene.band_count))
        self._air = Atmosphere(tracer, scene.media, centre, scene.world_depth)
        self._air.fill(table)
        signal = band_weights(scene.response, edges) * band_radiance(edges, WEIGHTING)
        self._weights = signal / signal.sum()

    def of(self, origin: np.ndarray, direction: np.ndarray, hits: Hits) -> np.ndarray:
        """(n,) float64 share, 0..1, of a sensor's signal that rays, origin and direction (n, 3) float32, bring from
        what they meet, or from behind the world's medium."""
        air, values = self._air.cross(origin, direction, ways(hits)), np.empty(len(origin))
        _transmittances(air, self._extinction, self._weights, values)
        return values


@njit(**KERNEL)
def _transmittances(air, extinction, weights, values):
    """Fill values (n,) with the mean over draws and bands of what segments let through. extinction: (media, draws, b)
    1/m. weights: (b,) of the bands, which add up to 1."""
    for i in range(values.size):
        total = 0.0
        for draw in range(extinction.shape[1]):
            for b in range(weights.size):
                depth = 0.0
                for s in range(air.first[i], air.first[i + 1]):
                    depth += extinction[air.medium[s], draw, b] * (air.end[s] - air.begin[s])
                total += weights[b] * math.exp(-depth * air.length[i])
        values[i] = total / extinction.shape[1]
