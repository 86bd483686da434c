# SPDX-License-Identifier: GPL-3.0-or-later
"""A thermal palette: black, indigo, magenta, red, orange, yellow, white, as thermal cameras paint iron.

The palette is laid out in CIE L*a*b* with a lightness L* that grows linearly from 0 to 100, so equal steps of the value
look equally large, and a print in grey keeps their order.
"""

from __future__ import annotations

import numpy as np

_SIZE = 1024  # colours in the table: four times what 8 bits of lightness can show
# Lightness L*, chroma and hue (degrees) in CIE L*a*b*; chroma stays inside the gamut of Rec.709 at that lightness.
_POINTS = np.array(
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


def _table() -> np.ndarray:
    """(_SIZE, 3) float32 linear Rec.709 colours, from the lowest value to the highest."""
    lightness = np.linspace(0.0, 100.0, _SIZE)
    chroma = np.interp(lightness, _POINTS[:, 0], _POINTS[:, 1])
    hue = np.radians(np.interp(lightness, _POINTS[:, 0], _POINTS[:, 2]))
    linear = _lab_to_linear(lightness, chroma * np.cos(hue), chroma * np.sin(hue))
    return np.clip(linear, 0.0, 1.0).astype(np.float32)


_COLOURS = _table()


def robust_range(values: np.ndarray) -> tuple[float, float]:
    """(low, high) that hold 99.8 % of the finite values of any shape, so that outliers do not flatten the picture.

    (0.0, 0.0) if no value is finite.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 0.0
    low, high = np.percentile(finite, (0.1, 99.9))
    return float(low), float(high)


def thermal(values: np.ndarray, low: float | None = None, high: float | None = None) -> np.ndarray:
    """Colours of values (any shape s, any unit): s + (3,) float32, linear Rec.709, 0..1 and always finite.

    low and high, in the unit of the values, get the ends of the palette; None takes that end from `robust_range`.
    Values outside get the nearer end, NaN gets the low end. A range narrower than float32 can resolve (a constant
    image) is widened, so that the image gets the middle of the palette.
    """
    values = np.asarray(values, dtype=np.float32)
    if low is None or high is None:
        robust_low, robust_high = robust_range(values)
        low = robust_low if low is None else low
        high = robust_high if high is None else high
    resolution = 4 * np.finfo(np.float32).eps * max(abs(low), abs(high))
    if abs(high - low) <= resolution:
        low, high = low - max(0.5, resolution), high + max(0.5, resolution)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite or far outside is settled below
        position = np.clip((values - np.float32(low)) * np.float32((_SIZE - 1) / (high - low)), 0, _SIZE - 1)
    position = np.where(np.isnan(position), 0, position)
    return _COLOURS[np.rint(position).astype(np.intp)]


def display(linear: np.ndarray) -> np.ndarray:
    """8-bit sRGB (uint8, same shape) of linear Rec.709 colours 0..1 (IEC 61966-2-1), for a PNG or a screen."""
    linear = np.clip(linear, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)
