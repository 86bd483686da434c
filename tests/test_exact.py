# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with an exact solution (exact_cases.py), rendered through the camera, and the formulas of the truths.

The mean of the image must lie within the standard errors of the truth that CHANCE allows (from the spread of the
passes), and within 0.3 %, of long tests with five times the passes within 0.1 %. docs/accuracy.md has longer renders of
more cases, and of them against 3 standard errors.

Standard errors are at most 0.03 % in enclosures and 0.06 % elsewhere: a mean that is wrong by five of them is found.
"""

import math

import numpy as np
import pytest
from scipy.stats import t as student

from addon.solver import Settings, render
from addon.solver.geometry.triangles import Corners, areas
from addon.solver.physics.spectrum import band_radiance
from tests.helpers.exact_cases import (
    ALL,
    CASES,
    NARROW,
    OFF,
    PHOTONS,
    SIGMA,
    WRONG,
    blackbody,
    cavity,
    closed_sphere,
    concentric,
    corner_factor,
    disk,
    disk_factor,
    disks,
    disks_image,
    ggx,
    globe,
    isothermal,
    lobe_albedo,
    mean_over,
    parallel,
    parallel_factor,
    parallel_image,
    plates,
    polygon_factor,
    rectangle,
)
from tests.helpers.marks import long
from tests.helpers.scenes import pass_means, quad

pytestmark = pytest.mark.once

ENCLOSURES = plates, closed_sphere, concentric, cavity  # light comes from all sides, so that few passes tell its spread
CHANCE = 6e-5  # that one of some 60 means strays further: in every 260th suite, as for 4 standard errors that are known
SECOND_VIEWS = (
    "hot, e = 0.8 / 0.4",
    "rest, e = 0.3 / 0.9",
    "cap, e = 0.3 / 0.9",
    "inner, e = 0.8 / 0.4",
    "parallel, distance 0.3 m",
    "half mirrors",
    "f = 0.01, e = 0.5",
    "three bands",
)  # of what others show


def is_long(case):
    return case.settings in (OFF, WRONG) or any(words in case.name for words in SECOND_VIEWS)


SHORT = [
    pytest.param(
        case,
        1,
        id=f"{case.build.__name__}-{case.name}",
        marks=[pytest.mark.long] if is_long(case) else [],
    )
    for case in CASES
    if case.short
]
LONG = [long(*case.values[:1], 5, id=f"{case.id}-long") for case in SHORT]


@pytest.mark.parametrize("case, times", SHORT + LONG)
def test_exact_case(case, times):
    scene, truth = case.build(**case.arguments)
    count = times * (
        25 if case.build in ENCLOSURES else 60
    )  # where a small bright thing shines, fewer tell their spread badly
    passes = pass_means(scene, case.render_settings(passes=count))
    deviation = passes.mean(axis=0) / truth - 1.0
    error = passes.std(axis=0, ddof=1) / math.sqrt(count) / truth
    print("; ".join(f"deviation {d:+.5%}, standard error {e:.5%}" for d, e in zip(deviation, error, strict=True)))
    assert np.all(np.abs(deviation) <= np.maximum(student.isf(CHANCE / 2, count - 1) * error, case.tolerance))
    assert np.all(np.abs(deviation) < (0.003 if times == 1 else 0.001))


EXACT = [case for case in CASES if case.build is isothermal and not case.settings]


@pytest.mark.parametrize("case", EXACT, ids=lambda case: case.name)
def test_isothermal_enclosure_is_exact_in_every_pixel(case):
    scene, _ = case.build(**case.arguments)
    film = render(scene, Settings(passes=2, photons_per_pass=1000))
    np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)
    assert np.all(film.noise() == 0)


@pytest.mark.long  # docs/accuracy.md tells the same of more passes
def test_pixels_converge():
    """The error of single pixels falls at least as m^-1/3 over m passes: that of photons alone, whose disks shrink.

    Passes of rays alone give m^-1/2, and the first passes, with the widest disks, may add blur (Knaus and Zwicker
    2011). The exponent is measured from 8 to 64 passes in each of 8 renders; 3 standard errors of their mean.
    """
    scene, truth = parallel_image(1.0)
    exponents = []
    for seed in range(8):
        error = {}

        def note(film, error=error):
            error[film.passes] = math.sqrt(np.mean((film.radiance() - truth) ** 2))

        render(scene, Settings(passes=64, photons_per_pass=5000, seed=seed), note)
        exponents.append(math.log(error[64] / error[8]) / math.log(64 / 8))
    mean, standard = np.mean(exponents), np.std(exponents, ddof=1) / math.sqrt(len(exponents))
    print(f"error as passes to the power {mean:.3f} +- {standard:.3f}")
    assert standard < 0.02
    assert mean < -1 / 3 + 3 * standard


def test_pixels_on_an_edge():
    """Pixels that hold less than a third of a disk's rim show its light like all others: 3 standard errors."""
    scene, truth, cover = disks_image(0.25)
    edge = (cover > 0) & (cover < 1 / 3)
    renders = [render(scene, Settings(passes=16, photons_per_pass=PHOTONS, seed=seed)).radiance() for seed in range(8)]
    deviations = np.array([(image[edge].mean() / truth[edge].mean(), image.mean() / truth.mean()) for image in renders])
    deviations -= 1.0
    deviation, error = deviations.mean(axis=0), deviations.std(axis=0, ddof=1) / math.sqrt(len(renders))
    print(f"{np.count_nonzero(edge)} pixels on the edge: {deviation[0]:+.2%} +- {error[0]:.2%}")
    print(f"whole image: {deviation[1]:+.3%} +- {error[1]:.3%}")
    assert abs(deviation[0]) < 3 * error[0]


