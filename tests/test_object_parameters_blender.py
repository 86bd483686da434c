# SPDX-License-Identifier: GPL-3.0-or-later
"""Object parameters in Blender: where they come from, what a render makes of them, and what is said of bad ones."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.measuring.correcting import Sensor, corrected  # noqa: E402
from addon.measuring.object_parameters import ObjectParameters, camera_air_transmission  # noqa: E402
from addon.reading.object_parameters import PROPERTIES, read_object_parameters  # noqa: E402
from addon.reading.settings import read_settings  # noqa: E402
from addon.rendering.checks import object_parameter_checks, scene_checks  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.solver.physics.spectrum import uniform_edges  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import grey_plate, render_to_exr  # noqa: E402


@pytest.fixture
def infrared(reset_blender):
    return grey_plate()


def test_the_defaults_are_those_of_the_class_and_correct_nothing(infrared):
    assert read_object_parameters(infrared) == ObjectParameters()
    assert read_object_parameters(infrared).correction.share == 1.0
    assert object_parameter_checks(infrared) == []


def test_every_parameter_has_a_field_with_a_tooltip(infrared):
    assert set(PROPERTIES) == set(ObjectParameters.__dataclass_fields__)
    for name in [*PROPERTIES.values(), "air_transmission_source"]:
        assert len(infrared.bl_rna.properties[name].description) > 20


def test_the_airs_transmission_comes_from_where_the_menu_says(infrared):
    infrared.air_transmission, infrared.object_distance, infrared.relative_humidity = 0.7, 50.0, 80.0
    infrared.air_temperature = 303.15
    assert read_settings(infrared).air_transmission == 0.7
    infrared.air_transmission_source = "FORMULA"
    expected = camera_air_transmission(50.0, 303.15, 0.8)
    assert read_settings(infrared).air_transmission == pytest.approx(expected, rel=1e-12)
    [check] = object_parameter_checks(infrared)
    assert check.level == "HINT" and f"lets {expected:.1%} through, but the world has no gas" in check.text
    infrared.air_transmission_source = "WORLD"
    assert read_settings(infrared).air_transmission == 1.0
    [check] = object_parameter_checks(infrared)
    assert check.level == "WARNING" and "the world has no gas" in check.text
    bpy.context.scene.world["absorption"] = 0.01
    settings = read_settings(infrared)
    assert settings.air_transmission == pytest.approx(np.exp(-0.5), rel=1e-6)
    assert settings.air_temperature == 260.0  # that of the gas, not of the field
    assert object_parameter_checks(infrared) == []


def test_a_render_through_air_and_a_window_reads_the_plates_own_temperature(infrared, tmp_path):
    """What stands between is not in the scene; so the temperature of a radiance that went through it is made here."""
    plain = render_to_exr(tmp_path)["ViewLayer"]["Radiance"]
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.8, 260.0
    infrared.optics_transmission, infrared.optics_temperature = 0.9, 310.0
    images = render_to_exr(tmp_path)["ViewLayer"]
    np.testing.assert_array_equal(images["Radiance"], plain)
    parameters = ObjectParameters(0.8, 260.0, optics_transmission=0.9, optics_temperature=310.0)
    expected = corrected(plain, Sensor(uniform_edges(7.5, 14.0, 4), np.ones(4)), parameters.correction)
    np.testing.assert_allclose(images["Temperature"], expected, rtol=0, atol=1e-4)  # float32 of 320 K is 3e-5 K
    [layer] = finished_layers.values()
    facts = layer["metadata"]
    assert (facts["airTransmission"], facts["opticsTransmission"], facts["opticsTemperature"]) == (1.0, 0.9, 310.0)


def test_air_of_the_world_is_corrected_for(infrared, tmp_path):
    """Grey gas at the temperature of the sky between camera and plate: the plate's own temperature comes out.

    The plate's upper side is at z = 0.5; rays start at the camera's clip start. Through a long lens they differ in
    length by less than 0.1 % of the way, and so
    in what the air adds and takes: less than 1e-4 of S(320 K) - S(260 K), 10 mK.
    """
    world, scene = bpy.context.scene.world, bpy.context.scene
    world["absorption"], world["depth"] = 0.02, 0.0
    scene.camera.data.lens = 500.0
    distance = scene.camera.location.z - scene.camera.data.clip_start - 0.5
    infrared.air_transmission_source, infrared.object_distance = "WORLD", distance
    infrared.assumed_emissivity, infrared.reflected_temperature = 0.8, 260.0
    images = render_to_exr(tmp_path)["ViewLayer"]
    through = read_settings(infrared).air_transmission
    print(f"{distance:g} m let {through:.3f} through: {images['Temperature'].mean():.3f} K")
    assert through < 0.95
    np.testing.assert_allclose(images["Temperature"].mean(), 320.0, rtol=0, atol=0.01)


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("air_transmission", 0.0, "Panel 'Spectrum > Object Parameters': Air Transmission is 0, expected above 0 to 1"),
        ("optics_transmission", 1.5, "Panel 'Spectrum > Object Parameters': Optics Transmission is 1.5"),
        ("object_distance", -1.0, r"Panel 'Spectrum > Object Parameters': Distance \(m\) is -1 m"),
        ("relative_humidity", 120.0, "Panel 'Spectrum > Object Parameters': Relative Humidity is 120 %"),
        ("air_temperature", -3.0, "Panel 'Spectrum > Object Parameters': Air Temperature: temperature -3 K"),
    ],
)
def test_a_bad_value_is_named_once_and_stops_the_render(infrared, name, value, message):
    setattr(infrared, name, value)
    with pytest.raises(SceneError, match=message):
        read_settings(infrared)
    checks = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert len([check for check in checks if check.level == "ERROR"]) == 1


def test_gas_that_lets_nothing_through_is_named(infrared):
    bpy.context.scene.world["absorption"] = 1e4
    infrared.air_transmission_source = "WORLD"
    with pytest.raises(SceneError, match="World 'World': its gas lets nothing through over 1 m"):
        read_settings(infrared)
