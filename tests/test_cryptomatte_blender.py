# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte passes in Blender: beside Cycles, in the compositor, in files."""

import json

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.output.cryptomatte import as_float, murmur_hash  # noqa: E402
from addon.rendering import cryptomatte  # noqa: E402
from addon.rendering.cryptomatte import SAMPLES, jittered  # noqa: E402
from addon.rendering.render_passes import CRYPTOMATTE_SWITCHES, register_passes  # noqa: E402
from addon.solver import Camera  # noqa: E402
from addon.ui.sensor_image import compositor_tree  # noqa: E402
from tests.helpers.blender import (  # noqa: E402
    camera,
    cube_mesh,
    link,
    material,
    read_exr,
    render_to_exr,
    use_multilayer_exr,
)

KINDS = list(CRYPTOMATTE_SWITCHES)
PIXEL = 1.0 / SAMPLES  # of the coverage


@pytest.fixture(autouse=True)
def objects(reset_blender):
    """A box with two materials, one that is its child, and an instance of a third without a material; and sky."""
    scene = bpy.context.scene
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 1000, 2, 1
    eye = camera((3.0, -4.0, 2.5), 48, 36)
    eye.rotation_euler = (1.1, 0.05, 0.6)
    box = link("Box", cube_mesh(), temperature=330.0)
    box.rotation_euler = (0.2, 0.3, 0.4)
    for name in ("Paint", "M\u00e4tall"):
        box.data.materials.append(material(name, emissivity=0.9))
    for face in box.data.polygons:
        face.material_index = face.index % 2
    child = link("Child", cube_mesh(), temperature=310.0)
    child.data.materials.append(bpy.data.materials["Paint"])
    child.location, child.parent, child.pass_index = (1.4, 0.2, 0.0), box, 3
    shelf = bpy.data.collections.new("Shelf")
    inside = link("Inside", cube_mesh(), shelf, temperature=300.0)
    inside.scale = (0.6, 0.6, 1.5)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", shelf
    empty.location = (-1.3, 0.4, 0.2)


def ask_for(*kinds):
    for kind in kinds or KINDS:
        setattr(bpy.context.view_layer, CRYPTOMATTE_SWITCHES[kind], True)


def pairs(passes, kind):
    """(levels, h, w) ids and coverages of a kind of mattes, the largest coverage first."""
    names = sorted({name.partition(".")[0] for name in passes if name.startswith(kind)})
    planes = np.stack([passes[f"{name}.{channel}"] for name in names for channel in "rgba"])
    return planes[0::2], planes[1::2]


def coverage(passes, kind, name):
    """(h, w) share of the pixels that a thing of this name covers."""
    ids, shares = pairs(passes, kind)
    return np.where(ids == as_float([murmur_hash(name)])[0], shares, 0.0).sum(axis=0)


def manifests(path):
    """{name: {name of a thing: hash}} of a file of Blender's."""
    facts = {key: value for part in OpenEXR.File(str(path)).parts for key, value in part.header.items()}
    keys = [key.removesuffix("/name") for key in facts if key.startswith("cryptomatte/") and key.endswith("/name")]
    assert all(facts[f"{key}/conversion"] == "uint32_to_float32" for key in keys)
    return {facts[f"{key}/name"]: json.loads(facts[f"{key}/manifest"]) for key in keys}


