# SPDX-License-Identifier: GPL-3.0-or-later
"""Humidity of air by Magnus' formula: saturated vapour, dew point and relative humidity.

Over liquid water, also below 0 deg C, as weather services give dew points. Coefficients: O. A. Alduchov and R. E.
Eskridge, Improved Magnus form approximation of saturation vapor pressure, J. Appl. Meteorol. 35, 601 (1996), their
AERK, within 0.4 % from -40 to 50 deg C.
"""

from __future__ import annotations

import math

from ..scene import SceneError

FREEZING = 273.15  # K, of 0 deg C
_PASCALS, _A, _B = 610.94, 17.625, 243.04  # vapour at 0 deg C, Pa; without unit; deg C


def saturation_pressure(kelvin: float) -> float:
    """Pressure of water vapour, Pa, that is saturated at a temperature, K."""
    celsius = kelvin - FREEZING
    return _PASCALS * math.exp(_A * celsius / (_B + celsius))


def dew_point(air: float, humidity: float) -> float:
    """Temperature, K, at which the vapour in air would be saturated.

    air: its temperature, K. humidity: relative, above 0 and at most 1. Raises SceneError if that is no humidity.
    """
    if not 0.0 < humidity <= 1.0:
        raise SceneError(f"Relative humidity {100.0 * humidity:g} %; it is above 0 % and at most 100 %")
    if humidity == 1.0:  # exactly, not but for rounding
        return air
    exponent = math.log(humidity * saturation_pressure(air) / _PASCALS)
    return FREEZING + _B * exponent / (_A - exponent)


def relative_humidity(air: float, dew: float) -> float:
    """Relative humidity, 0 to 1, of air by its temperature and dew point, both K."""
    return saturation_pressure(dew) / saturation_pressure(air)