# The truths themselves


def test_blackbody():
    """Printed integrals of Planck's law (the second share: up to its maximum), to their last digit."""
    bands = {  # 3-5, 8-12, 8-14 and 7.5-13 um
        293.15: (1.44748, 34.3344, 49.3729, 45.9676),
        300.0: (1.86596, 38.5004, 54.9335, 51.4770),
        500.0: (167.528, 289.833, 369.121, 386.575),
        1000.0: (6506.73, 1602.83, 1924.07, 2179.04),
    }
    for planck in (blackbody, band_radiance):  # that of the truths, and the engine's
        for kelvin, expected in bands.items():
            found = [planck(np.array(band), kelvin)[0] for band in ((3.0, 5.0), (8.0, 12.0), (8.0, 14.0), (7.5, 13.0))]
            np.testing.assert_allclose(found, expected, rtol=5e-6)
    shares = {1000: 0.000321, 2897.771955: 0.250055, 5000: 0.633726, 10_000: 0.914157, 50_000: 0.998904}
    for wavelength_times_kelvin, expected in shares.items():
        below = blackbody(np.array([0.3, wavelength_times_kelvin / 1000.0]), 1000.0)[0]
        assert math.pi * below / (SIGMA * 1000.0**4) == pytest.approx(expected, abs=6e-7)


def test_view_factors():
    """Printed values; and closed forms against Lambert's contour integral, averaged over the receiver."""
    assert disk_factor(1, 1, 1) == pytest.approx(0.381966011, abs=1e-9)
    assert disk_factor(1, 1, 2) == pytest.approx(0.171572875, abs=1e-9)
    assert parallel_factor(1, 1, 1) == pytest.approx(0.1998248957, abs=1e-10)
    assert parallel_factor(1, 1, 2) == pytest.approx(0.068589589, abs=1e-9)
    assert corner_factor(1, 1, 1) == pytest.approx(0.2000437761, abs=1e-9)
    square = (-1.0, 1.0, -0.25, 0.25)
    above = rectangle(*square, 0.4)
    assert mean_over(square, lambda at: polygon_factor(at, *above), 24) == pytest.approx(parallel_factor(2, 0.5, 0.4))
    wall = quad((0, 0.5, 0.25), (0, 0.5, 0), (0, 0, 0.25))
    floor = (0.0, 2.0, 0.0, 1.0)
    # the factor is not smooth at the common edge, where the mean of 64^2 points converges slowly
    assert mean_over(floor, lambda at: polygon_factor(at, *wall), 64) == pytest.approx(
        corner_factor(2, 0.5, 1), rel=1e-4
    )


