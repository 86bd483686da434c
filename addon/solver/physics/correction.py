# SPDX-License-Identifier: GPL-3.0-or-later
"""A thermal camera's correction for the emissivity of what it sees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .spectrum import sensor_radiance


class Correction(NamedTuple):
    """How the user of a camera turns the apparent temperature of a surface into the surface's own temperature.

    A surface of this emissivity, in surroundings that look like a blackbody at reflected_temperature (K), sends the
    radiance L = emissivity L(T) + (1 - emissivity) L(reflected_temperature), which is solved for T. Emissivity 1
    corrects nothing. (M. Vollmer, K.-P. Moellmann, Infrared Thermal Imaging, 2nd edition 2018, chapter 3.)
    """

    emissivity: float = 1.0
    reflected_temperature: float = 293.15  # K

    def object_radiance(self, radiance, edges: np.ndarray, weights: np.ndarray):
        """Radiance of a blackbody at the surface's own temperature, W m-2 sr-1; it may come out below 0.

        radiance: what was seen, W m-2 sr-1, of any shape; the result has the same shape. edges: (b + 1,) um. weights:
        (b,) response.
        """
        reflection = (1.0 - self.emissivity) * sensor_radiance(edges, weights, self.reflected_temperature)
        return (radiance - reflection) / self.emissivity
