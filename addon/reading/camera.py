# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's camera becomes the solver's Camera."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..solver.scene import Camera, SceneError

_NEAREST = 1e-6  # m, at which the size of a pixel is told
WHOLE = np.array([[0.0, 0.0], [1.0, 1.0]])  # the border that encloses its whole frame


class Eye(NamedTuple):
    """One of several cameras that Blender makes of a camera object for stereoscopy. matrix: (4, 4) float64, to the
    world. shift: of its frame to the right, as Camera.shift_x."""

    matrix: np.ndarray
    shift: float


def read_camera(depsgraph, obj, warnings, eye: Eye | None = None) -> Camera:
    """The solver's camera for an evaluated camera object and the scene's resolution and border.

    eye: in place of the object's own matrix and shift. Raises SceneError without a camera, or if it cannot take a
    picture.
    """
    if obj is None:
        raise SceneError("The scene has no camera")
    if obj.type != "CAMERA":
        raise SceneError(f"Object '{obj.name}' is the scene's camera, but it is a {obj.type.lower()}, not a camera")
    obj = obj.evaluated_get(depsgraph)
    camera, render = obj.data, depsgraph.scene_eval.render
    width, height = render_size(render)
    matrix = _rigid(eye.matrix if eye else np.array(obj.matrix_world, dtype=np.float64))
    if not np.isfinite(matrix).all():
        raise SceneError(f"Camera '{obj.name}': its position or scale is not finite, or its scale is 0")
    kind = {"PERSP": "PERSPECTIVE", "ORTHO": "ORTHOGRAPHIC", "PANO": "PANORAMA"}.get(camera.type)
    if kind is None:
        raise SceneError(f"Camera '{obj.name}': type {camera.type} cannot be rendered")
    if kind == "PANORAMA":
        if camera.panorama_type != "EQUIRECTANGULAR":
            other = camera.bl_rna.properties["panorama_type"].enum_items[camera.panorama_type].name
            warnings.add(obj.name, f"panorama type {other} is not supported, rendered as Equirectangular")
        frame = _panorama_frame(camera)
    else:
        projection = obj.calc_matrix_camera(
            depsgraph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
        )
        frame = _projection_frame(np.array(projection, dtype=np.float64), kind)
        if eye:
            frame = _shifted_frame(frame, eye.shift - camera.shift_x, camera.sensor_fit)
    return Camera(
        width=width,
        height=height,
        matrix=matrix,
        kind=kind,
        frame=frame,
        window=render_window(render),
        clip=(camera.clip_start, camera.clip_end),
        **_lens(depsgraph, camera, matrix, kind),
    )


def pixel_size(camera: Camera, points: np.ndarray) -> np.ndarray:
    """(n,) m, about how large a pixel of a camera is at points (n, 3) in world space: its smaller side, in focus."""
    left, right, bottom, top = camera.frame
    size = min((right - left) / camera.width, (top - bottom) / camera.height)
    if camera.kind == "ORTHOGRAPHIC":
        return np.full(len(points), size)
    distance = np.linalg.norm(points - camera.matrix[:3, 3], axis=1)
    return size * np.maximum(distance, max(camera.clip[0], _NEAREST))


