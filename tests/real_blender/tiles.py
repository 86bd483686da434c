# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: a wall of black tiles, one for each pixel of a render, whose temperatures are known."""

import bpy
import numpy as np

from tests.helpers.tiles import COLUMNS, HIGH, LOW, ROWS, kelvin


def make_scene():
    """A wall of tiles of 1 m, lower left corner at the origin, that an orthographic camera sees pixel by pixel."""
    scene = bpy.context.scene
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    x, y = np.meshgrid(np.arange(COLUMNS + 1.0), np.arange(ROWS + 1.0))
    corner = np.arange(ROWS)[:, None] * (COLUMNS + 1) + np.arange(COLUMNS)
    faces = np.stack((corner, corner + 1, corner + COLUMNS + 2, corner + COLUMNS + 1), axis=-1)
    mesh = bpy.data.meshes.new("Wall")
    mesh.from_pydata(np.stack((x, y, 0.0 * x), axis=-1).reshape(-1, 3).tolist(), [], faces.reshape(-1, 4).tolist())
    mesh.attributes.new("temperature", "FLOAT", "FACE").data.foreach_set("value", kelvin.ravel().astype(np.float32))
    black = bpy.data.materials.new("Black")
    black["emissivity"] = 1.0
    mesh.materials.append(black)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.show_passepartout = "ORTHO", COLUMNS, False
    for data in (mesh, camera):
        thing = bpy.data.objects.new(data.name, data)
        scene.collection.objects.link(thing)
    scene.camera = thing
    scene.camera.location = COLUMNS / 2, ROWS / 2, 10.0
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = COLUMNS, ROWS, 100
    scene.render.dither_intensity = 0.0
    bpy.ops.infrared.true_colours()
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count = 2, 1000, 2
    infrared.palette, infrared.range_mode, infrared.range_low, infrared.range_high = "RAINBOW", "FIXED", LOW, HIGH
    scene.update_tag()
