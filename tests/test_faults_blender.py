# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to a render in Blender when things go wrong: files, memory, a killed process, senseless values."""

import faulthandler
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon import solver  # noqa: E402
from addon.reading.scene_reader import read_scene  # noqa: E402
from addon.rendering import final_render  # noqa: E402
from addon.solver import SceneError, Settings, memory  # noqa: E402
from addon.solver.photons.lights import light_spectrum  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.physics.sensors import band_weights  # noqa: E402
from addon.solver.physics.spectrum import apparent_temperature, band_radiance  # noqa: E402
from addon.solver.scene import HOTTEST  # noqa: E402
from tests.helpers.blender import plain, read_exr, use_multilayer_exr  # noqa: E402
from tests.helpers.faults_blender import build_scene, render, save_slowly, stop_after  # noqa: E402
from tests.helpers.marks import long  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
FLOAT32 = 1e-6  # relative: a few roundings of float32


@pytest.fixture
def infrared(reset_blender):
    return build_scene()


def failed_render():
    """The message of a render that must fail."""
    with pytest.raises(RuntimeError) as error:
        render()
    return str(error.value)


def radiance():
    """The last finished image, (h, w) W m-2 sr-1."""
    return final_render.finished_layers["ViewLayer"]["radiance"]


# Output ---------------------------------------------------------------------------------------------------------------


def assert_image_is_kept(folder):
    """What Blender shows and what can be exported is the image of the render that ended."""
    use_multilayer_exr()
    bpy.data.images["Render Result"].save_render(str(folder / "shown.exr"))
    assert bpy.ops.infrared.export_bands(filepath=str(folder / "exported.exr")) == {"FINISHED"}
    exported = OpenEXR.File(str(folder / "exported.exr")).parts[0].channels["Radiance.V"].pixels[::-1]
    np.testing.assert_array_equal(read_exr(folder / "shown.exr")["ViewLayer"]["Radiance"], exported)
    assert exported.min() > 0


# Each output, a key of FORMATS or the temperature groups: what messages call it, and the file that is written first.
OUTPUTS = {
    "BAND_EXR": ("the band images", "out.exr"),
    "SPECTRAL_EXR": ("the band images", "out_spectral.exr"),
    "ENVI": ("the band images", "out.raw"),
    "TIFF": ("the temperature image", "out.tif"),
    "CAMERA_TIFF": ("the temperature image", "out_16bit.tif"),
    "GROUPS": ("the temperature groups", "out.exr"),
}


def write_to(path, output):
    """Let the next render write one output, and no other."""
    scene = bpy.context.scene
    if output == "GROUPS":
        bpy.data.objects["Plate"]["temperature_group"], scene.infrared.group_exr_path = "plate", str(path)
    else:
        scene.infrared.band_exr_path, scene.infrared.file_formats = str(path), {output}


@pytest.mark.parametrize("output", OUTPUTS)
def test_an_output_that_cannot_be_written_is_named_and_the_image_kept(infrared, tmp_path, caplog, capfd, output):
    (tmp_path / "file").write_text("a file, not a folder")
    for place in ("missing/out", "file/out", "/proc/out"):
        caplog.clear()
        write_to(tmp_path / place, output)
        message = failed_render()
        for told in (message, caplog.text):
            assert f"Cannot write {OUTPUTS[output][0]}" in told and str((tmp_path / place).parent) in told
    assert "Traceback" not in "".join(capfd.readouterr())
    assert_image_is_kept(tmp_path)


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_full_disk_is_told_and_the_image_and_older_files_are_kept(infrared, tmp_path, caplog, output):
    """A limit on the size of files stands in for the full disk. Every file is larger."""
    folder, scene = tmp_path / "output", bpy.context.scene
    folder.mkdir()
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    write_to(folder / "out", output)
    render()
    old = {path: path.read_bytes() for path in folder.iterdir()}
    infrared.seed += 1  # another image
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, before[1]))
    try:
        message = failed_render()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    what, first = OUTPUTS[output]
    for told in (message, caplog.text):
        assert f"Cannot write {what} to '{folder / first}'" in told
    assert {path: path.read_bytes() for path in folder.iterdir()} == old
    assert_image_is_kept(tmp_path)


