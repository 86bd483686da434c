# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine inside Blender: pixels in every pass, messages instead of tracebacks, files where they belong.

The scenes are black walls: they reflect nothing, so every pixel is Planck's law and no tolerance covers noise.
"""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.output.formats import layer_suffixes  # noqa: E402
from addon.rendering import final_render  # noqa: E402
from addon.rendering.last_render import forget_last_render  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.physics.spectrum import band_names, band_radiance  # noqa: E402
from addon.solver.settings import Settings  # noqa: E402
from tests.helpers.blender import (  # noqa: E402
    camera,
    cube_mesh,
    link,
    material,
    read_exr,
    render_to_exr,
    use_multilayer_exr,
)

ROOT = Path(__file__).resolve().parents[1]
FLOAT32 = 1e-6  # relative: a few roundings of float32


@pytest.fixture(autouse=True)
def small_render(reset_blender):
    camera()
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 1000, 3, 1


def wall(temperature, name="Wall", collection=None, emissivity=1.0, size=40.0, location=(0.0, 0.0, -20.0)):
    """A cube in front of the camera, black unless told otherwise, whose top fills the picture."""
    mesh = cube_mesh(name)
    mesh.materials.append(material(f"{name} paint", emissivity=emissivity))
    obj = link(name, mesh, collection, temperature=temperature)
    obj.scale, obj.location = (size, size, size), location
    return obj


def left_and_right(left=280.0, right=340.0):
    """Two black walls that meet in the middle of the picture, one in each half."""
    wall(left, "Left", location=(-20.0, 0.0, -20.0))
    wall(right, "Right", location=(20.0, 0.0, -20.0))


# Passes ---------------------------------------------------------------------------------------------------------------


def test_every_pass_holds_its_image(tmp_path):
    wall(300.0)
    images = render_to_exr(tmp_path)["ViewLayer"]
    edges = np.linspace(7.5, 14.0, 4)
    exact = band_radiance(edges, 300.0)
    names = band_names(edges)
    assert set(images) == {"Combined", *names, "Radiance", "Temperature", "Noise"}
    for name, value, width in zip(names, exact, np.diff(edges), strict=True):
        assert images[name].shape == (12, 16)
        np.testing.assert_allclose(images[name], value / width, rtol=FLOAT32)
    np.testing.assert_allclose(images["Radiance"], exact.sum(), rtol=FLOAT32)
    np.testing.assert_allclose(images["Temperature"], 300.0, rtol=FLOAT32)
    assert np.all(images["Noise"] < 1e-3)
    assert images["Combined"].shape == (12, 16, 4) and np.all(images["Combined"][..., 3] == 1.0)


def test_combined_is_a_thermal_picture(tmp_path):
    left_and_right()
    combined = render_to_exr(tmp_path)["ViewLayer"]["Combined"][..., :3]
    assert combined[:, -1].sum() > 2 * combined[:, 0].sum()  # warm is bright


def test_image_is_the_right_way_up_and_round(tmp_path):
    left_and_right()
    bpy.data.objects["Left"].location.y = 20.0  # the lower left corner shows the 0 K surroundings
    temperature = render_to_exr(tmp_path)["ViewLayer"]["Temperature"]
    np.testing.assert_allclose(temperature[:, 9:], 340.0, rtol=FLOAT32)
    np.testing.assert_allclose(temperature[7:, :7], 280.0, rtol=FLOAT32)
    np.testing.assert_array_equal(temperature[:5, :7], 0.0)


def test_every_view_layer_is_filled_with_its_own_objects(tmp_path):
    scene = bpy.context.scene
    cold, hot = (bpy.data.collections.new(name) for name in ("Cold", "Hot"))
    for collection, temperature in ((cold, 250.0), (hot, 350.0)):
        scene.collection.children.link(collection)
        wall(temperature, collection.name, collection)
    other = scene.view_layers.new("Other")
    scene.view_layers[0].layer_collection.children["Hot"].exclude = True
    other.layer_collection.children["Cold"].exclude = True
    layers = render_to_exr(tmp_path)
    assert set(layers["ViewLayer"]) == set(layers["Other"]) and len(layers["Other"]) == 3 + 4
    np.testing.assert_allclose(layers["ViewLayer"]["Temperature"], 250.0, rtol=FLOAT32)
    np.testing.assert_allclose(layers["Other"]["Temperature"], 350.0, rtol=FLOAT32)


def test_compositor_has_a_socket_for_every_pass():
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
    node = tree.nodes.new("CompositorNodeRLayers")
    bpy.context.view_layer.update()
    sockets = {socket.name for socket in node.outputs if socket.enabled}
    assert {*band_names(np.linspace(7.5, 14.0, 4)), "Radiance", "Temperature", "Noise"} <= sockets


def test_custom_bands_name_the_passes(tmp_path):
    wall(300.0)
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.band_edges = "CUSTOM", "3, 5, 8.121, 8.124"
    images = render_to_exr(tmp_path)["ViewLayer"]
    assert {"3.000-5.000um", "5.000-8.121um", "8.121-8.124um"} <= set(images)


@pytest.mark.parametrize("crop", [False, True])
def test_border(tmp_path, crop):
    left_and_right()
    render = bpy.context.scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = 0.25, 0.75  # columns 4 to 11 of 16
    render.border_min_y, render.border_max_y = 0.5, 1.0  # rows 6 to 11 of 12
    temperature = render_to_exr(tmp_path)["ViewLayer"]["Temperature"]
    if crop:
        assert temperature.shape == (6, 8)
    else:
        assert temperature.shape == (12, 16)
        outside = np.ones((12, 16), bool)
        outside[6:12, 4:12] = False
        assert np.all(temperature[outside] == 0.0)
        temperature = temperature[6:12, 4:12]
    np.testing.assert_allclose(temperature[:, :3], 280.0, rtol=FLOAT32)
    np.testing.assert_allclose(temperature[:, 5:], 340.0, rtol=FLOAT32)


@pytest.mark.parametrize("border", [(0.1, 0.9, 0.1, 0.9), (0.333, 0.777, 0.0, 0.29), (0.05, 0.2, 0.71, 0.99)])
@pytest.mark.parametrize("size", [(16, 12), (33, 17)])
def test_border_of_any_size_fits_blenders_result(tmp_path, border, size):
    """Blender drops a result of a wrong size without a word; then the pixels stay 0."""
    wall(300.0)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = size
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = border
    np.testing.assert_allclose(render_to_exr(tmp_path)["ViewLayer"]["Temperature"], 300.0, rtol=FLOAT32)


def test_animation_renders_every_frame_with_its_own_temperature(tmp_path):
    obj = wall(300.0)
    obj.keyframe_insert('["temperature"]', frame=1)
    obj["temperature"] = 320.0
    obj.keyframe_insert('["temperature"]', frame=2)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 2
    render_to_exr(tmp_path, animation=True)
    for frame, temperature in ((1, 300.0), (2, 320.0)):
        image = read_exr(tmp_path / f"image_{frame:04d}.exr")["ViewLayer"]["Temperature"]
        np.testing.assert_allclose(image, temperature, rtol=FLOAT32)


def grey_room():
    """A grey wall under a hot plate: photons matter."""
    wall(290.0, emissivity=0.5)
    plate = wall(600.0, "Plate", size=1.0, location=(0.0, 0.0, 2.0))
    plate.scale.z = 0.01


def test_pass_ranges_add_up(tmp_path):
    """Passes 0-3 are the mean of passes 0-1 and 2-3 (radiance; the temperature is not linear in it)."""
    grey_room()
    infrared = bpy.context.scene.infrared
    images = {}
    for passes, offset in ((4, 0), (2, 0), (2, 2)):
        infrared.passes, infrared.pass_offset = passes, offset
        images[passes, offset] = render_to_exr(tmp_path)["ViewLayer"]["Radiance"]
    assert not np.array_equal(images[2, 0], images[2, 2])
    np.testing.assert_allclose(images[4, 0], 0.5 * (images[2, 0] + images[2, 2]), rtol=FLOAT32)


def compositor_tree(scene):
    """The scene's new compositor."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
        return scene.compositing_node_group
    scene.use_nodes = True
    return scene.node_tree


