# SPDX-License-Identifier: GPL-3.0-or-later
"""Infrared Photons: a Blender render engine for thermal infrared."""

from __future__ import annotations

import atexit


def register():
    """Make the engine, its settings and its panels known to Blender; the solver is loaded by the first render."""
    for module in _modules():
        module.register()
    atexit.register(unregister)  # as a Python module, Blender 4.5 hangs at exit while an engine class is registered


def unregister():
    """Take everything back that register made known."""
    atexit.unregister(unregister)
    for module in reversed(_modules()):
        module.unregister()


def _modules():
    from . import engine, operators, panels, properties  # here, so that `addon.solver` is usable without Blender

    return properties, operators, panels, engine
