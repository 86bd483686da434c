# SPDX-License-Identifier: GPL-3.0-or-later
"""Specks: what is seen straight and so small that rays may not meet it. Where it is, and that its error is stated."""

import dataclasses
import math

import numpy as np
import pytest

from addon.solver import Material, Medium, Settings, render
from addon.solver.geometry.eye import rays_through
from addon.solver.physics.spectrum import apparent_temperature, band_radiance
from addon.solver.planning import specks
from addon.solver.planning.preparation import prepare
from addon.solver.planning.specks import Specks, find_specks, variance_of_specks, what_to_expect
from tests.benchmarks.speed_scenes import grid
from tests.helpers.marks import long
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
BLACK, MIRROR = range(2)
MATERIALS = Material("black", 1.0), Material("mirror", 0.05, specular=1.0)
COLD, HOT = 300.0, 900.0
PIXELS = 12, 16


def view(kind="PERSPECTIVE"):
    """Straight down from 10 m, 16 x 12 pixels."""
    camera = look((0, 0, 10), (0, 0, 0), PIXELS[1], PIXELS[0], 0.5)
    if kind == "ORTHOGRAPHIC":
        return dataclasses.replace(camera, kind=kind, frame=tuple(10.0 * end for end in camera.frame))
    if kind == "PANORAMA":
        return dataclasses.replace(camera, kind=kind)
    return camera


def ball(centre, radius, kelvin=HOT, material=BLACK):
    vertices, triangles = sphere(1, radius)
    return vertices + centre, triangles, kelvin, material


def over_a_floor(*parts, camera=None, **options):
    """Parts over a black floor 300 K warm, as the surroundings are."""
    floor = (*quad((0, 0, -1), (50, 0, 0), (0, 50, 0)), COLD, BLACK)
    vertices, triangles, temperature, material = join(*parts, floor)
    camera, options = camera or view(), {"world_temperature": COLD} | options
    return make_scene(vertices, triangles, temperature, MATERIALS, camera, EDGES, material, **options)


def specks_of(scene):
    """The Specks of a scene, (h, w) each."""
    model = prepare(scene, Settings(1, 1000, reference_temperature=COLD))
    found = find_specks(model.stage, model.tracer, model.eye)
    shape = scene.camera.height, scene.camera.width
    return Specks(*(each.reshape(shape) for each in found))


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC", "PANORAMA"])
def test_where_a_speck_is_and_how_much_of_the_pixel_it_fills(kind):
    """A ball 10 m before the camera, near the middle of the picture, where the three see alike."""
    radius = 0.02
    scene = over_a_floor(ball((0.3, -0.9, 0.0), radius), camera=view(kind))
    found = specks_of(scene)
    row, column = np.argwhere(found.share)[0]
    assert np.count_nonzero(found.share) == 1
    assert (row, column) == (6 + math.floor(-0.9 / 0.625), 8 + math.floor(0.3 / 0.625))
    assert found.share[row, column] == pytest.approx(math.pi * (radius / 0.625) ** 2, rel=0.12)  # of 80 faces
    excess = (band_radiance(EDGES, HOT) - band_radiance(EDGES, COLD)).sum()
    assert found.radiance[row, column] == pytest.approx(excess, rel=1e-5)


def test_what_is_hidden_large_or_beside_the_picture_is_none():
    small = ball((0.3, -0.9, 0.0), 0.02)
    screen = (*quad((0.2, -0.6, 5), (1, 0, 0), (0, 1, 0)), COLD, BLACK)
    for parts in ((small, screen), (ball((0.3, -0.9, 0.0), 1.8),), (ball((9.0, 0.0, 0.0), 0.02),), ()):
        assert not specks_of(over_a_floor(*parts)).share.any()


def test_a_box_of_six_sheets_is_one_speck():
    vertices, triangles = box((0.03, 0.03, 0.03))
    found = specks_of(over_a_floor((vertices + (0.3, -0.9, 0.0), triangles, HOT, BLACK)))
    aslant = 1.0 + 0.03 + 0.09  # two of its sides are seen, too
    assert found.share.sum() == pytest.approx(aslant * (0.03 / 0.625) ** 2, rel=0.02)


def test_many_of_them_share_few_rays(monkeypatch):
    """A ninth of the rays that their points would take: the triangles that get one stand for the others."""
    every = specks_of(over_a_floor(*field(0.01)))
    sent = []
    monkeypatch.setattr(specks, "_RAYS", 1000)
    monkeypatch.setattr(
        specks, "rays_through", lambda eye, x, *rest: (sent.append(len(x)), rays_through(eye, x, *rest))
    )
    few = specks_of(over_a_floor(*field(0.01)))
    assert 0 < sent[0] <= 2000
    assert few.share.sum() == pytest.approx(every.share.sum(), rel=0.1)


