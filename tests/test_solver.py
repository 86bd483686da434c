# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver as a whole: passes, threads, roulettes, lights and lobes against closed forms."""

import dataclasses
import threading
import time

import numpy as np
import pytest

from addon.solver import (
    AreaLight,
    Camera,
    Material,
    PointLight,
    SceneError,
    Settings,
    SpotLight,
    SunLight,
    render,
)
from addon.solver.camera import eye_paths
from addon.solver.photons.lights import light_spectrum
from addon.solver.physics.lobes import evaluate_ggx
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.preparation import prepare
from tests.helpers.marks import long
from tests.helpers.paper_estimator import no_final_gathers
from tests.helpers.scenes import box, look, make_scene, mean_and_error, sphere

EDGES = np.linspace(8.0, 12.0, 5)
STEEL = Material("steel", np.array([[8.0, 0.2], [10.0, 0.6], [12.0, 0.3]]), specular=0.5, roughness=0.3)
PAINT = Material("paint", np.array([[8.0, 0.9], [10.0, 0.5], [12.0, 0.7]]))


def room(camera=None, **options):
    """A box with a hot floor, a spectral ball and every kind of lobe."""
    walls, wall_triangles = box((2.0, 2.0, 1.5))
    ball, ball_triangles = sphere(2, 0.3)
    vertices = np.concatenate((walls, ball + (1.0, 1.0, 0.5)))
    triangles = np.concatenate((wall_triangles, ball_triangles + len(walls))).astype(np.int32)
    material = np.array([0] * 10 + [2] * 2 + [1] * len(ball_triangles))
    temperature = np.array([290.0] * 8 + [330.0] * 2 + [290.0] * 2 + [310.0] * len(ball_triangles))
    mirror = Material("mirror", 0.1, specular=1.0)
    camera = camera or look((0.2, 0.3, 1.2), (1.2, 1.1, 0.4), 32, 24, 0.8)
    return make_scene(vertices, triangles, temperature, [PAINT, STEEL, mirror], camera, EDGES, material, **options)


def plane(camera, material, size=4.0, **options):
    """A square in z = 0 at 0 K, so that only what lights send is seen."""
    h = size / 2
    vertices = np.array([(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)], float)
    return make_scene(vertices, np.array([(0, 1, 2), (0, 2, 3)], np.int32), 0.0, [material], camera, EDGES, **options)


def bands(film):
    return np.array([film.band_radiance(b) for b in range(film.band_count)])


QUICK = Settings(passes=4, photons_per_pass=40_000, neighbours=20)


def outdoors():
    """A hot ball before a hut without a wall on a plain, under a sun and a cold sky: lamps and open sheets."""
    hut, hut_triangles = box((1.5, 1.5, 1.0))
    ball, ball_triangles = sphere(2, 0.1)
    ground = np.array([(-40, -40, 0), (40, -40, 0), (40, 40, 0), (-40, 40, 0)], float)
    vertices = np.concatenate((hut, ball + (-0.4, 0.3, 0.9), ground))
    triangles = np.concatenate(
        (hut_triangles[2:], ball_triangles + 8, np.array([(0, 1, 2), (0, 2, 3)]) + len(hut) + len(ball))
    )
    material = np.array([0] * 10 + [1] * len(ball_triangles) + [0] * 2)
    temperature = np.array([290.0] * 10 + [2500.0] * len(ball_triangles) + [285.0] * 2)
    materials = [Material("metal", 0.4), STEEL]
    sun = SunLight(np.array([0.5, 0.3, -1.0]), 800.0)
    camera = look((-1.5, 0.4, 1.8), (0.8, 0.7, 0.5), 32, 24, 0.5)
    return make_scene(
        vertices, triangles.astype(np.int32), temperature, materials, camera, EDGES, material, world_temperature=220.0,
        lights=(sun,),
    )  # fmt: skip


def test_outdoors_has_lamps_and_open_sheets():
    """What the tests of determinism below rest on."""
    model = prepare(outdoors(), QUICK)
    emitters = model.emitters
    assert model.lamps.sides.before[-1] > 0.0 and emitters.caustic.any() and emitters.surroundings.open.any()


