# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures over a surface from weights, colours, images and measured points: arithmetic on arrays, no Blender."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from ..solver.scene import SceneError, check_temperature

# Columns of a file of points -> how its header may call them; ParaView calls coordinates Points:0 or Points_0.
COLUMNS = {
    "x": {"x", "points:0", "points_0"},
    "y": {"y", "points:1", "points_1"},
    "z": {"z", "points:2", "points_2"},
    "temperature": {"temperature", "temp", "t"},
}
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear Rec.709 (ITU-R BT.709)


class TemperatureError(ValueError):
    """Temperatures cannot be made; the message names the object or file and the value."""


def spread(shares: np.ndarray, low: float, high: float) -> np.ndarray:
    """Kelvin of shares of a range: 0 is low, 1 is high (K), linear within and outside it."""
    shares = np.asarray(shares, dtype=np.float64)
    return low * (1.0 - shares) + high * shares


def check_kelvin(values: np.ndarray, owner: str) -> None:
    """Raise TemperatureError unless the engine can render all values (K); owner names their source."""
    try:
        for value in (values.min(), values.max()) if values.size else ():  # NaN is both
            check_temperature(value, owner)
    except SceneError as error:
        raise TemperatureError(str(error)) from None


def pick_channel(colours: np.ndarray, channel: str) -> np.ndarray:
    """(n,) float32 of colours (n, c): their LUMINANCE, or the channel R, G, B or A. One channel is grey."""
    count = colours.shape[1]
    if channel == "A":
        return colours[:, -1] if count in (2, 4) else np.ones(len(colours), np.float32)
    if count < 3:
        return colours[:, 0]
    return colours[:, :3] @ LUMINANCE.astype(np.float32) if channel == "LUMINANCE" else colours[:, "RGB".index(channel)]


def sample_image(pixels: np.ndarray, uv: np.ndarray, extension: str, closest: bool = False) -> np.ndarray:
    """(n,) float64 of an image (h, w), row 0 at the bottom, at (n, 2) UV coordinates, looked up as a solver's Texture.

    The image spans 0..1. Outside it an extension CLIP gives NaN, as do coordinates that are not finite.
    """
    size = np.array(pixels.shape[::-1])
    position = uv.astype(np.float64) * size - (0.0 if closest else 0.5)  # pixel i has its centre at (i + 0.5) / size
    outside = (uv < 0.0) | (uv > 1.0) if extension == "CLIP" else False
    position[~np.isfinite(position) | outside] = np.nan  # and so are the fraction and the result
    cell = np.floor(np.nan_to_num(position))
    fraction = position - cell
    if closest:
        fraction *= 0.0
    corners = [_pixels_at(c, size, extension) for c in (cell, cell + 1)]
    (x0, y0), (x1, y1) = (c.astype(np.int64).T for c in corners)
    u, v = fraction.T
    below = pixels[y0, x0] * (1.0 - u) + pixels[y0, x1] * u
    above = pixels[y1, x0] * (1.0 - u) + pixels[y1, x1] * u
    return below * (1.0 - v) + above * v


def _pixels_at(cell: np.ndarray, size: np.ndarray, extension: str) -> np.ndarray:
    """The pixels (n, 2) of an image of a size that are at the places of pixels, which may be outside it."""
    if extension == "REPEAT":
        return np.mod(cell, size)
    if extension == "MIRROR":
        cell = np.mod(cell, 2 * size)
        return np.minimum(cell, 2 * size - 1 - cell)
    return np.clip(cell, 0, size - 1)


def inverse_distance(distances: np.ndarray, values: np.ndarray, power: float, reach: float, otherwise) -> np.ndarray:
    """(n,) float64 means of the values (n, k) of the k nearest samples, weighted with distance^-power (Shepard 1968).

    distances: (n, k). A sample at distance 0 counts alone. Samples farther than reach do not count; where none is left
    the result is `otherwise`.
    """
    near = distances <= reach
    nearest = distances.min(axis=1, keepdims=True)
    exact = nearest == 0.0
    # relative to the nearest, so that no power of a small distance overflows
    ratio = np.divide(nearest, distances, out=np.ones_like(distances), where=distances > 0)
    weights = np.where(exact, distances == 0.0, near * ratio**power)
    total = weights.sum(axis=1)
    found = total > 0
    return np.where(found, (weights * values).sum(axis=1) / np.where(found, total, 1.0), otherwise)


def read_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and temperatures (n,), float64 in the file's units, of a text file with one sample a line.

    Values stand between commas, semicolons, tabs or spaces. A header names the columns as in COLUMNS, in any order and
    with a unit in brackets if it likes; without a header, or with one that names none of them, they are the first four.
    Empty lines and those that start with # or % are skipped. Raises TemperatureError, naming file, line and value.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TemperatureError(f"File '{path.name}' cannot be read as text: {error}") from error
    numbered = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and line.strip()[0] not in "#%"]
    if not numbered:
        raise TemperatureError(f"File '{path.name}' holds no values")
    first = re.sub(r"[\[(].*?[\])]", "", numbered[0][1])  # without units in brackets
    split = _splitter(first)
    columns, header = _columns(split(first), path.name)
    samples = [_sample(split(line), columns, path.name, i) for i, line in numbered[header:]]
    if not samples:
        raise TemperatureError(f"File '{path.name}' holds a header but no values")
    table = np.array(samples)
    if not np.isfinite(table[:, :3]).all():
        wrong = np.count_nonzero(~np.isfinite(table[:, :3]).all(axis=1))
        raise TemperatureError(f"File '{path.name}': {wrong} of {len(table)} positions are not finite")
    return table[:, :3], table[:, 3]


def _splitter(line: str):
    """The function that splits lines like this one into cells."""
    for delimiter in ";\t,":
        if delimiter in line:
            return lambda text: next(csv.reader([text], delimiter=delimiter))
    return str.split


def _number(cell: str) -> float | None:
    """The cell as a number, with a decimal point or a decimal comma; None if it is none."""
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return None


def _columns(cells: list[str], name: str) -> tuple[list[int], bool]:
    """Where x, y, z and temperature stand, and whether this first line is a header."""
    if all(_number(cell) is not None for cell in cells):
        return [0, 1, 2, 3], False
    titles = [cell.strip().lower() for cell in cells]
    found = {key: next((i for i, t in enumerate(titles) if t in known), None) for key, known in COLUMNS.items()}
    missing = [key for key, index in found.items() if index is None]
    if len(missing) == len(COLUMNS):
        return [0, 1, 2, 3], True
    if missing:
        raise TemperatureError(
            f"File '{name}': its header has no column {' and no '.join(missing)}: {', '.join(cells)}"
        )
    return list(found.values()), True


def _sample(cells: list[str], columns: list[int], name: str, line: int) -> list[float]:
    """x, y, z and temperature of one line."""
    if len(cells) <= max(columns):
        raise TemperatureError(f"File '{name}', line {line}: {len(cells)} columns, expected {max(columns) + 1}")
    values = [_number(cells[i]) for i in columns]
    if None in values:
        raise TemperatureError(f"File '{name}', line {line}: '{cells[columns[values.index(None)]]}' is no number")
    return values
