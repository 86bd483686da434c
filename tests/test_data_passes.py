# SPDX-License-Identifier: GPL-3.0-or-later
"""The data passes in Blender: asked for by its switches, equal to those of Cycles, kept with the other passes."""

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.rendering import final_render  # noqa: E402
from addon.rendering.render_passes import LAYER_SWITCHES, SCENE_SWITCHES, register_passes  # noqa: E402
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

SWITCHES = LAYER_SWITCHES | SCENE_SWITCHES
NAMES = {quantity: each.name for quantity, (_, each) in SWITCHES.items()}
FAR = np.float32(1e10)
SIZE = 64, 48


@pytest.fixture(autouse=True)
def objects(reset_blender):
    """A cube with two materials, a mirrored one, and an instance of a third, over a floor without a material."""
    scene = bpy.context.scene
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 1000, 2, 1
    eye = camera((3.0, -4.0, 2.5), *SIZE)
    eye.rotation_euler = (1.1, 0.05, 0.6)
    floor = link("Floor", cube_mesh(), temperature=280.0)
    floor.scale, floor.location, floor.pass_index = (6.0, 6.0, 0.1), (0.0, 0.0, -0.6), 4
    box = link("Box", cube_mesh(), temperature=330.0)
    box.rotation_euler, box.pass_index = (0.2, 0.3, 0.4), 7
    for name, emissivity, index in (("Paint", 0.9, 11), ("Metal", 0.2, 12)):
        box.data.materials.append(material(name, emissivity=emissivity))
        bpy.data.materials[name].pass_index = index
    for face in box.data.polygons:
        face.material_index = face.index % 2
    mirrored = link("Mirrored", box.data, temperature=310.0)
    mirrored.location, mirrored.scale, mirrored.pass_index = (1.4, 0.2, 0.0), (-0.7, 0.8, 1.1), 8
    shelf = bpy.data.collections.new("Shelf")
    inside = link("Inside", cube_mesh(), shelf, temperature=300.0)
    inside.scale, inside.pass_index = (0.6, 0.6, 1.5), 9
    empty = link("Instance")
    empty.instance_type, empty.instance_collection, empty.pass_index = "COLLECTION", shelf, 5
    empty.location, empty.rotation_euler = (-1.3, 0.4, 0.2), (0.0, 0.2, 0.1)


def ask_for(*quantities):
    for quantity in quantities:
        owner = bpy.context.view_layer if quantity in LAYER_SWITCHES else bpy.context.scene.infrared
        setattr(owner, SWITCHES[quantity][0], True)


def fill_with_air():
    """Grey, 0.2 per metre, and 3 m of it before the sky."""
    world = bpy.context.scene.world = bpy.data.worlds.new("Air")
    world["absorption"], world["depth"], world["temperature"] = 0.2, 3.0, 270.0


def images_of(passes, quantities):
    """{quantity: (h, w) or (h, w, 3)} of the passes of a file."""
    images = {}
    for quantity in quantities:
        name, channels = NAMES[quantity], SWITCHES[quantity][1].channels
        planes = [passes[name if channel == "V" else f"{name}.{channel}"] for channel in channels]
        images[quantity] = planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
    return images


