# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera effects in Blender: passes and files that have them, what stays as it is, and what is told."""

import logging
import re
from unittest.mock import MagicMock, patch

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.rendering.camera_effects import read_detector  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.physics.sensors import band_weights  # noqa: E402
from addon.solver.physics.spectrum import sensor_radiance, uniform_edges  # noqa: E402
from addon.ui.sensor_panel import INFRARED_PT_detector  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read, read_exr, render_to_exr  # noqa: E402

KELVIN = 310.0
OURS = ("Camera Signal", "Camera Temperature")
IDEAL = {"f_number": 0.0, "netd": 0.0, "gain_spread": 0.0, "offset_spread": 0.0, "bits": 0}


@pytest.fixture
def infrared(reset_blender):
    """A black wall at one temperature before the camera; four bands."""
    camera(width=24, height=18)
    mesh = cube_mesh()
    mesh.materials.append(material(emissivity=1.0))
    link("Wall", mesh, temperature=KELVIN).scale = (20.0, 20.0, 1.0)
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads, infrared.band_count = 2, 1000, 1, 4
    return infrared


def use(infrared, **values):
    """Turn the effects on, only these ones."""
    infrared.use_detector = True
    for name, value in (IDEAL | values).items():
        setattr(infrared, f"detector_{name}", value)


def test_they_are_off_unless_asked_for(infrared, tmp_path):
    infrared.band_exr_path = str(tmp_path / "bands.exr")
    assert not infrared.use_detector
    assert not any("Camera" in name for name in render_to_exr(tmp_path)["ViewLayer"])
    file = OpenEXR.File(str(tmp_path / "bands.exr"))
    assert not any("amera" in name for name in (*file.channels(), *file.header()))


def test_the_other_passes_stay_as_they_are(infrared, tmp_path):
    link("Cube", cube_mesh(), temperature=400.0).location.z = 1.0
    plain = render_to_exr(tmp_path)["ViewLayer"]
    infrared.use_detector = True
    passes = render_to_exr(tmp_path)["ViewLayer"]
    assert set(passes) - set(plain) == set(OURS)
    for name, image in plain.items():
        np.testing.assert_array_equal(passes[name], image)
    assert not np.array_equal(passes["Camera Temperature"], passes["Temperature"])


@pytest.mark.parametrize("sensor", ["BOX", "MICROBOLOMETER"])
def test_a_black_wall_has_its_temperature_within_half_a_step(infrared, tmp_path, sensor):
    infrared.sensor = sensor
    use(infrared, f_number=1.0, bits=14)
    passes = render_to_exr(tmp_path)["ViewLayer"]
    edges = uniform_edges(7.5, 14.0, 4)
    weights = band_weights(read()[0].response, edges)
    low, high = sensor_radiance(edges, weights, np.array([233.15, 423.15]))
    step = (high - low) / (2**14 - 1) / (sensor_radiance(edges, weights, KELVIN, derivative=True) / KELVIN)  # K
    assert step < 0.02
    float32 = 4.0 * 2.0**-23 * KELVIN  # bands, their sum and the temperature are rounded
    np.testing.assert_allclose(passes["Camera Temperature"], KELVIN, rtol=0, atol=0.5 * step + float32)
    number = (sensor_radiance(edges, weights, KELVIN) - low) / (high - low) * (2**14 - 1)
    np.testing.assert_allclose(passes["Camera Signal"], number, rtol=0, atol=0.51)


def test_an_ideal_camera_shows_radiance_and_temperature(infrared, tmp_path):
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.9, 280.0
    use(infrared)
    passes = render_to_exr(tmp_path)["ViewLayer"]
    for ours, engines in zip(OURS, ("Radiance", "Temperature"), strict=True):
        np.testing.assert_allclose(passes[ours], passes[engines], rtol=1e-6)


def test_frames_differ_by_the_noise_alone(infrared, tmp_path):
    use(infrared, netd=0.05, offset_spread=1.0)
    bpy.context.scene.frame_end = 2
    render_to_exr(tmp_path, animation=True)
    first, second = (
        read_exr(tmp_path / f"image_000{frame}.exr")["ViewLayer"]["Camera Temperature"].astype(float)
        for frame in (1, 2)
    )
    # 432 pixels: standard deviations err by 3.4 % of themselves, four times that is allowed
    assert (second - first).std() == pytest.approx(np.sqrt(2.0) * 0.05, rel=0.14)
    assert first.std() == pytest.approx(1.0, rel=0.14)


