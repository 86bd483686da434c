# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as their user typed them, and messages with the names that the interface shows."""

from __future__ import annotations

import re
from collections.abc import Mapping


def as_shown(error: Exception, infrared, properties: Mapping[str, str]) -> str:
    """The solver's message about its settings, with their names replaced by the labels that the interface shows.

    properties: of scene.infrared, by the solver's name.
    """
    labels = {name: infrared.bl_rna.properties[shown].name for name, shown in properties.items()}
    return "".join(labels.get(word, word) for word in re.findall(r"\w+|\W+", str(error)))


def as_typed(value):
    """A property's value as its user typed it: Blender keeps 293.15 as the float32 293.149994."""
    return float(f"{value:.7g}") if isinstance(value, float) else value
