# SPDX-License-Identifier: GPL-3.0-or-later
"""What the header of an Image Editor says after a render: how many passes it has, and what noise, or why it failed.
Blender forgets the status of a render at its end.
"""

from __future__ import annotations

import bpy

from ..interface import ENGINE
from ..rendering.last_render import finished_frames, last_ends, last_failures


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


def draw_end(self, context) -> None:
    """Draw it, unless a render goes on, of which Blender tells the status."""
    text = end_of_render(context.space_data, context.scene)
    if text and not bpy.app.is_job_running("RENDER"):
        self.layout.label(text=text)


def register():
    bpy.types.IMAGE_HT_header.append(draw_end)


def unregister():
    bpy.types.IMAGE_HT_header.remove(draw_end)
