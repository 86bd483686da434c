# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies of Blender's worlds: lists over the zenith angle, tables, images; what is refused, and what else uses them."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.world import air_temperature, unset_surroundings, world_temperature  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, read  # noqa: E402


@pytest.fixture(autouse=True)
def world(reset_blender):
    camera()
    link("Cube", cube_mesh(), temperature=300.0)
    found = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    return found


def image_of(kelvin, name="Skies", is_float=True):
    """An image whose first channel holds these values (height, width), row 0 at the bottom."""
    height, width = kelvin.shape
    image = bpy.data.images.new(name, width, height, float_buffer=is_float)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[:, :, 0] = kelvin
    image.pixels.foreach_set(pixels.ravel())
    return image


def test_a_list_over_the_zenith_angle(world):
    world["temperature"] = [0.0, 230.0, 60.0, 250.0, 90.0, 285.0]
    sky = read()[0].sky
    np.testing.assert_array_equal(sky.zenith, (0.0, 60.0, 90.0))
    np.testing.assert_array_equal(sky.kelvin, (230.0, 250.0, 285.0))
    assert air_temperature(world) == 285.0 and not unset_surroundings(world)
    assert world_temperature(world) == pytest.approx(sky.mean_temperature)


def test_a_number_is_no_sky(world):
    world["temperature"] = 255.0
    scene = read()[0]
    assert scene.sky is None and scene.world_temperature == 255.0 and air_temperature(world) == 255.0


def test_an_image_wins(world):
    world["temperature"] = 255.0
    kelvin = np.linspace(240.0, 300.0, 32, dtype=np.float32).reshape(4, 8)
    world["temperature_image"] = image_of(kelvin)
    np.testing.assert_array_equal(read()[0].sky.kelvin, kelvin)
    assert air_temperature(world) == pytest.approx(kelvin[1:3].mean())


def test_a_range_maps_bytes(world):
    world["temperature_image"] = image_of(np.array([[0.0, 0.2], [0.6, 1.0]]), is_float=False)
    with pytest.raises(SceneError, match="World 'Sky': Image 'Skies' has 8 bits and holds no kelvin"):
        read()
    world["temperature_range"] = [250.0, 300.0]
    np.testing.assert_allclose(read()[0].sky.kelvin, [[250.0, 260.0], [280.0, 300.0]], atol=0.1)


def test_a_table_over_zenith_angle_and_wavelength(world):
    world["temperature_table"] = {
        "zenith": [0.0, 90.0], "wavelength": [8.0, 10.0, 12.0], "kelvin": [250.0, 230.0, 240.0, 285.0, 280.0, 282.0],
    }  # fmt: skip
    sky = read()[0].sky
    np.testing.assert_array_equal(sky.kelvin, [[250.0, 230.0, 240.0], [285.0, 280.0, 282.0]])
    assert air_temperature(world) == pytest.approx(847.0 / 3.0)


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("temperature", [0.0, 230.0, 60.0], "World 'Sky': temperature has 3 numbers, expected pairs"),
        ("temperature", "blue", "World 'Sky': temperature is 'blue'"),
        ("temperature", [0.0, -5.0, 90.0, 280.0], "World 'Sky', sky: temperature -5 K"),
        (
            "temperature",
            [60.0, 250.0, 30.0, 280.0],
            "World 'Sky': temperature: zenith angles must increase, but 60 is followed by 30",
        ),
        ("temperature_table", {"zenith": [0.0]}, "expected lists named zenith, wavelength, kelvin"),
        (
            "temperature_table",
            {"zenith": "a", "wavelength": [8.0], "kelvin": [250.0]},
            "expected numbers in the lists zenith, wavelength, kelvin",
        ),
        (
            "temperature_table",
            {"zenith": [0.0, 90.0], "wavelength": [8.0, 9.0], "kelvin": [250.0, 260.0, 270.0]},
            "has 3 temperatures, expected 2 zenith angles times 2 wavelengths",
        ),
        ("temperature_image", "a name", "temperature_image is 'a name', expected an image"),
    ],
)
def test_nonsense_is_refused_by_name(world, key, value, message):
    world[key] = value
    with pytest.raises(SceneError, match=message):
        read()
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert any(check.level == "ERROR" and "World 'Sky'" in check.text for check in scene_checks(scene, layer))


def test_images_without_pixels_and_sequences_are_refused(world):
    image = world["temperature_image"] = bpy.data.images.new("Gone", 2, 2)
    image.source, image.filepath = "FILE", "//is_not_there.exr"
    with pytest.raises(SceneError, match="Image 'Gone' has no pixels"):
        read()
    image.source = "SEQUENCE"
    with pytest.raises(SceneError, match="Image 'Gone': sequence images cannot be read"):
        read()


def test_the_operator_sets_an_image(world):
    image_of(np.full((2, 4), 250.0, np.float32) + np.arange(4), "Night")
    assert bpy.ops.infrared.sky_image(image="Night") == {"FINISHED"}
    assert read()[0].sky.kelvin.shape == (2, 4)
    with pytest.raises(RuntimeError, match="There is no image 'Day'"):
        bpy.ops.infrared.sky_image(image="Day")


def test_a_group_takes_no_sky(world):
    world["temperature"], world["temperature_group"] = [0.0, 230.0, 90.0, 285.0], "sky"
    bpy.context.scene.infrared.group_exr_path = "//groups.exr"
    with pytest.raises(SceneError, match="World 'Sky': a temperature that depends on the direction is in no group"):
        read()
