# SPDX-License-Identifier: GPL-3.0-or-later
"""The emissivity curve in the material's panel: a picture over the scene's bands, and its points to edit.

The points live in material["emissivity"] alone, a flat list [um, eps, um, eps, ...], which every operator reads and
writes.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import FloatProperty, IntProperty, StringProperty
from bpy.types import Operator, Panel

from ...reading.bands import read_band_edges
from ...reading.materials import pair_points, read_material
from ...solver.scene import Material, SceneError
from ..panel_base import InfraredPanel
from . import curve_previews
from .material_library import MaterialOperator, active_material, write_emissivity

ROWS = 12  # points shown at a time; measured spectra have thousands


def point_list(material) -> list[tuple[float, float]] | None:
    """[(um, emissivity), ...] of material["emissivity"] as they stand, right or wrong; None if it is no such list."""
    value = material.get("emissivity")
    numbers = value.to_list() if hasattr(value, "to_list") else []
    if not numbers or len(numbers) % 2 or not all(isinstance(number, int | float) for number in numbers):
        return None
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def write_points(operator, material, points: list[tuple[float, float]]) -> None:
    """Set material["emissivity"] to the points, in the order of their wavelengths. operator: see write_emissivity."""
    write_emissivity(operator, material, [float(number) for point in sorted(points) for number in point])


class INFRARED_OT_emissivity_curve(MaterialOperator, Operator):
    """Give the emissivity at several wavelengths; it is linear between them and constant outside"""

    bl_idname = "infrared.emissivity_curve"
    bl_label = "Emissivity over Wavelength"

    points: StringProperty(
        name="µm, emissivity, ...",
        description="Pairs of wavelength in micrometres and emissivity 0 to 1, separated by commas",
        default="8, 0.95, 14, 0.90",
    )

    def invoke(self, context, _event):
        points = point_list(active_material(context))
        if points is not None:
            self.points = as_text(points)
        return context.window_manager.invoke_props_dialog(self, width=500)

    def execute(self, context):
        material = active_material(context)
        try:
            numbers = [float(word) for word in self.points.split(",")]
            points = sorted(map(tuple, pair_points(numbers, f"Material '{material.name}'").tolist()))
            Material(name=material.name, emissivity=points)
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except ValueError:
            self.report({"ERROR"}, f"'{self.points}' is no list of numbers separated by commas")
            return {"CANCELLED"}
        write_points(self, material, points)
        return {"FINISHED"}


def as_text(points: list[tuple[float, float]]) -> str:
    """The points as the dialog of all of them shows and takes them: 9 digits keep apart what measurements do."""
    return ", ".join(f"{number:.9g}" for point in points for number in point)


class PointOperator(MaterialOperator):
    """Base of operators on the list of points of the active material."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and point_list(active_material(context)) is not None


class PointDialog:
    """Base of operators that ask for a point."""

    wavelength: FloatProperty(name="Wavelength (µm)", default=10.0, min=0.001, soft_max=100.0, precision=3, step=10)
    emissivity: FloatProperty(name="Emissivity", default=0.9, min=0.0, max=1.0, precision=3, subtype="FACTOR")

    def write(self, context, others: list[tuple[float, float]]):
        """Join the point to the others, unless one of them has its wavelength."""
        wavelength = round(self.wavelength, 6)  # what the dialog shows, not float32's 8.30000019
        if any(wavelength == other for other, _ in others):
            self.report({"ERROR"}, f"There is a point at {wavelength:g} µm already")
            return {"CANCELLED"}
        write_points(self, active_material(context), [*others, (wavelength, round(self.emissivity, 6))])
        return {"FINISHED"}


class INFRARED_OT_point_add(PointDialog, PointOperator, Operator):
    """Add a point to the curve"""

    bl_idname = "infrared.point_add"
    bl_label = "Add Point"

    def invoke(self, context, _event):
        points = point_list(active_material(context))
        self.wavelength, self.emissivity = points[-1][0] + 1.0, points[-1][1]
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        return self.write(context, point_list(active_material(context)))


class INFRARED_OT_point_edit(PointDialog, PointOperator, Operator):
    """Change this point"""

    bl_idname = "infrared.point_edit"
    bl_label = "Edit Point"

    index: IntProperty(options={"HIDDEN"}, min=0)

    def invoke(self, context, _event):
        points = point_list(active_material(context))
        if self.index < len(points):
            self.wavelength, self.emissivity = points[self.index]
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        points = point_list(active_material(context))
        if self.index >= len(points):
            self.report({"ERROR"}, f"There is no point {self.index}; the curve has {len(points)}")
            return {"CANCELLED"}
        return self.write(context, points[: self.index] + points[self.index + 1 :])


