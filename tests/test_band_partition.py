# SPDX-License-Identifier: GPL-3.0-or-later
"""Bands where spectra ask for them: the optimal partition, what bands lose, and what adaptive edges spare."""

import itertools
import math

import numpy as np
import pytest

from addon.solver import Camera, Material, SceneError, Settings, render
from addon.solver.physics import library
from addon.solver.physics.band_partition import (
    MOST_BANDS,
    arriving_light,
    candidate_edges,
    choose_bands,
    error_table,
    optimal_partition,
)
from addon.solver.physics.radiometry import band_emissivity, excess_emissivity
from addon.solver.physics.spectrum import band_radiance, planck, uniform_edges
from tests.helpers.band_cases import (
    COLD,
    GLASS,
    GREEN,
    HOT,
    QUARTZ,
    SETS,
    compared,
    curve,
    finer,
    plates,
    spectral_error,
    summed,
)
from tests.helpers.exact_cases import rectangle
from tests.helpers.scenes import box, join, look, make_scene, pass_means, quad

SCENE = (COLD, HOT)  # K


def chosen(names, low, high, **how):
    return choose_bands(low, high, [curve(name) for name in names], SCENE, **how)


# The optimal partition


def random_costs(seed, cells=9):
    table = np.random.default_rng(seed).exponential(size=(cells + 1, cells + 1))
    table[np.tril_indices(cells + 1)] = np.inf
    return table


def sum_of(table, indices):
    return sum(table[i, j] for i, j in itertools.pairwise(indices))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", range(1, 10))
def test_partition_is_the_best_of_all(seed, count):
    """Of all partitions of 9 cells, each tried; costs that follow no law."""
    table = random_costs(seed)
    indices, total = optimal_partition(table, count)
    every = [(0, *inner, 9) for inner in itertools.combinations(range(1, 9), count - 1)]
    assert tuple(indices) in every
    assert sum_of(table, indices) == pytest.approx(total, rel=1e-12)
    assert total == pytest.approx(min(sum_of(table, each) for each in every), rel=1e-12)


def test_partition_takes_no_more_bands_than_enough():
    table = error_table(candidate_edges(8.0, 14.0, 1), [curve(QUARTZ)], SCENE)
    sums = [optimal_partition(table, count)[1] for count in range(1, 30)]
    assert np.all(np.diff(sums) < 0)
    for count in (1, 5, 20):
        indices, total = optimal_partition(table, 100, enough=sums[count - 1])
        assert (len(indices) - 1, total) == (count, sums[count - 1])


def test_more_bands_than_cells_are_as_many_as_cells():
    assert optimal_partition(random_costs(0), 50)[0].tolist() == list(range(10))


# Candidates


@pytest.mark.parametrize("low, high", [(7.5, 14.0), (3.0, 5.0), (0.9, 1.7), (2.0, 100.0), (8.0, 8.001), (13.9, 14.1)])
@pytest.mark.parametrize("most", [1, 256, 512])
def test_candidates_are_round_and_even(low, high, most):
    edges = candidate_edges(low, high, most)
    step = np.median(np.diff(edges))
    assert (edges[0], edges[-1]) == (low, high)
    assert len(edges) > max(500, most)
    assert np.all(np.diff(edges) > 0.49 * step) and np.all(np.diff(edges) < 1.51 * step)
    mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(mantissa - round_) for round_ in (1, 2, 5)) < 1e-6
    np.testing.assert_allclose(edges[1:-1] / step, np.round(edges[1:-1] / step), rtol=1e-9)


@pytest.mark.parametrize("count", [256, 512])
def test_hundreds_of_bands(count):
    edges = chosen([GLASS, QUARTZ], 3.0, 14.0, count=count).edges
    assert len(edges) == count + 1 and np.all(np.diff(edges) > 0)
    assert (edges[0], edges[-1]) == (3.0, 14.0)


# The error of a band


