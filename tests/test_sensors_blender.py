# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors in Blender: the menu, an imported response that the file keeps, checks, and what a render makes of them."""

import re
from unittest.mock import MagicMock, patch

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.bands import read_adaptive_bands  # noqa: E402
from addon.reading.sensor import read_response  # noqa: E402
from addon.reading.settings import read_settings  # noqa: E402
from addon.rendering.checks import scene_checks, sensor_checks  # noqa: E402
from addon.solver.physics import library, sensors  # noqa: E402
from addon.solver.physics.band_partition import choose_bands  # noqa: E402
from addon.solver.physics.spectrum import (  # noqa: E402
    apparent_temperature,
    band_names,
    sensor_radiance,
    uniform_edges,
)
from addon.solver.scene import SceneError  # noqa: E402
from addon.ui.sensor_panel import INFRARED_PT_sensor  # noqa: E402
from tests.helpers.blender import grey_plate, read, render_to_exr  # noqa: E402

TABLE = "wavelength (um), response\n7, 0\n10, 4\n13, 1\n"
POINTS = [7.0, 0.0, 10.0, 4.0, 13.0, 1.0]


@pytest.fixture
def infrared(reset_blender):
    return grey_plate()


def test_the_menu_chooses_the_response(infrared):
    assert infrared.sensor == "BOX" and read()[0].response is None
    for name, make in sensors.BUILT_IN.items():
        if name != "INSB":
            infrared.sensor = name
            np.testing.assert_array_equal(read()[0].response.points, make().points)


def test_an_imported_response_stays_in_the_file(infrared, tmp_path):
    (tmp_path / "camera.csv").write_text(TABLE)
    assert bpy.ops.infrared.sensor_import(filepath=str(tmp_path / "camera.csv")) == {"FINISHED"}
    assert infrared.sensor == "CUSTOM" and bpy.context.scene["sensor_response"].to_list() == POINTS
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "camera.csv").unlink()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    np.testing.assert_array_equal(read()[0].response.points.ravel(), POINTS)


def test_a_bad_file_changes_nothing(infrared, tmp_path):
    path = tmp_path / "camera.csv"
    path.write_text("8 1\n9 -2\n")
    with pytest.raises(RuntimeError, match=f"{re.escape(str(path))}, line 2: response -2"):
        bpy.ops.infrared.sensor_import(filepath=str(path))
    with pytest.raises(RuntimeError, match=re.escape(str(tmp_path / "missing.csv"))):
        bpy.ops.infrared.sensor_import(filepath=str(tmp_path / "missing.csv"))
    assert infrared.sensor == "BOX" and "sensor_response" not in bpy.context.scene


@pytest.mark.parametrize(
    "value, message",
    [
        (None, "sensor_response is None, expected a flat list"),
        ("InSb", "sensor_response is 'InSb', expected a flat list"),
        ([8.0, 1.0, 9.0], "sensor_response has 3 numbers"),
        ([8.0, 1.0], "two or more pairs"),
        ([9.0, 1.0, 8.0, 1.0], "9 um is followed by 8 um"),
        ([3.0, 1.0, 5.0, 1.0], "does not respond between 7.5 and 14 um"),
    ],
)
def test_a_senseless_response_is_told(infrared, value, message):
    infrared.sensor = "CUSTOM"
    if value is not None:
        bpy.context.scene["sensor_response"] = value
    with pytest.raises(SceneError, match=message):
        read()
    [check] = [check for check in scene_checks(bpy.context.scene, bpy.context.view_layer) if check.level == "ERROR"]
    assert message in check.text


def test_a_part_outside_the_bands_is_a_warning(infrared):
    assert sensor_checks(infrared) == []
    infrared.sensor = "HGCDTE"
    lost = sensors.share_outside(sensors.hgcdte(), 7.5, 14.0, infrared.ambient_temperature)
    [check] = sensor_checks(infrared)
    assert check.level == "WARNING" and f"'HgCdTe': {lost:.0%} of its signal at 293.15 K" in check.text
    infrared.wavelength_min, infrared.wavelength_max = 2.0, 14.0
    assert sensor_checks(infrared) == []


