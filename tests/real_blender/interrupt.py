# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: disturb renders at random moments, and quit.

Prints a line for each: how many solvers were at work at that moment, and the seconds until the render had ended.
"""

import random
import subprocess
import sys
import threading
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from story import tell  # noqa: E402

BLEND = bpy.data.filepath
ROUNDS = 2
LONGEST = 2.0  # s from the start of a render to the disturbance: before, in and after its first pass
PATIENCE = 60.0  # s for a render to end


def solvers():
    """The background threads that render."""
    return [thread for thread in threading.enumerate() if thread.name == "Infrared Photons"]


def press_esc():
    """On the keyboard: an event that Blender simulates for itself does not break a render."""
    subprocess.run(["xdotool", "mousemove", "800", "450", "key", "Escape"], check=True)


def undo():
    bpy.ops.ed.undo()
    press_esc()


def load_file():
    bpy.ops.wm.open_mainfile(filepath=BLEND)


def new_file():
    bpy.ops.wm.read_homefile(use_empty=True)


def render_again():
    bpy.ops.render.render("INVOKE_DEFAULT")
    press_esc()


def remove_scene_content():
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    press_esc()


def start_endless_render():
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.infrared.passes, scene.infrared.photons_per_pass = 1_000_000, 10_000
    scene.camera.location.x += 0.01
    bpy.ops.ed.undo_push(message="Move")  # something to undo
    return bpy.ops.render.render("INVOKE_DEFAULT")


def disturb_renders():
    """A generator that yields how many seconds to wait."""
    moments = random.Random(1)
    for disturb in (press_esc, undo, load_file, new_file, render_again, remove_scene_content) * ROUNDS:
        load_file()
        yield 0.5  # the new file's window is that of the next step
        assert start_endless_render() == {"RUNNING_MODAL"}
        yield moments.uniform(0.0, LONGEST)
        running = len(solvers())
        begin = time.monotonic()
        disturb()
        while bpy.app.is_job_running("RENDER") or solvers():
            if time.monotonic() > begin + PATIENCE:
                print("STILL RUNNING after", disturb.__name__, flush=True)
                return
            yield 0.05
        print("DISTURBED", disturb.__name__, running, f"{time.monotonic() - begin:.2f}", flush=True)
    print("ALL DISTURBED", flush=True)


tell(disturb_renders())
