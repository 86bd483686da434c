# SPDX-License-Identifier: GPL-3.0-or-later
"""The continuum of water vapour: what it absorbs between its bands.

By collisions with itself; with air it is much weaker (Roberts, Selby and Biberman 1976, Appl. Opt. 15, 2085; in 8 to 12
um).
"""

from __future__ import annotations

import numpy as np

_STRENGTH = 4.18, 5578.0, 7.87e-3  # a, b, beta of a + b exp(-beta wavenumber), cm2 g-1 atm-1 at 296 K
_KELVIN, _COLD, _BY_AIR = 1800.0, 296.0, 0.002
_RANGE = 500.0, 1250.0  # cm-1: stronger lines on either side hide it
_WATER_MASS, _GAS_CONSTANT = 18.015, 82.057  # g / mol; cm3 atm mol-1 K-1


def water_continuum(wavenumber: np.ndarray, kelvin: np.ndarray, atm: float, fraction: float) -> np.ndarray:
    """Coefficient of water vapour's continuum per unit of its mole fraction, 1/m. wavenumber: cm-1, shaped to go with
    kelvin. atm: pressure of the mixture, atm. fraction: of water vapour in it."""
    a, b, beta = _STRENGTH
    low, high = _RANGE
    by_mass = (a + b * np.exp(-beta * wavenumber)) * ((wavenumber >= low) & (wavenumber <= high))
    by_mass = by_mass * np.exp(_KELVIN * (1.0 / kelvin - 1.0 / _COLD))
    density = _WATER_MASS * atm / (_GAS_CONSTANT * kelvin)  # g / cm3 of pure vapour
    return 100.0 * by_mass * density * atm * (fraction + _BY_AIR * (1.0 - fraction))
