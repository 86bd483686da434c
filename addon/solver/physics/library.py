# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials with a measured or computed spectral emissivity, each with its source.

The data are three tables beside this file, all plain CSV with a header row, which anyone can read and edit:

    library.csv          material, wavelength_um, emissivity: the points of each curve, wavelengths ascending
    library_sources.csv  material, category, kind, source, note: one row for each material

    optical_constants.csv  material, wavelength_um, n, k: of those whose emissivity was computed from one n and k

docs/materials.md shows them and says how they were made.

Artists keep materials of their own in another file, which the environment variable INFRARED_PHOTONS_LIBRARY names (the
add-on sets it to a file among Blender's data files of the user):

    material, wavelength_um, emissivity, source: the points of each curve; the source stands in its first row
"""

from __future__ import annotations

import csv
import logging
import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from ..scene import Material
from ..system.files import replacing
from .names import close_names, find_name

log = logging.getLogger(__name__)

POINTS_FILE = Path(__file__).with_name("library.csv")
SOURCES_FILE = Path(__file__).with_name("library_sources.csv")
CONSTANTS_FILE = Path(__file__).with_name("optical_constants.csv")
POINTS_HEADER = ["material", "wavelength_um", "emissivity"]
SOURCES_HEADER = ["material", "category", "kind", "source", "note"]
CONSTANTS_HEADER = ["material", "wavelength_um", "n", "k"]
USER_HEADER = [*POINTS_HEADER, "source"]
USER_VARIABLE = "INFRARED_PHOTONS_LIBRARY"  # environment variable: the file of the artist's own materials
COPIED = "my_materials_copied.txt"  # beside a file of the artist's materials: it was copied to another place
USER_CATEGORY = "my materials"

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

    name: what artists write; category: for menus; kind: a key of KINDS, or 'own' for an artist's material.
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
    """The materials that come with the add-on, by name, in the order of library_sources.csv. Read once and kept.

    Raises LibraryError if a table is missing or damaged.
    """
    return read(POINTS_FILE, SOURCES_FILE)


def user_file() -> Path | None:
    """The file of the artist's own materials, whether or not it exists yet; None if USER_VARIABLE names none."""
    path = os.environ.get(USER_VARIABLE)
    return Path(path) if path else None


def copy_once(earlier: Path, path: Path) -> None:
    """Copy the artist's materials from the file where they used to be kept, which stays as it is.

    Nothing happens if there is no such file, if there is a file at path, whatever it holds, or if it was copied before:
    a note beside it says so, as the artist may have deleted the copy since. Raises OSError if it cannot be copied.
    """
    note = earlier.with_name(COPIED)
    if path.exists() or note.exists() or not earlier.is_file():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path, "my materials") as unfinished:
        shutil.copyfile(earlier, unfinished)
    with suppress(OSError):  # it is copied all the same
        note.write_text(f"{earlier.name} was copied to {path}, which is the file that counts.\n", encoding="utf-8")
    log.info("My materials were copied from '%s' to '%s'", earlier, path)


def user_materials() -> dict[str, LibraryMaterial]:
    """The artist's own materials by name, in the order of their file; none without a file.

    The file is read anew whenever it has changed, even by another Blender. Raises LibraryError if it is damaged, or has
    a name that comes with the add-on.
    """
    path = user_file()
    try:
        status = path.stat() if path else None
    except FileNotFoundError:
        status = None
    except OSError as error:
        raise LibraryError(f"{path}: {error.strerror}") from error
    return _read_user(path, status.st_mtime_ns, status.st_size) if status else {}


def user_problem() -> str:
    """Why the artist's own materials cannot be read, or an empty text."""
    try:
        user_materials()
    except LibraryError as error:
        return str(error)
    return ""


def materials() -> dict[str, LibraryMaterial]:
    """All materials by name: those of the add-on, then the artist's own. A damaged file of the artist is left out, with
    a warning in the log, so that a render without the artist's materials goes on."""
    built_in = load()
    try:
        return built_in | user_materials()
    except LibraryError as error:
        _warn_once(f"My materials are ignored: {error}")
        return built_in


@cache
def _warn_once(message: str) -> None:
    log.warning(message)


def names() -> list[str]:
    """The names of all materials, sorted."""
    return sorted(materials(), key=str.casefold)


def get(name: str) -> LibraryMaterial:
    """The material called name, letter case ignored.

    Raises KeyError if there is none; its one argument is a message that suggests close names.
    """
    known = materials()
    found = find_name(name, known)
    if found is None:
        problem = user_problem()
        damage = f"; my materials cannot be read: {problem}" if problem else ""
        raise KeyError(f"the library has no material '{name}'{close_names(name, known)}{damage}")
    return known[found]


