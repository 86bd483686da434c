# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: an artist at work in a viewport in Rendered mode, who quits while it renders.

Prints a line for each step, as test_real_blender.py reads it: the seconds until its first picture, and the longest time
that this engine kept the window from going on; how far pixels are from where Blender has them; what came of an F12
beside a viewport; when threads ended.
A folder for screenshots may be given.
"""

import json
import sys
import threading
import time

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Quaternion, Vector

from tests.real_blender.screen import capture
from tests.real_blender.story import tell

BLEND = bpy.data.filepath
SCREENSHOTS = sys.argv[1:]
PATIENCE = 300.0  # s for a picture: the first waits for kernels to be compiled
TICK = 0.005  # s between two looks

pictures = []  # the moments at which a first, coarse picture was drawn
finer = []  # and any other
calls = [0.0]  # s that calls of the engine took


def watch():
    """Note what the engine does on Blender's thread."""
    from bl_ext.user_default.infrared_photons.engine import InfraredPhotonsEngine as Engine
    from bl_ext.user_default.infrared_photons.rendering import coarse, viewport

    def texture_of(temperature, original=viewport.temperature_texture):
        (pictures if temperature.size <= coarse.FIRST_PIXELS else finer).append(time.monotonic())
        return original(temperature)

    viewport.temperature_texture = texture_of

    def timed(original):
        def call(self, context, depsgraph):
            begin = time.monotonic()
            original(self, context, depsgraph)
            calls.append(time.monotonic() - begin)

        return call

    Engine.view_update, Engine.view_draw = timed(Engine.view_update), timed(Engine.view_draw)


def renders():
    """The background threads of viewports."""
    return [thread for thread in threading.enumerate() if thread.name == "Infrared Photons viewport"]


def viewports():
    return [area for area in bpy.context.screen.areas if area.type == "VIEW_3D"]


def shade(kind):
    for area in viewports():
        area.spaces[0].shading.type = kind


def view():
    return viewports()[0].spaces[0].region_3d


def turn():
    view().view_rotation = Quaternion((0, 0, 1), 0.2) @ view().view_rotation


def perspective():
    view().view_perspective = "PERSP"
    view().view_distance = 3.0


def orthographic():
    view().view_perspective = "ORTHO"


def through_camera():
    view().view_perspective = "CAMERA"


def zoom_in_camera_view():
    view().view_camera_zoom, view().view_camera_offset = 20.0, (0.1, -0.05)


def panorama():
    bpy.context.scene.camera.data.type = "PANO"


def perspective_camera():
    bpy.context.scene.camera.data.type = "PERSP"


def hot_object():
    return max((o for o in bpy.data.objects if "temperature" in o and o.type == "MESH"), key=lambda o: o["temperature"])


def heat():
    hot_object()["temperature"] += 20.0
    hot_object().update_tag()
    bpy.ops.ed.undo_push(message="Heat")


def lower_emissivity():
    hot_object().active_material["emissivity"] = 0.4
    hot_object().active_material.update_tag()


def move_object():
    hot_object().location.x += 0.02
    bpy.ops.ed.undo_push(message="Move")


def undo():
    bpy.ops.ed.undo()


def second_viewport():
    with bpy.context.temp_override(area=viewports()[0]):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.6)
    shade("RENDERED")  # Blender lets the new one begin with Solid


def another_engine_and_back():
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"


def solid_and_back():
    shade("SOLID")
    shade("RENDERED")


def load_file():
    bpy.ops.wm.open_mainfile(filepath=BLEND)


def mismatch():
    """Largest distance in pixels between where Blender's overlays and where the solver's camera have a point."""
    from bl_ext.user_default.infrared_photons.reading.camera import read_view

    area = viewports()[0]
    region = next(region for region in area.regions if region.type == "WINDOW")
    camera = read_view(bpy.context.evaluated_depsgraph_get(), area.spaces[0], region, view())
    left, right, bottom, top = camera.frame
    worst = 0.0
    for point in np.random.default_rng(1).uniform(-0.2, 0.2, (20, 3)):
        x, y, z, _ = np.linalg.inv(camera.matrix) @ [*point, 1.0]
        depth = -z if camera.kind == "PERSPECTIVE" else 1.0
        pixel = Vector((
            (x / depth - left) / (right - left) * camera.width, (y / depth - bottom) / (top - bottom) * camera.height
        ))  # fmt: skip
        worst = max(worst, (pixel - location_3d_to_region_2d(region, view(), point)).length)
    return worst


