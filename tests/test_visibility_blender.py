# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray visibility, holdout, collections and a transparent film of Blender's, up to its render result and its files."""

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.visibility import HIDDEN_IN_FOG, read_visibility  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.scene import Hidden  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")


def cube(name="Cube", collection=None, kelvin=300.0):
    mesh = cube_mesh(name)
    mesh.materials.append(material(name, emissivity=1.0))
    return link(name, mesh, collection, temperature=kelvin)


def in_collection(*objects):
    """The layer collection of a new collection with these objects."""
    things = bpy.data.collections.new("Things")
    bpy.context.scene.collection.children.link(things)
    for obj in objects:
        things.objects.link(obj)
        bpy.context.scene.collection.objects.unlink(obj)
    return bpy.context.view_layer.layer_collection.children["Things"]


def hidden():
    """Names of the cubes whose triangles, all 12, the scene hides; empty if it hides none."""
    scene = read()[0]
    if scene.hidden is None:
        return []
    count = np.bincount(scene.material[scene.hidden == Hidden.CAMERA], minlength=len(scene.materials))
    assert set(count) == {0, 12} and set(scene.hidden) == {0, Hidden.CAMERA}
    return [scene.materials[index].name for index in np.flatnonzero(count)]


@pytest.fixture
def two():
    """A scene with a camera and two cubes, of which the second is returned."""
    camera()
    cube("Floor")
    return cube()


def test_usually_nothing_is_hidden(two):
    assert hidden() == []


def test_objects_are_hidden_from_the_camera(two):
    two.visible_camera = False
    assert hidden() == ["Cube"]


@pytest.mark.parametrize(
    ("rays", "flags"),
    [
        (["diffuse"], Hidden.DIFFUSE),
        (["glossy"], Hidden.GLOSSY),
        (["shadow"], Hidden.LIGHTS),
        (["camera", "diffuse", "glossy", "shadow"], sum(Hidden)),
    ],
)
def test_objects_are_hidden_from_other_rays(two, rays, flags):
    for ray in rays:
        setattr(two, f"visible_{ray}", False)
    scene, warnings = read()
    assert scene.hidden.dtype == np.uint8 and scene.hidden.tolist() == [0] * 12 + [flags] * 12
    assert not [each for each in warnings if "ray visibility" in each]


def test_rays_pass_what_the_instance_or_its_source_hides(two):
    source = bpy.data.collections.new("Source")
    cube("Instanced", source).visible_glossy = False
    empty = link("Instance")
    empty.instance_type, empty.instance_collection, empty.visible_diffuse = "COLLECTION", source, False
    assert read()[0].hidden.tolist() == [0] * 24 + [Hidden.DIFFUSE | Hidden.GLOSSY] * 12


def test_where_gas_scatters_a_warning_names_what_is_not_hidden(two):
    """In the render's report and in the checks before it, with the same words."""
    two.visible_glossy = False
    fog = cube("Fog")
    fog.data.materials[0]["scattering"], fog.data.materials[0]["absorption"] = 0.2, 0.1
    assert any("Cube" in each and "as gas scatters light" in each for each in read()[1])
    assert checked() == [f"Object 'Cube': {HIDDEN_IN_FOG}"]
    fog.data.materials[0]["scattering"] = 0.0
    assert not any("scatters" in each for each in read()[1]) and checked() == []
    bpy.context.scene.world = bpy.data.worlds.new("Fog")
    bpy.context.scene.world["scattering"] = 0.01
    assert checked() == [f"Object 'Cube': {HIDDEN_IN_FOG}"]
    two.visible_glossy, two.visible_camera = True, False
    assert checked() == []


def checked():
    """The checks that speak of gas that scatters."""
    checks = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in checks if "scatters light" in check.text]


def test_collections_that_are_indirect_only_are_hidden(two):
    in_collection(two).indirect_only = True
    assert hidden() == ["Cube"]


def test_a_holdout_is_not_hidden_by_being_indirect_only(two):
    of_layer = in_collection(two)
    of_layer.indirect_only = of_layer.holdout = True
    assert hidden() == []


@pytest.mark.parametrize("how", ["object", "parent", "collection of the parent"])
def test_instances_are_hidden_by_either(two, how):
    source = bpy.data.collections.new("Source")
    instanced = cube("Instanced", source)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", source
    if how == "object":
        instanced.visible_camera = False
    elif how == "parent":
        empty.visible_camera = False
    else:
        in_collection(empty).indirect_only = True
    assert hidden() == ["Instanced"]


@pytest.mark.parametrize("parent", [False, True])
def test_an_instance_is_a_holdout_if_what_instances_it_is(two, parent):
    source = bpy.data.collections.new("Source")
    instanced = cube("Instanced", source)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", source
    (empty if parent else instanced).is_holdout = True
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = [
        read_visibility(each.object, each.parent or each.object, depsgraph.view_layer_eval)
        for each in depsgraph.object_instances
        if each.object.type == "MESH"
    ]
    assert [each.holdout for each in found].count(True) == parent


