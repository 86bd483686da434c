# SPDX-License-Identifier: GPL-3.0-or-later
"""Clear gases: exact radiances of slabs and spheres, isothermal scenes, media that overlap, touch and hold the camera.

Truths are those of Bouguer's and Planck's laws (Modest, Radiative Heat Transfer, chapter 10), in units of a blackbody.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from addon.solver import Camera, Material, Medium, PointLight, Scene, SceneError, Settings, render
from addon.solver.geometry.closed import open_edge, outward
from addon.solver.physics.spectrum import band_radiance
from tests.helpers.marks import long
from tests.helpers.path_tracer import standard_error, trace_paths
from tests.helpers.scenes import box, look, make_scene, mean_and_error, pass_means, quad, sphere

pytestmark = pytest.mark.once

EDGES = np.array([9.99, 10.01])  # um, so that formulas for one wavelength hold
FLOAT32 = 1e-6


def black(kelvin):
    return float(band_radiance(EDGES, kelvin)[0])


def block(low, high):
    """Vertices and triangles of a closed box between two corners."""
    vertices, triangles = box(np.subtract(high, low))
    return vertices + np.asarray(low, float), triangles


def filled(name, absorption, kelvin, low, high):
    vertices, triangles = block(low, high)
    return Medium(name, absorption, kelvin, vertices=vertices, triangles=triangles)


def before_a_wall(*media, wall=0.0, camera=((0, 0, 0), (0, 0, -1)), **options):
    """A black wall of 20 m at z = -10, seen straight on from the origin by a narrow camera."""
    return make_scene(
        *quad((0, 0, -10), (10, 0, 0), (0, 10, 0)), wall, [Material("black", 1.0)],
        look(*camera, 4, 3, 1e-3), EDGES, media=media, **options,
    )  # fmt: skip


def seen(scene, **settings):
    """Mean radiance of an image without noise."""
    return float(render(scene, Settings(passes=1, **settings)).radiance().mean(dtype=float))


@pytest.mark.parametrize("away", [0.0, 5.0, 2000.0])
def test_air_before_the_scene_counts(away):
    """From a camera far outside of the scene, too; float32 knows 2 km to 1.2e-4 m."""
    air = Medium("air", 1e-3, 600.0)
    scene = before_a_wall(air, wall=300.0, camera=((0, 0, away), (0, 0, -1)))
    tau = 1e-3 * (10.0 + away)
    truth = black(600.0) * -math.expm1(-tau) + black(300.0) * math.exp(-tau)
    assert seen(scene) == pytest.approx(truth, rel=4e-6)


def test_gas_that_reaches_beyond_the_surfaces():
    """A ball of gas, 60 m wide, around a wall of 20 m, seen from outside of both."""
    vertices, triangles = block((-30, -30, -30), (30, 30, 30))
    gas = Medium("gas", 0.02, 600.0, vertices=vertices, triangles=triangles)
    scene = before_a_wall(gas, wall=300.0, camera=((0, 0, 50), (0, 0, -1)))
    truth = black(600.0) * -math.expm1(-0.8) + black(300.0) * math.exp(-0.8)
    assert seen(scene) == pytest.approx(truth, rel=4e-6)


SLAB = (-5, -5, -6), (5, 5, -4)


@pytest.mark.parametrize("subtraction", [True, False])
@pytest.mark.parametrize("depth", [1e-3, 0.1, 1.0, 30.0])
def test_a_slab_emits_and_absorbs(depth, subtraction):
    """1 - exp(-tau) of its own, exp(-tau) of the wall behind; the camera's cone makes paths longer by 1e-6."""
    scene = before_a_wall(filled("gas", depth / 2.0, 600.0, *SLAB), wall=300.0)
    truth = black(600.0) * -math.expm1(-depth) + black(300.0) * math.exp(-depth)
    assert seen(scene, reference_subtraction=subtraction) == pytest.approx(truth, rel=4e-6)


