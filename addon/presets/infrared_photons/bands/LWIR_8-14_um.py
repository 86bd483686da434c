# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

infrared = bpy.context.scene.infrared
infrared.band_mode = "UNIFORM"
infrared.wavelength_min = 8.0
infrared.wavelength_max = 14.0
infrared.band_count = 12
