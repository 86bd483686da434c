# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereoscopy: a view layer has several pictures then, its views, each by a camera of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from ..solver.scene import Camera
from .camera import Eye, read_camera
from .warnings import Warnings

NO_VIEWS = ("",)  # what view_names returns without stereoscopy


def view_names(render) -> tuple[str, ...]:
    """The views that a scene's render settings ask for, in Blender's order; NO_VIEWS if they ask for none."""
    return tuple(each.name for each in views_of(render)) or NO_VIEWS


def views_of(render) -> list[bpy.types.SceneRenderView]:
    """Blender's views of a scene's render settings, those that are used; none without stereoscopy."""
    if not render.use_multiview:
        return []
    return [each for each in (render.stereo_views if _has_eyes(render) else render.views) if each.use]


def _has_eyes(render) -> bool:
    """Whether views are two eyes of one camera object, else each has an object of its own."""
    return render.views_format == "STEREO_3D"


def ignored_view_settings(scene) -> Iterator[str]:
    """What a scene's stereoscopy asks for and the engine does not do, and what it does instead."""
    views, camera = views_of(scene.render), scene.camera
    if not views or camera is None or camera.type != "CAMERA":
        return
    if _has_eyes(scene.render):
        if camera.data.type == "PANO" and camera.data.stereo.use_spherical_stereo:
            yield f"Camera '{camera.name}': no spherical stereo; its panoramas are of two cameras side by side"
        return
    # as Blender finds them: the longest suffix at the end of the active camera's name is replaced by each view's
    ends = [each.camera_suffix for each in views if camera.name.endswith(each.camera_suffix)]
    stem = camera.name[: len(camera.name) - max(map(len, ends), default=0)]
    for each in views:
        twin = f"{stem}{each.camera_suffix}"
        if not ends or twin not in scene.objects:
            yield f"Stereoscopy: there is no camera '{twin}', so view '{each.name}' shows what '{camera.name}' sees"


def view_cameras(engine, depsgraph, views: Sequence[str]) -> dict[str, bpy.types.Object | None]:
    """The camera object of each view at the depsgraph's frame, by the view's name; None if the scene has none.

    A picture has one camera, however long it is taken. Blender switches to others with markers of the timeline as soon
    as a frame is set, so these are the original objects, to be evaluated at whatever time.
    """
    return {view: _view_camera(engine, depsgraph, view) for view in views}


def _view_camera(engine, depsgraph, view: str) -> bpy.types.Object | None:
    if view:
        engine.active_view_set(view)
    obj = engine.camera_override or depsgraph.scene_eval.camera
    return obj and obj.original


def read_view_camera(engine, depsgraph, view: str, obj, warnings: Warnings) -> Camera:
    """The solver's camera of a view, as the depsgraph is now; Blender is told that this is the view that it renders.

    obj: its camera object, see view_cameras. Raises SceneError as read_camera does.
    """
    if not view or obj is None or obj.type != "CAMERA":
        return read_camera(depsgraph, obj, warnings)
    engine.active_view_set(view)
    obj = obj.evaluated_get(depsgraph)
    eye = Eye(np.array(engine.camera_model_matrix(obj), dtype=np.float64), engine.camera_shift_x(obj))
    return read_camera(depsgraph, obj, warnings, eye)
