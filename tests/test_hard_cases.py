# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases at the edge of what can be rendered: extreme temperatures, surfaces, bands, sizes, meshes, views and numbers.

Every image of every render here must be finite, in each case. Most scenes are closed rooms at one temperature, which
are black at it whatever they look like (Kirchhoff). With the right reference that is exact by construction, so the
cases are also rendered without the subtraction, and from a wrong reference.

Statistical tests ask for 3 standard errors, of the spread of the passes and with the quantile of Student's t for their
number: a sound engine misses that in one of 370 comparisons. What misses is rendered again, with another seed and four
times the passes: only one of 137,000 misses twice, and there are some ninety here.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from addon.solver import (
    Camera,
    Film,
    Material,
    PointLight,
    SceneError,
    Settings,
    SpotLight,
    SunLight,
    render,
)
from addon.solver.geometry.triangles import CLEAR, Corners, areas
from addon.solver.photons.lights import light_spectrum
from addon.solver.physics.spectrum import apparent_temperature, band_radiance
from addon.solver.planning import preparation
from addon.solver.planning.preparation import prepare
from tests.helpers import scenes
from tests.helpers.marks import long
from tests.helpers.scenes import box, cylinder, join, look, make_scene, pass_means, quad, sphere, stored_photons

pytestmark = pytest.mark.once

EDGES = np.array([8.0, 9.0, 12.0])
QUICK = Settings(passes=16, photons_per_pass=5000)
GREY = Material("grey", 0.5)
EYE, TARGET = np.array([0.8, 0.6, 0.4]), np.array([0.1, 0.1, 0.1])  # m, of the camera in a box of 1 x 0.8 x 0.6
SUBTRACTION = [
    pytest.param({}, id="subtraction"),
    pytest.param({"reference_subtraction": False}, id="no-subtraction"),
]
# Where a case takes long: without the subtraction estimates are noisier, and as right.
BRIEFLY = [SUBTRACTION[0], long(*SUBTRACTION[1].values, id=SUBTRACTION[1].id)]
WRONG = long({"reference_temperature": 333.0}, id="wrong-T0")
# Under a sky of 0 K the solver may choose 0 K, which traces the same as without the subtraction: a given one does not
WARM = pytest.param({"reference_temperature": 300.0}, id="T0=300")
ROUNDING = 5e-7  # of images: float32 keeps 6e-8, and differences to a reference a few of that
SUMMED = 512 * 2.0**-24  # of a pixel: at most so many rays, each alike and rounded alike in the sum
CHANCE = 2 * stats.norm.sf(3.0)  # of more than 3 standard errors


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
    camera = look(EYE * size + shift, TARGET * size + shift, 8, 6)
    return make_scene(vertices * size + shift, triangles, kelvin, [material], camera, edges, **options)


def closed(vertices, triangles, **options):
    """A grey surface at 300 K that closes the box of `room`, seen from inside, a few pixels wide."""
    return make_scene(vertices, triangles, 300.0, [GREY], look(EYE, TARGET, 8, 6), EDGES, **options)


def expect(scene, truth, settings=QUICK, precision=0.005, allowance=ROUNDING, **change):
    """The mean of the image is the truth (W m-2 sr-1, over all bands or in each) within 3 standard errors, see above.

    precision: relative standard error that it must have, as a larger one would say little. allowance: relative
    deviation that is not noise.
    """
    settings, truth = dataclasses.replace(settings, **change), np.asarray(truth)
    for again in (0, 1):
        run = dataclasses.replace(settings, seed=settings.seed + again, passes=4**again * settings.passes)
        passes = pass_means(scene, run) if truth.ndim else pass_means(scene, run).sum(axis=1)
        deviation = passes.mean(axis=0) / truth - 1.0
        error = passes.std(axis=0, ddof=1) / math.sqrt(run.passes) / truth
        print(f"deviation {deviation}, standard error {error}")
        assert np.all(error < precision)
        level = stats.t.isf(CHANCE / 2 / deviation.size, run.passes - 1)
        if np.all(np.abs(deviation) <= level * error + allowance):
            return
    pytest.fail(f"deviation {deviation}, standard error {error}, and beyond chance before")


def expect_black(scene, kelvin=300.0, settings=QUICK, precision=0.005):
    """Black at its temperature in every band: each pixel with the subtraction, the mean without it or from another."""
    truth = band_radiance(scene.band_edges, kelvin)
    film = checked_render(scene, dataclasses.replace(settings, passes=2))
    pixels = film.bands() * np.diff(scene.band_edges)[:, None, None]
    np.testing.assert_allclose(pixels, np.broadcast_to(truth[:, None, None], pixels.shape), rtol=ROUNDING)
    assert np.all(film.noise() == 0)
    expect(scene, truth, settings, precision, reference_subtraction=False)
    expect(scene, truth, settings, precision, reference_temperature=1.05 * kelvin)


def expect_black_in_all(scene, settings):
    """Black at 300 K over all bands together, known better than each: without the subtraction, or a wrong T0."""
    for change in ({"reference_subtraction": False}, {"reference_temperature": 315.0}):
        expect(scene, black(scene.band_edges, 300.0), settings, **change)


# Temperatures


@pytest.mark.parametrize("kelvin", [40.0, 3000.0, 1e5, 1e6])
def test_rooms_of_any_temperature_are_black(kelvin):
    """At 40 K bands at 10 um hold 1e-12 of what they hold at 300 K, and 42 K, the wrong reference, is 6 times that."""
    expect_black(room(kelvin=kelvin), kelvin, precision=0.01)


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
    expect(scene, 0.5 * black(edges, 3.0), allowance=SUMMED, **settings)


FAR = np.array([500.0, 1000.0, 2000.0])  # um: around the peak of the spectrum of 3 K (1 mm)


def test_walls_of_three_kelvin_are_black():
    """They emit all there is to see, and rays and photons carry it as they do at 300 K."""
    expect_black(room(kelvin=3.0, edges=FAR), 3.0)


@pytest.mark.parametrize("settings", [*BRIEFLY, pytest.param({"reference_temperature": 200.0}, id="T0=200")])
@pytest.mark.parametrize("edges", [long(EDGES), FAR], ids=["8-12 um", "0.5-2 mm"])
@pytest.mark.parametrize("hot, cold", [(300.0, 3.0), long(3.0, 300.0)])
def test_three_kelvin_beside_300(hot, cold, edges, settings):
    """Two parts of a diffuse ball (see diffuse_sphere): what is at 3 K reflects the other, and takes from it as much as
    it must. In 8-12 um it emits less than the smallest float32, in 0.5-2 mm up to a thousandth of the other.

    1 %: what 300 K has above 200 K there is a half of what 3 K lacks, so that photons of both signs make the picture.
    """
    scene, truth = diffuse_sphere(0.4, 0.6, kelvin=(hot, cold), edges=edges)
    expect(scene, truth, precision=0.01, passes=128, **settings)


FILAMENT = np.array([3.0, 3.01, 5.0])  # um: in the first band 3000 K is 2.2e6 times as bright as 300 K, in both 6e4


