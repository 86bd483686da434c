# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window and `--enable-event-simulate`: an artist's first hour, by mouse and keyboard.

Arguments: the extension's zip, the .blend file, and a folder for the results. Prints facts, a line of JSON for each. A
second folder may follow for screenshots.
"""

import sys
import threading
import time
from pathlib import Path

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d

from tests.real_blender import hands
from tests.real_blender.facts import fact
from tests.real_blender.screen import capture
from tests.real_blender.small import make_small
from tests.real_blender.story import tell

ARCHIVE, BLEND, RESULTS, *SCREENSHOTS = sys.argv[1:]
PATIENCE = 300.0  # s for a render: kernels may have to be compiled

renders = []  # how those that ended did


def screenshot(name: str) -> None:
    if SCREENSHOTS:
        capture(f"{SCREENSHOTS[0]}/{name}.png")


def wait_until(true, what: str):
    begin = time.monotonic()
    while not true():
        if time.monotonic() > begin + PATIENCE:
            raise TimeoutError(what)
        yield hands.PAUSE


def drop_the_zip():
    """Blender calls this operator for a file dropped into its window; it asks before it installs."""
    yield from hands.move(800, 450)
    bpy.ops.extensions.package_install_files("INVOKE_DEFAULT", url=ARCHIVE)
    yield 0.5
    screenshot("install")
    yield from hands.press("RET")
    yield from wait_until(lambda: hasattr(bpy.types.Scene, "infrared"), "installation")


def open_file():
    bpy.ops.wm.open_mainfile(filepath=BLEND)
    yield 0.5
    make_small()
    with bpy.context.temp_override(area=hands.area_of("OUTLINER")):
        bpy.ops.screen.area_close()  # panels have all the room to themselves
    yield 0.5
    for handlers, how in (
        (bpy.app.handlers.render_complete, "complete"),
        (bpy.app.handlers.render_cancel, "cancelled"),
    ):
        handlers.append(lambda *_, how=how: renders.append(how))


def select(name: str, place):
    """Click on a point of an object in the 3D viewport."""
    area = hands.area_of("VIEW_3D")
    region = hands.region_of(area)
    yield from hands.hover_middle(area)
    yield from hands.press("HOME")
    yield 0.5  # the view glides
    x, y = location_3d_to_region_2d(region, area.spaces.active.region_3d, place)
    yield from hands.move(region.x + x, region.y + y)
    yield from hands.press("LEFTMOUSE")
    yield 0.2
    assert bpy.context.view_layer.objects.active.name == name, bpy.context.view_layer.objects.active


def delete_heater():
    """What is left emits by its temperature alone."""
    heater = bpy.data.objects["Heater"]
    yield from select("Heater", heater.location)
    yield from hands.press("DEL")
    yield 0.2
    fact("objects", sorted(bpy.data.objects.keys()))


def give_temperature():
    yield from select("Plane", (0.3, 0.3, 0.0))
    plane = bpy.context.object
    yield from hands.open_tab("OBJECT")
    yield from hands.change(plane, '["temperature"]', "310.5")
    screenshot("temperature")
    fact("temperature", plane["temperature"])


def choose_library_material():
    yield from hands.open_tab("MATERIAL")
    yield from hands.push("infrared.emissivity_library")
    yield 0.5
    yield from hands.write("granite")
    yield from hands.press("RET")  # ends the search
    yield 0.2
    screenshot("library")
    yield from hands.press("RET")  # Use
    yield 0.2
    screenshot("material")
    fact("material", bpy.context.object.active_material["emissivity"])


def nearest_corner() -> float:
    """The least distance (m) from the z axis to where the picture's corners show the plane z = 0."""
    scene = bpy.context.scene
    place, matrix = scene.camera.matrix_world.translation, scene.camera.matrix_world
    rays = [matrix @ corner - place for corner in scene.camera.data.view_frame(scene=scene)]
    return min((place - ray * (place.z / ray.z)).length for ray in rays)


def render():
    begin, before = time.monotonic(), len(renders)
    yield from hands.hover_middle(hands.area_of("VIEW_3D"))
    yield from hands.press("F12")
    yield from wait_until(lambda: len(renders) > before and not bpy.app.is_job_running("RENDER"), "render")
    yield 0.5
    screenshot("render")
    fact("render", [renders[-1], round(time.monotonic() - begin, 2)])
    image = bpy.context.scene.render.image_settings
    image.media_type, image.file_format, image.color_depth = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER", "32"
    fact("nearest corner", nearest_corner())
    bpy.data.images["Render Result"].save_render(f"{RESULTS}/shown.exr")


def export_bands():
    render_window = hands.newest_window()
    yield from hands.move(render_window.width // 2, render_window.height // 2)
    yield from hands.press("ESC")  # closes it
    yield 0.5
    yield from hands.open_tab("OUTPUT")
    yield from hands.hover_middle(hands.area_of("PROPERTIES"))
    yield from hands.press("F", ctrl=True)  # the search opens the panel that it finds
    yield from hands.write("band exr")
    yield from hands.press("RET")
    yield 0.5
    screenshot("search")
    yield from hands.push("infrared.export_bands")
    yield 1.0
    browser = next(area for area in hands.newest_window().screen.areas if area.type == "FILE_BROWSER")
    screenshot("browser")
    params = browser.spaces.active.params
    params.directory, params.filename = RESULTS.encode(), "bands.exr"
    yield 0.5
    yield from hands.hover_middle(browser)
    yield from hands.press("RET")
    yield from wait_until(Path(RESULTS, "bands.exr").exists, "export")


def cancel():
    """By a real key: an event that Blender simulates for itself does not break a render."""
    yield from hands.hover_middle(hands.area_of("PROPERTIES"))
    yield from hands.press("F", alt=True)  # ends the search for the panel
    yield from hands.open_tab("RENDER")
    infrared = bpy.context.scene.infrared
    yield from hands.change(bpy.context.scene, "infrared.passes", "1000000")
    fact("passes", infrared.passes)
    yield from hands.press("F12")
    yield from wait_until(lambda: any(t.name == "Infrared Photons" for t in threading.enumerate()), "start")
    yield 2.0
    before, begin = len(renders), time.monotonic()
    bpy.app.use_event_simulate = False  # for good
    hands.press_real_esc()
    yield from wait_until(lambda: len(renders) > before and not bpy.app.is_job_running("RENDER"), "Esc")
    fact("cancelled", [renders[-1], round(time.monotonic() - begin, 2)])
    yield 0.5
    screenshot("cancelled")


def work():
    """A generator that yields how many seconds to wait."""
    for step in (drop_the_zip, open_file, delete_heater, give_temperature, choose_library_material, render,
                 export_bands, cancel):  # fmt: skip
        begin = time.monotonic()
        try:
            yield from step()
        except Exception:
            screenshot(f"failed in {step.__name__}")
            raise
        fact(f"seconds of {step.__name__}", round(time.monotonic() - begin, 1))
    fact("end", True)


bpy.context.preferences.view.show_splash = False
tell(work())
