# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated meshes as arrays, one bulk read for each kind of element."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from .arrays import read_values, render_uv_map
from .surface_temperature import DOMAINS, NAME, attribute_temperatures, usable_attribute
from .warnings import Warnings

UV_MAP = ""  # name of a layer, which no attribute has


class Elements(NamedTuple):
    """How a mesh's m triangles are made of its elements, int32: vertex of each of its corners, (3 m,) corners of the
    triangles, (m,) their faces."""

    corner_vertices: np.ndarray
    corners: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class MeshData:
    """A mesh in its own space, read once however often it is instanced.

    vertices: (n, 3) float64. triangles: (m, 3) int32. slot: (m,) int32, material slot of each triangle.
    temperature: (m,) or (m, 3) float32 K from the mesh attribute, or None. normals: (m, 3, 3) float32, unit normals at
    the corners of triangles; None if all faces are flat. layers: what else was asked for at the corners of triangles,
    by name, or what is wrong with it, for users; see read_layer.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    slot: np.ndarray
    temperature: np.ndarray | None
    normals: np.ndarray | None = None
    layers: dict[str, np.ndarray | str] = field(default_factory=dict)

    def part(self, kept: np.ndarray) -> MeshData:
        """Those of the triangles for which kept, (m,) bool, is true. The vertices stay."""
        temperature, normals = (None if each is None else each[kept] for each in (self.temperature, self.normals))
        layers = {name: values if isinstance(values, str) else values[kept] for name, values in self.layers.items()}
        return MeshData(self.vertices, self.triangles[kept], self.slot[kept], temperature, normals, layers)


def read_mesh(mesh, owner: str, warnings: Warnings, layers: Collection[str] = ()) -> MeshData:
    """Positions, triangles, slots, normals, the `temperature` attribute and these layers of an evaluated mesh, one bulk
    read each."""
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
    elements = Elements(corner_vertices, corners, faces)
    return MeshData(
        vertices=read_values(mesh.attributes["position"].data, "vector", np.float32, 3).astype(np.float64),
        triangles=corner_vertices[corners].reshape(-1, 3),
        slot=np.zeros(count, np.int32) if slots is None else read_values(slots.data, "value", np.int32)[faces],
        temperature=_triangle_temperatures(mesh, elements, owner, warnings),
        normals=_corner_normals(mesh, corners),
        layers={name: read_layer(mesh, name, elements) for name in layers},
    )


def read_layer(mesh, name: str, elements: Elements) -> np.ndarray | str:
    """At the corners of triangles: (m, 3, 2) float32 coordinates of the UV map that renders use, if the name is UV_MAP,
    else (m, 3) float32 values of the float attribute of this name; or what is wrong with it, for users."""
    if problem := layer_problem(mesh, name):
        return problem
    if name == UV_MAP:
        layer = render_uv_map(mesh)
        uv = read_values(layer.uv, "vector", np.float32, 2)[elements.corners].reshape(-1, 3, 2)
        return uv if np.isfinite(uv).all() else f"the UV map '{layer.name}' has coordinates that are not finite"
    attribute = mesh.attributes[name]
    values = _on_triangles(read_values(attribute.data, "value", np.float32), attribute.domain, elements)
    return values if values.ndim == 2 else np.repeat(values[:, None], 3, axis=1)


def layer_problem(mesh, name: str) -> str:
    """Why a mesh cannot have a layer, as far as its values need not be read for that; an empty text if it can."""
    if name == UV_MAP:
        return "" if render_uv_map(mesh) else "the mesh has no UV map"
    attribute = mesh.attributes.get(name)
    if attribute is None:
        return f"the mesh has no attribute '{name}'"
    usable = attribute.data_type == "FLOAT" and attribute.domain in DOMAINS
    return "" if usable else f"the attribute '{name}' {wrong_kind(attribute)}"


def _on_triangles(values: np.ndarray, domain: str, elements: Elements) -> np.ndarray:
    """Values (n,) of an attribute on a domain, per triangle (m,) of FACE, else per triangle corner (m, 3)."""
    if domain == "FACE":
        return values[elements.faces]
    corners = elements.corners
    return values[elements.corner_vertices[corners] if domain == "POINT" else corners].reshape(-1, 3)


def wrong_kind(attribute) -> str:
    """That an attribute is not of the kind that the engine reads, and of which it is."""
    kind = f"{attribute.data_type.lower()} on {attribute.domain.lower()}s"
    where = "points or curves" if attribute.id_data.id_type in ("CURVES", "POINTCLOUD") else "points, corners or faces"
    return f"({kind}) is no float on {where}"


def attribute_problem(mesh) -> str:
    """That the mesh attribute `temperature` is of a kind that the engine does not read; an empty text if it is not."""
    attribute = mesh.attributes.get(NAME)
    if attribute is None or usable_attribute(mesh):
        return ""
    return f"the attribute '{NAME}' {wrong_kind(attribute)}; using the object's temperature"


def _corner_normals(mesh, corners: np.ndarray) -> np.ndarray | None:
    """(m, 3, 3) float32 normals at corners of triangles as Blender shades them, by sharp edges and custom normals. None
    if all faces are flat."""
    if mesh.normals_domain == "FACE":
        return None
    return read_values(mesh.corner_normals, "vector", np.float32, 3)[corners].reshape(-1, 3, 3)


def _triangle_temperatures(mesh, elements: Elements, owner: str, warnings: Warnings) -> np.ndarray | None:
    """The mesh attribute `temperature` per triangle (m,) or per triangle corner (m, 3), float32 K; None without one."""
    values, attribute = attribute_temperatures(mesh, owner), mesh.attributes.get(NAME)
    if values is None:
        if problem := attribute_problem(mesh):
            warnings.add(owner, problem)
        return None
    return _on_triangles(values, attribute.domain, elements)
