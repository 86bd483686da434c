# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that give temperatures to objects, and over their surfaces, and the menus of these operators."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy.types import Menu, Operator
from bpy_extras.io_utils import ImportHelper

from ...heat_settings import in_scene_unit
from ...interface import temperature_property
from ...output.temperature_scale import UNITS
from ...properties import ROOM_TEMPERATURE, add_custom_property, initial_value
from ...reading.arrays import read_values, same_elements
from ...reading.images import image_channel
from ...reading.objects import SURFACE_TYPES
from ...reading.surface_temperature import DOMAINS, NAME, own_temperature
from ...reading.temperature_fields import (
    TemperatureError,
    check_kelvin,
    pick_channel,
    read_points,
    sample_image,
    spread,
)
from .temperature_sources import (
    check_writable,
    interpolate,
    selected_meshes,
    vertex_weights,
    write_temperature,
)

UNIT_ITEMS = (
    ("KELVIN", "Kelvin", "", 0),
    ("CELSIUS", "Celsius", "", 1),
    ("FAHRENHEIT", "Fahrenheit", "", 2),
)
CHANNELS = (
    ("LUMINANCE", "Luminance", "Brightness of the color, from linear Rec.709", 0),
    ("R", "Red", "", 1),
    ("G", "Green", "", 2),
    ("B", "Blue", "", 3),
    ("A", "Alpha", "", 4),
)


# Operators over surfaces ----------------------------------------------------------------------------------------------


def can_write(operator, context) -> bool:
    """Whether there are meshes to write to; tells the operator's tooltip why not."""
    if context.mode == "EDIT_MESH":
        operator.poll_message_set("Leave Edit Mode first")
        return False
    if not any(obj.type == "MESH" for obj in context.selected_objects):
        operator.poll_message_set("Select a mesh object")
        return False
    return True


