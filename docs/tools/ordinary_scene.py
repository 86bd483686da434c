# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene such as people make for visible light, for pictures of what *Thermal from Shaders...* makes of it.

Nothing in it knows of heat: Principled materials with textures, glass, a lamp, leaf cards, a sky and a sun.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

BALLS = (  # name and inputs of its material, in rows from the left, the nearest first
    ("Copper kettle", {"Base Color": (0.9, 0.45, 0.3), "Metallic": 1.0, "Roughness": 0.1}),
    ("Brushed_Aluminum", {"Base Color": (0.9, 0.9, 0.9), "Metallic": 1.0, "Roughness": 0.35}),
    ("CarPaint", {"Base Color": (0.6, 0.02, 0.02), "Metallic": 0.7, "Roughness": 0.4, "Coat Weight": 1.0}),
    ("Gold Paint", {"Base Color": (0.9, 0.6, 0.1), "Metallic": 1.0, "Roughness": 0.3}),
    ("Wine Glass", {"Transmission Weight": 1.0, "Roughness": 0.0}),
    ("Shiny plastic", {"Base Color": (0.02, 0.2, 0.6), "Roughness": 0.15}),
    ("Metal.001", {"Base Color": (0.6, 0.6, 0.65), "Metallic": 1.0, "Roughness": 0.2}),
    ("Cushion", {"Base Color": (0.25, 0.5, 0.2), "Roughness": 1.0}),
    ("Lampshade", {"Emission Color": (1.0, 0.8, 0.5), "Emission Strength": 3.0}),
)
A_ROW, APART, RADIUS = 5, 0.55, 0.24  # balls in a row; m between their middles; m
SUN, LENS = 3.0, 36.0  # W/m2, mm


def build() -> None:
    """Fill an empty scene."""
    for i, (name, inputs) in enumerate(BALLS):
        row, place = divmod(i, A_ROW)
        count = min(A_ROW, len(BALLS) - row * A_ROW)
        bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=RADIUS)
        ball = finish(name, shader(name, inputs), ((place - (count - 1) / 2) * APART, row * APART, RADIUS))
        ball.data.shade_smooth()
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    finish("Floor", textured("Concrete floor", "ShaderNodeTexNoise", 9.0), (0.0, 0.0, 0.0))
    bpy.ops.mesh.primitive_plane_add(size=1.0, rotation=(np.pi / 2, 0.0, 0.0))
    finish("Wall", textured("brick_wall", "ShaderNodeTexBrick", 5.0), (0.0, 1.2, 0.45), (3.6, 0.9, 1.0))
    add_leaves()
    add_light()
    add_camera((0.0, -2.7, 1.2), (0.0, 0.3, 0.4))


def shader(name: str, inputs: dict):
    """A material with a Principled BSDF whose inputs have these values."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    for key, value in inputs.items():
        shown = (*value, 1.0) if isinstance(value, tuple) else value
        material.node_tree.nodes["Principled BSDF"].inputs[key].default_value = shown
    return material


def textured(name: str, kind: str, scale: float):
    """A rough material whose colour is a texture."""
    material = shader(name, {"Roughness": 0.8})
    texture = material.node_tree.nodes.new(kind)
    texture.inputs["Scale"].default_value = scale
    principled = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(texture.outputs[0], principled.inputs["Base Color"])
    return material


def add_leaves() -> None:
    """Cards with the picture of a leaf, cut out by its alpha."""
    side = 64
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, side), np.linspace(-1.0, 1.0, side))
    pixels = np.dstack((0.1 + 0.1 * v, 0.4 + 0.1 * u, 0.05 + 0.0 * u, (np.abs(u) < 0.6 * (1.0 - v**2)) * 1.0))
    image = bpy.data.images.new("leaf", side, side, alpha=True)
    image.pixels.foreach_set(np.float32(pixels).ravel())
    image.pack()
    material = shader("leaf_card", {})
    tree, principled = material.node_tree, material.node_tree.nodes["Principled BSDF"]
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs["Color"], principled.inputs["Base Color"])
    tree.links.new(texture.outputs["Alpha"], principled.inputs["Alpha"])
    for i in range(3):
        bpy.ops.mesh.primitive_plane_add(size=0.4, rotation=(1.2, 0.0, 0.6 * i - 0.6))
        finish(f"Leaf {i}", material, (1.25 + 0.2 * (i - 1), 0.6, 0.25 + 0.12 * i))


def add_light() -> None:
    """A sun and a blue sky."""
    lamp = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    lamp.data.energy, lamp.rotation_euler = SUN, (0.7, 0.3, 0.4)
    bpy.context.scene.collection.objects.link(lamp)
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.4, 0.6, 0.9, 1.0)


def add_camera(place, target) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.data.lens = place, LENS
    camera.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera


def finish(name: str, material, place, scale=(1.0, 1.0, 1.0)):
    """Name, place and cover the object that was just added; returns it."""
    added = bpy.context.object
    added.name, added.location, added.scale = name, place, scale
    added.data.materials.append(material)
    return added
