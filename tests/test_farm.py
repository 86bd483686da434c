# SPDX-License-Identifier: GPL-3.0-or-later
"""Templates of jobs for a farm, run by the reference implementation of Open Job Description on this machine."""

import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

import run  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver.checkpoint import read  # noqa: E402
from tests.helpers.faults_blender import build_scene  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
TEMPLATES = run.ROOT / "docs" / "farm"
PASSES = 25


@pytest.fixture
def job(tmp_path):
    """A scene in a file, the images of its single render, and a program that stands for Blender."""
    infrared = build_scene()
    infrared.passes = PASSES
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.render.render()
    program = tmp_path / "blender"
    command = f"{shlex.quote(sys.executable)} -m tests.helpers.blender_command"
    program.write_text(f'#!/bin/sh\ncd {shlex.quote(str(run.ROOT))} && exec {command} "$@"\n')
    program.chmod(0o755)
    (tmp_path / "films").mkdir()
    return tmp_path, dict(finished_layers["ViewLayer"]), program


def submit(job, *more, **parameters):
    """Run the job of a frame by passes; returns what it prints."""
    folder, _, program = job
    parameters = {
        "BlendFile": folder / "scene.blend", "Frame": 1, "LastPass": PASSES - 1, "PassesPerTask": 10,
        "Films": folder / "films", "Output": folder / "merged.exr", "Blender": program,
    } | parameters  # fmt: skip
    told = [f"-p={name}={value}" for name, value in parameters.items()]
    command = [Path(sys.executable).with_name("openjd"), "run", TEMPLATES / "passes.yaml", *told, *more]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    return done.returncode, done.stdout + done.stderr


def assert_merged(job):
    folder, whole, _ = job
    with OpenEXR.File(str(folder / "merged.exr"), separate_channels=True) as file:
        for name in ("temperature", "noise"):
            merged = file.channels()[f"{name.capitalize()}.V"].pixels[::-1]
            np.testing.assert_allclose(merged, whole[name], rtol=1e-5)


def test_a_frame_by_passes_is_the_single_render(job):
    """25 passes at 10 a task come as three ranges of about as many. A task whose film is gone is rendered again alone;
    the others find theirs complete."""
    code, told = submit(job, "--step", "Merge", "--run-dependencies")
    assert code == 0, told
    films = job[0] / "films"
    assert {path.name for path in films.iterdir()} == {"frame1_0-8.npz", "frame1_9-16.npz", "frame1_17-24.npz"}
    assert_merged(job)
    (films / "frame1_9-16.npz").unlink()
    (job[0] / "merged.exr").unlink()
    code, told = submit(job, "--step", "Merge", "--no-run-dependencies")
    assert code != 0 and "missing are 9 to 16" in told
    code, told = submit(job, "--step", "Passes", "--task-param", "Passes=9-16")
    assert code == 0 and read(films / "frame1_9-16.npz").film.ranges == [(0, 9, 17)], told
    code, told = submit(job, "--step", "Merge", "--no-run-dependencies")
    assert code == 0, told
    assert_merged(job)
    code, told = submit(job, "--step", "Merge", "--no-run-dependencies", TargetNoise=1e-4)
    assert code != 0 and "more passes are needed for 0.0001 K" in told


@pytest.mark.parametrize("name", ["passes", "frames"])
def test_templates_are_valid(name):
    command = [Path(sys.executable).with_name("openjd"), "check", TEMPLATES / f"{name}.yaml"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
