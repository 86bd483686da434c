# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: how long a finished picture of 1920 x 1080 takes to show what changes.

    blender --python tests/real_blender/launch.py -- tests.real_blender.bench_times

Prints milliseconds of a whole redraw of the Image Editor, on whatever draws here: the median of several; and what the
add-on's own code takes of the processor.
"""

import statistics
import time

import bpy

from tests.real_blender import hands
from tests.real_blender.story import tell
from tests.real_blender.tiles import make_scene

WIDTH, HEIGHT = 1920, 1080
REPEATS = 15

own = []  # s of one processor that the add-on's drawing took


def module(name):
    """A module of the installed add-on."""
    from importlib import import_module

    return import_module(f"bl_ext.user_default.infrared_photons.{name}")


def time_own_drawing(heat_display):
    """Let the Image Editor be drawn by a function that notes how long the add-on's takes."""
    space, handle = heat_display._handlers.pop(0)
    space.draw_handler_remove(handle, "WINDOW")

    def draw():
        begin = time.thread_time()
        heat_display.draw_over_image_editor()
        own.append(time.thread_time() - begin)

    heat_display._handlers.insert(0, (space, space.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")))


def redraws(name, area, region, change):
    """Change something, draw, and tell how long both took together."""
    total = []
    own.clear()
    for number in range(REPEATS):
        begin = time.perf_counter()
        change(number)
        with bpy.context.temp_override(area=area, region=region):
            bpy.ops.wm.redraw_timer(type="DRAW", iterations=1)
        total.append(time.perf_counter() - begin)
    mine = f", the add-on {1e3 * statistics.median(own):.1f} ms" if own else ""
    print(f"{name}: {1e3 * statistics.median(total):.1f} ms{mine}", flush=True)


def work():
    """A generator that yields how many seconds to wait."""
    make_scene()
    yield 5.0  # until kernels would be compiled, beside what is timed
    if bpy.ops.infrared.cancel_compiling.poll():
        bpy.ops.infrared.cancel_compiling()
    scene = bpy.context.scene
    infrared, render = scene.infrared, scene.render
    render.resolution_x, render.resolution_y, scene.world["temperature"] = WIDTH, HEIGHT, 250.0
    bpy.ops.render.render()
    area = hands.area_of("VIEW_3D")
    area.type = "IMAGE_EDITOR"
    space, region = area.spaces.active, hands.region_of(area)
    space.image, space.show_region_ui = bpy.data.images["Render Result"], True
    yield 1.0
    heat_display, add_tool = module("ui.temperatures.heat_display"), module("measure_settings").add_tool
    space.overlay.show_overlays = False
    redraws("without the add-on", area, region, lambda number: None)
    space.overlay.show_overlays = True
    time_own_drawing(heat_display)
    redraws("nothing changed", area, region, lambda number: None)

    def palette(number):
        infrared.palette = ("IRON", "VIRIDIS")[number % 2]

    def span(number):
        infrared.range_low = 280.0 + number

    def isotherm(number):
        infrared.use_isotherm, infrared.isotherm_low = True, 290.0 + number

    def emissivity(number):
        infrared.assumed_emissivity = 1.0 - 0.01 * number

    redraws("palette", area, region, palette)
    redraws("span", area, region, span)
    redraws("isotherm", area, region, isotherm)
    infrared.use_isotherm = False
    redraws("assumed emissivity", area, region, emissivity)
    infrared.assumed_emissivity = 1.0
    corners = [(0.1, 0.1), (0.9, 0.8), (0.3, 0.9)]
    for kind in ("SPOT", "LINE", "BOX", "ELLIPSE", "POLYGON"):
        count = {"SPOT": 1, "POLYGON": 3}.get(kind, 2)
        add_tool(infrared, kind, corners[:count])
        tool = infrared.measuring_tools[-1]

        def drag(number, tool=tool):
            tool.points[0].position[0] = 0.1 + 0.01 * number

        redraws(f"{kind.lower()} dragged", area, region, drag)


bpy.context.preferences.view.show_splash = False
tell(work())