# Memory ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["range_low", "isotherm_high", "band_tolerance", "checkpoint_minutes"])
def test_a_setting_that_is_no_number_is_named(infrared, name):
    setattr(infrared, name, np.nan)
    with pytest.raises(RuntimeError, match=rf"Setting '.*' \({name}\) is nan, expected a finite number"):
        bpy.ops.render.render()


def test_a_render_that_needs_too_much_memory_is_refused(infrared, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 10**8)
    infrared.photons_per_pass = 10**8
    message = failed_render()
    assert "This render needs about " in message and "0.1 GB are available. The photons of a pass need most" in message
    infrared.photons_per_pass = 1000
    render()


@pytest.fixture
def untouched(monkeypatch):
    """The scene's reader and Blender's own images must not be reached."""
    for name in ("read_moving_scene", "_render"):
        monkeypatch.setattr(final_render, name, Mock(side_effect=AssertionError(f"{name} was called")))


def test_an_image_too_large_is_refused_before_anything_is_read_or_taken(infrared, untouched, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 24 * 10**9)
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 60_000
    infrared.band_count = 16
    begin = time.monotonic()
    message = failed_render()
    assert time.monotonic() - begin < 1.0  # s
    assert "This render of 60,000 x 60,000 pixels and 16 bands needs about 3,096.0 GB of memory, 24.0 GB are" in message
    assert "The images of every band need most, 1,886.4 GB: lower the resolution, the number of bands" in message


@pytest.mark.parametrize("more", ["view layer", "data passes"])
def test_what_blender_keeps_of_view_layers_and_passes_counts(infrared, untouched, monkeypatch, more):
    """A render that would just fit is refused if it has one more of them."""
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 4000
    foreseen, _ = final_render.images_beforehand(scene.render, 3, final_render.IMAGE_COPIES)
    monkeypatch.setattr(memory, "available_memory", lambda: sum(foreseen.values()))
    assert "read_moving_scene was called" in failed_render()  # it fits
    if more == "view layer":
        scene.view_layers.new("Second")
    else:
        bpy.context.view_layer.use_pass_normal = True
    message = failed_render()
    assert "4,000 x 4,000 pixels and 3 bands needs about" in message and "view layers" in message


def test_the_frame_around_a_render_region_counts(infrared, untouched, monkeypatch):
    """Blender pastes the region into it; a cropped one it leaves alone."""
    monkeypatch.setattr(memory, "available_memory", lambda: 10**9)
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 10_000
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.5, 0.501, 0.5, 0.501
    message = failed_render()
    assert "This render of 10 x 10 pixels of 10,000 x 10,000 and 3 bands needs about 2.0 GB" in message
    assert "crop to the render region" in message
    render.use_crop_to_border = True
    assert "read_moving_scene was called" in failed_render()


def test_a_mesh_too_large_is_refused_before_blender_takes_room(infrared, monkeypatch):
    monkeypatch.setattr(final_render, "_render", Mock(side_effect=AssertionError("begin_result would be called")))
    monkeypatch.setattr(memory, "available_memory", lambda: 10**8)
    bpy.data.objects["Floor"].modifiers.new("Finer", "SUBSURF").render_levels = 8
    message = failed_render()
    assert "8 x 6 pixels and 3 bands needs about" in message and "The triangles need most" in message


def test_running_out_of_memory_is_a_message(infrared, monkeypatch, capfd, caplog):
    def greedy(*_args, **_options):
        np.empty((10**9, 10**9))

    monkeypatch.setattr(final_render, "render", greedy)
    message = failed_render()
    assert "Out of memory: Unable to allocate" in message and "Lower the resolution" in message
    assert "Traceback" not in "".join(capfd.readouterr()) + caplog.text
    monkeypatch.undo()
    render()


# Checkpoints ----------------------------------------------------------------------------------------------------------

