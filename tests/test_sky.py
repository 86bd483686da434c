# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies whose temperature depends on the direction."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from addon.solver import Camera, Material, Medium, SceneError, Settings, Sky, render
from addon.solver.physics.sky import (
    build_sky_cells,
    build_sky_table,
    choose_direction,
    density_towards,
    fill_sky,
    mean_excess,
)
from addon.solver.physics.spectrum import band_radiance, planck
from addon.solver.planning import pilot
from tests.helpers.hot_skies import EDGES, lit_corner, with_spot
from tests.helpers.marks import long
from tests.helpers.path_tracer import trace_paths
from tests.helpers.scenes import join, look, make_scene, mean_and_error, pass_means, quad, sphere

pytestmark = pytest.mark.once

ANGLES = np.array([0.0, 40.0, 75.0, 90.0])
BY_ANGLE = Sky(np.array([230.0, 238.0, 262.0, 285.0]), ANGLES)
SPECTRAL = Sky(BY_ANGLE.kelvin[:, None] + np.array([0.0, -20.0, 15.0]), ANGLES, np.array([8.0, 10.0, 12.0]))
_RANDOM = np.random.default_rng(3)
IMAGE = Sky((270.0 + 30.0 * _RANDOM.random((12, 20))).astype(np.float32))


SPOT = with_spot(900.0, 6.0)
KINDS = {"by angle": BY_ANGLE, "spectral": SPECTRAL, "image": IMAGE}
LIT = KINDS | {"hot spot": SPOT}


def seen(sky, ways, wavelength):
    """(n,) spectral radiance of a sky at a wavelength in directions (n, 3), by numpy alone: linear in temperature over
    the zenith angle, and in radiance between the values of an image."""
    x, y, z = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).T
    zenith = np.degrees(np.arccos(np.clip(z, -1, 1)))
    if sky.zenith is not None:
        kelvin = sky.kelvin
        if sky.wavelengths is not None:
            kelvin = [np.interp(wavelength, sky.wavelengths, row) for row in sky.kelvin]
        return planck(wavelength, np.interp(zenith, sky.zenith, kelvin))
    value = planck(wavelength, sky.kelvin.astype(float))
    height, width = value.shape
    v, u = (1.0 - zenith / 180.0) * height - 0.5, (0.5 - np.arctan2(y, x) / (2 * np.pi)) * width - 0.5
    v = np.clip(v, 0, height - 1)
    row, column = np.minimum(v.astype(int), height - 2), np.floor(u).astype(int)
    a, b = v - row, u - column
    here, beside = value[:, column % width], value[:, (column + 1) % width]
    each = np.arange(len(ways))
    low, high = ((1 - b) * here[i, each] + b * beside[i, each] for i in (row, row + 1))
    return (1 - a) * low + a * high


def radiance(sky, ways):
    """(n, b) radiance in directions, by a sum over 40 wavelengths of each band."""
    bands = []
    for low, high in itertools.pairwise(EDGES):
        fine = low + (np.arange(40) + 0.5) * (high - low) / 40
        bands.append(sum(seen(sky, ways, each) for each in fine) * (high - low) / 40)
    return np.stack(bands, axis=-1)


def directions(count):
    z, turn = 1.0 - 2.0 * (np.arange(count) + 0.5) / count, np.pi * (1 + 5**0.5) * np.arange(count)
    return np.column_stack((np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z))


@pytest.mark.parametrize("sky", KINDS.values(), ids=KINDS)
def test_the_table_is_the_sky(sky):
    """In each direction to 2e-3, as kinks over the zenith angle are rounded over a quarter of a degree; the mean over
    directions to 1e-3."""
    table, ways, out = build_sky_table(sky, EDGES, np.zeros(3)), directions(2000), np.empty(3)
    found = []
    for way in ways:
        fill_sky(table, tuple(7.0 * way), out)
        found.append(out.copy())
    expected = radiance(sky, ways)
    np.testing.assert_allclose(found, expected, rtol=2e-3)
    np.testing.assert_allclose(mean_excess(table), expected.mean(axis=0), rtol=1e-3)


@pytest.mark.parametrize("sky", KINDS.values(), ids=KINDS)
def test_the_camera_sees_it(sky):
    """Beside a surface: means over pixels, by 5 x 5 points in each, to 3e-3, by which few rays a pixel differ."""
    plate = quad((0, 0, -50), (0.1, 0, 0), (0, 0.1, 0))
    camera = Camera(48, 24, look((0, 0, 0), (1, 0, 0)).matrix, "PANORAMA", frame=(-3.0, 3.0, -1.5, 1.5))
    film = render(make_scene(*plate, 280.0, [Material()], camera, EDGES, sky=sky), Settings(passes=16))
    longitude = -3.0 + 6.0 * (np.arange(240) + 0.5) / 240
    latitude = -1.5 + 3.0 * (np.arange(120) + 0.5) / 120
    lon, lat = np.meshgrid(longitude, latitude)
    ways = np.stack((np.cos(lat) * np.cos(lon), -np.cos(lat) * np.sin(lon), np.sin(lat)), -1).reshape(-1, 3)
    expected = radiance(sky, ways).sum(axis=1).reshape(24, 5, 48, 5).mean(axis=(1, 3))
    np.testing.assert_allclose(film.radiance(), expected, rtol=3e-3)


