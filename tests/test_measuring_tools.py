# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring tools in Blender: settings, operators, files, and readings of a render against sums by hand."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.constants import c, h, k
from scipy.integrate import simpson

bpy = pytest.importorskip("bpy")

from addon.heat_settings import read_scale  # noqa: E402
from addon.measure_settings import KIND_ITEMS, add_tool  # noqa: E402
from addon.measuring.regions import KINDS  # noqa: E402
from addon.output.temperature_scale import Isotherm, TemperatureScale  # noqa: E402
from addon.rendering import readings  # noqa: E402
from addon.rendering.last_render import finished_frames, finished_layers, forget_last_render  # noqa: E402
from addon.ui.measuring import graphs, tool_operators, workspace_tools  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, render_to_exr  # noqa: E402

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


# Operators


def add(kind, places=None):
    points = [{"name": "", "position": place} for place in places or PLACES[kind]]
    return bpy.ops.infrared.tool_add(kind=kind, points=points)


@pytest.mark.parametrize("kind", KINDS)
def test_a_script_adds_tools_and_is_told_what_is_missing(kind):
    assert add(kind) == {"FINISHED"}
    assert [(t.kind, [pytest.approx(p) for p in t.places()]) for t in tools()] == [(kind, PLACES[kind])]
    if kind != "SPOT":
        with pytest.raises(RuntimeError, match="needs"):
            add(kind, [(0.5, 0.5)])
        assert len(tools()) == 1


def test_removing_keeps_the_choice_where_there_is_one():
    infrared = bpy.context.scene.infrared
    assert not bpy.ops.infrared.tool_remove.poll()
    for kind in KINDS:
        add(kind)
    infrared.tool_index = 2
    assert bpy.ops.infrared.tool_remove(index=0) == {"FINISHED"}
    assert [t.kind for t in tools()] == list(KINDS[1:]) and infrared.tool_index == 1  # still the box
    bpy.ops.infrared.tool_remove()
    assert [t.kind for t in tools()] == ["LINE", "ELLIPSE", "POLYGON"] and infrared.tool_index == 1
    with pytest.raises(RuntimeError, match="no measuring tool 7"):
        bpy.ops.infrared.tool_remove(index=7)
    infrared.tool_index = 2
    bpy.ops.infrared.tool_remove()
    assert infrared.tool_index == 1
    bpy.ops.infrared.tool_remove(all=True)
    assert len(tools()) == 0 and infrared.tool_index == 0


def test_undo_takes_tools_back():
    bpy.ops.ed.undo_push(message="Start")
    add("SPOT")
    bpy.ops.ed.undo_push(message="Spot")
    add("BOX")
    bpy.ops.ed.undo_push(message="Box")
    bpy.ops.ed.undo()
    assert [t.kind for t in tools()] == ["SPOT"]
    bpy.ops.ed.redo()
    assert [(t.kind, len(t.points)) for t in tools()] == [("SPOT", 1), ("BOX", 2)]


def test_every_kind_has_a_tool_in_the_toolbar_with_an_icon():
    from bl_ui.space_toolsystem_common import ToolSelectPanelHelper

    helper = ToolSelectPanelHelper._tool_class_from_space_type("IMAGE_EDITOR")
    found = {
        item.idname: item for item in helper._tools_flatten(helper.tools_from_context(bpy.context, "VIEW")) if item
    }
    for kind in KINDS:
        item = found[workspace_tools.tool_id(kind)]
        icon = Path(item.icon + ".dat").read_bytes()
        assert icon.startswith(b"VCO\0") and (len(icon) - 8) % 18 == 0  # whole triangles, as Blender reads them
        assert bpy.app.icons.new_triangles_from_file(item.icon + ".dat") > 0


# Readings of a render


COLD, WARM = 280.0, 340.0  # K
LEFT, RIGHT = [(0.0, 0.0), (0.5, 1.0)], [(0.5, 0.0), (1.0, 1.0)]


