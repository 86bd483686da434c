# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide of emissions: a probability density over the cube, drawn from exactly, that leaves the mean alone."""

import dataclasses

import numpy as np
import pytest
from numba import njit

from addon.solver import Material, Settings, SunLight, render
from addon.solver.camera import eye_paths
from addon.solver.geometry.interaction import Interaction
from addon.solver.geometry.point_tree import empty_walk
from addon.solver.photons.emission import chosen_numbers
from addon.solver.photons.guide import CELLS, DIMENSIONS, _count, build_gather_tree, build_guide, even_guide
from addon.solver.planning import preparation
from addon.solver.planning.preparation import prepare
from addon.solver.sampling.rng import PHOTONS, pass_key
from tests.helpers.paper_estimator import no_final_gathers
from tests.helpers.scenes import box, look, make_scene, mean_and_error

EDGES = np.array([8.0, 10.0, 12.0])
BOX_LOW, BOX_HIGH = np.array([0.5, 0.25, 0.0, 0.5, 0.75]), np.array([0.75, 0.5, 0.25, 1.0, 1.0])  # 1/4^4/2 of the cube


def guide_for(score, count=16384, seed=1):
    """Guide learnt from an even sample of score(numbers), and its gain."""
    numbers = np.random.default_rng(seed).random((count, DIMENSIONS))
    return build_guide(numbers, score(numbers), np.ones(count))


def in_the_box(numbers):
    return np.all((numbers >= BOX_LOW) & (numbers < BOX_HIGH), axis=1).astype(float)


def peaked(numbers):
    return np.exp(-20.0 * np.sum((numbers - 0.3) ** 2, axis=1))


GUIDES = {
    "even": even_guide,
    "box": lambda: guide_for(in_the_box)[0],
    "peak": lambda: guide_for(peaked)[0],
    "wall": lambda: guide_for(lambda numbers: (numbers[:, 2] > 0.9).astype(float))[0],
    "few samples": lambda: guide_for(peaked, count=100)[0],
}


def cells_of(guide, points):
    """Number of the cell that holds each point, and in how many cells it lies."""
    inside = np.all(
        (points[:, None] >= guide.low) & (points[:, None] < guide.low + guide.size), axis=2
    )  # fmt: skip
    return inside.argmax(axis=1), inside.sum(axis=1)


@pytest.mark.parametrize("name", GUIDES)
def test_guide_is_a_probability_density(name):
    guide = GUIDES[name]()
    n = len(guide.density)
    assert guide.low.shape == guide.size.shape == (n, DIMENSIONS) and 1 <= n <= CELLS
    volume = guide.size.prod(axis=1)
    assert volume.sum() == 1.0  # powers of 2: exact
    assert guide.cumulative[0] == 0.0 and guide.cumulative[-1] == 1.0
    assert np.all(np.diff(guide.cumulative) > 0)
    np.testing.assert_allclose(guide.density * volume, np.diff(guide.cumulative), rtol=1e-9)
    assert np.all(np.diff(guide.low[:, 0]) >= 0)  # in the order of the emitters
    assert guide.density.min() >= 0.5 - 1e-9  # half is spread evenly: a weight is at most 2


@pytest.mark.parametrize("name", GUIDES)
def test_cells_tile_the_cube(name):
    _, times = cells_of(GUIDES[name](), np.random.default_rng(2).random((5000, DIMENSIONS)))
    assert np.all(times == 1)


@pytest.mark.parametrize("name", GUIDES)
def test_numbers_are_drawn_from_the_density(name):
    """Every number lies in the cell whose density it states, and each cell gets its share to 1, as the first ascend."""
    guide, total = GUIDES[name](), 20_000
    numbers, density = chosen_numbers(guide, pass_key(3, 0, PHOTONS), total)
    assert np.all((numbers >= 0) & (numbers < 1))
    cell, times = cells_of(guide, numbers)
    assert np.all(times == 1)
    assert np.array_equal(guide.density[cell], density)
    share = np.bincount(cell, minlength=len(guide.density))
    assert np.all(np.abs(share - total * np.diff(guide.cumulative)) <= 1.0)
    assert np.mean(1.0 / density) == pytest.approx(1.0, abs=len(guide.density) / total)  # volume of the cube


