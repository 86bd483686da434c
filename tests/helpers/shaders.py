# SPDX-License-Identifier: GPL-3.0-or-later
"""Short ways to build shaders in tests."""

from __future__ import annotations

import bpy


def shaded(name="Paint", properties=None, **inputs):
    """A material with a Principled BSDF whose inputs have these values (words of a name are joined by _)."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:  # before Blender 5
        result.use_nodes = True
    for key, value in inputs.items():
        principled(result).inputs[key.replace("_", " ")].default_value = value
    for key, value in (properties or {}).items():
        result[key] = value
    return result


def principled(material):
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")


def output(material):
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")


def node(tree, kind, **inputs):
    """A new node in a material's tree, or in a group, whose inputs have these values."""
    owner = getattr(tree, "node_tree", tree)
    result = owner.nodes.new(f"ShaderNode{kind}" if not kind.startswith("Node") else kind)
    for key, value in inputs.items():
        result.inputs[key.replace("_", " ")].default_value = value
    return result


def join(source, target, output=0):
    """Link an output of a node to an input socket; returns the link."""
    return target.id_data.links.new(source.outputs[output], target)


def textured(material, name, kind="TexImage"):
    """Link a texture to an input of a material's Principled BSDF; returns its node."""
    texture = node(material, kind)
    join(texture, principled(material).inputs[name])
    return texture


def mixed(material, first, second, factor=0.5):
    """Show a mix of two nodes, None for no shader; returns the mix."""
    mix = node(material, "MixShader")
    mix.inputs[0].default_value = factor
    for each, socket in ((first, mix.inputs[1]), (second, mix.inputs[2])):
        if each is not None:
            join(each, socket)
    join(mix, output(material).inputs["Surface"])
    return mix


def covering(material):
    """Geometry nodes that give an object a material."""
    tree = bpy.data.node_groups.new("Cover", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, cover, end = map(tree.nodes.new, ("NodeGroupInput", "GeometryNodeSetMaterial", "NodeGroupOutput"))
    cover.inputs["Material"].default_value = material
    tree.links.new(begin.outputs[0], cover.inputs["Geometry"])
    tree.links.new(cover.outputs[0], end.inputs[0])
    return tree


def grouped(kind, shared, value, **inputs):
    """A node group of one shader, one of whose inputs is the group's, with this default; its other inputs are given."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    group.interface.new_socket(shared, in_out="INPUT", socket_type="NodeSocketFloat").default_value = value
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    inside = node(group, kind, **inputs)
    join(begin, inside.inputs[shared])
    join(inside, end.inputs[0])
    return group
