# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: go on with a story, which says when it wants to be called again, and quit."""

import sys
import time
from collections.abc import Iterator

import bpy


def tell(story: Iterator[float]) -> None:
    """Go through a generator of pauses (s) in Blender's own thread, whatever files are loaded meanwhile; then quit."""

    def go_on():
        try:
            with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
                return next(story)
        except StopIteration:
            bpy.ops.wm.quit_blender()
        except Exception:
            sys.excepthook(*sys.exc_info())
            bpy.ops.wm.quit_blender()

    bpy.context.preferences.system.viewport_aa = "OFF"  # it draws everything eight times, on a software GPU
    bpy.app.timers.register(go_on, first_interval=2.0, persistent=True)
    if bpy.app.use_event_simulate:
        bpy.app.timers.register(rest, persistent=True)


def rest() -> float:
    """Sleep as Blender's main loop does when it has nothing to do, but not when events are simulated: then it spins,
    and takes processor and interpreter away from what renders. Returns when it wants to be called again: at once."""
    time.sleep(0.005)
    return 0.0
