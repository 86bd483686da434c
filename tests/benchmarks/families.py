# SPDX-License-Identifier: GPL-3.0-or-later
"""Families of scenes that are hard for photon maps and caches, in numbers: random members without end.

Each family is a function of a random generator that returns a Scene of one narrow band, 64 x 48 pixels. FIXED are
members that do not change, by the family's name. The surroundings have the ambient temperature, T0 of the excess, but
under a sky. Four families, from `plume` on, hold grey gas; the last four have surfaces that vary, or a sky.
"""

import zlib
from dataclasses import replace

import numpy as np

from addon.solver import Grid, Material, Medium, Sky, Texture
from tests.benchmarks.painted_parts import NOTHING, Coat, PaintedParts, random_square, turned_profile, whole_square
from tests.benchmarks.speed_scenes import Parts, cylinder, grid, grid_triangles, revolve
from tests.helpers.grids import placed
from tests.helpers.scenes import box, look, quad, sphere

WIDTH, HEIGHT = 64, 48
BAND = np.array([9.99, 10.01])  # um
AMBIENT = 300.0  # K
_VIEW = np.tan(np.radians(22.5))  # of half the horizontal field of view


def view(position, target, tangent=_VIEW):
    return look(position, target, WIDTH, HEIGHT, tangent)


def turned(mesh, angle, axis=2):
    """A mesh turned by an angle (rad) about a coordinate axis through the origin."""
    vertices, triangles = mesh
    i, j = [k for k in range(3) if k != axis]
    turned_vertices = np.array(vertices, float)
    turned_vertices[:, i] = np.cos(angle) * vertices[:, i] - np.sin(angle) * vertices[:, j]
    turned_vertices[:, j] = np.sin(angle) * vertices[:, i] + np.cos(angle) * vertices[:, j]
    return turned_vertices, triangles


def block(size):
    """A box (m) with its middle in the origin."""
    vertices, triangles = box(size)
    return vertices - 0.5 * np.asarray(size, float), triangles


def floor(parts, material, kelvin=AMBIENT, half=1.0, height=0.0):
    parts.add(quad((0, 0, height), (half, 0, 0), (0, half, 0)), kelvin, material)


def shell(parts, size, kelvin, material, skip=()):
    """Faces of a box from the origin, seen from inside, without those in skip (order of `box`: -x +x -y +y -z +z)."""
    vertices, triangles = box(size)
    kept = [t for face in range(6) if face not in skip for t in (2 * face, 2 * face + 1)]
    parts.add((vertices, triangles[kept][:, ::-1]), kelvin, material)


def wall_with_hole(parts, y, size, hole, material):
    """Wall in a plane of constant y, from x = 0 and z = 0, with a rectangular hole (x0, x1, z0, z1)."""
    (width, height), (x0, x1, z0, z1) = size, hole
    for low, high, bottom, top in ((0, x0, 0, height), (x1, width, 0, height), (x0, x1, 0, z0), (x0, x1, z1, height)):
        if high > low and top > bottom:
            parts.add(grid((low, y, bottom), (high - low, 0, 0), (0, 0, top - bottom)), AMBIENT, material)


def grey(emissivity, specular=0.0, roughness=0.0):
    return Material(f"{emissivity:.3g} {specular:.3g} {roughness:.3g}", float(emissivity), specular, roughness)


# Tubes and ducts

TIN = grey(0.15)


def tube(radius=0.1, bottom=0.5, top=1.5, wall=TIN, ball=(1.42, 0.02, 1000.0), square=False):
    """A tube above a floor, open below, with a small hot ball in its upper end. ball: height, radius (m), kelvin."""
    parts = Parts()
    if square:
        for x, y in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            across = (-y * radius, x * radius, 0)
            parts.add(
                quad((x * radius, y * radius, (top + bottom) / 2), across, (0, 0, (top - bottom) / 2)), AMBIENT, wall
            )
    else:
        parts.add(revolve([(radius, bottom), (radius, top)], 64), AMBIENT, wall)
    parts.add(quad((0, 0, top), (1.2 * radius, 0, 0), (0, 1.2 * radius, 0)), AMBIENT, wall)
    height, size, kelvin = ball
    parts.add(sphere(3, size), kelvin, grey(0.9), (0, 0, height))
    floor(parts, grey(0.5))
    return parts.scene(view((0.9, -1.2, 0.9), (0, 0, 0.35)), BAND, AMBIENT)


def random_tube(rng):
    radius, bottom = rng.uniform(0.04, 0.2), rng.uniform(0.15, 0.6)
    length = rng.uniform(2.0, 12.0) * radius
    size = radius * rng.uniform(0.1, 0.5)
    height = bottom + length * rng.uniform(0.5, 0.9)
    wall = grey(rng.uniform(0.03, 0.4), 1.0 if rng.random() < 0.3 else 0.0)
    return tube(radius, bottom, bottom + length, wall, (height, size, rng.uniform(600, 1400)), rng.random() < 0.4)


