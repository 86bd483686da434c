# SPDX-License-Identifier: GPL-3.0-or-later
"""Clear Sky from Weather... in Blender: what it sets, what it leaves, what it says."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.heat_settings import in_scene_unit  # noqa: E402
from addon.reading.bands import read_band_range  # noqa: E402
from addon.reading.world import read_sky  # noqa: E402
from addon.solver.physics.clear_sky import ZENITH, band_temperatures, clear_sky, sky_emissivity  # noqa: E402
from addon.solver.physics.humidity import dew_point  # noqa: E402
from addon.ui import panels  # noqa: E402
from addon.ui.temperatures.clear_sky import INFRARED_OT_clear_sky, present_text, shown_world  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
operator = bpy.ops.infrared.clear_sky


@pytest.fixture
def world():
    """The scene's world, without a temperature."""
    found = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    return found


def table(world):
    """Zenith angles that a world holds, and the temperatures in its scene's bands, (n,) each."""
    sky = read_sky(world)
    bands = read_band_range(bpy.context.scene.infrared)
    return sky.zenith, band_temperatures((sky.zenith, sky.wavelengths, sky.kelvin), *bands)


def test_temperatures_of_the_bands(world):
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.wavelength_min, infrared.wavelength_max = "UNIFORM", 3.0, 5.0
    assert operator(air=300.0, humidity=40.0, cover=0.25, base=2000.0) == {"FINISHED"}
    zenith, kelvin = table(world)
    np.testing.assert_array_equal(zenith, ZENITH)
    expected = band_temperatures(clear_sky(300.0, dew_point(300.0, 0.4), 0.25, 2000.0), 3.0, 5.0)
    np.testing.assert_allclose(kelvin, expected, rtol=1e-6)  # Blender's fields are float32
    infrared.wavelength_min, infrared.wavelength_max = 8.0, 14.0
    assert operator(air=300.0, humidity=40.0, cover=0.25, base=2000.0, replace=True) == {"FINISHED"}
    assert table(world)[1][0] < kelvin[0] - 1.0


def test_humidity_or_dew_point(world):
    operator(air=290.0, humidity=100.0 * 0.6)
    by_humidity = table(world)[1]
    operator(air=290.0, moisture="DEW_POINT", dew=dew_point(290.0, 0.6), humidity=5.0, replace=True)
    np.testing.assert_allclose(table(world)[1], by_humidity, rtol=1e-5)


@pytest.mark.parametrize("present", [255.0, [0.0, 250.0, 90.0, 280.0], "blue"])
def test_a_temperature_is_only_replaced_if_asked(world, present):
    world["temperature"] = present
    with pytest.raises(RuntimeError, match="World 'Sky' has a temperature already, .*: replace it, or remove it"):
        operator()
    value = world["temperature"]
    assert (value.to_list() if hasattr(value, "to_list") else value) == present and "temperature_table" not in world
    assert operator(replace=True) == {"FINISHED"} and len(table(world)[0]) == len(ZENITH)
    assert "temperature" not in world
    with pytest.raises(RuntimeError, match="already"):
        operator()  # the answer is not kept for the next time


@pytest.mark.parametrize("weather, message", [
    ({"humidity": 0.0}, "Relative humidity 0 %"),
    ({"humidity": 120.0}, "Relative humidity 120 %"),
    ({"air": 280.0, "moisture": "DEW_POINT", "dew": 281.0}, "dew point 281 K above the air temperature 280 K"),
    ({"cover": 1.5}, "cloud cover 1.5; it is 0 to 1"),
    ({"base": -10.0}, "cloud base -10 m"),
    ({"air": 500.0, "moisture": "DEW_POINT"}, "air temperature 500 K; at most"),
])  # fmt: skip
def test_impossible_weather_changes_nothing(world, weather, message):
    with pytest.raises(RuntimeError, match=message):
        operator(**weather)
    assert not list(world.keys())