def read_view(depsgraph, space, region, view) -> Camera:
    """The solver's camera for what a 3D viewport shows: as many pixels as the viewport has, and its render region.

    space, region, view: SpaceView3D, Region and RegionView3D. The matrices of a view through a camera already contain
    the camera's shift and the view's zoom and offset. A panorama fills the camera's frame, as in Cycles, and nothing is
    shown around it; Blender draws its own overlays as in a perspective.
    """
    projection = np.array(view.window_matrix, dtype=np.float64)
    matrix = _rigid(np.linalg.inv(np.array(view.view_matrix, dtype=np.float64)))
    kind = "ORTHOGRAPHIC" if projection[3, 3] else "PERSPECTIVE"
    through = space.camera if view.view_perspective == "CAMERA" else None
    camera = through.evaluated_get(depsgraph).data if through is not None and through.type == "CAMERA" else None
    lens = _lens(depsgraph, camera, matrix, kind) if camera else {}
    frame, border = _projection_frame(projection, kind), _view_border(depsgraph.scene_eval, space, view, camera)
    within = _frame_in_view(depsgraph.scene_eval, camera, projection) if camera else WHOLE
    if camera and camera.type == "PANO":
        kind, frame = "PANORAMA", _extended_frame(_panorama_frame(camera), within)
        border = WHOLE if border is None else border
    start, end = (camera or space).clip_start, (camera or space).clip_end
    if kind == "ORTHOGRAPHIC" and not camera:  # as Blender, which also shows what is behind the view's centre
        start, end = -0.5 * end, 0.5 * end
        matrix[:3, 3] -= start * matrix[:3, 2]
        start, end = 0.0, end - start
    return Camera(
        width=region.width,
        height=region.height,
        matrix=matrix,
        kind=kind,
        frame=frame,
        window=None if border is None else _whole_pixels(within[0] + border * (within[1] - within[0]), region),
        clip=(start, end),
        **lens,
    )


def _view_border(scene, space, view, camera) -> np.ndarray | None:
    """The render region (2, 2) in shares of its frame, as `_border` returns it; None renders everything.

    A view through a camera has the border of the render, other views have one of their own.
    """
    if view.view_perspective == "CAMERA":
        return _border(scene.render, "border") if camera and scene.render.use_border else None
    return _border(space, "render_border") if space.use_render_border else None


def camera_frame(scene, space, region, view) -> tuple[float, float, float, float] | None:
    """Left, bottom, width and height of the frame of the camera that a 3D viewport looks through, in the region's
    pixels; None if it looks through none.

    space, region, view: SpaceView3D, Region and RegionView3D.
    """
    camera = space.camera
    if view.view_perspective != "CAMERA" or camera is None or camera.type != "CAMERA":
        return None
    low, high = _frame_in_view(scene, camera.data, np.array(view.window_matrix, dtype=np.float64))
    low, high = low * (region.width, region.height), high * (region.width, region.height)
    return *low.tolist(), *(high - low).tolist()


def _frame_in_view(scene, camera, projection: np.ndarray) -> np.ndarray:
    """(2, 2) lower left and upper right corner of a camera's frame, as shares of the viewport's width and height."""
    corners = np.column_stack((camera.view_frame(scene=scene), np.ones(4))) @ projection.T
    corners = 0.5 + 0.5 * corners[:, :2] / corners[:, 3:]
    return np.stack((corners.min(axis=0), corners.max(axis=0)))


def _extended_frame(frame: tuple[float, float, float, float], within: np.ndarray) -> tuple[float, float, float, float]:
    """The frame (left, right, bottom, top) of a whole viewport, from that of the camera in it.

    within: (2, 2) corners of the camera's frame in the viewport, see `_frame_in_view`.
    """
    low, high = np.reshape(frame, (2, 2)).T
    size = (high - low) / (within[1] - within[0])
    start = low - within[0] * size
    left, right, bottom, top = np.column_stack((start, start + size)).ravel().tolist()
    return left, right, bottom, top


def _whole_pixels(corners: np.ndarray, region) -> tuple[int, int, int, int]:
    """(x0, y0, x1, y1) of the region's pixels that hold a rectangle (2, 2), shares of width and height."""
    size = np.array((region.width, region.height))
    (x0, y0), (x1, y1) = np.clip(corners * size, 0, size)
    return int(x0), int(y0), int(np.ceil(x1)), int(np.ceil(y1))


def _border(owner, prefix: str) -> np.ndarray:
    """(2, 2) lower left and upper right corner of a border, as shares of its frame.

    owner, prefix: the data block with the border, and what the names of its four numbers begin with.
    """
    return np.array([[getattr(owner, f"{prefix}_{end}_{axis}") for axis in "xy"] for end in ("min", "max")])


