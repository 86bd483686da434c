# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed meshes: whether a mesh is one, and on which side of it the outside is."""

from __future__ import annotations

import numpy as np


def outward(corners: np.ndarray) -> np.ndarray:
    """Corners (t, 3, 3) of a closed mesh, turned so that all normals point outwards.

    Parts that are not connected are turned each by itself, so that a mesh may consist of several bodies.
    """
    part = _parts(corners)
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    inverted = np.bincount(part, volume)[part] < 0.0
    return np.where(inverted[:, None, None], corners[:, ::-1], corners)


def _parts(corners):
    """(t,) number of the connected part of each triangle, by corners at the same place."""
    _, point = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    point = point.reshape(-1, 3)
    part = np.arange(point.max() + 1)
    while True:  # labels spread from corner to corner until each part has one
        least = part[point].min(axis=1)
        spread = part.copy()
        np.minimum.at(spread, point, least[:, None])
        spread = spread[spread]
        if np.array_equal(spread, part):
            return np.unique(part[point[:, 0]], return_inverse=True)[1]
        part = spread


def leak_place(vertices: np.ndarray, triangles: np.ndarray) -> str:
    """Where a mesh is open, as messages tell it; an empty text if it is closed. Arguments as in open_edge."""
    leak = open_edge(vertices, triangles)
    return "" if leak is None else f"({', '.join(f'{value:.4g}' for value in leak)})"


def open_edge(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray | None:
    """(3,) middle of an edge through which a mesh is open, None if it is closed: each edge then is crossed as often in
    one direction as in the other. vertices: (n, 3) m; those at the same place count as one. triangles: (m, 3)."""
    points, index = np.unique(np.asarray(vertices, np.float64), axis=0, return_inverse=True)
    corner = index.ravel()[triangles]
    edges = np.concatenate([corner[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    edges = edges[edges[:, 0] != edges[:, 1]]
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    key = edges.min(axis=1) * len(points) + edges.max(axis=1)
    unique, of = np.unique(key, return_inverse=True)
    balance = np.bincount(of.ravel(), sign)
    if not balance.any():
        return None
    leak = unique[np.flatnonzero(balance)[0]]
    return 0.5 * (points[leak // len(points)] + points[leak % len(points)])
