# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong or worth knowing before a render: in the Checks panel, and in the panel of the property concerned.

Whether a value can be rendered, the scene's reader decides; nothing here judges it a second time.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import bpy
from bpy.app.handlers import persistent
from bpy.types import Panel

from .panels import SURFACE_TYPES, INFRARED_PT_light, INFRARED_PT_object, InfraredPanel, band_problem

LISTED = 8  # messages of a kind; more are counted
LOST = 0.02  # share of a sensor's signal outside the bands that is worth a warning
SLACK = 1e-4  # um: settings are float32, so 14 um may be 14.0000001

ICONS = {"ERROR": "ERROR", "WARNING": "QUESTION", "HINT": "INFO"}


@dataclass(frozen=True)
class Check:
    """level: an 'ERROR' stops the render, a 'WARNING' may not be meant, a 'HINT' says what counts. text: why."""

    level: str
    text: str


def material_checks(material, infrared) -> list[Check]:
    """What is to be said of a material's emissivity, specular share and roughness."""
    from .scene_reader import SceneError, read_band_range, read_material

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
    from .scene_reader import SceneError, read_band_range, read_response
    from .solver.scene import check_response
    from .solver.sensors import share_outside

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
    """What is to be said of the camera effects; of the camera itself, the render says it."""
    from .camera_effects import read_detector
    from .scene_reader import SceneError, read_band_edges, read_response
    from .solver.scene import check_response

    if not scene.infrared.use_detector or scene.camera is None or scene.camera.type != "CAMERA":
        return []
    try:
        check_response(read_response(scene.infrared), read_band_edges(scene.infrared))
    except SceneError:
        return []  # reported for the bands and the sensor
    try:
        read_detector(scene, scene.camera)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    return []


def object_checks(obj, infrared) -> list[Check]:
    """What is to be said of an object; nothing of one that neither emits nor shines."""
    return _temperature_checks(obj, infrared) + _ignored_checks(obj)


def _ignored_checks(obj) -> list[Check]:
    from .scene_reader import ignored_settings

    if obj.type not in SURFACE_TYPES and obj.type != "LIGHT":
        return []
    messages = ignored_settings(obj, bpy.context.view_layer)
    return [Check("WARNING", f"{_owner(obj)}: {message}") for message in messages]


def _owner(obj) -> str:
    return f"{'Light' if obj.type == 'LIGHT' else 'Object'} '{obj.name}'"


def _temperature_checks(obj, infrared) -> list[Check]:
    if obj.type == "MESH" and "temperature" in obj.data.attributes:
        problem = attribute_problem(obj.data, obj.name)
        return [Check("ERROR", problem)] if problem else []
    if obj.type not in SURFACE_TYPES and obj.type != "LIGHT":
        return []
    temperature = obj.get("temperature")
    if temperature is not None:
        return _number_checks(obj, _owner(obj))
    if obj.type == "LIGHT":
        return []
    ambient = f"the ambient {infrared.ambient_temperature:.5g} K counts"
    return [Check("HINT", f"Object '{obj.name}': no temperature; {ambient}")]


def _number_checks(id_block, owner: str) -> list[Check]:
    from .scene_reader import SceneError, read_temperature

    try:
        read_temperature(id_block, 0.0, owner)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    return []


def scene_checks(scene, view_layer) -> list[Check]:
    """All of a scene, in the order of their weight: errors, warnings, hints. What is not rendered is passed over."""
    from .solver import library

    infrared = scene.infrared
    objects = [obj for obj in view_layer.objects if not obj.hide_render]
    override = view_layer.material_override
    slots = (slot.material for obj in objects if obj.type in SURFACE_TYPES for slot in obj.material_slots)
    materials = [override] if override else dict.fromkeys(material for material in slots if material is not None)
    found = [Check("ERROR", problem) for problem in [band_problem(infrared)] if problem]
    found += sensor_checks(infrared)
    found += detector_checks(scene)
    found += [Check("WARNING", f"My materials: {problem}") for problem in [library.user_problem()] if problem]
    if scene.world is not None:
        found += _number_checks(scene.world, f"World '{scene.world.name}'")
    for material in materials:
        found += material_checks(material, infrared)
    for obj in objects:
        found += object_checks(obj, infrared)
    return sorted(found, key=lambda check: list(ICONS).index(check.level))


# The attribute `temperature` ------------------------------------------------------------------------------------------

_problems = {}  # session_uid of a mesh -> why its attribute cannot be rendered, or an empty text


def attribute_problem(mesh, owner: str) -> str:
    """Why the mesh's attribute `temperature` cannot be rendered, or an empty text. Read once after each change."""
    import numpy as np

    from .scene_reader import SceneError, check_temperature

    if mesh.session_uid not in _problems:
        attribute, problem = mesh.attributes["temperature"], ""
        if attribute.data_type == "FLOAT" and len(attribute.data):  # else the object's temperature counts
            values = np.empty(len(attribute.data), dtype=np.float32)
            attribute.data.foreach_get("value", values)
            try:
                for value in (values.min(), values.max()):  # NaN is both
                    check_temperature(value, f"Attribute 'temperature' of object '{owner}'")
            except SceneError as error:
                problem = str(error)
        _problems[mesh.session_uid] = problem
    return _problems[mesh.session_uid]


@persistent
def forget_changed(_scene, depsgraph):
    """After an edit: read the attributes of the meshes that it changed again."""
    for update in depsgraph.updates:
        if update.is_updated_geometry:
            data = update.id.data if isinstance(update.id, bpy.types.Object) else update.id
            if isinstance(data, bpy.types.Mesh):
                _problems.pop(data.original.session_uid, None)


@persistent
def forget_all(*_):
    """After another file or a step of undo."""
    _problems.clear()


# Panels ---------------------------------------------------------------------------------------------------------------


class INFRARED_PT_checks(InfraredPanel, Panel):
    bl_label = "Checks"

    def draw(self, context):
        checks = scene_checks(context.scene, context.view_layer)
        for level in ICONS:
            of_level = [check for check in checks if check.level == level]
            draw_checks(self.layout, of_level[:LISTED], context.region)
            if len(of_level) > LISTED:
                self.layout.label(text=f"and {len(of_level) - LISTED} more", icon=ICONS[level])
        if not checks:
            self.layout.label(text="Nothing to report", icon="CHECKMARK")


def draw_object_checks(self, context):
    """Under the object's temperature."""
    if context.object is not None:
        draw_problems(self.layout, object_checks(context.object, context.scene.infrared), context.region)


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
    "depsgraph_update_post": forget_changed,
    "load_post": forget_all,
    "undo_post": forget_all,
    "redo_post": forget_all,
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
    _problems.clear()
