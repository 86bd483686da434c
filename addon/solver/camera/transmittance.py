# SPDX-License-Identifier: GPL-3.0-or-later
"""What media let through between the camera and the first surface, as a sensor sees it."""

from __future__ import annotations

import math

import numpy as np

from ..geometry.media import Atmosphere
from ..geometry.segments import Air, Hits, Tracer, measure_depth, ways
from ..physics.heat import build_heat_table
from ..physics.media import build_medium_table
from ..physics.molecules import MolecularMedia, Sampler
from ..physics.sensors import WEIGHTING, band_weights
from ..physics.spectrum import band_radiance
from ..scene import Scene
from ..system.kernels import KERNEL, njit

_EVALUATED, _FEWEST = 1024, 64  # coefficients of a ray, of all bands and draws; draws at least
_CELL_DRAWS = 32  # where each draw crosses the cells anew
_SEED = 0  # of the draws: the pass is a property of the scene, and not of the render's random numbers


class Transmittance:
    """The transmittance of ways through the media of a scene, by the signal of a blackbody at WEIGHTING."""

    def __init__(self, scene: Scene, tracer: Tracer, centre: np.ndarray):
        """tracer, centre: see build_surfaces. scene: with media."""
        edges = scene.band_edges
        table = build_medium_table(scene.media, edges, 0.0, np.zeros(scene.band_count))
        self._air = Atmosphere(tracer, scene.media, centre, scene.world_depth)
        self._air.fill(table, build_heat_table(scene.media, edges, 0.0, np.zeros(scene.band_count)))
        self._tables, extinction = [], table.extinction
        if any(medium.molecules or medium.components for medium in scene.media):
            molecular = MolecularMedia(scene.media, table, Sampler(edges, WEIGHTING, _SEED))
            if any(medium.components for medium in scene.media):  # what a draw absorbs is then known in cells alone
                self._tables = [molecular.table(index) for index in range(_CELL_DRAWS)]
            else:
                extinction = molecular.extinctions(max(_FEWEST, _EVALUATED // scene.band_count))
        self._extinction = extinction.reshape(len(scene.media), -1)  # (media, draws * b)
        signal = band_weights(scene.response, edges) * band_radiance(edges, WEIGHTING)
        self._weights = signal / signal.sum()

    def of(self, origin: np.ndarray, direction: np.ndarray, hits: Hits) -> np.ndarray:
        """(n,) float64 share, 0..1, of a sensor's signal that rays, origin and direction (n, 3) float32, bring from
        what they meet, or from behind the world's medium."""
        values = np.zeros(len(origin))
        for table in self._tables:
            self._air.fill(table)
            air = self._air.cross(origin, direction, ways(hits))
            _add_transmittances(air, air.table.extinction, self._weights / len(self._tables), values)
        if not self._tables:
            draws = self._extinction.shape[1] // self._weights.size
            air = self._air.cross(origin, direction, ways(hits))
            _add_transmittances(air, self._extinction, np.tile(self._weights / draws, draws), values)
        return values


def _add_transmittances(air: Air, extinction: np.ndarray, weights: np.ndarray, values: np.ndarray) -> None:
    """Add to values (n,) the mean of what segments let through. extinction: (rows, k) 1/m, of bands, or of all bands of
    several draws. weights: (k,) of these."""
    _add(air, extinction, weights, np.empty(len(weights)), values)


@njit(**KERNEL)
def _add(air, extinction, weights, depth, values):
    for i in range(values.size):
        measure_depth(air, i, extinction, depth)
        for k in range(depth.size):
            values[i] += weights[k] * math.exp(-depth[k])
