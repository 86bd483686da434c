# SPDX-License-Identifier: GPL-3.0-or-later
"""Gas in grids: against closed meshes of the same gas, exact solutions, and sums over the cells of a ray in numpy.

What is not random agrees to the float32 of images, 6e-8 a step: 1e-6 here, after many. Meshes are met at distances in
float32, so that what is compared with them agrees to 4e-6.
"""

import numpy as np
import pytest

from addon.solver import Grid, Material, Medium, SceneError, Settings, render
from addon.solver.physics.constants import C2
from addon.solver.physics.heat import between_nodes, build_heat_table, steps_from_anchor
from addon.solver.physics.media import THIN, absorbed, absorbed_if_thin
from addon.solver.physics.radiometry import reference_radiance
from addon.solver.physics.spectrum import apparent_temperature, band_radiance
from addon.solver.planning import preparation
from tests.benchmarks.speed_scenes import plume_grid
from tests.helpers.grids import (
    atmosphere,
    cells_on_ray,
    placed,
    random_grid,
    random_rays,
    transmit_all,
    traverse_all,
    turned,
)
from tests.helpers.marks import long
from tests.helpers.scenes import box, look, make_scene, mean_and_error, quad

pytestmark = pytest.mark.once

EDGES = np.array([9.99, 10.01])  # um, so that formulas for one wavelength hold
THREE = np.array([3.0, 5.0, 8.0, 12.0])
FLOAT32 = 1e-6


def black(kelvin):
    return float(band_radiance(EDGES, kelvin)[0])


def before_a_wall(*media, wall=0.0, camera=((0, 0, 0), (0, 0, -1)), tangent=1e-3, **options):
    """A black wall of 20 m at z = -10, seen from the origin by a narrow camera."""
    return make_scene(
        *quad((0, 0, -10), (10, 0, 0), (0, 10, 0)), wall, [Material("black", 1.0)],
        look(*camera, 8, 6, tangent), EDGES, media=media, **options,
    )  # fmt: skip


def seen(scene, **settings):
    """Mean radiance of an image without noise."""
    return float(render(scene, Settings(passes=1, **settings)).radiance().mean(dtype=float))


SLAB = (-5.0, -5.0, -6.0), (5.0, 5.0, -4.0)


def slab(absorption, kelvin, cells=(20, 12, 9)):
    """A grid of uniform gas between z = -6 and -4, most of whose leaves are not full."""
    grid = Grid.from_arrays(placed(*SLAB, cells), np.ones(cells), low=(0, 0, 0))
    return Medium("grid", absorption, kelvin, grid=grid)


# Against homogeneous media


@pytest.mark.parametrize("subtraction", [True, False])
@pytest.mark.parametrize("depth", [1e-3, 0.1, 1.0, 30.0])
def test_a_uniform_grid_is_a_slab(depth, subtraction):
    """1 - exp(-tau) of its own, exp(-tau) of the wall behind; the camera's cone makes paths longer by 1e-6."""
    scene = before_a_wall(slab(depth / 2.0, 600.0), wall=300.0)
    truth = black(600.0) * -np.expm1(-depth) + black(300.0) * np.exp(-depth)
    assert seen(scene, reference_subtraction=subtraction) == pytest.approx(truth, rel=4e-6)


def test_a_uniform_grid_is_a_closed_mesh(monkeypatch):
    """Pixel by pixel under oblique rays that cross many leaves, with a second medium that overlaps both. Both send as
    many camera rays: rounding may move the plan from one power of two to the next."""
    monkeypatch.setattr(preparation, "choose_samples", lambda variance, *_: np.full(len(variance), 4, np.uint16))
    vertices, triangles = box((4.0, 3.0, 2.0))
    low = np.array([-2.2, -1.4, -6.1])
    mesh = Medium("mesh", 0.4, 500.0, vertices=vertices + low, triangles=triangles)
    grid = Medium(
        "grid", 0.4, 500.0, grid=Grid.from_arrays(placed(low, low + (4, 3, 2), (40, 17, 33)), np.ones((40, 17, 33)))
    )
    images = [
        render(
            before_a_wall(each, Medium("air", 0.05, 350.0), wall=300.0, tangent=0.45, world_depth=20.0),
            Settings(passes=1),
        ).radiance()
        for each in (mesh, grid)
    ]
    np.testing.assert_allclose(images[1], images[0], rtol=4e-6)
    assert np.ptp(images[0]) > 0.1 * images[0].max()


