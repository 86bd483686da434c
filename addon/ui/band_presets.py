# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the Spectrum panel: those in presets/infrared_photons/bands, and the artist's own; and a button there.

The ranges are those that M. Vollmer and K.-P. Möllmann, Infrared Thermal Imaging (2nd edition, 2018), give for thermal
cameras: 0.9-1.7 um (SWIR, InGaAs), 3-5 um (MWIR), 8-14 um (LWIR). Uncooled microbolometers start a little earlier:
their makers state 7.5-14 um (data sheet of the FLIR T500 series).
"""

from __future__ import annotations

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.types import Operator, Panel

from ..reading.bands import read_band_edges
from ..solver.scene import SceneError

SUBFOLDER = "infrared_photons/bands"
FOLDER = str(Path(__file__).parents[1])  # the add-on's, which holds presets/


class INFRARED_PT_band_presets(PresetPanel, Panel):
    bl_label = "Bands"
    preset_subdir = SUBFOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = "infrared.band_preset_add"


class INFRARED_OT_band_preset_add(AddPresetBase, Operator):
    """Add or remove a preset of the bands"""

    bl_idname = "infrared.band_preset_add"
    bl_label = "Add Band Preset"

    preset_menu = "INFRARED_PT_band_presets"
    preset_subdir = SUBFOLDER
    preset_defines = ["infrared = bpy.context.scene.infrared"]
    preset_values = [
        f"infrared.{name}"
        for name in ("band_mode", "wavelength_min", "wavelength_max", "band_count", "band_tolerance", "band_edges")
    ]


class INFRARED_OT_bands_keep(Operator):
    """Make these edges custom ones, which stay as they are whatever changes in the scene"""

    bl_idname = "infrared.bands_keep"
    bl_label = "Keep These Bands"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.scene.infrared.band_mode == "ADAPTIVE"

    def execute(self, context):
        infrared = context.scene.infrared
        try:
            edges = read_band_edges(infrared)
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        infrared.band_edges = ", ".join(f"{edge:.9g}" for edge in edges)
        infrared.band_mode = "CUSTOM"
        return {"FINISHED"}


register_classes, unregister_classes = bpy.utils.register_classes_factory(
    (INFRARED_PT_band_presets, INFRARED_OT_band_preset_add, INFRARED_OT_bands_keep)
)


def register():
    bpy.utils.register_preset_path(FOLDER)
    register_classes()


def unregister():
    unregister_classes()
    bpy.utils.unregister_preset_path(FOLDER)
