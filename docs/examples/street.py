# SPDX-License-Identifier: GPL-3.0-or-later
"""Make street.blend: a street in fog on a winter evening, 8.1 to 11.9 um.

    python -m docs.examples.street

The world is filled with droplets of water of 5 um, 0.1 g in a cubic metre: one sees about 130 m.
"""

from __future__ import annotations

import numpy as np

from docs.examples.facade import add_car
from docs.examples.modelling import (
    FOLDER,
    add,
    add_camera,
    add_sky,
    box,
    choose_settings,
    curve,
    fill,
    joined,
    link,
    prism,
    save,
    surface,
    tube,
    turned,
)
from docs.examples.people import HANGING_ARM, HEAD, STANDING_LEG, TRUNK, add_person, mirrored

AIR = 276.0  # K, and the fog's
LENGTH = 130.0  # m, of the street, along y
WALKERS = ((-3.9, 16.0, 12), (3.7, 26.0, 170), (-4.1, 42.0, 15), (3.9, 62.0, 185))  # m, m, degrees


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "skin": surface("Skin", "Skin, human", colour=(0.8, 0.6, 0.5)),
        "clothes": surface("Polyester", "Plastic, PET", colour=(0.3, 0.35, 0.6)),
        "hair": surface("Hair", 0.97, colour=(0.15, 0.1, 0.08)),
        "brick": surface("Brick", "Brick, weathered", colour=(0.5, 0.3, 0.25)),
        "glass": surface("Window glass", "Glass, window", specular=1.0, colour=(0.4, 0.55, 0.6)),
        "tiles": surface("Roof tiles", "Roof tile, ceramic", colour=(0.4, 0.2, 0.15)),
        "asphalt": surface("Asphalt", "Asphalt, road", colour=(0.2, 0.2, 0.2)),
        "paving": surface("Paving", "Concrete, weathered", colour=(0.6, 0.6, 0.58)),
        "paint": surface("Car paint", "Paint, lacquer on aluminium", 0.7, 0.1, (0.2, 0.3, 0.5)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", colour=(0.1, 0.1, 0.1)),
        "zinc": surface("Zinc", "Steel, galvanised, heavily oxidised", 0.5, 0.3, (0.6, 0.6, 0.62)),
    }
    add_ground(materials)
    add_houses(materials)
    add_lamps(materials)
    add_walkers(materials)
    for place, turn in (((2.2, 19.0, 0), -90), ((-2.3, 31.0, 0), 90), ((1.4, 48.0, 0), -90), ((-1.5, 80.0, 0), 90)):
        add_car(materials, place, turn, warmer=6.0)
    world = add_sky("Fog", AIR)
    fill(world, depth=150.0, gas={"Water droplets 5 um": 0.1})
    add_camera((-0.7, 0.0, 2.3), (-0.2, 30.0, 2.6), lens=30.0)
    choose_settings((8.1, 11.9, 4), "IRON", (275.15, 288.15), passes=3, time_limit=110.0, percentage=75)


def add_ground(materials) -> None:
    """The street, its pavements and the field at its end."""
    add("Street", box((-3, -20, -0.3), (3, LENGTH, -0.12)), materials["asphalt"], 277.6)
    tracks = [box((x - 0.14, -20, -0.13), (x + 0.14, LENGTH, -0.115)) for x in (-2.2, -0.8, 0.8, 2.2)]
    add("Tracks", joined(*tracks), materials["asphalt"], 278.6)
    pavements = [box((side * 4.5 - 1.5, -20, -0.3), (side * 4.5 + 1.5, LENGTH, 0.0)) for side in (-1, 1)]
    add("Pavements", joined(*pavements), materials["paving"], 276.9)
    add("Ground", box((-150, -20, -0.6), (150, 300, -0.31)), materials["paving"], 276.4)


def add_houses(materials) -> None:
    """Terraces to both sides, of brick with warm windows and doors; each house has a warmth of its own."""
    random = np.random.default_rng(3)
    for side in (-1, 1):
        for number, y in enumerate(np.arange(4.0, LENGTH - 12, 9.5)):
            height, kelvin = 5.6 + 0.9 * random.random(), 278.6 + 1.4 * random.random()
            front = side * 6.0
            name = f"House {side} {number}"
            add(name, box((min(front, front + 8 * side), y, 0), (max(front, front + 8 * side), y + 8.6, height)),
                materials["brick"], kelvin)  # fmt: skip
            roof = prism([(-4.4, height), (0, height + 2.8), (4.4, height)], 8.9)
            add(f"{name} roof", roof, materials["tiles"], 276.6, (front + 4 * side, y + 4.3, 0.01))
            near, far = sorted((front - 0.03 * side, front + 0.05 * side))
            panes = [box((near, y + u, z), (far, y + u + 1.1, z + 1.4)) for u in (0.9, 3.6, 6.4) for z in (0.9, 3.6)]
            del panes[2]
            add(f"{name} windows", joined(*panes), materials["glass"], 281.0 + 2.5 * random.random())
            add(f"{name} door", box((near, y + 3.6, 0.1), (far, y + 4.6, 2.2)), materials["paint"], kelvin + 2.0)
            stack = box(
                (front + 3.7 * side - 0.3, y + 7, height + 1.5), (front + 3.7 * side + 0.3, y + 7.6, height + 3.9)
            )
            add(f"{name} chimney", stack, materials["brick"], 284.0 + 6 * random.random())


def add_lamps(materials) -> None:
    """Street lamps with warm heads, to both sides in turn."""
    for number, y in enumerate(np.arange(11.0, LENGTH, 15.0)):
        side = (-1) ** number
        path = curve([(0, 0, 0), (0, 0, 3.6), (0, 0, 4.9), (-0.3 * side, 0, 5.4), (-1.0 * side, 0, 5.5)], 6)
        add(f"Lamp pole {number}", tube(path, 0.06, 12), materials["zinc"], AIR, (3.3 * side, y, 0))
        head = turned([(0.02, 0.0), (0.28, 0.02), (0.3, 0.07), (0.14, 0.2), (0.03, 0.22)], 24)
        add(f"Lamp head {number}", head, materials["paint"], 303.0, (2.3 * side, y, 5.35))


def add_walkers(materials) -> None:
    """One body, which walks at four places."""
    cones = HEAD + TRUNK + STANDING_LEG + mirrored(STANDING_LEG) + HANGING_ARM + mirrored(HANGING_ARM)
    (x, y, turn), *others = WALKERS
    first = add_person("Walker 0", cones, materials, (x, y, 0), np.radians(turn))
    first.modifiers.clear()
    painted = first.data.attributes["temperature"].data
    kelvin = np.empty(len(painted), np.float32)
    painted.foreach_get("value", kelvin)
    painted.foreach_set("value", np.where(kelvin < 303, kelvin - 16, kelvin - 2))  # coats are colder than in a room
    for number, (x, y, turn) in enumerate(others, 1):
        walker = link(f"Walker {number}", first.data)
        walker.location, walker.rotation_euler = (x, y, 0), (0, 0, np.radians(turn))


if __name__ == "__main__":
    save(build, FOLDER / "street.blend")
