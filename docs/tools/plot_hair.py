# SPDX-License-Identifier: GPL-3.0-or-later
"""Render images/hair.png: a head without and with hair, and fur and a point cloud. Needs Blender as a Python module.

python -m docs.tools.plot_hair
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
from PIL import Image

from docs.examples.modelling import choose_settings
from docs.tools.blender import registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import tiled, titled
from docs.tools.plot_examples import render
from tests.benchmarks.hair import build

WIDTH, PASSES = 320, 8


def fur_and_points() -> None:
    """A ball with particle hair of 296 K on a skin of 306 K, over drops of 300 K that geometry nodes lay out."""
    build(0, WIDTH)
    ball = next(obj for obj in bpy.data.objects if obj.get("temperature") == 307.0)
    skin = ball.data.attributes.new("temperature", "FLOAT", "POINT").data
    skin.foreach_set("value", [306.0] * len(skin))
    ball["temperature"] = 296.0  # of the hair; the attribute counts on the skin
    ball.modifiers.new("Fur", "PARTICLE_SYSTEM")
    fur = ball.particle_systems[0].settings
    fur.type, fur.count, fur.hair_length = "HAIR", 3000, 0.03
    fur.root_radius, fur.tip_radius, fur.radius_scale = 1.0, 0.2, 0.001
    fur.brownian_factor = 0.004
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=24, y_subdivisions=3, size=0.4, location=(0.0, 0.0, -0.15))
    drops = bpy.context.object
    drops["temperature"] = 300.0
    tree = bpy.data.node_groups.new("Drops", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given, points, made = (
        tree.nodes.new(name) for name in ("NodeGroupInput", "GeometryNodeMeshToPoints", "NodeGroupOutput")
    )
    points.inputs["Radius"].default_value = 0.006
    tree.links.new(given.outputs[0], points.inputs["Mesh"])
    tree.links.new(points.outputs[0], made.inputs[0])
    drops.modifiers.new("Drops", "NODES").node_group = tree


def main() -> None:
    parts = []
    scenes = (
        ("a head at 307 K", lambda: build(0, WIDTH)),
        ("with 100,000 hairs at 300 K", lambda: build(100_000, WIDTH)),
        ("particle hair and a point cloud", fur_and_points),
    )
    with registered(), tempfile.TemporaryDirectory() as folder:
        for title, make in scenes:
            make()
            choose_settings((7.5, 14.0, 4), "IRON", (292.0, 307.0), PASSES)
            bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = WIDTH, WIDTH * 3 // 4
            path = Path(folder) / f"{len(parts)}.png"
            render(path)
            with Image.open(path) as picture:
                parts.append(titled(picture.convert("RGB"), title))
    tiled(parts, 3).save(IMAGES / "hair.png", optimize=True)


if __name__ == "__main__":
    main()
