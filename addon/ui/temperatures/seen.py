# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of this engine that an editor shows, and where it lies in the editor: for all that is drawn over it, and
for clicks on it."""

from __future__ import annotations

from typing import NamedTuple

from ...heat_settings import read_scale
from ...output.temperature_scale import TemperatureScale
from ...rendering.live_pictures import picture_in
from ...rendering.readings import MeasuredPicture, fitted, temperature_now
from . import spot_meter

HALF = 0.5  # pixels: Blender takes a pixel's colour from where its lower left corner is in the picture
SHIFT = 0.01  # pixels by which Blender moves all that is drawn over a region, to the right and up

Place = tuple[float, float, float, float]  # left, bottom, width and height in a region, pixels


class Seen(NamedTuple):
    """A picture in an editor. images, frame: where its images lie, and the whole picture that tools are placed in.
    in_colours: what is seen are its temperatures, in colours. told: a line of text over them tells of the render.
    """

    picture: MeasuredPicture
    images: Place
    frame: Place
    in_colours: bool
    told: bool = False

    def scale(self, infrared) -> TemperatureScale:
        """The scale of its colours, whose ends are known."""
        return fitted(read_scale(infrared), temperature_now(self.picture, infrared))

    def in_region(self, position) -> tuple[float, float]:
        """A place (u, v) of a tool in the region, pixels."""
        left, bottom, width, height = self.frame
        return left + position[0] * width, bottom + position[1] * height

    def in_picture(self, x: float, y: float) -> tuple[float, float]:
        """Where the middle of a region's pixel is in the picture: (u, v), shares of its width and height."""
        left, bottom, width, height = self.frame
        return (x + HALF - left) / width, (y + HALF - bottom) / height

    def middle_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """The middle of a pixel (row, column) of the images in the region, pixels."""
        left, bottom, width, height = self.images
        rows, columns = self.picture.temperature.shape
        return left + (pixel[1] + 0.5) * width / columns, bottom + (pixel[0] + 0.5) * height / rows


def seen_in(area, region, scene) -> Seen | None:
    """What the main region of an area shows of this engine; None if it is something else."""
    if area.type == "IMAGE_EDITOR":
        return _in_image_editor(area.spaces.active, region, scene)
    return _in_viewport(area.spaces.active, region)


def _in_image_editor(space, region, scene) -> Seen | None:
    shown = spot_meter.shown_layer(space, scene)
    if shown is None:
        return None
    frame, picture = _picture_place(region), shown.picture
    width, height = (size / pixels for size, pixels in zip(frame[2:], picture.window.size, strict=True))  # of a pixel
    rows, columns = picture.window.shape
    left, bottom = frame[0] + picture.window.origin[0] * width, frame[1] + picture.window.origin[1] * height
    both_eyes = bool(shown.frame.view) and space.show_stereo_3d  # Blender does not tell which of them it draws
    in_colours = shown.is_combined and not both_eyes and space.display_channels in ("COLOR", "COLOR_ALPHA")
    return Seen(picture, (left, bottom, columns * width, rows * height), frame, in_colours, shown.frame.told)


def _picture_place(region) -> Place:
    """Where an Image Editor draws its picture. Blender itself rounds places in the region to whole pixels."""
    view = region.view2d
    (u0, v0), (u1, v1) = view.region_to_view(0, 0), view.region_to_view(region.width, region.height)
    width, height = region.width / (u1 - u0), region.height / (v1 - v0)
    return HALF - SHIFT - u0 * width, HALF - SHIFT - v0 * height, width, height


def _in_viewport(space, region) -> Seen | None:
    picture = picture_in(region)
    if picture is None or space.shading.type != "RENDERED":
        return None
    return Seen(picture.measured, picture.place, picture.frame or picture.place, True)