KILLED = """
import sys
import bpy, addon
from tests.helpers.faults_blender import build_scene
bpy.ops.wm.read_factory_settings(use_empty=True)
addon.register()
infrared = build_scene()
infrared.passes, infrared.checkpoint_path, infrared.checkpoint_minutes = {passes}, {path!r}, 0.0
bpy.ops.render.render()
"""


def started(script, *arguments):
    """A process that runs a script; its errors can be read."""
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


@pytest.mark.once
def test_a_killed_render_goes_on_from_its_checkpoint(infrared, tmp_path, monkeypatch):
    """Killed without warning in the middle, in a process of its own; here it goes on, to the last bit the same."""
    path, passes = tmp_path / "check.npz", 100_000
    script = KILLED.format(passes=passes, path=str(path))
    process = started(script)
    deadline = time.monotonic() + 240
    while not path.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.3)  # some passes more
    process.kill()  # SIGKILL
    error = process.communicate()[1].decode()
    assert process.returncode == -signal.SIGKILL and path.exists(), error

    saved, real = [], final_render.load  # numbers of passes

    def load(*args):
        film = real(*args)
        saved.append(film.passes)
        return film

    monkeypatch.setattr(final_render, "load", load)
    infrared.passes = passes
    with pytest.MonkeyPatch.context() as patch:  # how many there are to go on from, without going on
        patch.setattr(final_render, "render_with_checkpoints", lambda *_args, **_options: None)
        infrared.checkpoint_path = str(path)
        render()
    infrared.passes = saved[0] + 3
    render()
    assert 1 <= saved[1] == infrared.passes - 3
    resumed = final_render.finished_layers["ViewLayer"]
    assert resumed["metadata"]["passes"] == infrared.passes and not path.exists()
    infrared.checkpoint_path = ""
    render()
    whole = final_render.finished_layers["ViewLayer"]
    np.testing.assert_array_equal(resumed["bands"], whole["bands"])
    np.testing.assert_array_equal(resumed["noise"], whole["noise"])


def wait_for(path):
    """The solver writes a checkpoint after Blender has the image."""
    deadline = time.monotonic() + 10
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)


def test_a_render_ended_by_esc_goes_on(infrared, tmp_path, monkeypatch):
    path = tmp_path / "check.npz"
    infrared.passes = 6
    render()
    whole = radiance()
    infrared.checkpoint_path = str(tmp_path / "check")
    stop_after(monkeypatch, 2)
    wait_for(path)
    seen, real = [], final_render.RenderJob._on_pass
    monkeypatch.setattr(final_render.RenderJob, "_on_pass", lambda *args: (seen.append(args[1].passes), real(*args)))
    render()
    assert seen == [2, 3, 4, 5, 6]  # it did not start anew
    np.testing.assert_array_equal(radiance(), whole)
    assert not path.exists()


def test_a_render_started_right_after_esc_goes_on_from_what_is_being_saved(infrared, tmp_path, monkeypatch):
    path = tmp_path / "check.npz"
    infrared.passes, infrared.checkpoint_path = 5, str(path)
    save_slowly(monkeypatch)
    stop_after(monkeypatch, 2)
    assert not path.exists()
    told, impatient = [], SimpleNamespace(test_break=lambda: True, update_stats=lambda _stats, info: told.append(info))
    assert not final_render._await_last_save(impatient, path)  # Esc again
    assert told == ["Saving the passes of the last render"]
    seen, real = [], final_render.RenderJob._on_pass
    monkeypatch.setattr(final_render.RenderJob, "_on_pass", lambda *args: (seen.append(args[1].passes), real(*args)))
    render()
    assert seen == [2, 3, 4, 5]
    assert not path.exists()


QUIT = """
import bpy, addon, pytest
from tests.helpers.faults_blender import build_scene, save_slowly, stop_after
bpy.ops.wm.read_factory_settings(use_empty=True)
addon.register()
infrared = build_scene()
infrared.passes, infrared.checkpoint_path = 100, {path!r}
save_slowly(pytest.MonkeyPatch())
stop_after(pytest.MonkeyPatch(), 2)
"""


