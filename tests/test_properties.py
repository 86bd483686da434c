# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties that hold in every closed enclosure, over random ones (hypothesis; the same in every run).

How many: the profile in conftest.py.
"""

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy import stats

from addon.solver import Material, Settings, render
from addon.solver.geometry.interaction import emit_at
from addon.solver.geometry.stage import Stage, fill_emission
from addon.solver.geometry.surfaces import unit_normal
from addon.solver.geometry.triangles import areas
from addon.solver.passes import Work, render_pass
from addon.solver.photons.wave import arrive, has_arrived
from addon.solver.physics.lobes import interpolate_albedo
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.preparation import photon_store, prepare
from tests.helpers.scenes import box, look, make_scene, mean_and_error, sphere, stored_photons

OVER = settings.get_profile("enclosures")
PASSES = 16
QUICK = Settings(passes=PASSES, photons_per_pass=4000)
PHOTONS = 60_000  # whose energy is added up, in each of so many passes
PAPER = {"reference_subtraction": False}
EDGES = np.array([8.0, 9.5, 12.0])
# A sound engine fails a statistical test here once in a thousand times: Student's t for the spread of the passes, a
# two-sided test, and Bonferroni's share for each of `comparisons`.
MISTAKE = 1e-3


def standard_errors(comparisons=OVER.max_examples):
    """Standard errors that a sound engine exceeds in one of a thousand tests of so many comparisons."""
    return stats.t.ppf(1.0 - 0.5 * MISTAKE / comparisons, PASSES - 1)


@st.composite
def meshes(draw):
    """Closed surface around the origin: a box or an icosphere, stretched, with every corner moved in or out. Each ray
    from the origin still meets it once, so it stays closed and never meets itself."""
    vertices, triangles = draw(st.sampled_from([box(), sphere(0), sphere(1)]))
    vertices = vertices - vertices.mean(axis=0)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    stretch = [draw(st.floats(0.5, 2.0)) for _ in range(3)]
    return vertices * stretch * rng.uniform(0.8, 1.2, (len(vertices), 1)), triangles


values = st.floats(0.1, 1.0)  # grey ones, and curves between two wavelengths
emissivities = st.one_of(values, st.tuples(values, values).map(lambda e: np.array([[8.5, e[0]], [11.0, e[1]]])))
materials = st.builds(  # few values of the lobe, so that mirrors and rough ones are among few examples
    Material, st.just("wall"), emissivities, st.sampled_from([0.0, 0.5, 1.0]), st.sampled_from([0.0, 0.3, 1.0])
)


@st.composite
def enclosures(draw, isothermal=False):
    """Scene of a closed enclosure seen from its middle: two materials and, unless isothermal, random temperatures."""
    vertices, triangles = draw(meshes())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kelvin = np.full(len(triangles), draw(st.sampled_from([77.0, 300.0, 1500.0])))
    if not isothermal:
        kelvin = rng.uniform(250.0, 400.0, len(triangles))
    camera = look((0, 0, 0), rng.normal(size=3), 6, 4, 0.8)
    pair = [draw(materials), draw(materials)]
    return make_scene(vertices, triangles, kelvin, pair, camera, EDGES, rng.integers(0, 2, len(triangles)))


@OVER
@given(enclosures(isothermal=True))
def test_isothermal_enclosures_are_black(scene):
    """Exactly so in every pixel with the right reference; without a reference within the noise."""
    kelvin = float(scene.temperature[0])
    truth = band_radiance(EDGES, kelvin)
    film = render(scene, dataclasses.replace(QUICK, passes=2))
    pixels = film.bands() * np.diff(EDGES)[:, None, None]
    # float32: the reference and the image are rounded, and so is their sum
    np.testing.assert_allclose(pixels, np.broadcast_to(truth[:, None, None], pixels.shape), rtol=2e-7)
    assert np.all(film.noise() == 0)
    mean, error = mean_and_error(scene, dataclasses.replace(QUICK, photons_per_pass=10_000, **PAPER))
    print(f"standard error {error / truth.sum():.2%}")
    assert error < 0.005 * truth.sum()
    assert abs(mean - truth.sum()) <= standard_errors() * error + 5e-7 * truth.sum()


@OVER
@given(enclosures())
def test_the_reference_does_not_change_the_mean(scene):
    """The image with the subtraction and without is the same within the noise of both, which is below 1 %."""
    mean, error = mean_and_error(scene, QUICK)
    other, other_error = mean_and_error(scene, dataclasses.replace(QUICK, **PAPER))
    print(f"standard errors {error / mean:.2%} {other_error / mean:.2%}")
    assert max(error, other_error) < 0.01 * mean
    assert abs(mean - other) <= standard_errors() * np.hypot(error, other_error)


@njit
def lost(lobes, material, cosine):
    """Share of the radiance of a blackbody that a surface emits, beside its emissivity, as its lobe loses it."""
    albedo = interpolate_albedo(lobes.albedo, material, cosine)
    return lobes.specular[material] * (1.0 - albedo) if lobes.alpha[material] > 0.0 else 0.0


@njit
def absorb(stage, inner, hits, wave, absorbed):
    """Add to absorbed (b,) the power, W, that the inner sides (t,) absorb of a wave."""
    for i in range(hits.triangle.size):
        if not has_arrived(wave, i, hits.triangle[i]):
            continue
        at = arrive(stage.surfaces, hits, i, wave)
        if at.side_id != inner[at.triangle]:
            continue
        share = lost(stage.radiometry.lobes, at.material, at.cosine)
        reflectance = stage.radiometry.reflectance[at.material]
        for b in range(absorbed.size):
            rho = reflectance[b]
            absorbed[b] += wave.power[i, b] * (1.0 - rho + rho * share)


@njit
def emitted_inwards(stage, area):
    """(b,) power in excess of the reference that one side of every triangle emits, W: the mean over the squared sine of
    the angle, by 1000 steps."""
    total, value = np.zeros(stage.radiometry.reference.size), np.empty(stage.radiometry.reference.size)
    for t in range(area.size):
        for step in range(1000):
            cosine = math.sqrt(1.0 - (step + 0.5) / 1000.0)
            fill_emission(stage, emit_at(stage.surfaces, 2 * t, 0.2, 0.3, cosine), value)
            for b in range(value.size):
                total[b] += math.pi * area[t] * value[b] / 1000.0
    return total


def inner_sides(surfaces):
    """(t,) side_ids of the sides that face the origin."""
    fronts = np.arange(0, 2 * len(surfaces.sheet), 2)
    normals = np.array([unit_normal(surfaces, front) for front in fronts])
    return fronts + (np.sum(normals * surfaces.corners.of().mean(axis=1), axis=1) > 0)


def absorbed_inside(model, key):
    """(b,) power that the inner sides absorb from the photons of a pass, W."""
    inner, absorbed = inner_sides(model.stage.surfaces), np.zeros(len(EDGES) - 1)
    stored_photons(model, PHOTONS, key, lambda hits, wave: absorb(model.stage, inner, hits, wave, absorbed))
    return absorbed


@OVER
@given(enclosures(), st.sampled_from([PAPER, {"reference_temperature": 450.0}]))
def test_enclosures_absorb_what_they_emit(scene, change):
    """What photons leave at their hits, each a share eps, is what the walls emit inwards in every band, also where that
    is all in deficit of a reference. Mirrors and rough walls take part: what a lobe loses at grazing angles is
    absorbed, and emitted. The emitted power is a sum over the triangles: pi A eps B(T) for diffuse ones.

    The standard error is below 0.25 %. Nothing of the deficit of the surroundings, outside, counts.
    """
    model = prepare(scene, dataclasses.replace(QUICK, photons_per_pass=PHOTONS, **change))
    emitted = emitted_inwards(model.stage, areas(model.stage.surfaces.corners))
    absorbed = np.array([absorbed_inside(model, i) for i in range(PASSES)]) / emitted
    error = absorbed.std(axis=0, ddof=1) / np.sqrt(PASSES)
    print(f"deviation {absorbed.mean(axis=0) - 1.0}, standard error {error}")
    assert np.all(error < 0.0025)
    assert np.all(np.abs(absorbed.mean(axis=0) - 1.0) <= standard_errors(OVER.max_examples * len(emitted)) * error)


def swapped(tables, *names):
    """The tables with the order of their bands, the last axis, turned round."""
    return tables._replace(**{name: np.ascontiguousarray(getattr(tables, name)[..., ::-1]) for name in names})


@OVER
@given(enclosures())
def test_bands_are_alike(scene):
    """A pass of the model with its two bands swapped is the same image with its bands swapped: no band leads.

    To float32 rounding of some ten terms, as fused products round one band's share in the roulette, not the other's; of
    the survivals that differ by that, none of so few photons is decided otherwise.
    """
    settings = dataclasses.replace(QUICK, reference_temperature=280.0)
    model = prepare(scene, settings)
    radiometry = swapped(model.stage.radiometry, "reflectance", "emission", "slope", "base", "reference")
    lights = swapped(model.emitters.lights, "power")
    other = dataclasses.replace(
        model,
        stage=Stage(model.stage.surfaces, radiometry),
        emitters=model.emitters._replace(surroundings=swapped(model.emitters.surroundings, "radiance"), lights=lights),
        lamps=model.lamps._replace(lights=lights),
        optics=swapped(model.optics, "band_share"),
    )
    images = []
    with ThreadPoolExecutor(1) as pool:
        for m in (model, other):
            image, seen = np.zeros((24, 2), np.float32), np.zeros(24, np.float32)
            work = Work(photon_store(2, m.optics), pool, lambda: False)
            assert render_pass(m, settings, 0, work, (image, seen, np.empty_like(seen)))
            images.append(image)
    assert np.ptp(images[0]) > 0
    np.testing.assert_allclose(images[0], images[1][:, ::-1], rtol=0, atol=1e-6 * np.abs(images[0]).max())


def moved(scene, vertices, matrix):
    """The scene with other vertices and another camera matrix."""
    return dataclasses.replace(scene, vertices=vertices, camera=dataclasses.replace(scene.camera, matrix=matrix))


@OVER
@given(enclosures(), st.integers(0, 2**32 - 1), st.sampled_from([{}, PAPER]))
def test_rigid_motion_does_not_change_the_mean(scene, seed, change):
    """A random rotation and shift. Directions are sampled in other frames, so images agree within the noise, which is
    below 1 %."""
    rotation = stats.special_ortho_group.rvs(3, random_state=seed)
    shift = np.random.default_rng(seed).uniform(-100.0, 100.0, 3)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack((rotation @ scene.camera.matrix[:3, :3], shift))
    other = moved(scene, scene.vertices @ rotation.T + shift, matrix)
    quick = dataclasses.replace(QUICK, **change)
    (mean, error), (there, error_there) = (mean_and_error(s, quick) for s in (scene, other))
    print(f"standard errors {error / mean:.2%} {error_there / there:.2%}")
    assert max(error, error_there) < 0.01 * mean
    assert abs(mean - there) <= standard_errors() * np.hypot(error, error_there) + 5e-7 * mean


@OVER
@given(enclosures(), st.sampled_from([2.0**-20, 2.0**-3, 2.0**20]))
def test_scale_changes_nothing(scene, factor):
    """Radiance does not depend on size. Powers of two scale float numbers exactly, so every bit stays."""
    matrix = scene.camera.matrix.copy()
    matrix[:3, 3] *= factor
    settings = dataclasses.replace(QUICK, passes=2)
    film, scaled = render(scene, settings), render(moved(scene, scene.vertices * factor, matrix), settings)
    assert np.array_equal(film.bands(), scaled.bands())
    assert np.array_equal(film.noise(), scaled.noise())


@OVER
@given(enclosures())
def test_threads_change_nothing(scene):
    settings = dataclasses.replace(QUICK, passes=2, photons_per_pass=40_000)  # several chunks of photons
    one, three = (render(scene, dataclasses.replace(settings, threads=threads)) for threads in (1, 3))
    assert np.array_equal(one.bands(), three.bands())
    assert np.array_equal(one.noise(), three.noise())


def test_thresholds():
    """16 passes have 15 degrees of freedom: 4.07 standard errors are exceeded once in a thousand times."""
    assert standard_errors(1) == pytest.approx(4.073, abs=1e-3)
