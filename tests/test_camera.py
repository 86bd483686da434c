# SPDX-License-Identifier: GPL-3.0-or-later
"""Eye rays: where they start, where they go and how they spread over pixel and lens."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

from addon.solver import Camera, SceneError
from addon.solver.geometry.eye import build_eye, eye_rays
from addon.solver.sampling.low_discrepancy import reversed_sobol
from addon.solver.sampling.rng import CAMERA, pass_key
from tests.helpers.scenes import look

KEY = pass_key(0, 2**32 - 1, CAMERA)
ORIGIN = np.zeros(3)
WIDTH, HEIGHT = 12, 7

FRAMES = {
    "PERSPECTIVE": (-0.5, 0.7, -0.3, 0.2),
    "ORTHOGRAPHIC": (-6.0, 4.0, -2.0, 3.0),
    "PANORAMA": (-np.pi, np.pi, -np.pi / 2, np.pi / 2),
}
KINDS = pytest.mark.parametrize("kind", FRAMES)


def camera(kind, **options):
    """Camera at the origin that looks along -Z."""
    return Camera(WIDTH, HEIGHT, kind=kind, frame=FRAMES[kind], **options)


def rays(camera, index=0, first=0, count=None, centre=ORIGIN, radius=np.inf):
    """Origins (n, 3), directions (n, 3), reaches (n,) of the pixels of the window, float32."""
    x0, y0, x1, y1 = camera.pixels
    count = (x1 - x0) * (y1 - y0) if count is None else count
    origin, direction = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    reach = np.empty(count, np.float32)
    pixels = np.arange(first, first + count)
    once = np.ones(count, np.uint16)
    eye_rays(build_eye(camera, centre, radius), KEY, index, once, pixels, origin, direction, reach)
    return origin, direction, reach


def frame_position(camera, origin, direction):
    """Pixel coordinates (n, 2) of rays in camera space, by the definition of each kind of camera."""
    origin, direction = origin.astype(float), direction.astype(float)
    if camera.kind == "PERSPECTIVE":
        plane = direction[:, :2] / -direction[:, 2:]
    elif camera.kind == "ORTHOGRAPHIC":
        plane = origin[:, :2]
    else:
        longitude = np.arctan2(direction[:, 0], -direction[:, 2])
        latitude = np.arcsin(np.clip(direction[:, 1], -1, 1))
        plane = np.column_stack((longitude, latitude))
    left, right, bottom, top = camera.frame
    return (plane - (left, bottom)) / (right - left, top - bottom) * (camera.width, camera.height)


def corners(camera):
    """Lower left corners (n, 2) of the pixels of the window, row by row from the bottom."""
    x0, y0, x1, y1 = camera.pixels
    return np.array([(x, y) for y in range(y0, y1) for x in range(x0, x1)], float)


def lens_rays(eye, key, count):
    """Origins (count, 3) of the first pixel's rays in one pass."""
    origins, directions = np.empty((2, count, 3), np.float32)
    samples, pixels, reach = np.array([count], np.uint16), np.zeros(1, np.int64), np.empty(count, np.float32)
    eye_rays(eye, key, 0, samples, pixels, origins, directions, reach)
    return origins


def sobol(count, dimension):
    """The first points' coordinates as fractions of 2^32."""
    return np.array([int(f"{reversed_sobol(i, dimension):032b}"[::-1], 2) for i in range(count)], float)


def test_sequence_is_sobols():
    """The first 2^m points are those of another implementation, which lists them in Gray-code order."""
    count = 1024
    expected = qmc.Sobol(4, scramble=False, bits=32).random(count)
    index = np.arange(count)
    for dimension in range(4):
        points = sobol(count, dimension)[index ^ (index >> 1)] * 2.0**-32
        np.testing.assert_array_equal(points, expected[:, dimension])


@KINDS
def test_rays_pass_through_their_pixels(kind):
    view = camera(kind)
    for index in range(20):
        origin, direction, _ = rays(view, index)
        inside = frame_position(view, origin, direction) - corners(view)
        assert inside.min() > -1e-5 and inside.max() < 1 + 1e-5  # float32 of a frame 12 pixels wide


@KINDS
def test_passes_cover_every_pixel_evenly(kind):
    """After 2^m passes each pixel has one sample in each of 2^m strips: their mean is the centre to half a strip."""
    view, passes = camera(kind), 256
    positions = [frame_position(view, *rays(view, index)[:2]) for index in range(passes)]
    inside = np.array(positions) - corners(view)
    assert np.abs(inside.mean(axis=0) - 0.5).max() < 0.5 / passes + 1e-5
    # a box filter: in each pixel one sample in each of 16 x 16 cells, but for float32 at the cells' borders
    counts = np.histogram2d(*inside.reshape(-1, 2).T, bins=16, range=[[0, 1], [0, 1]])[0]
    np.testing.assert_allclose(counts, WIDTH * HEIGHT, atol=3)


