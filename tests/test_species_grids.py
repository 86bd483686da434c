# SPDX-License-Identifier: GPL-3.0-or-later
"""Species in grids: against closed meshes of the same gas, and sums over the cells of a ray in numpy, pass by pass.

As in test_grids, what is not random agrees to the float32 of images: 5e-7 of the brightest, and 4e-6 with meshes, which
are met at distances in float32.
"""

import dataclasses

import numpy as np
import pytest

from addon.solver import Grid, Material, Medium, SceneError, Settings, render
from addon.solver.physics.heat import build_heat_table
from addon.solver.physics.media import band_mean, build_medium_table
from addon.solver.physics.mixtures import place_among_nodes
from addon.solver.physics.molecules import build_molecular_media, species_coefficients
from addon.solver.physics.radiometry import reference_radiance
from addon.solver.physics.soot import soot_curve
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning import preparation
from addon.solver.planning.preparation import prepare
from tests.helpers.grids import (
    atmosphere,
    cells_on_ray,
    draws_of,
    placed,
    random_grid,
    random_rays,
    transmit_all,
    traverse_all,
    turned,
)
from tests.helpers.marks import long
from tests.helpers.scenes import box, look, make_scene, quad

EDGES = np.array([4.2, 4.3, 4.5, 4.8, 5.6])
MIXTURE = {"H2O": 0.125, "CO2": 0.0625, "CO": 0.03125}  # exact in float32
LOW, SIZE, CELLS = np.array([-2.2, -1.4, -6.1]), (4.0, 3.0, 2.0), (20, 17, 13)


def before_a_wall(medium):
    """A black wall at 400 K at z = -10, seen from the origin by a wide camera."""
    return make_scene(
        *quad((0, 0, -10), (10, 0, 0), (0, 10, 0)), 400.0, [Material("black", 1.0)],
        look((0, 0, 0), (0, 0, -1), 8, 6, 0.45), EDGES, media=(medium,),
    )  # fmt: skip


def filled(values):
    """A grid of CELLS in a box; values: of all cells, by quantity."""
    arrays = {name: np.full(CELLS, value) for name, value in values.items()}
    given = {name: arrays.pop(name) for name in ("density", "temperature") if name in arrays}
    return Grid.from_arrays(placed(LOW, LOW + SIZE, CELLS), fractions=arrays, **given)


# Against homogeneous media


@pytest.mark.parametrize("grid, gas", [
    (MIXTURE | {"soot": 2.0**-20, "temperature": 912.0}, {"CO2": 0.9}),
    (MIXTURE, {"soot": 2.0**-20}),
    ({"temperature": 912.0}, MIXTURE | {"soot": 2.0**-20}),
    ({"H2O": 0.125, "temperature": 912.0}, {"CO2": 0.0625, "CO": 0.03125, "soot": 2.0**-20}),
], ids=["grids", "own temperature", "numbers", "both"])  # fmt: skip
def test_a_uniform_grid_is_a_closed_mesh(monkeypatch, grid, gas):
    """Pixel by pixel and pass by pass, with a grey absorption; numbers of species that have grids do not count. Both
    send as many camera rays: rounding may move the plan from one power of two to the next."""
    monkeypatch.setattr(preparation, "choose_samples", lambda variance, *_: np.full(len(variance), 4, np.uint16))
    vertices, triangles = box(SIZE)
    mesh = Medium("gas", 0.02, 912.0, vertices=vertices + LOW, triangles=triangles, gas=MIXTURE | {"soot": 2.0**-20})
    media = mesh, Medium("gas", 0.02, 912.0, gas=gas, grid=filled(grid))
    for index in (0, 3):
        one, other = (render(before_a_wall(each), Settings(passes=1, pass_offset=index)).bands() for each in media)
        np.testing.assert_allclose(other, one, rtol=4e-6)
        assert np.all(np.ptp(one, axis=(1, 2)) > 0.05 * one.max(axis=(1, 2)))