def test_the_compositor_shows_the_bands_that_are_set():
    """At once, without a render."""
    wall(300.0)
    scene, infrared = bpy.context.scene, bpy.context.scene.infrared
    node = compositor_tree(scene).nodes.new("CompositorNodeRLayers")
    scene.render.engine = "INFRARED_PHOTONS"
    for name, value, expected in (
        ("band_count", 2, ["7.50-10.75um", "10.75-14.00um"]),
        ("wavelength_min", 8.0, ["8.00-11.00um", "11.00-14.00um"]),
        ("wavelength_max", 7.0, []),  # which is no band
        ("wavelength_max", 12.0, ["8.00-10.00um", "10.00-12.00um"]),
        ("band_edges", "3, 4, 6", ["8.00-10.00um", "10.00-12.00um"]),
        ("band_mode", "CUSTOM", ["3.00-4.00um", "4.00-6.00um"]),
        ("band_edges", "3, 4", ["3.00-4.00um"]),
        ("band_mode", "ADAPTIVE", ["8.00-10.00um", "10.00-12.00um"]),
        ("band_tolerance", 0.1, ["8.00-12.00um"]),
    ):
        setattr(infrared, name, value)
        shown = [socket.name for socket in node.outputs if socket.enabled and socket.name.endswith("um")]
        assert shown == expected, (name, value)


