# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups: a render that is recombined for other temperatures is the render at these temperatures."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Film, Material, Medium, PointLight, Scene, SceneError, Settings, render
from addon.solver.checkpoint import load, render_with_checkpoints
from addon.solver.image.recombine import layered_image, read_series
from addon.solver.physics.layers import (
    LEAST_EXCESS,
    SINGLE,
    Layer,
    from_json,
    layer_factors,
    scene_layers,
    to_json,
    trace_apart,
)
from addon.solver.physics.radiometry import build_radiometry
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.preparation import prepare
from tests.helpers.scenes import box, join, look, quad, sphere

EDGES = np.array([3.0, 5.0, 8.0, 10.0, 14.0])
QUICK = Settings(passes=3, photons_per_pass=2000, threads=2)
NARROW = np.array([[4.0, 0.9], [9.0, 0.3], [12.0, 0.8]])  # um, emissivity: changes within each band
STEPS = np.array([[5.0, 0.9], [8.0, 0.9], [8.0 + 1e-9, 0.4], [14.0, 0.4]])  # constant within all bands but none


def grouped(parts, groups, materials, camera, world=0.0, world_group=-1, **options):
    """Scene of parts (vertices, triangles, temperature, material, group); groups: their names."""
    vertices, triangles, temperature, material = join(*(part[:4] for part in parts))
    group = np.concatenate([np.full(len(part[1]), part[4], np.int16) for part in parts])
    return Scene(
        vertices, triangles, material, temperature.astype(np.float32), materials, camera, options.pop("edges", EDGES),
        world, groups=groups, group=group, world_group=world_group, **options,
    )  # fmt: skip


def at(scene, **temperatures):
    """The same scene with groups at other temperatures (K)."""
    kelvin, world = scene.temperature.copy(), scene.world_temperature
    for name, value in temperatures.items():
        kelvin[scene.group == scene.groups.index(name)] = value
        world = value if scene.world_group == scene.groups.index(name) else world
    return dataclasses.replace(scene, temperature=kelvin, world_temperature=world)


def ungrouped(scene):
    return dataclasses.replace(scene, groups=(), group=None, world_group=-1)


def ball(radius, centre):
    points, triangles = sphere(1, radius)
    return points + centre, triangles


def room(size=(16, 12)):
    """Closed and grey: walls in no group, a heater, a person and a window, which is at the walls' temperature."""
    walls, heater = box((4.0, 3.0, 2.5)), quad((2.0, 2.9, 0.6), (0.8, 0, 0), (0, 0, 0.4))
    window = quad((3.9, 1.5, 1.4), (0, 0.6, 0), (0, 0, 0.5))
    parts = (*walls, 293.0, 0, -1), (*heater, 340.0, 1, 0), (*ball(0.4, (2.0, 1.2, 1.0)), 306.0, 1, 1)
    materials = Material("Wall", 0.7), Material("Paint", 0.9)
    camera = look((0.2, 0.2, 1.6), (2.5, 2.0, 1.0), *size, 0.9)
    return grouped((*parts, (*window, 293.0, 0, 2)), ("heater", "person", "window"), materials, camera)


def outside(**options):
    """A floor that shines and scatters under a sky that is a group; a warm ball stands on it."""
    floor = quad((0.0, 0.0, 0.0), (2.0, 0, 0), (0, 2.0, 0))
    parts = (*floor, 290.0, 0, -1), (*ball(0.5, (0.0, 0.0, 0.6)), 320.0, 1, 1)
    materials = Material("Floor", 0.5, 0.5, 0.3), Material("Ball", 0.6, 1.0, 0.0)
    camera = look((-3.0, -2.0, 1.5), (0.0, 0.0, 0.3), 16, 12, 0.5)
    return grouped(parts, ("sky", "ball"), materials, camera, 250.0, 0, **options)


def plume():
    """A black wall in a group behind 1 m of gas in none."""
    wall, (vertices, triangles) = quad((0, 0, -3), (5, 0, 0), (0, 5, 0)), box((10.0, 10.0, 1.0))
    gas = Medium("gas", 0.7, 600.0, vertices=vertices + (-5, -5, -2), triangles=triangles)
    materials, camera = (Material("Wall", 1.0),), look((0, 0, 0), (0, 0, -1), 4, 3, 1e-3)
    return grouped(((*wall, 300.0, 0, 0),), ("wall",), materials, camera, media=(gas,))


