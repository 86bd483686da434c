# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on measuring tools: draw and move them by mouse in the picture, add them by script, remove them."""

from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty
from bpy.types import Operator

from ...heat_settings import fix_range, redraw_pictures
from ...measure_settings import KIND_ITEMS, InfraredToolPoint, add_tool
from ...measuring.regions import FEWEST_POINTS, region_of
from ...rendering.readings import read_tool, temperature_now
from ..temperatures.seen import Seen, seen_in
from ..temperatures.spot_meter import picture_at
from .outlines import REACH, Hit, hit

LEAST_DRAG = 3  # pixels: a tool that is drawn shorter than this was a click
NEIGHBOURHOOD = 0.05  # share of the picture's larger side around a click, whose range it takes


def main_region(area):
    """The region of an area in which the picture lies."""
    return next(region for region in area.regions if region.type == "WINDOW")


def seen_here(context) -> Seen | None:
    """The picture of this engine in the context's editor."""
    area = context.area
    if area is None or area.type not in ("IMAGE_EDITOR", "VIEW_3D"):
        return None
    return seen_in(area, main_region(area), context.scene)


def hit_at(seen: Seen, infrared, x: float, y: float) -> Hit | None:
    """Which tool a click at a place of the region means."""
    if not infrared.show_measuring_tools:
        return None
    tools = [(tool.kind, [seen.in_region(place) for place in tool.places()]) for tool in infrared.measuring_tools]
    return hit(tools, (x, y), REACH * bpy.context.preferences.system.ui_scale, infrared.tool_index)


def within(u: float, v: float) -> tuple[float, float]:
    """The place in the picture that is nearest to (u, v)."""
    return min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)


