# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: disturb renders at random moments, and quit.

Prints a line for each: how many solvers were at work at that moment, and the seconds until the render had ended. Each
kind meets one at work at least once. The F12 after each gives the image that it gives in a Blender that was left alone.
"""

import random
import sys
import threading
import time

import bpy
import numpy as np

from tests.real_blender.hands import press_real_esc
from tests.real_blender.story import tell

BLEND = bpy.data.filepath
ROUNDS = 2
LONGEST = 2.0  # s from the start of a render to the disturbance: before, in and after its first pass
SOON = 0.5  # s, the same from when the solver is at work, in the first round
PATIENCE = 60.0  # s for a render to end


def solvers():
    """The background threads that render."""
    return [thread for thread in threading.enumerate() if thread.name == "Infrared Photons"]


def undo():
    moved = bpy.context.scene.camera.location.x
    assert bpy.ops.ed.undo() == {"FINISHED"}
    assert bpy.context.scene.camera.location.x < moved - 0.005, "the camera did not move back"
    press_real_esc()


def load_file():
    bpy.ops.wm.open_mainfile(filepath=BLEND)


def new_file():
    bpy.ops.wm.read_homefile(use_empty=True)


def render_again():
    bpy.ops.render.render("INVOKE_DEFAULT")
    press_real_esc()


def remove_scene_content():
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    press_real_esc()


def use(passes):
    """Small renders of so many passes."""
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.infrared.passes, scene.infrared.photons_per_pass = passes, 10_000


def start_endless_render():
    use(1_000_000)
    bpy.context.scene.camera.location.x += 0.01
    bpy.ops.ed.undo_push(message="Move")  # something to undo
    return bpy.ops.render.render("INVOKE_DEFAULT")


def ended(what):
    """Yield until nothing renders."""
    begin = time.monotonic()
    while bpy.app.is_job_running("RENDER") or solvers():
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError(f"still running after {what}")
        yield 0.05


def finished():
    """The last finished image, None if there is none: the module is there from the first render on."""
    module = sys.modules.get("bl_ext.user_default.infrared_photons.rendering.final_render")
    return module and module.finished_layers.get("ViewLayer")


def next_image():
    """Press F12 and yield until its render has ended; returns the images of its bands and their noise."""
    use(2)
    before = finished()
    assert bpy.ops.render.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from ended("F12")
    layer = finished()
    assert layer is not before
    return np.array([*layer["bands"], layer["noise"]])


def disturb_renders():
    """A generator that yields how many seconds to wait."""
    moments, met = random.Random(1), set()
    load_file()
    yield 0.5  # the new file's window is that of the next step
    place = bpy.context.scene.camera.location.x
    alone = yield from next_image()
    disturbances = press_real_esc, undo, load_file, new_file, render_again, remove_scene_content
    for number, disturb in enumerate(disturbances * ROUNDS):
        load_file()
        yield 0.5
        assert start_endless_render() == {"RUNNING_MODAL"}
        begin = time.monotonic()
        while number < len(disturbances) and not solvers() and time.monotonic() < begin + PATIENCE:
            yield 0.01
        yield moments.uniform(0.0, SOON if number < len(disturbances) else LONGEST)
        running = len(solvers())
        if running:
            met.add(disturb)
        begin = time.monotonic()
        disturb()
        yield from ended(disturb.__name__)
        print("DISTURBED", disturb.__name__, running, f"{time.monotonic() - begin:.2f}", flush=True)
        yield 0.5  # an Esc that was not needed is not for the next render
        if disturb in (new_file, remove_scene_content):
            load_file()
            yield 0.5
        elif disturb in (press_real_esc, render_again):
            bpy.context.scene.camera.location.x = place
        image = yield from next_image()
        assert np.array_equal(image, alone), f"another image after {disturb.__name__}"
    missed = [disturb.__name__ for disturb in disturbances if disturb not in met]
    assert not missed, f"{missed} met no solver at work"
    print("ALL DISTURBED", flush=True)


tell(disturb_renders())
