# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's law: the formula, its tables, and what cameras and photons make of it.

Truths are computed here, by the formula in another form (helpers/path_tracer.py) and quadratures of their own. Means of
noisy renders must lie within 4 standard errors: a sound solver misses that in one of 16,000 comparisons, and the seeds
are fixed.
"""

import math

import numpy as np
import pytest

from addon.solver import Material, PointLight, Settings, render
from addon.solver.camera.first_hits import first_hit_images
from addon.solver.geometry.segments import Hits
from addon.solver.geometry.stage import Stage
from addon.solver.geometry.surfaces import build_surfaces
from addon.solver.photons.photon_map import photon_arrays
from addon.solver.photons.transport import Optics, scatter
from addon.solver.photons.wave import empty_wave
from addon.solver.physics import library
from addon.solver.physics.fresnel import (
    ANGLES,
    angles,
    build_fresnel_table,
    dielectric_index,
    fill_emissivity,
    fresnel_reflectance,
    lobe_matrix,
    reflectance_of,
)
from addon.solver.physics.lobes import ggx_albedo
from addon.solver.physics.radiometry import build_radiometry
from addon.solver.scene import SceneError
from tests.helpers import chains
from tests.helpers.exact_cases import (
    C1,
    C2,
    NARROW,
    WRONG,
    blackbody,
    ggx,
    isothermal,
    light_share,
    mean_over,
    on_floor,
    quad,
    rectangle,
    rough_view,
    smith,
)
from tests.helpers.marks import long
from tests.helpers.path_tracer import _face_reflectance, black_radiance, standard_error, trace_paths
from tests.helpers.scenes import box, join, look, make_scene, pass_means, sphere

pytestmark = pytest.mark.once

BANDS = np.array([8.0, 9.0, 10.0, 12.0])  # um
DEGREES = 0, 30, 60, 75, 85
SIGMAS = 4.0
FLOAT32 = 1e-6
WATER, GLASS = library.find_constants("Water"), library.find_constants("Glass, window")
GOLD = np.array([[10.0, 12.0, 69.0]])
BODIES = {
    "water": Material("water", specular=1.0, fresnel=True, constants=WATER),
    "glass": Material("glass", specular=1.0, fresnel=True, constants=GLASS),
    "gold": Material("gold", specular=1.0, fresnel=True, constants=GOLD),
    "varnish": Material("varnish", np.array([[8.0, 0.97], [10.0, 0.90], [12.0, 0.96]]), specular=1.0, fresnel=True),
    "gloss paint": Material("gloss paint", 0.8, specular=0.2, fresnel=True),
    "dull gold": Material("dull gold", specular=0.6, fresnel=True, constants=GOLD),
}
ROUGH = {
    "rough glass": Material("rough glass", 0.9, 1.0, 0.5, fresnel=True),
    "satin paint": Material("satin paint", 0.5, 0.2, 0.5, fresnel=True),
    "rough metal": Material("rough metal", 0.5, 0.7, 0.8, fresnel=True, constants=np.array([[10.0, 5.0, 20.0]])),
}


# Truths ---------------------------------------------------------------------------------------------------------------


def face(material, wavelength, cosine):
    """(wavelengths, cosines) of a face of the specular lobe, and its normal reflectance of all lobes (wavelengths,)."""
    if material.constants is None:
        normal = 1.0 - np.interp(wavelength, *material.curve)
        root = np.sqrt(material.specular * normal)
        index = ((1.0 + root) / (1.0 - root)).astype(complex)
        return np.array([[_face_reflectance(m, c) for c in cosine] for m in index]), normal
    um, n, k = material.constants.T
    points = np.array([[_face_reflectance(complex(*m), c) for c in (*cosine, 1.0)] for m in zip(n, k, strict=True)])
    values = np.array([np.interp(wavelength, um, column) for column in points.T])
    return material.specular * values[:-1].T, values[-1]


def smooth_albedo(material, edges, kelvin, cosine):
    """(b,) albedo of a smooth surface towards a direction, with a blackbody's spectrum as weight."""
    result = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        wavelength = np.linspace(low, high, 801)
        weight = C1 / wavelength**5 / np.expm1(C2 / (wavelength * kelvin))
        weight[[0, -1]] *= 0.5  # trapezoids
        mean, normal = (np.average(each, axis=0, weights=weight) for each in face(material, wavelength, [cosine, 1.0]))
        below = (1.0 - material.specular) * normal / (1.0 - mean[1]) if material.specular < 1.0 else 0.0
        result.append(mean[0] + below * (1.0 - mean[0]))
    return np.array(result)


