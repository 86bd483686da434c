# SPDX-License-Identifier: GPL-3.0-or-later
"""What settings, panels and operators share: the engine's identifier, properties with a unit, redrawing of editors."""

from __future__ import annotations

import bpy
from bpy.props import FloatProperty

ENGINE = "INFRARED_PHOTONS"  # the engine's identifier in Blender
TEMPERATURE_DIGITS = 5  # significant ones: that is what Blender's precision means for values with a unit


def temperature_property(name: str, description: str, default: float, **options):
    """A temperature in K that Blender shows in the scene's unit; default in K. options: more of FloatProperty."""
    return FloatProperty(
        name=name,
        description=description,
        default=default,
        precision=TEMPERATURE_DIGITS,
        subtype="TEMPERATURE",
        unit="TEMPERATURE",
        **options,
    )


def redraw(kind: str | None = None) -> None:
    """Draw the editors of a kind (an area's type) again, or all of them."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if kind in (None, area.type):
                area.tag_redraw()
