# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: its version, compiling in the background, and a button that checks the installation."""

from __future__ import annotations

import sys
import threading

import bpy
from bpy.props import BoolProperty
from bpy.types import AddonPreferences, Operator

from .interface import redraw
from .rendering.self_check import CHECKS, run_checks
from .ui.kernels import draw_compiling
from .version import version

THREAD = "Infrared Photons check"

_lines: list[tuple[str, str]] = []  # results of the last check, see run_checks


class INFRARED_OT_self_check(Operator):
    """Render a box whose image is known, and read a file back. The first time the engine's inner loops are compiled"""

    bl_idname = "infrared.self_check"
    bl_label = "Self-Test"

    _thread: threading.Thread | None = None  # the last one; it goes on if its window closes or another file opens

    @classmethod
    def poll(cls, _context):
        return not is_running()

    def execute(self, _context):
        """Without a window: wait for the result."""
        _check()
        return self._end()

    def invoke(self, context, _event):
        INFRARED_OT_self_check._thread = thread = threading.Thread(target=_check, name=THREAD, daemon=True)
        thread.start()
        self._timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if is_running():
            redraw("PREFERENCES")
            return {"PASS_THROUGH"}
        self.cancel(context)
        redraw()
        return self._end()

    def cancel(self, context):
        """Nobody waits for the result any more; the preferences show it all the same."""
        context.window_manager.event_timer_remove(self._timer)

    def _end(self):
        problems = [f"{what}: {problem}" for what, problem in _lines if problem]
        if problems:
            self.report({"ERROR"}, "Self-test failed. " + "; ".join(problems))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Self-test passed: {len(_lines)} checks")
        return {"FINISHED"}


def is_running() -> bool:
    """Whether the check goes on in the background."""
    thread = INFRARED_OT_self_check._thread
    return thread is not None and thread.is_alive()


def _check() -> None:
    _lines.clear()
    for line in run_checks():
        _lines.append(line)


def _now() -> str:
    """What the check in the background is at."""
    watch = sys.modules.get(f"{__package__}.compiling.watch")  # once a render has loaded it
    compiling = watch.COMPILING if watch and watch.compiles_now() else ""
    return CHECKS[min(len(_lines), len(CHECKS) - 1)].__doc__ + compiling


class InfraredPreferences(AddonPreferences):
    """What Blender shows of the add-on in Edit > Preferences > Add-ons."""

    bl_idname = __package__

    compile_at_start: BoolProperty(
        name="Compile at Start",
        description="Compile the engine's inner loops in the background when Blender starts, unless they are compiled",
        default=True,
    )

    def draw(self, _context):
        layout = self.layout
        layout.label(text=f"Infrared Photons {version()}")
        layout.prop(self, "compile_at_start")
        draw_compiling(layout)
        if is_running():
            layout.progress(factor=len(_lines) / len(CHECKS), text=_now())
        else:
            layout.operator("infrared.self_check", icon="CHECKMARK")
        for what, problem in _lines:
            layout.label(text=f"{what}: {problem}" if problem else what, icon="ERROR" if problem else "CHECKMARK")


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_self_check, InfraredPreferences))