@pytest.mark.parametrize("position, inside", [((0, 0, -5), 1.0), ((0, 0, -6 + 1e-3), 1e-3), ((0, 0, -7), 0.0)])
def test_the_camera_may_be_inside(position, inside):
    """To the rounding of positions in float32, 5e-7 m here."""
    scene = before_a_wall(slab(1.0, 500.0), camera=(position, (0, 0, -10)))
    assert seen(scene) == pytest.approx(black(500.0) * -np.expm1(-inside), rel=4e-6, abs=5e-7 * black(500.0))


@pytest.mark.long  # random grids beside the path tracer are compared in any case
@pytest.mark.parametrize("albedo", [0.5, 1.0])
def test_a_uniform_grid_scatters_as_a_closed_mesh_does(albedo):
    """Fog in the middle of a room with one hot wall: means within 4 of their errors."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    temperature = np.repeat([400.0, 300.0, 300.0, 300.0, 300.0, 300.0], 2)
    low, size = np.array([0.2, 0.3, 0.1]), np.array([0.6, 0.5, 0.7])
    fog = {"absorption": 4.0 * (1.0 - albedo), "scattering": 4.0 * albedo, "anisotropy": 0.4, "temperature": 350.0}
    walls, inner = box(size)
    grid = Grid.from_arrays(placed(low, low + size, (9, 21, 16)), np.ones((9, 21, 16)))
    found = []
    for medium in (Medium("mesh", vertices=walls + low, triangles=inner, **fog), Medium("grid", grid=grid, **fog)):
        scene = make_scene(
            vertices, triangles[:, ::-1], temperature, [Material("wall", 0.8)],
            look((0.5, 0.01, 0.5), (0.5, 1.0, 0.5), 8, 6, 0.5), EDGES, media=(medium,),
        )  # fmt: skip
        found.append(mean_and_error(scene, Settings(passes=200, photons_per_pass=2000)))
    (one, error), (other, other_error) = found
    print(f"mesh {one / black(300):.5f} +- {error / black(300):.5f}, grid {other / black(300):.5f}")
    assert error < 3e-3 * one and abs(one - other) < 4 * np.hypot(error, other_error)


# Against exact solutions


@pytest.mark.parametrize("tau, truth", [(0.5, 0.606531), (1.0, 1.0), (2.0, 1.432332)])
def test_linear_blackbody_radiance_along_a_slab(tau, truth):
    """B from 2 (near) to 1 (far), in units of a blackbody at 500 K: the error of n cells falls as 1 / n^2."""
    errors = []
    for cells in (8, 16, 32, 64):
        b = 1.0 + (np.arange(cells) + 0.5) / cells  # from far to near
        kelvin = apparent_temperature(black(500.0) * b, EDGES)
        grid = Grid.from_arrays(placed(*SLAB, (1, 1, cells)), temperature=kelvin[None, None])
        errors.append(seen(before_a_wall(Medium("gas", 0.5 * tau, grid=grid))) / black(500.0) - truth)
    print(f"tau {tau}:", " ".join(f"{error:+.1e}" for error in errors))
    assert abs(errors[-1]) < 4e-5
    assert np.all(np.divide(errors[:-2], errors[1:-1]) == pytest.approx(4.0, rel=0.1))


ROOM = (2.0, 3.0, 2.5)


def isothermal_room(scattering):
    """Grey, mirror and rough walls around a turned grid of random density, all at 350 K."""
    rng = np.random.default_rng(5)
    vertices, triangles = box(ROOM)
    materials = [Material("grey", 0.3), Material("mirror", 0.2, 1.0), Material("rough", 0.4, 0.7, 0.4)]
    matrix = turned(2)
    matrix[:3, 3] = (1.0, 1.5, 1.2) - matrix[:3, :3] @ (6.0, 10.0, 4.0)
    density = rng.uniform(0, 4, (12, 20, 8)) * (rng.uniform(size=(12, 20, 8)) < 0.7)
    grid = Grid.from_arrays(matrix, density, np.full(density.shape, 350.0))
    return make_scene(
        vertices, triangles[:, ::-1], 350.0, materials, look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), EDGES,
        np.repeat([0, 1, 2, 0, 0, 0], 2), media=(Medium("plume", 1.0, 350.0, scattering, grid=grid),),
    )  # fmt: skip


@pytest.mark.parametrize("scattering", [0.0, 1.0])
def test_a_grid_at_the_reference_temperature_is_black(scattering):
    """Exactly: nothing is emitted, so that each pixel is a blackbody at T0."""
    film = render(isothermal_room(scattering), Settings(passes=1, photons_per_pass=1000))
    assert np.all(np.abs(film.temperature() - 350.0) < 1e-4)


@pytest.mark.parametrize(
    "settings",
    [long({"reference_subtraction": False}), {"reference_temperature": 400.0}],
)
@pytest.mark.parametrize("scattering", [0.0, 1.0])
def test_a_grid_of_one_temperature_is_black(scattering, settings):
    """Without the subtraction, and with a wrong T0: the mean within 4 of its errors."""
    scene = isothermal_room(scattering)
    mean, error = mean_and_error(scene, Settings(passes=64, photons_per_pass=10_000, **settings))
    print(f"{mean / black(350.0) - 1:+.3%} +- {error / mean:.3%}")
    assert abs(mean - black(350.0)) < 4 * error + FLOAT32 * mean and error < 0.01 * mean


@pytest.mark.parametrize("t0", [0.0, 280.0, 500.0])
def test_a_black_room_of_one_temperature_with_a_grid(t0):
    """Black walls reflect nothing, so whatever T0 is, each pixel has the radiance of the walls to float32."""
    scene = isothermal_room(0.0)
    black_room = make_scene(
        scene.vertices, scene.triangles, 350.0, [Material("black", 1.0)], scene.camera, EDGES, media=scene.media
    )
    settings = {"reference_temperature": t0} if t0 else {"reference_subtraction": False}
    image = render(black_room, Settings(passes=1, **settings)).radiance()
    np.testing.assert_allclose(image, black(350.0), rtol=FLOAT32)


# Against sums over cells in numpy


def marched(media, edges, quiet, ray, limit):
    """Radiance and transmittance (b,) of a ray: the sum over all that is constant, media without a grid everywhere."""
    reference, (origin, direction) = reference_radiance(edges, quiet), ray
    parts = [None if m.grid is None else cells_on_ray(m.grid, origin, direction, limit) for m in media]
    stops = np.unique(np.concatenate([[0.0, limit], *(part[0] for part in parts if part)]))
    light, through = np.zeros(len(edges) - 1), np.ones(len(edges) - 1)
    length = np.linalg.norm(direction)
    for a, b in zip(stops[:-1], stops[1:], strict=True):
        k, j = 0.0, 0.0
        for medium, part in zip(media, parts, strict=True):
            density, kelvin = part[1](0.5 * (a + b)) if part else (1.0, medium.temperature)
            if density > 0.0:
                k = k + density * medium.absorption + density * medium.scattering
                j = j + density * medium.absorption * (band_radiance(edges, kelvin) - reference)
        lost = -np.expm1(-k * (b - a) * length)
        light, through = light + through * (j / k * lost if k > 0.0 else 0.0), through * (1.0 - lost)
    return light, through


@pytest.mark.parametrize("media", [
    (Medium("one", 0.8, grid=random_grid(1)),),
    (Medium("thick", 60.0, grid=random_grid(2)),),
    (Medium("sparse", 0.5, 0.0, 0.3, grid=random_grid(3, reach=6, filled=0.02)),),
    (Medium("one", 0.8, grid=random_grid(4)), Medium("two", 0.3, grid=random_grid(5)), Medium("air", 0.02, 280.0)),
], ids=["one", "thick", "sparse", "overlapping"])  # fmt: skip
@pytest.mark.parametrize("quiet", [0.0, long(310.0)])
def test_random_grids_against_a_march_in_numpy(media, quiet):
    """Radiance and transmittance of rays; 5e-7 for float32 and its temperatures."""
    (origin, direction), centre = random_rays(120), np.array([0.3, -0.2, 0.1])
    limit = (10.0 / np.linalg.norm(direction, axis=1)).astype(np.float32)
    air = atmosphere(media, THREE, quiet, centre).cross(origin, direction, limit)
    through, light = np.ones((120, 3), np.float32), np.zeros((120, 3), np.float32)
    traverse_all(air, through, light)
    power = np.ones((120, 3), np.float32)
    transmit_all(air, power)
    rays = list(zip(origin.astype(float) + centre, direction.astype(float), strict=True))
    truth = [marched(media, THREE, quiet, ray, float(far)) for ray, far in zip(rays, limit, strict=True)]
    expected, left = (np.array(each) for each in zip(*truth, strict=True))
    scale = np.abs(expected).max(axis=0)
    print("worst", np.max(np.abs(light - expected) / scale), np.max(np.abs(through - left)))
    assert np.mean(left < 0.99) > 0.1 and np.all(np.abs(light - expected) < 5e-7 * scale)
    assert np.all(np.abs(through - left) < 2e-7) and np.all(np.abs(power - through) < 2e-7)


def test_the_benchmarks_plume_through_the_camera():
    """Pixels that show it before a black wall, to its rim. They are small, and are compared with the ray in their
    middle, so cells' edges in them count."""
    grid, eye = plume_grid(64), np.array([0.4, 0.35, 1.7])
    worst = []
    for u, v, w in np.random.default_rng(0).uniform(0.15, 0.85, (16, 3)):
        target = grid.matrix[:3] @ [64 * u, 64 * v, 64 * w, 1.0]
        away = (target - eye) / np.linalg.norm(target - eye)
        x = np.cross(away, (0, 0, 1))
        scene = make_scene(
            *quad(eye + 6 * away, 9 * x, 9 * np.cross(x, away)), 294.0, [Material("black", 1.0)],
            look(eye, target, 2, 2, 1e-6), EDGES, media=(Medium("plume", 0.8, grid=grid),),
        )  # fmt: skip
        light, through = marched(scene.media, EDGES, 0.0, (eye, away), 6.0)
        assert through[0] < 0.999
        worst.append(abs(seen(scene) / (light[0] + through[0] * black(294.0)) - 1))
    print("worst", max(worst))
    assert max(worst) < 1e-5


