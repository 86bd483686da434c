# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds per frame of an animation whose geometry stays the same, without and with Blender's Persistent Data.

python -m docs.tools.measure_persistent_data
"""

import tempfile
import time

import bpy

from docs.tools.blender import registered

FRAMES = 8


def build() -> int:
    """A warm sphere on a floor; the number of triangles."""
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 120, 100
    scene.infrared.passes, scene.infrared.photons_per_pass, scene.infrared.default_emissivity = 1, 20_000, 0.7
    bpy.ops.mesh.primitive_plane_add(size=10.0)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=320, ring_count=160, location=(0.0, 0.0, 1.5))
    sphere = bpy.context.object
    for frame in range(1, FRAMES + 1):
        sphere["temperature"] = 300.0 + 2.0 * frame
        sphere.keyframe_insert('["temperature"]', frame=frame)
    bpy.ops.object.camera_add(location=(0.0, -8.0, 2.0), rotation=(1.5, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.frame_start, scene.frame_end = 1, FRAMES
    for obj in bpy.data.objects:
        if obj.type == "MESH":
            obj.data.calc_loop_triangles()
    return sum(len(mesh.loop_triangles) for mesh in bpy.data.meshes)


def seconds_per_frame(persistent: bool, folder: str) -> float:
    bpy.context.scene.render.use_persistent_data = persistent
    bpy.context.scene.render.filepath = f"{folder}/"
    begin = time.perf_counter()
    bpy.ops.render.render(animation=True)
    return (time.perf_counter() - begin) / FRAMES


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with registered(), tempfile.TemporaryDirectory() as folder:
        triangles = build()
        bpy.ops.render.render()  # compiles the kernels
        without, kept = (seconds_per_frame(persistent, folder) for persistent in (False, True))
    print(
        f"{triangles} triangles: {without:.2f} s a frame, with Persistent Data {kept:.2f} s, {without / kept:.2f} times"
    )


if __name__ == "__main__":
    main()