def lamp():
    """A small hot part over a floor, which shadow rays are sent to, and a light, which is in no group."""
    floor = quad((0.0, 0.0, 0.0), (2.0, 0, 0), (0, 2.0, 0))
    parts = (*floor, 290.0, 0, 0), (*ball(0.05, (0.5, 0.0, 0.8)), 900.0, 1, 1)
    camera = look((-3.0, -2.0, 1.5), (0.0, 0.0, 0.3), 16, 12, 0.5)
    light = PointLight(np.array([-0.5, 0.0, 1.0]), 100.0, 0.02)
    materials = Material("Floor", 0.5, 0.3, 0.4), Material("Part", 0.9)
    return grouped(parts, ("floor", "part"), materials, camera, 290.0, lights=(light,))


def spectral():
    """Balls whose emissivities change within bands, over a grey floor; all they reflect is at the reference."""
    floor = quad((0.0, 0.0, 0.0), (2.0, 0, 0), (0, 2.0, 0))
    left, right = ball(0.4, (0.0, 0.8, 0.8)), ball(0.4, (0.0, -0.8, 0.8))
    parts = (*floor, 290.0, 0, -1), (*left, 330.0, 1, 0), (*right, 330.0, 2, 0)
    materials = Material("Floor", 0.4), Material("Glass", NARROW), Material("Paint", 0.9)
    camera = look((-3.0, 0.0, 1.5), (0.0, 0.0, 0.3), 16, 12, 0.5)
    return grouped(parts, ("hot",), materials, camera, 290.0)


CASES = {
    "room": (room, {"heater": 420.0, "person": 280.0, "window": 250.0}, {}),
    "sky": (outside, {"sky": 285.0, "ball": 400.0}, {}),
    "without reference": (outside, {"sky": 200.0, "ball": 350.0}, {"reference_subtraction": False}),
    "lamp": (lamp, {"floor": 310.0, "part": 600.0}, {}),
    "spectra": (spectral, {"hot": 450.0}, {}),
}


@pytest.mark.parametrize("name", CASES)
def test_recombined_is_a_fresh_render(name):
    """The means of several renders agree within 4 standard errors in each band, a small part of what has changed.

    Pixels: the squared difference over that expected is 1 on average, n / (n - 2) as its size is known from a few
    renders only (Student's t of n degrees of freedom). Pixels share photons, so they tell it to a factor of two.
    """
    build, temperatures, options = CASES[name]
    scene, count = build(), 8
    fresh = ungrouped(at(scene, **temperatures))
    new, old = [], []
    for seed in range(count):
        settings = Settings(passes=3, photons_per_pass=2000, seed=seed, threads=1, **options)
        new.append(layered_image(render(scene, settings)).recombined(temperatures))
        old.append(render(fresh, dataclasses.replace(settings, seed=1000 + seed)).bands())
    new, old = np.array(new, float), np.array(old, float)  # (renders, b, h, w)
    means = [images.mean(axis=(2, 3)) for images in (new, old)]
    error = np.sqrt(sum(mean.var(axis=0, ddof=1) / count for mean in means))
    difference = means[0].mean(axis=0) - means[1].mean(axis=0)
    change = np.abs(means[1].mean(axis=0) - render(ungrouped(scene), QUICK).bands().mean(axis=(1, 2)))
    print(name, (difference / error).round(2), (error / change).round(4))
    assert np.all(error < 0.05 * change)
    assert np.all(np.abs(difference) < 4 * error)
    spread = (new.var(axis=0, ddof=1) + old.var(axis=0, ddof=1)) / count
    noisy = spread > (1e-6 * old.mean(axis=0)) ** 2  # the others are exact: they show what is seen directly
    squares = (new.mean(axis=0) - old.mean(axis=0))[noisy] ** 2 / spread[noisy]
    degrees = 2 * (count - 1)
    print(f"{squares.mean():.2f}, expected {degrees / (degrees - 2):.2f}")
    assert 0.5 < squares.mean() * (degrees - 2) / degrees < 2.0