@pytest.mark.parametrize("name", GUIDES)
def test_weighted_numbers_are_even(name):
    """The mean of f / density is the mean of f over the cube, within 4 standard errors."""
    guide, total = GUIDES[name](), 50_000
    numbers, density = chosen_numbers(guide, pass_key(4, 0, PHOTONS), total)
    for dimension in range(DIMENSIONS):
        for power, mean in ((1, 1 / 2), (2, 1 / 3)):
            values = numbers[:, dimension] ** power / density
            assert abs(values.mean() - mean) < 4 * values.std() / np.sqrt(total)
    values = in_the_box(numbers) / density
    assert abs(values.mean() - 2.0**-9) < 4 * max(values.std(), 2.0**-4.5) / np.sqrt(total)


def test_what_matters_is_drawn_more_often():
    """A score of 1 in 1/512 of the cube: half of the density goes there, but for what the prior smooths over."""
    guide, gain = guide_for(in_the_box)
    numbers, density = chosen_numbers(guide, pass_key(5, 0, PHOTONS), 10_000)
    share = in_the_box(numbers).mean()
    print(f"{len(guide.density)} cells, {share:.1%} in the box, gain {gain:.1f}")
    assert share > 0.2  # against 0.2 % evenly
    # root mean square over mean: sqrt(512) = 22.6 at best
    assert 5 < gain < 23
    values = in_the_box(numbers) / density
    assert values.std() < np.sqrt(512) / 512 / 5  # against that of even sampling


def test_learning_goes_on_from_a_guide():
    """Samples of a guide, with their density, teach the same as even ones, and more where it matters."""
    first, _ = guide_for(in_the_box, count=2000)
    numbers, density = chosen_numbers(first, pass_key(6, 0, PHOTONS), 16384)
    second, _ = build_guide(numbers, in_the_box(numbers), density)
    shares = [in_the_box(chosen_numbers(guide, pass_key(7, 0, PHOTONS), 10_000)[0]).mean() for guide in (first, second)]
    print(shares)
    assert shares[1] > shares[0] and shares[1] > 0.3


def test_no_guide_where_all_is_alike():
    guide, gain = guide_for(lambda numbers: np.ones(len(numbers)))
    assert len(guide.density) == 1 and gain == pytest.approx(1.0)
    guide, gain = guide_for(lambda numbers: np.zeros(len(numbers)))
    assert len(guide.density) == 1 and gain == 1.0


@pytest.mark.parametrize("count", [1, 3, 63, 64, 65])
def test_few_samples_do_not_break_it(count):
    guide, gain = guide_for(peaked, count=count)
    assert np.all(np.isfinite(guide.density)) and np.isfinite(gain)
    assert guide.size.prod(axis=1).sum() == 1.0


