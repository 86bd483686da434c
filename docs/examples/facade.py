# SPDX-License-Identifier: GPL-3.0-or-later
"""Make facade.blend: a house on a clear winter night, and the faults of its insulation.

    python -m docs.examples.facade

What is painted on the walls as the attribute `temperature`: the edge of the floor slab, lintels, the niches of the
radiators, a patch without insulation, air that leaks from a window's frame, and beams under the plaster of the gable.
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
    grid,
    joined,
    prism,
    save,
    surface,
    tube,
    turned,
)

HALF_WIDTH, DEPTH, EAVES, RIDGE = 4.0, 7.04, 5.2, 7.8  # m, of the house; its front is at y = 0
STEP = 0.08  # m, of the squares whose corners carry the walls' temperatures; windows fit in
REVEAL = 0.16  # m, how deep windows sit in the wall
SLAB = 2.72  # m, height of the middle of the floor slab

DOOR = (-0.48, 0.0, 0.56, 2.16)  # m: left, bottom, right, top, along the wall
LOWER_LEFT, LOWER_RIGHT = (-3.04, 0.88, -1.6, 2.16), (1.6, 0.88, 3.04, 2.16)
UPPER_LEFT, UPPER_MIDDLE, UPPER_RIGHT = (-3.04, 3.6, -1.6, 4.88), (-0.4, 3.76, 0.48, 4.88), (1.6, 3.6, 3.04, 4.88)
SIDE_LOWER, SIDE_UPPER = (2.08, 0.88, 3.52, 2.16), (2.08, 3.6, 3.52, 4.88)

WALL, AIR, ROOM = 274.2, 273.0, 293.5  # K


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "plaster": surface("Plaster", "Limestone", colour=(0.80, 0.76, 0.66)),
        "brick": surface("Brick", "Brick, weathered", colour=(0.5, 0.25, 0.2)),
        "tiles": surface("Roof tiles", "Roof tile, ceramic", colour=(0.45, 0.2, 0.15)),
        "glass": surface("Window glass", "Glass, window", specular=1.0, colour=(0.3, 0.4, 0.5)),
        "frame": surface("Window frame", "Plastic, PVC", colour=(0.9, 0.9, 0.9)),
        "paint": surface("Car paint", "Paint, dark green on metal", 0.8, 0.1, (0.1, 0.3, 0.2)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", colour=(0.1, 0.1, 0.1)),
        "zinc": surface("Zinc", "Steel, galvanised, heavily oxidised", 0.5, 0.3, (0.6, 0.6, 0.65)),
        "asphalt": surface("Asphalt", "Asphalt, road", colour=(0.2, 0.2, 0.22)),
        "paving": surface("Paving", "Concrete, weathered", colour=(0.5, 0.5, 0.5)),
        "grass": surface("Grass", 0.97, colour=(0.2, 0.4, 0.15)),  # no library has it; leaves emit nearly all
    }
    add_walls(materials["plaster"])
    add_roof(materials)
    front = (DOOR, LOWER_LEFT, LOWER_RIGHT, UPPER_LEFT, UPPER_MIDDLE, UPPER_RIGHT)
    for number, opening in enumerate(front):
        add_window(f"Window {number}", opening, materials, 0.0, tilted=opening is UPPER_MIDDLE)
    for number, opening in enumerate((SIDE_LOWER, SIDE_UPPER)):
        add_window(f"Side window {number}", opening, materials, np.pi / 2)
    add_ground(materials)
    add_car(materials)
    add_lamp(materials)
    add_sky("Clear winter sky", 248.0)
    add_camera((8.4, -15.2, 1.75), (0.35, 0.0, 3.05), lens=40.0)
    choose_settings((8.1, 13.9, 8), "IRON", (263.15, 287.15), target_noise=0.06)


# The walls ------------------------------------------------------------------------------------------------------------


def add_walls(plaster) -> None:
    """The front with its gable and the side to the right, which the camera sees; the others only close the house."""
    front = grid((-HALF_WIDTH, 0, 0), (2 * HALF_WIDTH, 0, 0), (0, 0, EAVES), STEP)
    openings = (DOOR, LOWER_LEFT, LOWER_RIGHT, UPPER_LEFT, UPPER_MIDDLE, UPPER_RIGHT)
    x, _, z = front[0].T
    add("Front", cut(front, x, z, openings), plaster, front_temperature(x, z))

    side = grid((HALF_WIDTH, 0, 0), (0, DEPTH, 0), (0, 0, EAVES), STEP)
    _, y, z = side[0].T
    warm = bridges(z) + lintels(y, z, (SIDE_LOWER, SIDE_UPPER)) + niches(y, z, (SIDE_LOWER, SIDE_UPPER))
    add("Side", cut(side, y, z, (SIDE_LOWER, SIDE_UPPER)), plaster, WALL - 0.3 + warm)

    vertices, faces = grid((-HALF_WIDTH, 0, EAVES), (2 * HALF_WIDTH, 0, 0), (0, 0, RIDGE - EAVES), STEP)
    narrowing = np.maximum(1 - np.abs(vertices[:, 0]) / HALF_WIDTH, 0.01)  # no faces without an area
    vertices[:, 2] = EAVES + (vertices[:, 2] - EAVES) * narrowing
    add("Gable", (vertices, faces), plaster, gable_temperature(vertices[:, 0], vertices[:, 2]))
    left = [(-HALF_WIDTH, 0, 0), (-HALF_WIDTH, DEPTH, 0), (-HALF_WIDTH, DEPTH, EAVES), (-HALF_WIDTH, 0, EAVES)]
    add("Other side", (np.array(left, float), [(0, 3, 2, 1)]), plaster, WALL)


def cut(wall, u, z, openings):
    """A wall's shape without the squares inside the openings. u, z: (n,) where its vertices are along it and up."""
    vertices, faces = wall
    corners = np.array(faces)
    middle_u, middle_z = u[corners].mean(axis=1), z[corners].mean(axis=1)
    inside = [
        (left < middle_u) & (middle_u < right) & (bottom < middle_z) & (middle_z < top)
        for left, bottom, right, top in openings
    ]
    return vertices, corners[~np.any(inside, axis=0)].tolist()