LIT = {"room": lambda: room(lights=(PointLight(np.array([0.5, 1.5, 1.2]), 200.0),)), "outdoors": outdoors}


@pytest.mark.parametrize("name", LIT)
def test_image_is_bit_identical_for_any_number_of_threads(name):
    scene = LIT[name]()
    films = [render(scene, dataclasses.replace(QUICK, threads=threads)) for threads in (1, 2, 5)]
    for film in films[1:]:
        assert np.array_equal(bands(films[0]), bands(film))
        assert np.array_equal(films[0].noise(), film.noise())


@pytest.mark.parametrize("name", LIT)
def test_pass_ranges_join_to_the_same_image(name):
    """Passes 0..5 are the weighted mean of 0..1 and 2..5, to float32 rounding, noise included."""
    scene = LIT[name]()
    whole = render(scene, dataclasses.replace(QUICK, passes=6))
    head = render(scene, dataclasses.replace(QUICK, passes=2))
    tail = render(scene, dataclasses.replace(QUICK, passes=4, pass_offset=2))
    joined = head.merge(tail)
    assert joined.passes == 6 and joined.photons == whole.photons
    np.testing.assert_allclose(bands(joined), bands(whole), rtol=2e-7)
    np.testing.assert_allclose(bands(whole), (2 * bands(head) + 4 * bands(tail)) / 6, rtol=1e-6)
    np.testing.assert_allclose(joined.noise(), whole.noise(), rtol=1e-4, atol=1e-5)
    with pytest.raises(ValueError, match="same size"):
        head.merge(render(room(look((0.2, 0.3, 1.2), (1, 1, 0), 8, 6)), dataclasses.replace(QUICK, passes=1)))


def test_seeds_differ_and_passes_differ():
    scene = room()
    one = [
        render(scene, dataclasses.replace(QUICK, passes=1, **change))
        for change in ({}, {"seed": 1}, {"pass_offset": 1})
    ]
    assert not np.array_equal(bands(one[0]), bands(one[1]))
    assert not np.array_equal(bands(one[0]), bands(one[2]))


CHOICES = Settings(passes=16, photons_per_pass=30_000)


def room_with_a_light():
    return room(lights=(PointLight(np.array([0.5, 1.5, 1.2]), 200.0, 0.1),), world_temperature=260.0)


@pytest.fixture(scope="module")
def usual():
    """Mean of the image and its standard error, with the estimator's own choices."""
    return mean_and_error(room_with_a_light(), CHOICES)


@pytest.mark.parametrize(
    "change",
    [
        {"roulette": "BAND_AVERAGE"},
        long({"reference_subtraction": False}),
        long({"reference_temperature": 250.0}),
        long({"neighbours": 8}),
    ],
    ids=lambda change: next(iter(change)),
)
def test_choices_of_the_estimator_do_not_change_the_mean(change, usual):
    """Every unbiased choice has the same image mean, within 4 standard errors of the difference."""
    mean, error = usual
    other, other_error = mean_and_error(room_with_a_light(), dataclasses.replace(CHOICES, **change))
    print(f"{other / mean - 1:+.3%} +- {np.hypot(error, other_error) / mean:.3%}")
    assert abs(mean - other) < 4 * np.hypot(error, other_error)
    assert np.hypot(error, other_error) < 0.01 * mean  # else the comparison would say little


