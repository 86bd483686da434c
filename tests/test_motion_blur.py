# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur and a sensor's time constant in Blender: what is read at subframes, and what pictures show of it."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon import commands, merge  # noqa: E402
from addon.reading.motion import read_exposure  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver.checkpoint import CheckpointError, load, read  # noqa: E402
from addon.solver.moments import at_moment  # noqa: E402
from addon.solver.physics.spectrum import band_radiance  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material  # noqa: E402
from tests.helpers.blender import read as read_rendered  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")

WIDTH, HEIGHT, STEPS = 32, 8, 16
WALL, HOT = 290.0, 350.0  # K


@pytest.fixture
def infrared():
    """A black cube of 350 K, 1 m wide, in front of a black wall; the picture is 8 m wide and taken from above.

    It moves along x by 2 m each frame, from 0 at frame 1 on.
    """
    view = camera((0.0, 0.0, 5.0), WIDTH, HEIGHT)
    view.data.type, view.data.ortho_scale = "ORTHO", 8.0
    black = material(emissivity=1.0)
    for name, kelvin in (("Wall", WALL), ("Cube", HOT)):
        mesh = cube_mesh(name)
        mesh.materials.append(black)
        link(name, mesh, temperature=kelvin)
    bpy.data.objects["Wall"].scale, bpy.data.objects["Wall"].location = (50.0, 50.0, 1.0), (0.0, 0.0, -2.0)
    move(bpy.data.objects["Cube"], "location", 0, lambda frame: 2.0 * (frame - 1.0))
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads, infrared.band_count = STEPS, 1000, 1, 2
    infrared.motion_steps = STEPS
    return infrared


def move(owner, path, index, value):
    """Key a value at one speed over the frames around 1. index: of a vector, -1 for a number."""
    for frame in (-99, 101):
        holder, _, name = path.rpartition(".")
        target = owner.path_resolve(holder) if holder else owner
        if name.startswith("["):
            target[name[2:-2]] = value(frame)
        elif index < 0:
            setattr(target, name, value(frame))
        else:
            getattr(target, name)[index] = value(frame)
        owner.keyframe_insert(path, index=index, frame=frame)
    action = owner.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    bpy.context.scene.frame_set(1)


def render():
    bpy.ops.render.render()
    return dict(finished_layers["ViewLayer"])


