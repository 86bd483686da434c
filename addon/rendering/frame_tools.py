# SPDX-License-Identifier: GPL-3.0-or-later
"""What measuring tools read in each frame of an animation while it is rendered: kept, and written to a CSV file."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from ..heat_settings import scene_unit
from ..measuring.table import ToolReading, write_table
from ..output.formats import without_extension
from .last_render import FinishedFrame
from .readings import finished_picture
from .reporting import tool_readings

log = logging.getLogger(__name__)

ENDING = "_tools.csv"

# Tools over the frames of the animation that is rendered, or was last: scene -> readings. A render in the background
# may change this at any time.
_over_frames: dict[str, list[ToolReading]] = {}


def over_frames(scene) -> list[ToolReading]:
    """What the tools of a scene read in the last animation, by frame; empty without one."""
    return list(_over_frames.get(scene.name, ()))


def keep_frame(scene, layer: str, images: dict, frame: FinishedFrame) -> None:
    """Add what the tools of a scene read in a frame of an animation. images: see final_render.layer_images."""
    infrared = scene.infrared
    if len(infrared.measuring_tools):
        picture = finished_picture(images, frame)
        read = tool_readings(infrared, layer, picture, scene.frame_current, values=False)
        _over_frames.setdefault(scene.name, []).extend(read)


def write_frames(scene) -> None:
    """Write the tools over the frames so far, beside the band images if these are written. Raises OSError."""
    read = over_frames(scene)
    if read and scene.infrared.band_exr_path:
        path = frames_path(scene)
        write_table(path, read, scene_unit(scene))
        log.info("%d readings of tools written to %s", len(read), path)


def frames_path(scene) -> Path:
    """The file of the tools over frames: the path of the band images without the number of a frame."""
    path = Path(bpy.path.abspath(without_extension(scene.infrared.band_exr_path)))
    name = re.sub("#+", "", path.name).rstrip("_-. ") or "infrared"
    return path.with_name(f"{name}{ENDING}")


@persistent
def forget_frames(*_) -> None:
    """Another render begins, or another file is open."""
    _over_frames.clear()


def register():
    bpy.app.handlers.render_init.append(forget_frames)
    bpy.app.handlers.load_post.append(forget_frames)


def unregister():
    bpy.app.handlers.load_post.remove(forget_frames)
    bpy.app.handlers.render_init.remove(forget_frames)
    forget_frames()
