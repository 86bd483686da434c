# SPDX-License-Identifier: GPL-3.0-or-later
"""Make car.blend: a car just parked under a clear evening sky, somebody behind a plastic film, and a tree.

    python -m docs.examples.car

Paint and glass follow Fresnel's law and show the cold sky. The engine's heat on the bonnet is an image of temperatures,
the film is a thin sheet, and the leaves are cut out of cards by an image.
"""

from __future__ import annotations

import numpy as np

from addon.properties import add_custom_property
from docs.examples.modelling import (
    ALONG_Y,
    FOLDER,
    add,
    add_camera,
    add_clear_sky,
    box,
    choose_settings,
    curve,
    grid,
    joined,
    lay_on,
    lying,
    new_image,
    save,
    surface,
    tube,
    turned,
)
from docs.examples.people import HANGING_ARM, HEAD, STANDING_LEG, TRUNK, add_person, mirrored

AIR, BODY = 284.0, 282.0  # K
WHEELS = (1.33, -1.33)  # m, where the axles are along x; the front is at +x
AXLE, TYRE, ARCH = 0.33, 0.33, 0.385  # m: height of the axles, radius of tyres, of the arches around them

# The body, m: at x the height of its top and of its lower edge, and half its width. Catmull-Rom curves join them.
TOP = [(-2.2, 0.6), (-2.17, 0.78), (-2.05, 0.9), (-1.6, 0.95), (-0.6, 0.95), (0.8, 0.95), (1.2, 0.92), (1.65, 0.84)]
TOP += [(1.95, 0.73), (2.1, 0.62), (2.16, 0.5)]
SILL = [(-2.2, 0.34), (-1.9, 0.24), (-1.0, 0.2), (0.0, 0.19), (1.0, 0.2), (1.9, 0.22), (2.16, 0.28)]
WIDTH = [(-2.2, 0.7), (-2.1, 0.78), (-1.8, 0.85), (-0.9, 0.89), (0.3, 0.9), (1.3, 0.88), (1.8, 0.83), (2.05, 0.74)]
WIDTH += [(2.16, 0.6)]
SECTION = [(0.95, 0.0), (1.0, 0.35), (1.0, 0.6), (0.97, 0.8), (0.91, 0.9), (0.78, 0.955), (0.42, 0.99), (0.0, 1.0)]

# The cabin, m: middle along x, half its length and width, and height, at the belt line and at the edge of the roof
BELT, ROOF = (-0.35, 1.42, 0.8, 0.92), (-0.5, 0.86, 0.6, 1.4)
PAINT, GLASS, TRIM = 0, 1, 2  # slots of the car's materials


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "paint": surface("Car paint", "Paint, lacquer on aluminium", 0.57, 0.04, (0.5, 0.05, 0.05), fresnel=True),
        "glass": surface("Car glass", "Glass, window", 1.0, 0.0, (0.2, 0.3, 0.35), fresnel=True),
        "trim": surface("Trim", "Plastic, polycarbonate", colour=(0.05, 0.05, 0.05)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", colour=(0.08, 0.08, 0.08)),
        "alloy": surface("Lacquered alloy", "Paint, lacquer on aluminium", 0.57, 0.1, (0.7, 0.7, 0.72), fresnel=True),
        "disc": surface("Brake disc", "Iron, weathered", colour=(0.3, 0.28, 0.26)),
        "asphalt": surface("Asphalt", "Asphalt, road", colour=(0.2, 0.2, 0.2)),
        "grass": surface("Grass", 0.97, colour=(0.2, 0.4, 0.15)),  # no library has it; leaves emit nearly all
        "bark": surface("Bark", 0.95, colour=(0.3, 0.22, 0.15)),
        "stone": surface("Kerb stone", "Granite", colour=(0.6, 0.6, 0.58)),
        "steel": surface("Steel", "Steel, cold rolled", 0.8, 0.2, (0.6, 0.6, 0.62)),
        "skin": surface("Skin", "Skin, human", colour=(0.8, 0.6, 0.5)),
        "clothes": surface("Polyester", "Plastic, PET", colour=(0.3, 0.35, 0.6)),
        "hair": surface("Hair", 0.97, colour=(0.15, 0.1, 0.08)),
    }
    add_body(materials)
    add_cabin(materials)
    add_details(materials)
    for x in WHEELS:
        for side in (-1, 1):
            add_wheel(materials, x, side)
    add_ground(materials)
    add_film(materials)
    add_tree(materials)
    add_camera((5.9, -4.7, 2.55), (-0.1, 0.4, 1.16), lens=45.0)
    choose_settings((8.1, 13.9, 8), "IRON", (261.15, 311.15), passes=4)
    add_clear_sky("Clear evening sky", AIR, humidity=50.0)