class INFRARED_OT_tool_draw(Operator):
    """Draw a measuring tool in the picture. Near a tool that is there: choose it, and move it or one of its points"""

    bl_idname = "infrared.tool_draw"
    bl_label = "Draw Measuring Tool"
    bl_options = {"UNDO"}

    kind: EnumProperty(name="Kind", description="What is drawn", items=KIND_ITEMS)

    @classmethod
    def poll(cls, context):
        return seen_here(context) is not None

    def invoke(self, context, event):
        seen, region = seen_here(context), main_region(context.area)
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        infrared = context.scene.infrared
        found, (u, v) = hit_at(seen, infrared, x, y), seen.in_picture(x, y)
        self.region, self.start, self.moved = region, (x, y), False
        self.created = found is None
        if found is None:
            if not (0.0 <= u < 1.0 and 0.0 <= v < 1.0):
                return {"PASS_THROUGH"}
            add_tool(infrared, self.kind, [(u, v)] * min(2, FEWEST_POINTS[self.kind]))
            last = len(infrared.measuring_tools[-1].points) - 1
            self.handle = last, last
        else:
            infrared.tool_index, self.handle = found.tool, found.handle
        self.index = infrared.tool_index
        self.before = self.tool(context).places()
        context.window_manager.modal_handler_add(self)
        redraw_pictures()
        return {"RUNNING_MODAL"}

    def tool(self, context):
        """The tool that is drawn or moved."""
        return context.scene.infrared.measuring_tools[self.index]

    def modal(self, context, event):
        seen = seen_here(context)
        if seen is None or self.index >= len(context.scene.infrared.measuring_tools):
            return {"CANCELLED"}
        x, y = event.mouse_x - self.region.x, event.mouse_y - self.region.y
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self.give_up(context)
        if event.type == "MOUSEMOVE":
            self.follow(context, seen, x, y)
        elif self.created and self.kind == "POLYGON":
            return self.add_corner(context, seen, event, x, y)
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self.end(context)
        return {"RUNNING_MODAL"}

    def follow(self, context, seen: Seen, x: float, y: float) -> None:
        """Bring to the mouse what is drawn or moved."""
        self.moved = self.moved or math.dist((x, y), self.start) >= LEAST_DRAG
        if not self.moved and self.kind != "SPOT":
            return
        points = self.tool(context).points
        (u0, v0), (u, v) = seen.in_picture(*self.start), seen.in_picture(x, y)
        if self.handle is None:  # all of it, as far as the picture lets it
            us, vs = zip(*self.before, strict=True)
            du, dv = (
                min(max(now - then, -min(all_)), 1.0 - max(all_)) for now, then, all_ in ((u, u0, us), (v, v0, vs))
            )
            for point, place in zip(points, self.before, strict=True):
                point.position = place[0] + du, place[1] + dv
        else:
            for axis, index in enumerate(self.handle):
                points[index].position[axis] = within(u, v)[axis]
            redraw_pictures()

    def add_corner(self, context, seen: Seen, event, x: float, y: float):
        """What keys and buttons do while a polygon is drawn."""
        points = self.tool(context).points
        ends = event.type in ("RET", "NUMPAD_ENTER") and event.value == "PRESS"
        if event.type == "LEFTMOUSE" and event.value in ("PRESS", "DOUBLE_CLICK"):
            first, last = (seen.in_region(points[i].position) for i in (0, max(0, len(points) - 2)))
            ends = event.value == "DOUBLE_CLICK" or min(math.dist(first, (x, y)), math.dist(last, (x, y))) < REACH
            if not ends:
                points.add().position = within(*seen.in_picture(x, y))
                self.handle = len(points) - 1, len(points) - 1
        elif event.type == "BACK_SPACE" and event.value == "PRESS" and len(points) > 2:
            points.remove(len(points) - 2)
            self.handle = len(points) - 1, len(points) - 1
        if ends:
            points.remove(len(points) - 1)  # the one that follows the mouse
            return self.end(context)
        redraw_pictures()
        return {"RUNNING_MODAL"}

    def end(self, context):
        """What was drawn or moved stays, if it is a tool."""
        tool = self.tool(context)
        unfinished = len(tool.points) < FEWEST_POINTS[tool.kind]
        if self.created and (unfinished or not self.moved and self.kind in ("LINE", "BOX", "ELLIPSE")):
            return self.give_up(context)
        redraw_pictures()
        return {"FINISHED"}  # a tool may only have been chosen, which undo takes back, too

    def give_up(self, context):
        """All is as it was."""
        tool = self.tool(context)
        if self.created:
            remove_tool(context.scene.infrared, self.index)
        else:
            for point, place in zip(tool.points, self.before, strict=True):
                point.position = place
        redraw_pictures()
        return {"CANCELLED"}


def remove_tool(infrared, index: int) -> None:
    """Remove a tool of scene.infrared; the chosen one stays chosen, or the one behind it is."""
    infrared.measuring_tools.remove(index)
    chosen = infrared.tool_index - (infrared.tool_index > index)
    infrared.tool_index = max(0, min(chosen, len(infrared.measuring_tools) - 1))


class INFRARED_OT_tool_add(Operator):
    """Add a measuring tool at places in the picture, shares of its width and height from the lower left corner"""

    bl_idname = "infrared.tool_add"
    bl_label = "Add Measuring Tool"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    kind: EnumProperty(name="Kind", description="What the tool measures", items=KIND_ITEMS)
    points: CollectionProperty(name="Points", description="Places in the picture", type=InfraredToolPoint)

    def execute(self, context):
        if len(self.points) < FEWEST_POINTS[self.kind]:
            self.report({"ERROR"}, f"A {self.kind.lower()} needs {FEWEST_POINTS[self.kind]} points")
            return {"CANCELLED"}
        add_tool(context.scene.infrared, self.kind, [tuple(point.position) for point in self.points])
        redraw_pictures()
        return {"FINISHED"}


