# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases at the edge of what can be rendered: extreme temperatures, surfaces, bands, sizes, meshes, views and numbers.

Every image of every render here must be finite, in each case. Most scenes are closed rooms at one temperature, which
are black at it whatever they look like (Kirchhoff). With the right reference that is exact by construction, so the
cases are also rendered without the subtraction, and from a wrong reference.

Statistical tests ask for 4 standard errors, from the spread of the passes: with 15 degrees of freedom a sound engine
misses that in one of 860 comparisons, and there are some sixty here.
"""

import dataclasses
import importlib

import numpy as np
import pytest
import scenes
from scenes import box, cylinder, join, look, make_scene, mean_and_error, pass_means, quad, sphere

from addon.solver import Camera, Film, Material, PointLight, Settings, SunLight, render
from addon.solver.emission import light_spectrum
from addon.solver.spectrum import apparent_temperature, band_radiance
from addon.solver.surfaces import areas

EDGES = np.array([8.0, 9.0, 12.0])
QUICK = Settings(passes=16, photons_per_pass=5000)
GREY = Material("grey", 0.5)
SUBTRACTION = [
    pytest.param({}, id="subtraction"),
    pytest.param({"reference_subtraction": False}, id="no-subtraction"),
]
ROUNDING = 5e-7  # of images: float32 keeps 6e-8, and differences to a reference a few of that


def black(edges, kelvin):
    """Radiance of a blackbody over all bands, W m-2 sr-1."""
    return band_radiance(edges, kelvin).sum()


def checked_render(*arguments, **options):
    """A render whose images must all be finite."""
    film = render(*arguments, **options)
    for image in (film.bands(), film.radiance(), film.temperature(), film.noise()):
        assert np.all(np.isfinite(image))
    assert np.all(film.noise() >= 0)
    return film


@pytest.fixture(autouse=True)
def check_every_render(monkeypatch):
    monkeypatch.setattr(scenes, "render", checked_render)


def room(size=1.0, shift=0.0, material=GREY, kelvin=300.0, edges=EDGES, **options):
    """The inside of a closed box of 1 x 0.8 x 0.6 times size, moved by shift."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    return closed(vertices * size + shift, triangles, (0.8, 0.6, 0.4), material, kelvin, edges, size, shift, **options)


def closed(vertices, triangles, eye, material=GREY, kelvin=300.0, edges=EDGES, size=1.0, shift=0.0, **options):
    """A closed surface seen from inside, a few pixels wide."""
    camera = look(np.array(eye) * size + shift, np.array([0.1, 0.1, 0.1]) * size + shift, 8, 6)
    return make_scene(vertices, triangles, kelvin, [material], camera, edges, **options)


def expect(scene, truth, settings=QUICK, **change):
    """The mean of the image is the truth (W m-2 sr-1) within 4 standard errors, or rounding."""
    settings = dataclasses.replace(settings, **change)
    mean, error = mean_and_error(scene, settings)
    print(f"{mean / truth - 1:+.2e} +- {error / truth:.1e}")
    assert error < 0.05 * truth  # else it would say little
    assert abs(mean - truth) <= 4 * error + ROUNDING * truth


def expect_black(scene, kelvin=300.0, settings=QUICK):
    """Black at its temperature: every pixel and band with the subtraction, the mean without it or with a wrong T0."""
    truth = band_radiance(scene.band_edges, kelvin)
    film = checked_render(scene, dataclasses.replace(settings, passes=2))
    pixels = film.bands() * np.diff(scene.band_edges)[:, None, None]
    np.testing.assert_allclose(pixels, np.broadcast_to(truth[:, None, None], pixels.shape), rtol=ROUNDING)
    assert np.all(film.noise() == 0)
    expect(scene, truth.sum(), settings, reference_subtraction=False)
    expect(scene, truth.sum(), settings, reference_temperature=1.05 * kelvin)


# Temperatures


@pytest.mark.parametrize("kelvin", [40.0, 3000.0, 1e5, 1e6])
def test_rooms_of_any_temperature_are_black(kelvin):
    """At 40 K bands at 10 um hold 1e-12 of what they hold at 300 K."""
    expect_black(room(kelvin=kelvin), kelvin)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("kelvin", [0.0, 3.0])
