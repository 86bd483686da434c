# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports of measured renders: picture, table and report, of a frame and of an animation, headless."""

import base64
import csv
import math
import re
from html import unescape

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.measure_settings import add_tool  # noqa: E402
from addon.rendering.frame_tools import STRIP_LENGTH, Strip, frames_path, over_frames, reduced, strips  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver.physics.spectrum import apparent_temperature, sensor_radiance, uniform_edges  # noqa: E402
from tests.helpers.blender import grey_plate, read_png, render_to_exr  # noqa: E402

EDGES, WEIGHTS = uniform_edges(7.5, 14.0, 4), np.ones(4)
EVIL = '<img src=x onerror="alert(1)">&'


@pytest.fixture
def infrared(reset_blender):
    """A grey plate at 320 K in the middle of the picture, under a sky of 260 K, which is all that it reflects."""
    return grey_plate(32, 24, 2.0, "Plate")


def plate(emissivity=1.0, reflected=293.15, kelvin=320.0):
    """The temperature, K, that a camera reads on the plate by these parameters: S = .8 S(320 K) + .2 S(260 K)."""
    seen, sky = (sensor_radiance(EDGES, WEIGHTS, np.array(each)) for each in (kelvin, 260.0))
    left = 0.8 * seen + 0.2 * sky - (1.0 - emissivity) * sensor_radiance(EDGES, WEIGHTS, np.array(reflected))
    return apparent_temperature(left / emissivity, EDGES, WEIGHTS).item()


def place_tools(infrared):
    add_tool(infrared, "SPOT", [(0.5, 0.5)], EVIL)
    add_tool(infrared, "BOX", [(0.4, 0.4), (0.6, 0.6)], "Inside")
    add_tool(infrared, "LINE", [(0.02, 0.5), (0.98, 0.5)], "Across")
    own = add_tool(infrared, "BOX", [(0.4, 0.4), (0.6, 0.6)], "Own")
    own.use_own_emissivity, own.emissivity, own.reflected_temperature = True, 0.8, 260.0


