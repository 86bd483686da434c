# SPDX-License-Identifier: GPL-3.0-or-later
"""Eye rays: one per pixel and pass, low-discrepancy over the passes inside the pixel and on the lens."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from .rng import path_key, uniform
from .sampling import fraction, triangle_point, turn
from .scene import Camera, SceneError

KINDS = {"PERSPECTIVE": 0, "ORTHOGRAPHIC": 1, "PANORAMA": 2}

# Additive recurrence of the generalised golden ratio in four dimensions (x^5 = x + 1): pixel x, y and lens u, v.
_RATIO = 1.1673039782614187
_ALPHA = tuple(_RATIO ** -(i + 1) for i in range(4))


class Eye(NamedTuple):
    """Camera for the kernels, in solver coordinates; see scene.Camera."""

    kind: int
    matrix: np.ndarray  # (3, 4) float64
    frame: np.ndarray  # (4,) float64
    width: int
    height: int
    window: np.ndarray  # (4,) int64
    clip: np.ndarray  # (2,) float64
    lens_radius: float
    focus_distance: float
    blades: int
    blade_rotation: float
    lens_ratio: float


def build_eye(camera: Camera, centre: np.ndarray) -> Eye:
    """Eye of a camera; centre (3,) is subtracted from its position. Raises SceneError for what has no image."""
    if camera.kind not in KINDS:
        raise SceneError(f"Camera: kind '{camera.kind}' is unknown; known are {', '.join(KINDS)}")
    x0, y0, x1, y1 = camera.pixels
    if not (0 <= x0 < x1 <= camera.width and 0 <= y0 < y1 <= camera.height):
        raise SceneError(f"Camera: window {camera.pixels} is empty or outside {camera.width}x{camera.height} pixels")
    matrix = np.array(camera.matrix, dtype=np.float64)[:3]
    if matrix.shape != (3, 4) or not np.all(np.isfinite(matrix)):
        raise SceneError("Camera: its matrix must be 4x4 and finite")
    matrix[:, 3] -= centre
    start, end = camera.clip
    if not 0 <= start < end:
        raise SceneError(f"Camera: clip range {start:g}..{end:g} m is empty")
    if camera.lens_radius > 0 and not camera.focus_distance > 0:
        raise SceneError(f"Camera: focus distance {camera.focus_distance:g} m must be above 0")
    return Eye(
        KINDS[camera.kind],
        np.ascontiguousarray(matrix),
        np.array(camera.frame, dtype=np.float64),
        camera.width,
        camera.height,
        np.array(camera.pixels, dtype=np.int64),
        np.array([start, min(end, 1e37)]),
        float(camera.lens_radius),
        float(camera.focus_distance),
        int(camera.blades),
        float(camera.blade_rotation),
        float(camera.lens_ratio),
    )


@njit(inline="always")
def _lens_point(eye, u, v):
    """Point on the unit aperture: a disk, or a regular polygon."""
    if eye.blades < 3:
        r = math.sqrt(u)
        c, s = turn(v)
        return r * c / eye.lens_ratio, r * s
    corner = math.floor(u * eye.blades)
    s, t = triangle_point(u * eye.blades - corner, v)
    a = eye.blade_rotation + 2.0 * math.pi * corner / eye.blades
    b = eye.blade_rotation + 2.0 * math.pi * (corner + 1.0) / eye.blades
    x = s * math.cos(a) + t * math.cos(b)
    return x / eye.lens_ratio, s * math.sin(a) + t * math.sin(b)


@njit(cache=True, nogil=True)
def eye_rays(eye, key, index, first, origin, direction, reach):
    """Fill one ray for each of n pixels from pixel `first` of the window (row by row from the bottom).

    key: of the camera stream of the seed (not of the pass: the passes share one sequence). index: of the pass.
    origin, direction: (n, 3) float32; the direction is not normalised. reach: (n,) float32 in its units.
    """
    columns = eye.window[2] - eye.window[0]
    m = eye.matrix
    for i in range(origin.shape[0]):
        pixel = first + i
        x, y = eye.window[0] + pixel % columns, eye.window[1] + pixel // columns
        path = path_key(key, y * eye.width + x)
        s0 = fraction(uniform(path, 0) + index * _ALPHA[0])
        s1 = fraction(uniform(path, 1) + index * _ALPHA[1])
        fx = eye.frame[0] + (eye.frame[1] - eye.frame[0]) * ((x + s0) / eye.width)
        fy = eye.frame[2] + (eye.frame[3] - eye.frame[2]) * ((y + s1) / eye.height)
        lx = ly = 0.0
        if eye.lens_radius > 0.0:
            s2 = fraction(uniform(path, 2) + index * _ALPHA[2])
            s3 = fraction(uniform(path, 3) + index * _ALPHA[3])
            lx, ly = _lens_point(eye, s2, s3)
            lx, ly = lx * eye.lens_radius, ly * eye.lens_radius
        if eye.kind == 0:
            ox, oy = lx, ly
            dx, dy, dz = fx - lx / eye.focus_distance, fy - ly / eye.focus_distance, -1.0
        elif eye.kind == 1:
            ox, oy = fx + lx, fy + ly
            dx, dy, dz = -lx / eye.focus_distance, -ly / eye.focus_distance, -1.0
        else:
            ox = oy = 0.0
            dx, dy, dz = math.sin(fx) * math.cos(fy), math.sin(fy), -math.cos(fx) * math.cos(fy)
        ox, oy, oz = ox + dx * eye.clip[0], oy + dy * eye.clip[0], dz * eye.clip[0]
        for axis in range(3):
            origin[i, axis] = m[axis, 0] * ox + m[axis, 1] * oy + m[axis, 2] * oz + m[axis, 3]
            direction[i, axis] = m[axis, 0] * dx + m[axis, 1] * dy + m[axis, 2] * dz
        reach[i] = eye.clip[1] - eye.clip[0]