def test_pixels_are_sampled_independently():
    """One sequence for all pixels would turn its error into a shift of the image."""
    view = camera("PERSPECTIVE")
    inside = frame_position(view, *rays(view)[:2]) - corners(view)
    assert len(np.unique(inside.round(6), axis=0)) == WIDTH * HEIGHT


@KINDS
def test_window_has_the_pixels_of_the_full_frame(kind):
    full = rays(camera(kind), 3)
    x0, y0, x1, y1 = window = (2, 1, 9, 6)
    part = rays(camera(kind, window=window), 3)
    for whole, border in zip(full, part, strict=True):
        whole = whole.reshape(HEIGHT, WIDTH, -1)[y0:y1, x0:x1]
        assert np.array_equal(border, whole.reshape(border.shape))


def test_chunks_of_pixels_are_the_same_rays():
    view = camera("PERSPECTIVE", lens_radius=0.1)
    for whole, chunk in zip(rays(view, 1), rays(view, 1, first=17, count=30), strict=True):
        assert np.array_equal(whole[17:47], chunk)


@KINDS
@pytest.mark.parametrize("lens_radius", [0.0, 0.05])
def test_clip_is_a_range_of_depth(kind, lens_radius):
    start, end = 0.5, 20.0
    clipped = camera(kind, clip=(start, end), lens_radius=lens_radius, focus_distance=3.0)
    origin, direction, reach = rays(clipped)
    free_origin, free_direction, free_reach = rays(replace(clipped, clip=(0.0, np.inf)))
    assert np.array_equal(direction, free_direction)
    assert free_reach.min() > 1e30 and np.all(np.isfinite(free_reach))
    if kind == "PANORAMA":
        first, last = np.linalg.norm(origin, axis=1), np.linalg.norm(origin + reach[:, None] * direction, axis=1)
    else:
        first, last = -origin[:, 2], -(origin + reach[:, None] * direction)[:, 2]
    np.testing.assert_allclose(first, start, rtol=1e-6)  # float32
    np.testing.assert_allclose(last, end, rtol=1e-6)
    np.testing.assert_allclose(free_origin + start * direction, origin, atol=1e-6)  # the same line


def test_matrix_places_the_camera():
    """A camera somewhere else sees in its own space what one at the origin sees; `centre` moves the world."""
    view, centre = camera("PERSPECTIVE", clip=(0.1, 10.0)), np.array([1.0, -2.0, 30.0])
    posed = replace(view, matrix=look((5.0, -3.0, 31.0), (4.0, 2.0, 29.0)).matrix)
    origin, direction, _ = rays(posed, centre=centre)
    local_origin, local_direction, _ = rays(view)
    rotation, position = posed.matrix[:3, :3], posed.matrix[:3, 3]
    np.testing.assert_allclose(origin, local_origin @ rotation.T + position - centre, atol=2e-6)
    np.testing.assert_allclose(direction, local_direction @ rotation.T, atol=1e-6)


@KINDS
@pytest.mark.parametrize("clip", [(0.0, np.inf), (10.0, 1e6 + 0.25), (10.0, 5e5)])
def test_rays_from_far_away_are_exact_where_the_scene_is(kind, clip):
    """1000 km from a scene of 1 m, where float32 resolves 0.06 m: rays start at the scene, on the same lines."""
    distance, radius = 1e6, 1.0
    width = 1.0 if kind == "ORTHOGRAPHIC" else 1.0 / distance
    view = replace(camera(kind, clip=clip), frame=tuple(width * np.array((-1.2, 1.2, -0.8, 0.8))))
    posed = replace(view, matrix=look(np.array((0.6, 0.64, 0.48)) * distance, (0, 0, 0)).matrix)
    origin, direction, reach = rays(posed, radius=radius)
    # from a camera at the origin float32 keeps the small numbers that tell one ray from another
    rotation, position = posed.matrix[:3, :3], posed.matrix[:3, 3]
    line = [ray.astype(float) @ rotation.T for ray in rays(replace(view, clip=(0.0, np.inf)))[:2]]
    place = line[0] + position
    along = line[1] / np.linalg.norm(line[1], axis=1, keepdims=True)
    rounding = 4e-7  # of float32 numbers up to 2
    for step in (0.0, 2.0):
        offset = origin + step * direction.astype(float) - place
        assert np.linalg.norm(np.cross(offset, along), axis=1).max() < rounding
    nearest = np.linalg.norm(np.cross(place, along), axis=1)
    assert nearest.min() < 0.2 and nearest.max() > 1.2  # some rays hit the sphere and some do not
    start = np.linalg.norm(origin, axis=1)
    assert np.all(start <= np.maximum(nearest, 1.02 * radius) + rounding) and np.all(start > radius)
    end = origin + np.minimum(reach, 1e9)[:, None] * direction.astype(float) - position
    depth = np.linalg.norm(end, axis=1) if kind == "PANORAMA" else -end @ rotation[:, 2]
    if clip[1] < distance - radius:
        assert np.all(reach == 0)
    elif np.isfinite(clip[1]):
        np.testing.assert_allclose(depth - distance, clip[1] - distance, atol=rounding)
    else:
        assert reach.min() > 1e30