# While it renders -----------------------------------------------------------------------------------------------------


class Watcher:
    """Stands between the engine and Blender: records what Blender is told and breaks the render on demand."""

    def __init__(self, monkeypatch):
        self.statuses, self.progress, self.updates = [], [], 0
        self.break_when, self.broken_at = lambda: False, None
        real = final_render.render_view_layer
        monkeypatch.setattr(final_render, "render_view_layer", lambda engine, graph: real(self.wrap(engine), graph))

    def wrap(self, engine):
        self.engine = engine
        return self

    def __getattr__(self, name):
        return getattr(self.engine, name)

    def update_stats(self, _stats, info):
        self.statuses.append(info)

    def update_progress(self, share):
        self.progress.append(share)

    def update_result(self, result):
        assert threading.current_thread() is threading.main_thread()
        self.updates += 1
        self.engine.update_result(result)

    def test_break(self):
        if self.broken_at is None and self.break_when():
            self.broken_at = time.monotonic()
        return self.broken_at is not None


def test_progress_status_and_live_image(tmp_path, monkeypatch):
    grey_room()
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass = 40, 20_000
    monkeypatch.setattr(final_render, "LIVE_INTERVAL", 0.0)
    monkeypatch.setattr(final_render, "POLL", 0.005)
    watcher = Watcher(monkeypatch)
    live = render_to_exr(tmp_path)["ViewLayer"]
    assert watcher.updates >= 1
    assert watcher.progress == sorted(watcher.progress) and 0 < watcher.progress[-1] <= 1
    assert any(status.startswith("Preparing the scene and the first pass") for status in watcher.statuses)
    running = next(status for status in watcher.statuses if "Noise" in status)
    assert running.startswith("Pass ") and "/40 | " in running and " photons | Noise " in running and " MB" in running
    monkeypatch.undo()
    for name, image in render_to_exr(tmp_path)["ViewLayer"].items():  # updates leave no trace in the final image
        np.testing.assert_array_equal(image, live[name])


def test_break_ends_the_render_and_keeps_the_passes(tmp_path, monkeypatch):
    wall(300.0)
    infrared = bpy.context.scene.infrared
    infrared.passes = 1_000_000
    infrared.band_exr_path = str(tmp_path / "bands")
    watcher = Watcher(monkeypatch)
    watcher.break_when = lambda: any(status.startswith("Pass") for status in watcher.statuses)
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    bpy.ops.render.render()
    assert time.monotonic() - watcher.broken_at < 0.5
    assert not list(tmp_path.iterdir())  # an unfinished image does not replace a finished file
    use_multilayer_exr()
    bpy.data.images["Render Result"].save_render(str(tmp_path / "kept.exr"))
    np.testing.assert_allclose(read_exr(tmp_path / "kept.exr")["ViewLayer"]["Temperature"], 300.0, rtol=FLOAT32)