def rough_lobe_albedo(index, alpha, cosine, count=1200):
    """As exact_cases.lobe_albedo, of facets that reflect by their angle."""
    g = (np.arange(count)[:, None] + 0.5) / count
    turn = 2 * math.pi * (np.arange(count) + 0.5) / count
    tan = alpha * np.sqrt(1 / g**2 - 1)
    upward = 1 / np.sqrt(1 + tan**2)
    on_facet = upward * (math.sqrt(1 - cosine**2) * tan * np.cos(turn) + cosine)
    out = 2 * on_facet * upward - cosine
    lit = (on_facet > 0) & (out > 0)
    shadowing = 1 / (1 + smith(alpha, cosine) + smith(alpha, np.where(lit, out, 1.0)))
    weight = np.where(lit, 2 * g * shadowing * on_facet / (cosine * upward), 0.0)
    return float(np.mean(weight * fresnel_reflectance(index.real, index.imag, np.clip(on_facet, 0.0, 1.0))))


def index_of(material):
    """Complex index of the faces of a material that is the same at all wavelengths, and their factor."""
    if material.constants is not None:
        return complex(*material.constants[0, 1:]), material.specular
    return complex(dielectric_index(material.specular * (1.0 - material.emissivity))), 1.0


def albedo_of(material, cosine):
    """Of a rough or smooth material that is the same at all wavelengths."""
    (index, share), normal = index_of(material), 1.0 - material.curve[1][0]
    lobe = rough_lobe_albedo(index, material.alpha, cosine) if material.alpha else _face_reflectance(index, cosine)
    below = (1.0 - material.specular) * normal / (1.0 - material.specular * normal) if material.specular < 1.0 else 0.0
    return share * lobe + below * (1.0 - share * lobe)


# The library ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", library.load_constants())
def test_constants_of_the_library(name):
    """The solver takes them, and along the normal they give the library's emissivity: each is thinned to 0.0015 or 2 %
    of it, so both differ by twice that at most (and by the rounding to 0.0001)."""
    points, constants = library.find(name), library.find_constants(name.upper())
    material = Material(name, specular=1.0, fresnel=True, constants=constants)
    wavelength = np.linspace(max(points[0, 0], constants[0, 0]), min(points[-1, 0], constants[-1, 0]), 4001)
    ours, library_s = (np.interp(wavelength, *curve) for curve in (material.curve, points.T))
    assert np.all(np.abs(ours - library_s) <= 2.0 * np.minimum(0.0015, 0.02 * library_s) + 1.1e-4)
    assert library.get(name).kind == "computed" and constants[-1, 0] >= 11.0


def test_materials_without_constants():
    assert library.find_constants("Brick, new") is None and library.find_constants("nothing") is None
    assert library.find_constants("Alumina") is None  # a mean over the rays of a crystal
    for name in ("Water", "Ice", "Glass, window", "Fused silica", "Germanium", "Silicon", "Gold, polished"):
        assert library.find_constants(name) is not None


# The formula and its tables -------------------------------------------------------------------------------------------


