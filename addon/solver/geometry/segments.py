# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments: the straight ways of light between two points, and what lies between the two.

Camera rays, rays of final gathers, shadow rays and photons all cross one segment at a time. Embree says here where a
segment ends and how long it is. Only here is asked what a segment takes from the light on it, and what it adds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ..physics.media import MediumTable
from ..system.kernels import njit


class RayBatch(NamedTuple):
    """n rays: origin, direction (n, 3) float32."""

    origin: np.ndarray
    direction: np.ndarray


def empty_ray_batch(count: int) -> RayBatch:
    """Room for count rays."""
    return RayBatch(*np.empty((2, count, 3), np.float32))


class Hits(NamedTuple):
    """Where n rays meet triangles first.

    triangle: (n,) int32, -1 where a ray meets none. u, v: (n,) float32, barycentric coordinates of corners 1 and 2.
    distance: (n,) float32, in units of the length of the ray's direction; where a ray meets nothing, its reach.
    """

    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    distance: np.ndarray


class Tracer:
    """Embree's BVH over the triangles. Embree looks for hits from distance 0 on, so the origin of a ray must be clear
    of the surface that it leaves (see `clear_of`).

    All methods release the GIL.

    holds_media, scatters: whether there are media between the surfaces, and whether any scatters. Only if there are, a
    tracer is asked what segments cross; it then is a media.Atmosphere.
    """

    holds_media = scatters = False

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        """vertices (n, 3) float32, triangles (m, 3) int32. Builds the BVH at once, so threads never race for it."""
        self._scene = EmbreeScene()  # robust: no ray slips between two triangles that share an edge
        TriangleMesh(self._scene, vertices, triangles)
        self.trace(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        """The first Hits of rays, origin and direction (n, 3) float32. reach: (n,) float32, in units of the direction's
        length, overwritten; None is without limit."""
        hits = self._scene.run(origin, direction, reach, output=True)
        return Hits(hits["primID"], hits["u"], hits["v"], hits["tfar"])

    def visible(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """(n,) bool, visibility of the ends of shadow rays: whether they meet nothing on the way; see `trace`."""
        return self.trace(origin, direction, reach).triangle < 0


class Air(NamedTuple):
    """What n segments cross.

    first: (n + 1,) int64, where the stretches of each segment begin in medium, begin and end. medium: (s,) int64.
    begin, end: (s,) float64, of the stretch of a segment in a medium, in units of the direction's length; stretches in
    several media may overlap. length: (n,) of the direction. table: of the media, see MediumTable.
    """

    first: np.ndarray
    medium: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    length: np.ndarray
    table: MediumTable


def ways(hits: Hits) -> np.ndarray:
    """(n,) float32, how far rays go: to what they meet, or without end."""
    return np.where(hits.triangle < 0, np.float32(np.inf), hits.distance)


@njit(inline="always")
def next_stop(air, i, t):
    """The least distance beyond t, in units of the direction's length, at which segment i enters or leaves a medium;
    infinite if there is none."""
    stop = np.inf
    for s in range(air.first[i], air.first[i + 1]):
        if air.begin[s] > t:
            stop = min(stop, air.begin[s])
        elif air.end[s] > t:
            stop = min(stop, air.end[s])
    return stop


@njit(inline="always")
def coefficient(air, i, t, stop, of, b):
    """A coefficient in band b on segment i between t and the next stop, for each unit of the direction's length: media
    that overlap add. of: (m, b) float64, 1/m."""
    total = 0.0
    for s in range(air.first[i], air.first[i + 1]):
        if air.begin[s] <= t and stop <= air.end[s]:
            total += of[air.medium[s], b]
    return total * air.length[i]


@njit(inline="always")
def emission(air, i, t, stop, b):
    """Excess radiance that media emit in band b on segment i between t and the next stop, for each unit of the
    direction's length."""
    total = 0.0
    for s in range(air.first[i], air.first[i + 1]):
        if air.begin[s] <= t and stop <= air.end[s]:
            total += air.table.absorption[air.medium[s], b] * air.table.excess[air.medium[s], b]
    return total * air.length[i]


@njit(inline="always")
def transmit(air, i, power):
    """Lower power (b,), or a radiance or throughput, by what segment i absorbs and scatters (Bouguer's law). Both
    directions lose alike."""
    t, stop = 0.0, next_stop(air, i, 0.0)
    while stop < np.inf:
        for b in range(power.size):
            power[b] *= math.exp(-coefficient(air, i, t, stop, air.table.extinction, b) * (stop - t))
        t, stop = stop, next_stop(air, i, stop)


@njit(inline="always")
def glow(air, i, throughput, radiance):
    """Add to radiance (b,) what media on segment i emit towards its origin, times the throughput (b,) there."""
    for b in range(throughput.size):
        _glow(air, i, b, throughput[b], radiance)


@njit(inline="always")
def traverse(air, i, throughput, radiance):
    """`glow` and `transmit` in one."""
    for b in range(throughput.size):
        throughput[b] = _glow(air, i, b, throughput[b], radiance)


@njit(inline="always")
def _glow(air, i, b, throughput, radiance):
    """Add to radiance[b] what media on segment i emit; returns what is left of the throughput at its end.

    A stretch of optical depth tau between media of one temperature each brings dL = j / k (1 - exp(-tau)), j their
    emission and k their extinction (Modest, section 10.4). No step is random.
    """
    through = float(throughput)
    t, stop = 0.0, next_stop(air, i, 0.0)
    while stop < np.inf:
        k = coefficient(air, i, t, stop, air.table.extinction, b)
        if k > 0.0:
            left = math.exp(-k * (stop - t))
            if left < 1.0:
                radiance[b] -= through * emission(air, i, t, stop, b) / k * math.expm1(-k * (stop - t))
            through *= left
        t, stop = stop, next_stop(air, i, stop)
    return through
