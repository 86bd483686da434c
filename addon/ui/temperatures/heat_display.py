# SPDX-License-Identifier: GPL-3.0-or-later
"""How temperatures are shown: colour bar and spot meter over pictures, the panels and the PNG export."""

from __future__ import annotations

from pathlib import Path

import blf
import bpy
import gpu
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator, Panel
from gpu_extras.batch import batch_for_shader

from ...heat_settings import read_scale, scene_unit, use_true_colours, view_problem
from ...interface import ENGINE
from ...output.colour_bar import BACKGROUND, INK, ColourBar
from ...output.heat_picture import Beside, write_picture
from ...output.palette import display, spread
from ...output.temperature_scale import TemperatureScale, automatic_range
from ...rendering.last_render import finished_layers
from ...rendering.live_pictures import picture_in
from ...rendering.render_files import layer_suffixes
from ..exporter import Exporter
from ..panel_base import RenderSettingsPanel
from . import spot_meter

FONT = 0  # Blender's own
TEXT = 13  # pixels at a scale of 1: height of the text
GAP = 12  # pixels at a scale of 1: between the bar and the edges of its region
GIZMOS = 260  # pixels at a scale of 1: what gizmos and header take of a 3D viewport's height at the right
MOST_HEIGHT = 420  # pixels at a scale of 1, of the bar's panel
PANEL_OPACITY = 0.8


# Drawing --------------------------------------------------------------------------------------------------------------


def colour_bar_of(context, scale: TemperatureScale, above: int) -> ColourBar | None:
    """The bar of a scale whose ends are known, at the lower right of the region; None if there is no room for it.

    It is in the region's pixels and the scene's unit. above: pixels at a scale of 1 to be left free over it.
    """
    ui = context.preferences.system.ui_scale
    text, gap = round(TEXT * ui), round(GAP * ui)
    height = min(context.region.height - round(above * ui), round(MOST_HEIGHT * ui))
    if height < 8 * text:
        return None
    right = context.region.width - gap - overlapping_width(context.area)
    left = right - ColourBar.panel_width(text)
    return ColourBar(scale, scene_unit(context.scene), left, gap, height, text)


def draw_colour_bar(context, scale, above: int) -> None:
    """Draw the bar of `colour_bar_of` into the region that is being drawn, in a POST_PIXEL draw handler."""
    bar = colour_bar_of(context, scale, above)
    if bar is None:
        return
    width, line = bar.panel_width(bar.text), max(1.0, context.preferences.system.ui_scale)
    rectangles = [(bar.left, bar.bottom, width, bar.height, (*BACKGROUND, PANEL_OPACITY))]
    left, low, across, _ = bar.bar
    rows = (display(bar.colours()) / 255.0).tolist()
    rectangles += [(left, low + row, across, 1, (*colour, 1.0)) for row, colour in enumerate(rows)]
    rectangles += [(start, y, end - start, line, (*INK, 1.0)) for start, end, y in bar.ticks()]
    draw_rectangles(rectangles)
    for x, y, label in bar.labels():
        draw_text(x, y, label, bar.text)
    if problem := view_problem(context.scene):
        note, top = f"Colors changed by: {problem}", bar.bottom + bar.height
        draw_label(bar.left + width, top + bar.text, note, bar.text, from_right=True)


def draw_rectangles(rectangles) -> None:
    """Draw (left, bottom, width, height, colour) rectangles; colours are sRGB and opacity, 0..1."""
    corners, colours = [], []
    for x, y, width, height, colour in rectangles:
        a, b, c, d = (x, y, 0.0), (x + width, y, 0.0), (x + width, y + height, 0.0), (x, y + height, 0.0)
        corners += (a, b, c, a, c, d)
        colours += (colour,) * 6
    shader = gpu.shader.from_builtin("FLAT_COLOR")
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "TRIS", {"pos": corners, "color": colours}).draw(shader)
    gpu.state.blend_set("NONE")


def draw_text(x: float, y: float, text: str, size: int) -> None:
    """Draw a line of text whose lower left corner is given, in pixels."""
    blf.size(FONT, size)
    blf.color(FONT, *INK, 1.0)
    blf.position(FONT, x, y, 0.0)
    blf.draw(FONT, text)


def draw_label(x: float, y: float, text: str, size: int, from_right: bool = False) -> None:
    """Draw a line of text on a background, in pixels; from_right: x is its right end."""
    blf.size(FONT, size)
    width = blf.dimensions(FONT, text)[0]
    left, pad = x - width - 0.5 * size if from_right else x, 0.5 * size
    draw_rectangles([(left - pad, y - pad, width + 2 * pad, size + pad, (*BACKGROUND, PANEL_OPACITY))])
    draw_text(left, y, text, size)


