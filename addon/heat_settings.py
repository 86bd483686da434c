# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings in scene.infrared and in a scene that say how temperatures are shown: palette, range, unit, view."""

from __future__ import annotations

from functools import partial

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatVectorProperty

from .interface import redraw, temperature_property
from .output.palette import spread
from .output.temperature_scale import KELVIN, UNITS, Isotherm, TemperatureScale, TemperatureUnit

PICTURE_EDITORS = ("IMAGE_EDITOR", "VIEW_3D")  # types of the areas that show pictures of this engine


def redraw_pictures(_owner=None, _context=None) -> None:
    """Draw the editors of pictures again, with what lies over them. Settings may name this as their update function."""
    for kind in PICTURE_EDITORS:
        redraw(kind)


scale_temperature = partial(temperature_property, min=0.0, soft_max=2_000.0, step=100, update=redraw_pictures)


class InfraredSpot(bpy.types.PropertyGroup):
    """A fixed spot in files of earlier versions, see measure_settings.convert_spots."""

    position: FloatVectorProperty(
        name="Position",
        description="Place in the picture, as shares of its width and height from the lower left corner",
        size=2,
        min=0.0,
        max=1.0,
    )


class HeatDisplaySettings:
    """Base of InfraredSettings: palette, range, isotherm, color bar and spots."""

    palette: EnumProperty(
        name="Palette",
        description="Colors of the temperatures in Combined, and in exported pictures",
        items=(
            ("IRON", "Iron", "Black, violet, red, yellow, white: equal steps look equally bright", 0),
            ("RAINBOW", "Rainbow", "Blue, green, yellow, red: strong contrast, but brightness does not follow heat", 1),
            ("WHITE_HOT", "White Hot", "Greys, hot is white", 2),
            ("BLACK_HOT", "Black Hot", "Greys, hot is black", 3),
            ("VIRIDIS", "Viridis", "Violet, green, yellow: equal steps look equally large", 4),
            ("INFERNO", "Inferno", "Black, violet, orange, pale yellow: equal steps look equally large", 5),
        ),
        default="IRON",
        update=redraw_pictures,
    )
    range_mode: EnumProperty(
        name="Range",
        description="Which temperatures get the two ends of the palette",
        items=(
            (
                "AUTOMATIC",
                "Automatic",
                "From the coldest to the hottest of each image; outliers and a 0 K background aside",
                0,
            ),
            ("FIXED", "Fixed", "The same in every image, so that images and frames can be compared", 1),
        ),
        default="AUTOMATIC",
        update=redraw_pictures,
    )
    range_low: scale_temperature("Low", "What is at this temperature or below gets the palette's cold end", 283.15)
    range_high: scale_temperature("High", "What is at this temperature or above gets the palette's hot end", 323.15)
    use_isotherm: BoolProperty(
        name="Isotherm",
        description="Paint what is between two temperatures in one color",
        default=False,
        update=redraw_pictures,
    )
    isotherm_low: scale_temperature("From", "Lowest temperature that is painted in the isotherm's color", 303.15)
    isotherm_high: scale_temperature("To", "Highest temperature that is painted in the isotherm's color", 308.15)
    isotherm_colour: FloatVectorProperty(
        name="Color",
        description="Color of the temperatures of the isotherm",
        size=3,
        subtype="COLOR_GAMMA",  # sRGB, as a screen shows it
        default=(0.0, 1.0, 0.0),
        min=0.0,
        max=1.0,
        update=redraw_pictures,
    )
    isotherm_rest: EnumProperty(
        name="Elsewhere",
        description="Colors of the temperatures that the isotherm leaves",
        items=(
            ("PALETTE", "Palette", "The chosen palette", 0),
            ("GREY", "Grey", "Greys, hot is white", 1),
        ),
        default="PALETTE",
        update=redraw_pictures,
    )
    show_colour_bar: BoolProperty(
        name="Color Bar",
        description="Show beside a render what temperatures its colors stand for",
        default=True,
        update=redraw_pictures,
    )
    spots: CollectionProperty(
        name="Spots",
        description="Fixed spots in files of earlier versions; measuring tools stand in their place",
        type=InfraredSpot,
        options={"HIDDEN"},
    )


def read_scale(infrared) -> TemperatureScale:
    """The TemperatureScale that scene.infrared asks for; its automatic ends are None."""
    isotherm, ends = None, (None, None)
    if infrared.use_isotherm:
        grey = infrared.isotherm_rest == "GREY"
        isotherm = Isotherm(infrared.isotherm_low, infrared.isotherm_high, tuple(infrared.isotherm_colour), grey)
    if infrared.range_mode == "FIXED":
        ends = infrared.range_low, infrared.range_high
    return TemperatureScale(infrared.palette, *ends, isotherm)


def fix_range(infrared, low: float, high: float) -> None:
    """Show temperatures from low to high, K, with all colours."""
    infrared.range_mode = "FIXED"
    infrared.range_low, infrared.range_high = spread(low, high)


def scene_unit(scene) -> TemperatureUnit:
    """The TemperatureUnit that Blender shows this scene's temperatures in."""
    units = scene.unit_settings
    if units.system == "NONE":  # its temperature_unit is then no valid value
        return KELVIN
    return UNITS.get(units.temperature_unit, KELVIN)


def in_scene_unit(kelvin: float, scene) -> str:
    """A temperature in words, in the unit that the scene shows."""
    return scene_unit(scene).text(kelvin)


def view_problem(scene) -> str:
    """What of the scene's color management changes the palette's colors on screen, or an empty text."""
    view = scene.view_settings
    if view.view_transform != "Standard":
        return f"View transform '{view.view_transform}'"
    if view.look not in ("None", ""):
        return f"Look '{view.look}'"
    if view.exposure != 0.0:
        return f"Exposure {view.exposure:g}"
    if view.gamma != 1.0:
        return f"Gamma {view.gamma:g}"
    if view.use_curve_mapping:
        return "Curves"
    return "White balance" if view.use_white_balance else ""


def use_true_colours(scene) -> None:
    """Let the scene's color management show the palette's colors as they are."""
    view = scene.view_settings
    view.view_transform = "Standard"  # first: the choice of looks depends on it
    view.look = "None"
    view.exposure, view.gamma = 0.0, 1.0
    view.use_curve_mapping = view.use_white_balance = False
