# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the benchmark of error against time: what thermal cameras look at, of diffuse and mirror materials only, in
SCENES without and in GAS_SCENES with gas.

Emissivities and coefficients of gas are constant inside each band, so that a band's mean does not depend on the
temperature that weights it, and all renderers solve one problem to the last digit.
"""

from dataclasses import replace

import numpy as np

from addon.solver import Grid, Material, Medium, mix_in
from tests.helpers.scenes import box, look, make_scene, sphere

WIDTH, HEIGHT = 128, 96
LWIR = np.linspace(7.5, 14.0, 17)
ENGINE_BANDS = np.linspace(3.0, 12.0, 17)


def in_bands(edges, *points):
    """Steps of emissivity, one a band, through pairs of wavelength (um) and emissivity: pairs again, (2 b, 2)."""
    values = np.interp(0.5 * (edges[1:] + edges[:-1]), *np.transpose(points))
    ends = np.column_stack((edges[:-1] * (1 + 1e-9), edges[1:]))
    return np.column_stack((ends.ravel(), np.repeat(values, 2)))


PAINT = in_bands(LWIR, (7.0, 0.93), (9.0, 0.96), (11.0, 0.90), (14.0, 0.94))
GLASS = in_bands(LWIR, (7.0, 0.95), (8.0, 0.90), (9.5, 0.68), (11.0, 0.85), (14.0, 0.92))
PLASTER = in_bands(LWIR, (7.0, 0.60), (8.5, 0.75), (10.0, 0.88), (14.0, 0.92))
RUST = in_bands(ENGINE_BANDS, (3.0, 0.62), (5.0, 0.74), (8.0, 0.80), (12.0, 0.72))
ENAMEL = in_bands(ENGINE_BANDS, (3.0, 0.88), (5.5, 0.94), (9.0, 0.83), (12.0, 0.91))


class Parts:
    """Collects meshes, each of one temperature (K) and one material."""

    def __init__(self):
        self.vertices, self.triangles, self.temperature, self.material, self.materials = [], [], [], [], []

    def add(self, mesh, temperature, material, at=(0.0, 0.0, 0.0)):
        """mesh: vertices (n, 3) and triangles (m, 3). temperature: K, one or (m,). at: m."""
        vertices, triangles = mesh
        if material not in self.materials:
            self.materials.append(material)
        first = sum(map(len, self.vertices))
        self.vertices.append(vertices + np.asarray(at, float))
        self.triangles.append(triangles + np.int32(first))
        self.temperature.append(np.broadcast_to(temperature, (len(triangles),)))
        self.material.append(np.full(len(triangles), self.materials.index(material)))

    def scene(self, camera, edges, world_temperature):
        together = map(np.concatenate, (self.vertices, self.triangles, self.temperature, self.material))
        vertices, triangles, temperature, material = together
        return make_scene(
            vertices,
            triangles,
            temperature,
            self.materials,
            camera,
            edges,
            material,
            world_temperature=world_temperature,
        )


def grid(corner, u, v, columns=1, rows=1):
    """Rectangle from a corner along u and v, in columns by rows cells; its front is where u, v turn left."""
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    vertices = np.asarray(corner, float) + s.reshape(-1, 1) * np.asarray(u, float) + t.reshape(-1, 1) * np.asarray(v)
    return vertices, grid_triangles(columns, rows)


def grid_triangles(columns, rows):
    """Two triangles for each cell between (columns + 1) by (rows + 1) points."""
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    return np.concatenate((np.column_stack((a, b, c)), np.column_stack((a, c, d)))).astype(np.int32)


def revolve(profile, segments, start=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    """Surface of revolution of (n, 2) pairs of radius and height (m), which go round so that the front is outside."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    u = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    angle = 2 * np.pi * np.arange(segments) / segments
    circle = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    profile = np.asarray(profile, float)
    vertices = profile[:, :1, None] * circle + profile[:, 1:, None] * axis
    wrapped = (grid_triangles(segments, len(profile) - 1) // (segments + 1)) * segments + grid_triangles(
        segments, len(profile) - 1
    ) % (segments + 1) % segments
    corners = vertices.reshape(-1, 3) + np.asarray(start, float)
    a, b, c = corners[wrapped].transpose(1, 0, 2)
    return corners, wrapped[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]


