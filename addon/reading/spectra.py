# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra from files: the ECOSTRESS (ASTER) and USGS libraries, and tables of two columns.

ECOSTRESS and ASTER (Baldridge et al. 2009, doi:10.1016/j.rse.2008.11.007; Meerdink et al. 2019,
doi:10.1016/j.rse.2019.05.015): lines `key: value`, then two columns, wavelength and value, often descending.
USGS Spectral Library Version 7, splib07 as ASCII (Kokaly et al. 2017, doi:10.3133/ds1035): one line with the record's
name, then one value a line; the wavelengths are such a file of their own, and -1.23e34 marks a deleted channel.

An opaque surface emits what it does not reflect (Kirchhoff): emissivity = 1 - reflectance, where the reflectance is
hemispherical, of light from one direction into all. Reflectance into one direction only approximates it, the better
the more evenly a surface scatters; such a spectrum says so in its remark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

SHORTEST, LONGEST = 0.1, 250.0  # um; what lies outside is in another unit: the libraries span 0.2 to 216 um
TOLERANCE = 0.02  # spectrometers are calibrated to one or two percent, so that a black sample may reflect -1 %
DELETED = -1.23e34  # USGS: this channel has no value
APPROXIMATE = "the file does not say that its reflectance is hemispherical; if it is not, the emissivity is approximate"

QUANTITIES = ("emissivity", "reflectance")
NOT_MICROMETRES = {"nanomet": "nanometres", "(nm": "nanometres", "_nm": "nanometres", "cm-1": "wavenumbers",
                   "wavenumber": "wavenumbers"}  # fmt: skip
UNITS = {"fraction": 1.0, "percent": 100.0}  # what counts as 1


class SpectrumError(ValueError):
    """A file is no spectrum that can be read; the message names the file, and the line and the value if one is bad."""


@dataclass(frozen=True)
class Spectrum:
    """A spectral emissivity from a file.

    name: of the sample. points: (n, 2) float64 [wavelength um, emissivity 0..1], wavelengths ascending, n at least 2.
    source: what file and sample it is, and how the emissivity follows. remark: what to mind, or an empty text.
    """

    name: str
    points: np.ndarray
    source: str
    remark: str = ""


@dataclass(frozen=True)
class _Row:
    line: int
    wavelength: float  # um
    value: float


def read_spectrum(
    path: Path, quantity: str = "emissivity", unit: str = "fraction", wavelengths: Path | None = None
) -> Spectrum:
    """The spectrum of a file in any of the formats; which one, its first lines tell.

    quantity: 'emissivity' or 'reflectance', unit: 'fraction' or 'percent': what the second column of a plain table is.
    wavelengths: the file of wavelengths of a USGS spectrum; None looks for it beside the file and one folder up.
    Raises SpectrumError, or OSError if a file cannot be opened.
    """
    lines = _read_lines(path)
    if "record=" in lines[0].lower():
        return _read_usgs(path, lines, wavelengths)
    if any(line.lower().startswith(("x units:", "y units:")) for line in lines[:100]):
        return _read_ecostress(path, lines)
    return _read_table(path, lines, quantity, unit)


def read_response(path: Path) -> np.ndarray:
    """The response of a sensor from a table of two columns: (n, 2) float64 [wavelength um, response], ascending.

    The responses may have any unit; values down to -2 % of the largest, as noise leaves them, count as 0.
    Raises SpectrumError, or OSError if the file cannot be opened.
    """
    lines, first, titles = _table(path, _read_lines(path))
    for sign, meaning in NOT_MICROMETRES.items():
        if sign in titles:
            raise SpectrumError(f"{path}, line {first}: the titles '{titles}' speak of {meaning}; expected um")
    rows = _ordered(path, _rows(path, lines, first))
    highest = max(row.value for row in rows)
    for row in rows:
        if not -TOLERANCE * highest <= row.value < math.inf:
            raise SpectrumError(f"{path}, line {row.line}: response {row.value:g} is not a finite number of 0 or more")
    if highest <= 0.0:
        raise SpectrumError(f"{path}: the response is 0 at every wavelength")
    return np.array([(row.wavelength, max(0.0, row.value)) for row in rows])


def _read_lines(path: Path) -> list[str]:
    """The lines of a text file, stripped."""
    data = path.read_bytes()
    if not data.strip():
        raise SpectrumError(f"{path}: the file is empty")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # the ECOSTRESS library; any bytes pass, so binary files are refused next
    odd = next((character for character in text if ord(character) < 32 and character not in "\t\r\n\f\x1a"), None)
    if odd is not None:
        raise SpectrumError(f"{path}: this is a binary file, not a text (it holds the byte {ord(odd)})")
    return [line.strip("\x1a\f \t\r") for line in text.split("\n")]


