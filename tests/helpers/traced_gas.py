# SPDX-License-Identifier: GPL-3.0-or-later
"""Grey gas for the plain path tracer (path_tracer.py): closed meshes, grids, and what fills the world. No code of the
solver is used but its data classes.
"""

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

_CELLS = 8  # of a leaf, along each axis
_AT_ONCE = 1 << 14  # cells whose radiances are integrated together, as that takes some kB each
_BEHIND = 1e-6  # of the scene's size, and of the distance: by which a ray begins anew behind a face that it crosses


class Gas(NamedTuple):
    """m media. absorption, scattering: (m,) 1/m at a density of 1. anisotropy: (m,). everywhere: (m,) bool, whether it
    is the world's. depth: m, of that one before the surroundings. to_index: (m, 3, 4), from the scene's space to cells,
    and count: (m, 3) of them, 0 where a medium has no grid. first: (m,), its first cell; media without a grid have one.
    density: (c,) and excess: (c, b) radiance of a blackbody less that at T0, of cells, the last axis fastest.
    """

    absorption: np.ndarray
    scattering: np.ndarray
    anisotropy: np.ndarray
    everywhere: np.ndarray
    depth: float
    to_index: np.ndarray
    count: np.ndarray
    first: np.ndarray
    density: np.ndarray
    excess: np.ndarray


class Crossings(NamedTuple):
    """Where n rays cross the faces of the meshes of m media, in order. distance: (m, n, k) m, infinite where there are
    fewer than k. leaves: (m, n, k), whether the ray leaves the mesh there."""

    distance: np.ndarray
    leaves: np.ndarray


def check_gas(media):
    """Raise ValueError for media that are not grey."""
    for medium in media:
        values = medium.absorption, medium.scattering, medium.anisotropy
        if any(map(np.ndim, values)) or medium.gas or (medium.grid is not None and medium.grid.fractions):
            raise ValueError(f"Medium '{medium.name}': only grey media are traced")


def build_gas(media, depth, centre, black, excess_of):
    """The Gas of media. centre: (3,) m, subtracted from coordinates. black: (b,) excess of nothing, for its shape.
    excess_of: function of temperatures (c,) K that gives (c, b)."""
    to_index, count, cells = np.zeros((len(media), 3, 4)), np.zeros((len(media), 3), np.int64), []
    for m, medium in enumerate(media):
        if medium.grid is None:
            cells.append((np.ones(1), np.array([medium.temperature])))
        else:
            to_index[m], count[m], *of = _dense(medium, centre)
            cells.append(of)
    first = np.concatenate(([0], np.cumsum([len(density) for density, _ in cells])))[:-1].astype(np.int64)
    density, kelvin = (np.concatenate([np.zeros(0), *(of[i] for of in cells)]) for i in (0, 1))
    few_at_a_time = np.array_split(kelvin, 1 + len(kelvin) // _AT_ONCE)
    return Gas(
        *(np.array([getattr(each, name) for each in media], float) for name in ("absorption", "scattering")),
        np.array([each.anisotropy for each in media], float),
        np.array([each.triangles is None and each.grid is None for each in media], np.bool_),
        float(depth),
        to_index,
        count,
        first,
        density,
        np.concatenate([excess_of(few).reshape(-1, len(black)) for few in few_at_a_time]),
    )


def _dense(medium, centre):
    """Matrix (3, 4) to cells, their number (3,), and the density and temperature of all of them, (c,) each."""
    grid = medium.grid
    low = grid.leaves.min(axis=0) * _CELLS
    count = (grid.leaves.max(axis=0) + 1) * _CELLS - low
    density, kelvin = np.zeros(count), np.full(count, medium.temperature, float)
    for number, leaf in enumerate(grid.leaves):
        a, b, c = (slice(start, start + _CELLS) for start in leaf * _CELLS - low)
        density[a, b, c] = 1.0 if grid.density is None else grid.density[number]
        kelvin[a, b, c] = medium.temperature if grid.temperature is None else grid.temperature[number]
    moved = grid.matrix.copy()
    moved[:3, 3] -= centre
    matrix = np.linalg.inv(moved)[:3]
    matrix[:, 3] -= low
    return matrix, count, density.ravel(), kelvin.ravel()


class Bodies:
    """The meshes of media, whatever way their faces look."""

    def __init__(self, media, centre, size):
        """centre: (3,) m. size: m, of the scene."""
        self._meshes, self._step = [], _BEHIND * size
        for medium in media:
            if medium.triangles is None:
                self._meshes.append(None)
                continue
            corners = (np.asarray(medium.vertices, float) - centre)[medium.triangles]
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            volume = np.sum(
                np.einsum("ti,ti->t", corners[:, 0], normal)
            )  # six times that; below 0 if turned inside out
            embree, points = EmbreeScene(), corners.astype(np.float32).reshape(-1, 3)
            TriangleMesh(embree, points, np.arange(len(points), dtype=np.int32).reshape(-1, 3))
            embree.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))  # builds the tree
            self._meshes.append((embree, normal * np.sign(volume)))

    def crossings(self, origin, direction):
        """Crossings of rays, origin and unit direction (n, 3)."""
        found = [_crossed(mesh, origin, direction, self._step) if mesh else ([], []) for mesh in self._meshes]
        most = max((len(distance) for distance, _ in found), default=0)
        shape = len(found), len(origin), most
        every = Crossings(np.full(shape, np.inf), np.zeros(shape, np.bool_))
        for m, (distance, leaves) in enumerate(found):
            for k in range(len(distance)):
                every.distance[m, :, k], every.leaves[m, :, k] = distance[k], leaves[k]
        return every


def _crossed(mesh, origin, direction, step):
    """Lists of distances (n,) and whether rays leave there (n,), one for each face that the rays cross."""
    (embree, normal), ray, begin = mesh, np.arange(len(origin)), np.zeros(len(origin))
    distances, leaving = [], []
    while True:
        start = origin[ray] + begin[ray, None] * direction[ray]
        hits = embree.run(start.astype(np.float32), direction[ray].astype(np.float32), output=True)
        met = hits["primID"] >= 0
        if not met.any():
            return distances, leaving
        ray, face = ray[met], hits["primID"][met]
        distance, leaves = np.full(len(origin), np.inf), np.zeros(len(origin), np.bool_)
        distance[ray] = begin[ray] + hits["tfar"][met]
        leaves[ray] = np.einsum("ri,ri->r", direction[ray], normal[face]) > 0.0
        begin[ray] = distance[ray] * (1.0 + _BEHIND) + step
        distances.append(distance)
        leaving.append(leaves)
