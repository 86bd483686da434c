# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: print a line of JSON, what it has of the extension and what the open scene asks for."""

import importlib.util
import json
import sys

import bpy

LIBRARIES = ("numba", "llvmlite", "embreex", "OpenEXR", "numpy")


def report():
    specs = {name: importlib.util.find_spec(name) for name in LIBRARIES}
    yield "python", f"{sys.version_info.major}.{sys.version_info.minor}"
    yield "engines", [getattr(engine, "bl_idname", None) for engine in bpy.types.RenderEngine.__subclasses__()]
    yield "libraries", {name: spec and spec.origin for name, spec in specs.items()}
    infrared = getattr(bpy.context.scene, "infrared", None)
    if infrared:
        world = bpy.context.scene.world
        bodies = [o.get("temperature", infrared.ambient_temperature) for o in bpy.data.objects if o.type != "LIGHT"]
        lights = [o.get("temperature", 5772.0) for o in bpy.data.objects if o.type == "LIGHT"]
        yield "band_mode", infrared.band_mode
        yield "bands", [infrared.wavelength_min, infrared.wavelength_max, infrared.band_count]
        yield "temperatures", [world.get("temperature", 0.0) if world else 0.0, *bodies, *lights]


print("REPORT", json.dumps(dict(report())))