def test_a_mirror_behind_gas_that_nothing_gets_through():
    """Rays from a floor that meet the mirror have lost all in float32, at a depth of 200. The floor is lit by the gas
    alone, but for 1 %."""
    parts = (*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 300.0, 0), (*quad((0, 0, 3), (9, 0, 0), (0, 9, 0)), 300.0, 1)
    gas = filled("gas", 200.0, 500.0, (-9, -9, 1), (9, 9, 2))
    materials = [Material("floor", 0.5), Material("mirror", 0.1, 1.0)]
    scene = joined(parts, materials, look((0.1, 0, 0.5), (0, 0, 0), 8, 6, 0.2), media=(gas,))
    image = render(scene, Settings(passes=4, photons_per_pass=1000, reference_temperature=300.0)).radiance()
    assert image.mean(dtype=float) == pytest.approx(0.5 * (black(300.0) + black(500.0)), rel=0.02)


@pytest.mark.parametrize("t0", [None, 500.0])
@pytest.mark.parametrize("inner, outer", [(600.0, 300.0), (300.0, 600.0)])
def test_media_that_overlap_add(inner, outer, t0):
    """A slab within a slab: three stretches, in the middle one both absorb and emit."""
    scene = before_a_wall(
        filled("inner", 0.4, inner, (-1, -1, -6), (1, 1, -5)), filled("outer", 0.2, outer, (-2, -2, -8), (2, 2, -3))
    )
    a, b = black(inner), black(outer)
    truth = b * -math.expm1(-0.4)  # 2 m of the outer one in front
    both = (0.4 * a + 0.2 * b) / 0.6
    truth += math.exp(-0.4) * both * -math.expm1(-0.6) + math.exp(-1.0) * b * -math.expm1(-0.4)
    assert seen(scene, reference_temperature=t0) == pytest.approx(truth, rel=4e-6)


def test_media_that_touch_are_those_of_one_block():
    """Two boxes that share a face, one after the other along the view, and a mirrored one, whose faces look inwards."""
    vertices, triangles = block((-2, -2, -8), (2, 2, -6))
    far = Medium("far", 0.1, 500.0, vertices=vertices, triangles=triangles[:, ::-1])
    two = before_a_wall(filled("near", 0.1, 500.0, (-2, -2, -6), (2, 2, -4)), far)
    assert seen(two) == pytest.approx(black(500.0) * -math.expm1(-0.4), rel=4e-6)


@pytest.mark.parametrize("position, inside", [((0, 0, -5), 1.0), ((0, 0, -6 + 1e-3), 1e-3), ((0, 0, -7), 0.0)])
def test_the_camera_may_be_inside(position, inside):
    """To the rounding of positions in float32, 5e-7 m here."""
    scene = before_a_wall(filled("gas", 1.0, 500.0, *SLAB), camera=(position, (0, 0, -10)))
    assert seen(scene) == pytest.approx(black(500.0) * -math.expm1(-inside), rel=4e-6, abs=5e-7 * black(500.0))


def test_surfaces_stand_in_a_medium():
    """A wall in the middle of the slab hides what is behind it."""
    scene = before_a_wall(filled("gas", 0.5, 500.0, (-5, -5, -20), (5, 5, -4)), wall=400.0)
    truth = black(500.0) * -math.expm1(-3.0) + black(400.0) * math.exp(-3.0)
    assert seen(scene) == pytest.approx(truth, rel=4e-6)


