# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures that 3D viewports show in Rendered mode, for whoever draws over them. This loads no solver."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np

from ..measuring.correcting import Sensor
from ..measuring.regions import Window
from ..solver.physics.correction import Correction
from .readings import MeasuredPicture


@dataclass(frozen=True)
class Picture:
    """step: screen pixels on each side of one of the picture's. origin: x and y of the lower left corner in the region,
    screen pixels.
    radiance, temperature, noise: (h, w) float32, W m-2 sr-1 through the sensor and K, row 0 at the bottom, without a
    correction for an assumed emissivity. sensor: that saw it. frame: left, bottom, width and height, in the region's
    pixels, of the frame of the camera that the view goes through; None in other views.
    for_the_eye: radiance and temperature as they are drawn instead, where they are smoothed; readings know nothing of
    that.
    """

    step: int
    origin: tuple[int, int]
    radiance: np.ndarray
    temperature: np.ndarray
    noise: np.ndarray
    sensor: Sensor
    frame: tuple[float, float, float, float] | None = None
    for_the_eye: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def place(self) -> tuple[int, int, int, int]:
        """Left, bottom, width and height in the region, screen pixels."""
        height, width = self.temperature.shape
        return *self.origin, width * self.step, height * self.step

    @property
    def measured(self) -> MeasuredPicture:
        """The picture for measuring tools, which lie in the camera's frame if there is one, else in the picture."""
        left, bottom, width, height = self.frame or self.place
        size = width / self.step, height / self.step
        origin = (self.origin[0] - left) / self.step, (self.origin[1] - bottom) / self.step
        window = Window(size, origin, self.temperature.shape)
        return MeasuredPicture(self.radiance, self.temperature, self.noise, self.sensor, Correction(), window)

    @property
    def drawn(self) -> MeasuredPicture:
        """The picture as it is drawn."""
        if self.for_the_eye is None:
            return self.measured
        radiance, temperature = self.for_the_eye
        return self.measured._replace(radiance=radiance, temperature=temperature)

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
