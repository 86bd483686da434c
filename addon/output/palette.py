# SPDX-License-Identifier: GPL-3.0-or-later
"""Thermal palettes: which colour stands for which share of a range.

Iron, White Hot and Black Hot are laid out in CIE L*a*b* with a lightness L* that changes linearly, so equal steps of
the value look equally bright, and a print in grey keeps their order. Viridis and Inferno go through the colours that
S. van der Walt and N. Smith made for matplotlib (2015, CC0) at equal steps of the distance in CIE L*a*b* (CIE 1976), so
that equal steps of the value look equally large. Rainbow follows the hues and promises nothing: bands of one hue hide
small differences, and yellow is brighter than the red above it.
"""

from __future__ import annotations

import numpy as np

_SIZE = 1024  # colours in the table: four times what 8 bits of lightness can show
# Iron: black, indigo, magenta, red, orange, yellow, white. Lightness L*, chroma and hue (degrees) in CIE L*a*b*; chroma
# stays inside the gamut of Rec.709 at that lightness.
_IRON = np.array(
    [
        (0.0, 0.0, 290.0),
        (8.0, 30.0, 292.0),
        (20.0, 62.0, 302.0),
        (32.0, 72.0, 316.0),
        (43.0, 72.0, 350.0),
        (53.0, 78.0, 387.0),
        (65.0, 74.0, 412.0),
        (77.0, 74.0, 434.0),
        (89.0, 74.0, 456.0),
        (100.0, 0.0, 465.0),
    ]
)
# 8-bit sRGB
_VIRIDIS = "440154 482878 3e4a89 31688e 26828e 1f9e89 35b779 6dcd59 b4de2c fde725"
_INFERNO = "000004 1b0c42 4b0c6b 781c6d a52c60 cf4446 ed6925 fb9a06 f7d03c fcffa4"
_RAINBOW = "000080 0000ff 00ffff 00ff00 ffff00 ff0000 800000"
_WHITE = np.array([0.95047, 1.0, 1.08883])  # XYZ of D65, the white of Rec.709
_XYZ_TO_LINEAR = np.array(  # IEC 61966-2-1
    [
        (3.2404542, -1.5371385, -0.4985314),
        (-0.9692660, 1.8760108, 0.0415560),
        (0.0556434, -0.2040259, 1.0572252),
    ]
)


