# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs of temperatures as SVG, to stand in a page: profiles, histograms, and tools over frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from ..output.palette import display
from ..output.temperature_scale import TemperatureScale, TemperatureUnit, tick_step, ticks
from .statistics import histogram

WIDTH, HEIGHT = 640, 220  # px
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 12, 40  # px around the drawing
MOST_POINTS = 2000  # of a profile that is drawn; of a longer one extremes are kept
BINS = 64
STOPS = 128  # of the bar's colours
COLOURS = ("#c2410c", "#1d4ed8", "#15803d", "#7e22ce", "#a16207", "#0e7490", "#be123c", "#4d7c0f")


@dataclass(frozen=True)
class Axes:
    """What the sides of a drawing stand for: x from x_low to x_high, y from y_low to y_high, with their titles.

    counts: whether x are whole numbers.
    """

    x_low: float
    x_high: float
    y_low: float
    y_high: float
    x_title: str
    y_title: str
    counts: bool = False

    def x(self, value):
        """Pixels from the left of a value, number or array."""
        return LEFT + (value - self.x_low) / (self.x_high - self.x_low) * (WIDTH - LEFT - RIGHT)

    def y(self, value):
        """Pixels from the top of a value, number or array."""
        return HEIGHT - BOTTOM - (value - self.y_low) / (self.y_high - self.y_low) * (HEIGHT - TOP - BOTTOM)

    def drawn(self, content: str, label: str) -> str:
        """The SVG of a graph with its frame and ticks. label: what it shows, for those who cannot see it."""
        right, low = WIDTH - RIGHT, HEIGHT - BOTTOM
        parts = [
            f'<svg class="graph" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(label)}">',
            f"<title>{escape(label)}</title>",
        ]
        for value, text in _labels(self.x_low, self.x_high, 8, self.counts):
            x = self.x(value)
            parts.append(f'<path class="grid" d="M{x:.1f} {TOP}V{low}"/>')
            parts.append(f'<text x="{x:.1f}" y="{low + 14}" text-anchor="middle">{text}</text>')
        for value, text in _labels(self.y_low, self.y_high, 5, False):
            y = self.y(value)
            parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{right}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
        middle = 0.5 * (TOP + low)
        parts += [
            content,
            f'<path class="frame" d="M{LEFT} {TOP}V{low}H{right}"/>',
            f'<text x="{0.5 * (LEFT + right):.1f}" y="{HEIGHT - 8}" text-anchor="middle">{escape(self.x_title)}</text>',
            f'<text transform="translate(14 {middle:.1f}) rotate(-90)" text-anchor="middle">',
            f"{escape(self.y_title)}</text>",
            "</svg>",
        ]
        return "\n".join(parts)


def _labels(low: float, high: float, most: int, whole: bool) -> list[tuple[float, str]]:
    """(value, text) of round values between two. whole: of whole numbers alone."""
    decimals = max(0, -math.floor(math.log10(tick_step(low, high, most)) + 1e-9))
    values = [value for value in ticks(low, high, most) if not whole or abs(value - round(value)) < 1e-6]
    return [(value, f"{value:.{0 if whole else decimals}f}") for value in values]