# The car --------------------------------------------------------------------------------------------------------------


def along(points, x):
    """A curve through points (position, value), at positions x (n,)."""
    smooth = curve(points)
    return np.interp(x, *smooth.T)


def stations():
    """Where along x the body has its sections: close together at the ends and at the arches."""
    angle = np.linspace(0.0, np.pi, 25)
    arches = [axle + ARCH * np.cos(angle) for axle in WHEELS]
    beside = [axle + side * (ARCH + 0.002) for axle in WHEELS for side in (-1, 1)]
    ends = [2.16 - 0.3 * np.linspace(0, 1, 14) ** 2, -2.2 + 0.3 * np.linspace(0, 1, 14) ** 2]
    between = [np.linspace(-0.85, 0.85, 24), [-1.8, 1.8]]
    return np.unique(np.concatenate((*arches, beside, *ends, *between)).round(4))


def section(x, rows=26):
    """Half a section of the body at x, from its lower edge, or the arch of a wheel, to the middle: (rows, 2) y, z."""
    top, sill, width = (float(along(points, x)) for points in (TOP, SILL, WIDTH))
    y, z = curve(SECTION).T
    y, z = width * y, sill + (top - sill) * z
    share = np.linspace(0.0, 1.0, len(z))
    away = np.min(np.abs(x - np.array(WHEELS)))  # from the nearest axle
    edge = AXLE + np.sqrt(max(ARCH**2 - away**2, 0.0)) if away < ARCH + 0.001 else sill
    lowest, fixed = np.interp(edge, z, share), 0.55  # rows above do not move, those below make way for the wheel
    at = np.linspace(0.0, 1.0, rows)
    at = np.where(at < fixed, lowest + at * (fixed - lowest) / fixed, at)
    return np.column_stack((np.interp(at, share, y), np.interp(at, share, z)))


def add_body(materials) -> None:
    """The body below the windows, with its image of temperatures; at the front ends a grille."""
    places = stations()
    rings = []
    for x in places:
        half = section(x)
        whole = np.concatenate((half * (-1, 1), half[-2::-1]))
        rings.append(np.column_stack((np.full(len(whole), x), whole)))
    count = len(rings[0])
    corner = np.arange(len(rings) - 1)[:, None] * count + np.arange(count - 1)
    faces = np.stack((corner, corner + count, corner + count + 1, corner + 1), axis=-1).reshape(-1, 4).tolist()
    ends = [list(range(count)), list(range(len(rings) * count - 1, (len(rings) - 1) * count - 1, -1))]
    body = add("Body", (np.concatenate(rings), faces + ends), materials["paint"], BODY)
    body.data.materials.append(materials["trim"])
    for polygon in list(body.data.polygons)[-2:]:
        polygon.material_index = 1
    lay_on(body.data, body_uv(np.concatenate(rings)))
    body["temperature_image"] = new_image("Body temperatures", body_temperatures())
    body["temperature_extension"] = "EXTEND"
    add("Underbody", box((-1.95, -0.6, 0.22), (1.9, 0.6, 0.62)), materials["trim"], 288.0)


LOW, HIGH = np.array([-2.25, -0.95]), np.array([2.25, 0.95])  # m: x and y of the corners of the image of temperatures


