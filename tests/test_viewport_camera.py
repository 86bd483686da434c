# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's camera puts every point on the pixel of a 3D viewport where Blender's own tools put it.

Real views, with a camera's zoom and offset, need a window: tests/real_blender/viewport.py looks at those.
"""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_vector_3d  # noqa: E402
from mathutils import Euler, Matrix, Vector  # noqa: E402

from addon.reading.camera import read_view  # noqa: E402
from addon.rendering.viewport import Request, Viewport  # noqa: E402
from tests.helpers.blender import camera, link  # noqa: E402

REGION = SimpleNamespace(width=301, height=200)
PLACE = Matrix.LocRotScale((3.0, -4.0, 2.0), Euler((1.1, 0.2, 0.6)), None)
# Blender's matrices are float32: 6e-8 of the coordinates, some 10 m, over the size of a pixel there, some 0.02 m
PRECISION = 1e-3  # pixels


def viewport(projection, perspective="PERSP"):
    """A stand-in for Blender's RegionView3D, which without a window does not compute its own matrices."""
    view_matrix = PLACE.inverted()
    return SimpleNamespace(
        window_matrix=projection,
        view_matrix=view_matrix,
        perspective_matrix=projection @ view_matrix,
        view_perspective=perspective,
        is_perspective=projection[3][3] == 0,
    )


def space(**changes):
    """A stand-in for SpaceView3D."""
    border = {f"render_border_{end}_{axis}": float(end == "max") for end in ("min", "max") for axis in "xy"}
    return SimpleNamespace(
        **{"camera": None, "clip_start": 0.1, "clip_end": 100.0, "use_render_border": False} | border | changes
    )


class Engine:
    """A stand-in for Blender's engine, which asking does not need."""


@pytest.fixture
def eye():
    """A camera object where the views look from."""
    obj = camera(width=REGION.width, height=REGION.height)
    obj.matrix_world = PLACE
    return obj


def projection_of(eye, kind, region=REGION):
    """Blender's projection matrix of a camera with a shift."""
    eye.data.type, eye.data.ortho_scale, eye.data.shift_x, eye.data.shift_y = kind, 7.0, 0.1, -0.2
    graph = bpy.context.evaluated_depsgraph_get()
    return eye.calc_matrix_camera(graph, x=region.width, y=region.height)


def read(view, of=None):
    return read_view(bpy.context.evaluated_depsgraph_get(), of or space(), REGION, view)


def pixel(solver_camera, point):
    """Where the solver's Camera, as its docstring defines it, puts a world point: x, y in pixels."""
    local = np.linalg.inv(solver_camera.matrix) @ np.array([*point, 1.0])
    x, y = local[:2] / -local[2] if solver_camera.kind == "PERSPECTIVE" else local[:2]
    left, right, bottom, top = solver_camera.frame
    return solver_camera.width * (x - left) / (right - left), solver_camera.height * (y - bottom) / (top - bottom)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize("perspective", ["PERSP", "CAMERA"])
def test_points_lie_on_the_viewports_pixels(eye, kind, perspective):
    view = viewport(projection_of(eye, kind), perspective)
    result = read(view, space(camera=eye))
    assert (result.width, result.height) == (REGION.width, REGION.height) and result.window is None
    for local in np.random.default_rng(1).uniform((-3, -2, -12), (3, 2, -2), (20, 3)):
        point = PLACE @ Vector(local)
        expected = location_3d_to_region_2d(REGION, view, point)
        np.testing.assert_allclose(pixel(result, point), expected, atol=PRECISION)


def test_the_middle_of_a_pixel_looks_where_the_viewports_does(eye):
    view = viewport(projection_of(eye, "PERSP"))
    result = read(view)
    for x, y in ((0.5, 0.5), (300.5, 0.5), (150.5, 199.5)):
        left, right, bottom, top = result.frame
        local = left + (right - left) * x / 301, bottom + (top - bottom) * y / 200, -1.0
        direction = result.matrix[:3, :3] @ local
        expected = region_2d_to_vector_3d(REGION, view, (x, y))
        # Blender inverts a float32 matrix whose condition is clip end over clip start, here 1000
        np.testing.assert_allclose(direction / np.linalg.norm(direction), expected, atol=1000 * 6e-8)


def test_what_is_behind_an_orthographic_views_centre_is_seen(eye):
    """Blender cuts half of the clip end before and behind the view's centre."""
    result = read(viewport(projection_of(eye, "ORTHO")), space(clip_end=100.0))
    depth = -(np.linalg.inv(result.matrix) @ np.array([*PLACE.translation, 1.0]))[2]
    assert result.clip == (0.0, 100.0) and depth == pytest.approx(50.0, rel=1e-6)


