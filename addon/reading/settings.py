# SPDX-License-Identifier: GPL-3.0-or-later
"""The render settings in scene.infrared become the solver's Settings, and what counts where nothing else is set."""

from __future__ import annotations

import re
from collections.abc import Iterable

from ..solver.scene import Material, SceneError, check_temperature
from ..solver.settings import Settings

DEFAULTS = "Where Nothing Is Set"  # label of the panel with these settings
SENSOR_SETTINGS = {"assumed_emissivity", "reflected_temperature"}


def read_settings(infrared) -> Settings:
    """The solver's settings from scene.infrared. Raises SceneError, with the names that the interface shows, if nothing
    would stop the render or a value makes no sense.
    """
    names = [name for name in Settings.__dataclass_fields__ if hasattr(infrared, name)]
    try:
        return Settings(**{name: as_typed(getattr(infrared, name)) for name in names})
    except ValueError as error:
        panel = "Spectrum > Sensor" if SENSOR_SETTINGS.intersection(re.findall(r"\w+", str(error))) else "Photons"
        raise SceneError(f"Panel '{panel}': {as_shown(error, infrared, names)}") from error


def as_shown(error: Exception, infrared, names: Iterable[str], prefix: str = "") -> str:
    """The solver's message about its settings, with their names replaced by the labels that the interface shows.

    names: of the solver's settings. prefix: what scene.infrared puts before them.
    """
    labels = {name: infrared.bl_rna.properties[prefix + name].name for name in names}
    return "".join(labels.get(word, word) for word in re.findall(r"\w+|\W+", str(error)))


def read_defaults(infrared) -> tuple[float, Material]:
    """The temperature (K) of objects and the material of faces that have none of their own.

    Raises SceneError, naming their panel, if a value makes no sense.
    """
    check_temperature(infrared.ambient_temperature, f"Panel '{DEFAULTS}'")
    if not 0.0 <= infrared.default_emissivity <= 1.0:  # also NaN
        raise SceneError(f"Panel '{DEFAULTS}': emissivity {infrared.default_emissivity:g} is outside 0..1")
    return infrared.ambient_temperature, Material(name=DEFAULTS, emissivity=infrared.default_emissivity)


def as_typed(value):
    """A property's value as its user typed it: Blender keeps 293.15 as the float32 293.149994."""
    return float(f"{value:.7g}") if isinstance(value, float) else value