class SurfaceOperator:
    """Base of operators that write the attribute to the meshes of all selected objects, or to none of them."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return can_write(cls, context)

    def invoke(self, context, _event):
        self.prepare(selected_meshes(context)[0])
        return context.window_manager.invoke_props_dialog(self, width=360)

    def prepare(self, obj):
        """Choose names that `obj` has, where those of the last time do not fit."""

    def execute(self, context):
        objects = selected_meshes(context)
        try:
            for obj in objects:
                check_writable(obj)
            results = [(obj, *self.temperatures(context, obj)) for obj in objects]
            with np.errstate(over="ignore"):  # what float32 cannot hold is infinite, and refused
                results = [(obj, domain, kelvin.astype(np.float32)) for obj, domain, kelvin in results]
            for obj, _, kelvin in results:
                check_kelvin(kelvin, f"Object '{obj.name}'")
        except TemperatureError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for obj, domain, kelvin in results:
            write_temperature(obj.data, domain, kelvin)
        filled = [kelvin for *_, kelvin in results if kelvin.size]
        if filled:
            low, high = min(k.min() for k in filled), max(k.max() for k in filled)
            names = ", ".join(f"'{obj.name}'" for obj in objects[:3]) + (", ..." if len(objects) > 3 else "")
            text = " to ".join(in_scene_unit(float(kelvin), context.scene) for kelvin in (low, high))
            self.report({"INFO"}, f"Temperatures of {names}: {text}")
        return {"FINISHED"}

    def temperatures(self, context, obj):
        """The domain and the temperatures, K (n,), for the mesh of an object. Raises TemperatureError."""
        raise NotImplementedError


class RangeOperator(SurfaceOperator):
    """Base of operators on sources whose 0..1 becomes a range of temperatures."""

    low: temperature_property("At 0", "Temperature where the source is 0", ROOM_TEMPERATURE)
    high: temperature_property("At 1", "Temperature where the source is 1", ROOM_TEMPERATURE + 50.0)

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        self.draw_source(column, selected_meshes(context)[0])
        column.prop(self, "low")
        column.prop(self, "high")

    def temperatures(self, context, obj):
        domain, shares = self.shares(context, obj)
        return domain, spread(shares, self.low, self.high)


class INFRARED_OT_temperature_from_vertex_group(RangeOperator, Operator):
    """Set temperatures over the selected meshes from the weights of a vertex group"""

    bl_idname = "infrared.temperature_from_vertex_group"
    bl_label = "Temperature from Vertex Group"

    group: StringProperty(name="Vertex Group", description="Name of the group; empty is the active one")

    def prepare(self, obj):
        if self.group not in obj.vertex_groups and obj.vertex_groups.active:
            self.group = obj.vertex_groups.active.name

    def draw_source(self, column, obj):
        column.prop_search(self, "group", obj, "vertex_groups")

    def shares(self, context, obj):
        active = obj.vertex_groups.active
        name = self.group or (active.name if active else "")
        if name not in obj.vertex_groups:
            raise TemperatureError(f"Object '{obj.name}' has no vertex group '{name}'")
        return "POINT", vertex_weights(context, obj, name)


class INFRARED_OT_temperature_from_colors(RangeOperator, Operator):
    """Set temperatures over the selected meshes from a color attribute"""

    bl_idname = "infrared.temperature_from_colors"
    bl_label = "Temperature from Color Attribute"

    attribute: StringProperty(name="Color Attribute", description="Name of the attribute; empty is the active one")
    channel: EnumProperty(name="Channel", items=CHANNELS)

    def prepare(self, obj):
        colours = obj.data.color_attributes
        if self.attribute not in colours and colours.active_color:
            self.attribute = colours.active_color.name

    def draw_source(self, column, obj):
        column.prop_search(self, "attribute", obj.data, "color_attributes")
        column.prop(self, "channel")

    def shares(self, _context, obj):
        colours = obj.data.color_attributes
        attribute = colours.get(self.attribute) if self.attribute else colours.active_color
        if attribute is None:
            raise TemperatureError(f"Object '{obj.name}' has no color attribute '{self.attribute}'")
        return attribute.domain, pick_channel(read_values(attribute.data, "color", np.float32, 4), self.channel)


class INFRARED_OT_temperature_from_image(RangeOperator, Operator):
    """Set temperatures over the selected meshes from an image, laid on by a UV map"""

    bl_idname = "infrared.temperature_from_image"
    bl_label = "Temperature from Image"

    image: StringProperty(name="Image", description="Name of an image in this file")
    uv_map: StringProperty(name="UV Map", description="Name of the UV map; empty is the active one")
    channel: EnumProperty(name="Channel", items=CHANNELS)
    extension: EnumProperty(
        name="Outside",
        description="What lies outside the image",
        items=(
            ("REPEAT", "Repeat", "The image again", 0),
            ("EXTEND", "Clamp", "The image's border", 1),
        ),
    )

    def prepare(self, obj):
        if self.image not in bpy.data.images and bpy.data.images:
            self.image = bpy.data.images[0].name
        if self.uv_map not in obj.data.uv_layers:
            self.uv_map = ""

    def draw_source(self, column, obj):
        column.prop_search(self, "image", bpy.data, "images")
        column.prop_search(self, "uv_map", obj.data, "uv_layers")
        column.prop(self, "channel")
        column.prop(self, "extension")

    def execute(self, context):
        image = bpy.data.images.get(self.image)
        try:
            if image is None:
                raise TemperatureError(f"There is no image '{self.image}'")
            self.pixels = image_channel(image, self.channel)  # once for all objects
        except TemperatureError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return super().execute(context)

    def shares(self, _context, obj):
        layers = obj.data.uv_layers
        layer = layers.get(self.uv_map) if self.uv_map else layers.active
        if layer is None:
            raise TemperatureError(f"Object '{obj.name}' has no UV map '{self.uv_map}'")
        uv = read_values(layer.uv, "vector", np.float32, 2)
        return "CORNER", sample_image(self.pixels, uv, self.extension)


class INFRARED_OT_temperature_from_points(SurfaceOperator, ImportHelper, Operator):
    """Set temperatures over the selected meshes from measured or simulated points in a file: x, y, z, temperature"""

    bl_idname = "infrared.temperature_from_points"
    bl_label = "Temperature from Points"

    filter_glob: StringProperty(default="*.csv;*.txt;*.tsv;*.dat", options={"HIDDEN"})
    unit: EnumProperty(name="Unit", description="Unit of the temperatures in the file", items=UNIT_ITEMS)
    space: EnumProperty(
        name="Space",
        description="What the positions in the file refer to",
        items=(
            ("WORLD", "World", "The scene, in Blender units", 0),
            ("LOCAL", "Object", "Each object's own origin, axes and scale", 1),
        ),
    )
    neighbours: IntProperty(
        name="Nearest Points", description="How many points count for a vertex", default=8, min=1, soft_max=64
    )
    power: FloatProperty(
        name="Power",
        description="A point counts with 1 / distance to this power: high makes plateaus, low smooths",
        default=2.0,
        min=0.1,
        soft_max=8.0,
    )
    reach: FloatProperty(
        name="Largest Distance",
        description="Points farther away do not count; without any the object's own temperature stays. 0 is no limit",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
        unit="LENGTH",
    )

    def invoke(self, context, event):
        return ImportHelper.invoke(self, context, event)

    def execute(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        try:
            self.points, values = read_points(path)
            self.kelvin = UNITS[self.unit].in_kelvin(values)
            check_kelvin(self.kelvin, f"File '{path.name}'")
            _refuse_shared_meshes(context)
        except TemperatureError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return super().execute(context)

    def temperatures(self, context, obj):
        positions = read_values(obj.data.vertices, "co", np.float32, 3).astype(np.float64)
        if self.space == "WORLD":
            matrix = np.array(obj.matrix_world, dtype=np.float64)
            positions = positions @ matrix[:3, :3].T + matrix[:3, 3]
        if not np.isfinite(positions).all():
            raise TemperatureError(f"Object '{obj.name}' has vertices that are not finite")
        own = own_temperature(obj, context.scene)
        reach = self.reach or np.inf
        return "POINT", interpolate(positions, self.points, self.kelvin, self.neighbours, self.power, reach, own)


def _refuse_shared_meshes(context) -> None:
    """Raise TemperatureError if selected objects share a mesh: each has positions and temperatures of its own."""
    owners = {}
    for obj in context.selected_objects:
        if obj.type == "MESH" and owners.setdefault(obj.data, obj) != obj:
            raise TemperatureError(
                f"Objects '{owners[obj.data].name}' and '{obj.name}' share the mesh '{obj.data.name}'; "
                "make it single-user first"
            )


class INFRARED_OT_temperature_from_attribute(SurfaceOperator, Operator):
    """Keep in the selected meshes the temperatures that their geometry nodes make, or that another attribute holds"""

    bl_idname = "infrared.temperature_from_attribute"
    bl_label = "Temperature from Attribute"

    attribute: StringProperty(
        name="Attribute",
        description="Name of a float attribute on points, corners or faces, after all modifiers",
        default=NAME,
    )
    unit: EnumProperty(name="Unit", description="Unit of the attribute", items=UNIT_ITEMS)

    def temperatures(self, context, obj):
        mesh = obj.evaluated_get(context.evaluated_depsgraph_get()).data
        attribute = mesh.attributes.get(self.attribute)
        owner = f"Object '{obj.name}'"
        if attribute is None:
            raise TemperatureError(f"{owner} has no attribute '{self.attribute}' after its modifiers")
        if attribute.data_type != "FLOAT" or attribute.domain not in DOMAINS:
            kind = f"{attribute.data_type.lower()} on {attribute.domain.lower()}s"
            raise TemperatureError(
                f"{owner}: attribute '{self.attribute}' is {kind}, expected float on points, corners or faces"
            )
        if not same_elements(obj.data, mesh):
            raise TemperatureError(
                f"{owner}: its modifiers change its faces ({len(obj.data.vertices)} vertices become "
                f"{len(mesh.vertices)}); apply them to keep '{self.attribute}'"
            )
        values = read_values(attribute.data, "value", np.float32).astype(np.float64)
        return attribute.domain, UNITS[self.unit].in_kelvin(values)


class INFRARED_OT_temperature_remove_attribute(Operator):
    """Remove the temperatures over the surface from all selected meshes, so that the object's temperature counts"""

    bl_idname = "infrared.temperature_remove_attribute"
    bl_label = "Remove Temperatures over the Surface"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return can_write(cls, context)

    def execute(self, context):
        kept = {obj: obj.data.attributes.get(NAME) for obj in selected_meshes(context)}
        kept = {obj: attribute for obj, attribute in kept.items() if attribute and attribute.data_type == "FLOAT"}
        if not kept:
            self.report({"WARNING"}, f"No selected mesh has a float attribute '{NAME}'")
            return {"CANCELLED"}
        linked = [obj for obj in kept if not obj.data.is_editable]
        if linked:
            self.report({"ERROR"}, f"Object '{linked[0].name}': its mesh is linked and cannot be changed")
            return {"CANCELLED"}
        for obj, attribute in kept.items():
            obj.data.attributes.remove(attribute)
            obj.data.update_tag()
        return {"FINISHED"}


