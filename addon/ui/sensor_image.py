# SPDX-License-Identifier: GPL-3.0-or-later
"""Compositor nodes that turn the bands of a render into the image of a sensor: the scene's, or another one."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import EnumProperty
from bpy.types import Operator

from ..interface import ENGINE
from ..output.sensor import calibrate
from ..properties import SENSORS
from ..reading.bands import read_band_edges
from ..reading.sensor import read_response
from ..reading.settings import read_settings
from ..solver.physics.sensors import band_weights
from ..solver.physics.spectrum import band_names
from ..solver.scene import SceneError, check_response

GROUP = "Sensor Image"
MARK = "infrared_band_edges"  # custom property of the node groups that are made here: um
_SPACING = 180  # between nodes, in units of the node editor


class INFRARED_OT_sensor_image(Operator):
    """Add compositor nodes that turn the bands into the image of a sensor: its radiance and the temperature it reads"""

    bl_idname = "infrared.sensor_image"
    bl_label = "Sensor Image Nodes"
    bl_options = {"REGISTER", "UNDO"}

    sensor: EnumProperty(
        name="Sensor",
        description="The sensor whose image the nodes make",
        items=(
            ("SCENE", "The Scene's", "That of the panel Sensor, as the passes Radiance and Temperature", 5),
            *SENSORS,
        ),
        default="SCENE",
    )

    @classmethod
    def poll(cls, context):
        return context.scene.render.engine == ENGINE

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self, width=300)

    def execute(self, context):
        infrared = context.scene.infrared
        try:
            edges, correction = read_band_edges(infrared), read_settings(infrared).correction
            response = read_response(infrared, None if self.sensor == "SCENE" else self.sensor)
            check_response(response, edges)
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        tree = compositor_tree(context.scene)
        node = _group_node(tree)
        _fill(node.node_tree, edges, band_weights(response, edges), correction)
        layers = _render_layers(tree, context.scene)
        context.scene.update_render_engine()  # the node has the passes of the bands at this moment
        for socket in node.inputs:
            tree.links.new(layers.outputs[socket.name], socket)
        return {"FINISHED"}


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


def _fill(group, edges, weights, correction) -> None:
    """Make a group's inputs and nodes anew; what is linked to its outputs stays."""
    group[MARK] = edges.tolist()
    group.nodes.clear()
    for item in [item for item in group.interface.items_tree if item.in_out == "INPUT"]:
        group.interface.remove(item)
    for name in band_names(edges):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
    bands, output = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    math = _Arithmetic(group)
    radiance = 0.0
    for band, factor in zip(bands.outputs[: len(weights)], weights * np.diff(edges), strict=True):
        radiance = math("MULTIPLY_ADD", band, factor, radiance)
    group.links.new(radiance, output.inputs["Radiance"])
    if correction.share != 1.0:
        without = correction.object_radiance(0.0, edges, weights)
        radiance = math("MULTIPLY_ADD", radiance, 1.0 / correction.share, without)
    group.links.new(_temperature(math, radiance, calibrate(edges, weights)), output.inputs["Temperature"])
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


def draw_add_menu(self, context):
    """The last entry of the compositor's Add menu."""
    if context.space_data.tree_type == "CompositorNodeTree" and context.scene.render.engine == ENGINE:
        self.layout.separator()
        self.layout.operator(INFRARED_OT_sensor_image.bl_idname, text="Sensor Image...", icon="NODETREE")


def register():
    bpy.utils.register_class(INFRARED_OT_sensor_image)
    bpy.types.NODE_MT_add.append(draw_add_menu)


def unregister():
    bpy.types.NODE_MT_add.remove(draw_add_menu)
    bpy.utils.unregister_class(INFRARED_OT_sensor_image)