@pytest.mark.parametrize("settings", BRIEFLY)
def test_filament_beside_walls(settings):
    """A sphere at 3000 K in one at 300 K: concentric diffuse spheres have a closed form.

    J1 = e1 B1 + (1 - e1) J2 on the inner sphere, which sees the outer one alone; that one sees the inner one by the
    share f = A1 / A2, and itself: J2 = e2 B2 + (1 - e2) (f J1 + (1 - f) J2) (Modest, Radiative Heat Transfer, chapter
    5). The camera looks from near the inner sphere at the outer one. The inner one is a lamp in the middle of the
    scene, where shadow rays are long against its coordinates. f is that of the meshes' areas; 0.3 %: their facets.
    """
    inner, outer = sphere(3, 0.1), sphere(4, 1.0)
    e1, e2, b1, b2 = 0.4, 0.8, band_radiance(FILAMENT, 3000.0), band_radiance(FILAMENT, 300.0)
    f = np.divide(*(areas(Corners(points, corners.astype(np.int32))).sum() for points, corners in (inner, outer)))
    equations = [[1.0, e1 - 1.0], [(e2 - 1.0) * f, 1.0 - (1.0 - e2) * (1.0 - f)]]
    j2 = np.linalg.solve(equations, [e1 * b1, e2 * b2])[1]
    vertices, triangles, kelvin, material = join((*inner, 3000.0, 0), (*outer, 300.0, 1))
    camera = look((0.0, 0.0, 0.3), (0.0, 0.0, 1.0), 8, 6, 0.5)
    scene = make_scene(vertices, triangles, kelvin, [Material("", e1), Material("", e2)], camera, FILAMENT, material)
    expect(scene, j2, allowance=0.003, passes=64, **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_filament_and_walls_in_one_picture(settings):
    """1.7e6 between the brightest and the darkest pixel of a band, and both ends are right.

    A screen hides a filament from a plate that reflects half. The room and the screen are black and at 300 K, so the
    plate is, too: if a millionth of the filament's light came through, it would look twice as bright. The filament
    reflects 300 K alone.
    """
    ball, triangles = sphere(2, 0.1)
    *mesh, material = join(
        (*box((2.0, 1.0, 1.0)), 300.0, 0),
        (ball + (0.5, 0.5, 0.5), triangles, 3000.0, 1),
        (*quad((1.0, 0.5, 0.35), (0, 0.5, 0), (0, 0, 0.35)), 300.0, 0),
        (*quad((1.5, 0.5, 0.1), (0.3, 0, 0), (0, 0.3, 0)), 300.0, 2),
    )
    materials = [Material("black", 1.0), Material("filament", 0.8), Material("plate", 0.5)]
    camera = look((1.0, 0.5, 0.95), (1.0, 0.5, 0.0), 48, 12, 1.2)
    scene = make_scene(*mesh, materials, camera, FILAMENT, material)
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    pixels = film.bands() * np.diff(FILAMENT)[:, None, None]
    b1, b2 = band_radiance(FILAMENT, 3000.0), band_radiance(FILAMENT, 300.0)
    filament = 0.8 * b1 + 0.2 * b2
    assert filament[0] / b2[0] > 1e6
    beside = np.broadcast_to(b2[:, None, None], pixels[:, :, 25:].shape)  # the screen's edge is in the middle
    # single shadow rays to the walls find a small share of their light, so that there is a little noise, too: all of
    # the light is that of 300 K, so the noise of all bands, of which the second is nearly all, is that of each
    deviation = pixels[:, :, 25:] / beside - 1.0
    film.estimated[:] = False  # each pixel tells its own noise: some are beside the filament's edge
    error = film.noise()[:, 25:] * (band_radiance(FILAMENT, 301.0)[1] / b2[1] - 1.0)  # relative
    # known to a twentieth of what a millionth of the filament would add
    assert np.all(error < 0.05) and np.all(np.abs(deviation) < 1e-4 + 6.0 * error)
    assert np.all(np.abs(deviation.mean(axis=(1, 2))) < 1e-4)
    inside = pixels[0] > 0.999 * filament[0]
    assert np.count_nonzero(inside) >= 4
    np.testing.assert_allclose(pixels[:, inside], np.broadcast_to(filament[:, None], (2, inside.sum())), rtol=SUMMED)


@pytest.mark.parametrize("settings", [*SUBTRACTION, WARM])
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
    expect(scene, 0.5 * irradiance / np.pi, allowance=0.002, passes=64, precision=0.02, **settings)


def test_light_of_a_hundred_thousand_kelvin():
    """Its share of power in the bands is tiny, and right."""
    sun = SunLight(np.array([0.0, 0.0, -1.0]), 1e9, temperature=1e5)
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    scene = make_scene(*floor, 0.0, [GREY], look((0, 0, 1), (0, 0, 0), 8, 6, 0.3), EDGES, lights=(sun,))
    expect(scene, 0.5 * 1e9 / np.pi * light_spectrum(sun, EDGES).sum())


def test_light_of_nearly_no_temperature():
    """In the bands it sends nothing, as one of 0 K does: the picture is that, to the last bit."""
    images = []
    for kelvin in (0.0, 5e-324):
        scene = furnished()
        lamp = dataclasses.replace(scene.lights[0], temperature=kelvin)
        film = checked_render(dataclasses.replace(scene, lights=(lamp,)), dataclasses.replace(QUICK, passes=2))
        images.append(film.bands())
    assert np.array_equal(*images)


# Surfaces


@pytest.mark.parametrize("specular", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("settings", SUBTRACTION)
def test_perfect_absorber_and_perfect_reflector(specular, settings):
    """Emissivity exactly 1 reflects nothing, exactly 0 emits nothing: a patch of each in a black room at 300 K.

    Where shadow rays are worth little all rays bring the same, and are rounded alike in the sum.
    """
    walls, walls_triangles = box()
    vertices, triangles, kelvin, material = join(
        (walls, walls_triangles, 300.0, 0),
        (*quad((0.5, 0.5, 0.01), (0.3, 0, 0), (0, 0.3, 0)), 900.0, 1),
    )
    camera = look((0.5, 0.5, 0.5), (0.5, 0.5, 0.0), 8, 6, 0.3)
    materials = [Material("black", 1.0), Material("perfect", 0.0, specular)]
    scene = make_scene(vertices, triangles, kelvin, materials, camera, EDGES, material)
    expect(scene, black(EDGES, 300.0), allowance=SUMMED, **settings)
    absorber = dataclasses.replace(scene, materials=(materials[0], Material("black", 1.0, specular)))
    film = checked_render(absorber, dataclasses.replace(QUICK, **settings))
    np.testing.assert_allclose(film.radiance(), black(EDGES, 900.0), rtol=ROUNDING)


@pytest.mark.parametrize("specular", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("settings", [*SUBTRACTION, WRONG])
def test_perfect_reflector_lights_nothing(specular, settings):
    """A patch at 900 K of emissivity exactly 0, beside a grey wall in a room at 300 K: the wall is black at 300 K.

    With an emissivity of 0.5 the patch would light it by more than a half of that: so the test would see it. Where the
    patch is a mirror nothing is random, and what is left is the rounding of sums over rays (see `SUMMED`).
    """
    patch = quad((0.5, 0.5, 0.01), (0.3, 0, 0), (0, 0.3, 0))
    *mesh, material = join((*box(), 300.0, 0), (*patch, 900.0, 1))
    material[:2] = 2  # the wall at x = 0
    camera = look((0.8, 0.5, 0.3), (0.0, 0.5, 0.3), 8, 6, 0.3)
    materials = [Material("black", 1.0), Material("perfect", 0.0, specular), GREY]
    scene = make_scene(*mesh, materials, camera, EDGES, material)
    truth = band_radiance(EDGES, 300.0)
    expect(scene, truth, allowance=SUMMED, **settings)
    lit = dataclasses.replace(scene, materials=(materials[0], Material("hot", 0.5, specular), GREY))
    assert pass_means(lit, dataclasses.replace(QUICK, passes=2, **settings)).mean(axis=0).sum() > 1.5 * truth.sum()


def diffuse_sphere(e_hot, e_cold, subdivisions=2, kelvin=(400.0, 300.0), edges=EDGES):
    """The cold part of a ball from its inside, hot above: the scene, and its radiance in each band, W m-2 sr-1.

    E / pi = sum f e B / sum f e everywhere, f the shares of the mesh's area (Modest, chapter 5).
    """
    vertices, triangles = sphere(subdivisions)
    hot = vertices[triangles].mean(axis=1)[:, 2] > 0.5
    area = areas(Corners(vertices, triangles.astype(np.int32)))
    share = area[hot].sum() / area.sum()
    power = share * e_hot, (1 - share) * e_cold
    above, below = (band_radiance(edges, each) for each in kelvin)
    incident = (power[0] * above + power[1] * below) / sum(power)
    materials = [Material("hot", e_hot), Material("cold", e_cold)]
    camera = look((0, 0, 0), (0, 0, -1), 8, 6)
    scene = make_scene(vertices, triangles, np.where(hot, *kelvin), materials, camera, edges, np.where(hot, 0, 1))
    return scene, e_cold * below + (1 - e_cold) * incident


@pytest.mark.parametrize("settings", [*BRIEFLY, WRONG])
def test_a_thousand_bounces(settings, monkeypatch):
    """Emissivity 0.001: a share of 1e-4 that got lost at each bounce would be 10 % of the image.

    4 %: one photon's time in the ball varies as much as its mean, so 1200 of them err by 3 %.
    """
    monkeypatch.setattr(
        preparation, "_PLAN_PHOTONS", 512
    )  # 8192 that plan the render would take longer than the passes
    scene, truth = diffuse_sphere(0.001, 0.001, 1)
    expect(scene, truth, precision=0.04, passes=16, photons_per_pass=150, **settings)


def test_photons_of_a_thousand_bounces_end(monkeypatch):
    """How often a photon is reflected is a geometric variable: 1 / eps on average and nearly as much in its spread.

    So all hits together are known within 3 standard errors, and the last of the photons ends after
    ln(photons / chance) / eps bounces at the latest, but for that chance.

    What is not chance is exact. No ray of a million that leaves a hit misses the ball, so less than 3e-6 is lost at a
    bounce (rule of three). And as walls are grey, survival is their reflectance and no photon's power ever changes.
    Each bounce rounds it to float32 (6e-8 for each of two factors), at random: 7000 of them, as many as the longest way
    has, are off by sqrt(7000) of that, 1e-5. Some photons leave the outside, and are gone at once.
    """
    monkeypatch.setattr(preparation, "_PLAN_PHOTONS", 512)
    emissivity, count = 0.001, 1100
    scene, _ = diffuse_sphere(emissivity, emissivity, 1)
    model = prepare(scene, dataclasses.replace(QUICK, reference_subtraction=False))
    emitted, drifts, met, missed = [], [], [], []

    def on_hits(hits, wave):
        alive = len(hits.triangle)
        if not emitted:
            emitted.append(wave.power.copy())
        relative = wave.power[:alive] / emitted[0][wave.photon[:alive]] - 1.0
        drifts.append(float(np.abs(relative).max()))
        met.append(np.count_nonzero(hits.triangle >= 0))
        missed.append(alive - met[-1])

    stored = sum(len(batch.surface) for batch in stored_photons(model, count, on_hits=on_hits))
    count = met[0]  # that start inside
    error = math.sqrt((1.0 - emissivity) / count)  # relative
    print(f"{sum(met) / count:.0f} bounces +- {error:.1%}, {len(met)} at most, power drifts by {max(drifts):.1e}")
    assert np.all(emitted[0] > 0)
    assert sum(missed[1:]) == 0 and sum(met) > 1_000_000
    assert sum(met) - count <= stored <= sum(met)  # shadow rays find a share of what photons bring to their first hits
    assert max(drifts) < 1e-4
    assert abs(sum(met) * emissivity / count - 1.0) < 3 * error
    assert len(met) < math.log(count / 1e-9) / emissivity


def one_band():
    """A room that is black, but for the second of four bands, in which it reflects all; and a small black plate."""
    edges = np.array([8.0, 9.0, 10.0, 11.0, 12.0])
    curve = np.array([[9.0 - 1e-6, 1.0], [9.0, 0.0], [10.0, 0.0], [10.0 + 1e-6, 1.0]])
    *mesh, material = join(
        (*box((1.0, 0.8, 0.6)), 300.0, 0), (*quad((0.5, 0.4, 0.3), (0.15, 0, 0), (0, 0.15, 0)), 300.0, 1)
    )
    camera = look((0.8, 0.6, 0.4), (0.1, 0.1, 0.1), 8, 6)
    return make_scene(*mesh, [Material("one band", curve), Material("black", 1.0)], camera, edges, material)


@pytest.mark.parametrize("settings", [SUBTRACTION[1], WRONG])
def test_error_where_one_band_reflects_all(settings):
    """Reflectance 1 in one band of four and 0 in the others. All at one temperature, so the band is black as others
    are, but all of its light comes from the plate, after twenty bounces on average (areas 3.76 and 0.18 m2).

    The paper's roulette survives with the mean reflectance, 1 / 4: after five bounces a thousandth of the photons is
    left to carry the band, so a pass holds less than a half of it, or far too much. With that of the power, passes lie
    nearer to the truth by a factor of 8 (root mean square); 4: each is known to 1 / sqrt(2 * 16), 18 %, and 3 standard
    errors of the factor's logarithm are as much.
    """
    scene = one_band()
    settings = dataclasses.replace(QUICK, photons_per_pass=20_000, **settings)
    truth = band_radiance(scene.band_edges, 300.0)
    errors = {}
    for roulette in ("POWER", "BAND_AVERAGE"):
        passes = pass_means(scene, dataclasses.replace(settings, roulette=roulette))
        errors[roulette] = np.sqrt(np.mean((passes[:, 1] / truth[1] - 1.0) ** 2))
    print(errors)
    assert 4 * errors["POWER"] < errors["BAND_AVERAGE"]
    expect(scene, truth.sum(), settings)


@pytest.mark.parametrize("settings", [SUBTRACTION[1], WRONG])
@pytest.mark.parametrize("roulette, bounded", [("POWER", True), ("BAND_AVERAGE", False)])
def test_weight_of_a_photon_is_bounded(roulette, bounded, settings):
    """The power roulette never lets a photon weigh more over all bands than it left with, but for what the limit of
    the survival adds, 1 / 4096 a bounce; with the paper's its weight quadruples at a bounce, once it is in one band."""
    model = prepare(one_band(), dataclasses.replace(QUICK, roulette=roulette, **settings))
    weights = []  # of photons, by number, as they leave, and later the growth of each that is left

    def on_hits(hits, wave):
        alive = len(hits.triangle)
        weight = np.abs(wave.power[:alive].sum(axis=1, dtype=float))
        weights.append(weight / weights[0][wave.photon[:alive]] if weights else weight)

    stored_photons(model, 20_000, on_hits=on_hits)
    growth = max(each.max() for each in weights[1:])
    print(f"{growth:.3g} times the weight within {len(weights)} bounces")
    if bounded:
        assert len(weights) > 100  # they do bounce that often
        assert growth <= (1 + 1e-6) * (1 + 1 / 4095) ** len(weights)
    else:
        assert growth > 2


@pytest.mark.parametrize("specular", [0.0, 0.5])
@pytest.mark.parametrize("settings", [*SUBTRACTION, WRONG])
def test_room_in_which_nothing_absorbs(specular, settings):
    """Emissivity 0 everywhere: walls emit nothing, so any radiance of the room would stay as it is, and the equations
    leave it open. It is that of the reference: of the room's temperature, which is what a room of ever less emissivity
    tends to, of a given one, and of none without the subtraction."""
    scene = room(material=Material("perfect", 0.0, specular))
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    kelvin = {"reference_subtraction": 0.0, "reference_temperature": 333.0}.get(*settings, 300.0) if settings else 300.0
    assert film.reference_temperature == kelvin
    np.testing.assert_allclose(film.radiance(), black(EDGES, kelvin), rtol=ROUNDING)
    assert np.all(film.noise() == 0)


@pytest.mark.parametrize("settings", BRIEFLY)
@pytest.mark.parametrize("specular", [long(0.0), 1.0])
def test_room_in_which_nothing_absorbs_ends(specular, settings, monkeypatch):
    """With a lamp there is no steady state at all; between mirrors alone a camera path meets nothing that ends it. Both
    end by roulette, after 4096 bounces on average, and leave an image of finite numbers."""
    monkeypatch.setattr(preparation, "_PLAN_PHOTONS", 64)
    scene = room(material=Material("perfect", 0.0, specular), lights=(PointLight(np.array([0.5, 0.4, 0.3]), 100.0),))
    scene = dataclasses.replace(scene, camera=look((0.8, 0.6, 0.4), (0.1, 0.1, 0.1), 2, 1))
    checked_render(scene, dataclasses.replace(QUICK, passes=2, photons_per_pass=20, **settings))


def test_emissivity_with_a_step_inside_a_band():
    """Emission and the band's one reflectance are means over the same spectrum, so the room is black in each band."""
    curve = np.array([[10.0, 0.2], [10.0 + 1e-9, 1.0]])
    scene = room(material=Material("step", curve))
    # 2 %: what a band reflects is noisier than what it emits, and the first reflects four fifths
    expect_black(scene, precision=0.02)
    expect_black_in_all(scene, QUICK)


# Bands


def test_narrow_bands():
    """Relative width 1e-6: their radiance is Planck's law times the width, and images are as clean as those of wide."""
    expect_black(room(edges=10.0 * (1 + 1e-6 * np.arange(4))))


def test_hundreds_of_bands():
    """Each is black, so that none takes what is another's. Up to nine tenths of a band are reflected: 3 %."""
    edges = np.linspace(3.0, 14.0, 301)
    curve = np.column_stack((edges, 0.5 + 0.4 * np.sin(20 * edges)))
    scene, quick = room(material=Material("comb", curve), edges=edges), dataclasses.replace(QUICK, passes=8)
    expect_black(scene, settings=quick, precision=0.03)
    expect_black_in_all(scene, quick)


# Sizes


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_scenes_of_any_size(size):
    expect_black(room(size))


def test_far_from_the_origin():
    """1e6 m away, where float32 resolves 0.06 m."""
    expect_black(room(shift=np.array([1e6, -1e6, 1e6])))


def furnished(size=1.0, shift=0.0, count=0):
    """A room with a warm floor, a hot plate, a mirror ball and a lamp, times a size and moved.

    count: of strips that its wall at x = 0 consists of, if any.
    """
    ball, triangles = sphere(2, 0.12)
    walls = in_strips(*box((1.0, 0.8, 0.6)), count) if count else box((1.0, 0.8, 0.6))
    *mesh, material = join(
        (*walls, 300.0, 0),
        (ball + (0.3, 0.35, 0.2), triangles, 300.0, 1),
        (*quad((0.6, 0.4, 0.05), (0.1, 0, 0), (0, 0.1, 0)), 400.0, 0),
    )
    vertices, triangles, kelvin = mesh
    kelvin[np.all(vertices[triangles][:, :, 2] == 0.0, axis=1)] = 330.0  # the floor
    lamp = PointLight(np.array([0.7, 0.5, 0.45]) * size + shift, 30.0 * size**2, 0.02 * size)
    camera = look(np.array([0.8, 0.6, 0.4]) * size + shift, np.array([0.1, 0.1, 0.1]) * size + shift, 8, 6)
    materials = [Material("paint", 0.7), Material("mirror", 0.1, specular=1.0)]
    return make_scene(vertices * size + shift, triangles, kelvin, materials, camera, EDGES, material, lights=(lamp,))


@pytest.mark.parametrize("distance", [2e4, 1e6])
def test_one_thing_far_away_changes_nothing(distance):
    """Coordinates count from where most of the scene is, so that float32 resolves what is there. Differences of pixels
    over their stated errors, with 2 mK in quadrature: about 1, or less as both renders have one seed, and none beyond
    5."""
    near = furnished()
    plate, triangles = quad((distance, 0, 0), (1, 0, 0), (0, 1, 0))
    both = dataclasses.replace(
        near,
        vertices=np.concatenate((near.vertices, plate)),
        triangles=np.concatenate((near.triangles, triangles + len(near.vertices))).astype(np.int32),
        temperature=np.append(near.temperature, [300.0, 300.0]).astype(np.float32),
        material=np.append(near.material, [0, 0]).astype(np.int32),
    )
    one, other = (render(scene, QUICK) for scene in (near, both))
    stated = np.sqrt(one.noise() ** 2 + other.noise() ** 2 + 0.002**2)
    ratio = np.abs(one.temperature() - other.temperature()) / stated
    print(np.sqrt(np.mean(ratio**2)), ratio.max())
    assert np.sqrt(np.mean(ratio**2)) < 1.2 and ratio.max() < 5.0


@pytest.mark.parametrize("size", [2.0**-20, 2.0**20])
def test_size_of_a_furnished_room(size):
    """Radiance does not depend on size, if lamps grow as areas do. Powers of two scale float numbers exactly, so every
    bit stays."""
    settings = dataclasses.replace(QUICK, passes=2)
    film, scaled = (checked_render(furnished(factor), settings) for factor in (1.0, size))
    assert np.array_equal(film.bands(), scaled.bands()) and np.array_equal(film.noise(), scaled.noise())


@pytest.mark.parametrize(
    "moved", [(1e-6, 0.0), (1e6, 0.0), (1.0, np.array([1e6, -1e6, 1e6]))], ids=["1e-6", "1e6", "far"]
)
def test_size_and_position_of_a_furnished_room(moved):
    """Other sizes, and 1e6 m from the origin: coordinates are rounded otherwise. Passes share their random numbers with
    those of the room as it is, so it is the spread of the differences that counts; most of them are rounding."""
    passes, other = (
        pass_means(scene, dataclasses.replace(QUICK, passes=40)) for scene in (furnished(), furnished(*moved))
    )
    difference = (other - passes).sum(axis=1) / passes.sum(axis=1).mean()
    error = difference.std(ddof=1) / math.sqrt(len(difference))
    print(f"difference {difference.mean():+.1e} +- {error:.1e}")
    assert error < 1e-5
    assert abs(difference.mean()) <= stats.t.isf(CHANCE / 2, len(difference) - 1) * error + ROUNDING


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


def in_strips(vertices, triangles, count):
    """A box from the origin whose wall at x = 0 consists of so many strips from floor to ceiling."""
    others = triangles[~np.all(vertices[triangles][:, :, 0] == 0.0, axis=1)]
    y = np.linspace(0.0, vertices[:, 1].max(), count + 1)
    edges = np.concatenate([np.column_stack((0 * y, y, 0 * y + z)) for z in (0, vertices[:, 2].max())])
    a = np.arange(count)
    low = np.column_stack((a, a + 1, a + count + 2))
    high = np.column_stack((a, a + count + 2, a + count + 1))
    wall = np.concatenate((low, high)) + len(vertices)
    return np.concatenate((vertices, edges)), np.concatenate((others, wall)).astype(np.int32)


def turned(points):
    """Points turned about an axis along no edge (Rodrigues' formula, 1 rad)."""
    axis = np.array([0.36, 0.48, 0.8])
    across = np.cross(axis, points)
    return points + np.sin(1.0) * across + (1 - np.cos(1.0)) * np.cross(axis, across)


def test_walls_of_needles():
    """Strips 1000 times as long as wide: a disk of photons lies over hundreds that reach far beyond it."""
    vertices, triangles = in_strips(*box(), 1000)
    vertices = turned(vertices)
    camera = look(*turned(np.array([(0.8, 0.6, 0.4), (0.0, 0.3, 0.3)])), 8, 6)
    expect_black(make_scene(vertices, triangles, 300.0, [GREY], camera, EDGES))


@pytest.mark.parametrize("settings", [*BRIEFLY, WRONG])
def test_wall_of_needles_in_a_furnished_room(settings):
    """A wall in 1000 strips looks as it does in one piece where light differs from place to place, so that photons of
    another strip in the place of one's own would be seen: every sixth of the picture, and all of it, within the noise.

    The picture is that wall: from where the camera is, its lower left has most of the floor's light.
    """
    camera = look((0.7, 0.4, 0.3), (0.0, 0.4, 0.3), 12, 8, 0.55)
    settings = dataclasses.replace(QUICK, passes=12, **settings)

    def sixths(count):
        """(passes, 7) the mean radiance of each part of the picture, and of all, in each pass."""
        sums = [np.zeros((8, 12))]
        scene = dataclasses.replace(furnished(count=count), camera=camera)
        checked_render(scene, settings, lambda film: sums.append(film.passes * film.radiance().astype(float)))
        images = np.diff(sums, axis=0).reshape(-1, 2, 4, 3, 4).mean(axis=(2, 4)).reshape(-1, 6)
        return np.column_stack((images, images.mean(axis=1)))

    plain, cut = sixths(0), sixths(1000)
    deviation = cut.mean(axis=0) / plain.mean(axis=0) - 1.0
    error = np.hypot(*(stats.sem(each, axis=0) / each.mean(axis=0) for each in (plain, cut)))
    print(f"deviation {deviation}, standard error {error}")
    assert np.ptp(plain.mean(axis=0)) > 0.02 * plain.mean()  # there is a pattern to see
    assert error[-1] < 0.003 and np.all(error < 0.01)
    level = stats.t.isf(CHANCE / 2 / len(deviation), settings.passes - 1)
    assert np.all(np.abs(deviation) <= level * error + ROUNDING)


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


@pytest.mark.long
def test_long_thin_pipe():
    """2 mm wide and 10 m long, of 32 sides: needles, in a place where a ray must not start far from them.

    Few of the photons come near the camera, so it takes more of them until passes are normally distributed.
    """
    radius, length = 1e-3, 10.0
    vertices, triangles = cylinder(32, radius, length)
    camera = look(*turned(np.array([(0.0, 0.0, 0.5 * length), (0.0, radius, 0.5 * length + radius)])), 8, 6, 1.0)
    scene = make_scene(turned(vertices), triangles, 300.0, [GREY], camera, EDGES)
    expect_black(scene, settings=dataclasses.replace(QUICK, passes=32, photons_per_pass=40_000), precision=0.01)


def test_faces_without_area():
    vertices, triangles = box((1.0, 0.8, 0.6))
    none = np.array([(0, 1, 1), (0, 0, 0), (2, 3, 2)], np.int32)
    expect_black(closed(vertices, np.concatenate((triangles, none))))


def test_only_faces_without_area():
    """Nothing to see is a clear error, not an image of the surroundings."""
    scene = closed(box()[0], np.array([(0, 1, 1), (2, 2, 2)], np.int32), world_temperature=250.0)
    with pytest.raises(SceneError, match="No triangle of the scene has an area"):
        render(scene, QUICK)


@pytest.mark.parametrize("flip", [False, True])
def test_faces_that_are_there_twice(flip):
    """A surface that is doubled by mistake emits once."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    again = triangles[:, ::-1] if flip else triangles[:, [1, 2, 0]]
    expect_black(closed(vertices, np.concatenate((triangles, again)).astype(np.int32)))


def test_flipped_normals():
    """Both sides of a face are alike, so its winding has no meaning."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    triangles[::3] = triangles[::3, ::-1]
    expect_black(closed(vertices, triangles))


@pytest.mark.parametrize(
    "other",
    [
        Material("mirror", 0.5, specular=1.0),
        long(Material("black", 1.0)),
        long(Material("rough", 0.5, specular=1.0, roughness=0.5)),
    ],
    ids=lambda material: material.name,
)
def test_walls_of_which_a_half_stores_no_photons(other):
    """Each wall of a room is half diffuse and half of something that keeps no photons: what the photons of the diffuse
    half are spread over is that half alone, though both lie in one plane. At one temperature: black."""
    camera = look((0.5, 0.5, 0.5), (0.9, 0.6, 0.2), 16, 12, 0.9)
    scene = make_scene(*box(), 300.0, [Material("diffuse", 0.5), other], camera, EDGES, [0, 1] * 6)
    settings = Settings(passes=64, photons_per_pass=2000, reference_subtraction=False)
    expect(scene, black(EDGES, 300.0), settings, precision=0.002)


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
    # without subtraction a third of this is a sum over rays that round alike, which costs 5.1e-7
    np.testing.assert_allclose(film.radiance()[:, 4:], right, rtol=1.2 * ROUNDING)


def doubled(kind, corners, half_u, half_v, centre):
    """The two triangles of a rectangle with these corners, and again in its plane: vertices and triangles.

    kind: "diagonal", the same cut along its other diagonal; "rug", a smaller one; "once", nothing again.
    """
    if kind == "rug":
        rug = quad(centre, 0.6 * np.array(half_u), 0.6 * np.array(half_v))
        return np.concatenate((corners, rug[0])), np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    again = [(1, 2, 3), (1, 3, 0)] if kind == "diagonal" else []
    return corners, np.array([(0, 1, 2), (0, 2, 3), *again])


@pytest.mark.parametrize("kind", ["diagonal", "rug"])
def test_overlapping_coplanar_faces_at_one_temperature(kind):
    """A floor that is there twice, but not in the same triangles, or with a rug exactly in its plane: each of the two
    emits, though only one is met. That is exact where nothing has to be emitted, and finite otherwise."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    at = np.array([0.5, 0.4, 0.0]), np.array([0.5, 0.0, 0.0]), np.array([0.0, 0.4, 0.0])
    floor = doubled(kind, quad(*at)[0], at[1], at[2], at[0])
    mesh = join((vertices, np.delete(triangles, [8, 9], axis=0), 300.0, 0), (*floor, 300.0, 0))
    scene = closed(*mesh[:2])
    film = checked_render(scene, QUICK)
    np.testing.assert_allclose(film.radiance(), black(EDGES, 300.0), rtol=ROUNDING)
    for settings in ({"reference_subtraction": False}, {"reference_temperature": 333.0}):
        film = checked_render(scene, dataclasses.replace(QUICK, **settings))
        print(f"{kind}, {settings}: {film.radiance().mean(dtype=float) / black(EDGES, 300.0) - 1:+.1%}")


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("kind", ["diagonal", "rug"])
def test_overlapping_coplanar_emitters(kind, settings):
    """A hot plate over a floor that is there twice lights it by at least as much as one plate (2 % for the noise of the
    three), and by less than one that is twice as emissive."""
    corners = quad((0, 0, 0.5), (1, 0, 0), (0, 1, 0))[0]
    camera = look((0.7, 0.0, 0.4), (0.0, 0.0, 0.0), 8, 6, 0.3)

    def lit(kind, emissivity):
        plate = doubled(kind, corners, (1, 0, 0), (0, 1, 0), (0, 0, 0.5))
        *mesh, material = join((*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0.0, 0), (*plate, 400.0, 1))
        materials = [GREY, Material("plate", emissivity)]
        scene = make_scene(*mesh, materials, camera, EDGES, material, world_temperature=300.0)
        return pass_means(scene, dataclasses.replace(QUICK, **settings)).sum(axis=1).mean()

    once, twice, emissive = lit("once", 0.5), lit(kind, 0.5), lit("once", 1.0)
    print(f"{twice / once:.4f} times the light of one, {emissive / once:.4f} of one that is twice as emissive")
    assert 0.98 * once < twice < emissive


def rooms(gap, hot, left=400.0, right=300.0, material=GREY, tangent=0.5, edges=EDGES):
    """Two closed rooms side by side, turned askew; the wall between them from inside the left (hot) or right one."""
    box_left, box_right = box(), box()
    vertices, triangles, kelvin, index = join(
        (box_left[0] - (1.0 + gap, 0, 0), box_left[1], left, 0), (*box_right, right, 0)
    )
    eye = np.array([-0.8 - gap if hot else 0.8, 0.6, 0.4])
    camera = look(turned(eye), turned(eye * (0, 1, 1)), 8, 6, tangent)
    return make_scene(turned(vertices), triangles, kelvin, [material], camera, edges, index)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("hot", [True, False], ids=["hot room", "cold room"])
@pytest.mark.parametrize("gap", [1e-4, 2 * CLEAR], ids=["0.1 mm", "2 um"])
def test_nothing_leaks_through_a_thin_wall(gap, hot, settings):
    """Two closed rooms at 400 K and 300 K: each is black at its own temperature, however near they are.

    Rays start 1e-6 of the largest coordinate (1.2 m) from their surface, which float32 is sure to resolve (`offset`).
    Walls that are nearer cannot be told apart: at half a micrometre each room is lit by the other.
    """
    expect(rooms(gap, hot), black(EDGES, 400.0 if hot else 300.0), **settings)


@pytest.mark.parametrize(
    "emissivity, settings",
    [
        (1.0, {}),
        (1.0, {"reference_subtraction": False}),
        (0.5, {}),
        (0.5, {"reference_subtraction": False}),
        (0.5, {"reference_temperature": 333.0}),
    ],
)
@pytest.mark.parametrize("gap", [1e-4, 2 * CLEAR], ids=["0.1 mm", "2 um"])
def test_millions_of_times_the_light_behind_a_thin_wall(gap, emissivity, settings):
    """Beside a room at 3000 K, in 3-3.01 um 2.2e6 times as bright, one at 300 K is black at its own temperature: were a
    millionth of that light to come through, it would be three times as bright."""
    edges = FILAMENT[:2]
    scene = rooms(gap, False, 3000.0, 300.0, Material("walls", emissivity), edges=edges)
    truth = band_radiance(edges, 300.0)
    assert band_radiance(edges, 3000.0) > 2e6 * truth
    expect(scene, truth, **settings)


def test_heat_that_nobody_sees_adds_no_noise():
    """A room with a floor at 330 K and the rest at 300 K, in 3-5 um, one metre from a closed one at 3000 K, or at 0 K:
    no light of that one can come, so the picture is as noisy. A factor of 2: each of the errors is known to 18 %."""
    errors, means = [], []
    for hot in (0.0, 3000.0):
        scene = rooms(1.0, False, hot, 300.0, edges=FILAMENT[::2])
        kelvin = scene.temperature.copy()
        kelvin[20:22] = 330.0
        passes = pass_means(dataclasses.replace(scene, temperature=kelvin), QUICK).sum(axis=1)
        errors.append(stats.sem(passes))
        means.append(passes.mean())
    print(f"{means} +- {errors}")
    assert errors[1] < 2 * errors[0]


@pytest.mark.parametrize("gap", [1e-4, 2 * CLEAR], ids=["0.1 mm", "2 um"])
def test_no_millionth_leaks_through_a_thin_wall(gap):
    """Rays that leak may be rare, and a picture takes few. So 3.1 million from all the walls of one room are looked at,
    from where the solver starts them: none meets the other room or nothing at all. Were it a millionth of them that
    did, the chance of that would be 5 % (rule of three)."""
    m = prepare(rooms(gap, False), QUICK)
    surfaces = m.stage.surfaces
    corners, (normal, clear) = surfaces.corners.of().astype(float), np.split(surfaces.plane.astype(float), [3], axis=1)
    inwards = corners[12:].mean(axis=(0, 1)) - corners.mean(axis=1)
    normal *= np.sign(np.sum(normal * inwards, axis=1))[:, None]
    rng = np.random.default_rng(1)
    for _ in range(31):
        t = rng.integers(12, 24, 100_000)
        share = rng.dirichlet((1.0, 1.0, 1.0), len(t))
        direction = rng.normal(size=(len(t), 3))
        direction = normal[t] + direction / np.linalg.norm(direction, axis=1)[:, None]  # cosine distribution
        origin = np.einsum("ni,nij->nj", share, corners[t]) + clear[t] * normal[t]
        met = m.tracer.trace(origin.astype(np.float32), direction.astype(np.float32)).triangle
        assert met.min() >= 12


@pytest.mark.parametrize("first", [400.0, 300.0])
@pytest.mark.parametrize("seen_from", ["left", "right"])
def test_walls_that_coincide(first, seen_from, caplog):
    """Two rooms with a wall of each at one position: the log tells, and the wall of the first counts, on both sides."""
    scene = rooms(0.0, seen_from == "left", first, 700.0 - first, Material("black", 1.0), 0.3)
    film = checked_render(scene, dataclasses.replace(QUICK, passes=1))
    assert "2 triangles lie exactly on others and are left out" in caplog.text
    np.testing.assert_allclose(film.radiance(), black(EDGES, first), rtol=ROUNDING)


# Views


@pytest.mark.parametrize("settings", BRIEFLY)
def test_between_mirrors_that_absorb_little(settings):
    """An endless corridor: eps = 0.001 on both, at one temperature with what closes it at the sides: black."""
    walls, triangles = box((1.0, 1.0, 0.2))
    materials = [Material("mirror", 0.001, specular=1.0), GREY]
    camera = look((0.5, 0.5, 0.1), (0.9, 0.55, 0.12), 8, 6)
    scene = make_scene(walls, triangles, 300.0, materials, camera, EDGES, [1] * 8 + [0] * 4)
    expect(scene, black(EDGES, 300.0), passes=64, **settings)


@pytest.mark.parametrize("settings", [*SUBTRACTION, WRONG])
def test_between_perfect_mirrors(settings):
    """Two that face each other reflect all and emit nothing: whatever a path does, it ends at the surroundings."""
    *mesh, material = join(
        (*quad((0, 0, 0), (5, 0, 0), (0, 5, 0)), 300.0, 0), (*quad((0, 0, 1), (5, 0, 0), (0, 5, 0)), 300.0, 0)
    )
    camera = look((0, 0, 0.5), (0, 0, 1), 8, 6)
    mirrors = [Material("mirror", 0.0, specular=1.0)]
    scene = make_scene(*mesh, mirrors, camera, EDGES, material, world_temperature=250.0)
    expect(scene, black(EDGES, 250.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_room_of_mirrors_alone(settings):
    """No diffuse surface at all: no photon can be stored, and camera paths find everything."""
    scene = room(material=Material("mirror", 0.05, specular=1.0))
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("emissivity", [0.0, 0.05])
@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_photons_that_could_never_be_stored_are_not_traced(emissivity, roughness):
    """Between perfect mirrors each would bounce 4096 times for nothing. Rough lobes store those from lights alone."""
    material = Material("mirror", emissivity, 1.0, roughness)
    scene = room(material=material, lights=(PointLight(np.array([0.5, 0.4, 0.3]), 100.0),))
    unlit = dataclasses.replace(scene, lights=())
    settings = dataclasses.replace(QUICK, reference_subtraction=False)
    assert prepare(unlit, settings).photons_per_pass == 0
    assert (prepare(scene, settings).photons_per_pass == 0) == (roughness == 0.0)


@pytest.mark.long
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
    expect(scene, 0.5 * incident / np.pi, precision=0.01, photons_per_pass=1000, passes=8 * QUICK.passes)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_camera_inside_an_object(settings):
    """A closed ball around the camera hides a room of another temperature."""
    vertices, triangles, kelvin, material = join((*box(), 400.0, 0), (sphere(2, 0.1)[0] + 0.5, sphere(2)[1], 300.0, 0))
    camera = look((0.5, 0.5, 0.5), (1, 1, 1), 8, 6)
    scene = make_scene(vertices, triangles, kelvin, [GREY], camera, EDGES)
    expect(scene, black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize(
    "position", [(0.0, 0.4, 0.3), (0.0, 0.0, 0.0), (1e-9, 0.4, 0.3)], ids=["wall", "corner", "touching"]
)
def test_camera_on_a_surface(position, settings):
    """A ray that starts on a wall, or so near that float32 cannot tell, meets it at once, and from behind, as it goes
    into the room: what the outside emits, half of a blackbody, in every pixel. Outside is 0 K."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    scene = make_scene(vertices, triangles, 300.0, [GREY], look(position, (0.6, 0.5, 0.3), 8, 6), EDGES)
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    np.testing.assert_allclose(film.radiance(), 0.5 * black(EDGES, 300.0), rtol=ROUNDING)


@pytest.mark.parametrize("settings", SUBTRACTION)
def test_camera_close_to_a_surface(settings):
    """As far from the wall as rays of the solver start: it sees the room."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    camera = look((CLEAR, 0.4, 0.3), (0.6, 0.5, 0.3), 8, 6)
    expect(make_scene(vertices, triangles, 300.0, [GREY], camera, EDGES), black(EDGES, 300.0), **settings)


@pytest.mark.parametrize("specular, roughness", [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)])
@pytest.mark.parametrize("settings", SUBTRACTION)
def test_grazing_views(specular, roughness, settings):
    """A floor seen at 0.06 degrees, under surroundings of its own temperature: black, whatever its lobe."""
    floor = quad((0, 0, 0), (1000, 0, 0), (0, 1000, 0))
    camera = look((-900, 0, 1.0), (100, 0, 0), 8, 2, 0.0005)
    materials = [Material("floor", 0.5, specular, roughness)]
    scene = make_scene(*floor, 300.0, materials, camera, EDGES, world_temperature=300.0)
    expect(scene, black(EDGES, 300.0), allowance=SUMMED, **settings)


@pytest.mark.parametrize("settings", [*SUBTRACTION, WRONG])
@pytest.mark.parametrize("material", [GREY, Material("mirror", 0.5, specular=1.0)], ids=lambda material: material.name)
@pytest.mark.parametrize("world", [0.0, 250.0])
def test_one_triangle_in_an_empty_world(world, material, settings):
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    camera = look((0.2, 0.2, 1), (0.2, 0.2, 0), 8, 6, 0.1)
    triangles = np.array([(0, 1, 2)], np.int32)
    scene = make_scene(corners, triangles, 300.0, [material], camera, EDGES, world_temperature=world)
    film = checked_render(scene, dataclasses.replace(QUICK, **settings))
    truth = 0.5 * (black(EDGES, 300.0) + black(EDGES, world))
    np.testing.assert_allclose(film.radiance(), truth, rtol=SUMMED)


# Numbers of photons and passes


def test_passes_that_store_no_photon_send_rays_like_others():
    """With two photons most passes store none; were they without rays, two thirds of the light would be missing."""
    vertices, triangles = box((2.0, 2.0, 2.0))
    temperature, material = np.full(12, 300.0), np.ones(12, int)
    temperature[:2] = 330.0  # -x
    material[8:10] = 0  # the floor
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 1.0, 1.9
    camera = Camera(16, 16, matrix, kind="ORTHOGRAPHIC", frame=(-0.5, 0.5, -0.5, 0.5))
    materials = [Material("grey", 0.5), Material("black", 1.0)]
    scene = make_scene(vertices, triangles, temperature, materials, camera, [8.0, 12.0], material)
    few, many = (
        pass_means(scene, Settings(passes=passes, photons_per_pass=photons, seed=3))[:, 0]
        for passes, photons in ((100, 2), (20, 20_000))
    )
    deviation = few.mean() - many.mean()
    excess = many.mean() - band_radiance(np.array([8.0, 12.0]), 300.0)[0]
    error = math.hypot(stats.sem(few), stats.sem(many))
    assert abs(deviation) < 4.0 * error and error < 0.01 * excess


@pytest.mark.parametrize(
    "photons, precision",
    [(1, 0.03), *(long(*case) for case in ((2, 0.02), (10, 0.01)))],
)
@pytest.mark.parametrize("settings", BRIEFLY)
def test_fewer_photons_than_neighbours(photons, precision, settings):
    """All count, over the largest disk, and the mean is that of many: the closed form of a diffuse ball.

    Their number in all, 256 to 2560, says how well it can be known.
    """
    scene, truth = diffuse_sphere(0.5, 0.5)
    expect(scene, truth, precision=precision, passes=256, photons_per_pass=photons, **settings)


@pytest.mark.parametrize("settings", [*SUBTRACTION, WARM])
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


def beam(power=1000.0, half=3.0):
    """A beam of light, turned down by a mirror onto a spot of a floor that is smaller than float32 resolves there; and
    its radiance in the mean over the picture, W m-2 sr-1. power: of the lamp, W. half: width of the picture, m."""
    at = np.array([12.3, 7.2, 0.0])
    *mesh, material = join(
        (*quad((0, 0, 0), (16, 0, 0), (0, 16, 0)), 0.0, 0), (*quad(at + (0, 0, 1), (0, 0.1, 0), (-0.1, 0, 0.1)), 0.0, 1)
    )
    lamp = SpotLight(at + (-0.8, 0.0, 1.0), np.array([1.0, 0.0, 0.0]), power, 1e-7)
    matrix = look(at + (0, 0, 0.8), at).matrix
    camera = Camera(16, 16, matrix, "ORTHOGRAPHIC", frame=(-half, half, -half, half))
    materials = [GREY, Material("mirror", 0.0, specular=1.0)]
    scene = make_scene(*mesh, materials, camera, EDGES, material, lights=(lamp,))
    return scene, 0.5 * power * light_spectrum(lamp, EDGES).sum() / np.pi / (2 * half) ** 2


@pytest.mark.parametrize("settings", [*SUBTRACTION, WARM])
def test_photons_that_coincide(settings):
    """40 photons at one point, fewer than the neighbours of an estimate: their light is spread over the largest disk,
    and all of it is there.

    With a reference of 300 K some are what the surroundings lack. So the beam is a bright one, to send most of them.
    """
    scene, truth = beam(1e9)
    settings = dataclasses.replace(QUICK, passes=128, photons_per_pass=40, **settings)
    model = prepare(scene, settings)
    batches = stored_photons(model, 40)
    points = np.concatenate([batch.position for batch in batches])
    most = np.unique(points, axis=0, return_counts=True)[1].max()
    assert most == len(points) == 40 or (settings.reference_temperature and 30 <= most <= 40)
    expect(scene, truth, settings, precision=0.01)


@pytest.mark.parametrize("settings", [*SUBTRACTION, WARM])
def test_more_photons_coincide_than_are_neighbours(settings):
    """5000 at one point leave an estimate no disk of its own: their light is spread over the largest one, too."""
    scene, truth = beam(1e9, 0.3)  # the largest disk of a caustic has a radius of 0.24 m
    expect(scene, truth, QUICK, precision=0.015, passes=32, **settings)


def test_film_of_a_hundred_thousand_passes():
    """Mean and noise do not drift: float64 sums of 1e5 passes err by 1e5 roundings of 1e-16 at most, far below what
    the float32 image resolves. Passes repeat a few random ones, so that the truth is known without a sum as long.

    What the camera sees directly varies 20 times as much as the rest, in all passes alike. As camera rays are one
    stratified sequence, that counts by 1 / sqrt(passes) (see Film.noise): by about as much as the rest does.
    """
    rng = np.random.default_rng(5)
    shape, rounds = (50, 6, len(EDGES) - 1), 2000
    seen = rng.choice((-20.0, 20.0), shape[:2]).astype(np.float32)
    excess = 30.0 + rng.normal(size=shape) + seen[:, :, None] / shape[2]  # about a reference of 290 K
    some = excess.astype(np.float32)
    film = Film(3, 2, EDGES, 290.0)
    for _ in range(rounds):
        for one, part in zip(some, seen, strict=True):
            film.add_pass(one, part, 1)
    assert film.passes == 100_000
    total = some.sum(axis=2, dtype=np.float64)
    mean = total.mean(axis=0) + black(EDGES, 290.0)
    variances = (total - seen).var(axis=0), seen.var(axis=0, dtype=np.float64) / np.sqrt(film.passes)
    assert np.all(np.abs(np.log(variances[1] / variances[0])) < np.log(3.0))
    error = np.sqrt(sum(variances) / (film.passes - 1))
    half = apparent_temperature(mean + error, EDGES) - apparent_temperature(mean - error, EDGES)
    rounding = np.finfo(np.float32).eps
    np.testing.assert_allclose(film.radiance().ravel(), mean, rtol=rounding)
    np.testing.assert_allclose(film.temperature().ravel(), apparent_temperature(mean, EDGES), rtol=rounding)
    np.testing.assert_allclose(film.noise().ravel(), 0.5 * half, rtol=1e-5)  # difference of near temperatures


@pytest.mark.parametrize("settings", [*BRIEFLY, WRONG])
def test_passes_around_the_hundred_thousandth(settings):
    """Disks are a fiftieth of the first pass's area by then, and random numbers as good: a diffuse ball in its closed
    form (see diffuse_sphere), and other passes than the first."""
    scene, truth = diffuse_sphere(0.5, 0.5)
    late = dataclasses.replace(QUICK, passes=32, pass_offset=99_984, **settings)
    first = dataclasses.replace(late, pass_offset=0)
    assert not np.array_equal(*(pass_means(scene, dataclasses.replace(each, passes=1)) for each in (late, first)))
    expect(scene, truth, late)
