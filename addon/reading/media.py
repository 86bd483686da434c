# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases: closed meshes, and the world, whose material or own properties say what they absorb."""

from __future__ import annotations

import numpy as np

from ..solver.geometry.closed import open_edge
from ..solver.physics.gases import find_gas
from ..solver.scene import ATMOSPHERE, Medium, SceneError
from .custom_properties import describe, read_number
from .materials import pair_points
from .warnings import Warnings

_KEYS = "absorption", "scattering", "gas"  # any of them makes a mesh a medium


def is_medium(material) -> bool:
    """Whether a Blender material fills a closed mesh instead of covering its surface."""
    return material is not None and any(material.get(key) is not None for key in _KEYS)


def read_optics(block, owner: str, metres: float) -> dict:
    """The absorption, scattering, anisotropy and gas of a material or world, as Medium takes them.

    metres: length of a unit of the scene, see metres_per_unit. Raises SceneError, naming the value, if it makes no
    sense.
    """
    optics = {quantity: _coefficient(block, quantity, owner, metres) for quantity in ("absorption", "scattering")}
    anisotropy = read_number(block, "anisotropy", 0.0, owner, " from -1 to 1")
    return optics | {"anisotropy": anisotropy, "gas": _mixture(block, owner), "metres": metres}


def _mixture(block, owner: str) -> dict[str, float]:
    """What the gas of a material or world consists of: fractions by species, given so or by the name of a mixture."""
    value = block.get("gas")
    if value is None:
        return {}
    if isinstance(value, str):
        try:
            return find_gas(value)
        except KeyError as error:
            raise SceneError(f"{owner}: {error.args[0]}") from None
    fractions = value.to_dict() if hasattr(value, "to_dict") else {}
    if not fractions or not all(_is_number(fraction) for fraction in fractions.values()):
        raise SceneError(
            f"{owner}: gas is {describe(value)}, expected the name of a gas of the library, or mole fractions such as "
            '{"H2O": 0.12, "CO2": 0.12}'
        )
    return {name: float(fraction) for name, fraction in fractions.items()}


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _coefficient(block, quantity: str, owner: str, metres: float) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, coefficient] from a flat list."""
    value = block.get(quantity)
    if value is None:
        return 0.0
    if _is_number(value):
        return metres * float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: {quantity} is {describe(value)}, expected a number (1/m), or a flat list of wavelengths "
            "(um) and coefficients (1/m)"
        )
    return pair_points(value.to_list(), owner, quantity) * (1.0, metres)


def read_medium(
    obj, material, kelvin: float, vertices: np.ndarray, triangles: np.ndarray, warnings: Warnings, metres: float
) -> Medium | None:
    """The gas in a mesh of vertices (n, 3) float64, in world space, and triangles (m, 3); None, and a warning that says
    where it leaks, if the mesh is open. kelvin: temperature of the object. metres: see read_optics."""
    leak = open_edge(vertices, triangles)
    if leak is not None:
        place = ", ".join(f"{value:.4g}" for value in leak)
        warnings.add(obj.name, f"the mesh of a gas must be closed, but it is open at ({place}); the gas is left out")
        return None
    optics = read_optics(material, f"Material '{material.name}'", metres)
    optics["pressure"] = read_pressure(obj, f"Object '{obj.name}'")
    return Medium(f"{obj.name}: {material.name}", temperature=kelvin, vertices=vertices, triangles=triangles, **optics)


def read_pressure(block, owner: str) -> float:
    """The pressure of an object's or the world's gas, Pa."""
    return read_number(block, "pressure", ATMOSPHERE, owner, " in pascals")


def read_world_medium(world, kelvin: float, warnings: Warnings, metres: float) -> tuple[tuple[Medium, ...], float]:
    """The gas that fills the world, none without one, and its depth along rays that leave the scene, in units
    of the scene. kelvin: its temperature, which is that of the surroundings."""
    if not is_medium(world):
        return (), 0.0
    owner = f"World '{world.name}'"
    depth = read_number(world, "depth", 0.0, owner, " in metres") / metres
    if world.get("depth") is None:
        warnings.add(world.name, "its gas has no depth, so rays that leave the scene cross none of it")
    optics = read_optics(world, owner, metres) | {"pressure": read_pressure(world, owner)}
    return (Medium(owner, temperature=kelvin, **optics),), depth