def test_empty_space_is_crossed_in_few_steps():
    """Two leaves 4000 cells apart: what lies between counts as one stop, and the gas of both is there."""
    leaves = np.array([[0, 0, 0], [500, 0, 0]], np.int32)
    matrix = np.diag([0.01, 1.0, 1.0, 1.0])
    matrix[:3, 3] = 0.0, -4.0, -4.0
    medium = Medium("two", 1.0, 400.0, grid=Grid(leaves, matrix))
    air = atmosphere((medium,), THREE, 0.0).cross(
        np.float32([[-1.0, 0.1, 0.2]]), np.float32([[2.0, 0.0, 0.0]]), np.float32([100.0])
    )
    power = np.ones((1, 3), np.float32)
    transmit_all(air, power)
    np.testing.assert_allclose(power, np.exp(-0.16), rtol=FLOAT32)


# The parts


@pytest.mark.parametrize("quiet", [0.0, 230.0, 293.15, 350.0])
def test_the_heat_table_is_exact_to_1e_5_of_the_excess(quiet):
    """From 200 to 2500 K in bands from 2 um on, where x = c2 / (lambda T) is below 25; the reference is a float32, 6e-8
    of it. At T0 the excess is exactly 0, and below x = 16, in the thermal infrared, the error is below 2e-6."""
    edges, quiet = np.array([2.9, 3.1, 5.0, 8.0, 12.0, 14.0]), float(np.float32(quiet))
    rng = np.random.default_rng(1)
    kelvin = np.concatenate([[200.0, 2500.0], rng.uniform(200, 2500, 506)]).astype(np.float32)
    if quiet:
        kelvin[2:200] = quiet * (1.0 + np.logspace(-6, -1, 198) * rng.choice([-1, 1], 198))
        kelvin[200] = quiet
    kelvin = np.maximum(kelvin, np.float32(C2 / (25.0 * 2.9)))
    medium = Medium("gas", 1.0, grid=Grid(np.zeros((1, 3), np.int32), np.eye(4), None, np.resize(kelvin, (1, 8, 8, 8))))
    reference = reference_radiance(edges, quiet)
    heat = build_heat_table((medium,), edges, quiet, reference)
    steps = steps_from_anchor(heat, medium).ravel()[: len(kelvin)].astype(float)
    found = []
    for step in steps:
        row, (h0, d0, h1, d1) = between_nodes(heat, step)
        found.append(
            h0 * heat.excess[row] + d0 * heat.slope[row] + h1 * heat.excess[row + 1] + d1 * heat.slope[row + 1]
        )
    truth = band_radiance(edges, kelvin.astype(float)) - band_radiance(edges, quiet)
    error = np.abs(found - truth) - np.abs(reference - band_radiance(edges, quiet))  # without what rounds the reference
    x = C2 / (edges[:-1] * kelvin[:, None])
    print("worst", np.max(error / np.maximum(np.abs(truth), 1e-300)))
    assert np.all(error <= 1e-5 * np.abs(truth)) and np.all(error[x < 16] <= 2e-6 * np.abs(truth[x < 16]))
    if quiet:
        assert steps[200] == 0.0 and np.all(heat.excess[-heat.coldest] == 0.0)