@pytest.mark.long
def test_many_small_maps_equal_one_big_map(monkeypatch):
    """Section 4.3 of Boudet et al.: m maps of N photons with n neighbours against one of m N with m n.

    They saw means that differ by 0.14 % and standard deviations by 0.27 %; asked for are 0.2 % and 0.5 %. The density
    of k neighbours needs (k - 1) / A, so it is n - 1 that is multiplied. Three million photons, as theirs, and four
    such pairs: the standard deviations of one pair differ by 0.3 % from chance alone. It is about photon maps, so no
    rays take the photons' place.
    """
    monkeypatch.setattr(eye_paths, "choose_splits", no_final_gathers)
    walls, triangles = box((2.0, 2.0, 1.5))
    camera = look((1.0, 1.0, 1.4), (1.0, 1.0, 0.0), 32, 32, 0.6)  # the floor alone: the paper has no antialiasing
    # one hot wall, which is no lamp: all that the floor reflects is the photons' work
    temperature = np.where(np.abs(walls[triangles][:, :, 0]).max(axis=1) == 0.0, 500.0, 290.0)
    scene = make_scene(walls, triangles, temperature, [PAINT], camera, EDGES, world_temperature=290.0)
    small, m = Settings(passes=30, photons_per_pass=100_000, neighbours=51, shrink=False), 30
    big = dataclasses.replace(small, passes=1, photons_per_pass=m * 100_000, neighbours=50 * m + 1)
    many, one = (
        np.array([render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(4)])
        for settings in (small, big)
    )
    mean = many.mean() / one.mean() - 1
    deviation = many.std(axis=(1, 2)).mean() / one.std(axis=(1, 2)).mean() - 1
    print(f"mean {mean:+.3%}, standard deviation {deviation:+.3%}")
    assert abs(mean) < 0.002
    assert abs(deviation) < 0.005


@pytest.mark.long
def test_noise_is_the_spread_between_renders():
    """The predicted standard error against that of 24 renders. A pixel's ratio has a relative error of 1/sqrt(2 * 23) =
    15 %, the median over 768 pixels (which share photons) a few percent. Pixels across a silhouette do better than
    predicted, because the camera's samples are stratified over the passes; hence the median."""
    scene = room()
    films = [render(scene, Settings(passes=8, photons_per_pass=20_000, seed=seed)) for seed in range(24)]
    spread = np.std([film.temperature() for film in films], axis=0, ddof=1)
    predicted = np.sqrt(np.mean([film.noise() ** 2 for film in films], axis=0))
    assert 0.9 < np.median(spread / predicted) < 1.1
    assert np.percentile(spread / predicted, 99) < 2.0  # nowhere is the error much larger than said


def test_stop_conditions():
    scene = room()
    start = time.monotonic()
    film = render(scene, Settings(passes=0, photons_per_pass=5000, time_limit=0.5))
    assert film.passes >= 1 and time.monotonic() - start < 5
    film = render(scene, Settings(passes=0, photons_per_pass=20_000, target_noise=0.5))
    assert np.percentile(film.noise(), 95) < 0.5
    with pytest.raises(ValueError, match="Nothing stops"):
        Settings(passes=0)


def test_cancel_keeps_finished_passes():
    scene, stop = room(), threading.Event()
    seen = []

    def on_pass(film):
        seen.append(film.passes)
        if film.passes == 3:
            stop.set()

    film = render(scene, dataclasses.replace(QUICK, passes=100), on_pass, stop.is_set)
    assert film.passes == 3 and seen == [1, 2, 3]
    assert np.array_equal(bands(film), bands(render(scene, dataclasses.replace(QUICK, passes=3))))


def test_one_temperature_needs_no_photons():
    vertices, triangles = box()
    scene = make_scene(
        vertices, triangles, 300.0, [PAINT], look((0.5, 0.5, 0.5), (1, 1, 1)), EDGES, world_temperature=300.0
    )
    film = render(scene, Settings(passes=2))
    assert film.photons == 0
    np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)


GREY = Material("grey", 0.5)
LIGHT_PASSES = Settings(passes=96, photons_per_pass=40_000, neighbours=30, shrink=False)


def middle_of(camera):
    """The 8 x 8 pixels in the middle of a frame of 400 x 400 pixels, 0.04 of the distance across."""
    return Camera(400, 400, camera.matrix, frame=(-1, 1, -1, 1), window=(196, 196, 204, 204))


def irradiance_under(light, spot=0.0):
    """Irradiance per band at (spot, 0, 0) on a plane under a light, from the image: E = pi L / rho, with its error."""
    camera = middle_of(look((spot, 0, 1), (spot, 0, 0)))
    scene = plane(camera, GREY, lights=(light,))
    mean, error = mean_and_error(scene, LIGHT_PASSES)
    return np.pi * mean / 0.5, np.pi * error / 0.5


