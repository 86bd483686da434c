# SPDX-License-Identifier: GPL-3.0-or-later
"""The measuring tools over a picture: outlines, numbers, readings, and marks at the hottest and the coldest pixels."""

from __future__ import annotations

import bpy

from ...heat_settings import scene_unit
from ...measuring.regions import AREAS
from ...output.marks import Mark, is_closed, label_place, outline
from ...output.temperature_scale import reading
from ...rendering.readings import extremes_now, read_tool
from ..drawing import DARK, LIGHT, draw_cross, draw_label, draw_line, draw_rectangles, text_height, text_width
from ..temperatures.seen import Seen
from .outlines import handles

CHOSEN = (1.0, 0.75, 0.25, 1.0)
HOT, COLD = (1.0, 0.25, 0.2, 1.0), (0.3, 0.65, 1.0, 1.0)
NO_VALUE = "not rendered"
SMALL = 45  # heights of the text: in narrower pictures tools have their numbers alone


def draw_tools(seen: Seen, region, scene) -> None:
    """Draw all tools of a scene over its picture in a region, in a POST_PIXEL draw handler."""
    infrared = scene.infrared
    if infrared.show_extremes:
        draw_extremes(seen, extremes_now(seen.picture, infrared), text_height())
    if not infrared.show_measuring_tools:
        return
    for draw in (draw_tool, draw_tool_label):  # no outline crosses out a label
        for index, tool in enumerate(infrared.measuring_tools):
            if len(tool.points):
                draw(seen, region, scene, index, tool)


def draw_tool(seen: Seen, _region, scene, index: int, tool) -> None:
    """The outline of a tool, with handles if it is the chosen one."""
    infrared, text, line = scene.infrared, text_height(), max(1.0, bpy.context.preferences.system.ui_scale)
    colour = CHOSEN if index == infrared.tool_index else LIGHT
    places = [seen.in_region(position) for position in tool.places()]
    corners = outline(tool.kind, places)
    if tool.kind == "SPOT":
        draw_cross(*places[0], text, colour)
    elif len(corners) > 1:
        for width, ink in ((line + 2.5, DARK), (line + 0.5, colour)):  # to be seen on any colour
            draw_line(corners, width, ink, is_closed(tool.kind))
    if colour == CHOSEN and tool.kind != "SPOT":
        half = 0.2 * text
        knobs = [(places[a][0] - half, places[b][1] - half) for a, b in handles(tool.kind, len(places))]
        draw_rectangles([(x - 1.0, y - 1.0, 2 * half + 2.0, 2 * half + 2.0, DARK) for x, y in knobs])
        draw_rectangles([(x, y, 2 * half, 2 * half, CHOSEN) for x, y in knobs])


def draw_tool_label(seen: Seen, region, scene, index: int, tool) -> None:
    """The number of a tool and its reading: of a spot the temperature, of others the mean."""
    infrared, text = scene.infrared, text_height()
    measured = read_tool(tool, seen.picture, infrared)
    if measured and infrared.show_extremes and tool.kind in AREAS:
        draw_extremes(seen, (measured.place_of_minimum, measured.place_of_maximum), text)
    value = measured and reading(measured.mean, measured.error_of_mean, scene_unit(scene))
    own = f"  ε {tool.emissivity:.3g}" if tool.use_own_emissivity else ""
    label = f"{index + 1}:  {value or NO_VALUE}{own}" if seen.frame[2] > SMALL * text else f"{index + 1}"
    left, bottom, width, height = seen.frame
    x, y = max(left, 0.0), max(bottom, 0.0)  # labels stay in what is visible of the picture, off the bar beside it
    visible = min(left + width, region.width) - x, min(bottom + height, region.height) - y
    places = (seen.in_region(position) for position in tool.places())
    mark = Mark(tool.kind, tuple((u - x, v - y) for u, v in places), label)
    place = label_place(mark, 1.6 * text, text_width(label, text) + text, visible)
    draw_label(x + place[0] + 0.5 * text, y + place[1] + 0.5 * text, label, text)


def draw_extremes(seen: Seen, pixels, text: int) -> None:
    """Mark the coldest and the hottest of some pixels (row, column), by triangles that point at them."""
    for pixel, colour, up in zip(pixels, (COLD, HOT), (1.0, -1.0), strict=True):
        x, y = seen.middle_of(pixel)
        size = 0.5 * text
        base = y - up * (size + 2.0)
        corners = [(x, y - up * 2.0), (x - 0.7 * size, base), (x + 0.7 * size, base)]
        for width, ink in ((4.0, DARK), (2.0, colour)):
            draw_line(corners, width, ink, closed=True)