def test_panorama_looks_along_its_axis_and_to_the_right():
    view = replace(camera("PANORAMA"), frame=(-1e-4, 1e-4, -1e-4, 1e-4))
    np.testing.assert_allclose(rays(view)[1], np.broadcast_to((0, 0, -1), (WIDTH * HEIGHT, 3)), atol=2e-4)
    view = replace(view, frame=(np.pi / 2 - 1e-4, np.pi / 2 + 1e-4, -1e-4, 1e-4))
    np.testing.assert_allclose(rays(view)[1], np.broadcast_to((1, 0, 0), (WIDTH * HEIGHT, 3)), atol=2e-4)
    np.testing.assert_allclose(np.linalg.norm(rays(camera("PANORAMA"))[1], axis=1), 1, rtol=1e-6)


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("blades", [0, 6])
def test_lens_rays_meet_at_the_focus(kind, blades):
    """What lies at the focus distance is as sharp as with a pinhole, through whatever part of the lens."""
    focus = 2.5
    lens = camera(kind, lens_radius=0.3, focus_distance=focus, blades=blades)
    for index in range(5):
        origin, direction, _ = rays(lens, index)
        pinhole_origin, pinhole_direction, _ = rays(replace(lens, lens_radius=0.0), index)
        assert np.ptp(origin[:, 0] - pinhole_origin[:, 0]) > 0.3  # they do start all over the lens
        sharp = pinhole_origin + focus * pinhole_direction
        np.testing.assert_allclose(origin + focus * direction, sharp, atol=2e-6)  # float32


@pytest.mark.parametrize("blades, ratio", [(0, 1.0), (0, 2.0), (3, 1.0), (5, 1.0), (6, 0.5)])
def test_aperture_is_covered_evenly(blades, ratio):
    radius, count = 0.2, 4096
    view = camera(
        "PERSPECTIVE", lens_radius=radius, focus_distance=2.0, blades=blades, blade_rotation=0.3, lens_ratio=ratio
    )
    lens = lens_rays(build_eye(view, ORIGIN, np.inf), KEY, count)[:, :2].astype(float) / radius * (ratio, 1.0)
    squares = np.sum(lens**2, axis=1)
    assert squares.max() <= 1 + 1e-6
    # second moment of a disk, or of the triangles (0, a, b) of a polygon: (|a|^2 + |b|^2 + a.b) / 6
    moment = 0.5 if blades < 3 else (2 + np.cos(2 * np.pi / blades)) / 6
    error = squares.std() / np.sqrt(count)  # of independent points; the sequence does better
    assert abs(squares.mean() - moment) < 3 * error
    np.testing.assert_allclose(lens.mean(axis=0), 0, atol=3 * 0.5 / np.sqrt(count))
    if blades >= 3:  # no point beyond an edge, and some near every corner
        turn = 2 * np.pi / blades
        angle = (np.arctan2(lens[:, 1], lens[:, 0]) - 0.3) % turn - 0.5 * turn
        assert np.max(np.sqrt(squares) * np.cos(angle)) <= np.cos(0.5 * turn) + 1e-6
        for corner in 0.3 + turn * np.arange(blades):
            assert np.linalg.norm(lens - (np.cos(corner), np.sin(corner)), axis=1).min() < 0.15


@pytest.mark.parametrize(
    "options, message",
    [
        ({"kind": "FISHEYE"}, "kind 'FISHEYE' is unknown"),
        ({"window": (3, 3, 3, 5)}, r"window \(3, 3, 3, 5\) is empty or outside 12x7"),
        ({"window": (0, 0, WIDTH + 1, HEIGHT)}, "outside"),
        ({"window": (-1, 0, 5, 5)}, "outside"),
        ({"width": 0}, "empty"),
        ({"matrix": np.eye(3)}, "4x4"),
        ({"matrix": np.full((4, 4), np.nan)}, "finite"),
        ({"clip": (2.0, 2.0)}, r"clip range 2\.\.2 m is empty"),
        ({"clip": (-1.0, 2.0)}, "clip range"),
        ({"clip": (0.0, np.nan)}, "clip range"),
        ({"lens_radius": 0.1, "focus_distance": 0.0}, "focus distance 0 m"),
        ({"lens_radius": 0.1, "focus_distance": np.nan}, "focus distance nan m"),
    ],
)
def test_what_has_no_image_is_an_error(options, message):
    with pytest.raises(SceneError, match=message):
        build_eye(replace(camera("PERSPECTIVE"), **options), ORIGIN, np.inf)