def _words(line: str) -> list[str]:
    """What blanks, commas or semicolons separate."""
    return line.replace(",", " ").replace(";", " ").split()


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _starts_with_number(line: str) -> bool:
    words = _words(line)
    return bool(words) and _number(words[0]) is not None


def _rows(path: Path, lines: list[str], first: int) -> list[_Row]:
    """Wavelength and value of each line from index `first` on; blank lines are passed over."""
    rows = []
    for index in range(first, len(lines)):
        words = _words(lines[index])
        if not words:
            continue
        numbers = [_number(word) for word in words]
        if len(words) != 2 or None in numbers:
            raise SpectrumError(
                f"{path}, line {index + 1}: '{lines[index][:60]}' is not two numbers, a wavelength in um and a value"
            )
        rows.append(_Row(index + 1, *numbers))
    return rows


def _points(path: Path, rows: list[_Row], quantity: str, unit: str) -> np.ndarray:
    """(n, 2) float64 [um, emissivity], ascending, of rows in any order."""
    whole = UNITS[unit]
    rows = _ordered(path, rows)
    for row in rows:
        if not -TOLERANCE * whole <= row.value <= (1.0 + TOLERANCE) * whole:
            raise SpectrumError(f"{path}, line {row.line}: {quantity} {row.value:g} is outside 0..{whole:g} ({unit})")
    values = np.clip([row.value / whole for row in rows], 0.0, 1.0)
    emissivity = values if quantity == "emissivity" else 1.0 - values
    return np.column_stack(([row.wavelength for row in rows], emissivity))


def _ordered(path: Path, rows: list[_Row]) -> list[_Row]:
    """Rows by wavelength: two or more, in um and each once."""
    for row in rows:
        if not SHORTEST <= row.wavelength <= LONGEST:  # also refuses NaN
            raise SpectrumError(
                f"{path}, line {row.line}: wavelength {row.wavelength:g} is outside {SHORTEST:g}..{LONGEST:g} um; "
                "nanometres and wavenumbers must be converted first"
            )
    if len(rows) < 2:
        raise SpectrumError(f"{path}: a spectrum needs two points or more, this file has {len(rows)}")
    rows = sorted(rows, key=lambda row: row.wavelength)
    for before, after in pairwise(rows):
        if before.wavelength == after.wavelength:
            first, second = sorted((before.line, after.line))
            raise SpectrumError(
                f"{path}, line {second}: wavelength {after.wavelength:g} um stands in line {first} already"
            )
    return rows


def _how(quantity: str) -> str:
    return "emissivity as given" if quantity == "emissivity" else "emissivity = 1 - reflectance"


# ECOSTRESS and ASTER --------------------------------------------------------------------------------------------------


def _read_ecostress(path: Path, lines: list[str]) -> Spectrum:
    first = next((i for i, line in enumerate(lines) if ":" not in line and _starts_with_number(line)), len(lines))
    header = {}
    for line in lines[:first]:
        key, colon, value = line.partition(":")
        if colon:
            header.setdefault(key.strip().lower(), value.strip())
    for key in ("x units", "y units", "number of x values"):
        if not header.get(key):
            raise SpectrumError(f"{path}: the header has no '{key.title()}'")
    if "micromet" not in header["x units"].lower():
        raise SpectrumError(f"{path}: X Units are '{header['x units']}', expected Wavelength (micrometers)")
    y_units = header["y units"].lower()
    quantity = next((quantity for quantity in QUANTITIES if quantity[:7] in y_units), None)  # some say 'Reflectence'
    unit = next((unit for unit in UNITS if unit in y_units), None)
    if quantity is None or unit is None:
        raise SpectrumError(f"{path}: Y Units are '{header['y units']}', expected Reflectance (percentage)")
    rows = _rows(path, lines, first)
    declared = header["number of x values"]
    if _number(declared) != len(rows):
        raise SpectrumError(f"{path}: the header announces {declared} values, the file has {len(rows)}")
    measurement = header.get("measurement", "")
    name = header.get("name") or path.stem
    parts = [name, header.get("sample no.", ""), header.get("owner", ""), measurement, f"file {path.name}"]
    hemispherical = quantity == "emissivity" or "hemispherical" in measurement.lower()
    return Spectrum(
        name=name,
        points=_points(path, rows, quantity, unit),
        source=", ".join(part for part in parts if part) + f"; {_how(quantity)}",
        remark="" if hemispherical else APPROXIMATE,
    )


# USGS -----------------------------------------------------------------------------------------------------------------