def render_size(render) -> tuple[int, int]:
    """(width, height) in pixels of the whole frame, rounded down as Blender does."""
    return (
        max(1, render.resolution_x * render.resolution_percentage // 100),
        max(1, render.resolution_y * render.resolution_percentage // 100),
    )


def render_window(render) -> tuple[int, int, int, int] | None:
    """(x0, y0, x1, y1) in pixels of the border, origin at the lower left; None renders the whole frame."""
    if not render.use_border:
        return None
    # Blender multiplies in float32 and rounds down
    (x0, y0), (x1, y1) = np.float32(_border(render, "border")) * np.float32(render_size(render))
    return int(x0), int(y0), int(x1), int(y1)


def rendered_size(render) -> tuple[int, int]:
    """(width, height) in pixels of what is rendered: the border, if there is one, else the whole frame."""
    x0, y0, x1, y1 = render_window(render) or (0, 0, *render_size(render))
    return x1 - x0, y1 - y0


def _rigid(matrix: np.ndarray) -> np.ndarray:
    """The matrix without its scale: as in Blender, the scale of a camera object does not zoom."""
    result = matrix.copy()
    with np.errstate(invalid="ignore", divide="ignore"):
        result[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    return result


def _projection_frame(projection: np.ndarray, kind: str) -> tuple[float, float, float, float]:
    """(left, right, bottom, top) of the frame: what the projection matrix maps to -1 and 1."""
    column, sign = (2, 1.0) if kind == "PERSPECTIVE" else (3, -1.0)
    left, right = (np.array([-1.0, 1.0]) + sign * projection[0, column]) / projection[0, 0]
    bottom, top = (np.array([-1.0, 1.0]) + sign * projection[1, column]) / projection[1, 1]
    return float(left), float(right), float(bottom), float(top)


def _shifted_frame(
    frame: tuple[float, float, float, float], shift: float, fit: str
) -> tuple[float, float, float, float]:
    """A frame (left, right, bottom, top) moved to the right. shift: in sizes of the side that the sensor is fitted to,
    as a camera's shift_x counts. fit: Camera.sensor_fit."""
    left, right, bottom, top = frame
    width, height = right - left, top - bottom
    moved = shift * {"HORIZONTAL": width, "VERTICAL": height, "AUTO": max(width, height)}[fit]
    return left + moved, right + moved, bottom, top


def _panorama_frame(camera) -> tuple[float, float, float, float]:
    """(left, right, bottom, top) in radians of longitude and latitude; a shift counts in frames, as in Cycles."""
    across = camera.shift_x * (camera.longitude_max - camera.longitude_min)
    up = camera.shift_y * (camera.latitude_max - camera.latitude_min)
    return (
        camera.longitude_min + across,
        camera.longitude_max + across,
        camera.latitude_min + up,
        camera.latitude_max + up,
    )


def _lens(depsgraph, camera, matrix: np.ndarray, kind: str) -> dict:
    """Depth of field: lens radius and focus distance in m, and the shape of the aperture, as Cycles takes them."""
    dof = camera.dof
    if not dof.use_dof:
        return {}
    aperture = 1.0 if kind == "ORTHOGRAPHIC" else camera.lens * 1e-3  # m; an orthographic camera has no focal length
    return {
        "lens_radius": aperture / (2.0 * max(dof.aperture_fstop, 1e-5)),
        "focus_distance": _focus_distance(depsgraph, dof, matrix),
        "blades": dof.aperture_blades,
        "blade_rotation": dof.aperture_rotation,
        "lens_ratio": dof.aperture_ratio,
    }


def _focus_distance(depsgraph, dof, matrix: np.ndarray) -> float:
    """Depth in focus, m: set by hand, or that of the focus object (or its bone) along the view axis."""
    if dof.focus_object is None:
        return dof.focus_distance
    target = dof.focus_object.evaluated_get(depsgraph)
    to_world = target.matrix_world
    if target.pose is not None and dof.focus_subtarget in target.pose.bones:
        to_world = to_world @ target.pose.bones[dof.focus_subtarget].matrix
    return float(abs((matrix[:3, 3] - np.array(to_world.translation)) @ matrix[:3, 2]))