def cylinder(start, end, radius, segments, rings=1):
    """Closed cylinder between two points, its side cut into rings."""
    length = np.linalg.norm(np.subtract(end, start))
    side = [(radius, length * i / rings) for i in range(rings + 1)]
    return revolve([(0.0, 0.0), *side, (0.0, length)], segments, start, np.subtract(end, start))


def stretched(mesh, size):
    return mesh[0] * np.asarray(size, float), mesh[1]


def room():
    """Closed room of 5 x 4 x 2.8 m with a cold window, a radiator, furniture and a person."""
    parts = Parts()
    plaster, paint, glass = Material("plaster", PLASTER), Material("paint", PAINT), Material("glass", GLASS)
    wood, floor, metal = Material("wood", 0.85), Material("floor", 0.9), Material("metal", 0.6)
    vertices, triangles = box((5.0, 4.0, 2.8))
    shell = zip((291.0, 293.0, 290.0, 292.5, 289.0, 294.0), [plaster] * 4 + [floor, paint], strict=True)
    for face, (temperature, material) in enumerate(shell):
        parts.add((vertices, triangles[2 * face : 2 * face + 2, ::-1]), temperature, material)
    parts.add(grid((4.99, 1.2, 1.0), (0, 0, 1.2), (0, 1.6, 0)), 279.0, glass)
    parts.add(box((0.12, 1.5, 0.6)), 338.0, metal, (4.85, 1.25, 0.15))
    parts.add(box((1.4, 0.8, 0.04)), 292.0, wood, (2.2, 1.4, 0.71))
    for x in (2.25, 3.5):
        for y in (1.45, 2.1):
            parts.add(box((0.05, 0.05, 0.73)), 291.5, wood, (x, y, -0.01))
    parts.add(box((0.8, 1.9, 0.45)), 293.5, wood, (0.05, 1.9, -0.01))  # sofa
    parts.add(box((0.25, 1.9, 0.9)), 293.5, wood, (0.02, 1.9, -0.01))
    parts.add(box((1.2, 0.45, 2.0)), 290.5, paint, (1.5, 3.52, -0.01))  # cabinet
    parts.add(box((0.3, 0.25, 0.2)), 312.0, metal, (2.7, 1.7, 0.76))  # a device on the table
    skin = Material("skin", 0.98)
    parts.add(stretched(sphere(3), (0.22, 0.3, 0.45)), 304.0, paint, (3.6, 2.9, 1.1))
    parts.add(sphere(3, 0.12), 306.0, skin, (3.6, 2.9, 1.68))
    for y in (2.78, 3.02):
        parts.add(cylinder((3.6, y, -0.01), (3.6, y, 0.8), 0.09, 24), 301.0, paint)
    return parts.scene(look((0.4, 0.35, 1.7), (3.4, 2.5, 1.0), WIDTH, HEIGHT, 0.75), LWIR, 285.0)


def ring():
    """A small 900 K ball beside the middle of a mirror ring on the ground, its caustic inside the ring, a cold sky."""
    parts = Parts()
    ground, steel = Material("ground", 0.7), Material("steel", 0.85)
    mirror = Material("mirror", 0.05, specular=1.0)
    parts.add(grid((-20, -20, 0), (40, 0, 0), (0, 40, 0)), 288.0, ground)
    profile = [(1.0, 0.4), (1.0, -0.01), (1.04, -0.01), (1.04, 0.4), (1.0, 0.4)]
    parts.add(revolve(profile, 256), 288.0, mirror)
    parts.add(sphere(3, 0.06), 900.0, steel, (0.45, 0.1, 0.3))
    return parts.scene(look((0.0, -3.2, 2.4), (0, 0, 0.05), WIDTH, HEIGHT, 0.42), np.linspace(3.0, 5.0, 13), 230.0)


