# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a small version of a .blend with Blender as a Python module and the add-on from the source:

python -m tests.real_blender.render_with_bpy BLEND OUTPUT.exr
"""

import sys

import bpy

from docs.tools.blender import registered
from tests.helpers.blender import use_multilayer_exr
from tests.real_blender.small import make_small

if __name__ == "__main__":
    blend, output = sys.argv[1:]
    with registered():
        bpy.ops.wm.open_mainfile(filepath=blend)
        make_small()
        render = bpy.context.scene.render
        render.engine, render.filepath = "INFRARED_PHOTONS", output
        use_multilayer_exr()
        bpy.ops.render.render(write_still=True)
