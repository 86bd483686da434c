# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels show of the checks before a render: all of them in a panel of their own, and those of one property in the
panel of that property.
"""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable, Iterable

import bpy
from bpy.app.handlers import persistent
from bpy.types import Panel

from ..reading.world import layer_world, unset_surroundings
from ..rendering.checks import LEVELS, Check, object_checks, scene_checks
from ..rendering.last_render import last_warnings
from .panel_base import InfraredPanel

LISTED = 8  # messages of a level; more are counted
SLOW = 0.01  # s: what takes longer is not done each time that a panel is drawn

ICONS = {"ERROR": "ERROR", "WARNING": "QUESTION", "HINT": "INFO"}  # by level

_kept = {}  # what `kept` keeps until the next change: (scene, what, frame) -> result


def kept(scene, what: str, find: Callable):
    """The result of find(). If that takes long, it is kept until the scene changes.

    what: a name of the result that no other result of the scene has. While an animation plays, a frame is no change.
    """
    playing = bpy.context.screen is not None and bpy.context.screen.is_animation_playing
    key = scene.session_uid, what, None if playing else scene.frame_current
    if key in _kept:
        return _kept[key]
    begin = time.perf_counter()
    result = find()
    if time.perf_counter() - begin > SLOW:
        _kept[key] = result
    return result


@persistent
def forget(*_):
    """After an edit, another file or a step of undo."""
    _kept.clear()


class INFRARED_PT_checks(InfraredPanel, Panel):
    bl_label = "Checks"

    def draw(self, context):
        scene, layer = context.scene, context.view_layer
        self.layout.operator("infrared.thermal_from_shaders", text="Thermal from Shaders...", icon="SHADING_RENDERED")
        checks = kept(scene, f"checks of {layer.name}", lambda: scene_checks(scene, layer))
        for level in LEVELS:
            of_level = [check for check in checks if check.level == level]
            draw_checks(self.layout, of_level[:LISTED], context.region)
            if len(of_level) > LISTED:
                self.layout.label(text=f"and {len(of_level) - LISTED} more", icon=ICONS[level])
        unset = unset_surroundings(layer_world(scene, layer))
        if unset and layer_world(scene, layer):
            self.layout.operator("infrared.clear_sky", text="Clear Sky from Weather...", icon="WORLD")
        elif unset:
            self.layout.operator("world.new", text="New World", icon="WORLD")
        warned = new_warnings(last_warnings, checks)
        if warned:
            self.layout.label(text="The last render warned:")
            draw_checks(self.layout, [Check("WARNING", text) for text in warned], context.region)
        if not (checks or warned):
            self.layout.label(text="Nothing to report", icon="CHECKMARK")


def new_warnings(warnings: Iterable[str], checks: list[Check]) -> list[str]:
    """The warnings of a render that no check tells of. Renders name several objects in one warning, checks do not."""
    texts = [check.text for check in checks]
    told = [(warning, warning.rpartition("': ")[2]) for warning in warnings]
    return [warning for warning, what in told if not any(what in text or text in warning for text in texts)]


def draw_object_checks(layout, context) -> None:
    """The errors and warnings of the active object, if there is one."""
    obj, scene, layer = context.object, context.scene, context.view_layer
    if obj is not None:
        checks = kept(scene, f"checks of {obj.session_uid}", lambda: object_checks(obj, scene.infrared, layer))
        draw_problems(layout, checks, context.region)


def draw_problems(layout, checks: list[Check], region) -> None:
    """Draw errors and warnings only: the panel of a property itself says which default is used where nothing is set."""
    draw_checks(layout, [check for check in checks if check.level != "HINT"], region)


def draw_checks(layout, checks: list[Check], region) -> None:
    """Draw each as text that is wrapped to the region's width; hints are dimmed."""
    scale = bpy.context.preferences.system.ui_scale
    width = max(20, int(region.width / (7.0 * scale)) - 8)  # letters are about 7 pixels wide
    for check in checks:
        column = layout.column(align=True)
        column.scale_y = 0.8
        column.active = check.level != "HINT"
        for i, line in enumerate(textwrap.wrap(check.text, width)):
            column.label(text=line, icon="BLANK1" if i else ICONS[check.level])


HANDLERS = {
    "depsgraph_update_post": forget,
    "load_post": forget,
    "undo_post": forget,
    "redo_post": forget,
}


def register():
    bpy.utils.register_class(INFRARED_PT_checks)
    for event, handler in HANDLERS.items():
        getattr(bpy.app.handlers, event).append(handler)


def unregister():
    for event, handler in HANDLERS.items():
        getattr(bpy.app.handlers, event).remove(handler)
    bpy.utils.unregister_class(INFRARED_PT_checks)
    forget()