def cavity():
    """A box four times as deep as its opening is wide, about 300 K and poorly emitting, seen through the opening."""
    parts = Parts()
    walls, plate = Material("walls", 0.35), Material("plate", 0.5)
    vertices, triangles = box((1.0, 1.0, 4.0))
    inward = triangles[:, ::-1]
    for face, temperature in zip(range(4), (298.0, 302.0, 300.0, 301.0), strict=True):
        parts.add((vertices, inward[2 * face : 2 * face + 2]), temperature, walls)
    parts.add((vertices, inward[8:10]), 305.0, walls)
    parts.add(box((0.35, 0.3, 0.5)), 315.0, plate, (0.15, 0.2, -0.01))
    parts.add(sphere(3, 0.16), 288.0, walls, (0.65, 0.65, 0.4))
    parts.add(box((0.1, 1.02, 0.1)), 295.0, plate, (0.8, -0.01, 2.2))  # a beam across
    for corner, u, v in (  # the ground around the opening
        ((-6, -6, 4), (13, 0, 0), (0, 6, 0)),
        ((-6, 1, 4), (13, 0, 0), (0, 6, 0)),
        ((-6, 0, 4), (6, 0, 0), (0, 1, 0)),
        ((1, 0, 4), (6, 0, 0), (0, 1, 0)),
    ):
        parts.add(grid(corner, u, v), 283.0, plate)
    return parts.scene(look((0.35, 0.2, 6.2), (0.52, 0.55, 0.0), WIDTH, HEIGHT, 0.30), LWIR, 200.0)


def engine():
    """An engine bay under the sky: some 100,000 triangles of small parts at 20 temperatures."""
    random = np.random.default_rng(7)
    parts = Parts()
    temperatures = np.round(np.geomspace(290.0, 700.0, 20))
    materials = [Material("rust", RUST), Material("enamel", ENAMEL), Material("aluminium", 0.25)]
    materials += [Material("rubber", 0.93), Material("cast iron", 0.6)]
    vertices, triangles = box((1.2, 0.8, 0.6))
    parts.add((vertices, triangles[:10, ::-1]), temperatures[1], materials[1])
    parts.add(grid((-4, -4, -0.001), (10, 0, 0), (0, 10, 0)), temperatures[0], materials[3])

    def pick():  # hot parts are rarer than warm ones
        return temperatures[int(20 * random.random() ** 1.8)], materials[random.integers(5)]

    for column in range(12):
        for row in range(8):
            x, y = 0.05 + 0.1 * column, 0.05 + 0.1 * row
            height = random.uniform(0.08, 0.3)
            kind = random.integers(3)
            if kind == 0:
                parts.add(cylinder((x, y, 0.0), (x, y, height), random.uniform(0.02, 0.045), 32, 8), *pick())
            elif kind == 1:
                size = random.uniform(0.04, 0.09, 3) * (1, 1, 2)
                parts.add(box(size), *pick(), (x - 0.5 * size[0], y - 0.5 * size[1], -0.001))
            else:
                radius = random.uniform(0.02, 0.045)
                parts.add(sphere(3, radius), *pick(), (x, y, random.uniform(0.05, 0.25)))
    for _ in range(90):  # pipes and hoses across
        start = random.uniform((0.02, 0.02, 0.2), (1.18, 0.78, 0.5))
        end = np.clip(start + random.normal(0.0, 0.3, 3), (0.02, 0.02, 0.1), (1.18, 0.78, 0.55))
        parts.add(cylinder(start, end, random.uniform(0.006, 0.018), 24, 6), *pick())
    for _ in range(60):  # bolts
        parts.add(
            sphere(2, random.uniform(0.005, 0.012)), *pick(), random.uniform((0.03, 0.03, 0.1), (1.17, 0.77, 0.5))
        )
    camera = look((0.6, -0.1, 1.6), (0.6, 0.4, 0.15), WIDTH, HEIGHT, 0.42)
    return parts.scene(camera, ENGINE_BANDS, 250.0)


