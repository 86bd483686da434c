# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments: the straight ways of light between two points, and what lies between the two.

Camera rays, rays of final gathers, shadow rays and photons all cross one segment at a time. Embree says here where a
segment ends and how long it is. Only here is asked what a segment takes from the light on it, and what it adds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

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
    """

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


@njit(inline="always")
def transmit(stage, origin, direction, distance, power):
    """Lower power (b,), or a radiance or throughput, by what a segment absorbs. Both directions absorb alike.

    stage: see Stage. origin, direction: (3,) of the segment. distance: length of the segment, in units of the
    direction's length. Between surfaces there is a vacuum, which absorbs nothing, so this compiles to nothing.
    """


@njit(inline="always")
def glow(stage, origin, direction, distance, throughput, radiance):
    """Add to radiance (b,) what a segment emits towards its origin, times the throughput (b,) at the origin: nothing in
    a vacuum. The other arguments are those of `transmit`, which is to be called after this."""