def test_soot_alone_draws_nothing():
    """The mean over the band at the temperature of the cells, in every pass: a slab along its normal."""
    grid = Grid.from_arrays(
        placed((-5, -5, -6), (5, 5, -4), (1, 1, 2)), fractions={"soot": np.full((1, 1, 2), 2.0**-20)},
        temperature=np.array([[[1500.0, 800.0]]]),
    )  # fmt: skip
    scene = before_a_wall(Medium("soot", grid=grid))
    scene = dataclasses.replace(scene, camera=look((0, 0, 0), (0, 0, -1), 4, 3, 1e-4))
    assert prepare(scene, Settings()).molecular is None
    truth = band_radiance(EDGES, 400.0)
    for kelvin in (1500.0, 800.0):
        lost = -np.expm1(-(2.0**-20) * band_mean(*soot_curve(), kelvin, EDGES))
        truth = truth * (1.0 - lost) + lost * band_radiance(EDGES, kelvin)
    bands = render(scene, Settings(passes=1, reference_subtraction=False)).bands().mean(axis=(1, 2)) * np.diff(EDGES)
    np.testing.assert_allclose(bands, truth, rtol=4e-6)


# Against sums over cells in numpy


def gas_grid(seed, kelvin, names, reach=2):
    """Cells of random density and fractions, each 0 in some, at temperatures (n,) that are nodes."""
    grid, rng = random_grid(seed, reach), np.random.default_rng(seed)
    shape = grid.density.shape

    def fraction():
        return (rng.uniform(0.0, 0.2, shape) * (rng.uniform(size=shape) < 0.5)).astype(np.float32)

    return dataclasses.replace(
        grid, temperature=rng.choice(kelvin, shape).astype(np.float32), fractions={name: fraction() for name in names}
    )


def coefficients(medium, molecular, index):
    """A function that tells the absorption and scattering coefficients (b,) of a cell of a medium in a pass."""
    draws, known = draws_of(molecular.sampler, index), {}

    def of(kelvin, density, fractions):
        if kelvin not in known:
            parts = species_coefficients(draws, np.array([kelvin]), medium.pressure, medium.molecules)
            known[kelvin] = {name: part[0] for name, part in parts.items()}
            known[kelvin]["soot"] = band_mean(*soot_curve(), kelvin, EDGES)
        amounts = {name: density * fraction for name, fraction in medium.gas.items()} | fractions
        lines = sum(amount * known[kelvin][name] for name, amount in amounts.items())
        return density * medium.absorption + medium.metres * lines, density * medium.scattering

    return of


def cell_at(medium, ray, limit):
    """Planes between cells, and a function that tells temperature, density and fractions at a distance, None where
    there is no gas."""
    if medium.grid is None:
        return np.empty(0), lambda t: (medium.temperature, 1.0, {})
    grid = medium.grid
    planes, at = cells_on_ray(grid, *ray, limit)
    others = {name: cells_on_ray(dataclasses.replace(grid, density=each), *ray, limit)[1]
              for name, each in grid.fractions.items()}  # fmt: skip

    def of(t):
        density, kelvin = at(t)
        return kelvin, density, {name: each(t)[0] for name, each in others.items()}

    return planes, of


def marched(media, tables, quiet, ray, limit):
    """Radiance and transmittance (b,) of a ray: the sum over all that is constant."""
    reference = reference_radiance(EDGES, quiet)
    parts = [cell_at(medium, ray, limit) for medium in media]
    stops = np.unique(np.concatenate([[0.0, limit], *(planes for planes, _ in parts)]))
    light, through = np.zeros(len(EDGES) - 1), np.ones(len(EDGES) - 1)
    for a, b in zip(stops[:-1], stops[1:], strict=True):
        k, j = np.zeros((2, len(EDGES) - 1))
        for (_, at), table in zip(parts, tables, strict=True):
            kelvin, density, fractions = at(0.5 * (a + b))
            absorption, scattering = table(kelvin, density, fractions)
            k = k + absorption + scattering
            j = j + absorption * (band_radiance(EDGES, kelvin) - reference)
        lost = -np.expm1(-k * (b - a) * np.linalg.norm(ray[1]))
        light, through = (
            light + through * np.where(k > 0.0, j / np.maximum(k, 1e-300), 0.0) * lost,
            through - through * lost,
        )
    return light, through


