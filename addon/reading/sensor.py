# SPDX-License-Identifier: GPL-3.0-or-later
"""The spectral response of the sensor that scene.infrared chooses, and how slowly it follows what it sees."""

from __future__ import annotations

import math

import numpy as np

from ..solver.physics.sensors import BUILT_IN
from ..solver.scene import Response, SceneError
from .custom_properties import describe


def read_response(infrared, sensor: str | None = None) -> Response | None:
    """The response of a sensor, None for an ideal one. sensor: its key; None takes that of scene.infrared.

    Raises SceneError if a custom one is no response.
    """
    sensor = sensor or infrared.sensor
    if sensor == "BOX":
        return None
    if sensor != "CUSTOM":
        return BUILT_IN[sensor]()
    value = infrared.id_data.get("sensor_response")
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"Sensor: the scene's sensor_response is {describe(value)}, expected a flat list of wavelengths (um) and "
            "responses; import one, or choose another sensor"
        )
    if len(value) % 2:
        raise SceneError(f"Sensor: sensor_response has {len(value)} numbers, expected pairs of um and response")
    return Response("Custom", np.array(value.to_list(), dtype=np.float64).reshape(-1, 2))


def read_lag(infrared) -> float:
    """Time constant of the sensor, s. Raises SceneError if it is none."""
    milliseconds = infrared.sensor_lag
    if not 0.0 <= milliseconds < math.inf:
        raise SceneError(f"Sensor: the time constant is {milliseconds:g} ms, expected a finite number of 0 or more")
    return 1e-3 * milliseconds
