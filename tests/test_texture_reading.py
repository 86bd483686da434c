# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of temperatures, mixed materials and thin sheets, as they are read from Blender: exact arrays, and what is
told of what cannot be read."""

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.bands import read_adaptive_bands  # noqa: E402
from addon.reading.materials import read_material  # noqa: E402
from addon.reading.surface_temperature import (  # noqa: E402
    object_temperatures,
    temperature_source,
    vertex_temperatures,
)
from addon.reading.temperature_fields import TemperatureError  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402
from tests.helpers.shaders import shaded, textured  # noqa: E402

KELVIN = np.array([[300.0, 310.0, 320.0], [330.0, 340.0, 350.0]], np.float32)  # row 0 is at the bottom
SHARES = np.array([[0.0, 0.25], [0.5, 1.0]], np.float32)
CORNERS = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.5], [0.0, 0.5]], np.float32)  # texture coordinates of the square


@pytest.fixture(autouse=True)
def viewed(reset_blender):
    camera()


def square(name="Square", uv=CORNERS):
    """A mesh of one quad, which becomes two triangles, with a UV map, or None."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    if uv is not None:
        mesh.uv_layers.new(name="Map").uv.foreach_set("vector", np.asarray(uv, np.float32).ravel())
    return mesh


def image_of(values, name="Heat", is_float=True, space="Non-Color"):
    """An image whose first channel holds these values (height, width), row 0 at the bottom. The others differ."""
    height, width = np.shape(values)
    image = bpy.data.images.new(name, width, height, float_buffer=is_float)
    image.colorspace_settings.name = space
    pixels = np.full((height, width, 4), 0.75, np.float32)
    pixels[:, :, 0] = values
    image.pixels.foreach_set(pixels.ravel())
    return image


def attribute(mesh, name, values, kind="FLOAT", domain="POINT"):
    added = mesh.attributes.new(name, kind, domain)
    added.data.foreach_set("color" if kind == "FLOAT_COLOR" else "value", values)
    return added


def told(warnings, *parts):
    """Whether one of the warnings holds all of these texts."""
    return any(all(part in warning for part in parts) for warning in warnings)


@pytest.fixture
def warm():
    """An object with an image of temperatures."""
    return link("Wall", square(), temperature=290.0, temperature_image=image_of(KELVIN))


@pytest.fixture
def mixed():
    """An object whose material is mixed with another by a number."""
    mesh = square()
    mesh.materials.append(material("Leaf", emissivity=0.95, mix_material=material("Rust", emissivity=0.6), mix=0.3))
    return link("Card", mesh, temperature=290.0)


# Temperatures ---------------------------------------------------------------------------------------------------------


def test_an_image_of_temperatures(warm):
    scene, warnings = read()
    textures = scene.textures
    assert warnings == ["'Wall': faces without a material, using the default emissivity 0.95"]
    assert textures.triangle.tolist() == [0, 1] and textures.triangle.dtype == np.int32
    assert textures.temperature_image.tolist() == [0, 0]
    assert textures.mixed.tolist() == textures.share_image.tolist() == [-1, -1]
    at = {tuple(vertex): corner.tolist() for vertex, corner in zip(scene.vertices, CORNERS, strict=True)}
    expected = [[at[tuple(scene.vertices[corner])] for corner in corners] for corners in scene.triangles]
    assert textures.uv.tolist() == expected and textures.uv.dtype == np.float32
    (image,) = textures.images
    np.testing.assert_array_equal(image.values, KELVIN)
    assert image.values.dtype == np.float32 and image.extension == "REPEAT" and not image.closest
    assert scene.temperature.tolist() == [290.0, 290.0]


def test_the_image_wins_over_the_attribute(warm):
    attribute(warm.data, "temperature", [280.0] * 4)
    textures = read()[0].textures
    assert textures.temperature_image.tolist() == [0, 0]
    assert textures.images[0].values.min() == 300.0


