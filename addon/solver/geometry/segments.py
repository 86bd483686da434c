# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments: the straight ways of light between two points, and what lies between.

Whatever travels, a camera ray, a ray of a final gather, a shadow ray or a photon, crosses one segment at a time. Here
Embree says where it ends and how long it is, and here alone is asked what the way does to what travels on it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ..system.kernels import njit


class RayBatch(NamedTuple):
    """Rays, n of them: origin, direction (n, 3) float32."""

    origin: np.ndarray
    direction: np.ndarray


def empty_ray_batch(count: int) -> RayBatch:
    """Room for count rays."""
    return RayBatch(*np.empty((2, count, 3), np.float32))


class Hits(NamedTuple):
    """Where n rays meet triangles first.

    triangle: (n,) int32, -1 where they meet none. u, v: (n,) float32, barycentric coordinates of corners 1 and 2.
    distance: (n,) float32, in units of the length of the ray's direction; where nothing is met, how far the ray
    reaches.
    """

    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    distance: np.ndarray


class Tracer:
    """Embree's BVH over the triangles. Embree starts rays at 0, so origins must be off their surface (see `clear_of`).

    All methods release the GIL.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray):
        """vertices (n, 3) float32, triangles (m, 3) int32. Builds the BVH at once, so threads never race for it."""
        self._scene = EmbreeScene()  # robust: no ray slips between two triangles that share an edge
        TriangleMesh(self._scene, vertices, triangles)
        self.trace(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        """The first Hits of (n, 3) float32 rays. reach: (n,) float32 in units of the direction's length, overwritten;
        None is without end."""
        hits = self._scene.run(origin, direction, reach, output=True)
        return Hits(hits["primID"], hits["u"], hits["v"], hits["tfar"])

    def visible(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """(n,) bool, whether shadow rays meet nothing within their reach; see `trace`."""
        return self.trace(origin, direction, reach).triangle < 0


@njit(inline="always")
def transmit(stage, origin, direction, distance, power):
    """Lower power (b,), or radiance, or a throughput, by what a segment absorbs; it is the same backwards.

    stage: see Stage. origin, direction: (3,) of the segment. distance: its length, in units of the direction's. Between
    surfaces there is a vacuum, which takes nothing, so this compiles to nothing.
    """


@njit(inline="always")
def glow(stage, origin, direction, distance, throughput, radiance):
    """Add to radiance (b,) what a segment emits towards its origin, times the throughput (b,) there: nothing in a
    vacuum. Arguments as of `transmit`, which is asked afterwards."""