def irradiance(sky, normal, count=60_000):
    """(b,) W m-2 on a plate, by quadrature."""
    ways = directions(count)
    cosine = np.maximum(ways @ normal, 0.0)
    return 4.0 * np.pi * (radiance(sky, ways) * cosine[:, None]).mean(axis=0)


@pytest.mark.parametrize("sky", LIT.values(), ids=LIT)
@pytest.mark.parametrize("tilt", [0.0, *map(long, (60.0, 90.0, 135.0, 180.0))])
def test_irradiance_on_plates(sky, tilt):
    """Reflected by a tilted plate into the camera, in each band: within .1 % and 4 standard errors of quadrature."""
    angle = np.radians(tilt)
    normal, across = np.array((np.sin(angle), 0.0, np.cos(angle))), np.array((np.cos(angle), 0.0, -np.sin(angle)))
    plate = quad((0, 0, 0), across, np.array((0.0, 1.0, 0.0)))
    camera = look(3.0 * normal + 0.01 * across, (0, 0, 0), 8, 8, 0.1)
    scene = make_scene(*plate, 270.0, [Material("white", 0.1)], camera, EDGES, sky=sky)
    passes = pass_means(scene, Settings(passes=24))
    expected = 0.1 * band_radiance(EDGES, 270.0) + 0.9 * irradiance(sky, normal) / np.pi
    error = passes.std(axis=0, ddof=1) / len(passes) ** 0.5
    assert np.all(np.abs(passes.mean(axis=0) - expected) < 1e-3 * expected + 4 * error), (passes.mean(axis=0), expected)


def test_directions_are_chosen_by_brightness():
    """None in an even sky; beside a hot spot as dense as said, in each cell within 4 standard errors of the count, and
    all where the sky is bright."""
    around = np.full(3, 1.0)
    assert not build_sky_cells(build_sky_table(IMAGE, EDGES, around)).cumulative.size
    cells = build_sky_cells(build_sky_table(SPOT, EDGES, band_radiance(EDGES, 281.0)))
    random, count = np.random.default_rng(5).random((100_000, 2)), np.zeros((60, 120))
    for s, w in random:
        way = choose_direction(cells, s, w)
        row = int((math.asin(way[2]) / math.pi + 0.5) * 60)
        count[row, int((0.5 - math.atan2(way[1], way[0]) / (2 * math.pi)) * 120)] += 1
    heights = -np.cos(np.pi * np.arange(61) / 60)
    expected = np.zeros((60, 120))
    for row, column in itertools.product(range(60), range(120)):
        z, turn = 0.5 * (heights[row] + heights[row + 1]), math.pi * (1 - 2 * (column + 0.5) / 120)
        across = math.sqrt(1 - z * z)
        way = across * math.cos(turn), across * math.sin(turn), z
        solid = (heights[row + 1] - heights[row]) * math.pi / 60
        expected[row, column] = density_towards(cells, way) * solid * len(random)
    assert expected.sum() == pytest.approx(len(random), rel=1e-9)
    assert np.all(np.abs(count - expected) <= 4.5 * np.sqrt(expected))  # 7200 cells
    assert np.all(expected[SPOT.kelvin > 800.0] > 0.0)


@pytest.mark.parametrize(
    "open_sides, fog",
    [
        long(True, False),
        long(True, True),
        long(False, False),
    ],
)
def test_a_hot_spot_lights_a_corner_as_in_a_path_tracer(monkeypatch, open_sides, fog):
    """Directly, by mirrors, in rough lobes and by all later bounces, by shadow rays, rays that meet the spot, photons
    and recalled points together, with rays from the ends of final gathers and without: within 4 standard errors of both
    in the mean, and no more than expected apart in pixels. The path tracer finds the spot by chance alone. Fog, too, is
    lit by it, and lights the walls."""
    if not open_sides:
        monkeypatch.setattr(pilot, "_OPEN", 2.0)
    scene = lit_corner(SPOT)
    if fog:
        scene = dataclasses.replace(scene, media=(Medium("fog", 0.1, 280.0, 0.3, 0.5),), world_depth=3.0)
    traced = trace_paths(scene, 1024 if fog else 2048, batches=8, threads=2, reference=280.0).images.sum(axis=-1)
    background = band_radiance(EDGES, 280.0).sum()
    settings = Settings(passes=12 if fog else 24, photons_per_pass=10_000)
    ours = np.array([render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(8)])
    ours = ours - background
    error = np.hypot(ours.std(axis=0, ddof=1), traced.std(axis=0, ddof=1)) / 8**0.5
    apart = ours.mean(axis=0) - traced.mean(axis=0)
    mean, of_mean = apart.mean(), np.sqrt(np.mean(error**2) / error.size)
    noisy = error > 1e-3 * traced.mean(axis=0)  # all but the sky itself
    square = np.mean((apart / error)[noisy] ** 2)
    print(f"{mean:+.4f} +- {of_mean:.4f} of {traced.mean():.3f}, root mean square {square**0.5:.2f}")
    assert abs(mean) < 4 * of_mean
    # squares of Student's t of 8 samples have the mean 7 / 5 and the variance 7.8
    assert square < 1.4 + 4 * math.sqrt(7.8 / noisy.sum())


