# SPDX-License-Identifier: GPL-3.0-or-later
"""Templates of jobs for a farm, run by the reference implementation of Open Job Description on this machine; and the
script of a job type for Flamenco, run by a stand-in for its manager and its workers."""

import fnmatch
import json
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import quickjs

bpy = pytest.importorskip("bpy")

import run  # noqa: E402
from addon.pass_ranges import read_passes  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver.checkpoint import read  # noqa: E402
from tests.helpers.faults_blender import build_scene  # noqa: E402

pytestmark = [pytest.mark.usefixtures("reset_blender"), pytest.mark.once]
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


# Blender's program, whose process is killed when it has rendered three passes
KILLED = """
import os, signal, sys
from addon.solver.image.film import Film
from tests.helpers import blender_command

add_pass = Film.add_pass

def add_pass_and_die(film, *values):
    add_pass(film, *values)
    if film.passes == 3:
        os.kill(os.getpid(), signal.SIGKILL)

Film.add_pass = add_pass_and_die
sys.exit(blender_command.main(sys.argv[1:]))
"""


def test_a_task_that_is_killed_in_the_middle_is_rendered_again(job):
    """Whatever it leaves, the next run makes the same picture of it."""
    folder, _, _ = job
    film = folder / "films" / "frame1_9-16.npz"
    task = "--command", "infrared_passes", "--frame", "1", "--passes", "9-16", "--film", film
    done = subprocess.run([sys.executable, "-c", KILLED, "-b", folder / "scene.blend", *task], cwd=run.ROOT)
    assert done.returncode == -signal.SIGKILL
    assert not film.exists() or read(film).film.passes < 8
    code, told = submit(job, "--step", "Merge", "--run-dependencies")
    assert code == 0, told
    assert read(film).film.ranges == [(0, 9, 17)]
    assert_merged(job)


@pytest.mark.parametrize("name", ["passes", "frames"])
def test_templates_are_valid(name):
    command = [Path(sys.executable).with_name("openjd"), "check", TEMPLATES / f"{name}.yaml"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


# Flamenco -------------------------------------------------------------------------------------------------------------

# What Flamenco's manager gives a script, as in its internal/manager/job_compilers: a job keeps copies of its tasks, so
# what a task gets later is lost.
MANAGER = """
"use strict";
const path = { join: (...parts) => parts.join("/") };
const author = {
    Task: (name, type) => ({
        name, type, commands: [], dependencies: [],
        addCommand(command) { this.commands.push(command); },
        addDependency(task) { this.dependencies.push(task.name); },
    }),
    Command: (name, parameters) => ({ name, parameters }),
};
function compiled(name, settings) {
    const job = { name, settings, tasks: [], addTask(task) { this.tasks.push(JSON.parse(JSON.stringify(task))); } };
    compileJob(job);
    return JSON.stringify(job.tasks);
}
"""
# of a setting, in flamenco-openapi.yaml
KEYS = {
    "key", "type", "subtype", "choices", "propargs", "description", "label", "default", "eval", "evalInfo", "visible",
    "required", "editable",
}  # fmt: skip
KINDS = {"string": str, "int32": int, "float": float, "bool": bool}
SUBTYPES = {"file_path", "dir_path", "file_name", "hashed_file_path"}


@pytest.fixture
def flamenco():
    """Flamenco's script in a JavaScript engine."""
    context = quickjs.Context()
    context.eval(MANAGER + (TEMPLATES / "infrared_passes.js").read_text(encoding="utf-8"))
    return context


def compile_job(flamenco, name, **settings):
    """The tasks that the script makes of a job."""
    return json.loads(flamenco.eval(f"compiled({json.dumps(name)}, {json.dumps(settings)})"))


def test_settings_of_the_job_type_are_such_as_flamenco_knows(flamenco):
    """And Blender's add-on of Flamenco can work out those that are evaluated."""
    build_scene().passes = PASSES
    settings = json.loads(flamenco.eval("JSON.stringify(JOB_TYPE.settings)"))
    names = {"C": bpy.context, "bpy": bpy, "max": max}
    for each in settings:
        assert each.keys() <= KEYS and each["type"] in KINDS and each["description"]
        assert each.get("subtype", "dir_path") in SUBTYPES
        assert each.get("visible", "visible") in {"visible", "hidden", "submission", "web"}
        if "eval" in each:
            assert isinstance(eval(each["eval"], names), KINDS[each["type"]])
    found = {each["key"]: each for each in settings}
    assert eval(found["last_pass"]["eval"], names) == PASSES - 1
    assert found["blendfile"]["required"] and "eval" not in found["blendfile"]  # Flamenco's add-on fills this one in


@pytest.mark.parametrize("last, most, expected", [(24, 10, "0-7 8-15 16-24"), (0, 8, "0-0"), (7, 8, "0-7"), (3, 1, "")])
def test_every_pass_is_in_one_task(flamenco, last, most, expected):
    common = {"frame": 7, "target_noise": 0, "output_folder": "/out", "blendfile": "/a.blend"}
    *tasks, merge = compile_job(flamenco, "my job/[1]", last_pass=last, passes_per_task=most, **common)
    ranges = [task["name"].removeprefix("passes-") for task in tasks]
    assert not expected or ranges == expected.split()
    passes = [i for each in ranges for i in read_passes(each)]
    assert passes == list(range(last + 1)) and max(len(read_passes(each)) for each in ranges) <= most
    assert merge["dependencies"] == [task["name"] for task in tasks] and {task["type"] for task in tasks} == {"blender"}
    (command,) = merge["commands"]
    pattern = command["parameters"]["args"][2]
    films = [task["commands"][0]["parameters"]["args"][-1] for task in tasks]
    assert films == [f"/out/my_job__1__frame7_{each}.npz" for each in ranges] == fnmatch.filter(films, pattern)


@pytest.mark.parametrize("settings", [{"last_pass": -1, "passes_per_task": 1}, {"last_pass": 3, "passes_per_task": 0}])
def test_a_job_without_passes_is_refused(flamenco, settings):
    with pytest.raises(quickjs.JSException, match="expected 0 or more"):
        compile_job(flamenco, "job", frame=1, output_folder="/out", blendfile="/a.blend", **settings)


def test_the_tasks_of_flamenco_render_the_frame(flamenco, job):
    """Each as a worker runs it: program, arguments of the manager, the file if there is one, those of the script."""
    folder, _, program = job
    settings = {"frame": 1, "last_pass": PASSES - 1, "passes_per_task": 13, "target_noise": 0}
    settings |= {"output_folder": str(folder), "blendfile": str(folder / "scene.blend")}
    for task in compile_job(flamenco, "merged", **settings):
        (command,) = task["commands"]
        given = command["parameters"]
        assert command["name"] == "blender-render" and given["exe"] == "{blender}"
        assert given["exeArgs"] == "{blenderArgs}"
        line = [program, "-b", *given["argsBefore"], *filter(None, [given["blendfile"]]), *given["args"]]
        done = subprocess.run(line, cwd=folder, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
    (folder / "merged_0001.exr").rename(folder / "merged.exr")
    assert_merged(job)
