# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixtures of gases by name. They stand in gases.csv, by row: mole fractions of molecules and volume fraction of soot,
by the chemistry that the note tells, and so round numbers. docs/gas.md shows them."""

from __future__ import annotations

import csv
import difflib
from functools import cache
from pathlib import Path

from ..scene import MOLECULES, SOOT

GASES_FILE = Path(__file__).with_name("gases.csv")


@cache
def gases() -> dict[str, dict[str, float]]:
    """The fractions of each mixture by species, by the mixture's name, in the order of the file."""
    with GASES_FILE.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    species = (*MOLECULES, SOOT)
    return {row["gas"]: {name: float(row[name]) for name in species if float(row[name])} for row in rows}


def find_gas(name: str) -> dict[str, float]:
    """The fractions of the mixture called name, letter case ignored.

    Raises KeyError if there is none; its one argument is a message that suggests close names.
    """
    by_folded_name = {known.casefold(): known for known in gases()}
    folded = name.strip().casefold()
    if folded not in by_folded_name:
        close = difflib.get_close_matches(folded, by_folded_name, n=3, cutoff=0.4)
        hint = "; close names: " + ", ".join(f"'{by_folded_name[match]}'" for match in close) if close else ""
        raise KeyError(f"the library has no gas '{name}'{hint}")
    return dict(gases()[by_folded_name[folded]])
