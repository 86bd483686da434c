# SPDX-License-Identifier: GPL-3.0-or-later
"""The world that a view layer shows, and its temperature."""

from __future__ import annotations

from .custom_properties import read_temperature

WHERE_TO_SET = "World properties, panel Surroundings"


def layer_world(scene, layer):
    """The world that a view layer shows, or None: its own if it overrides the scene's."""
    return layer.world_override or scene.world


def unset_surroundings(world) -> str:
    """What surroundings without a temperature lack; an empty text if somebody set it, be it to 0 K."""
    if world is None:
        return "The scene has no world"
    return "" if world.get("temperature") is not None else f"World '{world.name}' has no temperature"


def world_temperature(world) -> float:
    """What rays that leave the scene see, K; without the property, or without a world, that is 0 K."""
    return 0.0 if world is None else read_temperature(world, 0.0, f"World '{world.name}'")
