# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures of all tests. Those in a module with `bpy` start with Blender reset; the solver's tests run without it."""

from __future__ import annotations

import hypothesis
import pytest

# Files in the order in which they start; all others follow. First comes what takes longest in one process and compiles
# kernels of its own, then what compiles those of most renders, for two minutes. Beside it run files that render next to
# nothing: others would compile the same kernels too. For the same reason the tests' path tracer comes before the files
# that compare with it.
ORDER = (
    {"test_real_blender.py"},
    {"test_adaptive_bands_blender.py"},
    {
        "test_gas_panels.py",
        "test_hair_blender.py",
        "test_heat_display.py",
        "test_pairs.py",
        "test_preferences.py",
        "test_scene_reader.py",
        "test_shader_proposals.py",
        "test_shaders.py",
        "test_startup.py",
        "test_texture_reading.py",
    },
    {"test_path_tracer.py"},
)


def place(name):
    """Where a file comes in the order of all: the lowest numbers first."""
    return next((number for number, names in enumerate(ORDER) if name in names), len(ORDER))


def pytest_addoption(parser):
    parser.addoption("--long", action="store_true", help="run the long tests, too")


def pytest_configure(config):
    config.option.loadscopereorder = False  # files that share processes start in the order set below
    # of test_properties.py, whose examples render for longer than hypothesis expects; the same in every run
    hypothesis.settings.register_profile(
        "enclosures",
        max_examples=60 if config.getoption("--long") else 6,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )


def pytest_collection_modifyitems(config, items):
    items.sort(key=lambda item: place(item.path.name))
    if not config.getoption("--long"):
        long = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


@pytest.fixture(autouse=True, scope="module")
def reset_preferences(request):
    """Modules with `bpy` start with Blender's own preferences and add-ons. To load these anew takes five times as long
    as an empty file, which is all that nearly all tests need."""
    if hasattr(request.module, "bpy"):
        import bpy

        bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture(autouse=True)
def reset_blender(request):
    """Every test of a module with `bpy` starts from an empty file with the add-on registered."""
    if not hasattr(request.module, "bpy"):
        yield
        return
    import bpy

    import addon

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    addon.register()
    yield
    addon.unregister()