def test_break_during_compilation_leaves_the_solver_behind(monkeypatch):
    """Numba cannot be interrupted; the render ends all the same."""
    wall(300.0)
    release = threading.Event()

    def compiling(scene, settings, on_pass, cancelled, **_):
        release.wait(10.0)
        assert cancelled()

    monkeypatch.setattr(final_render, "render", compiling)
    watcher = Watcher(monkeypatch)
    watcher.break_when = lambda: True
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    bpy.ops.render.render()
    assert time.monotonic() - watcher.broken_at < 0.5
    release.set()


# Messages -------------------------------------------------------------------------------------------------------------


def failed_render(tmp_path):
    """The message of a render that must fail."""
    with pytest.raises(RuntimeError) as error:
        render_to_exr(tmp_path)
    return str(error.value)


def break_camera():
    bpy.context.scene.camera = None


def break_geometry():
    bpy.data.objects["Wall"].hide_render = True


def break_temperature():
    bpy.data.objects["Wall"]["temperature"] = -5.0


def break_emissivity():
    bpy.data.materials["Wall paint"]["emissivity"] = [8.0, 0.5, 7.0, 0.5]


def break_library_name():
    bpy.data.materials["Wall paint"]["emissivity"] = "Unobtainium"


def break_bands():
    bpy.context.scene.infrared.band_mode = "CUSTOM"
    bpy.context.scene.infrared.band_edges = "8, 7"


def break_pass_name():
    bpy.context.scene.infrared.band_mode = "CUSTOM"
    bpy.context.scene.infrared.band_edges = "1e-40, 2e-40, 1"


def break_stop_condition():
    bpy.context.scene.infrared.passes = 0


@pytest.mark.parametrize(
    "damage, message",
    [
        (break_camera, "camera"),
        (break_geometry, "View layer 'ViewLayer' has nothing to render"),
        (break_temperature, "Object 'Wall': temperature -5 K"),
        (break_emissivity, "Material 'Wall paint': emissivity wavelengths must increase"),
        (break_library_name, "Material 'Wall paint': the library has no material 'Unobtainium'"),
        (break_bands, "Band edges must ascend: 8 um is followed by 7 um"),
        (break_pass_name, "characters"),
        (break_stop_condition, "Nothing stops this render"),
    ],
)
def test_errors_are_messages_without_a_traceback(tmp_path, capfd, damage, message):
    wall(300.0)
    damage()
    assert message in failed_render(tmp_path)
    shown = "".join(capfd.readouterr())
    assert "Traceback" not in shown


def test_a_later_render_works_after_an_error(tmp_path):
    wall(300.0)
    break_temperature()
    failed_render(tmp_path)
    bpy.data.objects["Wall"]["temperature"] = 310.0
    np.testing.assert_allclose(render_to_exr(tmp_path)["ViewLayer"]["Temperature"], 310.0, rtol=FLOAT32)


def test_solver_failure_reaches_the_user(tmp_path, monkeypatch, caplog):
    wall(300.0)

    def fail(*_args, **_):
        raise ZeroDivisionError("by a mistake of ours")

    monkeypatch.setattr(final_render, "render", fail)
    assert "The solver failed: ZeroDivisionError('by a mistake of ours')" in failed_render(tmp_path)
    assert "Traceback" in caplog.text  # for the bug report


def test_missing_library_is_explained(tmp_path, monkeypatch):
    wall(300.0)
    monkeypatch.delitem(sys.modules, "addon.rendering.final_render")
    monkeypatch.setitem(sys.modules, "addon.solver.checkpoint", None)
    assert "A library of the solver is missing" in failed_render(tmp_path)


