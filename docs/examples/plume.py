# SPDX-License-Identifier: GPL-3.0-or-later
"""Make plume.blend: a jet engine with afterburner on its test stand, 3 to 5 um, and its exhaust.

    python -m docs.examples.plume

The exhaust is closed meshes in each other, each with a temperature and the mole fractions that it adds to those around
it. The world is filled with air, whose carbon dioxide hides most of what that of the exhaust emits, but not all.
"""

from __future__ import annotations

import numpy as np

from docs.examples.modelling import (
    FOLDER,
    add,
    add_camera,
    add_sky,
    box,
    choose_settings,
    curve,
    fill,
    gas,
    grid,
    joined,
    save,
    surface,
    tube,
    turned,
)

ALONG_X = np.array([(0, 0, 1), (0, 1, 0), (-1, 0, 0)])  # turns what stands on z to lie along x
HEIGHT = 1.35  # m, of the engine's axis, which is along x; the nozzle ends at x = 0
AIR = 286.0  # K
LAYERS = {  # from the mixed air to the core: K, mole fractions, and the outline (x, radius) in m
    "Mixed": (480.0, (0.02, 0.02, 2e-9), [(0.0, 0.3), (1.2, 0.48), (3.0, 0.68), (5.0, 0.82), (6.6, 0.7), (7.3, 0.3)]),
    "Warm": (720.0, (0.03, 0.03, 1e-8), [(0.0, 0.29), (1.2, 0.38), (3.0, 0.48), (4.6, 0.48), (5.6, 0.36), (6.0, 0.12)]),
    "Hot": (980.0, (0.03, 0.03, 3e-8), [(0.0, 0.28), (1.2, 0.32), (2.6, 0.34), (3.7, 0.26), (4.4, 0.08)]),
    "Core": (1250.0, (0.04, 0.04, 5e-8), [(0.0, 0.27), (0.8, 0.27), (1.8, 0.23), (2.7, 0.13), (3.2, 0.03)]),
}
SHOCKS = (0.42, 1.0, 1.55, 2.05)  # m, behind the nozzle: where the core is squeezed and hottest, 1400 K


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "casing": surface("Casing", "Steel, galvanised, heavily oxidised", 0.7, 0.25, (0.6, 0.6, 0.62)),
        "oxide": surface("Oxidised steel", "Magnetite", 0.3, 0.4, (0.3, 0.2, 0.15)),
        "paint": surface("Paint", "Paint, lacquer on aluminium", 0.5, 0.2, (0.7, 0.6, 0.1)),
        "concrete": surface("Concrete", 0.93, colour=(0.6, 0.6, 0.58)),
        "brick": surface("Brick", 0.92, colour=(0.5, 0.3, 0.25)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", 0.2, 0.4, (0.1, 0.1, 0.1)),
    }
    add_engine(materials)
    add_stand(materials)
    add_plume()
    add_surroundings(materials)
    fill(add_sky("Air under clouds", AIR), gas="Air, 20 C, 50 % humidity", depth=1000.0)
    add_camera((1.2, -11.5, 2.3), (1.75, 0.0, 1.42), lens=36.0)
    choose_settings(bands(), "INFERNO", (273.15, 773.15), passes=3, time_limit=110.0, percentage=75)


def bands() -> str:
    """Edges in um: steps of 0.5 to 0.04, and of 0.02 in the band of carbon dioxide."""
    edges = [
        *np.arange(3.0, 3.9, 0.5),
        *np.arange(4.0, 4.17, 0.04),
        *np.arange(4.18, 4.59, 0.02),
        *np.arange(4.6, 5.1, 0.2),
    ]
    return ", ".join(f"{edge:.2f}" for edge in edges)


def lying(shape):
    """What stands on z along the engine's axis."""
    return shape[0] @ ALONG_X.T + (0, 0, HEIGHT), shape[1]


def revolved(outline, sides=64):
    """A body of revolution about the engine's axis. outline: [(x, radius), ...]."""
    return lying(turned([(radius, x) for x, radius in outline], sides))


