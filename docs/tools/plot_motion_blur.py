# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/motion-blur.png: a warm ball that flies past a turning fan, sharp, with an open shutter, and as a slow
detector sees it. Needs Blender as a Python module.

python -m docs.tools.plot_motion_blur
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from docs.tools.blender import registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import labelled, tiled

WIDTH, HEIGHT, PASSES = 240, 160, 32
BALL, BLADES, WALL = 320.0, 303.0, 293.0  # K
SHOWN = (  # title, length of the shutter in frames (0 is none), time constant in ms
    ("Sharp, K", 0.0, 0.0),
    ("Shutter 0.5 frames, K", 0.5, 0.0),
    ("Time constant 12 ms, K", 0.0, 12.0),
)


def thing(name: str, kelvin: float, paint):
    """The object that was made last, with a temperature and a material."""
    obj = bpy.context.object
    obj.name, obj["temperature"] = name, kelvin
    obj.data.materials.append(paint)
    return obj


def keyed(obj, path: str, index: int, first: float, last: float) -> None:
    """Let a value run at one speed through the frames from 0 to 2."""
    for frame, value in ((0, first), (2, last)):
        getattr(obj, path)[index] = value
        obj.keyframe_insert(path, index=index, frame=frame)
    action = obj.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        curve.extrapolation = "LINEAR"
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def build() -> bpy.types.Scene:
    """The scene at frame 1: 25 frames a second, the fan turns 5 times a second, the ball flies at 20 m/s."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, paint = bpy.context.scene, bpy.data.materials.new("Paint")
    paint["emissivity"] = 0.92
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 2.0, 0.0), rotation=(math.pi / 2, 0.0, 0.0))
    thing("Wall", WALL, paint)
    bpy.ops.object.empty_add(location=(-0.9, 0.5, 0.0))
    hub = bpy.context.object
    for number in range(4):
        angle = number * math.pi / 2
        bpy.ops.mesh.primitive_cube_add(
            location=(0.6 * math.cos(angle), 0.0, 0.6 * math.sin(angle)), rotation=(0.0, -angle, 0.0)
        )
        blade = thing("Blade", BLADES, paint)
        blade.scale, blade.parent = (0.45, 0.02, 0.14), hub
    keyed(hub, "rotation_euler", 1, 0.0, 2 * math.tau * 5 / 25)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0.0, 0.0, 0.5))
    keyed(thing("Ball", BALL, paint), "location", 0, 0.9 - 20 / 25, 0.9 + 20 / 25)
    scene.world = bpy.data.worlds.new("World")
    scene.world["temperature"] = WALL
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -5.5, 0.0), (math.pi / 2, 0.0, 0.0)
    scene.render.engine, scene.render.fps = "INFRARED_PHOTONS", 25
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.infrared.passes, scene.infrared.photons_per_pass, scene.infrared.band_count = PASSES, 10_000, 4
    scene.frame_set(1)
    return scene


def main() -> None:
    from addon.rendering.last_render import finished_layers

    pictures = []
    with registered():
        scene = build()
        for title, shutter, lag in SHOWN:
            scene.render.use_motion_blur, scene.render.motion_blur_shutter = shutter > 0.0, shutter or 0.5
            scene.infrared.sensor_lag = lag
            bpy.ops.render.render()
            pictures.append(labelled(np.array(finished_layers["ViewLayer"]["temperature"])[::-1], title))
    tiled(pictures, len(pictures)).save(IMAGES / "motion-blur.png", optimize=True)


if __name__ == "__main__":
    main()
