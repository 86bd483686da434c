# SPDX-License-Identifier: GPL-3.0-or-later
"""What the example scenes are built with: shapes, things with a temperature, a camera and the settings of a render.

A shape is a pair (vertices (n, 3) float in m, faces: a list of lists of vertex indices), whose faces look outwards.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

import addon
from addon.properties import add_custom_property

FOLDER = Path(__file__).resolve().parent

# Binary fractions to which what is saved is rounded, far finer than anything to be seen: short numbers compress well,
# and do not depend on how a system rounds.
PER_METRE, PER_KELVIN = 2**14, 2**6

ALONG_X = np.array([(0, 0, -1), (0, 1, 0), (1, 0, 0)])  # turns what stands on z to lie along x
ALONG_Y = np.array([(1, 0, 0), (0, 0, -1), (0, 1, 0)])  # and along -y
SHARP = np.radians(40.0)  # from which angle between two faces on their edge is an edge to be seen, not part of a curve

# Shapes ---------------------------------------------------------------------------------------------------------------


def box(low, high):
    """A box between two corners."""
    vertices = [(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return np.array(vertices, float), faces


def grid(origin, side_u, side_v, step):
    """A rectangle of squares about `step` m wide, which looks along side_u x side_v. Rows along side_u come first."""
    origin, side_u, side_v = (np.asarray(vector, float) for vector in (origin, side_u, side_v))
    columns, rows = (max(1, round(float(np.linalg.norm(side)) / step)) for side in (side_u, side_v))
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1]
    vertices = origin + u[..., None] / columns * side_u + v[..., None] / rows * side_v
    corner = np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)
    faces = np.stack((corner, corner + 1, corner + columns + 2, corner + columns + 1), axis=-1)
    return vertices.reshape(-1, 3), faces.reshape(-1, 4).tolist()


def prism(outline, width):
    """An outline [(x, z), ...], clockwise as seen from -y, drawn out along y to both sides of y = 0."""
    outline = np.array(outline, float)
    count = len(outline)
    near, far = (np.insert(outline, 1, y, axis=1) for y in (-width / 2, width / 2))
    there = [*range(1, count), 0]
    sides = [(i, i + count, there[i] + count, there[i]) for i in range(count)]
    return np.concatenate((near, far)), [tuple(reversed(range(count))), tuple(range(count, 2 * count)), *sides]


def curve(points, steps=8):
    """A smooth curve through points (Catmull-Rom) in space or in a plane: (m, 3) or (m, 2), so many steps from one to
    the next."""
    points = np.array(points, float)
    ends = 2 * points[0] - points[1], 2 * points[-1] - points[-2]
    a, b, c, d = (np.concatenate(([ends[0]], points, [ends[1]]))[i : i + len(points) - 1, None] for i in range(4))
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    inner = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
    return np.concatenate((inner.reshape(-1, points.shape[1]), points[-1:]))


def tube(path, radius, sides=32):
    """A closed tube around a path (m, 3). radius: one, or one for each point."""
    path = np.asarray(path, float)
    radius = np.broadcast_to(np.asarray(radius, float), len(path))
    tangents = np.gradient(path, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    across = np.cross(tangents[0], np.eye(3)[np.argmin(np.abs(tangents[0]))])
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for point, tangent, r in zip(path, tangents, radius, strict=True):
        across = across - (across @ tangent) * tangent  # carried along without twist
        across /= np.linalg.norm(across)
        ring = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(tangent, across)
        rings.append(point + r * ring)
    return np.concatenate(rings), _rings_faces(len(path), sides)


def turned(profile, sides=48):
    """A closed body of revolution about the z axis. profile: [(radius, z), ...] from the bottom to the top."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = [np.column_stack((r * np.cos(angle), r * np.sin(angle), np.full(sides, z))) for r, z in profile]
    return np.concatenate(rings), _rings_faces(len(profile), sides)


def _rings_faces(count, sides):
    """Faces between so many rings of vertices, and the two ends."""
    here = np.arange(sides)
    there = (here + 1) % sides
    band = np.column_stack((here, there, there + sides, here + sides))
    faces = np.concatenate([band + first for first in range(0, (count - 1) * sides, sides)])
    return [*faces.tolist(), here[::-1].tolist(), (here + (count - 1) * sides).tolist()]


