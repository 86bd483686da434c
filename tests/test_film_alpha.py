# SPDX-License-Identifier: GPL-3.0-or-later
"""Alpha of a picture, against the areas that its pixels see of things."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Camera, Material, Medium, Textures, coverage_image
from addon.solver.moments import moment_of
from tests.helpers.scenes import join, look, make_scene, quad

EDGES = np.array([8.0, 10.0, 12.0])
MATERIALS = (
    Material("black", 1.0),
    Material("mirror", 0.2, specular=1.0),
    Material("sheet", 0.3, transmittance=0.6),
    Material("hole", 0.0, transmittance=1.0),
)
EXACT = 2e-6  # alpha is float32
LATTICE = 1.0 / 64.0  # of 256 low-discrepancy points in a pixel that an edge cuts: four times one point's share


def picture(*parts, clip=(0.0, np.inf), **options):
    """Parts as an orthographic camera 5 m above sees them: 4 x 4 pixels of 1 m, from (0, 0) on."""
    vertices, triangles, temperature, material = join(*parts)
    camera = Camera(4, 4, look((0, 0, 5), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(0.0, 4.0, 0.0, 4.0), clip=clip)
    return make_scene(vertices, triangles, temperature, MATERIALS, camera, EDGES, material, **options)


def plate(low, high, height=0.0, material=0):
    """A rectangle between two corners (x, y), m."""
    (x0, y0), (x1, y1) = low, high
    middle = (0.5 * (x0 + x1), 0.5 * (y0 + y1), height)
    return (*quad(middle, (0.5 * (x1 - x0), 0, 0), (0, 0.5 * (y1 - y0), 0)), 300.0, material)


ALL = (-1.0, -1.0), (5.0, 5.0)


def overlap(low, high):
    """(4, 4) area of each pixel that a rectangle covers."""
    covered = [
        np.clip(np.minimum(high[axis], np.arange(1, 5)) - np.maximum(low[axis], np.arange(4)), 0.0, 1.0)
        for axis in (0, 1)
    ]
    return covered[1][:, None] * covered[0]


@pytest.mark.parametrize(
    ("low", "high"), [((0.5, 1.0), (3.0, 2.25)), ((1.1, 0.3), (2.7, 3.9)), ((1.4, 1.4), (1.7, 1.6))]
)
def test_edges_cover_their_share_of_a_pixel(low, high):
    alpha, truth = coverage_image(picture(plate(low, high)), True), overlap(low, high)
    np.testing.assert_allclose(alpha, truth, atol=LATTICE)
    inside = (truth == 0.0) | (truth == 1.0)
    np.testing.assert_array_equal(alpha[inside], truth[inside])


def test_sheets_count_by_what_they_stop():
    """One sheet, two of them, one before a plate, and holes."""
    left, right = ((0.0, 0.0), (2.0, 4.0)), ((2.0, 0.0), (4.0, 4.0))
    alpha = coverage_image(picture(plate(*ALL, 1.0, 2), plate(*left, 0.5, 2), plate(*right, 0.0, 0)), True)
    np.testing.assert_allclose(alpha[:, :2], 1.0 - 0.6**2, atol=EXACT)
    np.testing.assert_allclose(alpha[:, 2:], 1.0, atol=EXACT)
    alpha = coverage_image(picture(plate(*ALL, 1.0, 2), plate(*ALL, 0.5, 3)), True)
    np.testing.assert_allclose(alpha, 1.0 - 0.6, atol=EXACT)


def test_a_mirror_is_something_whatever_it_shows():
    assert (coverage_image(picture(plate(*ALL, 0.0, 1)), True) == 1.0).all()


def test_what_is_cut_out_hides_and_is_nothing():
    """A plate that is cut out, over half of another one; where it is a sheet, what it lets through counts."""
    half, holdout = ((0.0, 0.0), (2.0, 4.0)), np.repeat([False, True], 2)
    for material, expected in ((0, 0.0), (2, 0.6)):
        scene = dataclasses.replace(picture(plate(*ALL), plate(*half, 1.0, material)), holdout=holdout)
        for transparent in (True, False):
            alpha = coverage_image(scene, transparent)
            np.testing.assert_allclose(alpha[:, :2], expected, atol=EXACT)
            np.testing.assert_allclose(alpha[:, 2:], 1.0, atol=EXACT)


def test_what_moves_covers_in_the_mean_over_time():
    """At one of four times the plate is elsewhere, and another time it is cut out."""
    scene, moved = picture(plate((0.0, 0.0), (2.0, 4.0))), picture(plate((2.0, 0.0), (4.0, 4.0)))
    cut_out = dataclasses.replace(scene, holdout=np.ones(2, np.bool_))
    moments = tuple(moment_of(each, scene) for each in (scene, moved, cut_out, scene))
    alpha = coverage_image(dataclasses.replace(scene, moments=moments), True)
    np.testing.assert_allclose(alpha, np.repeat([[0.5, 0.5, 0.25, 0.25]], 4, axis=0), atol=EXACT)


def test_surroundings_count_unless_the_film_is_transparent():
    scene = picture(plate((0.0, 0.0), (2.0, 4.0)))
    assert (coverage_image(scene, False) == 1.0).all()
    np.testing.assert_array_equal(coverage_image(scene, True), np.repeat([[1.0, 1.0, 0.0, 0.0]], 4, axis=0))


def test_what_is_clipped_is_not_there():
    assert (coverage_image(picture(plate(*ALL), clip=(0.0, 4.0)), True) == 0.0).all()
    assert (coverage_image(picture(plate(*ALL), clip=(0.0, 6.0)), True) == 1.0).all()
    behind_a_sheet = picture(plate(*ALL, 1.0, 2), plate(*ALL), clip=(0.0, 4.5))
    np.testing.assert_allclose(coverage_image(behind_a_sheet, True), 0.4, atol=EXACT)


def test_gas_counts_by_what_it_stops():
    """Grey air: what it takes up to its end, or before a sheet and behind it; before a plate it adds nothing."""
    air = {"media": (Medium("Air", 0.05, 300.0),), "world_depth": 8.0}
    far = (plate((10.0, 10.0), (11.0, 11.0)),)
    np.testing.assert_allclose(coverage_image(picture(*far, **air), True), 1.0 - np.exp(-0.05 * 8.0), atol=EXACT)
    through = 0.6 * np.exp(-0.05 * (4.0 + 8.0))
    np.testing.assert_allclose(coverage_image(picture(plate(*ALL, 1.0, 2), **air), True), 1.0 - through, atol=EXACT)
    np.testing.assert_allclose(coverage_image(picture(plate(*ALL), **air), True), 1.0, atol=EXACT)


def test_a_mixed_material_covers_its_share():
    """Half holes: to four standard errors of 256 grains in each of 16 pixels."""
    none, corners = np.full(2, -1, np.int32), np.zeros((2, 3, 2), np.float32)
    textures = Textures(
        np.arange(2, dtype=np.int32), corners, none, np.full(2, 3, np.int32), np.full((2, 3), 0.5, np.float32), none
    )
    alpha = coverage_image(picture(plate(*ALL), textures=textures), True)
    error = 0.5 / np.sqrt(256)
    assert np.abs(alpha - 0.5).max() < 5 * error and abs(alpha.mean() - 0.5) < 4 * error / 4


def test_threads_change_nothing():
    scene = picture(plate((1.1, 0.3), (2.7, 3.9)))
    np.testing.assert_array_equal(coverage_image(scene, True), coverage_image(scene, True, threads=3))


def test_pixels_that_were_not_reached_are_opaque():
    assert (coverage_image(picture(plate((0.0, 0.0), (2.0, 4.0))), True, cancelled=lambda: True) == 1.0).all()
