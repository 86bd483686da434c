# SPDX-License-Identifier: GPL-3.0-or-later
"""The path tracer that serves as a reference (helpers/path_tracer.py), against scenes with an exact solution.

Means must lie within 4 standard errors of the truth, which a sound tracer misses in one of 16,000 comparisons; seeds
are fixed, so that a test which passes always does.
"""

import numpy as np
import pytest

from addon.solver import Material, Medium
from tests.benchmarks.families import FAMILIES, HEIGHT, WIDTH, member
from tests.helpers.exact_cases import (
    THERMAL,
    WRONG,
    cavity,
    closed_sphere,
    concentric,
    corner,
    isothermal,
    mirrors,
    plates,
    ramp,
    rough_emitter,
    rough_mirror,
    rough_plate,
)
from tests.helpers.gas_cases import (
    black,
    endless,
    full_sphere,
    hemispherical_emissivity,
    linear_radiance,
    normal_emissivity,
    normal_transmitted,
    plates_with_mirrors,
    reflectance,
    scattering_emissivity,
    slab,
    straight_down,
    transmittance,
)
from tests.helpers.grids import cells_on_ray, random_grid
from tests.helpers.marks import long
from tests.helpers.path_tracer import LONGER, black_radiance, standard_error, trace_paths
from tests.helpers.scenes import look, make_scene, quad

pytestmark = pytest.mark.once

STEPS = (0.2, 0.9, 0.5)  # emissivities in THERMAL
ROUNDING = 1e-6  # positions of hits are those of float32
FACETS = 2e-4  # of a sphere's mesh
CASES = {
    "plates": (plates, {"view": "cold"}, {}, 0.0),
    "half mirrors": (plates, {"view": "hot", "specular": 0.5}, {}, 0.0),
    "mirrors": (plates, {"view": "cold", "specular": 1.0}, {}, 0.0),
    "three bands": (plates, {"view": "hot", "hot": STEPS, "cold": STEPS[::-1], "edges": THERMAL}, {}, 0.0),
    "concentric spheres": (concentric, {"view": "outer"}, {}, FACETS),
    "closed sphere": (closed_sphere, {"view": "rest", "cap": 0.05, "rest": 0.05}, {}, FACETS),
    "temperature that varies": (closed_sphere, {"view": "rest", "rest": 0.4, "hottest": 500.0}, {}, FACETS),
    "ramp": (ramp, {"low": 250.0, "high": 500.0}, {}, 0.0),
    "cavity": (cavity, {"cut": 0.8, "emissivity": 0.1, "sky": 270.0}, {}, FACETS),
    "corner": (corner, {"width": 1, "height": 1, "edge": 1}, {}, 0.0),
    "beside a mirror": (mirrors, {"count": 1}, {}, 0.0),
    "rough plate": (rough_plate, {"degrees": 80, "roughness": 0.5, "plate": 300.0, "sky": 0.0}, {}, 1e-5),
    "rough plate under a sky": (rough_plate, {"degrees": 60, "roughness": 1.0, "plate": 0.0, "sky": 300.0}, {}, 1e-5),
    "rough plate, T0 = 250 K": (
        rough_plate, {"degrees": 80, "roughness": 0.5, "plate": 300.0, "sky": 0.0}, {"reference": 250.0}, 1e-5
    ),
    "in a rough mirror": (rough_mirror, {"source": "rectangle", "roughness": 0.3}, {}, 0.0),
    "beside a rough emitter": (rough_emitter, {}, {"samples": 32}, 2e-5),
}  # fmt: skip


SHORT = "mirrors", "three bands", "ramp", "corner", "beside a mirror", "rough plate under a sky", "in a rough mirror"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in SHORT else pytest.mark.long) for name in CASES]
)
def test_exact_case(name):
    build, arguments, options, tolerance = CASES[name]
    scene, truth = build(**arguments)
    traced = trace_paths(scene, **{"samples": 8, "batches": 32} | options)
    batches = traced.images.mean(axis=(1, 2)) + black_radiance(traced.edges, traced.reference)
    deviation, error = batches.mean(axis=0) / truth - 1.0, standard_error(batches) / truth
    print(f"deviation {deviation}, standard error {error}")
    assert np.all(error < 0.03)
    assert np.all(np.abs(deviation) <= 4.0 * error + tolerance + ROUNDING)


@pytest.mark.parametrize(
    "material",
    [
        Material("grey", 0.3),
        Material("rough", 0.3, 1.0, 1.0),
        long(Material("", 0.1, 0.5, 0.4)),
    ],
)
def test_isothermal_enclosure_is_black(material):
    """Exactly if its temperature is T0; in the mean from another one, as only roulette makes paths differ then."""
    scene, truth = isothermal(material)
    same = trace_paths(scene, samples=4, batches=2, reference=300.0)
    assert np.all(same.images == 0.0) and np.allclose(same.radiance(), truth)
    other = trace_paths(scene, samples=16, batches=32, reference=WRONG["reference_temperature"])
    batches = other.images.mean(axis=(1, 2)) + black_radiance(other.edges, other.reference)
    assert np.abs(batches.mean() / truth[0] - 1.0) <= 4.0 * standard_error(batches) / truth[0] + ROUNDING