def table(path):
    """{name of the tool: {title: text}}, or of several frames a list of these."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_tells_what_a_camera_reads(infrared, tmp_path):
    """By hand to 1 mK: the plate as a blackbody, and with its emissivity and the sky its own temperature."""
    place_tools(infrared)
    render_to_exr(tmp_path)
    assert bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv")) == {"FINISHED"}
    spot, inside, across, own = table(tmp_path / "tools.csv")
    assert (spot["Name"], inside["Kind"], across["View Layer"], own["Number"]) == (EVIL, "Box", "ViewLayer", "4")
    assert spot["Frame"] == str(bpy.context.scene.frame_current)
    for tool in (spot, inside):
        assert float(tool["Mean (K)"]) == pytest.approx(plate(), abs=1e-3)
    assert float(across["Minimum (K)"]) == pytest.approx(260.0, abs=1e-3)
    assert float(own["Mean (K)"]) == pytest.approx(320.0, abs=1e-3)
    assert (own["Emissivity"], own["Reflected Temperature (K)"], spot["Emissivity"]) == ("0.8", "260.0000", "1")
    assert inside["Pixels"] == "24"  # columns 13 to 18, rows 10 to 13


def test_parameters_changed_afterwards_count_without_a_render(infrared, tmp_path):
    place_tools(infrared)
    render_to_exr(tmp_path)
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.8, 260.0
    infrared.optics_transmission, infrared.optics_temperature = 0.5, 260.0
    bpy.context.scene.unit_settings.temperature_unit = "CELSIUS"
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv"))
    spot = table(tmp_path / "tools.csv")[0]
    seen, sky = (sensor_radiance(EDGES, WEIGHTS, np.array(each)) for each in (320.0, 260.0))
    left = (0.8 * seen + 0.2 * sky - 0.5 * 0.2 * sky - 0.5 * sky) / (0.8 * 0.5)
    expected = apparent_temperature(left, EDGES, WEIGHTS).item() - 273.15
    assert float(spot["Mean (°C)"]) == pytest.approx(expected, abs=1e-3)
    assert (spot["Optics Transmission"], spot["Optics Temperature (°C)"]) == ("0.5", "-13.1500")


def test_a_report_shows_the_picture_and_what_the_tools_read(infrared, tmp_path):
    place_tools(infrared)
    infrared.use_isotherm, infrared.isotherm_low, infrared.isotherm_high = True, 300.0, 330.0
    infrared.difference_of, infrared.difference_to = "Own", "Inside"
    render_to_exr(tmp_path)
    assert bpy.ops.infrared.export_report(filepath=str(tmp_path / "report")) == {"FINISHED"}
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    [data] = re.findall(r'"data:image/png;base64,([^"]+)"', text)
    (tmp_path / "inside.png").write_bytes(base64.b64decode(data, validate=True))
    assert read_png(tmp_path / "inside.png").shape == (24, 32, 3)
    assert bpy.ops.infrared.export_picture(
        filepath=str(tmp_path / "a.png"), colour_bar=False, tools=False, table=False
    ) == {"FINISHED"}
    np.testing.assert_array_equal(read_png(tmp_path / "inside.png"), read_png(tmp_path / "a.png"))
    assert EVIL not in text and EVIL in unescape(text) and "<script" not in text and "http" not in text
    for found in ("Inside", "Infrared Photons", bpy.app.version_string, "7.5 to 14 µm", "not saved yet", "Camera"):
        assert found in text
    [shown] = re.findall(r"<td>4 Own - 2 Inside</td><td>([\d.]+) ± [\d.]+ K</td>", text)
    assert float(shown) == pytest.approx(320.0 - plate(), abs=0.006)  # it has two decimals at least
    [[most]] = [re.findall(r"below ([\d.e-]+) K in 95 %", text)]
    [layer] = finished_layers.values()
    assert float(most) == pytest.approx(np.percentile(layer["noise"], 95), rel=0.01, abs=1e-9)


def test_the_exported_picture_has_tools_and_table(infrared, tmp_path):
    place_tools(infrared)
    render_to_exr(tmp_path)
    bpy.ops.infrared.export_picture(filepath=str(tmp_path / "plain.png"), tools=False, table=False)
    bpy.ops.infrared.export_picture(filepath=str(tmp_path / "tools.png"), table=False)
    bpy.ops.infrared.export_picture(filepath=str(tmp_path / "all.png"))
    plain, tools, everything = (read_png(tmp_path / f"{name}.png") for name in ("plain", "tools", "all"))
    larger = 10  # of the 32 pixels across, so that tools have room
    picture = plain[-24:, :32].repeat(larger, axis=0).repeat(larger, axis=1)
    shown = tools[-24 * larger :, : 32 * larger]
    changed = np.abs(shown.astype(int) - picture).max(axis=2) > 20
    assert 0.01 < changed.mean() < 0.2  # outlines and labels
    assert everything.shape[0] > tools.shape[0] + 4 * 13
    assert everything[: everything.shape[0] - tools.shape[0]].max() > 200  # light letters under it


def test_the_table_of_band_images_in_a_folder_is_there_too(infrared, tmp_path):
    infrared.band_exr_path = f"{tmp_path}/"
    assert frames_path(bpy.context.scene) == tmp_path / "infrared_tools.csv"


def test_an_animation_is_followed_in_memory_and_in_a_file(infrared, tmp_path):
    """The plate warms from 320 K to 340 K; each frame is read as it is rendered, to 1 mK."""
    scene, plate_object = bpy.context.scene, bpy.data.objects["Plate"]
    place_tools(infrared)
    for frame, kelvin in ((1, 320.0), (2, 330.0), (3, 340.0)):
        plate_object["temperature"] = kelvin
        plate_object.keyframe_insert('["temperature"]', frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    infrared.band_exr_path = str(tmp_path / "bands_####.exr")
    assert frames_path(scene) == tmp_path / "bands_tools.csv"
    render_to_exr(tmp_path, animation=True)
    written = table(tmp_path / "bands_tools.csv")
    own = [row for row in written if row["Name"] == "Own"]
    assert [row["Frame"] for row in own] == ["1", "2", "3"]
    for row, kelvin in zip(own, (320.0, 330.0, 340.0), strict=True):
        assert float(row["Mean (K)"]) == pytest.approx(kelvin, abs=1e-3)
    assert len(over_frames(scene)) == 12
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "again.csv"))
    assert table(tmp_path / "again.csv") == written
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "last.csv"), frames=False)
    assert {row["Frame"] for row in table(tmp_path / "last.csv")} == {"3"}
    bpy.ops.infrared.export_report(filepath=str(tmp_path / "report.html"))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Over frames" in text and text.count("<circle") == 12
    assert text.count("<figcaption>") == 3 and "frames 1 to 3" in text
    bpy.ops.infrared.export_report(filepath=str(tmp_path / "last.html"), frames=False)
    assert "<figcaption>" not in (tmp_path / "last.html").read_text(encoding="utf-8")
    small = strips(scene)["ViewLayer"]
    last = finished_layers["ViewLayer"]["temperature"]
    np.testing.assert_array_equal(small[3], last)  # which is narrower than a small picture may be
    render_to_exr(tmp_path)
    assert over_frames(scene) == [] and strips(scene) == {}  # another render


def test_small_pictures_are_means_of_blocks():
    picture = np.arange(7 * 401, dtype=np.float32).reshape(7, 401)
    small = reduced(picture)
    assert small.shape == (2, 133)  # 3 x 3 pixels each; a row and two columns remain
    np.testing.assert_allclose(small[1, 2], picture[3:6, 6:9].mean())
    assert reduced(picture[:2]).shape == (1, 133)


@pytest.mark.parametrize("count", [1, STRIP_LENGTH, STRIP_LENGTH + 1, 1000])
def test_small_pictures_are_spread_evenly_over_the_frames(count):
    strip = Strip()
    for frame in range(count):
        strip.add(frame, np.full((2, 2), float(frame)))
    kept = list(strip.frames)
    assert kept[0] == 0 and len(set(np.diff(kept))) <= 1 and len(kept) <= STRIP_LENGTH
    assert 2 * len(kept) > min(count, STRIP_LENGTH) and kept[-1] >= count - count / len(kept) - 1
    assert all(image[0, 0] == frame for frame, image in strip.frames.items())


def test_a_tool_that_is_keyed_is_read_as_it_is_in_the_frame(infrared, tmp_path):
    """From the plate to the sky, and with an emissivity that changes."""
    scene = bpy.context.scene
    moving = add_tool(infrared, "SPOT", [(0.5, 0.5)], "Moving")
    moving.use_own_emissivity = True
    for frame, place, emissivity in ((1, 0.5, 1.0), (2, 0.5, 0.8), (3, 0.02, 1.0)):
        moving.points[0].position[0], moving.emissivity, moving.reflected_temperature = place, emissivity, 260.0
        for name in ("points[0].position", "emissivity"):
            scene.keyframe_insert(f"infrared.measuring_tools[0].{name}", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    render_to_exr(tmp_path, animation=True)
    kelvin = [tool.measurement.mean for tool in over_frames(scene)]
    np.testing.assert_allclose(kelvin, [plate(), 320.0, 260.0], rtol=0, atol=1e-3)


def test_a_table_that_is_in_the_way_ends_no_animation(infrared, tmp_path):
    add_tool(infrared, "SPOT", [(0.5, 0.5)])
    (tmp_path / "bands_tools.csv").mkdir()
    infrared.band_exr_path = str(tmp_path / "bands_####.exr")
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 2
    render_to_exr(tmp_path, animation=True)
    assert (tmp_path / "bands_0002.exr").is_file() and len(over_frames(bpy.context.scene)) == 2
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv"))
    assert len(table(tmp_path / "tools.csv")) == 2


def test_view_layers_are_told_apart(infrared, tmp_path):
    place_tools(infrared)
    bpy.context.scene.view_layers.new("Other & more")
    render_to_exr(tmp_path)
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv"))
    rows = table(tmp_path / "tools.csv")
    assert [row["View Layer"] for row in rows] == ["ViewLayer"] * 4 + ["Other & more"] * 4
    bpy.ops.infrared.export_report(filepath=str(tmp_path / "report.html"))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.count("data:image/png") == 2 and "Other &amp; more, frame" in text


def test_a_tool_where_no_temperature_fits_has_no_value(infrared, tmp_path):
    """The sky sends less than what is said to be reflected."""
    add_tool(infrared, "SPOT", [(0.01, 0.01)], "Sky")
    add_tool(infrared, "BOX", [(0.0, 0.0), (1.0, 1.0)], "All")
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.1, 300.0
    render_to_exr(tmp_path)
    for _ in range(2):  # rendered so, and changed afterwards
        bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv"))
        sky, everything = table(tmp_path / "tools.csv")
        assert sky["Mean (K)"] == everything["Mean (K)"] == "" and sky["Pixels"] == "1"
        bpy.ops.infrared.export_report(filepath=str(tmp_path / "report.html"))
        assert "no value" in (tmp_path / "report.html").read_text(encoding="utf-8")
        infrared.reflected_temperature = 310.0


def test_bad_paths_are_named(infrared, tmp_path):
    add_tool(infrared, "SPOT", [(0.5, 0.5)])
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.infrared.export_report(filepath=str(tmp_path / "a.html"))
    render_to_exr(tmp_path)
    for export, name in ((bpy.ops.infrared.export_report, "a.html"), (bpy.ops.infrared.export_table, "a.csv")):
        with pytest.raises(RuntimeError, match="missing.*no such folder|no such folder.*missing"):
            export(filepath=str(tmp_path / "missing" / name))
    infrared.measuring_tools.clear()
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.infrared.export_table(filepath=str(tmp_path / "a.csv"))
    assert bpy.ops.infrared.export_report(filepath=str(tmp_path / "a.html")) == {"FINISHED"}


def test_an_error_is_known_or_left_out(infrared, tmp_path):
    """After a single pass nothing is known of the error."""
    add_tool(infrared, "SPOT", [(0.5, 0.5)])
    infrared.passes = 1
    render_to_exr(tmp_path)
    bpy.ops.infrared.export_table(filepath=str(tmp_path / "tools.csv"))
    [spot] = table(tmp_path / "tools.csv")
    assert spot["Error of Mean (K)"] == "" and math.isfinite(float(spot["Mean (K)"]))
    bpy.ops.infrared.export_report(filepath=str(tmp_path / "report.html"))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "(error unknown)" in text and "<dt>Noise</dt><dd>unknown</dd>" in text