def test_warnings_name_the_object_and_rendering_goes_on(tmp_path, caplog):
    wall(300.0)
    del bpy.data.objects["Wall"]["temperature"]
    bpy.context.scene.infrared.ambient_temperature = 305.0
    images = render_to_exr(tmp_path)["ViewLayer"]
    assert "'Wall': no temperature; the ambient 305 K counts" in caplog.text
    np.testing.assert_allclose(images["Temperature"], 305.0, rtol=FLOAT32)


# Band EXR -------------------------------------------------------------------------------------------------------------


def test_band_exr_is_written_with_the_render(tmp_path):
    wall(300.0)
    scene = bpy.context.scene
    scene.frame_set(7)
    scene.infrared.band_exr_path = str(tmp_path / "bands_###.exr")
    blenders = render_to_exr(tmp_path)["ViewLayer"]
    file = OpenEXR.File(str(tmp_path / "bands_007.exr"))
    channels = {name: channel.pixels[::-1] for name, channel in file.parts[0].channels.items()}
    for name, image in blenders.items():
        if name != "Combined":
            np.testing.assert_array_equal(channels[name.replace(".", ",") + ".V"], image)
    header = file.header()
    edges = [float(edge) for edge in header["bandEdges"].split()]
    np.testing.assert_array_equal(edges, np.linspace(7.5, 14.0, 4))
    assert (header["passes"], header["firstPass"], header["seed"]) == ("2", "0", "0")
    assert "W m-2 sr-1 um-1" in header["units"]


def test_band_exr_paths(tmp_path):
    """(setting, suffix of the view layer, animation) -> file"""
    scene = bpy.context.scene
    scene.frame_set(12)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    for setting, suffix, animation, expected in (
        ("//out", "", False, "out.exr"),
        ("//out", "", True, "out0012.exr"),
        ("//out_##.EXR", "", True, "out_12.exr"),
        ("//sub/v1.2_###", "", False, "sub/v1.2_012.exr"),
        ("//out", "_Layer", False, "out_Layer.exr"),
        ("//v1.2", "_Layer", True, "v1.20012_Layer.exr"),
        ("//sub/", "", False, "sub/0012.exr"),  # a folder, where Blender's own pictures are numbers, too
        ("//sub/", "_Layer", True, "sub/0012_Layer.exr"),
    ):
        scene.infrared.band_exr_path = setting
        assert final_render.file_path(scene, suffix, animation) == tmp_path / expected


@pytest.mark.parametrize(
    ("layers", "suffixes"),
    [
        (["ViewLayer"], [""]),
        (["A/1", "B"], ["_A_1", "_B"]),
        (["A.1", "A_1", "a 1"], ["_A_1", "_A_1_2", "_a_1_3"]),  # some disks take the third for the first
        (["A.1", "A_1_2", "A_1"], ["_A_1", "_A_1_2", "_A_1_3"]),
        (["B", "A", "B"], ["_B", "_A"]),
        (["Zwei/ä", "Näh"], ["_Zwei__", "_N_h"]),
    ],
)
def test_files_of_view_layers_have_names_of_their_own(layers, suffixes):
    assert layer_suffixes(layers) == dict(zip(dict.fromkeys(layers), suffixes, strict=True))
    clean = [f"_{bpy.path.clean_name(layer)}" for layer in dict.fromkeys(layers)]
    assert len(clean) == 1 or all(map(str.startswith, suffixes, clean))


@pytest.mark.parametrize("name", ["band_exr_path", "group_exr_path", "checkpoint_path"])
def test_a_path_beside_an_unsaved_file_is_an_error_before_the_first_pass(tmp_path, monkeypatch, name):
    """Blender takes it for one in the folder that the process was started in."""
    wall(300.0)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(final_render, "read_moving_scene", lambda *_: pytest.fail("It is told too late"))
    setattr(bpy.context.scene.infrared, name, "//bands")
    assert "Save the file first: '//bands' starts at its folder" in failed_render(tmp_path)
    assert not list(tmp_path.iterdir())