def body_uv(vertices):
    """Where vertices (n, 3) lie in an image that is laid on from above: (n, 2)."""
    return (vertices[:, :2] - LOW) / (HIGH - LOW)


def body_temperatures(width=288, height=122):
    """K over the car as seen from above, front to the right: (height, width). The bonnet's inner frame is cooler."""
    x = LOW[0] + (np.arange(width) + 0.5) / width * (HIGH - LOW)[0]
    y = (LOW[1] + (np.arange(height) + 0.5) / height * (HIGH - LOW)[1])[:, None]
    heat = 29 * np.exp(-(np.abs((x - 1.5) / 0.5) ** 3) - np.abs(y / 0.55) ** 3)
    frame = [((0.98, 0.12), (1.98, 0.42)), ((0.98, 0.55), (1.55, 0.29)), ((0.95, 0.0), (1.2, 0.0))]
    near = np.min([segment_distance(x, np.abs(y), *ends) for ends in frame], axis=0)
    heat *= 1 - 0.33 * np.exp(-((near / 0.03) ** 4))
    gap = np.abs(np.maximum(np.abs(x - 1.49) - 0.57, np.abs(y) - 0.68 + 0.06 * (x - 0.92)))
    heat += 3.0 * np.exp(-((gap / 0.016) ** 2))  # warm air from the joint around the bonnet
    nose = 9 * np.exp((x - 2.16) / 0.12) * np.exp(-((y / 0.45) ** 4))
    wings = 5 * np.exp(-(((x - 1.33) / 0.4) ** 2)) * (np.abs(y) > 0.7)
    return BODY + heat + nose + wings


def segment_distance(x, y, start, end):
    """Distance of points from the straight line between two points, all in a plane."""
    start, way = np.array(start), np.subtract(end, start)
    share = np.clip(((x - start[0]) * way[0] + (y - start[1]) * way[1]) / (way @ way), 0, 1)
    return np.hypot(x - start[0] - share * way[0], y - start[1] - share * way[1])


def add_cabin(materials) -> None:
    """Windows, pillars and roof in one piece."""
    around = cabin_outline()
    up = np.concatenate((np.linspace(0, 1, 13), [1.02, 1.06]))
    rings = [cabin_ring(around, v) for v in up]
    last = rings[-1]
    middle = np.array((ROOF[0], 0.0))
    for scale, rise in ((0.93, 0.022), (0.82, 0.04), (0.65, 0.058), (0.45, 0.071), (0.25, 0.078), (0.02, 0.08)):
        rings.append(np.column_stack((middle + scale * (last[:, :2] - middle), last[:, 2] + rise)))
    count, here = len(around), np.arange(len(around))
    there = (here + 1) % count
    band = np.column_stack((here, there, there + count, here + count))
    faces = np.concatenate([band + row * count for row in range(len(rings) - 1)]).tolist()
    faces.append((here + (len(rings) - 1) * count).tolist())
    vertices = np.concatenate(rings)
    share = (vertices[:, 2] - BELT[3]) / (ROOF[3] - BELT[3])
    cabin = add("Cabin", (vertices, faces), materials["paint"], 284.5 - 5.0 * np.clip(share, 0, 1.1))
    cabin.data.materials.append(materials["glass"])
    cabin.data.materials.append(materials["trim"])
    slots = np.full(len(faces), PAINT, np.int32)
    middle = np.abs((around + around[there]) / 2)  # of each column of faces
    pillar = (middle.min(axis=1) > 0.8) | ((middle[:, 0] < 0.06) & (middle[:, 1] > 0.9))
    for row, slot in enumerate([TRIM] + 10 * [GLASS]):
        slots[row * count : (row + 1) * count] = np.where(pillar, PAINT, slot)
    cabin.data.polygons.foreach_set("material_index", slots)


