# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials become the solver's: emissivity, transmittance, specular share, roughness and Fresnel's law from
their custom properties."""

from __future__ import annotations

import numpy as np

from ..solver.physics import library
from ..solver.scene import Material, SceneError
from .custom_properties import describe, driver_remarks, is_number, number_hint, read_choice, read_number

_PLURAL = {"emissivity": "emissivities", "transmittance": "transmittances"}
FRESNEL_LEFT_OUT = "fresnel is left out: a thin sheet with a transmittance is alike at all angles"


def read_material(material, default_emissivity: float) -> Material:
    """The solver's material from a Blender material's custom properties. A thin sheet leaves Fresnel's law out, see
    leaves_fresnel_out. Raises SceneError, naming material and value, if one makes no sense."""
    owner = f"Material '{material.name}'"
    emissivity = material.get("emissivity")  # Blender 5 can hold None, which is as good as nothing
    passed = material.get("transmittance")
    transmittance = 0.0 if passed is None else _spectrum(passed, "transmittance", owner)
    specular = read_number(material, "specular", 0.0, owner, " from 0 to 1")
    transmits = np.any(np.atleast_2d(transmittance)[:, -1] > 0.0)
    fresnel = read_choice(material, "fresnel", owner) and not (transmits and specular > 0.0)
    by_name = fresnel and isinstance(emissivity, str)
    return Material(
        name=material.name,
        emissivity=default_emissivity if emissivity is None else _spectrum(emissivity, "emissivity", owner),
        specular=specular,
        roughness=read_number(material, "roughness", 0.0, owner, " from 0 to 1"),
        fresnel=fresnel,
        constants=library.find_constants(emissivity) if by_name else None,
        transmittance=transmittance,
    )


def surface_remarks(material) -> list[str]:
    """What is wrong with the drivers of a Blender material's surface, and which values count."""
    others = driver_remarks(material, ("transmittance", "specular", "roughness", "mix"))
    return driver_remarks(material, ("emissivity",), zero=False) + others


def leaves_fresnel_out(material, read: Material) -> bool:
    """Whether a Blender material asks for Fresnel's law and, as it was read, does not follow it."""
    return bool(material.get("fresnel")) and not read.fresnel


def _spectrum(value, quantity: str, owner: str) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, quantity] from a flat list or the name of a library material."""
    if isinstance(value, str):
        return _library_curve(value, quantity, owner)
    if is_number(value):
        return float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: {quantity} is {describe(value)}, expected a number, "
            f"a flat list of wavelengths (um) and {_PLURAL[quantity]}, or the name of a library material"
        )
    return pair_points(value.to_list(), owner, quantity)


def pair_points(numbers: list[float], owner: str, quantity: str = "emissivity") -> np.ndarray:
    """(n, 2) float64 points [um, quantity] of a flat list. Raises SceneError unless its length is even."""
    if len(numbers) == 0 or len(numbers) % 2:
        raise SceneError(
            f"{owner}: the {quantity} list has {len(numbers)} numbers, expected pairs of wavelength (um) and {quantity}"
        )
    return np.array(numbers, dtype=np.float64).reshape(-1, 2)


def _library_curve(name: str, quantity: str, owner: str) -> np.ndarray:
    """The points of a material of the library. What comes with it are emissivities, so only a curve that the artist
    keeps there can be a transmittance."""
    try:
        known = library.get(name)
    except KeyError as error:
        raise SceneError(f"{owner}: {error.args[0]}{number_hint(quantity, name)}") from None
    if quantity == "transmittance" and known.category != library.USER_CATEGORY:
        raise SceneError(
            f"{owner}: transmittance is '{known.name}', whose curve in the library is an emissivity; "
            "expected a number, a flat list, or the name of one of my materials"
        )
    return known.points
