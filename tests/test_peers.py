# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmarks hand to other renderers is the scene: gas in meshes, in grids, and everywhere; images of
temperatures and mixed materials, thin sheets, smooth surfaces, and skies."""

from dataclasses import replace

import numpy as np
import pytest

from addon.solver import Material, Medium, Sky, Texture
from addon.solver.physics.sky import build_sky_table, fill_sky
from addon.solver.physics.spectrum import band_radiance
from tests.benchmarks.painted_parts import Coat, PaintedParts, random_square, turned_profile
from tests.benchmarks.peers.problem import Problem, build_problem
from tests.helpers.grids import random_grid
from tests.helpers.scenes import box, look, make_scene, quad, sphere
from tests.helpers.traced_textures import build_painted, kelvin_at, mixed_at

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


REFERENCE = 300.0  # K
SHEET = Material("sheet", 0.3, transmittance=0.5)


def random_texture(random, low, high, extension, closest):
    return Texture(random.uniform(low, high, random.integers(2, 9, 2)).astype(np.float32), extension, closest)


def painted(seed, extension="REPEAT", closest=True, material=None):
    """A card with a random image of temperatures, mixed by another, and a ball."""
    random, parts = np.random.default_rng(seed), PaintedParts()
    kelvin = random_texture(random, 280.0, 400.0, extension, closest)
    share = random_texture(random, 0.0, 1.0, extension, closest)
    coat = Coat(random_square(random), kelvin, Material("light", 0.2), share)
    parts.add(quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), 300.0, material or Material("dark", 0.9), coat=coat)
    parts.add(sphere(1, 0.2), REFERENCE, Material("ball", 0.5), (0, -1, 0))
    return parts.scene(look((0, -4, 0), (0, 0, 0), 8, 6, 0.5), EDGES, REFERENCE)


def texel_of(image, uv, wrap):
    """Of an image (h, w, ...) at (u, v), as Mitsuba looks it up."""
    size = np.array(image.shape[1::-1])
    column, row = np.floor(np.asarray(uv, float) * size).astype(int)
    fold = {
        "repeat": lambda i, n: i % n,
        "clamp": lambda i, n: min(max(i, 0), n - 1),
        "mirror": lambda i, n: min(i % (2 * n), 2 * n - 1 - i % (2 * n)),
    }[wrap]
    return image[fold(row, size[1]), fold(column, size[0])]


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "MIRROR"])
@pytest.mark.parametrize("closest", [True, False])
def test_images_are_those_of_the_scene(extension, closest):
    """At random points of a card: excess radiance and share, by the path tracer's look-up. Bilinear values come in
    steps of 1/512 of the image: half a step along both axes changes them by at most 8/512 of what 8 texels differ by,
    120 K or a share of 1; we allow twice that. Points within rounding of a texel's edge may get the neighbour's value.
    """
    scene = painted(3, extension, closest)
    (skin,), random = build_problem(scene, REFERENCE, all_lobes=True).skins, np.random.default_rng(1)
    table, black = build_painted(scene.textures, len(scene.triangles)), band_radiance(EDGES, REFERENCE)
    emissivity = np.array([0.9, 0.2])[:, None]
    off = []
    for triangle, u, v in zip(random.integers(0, 2, 400), *random.uniform(0, 0.5, (2, 400)), strict=True):
        a, b, c = skin.uv[triangle]
        at = a + u * (b - a) + v * (c - a)
        kelvin, (_, share) = kelvin_at(table, triangle, u, v), mixed_at(table, triangle, u, v)
        each = emissivity * (band_radiance(EDGES, np.array([kelvin])) - black)
        expected = (1.0 - share) * each[0] + share * each[1]
        found = texel_of(skin.emission, at, skin.wrap)
        off.append((np.abs(found - expected).max() / black.max(), abs(texel_of(skin.share, at, skin.wrap) - share)))
    off = np.array(off)
    assert skin.share.max() > 0.6 and skin.emission.max() > 0.3 * black.max()  # there is something to be wrong
    if closest:
        assert np.mean(off.max(axis=1) > 1e-5) < 0.01
    else:
        slope = np.ptp(band_radiance(EDGES, np.array([399.0, 400.0])), axis=0).max()  # per kelvin, the steepest
        steps = 2 * 8 / 512 * np.array([0.9 * 120.0 * slope + np.ptp(skin.emission), black.max()]) / black.max()
        assert np.all(off.max(axis=0) < steps)


def test_sheets_and_smooth_surfaces_have_both_sides_once():
    """A film's emission, reflectance and transmittance; normals of a cone, outwards and across its flank."""
    parts = PaintedParts()
    parts.add(quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), 350.0, SHEET)
    *cone, normals = turned_profile([(1.0, 0.0), (0.5, 0.5)], 32)
    parts.add(cone, REFERENCE, Material("mirror", 0.1, specular=1.0), normals=normals)
    parts.add(sphere(1, 0.2), 400.0, Material("ball", 0.5), (0, -3, 0))
    scene = parts.scene(look((0, -4, 1), (0, 0, 0), 8, 6, 0.5), EDGES, REFERENCE)
    problem = build_problem(scene, REFERENCE, all_lobes=True)
    film, smooth = sorted(problem.skins, key=lambda skin: len(skin.corners))
    excess = band_radiance(EDGES, 350.0) - band_radiance(EDGES, REFERENCE)
    np.testing.assert_allclose(film.emission[0, 0], 0.3 * excess, rtol=1e-5)
    np.testing.assert_allclose(film.reflectance, 0.2, rtol=1e-5)
    assert np.all(film.transmittance == 0.5) and film.normals is None and len(film.corners) == 2
    outwards = smooth.corners * (1, 1, 0)
    outwards = outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)
    np.testing.assert_allclose(smooth.normals, (outwards + (0, 0, 1)) / 2**0.5, atol=1e-6)
    assert len(problem.triangles) == np.count_nonzero(scene.material == 2)  # the ball alone
    assert not smooth.emission.any() or np.abs(smooth.emission).max() < 1e-6