@pytest.fixture
def picture(tmp_path):
    """Of two black walls, COLD in the left half and WARM in the right, which reflect nothing: every pixel is known."""
    camera()
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 1000, 2, 1
    for temperature, x in ((COLD, -20.0), (WARM, 20.0)):
        mesh = cube_mesh()
        mesh.materials.append(material(emissivity=1.0))
        wall = link("Wall", mesh, temperature=temperature)
        wall.scale, wall.location = (40.0, 40.0, 40.0), (x, 0.0, -20.0)
    render_to_exr(tmp_path)
    yield readings.finished_picture(finished_layers["ViewLayer"], finished_frames["ViewLayer"])
    forget_last_render()


def read(kind, places, picture):
    infrared = bpy.context.scene.infrared
    return readings.read_tool(add_tool(infrared, kind, places), picture, infrared)


def test_tools_read_a_render(picture):
    """Black walls have no noise, and their temperatures are exact but for float32."""
    near = {"abs": 1e-3}  # K
    left, right, both = (read("BOX", places, picture) for places in (LEFT, RIGHT, [(0.0, 0.0), (1.0, 1.0)]))
    assert [left.minimum, left.maximum, left.mean] == [pytest.approx(COLD, **near)] * 3
    assert [right.minimum, right.maximum, right.mean] == [pytest.approx(WARM, **near)] * 3
    assert both.mean == pytest.approx(0.5 * (COLD + WARM), **near)
    assert both.deviation == pytest.approx(0.5 * (WARM - COLD), **near)
    assert (left.count, both.count, left.area, both.area) == (8 * 12, 16 * 12, 0.5, 1.0)
    assert left.error_of_mean == pytest.approx(0.0, **near)
    line = read("LINE", [(0.01, 0.5), (0.99, 0.5)], picture)
    profile = readings.tool_values(tools()[-1], picture, bpy.context.scene.infrared)
    np.testing.assert_allclose(profile, [COLD] * 8 + [WARM] * 8, atol=1e-3)
    assert line.count == 16 and line.place_of_minimum[1] < 8 <= line.place_of_maximum[1]


def seen_radiance(kelvin):
    """Of a blackbody from 7.5 to 14 um, W m-2 sr-1: Planck's law by the rule of Simpson."""
    wavelength = np.linspace(7.5e-6, 14e-6, 2001)  # m
    spectral = 2 * h * c**2 / wavelength**5 / np.expm1(h * c / (wavelength * k * kelvin))
    return simpson(spectral, x=wavelength)


def corrected_by_hand(kelvin, emissivity, reflected):
    """The temperature that with the reflection gives the radiance of a blackbody at `kelvin`; by bisection."""
    wanted = (seen_radiance(kelvin) - (1 - emissivity) * seen_radiance(reflected)) / emissivity
    low, high = 1.0, 2000.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if seen_radiance(middle) < wanted else (low, middle)
    return low


def test_a_tools_own_emissivity_counts_for_it_alone(picture):
    """To 1 mK."""
    infrared = bpy.context.scene.infrared
    for places in (LEFT, LEFT, RIGHT):
        add_tool(infrared, "BOX", places)
    own = tools()[1]
    own.use_own_emissivity, own.emissivity, own.reflected_temperature = True, 0.6, 250.0
    means = [readings.read_tool(tool, picture, infrared).mean for tool in tools()]
    expected = [COLD, corrected_by_hand(COLD, 0.6, 250.0), WARM]
    assert expected[1] > COLD + 5
    np.testing.assert_allclose(means, expected, atol=1e-3)


def test_the_pictures_correction_counts_at_once(picture, tmp_path):
    """For tools, the automatic range, exports and the picture, without a render; to 1 mK."""
    infrared = bpy.context.scene.infrared
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.7, 260.0
    expected = [corrected_by_hand(kelvin, 0.7, 260.0) for kelvin in (COLD, WARM)]
    means = [read("BOX", places, picture).mean for places in (LEFT, RIGHT)]
    np.testing.assert_allclose(means, expected, atol=1e-3)
    temperature = readings.temperature_now(picture, infrared)
    np.testing.assert_allclose(temperature[0, [0, -1]], expected, atol=1e-3)
    scale = readings.fitted(read_scale(infrared), temperature)
    np.testing.assert_allclose((scale.low, scale.high), expected, atol=1e-3)
    images, frame = finished_layers["ViewLayer"], finished_frames["ViewLayer"]
    exported = readings.images_now(images, frame, infrared)
    np.testing.assert_array_equal(exported["temperature"], temperature)
    assert exported["metadata"]["assumedEmissivity"] == 0.7 and images["metadata"]["assumedEmissivity"] == 1.0
    infrared.assumed_emissivity = 0.0  # the checks tell; the picture stays as rendered
    assert readings.temperature_now(picture, infrared) is picture.temperature
    infrared.assumed_emissivity = 1.0
    assert readings.images_now(images, frame, infrared) is images


