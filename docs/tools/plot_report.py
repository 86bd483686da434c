# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure in the facade of the examples, and picture the exports. Needs Blender as a Python module, and Chromium.

    python -m docs.tools.plot_report [folder]

makes images/report-picture.png, the exported picture, and images/report.png, the report as a browser shows it. The
report itself and the table are left in a folder, if one is named.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import bpy

from addon.measure_settings import add_tool
from docs.tools.blender import registered
from docs.tools.paths import IMAGES
from docs.tools.plot_examples import open_scene

BROWSER = "chromium"
SIZE = 1000, 1480  # pixels of the browser's window
TOOLS = (  # name, kind, places
    ("Chimney pot", "SPOT", [(0.619, 0.965)]),
    ("Storeys", "LINE", [(0.535, 0.25), (0.535, 0.84)]),
    ("Wall", "BOX", [(0.46, 0.49), (0.56, 0.55)]),
    ("Bonnet", "ELLIPSE", [(0.745, 0.205), (0.905, 0.285)]),
    ("Gable", "POLYGON", [(0.32, 0.68), (0.465, 0.88), (0.68, 0.72)]),
    ("Pane", "BOX", [(0.588, 0.565), (0.615, 0.64)]),
)
GLASS, SKY = 0.84, 263.15  # emissivity of the pane, and K: what it reflects


def place_tools(infrared) -> None:
    """Tools of every kind, one of them with an emissivity of its own, and a difference."""
    for name, kind, places in TOOLS:
        tool = add_tool(infrared, kind, places, name)
    tool.use_own_emissivity, tool.emissivity, tool.reflected_temperature = True, GLASS, SKY
    infrared.difference_of, infrared.difference_to = "Gable", "Wall"


def photograph(page: Path, picture: Path) -> None:
    """What a browser shows of a page, as PNG."""
    options = ["--headless", "--no-sandbox", "--hide-scrollbars", f"--window-size={SIZE[0]},{SIZE[1]}"]
    subprocess.run([BROWSER, *options, f"--screenshot={picture}", page.as_uri()], check=True, capture_output=True)


def main() -> None:
    with registered(), tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary).resolve()
        scene = open_scene("facade")
        place_tools(scene.infrared)
        bpy.ops.render.render()
        bpy.ops.infrared.export_picture(filepath=str(IMAGES / "report-picture.png"))
        bpy.ops.infrared.export_table(filepath=str(folder / "facade.csv"))
        bpy.ops.infrared.export_report(filepath=str(folder / "facade.html"))
        photograph(folder / "facade.html", IMAGES / "report.png")


if __name__ == "__main__":
    main()
