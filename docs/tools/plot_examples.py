# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the pictures of the examples without gas. Needs Blender as a Python module.

    python -m docs.tools.plot_examples [facade] [engine] [people] [car]

makes all of images/example-facade.png, -engine.png, -people.png and -car.png, or those that are named, and tells the
time that each took.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import bpy

from docs.tools.blender import registered
from docs.tools.paths import DOCS, IMAGES


def open_scene(name: str):
    """Open the file of an example; returns its scene, which renders all its passes however long that takes."""
    bpy.ops.wm.open_mainfile(filepath=str(DOCS / "examples" / f"{name}.blend"), load_ui=False)
    bpy.context.scene.infrared.time_limit = 0.0
    return bpy.context.scene


def render(path: Path) -> None:
    """Render the open file and export its picture with the colour bar."""
    start = time.monotonic(), time.process_time()
    bpy.ops.render.render()
    print(f"{path.stem}: {time.monotonic() - start[0]:.0f} s, {time.process_time() - start[1]:.0f} s of processor time")
    bpy.ops.infrared.export_picture(filepath=str(path))


def draw(name: str) -> None:
    """The picture of an example as it is."""
    open_scene(name)
    render(IMAGES / f"example-{name}.png")


def main() -> None:
    with registered():
        for name in sys.argv[1:] or ["facade", "engine", "people", "car"]:
            draw(name)


if __name__ == "__main__":
    main()