def test_without_anything_that_varies_there_are_no_textures():
    link("Wall", square(), temperature=290.0)
    assert read()[0].textures is None


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest", "closest"])
def test_how_an_image_is_looked_up(warm, extension, interpolation):
    warm["temperature_extension"], warm["temperature_interpolation"] = extension, interpolation
    (image,) = read()[0].textures.images
    assert image.extension == extension and image.closest == (interpolation != "Linear")


def test_what_is_no_way_to_look_an_image_up_is_told(warm):
    warm["temperature_extension"], warm["temperature_interpolation"] = "TILE", 3
    scene, warnings = read()
    (image,) = scene.textures.images
    assert image.extension == "REPEAT" and not image.closest
    assert told(warnings, "'Wall': temperature_extension is 'TILE', expected REPEAT, EXTEND, CLIP or MIRROR; REPEAT")
    assert told(warnings, "'Wall': temperature_interpolation is 3, expected Linear or Closest; Linear counts")


@pytest.mark.parametrize("is_float, tolerance", [(True, 0.0), (False, 0.5 / 255)])  # 8 bits are rounded
def test_a_range_says_what_0_and_1_are(warm, is_float, tolerance):
    warm["temperature_image"] = image_of(SHARES, "Shares", is_float)
    warm["temperature_range"] = [280.0, 380.0]
    (image,) = read()[0].textures.images
    np.testing.assert_allclose(image.values, 280.0 + 100.0 * SHARES, rtol=1e-6, atol=100.0 * tolerance)


@pytest.mark.parametrize(
    "values, is_float, span, message",
    [
        (SHARES, False, None, "Object 'Wall': Image 'Bad' has 8 bits and holds no kelvin"),
        (SHARES, True, None, "Object 'Wall': Image 'Bad' has values from .* to .*, which are no kelvin"),  # 16 bits
        (KELVIN - 400.0, True, None, "Object 'Wall': Image 'Bad': temperature -100 K"),
        ([[math.nan, 300.0]], True, None, "Object 'Wall': Image 'Bad': temperature nan K"),
        (SHARES, True, [300.0], "Object 'Wall': temperature_range is"),
    ],
)
def test_an_image_of_no_temperatures_is_refused(warm, values, is_float, span, message):
    warm["temperature_image"] = image_of(values, "Bad", is_float)
    if span:
        warm["temperature_range"] = span
    with pytest.raises(SceneError, match=message):
        read()


def test_what_is_no_image_is_refused(warm):
    warm["temperature_image"] = "Heat"
    with pytest.raises(SceneError, match="Object 'Wall': temperature_image is 'Heat', expected an image"):
        read()


@pytest.mark.parametrize("source", ["TILED", "SEQUENCE", "MOVIE"])
def test_images_that_are_not_one_are_told(warm, source):
    warm["temperature_image"].source = source
    scene, warnings = read()
    assert scene.textures is None and scene.temperature.tolist() == [290.0, 290.0]
    assert told(
        warnings, f"'Wall': Image 'Heat': {source.lower()} images cannot be read", "; the object's own temperature"
    )


def test_an_image_without_pixels_is_told(warm):
    image = warm["temperature_image"] = bpy.data.images.new("Gone", 2, 2)
    image.source, image.filepath = "FILE", "//is_not_there.exr"
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, "'Wall': Image 'Gone' has no pixels", "; the object's own temperature counts")


def test_an_image_whose_values_blender_alters_is_told(warm):
    warm["temperature_image"] = image_of(KELVIN, "Graded", space="ACEScg")
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, "'Wall': Image 'Graded': its color space ACEScg alters", "; the object's own temperature")


def test_an_image_with_a_color_space_is_told(warm):
    warm["temperature_image"] = image_of(SHARES, "Photo", is_float=False, space="sRGB")
    warm["temperature_range"] = [280.0, 380.0]
    scene, warnings = read()
    assert told(warnings, "'Wall': Image 'Photo': its color space sRGB does not count; its values are taken as they")
    assert scene.textures.images[0].values[1, 0] == pytest.approx(330.0, abs=100.0 / 255)  # not 280 + 100 * 0.214


