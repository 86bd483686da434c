# SPDX-License-Identifier: GPL-3.0-or-later
"""Make steam.blend: somebody behind the steam of a pot, 8 to 12 um.

    python -m docs.examples.steam

Steam that one sees is droplets of water. They shine with their own warmth, hide what is behind by absorption, and blur
it by scattering: droplets of 5 um, in g/m3.
"""

from __future__ import annotations

import numpy as np

from docs.examples.modelling import (
    FOLDER,
    add,
    add_camera,
    add_sky,
    blob,
    box,
    choose_settings,
    curve,
    gas,
    grid,
    joined,
    save,
    surface,
    tube,
    turned,
)
from docs.examples.people import HANGING_ARM, HEAD, STANDING_LEG, TRUNK, add_person, mirrored

TOP = 0.9  # m, height of the stove
POT = (0.0, 0.0, TOP + 0.21)  # its rim
# Puffs from the pot upwards: x, y, height above the rim, radius; m. The inner ones are hotter and denser.
OUTER = [
    (0.0, 0.0, 0.02, 0.12),
    (0.02, 0.0, 0.12, 0.11),
    (0.06, 0.01, 0.22, 0.11),
    (0.05, -0.01, 0.33, 0.12),
    (0.1, 0.0, 0.44, 0.13),
    (0.17, 0.02, 0.53, 0.13),
    (0.13, -0.03, 0.64, 0.15),
    (0.24, 0.0, 0.72, 0.13),
    (0.3, 0.02, 0.84, 0.15),
    (0.2, 0.0, 0.92, 0.11),
]
INNER = [(x, y, z - 0.02, 0.6 * radius) for x, y, z, radius in OUTER[:6]]


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "skin": surface("Skin", "Skin, human", colour=(0.8, 0.6, 0.5)),
        "clothes": surface("Polyester", "Plastic, PET", colour=(0.3, 0.35, 0.6)),
        "hair": surface("Hair", 0.97, colour=(0.15, 0.1, 0.08)),
        "plaster": surface("Plaster", "Anhydrite", colour=(0.85, 0.83, 0.78)),
        "tiles": surface("Tiles", "Alumina", 0.6, 0.1, (0.9, 0.9, 0.95)),
        "front": surface("Kitchen front", "Plastic, PVC", 0.6, 0.15, (0.8, 0.8, 0.75)),
        "steel": surface("Steel", "Steel, cold rolled", 0.9, 0.15, (0.6, 0.6, 0.6)),
        "water": surface("Water", "Water", 0.9, 0.1, (0.3, 0.5, 0.7)),
    }
    add_kitchen(materials)
    add_pot(materials)
    cook = HEAD + TRUNK + STANDING_LEG + mirrored(STANDING_LEG) + HANGING_ARM + mirrored(HANGING_ARM)
    add_person("Cook", cook, materials, (0.19, 0.75, 0.0), np.radians(10))
    add("Steam", puffs(OUTER, 0), gas("Steam", gas={"Water droplets 5 um": 6.0}), 309.0)
    add("Hot steam", puffs(INNER, 1), gas("Hot steam", gas={"Water droplets 5 um": 14.0}), 322.0)
    add_sky("Room", 294.0)
    add_camera((-0.35, -2.2, 1.72), (0.02, 0.0, 1.36), lens=47.0)
    choose_settings((8.0, 12.0, 4), "IRON", (290.15, 313.15), passes=6, time_limit=110.0, percentage=75)