def test_the_world_is_filled_to_its_depth():
    """A ray that leaves the scene crosses its depth, one that meets the wall only the way to it."""
    air = Medium("air", 0.05, 300.0)
    sky = before_a_wall(air, camera=((0, 0, 0), (0, 0, 1)), world_depth=40.0, world_temperature=200.0)
    truth = black(300.0) * -math.expm1(-2.0) + black(200.0) * math.exp(-2.0)
    assert seen(sky) == pytest.approx(truth, rel=FLOAT32)
    wall = before_a_wall(air, world_depth=40.0, wall=400.0)
    truth = black(300.0) * -math.expm1(-0.5) + black(400.0) * math.exp(-0.5)
    assert seen(wall) == pytest.approx(truth, rel=4e-6)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        long({"reference_subtraction": False}),
        long({"reference_temperature": 400.0}),
    ],
)
def test_an_isothermal_room_is_black(settings):
    """Grey, mirror and rough walls with gas in a part of the room and everywhere, at one temperature: each pixel has
    the radiance of a blackbody, by the subtraction exactly, else within 5 of its errors (48 pixels) and the mean within
    4."""
    vertices, triangles = box((2.0, 3.0, 2.5))
    materials = [Material("grey", 0.3), Material("mirror", 0.2, 1.0), Material("rough", 0.4, 0.7, 0.4)]
    scene = make_scene(
        vertices, triangles[:, ::-1], 350.0, materials, look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), EDGES,
        np.repeat([0, 1, 2, 0, 0, 0], 2),
        media=(Medium("air", 0.1, 350.0), filled("plume", 2.0, 350.0, (0.5, 1, 0), (1.5, 2, 2))), world_depth=5.0,
    )  # fmt: skip
    passes = 64 if settings else 1
    film = render(scene, Settings(passes=passes, photons_per_pass=10_000, **settings))
    if not settings:
        assert np.all(np.abs(film.temperature() - 350.0) < 1e-4)
        return
    off, noise = film.temperature() - 350.0, film.noise()
    print("worst", np.max(np.abs(off) / noise), "mean", off.mean(), "noise", noise.mean())
    assert np.all(np.abs(off) < 5 * noise + 1e-3)
    mean, error = mean_and_error(scene, Settings(passes=passes, photons_per_pass=10_000, **settings))
    assert abs(mean - black(350.0)) < 4 * error + FLOAT32 * mean


def gas_sphere(emissivity, wall, gas, depth):
    """A diffuse sphere of 1 m diameter filled with gas, seen from its middle."""
    vertices, triangles = sphere(4, 0.5)
    round_off = 0.5 / np.linalg.norm(vertices[triangles].mean(axis=1), axis=1).mean()  # facets lie inside the sphere
    vertices = vertices * round_off
    return make_scene(
        vertices, triangles[:, ::-1], wall, [Material("wall", emissivity)],
        look((0, 0, 0), (0.3, 0.2, 1), 6, 5, 0.3), EDGES, media=(Medium("gas", depth, gas),), world_depth=1.0,
    )  # fmt: skip


@pytest.mark.parametrize("t0", [None, *map(long, (0.0, 450.0))])
def test_gas_in_a_grey_sphere(t0):
    """Radiosity J = (e Bw + (1 - e) eg Bg) / (1 - (1 - e) (1 - eg)), eg = 1 - 2/t^2 (1 - (1 + t) exp(-t)) the
    cosine-weighted emissivity of a sphere of optical diameter t (Modest, section 10.6 and chapter 5). From the middle
    half a diameter of gas lies before the wall. 4 standard errors and 0.1 %, as the sphere has facets."""
    e, wall, gas, t = 0.5, 350.0, 400.0, 1.0
    scene = gas_sphere(e, wall, gas, t)
    eg = 1.0 - 2.0 / t**2 * (1.0 - (1.0 + t) * math.exp(-t))
    radiosity = (e * black(wall) + (1 - e) * eg * black(gas)) / (1.0 - (1 - e) * (1 - eg))
    truth = radiosity * math.exp(-0.5 * t) + black(gas) * -math.expm1(-0.5 * t)
    settings = {"reference_subtraction": False} if t0 == 0.0 else {"reference_temperature": t0}
    mean, error = mean_and_error(scene, Settings(passes=48, photons_per_pass=20_000, **settings))
    print(f"{mean:.6f} +- {error:.6f}, exact {truth:.6f}, {mean / truth - 1:+.3%}")
    assert abs(mean - truth) < 4 * error + 1e-3 * truth


