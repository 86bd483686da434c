# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures as colours in the 3D viewport's Solid mode: a color attribute in every mesh, and back again.

What has to be put back is kept beside what was changed, so that a saved file can still be cleaned: a screen keeps how
its viewports were shaded, a mesh which color attributes were chosen. Removing the map removes these, too.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty
from bpy.types import Operator

from ...heat_settings import in_scene_unit
from ...interface import temperature_property
from ...output.palette import thermal
from ...properties import ROOM_TEMPERATURE
from ...reading.surface_temperature import vertex_temperatures
from ...reading.temperature_fields import TemperatureError

NAME = "Infrared Heat Map"  # of the color attribute
KEPT = "infrared_heat_map"  # custom property of screens and meshes: what to put back
SHADING = {"type": "SOLID", "color_type": "VERTEX", "light": "FLAT"}  # flat: only then a colour is a temperature
PLAIN = {"type": "SOLID", "color_type": "MATERIAL", "light": "STUDIO"}  # as in a new file


def paint(mesh, domain: str, colours: np.ndarray) -> None:
    """Make colours (n, 3), linear Rec.709, the mesh's active color attribute, the heat map."""
    layers = mesh.color_attributes
    if KEPT not in mesh:
        mesh[KEPT] = [layers.active_color_name, layers.default_color_name]
    attribute = layers.get(NAME)
    if attribute is not None and attribute.domain != domain:
        layers.remove(attribute)
        attribute = None
    if attribute is None:
        attribute = layers.new(NAME, "FLOAT_COLOR", domain)
    opaque = np.ones((len(colours), 4), dtype=np.float32)
    opaque[:, :3] = colours
    attribute.data.foreach_set("color", opaque.ravel())
    layers.active_color_name = NAME
    mesh.update_tag()


def clean(mesh) -> None:
    """Take the heat map out of a mesh, with every trace of it."""
    layers = mesh.color_attributes
    attribute = layers.get(NAME)
    if attribute is not None:
        layers.remove(attribute)
    if KEPT in mesh:
        layers.active_color_name, layers.default_color_name = mesh[KEPT]
        del mesh[KEPT]
    mesh.update_tag()


def viewports(screen):
    """(key, shading) of the 3D viewports of a screen."""
    for index, area in enumerate(screen.areas):
        if area.type == "VIEW_3D":
            yield str(index), area.spaces.active.shading


def area_types(screen) -> str:
    """The types of a screen's areas. If they change, areas were split or joined, and the keys of viewports are void."""
    return " ".join(area.type for area in screen.areas)


def shade(shading, values) -> None:
    """Set the members of SHADING of a viewport."""
    shading.type = "SOLID"  # color_type and light belong to this type
    for member, value in reversed(list(zip(SHADING, values, strict=True))):
        setattr(shading, member, value)


def is_shown(screen) -> bool:
    """Whether a screen's viewports show the heat map."""
    return screen is not None and KEPT in screen


def shown_range(screen) -> tuple[float, float]:
    """The temperatures, K, of the two ends of the palette in a screen that shows the heat map."""
    return tuple(screen[KEPT]["range"])


def show_in(screen, low: float, high: float) -> None:
    """Let the viewports of a screen show color attributes; remember how they were, and the range."""
    kept = screen[KEPT].to_dict() if KEPT in screen else {}
    kept["range"] = [low, high]
    kept.setdefault("areas", area_types(screen))
    for key, shading in viewports(screen):
        kept.setdefault(key, [getattr(shading, member) for member in SHADING])
        shade(shading, SHADING.values())
    screen[KEPT] = kept


def hide_in(screen) -> bool:
    """Shade the viewports of a screen as before the map; if its areas have changed, plainly, and return False."""
    kept = screen[KEPT].to_dict()
    same_areas = kept.get("areas", area_types(screen)) == area_types(screen)
    for key, shading in viewports(screen):
        if not same_areas:
            shade(shading, PLAIN.values())
        elif key in kept:
            shade(shading, kept[key])
    del screen[KEPT]
    return same_areas


class INFRARED_OT_heat_map_show(Operator):
    """Show temperatures as colors in the 3D viewport, or update these colors"""

    bl_idname = "infrared.heat_map_show"
    bl_label = "Show Heat Map"
    bl_options = {"REGISTER", "UNDO"}

    automatic: BoolProperty(
        name="Automatic Range", description="From the coldest to the hottest visible object", default=True
    )
    low: temperature_property("Low", "Temperature of the palette's dark end", ROOM_TEMPERATURE, min=0.0)
    high: temperature_property("High", "Temperature of the palette's bright end", ROOM_TEMPERATURE + 50.0, min=0.0)

    @classmethod
    def poll(cls, context):
        if context.mode == "EDIT_MESH":
            cls.poll_message_set("Leave Edit Mode first")
            return False
        return context.screen is not None

    def draw(self, _context):
        column = self.layout.column()
        column.use_property_split = True
        column.prop(self, "automatic")
        limits = column.column(align=True)
        limits.active = not self.automatic
        limits.prop(self, "low")
        limits.prop(self, "high")

    def execute(self, context):
        depsgraph, scene = context.evaluated_depsgraph_get(), context.scene
        found, skipped = {}, []
        try:
            for obj in context.visible_objects:
                if obj.type != "MESH":
                    continue
                if obj.data.is_editable and obj.data not in found:
                    found[obj.data] = vertex_temperatures(obj, depsgraph, scene)
                elif not obj.data.is_editable or self._differs(found[obj.data], obj, depsgraph, scene):
                    skipped.append(obj.name)
        except TemperatureError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        filled = [kelvin for _, kelvin in found.values() if kelvin.size]
        if not filled:
            self.report({"ERROR"}, "No visible mesh can be painted")
            return {"CANCELLED"}
        if self.automatic:
            self.low, self.high = float(min(k.min() for k in filled)), float(max(k.max() for k in filled))
        for mesh, (domain, kelvin) in found.items():
            paint(mesh, domain, thermal(kelvin, self.low, self.high))
        show_in(context.screen, self.low, self.high)
        if skipped:
            self.report(
                {"WARNING"}, f"Not in the heat map, their meshes are linked or shared: {', '.join(skipped[:5])}"
            )
        else:
            ends = " to ".join(in_scene_unit(kelvin, scene) for kelvin in (self.low, self.high))
            self.report({"INFO"}, f"Heat map from {ends}")
        return {"FINISHED"}

    @staticmethod
    def _differs(painted, obj, depsgraph, scene) -> bool:
        """Whether an object that shares a mesh has temperatures other than those painted."""
        domain, kelvin = vertex_temperatures(obj, depsgraph, scene)
        return domain != painted[0] or not np.array_equal(kelvin, painted[1])


class INFRARED_OT_heat_map_hide(Operator):
    """Remove the heat map, and shade the 3D viewport as before"""

    bl_idname = "infrared.heat_map_hide"
    bl_label = "Hide Heat Map"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.mode != "EDIT_MESH"

    def execute(self, _context):
        for mesh in bpy.data.meshes:
            if mesh.is_editable and (KEPT in mesh or NAME in mesh.color_attributes):
                clean(mesh)
        restored = [hide_in(screen) for screen in bpy.data.screens if is_shown(screen)]
        if not all(restored):
            self.report({"WARNING"}, "Editors were split or joined meanwhile: 3D viewports are in Solid mode now")
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_heat_map_show, INFRARED_OT_heat_map_hide))
