# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures in a real Blender's window: the heat map's colours on the screen, and undo."""

import numpy as np
import pytest

from addon.output.palette import display, thermal
from tests.helpers.real_blender import blender, facts, module, needs_real_blender

pytestmark = needs_real_blender


@pytest.fixture(scope="module")
def told():
    """What the script found out."""
    text = blender("--factory-startup", *module("temperatures"), window=True)
    return facts(text)


def test_the_screen_shows_the_palettes_colours(told):
    colours = display(thermal(np.array([280.0, 301.0, 320.0]), 280.0, 320.0)).astype(int)
    found = np.array([told[name] for name in ("Cold", "Middle", "Hot")])
    assert np.abs(found - colours).max() <= 1, found  # both round to 8 bits


def test_what_is_written_can_be_undone_and_redone(told):
    assert [told[key] for key in ("written", "undone", "redone")] == [True, False, True]


def test_the_heat_map_leaves_no_trace(told):
    assert told["end"] and told["same as before"], told["before"]
