# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials with a measured or computed spectral emissivity, each with its source.

The data are two tables beside this file, both plain CSV with a header row, to be read and edited by anyone:

    library.csv          material, wavelength_um, emissivity: the points of each curve, wavelengths ascending
    library_sources.csv  material, category, kind, source, note: one row for each material

docs/materials.md shows them and says how they were made.
"""

from __future__ import annotations

import csv
import difflib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

POINTS_FILE = Path(__file__).with_name("library.csv")
SOURCES_FILE = Path(__file__).with_name("library_sources.csv")
POINTS_HEADER = ["material", "wavelength_um", "emissivity"]
SOURCES_HEADER = ["material", "category", "kind", "source", "note"]

KINDS = {
    "computed": "from published optical constants by Fresnel's equations, for a smooth surface of an opaque body",
    "measured": "a published spectrum, resampled",
    "band": "published values for whole bands, drawn flat across each band",
}


class LibraryError(ValueError):
    """A table of the library is damaged; the message names the file and the line."""


@dataclass(frozen=True)
class LibraryMaterial:
    """One material of the library. The emissivity is spectral and directional, along the surface normal or near it.

    name: what artists write; category: for menus; kind: a key of KINDS.
    points: (n, 2) float64 [wavelength um, emissivity 0..1], wavelengths ascending; read-only.
    source: the publication the numbers come from. note: how they were derived and where they hold.
    """

    name: str
    category: str
    kind: str
    points: np.ndarray
    source: str
    note: str


@cache
def load() -> dict[str, LibraryMaterial]:
    """All materials by name, in the order of library_sources.csv. Read once and kept.

    Raises LibraryError if a table is missing or damaged.
    """
    return read(POINTS_FILE, SOURCES_FILE)


def names() -> list[str]:
    """The names of all materials, sorted."""
    return sorted(load(), key=str.casefold)


def find(name: str) -> np.ndarray:
    """The points of the material called name, letter case ignored: (n, 2) float64 [um, emissivity], read-only.

    Raises KeyError if there is none; its one argument is a message that suggests close names.
    """
    by_folded_name = {known.casefold(): material for known, material in load().items()}
    folded = name.strip().casefold()
    if folded not in by_folded_name:
        close = difflib.get_close_matches(folded, by_folded_name, n=3, cutoff=0.4)
        hint = "; close names: " + ", ".join(f"'{by_folded_name[match].name}'" for match in close) if close else ""
        raise KeyError(f"the library has no material '{name}'{hint}")
    return by_folded_name[folded].points


def read(points_file: Path, sources_file: Path) -> dict[str, LibraryMaterial]:
    """The materials of two tables laid out like library.csv and library_sources.csv, by name.

    Raises LibraryError if a table is missing or damaged.
    """
    curves = _read_curves(points_file)
    materials = {}
    for line, row in _rows(sources_file, SOURCES_HEADER):
        name, category, kind, source, note = row
        if name.casefold() in {known.casefold() for known in materials}:
            raise LibraryError(f"{sources_file}, line {line}: material '{name}' is listed twice")
        if not source:
            raise LibraryError(f"{sources_file}, line {line}: material '{name}' has no source")
        if kind not in KINDS:
            raise LibraryError(f"{sources_file}, line {line}: kind is '{kind}', expected {', '.join(KINDS)}")
        if name not in curves:
            raise LibraryError(f"{sources_file}, line {line}: material '{name}' has no points in {points_file.name}")
        materials[name] = LibraryMaterial(name, category, kind, curves.pop(name), source, note)
    for name in curves:
        raise LibraryError(f"{points_file}: material '{name}' is not listed in {sources_file.name}")
    return materials


def _read_curves(path: Path) -> dict[str, np.ndarray]:
    """(n, 2) read-only points by material name."""
    points: dict[str, list[tuple[float, float]]] = {}
    for line, (name, *texts) in _rows(path, POINTS_HEADER):
        try:
            wavelength, emissivity = (float(text) for text in texts)
        except ValueError:
            raise LibraryError(f"{path}, line {line}: {', '.join(texts)} are not two numbers") from None
        if not 0.0 <= emissivity <= 1.0:  # also refuses NaN
            raise LibraryError(f"{path}, line {line}: emissivity {emissivity:g} is outside 0..1")
        curve = points.setdefault(name, [])
        shortest = curve[-1][0] if curve else 0.0
        if not shortest < wavelength < np.inf:
            raise LibraryError(
                f"{path}, line {line}: wavelength {wavelength:g} um of '{name}' must be finite and above {shortest:g}"
            )
        curve.append((wavelength, emissivity))
    curves = {name: np.array(curve) for name, curve in points.items()}
    for curve in curves.values():
        curve.flags.writeable = False
    return curves


def _rows(path: Path, header: list[str]):
    """(line number, stripped fields) of each row under the header."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file, strict=True)
            if next(reader, None) != header:
                raise LibraryError(f"{path}, line 1: the header must be {','.join(header)}")
            for row in reader:
                fields = [field.strip() for field in row]
                if len(fields) != len(header) or not fields[0]:
                    raise LibraryError(f"{path}, line {reader.line_num}: expected {', '.join(header)}, got {row}")
                yield reader.line_num, fields
    except OSError as error:
        raise LibraryError(f"{path}: {error.strerror}") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise LibraryError(f"{path}, line {reader.line_num}: {error}") from error
