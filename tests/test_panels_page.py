# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/panels.md has every panel, every setting and a picture of each tab."""

import re
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = (DOCS / "panels.md").read_text(encoding="utf-8")


def test_every_panel_is_on_the_page():
    panels = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("INFRARED_PT_")]
    # Blender gives a menu of presets the name of the one that was chosen last
    labels = {panel.bl_label for panel in panels if not hasattr(panel, "preset_subdir")}
    assert len(labels) > 10
    assert not {label for label in labels if label not in PAGE}


def test_every_setting_is_on_the_page():
    settings = [
        each for each in bpy.context.scene.infrared.bl_rna.properties if each.type not in ("POINTER", "COLLECTION")
    ]
    names = {each.name.partition(" (")[0] for each in settings} - {"Name"}
    assert len(names) > 20
    assert not {name for name in names if name not in PAGE}


def test_every_picture_is_there():
    pictures = re.findall(r"\((images/panel-[\w-]+\.png)\)", PAGE)
    assert len(pictures) == len(set(pictures)) == 10
    assert all((DOCS / picture).is_file() for picture in pictures)
