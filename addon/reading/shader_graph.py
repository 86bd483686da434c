# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of a material's shader as Blender follows them: through groups, reroutes, muted nodes and mixes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy

Groups = tuple  # the group nodes that a node is inside of, the outermost first

TARGETS = ("CYCLES", "EEVEE")  # whose output counts; the outputs for all engines are among the first one's
ANGLE_NODES = {"ShaderNodeFresnel", "ShaderNodeLayerWeight"}
FACING = 0.1  # how much of a mix by angle is its second shader, over all directions
UNKNOWN = 0.5  # the same of a mix by something else that varies, such as a texture


class Feed(NamedTuple):
    """What gives an input its value: the output `socket` of a node, or, with node None, `socket` by a value of its own,
    which is 0 if there is no socket.

    groups: those that the node, or the socket, is inside of.
    """

    node: object | None
    socket: object
    groups: Groups


class Closure(NamedTuple):
    """A node whose light a surface sends, and the weight, 0 to 1, that mixes give it."""

    node: object
    output: object
    groups: Groups
    weight: float


def shader_output(material):
    """The node of the output that renders show, or None. One for Cycles wins over one for all engines, as in Cycles,
    and one for EEVEE counts where there is no other; of several the active one."""
    tree = material.node_tree if uses_nodes(material) else None
    found = (tree.get_output_node(target) for target in TARGETS) if tree else ()
    return next(filter(None, found), None)


def uses_nodes(material) -> bool:
    """Whether nodes make the shader, not the few values that materials have beside them. Since Blender 5 they do."""
    return material.node_tree is not None and (bpy.app.version >= (5, 0) or material.use_nodes)


def feed(socket, groups: Groups = ()) -> Feed:
    """What gives an input its value. Muted nodes hand on what Blender's inner links say, muted links do nothing."""
    own = socket  # whose value counts if nothing comes
    while True:
        links = socket.links if socket.is_linked else ()  # Blender looks through all of the tree for them
        link = next((link for link in links if link.is_valid and not link.is_muted), None)
        if link is None:
            return Feed(None, own, groups)
        node, output = link.from_node, link.from_socket
        if node.mute or node.bl_idname == "NodeReroute":  # they have no value of their own
            socket = _inner_end(node, output)
            if socket is None:
                return Feed(None, own, groups)
            if bpy.app.version < (5, 0):  # where nothing comes to such an input, earlier Blenders make it 0
                own = None
            continue
        if node.bl_idname == "NodeGroupInput" and groups:
            socket, groups = _same(groups[-1].inputs, output), groups[:-1]
        elif node.bl_idname == "ShaderNodeGroup":
            ends = node.node_tree.nodes if node.node_tree else ()
            end = next((each for each in ends if each.bl_idname == "NodeGroupOutput" and each.is_active_output), None)
            socket, groups = _same(end.inputs if end else (), output), (*groups, node)
        else:
            return Feed(node, output, groups)
        own = socket
        if socket is None:  # a group without this input or output gives 0, or no shader
            return Feed(None, None, groups)


def _inner_end(node, output):
    """The input of a reroute, or of a muted node, that comes out of an output; None if none does."""
    if node.bl_idname == "NodeReroute":
        return node.inputs[0]
    return next((each.from_socket for each in node.internal_links if each.to_socket == output), None)


def _same(sockets, wanted):
    return next((socket for socket in sockets if socket.identifier == wanted.identifier), None)


def constant(node, name: str, groups: Groups, missing: float = 0.0) -> float | None:
    """The value of a node's input, the mean of a colour; None if it varies, `missing` if there is no such input."""
    socket = next((each for each in node.inputs if each.identifier == name), None)
    return missing if socket is None else _value(feed(socket, groups))


def _value(fed: Feed) -> float | None:
    if fed.node is not None and fed.node.bl_idname not in ("ShaderNodeValue", "ShaderNodeRGB"):
        return None
    value = getattr(fed.socket, "default_value", 0.0)
    if hasattr(value, "__len__"):
        value = sum(value[:3]) / 3.0
    return float(value)


def closures(socket, groups: Groups = (), weight: float = 1.0) -> Iterator[Closure]:
    """The shaders that come to an input, with what mixes leave of them. A mix that varies counts by its likely mean."""
    node, output, groups = feed(socket, groups)
    if node is None:
        return
    for branch, share in _branches(node, groups):
        yield from closures(branch, groups, weight * share)
    if node.bl_idname not in ("ShaderNodeMixShader", "ShaderNodeAddShader"):
        yield Closure(node, output, groups, weight)


def _branches(node, groups: Groups) -> list[tuple]:
    """The inputs of a mix or a sum that count, and the weight of each; none of another node."""
    if node.bl_idname == "ShaderNodeAddShader":
        return [(node.inputs[0], 1.0), (node.inputs[1], 1.0)]
    if node.bl_idname != "ShaderNodeMixShader":
        return []
    fed = feed(node.inputs[0], groups)
    share = _value(fed)
    if share is None:
        share = FACING if fed.node.bl_idname in ANGLE_NODES else UNKNOWN
    share = min(max(share, 0.0), 1.0)
    return [(node.inputs[i], weight) for i, weight in ((1, 1.0 - share), (2, share)) if weight > 0.0]


def live_nodes(socket, groups: Groups = ()) -> Iterator[tuple[object, Groups]]:
    """Each node that has a say in an input, with the groups that it is inside of, once."""
    seen, waiting = set(), [(socket, groups)]
    while waiting:
        node, _, inside = feed(*waiting.pop())
        key = node and (node.as_pointer(), *(group.as_pointer() for group in inside))
        if node is None or key in seen:
            continue
        seen.add(key)
        yield node, inside
        inputs = [branch for branch, _ in _branches(node, inside)]
        if node.bl_idname == "ShaderNodeMixShader":
            inputs.append(node.inputs[0])
        inputs = inputs or [each for each in node.inputs if each.enabled]
        waiting.extend((each, inside) for each in inputs)