def cabin_outline(power=5.0):
    """A superellipse, (n, 2) of -1 to 1: many points at its corners, two close together in the middle of its sides."""
    front = np.arcsin(np.array([0.0, 0.2, 0.4, 0.55, 0.7]) ** (power / 2))
    side = np.arccos(np.array([0.7, 0.55, 0.3, 0.05, 0.0]) ** (power / 2))
    quarter = np.concatenate((front, np.linspace(front[-1], side[0], 16)[1:-1], side))
    angle = np.concatenate((quarter, np.pi - quarter, np.pi + quarter, 2 * np.pi - quarter))
    angle = np.unique(angle.round(9))[:-1]  # the last is the first
    return np.column_stack([np.sign(u) * np.abs(u) ** (2 / power) for u in (np.cos(angle), np.sin(angle))])


def cabin_ring(around, share):
    """The outline of the cabin at a share of the way from the belt line to the edge of the roof; it bulges a little."""
    x, length, width, z = (1 - share) * np.array(BELT) + share * np.array(ROOF)
    bulge = 0.03 * np.sin(np.pi * np.clip(share, 0, 1))
    outline = (x, 0.0) + (np.array((length, width)) + bulge) * around
    return np.column_stack((outline, np.full(len(outline), z)))


def ellipsoid(centre, radii, sides=32):
    """An ellipsoid whose axes are those of the scene."""
    angle = np.linspace(0.02, np.pi - 0.02, 17)
    vertices, faces = turned(np.column_stack((np.sin(angle), -np.cos(angle))), sides)
    return vertices * radii + centre, faces


def add_details(materials) -> None:
    """Headlamps, mirrors, joints of the doors, handles, number plate and wipers."""
    lamps = [ellipsoid((1.985, side * 0.585, 0.645), (0.1, 0.155, 0.06)) for side in (-1, 1)]
    add("Headlamps", joined(*lamps), materials["glass"], 293.0)
    fogs = [ellipsoid((2.1, side * 0.5, 0.37), (0.05, 0.07, 0.04)) for side in (-1, 1)]
    add("Fog lamps", joined(*fogs), materials["glass"], 285.0)
    shells = [ellipsoid((0.68, side * 0.98, 1.03), (0.07, 0.13, 0.075)) for side in (-1, 1)]
    arms = [tube([(0.72, side * 0.8, 0.96), (0.7, side * 0.88, 0.99), (0.69, side * 0.94, 1.01)], 0.02, 12)
            for side in (-1, 1)]  # fmt: skip
    add("Mirrors", joined(*shells, *arms), materials["paint"], 281.0)
    joints, handles = [], []
    for x in (0.82, -0.28, -0.86):
        y, z = section(x)[:19].T
        for side in (-1, 1):
            joints.append(tube(np.column_stack((np.full(19, x), side * y, z)), 0.006, 8))
            if x < 0.5:
                handles.append(box((x + 0.06, side * 0.88 - 0.03, 0.77), (x + 0.24, side * 0.88 + 0.03, 0.795)))
    add("Joints of the doors", joined(*joints), materials["rubber"], 285.5)
    add("Handles", joined(*handles), materials["paint"], 282.5, bevel=0.008)
    slats = [box((2.13, -0.42, z), (2.175, 0.42, z + 0.018)) for z in np.arange(0.3, 0.49, 0.04)]
    add("Grille", joined(*slats), materials["trim"], 291.0)
    add("Number plate", box((2.17, -0.26, 0.35), (2.185, 0.26, 0.46)), materials["alloy"], 284.0, bevel=0.004)


def open_ended(shape):
    """A turned shape without the discs that close its two ends."""
    return shape[0], shape[1][:-2]


