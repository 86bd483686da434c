# SPDX-License-Identifier: GPL-3.0-or-later
"""Short ways to build and read Blender scenes in tests."""

from __future__ import annotations

from types import SimpleNamespace

import bmesh
import bpy
import numpy as np
import OpenEXR


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


def grey_plate(width=4, height=3, scale=20.0, name="Cube"):
    """A grey plate at 320 K that fills a small picture, or less at a smaller scale, under a sky of 260 K; returns
    scene.infrared."""
    camera(width=width, height=height)
    mesh = cube_mesh()
    mesh.materials.append(material(emissivity=0.8))
    link(name, mesh, temperature=320.0).scale = (scale, scale, 1.0)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world["temperature"] = 260.0
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads, infrared.band_count = 4, 1000, 1, 4
    return infrared


def called_as_rendered(call):
    """What call(engine, depsgraph) returns in a real render of the current scene: {view layer: result or the error}.

    Blender runs a stand-in engine, so that hide_render, render modifiers and view layers count as they do with F12.
    """
    from addon.reading.scene_reader import SceneError

    results, before = {}, bpy.context.scene.render.engine

    class ProbeEngine(bpy.types.RenderEngine):
        bl_idname, bl_label = "INFRARED_PROBE", "Probe"

        def render(self, depsgraph):
            try:
                results[depsgraph.view_layer_eval.name] = call(self, depsgraph)
            except SceneError as error:
                results[depsgraph.view_layer_eval.name] = error

    bpy.utils.register_class(ProbeEngine)
    try:
        bpy.context.scene.render.engine = "INFRARED_PROBE"
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(ProbeEngine)
        bpy.context.scene.render.engine = before
    return results


def read_as_rendered():
    """What the reader makes of the current scene in a real render: {view layer: (Scene, warnings) or the error}."""
    from addon.reading.motion import read_moving_scene

    def read_scene_of(engine, depsgraph):
        scenes, warnings, _ = read_moving_scene(engine, depsgraph)
        return scenes[0], warnings

    return called_as_rendered(read_scene_of)


def read(layer="ViewLayer"):
    """(Scene, warnings) of one view layer, read as in a real render; raises its SceneError."""
    result = read_as_rendered()[layer]
    if isinstance(result, Exception):
        raise result
    return result


def use_multilayer_exr():
    """Let Blender write every pass to one 32-bit file."""
    image = bpy.context.scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5; it resets the colour depth
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth = "OPEN_EXR_MULTILAYER", "32"


def render_to_exr(folder, animation=False):
    """Render as a user does and read the multilayer EXR that Blender writes: {view layer: {pass: pixels}}.

    Pixels are (h, w[, 4]) float32, row 0 at the bottom. Raises RuntimeError with the engine's message if it fails.
    """
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    use_multilayer_exr()
    scene.render.filepath = str(folder / ("image_####" if animation else "image"))
    bpy.ops.render.render(animation=animation, write_still=not animation)
    return read_exr(folder / (f"image_{scene.frame_current:04d}.exr" if animation else "image.exr"))


def read_exr(path):
    """{view layer: {pass: pixels}} of a multilayer EXR, one part (Blender 4.5) or a part for each pass (5)."""
    layers = {}
    for part in OpenEXR.File(str(path)).parts:
        for name, channel in part.channels.items():
            layer, _, rest = name.partition(".")
            pass_name = rest.removesuffix(".V").removesuffix(".RGBA")
            layers.setdefault(layer, {})[pass_name] = channel.pixels[::-1]
    return layers


def editor(layer=0, render_pass=0, slot=0, kind="RENDER_RESULT", view=0):
    """As an Image Editor that shows a layer, a view and a pass of a slot of the render result."""
    image = SimpleNamespace(type=kind, render_slots=SimpleNamespace(active_index=slot))
    user = SimpleNamespace(multilayer_layer=layer, multilayer_view=view, multilayer_pass=render_pass)
    return SimpleNamespace(image=image, image_user=user)


def describe(scene):
    """Everything of a scene that the engine renders, in plain values."""
    infrared = scene.infrared
    settings = [name for name in infrared.bl_rna.properties.keys() if name not in ("rna_type", "name")]  # noqa: SIM118
    result = {
        "settings": {name: plain(getattr(infrared, name)) for name in settings},
        "render": (scene.render.engine, scene.render.resolution_x, scene.render.resolution_y, scene.camera.name),
        "world": custom_properties(scene.world),
    }
    for obj in scene.objects:
        entry = {"matrix": np.array(obj.matrix_world).tolist(), "properties": custom_properties(obj)}
        if obj.type == "MESH":
            entry["vertices"] = [list(vertex.co) for vertex in obj.data.vertices]
            entry["faces"] = [list(face.vertices) for face in obj.data.polygons]
            entry["smooth_faces"] = [face.use_smooth for face in obj.data.polygons]
            entry["sharp_edges"] = sorted(sorted(edge.vertices) for edge in obj.data.edges if edge.use_edge_sharp)
            entry["uv"] = [[list(point.vector) for point in layer.uv] for layer in obj.data.uv_layers]
            entry["face_materials"] = [face.material_index for face in obj.data.polygons]
            if "temperature" in obj.data.attributes:
                entry["temperatures"] = [point.value for point in obj.data.attributes["temperature"].data]
            entry["modifiers"] = [
                (m.type, getattr(m, "width", None), getattr(m, "harden_normals", None)) for m in obj.modifiers
            ]
            entry["materials"] = [(m.name, custom_properties(m)) for m in obj.data.materials]
        elif obj.type == "LIGHT":
            entry["light"] = (obj.data.type, obj.data.energy, obj.data.shadow_soft_size)
        elif obj.type == "CAMERA":
            entry["camera"] = (obj.data.lens, obj.data.sensor_width, obj.data.clip_start, obj.data.clip_end)
        result[obj.name] = entry
    return result


def plain(value):
    """A setting's value that outlives its file: vectors and collections are lists."""
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def custom_properties(block):
    """Custom properties in plain values, with those of groups such as the species of a gas. Images are their name, size
    and values, other blocks of Blender their name."""
    plain_values = {}
    for key, value in block.items():
        convert = getattr(value, "to_list", None) or getattr(value, "to_dict", None)
        if isinstance(value, bpy.types.Image):
            plain_values[key] = value.name, *value.size, list(value.pixels)
        elif isinstance(value, bpy.types.ID):
            plain_values[key] = value.name
        else:
            plain_values[key] = convert() if convert else value
    return plain_values


def read_png(path):
    """(h, w, 3) uint8 of a PNG, row 0 at the bottom."""
    image = bpy.data.images.load(str(path))
    pixels = np.empty((image.size[1], image.size[0], 4), np.float32)
    image.pixels.foreach_get(pixels.ravel())
    bpy.data.images.remove(image)
    return np.rint(pixels[..., :3] * 255).astype(np.uint8)
