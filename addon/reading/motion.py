# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene that moves while its picture is taken: when a picture sees it, and the scene at these times.

Blender's thread goes from time to time and reads the whole scene at each: positions, shapes, cameras, temperatures and
all else that is keyed or driven. Then it goes back to the frame.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from ..solver.memory import check_memory
from ..solver.moments import bytes_of, moment_of, moment_times
from ..solver.scene import Moment, Scene, SceneError
from .camera import read_camera
from .scene_reader import read_contents, read_scene, render_reader
from .sensor import read_lag
from .surfaces import SurfaceReader

LAST_FRAME = 1_048_574  # of Blender, and the first one below 0


class Exposure(NamedTuple):
    """When a picture sees its scene, in frames. opened, closed: of the shutter. lag: time constant of the sensor.
    times: ascending, of equal weight; none if the picture is of one time, the middle."""

    opened: float
    closed: float
    lag: float
    times: tuple[float, ...]

    @property
    def middle(self) -> float:
        """The time by which everything is planned, and of which passes without light are."""
        return 0.5 * (self.opened + self.closed)


def read_exposure(scene) -> Exposure:
    """The Exposure of a scene's current frame. Raises SceneError if a value makes no sense."""
    render, infrared, frame = scene.render, scene.infrared, scene.frame_current_final
    opened = closed = frame
    if render.use_motion_blur:
        before = {"START": 0.0, "CENTER": 0.5, "END": 1.0}[render.motion_blur_position]
        opened = frame - before * render.motion_blur_shutter
        closed = opened + render.motion_blur_shutter
    lag = read_lag(infrared) * render.fps / render.fps_base
    moves = closed > opened or lag > 0.0
    times = moment_times(opened, closed, lag, infrared.motion_steps).tolist() if moves else ()
    if moves and not -LAST_FRAME <= times[0] <= times[-1] <= LAST_FRAME:
        raise SceneError(
            f"Motion blur: the picture sees frames from {times[0]:g} to {times[-1]:g}; Blender has none beyond "
            f"{LAST_FRAME:,}. Lower the shutter or the sensor's time constant"
        )
    return Exposure(opened, closed, lag, tuple(times))


class CancelledError(Exception):
    """Esc ended the reading of a scene."""


def read_moving_scene(engine, depsgraph) -> tuple[Scene, list[str], SurfaceReader]:
    """Everything that the depsgraph's view layer renders, at all times of the picture; warnings; and what read it as it
    is in the middle.

    engine: the RenderEngine, whose depsgraph goes from time to time, and in the end is back. Raises SceneError as
    read_scene does, and CancelledError.
    """
    exposure, frame = read_exposure(depsgraph.scene_eval), depsgraph.scene_eval.frame_current_final
    if not exposure.times:
        surfaces = render_reader(depsgraph)
        return *read_scene(depsgraph, engine.camera_override, surfaces), surfaces
    try:
        _go_to(engine, exposure.middle)
        surfaces = render_reader(depsgraph)
        scene, warnings = read_scene(depsgraph, engine.camera_override, surfaces)
        moments: list[Moment] = []
        for number, time in enumerate(exposure.times, 1):
            if engine.test_break():
                raise CancelledError
            engine.update_stats("", f"Reading the scene at time {number} of {len(exposure.times)}")
            _go_to(engine, time)
            try:
                moment, further = _read_moment(engine, depsgraph, scene, surfaces)
            except SceneError as error:
                raise SceneError(f"At frame {time:.6g}, which the picture sees too: {error}") from error
            moments.append(moment)
            warnings += [message for message in further if message not in warnings]
            if number == 1:  # those that follow will not differ from it much in size
                check_memory({"moments": len(exposure.times) * bytes_of(moment)})
    finally:
        _go_to(engine, frame)
    return replace(scene, moments=tuple(moments) if any(moments) else ()), warnings, surfaces


def _go_to(engine, time: float) -> None:
    """Evaluate the engine's depsgraph at a time, in frames."""
    engine.frame_set(math.floor(time), time - math.floor(time))


def _read_moment(engine, depsgraph, base: Scene, earlier: SurfaceReader) -> tuple[Moment, list[str]]:
    """What is otherwise than in a scene, as the depsgraph is now, and warnings. earlier: its reader."""
    surfaces = render_reader(depsgraph, earlier.textures.kept)
    contents = read_contents(depsgraph, surfaces)
    contents |= {"band_edges": base.band_edges, "response": base.response}  # those of the picture
    camera = read_camera(depsgraph, engine.camera_override or depsgraph.scene_eval.camera, surfaces.warnings)
    return moment_of(Scene(**contents, camera=camera), base), surfaces.warnings.messages()
