# SPDX-License-Identifier: GPL-3.0-or-later
"""What is hidden from the camera: its rays pass it, also behind thin sheets; all other light meets it."""

import dataclasses
import math

import numpy as np
import pytest

from addon.solver import Camera, Material, Medium, SceneError, Settings, coverage_image, first_hit_images, render
from addon.solver.geometry.surfaces import build_geometry
from addon.solver.physics.spectrum import band_radiance
from tests.helpers.scenes import box, join, look, make_scene, mean_and_error, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
GREY, BLACK, MIRROR = Material("grey", 0.5), Material("black", 1.0), Material("mirror", 0.2, specular=1.0)
SHEET = Material("sheet", 0.3, transmittance=0.7)
MATERIALS = (GREY, BLACK, MIRROR, SHEET)
FLOAT32 = 3e-6  # of radiance: the film's image is summed in float32
SETTINGS = Settings(passes=2, photons_per_pass=2000, threads=1)


def plate(height, kelvin, material, half=5.0):
    return (*quad((0, 0, height), (half, 0, 0), (0, half, 0)), kelvin, material)


def seen_from_above(*parts, hidden=(), **options):
    """Parts as an orthographic camera 3 m above the middle sees them. hidden: numbers of parts."""
    vertices, triangles, temperature, material = join(*parts)
    owner = np.repeat(np.arange(len(parts)), [len(part[1]) for part in parts])
    frame = (-0.1, 0.1, -0.1, 0.1)
    camera = Camera(4, 4, look((0, 0, 3), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=frame)
    mask = np.isin(owner, hidden) if hidden else None
    return make_scene(vertices, triangles, temperature, MATERIALS, camera, EDGES, material, hidden=mask, **options)


def black(kelvin):
    return band_radiance(EDGES, kelvin)


def bands(scene, settings=SETTINGS):
    """(h, w, b) radiance, W m-2 sr-1."""
    return np.stack(list(render(scene, settings).bands()), axis=-1) * np.diff(EDGES)


def test_what_is_behind_is_seen_exactly():
    """A black floor behind a hot plate that is hidden, and that touches it: its own radiance, without noise."""
    scene = seen_from_above(plate(0.0, 320.0, 1), plate(1e-6, 900.0, 1, half=1.0), hidden=(1,))
    np.testing.assert_allclose(bands(scene), np.broadcast_to(black(320.0), (4, 4, 2)), rtol=FLOAT32)
    shown = dataclasses.replace(scene, hidden=None)
    np.testing.assert_allclose(bands(shown), np.broadcast_to(black(900.0), (4, 4, 2)), rtol=FLOAT32)


def test_nothing_but_the_surroundings_behind():
    """A hidden object alone in the picture: the surroundings, all over."""
    scene = seen_from_above(plate(0.0, 900.0, 1), hidden=(0,), world_temperature=280.0)
    np.testing.assert_allclose(bands(scene), np.broadcast_to(black(280.0), (4, 4, 2)), rtol=FLOAT32)


@pytest.mark.once
def test_a_hidden_lamp_lights_as_one_that_is_seen():
    """A hot ball between camera and floor: E = pi L (r / d)^2 under it, though the camera looks through it. To 4
    standard errors, and 0.5 % for the mesh."""
    vertices, triangles = sphere(3, 0.1)
    ball = vertices + (0, 0, 1), triangles, 900.0, 1
    scene = seen_from_above(plate(0.0, 0.0, 0), ball, hidden=(1,))
    value, error = mean_and_error(scene, Settings(passes=64, photons_per_pass=2000, reference_temperature=0.0))
    # over the picture, 0.2 m wide, cos^3 falls to 0.98
    offsets = 0.2 * (np.arange(50) + 0.5) / 50 - 0.1
    x, y = np.meshgrid(offsets, offsets)
    truth = 0.5 * black(900.0).sum() * 0.1**2 * np.mean((1 + x * x + y * y) ** -1.5)
    print(value / truth - 1, error / truth)
    assert error < 0.01 * truth
    assert abs(value - truth) < 4 * error + 0.005 * truth


def test_a_mirror_shows_what_is_hidden():
    """The camera looks down on a mirror, which shows the plate above it, through which the camera looks."""
    scene = seen_from_above(plate(0.0, 300.0, 2), plate(1.0, 400.0, 1, half=50.0), hidden=(1,))
    expected = 0.2 * black(300.0) + 0.8 * black(400.0)
    np.testing.assert_allclose(bands(scene), np.broadcast_to(expected, (4, 4, 2)), rtol=FLOAT32)


def test_hidden_behind_thin_sheets():
    """Straight on through two sheets the hidden plate between and below them is not seen; of the sheets nothing is
    reflected."""
    parts = plate(2.0, 310.0, 3), plate(1.5, 900.0, 1), plate(1.0, 290.0, 3), plate(0.5, 800.0, 1), plate(0.0, 330.0, 1)
    scene = seen_from_above(*parts, hidden=(1, 3))
    expected = 0.3 * black(310.0) + 0.7 * (0.3 * black(290.0) + 0.7 * black(330.0))
    seen = bands(scene, dataclasses.replace(SETTINGS, reference_temperature=300.0))
    np.testing.assert_allclose(seen, np.broadcast_to(expected, (4, 4, 2)), rtol=FLOAT32)


def test_hidden_in_gas():
    """Grey gas between: what passes of the floor, and what the gas emits, as without the plate."""
    air = Medium("Air", 0.2, 350.0)
    scene = seen_from_above(plate(0.0, 320.0, 1), plate(1.0, 900.0, 1), hidden=(1,), media=(air,), world_depth=10.0)
    through = math.exp(-0.2 * 3.0)
    expected = through * black(320.0) + (1 - through) * black(350.0)
    np.testing.assert_allclose(bands(scene), np.broadcast_to(expected, (4, 4, 2)), rtol=1e-5)


def test_an_isothermal_room_stays_black():
    """Whatever is hidden in it: not a photon, not a bit of noise."""
    vertices, triangles = box((2.0, 2.0, 2.0))
    inner, more = box((0.5, 0.5, 0.5))
    mesh = join((vertices, triangles, 300.0, 0), (inner + 0.7, more, 300.0, 2))
    camera, hidden = look((0.2, 0.2, 1.6), (1.0, 1.0, 1.0), 8, 6), np.repeat([False, True], [12, 12])
    scene = make_scene(*mesh[:3], MATERIALS, camera, EDGES, mesh[3], hidden=hidden, world_temperature=300.0)
    film = render(scene, SETTINGS)
    assert film.photons == 0 and not film.noise().any()
    np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)


def test_first_hits_and_coverage_pass_what_is_hidden():
    scene = seen_from_above(plate(0.0, 320.0, 1), plate(1.0, 900.0, 1), hidden=(1,))
    images = first_hit_images(scene, ["depth", "surface_temperature"])
    np.testing.assert_allclose(images["depth"], 3.0, rtol=1e-6)
    np.testing.assert_allclose(images["surface_temperature"], 320.0)
    assert not coverage_image(dataclasses.replace(scene, hidden=np.ones(4, np.bool_)), True).any()


def test_geometry_is_made_anew_when_something_is_hidden():
    scene = seen_from_above(plate(0.0, 320.0, 1), plate(1.0, 900.0, 1), hidden=(1,))
    geometry = build_geometry(scene)
    assert build_geometry(scene, geometry) is geometry
    shown = build_geometry(dataclasses.replace(scene, hidden=None), geometry)
    assert shown is not geometry and shown.tracer.camera is shown.tracer


def test_hidden_needs_a_mask_of_the_triangles():
    with pytest.raises(SceneError, match=r"hidden has shape \(1,\) and dtype bool, not \(2,\) uint8"):
        dataclasses.replace(seen_from_above(plate(0.0, 320.0, 1)), hidden=np.ones(1, np.bool_))