@pytest.mark.parametrize("media", [
    long((Medium("fractions", 0.05, grid=gas_grid(1, (300.0, 900.0), ("CO2", "H2O"))),)),
    (Medium("numbers", 0.0, gas={"CO": 0.1, "soot": 1e-7}, grid=gas_grid(2, (350.0, 1000.0), ())),),
    (
        Medium("both", 0.1, 0.0, 0.2, gas={"CO2": 0.3, "H2O": 0.1}, grid=gas_grid(3, (300.0, 1200.0), ("CO2", "CO")),
               pressure=2e5, metres=0.5),
        Medium("other", 0.0, grid=gas_grid(4, (400.0, 450.0), ("CH4",))),
        Medium("plain", 0.3, grid=random_grid(5)),
        Medium("air", 0.02, 280.0),
    ),
], ids=["fractions", "numbers", "overlapping"])  # fmt: skip
@pytest.mark.parametrize("quiet", [0.0, long(310.0)])
def test_random_cells_against_a_march_in_numpy(media, quiet):
    """Radiance and transmittance of rays in one pass, where no temperature is between nodes; 5e-7 for float32."""
    (origin, direction), index = random_rays(60), 5
    limit = (10.0 / np.linalg.norm(direction, axis=1)).astype(np.float32)
    arguments = media, EDGES, quiet, reference_radiance(EDGES, quiet)
    table = build_medium_table(*arguments)
    molecular = build_molecular_media(media, table, EDGES, 300.0, 1)
    tracer = atmosphere(media, EDGES, quiet)
    tracer.fill(molecular.table(index), build_heat_table(*arguments))
    air = tracer.cross(origin, direction, limit)
    through, light, power = np.ones((60, 4), np.float32), np.zeros((60, 4), np.float32), np.ones((60, 4), np.float32)
    traverse_all(air, through, light)
    transmit_all(air, power)
    tables = [coefficients(medium, molecular, index) for medium in media]
    rays = zip(origin.astype(float), direction.astype(float), limit, strict=True)
    truth = [marched(media, tables, quiet, (o, d), float(far)) for o, d, far in rays]
    expected, left = (np.array(each) for each in zip(*truth, strict=True))
    scale = np.abs(expected).max(axis=0)
    print("worst", np.max(np.abs(light - expected) / scale), np.max(np.abs(through - left)))
    assert np.mean(left < 0.99) > 0.1 and np.all(np.abs(light - expected) < 5e-7 * scale)
    assert np.all(np.abs(through - left) < 2e-7) and np.all(np.abs(power - through) < 2e-7)


ROOM = (2.0, 3.0, 2.5)


def room_with_a_plume(scattering, kelvin=350.0, walls=350.0):
    """Grey, mirror and rough walls around a turned grid of random density and composition."""
    rng = np.random.default_rng(5)
    vertices, triangles = box(ROOM)
    materials = [Material("grey", 0.3), Material("mirror", 0.2, 1.0), Material("rough", 0.4, 0.7, 0.4)]
    matrix, shape = turned(2), (12, 20, 8)
    matrix[:3, 3] = (1.0, 1.5, 1.2) - matrix[:3, :3] @ (6.0, 10.0, 4.0)
    density = rng.uniform(0, 4, shape) * (rng.uniform(size=shape) < 0.7)
    fractions = {"CO2": rng.uniform(0, 0.2, shape), "soot": rng.uniform(0, 1e-6, shape)}
    grid = Grid.from_arrays(matrix, density, np.broadcast_to(kelvin, shape), fractions)
    plume = Medium("plume", 0.1, 350.0, scattering, gas={"CO": 0.05}, grid=grid)
    return make_scene(
        vertices, triangles[:, ::-1], walls, materials, look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), EDGES,
        np.repeat([0, 1, 2, 0, 0, 0], 2), media=(plume,),
    )  # fmt: skip


@pytest.mark.parametrize("scattering", [0.0, 1.0])
def test_a_room_of_one_temperature_is_black(scattering):
    """Exactly, in every pass: nothing is emitted over the reference."""
    film = render(room_with_a_plume(scattering), Settings(passes=2, photons_per_pass=1000))
    assert np.all(np.abs(film.temperature() - 350.0) < 1e-4)


def test_threads_change_nothing():
    """To the last bit, with photons, scattering and a mixture in cells."""
    kelvin = np.random.default_rng(6).uniform(300.0, 900.0, (12, 20, 8))
    scene = room_with_a_plume(1.0, kelvin, np.repeat([300.0, 350.0, 320.0, 300.0, 400.0, 300.0], 2))
    one, two = (render(scene, Settings(passes=2, photons_per_pass=5000, threads=n)).bands() for n in (1, 3))
    assert np.array_equal(one, two)


# The parts


