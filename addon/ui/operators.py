# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators behind the panels: add and remove the custom properties that carry the physics."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy.types import Operator

from ..output.formats import ENUM_ITEMS, FORMATS, layer_suffixes
from ..properties import CUSTOM_PROPERTIES, add_custom_property, initial_value, property_label
from ..rendering.last_render import finished_frames, finished_layers
from ..rendering.readings import images_now
from ..rendering.render_files import write_layer
from .exporter import Exporter

OWNERS = (
    ("OBJECT", "Object", "The active object", 0),
    ("MATERIAL", "Material", "The active material", 1),
    ("WORLD", "World", "The scene's world", 2),
)
KEYS = tuple((key, property_label(key), ui["description"], i) for i, (key, ui) in enumerate(CUSTOM_PROPERTIES.items()))


def _owner(context, kind: str):
    """The data block that the panel shows, or None."""
    return getattr(context, kind.lower(), None) or (context.scene.world if kind == "WORLD" else None)


class CustomPropertyOperator:
    """Base of operators on one custom property of the object, material or world in the panel."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    owner: EnumProperty(name="Owner", items=OWNERS)
    key: EnumProperty(name="Property", items=KEYS)

    def execute(self, context):
        id_block = _owner(context, self.owner)
        if id_block is None or not id_block.is_editable:
            self.report({"ERROR"}, f"There is no editable {self.owner.lower()} here")
            return {"CANCELLED"}
        self.edit(context, id_block)
        id_block.update_tag()
        return {"FINISHED"}


class INFRARED_OT_property_add(CustomPropertyOperator, Operator):
    """Set a value here. It starts at what counted without it"""

    bl_idname = "infrared.property_add"
    bl_label = "Set"

    def edit(self, context, id_block):
        add_custom_property(id_block, self.key, initial_value(id_block, self.key, context.scene))


class INFRARED_OT_property_remove(CustomPropertyOperator, Operator):
    """Remove the value, so that the default counts"""

    bl_idname = "infrared.property_remove"
    bl_label = "Remove"

    def edit(self, context, id_block):
        id_block.pop(self.key, None)


class INFRARED_OT_export_bands(Operator, Exporter):
    """Write the last render to a file, one for each view layer"""

    bl_idname = "infrared.export_bands"
    bl_label = "Export Band Images"

    filter_glob: StringProperty(default="*.exr;*.hdr;*.tif", options={"HIDDEN"})
    file_format: EnumProperty(name="Format", description="Format of the file", items=ENUM_ITEMS)

    @property
    def filename_ext(self) -> str:
        """The extension that ExportHelper gives to the file."""
        return FORMATS[self.file_format].extension

    @classmethod
    def poll(cls, _context):
        return bool(finished_layers)

    def execute(self, context):
        layers, frames = dict(finished_layers), dict(finished_frames)  # another render may begin meanwhile
        try:
            for layer, suffix in layer_suffixes(layers).items():
                path = Path(bpy.path.abspath(self.target(suffix)))
                images = images_now(layers[layer], frames[layer], context.scene.infrared)
                write_layer(path, layer, images, self.file_format)
        except OSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (
        INFRARED_OT_property_add,
        INFRARED_OT_property_remove,
        INFRARED_OT_export_bands,
    )
)
