# SPDX-License-Identifier: GPL-3.0-or-later
"""What motion costs: processor time of passes at as many times against passes at one time, for scenes in which some
triangles move, and so all is prepared again for each pass; and how long it takes to read a scene at one time.

python -m tests.benchmarks.motion_cost [--scenes NAME ...] [--passes N] [--width PIXELS] [--triangles N]

Processor time, as other work on the machine does not count in it. A render of one pass without motion comes before and
does not count: it loads compiled code.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from addon.solver import Scene, Settings, render
from addon.solver.moments import moment_of, moment_times
from docs.tools.blender import registered
from docs.tools.pages import table
from tests.benchmarks.speed_scenes import SCENES

NAMES = ("room", "street", "office", "engine")
MOVING, WAY = 0.1, 0.05  # share of the triangles, the last ones, and how far they move along x, m


def in_motion(scene: Scene, count: int) -> Scene:
    """The scene with some of its triangles on their way, at count times."""
    vertices = np.unique(scene.triangles[-round(MOVING * len(scene.triangles)) :])
    moments = []
    for share in moment_times(-0.5, 0.5, 0.0, count):
        points = scene.vertices.copy()
        points[vertices, 0] += WAY * share
        moments.append(moment_of(replace(scene, vertices=points), scene))
    return replace(scene, moments=tuple(moments))


def cost(scene: Scene, settings: Settings) -> float:
    """Processor time of a render, s."""
    begin = time.process_time()
    render(scene, settings)
    return time.process_time() - begin


def table_of_scenes(names: Sequence[str], passes: int, width: int) -> None:
    settings, rows = Settings(passes=passes, threads=2), []
    for name in names:
        scene = SCENES[name]()
        scene = replace(scene, camera=replace(scene.camera, width=width, height=3 * width // 4))
        cost(in_motion(scene, 1), replace(settings, passes=1))
        still, moving = cost(scene, settings), cost(in_motion(scene, passes), settings)
        rows.append((name, f"{len(scene.triangles):,}", f"{still:.1f} s", f"{moving:.1f} s", f"{moving / still:.2f}"))
    print(f"{passes} passes, {width} x {3 * width // 4} pixels, processor time\n")
    print(table(("scene", "triangles", "sharp", "moving", "ratio"), *rows), flush=True)


def time_of_reading(triangles: int) -> float:
    """Seconds that one time of a scene with so many triangles, all of which move, takes to be read."""
    from addon.reading import motion

    side = round((triangles / 2) ** 0.5)
    scene, times = bpy.context.scene, []
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side)
    for frame, height in ((0, 0.0), (2, 1.0)):
        bpy.context.object.location[2] = height
        bpy.context.object.keyframe_insert("location", frame=frame)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.use_motion_blur, scene.infrared.motion_steps = True, 8

    class Reading(bpy.types.RenderEngine):
        bl_idname, bl_label = "INFRARED_READING", "Reading"

        def render(self, depsgraph):
            begin = time.perf_counter()
            motion.read_moving_scene(self, depsgraph)
            times.append((time.perf_counter() - begin) / (scene.infrared.motion_steps + 1))

    bpy.utils.register_class(Reading)
    scene.render.engine = "INFRARED_READING"
    bpy.ops.render.render()
    bpy.utils.unregister_class(Reading)
    return times[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=NAMES, choices=SCENES)
    parser.add_argument("--passes", type=int, default=16)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--triangles", type=int, default=100_000, help="of the scene that is read")
    options = parser.parse_args()
    table_of_scenes(options.scenes, options.passes, options.width)
    with registered():
        seconds = time_of_reading(options.triangles)
    print(f"\n{options.triangles:,} triangles that move are read in {seconds:.2g} s at each time")


if __name__ == "__main__":
    main()
