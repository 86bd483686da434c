# SPDX-License-Identifier: GPL-3.0-or-later
"""The spot meter: temperatures under the cursor, in the Image Editor and in a 3D viewport, and at fixed spots."""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy
from bpy.app.handlers import persistent
from bpy.props import FloatVectorProperty, IntProperty
from bpy.types import Operator

from ...heat_settings import PICTURE_EDITORS, redraw_pictures
from ...interface import ENGINE
from ...output.temperature_scale import TemperatureUnit, reading
from ...rendering.last_render import FinishedFrame, finished_frames, finished_layers, forget_last_render
from ...rendering.live_pictures import Picture

HELP = "Spot Meter    LMB in an Image Editor: Place Spot, or Remove the One There    Esc: Leave"
REACH = 8  # pixels: a click so near to a spot means that spot


# What the Image Editor shows ------------------------------------------------------------------------------------------


class ShownLayer(NamedTuple):
    """A finished view layer in an Image Editor, and whether what is seen of it is its Combined pass.

    images: see final_render.layer_images.
    """

    images: dict
    frame: FinishedFrame
    is_combined: bool


def shown_layer(space, scene) -> ShownLayer | None:
    """The finished view layer that an Image Editor shows; None if it shows something else.

    The compositor's picture counts as the first layer, but not as its Combined.
    """
    layers, frames = dict(finished_layers), dict(finished_frames)  # another render may begin meanwhile
    image = space.image
    if not frames or image is None or image.type != "RENDER_RESULT" or scene.render.engine != ENGINE:
        return None
    first = next(iter(frames.values()))
    if first.scene != scene.name or first.slot != image.render_slots.active_index:
        return None
    index = space.image_user.multilayer_layer - first.composited
    name, frame = next((item for i, item in enumerate(frames.items()) if i == max(index, 0)), ("", None))
    if name not in layers:
        return None
    return ShownLayer(layers[name], frame, index >= 0 and space.image_user.multilayer_pass == 0)


def pixel_at(u: float, v: float, size: tuple[int, int], origin: tuple[int, int], shape) -> tuple[int, int] | None:
    """(row, column) of images of a shape (h, w) at shares (u, v) of the render result's width and height.

    size: of the render result in pixels; origin: its pixel that the lower left pixel of the images is. None outside.
    """
    column, row = math.floor(u * size[0]) - origin[0], math.floor(v * size[1]) - origin[1]
    return (row, column) if 0 <= row < shape[0] and 0 <= column < shape[1] else None


def reading_at(shown: ShownLayer, u: float, v: float, unit: TemperatureUnit) -> str | None:
    """The reading of a finished view layer at shares (u, v) of the picture's width and height; None outside."""
    images, frame = shown.images, shown.frame
    pixel = pixel_at(u, v, frame.size, frame.origin, images["temperature"].shape)
    return pixel and reading(float(images["temperature"][pixel]), float(images["noise"][pixel]), unit)


def spot_under(positions, x: int, y: int, view2d) -> int | None:
    """Index of the spot that is drawn nearest to a region's pixel, None if that is farther away than REACH.

    positions: of the spots, shares (u, v) of the picture's width and height.
    """

    def distance(index):
        return math.dist(view2d.view_to_region(*positions[index], clip=False), (x, y))

    return min((i for i in range(len(positions)) if distance(i) <= REACH), key=distance, default=None)


# What a 3D viewport shows ---------------------------------------------------------------------------------------------


def live_reading(picture: Picture, x: int, y: int, unit: TemperatureUnit) -> str | None:
    """The reading of a 3D viewport's picture at a pixel of its region; None outside."""
    pixel = picture.pixel_at(x, y)
    return pixel and reading(float(picture.temperature[pixel]), float(picture.noise[pixel]), unit)


# Operators ------------------------------------------------------------------------------------------------------------


class Cursor:
    """Where the running spot meter's cursor is: the address of the area, and the region's pixel."""

    meter = None  # the running operator
    area, x, y = 0, 0, 0

    @classmethod
    def is_in(cls, area) -> bool:
        """Whether a spot meter runs and its cursor is in this area."""
        return cls.meter is not None and cls.area == area.as_pointer()


