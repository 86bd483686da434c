# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene that moves while its picture is taken: when a picture sees it, and the scene at these times.

Blender's thread goes from time to time and reads the whole scene at each: positions, shapes, cameras, temperatures and
all else that is keyed or driven. Then it goes back to the frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import NamedTuple

import bpy

from ..solver.memory import check_memory
from ..solver.moments import bytes_of, moment_of, moment_times
from ..solver.scene import Camera, Moment, Scene, SceneError
from .scene_reader import read_contents, read_scene, render_reader
from .sensor import read_lag
from .surfaces import SurfaceReader
from .views import NO_VIEWS, read_view_camera, view_cameras
from .warnings import Warnings

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
    render, infrared, frame = scene.render, scene.infrared, _frame_of(scene)
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


def _frame_of(scene) -> float:
    """A scene's current frame, with its subframe, as the timeline counts. Blender's frame_current_final is that by Time
    Stretching, and would be stretched again wherever a frame is set."""
    return scene.frame_current + scene.frame_subframe


class CancelledError(Exception):
    """Esc ended the reading of a scene."""


def read_moving_scene(
    engine, depsgraph, views: Sequence[str] = NO_VIEWS
) -> tuple[list[Scene], list[str], SurfaceReader]:
    """Everything that the depsgraph's view layer renders, at all times of the picture, for each of its views; warnings;
    and what read it as it is in the middle. Scenes of views differ in their cameras alone and share all else.

    engine: the RenderEngine, whose depsgraph goes from time to time, and in the end is back. views: their names. Raises
    SceneError as read_scene does, and CancelledError.
    """
    exposure, frame = read_exposure(depsgraph.scene_eval), _frame_of(depsgraph.scene_eval)
    cameras = view_cameras(engine, depsgraph, views)  # of the frame: markers switch to others at other times
    if not exposure.times:
        return _read_views(engine, depsgraph, cameras)
    try:
        _go_to(engine, exposure.middle)
        elsewhen = exposure.middle != frame
        with _named(exposure.middle, "the middle of the shutter") if elsewhen else nullcontext():
            scenes, warnings, surfaces = _read_views(engine, depsgraph, cameras)
        moments: list[list[Moment]] = []  # by time, then by view
        for number, time in enumerate(exposure.times, 1):
            if engine.test_break():
                raise CancelledError
            engine.update_stats("", f"Reading the scene at time {number} of {len(exposure.times)}")
            _go_to(engine, time)
            with _named(time, "which the picture sees too"):
                seen, further = _read_moment(engine, depsgraph, cameras, scenes, surfaces)
            moments.append(seen)
            warnings += [message for message in further if message not in warnings]
            if number == 1:  # those that follow will not differ from it much in size
                check_memory({"moments": len(exposure.times) * bytes_of(seen[0])})
    finally:
        _go_to(engine, frame)
    of_views = zip(scenes, zip(*moments, strict=True), strict=True)
    return [replace(scene, moments=seen if any(seen) else ()) for scene, seen in of_views], warnings, surfaces


def _go_to(engine, time: float) -> None:
    """Evaluate the engine's depsgraph at a time, in frames."""
    engine.frame_set(math.floor(time), time - math.floor(time))


@contextmanager
def _named(time: float, which: str) -> Iterator[None]:
    """Errors of a scene say at which frame it is so, and which frame that is."""
    try:
        yield
    except SceneError as error:
        raise SceneError(f"At frame {time:.6g}, {which}: {error}") from error


def _read_views(
    engine, depsgraph, cameras: dict[str, bpy.types.Object]
) -> tuple[list[Scene], list[str], SurfaceReader]:
    """As read_moving_scene, as the depsgraph is now. cameras: see view_cameras."""
    surfaces = render_reader(depsgraph)
    scene, warnings = read_scene(depsgraph, _first(cameras), surfaces)
    if tuple(cameras) == NO_VIEWS:
        return [scene], warnings, surfaces
    scenes = [replace(scene, camera=camera) for camera in _read_cameras(engine, depsgraph, cameras, Warnings())]
    return scenes, warnings, surfaces


def _read_moment(
    engine, depsgraph, cameras: dict[str, bpy.types.Object], base: list[Scene], earlier: SurfaceReader
) -> tuple[list[Moment], list[str]]:
    """What is otherwise than in the scene of each view, as the depsgraph is now, and warnings. cameras: see
    view_cameras. base: the scenes. earlier: their reader."""
    surfaces = render_reader(depsgraph, earlier.textures.kept)
    contents = read_contents(depsgraph, surfaces, camera=_first(cameras))
    contents |= {"band_edges": base[0].band_edges, "response": base[0].response}  # those of the picture
    seen = _read_cameras(engine, depsgraph, cameras, surfaces.warnings)
    moment = moment_of(Scene(**contents, camera=seen[0]), base[0])
    others = zip(seen[1:], base[1:], strict=True)
    return [moment, *(_seen_by(camera, moment, scene) for camera, scene in others)], surfaces.warnings.messages()


def _first(cameras: dict[str, bpy.types.Object]) -> bpy.types.Object:
    return next(iter(cameras.values()))


def _read_cameras(engine, depsgraph, cameras: dict[str, bpy.types.Object], warnings: Warnings) -> list[Camera]:
    """The solver's camera of each view, as the depsgraph is now."""
    return [read_view_camera(engine, depsgraph, view, obj, warnings) for view, obj in cameras.items()]


def _seen_by(camera: Camera, moment: Moment, base: Scene) -> Moment:
    """A moment of one view as the camera of another sees it. base: the scene of the other."""
    alike = [change for change in moment if change.part != "camera"]
    return (*alike, *moment_of(replace(base, camera=camera), base))
