# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases: closed meshes, and the world, whose material or own properties say what they absorb."""

from __future__ import annotations

import numpy as np

from ..solver.geometry.closed import open_edge
from ..solver.scene import Medium, SceneError
from .custom_properties import describe, read_number
from .materials import pair_points
from .warnings import Warnings

_KEYS = "absorption", "scattering", "gas"  # any of them makes a mesh a medium


def is_medium(material) -> bool:
    """Whether a Blender material fills a closed mesh instead of covering its surface."""
    return material is not None and any(material.get(key) is not None for key in _KEYS)


def read_optics(block, owner: str, warnings: Warnings, metres: float) -> dict:
    """The absorption, scattering and anisotropy of a material or world, as Medium takes them, in units of the scene.

    metres: length of such a unit, see metres_per_unit. Raises SceneError, naming the value, if it makes no sense.
    """
    if block.get("gas") is not None:
        warnings.add(block.name, "mixtures of gases are not rendered; absorption and scattering count")
    optics = {quantity: _coefficient(block, quantity, owner, metres) for quantity in ("absorption", "scattering")}
    return optics | {"anisotropy": read_number(block, "anisotropy", 0.0, owner, " from -1 to 1")}


def _coefficient(block, quantity: str, owner: str, metres: float) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, coefficient] from a flat list."""
    value = block.get(quantity)
    if value is None:
        return 0.0
    if isinstance(value, int | float) and not isinstance(value, bool):
        return metres * float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: {quantity} is {describe(value)}, expected a number (1/m), or a flat list of wavelengths "
            "(um) and coefficients (1/m)"
        )
    return pair_points(value.to_list(), owner, quantity) * (1.0, metres)


def read_medium(
    material, kelvin: float, vertices: np.ndarray, triangles: np.ndarray, owner: str, warnings: Warnings, metres: float
) -> Medium | None:
    """The gas in a mesh of vertices (n, 3) float64, in world space, and triangles (m, 3); None, and a warning that says
    where it leaks, if the mesh is open. owner: the object. kelvin: its temperature. metres: see read_optics."""
    leak = open_edge(vertices, triangles)
    if leak is not None:
        place = ", ".join(f"{value:.4g}" for value in leak)
        warnings.add(owner, f"the mesh of a gas must be closed, but it is open at ({place}); the gas is left out")
        return None
    optics = read_optics(material, f"Material '{material.name}'", warnings, metres)
    return Medium(f"{owner}: {material.name}", temperature=kelvin, vertices=vertices, triangles=triangles, **optics)


def read_world_medium(world, kelvin: float, warnings: Warnings, metres: float) -> tuple[tuple[Medium, ...], float]:
    """The gas that fills the world, none without one, and its depth along rays that leave the scene, in units
    of the scene. kelvin: its temperature, which is that of the surroundings."""
    if not is_medium(world):
        return (), 0.0
    owner = f"World '{world.name}'"
    depth = read_number(world, "depth", 0.0, owner, " in metres") / metres
    if world.get("depth") is None:
        warnings.add(world.name, "its gas has no depth, so rays that leave the scene cross none of it")
    return (Medium(owner, temperature=kelvin, **read_optics(world, owner, warnings, metres)),), depth
