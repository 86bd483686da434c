# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry kept between renders: built once for a shape, and the image is that of a render from scratch."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Material, Settings, render
from addon.solver.geometry.surfaces import build_geometry
from tests.helpers.scenes import box, join, look, make_scene, quad

SETTINGS = Settings(passes=2, photons_per_pass=2000, neighbours=20)
GREY, SHINY = Material("Grey", 0.6), Material("Shiny", 0.3, specular=0.5, roughness=0.3)


@pytest.fixture(scope="module")
def scene():
    """A room with a hot plate in it; one wall is there twice, so that not all triangles count."""
    room, triangles = box((4.0, 3.0, 2.5))
    plate = quad((2.0, 1.5, 0.6), (0.3, 0, 0), (0, 0.3, 0))
    parts = (room, triangles, 293.0, 0), (*plate, 350.0, 1), (room, triangles[:2], 293.0, 0)
    vertices, triangles, kelvin, material = join(*parts)
    camera = look((0.5, 0.4, 1.5), (2.0, 1.5, 0.6))
    return make_scene(vertices, triangles, kelvin, (GREY, SHINY), camera, (8.0, 10.0, 12.0), material)


def same_shape(scene, **changes):
    """Another scene with copies of the arrays, as if it was read from Blender once more."""
    changes = {"vertices": scene.vertices.copy(), "triangles": scene.triangles.copy()} | changes
    return dataclasses.replace(scene, **changes)


def edits(scene):
    """What artists change without touching the shape."""
    yield "temperatures", same_shape(scene, temperature=scene.temperature + np.float32(5.0) * (scene.material == 1))
    yield "temperatures of corners", same_shape(scene, temperature=np.repeat(scene.temperature[:, None], 3, axis=1))
    yield "surroundings", same_shape(scene, world_temperature=250.0)
    yield "materials", same_shape(scene, materials=(SHINY, GREY))
    yield "other slots", same_shape(scene, material=1 - scene.material)
    yield "bands", same_shape(scene, band_edges=np.array([3.0, 5.0]))
    yield "the view", same_shape(scene, camera=look((3.5, 2.6, 0.4), (0.0, 0.0, 2.0), width=30))


def test_images_of_kept_geometry_are_the_same_to_the_last_bit(scene):
    geometry = build_geometry(scene)
    for what, edited in edits(scene):
        assert build_geometry(edited, geometry) is geometry, what
        kept, anew = render(edited, SETTINGS, geometry=geometry), render(edited, SETTINGS)
        np.testing.assert_array_equal(kept.bands(), anew.bands(), what)
        np.testing.assert_array_equal(kept.noise(), anew.noise(), what)
        assert np.ptp(anew.temperature()) > 1.0, what  # K: there is an image that could differ


def test_geometry_of_another_shape_is_not_kept(scene):
    geometry = build_geometry(scene)
    moved = scene.vertices.copy()
    moved[8] += 1e-9  # m: float64 vertices, so even what float32 cannot tell
    flipped = scene.triangles.copy()
    flipped[0] = flipped[0, ::-1]
    shapes = {"vertices": moved}, {"triangles": flipped}
    for changes in shapes:
        assert build_geometry(dataclasses.replace(scene, **changes), geometry) is not geometry
    fewer = dataclasses.replace(
        scene, triangles=scene.triangles[:-1], material=scene.material[:-1], temperature=scene.temperature[:-1]
    )
    assert build_geometry(fewer, geometry) is not geometry
    np.testing.assert_array_equal(render(fewer, SETTINGS, geometry=geometry).bands(), render(fewer, SETTINGS).bands())
