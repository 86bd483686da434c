# SPDX-License-Identifier: GPL-3.0-or-later
"""Mix a material with another one: by a number, by an attribute of the mesh, or by an image."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty
from bpy.types import Operator
from bpy.utils import register_classes_factory

from ...interface import redraw
from ...properties import CUSTOM_PROPERTIES, add_custom_property, set_custom_property
from ...reading.custom_properties import is_number
from ...reading.images import CHANNELS, is_image, read_choice
from ...reading.textures import TextureReader
from ...reading.warnings import Warnings
from ..image_lookup import ImageLookup, store_choice

_SOURCES = (
    ("NUMBER", "Number", "The same share everywhere", 0),
    ("ATTRIBUTE", "Attribute", "What a float attribute of the mesh says at each point, corner or face", 1),
    ("IMAGE", "Image", "What an image says, which the UV map lays on", 2),
)


class INFRARED_OT_material_mix(ImageLookup, Operator):
    """Put another material in the place of this one in part: rust on steel, holes between leaves"""

    bl_idname = "infrared.material_mix"
    bl_label = "Mix with Another Material"
    bl_options = {"REGISTER", "UNDO"}
    kind = "mix"

    material: StringProperty(name="Material", description="Name of the other material")
    source: EnumProperty(name="Share", description="What says how much of it there is", items=_SOURCES)
    share: FloatProperty(
        name="Share",
        description=CUSTOM_PROPERTIES["mix"]["description"],
        default=0.5,
        min=0.0,
        max=1.0,
        precision=3,
        subtype="FACTOR",
    )
    channel: EnumProperty(
        name="Channel",
        description="What of the image is the share",
        items=(
            ("Color", "Color", "Its first channel: red, or grey", 0),
            ("Alpha", "Alpha", "Its alpha channel, as of pictures of leaves", 1),
            ("Inverted Color", "Inverted Color", "What its first channel is short of 1", 2),
            ("Inverted Alpha", "Inverted Alpha", "What its alpha channel is short of 1: the holes between leaves", 3),
        ),
    )
    attribute: StringProperty(name="Attribute", description="Name of a float attribute of the mesh")

    @classmethod
    def poll(cls, context):
        material = getattr(context, "material", None)
        if material is None or not material.is_editable:
            cls.poll_message_set("There is no editable material here")
            return False
        return True

    def invoke(self, context, _event):
        material = context.material
        value, other = material.get("mix"), material.get("mix_material")
        self.material = getattr(other, "name", "")
        self.load_lookup(material, value if is_image(value) else None)
        self.channel = read_choice(material, "mix_channel", CHANNELS, Warnings())
        if is_image(value):
            self.source = "IMAGE"
        elif isinstance(value, str):
            self.source, self.attribute = "ATTRIBUTE", value
        elif is_number(value):
            self.source, self.share = "NUMBER", value
        return context.window_manager.invoke_props_dialog(self, width=360, confirm_text="Mix")

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        column.prop_search(self, "material", bpy.data, "materials")
        column.row().prop(self, "source", expand=True)
        if self.source == "IMAGE":
            self.draw_lookup(column)
            column.prop(self, "channel")
        elif self.source == "NUMBER":
            column.prop(self, "share")
        elif context.object is not None and context.object.type == "MESH":
            column.prop_search(self, "attribute", context.object.data, "attributes")
        else:
            column.prop(self, "attribute")

    def execute(self, context):
        material, other = context.material, bpy.data.materials.get(self.material)
        if other is None:
            self.report({"ERROR"}, f"There is no material '{self.material}' in this file")
            return {"CANCELLED"}
        image = self.find_image() if self.source == "IMAGE" else None
        if self.source == "IMAGE" and image is None:
            return {"CANCELLED"}
        if self.source == "NUMBER":
            add_custom_property(material, "mix", self.share)
        else:
            set_custom_property(material, "mix", image or self.attribute)
        set_custom_property(material, "mix_material", other)
        self.store_lookup(material)
        store_choice(material, "mix_channel", self.channel, CHANNELS)
        material.update_tag()
        redraw("PROPERTIES")
        warnings = Warnings()
        TextureReader(warnings).mix(material)
        self.tell(warnings)
        return {"FINISHED"}


register, unregister = register_classes_factory((INFRARED_OT_material_mix,))