@pytest.mark.parametrize("name", [GLASS, QUARTZ, GREEN])
def test_foreseen_error_is_what_one_reflection_loses(name):
    """A hot surface lights one of its own material: truth from 4096 bands, loss of 6 bands as the solver has them.

    The loss falls with the square of the width: beside the finest structure, the paint's 0.05 um, bands of 0.0015 um
    still lose (0.0015 / 0.05)^2 = 1e-3 of it.
    """
    edges = uniform_edges(8.0, 14.0, 6)
    fine = finer(edges, 4096)

    def reflected(bands):
        emissivity = excess_emissivity(bands, HOT, COLD, curve(name))
        return (1 - emissivity) * emissivity * (band_radiance(bands, HOT) - band_radiance(bands, COLD))

    loss = reflected(edges) - summed(reflected(fine), edges)
    candidates = candidate_edges(8.0, 14.0, 6)
    at = np.searchsorted(candidates, edges)
    np.testing.assert_allclose(candidates[at], edges, rtol=1e-12)
    foreseen = error_table(candidates, [curve(name)], SCENE)[at[:-1], at[1:]]
    np.testing.assert_allclose(foreseen, loss, rtol=1e-3)


def test_error_of_materials_is_their_mean_and_grey_ones_have_none():
    edges = candidate_edges(8.0, 14.0, 1)
    cells = np.triu_indices(len(edges), 1)
    one, other = (error_table(edges, [curve(name)], SCENE)[cells] for name in (GLASS, QUARTZ))
    both = error_table(edges, [curve(GLASS), curve(QUARTZ), (np.array([1.0]), np.array([0.4]))], SCENE)[cells]
    np.testing.assert_allclose(both, (one + other) / 2, rtol=1e-9, atol=1e-9 * one.max())


def test_grey_scenes_have_bands_of_equal_width():
    bands = choose_bands(7.5, 14.0, [], (COLD, HOT), count=13)
    step = np.diff(candidate_edges(7.5, 14.0, 13)).max()
    np.testing.assert_allclose(bands.edges, uniform_edges(7.5, 14.0, 13), atol=step)
    assert bands.error < 1e-6
    assert len(choose_bands(7.5, 14.0, [], (COLD, HOT), tolerance=0.001).edges) == 2


def test_lamps_count_as_much_as_surfaces():
    wavelength = np.linspace(3.0, 14.0, 50)
    alone = arriving_light(wavelength, SCENE)
    np.testing.assert_allclose(alone, planck(wavelength, HOT) - planck(wavelength, COLD), rtol=1e-12)
    lit = arriving_light(wavelength, SCENE, [5772.0, 2856.0])
    assert lit.sum() == pytest.approx(2 * alone.sum())
    assert (lit - alone)[0] / (lit - alone)[-1] > 50 * alone[0] / alone[-1]  # a sun is brightest at short waves
    assert np.all(arriving_light(wavelength, (300.0, 300.0)) > 0)
    assert np.all(np.isfinite(arriving_light(wavelength, (0.0, 0.0), [1e6])))


def test_coldest_scenes_have_bands():
    assert len(choose_bands(0.1, 0.2, [curve(QUARTZ)], (0.0, 3.0), count=4).edges) == 5


# Where edges lie


@pytest.mark.parametrize("names", [(GLASS,), (QUARTZ,), (GLASS, QUARTZ)])
def test_edges_gather_where_glass_and_quartz_reflect(names):
    """The Si-O stretch makes the one strong reflection band from 3 to 14 um, about 8 to 10.5 um.

    There bands are less than half as wide as even ones; outside and between 3 and 7 um they are wider.
    """
    edges = chosen(names, 3.0, 14.0, count=16).edges
    width, even = np.diff(edges), 11.0 / 16
    middle = (edges[1:] + edges[:-1]) / 2
    assert np.mean(width[(middle > 8.0) & (middle < 10.5)]) < even / 2
    assert np.max(width[middle < 7.0]) > 2 * even


def test_a_step_gets_an_edge():
    """An emissivity of two values needs two bands: the step is an edge, and nothing is lost."""
    step = (np.array([9.0, 9.0 + 1e-9]), np.array([0.9, 0.2]))
    bands = choose_bands(8.0, 14.0, [step], SCENE, count=2)
    np.testing.assert_allclose(bands.edges, [8.0, 9.0, 14.0], atol=1e-12)
    assert bands.error < 1e-6


def test_response_decides_where_bands_matter():
    """Where the sensor is blind bands need not be narrow: one holds all of that, but for a cell of the candidates."""
    response = (np.array([9.99, 10.0]), np.array([0.0, 0.7]))
    blind = chosen([QUARTZ], 8.0, 14.0, count=8, response=response)
    assert np.count_nonzero(blind.edges < 9.97) == 1
    assert np.count_nonzero(chosen([QUARTZ], 8.0, 14.0, count=8).edges < 9.97) > 4
    flat = chosen([QUARTZ], 8.0, 14.0, count=8, response=(np.array([1.0]), np.array([0.3])))
    np.testing.assert_array_equal(flat.edges, chosen([QUARTZ], 8.0, 14.0, count=8).edges)
    assert flat.error == pytest.approx(chosen([QUARTZ], 8.0, 14.0, count=8).error)