@pytest.mark.parametrize("build", [room, outside, lamp, spectral])
def test_recombined_for_its_own_temperatures_is_the_render(build):
    """To float32's rounding of each layer and band: 6e-8 of the largest of them."""
    film = render(build(), QUICK)
    image = layered_image(film)
    for temperatures in (None, image.temperatures):
        bands = image.recombined(temperatures)
        largest = np.abs(image.excess).max() + film.bands().max()
        np.testing.assert_allclose(bands, film.bands(), rtol=1.2e-7, atol=6e-8 * len(film.layers) * largest)
        radiance = image.radiance(bands)
        np.testing.assert_allclose(radiance, film.radiance(), rtol=1e-6)
        np.testing.assert_allclose(image.temperature(radiance), film.temperature(), rtol=1e-6)


def test_what_is_seen_directly_is_exact():
    """Black surfaces reflect nothing: recombined pixels that show but one are its blackbody at once."""
    parts = (*quad((0, 0, 0), (9, 0, 0), (0, 9, 0)), 300.0, 0, 0), (*quad((9, 0, 1), (9, 0, 0), (0, 9, 0)), 300.0, 0, 1)
    camera = look((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 8, 8, 0.4)
    scene = grouped(parts, ("low", "high"), (Material("Black", 1.0),), camera, 300.0)
    image = layered_image(render(scene, QUICK))
    assert image.layers[1].traced >= 300.0 + LEAST_EXCESS  # all is at the reference
    for kelvin in (0.0, 250.0, 300.0, 1200.0):
        bands = image.recombined({"low": kelvin})
        expected = band_radiance(EDGES, kelvin) / np.diff(EDGES)
        black = band_radiance(EDGES, 300.0).max()
        np.testing.assert_allclose(bands[:, 4, 1], expected, rtol=1e-5, atol=1e-6 * black)


def test_without_groups_there_is_one_layer():
    film = render(ungrouped(room()), QUICK)
    model = prepare(ungrouped(room()), QUICK)
    assert (
        to_json(film.layers) == to_json(SINGLE) and model.stage.surfaces.layer.size == 0 and not model.optics.keep_layer
    )
    assert film.layer_means().shape == (16 * 12, 4)


def test_groups_far_from_the_reference_change_little_but_the_sums():
    """With no group near the reference the same photons fly: the image is the same but for the order of additions."""
    scene = at(room(), window=280.0)
    settings = dataclasses.replace(QUICK, reference_temperature=293.0)
    with_groups, without = render(scene, settings), render(ungrouped(scene), settings)
    assert with_groups.photons == without.photons and len(with_groups.layers) == 4
    np.testing.assert_allclose(with_groups.bands(), without.bands(), rtol=2e-6)
    np.testing.assert_allclose(with_groups.noise(), without.noise(), rtol=2e-3)


def test_layers_do_not_depend_on_threads():
    for build in (outside, lamp):
        films = [render(build(), dataclasses.replace(QUICK, threads=threads)) for threads in (1, 3)]
        assert np.array_equal(films[0].layer_means(), films[1].layer_means())
        assert np.array_equal(films[0].noise(), films[1].noise())


def test_resumed_layers_are_those_of_a_render_without_a_break(tmp_path):
    scene, path = room(), tmp_path / "room.npz"
    whole = render(scene, QUICK)
    passes = []
    render_with_checkpoints(scene, QUICK, passes.append, lambda: len(passes) == 2, path=path, interval=1e9)
    saved = load(path, scene, QUICK)
    assert saved.passes == 2 and to_json(saved.layers) == to_json(whole.layers)
    film = render_with_checkpoints(scene, QUICK, path=path, interval=1e9, saved=saved)
    assert np.array_equal(film.layer_means(), whole.layer_means()) and np.array_equal(film.noise(), whole.noise())


def test_merged_layers_are_those_of_all_passes():
    scene = outside()
    parts = [render(scene, dataclasses.replace(QUICK, passes=n, pass_offset=first)) for n, first in ((1, 0), (2, 1))]
    merged, whole = parts[0].merge(parts[1]), render(scene, QUICK)
    np.testing.assert_allclose(merged.layer_means(), whole.layer_means(), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(merged.noise(), whole.noise(), rtol=1e-5)
    with pytest.raises(ValueError, match="temperature groups cannot be merged"):
        merged.merge(render(ungrouped(scene), dataclasses.replace(QUICK, pass_offset=9)))


# Layers and their factors


def test_a_group_has_a_layer_for_each_spectrum():
    layers, layer = scene_layers(spectral())
    assert [(each.group, each.material) for each in layers] == [("", ""), ("hot", ""), ("hot", "Glass")]
    assert layer.tolist() == [0] * 2 + [2] * 80 + [1] * 80
    scene = dataclasses.replace(spectral(), materials=(Material(), Material("Steps", STEPS), Material("Paint", 0.9)))
    edges = np.array([5.0, 8.0, 14.0])
    assert len(scene_layers(dataclasses.replace(scene, band_edges=edges))[0]) == 3  # the step is inside a band
    same = (Material(), Material("Glass", NARROW), Material("Pane", NARROW))
    assert len(scene_layers(dataclasses.replace(spectral(), materials=same))[0]) == 2


def test_groups_near_the_reference_are_traced_apart():
    layers = (Layer(), *(Layer("a", temperature=kelvin, traced=kelvin) for kelvin in (0.0, 281.0, 300.0, 309.0, 320.0)))
    assert [each.traced for each in trace_apart(layers, 300.0)] == [0.0, 0.0, 281.0, 310.0, 310.0, 320.0]


def test_factors_are_ratios_of_what_surfaces_emit():
    """Of the tables that photons are emitted by, to their interpolation: 4e-8 of what is emitted."""
    materials = Material("Grey", 0.6), Material("Glass", NARROW)
    tables = build_radiometry(materials, EDGES, (250.0, 900.0), 300.0, 290.0)
    temperatures = np.exp(tables.log_start + 0.004 * np.arange(tables.emission.shape[1]))
    rows = [np.argmin(np.abs(temperatures - kelvin)) for kelvin in (310.0, 600.0)]
    cold, hot = temperatures[rows]
    for index, material in enumerate(materials):
        curve = material.curve if index else Layer().curve
        layers = (Layer(), Layer("a", "", curve, cold, cold))
        emitted = tables.emission[index, rows] - tables.base[index]
        factors = layer_factors(layers, EDGES, 290.0, {"a": hot})
        np.testing.assert_allclose(factors[1], emitted[1] / emitted[0], rtol=1e-5)
        assert np.all(factors[0] == 1.0)
    assert np.all(layer_factors(layers, EDGES, 290.0, {"a": 290.0})[1] == 0.0)


@pytest.mark.parametrize(
    "temperatures, message",
    [
        ({"engine": 300.0}, "no temperature group 'engine', only 'heater', 'person', 'window'"),
        ({"heater": float("nan")}, "group 'heater': temperature nan K"),
        ({"person": -1.0}, "group 'person': temperature -1 K"),
        ({"person": 1e9}, "at most 1e"),
    ],
)
def test_impossible_temperatures_are_named(temperatures, message):
    layers, _ = scene_layers(room())
    with pytest.raises(SceneError, match=message):
        layer_factors(layers, EDGES, 293.0, temperatures)


def test_a_group_rendered_too_cold_cannot_be_scaled():
    """At 20 K a blackbody sends e^-240 of what it sends at 300 K in the shortest band: nothing, in float32."""
    layers = (Layer(), Layer("ice", temperature=20.0, traced=20.0))
    assert np.all(layer_factors(layers, EDGES, 0.0) == 1.0)
    with pytest.raises(SceneError, match="'ice' was rendered at 20 K, where its bands hold no radiance to scale up to"):
        layer_factors(layers, EDGES, 0.0, {"ice": 300.0})


def test_layers_survive_as_text():
    layers = trace_apart(scene_layers(spectral())[0], 290.0)
    again = from_json(to_json(layers))
    for one, other in zip(layers, again, strict=True):
        assert one._replace(curve=None) == other._replace(curve=None)
        assert np.array_equal(one.curve, other.curve)


@pytest.mark.parametrize(
    "change",
    ["[]", "{}", "3", "nonsense", '[{"group": 1}]', '[{"group": "a"}]', '[{}, {"group": "a", "traced": NaN}]',
     '[{}, {"group": "a", "curve": [[2, 1], [0.5, 0.5]]}]', '[{}, {}]', '[{"curve": [[1], ["a"]]}]'],
)  # fmt: skip
def test_text_that_is_no_layers_is_refused(change):
    with pytest.raises(ValueError):
        from_json(change)


# Bad scenes


@pytest.mark.parametrize(
    "change, message",
    [
        ({"groups": ("a", "a", "b")}, "names that differ"),
        ({"groups": ("a", "", "b")}, "names that differ"),
        ({"groups": ("a", "b")}, "group that does not exist"),
        ({"groups": ("a", "b", "c", "d")}, "Nothing is in the temperature group 'd'"),
        ({"group": None}, "needs the index"),
        ({"group": np.zeros(3, np.int16)}, "needs the index"),
        ({"world_group": 1}, "group 'person' runs from 0 to 306 K; all in a group have one temperature"),
        ({"world_group": 5}, "group that does not exist"),
    ],
)
def test_groups_that_make_no_sense_are_named(change, message):
    with pytest.raises(SceneError, match=message):
        dataclasses.replace(room(), **change)


def test_too_many_layers_are_refused():
    scene = room()
    count = 260
    names = tuple(f"group {i}" for i in range(count))
    points, triangles = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    parts = [(points + (0, 0, 0.1 * i), triangles, 300.0, 0, i) for i in range(count)]
    scene = grouped(parts, names, scene.materials, scene.camera)
    with pytest.raises(SceneError, match="260 temperature groups need 261 layers.*at most 256"):
        scene_layers(scene)


def test_a_damaged_film_is_refused():
    state = render(room(), dataclasses.replace(QUICK, passes=1)).state()
    assert len(Film.from_state(state).layers) == 4
    for layers in ("nonsense", to_json(SINGLE)):
        with pytest.raises(ValueError):
            Film.from_state({**state, "layers": np.asarray(layers)})


# Series


def test_a_series_is_read():
    series = read_series("time,engine, exhaust\n0,300,310\n\n0.5, 350 ,400\n", ["exhaust", "engine"])
    assert series == [(1, {"engine": 300.0, "exhaust": 310.0}), (2, {"engine": 350.0, "exhaust": 400.0})]
    assert [frame for frame, _ in read_series("frame,a\n7,1\n5,2", ["a", "b"])] == [7, 5]


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "line of titles"),
        ("frame,engine\n", "line of titles"),
        ("frame,motor\n1,300", "column 'motor', but no temperature group is called so, only 'engine'"),
        ("frame,time\n1,300", "needs a column for a temperature group"),
        ("engine,engine\n1,300", "each once"),
        ("frame,engine\n1,300,5", "Line 2 of the series has 3 values, expected 2"),
        ("frame,engine\n1,300\n2,warm", "Line 3 of the series: engine is 'warm', expected a number"),
        ("frame,engine\n1.5,300", "Line 2 of the series: frame is '1.5'"),
        ("frame,engine\n1,300\n1,300", "a frame twice"),
    ],
)
def test_mistakes_in_a_series_are_named(text, message):
    with pytest.raises(SceneError, match=message):
        read_series(text, ["engine"])


