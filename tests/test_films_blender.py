# SPDX-License-Identifier: GPL-3.0-or-later
"""Films of renders in Blender: kept, extended, and made of some passes by a command."""

from unittest.mock import Mock

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon import commands, merge  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver import passes  # noqa: E402
from addon.solver.checkpoint import read  # noqa: E402
from tests.helpers.faults_blender import build_scene  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")


@pytest.fixture
def infrared():
    infrared = build_scene()
    infrared.passes = 4
    return infrared


def render():
    bpy.ops.render.render()
    return dict(finished_layers["ViewLayer"])


def same(images, others):
    np.testing.assert_array_equal(images["bands"], others["bands"])
    np.testing.assert_array_equal(images["noise"], others["noise"])


def test_a_film_is_kept_and_extended(infrared, tmp_path):
    """Further passes are added to those that it holds: to the last bit as in a render of all."""
    infrared.film_path, bpy.context.scene.frame_current = str(tmp_path / "kept_####"), 3
    render()
    stored = read(tmp_path / "kept_0003.npz")
    assert stored.film.passes == 4 and stored.about["frame"] == 3 and stored.about["layer"] == "ViewLayer"
    infrared.passes = 6
    longer = render()
    assert read(tmp_path / "kept_0003.npz").film.ranges == [(0, 0, 6)]
    again = render()  # nothing is left to do
    infrared.film_path = ""
    for images in (longer, again):
        same(images, render())


def test_a_film_of_another_render_is_set_aside(infrared, tmp_path, caplog):
    infrared.film_path = str(tmp_path / "kept.npz")
    render()
    infrared.photons_per_pass += 1
    render()
    assert "photons_per_pass differ" in caplog.text and "kept.old1.npz" in caplog.text
    assert read(tmp_path / "kept.old1.npz").film.passes == read(tmp_path / "kept.npz").film.passes == 4


def test_a_folder_that_is_missing_is_told_before_the_render(infrared, tmp_path):
    infrared.film_path = str(tmp_path / "no" / "kept.npz")
    with pytest.raises(RuntimeError, match="Cannot write the film"):
        render()


