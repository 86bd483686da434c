# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the colour bar finds room, what dragging it does, and which measuring tool a click means."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.output.colour_bar import ColourBar  # noqa: E402
from addon.output.temperature_scale import KELVIN, TemperatureScale  # noqa: E402
from addon.rendering.gpu_pictures import _colours  # noqa: E402
from addon.ui.drawing import as_on_screen  # noqa: E402
from addon.ui.measuring.outlines import Hit, handles, hit, outline  # noqa: E402
from addon.ui.temperatures.bar import LEAST_SPAN, Margins, dock, dragged, part_at  # noqa: E402

NONE = Margins(0, 0, 0, 0)
WIDTH, LEAST, MOST = 100, 90, 400


def overlap(place, images) -> bool:
    """Does a bar lie over the picture?"""
    left, bottom, height = place
    across = left < images[0] + images[2] and left + WIDTH > images[0]
    return across and bottom < images[1] + images[3] and bottom + height > images[1]


@pytest.mark.parametrize("size", [(1200, 700), (640, 400), (330, 240)])
@pytest.mark.parametrize("taken", [NONE, Margins(50, 200, 30, 10)], ids=["free", "with regions over it"])
def test_the_bar_is_inside_the_window_and_beside_the_picture_where_there_is_room(size, taken):
    """At any place and size of the picture."""
    rng = np.random.default_rng(0)
    beside = 0
    for _ in range(300):
        width, height = rng.uniform(20, 1.2 * size[0]), rng.uniform(20, 1.2 * size[1])
        images = rng.uniform(-0.3, 0.9) * size[0], rng.uniform(-0.3, 0.9) * size[1], width, height
        place = dock(size, taken, images, (WIDTH, LEAST, MOST))
        free = taken.left, size[0] - taken.right
        if free[1] - free[0] < WIDTH:
            assert place is None
            continue
        left, bottom, tall = place
        assert free[0] <= left and left + WIDTH <= free[1]
        assert taken.bottom <= bottom and bottom + tall <= size[1] - taken.top and tall <= MOST
        room = free[1] - (images[0] + width) >= WIDTH + 1 or images[0] - free[0] >= WIDTH + 1
        room |= images[1] - taken.bottom >= LEAST + 1 or size[1] - taken.top - (images[1] + height) >= LEAST + 1
        assert not (room and overlap(place, images))
        beside += room
    assert beside > 50 or size[0] - taken.left - taken.right < 2 * WIDTH


def test_a_picture_as_wide_as_the_window_has_the_bar_below_or_above():
    assert dock((300, 600), NONE, (0, 200, 300, 300), (WIDTH, LEAST, MOST)) == (200, 0, 200)
    assert dock((300, 600), NONE, (0, 10, 300, 300), (WIDTH, LEAST, MOST)) == (200, 310, 290)
    assert dock((300, 600), NONE, (0, 0, 300, 600), (WIDTH, LEAST, MOST)) == (200, 0, 400)  # over it: there is no room


def test_the_bar_keeps_off_the_viewports_gizmos():
    at_the_edge = dock((600, 500), NONE, (0, 0, 600, 500), (WIDTH, LEAST, MOST), gizmos=230)
    assert at_the_edge[1] + at_the_edge[2] <= 500 - 230
    beside = dock((1200, 500), NONE, (100, 100, 500, 300), (WIDTH, LEAST, MOST), gizmos=230)
    assert beside == (600, 100, 400)


def test_parts_of_a_bar_and_what_is_beside_it():
    bar = ColourBar(TemperatureScale(low=280.0, high=300.0), KELVIN, 100, 50, 400)
    left, bottom, width, height = bar.bar
    x = left + width // 2
    assert [part_at(bar, x, bottom + share * height) for share in (0.05, 0.5, 0.95)] == ["LOW", "MIDDLE", "HIGH"]
    assert part_at(bar, left - 1, bottom + 10) is None and part_at(bar, x, bottom + height + 100) is None


def test_dragging_moves_what_was_taken_hold_of():
    low, high = 280.0, 300.0
    assert dragged(low, high, "HIGH", 0.5) == (280.0, 310.0)
    assert dragged(low, high, "LOW", 0.5) == (290.0, 300.0)
    assert dragged(low, high, "MIDDLE", -0.25) == (275.0, 295.0)
    assert dragged(low, high, "SPAN", 0.5) == (270.0, 310.0)  # twice as wide, about the same middle
    assert dragged(low, high, "SPAN", -0.5) == (285.0, 295.0)


@pytest.mark.parametrize("part", ["LOW", "MIDDLE", "HIGH", "SPAN"])
@pytest.mark.parametrize("share", [-300.0, -2.0, 2.0, 300.0])
def test_no_way_of_the_mouse_makes_a_range_that_is_none(part, share):
    low, high = dragged(280.0, 300.0, part, share)
    assert low >= 0.0 and (high - low >= LEAST_SPAN * (1 - 1e-9)) and not math.isnan(low + high)


def test_what_is_drawn_over_an_editor_gets_onto_the_screen_as_wanted():
    """Blender keeps the light of sRGB colours (IEC 61966-2-1) and shows it by the power of 1 / 2.2."""
    wanted = np.arange(256) / 255.0
    given = as_on_screen(wanted)
    light = np.where(given <= 0.04045, given / 12.92, ((given + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(light ** (1 / 2.2), wanted, atol=1e-4)


def test_the_graphics_card_gets_the_palettes_colours():
    """8-bit sRGB for the screen; in a working space the linear colours by its primaries."""
    scale = TemperatureScale("IRON", 280.0, 300.0)
    linear = scale.colours(np.linspace(280.0, 300.0, 50))
    assert np.abs(_colours(linear, None) * 255 - np.rint(_colours(linear, None) * 255)).max() < 1e-4
    primaries = np.arange(9, dtype=np.float32).reshape(3, 3)
    np.testing.assert_allclose(_colours(linear, primaries.tobytes()), linear @ primaries)


# Clicks on measuring tools

BOX = "BOX", [(100.0, 100.0), (200.0, 160.0)]
LINE = "LINE", [(300.0, 100.0), (400.0, 200.0)]
SPOT = "SPOT", [(50.0, 50.0)]


def test_a_click_means_the_handle_or_the_outline_under_it():
    tools = [BOX, LINE, SPOT]
    assert hit(tools, (203, 158), 8) == Hit(0, (1, 1))
    assert hit(tools, (203, 98), 8) == Hit(0, (1, 0))  # a corner that no point is at: u of the second, v of the first
    assert hit(tools, (150, 163), 8) == Hit(0, None)
    assert hit(tools, (150, 130), 8) is None  # inside: there a new tool is drawn
    assert hit(tools, (350, 154), 8) == Hit(1, None)
    assert hit(tools, (45, 52), 8) == Hit(2, (0, 0))
    assert hit([], (45, 52), 8) is None


def test_the_chosen_tools_handles_come_first():
    tools = [BOX, ("SPOT", [(104.0, 100.0)])]
    assert hit(tools, (103, 100), 8) == Hit(1, (0, 0))
    assert hit(tools, (103, 100), 8, chosen=0) == Hit(0, (0, 0))


def test_outlines_go_around_what_is_measured():
    assert outline(*BOX) == [(100.0, 100.0), (200.0, 100.0), (200.0, 160.0), (100.0, 160.0)]
    ellipse = np.array(outline("ELLIPSE", BOX[1]))
    np.testing.assert_allclose(((ellipse - (150, 130)) / (50, 30)) ** 2 @ (1, 1), 1.0)
    assert outline(*LINE) == LINE[1] and len(handles("POLYGON", 5)) == 5
