# SPDX-License-Identifier: GPL-3.0-or-later
"""What an Image Editor says after a render: how many passes it has, and what noise, or why it failed.

Blender forgets the status of a render at its end. This stands at the right end of the line of text that it writes over
the picture then.
"""

from __future__ import annotations

import blf
import bpy

from ..interface import ENGINE
from ..rendering.last_render import finished_frames, last_ends, last_failures
from .temperatures.bar import margins

FONT, SIZE = 0, 11.0  # Blender's own, and its size in pixels at a scale of 1
FROM_TOP, FROM_RIGHT = 14, 44  # pixels at a scale of 1, of the text's lower right corner: beside the gizmos

_handler = None


def end_of_render(space, scene) -> str:
    """How the render in an Image Editor ended, or why it failed; an empty text if it shows something else."""
    image, frames = space.image, list(finished_frames.values())  # another render may begin meanwhile
    if image is None or image.type != "RENDER_RESULT" or scene.render.engine != ENGINE:
        return ""
    if failure := last_failures.get(scene.name):
        return failure
    if not frames or (frames[0].scene, frames[0].slot) != (scene.name, image.render_slots.active_index):
        return ""
    ends = dict(last_ends)
    return next(iter(ends.values())) if len(ends) == 1 else "; ".join(f"{name}: {end}" for name, end in ends.items())


def draw_end() -> None:
    """Draw it, unless a render goes on, of which Blender tells the status."""
    context = bpy.context
    text = end_of_render(context.space_data, context.scene)
    if not text or bpy.app.is_job_running("RENDER"):
        return
    scale, region, taken = context.preferences.system.ui_scale, context.region, margins(context.area)
    blf.size(FONT, SIZE * scale)
    left = region.width - taken.right - FROM_RIGHT * scale - blf.dimensions(FONT, text)[0]
    blf.position(FONT, max(left, taken.left + FROM_TOP * scale), region.height - taken.top - FROM_TOP * scale, 0)
    blf.enable(FONT, blf.SHADOW)
    blf.shadow(FONT, 3, 0.0, 0.0, 0.0, 1.0)
    blf.color(FONT, 1.0, 1.0, 1.0, 1.0)
    blf.draw(FONT, text)
    blf.disable(FONT, blf.SHADOW)


def register():
    global _handler
    _handler = bpy.types.SpaceImageEditor.draw_handler_add(draw_end, (), "WINDOW", "POST_PIXEL")


def unregister():
    bpy.types.SpaceImageEditor.draw_handler_remove(_handler, "WINDOW")
