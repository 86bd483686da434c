# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of pictures as the settings of now correct them, and what the measuring tools read there.

What is computed is kept until the picture or what is asked for changes, as windows ask for it each time they are drawn.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..heat_settings import read_scale
from ..measuring.correcting import (
    Sensor,
    corrected,
    corrected_noise,
    correction_inverted,
    detector_noise,
    effective,
)
from ..measuring.regions import Region, Window, region_of
from ..measuring.statistics import Measurement, measure_values
from ..output.description import CORRECTION_FACTS
from ..output.temperature_scale import TemperatureScale, automatic_range
from ..reading.object_parameters import read_object_parameters
from ..reading.shown import as_typed
from ..solver.physics.correction import Correction
from ..solver.physics.spectrum import sensor_radiance
from ..solver.scene import SceneError
from .last_render import FinishedFrame
from .render_passes import CAMERA_TEMPERATURE


class _OfImage:
    """Results of a function of an image and of hashable arguments, kept as long as the image lives.

    most: results that are kept of one image.
    """

    def __init__(self, function: Callable, most: int = 1):
        self._function, self._most, self._kept = function, most, {}

    def __call__(self, image: np.ndarray, *arguments, **more):
        """more: what the result does not depend on, but for the image and the arguments."""
        key = id(image)
        alive, results = self._kept.get(key, (None, None))
        if alive is None or alive() is not image:
            results = {}
            self._kept[key] = weakref.ref(image, lambda _: self._kept.pop(key, None)), results
        if arguments not in results:
            while len(results) >= self._most:
                results.pop(next(iter(results)))  # the oldest
            results[arguments] = self._function(image, *arguments, **more)
        return results[arguments]


_range_of = _OfImage(automatic_range)


def fitted(scale: TemperatureScale, temperature: np.ndarray) -> TemperatureScale:
    """As scale.fitted(temperature), but an image is looked through only once."""
    if scale.low is not None and scale.high is not None:
        return scale.fitted(temperature)
    return scale.between(*_range_of(temperature))


# Pictures and their correction ----------------------------------------------------------------------------------------


class MeasuredPicture(NamedTuple):
    """A picture that can be measured: images (h, w) float32, row 0 at the bottom.

    radiance: through the sensor, W m-2 sr-1. temperature, noise: K, with the correction. window: where the images lie
    in the picture that the tools are placed in.
    """

    radiance: np.ndarray
    temperature: np.ndarray
    noise: np.ndarray
    sensor: Sensor
    correction: Correction
    window: Window


def finished_picture(images: dict, frame: FinishedFrame) -> MeasuredPicture:
    """The picture of a finished view layer. images: see final_render.layer_images."""
    return MeasuredPicture(
        images["radiance"],
        images["temperature"],
        images["noise"],
        Sensor(images["band_edges"], frame.weights),
        effective(frame.correction),
        Window(frame.size, frame.origin, images["radiance"].shape),
    )


def camera_picture(images: dict, frame: FinishedFrame) -> MeasuredPicture:
    """The same as the camera saw it, its pass Camera Temperature: the noise holds what the detector adds from frame to
    frame, as its NETD says."""
    return _camera_picture_of(images["further"][CAMERA_TEMPERATURE].image, images=images, frame=frame)


def _camera_picture(kelvin: np.ndarray, images: dict, frame: FinishedFrame) -> MeasuredPicture:
    plain, facts = finished_picture(images, frame), images["metadata"]
    seen = correction_inverted(kelvin, plain.sensor, plain.correction)
    added = detector_noise(seen, plain.sensor, facts["cameraNetd"], facts["cameraPhotonNoise"])
    slope = plain.correction.share * sensor_radiance(*plain.sensor, kelvin, derivative=True)
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing is known of 0 K
        error = np.hypot(plain.noise, added * kelvin / slope)
    return plain._replace(radiance=seen.astype(np.float32), temperature=kelvin, noise=error.astype(np.float32))


_camera_picture_of = _OfImage(_camera_picture)


def correction_now(infrared, picture: MeasuredPicture) -> Correction:
    """The correction that scene.infrared asks for; that of the picture if it makes no sense, which the checks tell."""
    try:
        return effective(read_object_parameters(infrared).correction)
    except SceneError:
        return picture.correction


def _corrected(radiance: np.ndarray, correction: Correction, sensor: Sensor) -> np.ndarray:
    return corrected(radiance, sensor, correction)


_temperature_of = _OfImage(_corrected)


def temperature_now(picture: MeasuredPicture, infrared) -> np.ndarray:
    """(h, w) float32 temperatures of a picture, K, as the settings of now correct them. Do not change them."""
    correction = correction_now(infrared, picture)
    if correction == picture.correction:
        return picture.temperature
    return _temperature_of(picture.radiance, correction, sensor=picture.sensor)