def test_clipping_is_the_viewports_or_the_cameras(eye):
    eye.data.clip_start, eye.data.clip_end = 0.5, 20.0
    projection = projection_of(eye, "PERSP")
    assert read(viewport(projection), space(camera=eye)).clip == (0.1, 100.0)
    assert read(viewport(projection, "CAMERA"), space(camera=eye)).clip == (0.5, 20.0)


def test_depth_of_field_is_the_cameras_alone(eye):
    eye.data.dof.use_dof, eye.data.dof.focus_distance, eye.data.dof.aperture_fstop = True, 3.0, 2.0
    projection = projection_of(eye, "PERSP")
    through = read(viewport(projection, "CAMERA"), space(camera=eye))
    assert through.focus_distance == 3.0 and through.lens_radius == pytest.approx(eye.data.lens * 1e-3 / 4)
    assert read(viewport(projection), space(camera=eye)).lens_radius == 0.0


def test_any_object_may_stand_in_for_a_camera(eye):
    """Blender looks through lamps and empties too."""
    result = read(viewport(projection_of(eye, "PERSP"), "CAMERA"), space(camera=link("Empty")))
    assert result.kind == "PERSPECTIVE" and result.clip == (0.1, 100.0)


def test_the_viewports_render_region(eye):
    border = {"render_border_min_x": 0.25, "render_border_max_x": 0.5, "render_border_min_y": 0.1}
    of = space(camera=eye, use_render_border=True, **border)
    projection = projection_of(eye, "PERSP")
    assert read(viewport(projection), of).window == (75, 20, 151, 200)  # whole pixels that hold 75.25 to 150.5
    assert read(viewport(projection, "CAMERA"), of).window is None


def test_the_renders_border_lies_in_the_cameras_frame(eye):
    """A camera's frame that fills the middle half of the viewport's width and height."""
    projection = projection_of(eye, "PERSP")
    zoomed = Matrix.Diagonal((0.5, 0.5, 1.0, 1.0)) @ projection
    render = bpy.context.scene.render
    render.use_border, render.border_min_x, render.border_max_x = True, 0.5, 1.0
    window = read(viewport(zoomed, "CAMERA"), space(camera=eye)).window
    # edges at 150.5 and 225.75, 50 and 150; an edge on a pixel's may be rounded to either
    assert window[::2] == (150, 226) and abs(window[1] - 50) <= 1 and abs(window[3] - 150) <= 1
    assert read(viewport(zoomed), space(camera=eye)).window is None


def test_a_panorama_fills_the_cameras_frame(eye):
    """Longitude and latitude are linear in the frame, which here has the middle half of the viewport."""
    projection = projection_of(eye, "PERSP")
    eye.data.type = "PANO"
    pano = eye.data
    pano.longitude_min, pano.longitude_max, pano.latitude_min, pano.latitude_max = -1.0, 2.0, -0.5, 0.7
    pano.shift_x = pano.shift_y = 0.0
    zoomed = Matrix.Diagonal((0.5, 0.5, 1.0, 1.0)) @ projection
    graph = bpy.context.evaluated_depsgraph_get()
    corners = [pano.view_frame(scene=bpy.context.scene)[index] for index in (2, 0)]  # lower left, upper right
    low, high = (location_3d_to_region_2d(REGION, viewport(zoomed), PLACE @ corner) for corner in corners)
    result = read_view(graph, space(camera=eye), REGION, viewport(zoomed, "CAMERA"))
    assert result.kind == "PANORAMA"
    left, right, bottom, top = result.frame
    for x, y, longitude, latitude in ((*low, -1.0, -0.5), (*high, 2.0, 0.7)):
        # float32 of the corners, as above, over the pixels in a radian
        assert left + (right - left) * x / REGION.width == pytest.approx(longitude, abs=1e-3 / 50)
        assert bottom + (top - bottom) * y / REGION.height == pytest.approx(latitude, abs=1e-3 / 50)
    assert result.window == (int(low.x), int(low.y), -int(-high.x // 1), -int(-high.y // 1))


def test_a_panorama_out_of_sight_asks_for_nothing(eye):
    """The camera's frame is moved by more than the viewport's width."""
    projection = projection_of(eye, "PERSP")
    eye.data.type = "PANO"
    asked = []
    live = Viewport(Engine())
    live._render = SimpleNamespace(submit=asked.append)
    live._wanted = Request(None, None, None)
    for moved in (projection, Matrix.Translation((3.0, 0.0, 0.0)) @ projection):
        view = SimpleNamespace(space_data=space(camera=eye), region=REGION, region_data=viewport(moved, "CAMERA"))
        live._ask(view, bpy.context.evaluated_depsgraph_get())
    assert asked[0].camera.kind == "PANORAMA" and asked[1:] == [None]
