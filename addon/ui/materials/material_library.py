# SPDX-License-Identifier: GPL-3.0-or-later
"""The material library in Blender's window: browse and use it, import spectra, keep materials of one's own."""

from __future__ import annotations

import textwrap
from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty, StringProperty
from bpy.types import Operator, PropertyGroup, UIList
from bpy_extras.io_utils import ImportHelper

from ...interface import redraw
from ...properties import set_custom_property
from ...reading.materials import read_material
from ...reading.spectra import SpectrumError, read_spectrum
from ...solver.physics import library
from ...solver.scene import SceneError
from . import curve_previews

UNUSABLE = "There is no editable material here"
SOURCE_WIDTH = 62  # characters of a line of text in the browser


def active_material(context):
    """The material that the panel shows, else the active object's; None if there is none that can be edited."""
    material = getattr(context, "material", None)
    if material is None and context.object is not None:
        material = context.object.active_material
    return material if material is not None and material.is_editable else None


def write_emissivity(operator, material, value: str | list[float]) -> None:
    """Set a material's emissivity, let Blender evaluate it and draw the panels that may show it.

    The operator warns where Blender will forget it: nobody would notice before the file is opened again.
    """
    set_custom_property(material, "emissivity", value)
    material.update_tag()
    redraw("PROPERTIES")
    if material.override_library is not None:
        operator.report(
            {"WARNING"},
            f"Material '{material.name}' is a library override: if its emissivity was of another kind, or had more or "
            "fewer points, Blender forgets this one when the file is opened again. Make the material local",
        )


class MaterialOperator:
    """Base of operators on the active material."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    @classmethod
    def poll(cls, context):
        return active_material(context) is not None


# Browse ---------------------------------------------------------------------------------------------------------------


class InfraredLibraryName(PropertyGroup):
    """One row of the browser; its built-in property `name` is the material's name."""