@pytest.mark.long
def test_gas_between_plates_with_mirrors():
    """Plates of 400 K (e .8) and 300 K (e .4), gas at 600 K, tau .2 between them, mirrors around: an endless slab, of
    which 2 E3(tau) gets through (Modest, chapter 14). 4 standard errors."""
    from scipy.special import expn

    tau, gas = 0.2, black(600.0)
    through = 2.0 * float(expn(3, tau))
    a, b = (0.8, black(400.0)), (0.4, black(300.0))
    matrix = np.array([[1.0, -(1 - a[0]) * through], [-(1 - b[0]) * through, 1.0]])
    source = [e * of + (1 - e) * gas * (1 - through) for e, of in (a, b)]
    radiosity = np.linalg.solve(matrix, source)
    vertices, triangles = box((1.0, 1.0, 1.0))
    materials = [Material("mirror", 0.0, 1.0), Material("hot", 0.8), Material("cold", 0.4)]
    temperature = np.repeat([300.0] * 4 + [400.0, 300.0], 2)
    for target, side in (((0.5, 0.5, 0.0), 0), ((0.5, 0.5, 1.0), 1)):
        camera = look((0.5, 0.5, 0.5), target, 4, 3, 0.2)
        scene = make_scene(
            vertices, triangles[:, ::-1], temperature, materials, camera, EDGES, np.repeat([0, 0, 0, 0, 1, 2], 2),
            media=(Medium("gas", tau, 600.0),), world_depth=1.0,
        )  # fmt: skip
        # along each pixel's way to the plate
        x, y = np.meshgrid((np.arange(4) + 0.5) / 2 - 1, (np.arange(3) + 0.5) / 1.5 - 1)
        way = 0.5 * np.sqrt(1 + (0.2 * x) ** 2 + (0.15 * y) ** 2)
        truth = np.mean(radiosity[side] * np.exp(-tau * way) - gas * np.expm1(-tau * way))
        mean, error = mean_and_error(scene, Settings(passes=12, photons_per_pass=20_000))
        print(f"plate {side}: {mean:.5f} +- {error:.5f}, exact {truth:.5f}")
        assert abs(mean - truth) < 4 * error + 1e-4 * truth


# Scattering. Numbers of isotropically scattering slabs: exact solutions, to the digits that stand here.


def scattering_slab(omega, tau, medium, below, anisotropy=0.0):
    """A slab of 1 m, endless by mirrors around it, over a black plate at z = 0, under one of 0 K, seen straight down.
    Temperatures in K."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    materials = [Material("mirror", 0.0, 1.0), Material("black", 1.0)]
    temperature = np.repeat([0.0] * 4 + [below, 0.0], 2)
    return make_scene(
        vertices, triangles[:, ::-1], temperature, materials, look((0.5, 0.5, 1.0 - 1e-6), (0.5, 0.5, 0.0), 4, 3, 1e-3),
        EDGES, np.repeat([0, 0, 0, 0, 1, 1], 2), world_depth=1.0,
        media=(Medium("fog", (1.0 - omega) * tau, medium, omega * tau, anisotropy),),
    )  # fmt: skip


@pytest.mark.parametrize("omega, tau, source, truth", [
    long(1.0, 1.0, "plate", 0.658671),
    (0.9, 1.0, "plate", 0.591625),
    long(0.5, 1.0, "plate", 0.446058),
    long(0.9, 1.0, "medium", 0.140965),
    long(0.5, 1.0, "medium", 0.454822),
    (0.5, 40.0, "medium", 0.884774),  # a half-space but for 1e-16
    long(0.9, 40.0, "medium", 0.585053),
])  # fmt: skip
def test_scattering_slabs(omega, tau, source, truth):
    """Light from a plate through a slab, and from the slab itself, over that of a blackbody: 4 standard errors. The
    half-space is sqrt(1 - omega) H(1) with Chandrasekhar's H."""
    kelvin = 400.0
    scene = scattering_slab(omega, tau, kelvin if source == "medium" else 0.0, kelvin if source == "plate" else 0.0)
    mean, error = mean_and_error(scene, Settings(passes=400, photons_per_pass=1000))
    mean, error = mean / black(kelvin), error / black(kelvin)
    print(f"omega {omega}, tau {tau}, {source}: {mean:.5f} +- {error:.5f}, exact {truth:.5f}")
    assert error < 0.01 and abs(mean - truth) < 4 * error


