# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's images as arrays, of one channel or of temperatures."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ..solver.scene import EXTENSIONS, SceneError, check_temperature
from .custom_properties import describe
from .temperature_fields import TemperatureError, pick_channel
from .warnings import Warnings

INTERPOLATIONS = "Linear", "Closest"
# What of an image of shares counts: its first channel or its last, or what either is short of 1
CHANNELS = "Color", "Alpha", "Inverted Color", "Inverted Alpha"
UNALTERED = {"Non-Color", "Raw", "Linear Rec.709"}  # color spaces whose float pixels Blender keeps as they are


def image_channel(image, channel: str) -> np.ndarray:
    """(h, w) float32 values of one channel of an image as its file has them, 0..1 if they are integers.

    Row 0 is at the bottom. Raises TemperatureError, naming the image, if its values cannot be had.
    """
    owner = f"Image '{image.name}'"
    if image.source not in ("FILE", "GENERATED"):
        raise TemperatureError(f"{owner}: {image.source.lower()} images cannot be read, use a single image")
    if not image.has_data and not image.size[0]:  # has_data is False until an image on disk is first used
        raise TemperatureError(f"{owner} has no pixels: '{image.filepath}'")
    if image.is_float and image.colorspace_settings.name not in UNALTERED:
        space = image.colorspace_settings.name
        raise TemperatureError(f"{owner}: its color space {space} alters the file's values, set it to Non-Color")
    width, height = image.size
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pick_channel(pixels.reshape(-1, image.channels), channel).reshape(height, width)


def image_shares(image, channel: str) -> np.ndarray:
    """(h, w) float32 values of what counts of an image, one of CHANNELS; see image_channel."""
    values = image_channel(image, "A" if channel.endswith("Alpha") else "R")
    return 1.0 - values if channel.startswith("Inverted") else values


def image_stamp(image) -> tuple | None:
    """What changes when the values of an image do; None if it was painted on and not saved, when nothing tells."""
    if image.is_dirty:
        return None
    try:
        about = Path(bpy.path.abspath(image.filepath, library=image.library)).stat()
    except OSError:  # none, or packed
        about = None
    made = image.generated_type, tuple(image.generated_color), image.is_float, tuple(image.size)
    stored = image.source, image.filepath, image.alpha_mode, image.colorspace_settings.name
    return *made, *stored, about and (about.st_mtime_ns, about.st_size)


def read_kelvin(image, id_block, owner: str) -> np.ndarray:
    """(height, width) float32 K as kelvin_pixels reads them. Raises SceneError, naming owner and image, if it holds no
    temperatures or cannot be read."""
    try:
        return kelvin_pixels(image, id_block, owner)
    except TemperatureError as error:
        raise SceneError(f"{owner}: {error}") from None


def kelvin_pixels(image, id_block, owner: str) -> np.ndarray:
    """(height, width) float32 K of the first channel of an image, row 0 at the bottom.

    Float images hold kelvin; with id_block["temperature_range"] = [low, high] K, values from 0 to 1 of any image mean
    what lies between. Raises SceneError, naming owner and image, if it holds no temperatures, and TemperatureError,
    naming the image, if its values cannot be had.
    """
    check_image(image, owner)
    span = temperature_range(id_block, owner)
    values = image_channel(image, "R")
    if span is None and not image.is_float:
        raise SceneError(
            f"{owner}: Image '{image.name}' has 8 bits and holds no kelvin; set temperature_range to what 0 and 1 mean"
        )
    if span is None and 0.0 < values.max() <= 1.0:  # Blender says of 16 bits that they are floating point, too
        raise SceneError(
            f"{owner}: Image '{image.name}' has values from {values.min():.4g} to {values.max():.4g}, which are no "
            "kelvin; set temperature_range to what 0 and 1 mean"
        )
    kelvin = values if span is None else (span[0] + (span[1] - span[0]) * values).astype(np.float32)
    for value in (kelvin.min(), kelvin.max()):  # NaN is both
        check_temperature(float(value), f"{owner}: Image '{image.name}'")
    return kelvin


def read_lookup(id_block, kind: str, warnings: Warnings) -> tuple[str, bool]:
    """How the image of a kind, "temperature" or "mix", of an object or material is looked up: what is outside it, one
    of EXTENSIONS, and whether its texels are constant, see Texture. Warns of what is no such choice."""
    extension = read_choice(id_block, f"{kind}_extension", EXTENSIONS, warnings)
    return extension, read_choice(id_block, f"{kind}_interpolation", INTERPOLATIONS, warnings) == "Closest"


def read_choice(id_block, key: str, choices: tuple[str, ...], warnings: Warnings) -> str:
    """The choice that a custom property makes, in capitals or not; the first, and a warning, if it makes none."""
    value = id_block.get(key)
    named = [choice for choice in choices if isinstance(value, str) and value.casefold() == choice.casefold()]
    if value is not None and not named:
        *first, last = choices
        expected = f"expected {', '.join(first)} or {last}; {choices[0]} counts"
        warnings.add(id_block.name, f"{key} is {describe(value)}, {expected}")
    return named[0] if named else choices[0]


def check_image(value, owner: str) -> None:
    """Raise SceneError unless the value of the custom property `temperature_image` is an image."""
    if not is_image(value):
        raise SceneError(f"{owner}: temperature_image is {describe(value)}, expected an image")


def is_image(value) -> bool:
    """Whether the value of a custom property is an image."""
    return getattr(value, "id_type", "") == "IMAGE"


def temperature_range(id_block, owner: str) -> tuple[float, float] | None:
    """The kelvin that 0 and 1 of an image mean, if they are set. Raises SceneError if they are no two numbers."""
    value = id_block.get("temperature_range")
    if value is None:
        return None
    if getattr(value, "typecode", None) not in ("i", "f", "d") or len(value) != 2:
        raise SceneError(f"{owner}: temperature_range is {describe(value)}, expected the kelvin that 0 and 1 mean")
    return float(value[0]), float(value[1])
