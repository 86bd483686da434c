# SPDX-License-Identifier: GPL-3.0-or-later
"""Make engine.blend: a four-cylinder engine that ran hot, on a stand under a clear sky.

    python -m docs.examples.engine

Bright metal is a bad emitter and a good mirror: the heat shield and the manifold show each other, the sky and the
floor. The temperature along the exhaust is painted as the attribute `temperature`.
"""

from __future__ import annotations

import numpy as np

from docs.examples.modelling import (
    ALONG_X,
    ALONG_Y,
    FOLDER,
    add,
    add_camera,
    add_sky,
    box,
    choose_settings,
    curve,
    grid,
    joined,
    lying,
    prism,
    save,
    surface,
    tube,
    turned,
)

CYLINDERS = np.array([-0.27, -0.09, 0.09, 0.27])  # m, along x; the exhaust is at -y, the inlet at +y


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "iron": surface("Cast iron", "Iron, weathered", 0.2, 0.4, (0.35, 0.33, 0.32)),
        "pipe": surface("Oxidised pipe", "Magnetite", 0.6, 0.25, (0.3, 0.2, 0.15)),
        "aluminium": surface("Cast aluminium", "Aluminium, weathered", 0.6, 0.3, (0.7, 0.7, 0.72)),
        "polished": surface("Polished aluminium", "Aluminium, polished", 1.0, 0.06, (0.9, 0.9, 0.92)),
        "chrome": surface("Chromium", "Chromium, polished", 1.0, 0.0, (0.85, 0.87, 0.9)),
        "steel": surface("Steel", "Steel, cold rolled", 0.8, 0.2, (0.6, 0.6, 0.62)),
        "lacquer": surface("Lacquer", "Paint, lacquer on aluminium", 0.6, 0.15, (0.6, 0.1, 0.1)),
        "black": surface("Black paint", "Paint, ultra-flat black", colour=(0.05, 0.05, 0.05)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", 0.2, 0.4, (0.1, 0.1, 0.1)),
        "plastic": surface("Plastic", "Plastic, polycarbonate", 0.4, 0.3, (0.15, 0.15, 0.2)),
        "concrete": surface("Concrete", "Concrete, new", 0.35, 0.18, (0.6, 0.6, 0.58)),
    }
    add_block(materials)
    add_head(materials)
    add_exhaust(materials)
    add_belt_side(materials)
    add_cooling(materials)
    add_stand(materials)
    add_sky("Clear sky", 255.0)
    add_camera((-1.15, -1.75, 1.45), (-0.06, -0.03, 0.72), lens=41.0)
    choose_settings((8.1, 13.9, 8), "INFERNO", (278.15, 443.15), passes=6)


def add_block(materials) -> None:
    """Block, oil pan, filter and the ribs that stiffen the block."""
    block = grid_box((-0.4, -0.15, 0.55), (0.4, 0.15, 0.88), 0.04)
    near = np.exp(-(((block[0][:, :1] - CYLINDERS) / 0.06) ** 2)).max(axis=1)
    add("Block", block, materials["iron"], 352 + 45 * (block[0][:, 2] - 0.55) + 7 * near)
    ribs = [box((x - 0.008, -0.172, 0.57), (x + 0.008, -0.149, 0.86)) for x in (-0.36, -0.18, 0.0, 0.18, 0.36)]
    ribs += [box((-0.39, -0.168, z), (0.39, -0.149, z + 0.014)) for z in (0.6, 0.72)]
    add("Ribs", joined(*ribs), materials["iron"], 352, bevel=0.003)
    pan = prism([(-0.38, 0.55), (0.38, 0.55), (0.36, 0.47), (0.05, 0.45), (-0.1, 0.36), (-0.36, 0.36)][::-1], 0.27)
    add("Oil pan", (pan[0], pan[1]), materials["steel"], 366, bevel=0.015)
    flange = box((-0.41, -0.165, 0.54), (0.41, 0.165, 0.556))
    add("Flange", flange, materials["aluminium"], 360, bevel=0.003)
    bolts = [turned_at(0.011, 0.012, (x, -0.157, 0.556)) for x in np.linspace(-0.38, 0.38, 11)]
    add("Bolts", joined(*bolts), materials["steel"], 358)
    filter_can = turned([(0.03, 0.0), (0.05, 0.012), (0.05, 0.1), (0.044, 0.115), (0.02, 0.12)], 40)
    add("Oil filter", lying(filter_can, ALONG_Y), materials["lacquer"], 369, (0.27, -0.15, 0.65))


