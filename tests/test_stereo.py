# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereoscopy: a picture for each view, by Blender's cameras of two eyes or by cameras of their own."""

import json

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon import merge  # noqa: E402
from addon.reading.motion import read_moving_scene  # noqa: E402
from addon.reading.scene_reader import read_scene  # noqa: E402
from addon.reading.views import ignored_view_settings, view_names  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.rendering.last_render import finished_frames, finished_layers, last_warnings  # noqa: E402
from addon.rendering.render_files import view_suffixes  # noqa: E402
from addon.solver.moments import at_moment  # noqa: E402
from addon.ui.temperatures.spot_meter import shown_layer  # noqa: E402
from tests.helpers.blender import called_as_rendered, editor, grey_plate, use_multilayer_exr  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")

WIDTH, HEIGHT = 24, 16
APART, CONVERGE, LENS, SENSOR = 0.2, 5.0, 50.0, 36.0  # m, m, mm, mm
LEFT, RIGHT = "ViewLayer left", "ViewLayer right"


@pytest.fixture
def infrared():
    """A warm plate, seen from 5 m by two eyes that are 0.2 m apart and meet there."""
    infrared = grey_plate(WIDTH, HEIGHT, 0.8, "Plate")
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.use_multiview = True
    data = scene.camera.data
    scene.camera.location = (0.1, 0.05, CONVERGE + 1.0)
    data.lens, data.sensor_width = LENS, SENSOR
    data.stereo.interocular_distance, data.stereo.convergence_distance = APART, CONVERGE
    data.stereo.convergence_mode, data.stereo.pivot = "OFFAXIS", "CENTER"
    return infrared


def read_views():
    """What the reader makes of the current scene's views in a render, see read_moving_scene."""

    def read(engine, depsgraph):
        return read_moving_scene(engine, depsgraph, view_names(depsgraph.scene_eval.render))

    return called_as_rendered(read)["ViewLayer"]


def cameras():
    """The solver's cameras of the current scene's views."""
    return [scene.camera for scene in read_views()[0]]


def column_of(seen, point):
    """Where a camera sees a point: the distance from the picture's left edge, in its width."""
    x, _, z = np.linalg.inv(seen.matrix)[:3] @ (*point, 1.0)
    left, right = seen.frame[:2]
    return (x / -z - left) / (right - left)


# The cameras ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pivot", "places"), [("LEFT", (0.0, 1.0)), ("RIGHT", (-1.0, 0.0)), ("CENTER", (-0.5, 0.5))])
def test_eyes_lie_beside_the_pivot(infrared, pivot, places):
    bpy.context.scene.camera.data.stereo.pivot = pivot
    for seen, place in zip(cameras(), places, strict=True):
        assert seen.matrix[:3, 3] == pytest.approx((0.1 + place * APART, 0.05, CONVERGE + 1.0), abs=1e-6)