def passes_of_cycles(folder):
    """The same file from Cycles: one ray through the middle of each pixel, but for a hundredth."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    use_multilayer_exr()
    scene.render.filepath = str(folder / "cycles")
    bpy.ops.render.render(write_still=True)
    return read_exr(folder / "cycles.exr")["ViewLayer"]


def neighbours(image):
    """(9, h, w[, 3]): the pixel and those around it, the rim repeated."""
    padded = np.pad(image, [(1, 1), (1, 1)] + [(0, 0)] * (image.ndim - 2), mode="edge")
    height, width = image.shape[:2]
    return np.stack([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)])


# Beside Cycles --------------------------------------------------------------------------------------------------------


def perspective(eye):
    eye.shift_x, eye.shift_y, eye.lens = 0.1, -0.05, 30.0


def border(eye):
    perspective(eye)
    render = bpy.context.scene.render
    render.use_border, render.border_min_x, render.border_max_y = True, 0.1, 0.8


def out_of_focus(eye):
    eye.dof.use_dof, eye.dof.focus_distance, eye.dof.aperture_fstop = True, 2.0, 1e5  # Cycles has no middle of a lens


def orthographic(eye):
    eye.type, eye.ortho_scale, eye.shift_x = "ORTHO", 5.0, 0.1


def panorama(eye):
    eye.type, eye.panorama_type = "PANO", "EQUIRECTANGULAR"
    eye.longitude_min, eye.longitude_max, eye.latitude_min, eye.latitude_max = -0.8, 0.5, -0.6, 0.2


@pytest.mark.parametrize("kind", [perspective, border, out_of_focus, orthographic, panorama])
def test_passes_equal_those_of_cycles(tmp_path, kind):
    kind(bpy.context.scene.camera.data)
    ask_for(*LAYER_SWITCHES)
    ours = images_of(render_to_exr(tmp_path)["ViewLayer"], LAYER_SWITCHES)
    cycles = images_of(passes_of_cycles(tmp_path), LAYER_SWITCHES)
    indices = np.stack([ours["object_index"], ours["material_index"]], axis=-1)
    surface = np.concatenate((indices, ours["normal"]), axis=-1)
    inside = (neighbours(surface) == surface).all(axis=(0, -1))  # away from edges
    seen = inside & (ours["depth"] < FAR)
    assert set(np.unique(ours["object_index"][seen])) == {4.0, 7.0, 8.0, 9.0}
    for quantity in ("object_index", "material_index"):
        np.testing.assert_array_equal(ours[quantity][inside], cycles[quantity][inside])
    np.testing.assert_allclose(ours["normal"][inside], cycles["normal"][inside], atol=1e-6)  # some roundings of float32
    np.testing.assert_array_equal(cycles["depth"][~seen & inside], ours["depth"][~seen & inside])
    for quantity in ("depth", "position"):
        change = np.abs(neighbours(ours[quantity]) - ours[quantity]).max(axis=0)
        error = np.abs(ours[quantity] - cycles[quantity])
        assert (error <= 0.01 * change + 1e-5)[seen].all()  # a hundredth of a pixel; roundings of some metres


def test_smooth_normals_equal_those_of_cycles(tmp_path):
    """Of a stretched and mirrored ball that is shaded smooth: within a hundredth of a pixel, the width of Cycles'
    filter, and float32's rounding of a sum of three normals."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=0.6, location=(0.3, 0.0, 0.9))
    ball = bpy.context.object
    ball.data.shade_smooth()
    ball.scale, ball.rotation_euler, ball.pass_index = (-1.0, 0.7, 1.3), (0.3, 0.2, 0.4), 21
    ask_for("object_index", "normal")
    ours = images_of(render_to_exr(tmp_path)["ViewLayer"], ("object_index", "normal"))
    cycles = images_of(passes_of_cycles(tmp_path), ("object_index", "normal"))
    on_ball = (neighbours(ours["object_index"]) == 21.0).all(axis=0)
    assert on_ball.sum() > 50
    change = np.abs(neighbours(ours["normal"]) - ours["normal"]).max(axis=(0, -1))
    error = np.abs(ours["normal"] - cycles["normal"]).max(axis=-1)
    assert (error <= 0.01 * change + 2e-6)[on_ball].all()
    assert np.unique(np.round(ours["normal"][on_ball], 3), axis=0).shape[0] > 0.8 * on_ball.sum()  # not by facets


# What is asked for ----------------------------------------------------------------------------------------------------


def registered():
    """(name, channels) of the passes that the engine registers for the compositor."""

    class Recorder(list):
        def register_pass(self, scene, view_layer, name, count, channels, kind):
            assert count == len(channels) and kind == ("COLOR" if count == 4 else "VECTOR" if count == 3 else "VALUE")
            self.append((name, channels))

    recorder = Recorder()
    register_passes(recorder, bpy.context.scene, bpy.context.view_layer)
    return recorder