@pytest.mark.once
def test_a_render_ended_by_esc_is_saved_though_blender_is_quit(tmp_path):
    path = tmp_path / "check.npz"
    script = QUIT.format(path=str(path))
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0 and path.exists(), done.stderr
    with np.load(path) as saved:
        assert saved["passes"] == 2


def test_a_render_ended_by_esc_can_be_read_and_exported_but_writes_no_files(infrared, tmp_path, monkeypatch):
    infrared.band_exr_path = str(tmp_path / "bands")
    stop_after(monkeypatch, 2)
    assert list(tmp_path.glob("bands*")) == []
    assert final_render.finished_layers["ViewLayer"]["metadata"]["passes"] == 2
    assert "ViewLayer" in final_render.finished_frames  # of the colour bar and the spot meter
    infrared.band_exr_path = ""
    shown = radiance()
    assert bpy.ops.infrared.export_bands(filepath=str(tmp_path / "seen.exr")) == {"FINISHED"}
    exported = OpenEXR.File(str(tmp_path / "seen.exr")).parts[0].channels["Radiance.V"].pixels[::-1]
    np.testing.assert_array_equal(exported, shown)


def damage(path):
    path.write_bytes(path.read_bytes()[:-100])


def change_scene(_path):
    bpy.data.objects["Plate"]["temperature"] = 500.0


@pytest.mark.parametrize(
    "change, message",
    [(damage, "is no checkpoint, or a damaged one"), (change_scene, "is of another render: temperature differ")],
)
def test_a_checkpoint_that_does_not_fit_is_kept_and_told(infrared, tmp_path, monkeypatch, caplog, change, message):
    path = tmp_path / "check.npz"
    infrared.passes, infrared.checkpoint_path = 6, str(path)
    stop_after(monkeypatch, 2)
    wait_for(path)
    change(path)
    content = path.read_bytes()
    render()
    assert message in caplog.text
    kept = tmp_path / "check.old1.npz"
    assert f"The render starts anew; the old file is kept as '{kept}'" in caplog.text
    assert list(tmp_path.iterdir()) == [kept] and kept.read_bytes() == content
    begun_anew = radiance()
    infrared.checkpoint_path = ""
    render()
    np.testing.assert_array_equal(radiance(), begun_anew)


def test_a_checkpoint_that_cannot_be_written_is_an_error_at_once(infrared, tmp_path):
    infrared.checkpoint_path = str(tmp_path / "missing" / "check")
    message = failed_render()
    assert "Cannot write the checkpoint" in message and str(tmp_path / "missing") in message


def test_every_view_layer_and_frame_has_its_checkpoint(infrared, tmp_path):
    scene = bpy.context.scene
    scene.frame_set(12)
    infrared.checkpoint_path = str(tmp_path / "check.npz")
    for suffix, animation, expected in (("", False, "check.npz"), ("_A_1", True, "check0012_A_1.npz")):
        assert final_render.checkpoint_path(scene, suffix, animation) == tmp_path / expected


# Two at once ----------------------------------------------------------------------------------------------------------


@pytest.mark.once
def test_two_processes_render_at_once(infrared, tmp_path):
    """They share the folder of kernels, and give the image of this process."""
    script = KILLED.replace("infrared.passes,", "infrared.band_exr_path = sys.argv[1]\ninfrared.passes,")
    script = script.format(passes=2, path="")
    files = [tmp_path / f"{name}.exr" for name in "ab"]
    processes = [started(script, file) for file in files]
    errors = [process.communicate(timeout=240)[1].decode() for process in processes]
    assert not any("Traceback" in error for error in errors), errors
    render()
    for file in files:
        channels = OpenEXR.File(str(file)).parts[0].channels
        np.testing.assert_array_equal(channels["Radiance.V"].pixels[::-1], radiance())


# Senseless values -----------------------------------------------------------------------------------------------------

