# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials become the solver's: emissivity, specular share, roughness and Fresnel's law from their custom
properties."""

from __future__ import annotations

import numpy as np

from ..solver.physics import library
from ..solver.scene import Material, SceneError
from .custom_properties import describe, is_number, read_choice, read_number


def read_material(material, default_emissivity: float) -> Material:
    """The solver's material from a Blender material's custom properties."""
    owner = f"Material '{material.name}'"
    emissivity = material.get("emissivity")  # Blender 5 can hold None, which is as good as nothing
    fresnel = read_choice(material, "fresnel", owner)
    by_name = fresnel and isinstance(emissivity, str)
    return Material(
        name=material.name,
        emissivity=default_emissivity if emissivity is None else _emissivity(emissivity, owner),
        specular=read_number(material, "specular", 0.0, owner, " from 0 to 1"),
        roughness=read_number(material, "roughness", 0.0, owner, " from 0 to 1"),
        fresnel=fresnel,
        constants=library.find_constants(emissivity) if by_name else None,
    )


def _emissivity(value, owner: str) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, emissivity] from a flat list or the name of a library material."""
    if isinstance(value, str):
        return _library_emissivity(value, owner)
    if is_number(value):
        return float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: emissivity is {describe(value)}, expected a number, "
            "a flat list of wavelengths (um) and emissivities, or the name of a library material"
        )
    return pair_points(value.to_list(), owner)


def pair_points(numbers: list[float], owner: str, quantity: str = "emissivity") -> np.ndarray:
    """(n, 2) float64 points [um, quantity] of a flat list. Raises SceneError unless its length is even."""
    if len(numbers) == 0 or len(numbers) % 2:
        raise SceneError(
            f"{owner}: the {quantity} list has {len(numbers)} numbers, expected pairs of wavelength (um) and {quantity}"
        )
    return np.array(numbers, dtype=np.float64).reshape(-1, 2)


def _library_emissivity(name: str, owner: str) -> np.ndarray:
    try:
        return library.find(name)
    except KeyError as error:
        raise SceneError(f"{owner}: {error.args[0]}") from None
