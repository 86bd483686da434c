# SPDX-License-Identifier: GPL-3.0-or-later
"""Films of renders in Blender: kept, extended, and made of some passes by a command."""

from unittest.mock import Mock

import numpy as np
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


def test_a_finished_task_is_not_rendered_again(infrared, tmp_path, monkeypatch):
    arguments = ["--passes", "2-3", "--film", str(tmp_path / "some.npz")]
    assert commands.render_passes(arguments) == 0
    before = read(tmp_path / "some.npz").film
    monkeypatch.setattr(passes, "render_pass", Mock(side_effect=AssertionError("a pass was rendered")))
    assert commands.render_passes(arguments) == 0
    after = read(tmp_path / "some.npz").film
    assert after.ranges == before.ranges == [(0, 2, 4)]


@pytest.mark.parametrize("text", ["4-2", "x", "-1", "1-", ""])
def test_nonsense_is_refused(infrared, text, capsys):
    with pytest.raises(SystemExit):
        commands.render_passes([f"--passes={text}", "--film", "some.npz"])
    assert "are no passes" in capsys.readouterr().err


def test_another_engine_is_told(infrared, capsys):
    bpy.context.scene.render.engine = "CYCLES"
    assert commands.render_passes(["--passes", "0-1", "--film", "some.npz"]) == 1
    assert "not INFRARED_PHOTONS" in capsys.readouterr().err
