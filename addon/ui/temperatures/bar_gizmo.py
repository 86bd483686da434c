# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour bar under the mouse: its ends are dragged for low and high, its middle for both; double click fits."""

from __future__ import annotations

import math
import time

import bpy
from bpy.types import Gizmo, GizmoGroup

from ...heat_settings import redraw_pictures
from ...interface import ENGINE
from ..drawing import LIGHT, draw_rectangles
from .bar import END, bar_of, dragged, part_at

STILL = 4  # pixels that the mouse may move in a click
SLOW = 0.1  # of the mouse's way counts while Ctrl is held


class INFRARED_GT_colour_bar(Gizmo):
    """The bar takes hold of the mouse where it is; what is seen of it is drawn with the picture."""

    bl_idname = "INFRARED_GT_colour_bar"

    last_press = 0.0, (0, 0)  # time (s) and place of the last click on any bar

    def setup(self):
        self.part = None  # of the bar, that is under the mouse or dragged

    def test_select(self, context, location):
        bar = bar_of(context, context.area, context.region)
        part = bar and part_at(bar, *location)
        if part != self.part and not self.is_modal:
            self.part = part
            context.area.tag_redraw()
        return -1 if part is None else 0

    def draw(self, context):
        """A frame around the part that a drag would move."""
        if not (self.is_highlight or self.is_modal) or self.part is None:
            return
        bar = bar_of(context, context.area, context.region)
        if bar is None:
            return
        left, bottom, width, height = bar.bar
        lower, upper = {"LOW": (0.0, END), "HIGH": (1.0 - END, 1.0)}.get(self.part, (END, 1.0 - END))
        low, high = bottom + lower * height, bottom + upper * height
        sides = ((left - 2, low, 2, high - low), (left + width, low, 2, high - low))
        ends = ((left - 2, low - 1, width + 4, 2), (left - 2, high - 1, width + 4, 2))
        draw_rectangles([(*side, LIGHT) for side in sides + ends])

    def invoke(self, context, event):
        place = event.mouse_region_x, event.mouse_region_y
        self.bar = bar_of(context, context.area, context.region)
        self.part = self.bar and part_at(self.bar, *place)
        if self.part is None:
            return {"CANCELLED", "PASS_THROUGH"}
        self.from_y, self.moved, self.infrared = place[1], False, context.scene.infrared
        self.before = self.infrared.range_mode, self.infrared.range_low, self.infrared.range_high
        now, (then, where) = time.monotonic(), INFRARED_GT_colour_bar.last_press
        between = 0.001 * context.preferences.inputs.mouse_double_click_time  # s; simulated events are no double clicks
        self.twice = event.value == "DOUBLE_CLICK" or (now - then < between and math.dist(where, place) <= STILL)
        INFRARED_GT_colour_bar.last_press = (0.0, place) if self.twice else (now, place)
        return {"RUNNING_MODAL"}

    def modal(self, context, event, tweak):
        way = event.mouse_region_y - self.from_y
        if abs(way) < STILL and not self.moved:
            return {"RUNNING_MODAL"}
        self.moved = True
        part = "SPAN" if event.shift and self.part == "MIDDLE" else self.part
        share = way * (SLOW if "PRECISE" in tweak else 1.0) / self.bar.bar[3]
        low, high = dragged(self.bar.scale.low, self.bar.scale.high, part, share)
        self.infrared.range_mode, self.infrared.range_low, self.infrared.range_high = "FIXED", low, high
        redraw_pictures()
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        if cancel:
            self.infrared.range_mode, self.infrared.range_low, self.infrared.range_high = self.before
        elif self.twice and not self.moved:
            self.infrared.range_mode = "AUTOMATIC"
            bpy.ops.ed.undo_push(message="Fit Range")
        elif self.moved:
            bpy.ops.ed.undo_push(message="Drag Color Bar")
        redraw_pictures()


class BarGroup:
    """Base of the groups with the bar's gizmo, one for each kind of editor."""

    bl_label = "Color Bar"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}

    @classmethod
    def poll(cls, context):
        infrared = getattr(context.scene, "infrared", None)
        return infrared is not None and infrared.show_colour_bar and context.scene.render.engine == ENGINE

    @classmethod
    def setup_keymap(cls, keyconfig):
        keymap = keyconfig.keymaps.new(name="Color Bar", space_type="EMPTY", region_type="WINDOW")
        for value in ("PRESS", "DOUBLE_CLICK"):
            keymap.keymap_items.new("gizmogroup.gizmo_tweak", "LEFTMOUSE", value, any=True)
        return keymap

    def setup(self, _context):
        self.gizmos.new(INFRARED_GT_colour_bar.bl_idname)


class INFRARED_GGT_image_bar(BarGroup, GizmoGroup):
    bl_idname = "INFRARED_GGT_image_bar"
    bl_space_type = "IMAGE_EDITOR"


class INFRARED_GGT_view_bar(BarGroup, GizmoGroup):
    bl_idname = "INFRARED_GGT_view_bar"
    bl_space_type = "VIEW_3D"


register, unregister = bpy.utils.register_classes_factory(
    (INFRARED_GT_colour_bar, INFRARED_GGT_image_bar, INFRARED_GGT_view_bar)
)