def test_a_far_pane_has_a_back():
    """Panes 5 mm before a wall, up to 100 m away: no walk enters most of the gaps, and there the wall would be dark.
    The wall itself has no back, nor has a block that is sunk into it."""
    parts = PaintedParts()
    wall, glass = Material("wall", 0.9), Material("glass", 0.8)
    parts.add(quad((0, 0, 0), (40, 0, 0), (0, 0, 3)), REFERENCE, wall)
    for x in np.arange(-39.0, 40.0, 2.0):
        parts.add(quad((x, -0.005, 0), (0.5, 0, 0), (0, 0, 1)), 350.0, glass)
    parts.add(box((0.5, 0.5, 0.5)), 350.0, wall, (0.7, -0.1, 2))
    scene = parts.scene(look((-60, -20, 0), (0, 0, 0), 8, 6, 0.5), EDGES, REFERENCE)
    problem = build_problem(scene, REFERENCE)
    twins = problem.vertices[problem.triangles[len(scene.triangles) :]]
    assert len(twins) == 2 * 40
    assert np.all((twins[:, :, 1] > -0.005) & (twins[:, :, 1] < -0.0049))
    assert np.all(np.cross(twins[:, 1] - twins[:, 0], twins[:, 2] - twins[:, 0])[:, 1] > 0.0)


@pytest.mark.parametrize(
    "sky",
    [
        Sky(np.array([220.0, 260.0, 290.0]), np.array([0.0, 70.0, 90.0])),
        Sky(np.random.default_rng(2).uniform(220.0, 320.0, (9, 14)).astype(np.float32)),
    ],
    ids=["by angle", "image"],
)
def test_a_sky_is_an_image_of_radiance(sky):
    """At its own places it is what rays of the engine see. By zenith angle to 2e-3, as the engine rounds kinks."""
    image = build_problem(replace(painted(5), sky=sky), REFERENCE, all_lobes=True).sky
    table, random = build_sky_table(sky, EDGES, band_radiance(EDGES, REFERENCE)), np.random.default_rng(4)
    rows, columns = image.shape[:2]
    for row, column in zip(random.integers(0, rows, 300), random.integers(0, columns, 300), strict=True):
        zenith, turn = np.pi * row / (rows - 1), 2.0 * np.pi * (column + 0.5) / columns  # from -x to +y
        seen = np.empty(len(EDGES) - 1)
        fill_sky(table, (-np.sin(zenith) * np.cos(turn), np.sin(zenith) * np.sin(turn), np.cos(zenith)), seen)
        tolerance = 1e-6 if sky.zenith is None else 2e-3
        np.testing.assert_allclose(image[row, column], seen, atol=tolerance * band_radiance(EDGES, REFERENCE).max())


SPECTRAL_SKY = Sky(np.array([[280.0, 270.0]]), np.zeros(1), np.array([8.0, 9.0]))


@pytest.mark.parametrize(
    "scene, message",
    [
        (lambda: painted(1, "CLIP"), "one extension for all images of a surface"),
        (lambda: painted(1, material=Material("film", 0.3, transmittance=ABSORPTION / (1, 5))), "same transmittance"),
        (lambda: replace(painted(1), sky=SPECTRAL_SKY), "skies of the same apparent temperature"),
    ],
)
def test_surfaces_that_peers_cannot_render_are_refused(scene, message):
    with pytest.raises(ValueError, match=message):
        build_problem(scene(), REFERENCE, all_lobes=True)
    with pytest.raises(ValueError, match="skins or a sky"):  # other peers than Mitsuba
        build_problem(scene(), REFERENCE)


def test_smooth_surfaces_do_not_emit():
    parts = PaintedParts()
    *cone, normals = turned_profile([(1.0, 0.0), (0.5, 0.5)], 32)
    parts.add(cone, 350.0, Material("grey", 0.5), normals=normals)
    parts.add(sphere(1, 0.2), REFERENCE, Material("ball", 0.5), (0, -3, 0))
    scene = parts.scene(look((0, -4, 1), (0, 0, 0), 8, 6, 0.5), EDGES, REFERENCE)
    with pytest.raises(ValueError, match="Smooth surfaces are to be at the reference"):
        build_problem(scene, REFERENCE, all_lobes=True)


def everything():
    scene = replace(painted(7), sky=Sky(np.random.default_rng(2).uniform(220.0, 320.0, (9, 14)).astype(np.float32)))
    return build_problem(scene, REFERENCE, all_lobes=True)


@pytest.mark.parametrize(
    "make, prefix",
    [
        (lambda: build_problem(filled()), None),
        (lambda: build_problem(filled(Medium("plume", ABSORPTION, KELVIN, grid=random_grid(3)))), "gas_"),
        (everything, "skin0_"),
    ],
)
def test_problems_travel_in_files(tmp_path, make, prefix):
    problem = make()
    problem.save(tmp_path / "problem.npz")
    arrays, loaded = problem.arrays(), Problem.load(tmp_path / "problem.npz").arrays()
    assert arrays.keys() == loaded.keys()
    assert any(name.startswith(("gas_", "skin")) for name in arrays) == (prefix is not None)
    assert prefix is None or any(name.startswith(prefix) for name in arrays)
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