def add_wheel(materials, x, side) -> None:
    """Tyre, rim with five spokes, and the hot brake behind them. side: -1 is the right of the car."""
    warm = x > 0  # the front wheels brake most
    profile = [(0.19, -0.1), (0.22, -0.105), (0.3, -0.1), (0.322, -0.085), (TYRE, -0.05), (TYRE, 0.05), (0.322, 0.085)]
    profile += [(0.3, 0.1), (0.22, 0.105), (0.19, 0.1)]
    tyre = open_ended(turned(profile, 64))
    radius = np.hypot(*tyre[0][:, :2].T)
    place = {"location": (x, side * 0.77, AXLE), "rotation": (0, 0, 0 if side < 0 else np.pi)}
    name = f"{'front' if warm else 'rear'} {'left' if side > 0 else 'right'}"
    tread = np.clip((radius - 0.27) / 0.06, 0, 1)
    add(f"Tyre {name}", lying(tyre, ALONG_Y), materials["rubber"], 287.0 + (10.0 if warm else 6.0) * tread, **place)
    rim = open_ended(turned([(0.187, -0.08), (0.187, 0.06), (0.2, 0.1), (0.215, 0.11), (0.224, 0.104)], 64))
    hub = turned([(0.002, 0.02), (0.06, 0.02), (0.06, 0.07), (0.045, 0.082), (0.002, 0.085)], 32)
    spokes = []
    for turn in 2 * np.pi * np.arange(5) / 5 + 0.3:
        vertices, faces = box((0.04, -0.024, 0.058), (0.2, 0.024, 0.082))
        c, s = np.cos(turn), np.sin(turn)
        spokes.append((vertices @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)]), faces))
    add(f"Rim {name}", lying(joined(rim, hub, *spokes), ALONG_Y), materials["alloy"], 292.0 if warm else 287.0, **place)
    disc = turned([(0.07, 0.0), (0.155, 0.0), (0.155, 0.024), (0.07, 0.024)], 64)
    back = turned([(0.002, -0.03), (0.19, -0.03), (0.19, -0.02), (0.002, -0.02)], 48)
    add(f"Brake {name}", lying(disc, ALONG_Y), materials["disc"], 345.0 if warm else 312.0, **place)
    add(f"Dust shield {name}", lying(back, ALONG_Y), materials["trim"], 293.0 if warm else 287.0, **place)


# Around the car -------------------------------------------------------------------------------------------------------


def add_ground(materials) -> None:
    """Asphalt that keeps the day's warmth, warmer below the engine and where the tyres rolled; a kerb and a meadow."""
    asphalt = grid((-7, -5, 0), (15, 0, 0), (0, 8, 0), 0.1)
    x, y, _ = asphalt[0].T
    warm = 9 * np.exp(-(((x - 1.4) / 0.5) ** 2) - (y / 0.45) ** 2)
    warm += 2.5 * np.exp(-(((x + 0.3) / 1.6) ** 2) - (y / 0.5) ** 2)
    behind = 1 / (1 + np.exp((x - 1.3) / 0.1))
    warm += 1.6 * behind * np.exp(-(((np.abs(y) - 0.77) / 0.09) ** 4))
    add("Asphalt", asphalt, materials["asphalt"], 287.0 + warm)
    add("Road", box((-90, -60, -0.3), (90, 3.0, -0.01)), materials["asphalt"], 287.0)
    add("Kerb", box((-90, 3.0, -0.3), (90, 3.15, 0.1)), materials["stone"], 285.5, bevel=0.02)
    add("Meadow", box((-90, 3.15, -0.3), (90, 160, 0.06)), materials["grass"], 280.5)


def add_film(materials) -> None:
    """A plastic film on a frame, and somebody behind it. The film is a sheet that lets most of the heat pass."""
    film = surface("Plastic film", 0.12, 1.0, 0.0, (0.1, 0.1, 0.1))
    add_custom_property(film, "transmittance", 0.78)
    place = {"location": (0.33, 3.35, 0.06), "rotation": (0, 0, np.radians(38))}
    sheet = grid((-0.75, 0, 0.1), (1.5, 0, 0), (0, 0, 1.1), 0.05)
    sheet[0][:, 1] += 0.012 * np.sin(9 * sheet[0][:, 0] + 2 * sheet[0][:, 2]) * np.sin(5 * sheet[0][:, 2])
    add("Film", sheet, film, 283.0, **place)
    posts = [tube([(x, 0, 0), (x, 0, 0.6), (x, 0, 1.25)], 0.025, 16) for x in (-0.77, 0.77)]
    rails = [tube([(-0.77, 0, z), (0, 0, z), (0.77, 0, z)], 0.015, 12) for z in (0.09, 1.21)]
    add("Frame", joined(*posts, *rails), materials["steel"], 283.0, **place)
    cones = HEAD + TRUNK + STANDING_LEG + mirrored(STANDING_LEG) + HANGING_ARM + mirrored(HANGING_ARM)
    add_person("Somebody", cones, materials, (-0.15, 4.15, 0.06), np.radians(38))


