# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiling in the background, as the artist sees it: it begins by itself, the status bar tells how far it is, and a
click ends it.
"""

from __future__ import annotations

import atexit
import logging
import os

import bpy
from bpy.types import Operator

from ..compiling.compilation import Compilation, are_kept, is_complete, python
from ..interface import redraw

log = logging.getLogger(__name__)

BEGIN = 1.0  # s after Blender's start, when its window is there
LOOK = 0.5  # s between two looks at how far it is
EXTENSION = __package__.rpartition(".")[0]

_compilation: Compilation | None = None  # the last one


class INFRARED_OT_compile_kernels(Operator):
    """Compile the engine's inner loops in the background, so that no render has to wait for it"""

    bl_idname = "infrared.compile_kernels"
    bl_label = "Compile Now"

    @classmethod
    def poll(cls, _context):
        return not is_compiling() and bool(python())

    def execute(self, _context):
        if problem := begin():
            self.report({"ERROR"}, problem)
            return {"CANCELLED"}
        return {"FINISHED"}


class INFRARED_OT_cancel_compiling(Operator):
    """End compiling. The next start of Blender goes on with it; until then renders compile what they need"""

    bl_idname = "infrared.cancel_compiling"
    bl_label = "Cancel Compiling"

    @classmethod
    def poll(cls, _context):
        return is_compiling()

    def execute(self, _context):
        _compilation.cancel()
        return {"FINISHED"}


def is_compiling() -> bool:
    """Whether kernels are compiled in the background."""
    return _compilation is not None and _compilation.is_running()


def begin() -> str:
    """Begin to compile all kernels; returns why that was not possible, or an empty text."""
    global _compilation
    _compilation = Compilation()
    try:
        _compilation.start(bpy.app.python_args)
    except OSError as error:
        _compilation.problem = f"Python does not start: {error}"
        return _compilation.problem
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=LOOK, persistent=True)
    return ""


def end() -> None:
    """End what goes on in the background, and wait until nothing is written any more."""
    if _compilation is not None:
        _compilation.cancel()
        _compilation.wait()


def _look() -> float | None:
    """A timer: show how far it is, until it has ended."""
    _redraw()
    if is_compiling():
        return LOOK
    if _compilation.problem:
        log.warning("Compiling in the background failed: %s", _compilation.problem)
    return None


def _redraw() -> None:
    redraw("PREFERENCES")
    for window in bpy.context.window_manager.windows:
        # Nothing else has the status bar drawn again. A timer may run without a window, as after a file was opened, and
        # then Blender would crash.
        with bpy.context.temp_override(window=window):
            window.workspace.status_text_set_internal(None)


def _begin_by_itself() -> None:
    """A timer, once: begin, if the artist wants that and there is something to do."""
    entry = bpy.context.preferences.addons.get(EXTENSION)
    if not (entry and entry.preferences.compile_at_start) or is_compiling():
        return
    if python() and are_kept() and not is_complete():
        begin()


def draw_compiling(layout) -> None:
    """What the preferences show: how far it is, or a button to begin."""
    row = layout.row()
    if is_compiling():
        done, total = _compilation.done, _compilation.total
        row.progress(factor=done / total, text=f"Compiling kernels: {done} of {total}")
        row.operator("infrared.cancel_compiling", text="", icon="X")
        return
    if is_complete():
        row.label(text="All kernels are compiled", icon="CHECKMARK")
        return
    problem = _compilation.problem if _compilation else ""
    row.label(text=problem or "Kernels are compiled when a render needs them", icon="ERROR" if problem else "INFO")
    row.operator("infrared.compile_kernels")


def draw_status(self, _context) -> None:
    """In the status bar, while it goes on."""
    if is_compiling():
        row = self.layout.row(align=True)
        share = _compilation.done / _compilation.total
        row.label(text=f"Infrared Photons compiles its kernels: {share:.0%}", icon="SORTTIME")
        row.operator("infrared.cancel_compiling", text="", icon="X", emboss=False)


CLASSES = INFRARED_OT_compile_kernels, INFRARED_OT_cancel_compiling


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.STATUSBAR_HT_header.append(draw_status)
    atexit.register(end)
    if not (bpy.app.background or bpy.app.module) and "INFRARED_PHOTONS_KERNELS" in os.environ:
        bpy.app.timers.register(_begin_by_itself, first_interval=BEGIN, persistent=True)


def unregister():
    end()
    atexit.unregister(end)
    for timer in (_begin_by_itself, _look):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    bpy.types.STATUSBAR_HT_header.remove(draw_status)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
