# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of a cloud as triangles: arithmetic on arrays, no Blender.

A sphere of radius r becomes a convex solid of the same surface, 4 pi r^2, so that it emits the same power. After Cauchy
(1841) the mean of the area that a convex body hides, over all directions, is a quarter of its surface, so that it also
hides as much. Each solid is turned differently, so that many points hide what spheres do from any direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from .meshes import MeshData
from .tubes import ALLOWED, joined_meshes

_SMOOTH_FROM = 80  # faces from which on a solid is shaded smooth; smaller ones are smaller than a pixel
_LEVELS = 6  # of detail: an octahedron, then an icosahedron and four subdivisions of it
_UNSEEN = 1  # level without a camera that tells the size of a pixel
_STEPS = 1.2207440846057596 ** -np.arange(1.0, 4.0)  # of the R3 sequence (Roberts 2018), whose base solves x^4 = x + 1


@dataclass(frozen=True)
class Points:
    """n points in the space of their object. position: (n, 3) float64. radius: (n,) float64. slot: (n,) int32, material
    slot. temperature: (n,) float32 K, or None."""

    position: np.ndarray
    radius: np.ndarray
    slot: np.ndarray
    temperature: np.ndarray | None = None

    def part(self, kept: np.ndarray) -> Points:
        """Those for which kept, (n,) bool, is true."""
        temperature = None if self.temperature is None else self.temperature[kept]
        return Points(self.position[kept], self.radius[kept], self.slot[kept], temperature)


@cache
def solid(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int32 of a solid with the surface of the unit sphere: an octahedron
    (level 0), an icosahedron, and its subdivisions."""
    vertices, triangles = _octahedron() if level == 0 else _icosahedron()
    for _ in range(level - 1):
        vertices, triangles = _subdivided(vertices, triangles)
    a, b, c = vertices[triangles].swapaxes(0, 1)
    surface = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return vertices * np.sqrt(4.0 * np.pi / surface), triangles


@cache
def _error(level: int) -> float:
    """How far the solid of a level lies beside the unit sphere: beyond it at corners, within it at faces."""
    vertices, triangles = solid(level)
    corner = np.linalg.norm(vertices, axis=1).max() - 1.0
    return max(corner, 1.0 - np.linalg.norm(vertices[triangles].mean(axis=1), axis=1).min())


def levels_of(radius: np.ndarray, pixel: np.ndarray | None) -> np.ndarray:
    """(n,) int64 level of detail for spheres of these radii. pixel: (n,) size of a pixel at each, None if unknown."""
    if pixel is None:
        return np.full(len(radius), _UNSEEN)
    errors = np.array([_error(level) for level in range(_LEVELS)])
    return np.searchsorted(-errors[:-1], -ALLOWED * pixel / radius)


def face_count(levels: np.ndarray) -> int:
    """How many triangles solids of these levels have."""
    counts = np.array([len(solid(level)[1]) for level in range(_LEVELS)])
    return int(counts[levels].sum())


def solids(points: Points, levels: np.ndarray) -> MeshData:
    """The triangles of points with these levels of detail, (n,)."""
    parts, start = [], 0
    for level in np.unique(levels):
        vertices, triangles = solid(int(level))
        chosen = points.part(levels == level)
        count = len(chosen.radius)
        turned = np.einsum("nij,vj->nvi", _rotations(count), vertices)
        every = triangles + np.int32(len(vertices)) * np.arange(count, dtype=np.int32)[:, None, None]
        of = np.repeat(np.arange(count), len(triangles))
        outward = turned / np.linalg.norm(turned, axis=2, keepdims=True)
        smooth = len(triangles) >= _SMOOTH_FROM
        at = (chosen.position[:, None] + chosen.radius[:, None, None] * turned).reshape(-1, 3)
        parts.append(
            MeshData(
                at,
                every.reshape(-1, 3) + np.int32(start),
                chosen.slot[of],
                None if chosen.temperature is None else chosen.temperature[of],
                outward.reshape(-1, 3)[every.reshape(-1, 3)].astype(np.float32) if smooth else None,
            )
        )
        start += len(at)
    return joined_meshes(parts)


def _rotations(count: int) -> np.ndarray:
    """(n, 3, 3) rotations that spread evenly: uniform quaternions (Shoemake 1992) of a low-discrepancy sequence."""
    a, b, c = ((np.arange(count)[:, None] + 1.0) * _STEPS % 1.0).T
    low, high, b, c = np.sqrt(1.0 - a), np.sqrt(a), 2.0 * np.pi * b, 2.0 * np.pi * c
    x, y, z, w = low * np.sin(b), low * np.cos(b), high * np.sin(c), high * np.cos(c)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def _octahedron() -> tuple[np.ndarray, np.ndarray]:
    vertices = np.concatenate((np.eye(3), -np.eye(3)))
    return vertices, _outward(vertices, [(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)])


def _icosahedron() -> tuple[np.ndarray, np.ndarray]:
    golden = 0.5 * (1.0 + 5.0**0.5)
    planar = [(0.0, s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    vertices = np.array([np.roll(each, turn) for turn in range(3) for each in planar]) / np.hypot(1.0, golden)
    edge = 2.0 / np.hypot(1.0, golden) * 1.01
    near = np.linalg.norm(vertices[:, None] - vertices, axis=2) < edge
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    return vertices, _outward(vertices, faces)


def _outward(vertices: np.ndarray, faces: list) -> np.ndarray:
    """Faces (m, 3) int32 of a convex solid around the origin, wound counter-clockwise as seen from outside."""
    triangles = np.array(faces, np.int32)
    inside = np.linalg.det(vertices[triangles]) < 0.0
    triangles[inside] = triangles[inside, ::-1]
    return triangles


def _subdivided(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle as four, with all vertices on the unit sphere."""
    edges = np.sort(np.stack((triangles, np.roll(triangles, -1, axis=1)), axis=-1).reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    middle = vertices[unique].mean(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    a, b, c = triangles.T
    d, e, f = (number.reshape(-1, 3) + len(vertices)).T
    smaller = np.concatenate([np.column_stack(each) for each in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    return np.concatenate((vertices, middle)), smaller.astype(np.int32)
