# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that write what the measuring tools read: a table, and a report of one file."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty
from bpy.types import Operator, Panel

from ..heat_settings import scene_unit
from ..measuring.report import write_report
from ..measuring.table import write_table
from ..rendering.frame_tools import over_frames, strips
from ..rendering.last_render import finished_frames, finished_layers
from ..rendering.readings import finished_picture
from ..rendering.reporting import build_report, frame_number, tool_readings
from .exporter import Exporter
from .temperatures.heat_display import AfterRender, ImageSidebarPanel


class ToolsExporter(AfterRender, Exporter):
    """Base of operators that export what tools read in the last render."""

    frames: BoolProperty(
        name="Over Frames",
        description="What the tools read in each frame of the animation that was rendered last, if there is one; a "
        "report has small pictures of its frames, too",
        default=True,
    )

    def execute(self, context):
        layers, frames = dict(finished_layers), dict(finished_frames)  # another render may begin meanwhile
        over = (over_frames(context.scene), strips(context.scene)) if self.frames else ([], {})
        try:
            self.write(Path(bpy.path.abspath(self.target())), context.scene, (layers, frames), *over)
        except OSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class INFRARED_OT_export_table(Operator, ToolsExporter):
    """Write what the measuring tools read in the last render, or in each frame of the last animation, to a CSV file"""

    bl_idname = "infrared.export_table"
    bl_label = "Export Table of Tools"

    filename_ext = ".csv"
    extensions = (filename_ext,)
    filter_glob: StringProperty(default="*.csv", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        if len(context.scene.infrared.measuring_tools):
            return bool(finished_layers)
        cls.poll_message_set("There are no measuring tools")
        return False

    def write(self, path, scene, rendered, read, _strips) -> None:
        """read: over frames; without any, what the tools read in the pictures of the last render."""
        for layer, images in rendered[0].items() if not read else ():
            picture = finished_picture(images, rendered[1][layer])
            read += tool_readings(scene.infrared, layer, picture, frame_number(images), values=False)
        write_table(path, read, scene_unit(scene))


class INFRARED_OT_export_report(Operator, ToolsExporter):
    """Write a report of the last render as one HTML file: pictures, tools, graphs, parameters and how it was made"""

    bl_idname = "infrared.export_report"
    bl_label = "Export Report"

    filename_ext = ".html"
    extensions = (filename_ext, ".htm")
    filter_glob: StringProperty(default="*.html", options={"HIDDEN"})

    def write(self, path, scene, rendered, *over) -> None:
        """over: what the tools read over frames, and small pictures of these."""
        write_report(path, build_report(scene, *rendered, *over))


class INFRARED_PT_image_report(ImageSidebarPanel, Panel):
    bl_label = "Report"

    def draw(self, _context):
        column = self.layout.column()
        column.operator("infrared.export_picture", text="Export Picture...", icon="IMAGE_DATA")
        column.operator("infrared.export_table", text="Export Table...", icon="SPREADSHEET")
        column.operator("infrared.export_report", text="Export Report...", icon="FILE_TEXT")


register, unregister = bpy.utils.register_classes_factory(
    (INFRARED_OT_export_table, INFRARED_OT_export_report, INFRARED_PT_image_report)
)
