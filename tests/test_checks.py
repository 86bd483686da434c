# SPDX-License-Identifier: GPL-3.0-or-later
"""The Checks panel says what stops a render, in the render's words, and never makes drawing slow."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.properties import add_custom_property  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.ui import checks, panels  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material  # noqa: E402


@pytest.fixture
def infrared(reset_blender):
    """The settings of a scene of which nothing is to be said: a cube, a lamp, surroundings and a camera."""
    camera()
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.materials.append(material(emissivity=0.9))
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"), temperature=3000.0)
    bpy.context.scene.world = bpy.data.worlds.new("Night")
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    assert found("ERROR") == []
    return bpy.context.scene.infrared


def found(level):
    """Texts of a level in the panel."""
    bpy.context.view_layer.update()
    every = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in every if check.level == level]


def use_two_temperatures_in_a_group():
    bpy.context.scene.infrared.group_exr_path = "/tmp/never_written.exr"
    bpy.data.objects["Cube"]["temperature_group"] = "Walls"
    link("Other", bpy.data.objects["Cube"].data, temperature=310.0, temperature_group="Walls")


def hide_collection():
    things = bpy.data.collections.new("Things")
    bpy.context.scene.collection.children.link(things)
    cube = bpy.data.objects["Cube"]
    things.objects.link(cube)
    bpy.context.scene.collection.objects.unlink(cube)
    things.hide_render = True


def instance_something_cold():
    things = bpy.data.collections.new("Things")
    link("Cold", cube_mesh(), things, temperature=-3.0)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", things


def use_long_band_names():
    settings = bpy.context.scene.infrared
    settings.band_mode, settings.band_edges = "CUSTOM", "1e-40, 2e-40, 1"


def set_value(name, value):
    """A function that changes a setting."""
    return lambda: setattr(bpy.context.scene.infrared, name, value)


DAMAGE = {
    "stop": (
        set_value("passes", 0),
        "Panel 'Photons': Nothing stops this render: set Passes, Time Limit or",
    ),
    "ambient": (set_value("ambient_temperature", -5.0), "Panel 'Where Nothing Is Set': temperature -5 K"),
    "default": (
        set_value("default_emissivity", 2.0),
        "Panel 'Where Nothing Is Set': emissivity 2 is outside 0..1",
    ),
    "assumed": (set_value("assumed_emissivity", 0.0), "Panel 'Spectrum > Object Parameters': Assumed Emissivity is 0,"),
    "reflected": (
        set_value("reflected_temperature", -1.0),
        "Panel 'Spectrum > Object Parameters': Reflected Temperature: temperature -1 K;",
    ),
    "unsaved": (set_value("band_exr_path", "//bands.exr"), "Save the file first: '//bands.exr'"),
    "names": (use_long_band_names, "characters"),
    "light": (lambda: setattr(bpy.data.lights["Lamp"], "energy", -5.0), "Light 'Lamp': energy -5 W"),
    "lamp": (lambda: bpy.data.objects["Lamp"].__setitem__("temperature", -2.0), "Light 'Lamp': temperature -2 K"),
    "world": (
        lambda: bpy.data.worlds["Night"].__setitem__("temperature", "cold"),
        "World 'Night': temperature is 'cold', expected a number in kelvin",
    ),
    "group": (use_two_temperatures_in_a_group, "are in the temperature group 'Walls'; a group has one temperature"),
    "camera": (lambda: setattr(bpy.context.scene, "camera", None), "The scene has no camera"),
    "hidden": (
        lambda: setattr(bpy.data.objects["Cube"], "hide_render", True),
        "nothing to render: no visible object has faces",
    ),
    "collection": (hide_collection, "nothing to render: no visible object has faces"),
    "instance": (instance_something_cold, "Object 'Cold': temperature -3 K"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_what_stops_the_render_is_told_in_its_words(infrared, name):
    damage, message = DAMAGE[name]
    damage()
    texts = found("ERROR")
    assert len(texts) == 1 and message in texts[0], texts
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.render.render()
    if name != "camera":  # of which Blender speaks before the engine does
        assert texts[0] in str(caught.value)


def test_each_object_of_a_shared_mesh_is_named(infrared):
    mesh = bpy.data.objects["Cube"].data
    mesh.attributes.new("temperature", "FLOAT", "POINT").data.foreach_set("value", np.full(8, -7.0, np.float32))
    link("Twin", mesh)
    expected = [f"Attribute 'temperature' of object '{name}': temperature -7 K" for name in ("Cube", "Twin")]
    assert [text.partition(";")[0] for text in found("ERROR")] == expected


def test_an_attribute_that_does_not_count_leaves_the_property_to_be_checked(infrared):
    cube = bpy.data.objects["Cube"]
    cube.data.attributes.new("temperature", "INT", "POINT")
    cube["temperature"] = -1.0
    [text] = found("ERROR")
    assert "Object 'Cube': temperature -1 K" in text


# Drawing


def looker(times):
    """A function that counts its calls in the list."""
    return lambda: times.append(1) or len(times)


def test_what_is_slow_is_kept_until_something_changes(infrared, monkeypatch):
    monkeypatch.setattr(checks, "SLOW", -1.0)
    scene, times = bpy.context.scene, []
    assert [checks.kept(scene, "test", looker(times)) for _ in range(3)] == [1, 1, 1]
    bpy.data.objects["Cube"].location.x += 1.0
    bpy.context.view_layer.update()
    assert [checks.kept(scene, "test", looker(times)) for _ in range(2)] == [2, 2]
    scene.frame_set(scene.frame_current + 1)
    assert [checks.kept(scene, "test", looker(times)) for _ in range(2)] == [3, 3]
    for event in ("load_post", "undo_post", "redo_post"):
        assert checks.forget in getattr(bpy.app.handlers, event)


def test_what_is_quick_is_always_looked_at(infrared, monkeypatch):
    monkeypatch.setattr(checks, "SLOW", 60.0)
    times = []
    assert [checks.kept(bpy.context.scene, "test", looker(times)) for _ in range(3)] == [1, 2, 3]


# Units


def without_a_value(monkeypatch, panel, **context):
    """What a panel says of a temperature that is not set."""
    shown = {}
    monkeypatch.setattr(panels, "draw_custom_property", lambda *args: shown.update({args[3]: args[4]}))
    monkeypatch.setattr(panels, "draw_object_checks", lambda *_: None)  # which need a window

    class Layout:
        def __getattr__(self, _name):
            return lambda *_, **__: Layout()

    stand_in = SimpleNamespace(layout=Layout(), column=Layout)
    panel.draw(stand_in, SimpleNamespace(scene=bpy.context.scene, **context))
    return shown["temperature"]


def test_what_counts_without_a_temperature_is_told_in_the_scenes_unit(infrared, monkeypatch):
    bpy.context.scene.unit_settings.temperature_unit = "CELSIUS"
    text = without_a_value(monkeypatch, panels.INFRARED_PT_world, world=bpy.context.scene.world)
    assert text == "-273.15 °C (no radiation)"
    lamp = bpy.data.objects["Lamp"]
    for kind, kelvin in (("POINT", 2856.0), ("SUN", 5772.0)):
        lamp.data.type = kind
        text = without_a_value(monkeypatch, panels.INFRARED_PT_light, light=lamp.data, object=lamp)
        assert text == f"{kelvin - 273.15:.2f} °C (default)"


def test_a_temperature_that_a_script_has_set_is_shown_with_its_unit(infrared):
    cube = bpy.data.objects["Cube"]
    for value, label in ((300.0, "Temperature (K)"), (300, "Temperature (K)"), ("hot", "Temperature")):
        cube["temperature"] = value
        assert panels.shown_label(cube, "temperature") == label
    add_custom_property(cube, "temperature", 300.0)
    assert panels.shown_label(cube, "temperature") == "Temperature"


def test_only_objects_with_a_surface_are_told_of_the_attribute(infrared):
    for owner, told in (
        (bpy.data.objects["Cube"], True),
        (bpy.data.objects["Lamp"], False),
        (bpy.data.worlds[0], False),
    ):
        add_custom_property(owner, "temperature", 300.0)
        description = owner.id_properties_ui("temperature").as_dict()["description"]
        assert description.startswith("Temperature in kelvin") and ("mesh attribute" in description) == told