def add_plume() -> None:
    """The layers, and the spindles where shocks heat the core."""
    for number, (name, (kelvin, fractions, outline)) in enumerate(LAYERS.items()):
        path = curve([(x, 0, radius) for x, radius in outline], 10)
        shape = swirled(path[:, 0], path[:, 2], number)
        add(f"Plume {name}", shape, exhaust(name, fractions), kelvin)
    spindles = [
        revolved([(x - 0.24, 0.01), (x - 0.12, 0.07 * size), (x, 0.14 * size), (x + 0.1, 0.07 * size), (x + 0.2, 0.01)])
        for x, size in zip(SHOCKS, (1.2, 1.0, 0.8, 0.6), strict=True)
    ]
    add("Plume shocks", joined(*spindles), exhaust("Shocks", (0.08, 0.08, 1e-7)), 1400.0)


def exhaust(name, fractions):
    """A material of carbon dioxide, water vapour and soot."""
    return gas(name, (1.0, 0.6, 0.3), gas=dict(zip(("CO2", "H2O", "soot"), fractions, strict=True)))


def swirled(x, radius, seed):
    """A body of revolution whose skin is the more ruffled the further from the nozzle."""
    random = np.random.default_rng(seed)
    vertices, faces = turned(np.column_stack((radius, x)), 96)
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    ruffles = np.zeros(len(vertices))
    for wave in range(1, 9):
        along, phase = random.uniform(2.0, 9.0), random.uniform(0, 2 * np.pi, 2)
        ruffles += (
            np.sin(along * vertices[:, 2] + phase[0] + wave * angle) * np.cos(wave * angle + phase[1]) / wave**0.5
        )
    vertices[:, :2] *= (1 + 0.055 * ruffles * np.minimum(vertices[:, 2] / 2.0, 1.0))[:, None]
    return lying((vertices, faces))


# The engine and around it --------------------------------------------------------------------------------------------


def casing_temperature(x):
    """K along the engine: cold at the inlet, hottest at the nozzle."""
    return np.interp(x, [-3.6, -3.0, -2.2, -1.9, -1.4, -0.5, 0.0], [289, 325, 410, 520, 560, 680, 860])


