# SPDX-License-Identifier: GPL-3.0-or-later
"""Give the world the temperatures of a sky: by zenith angle and wavelength, from the weather, or an image."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty
from bpy.types import Operator
from bpy.utils import register_classes_factory

from ...heat_settings import in_scene_unit
from ...interface import redraw, temperature_property
from ...properties import CUSTOM_PROPERTIES, ROOM_TEMPERATURE, set_custom_property
from ...reading.bands import read_band_range
from ...reading.custom_properties import describe, is_number
from ...reading.world import SKY_KEYS, layer_world, read_sky, sky_table
from ...solver.physics.clear_sky import band_temperatures, check_weather, clear_sky, sky_emissivity
from ...solver.physics.humidity import FREEZING, dew_point
from ...solver.scene import SceneError

SKY_VALUES = (*SKY_KEYS, "temperature")  # what says what the surroundings are like; the first that is set counts
MOISTURES = (
    ("HUMIDITY", "Humidity", "Relative humidity near the ground", 0),
    ("DEW_POINT", "Dew Point", "Temperature to which the air cools until dew falls", 1),
)


def shown_world(context):
    """The world in the World properties, else that of the view layer; None if there is none."""
    return getattr(context, "world", None) or layer_world(context.scene, context.view_layer)


class INFRARED_OT_clear_sky(Operator):
    """Set the temperature of the surroundings by zenith angle: of a clear or cloudy sky, from the weather"""

    bl_idname = "infrared.clear_sky"
    bl_label = "Clear Sky from Weather"
    bl_options = {"REGISTER", "UNDO"}

    air: temperature_property("Air Temperature", "Of the air near the ground", ROOM_TEMPERATURE)
    moisture: EnumProperty(name="Moisture", description="How the moisture of the air is given", items=MOISTURES)
    humidity: FloatProperty(
        name="Humidity",
        description="Relative humidity near the ground",
        default=50.0,
        soft_min=1.0,
        soft_max=100.0,
        precision=1,
        subtype="PERCENTAGE",
    )
    dew: temperature_property("Dew Point", "Of the air near the ground", FREEZING + 10.0)
    cover: FloatProperty(
        name="Cloud Cover",
        description="Share of the sky that clouds cover; all of it gets its share of them",
        default=0.0,
        soft_min=0.0,
        soft_max=1.0,
        precision=2,
        subtype="FACTOR",
    )
    base: FloatProperty(
        name="Cloud Base (m)",
        description="Height of the base of the clouds above the ground, in metres; from 4000 m on they are thinner",
        default=1000.0,
        soft_min=0.0,
        soft_max=12000.0,
        step=10000,
        precision=0,
    )
    replace: BoolProperty(
        name="Replace",
        description="Replace a temperature that the world has. The dialog shows it",
        default=False,
        options={"SKIP_SAVE", "HIDDEN"},
    )
    replaced: StringProperty(options={"SKIP_SAVE", "HIDDEN"})  # in words; the world has the new one when it is adjusted

    @classmethod
    def poll(cls, context):
        world = shown_world(context)
        if world is None or not world.is_editable:
            cls.poll_message_set("The scene has no world" if world is None else "The world is linked from another file")
            return False
        return True

    def invoke(self, context, _event):
        if not self.properties.is_property_set("air"):
            self.air = context.scene.infrared.ambient_temperature
        self.replaced = present_text(shown_world(context), context.scene)
        self.replace = True  # what it replaces is shown
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Set Temperatures")

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        column.prop(self, "air")
        column.row().prop(self, "moisture", expand=True)
        column.prop(self, "humidity" if self.moisture == "HUMIDITY" else "dew")
        column.prop(self, "cover")
        clouds = column.column()
        clouds.active = self.cover > 0.0
        clouds.prop(self, "base")
        column.separator()
        text, icon = self.outlook(context)
        column.label(text=text, icon=icon, translate=False)
        if self.replaced:
            column.label(text=f"Replaces {self.replaced}", icon="INFO", translate=False)

    def weather(self) -> tuple[float, float, float, float]:
        """What clear_sky takes. Raises SceneError if it makes no sense."""
        dew = dew_point(self.air, self.humidity / 100.0) if self.moisture == "HUMIDITY" else self.dew
        weather = self.air, dew, self.cover, self.base
        check_weather(*weather)
        return weather

    def outlook(self, context) -> tuple[str, str]:
        """What the dialog tells of the weather, and the icon before it."""
        try:
            air, *rest = self.weather()
        except SceneError as error:
            return str(error), "ERROR"
        return f"In all as a blackbody of {in_scene_unit(air * sky_emissivity(*rest) ** 0.25, context.scene)}", "WORLD"

    def execute(self, context):
        world = shown_world(context)
        present = present_text(world, context.scene)
        if present and not self.replace:
            self.report(
                {"ERROR"}, f"World '{world.name}' has a temperature already, {present}: replace it, or remove it"
            )
            return {"CANCELLED"}
        try:
            sky, bands = clear_sky(*self.weather()), read_band_range(context.scene.infrared)
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for key in SKY_VALUES:
            world.pop(key, None)
        set_custom_property(world, "temperature_table", sky_table(*sky))
        kelvin = band_temperatures(sky, *bands)
        world.update_tag()
        redraw("PROPERTIES")
        self.report({"INFO"}, f"World '{world.name}': {summary(sky[0], kelvin, bands, context.scene)}")
        return {"FINISHED"}


def present_text(world, scene) -> str:
    """The temperature that a world has, in words; an empty text without one."""
    key = next((key for key in SKY_VALUES if world.get(key) is not None), None)
    if key is None:
        return ""
    value = world[key]
    if key == "temperature":
        return in_scene_unit(value, scene) if is_number(value) else describe(value)
    return f"image '{value.name}'" if hasattr(value, "id_type") else "a table over zenith angle and wavelength"


def summary(zenith: np.ndarray, kelvin: np.ndarray, bands: tuple[float, float], scene) -> str:
    """Temperatures (n,), K, at zenith angles (n,), degrees, in words."""
    overhead, slanted, level = (in_scene_unit(float(each), scene) for each in np.interp((0, 60, 90), zenith, kelvin))
    low, high = bands
    return f"{overhead} overhead, {slanted} at 60° from there, {level} at the horizon, from {low:g} to {high:g} µm"


class INFRARED_OT_sky_image(Operator):
    """Let an equirectangular image say how warm the sky is in each direction: of a float image, values in kelvin"""

    bl_idname = "infrared.sky_image"
    bl_label = "Temperature Image"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Image", description="Name of an image of this file")

    @classmethod
    def poll(cls, context):
        return INFRARED_OT_clear_sky.poll.__func__(cls, context)

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Set Image")

    def draw(self, _context):
        self.layout.prop_search(self, "image", bpy.data, "images")
        self.layout.label(text=CUSTOM_PROPERTIES["temperature_image"]["description"].split(". It")[0], translate=False)

    def execute(self, context):
        world, image = shown_world(context), bpy.data.images.get(self.image)
        if image is None:
            self.report({"ERROR"}, f"There is no image '{self.image}' in this file")
            return {"CANCELLED"}
        set_custom_property(world, "temperature_image", image)
        try:
            kelvin = read_sky(world).kelvin
        except SceneError as error:
            self.report({"WARNING"}, str(error))
            return {"FINISHED"}
        low, high = (in_scene_unit(float(each), context.scene) for each in (kelvin.min(), kelvin.max()))
        self.report({"INFO"}, f"World '{world.name}': a sky of {low} to {high}")
        world.update_tag()
        redraw("PROPERTIES")
        return {"FINISHED"}


register, unregister = register_classes_factory((INFRARED_OT_clear_sky, INFRARED_OT_sky_image))
