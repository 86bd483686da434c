# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of what a length of gas lets through, over the wavelength."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...solver.physics.aerosols import mix_in
from ...solver.physics.gases import find_gas
from ...solver.physics.transmission import transmittance
from ...solver.scene import ATMOSPHERE, Medium
from ..materials.curve_previews import PANEL_SIZE, THUMBNAIL_RANGE, THUMBNAIL_SIZE, curve_icon, shown_range

_IN_A_COLUMN = 4  # wavelengths whose mean a column of pixels shows


def gas_points(medium: Medium, length: float, low: float, high: float, columns: int) -> np.ndarray:
    """(columns, 2) [um, transmittance 0..1] of a length (m) of a gas from `low` to `high` um, means over columns of a
    picture."""
    border = np.linspace(low, high, columns * _IN_A_COLUMN + 1)
    wavelength = np.maximum(0.5 * (border[:-1] + border[1:]), 1e-3)
    through = transmittance(medium, wavelength, length)
    return np.column_stack([each.reshape(columns, -1).mean(axis=1) for each in (wavelength, through)])


def gas_icon(name: str, medium: Medium, length: float, edges: np.ndarray) -> int:
    """The number of the picture of a gas over the bands between edges (b + 1,), um. name, edges: see curve_icon.
    length: m."""
    points = gas_points(medium, length, *shown_range(edges), PANEL_SIZE[0])
    return curve_icon(name, points, PANEL_SIZE, edges)


def mixture_icon(name: str, kelvin: float, length: float) -> int:
    """The number of the small picture of a mixture of the library at a temperature. length: m."""
    return curve_icon(f"mixture {name}", _thumbnail(name, kelvin, length))


@lru_cache(maxsize=256)
def _thumbnail(name: str, kelvin: float, length: float) -> np.ndarray:
    return gas_points(mixture(name, kelvin), length, *THUMBNAIL_RANGE, THUMBNAIL_SIZE[0])


def mixture(name: str, kelvin: float, pressure: float = ATMOSPHERE) -> Medium:
    """A mixture of the library as a Medium without a mesh, in metres."""
    return mix_in(Medium(name, temperature=kelvin, pressure=pressure), find_gas(name))
