# SPDX-License-Identifier: GPL-3.0-or-later
"""The world that a view layer shows: its temperature, or its sky, whose temperature depends on the direction."""

from __future__ import annotations

import numpy as np

from ..solver.scene import SceneError, Sky
from .custom_properties import describe, is_number, read_temperature
from .images import read_kelvin

WHERE_TO_SET = "World properties, panel Surroundings"
SKY_KEYS = "temperature_image", "temperature_table"  # the first that is set wins over the others and `temperature`
_COLUMNS = "zenith", "wavelength", "kelvin"
_HORIZON = 90.0  # degrees from the zenith


def layer_world(scene, layer):
    """The world that a view layer shows, or None: its own if it overrides the scene's."""
    return layer.world_override or scene.world


def unset_surroundings(world) -> str:
    """What surroundings without a temperature lack; an empty text if somebody set it, be it to 0 K."""
    if world is None:
        return "The scene has no world"
    is_set = any(world.get(key) is not None for key in ("temperature", *SKY_KEYS))
    return "" if is_set else f"World '{world.name}' has no temperature"


def world_temperature(world) -> float:
    """What rays that leave the scene see, K, of a sky its mean; without the property, or without a world, 0 K."""
    if world is None:
        return 0.0
    sky = read_sky(world)
    return read_temperature(world, 0.0, f"World '{world.name}'") if sky is None else sky.mean_temperature


def air_temperature(world) -> float:
    """Temperature of the gas that fills a world, K: that of the surroundings, of a sky that at the horizon."""
    sky = None if world is None else read_sky(world)
    return world_temperature(world) if sky is None else float(sky.temperature_at(_HORIZON))


def read_sky(world) -> Sky | None:
    """The sky of a world, None if it has one temperature. Raises SceneError, naming the world, if it makes no sense."""
    owner, value = f"World '{world.name}'", world.get("temperature")
    image, table = (world.get(key) for key in SKY_KEYS)
    if image is not None:
        return Sky(read_kelvin(image, world, owner))
    if table is not None:
        return _sky_of_table(table, owner)
    if value is None or is_number(value):
        return None
    if getattr(value, "typecode", None) not in ("i", "f", "d"):
        raise SceneError(
            f"{owner}: temperature is {describe(value)}, expected a number in kelvin or a flat list of zenith angles "
            "(degrees) and temperatures"
        )
    numbers = value.to_list()
    if len(numbers) == 0 or len(numbers) % 2:
        raise SceneError(f"{owner}: temperature has {len(numbers)} numbers, expected pairs of zenith angle and kelvin")
    pairs = np.array(numbers, np.float64).reshape(-1, 2)
    return _named(owner, pairs[:, 1], pairs[:, 0])


def _sky_of_table(table, owner: str) -> Sky:
    """Of the property group {"zenith": [deg, ...], "wavelength": [um, ...], "kelvin": [...]}, kelvin by zenith angle
    first."""
    if not hasattr(table, "to_dict") or any(key not in table for key in _COLUMNS):
        raise SceneError(f"{owner}: temperature_table is {describe(table)}, expected lists named {', '.join(_COLUMNS)}")
    try:
        zenith, wavelength, kelvin = (np.atleast_1d(np.array(table[key], np.float64)) for key in _COLUMNS)
    except (TypeError, ValueError):
        expected = f"expected numbers in the lists {', '.join(_COLUMNS)}"
        raise SceneError(f"{owner}: temperature_table is {describe(table)}, {expected}") from None
    if kelvin.size != zenith.size * wavelength.size:
        raise SceneError(
            f"{owner}: temperature_table has {kelvin.size} temperatures, expected {zenith.size} zenith angles times "
            f"{wavelength.size} wavelengths"
        )
    return _named(owner, kelvin.reshape(zenith.size, wavelength.size), zenith, wavelength)


def sky_table(zenith: np.ndarray, wavelength: np.ndarray, kelvin: np.ndarray) -> dict[str, list[float]]:
    """The custom property `temperature_table` of a sky: (n,) degrees, (m,) um and (n, m) K."""
    return {"zenith": zenith.tolist(), "wavelength": wavelength.tolist(), "kelvin": kelvin.ravel().tolist()}


def _named(owner: str, *arguments) -> Sky:
    """The Sky. Its messages begin with this owner."""
    try:
        return Sky(*arguments)
    except SceneError as error:
        raise SceneError(str(error).replace("World", owner, 1)) from None
