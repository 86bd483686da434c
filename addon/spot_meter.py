# SPDX-License-Identifier: GPL-3.0-or-later
"""The spot meter: temperatures of the last render under the cursor and at fixed spots of the Image Editor."""

from __future__ import annotations

import math
import sys

import bpy
from bpy.app.handlers import persistent
from bpy.props import FloatVectorProperty, IntProperty
from bpy.types import Operator

from .heat_settings import redraw_image_editors

HELP = "Spot Meter    LMB: Place Spot, or Remove the One There    Esc: Leave"
REACH = 8  # pixels: a click so near to a spot means that spot


# What the Image Editor shows ------------------------------------------------------------------------------------------


def finished():
    """(finished_layers, finished_frames) of final_render; both are empty if nothing was rendered yet."""
    final_render = sys.modules.get(f"{__package__}.final_render")  # loading it would load the solver
    return (final_render.finished_layers, final_render.finished_frames) if final_render else ({}, {})


def shown_layer(space, scene) -> tuple[str, bool] | None:
    """The finished view layer that an Image Editor shows, and whether what is seen is its Combined pass.

    None if it shows something else. The compositor's picture counts as the first layer, but not as its Combined.
    """
    _, frames = finished()
    image = space.image
    if not frames or image is None or image.type != "RENDER_RESULT":
        return None
    first = next(iter(frames.values()))
    if first.scene != scene.name or first.slot != image.render_slots.active_index:
        return None
    index = space.image_user.multilayer_layer - first.composited
    if index < 0:
        return next(iter(frames)), False
    layer = next((name for i, name in enumerate(frames) if i == index), None)
    return None if layer is None else (layer, space.image_user.multilayer_pass == 0)


def pixel_at(u: float, v: float, size: tuple[int, int], origin: tuple[int, int], shape) -> tuple[int, int] | None:
    """(row, column) of images of a shape (h, w) at shares (u, v) of the render result's width and height.

    size: of the render result in pixels; origin: its pixel that the lower left pixel of the images is. None outside.
    """
    column, row = math.floor(u * size[0]) - origin[0], math.floor(v * size[1]) - origin[1]
    return (row, column) if 0 <= row < shape[0] and 0 <= column < shape[1] else None


def reading_at(layer: str, u: float, v: float, unit) -> str | None:
    """The reading of a finished view layer at shares (u, v) of the picture, in a TemperatureUnit; None outside."""
    from .output.temperature_scale import reading

    layers, frames = finished()
    images, frame = layers[layer], frames[layer]
    pixel = pixel_at(u, v, frame.size, frame.origin, images["temperature"].shape)
    return pixel and reading(float(images["temperature"][pixel]), float(images["noise"][pixel]), unit)


def cursor_position(region, x: int, y: int) -> tuple[float, float]:
    """Shares of the picture's width and height in the middle of an Image Editor region's pixel, at any zoom and offset.

    region_to_view alone is up to a pixel off: it maps the first pixel's edge and the last pixel's other edge, between
    which Blender draws, to the first and the last pixel.
    """
    left, bottom = region.view2d.region_to_view(0, 0)
    right, top = region.view2d.region_to_view(region.width - 1, region.height - 1)
    u, v = (x + 0.5) / region.width, (y + 0.5) / region.height
    return left + u * (right - left), bottom + v * (top - bottom)


def spot_under(positions, x: int, y: int, view2d) -> int | None:
    """Index of the spot nearest to a region's pixel as it is seen, if within REACH; positions: shares (u, v)."""

    def distance(index):
        return math.dist(view2d.view_to_region(*positions[index], clip=False), (x, y))

    return min((i for i in range(len(positions)) if distance(i) <= REACH), key=distance, default=None)


# Operators ------------------------------------------------------------------------------------------------------------


class Cursor:
    """Where the running spot meter's cursor is: the area as a pointer, and the region's pixel."""

    meter = None  # the running operator
    area, x, y = 0, 0, 0


def picture_at(area, x: int, y: int):
    """The main region of an area at a pixel of its window, if no other region lies over it there; else None."""
    regions = [region for region in area.regions if _contains(region, x, y)]
    return regions[0] if len(regions) == 1 and regions[0].type == "WINDOW" else None