def expect(light, irradiance, spot=0.0):
    """4 standard errors, and an error small enough (3 %) for that to say something."""
    value, error = irradiance_under(light, spot)
    truth = irradiance * light_spectrum(light, EDGES).sum()
    assert error < 0.03 * truth
    assert abs(value - truth) < 4 * error + 0.002 * truth  # 0.2 %: blur and curvature of E over the gather disk


def test_point_light_falls_with_the_square():
    """E = Phi cos / (4 pi d^2)."""
    light = PointLight(np.array([0, 0, 2.0]), 1000.0)
    expect(light, 1000.0 / (4 * np.pi * 4.0))
    expect(light, 1000.0 / (4 * np.pi * 5.0) * (2 / 5**0.5), spot=1.0)


def test_spot_light_keeps_its_flux_in_the_cone():
    """Full cone: intensity Phi / (2 pi (1 - cos)); blend 1: smoothstep over all of it, 1 in the middle, mean 1/2."""
    down = np.array([0, 0, -1.0])
    solid_angle = 2 * np.pi * (1 - np.cos(0.4))
    expect(SpotLight(np.array([0, 0, 2.0]), down, 1000.0, 0.8), 1000.0 / solid_angle / 4.0)
    expect(SpotLight(np.array([0, 0, 2.0]), down, 1000.0, 0.8, blend=1.0), 2 * 1000.0 / solid_angle / 4.0)


def test_sun_light_gives_its_irradiance():
    expect(SunLight(np.array([0, 0, -1.0]), 500.0), 500.0)
    expect(SunLight(np.array([0, 3**0.5, -1.0]), 500.0, angle=0.02), 250.0)


@pytest.mark.parametrize("ellipse", [False, True])
def test_area_light_has_the_view_factor_of_its_shape(ellipse):
    """E = M F with M = Phi / A; disk on the axis: F = r^2 / (r^2 + d^2); square: 4 times that of a quarter."""
    light = AreaLight(np.array([0, 0, 1.0]), np.array([0.5, 0, 0]), np.array([0, 0.5, 0]), 300.0, ellipse)
    if ellipse:
        factor, size = 0.25 / 1.25, np.pi / 4
    else:  # differential element to a rectangle a x b at distance c from its corner (Howell C-9)
        x = 0.5
        factor, size = 4 * 2 / (2 * np.pi) * x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)), 1.0
    expect(light, 300.0 / size * factor)


def test_mirror_shows_what_it_reflects():
    """A mirror at 45 degrees shows the surroundings times its reflectance, with its own emission."""
    camera = look((0, -1, 1), (0, 0, 0), 8, 6, 0.1)
    film = render(dataclasses.replace(plane(camera, Material("m", 0.2, specular=1.0)), world_temperature=280.0), QUICK)
    truth = 0.8 * band_radiance(EDGES, 280.0).sum()
    np.testing.assert_allclose(film.radiance(), truth, rtol=1e-6)


def test_light_in_a_rough_mirror():
    """Lights are not there for a camera path to hit: the highlight comes from photons, L = rho f E."""
    material = Material("rough", 0.5, specular=1.0, roughness=0.7)
    light = PointLight(np.array([0.0, 1.5, 2.0]), 1000.0)
    camera = middle_of(look((0, -1, 2), (0, 0, 0)))
    mean, error = mean_and_error(plane(camera, material, lights=(light,)), LIGHT_PASSES)
    to_light, to_eye = np.array([0, 1.5, 2.0]) / 2.5, np.array([0, -1, 2.0]) / 5**0.5
    irradiance = 1000.0 / (4 * np.pi * 6.25) * to_light[2] * light_spectrum(light, EDGES).sum()
    truth = 0.5 * evaluate_ggx(tuple(to_light), tuple(to_eye), 0.49) * irradiance
    assert error < 0.03 * truth
    assert abs(mean - truth) < 4 * error + 0.005 * truth  # 0.5 %: the lobe varies over the gather disk


