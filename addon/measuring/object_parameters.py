# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user of a thermal camera says about the object, the air and the optics before the camera, and the object's
temperature that follows, by ISO 18434-1:2008 and ASTM E1933; the formula itself is the solver's Correction.

The air's transmission is either given, or follows from distance, air temperature and humidity by the formula that FLIR
puts into its cameras: W. Minkina and S. Dudzik, Infrared Thermography: Errors and Uncertainties, Wiley 2009; W. Minkina
and D. Klecha, J. Sens. Sens. Syst. 5, 17-23, 2016, doi:10.5194/jsss-5-17-2016; G. J. Tattersall's Thermimage
(raw2temp.R) has the same coefficients from the files of a FLIR SC660. They are those of uncooled long-wave cameras, 7.5
to 13 um; other cameras state others in their files, so these are no constants of nature. On long ways through humid
air the formula falls below 0, where it has no meaning.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..solver.physics.correction import Correction
from ..solver.physics.humidity import FREEZING
from ..solver.physics.spectrum import planck
from ..solver.physics.transmission import transmittance
from ..solver.scene import Medium, SceneError, check_temperature

SHARE = 1.9  # of the first of two exponentials; the second has 1 minus that
DRY = 0.006569, 0.01262  # m^-1/2, of each
HUMID = -0.002276, -0.00667  # m^-1/2 (g/m3)^-1/2, of each
VAPOUR = 1.5587, 6.939e-2, -2.7816e-4, 6.8455e-7  # logarithm of saturated vapour in g/m3, by powers of deg C
SAMPLES = 64  # wavelengths in a band, at which a gas is looked at


@dataclass(frozen=True)
class ObjectParameters:
    """The defaults correct nothing.

    emissivity: of the object, above 0, at most 1. reflected_temperature: apparent, of what it reflects, K.
    distance: m, through air of air_temperature, K, and relative_humidity, 0 to 1.
    air_transmission: above 0, at most 1; None takes that of `camera_air_transmission`.
    optics_transmission: of a window or lens before the camera, above 0, at most 1. optics_temperature: its own, K.

    Raises SceneError, naming the value, for one that makes no sense.
    """

    emissivity: float = 1.0
    reflected_temperature: float = 293.15
    distance: float = 1.0
    air_temperature: float = 293.15
    relative_humidity: float = 0.5
    air_transmission: float | None = 1.0
    optics_transmission: float = 1.0
    optics_temperature: float = 293.15

    def __post_init__(self):
        for name in ("emissivity", "air_transmission", "optics_transmission"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value <= 1.0:  # also NaN
                raise SceneError(f"{name} is {value:g}, expected above 0 to 1")
        for name in ("reflected_temperature", "air_temperature", "optics_temperature"):
            check_temperature(getattr(self, name), name)
        if not 0.0 <= self.distance < math.inf:
            raise SceneError(f"distance is {self.distance:g} m, expected a finite number of 0 or more")
        if not 0.0 <= self.relative_humidity <= 1.0:
            raise SceneError(f"relative_humidity is {100.0 * self.relative_humidity:g} %, expected 0 to 100 %")
        if self.air_transmission is None and not self.correction.air_transmission > 0.0:
            raise SceneError(
                f"The formula for air_transmission has no meaning at a distance of {self.distance:g} m through air of "
                f"{self.air_temperature:g} K and {100.0 * self.relative_humidity:g} %: state the transmission instead"
            )

    @property
    def correction(self) -> Correction:
        """The solver's Correction by these parameters."""
        air = self.air_transmission
        if air is None:
            air = camera_air_transmission(self.distance, self.air_temperature, self.relative_humidity)
        optics = self.optics_transmission, self.optics_temperature
        return Correction(self.emissivity, self.reflected_temperature, float(air), self.air_temperature, *optics)


def vapour_density(air_temperature, relative_humidity):
    """Water in air, g/m3, as cameras reckon it. K and 0 to 1, numbers or arrays."""
    celsius = np.asarray(air_temperature, np.float64) - FREEZING
    return relative_humidity * np.exp(np.polynomial.polynomial.polyval(celsius, VAPOUR))


def camera_air_transmission(distance, air_temperature, relative_humidity):
    """Transmission of air in long-wave cameras by the formula above. m, K and 0 to 1, numbers or arrays.

    It is 1 at no distance and falls with distance and humidity, below 0 in the end.
    """
    far, vapour = np.sqrt(distance), np.sqrt(vapour_density(air_temperature, relative_humidity))
    first, second = (np.exp(-far * (dry + humid * vapour)) for dry, humid in zip(DRY, HUMID, strict=True))
    return SHARE * first + (1.0 - SHARE) * second


def gas_transmission(gas: Medium, distance: float, edges: np.ndarray, weights: np.ndarray, temperature: float) -> float:
    """Share of a blackbody's signal that a length of gas lets through: the mean over bands, by response and radiance.

    gas: in metres. distance: m. edges: (b + 1,) um. weights: (b,) response. temperature: of the blackbody, K > 0.
    """
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    wavelengths = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
    signal = np.repeat(weights * np.diff(edges), SAMPLES) * planck(wavelengths, temperature)
    return float(signal @ transmittance(gas, wavelengths, distance) / signal.sum())
