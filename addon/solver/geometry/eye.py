# SPDX-License-Identifier: GPL-3.0-or-later
"""Eye rays: from the camera, with a low-discrepancy sequence over all passes inside the pixel and on the lens."""

import math
from typing import NamedTuple

import numpy as np

from ..sampling.low_discrepancy import scrambled
from ..sampling.rng import path_key
from ..sampling.warps import triangle_point, turn
from ..scene import Camera, SceneError
from ..system.kernels import KERNEL, njit

_CLEAR_OF_SCENE = 1.01  # factor on the radius of the sphere around the scene: rays start in front of all surfaces
_PIXEL_X, _PIXEL_Y, _LENS_U, _LENS_V = np.arange(4)  # dimensions of the sequence; no literals, see kernels
KINDS = {"PERSPECTIVE": 0, "ORTHOGRAPHIC": 1, "PANORAMA": 2}


class Eye(NamedTuple):
    """The camera for the kernels, in solver coordinates; see scene.Camera.

    radius: m, of a sphere around the origin that holds the scene: rays of a camera outside start on this sphere.
    """

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
    radius: float


def build_eye(camera: Camera, centre: np.ndarray, radius: float) -> Eye:
    """The Eye of a camera. centre: (3,) m, of the scene, subtracted from world coordinates. radius: m, of a sphere
    around it that holds the scene.

    Raises SceneError for a camera that can have no image.
    """
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
    left, right, bottom, top = camera.frame
    if not (0 < right - left < np.inf and 0 < top - bottom < np.inf):
        raise SceneError(f"Camera: the frame {camera.frame} (left, right, bottom, top) has no extent")
    if not (0 <= camera.lens_radius < np.inf and 0 < camera.lens_ratio < np.inf):
        raise SceneError(
            f"Camera: a lens of {camera.lens_radius:g} m, squeezed by {camera.lens_ratio:g}, has no opening"
        )
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
        _CLEAR_OF_SCENE * radius,
    )


@njit(inline="always")
def _turned(matrix, x, y, z):
    """A direction in camera space, turned to world space."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z,
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


@njit(inline="always")
def _way_to_sphere(ox, oy, oz, dx, dy, dz, radius):
    """Distance along a ray, in units of the direction's length, at which the ray enters the sphere around the origin.
    0 for rays from inside. For a ray that passes by the sphere, the distance to the nearest point to the origin.
    """
    length2 = dx * dx + dy * dy + dz * dz
    nearest = -(ox * dx + oy * dy + oz * dz) / length2
    x, y, z = ox + nearest * dx, oy + nearest * dy, oz + nearest * dz
    return max(0.0, nearest - math.sqrt(max(0.0, radius * radius - (x * x + y * y + z * z)) / length2))


def empty_eye_rays(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Room for count rays: origin, direction and reach, see eye_rays."""
    return np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty(count, np.float32)


@njit(**KERNEL)
def eye_rays(eye, key, index, samples, pixels, origin, direction, reach):
    """Fill the rays of pass `index`: samples (n,) rays of each of n pixels, the rays of a pixel one behind the other.

    key: of the camera stream of the seed (not of the pass: all passes share one sequence). pixels: (n,) int64, numbers
    in the window, row by row from the bottom.
    origin, direction: (r, 3) float32, r the sum of samples; directions are not normalised. reach: (r,) float32, up to
    which a ray sees, in units of the direction's length.
    """
    columns = eye.window[2] - eye.window[0]
    row = 0
    for i in range(pixels.size):
        x, y = eye.window[0] + pixels[i] % columns, eye.window[1] + pixels[i] // columns
        path = path_key(key, y * eye.width + x)
        for sample in range(samples[i]):
            n = (np.int64(index) * samples[i] + sample) & 0xFFFFFFFF
            s, t = scrambled(n, path, _PIXEL_X), scrambled(n, path, _PIXEL_Y)
            u = v = 0.0
            if eye.lens_radius > 0.0:
                u, v = scrambled(n, path, _LENS_U), scrambled(n, path, _LENS_V)
            _put_eye_ray(eye, x + s, y + t, (u, v), origin, direction, reach, row)
            row += 1


@njit(**KERNEL)
def rays_through(eye, x, y, origin, direction, reach):
    """Fill one ray for each of n places in the picture, (n,) each, in pixels from the lower left of the whole picture.
    eye: a pinhole, with a lens_radius of 0. Other arguments as in eye_rays."""
    for i in range(x.size):
        _put_eye_ray(eye, x[i], y[i], (0.0, 0.0), origin, direction, reach, i)


@njit(inline="always")
def _put_eye_ray(eye, x, y, lens, origin, direction, reach, row):
    """Fill one ray: through the frame at (x, y), in pixels from its lower left, and the lens at two numbers in [0, 1).

    An origin far from the scene is moved along the ray to the scene in float64, as float32 would shift the view.
    """
    m = eye.matrix
    fx = eye.frame[0] + (eye.frame[1] - eye.frame[0]) * (x / eye.width)
    fy = eye.frame[2] + (eye.frame[3] - eye.frame[2]) * (y / eye.height)
    lx = ly = 0.0
    if eye.lens_radius > 0.0:
        lx, ly = _lens_point(eye, lens[0], lens[1])
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
    ox, oy, oz = _turned(m, ox, oy, oz)
    dx, dy, dz = _turned(m, dx, dy, dz)
    ox, oy, oz = ox + m[0, 3], oy + m[1, 3], oz + m[2, 3]
    way = _way_to_sphere(ox, oy, oz, dx, dy, dz, eye.radius)
    origin[row, 0], origin[row, 1], origin[row, 2] = ox + way * dx, oy + way * dy, oz + way * dz
    direction[row, 0], direction[row, 1], direction[row, 2] = dx, dy, dz
    reach[row] = max(0.0, eye.clip[1] - eye.clip[0] - way)