def test_gas_takes_from_it():
    clear = specks_of(over_a_floor(ball((0.3, -0.9, 0.0), 0.02)))
    air = Medium("air", 0.1, COLD)
    dim = specks_of(over_a_floor(ball((0.3, -0.9, 0.0), 0.02), media=(air,), world_depth=20.0))
    assert dim.radiance.max() == pytest.approx(math.exp(-1.0) * clear.radiance.max(), rel=0.01)


def test_what_it_adds():
    some = Specks(np.array([0.0, 0.01]), np.array([0.0, 50.0]), np.array([0.0, 0.05]))
    np.testing.assert_allclose(variance_of_specks(some, 16), [0.0, 0.99**17 * 0.01 * 2500.0])
    variance, samples = np.array([8.0, 0.0]), np.array([4, 32])
    found = what_to_expect(some, variance, samples, np.array([1.0, 0.5]))
    np.testing.assert_allclose(found, [[0.75**2, 0.0], [0.0, 0.375], [0.0, 0.32], [np.inf, 0.08]])


def field(share, pixel=0.625, height=0.0):
    """A ball at a random place in each of 12 x 9 pixels, so many metres wide, that fills this share of it and lies
    inside it."""
    rng, radius = np.random.default_rng(3), math.sqrt(share / math.pi)
    places = np.array([(x, y) for x in range(2, 14) for y in range(2, 11)])
    at = places + radius + (1.0 - 2.0 * radius) * rng.random(places.shape) - (8, 6)
    return [ball((x, y, height), pixel * radius) for x, y in pixel * at]


def truth(share):
    """Apparent temperature of a pixel of the field, for the faces that a ball has."""
    vertices, triangles = sphere(1, 1.0)
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    share *= np.abs(np.cross(b - a, c - a)[:, 2]).sum() / 4.0 / math.pi
    radiance = (1.0 - share) * band_radiance(EDGES, COLD) + share * band_radiance(EDGES, HOT)
    return float(apparent_temperature(radiance.sum(keepdims=True), EDGES)[0])


def ratios(scene, passes, seeds, kelvin=None):
    """Errors over the stated ones, (seeds, h, w) without the outermost two pixels; 2 mK added, as a camera sees no
    less. kelvin: the truth; None for the mean of all seeds."""
    films = [render(scene, Settings(passes, 1000, seed=seed, reference_temperature=COLD)) for seed in range(seeds)]
    found = np.array([film.temperature() for film in films], float)
    stated = np.hypot(np.array([film.noise() for film in films], float), 0.002)
    error = (found - found.mean(axis=0)) * math.sqrt(seeds / (seeds - 1)) if kelvin is None else found - kelvin
    return (error / stated)[:, 2:-1, 2:-2]


@pytest.mark.once
@pytest.mark.parametrize("share", [0.1, *map(long, (0.01, 0.001)), 0.0001])
@pytest.mark.parametrize("passes", [4, 32])
def test_the_error_of_specks_is_stated(share, passes):
    """True over stated errors, root mean square: at most 1.2, and 0.4 at least, as the plan and neighbours that met
    theirs tell of specks, too. None beyond 5 after 32 passes, as half of the pixels were that had met none; after four
    passes a few that agree by chance."""
    scene = over_a_floor(*field(share), camera=view("ORTHOGRAPHIC"))
    found = ratios(scene, passes, 12, truth(share))
    print(f"rms {np.sqrt(np.mean(found**2)):.2f}, largest {np.abs(found).max():.1f}")
    assert 0.4 < np.sqrt(np.mean(found**2)) < 1.2
    assert np.mean(np.abs(found) > 3.0) < 0.02
    assert np.mean(np.abs(found) > 5.0) <= (0.005 if passes == 4 else 0.0)


def spotted(across):
    """A black floor whose mesh has so many faces along each side of a pixel, and one of them is hot, at random, in each
    of 12 x 9 pixels."""
    rng = np.random.default_rng(5)
    vertices, triangles = grid((-5.0, -3.75, -1.0), (10.0, 0, 0), (0, 7.5, 0), 16 * across, 12 * across)
    kelvin = np.full((12 * across, 16 * across), COLD)
    for y in range(2, 11):
        for x in range(2, 14):
            kelvin[y * across + rng.integers(across), x * across + rng.integers(across)] = HOT
    x, y, _ = ((vertices[triangles].mean(axis=1) + (5.0, 3.75, 0.0)) / 0.625 * across).astype(int).T
    camera, material = view("ORTHOGRAPHIC"), np.zeros(len(triangles), np.int32)
    return make_scene(vertices, triangles, kelvin[y, x], MATERIALS, camera, EDGES, material, world_temperature=COLD)