def add_engine(materials) -> None:
    """Inlet, compressor, combustion chamber, afterburner and nozzle, from the left to the right."""
    bodies = {
        "Inlet": ("paint", [(-3.5, 0.36), (-3.62, 0.4), (-3.62, 0.43), (-3.5, 0.46), (-3.05, 0.45), (-3.0, 0.4)]),
        "Compressor": ("paint", [(-3.05, 0.43), (-2.7, 0.42), (-2.3, 0.37), (-2.1, 0.36)]),
        "Chamber": ("casing", [(-2.15, 0.38), (-2.05, 0.42), (-1.7, 0.42), (-1.55, 0.38), (-1.4, 0.35)]),
        "Afterburner": ("oxide", [(-1.45, 0.36), (-1.3, 0.38), (-0.55, 0.38), (-0.5, 0.35)]),
    }
    for name, (material, outline) in bodies.items():
        path = curve([(x, 0, radius) for x, radius in outline], 5)[:, [0, 2]]
        shape = revolved(path)
        add(name, shape, materials[material], casing_temperature(shape[0][:, 0]))
    flanges = joined(*(revolved([(x - 0.02, 0.47), (x + 0.02, 0.47)]) for x in (-3.02, -2.12, -1.43)))
    add("Flanges", flanges, materials["casing"], casing_temperature(flanges[0][:, 0]) - 30)
    # The nozzle is open: outside, rim and inside in one skin; at its bottom is the flame holder.
    skin = np.array([(-0.55, 0.4), (-0.3, 0.385), (-0.02, 0.315), (-0.02, 0.285), (-0.3, 0.33), (-0.5, 0.34)])
    vertices, faces = revolved(skin, 60)
    kelvin = np.where(np.arange(len(vertices)) // 60 < 3, casing_temperature(vertices[:, 0]), 1000.0)
    add("Nozzle", (vertices, [*faces[:-2], faces[-1]]), materials["oxide"], kelvin)
    angle = 2 * np.pi * np.arange(15) / 15
    seams = [
        tube([(-0.5, 0.4 * c, 0.4 * s), (-0.3, 0.39 * c, 0.39 * s), (-0.03, 0.32 * c, 0.32 * s)], 0.012, 8)
        for c, s in zip(np.cos(angle), np.sin(angle), strict=True)
    ]
    vertices, faces = joined(*seams)
    add("Seams", (vertices + (0, 0, HEIGHT), faces), materials["casing"], casing_temperature(vertices[:, 0]) - 60)
    add_pipes(materials)


def add_pipes(materials) -> None:
    """Fuel and air along the casing, and the gear box below the compressor."""
    for number, (turn, start, end, radius) in enumerate(
        ((-1.2, -2.9, -0.7, 0.018), (-1.45, -2.7, -1.2, 0.025), (-1.8, -2.9, -1.75, 0.015), (-2.3, -2.5, -0.9, 0.02))
    ):
        x = np.array([start, start + 0.06, start + 0.3, -2.0, end - 0.25, end - 0.05, end])
        out = np.array([0.36, 0.46, 0.48, 0.48, 0.45, 0.42, 0.36])
        path = curve(np.column_stack((x, out * np.cos(turn - np.pi / 6), HEIGHT + out * np.sin(turn + np.pi / 2))), 6)
        path[:, 1] = -np.abs(path[:, 1])
        shape = tube(path, radius, 12)
        add(f"Pipe {number}", shape, materials["casing"], 0.5 * casing_temperature(shape[0][:, 0]) + 165)
    add("Gear box", box((-2.9, -0.25, 0.78), (-2.3, 0.25, 0.98)), materials["paint"], 352.0, bevel=0.04)


def leg(x, side):
    """A bent leg of the stand, on one side of the engine."""
    return tube([(x, side * 0.75, 0.05), (x, side * 0.5, 0.7), (x, side * 0.42, HEIGHT)], 0.045, 16)


def add_stand(materials) -> None:
    """Two frames that carry the engine, rails, and a hose for the fuel."""
    bars = []
    for x in (-2.75, -0.95):
        bars += [leg(x, side) for side in (-1, 1)]
        bars.append(box((x - 0.05, -0.85, 0.0), (x + 0.05, 0.85, 0.08)))
        bars.append(box((x - 0.04, -0.6, 0.62), (x + 0.04, 0.6, 0.69)))
    bars += [box((-3.2, side * 0.78 - 0.05, 0.08), (-0.5, side * 0.78 + 0.05, 0.16)) for side in (-1, 1)]
    add("Stand", joined(*bars), materials["paint"], 291.0)
    hose = curve([(-2.6, -0.2, 0.8), (-2.6, -0.5, 0.45), (-2.8, -0.9, 0.06), (-3.6, -1.4, 0.05), (-6.0, -1.2, 0.05)], 8)
    add("Hose", tube(hose, 0.04, 16), materials["rubber"], 284.0)


def add_surroundings(materials) -> None:
    """Concrete that the exhaust has warmed, and a wall with a door behind."""
    ground = grid((-8, -6, 0), (20, 0, 0), (0, 11, 0), 0.25)
    x, y, _ = ground[0].T
    warm = 45 * np.exp(-(((x - 4.5) / 2.6) ** 2) - (y / 0.9) ** 2)
    warm += 12 * np.exp(-(((x + 0.8) / 1.2) ** 2) - (y / 0.6) ** 2)
    add("Apron", ground, materials["concrete"], 287.0 + warm)
    add("Ground", box((-80, -40, -0.3), (80, 60, -0.02)), materials["concrete"], 286.5)
    wall = grid((-9, 5, 0), (22, 0, 0), (0, 0, 3.4), 0.2)
    x, _, z = wall[0].T
    add("Wall", wall, materials["brick"], 288.5 + 9 * np.exp(-(((x - 4.0) / 2.5) ** 2) - ((z - 1.4) / 1.2) ** 2))
    add("Door", box((-6.4, 4.9, 0), (-3.9, 5.1, 2.6)), materials["paint"], 290.0)


if __name__ == "__main__":
    save(build, FOLDER / "plume.blend")
