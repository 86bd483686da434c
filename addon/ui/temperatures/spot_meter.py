# SPDX-License-Identifier: GPL-3.0-or-later
"""The spot meter: temperatures under the cursor, in the Image Editor and in a 3D viewport."""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy
from bpy.app.handlers import persistent
from bpy.types import Operator

from ...heat_settings import PICTURE_EDITORS, redraw_pictures
from ...interface import ENGINE
from ...output.temperature_scale import TemperatureUnit, reading
from ...rendering.last_render import FinishedFrame, finished_frames, finished_layers, forget_last_render
from ...rendering.live_pictures import Picture
from ...rendering.readings import MeasuredPicture, camera_picture, finished_picture, pixel_now
from ...rendering.render_passes import CAMERA_TEMPERATURE

HELP = "Spot Meter    Esc: Leave"


# What the Image Editor shows ------------------------------------------------------------------------------------------


class ShownLayer(NamedTuple):
    """A finished view layer in an Image Editor, and whether what is seen of it is its Combined pass, or its Camera
    Temperature.

    images: see final_render.layer_images.
    """

    images: dict
    frame: FinishedFrame
    is_combined: bool
    is_camera: bool = False

    @property
    def picture(self) -> MeasuredPicture:
        """The layer for measuring tools."""
        return (camera_picture if self.is_camera else finished_picture)(self.images, self.frame)


def shown_layer(space, scene) -> ShownLayer | None:
    """The finished view layer, and with stereoscopy its view, that an Image Editor shows; None if it shows something
    else.

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
    names = list(dict.fromkeys(frame.layer for frame in frames.values()))[max(index, 0) :]
    views = [name for name, frame in frames.items() if frame.layer in names[:1]][space.image_user.multilayer_view :]
    if not views or views[0] not in layers:
        return None
    images, frame, shown = layers[views[0]], frames[views[0]], space.image_user.multilayer_pass
    return ShownLayer(images, frame, index >= 0 and shown == 0, index >= 0 and shown == camera_pass(images))


def camera_pass(images: dict) -> int | None:
    """The number of the pass Camera Temperature of a finished view layer, as `render_passes` lists them; None without
    one. images: see final_render.layer_images."""
    further = list(images["further"])
    usual = 1 + len(images["bands"]) + 3  # Combined, the bands, Radiance, Temperature and Noise
    return usual + further.index(CAMERA_TEMPERATURE) if CAMERA_TEMPERATURE in further else None


def pixel_at(u: float, v: float, size, origin, shape: tuple[int, int]) -> tuple[int, int] | None:
    """(row, column) of images of a shape (h, w) at shares (u, v) of the render result's width and height.

    size, origin: of the render result and of the images in it, see measuring.regions.Window. None outside.
    """
    column, row = math.floor(u * size[0] - origin[0]), math.floor(v * size[1] - origin[1])
    return (row, column) if 0 <= row < shape[0] and 0 <= column < shape[1] else None


def reading_at(picture: MeasuredPicture, infrared, u: float, v: float, unit: TemperatureUnit) -> str | None:
    """The reading of a picture at shares (u, v) of its width and height, with the correction of now; None outside."""
    size, origin, shape = picture.window
    pixel = pixel_at(u, v, size, origin, shape)
    return pixel and reading(*pixel_now(picture, infrared, pixel), unit)


# What a 3D viewport shows ---------------------------------------------------------------------------------------------


def live_reading(picture: Picture, infrared, x: int, y: int, unit: TemperatureUnit) -> str | None:
    """The reading of a 3D viewport's picture at a pixel of its region, with the correction of now; None outside."""
    pixel = picture.pixel_at(x, y)
    return pixel and reading(*pixel_now(picture.measured, infrared, pixel), unit)


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
    """Show the temperature under the cursor with its standard error"""

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
        if area.as_pointer() != Cursor.area:  # and the reading in the one that it comes from goes
            redraw_pictures()
        if (area.as_pointer(), x, y) != (Cursor.area, Cursor.x, Cursor.y):
            Cursor.area, Cursor.x, Cursor.y = area.as_pointer(), x, y
            area.tag_redraw()
        return {"PASS_THROUGH"}

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


CLASSES = (INFRARED_OT_spot_meter,)


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