def test_nothing_comes_from_what_is_too_cold(kelvin, settings):
    """At 3 K there is less in a band at 10 um than the smallest float32: exactly 0, and no temperature to be told."""
    film = checked_render(room(kelvin=kelvin), dataclasses.replace(QUICK, **settings))
    assert np.all(film.bands() == 0) and np.all(film.temperature() == 0) and np.all(film.noise() == 0)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_three_kelvin_in_the_far_infrared(settings):
    """The cosmic background around a surface at 0 K, in bands around the peak of its spectrum (1 mm)."""
    edges = np.array([500.0, 1000.0, 2000.0])
    scene = make_scene(*box(), 0.0, [GREY], look((2, 2, 2), (0.5, 0.5, 0.5), 8, 6, 0.05), edges, world_temperature=3.0)
    expect(scene, 0.5 * black(edges, 3.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_filament_beside_walls(settings):
    """A sphere at 3000 K in one at 300 K, 3-5 um, radiances 1 to 3e4: concentric diffuse spheres have a closed form.

    J1 = e1 B1 + (1 - e1) J2 on the inner sphere, which sees the outer one alone; that one sees the inner one by the
    share f = A1 / A2, and itself: J2 = e2 B2 + (1 - e2) (f J1 + (1 - f) J2) (Modest, Radiative Heat Transfer, chapter
    5). The camera looks from near the inner sphere at the outer one. The inner one is a lamp in the middle of the
    scene, where shadow rays are long against its coordinates. f is that of the meshes' areas; 0.3 %: their facets.
    """
    edges = np.array([3.0, 5.0])
    inner, outer = sphere(3, 0.1), sphere(4, 1.0)
    e1, e2, b1, b2 = 0.4, 0.8, black(edges, 3000.0), black(edges, 300.0)
    assert b1 / b2 > 1e4
    f = np.divide(*(areas(points[corners].astype(np.float32)).sum() for points, corners in (inner, outer)))
    j2 = np.linalg.solve([[1.0, e1 - 1.0], [(e2 - 1.0) * f, 1.0 - (1.0 - e2) * (1.0 - f)]], [e1 * b1, e2 * b2])[1]
    vertices, triangles, kelvin, material = join((*inner, 3000.0, 0), (*outer, 300.0, 1))
    camera = look((0.0, 0.0, 0.3), (0.0, 0.0, 1.0), 8, 6, 0.5)
    scene = make_scene(vertices, triangles, kelvin, [Material("", e1), Material("", e2)], camera, edges, material)
    mean, error = mean_and_error(scene, dataclasses.replace(QUICK, passes=64, **settings))
    print(f"{mean / j2 - 1:+.2e} +- {error / j2:.1e}")
    assert error < 0.01 * j2
    assert abs(mean - j2) < 4 * error + 0.003 * j2


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_temperature_that_runs_steeply_over_one_triangle(settings):
    """300 K to 1500 K over one triangle in 3-5 um: what it emits is Planck's law at each point, not of the mean.

    A black triangle lights a small reflector parallel to it. E = integral of L cos cos' / d^2 by quadrature over
    200 x 200 points; the reflector is small, so its middle stands for it (0.2 %).
    """
    edges = np.array([3.0, 5.0])
    hot = np.array([(-1.0, -1.0, 1.0), (1.0, -1.0, 1.0), (-1.0, 1.0, 1.0)])
    at_corners = np.array([300.0, 1500.0, 300.0])
    s, t = np.meshgrid(*(((np.arange(200) + 0.5) / 200,) * 2))
    u, v = (1 - np.sqrt(s)).ravel(), (np.sqrt(s) * t).ravel()  # even over the triangle
    points = hot[0] + u[:, None] * (hot[1] - hot[0]) + v[:, None] * (hot[2] - hot[0])
    emitted = band_radiance(edges, at_corners[0] + u * 1200.0 + v * 0.0).sum(axis=1)
    irradiance = 2.0 * np.mean(emitted / np.sum(points**2, axis=1) ** 2)  # area 2 m2; cos cos' / d^2 = 1 / d^4 at z = 1
    vertices, triangles, _, material = join(
        (hot, [(0, 1, 2)], 0, 0), (*quad((0, 0, 0), (0.05, 0, 0), (0, 0.05, 0)), 0, 1)
    )
    kelvin = np.zeros((3, 3))
    kelvin[0] = at_corners
    camera = look((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), 8, 6, 0.02)
    scene = make_scene(vertices, triangles, 0.0, [Material("", 1.0), GREY], camera, edges, material)
    scene = dataclasses.replace(scene, temperature=kelvin.astype(np.float32))
    truth = 0.5 * irradiance / np.pi
    mean, error = mean_and_error(scene, dataclasses.replace(QUICK, passes=64, **settings))
    print(f"{mean / truth - 1:+.2e} +- {error / truth:.1e}")
    assert error < 0.02 * truth
    assert abs(mean - truth) < 4 * error + 0.002 * truth


def test_light_of_a_hundred_thousand_kelvin():
    """Its share of power in the bands is tiny, and right."""
    sun = SunLight(np.array([0.0, 0.0, -1.0]), 1e9, temperature=1e5)
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    scene = make_scene(*floor, 0.0, [GREY], look((0, 0, 1), (0, 0, 0), 8, 6, 0.3), EDGES, lights=(sun,))
    expect(scene, 0.5 * 1e9 / np.pi * light_spectrum(sun, EDGES).sum())


# Surfaces


@pytest.mark.parametrize("specular", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("settings", SUBTRACTION)
def test_perfect_absorber_and_perfect_reflector(specular, settings):
    """Emissivity exactly 1 reflects nothing, exactly 0 emits nothing: a patch of each in a black room at 300 K."""
    walls, walls_triangles = box()
    vertices, triangles, kelvin, material = join(
        (walls, walls_triangles, 300.0, 0),
        (*quad((0.5, 0.5, 0.01), (0.3, 0, 0), (0, 0.3, 0)), 900.0, 1),
    )
    camera = look((0.5, 0.5, 0.5), (0.5, 0.5, 0.0), 8, 6, 0.3)
    materials = [Material("black", 1.0), Material("perfect", 0.0, specular)]
    scene = make_scene(vertices, triangles, kelvin, materials, camera, EDGES, material)
    expect(scene, black(EDGES, 300.0), **settings)
    absorber = dataclasses.replace(scene, materials=(materials[0], Material("black", 1.0, specular)))
    film = checked_render(absorber, dataclasses.replace(QUICK, **settings))
    np.testing.assert_allclose(film.radiance(), black(EDGES, 900.0), rtol=ROUNDING)


@pytest.mark.parametrize(
    "settings",
    [*SUBTRACTION, pytest.param({"reference_temperature": 333.0}, id="wrong-T0")],
)
def test_hundreds_of_bounces(settings):
    """Emissivity 0.008 and 0.004: photons bounce 200 times. E / pi = sum f e B / sum f e in a diffuse sphere."""
    vertices, triangles = sphere(2)
    hot = vertices[triangles].mean(axis=1)[:, 2] > 0.5
    area = areas(vertices[triangles].astype(np.float32))
    share, e_hot, e_cold = area[hot].sum() / area.sum(), 0.008, 0.004
    power = share * e_hot, (1 - share) * e_cold
    incident = (power[0] * black(EDGES, 400.0) + power[1] * black(EDGES, 300.0)) / sum(power)
    materials = [Material("hot", e_hot), Material("cold", e_cold)]
    camera = look((0, 0, 0), (0, 0, -1), 8, 6)
    scene = make_scene(vertices, triangles, np.where(hot, 400, 300), materials, camera, EDGES, np.where(hot, 0, 1))
    truth = e_cold * black(EDGES, 300.0) + (1 - e_cold) * incident
    expect(scene, truth, photons_per_pass=200, **settings)


def one_band(emissivity=0.01):
    """A black room at 300 K, but for the second of four bands."""
    edges = np.array([8.0, 9.0, 10.0, 11.0, 12.0])
    curve = np.array([[9.0, 1.0], [9.0 + 1e-6, emissivity], [10.0 - 1e-6, emissivity], [10.0, 1.0]])
    return room(material=Material("one band", curve), edges=edges)


def test_error_where_one_band_reflects_all():
    """Reflectance 0.95 in one band of four and 0 in the others: passes lie nearer to the truth than with the paper's
    roulette, which survives with the mean reflectance, so that few photons of great weight have to carry the band.
    Those are so rare that the spread of the passes does not show them; hence the root mean square from the truth."""
    scene = one_band(0.05)
    settings = dataclasses.replace(QUICK, photons_per_pass=10_000, reference_subtraction=False)
    truth = black(scene.band_edges, 300.0)
    passes = {
        roulette: pass_means(scene, dataclasses.replace(settings, roulette=roulette)).sum(axis=1) / truth - 1
        for roulette in ("POWER", "BAND_AVERAGE")
    }
    errors = {roulette: np.sqrt(np.mean(values**2)) for roulette, values in passes.items()}
    print(errors)
    assert abs(passes["POWER"].mean()) < 4 * passes["POWER"].std(ddof=1) / np.sqrt(QUICK.passes)
    assert errors["POWER"] < errors["BAND_AVERAGE"]


@pytest.mark.parametrize("roulette, bounded", [("POWER", True), ("BAND_AVERAGE", False)])
def test_weight_of_a_photon_is_bounded(roulette, bounded):
    """The power roulette never lets a photon weigh more over all bands than it left with, but for what the limit of
    the survival adds, 1 / 4096 a bounce; with the paper's its weight quadruples at a bounce, once it is in one band."""
    solver = importlib.import_module("addon.solver.render")
    settings = dataclasses.replace(QUICK, reference_subtraction=False, roulette=roulette)
    model = solver.prepare(one_band(), settings)
    batches = solver.trace_photons(
        model.tracer, model.surfaces, model.radiometry, model.emitters, model.optics, np.uint64(1), 0, 5000, 5000
    )
    weights = [batch.power.sum(axis=1, dtype=float).max() for batch in batches]
    growth = max(weights) / weights[0]
    if bounded:
        assert len(batches) > 100  # they do bounce that often
        assert growth <= (1 + 1e-6) * (1 + 1 / 4095) ** len(batches)
    else:
        assert growth > 2


def test_emissivity_with_a_step_inside_a_band():
    """Emission and the band's one reflectance are means over the same spectrum, so the room is black in each band."""
    curve = np.array([[10.0, 0.2], [10.0 + 1e-9, 1.0]])
    expect_black(room(material=Material("step", curve)))


# Bands


def test_narrow_bands():
    """Relative width 1e-6: their radiance is Planck's law times the width, and images are as clean as those of wide."""
    expect_black(room(edges=10.0 * (1 + 1e-6 * np.arange(4))))


def test_hundreds_of_bands():
    edges = np.linspace(3.0, 14.0, 301)
    curve = np.column_stack((edges, 0.5 + 0.4 * np.sin(20 * edges)))
    expect_black(room(material=Material("comb", curve), edges=edges), settings=dataclasses.replace(QUICK, passes=8))


# Sizes


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_scenes_of_any_size(size):
    expect_black(room(size))


def test_far_from_the_origin():
    """1e6 m away, where float32 resolves 0.06 m."""
    expect_black(room(shift=np.array([1e6, -1e6, 1e6])))


def distant_view(distance, tangent):
    """A black ball of radius 1 m from so many metres away."""
    camera = look(np.array([0.6, 0.64, 0.48]) * distance, (0, 0, 0), 24, 24, tangent / distance)
    return make_scene(*sphere(4), 300.0, [Material("black", 1.0)], camera, EDGES)


@pytest.mark.parametrize("distance", [1e4, 1e6, 1e9])
def test_view_from_far_away(distance):
    """The ball covers pi of 2.4^2 m2; 0.3 %: icosphere of 5120 triangles, 16 passes of 24 x 24 x 16 stratified rays."""
    film = checked_render(distant_view(distance, 1.2), QUICK)
    assert film.radiance().mean(dtype=float) / black(EDGES, 300.0) == pytest.approx(np.pi / 2.4**2, rel=3e-3)


# Meshes


def strips(count):
    """A closed box; the wall at x = 0 consists of so many strips from floor to ceiling, turned askew."""
    vertices, triangles = box()
    others = triangles[~np.all(vertices[triangles][:, :, 0] == 0.0, axis=1)]
    y = np.linspace(0.0, 1.0, count + 1)
    edges = np.concatenate([np.column_stack((0 * y, y, 0 * y + z)) for z in (0, 1)])
    a = np.arange(count)
    low = np.column_stack((a, a + 1, a + count + 2))
    high = np.column_stack((a, a + count + 2, a + count + 1))
    wall = np.concatenate((low, high)) + len(vertices)
    return turned(np.concatenate((vertices, edges))), np.concatenate((others, wall)).astype(np.int32)


def turned(points):
    """Points turned about an axis along no edge (Rodrigues' formula, 1 rad)."""
    axis = np.array([0.36, 0.48, 0.8])
    across = np.cross(axis, points)
    return points + np.sin(1.0) * across + (1 - np.cos(1.0)) * np.cross(axis, across)


def test_walls_of_needles():
    """Strips 1000 times as long as wide: a disk of photons lies over hundreds that reach far beyond it."""
    vertices, triangles = strips(1000)
    camera = look(*turned(np.array([(0.8, 0.6, 0.4), (0.0, 0.3, 0.3)])), 8, 6)
    expect_black(make_scene(vertices, triangles, 300.0, [GREY], camera, EDGES))


def test_cap_of_a_cylinder_as_a_fan():
    """A polygon of 256 corners as Blender may cut it: all triangles meet in one corner, where hundreds cross a disk.

    No pixel is off by more than 5 standard errors. Half of the radiance is reflected, by 50 photons in each of 16
    passes, of which the shrinking radius leaves 0.4 in the last.
    """
    vertices, triangles = cylinder(256, 1.0, 1.0)
    camera = look((0.5, 0, 0.9), (0.5, 0.1, 0.0), 8, 6, 1.0)
    scene = make_scene(vertices, triangles, 300.0, [GREY], camera, EDGES)
    expect_black(scene)
    film = checked_render(scene, dataclasses.replace(QUICK, reference_subtraction=False))
    limit = 5 * 0.5 / np.sqrt(0.4 * 50 * 16)
    np.testing.assert_allclose(film.radiance(), black(EDGES, 300.0), rtol=limit)


def test_long_thin_pipe():
    """2 mm wide and 10 m long, of 32 sides: needles, in a place where a ray must not start far from them.

    Few of the photons come near the camera, so it takes more of them until passes are normally distributed.
    """
    radius, length = 1e-3, 10.0
    vertices, triangles = cylinder(32, radius, length)
    camera = look(*turned(np.array([(0.0, 0.0, 0.5 * length), (0.0, radius, 0.5 * length + radius)])), 8, 6, 1.0)
    scene = make_scene(turned(vertices), triangles, 300.0, [GREY], camera, EDGES)
    expect_black(scene, settings=dataclasses.replace(QUICK, passes=32, photons_per_pass=40_000))


def test_faces_without_area():
    vertices, triangles = box((1.0, 0.8, 0.6))
    none = np.array([(0, 1, 1), (0, 0, 0), (2, 3, 2)], np.int32)
    expect_black(closed(vertices, np.concatenate((triangles, none)), (0.8, 0.6, 0.4)))


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_only_faces_without_area(settings):
    """Nothing to see but the surroundings."""
    scene = closed(box()[0], np.array([(0, 1, 1), (2, 2, 2)], np.int32), (0.8, 0.6, 0.4), world_temperature=250.0)
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    np.testing.assert_allclose(film.radiance(), black(EDGES, 250.0), rtol=ROUNDING)


@pytest.mark.parametrize("flip", [False, True])
def test_faces_that_are_there_twice(flip):
    """A surface that is doubled by mistake emits once."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    again = triangles[:, ::-1] if flip else triangles[:, [1, 2, 0]]
    expect_black(closed(vertices, np.concatenate((triangles, again)).astype(np.int32), (0.8, 0.6, 0.4)))


def test_flipped_normals():
    """Both sides of a face are alike, so its winding has no meaning."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    triangles[::3] = triangles[::3, ::-1]
    expect_black(closed(vertices, triangles, (0.8, 0.6, 0.4)))


@pytest.mark.parametrize(
    "other",
    [
        Material("mirror", 0.5, specular=1.0),
        Material("black", 1.0),
        Material("rough", 0.5, specular=1.0, roughness=0.5),
    ],
    ids=lambda material: material.name,
)
def test_walls_of_which_a_half_stores_no_photons(other):
    """Each wall of a room is half diffuse and half of something that keeps no photons: what the photons of the diffuse
    half are spread over is that half alone, though both lie in one plane. Isothermal, without the subtraction: black.
    3.8 standard errors of 64 passes: one sound engine of 1000 fails in one of the three (Student's t)."""
    camera = look((0.5, 0.5, 0.5), (0.9, 0.6, 0.2), 16, 12, 0.9)
    scene = make_scene(*box(), 300.0, [Material("diffuse", 0.5), other], camera, EDGES, [0, 1] * 6)
    settings = Settings(passes=64, photons_per_pass=2000, reference_subtraction=False)
    mean, error = mean_and_error(scene, settings)
    truth = band_radiance(EDGES, 300.0).sum()
    print(f"{other.name}: {100 * (mean / truth - 1):+.2f} % +- {100 * error / truth:.2f} %")
    assert error < 0.002 * truth and abs(mean - truth) < 3.8 * error


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_coplanar_faces_of_different_materials(settings):
    """A floor of two materials, one plane and one sheet, under an even sky: each has its own radiance."""
    vertices, triangles, kelvin, material = join(
        (*quad((-1, 0, 0), (1, 0, 0), (0, 2, 0)), 300.0, 0), (*quad((1, 0, 0), (1, 0, 0), (0, 2, 0)), 300.0, 1)
    )
    camera = Camera(8, 8, look((0, 0, 1), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-1, 1, -1, 1))
    scene = make_scene(
        vertices, triangles, kelvin, [Material("", 0.8), Material("", 0.3)], camera, EDGES, material,
        world_temperature=250.0,
    )  # fmt: skip
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    left, right = (e * black(EDGES, 300.0) + (1 - e) * black(EDGES, 250.0) for e in (0.8, 0.3))
    # nothing rises above the floor: every ray that looks for the sky finds it
    np.testing.assert_allclose(film.radiance()[:, :4], left, rtol=ROUNDING)
    np.testing.assert_allclose(film.radiance()[:, 4:], right, rtol=ROUNDING)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("hot", [True, False], ids=["hot room", "cold room"])
def test_nothing_leaks_through_a_thin_wall(hot, settings):
    """Two closed rooms at 400 K and 300 K, 0.1 mm apart: each is black at its own temperature."""
    left, right = box(), box()
    vertices, triangles, kelvin, material = join(
        (left[0] - (1.0001, 0, 0), left[1], 400.0, 0), (right[0], right[1], 300.0, 0)
    )
    eye = np.array([-0.8001 if hot else 0.8, 0.6, 0.4])
    camera = look(eye, eye * (0, 1, 1), 8, 6)
    scene = make_scene(vertices, triangles, kelvin, [GREY], camera, EDGES)
    truth = black(EDGES, 400.0 if hot else 300.0)
    expect(scene, truth, **settings)


# Views


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_between_mirrors_that_absorb_little(settings):
    """An endless corridor: eps = 0.001 on both, at one temperature with what closes it at the sides: black."""
    walls, triangles = box((1.0, 1.0, 0.2))
    materials = [Material("mirror", 0.001, specular=1.0), GREY]
    camera = look((0.5, 0.5, 0.1), (0.9, 0.55, 0.12), 8, 6)
    scene = make_scene(walls, triangles, 300.0, materials, camera, EDGES, [1] * 8 + [0] * 4)
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_room_of_mirrors_alone(settings):
    """No diffuse surface at all: no photon can be stored, and camera paths find everything."""
    scene = room(material=Material("mirror", 0.05, specular=1.0))
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("emissivity", [0.0, 0.05])
@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_photons_that_could_never_be_stored_are_not_traced(emissivity, roughness):
    """Between perfect mirrors each would bounce 4096 times for nothing. Rough lobes store those from lights alone."""
    solver = importlib.import_module("addon.solver.render")
    material = Material("mirror", emissivity, 1.0, roughness)
    scene = room(material=material, lights=(PointLight(np.array([0.5, 0.4, 0.3]), 100.0),))
    unlit = dataclasses.replace(scene, lights=())
    settings = dataclasses.replace(QUICK, reference_subtraction=False)
    assert solver.prepare(unlit, settings).photons_per_pass == 0
    assert (solver.prepare(scene, settings).photons_per_pass == 0) == (roughness == 0.0)


def test_one_diffuse_wall_among_perfect_mirrors():
    """It keeps half of what arrives, and all that a lamp sends ends there: 0.5 A E = P on average."""
    power, floor = 1e4, 1.0 * 0.8
    lamp = PointLight(np.array([0.5, 0.4, 0.3]), power)
    matrix = look((0.5, 0.4, 0.5), (0.5, 0.4, 0.0)).matrix
    camera = Camera(10, 8, matrix, "ORTHOGRAPHIC", frame=(-0.5, 0.5, -0.4, 0.4))
    materials = [Material("mirror", 0.0, specular=1.0), GREY]
    wall = [0] * 8 + [1] * 2 + [0] * 2
    scene = make_scene(*box((1.0, 0.8, 0.6)), 0.0, materials, camera, EDGES, wall, lights=(lamp,))
    incident = power * light_spectrum(lamp, EDGES).sum() / (0.5 * floor)
    expect(scene, 0.5 * incident / np.pi, photons_per_pass=1000)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_camera_inside_an_object(settings):
    """A closed ball around the camera hides a room of another temperature."""
    vertices, triangles, kelvin, material = join((*box(), 400.0, 0), (sphere(2, 0.1)[0] + 0.5, sphere(2)[1], 300.0, 0))
    camera = look((0.5, 0.5, 0.5), (1, 1, 1), 8, 6)
    scene = make_scene(vertices, triangles, kelvin, [GREY], camera, EDGES)
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize(
    "place", [(0.0, 0.4, 0.3), (0.0, 0.0, 0.0), (1e-9, 0.4, 0.3)], ids=["wall", "corner", "touching"]
)
def test_camera_on_a_surface(place, settings):
    """Whether it then sees the wall it touches, from which side, or the room, is left open: all of it is between what
    one side emits alone (0.5 of a blackbody; outside is 0 K) and a blackbody, but for noise."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    scene = make_scene(vertices, triangles, 300.0, [GREY], look(place, (0.6, 0.5, 0.3), 8, 6), EDGES)
    mean, error = mean_and_error(scene, dataclasses.replace(QUICK, **settings))
    truth = black(EDGES, 300.0)
    assert 0.5 * truth * (1 - ROUNDING) - 4 * error <= mean <= truth * (1 + ROUNDING) + 4 * error


@pytest.mark.parametrize("specular, roughness", [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)])
@pytest.mark.parametrize("settings", SUBTRACTION)
def test_grazing_views(specular, roughness, settings):
    """A floor seen at 0.06 degrees, under surroundings of its own temperature: black, whatever its lobe."""
    floor = quad((0, 0, 0), (1000, 0, 0), (0, 1000, 0))
    camera = look((-900, 0, 1.0), (100, 0, 0), 8, 2, 0.0005)
    materials = [Material("floor", 0.5, specular, roughness)]
    scene = make_scene(*floor, 300.0, materials, camera, EDGES, world_temperature=300.0)
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("material", [GREY, Material("mirror", 0.5, specular=1.0)], ids=lambda material: material.name)
@pytest.mark.parametrize("world", [0.0, 250.0])
def test_one_triangle_in_an_empty_world(world, material, settings):
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    camera = look((0.2, 0.2, 1), (0.2, 0.2, 0), 8, 6, 0.1)
    triangles = np.array([(0, 1, 2)], np.int32)
    scene = make_scene(corners, triangles, 300.0, [material], camera, EDGES, world_temperature=world)
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    truth = 0.5 * (black(EDGES, 300.0) + black(EDGES, world))
    np.testing.assert_allclose(film.radiance(), truth, rtol=ROUNDING)


# Numbers of photons and passes


@pytest.mark.parametrize("photons", [1, 2, 10])
@pytest.mark.parametrize("settings", SUBTRACTION)
def test_fewer_photons_than_neighbours(photons, settings):
    """All count, over the largest disk, and the mean is still that of many."""
    hot = np.array([300.0] * 10 + [400.0] * 2)
    scene = dataclasses.replace(room(), temperature=hot.astype(np.float32))
    truth, truth_error = mean_and_error(scene, dataclasses.replace(QUICK, photons_per_pass=20_000))
    mean, error = mean_and_error(scene, dataclasses.replace(QUICK, passes=256, photons_per_pass=photons, **settings))
    print(f"{mean / truth - 1:+.2e} +- {np.hypot(error, truth_error) / truth:.1e}")
    assert abs(mean - truth) < 4 * np.hypot(error, truth_error)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_photons_that_reach_nothing(settings):
    """A hot plate that looks away from the one in view: nothing of it arrives."""
    vertices, triangles, kelvin, material = join(
        (*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0.0, 0), (*quad((0, 0, -1), (1, 0, 0), (0, 1, 0)), 900.0, 0)
    )
    camera = look((0, 0, 1), (0, 0, 0), 8, 6, 0.3)
    film = checked_render(
        make_scene(vertices, triangles, kelvin, [GREY], camera, EDGES), dataclasses.replace(QUICK, **settings)
    )
    # with a reference other than 0 K the sky's deficit has to cancel what is seen of it
    np.testing.assert_allclose(film.radiance(), 0.0, atol=ROUNDING * black(EDGES, film.reference_temperature or 300.0))


def test_photons_that_coincide():
    """A spot of light smaller than float32 resolves: all its photons lie at one place, and the image stays finite."""
    lamp = PointLight(np.array([0.0, 0.0, 1e-6]), 1.0)
    mirror = Material("mirror", 0.0, specular=1.0)
    vertices, triangles, kelvin, material = join(
        (*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0.0, 0), (*quad((0, 0, 2e-6), (1e-6, 0, 0), (0, 1e-6, 0)), 0.0, 1)
    )
    camera = look((0, 0, 1), (0, 0, 0), 8, 6, 0.3)
    scene = make_scene(vertices, triangles, kelvin, [GREY, mirror], camera, EDGES, material, lights=(lamp,))
    checked_render(scene, QUICK)


def test_film_of_a_hundred_thousand_passes():
    """Mean and noise do not drift: float64 sums of 1e5 passes err by 1e5 roundings of 1e-16 at most, far below what
    the float32 image resolves. Passes repeat a few random ones, so that the truth is known without a sum as long."""
    rng = np.random.default_rng(5)
    shape, rounds = (50, 6, len(EDGES) - 1), 2000
    some = (30.0 + rng.normal(size=shape)).astype(np.float32)  # about a reference of 290 K
    film = Film(3, 2, EDGES, 290.0)
    nothing = np.zeros(6, np.float32)
    for _ in range(rounds):
        for excess in some:
            film.add_pass(excess, nothing, 1)
    assert film.passes == 100_000
    total = some.sum(axis=2, dtype=np.float64)
    mean = total.mean(axis=0) + black(EDGES, 290.0)
    error = total.std(axis=0) / np.sqrt(film.passes - 1)
    half = apparent_temperature(mean + error, EDGES) - apparent_temperature(mean - error, EDGES)
    rounding = np.finfo(np.float32).eps
    np.testing.assert_allclose(film.radiance().ravel(), mean, rtol=rounding)
    np.testing.assert_allclose(film.temperature().ravel(), apparent_temperature(mean, EDGES), rtol=rounding)
    np.testing.assert_allclose(film.noise().ravel(), 0.5 * half, rtol=1e-5)  # difference of near temperatures
