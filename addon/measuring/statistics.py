# SPDX-License-Identifier: GPL-3.0-or-later
"""What a measuring tool reads: least, largest and mean temperature, their errors, histogram and profile."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..output.temperature_scale import Isotherm
from .regions import Region

_BLOCK = 1 << 14  # values, 64 KB of float32


class Measurement(NamedTuple):
    """What a tool reads in its pixels. Temperatures and errors are in K; an error of infinity is unknown.

    deviation: standard deviation of the pixels' temperatures, sqrt(mean of (T - mean)^2). count: pixels. area: their
    share of all pixels of the image. place_of_...: (row, column) in the image. error_of_...: standard errors; that of
    the mean takes the errors of pixels as independent. in_isotherm: share of the pixels in the isotherm, None without.
    """

    minimum: float
    maximum: float
    mean: float
    deviation: float
    count: int
    area: float
    place_of_minimum: tuple[int, int]
    place_of_maximum: tuple[int, int]
    error_of_minimum: float
    error_of_maximum: float
    error_of_mean: float
    in_isotherm: float | None = None


def measure(
    temperature: np.ndarray, noise: np.ndarray, region: Region, isotherm: Isotherm | None = None
) -> Measurement | None:
    """The Measurement of a region in images of temperatures and of their standard errors, (h, w) K; None of no pixel.

    An error as large as the temperature is what the engine gives after a single pass, when nothing is known of it.
    """
    return measure_values(region, region.values(temperature), region.values(noise), temperature.size, isotherm)


def measure_values(
    region: Region, values: np.ndarray, errors: np.ndarray, pixels: int, isotherm: Isotherm | None = None
) -> Measurement | None:
    """As `measure`, of the values (n,) and errors (n,) in a region's pixels, K. pixels: of the whole image."""
    if values.size == 0:
        return None
    unknown = errors >= values
    known = not (unknown.any() and (values[unknown] > 0.0).any())
    low, high = int(np.argmin(values)), int(np.argmax(values))
    mean = float(np.mean(values, dtype=np.float64))
    near = float(values.dtype.type(mean))  # values less this are small, and their squares exact enough in float32
    variance = _sum_of_squares(values, near) / values.size - (mean - near) ** 2
    return Measurement(
        minimum=float(values[low]),
        maximum=float(values[high]),
        mean=mean,
        deviation=math.sqrt(max(0.0, variance)),
        count=values.size,
        area=values.size / pixels,
        place_of_minimum=region.pixel(low),
        place_of_maximum=region.pixel(high),
        error_of_minimum=_known(errors[low], values[low]),
        error_of_maximum=_known(errors[high], values[high]),
        error_of_mean=math.sqrt(_sum_of_squares(errors)) / values.size if known else math.inf,
        in_isotherm=None if isotherm is None else share_in(values, isotherm),
    )


def _sum_of_squares(values: np.ndarray, shift: float = 0.0) -> float:
    """Sum of (value - shift)^2 of values (n,), by blocks: copies of whole pictures would not stay in the cache."""
    total, shift = 0.0, values.dtype.type(shift)
    for begin in range(0, values.size, _BLOCK):
        part = values[begin : begin + _BLOCK] - shift
        total += float(part @ part)
    return total


def _known(error, value) -> float:
    """A pixel's error, infinity where it is unknown."""
    return math.inf if error >= value > 0.0 else float(error)


def share_in(values: np.ndarray, isotherm: Isotherm) -> float:
    """Share of temperatures (n,), K, that an isotherm paints."""
    low, high = sorted((isotherm.low, isotherm.high))
    return np.count_nonzero((values >= low) & (values <= high)) / values.size


def difference(first: Measurement, second: Measurement) -> tuple[float, float]:
    """Mean of the first less that of the second, K, and its standard error as of independent readings, K."""
    return first.mean - second.mean, math.hypot(first.error_of_mean, second.error_of_mean)


class Histogram(NamedTuple):
    """How many pixels are how warm. counts: (n,) pixels in each of n bins of equal width. edges: (n + 1,) K."""

    counts: np.ndarray
    edges: np.ndarray


def histogram(values: np.ndarray, bins: int = 64, ends: tuple[float, float] | None = None) -> Histogram:
    """The Histogram of temperatures (n,), K, from the least to the largest, or between two ends; values of one
    temperature fill one bin."""
    if values.size == 0:
        return Histogram(np.zeros(bins, int), np.linspace(0.0, 1.0, bins + 1))
    return Histogram(*np.histogram(values, bins, ends))