SHELL = Sky(300.0 + 60.0 * np.cos(np.radians(np.arange(0.0, 181.0, 2.0))), np.arange(0.0, 181.0, 2.0))


@pytest.mark.parametrize("fog", [False, long(True)])
def test_a_sky_is_a_large_shell(fog):
    """What a sky sends into a half-open box of diffuse, rough and mirror walls, directly and by photons, with fog and
    without: the same as a black shell far away with these temperatures. Within 4 standard errors, and the 1e-3 by which
    temperatures along flat triangles differ from the sky's."""
    walls = [
        (*quad((0, 0, -1), (1, 0, 0), (0, 1, 0)), 290.0, 0), (*quad((0, 0, 1), (1, 0, 0), (0, 1, 0)), 290.0, 0),
        (*quad((-1, 0, 0), (0, 1, 0), (0, 0, 1)), 290.0, 1), (*quad((0, 1, 0), (1, 0, 0), (0, 0, 1)), 290.0, 2),
    ]  # fmt: skip
    materials = [Material("grey", 0.2), Material("rough", 0.1, 0.7, 0.4), Material("mirror", 0.1, 1.0)]
    camera = look((0.6, -0.9, 0.3), (-0.5, 0.5, -0.4), 16, 12, 0.8)
    media = (Medium("fog", 0.05, 320.0, 0.3, 0.5),) if fog else ()
    options = {"world_depth": 2.0, "media": media} if fog else {}
    *mesh, index = join(*walls)
    open_ = make_scene(*mesh, materials, camera, EDGES, index, sky=SHELL, **options)
    shell, faces = sphere(4, 400.0)
    *mesh, index = join(*walls, (shell, faces[:, ::-1], 0.0, 3))
    kelvin = np.repeat(mesh[2][:, None], 3, axis=1)
    kelvin[8:] = 300.0 + 60.0 * mesh[0][mesh[1][8:]][:, :, 2] / 400.0
    if fog:  # the air ends before the shell, as it does before the sky
        vertices, triangles = sphere(3, 1.0)
        ball = 3.0 * vertices
        media = (dataclasses.replace(media[0], vertices=ball, triangles=triangles),)
        open_, options = dataclasses.replace(open_, media=media, world_depth=0.0), {"media": media}
    closed = make_scene(*mesh, [*materials, Material("black", 1.0)], camera, EDGES, index, **options)
    closed = dataclasses.replace(closed, temperature=kelvin.astype(np.float32))
    settings = Settings(passes=24, photons_per_pass=20_000, reference_temperature=290.0)
    means = mean_and_error(open_, settings), mean_and_error(closed, settings)
    (a, da), (b, db) = means
    print(f"{a:.5f} +- {da:.5f}, shell {b:.5f} +- {db:.5f}")
    assert abs(a - b) < 4 * np.hypot(da, db) + 1e-3 * b


def test_an_even_sky_is_no_sky():
    scene = make_scene(*quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 300.0, [Material()], look((0, 0, 3), (0, 0, 0)), EDGES,
                       sky=Sky(np.full(4, 250.0), ANGLES))  # fmt: skip
    assert scene.sky is None and scene.world_temperature == 250.0


@pytest.mark.parametrize(
    "values, message",
    [
        ((np.array([250.0, np.nan, 260.0, 270.0]), ANGLES), "World, sky: temperature nan"),
        ((np.array([250.0, -1.0, 260.0, 270.0]), ANGLES), "World, sky: temperature -1 K"),
        ((np.array([250.0, 260.0]), np.array([0.0, 200.0])), "zenith angle 200"),
        ((np.array([250.0, 260.0]), np.array([10.0, 10.0])), "10 is followed by 10"),
        ((np.array([250.0, 260.0]), np.array([10.0, 20.0, 30.0])), r"shape \(2,\), expected \(3,\)"),
        ((np.zeros((0, 4)),), r"shape \(0, 4\)"),
        ((np.full((2, 2), 250.0), np.array([0.0, 90.0]), np.array([9.0, 8.0])), "9 um is followed by 8 um"),
    ],
)
def test_nonsense_is_refused_by_name(values, message):
    with pytest.raises(SceneError, match=message):
        Sky(*values)
