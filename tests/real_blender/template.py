# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: render what is open, small. Arguments: the template's zip, to install it and begin
with *File > New > Infrared Photons*; none if Blender was started with the template.
"""

import sys

import bpy
import numpy as np

from tests.real_blender.facts import fact
from tests.real_blender.small import make_small

for archive in sys.argv[1:]:
    bpy.ops.preferences.app_template_install(filepath=archive)
    bpy.ops.wm.read_homefile(app_template="Infrared_Photons")
fact("template", bpy.context.preferences.app_template)
fact("objects", sorted(bpy.data.objects.keys()))
fact("engine", bpy.context.scene.render.engine)
if bpy.context.scene.render.engine == "INFRARED_PHOTONS":
    make_small()
    bpy.ops.render.render()
    from bl_ext.user_default.infrared_photons.rendering.final_render import finished_layers

    kelvin = finished_layers["ViewLayer"]["temperature"]
    fact("temperatures", np.percentile(kelvin, [5, 95]).tolist())  # noise can take single pixels farther