class INFRARED_UL_library(UIList):
    """Names with their curves, those that match the search."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property):
        material = library.materials().get(item.name)
        row = layout.row()
        if material is not None:  # removed from my materials meanwhile
            row.template_icon(curve_previews.curve_icon(item.name, material.points))
        row.label(text=item.name)

    def filter_items(self, _context, data, _property):
        shown = matching_names(data.search)
        return [self.bitflag_filter_item if item.name in shown else 0 for item in data.names], []


def matching_names(search: str) -> set[str]:
    """The names of the materials whose name or category holds every word of the search, letter case ignored."""
    words = search.casefold().split()
    return {
        name
        for name, material in library.materials().items()
        if all(word in f"{name} {material.category}".casefold() for word in words)
    }


def choose_match(browser, _context) -> None:
    """What the search hides is not chosen: the first name that matches is."""
    shown = matching_names(browser.search)
    if browser.names and browser.names[browser.index].name not in shown:
        matches = (i for i, item in enumerate(browser.names) if item.name in shown)
        browser.index = next(matches, browser.index)


class INFRARED_OT_emissivity_library(Operator):
    """Use the spectral emissivity of a library material"""

    bl_idname = "infrared.emissivity_library"
    bl_label = "Material Library"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: StringProperty(name="Material", description="Name of a library material", options={"SKIP_SAVE"})
    target: EnumProperty(
        name="Use For",
        items=(
            ("ACTIVE", "Active Material", "The material in the panel", 0),
            ("SELECTED", "Selected Objects", "The active material of every selected object", 1),
        ),
    )
    search: StringProperty(
        name="Search",
        description="Words of a name or a category",
        update=choose_match,
        options={"TEXTEDIT_UPDATE", "SKIP_SAVE"},
    )
    names: CollectionProperty(type=InfraredLibraryName, options={"SKIP_SAVE"})
    index: IntProperty(options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return active_material(context) is not None or bool(getattr(context, "selected_objects", ()))

    def invoke(self, context, _event):
        self.names.clear()
        for name in library.names():
            self.names.add().name = name
        material = active_material(context)
        current = material.get("emissivity") if material else None
        if isinstance(current, str):
            found = [i for i, item in enumerate(self.names) if item.name.casefold() == current.strip().casefold()]
            self.index = found[0] if found else 0
        return context.window_manager.invoke_props_dialog(self, width=760, confirm_text="Use")

    def draw(self, _context):
        layout = self.layout
        layout.row().prop(self, "target", expand=True)
        split = layout.split(factor=0.45)
        left, right = split.column(), split.column()
        row = left.row()
        row.activate_init = True
        row.prop(self, "search", text="", icon="VIEWZOOM")
        left.template_list("INFRARED_UL_library", "", self, "names", self, "index", rows=13)
        name = self.names[self.index].name if self.names else ""
        if name in matching_names(self.search):
            draw_material(right, library.get(name))

    def execute(self, context):
        name = self.names[self.index].name if self.names else self.name
        if self.names and name not in matching_names(self.search):
            self.report({"ERROR"}, f"No material matches '{self.search}'")
            return {"CANCELLED"}
        try:
            name = library.get(name).name
        except KeyError as error:
            self.report({"ERROR"}, error.args[0])
            return {"CANCELLED"}
        materials = self.materials(context)
        if not materials:
            self.report({"ERROR"}, UNUSABLE)
            return {"CANCELLED"}
        for material in materials:
            write_emissivity(self, material, name)
        self.report({"INFO"}, f"{name}: used for {len(materials)} material{'s' if len(materials) > 1 else ''}")
        return {"FINISHED"}

    def materials(self, context):
        """The materials to change, each once."""
        if self.target == "ACTIVE":
            material = active_material(context)
            return [material] if material else []
        found = (obj.active_material for obj in context.selected_objects)
        return list(dict.fromkeys(material for material in found if material is not None and material.is_editable))


def draw_material(column, material) -> None:
    """A library material as large as the browser has room for it: its curve and where it comes from."""
    column.label(text=material.name)
    name = f"large {material.name}"
    column.template_icon(curve_previews.curve_icon(name, material.points, curve_previews.PANEL_SIZE), scale=9.0)
    low, high = curve_previews.THUMBNAIL_RANGE
    texts = column.column(align=True)
    texts.scale_y = 0.8
    texts.label(text=f"{low:g} to {high:g} µm; emissivity 0 to 1. Grey: held constant")
    texts.label(text=f"{material.category}, {material.kind}, {material.points[0, 0]:g}-{material.points[-1, 0]:g} µm")
    for text in (material.note, material.source):
        for line in textwrap.wrap(text, SOURCE_WIDTH):
            texts.label(text=line)
    if material.kind == "own":
        operator = column.operator("infrared.library_remove", text="Remove from My Materials", icon="TRASH")
        operator.name = material.name


# Materials of one's own -----------------------------------------------------------------------------------------------


class INFRARED_OT_library_save(MaterialOperator, Operator):
    """Keep this emissivity in the library under a name, for every file"""

    bl_idname = "infrared.library_save"
    bl_label = "Save to My Materials"

    name: StringProperty(name="Name", description="Name in the library", options={"SKIP_SAVE"})
    source: StringProperty(name="Source", description="Where the values come from", options={"SKIP_SAVE"})
    replace: BoolProperty(name="Replace", description="Overwrite my material of this name", options={"SKIP_SAVE"})

    def invoke(self, context, _event):
        self.name = active_material(context).name
        return context.window_manager.invoke_props_dialog(self, width=450)

    def execute(self, context):
        material = active_material(context)
        try:
            points = np.column_stack(read_material(material, context.scene.infrared.default_emissivity).curve)
            library.add_user_material(self.name, points, self.source, self.replace)
        except (SceneError, library.LibraryError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"'{self.name}' is in my materials: {library.user_file()}")
        return {"FINISHED"}


class INFRARED_OT_library_remove(Operator):
    """Remove this material from my materials. Files that use its name can no longer be rendered"""

    bl_idname = "infrared.library_remove"
    bl_label = "Remove from My Materials"
    bl_options = {"INTERNAL"}

    name: StringProperty(name="Name", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def execute(self, _context):
        try:
            library.remove_user_material(self.name)
        except (library.LibraryError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class INFRARED_OT_spectrum_import(MaterialOperator, Operator, ImportHelper):
    """Read a measured spectrum: a file of the ECOSTRESS, ASTER or USGS library, or a table of two columns"""

    bl_idname = "infrared.spectrum_import"
    bl_label = "Import Spectrum"

    filter_glob: StringProperty(default="*.txt;*.csv;*.tsv;*.dat;*.asc", options={"HIDDEN"})
    quantity: EnumProperty(
        name="Second Column",
        description="What the second column of a plain table holds; library files say it themselves",
        items=(
            ("emissivity", "Emissivity", "Emissivity", 0),
            ("reflectance", "Reflectance", "Hemispherical reflectance; the emissivity is 1 minus it", 1),
        ),
    )
    unit: EnumProperty(
        name="As",
        description="How the second column of a plain table is written",
        items=(("fraction", "Fraction", "0 to 1", 0), ("percent", "Percent", "0 to 100", 1)),
    )
    wavelengths: StringProperty(
        name="Wavelengths",
        description="USGS spectra: the file of wavelengths. Empty looks for it beside the spectrum and one folder up",
    )
    keep: BoolProperty(name="Save to My Materials", description="Keep it in the library, for every file", default=False)
    replace: BoolProperty(name="Replace", description="Overwrite my material of this name", options={"SKIP_SAVE"})
    name: StringProperty(
        name="Name", description="Name in the library; empty takes the one in the file", options={"SKIP_SAVE"}
    )

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        table = layout.column(heading="Plain Table (µm, value)")
        table.prop(self, "quantity")
        table.prop(self, "unit")
        layout.prop(self, "wavelengths")
        layout.prop(self, "keep")
        own = layout.column()
        own.active = self.keep
        own.prop(self, "name")
        own.prop(self, "replace")

    def execute(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        wavelengths = Path(bpy.path.abspath(self.wavelengths)) if self.wavelengths else None
        material = active_material(context)
        try:
            spectrum = read_spectrum(path, self.quantity, self.unit, wavelengths)
            if self.keep:
                name = " ".join((self.name or spectrum.name).split())
                remark = f" ({spectrum.remark})" if spectrum.remark else ""
                library.add_user_material(name, spectrum.points, spectrum.source + remark, self.replace)
                value = library.get(name).name
            else:
                value = spectrum.points.ravel().tolist()
        except (SpectrumError, library.LibraryError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        write_emissivity(self, material, value)
        text = f"{spectrum.name}: {len(spectrum.points)} points"
        self.report({"WARNING"} if spectrum.remark else {"INFO"}, f"{text}; {spectrum.remark}".removesuffix("; "))
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (
        InfraredLibraryName,
        INFRARED_UL_library,
        INFRARED_OT_emissivity_library,
        INFRARED_OT_library_save,
        INFRARED_OT_library_remove,
        INFRARED_OT_spectrum_import,
    )
)