def share(images):
    """(columns,) how much of the cube each column shows, from 0 to 1, in the middle rows."""
    edges = images["band_edges"]
    cold, hot = band_radiance(edges, np.array([WALL, HOT])).sum(axis=1)
    return (images["radiance"][HEIGHT // 2 - 1 : HEIGHT // 2 + 1].mean(axis=0) - cold) / (hot - cold)


def columns():
    return -4.0 + 8.0 * (np.arange(WIDTH) + 0.5) / WIDTH


def covered(x, opened, closed, speed=2.0, width=1.0):
    """The share of the time from opened to closed, in frames from 1, in which a cube that moves covers x."""
    first, last = (x - 0.5 * width) / speed, (x + 0.5 * width) / speed  # the cube comes, and has gone
    return np.clip(np.minimum(last, closed) - np.maximum(first, opened), 0.0, None) / (closed - opened)


@pytest.mark.parametrize("position, opened", [("START", 0.0), ("CENTER", -0.25), ("END", -0.5)])
def test_the_shutter_is_that_of_blender(infrared, position, opened):
    """Columns of 0.25 m and 16 times, 1 / 16 m apart: a share is off by half of a step, and by what a pixel's width
    smooths, an eighth of a frame's quarter."""
    bpy.context.scene.render.motion_blur_position = position
    found = share(render())
    wanted = covered(columns(), opened, opened + 0.5)
    assert np.abs(found - wanted).max() < 0.5 / STEPS + 0.125 / (2.0 * 0.5)
    assert found.sum() * 8.0 / WIDTH == pytest.approx(1.0, abs=0.02)  # the light of a cube 1 m wide
    assert bpy.context.scene.frame_current == 1 and bpy.context.scene.frame_subframe == 0.0


def test_without_motion_blur_the_picture_is_sharp_and_as_before(infrared):
    blurred = render()
    bpy.context.scene.render.use_motion_blur = False
    sharp = render()
    assert np.ptp(np.unique(np.round(share(sharp), 3))) == pytest.approx(1.0)
    assert (np.abs(share(blurred) - share(sharp)) > 0.1).sum() >= 4
    assert "shutterOpen" not in sharp["metadata"]
    facts = {name: blurred["metadata"][name] for name in ("shutterOpen", "shutterClose", "motionSteps")}
    assert facts == {"shutterOpen": 0.75, "shutterClose": 1.25, "motionSteps": STEPS}


def test_a_shutter_of_no_length_is_told_and_blurs_nothing(infrared, caplog):
    bpy.context.scene.render.motion_blur_shutter = 0.0
    images = render()
    assert "the shutter is open for 0 frames" in caplog.text
    bpy.context.scene.render.use_motion_blur = False
    np.testing.assert_array_equal(images["bands"], render()["bands"])


def test_the_lag_of_a_bolometer(infrared):
    """24 frames a second, 12.5 ms are 0.3 frames: behind the cube the picture fades with exp(-way / 0.6 m). 64 times
    tell a share to half of 1 / 64, a pixel is 0.25 m wide."""
    bpy.context.scene.render.use_motion_blur = False
    bpy.context.scene.render.fps = 24
    infrared.sensor_lag, infrared.motion_steps, infrared.passes = 12.5, 64, 64
    found, fade = share(render()), 2.0 * 0.3
    x = columns()
    wanted = np.exp(-np.maximum(-0.5 - x, 0.0) / fade) - np.exp(-np.maximum(0.5 - x, 0.0) / fade)
    assert np.abs(found - wanted).max() < 0.5 / 64 + 0.125 / fade
    behind, ahead = found[np.abs(x + 1.0) < 0.3].mean(), found[x > 0.75]
    assert behind > 0.3 and np.all(ahead < 1e-4)


@pytest.mark.parametrize("value", [-5.0, float("nan")])
def test_a_time_constant_that_is_none_is_refused(infrared, value):
    infrared.sensor_lag = value
    with pytest.raises(RuntimeError, match="Sensor: the time constant is .* ms"):
        render()


def test_times_that_blender_does_not_have_are_refused(infrared):
    infrared.sensor_lag = 1e12
    with pytest.raises(RuntimeError, match="sees frames from .* Lower the shutter or the sensor's time constant"):
        render()


def test_a_camera_that_moves(infrared):
    """A camera that goes along with the cube shows it sharp."""
    move(bpy.data.objects["Camera"], "location", 0, lambda frame: 2.0 * (frame - 1.0))
    found = share(render())
    assert np.all((found < 0.01) | (found > 0.99))


def hide(obj, by_frame):
    """Hide an object from renders, or show it, from each of these frames on."""
    for frame, hidden in by_frame.items():
        obj.hide_render = hidden
        obj.keyframe_insert("hide_render", frame=frame)


def stretch_time(frame):
    """Time passes half as fast as the timeline tells, and the current frame is this one of the timeline."""
    scene = bpy.context.scene
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    scene.frame_set(frame)


@pytest.mark.parametrize("position, opened", [("START", 0.0), ("CENTER", -0.25), ("END", -0.5)])
def test_stretched_time_moves_things_more_slowly_through_the_same_shutter(infrared, position, opened):
    """At frame 2 the cube is where it was at 1, with half of its speed. As exact as the shutter itself."""
    bpy.context.scene.render.motion_blur_position = position
    stretch_time(2)
    found = share(render())
    wanted = covered(columns(), opened, opened + 0.5, speed=1.0)
    assert np.abs(found - wanted).max() < 0.5 / STEPS + 0.125 / (1.0 * 0.5)
    assert found.sum() * 8.0 / WIDTH == pytest.approx(1.0, abs=0.02)
    assert bpy.context.scene.frame_current == 2 and bpy.context.scene.frame_subframe == 0.0


def test_stretched_time_and_the_lag_of_a_bolometer(infrared):
    """A cube that stands and gets warmer by 80 K a frame of unstretched time, through a time constant of one frame."""
    cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    cube.location[0] = 0.0
    move(cube, '["temperature"]', -1, lambda frame: 2000.0 + 80.0 * (frame - 1.0))
    bpy.context.scene.render.use_motion_blur, bpy.context.scene.render.fps = False, 25
    infrared.sensor_lag = 40.0
    stretch_time(2)
    images = render()
    ago = -np.log((np.arange(STEPS) + 0.5) / STEPS)  # frames
    expected = band_radiance(images["band_edges"], 2000.0 - 80.0 * 0.5 * ago).sum(axis=1).mean()
    assert images["radiance"][HEIGHT // 2, WIDTH // 2] == pytest.approx(expected, rel=1e-5)
    assert bpy.context.scene.frame_current == 2


@pytest.mark.parametrize("position, lag", [("CENTER", 0.0), ("END", 0.0), ("START", 40.0)])
def test_a_picture_has_the_camera_of_its_frame(infrared, position, lag):
    """A marker cuts to a second camera at frame 1, while light of earlier times still counts: nothing is seen of where
    the first one stood. The second goes along with the cube, so that it shows it sharp."""
    scene = bpy.context.scene
    first, second = scene.camera, scene.camera.copy()
    second.data = first.data.copy()
    scene.collection.objects.link(second)
    move(second, "location", 0, lambda frame: 2.0 * (frame - 1.0))
    first.location[0], first.data.ortho_scale = 1.5, 4.0
    for frame, obj in ((-10, first), (1, second)):
        scene.timeline_markers.new("Cut", frame=frame).camera = obj
    scene.frame_set(1)
    scene.render.motion_blur_position, infrared.sensor_lag = position, lag
    found = share(render())
    assert np.all((found < 0.01) | (found > 0.99))
    assert (found > 0.99).sum() == WIDTH // 8  # the cube is 1 m wide, the picture of the second camera 8 m
    assert scene.camera == second


def test_temperatures_that_change(infrared):
    """A cube that stands and gets warmer by 80 K a frame shows the mean radiance of the times."""
    cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    cube.location[0] = 0.0
    move(cube, '["temperature"]', -1, lambda frame: 2000.0 + 80.0 * (frame - 1.0))  # above 0 K at both keys
    images = render()
    kelvin = 2000.0 + 80.0 * 0.5 * ((np.arange(STEPS) + 0.5) / STEPS - 0.5)
    expected = band_radiance(images["band_edges"], kelvin).sum(axis=1).mean()
    assert images["radiance"][HEIGHT // 2, WIDTH // 2] == pytest.approx(expected, rel=1e-5)


def test_a_mesh_that_deforms_changes_its_topology_and_appears(infrared):
    """A shape key stretches the cube, an array modifier appears while the shutter is open, and with it more faces."""
    cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    cube.location[0] = 0.0
    cube.shape_key_add(name="Basis")
    wide = cube.shape_key_add(name="Wide")
    for point in wide.data:
        point.co.x *= 3.0
    wide.value = 0.5
    move(cube.data.shape_keys, 'key_blocks["Wide"].value', -1, lambda frame: 0.5 + 0.005 * (frame - 1.0))
    copies = cube.modifiers.new("Copies", "ARRAY")
    copies.use_relative_offset, copies.use_constant_offset = False, True
    copies.constant_offset_displace = (0.0, 0.0, -0.1)
    copies.count = 1
    copies.keyframe_insert("count", frame=1)
    copies.count = 2
    copies.keyframe_insert("count", frame=2)
    other = link("Other", cube_mesh("Other"), temperature=HOT)
    other.data.materials.append(bpy.data.objects["Wall"].data.materials[0])
    other.location = (3.0, 0.0, 0.0)
    hide(other, {0: True, 1: False})
    bpy.context.scene.frame_set(1)
    scene = read_rendered()[0]
    counts = {len(at_moment(scene, moment).triangles) for moment in scene.moments}
    assert len(counts) >= 2
    found = share(render())
    assert found[np.abs(columns()) < 0.9] == pytest.approx(1.0, abs=1e-3)  # 2 m wide
    assert found[np.abs(columns() - 3.0) < 0.4] == pytest.approx(0.5, abs=1e-3)  # there from frame 1 on


def test_what_is_read_is_small(infrared):
    """Of what moves only the moved rows are kept; what stands still is kept once."""
    scene = read_rendered()[0]
    assert len(scene.moments) == STEPS
    for moment in scene.moments:
        assert [change.part for change in moment] == ["vertices"]
    cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    assert read_rendered()[0].moments == ()


def test_an_error_at_another_time_names_it(infrared):
    """At some time of the picture nothing is there to render."""
    for name in ("Cube", "Wall"):
        hide(bpy.data.objects[name], {1: False, 2: True})
    bpy.context.scene.render.motion_blur_shutter = 2.5
    bpy.context.scene.frame_set(1)
    with pytest.raises(RuntimeError, match=r"At frame 2\.\d+, which the picture sees too: View layer 'ViewLayer'"):
        render()
    assert bpy.context.scene.frame_current == 1


def test_an_error_in_the_middle_of_the_shutter_names_it(infrared):
    """There is something to render at the frame, and nothing half a frame later."""
    for name in ("Cube", "Wall"):
        hide(bpy.data.objects[name], {1: False, 2: True})
    render_settings = bpy.context.scene.render
    render_settings.motion_blur_shutter, render_settings.motion_blur_position = 2.5, "START"
    bpy.context.scene.frame_set(1)
    with pytest.raises(RuntimeError, match=r"At frame 2\.25, the middle of the shutter: View layer 'ViewLayer'"):
        render()
    assert bpy.context.scene.frame_current == 1


def test_data_passes_are_of_the_middle_of_the_shutter(infrared):
    bpy.context.scene.render.motion_blur_position = "START"  # from 1 to 1.5, so the cube is at 0.5 m in the middle
    infrared.use_surface_temperature = True
    kelvin = render()["further"]["Surface Temperature"].image[HEIGHT // 2]
    assert np.abs(columns()[kelvin == np.float32(HOT)] - 0.5).max() < 0.5
    assert (kelvin == np.float32(HOT)).sum() == 4


def test_passes_by_commands_are_the_render(infrared, tmp_path):
    """Two ranges of passes, rendered apart and merged, are the whole; a film of another shutter is not."""
    whole = render()
    for some in ("0-6", "7-15"):
        film = tmp_path / f"{some}.npz"
        assert commands.render_passes(["--frame", "1", "--passes", some, "--film", str(film)]) == 0
    assert merge.main([str(tmp_path / "*.npz"), "--film", str(tmp_path / "all.npz")]) == 0
    film = read(tmp_path / "all.npz").film
    np.testing.assert_allclose(film.temperature(), whole["temperature"], rtol=1e-6)
    np.testing.assert_allclose(film.noise(), whole["noise"], rtol=1e-5, atol=1e-7)
    bpy.context.scene.render.motion_blur_shutter = 0.6
    other = tmp_path / "other.npz"
    assert commands.render_passes(["--frame", "1", "--passes", "16-17", "--film", str(other)]) == 0
    assert merge.main([str(tmp_path / "all.npz"), str(other), "--film", str(tmp_path / "no.npz")]) == 1


def test_a_checkpoint_of_other_times_is_refused(infrared, tmp_path):
    from addon.reading.settings import read_settings

    infrared.film_path = str(tmp_path / "kept.npz")
    render()
    settings, scene = read_settings(infrared), read_rendered()[0]
    assert load(tmp_path / "kept.npz", scene, settings).passes == STEPS
    bpy.context.scene.render.motion_blur_shutter = 0.25
    with pytest.raises(CheckpointError, match="moments differ"):
        load(tmp_path / "kept.npz", read_rendered()[0], settings)


def test_times_of_a_picture(infrared):
    scene = bpy.context.scene
    scene.frame_set(10)
    infrared.motion_steps, infrared.sensor_lag = 2, 0.0
    assert read_exposure(scene).times == pytest.approx((9.875, 10.125))
    infrared.sensor_lag, scene.render.fps, scene.render.fps_base = 10.0, 50, 0.5  # 100 a second: 1 frame
    scene.render.use_motion_blur = False
    exposure = read_exposure(scene)
    assert exposure.lag == pytest.approx(1.0) and exposure.middle == 10.0
    assert exposure.times == pytest.approx((10.0 - np.log(4.0), 10.0 - np.log(4.0 / 3.0)))
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 300  # frames of the timeline, however time passes
    assert read_exposure(scene) == exposure
