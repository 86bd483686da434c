# SPDX-License-Identifier: GPL-3.0-or-later
"""Make people.blend: two people in a heated room on a winter evening.

    python -m docs.examples.people

Glass is a mirror for thermal cameras: the window and the picture on the wall show who stands before them. The floor
keeps the warmth of the feet that walked over it.
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
    grid,
    joined,
    save,
    shade_smooth,
    surface,
    tube,
    turned,
)

WIDTH, DEPTH, HEIGHT = 5.2, 4.4, 2.6  # m, of the room: x from 0, y from 0, z from 0
SKIN, CLOTHES, HAIR = 0, 1, 2  # slots of a body's materials

# A body is made of rounded cones: from, to (m), radius at both ends (m), temperature (K), slot. Left and right are
# mirrored unless a limb is given for one side.
HEAD = [
    ((0, 0, 1.50), (0, -0.01, 1.40), 0.055, 0.06, 307.3, SKIN),
    ((0, -0.015, 1.60), (0, -0.035, 1.56), 0.088, 0.07, 307.6, SKIN),
    ((0, 0.03, 1.645), (0, 0.04, 1.60), 0.092, 0.085, 300.3, HAIR),
    ((0, -0.115, 1.585), (0, -0.1, 1.61), 0.016, 0.01, 304.0, SKIN),
]
TRUNK = [
    ((0, 0.01, 1.36), (0, 0.01, 1.20), 0.09, 0.135, 302.3, CLOTHES),
    ((-0.15, 0.01, 1.345), (0.15, 0.01, 1.345), 0.062, 0.062, 302.0, CLOTHES),
    ((-0.06, 0.0, 1.24), (0.06, 0.0, 1.24), 0.115, 0.115, 302.6, CLOTHES),
    ((-0.05, 0.0, 1.05), (0.05, 0.0, 1.05), 0.115, 0.115, 301.8, CLOTHES),
    ((-0.075, 0.01, 0.92), (0.075, 0.01, 0.92), 0.115, 0.115, 300.8, CLOTHES),
]
STANDING_LEG = [
    ((0.09, 0.01, 0.88), (0.1, 0.0, 0.48), 0.095, 0.062, 300.4, CLOTHES),
    ((0.1, 0.0, 0.48), (0.11, 0.03, 0.10), 0.064, 0.05, 299.6, CLOTHES),
    ((0.11, 0.03, 0.06), (0.12, -0.14, 0.045), 0.05, 0.038, 297.2, CLOTHES),
]
SITTING_LEG = [
    ((0.09, -0.02, 0.90), (0.11, -0.42, 0.88), 0.095, 0.068, 300.6, CLOTHES),
    ((0.11, -0.42, 0.86), (0.11, -0.40, 0.50), 0.066, 0.048, 299.4, CLOTHES),
    ((0.11, -0.40, 0.47), (0.12, -0.56, 0.445), 0.048, 0.037, 297.2, CLOTHES),
]
HANGING_ARM = [
    ((0.19, 0.01, 1.345), (0.245, 0.03, 1.09), 0.052, 0.042, 301.6, CLOTHES),
    ((0.245, 0.03, 1.09), (0.25, -0.05, 0.88), 0.038, 0.028, 305.6, SKIN),
    ((0.25, -0.06, 0.85), (0.245, -0.085, 0.77), 0.036, 0.026, 305.0, SKIN),
]
POINTING_ARM = [  # of the standing one, towards the window
    ((-0.19, 0.01, 1.345), (-0.36, -0.12, 1.17), 0.052, 0.042, 301.6, CLOTHES),
    ((-0.36, -0.12, 1.17), (-0.46, -0.33, 1.27), 0.038, 0.028, 305.6, SKIN),
    ((-0.465, -0.35, 1.285), (-0.48, -0.42, 1.33), 0.034, 0.024, 304.6, SKIN),
]
RESTING_ARM = [  # of the sitting one, on the table
    ((0.19, 0.01, 1.345), (0.235, -0.12, 1.11), 0.052, 0.042, 301.6, CLOTHES),
    ((0.235, -0.12, 1.11), (0.13, -0.36, 1.09), 0.038, 0.029, 305.4, SKIN),
    ((0.12, -0.39, 1.09), (0.08, -0.47, 1.085), 0.036, 0.024, 304.2, SKIN),
]


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "skin": surface("Skin", "Skin, human", colour=(0.8, 0.6, 0.5)),
        "clothes": surface("Polyester", "Plastic, PET", colour=(0.3, 0.35, 0.6)),
        "hair": surface("Hair", 0.97, colour=(0.15, 0.1, 0.08)),  # no library has it; fur emits nearly all
        "glass": surface("Window glass", "Glass, window", specular=1.0, colour=(0.4, 0.55, 0.6)),
        "plaster": surface("Plaster", "Anhydrite", colour=(0.85, 0.83, 0.78)),
        "vinyl": surface("Vinyl floor", "Plastic, PVC", 0.85, 0.06, (0.5, 0.4, 0.3)),
        "enamel": surface("Enamel", 0.92, 0.5, 0.2, (0.9, 0.9, 0.9)),
        "frame": surface("Frame", "Plastic, PVC", colour=(0.9, 0.9, 0.9)),
        "table": surface("Table top", "Plastic, PMMA (acrylic)", 0.9, 0.05, (0.55, 0.4, 0.25)),
        "steel": surface("Steel", "Steel, cold rolled", 0.9, 0.15, (0.6, 0.6, 0.6)),
        "ceramic": surface("Ceramic", "Alumina", 0.5, 0.1, (0.9, 0.9, 0.95)),
    }
    add_room(materials)
    add_window(materials)
    add_furniture(materials)
    standing = HEAD + TRUNK + STANDING_LEG + mirrored(STANDING_LEG) + HANGING_ARM + POINTING_ARM
    add_person("Standing person", standing, materials, (3.3, 3.1, 0.0), np.radians(-12))
    sitting = HEAD + TRUNK + SITTING_LEG + mirrored(SITTING_LEG) + RESTING_ARM + mirrored(RESTING_ARM)
    add_person("Sitting person", sitting, materials, (1.5, 2.95, -0.4), np.radians(38))
    add_glasses(materials, (3.3, 3.1, 0.0), np.radians(-12))
    add_footprints(materials)
    add_sky("Winter evening", 262.0)
    add_camera((3.0, -2.2, 1.6), (2.5, 3.0, 1.02), lens=40.0)
    choose_settings((7.5, 14.0, 8), "IRON", (288.65, 308.15), passes=3)


# People ---------------------------------------------------------------------------------------------------------------


def mirrored(cones):
    """Cones of the other side."""
    return [((-a[0], *a[1:]), (-b[0], *b[1:]), *rest) for a, b, *rest in cones]


def cone_distances(cones, points):
    """Distance (n, cones) in m of points (n, 3) from the surface of each cone, negative inside."""
    result = []
    for start, end, radius, radius_end, *_ in cones:
        start, along = np.array(start, float), np.subtract(end, start)
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        near = start + share[:, None] * along
        result.append(np.linalg.norm(points - near, axis=1) - (radius + share * (radius_end - radius)))
    return np.stack(result, axis=1)


def add_person(name, cones, materials, location, turn):
    """A body: cones that flow into each other; skin, clothes and hair where their cones are nearest."""
    blend = 0.018  # m, over which neighbouring cones flow into each other

    def distance(points):
        return -blend * np.log(np.exp(-cone_distances(cones, points) / blend).sum(axis=1))

    ends = np.array([end for cone in cones for end in cone[:2]])
    vertices, faces = blob(distance, ends.min(axis=0) - 0.2, ends.max(axis=0) + 0.2, 0.026)
    shares = np.exp(-cone_distances(cones, vertices) / 0.012)
    kelvin = shares @ np.array([cone[4] for cone in cones]) / shares.sum(axis=1)
    person = add(name, (vertices, faces), materials["skin"], kelvin, location, (0, 0, turn))
    person.data.materials.append(materials["clothes"])
    person.data.materials.append(materials["hair"])
    middles = vertices[np.array(faces)].mean(axis=1)
    slots = np.array([cone[5] for cone in cones])[cone_distances(cones, middles).argmin(axis=1)]
    person.data.polygons.foreach_set("material_index", slots.astype(np.int32))
    person.modifiers.new("Smooth", "SUBSURF").render_levels = 1
    shade_smooth(person.data, sharp=np.pi)  # a body has no edges
    return person


def add_glasses(materials, location, turn) -> None:
    """Spectacles: glass does not let heat through, so the eyes behind are not seen."""
    path = 2 * np.pi * np.arange(33) / 32
    rims, panes = [], []
    for x in (-0.034, 0.034):
        ring = np.column_stack((x + 0.027 * np.cos(path), np.full(33, -0.128), 1.612 + 0.02 * np.sin(path)))
        rims.append(tube(ring, 0.003, 8))
        panes.append((ring[:-1], [list(range(32))]))
    rims += [
        tube(curve([(s * 0.06, -0.128, 1.615), (s * 0.1, -0.06, 1.62), (s * 0.1, 0.02, 1.61)]), 0.003, 8)
        for s in (-1, 1)
    ]
    rims.append(tube(curve([(-0.01, -0.128, 1.615), (0, -0.131, 1.618), (0.01, -0.128, 1.615)]), 0.003, 8))
    place = {"location": location, "rotation": (0, 0, turn)}
    add("Rims", joined(*rims), materials["frame"], 299.5, **place)
    add("Lenses", joined(*panes), materials["glass"], 298.8, **place)


# The room -------------------------------------------------------------------------------------------------------------


def add_room(materials) -> None:
    """Walls with cold corners, a floor and a ceiling. The side of the camera is open; warm air is behind it."""
    window = (0.9, 0.95, 2.3, 2.15)  # m: left, bottom, right, top, in the back wall
    back = grid((0, DEPTH, 0), (WIDTH, 0, 0), (0, 0, HEIGHT), 0.1)
    x, _, z = back[0].T
    kelvin = 292.2 + 0.5 * z / HEIGHT - edges(x, WIDTH) - edges(z, HEIGHT)
    kelvin = kelvin + 2.2 * np.exp(-(((x - 1.6) / 0.75) ** 2) - ((z - 0.75) / 0.5) ** 2)  # above the radiator
    corners = np.array(back[1])
    middle_x, middle_z = x[corners].mean(axis=1), z[corners].mean(axis=1)
    left, bottom, right, top = window
    keep = ~((left < middle_x) & (middle_x < right) & (bottom < middle_z) & (middle_z < top))
    add("Back wall", (back[0], corners[keep].tolist()), materials["plaster"], kelvin)
    for name, x in (("Left wall", 0.0), ("Right wall", WIDTH)):
        wall = grid((x, -3.2, 0), (0, DEPTH + 3.2, 0), (0, 0, HEIGHT), 0.1)
        _, y, z = wall[0].T
        add(
            name,
            wall,
            materials["plaster"],
            293.0 + 0.4 * z / HEIGHT - edges(z, HEIGHT) - 1.2 * np.exp((y - DEPTH) / 0.25),
        )
    floor = grid((0, -3.2, 0), (WIDTH, 0, 0), (0, DEPTH + 3.2, 0), 0.1)
    add("Floor", floor, materials["vinyl"], 292.0 - 0.8 * np.exp((floor[0][:, 1] - DEPTH) / 0.3))
    add("Ceiling", box((0, -3.2, HEIGHT), (WIDTH, DEPTH, HEIGHT + 0.1)), materials["plaster"], 293.8)
    add("Front wall", box((0, -3.3, 0), (WIDTH, -3.2, HEIGHT)), materials["plaster"], 293.3)
    skirting = [box((0.005, DEPTH - 0.02, 0), (WIDTH - 0.005, DEPTH - 0.002, 0.09))]
    add("Skirting board", joined(*skirting), materials["frame"], 291.4)


def edges(u, size):
    """K that the outer wall is colder where it meets others at 0 and `size`."""
    return 1.6 * (np.exp(-u / 0.14) + np.exp((u - size) / 0.14))


def add_window(materials) -> None:
    """The window, its sill, the radiator below and its pipes, and a draught at the lower edge of the frame."""
    left, bottom, right, top = 0.9, 0.95, 2.3, 2.15
    near, far, bar = DEPTH - 0.01, DEPTH + 0.05, 0.07
    uprights = [box((u, near + 0.005, bottom + 0.005), (u + bar, far, top - 0.005)) for u in (left, 1.565, right - bar)]
    rails = [box((left - 0.005, near, z), (right + 0.005, far, z + bar)) for z in (bottom, top - bar)]
    add("Window frame", joined(*uprights, *rails), materials["frame"], 289.8, bevel=0.01)
    pane = grid((left, DEPTH + 0.025, bottom), (right - left, 0, 0), (0, 0, top - bottom), 0.1)
    add("Window pane", pane, materials["glass"], 285.8 - 1.8 * np.exp((bottom - pane[0][:, 2]) / 0.25))
    add(
        "Sill",
        box((left - 0.1, DEPTH - 0.2, bottom - 0.06), (right + 0.1, DEPTH - 0.012, bottom - 0.02)),
        materials["frame"],
        294.5,
        bevel=0.01,
    )
    ribs = [box((x, DEPTH - 0.13, 0.14), (x + 0.05, DEPTH - 0.05, 0.78)) for x in np.arange(0.95, 2.2, 0.066)]
    ribs = [(vertices, faces) for vertices, faces in ribs]
    heights = joined(*ribs)[0][:, 2]
    add("Radiator", joined(*ribs), materials["enamel"], np.where(heights > 0.5, 324.0, 313.0), bevel=0.018)
    pipes = [
        tube([(2.33, DEPTH - 0.09, z) for z in (0.0, 0.35, 0.7)], 0.011, 16),
        tube([(x, DEPTH - 0.09, 0.72) for x in (2.22, 2.3, 2.34)], 0.011, 16),
    ]
    add("Pipes", joined(*pipes), materials["steel"], 326)


def add_furniture(materials) -> None:
    """A table with tea, a laptop and a lamp, a chair, a picture behind glass and a cold bottle."""
    legs = [box((x, y, 0), (x + 0.05, y + 0.05, 0.68)) for x in (1.45, 2.55) for y in (1.6, 2.25)]
    add("Table legs", joined(*legs), materials["steel"], 292.3)
    top = grid((1.35, 1.5, 0.72), (1.4, 0, 0), (0, 0.9, 0), 0.025)
    x, y, _ = top[0].T
    print_of_hand = 3.0 * np.exp(-(((x - 1.98) / 0.045) ** 2) - ((y - 1.68) / 0.07) ** 2)
    fingers = [
        np.exp(-(((x - 1.94 - 0.026 * i) / 0.011) ** 2) - ((y - 1.79 - 0.012 * min(i, 3 - i)) / 0.045) ** 2)
        for i in range(4)
    ]
    add("Table top", top, materials["table"], 292.6 + np.maximum(print_of_hand, 3.0 * np.max(fingers, axis=0)))
    add("Table edge", box((1.35, 1.5, 0.68), (2.75, 2.4, 0.715)), materials["table"], 292.5, bevel=0.006)
    mug = turned([(0.03, 0), (0.042, 0.01), (0.042, 0.1), (0.036, 0.1), (0.035, 0.085), (0.002, 0.085)], 40)
    add("Tea", mug, materials["ceramic"], np.where(mug[0][:, 2] > 0.02, 331.0, 318.0), (1.62, 1.66, 0.722))
    add(
        "Handle",
        tube(curve([(0.04, 0, 0.08), (0.07, 0, 0.075), (0.072, 0, 0.04), (0.04, 0, 0.025)]), 0.006, 12),
        materials["ceramic"],
        312,
        (1.62, 1.66, 0.722),
    )
    add("Laptop", box((2.16, 1.75, 0.722), (2.5, 1.99, 0.74)), materials["steel"], 303.5, bevel=0.005)
    screen = box((2.16, 0, 0), (2.5, 0.008, 0.23))
    add("Laptop screen", screen, materials["frame"], 301.5, (0, 1.745, 0.735), (0.35, 0, 0), 0.003)
    bottle = turned([(0.035, 0), (0.037, 0.01), (0.037, 0.16), (0.014, 0.22), (0.014, 0.27), (0.01, 0.27)], 40)
    add("Cold bottle", bottle, materials["glass"], np.where(bottle[0][:, 2] < 0.15, 280.5, 284.5), (1.9, 2.2, 0.722))
    seat = joined(box((-0.22, -0.2, 0.4), (0.22, 0.22, 0.43)), box((-0.2, 0.2, 0.5), (0.2, 0.225, 0.9)))
    chair_legs = [
        box((x - 0.018, y - 0.018, 0), (x + 0.018, y + 0.018, 0.4)) for x in (-0.19, 0.19) for y in (-0.17, 0.19)
    ]
    place = {"location": (1.5, 2.95, 0), "rotation": (0, 0, np.radians(38))}
    add("Chair", seat, materials["table"], 296.5, bevel=0.01, **place)
    add("Chair legs", joined(*chair_legs), materials["steel"], 292.5, **place)
    border = [box((3.9, DEPTH - 0.03, z), (4.8, DEPTH - 0.002, z + 0.03)) for z in (1.1, 2.05)]
    border += [box((x, DEPTH - 0.032, 1.105), (x + 0.03, DEPTH - 0.002, 2.075)) for x in (3.9, 4.77)]
    add("Picture frame", joined(*border), materials["steel"], 292.4)
    pane = np.array(
        [
            (3.92, DEPTH - 0.015, 1.12),
            (4.78, DEPTH - 0.015, 1.12),
            (4.78, DEPTH - 0.015, 2.06),
            (3.92, DEPTH - 0.015, 2.06),
        ]
    )
    add("Picture glass", (pane, [(0, 1, 2, 3)]), materials["glass"], 292.2)
    stand = joined(turned([(0.15, 0), (0.15, 0.02), (0.012, 0.03), (0.012, 1.55)], 40))
    add("Lamp stand", stand, materials["steel"], 293, (4.6, 3.7, 0))
    shade = turned([(0.2, 1.5), (0.13, 1.8), (0.125, 1.8), (0.195, 1.5)], 48)
    vertices, faces = shade
    add(
        "Lamp shade",
        (vertices, faces[:-2]),
        materials["frame"],
        np.where(vertices[:, 2] > 1.6, 303.0, 298.0),
        (4.6, 3.7, 0),
    )
    bulb = turned([(0.015, 1.55), (0.02, 1.58), (0.035, 1.63), (0.03, 1.67), (0.008, 1.69)], 32)
    add("Bulb", bulb, materials["glass"], 340.0, (4.6, 3.7, 0))


def add_footprints(materials) -> None:
    """Prints of bare feet from the right to where one stands: the older, the colder."""
    for step in range(6):
        share = step / 5
        x, y = 4.75 - 1.25 * share, 0.55 + 2.2 * share
        side = 0.09 * (-1) ** step
        turn = np.arctan2(2.2, -1.25) - np.pi / 2
        angle = 2 * np.pi * np.arange(28) / 28
        sole = np.column_stack((0.042 * np.cos(angle) * (1 + 0.25 * np.sin(angle)), 0.115 * np.sin(angle)))
        outlines = [sole] + [
            np.column_stack((0.032 - 0.017 * i + 0.011 * np.cos(angle), 0.135 - 0.006 * i + 0.013 * np.sin(angle)))
            for i in range(5)
        ]
        toes = [(np.insert(outline, 2, 0.001, axis=1), [list(range(28))]) for outline in outlines]
        location = (x + side * np.cos(turn), y + side * np.sin(turn), 0.0)
        add(f"Footprint {step}", joined(*toes), materials["vinyl"], 294.0 + 3.0 * share**1.5, location, (0, 0, turn))


if __name__ == "__main__":
    save(build, FOLDER / "people.blend")
