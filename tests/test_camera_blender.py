# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's camera puts every point on the pixel where Blender's camera puts it."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Vector  # noqa: E402

from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, read  # noqa: E402


@pytest.fixture(autouse=True)
def with_cube(reset_blender):
    link("Cube", cube_mesh(), temperature=300.0)


@pytest.fixture
def tilted():
    obj = camera((3.0, -4.0, 2.0), width=64, height=36)
    obj.rotation_euler = (1.1, 0.2, 0.6)
    return obj


def position(result, point):
    """(x, y, depth) of a world point: x and y from 0 to 1 over the frame, as the solver's Camera defines its frame."""
    local = np.linalg.inv(result.matrix) @ np.array([*point, 1.0])
    x, y = local[:2] / -local[2] if result.kind == "PERSPECTIVE" else local[:2]
    left, right, bottom, top = result.frame
    return (x - left) / (right - left), (y - bottom) / (top - bottom), -local[2]


def assert_same_pixels(obj):
    """world_to_camera_view knows shift and sensor fit, but no pixel aspect: use it with square pixels only."""
    result = read()[0].camera
    obj = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    rng = np.random.default_rng(1)
    local = rng.uniform((-2, -2, -9), (2, 2, -1), (20, 3))
    for point in local:
        world = obj.matrix_world.normalized() @ Vector(point)
        expected = world_to_camera_view(bpy.context.scene, obj, world)
        np.testing.assert_allclose(position(result, world), expected, rtol=2e-5, atol=2e-5)  # float32 matrices
    return result


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("size", [(64, 36), (36, 64), (50, 50)])
def test_sensor_fit_and_shift(tilted, kind, fit, size):
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    data = tilted.data
    data.type, data.sensor_fit, data.sensor_width, data.sensor_height = kind, fit, 36.0, 20.0
    data.shift_x, data.shift_y, data.lens, data.ortho_scale = 0.2, -0.3, 35.0, 5.0
    result = assert_same_pixels(tilted)
    assert (result.width, result.height) == size and result.window is None
    assert result.kind == ("PERSPECTIVE" if kind == "PERSP" else "ORTHOGRAPHIC")


def test_scale_and_parent_do_not_change_the_lens(tilted):
    parent = link("Parent")
    parent.scale, parent.location = (2.0, 2.0, 2.0), (1.0, 0.0, 0.0)
    tilted.parent = parent
    tilted.scale = (3.0, 0.5, 1.0)
    result = assert_same_pixels(tilted)
    np.testing.assert_allclose(np.linalg.norm(result.matrix[:3, :3], axis=0), 1.0, rtol=1e-9)


def test_pixel_aspect_widens_the_frame(tilted):
    """A 64 x 36 frame of pixels twice as wide as high shows what a 128 x 36 frame of square pixels shows."""
    render = bpy.context.scene.render
    render.pixel_aspect_x, render.pixel_aspect_y = 2.0, 1.0
    wide = read()[0].camera
    render.pixel_aspect_x, render.resolution_x = 1.0, 128
    square = read()[0].camera
    assert (wide.width, square.width) == (64, 128)
    np.testing.assert_allclose(wide.frame, square.frame, rtol=1e-6)


def test_resolution_percentage_rounds_down_as_blender(tilted):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 101, 67, 33
    result = read()[0].camera
    assert (result.width, result.height) == (33, 22)


@pytest.mark.parametrize("crop", [False, True])
def test_border_is_the_window(tilted, crop):
    render = bpy.context.scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.5, 1.0
    whole = read()[0].camera
    assert whole.window == (16, 18, 48, 36) and (whole.width, whole.height) == (64, 36)


def test_clip_range(tilted):
    tilted.data.clip_start, tilted.data.clip_end = 0.5, 20.0
    assert read()[0].camera.clip == (0.5, 20.0)


def test_depth_of_field(tilted):
    assert read()[0].camera.lens_radius == 0.0
    dof = tilted.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, 2.0, 3.5
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 6, 0.3, 1.5
    tilted.data.lens = 50.0
    result = read()[0].camera
    assert result.lens_radius == pytest.approx(0.050 / 4)  # focal length over f-number is the diameter
    assert (result.focus_distance, result.blades) == (3.5, 6)
    assert (result.blade_rotation, result.lens_ratio) == pytest.approx((0.3, 1.5))
    tilted.data.type = "ORTHO"
    assert read()[0].camera.lens_radius == pytest.approx(1 / 4)  # as Cycles: there is no focal length


def test_focus_object_counts_along_the_view_axis(tilted):
    tilted.location, tilted.rotation_euler = (0.0, 0.0, 10.0), (0.0, 0.0, 0.0)
    dof = tilted.data.dof
    dof.use_dof, dof.focus_object = True, link("Focus")
    dof.focus_object.location = (3.0, 1.0, 4.0)
    assert read()[0].camera.focus_distance == pytest.approx(6.0)


def test_focus_on_a_bone(tilted):
    tilted.location, tilted.rotation_euler = (0.0, 0.0, 10.0), (0.0, 0.0, 0.0)
    armature = link("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("Tip")
    bone.head, bone.tail = (0, 0, 3), (0, 0, 4)
    bpy.ops.object.mode_set(mode="OBJECT")
    dof = tilted.data.dof
    dof.use_dof, dof.focus_object, dof.focus_subtarget = True, armature, "Tip"
    assert read()[0].camera.focus_distance == pytest.approx(7.0)


def test_panorama(tilted):
    data = tilted.data
    data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
    scene, warnings = read()
    assert scene.camera.kind == "PANORAMA" and not warnings_about("Camera", warnings)
    np.testing.assert_allclose(scene.camera.frame, (-np.pi, np.pi, -np.pi / 2, np.pi / 2), rtol=1e-6)
    data.longitude_min, data.longitude_max, data.latitude_min, data.latitude_max = -0.5, 1.5, -0.25, 0.75
    data.shift_x, data.shift_y = 0.25, -0.5
    np.testing.assert_allclose(read()[0].camera.frame, (0.0, 2.0, -0.75, 0.25), atol=1e-6)


def warnings_about(name, warnings):
    return [w for w in warnings if f"'{name}'" in w]


def test_other_panoramas_fall_back_with_a_warning(tilted):
    tilted.data.type, tilted.data.panorama_type = "PANO", "FISHEYE_EQUIDISTANT"
    scene, warnings = read()
    assert scene.camera.kind == "PANORAMA"
    (warning,) = warnings_about("Camera", warnings)
    assert "Fisheye Equidistant" in warning and "Equirectangular" in warning


def test_custom_camera_and_other_objects_are_refused(tilted):
    tilted.data.type = "CUSTOM"
    with pytest.raises(SceneError, match="Camera 'Camera': type CUSTOM"):
        read()
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "SPOT"))
    bpy.context.scene.camera = lamp
    with pytest.raises(SceneError, match="'Lamp'.*not a camera"):
        read()


def test_camera_keyframes_count(tilted):
    for frame, lens in ((1, 20.0), (11, 60.0)):
        tilted.data.lens = lens
        tilted.data.keyframe_insert("lens", frame=frame)
    bpy.context.scene.frame_set(11)
    assert read()[0].camera.frame[1] == pytest.approx(18.0 / 60.0, rel=1e-5)