def test_temperature_varies_over_a_triangle():
    """What the camera hits emits at its own temperature: a linear ramp of a black plane is seen exactly."""
    camera = Camera(16, 1, look((0, 0, 1), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-1, 1, -0.01, 0.01))
    scene = plane(camera, Material("black", 1.0), size=2.0)
    scene = dataclasses.replace(scene, temperature=np.float32([[280, 320, 320], [280, 320, 280]]))
    film = render(scene, Settings(passes=64))
    x = (np.arange(16) + 0.5) / 16
    # a pixel is the mean radiance over 2.5 K; its midpoint differs by (2.5 K)^2 / 24 * L'' / L' < 0.01 K
    np.testing.assert_allclose(film.temperature()[0], 280 + 40 * x, atol=0.03)


def test_thin_wall_does_not_leak():
    """A wall with a hot face and a cold one 0.1 mm apart: the cold side does not see the hot side's light."""
    vertices = np.array([(x, y, z) for z in (0, 1e-4) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
    triangles = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)], np.int32)
    lamp = PointLight(np.array([0, 0, -0.5]), 1e5)
    camera = look((0, 0, 1), (0, 0, 0), 8, 8, 0.2)
    scene = make_scene(vertices, triangles, [290, 290, 280, 280], [GREY], camera, EDGES, lights=(lamp,))
    film = render(scene, dataclasses.replace(QUICK, passes=8))
    truth = 0.5 * band_radiance(EDGES, 280.0).sum()  # it reflects a 0 K sky
    np.testing.assert_allclose(film.radiance(), truth, rtol=1e-5)


def test_facing_mirrors_end():
    vertices = np.array([(x, y, z) for z in (0, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
    triangles = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)], np.int32)
    mirror = Material("perfect", 0.0, specular=1.0)
    lamp = PointLight(np.array([0, 0, 0.5]), 10.0)
    camera = Camera(2, 2, look((0, 0, 0.9), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.1, 0.1, -0.1, 0.1))
    scene = make_scene(vertices, triangles, 300.0, [mirror], camera, EDGES, lights=(lamp,), world_temperature=300.0)
    assert np.all(np.isfinite(render(scene, Settings(passes=1, photons_per_pass=1000)).radiance()))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"temperature": np.full(12, np.nan, np.float32)}, "Triangle 0: temperature nan K"),
        ({"temperature": np.arange(36, 0, -1, np.float32).reshape(12, 3) - 4}, "Triangle 11: temperature -3 K"),
        ({"vertices": np.full((8, 3), np.inf)}, "not finite"),
        ({"triangles": np.empty((0, 3), np.int32)}, "no triangles"),
        ({"band_edges": np.array([8.0, 7.0])}, "ascend"),
        ({"band_edges": np.array([0.0, 7.0])}, "above 0"),
        ({"world_temperature": -3.0}, "World: temperature -3"),
        ({"camera": Camera(kind="FISHEYE")}, "FISHEYE"),
        ({"camera": Camera(clip=(2.0, 1.0))}, "clip range 2..1"),
        ({"camera": Camera(frame=(0.0, 0.0, -1.0, 1.0))}, "frame"),
        ({"camera": Camera(lens_radius=0.1, lens_ratio=0.0)}, "lens"),
    ],
)
def test_bad_scenes_are_refused_by_name(change, message):
    vertices, triangles = box()
    scene = make_scene(vertices, triangles, 300.0, [GREY], look((0.5, 0.5, 0.5), (1, 1, 1)), EDGES)
    with pytest.raises(SceneError, match=message):
        render(dataclasses.replace(scene, **change), QUICK)


@pytest.mark.parametrize(
    "material, message",
    [
        ({"emissivity": 1.2}, "'x': emissivity 1.2"),
        ({"emissivity": np.array([[8, 0.5], [7, 0.5]])}, "increase"),
        ({"emissivity": np.array([[8, np.nan]])}, "nan"),
        ({"emissivity": np.array([1.0, 2.0, 3.0])}, "pairs"),
        ({"specular": -0.1}, "specular -0.1"),
    ],
)
def test_bad_materials_are_refused_by_name(material, message):
    with pytest.raises(SceneError, match=message):
        Material("x", **material)


