# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

infrared = bpy.context.scene.infrared
infrared.band_mode = "UNIFORM"
infrared.wavelength_min = 0.9
infrared.wavelength_max = 1.7
infrared.band_count = 8