def test_without_a_switch_there_is_nothing_more(tmp_path, monkeypatch):
    monkeypatch.setattr(final_render, "first_hit_images", lambda *_: pytest.fail("rays for what nobody asked for"))
    usual = ["Combined", "7.50-10.75um", "10.75-14.00um", "Radiance", "Temperature", "Noise"]
    bpy.context.view_layer.use_pass_z = False
    assert [name for name, _ in registered()] == usual
    assert set(render_to_exr(tmp_path)["ViewLayer"]) == set(usual)
    assert final_render.finished_layers["ViewLayer"]["further"] == {}


@pytest.mark.parametrize("quantity", list(SWITCHES))
def test_each_switch_brings_its_pass_to_sockets_and_renders(tmp_path, quantity):
    usual = registered()
    fill_with_air()  # else the transmittance is the same everywhere
    ask_for(quantity)
    (added,) = registered()[len(usual) :]
    assert added == (NAMES[quantity], SWITCHES[quantity][1].channels)
    image = images_of(render_to_exr(tmp_path)["ViewLayer"], [quantity])[quantity]
    assert np.isfinite(image).all() and image.std() > 0.0


def test_switches_show_at_the_compositors_node_at_once():
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    tree = compositor_tree(scene)
    node = next(node for node in tree.nodes if node.bl_idname == "CompositorNodeRLayers")
    for name in ("Surface Temperature", "Emissivity"):
        assert name not in [socket.name for socket in node.outputs if socket.enabled]
    ask_for("surface_temperature", "emissivity")
    outputs = {socket.name: socket.type for socket in node.outputs if socket.enabled}
    assert outputs["Surface Temperature"] == outputs["Emissivity"] == "VALUE"


def test_the_picture_is_the_same_with_and_without(tmp_path):
    without = render_to_exr(tmp_path)["ViewLayer"]
    ask_for(*SWITCHES)
    with_them = render_to_exr(tmp_path)["ViewLayer"]
    for name, image in without.items():
        np.testing.assert_array_equal(image, with_them[name])


# Values ---------------------------------------------------------------------------------------------------------------


def test_temperature_and_emissivity_are_those_of_the_object_and_its_material(tmp_path):
    infrared = bpy.context.scene.infrared
    infrared.default_emissivity = 0.75
    wanted = "surface_temperature", "emissivity", "object_index", "material_index"
    ask_for(*wanted)
    images = images_of(render_to_exr(tmp_path)["ViewLayer"], wanted)
    kelvin, emissivity = images["surface_temperature"], images["emissivity"]
    for index, expected in {0: 0.0, 4: 280.0, 7: 330.0, 8: 310.0, 9: 300.0}.items():
        assert (kelvin[images["object_index"] == index] == expected).all()
    seen = images["object_index"] > 0
    for index, expected in {0: 0.75, 11: 0.9, 12: 0.2}.items():
        there = seen & (images["material_index"] == index)
        assert there.any()
        np.testing.assert_allclose(emissivity[there], expected, rtol=1e-6)
    assert not emissivity[~seen].any()


def test_the_transmittance_is_that_of_the_way_to_the_surface(tmp_path):
    """From the clip start on, which lies 0.1 m before the camera."""
    fill_with_air()
    eye = bpy.context.scene.camera.data
    eye.type, eye.clip_start, eye.ortho_scale = "ORTHO", 0.1, 8.0
    ask_for("transmittance", "depth")
    images = images_of(render_to_exr(tmp_path)["ViewLayer"], ["transmittance", "depth"])
    sky = images["depth"] == FAR
    assert sky.any() and not sky.all()
    np.testing.assert_allclose(images["transmittance"][sky], np.exp(-0.2 * 3.0), rtol=1e-6)
    expected = np.exp(-0.2 * (images["depth"][~sky].astype(float) - 0.1))
    np.testing.assert_allclose(images["transmittance"][~sky], expected, rtol=2e-6)  # 1 um of 6 m