@pytest.mark.parametrize("image, case", [(parallel_image, (parallel, 1, 1)), (disks_image, (disks, 1, 1))])
def test_truth_of_pixels(image, case):
    """Pixels have the mean of the whole; 1e-4: 40 x 40 points in each pixel on the rim of a disk."""
    build, *arguments = case
    assert image(0.25)[1].mean() == pytest.approx(build(*arguments, 0.25)[1][0], rel=1e-4)


@pytest.mark.parametrize("receiver, emitter, distance", [(1, 1, 1), (1, 1, 0.25), (0.5, 2, 0.5)])
def test_polygons_serve_as_disks(receiver, emitter, distance):
    """The view factor to a polygon of 256 corners, from rings of the receiver, is that of the disk to 1e-5."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    radius = receiver * np.sqrt((nodes + 1) / 2)  # even over the area
    points = np.column_stack((radius, np.zeros_like(radius), np.zeros_like(radius)))
    factor = weights / 2 @ polygon_factor(points, *disk(emitter, distance))
    assert factor == pytest.approx(disk_factor(receiver, emitter, distance), rel=1e-5)


def test_enclosures():
    """Printed values: radiosities of plates over pi at 10 um, radiances in a sphere, the heat flux between concentric
    spheres, and effective emissivities of cavities.

    1e-6: the narrow band is not one wavelength; 1e-7 of a blackbody lies outside ALL. 2e-5: the area of the mesh.
    """
    width = blackbody(NARROW, 300.0)[0] / 9.924033  # um: over B(10 um, 300 K)
    assert plates("hot")[1][0] / width == pytest.approx(31.41425, rel=1e-6)
    assert plates("cold")[1][0] / width == pytest.approx(22.81816, rel=1e-6)
    radiosity = concentric("inner", edges=ALL)[1][0]
    flux = math.pi * (blackbody(ALL, 400.0)[0] - radiosity) / (1 / 0.8 - 1)
    assert flux == pytest.approx(610.6557, rel=1e-6)
    assert closed_sphere("cap")[1][0] / width == pytest.approx(18.67055, rel=2e-5)
    assert closed_sphere("rest")[1][0] / width == pytest.approx(10.16043, rel=2e-5)
    for cut, expected in ((0.98, 0.990099), (0.8, 0.909091), (0.0, 0.666667)):
        assert cavity(cut)[1][0] / blackbody(NARROW, 300.0)[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("cut", [0.98, 0.8, 0.5, 0.0])
def test_share_of_a_cap(cut):
    """That of a sphere to 1e-4, which changes the emissivity of a cavity by a third of it at most; and no gaps."""
    vertices, triangles, is_cap = globe(cut)
    area = areas(Corners(np.ascontiguousarray(vertices), triangles.astype(np.int32)))
    assert area[is_cap].sum() / area.sum() == pytest.approx((1 - cut) / 2, rel=1e-4)
    assert len(vertices) - len(triangles) // 2 == 2  # Euler: as all of its edges have two faces


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.2])
def test_lobe(cosine):
    """The albedo, a quadrature over facets, against one of the BRDF over directions, for a wide lobe."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    z, turn = (nodes[:, None] + 1) / 2, 2 * math.pi * (np.arange(400) + 0.5) / 400
    sine = np.sqrt(1 - z**2)
    light = np.stack(np.broadcast_arrays(sine * np.cos(turn), sine * np.sin(turn), z), axis=-1)
    eye = np.array((math.sqrt(1 - cosine**2), 0.0, cosine))
    over_directions = 2 * math.pi * np.sum(weights / 2 * np.mean(ggx(0.7, light, eye) * light[..., 2], axis=1))
    assert lobe_albedo(0.7, cosine) == pytest.approx(over_directions, abs=1e-5)
