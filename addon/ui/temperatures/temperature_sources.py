# SPDX-License-Identifier: GPL-3.0-or-later
"""What the temperature operators read and write in Blender: sources of temperatures, and the attribute of meshes.

The attribute is the float mesh attribute `temperature`, K, on points, corners or faces.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ...reading.arrays import read_values
from ...reading.surface_temperature import NAME
from ...reading.temperature_fields import TemperatureError, inverse_distance

QUERIES = 1 << 16  # vertices looked up at a time, which bounds the memory


# Meshes ---------------------------------------------------------------------------------------------------------------


def selected_meshes(context) -> list:
    """The selected mesh objects, the active one first. Of objects that share a mesh only one is listed."""
    meshes = {}
    for obj in sorted(context.selected_objects, key=lambda obj: obj != context.object):
        if obj.type == "MESH":
            meshes.setdefault(obj.data, obj)
    return list(meshes.values())


def check_writable(obj) -> None:
    """Raise TemperatureError if the object's mesh cannot get the attribute."""
    mesh = obj.data
    if not mesh.is_editable:
        raise TemperatureError(f"Object '{obj.name}': its mesh '{mesh.name}' is linked and cannot be changed")
    attribute = mesh.attributes.get(NAME)
    if attribute is not None and attribute.data_type != "FLOAT":
        kind = attribute.data_type.lower()
        raise TemperatureError(f"Object '{obj.name}': rename its attribute '{NAME}', which is {kind}, not float")
    if NAME in obj.vertex_groups:
        raise TemperatureError(f"Object '{obj.name}': rename its vertex group '{NAME}', it takes the attribute's name")


def write_temperature(mesh, domain: str, kelvin: np.ndarray) -> None:
    """Set the mesh's attribute `temperature` to `kelvin` (n,) on a domain of n elements, in place of an old one."""
    attribute = mesh.attributes.get(NAME)
    if attribute is not None and attribute.domain != domain:
        mesh.attributes.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = mesh.attributes.new(NAME, "FLOAT", domain)
    attribute.data.foreach_set("value", np.ascontiguousarray(kelvin, dtype=np.float32))
    mesh.update_tag()


# Sources --------------------------------------------------------------------------------------------------------------


def vertex_weights(context, obj, group: str) -> np.ndarray:
    """(n,) float32 weights of the mesh's vertices in a vertex group; 0 where a vertex is not in it.

    Blender's Python has no array of weights, but geometry nodes read them all at once: 50 times faster than a loop.
    """
    tree = bpy.data.node_groups.new("Weights", "GeometryNodeTree")
    reader = bpy.data.objects.new("Weights", obj.data)  # vertex groups belong to the mesh
    try:
        for direction in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
        kinds = ("NodeGroupInput", "GeometryNodeInputNamedAttribute", "GeometryNodeStoreNamedAttribute")
        start, weights, store = (tree.nodes.new(kind) for kind in kinds)
        weights.data_type = store.data_type = "FLOAT"
        weights.inputs["Name"].default_value, store.inputs["Name"].default_value = group, ".weights"
        tree.links.new(start.outputs[0], store.inputs["Geometry"])
        tree.links.new(weights.outputs["Attribute"], store.inputs["Value"])
        tree.links.new(store.outputs["Geometry"], tree.nodes.new("NodeGroupOutput").inputs[0])
        reader.modifiers.new("Weights", "NODES").node_group = tree
        context.scene.collection.objects.link(reader)
        mesh = reader.evaluated_get(context.evaluated_depsgraph_get()).data
        return read_values(mesh.attributes[".weights"].data, "value", np.float32)
    finally:
        bpy.data.objects.remove(reader)
        bpy.data.node_groups.remove(tree)


def interpolate(positions, points, kelvin, neighbours: int, power: float, reach: float, own: float) -> np.ndarray:
    """(n,) float64 K at positions (n, 3): inverse distance weighted means of the nearest of the points (m, 3).

    kelvin: (m,). own: K where no point is within reach, in the points' unit of length.
    """
    origin = points.mean(axis=0)  # the tree is float32: near the origin it resolves best
    tree = KDTree(len(points))
    for index, point in enumerate((points - origin).tolist()):
        tree.insert(point, index)
    tree.balance()
    count = min(neighbours, len(points))
    result = np.empty(len(positions))
    for first in range(0, len(positions), QUERIES):
        some = positions[first : first + QUERIES]
        queries = (some - origin).tolist()
        found = (index for query in queries for _, index, _ in tree.find_n(query, count))
        nearest = np.fromiter(found, np.int32, len(queries) * count).reshape(-1, count)
        distances = np.linalg.norm(points[nearest] - some[:, None], axis=2)
        result[first : first + QUERIES] = inverse_distance(distances, kelvin[nearest], power, reach, own)
    return result