@pytest.mark.once
@pytest.mark.parametrize(("passes", "across"), [(4, 10), (32, 10), (32, 30)])
def test_the_error_of_hot_faces_is_stated(passes, across):
    """Of specks that are faces of the floor itself, as of others."""
    radiance = [band_radiance(EDGES, kelvin).sum() for kelvin in (COLD, HOT)]
    seen = radiance[0] + (radiance[1] - radiance[0]) / across**2
    kelvin = float(apparent_temperature(np.array([seen]), np.array([EDGES[0], EDGES[-1]]))[0])
    found = ratios(spotted(across), passes, 12, kelvin)
    print(f"rms {np.sqrt(np.mean(found**2)):.2f}, largest {np.abs(found).max():.1f}")
    assert 0.4 < np.sqrt(np.mean(found**2)) < 1.2
    assert np.mean(np.abs(found) > 5.0) <= (0.005 if passes == 4 else 0.0)


def wires(width):
    """Four wires across the picture, at angles, so many pixels wide."""
    half, parts = 0.5 * width * 0.625, []
    for number, y in enumerate((-2.1, -0.77, 0.45, 1.9)):
        vertices, triangles = box((30.0, 2 * half, 2 * half))
        turn = 0.03 * number
        rotation = np.array([(np.cos(turn), np.sin(turn), 0), (-np.sin(turn), np.cos(turn), 0), (0, 0, 1)])
        parts.append(((vertices - (15.0, half, half)) @ rotation + (0, y, 0), triangles, HOT, BLACK))
    return parts


def test_a_wire_is_found_all_along():
    """Also where it is one sheet with ends far beside the picture."""
    found = specks_of(over_a_floor(wires(0.01)[0], camera=view("ORTHOGRAPHIC")))
    row = math.floor(6 - 2.1 / 0.625)
    np.testing.assert_allclose(found.share[row], 0.01, rtol=0.2)  # by sixteen points or so in each pixel
    assert found.share[row].mean() == pytest.approx(0.01, rel=0.05)
    assert not np.delete(found.share, row, axis=0).any()
    np.testing.assert_allclose(found.width[row], 0.01, rtol=0.01)


@pytest.mark.once
@pytest.mark.parametrize("width", [*map(long, (0.1, 0.01)), 0.001])
@pytest.mark.parametrize("passes", [4, 32])
def test_the_error_of_wires_is_stated(width, passes):
    """As of specks; against many passes, 5 in 1000 beyond 5, as no point may lie in a corner that a wire cuts, and what
    is a tenth of a pixel wide has agreed by chance in more of four passes."""
    scene = over_a_floor(*wires(width), camera=view("ORTHOGRAPHIC"))
    converged = render(scene, Settings(512, 1000, seed=99, reference_temperature=COLD)).temperature().astype(float)
    found = ratios(scene, passes, 12, converged)
    print(f"rms {np.sqrt(np.mean(found**2)):.2f}, largest {np.abs(found).max():.1f}")
    assert np.sqrt(np.mean(np.clip(found, -5.0, 5.0) ** 2)) < 1.2
    assert np.mean(np.abs(found) > 3.0) < (0.03 if passes == 4 else 0.01)
    assert np.mean(np.abs(found) > 5.0) < 0.005


@pytest.mark.once
@pytest.mark.parametrize("passes", [4, 32])
def test_edges_in_a_mirror_state_their_error(passes):
    """Balls of half a pixel, which a mirror shows: as seen straight."""
    mirror = (*quad((0, 0, 0), (50, 0, 0), (0, 50, 0)), COLD, MIRROR)
    vertices, triangles, temperature, material = join(*field(0.5, pixel=1.875, height=20.0), mirror)
    options = {"material": material, "world_temperature": COLD}
    scene = make_scene(vertices, triangles, temperature, MATERIALS, view(), EDGES, **options)
    found = ratios(scene, passes, seeds=12)
    print(f"rms {np.sqrt(np.mean(found**2)):.2f}, largest {np.abs(found).max():.1f}")
    assert 0.8 < np.sqrt(np.mean(found**2)) < 1.2