def grid_box(low, high, step):
    """A box whose sides are made of squares, to paint on."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    x, y, z = (x1 - x0, 0, 0), (0, y1 - y0, 0), (0, 0, z1 - z0)
    sides = ((low, x, z), ((x1, y0, z0), y, z), ((x1, y1, z0), np.negative(x), z), ((x0, y1, z0), np.negative(y), z))
    return joined(*(grid(*side, step) for side in (*sides, ((x0, y0, z1), x, y), ((x0, y1, z0), x, np.negative(y)))))


def turned_at(radius, height, place, sides=6):
    """A small upright cylinder, such as the head of a bolt."""
    vertices, faces = turned([(radius, 0), (radius, height)], sides)
    return vertices + place, faces


def add_head(materials) -> None:
    """Cylinder head, valve cover with its ribs and cap, ignition coils and their leads."""
    head = grid_box((-0.4, -0.14, 0.885), (0.4, 0.14, 0.985), 0.04)
    warmer = 10 * (head[0][:, 1] < 0)  # the side of the exhaust
    add("Head", head, materials["aluminium"], 366 + warmer)
    cover = prism([(-0.385, 0.99), (-0.385, 1.05), (-0.36, 1.085), (0.36, 1.085), (0.385, 1.05), (0.385, 0.99)], 0.2)
    add("Valve cover", cover, materials["lacquer"], 356, bevel=0.015)
    ribs = [box((-0.3, y - 0.006, 1.08), (0.22, y + 0.006, 1.094)) for y in (-0.06, -0.035, 0.035, 0.06)]
    add("Cover ribs", joined(*ribs), materials["polished"], 355, bevel=0.002)
    cap = turned([(0.04, 0), (0.042, 0.02), (0.036, 0.034), (0.01, 0.036)], 40)
    add("Oil cap", cap, materials["plastic"], 346, (0.3, 0, 1.084))
    for number, x in enumerate(CYLINDERS):
        coil = turned([(0.02, 0), (0.02, 0.03), (0.026, 0.032), (0.026, 0.055), (0.012, 0.06)], 24)
        add(f"Coil {number}", coil, materials["plastic"], 351 + 2 * number, (x, 0, 1.084))
        lead = [(x, 0, 1.14), (x + 0.01, 0.05, 1.17), (x + 0.03, 0.11, 1.12), (0.3, 0.15, 1.04)]
        add(f"Lead {number}", tube(curve(lead), 0.007, 12), materials["rubber"], 331)
    runners = [
        curve([(x, 0.13, 0.94), (x, 0.2, 0.97), (x * 0.95, 0.27, 1.06), (x * 0.9, 0.26, 1.16)]) for x in CYLINDERS
    ]
    add("Inlet runners", joined(*(tube(path, 0.03) for path in runners)), materials["plastic"], 318)
    plenum = tube([(x, 0.25, 1.18) for x in (-0.34, -0.33, 0, 0.3, 0.31)], [0.04, 0.055, 0.055, 0.055, 0.04])
    add("Inlet plenum", plenum, materials["plastic"], 314)


def add_exhaust(materials) -> None:
    """Four bent pipes that join, the pipe below, and the bright shield between them and the block."""
    joint = np.array((0.0, -0.33, 0.66))
    for number, x in enumerate(CYLINDERS):
        flange = box((x - 0.05, -0.155, 0.9), (x + 0.05, -0.141, 0.975))
        add(f"Flange {number}", flange, materials["iron"], 430, bevel=0.006)
        bend = [(x, -0.15, 0.937), (x * 0.98, -0.225, 0.93), (x * 0.85, -0.29, 0.86), (x * 0.45, -0.33, 0.76)]
        path = curve([*bend, joint + (0.18 * x, 0, 0.0)], 10)
        middle = 1 - (x / 0.27) ** 2
        add_painted_pipe(f"Manifold {number}", path, 0.027, 505 - 35 * middle, 470, materials["pipe"])
    collector = np.array([(0, -0.33, 0.69), (0, -0.33, 0.62), (0, -0.33, 0.57), (0, -0.33, 0.55)])
    add_painted_pipe("Collector", collector, [0.075, 0.06, 0.045, 0.04], 472, 452, materials["pipe"])
    down = curve([(0, -0.33, 0.56), (0, -0.33, 0.42), (0.05, -0.33, 0.3), (0.25, -0.33, 0.24), (0.75, -0.33, 0.24)], 10)
    add_painted_pipe("Downpipe", down, 0.036, 455, 372, materials["pipe"])
    clamp = lying(turned([(0.046, -0.012), (0.046, 0.012)]), ALONG_X)
    add("Clamp", clamp, materials["chrome"], 395, (0.45, -0.33, 0.24))
    shield = curve([(0, -0.185, 0.89), (0, -0.21, 0.8), (0, -0.215, 0.7), (0, -0.19, 0.6)], 8)[:, 1:]
    rows, x = len(shield), np.array([-0.33, 0.33])
    vertices = np.array([(along, y, z) for y, z in shield for along in x])
    faces = [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(rows - 1)]
    add("Heat shield", (vertices, faces), materials["polished"], 388)


def add_painted_pipe(name, path, radius, hot, cool, material):
    """A pipe that cools along its way; temperatures in K."""
    sides = 32
    fraction = np.linspace(0, 1, len(path)).repeat(sides)
    add(name, tube(path, radius, sides), material, hot + (cool - hot) * fraction**0.8)


def add_belt_side(materials) -> None:
    """Pulleys, the belt around them, and the alternator, at the end to the left."""
    wheels = {
        "Crank": (0.0, 0.53, 0.085),
        "Pump": (0.0, 0.8, 0.07),
        "Alternator": (-0.2, 0.86, 0.042),
        "Idler": (0.15, 0.68, 0.04),
    }
    for name, (y, z, radius) in wheels.items():
        groove = [(radius * 0.3, -0.012), (radius, -0.02), (radius * 0.93, -0.006), (radius * 0.93, 0.006)]
        wheel = lying(turned([*groove, (radius, 0.02), (radius * 0.3, 0.012)], 56), ALONG_X)
        add(f"{name} pulley", wheel, materials["steel"], 338 if name == "Alternator" else 344, (-0.46, y, z))
        hub = lying(turned([(0.016, -0.03), (0.016, 0.06)], 24), ALONG_X)
        add(f"{name} hub", hub, materials["chrome"], 347, (-0.46, y, z))
    loop = [(0.088, 0.53), (0.182, 0.66), (0.185, 0.71), (0.06, 0.86), (0.0, 0.885), (-0.18, 0.905), (-0.24, 0.87)]
    loop += [(-0.225, 0.82), (-0.08, 0.5), (-0.02, 0.445), (0.05, 0.46), (0.088, 0.53)]
    inner = np.array(loop[:-1])
    middle = inner.mean(axis=0)
    outer = inner + 0.006 * (inner - middle) / np.linalg.norm(inner - middle, axis=1)[:, None]
    rings = [
        np.column_stack((np.full(len(p), x), p))
        for x, p in ((-0.472, inner), (-0.472, outer), (-0.448, outer), (-0.448, inner))
    ]
    count, here = len(inner), np.arange(len(inner))
    there = (here + 1) % count
    faces = np.concatenate(
        [
            np.column_stack((a * count + here, a * count + there, b * count + there, b * count + here))
            for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))
        ]
    )
    add("Belt", (np.concatenate(rings), faces.tolist()), materials["rubber"], 341)
    body = lying(turned([(0.03, 0.02), (0.065, 0.03), (0.068, 0.12), (0.05, 0.135)], 48), ALONG_X)
    add("Alternator", body, materials["aluminium"], 349, (-0.46, -0.2, 0.86))


def add_cooling(materials) -> None:
    """A radiator behind the engine's end to the left, its hoses and clamps, and the overflow bottle."""
    fins = [box((-0.8, y, 0.5), (-0.76, y + 0.007, 1.0)) for y in np.arange(-0.1, 0.5, 0.016)]
    add("Radiator fins", joined(*fins), materials["black"], 341)
    core = grid((-0.78, 0.5, 0.5), (0, -0.6, 0), (0, 0, 0.5), 0.05)
    add("Radiator core", core, materials["black"], 337 + 24 * (core[0][:, 2] - 0.5))
    for name, z, kelvin in (("top", 1.0, 360), ("bottom", 0.44, 339)):
        tank = box((-0.82, -0.12, z), (-0.74, 0.52, z + 0.06))
        add(f"Radiator {name}", tank, materials["plastic"], kelvin, bevel=0.02)
    upper = curve(
        [(-0.74, 0.05, 1.03), (-0.66, 0.05, 1.04), (-0.55, 0.04, 1.0), (-0.46, 0.02, 0.95), (-0.39, 0.0, 0.94)]
    )
    add("Upper hose", tube(upper, 0.026), materials["rubber"], 359)
    lower = curve([(-0.74, 0.42, 0.47), (-0.62, 0.4, 0.48), (-0.5, 0.25, 0.6), (-0.39, 0.13, 0.7)])
    add("Lower hose", tube(lower, 0.026), materials["rubber"], 339)
    ring = lying(turned([(0.029, -0.006), (0.029, 0.006)], 32), ALONG_X)
    for number, place in enumerate(((-0.72, 0.05, 1.03), (-0.415, 0.005, 0.942))):
        add(f"Hose clamp {number}", ring, materials["chrome"], 352, place)
    heater = curve([(0.4, 0.02, 0.93), (0.5, 0.0, 0.95), (0.55, -0.06, 0.85), (0.5, -0.12, 0.7), (0.4, -0.13, 0.66)])
    add("Heater hose", tube(heater, 0.018, 24), materials["rubber"], 355)


