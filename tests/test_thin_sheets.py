# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin sheets: what passes straight through, in camera paths, photons, shadow rays and caustics."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Camera, Material, SceneError, Settings, SunLight, Texture, Textures, render
from addon.solver.camera.first_hits import first_hit_images
from tests.helpers.chains import FILM
from tests.helpers.painted_rooms import NOTHING, random_painted_room, steps, with_fog
from tests.helpers.path_tracer import black_radiance, standard_error, trace_paths
from tests.helpers.scenes import box, join, look, make_scene, pass_means, quad

pytestmark = pytest.mark.once

BANDS, SHORT_WAVES = np.array([8.0, 10.0, 12.0]), np.array([3.0, 5.0])
HALF = 60.0  # m, half of the edge of plates that stand for infinite ones; light from beyond is (gap / HALF)^2 = 3e-6


def stack_radiance(sheets, world):
    """(b,) radiance above a stack of infinite sheets (emissivity, transmittance (b,), kelvin), the first on top, by
    adding one sheet after the other: light between two is a geometric series (van de Hulst 1980, section 4.5). What a
    stack lets through it does from both sides alike."""
    beyond = black_radiance(BANDS, world)
    reflectance, upwards, through = np.zeros(2), np.zeros(2), np.ones(2)  # of the stack from above, and its emission
    for emissivity, tau, kelvin in reversed(sheets):
        rho, own = 1.0 - emissivity - tau, emissivity * black_radiance(BANDS, kelvin)
        series = 1.0 / (1.0 - rho * reflectance)
        upwards = own + tau * series * (upwards + reflectance * own)
        through, reflectance = tau * series * through, rho + tau**2 * series * reflectance
    return upwards + (reflectance + through) * beyond


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("specular", [0.0, 1.0])
def test_stacks_bring_the_sum_of_all_reflections(count, specular):
    """1 to 5 sheets, seen from straight above, over surroundings of another temperature: within 3 standard errors, and
    0.1 % where these are smaller, as the plates are not infinite."""
    random = np.random.default_rng(10 * count + int(specular))
    sheets = [
        (random.uniform(0.05, 0.5, 2), random.uniform(0.1, 0.5, 2), random.uniform(280, 350)) for _ in range(count)
    ]
    plates = [(*quad((0, 0, -0.1 * i), (HALF, 0, 0), (0, HALF, 0)), sheets[i][2], i) for i in range(count)]
    materials = [
        Material(f"sheet {i}", steps(*emissivity), specular, transmittance=steps(*tau))
        for i, (emissivity, tau, _) in enumerate(sheets)
    ]
    *mesh, index = join(*plates)
    camera = look((0, 0, 1), (0, 0, 0), 4, 4, tangent=0.05)
    scene = make_scene(*mesh, materials, camera, BANDS, index, world_temperature=270.0)
    means = pass_means(scene, Settings(passes=32, photons_per_pass=5_000, threads=1))
    truth, error = stack_radiance(sheets, 270.0), standard_error(means)
    print(means.mean(axis=0) / truth - 1.0, error / truth)
    assert np.all(np.abs(means.mean(axis=0) - truth) < np.maximum(3.0 * error, 1e-3 * truth))
    assert np.all(error < 5e-3 * truth)


@pytest.mark.long
@pytest.mark.parametrize("seed, fog", [(1, False), (3, False), (4, True), (5, True)])
def test_random_rooms(seed, fog):
    """Rooms with sheets, holes, images and mixtures, and gas, against the path tracer: no block of 4 x 4 pixels is off
    by 5 standard errors of both (of 48 blocks in 2 bands one is by 3.0)."""
    random = np.random.default_rng(seed)
    scene = random_painted_room(random)
    scene = with_fog(scene, random) if fog else scene
    traced = trace_paths(scene, 100, 16, reference=300.0)
    settings, sums = Settings(passes=48, photons_per_pass=10_000, threads=1), []
    render(scene, settings, lambda film: sums.append(film.passes * blocks(film.bands().transpose(1, 2, 0))))
    ours = np.diff([np.zeros_like(sums[0]), *sums], axis=0) * np.diff(BANDS)
    theirs = blocks(traced.images) + black_radiance(BANDS, 300.0)
    error = np.hypot(standard_error(ours), standard_error(theirs))
    apart = (ours.mean(axis=0) - theirs.mean(axis=0)) / error
    print(np.sqrt(np.mean(apart**2)), np.abs(apart).max(), np.mean(error) / theirs.mean())
    assert np.abs(apart).max() < 5.0 and np.sqrt(np.mean(apart**2)) < 1.5 and np.mean(error) < 0.01 * theirs.mean()


