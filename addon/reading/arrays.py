# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's collections of mesh elements as numpy arrays."""

from __future__ import annotations

import numpy as np


def read_values(collection, member: str, dtype, width: int = 1) -> np.ndarray:
    """One member of all elements of a Blender collection: (n,), or (n, width) for vectors.

    dtype: should be the one that Blender has the member in; a conversion would be slow.
    """
    values = np.empty(len(collection) * width, dtype=dtype)
    collection.foreach_get(member, values)
    return values if width == 1 else values.reshape(-1, width)


def same_elements(mesh, other) -> bool:
    """Whether two meshes have the same vertices, faces and corners, wherever the vertices are."""
    if any(len(getattr(mesh, kind)) != len(getattr(other, kind)) for kind in ("vertices", "polygons", "loops")):
        return False
    members = (("polygons", "loop_start"), ("loops", "vertex_index"))
    return all(
        np.array_equal(*(read_values(getattr(m, kind), member, np.int32) for m in (mesh, other)))
        for kind, member in members
    )


def render_uv_map(mesh):
    """The UV map of a mesh that renders use, or None."""
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)
