# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a small version of a .blend with bpy and the add-on from the source: render_with_bpy.py BLEND OUTPUT.exr"""

import runpy
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import addon

blend, output = sys.argv[1:]
addon.register()
bpy.ops.wm.open_mainfile(filepath=blend)
runpy.run_path(str(Path(__file__).with_name("small.py")))
render = bpy.context.scene.render
render.engine = "INFRARED_PHOTONS"
render.image_settings.media_type = "MULTI_LAYER_IMAGE"
render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
render.image_settings.color_depth = "32"
render.filepath = output
bpy.ops.render.render(write_still=True)
addon.unregister()