def twig_mask(size=128):
    """How much of a card is no leaf: (size, size), 0 on leaves, 1 between them. The twig grows along the rows."""
    x, y = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size)
    away = np.abs(y - 0.5) - 0.008 * (1 - x)  # the stalk
    away = np.where(x < 0.8, away, 1.0)
    for number in range(9):
        side, at = (-1) ** number, 0.1 + 0.085 * number
        turn = side * np.radians(52 - 3 * number) * (number < 8)
        reach = 0.17 - 0.006 * number
        u = (x - at) * np.cos(turn) + (y - 0.5) * np.sin(turn) - reach
        v = -(x - at) * np.sin(turn) + (y - 0.5) * np.cos(turn)
        away = np.minimum(away, np.hypot(u / reach, v / (0.42 * reach)) - 1)
    return (away > 0).astype(np.float32)


def add_tree(materials, place=(-9.5, 4.6, 0.0), cards=1800) -> None:
    """A tree whose twigs are cards. What is between the leaves is not there: a material that lets all pass."""
    leaf = surface("Leaf", 0.96, colour=(0.15, 0.4, 0.1))
    nothing = surface("Nothing", 0.0)
    add_custom_property(nothing, "transmittance", 1.0)
    leaf["mix"], leaf["mix_material"] = new_image("Twig", twig_mask(), is_float=False), nothing
    leaf["mix_interpolation"], leaf["mix_extension"] = "Closest", "EXTEND"
    random = np.random.default_rng(5)
    out = random.standard_normal((cards, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    radius = random.random((cards, 1)) ** 0.4 * (1 + 0.13 * np.sin(5 * out[:, :1] + 4 * out[:, 1:2]))
    centre = (0, 0, 2.85) + radius * out * (1.7, 1.7, 1.35)
    growing = out + 0.7 * random.standard_normal((cards, 3)) + (0, 0, 0.2)
    growing *= 0.42 / np.linalg.norm(growing, axis=1)[:, None]
    across = np.cross(growing, random.standard_normal((cards, 3)))
    across *= 0.42 / np.linalg.norm(across, axis=1)[:, None]
    corner = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    vertices = centre[:, None] + corner[:, :1] * growing[:, None] + corner[:, 1:] * across[:, None]
    faces = np.arange(4 * cards).reshape(-1, 4).tolist()
    kelvin = 283.4 - 1.5 * radius[:, 0] * np.clip(out[:, 2] + 0.3, 0, 1)  # leaves that see the sky are colder
    tree = add("Leaves", (vertices.reshape(-1, 3), faces), leaf, np.repeat(kelvin, 4), place)
    lay_on(tree.data, np.tile(corner + 0.5, (cards, 1)))
    trunk = np.array([(0, 0, 0), (0.04, 0, 0.9), (-0.03, 0.03, 1.8), (0.05, 0, 2.8), (0, 0, 4.2)])
    branches = [tube(curve(trunk), np.linspace(0.15, 0.02, 33), 16)]
    for height in np.linspace(1.4, 3.4, 14):
        turn = 2.4 * height * 5
        way = np.array([np.cos(turn), np.sin(turn), 0.5])
        start = np.array([np.interp(height, trunk[:, 2], trunk[:, 0]), 0, height])
        branches.append(tube(curve([start, start + 0.5 * way, start + 1.1 * way + (0, 0, 0.2)], 6),
                             np.linspace(0.05, 0.012, 13), 8))  # fmt: skip
    add("Trunk", joined(*branches), materials["bark"], 284.8, place)


if __name__ == "__main__":
    save(build, FOLDER / "car.blend")