def soft(u, low, high, edge):
    """1 between two values, 0 outside, with edges so wide."""
    return 1 / (1 + np.exp((low - u) / edge)) / (1 + np.exp((u - high) / edge))


def front_temperature(x, z):
    """K of the front wall at points (n,)."""
    windows = (LOWER_LEFT, LOWER_RIGHT, UPPER_LEFT, UPPER_MIDDLE, UPPER_RIGHT)
    kelvin = WALL + bridges(z) + lintels(x, z, (DOOR, *windows)) + niches(x, z, (LOWER_LEFT, LOWER_RIGHT))
    # The patch without insulation is a few mats of 0.6 m by 1 m that are missing, side by side and on top.
    mats = ((-1.36, 2.96, 0.62, 1.0), (-1.36, 3.98, 0.62, 1.0), (0.72, 4.0, 0.62, 1.08))
    for left, bottom, width, height in mats:
        kelvin += 4.2 * soft(x, left, left + width, 0.035) * soft(z, bottom, bottom + height, 0.035)
    # Air that leaks from the upper right window's frame licks up the wall and spreads.
    left, _, right, top = UPPER_RIGHT
    above = np.maximum(z - top + 0.1, 0)
    spread = 0.10 + 0.35 * above
    for source, strength in ((left + 0.2, 6.0), (right - 0.35, 9.0)):
        plume = np.exp(-(((x - source) / spread) ** 2) - above / 0.3)
        kelvin += strength * plume * (z > top - 0.1)
    return kelvin


def bridges(z):
    """K that the edge of the floor slab, the cellar's ceiling and the rim of the roof are warmer."""
    slab = 3.0 * np.exp(-(((z - SLAB) / 0.11) ** 2))
    cellar = 3.5 * np.exp(-(((z - 0.18) / 0.14) ** 2))
    return slab + cellar + 1.2 * np.exp((z - EAVES) / 0.15)


def lintels(u, z, windows):
    """K that the concrete over the windows is warmer."""
    return sum(
        1.8 * soft(u, left - 0.2, right + 0.2, 0.03) * soft(z, top, top + 0.22, 0.03) for left, _, right, top in windows
    )


