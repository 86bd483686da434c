# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender as a Python module, with the add-on from the source."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

import addon
from docs.tools.paths import DEMO


@contextmanager
def registered() -> Iterator[None]:
    """The add-on is registered for a while. It has to go in the end: Blender 4.5 does not end with a render engine."""
    addon.register()
    try:
        yield
    finally:
        addon.unregister()


def open_demo() -> bpy.types.Scene:
    """Open the demo's file; returns its scene."""
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    return bpy.context.scene
