# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring tools in Blender: settings, operators, files, and readings of a render against sums by hand."""

import pytest

bpy = pytest.importorskip("bpy")

from addon.measure_settings import KIND_ITEMS, add_tool  # noqa: E402
from addon.measuring.regions import KINDS  # noqa: E402

PLACES = {
    "SPOT": [(0.25, 0.5)],
    "LINE": [(0.1, 0.2), (0.9, 0.7)],
    "BOX": [(0.1, 0.1), (0.4, 0.5)],
    "ELLIPSE": [(0.5, 0.5), (0.9, 0.9)],
    "POLYGON": [(0.1, 0.6), (0.5, 0.6), (0.3, 0.9), (0.2, 0.8)],
}


def tools():
    return bpy.context.scene.infrared.measuring_tools


def in_plain_values():
    """Everything that a file keeps of the tools."""
    return [(t.name, t.kind, t.places(), t.use_own_emissivity, t.emissivity) for t in tools()]


def test_the_kinds_to_choose_are_those_that_can_be_measured():
    assert tuple(item[0] for item in KIND_ITEMS) == KINDS


def test_tools_are_kept_in_the_file(tmp_path):
    infrared = bpy.context.scene.infrared
    for kind in (*KINDS, "BOX"):
        add_tool(infrared, kind, PLACES[kind])
    tools()[2].use_own_emissivity, tools()[2].emissivity = True, 0.5
    before = in_plain_values()
    assert [each[0] for each in before] == ["Spot", "Line", "Box", "Ellipse", "Polygon", "Box 2"]
    assert infrared.tool_index == 5
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "tools.blend"))
    tools().clear()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "tools.blend"))
    assert in_plain_values() == before


def test_spots_of_earlier_files_become_tools(tmp_path):
    spots = bpy.context.scene.infrared.spots
    for position in ((0.25, 0.5), (0.75, 0.125)):
        spots.add().position = position
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "old.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "old.blend"))
    assert [(t.kind, t.places()) for t in tools()] == [("SPOT", [(0.25, 0.5)]), ("SPOT", [(0.75, 0.125)])]
    assert not bpy.context.scene.infrared.spots
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "new.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "new.blend"))
    assert len(tools()) == 2