@pytest.mark.parametrize(
    "uv, problem",
    [(None, "the mesh has no UV map"), (CORNERS * math.nan, "the UV map 'Map' has coordinates that are not finite")],
)
def test_a_mesh_without_texture_coordinates_is_told(warm, uv, problem):
    warm.data = square("Other", uv)
    del warm["temperature"]
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, f"'Wall': temperature_image: {problem}; the object's own temperature counts")
    assert told(warnings, "'Wall': no temperature; the ambient")


@pytest.mark.parametrize("extension, counts", [("CLIP", True), ("REPEAT", False)])
def test_an_own_temperature_is_missed_only_where_it_counts(warm, extension, counts):
    del warm["temperature"]
    warm["temperature_extension"] = extension
    assert told(read()[1], "'Wall': no temperature; the ambient") == counts


def test_the_uv_map_of_renders_counts(warm):
    layers = warm.data.uv_layers
    layers.new(name="Other").uv.foreach_set("vector", np.full(8, 0.25, np.float32))
    layers.active = layers["Map"]
    layers["Other"].active_render = True
    assert np.unique(read()[0].textures.uv).tolist() == [0.25]


def test_an_image_is_read_once_for_all_that_use_it_alike(warm):
    other = link("Floor", square("Floor"), temperature=300.0, temperature_image=warm["temperature_image"])
    assert len(read()[0].textures.images) == 1
    other["temperature_extension"] = "CLIP"
    textures = read()[0].textures
    assert sorted(image.extension for image in textures.images) == ["CLIP", "REPEAT"]
    assert textures.triangle.tolist() == [0, 1, 2, 3] and len(set(textures.temperature_image.tolist())) == 2


def test_only_what_varies_has_rows(warm):
    link("A Cube", cube_mesh(), temperature=280.0)
    scene, _ = read()
    varies = scene.textures.triangle
    assert len(scene.triangles) == 14 and scene.temperature[varies].tolist() == [290.0, 290.0]
    assert np.delete(scene.temperature, varies).tolist() == [280.0] * 12


def test_instances_have_rows_of_their_own(warm):
    collection = bpy.data.collections.new("Walls")
    collection.objects.link(warm)
    bpy.context.scene.collection.objects.unlink(warm)
    for x in (0.0, 5.0):
        empty = link(f"Empty {x}")
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (x, 0.0, 0.0)
    textures = read()[0].textures
    assert textures.triangle.tolist() == [0, 1, 2, 3] and textures.temperature_image.tolist() == [0] * 4
    np.testing.assert_array_equal(textures.uv[:2], textures.uv[2:])


def test_a_mesh_serves_objects_with_and_without_an_image(warm):
    link("A Bare One", warm.data, temperature=250.0)
    link("Z Bare One", warm.data, temperature=250.0)
    scene, _ = read()
    assert scene.temperature[scene.textures.triangle].tolist() == [290.0, 290.0]


def test_a_mirrored_object_has_its_corners_reversed(warm):
    attribute(warm.data, "wet", [0.0, 0.1, 0.2, 0.3])
    warm.data.materials.append(material("Leaf", mix="wet", mix_material=material("Water")))
    scene = read()[0]
    before = {tuple(map(tuple, scene.vertices[corners])): row for corners, row in rows_by_corners(scene)}
    warm.scale = (1.0, 1.0, -1.0)
    scene = read()[0]
    for corners, (uv, share) in rows_by_corners(scene):
        uv_before, share_before = before[tuple(map(tuple, scene.vertices[corners[::-1]]))]
        np.testing.assert_array_equal(uv, uv_before[::-1])
        np.testing.assert_array_equal(share, share_before[::-1])


def rows_by_corners(scene):
    textures = scene.textures
    return zip(scene.triangles, zip(textures.uv, textures.share, strict=True), strict=True)


@pytest.mark.parametrize("values", [KELVIN, np.full((2, 2), 290.0)])
def test_a_group_takes_no_image(warm, values):
    warm["temperature_image"], warm["temperature_group"] = image_of(values, "Any"), "Walls"
    read()
    bpy.context.scene.infrared.group_exr_path = "//groups.exr"
    with pytest.raises(SceneError, match="Object 'Wall': its temperature comes from the image 'Any', but it is in the"):
        read()


