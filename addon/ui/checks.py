# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong or worth knowing before a render: in the Checks panel, and in the panel of the property concerned.

Whether a value can be rendered, the scene's reader decides; nothing here judges it a second time.
"""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from bpy.app.handlers import persistent
from bpy.types import Panel

from .panels import SURFACE_TYPES, INFRARED_PT_light, INFRARED_PT_object, InfraredPanel

LISTED = 8  # messages of a kind; more are counted
LOST = 0.02  # share of a sensor's signal outside the bands that is worth a warning
SLACK = 1e-4  # um: settings are float32, so 14 um may be 14.0000001
SLOW = 0.01  # s: what takes longer is not done each time that a panel is drawn

ICONS = {"ERROR": "ERROR", "WARNING": "QUESTION", "HINT": "INFO"}


@dataclass(frozen=True)
class Check:
    """level: an 'ERROR' stops the render, a 'WARNING' may not be meant, a 'HINT' says what counts. text: why."""

    level: str
    text: str


def problems(read: Callable, *arguments) -> list[Check]:
    """The error with which a render stops where it reads something in the same way, if there is one."""
    from ..reading.scene_reader import SceneError

    try:
        read(*arguments)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    return []


def settings_checks(infrared) -> list[Check]:
    """What is to be said of the solver's settings."""
    from ..reading.scene_reader import read_settings

    return problems(read_settings, infrared)


def material_checks(material, infrared) -> list[Check]:
    """What is to be said of a material's emissivity, specular share and roughness."""
    from ..reading.scene_reader import SceneError, read_band_range, read_material

    owner = f"Material '{material.name}'"
    try:
        wavelengths, _ = read_material(material, infrared.default_emissivity).curve
    except SceneError as error:
        return [Check("ERROR", str(error))]
    if material.get("emissivity") is None:
        return [Check("HINT", f"{owner}: no emissivity; the default {infrared.default_emissivity:.3g} counts")]
    try:
        low, high = read_band_range(infrared)
    except SceneError:
        return []  # reported for the bands
    first, last = wavelengths[0], wavelengths[-1]
    if len(wavelengths) > 1 and (low < first - SLACK or high > last + SLACK):
        return [
            Check(
                "WARNING",
                f"{owner}: emissivity is known from {first:.4g} to {last:.4g} µm; the bands reach from {low:.4g} "
                f"to {high:.4g} µm, where the nearest value is held",
            )
        ]
    return []


def sensor_checks(infrared) -> list[Check]:
    """What is to be said of the sensor and the bands that it sees through."""
    from ..reading.scene_reader import SceneError, read_band_range, read_response
    from ..solver.physics.sensors import share_outside
    from ..solver.scene import check_response

    try:
        low, high = read_band_range(infrared)
    except SceneError:
        return []  # reported for the bands
    try:
        response = read_response(infrared)
        check_response(response, (low, high))
    except SceneError as error:
        return [Check("ERROR", str(error))]
    lost = 0.0 if response is None else share_outside(response, low, high, infrared.ambient_temperature)
    if lost <= LOST:
        return []
    text = (
        f"Sensor '{response.name}': {lost:.0%} of its signal at {infrared.ambient_temperature:.5g} K lies outside the "
    )
    return [Check("WARNING", text + f"bands from {low:.4g} to {high:.4g} µm, which act as a filter")]


def detector_checks(scene) -> list[Check]:
    """What is to be said of the camera effects; of the camera itself, `camera_checks` says it."""
    from ..rendering.camera_effects import read_detector

    if not scene.infrared.use_detector or scene.camera is None or scene.camera.type != "CAMERA":
        return []
    if any(check.level == "ERROR" for check in sensor_checks(scene.infrared)):
        return []  # the bands' weights make no sense
    return problems(read_detector, scene, scene.camera)


def camera_checks(scene, depsgraph) -> list[Check]:
    """What is to be said of the scene's camera."""
    from ..reading.camera_reader import read_camera
    from ..reading.scene_reader import Warnings

    warnings = Warnings()
    found = problems(read_camera, depsgraph, scene.camera, warnings)
    return found + [Check("WARNING", message) for message in warnings.messages()]


def object_checks(obj, infrared, depsgraph) -> list[Check]:
    """What is to be said of an object; nothing of one that neither emits nor shines."""
    return _temperature_checks(obj, infrared, depsgraph) + _ignored_checks(obj)


def _ignored_checks(obj) -> list[Check]:
    from ..reading.scene_reader import ignored_settings

    if obj.type not in SURFACE_TYPES and obj.type != "LIGHT":
        return []
    messages = ignored_settings(obj, bpy.context.view_layer)
    return [Check("WARNING", f"{_owner(obj)}: {message}") for message in messages]


def _owner(obj) -> str:
    return f"{'Light' if obj.type == 'LIGHT' else 'Object'} '{obj.name}'"


def _temperature_checks(obj, infrared, depsgraph) -> list[Check]:
    from ..reading.scene_reader import object_temperatures, read_light
    from ..reading.surface_temperature import temperature_source

    if obj.type == "LIGHT":
        return problems(read_light, obj, np.array(obj.matrix_world, dtype=np.float64))
    if obj.type not in SURFACE_TYPES:
        return []
    if obj.get("temperature") is None and temperature_source(obj, depsgraph) == "AMBIENT":
        ambient = f"the ambient {infrared.ambient_temperature:.5g} K counts"
        return [Check("HINT", f"Object '{obj.name}': no temperature; {ambient}")]
    return problems(object_temperatures, obj, 0.0)


