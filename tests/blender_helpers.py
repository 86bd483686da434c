# SPDX-License-Identifier: GPL-3.0-or-later
"""Short ways to build and read Blender scenes in tests."""

from __future__ import annotations

import bmesh
import bpy


def link(name, data=None, collection=None, **properties):
    """A new object in the scene (or in a collection) with custom properties."""
    obj = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(obj)
    for key, value in properties.items():
        obj[key] = value
    return obj


def cube_mesh(name="Cube"):
    """A cube from -0.5 to 0.5: 8 vertices, 6 quads."""
    mesh, shape = bpy.data.meshes.new(name), bmesh.new()
    bmesh.ops.create_cube(shape, size=1.0)
    shape.to_mesh(mesh)
    shape.free()
    return mesh


def material(name="Paint", **properties):
    """A material with custom properties."""
    result = bpy.data.materials.new(name)
    for key, value in properties.items():
        result[key] = value
    return result


def camera(location=(0.0, 0.0, 5.0), width=16, height=12):
    """A camera that looks down from `location`, made the scene's, and a small picture."""
    scene = bpy.context.scene
    obj = link("Camera", bpy.data.cameras.new("Camera"))
    obj.location = location
    scene.camera = obj
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    return obj


def read_as_rendered():
    """What the reader makes of the current scene in a real render: {view layer: (Scene, warnings) or the error}.

    Blender runs a stand-in engine, so that hide_render, render modifiers and view layers count as they do with F12.
    """
    from addon.scene_reader import SceneError, read_scene

    results = {}

    class ProbeEngine(bpy.types.RenderEngine):
        bl_idname, bl_label = "INFRARED_PROBE", "Probe"

        def render(self, depsgraph):
            try:
                results[depsgraph.view_layer_eval.name] = read_scene(depsgraph)
            except SceneError as error:
                results[depsgraph.view_layer_eval.name] = error

    bpy.utils.register_class(ProbeEngine)
    try:
        bpy.context.scene.render.engine = "INFRARED_PROBE"
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(ProbeEngine)
    return results


def read(layer="ViewLayer"):
    """(Scene, warnings) of one view layer, read as in a real render; raises its SceneError."""
    result = read_as_rendered()[layer]
    if isinstance(result, Exception):
        raise result
    return result
