# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures in the colours of a scale, as Blender takes pictures."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Color

from ..output.temperature_scale import TemperatureScale

DEFAULT_SCALE = TemperatureScale()
REC709 = np.eye(3, dtype=np.float32)


def thermal_picture(
    temperature: np.ndarray, scale: TemperatureScale = DEFAULT_SCALE, primaries: np.ndarray = REC709
) -> np.ndarray:
    """Temperatures (height, width), K, in the colours of a scale: (height, width, 4) float32, alpha 1.

    The colours are linear. primaries: (3, 3), each row a primary of Rec.709 in the space that they are wanted in.
    """
    picture = np.ones((*temperature.shape, 4), dtype=np.float32)
    picture[..., :3] = scale.colours(temperature) @ primaries
    return picture


def cut_out(picture: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """A picture (h, w, 4) of which alpha (h, w), 0..1, is left; colours are multiplied by it, as Blender keeps them."""
    return picture * alpha[..., None]


def working_primaries() -> np.ndarray:
    """(3, 3) float32: the primaries of Rec.709 in the working space of the open file. On Blender's thread only."""
    primaries = [Color(primary).from_rec709_linear_to_scene_linear() for primary in np.eye(3)]
    return np.round(primaries, 4).astype(np.float32)  # Blender rounds alike: Rec.709 in Rec.709 is not quite itself


_OURS = "infrared_picture"  # custom property of images that keep_picture makes: those of the user stay as they are


def keep_picture(name: str, picture: np.ndarray):
    """Keep a picture (h, w, 4) as an image of this name, which Blender's editors can show; returns the image. One that
    was made so before is replaced."""
    height, width, _ = picture.shape
    shown = next((image for image in bpy.data.images if image.get(_OURS) == name), None)
    if shown is not None and tuple(shown.size) != (width, height):
        bpy.data.images.remove(shown)
        shown = None
    if shown is None:
        shown = bpy.data.images.new(name, width, height, float_buffer=True)
        shown[_OURS] = name
    shown.pixels.foreach_set(np.ascontiguousarray(picture, np.float32).ravel())
    shown.update()
    return shown