def puffs(balls, seed):
    """Balls that flow into each other, with smaller ones on their skin; above the pot."""
    random = np.random.default_rng(seed)
    balls = np.array(balls)
    out = random.standard_normal((len(balls), 7, 3))
    out /= np.linalg.norm(out, axis=2)[..., None]
    small = np.concatenate((balls[:, None, :3] + out * balls[:, None, 3:], np.full((len(balls), 7, 1), 0.0)), axis=2)
    small[..., 3] = balls[:, None, 3] * random.uniform(0.25, 0.55, (len(balls), 7))
    balls = np.concatenate((balls, small[1:].reshape(-1, 4)))
    blend = 0.012  # m

    def distance(points):
        distances = np.linalg.norm(points[:, None] - balls[:, :3], axis=2) - balls[:, 3]
        return np.maximum(-blend * np.log(np.exp(-distances / blend).sum(axis=1)), -0.012 - points[:, 2])

    low, high = balls[:, :3] - 2 * balls[:, 3:], balls[:, :3] + 2 * balls[:, 3:]
    vertices, faces = blob(distance, low.min(axis=0), high.max(axis=0), 0.018)
    return vertices + POT, faces


def add_pot(materials) -> None:
    """A pot of hot soup on a stove, its handles, and a kettle beside it."""
    profile = [(0.11, 0), (0.125, 0.01), (0.125, 0.21), (0.121, 0.21), (0.121, 0.15), (0.002, 0.15)]
    pot = turned(profile, 64)
    add("Pot", (pot[0] + (0, 0, TOP + 0.002), pot[1][:-1]), materials["steel"], 346.0)
    level = turned([(0.12, 0.14), (0.12, 0.16)], 48)
    add("Soup", (level[0] + (0, 0, TOP), level[1]), materials["water"], 348.0)
    loops = []
    for side in (-1, 1):
        path = [(side * 0.124, -0.04, 0.16), (side * 0.16, -0.035, 0.165), (side * 0.16, 0.035, 0.165)]
        loops.append(tube(curve([*path, (side * 0.124, 0.04, 0.16)]) + (0, 0, TOP), 0.008, 12))
    add("Handles", joined(*loops), materials["front"], 318.0)
    kettle = turned([(0.09, 0), (0.1, 0.02), (0.085, 0.12), (0.05, 0.17), (0.02, 0.18), (0.015, 0.2)], 48)
    add("Kettle", kettle, materials["front"], 306.0, (-0.52, 0.05, TOP + 0.002))


def add_kitchen(materials) -> None:
    """A stove whose plate is warm around the pot, the wall behind and the floor."""
    plate = grid((-1.2, -0.3, TOP), (2.4, 0, 0), (0, 0.6, 0), 0.04)
    x, y, _ = plate[0].T
    warm = 35 * np.exp(-(((x**2 + y**2) / 0.17**2) ** 2))
    add("Plate", plate, materials["front"], 295.5 + warm)
    add("Stove", box((-1.2, -0.28, 0.0), (1.2, 0.28, TOP - 0.01)), materials["front"], 296.5)
    wall = grid((-3.0, 2.2, 0), (6, 0, 0), (0, 0, 2.8), 0.1)
    x, _, z = wall[0].T
    add("Wall", wall, materials["plaster"], 292.6 + 1.2 * z / 2.8)
    joints = [box((-3, 2.18, z), (3, 2.199, z + 0.15)) for z in np.arange(0.02, 1.3, 0.16)]
    add("Tiles", joined(*joints), materials["tiles"], 292.2)
    shelf = box((-1.4, 1.95, 1.75), (-0.6, 2.19, 1.79))
    jars = [turned([(0.055, 0), (0.06, 0.01), (0.06, 0.15), (0.045, 0.17), (0.045, 0.19)], 32) for _ in range(4)]
    places = [(-1.3 + 0.19 * number, 2.06, 1.792) for number in range(4)]
    stood = [(vertices + place, faces) for (vertices, faces), place in zip(jars, places, strict=True)]
    add("Shelf", joined(shelf, *stood), materials["tiles"], 294.6)
    add("Floor", box((-5, -5, -0.1), (5, 5, 0)), materials["tiles"], 292.0)
    add(
        "Lamp",
        turned([(0.16, 2.0), (0.09, 2.15), (0.02, 2.2), (0.012, 2.7)], 40),
        materials["front"],
        303,
        (0.85, 1.2, 0),
    )


if __name__ == "__main__":
    save(build, FOLDER / "steam.blend")
