# SPDX-License-Identifier: GPL-3.0-or-later
"""Which colour stands for which temperature, and how temperatures are written: units, ticks of a bar, readings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .palette import linear, robust_range, spread, thermal

TICKS = 8  # most of them on a bar


@dataclass(frozen=True)
class TemperatureUnit:
    """A unit of temperature: value = scale * kelvin + offset."""

    symbol: str
    scale: float = 1.0
    offset: float = 0.0

    def of_kelvin(self, kelvin):
        """A temperature (number or array, K) in this unit."""
        return self.scale * kelvin + self.offset

    def in_kelvin(self, value):
        """A temperature (number or array) of this unit in K."""
        return (value - self.offset) / self.scale

    def text(self, kelvin: float) -> str:
        """A temperature (K) in this unit with two decimals, such as '31.42 °C'."""
        return f"{self.of_kelvin(kelvin):.2f} {self.symbol}"


KELVIN = TemperatureUnit("K")
CELSIUS = TemperatureUnit("°C", 1.0, -273.15)
FAHRENHEIT = TemperatureUnit("°F", 1.8, -459.67)
UNITS = {"KELVIN": KELVIN, "CELSIUS": CELSIUS, "FAHRENHEIT": FAHRENHEIT}  # by Blender's names


@dataclass(frozen=True)
class Isotherm:
    """Temperatures from low to high, both included, K, in one colour (sRGB 0..1). grey: what is outside is in grey."""

    low: float
    high: float
    colour: tuple[float, float, float]
    grey: bool = False


@dataclass(frozen=True)
class TemperatureScale:
    """The colour of each temperature: a palette (a name in PALETTES) from low to high, K, and an isotherm or None.

    None for low or high takes that end from the image that is painted, see automatic_range.
    """

    palette: str = "IRON"
    low: float | None = None
    high: float | None = None
    isotherm: Isotherm | None = None

    def fitted(self, temperature: np.ndarray) -> TemperatureScale:
        """The same scale with both ends in ascending order, for an image in K of any shape; rows and columns last."""
        if self.low is None or self.high is None:
            return self.between(*automatic_range(temperature))
        return self.between(self.low, self.high)

    def between(self, coldest: float, hottest: float) -> TemperatureScale:
        """The same scale with both ends in ascending order; these temperatures, K, are the ends that it lacks."""
        low, high = coldest if self.low is None else self.low, hottest if self.high is None else self.high
        low, high = spread(low, high)
        return replace(self, low=low, high=high)

    def colours(self, temperature: np.ndarray) -> np.ndarray:
        """Colours of temperatures (any shape s, K): s + (3,) float32, linear Rec.709."""
        isotherm = self.isotherm
        palette = "WHITE_HOT" if isotherm and isotherm.grey else self.palette
        ends = self.fitted(temperature)
        result = thermal(temperature, ends.low, ends.high, palette)
        if isotherm:
            low, high = sorted((isotherm.low, isotherm.high))
            result[(temperature >= low) & (temperature <= high)] = linear(isotherm.colour)
        return result

    def bar(self, count: int) -> np.ndarray:
        """(count, 3) float32 linear Rec.709: a bar of so many rows from the low end to the high; needs both ends."""
        return self.colours(self.low + (self.high - self.low) * (np.arange(count) + 0.5) / count)

    def ticks(self, unit: TemperatureUnit, most: int = TICKS) -> list[tuple[float, str]]:
        """(position, label) of at most `most` round temperatures of a unit; position 0 is the low end, 1 the high."""
        low, high = unit.of_kelvin(self.low), unit.of_kelvin(self.high)
        decimals = max(0, -math.floor(math.log10(tick_step(low, high, most)) + 1e-9))  # 0.1 has the logarithm -1
        span = self.high - self.low
        return [
            ((unit.in_kelvin(value) - self.low) / span, f"{value:.{decimals}f}") for value in ticks(low, high, most)
        ]


def automatic_range(temperature: np.ndarray) -> tuple[float, float]:
    """(low, high) in K of an image of any shape, with rows and columns last: as `robust_range`, without a background at
    exactly 0 K.

    Surroundings without a temperature are that cold and no surface is, so the background says nothing about what is in
    front of it. Pixels beside it show an edge, a mixture with it, and do not count for the low end either. An image of
    nothing else keeps its range.
    """
    temperature = np.asarray(temperature)
    background = temperature == 0.0
    if not background.any():
        return robust_range(temperature)
    shown, inner = temperature[~background], temperature[~_grown(background)]
    if not np.isfinite(shown).any():
        return robust_range(temperature)
    low, high = robust_range(shown)
    return robust_range(inner)[0] if np.isfinite(inner).any() else low, high


def _grown(mask: np.ndarray) -> np.ndarray:
    """A mask (..., rows, columns) and all pixels beside it, those at a corner too. A list of values has no beside."""
    grown = mask.copy()
    for axis in (-2, -1) if mask.ndim > 1 else ():
        along = np.moveaxis(grown, axis, 0)
        before = along.copy()
        along[1:] |= before[:-1]
        along[:-1] |= before[1:]
    return grown


def tick_step(low: float, high: float, most: int = TICKS) -> float:
    """The least step, 1, 2 or 5 times a power of ten, of which at most `most` multiples lie from low to high > low."""
    return next(
        step
        for exponent in range(int(np.floor(np.log10(high - low))) - 2, 40)
        for step in (1.0 * 10.0**exponent, 2.0 * 10.0**exponent, 5.0 * 10.0**exponent)
        if (high - low) / step <= most - 1
    )


def ticks(low: float, high: float, most: int = TICKS) -> Iterator[float]:
    """The multiples of `tick_step` from low to high; none if high is not above low."""
    if not high > low:
        return
    step = tick_step(low, high, most)
    for multiple in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1):
        yield multiple * step


def reading(kelvin: float, noise: float, unit: TemperatureUnit) -> str:
    """A temperature (K) and its standard error (K) in a unit, such as '31.42 ± 0.05 °C'.

    The error has one digit, but at most three decimals. An error as large as the temperature is what the engine gives
    after a single pass, when nothing is known of it.
    """
    value = unit.of_kelvin(kelvin)
    if not math.isfinite(value):
        return f"no value ({kelvin})"
    if noise >= kelvin > 0.0 or not math.isfinite(noise):
        return f"{value:.2f} {unit.symbol} (error unknown)"
    error = unit.scale * noise
    decimals = _decimals(error)
    return f"{value:.{decimals}f} ± {error:.{decimals}f} {unit.symbol}"


def span_reading(kelvin: float, error: float | None, unit: TemperatureUnit) -> str:
    """A difference of temperatures and its standard error, K, in a unit, such as '1.42 ± 0.05 °C'; None has none."""
    value = unit.scale * kelvin
    if error is None:
        return f"{value:.2f} {unit.symbol}"
    if not math.isfinite(error):
        return f"{value:.2f} {unit.symbol} (error unknown)"
    decimals = _decimals(unit.scale * error)
    return f"{value:.{decimals}f} ± {unit.scale * error:.{decimals}f} {unit.symbol}"


def _decimals(error: float) -> int:
    """After the point, so that an error has one digit; at most three, two if there is no error."""
    return min(3, max(0, -math.floor(math.log10(error)))) if error > 0.0 else 2