def test_band_exr_of_several_view_layers(tmp_path):
    wall(300.0)
    bpy.context.scene.view_layers.new("Other")
    bpy.context.scene.infrared.band_exr_path = str(tmp_path / "bands")
    render_to_exr(tmp_path)
    assert sorted(path.name for path in tmp_path.glob("bands*")) == ["bands_Other.exr", "bands_ViewLayer.exr"]


def test_unwritable_band_exr_is_an_error(tmp_path):
    wall(300.0)
    bpy.context.scene.infrared.band_exr_path = str(tmp_path / "missing" / "bands.exr")
    assert "missing" in failed_render(tmp_path)


def test_export_operator_writes_the_last_render(tmp_path):
    forget_last_render()
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.infrared.export_bands(filepath=str(tmp_path / "export.exr"))
    wall(300.0)
    blenders = render_to_exr(tmp_path)["ViewLayer"]
    assert bpy.ops.infrared.export_bands(filepath=str(tmp_path / "export.exr")) == {"FINISHED"}
    file = OpenEXR.File(str(tmp_path / "export.exr"))
    np.testing.assert_array_equal(file.parts[0].channels["Temperature.V"].pixels[::-1], blenders["Temperature"])
    with pytest.raises(RuntimeError, match="no such folder"):
        bpy.ops.infrared.export_bands(filepath=str(tmp_path / "missing" / "export.exr"))


# Registration, panels and operators -----------------------------------------------------------------------------------


def test_registering_and_drawing_load_no_large_library_and_the_interpreter_exits():
    """Windows ask for the last render and for the pictures of 3D viewports before there are any."""
    script = """
import sys, bpy, addon
addon.register()
addon.unregister()
addon.register()
from addon.rendering import last_render, live_pictures
area = next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == "VIEW_3D")
assert not any(live_pictures.picture_in(region) for region in area.regions) and not any(last_render.TABLES)
assert not bpy.ops.infrared.export_bands.poll() and not bpy.ops.infrared.range_from_render.poll()
for name in ("numba", "embreex", "OpenEXR"):
    assert name not in sys.modules, f"{name} slows the start of Blender"
print("registered")
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert "registered" in done.stdout and done.returncode == 0, done.stderr


MISSING_LIBRARIES = """
import sys
sys.modules["numba"] = sys.modules["embreex"] = None
import bpy, addon
bpy.ops.wm.read_factory_settings()
addon.register()
from addon.rendering.checks import band_problem, scene_checks
scene = bpy.context.scene
scene.render.engine = "INFRARED_PHOTONS"
assert band_problem(scene.infrared) == ""
levels = {check.level for check in scene_checks(scene, bpy.context.view_layer)}
assert "ERROR" not in levels, levels
scene.infrared.band_mode = "ADAPTIVE"
assert "A library of the solver is missing" in band_problem(scene.infrared)
scene.infrared.band_mode = "UNIFORM"
try:
    bpy.ops.render.render()
except RuntimeError as error:
    assert "A library of the solver is missing" in str(error), error
    print("told")