def _range(values: np.ndarray) -> tuple[float, float] | None:
    """Ends that hold all finite values with a margin; None without any."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    low, high = float(finite.min()), float(finite.max())
    margin = max(0.05 * (high - low), 1e-3 * max(abs(high), 1.0) if high - low < 1e-6 else 0.0)
    return low - margin, high + margin


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """Data of an SVG path through (n,) places in pixels, with gaps where y is not finite."""
    command, parts = "M", []
    for left, top in zip(x.tolist(), y.tolist(), strict=True):
        if math.isfinite(top):
            parts.append(f"{command}{left:.1f} {top:.1f}")
            command = "L"
        else:
            command = "M"
    return "".join(parts)


def _rectangle(ends: tuple[float, float, float, float], look: str) -> str:
    """From left and top to right and bottom, in pixels."""
    left, top, right, bottom = ends
    return f'<rect {look} x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" height="{bottom - top:.2f}"/>'


def profile(values: np.ndarray, unit: TemperatureUnit, label: str) -> str:
    """A graph of temperatures (n,), K, along a line; an empty text if there are none. label: what it is of."""
    shown, at = unit.of_kelvin(values.astype(np.float64)), np.arange(1, len(values) + 1)
    ends = _range(shown)
    if ends is None:
        return ""
    if len(shown) > MOST_POINTS:  # the least and the largest of each piece, so that no peak is lost
        pieces = np.array_split(np.arange(len(shown)), MOST_POINTS // 2)
        kept = sorted({int(i) for part in pieces for i in (part[shown[part].argmin()], part[shown[part].argmax()])})
        shown, at = shown[kept], at[kept]
    axes = Axes(1.0, max(len(values), 2), *ends, "Pixel along the line", unit.symbol, True)
    return axes.drawn(f'<path class="curve" d="{_path(axes.x(at), axes.y(shown))}"/>', f"Profile of {label}")


def histogram_of(
    values: np.ndarray, unit: TemperatureUnit, label: str, isotherm: tuple[float, float] | None = None
) -> str:
    """A graph of how many pixels are how warm: values (n,), K; an empty text if there are none. isotherm: K, from and
    to, which is shaded."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return ""
    counts, edges = histogram(finite, BINS)
    edges = unit.of_kelvin(edges)
    axes = Axes(edges[0], edges[-1], 0.0, 1.05 * float(counts.max()), unit.symbol, "Pixels")
    bars, zero = [], axes.y(0.0)
    if isotherm is not None:
        low, high = (float(np.clip(unit.of_kelvin(end), edges[0], edges[-1])) for end in sorted(isotherm))
        if high > low:
            bars.append(_rectangle((axes.x(low), TOP, axes.x(high), zero), 'class="isotherm"'))
    sides = axes.x(edges).tolist()
    for count, left, right in zip(counts.tolist(), sides[:-1], sides[1:], strict=True):
        if count:
            bars.append(_rectangle((left, axes.y(count), right, zero), 'class="bar"'))
    return axes.drawn("\n".join(bars), f"Histogram of {label}")


def over_frames(series: Mapping[str, tuple[Sequence[int], np.ndarray]], unit: TemperatureUnit, label: str) -> str:
    """A graph of mean temperatures over frames, with their least and largest as a band; an empty text without any.

    series: by name, frames (n,) and (n, 3) K: least, mean, largest. A legend names them.
    """
    all_frames = np.array([frame for frames, _ in series.values() for frame in frames], np.float64)
    values = [unit.of_kelvin(np.asarray(kelvin, np.float64)) for _, kelvin in series.values()]
    ends = _range(np.concatenate([each.ravel() for each in values])) if values else None
    if ends is None or not all_frames.size:
        return ""
    first, last = float(all_frames.min()), float(all_frames.max())
    axes = Axes(first, last if last > first else first + 1.0, *ends, "Frame", unit.symbol, True)
    parts = []
    for index, ((frames, _), shown) in enumerate(zip(series.values(), values, strict=True)):
        colour, x = COLOURS[index % len(COLOURS)], axes.x(np.asarray(frames, np.float64))
        finite = np.isfinite(shown).all(axis=1)
        around = np.concatenate((x[finite], x[finite][::-1]))
        band = np.concatenate((axes.y(shown[finite, 2]), axes.y(shown[finite, 0])[::-1]))
        if finite.any():
            parts.append(f'<path d="{_path(around, band)}Z" fill="{colour}" opacity="0.15"/>')
        parts.append(f'<path class="curve" style="stroke:{colour}" d="{_path(x, axes.y(shown[:, 1]))}"/>')
        dots = zip(x.tolist(), axes.y(shown[:, 1]).tolist(), strict=True)
        parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2" fill="{colour}"/>' for a, b in dots if math.isfinite(b)]
    legend = "".join(
        f'<span><i style="background:{COLOURS[index % len(COLOURS)]}"></i>{escape(name)}</span>'
        for index, name in enumerate(series)
    )
    return axes.drawn("\n".join(parts), label) + f'\n<p class="legend">{legend}</p>'


def bar(scale: TemperatureScale, unit: TemperatureUnit, height: int) -> str:
    """The bar of a scale whose ends are known, with its ticks, as SVG of a height in px."""
    top, bottom, width = 24, height - 8, 22
    rows = display(scale.bar(STOPS)).tolist()
    step = (bottom - top) / STOPS
    parts = [f'<svg class="scale" width="96" height="{height}" role="img" aria-label="Colours of the temperatures">']
    parts.append(f'<text x="4" y="14">{escape(unit.symbol)}</text>')
    for index, (red, green, blue) in enumerate(rows):
        y = bottom - (index + 1) * step
        parts.append(_rectangle((4, y, 4 + width, y + step + 0.5), f'fill="#{red:02x}{green:02x}{blue:02x}"'))
    for position, text in scale.ticks(unit):
        y = bottom - position * (bottom - top)
        parts.append(f'<path class="tick" d="M{4 + width} {y:.1f}h5"/>')
        parts.append(f'<text x="{width + 14}" y="{y + 4:.1f}">{text}</text>')
    return "\n".join([*parts, "</svg>"])
