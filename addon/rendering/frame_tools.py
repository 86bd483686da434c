# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept of each frame of an animation while it is rendered: what the measuring tools read, which is also written
to a CSV file, and a small picture for the report."""

from __future__ import annotations

import logging
import os
import re
from pathlib import Path

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..heat_settings import scene_unit
from ..measuring.table import ToolReading, write_table
from ..output.formats import without_extension
from .last_render import FinishedFrame
from .readings import finished_picture
from .reporting import tool_readings

log = logging.getLogger(__name__)

ENDING = "_tools.csv"
STRIP_WIDTH, STRIP_LENGTH = (
    160,
    48,
)  # most pixels of a small picture's width, and most pictures that are kept of a layer


class Strip:
    """Small pictures of an animation's frames, evenly spread over them: where there would be too many, every second one
    goes, and from then on only every second frame is kept.

    frames: number of the frame -> (h, w) float32 K, row 0 at the bottom.
    """

    def __init__(self):
        self.frames: dict[int, np.ndarray] = {}
        self._seen, self._step = 0, 1

    def add(self, frame: int, temperature: np.ndarray) -> None:
        """Keep a picture (h, w), K, if it is one frame's turn."""
        if self._seen % self._step == 0:
            self.frames[frame] = reduced(temperature)
        self._seen += 1
        if len(self.frames) > STRIP_LENGTH:
            self.frames = dict(list(self.frames.items())[::2])
            self._step *= 2


def reduced(temperature: np.ndarray) -> np.ndarray:
    """A picture (h, w), K, with at most STRIP_WIDTH columns: means of square blocks, without what remains at the upper
    and the right edge."""
    step = -(-temperature.shape[1] // STRIP_WIDTH)
    height, width = (max(1, size // step) for size in temperature.shape)
    step_up = min(step, temperature.shape[0])
    blocks = temperature[: height * step_up, : width * step].reshape(height, step_up, width, step)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


# Tools over the frames of the animation that is rendered, or was last: scene -> readings. A render in the background
# may change this at any time.
_over_frames: dict[str, list[ToolReading]] = {}
_strips: dict[str, dict[str, Strip]] = {}  # scene -> view layer -> its small pictures


def over_frames(scene) -> list[ToolReading]:
    """What the tools of a scene read in the last animation, by frame; empty without one."""
    return list(_over_frames.get(scene.name, ()))


def strips(scene) -> dict[str, dict[int, np.ndarray]]:
    """Small pictures of the frames of a scene's last animation, (h, w) K by view layer and frame; empty without one."""
    return {layer: dict(strip.frames) for layer, strip in _strips.get(scene.name, {}).items()}


def keep_frame(scene, layer: str, images: dict, frame: FinishedFrame) -> None:
    """Add a frame of an animation, and what the tools of a scene read in it. images: see final_render.layer_images."""
    infrared = scene.infrared
    _strips.setdefault(scene.name, {}).setdefault(layer, Strip()).add(scene.frame_current, images["temperature"])
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
    folder, name = os.path.split(bpy.path.abspath(without_extension(scene.infrared.band_exr_path)))
    name = re.sub("#+", "", name).rstrip("_-. ") or "infrared"
    return Path(folder) / f"{name}{ENDING}"


@persistent
def forget_frames(*_) -> None:
    """Another render begins, or another file is open."""
    _over_frames.clear()
    _strips.clear()


def register():
    bpy.app.handlers.render_init.append(forget_frames)
    bpy.app.handlers.load_post.append(forget_frames)


def unregister():
    bpy.app.handlers.load_post.remove(forget_frames)
    bpy.app.handlers.render_init.remove(forget_frames)
    forget_frames()