def _read_usgs(path: Path, lines: list[str], wavelengths: Path | None) -> Spectrum:
    record, _, title = lines[0].partition(":")
    words = title.split()
    if not words:
        raise SpectrumError(f"{path}, line 1: '{lines[0]}' has no name after the record's number")
    if "wavelength" in title.lower() or "bandpass" in title.lower():
        raise SpectrumError(f"{path}: this file lists the channels' {words[0].lower()}; choose a spectrum")
    if words[-1] in ("RREF", "RTGC", "TRAN"):
        raise SpectrumError(f"{path}, line 1: '{words[-1]}' is no absolute reflectance (AREF)")
    values = _read_channels(path, lines)
    found = wavelengths or _find_wavelengths(path, len(values))
    at = _read_channels(found, _read_lines(found))
    if len(at) != len(values):
        raise SpectrumError(f"{path} has {len(values)} channels, '{found}' {len(at)} wavelengths")
    rows = [
        _Row(line, wavelength, value)
        for (line, value), (_, wavelength) in zip(values, at, strict=True)
        if not math.isclose(value, DELETED, rel_tol=1e-5) and not math.isclose(wavelength, DELETED, rel_tol=1e-5)
    ]
    name = " ".join(words[:-2] if words[-1] == "AREF" and len(words) > 2 else words)
    source = f"USGS Spectral Library Version 7, {record}: {' '.join(words)}, file {path.name}; {_how('reflectance')}"
    return Spectrum(name, _points(path, rows, "reflectance", "fraction"), source, APPROXIMATE)


def _read_channels(path: Path, lines: list[str]) -> list[tuple[int, float]]:
    """(line, value) of each channel: one number a line under the first line."""
    channels = []
    for index in range(1, len(lines)):
        if lines[index]:
            value = _number(lines[index])
            if value is None:
                raise SpectrumError(f"{path}, line {index + 1}: '{lines[index][:60]}' is not a number")
            channels.append((index + 1, value))
    return channels


def _find_wavelengths(path: Path, count: int) -> Path:
    """The one file of wavelengths with as many channels, beside the spectrum or, as USGS ships them, one folder up."""
    candidates = [
        file
        for folder in (path.parent, path.parent.parent)
        for file in sorted(folder.glob("*.txt"))
        if "wavelength" in file.name.lower() and len(_read_channels(file, _read_lines(file))) == count
    ]
    if len(candidates) != 1:
        found = ", ".join(f"'{file.name}'" for file in candidates) or "none"
        raise SpectrumError(
            f"{path}: its {count} wavelengths are in a file of their own; beside it and one folder up, {found} fits. "
            "Choose the file"
        )
    return candidates[0]


# Tables ---------------------------------------------------------------------------------------------------------------


def _read_table(path: Path, lines: list[str], quantity: str, unit: str) -> Spectrum:
    """Two columns, after one line of titles if the file has one, and lines that start with #."""
    lines, first, titles = _table(path, lines)
    if titles:
        _check_titles(path, first, titles, quantity, unit)
    rows = _rows(path, lines, first)
    points = _points(path, rows, quantity, unit)
    if unit == "percent":
        _check_percent(path, rows)
    return Spectrum(path.stem, points, f"file {path.name}; {_how(quantity)}")


def _table(path: Path, lines: list[str]) -> tuple[list[str], int, str]:
    """The lines without comments, the index of the first row of numbers, and the titles right above it or ''."""
    lines = ["" if line.startswith("#") else line for line in lines]
    first = next(i for i, line in enumerate([*lines, "end"]) if line)
    if first == len(lines):
        raise SpectrumError(f"{path}: the file has only comments")
    return (lines, first, "") if _starts_with_number(lines[first]) else (lines, first + 1, lines[first].lower())


def _check_titles(path: Path, line: int, titles: str, quantity: str, unit: str) -> None:
    """Refuse titles that contradict what the columns are said to be."""
    strange = NOT_MICROMETRES | {"transmi": "transmittance"}
    strange |= {"%": "percent", "percent": "percent"} if unit == "fraction" else {"fraction": "fractions"}
    if quantity[:7] not in titles:  # 'reflect' also stands in reflectivity, 'emissiv' in emissivities
        strange |= {other[:7]: other for other in QUANTITIES if other != quantity}
    for sign, meaning in strange.items():
        if sign in titles:
            raise SpectrumError(
                f"{path}, line {line}: the titles '{titles}' speak of {meaning}, but the columns are said to be "
                f"wavelength in um and {quantity} as {unit}"
            )


def _check_percent(path: Path, rows: list[_Row]) -> None:
    """Refuse fractions that are said to be percent, and a mixture of both: 0.95 beside 95. As no fraction exceeds 1, a
    mixture the other way round is outside the range."""
    if max(row.value for row in rows) <= 1.0:
        raise SpectrumError(f"{path}: no value exceeds 1 percent; they look like fractions")
    for before, after in pairwise(rows):
        low, high = sorted((before, after), key=lambda row: row.value)
        if low.value <= 1.0 and high.value >= 50.0:
            raise SpectrumError(
                f"{path}, line {after.line}: {after.value:g} follows {before.value:g}; fractions and percent look mixed"
            )
