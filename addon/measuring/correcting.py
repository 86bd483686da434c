# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of a finished picture for another correction than that with which it was rendered.

The radiance stays what it is, so that the temperatures are exactly those of a new render. Their standard errors follow
by the slope of the calibration, to the first order of the error.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..solver.image.detector import STATED
from ..solver.physics.correction import Correction
from ..solver.physics.spectrum import apparent_temperature, sensor_radiance

_BLOCK = 65_536  # pixels of a piece of work, which fits into a core's cache


class Sensor(NamedTuple):
    """How a sensor sees: edges (b + 1,) of the bands in um, and its response, weights (b,)."""

    edges: np.ndarray
    weights: np.ndarray


def effective(correction: Correction) -> Correction:
    """The same correction, the same for all temperatures that do not count: those behind a share of 1."""
    none = Correction()
    shares = ("emissivity", "reflected_temperature"), ("air_transmission", "air_temperature")
    shares += (("optics_transmission", "optics_temperature"),)
    idle = [kelvin for share, kelvin in shares if getattr(correction, share) == 1.0]
    return correction._replace(**{name: getattr(none, name) for name in idle})


def corrected(radiance: np.ndarray, sensor: Sensor, correction: Correction) -> np.ndarray:
    """Temperatures, float32 K, of radiance of any shape, W m-2 sr-1 through the sensor's response; 0 K where the
    correction leaves no radiance."""
    flat = np.asarray(radiance).reshape(-1)
    result = np.empty(flat.shape, np.float32)

    def fill(start: int) -> None:
        part = slice(start, start + _BLOCK)
        left = correction.object_radiance(flat[part].astype(np.float64), *sensor)
        result[part] = apparent_temperature(left, *sensor)

    fill(0)  # alone: it makes the table of the sensor
    if flat.size > _BLOCK:
        with ThreadPoolExecutor() as pool:
            list(pool.map(fill, range(_BLOCK, flat.size, _BLOCK)))
    return result.reshape(np.shape(radiance))


def corrected_noise(
    before: tuple[np.ndarray, np.ndarray],
    temperature: np.ndarray,
    sensor: Sensor,
    changes: tuple[Correction, Correction],
) -> np.ndarray:
    """Standard errors, float32 K, of `corrected` temperatures.

    before: temperatures and their errors as rendered, K. changes: the correction that they have, and that of the
    result. An error as large as its temperature is unknown, and stays so; unknown is also that of a temperature where
    the first correction left no radiance. Where the second leaves none, the error is 0.
    """
    seen, noise = before
    known, new = (_slope(kelvin, sensor) for kelvin in (seen, temperature))
    old_gain, new_gain = (_gain(each, sensor) for each in changes)
    ratio = np.divide(known, new, out=np.zeros_like(new), where=new > 0.0)
    unknown = (seen <= 0.0) | (noise >= seen)
    return np.where(unknown, temperature, noise * ratio * (new_gain / old_gain)).astype(np.float32)


def _slope(kelvin: np.ndarray, sensor: Sensor) -> np.ndarray:
    """d radiance / d temperature of a blackbody, W m-2 sr-1 K-1, by a table; 0 at 0 K."""
    warm = kelvin > 0.0
    if not warm.any():
        return np.zeros(np.shape(kelvin))
    logarithm = np.log(np.where(warm, kelvin, 1.0))
    table = np.arange(logarithm[warm].min() - 0.01, logarithm[warm].max() + 0.01, 0.002)
    slopes = sensor_radiance(*sensor, np.exp(table), derivative=True) / np.exp(table)
    return np.where(warm, np.interp(logarithm, table, slopes), 0.0)


def _gain(correction: Correction, sensor: Sensor) -> float:
    """By how much more the object's radiance changes than what is seen."""
    none, one = (correction.object_radiance(value, *sensor) for value in (0.0, 1.0))
    return float(one - none)


def correction_inverted(temperature: np.ndarray, sensor: Sensor, correction: Correction) -> np.ndarray:
    """What a sensor saw, W m-2 sr-1, where a correction gives these temperatures, K, of any shape."""
    return correction.share * sensor_radiance(*sensor, temperature) + correction.other_radiance(*sensor)


def detector_noise(radiance: np.ndarray, sensor: Sensor, netd: float, photon_noise: bool) -> np.ndarray:
    """Standard deviation of a detector's pixels from frame to frame, W m-2 sr-1, where they see this radiance.

    netd: K, in front of a blackbody at the temperature at which cameras state it. photon_noise: whether the noise grows
    with the square root of the signal.
    """
    stated = sensor_radiance(*sensor, STATED)
    noise = netd * sensor_radiance(*sensor, STATED, derivative=True) / STATED
    return noise * np.sqrt(np.maximum(radiance, 0.0) / stated) if photon_noise else np.full(np.shape(radiance), noise)