def render_cycles(folder):
    """The same passes and manifests from Cycles, with a box of a pixel as its filter, too."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 256, False, False
    scene.cycles.pixel_filter_type = "BOX"
    use_multilayer_exr()
    scene.render.filepath = str(folder / "cycles")
    bpy.ops.render.render(write_still=True)
    return read_exr(folder / "cycles.exr")["ViewLayer"], manifests(folder / "cycles.exr")


def test_mattes_are_those_of_cycles(tmp_path):
    """Names, ids and shares; the shares to the noise of their random samples and of our 16."""
    ask_for()
    ours, our_manifests = render_to_exr(tmp_path)["ViewLayer"], manifests(tmp_path / "image.exr")
    theirs, their_manifests = render_cycles(tmp_path)
    for kind in KINDS:
        ids, shares = pairs(ours, kind)
        name = f"ViewLayer.{kind}"
        # Cycles writes the hash itself, also where the id in the pixels differs from it: that of 'Box' has no exponent
        theirs_as_ids = {thing: as_float([int(value, 16)])[0] for thing, value in their_manifests[name].items()}
        assert all(
            as_float([int(value, 16)])[0] == theirs_as_ids[thing] for thing, value in our_manifests[name].items()
        )
        assert {f"{each:08x}" for each in np.unique(ids[shares > 0.0]).view(np.uint32)} == set(
            our_manifests[name].values()
        )
        for thing in our_manifests[name]:
            off = coverage(ours, kind, thing) - coverage(theirs, kind, thing)
            # ours: an edge takes or leaves a point or two of 16; theirs: four standard errors of 256 samples
            assert np.abs(off).max() < 2.0 * PIXEL + 4.0 * 0.5 / 16.0 and abs(off.mean()) < 2e-3, thing
    assert set(our_manifests["ViewLayer.CryptoObject"]) == {"Box", "Child", "Inside"}
    assert set(our_manifests["ViewLayer.CryptoAsset"]) == {"Box", "Inside"}
    assert set(our_manifests["ViewLayer.CryptoMaterial"]) == {"Paint", "M\u00e4tall", "default_surface"}


def test_shares_add_up_to_what_is_no_sky(tmp_path):
    ask_for()
    bpy.context.view_layer.use_pass_z = True
    passes = render_to_exr(tmp_path)["ViewLayer"]
    totals = [pairs(passes, kind)[1].sum(axis=0) for kind in KINDS]
    for total in totals:
        np.testing.assert_allclose(total, totals[0], atol=1e-6)
        inside = (total == 0.0) | (total == 1.0)
        np.testing.assert_array_equal(total[inside] == 1.0, passes["Depth.Z"][inside] < 1e9)
    assert (totals[0] == 0.0).any() and (totals[0] == 1.0).any()
    assert ((totals[0] > 0.0) & (totals[0] < 1.0)).any()


def test_the_share_of_an_edge_is_its_area(tmp_path):
    """A plate whose edges run along the pixels' at known shares of a pixel, .3 of one and .6 of the next."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    eye = camera((0.0, 0.0, 5.0), 16, 12)
    eye.data.type, eye.data.ortho_scale = "ORTHO", 16.0  # a pixel is a metre
    plate = link("Plate", cube_mesh(), temperature=300.0)
    plate.scale, plate.location = (4.3, 3.6, 0.1), (4.3 / 2.0, 3.6 / 2.0, 0.0)
    ask_for("CryptoObject")
    shares = coverage(render_to_exr(tmp_path)["ViewLayer"], "CryptoObject", "Plate")
    across, up = np.zeros(16), np.zeros(12)
    across[8:12], across[12], up[6:9], up[9] = 1.0, 0.3, 1.0, 0.6
    np.testing.assert_allclose(shares, np.outer(up, across), atol=1.5 * PIXEL)  # two edges cross the corner's pixel
    inner = np.isin(across, (0.0, 1.0)) | ~np.isin(up, (0.0, 1.0))[:, None]
    np.testing.assert_allclose(np.where(inner, shares - np.outer(up, across), 0.0), 0.0, atol=1.5 * PIXEL)


def test_rays_are_spread_over_a_pixel():
    """Each in a row and a column of its own, of as many; so edges along both axes are as fine as can be."""
    eye = Camera(width=10, height=4, frame=(-1.0, 1.0, -0.4, 0.4))
    frames = np.array([each.frame for each in jittered(eye)])
    for low in (0, 2):
        np.testing.assert_allclose(frames[:, low + 1] - frames[:, low], eye.frame[low + 1] - eye.frame[low])
        offset = (frames[:, low] - eye.frame[low]) / 0.2
        np.testing.assert_allclose(np.sort(offset), (np.arange(SAMPLES) + 0.5) * PIXEL - 0.5, atol=1e-12)


@pytest.mark.once
def test_strips_and_borders_are_parts_of_the_whole(tmp_path, monkeypatch):
    ask_for("CryptoObject")
    whole = pairs(render_to_exr(tmp_path)["ViewLayer"], "CryptoObject")
    monkeypatch.setattr(cryptomatte, "_STRIP", 100)
    monkeypatch.setattr(cryptomatte, "_PIECE", 7)
    for ours, strips in zip(whole, pairs(render_to_exr(tmp_path)["ViewLayer"], "CryptoObject"), strict=True):
        np.testing.assert_array_equal(strips, ours)
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.25, 1.0
    for ours, part in zip(whole, pairs(render_to_exr(tmp_path)["ViewLayer"], "CryptoObject"), strict=True):
        np.testing.assert_array_equal(part, ours[:, 9:, 12:36])


