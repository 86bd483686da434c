# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/stereo.png: the example with two people for red and cyan glasses, as Blender writes it. Needs Blender as
a Python module.

python -m docs.tools.plot_stereo
"""

from __future__ import annotations

import bpy

from docs.tools.blender import registered
from docs.tools.paths import EXAMPLES, IMAGES


def main() -> None:
    with registered():
        bpy.ops.wm.open_mainfile(filepath=str(EXAMPLES / "people.blend"), load_ui=False)
        scene = bpy.context.scene
        render, stereo = scene.render, scene.camera.data.stereo
        render.use_multiview = True
        stereo.interocular_distance, stereo.convergence_distance, stereo.pivot = 0.065, 3.5, "CENTER"
        scene.infrared.palette, scene.infrared.band_exr_path = "WHITE_HOT", ""
        scene.view_settings.view_transform = "Standard"
        render.image_settings.file_format = "PNG"
        render.image_settings.views_format = "STEREO_3D"
        render.image_settings.stereo_3d_format.display_mode = "ANAGLYPH"
        render.filepath = str(IMAGES / "stereo.png")
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
