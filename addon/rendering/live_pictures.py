# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that 3D viewports show in Rendered mode, for whoever draws over them. This loads no solver."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np

from ..output.temperature_scale import TemperatureScale


@dataclass(frozen=True)
class Picture:
    """pixels: (h, w, 4) float32, linear colours, row 0 at the bottom. step: screen pixels on each side of one of them.
    origin: x and y of the lower left corner in the region, screen pixels.
    temperature, noise: (h, w) float32 K, what was painted and its standard error. scale: that of the colours, fitted.
    """

    pixels: np.ndarray
    step: int
    origin: tuple[int, int]
    temperature: np.ndarray
    noise: np.ndarray
    scale: TemperatureScale

    def pixel_at(self, x: int, y: int) -> tuple[int, int] | None:
        """(row, column) at a pixel of the region, or None outside."""
        row, column = (y - self.origin[1]) // self.step, (x - self.origin[0]) // self.step
        height, width = self.temperature.shape
        return (row, column) if 0 <= row < height and 0 <= column < width else None


viewports = weakref.WeakValueDictionary()  # a region's address -> the viewport.Viewport that draws in it


def picture_in(region) -> Picture | None:
    """What a 3D viewport's region shows of this engine; None if it shows nothing of it."""
    viewport = viewports.get(region.as_pointer())
    return viewport and viewport.shown
