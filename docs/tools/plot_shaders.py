# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/shaders.png: a scene made for visible light, and its thermal pictures before and after one operator.

Needs Blender as a Python module, with Cycles.

python -m docs.tools.plot_shaders
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from PIL import Image

from docs.tools.blender import registered
from docs.tools.ordinary_scene import build
from docs.tools.paths import IMAGES
from docs.tools.pictures import MARGIN, WIDTH, labelled, resized, tiled, titled

HEIGHT = WIDTH * 9 // 16  # pixels
SAMPLES, PASSES, PHOTONS = 64, 12, 20_000


def visible(folder: Path) -> Image.Image:
    """What Cycles shows of the scene."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", SAMPLES, False
    scene.render.filepath = str(folder / "visible.png")
    bpy.ops.render.render(write_still=True)
    return Image.open(scene.render.filepath).convert("RGB")


def thermal(folder: Path) -> np.ndarray:
    """The apparent temperature, K, (height, width), top row first."""
    scene, path = bpy.context.scene, folder / "thermal.exr"
    scene.render.engine = "INFRARED_PHOTONS"
    scene.infrared.passes, scene.infrared.photons_per_pass = PASSES, PHOTONS
    scene.infrared.band_exr_path, scene.infrared.file_formats = str(path), {"BAND_EXR"}
    bpy.ops.render.render()
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.array(file.channels()["Temperature.V"].pixels)


def main() -> None:
    with registered(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        build()
        picture = bpy.context.scene.render
        picture.resolution_x, picture.resolution_y, picture.resolution_percentage = WIDTH, HEIGHT, 100
        shown, before = visible(folder), thermal(folder)
        bpy.ops.infrared.thermal_from_shaders(scope="SCENE")
        after = thermal(folder)
    pictures = [
        titled(resized(shown), "Visible light, Cycles", margin=MARGIN),
        labelled(before, "As it was opened: temperature, K"),
        labelled(after, "After Thermal from Shaders...: temperature, K"),
    ]
    tiled(pictures, 3).save(IMAGES / "shaders.png", optimize=True)


if __name__ == "__main__":
    main()
