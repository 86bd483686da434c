# SPDX-License-Identifier: GPL-3.0-or-later
"""Infrared Photons: a Blender render engine for thermal infrared."""

from __future__ import annotations

import atexit
import logging
import os
from pathlib import Path

log = logging.getLogger(__name__)

DATA_FOLDER = "infrared_photons"  # among Blender's data files of the user
MATERIALS = "my_materials.csv"

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
    """Let the solver keep compiled kernels in the extension's own folder, which survives updates and is writable, and
    the artist's materials where they survive the extension, too.

    Without an extension (the add-on as a Python package) kernels stay beside the sources, and there are no such
    materials unless the environment names their file.
    """
    import bpy

    try:
        kernels = bpy.utils.extension_path_user(__package__, path="kernels", create=True)
        earlier = Path(bpy.utils.extension_path_user(__package__, path="library")) / MATERIALS
    except (ValueError, OSError):
        return
    # The solver reads these; to tell it by importing it would load numba.
    names = ("INFRARED_PHOTONS_KERNELS", "INFRARED_PHOTONS_LIBRARY")
    _environment.update({name: os.environ.get(name) for name in names})
    os.environ["INFRARED_PHOTONS_KERNELS"] = kernels
    os.environ.setdefault("INFRARED_PHOTONS_LIBRARY", str(_own_materials(earlier)))


def _own_materials(earlier: Path) -> Path:
    """The file of the artist's materials: Blender deletes the extension's own folder with it, but no data files.

    earlier: the file in the extension's own folder, where it used to be. It is copied once, and serves itself where
    that fails. The folder is made when there is something to keep in it.
    """
    import bpy

    from .solver.physics.library import copy_once

    folder = bpy.utils.user_resource("DATAFILES", path=DATA_FOLDER)
    if not folder:
        return earlier
    path = Path(folder) / MATERIALS
    try:
        copy_once(earlier, path)
    except OSError as error:
        log.warning("My materials stay where removing the extension deletes them, in '%s': %s", earlier, error)
        return earlier
    return path


def _modules():
    from . import commands, engine, measure_settings, preferences, properties
    from .rendering import frame_tools
    from .ui import (
        band_presets,
        checks,
        export_report,
        kernels,
        object_panel,
        operators,
        panels,
        render_end,
        sensor_image,
        sensor_panel,
    )
    from .ui.gases import gas_panels
    from .ui.materials import curve_points, curve_previews, material_assets, material_library, mix, thermal_from_shaders
    from .ui.measuring import tool_operators, tool_panels, workspace_tools
    from .ui.temperatures import (
        bar_gizmo,
        clear_sky,
        heat_display,
        heat_map,
        surface_image,
        temperature_groups,
        temperature_series,
        temperature_tools,
    )

    return (
        measure_settings,
        properties,
        operators,
        sensor_image,
        temperature_tools,
        surface_image,
        temperature_series,
        clear_sky,
        heat_map,
        curve_previews,
        material_library,
        material_assets,
        mix,
        thermal_from_shaders,
        panels,
        gas_panels,
        sensor_panel,
        temperature_groups,
        curve_points,
        band_presets,
        checks,
        heat_display,
        bar_gizmo,
        tool_operators,
        tool_panels,
        workspace_tools,
        object_panel,
        export_report,
        frame_tools,
        kernels,
        render_end,
        preferences,
        engine,
        commands,
    )