def baffles(rng):
    """A duct with plates from two sides by turns, and something hot behind the last: what gets out went round all."""
    parts = Parts()
    width, count = rng.uniform(0.1, 0.3), int(rng.integers(2, 7))
    gap, wall = width * rng.uniform(0.4, 1.5), grey(rng.uniform(0.02, 0.3), rng.choice((0.0, 0.0, 0.6)))
    length = gap * (count + 1)
    vertices, triangles = box((width, width, length))
    parts.add((vertices, triangles[[t for t in range(12) if t // 2 != 4]]), AMBIENT, wall, (0, 0, 0.1))
    reach = width * rng.uniform(0.5, 0.9)
    for i in range(count):
        left = 0.0 if i % 2 else width - reach
        parts.add(quad((left + reach / 2, width / 2, 0.1 + gap * (i + 1)), (reach / 2, 0, 0), (0, width / 2, 0)),
                  AMBIENT, wall)  # fmt: skip
    size = rng.uniform(0.05, 0.3) * min(width, gap)
    place = rng.uniform(0.25, 0.75, 2) * width
    parts.add(sphere(3, size / 2), rng.uniform(600, 1400), grey(0.9), (*place, 0.1 + length - gap / 2))
    floor(parts, grey(0.5))
    return parts.scene(view((0.8, -1.0, 0.8), (width / 2, width / 2, 0.1), 0.3), BAND, AMBIENT)


# Combs, fins, louvres, grooves


def comb(count=40, gap=0.005, size=(0.1, 0.04), kelvin=(300.0, 400.0), emissivity=0.3, lean=0.0):
    """Thin plates side by side on a base under a warm lid. size: width and height (m). lean: rad."""
    parts = Parts()
    width, height = size
    for i in range(count):
        vertices, triangles = turned(block((0.0002, width, height)), lean, axis=1)
        at = ((i - (count - 1) / 2) * gap, 0, height / 2 * np.cos(lean) + 0.0001)
        parts.add((vertices, triangles), kelvin[i % len(kelvin)], grey(emissivity), at)
    half = 0.75 * max(count * gap, width)
    floor(parts, grey(0.5), half=half)
    floor(parts, grey(0.9), 320.0, half, 0.3)
    camera = view((0.25 * half, -2.6 * half, 0.2), (0, -0.25 * half, 0.3 * height))
    return parts.scene(camera, BAND, AMBIENT)


def random_comb(rng):
    gap, height = rng.uniform(0.002, 0.015), rng.uniform(0.02, 0.08)
    kelvin = AMBIENT + rng.uniform(-40, 200, rng.integers(2, 5))
    return comb(
        int(rng.integers(10, 60)), gap, (rng.uniform(0.04, 0.2), height), kelvin, rng.uniform(0.05, 0.8),
        rng.uniform(-0.5, 0.5) if rng.random() < 0.4 else 0.0,
    )  # fmt: skip


def fins(rng):
    """A hot pipe with thin round fins above a floor."""
    parts = Parts()
    radius, count, gap = rng.uniform(0.02, 0.05), int(rng.integers(10, 50)), rng.uniform(0.004, 0.02)
    outer, material = radius * rng.uniform(1.5, 4.0), grey(rng.uniform(0.05, 0.6))
    half = count * gap / 2
    kelvin = rng.uniform(320, 700)
    parts.add(cylinder((-half, 0, 0.2), (half, 0, 0.2), radius, 48), kelvin, material)
    for i in range(count):
        x = (i - (count - 1) / 2) * gap
        ring = [(radius, 0.0), (outer, 0.0), (outer, 0.0003), (radius, 0.0003), (radius, 0.0)]
        cool = AMBIENT + (kelvin - AMBIENT) * rng.uniform(0.1, 0.9)
        parts.add(revolve(ring, 48, (x, 0, 0.2), (1, 0, 0)), cool, material)
    floor(parts, grey(0.6))
    return parts.scene(view((0.3, -0.7, 0.5), (0, 0, 0.12)), BAND, AMBIENT)


def louvres(rng):
    """Slats before an opening of a box with a small hot thing in it; the floor before it is lit between them."""
    parts = Parts()
    depth, count = rng.uniform(0.2, 0.6), int(rng.integers(6, 30))
    wall, slat = grey(rng.uniform(0.2, 0.9)), grey(rng.uniform(0.05, 0.7), 1.0 if rng.random() < 0.2 else 0.0)
    shell(parts, (1.0, depth, 1.0), AMBIENT, wall, skip=(2,))
    size = rng.uniform(0.02, 0.1)
    parts.add(
        sphere(3, size),
        rng.uniform(500, 1200),
        grey(0.9),
        rng.uniform((0.2, 0.3 * depth, 0.2), (0.8, depth - size, 0.8)),
    )
    gap, lean = 1.0 / count, rng.uniform(-0.9, 0.9)
    for i in range(count):
        mesh = turned(block((0.99, gap * rng.uniform(0.8, 1.3), 0.001)), lean, axis=0)
        parts.add(mesh, AMBIENT, slat, (0.5, -0.75 * gap, (i + 0.5) * gap))
    parts.add(grid((-1, -2, -0.01), (3, 0, 0), (0, 2.0 + depth, 0)), AMBIENT, grey(0.5))
    return parts.scene(view((2.0, -2.2, 1.4), (0.5, -0.5, 0.2)), BAND, AMBIENT)


def grooves(rng):
    """A plate with deep grooves, whose bottoms are warm, beside a small hot ball."""
    parts = Parts()
    count, gap = int(rng.integers(8, 40)), rng.uniform(0.005, 0.03)
    depth, width = gap * rng.uniform(1.0, 8.0), rng.uniform(0.3, 0.9) * gap
    ridge, bottom = grey(rng.uniform(0.03, 0.6)), grey(rng.uniform(0.2, 0.9))
    half = count * gap / 2
    for i in range(count + 1):
        parts.add(
            box((gap - width, 2 * half, depth)), AMBIENT, ridge, (i * gap - half - (gap - width) / 2, -half, 0.0001)
        )
    floor(parts, bottom, rng.uniform(310, 400), half + gap)
    size = rng.uniform(0.02, 0.1) * half
    parts.add(
        sphere(3, size),
        rng.uniform(500, 1200),
        grey(0.9),
        (rng.uniform(-half, half), 0, depth + rng.uniform(2, 6) * size),
    )
    return parts.scene(view((1.2 * half, -2.2 * half, 2.4 * half + depth), (0, 0, depth)), BAND, AMBIENT)


# Landscapes


def heights(x, y, hills):
    """Of hills (n, 4): wave numbers (1/m) along x and y, phase, and height (m)."""
    along, across, phase, height = np.transpose(hills)
    return np.sum(height * np.sin(x[..., None] * along + y[..., None] * across + phase), axis=-1)


def terrain(seed=1, cubes=12, kelvin=900.0, world=285.0, spread=40.0):
    """2 km of hills at 285 K with hot cubes of 1 m that float 0.5 m above the ground around the middle."""
    rng = np.random.default_rng(seed)
    turn, length = rng.uniform(0, 2 * np.pi, 6), rng.uniform(80, 700, 6)
    wave = 2 * np.pi / length
    hills = np.column_stack((wave * np.cos(turn), wave * np.sin(turn), rng.uniform(0, 2 * np.pi, 6), 0.025 * length))
    cells = 160
    x, y = np.meshgrid(*(np.linspace(-1000.0, 1000.0, cells + 1),) * 2)
    middle = heights(np.zeros(1), np.zeros(1), hills)[0]
    ground = heights(x, y, hills) - middle
    parts = Parts()
    soil = grey(0.8)
    parts.add((np.column_stack((x.ravel(), y.ravel(), ground.ravel())), grid_triangles(cells, cells)), 285.0, soil)
    places = rng.uniform(-spread, spread, (cubes, 2))
    step = 2000.0 / cells
    for a, b in places:
        i, j = (int((v + 1000.0) // step) for v in (a, b))
        top = ground[j : j + 2, i : i + 2].max()  # of the cell, so that no cube touches the ground
        parts.add(block((1.0, 1.0, 1.0)), kelvin, grey(0.9), (a, b, top + 1.0))
    return parts.scene(view((0.0, -2.0 * spread, 0.6 * spread), (0, 0, 0)), BAND, world)


def random_terrain(rng):
    seed, cubes = int(rng.integers(1 << 30)), int(rng.integers(1, 40))
    return terrain(seed, cubes, rng.uniform(400, 1200), 285.0 if rng.random() < 0.5 else 240.0, rng.uniform(10, 200))


def many(rng):
    """Many small emitters of a few temperatures above a floor and between walls."""
    parts = Parts()
    count = int(10 ** rng.uniform(1.5, 3.5))
    kelvin = rng.uniform(280, 900, 5)
    radius = 0.3 / np.sqrt(count) * rng.uniform(0.2, 0.8)
    places = rng.uniform((0.05, 0.05, 0.05), (0.95, 0.95, 0.95), (count, 3))
    size = radius * rng.uniform(0.5, 1.5, count)
    for which, temperature in enumerate(kelvin):
        chosen = places[which :: len(kelvin)], size[which :: len(kelvin)]
        small = sphere(0 if count > 300 else 2)
        vertices = np.concatenate([s * small[0] + at for at, s in zip(*chosen, strict=True)])
        triangles = np.concatenate([small[1] + i * len(small[0]) for i in range(len(chosen[0]))])
        parts.add((vertices, triangles), temperature, grey(rng.uniform(0.3, 0.95)))
    shell(parts, (1.0, 1.0, 1.0), AMBIENT, grey(rng.uniform(0.2, 0.8)), skip=(2, 5) if rng.random() < 0.5 else (2,))
    return parts.scene(view((0.5, -1.6, 0.6), (0.5, 0.5, 0.45)), BAND, AMBIENT)


# Rooms, doors, holes


def door(rng):
    """Two rooms and a door ajar: a small hot thing in the dark one, the camera in the other."""
    parts = Parts()
    wall = grey(rng.uniform(0.2, 0.9))
    shell(parts, (4.0, 6.0, 2.6), AMBIENT, wall)
    wall_with_hole(parts, 3.0, (4.0, 2.6), (1.5, 2.4, 0.0, 2.0), wall)
    parts.add(turned(box((0.9, 0.04, 1.99)), -rng.uniform(0.01, 0.6)), AMBIENT, wall, (1.5, 2.98, 0.005))
    size = rng.uniform(0.03, 0.3)
    parts.add(
        block((size, size, size)), rng.uniform(400, 1200), grey(0.9), rng.uniform((0.4, 3.8, 0.4), (3.6, 5.6, 2.2))
    )
    return parts.scene(view((0.5, 0.4, 1.6), (2.2, 3.0, 0.7), 0.6), BAND, AMBIENT)


def keyhole(rng):
    """A closed box with a small hole, a hot ball inside, and the floor before the hole."""
    parts = Parts()
    wall, hole = grey(rng.uniform(0.05, 0.6)), rng.uniform(0.004, 0.04)
    size = (0.5, 0.5)
    x, z = rng.uniform(0.1, 0.4, 2)
    wall_with_hole(parts, 0.0, size, (x - hole, x + hole, z - hole, z + hole), wall)
    shell(parts, (0.5, 0.5, 0.5), AMBIENT, wall, skip=(2,))
    radius = rng.uniform(0.01, 0.06)
    parts.add(sphere(3, radius), rng.uniform(700, 1500), grey(0.9), rng.uniform((0.1, 0.15, 0.1), (0.4, 0.4, 0.4)))
    parts.add(grid((-0.5, -1.0, -0.002), (1.5, 0, 0), (0, 1.6, 0)), AMBIENT, grey(0.5))
    return parts.scene(view((1.2, -1.1, 0.9), (0.25, -0.25, 0.05)), BAND, AMBIENT)


def nested(rng):
    """Boxes in one another, each open at another side, with a hot ball in the middle."""
    parts = Parts()
    count = int(rng.integers(2, 5))
    for i in range(count):
        size = 1.0 - 0.7 * i / count
        open_side = rng.integers(6)
        kept = [face for face in range(6) if face != open_side]
        vertices, triangles = block((size, size, size))
        chosen = [t for face in kept for t in (2 * face, 2 * face + 1)]
        skew = rng.uniform(-0.03, 0.03, 3)
        parts.add(
            (vertices, triangles[chosen]),
            AMBIENT + rng.uniform(-5, 20),
            grey(rng.uniform(0.05, 0.6)),
            skew + (0, 0, 0.6),
        )
    parts.add(sphere(3, 0.05), rng.uniform(500, 1200), grey(0.9), (0, 0, 0.6))
    floor(parts, grey(0.5), half=2.0)
    return parts.scene(view((1.6, -2.4, 1.8), (0, 0, 0.45)), BAND, AMBIENT)


def grate(rng):
    """A grate of thin bars over a pit with hot plates in it, under a ceiling that they light through it."""
    parts = Parts()
    count, depth = int(rng.integers(8, 40)), rng.uniform(0.1, 0.6)
    bar = grey(rng.uniform(0.05, 0.8))
    thick = rng.uniform(0.1, 0.6) / count
    for i in range(count):
        at = -0.5 + (i + 0.5) / count
        parts.add(block((thick, 1.0, thick)), AMBIENT, bar, (at, 0, 0))
        parts.add(block((1.0, thick, thick)), AMBIENT, bar, (0, at, 1.01 * thick))
    shell(parts, (1.0, 1.0, depth), AMBIENT, grey(rng.uniform(0.1, 0.8)), skip=(5,))
    parts.vertices[-1] = parts.vertices[-1] - (0.5, 0.5, depth + thick)
    plate = rng.uniform(0.02, 0.2)
    x, y = rng.uniform(-0.35, 0.35, 2)
    parts.add(block((plate, plate, 0.01)), rng.uniform(400, 1000), grey(0.9), (x, y, 0.02 - depth - thick))
    floor(parts, grey(0.5), height=0.8)
    return parts.scene(view((0.3, -1.9, 0.45), (0, 0, 0.3), 0.5), BAND, AMBIENT)


def bulb(rng):
    """A hot bulb in a shade, a cone that opens downwards, over a floor and beside a wall."""
    parts = Parts()
    narrow, wide, length = rng.uniform(0.02, 0.08), rng.uniform(0.1, 0.25), rng.uniform(0.1, 0.4)
    bottom = rng.uniform(0.3, 0.9)
    shade = grey(rng.uniform(0.03, 0.5), rng.choice((0.0, 0.0, 0.5, 1.0)))
    parts.add(revolve([(wide, bottom), (narrow, bottom + length), (0.0, bottom + length)], 64), AMBIENT, shade)
    size = narrow * rng.uniform(0.2, 0.8)
    height = bottom + length * rng.uniform(0.3, 0.9) - size
    parts.add(sphere(3, size), rng.uniform(700, 1500), grey(0.9), (0, 0, height))
    floor(parts, grey(0.5))
    parts.add(quad((0, 0.9, 0.75), (1, 0, 0), (0, 0, 0.75)), AMBIENT, grey(0.7))
    return parts.scene(view((1.1, -1.8, 1.1), (0, 0, 0.4), 0.5), BAND, AMBIENT)


def hidden(rng):
    """A closed room with one hot bulb behind a screen: all that can be seen is lit at second hand."""
    parts = Parts()
    shell(parts, (3.0, 4.0, 2.5), AMBIENT, grey(rng.uniform(0.1, 0.8)))
    x, z = rng.uniform(0.6, 2.4), rng.uniform(0.6, 1.9)
    size = rng.uniform(0.01, 0.06)
    parts.add(sphere(3, size), rng.uniform(700, 1500), grey(0.9), (x, 3.6, z))
    parts.add(block((1.0, 0.02, 1.0)), AMBIENT, grey(rng.uniform(0.2, 0.9)), (x, 3.4, z))
    parts.add(block((0.4, 0.4, 0.8)), AMBIENT, grey(0.6), (1.2, 2.0, 0.41))
    return parts.scene(view((1.5, 0.3, 1.3), (1.5, 3.4, 1.0), 0.7), BAND, AMBIENT)


# Mirrors and rough metal


def mirrors(rng):
    """Flat and round mirrors beside a small hot ball, over a floor that shows their reflections."""
    parts = Parts()
    metal = grey(rng.uniform(0.02, 0.3), rng.choice((0.6, 1.0, 1.0)))
    if rng.random() < 0.5:
        radius = rng.uniform(0.2, 0.6)
        parts.add(revolve([(radius, 0.0001), (radius, rng.uniform(0.1, 0.4))], 128), AMBIENT, metal)
    for _ in range(rng.integers(1, 4)):
        turn = rng.uniform(0, 2 * np.pi)
        away, across = np.array((np.cos(turn), np.sin(turn), 0.0)), np.array((-np.sin(turn), np.cos(turn), 0.0))
        parts.add(quad(rng.uniform(0.65, 0.9) * away + (0, 0, 0.21), 0.2 * across, (0, 0, 0.2)), AMBIENT, metal)
    size = rng.uniform(0.01, 0.06)
    parts.add(sphere(3, size), rng.uniform(600, 1300), grey(0.9), rng.uniform((-0.3, -0.3, 0.08), (0.3, 0.3, 0.5)))
    floor(parts, grey(0.5))
    return parts.scene(view((0.6, -2.2, 1.7), (0, 0, 0.05)), BAND, AMBIENT)


def reflector(rng):
    """A hot filament near the focus of a dish, of mirror or of rough metal, that throws its light at a wall."""
    parts = Parts()
    focus, radius = rng.uniform(0.02, 0.1), rng.uniform(0.08, 0.25)
    metal = grey(rng.uniform(0.02, 0.2), rng.choice((0.7, 1.0, 1.0)), rng.choice((0.0, 0.0, 0.08, 0.3)))
    r = np.linspace(radius, 0.0, 24)
    at, aim = np.array((0.0, -0.6, 0.35)), np.array((rng.uniform(-0.3, 0.3), 1.0, rng.uniform(-0.2, 0.2)))
    aim /= np.linalg.norm(aim)
    parts.add(revolve(np.column_stack((r, r**2 / (4.0 * focus))), 96, at, aim), AMBIENT, metal)
    middle = at + focus * rng.uniform(0.6, 1.4) * aim
    half = np.array((rng.uniform(0.005, 0.02), 0.0, 0.0))
    filament = cylinder(middle - half, middle + half, rng.uniform(0.001, 0.006), 12)
    parts.add(filament, rng.uniform(700, 1500), grey(0.9))
    parts.add(quad((0, 0.8, 0.6), (1.2, 0, 0), (0, 0, 0.6)), AMBIENT, grey(rng.uniform(0.3, 0.9)))
    floor(parts, grey(0.5), half=1.2)
    return parts.scene(view((1.0, -2.0, 1.1), (0, 0.1, 0.3), 0.5), BAND, AMBIENT)


def rough(roughness=0.15, emissivity=0.2, specular=1.0, ball=((0.35, 0.1, 0.12), 0.03, 1200.0), lean=0.0):
    """A plate of rough metal on a floor, beside a small hot ball. ball: place and radius (m), kelvin. lean: rad."""
    parts = Parts()
    plate = turned(block((0.5, 0.8, 0.01)), lean, axis=1)
    parts.add(plate, AMBIENT, grey(emissivity, specular, roughness), (0, 0, 0.006 + 0.25 * abs(np.sin(lean))))
    place, radius, kelvin = ball
    parts.add(sphere(3, radius), kelvin, grey(0.9), place)
    floor(parts, grey(0.5))
    return parts.scene(view((-0.9, -0.9, 0.7), (0.05, 0, 0)), BAND, AMBIENT)


def random_rough(rng):
    place = rng.uniform((0.3, -0.3, 0.08), (0.5, 0.3, 0.4))
    specular = rng.choice((0.4, 0.8, 1.0))
    ball = place, rng.uniform(0.01, 0.05), rng.uniform(600, 1300)
    return rough(rng.uniform(0.05, 0.7), rng.uniform(0.05, 0.5), specular, ball, rng.uniform(0, 0.6))


# Pipes, wires, corners, stairs, jars, cracks


def pipe(rng):
    """A pipe of mirrors, or of metal that is nearly one, that leads the light of a hot ball down to a floor."""
    parts = Parts()
    radius, bottom = rng.uniform(0.03, 0.15), rng.uniform(0.05, 0.3)
    length = rng.uniform(3, 14) * radius
    wall = grey(rng.uniform(0.02, 0.15), rng.choice((1.0, 0.9)), rng.choice((0.0, 0.0, 0.1)))
    parts.add(revolve([(radius, bottom), (radius, bottom + length)], 48), AMBIENT, wall)
    size, kelvin = radius * rng.uniform(0.1, 0.4), rng.uniform(600, 1300)
    parts.add(sphere(3, size), kelvin, grey(0.9), (0, 0, bottom + length * rng.uniform(0.5, 0.95)))
    floor(parts, grey(0.5))
    return parts.scene(view((0.9, -1.2, 0.9), (0, 0, 0.15)), BAND, AMBIENT)


def fence(rng):
    """Thin upright wires, some of them hot, before a warm plate."""
    parts = Parts()
    count, gap, radius = int(rng.integers(8, 40)), rng.uniform(0.012, 0.05), rng.uniform(0.0008, 0.004)
    for i in range(count):
        x = (i - (count - 1) / 2) * gap
        kelvin = AMBIENT if rng.random() < 0.7 else rng.uniform(400, 900)
        metal = grey(rng.uniform(0.1, 0.9), rng.choice((0.0, 1.0)))
        parts.add(cylinder((x, 0, 0.001), (x, 0, 0.6), radius, 12), kelvin, metal)
    plate = quad((0, 0.25, 0.3), (0.4, 0, 0), (0, 0, 0.28))
    parts.add(plate, rng.uniform(330, 600), grey(rng.uniform(0.3, 0.95)))
    floor(parts, grey(0.4))
    return parts.scene(view((0.3, -1.3, 0.7), (0, 0, 0.2)), BAND, AMBIENT)


def corner(rng):
    """A corner of three plates of rough metal, which reflect one another, and small hot balls."""
    parts = Parts()
    metal = grey(rng.uniform(0.05, 0.3), rng.choice((0.7, 1.0)), rng.uniform(0.06, 0.4))
    x, y, z = 0.5 * np.eye(3)
    for middle, *sides in ((0 * z, x, y), (y + z, x, z), (z - x, y, z)):
        parts.add(quad(middle, *sides), AMBIENT, metal)
    for _ in range(rng.integers(1, 4)):
        size, kelvin = rng.uniform(0.01, 0.05), rng.uniform(500, 1200)
        parts.add(sphere(3, size), kelvin, grey(0.9), rng.uniform((-0.35, -0.35, 0.06), (0.35, 0.35, 0.6)))
    return parts.scene(view((1.0, -1.3, 1.1), (0, 0.05, 0.2)), BAND, AMBIENT)


def stairs(rng):
    """Stairs with a thin hot bar under the nose of each, millimetres off tread and riser."""
    parts = Parts()
    count, height, depth = int(rng.integers(3, 9)), rng.uniform(0.05, 0.15), rng.uniform(0.08, 0.2)
    stone, off = grey(rng.uniform(0.1, 0.8)), rng.uniform(0.001, 0.01)
    for i in range(count):
        parts.add(quad((0, (i + 0.5) * depth, i * height), (0.5, 0, 0), (0, depth / 2, 0)), AMBIENT, stone)
        parts.add(quad((0, (i + 1) * depth, (i + 0.5) * height), (0.5, 0, 0), (0, 0, height / 2)), AMBIENT, stone)
        size = rng.uniform(0.002, 0.01)
        at = np.array((0, (i + 1) * depth - off - size / 2, (i + 1) * height - off - size / 2 - 0.003))
        parts.add(block((0.8, size, size)), rng.uniform(400, 900), grey(0.9), at)
    camera = view((0.6, -1.0, count * height + 0.6), (0, count * depth / 2, count * height / 2))
    return parts.scene(camera, BAND, AMBIENT)


def jar(rng):
    """A hot ball in a jar of a thin film that lets some of its light through, between boxes of all kinds."""
    parts = Parts()
    tau, shine = rng.uniform(0.2, 0.6), rng.choice((0.0, 1.0))
    film = Material("film", float(min(rng.uniform(0.05, 0.4), 1.0 - tau)), float(shine), transmittance=float(tau))
    radius = rng.uniform(0.1, 0.25)
    parts.add(revolve([(radius, 0.02), (radius, 0.5)], 64), rng.uniform(300, 340), film)
    size, kelvin = rng.uniform(0.01, 0.05), rng.uniform(600, 1300)
    parts.add(sphere(3, size), kelvin, grey(0.9), (rng.uniform(-0.3, 0.3) * radius, 0, rng.uniform(0.1, 0.4)))
    for _ in range(3):
        turn = rng.uniform(0, 2 * np.pi)
        material = grey(rng.uniform(0.1, 0.9), rng.choice((0.0, 1.0)), rng.choice((0.0, 0.2)))
        at = 0.5 * np.cos(turn), 0.5 * np.sin(turn), 0.15
        parts.add(block(rng.uniform(0.05, 0.25, 3)), AMBIENT, material, at)
    floor(parts, grey(0.5))
    return parts.scene(view((0.8, -1.3, 1.0), (0, 0, 0.12)), BAND, AMBIENT)


def crack(rng):
    """Two rooms on both sides of a crack of some millimetres: a hot panel in the one, the camera in the other."""
    parts = Parts()
    wall, half = grey(rng.uniform(0.1, 0.6)), rng.uniform(0.001, 0.006)
    shell(parts, (1, 1, 0.6), AMBIENT, wall, skip=(2,))
    wall_with_hole(parts, 0.5, (1, 0.6), (0.5 - half, 0.5 + half, 0, 0.6), wall)
    parts.add(quad((0.5, 0.95, 0.3), (0.3, 0, 0), (0, 0, 0.2)), rng.uniform(500, 900), grey(0.9))
    return parts.scene(view((0.5, -1.0, 0.9), (0.5, 0.3, 0.1)), BAND, AMBIENT)


def honeycomb(rng):
    """A honeycomb on a warm plate, whose cells are one to six times as deep as wide; bars across some of them glow."""
    parts = Parts()
    width, wall = rng.uniform(0.05, 0.12), grey(rng.uniform(0.1, 0.7), rng.choice((0.0, 0.0, 1.0)))
    depth, rows = width * rng.uniform(1.0, 6.0), int(rng.integers(3, 7))
    sides = [(np.cos(turn), np.sin(turn)) for turn in np.arange(3) * np.pi / 3]
    for i in range(rows):
        for j in range(rows):
            x, y = width * (i - rows / 2 + 0.5 * (j % 2)), width * np.sqrt(0.75) * (j - rows / 2)
            for across, up in sides:  # three of the six sides: neighbours bring the others
                along = width / np.sqrt(12) * np.array((-up, across, 0))
                middle = (x + 0.5 * width * across, y + 0.5 * width * up, 0.5 * depth)
                parts.add(quad(middle, along, (0, 0, 0.5 * depth)), AMBIENT, wall)
            if rng.random() < 0.2:
                at = (x, y, depth * rng.uniform(0.05, 0.5))
                parts.add(block((0.8 * width, 0.004, 0.004)), rng.uniform(500, 1100), grey(0.9), at)
    floor(parts, grey(rng.uniform(0.3, 0.9)), AMBIENT + rng.uniform(0, 60))
    half = 0.5 * rows * width
    return parts.scene(view((0.6 * half, -2.2 * half, depth + 2.0 * half), (0, 0, depth)), BAND, AMBIENT)


def clutter(rng):
    """Blocks, balls and rods of all materials thrown on a heap in a corner of two walls; a few small ones are hot."""
    parts = Parts()
    for _ in range(rng.integers(25, 70)):
        surface = grey(rng.uniform(0.05, 0.95), rng.choice((0.0, 0.0, 0.6, 1.0)), rng.choice((0.0, 0.1, 0.3)))
        hot = rng.random() < 0.12
        size, kelvin = (rng.uniform(0.01, 0.03), rng.uniform(450, 1200)) if hot else (rng.uniform(0.03, 0.12), AMBIENT)
        kind = rng.integers(3)
        if kind == 0:
            mesh = sphere(3, size)
        elif kind == 1:
            mesh = turned(turned(block(size * rng.uniform(0.5, 2.0, 3)), rng.uniform(0, 3)), rng.uniform(0, 3), axis=0)
        else:
            mesh = turned(cylinder((-2 * size, 0, 0), (2 * size, 0, 0), 0.3 * size, 24), rng.uniform(0, 3))
        at = np.append(rng.uniform(-0.45, 0.45, 2), rng.uniform(0.02, 0.35))
        parts.add(mesh, kelvin, grey(0.9) if hot else surface, at)
    floor(parts, grey(rng.uniform(0.2, 0.9)))
    parts.add(quad((0, 0.7, 0.5), (1, 0, 0), (0, 0, 0.5)), AMBIENT, grey(rng.uniform(0.1, 0.9)))
    parts.add(quad((-0.7, 0, 0.5), (0, 1, 0), (0, 0, 0.5)), AMBIENT, grey(rng.uniform(0.1, 0.9)))
    return parts.scene(view((0.9, -1.4, 0.9), (0, 0, 0.15)), BAND, AMBIENT)


def shelf(rng):
    """A case of shelves that stands off a wall, open at both sides: small hot things stand on the shelves, and what is
    seen of the wall is lit through the gap behind."""
    parts = Parts()
    count, width, depth, gap = int(rng.integers(2, 6)), 0.6, rng.uniform(0.1, 0.3), rng.uniform(0.005, 0.06)
    board, step = grey(rng.uniform(0.1, 0.8)), rng.uniform(0.12, 0.25)
    for i in range(count + 1):
        parts.add(block((width, depth, 0.01)), AMBIENT, board, (0, -gap - depth / 2, 0.05 + i * step))
    for i in range(count):
        for _ in range(rng.integers(1, 4)):
            size = rng.uniform(0.01, 0.04)
            at = (rng.uniform(-0.28, 0.28), -gap - rng.uniform(0.1, 0.9) * depth, 0.06 + i * step + size)
            mesh = sphere(3, size) if rng.random() < 0.5 else block((size, size, 2 * size))
            hot = rng.random() < 0.5
            material = grey(0.9) if hot else grey(rng.uniform(0.1, 0.9), rng.choice((0.0, 1.0)))
            parts.add(mesh, rng.uniform(400, 900) if hot else AMBIENT, material, at)
    parts.add(quad((0, 0, 0.8), (1, 0, 0), (0, 0, 0.8)), AMBIENT, grey(rng.uniform(0.1, 0.7)))
    floor(parts, grey(0.5))
    return parts.scene(view((0.7, -1.6, 0.7), (0, 0, 0.05 + count * step / 2)), BAND, AMBIENT)


def lattice(rng):
    """A lattice of rods of metal, smooth and rough, along three axes, with a hot ball in it, over a floor."""
    parts = Parts()
    count, step = int(rng.integers(3, 7)), rng.uniform(0.08, 0.15)
    radius, metal = step * rng.uniform(0.05, 0.25), grey(rng.uniform(0.03, 0.4), 1.0, rng.choice((0.0, 0.1, 0.3, 0.6)))
    half = 0.5 * step * count
    for a in range(3):
        for i in range(count):
            for j in range(count):
                end = np.zeros(3)
                end[a], at = half, np.zeros(3)
                at[(a + 1) % 3], at[(a + 2) % 3] = step * (i - count / 2 + 0.5), step * (j - count / 2 + 0.5)
                at += np.array((0, 0, half + 0.1)) + radius * (a - 1.0)  # rods pass one another
                parts.add(cylinder(at - end, at + end, 0.4 * radius, 16), AMBIENT, metal)
    ball = rng.uniform((-half, -half, 0.1), (half, half, 2 * half))
    parts.add(sphere(3, rng.uniform(0.1, 0.3) * step), rng.uniform(600, 1300), grey(0.9), ball)
    floor(parts, grey(rng.uniform(0.3, 0.9)))
    return parts.scene(view((1.6 * half, -2.6 * half, 2.5 * half), (0, 0, half)), BAND, AMBIENT)


# Gas


def things(rng):
    """A floor and blocks on and over it, of any surface, some of them warm."""
    parts = Parts()
    for _ in range(rng.integers(1, 5)):
        surface = grey(rng.uniform(0.2, 0.95), rng.choice((0.0, 0.0, 0.5, 1.0)), rng.choice((0.0, 0.2)))
        at = (*rng.uniform(-0.7, 0.7, 2), rng.uniform(0.2, 0.4))
        parts.add(block(rng.uniform(0.1, 0.4, 3)), rng.choice((AMBIENT, AMBIENT, 350.0, 500.0)), surface, at)
    floor(parts, grey(0.5))
    return parts


def body(rng, name, size, at, absorption, kelvin, scattering=0.0, anisotropy=0.0):
    """A ball, block or cylinder of gas, of about that size (m), with its middle at a place."""
    kind = rng.integers(3)
    if kind == 0:
        vertices, triangles = sphere(2, size)
    elif kind == 1:
        vertices, triangles = turned(block(size * rng.uniform(0.7, 1.8, 3)), rng.uniform(0, 1.5), axis=rng.integers(3))
    else:
        vertices, triangles = turned(cylinder((0, 0, -size), (0, 0, size), 0.7 * size, 24), rng.uniform(-1, 1), axis=1)
    return Medium(name, absorption, kelvin, scattering, anisotropy, vertices=vertices + at, triangles=triangles)


def air(rng, absorption, kelvin, scattering=0.0, anisotropy=0.0):
    """Scene options of gas that fills the world."""
    media = (Medium("air", absorption, kelvin, scattering, anisotropy),)
    return {"media": media, "world_depth": rng.uniform(1, 6)}


def over_the_floor(parts, **options):
    return replace(parts.scene(view((0.6, -2.2, 1.3), (0, 0, 0.25)), BAND, AMBIENT), **options)


def plume(rng):
    """Clear hot plumes, which overlap, around things on a floor, sometimes in air that absorbs."""
    parts = things(rng)
    media = tuple(
        body(rng, f"plume {i}", rng.uniform(0.15, 0.4), (*rng.uniform(-0.4, 0.4, 2), rng.uniform(0.3, 0.6)),
             10 ** rng.uniform(-1, 1), rng.uniform(350, 1200))
        for i in range(rng.integers(1, 4))
    )  # fmt: skip
    options = {"media": ()}
    if rng.random() < 0.5:
        options = air(rng, 10 ** rng.uniform(-2, -0.3), rng.choice((280.0, 300.0, 400.0)))
    return over_the_floor(parts, **options | {"media": media + options["media"]})


def fog(rng):
    """Air that scatters, or a cloud, around a hot ball over a floor with things."""
    parts = things(rng)
    ball = sphere(3, rng.uniform(0.06, 0.15))
    parts.add(ball, rng.uniform(400, 900), grey(0.9), (*rng.uniform(-0.5, 0.5, 2), rng.uniform(0.4, 0.7)))
    kelvin, scattering, g = rng.choice((280.0, 300.0, 330.0)), 10 ** rng.uniform(-1, 0.3), rng.uniform(-0.3, 0.9)
    if rng.random() < 0.6:
        return over_the_floor(parts, **air(rng, scattering * rng.uniform(0, 1), kelvin, scattering, g))
    at = (*rng.uniform(-0.3, 0.3, 2), 0.5)
    cloud = body(rng, "cloud", rng.uniform(0.3, 0.5), at, 3 * scattering * rng.uniform(0, 1), kelvin, 3 * scattering, g)
    return over_the_floor(parts, media=(cloud,))


def smoke(rng):
    """A rising plume in cells of different density and temperature, most of which scatters, over things on a floor."""
    parts = things(rng)
    cells = np.array([12, 12, 20])
    x, y, z = (np.indices(cells) + 0.5) / cells[:, None, None, None]
    lean = rng.uniform(-0.3, 0.3, 2)
    off = np.hypot(x - 0.5 - lean[0] * z, y - 0.5 - lean[1] * z) / (0.15 + 0.3 * z)
    density = np.exp(-2.0 * off**2) * rng.uniform(0.5, 1.5, off.shape) * (off < 1.2)
    kelvin = AMBIENT + rng.uniform(50, 900) * np.exp(-(off**2)) * (1.0 - 0.8 * z)
    size = rng.uniform((0.5, 0.5, 0.8), (0.9, 0.9, 1.2))
    low = np.array((*rng.uniform(-0.3, 0.3, 2), 0.05)) - (0.5 * size[0], 0.5 * size[1], 0)
    matrix = placed(low, low + size, cells)
    scattering = rng.choice((0.0, 1.0, 4.0))
    grid = Medium(
        "smoke", 10 ** rng.uniform(-0.5, 1), AMBIENT, scattering, 0.7, grid=Grid.from_arrays(matrix, density, kelvin)
    )
    return over_the_floor(parts, media=(grid,))


def filled(rng):
    """A room with mirrors and walls, seen from inside, full of gas, with another gas in it and a third in that."""
    parts = Parts()
    shell(parts, (2.0, 3.0, 2.0), AMBIENT, grey(rng.uniform(0.2, 0.9)), skip=(0, 1))
    for face, kelvin in ((0, AMBIENT), (1, rng.uniform(AMBIENT, 450.0))):
        others = tuple(other for other in range(6) if other != face)
        shell(parts, (2.0, 3.0, 2.0), kelvin, grey(rng.uniform(0.05, 0.9), rng.choice((0.0, 1.0))), skip=others)
    parts.add(block((0.4, 0.4, 0.8)), rng.uniform(300, 600), grey(0.6), (0.6, 2.2, 0.41))
    parts.add(sphere(3, 0.2), AMBIENT, grey(0.1, 1.0), (1.4, 1.8, 0.5))
    at, size = np.array((1.2, 2.0, 0.9)), rng.uniform(0.4, 0.6)
    scatters = rng.random(3) < 0.5
    media = []
    for i, part in enumerate((1.0, 0.4)):
        absorption, scattering = 10 ** rng.uniform(-1, 1), scatters[i] * rng.uniform(0, 4)
        kelvin, g = rng.uniform(280, 900), rng.uniform(-0.3, 0.8)
        media.append(body(rng, ("outer", "inner")[i], part * size, at, absorption, kelvin, scattering, g))
    media.append(Medium("air", 10 ** rng.uniform(-2, -0.5), rng.choice((280.0, 330.0)), scatters[2] * 0.2))
    scene = parts.scene(view((1.0, 0.1, 1.2), (1.0, 2.2, 0.8), 0.7), BAND, AMBIENT)
    return replace(scene, media=tuple(media), world_depth=1.0)


# Surfaces that vary, and skies

_EXTENSIONS = "REPEAT", "EXTEND", "MIRROR"


def random_image(rng, values, extension=None):
    """A Texture of values (height, width), of a random extension and interpolation."""
    extension = extension or str(rng.choice(_EXTENSIONS))
    return Texture(values.astype(np.float32), extension, bool(rng.integers(2)))


def hot_texels(rng, extension=None):
    """An image of temperatures, a few of whose texels are hot."""
    shape = rng.integers(4, 20, 2)
    kelvin = AMBIENT + rng.uniform(0, 20, shape)
    hot = rng.random(shape) < rng.uniform(0.01, 0.1)
    hot.flat[rng.integers(hot.size)] = True
    return random_image(rng, np.where(hot, rng.uniform(350, 900), kelvin), extension)


def painted(rng):
    """A room open to the camera: images of temperatures with hot texels, materials that images mix, a mirror."""
    parts = PaintedParts()
    light, dark = rng.uniform(0.05, 0.5), rng.uniform(0.6, 0.95)
    shell(parts, (2.0, 2.0, 2.0), AMBIENT, grey(rng.uniform(0.2, 0.9)), skip=(2, 3, 4))
    extension = str(rng.choice(_EXTENSIONS))
    mixed = [random_image(rng, rng.random(rng.integers(2, 12, 2)) ** rng.uniform(0.3, 3), extension) for _ in range(2)]
    back = Coat(random_square(rng), hot_texels(rng, extension), grey(light), mixed[0])
    parts.add(quad((1, 2, 1), (1, 0, 0), (0, 0, 1)), AMBIENT, grey(dark), coat=back)
    ground = Coat(random_square(rng), None, grey(dark), mixed[1])
    parts.add(quad((1, 1, 0), (1, 0, 0), (0, 1, 0)), AMBIENT, grey(light), coat=ground)
    plate = turned(quad((0, 0, 0), (0.4, 0, 0), (0, 0, 0.4)), rng.uniform(-0.8, 0.8))
    parts.add(plate, AMBIENT, grey(0.6), (0.5, 1.2, 0.45), Coat(random_square(rng), hot_texels(rng)))
    metal = turned(quad((0, 0, 0), (0.25, 0, 0), (0, 0, 0.3)), rng.uniform(-0.8, 0.8))
    parts.add(metal, AMBIENT, grey(0.1, 1.0), (1.5, 1.4, 0.31))
    return parts.scene(view((1.0, -2.6, 1.4), (1.0, 1.0, 0.8)), BAND, AMBIENT)


def curved(rng):
    """A vase and a bowl of any lobes, shaded smooth, beside a small hot ball on a floor."""
    parts = PaintedParts()
    height, rings, waist = rng.uniform(0.4, 0.9), 64, rng.uniform(0.05, 0.12)
    for x, bottom in ((-0.35, 0.01), (0.35, 0.05)):
        z = np.linspace(0.0, height, rings)
        radius = 0.16 + waist * np.sin(rng.uniform(2, 6) * z / height + rng.uniform(0, 6))
        surface = grey(rng.uniform(0.05, 0.5), rng.choice((0.0, 0.5, 1.0)), rng.choice((0.0, 0.25, 0.5)))
        vertices, triangles, normals = turned_profile(np.column_stack((radius, z)), 128)
        parts.add((vertices, triangles), AMBIENT, surface, (x, rng.uniform(-0.3, 0.3), bottom), normals=normals)
    place = rng.uniform((-0.1, -0.6, 0.1), (0.1, -0.2, 0.6))
    parts.add(sphere(3, rng.uniform(0.02, 0.08)), rng.uniform(500, 1200), grey(0.9), place)
    floor(parts, grey(0.5))
    return parts.scene(view((0.5, -2.2, 1.2), (0, 0, 0.3)), BAND, AMBIENT)


def leaves(rng):
    """Leaves that an image cuts out of cards, some warm, some translucent, and a film over a floor with a hot ball."""
    parts = PaintedParts()
    floor(parts, grey(0.5))
    rows, columns = np.indices((32, 16)) + 0.5
    lobes = 1.0 + 0.2 * np.sin(rng.uniform(2, 9) * np.arctan2(rows - 16, columns - 8))
    inside = np.hypot((columns - 8) / 7, (rows - 16) / 15) < lobes
    holes = Texture((~inside).astype(np.float32), "EXTEND", True)
    passes = rng.uniform(0.05, 0.3)
    kinds = grey(rng.uniform(0.6, 0.95)), Material("leaf", float(rng.uniform(0.4, 0.6)), transmittance=float(passes))
    size = rng.uniform(0.08, 0.2)
    for _ in range(rng.integers(10, 40)):
        leaf = turned(quad((0, 0, 0), (0.5 * size, 0, 0), (0, 0, size)), rng.uniform(0, 3), axis=rng.integers(2))
        at = rng.uniform((-0.6, -0.6, 0.25), (0.6, 0.6, 0.9))
        kelvin = rng.choice((AMBIENT, AMBIENT, AMBIENT + rng.uniform(5, 40)))
        coat = Coat(whole_square(), None, NOTHING, holes)
        parts.add(turned(leaf, rng.uniform(0, 6)), kelvin, kinds[rng.integers(2)], at, coat)
    film = Material("film", float(rng.uniform(0.05, 0.4)), transmittance=float(rng.uniform(0.2, 0.5)))
    parts.add(quad((rng.uniform(-0.5, 0.5), -0.7, 0.35), (0.3, 0.1, 0), (0, 0, 0.3)), 310.0, film)
    ball = sphere(3, rng.uniform(0.08, 0.2))
    parts.add(ball, rng.uniform(350, 600), grey(0.9), (*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.3, 0.8)))
    return parts.scene(view((0.6, -2.2, 1.3), (0, 0, 0.4)), BAND, AMBIENT)


def skylit(rng):
    """Blocks, a mirror ball and a wall of holes on a ground under a sky: an image, colder upwards, with a warm spot."""
    parts = PaintedParts()
    floor(parts, grey(rng.uniform(0.4, 0.9)), 290.0)
    for _ in range(rng.integers(2, 6)):
        surface = grey(rng.uniform(0.1, 0.95), rng.choice((0.0, 0.0, 0.5, 1.0)))
        at = (*rng.uniform(-0.7, 0.7, 2), rng.uniform(0.22, 0.4))
        parts.add(block(rng.uniform(0.1, 0.4, 3)), rng.uniform(280, 320), surface, at)
    parts.add(sphere(3, 0.15), 290.0, grey(0.0, 1.0), (*rng.uniform(-0.3, 0.3, 2), 0.8))
    holes = random_image(rng, (rng.random((5, 7)) < 0.5).astype(float))
    coat = Coat(random_square(rng), None, NOTHING, replace(holes, closest=True))
    parts.add(quad((0, 0.6, 0.41), (0.6, 0.1, 0), (0, 0, 0.4)), 300.0, grey(0.3), coat=coat)
    height, width = rng.integers(8, 40, 2)
    zenith = 180.0 * (1.0 - (np.arange(height) + 0.5) / height)
    kelvin = np.interp(zenith, (0, 90, 100, 180), (rng.uniform(200, 260), 285, 290, 290))[:, None]
    kelvin = kelvin + rng.uniform(0, 15, (height, width))
    kelvin[rng.integers(height // 2 + 1, height - 1), rng.integers(width)] = rng.uniform(300, 900)
    sky = Sky(kelvin.astype(np.float32))
    return replace(parts.scene(view((0.6, -2.2, 1.3), (0, 0, 0.35)), BAND, AMBIENT), sky=sky)


def distant(rng):
    """A plain with hot things and wires from 50 m to 1.5 km away: most of them fill little of a pixel."""
    parts, height = Parts(), rng.uniform(2.0, 40.0)
    parts.add(quad((0, 1000, 0), (1500, 0, 0), (0, 1500, 0)), 285.0, grey(rng.uniform(0.7, 1.0)))
    for _ in range(rng.integers(5, 60)):
        away, size = 10 ** rng.uniform(1.7, 3.2), rng.uniform(0.1, 2.0)
        mesh = sphere(2, 0.5 * size) if rng.random() < 0.5 else turned(block((size, size, size)), rng.uniform(0, 1.5))
        above = 0.5 * size + 10 ** rng.uniform(-1.0, 1.5)
        at = away * rng.uniform(-0.4, 0.4), away, above
        parts.add(mesh, rng.uniform(310.0, 1200.0), grey(rng.uniform(0.3, 1.0)), at)
    for _ in range(rng.integers(1, 5)):
        away, width = rng.uniform(30.0, 400.0), 10 ** rng.uniform(-2.3, -0.7)
        wire = turned(block((2.0 * away, width, width)), rng.uniform(-0.5, 0.5))
        parts.add(wire, rng.uniform(290.0, 500.0), grey(rng.uniform(0.3, 0.9)), (0, away, rng.uniform(5.0, 25.0)))
    return parts.scene(view((0, 0, height), (0, 200, 8)), BAND, 270.0)


FAMILIES = {
    "tube": random_tube,
    "baffles": baffles,
    "comb": random_comb,
    "fins": fins,
    "louvres": louvres,
    "grooves": grooves,
    "terrain": random_terrain,
    "many": many,
    "door": door,
    "keyhole": keyhole,
    "nested": nested,
    "grate": grate,
    "bulb": bulb,
    "hidden": hidden,
    "mirrors": mirrors,
    "reflector": reflector,
    "rough": random_rough,
    "pipe": pipe,
    "fence": fence,
    "corner": corner,
    "stairs": stairs,
    "jar": jar,
    "crack": crack,
    "distant": distant,
    "honeycomb": honeycomb,
    "clutter": clutter,
    "shelf": shelf,
    "lattice": lattice,
    "plume": plume,
    "fog": fog,
    "smoke": smoke,
    "filled": filled,
    "painted": painted,
    "curved": curved,
    "leaves": leaves,
    "skylit": skylit,
}
FIXED = {"tube": tube, "comb": comb, "terrain": terrain, "rough": rough}


def member(family, index):
    """Member of a family: 0 is the fixed one if there is one, others are random and always the same."""
    if index == 0 and family in FIXED:
        return FIXED[family]()
    return FAMILIES[family](np.random.default_rng((zlib.crc32(family.encode()), index)))