def test_gas_takes_from_a_group_what_it_takes_at_any_temperature():
    """And stays at its own: an exact slab before a wall of another temperature."""
    image = layered_image(render(plume(), QUICK))
    through, widths = np.exp(-0.7), np.diff(EDGES)
    for kelvin in (300.0, 250.0, 500.0):
        truth = (1.0 - through) * band_radiance(EDGES, 600.0) + through * band_radiance(EDGES, kelvin)
        bands = image.recombined({"wall": kelvin})
        np.testing.assert_allclose(bands.mean(axis=(1, 2)) * widths, truth, rtol=1e-5)


@pytest.mark.once
def test_gas_does_not_change_with_the_sky():
    """Warm air over a grey floor, whose light photons bring together with that of the sky, which is a group: the mean
    over the image, recombined, beside renders at this temperature, of 4 seeds each, within 4 standard errors."""
    materials = Material("Floor", 0.3), Material("Ball", 0.6)
    scene = dataclasses.replace(outside(), media=(Medium("air", 0.1, 400.0),), world_depth=20.0, materials=materials)
    changed = ungrouped(at(scene, sky=300.0))
    settings = [Settings(passes=4, photons_per_pass=5000, threads=2, seed=seed) for seed in range(8)]
    images = [layered_image(render(scene, each)).recombined({"sky": 300.0}) for each in settings[:4]]
    renders = [render(changed, each).bands() for each in settings[4:]]
    found, truth = (np.mean(each, axis=(2, 3), dtype=float) for each in (images, renders))
    error = np.sqrt((found.var(axis=0, ddof=1) + truth.var(axis=0, ddof=1)) / 4)
    found, truth = found.mean(axis=0), truth.mean(axis=0)
    print(found / truth - 1.0, error / truth)
    assert np.all(np.abs(found - truth) < 4.0 * error) and np.all(error < 1e-3 * truth)
