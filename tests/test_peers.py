# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmarks hand to other renderers is the scene: gas in meshes, in grids, and everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from addon.solver import Material, Medium
from addon.solver.physics.spectrum import band_radiance
from tests.benchmarks.peers.problem import Problem, build_problem
from tests.helpers.grids import random_grid
from tests.helpers.scenes import box, look, make_scene, sphere

EDGES = np.linspace(8.0, 12.0, 5)
ABSORPTION = np.array([[8.0, 0.5], [12.0, 1.5]])
KELVIN = 350.0


def filled(*media):
    """A closed room of 2 x 3 x 2.5 m, with media."""
    vertices, triangles = box((2.0, 3.0, 2.5))
    return make_scene(
        vertices, triangles[:, ::-1], 300.0, [Material("grey", 0.5)], look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), EDGES,
        media=media, world_depth=5.0,
    )  # fmt: skip


def volume(gas):
    """m3 within its mesh, positive if fronts look outwards."""
    corners = gas.vertices[gas.triangles]
    return np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0


def test_gas_of_the_world_is_a_box_around_everything():
    gas = build_problem(filled(Medium("air", ABSORPTION, KELVIN, 0.25, 0.6))).gas
    low, high = gas.vertices.min(axis=0), gas.vertices.max(axis=0)
    assert gas.world and np.all(low < 0.0) and np.all(high > (2.0, 3.0, 2.5))
    assert volume(gas) == pytest.approx(np.prod(high - low))
    np.testing.assert_allclose(gas.source, band_radiance(EDGES, KELVIN))
    assert np.all(np.diff(gas.absorption) > 0) and np.all(gas.scattering == 0.25) and gas.anisotropy == 0.6


@pytest.mark.parametrize("turn", [False, True])
def test_a_mesh_stays_and_looks_outwards(turn):
    vertices, triangles = sphere(2, 0.5)
    medium = Medium("ball", 1.0, KELVIN, vertices=vertices, triangles=triangles[:, ::-1] if turn else triangles)
    gas = build_problem(filled(medium)).gas
    assert not gas.world and len(gas.triangles) == len(triangles)
    assert volume(gas) == pytest.approx(np.pi / 6, rel=0.1)  # facets lie inside the sphere


@pytest.mark.parametrize("seed", [1, 2])
def test_cells_of_a_grid_stay_where_they_are(seed):
    """At points anywhere in it, turned, sheared and mirrored as it is; its mesh holds all cells."""
    grid = random_grid(seed)
    reference = 300.0
    gas = build_problem(filled(Medium("plume", ABSORPTION, KELVIN, grid=grid)), reference).gas
    leaf, *cell = np.nonzero(grid.density > 0.0)
    middles = 8.0 * grid.leaves[leaf] + np.transpose(cell) + 0.5
    world = middles @ grid.matrix[:3, :3].T + grid.matrix[:3, 3]
    found = (world - gas.matrix[:3, 3]) @ np.linalg.inv(gas.matrix[:3, :3]).T
    index = tuple(np.floor(found).astype(int).T)
    np.testing.assert_array_equal(gas.density[index], grid.density[leaf, *cell])
    assert gas.density.sum() == pytest.approx(grid.density.sum())
    excess = band_radiance(EDGES, grid.temperature[leaf, *cell]) - band_radiance(EDGES, reference)
    np.testing.assert_allclose(np.moveaxis(gas.source, 0, -1)[index], excess, rtol=1e-5)
    assert volume(gas) == pytest.approx(abs(np.linalg.det(gas.matrix)) * gas.density.size)


def test_gas_at_the_reference_does_not_emit():
    scene = filled(Medium("air", 0.5, KELVIN))
    assert build_problem(scene).gas.emits and not build_problem(scene, KELVIN).gas.emits
    assert not build_problem(filled(Medium("fog", 0.0, KELVIN, 1.0))).gas.emits  # it only scatters


@pytest.mark.parametrize("media", [(), (Medium("plume", ABSORPTION, KELVIN, grid=random_grid(3)),)])
def test_problems_travel_in_files(tmp_path, media):
    problem = build_problem(filled(*media))
    problem.save(tmp_path / "problem.npz")
    arrays, loaded = problem.arrays(), Problem.load(tmp_path / "problem.npz").arrays()
    assert arrays.keys() == loaded.keys() and any(name.startswith("gas_") for name in arrays) == bool(media)
    for name, array in arrays.items():
        np.testing.assert_array_equal(loaded[name], array)


def test_three_bands_a_run():
    """In units in which the brightest is 1, here the gas; the fourth band comes alone, three times."""
    problem = build_problem(filled(Medium("plume", ABSORPTION, KELVIN, grid=random_grid(4))))
    assert problem.groups == [[0, 1, 2], [3]]
    for bands, three in zip(problem.groups, ([0, 1, 2], [3, 3, 3]), strict=True):
        part, scale = problem.of_bands(bands)
        np.testing.assert_allclose(part.gas.brightest(), 1.0)
        np.testing.assert_allclose(part.emission * scale, problem.emission[:, three])
        np.testing.assert_allclose((part.gas.source.T * scale).T, problem.gas.source[three], rtol=1e-6)
        np.testing.assert_array_equal(part.gas.absorption, problem.gas.absorption[three])


@pytest.mark.parametrize(
    "media",
    [
        (Medium("one", 0.5, KELVIN), Medium("two", 0.5, KELVIN)),
        (Medium("lines", temperature=KELVIN, gas={"CO2": 0.1}),),
        (Medium("fog", 0.5, KELVIN, 0.5, np.array([[8.0, 0.1], [12.0, 0.9]])),),
    ],
)
def test_what_peers_cannot_render_is_refused(media):
    with pytest.raises(ValueError, match="Peers take one gas, without species, and one anisotropy"):
        build_problem(replace(filled(), media=media))


def test_the_worlds_gas_needs_a_closed_room():
    """Elsewhere it reaches as far as its depth, and a box around the scene does not."""
    room = filled(Medium("air", 0.5, KELVIN))
    with pytest.raises(ValueError, match="in a box around the scene, which must let no ray out"):
        build_problem(
            replace(room, **{each: getattr(room, each)[:-2] for each in ("triangles", "material", "temperature")})
        )