def test_files_have_the_images_and_tell_the_effects(infrared, tmp_path):
    infrared.use_detector, infrared.band_exr_path = True, str(tmp_path / "bands.exr")
    infrared.file_formats = {"BAND_EXR", "SPECTRAL_EXR"}
    passes = render_to_exr(tmp_path)["ViewLayer"]
    for name in ("bands.exr", "bands_spectral.exr"):
        file = OpenEXR.File(str(tmp_path / name))
        for ours in OURS:
            np.testing.assert_array_equal(file.channels()[f"{ours}.V"].pixels[::-1], passes[ours])
        header = file.header()
        assert "Camera Signal: digital number; Camera Temperature: K" in header["units"]
        assert (header["cameraNetd"], header["cameraBits"], header["cameraFrame"]) == ("0.05", "14", "1")
        assert header["cameraRange"] == "233.15 423.15"
        assert "cameraNetd, cameraOffsetSpread, cameraRange: K" in header["cameraUnits"]


def test_clipped_pixels_are_told(infrared, tmp_path, caplog):
    use(infrared, bits=8)
    infrared.detector_high = 300.0
    with caplog.at_level(logging.WARNING):
        passes = render_to_exr(tmp_path)["ViewLayer"]
    assert np.all(passes["Camera Signal"] == 255)
    assert "432 of 432 pixels are outside the camera's range from 233.15 K to 300 K" in caplog.text


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("f_number", -1.0, "F-Number is -1"),
        ("pitch", -3.0, "the pixel pitch is -3 um"),
        ("netd", -0.1, r"NETD (K) is -0.1 K"),
        ("fill_factor", 0.0, "Fill Factor is 0"),
        ("bits", 30, "30 Bits, expected 0 to 24"),
        ("high", 200.0, "the range from 233.15 K to 200 K is none"),
    ],
)
def test_senseless_values_are_told_before_the_first_pass(infrared, tmp_path, name, value, message):
    setattr(infrared, f"detector_{name}", value)
    assert not any(check.text.startswith("Camera effects") for check in checks())
    infrared.use_detector = True
    [check] = [check for check in checks() if check.text.startswith("Camera effects")]
    assert check.level == "ERROR" and message in check.text
    with patch("addon.rendering.final_render.RenderJob") as job, pytest.raises(RuntimeError, match=re.escape(message)):
        render_to_exr(tmp_path)
    assert not job.called


def checks():
    return scene_checks(bpy.context.scene, bpy.context.view_layer)


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize(
    "size, aspect, percentage", [((40, 20), (1, 1), 100), ((20, 40), (1, 1), 50), ((30, 20), (1, 2), 50)]
)
def test_the_pitch_is_that_of_blenders_camera(infrared, fit, size, aspect, percentage):
    """A pixel of the frame, seen under the angle that the lens gives it, is that large on the sensor."""
    scene = bpy.context.scene
    render, data = scene.render, scene.camera.data
    render.resolution_x, render.resolution_y = size
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    render.resolution_percentage = percentage
    data.sensor_fit, data.sensor_width, data.sensor_height, data.lens = fit, 9.6, 7.2, 19.0
    infrared.use_detector = True
    seen = read()[0].camera
    left, right, bottom, top = seen.frame
    expected = 19e3 * (right - left) / seen.width, 19e3 * (top - bottom) / seen.height  # um
    assert read_detector(scene, scene.camera).pitch == pytest.approx(expected, rel=1e-5)
    infrared.detector_pitch = 17.0
    at_full_size = 17.0 * 100 / percentage
    stretch = aspect[1] / aspect[0]
    assert read_detector(scene, scene.camera).pitch == pytest.approx((at_full_size, at_full_size * stretch))


def test_the_panel_shows_every_setting(infrared):
    column = MagicMock()
    rows = column.row.return_value, column.column.return_value
    with patch("addon.ui.checks.draw_checks"):
        INFRARED_PT_detector.draw_settings(None, column, infrared)
    shown = {call.args[1] for each in (column, *rows) for call in each.prop.call_args_list}
    settings = {name for name in infrared.bl_rna.properties.keys() if name.startswith("detector_")}  # noqa: SIM118
    assert shown == settings
    assert column.active is False
    header = MagicMock()
    INFRARED_PT_detector.draw_header(header, bpy.context)
    assert header.layout.prop.call_args.args[1] == "use_detector"