def picture_at(area, x: int, y: int):
    """The main region of an area at a pixel of its window, if no other region lies over it there; else None."""
    regions = [region for region in area.regions if _contains(region, x, y)]
    return regions[0] if len(regions) == 1 and regions[0].type == "WINDOW" else None


def _contains(region, x: int, y: int) -> bool:
    inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
    return inside and region.width > 1 and region.height > 1  # a hidden region has the size 1


def editor_under(context, event):
    """(area, main region) of the editor of pictures under the cursor, or (None, None)."""
    for area in context.window.screen.areas:
        if area.type in PICTURE_EDITORS and (region := picture_at(area, event.mouse_x, event.mouse_y)):
            return area, region
    return None, None


class INFRARED_OT_spot_meter(Operator):
    """Show the temperature under the cursor with its standard error. In an Image Editor clicks place fixed spots"""

    bl_idname = "infrared.spot_meter"
    bl_label = "Spot Meter"

    @classmethod
    def poll(cls, context):
        return context.area is not None and context.area.type in PICTURE_EDITORS

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
                redraw_pictures()
            return {"PASS_THROUGH"}
        x, y = event.mouse_x - region.x, event.mouse_y - region.y
        if event.type == "ESC" and event.value == "PRESS":
            stop(context)
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and self.click(context, area, region, x, y):
            return {"RUNNING_MODAL"}
        if area.as_pointer() != Cursor.area:  # and the reading in the one that it comes from goes
            redraw_pictures()
        if (area.as_pointer(), x, y) != (Cursor.area, Cursor.x, Cursor.y):
            Cursor.area, Cursor.x, Cursor.y = area.as_pointer(), x, y
            area.tag_redraw()
        return {"PASS_THROUGH"}

    def click(self, context, area, region, x: int, y: int) -> bool:
        """Remove the spot under the cursor, or place one there; False if no render is there."""
        if area.type != "IMAGE_EDITOR" or not shown_layer(area.spaces.active, context.scene):
            return False
        u, v = region.view2d.region_to_view(x, y)  # of a pixel, this is where Blender takes its colour from
        under = spot_under([spot.position for spot in context.scene.infrared.spots], x, y, region.view2d)
        if under is not None:
            bpy.ops.infrared.spot_remove(index=under)
        elif 0.0 <= u < 1.0 and 0.0 <= v < 1.0:
            bpy.ops.infrared.spot_add(position=(u, v))
        else:
            return True
        bpy.ops.ed.undo_push(message="Spots")  # operators called by an operator push none
        return True

    def cancel(self, context):
        stop(context)


def stop(context) -> None:
    """End the spot meter, if one runs."""
    Cursor.meter, Cursor.area = None, 0
    clear_status(context)
    redraw_pictures()


def clear_status(context) -> None:
    """Take the help out of the status bar. Each workspace has its own, and the window may show another by now."""
    for workspace in bpy.data.workspaces:
        with context.temp_override(workspace=workspace):  # Blender asks the context for it, not the workspace
            workspace.status_text_set(None)


class INFRARED_OT_spot_add(Operator):
    """Place a fixed spot in the picture, at shares of its width and height"""

    bl_idname = "infrared.spot_add"
    bl_label = "Add Spot"
    bl_options = {"REGISTER", "UNDO"}

    position: FloatVectorProperty(name="Position", size=2, min=0.0, max=1.0, default=(0.5, 0.5))

    def execute(self, context):
        context.scene.infrared.spots.add().position = self.position
        redraw_pictures()
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
        redraw_pictures()
        return {"FINISHED"}


@persistent
def forget_render(*_):
    """Another file is open: its render result is empty, and Blender has ended the operators."""
    forget_last_render()
    Cursor.meter, Cursor.area = None, 0


@persistent
def forget_other_render(scene, *_):
    """Another scene is rendered, or this one with another engine: the render result will hold other images."""
    frames = list(finished_frames.values())
    if scene.render.engine != ENGINE or any(frame.scene != scene.name for frame in frames):
        forget_last_render()


CLASSES = (INFRARED_OT_spot_meter, INFRARED_OT_spot_add, INFRARED_OT_spot_remove)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_post.append(forget_render)
    bpy.app.handlers.render_init.append(forget_other_render)


def unregister():
    bpy.app.handlers.render_init.remove(forget_other_render)
    bpy.app.handlers.load_post.remove(forget_render)
    forget_render()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
