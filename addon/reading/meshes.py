# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated meshes as arrays, one bulk read for each kind of element."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import read_values
from .surface_temperature import NAME, attribute_temperatures
from .warnings import Warnings


@dataclass(frozen=True)
class MeshData:
    """A mesh in its own space, read once however often it is instanced.

    vertices: (n, 3) float64. triangles: (m, 3) int32. slot: (m,) int32, material slot of each triangle.
    temperature: (m,) or (m, 3) float32 K from the mesh attribute, or None. normals: (m, 3, 3) float32, unit normals at
    the corners of triangles; None if all faces are flat.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    slot: np.ndarray
    temperature: np.ndarray | None
    normals: np.ndarray | None = None


def read_mesh(mesh, owner: str, warnings: Warnings) -> MeshData:
    """Positions, triangles, slots, normals and the `temperature` attribute of an evaluated mesh, one bulk read each."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        return MeshData(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32), None)
    corner_vertices = read_values(mesh.attributes[".corner_vert"].data, "value", np.int32)
    corners = np.empty(3 * count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    faces = np.empty(count, dtype=np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", faces)
    slots = mesh.attributes.get("material_index")
    return MeshData(
        vertices=read_values(mesh.attributes["position"].data, "vector", np.float32, 3).astype(np.float64),
        triangles=corner_vertices[corners].reshape(-1, 3),
        slot=np.zeros(count, np.int32) if slots is None else read_values(slots.data, "value", np.int32)[faces],
        temperature=_triangle_temperatures(mesh, corner_vertices, corners, faces, owner, warnings),
        normals=_corner_normals(mesh, corners),
    )


def _corner_normals(mesh, corners: np.ndarray) -> np.ndarray | None:
    """(m, 3, 3) float32 normals at corners of triangles as Blender shades them, by sharp edges and custom normals. None
    if all faces are flat."""
    if mesh.normals_domain == "FACE":
        return None
    return read_values(mesh.corner_normals, "vector", np.float32, 3)[corners].reshape(-1, 3, 3)


def _triangle_temperatures(mesh, corner_vertices, corners, faces, owner, warnings) -> np.ndarray | None:
    """The mesh attribute `temperature` per triangle (m,) or per triangle corner (m, 3), float32 K; None without one."""
    values, attribute = attribute_temperatures(mesh, owner), mesh.attributes.get(NAME)
    if values is None:
        if attribute is not None:
            kind = f"{attribute.data_type.lower()} on {attribute.domain.lower()}s"
            message = f"the attribute '{NAME}' ({kind}) is no float on points, corners or faces"
            warnings.add(owner, f"{message}; using the object's temperature")
        return None
    if attribute.domain == "FACE":
        return values[faces]
    return values[corner_vertices[corners] if attribute.domain == "POINT" else corners].reshape(-1, 3)