# Mixed materials ------------------------------------------------------------------------------------------------------


def test_a_mix_by_a_number_needs_no_texture_coordinates(mixed):
    scene, warnings = read()
    textures = scene.textures
    assert warnings == []
    assert [scene.materials[i].name for i in textures.mixed] == ["Rust", "Rust"]
    assert [scene.materials[i].name for i in scene.material] == ["Leaf", "Leaf"]
    np.testing.assert_array_equal(textures.share, np.full((2, 3), 0.3, np.float32))
    assert textures.temperature_image.tolist() == textures.share_image.tolist() == [-1, -1]
    assert not textures.uv.any() and textures.images == ()


def test_a_mix_of_0_is_none_and_a_mix_of_1_is_all(mixed):
    mixed.data.materials[0]["mix"] = 0
    scene, warnings = read()
    assert scene.textures is None and warnings == []
    mixed.data.materials[0]["mix"] = 1
    assert read()[0].textures.share.tolist() == [[1.0] * 3] * 2


@pytest.mark.parametrize(
    "value, share, words", [(1.5, 1.0, "mix is 1.5"), (-1.0, 0.0, "mix is -1"), (math.nan, 0.0, "no numbers")]
)
def test_a_number_outside_0_to_1_is_told(mixed, value, share, words):
    mixed.data.materials[0]["mix"] = value
    scene, warnings = read()
    assert told(warnings, "'Leaf': mix", words)
    assert scene.textures is None if share == 0.0 else scene.textures.share.tolist() == [[share] * 3] * 2


@pytest.mark.parametrize(
    "domain, values",
    [("POINT", [0.0, 0.1, 0.2, 0.3]), ("CORNER", [0.0, 0.1, 0.2, 0.3]), ("FACE", [0.4])],
)
def test_a_mix_by_an_attribute(mixed, domain, values):
    attribute(mixed.data, "wet", values, domain=domain)
    mixed.data.materials[0]["mix"] = "wet"
    scene, warnings = read()
    assert warnings == []
    by_corner = np.float32(values if len(values) == 4 else values * 4)
    np.testing.assert_array_equal(scene.textures.share, by_corner[scene.triangles])  # the quad's corners are in order
    assert scene.textures.share.dtype == np.float32 and scene.textures.share_image.tolist() == [-1, -1]


@pytest.mark.parametrize(
    "kind, values, described",
    [
        (None, (), "the mesh has no attribute 'wet'"),
        ("BOOLEAN", [True] * 4, "the attribute 'wet' (boolean on points) is no float"),
        ("INT", [1] * 4, "the attribute 'wet' (int on points) is no float"),
        ("FLOAT_COLOR", [0.5] * 16, "the attribute 'wet' (float_color on points) is no float"),
    ],
)
def test_an_attribute_of_another_kind_is_told(mixed, kind, values, described):
    if kind:
        attribute(mixed.data, "wet", values, kind)
    mixed.data.materials[0]["mix"] = "wet"
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, f"'Card': mix of its material 'Leaf': {described}", "; a share of 0 counts")


def test_shares_of_an_attribute_outside_0_to_1_are_told(mixed):
    attribute(mixed.data, "wet", [-1.0, 0.5, 2.0, math.nan])
    mixed.data.materials[0]["mix"] = "wet"
    scene, warnings = read()
    np.testing.assert_array_equal(scene.textures.share, np.float32([0.0, 0.5, 1.0, 0.0])[scene.triangles])
    assert told(warnings, "'Card': the attribute 'wet' runs from -1 to 2; shares are from 0 to 1")
    assert told(warnings, "'Card': the attribute 'wet' holds values that are no numbers")


def test_a_mix_by_an_image(mixed):
    leaf = mixed.data.materials[0]
    leaf["mix"], leaf["mix_extension"], leaf["mix_interpolation"] = image_of(SHARES, "Mask"), "CLIP", "Closest"
    scene, warnings = read()
    textures = scene.textures
    assert warnings == []
    (image,) = textures.images
    np.testing.assert_array_equal(image.values, SHARES)
    assert image.extension == "CLIP" and image.closest
    assert textures.share_image.tolist() == [0, 0] and textures.temperature_image.tolist() == [-1, -1]
    np.testing.assert_array_equal(textures.uv, CORNERS[scene.triangles])