def test_gathers_are_those_within_reach_that_face_the_same_way():
    """Their number, against a count of all pairs, through what a photon's score is: power times its root."""
    rng = np.random.default_rng(8)
    points, normals = rng.random((2000, 3)), rng.normal(size=(2000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tree = build_gather_tree(points, normals, 0.04)

    @njit
    def count(tree, at):
        return _count(tree, at, empty_walk())

    for _ in range(50):
        point, normal = rng.random(3), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        near = np.sum((points - point) ** 2, axis=1) < 0.04
        point, facing = tuple(point), tuple(normal)
        at = Interaction(0, 0, point, facing, facing, 0, 0.2, 0.3, tuple(-normal), 1.0, 1.0)
        assert count(tree, at) == np.sum(near & (normals @ normal > 0.8))


# In a render


def dark_room(world=150.0, plain=10.0, lights=()):
    """A poorly emitting room under a plain (of this half side, m), lit by a cold sky through a hole in its ceiling."""
    vertices, triangles = box((2.0, 2.0, 1.5))
    vertices, triangles = [vertices], [triangles[:10]]
    a, b = 1.0 - plain, 1.0 + plain
    strips = [(a, a, b, 0.8), (a, 1.2, b, b), (a, 0.8, 0.8, 1.2), (1.2, 0.8, b, 1.2)]
    for x0, y0, x1, y1 in strips:
        triangles.append(np.array([(0, 1, 2), (0, 2, 3)], np.int32) + sum(map(len, vertices)))
        vertices.append(np.array([(x0, y0, 1.5), (x1, y0, 1.5), (x1, y1, 1.5), (x0, y1, 1.5)], float))
    camera = look((0.2, 0.2, 1.3), (1.3, 1.3, 0.2), 12, 9, 0.7)
    vertices, triangles = np.concatenate(vertices), np.concatenate(triangles).astype(np.int32)
    return make_scene(
        vertices, triangles, 290.0, [Material("metal", 0.4)], camera, EDGES, world_temperature=world, lights=lights
    )  # fmt: skip


SUN = SunLight(np.array([0.3, 0.2, -1.0]), 1e6)  # W/m2, so that it outshines the room in these bands
# the sun's photons need a point of a disk, those of the sky one in the room and a direction from there
SCENES = {"sky": dark_room, "sun": lambda: dark_room(290.0, 3.0, (SUN,))}


def without_guide(tracer, stage, emitters, *_):
    return emitters


@pytest.mark.parametrize("name", SCENES)
def test_guide_does_not_change_the_mean(name, monkeypatch):
    """With and without it, within 4 standard errors."""
    scene, settings = SCENES[name](), Settings(passes=96, photons_per_pass=10_000)
    assert len(prepare(scene, settings).emitters.guide.density) > 20
    mean, error = mean_and_error(scene, settings)
    monkeypatch.setattr(preparation, "learn_guide", without_guide)
    assert len(prepare(scene, settings).emitters.guide.density) == 1
    other, other_error = mean_and_error(scene, settings)
    print(f"{mean / other - 1:+.3%} +- {error / mean:.3%} guided, {other_error / mean:.3%} even")
    assert np.hypot(error, other_error) < 0.03 * mean
    assert abs(mean - other) < 4 * np.hypot(error, other_error)


@pytest.mark.parametrize("name, factor", [("sky", 1.0), ("sun", 0.5)])
def test_guide_lowers_the_noise(name, factor, monkeypatch):
    """In the pixels, at equal photons and without rays in their place. Two numbers are learnt better than four."""
    scene, settings = SCENES[name](), Settings(passes=32, photons_per_pass=10_000)
    monkeypatch.setattr(eye_paths, "choose_splits", no_final_gathers)
    guided = np.median(render(scene, settings).noise())
    monkeypatch.setattr(preparation, "learn_guide", without_guide)
    even = np.median(render(scene, settings).noise())
    print(f"{guided:.3f} K guided, {even:.3f} K even")
    assert guided < factor * even


def test_guide_finds_what_few_photons_find():
    """One of 4000 photons of the sun finds the hole: there a guide is worth most."""
    scene = dark_room(290.0, 10.0, (SUN,))
    assert len(prepare(scene, Settings()).emitters.guide.density) > 1


def test_guide_depends_on_the_scene_alone():
    """Neither on the seed nor on the pass: passes rendered elsewhere belong to the same image."""
    guides = [
        prepare(dark_room(), settings).emitters.guide
        for settings in (Settings(), Settings(seed=5, passes=3, pass_offset=9, threads=1))
    ]
    for one, other in zip(*guides, strict=True):
        assert np.array_equal(one, other)


def test_guided_image_is_bit_identical_for_any_number_of_threads():
    scene, settings = dark_room(), Settings(passes=3, photons_per_pass=40_000)
    films = [render(scene, dataclasses.replace(settings, threads=threads)) for threads in (1, 2, 5)]
    for film in films[1:]:
        assert np.array_equal(films[0].radiance(), film.radiance())
        assert np.array_equal(films[0].noise(), film.noise())


def test_guided_pass_ranges_join():
    """Passes 0..3 are the mean of 0..1 and 2..3, to float32 rounding."""
    scene, settings = dark_room(), Settings(passes=2, photons_per_pass=20_000)
    joined = render(scene, settings).merge(render(scene, dataclasses.replace(settings, pass_offset=2)))
    whole = render(scene, dataclasses.replace(settings, passes=4))
    np.testing.assert_allclose(joined.radiance(), whole.radiance(), rtol=2e-7)
    np.testing.assert_allclose(joined.noise(), whole.noise(), rtol=1e-4, atol=1e-5)


def test_no_guide_in_a_closed_room():
    vertices, triangles = box((2.0, 2.0, 1.5))
    temperature = np.repeat([290.0, 300.0, 280.0, 290.0, 310.0, 290.0], 2)
    camera = look((0.2, 0.2, 1.3), (1.3, 1.3, 0.2), 12, 9, 0.7)
    scene = make_scene(vertices, triangles, temperature, [Material("grey", 0.5)], camera, EDGES)
    assert len(prepare(scene, Settings()).emitters.guide.density) == 1
