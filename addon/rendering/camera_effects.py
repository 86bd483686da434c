# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera effects of a render: the settings become the solver's Detector, and its images become passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..reading.bands import read_band_edges
from ..reading.sensor import read_response
from ..reading.shown import as_shown, as_typed
from ..solver.image.detector import Detector, check_range, expose
from ..solver.physics.sensors import band_weights
from ..solver.scene import Camera, SceneError
from .render_passes import CAMERA_TEMPERATURE


def read_detector(scene, camera) -> Detector | None:
    """The detector of a scene's settings and of a camera object, None if there are to be no effects.

    camera: the object, evaluated for a render. Raises SceneError, naming the value, if one makes no sense.
    """
    infrared = scene.infrared
    if not infrared.use_detector:
        return None
    names = {*Detector.__dataclass_fields__} - {"pitch", "range"}
    try:
        detector = Detector(
            **{name: as_typed(getattr(infrared, f"detector_{name}")) for name in names},
            pitch=_pitch(scene.render, camera.data, as_typed(infrared.detector_pitch)),
            range=(as_typed(infrared.detector_low), as_typed(infrared.detector_high)),
        )
    except SceneError as error:
        raise SceneError(as_shown(error, infrared, {name: f"detector_{name}" for name in names})) from error
    edges = read_band_edges(infrared)
    check_range(detector, edges, band_weights(read_response(infrared), edges))
    return detector


def _pitch(render, camera, pitch: float) -> tuple[float, float]:
    """Distance of the detector's pixels, (x, y) um.

    pitch: um in x at a resolution of 100 %; 0 divides the size of Blender's camera sensor by the number of pixels along
    the side that Blender fits it to.
    """
    stretch = render.pixel_aspect_y / render.pixel_aspect_x
    width, height = render.resolution_x, render.resolution_y * stretch
    if pitch == 0.0:
        upright = camera.sensor_fit == "VERTICAL" or (camera.sensor_fit == "AUTO" and height > width)
        size = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
        pitch = 1000.0 * size / (height if upright else width)
    pitch *= 100.0 / render.resolution_percentage
    return pitch, pitch * stretch


@dataclass
class CameraEffects:
    """Makes the images of the passes Camera Signal and Camera Temperature.

    camera: the solver's. frame: its number, which the noise depends on. clipped: how many pixels of the last images
    were outside the range of the digital numbers.
    """

    detector: Detector
    camera: Camera
    frame: int
    clipped: int = 0

    def __call__(self, film, images: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        bands = [images[name] for name in film.band_names]
        signal, temperature, self.clipped = expose(
            bands, film.band_edges, film.weights, self.detector, self.camera, self.frame, film.correction
        )
        return {"Camera Signal": signal, CAMERA_TEMPERATURE: temperature}

    def warning(self) -> str:
        """How many pixels of the last images were clipped, in words; an empty text if none were."""
        if not self.clipped:
            return ""
        x0, y0, x1, y1 = self.camera.pixels
        low, high = self.detector.range
        return (
            f"{self.clipped} of {(x1 - x0) * (y1 - y0)} pixels are outside the camera's range from {low:g} K to "
            f"{high:g} K; Camera Signal and Camera Temperature are clipped there"
        )

    def facts(self) -> dict[str, object]:
        """The effects by the names that files give them."""
        detector = self.detector
        return {
            "cameraUnits": "cameraPitch: um; cameraNetd, cameraOffsetSpread, cameraRange: K",
            "cameraFNumber": detector.f_number,
            "cameraPitch": " ".join(map(str, detector.pitch)),
            "cameraFillFactor": detector.fill_factor,
            "cameraNetd": detector.netd,
            "cameraPhotonNoise": detector.photon_noise,
            "cameraGainSpread": detector.gain_spread,
            "cameraOffsetSpread": detector.offset_spread,
            "cameraBits": detector.bits,
            "cameraRange": " ".join(map(str, detector.range)),
            "cameraSeed": detector.seed,
            "cameraFrame": self.frame,
        }