def test_a_mix_by_the_alpha_channel(mixed):
    """As pictures of leaves have it, whatever their colors and color space."""
    leaf, alpha = mixed.data.materials[0], np.linspace(0.0, 1.0, 6, dtype=np.float32)
    image = bpy.data.images.new("Leaf.png", 3, 2, alpha=True, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.column_stack((np.full((6, 3), 0.7), alpha)).astype(np.float32).ravel())
    leaf["mix"], leaf["mix_channel"] = image, "alpha"
    scene, warnings = read()
    np.testing.assert_array_equal(scene.textures.images[0].values, alpha.reshape(2, 3))
    assert warnings == []
    leaf["mix_channel"] = "Inverted Alpha"
    np.testing.assert_allclose(read()[0].textures.images[0].values, 1.0 - alpha.reshape(2, 3), atol=1e-7)
    leaf["mix_channel"] = "Inverted Color"
    assert read()[0].textures.images[0].values == pytest.approx(0.3)
    leaf["mix_channel"] = "Value"
    scene, warnings = read()
    assert scene.textures.images[0].values == pytest.approx(0.7)
    expected = "expected Color, Alpha, Inverted Color or Inverted Alpha; Color counts"
    assert told(warnings, f"'Leaf': mix_channel is 'Value', {expected}")


def test_an_image_that_serves_as_both_is_read_for_each(mixed):
    image = image_of(SHARES, "Both")
    mixed.data.materials[0]["mix"] = mixed["temperature_image"] = image
    mixed["temperature_range"] = [280.0, 380.0]
    textures = read()[0].textures
    of_temperature, of_share = textures.temperature_image[0], textures.share_image[0]
    assert {of_temperature, of_share} == {0, 1}


def test_shares_of_an_image_outside_0_to_1_are_told(mixed):
    mixed.data.materials[0]["mix"] = image_of([[-1.0, 0.5], [2.0, math.nan]], "Mask")
    scene, warnings = read()
    assert scene.textures.images[0].values.tolist() == [[0.0, 0.5], [1.0, 0.0]]
    assert told(warnings, "'Leaf': Image 'Mask' runs from -1 to 2; shares are from 0 to 1")
    assert told(warnings, "'Leaf': Image 'Mask' holds values that are no numbers; a share of 0 counts there")


def test_an_image_of_shares_that_cannot_be_read_is_told(mixed):
    image = mixed.data.materials[0]["mix"] = image_of(SHARES, "Mask")
    image.source = "TILED"
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, "'Leaf': Image 'Mask': tiled images cannot be read", "; a share of 0 counts")


def test_a_mix_by_an_image_without_texture_coordinates_is_told(mixed):
    leaf = mixed.data.materials[0]
    leaf["mix"] = image_of(SHARES, "Mask")
    mixed.data = square("Bare", None)
    mixed.data.materials.append(leaf)
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, "'Card': mix of its material 'Leaf': the mesh has no UV map; a share of 0 counts")


def no_mix(leaf, other):
    """Ways in which a material cannot be mixed, and what is told."""
    smoke = material("Smoke", absorption=1.0)
    return {
        "alone": ({"mix_material": None}, "mix changes nothing without a mix_material"),
        "reverse": ({"mix": None}, "mix_material changes nothing without mix"),
        "name": ({"mix_material": "Rust"}, "mix_material is 'Rust', expected a material"),
        "list": ({"mix": [0.1, 0.2]}, "mix is [0.1, 0.2], expected a number, the name of a mesh attribute or an image"),
        "choice": ({"mix": True}, "mix is True, expected a number"),
        "material": ({"mix": other}, "expected a number"),
        "itself": ({"mix_material": leaf}, "mix_material is the material itself"),
        "gas": ({"mix_material": smoke}, "mix_material 'Smoke' is a gas; mix is left out"),
    }