def test_what_is_absorbed():
    """To 1e-9 of it, and to 2e-14 of all."""
    depth = np.logspace(-12, 3, 3000)
    truth = -np.expm1(-depth)
    error = np.abs([absorbed(each) for each in depth] - truth)
    assert np.all(error <= np.maximum(1e-9 * truth, 2e-14)) and absorbed(0.0) == absorbed_if_thin(0.0) == 0.0
    thin = depth < THIN
    assert np.all(np.abs([absorbed_if_thin(each) for each in depth[thin]] - truth[thin]) <= 1e-9 * truth[thin])


def test_arrays_become_leaves():
    """At any first cell: each cell keeps its value, and leaves without gas are left out."""
    rng = np.random.default_rng(3)
    low, shape = np.array([-11, 5, 16]), (30, 9, 8)
    density, kelvin, water = rng.uniform(0.1, 1, shape), rng.uniform(300, 400, shape), rng.uniform(0, 1, shape)
    density[:11] = water[:11] = 0.0  # up to cell -1: the leaves before the origin
    grid = Grid.from_arrays(np.eye(4), density, kelvin, {"H2O": water}, tuple(low))
    assert grid.leaves[:, 0].min() == 0 and len(grid.leaves) == 3 * 2 * 1
    back = {name: np.zeros(shape) for name in ("density", "kelvin", "water")}
    values = {"density": grid.density, "kelvin": grid.temperature, "water": grid.fractions["H2O"]}
    for leaf, corner in enumerate(8 * grid.leaves):
        for offset in np.ndindex(8, 8, 8):
            at = tuple(corner + offset - low)
            if all(0 <= a < n for a, n in zip(at, shape, strict=True)):
                for name in back:
                    back[name][at] = values[name][leaf][offset]
            else:
                assert grid.density[leaf][offset] == 0.0
    for name, given in (("density", density), ("kelvin", kelvin), ("water", water)):
        np.testing.assert_array_equal(back[name][11:], given[11:].astype(np.float32))


