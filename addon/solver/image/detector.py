# SPDX-License-Identifier: GPL-3.0-or-later
"""What a real camera adds to a finished image: diffraction of the optics, noise of the detector, and digital numbers.

In the order in which they act on the signal (docs/detector.md):

    optics            each band is blurred by the aperture's diffraction at the wavelength in its middle
    response          the bands add up through the sensor's response to the signal L, W m-2 sr-1
    fixed pattern     L (1 + gain) + offset, gain and offset of each pixel the same in all frames
    temporal noise    normally distributed, new in each frame
    quantisation      to a number of bits between the signals of two blackbodies; signals outside are clipped

All functions make a copy of the image: the film is not changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..physics.correction import Correction
from ..physics.spectrum import apparent_temperature, sensor_radiance
from ..scene import Camera, SceneError

STATED = 300.0  # K: blackbody at which noise and offsets are stated, as makers of cameras do
MOST_BITS = 24  # digital numbers that float32 holds exactly

# Streams of random numbers. A frame's number follows the last one.
_GAIN, _OFFSET, _TEMPORAL = 1, 2, 3


@dataclass(frozen=True)
class Detector:
    """Optics and detector of a thermal camera. The defaults are ideal: they change nothing.

    f_number: N of the optics; 0 is without diffraction.
    pitch: (x, y) um, from one pixel of the image to the next.
    fill_factor: share of a pixel's area that detects, a square in its middle; above 0, at most 1.
    netd: K, standard deviation of the temporal noise in front of a blackbody at STATED, with this f_number.
    photon_noise: whether the temporal noise grows with the square root of the signal, as the noise of photons does;
        else it is the same for all signals.
    gain_spread: relative standard deviation of the pixels' gains.
    offset_spread: K at STATED, standard deviation of the pixels' offsets.
    bits: of a digital number, at most MOST_BITS; 0 does not quantise.
    range: K, the blackbodies whose signals are the lowest and the highest digital number.
    seed: of the pixels' gains and offsets, and of the noise.

    Raises SceneError, naming the value, for a value that makes no sense.
    """

    f_number: float = 0.0
    pitch: tuple[float, float] = (12.0, 12.0)
    fill_factor: float = 1.0
    netd: float = 0.0
    photon_noise: bool = False
    gain_spread: float = 0.0
    offset_spread: float = 0.0
    bits: int = 0
    range: tuple[float, float] = (233.15, 423.15)
    seed: int = 0

    def __post_init__(self):
        for name, unit in (("f_number", ""), ("netd", " K"), ("gain_spread", ""), ("offset_spread", " K")):
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise SceneError(f"Camera effects: {name} is {value:g}{unit}, expected a finite number of 0 or more")
        for pitch in self.pitch:
            if not 0.0 < pitch < np.inf:
                raise SceneError(f"Camera effects: the pixel pitch is {pitch:g} um, expected a finite number above 0")
        if not 0.0 < self.fill_factor <= 1.0:
            raise SceneError(f"Camera effects: fill_factor is {self.fill_factor:g}, expected above 0 to 1")
        if not 0 <= self.bits <= MOST_BITS:
            raise SceneError(f"Camera effects: {self.bits} bits, expected 0 to {MOST_BITS}")
        low, high = self.range
        if not 0.0 <= low < high < np.inf:
            raise SceneError(
                f"Camera effects: the range from {low:g} K to {high:g} K is none; it rises from 0 K or more"
            )
        if not 0 <= self.seed < 2**63:
            raise SceneError(f"Camera effects: seed is {self.seed}, expected 0 to 2^63 - 1")


class Exposure(NamedTuple):
    """The image of a camera. signal: (h, w) float32, digital numbers with quantisation, else W m-2 sr-1.
    temperature: (h, w) float32 K. clipped: pixels that were outside the range of the digital numbers."""

    signal: np.ndarray
    temperature: np.ndarray
    clipped: int


def check_range(detector: Detector, edges: np.ndarray, weights: np.ndarray) -> None:
    """Raise SceneError if the sensor gets nothing from the range of the digital numbers. Arguments as of `expose`."""
    if detector.bits:
        _digital_range(detector, edges, weights)


def expose(
    bands: Sequence[np.ndarray],
    edges: np.ndarray,
    weights: np.ndarray,
    detector: Detector,
    camera: Camera,
    frame: int = 0,
    correction: Correction | None = None,
) -> Exposure:
    """What a camera makes of a finished image.

    bands: (h, w) spectral radiance of each band, W m-2 sr-1 um-1. edges: (b + 1,) um. weights: (b,) response in each.
    camera: of the image; a window of the frame gets the gains, offsets and noise of its pixels in the whole frame.
    frame: number of the frame, on which the temporal noise depends. correction: of the temperature, as the film's.

    Raises SceneError as `check_range` does.
    """
    correction = correction or Correction()
    power = weights * np.diff(edges)  # um
    if detector.f_number > 0.0:
        signal = _through_optics(bands, 0.5 * (edges[:-1] + edges[1:]), power, detector)
    else:
        signal = sum(share * np.asarray(band, np.float64) for share, band in zip(power, bands, strict=True))
    signal = _with_noise(signal, edges, weights, detector, camera, frame)
    numbers, clipped = signal, 0
    if detector.bits:
        lowest, step, largest = _digital_range(detector, edges, weights)
        numbers = np.rint((signal - lowest) / step)
        clipped = int(np.count_nonzero((numbers < 0) | (numbers > largest)))
        numbers = np.clip(numbers, 0, largest)
        signal = lowest + step * numbers
    temperature = apparent_temperature(correction.object_radiance(signal, edges, weights), edges, weights)
    return Exposure(numbers.astype(np.float32), temperature.astype(np.float32), clipped)


# Optics ---------------------------------------------------------------------------------------------------------------


def diffraction_mtf(frequency: np.ndarray, wavelength: float | np.ndarray, f_number: float) -> np.ndarray:
    """Modulation transfer of an aberration-free circular aperture in incoherent light, 1 to 0, any shape.

    frequency: cycles/um in the focal plane. wavelength: um. With v = frequency wavelength f_number it is
    2/pi (acos v - v sqrt(1 - v^2)), and 0 above the cutoff v = 1 (G. D. Boreman, Modulation Transfer Function in
    Optical and Electro-Optical Systems, SPIE 2001, section 1.5.1).
    """
    v = np.minimum(np.abs(frequency) * (wavelength * f_number), 1.0)
    return 2.0 / np.pi * (np.arccos(v) - v * np.sqrt(1.0 - v * v))


def footprint_mtf(x: np.ndarray, y: np.ndarray, detector: Detector) -> np.ndarray:
    """Modulation transfer of the detecting squares beyond that of whole pixels. x, y: frequencies, cycles/um.

    Rendered pixels are means over their whole area, so the footprint of a fill factor of 1 is in the image already.
    What is left is sinc(a x) sinc(a y), with the side a of the detecting square, over the same with the pitch: 1 or
    more.
    """
    side = np.sqrt(detector.fill_factor)
    across, up = detector.pitch
    gain_x = np.sinc(side * across * x) / np.sinc(across * x)
    return gain_x * (np.sinc(side * up * y) / np.sinc(up * y))


def _through_optics(
    bands: Sequence[np.ndarray], wavelengths: np.ndarray, power: np.ndarray, detector: Detector
) -> np.ndarray:
    """(h, w) sum over bands of power times the band's image, blurred. wavelengths: (b,) um.

    The image is continued by its mirror image, so that nothing comes in from the opposite edge. Its Fourier series then
    holds cosines alone. The series of all bands are added up and transformed back together. The footprint sharpens the
    image, but never more than the aperture blurs it: the product of both is at most 1.
    """
    (height, width), (across, up) = bands[0].shape, detector.pitch
    x = 0.5 * np.arange(width) / (width * across)  # cycles/um
    y = 0.5 * np.arange(height)[:, None] / (height * up)
    radius, footprint, series = np.hypot(x, y), footprint_mtf(x, y, detector), 0.0
    for band, wavelength, share in zip(bands, wavelengths, power, strict=True):
        transfer = np.minimum(diffraction_mtf(radius, wavelength, detector.f_number) * footprint, 1.0)
        series = series + share * transfer * _cosines(_cosines(np.asarray(band, np.float64)).T).T
    return _from_cosines(_from_cosines(series.T).T)


def _cosines(rows: np.ndarray) -> np.ndarray:
    """Cosine series of rows (m, n), each continued by its mirror image: the discrete cosine transform of type II.

    By one Fourier transform of n numbers: those at even indices, then those at odd indices backwards (J. Makhoul, A
    fast cosine transform in one and two dimensions, IEEE Trans. ASSP 28, 27, 1980).
    """
    n = rows.shape[1]
    middle = n // 2
    spectrum = np.fft.rfft(np.concatenate((rows[:, ::2], rows[:, 1::2][:, ::-1]), axis=1))
    spectrum *= 2.0 * np.exp(-0.5j * np.pi / n * np.arange(middle + 1))
    series = np.empty_like(rows)
    series[:, : middle + 1] = spectrum.real
    series[:, :middle:-1] = -spectrum.imag[:, 1 : n - middle]
    return series


def _from_cosines(series: np.ndarray) -> np.ndarray:
    """The inverse of `_cosines`, by the Fourier transform of rows and mirror images."""
    n = series.shape[1]
    return np.fft.irfft(series * np.exp(0.5j * np.pi / n * np.arange(n)), 2 * n)[:, :n]


# Noise ----------------------------------------------------------------------------------------------------------------


def _with_noise(signal: np.ndarray, edges, weights, detector: Detector, camera: Camera, frame: int) -> np.ndarray:
    """The signal (h, w) with the pixels' gains and offsets, and the noise of a frame."""
    stated = sensor_radiance(edges, weights, STATED)
    per_kelvin = sensor_radiance(edges, weights, STATED, derivative=True) / STATED
    if detector.gain_spread > 0.0:
        signal = signal * (1.0 + detector.gain_spread * _normal(camera, detector.seed, _GAIN))
    if detector.offset_spread > 0.0:
        signal = signal + detector.offset_spread * per_kelvin * _normal(camera, detector.seed, _OFFSET)
    if detector.netd > 0.0:
        noise = detector.netd * per_kelvin * _normal(camera, detector.seed, _TEMPORAL, frame % 2**32)
        signal = signal + (noise * np.sqrt(np.maximum(signal, 0.0) / stated) if detector.photon_noise else noise)
    return signal


def _normal(camera: Camera, *key: int) -> np.ndarray:
    """(h, w) normally distributed numbers of the pixels in the camera's window, the same for each window."""
    x0, y0, x1, y1 = camera.pixels
    return np.random.default_rng(key).standard_normal((camera.height, camera.width))[y0:y1, x0:x1]


# Digital numbers ------------------------------------------------------------------------------------------------------


def _digital_range(detector: Detector, edges, weights) -> tuple[float, float, int]:
    """Signal of the number 0 and signal of one step, W m-2 sr-1, and the largest number."""
    low, high = detector.range
    lowest, highest = sensor_radiance(edges, weights, np.array([low, high]))
    largest = 2**detector.bits - 1
    step = (highest - lowest) / largest
    if not step > 0.0:
        raise SceneError(
            f"Camera effects: the sensor gets the same from {low:g} K and from {high:g} K; take a wider range"
        )
    return float(lowest), float(step), largest
