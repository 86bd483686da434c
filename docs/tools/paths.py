# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the files are that scripts read and write."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
IMAGES = DOCS / "images"
DEMO = DOCS / "demo" / "demo.blend"
DEMO_BANDS = ROOT / "render" / "demo-bands.exr"  # of `python run.py demo`
EXAMPLES = DOCS / "examples"
TEMPLATE = DOCS / "template" / "Infrared_Photons" / "startup.blend"  # Blender's menus show the folder's name
