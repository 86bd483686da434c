# SPDX-License-Identifier: GPL-3.0-or-later
"""What measuring tools read, as tables: for files with all figures, and short ones to be read."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..output.temperature_scale import TemperatureUnit, reading, span_reading
from ..solver.physics.correction import Correction
from ..solver.system.files import replacing
from .statistics import Measurement, difference

NO_VALUE = "no value"
KELVIN_DIGITS = 4  # decimals of temperatures in files: a tenth of a millikelvin
SHORT_TITLES = ("", "Tool", "Minimum", "Maximum", "Mean", "Deviation", "Area")


@dataclass(frozen=True)
class ToolReading:
    """A tool of a picture and what it reads there.

    number: from 1, as the picture shows it. kind: in words. frame, layer: of the picture. measurement: None if no pixel
    of the tool is there. correction: that its temperatures have. values: (n,) K in its pixels, of a line in their
    order; None where only the figures are kept. points: (u, v), shares of the picture's width and height.
    """

    number: int
    name: str
    kind: str
    frame: int
    layer: str
    measurement: Measurement | None
    correction: Correction
    values: np.ndarray | None = None
    points: tuple[tuple[float, float], ...] = ()


def columns(unit: TemperatureUnit) -> list[str]:
    """The titles of a table with all figures."""
    of = unit.symbol
    return [
        "Frame", "View Layer", "Number", "Name", "Kind",
        f"Minimum ({of})", f"Error of Minimum ({of})", f"Maximum ({of})", f"Error of Maximum ({of})",
        f"Mean ({of})", f"Error of Mean ({of})", f"Standard Deviation ({of})", "Pixels", "Share of Picture (%)",
        "Column of Minimum", "Row of Minimum", "Column of Maximum", "Row of Maximum", "Share in Isotherm (%)",
        "Emissivity", f"Reflected Temperature ({of})", "Air Transmission", f"Air Temperature ({of})",
        "Optics Transmission", f"Optics Temperature ({of})", "Points (u v)",
    ]  # fmt: skip


def row(tool: ToolReading, unit: TemperatureUnit) -> list[str]:
    """A tool's figures in the order of `columns`. What is unknown is empty: errors after a single pass, figures of a
    tool outside the picture or where no temperature fits. Rows and columns of pixels count from 0, at the lower left.
    """
    found, correction = tool.measurement, tool.correction
    figures = [""] * 14
    if found is not None:
        (low_row, low_column), (high_row, high_column) = found.place_of_minimum, found.place_of_maximum
        figures = [
            _kelvin(found.minimum, unit), _error(found.error_of_minimum, unit),
            _kelvin(found.maximum, unit), _error(found.error_of_maximum, unit),
            _kelvin(found.mean, unit), _error(found.error_of_mean, unit), _error(found.deviation, unit),
            str(found.count), f"{100.0 * found.area:.6g}",
            str(low_column), str(low_row), str(high_column), str(high_row),
            "" if found.in_isotherm is None else f"{100.0 * found.in_isotherm:.6g}",
        ]  # fmt: skip
    stated = [
        f"{correction.emissivity:.7g}", _kelvin(correction.reflected_temperature, unit),
        f"{correction.air_transmission:.7g}", _kelvin(correction.air_temperature, unit),
        f"{correction.optics_transmission:.7g}", _kelvin(correction.optics_temperature, unit),
    ]  # fmt: skip
    points = "; ".join(f"{u:.6g} {v:.6g}" for u, v in tool.points)
    return [str(tool.frame), tool.layer, str(tool.number), tool.name, tool.kind, *figures, *stated, points]


def write_table(path: str | os.PathLike, tools: Iterable[ToolReading], unit: TemperatureUnit) -> None:
    """Write tools to a CSV file, UTF-8 with a mark that spreadsheets look for, a row for each.

    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    with (
        replacing(Path(path), "the table of tools") as unfinished,
        open(unfinished, "w", newline="", encoding="utf-8-sig") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(columns(unit))
        writer.writerows(row(tool, unit) for tool in tools)


def short_row(tool: ToolReading, unit: TemperatureUnit) -> list[str]:
    """A tool's figures in the order of SHORT_TITLES, to be read; errors stand behind the temperatures."""
    found, title = tool.measurement, [str(tool.number), tool.name]
    if found is None:
        return [*title, "not rendered", "", "", "", ""]
    spot = found.count == 1
    ends = [
        reading(kelvin, error, unit)
        for kelvin, error in (
            (found.minimum, found.error_of_minimum),
            (found.maximum, found.error_of_maximum),
            (found.mean, found.error_of_mean),
        )
    ]
    ends = [NO_VALUE if each.startswith(NO_VALUE) else each for each in ends]
    if spot:
        return [*title, "", "", ends[2], "", "1 pixel"]
    deviation = _short(found.deviation, unit)
    return [*title, *ends, deviation, f"{found.count} pixels" if tool.kind == "Line" else f"{100.0 * found.area:.3g} %"]


def difference_text(first: ToolReading, second: ToolReading, unit: TemperatureUnit) -> str:
    """The mean of one tool less that of another, with its standard error as of independent readings."""
    one, other = first.measurement, second.measurement
    if one is None or other is None:
        return "not rendered"
    kelvin, error = difference(one, other)
    return span_reading(kelvin, error, unit) if math.isfinite(kelvin) else NO_VALUE


def by_tool(tools: Sequence[ToolReading]) -> dict[tuple[str, str], list[ToolReading]]:
    """Tools over frames by view layer and name, in the order of the frames."""
    grouped: dict[tuple[str, str], list[ToolReading]] = {}
    for tool in sorted(tools, key=lambda each: each.frame):
        grouped.setdefault((tool.layer, tool.name), []).append(tool)
    return grouped


def _kelvin(value: float, unit: TemperatureUnit) -> str:
    return f"{unit.of_kelvin(value):.{KELVIN_DIGITS}f}" if math.isfinite(value) else ""


def _error(value: float, unit: TemperatureUnit) -> str:
    return f"{unit.scale * value:.{KELVIN_DIGITS}f}" if math.isfinite(value) else ""


def _short(value: float, unit: TemperatureUnit) -> str:
    return span_reading(value, None, unit) if math.isfinite(value) else NO_VALUE