def add_stand(materials) -> None:
    """A steel stand on a concrete floor that has been warmed from above, and a tool that lies on it."""
    legs = [box((x - 0.025, y - 0.025, 0.0), (x + 0.025, y + 0.025, 0.53)) for x in (-0.36, 0.36) for y in (-0.2, 0.2)]
    rails = [box((-0.5, y - 0.022, 0.06), (0.5, y + 0.022, 0.1)) for y in (-0.2, 0.2)]
    add("Stand", joined(*legs, *rails), materials["lacquer"], 293, bevel=0.006)
    mounts = [
        box((x - 0.04, side * 0.18 - 0.04, 0.532), (x + 0.04, side * 0.18 + 0.04, 0.54))
        for x in (-0.36, 0.36)
        for side in (-1, 1)
    ]
    add("Mounts", joined(*mounts), materials["rubber"], 325)
    floor = grid((-3, -3, 0), (6, 0, 0), (0, 6, 0), 0.15)
    x, y, _ = floor[0].T
    warm = 14 * np.exp(-((x / 0.5) ** 2 + (y / 0.35) ** 2)) + 12 * np.exp(
        -(((x - 0.45) / 0.4) ** 2 + ((y + 0.33) / 0.2) ** 2)
    )
    add("Floor", floor, materials["concrete"], 287.5 + warm)
    add("Ground", box((-60, -60, -0.2), (60, 60, -0.02)), materials["concrete"], 284)
    spanner = joined(
        lying(turned([(0.007, -0.1), (0.007, 0.1)], 16), ALONG_X),
        *[
            (vertices + (x, 0, -0.006), faces)
            for x in (-0.12, 0.12)
            for vertices, faces in [turned([(0.022, 0), (0.022, 0.012)], 24)]
        ],
    )
    add("Spanner", spanner, materials["chrome"], 290, (-0.45, -0.62, 0.008), (0, 0, 0.5))


if __name__ == "__main__":
    save(build, FOLDER / "engine.blend")
