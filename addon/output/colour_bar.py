# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the parts of a colour bar lie, in pixels whose y grows upwards: for the screen and for pictures alike."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .temperature_scale import TICKS, TemperatureScale, TemperatureUnit

BACKGROUND, INK = (0.094, 0.094, 0.110), (0.88, 0.88, 0.88)  # sRGB
LINES_A_TICK = 2.0  # least distance between labels, in heights of the text


@dataclass(frozen=True)
class ColourBar:
    """A bar of a scale whose ends are known, labelled in a unit, in a panel with a background.

    left, bottom: lower left corner of the panel. height: of the panel. text: height of the text. All in pixels.
    """

    scale: TemperatureScale
    unit: TemperatureUnit
    left: int
    bottom: int
    height: int
    text: int = 13

    @staticmethod
    def panel_width(text: int) -> int:
        """Width of the panel: a margin, the bar, its ticks and labels of seven digits."""
        return 8 * text

    @property
    def bar(self) -> tuple[int, int, int, int]:
        """Left, bottom, width and height of the coloured rectangle."""
        return self.left + self.text, self.bottom + self.text, 3 * self.text // 2, max(1, self.height - 4 * self.text)

    def colours(self) -> np.ndarray:
        """(height of the bar, 3) float32 linear Rec.709 for each row of the bar, from the bottom."""
        return self.scale.bar(self.bar[3])

    def marks(self) -> Iterator[tuple[float, str]]:
        """(y, label) of every tick."""
        _, bottom, _, height = self.bar
        most = int(np.clip(height / (LINES_A_TICK * self.text), 3, TICKS))
        for position, label in self.scale.ticks(self.unit, most):
            yield bottom + position * height, label

    def ticks(self) -> Iterator[tuple[float, float, float]]:
        """x from, x to and y of the line of every tick."""
        left, _, width, _ = self.bar
        for y, _label in self.marks():
            yield left + width, left + width + self.text / 3, y

    def labels(self) -> Iterator[tuple[float, float, str]]:
        """x and y of the lower left corner of every text, and the text; the last is the unit."""
        left, bottom, width, height = self.bar
        capital = 0.35 * self.text  # half the height of a figure
        for y, label in self.marks():
            yield left + width + 2 * self.text / 3, y - capital, label
        yield left, bottom + height + self.text, self.unit.symbol
