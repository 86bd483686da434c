# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive bands in Blender: alike for sockets, renders and panels, the same in all frames, and kept if wanted."""

import logging

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.bands import read_adaptive_bands, read_band_edges  # noqa: E402
from addon.rendering.checks import band_problem  # noqa: E402
from addon.rendering.render_passes import register_passes  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.physics.band_partition import choose_bands  # noqa: E402
from addon.solver.physics.spectrum import band_names  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import (  # noqa: E402
    camera,
    cube_mesh,
    link,
    material,
    read_as_rendered,
    read_exr,
    render_to_exr,
)

GLASS, QUARTZ = "Glass, window", "Fused silica"


@pytest.fixture(autouse=True)
def adaptive(reset_blender):
    camera()
    bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.context.scene.world["temperature"] = 280.0
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads = 2, 1000, 1
    infrared.band_mode, infrared.band_count = "ADAPTIVE", 5


def cube(name, emissivity, temperature, collection=None):
    mesh = cube_mesh(name)
    mesh.materials.append(material(f"{name} surface", emissivity=emissivity))
    return link(name, mesh, collection, temperature=temperature)


def bands():
    return read_adaptive_bands(bpy.context.scene.infrared)


def expected(names, temperatures, lights=(), **how):
    curves = [tuple(library.find(name).T) for name in names]
    return choose_bands(7.5, 14.0, curves, temperatures, lights, **(how or {"count": 5}))


def test_a_script_sets_the_mode_and_renders(tmp_path, caplog):
    """Passes, the log and the band file all have the edges that the solver chose."""
    cube("Lens", QUARTZ, 340.0)
    edges = expected([QUARTZ], [280.0, 340.0]).edges
    bpy.context.scene.infrared.band_exr_path = str(tmp_path / "bands.exr")
    with caplog.at_level(logging.INFO):
        images = render_to_exr(tmp_path)["ViewLayer"]
    assert set(images) == {"Combined", *band_names(edges), "Radiance", "Temperature", "Noise"}
    assert f"bands between {', '.join(f'{edge:.6g}' for edge in edges)} um" in caplog.text
    header = OpenEXR.File(str(tmp_path / "bands.exr")).header()
    np.testing.assert_array_equal(np.array(header["bandEdges"].split(), float), edges)


def test_radiance_is_the_sum_over_the_bands(tmp_path):
    cube("Lens", QUARTZ, 340.0)
    images = render_to_exr(tmp_path)["ViewLayer"]
    edges = bands().edges
    total = sum(images[name] * width for name, width in zip(band_names(edges), np.diff(edges), strict=True))
    np.testing.assert_allclose(images["Radiance"], total, rtol=1e-5)  # float32 bands are added up here


def registered():
    """The names of the passes that the engine registers for the compositor."""

    class Recorder(list):
        def register_pass(self, scene, view_layer, name, *_):
            self.append(name)

    recorder = Recorder()
    register_passes(recorder, bpy.context.scene, bpy.context.view_layer)
    return recorder


def test_sockets_and_renders_have_the_same_passes(tmp_path):
    cube("Lens", QUARTZ, 340.0)
    assert set(registered()) == set(render_to_exr(tmp_path)["ViewLayer"])