# (owner, key) of every custom property that is read, and how messages name the owner.
PROPERTIES = {
    ("objects", "Plate", "temperature"): "Object 'Plate'",
    ("objects", "Lamp", "temperature"): "Light 'Lamp'",
    ("worlds", "Sky", "temperature"): "World 'Sky'",
    ("materials", "Paint", "emissivity"): "Material 'Paint'",
    ("materials", "Metal", "specular"): "Material 'Metal'",
    ("materials", "Metal", "roughness"): "Material 'Metal'",
    ("objects", "Plate", "temperature_group"): "Object 'Plate'",
    ("worlds", "Sky", "temperature_group"): "World 'Sky'",
    ("scenes", "Scene", "sensor_response"): "Sensor",
}
HANGS = 300.0  # s by the clock, after which nothing but a hang is left to be the reason
MOST = 100.0  # s of processor time, which a busy machine does not change: to compile kernels takes most of it, once
MANY = 10_000 if bpy.app.version >= (5, 0, 0) else 1_000  # the older line is asked whether it takes them alike
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -1.0, 300.0, 1e6, 1e7, 1e308, -1e308, 5e-324, 1e-300, 1e-8, 0.5)
INTEGERS = (0, 1, -1, 300, 2**31 - 1, -(2**31))
TEXTS = ("", " ", "300", "nan", "Granite", "granite ", "Unobtainium", "x" * 5000, "\u00e9\U0001f525", "a\nb", "'%s{}")


@pytest.fixture
def watchdog(capfd):
    """A function that starts the clock anew: whatever takes HANGS then ends the process, and shows all its threads.

    A hang can be in a kernel or in Blender, where no exception ends it.
    """
    with capfd.disabled():
        screen = os.fdopen(os.dup(2), "w")
    yield lambda: faulthandler.dump_traceback_later(HANGS, exit=True, file=screen)
    faulthandler.cancel_dump_traceback_later()
    screen.close()


def assert_between_the_coldest_and_the_hottest(scene, radiance, temperature, noise, values):
    """Bodies show at least what a blackbody of the coldest thing would, and at most one of the hottest and the lamp
    together: what surfaces emit and reflect is a mean of what they receive and a blackbody (the maximum principle, for
    each of the two sources). Within 5 standard errors, and rounding of float32."""
    weights, edges = band_weights(scene.response, scene.band_edges), scene.band_edges
    around = scene.world_temperature if scene.sky is None else scene.sky.kelvin.ravel()
    kelvin = np.append(scene.temperature.ravel().astype(float), around)
    most = weights @ band_radiance(edges, kelvin.max())
    for lamp in scene.lights:  # none if it is dark
        shining = lamp.power * light_spectrum(lamp, edges) / (4.0 * np.pi**2 * lamp.radius**2)  # of a Lambertian sphere
        most += weights @ shining
    least = weights @ band_radiance(edges, kelvin.min())
    low, high = apparent_temperature(np.array([least, most]), edges, weights)
    assert np.all(radiance >= 0) and np.all(noise >= 0), values
    assert np.all(temperature <= high * (1 + 1e-6) + 5 * noise), (values, high)
    assert np.all(temperature >= low * (1 - 1e-6) - 5 * noise), (values, low)


def senseless(rng, depth=0):
    """A value of any kind that a custom property might hold, and some that Blender refuses."""
    kind = rng.integers(13 if depth < 3 else 9)
    if kind <= 1:
        return float(rng.choice(NUMBERS))
    if kind == 2:
        return float(rng.normal() * 10.0 ** rng.integers(-6, 7))
    if kind == 3:
        return float(rng.random())
    if kind == 4:
        return int(rng.choice(INTEGERS))
    if kind == 5:
        return bool(rng.integers(2))
    if kind == 6:
        return str(rng.choice(TEXTS))
    if kind == 7:
        return bytes(rng.bytes(rng.integers(5)))
    if kind == 8:
        return None if rng.integers(2) else bpy.data.objects["Floor"]
    length = rng.integers(7)
    if kind == 9:
        return [float(rng.choice(NUMBERS)) for _ in range(length)]
    if kind == 10:  # near to a spectrum
        points = np.column_stack((np.sort(rng.uniform(1.0, 20.0, length)), rng.uniform(-0.05, 1.05, length)))
        return points.ravel().tolist()
    if kind == 11:
        return [senseless(rng, depth + 1) for _ in range(length)]
    return {f"key {i}": senseless(rng, depth + 1) for i in range(length)}


