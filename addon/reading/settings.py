# SPDX-License-Identifier: GPL-3.0-or-later
"""The render settings in scene.infrared become the solver's Settings, and what counts where nothing else is set."""

from __future__ import annotations

import math
from dataclasses import replace

from ..solver.physics.correction import Correction
from ..solver.scene import Material, SceneError, check_temperature
from ..solver.settings import Settings
from .object_parameters import read_object_parameters
from .shown import as_shown, as_typed

DEFAULTS = "Where Nothing Is Set"  # label of the panel with these settings
# Scripts and drivers can put NaN and infinity anywhere. All other settings are checked where they are read.
_FINITE = "range_low", "range_high", "isotherm_low", "isotherm_high", "band_tolerance", "checkpoint_minutes"


def read_settings(infrared) -> Settings:
    """The solver's settings from scene.infrared. Raises SceneError, with the names that the interface shows, if nothing
    would stop the render or a value makes no sense.
    """
    for name in _FINITE:
        if not math.isfinite(getattr(infrared, name)):
            shown = infrared.bl_rna.properties[name].name
            raise SceneError(f"Setting '{shown}' ({name}) is {getattr(infrared, name)}, expected a finite number")
    correction = read_object_parameters(infrared).correction
    of_correction = _by_setting(correction)
    names = [name for name in Settings.__dataclass_fields__ if hasattr(infrared, name) and name not in of_correction]
    try:
        return Settings(**{name: as_typed(getattr(infrared, name)) for name in names}, **of_correction)
    except ValueError as error:
        shown = as_shown(error, infrared, dict(zip(names, names, strict=True)))
        raise SceneError(f"Panel 'Photons': {shown}") from error


def with_correction(settings: Settings, correction: Correction) -> Settings:
    """The same settings with another correction."""
    return replace(settings, **_by_setting(correction))


def _by_setting(correction: Correction) -> dict[str, float]:
    """The values of a correction by the names that the solver's settings give them."""
    emissivity, *further = correction
    return {"assumed_emissivity": emissivity, **dict(zip(Correction._fields[1:], further, strict=True))}


def read_defaults(infrared) -> tuple[float, Material]:
    """The temperature (K) of objects and the material of faces that have none of their own.

    Raises SceneError, naming their panel, if a value makes no sense.
    """
    check_temperature(infrared.ambient_temperature, f"Panel '{DEFAULTS}'")
    if not 0.0 <= infrared.default_emissivity <= 1.0:  # also NaN
        raise SceneError(f"Panel '{DEFAULTS}': emissivity {infrared.default_emissivity:g} is outside 0..1")
    return infrared.ambient_temperature, Material(name=DEFAULTS, emissivity=infrared.default_emissivity)
