# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensor of the camera: its response over the scene's bands, an import of one, and the effects of its optics and
detector.

A custom response is the scene's custom property `sensor_response`, a flat list [um, response, um, response, ...].
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from bpy.props import StringProperty
from bpy.types import Operator, Panel
from bpy_extras.io_utils import ImportHelper

from ..heat_settings import read_scale
from ..properties import set_custom_property
from ..reading import spectra
from ..reading.bands import read_band_edges
from ..reading.sensor import read_response
from ..rendering.checks import detector_checks, sensor_checks
from ..rendering.last_render import finished_layers
from ..rendering.painting import keep_picture, thermal_picture, working_primaries
from ..rendering.render_passes import CAMERA_TEMPERATURE as PASS
from ..solver.scene import SceneError
from .checks import draw_problems
from .materials import curve_previews
from .panel_base import RenderSettingsPanel


class INFRARED_OT_sensor_import(Operator, ImportHelper):
    """Read a sensor's response from a table of two columns: wavelength in micrometres and response in any unit"""

    bl_idname = "infrared.sensor_import"
    bl_label = "Import Response"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    filter_glob: StringProperty(default="*.csv;*.txt;*.tsv;*.dat", options={"HIDDEN"})

    def execute(self, context):
        try:
            points = spectra.read_response(Path(bpy.path.abspath(self.filepath)))
        except (spectra.SpectrumError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        scene = context.scene
        set_custom_property(scene, "sensor_response", points.ravel().tolist())
        scene.infrared.sensor = "CUSTOM"
        scene.update_tag()
        self.report({"INFO"}, f"Response of {len(points)} points, {points[0, 0]:g} to {points[-1, 0]:g} µm")
        return {"FINISHED"}


class INFRARED_OT_show_camera_temperature(Operator):
    """Show the last render as the camera saw it, its pass Camera Temperature in the colors of Heat Display"""

    bl_idname = "infrared.show_camera_temperature"
    bl_label = "Show Camera Temperature"

    @classmethod
    def poll(cls, _context):
        if any(PASS in images["further"] for images in list(finished_layers.values())):
            return True
        cls.poll_message_set("Render with Camera Effects first")
        return False

    def execute(self, context):
        layers = list(finished_layers.values())
        kelvin = next(images["further"][PASS].image for images in layers if PASS in images["further"])
        image = keep_picture(PASS, thermal_picture(kelvin, read_scale(context.scene.infrared), working_primaries()))
        if not _image_editors(context):
            bpy.ops.render.view_show("INVOKE_DEFAULT")
        for area in _image_editors(context)[:1]:
            area.spaces.active.image = image
        return {"FINISHED"}


def _image_editors(context) -> list:
    """The areas that show images, of all windows."""
    areas = [area for window in context.window_manager.windows for area in window.screen.areas]
    return [area for area in areas if area.type == "IMAGE_EDITOR" and area.ui_type == "IMAGE_EDITOR"]


class INFRARED_PT_sensor(RenderSettingsPanel, Panel):
    bl_label = "Sensor"
    bl_parent_id = "INFRARED_PT_spectrum"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "sensor")
        if infrared.sensor != "BOX":
            draw_response(column, infrared)
        column.prop(infrared, "sensor_lag")
        column.operator("infrared.sensor_import", text="Import...", icon="IMPORT")
        draw_problems(column, sensor_checks(infrared), bpy.context.region)


class INFRARED_PT_detector(RenderSettingsPanel, Panel):
    bl_label = "Camera Effects"
    bl_parent_id = "INFRARED_PT_spectrum"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.infrared, "use_detector", text="")

    def draw_settings(self, column, infrared):
        column.active = infrared.use_detector
        for name in ("f_number", "pitch"):
            column.prop(infrared, f"detector_{name}")
        row = column.row()
        row.active = infrared.detector_f_number > 0.0
        row.prop(infrared, "detector_fill_factor")
        column.separator()
        for name in ("netd", "photon_noise", "gain_spread", "offset_spread", "seed"):
            column.prop(infrared, f"detector_{name}")
        column.separator()
        column.prop(infrared, "detector_bits")
        limits = column.column(align=True)
        limits.active = infrared.detector_bits > 0
        limits.prop(infrared, "detector_low")
        limits.prop(infrared, "detector_high")
        draw_problems(column, detector_checks(infrared.id_data), bpy.context.region)
        column.separator()
        column.operator("infrared.show_camera_temperature", icon="IMAGE_DATA")


def draw_response(column, infrared) -> None:
    """The response over the bands, if both make sense; the checks say what does not."""
    try:
        points, edges = np.column_stack(read_response(infrared).curve), read_band_edges(infrared)
    except SceneError:
        return
    icon = curve_previews.curve_icon("sensor", points, curve_previews.PANEL_SIZE, edges)
    column.template_icon(icon, scale=8.0)
    low, high = curve_previews.shown_range(edges)
    row = column.row()
    row.alignment = "CENTER"
    row.active = False
    row.label(text=f"{low:.3g} to {high:.3g} µm, bands shaded; response 0 to 1")


register, unregister = bpy.utils.register_classes_factory(
    (INFRARED_OT_sensor_import, INFRARED_OT_show_camera_temperature, INFRARED_PT_sensor, INFRARED_PT_detector)
)
