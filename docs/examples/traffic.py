# SPDX-License-Identifier: GPL-3.0-or-later
"""Make traffic.blend: a street by day with people and cars, for data sets of pairs, 8.1 to 13.9 um.

    python -m docs.examples.traffic

traffic.json beside it says what a data set draws for each frame; see docs/pairs.md. Each person and each car is one
object with the custom property `category`.
"""

from __future__ import annotations

import bpy
import numpy as np

from addon.properties import add_custom_property
from docs.examples import car
from docs.examples.modelling import (
    FOLDER,
    PER_KELVIN,
    PER_METRE,
    add_camera,
    add_clear_sky,
    choose_settings,
    link,
    save,
    shade_smooth,
    surface,
)
from docs.examples.people import HANGING_ARM, HEAD, SKIN, STANDING_LEG, TRUNK, add_person, mirrored
from docs.examples.street import add_ground, add_houses, add_lamps

CLOTHES = 1
AIR = 278.0  # K
WALKING_LEG = [  # of the foot that is set down; the front is -y
    ((0.09, 0.01, 0.88), (0.1, -0.19, 0.50), 0.095, 0.062, 300.4, CLOTHES),
    ((0.1, -0.19, 0.50), (0.11, -0.29, 0.10), 0.064, 0.05, 299.6, CLOTHES),
    ((0.11, -0.29, 0.06), (0.12, -0.46, 0.06), 0.05, 0.038, 297.2, CLOTHES),
]
TRAILING_LEG = [
    ((-0.09, 0.01, 0.88), (-0.1, 0.08, 0.48), 0.095, 0.062, 300.4, CLOTHES),
    ((-0.1, 0.08, 0.48), (-0.11, 0.36, 0.17), 0.064, 0.05, 299.6, CLOTHES),
    ((-0.11, 0.37, 0.13), (-0.12, 0.27, 0.03), 0.05, 0.038, 297.2, CLOTHES),
]
SWINGING_ARM = [
    ((0.19, 0.01, 1.345), (0.24, 0.17, 1.12), 0.052, 0.042, 301.6, CLOTHES),
    ((0.24, 0.17, 1.12), (0.24, 0.13, 0.90), 0.04, 0.034, 301.0, CLOTHES),
    ((0.24, 0.12, 0.87), (0.235, 0.07, 0.79), 0.036, 0.026, 305.0, SKIN),
]
FORWARD_ARM = [
    ((-0.19, 0.01, 1.345), (-0.24, -0.07, 1.09), 0.052, 0.042, 301.6, CLOTHES),
    ((-0.24, -0.07, 1.09), (-0.22, -0.27, 0.96), 0.04, 0.034, 301.0, CLOTHES),
    ((-0.22, -0.29, 0.95), (-0.2, -0.37, 0.93), 0.036, 0.026, 305.0, SKIN),
]
COATS = ((0.35, 0.04, 0.04), (0.04, 0.08, 0.25), (0.3, 0.26, 0.2), (0.03, 0.12, 0.06), (0.05, 0.05, 0.05))
PAINTS = ((0.4, 0.02, 0.02), (0.05, 0.1, 0.3), (0.55, 0.55, 0.57), (0.03, 0.03, 0.03))
CARS = ((1.6, 19.0, -90), (1.6, 38.0, -90), (-1.6, 21.0, 90), (-1.6, 46.0, 90))  # m, m, degrees: x, y, turn
TOO_SMALL = "Fog lamps", "Joints", "Handles", "Dust shield"  # parts of the car for so small a picture
PEOPLE = (  # m, m, degrees: on both pavements, and two who cross the street before the cars
    (-4.4, 9.0, 0), (-4.6, 15.0, 180), (-4.3, 21.5, 0), (-4.6, 29.0, 180), (4.5, 11.5, 180), (4.3, 17.5, 0),
    (4.6, 27.0, 180), (-1.2, 7.5, 90), (1.6, 9.0, -90),
)  # fmt: skip


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    materials = {
        "skin": surface("Skin", "Skin, human", colour=(0.6, 0.35, 0.25)),
        "hair": surface("Hair", 0.97, colour=(0.05, 0.03, 0.02)),
        "brick": surface("Brick", "Brick, weathered", colour=(0.35, 0.14, 0.09)),
        "tiles": surface("Roof tiles", "Roof tile, ceramic", colour=(0.2, 0.08, 0.05)),
        "asphalt": surface("Asphalt", "Asphalt, road", colour=(0.06, 0.06, 0.065)),
        "paving": surface("Paving", "Concrete, weathered", colour=(0.33, 0.32, 0.3)),
        "zinc": surface("Zinc", "Steel, galvanised, heavily oxidised", 0.5, 0.3, (0.4, 0.4, 0.42)),
        "glass": surface("Glass", "Glass, window", 1.0, 0.0, (0.03, 0.04, 0.05), fresnel=True),
        "trim": surface("Trim", "Plastic, polycarbonate", colour=(0.02, 0.02, 0.02)),
        "rubber": surface("Rubber", "Silicone rubber (PDMS)", colour=(0.02, 0.02, 0.02)),
        "alloy": surface("Lacquered alloy", "Paint, lacquer on aluminium", 0.57, 0.1, (0.5, 0.5, 0.52), fresnel=True),
        "disc": surface("Brake disc", "Iron, weathered", colour=(0.15, 0.13, 0.12)),
    }
    materials["clothes"] = coats = [surface(f"Coat {i}", "Plastic, PET", colour=each) for i, each in enumerate(COATS)]
    materials["paint"] = paints = [
        surface(f"Car paint {i}", "Paint, lacquer on aluminium", 0.57, 0.04, each, fresnel=True)
        for i, each in enumerate(PAINTS)
    ]
    doors = surface("Door paint", "Paint, lacquer on aluminium", colour=(0.06, 0.09, 0.08))
    of_parts = materials | {"clothes": coats[0], "paint": doors}
    add_ground(of_parts)
    add_houses(of_parts)
    add_lamps(of_parts)
    add_people(of_parts, coats)
    add_cars(of_parts | {"paint": paints[0]}, paints)
    for material in bpy.data.materials:
        add_shader(material)
    add_clear_sky("Clear day", AIR, humidity=60.0).color = (0.35, 0.5, 0.8)
    add_sun()
    add_camera((-0.4, 0.0, 2.1), (0.1, 30.0, 1.6), lens=32.0)
    choose_settings((8.1, 13.9, 3), "WHITE_HOT", (268.15, 308.15), passes=4, time_limit=0.0)
    choose_data_set_settings()