@pytest.mark.parametrize("case", ["alone", "reverse", "name", "list", "choice", "material", "itself", "gas"])
def test_what_cannot_be_mixed_is_told(mixed, case):
    leaf = mixed.data.materials[0]
    changes, message = no_mix(leaf, leaf["mix_material"])[case]
    for key, value in changes.items():
        del leaf[key]
        if value is not None:
            leaf[key] = value
    scene, warnings = read()
    assert scene.textures is None
    assert told(warnings, "'Leaf': ", message)


def test_a_gas_is_not_mixed():
    smoke = material("Smoke", absorption=1.0, mix=0.5, mix_material=material("Rust"))
    mesh = cube_mesh()
    mesh.materials.append(smoke)
    link("Cloud", mesh, temperature=300.0, temperature_image=image_of(KELVIN))
    link("Wall", square(), temperature=290.0)
    scene, warnings = read()
    assert scene.textures is None and len(scene.media) == 1 and scene.media[0].temperature == 300.0
    assert told(warnings, "'Smoke': a gas is not mixed; mix is left out")
    assert told(warnings, "'Cloud': a gas has one temperature; not that of an image")


def test_a_mix_of_a_mixed_material_is_left_out(mixed):
    rust = mixed.data.materials[0]["mix_material"]
    rust["mix"], rust["mix_material"] = 0.5, material("Paint")
    scene, warnings = read()
    assert told(warnings, "'Leaf': mix_material 'Rust' is mixed itself; its own mix is left out")
    assert [scene.materials[i].name for i in scene.textures.mixed] == ["Rust", "Rust"]


def test_each_slot_has_its_own_mix(mixed):
    cube = cube_mesh()
    plain, other = material("Plain"), mixed.data.materials[0]["mix_material"]
    for each in (plain, other, mixed.data.materials[0]):
        cube.materials.append(each)
    cube.polygons.foreach_set("material_index", [0, 1, 2, 2, 1, 0])
    bpy.data.objects.remove(mixed)
    link("Cube", cube, temperature=300.0)
    scene = read()[0]
    names = [scene.materials[i].name for i in scene.material]
    assert scene.textures.triangle.tolist() == [i for i, name in enumerate(names) if name == "Leaf"]
    assert len(scene.materials) == 3  # the other material, which is in a slot too, is read once


def test_gas_in_other_slots_moves_no_rows(mixed):
    cube, leaf = cube_mesh(), mixed.data.materials[0]
    cube.materials.append(material("Smoke", absorption=1.0))
    cube.materials.append(leaf)
    cube.polygons.foreach_set("material_index", [0, 0, 0, 0, 0, 1])
    attribute(cube, "wet", np.arange(6) / 8.0, domain="FACE")
    leaf["mix"] = "wet"
    bpy.data.objects.remove(mixed)
    link("Cube", cube, temperature=300.0)
    scene = read()[0]
    assert scene.textures.triangle.tolist() == [0, 1]
    assert scene.textures.share.tolist() == [[0.625] * 3] * 2


def test_the_override_of_a_view_layer_counts(mixed):
    bpy.context.view_layer.material_override = material("Clay", mix=0.25, mix_material=material("Dust"))
    scene = read()[0]
    assert [scene.materials[i].name for i in scene.textures.mixed] == ["Dust", "Dust"]
    assert scene.textures.share.tolist() == [[0.25] * 3] * 2


# Thin sheets ----------------------------------------------------------------------------------------------------------


def test_a_transmittance_is_a_number_or_a_list():
    sheet = read_material(material("Film", emissivity=0.2, transmittance=0.7), 0.95)
    assert sheet.transmittance == 0.7 and sheet.transmits
    sheet = read_material(material("Film", emissivity=0.2, transmittance=[8.0, 0.1, 12.0, 0.8]), 0.95)
    assert sheet.transmittance.tolist() == [[8.0, 0.1], [12.0, 0.8]]
    assert read_material(material("Wall", emissivity=0.2), 0.95).transmittance == 0.0


