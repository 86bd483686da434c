# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases: closed meshes, and the world, whose material or own properties say what they absorb."""

from __future__ import annotations

import numpy as np

from ..solver.geometry.closed import fault_of
from ..solver.physics.aerosols import mix_in
from ..solver.physics.gases import find_gas
from ..solver.scene import ATMOSPHERE, Medium, SceneError
from .custom_properties import describe, driver_remarks, is_number, number_hint, read_number
from .materials import pair_points
from .warnings import Warnings
from .world import unset_surroundings

# Of a world with gas in a temperature group
GROUPED_AIR = (
    "its gas is in no temperature group: recombined for other surroundings, the air keeps the temperature of the render"
)
NO_GROUP = "temperature groups are for surfaces; the gas stays as it is"
_KEYS = "absorption", "scattering", "gas"  # any of them makes a mesh a medium


def is_medium(material) -> bool:
    """Whether a Blender material fills a closed mesh instead of covering its surface."""
    return material is not None and any(material.get(key) is not None for key in _KEYS)


def read_optics(block, owner: str, metres: float) -> dict:
    """The absorption, scattering and anisotropy of a material or world, as Medium takes them, and its contents.

    metres: length of a unit of the scene, see metres_per_unit. Raises SceneError, naming the value, if it makes no
    sense.
    """
    optics = {quantity: _coefficient(block, quantity, owner, metres) for quantity in ("absorption", "scattering")}
    anisotropy = read_number(block, "anisotropy", 0.0, owner, " from -1 to 1")
    return optics | {"anisotropy": anisotropy, "contents": _contents(block, owner), "metres": metres}


def gas_remarks(block) -> list[str]:
    """What is wrong with the drivers of the gas of a material or world, and which values count."""
    return driver_remarks(block, ("absorption", "scattering", "anisotropy"))


def build_medium(name: str, contents: dict[str, float], **values) -> Medium:
    return mix_in(Medium(name, **values), contents)


def _contents(block, owner: str) -> dict[str, float]:
    """What the gas of a material or world consists of: fractions of species and grams of aerosols per m3, given so or
    by the name of a mixture."""
    value = block.get("gas")
    if value is None:
        return {}
    if isinstance(value, str):
        try:
            return find_gas(value)
        except KeyError as error:
            raise SceneError(f"{owner}: {error.args[0]}{number_hint('gas', value)}") from None
    fractions = value.to_dict() if hasattr(value, "to_dict") else {}
    if not fractions or not all(is_number(fraction) for fraction in fractions.values()):
        raise SceneError(
            f"{owner}: gas is {describe(value)}, expected the name of a gas of the library, or mole fractions such as "
            '{"H2O": 0.12, "CO2": 0.12}, and g/m3 of aerosols'
        )
    return {name: float(fraction) for name, fraction in fractions.items()}


def _coefficient(block, quantity: str, owner: str, metres: float) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, coefficient] from a flat list."""
    value = block.get(quantity)
    if value is None:
        return 0.0
    if is_number(value):
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
    leak = leak_message(vertices, triangles)
    if leak:
        warnings.add(obj.name, leak)
        return None
    for remark in gas_remarks(material):
        warnings.add(material.name, remark)
    optics = read_optics(material, f"Material '{material.name}'", metres)
    optics["pressure"] = read_pressure(obj, f"Object '{obj.name}'")
    return build_medium(
        f"{obj.name}: {material.name}", temperature=kelvin, vertices=vertices, triangles=triangles, **optics
    )


def leak_message(vertices: np.ndarray, triangles: np.ndarray) -> str:
    """How a mesh of vertices (n, 3) and triangles (m, 3) is not closed, and what that does; an empty text if it is."""
    fault = fault_of(vertices, triangles)
    return f"the mesh of a gas must be closed, but it is {fault}; the gas is left out" if fault else ""


def read_gas_alone(block, owner: str, kelvin: float, pressure: float = ATMOSPHERE) -> Medium:
    """The gas of a material or world without a mesh, in metres. kelvin: its temperature. pressure: Pa. Raises
    SceneError as read_medium does."""
    return build_medium(block.name, temperature=kelvin, pressure=pressure, **read_optics(block, owner, 1.0))


def read_pressure(block, owner: str) -> float:
    """The pressure of an object's or the world's gas, Pa. Raises SceneError if it is no number."""
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
    if unset_surroundings(world):
        warnings.add(world.name, "its gas has no temperature; it absorbs, and emits nothing, as at 0 K")
    for remark in gas_remarks(world):
        warnings.add(world.name, remark)
    optics = read_optics(world, owner, metres) | {"pressure": read_pressure(world, owner)}
    return (build_medium(owner, temperature=kelvin, **optics),), depth
