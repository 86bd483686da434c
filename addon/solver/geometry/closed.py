# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed meshes: whether a mesh is one, and on which side of it the outside is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Shell(NamedTuple):
    """Connected parts of a closed mesh that lie apart from each other. corners: (t, 3, 3) float64, turned so that all
    normals point outwards. sign: 1 if they did so before, -1 if they pointed inwards, as those of a cavity do."""

    corners: np.ndarray
    sign: int


def shells(vertices: np.ndarray, triangles: np.ndarray, gap: float) -> list[Shell]:
    """The Shells of a closed mesh, none if it has no volume. vertices: (n, 3) float64; triangles: (m, 3). gap: m,
    between the boxes around parts that lie apart; parts that are thinner, on average, are left out.

    Vertices at one place connect nothing if the mesh is closed without that: so bodies that touch stay apart.
    """
    corner = np.asarray(triangles)
    if _open_edges(corner, len(vertices)).size:
        corner = _places(vertices)[1][corner]
    corners, part = np.asarray(vertices, np.float64)[triangles], _parts(corner)
    normal, volume = _normals_and_volumes(corners)
    volume = np.bincount(part, volume)
    thick = 2.0 * np.abs(volume) > gap * np.bincount(part, np.linalg.norm(normal, axis=1))
    sign = np.where(volume < 0.0, -1, 1)
    corners = np.where((sign < 0)[part][:, None, None], corners[:, ::-1], corners)
    low, high = np.full((len(sign), 3), np.inf), np.full((len(sign), 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    found = []
    for each in (1, -1):
        of_sign = np.flatnonzero(thick & (sign == each))
        layer = _layers(low[of_sign] - gap, high[of_sign])
        for number in range(layer.max(initial=-1) + 1):
            found.append(Shell(corners[np.isin(part, of_sign[layer == number])], each))
    return found


def _layers(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) layer of each box, low and high (n, 3), the first of those in which it touches no other: along x, a box is
    compared with the boxes alone that have not ended yet."""
    layer, begun = np.zeros(len(low), np.int64), np.empty(0, np.int64)
    for box in np.argsort(low[:, 0], kind="stable"):
        begun = begun[high[begun, 0] >= low[box, 0]]
        touched = begun[np.all((low[begun] <= high[box]) & (high[begun] >= low[box]), axis=1)]
        layer[box] = np.setdiff1d(np.arange(len(touched) + 1), layer[touched])[0]
        begun = np.append(begun, box)
    return layer


def outward(corners: np.ndarray) -> np.ndarray:
    """Corners (t, 3, 3) of a closed mesh, turned so that all normals point outwards; each connected part by itself."""
    part = _parts(_places(corners.reshape(-1, 3))[1].reshape(-1, 3))
    inverted = np.bincount(part, _normals_and_volumes(corners)[1])[part] < 0.0
    return np.where(inverted[:, None, None], corners[:, ::-1], corners)


def _normals_and_volumes(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of triangles (t, 3, 3): normals (t, 3), as long as their area, and signed volumes (t,) of the tetrahedra over
    them whose tip is amid all, so that large coordinates hide no small body."""
    middle = corners - corners.reshape(-1, 3).mean(axis=0)
    normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normal, np.einsum("ti,ti->t", middle[:, 0], normal) / 3.0


def _parts(corner):
    """(t,) number of the connected part of each triangle, by the numbers of its corners, (t, 3)."""
    part = np.arange(corner.max() + 1)
    while True:  # labels spread from corner to corner until each part has one
        least = part[corner].min(axis=1)
        spread = part.copy()
        np.minimum.at(spread, corner, least[:, None])
        spread = spread[spread]
        if np.array_equal(spread, part):
            return np.unique(part[corner[:, 0]], return_inverse=True)[1]
        part = spread


def _places(vertices):
    """Places of vertices (n, 3), each once, and the number of that of each vertex, (n,)."""
    points, index = np.unique(np.asarray(vertices, np.float64), axis=0, return_inverse=True)
    return points, index.ravel()


def fault_of(vertices: np.ndarray, triangles: np.ndarray) -> str:
    """How and where a mesh is not closed, as messages tell it; an empty text if it is closed.
    Arguments as in open_edge."""
    leak = open_edge(vertices, triangles)
    if leak is None:
        return ""
    place = f"({', '.join(f'{value:.4g}' for value in leak)})"
    of = _edges(_places(vertices)[1][triangles], len(vertices))[2]
    is_twisted = not np.any(np.bincount(of) % 2)
    return f"twisted at {place}, where the normals of faces disagree" if is_twisted else f"open at {place}"


def open_edge(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """(3,) middle of an edge through which a mesh is open, None if it is closed: each edge then is crossed as often in
    one direction as in the other. vertices: (n, 3) m; those at the same place count as one. triangles: (m, 3)."""
    points, index = _places(vertices)
    leaks = _open_edges(index[triangles], len(points))
    return 0.5 * points[leaks[0]].sum(axis=0) if len(leaks) else None


def _open_edges(corner, count):
    """(e, 2) ends of the edges that are not crossed as often in one direction as in the other. corner: (t, 3) numbers
    of the triangles' corners, below count."""
    unique, sign, of = _edges(corner, count)
    leaks = unique[np.bincount(of, sign, len(unique)) != 0]
    return np.stack((leaks // count, leaks % count), axis=1)


def _edges(corner, count):
    """The edges of triangles: of each the numbers of its ends in one, and for each triangle that has it the direction,
    1 or -1, and the edge's place among all."""
    edges = np.concatenate([corner[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    edges = edges[edges[:, 0] != edges[:, 1]]
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    unique, of = np.unique(edges.min(axis=1) * count + edges.max(axis=1), return_inverse=True)
    return unique, sign, of.ravel()