def niches(u, z, windows):
    """K that the thin walls behind the radiators under the windows are warmer."""
    return sum(
        3.4 * soft(u, left + 0.12, right - 0.12, 0.04) * soft(z, bottom - 0.68, bottom - 0.1, 0.05)
        for left, bottom, right, _ in windows
    )


def gable_temperature(x, z):
    """K of the gable: posts and braces under the plaster let less heat through than the clay between them."""
    up = z - EAVES
    upright = np.min([np.abs(x - post) for post in (-2.4, -0.8, 0.8, 2.4)], axis=0)
    level = np.min([np.abs(up - rail) for rail in (0.08, 1.28)], axis=0)
    brace = np.abs(np.abs(x) - 0.8 - 1.25 * (1.28 - up)) / 1.6 + 10 * (up > 1.28) + 10 * (np.abs(x) > 2.4)
    beam = np.min([upright, level, brace], axis=0) < 0.07
    return np.where(beam, WALL, WALL + 1.7)


# The rest of the house ------------------------------------------------------------------------------------------------


def add_window(name, opening, materials, turn, tilted=False) -> None:
    """Frame and pane of an opening, or a dark warm room behind a tilted pane. turn: of its wall about the corner."""
    left, bottom, right, top = opening
    place = {"location": (HALF_WIDTH, 0, 0) if turn else (0, 0, 0), "rotation": (0, 0, turn)}
    near, far, bar = REVEAL - 0.06, REVEAL, 0.07
    jambs = [
        box((left, 0, bottom), (left + 0.002, far, top)),
        box((right - 0.002, 0, bottom), (right, far, top)),
        box((left, 0, top - 0.002), (right, far, top)),
    ]
    add(f"{name} reveal", joined(*jambs), materials["plaster"], WALL + 2.0, **place)
    uprights = [left, right - bar] if right - left < 1.2 else [left, (left + right - bar) / 2, right - bar]
    bars = [box((u, near + 0.005, bottom + 0.005), (u + bar, far, top - 0.005)) for u in uprights]
    bars += [box((left - 0.005, near, z), (right + 0.005, far, z + bar)) for z in (bottom, top - bar)]
    frame = 284.5 if opening is UPPER_RIGHT else 279.0
    add(f"{name} frame", joined(*bars), materials["frame"], frame, bevel=0.01, **place)
    if opening is DOOR:
        panels = [box((left + 0.1, near + 0.03, z), (right - 0.1, far, z + 0.85)) for z in (0.12, 1.1)]
        panels.append(box((left, near + 0.045, bottom), (right, far - 0.005, top)))
        add(f"{name} leaf", joined(*panels), materials["frame"], 277.6, bevel=0.02, **place)
        step = box((left - 0.35, -0.7, 0), (right + 0.35, -0.002, 0.12))
        add("Doorstep", step, materials["paving"], 274.6, bevel=0.015, **place)
        return
    sill = box((left - 0.06, -0.1, bottom - 0.05), (right + 0.06, far, bottom))
    add(f"{name} sill", sill, materials["zinc"], 274.5, bevel=0.008, **place)
    pane = grid((left, 0, 0), (right - left, 0, 0), (0, 0, top - bottom), 0.08)
    _, _, z = pane[0].T
    kelvin = 275.6 + 1.5 * np.exp(-z / 0.15)  # the spacer of double glazing is warm, the air between the panes falls
    place["location"] = (*place["location"][:2], bottom)
    if tilted:
        lean = pane[0] + np.column_stack((0 * z, near + 0.03 + 0.22 * z / (top - bottom), 0 * z))
        add(f"{name} pane", (lean, pane[1]), materials["glass"], kelvin, **place)
        room = box((left - 0.3, far + 0.5, -0.2), (right + 0.3, far + 0.6, top - bottom + 0.2))
        add("Heated room", room, materials["plaster"], ROOM, **place)
    else:
        add(f"{name} pane", (pane[0] + (0, near + 0.03, 0), pane[1]), materials["glass"], kelvin, **place)