def test_formula():
    """Along the normal ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2), 1 at grazing angles, at Brewster's angle what is left is
    polarised across; and at any angle as in the other form."""
    n, k = np.array([1.33, 1.5, 4.0, 12.0]), np.array([0.0, 0.1, 0.0, 70.0])
    np.testing.assert_allclose(fresnel_reflectance(n, k, 1.0), ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2))
    np.testing.assert_allclose(fresnel_reflectance(n, k, 0.0), 1.0)
    brewster = 1.0 / math.sqrt(1.0 + 1.5**2)
    assert fresnel_reflectance(1.5, 0.0, brewster) == pytest.approx(0.5 * ((1.5**2 - 1.0) / (1.5**2 + 1.0)) ** 2)
    for cosine in np.linspace(0.0, 1.0, 11):
        other = [_face_reflectance(complex(*m), cosine) for m in zip(n, k, strict=True)]
        np.testing.assert_allclose(fresnel_reflectance(n, k, cosine), other, rtol=1e-12)
    assert dielectric_index(0.04) == pytest.approx(1.5)
    assert np.all(np.isfinite(fresnel_reflectance(dielectric_index(np.array([0.0, 1.0])), 0.0, 0.3)))


@pytest.mark.parametrize("name", BODIES)
def test_table_is_right_between_its_angles(name):
    """To a thousandth of the reflectance and of the emissivity, up to 89 degrees; most are ten times closer."""
    material = BODIES[name]
    table = build_fresnel_table((material,), NARROW, (300.0, 300.0), 300.0, 0.0)
    out = np.empty(1)
    for degrees in np.linspace(0.0, 89.0, 60):
        cosine = math.cos(math.radians(degrees))
        truth = smooth_albedo(material, NARROW, 300.0, cosine)[0]
        assert reflectance_of(table, 0, 0, cosine, 0) == pytest.approx(truth, rel=1e-3)
        fill_emissivity(table, 0, 300.0, cosine, out)
        assert out[0] == pytest.approx(1.0 - truth, rel=1e-3)


def test_facets_of_a_rough_lobe():
    """Where all facets reflect alike, the lobe's albedo is that without Fresnel's law. Else that of another quadrature;
    each is right to 2e-4."""
    for alpha in (0.05, 0.25, 1.0):
        matrix = lobe_matrix(alpha)
        nodes = np.linspace(0.2, 1.0, 9)
        places = np.searchsorted(angles(), nodes)
        plain = np.interp(np.sqrt(angles()[places]), np.linspace(0, 1, len(ggx_albedo(alpha))), ggx_albedo(alpha))
        np.testing.assert_allclose(matrix.sum(axis=1)[places], plain, atol=3e-4)
        for i in places:
            truth = rough_lobe_albedo(1.5 + 0j, alpha, angles()[i])
            assert matrix[i] @ fresnel_reflectance(1.5, 0.0, angles()) == pytest.approx(truth, abs=2e-4)