def test_between_the_nodes():
    """Coefficients between the temperatures of the data, 300 to 2500 K, 11 bands, 64 passes: a metre of gas lets
    through what it does at the exact temperature to 0.012 in each pass and 0.0015 in their mean."""
    edges = np.array([2.5, 3, 3.5, 4.2, 4.5, 5, 6, 8, 10, 12, 14, 20])
    mixture, kelvin = MIXTURE | {"CH4": 0.05}, np.random.default_rng(1).uniform(300.0, 2500.0, 510)
    cells = np.concatenate([[300.0, 2500.0], kelvin]).reshape(1, 8, 8, 8).astype(np.float32)
    fractions = {name: np.full(cells.shape, np.float32(fraction)) for name, fraction in mixture.items()}
    medium = Medium("gas", grid=Grid(np.zeros((1, 3), np.int32), np.eye(4), None, cells, fractions))
    table = build_medium_table((medium,), edges, 0.0, np.zeros(len(edges) - 1))
    molecular = build_molecular_media((medium,), table, edges, 300.0, 1)
    weights, nodes = np.modf(place_among_nodes(medium).ravel()[2:])
    nodes = nodes.astype(int)
    off = {name: [] for name in mixture}
    for index in range(64):
        exact = species_coefficients(draws_of(molecular.sampler, index), kelvin, medium.pressure, medium.molecules)
        of = molecular.table(index).mixtures.absorption
        for c, name in enumerate(medium.components):
            if name in mixture:
                found = of[c, nodes] + weights[:, None] * (of[c, nodes + 1] - of[c, nodes])
                off[name].append(np.exp(-mixture[name] * found) - np.exp(-mixture[name] * exact[name]))
    for name, each in off.items():
        print(f"{name}: {np.abs(each).max():.1e} in a pass, {np.abs(np.mean(each, axis=0)).max():.1e} in the mean")
        assert np.abs(each).max() < 0.012 and np.abs(np.mean(each, axis=0)).max() < 0.0015


def test_grids_without_species_have_no_components():
    """Nor those of one temperature whose gas is given by numbers: their density says all."""
    grid = random_grid(1)
    assert Medium("grey", 1.0, grid=grid).components == ()
    assert Medium("gas", gas=MIXTURE, grid=dataclasses.replace(grid, temperature=None)).components == ()
    assert Medium("gas", gas=MIXTURE, grid=grid).components == ("density",)


def test_instances_share_their_cells():
    """And a grid that is a mixture in one medium and plain in another does not."""
    grid = gas_grid(1, (300.0, 900.0), ("CO2",))
    moved = dataclasses.replace(grid, transform=turned(7))
    air = atmosphere((Medium("a", 1.0, grid=grid), Medium("b", 2.0, grid=moved)), EDGES, 300.0)
    assert air._grids.cells.size == (3 + 2) * grid.density.size
    plain = random_grid(1)
    air = atmosphere((Medium("a", 1.0, grid=plain), Medium("b", gas=MIXTURE, grid=plain)), EDGES, 300.0)
    assert air._grids.cells.size == (2 + 3 + 1) * plain.density.size


def test_leaves_with_species_alone_are_kept():
    water = np.zeros((24, 8, 8))
    water[20, 3, 3] = 0.5
    grid = Grid.from_arrays(np.eye(4), np.zeros(water.shape), fractions={"H2O": water})
    np.testing.assert_array_equal(grid.leaves, [[2, 0, 0]])
    assert np.count_nonzero(grid.holds) == 1 and Medium("gas", 0.0, 300.0, grid=grid).molecules == {"H2O": 0.5}


@pytest.mark.parametrize("name, value, message", [
    ("CO2", -0.1, "Medium 'gas': fraction of CO2 -0.1 in a cell of its grid; it is from 0 to 1"),
    ("H2O", 1.5, "Medium 'gas': fraction of H2O 1.5 in a cell of its grid; it is from 0 to 1"),
    ("soot", np.nan, "Medium 'gas': fraction of soot nan in a cell"),
    ("CH4", np.inf, "Medium 'gas': fraction of CH4 inf in a cell"),
    ("N2O", 0.1, "Medium 'gas': unknown species 'N2O'; known are H2O, CO2, CO, CH4 and soot"),
])  # fmt: skip
def test_bad_fractions_are_named(name, value, message):
    with pytest.raises(SceneError, match=message):
        Medium("gas", 1.0, 300.0, grid=filled({name: value}))
