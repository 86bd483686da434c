# SPDX-License-Identifier: GPL-3.0-or-later
"""Infrared Photons: a Blender render engine for thermal infrared."""

from __future__ import annotations

import atexit
import os


def register():
    """Make the engine, its settings and its panels known to Blender; the solver is loaded by the first render."""
    import bpy  # here, so that `addon.solver` is usable without Blender

    _keep_kernels()
    for module in _modules():
        module.register()
    if bpy.app.module:  # as a Python module, Blender 4.5 hangs at exit while an engine class is registered
        atexit.register(unregister)


def unregister():
    """Take everything back that register made known."""
    atexit.unregister(unregister)
    for module in reversed(_modules()):
        module.unregister()


def _keep_kernels():
    """Let the solver keep compiled kernels in the extension's own folder, which survives updates and is writable.

    Without an extension (the add-on as a Python package) they stay beside the sources.
    """
    import bpy

    try:
        folder = bpy.utils.extension_path_user(__package__, path="kernels", create=True)
    except (ValueError, OSError):
        return
    os.environ["INFRARED_PHOTONS_KERNELS"] = folder  # solver.kernel_cache reads it; importing that would load numba


def _modules():
    from . import engine, operators, panels, properties

    return properties, operators, panels, engine