def street():
    """A street between two rows of houses on a clear night, a car with a warm bonnet and a person."""
    parts = Parts()
    asphalt, brick, glass = Material("asphalt", 0.94), Material("brick", PLASTER), Material("glass", GLASS)
    metal, cloth = Material("metal", 0.3), Material("cloth", 0.96)
    parts.add(grid((-40, -30, 0), (80, 0, 0), (0, 130, 0)), 277.0, asphalt)
    for side in (-1, 1):
        for house in range(6):
            y = 3.0 + 9.0 * house
            near, far = sorted((7.0 * side, 15.0 * side))
            parts.add(
                box((far - near, 8.6, 8.0 + (house * 5 + side) % 3)), 276.0 + 0.5 * house, brick, (near, y, -0.01)
            )
            for floor in range(3):
                for column in range(4):
                    at = np.array((6.98 * side, y + 0.8 + 1.9 * column, 1.0 + 2.5 * floor))
                    turn = ((0, 0, 1.4), (0, 1.2, 0)) if side > 0 else ((0, 1.2, 0), (0, 0, 1.4))
                    parts.add(grid(at, *turn), 281.0 + 1.5 * ((house + 2 * floor + 3 * column) % 5), glass)
    parts.add(box((1.7, 2.6, 1.3)), 278.0, metal, (2.2, 10.0, 0.2))
    parts.add(box((1.7, 1.1, 0.75)), 302.0, metal, (2.2, 8.9, 0.2))
    parts.add(stretched(sphere(3), (0.22, 0.22, 0.85)), 296.0, cloth, (-2.0, 8.0, 0.86))
    parts.add(sphere(3, 0.12), 305.0, cloth, (-2.0, 8.0, 1.82))
    return parts.scene(look((-0.6, -4.0, 3.2), (0.3, 12.0, 2.4), WIDTH, HEIGHT, 0.6), LWIR, 235.0)


def office():
    """A closed office of 7 x 5 x 3 m with cold windows, metal furniture, small lamps, and a mirror that shows them."""
    parts = Parts()
    plaster, paint, glass = Material("plaster", PLASTER), Material("paint", PAINT), Material("glass", GLASS)
    steel, aluminium, wood = Material("steel", 0.25), Material("aluminium", 0.12), Material("wood", 0.9)
    vertices, triangles = box((7.0, 5.0, 3.0))
    shell = zip((290, 288, 295, 291, 287, 296), (plaster, paint, plaster, paint, wood, plaster), strict=True)
    for face, (temperature, material) in enumerate(shell):
        parts.add((vertices, triangles[2 * face : 2 * face + 2, ::-1]), temperature, material)
    parts.add(grid((6.99, 0.5, 0.9), (0, 0, 1.5), (0, 2.0, 0)), 275.0, glass)
    parts.add(grid((6.99, 3.0, 0.9), (0, 0, 1.5), (0, 1.5, 0)), 276.0, glass)
    parts.add(grid((2.0, 4.99, 0.8), (2.0, 0, 0), (0, 0, 1.4)), 292.0, Material("mirror", 0.06, specular=1.0))
    for x in (1.5, 3.2, 4.9):  # desks with a screen, a computer and a lamp
        parts.add(box((1.3, 0.7, 0.03)), 291.0, wood, (x, 1.0, 0.72))
        parts.add(box((0.05, 0.6, 0.72)), 291.0, steel, (x + 0.05, 1.05, -0.01))
        parts.add(box((0.05, 0.6, 0.72)), 291.0, steel, (x + 1.2, 1.05, -0.01))
        parts.add(box((0.5, 0.03, 0.35)), 300.0 + 4.0 * x, aluminium, (x + 0.4, 1.5, 0.8))
        parts.add(box((0.2, 0.4, 0.4)), 305.0 + 5.0 * x, steel, (x + 0.9, 1.1, 0.05))
        parts.add(sphere(3, 0.06), 340.0, wood, (x + 0.1, 1.2, 1.1))
    for shelf in range(4):
        parts.add(box((0.9, 0.3, 0.02)), 291.5, aluminium, (0.2, 2.5, 0.5 + 0.5 * shelf))
    parts.add(box((1.0, 0.4, 1.8)), 289.0, steel, (5.5, 4.5, -0.01))
    parts.add(cylinder((4.5, 3.2, -0.01), (4.5, 3.2, 1.3), 0.22, 32), 303.0, paint)  # a person
    parts.add(sphere(3, 0.13), 307.0, Material("skin", 0.98), (4.5, 3.2, 1.5))
    return parts.scene(look((0.4, 0.5, 1.8), (4.5, 3.0, 0.9), WIDTH, HEIGHT, 0.7), LWIR, 285.0)