addon.unregister()
"""


def test_panels_are_drawn_and_the_render_tells_it_if_a_library_is_missing():
    done = subprocess.run(
        [sys.executable, "-c", MISSING_LIBRARIES], cwd=ROOT, capture_output=True, text=True, timeout=90
    )
    assert "told" in done.stdout and done.returncode == 0 and "Traceback" not in done.stderr, done.stderr


def test_kernels_are_kept_in_the_extensions_folder(monkeypatch, tmp_path):
    import addon

    for variable in ("INFRARED_PHOTONS_KERNELS", "INFRARED_PHOTONS_LIBRARY"):
        monkeypatch.setenv(variable, "")  # monkeypatch restores it afterwards
        monkeypatch.delenv(variable)
    addon._use_own_folder()
    assert "INFRARED_PHOTONS_KERNELS" not in os.environ  # this is no installed extension
    use_folders(monkeypatch, tmp_path)
    addon._use_own_folder()
    assert os.environ["INFRARED_PHOTONS_KERNELS"] == str(tmp_path / "extension" / "kernels")


def use_folders(monkeypatch, folder):
    """Let the add-on be an extension with its own folder, and Blender have its data files, in this folder."""
    for variable in ("INFRARED_PHOTONS_KERNELS", "INFRARED_PHOTONS_LIBRARY"):
        monkeypatch.setenv(variable, "")
        monkeypatch.delenv(variable)
    monkeypatch.setattr(
        bpy.utils, "extension_path_user", lambda package, path, create=False: str(folder / "extension" / path)
    )
    monkeypatch.setattr(bpy.utils, "user_resource", lambda kind, path: str(folder / kind / path))


def test_materials_of_the_artist_are_kept_outside_the_extensions_folder(monkeypatch, tmp_path):
    """Blender deletes that folder with the extension. Nothing is made before there is something to keep."""
    import addon

    use_folders(monkeypatch, tmp_path)
    addon._use_own_folder()
    assert library.user_file() == tmp_path / "DATAFILES" / "infrared_photons" / "my_materials.csv"
    assert not list(tmp_path.iterdir())


def test_materials_of_an_earlier_version_are_still_found(monkeypatch, tmp_path, caplog):
    import addon

    use_folders(monkeypatch, tmp_path)
    earlier = tmp_path / "extension" / "library" / "my_materials.csv"
    earlier.parent.mkdir(parents=True)
    text = "material,wavelength_um,emissivity,source\nOak,8.0,0.9,me\n"
    earlier.write_text(text)
    (tmp_path / "DATAFILES").write_text("a file, not a folder")
    addon._use_own_folder()
    assert library.user_file() == earlier and list(library.user_materials()) == ["Oak"]
    assert "My materials stay where removing the extension deletes them" in caplog.text
    (tmp_path / "DATAFILES").unlink()
    use_folders(monkeypatch, tmp_path)
    addon._use_own_folder()
    assert library.user_file().is_relative_to(tmp_path / "DATAFILES")
    assert list(library.user_materials()) == ["Oak"] and earlier.read_text() == text


def test_defaults_are_the_solvers():
    properties = bpy.context.scene.infrared.bl_rna.properties
    for name in Settings.__dataclass_fields__:
        if name != "reference_temperature":  # chosen by the solver
            default = getattr(Settings(), name)
            assert properties[name].default == (np.float32(default) if isinstance(default, float) else default), name


def test_every_setting_has_a_tooltip():
    for prop in bpy.context.scene.infrared.bl_rna.properties:
        if prop.identifier not in ("rna_type", "name"):
            assert len(prop.description) > 10, prop.identifier


def test_blenders_general_panels_stay():
    from addon.ui.panels import ENGINE, get_panels

    names = {panel.__name__ for panel in get_panels()}
    for name in (
        "RENDER_PT_format",
        "RENDER_PT_output",
        "RENDER_PT_color_management",
        "DATA_PT_lens",
        "DATA_PT_camera",
        "DATA_PT_camera_dof",
        "VIEWLAYER_PT_layer",
        "WORLD_PT_context_world",
        "DATA_PT_context_light",
        "EEVEE_MATERIAL_PT_context_material",
    ):
        assert name in names, name
    assert all(ENGINE in panel.COMPAT_ENGINES for panel in get_panels())


def test_setting_and_removing_custom_properties():
    obj = link("Cube", cube_mesh())
    lamp = link("Sun", bpy.data.lights.new("Sun", "SUN"))
    paint = material()
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    for owner, id_block, key, value in (
        ("OBJECT", obj, "temperature", pytest.approx(293.15)),
        ("OBJECT", lamp, "temperature", 5772.0),
        ("MATERIAL", paint, "emissivity", pytest.approx(0.95)),
        ("MATERIAL", paint, "specular", 0.0),
        ("WORLD", world, "temperature", 0.0),
    ):
        with bpy.context.temp_override(**{owner.lower(): id_block}):
            assert bpy.ops.infrared.property_add(owner=owner, key=key) == {"FINISHED"}
            assert id_block[key] == value
            ui = id_block.id_properties_ui(key).as_dict()
            assert ui["soft_min"] == 0.0 and len(ui["description"]) > 10
            assert id_block.is_property_overridable_library(f'["{key}"]') == (key != "emissivity")
            assert bpy.ops.infrared.property_remove(owner=owner, key=key) == {"FINISHED"}
            assert key not in id_block


def test_emissivities_take_any_form_after_any_other():
    """Of the panel's number, of one that overrides may change (Blender fixes its type), and from scripts."""
    from addon.solver.physics import library

    metal = library.names()[0]
    changes = (
        (lambda: bpy.ops.infrared.emissivity_library(name=metal), metal),
        (lambda: bpy.ops.infrared.emissivity_curve(points="8, 0.9, 14, 0.7"), [8.0, 0.9, 14.0, 0.7]),
        (lambda: bpy.ops.infrared.point_add(wavelength=20.0, emissivity=0.5), [8.0, 0.9, 14.0, 0.7, 20.0, 0.5]),
    )
    for overridable in (False, True):
        paint = material()
        with bpy.context.temp_override(material=paint):
            bpy.ops.infrared.property_add(owner="MATERIAL", key="emissivity")
            for change, expected in changes:
                paint.property_overridable_library_set('["emissivity"]', overridable)
                assert change() == {"FINISHED"}
                value = paint["emissivity"]
                assert (value if isinstance(value, str) else value.to_list()) == expected
            bpy.ops.infrared.property_remove(owner="MATERIAL", key="emissivity")
            bpy.ops.infrared.property_add(owner="MATERIAL", key="emissivity")
            paint["emissivity"] = metal  # a script's way