@pytest.mark.parametrize("anisotropy", [*map(long, (0.0, -0.5)), 0.8])
def test_mean_radiance_in_a_scattering_cube(anisotropy):
    """One black face, the others cold, and pure scattering between: in the middle the mean over all directions is one
    sixth, by symmetry and superposition, whatever the phase function. 4 standard errors."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    temperature = np.repeat([400.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2)
    camera = Camera(16, 8, look((0.5, 0.5, 0.5), (0.5, 1.0, 0.5)).matrix, "PANORAMA",
                    (-np.pi, np.pi, -0.5 * np.pi, 0.5 * np.pi))  # fmt: skip
    scene = make_scene(
        vertices, triangles[:, ::-1], temperature, [Material("black", 1.0)], camera, EDGES, world_depth=1.0,
        media=(Medium("fog", 0.0, 0.0, 2.0, anisotropy),),
    )  # fmt: skip
    latitude = np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9))
    weight = np.diff(latitude)[:, None] / 32.0  # share of the sphere that a pixel covers
    sums = [0.0]
    # pixels have an even density of rays in latitude, which is not that of the sphere: rows of 1/8 of it are nearly so
    render(scene, Settings(passes=100), lambda film: sums.append(film.passes * float(np.sum(film.radiance() * weight))))
    each = np.diff(sums) / black(400.0)
    mean, error = each.mean(), each.std(ddof=1) / np.sqrt(len(each))
    print(f"anisotropy {anisotropy}: {mean:.5f} +- {error:.5f}, exact {1 / 6:.5f}")
    assert abs(mean - 1 / 6) < 4 * error + 1e-3


@pytest.mark.parametrize("anisotropy", [long(0.0), 0.6])
def test_a_light_in_fog(anisotropy):
    """Light of a lamp that is scattered once, seen against nothing: the integral along the view of
    s phase(angle) I / d^2 exp(-s (way + d)); fog so thin that what is scattered twice is below 0.2 % of it."""
    s, power = 1e-3, 1e4
    light = PointLight(np.array([0.0, 1.0, -5.0]), power, temperature=2856.0)
    vertices, triangles = quad((0, -50, 0), (0.01, 0, 0), (0, 0, 0.01))
    scene = make_scene(
        vertices, triangles, 0.0, [Material("black", 1.0)], look((0, 0, 0), (0, 0, -1), 4, 3, 1e-3), EDGES,
        lights=(light,), media=(Medium("fog", 0.0, 0.0, s, anisotropy),), world_depth=60.0,
    )  # fmt: skip
    from addon.solver.photons.lights import light_spectrum

    nodes, weights = np.polynomial.legendre.leggauss(2000)
    way = 30.0 * (nodes + 1)
    towards = np.stack([0 * way, np.ones_like(way), way - 5.0], axis=1)  # from the view to the lamp
    d = np.linalg.norm(towards, axis=1)
    cosine = towards[:, 2] / d  # light travels from the lamp, then along +z to the camera
    g = anisotropy
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * -cosine) ** 1.5)
    intensity = power * light_spectrum(light, EDGES)[0] / (4 * np.pi)
    truth = float(np.sum(30.0 * weights * s * phase * intensity / d**2 * np.exp(-s * (way + d))))
    mean, error = mean_and_error(scene, Settings(passes=2000, photons_per_pass=1000))
    print(f"anisotropy {g}: {mean / truth:.4f} +- {error / truth:.4f} of the exact value")
    assert error < 0.05 * truth and abs(mean - truth) < 4 * error + 2e-3 * truth


def test_fog_of_one_temperature_is_black():
    """Any mixture of media, with a wrong T0, mean within 4 standard errors."""
    vertices, triangles = box((2.0, 3.0, 2.5))
    materials = [Material("grey", 0.3), Material("mirror", 0.2, 1.0), Material("rough", 0.4, 0.7, 0.4)]
    plume = block((0.5, 1, 0.2), (1.5, 2, 2))
    scene = make_scene(
        vertices, triangles[:, ::-1], 350.0, materials, look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), EDGES,
        np.repeat([0, 1, 2, 0, 0, 0], 2), world_depth=5.0,
        media=(Medium("air", 0.1, 350.0, 0.3, 0.5), Medium("plume", 1.0, 350.0, 2.0, -0.3, *plume)),
    )  # fmt: skip
    mean, error = mean_and_error(scene, Settings(passes=64, photons_per_pass=10_000, reference_temperature=400.0))
    print(f"{mean / black(350.0) - 1:+.3%} +- {error / mean:.3%}")
    assert abs(mean - black(350.0)) < 4 * error and error < 0.01 * mean


def test_what_scatters_straight_on_changes_nothing():
    """Anisotropy 1, beside the same room without fog; photons and rays of gathers cross it."""
    vertices, triangles = box((2, 2, 2))
    scene = make_scene(
        vertices, triangles[:, ::-1], np.where(np.arange(12) < 2, 600.0, 300.0), [Material("grey", 0.7)],
        look((1, 0.2, 1.2), (1, 3, 1), 4, 3, 0.6), EDGES,
    )  # fmt: skip
    foggy = replace(scene, media=(Medium("fog", 0.0, 300.0, 2.0, 1.0),), world_depth=1.0)
    (clear, noise), (fog, more) = (
        mean_and_error(each, Settings(passes=32, photons_per_pass=5000)) for each in (scene, foggy)
    )
    print(f"{fog / clear - 1:+.3%} +- {np.hypot(noise, more) / clear:.3%}")
    assert abs(fog - clear) < 4 * np.hypot(noise, more) and np.hypot(noise, more) < 0.02 * clear


@pytest.mark.parametrize("turn", [False, True])
def test_normals_are_turned_outwards(turn):
    """Of each part by itself."""
    (vertices, triangles), (others, inverted) = block((0, 0, 0), (1, 1, 1)), block((3, 0, 0), (4, 1, 1))
    vertices, triangles = np.concatenate((vertices, others)), np.concatenate((triangles, inverted[:, ::-1] + 8))
    triangles = triangles[:, ::-1] if turn else triangles
    corners = outward(np.asarray(vertices, float)[triangles])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = np.where(corners[:, :1, 0].mean(axis=1) < 2, 0.5, 3.5)
    away = corners.mean(axis=1) - np.stack([middle, np.full(len(middle), 0.5), np.full(len(middle), 0.5)], axis=1)
    assert np.all(np.einsum("ti,ti->t", normal, away) > 0)


def test_leaks_are_found():
    vertices, triangles = block((0, 0, 0), (1, 1, 1))
    assert open_edge(vertices, triangles) is None
    apart = vertices[triangles].reshape(-1, 3)  # no vertex is shared
    assert open_edge(apart, np.arange(len(apart)).reshape(-1, 3)) is None
    leak = open_edge(vertices, triangles[:-1])
    assert leak is not None and np.all((leak >= 0) & (leak <= 1))


@pytest.mark.parametrize("values, message", [
    ({"absorption": -0.5}, "Medium 'gas': absorption -0.5 1/m; it is finite and at least 0"),
    ({"absorption": np.nan}, "Medium 'gas': absorption nan 1/m"),
    ({"scattering": np.inf}, "Medium 'gas': scattering inf 1/m"),
    ({"anisotropy": 1.5}, "Medium 'gas': anisotropy 1.5 is outside -1..1"),
    ({"absorption": np.array([[4.0, 1.0], [3.0, 2.0]])}, "wavelengths must increase"),
    ({"temperature": -3.0}, "Medium 'gas': temperature -3 K"),
])  # fmt: skip
def test_bad_media_are_named(values, message):
    with pytest.raises(SceneError, match=message):
        Medium(**{"name": "gas", "temperature": 300.0, **values})


@pytest.mark.parametrize("change, message", [
    (lambda v, t: (v, t[:0]), "Medium 'gas': its mesh has no triangles"),
    (lambda v, t: (v[:5], t), "Medium 'gas': a triangle names a vertex that does not exist"),
    (lambda v, t: (np.where(v > 0, np.nan, v), t), r"Medium 'gas': vertex 1 is not finite: \[0.0, 0.0, nan\]"),
    (lambda v, t: (v, None), "Medium 'gas': a mesh has both vertices and triangles"),
])  # fmt: skip
def test_bad_meshes_are_named(change, message):
    vertices, triangles = change(*box())
    with pytest.raises(SceneError, match=message):
        Medium("gas", 1.0, 300.0, vertices=vertices, triangles=triangles)


def test_an_open_mesh_cannot_be_rendered():
    vertices, triangles = block((-1, -1, -3), (1, 1, -1))
    scene = before_a_wall(Medium("gas", 1.0, 300.0, vertices=vertices, triangles=triangles[1:]))
    with pytest.raises(SceneError, match=r"Medium 'gas': its mesh is open at \(-1, .*\); a gas fills closed meshes"):
        render(scene, Settings(passes=1))


@pytest.mark.parametrize("depth", [-1.0, np.nan, np.inf])
def test_a_bad_depth_of_the_world_is_named(depth):
    with pytest.raises(SceneError, match="World: depth .* the depth of its gas is finite and at least 0 m"):
        before_a_wall(Medium("air", 1.0, 300.0), world_depth=depth)


def test_the_log_tells_of_gas(caplog):
    media = (
        Medium("air", 0.1, 300.0),
        Medium("fog", 0.1, 300.0, 1.0),
        Medium("car", gas={"CO2": 0.1}, temperature=300.0),
    )
    with caplog.at_level("INFO"):
        render(before_a_wall(*media), Settings(passes=1))
    assert "3 media with gas, of which 1 scatter, lines of CO2" in caplog.text


def fog_around_a_ball(scattering, anisotropy, mirror):
    """A hot ball over a floor in fog, perhaps beside a mirror, seen from outside."""
    ball, floor = sphere(3, 0.15), quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    parts = [(ball[0] + (0.2, 0.1, 0.4), ball[1], 600.0, 0), (*floor, 300.0, 1)]
    if mirror:
        parts.append((*block((-0.55, 0.05, 0.01), (-0.25, 0.35, 0.31)), 300.0, 2))
    materials = [Material("hot", 0.9), Material("floor", 0.5), Material("mirror", 0.3, specular=1.0)]
    fog = Medium("fog", 0.1, 300.0, scattering=scattering, anisotropy=anisotropy)
    return joined(parts, materials, look((0.6, -2.2, 1.2), (0, 0, 0.3), 12, 9, 0.8), media=(fog,), world_depth=4.0)


def joined(parts, materials, camera, **options):
    """A Scene of (vertices, triangles, kelvin, material) each, in surroundings of 300 K."""
    offsets = np.cumsum([0, *(len(part[0]) for part in parts[:-1])])
    return Scene(
        np.concatenate([part[0] for part in parts]),
        np.concatenate([part[1] + offset for part, offset in zip(parts, offsets, strict=True)]),
        np.concatenate([np.full(len(part[1]), part[3]) for part in parts]),
        np.concatenate([np.full(len(part[1]), part[2]) for part in parts]),
        tuple(materials), camera, EDGES, 300.0, **options,
    )  # fmt: skip


@pytest.mark.parametrize(
    "scattering, anisotropy, mirror",
    [
        long(0.0, 0.0, False),
        (0.5, 0.0, True),
        long(1.0, 0.6, False),
    ],
)
def test_fog_agrees_with_a_path_tracer(scattering, anisotropy, mirror):
    """Quarters of the image, within 4 standard errors of both; the tracer has no shadow rays and no photons."""
    scene = fog_around_a_ball(scattering, anisotropy, mirror)
    film_quarters, before = [], [0.0]

    def note(film):
        total = (film.radiance().astype(float) - black(300.0)) * film.passes
        film_quarters.append(quarters(total - before[0]))
        before[0] = total

    render(scene, Settings(passes=32, photons_per_pass=10000, reference_temperature=300.0), note)
    traced = [quarters(image[..., 0]) for image in trace_paths(scene, 200, batches=16, threads=2).images]
    (ours, error), (theirs, other) = (
        (np.mean(x, axis=0), standard_error(np.array(x))) for x in (film_quarters, traced)
    )
    print(f"{ours} +- {error}, a path tracer {theirs} +- {other}")
    assert np.all(abs(ours - theirs) < 4.0 * np.hypot(error, other))


@pytest.mark.parametrize(("radius", "half"), [(0.15, 20.0), (0.03, 2.0)])
def test_a_small_flame_lights_a_wide_floor(radius, half):
    """Of the power 4 pi^2 r^2 e dB of a ball of gas (Modest, section 10.4: e = 1 - 2 / tau^2 (1 - (1 + tau) exp(-tau)),
    tau = 2 k r) a floor at the height h gets P cos / (4 pi d^2), as the flux of a ball goes straight away from it.
    Photons that are even over the floor seldom meet the flame. Within 4 standard errors and the share of the ball's
    volume that its mesh leaves out."""
    kelvin, absorption, height = 1200.0, 0.5 / radius, 1.0
    vertices, triangles = sphere(2, radius)
    flame = Medium("flame", absorption, kelvin, vertices=vertices + (0, 0, height), triangles=triangles)
    floor = quad((0, 0, 0), (half, 0, 0), (0, half, 0))
    view = look((0, 0, 0.8), (0, 0, 0), 8, 6, tangent=0.4)
    material = Material("floor", 0.5)
    scene = make_scene(*floor, 300.0, [material], view, EDGES, world_temperature=300.0, media=(flame,))
    found = pass_means(scene, Settings(passes=48, photons_per_pass=10_000, threads=1)).sum(axis=1)
    tau = 2.0 * absorption * radius
    emitted = 1.0 - 2.0 / tau**2 * (1.0 - (1.0 + tau) * math.exp(-tau))
    x, y = np.meshgrid((np.arange(80) + 0.5) / 80 * 0.64 - 0.32, (np.arange(60) + 0.5) / 60 * 0.48 - 0.24)
    seen_of = radius**2 * height / (x**2 + y**2 + height**2) ** 1.5
    truth = 0.5 * emitted * np.mean(seen_of) * (black(kelvin) - black(300.0))
    excess = found - black(300.0)
    error = standard_error(excess)
    print(excess.mean() / truth, error / truth)
    corners = vertices[triangles]
    missing = 1.0 - np.linalg.det(corners).sum() / 6.0 / (4.0 / 3.0 * math.pi * radius**3)
    assert abs(excess.mean() - truth) < 4.0 * error + missing * truth
    assert error < 0.3 * truth


@pytest.mark.long
@pytest.mark.parametrize("mirror", [False, True])
def test_bands_may_differ_in_anisotropy(mirror):
    """Of two bands in one render each has the light of a render in which both are scattered as this one: 4 standard
    errors. The ball is found by shadow rays, photons and by chance, behind the mirror too."""
    scene = fog_around_a_ball(1.0, 0.0, mirror)
    curve = np.array([[3.0, 0.9], [5.0, 0.9], [5.0001, -0.4], [8.0, -0.4]])
    settings = Settings(passes=64, photons_per_pass=5000, reference_temperature=300.0)

    def bands(anisotropy):
        (fog,) = scene.media
        changed = {"media": (replace(fog, anisotropy=anisotropy),), "band_edges": np.array([3.0, 5.0, 8.0])}
        return pass_means(replace(scene, **changed), settings)

    mixed = bands(curve)
    for b, anisotropy in enumerate((0.9, -0.4)):
        alone = bands(anisotropy)
        both = [each[:, b] for each in (mixed, alone)]
        means, errors = ([function(each) for each in both] for function in (np.mean, standard_error))
        print(f"g {anisotropy}: {means[0]:.4f} +- {errors[0]:.4f}, alone {means[1]:.4f} +- {errors[1]:.4f}")
        assert abs(means[0] - means[1]) < 4.0 * np.hypot(*errors)
        assert errors[0] < 2.5 * errors[1]


def quarters(image):
    """Means over the four quarters of an image (height, width)."""
    height, width = np.array(image.shape) // 2
    return np.array(
        [part.mean() for rows in (image[:height], image[height:]) for part in (rows[:, :width], rows[:, width:])]
    )


@pytest.mark.long
def test_noise_through_fog_is_what_seeds_differ_by():
    """True over stated error between 0.8 and 1.2, as everywhere; 768 pixels tell it to 3 %."""
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    fog = Medium("fog", 0.05, 400.0, scattering=0.2)
    scene = joined(
        [(*floor, 300.0, 0)], [Material("floor", 0.5)], look((0.6, -2.2, 1.2), (0, 0, 0.3), 32, 24, 0.8),
        media=(fog,), world_depth=4.0,
    )  # fmt: skip
    films = [render(scene, Settings(passes=64, photons_per_pass=2000, seed=seed)) for seed in (0, 1)]
    difference = films[0].temperature().astype(float) - films[1].temperature()
    ratio = np.sqrt(np.mean(difference**2 / (films[0].noise() ** 2 + films[1].noise() ** 2)))
    print(f"true over stated error {ratio:.2f}")
    assert 0.8 < ratio < 1.2
