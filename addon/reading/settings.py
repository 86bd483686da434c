# SPDX-License-Identifier: GPL-3.0-or-later
"""The render settings in scene.infrared become the solver's Settings, and what counts where nothing else is set."""

from __future__ import annotations

from ..solver.scene import Material, SceneError, check_temperature
from ..solver.settings import Settings
from .object_parameters import read_object_parameters
from .shown import as_shown, as_typed

DEFAULTS = "Where Nothing Is Set"  # label of the panel with these settings


def read_settings(infrared) -> Settings:
    """The solver's settings from scene.infrared. Raises SceneError, with the names that the interface shows, if nothing
    would stop the render or a value makes no sense.
    """
    emissivity, *further = correction = read_object_parameters(infrared).correction
    corrected = {"assumed_emissivity": emissivity, **dict(zip(correction._fields[1:], further, strict=True))}
    names = [name for name in Settings.__dataclass_fields__ if hasattr(infrared, name) and name not in corrected]
    try:
        return Settings(**{name: as_typed(getattr(infrared, name)) for name in names}, **corrected)
    except ValueError as error:
        shown = as_shown(error, infrared, dict(zip(names, names, strict=True)))
        raise SceneError(f"Panel 'Photons': {shown}") from error


def read_defaults(infrared) -> tuple[float, Material]:
    """The temperature (K) of objects and the material of faces that have none of their own.

    Raises SceneError, naming their panel, if a value makes no sense.
    """
    check_temperature(infrared.ambient_temperature, f"Panel '{DEFAULTS}'")
    if not 0.0 <= infrared.default_emissivity <= 1.0:  # also NaN
        raise SceneError(f"Panel '{DEFAULTS}': emissivity {infrared.default_emissivity:g} is outside 0..1")
    return infrared.ambient_temperature, Material(name=DEFAULTS, emissivity=infrared.default_emissivity)
