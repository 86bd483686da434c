# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of temperatures and mixed materials in Blender's interface: what the operators set, tell and show."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.ui.image_lookup import lookup_text  # noqa: E402
from tests.helpers.blender import cube_mesh, link, material  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
operators = bpy.ops.infrared


@pytest.fixture
def image():
    """A float image of 290 to 320 K."""
    made = bpy.data.images.new("Heat", 2, 2, float_buffer=True)
    made.pixels.foreach_set(np.repeat(np.float32([290.0, 300.0, 310.0, 320.0]), 4))
    return made


@pytest.fixture
def cube():
    """The active object, and its material in the panel."""
    obj = link("Cube", cube_mesh(), temperature=300.0)
    obj.data.materials.append(material("Steel", emissivity=0.3))
    material("Rust", emissivity=0.8)
    bpy.context.view_layer.objects.active = obj
    with bpy.context.temp_override(material=obj.active_material, object=obj):
        yield obj


def set_properties(block):
    """Its custom properties but for what it had."""
    return {key: getattr(value, "to_list", lambda value=value: value)() for key, value in block.items()}


def test_an_image_of_temperatures_is_set(cube, image):
    assert operators.temperature_image(image="Heat") == {"FINISHED"}
    assert set_properties(cube) == {"temperature": 300.0, "temperature_image": image}
    operators.temperature_image(
        image="Heat", use_range=True, low=280.0, high=380.0, interpolation="Closest", extension="CLIP"
    )
    assert cube["temperature_range"].to_list() == [280.0, 380.0]
    assert cube["temperature_interpolation"] == "Closest" and cube["temperature_extension"] == "CLIP"
    assert lookup_text(cube, "temperature", image) == "Heat (Closest, Clip)"
    operators.temperature_image(image="Heat")  # all as usual again
    assert set_properties(cube) == {"temperature": 300.0, "temperature_image": image}
    assert lookup_text(cube, "temperature", image) == "Heat"
    operators.property_remove(owner="OBJECT", key="temperature_image")
    assert "temperature_image" not in cube


def test_an_image_that_is_not_there_is_refused(cube):
    with pytest.raises(RuntimeError, match="There is no image 'Day'"):
        operators.temperature_image(image="Day")
    with pytest.raises(RuntimeError, match="There is no image 'Mask'"):
        operators.material_mix(material="Rust", source="IMAGE", image="Mask")
    assert "temperature_image" not in cube and "mix" not in cube.active_material


def test_an_image_of_no_temperatures_is_set_and_told(cube, capfd):
    bpy.data.images.new("Photo", 2, 2)
    assert operators.temperature_image(image="Photo") == {"FINISHED"}
    assert cube["temperature_image"].name == "Photo"
    assert "Image 'Photo' has 8 bits and holds no kelvin" in "".join(capfd.readouterr())


def test_a_light_takes_no_image(image):
    bpy.context.view_layer.objects.active = link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    with pytest.raises(RuntimeError, match="no editable object with a surface"):
        operators.temperature_image(image="Heat")


def test_a_material_is_mixed(cube, image):
    steel, rust = cube.active_material, bpy.data.materials["Rust"]
    operators.material_mix(material="Rust", source="NUMBER", share=0.25)
    assert set_properties(steel) == {"emissivity": 0.3, "mix": 0.25, "mix_material": rust}
    assert "other material" in steel.id_properties_ui("mix").as_dict()["description"]
    operators.material_mix(material="Rust", source="ATTRIBUTE", attribute="wet")
    assert set_properties(steel) == {"emissivity": 0.3, "mix": "wet", "mix_material": rust}
    operators.material_mix(material="Rust", source="IMAGE", image="Heat", extension="MIRROR")
    assert set_properties(steel) == {
        "emissivity": 0.3, "mix": image, "mix_material": rust, "mix_extension": "MIRROR"
    }  # fmt: skip
    operators.material_mix(material="Rust", source="IMAGE", image="Heat", channel="Alpha")
    assert set_properties(steel) == {"emissivity": 0.3, "mix": image, "mix_material": rust, "mix_channel": "Alpha"}
    operators.property_remove(owner="MATERIAL", key="mix")
    operators.property_remove(owner="MATERIAL", key="mix_material")
    assert "mix" not in steel and "mix_material" not in steel


def test_what_a_mix_lacks_is_told(cube, capfd):
    with pytest.raises(RuntimeError, match="There is no material 'Gold'"):
        operators.material_mix(material="Gold")
    assert operators.material_mix(material="Steel") == {"FINISHED"}
    assert "'Steel': mix_material is the material itself; mix is left out" in "".join(capfd.readouterr())


def test_a_transmittance_is_set(cube):
    steel = cube.active_material
    operators.property_add(owner="MATERIAL", key="transmittance")
    assert steel["transmittance"] == 0.0
    steel["transmittance"] = [8.0, 0.1, 12.0, 0.4]  # it may become a list
    operators.property_remove(owner="MATERIAL", key="transmittance")
    assert "transmittance" not in steel