@pytest.mark.parametrize(
    "value, message",
    [
        (0.3, "Material 'Film': the emissivity 0.8 and the transmittance 0.3 are more than 1 together"),
        (1.5, "Material 'Film': transmittance 1.5 is outside 0..1"),
        ([8.0, 0.1, 9.0], "Material 'Film': the transmittance list has 3 numbers"),
        ([8.0, 0.1, 9.0, 0.4], "Material 'Film': at 9 um the emissivity 0.8 and the transmittance 0.4"),
        (
            True,
            "Material 'Film': transmittance is True, expected a number, a flat list of wavelengths .* transmittances",
        ),
        ("Nothing of that name", "Material 'Film': the library has no material"),
        ("water", "Material 'Film': transmittance is 'Water', whose curve in the library is an emissivity"),
    ],
)
def test_what_is_no_transmittance_is_refused(value, message):
    with pytest.raises(SceneError, match=message):
        read_material(material("Film", emissivity=0.8, transmittance=value), 0.95)


def test_a_name_of_my_materials_is_a_transmittance(tmp_path, monkeypatch):
    monkeypatch.setenv(library.USER_VARIABLE, str(tmp_path / "mine.csv"))
    library.add_user_material("Cling film", np.array([[8.0, 0.9], [12.0, 0.7]]), "measured")
    sheet = read_material(material("Film", emissivity=0.1, transmittance="cling film"), 0.95)
    assert sheet.transmittance.tolist() == [[8.0, 0.9], [12.0, 0.7]]


def test_a_sheet_leaves_fresnels_law_out(mixed):
    leaf = mixed.data.materials[0]
    leaf["emissivity"], leaf["transmittance"], leaf["specular"], leaf["fresnel"] = 0.5, 0.3, 1.0, True
    scene, warnings = read()
    assert told(warnings, "'Leaf': fresnel is left out: a thin sheet with a transmittance is alike at all angles")
    assert not next(each for each in scene.materials if each.name == "Leaf").fresnel


def test_fresnels_law_stays_where_nothing_passes():
    glass = material("Pane", emissivity=0.9, specular=1.0, fresnel=True, transmittance=[8.0, 0.0, 12.0, 0.0])
    assert read_material(glass, 0.95).fresnel


# What else asks -------------------------------------------------------------------------------------------------------


def checks(level):
    """The texts of a level in the panel Checks."""
    bpy.context.view_layer.update()
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in found if check.level == level]


def source_of(obj):
    bpy.context.view_layer.update()
    return temperature_source(obj, bpy.context.view_layer.depsgraph)


def test_an_image_counts_where_there_are_texture_coordinates(warm):
    assert source_of(warm) == "IMAGE"
    attribute(warm.data, "temperature", [280.0] * 4)
    assert source_of(warm) == "IMAGE"
    warm.data.uv_layers.remove(warm.data.uv_layers[0])
    warm.data.update()
    assert source_of(warm) == "ATTRIBUTE"


@pytest.mark.parametrize("extension, expected", [("REPEAT", [300.0, 350.0]), ("CLIP", [290.0, 350.0])])
def test_the_range_of_an_object_with_an_image(warm, extension, expected):
    """Outside a clipped image its own temperature, 290 K, counts."""
    warm["temperature_extension"] = extension
    assert object_temperatures(warm, 0.0) == expected
    warm["temperature_image"].source = "TILED"
    assert object_temperatures(warm, 0.0) == [290.0]


@pytest.mark.parametrize("domain", [None, "POINT", "CORNER"])
@pytest.mark.parametrize("extension, beyond", [("EXTEND", [320.0, 335.0]), ("CLIP", [290.0, 290.0])])
def test_the_heat_map_shows_an_image_at_the_corners(warm, domain, extension, beyond):
    """Half-way up between the rows, and at u = 2 beyond the image."""
    warm["temperature_extension"] = extension
    if domain:
        attribute(warm.data, "temperature", [290.0] * 4, domain=domain)
    bpy.context.view_layer.update()
    shown = vertex_temperatures(warm, bpy.context.view_layer.depsgraph, bpy.context.scene)
    assert shown[0] == "CORNER"
    np.testing.assert_array_equal(shown[1], np.float32([300.0, *beyond, 315.0]))