def find(name: str) -> np.ndarray:
    """The points of the material called name, letter case ignored: (n, 2) float64 [um, emissivity], read-only.

    Raises KeyError if there is none; its one argument is a message that suggests close names.
    """
    return get(name).points


@cache
def load_constants() -> dict[str, np.ndarray]:
    """Optical constants by name of the material, (n, 3) float64 [um, n, k], wavelengths ascending; read-only.

    Raises LibraryError if the table is damaged.
    """
    rows: dict[str, list[list[float]]] = {}
    for line, (name, *texts) in _rows(CONSTANTS_FILE, CONSTANTS_HEADER):
        try:
            rows.setdefault(name, []).append([float(text) for text in texts])
        except ValueError:
            raise LibraryError(f"{CONSTANTS_FILE}, line {line}: {', '.join(texts)} are not three numbers") from None
    tables = {name: np.array(table) for name, table in rows.items()}
    for table in tables.values():
        table.flags.writeable = False
    return tables


def find_constants(name: str) -> np.ndarray | None:
    """The optical constants of the material called name, letter case ignored: (n, 3) float64 [um, n, k], read-only.
    None if the library has none of it, or has no such material."""
    found = find_name(name, load_constants())
    return None if found is None else load_constants()[found]


def add_user_material(name: str, points: np.ndarray, source: str, replace: bool = False) -> None:
    """Keep a material among the artist's own, for every file and every later render.

    points: (n, 2) [wavelength um, emissivity 0..1], wavelengths ascending. source: where they come from.
    replace: overwrite the artist's material of this name.
    Raises LibraryError if the name is taken or empty, SceneError if the points are no emissivity, OSError if the file
    cannot be written.
    """
    name = " ".join(name.split())
    if not name:
        raise LibraryError("A material of the library needs a name")
    points = np.asarray(Material(name, emissivity=points).emissivity, dtype=np.float64)
    if name.casefold() in _folded(load()):
        raise LibraryError(f"'{name}' comes with the add-on; choose another name")
    kept = user_materials()
    same = [known for known in kept if known.casefold() == name.casefold()]
    if same and not replace:
        raise LibraryError(f"My materials have '{same[0]}' already; choose another name, or replace it")
    material = LibraryMaterial(name, USER_CATEGORY, "own", points, " ".join(source.split()), "")
    _write_user([known for known in kept.values() if known.name not in same] + [material])


def remove_user_material(name: str) -> None:
    """Remove one of the artist's own materials. Raises LibraryError if there is none of this name, OSError if the file
    cannot be written."""
    kept = user_materials()
    if name not in kept:
        raise LibraryError(f"'{name}' is none of my materials")
    _write_user([material for material in kept.values() if material.name != name])


def _folded(known) -> set[str]:
    return {name.casefold() for name in known}


@lru_cache(maxsize=1)
def _read_user(path: Path, _time: int, _size: int) -> dict[str, LibraryMaterial]:
    """The materials of the artist's file, which is read anew when the time of its last change or its size differ."""
    curves = _read_curves(path, USER_HEADER)
    sources, folded = {}, _folded(load())
    for line, (name, _, _, source) in _rows(path, USER_HEADER):
        if name not in sources and name.casefold() in folded:
            raise LibraryError(f"{path}, line {line}: '{name}' comes with the add-on or is listed twice; rename it")
        sources.setdefault(name, source)
        folded.add(name.casefold())
    return {name: LibraryMaterial(name, USER_CATEGORY, "own", curves[name], sources[name], "") for name in curves}


def _write_user(kept: list[LibraryMaterial]) -> None:
    path = user_file()
    if path is None:
        raise OSError(f"My materials have no place: the environment variable {USER_VARIABLE} names no file")
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path, "my materials") as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(USER_HEADER)
        for material in kept:
            for row, point in enumerate(material.points.tolist()):
                writer.writerow([material.name, *point, "" if row else material.source])
    _read_user.cache_clear()  # two changes can fall into one tick of the file system's clock


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


def _read_curves(path: Path, header: list[str] = POINTS_HEADER) -> dict[str, np.ndarray]:
    """(n, 2) read-only points by material name."""
    points: dict[str, list[tuple[float, float]]] = {}
    for line, (name, *texts) in _rows(path, header):
        texts = texts[:2]
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
