# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of all tests. Tests that need Blender take `blender`; the solver's tests run without it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

HAS_BLENDER = importlib.util.find_spec("bpy") is not None


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="run the long tests, too (some ten minutes more)")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--long"):
        long = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


@pytest.fixture(autouse=True)
def reset_blender():
    """Every test starts from an empty file with the add-on registered, wherever there is a Blender."""
    if not HAS_BLENDER:
        yield
        return
    import bpy

    import addon

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon.register()
    yield
    addon.unregister()
