# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference temperature is the one with the least excess around it: where few sources light the image, a median."""

import numpy as np
import pytest

from addon.solver import Material, Medium, Settings, render
from addon.solver.geometry.surfaces import build_surfaces
from addon.solver.physics.radiometry import typical_emissivity
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.pilot import Pilot
from addon.solver.planning.reference import Sources, choose_reference, gather_sources, typical_source
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
GREY = Material("grey", 0.5)


def sources_of(temperature, share):
    """Sources at these temperatures (n,), K, with these shares (n,) in all bands."""
    temperature = np.asarray(temperature, float)
    shares = np.repeat(np.asarray(share, float)[:, None], len(EDGES) - 1, axis=1)
    return Sources(temperature, shares, band_radiance(EDGES, temperature))


def gathered(scene, importance, sky):
    """The sources of a scene of whose triangles and sky so much light comes to the image."""
    surfaces, _, _ = build_surfaces(scene)
    met, importance = np.arange(len(surfaces.sheet), dtype=np.int32), np.asarray(importance, float)
    pilot = Pilot(*[None] * len(Pilot._fields))._replace(met=met, importance=importance, sky=sky)
    emissivity = typical_emissivity(scene.materials, scene.band_edges, surfaces.temperature)
    return gather_sources(scene, surfaces, pilot, emissivity)


def triangles_at(temperature, materials=(GREY,), material=None, world_temperature=0.0):
    """A scene of single triangles at these temperatures, K, one beside the other."""
    count = len(temperature)
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]) + 2.0 * np.arange(count)[:, None, None] * (1, 0, 0)
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    camera = look((0, 0, 5), (0, 0, 0))
    return make_scene(
        corners.reshape(-1, 3), triangles, temperature, materials, camera, EDGES, material,
        world_temperature=world_temperature,
    )  # fmt: skip


# The choice -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "share, expected",
    [
        ((0.2, 0.5, 0.3), 300.0),
        ((0.6, 0.2, 0.2), 280.0),
        ((0.1, 0.3, 0.6), 900.0),
        ((0.3, 0.3, 0.4), 300.0),  # not the mean, which the hottest would rule
        ((0.0, 0.0, 0.1), 900.0),
    ],
)
def test_of_three_sources_the_median_is_chosen(share, expected):
    assert choose_reference(sources_of((280.0, 300.0, 900.0), share)) == expected
    assert choose_reference(sources_of((900.0, 280.0, 300.0), np.roll(share, 1))) == expected  # in any order


def test_of_many_sources_the_weighted_median_is_chosen():
    """Half of the light comes from colder sources than it and half from hotter ones, at most."""
    rng = np.random.default_rng(5)
    for count in (2, 5, 20, 100):
        kelvin, share = rng.uniform(200.0, 1000.0, count), rng.exponential(size=count)
        chosen = choose_reference(sources_of(kelvin, share))
        assert chosen in kelvin
        assert share[kelvin < chosen].sum() <= share.sum() / 2 and share[kelvin > chosen].sum() <= share.sum() / 2


def test_each_band_weighs_by_its_radiance():
    """One source is in one band alone, the other in the other: between them lie more watts in one of the bands, and the
    source in that band is the reference, so that only the other's difference is left."""
    kelvin = np.array([300.0, 600.0])
    radiance = band_radiance(EDGES, kelvin)
    more = int(np.argmax(radiance[1] - radiance[0]))
    assert more == 0  # 600 K is brightest at 5 um
    assert choose_reference(Sources(kelvin, np.eye(2), radiance)) == 300.0  # which is in the first band
    assert choose_reference(Sources(kelvin, np.eye(2)[::-1], radiance)) == 600.0


# The sources ----------------------------------------------------------------------------------------------------------


def test_sources_are_importance_times_emissivity():
    """Triangles of one temperature are one source; the sky is the last one and emits all."""
    step = Material("step", np.array([[8.0, 0.2], [10.0, 0.2], [10.0001, 0.8], [12.0, 0.8]]))
    scene = triangles_at((300.0, 350.0, 300.0), (GREY, step), (0, 0, 1), world_temperature=250.0)
    sources = gathered(scene, (0.1, 0.2, 0.3), 0.4)
    np.testing.assert_array_equal(sources.temperature, (300.0, 350.0, 250.0))
    cold = (0.1 * 0.5 + 0.3 * 0.2, 0.1 * 0.5 + 0.3 * 0.8)
    np.testing.assert_allclose(sources.share, (cold, (0.1, 0.1), (0.4, 0.4)), rtol=1e-4)  # of the step's width
    np.testing.assert_allclose(sources.radiance, band_radiance(EDGES, sources.temperature))