def test_the_range_of_a_rectangle_and_of_a_tool(picture):
    """As the mouse drags it: from any corner, in part outside the picture; with the correction of now."""
    seen, infrared = SimpleNamespace(picture=picture), bpy.context.scene.infrared
    within = tool_operators.range_within
    assert within(seen, infrared, (0.1, 0.1), (0.4, 0.9)) == (pytest.approx(COLD), pytest.approx(COLD))
    assert within(seen, infrared, (1.3, 1.2), (0.2, -0.1)) == (pytest.approx(COLD), pytest.approx(WARM))
    assert within(seen, infrared, (1.1, 1.1), (1.3, 1.2)) is None
    tool_operators.fix_range(infrared, COLD, COLD)  # of one temperature: the middle of the palette
    assert (infrared.range_mode, infrared.range_low, infrared.range_high) == ("FIXED", COLD - 0.5, COLD + 0.5)


def test_readings_are_kept_until_something_changes(picture, monkeypatch):
    """A window that is drawn again measures nothing again."""
    measured = []
    real = readings.measure_values
    monkeypatch.setattr(readings, "measure_values", lambda *args: measured.append(1) or real(*args))
    infrared = bpy.context.scene.infrared
    tool = add_tool(infrared, "ELLIPSE", PLACES["ELLIPSE"])
    first = readings.read_tool(tool, picture, infrared)
    assert readings.read_tool(tool, picture, infrared) is first and len(measured) == 1
    tool.points[0].position = 0.0, 0.0
    assert readings.read_tool(tool, picture, infrared).count > first.count and len(measured) == 2
    infrared.use_isotherm, infrared.isotherm_low, infrared.isotherm_high = True, 200.0, 300.0
    larger = readings.read_tool(tool, picture, infrared)
    assert larger.in_isotherm > 0 and len(measured) == 3
    infrared.assumed_emissivity = 0.9
    assert readings.read_tool(tool, picture, infrared).maximum > larger.maximum and len(measured) == 4


def test_the_hottest_and_the_coldest_pixel_are_found(picture):
    infrared = bpy.context.scene.infrared
    cold, hot = readings.extremes_now(picture, infrared)
    assert (
        picture.temperature[cold] == picture.temperature.min() and picture.temperature[hot] == picture.temperature.max()
    )


def test_graphs_show_the_values_and_the_isotherm():
    """A rising profile rises in its picture; a histogram's columns are as high as their bins are full."""
    values = np.linspace(290.0, 310.0, 100).astype(np.float32)
    image = graphs.profile_image(values, TemperatureScale(isotherm=Isotherm(295.0, 300.0, (0.0, 1.0, 0.0))))
    red = image[..., 0] > 0.8
    assert image.shape == (256, 256, 4)
    assert np.argmax(red[:, 5]) < np.argmax(red[:, 128]) < np.argmax(red[:, 250])
    green = image[..., 1] - image[..., 0] > 0.1
    assert green[60:120].any() and not green[140:].any() and not green[:40].any()
    two = np.array([290.0] * 30 + [310.0] * 60, np.float32)
    columns = (
        graphs.histogram_image(two, TemperatureScale(low=280.0, high=320.0), (290.0, 310.0))[..., :3].max(axis=2) > 0.2
    )
    heights = columns.sum(axis=0)
    assert heights[0] == pytest.approx(0.5 * heights[-1], abs=2) and heights[128] == 0
