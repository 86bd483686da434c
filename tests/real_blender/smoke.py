# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulate smoke and fire over a ball for some frames, read the domain, and tell where the gas is and how hot.

Arguments: 0 or 1, whether the domain adapts to the smoke, and a folder for the simulation.
"""

import sys

import bpy
import numpy as np

from addon.reading.volumes import VolumeReader
from addon.reading.warnings import Warnings
from tests.real_blender.facts import fact


def main() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(1.3, 2.2, 2.0))
    fluid = bpy.context.object.modifiers.new("Fluid", "FLUID")
    fluid.fluid_type = "FLOW"
    fluid.flow_settings.flow_type, fluid.flow_settings.flow_behavior = "BOTH", "INFLOW"
    bpy.ops.mesh.primitive_cube_add(size=4, location=(1.0, 2.0, 3.0))
    box = bpy.context.object
    box.scale = (1.0, 0.5, 1.0)
    fluid = box.modifiers.new("Fluid", "FLUID")
    fluid.fluid_type = "DOMAIN"
    settings = fluid.domain_settings
    settings.domain_type, settings.resolution_max, settings.cache_type = "GAS", 24, "REPLAY"
    settings.use_adaptive_domain, settings.cache_directory = sys.argv[1] == "1", sys.argv[2]
    for frame in range(1, 6):
        bpy.context.scene.frame_set(frame)
    paint = bpy.data.materials.new("Gas")
    paint["absorption"] = 1.0
    smoke = box.evaluated_get(bpy.context.evaluated_depsgraph_get())
    medium = VolumeReader(Warnings()).read_smoke(smoke, np.array(smoke.matrix_world), paint, 300.0, 1.0)
    leaf, *cell = np.nonzero(medium.grid.density > 0.3)
    where = (8 * medium.grid.leaves[leaf] + np.stack(cell, axis=1) + 0.5) @ medium.grid.matrix[:3, :3].T
    fact("centre", (where + medium.grid.matrix[:3, 3]).mean(axis=0).tolist())
    fact("hottest", float(medium.grid.temperature.max()))
    fact("coldest", float(medium.grid.temperature[medium.grid.density > 0.0].min()))


main()  # in a function: the simulation runs scripts that use the names of this module's own