@pytest.fixture
def values(infrared, tmp_path):
    """A value that makes sense for every custom property, in a scene that reads them all."""
    infrared.group_exr_path, infrared.sensor = str(tmp_path / "groups"), "CUSTOM"
    bpy.data.objects["Plate"]["temperature_group"] = "plate"
    bpy.data.worlds["Sky"]["temperature"], bpy.data.worlds["Sky"]["temperature_group"] = 250.0, "sky"
    bpy.data.objects["Lamp"]["temperature"], bpy.data.objects["Lamp"].data.shadow_soft_size = 3000.0, 0.05
    bpy.context.scene["sensor_response"] = [7.0, 0.0, 9.0, 1.0, 15.0, 0.5]
    return {(kind, name, key): plain(getattr(bpy.data, kind)[name][key]) for kind, name, key in PROPERTIES}


def put(place, value):
    """Give a custom property a value; False if Blender does not take it."""
    collection, name, key = place
    owner = getattr(bpy.data, collection)[name]
    try:
        owner[key] = value
    except (TypeError, ValueError, OverflowError):  # lists of mixed types, None ...
        return False
    owner.update_tag()
    return True


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def makes_sense(place, value):
    """Whether the contract allows it: kelvin from 0 to HOTTEST, shares from 0 to 1, spectra and names of groups."""
    if place[2] == "sensor_response":
        return isinstance(value, list) and is_response(value)
    if value is None:
        return True  # as good as absent
    if place[2] == "temperature_group":
        return isinstance(value, str) or not value  # 0 and what is empty are no group
    if is_number(value):
        return 0.0 <= value <= (HOTTEST if place[2] == "temperature" else 1.0)
    if place[2] != "emissivity":
        return False
    if isinstance(value, str):
        return value.strip().casefold() in map(str.casefold, library.names())
    if not isinstance(value, list) or not all(map(is_number, value)) or len(value) % 2 or not value:
        return False
    wavelengths, shares = np.array(value[::2], float), np.array(value[1::2], float)
    rising = np.all(np.isfinite(wavelengths)) and wavelengths[0] > 0 and np.all(wavelengths[1:] > wavelengths[:-1])
    return bool(rising and np.all((shares >= 0) & (shares <= 1)))


def is_response(numbers):
    """Whether a list is pairs of wavelength and response, and not blind from 7.5 to 14 um, where the bands are."""
    if not all(map(is_number, numbers)) or len(numbers) % 2 or len(numbers) < 4:
        return False
    wavelengths, seen = np.array(numbers[::2], float), np.array(numbers[1::2], float)
    rising = np.isfinite(wavelengths).all() and wavelengths[0] > 0 and np.all(wavelengths[1:] > wavelengths[:-1])
    if not rising or not np.isfinite(seen).all() or seen.min() < 0 or seen.max() == 0:
        return False
    return np.interp(np.linspace(7.5, 14.0, 10_001), wavelengths, seen / seen.max(), 0.0, 0.0).mean() > 1e-6


def clash():
    """Whether plate and sky are in one temperature group, but not at one temperature."""
    plate, sky = bpy.data.objects["Plate"], bpy.data.worlds["Sky"]
    group, other = (str(owner.get("temperature_group") or "").strip() for owner in (plate, sky))
    return group == other != "" and np.float32(plate["temperature"]) != np.float32(sky["temperature"])


def read():
    scene = read_scene(bpy.context.evaluated_depsgraph_get())[0]
    assert np.isfinite(scene.temperature).all() and 0 <= scene.temperature.min() <= scene.temperature.max() <= HOTTEST
    for each in scene.materials:
        wavelength, emissivity = each.curve
        assert np.isfinite(wavelength).all() and ((emissivity >= 0) & (emissivity <= 1)).all()
        assert 0 <= each.specular <= 1 and 0 <= each.roughness <= 1
    return scene


