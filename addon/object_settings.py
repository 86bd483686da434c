# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings in scene.infrared that say what the user of a thermal camera knows of the object, the air and optics."""

from __future__ import annotations

from functools import partial

from bpy.props import EnumProperty, FloatProperty

from .heat_settings import redraw_pictures
from .interface import temperature_property

ROOM_TEMPERATURE = 293.15  # K

_number = partial(FloatProperty, update=redraw_pictures)
_share = partial(_number, default=1.0, soft_min=0.01, soft_max=1.0, precision=3, subtype="FACTOR")
_temperature = partial(
    temperature_property,
    default=ROOM_TEMPERATURE,
    soft_min=0.0,
    soft_max=2_000.0,
    step=100,
    update=redraw_pictures,
)


class ObjectParameterSettings:
    """Base of InfraredSettings: object parameters by ISO 18434-1. The defaults correct nothing."""

    assumed_emissivity: _share(
        name="Assumed Emissivity",
        description="Emissivity that Temperature is corrected for, as a thermal camera's user sets it; 1 corrects "
        "nothing",
    )
    reflected_temperature: _temperature(
        "Reflected Temperature",
        "Apparent temperature in kelvin of what the surfaces reflect; it counts if Assumed Emissivity is below 1",
    )
    air_transmission_source: EnumProperty(
        name="Air",
        description="Where the transmission of the air between camera and object, which Temperature is corrected for, "
        "comes from",
        items=(
            ("FIXED", "Transmission", "The number below; 1 corrects nothing", 0),
            (
                "FORMULA",
                "Distance and Humidity",
                "The formula in long-wave cameras, 7.5 to 13 µm, by distance, air temperature and relative humidity",
                1,
            ),
            (
                "WORLD",
                "Gas of the World",
                "What the gas of the scene's world lets through over the distance, at its own temperature",
                2,
            ),
        ),
        default="FIXED",
        update=redraw_pictures,
    )
    air_transmission: _share(
        name="Air Transmission",
        description="Share of the radiation that the air between camera and object lets through, above 0 to 1; 1 "
        "corrects nothing",
    )
    object_distance: _number(
        name="Distance (m)",
        description="Way through the air from the camera to the object, in metres",
        default=1.0,
        soft_min=0.0,
        soft_max=1_000.0,
        precision=2,
    )
    relative_humidity: _number(
        name="Relative Humidity",
        description="Of the air between camera and object, in per cent",
        default=50.0,
        soft_min=0.0,
        soft_max=100.0,
        precision=1,
        subtype="PERCENTAGE",
    )
    air_temperature: _temperature(
        "Air Temperature",
        "Of the air between camera and object, in kelvin, which radiates what it does not let through",
    )
    optics_transmission: _share(
        name="Optics Transmission",
        description="Share of the radiation that a window or lens before the camera lets through, above 0 to 1; 1 "
        "corrects nothing",
    )
    optics_temperature: _temperature(
        "Optics Temperature",
        "Of the window or lens before the camera, in kelvin, which radiates what it does not let through",
    )