def _lab_to_linear(lightness: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n, 3) linear Rec.709, not clipped, of n colours in CIE L*a*b* (CIE 15)."""
    y = (lightness + 16.0) / 116.0
    f = np.stack((y + a / 500.0, y, y - b / 200.0), axis=-1)
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29)) * _WHITE
    return xyz @ _XYZ_TO_LINEAR.T


def _linear_to_lab(linear: np.ndarray) -> np.ndarray:
    """(n, 3) CIE L*a*b* of linear Rec.709 colours, the inverse of `_lab_to_linear`."""
    ratio = linear @ np.linalg.inv(_XYZ_TO_LINEAR).T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack((116.0 * f[:, 1] - 16.0, 500.0 * (f[:, 0] - f[:, 1]), 200.0 * (f[:, 1] - f[:, 2])), axis=-1)


def _table(linear: np.ndarray) -> np.ndarray:
    """Colours (_SIZE, 3), from the lowest value to the highest, as a table that stays as it is: float32 in 0..1."""
    table = np.clip(linear, 0.0, 1.0).astype(np.float32)
    table.flags.writeable = False
    return table


def _iron() -> np.ndarray:
    lightness = np.linspace(0.0, 100.0, _SIZE)
    chroma = np.interp(lightness, _IRON[:, 0], _IRON[:, 1])
    hue = np.radians(np.interp(lightness, _IRON[:, 0], _IRON[:, 2]))
    return _table(_lab_to_linear(lightness, chroma * np.cos(hue), chroma * np.sin(hue)))


def _grey(first: float, last: float) -> np.ndarray:
    """Greys between two values of the lightness L*."""
    return _table(_lab_to_linear(np.linspace(first, last, _SIZE), np.zeros(_SIZE), np.zeros(_SIZE)))


def _even(colours: str) -> np.ndarray:
    """The way through the colours by straight lines in CIE L*a*b*, at equal steps of its length."""
    corners = _linear_to_lab(linear(_from_hex(colours)))
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    steps = np.linspace(0.0, length[-1], _SIZE)
    return _table(_lab_to_linear(*(np.interp(steps, length, axis) for axis in corners.T)))


def _rainbow() -> np.ndarray:
    """The way through the colours by straight lines in sRGB."""
    corners = _from_hex(_RAINBOW)
    position = np.linspace(0.0, len(corners) - 1.0, _SIZE)
    mixed = np.stack([np.interp(position, np.arange(len(corners)), channel) for channel in corners.T], axis=-1)
    return _table(linear(mixed))


def _from_hex(colours: str) -> np.ndarray:
    """(n, 3) sRGB 0..1 of colours such as '440154 482878'."""
    return np.array([list(bytes.fromhex(colour)) for colour in colours.split()]) / 255.0


def linear(encoded: np.ndarray) -> np.ndarray:
    """Linear Rec.709 of sRGB colours, both 0..1, any shape (IEC 61966-2-1)."""
    encoded = np.asarray(encoded, dtype=np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


# Name -> (_SIZE, 3) float32 linear Rec.709 colours, from the lowest value to the highest.
PALETTES = {
    "IRON": _iron(),
    "RAINBOW": _rainbow(),
    "WHITE_HOT": _grey(0.0, 100.0),
    "BLACK_HOT": _grey(100.0, 0.0),
    "VIRIDIS": _even(_VIRIDIS),
    "INFERNO": _even(_INFERNO),
}


def robust_range(values: np.ndarray) -> tuple[float, float]:
    """(low, high) that hold 99.8 % of the finite values of any shape, so that outliers do not flatten the picture.

    (0.0, 0.0) if no value is finite.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 0.0
    low, high = np.percentile(finite, (0.1, 99.9))
    return float(low), float(high)


def spread(low: float, high: float) -> tuple[float, float]:
    """The range in ascending order. One narrower than float32 can resolve (a constant image) is widened by 0.5 to each
    side at least, so that the image gets the middle of the palette.
    """
    low, high = min(low, high), max(low, high)
    resolution = 4 * np.finfo(np.float32).eps * max(abs(low), abs(high))
    if high - low <= resolution:
        low, high = low - max(0.5, resolution), high + max(0.5, resolution)
    return low, high


def thermal(
    values: np.ndarray, low: float | None = None, high: float | None = None, palette: str = "IRON"
) -> np.ndarray:
    """Colours of values (any shape s, any unit): s + (3,) float32, linear Rec.709, 0..1 and always finite.

    low and high get the ends of the palette, a name in PALETTES, as `spread` makes them; None takes that end from
    `robust_range` of the values. Values outside get the nearer end, NaN gets the low end.
    """
    values = np.asarray(values, dtype=np.float32)
    if low is None or high is None:
        robust = robust_range(values)
        low, high = robust[0] if low is None else low, robust[1] if high is None else high
    low, high = spread(low, high)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite or far outside is settled below
        position = np.clip((values - np.float32(low)) * np.float32((_SIZE - 1) / (high - low)), 0, _SIZE - 1)
    position = np.where(np.isnan(position), 0, position)
    return PALETTES[palette].take(np.rint(position).astype(np.intp), axis=0)  # of one value, too, no view of the table


def display(linear: np.ndarray) -> np.ndarray:
    """8-bit sRGB (uint8, same shape) of linear Rec.709 colours 0..1 (IEC 61966-2-1), for a PNG or a screen."""
    linear = np.clip(linear, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)