def test_thousands_of_temperatures_are_few_groups_with_nearly_the_same_median():
    count, low, high = 4000, 280.0, 320.0
    scene = triangles_at(np.random.default_rng(3).permutation(np.linspace(low, high, count)))
    sources = gathered(scene, np.full(count, 1 / count), 0.0)
    assert len(sources.temperature) < 600
    np.testing.assert_allclose(sources.share.sum(axis=0), 0.5)
    # a group is a 512th of the range wide, and its least temperature stands for all of it
    assert choose_reference(sources) == pytest.approx(0.5 * (low + high), abs=(high - low) / 512)


def test_typical_source_is_the_mean_by_excess():
    """That of the reference itself counts nothing."""
    sources = sources_of((290.0, 300.0, 320.0), (0.1, 0.5, 0.4))
    excess = [np.abs(band_radiance(EDGES, kelvin) - band_radiance(EDGES, 300.0)).sum() for kelvin in (290.0, 320.0)]
    below, above = 0.1 * excess[0], 0.4 * excess[1]
    expected = (290.0 * below + 320.0 * above) / (below + above)
    assert typical_source(sources, EDGES, 300.0) == pytest.approx(expected)


# Scenes ---------------------------------------------------------------------------------------------------------------


def test_a_scene_at_one_temperature_has_nothing_in_excess():
    """Open, of several materials, under a sky that has the same temperature: it is the reference to the last bit, no
    photon is sent, and the image is the blackbody's."""
    kelvin = 291.25  # a number in float32
    ground, (points, faces) = quad((0, 0, 0), (3, 0, 0), (0, 3, 0)), sphere(2, 0.5)
    vertices, triangles, temperature, material = join((*ground, kelvin, 0), (points + (0, 0, 1), faces, kelvin, 1))
    materials = (Material("dull", 0.3), Material("bright", 0.7))
    scene = make_scene(
        vertices, triangles, temperature, materials, look((0, -4, 2), (0, 0, 0.5)), EDGES, material,
        world_temperature=kelvin,
    )  # fmt: skip
    sources = gathered(scene, np.full(len(triangles), 0.5 / len(triangles)), 0.5)
    assert choose_reference(sources) == kelvin
    assert typical_source(sources, EDGES, kelvin) == kelvin
    assert np.all(sources.radiance == band_radiance(EDGES, kelvin))
    film = render(scene, Settings(passes=2, photons_per_pass=1000))
    assert film.reference_temperature == kelvin and film.photons == 0
    np.testing.assert_array_equal(film.noise(), 0.0)
    np.testing.assert_allclose(film.temperature(), kelvin, rtol=1e-6)  # float32


@pytest.mark.parametrize("walls", [250.0, 293.0, 400.0])
def test_a_closed_room_has_the_temperature_of_its_walls(walls):
    """They light most of the image: it is not that of a small hot thing there, nor of the sky, which nothing sees."""
    small = quad((0.5, 0.5, 0.1), (0.05, 0, 0), (0, 0.05, 0))
    vertices, triangles, temperature, material = join((*box(), walls, 0), (*small, 900.0, 0))
    scene = make_scene(
        vertices, triangles, temperature, (Material(emissivity=0.8),), look((0.2, 0.2, 0.8), (0.5, 0.6, 0.3)), EDGES,
        material, world_temperature=200.0,
    )  # fmt: skip
    assert render(scene, Settings(passes=1, photons_per_pass=100)).reference_temperature == walls


@pytest.mark.parametrize("absorption, expected", [(0.01, 293.0), (20.0, 900.0)])
def test_gas_that_lights_most_of_the_image_is_the_reference(absorption, expected):
    """A room full of hot gas: thin gas takes next to nothing of the light of the walls, thick gas takes all."""
    vertices, triangles, temperature, material = join((*box(), 293.0, 0))
    gas = box((0.98, 0.98, 0.98))
    hot = Medium("hot", absorption, 900.0, vertices=gas[0] + 0.01, triangles=gas[1])
    scene = make_scene(
        vertices, triangles, temperature, (Material(emissivity=0.8),), look((0.2, 0.2, 0.8), (0.5, 0.6, 0.3)), EDGES,
        material, world_temperature=200.0, media=(hot,),
    )  # fmt: skip
    assert render(scene, Settings(passes=1, photons_per_pass=100)).reference_temperature == expected