@pytest.mark.parametrize("name", BODIES | ROUGH)
def test_light_from_all_sides_enters_in_the_mean(name):
    """ENTERING has the mean 1 over a cosine distribution; where there is no diffuse lobe it is 1."""
    material = (BODIES | ROUGH)[name]
    table = build_fresnel_table((material,), BANDS, (300.0, 300.0), 300.0, 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    cosine = (nodes + 1) / 2
    values = np.array([[reflectance_of(table, 0, 3, c, b) for b in range(3)] for c in cosine])
    np.testing.assert_allclose((weights * cosine) @ values, 1.0, rtol=2e-4)
    assert np.all(table.reflectance[:, :2] <= 1.0 / material.specular) and np.all(table.reflectance >= 0.0)
    assert np.all(table.reflectance[0, 0] <= 1.0 + FLOAT32)


def test_materials_without_fresnel_have_no_table():
    table = build_fresnel_table((Material("a"), Material("b", fresnel=True)), BANDS, (300.0, 300.0), 300.0, 0.0)
    assert table.row.tolist() == [-1, -1] and table.reflectance.size == 0  # the second has no specular lobe
    shape = build_fresnel_table((Material("a"), BODIES["water"]), BANDS, (200.0, 400.0), 300.0, 0.0)
    assert shape.row.tolist() == [-1, 0] and shape.reflectance.shape == (1, 4, ANGLES, 3)


def test_bad_constants_are_named():
    for constants, message in (
        (np.array([1.0, 2.0]), "rows of um, n and k"),
        (np.array([[10.0, 0.0, 1.0]]), "n 0 must be above 0"),
        (np.array([[10.0, 1.0, -1.0]]), "k -1 not below 0"),
        (np.array([[10.0, 1.0, 1.0], [9.0, 1.0, 1.0]]), "Material 'x': optical constants"),
    ):
        with pytest.raises(SceneError, match=message):
            Material("x", fresnel=True, specular=1.0, constants=constants)
    with pytest.raises(SceneError, match="no Fresnel's law"):
        Material("x", constants=GOLD)


# Through the camera ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["water", "glass", "gold", "varnish"])
def test_plates(name):
    """Warm under a 0 K sky a plate shows its emissivity at the angle, cold under a warm sky its reflectance: both to a
    thousandth of the formula, per band."""
    for degrees in DEGREES:
        camera, towards, _ = rough_view(degrees, 6)
        reflectance = smooth_albedo(BODIES[name], BANDS, 300.0, towards[2])
        for plate, sky in ((300.0, 0.0), (0.0, 300.0)):
            scene = make_scene(*rectangle(-2, 2, -2, 2), plate, [BODIES[name]], camera, BANDS, world_temperature=sky)
            seen = pass_means(scene, Settings(passes=1, photons_per_pass=1000, threads=1))[0]
            truth = (1.0 - reflectance if plate else reflectance) * blackbody(BANDS, 300.0)
            print(degrees, plate, seen / truth - 1.0)
            np.testing.assert_allclose(seen, truth, rtol=1e-3)


@pytest.mark.parametrize("name", ROUGH)
def test_rough_plates(name):
    """As smooth ones, the albedo by a quadrature of its own; that of the table is right to 2e-4."""
    for degrees in (0, 60, 80):
        camera, towards, _ = rough_view(degrees, 16)
        albedo, black = albedo_of(ROUGH[name], towards[2]), blackbody(NARROW, 300.0)[0]
        warm = make_scene(*rectangle(-2, 2, -2, 2), 300.0, [ROUGH[name]], camera, NARROW)
        seen = pass_means(warm, Settings(passes=1, photons_per_pass=1000, threads=1))[0, 0] / black
        assert seen == pytest.approx(1.0 - albedo, abs=2e-4)
        cold = make_scene(*rectangle(-2, 2, -2, 2), 0.0, [ROUGH[name]], camera, NARROW, world_temperature=300.0)
        means = pass_means(cold, Settings(passes=24, photons_per_pass=1000, threads=1))[:, 0] / black
        print(degrees, means.mean() - albedo, standard_error(means))
        assert abs(means.mean() - albedo) <= SIGMAS * standard_error(means) + 2e-4
        assert standard_error(means) < 0.01 * albedo


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.long if "gold" in name or "rough metal" in name else [])
        for name in BODIES | ROUGH
    ],
)
def test_isothermal_rooms_are_black(name):
    """At T0 exactly, in every pixel; with a wrong T0 in the mean (2e-4 is the error of the table of a rough lobe)."""
    scene, truth = isothermal((BODIES | ROUGH)[name])
    film = render(scene, Settings(passes=1, photons_per_pass=1000, threads=1))
    np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)
    means = pass_means(scene, Settings(passes=12, photons_per_pass=5_000, threads=1, **WRONG))[:, 0]
    deviation, error = means.mean() / truth[0] - 1.0, standard_error(means) / truth[0]
    print(f"deviation {deviation:+.5f}, standard error {error:.5f}")
    assert error < 5e-3 and abs(deviation) <= SIGMAS * error + (2e-4 if name in ROUGH else FLOAT32)


