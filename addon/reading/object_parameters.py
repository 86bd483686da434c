# SPDX-License-Identifier: GPL-3.0-or-later
"""The object parameters of scene.infrared: what Temperature is corrected for."""

from __future__ import annotations

from dataclasses import replace

from ..measuring.object_parameters import ObjectParameters, gas_transmission
from ..solver.physics.sensors import band_weights
from ..solver.scene import SceneError
from .bands import read_band_edges
from .media import is_medium, read_gas_alone, read_pressure
from .sensor import read_response
from .shown import as_shown, as_typed
from .world import air_temperature

PANEL = "Spectrum > Object Parameters"
TYPICAL = 300.0  # K, of objects that are seen through the gas of the world
# Field of ObjectParameters -> property of scene.infrared
PROPERTIES = {
    "emissivity": "assumed_emissivity",
    "reflected_temperature": "reflected_temperature",
    "distance": "object_distance",
    "air_temperature": "air_temperature",
    "relative_humidity": "relative_humidity",
    "air_transmission": "air_transmission",
    "optics_transmission": "optics_transmission",
    "optics_temperature": "optics_temperature",
}


def read_object_parameters(infrared) -> ObjectParameters:
    """The ObjectParameters of scene.infrared. Raises SceneError, with the names that the interface shows, if a value
    makes no sense, or if the gas of the world counts and cannot be read.
    """
    values = {field: as_typed(getattr(infrared, shown)) for field, shown in PROPERTIES.items()}
    values["relative_humidity"] /= 100.0
    source, world = infrared.air_transmission_source, infrared.id_data.world
    if source != "FIXED":
        values["air_transmission"] = None
    if source == "WORLD":
        values |= {"air_transmission": 1.0, "air_temperature": air_temperature(world)}
    try:
        parameters = ObjectParameters(**values)
    except SceneError as error:
        raise SceneError(f"Panel '{PANEL}': {as_shown(error, infrared, PROPERTIES)}") from error
    if source == "WORLD" and is_medium(world):
        return _through_gas(parameters, world, infrared)
    return parameters


def _through_gas(parameters: ObjectParameters, world, infrared) -> ObjectParameters:
    """The same with the transmission of a world's gas, as the sensor sees a blackbody at TYPICAL through it."""
    owner = f"World '{world.name}'"
    gas = read_gas_alone(world, owner, parameters.air_temperature, read_pressure(world, owner))
    edges = read_band_edges(infrared)
    weights = band_weights(read_response(infrared), edges)
    transmission = gas_transmission(gas, parameters.distance, edges, weights, TYPICAL)
    try:
        return replace(parameters, air_transmission=transmission)
    except SceneError as error:
        message = f"{owner}: its gas lets nothing through over {parameters.distance:g} m"
        raise SceneError(f"Panel '{PANEL}': {message}") from error