def test_settings_reach_the_solver(infrared):
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.5, 250.0
    settings = read_settings(infrared)
    assert (settings.assumed_emissivity, settings.reflected_temperature) == (0.5, 250.0)
    infrared.assumed_emissivity = 0.0
    with pytest.raises(SceneError, match="Panel 'Spectrum > Object Parameters': Assumed Emissivity is 0"):
        read_settings(infrared)


def test_adaptive_bands_know_the_response(infrared):
    bpy.data.materials["Paint"]["emissivity"] = "Fused silica"
    infrared.band_mode, infrared.sensor = "ADAPTIVE", "MICROBOLOMETER"
    curves = [tuple(library.find("Fused silica").T)]
    expected = choose_bands(7.5, 14.0, curves, [260.0, 320.0], count=4, response=read_response(infrared).curve)
    np.testing.assert_array_equal(read_adaptive_bands(infrared).edges, expected.edges)
    infrared.sensor = "BOX"
    assert not np.array_equal(read_adaptive_bands(infrared).edges, expected.edges)


def test_a_render_through_a_sensor(infrared, tmp_path):
    """Radiance is the weighted sum of the bands, Temperature the corrected one, and the file tells both.

    The grey plate's own temperature comes out: only the sky lights it, and all rays that look for the sky find it.
    """
    infrared.sensor, infrared.assumed_emissivity, infrared.reflected_temperature = "MICROBOLOMETER", 0.8, 260.0
    infrared.band_exr_path = str(tmp_path / "bands.exr")
    images = render_to_exr(tmp_path)["ViewLayer"]
    edges = uniform_edges(7.5, 14.0, 4)
    weights = sensors.band_weights(sensors.microbolometer(), edges)
    header = OpenEXR.File(str(tmp_path / "bands.exr")).header()
    assert header["sensor"] == "Microbolometer"
    np.testing.assert_array_equal(np.array(header["bandWeights"].split(), float), weights)
    assert header["assumedEmissivity"] == "0.8"
    assert float(header["reflectedTemperature"]) == 260.0
    bands = np.array([images[name] for name in band_names(edges)], dtype=float)
    seen = np.tensordot(weights * np.diff(edges), bands, 1)
    np.testing.assert_allclose(images["Radiance"], seen, rtol=3e-7)  # bands and sum are rounded to float32
    emissivity = float(np.float32(0.8))
    reflected = (1.0 - emissivity) * sensor_radiance(edges, weights, 260.0)
    corrected = apparent_temperature((images["Radiance"].astype(float) - reflected) / emissivity, edges, weights)
    np.testing.assert_allclose(images["Temperature"], corrected, rtol=3e-7)
    np.testing.assert_allclose(images["Temperature"], 320.0, rtol=0, atol=2e-3)


def test_the_panel_is_there_and_goes(infrared):
    import addon

    assert hasattr(bpy.types, "INFRARED_PT_sensor")
    addon.unregister()
    assert not hasattr(bpy.types, "INFRARED_PT_sensor")
    addon.register()


@pytest.mark.parametrize("sensor", ["BOX", "INSB", "HGCDTE", "MICROBOLOMETER"])
def test_the_panel_shows_the_response(infrared, sensor):
    """A picture for each sensor, the settings in any case, and what the checks say."""
    column = MagicMock()
    infrared.sensor = sensor
    with patch("addon.ui.checks.draw_checks") as drawn:
        INFRARED_PT_sensor.draw_settings(None, column, infrared)
    shown = [call.args[1] for call in column.prop.call_args_list]
    assert shown == ["sensor", "sensor_lag"]
    assert column.template_icon.called == (sensor != "BOX")
    assert [check.level for check in drawn.call_args.args[1]] == {"INSB": ["ERROR"], "HGCDTE": ["WARNING"]}.get(
        sensor, []
    )
