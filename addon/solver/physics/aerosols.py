# SPDX-License-Identifier: GPL-3.0-or-later
"""Aerosols by name: droplets of water, ice and soot, by their mass.

What a gram of each absorbs and scatters stands in aerosols.csv, whose header tells the sources; docs/gas.md says what
each is good for.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from ..scene import MOLECULES, SOOT, Medium, SceneError
from .names import close_names, find_name

AEROSOLS_FILE = Path(__file__).with_name("aerosols.csv")
_OPTICS = "absorption", "scattering", "anisotropy"  # of a Medium
Curve = tuple[np.ndarray, np.ndarray]  # wavelengths (n,) um, and values (n,)
HEADER = ["aerosol", "wavelength_um", "absorption_m2_per_g", "scattering_m2_per_g", "asymmetry"]


@cache
def aerosols() -> dict[str, np.ndarray]:
    """By name, in the order of the file: (n, 4) float64 of wavelength, um, absorption and scattering, m2/g, and
    asymmetry (mean cosine of the scattering angle). Linear between the points, constant outside."""
    tables = {}
    with AEROSOLS_FILE.open(newline="", encoding="utf-8") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            tables.setdefault(row[HEADER[0]], []).append([float(row[column]) for column in HEADER[1:]])
    return {name: np.array(rows) for name, rows in tables.items()}


def mix_in(medium: Medium, contents: Mapping[str, float]) -> Medium:
    """The medium with contents in it: mole fractions of molecules, volume fraction of soot, and aerosols, g/m3, by
    their names, letter case ignored. They add to what the medium has.

    Raises SceneError, naming the medium, for a name that is not known or an amount that makes no sense.
    """
    owner = f"Medium '{medium.name}'"
    gas = {name: amount for name, amount in contents.items() if name in (*MOLECULES, SOOT)}
    parts = []
    for name, grams in contents.items():
        if name in gas:
            continue
        found = find_name(name, aerosols())
        if found is None:
            hint = close_names(name, (*MOLECULES, SOOT, *aerosols()))
            raise SceneError(
                f"{owner}: unknown species '{name}'; known are {', '.join(MOLECULES)}, {SOOT} and the aerosols of the "
                f"library{hint}"
            )
        if not 0.0 <= grams < np.inf:  # also false for NaN
            raise SceneError(f"{owner}: {grams:g} g/m3 of {found}; it is finite and at least 0")
        wavelength, absorption, scattering, asymmetry = aerosols()[found].T
        amount = grams * medium.metres
        parts.append([(wavelength, each) for each in (amount * absorption, amount * scattering, asymmetry)])
    optics = _sum([[medium.curve(quantity) for quantity in _OPTICS], *parts]) if parts else {}
    return replace(medium, gas={**medium.gas, **gas}, **optics)


def _sum(parts: list[list[Curve]]) -> dict[str, np.ndarray]:
    """The curves (n, 2) of _OPTICS of all parts together, each given by its own: coefficients add, and asymmetries
    average by what each part scatters."""
    grid = np.unique(np.concatenate([curve[0] for part in parts for curve in part]))
    values = np.array([[np.interp(grid, *curve) for curve in part] for part in parts])
    absorption, scattering, asymmetry = values.swapaxes(0, 1)  # each (parts, len(grid))
    total = scattering.sum(axis=0)
    mean = (scattering * asymmetry).sum(axis=0) / np.where(total > 0.0, total, 1.0)
    columns = absorption.sum(axis=0), total, np.clip(mean, -1.0, 1.0)  # as rounding may lead beyond
    return {name: np.column_stack([grid, values]) for name, values in zip(_OPTICS, columns, strict=True)}