def _evaluated(view_layer):
    """The depsgraph of a view layer. It has none before its first evaluation."""
    return view_layer.depsgraph or bpy.context.evaluated_depsgraph_get()


def scene_checks(scene, view_layer) -> list[Check]:
    """All of a scene, in the order of their weight: errors, warnings, hints. What is not rendered is passed over."""
    from ..reading import scene_reader as reader
    from ..rendering.render_passes import render_passes
    from ..rendering.render_paths import check_paths
    from ..solver.physics import library

    infrared = scene.infrared
    depsgraph = _evaluated(view_layer)
    objects = reader.rendered_objects(reader.layer_objects(view_layer.layer_collection))
    override = view_layer.material_override
    slots = (slot.material for obj in objects if obj.type in SURFACE_TYPES for slot in obj.material_slots)
    materials = [override] if override else dict.fromkeys(material for material in slots if material is not None)
    found = problems(check_paths, infrared)
    found += settings_checks(infrared)
    found += problems(reader.read_defaults, infrared)
    found += problems(render_passes, scene, view_layer)
    found += sensor_checks(infrared)
    found += detector_checks(scene)
    found += camera_checks(scene, depsgraph)
    found += [Check("WARNING", message) for message in reader.ignored_scene_settings(scene, view_layer)]
    found += problems(reader.check_faces, view_layer, any(map(reader.may_have_faces, objects)))
    found += [Check("WARNING", f"My materials: {problem}") for problem in [library.user_problem()] if problem]
    found += problems(reader.world_temperature, reader.layer_world(scene, view_layer))
    for material in materials:
        found += material_checks(material, infrared)
    for obj in objects:
        found += object_checks(obj, infrared, depsgraph)
    if infrared.group_exr_path:
        found += problems(reader.read_group_temperatures, scene, view_layer)
    return sorted(dict.fromkeys(found), key=lambda check: list(ICONS).index(check.level))


# What panels show -----------------------------------------------------------------------------------------------------

_kept = {}  # what was found in a scene, if it took long: until the next change


def kept(scene, what: str, find: Callable):
    """What find() gives: looked for again after each change of the scene, or at once if that is quick.

    what: its name among the things found in a scene. While an animation plays its frames do not count as changes.
    """
    playing = bpy.context.screen is not None and bpy.context.screen.is_animation_playing
    key = scene.session_uid, what, None if playing else scene.frame_current
    if key in _kept:
        return _kept[key]
    begin = time.perf_counter()
    result = find()
    if time.perf_counter() - begin > SLOW:
        _kept[key] = result
    return result


@persistent
def forget(*_):
    """After an edit, another file or a step of undo."""
    _kept.clear()


# Panels ---------------------------------------------------------------------------------------------------------------


class INFRARED_PT_checks(InfraredPanel, Panel):
    bl_label = "Checks"

    def draw(self, context):
        scene, layer = context.scene, context.view_layer
        checks = kept(scene, f"checks of {layer.name}", lambda: scene_checks(scene, layer))
        for level in ICONS:
            of_level = [check for check in checks if check.level == level]
            draw_checks(self.layout, of_level[:LISTED], context.region)
            if len(of_level) > LISTED:
                self.layout.label(text=f"and {len(of_level) - LISTED} more", icon=ICONS[level])
        if not checks:
            self.layout.label(text="Nothing to report", icon="CHECKMARK")


def draw_object_checks(self, context):
    """Under the object's temperature."""
    obj, scene = context.object, context.scene
    if obj is not None:
        depsgraph = _evaluated(context.view_layer)
        checks = kept(scene, f"checks of {obj.session_uid}", lambda: object_checks(obj, scene.infrared, depsgraph))
        draw_problems(self.layout, checks, context.region)


def draw_problems(layout, checks: list[Check], region) -> None:
    """Without the hints: the panel of a property itself says what counts where nothing is set."""
    draw_checks(layout, [check for check in checks if check.level != "HINT"], region)


def draw_checks(layout, checks: list[Check], region) -> None:
    """Each as text that is broken to the region's width; hints are quiet."""
    scale = bpy.context.preferences.system.ui_scale
    width = max(20, int(region.width / (7.0 * scale)) - 8)  # letters are about 7 pixels wide
    for check in checks:
        column = layout.column(align=True)
        column.scale_y = 0.8
        column.active = check.level != "HINT"
        for i, line in enumerate(textwrap.wrap(check.text, width)):
            column.label(text=line, icon="BLANK1" if i else ICONS[check.level])


HANDLERS = {
    "depsgraph_update_post": forget,
    "load_post": forget,
    "undo_post": forget,
    "redo_post": forget,
}


def register():
    bpy.utils.register_class(INFRARED_PT_checks)
    for panel in (INFRARED_PT_object, INFRARED_PT_light):
        panel.append(draw_object_checks)
    for event, handler in HANDLERS.items():
        getattr(bpy.app.handlers, event).append(handler)


def unregister():
    for event, handler in HANDLERS.items():
        getattr(bpy.app.handlers, event).remove(handler)
    for panel in (INFRARED_PT_object, INFRARED_PT_light):
        panel.remove(draw_object_checks)
    bpy.utils.unregister_class(INFRARED_PT_checks)
    forget()