def blocks(images):
    """Means of blocks of 4 x 4 pixels of images (..., h, w, b)."""
    height, width, bands = images.shape[-3:]
    shape = (*images.shape[:-3], height // 4, 4, width // 4, 4, bands)
    return images.reshape(shape).mean(axis=(-4, -2), dtype=float)


@pytest.mark.parametrize("subtraction", [True, False])
def test_isothermal_rooms_are_black(subtraction):
    """Sheets of any kind in a room of one temperature show nothing; with the subtraction to rounding, without it within
    4 standard errors of a pixel's mean."""
    walls, faces = box()
    film, card = quad((0.5, 0.5, 0.5), (0.3, 0.1, 0), (0, 0, 0.3)), quad((0.5, 0.7, 0.4), (0.2, 0, 0), (0, 0.1, 0.3))
    materials = [
        Material("wall", 0.6),
        Material("rough film", steps(0.1, 0.3), 0.5, 0.5, transmittance=steps(0.4, 0.2)),
        Material("clear film", 0.0, 1.0, transmittance=steps(0.9, 0.1)),
    ]
    *mesh, index = join((walls, faces, 310.0, 0), (*film, 310.0, 1), (*card, 310.0, 2))
    camera = look((0.9, 0.1, 0.6), (0.4, 0.6, 0.4), 12, 9, tangent=0.6)
    scene = make_scene(*mesh, materials, camera, BANDS, index, world_temperature=310.0)
    settings = Settings(passes=8, photons_per_pass=3_000, reference_subtraction=subtraction, threads=1)
    means, truth = pass_means(scene, settings), black_radiance(BANDS, 310.0)
    error = 1e-6 * truth if subtraction else 4.0 * standard_error(means)
    assert np.all(np.abs(means.mean(axis=0) - truth) < error)


def before_wall(*materials, share=None, camera=None, **options):
    """A black wall of 350 K behind a sheet of the first material at 300 K, with a share (h, w) of the second in it."""
    wall, sheet = quad((0, 0, -1), (4, 0, 0), (0, 4, 0)), quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    *mesh, index = join((*sheet, 300.0, 0), (*wall, 350.0, len(materials)))
    camera = camera or Camera(8, 8, _above(2.0), "ORTHOGRAPHIC", frame=(-1, 1, -1, 1))
    scene = make_scene(
        *mesh, [*materials, Material("wall", 1.0)], camera, BANDS, index, world_temperature=300.0, **options
    )
    if share is None:
        return scene
    corners = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32)
    none, other, image = (np.full(2, i, np.int32) for i in (-1, 1, 0))
    texture = Texture(np.asarray(share, np.float32), "EXTEND", True)
    textures = Textures(
        np.arange(2, dtype=np.int32), corners, none, other, np.zeros((2, 3), np.float32), image, (texture,)
    )
    return dataclasses.replace(scene, textures=textures)


def _above(height):
    matrix = np.eye(4)
    matrix[2, 3] = height
    return matrix


def bands_of(scene, passes=4):
    """(height, width, b) radiance in each band, W m-2 sr-1."""
    film = render(scene, Settings(passes=passes, photons_per_pass=2_000, threads=1))
    return film.bands().transpose(1, 2, 0) * np.diff(BANDS)


def test_what_is_behind_a_sheet_is_seen_exactly():
    """Emission of both, without noise, to the rounding of float32."""
    scene = before_wall(Material("film", steps(0.3, 0.6), transmittance=steps(0.7, 0.2)))
    emissivity, tau = np.array([0.3, 0.6]), np.array([0.7, 0.2])
    own, behind = black_radiance(BANDS, 300.0), black_radiance(BANDS, 350.0)
    seen = bands_of(scene)
    assert seen[..., 0] == pytest.approx(own[0] * emissivity[0] + tau[0] * behind[0], rel=1e-5)
    # what the film reflects in the second band is at the reference temperature but for the wall, which it does not face
    assert seen[..., 1] == pytest.approx((1.0 - tau[1]) * own[1] + tau[1] * behind[1], rel=1e-5)
    assert emissivity[0] + tau[0] == 1.0


