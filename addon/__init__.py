# SPDX-License-Identifier: GPL-3.0-or-later
"""Infrared Photons: a Blender render engine for thermal infrared."""

from __future__ import annotations

import atexit
import os

_environment = {}  # variables that the solver reads, as they were before: name -> value or None


def register():
    """Make the engine, its settings and its panels known to Blender; the solver is loaded by the first render."""
    import bpy  # here, so that `addon.solver` is usable without Blender

    _use_own_folder()
    for module in _modules():
        module.register()
    if bpy.app.module:  # as a Python module, Blender 4.5 hangs at exit while an engine class is registered
        atexit.register(unregister)


def unregister():
    """Take everything back that register made known."""
    atexit.unregister(unregister)
    for module in reversed(_modules()):
        module.unregister()
    for name, value in _environment.items():
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value
    _environment.clear()


def _use_own_folder():
    """Let the solver keep compiled kernels, and the artist's materials, in the extension's own folder, which survives
    updates and is writable.

    Without an extension (the add-on as a Python package) kernels stay beside the sources, and there are no such
    materials unless the environment names their file.
    """
    import bpy

    try:
        kernels = bpy.utils.extension_path_user(__package__, path="kernels", create=True)
        library = bpy.utils.extension_path_user(__package__, path="library", create=True)
    except (ValueError, OSError):
        return
    # The solver reads these; to tell it by importing it would load numba.
    names = ("INFRARED_PHOTONS_KERNELS", "INFRARED_PHOTONS_LIBRARY")
    _environment.update({name: os.environ.get(name) for name in names})
    os.environ["INFRARED_PHOTONS_KERNELS"] = kernels
    os.environ.setdefault("INFRARED_PHOTONS_LIBRARY", os.path.join(library, "my_materials.csv"))


def _modules():
    from . import engine, preferences, properties
    from .ui import band_presets, checks, operators, panels, sensor_image, sensor_panel
    from .ui.materials import curve_points, curve_previews, material_assets, material_library
    from .ui.temperatures import heat_display, heat_map, temperature_groups, temperature_tools

    return (
        properties,
        operators,
        sensor_image,
        temperature_tools,
        heat_map,
        curve_previews,
        material_library,
        material_assets,
        panels,
        sensor_panel,
        temperature_groups,
        curve_points,
        band_presets,
        checks,
        heat_display,
        preferences,
        engine,
    )