def test_library_overrides_keep_an_emissivity_of_the_same_kind(tmp_path, capfd):
    """And the operator warns, as Blender forgets one of another kind."""
    for name, value in (("Number", 0.9), ("Text", "Water")):
        paint = material(name, emissivity=value)
        paint.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (there, here):
        here.materials = there.materials
    overrides = {linked.name: linked.override_create() for linked in list(here.materials)}
    for paint in overrides.values():
        paint.use_fake_user = True
        with bpy.context.temp_override(material=paint):
            assert bpy.ops.infrared.emissivity_library(name="Gold, polished") == {"FINISHED"}
        assert paint["emissivity"] == "Gold, polished"
    assert "Material 'Number' is a library override" in capfd.readouterr().out
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    kept = {paint.name: paint["emissivity"] for paint in bpy.data.materials if paint.library is None}
    assert kept == {"Number": 0.9, "Text": "Gold, polished"}


def test_temperatures_that_were_whole_numbers_take_fractions():
    obj = link("Cube", cube_mesh(), temperature=300)
    obj.property_overridable_library_set('["temperature"]', True)
    obj.select_set(True)
    assert bpy.ops.infrared.object_temperatures(action="SET", value=300.5) == {"FINISHED"}
    assert obj["temperature"] == 300.5


def test_emissivity_operators():
    paint = material(emissivity=0.5)
    with bpy.context.temp_override(material=paint):
        bpy.ops.infrared.emissivity_curve(points="8, 0.9, 14, 0.7")
        assert paint["emissivity"].to_list() == [8.0, 0.9, 14.0, 0.7]
        bpy.ops.infrared.emissivity_curve(points="14, 0.7, 8, 0.9")  # in the order of their wavelengths
        assert paint["emissivity"].to_list() == [8.0, 0.9, 14.0, 0.7]
        for wrong in ("8, high", "8", "8, 2", "8, 0.5, 8, 0.6", "8, 0.5, nan, 0.5"):
            with pytest.raises(RuntimeError):
                bpy.ops.infrared.emissivity_curve(points=wrong)
            assert paint["emissivity"].to_list() == [8.0, 0.9, 14.0, 0.7]
        from addon.solver.physics import library

        bpy.ops.infrared.emissivity_library(name=library.names()[0])
        assert paint["emissivity"] == library.names()[0]