def _contains(region, x: int, y: int) -> bool:
    inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
    return inside and region.width > 1 and region.height > 1  # a hidden region has the size 1


def editor_under(context, event):
    """(area, main region) of the Image Editor under the cursor, or (None, None)."""
    for area in context.window.screen.areas:
        if area.type == "IMAGE_EDITOR" and (region := picture_at(area, event.mouse_x, event.mouse_y)):
            return area, region
    return None, None


class INFRARED_OT_spot_meter(Operator):
    """Show the temperature of the render under the cursor with its standard error. Clicks place fixed spots"""

    bl_idname = "infrared.spot_meter"
    bl_label = "Spot Meter"

    @classmethod
    def poll(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR"

    def invoke(self, context, _event):
        if Cursor.meter is not None:  # the running one sees it and ends
            stop(context)
            return {"FINISHED"}
        Cursor.meter, Cursor.area = self.as_pointer(), 0
        context.workspace.status_text_set(HELP)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if Cursor.meter != self.as_pointer():
            return {"CANCELLED", "PASS_THROUGH"}
        area, region = editor_under(context, event)
        if area is None:
            if Cursor.area:
                Cursor.area = 0
                redraw_image_editors()
            return {"PASS_THROUGH"}
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if event.type == "ESC" and event.value == "PRESS":
            stop(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and shown_layer(area.spaces.active, context.scene):
            self.click(context, region, x, y)
            return {"RUNNING_MODAL"}
        if (area.as_pointer(), x, y) != (Cursor.area, Cursor.x, Cursor.y):
            Cursor.area, Cursor.x, Cursor.y = area.as_pointer(), x, y
            redraw_image_editors()
        return {"PASS_THROUGH"}

    def click(self, context, region, x: int, y: int) -> None:
        """Remove the spot under the cursor, or place one there."""
        u, v = cursor_position(region, x, y)
        under = spot_under([spot.position for spot in context.scene.infrared.spots], x, y, region.view2d)
        if under is not None:
            bpy.ops.infrared.spot_remove(index=under)
        elif 0.0 <= u < 1.0 and 0.0 <= v < 1.0:
            bpy.ops.infrared.spot_add(position=(u, v))
        else:
            return
        bpy.ops.ed.undo_push(message="Spots")  # operators called by an operator push none

    def cancel(self, context):
        stop(context)


def stop(context) -> None:
    """End the spot meter, if one runs."""
    Cursor.meter, Cursor.area = None, 0
    if context.workspace is not None:
        context.workspace.status_text_set(None)
    redraw_image_editors()


class INFRARED_OT_spot_add(Operator):
    """Place a fixed spot in the picture, at shares of its width and height"""

    bl_idname = "infrared.spot_add"
    bl_label = "Add Spot"
    bl_options = {"REGISTER", "UNDO"}

    position: FloatVectorProperty(name="Position", size=2, min=0.0, max=1.0, default=(0.5, 0.5))

    def execute(self, context):
        context.scene.infrared.spots.add().position = self.position
        redraw_image_editors()
        return {"FINISHED"}


class INFRARED_OT_spot_remove(Operator):
    """Remove a fixed spot"""

    bl_idname = "infrared.spot_remove"
    bl_label = "Remove Spot"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(name="Index", description="Number of the spot from 0; -1 removes all", min=-1, default=-1)

    def execute(self, context):
        spots = context.scene.infrared.spots
        if self.index < 0:
            spots.clear()
        elif self.index < len(spots):
            spots.remove(self.index)
        else:
            self.report({"ERROR"}, f"There is no spot {self.index}")
            return {"CANCELLED"}
        redraw_image_editors()
        return {"FINISHED"}


@persistent
def forget_render(*_):
    """Another file is open: its render result is empty, and Blender has ended the operators."""
    finished()[1].clear()
    Cursor.meter, Cursor.area = None, 0


CLASSES = (INFRARED_OT_spot_meter, INFRARED_OT_spot_add, INFRARED_OT_spot_remove)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_post.append(forget_render)


def unregister():
    bpy.app.handlers.load_post.remove(forget_render)
    Cursor.meter, Cursor.area = None, 0
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