def add_roof(materials) -> None:
    """Courses of tiles that lie on each other, gutters, verge boards and a chimney in use."""
    slope = np.arctan2(RIDGE - EAVES, HALF_WIDTH)
    courses, over = 17, 0.45
    length = (HALF_WIDTH + over) / np.cos(slope)
    width = length / courses
    random = np.random.default_rng(1)
    for side in (-1, 1):
        tiles = [box((0, -0.5, 0), (width * 1.12, DEPTH + 0.5, 0.05)) for _ in range(courses)]
        for course, (vertices, _) in enumerate(tiles):
            vertices[:, 2] += 0.045 * vertices[:, 0] / width  # its lower end lies on the next course
            vertices[:, 0] += course * width
            vertices[:, 1] *= side  # turned by half a turn on the left side
        kelvin = np.repeat(268.6 + 0.25 * random.standard_normal(courses), 8)
        turn = (0, slope, 0 if side > 0 else np.pi)
        add(f"Tiles {side}", joined(*tiles), materials["tiles"], kelvin, (0, 0, RIDGE + 0.12), turn)
        edge = side * (HALF_WIDTH + over + 0.06)
        gutter = tube([(edge, y, EAVES - 0.22) for y in (-0.52, 3.5, DEPTH + 0.52)], 0.075, 24)
        add(f"Gutter {side}", gutter, materials["zinc"], 271.5)
        verge = np.array([(0, RIDGE + 0.1), (side * (HALF_WIDTH + over), EAVES - 0.2)])
        board = [*verge, *(verge[::-1] - (0, 0.2))] if side > 0 else [*verge[::-1], *(verge - (0, 0.2))]
        add(f"Verge {side}", prism(board, 0.05), materials["frame"], 271.0, (0, -0.5, 0))
    add("Ridge", tube([(0, y, RIDGE + 0.13) for y in (-0.52, 3.5, DEPTH + 0.52)], 0.12, 24), materials["tiles"], 269.5)
    soffit = [box((-4.42, -0.5, 5.0), (-4.0, 0.0, 5.02)), box((4.0, -0.5, 5.0), (4.42, 0.0, 5.02))]
    add("Soffits", joined(*soffit), materials["frame"], 273.0)
    stack = box((1.0, 2.2, 6.2), (1.7, 2.9, 8.9))
    add("Chimney", stack, materials["brick"], np.where(stack[0][:, 2] > 7, 281.5, 276.0), bevel=0.01)
    add("Chimney cap", box((0.93, 2.13, 8.9), (1.77, 2.97, 9.0)), materials["paving"], 280.0, bevel=0.01)
    pot = turned([(0.17, 0), (0.15, 0.35), (0.18, 0.4), (0.13, 0.4), (0.12, 0.2)])
    add("Chimney pot", pot, materials["tiles"], 296.0, (1.35, 2.55, 9.0))
    pipe = tube(curve([(3.86, -0.09, 0.1), (3.86, -0.09, 4.6), (4.0, -0.2, 4.85), (4.45, -0.2, 5.0)], 8), 0.05, 20)
    add("Downpipe", pipe, materials["zinc"], 273.2)


# Around the house -----------------------------------------------------------------------------------------------------


def add_ground(materials) -> None:
    """Lawn to the horizon, a path to the door, a street, a hedge and a bare tree."""
    add("Lawn", grid((-60, -8, -0.02), (120, 0, 0), (0, 90, 0), 10), materials["grass"], 269.2)
    add("Street", box((-60, -30, -0.3), (60, -8, -0.12)), materials["asphalt"], 273.6)
    add("Kerb", box((-60, -8.15, -0.3), (60, -7.95, 0.0)), materials["paving"], 272.4)
    slabs = [box((-0.66, y, -0.1), (0.74, y + 0.72, 0.01)) for y in np.arange(-7.9, -0.75, 0.78)]
    add("Path", joined(*slabs), materials["paving"], 271.9, bevel=0.01)
    add("Drive", box((4.9, -7.9, -0.1), (8.3, 5.0, 0.005)), materials["paving"], 271.6)
    random = np.random.default_rng(2)
    bushes = []
    for x in np.arange(-12.6, -4.6, 0.8):
        height = 1.15 + 0.15 * random.random()
        profile = [(0.25, 0), (0.55, 0.3), (0.6, 0.7), (0.45, 0.95 * height), (0.12, height)]
        vertices, faces = turned(profile, 12)
        bushes.append((vertices + (x, -1.4, 0), faces))
    add("Hedge", joined(*bushes), materials["grass"], 272.1)
    trunk = np.array([(0, 0, 0), (0.05, 0, 1.2), (-0.05, 0.05, 2.4), (0.1, 0, 3.8), (0.05, 0, 5.6)])
    branches = [tube(curve(trunk), np.linspace(0.16, 0.02, 33), 10)]
    for height in np.linspace(1.7, 5.0, 22):
        angle, reach = 2 * np.pi * random.random(), (6.4 - height) * (0.35 + 0.2 * random.random())
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        start = np.array([np.interp(height, trunk[:, 2], trunk[:, 0]), 0, height])
        bend, end = start + out * reach * 0.5 + (0, 0, 0.25 * reach), start + out * reach + (0, 0, 0.9 * reach)
        branches.append(tube(curve([start, bend, end], 5), np.linspace(0.05, 0.012, 11), 6))
    add("Tree", joined(*branches), materials["grass"], 272.6, (-7.2, 1.0, 0))


