# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: render what is open, small. Arguments after `--`: the template's zip, to install it and begin
with *File > New > Infrared Photons*; none if Blender was started with the template.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from facts import fact  # noqa: E402

for archive in sys.argv[sys.argv.index("--") + 1 :]:
    bpy.ops.preferences.app_template_install(filepath=archive)
    bpy.ops.wm.read_homefile(app_template="Infrared_Photons")
fact("template", bpy.context.preferences.app_template)
fact("objects", sorted(bpy.data.objects.keys()))
fact("engine", bpy.context.scene.render.engine)
if bpy.context.scene.render.engine == "INFRARED_PHOTONS":
    exec(Path(__file__).with_name("small.py").read_text())
    bpy.ops.render.render()
    from bl_ext.user_default.infrared_photons.final_render import finished_layers

    kelvin = finished_layers["ViewLayer"]["temperature"]
    fact("temperatures", np.percentile(kelvin, [5, 95]).tolist())  # noise can take single pixels farther
