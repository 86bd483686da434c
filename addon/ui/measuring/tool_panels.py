# SPDX-License-Identifier: GPL-3.0-or-later
"""The measuring tools in the sidebar: their list, what the chosen one reads, differences."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty
from bpy.types import Operator, Panel, UIList

from ...heat_settings import scene_unit
from ...measure_settings import KIND_ICONS, KIND_ITEMS
from ...measuring.statistics import difference
from ...output.temperature_scale import TemperatureUnit, reading, span_reading
from ...rendering.readings import read_tool, tool_values
from ..temperatures.heat_display import ImageSidebarPanel, ViewSidebarPanel
from .graphs import graph_icon
from .tool_operators import seen_here
from .workspace_tools import tool_id

GRAPH_SCALE = 8.0  # of the graph, in heights of a button


class INFRARED_OT_tool_choose(Operator):
    """Take a measuring tool of the toolbar, which is then drawn in the picture by mouse"""

    bl_idname = "infrared.tool_choose"
    bl_label = "Measure"

    kind: EnumProperty(name="Kind", description="What is to be drawn", items=KIND_ITEMS)

    @classmethod
    def description(cls, _context, properties):
        return {item[0]: item[2] for item in KIND_ITEMS}[properties.kind]

    @classmethod
    def poll(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR"

    def execute(self, context):
        if context.space_data.mode != "VIEW":
            context.space_data.mode = "VIEW"  # the tools belong to it
        bpy.ops.wm.tool_set_by_id(name=tool_id(self.kind), space_type="IMAGE_EDITOR")
        return {"FINISHED"}


class INFRARED_UL_tools(UIList):
    """Number, name and mean of each tool."""

    def draw_item(self, context, layout, infrared, tool, _icon, _active, _property, index):
        seen = seen_here(context)
        measured = seen and read_tool(tool, seen.picture, infrared)
        row = layout.split(factor=0.45)
        name = row.row(align=True)
        name.label(text=f"{index + 1}", icon=KIND_ICONS[tool.kind])
        name.prop(tool, "name", text="", emboss=False)
        row.label(text=reading(measured.mean, measured.error_of_mean, scene_unit(context.scene)) if measured else "-")


class ToolsPanel:
    """Base of the panels with the measuring tools."""

    bl_label = "Measuring Tools"

    def draw(self, context):
        infrared, layout = context.scene.infrared, self.layout
        if self.bl_space_type == "IMAGE_EDITOR":
            row = layout.row(align=True)
            for kind, *_ in KIND_ITEMS:
                row.operator("infrared.tool_choose", text="", icon=KIND_ICONS[kind]).kind = kind
        row = layout.row()
        row.template_list("INFRARED_UL_tools", "", infrared, "measuring_tools", infrared, "tool_index", rows=3)
        row.operator("infrared.tool_remove", text="", icon="X").index = -1
        row = layout.row(align=True)
        row.prop(infrared, "show_measuring_tools", toggle=True)
        row.prop(infrared, "show_extremes", toggle=True)
        if infrared.tool_index < len(infrared.measuring_tools):
            draw_chosen(layout, context, infrared.measuring_tools[infrared.tool_index])
        ranges = layout.column(align=True)
        ranges.operator("infrared.range_from_region", icon="SELECT_SET")
        ranges.operator("infrared.range_from_tool")


def draw_chosen(layout, context, tool) -> None:
    """What a tool reads, its correction and its graph."""
    infrared, seen, unit = context.scene.infrared, seen_here(context), scene_unit(context.scene)
    measured = seen and read_tool(tool, seen.picture, infrared)
    if not measured:
        layout.label(text="No pixel of it is rendered", icon="INFO")
    else:
        table = layout.column(align=True)
        for name, value in reading_rows(measured, unit):
            row = table.split(factor=0.4)
            row.label(text=name)
            row.label(text=value)
    column = layout.column()
    column.use_property_split, column.use_property_decorate = True, False
    column.prop(tool, "use_own_emissivity")
    if tool.use_own_emissivity:
        column.prop(tool, "emissivity")
        column.prop(tool, "reflected_temperature", text="Reflected")
    if measured and tool.kind != "SPOT":
        values, scale = tool_values(tool, seen.picture, infrared), seen.scale(infrared)
        layout.template_icon(graph_icon(tool.kind, values, scale), scale=GRAPH_SCALE)
        row = layout.row()
        row.label(text=f"{'bottom' if tool.kind == 'LINE' else 'left'} {unit.text(measured.minimum)}")
        row.label(text=f"{'top' if tool.kind == 'LINE' else 'right'} {unit.text(measured.maximum)}")


def reading_rows(measured, unit: TemperatureUnit) -> list[tuple[str, str]]:
    """(name, value) of all that a tool reads."""
    if measured.count == 1:
        rows = [("Temperature", reading(measured.mean, measured.error_of_mean, unit))]
    else:
        rows = [
            ("Minimum", reading(measured.minimum, measured.error_of_minimum, unit)),
            ("Mean", reading(measured.mean, measured.error_of_mean, unit)),
            ("Maximum", reading(measured.maximum, measured.error_of_maximum, unit)),
            ("Deviation", span_reading(measured.deviation, None, unit)),
            ("Area", f"{measured.count:,} pixels, {100.0 * measured.area:.3g} %"),
        ]
    places = [("Coldest at", measured.place_of_minimum), ("Hottest at", measured.place_of_maximum)]
    if measured.count == 1:
        places = [("Pixel", measured.place_of_minimum)]
    rows += [(name, f"column {column}, row {row}") for name, (row, column) in places]
    if measured.in_isotherm is not None:
        rows.append(("In isotherm", f"{100.0 * measured.in_isotherm:.1f} %"))
    return rows


class DifferencePanel:
    """Base of the panels with the difference of two tools."""

    bl_label = "Difference"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        infrared, seen = context.scene.infrared, seen_here(context)
        column = self.layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        names = "difference_of", "difference_to"
        for name in names:
            column.prop_search(infrared, name, infrared, "measuring_tools")
        tools = [infrared.measuring_tools.get(getattr(infrared, name)) for name in names]
        read = [seen and tool and read_tool(tool, seen.picture, infrared) for tool in tools]
        if all(read):
            column.label(text=span_reading(*difference(*read), scene_unit(context.scene)))


class INFRARED_PT_image_tools(ToolsPanel, ImageSidebarPanel, Panel):
    bl_idname = "INFRARED_PT_image_tools"


class INFRARED_PT_image_difference(DifferencePanel, ImageSidebarPanel, Panel):
    bl_parent_id = "INFRARED_PT_image_tools"


class INFRARED_PT_view_tools(ToolsPanel, ViewSidebarPanel, Panel):
    bl_idname = "INFRARED_PT_view_tools"


class INFRARED_PT_view_difference(DifferencePanel, ViewSidebarPanel, Panel):
    bl_parent_id = "INFRARED_PT_view_tools"


CLASSES = (
    INFRARED_OT_tool_choose,
    INFRARED_UL_tools,
    INFRARED_PT_image_tools,
    INFRARED_PT_image_difference,
    INFRARED_PT_view_tools,
    INFRARED_PT_view_difference,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