# Operators on objects -------------------------------------------------------------------------------------------------


class INFRARED_OT_object_temperatures(Operator):
    """Set, copy or remove the temperature of all selected objects"""

    bl_idname = "infrared.object_temperatures"
    bl_label = "Temperature of Selected Objects"
    bl_options = {"REGISTER", "UNDO"}

    action: EnumProperty(
        name="Action",
        items=(
            ("SET", "Set", "Give all selected objects one temperature", 0),
            ("ADD", "Add Where Missing", "Give those without a temperature one, the ambient", 1),
            ("COPY", "Copy from Active", "Give all selected objects the active one's temperature", 2),
            ("REMOVE", "Remove", "Take the temperature away, so that the ambient counts", 3),
        ),
    )
    value: temperature_property(
        "Temperature", "In the scene's unit; kept in kelvin", ROOM_TEMPERATURE, soft_max=2000.0, min=0.0
    )

    @classmethod
    def description(cls, _context, properties):
        return cls.bl_rna.properties["action"].enum_items[properties.action].description

    @classmethod
    def poll(cls, context):
        return any(obj.type in SURFACE_TYPES for obj in context.selected_objects)

    def invoke(self, context, _event):
        if self.action != "SET":
            return self.execute(context)
        active = context.object
        if active is not None and isinstance(active.get(NAME), float | int):
            self.value = max(active[NAME], 0.0)
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        column = self.layout.column()
        column.use_property_split = True
        column.prop(self, "action")
        if self.action == "SET":
            column.prop(self, "value")

    def execute(self, context):
        objects = [obj for obj in context.selected_objects if obj.type in SURFACE_TYPES]
        linked = [obj for obj in objects if not obj.is_editable]
        if linked:
            self.report({"ERROR"}, f"Object '{linked[0].name}' is linked and cannot be changed")
            return {"CANCELLED"}
        value = self.value
        if self.action == "COPY":
            active = context.object
            if active is None or NAME not in active:
                self.report({"ERROR"}, f"Object '{active.name}' has no temperature" if active else "No active object")
                return {"CANCELLED"}
            try:
                value = own_temperature(active, context.scene)
            except TemperatureError as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
        for obj in objects:
            self.edit(obj, value, context.scene)
            obj.update_tag()
        return {"FINISHED"}

    def edit(self, obj, value, scene):
        if self.action == "REMOVE":
            obj.pop(NAME, None)
        elif self.action != "ADD":
            add_custom_property(obj, NAME, value)
        elif NAME not in obj:
            add_custom_property(obj, NAME, initial_value(obj, NAME, scene))