def draw_spot(x: float, y: float, text: str, size: int) -> None:
    """Draw a cross at a region's pixel and a reading beside it."""
    arm, gap, white, black = 0.7 * size, 0.2 * size, (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0)
    for thick, colour in ((3.0, black), (1.0, white)):  # to be seen on any colour
        half, long = 0.5 * thick, arm - gap + (thick - 1.0)
        start = gap - 0.5 * (thick - 1.0)
        draw_rectangles(
            [
                (x + start, y - half, long, thick, colour),
                (x - start - long, y - half, long, thick, colour),
                (x - half, y + start, thick, long, colour),
                (x - half, y - start - long, thick, long, colour),
            ]
        )
    draw_label(x + 1.5 * size, y - 0.35 * size, text, size)


def draw_over_image_editor() -> None:
    """Draw the bar and the spots over an Image Editor that shows a finished render of ours."""
    context = bpy.context
    space, region, scene = context.space_data, context.region, context.scene
    shown = spot_meter.shown_layer(space, scene)
    if shown is None or not space.overlay.show_overlays:
        return
    unit = scene_unit(scene)
    text = round(TEXT * context.preferences.system.ui_scale)
    for spot in scene.infrared.spots:
        value = spot_meter.reading_at(shown, *spot.position, unit)
        draw_spot(*region.view2d.view_to_region(*spot.position, clip=False), value or "not rendered", text)
    if scene.infrared.show_colour_bar and shown.is_combined:
        draw_colour_bar(context, shown.frame.scale, 5 * GAP)
    cursor = spot_meter.Cursor
    if cursor.is_in(context.area):
        value = spot_meter.reading_at(shown, *region.view2d.region_to_view(cursor.x, cursor.y), unit)
        draw_at_cursor(cursor, value, text)


def draw_over_viewport() -> None:
    """Draw the bar and the spot meter's reading over a 3D viewport that shows a picture of ours."""
    context = bpy.context
    picture = picture_in(context.region)
    space = context.space_data
    if picture is None or space.shading.type != "RENDERED" or not space.overlay.show_overlays:
        return
    if context.scene.infrared.show_colour_bar:
        draw_colour_bar(context, picture.scale, GIZMOS)
    cursor = spot_meter.Cursor
    if cursor.is_in(context.area):
        value = spot_meter.live_reading(picture, cursor.x, cursor.y, scene_unit(context.scene))
        draw_at_cursor(cursor, value, round(TEXT * context.preferences.system.ui_scale))


def draw_at_cursor(cursor, value: str | None, text: int) -> None:
    """Draw a reading, if there is one, beside the spot meter's cursor. text: its height in pixels."""
    if value:
        draw_label(cursor.x + 1.5 * text, cursor.y + 1.5 * text, value, text)


def overlapping_width(area) -> int:
    """Pixels at the right of an area's main region that the sidebar lies over."""
    if not bpy.context.preferences.system.use_region_overlap:
        return 0
    return max((region.width for region in area.regions if region.type == "UI" and region.width > 1), default=0)


# Operators ------------------------------------------------------------------------------------------------------------


class AfterRender:
    """Base of operators that need a finished render."""

    @classmethod
    def poll(cls, _context):
        return bool(finished_layers)


class INFRARED_OT_export_picture(AfterRender, Operator, Exporter):
    """Write the last render to a PNG as Heat Display says, one for each view layer. No view transform changes it"""

    bl_idname = "infrared.export_picture"
    bl_label = "Export Thermal Picture"

    filename_ext = ".png"
    extensions = (filename_ext,)
    filter_glob: StringProperty(default="*.png", options={"HIDDEN"})
    colour_bar: BoolProperty(name="Color Bar", description="Add a bar that tells what the colors mean", default=True)

    def execute(self, context):
        layers = dict(finished_layers)  # another render may begin meanwhile
        scale, unit = read_scale(context.scene.infrared), scene_unit(context.scene)
        try:
            for layer, suffix in layer_suffixes(layers).items():
                path = Path(bpy.path.abspath(self.target(suffix)))
                write_picture(path, layers[layer]["temperature"], scale, unit, Beside(self.colour_bar))
        except OSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class INFRARED_OT_range_from_render(AfterRender, Operator):
    """Fix the range at what an automatic one is in the last render"""

    bl_idname = "infrared.range_from_render"
    bl_label = "Range from Last Render"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        images = list(finished_layers.values())
        ranges = [automatic_range(layer["temperature"]) for layer in images]
        warm = [each for each in ranges if each[1] > 0.0] or ranges  # a layer may show nothing but a 0 K background
        low, high = spread(min(low for low, _ in warm), max(high for _, high in warm))
        infrared = context.scene.infrared
        infrared.range_mode, infrared.range_low, infrared.range_high = "FIXED", low, high
        return {"FINISHED"}


class INFRARED_OT_true_colours(Operator):
    """Set Color Management to Standard without changes, which shows the palette's colors as they are"""

    bl_idname = "infrared.true_colours"
    bl_label = "Show True Colors"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        use_true_colours(context.scene)
        return {"FINISHED"}


