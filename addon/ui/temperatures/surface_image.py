# SPDX-License-Identifier: GPL-3.0-or-later
"""Let an image say how warm an object's surface is, sampled where light meets it."""

from __future__ import annotations

from bpy.props import BoolProperty
from bpy.types import Operator
from bpy.utils import register_classes_factory

from ...heat_settings import in_scene_unit
from ...interface import redraw, temperature_property
from ...properties import ROOM_TEMPERATURE, set_custom_property
from ...reading.images import is_image, temperature_range
from ...reading.objects import STRAND_TYPES, SURFACE_TYPES
from ...reading.textures import TextureReader
from ...reading.warnings import Warnings
from ...solver.scene import SceneError
from ..image_lookup import ImageLookup


class INFRARED_OT_temperature_image(ImageLookup, Operator):
    """Let an image, laid on by the UV map, say how warm the surface is: of a float image, values in kelvin"""

    bl_idname = "infrared.temperature_image"
    bl_label = "Temperature Image"
    bl_options = {"REGISTER", "UNDO"}
    kind = "temperature"

    use_range: BoolProperty(
        name="Values from 0 to 1",
        description="The image holds no kelvin: 0 and 1 mean the temperatures below, and it is linear between them",
        default=False,
    )
    low: temperature_property("At 0", "Temperature where the image is 0", ROOM_TEMPERATURE, soft_min=0.0)
    high: temperature_property("At 1", "Temperature where the image is 1", ROOM_TEMPERATURE + 50.0, soft_min=0.0)

    @classmethod
    def poll(cls, context):
        obj = context.object
        if obj is None or obj.type not in SURFACE_TYPES - STRAND_TYPES or not obj.is_editable:
            cls.poll_message_set("There is no editable object with a surface here")
            return False
        return True

    def invoke(self, context, _event):
        obj = context.object
        image = obj.get("temperature_image")
        self.load_lookup(obj, image if is_image(image) else None)
        try:
            span = temperature_range(obj, obj.name)
        except SceneError:  # it is replaced
            span = None
        self.use_range = span is not None
        if span is not None:
            self.low, self.high = span
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Set Image")

    def draw(self, _context):
        column = self.layout.column()
        column.use_property_split = True
        self.draw_lookup(column)
        column.prop(self, "use_range")
        limits = column.column(align=True)
        limits.active = self.use_range
        limits.prop(self, "low")
        limits.prop(self, "high")

    def execute(self, context):
        obj, image = context.object, self.find_image()
        if image is None:
            return {"CANCELLED"}
        set_custom_property(obj, "temperature_image", image)
        obj.pop("temperature_range", None)
        if self.use_range:
            set_custom_property(obj, "temperature_range", [self.low, self.high])
        self.store_lookup(obj)
        obj.update_tag()
        redraw("PROPERTIES")
        self._report(obj, context.scene)
        return {"FINISHED"}

    def _report(self, obj, scene) -> None:
        """Say from where to where the temperatures are, or what is wrong with them."""
        warnings = Warnings()
        reader = TextureReader(warnings)
        try:
            number = reader.temperature_image(obj)
        except SceneError as error:
            self.report({"WARNING"}, str(error))
            return
        self.tell(warnings)
        if number >= 0:
            kelvin = reader.images[number].values
            low, high = (in_scene_unit(float(each), scene) for each in (kelvin.min(), kelvin.max()))
            self.report({"INFO"}, f"Object '{obj.name}': an image of {low} to {high}")


register, unregister = register_classes_factory((INFRARED_OT_temperature_image,))
