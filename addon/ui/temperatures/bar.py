# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour bar beside a picture: where it finds room, how it is drawn, and which part of it a click means."""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy

from ...heat_settings import scene_unit
from ...output.colour_bar import BACKGROUND, INK, ColourBar
from ...output.palette import display
from ..drawing import as_on_screen, draw_rectangles, draw_text, text_height
from .seen import Seen, seen_in

GAP = 12  # pixels at a scale of 1: between the bar and the edges of its region
HEADER = 30  # pixels at a scale of 1: what a header, and a render's information, takes at the top
GIZMOS = 230  # pixels at a scale of 1: what a 3D viewport's gizmos take below its header, at the right
MOST_HEIGHT = 420  # pixels at a scale of 1, of the bar's panel
LEAST_LINES = 7  # height of the smallest bar, in heights of its text
LEAST_SPAN = 0.01  # K, to which a bar can be dragged
END = 0.15  # share of the bar, at each end, that is dragged for this end


class Margins(NamedTuple):
    """Pixels of a region that the regions over its edges take."""

    left: int
    right: int
    top: int
    bottom: int


def margins(area) -> Margins:
    """What the other regions of an area take of its main region, where Blender lets them lie over it."""
    taken = {"LEFT": 0, "RIGHT": 0, "TOP": 0, "BOTTOM": 0}
    if bpy.context.preferences.system.use_region_overlap:
        for region in area.regions:
            if region.type != "WINDOW" and region.alignment in taken and min(region.width, region.height) > 1:
                wide = region.alignment in ("LEFT", "RIGHT")
                taken[region.alignment] += region.width if wide else region.height
    return Margins(*taken.values())


def dock(size: tuple[int, int], taken: Margins, images, wanted: tuple[int, int, int], gizmos: int = 0):
    """Where a bar goes: (left, bottom, height) in a region of this size (width, height), or None without room for it.

    Beside the picture if there is room, at its right before its left, as near to it as can be; else below or above it,
    where there is more room; else at the right edge of the region. images: left, bottom, width and height of the
    picture. wanted: width of the bar, its least and its most height. gizmos: pixels below the top margin that are taken
    at the right edge.
    """
    width, least, most = wanted
    first, last = taken.left, size[0] - taken.right  # what is free, from left to right
    low, high = taken.bottom, size[1] - taken.top
    if last - first < width:
        return None
    right, left = max(math.ceil(images[0] + images[2]), first), min(math.floor(images[0]), last) - width
    beside = right + width <= last or left >= first
    x = right if right + width <= last else left if left >= first else last - width
    if x + width > last - gizmos:
        high -= gizmos
    if not beside:
        below, above = (low, min(math.floor(images[1]), high)), (max(math.ceil(images[1] + images[3]), low), high)
        larger = max(below, above, key=lambda part: part[1] - part[0])
        low, high = larger if larger[1] - larger[0] >= least else (low, high)
    height = min(high - low, most)
    if height < least:
        return None
    bottom = round(min(max(images[1], low), high - height))  # beside the lower part of the picture
    return x, bottom, height


def colour_bar_in(area, region, scene, seen: Seen) -> ColourBar | None:
    """The bar beside a picture in an area's main region; None if there is no room for it.

    It is in the region's pixels and the scene's unit.
    """
    ui = bpy.context.preferences.system.ui_scale
    text, gap = text_height(), round(GAP * ui)
    taken = margins(area)
    top = taken.top or (round(HEADER * ui) if area.type == "IMAGE_EDITOR" else 0)
    taken = Margins(taken.left + gap // 2, taken.right + gap // 2, top + gap, taken.bottom + gap)
    gizmos = round(GIZMOS * ui) if area.type == "VIEW_3D" and area.spaces.active.show_gizmo else 0
    while text >= 8:
        wanted = ColourBar.panel_width(text), LEAST_LINES * text, round(MOST_HEIGHT * ui)
        beside = seen.images if area.type == "IMAGE_EDITOR" else seen.frame
        place = dock((region.width, region.height), taken, beside, wanted, gizmos)
        if place is not None:
            return ColourBar(seen.scale(scene.infrared), scene_unit(scene), *place, text)
        text -= 1  # a small window has small figures
    return None


def draw_colour_bar(bar: ColourBar, line: float) -> None:
    """Draw a bar into the region that is being drawn, in a POST_PIXEL draw handler. line: width of its ticks, pixels.

    What the bar lies over does not shine through.
    """
    left, low, across, up = bar.bar
    rectangles = [(bar.left, bar.bottom, bar.panel_width(bar.text), bar.height, (*BACKGROUND, 1.0))]
    rows = as_on_screen(display(bar.colours()) / 255.0).tolist()
    rectangles += [(left, low + row, across, 1, (*colour, 1.0)) for row, colour in enumerate(rows)]
    rectangles += [(start, y, end - start, line, (*INK, 1.0)) for start, end, y in bar.ticks()]
    draw_rectangles(rectangles)
    for x, y, label in bar.labels():
        draw_text(x, y, label, bar.text)


def part_at(bar: ColourBar, x: float, y: float) -> str | None:
    """Which part of a bar is at a place of its region: LOW and HIGH are its ends, MIDDLE is between; None is beside."""
    left, bottom, _, height = bar.bar
    if not (left <= x < bar.left + bar.panel_width(bar.text) and bottom - bar.text <= y <= bottom + height + bar.text):
        return None
    share = (y - bottom) / height
    return "LOW" if share < END else "HIGH" if share > 1.0 - END else "MIDDLE"


def dragged(low: float, high: float, part: str, share: float) -> tuple[float, float]:
    """The range (low, high), K, after a part of the bar was dragged upwards by a share of the bar's height.

    An end follows by as many kelvin as that share of the bar stood for. MIDDLE moves both, SPAN moves them apart.
    """
    span = high - low
    if part == "LOW":
        return min(max(0.0, low + share * span), high - LEAST_SPAN), high
    if part == "HIGH":
        return low, max(high + share * span, low + LEAST_SPAN)
    if part == "MIDDLE":
        shift = max(share * span, -low)
        return low + shift, high + shift
    apart = max(0.5 * (2.0 ** (2.0 * share) - 1.0) * span, 0.5 * (LEAST_SPAN - span))
    return max(0.0, low - apart), high + apart


def bar_of(context, area, region) -> ColourBar | None:
    """The bar that is shown in an area's main region, or None."""
    scene = context.scene
    if not (scene.infrared.show_colour_bar and area.spaces.active.overlay.show_overlays):
        return None
    seen = seen_in(area, region, scene)
    return colour_bar_in(area, region, scene, seen) if seen is not None and seen.in_colours else None