class INFRARED_OT_point_remove(PointOperator, Operator):
    """Remove this point"""

    bl_idname = "infrared.point_remove"
    bl_label = "Remove Point"

    index: IntProperty(options={"HIDDEN"}, min=0)

    def execute(self, context):
        points = point_list(active_material(context))
        if self.index >= len(points) or len(points) == 1:
            self.report({"ERROR"}, "A curve keeps one point" if len(points) == 1 else f"There is no point {self.index}")
            return {"CANCELLED"}
        write_points(self, active_material(context), points[: self.index] + points[self.index + 1 :])
        return {"FINISHED"}


class INFRARED_OT_points_make(MaterialOperator, Operator):
    """Turn the emissivity into points of this material: a copy of the library's curve, or two points of a number"""

    bl_idname = "infrared.points_make"
    bl_label = "Edit as Points"

    def execute(self, context):
        infrared, material = context.scene.infrared, active_material(context)
        try:
            wavelengths, values = read_material(material, infrared.default_emissivity).curve
            if len(wavelengths) == 1:
                edges = read_band_edges(infrared)
                wavelengths, values = (edges[0], edges[-1]), (values[0], values[0])
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        write_points(self, material, list(zip(map(float, wavelengths), map(float, values), strict=True)))
        return {"FINISHED"}


class INFRARED_PT_material_curve(InfraredPanel, Panel):
    """Under the material's panel."""

    bl_label = "Over Wavelength"
    bl_context = "material"
    bl_parent_id = "INFRARED_PT_material"

    def draw_header_preset(self, _context):
        self.layout.menu("INFRARED_MT_material_curve", text="", icon="DOWNARROW_HLT")

    def draw(self, context):
        material, infrared = context.material, context.scene.infrared
        draw_curve_picture(self.layout, material, infrared)
        points = point_list(material)
        if points is None:
            self.layout.operator("infrared.points_make", icon="CURVE_DATA")
        else:
            draw_points(self.layout, points, context.window_manager)


class INFRARED_MT_material_curve(bpy.types.Menu):
    bl_label = "Emissivity"

    def draw(self, _context):
        layout = self.layout
        layout.operator("infrared.spectrum_import", text="Import Spectrum...", icon="IMPORT")
        layout.operator("infrared.emissivity_curve", text="Points as Text...", icon="FCURVE")
        layout.operator("infrared.points_make", icon="CURVE_DATA")
        layout.separator()
        layout.operator("infrared.library_save", text="Save to My Materials...", icon="FILE_TICK")
        layout.operator("infrared.material_asset", icon="ASSET_MANAGER")


def draw_curve_picture(layout, material, infrared) -> None:
    """The curve over the bands, if the emissivity is one and both make sense; the checks say what does not."""
    if material.get("emissivity") is None or isinstance(material["emissivity"], float | int):
        return
    try:
        wavelengths, values = read_material(material, infrared.default_emissivity).curve
        edges = read_band_edges(infrared)
    except SceneError:
        return
    points = np.column_stack((wavelengths, values))
    name = f"panel {material.session_uid}"
    icon = curve_previews.curve_icon(name, points, curve_previews.PANEL_SIZE, edges)
    layout.template_icon(icon, scale=8.0)
    low, high = curve_previews.shown_range(edges)
    row = layout.row()
    row.alignment = "CENTER"
    row.active = False
    row.label(text=f"{low:.3g} to {high:.3g} µm, bands shaded; emissivity 0 to 1")


def draw_points(layout, points: list[tuple[float, float]], window_manager) -> None:
    """A row for each point; a slider for where to start if there are many."""
    first = 0
    if len(points) > ROWS:
        layout.prop(window_manager, "infrared_first_point")
        first = min(window_manager.infrared_first_point - 1, len(points) - ROWS)
    column = layout.column(align=True)
    for index in range(first, min(first + ROWS, len(points))):
        wavelength, emissivity = points[index]
        row = column.row(align=True)
        text = f"{wavelength:.5g} µm:   {emissivity:.4g}"
        row.operator("infrared.point_edit", text=text).index = index
        row.operator("infrared.point_remove", text="", icon="X").index = index
    if len(points) > ROWS:
        layout.label(text=f"Points {first + 1} to {first + ROWS} of {len(points)}")
    layout.operator("infrared.point_add", icon="ADD")


CLASSES = (
    INFRARED_OT_emissivity_curve,
    INFRARED_OT_point_add,
    INFRARED_OT_point_edit,
    INFRARED_OT_point_remove,
    INFRARED_OT_points_make,
    INFRARED_MT_material_curve,
    INFRARED_PT_material_curve,
)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.WindowManager.infrared_first_point = IntProperty(
        name="First Point", description="The first point that the list shows", default=1, min=1, options={"SKIP_SAVE"}
    )


def unregister():
    del bpy.types.WindowManager.infrared_first_point
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