def fitting(kelvin: np.ndarray, correction: Correction) -> np.ndarray:
    """Temperatures, K, of any shape, NaN where a correction leaves no radiance of the object, so that no temperature
    fits; images hold 0 K there. Without a correction 0 K is a temperature."""
    return kelvin if correction.share == 1.0 else np.where(kelvin > 0.0, kelvin, np.float32(np.nan))


def pixel_now(picture: MeasuredPicture, infrared, pixel: tuple[int, int]) -> tuple[float, float]:
    """Temperature of one pixel and its standard error, K, as the settings of now correct them."""
    correction = correction_now(infrared, picture)
    if correction == picture.correction:
        return float(fitting(picture.temperature[pixel], correction)), float(picture.noise[pixel])
    kelvin = fitting(corrected(np.array([picture.radiance[pixel]]), picture.sensor, correction), correction)
    before = np.array([picture.temperature[pixel]]), np.array([picture.noise[pixel]])
    noise = corrected_noise(before, kelvin, picture.sensor, (picture.correction, correction))
    return float(kelvin[0]), float(noise[0])


def images_now(images: dict, frame: FinishedFrame, infrared) -> dict:
    """A finished view layer with the temperatures, their errors and the facts about them as the settings of now correct
    them. images: see final_render.layer_images."""
    picture = finished_picture(images, frame)
    correction = correction_now(infrared, picture)
    if correction == picture.correction:
        return images
    temperature = temperature_now(picture, infrared)
    before, changes = (picture.temperature, picture.noise), (picture.correction, correction)
    noise = corrected_noise(before, temperature, picture.sensor, changes)
    facts = {fact: getattr(correction, field) for fact, field in CORRECTION_FACTS.items()}
    return images | {"temperature": temperature, "noise": noise, "metadata": {**images["metadata"], **facts}}


# Measuring tools ------------------------------------------------------------------------------------------------------


def tool_correction(tool, infrared, picture: MeasuredPicture) -> Correction:
    """The correction of a measuring tool: that of the picture, with the tool's own emissivity and reflected temperature
    if it has these and they make sense."""
    correction = correction_now(infrared, picture)
    if not tool.use_own_emissivity:
        return correction
    emissivity, reflected = as_typed(tool.emissivity), as_typed(tool.reflected_temperature)
    if not (0.0 < emissivity <= 1.0 and 0.0 <= reflected < np.inf):
        return correction
    return effective(correction._replace(emissivity=emissivity, reflected_temperature=reflected))


def read_tool(tool, picture: MeasuredPicture, infrared) -> Measurement | None:
    """What a measuring tool of scene.infrared reads in a picture; None if none of its pixels is there."""
    asked = _asked(tool, picture, infrared)
    return _measurement_of(picture.radiance, asked, read_scale(infrared).isotherm, picture=picture, infrared=infrared)


def tool_values(tool, picture: MeasuredPicture, infrared) -> np.ndarray:
    """(n,) float32 temperatures, K, in the pixels of a measuring tool, of a line in their order."""
    return _values_of(picture.radiance, _asked(tool, picture, infrared), picture=picture, infrared=infrared)


class _Asked(NamedTuple):
    """What a tool's readings depend on besides the images. window: see MeasuredPicture; it moves with a viewport."""

    kind: str
    places: tuple[tuple[float, float], ...]
    correction: Correction
    window: Window

    def region(self) -> Region:
        """The tool's pixels."""
        return region_of(self.kind, self.places, self.window)


def _asked(tool, picture: MeasuredPicture, infrared) -> _Asked:
    return _Asked(tool.kind, tuple(tool.places()), tool_correction(tool, infrared, picture), picture.window)


def _values(_radiance, asked: _Asked, picture: MeasuredPicture, infrared) -> np.ndarray:
    region = asked.region()
    if asked.correction == correction_now(infrared, picture):
        return fitting(region.values(temperature_now(picture, infrared)), asked.correction)
    return fitting(corrected(region.values(picture.radiance), picture.sensor, asked.correction), asked.correction)


def _measurement(radiance, asked: _Asked, isotherm, picture: MeasuredPicture, infrared) -> Measurement | None:
    region, values = asked.region(), _values(radiance, asked, picture, infrared)
    errors = region.values(picture.noise)
    if asked.correction != picture.correction:
        before = region.values(picture.temperature), errors
        errors = corrected_noise(before, values, picture.sensor, (picture.correction, asked.correction))
    return measure_values(region, values, errors, radiance.size, isotherm)


_measurement_of, _values_of = _OfImage(_measurement, 256), _OfImage(_values, 2)


def _extremes(temperature: np.ndarray) -> tuple[tuple[int, int], tuple[int, int]]:
    cold, hot = (divmod(int(index), temperature.shape[1]) for index in (temperature.argmin(), temperature.argmax()))
    return cold, hot


_extremes_of = _OfImage(_extremes)


def extremes_now(picture: MeasuredPicture, infrared) -> tuple[tuple[int, int], tuple[int, int]]:
    """(row, column) of the coldest and of the hottest pixel of a picture, as the settings of now correct it."""
    return _extremes_of(temperature_now(picture, infrared))
