# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the pictures of the examples with gas, and draw spectra of the plume. Needs Blender as a Python module.

    python -m docs.tools.plot_gas [plume] [steam] [street] [spectrum]

makes all of images/example-plume.png, -steam.png, -street.png and plume-spectrum.png, or those that are named.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from PIL import Image

from docs.tools.blender import registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import tiled, titled
from docs.tools.plot_examples import draw, open_scene, render
from docs.tools.plots import pyplot

SPOT = (0.75, 0.0, 1.35)  # m, of the plume scene: on the axis, between the shocks behind the nozzle


def draw_street(folder: Path) -> None:
    """The street without fog and in fog."""
    parts = []
    for bands, fog in (((8.1, 11.9), False), ((8.1, 11.9), True)):
        scene = open_scene("street")
        scene.infrared.wavelength_min, scene.infrared.wavelength_max = bands
        scene.render.resolution_percentage = 50
        if not fog:
            for key in ("gas", "depth"):
                del scene.world[key]
        title = f"{bands[0]:g} to {bands[1]:g} um, {'fog' if fog else 'clear air'}"
        path = folder / f"street-{len(parts)}.png"
        render(path)
        with Image.open(path) as picture:
            parts.append(titled(picture.convert("RGB"), title))
    tiled(parts, 2).save(IMAGES / "example-street.png", optimize=True)


def spectrum(path: Path, air: bool) -> tuple[np.ndarray, np.ndarray]:
    """Edges (b + 1,) of the bands in um, and the spectral radiance (b,) at SPOT, W m-2 sr-1 um-1."""
    from addon.rendering.last_render import finished_layers

    scene = open_scene("plume")
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.infrared.passes, scene.infrared.photons_per_pass = 12, 1000
    if not air:
        for key in ("gas", "depth"):
            del scene.world[key]
    bpy.context.view_layer.update()
    across, up, _ = world_to_camera_view(scene, scene.camera, Vector(SPOT))
    render(path)
    images = next(iter(finished_layers.values()))
    return images["band_edges"], np.array([band[int(48 * up), int(64 * across)] for band in images["bands"]])


def draw_spectrum(folder: Path) -> None:
    """Radiance over wavelength in the middle of the plume, seen through air and without."""
    figure, axis = pyplot().subplots(figsize=(8, 4.2), layout="constrained")
    for air, label, colour in ((False, "without air", "0.6"), (True, "through 12 m of air", "tab:red")):
        edges, radiance = spectrum(folder / "spectrum.png", air)
        axis.stairs(radiance, edges, label=label, color=colour, fill=not air, linewidth=1.6)
    axis.set(
        xlim=(3.9, 5.0),
        xlabel="wavelength, \u00b5m",
        ylabel="spectral radiance, W m\u207b\u00b2 sr\u207b\u00b9 \u00b5m\u207b\u00b9",
    )
    axis.legend()
    figure.savefig(IMAGES / "plume-spectrum.png", dpi=90)


def main() -> None:
    names = sys.argv[1:] or ["plume", "steam", "street", "spectrum"]
    with registered(), tempfile.TemporaryDirectory() as folder:
        for name in names:
            if name == "street":
                draw_street(Path(folder))
            elif name == "spectrum":
                draw_spectrum(Path(folder))
            else:
                draw(name)


if __name__ == "__main__":
    main()