def bay():
    """An engine bay where parts reach through one another, few of them hot, among these rings: 100,000 triangles."""
    random = np.random.default_rng(11)
    parts = Parts()
    temperatures = np.round(np.linspace(300, 800, 20))
    materials = [Material("rust", RUST), Material("enamel", ENAMEL), Material("aluminium", 0.2), Material("iron", 0.6)]
    vertices, triangles = box((1.4, 1.0, 0.5))
    parts.add((vertices, triangles[:10, ::-1]), 305.0, materials[1])
    parts.add(grid((-3, -3, -0.001), (8, 0, 0), (0, 8, 0)), 290.0, materials[3])

    def pick():
        return temperatures[int(20 * random.random() ** 2.5)], materials[random.integers(4)]

    while sum(map(len, parts.triangles)) < 100_000:
        kind, at = random.integers(4), random.uniform((0.05, 0.05, 0.03), (1.3, 0.9, 0.4))
        if kind == 0:
            radius, tube = random.uniform(0.03, 0.08), random.uniform(0.004, 0.012)
            angle = np.linspace(0, 2 * np.pi, 13)
            profile = np.column_stack((radius + tube * np.cos(angle), tube * np.sin(angle)))
            parts.add(revolve(profile, 40), *pick(), at)
        elif kind == 1:
            parts.add(box(random.uniform(0.03, 0.1, 3)), *pick(), at)
        elif kind == 2:
            parts.add(sphere(3, random.uniform(0.01, 0.05)), *pick(), at)
        else:
            end = at + random.normal(0, 0.1, 3)
            parts.add(cylinder(at, end, random.uniform(0.005, 0.03), 32, 6), *pick())
    return parts.scene(look((0.7, 0.2, 1.5), (0.7, 0.5, 0.1), WIDTH, HEIGHT, 0.45), ENGINE_BANDS, 255.0)


def fog():
    """The room in steam, 2 g/m3 of droplets of 5 um, at 291 K; all bands have one anisotropy, as peers need it."""
    drops = mix_in(Medium("fog", temperature=291.0), {"Water droplets 5 um": 2.0})
    absorption, scattering = (in_bands(LWIR, *points) for points in (drops.absorption, drops.scattering))
    return _with_gas(replace(drops, absorption=absorption, scattering=scattering, anisotropy=0.8))


def clear():
    """The room with a gas that absorbs and emits, a little in a window from 8 to 12 um and much beside it."""
    absorption = in_bands(
        LWIR, (7.5, 0.6), (8.2, 0.08), (9.5, 0.04), (11.0, 0.05), (12.0, 0.12), (13.0, 0.4), (14.0, 0.9)
    )
    return _with_gas(Medium("gas", absorption, 296.0))


def plume():
    """The room with a plume of hot gas over the device on the table, in cells of 12.5 x 12.5 x 28 mm."""
    absorption = in_bands(LWIR, (7.5, 2.0), (9.0, 0.6), (11.0, 0.8), (14.0, 2.5))
    return _with_gas(Medium("plume", absorption, 292.0, grid=plume_grid(64)))


def _with_gas(medium):
    return replace(room(), media=(medium,), world_depth=5.0)


def plume_grid(cells: int) -> Grid:
    """A cone of hot gas over the device on the table, up to the ceiling, in cells^3 cells of 0.8 x 0.8 x 1.8 m."""
    x, y, z = np.meshgrid(*3 * [(np.arange(cells) + 0.5) / cells], indexing="ij", sparse=True)
    swirl = 0.06 * z * np.sin(17.0 * z), 0.06 * z * np.cos(13.0 * z)
    radius = np.hypot(x - 0.5 - swirl[0], y - 0.5 - swirl[1]) / (0.12 + 0.33 * z)
    core = np.exp(-2.0 * radius**2) * (1.0 + 0.3 * np.sin(40.0 * x) * np.sin(37.0 * y) * np.sin(31.0 * z))
    density = np.where(core > 0.02, core, 0.0)
    transform = np.diag([0.8 / cells, 0.8 / cells, 1.8 / cells, 1.0])
    transform[:3, 3] = 2.45, 1.42, 0.97
    return Grid.from_arrays(transform, density, 292.0 + 150.0 * core)


SCENES = {scene.__name__: scene for scene in (room, ring, cavity, engine, street, office, bay)}
GAS_SCENES = {scene.__name__: scene for scene in (fog, plume, clear)}


def build(name, size=None):
    """The scene of this name. size: width and height in pixels, if not its own."""
    scene = (SCENES | GAS_SCENES)[name]()
    if not size:
        return scene
    width, height = size
    return replace(scene, camera=replace(scene.camera, width=width, height=height))