def test_an_emitter_lights_by_its_angle():
    """An upright plate of glass at 400 K lights a small floor at an angle, with its directional emissivity: photons and
    shadow rays. Integrated over both (Gauss and Legendre); the floor sends 1e-5 back."""
    frame, half, centre = (-0.02, 0.02, -0.02, 0.02), 0.1, np.array((0.4, 0.0, 0.8))
    plate, material = quad(centre, (0, half, 0), (0, 0, half)), Material("glass", 0.7, 1.0, fresnel=True)

    def received(points):
        def from_plate(uv):
            way = centre + half * np.column_stack((np.zeros(len(uv)), uv[:, :2])) - points[:, None]
            distance = np.linalg.norm(way, axis=2)
            facing, rise = way[..., 0] / distance, way[..., 2] / distance
            emissivity = 1.0 - fresnel_reflectance(dielectric_index(0.3), 0.0, facing)
            return (emissivity * facing * rise / (math.pi * distance**2)).T

        return mean_over((-1.0, 1.0, -1.0, 1.0), from_plate, 16) * (2 * half) ** 2

    materials = (Material("floor", 0.5), material)
    scene, truth = on_floor(rectangle(*frame), frame, [plate], 0.3, mean_over(frame, received, 4), materials)
    means = pass_means(scene, Settings(passes=40, photons_per_pass=10_000, threads=1))[:, 0]
    print(means.mean() / truth[0] - 1.0, standard_error(means) / truth[0])
    assert standard_error(means) < 2e-3 * truth[0]
    assert abs(means.mean() - truth[0]) <= SIGMAS * standard_error(means) + 2e-5 * truth[0]


@pytest.mark.parametrize("name", ROUGH)
def test_a_light_in_both_lobes(name):
    """A point light over a rough plate at 0 K: the BRDF of both lobes, by the formula, with facets at their angles."""
    material, (camera, towards, frame) = ROUGH[name], rough_view(50, 16)
    lamp = PointLight(np.array((-1.2, 0.3, 1.2)), 1000.0, temperature=1000.0)
    (index, share), normal = index_of(material), 1.0 - material.curve[1][0]
    cosines = np.linspace(0.02, 1.0, 50)
    through = np.array([1.0 - share * rough_lobe_albedo(index, material.alpha, c, 400) for c in cosines])
    nodes, weights = np.polynomial.legendre.leggauss(60)
    mean = np.sum(weights * (nodes + 1) / 2 * np.interp((nodes + 1) / 2, cosines, through))
    below = (1.0 - material.specular) * normal / (1.0 - material.specular * normal) if material.specular < 1.0 else 0.0

    def brdf(light):
        half = (light + towards) / np.linalg.norm(light + towards, axis=-1, keepdims=True)
        lobe = share * ggx(material.alpha, light, towards)
        lobe = lobe * fresnel_reflectance(index.real, index.imag, np.sum(half * light, axis=-1))
        ways = np.interp(light[..., 2], cosines, through) * np.interp(towards[2], cosines, through)
        return lobe + below / math.pi * ways / mean

    def reflected(points):
        way = lamp.position - points
        distance = np.linalg.norm(way, axis=1)[:, None]
        return brdf(way / distance) * way[:, 2] / distance[:, 0] ** 3 * lamp.power / (4 * math.pi)

    scene = make_scene(*rectangle(-0.2, 0.2, -0.2, 0.2), 0.0, [material], camera, NARROW, lights=(lamp,))
    truth = mean_over(frame, reflected, 6) * light_share(lamp)[0]
    means = pass_means(scene, Settings(passes=8, photons_per_pass=1000, threads=1))[:, 0]
    print(means.mean() / truth - 1.0, standard_error(means) / truth)
    assert abs(means.mean() / truth - 1.0) <= SIGMAS * standard_error(means) / truth + 1e-3


@pytest.mark.parametrize("name", ["water", "glass", "gloss paint"])
def test_pass_of_emissivity(name):
    """The data pass has the emissivity at the angle, of all bands together."""
    for degrees in DEGREES:
        camera, towards, _ = rough_view(degrees, 4)
        scene = make_scene(*rectangle(-2, 2, -2, 2), 300.0, [BODIES[name]], camera, BANDS)
        black = blackbody(BANDS, 300.0)
        truth = np.average(1.0 - smooth_albedo(BODIES[name], BANDS, 300.0, towards[2]), weights=black)
        np.testing.assert_allclose(first_hit_images(scene, ["emissivity"])["emissivity"], truth, rtol=1e-3)