def joined(*shapes):
    """Several shapes as one."""
    firsts = np.cumsum([0] + [len(vertices) for vertices, _ in shapes])
    faces = [
        [corner + first for corner in face]
        for (_, of_shape), first in zip(shapes, firsts.tolist(), strict=False)
        for face in of_shape
    ]
    return np.concatenate([vertices for vertices, _ in shapes]), faces


def lying(shape, matrix):
    """A shape turned by one of the matrices above."""
    return shape[0] @ matrix.T, shape[1]


def blob(distance: Callable, low, high, step):
    """The surface where distance(points (n, 3)) (n,) is 0, negative inside, as quads: surface nets (Gibson 1998).

    A cell of the raster that the surface crosses gets a vertex, the mean of the crossings on its edges; an edge that
    the surface crosses gets a face between the four cells around it. The surface has to lie inside low .. high.
    """
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = distance(corners.reshape(-1, 3)).reshape(corners.shape[:3])
    total, count = np.zeros(corners.shape), np.zeros(corners.shape[:3])
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first, second = values, np.roll(values, -1, axis)
        index = np.argwhere((first < 0) != (second < 0))
        here = tuple(index.T)
        point = corners[here].copy()
        point[:, axis] += step * first[here] / (first[here] - second[here])
        around = []
        for back_u, back_v in ((0, 0), (1, 0), (1, 1), (0, 1)):
            cell = index.copy()
            cell[:, u] -= back_u
            cell[:, v] -= back_v
            np.add.at(total, tuple(cell.T), point)
            np.add.at(count, tuple(cell.T), 1)
            around.append(np.ravel_multi_index(tuple(cell.T), count.shape))
        quad = np.column_stack(around)
        quads.append(np.where((first[here] < 0)[:, None], quad, quad[:, ::-1]))
    used = count > 0
    number = np.cumsum(used.ravel()) - 1
    return total[used] / count[used][:, None], number[np.concatenate(quads)].tolist()


# Things ---------------------------------------------------------------------------------------------------------------


def surface(name, emissivity, specular=0.0, roughness=0.0, colour=(0.5, 0.5, 0.5), fresnel=False):
    """A material. emissivity: a number, points over wavelength, or a name in the library. colour: in Solid mode.

    fresnel: whether the mirrored share follows Fresnel's law.
    """
    material = bpy.data.materials.new(name)
    if isinstance(emissivity, float):
        add_custom_property(material, "emissivity", emissivity)
    else:
        material["emissivity"] = emissivity
    add_custom_property(material, "specular", specular)
    add_custom_property(material, "roughness", roughness)
    if fresnel:
        add_custom_property(material, "fresnel", True)
    material.diffuse_color = (*colour, 1.0)
    return material


def gas(name, colour=(0.8, 0.8, 0.85), **properties):
    """A material that fills closed meshes. properties: see `fill`."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*colour, 0.3)
    fill(material, **properties)
    return material


def fill(block, **properties):
    """Make a material or the world a gas: absorption, scattering (1/m, numbers or points over wavelength), gas, ..."""
    for key, value in properties.items():
        if isinstance(value, float):
            add_custom_property(block, key, value)
        else:
            block[key] = value


def add(name, shape, material, temperature, location=(0, 0, 0), rotation=(0, 0, 0), bevel=0.0):
    """An object of a shape, shaded smooth where it is round.

    temperature: K, one for all, or one for each vertex. bevel: m, how round edges are.
    """
    vertices, faces = shape
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((np.round(vertices * PER_METRE) / PER_METRE).tolist(), [], faces)
    mesh.materials.append(material)
    shade_smooth(mesh, keep_flat=not bevel)
    thing = link(name, mesh)
    thing.location, thing.rotation_euler = location, rotation
    if np.ndim(temperature):
        painted = mesh.attributes.new("temperature", "FLOAT", "POINT")
        painted.data.foreach_set("value", (np.round(temperature * PER_KELVIN) / PER_KELVIN).astype(np.float32))
    else:
        add_custom_property(thing, "temperature", temperature)
    if bevel:
        modifier = thing.modifiers.new("Bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 3
        modifier.harden_normals = True  # the bevel is shaded round, the faces beside it stay flat
    return thing


def shade_smooth(mesh, sharp=SHARP, keep_flat=True):
    """Shade a mesh smooth but for edges between faces at a larger angle than `sharp`, rad.

    keep_flat: if that changes nothing, as on boxes and walls, the mesh stays flat, which renders faster.
    """
    mesh.shade_smooth()
    mesh.set_sharp_from_angle(angle=sharp)
    if keep_flat and not _is_round(mesh):
        mesh.shade_flat()


def _is_round(mesh):
    """Whether some corner's normal is not that of its face."""
    corners, faces = np.empty((len(mesh.loops), 3), np.float32), np.empty((len(mesh.polygons), 3), np.float32)
    mesh.corner_normals.foreach_get("vector", corners.ravel())
    mesh.polygons.foreach_get("normal", faces.ravel())
    sizes = np.empty(len(faces), np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    return bool(np.abs(corners - np.repeat(faces, sizes, axis=0)).max() > 1e-3)  # rounded vertices tilt by less


def new_image(name, values, is_float=True):
    """An image that is stored in the file. values: (height, width), row 0 at the bottom; K, or 0 to 1 for bytes."""
    height, width = values.shape
    values = np.round(values * PER_KELVIN) / PER_KELVIN
    image = bpy.data.images.new(name, width, height, float_buffer=is_float, is_data=True)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[..., None]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def lay_on(mesh, uv):
    """Give a mesh a UV map: (n, 2), where each vertex lies in an image."""
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uv[corners].astype(np.float32).ravel())


