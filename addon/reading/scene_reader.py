# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated scene becomes the solver's Scene: numpy arrays, one bulk read for each mesh.

Here the parts are put together; each has its own module beside this one.
Units: metres (one Blender unit, whatever the display units), kelvin, micrometres, watts.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import bpy
import numpy as np

from ..solver.scene import Hidden, Scene, SceneError
from .bands import read_band_edges
from .camera import pixel_size, read_camera
from .categories import Categories
from .custom_properties import driver_remark, setting_remarks
from .groups import UNGROUPED_LIGHT, GroupReader, read_group
from .ignored import ignored_scene_settings, ignored_settings, left_out_instance
from .lights import metres_per_unit, read_light, uneven_beam
from .objects import STRAND_TYPES
from .sensor import read_response
from .settings import read_defaults
from .shaders import read_shader, unseen_message
from .strands import PixelSize
from .surfaces import SurfaceReader
from .visibility import HIDDEN_IN_FOG, Visibility, read_visibility
from .warnings import Warnings
from .world import layer_world, read_sky, world_temperature

# Types of evaluated objects with faces: curves, texts, metaballs and geometry nodes arrive as meshes.
FACED = {"MESH", *STRAND_TYPES}


def read_scene(depsgraph, camera=None, surfaces: SurfaceReader | None = None) -> tuple[Scene, list[str]]:
    """Everything that the depsgraph's view layer renders, and warnings about what it cannot render as it stands.

    camera: evaluated camera object; None is the scene's camera. surfaces: a new reader, to ask it for more afterwards.
    Raises SceneError, naming the object and the value, if there is nothing to render or a value makes no sense.
    """
    surfaces = surfaces or render_reader(depsgraph)
    contents = read_contents(depsgraph, surfaces, camera=camera)
    _tell_of_shaders(depsgraph, surfaces)
    solver_camera = read_camera(depsgraph, camera or depsgraph.scene_eval.camera, surfaces.warnings)
    ignored = ignored_scene_settings(depsgraph.scene_eval, depsgraph.view_layer_eval)
    warnings = surfaces.warnings.messages() + list(ignored)
    return Scene(**contents, camera=solver_camera), warnings


def _tell_of_shaders(depsgraph, surfaces: SurfaceReader) -> None:
    """Warn of what the engine does not see of the shaders of the materials that were read. Viewports tell nothing, so
    they need not look."""
    materials = {block.as_pointer(): block for block in depsgraph.ids if isinstance(block, bpy.types.Material)}
    for material in filter(None, map(materials.get, surfaces.indices)):  # in the order of their use
        if message := unseen_message(read_shader(material)):
            surfaces.warnings.add(material.name, message)


def render_reader(depsgraph, kept_images: dict[tuple, tuple] | None = None) -> SurfaceReader:
    """A new reader for a final render: it keeps temperature groups apart, and instances, if the scene asks for them.

    kept_images: of an earlier reader, see TextureReader.
    """
    infrared, warnings = depsgraph.scene_eval.infrared, Warnings()
    groups = GroupReader() if infrared.group_exr_path else None
    categories = Categories(warnings) if infrared.label_path else None
    return SurfaceReader(depsgraph, warnings, groups=groups, kept_images=kept_images, categories=categories)


def read_contents(depsgraph, surfaces: SurfaceReader, space=None, camera=None) -> dict:
    """The arguments of Scene, without the camera, for all that the depsgraph's view layer shows.

    surfaces: a new reader, which is filled. space: the 3D viewport whose local view counts; None is a render. camera:
    see read_scene; it only tells how fine hair is.
    Raises SceneError as read_scene does.
    """
    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    surfaces.ambient_temperature, surfaces.default = read_defaults(scene.infrared)
    warnings, lights, known, metres = surfaces.warnings, [], set(), metres_per_unit(scene)
    surfaces.metres = metres
    surfaces.pixel_size, hiding = _pixel_size(depsgraph, camera or scene.camera), set()
    for instance, matrix, visibility in _shown_instances(depsgraph, space):
        obj, surfaces.instancer = instance.object, instance.parent
        if visibility.hidden & ~Hidden.CAMERA and obj.type in FACED:
            hiding.add(obj.name)
        asks = obj.type in (*FACED, "LIGHT", "VOLUME")
        if asks and obj.name_full not in known:  # all instances of an object ask for the same
            known.add(obj.name_full)
            for message in ignored_settings(obj, layer):
                warnings.add(obj.name, message)
        if message := left_out_instance(instance):
            warnings.add(obj.name, message)
        if obj.type in FACED:
            if instance.show_self:
                surfaces.add(obj, matrix, visibility)
            if instance.show_particles:
                source = instance.instance_object or obj
                surfaces.add_particle_hair(obj, matrix, source, not instance.show_self, visibility)
        elif obj.type == "VOLUME":
            surfaces.add_volume(obj, matrix)
        elif obj.type == "LIGHT":
            lights.extend(read_light(obj, matrix, metres))
            if message := uneven_beam(obj.data, matrix):
                warnings.add(obj.name, message)
            if remark := driver_remark(obj):
                warnings.add(obj.name, remark)
            if surfaces.groups is not None and read_group(obj, f"Light '{obj.name}'"):
                warnings.add(obj.name, UNGROUPED_LIGHT)
    check_faces(layer, bool(surfaces.triangles))
    world = layer_world(scene, layer)
    if world is not None and (remark := driver_remark(world)):
        warnings.add(world.name, remark)
    for remark in setting_remarks(scene):
        warnings.add(scene.name, remark)
    arrays = surfaces.arrays(world)
    if any(medium.scatters for medium in arrays.get("media", ())):
        for name in sorted(hiding):
            warnings.add(name, HIDDEN_IN_FOG)
    return arrays | {
        "band_edges": read_band_edges(scene.infrared),
        **_surroundings(world),
        "lights": tuple(lights),
        "response": read_response(scene.infrared),
    }


def _surroundings(world) -> dict:
    """The arguments of Scene that say what rays see that leave it."""
    sky = None if world is None else read_sky(world)
    return {"world_temperature": world_temperature(world)} if sky is None else {"sky": sky}


def _pixel_size(depsgraph, camera) -> PixelSize | None:
    """The size of a pixel of a camera object anywhere, None without a camera that takes pictures."""
    try:
        return partial(pixel_size, read_camera(depsgraph, camera, Warnings()))
    except SceneError:  # reported where the camera itself is needed
        return None


def _shown_instances(depsgraph, space) -> Iterator[tuple[bpy.types.DepsgraphObjectInstance, np.ndarray, Visibility]]:
    """The evaluated objects that are shown, or of which only hair is, once for each instance, their (4, 4) float64
    matrices to the world, and what the camera sees of them."""
    layer = depsgraph.view_layer_eval
    for instance in depsgraph.object_instances:
        if not (instance.show_self or instance.show_particles):
            continue
        if space and not (instance.parent or instance.object).visible_in_viewport_get(space):
            continue
        visibility = read_visibility(instance.object, instance.parent or instance.object, layer)
        yield instance, np.array(instance.matrix_world, dtype=np.float64), visibility


def check_faces(layer, found: bool) -> None:
    """Raise SceneError, naming the view layer, unless faces to render were found in it."""
    if not found:
        why = "no visible object has faces, but of gas, which needs a surface, however far"
        raise SceneError(f"View layer '{layer.name}' has nothing to render: {why}")