@pytest.mark.parametrize("depth, count", [(2, 1), (5, 3), (16, 8)])
def test_levels_say_how_many_passes_there_are(depth, count):
    registered = []

    class Recorder:
        def register_pass(self, scene, view_layer, name, size, channels, kind):
            registered.append((name, size, channels, kind))

    bpy.context.view_layer.pass_cryptomatte_depth = depth
    register_passes(Recorder(), bpy.context.scene, bpy.context.view_layer)
    usual = len(registered)
    ask_for("CryptoMaterial")
    register_passes(Recorder(), bpy.context.scene, bpy.context.view_layer)
    added = registered[2 * usual :]
    assert added == [(f"CryptoMaterial{i:02d}", 4, "rgba", "COLOR") for i in range(count)]


def test_without_a_switch_no_ray_is_traced(tmp_path, monkeypatch):
    monkeypatch.setattr(cryptomatte, "first_hit_images", lambda *_: pytest.fail("rays for what nobody asked for"))
    render_to_exr(tmp_path)
    assert manifests(tmp_path / "image.exr") == {}


def test_the_compositor_picks_an_object_by_its_name(tmp_path):
    """The matte of its Cryptomatte node is our coverage; where it is whole it is the object's index pass."""
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    ask_for("CryptoObject")
    bpy.context.view_layer.use_pass_object_index = True
    passes = render_to_exr(tmp_path)["ViewLayer"]
    tree = compositor_tree(scene)
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.scene, node.layer_name, node.matte_id = "RENDER", scene, "ViewLayer.CryptoObject", "Child"
    output = next(each for each in tree.nodes if each.bl_idname in ("NodeGroupOutput", "CompositorNodeComposite"))
    layers = next(each for each in tree.nodes if each.bl_idname == "CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], node.inputs["Image"])
    tree.links.new(node.outputs["Matte"], output.inputs["Image"])
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "IMAGE"
    image.file_format, image.color_depth, image.color_mode = "OPEN_EXR", "32", "RGB"
    scene.render.filepath = str(tmp_path / "matte.exr")
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(str(tmp_path / "matte.exr"), separate_channels=True) as file:
        matte = file.channels()["R"].pixels[::-1]
    expected = coverage(passes, "CryptoObject", "Child")
    np.testing.assert_allclose(matte, expected, atol=1e-6)
    index = passes.get("Object Index.X", passes.get("IndexOB.X"))
    sharp = (expected == 0.0) | (expected == 1.0)
    np.testing.assert_array_equal(expected[sharp] == 1.0, index[sharp] == 3.0)
    assert (expected == 1.0).sum() > 20


def test_band_files_have_them_too(tmp_path):
    """With names as their channels have: without the view layer's."""
    scene = bpy.context.scene
    scene.infrared.band_exr_path = str(tmp_path / "bands")
    ask_for("CryptoMaterial")
    blenders = render_to_exr(tmp_path)["ViewLayer"]
    with OpenEXR.File(str(tmp_path / "bands.exr"), separate_channels=True) as file:
        for channel in "rgba":
            name = f"CryptoMaterial00.{channel}"
            np.testing.assert_array_equal(file.channels()[name].pixels[::-1], blenders[name])
    found = manifests(tmp_path / "bands.exr")
    assert set(found) == {"CryptoMaterial"} and "M\u00e4tall" in found["CryptoMaterial"]


def test_another_library_reads_the_manifest(tmp_path):
    oiio = pytest.importorskip("OpenImageIO")
    ask_for("CryptoObject")
    render_to_exr(tmp_path)
    file = oiio.ImageInput.open(str(tmp_path / "image.exr"))
    manifest = json.loads(file.spec().getattribute("cryptomatte/542cafa/manifest"))
    file.close()
    assert manifest["Box"] == f"{as_float([murmur_hash('Box')]).view(np.uint32)[0]:08x}"
