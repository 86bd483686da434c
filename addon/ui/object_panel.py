# SPDX-License-Identifier: GPL-3.0-or-later
"""The object parameters: what the temperatures are corrected for, in the render settings and beside a picture."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
from bpy.types import Panel

from ..reading.object_parameters import read_object_parameters
from ..rendering.checks import object_parameter_checks
from ..solver.scene import SceneError
from .checks import draw_problems
from .panel_base import RenderSettingsPanel
from .temperatures.heat_display import ImageSidebarPanel, ViewSidebarPanel

# Where the full names would be cut: in the sidebars
SHORT = {
    "assumed_emissivity": "Emissivity",
    "reflected_temperature": "Reflected",
    "air_transmission": "Transmission",
    "relative_humidity": "Humidity",
    "optics_transmission": "Optics",
    "optics_temperature": "Temperature",
}


def draw_object_parameters(column, infrared, names: Mapping[str, str] | None = None) -> None:
    """What is known of the object, of the air and of the optics before the camera. names: other ones than properties
    have, by property."""
    names = names or {"reflected_temperature": "Reflected"}  # the whole name would be cut

    def show(name: str, counts: bool = True) -> None:
        row = column.row()
        row.active = counts
        row.prop(infrared, name, **({"text": names[name]} if name in names else {}))

    source = infrared.air_transmission_source
    show("assumed_emissivity")
    show("reflected_temperature", infrared.assumed_emissivity < 1.0)
    column.separator()
    show("air_transmission_source")
    show("air_transmission" if source == "FIXED" else "object_distance")
    if source == "FORMULA":
        show("relative_humidity")
    if source != "WORLD":
        show("air_temperature", source == "FORMULA" or infrared.air_transmission < 1.0)
    if source != "FIXED":
        _draw_transmission(column, infrared)
    column.separator()
    show("optics_transmission")
    show("optics_temperature", infrared.optics_transmission < 1.0)
    draw_problems(column, object_parameter_checks(infrared), bpy.context.region)


def _draw_transmission(column, infrared) -> None:
    """What follows for the air's transmission; the checks say why there is none."""
    try:
        transmission = read_object_parameters(infrared).correction.air_transmission
    except SceneError:
        return
    row = column.row()
    row.alignment = "RIGHT"
    row.active = False
    row.label(text=f"The air lets {100.0 * transmission:.4g} % through")


class INFRARED_PT_object_parameters(RenderSettingsPanel, Panel):
    bl_label = "Object Parameters"
    bl_parent_id = "INFRARED_PT_spectrum"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        draw_object_parameters(column, infrared)


class SidebarPanel:
    """Base of the panels with the object parameters beside a picture."""

    bl_label = "Object Parameters"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        draw_object_parameters(self.layout.column(), context.scene.infrared, SHORT)


class INFRARED_PT_image_object_parameters(SidebarPanel, ImageSidebarPanel, Panel):
    pass


class INFRARED_PT_view_object_parameters(SidebarPanel, ViewSidebarPanel, Panel):
    pass


register, unregister = bpy.utils.register_classes_factory(
    (INFRARED_PT_object_parameters, INFRARED_PT_image_object_parameters, INFRARED_PT_view_object_parameters)
)
