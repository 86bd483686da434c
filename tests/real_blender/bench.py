# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window and `--enable-event-simulate`: a thermographer works on a finished picture.

A wall of black tiles, one for each pixel of a render, whose temperatures are known: the span is dragged on the colour
bar, five tools are placed, one gets an emissivity of its own. Prints facts. A folder for screenshots and exported
files may be given.
"""

import sys

import bpy

from tests.real_blender import hands
from tests.real_blender.exports import export_all
from tests.real_blender.facts import fact
from tests.real_blender.screen import capture
from tests.real_blender.story import tell
from tests.real_blender.tiles import make_scene

SCREENSHOTS = sys.argv[1:]
ZOOM = 11.3  # pixels of the screen on each side of one of the picture's
FIRST_BUTTON, BUTTON = 18, 21  # pixels of the sidebar: the middle of the first tool's button, and from one to the next
DRAWN = 0.5  # s in which Blender has drawn everything
PLACES = {
    "SPOT": [(10, 30)],
    "LINE": [(5, 5), (40, 12)],
    "BOX": [(20, 20), (35, 30)],
    "ELLIPSE": [(38, 18), (54, 34)],
    "POLYGON": [(4, 34), (18, 34), (16, 42), (6, 42)],
}  # columns and rows of the pixels that are clicked on


def module(name):
    """A module of the installed add-on."""
    from importlib import import_module

    return import_module(f"bl_ext.user_default.infrared_photons.{name}")


def editor():
    """(area, main region) of the Image Editor."""
    area = hands.area_of("IMAGE_EDITOR")
    return area, hands.region_of(area)


def infrared():
    return bpy.context.scene.infrared


def screenshot(name):
    if SCREENSHOTS:
        capture(f"{SCREENSHOTS[0]}/{name}.png")


def show_render():
    """Render, and show it in place of the 3D viewport, with toolbar and sidebar."""
    make_scene()
    yield 0.2
    bpy.context.scene.world["temperature"] = 250.0
    bpy.ops.render.render()
    area = hands.area_of("VIEW_3D")
    area.type = "IMAGE_EDITOR"
    space = area.spaces.active
    space.image, space.show_region_ui, space.show_region_toolbar = bpy.data.images["Render Result"], True, True
    yield DRAWN
    hands.region_of(area, "UI").active_panel_category = "Infrared"
    area.tag_redraw()
    yield DRAWN
    area, region = editor()
    with bpy.context.temp_override(area=area, region=region):
        bpy.ops.image.view_all()
        bpy.ops.image.view_zoom_ratio(ratio=ZOOM)
    yield DRAWN


def bar():
    """The colour bar, in the pixels of its region."""
    area, region = editor()
    with bpy.context.temp_override(area=area, region=region):
        return module("ui.temperatures.bar").bar_of(bpy.context, area, region)


def drag(start, *ways):
    """With the left button from a place (x, y) of the main region by (x, y) pixels each."""
    _, region = editor()
    yield from hands.move(region.x + start[0], region.y + start[1])
    hands.button_down()
    yield hands.PAUSE
    x, y = start
    for dx, dy in ways:
        x, y = x + dx, y + dy
        yield from hands.move(region.x + x, region.y + y)
    hands.button_up()
    yield hands.PAUSE


def drag_span():
    """Its ends, its middle, and a double click that fits."""
    fact("range at first", [infrared().range_mode, infrared().range_low, infrared().range_high])
    left, bottom, width, height = bar().bar
    fact("bar", bar().bar)
    x = left + width // 2
    yield from drag((x, bottom + height - 4), (0, 10), (0, 20))
    fact("upper end dragged", [infrared().range_mode, infrared().range_low, infrared().range_high, 30 / height])
    yield from drag((x, bottom + 4), (0, 20))
    yield DRAWN
    fact("lower end dragged", [infrared().range_mode, infrared().range_low, infrared().range_high])
    yield from drag((x, bottom + height // 2), (0, -25))
    fact("middle dragged", [infrared().range_mode, infrared().range_low, infrared().range_high])
    screenshot("dragged")
    yield from hands.press("Z", ctrl=True)
    yield 0.2
    fact("undone", [infrared().range_mode, infrared().range_low, infrared().range_high])
    yield 0.6  # or the next click would be the second one
    bpy.context.preferences.inputs.mouse_double_click_time = 1000  # ms: time enough for a slow machine to draw
    for _ in range(2):
        yield from hands.press("LEFTMOUSE")
    bpy.context.preferences.inputs.mouse_double_click_time = 350
    yield DRAWN
    fact("double click", [infrared().range_mode])


def seen():
    area, region = editor()
    return module("ui.temperatures.seen").seen_in(area, region, bpy.context.scene)


def middle_of(pixel):
    """Where a pixel (column, row) of the picture is in the main region."""
    x, y = seen().middle_of(pixel[::-1])
    return int(x), int(y)


def choose(kind):
    """Take a tool by its button in the sidebar."""
    area = hands.area_of("IMAGE_EDITOR")
    names = list(PLACES)
    sidebar = hands.region_of(area, "UI")
    share = (FIRST_BUTTON + names.index(kind) * BUTTON) / sidebar.width
    yield from hands.hover(area, sidebar, hands.button("infrared.tool_choose"), share)
    yield from hands.press("LEFTMOUSE")
    yield 0.2
    area, region = editor()
    with bpy.context.temp_override(area=area, region=region):
        fact(f"toolbar {kind}", bpy.context.workspace.tools.from_space_image_mode("VIEW").idname)


def place_tools():
    for kind, pixels in PLACES.items():
        yield from choose(kind)
        places = [middle_of(pixel) for pixel in pixels]
        if kind == "POLYGON":
            _, region = editor()
            for x, y in places:
                yield from hands.move(region.x + x, region.y + y)
                yield from hands.press("LEFTMOUSE")
                yield 0.5  # or it would be a double click
            yield from hands.press("RET")
        else:
            ways = [(b[0] - a[0], b[1] - a[1]) for a, b in zip(places, places[1:], strict=False)]
            yield from drag(places[0], *ways)
        yield 0.2
    fact("tools", [[tool.kind, tool.places()] for tool in infrared().measuring_tools])
    fact("readings", readings())
    screenshot("tools")


def readings():
    """What each tool reads."""
    read, picture = module("rendering.readings").read_tool, seen().picture
    return [read(tool, picture, infrared())._asdict() for tool in infrared().measuring_tools]


def change_emissivity():
    """Of the box, which is chosen by a click on its edge, in the sidebar."""
    scene, box = bpy.context.scene, infrared().measuring_tools[2]
    yield from drag(middle_of((27, 20)))
    fact("chosen", infrared().tool_index)
    area = hands.area_of("IMAGE_EDITOR")
    sidebar = hands.region_of(area, "UI")
    yield from hands.hover(area, sidebar, hands.field(scene, box.path_from_id("use_own_emissivity")), 0.42)
    yield from hands.press("LEFTMOUSE")
    yield 0.2
    for path, text in (("emissivity", "0.8"), ("reflected_temperature", "280")):
        yield from hands.hover(area, sidebar, hands.field(scene, box.path_from_id(path)), 0.6)
        yield from hands.press("RET")
        yield from hands.press("A", ctrl=True)
        yield from hands.write(text)
        yield from hands.press("RET")
        yield 0.2
    fact("own emissivity", [box.use_own_emissivity, box.emissivity, box.reflected_temperature])
    fact("readings with it", readings())
    screenshot("emissivity")


def move_and_remove():
    """A corner of the box is dragged, which undo takes back; the spot is removed by X."""
    yield from choose("SPOT")
    yield from drag(middle_of(PLACES["BOX"][0]), (-60, -30))
    fact("moved box", infrared().measuring_tools[2].places())
    yield from hands.press("Z", ctrl=True)
    yield 0.3
    fact("box after undo", infrared().measuring_tools[2].places())
    yield from drag(middle_of(PLACES["SPOT"][0]))
    yield from hands.press("X")
    yield 0.3
    fact("kinds after X", [tool.kind for tool in infrared().measuring_tools])
    screenshot("removed")


def work():
    """A generator that yields how many seconds to wait."""
    yield from show_render()
    screenshot("shown")
    yield from drag_span()
    yield from place_tools()
    yield from change_emissivity()
    if SCREENSHOTS:
        yield from export_all(SCREENSHOTS[0])
    yield from move_and_remove()
    fact("end", True)


bpy.context.preferences.view.show_splash = False
tell(work())