def test_batches_depend_on_their_index_alone():
    scene, _ = plates("cold")
    whole = trace_paths(scene, samples=2, batches=4, seed=3, threads=2)
    rest = trace_paths(scene, samples=2, batches=2, seed=3, first_batch=2)
    assert np.array_equal(whole.images[2:], rest.images)
    assert not np.array_equal(whole.images[0], whole.images[1])


def test_kinds_of_paths_add_up():
    """A floor that reflects a hot rectangle, directly and by way of an upright mirror."""
    scene, _ = mirrors(1)
    traced = trace_paths(scene, samples=64, batches=4, kinds=True)
    kinds = traced.by_kind()
    assert np.allclose(sum(mean for mean, _ in kinds.values()), traced.excess().sum(axis=-1))
    assert {"D", "DS"} <= set(kinds) and not {"S", "SD", "G", LONGER} & set(kinds)
    assert kinds["D"][0].mean() > kinds["DS"][0].mean() > 0.0


@pytest.mark.parametrize("build, arguments", [
    (normal_emissivity, (0.1,)), (hemispherical_emissivity, (1.0,)), (full_sphere, (True,)), (linear_radiance, (1.0,)),
    (plates_with_mirrors, (0,)), (reflectance, (0.9, 1.0, 0.352712)), (transmittance, (0.5, 1.0, 0.306709)),
    (normal_transmitted, (1.0, 1.0, 0.658671)), (scattering_emissivity, (0.9, 1.0, 0.140965)),
])  # fmt: skip
def test_gas(build, arguments):
    """Exact cases with gas in a mesh, in cells, and everywhere."""
    case = build(*arguments)
    traced = trace_paths(case.scene, samples=2, batches=16)
    batches = traced.images.mean(axis=(1, 2))[:, 0] + black_radiance(traced.edges, traced.reference)[0]
    value, error = batches.mean() / case.scale, standard_error(batches) / case.scale
    print(f"{value:.5f} +- {error:.5f}, exact {case.truth:.5f}")
    assert error < 0.02 * case.truth
    assert abs(value - case.truth) <= 4.0 * error + (case.tolerance + ROUNDING) * case.truth


def test_gases_that_overlap_add():
    """Three stretches along a ray through a slab in a slab whose faces look inwards."""
    inner, outer = slab(0.4, 0.6, 2.0, 500.0), slab(0.1, 1.1, 1.0, 300.0)
    outer.triangles[:] = outer.triangles[:, ::-1]
    traced = trace_paths(endless((inner, outer), straight_down(1.15), below=400.0), samples=1, batches=2)
    a, b, expected = black(500.0), black(300.0), black(400.0)
    for tau, source in ((0.3, b), (0.6, (2.0 * a + b) / 3.0), (0.5, b)):
        expected = expected * np.exp(-tau) - source * np.expm1(-tau)
    assert np.allclose(traced.radiance(), expected, rtol=1e-5)


# of seed 4 the ray through the second grid meets missing leaves alone
@pytest.mark.parametrize("seed", (long(0), 4))
def test_random_cells(seed):
    """Single rays through a sheared grid with missing leaves, beside a sum over its cells."""
    grid = random_grid(seed)
    middle = grid.matrix[:3, 3]
    position = middle + (1.0, -7.0, 0.5)
    wall = quad(middle + (0, 9.0, 0), (9.0, 0, 0), (0, 0, 9.0))
    scene = make_scene(
        *wall, 350.0, [Material("wall", 1.0)], look(position, middle, 1, 1, 1e-6), np.array([9.99, 10.01]),
        media=(Medium("gas", 0.7, grid=grid),),
    )  # fmt: skip
    along = (middle - position) / np.linalg.norm(middle - position)
    planes, at = cells_on_ray(grid, position, along, 20.0)
    stops = np.concatenate(([0.0], np.sort(planes), [20.0]))
    expected, depths = 0.0, []
    for begin, end in zip(stops[:-1], stops[1:], strict=True):
        density, kelvin = at(0.5 * (begin + end))
        expected -= np.exp(-sum(depths)) * np.expm1(-0.7 * density * (end - begin)) * black(kelvin)
        depths.append(0.7 * density * (end - begin))
    expected += np.exp(-sum(depths)) * black(350.0)
    assert sum(depths) > 0.1
    assert trace_paths(scene, samples=1, batches=2).radiance()[0, 0, 0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("family", [family for family in FAMILIES if family not in ("curved", "skylit")])
def test_families_can_be_traced(family):
    """Members are always the same, and their pictures show more than the surroundings. Normals at corners and skies are
    not traced."""
    for index in range(2):
        scene = member(family, index)
        traced = trace_paths(scene, samples=16, batches=2)
        image = traced.excess()[..., 0]
        assert image.shape == (HEIGHT, WIDTH) and np.all(np.isfinite(image))
        assert np.array_equal(scene.vertices, member(family, index).vertices)
        if family not in ("door", "keyhole"):  # hardly any light comes through some of these
            assert np.any(image != 0.0)