def test_instances_share_their_cells():
    """But not those whose own temperature differs."""
    grid = random_grid(1)
    plain = Grid(grid.leaves, grid.transform, grid.density)
    air = atmosphere([Medium("gas", 1.0, kelvin, grid=plain) for kelvin in (300.0, 400.0, 300.0)], THREE, 300.0)
    assert air._grids.cells.size == 2 * 2 * grid.density.size
    moved = Grid(grid.leaves, turned(7), grid.density, grid.temperature)
    air = atmosphere((Medium("a", 1.0, grid=grid), Medium("b", 2.0, grid=moved)), THREE, 300.0)
    assert air._grids.cells.size == 2 * grid.density.size


def test_threads_change_nothing():
    """To the last bit, with photons, scattering and gas in cells."""
    scene = isothermal_room(1.0)
    hot = make_scene(
        scene.vertices, scene.triangles, np.repeat([300.0, 350.0, 320.0, 300.0, 400.0, 300.0], 2),
        [Material("grey", 0.5)], scene.camera, THREE, media=scene.media,
    )  # fmt: skip
    one, two = (render(hot, Settings(passes=2, photons_per_pass=5000, threads=n)).bands() for n in (1, 3))
    assert np.array_equal(one, two)


LEAF = np.zeros((1, 3), np.int32)
FULL = np.ones((1, 8, 8, 8), np.float32)


