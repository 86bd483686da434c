# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's settings ask for and the engine does not do: render and Checks panel name the object and say so."""

import re

import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.visibility import RAYS  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402


@pytest.fixture
def cube(reset_blender):
    """A scene of which nothing is to be said, with a cube and a lamp."""
    camera()
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.materials.append(material(emissivity=0.9))
    link("Lamp", bpy.data.lights.new("Lamp", "AREA"), temperature=3000.0)
    bpy.context.scene.world = bpy.data.worlds.new("Night")
    bpy.context.scene.world["temperature"] = 0.0
    return cube


def told():
    """The render's warnings, and those of the panel without its objects' types."""
    bpy.context.view_layer.update()
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert {check.level for check in found} <= {"WARNING"}
    return read()[1], [check.text.partition(" ")[2] for check in found]


def test_usual_settings_are_not_mentioned(cube):
    assert told() == ([], [])


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("is_shadow_catcher", True, "shadow catcher is ignored"),
        ("visible_transmission", False, "ray visibility is ignored for transmission; diffuse, glossy, camera and"),
        ("visible_volume_scatter", False, "ray visibility is ignored for volume scatter"),
    ],
)
def test_settings_of_objects_that_are_ignored_are_named(cube, name, value, message):
    setattr(cube, name, value)
    check_told("Cube", message)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("color", (1.0, 0.5, 0.5), "the light's color is ignored"),
        ("use_temperature", True, "the light's color is ignored"),
        ("spread", 0.0, "spread of 0 degrees is too narrow; it spreads by 1 degree"),
        ("use_shadow", False, "casts no shadow is ignored"),
    ],
)
def test_settings_of_lights_that_are_ignored_are_named(cube, name, value, message):
    lamp = bpy.data.lights["Lamp"]
    if not hasattr(lamp, name):
        pytest.skip(f"this Blender's lights have no {name}")
    setattr(lamp, name, value)
    check_told("Lamp", message)


@pytest.mark.parametrize("owner", ["Cube", "Lamp"])
@pytest.mark.parametrize("kind", ["receiver", "blocker"])
def test_light_linking_is_named(cube, owner, kind):
    setattr(bpy.data.objects[owner].light_linking, f"{kind}_collection", bpy.data.collections.new("Some"))
    check_told(owner, "light linking is ignored")


def test_samples_of_a_view_layer_are_named(cube):
    bpy.context.view_layer.samples = 8
    (found,) = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert read()[1] == [found.text] and found.level == "WARNING"
    assert found.text.startswith("View layer 'ViewLayer': its 8 samples are ignored")


@pytest.mark.parametrize("name", ["is_holdout", *(f"visible_{ray}" for ray in RAYS)])
def test_what_is_followed_is_not_mentioned_but_for_gas(cube, name):
    setattr(cube, name, not getattr(cube, name))
    assert told() == ([], [])
    cube.data.materials[0]["absorption"] = 0.5
    link("Floor", cube_mesh(), temperature=300.0).data.materials.append(material(emissivity=0.9))
    check_told("Cube", "gas cannot be hidden or held out")


def test_instances_are_named_once(cube):
    cube.visible_transmission = False
    things = bpy.data.collections.new("Things")
    things.objects.link(cube)
    for place in range(3):
        empty = link(f"Instance {place}")
        empty.instance_type, empty.instance_collection = "COLLECTION", things
    check_told("Cube", "ignored for transmission")


def check_told(owner, message):
    """That the render and the panel say the same, once, of this object alone."""
    warnings, checks = told()
    assert len(warnings) == 1 and warnings == checks, (warnings, checks)
    assert re.match(f"'{owner}': .*{message}", warnings[0]), warnings