@pytest.mark.parametrize(
    "light, message",
    [
        (PointLight(np.zeros(3), 1.0, radius=np.nan, name="x"), "'x': radius nan m"),
        (PointLight(np.zeros(3), -1.0, name="x"), "'x': power -1"),
        (SpotLight(np.zeros(3), np.ones(3), 1.0, 0.0, name="x"), "'x': a cone of 0 rad"),
        (SpotLight(np.zeros(3), np.ones(3), 1.0, 1.0, blend=2.0, name="x"), "a blend of 2"),
        (SunLight(np.ones(3), 1.0, angle=np.nan, name="x"), "'x': angle nan rad"),
        (SunLight(np.zeros(3), 1.0, name="x"), "'x': direction"),
    ],
)
def test_bad_lights_are_refused_by_name(light, message):
    with pytest.raises(SceneError, match=message):
        plane(look((0, 0, 2), (0, 0, 0)), PAINT, lights=(light,))


def test_surroundings_through_a_hole_that_nothing_found():
    """The pilot's rays miss a hole of a millionth of the walls, and all else is at the reference: the surroundings send
    photons all the same, or their energy would be lost without a word."""
    vertices, triangles = box()
    hole = np.array([(0.5, 0.5, 1.0), (0.502, 0.5, 1.0), (0.5, 0.502, 1.0)])
    assert np.all(vertices[triangles[10:], 2] == 1.0)  # the last two are the ceiling
    outer = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    ring = np.array([*outer, *hole])
    around = [(0, 1, 5), (0, 5, 4), (1, 2, 5), (2, 6, 5), (2, 3, 6), (3, 4, 6), (3, 0, 4)]
    vertices = np.concatenate((vertices, ring))
    triangles = np.concatenate((triangles[:10], np.array(around) + 8)).astype(np.int32)
    scene = make_scene(
        vertices, triangles, 293.15, [PAINT], look((0.5, 0.2, 0.5), (0.5, 1.0, 0.4)), EDGES, world_temperature=220.0
    )
    model = prepare(scene, Settings(reference_temperature=293.15))
    assert model.reference_temperature == np.float32(293.15)  # as the walls': they emit no photons
    assert model.photons_per_pass == Settings().photons_per_pass


@pytest.mark.parametrize("subdivisions", [2, 5])
def test_small_objects_reflect_whatever_their_mesh(subdivisions):
    """A ball of 0.3 m in a horizontal sun over a floor of 4 m: the gather disk spans the ball, and many triangles.

    With the disk's area instead of the surface's inside it the ball would be 88 % too dark. L = rho E cos / pi; the
    window's mean of cos comes from a smooth sphere. 3 %: cos over a disk of a third of the ball's radius.
    """
    ball, triangles = sphere(subdivisions, 0.3)
    floor = np.array([(-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1)], float)
    vertices = np.concatenate((floor, ball))
    triangles = np.concatenate((np.array([(0, 1, 2), (0, 2, 3)], np.int32), triangles + 4)).astype(np.int32)
    sun = SunLight(np.array([0, 1.0, 0]), 1000.0)
    camera = Camera(96, 96, look((0, -3, 0), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.54, 0.54, -0.54, 0.54))
    camera = dataclasses.replace(camera, window=(40, 40, 56, 56))
    scene = make_scene(vertices, triangles, 0.0, [GREY], camera, EDGES, lights=(sun,))
    mean, error = mean_and_error(scene, Settings(passes=64, photons_per_pass=60_000))
    x = (np.arange(100) + 0.5) / 100 * 0.18 - 0.09
    cosine = np.sqrt(1 - (x[:, None] ** 2 + x**2) / 0.09).mean()
    truth = 0.5 * 1000.0 * light_spectrum(sun, EDGES).sum() * cosine / np.pi
    print(f"{mean / truth - 1:+.2%} +- {error / truth:.2%}")
    assert error < 0.05 * truth
    assert abs(mean - truth) < 3 * error + 0.03 * truth