def test_impossible_bands_change_nothing(world):
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.band_edges = "CUSTOM", "8, much"
    with pytest.raises(RuntimeError, match="Band edges: 'much' is not a number"):
        operator()
    assert not list(world.keys())


def test_one_step_back(world):
    world["temperature"] = 255.0
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    operator("EXEC_DEFAULT", True, replace=True)  # True: as from the interface, with a step of undo
    assert len(table(world)[0]) == len(ZENITH)
    bpy.ops.ed.undo()
    assert bpy.data.worlds["Sky"]["temperature"] == 255.0


def test_where_there_is_no_world_it_cannot_be_called():
    bpy.context.scene.world = None
    assert not operator.poll()


def test_the_world_of_the_view_layer(world):
    other = bpy.context.view_layer.world_override = bpy.data.worlds.new("Other")
    assert shown_world(bpy.context) == other
    with bpy.context.temp_override(world=world):  # that of the panel comes first
        assert operator() == {"FINISHED"}
    assert "temperature_table" in world and not list(other.keys())


class Dialog:
    """Stands in for the operator, for its layout and for the window manager: notes what the dialog shows."""

    weather, outlook = INFRARED_OT_clear_sky.weather, INFRARED_OT_clear_sky.outlook

    def __init__(self, **values):
        weather = {"air": 290.0, "moisture": "HUMIDITY", "humidity": 50.0, "cover": 0.0, "base": 1000.0}
        vars(self).update(weather | values)
        self.layout = self.properties = self
        self.replace, self.fields, self.texts, self.given = False, [], [], values
        parts = SimpleNamespace(scene=bpy.context.scene, view_layer=bpy.context.view_layer, window_manager=self)
        INFRARED_OT_clear_sky.invoke(self, parts, None)
        INFRARED_OT_clear_sky.draw(self, bpy.context)

    def is_property_set(self, name):
        return name in self.given

    def invoke_props_dialog(self, *_, **__):
        pass

    def prop(self, _owner, name, **_):
        self.fields.append(name)

    def label(self, text, **_):
        self.texts.append(text)

    def column(self):
        return self

    row, separator = column, lambda _self: None


def test_the_dialog_shows_what_it_replaces(world):
    scene = bpy.context.scene
    dialog = Dialog(air=290.0)
    assert dialog.fields == ["air", "moisture", "humidity", "cover", "base"] and dialog.replace
    whole = in_scene_unit(290.0 * sky_emissivity(dew_point(290.0, 0.5)) ** 0.25, scene)
    assert dialog.texts == [f"In all as a blackbody of {whole}"]
    assert Dialog().air == scene.infrared.ambient_temperature
    world["temperature"] = 255.0
    assert Dialog().texts[1] == f"Replaces {in_scene_unit(255.0, scene)}"
    world["temperature"] = [0.0, 250.0, 90.0, 280.0]
    assert Dialog().texts[1] == "Replaces [0.0, 250.0, 90.0, 280.0]"
    dialog = Dialog(air=290.0, moisture="DEW_POINT", dew=291.0)
    assert "dew" in dialog.fields and "dew point 291 K above the air temperature 290 K" in dialog.texts[0]


def test_text_of_no_temperature(world):
    assert present_text(world, bpy.context.scene) == ""


def test_the_panel_counts_the_numbers(world, monkeypatch):
    """A field for each of them would fill it."""
    texts = []
    monkeypatch.setattr(panels, "draw_text", lambda row, _key, text: texts.append(text) or row)

    class Row:
        def row(self, **_):
            return self

        def operator(self, *_, **__):
            return self

        def prop(self, *_, **__):
            raise AssertionError

    operator()
    panels.draw_sky(Row(), world, "temperature_table")
    world["temperature"] = [0.0, 250.0, 90.0, 280.0]
    panels.draw_custom_property(Row(), world, "WORLD", "temperature", "none")
    assert texts == [f"{len(ZENITH)} angles, 200 wavelengths", "4 numbers"]
