# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: its version, and a button that checks the installation."""

from __future__ import annotations

import threading

import bpy
from bpy.types import AddonPreferences, Operator

from .interface import redraw
from .self_check import run_checks
from .version import version

_lines: list[tuple[str, str]] = []  # results of the last check, see run_checks


class INFRARED_OT_self_check(Operator):
    """Render a box whose image is known, and read a file back. The first time the engine's inner loops are compiled"""

    bl_idname = "infrared.self_check"
    bl_label = "Self-Test"

    _running: threading.Thread | None = None

    @classmethod
    def poll(cls, _context):
        return INFRARED_OT_self_check._running is None

    def execute(self, _context):
        """Without a window: wait for the result."""
        _check()
        return self._end()

    def invoke(self, context, _event):
        INFRARED_OT_self_check._running = threading.Thread(target=_check, name="Infrared Photons check", daemon=True)
        self._running.start()
        self._timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "TIMER" or self._running.is_alive():
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        redraw()
        return self._end()

    def _end(self):
        INFRARED_OT_self_check._running = None
        problems = [f"{what}: {problem}" for what, problem in _lines if problem]
        if problems:
            self.report({"ERROR"}, "Self-test failed. " + "; ".join(problems))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Self-test passed: {len(_lines)} checks")
        return {"FINISHED"}


def _check() -> None:
    _lines.clear()
    for line in run_checks():
        _lines.append(line)


class InfraredPreferences(AddonPreferences):
    """What Blender shows of the add-on in Edit > Preferences > Add-ons."""

    bl_idname = __package__

    def draw(self, _context):
        layout = self.layout
        layout.label(text=f"Infrared Photons {version()}")
        running = INFRARED_OT_self_check._running is not None
        layout.operator("infrared.self_check", text="Testing..." if running else "Self-Test", icon="CHECKMARK")
        for what, problem in _lines:
            layout.label(text=f"{what}: {problem}" if problem else what, icon="ERROR" if problem else "CHECKMARK")


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_self_check, InfraredPreferences))