@pytest.mark.parametrize("images", [False, long(True)])
def test_no_value_of_a_custom_property_surprises_the_reader(values, watchdog, images):
    """MANY values: those that make sense are read, all others are errors that name the owner and the property.

    images: the solver renders what was read, to finite images between the coldest and the hottest thing. No value takes
    more than MOST.
    """
    rng = np.random.default_rng(1)
    places, accepted, refused, laps = list(PROPERTIES), 0, 0, [time.process_time()]
    while accepted + refused < MANY:
        watchdog()
        place, value = places[rng.integers(len(places))], senseless(rng)
        if not put(place, value):
            continue
        if makes_sense(place, value):
            scene = read()
            if images:
                film = solver.render(scene, Settings(passes=2, photons_per_pass=100, threads=1))
                shown = film.radiance(), film.temperature(), film.noise()
                for image in (film.bands(), *shown):
                    assert np.isfinite(image).all(), (place, value)
                assert_between_the_coldest_and_the_hottest(scene, *shown, (place, value))
            accepted += 1
        else:
            with pytest.raises(SceneError) as error:
                read()
            message = str(error.value)
            assert PROPERTIES[place] in message, (place, value)
            key = place[2].removeprefix("sensor_")  # "Sensor: sensor_response" and "Sensor 'Custom': response"
            assert key in message or "not respond" in message or f"the library has no material '{value}'" in message
            if is_number(value):
                assert f"{value:g}" in message or repr(value) in message
            refused += 1
        put(place, values[place])
        laps.append(time.process_time())
        assert laps[-1] - laps[-2] < MOST
    read()
    assert accepted > 0.1 * MANY and refused > 0.1 * MANY


def test_no_value_of_an_attribute_surprises_the_reader(infrared):
    rng = np.random.default_rng(2)
    mesh = bpy.data.meshes["Plate"]
    counts = {"POINT": 8, "CORNER": 24, "FACE": 6}
    for _ in range(1000):
        domain = str(rng.choice(list(counts)))
        attribute = mesh.attributes.new("temperature", "FLOAT", domain)
        with np.errstate(over="ignore"):
            values = rng.choice([*NUMBERS, 290.0, 300.0, 310.0], counts[domain]).astype(np.float32)
        if rng.integers(2):
            values = rng.uniform(0.0, 1000.0, counts[domain]).astype(np.float32)
        attribute.data.foreach_set("value", values)
        mesh.update_tag()
        if np.all((values >= 0) & (values <= HOTTEST)):
            read()
        else:
            with pytest.raises(SceneError, match="Attribute 'temperature' of object 'Plate': temperature"):
                read()
        mesh.attributes.remove(mesh.attributes["temperature"])


@pytest.mark.once
@pytest.mark.parametrize("renders", [100, long(300)])
def test_renders_with_senseless_values_are_messages_or_finite_images(infrared, values, watchdog, renders):
    """Whole renders, each with one to three values at random, each within MOST. What is rendered lies between the
    coldest and the hottest thing."""
    rng = np.random.default_rng(3)
    infrared.photons_per_pass, images, laps = 200, 0, [time.process_time()]
    for _ in range(renders):
        watchdog()
        changed = [list(PROPERTIES)[i] for i in rng.choice(len(PROPERTIES), rng.integers(1, 4), replace=False)]
        wanted = [(place, senseless(rng)) for place in changed if rng.random() < 0.8]
        taken = [each for each in wanted if put(*each)]
        if all(makes_sense(*each) for each in taken) and not clash():
            render()
            layer = final_render.finished_layers["ViewLayer"]
            shown = layer["radiance"], layer["temperature"], layer["noise"]
            for image in (*layer["bands"], *shown):
                assert np.isfinite(image).all(), taken
            assert_between_the_coldest_and_the_hottest(read(), *shown, taken)
            images += 1
        else:
            message = failed_render()
            assert any(PROPERTIES[place] in message for place, _ in taken), (message, taken)
            assert "The solver failed" not in message, taken
        for place in changed:
            put(place, values[place])
        laps.append(time.process_time())
        assert laps[-1] - laps[-2] < MOST
    assert renders / 6 < images < renders * 5 / 6