def test_holes_are_holes():
    """Where the share of what transmits everything is 1, nothing is seen of the sheet, in no picture: neither in the
    bands nor in the passes of first hits."""
    share = np.array([[0, 1, 1, 0], [1, 1, 0, 0], [0, 0, 1, 0], [1, 0, 1, 1]])
    scene = before_wall(Material("leaf", 1.0), NOTHING, share=share)
    hole = np.kron(share, np.ones((2, 2))) > 0
    kelvin = np.where(hole, 350.0, 300.0)
    assert bands_of(scene) == pytest.approx(black_radiance(BANDS, kelvin), rel=1e-5)
    images = first_hit_images(scene, ("surface_temperature", "depth"))
    assert images["surface_temperature"] == pytest.approx(kelvin)
    assert images["depth"] == pytest.approx(np.where(hole, 3.0, 2.0), abs=1e-5)


def test_the_camera_clips_behind_sheets():
    """What lies beyond the end of the camera's view is not seen through a sheet, either."""
    film = Material("film", 0.5, transmittance=0.5)
    for end, kelvin in ((3.5, 350.0), (2.5, 300.0)):
        camera = Camera(8, 8, _above(2.0), "ORTHOGRAPHIC", frame=(-1, 1, -1, 1), clip=(0.0, end))
        seen = bands_of(before_wall(film, camera=camera))
        expected = 0.5 * black_radiance(BANDS, 300.0) + 0.5 * black_radiance(BANDS, kelvin)
        assert seen == pytest.approx(np.broadcast_to(expected, seen.shape), rel=1e-5)


@pytest.mark.parametrize("count", [1, 3])
def test_a_sun_shines_through(count):
    """A sun on a grey floor, seen from below it through nothing: the floor's excess with films above it, over that
    without, is their transmittance, within 4 standard errors and to 1 %."""
    floor, camera = quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), look((0.5, 0.5, 0.2), (0, 0, 0), 6, 6, tangent=0.2)
    sun = SunLight(np.array((0.1, 0.0, -1.0)), 800.0)

    def excess(films):
        parts = [(*quad((0, 0, 1 + 0.1 * i), (9, 0, 0), (0, 9, 0)), 300.0, 1) for i in range(films)]
        *mesh, index = join((*floor, 300.0, 0), *parts)
        materials = [Material("floor", 0.4), Material("film", 1.0 - FILM, transmittance=FILM)]
        scene = make_scene(
            *mesh, materials, camera, np.array([3.0, 5.0]), index, world_temperature=300.0, lights=(sun,)
        )
        settings = Settings(passes=16, photons_per_pass=4_000, reference_temperature=300.0, threads=1)
        means = pass_means(scene, settings)[:, 0] - black_radiance(np.array([3.0, 5.0]), 300.0)[0]
        return means.mean(), standard_error(means)

    (bare, its_error), (shaded, error) = excess(0), excess(count)
    relative = np.hypot(error / shaded, its_error / bare)
    assert abs(shaded / bare / FILM**count - 1.0) < max(4.0 * relative, 1e-3) and relative < 0.01


@pytest.mark.parametrize(
    "values, message",
    [
        (
            {"emissivity": 0.7, "transmittance": 0.4},
            "the emissivity 0.7 and the transmittance 0.4 are more than 1 together",
        ),
        (
            {"emissivity": 0.5, "transmittance": np.array([[8.0, 0.2], [9.5, 0.6], [12.0, 0.1]])},
            "Material 'film': at 9.5 um the emissivity 0.5 and the transmittance 0.6 are more than 1 together",
        ),
        ({"transmittance": -0.1}, "Material 'film': transmittance -0.1 is outside 0..1"),
        ({"transmittance": np.nan}, "Material 'film': transmittance nan is outside 0..1"),
        ({"transmittance": np.ones(3)}, "transmittance must be a number or pairs of um and transmittance"),
        ({"transmittance": 0.2, "specular": 1.0, "fresnel": True}, "cannot follow Fresnel's law"),
    ],
)
def test_bad_sheets_are_named(values, message):
    with pytest.raises(SceneError, match=message):
        Material(**{"name": "film", "emissivity": 0.3, **values})