# Photons --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BODIES | ROUGH)
def test_photons_keep_the_balance(name):
    """Of photons that arrive under an angle, what goes on has the power of the albedo there; of those from all sides,
    that of the hemispherical albedo. What is absorbed is what the surface emits: Kirchhoff, angle by angle."""
    material, count = (BODIES | ROUGH)[name], 200_000
    scene = make_scene(*rectangle(-1, 1, -1, 1), 300.0, [material], look((0, 0, 1), (0, 0, 0), 2, 2), BANDS)
    surfaces, _, _ = build_surfaces(scene)
    stage = Stage(surfaces, build_radiometry((material,), BANDS, (300.0, 300.0), 300.0, 0.0))
    table = stage.radiometry.fresnel
    random = np.random.default_rng(1)
    for cosine in (1.0, 0.5, 0.2, 0.08, np.sqrt(random.random(count))):
        wave, cosine = empty_wave(count, 3, False), np.broadcast_to(cosine, count)
        wave.direction[:] = np.column_stack((np.sqrt(1.0 - cosine**2), np.zeros(count), -cosine))
        wave.origin[:] = -wave.direction
        wave.power[:] = 1.0, 2.0, 4.0
        wave.photon[:], wave.aimed[:], wave.chain[:], wave.arrival[:] = np.arange(count), 0.0, 0, -1
        hits = Hits(np.zeros(count, np.int32), *np.full((2, count), 0.2, np.float32), np.ones(count, np.float32))
        optics = Optics(np.full(3, 1 / 3, np.float32), True, False, False, False)
        stored = photon_arrays(count, 3, False, False, False)
        rooms = np.empty(3, np.float32), np.empty(3, np.float32)
        kept, alive = scatter(stage, optics, np.uint64(7), 0, hits, wave, (stored, rooms))
        truth = np.array([[reflectance_of(table, 0, 0, c, b) for b in range(3)] for c in cosine[:: count // 500]])
        power = np.zeros((count, 3))
        power[:alive] = wave.power[:alive] / (1.0, 2.0, 4.0)
        error = np.hypot(standard_error(power), standard_error(truth) if np.ptp(cosine) else 0.0)
        print(power.mean(axis=0) - truth.mean(axis=0), error)
        assert np.all(np.abs(power.mean(axis=0) - truth.mean(axis=0)) <= SIGMAS * error + 2e-4)
        below = np.array([[reflectance_of(table, 0, 3, c, b) for b in range(3)] for c in cosine[:: count // 500]])
        if kept:
            entered = stored.power[:kept].mean(axis=0, dtype=float) / (1.0, 2.0, 4.0)
            assert kept == count and np.allclose(entered, below.mean(axis=0), rtol=0.03 if np.ptp(cosine) else 1e-5)
        else:
            assert material.specular == 1.0


# Against the path tracer ----------------------------------------------------------------------------------------------


LONG_CHAINS = "d", "s", "dd", "ds", "sG", "sd", "Gd", "Sd"
COATED = {
    "G": Material("rough", 0.6, specular=1.0, roughness=0.5, fresnel=True),
    "S": Material("mirror", 0.6, specular=1.0, fresnel=True),
    "d": Material("coated, rough", 0.2, specular=0.3, roughness=0.5, fresnel=True),
    "s": Material("coated, smooth", 0.2, specular=0.3, fresnel=True),
}


@pytest.mark.parametrize("emitter", ["plate", "lamp", *map(long, chains.EMITTERS[2:])])
@pytest.mark.parametrize("lobes", ["G", *map(long, LONG_CHAINS)])
def test_every_kind_once(monkeypatch, lobes, emitter):
    """As in tests/test_ledger.py: chains of plates between which light can take one way alone."""
    if not chains.is_compared(lobes, emitter):
        pytest.skip("lights are not seen in mirrors alone, lamps not found behind what other surfaces mirror")
    monkeypatch.setattr(chains, "LOBES", chains.LOBES | COATED)
    scene = chains.chain(lobes, emitter)
    scene_of_reference = chains.chain(lobes, "plate") if emitter in ("sky", "light") else scene
    traced = trace_paths(scene_of_reference, 400, 24, reference=chains.COLD)
    truth = traced.images.sum(axis=-1).mean(axis=(1, 2))
    settings = Settings(passes=32, photons_per_pass=10_000, reference_temperature=chains.COLD, threads=1)
    means = pass_means(scene, settings)[:, 0] - black_radiance(chains.EDGES, chains.COLD)[0]
    deviation = means.mean() / truth.mean() - 1.0
    error = np.hypot(standard_error(means), standard_error(truth)) / truth.mean()
    print(f"deviation {deviation:+.4f}, standard error {error:.4f}")
    assert error < 0.1 and abs(deviation) <= SIGMAS * error + 5e-4


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_random_rooms(seed):
    """A room of random materials with a hot ball and a plate in it, in two bands: blocks of the picture against those
    of the path tracer, none of which may be off by 5 standard errors (of 48 blocks one is by 2.9)."""
    scene = random_room(np.random.default_rng(seed))
    traced = trace_paths(scene, 100, 16, reference=300.0)
    settings = Settings(passes=48, photons_per_pass=10_000, threads=1)
    blocks = []
    render(scene, settings, lambda film: blocks.append(film.passes * _blocks(film.bands().transpose(1, 2, 0))))
    ours = np.diff([np.zeros_like(blocks[0]), *blocks], axis=0) * np.diff(scene.band_edges)
    theirs = _blocks(traced.images) + black_radiance(traced.edges, 300.0)
    error = np.hypot(standard_error(ours), standard_error(theirs))
    apart = (ours.mean(axis=0) - theirs.mean(axis=0)) / error
    print(np.sqrt(np.mean(apart**2)), np.abs(apart).max(), np.mean(error) / theirs.mean())
    assert np.abs(apart).max() < 5.0 and np.sqrt(np.mean(apart**2)) < 1.5 and np.mean(error) < 0.02 * theirs.mean()


def random_room(random):
    """Scene of materials that follow Fresnel's law, or not, each of another emissivity in each of two bands."""
    edges = np.array([8.0, 10.0, 12.0])

    def material(i):
        low, high = random.uniform(0.2, 0.9, 2)
        steps = np.array([[8.0, low], [9.9999999, low], [10.0000001, high], [12.0, high]])
        share, roughness = random.choice([0.2, 0.6, 1.0]), random.choice([0.0, 0.3, 0.7])
        return Material(f"material {i}", steps, share, roughness, fresnel=bool(i % 4))

    ball, plate = sphere(2, 0.15), quad((0.7, 0.3, 0.35), (0.1, 0.1, 0.0), (0.0, 0.0, 0.2))
    walls, faces = box((1.0, 0.8, 0.6))
    sides = [(walls, faces[2 * i : 2 * i + 2], float(random.uniform(280, 320)), i) for i in range(6)]
    *mesh, index = join(*sides, (ball[0] + (0.4, 0.4, 0.25), ball[1], 420.0, 6), (*plate, 300.0, 7))
    camera = look((0.9, 0.7, 0.5), (0.3, 0.3, 0.2), 24, 16, tangent=0.7)
    return make_scene(*mesh, [material(i) for i in range(8)], camera, edges, index, world_temperature=300.0)


def _blocks(images):
    """Means of blocks of 4 x 4 pixels of images (..., h, w, b)."""
    height, width, bands = images.shape[-3:]
    shape = (*images.shape[:-3], height // 4, 4, width // 4, 4, bands)
    return images.reshape(shape).mean(axis=(-4, -2), dtype=float)
