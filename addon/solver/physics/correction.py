# SPDX-License-Identifier: GPL-3.0-or-later
"""A thermal camera's correction for the emissivity of what it sees, for the air and for optics on the way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .spectrum import sensor_radiance


class Correction(NamedTuple):
    """How the user of a camera turns the apparent temperature of a surface into the surface's own temperature.

    A grey surface, in surroundings that look like a blackbody, is seen through air and through optics in front of the
    camera, such as a window. What arrives at the camera is the radiance

        L = t_o t_a e L(T) + t_o t_a (1 - e) L(reflected) + t_o (1 - t_a) L(air) + (1 - t_o) L(optics)

    with emissivity e and transmissions t_a of the air, t_o of the optics, which is solved for T (ISO 18434-1:2008;
    M. Vollmer, K.-P. Moellmann, Infrared Thermal Imaging, 2nd edition 2018, chapters 2 and 3). The defaults correct
    nothing. Emissivity and transmissions are above 0, at most 1, and alike in all bands; temperatures are in K.
    """

    emissivity: float = 1.0
    reflected_temperature: float = 293.15
    air_transmission: float = 1.0
    air_temperature: float = 293.15
    optics_transmission: float = 1.0
    optics_temperature: float = 293.15

    @property
    def share(self) -> float:
        """Share of a blackbody's radiance at the surface's temperature that arrives at the camera."""
        return self.emissivity * self.air_transmission * self.optics_transmission

    def other_radiance(self, edges: np.ndarray, weights: np.ndarray) -> float:
        """What arrives from all but the surface itself, W m-2 sr-1. edges: (b + 1,) um. weights: (b,) response."""
        kelvin = np.array([self.reflected_temperature, self.air_temperature, self.optics_temperature])
        reflected, air, optics = sensor_radiance(edges, weights, kelvin)
        before = self.air_transmission * (1.0 - self.emissivity) * reflected + (1.0 - self.air_transmission) * air
        return float(self.optics_transmission * before + (1.0 - self.optics_transmission) * optics)

    def object_radiance(self, radiance, edges: np.ndarray, weights: np.ndarray):
        """Radiance of a blackbody at the surface's own temperature, W m-2 sr-1; it may come out below 0.

        radiance: what was seen, W m-2 sr-1, of any shape; the result has the same shape. edges: (b + 1,) um. weights:
        (b,) response.
        """
        return (radiance - self.other_radiance(edges, weights)) / self.share