def link(name, data):
    """A new object in the scene."""
    new = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(new)
    return new


def add_camera(location, target, lens):
    """The scene's camera at a place, looking at another. lens: focal length in mm on Blender's 36 mm sensor."""
    camera = link("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.data.lens = location, lens
    camera.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = camera
    return camera


# The scene ------------------------------------------------------------------------------------------------------------


def add_sky(name, temperature):
    """The world: what rays that leave the scene see, in K."""
    world = bpy.data.worlds.new(name)
    add_custom_property(world, "temperature", temperature)
    bpy.context.scene.world = world
    return world


def add_clear_sky(name, air, humidity):
    """A world with the clear sky of a weather, by zenith angle and wavelength. air: K. humidity: percent."""
    world = add_sky(name, air)
    bpy.ops.infrared.clear_sky(air=air, humidity=humidity, replace=True)
    table = world["temperature_table"].to_dict()
    for key, steps in (("wavelength", PER_METRE), ("kelvin", PER_KELVIN)):
        table[key] = (np.round(np.array(table[key]) * steps) / steps).tolist()
    world["temperature_table"] = table
    return world


def choose_settings(bands, palette, temperatures, passes=64, target_noise=0.0, time_limit=60.0, percentage=100):
    """The engine, a picture of 640 x 480 pixels (or a percentage of that) in true colours, and when to stop.

    bands: shortest and longest wavelength in um and the number of bands, or their edges as a text, um between commas.
    temperatures: the ends of the palette, K. passes: at most; slow machines stop after time_limit (s). target_noise: K,
    0 for none, which few passes do not look at.
    """
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 480, percentage
    scene.render.filepath = "//render/"
    scene.unit_settings.temperature_unit = "CELSIUS"
    scene.view_settings.view_transform = "Standard"  # shows the thermal palette as it is
    infrared = scene.infrared
    if isinstance(bands, str):
        infrared.band_mode, infrared.band_edges = "CUSTOM", bands
    else:
        infrared.band_mode = "UNIFORM"
        infrared.wavelength_min, infrared.wavelength_max, infrared.band_count = bands
    infrared.palette = palette
    infrared.range_mode = "FIXED"
    infrared.range_low, infrared.range_high = temperatures
    infrared.photons_per_pass = 100_000
    infrared.passes, infrared.target_noise, infrared.time_limit = passes, target_noise, time_limit


def forget_folders():
    """Blender's start-up file holds a file browser at the user's home, which is nobody else's business."""
    for screen in bpy.data.screens:
        for space in (space for area in screen.areas for space in area.spaces):
            if space.type == "FILE_BROWSER" and space.params:
                space.params.directory = b"//"


def save(build: Callable, path: Path, empty: bool = True) -> None:
    """Build a scene in an empty file, or in Blender's start-up file, and save it.

    Use bpy 4.5, so that every supported Blender can open the file.
    """
    bpy.ops.wm.read_factory_settings(use_empty=empty)
    addon.register()
    build()
    forget_folders()
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    addon.unregister()  # Blender 4.5 does not end with an engine