def test_passes_by_commands_are_the_render(infrared, tmp_path):
    """Two commands and a merge; the commands write nothing but films."""
    infrared.passes, infrared.band_exr_path = 5, str(tmp_path / "whole.exr")
    whole = render()
    (tmp_path / "whole.exr").unlink()
    for some in ("3-4", "0-2"):
        film = tmp_path / f"{some}.npz"
        assert commands.render_passes(["--frame", "2", "--passes", some, "--film", str(film), "--threads", "1"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"3-4.npz", "0-2.npz"}
    assert merge.main([str(tmp_path / "*.npz"), "--film", str(tmp_path / "all_##.npz")]) == 0
    film = read(tmp_path / "all_02.npz").film
    np.testing.assert_allclose(film.temperature(), whole["temperature"], rtol=1e-6)
    np.testing.assert_allclose(film.noise(), whole["noise"], rtol=1e-5)


def facts_of(path):
    return {name: str(value) for name, value in OpenEXR.File(str(path), header_only=True).header().items()}


@pytest.mark.parametrize("kind", ["motion", "stereo"])
def test_a_merged_file_says_what_that_of_the_render_says(infrared, tmp_path, kind):
    render_settings, plate = bpy.context.scene.render, bpy.data.objects["Plate"]
    plate.keyframe_insert("location", frame=0)
    plate.location.x += 1.0
    plate.keyframe_insert("location", frame=2)
    render_settings.use_motion_blur, infrared.motion_steps, infrared.sensor_lag = kind == "motion", 2, 5.0
    render_settings.use_multiview = kind == "stereo"
    infrared.band_exr_path, infrared.film_path = str(tmp_path / "direct.exr"), str(tmp_path / "film.npz")
    bpy.ops.render.render()
    assert merge.main([str(path) for path in (tmp_path / "film*.npz", "--output", tmp_path / "merged.exr")]) == 0
    ends = {"motion": {"": ""}, "stereo": {"_L": "_ViewLayer_left", "_R": "_ViewLayer_right"}}[kind]
    for direct, merged in ends.items():
        facts = facts_of(tmp_path / f"direct{direct}.exr")
        assert facts == facts_of(tmp_path / f"merged{merged}.exr")
        assert {"motion": "shutterOpen", "stereo": "view"}[kind] in facts


def test_a_finished_task_is_not_rendered_again(infrared, tmp_path, monkeypatch):
    arguments = ["--passes", "2-3", "--film", str(tmp_path / "some.npz")]
    assert commands.render_passes(arguments) == 0
    before = read(tmp_path / "some.npz").film
    monkeypatch.setattr(passes, "render_pass", Mock(side_effect=AssertionError("a pass was rendered")))
    assert commands.render_passes(arguments) == 0
    after = read(tmp_path / "some.npz").film
    assert after.ranges == before.ranges == [(0, 2, 4)]


def test_the_command_leaves_the_scene_and_other_files_alone(infrared, tmp_path):
    """What the scene writes otherwise would be of one task's passes alone, and tasks would overwrite one another."""
    scene, folder = bpy.context.scene, tmp_path / "missing"
    bpy.data.objects["Plate"]["category"] = "plate"
    infrared.label_path, infrared.band_exr_path = str(folder / "labels.json"), str(folder / "bands.exr")
    scene.frame_set(5)
    before = {name: getattr(infrared, name) for name in type(infrared).__annotations__}
    assert commands.render_passes(["--frame", "2", "--passes", "1-2", "--film", str(tmp_path / "some.npz")]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"some.npz"}
    assert before == {name: getattr(infrared, name) for name in before}
    assert scene.frame_current == 5 and scene.render.use_sequencer and scene.render.use_compositing


def test_strips_are_not_rendered_in_place_of_the_film(infrared, tmp_path):
    editor = bpy.context.scene.sequence_editor_create()
    length = {"length": 10} if bpy.app.version >= (5, 0) else {"frame_end": 11}
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strips.new_effect(name="Colour", type="COLOR", channel=1, frame_start=1, **length)
    assert commands.render_passes(["--passes", "0", "--film", str(tmp_path / "some.npz")]) == 0
    assert read(tmp_path / "some.npz").film.passes == 1


def test_a_render_without_a_film_is_a_failure(infrared, tmp_path, capsys):
    bpy.context.view_layer.use = False
    assert commands.render_passes(["--passes", "0", "--film", str(tmp_path / "some.npz")]) == 1
    assert "Scene 'Scene' has no view layer that is rendered, so there is no film" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_film_of_more_passes_than_asked_for_is_told_and_kept(infrared, tmp_path, capsys):
    """It would clash with the film of the task that has the further passes."""
    film = str(tmp_path / "some.npz")
    assert commands.render_passes(["--passes", "2-5", "--film", film]) == 0
    assert commands.render_passes(["--passes", "2-3", "--film", film]) == 1
    assert f"'{film}' holds passes 2 to 5, asked for are 2 to 3" in capsys.readouterr().err
    assert read(tmp_path / "some.npz").film.ranges == [(0, 2, 6)]


def test_each_view_layer_has_a_film(infrared, tmp_path):
    for name in ("A.1", "A_1"):
        bpy.context.scene.view_layers.new(name)
    assert commands.render_passes(["--passes", "0", "--film", str(tmp_path / "some.npz")]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"some_ViewLayer.npz", "some_A_1.npz", "some_A_1_2.npz"}


def test_a_folder_is_no_film(infrared, tmp_path, capsys):
    with pytest.raises(SystemExit):
        commands.render_passes(["--passes", "0", "--film", f"{tmp_path}/"])
    assert f"--film is the folder '{tmp_path}/', expected a file" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["4-2", "x", "-1", "1-", "", "0-2147483647"])
def test_nonsense_is_refused(infrared, text, capsys):
    with pytest.raises(SystemExit):
        commands.render_passes([f"--passes={text}", "--film", "some.npz"])
    assert "are no passes" in capsys.readouterr().err


def test_another_engine_is_told(infrared, capsys):
    bpy.context.scene.render.engine = "CYCLES"
    assert commands.render_passes(["--passes", "0-1", "--film", "some.npz"]) == 1
    assert "not INFRARED_PHOTONS" in capsys.readouterr().err