class INFRARED_OT_tool_remove(Operator):
    """Remove the chosen measuring tool"""

    bl_idname = "infrared.tool_remove"
    bl_label = "Remove Measuring Tool"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(name="Index", description="Number of the tool from 0; -1 is the chosen one", min=-1, default=-1)
    all: BoolProperty(name="All", description="Remove all tools", default=False)

    @classmethod
    def poll(cls, context):
        return bool(context.scene.infrared.measuring_tools)

    def execute(self, context):
        infrared = context.scene.infrared
        index = infrared.tool_index if self.index < 0 else self.index
        if self.all:
            infrared.measuring_tools.clear()
            infrared.tool_index = 0
        elif index < len(infrared.measuring_tools):
            remove_tool(infrared, index)
        else:
            self.report({"ERROR"}, f"There is no measuring tool {index}")
            return {"CANCELLED"}
        redraw_pictures()
        return {"FINISHED"}


class INFRARED_OT_range_from_tool(Operator):
    """Fix the range at the coldest and the hottest temperature of the chosen measuring tool"""

    bl_idname = "infrared.range_from_tool"
    bl_label = "Range from Tool"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return bool(context.scene.infrared.measuring_tools) and seen_here(context) is not None

    def execute(self, context):
        infrared = context.scene.infrared
        measured = read_tool(infrared.measuring_tools[infrared.tool_index], seen_here(context).picture, infrared)
        if measured is None:
            self.report({"ERROR"}, "The tool has no pixel in the picture")
            return {"CANCELLED"}
        fix_range(infrared, measured.minimum, measured.maximum)
        return {"FINISHED"}


class INFRARED_OT_range_from_region(Operator):
    """Fix the range at the coldest and the hottest temperature of a rectangle that is dragged in the picture, or around
    a click"""

    bl_idname = "infrared.range_from_region"
    bl_label = "Range from Region"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        return seen_here(context) is not None

    def invoke(self, context, _event):
        self.area, self.start = context.area, None
        context.workspace.status_text_set("Range from Region    LMB: Drag a Rectangle, or Click    Esc: Leave")
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        region = main_region(self.area)
        seen = seen_in(self.area, region, context.scene)
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if seen is None or event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            return self.leave(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE":
            return {"RUNNING_MODAL"}
        if event.value in ("PRESS", "DOUBLE_CLICK"):
            if picture_at(self.area, event.mouse_x, event.mouse_y) is None:
                return self.leave(context, {"CANCELLED"})
            self.start = x, y
        elif self.start is not None:
            return self.leave(context, self.take(context, seen, (x, y)))
        return {"RUNNING_MODAL"}

    def take(self, context, seen: Seen, end) -> set[str]:
        """Take the range of what was dragged or clicked on."""
        from_, to = (seen.in_picture(*place) for place in (self.start, end))
        if math.dist(self.start, end) < LEAST_DRAG:
            half = 0.5 * NEIGHBOURHOOD * max(seen.frame[2:])
            corners = [(self.start[0] + sign * half, self.start[1] + sign * half) for sign in (-1.0, 1.0)]
            from_, to = (seen.in_picture(*corner) for corner in corners)
        ends = range_within(seen, context.scene.infrared, from_, to)
        if ends is None:
            self.report({"WARNING"}, "No pixel of the picture is there")
            return {"CANCELLED"}
        fix_range(context.scene.infrared, *ends)
        return {"FINISHED"}

    def leave(self, context, result: set[str]) -> set[str]:
        """Put back cursor and status bar."""
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        redraw_pictures()
        return result


def range_within(seen: Seen, infrared, corner, opposite) -> tuple[float, float] | None:
    """(low, high), K, of a rectangle between two places (u, v) of the picture; None if no pixel is there."""
    values = region_of("BOX", (corner, opposite), seen.picture.window).values(temperature_now(seen.picture, infrared))
    return (float(values.min()), float(values.max())) if values.size else None


CLASSES = (
    INFRARED_OT_tool_draw,
    INFRARED_OT_tool_add,
    INFRARED_OT_tool_remove,
    INFRARED_OT_range_from_tool,
    INFRARED_OT_range_from_region,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