def test_materials_in_any_order_give_the_same_bands():
    there, back = (
        chosen(names, 7.5, 14.0, count=12).edges for names in ((GLASS, QUARTZ, GREEN), (GREEN, QUARTZ, GLASS))
    )
    np.testing.assert_array_equal(there, back)


# Tolerance


@pytest.mark.parametrize("tolerance", [0.3, 0.03, 0.003])
def test_tolerance_takes_the_fewest_bands(tolerance):
    bands = chosen([GLASS, QUARTZ], 7.5, 14.0, tolerance=tolerance)
    fewer = chosen([GLASS, QUARTZ], 7.5, 14.0, count=len(bands.edges) - 2)
    assert bands.error <= tolerance < fewer.error


def test_errors_say_what_is_wrong():
    with pytest.raises(SceneError, match="Band edges must ascend: 14 um is followed by 8 um"):
        choose_bands(14.0, 8.0, [], SCENE, count=4)
    with pytest.raises(SceneError, match="finite and above 0 um, got -1"):
        choose_bands(-1.0, 8.0, [], SCENE, count=4)
    with pytest.raises(SceneError, match=f"a tolerance of 1e-09 K needs more than {MOST_BANDS} bands"):
        chosen([QUARTZ], 3.0, 14.0, tolerance=1e-9)
    with pytest.raises(SceneError, match="does not respond to light from 8 to 14 um"):
        chosen([QUARTZ], 8.0, 14.0, count=4, response=(np.array([3.0, 5.0]), np.array([1.0, 0.0])))


# What adaptive bands spare

PAINTS = "paints have fine structure everywhere, so that no other edges help much: these are the best"
TOGETHER = "what suits glass and quartz does not suit the paints: these are the best edges for all"


@pytest.mark.parametrize("count", [8, 12, 16, 32])
@pytest.mark.parametrize(
    "names",
    [
        *[pytest.param(SETS[name], id=name) for name in ("glass", "quartz", "anodised", "glass, quartz")],
        pytest.param(SETS["paints"], id="paints", marks=pytest.mark.xfail(strict=True, reason=PAINTS)),
        pytest.param(SETS["all"], id="all", marks=pytest.mark.xfail(strict=True, reason=TOGETHER)),
    ],
)
def test_adaptive_bands_leave_a_quarter_of_the_error(names, count):
    """Parallel plates in all pairs of materials, 3 to 14 um: mean spectral error beside as many uniform bands."""
    uniform, adaptive = compared(names, 3.0, 14.0, count)
    print(f"mean {uniform.mean():.2e}, {adaptive.mean():.2e}; worst {uniform.max():.2e}, {adaptive.max():.2e}")
    assert adaptive.mean() <= uniform.mean() / 4


