# SPDX-License-Identifier: GPL-3.0-or-later
"""Series of meshes with temperatures in Blender: loaded by the operator, and rendered at frames between their steps."""

import subprocess
import sys

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import run  # noqa: E402
from addon.convert import Surface, write_ply  # noqa: E402
from tests.helpers.blender import camera, render_to_exr  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
CORNERS = np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0]], np.float32)  # m
SLOPE = np.array([1.0, 2.0, 0.0], np.float32)  # K/m
LEVELS = 300.0, 320.0, 310.0  # K at the origin, of each step


def write_series(folder, times=(0.0, 1.0, 3.0), **changes):
    """A plate at several times, hot-plate_1.ply and so on; `changes` are other fields of the surface of the last."""
    names = []
    for number, (level, time) in enumerate(zip(LEVELS, times, strict=True), 1):
        fields = {"points": CORNERS, "faces": [np.array([[0, 1, 2, 3]])], "kelvin": level + CORNERS @ SLOPE}
        if number == len(LEVELS):
            fields |= changes
        names.append(f"hot-plate_{number}.ply")
        write_ply(folder / names[-1], Surface(**fields), time)
    return names


def load(folder, names, **settings):
    files = [{"name": name} for name in names]
    assert bpy.ops.infrared.temperature_series(directory=f"{folder}/", files=files, **settings) == {"FINISHED"}
    return bpy.context.object


def temperatures(obj, frame):
    """The evaluated attribute of an object at a frame, which may be between two."""
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(len(evaluated.vertices), np.float32)
    evaluated.attributes["temperature"].data.foreach_get("value", values)
    return values


def level(frame, frames):
    return np.interp(frame, frames, LEVELS)


def test_any_frame_and_subframe_has_its_temperatures(tmp_path):
    plate = load(tmp_path, write_series(tmp_path), frame_start=10, frames_per_step=4.0)
    assert plate.name == "hot-plate" and len(plate.data.vertices) == 4
    for frame in (1.0, 10.0, 11.0, 12.5, 14.0, 16.0, 18.0, 50.0):
        expected = level(frame, (10, 14, 18)) + CORNERS @ SLOPE
        np.testing.assert_allclose(temperatures(plate, frame), expected, rtol=2e-7)  # float32


def test_steps_are_at_the_times_of_their_files(tmp_path):
    bpy.context.scene.render.fps = 20
    plate = load(tmp_path, write_series(tmp_path), frame_start=1, spacing="TIMES", speed=2.0)
    for frame in (1.0, 6.0, 11.0, 16.0, 31.0):
        expected = level(frame, (1, 11, 31)) + CORNERS @ SLOPE
        np.testing.assert_allclose(temperatures(plate, frame), expected, rtol=2e-7)


def test_files_are_in_the_order_of_their_numbers_and_one_is_enough(tmp_path):
    names = [f"s{number}.ply" for number in (10, 9)]
    for name, kelvin in zip(names, (310.0, 309.0), strict=True):
        write_ply(tmp_path / name, Surface(CORNERS, [np.array([[0, 1, 2, 3]])], np.full(4, kelvin, np.float32)))
    series = load(tmp_path, names)
    assert [temperatures(series, frame)[0] for frame in (1.0, 2.0)] == [309.0, 310.0]
    assert (temperatures(load(tmp_path, names[:1]), 7.0) == 310.0).all()


def test_a_background_render_of_the_file_interpolates(tmp_path):
    """Rendered from the saved file by another process, at a frame between two steps, with nothing of the series' files
    left: the pixels are those of the plate."""
    names = write_series(tmp_path)
    load(tmp_path, names, frames_per_step=4.0)
    scene = bpy.context.scene
    eye = camera((0.0, 0.0, 2.0), 16, 12)
    eye.data.type, eye.data.ortho_scale = "ORTHO", 4.0
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 1000, 2, 1
    infrared.default_emissivity, infrared.use_surface_temperature = 1.0, True
    scene.render.engine, scene.frame_start, scene.frame_end = "INFRARED_PHOTONS", 4, 4
    infrared.band_exr_path = str(tmp_path / "bands")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    for name in names:
        (tmp_path / name).unlink()
    code = f"import addon, bpy; addon.register(); bpy.ops.wm.open_mainfile(filepath={str(tmp_path / 'scene.blend')!r});"
    code += f"bpy.context.scene.render.filepath = {str(tmp_path / 'picture')!r}; bpy.ops.render.render(animation=True)"
    done = subprocess.run([sys.executable, "-c", code], cwd=run.ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    import OpenEXR

    with OpenEXR.File(str(tmp_path / "bands0004.exr"), separate_channels=True) as file:
        seen, apparent = (file.channels()[f"{name}.V"].pixels[::-1] for name in ("Surface Temperature", "Temperature"))
    y, x = np.mgrid[-1.5 + 0.125 : 1.5 : 0.25, -2.0 + 0.125 : 2.0 : 0.25]
    expected = level(4.0, (1, 5, 9)) + x * SLOPE[0] + y * SLOPE[1]
    np.testing.assert_allclose(seen, expected, atol=3e-4)  # 3 K/m over 1e-6 m of 6 m, and float32
    np.testing.assert_allclose(apparent, expected, atol=0.3)  # new rays in each pixel of 0.25 m, 3 K/m


def test_pixels_of_a_step_are_those_of_its_file(tmp_path):
    names = write_series(tmp_path)
    load(tmp_path, names, frames_per_step=4.0)
    eye = camera((0.0, 0.0, 2.0), 16, 12)
    eye.data.type, eye.data.ortho_scale = "ORTHO", 4.0
    scene = bpy.context.scene
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 1000, 2, 1
    scene.frame_set(5)
    series = render_to_exr(tmp_path)["ViewLayer"]["Temperature"]
    bpy.data.objects.remove(bpy.data.objects["hot-plate"])
    bpy.ops.wm.ply_import(filepath=str(tmp_path / names[1]))
    np.testing.assert_array_equal(render_to_exr(tmp_path)["ViewLayer"]["Temperature"], series)


@pytest.mark.parametrize(
    "why, settings, changes",
    [
        ("'hot-plate_3.ply' has another mesh than 'hot-plate_1.ply'", {}, {"faces": [np.array([[0, 1, 2]])]}),
        ("'hot-plate_3.ply': temperature -5 K", {}, {"kelvin": np.full(4, -5.0, np.float32)}),
        ("'hot-plate_2.ply' does not tell its time", {"spacing": "TIMES"}, {"time": (0.0, None, 1.0)}),
        ("times of the files do not grow", {"spacing": "TIMES"}, {"time": (0.0, 0.0, 1.0)}),
    ],
)
def test_what_is_no_series_is_refused_and_leaves_nothing(tmp_path, why, settings, changes):
    names = write_series(tmp_path, **({"times": changes["time"]} if "time" in changes else changes))
    with pytest.raises(RuntimeError, match=f"(?i){why}"):
        load(tmp_path, names, **settings)
    assert not bpy.data.objects and not bpy.data.meshes and not bpy.data.node_groups


def test_other_files_are_refused_by_name(tmp_path):
    (tmp_path / "broken.ply").write_text("nothing")
    ordinary = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    ordinary += "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    (tmp_path / "cold.ply").write_text(ordinary)
    for name, why in {
        "cold.ply": "no property 'temperature'",
        "broken.ply": "broken.ply",
        "none.ply": "none.ply",
    }.items():
        with pytest.raises(RuntimeError, match=why):
            load(tmp_path, [name])
    assert not bpy.data.objects and not bpy.data.meshes
