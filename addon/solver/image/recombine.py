# SPDX-License-Identifier: GPL-3.0-or-later
"""New temperatures for a finished render: its layers (see layers) get new weights. No photon is traced."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..physics.layers import Layer, group_temperatures, layer_factors
from ..physics.radiometry import reference_radiance
from ..physics.spectrum import apparent_temperature
from ..scene import SceneError
from ..system.kernels import KERNEL, njit
from .film import Correction, Film


@dataclass(frozen=True)
class LayeredImage:
    """The layers of a finished render.

    excess: (layers, b, height, width) float32, row 0 at the bottom: what each layer adds to the spectral radiance of a
        blackbody at the reference temperature, averaged over each band, W m-2 sr-1 um-1.
    layers: see layers.Layer. band_edges: (b + 1,) um. reference_temperature: K. weights: (b,) response of the sensor.
    correction: of temperatures, see Correction.
    """

    excess: np.ndarray
    layers: tuple[Layer, ...]
    band_edges: np.ndarray
    reference_temperature: float
    weights: np.ndarray
    correction: Correction = Correction()

    @property
    def temperatures(self) -> dict[str, float]:
        """The temperature (K) of each group in the scene that was rendered."""
        return group_temperatures(self.layers)

    def factors(self, temperatures: Mapping[str, float] | None = None) -> np.ndarray:
        """(layers, b) float64, by which the layers are multiplied at other temperatures (K, by group).

        Groups that are not named keep their temperatures of the scene. Raises as `layer_factors` does.
        """
        return layer_factors(self.layers, self.band_edges, self.reference_temperature, temperatures)

    def recombined(self, temperatures: Mapping[str, float] | None = None) -> np.ndarray:
        """(b, height, width) float32 spectral radiance averaged over each band, W m-2 sr-1 um-1, at other temperatures.

        temperatures: as in `factors`.
        """
        factors = self.factors(temperatures)
        base = reference_radiance(self.band_edges, self.reference_temperature) / np.diff(self.band_edges)
        count, bands, *shape = self.excess.shape
        images = np.empty((bands, *shape), np.float32)
        _combine(self.excess.reshape(count, bands, -1), factors, base, images.reshape(bands, -1))
        return images

    def radiance(self, bands: np.ndarray) -> np.ndarray:
        """(height, width) float32 radiance of recombined bands through the sensor's response, W m-2 sr-1."""
        return np.einsum("b,byx->yx", self.weights * np.diff(self.band_edges), bands).astype(np.float32)

    def temperature(self, radiance: np.ndarray) -> np.ndarray:
        """(height, width) float32 apparent temperature of a radiance as of `radiance`, after the correction, K."""
        seen = self.correction.object_radiance(radiance.astype(np.float64), self.band_edges, self.weights)
        return apparent_temperature(seen, self.band_edges, self.weights).astype(np.float32)


def layered_image(film: Film) -> LayeredImage:
    """The layers of a film."""
    shape = film.height, film.width
    excess = np.empty((len(film.layers), film.band_count, *shape), np.float32)
    _per_wavelength(film.layer_means(), np.diff(film.band_edges), excess.reshape(*excess.shape[:2], -1))
    return LayeredImage(excess, film.layers, film.band_edges, film.reference_temperature, film.weights, film.correction)


@njit(**KERNEL)
def _per_wavelength(mean, width, excess):
    """Fill excess (layers, b, pixels) with mean (pixels, layers * b) over the bands' width (um)."""
    layers, bands, pixels = excess.shape
    for i in range(pixels):
        for layer in range(layers):
            for b in range(bands):
                excess[layer, b, i] = mean[i, layer * bands + b] / width[b]


@njit(**KERNEL)
def _combine(excess, factors, base, images):
    """Fill images (b, pixels) with base (b,) and the sum over layers of factors (layers, b) times excess."""
    layers, bands, pixels = excess.shape
    for b in range(bands):
        for i in range(pixels):
            total = base[b]
            for layer in range(layers):
                total += factors[layer, b] * excess[layer, b, i]
            images[b, i] = total


def read_series(text: str, known: Sequence[str]) -> list[tuple[int, dict[str, float]]]:
    """A table of temperatures over time: for each image the number of its frame and temperatures (K) by group.

    The text is comma-separated values, with a line of titles.

    A column 'frame' holds whole numbers; without one, rows count from 1. 'time' is for the reader alone. Every other
    column is a temperature group, in kelvin. known: names of the groups.
    Raises SceneError naming line and value of what makes no sense.
    """
    rows = [(number, row) for number, row in enumerate(csv.reader(text.splitlines()), 1) if any(map(str.strip, row))]
    if len(rows) < 2:
        raise SceneError("The series needs a line of titles, such as frame,engine, and a line for each image")
    titles = [title.strip() for title in rows[0][1]]
    groups = [title for title in titles if title not in ("frame", "time")]
    listed = ", ".join(map(repr, known)) or "none"
    for title in groups:
        if title not in known:
            raise SceneError(f"The series has a column '{title}', but no temperature group is called so, only {listed}")
    if len(set(titles)) < len(titles) or not groups:
        raise SceneError(f"The series needs a column for a temperature group, each once, of {listed}")
    frames, temperatures = [], []
    for number, row in rows[1:]:
        if len(row) != len(titles):
            raise SceneError(f"Line {number} of the series has {len(row)} values, expected {len(titles)}")
        values = dict(zip(titles, row, strict=True))
        temperatures.append({group: _number(values[group], float, number, group) for group in groups})
        counted = len(frames) + 1
        frames.append(_number(values["frame"], int, number, "frame") if "frame" in values else counted)
    if len(set(frames)) < len(frames):
        raise SceneError("The series has a frame twice")
    return list(zip(frames, temperatures, strict=True))


def _number(text: str, kind: type, line: int, title: str):
    try:
        return kind(text)
    except ValueError:
        raise SceneError(f"Line {line} of the series: {title} is '{text.strip()}', expected a number") from None
