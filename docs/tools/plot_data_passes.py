# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/data-passes.png: what the middle of each pixel of the demo sees. Needs Blender as a Python module.

python -m docs.tools.plot_data_passes
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from PIL import Image

from docs.tools.blender import open_demo, registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import MARGIN, WIDTH, labelled, resized, tiled, titled

COLUMNS = 3


def render(path: Path) -> dict[str, np.ndarray]:
    """The channels of a quick render of the demo with all data passes, top row first."""
    from addon.rendering.render_passes import LAYER_SWITCHES, SCENE_SWITCHES

    scene = open_demo()
    layer = scene.view_layers[0]
    for owner, switches in ((layer, LAYER_SWITCHES), (scene.infrared, SCENE_SWITCHES)):
        for switch, _ in switches.values():
            setattr(owner, switch, True)
    for index, obj in enumerate(scene.objects, 1):
        obj.pass_index = index
        for slot in obj.material_slots:
            slot.material.pass_index = index
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        2 * WIDTH,
        3 * WIDTH // 2,
        100,
    )
    scene.infrared.passes, scene.infrared.photons_per_pass = 1, 1000
    scene.infrared.band_exr_path, scene.infrared.file_formats = str(path), {"BAND_EXR"}
    bpy.ops.render.render()
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels) for name, channel in file.channels().items()}


def coloured(vector: np.ndarray, title: str) -> Image.Image:
    """A picture of (height, width, 3) values from -1 to 1 as red, green and blue, with a title."""
    shades = Image.fromarray(np.uint8(np.clip(127.5 * (vector + 1.0), 0.0, 255.0)))
    return titled(resized(shades), title, margin=MARGIN)


def main() -> None:
    with registered(), tempfile.TemporaryDirectory() as folder:
        channels = render(Path(folder) / "demo.exr")
    seen = channels["Depth.Z"] < 1e9
    index = next(name for name in channels if name in ("Object Index.X", "IndexOB.X"))
    normal, position = (np.stack([channels[f"{name}.{axis}"] for axis in "XYZ"], -1) for name in ("Normal", "Position"))
    pictures = [
        labelled(channels["Surface Temperature.V"], "Surface Temperature, K"),
        labelled(channels["Emissivity.V"], "Emissivity"),
        labelled(np.where(seen, channels["Depth.Z"], channels["Depth.Z"][seen].max()), "Depth, m"),
        coloured(normal, "Normal, -1 to 1 as RGB"),
        coloured(position / np.abs(position).max(), "Position as RGB"),
        labelled(channels[index], "Object Index"),
    ]
    tiled(pictures, COLUMNS).save(IMAGES / "data-passes.png", optimize=True)


if __name__ == "__main__":
    main()