# Panels ---------------------------------------------------------------------------------------------------------------


def draw_scale_settings(column, scene) -> None:
    """The palette, its range and the isotherm."""
    infrared = scene.infrared
    column.prop(infrared, "palette")
    column.prop(infrared, "range_mode")
    if infrared.range_mode == "FIXED":
        ends = column.column(align=True)
        ends.prop(infrared, "range_low")
        ends.prop(infrared, "range_high")
    column.operator("infrared.range_from_render")
    column.separator()
    column.prop(infrared, "use_isotherm")
    if infrared.use_isotherm:
        ends = column.column(align=True)
        ends.prop(infrared, "isotherm_low")
        ends.prop(infrared, "isotherm_high")
        column.prop(infrared, "isotherm_colour")
        column.prop(infrared, "isotherm_rest")
    column.separator()
    problem = view_problem(scene)
    if problem:
        column.label(text="Colors are changed by", icon="ERROR")
        column.label(text=problem, icon="BLANK1")
        column.operator("infrared.true_colours", icon="COLOR")
    column.operator("infrared.export_picture", text="Export Picture...", icon="EXPORT")


class INFRARED_PT_heat_display(RenderSettingsPanel, Panel):
    bl_label = "Heat Display"

    def draw_settings(self, column, infrared):
        draw_scale_settings(column, infrared.id_data)


class ImageSidebarPanel:
    """Base of panels in the sidebar of an Image Editor that shows a render."""

    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Infrared"

    @classmethod
    def poll(cls, context):
        image = context.space_data.image
        return image is not None and image.type == "RENDER_RESULT" and context.scene.render.engine == ENGINE


class ViewSidebarPanel:
    """Base of panels in the sidebar of a 3D viewport in Rendered mode."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Infrared"

    @classmethod
    def poll(cls, context):
        return context.space_data.shading.type == "RENDERED" and context.scene.render.engine == ENGINE


def draw_sidebar_settings(layout, scene):
    """The colour bar's switch and the scale; returns the column."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    column = layout.column()
    column.prop(scene.infrared, "show_colour_bar")
    draw_scale_settings(column, scene)
    return column


def draw_spot_meter_button(layout) -> None:
    """Pressed while it runs."""
    layout.operator("infrared.spot_meter", icon="EYEDROPPER", depress=spot_meter.Cursor.meter is not None)


class INFRARED_PT_view_heat_display(ViewSidebarPanel, Panel):
    bl_label = "Heat Display"

    def draw(self, context):
        draw_sidebar_settings(self.layout, context.scene)


class INFRARED_PT_view_spots(ViewSidebarPanel, Panel):
    bl_label = "Spot Meter"

    def draw(self, _context):
        draw_spot_meter_button(self.layout)


class INFRARED_PT_image_heat_display(ImageSidebarPanel, Panel):
    bl_label = "Heat Display"

    def draw(self, context):
        column = draw_sidebar_settings(self.layout, context.scene)
        shown = spot_meter.shown_layer(context.space_data, context.scene)
        if shown and shown.frame.asked != read_scale(context.scene.infrared):
            column.label(text="Changed since this render", icon="INFO")


class INFRARED_PT_image_spots(ImageSidebarPanel, Panel):
    bl_label = "Spot Meter"

    def draw(self, context):
        layout, scene = self.layout, context.scene
        draw_spot_meter_button(layout)
        shown, unit = spot_meter.shown_layer(context.space_data, scene), scene_unit(scene)
        column = layout.column(align=True)
        for index, spot in enumerate(scene.infrared.spots):
            value = shown and spot_meter.reading_at(shown, *spot.position, unit)
            row = column.row(align=True)
            row.label(text=f"{index + 1}:  {value or 'not rendered'}")
            row.operator("infrared.spot_remove", text="", icon="X").index = index
        if scene.infrared.spots:
            layout.operator("infrared.spot_remove", text="Remove All Spots").index = -1


CLASSES = (
    INFRARED_OT_export_picture,
    INFRARED_OT_range_from_render,
    INFRARED_OT_true_colours,
    INFRARED_PT_heat_display,
    INFRARED_PT_image_heat_display,
    INFRARED_PT_image_spots,
    INFRARED_PT_view_heat_display,
    INFRARED_PT_view_spots,
)
OVERLAYS = ((bpy.types.SpaceImageEditor, draw_over_image_editor), (bpy.types.SpaceView3D, draw_over_viewport))
_handlers = []  # (type of space, Blender's handle)


def register():
    spot_meter.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for space, draw in OVERLAYS:
        _handlers.append((space, space.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")))


def unregister():
    while _handlers:
        space, handle = _handlers.pop()
        space.draw_handler_remove(handle, "WINDOW")
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    spot_meter.unregister()
