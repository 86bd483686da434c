# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases: closed meshes, and the world, whose material or own properties say what they absorb."""

from __future__ import annotations

import numpy as np

from ..solver.geometry.media import open_edge
from ..solver.scene import Medium, SceneError
from .custom_properties import describe, read_number
from .materials import pair_points
from .warnings import Warnings

_KEYS = "absorption", "scattering", "gas"  # any of them makes a mesh a medium
_LATER = "scattering", "gas"  # what is not rendered


def is_medium(material) -> bool:
    """Whether a Blender material fills a closed mesh instead of covering its surface."""
    return material is not None and any(material.get(key) is not None for key in _KEYS)


def read_absorption(block, owner: str, warnings: Warnings, metres: float) -> float | np.ndarray:
    """The absorption of a material or world, per unit of length of the scene: a float, or an (n, 2) array of [um, ...].

    metres: length of that unit, see metres_per_unit. Raises SceneError, naming the value, if it makes no sense.
    """
    for key in _LATER:
        if block.get(key) is not None:
            warnings.add(block.name, f"the {key} of a gas is not rendered, only its absorption")
    value = block.get("absorption")
    if value is None:
        return 0.0
    if isinstance(value, int | float) and not isinstance(value, bool):
        return metres * float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: absorption is {describe(value)}, expected a number (1/m), or a flat list of wavelengths (um) and "
            "absorption coefficients (1/m)"
        )
    return pair_points(value.to_list(), owner, "absorption") * (1.0, metres)


def read_medium(
    material, kelvin: float, vertices: np.ndarray, triangles: np.ndarray, owner: str, warnings: Warnings, metres: float
) -> Medium | None:
    """The gas in a mesh of vertices (n, 3) float64, in world space, and triangles (m, 3); None, and a warning that says
    where it leaks, if the mesh is open. owner: the object. kelvin: its temperature. metres: see read_absorption."""
    leak = open_edge(vertices, triangles)
    if leak is not None:
        place = ", ".join(f"{value:.4g}" for value in leak)
        warnings.add(owner, f"the mesh of a gas must be closed, but it is open at ({place}); the gas is left out")
        return None
    absorption = read_absorption(material, f"Material '{material.name}'", warnings, metres)
    name = f"{owner}: {material.name}"
    return Medium(name, absorption, kelvin, vertices=vertices, triangles=triangles)


def read_world_medium(world, kelvin: float, warnings: Warnings, metres: float) -> tuple[tuple[Medium, ...], float]:
    """The gas that fills the world, none if it absorbs nothing, and its depth along rays that leave the scene, in units
    of the scene. kelvin: its temperature, which is that of the surroundings."""
    if not is_medium(world):
        return (), 0.0
    owner = f"World '{world.name}'"
    depth = read_number(world, "depth", 0.0, owner, " in metres") / metres
    if world.get("depth") is None:
        warnings.add(world.name, "its gas has no depth, so rays that leave the scene cross none of it")
    return (Medium(owner, read_absorption(world, owner, warnings, metres), kelvin),), depth
