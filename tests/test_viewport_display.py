# SPDX-License-Identifier: GPL-3.0-or-later
"""What the spot meter and the measuring tools of a 3D viewport show is what its picture was made from."""

import gc
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.measure_settings import add_tool  # noqa: E402
from addon.output.temperature_scale import CELSIUS, KELVIN  # noqa: E402
from addon.rendering import viewport  # noqa: E402
from addon.rendering.live_pictures import picture_in  # noqa: E402
from addon.rendering.readings import pixel_now, read_tool, temperature_now  # noqa: E402
from addon.solver import Camera, Correction, Film, Settings  # noqa: E402
from addon.ui.temperatures import spot_meter  # noqa: E402

WIDTH, HEIGHT = 7, 5


def film_of(passes):
    """A film of random passes around 300 K."""
    film = Film(WIDTH, HEIGHT, np.array([8.0, 10.0, 14.0]), 300.0)
    rng = np.random.default_rng(4)
    for _ in range(passes):
        excess = rng.normal(0.0, 1.0, (WIDTH * HEIGHT, 2)).astype(np.float32)  # W m-2 sr-1
        film.add_pass(excess, np.zeros(WIDTH * HEIGHT, np.float32), 100)
    return film


def picture_of(film, step=1, origin=(0, 0), frame=None):
    return viewport.picture_of(film, viewport.Request(None, Settings(), Camera(), frame), step, origin)


def live_reading(picture, x, y, unit):
    return spot_meter.live_reading(picture, bpy.context.scene.infrared, x, y, unit)


@pytest.mark.parametrize("correction", [Correction(), Correction(0.8, 280.0)])
def test_the_correction_of_now_gives_what_a_render_with_it_gives(correction):
    film, infrared = film_of(50), bpy.context.scene.infrared
    picture = picture_of(film)
    infrared.assumed_emissivity, infrared.reflected_temperature = correction[:2]
    film.correction = correction
    np.testing.assert_allclose(temperature_now(picture.measured, infrared), film.temperature(), atol=1e-4)
    # to the first order of the error, which is 0.3 K
    kelvin, noise = pixel_now(picture.measured, infrared, (3, 2))
    assert kelvin == pytest.approx(film.temperature()[3, 2], abs=1e-4)
    assert noise == pytest.approx(film.noise()[3, 2], rel=0.01)


@pytest.mark.parametrize("step", [1, 3])
def test_tools_lie_in_the_cameras_frame_where_there_is_one(step):
    """A spot at a share of the frame reads the pixel that is drawn there."""
    picture = picture_of(film_of(3), step, (10, 20), (10.0 + 1.5 * step, 20.0 - 0.5 * step, 4.0 * step, 5.0 * step))
    infrared = bpy.context.scene.infrared
    spot = add_tool(infrared, "SPOT", [(0.5, 0.5)])  # 3.5 pixels from the left edge and 2 from the lower one
    assert read_tool(spot, picture.measured, infrared).mean == picture.temperature[2, 3]
    free = picture_of(film_of(3), step, (10, 20))
    assert read_tool(spot, free.measured, infrared).mean == free.temperature[HEIGHT // 2, WIDTH // 2]


def test_temperature_and_noise_are_the_films():
    film = film_of(6)
    picture = picture_of(film)
    np.testing.assert_array_equal(picture.temperature, film.temperature())
    np.testing.assert_array_equal(picture.noise, film.noise())


def test_readings_say_what_is_known():
    """Of the pixel at the cursor, in the scene's unit; nothing is known of the error after one pass."""
    film = film_of(1)
    kelvin = film.temperature()[3, 2]
    assert live_reading(picture_of(film), 2, 3, KELVIN) == f"{kelvin:.2f} K (error unknown)"
    film = film_of(9)
    value, error = film.temperature()[3, 2] - 273.15, film.noise()[3, 2]
    shown, sign, uncertainty, unit = live_reading(picture_of(film), 2, 3, CELSIUS).split()
    assert (sign, unit) == ("±", "°C")
    assert abs(float(shown) - value) <= 0.05 and abs(float(uncertainty) - error) <= 0.05  # a digit after the point


@pytest.mark.parametrize("step, origin", [(1, (0, 0)), (4, (12, 8)), (2, (3, 1))])
def test_the_cursor_finds_its_pixel_at_any_size_of_them(step, origin):
    picture = picture_of(film_of(2), step=step, origin=origin)
    for x in range(origin[0] - 2, origin[0] + step * WIDTH + 2):
        for y in range(origin[1] - 2, origin[1] + step * HEIGHT + 2):
            column, row = np.floor((np.array((x, y)) + 0.5 - origin) / step)
            inside = 0 <= column < WIDTH and 0 <= row < HEIGHT
            assert picture.pixel_at(x, y) == ((row, column) if inside else None)
            assert (live_reading(picture, x, y, KELVIN) is not None) == inside


def test_without_a_viewport_there_is_nothing_to_show():
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    assert picture_in(region) is None


class Engine:
    """A stand-in for Blender's engine."""

    def update_stats(self, *_):
        pass


def test_a_viewports_picture_is_found_by_its_region_while_there_is_the_viewport():
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    engine = Engine()
    drawn = viewport.Viewport(engine)
    drawn.draw(engine, SimpleNamespace(region=area.regions[0]), None)  # nothing was read, so nothing is drawn
    assert picture_in(area.regions[0]) is None
    drawn.shown = picture_of(film_of(2))
    assert picture_in(area.regions[0]) is drawn.shown and picture_in(area.regions[1]) is None
    del drawn
    gc.collect()
    assert picture_in(area.regions[0]) is None