def test_the_heat_map_refuses_an_image_of_no_temperatures(warm):
    warm["temperature_image"] = image_of(KELVIN - 400.0, "Bad")
    with pytest.raises(TemperatureError, match="Object 'Wall': Image 'Bad': temperature -100 K"):
        vertex_temperatures(warm, bpy.context.evaluated_depsgraph_get(), bpy.context.scene)


def test_checks_tell_what_the_render_tells(warm):
    leaf = material("Leaf", emissivity=0.9, mix="wet", mix_material=material("Rust", emissivity=0.6))
    warm.data.materials.append(leaf)
    leaf["specular"], leaf["fresnel"], leaf["transmittance"] = 0.5, True, 0.1
    warm["temperature_extension"] = "TILE"
    warm["temperature_image"].source = "TILED"
    warnings = read()[1]
    assert len(warnings) == 4
    kinds = {text: "Material" if text.startswith("'Leaf'") else "Object" for text in warnings}
    assert {f"{kind} {text}" for text, kind in kinds.items()} <= set(checks("WARNING"))
    warm.data.uv_layers.remove(warm.data.uv_layers[0])
    warm.data.update()
    warm["temperature_image"].source = "GENERATED"
    del warm["temperature_extension"]
    assert f"Object {read()[1][0]}" in checks("WARNING")
    assert told(checks("WARNING"), "Object 'Wall': temperature_image: the mesh has no UV map")


def test_checks_tell_what_stops_the_render(warm):
    warm["temperature_image"] = image_of(KELVIN - 400.0, "Bad")
    with pytest.raises(SceneError) as stopped:
        read()
    assert str(stopped.value) in checks("ERROR")


def test_checks_tell_of_gases_that_are_mixed():
    mesh = cube_mesh()
    mesh.materials.append(material("Smoke", absorption=1.0, mix=0.5, mix_material=material("Rust")))
    link("Cloud", mesh, temperature=300.0)
    assert told(checks("WARNING"), "Material 'Smoke': a gas is not mixed; mix is left out")


def test_checks_look_at_materials_that_are_only_mixed_in(mixed):
    rust = mixed.data.materials[0]["mix_material"]
    rust["emissivity"] = 1.5
    assert "Material 'Rust': emissivity 1.5 is outside 0..1" in checks("ERROR")
    del rust["emissivity"]
    assert told(checks("HINT"), "Material 'Rust': no emissivity; the default 0.95 counts")


def test_of_a_grouped_object_with_an_image_the_checks_tell(warm):
    warm["temperature_group"], bpy.context.scene.infrared.group_exr_path = "Walls", "//groups.exr"
    assert told(
        checks("ERROR"), "Object 'Wall': its temperature varies from 300 to 350 K, but it is in the temperature"
    )


def test_adaptive_bands_know_what_is_mixed_in_and_what_passes(mixed):
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.band_count = "ADAPTIVE", 3
    rust = mixed.data.materials[0]["mix_material"]

    def edges_with(**properties):
        for key, value in properties.items():
            rust[key] = value
        return read_adaptive_bands(infrared).edges.tolist()

    grey = edges_with(emissivity=0.05)
    step = [8.99, 0.05, 9.01, 0.9]
    passing = edges_with(transmittance=step)
    assert passing != grey and min(abs(edge - 9.0) for edge in passing) < 0.1


def test_a_shader_is_not_called_opaque_where_something_passes(mixed):
    leaf = shaded("Shaded", {"emissivity": 0.9, "mix": 0.5, "mix_material": mixed.data.materials[0]["mix_material"]})
    mixed.data.materials[0] = leaf
    textured(leaf, "Alpha")
    assert told(read()[1], "'Shaded': of its shader the engine does not see image textures")
    assert not told(read()[1], "alpha") and not told(read()[1], "opaque")
    picture = next(node for node in leaf.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    picture.image = leaf["mix"] = image_of(SHARES, "Mask")
    assert not told(read()[1], "of its shader")