def test_all_frames_have_the_same_bands(tmp_path):
    """An animated temperature changes no pass: the values that the interface shows decide, for all frames alike."""
    lens = cube("Lens", QUARTZ, 300.0)
    for frame, kelvin in ((1, 300.0), (3, 900.0)):
        lens["temperature"] = kelvin
        lens.keyframe_insert('["temperature"]', frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 3
    scene.frame_set(1)
    before = registered()
    render_to_exr(tmp_path, animation=True)
    frames = [set(read_exr(tmp_path / f"image_{frame:04d}.exr")["ViewLayer"]) for frame in (1, 2, 3)]
    assert frames[0] == frames[1] == frames[2] == set(before)
    scene.frame_set(3)
    assert set(registered()) != frames[0]  # at 900 K other edges suit the scene, so the test could fail


def test_view_layers_have_the_same_bands():
    scene = bpy.context.scene
    cube("Lens", QUARTZ, 340.0)
    window = material("Window", emissivity=GLASS)
    scene.view_layers.new("Other").material_override = window
    scenes = read_as_rendered()
    np.testing.assert_array_equal(scenes["ViewLayer"][0].band_edges, scenes["Other"][0].band_edges)
    np.testing.assert_array_equal(bands().edges, expected([GLASS, QUARTZ], [280.0, 340.0]).edges)


def test_what_decides():
    """Materials of what a render shows, instances too; temperatures of objects, attributes and surroundings; lights."""
    scene = bpy.context.scene
    cube("Lens", QUARTZ, 340.0)
    cube("Hidden", GLASS, 900.0).hide_render = True
    unseen = bpy.data.collections.new("Unseen")
    scene.collection.children.link(unseen)
    cube("In a hidden collection", GLASS, 900.0, unseen)
    unseen.hide_render = True
    np.testing.assert_array_equal(bands().edges, expected([QUARTZ], [280.0, 340.0]).edges)

    collection = bpy.data.collections.new("Windows")
    cube("Window", GLASS, 320.0, collection)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    assert "Window" not in scene.objects
    np.testing.assert_array_equal(bands().edges, expected([GLASS, QUARTZ], [280.0, 320.0, 340.0]).edges)

    attribute = bpy.data.objects["Lens"].data.attributes.new("temperature", "FLOAT", "POINT")
    attribute.data.foreach_set("value", np.linspace(300.0, 700.0, 8, dtype=np.float32))
    found = bands()
    np.testing.assert_array_equal(found.edges, expected([GLASS, QUARTZ], [280.0, 300.0, 320.0, 700.0]).edges)

    light = link("Sun", bpy.data.lights.new("Sun", "SUN"))
    lit = expected([GLASS, QUARTZ], [280.0, 300.0, 320.0, 700.0], [5772.0])
    assert bands().error == lit.error != found.error
    light.data.energy = 0.0
    assert bands().error == found.error


def test_bands_are_narrow_where_a_gas_absorbs():
    """A plume of carbon dioxide, 3 to 5 um: more edges between 4.1 and 4.7 um, where its strong lines are, than in all
    the rest, where uniform bands have 7 of 10. The world's air counts by its depth."""
    infrared = bpy.context.scene.infrared
    infrared.wavelength_min, infrared.wavelength_max, infrared.band_count = 3.0, 5.0, 10
    plume = cube("Plume", 0.9, 900.0)
    grey = bands().edges
    plume.data.materials[0]["gas"] = {"CO2": 0.1}
    edges = bands().edges
    in_band = (edges > 4.1) & (edges < 4.7)
    assert in_band.sum() > 6 > ((grey > 4.1) & (grey < 4.7)).sum()
    world = bpy.context.scene.world
    world["gas"], world["depth"] = {"CO2": 4e-4}, 500.0
    assert not np.array_equal(bands().edges, edges)


def test_grey_scenes_have_bands_of_equal_width():
    cube("Wall", 0.8, 300.0)
    np.testing.assert_allclose(bands().edges, np.linspace(7.5, 14.0, 6), atol=0.006)  # candidates are 0.01 um apart


def test_tolerance_takes_the_place_of_the_number():
    cube("Lens", QUARTZ, 340.0)
    infrared = bpy.context.scene.infrared
    infrared.band_tolerance = 0.05
    found = bands()
    np.testing.assert_array_equal(found.edges, expected([QUARTZ], [280.0, 340.0], tolerance=0.05).edges)
    assert found.error <= 0.05 and len(found.edges) > 6
    infrared.band_tolerance = 1e-9
    with pytest.raises(SceneError, match="a tolerance of 1e-09 K needs more than 256 bands"):
        bands()
    assert "a tolerance of 1e-09 K" in band_problem(infrared)


def test_a_reversed_range_is_told(tmp_path):
    cube("Lens", QUARTZ, 340.0)
    bpy.context.scene.infrared.wavelength_min = 20.0
    message = "Band edges must ascend: 20 um is followed by 14 um"
    assert band_problem(bpy.context.scene.infrared) == message
    assert registered() == []
    with pytest.raises(RuntimeError, match=message):
        render_to_exr(tmp_path)


def test_a_wrong_material_is_reported_as_such():
    """Not as a mistake of the bands."""
    cube("Lens", "Quarz", 340.0)
    assert band_problem(bpy.context.scene.infrared) == ""
    assert "the library has no material 'Quarz'" in str(read_as_rendered()["ViewLayer"])


def test_keeping_bands_makes_them_custom():
    lens = cube("Lens", QUARTZ, 340.0)
    infrared = bpy.context.scene.infrared
    infrared.wavelength_max = 13.9  # no round number in float32
    edges = bands().edges
    assert edges[-1] == 13.9
    assert bpy.ops.infrared.bands_keep() == {"FINISHED"}
    assert infrared.band_mode == "CUSTOM" and infrared.band_edges.endswith(", 13.9")
    lens["temperature"] = 900.0
    np.testing.assert_array_equal(read_band_edges(infrared), edges)
    assert not bpy.ops.infrared.bands_keep.poll()


@pytest.mark.parametrize("count", [256, 512])
def test_hundreds_of_bands_are_rendered(tmp_path, count):
    cube("Lens", QUARTZ, 340.0)
    infrared = bpy.context.scene.infrared
    infrared.band_count, infrared.passes = count, 1
    images = render_to_exr(tmp_path)["ViewLayer"]
    assert len(images) == count + 4 and set(images) == set(registered())
    assert all(np.all(images[name] > 0) for name in band_names(bands().edges))
