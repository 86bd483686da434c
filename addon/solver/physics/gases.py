# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixtures of gases by name. They stand in gases.csv, by row: mole fractions of molecules and volume fraction of soot,
by the chemistry that the note tells, and so round numbers; and an aerosol, g/m3. docs/gas.md shows them."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

from ..scene import MOLECULES, SOOT
from .names import close_names, find_name

GASES_FILE = Path(__file__).with_name("gases.csv")


@cache
def gases() -> dict[str, dict[str, float]]:
    """The fractions of each mixture by species, and g/m3 of its aerosol, by the mixture's name, in the order of the
    file; mix_in (see aerosols) takes them."""
    with GASES_FILE.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    species = (*MOLECULES, SOOT)
    mixtures = {row["gas"]: {name: float(row[name]) for name in species if float(row[name])} for row in rows}
    for row in rows:
        if row["aerosol"]:
            mixtures[row["gas"]][row["aerosol"]] = float(row["grams_per_m3"])
    return mixtures


def find_gas(name: str) -> dict[str, float]:
    """The contents of the mixture called name, letter case ignored, as in gases.

    Raises KeyError if there is none; its one argument is a message that suggests close names.
    """
    found = find_name(name, gases())
    if found is None:
        raise KeyError(f"the library has no gas '{name}'{close_names(name, gases())}")
    return dict(gases()[found])
