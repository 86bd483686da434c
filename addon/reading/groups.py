# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups: objects and worlds whose custom property `temperature_group` has the same name."""

from __future__ import annotations

import numpy as np

from ..solver.scene import SceneError
from .objects import SURFACE_TYPES, layers_objects
from .surface_temperature import object_temperatures
from .world import layer_world, world_temperature

KEY = "temperature_group"
UNGROUPED_LIGHT = "temperature groups are for surfaces; the light stays as it is"


def read_group(id_block, owner: str) -> str:
    """The name of the group that an object or the world is in; '' is none. Raises SceneError if it is no text."""
    name = id_block.get(KEY) or ""
    if not isinstance(name, str):
        raise SceneError(f"{owner}: {KEY} is {name!r}, expected the name of a group")
    return name.strip()


class GroupReader:
    """Numbers groups in the order in which they are met, and makes sure that each has one temperature."""

    def __init__(self):
        self._members: dict[str, tuple[int, str, float]] = {}  # group -> number, its first member, K

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the groups, by number."""
        return tuple(self._members)

    @property
    def temperatures(self) -> dict[str, float]:
        """Temperature of each group, K, by its name."""
        return {name: kelvin for name, (_, _, kelvin) in self._members.items()}

    def number(self, id_block, owner: str, temperature: np.ndarray) -> int:
        """The number of the group that an object or the world is in, -1 for none.

        owner: how messages name it. temperature: its temperatures, K, of any shape.
        Raises SceneError if the temperature varies, or differs from that of others in the group.
        """
        name = read_group(id_block, owner)
        if not name:
            return -1
        low, high = float(np.min(temperature)), float(np.max(temperature))
        if low < high:
            raise SceneError(
                f"{owner}: its temperature varies from {low:.6g} to {high:.6g} K, but it is in the temperature group "
                f"'{name}'; a group has one temperature"
            )
        number, other, kelvin = self._members.setdefault(name, (len(self._members), owner, low))
        if low != kelvin:
            raise SceneError(
                f"{owner} ({low:.6g} K) and {other} ({kelvin:.6g} K) are in the temperature group '{name}'; a group "
                "has one temperature"
            )
        return number


def read_group_temperatures(scene, layer=None) -> dict[str, float]:
    """The temperature (K) of each group that a scene's objects and worlds are in now, as the interface shows them.

    layer: the view layer whose objects and world count; None is all that some view layer renders.
    Raises SceneError if a temperature makes no sense, or differs within a group.
    """
    groups = GroupReader()
    layers = [layer] if layer else list(scene.view_layers)
    for obj in sorted(layers_objects(layers), key=lambda obj: obj.name_full):
        if obj.type in SURFACE_TYPES and read_group(obj, f"Object '{obj.name}'"):
            kelvin = object_temperatures(obj, scene.infrared.ambient_temperature)
            groups.number(obj, f"Object '{obj.name}'", np.float32(kelvin))
    worlds = dict.fromkeys(layer_world(scene, each) for each in layers)
    worlds.pop(None, None)
    for world in worlds:
        groups.number(world, f"World '{world.name}'", np.float32([world_temperature(world)]))
    return groups.temperatures
