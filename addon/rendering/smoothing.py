# SPDX-License-Identifier: GPL-3.0-or-later
"""A first picture without blotches: what is reflected is smoothed along surfaces that the engine knows.

After one pass the light that surfaces reflect is blotchy, while the first surface behind each pixel, its temperature
and its emissivity are known without noise. So only the reflected part of the radiance is smoothed, and only between
pixels that see the same even surface: the first level of an edge-avoiding wavelet transform (H. Dammertz, D. Sewtz, J.
Hanika, H. P. A. Lensch, Edge-avoiding a-trous wavelet transform for fast global illumination filtering, High
Performance Graphics 2010), guided by first hits instead of the picture. The error of a first picture falls to about a
half; a second level would blur the light at corners by more than it takes of the noise (tests/test_smoothing.py). It is
for the eye alone: readings are of the radiance as it was rendered.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from ..solver import Scene, first_hit_images
from ..solver.camera.first_hits import FAR
from ..solver.geometry.surfaces import Geometry
from ..solver.physics.spectrum import sensor_radiance

GUIDES = ("surface_temperature", "emissivity", "normal", "position", "depth")
TAPS = np.array([1.0, 4.0, 6.0, 4.0, 1.0], np.float32) / 16.0  # of a B-spline, the wavelet's smooth part
ROUGH = 0.5  # roughness of a specular lobe that is wide enough to be smoothed; what mirrors show is not
BEND = 0.97  # least cosine between normals of one even surface
RISE = 0.1  # most height above a tangent plane, over the distance
SAME = 0.02  # most difference of emissivities


def may_be_smoothed(scene: Scene) -> bool:
    """Whether first hits say what is behind the pixels of a scene: not in gas, and not out of focus."""
    return not scene.media and scene.camera.lens_radius == 0.0


def smoothed(
    radiance: np.ndarray,
    scene: Scene,
    sensor: tuple[np.ndarray, np.ndarray],
    geometry: Geometry | None = None,
    threads: int = 1,
    cancelled: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """A picture of a scene with what is reflected smoothed, (h, w) float32 W m-2 sr-1.

    radiance: (h, w), of the picture. sensor: edges (b + 1,) of the bands, um, and its response (b,). cancelled: the
    result is then of no use.
    """
    known = first_hit_images(scene, GUIDES, {"even": _even(scene)}, geometry, threads, cancelled)
    even = (known["even"] > 0.5) & (known["depth"] < FAR)
    emitted = known["emissivity"] * sensor_radiance(*sensor, known["surface_temperature"])
    even &= _alike(known, even)
    reflected = np.where(even, radiance - emitted, 0.0).astype(np.float32)
    return np.where(even, emitted + _level(reflected, known, even), radiance).astype(np.float32)


def _even(scene: Scene) -> np.ndarray:
    """(t,) float32, 1 for triangles that reflect no sharp image and let nothing through, else 0."""
    sharp = [
        bool(np.any(each.transmittance)) or (each.specular > 0.0 and each.roughness < ROUGH) for each in scene.materials
    ]
    even = ~np.array(sharp, bool)[scene.material]
    if scene.textures is not None:  # a pixel may hold more of an image than its middle shows
        even[scene.textures.triangle] = False
    return even.astype(np.float32)


def _shifted(image: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """An image whose pixels are those so many rows and columns on; beyond its edge its last ones are repeated."""
    height, width = image.shape[:2]
    row = np.clip(np.arange(height) + rows, 0, height - 1)
    column = np.clip(np.arange(width) + columns, 0, width - 1)
    return image[row[:, None], column]


def _same_surface(known: dict[str, np.ndarray], rows: int, columns: int) -> np.ndarray:
    """(h, w) bool, whether the pixel so many rows and columns on sees the same even surface."""
    normal, position, emissivity = known["normal"], known["position"], known["emissivity"]
    way = _shifted(position, rows, columns) - position
    height = np.abs(np.einsum("hwi,hwi->hw", normal, way))
    same = height <= RISE * np.sqrt(np.einsum("hwi,hwi->hw", way, way))
    same &= np.einsum("hwi,hwi->hw", normal, _shifted(normal, rows, columns)) > BEND
    return same & (np.abs(_shifted(emissivity, rows, columns) - emissivity) < SAME)


def _alike(known: dict[str, np.ndarray], even: np.ndarray) -> np.ndarray:
    """(h, w) bool, whether the four pixels beside one see the same surface: an edge inside a pixel is a mixture."""
    result = np.ones(even.shape, bool)
    for rows, columns in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        result &= _same_surface(known, rows, columns) & _shifted(even, rows, columns)
    return result


def _level(reflected: np.ndarray, known: dict[str, np.ndarray], even: np.ndarray) -> np.ndarray:
    """One level of the transform."""
    total, weights = np.zeros_like(reflected), np.zeros_like(reflected)
    for (i, across), (j, up) in product(enumerate(TAPS), repeat=2):
        shift = i - 2, j - 2
        weight = across * up * (_same_surface(known, *shift) & _shifted(even, *shift))
        total += weight * _shifted(reflected, *shift)
        weights += weight
    return total / np.maximum(weights, 1e-30)
