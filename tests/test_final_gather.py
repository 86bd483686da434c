# SPDX-License-Identifier: GPL-3.0-or-later
"""Final gathers beside walls: exact where photon disks would blur, and the same mean as photons wherever they stand."""

import importlib
import math

import numpy as np
import pytest
from numba import njit
from scenes import box, look, make_scene, mean_and_error, sphere

from addon.solver import Camera, Material, PointLight, Settings, SunLight, render
from addon.solver.spectrum import band_radiance

eye_paths = importlib.import_module("addon.solver.eye_paths")
EDGES = np.array([8.0, 10.0, 12.0])
GREY, BLACK = Material("grey", 0.5), Material("black", 1.0)
MIRROR = Material("mirror", 0.1, specular=1.0)
ROUGH = Material("rough", 0.2, specular=0.7, roughness=0.4)


def join(*parts):
    """Vertices, triangles, temperatures and materials of (vertices, triangles, temperature, material) parts."""
    firsts = np.cumsum([0] + [len(points) for points, *_ in parts])
    triangles = [corners + first for (_, corners, *_), first in zip(parts, firsts, strict=False)]
    temperature = np.concatenate([np.full(len(corners), kelvin) for _, corners, kelvin, _ in parts])
    material = np.concatenate([np.full(len(corners), index) for _, corners, _, index in parts])
    return np.concatenate([p[0] for p in parts]), np.concatenate(triangles).astype(np.int32), temperature, material


def quad(a, u, v):
    a, u, v = (np.asarray(value, float) for value in (a, u, v))
    return np.array([a, a + u, a + u + v, a + v]), np.array([(0, 1, 2), (0, 2, 3)])


def wall_factor(distance, width, height):
    """Share of the sky of a point of the floor that a wall on the floor fills: width (m) to both sides, height (m).

    Twice the configuration factor of a plane element to a rectangle at right angles with a corner beside it (Howell,
    factor B-4): (atan(1 / Y) - Y / sqrt(X^2 + Y^2) atan(1 / sqrt(X^2 + Y^2))) / (2 pi), X = height / width.
    """
    x, y = height / width, distance / width
    root = np.hypot(x, y)
    return (np.arctan(1 / y) - y / root * np.arctan(1 / root)) / math.pi


