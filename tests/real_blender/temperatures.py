# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: show and hide the heat map, undo and redo what writes temperatures, and quit.

Prints facts, a line of JSON for each. A folder for screenshots may be given.
"""

import sys

import bpy
from bpy_extras.view3d_utils import location_3d_to_region_2d

import addon  # from the source: nothing here renders, so no library is needed
from tests.real_blender.facts import fact
from tests.real_blender.screen import capture

SCREENSHOTS = sys.argv[1:]
KELVIN = {"Cold": 280.0, "Middle": 301.0, "Hot": 320.0}


def screenshot(name: str) -> None:
    if SCREENSHOTS:
        capture(f"{SCREENSHOTS[0]}/{name}.png")


def pixel(window, region, view, location) -> list[int]:
    """8-bit sRGB on the screen, where a viewport shows a place in the scene."""
    x, y = location_3d_to_region_2d(region, view, location)
    column, row = window.x + region.x + int(x), window.height - 1 - (window.y + region.y + int(y))
    return list(capture("rgb:-", "-crop", f"1x1+{column}+{row}", "-depth", "8"))


def has_attribute() -> bool:
    return "temperature" in bpy.data.objects["Hot"].data.attributes


def traces(space) -> list:
    """What the heat map may leave behind."""
    left = [key for mesh in bpy.data.meshes for key in (*mesh.keys(), *mesh.color_attributes.keys())]
    shading = space.shading
    return [left, list(bpy.context.window.screen.keys()), shading.type, shading.light, shading.color_type]


def work(window, space, region):
    """A generator that yields how many seconds to wait."""
    view = space.region_3d
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    for i, (name, kelvin) in enumerate(KELVIN.items()):
        bpy.ops.mesh.primitive_plane_add(location=(2.5 * i, 0.0, 0.0))
        bpy.context.object.name, bpy.context.object["temperature"] = name, kelvin
    bpy.context.object.vertex_groups.new(name="heat").add([0, 1, 2, 3], 1.0, "REPLACE")
    bpy.ops.view3d.view_axis(type="TOP")
    bpy.ops.view3d.view_all()
    space.overlay.show_overlays = False
    yield 1.0
    before = traces(space)
    bpy.ops.ed.undo_push(message="Scene")

    bpy.ops.infrared.temperature_from_vertex_group("EXEC_DEFAULT", True, group="heat", low=280.0, high=320.0)
    fact("written", has_attribute())
    bpy.ops.ed.undo()
    yield 0.2
    fact("undone", has_attribute())
    bpy.ops.ed.redo()
    yield 0.2
    fact("redone", has_attribute())

    bpy.ops.infrared.heat_map_show("EXEC_DEFAULT", True)
    yield 1.0
    screenshot("heat-map")
    for obj in bpy.data.objects:
        fact(obj.name, pixel(window, region, view, obj.location))
    bpy.ops.infrared.heat_map_hide("EXEC_DEFAULT", True)
    yield 0.5
    screenshot("hidden")
    fact("same as before", traces(space) == before)
    fact("before", before)


def run():
    """Go on with the work inside the 3D viewport; quit after it."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    try:
        with bpy.context.temp_override(window=window, area=area, region=region):
            if not story:
                story.append(work(window, area.spaces.active, region))
            return next(story[0])
    except StopIteration:
        fact("end", True)
    except Exception:
        sys.excepthook(*sys.exc_info())
    bpy.ops.wm.quit_blender()


story = []
bpy.context.preferences.view.show_splash = False
addon.register()
bpy.app.timers.register(run, first_interval=2.0)