def test_a_temperature_attribute_is_what_the_pass_shows(tmp_path):
    """T = 300 K + 20 K/m x on the floor, whose corners have it."""
    mesh = bpy.data.objects["Floor"].data
    values = [300.0 + 20.0 * 6.0 * vertex.co.x for vertex in mesh.vertices]
    mesh.attributes.new("temperature", "FLOAT", "POINT").data.foreach_set("value", values)
    ask_for("surface_temperature", "position", "object_index")
    images = images_of(render_to_exr(tmp_path)["ViewLayer"], ["surface_temperature", "position", "object_index"])
    floor = images["object_index"] == 4
    expected = 300.0 + 20.0 * images["position"][floor][:, 0]
    np.testing.assert_allclose(
        images["surface_temperature"][floor], expected, atol=2e-4
    )  # 20 K/m times 1e-6 m, 2^-15 K


def test_the_view_layers_material_override_has_its_own_index(tmp_path):
    override = material("Override", emissivity=0.6)
    override.pass_index = 20
    bpy.context.view_layer.material_override = override
    ask_for("material_index", "emissivity")
    images = images_of(render_to_exr(tmp_path)["ViewLayer"], ["material_index", "emissivity"])
    assert set(np.unique(images["material_index"])) == {0.0, 20.0}
    np.testing.assert_allclose(images["emissivity"][images["material_index"] == 20.0], 0.6, rtol=1e-6)


# Where they are kept --------------------------------------------------------------------------------------------------


def test_openexr_files_have_them_with_their_units(tmp_path):
    scene = bpy.context.scene
    scene.infrared.band_exr_path = str(tmp_path / "bands")
    scene.infrared.file_formats = {"BAND_EXR", "SPECTRAL_EXR", "ENVI", "TIFF"}
    ask_for(*SWITCHES)
    blenders = render_to_exr(tmp_path)["ViewLayer"]
    for name in ("bands.exr", "bands_spectral.exr"):
        file = OpenEXR.File(str(tmp_path / name), separate_channels=True)
        for _, each in SWITCHES.values():
            for letter in each.channels:
                expected = blenders[each.name if letter == "V" else f"{each.name}.{letter}"]
                np.testing.assert_array_equal(file.channels()[f"{each.name}.{letter}"].pixels[::-1], expected)
        units = file.header()["units"].split("; ")
        assert {"Depth: m", "Position: m", "Surface Temperature: K"} <= set(units)
    assert "bands = 2\n" in (tmp_path / "bands.hdr").read_text()  # a cube has a place for bands alone


def test_a_cancelled_render_keeps_them(tmp_path, monkeypatch):
    bpy.context.scene.infrared.passes = 1000
    ask_for("depth")
    add = final_render.RenderJob._on_pass
    monkeypatch.setattr(final_render.RenderJob, "_on_pass", lambda job, film: (add(job, film), job.cancel()))
    depth = images_of(render_to_exr(tmp_path)["ViewLayer"], ["depth"])["depth"]
    assert (depth < FAR).any() and depth.min() > 1.0


def test_kept_geometry_serves_them_too(tmp_path):
    """With Persistent Data an object that moves is seen where it is."""
    bpy.context.scene.render.use_persistent_data = True
    ask_for("depth")
    first, again = (images_of(render_to_exr(tmp_path)["ViewLayer"], ["depth"])["depth"] for _ in range(2))
    np.testing.assert_array_equal(first, again)
    bpy.data.objects["Box"].location.z += 0.5
    moved = images_of(render_to_exr(tmp_path)["ViewLayer"], ["depth"])["depth"]
    bpy.context.scene.render.use_persistent_data = False
    np.testing.assert_array_equal(moved, images_of(render_to_exr(tmp_path)["ViewLayer"], ["depth"])["depth"])
    assert not np.array_equal(moved, first)


def test_memory_counts_them():
    ask_for(*SWITCHES)
    layers = bpy.context.scene, bpy.context.view_layer
    passes, further = final_render.render_passes(*layers), final_render.further_passes(*layers)
    assert final_render.size_beside_usual(passes, further) == (4 + 2 + 3 + 12) / (4 + 2 + 3)
    assert final_render.size_beside_usual(passes[: -len(further)], []) == 1.0
