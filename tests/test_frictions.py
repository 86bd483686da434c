# SPDX-License-Identifier: GPL-3.0-or-later
"""What a first-time user stumbled over: each of these tests does what they did."""

import os
import time
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
import bmesh  # noqa: E402

from addon.compiling.watch import COMPILING, compiles_now  # noqa: E402
from addon.output.console import without_harmless_messages  # noqa: E402
from addon.output.temperature_scale import KELVIN, automatic_range  # noqa: E402
from addon.rendering import self_check  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.rendering.last_render import finished_layers, last_warnings  # noqa: E402
from addon.rendering.render_passes import render_passes  # noqa: E402
from addon.ui.checks import new_warnings  # noqa: E402
from addon.ui.render_end import end_of_render  # noqa: E402
from addon.ui.temperatures.spot_meter import camera_pass, reading_at, shown_layer  # noqa: E402
from addon.ui.temperatures.temperature_groups import first_choice  # noqa: E402
from tests.helpers.blender import link  # noqa: E402


@pytest.fixture
def untouched():
    """Blender's default scene, as it is after File > New, with this engine and a small picture."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    scene.infrared.passes, scene.infrared.photons_per_pass = 2, 1000
    bpy.context.view_layer.update()
    return scene


def checks(level=None):
    """The texts of all checks, or of those of a level."""
    bpy.context.view_layer.update()
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in found if level in (None, check.level)]


def shown_space():
    """An Image Editor that shows the render result."""
    image = bpy.data.images["Render Result"]
    return SimpleNamespace(image=image)


def test_the_untouched_scene_says_that_its_sky_is_missing_and_shows_more_than_two_colours(untouched):
    assert any("World 'World' has no temperature, and the scene is open" in text for text in checks("WARNING"))
    bpy.ops.render.render()
    (images,) = finished_layers.values()
    temperature = images["temperature"]
    assert (temperature == 0.0).any()  # the background
    low, high = automatic_range(temperature)
    assert 0.0 < temperature[temperature > 0.0].min() <= low < high <= temperature.max()
    assert any("has no temperature, and the scene is open" in text for text in last_warnings)
    assert new_warnings(last_warnings, all_checks()) == []  # the panel says it once


def drawing():
    pencils = bpy.data.grease_pencils_v3 if hasattr(bpy.data, "grease_pencils_v3") else bpy.data.grease_pencils
    link("Sketch", pencils.new("Sketch"))


def curves_with_a_wrong_attribute():
    curves = bpy.data.hair_curves.new("Fur")
    curves.add_curves([2])
    curves.attributes.new("temperature", "INT", "CURVE")
    link("Fur", curves)


def wrong_attribute():
    bpy.data.objects["Cube"].data.attributes.new("temperature", "INT", "POINT")


def grouped_light():
    bpy.context.scene.infrared.group_exr_path = "/tmp/never_written.exr"
    bpy.data.objects["Cube"]["temperature_group"] = "Cube"
    bpy.data.objects["Light"]["temperature_group"] = "Light"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (drawing, "Object 'Sketch': grease pencil is not rendered"),
        (curves_with_a_wrong_attribute, "Object 'Fur': the attribute 'temperature' (int on curves) is no float on"),
        (wrong_attribute, "Object 'Cube': the attribute 'temperature' (int on points) is no float on points, corners"),
        (grouped_light, "Light 'Light': temperature groups are for surfaces"),
    ],
)
def test_checks_tell_what_the_render_warns_of(untouched, monkeypatch, change, said):
    """And the panel repeats none of it after the render."""
    from addon.rendering import final_render

    monkeypatch.setattr(final_render, "write_groups", lambda *_: None)
    change()
    assert any(text.startswith(said) for text in checks("WARNING"))
    bpy.ops.render.render()
    what = said.partition(": ")[2]
    assert any(what in warning for warning in last_warnings)
    repeated = [warning for warning in new_warnings(last_warnings, all_checks()) if what in warning]
    assert repeated == []


def all_checks():
    bpy.context.view_layer.update()
    return scene_checks(bpy.context.scene, bpy.context.view_layer)


def test_warnings_of_a_render_stay_until_the_next(untouched):
    """Those that nothing but the render finds out, too."""
    cube = bpy.data.objects["Cube"]
    cube.scale = 20.0, 20.0, 20.0  # the camera is in its box, so no look at boxes tells that there is a way out
    mesh = bmesh.new()
    mesh.from_mesh(cube.data)
    mesh.faces.ensure_lookup_table()
    mesh.faces.remove(mesh.faces[0])
    mesh.to_mesh(cube.data)
    mesh.free()
    bpy.ops.render.render()
    (warning,) = new_warnings(last_warnings, all_checks())
    assert "the scene is open: rays that leave it see 0 K" in warning
    untouched.world["temperature"] = 280.0
    bpy.ops.render.render()
    assert new_warnings(last_warnings, all_checks()) == []


@pytest.mark.once
def test_kernels_are_spoken_of_only_while_they_are_compiled():
    """By a kernel that takes long to compile, and by a render whose kernels are there."""
    import threading

    import numba

    calls = "\n".join(f"    x = x * {i}.5 + y ** {i % 7} - abs(x)" for i in range(400))
    space = {}
    exec(f"def slow(x, y):\n{calls}\n    return x", space)  # nobody has compiled this
    assert not compiles_now()
    thread = threading.Thread(target=numba.njit(space["slow"]), args=(1.0, 2.0))
    thread.start()
    said = []
    while thread.is_alive():
        said.append(compiles_now())
        time.sleep(0.02)
    assert any(said) and not said[0] and not compiles_now()
    assert "once" in COMPILING


def test_passes_and_noise_stay_over_the_picture(untouched):
    untouched.world["temperature"] = 280.0
    bpy.data.objects["Cube"]["temperature"] = 330.0
    bpy.ops.render.render()
    text = end_of_render(shown_space(), untouched)
    assert text.startswith("2 passes, noise ") and text.endswith(" K")
    untouched.render.engine = "BLENDER_WORKBENCH"
    assert end_of_render(shown_space(), untouched) == ""


def test_an_error_is_told_once(untouched):
    bpy.data.materials["Material"]["emissivity"] = "Unobtainium"
    with pytest.raises(RuntimeError) as raised:
        bpy.ops.render.render()
    assert str(raised.value).count("the library has no material 'Unobtainium'") == 1
    assert "the library has no material 'Unobtainium'" in end_of_render(shown_space(), untouched)
    del bpy.data.materials["Material"]["emissivity"]
    bpy.ops.render.render()
    assert end_of_render(shown_space(), untouched).startswith("2 passes")


@pytest.mark.parametrize("text", ["0.5", "0,5", "1"])
def test_a_number_as_a_text_is_explained(untouched, text):
    bpy.data.materials["Material"]["emissivity"] = text
    (found,) = checks("ERROR")
    assert f"no material '{text}'" in found and "emissivity is a text: for a number" in found
    bpy.data.materials["Material"]["emissivity"] = "Unobtainium"
    assert "is a text" not in checks("ERROR")[0]


def test_a_missing_camera_stops_checks_and_render_alike(untouched):
    """Blender itself refuses a scene without a camera, and leaves one whose camera is no camera to the engine."""
    untouched.camera = None
    assert checks("ERROR") == ["The scene has no camera"]
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.render.render()
    untouched.camera = bpy.data.objects["Light"]
    (found,) = checks("ERROR")
    with pytest.raises(RuntimeError, match="it is a light, not a camera") as raised:
        bpy.ops.render.render()
    assert found in str(raised.value)
    untouched.infrared.use_detector = True
    assert checks("ERROR") == [found]


def test_the_self_test_speaks_of_a_blackbody():
    assert "A closed box at one temperature looks like a blackbody" in [each.__doc__ for each in self_check.CHECKS]


def test_the_camera_s_picture_is_one_click_away(untouched):
    assert not bpy.ops.infrared.show_camera_temperature.poll()
    untouched.infrared.use_detector = True
    bpy.ops.render.render()
    assert bpy.ops.infrared.show_camera_temperature.poll()
    assert bpy.ops.infrared.show_camera_temperature() == {"FINISHED"}
    image = bpy.data.images["Camera Temperature"]
    assert tuple(image.size) == (32, 24)
    pixels = np.empty(32 * 24 * 4, np.float32)
    image.pixels.foreach_get(pixels)
    assert np.ptp(pixels.reshape(-1, 4)[:, :3]) > 0.5  # a picture in colours


def test_recombining_begins_with_the_file_that_the_scene_writes(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.context.scene.infrared.group_exr_path = "//grp.exr"
    (tmp_path / "grp.exr").touch()
    dialog = SimpleNamespace(groups="", filepath="", filename_ext=".exr")
    first_choice(bpy.context.scene, dialog)
    assert dialog.groups == "//grp.exr"
    assert dialog.filepath == str(tmp_path / "grp_recombined.exr")


def test_the_harmless_message_of_openexr_stays_off_the_console(capfd):
    """Whatever else libraries print in the meantime follows, as well as after it."""
    with without_harmless_messages():
        os.write(2, b"(EXR_ERR_ARGUMENT_OUT_OF_RANGE) Invalid chunk\nDisk nearly full\n")
    os.write(2, b"later\n")
    assert capfd.readouterr().err == "Disk nearly full\nlater\n"


def test_an_error_of_a_writer_passes_through(capfd):
    with pytest.raises(OSError, match="full"), without_harmless_messages():
        raise OSError("disk full")
    os.write(2, b"still there\n")
    assert "still there" in capfd.readouterr().err


def test_the_netd_is_part_of_readings_in_the_camera_s_picture(untouched):
    """In front of a blackbody at 300 K, where it is stated; the picture itself has no noise there."""
    infrared = untouched.infrared
    untouched.world["temperature"] = bpy.data.objects["Cube"]["temperature"] = 300.0
    infrared.use_detector, infrared.detector_netd, infrared.detector_f_number = True, 0.08, 0.0
    infrared.detector_gain_spread = infrared.detector_offset_spread = 0.0
    bpy.data.objects.remove(bpy.data.objects["Light"])
    bpy.ops.render.render()
    (images,) = finished_layers.values()
    number = camera_pass(images)
    passes = [each.name for each in render_passes(untouched, bpy.context.view_layer)]
    assert passes[number] == "Camera Temperature"
    space = SimpleNamespace(image=bpy.data.images["Render Result"])
    space.image_user = SimpleNamespace(multilayer_layer=0, multilayer_view=0, multilayer_pass=number)
    picture = shown_layer(space, untouched).picture
    kelvin = images["further"]["Camera Temperature"].image
    np.testing.assert_array_equal(picture.temperature, kelvin)
    assert np.ptp(kelvin) > 0.1  # the camera's noise
    # the slope of Planck's law changes by less than a hundredth over these few noise levels
    np.testing.assert_allclose(picture.noise, 0.08, rtol=0.01)
    assert abs(np.std(kelvin) - 0.08) < 4 * 0.08 / np.sqrt(2 * kelvin.size)  # which is what the pixels do
    error = reading_at(picture, infrared, 0.5, 0.5, KELVIN).split()[2]
    assert error == "0.08"
    space.image_user.multilayer_pass = 0
    assert shown_layer(space, untouched).picture.noise.max() < 1e-3
