# SPDX-License-Identifier: GPL-3.0-or-later
"""Compositor nodes that turn the bands of a render into the image of a sensor with a response of its own."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty
from bpy.types import Operator

from .panels import ENGINE

GROUP = "Sensor Image"
MARK = "infrared_band_edges"  # custom property of the node groups that are made here: um
_SPACING = 180  # between nodes, in units of the node editor


class INFRARED_OT_sensor_image(Operator):
    """Add compositor nodes that turn the bands into the image of a sensor: its radiance and its apparent temperature"""

    bl_idname = "infrared.sensor_image"
    bl_label = "Sensor Image Nodes"
    bl_options = {"REGISTER", "UNDO"}

    response: StringProperty(
        name="µm, response, ...",
        description="The sensor's response: pairs of wavelength in micrometres and response, separated by commas; "
        "linear between them and constant outside. Empty is 1 at all wavelengths",
    )

    @classmethod
    def poll(cls, context):
        return context.scene.render.engine == ENGINE

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self, width=500)

    def execute(self, context):
        from .output.sensor import band_weights, calibrate
        from .scene_reader import SceneError, read_band_edges

        try:
            edges = read_band_edges(context.scene.infrared)
            weights = band_weights(edges, read_response(self.response))
            if not weights.sum() > 0.0:
                raise ValueError(f"The sensor sees nothing between {edges[0]:g} and {edges[-1]:g} um")
        except (SceneError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        tree = compositor_tree(context.scene)
        node = _group_node(tree)
        _fill(node.node_tree, edges, weights, calibrate(edges, weights))
        layers = _render_layers(tree, context.scene)
        context.scene.update_render_engine()  # the node has the passes of the bands at this moment
        for socket in node.inputs:
            tree.links.new(layers.outputs[socket.name], socket)
        return {"FINISHED"}


def read_response(text: str):
    """(n, 2) float64 [um, response] of pairs between commas, None of an empty text. ValueError if they are none."""
    import numpy as np

    if not text.strip():
        return None
    try:
        points = np.array([float(word) for word in text.split(",")]).reshape(-1, 2)
    except ValueError:
        raise ValueError(f"'{text}' is no list of pairs of numbers separated by commas") from None
    wavelength, response = points.T
    if not (np.isfinite(points).all() and wavelength[0] > 0.0 and (np.diff(wavelength) > 0.0).all()):
        raise ValueError(f"'{text}': expected wavelengths above 0 that rise from pair to pair")
    if (response < 0.0).any():
        raise ValueError(f"'{text}': expected responses of 0 or more")
    return points


def compositor_tree(scene):
    """The scene's compositor nodes; without any, new ones that let the picture through, as Blender makes them."""
    if not hasattr(scene, "compositing_node_group"):  # before Blender 5
        scene.use_nodes = True
        return scene.node_tree
    tree = scene.compositing_node_group
    if tree is None:
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositor Nodes", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
        output.location.x = 4 * _SPACING
        tree.links.new(_render_layers(tree, scene).outputs["Image"], output.inputs["Image"])
    return tree


def _render_layers(tree, scene):
    """The tree's node with the passes of a scene, a new one if there is none."""
    found = (node for node in tree.nodes if node.bl_idname == "CompositorNodeRLayers" and node.scene == scene)
    node = next(found, None)
    if node is None:
        node = tree.nodes.new("CompositorNodeRLayers")
        node.scene = scene
    return node


def _group_node(tree):
    """The tree's node of an earlier sensor image, which is then made anew, or a new one."""
    for node in tree.nodes:
        if node.bl_idname == "CompositorNodeGroup" and node.node_tree and MARK in node.node_tree:
            return node
    node = tree.nodes.new("CompositorNodeGroup")
    node.node_tree = bpy.data.node_groups.new(GROUP, "CompositorNodeTree")
    node.location = (2 * _SPACING, -_SPACING)
    for name in ("Radiance", "Temperature"):
        node.node_tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketFloat")
    return node


def _fill(group, edges, weights, calibration) -> None:
    """Make a group's inputs and nodes anew; what is linked to its outputs stays."""
    from .solver.spectrum import band_names

    group[MARK] = edges.tolist()
    group.nodes.clear()
    for item in [item for item in group.interface.items_tree if item.in_out == "INPUT"]:
        group.interface.remove(item)
    for name in band_names(edges):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
    bands, output = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    math = _Arithmetic(group)
    radiance = 0.0
    for band, weight in zip(bands.outputs[: len(weights)], weights, strict=True):
        radiance = math("MULTIPLY_ADD", band, weight, radiance)
    group.links.new(radiance, output.inputs["Radiance"])
    group.links.new(_temperature(math, radiance, calibration), output.inputs["Temperature"])
    output.location.x = math.x


def _temperature(math, radiance, calibration):
    """Sockets for the formula of a Calibration. Blender's logarithm and quotient give 0 where there is no result."""
    positive = math("MAXIMUM", radiance, 0.0)
    v = math("LOGARITHM", math("ADD", math("DIVIDE", calibration.scale, positive), 1.0), 2.718281828459045)
    x = math("MULTIPLY_ADD", math("LOGARITHM", v, 2.718281828459045), calibration.slope, calibration.offset)
    x.node.use_clamp = True
    *rest, total = calibration.coefficients
    for coefficient in reversed(rest):  # Horner
        total = math("MULTIPLY_ADD", x, total, coefficient)
    return math("DIVIDE", total, v)


class _Arithmetic:
    """Adds Math nodes to a node tree, from left to right. Operands are numbers or output sockets."""

    # Blender 5 has the shader's Math node in the compositor
    KIND = "CompositorNodeMath" if hasattr(bpy.types, "CompositorNodeMath") else "ShaderNodeMath"

    def __init__(self, tree):
        self.tree, self.x = tree, _SPACING

    def __call__(self, operation: str, *operands):
        node = self.tree.nodes.new(self.KIND)
        node.operation, node.hide = operation, True
        node.location.x, self.x = self.x, self.x + _SPACING
        for socket, operand in zip(node.inputs, operands, strict=False):
            if isinstance(operand, bpy.types.NodeSocket):
                self.tree.links.new(operand, socket)
            else:
                socket.default_value = operand
        return node.outputs[0]


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_sensor_image,))