@pytest.mark.parametrize("values, message", [
    ({"density": -FULL}, "Medium 'gas': density -1 in a cell of its grid; it is finite and at least 0"),
    ({"density": np.inf * FULL}, "Medium 'gas': density inf in a cell"),
    ({"temperature": np.nan * FULL}, "Medium 'gas': temperature nan in a cell of its grid; it is from 0 to 1e+06"),
    ({"temperature": 2e6 * FULL}, "Medium 'gas': temperature 2e\\+06 in a cell"),
    ({"fractions": {"H2O": 2 * FULL}}, "Medium 'gas': fraction of H2O 2 in a cell of its grid; it is from 0 to 1"),
    ({"density": FULL[0]}, "Medium 'gas': density has shape"),
    ({"leaves": np.zeros((0, 3), np.int32)}, "Medium 'gas': a grid needs leaves"),
    ({"leaves": np.zeros((2, 3), np.int32)}, "Medium 'gas': a leaf of its grid is given twice"),
    ({"leaves": np.array([[0, 0, 0], [9000, 9000, 9000]])}, "Medium 'gas': the leaves of its grid are scattered over"),
    ({"transform": np.diag([1.0, 1.0, 0.0, 1.0])}, "Medium 'gas': the transform of its grid is flat"),
    ({"transform": np.full((4, 4), np.nan)}, "Medium 'gas': the transform of a grid is a finite matrix"),
])  # fmt: skip
def test_bad_grids_are_named(values, message):
    with pytest.raises(SceneError, match=message.replace("(", "\\(").replace("1e+06", "1e\\+06")):
        Medium("gas", 1.0, 300.0, grid=Grid(**{"leaves": LEAF, "transform": np.eye(4), **values}))


def test_a_medium_fills_a_mesh_or_a_grid():
    vertices, triangles = box((1.0, 1.0, 1.0))
    with pytest.raises(SceneError, match="Medium 'gas': a medium fills a mesh or a grid, not both"):
        Medium("gas", 1.0, 300.0, vertices=vertices, triangles=triangles, grid=Grid(LEAF, np.eye(4)))
