# SPDX-License-Identifier: GPL-3.0-or-later
"""Persistent Data: geometry stays between frames where only temperatures, materials or the view change."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.solver.geometry import surfaces  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read_exr, render_to_exr  # noqa: E402

FRAMES = 3


@pytest.fixture
def built(monkeypatch):
    """The number of triangles in each structure for ray tracing that was built."""
    counts, real = [], surfaces.Tracer
    monkeypatch.setattr(surfaces, "Tracer", lambda *mesh: counts.append(len(mesh[1])) or real(*mesh))
    return counts


@pytest.fixture(autouse=True)
def animation(reset_blender):
    """A grey floor under a plate that warms up, while the floor's emissivity falls and the camera moves."""
    scene, eye = bpy.context.scene, camera()
    paint = material(emissivity=0.5)
    for name, size, kelvin, height in (("Floor", 40.0, 290.0, -20.0), ("Plate", 1.0, 500.0, 2.0)):
        mesh = cube_mesh(name)
        mesh.materials.append(paint)
        obj = link(name, mesh, temperature=kelvin)
        obj.scale, obj.location.z = (size, size, size), height
    for frame in range(1, FRAMES + 1):
        obj["temperature"] = 500.0 + 40.0 * frame
        obj.keyframe_insert('["temperature"]', frame=frame)
        paint["emissivity"] = 0.625 - 0.125 * frame  # exact in float32, as animation curves are
        paint.keyframe_insert('["emissivity"]', frame=frame)
        eye.location.x = 0.3 * frame
        eye.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, FRAMES
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count = 2, 2000, 3


def frames(folder, persistent: bool) -> list[dict]:
    """The passes of every frame, {view layer: {pass: pixels}}."""
    bpy.context.scene.render.use_persistent_data = persistent
    folder.mkdir()
    render_to_exr(folder, animation=True)
    return [read_exr(folder / f"image_{frame:04d}.exr") for frame in range(1, FRAMES + 1)]


def render_again(folder) -> dict:
    """Another F12 after `render_to_exr`, which chooses the engine, whereupon Blender forgets all."""
    bpy.ops.render.render(write_still=True)
    return read_exr(folder / "image.exr")


def assert_same_images(some, others):
    for one, other in zip(some, others, strict=True):
        for layer, passes in one.items():
            for name, image in passes.items():
                np.testing.assert_array_equal(image, other[layer][name], f"{layer} {name}")


def test_an_animation_builds_its_geometry_once_and_looks_the_same(tmp_path, built):
    anew = frames(tmp_path / "anew", persistent=False)
    assert len(built) == FRAMES
    temperatures = [frame["ViewLayer"]["Temperature"] for frame in anew]
    assert all(np.abs(a - b).max() > 1.0 for a, b in zip(temperatures, temperatures[1:], strict=False))  # K
    built.clear()
    assert_same_images(frames(tmp_path / "kept", persistent=True), anew)
    assert len(built) == 1


def test_rendering_again_builds_nothing_until_something_moves(tmp_path, built):
    bpy.context.scene.render.use_persistent_data = True
    first = render_to_exr(tmp_path)
    plate = bpy.data.objects["Plate"]
    plate.animation_data_clear()
    plate["temperature"] = 900.0
    plate.update_tag()
    second = render_again(tmp_path)
    assert len(built) == 1
    assert not np.array_equal(first["ViewLayer"]["Radiance"], second["ViewLayer"]["Radiance"])
    plate.location.x += 0.5
    moved = render_again(tmp_path)
    assert len(built) == 2
    bpy.context.scene.render.use_persistent_data = False
    assert_same_images([render_again(tmp_path)], [moved])
    assert len(built) == 3


def test_every_view_layer_keeps_its_own_geometry(tmp_path, built):
    scene = bpy.context.scene
    hidden = bpy.data.collections.new("Plate alone")
    scene.collection.children.link(hidden)
    plate = bpy.data.objects["Plate"]
    scene.collection.objects.unlink(plate)
    hidden.objects.link(plate)
    scene.view_layers.new("Without").layer_collection.children[hidden.name].exclude = True
    kept = frames(tmp_path / "kept", persistent=True)
    assert sorted(built) == [12, 24]  # triangles of one cube, and of two
    assert_same_images(kept, frames(tmp_path / "anew", persistent=False))


def test_checkpoints_go_on_with_kept_geometry(tmp_path, built):
    bpy.context.scene.infrared.checkpoint_path = str(tmp_path / "passes")
    kept = frames(tmp_path / "kept", persistent=True)
    assert len(built) == 1
    assert_same_images(kept, frames(tmp_path / "anew", persistent=False))


def test_another_file_forgets_the_geometry(tmp_path, built):
    bpy.context.scene.render.use_persistent_data = True
    render_to_exr(tmp_path)
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    render_to_exr(tmp_path)
    assert len(built) == 2