def choose_data_set_settings() -> None:
    """A small thermal camera with its noise, and quick RGB pictures."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 256, 100
    scene.frame_end = 100
    infrared = scene.infrared
    infrared.use_detector, infrared.detector_pitch = True, 17.0
    infrared.detector_low, infrared.detector_high = 203.15, 403.15  # K, also of the sky
    infrared.photons_per_pass = 20_000
    scene.cycles.samples, scene.cycles.use_denoising = 24, True


def add_shader(material) -> None:
    """What Cycles shows of a material: its colour in Solid mode, the gloss of a thermal one with a mirrored share."""
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = material.diffuse_color
    shader.inputs["Roughness"].default_value = 0.15 if material.get("specular", 0.0) > 0.4 else 0.8


def add_sun() -> None:
    """The sun of the RGB pictures. A light of 0 K has no part in the thermal ones."""
    sun = link("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 3.0, np.radians(2.0)
    add_custom_property(sun, "temperature", 0.0)
    sun.rotation_euler = np.radians((50, 12, 25))


# People and cars ------------------------------------------------------------------------------------------------------


def add_people(materials, coats) -> None:
    """Three bodies, each at several places with a coat of another colour."""
    standing = HEAD + TRUNK + STANDING_LEG + mirrored(STANDING_LEG) + HANGING_ARM + mirrored(HANGING_ARM)
    walking = HEAD + TRUNK + WALKING_LEG + TRAILING_LEG + SWINGING_ARM + FORWARD_ARM
    bodies = [body(materials, cones) for cones in (walking, mirrored(walking), standing)]
    for number, (x, y, turn) in enumerate(PEOPLE):
        person = link(f"Person {number}", bodies[number % 3])
        put(person, "person", (x, y, 0.0 if abs(x) > 3 else -0.12), turn)
        person.material_slots[CLOTHES].link = "OBJECT"
        person.material_slots[CLOTHES].material = coats[number % len(coats)]


def body(materials, cones):
    """The mesh of a person dressed for a cold day."""
    person = add_person("Person", cones, materials, (0, 0, 0), 0.0)
    mesh = person.data
    bpy.data.objects.remove(person)
    painted = mesh.attributes["temperature"].data
    kelvin = np.empty(len(painted), np.float32)
    painted.foreach_get("value", kelvin)
    painted.foreach_set("value", np.where(kelvin < 303, kelvin - 14, kelvin - 2))  # coats are colder than in a room
    return mesh


def put(thing, category, location, turn) -> None:
    """Place an object of a category. turn: degrees."""
    thing["category"] = category
    thing.location, thing.rotation_euler = location, (0, 0, np.radians(turn))


def add_cars(materials, paints) -> None:
    """The car of car.blend as one mesh, at several places in several colours."""
    before = list(bpy.data.objects)
    car.add_body(materials)
    car.add_cabin(materials)
    car.add_details(materials)
    for x in car.WHEELS:
        for side in (-1, 1):
            car.add_wheel(materials, x, side)
    parts = [each for each in bpy.data.objects if each not in before]
    mesh = as_one_mesh("Car", [each for each in parts if not each.name.startswith(TOO_SMALL)])
    for each in parts:
        bpy.data.objects.remove(each)
    slot = list(mesh.materials).index(paints[0])
    for number, (x, y, turn) in enumerate(CARS):
        vehicle = link(f"Car {number}", mesh)
        put(vehicle, "car", (x, y, -0.12), turn)
        vehicle.material_slots[slot].link = "OBJECT"
        vehicle.material_slots[slot].material = paints[number % len(paints)]


def as_one_mesh(name, parts):
    """One mesh of several objects, with the temperatures of all of them at its vertices."""
    bpy.context.view_layer.update()
    vertices, faces, kelvin, slots, materials = [], [], [], [], []
    for part in parts:
        shape = part.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        first, matrix = sum(map(len, vertices)), np.array(part.matrix_world)
        at = np.array([vertex.co for vertex in shape.vertices])
        kelvin.append(temperatures(part, shape, at))
        vertices.append(at @ matrix[:3, :3].T + matrix[:3, 3])
        for face in shape.polygons:
            faces.append([first + corner for corner in face.vertices])
            material = part.material_slots[face.material_index].material
            if material not in materials:
                materials.append(material)
            slots.append(materials.index(material))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((np.round(np.concatenate(vertices) * PER_METRE) / PER_METRE).tolist(), [], faces)
    for material in materials:
        mesh.materials.append(material)
    mesh.polygons.foreach_set("material_index", np.array(slots, np.int32))
    painted = mesh.attributes.new("temperature", "FLOAT", "POINT")
    painted.data.foreach_set("value", (np.round(np.concatenate(kelvin) * PER_KELVIN) / PER_KELVIN).astype(np.float32))
    shade_smooth(mesh)
    return mesh


def temperatures(part, shape, at):
    """(n,) K at the vertices (n, 3) of a part of car.blend: of its image, its mesh or its own."""
    if "temperature_image" in part:
        image = car.body_temperatures()
        row, column = ((car.body_uv(at)[:, ::-1] * image.shape).astype(int).clip(0, np.array(image.shape) - 1)).T
        return image[row, column]
    painted = shape.attributes.get("temperature")
    if painted is None:
        return np.full(len(at), part["temperature"])
    return np.array([each.value for each in painted.data])


if __name__ == "__main__":
    save(build, FOLDER / "traffic.blend")