def test_floor_beside_a_hot_wall_is_exact():
    """No disk of photons can hold half of what it counts behind a wall, or be smaller the nearer it is.

    The wall is black, floor and surroundings have the reference temperature: what the floor reflects of the wall is all
    the excess, E / pi times 0.5. 4 standard errors a column of pixels, which are themselves below 4 %.
    """
    wall = quad((0, -1, 0), (0, 2, 0), (0, 0, 0.2))
    floor = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    camera = Camera(32, 12, look((0.16, 0, 1), (0.16, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.16, 0.16, -0.3, 0.3))
    *parts, material = join((*floor, 300.0, 0), (*wall, 400.0, 1))
    scene = make_scene(*parts, (GREY, BLACK), camera, EDGES, material, world_temperature=300.0)
    images = np.array(
        [render(scene, Settings(passes=16, photons_per_pass=50_000, seed=seed)).radiance() for seed in range(8)]
    ).mean(axis=1)  # over the rows, along the wall
    background = band_radiance(EDGES, 300.0).sum()
    excess = 0.5 * (band_radiance(EDGES, 400.0).sum() - background)
    x = (np.arange(3200) + 0.5) / 3200 * 0.32
    y = (np.arange(60) + 0.5) / 60 * 0.6 - 0.3
    half = [wall_factor(x[:, None], 1.0 + sign * y, 0.2) for sign in (-1, 1)]
    truth = excess * (0.5 * (half[0] + half[1])).mean(axis=1).reshape(32, 100).mean(axis=1)
    value = images.mean(axis=0) - background
    error = images.std(axis=0, ddof=1) / math.sqrt(len(images))
    print(np.column_stack((value / truth - 1, error / truth)).round(4))
    assert np.all(error < 0.04 * truth)
    assert np.all(np.abs(value - truth) < 4 * error)


@njit
def split_all(surfaces, radiometry, estimate, code, rays, gathers, free2):
    """Every gather sends rays."""
    sent = 0
    for g in range(gathers.ray.size):
        if not rays.gathered[gathers.ray[g]]:
            gathers.side[g], gathers.of[gathers.ray[g]] = 6, g
            sent += 36
    return sent


def split_none(*_):
    return 0


def corner(kind):
    """A corner of floor and walls with things in it that light it in every way there is."""
    vertices, triangles = box((2.0, 2.0, 1.5))
    kelvin = np.repeat([290.0, 300.0, 310.0, 295.0, 285.0, 305.0], 2)
    parts = [(vertices, triangles[2 * f : 2 * f + 2], kelvin[2 * f], 0) for f in range(6 if kind != "open" else 5)]
    ball_points, ball = sphere(2, 0.05)
    lights = ()
    if "lamp" in kind:
        parts.append((ball_points + (0.6, 0.9, 0.5), ball, 900.0, 1))
    if "mirror" in kind:
        parts.append((*quad((0.1, 0.2, 0.05), (0, 1.5, 0), (0.1, 0, 1.2)), 290.0, 2))
    if "rough" in kind:
        parts.append((*quad((0.1, 0.2, 0.05), (0, 1.5, 0), (0.1, 0, 1.2)), 290.0, 3))
    if "light" in kind:
        lights = (PointLight(np.array([0.7, 1.1, 0.6]), 3000.0, 0.05),)
    if "sun" in kind:
        lights = (SunLight(np.array([0.3, 0.1, -1.0]), 500.0),)
    vertices, triangles, temperature, material = join(*parts)
    camera = look((1.7, 1.6, 1.2), (0.2, 0.3, 0.2), 8, 6, 0.7)
    return make_scene(
        vertices, triangles, temperature, (GREY, BLACK, MIRROR, ROUGH), camera, EDGES, material,
        lights=lights, world_temperature=250.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    "kind", ["closed", "open", "lamp", "lamp mirror", "light mirror", "lamp rough", "light rough", "light mirror rough"]
)
def test_final_gathers_and_photons_agree(kind, monkeypatch):
    """Every path of light is counted once, by a ray or by a photon. 4 standard errors, which are below 0.5 %."""
    scene = corner(kind)
    settings = Settings(passes=96, photons_per_pass=20_000, reference_temperature=290.0)
    results = []
    for choose in (split_all, split_none):
        monkeypatch.setattr(eye_paths, "choose_splits", choose)
        results.append(mean_and_error(scene, settings))
    (gathered, gathered_error), (photons, photons_error) = results
    error = math.hypot(gathered_error, photons_error)
    print(f"{kind}: {gathered / photons - 1:+.3%} +- {error / photons:.3%}")
    assert error < 0.005 * photons
    assert abs(gathered - photons) < 4 * error


@pytest.mark.parametrize("k", [2, 7, 8, 9, 50, 1000])
def test_ends_of_final_gathers_have_room_for_their_neighbours(k):
    """A search writes into room for k; more neighbours would be written beyond it."""
    assert 2 <= eye_paths.end_neighbours.py_func(k) <= k


def test_final_gathers_stand_where_walls_are_near(monkeypatch):
    """And nowhere else: in the open they would cost time for nothing."""
    chosen = []
    choose = eye_paths.choose_splits

    def watch(surfaces, estimate, triangle, rays, gathers, found, free2):
        count = choose(surfaces, estimate, triangle, rays, gathers, found, free2)
        for g in range(found):
            i = gathers.ray[g]
            near = free2[g] < np.float32(estimate.reach2)
            assert not (gathers.split[i] and (rays.gathered[i] or not near))
        chosen.append((count, found))
        return count

    monkeypatch.setattr(eye_paths, "choose_splits", watch)
    render(corner("closed"), Settings(passes=1, photons_per_pass=20_000))
    split, found = np.sum(chosen, axis=0)
    assert 0 < split < 0.5 * found