def wait_for_picture(name, begin, count=1):
    """Yield until `count` first pictures have come; tell how long the first took."""
    while sum(moment > begin for moment in pictures) < count:
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError(name)
        yield TICK
    first = next(moment for moment in pictures if moment > begin)
    print(f"PICTURE {name} {first - begin:.3f} {max(calls):.3f}", flush=True)
    calls[:] = [0.0]


def wait_for_finer(begin):
    """Yield until a finer picture has come."""
    while not finer or finer[-1] < begin:
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError("finer pictures")
        yield TICK


def wait_for_end():
    """Yield until no thread renders any more."""
    begin = time.monotonic()
    while renders():
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError("threads")
        yield TICK
    print(f"THREADS ENDED {time.monotonic() - begin:.3f}", flush=True)


def final_images():
    """Press F12 and yield until its render has ended; returns the images of its bands and their noise."""
    begin = time.monotonic()
    assert bpy.ops.render.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    while bpy.app.is_job_running("RENDER"):
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError("F12")
        yield TICK
    layer = sys.modules["bl_ext.user_default.infrared_photons.rendering.final_render"].finished_layers["ViewLayer"]
    return np.array([*layer["bands"], layer["noise"]])


def last_picture():
    """Yield until the viewport has its last picture; returns the temperatures in it, and what is said of it."""
    from bl_ext.user_default.infrared_photons.rendering.live_pictures import viewports as viewports_of_regions

    yield from wait_for_end()
    yield 0.2  # it is drawn
    region = next(region for region in viewports()[0].regions if region.type == "WINDOW")
    viewport = viewports_of_regions[region.as_pointer()]
    return viewport.shown.temperature, viewport._render.status


def make_small():
    """Renders of about a second, that of the viewport longer than F12."""
    scene, space = bpy.context.scene, viewports()[0].spaces[0]
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.infrared.passes, scene.infrared.photons_per_pass, scene.infrared.band_count = 2, 10_000, 4
    perspective()
    space.use_render_border, space.render_border_min_x, space.render_border_min_y = True, 0.6, 0.4


def render_beside_viewport():
    """F12 and a viewport, first one after the other, then at once."""
    with bpy.context.temp_override(area=viewports()[1]):
        bpy.ops.screen.area_close()
    yield 0.1
    begin = time.monotonic()
    make_small()
    yield from wait_for_picture("make_small", begin)
    view_alone, _ = yield from last_picture()
    image_alone = yield from final_images()
    shade("SOLID")
    yield 0.1  # its render is gone
    begin = time.monotonic()
    shade("RENDERED")
    yield from wait_for_picture("beside", begin)
    running = [len(renders())]
    image = yield from final_images()
    running.append(len(renders()))
    end = time.monotonic()
    view, said = yield from last_picture()
    later = sum(moment > end for moment in finer)
    same = np.array_equal(image, image_alone), np.array_equal(view, view_alone)
    print("BESIDE", json.dumps({"running": running, "later": later, "said": said, "same": same}), flush=True)


def work():
    """A generator that yields how many seconds to wait."""
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    begin = time.monotonic()
    watch()
    print(f"LIBRARIES {time.monotonic() - begin:.3f}", flush=True)
    begin = time.monotonic()
    shade("RENDERED")
    yield from wait_for_picture("start", begin)
    for step in (perspective, turn, orthographic, through_camera, zoom_in_camera_view, panorama, perspective_camera,
                 heat, move_object, undo, lower_emissivity, second_viewport, another_engine_and_back,
                 solid_and_back):  # fmt: skip
        yield from wait_for_finer(begin)  # into the finer pictures, the next of which must then give way
        begin = time.monotonic()
        step()
        yield from wait_for_picture(step.__name__, begin, len(viewports()))
        if step is not panorama:  # Blender's overlays know none
            print(f"VIEW {step.__name__} {mismatch():.4f}", flush=True)
        if SCREENSHOTS:
            yield 1.5
            capture(f"{SCREENSHOTS[0]}/{step.__name__}.png")
    yield from render_beside_viewport()
    load_file()
    yield 0.5  # the new file's window is that of the next step
    begin = time.monotonic()
    shade("RENDERED")
    yield from wait_for_picture("load_file", begin)
    shade("SOLID")
    yield from wait_for_end()
    shade("RENDERED")
    yield 1.0
    print(f"QUIT WITH {len(renders())}", flush=True)


tell(work())
