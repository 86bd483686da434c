# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the application template: what *File > New > Infrared Photons* opens.

    python -m docs.tools.make_template

Blender's own start-up window, with a floor, a warm cube and a mirror ball under a clear sky, ready to render.
"""

from __future__ import annotations

import bpy
import numpy as np

from docs.examples import modelling
from docs.tools.paths import TEMPLATE


def build() -> None:
    """Change Blender's start-up scene; the add-on has to be registered."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    paint = modelling.surface("Paint", "Paint, ultra-flat black", colour=(0.6, 0.2, 0.1))
    metal = modelling.surface("Polished metal", "Aluminium, polished", specular=1.0, colour=(0.8, 0.8, 0.85))
    floor = modelling.surface("Floor", 0.9, specular=0.3, roughness=0.2, colour=(0.4, 0.4, 0.4))
    modelling.add("Cube", modelling.box((-1, -1, -1), (1, 1, 1)), paint, 320.0, (0, 0, 1))
    modelling.add("Floor", modelling.grid((-10, -10, 0), (20, 0, 0), (0, 20, 0), 20), floor, 290.0)
    angle = np.linspace(0.01, np.pi - 0.01, 49)
    ball = modelling.turned(0.8 * np.column_stack((np.sin(angle), -np.cos(angle))), 96)
    modelling.add("Mirror Ball", ball, metal, 295.0, (2.4, -0.6, 0.8))
    modelling.add_sky("World", 260.0)
    modelling.add_camera((7.2, -6.6, 4.4), (0.7, -0.2, 0.75), lens=50.0)
    modelling.choose_settings((7.5, 14.0, 16), "IRON", (283.15, 323.15), target_noise=0.1)
    scene = bpy.context.scene
    scene.infrared.range_mode = "AUTOMATIC"  # new objects may have any temperature
    scene.render.filepath = "/tmp/"  # as in Blender's own start-up file: this file has no folder yet


if __name__ == "__main__":
    TEMPLATE.parent.mkdir(exist_ok=True)
    modelling.save(build, TEMPLATE, empty=False)
