# SPDX-License-Identifier: GPL-3.0-or-later
"""The measuring tools in the toolbar of the Image Editor, among Blender's own."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.types import WorkSpaceTool

from ...measure_settings import KIND_ITEMS

ICONS = Path(__file__).parent / "icons"
_REMOVE = (("infrared.tool_remove", {"type": key, "value": "PRESS"}, None) for key in ("X", "DEL"))
_KEYS = tuple(_REMOVE)


def tool_id(kind: str) -> str:
    """Blender's name of the toolbar's tool of a kind."""
    return f"infrared.measure_{kind.lower()}"


def _tool(kind: str, label: str, description: str) -> type[WorkSpaceTool]:
    """The class of the toolbar's tool of a kind."""
    draw = ("infrared.tool_draw", {"type": "LEFTMOUSE", "value": "PRESS"}, {"properties": [("kind", kind)]})
    how = "Click for each corner; Enter, or a click on the first, ends it" if kind == "POLYGON" else "Drag"
    how = "Click" if kind == "SPOT" else how
    return type(
        f"INFRARED_WT_{kind.lower()}",
        (WorkSpaceTool,),
        {
            "__module__": __name__,
            "bl_space_type": "IMAGE_EDITOR",
            "bl_context_mode": "VIEW",
            "bl_idname": tool_id(kind),
            "bl_label": f"Measure {label}",
            "bl_description": f"{description}.\n{how} in a finished render; drag a tool that is there to move it, X "
            "removes the chosen one",
            "bl_icon": str(ICONS / f"measure_{kind.lower()}"),
            "bl_cursor": "CROSSHAIR",
            "bl_keymap": (draw, *_KEYS),
        },
    )


TOOLS = tuple(_tool(kind, label, description) for kind, label, description, _, _ in KIND_ITEMS)


def register():
    for index, tool in enumerate(TOOLS):
        after = {TOOLS[index - 1].bl_idname} if index else None
        bpy.utils.register_tool(tool, after=after, separator=not index)


def unregister():
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
