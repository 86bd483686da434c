# SPDX-License-Identifier: GPL-3.0-or-later
"""How temperatures are shown: colour bar and spot meter over pictures, the panels and the PNG export."""

from __future__ import annotations

import weakref
from contextlib import contextmanager
from pathlib import Path

import bpy
import gpu
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator, Panel

from ...heat_settings import fix_range, read_scale, scene_unit, use_true_colours, view_problem
from ...interface import ENGINE
from ...output.formats import layer_suffixes
from ...output.heat_picture import write_picture
from ...output.temperature_scale import automatic_range
from ...rendering.gpu_pictures import draw_temperatures, forget_textures, temperature_texture
from ...rendering.last_render import finished_frames, finished_layers
from ...rendering.live_pictures import picture_in
from ...rendering.readings import finished_picture, temperature_now
from ...rendering.reporting import beside_picture
from ..drawing import draw_label, text_height
from ..exporter import Exporter
from ..measuring.tool_drawing import draw_tools
from ..panel_base import RenderSettingsPanel
from . import spot_meter
from .bar import bar_of, draw_colour_bar, margins
from .seen import seen_in

# Drawing --------------------------------------------------------------------------------------------------------------


LINE = 20  # pixels at a scale of 1: height of Blender's line of text over a render

_textures = []  # (weak reference to temperatures, texture of them): those that are shown


def texture_of(temperature):
    """The texture of an image of temperatures, made once and kept as long as the image lives."""
    _textures[:] = [(alive, texture) for alive, texture in _textures if alive() is not None]
    for alive, texture in _textures:
        if alive() is temperature:
            return texture
    texture = temperature_texture(temperature)
    _textures.append((weakref.ref(temperature), texture))
    return texture


@contextmanager
def below_the_text(area, region, told: bool):
    """Draw only below the line of text that Blender writes after a render at the top of a region, if it does."""
    if not told:
        yield
        return
    line = round(LINE * bpy.context.preferences.system.ui_scale)
    gpu.state.scissor_test_set(True)
    gpu.state.scissor_set(0, 0, region.width, max(0, region.height - margins(area).top - line))
    try:
        yield
    finally:
        gpu.state.scissor_set(0, 0, region.width, region.height)
        gpu.state.scissor_test_set(False)


def draw_over_image_editor() -> None:
    """Draw the picture in the colours of now over an Image Editor that shows a finished render of ours, and over it
    what belongs to it."""
    context = bpy.context
    area, space, region, scene = context.area, context.space_data, context.region, context.scene
    seen = seen_in(area, region, scene) if space.overlay.show_overlays else None
    if seen is None:
        return
    infrared = scene.infrared
    if seen.in_colours:
        with below_the_text(area, region, seen.told):
            draw_temperatures(texture_of(temperature_now(seen.picture, infrared)), seen.scale(infrared), seen.images)
    draw_tools(seen, region, scene)
    draw_bar_beside(context)
    cursor = spot_meter.Cursor
    if cursor.is_in(area):
        place, unit = region.view2d.region_to_view(cursor.x, cursor.y), scene_unit(scene)
        draw_at_cursor(cursor, spot_meter.reading_at(seen.picture, infrared, *place, unit))


def draw_over_viewport() -> None:
    """Draw what belongs to the picture of ours over a 3D viewport that shows one."""
    context = bpy.context
    area, space, region, scene = context.area, context.space_data, context.region, context.scene
    seen = seen_in(area, region, scene) if space.overlay.show_overlays else None
    if seen is None:
        return
    draw_tools(seen, region, scene)
    draw_bar_beside(context)
    cursor = spot_meter.Cursor
    if cursor.is_in(area):
        picture = picture_in(region)
        draw_at_cursor(cursor, spot_meter.live_reading(picture, scene.infrared, cursor.x, cursor.y, scene_unit(scene)))


def draw_bar_beside(context) -> None:
    """The colour bar, and over it, in a viewport, what changes the colours."""
    bar = bar_of(context, context.area, context.region)
    if bar is None:
        return
    draw_colour_bar(bar, max(1.0, context.preferences.system.ui_scale))
    problem = view_problem(context.scene) if context.area.type == "VIEW_3D" else ""
    if problem:
        right, top = bar.left + bar.panel_width(bar.text), bar.bottom + bar.height + bar.text
        draw_label(right, top, f"Colors changed by: {problem}", bar.text, from_right=True)


def draw_at_cursor(cursor, value: str | None) -> None:
    """Draw a reading, if there is one, beside the spot meter's cursor."""
    text = text_height()
    if value:
        draw_label(cursor.x + 1.5 * text, cursor.y + 1.5 * text, value, text)


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
    tools: BoolProperty(name="Tools", description="Draw the measuring tools with their numbers", default=True)
    table: BoolProperty(name="Table", description="Add a table of what the measuring tools read", default=True)

    def execute(self, context):
        layers, frames = dict(finished_layers), dict(finished_frames)  # another render may begin meanwhile
        infrared = context.scene.infrared
        scale, unit = read_scale(context.scene.infrared), scene_unit(context.scene)
        try:
            for layer, suffix in layer_suffixes(layers).items():
                path = Path(bpy.path.abspath(self.target(suffix)))
                images, frame = layers[layer], frames[layer]
                temperature = temperature_now(finished_picture(images, frame), infrared)
                shown = beside_picture(infrared, layer, images, frame, (self.colour_bar, self.tools, self.table))
                write_picture(path, temperature, scale, unit, shown)
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
        infrared, layers = context.scene.infrared, dict(finished_layers)  # another render may begin meanwhile
        pictures = [finished_picture(layers[name], frame) for name, frame in finished_frames.items() if name in layers]
        ranges = [automatic_range(temperature_now(picture, infrared)) for picture in pictures]
        warm = [each for each in ranges if each[1] > 0.0] or ranges  # a layer may show nothing but a 0 K background
        fix_range(infrared, min(low for low, _ in warm), max(high for _, high in warm))
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


class INFRARED_PT_heat_display(RenderSettingsPanel, Panel):
    bl_label = "Heat Display"

    def draw_settings(self, column, infrared):
        draw_scale_settings(column, infrared.id_data)
        column.operator("infrared.export_picture", text="Export Picture...", icon="EXPORT")


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
        draw_sidebar_settings(self.layout, context.scene)


class INFRARED_PT_image_spots(ImageSidebarPanel, Panel):
    bl_label = "Spot Meter"

    def draw(self, _context):
        draw_spot_meter_button(self.layout)


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
    _textures.clear()
    forget_textures()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    spot_meter.unregister()