def add_car(materials, location=(6.15, -2.0, 0), turn=-96.0, warmer=0.0) -> None:
    """A car that has just come home: bonnet, tyres and exhaust are warm. Its front is at +x before it is turned.

    turn: degrees. warmer: K, than after a clear night.
    """
    place = {"location": location, "rotation": (0, 0, np.radians(turn))}
    back = [(-2.1, 0.32), (-2.12, 0.75), (-1.95, 0.92), (0.98, 0.92), (0.98, 0.31)]
    add("Car body", prism(back, 1.7), materials["paint"], 270.8 + warmer, bevel=0.06, **place)
    front = [(0.97, 0.31), (0.97, 0.92), (1.9, 0.78), (2.08, 0.55), (2.05, 0.3)]
    add("Car front", prism(front, 1.69), materials["paint"], 281.0 + warmer, bevel=0.06, **place)
    cabin = prism([(-1.85, 0.9), (-1.45, 1.42), (0.05, 1.45), (0.95, 0.9)], 1.5)
    cabin[0][:, 1] *= np.where(cabin[0][:, 2] > 1.2, 0.82, 1.0)
    add("Car windows", cabin, materials["glass"], 272.6 + warmer, bevel=0.04, **place)
    roof = box((-1.4, -0.62, 1.41), (0.02, 0.62, 1.47))
    add("Car roof", roof, materials["paint"], 268.8 + warmer, bevel=0.03, **place)
    tyre = turned([(0.1, -0.1), (0.29, -0.1), (0.33, -0.06), (0.33, 0.06), (0.29, 0.1), (0.1, 0.1)], 40)
    disc = turned([(0.19, -0.105), (0.19, 0.105)], 40)
    for x in (-1.3, 1.3):
        for y in (-0.78, 0.78):
            centre = np.array((x, y, 0.33))
            stand = (tyre[0] @ np.array([(1, 0, 0), (0, 0, 1), (0, -1, 0)]) + centre, tyre[1])
            add(f"Tyre {x} {y}", stand, materials["rubber"], warmer + (280.0 if x > 0 else 277.5), **place)
            hub = (disc[0] @ np.array([(1, 0, 0), (0, 0, 1), (0, -1, 0)]) + centre, disc[1])
            add(f"Brake {x} {y}", hub, materials["zinc"], warmer + (300.0 if x > 0 else 288.0), **place)


def add_lamp(materials) -> None:
    """A street lamp: the pole is as cold as the air, the head is warm."""
    pole = tube(curve([(0, 0, 0), (0, 0, 3.5), (0, 0, 4.6), (0.35, 0, 5.1), (1.0, 0, 5.2)], 8), 0.06, 20)
    add("Lamp pole", pole, materials["zinc"], AIR, (-6.4, -2.6, 0))
    head = turned([(0.02, 0.0), (0.28, 0.02), (0.3, 0.07), (0.14, 0.2), (0.03, 0.22)], 32)
    add("Lamp head", head, materials["frame"], 301.0, (-5.4, -2.6, 5.05))


if __name__ == "__main__":
    save(build, FOLDER / "facade.blend")