# Menus ----------------------------------------------------------------------------------------------------------------


class INFRARED_MT_surface_temperature(Menu):
    bl_label = "Temperatures over the Surface"

    def draw(self, _context):
        layout = self.layout
        layout.operator_context = "INVOKE_DEFAULT"
        for cls, text, icon in (
            (INFRARED_OT_temperature_from_vertex_group, "Vertex Group...", "GROUP_VERTEX"),
            (INFRARED_OT_temperature_from_colors, "Color Attribute...", "GROUP_VCOL"),
            (INFRARED_OT_temperature_from_image, "Image...", "IMAGE_DATA"),
            (INFRARED_OT_temperature_from_points, "Points in a File...", "FILE"),
            (INFRARED_OT_temperature_from_attribute, "Geometry Nodes or Attribute...", "GEOMETRY_NODES"),
        ):
            layout.operator(cls.bl_idname, text=text, icon=icon)
        layout.separator()
        layout.operator(INFRARED_OT_temperature_remove_attribute.bl_idname, text="Remove", icon="X")


class INFRARED_MT_object_temperatures(Menu):
    bl_label = "Selected Objects"

    def draw(self, _context):
        self.layout.operator_context = "INVOKE_DEFAULT"
        for action, text in (("SET", "Set..."), ("ADD", ""), ("COPY", ""), ("REMOVE", "")):
            item = INFRARED_OT_object_temperatures.bl_rna.properties["action"].enum_items[action]
            self.layout.operator(INFRARED_OT_object_temperatures.bl_idname, text=text or item.name).action = action


register, unregister = bpy.utils.register_classes_factory(
    (
        INFRARED_OT_temperature_from_vertex_group,
        INFRARED_OT_temperature_from_colors,
        INFRARED_OT_temperature_from_image,
        INFRARED_OT_temperature_from_points,
        INFRARED_OT_temperature_from_attribute,
        INFRARED_OT_temperature_remove_attribute,
        INFRARED_OT_object_temperatures,
        INFRARED_MT_surface_temperature,
        INFRARED_MT_object_temperatures,
    )
)
