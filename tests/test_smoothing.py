# SPDX-License-Identifier: GPL-3.0-or-later
"""First pictures are smoothed by what the engine knows of first hits, and by nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from addon.rendering.smoothing import may_be_smoothed, smoothed
from addon.solver import Material, Medium, Settings, first_hit_images, render
from addon.solver.camera.first_hits import FAR
from tests.helpers.faults import room, wallpaper

FEW = Settings(passes=1, photons_per_pass=5_000, threads=2)


def matt_room(**options):
    return replace(room(width=64, **options), materials=(Material("Paint", 0.6), Material("Rust", 0.3)))


def picture(scene, settings=FEW):
    """Radiance (h, w) and sensor of a render."""
    film = render(scene, settings)
    return film.radiance(), (film.band_edges, film.weights)


@pytest.fixture(scope="module")
def converged():
    return picture(matt_room(), Settings(passes=64, photons_per_pass=20_000, seed=9, threads=2))[0]


@pytest.mark.long
def test_the_error_of_a_first_picture_falls(converged):
    """Of seeds that are not the reference's; the mean of the picture stays, but for what the noise lets it."""
    for seed in (1, 2, 3):
        radiance, sensor = picture(matt_room(), replace(FEW, seed=seed))
        smooth = smoothed(radiance, matt_room(), sensor)
        before, after = (float(np.sqrt(np.mean((each - converged) ** 2))) for each in (radiance, smooth))
        assert after < 0.75 * before
        assert abs(float(np.mean(smooth - radiance))) < 3.0 * before / np.sqrt(radiance.size)


def test_what_is_known_without_noise_stays_as_it_is():
    """In an enclosure at one temperature, and where surfaces only emit."""
    even = replace(matt_room(radiator=293.0), lights=())
    radiance, sensor = picture(even)
    np.testing.assert_allclose(smoothed(radiance, even, sensor), radiance, rtol=1e-5)  # float32 sums of 25 taps
    black = replace(matt_room(), materials=(Material("Soot", 1.0), Material("Soot", 1.0)))
    radiance, sensor = picture(black)
    np.testing.assert_allclose(smoothed(radiance, black, sensor), radiance, rtol=1e-5)


@pytest.mark.parametrize(
    "material",
    [
        Material("Mirror", 0.1, specular=1.0),
        Material("Gloss", 0.3, specular=0.5, roughness=0.3),
        Material("Film", 0.3, transmittance=0.4),
    ],
)
def test_images_in_mirrors_and_behind_sheets_are_left_alone(material):
    scene = replace(matt_room(), materials=(Material("Paint", 0.6), material))
    radiance, sensor = picture(scene)
    smooth = smoothed(radiance, scene, sensor)
    labels = {"ball": scene.material.astype(np.float32)}
    ball = first_hit_images(scene, (), labels)["ball"] == 1.0
    assert ball.sum() > 50
    np.testing.assert_array_equal(smooth[ball], radiance[ball])
    assert (smooth != radiance)[~ball].mean() > 0.5


def test_the_sky_textures_and_edges_are_left_alone():
    scene = matt_room()
    kept = np.flatnonzero(np.arange(len(scene.triangles)) >= 8)  # without some walls
    parts = {name: getattr(scene, name)[kept] for name in ("triangles", "material", "temperature")}
    open_scene = replace(scene, **parts, textures=wallpaper(8))
    radiance, sensor = picture(open_scene)
    smooth = smoothed(radiance, open_scene, sensor)
    textured = np.zeros(len(kept), np.float32)
    textured[open_scene.textures.triangle] = 1.0
    known = first_hit_images(open_scene, ("depth",), {"textured": textured})
    sky = known["depth"] >= FAR
    edge = sky.copy()
    edge[:, 1:] |= sky[:, :-1]
    edge[:, :-1] |= sky[:, 1:]
    for left_alone in (sky, edge, known["textured"] == 1.0):
        assert left_alone.any()
        np.testing.assert_array_equal(smooth[left_alone], radiance[left_alone])


def test_gas_and_depth_of_field_are_not_smoothed():
    scene = matt_room()
    assert may_be_smoothed(scene)
    assert not may_be_smoothed(replace(scene, media=(Medium("Air", 0.1, 300.0),), world_depth=1.0))
    assert not may_be_smoothed(replace(scene, camera=replace(scene.camera, lens_radius=0.01)))