def test_objects_of_a_background_scene_are_seen(two):
    """They are in no view layer of the scene, and so in no collection of one."""
    other = bpy.data.scenes.new("Background")
    behind = cube("Behind")
    bpy.context.scene.collection.objects.unlink(behind)
    other.collection.objects.link(behind)
    bpy.context.scene.background_set = other
    assert hidden() == []
    behind.visible_camera = False
    assert hidden() == ["Behind"]


def plate_in_the_middle():
    """A plate of 320 K that covers the middle half of a picture of 16 x 12 pixels in each direction, before a sky of
    250 K; returns scene.infrared."""
    seen = camera(width=16, height=12)
    seen.data.type, seen.data.ortho_scale = "ORTHO", 16.0
    obj = cube(kelvin=320.0)
    obj.scale = 8.0, 6.0, 1.0
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world["temperature"] = 250.0
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads, infrared.band_count = 2, 1000, 1, 2
    scene.render.engine = "INFRARED_PHOTONS"
    return infrared


INSIDE = np.zeros((12, 16), np.bool_)
INSIDE[3:9, 4:12] = True


def render_exr(folder):
    """Channels of Blender's own multilayer EXR by name, (12, 16) float32, row 0 at the bottom."""
    render = bpy.context.scene.render
    settings = render.image_settings
    if bpy.app.version >= (5, 0, 0):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
    render.filepath = str(folder / "picture.exr")
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(render.filepath, separate_channels=True) as file:
        channels = {name: each.pixels[::-1].copy() for part in file.parts for name, each in part.channels.items()}
    return {name.removeprefix("ViewLayer."): pixels for name, pixels in channels.items()}


def combined(channels):
    return np.stack([channels[f"Combined.{letter}"] for letter in "RGBA"], axis=-1)


def test_a_transparent_film_has_alpha_where_things_are(tmp_path):
    """And its colours are multiplied by it; temperature and radiance stay those of the sky."""
    plate_in_the_middle()
    opaque = render_exr(tmp_path)
    bpy.context.scene.render.film_transparent = True
    found = render_exr(tmp_path)
    assert (combined(opaque)[..., 3] == 1.0).all()
    np.testing.assert_array_equal(combined(found)[..., 3], INSIDE.astype(np.float32))
    np.testing.assert_array_equal(combined(found)[~INSIDE], 0.0)
    np.testing.assert_array_equal(combined(found)[INSIDE], combined(opaque)[INSIDE])
    for name in ("Temperature.V", "Radiance.V", "Noise.V"):
        np.testing.assert_array_equal(found[name], opaque[name])
    np.testing.assert_allclose(found["Temperature.V"], np.where(INSIDE, 320.0, 250.0), rtol=1e-5)


def test_alpha_of_a_picture_file(tmp_path):
    plate_in_the_middle()
    scene = bpy.context.scene
    scene.render.film_transparent = True
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode = "PNG", "RGBA"
    scene.render.filepath = str(tmp_path / "picture.png")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    assert picture.channels == 4
    alpha = np.array(picture.pixels[:]).reshape(12, 16, 4)[..., 3]
    np.testing.assert_array_equal(alpha, INSIDE)


@pytest.mark.parametrize("how", ["object", "collection"])
@pytest.mark.parametrize("transparent", [False, True])
def test_a_holdout_is_a_hole_in_the_picture_alone(tmp_path, how, transparent):
    """Before a larger plate: there the picture is cut out, with a transparent film or without; what is measured is the
    holdout's own."""
    plate_in_the_middle()
    back = cube("Back", kelvin=280.0)
    back.scale, back.location.z = (100.0, 100.0, 1.0), -2.0
    front = bpy.data.objects["Cube"]
    if how == "object":
        front.is_holdout = True
    else:
        in_collection(front).holdout = True
    bpy.context.scene.render.film_transparent = transparent
    found = render_exr(tmp_path)
    np.testing.assert_array_equal(combined(found)[..., 3], ~INSIDE)
    np.testing.assert_array_equal(combined(found)[INSIDE], 0.0)
    np.testing.assert_allclose(found["Temperature.V"], np.where(INSIDE, 320.0, 280.0), rtol=1e-5)


def test_what_is_hidden_is_not_in_the_picture(tmp_path):
    infrared = plate_in_the_middle()
    infrared.use_surface_temperature = True
    bpy.data.objects["Cube"].visible_camera = False
    bpy.context.scene.render.film_transparent = True
    found = render_exr(tmp_path)
    assert not combined(found).any()
    np.testing.assert_allclose(found["Temperature.V"], 250.0, rtol=1e-5)
    assert not found["Surface Temperature.V"].any()