@pytest.mark.parametrize("size", [(24, 16), (16, 24)])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_eyes_off_the_axis_agree_at_the_convergence_distance(infrared, fit, size):
    """There both see a point at the same place; elsewhere the places differ by f b (1 / z - 1 / z0), over the width."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    data = scene.camera.data
    data.sensor_fit, data.shift_x, data.sensor_height = fit, 0.1, SENSOR
    left, right = cameras()
    width = left.frame[1] - left.frame[0]
    for depth in (2.0, CONVERGE, 20.0):
        point = (0.3, -0.2, CONVERGE + 1.0 - depth)
        apart = column_of(left, point) - column_of(right, point)
        assert apart == pytest.approx(APART * (1.0 / depth - 1.0 / CONVERGE) / width, abs=1e-6)


def test_eyes_that_turn_look_at_one_point(infrared):
    bpy.context.scene.camera.data.stereo.convergence_mode = "TOE"
    target = (0.1, 0.05, 1.0)  # on the axis
    assert [column_of(seen, target) for seen in cameras()] == pytest.approx([0.5, 0.5], abs=1e-6)


def test_parallel_eyes_agree_at_infinity(infrared):
    bpy.context.scene.camera.data.stereo.convergence_mode = "PARALLEL"
    left, right = cameras()
    assert left.frame == right.frame and np.array_equal(left.matrix[:3, :3], right.matrix[:3, :3])


def test_each_view_may_have_a_camera_of_its_own(infrared):
    scene = bpy.context.scene
    scene.render.views_format = "MULTIVIEW"
    scene.camera.name = "Rig_L"
    other = bpy.data.objects.new("Rig_R", scene.camera.data.copy())
    scene.collection.objects.link(other)
    other.location, other.data.lens = (1.0, 2.0, 3.0), 100.0
    left, right = cameras()
    assert left.matrix[:3, 3] == pytest.approx((0.1, 0.05, 6.0)) and right.matrix[:3, 3] == pytest.approx((1, 2, 3))
    assert right.frame[1] == pytest.approx(0.5 * left.frame[1])
    assert not list(ignored_view_settings(scene))


def test_a_focus_object_is_in_focus_of_both_eyes(infrared):
    scene = bpy.context.scene
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_object = bpy.data.objects["Plate"]
    scene.camera.data.stereo.convergence_mode = "TOE"
    far = bpy.data.objects["Plate"].matrix_world.translation
    for seen in cameras():
        assert seen.focus_distance == pytest.approx(abs((seen.matrix[:3, 3] - far) @ seen.matrix[:3, 2]), rel=1e-6)


def test_eyes_move_with_a_camera_in_motion(infrared):
    """At each time each view sees what it would see if the camera stood still there."""
    scene = bpy.context.scene
    scene.render.use_motion_blur, scene.render.motion_blur_shutter, infrared.motion_steps = True, 1.0, 4
    for frame, x in ((-9, -1.0), (11, 1.0)):
        scene.camera.location[0] = x
        scene.camera.keyframe_insert("location", index=0, frame=frame)
    scenes = read_views()[0]
    assert len(scenes) == 2 and scenes[0].vertices is scenes[1].vertices
    for moments in zip(*(scene.moments for scene in scenes), strict=True):
        left, right = (at_moment(base, moment).camera.matrix for base, moment in zip(scenes, moments, strict=True))
        assert right[:3, 3] - left[:3, 3] == pytest.approx((APART, 0.0, 0.0), abs=1e-6)
    places = [at_moment(scenes[1], moment).camera.matrix[0, 3] for moment in scenes[1].moments]
    assert np.ptp(places) > 0.05  # m; the camera moves by about 0.1 m a frame


def test_all_cameras_of_a_rig_stay_those_of_the_frame(infrared):
    """A marker cuts to a second rig at the frame at which the shutter closes."""
    scene = bpy.context.scene
    scene.render.views_format = "MULTIVIEW"
    scene.render.use_motion_blur, scene.render.motion_blur_position, infrared.motion_steps = True, "END", 3
    for number, rig in enumerate("AB"):
        for side, end in enumerate("LR"):
            obj = bpy.data.objects.new(f"{rig}_{end}", scene.camera.data)
            scene.collection.objects.link(obj)
            obj.location = (side, 10.0 * number, CONVERGE)
    for frame, rig in ((-9, "A"), (1, "B")):
        scene.timeline_markers.new("Cut", frame=frame).camera = bpy.data.objects[f"{rig}_L"]
    scene.frame_set(1)
    for side, seen in enumerate(read_views()[0]):
        of_times = [seen, *(at_moment(seen, moment) for moment in seen.moments)]
        for each in of_times:
            assert each.camera.matrix[:3, 3] == pytest.approx((side, 10.0, CONVERGE))
    assert scene.camera.name == "B_L"


# The pictures ---------------------------------------------------------------------------------------------------------


def test_each_view_is_the_picture_of_its_camera(infrared, tmp_path):
    """As if a camera stood at its eye. Blender writes both into its own file."""
    scene, data = bpy.context.scene, bpy.context.scene.camera.data
    use_multilayer_exr()
    scene.render.image_settings.views_format = "MULTIVIEW"
    scene.render.filepath = str(tmp_path / "both")
    bpy.ops.render.render(write_still=True)
    assert list(finished_layers) == list(finished_frames) == [LEFT, RIGHT]
    views = {frame.view: finished_layers[name] for name, frame in finished_frames.items()}
    assert not np.array_equal(views["left"]["temperature"], views["right"]["temperature"])
    written = {}
    for part in OpenEXR.File(str(tmp_path / "both.exr")).parts:  # of one view in Blender 5, else views are in the names
        written |= {f"{name} {part.header.get('view')}": of.pixels for name, of in part.channels.items()}
    for view, images in views.items():
        (found,) = (pixels for name, pixels in written.items() if ".Temperature" in name and view in name)
        assert np.array_equal(found[::-1], images["temperature"]) and images["metadata"]["view"] == view
    scene.render.use_multiview = False
    scene.camera.location[0] -= 0.5 * APART
    data.shift_x += 0.5 * APART / SENSOR * LENS / CONVERGE
    bpy.ops.render.render()
    assert list(finished_layers) == ["ViewLayer"]
    alone = finished_layers["ViewLayer"]["temperature"]
    # the camera's place and shift are float32 in Blender: rays differ by 1e-7 of the distance, a pixel at the rim by as
    # much of the step between plate and sky
    assert np.abs(alone - views["left"]["temperature"]).max() < 60.0 * 1e-4


def test_files_of_views_end_as_blenders_do(infrared, tmp_path):
    infrared.band_exr_path, infrared.label_path = str(tmp_path / "bands_####.exr"), str(tmp_path / "labels")
    infrared.film_path, infrared.checkpoint_path = str(tmp_path / "film"), str(tmp_path / "kept")
    bpy.ops.render.render()
    names = {path.name for path in tmp_path.iterdir()}
    assert {f"{stem}{end}" for stem in ("bands_0001_L", "bands_0001_R") for end in (".exr",)} <= names
    assert {"labels_L.json", "labels_R.json", "film_L.npz", "film_R.npz"} <= names
    told = [json.loads((tmp_path / f"labels_{end}.json").read_text())["images"][0] for end in "LR"]
    assert [each["file_name"] for each in told] == ["bands_0001_L.exr", "bands_0001_R.exr"]
    assert told[0]["camera"] != told[1]["camera"]
    header = OpenEXR.File(str(tmp_path / "bands_0001_R.exr")).header()
    assert header["view"] == "right"  # the name that EXR itself has for it
    # a film of one eye is not taken for one of the other
    assert (
        merge.main([str(tmp_path / "film_L.npz"), str(tmp_path / "film_R.npz"), "--output", str(tmp_path / "m")]) == 0
    )
    assert {"m_ViewLayer_left.exr", "m_ViewLayer_right.exr"} <= {path.name for path in tmp_path.iterdir()}
    (tmp_path / "film_L.npz").replace(tmp_path / "film_R.npz")
    bpy.ops.render.render()
    assert any("is of another render" in message or "film_R" in message for message in last_warnings)


def test_detectors_of_the_eyes_have_noise_of_their_own(infrared):
    infrared.use_detector, infrared.detector_netd = True, 0.1
    data = bpy.context.scene.camera.data
    data.stereo.interocular_distance = 0.0  # both see the same
    bpy.ops.render.render()
    left, right = (finished_layers[name] for name in (LEFT, RIGHT))
    assert np.array_equal(left["temperature"], right["temperature"])
    noise = [images["further"]["Camera Temperature"].image - images["temperature"] for images in (left, right)]
    correlation = np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]
    assert abs(correlation) < 4.0 / np.sqrt(WIDTH * HEIGHT)  # 4 standard errors of that of independent numbers


def test_the_editor_shows_the_view_that_is_chosen(infrared):
    scene = bpy.context.scene
    scene.view_layers.new("Second")
    bpy.ops.render.render()
    names = [f"{layer} {view}" for layer in ("ViewLayer", "Second") for view in ("left", "right")]
    assert list(finished_frames) == names
    shown = [shown_layer(editor(layer, view=view), scene).images for layer in (0, 1) for view in (0, 1)]
    assert all(images is finished_layers[name] for images, name in zip(shown, names, strict=True))
    assert shown_layer(editor(0, view=2), scene) is None and shown_layer(editor(2), scene) is None


# What is asked for and not done ---------------------------------------------------------------------------------------


def test_a_missing_camera_of_a_view_is_named(infrared):
    scene = bpy.context.scene
    scene.render.views_format, scene.camera.name = "MULTIVIEW", "Eye_L"
    expected = "Stereoscopy: there is no camera 'Eye_R', so view 'right' shows what 'Eye_L' sees"
    assert list(ignored_view_settings(scene)) == [expected]
    assert expected in [check.text for check in scene_checks(scene, bpy.context.view_layer)]
    bpy.ops.render.render()
    assert list(last_warnings) == [expected]  # once, not for each view
    left, right = (finished_layers[name]["temperature"] for name in (LEFT, RIGHT))
    assert np.array_equal(left, right)


def test_spherical_stereo_is_named(infrared):
    camera = bpy.context.scene.camera
    camera.data.type, camera.data.stereo.use_spherical_stereo = "PANO", True
    (message,) = ignored_view_settings(bpy.context.scene)
    assert message == f"Camera '{camera.name}': no spherical stereo; its panoramas are of two cameras side by side"
    bpy.ops.render.render()
    assert message in last_warnings


@pytest.mark.parametrize(
    ("used", "ends", "expected"),
    [
        (("left", "right"), ("_L", "_R"), {"left": "_L", "right": "_R"}),
        (("left", "right"), ("_x", "_X"), {"left": "_left", "right": "_right"}),  # some disks take them for one
        (("right",), ("_L", "_R"), {"right": ""}),
        ((), ("_L", "_R"), {"": ""}),
    ],
)
def test_suffixes_of_views_differ(infrared, used, ends, expected):
    render = bpy.context.scene.render
    for view, end in zip(render.stereo_views, ends, strict=True):
        view.use, view.file_suffix = view.name in used, end
    assert view_suffixes(render) == expected
    bpy.ops.render.render()
    assert len(finished_layers) == max(1, len(used))


def test_without_stereoscopy_a_scene_is_read_once(infrared):
    bpy.context.scene.render.use_multiview = False
    scenes, _, _ = read_views()
    assert len(scenes) == 1
    graph = bpy.context.evaluated_depsgraph_get()
    assert np.array_equal(scenes[0].camera.matrix, read_scene(graph)[0].camera.matrix)