def seen_in_mirror(mirror, hot, edges):
    """Mean radiance of a render that shows a plate at HOT in a mirror at COLD, (b,) W m-2 sr-1, noise-free.

    Above the surroundings' COLD the image has one reflection of what the hot plate emits in excess; both are perfectly
    smooth, so that there are no photons, and quartz reflects enough for no roulette.
    """
    parts = (
        (*rectangle(-1.0, 1.0, -1.0, 1.0), COLD, 0),
        (*quad((1.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), HOT, 1),
    )
    *mesh, index = join(*parts)
    materials = [Material(name, library.find(name), specular=1.0) for name in (mirror, hot)]
    view = look((-1.0, 0.0, 1.5), (0.5, 0.0, 0.0)).matrix  # meets the hot plate half a metre above the mirror
    camera = Camera(2, 2, view, "ORTHOGRAPHIC", frame=(-0.1, 0.1, -0.1, 0.1))
    scene = make_scene(*mesh, materials, camera, edges, index, world_temperature=COLD)
    images = render(scene, Settings(passes=1, reference_temperature=COLD)).bands().astype(float)
    assert np.max(np.ptp(images, axis=(1, 2)) / images.mean(axis=(1, 2))) < 1e-6  # images are float32
    return images.mean(axis=(1, 2)) * np.diff(edges)


@pytest.mark.parametrize("mirror, hot", [(QUARTZ, QUARTZ), (QUARTZ, GLASS)])
def test_adaptive_bands_through_the_camera(mirror, hot):
    """Rendered by the solver in 12 uniform, 12 adaptive and 512 bands: a quarter of the spectral error at most."""
    errors = []
    for edges in (uniform_edges(3.0, 14.0, 12), chosen([GLASS, QUARTZ], 3.0, 14.0, count=12).edges):
        bands = seen_in_mirror(mirror, hot, edges)
        errors.append(float(spectral_error(bands, seen_in_mirror(mirror, hot, finer(edges)), edges)))
    print(f"uniform {errors[0]:.2e}, adaptive {errors[1]:.2e}, ratio {errors[1] / errors[0]:.3f}")
    assert errors[1] <= errors[0] / 4


def test_truth_of_the_mirror():
    """The 512 bands against single wavelengths, which the solver has no part in."""
    edges = finer(uniform_edges(3.0, 14.0, 8))
    middle = (edges[1:] + edges[:-1]) / 2
    mirror, hot = (np.interp(middle, *curve(name)) for name in (QUARTZ, GLASS))
    truth = planck(middle, COLD) + (1 - mirror) * hot * (planck(middle, HOT) - planck(middle, COLD))
    # midpoint rule: in bands of 0.02 um kinks of the curves weigh about 1e-5
    np.testing.assert_allclose(seen_in_mirror(QUARTZ, GLASS, edges).sum(), np.sum(truth * np.diff(edges)), rtol=5e-5)


def plates_scene(edges):
    """Diffuse plates of quartz at HOT and COLD between mirrors, which make them infinite. The cold one is seen."""
    materials = [Material("mirror", 0.0, specular=1.0), Material(QUARTZ, library.find(QUARTZ))]
    temperature = [COLD] * 8 + [HOT] * 2 + [COLD] * 2
    camera = look((0.5, 0.45, 0.25), (0.5, 0.5, 0.5))
    return make_scene(*box((1.0, 1.0, 0.5)), temperature, materials, camera, edges, [0] * 8 + [1] * 4)


@pytest.mark.long
def test_renders_lose_what_the_closed_form_says():
    """Diffuse plates of quartz in 4 wide bands, by photons: the loss against 512 bands is that of `plates`, to 4
    standard errors, and at least 10 standard errors of the worst band from none."""
    edges = uniform_edges(7.5, 14.0, 4)
    passes = pass_means(plates_scene(edges), Settings(passes=32, photons_per_pass=10_000))
    error = passes.std(axis=0, ddof=1) / math.sqrt(len(passes))
    truth = summed(plates(QUARTZ, QUARTZ, finer(edges))[1], edges)
    foreseen = plates(QUARTZ, QUARTZ, edges)[1]
    loss = passes.mean(axis=0) - truth
    print("found", loss / truth, "foreseen", foreseen / truth - 1, "standard error", error / truth)
    assert np.all(np.abs(passes.mean(axis=0) - foreseen) < 4 * error + 1e-6 * truth)
    assert np.max(np.abs(loss) / error) > 10


# Inside a band


def loss_of(weight, names, edges):
    return np.mean([spectral_error(plates(a, b, edges, weight), plates(a, b, finer(edges)), edges)
                    for a in names for b in names])  # fmt: skip


def test_black_light_of_the_scene_is_reflected_exactly():
    """Of a blackbody's excess over the reference nothing is lost, whatever the band; of one close by the loss falls
    with its distance in temperature, as the weighting is right to first order there."""
    edges = np.array([7.5, 14.0])
    fine = finer(edges)
    emissivity = excess_emissivity(edges, HOT, COLD, curve(QUARTZ))

    def loss(kelvin):
        arriving = band_radiance(fine, kelvin) - band_radiance(fine, COLD)
        exact = np.sum((1 - excess_emissivity(fine, HOT, COLD, curve(QUARTZ))) * arriving)
        return abs((1 - emissivity[0]) * arriving.sum() / exact - 1)

    assert loss(HOT) < 1e-9
    assert loss(HOT + 10) == pytest.approx(2 * loss(HOT + 5), rel=0.1)


def test_excess_weighs_better_than_the_reference_alone():
    """What arrives weighs the reflectance: less is lost than with a blackbody at the reference, in the mean."""

    def reference_alone(edges, _hot, cold, points):
        return band_emissivity(edges, cold, points)

    for count in (8, 16):
        edges = uniform_edges(7.5, 14.0, count)
        assert loss_of(excess_emissivity, SETS["all"], edges) < loss_of(reference_alone, SETS["all"], edges)
