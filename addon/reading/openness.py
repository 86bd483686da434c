# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a scene is open, as far as the boxes around its objects tell without a look at any mesh."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from .objects import SURFACE_TYPES, may_have_faces

DIRECTIONS = 256  # that are looked in
MOST_BOXES = 10_000  # more take long, and are no scene that one sees out of so easily


def surely_open(depsgraph, rendered: Collection, camera) -> bool:
    """Whether some ray from a camera object surely leaves the scene, as it meets no box around an object.

    rendered: the objects that count. False where that is unknown: meshes may leave a way out of their boxes, and of
    objects that are hidden in the viewport the depsgraph knows no box.
    """
    corners, matrices, known = [], [], set()
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not instance.show_self or obj.type not in SURFACE_TYPES:
            continue
        if instance.is_instance or obj.original in rendered:
            known.add(obj.original)
            corners.append([corner[:] for corner in obj.bound_box])
            matrices.append([row[:] for row in instance.matrix_world])
        if len(corners) > MOST_BOXES:
            return False
    if not corners or any(may_have_faces(obj) for obj in rendered if obj not in known):
        return False
    matrix = np.array(matrices)
    corner = np.einsum("nij,nkj->nki", matrix[:, :3, :3], np.array(corners)) + matrix[:, None, :3, 3]
    origin, low, high = np.array(camera.matrix_world.translation), corner.min(axis=1), corner.max(axis=1)
    if np.any(np.all((low <= origin) & (origin <= high), axis=1)):
        return False  # quickly, as in most rooms
    return any(not _meets(low - origin, high - origin, direction) for direction in _directions(DIRECTIONS))


def _directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the sphere by a Fibonacci lattice, from the zenith down."""
    index = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * index / count, np.pi * (1.0 + 5.0**0.5) * index
    radius = np.sqrt(1.0 - z**2)
    return np.column_stack((radius * np.cos(turn), radius * np.sin(turn), z))


def _meets(low: np.ndarray, high: np.ndarray, direction: np.ndarray) -> bool:
    """Whether a ray from the origin meets one of n boxes, by the slabs between their sides. low, high: (n, 3)."""
    near, far = np.where(direction > 0.0, low, high) / direction, np.where(direction > 0.0, high, low) / direction
    return bool(np.any(far.min(axis=1) >= np.maximum(near.max(axis=1), 0.0)))
