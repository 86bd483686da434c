# SPDX-License-Identifier: GPL-3.0-or-later
"""Compositor nodes that make a sensor's image of the bands, rendered through and compared with the engine's own."""

from unittest.mock import MagicMock

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.output.sensor import calibrate  # noqa: E402
from addon.solver.physics.sensors import BUILT_IN, band_weights  # noqa: E402
from addon.solver.physics.spectrum import band_radiance, sensor_radiance, uniform_edges  # noqa: E402
from addon.ui import sensor_image  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, render_to_exr  # noqa: E402

FLOAT32 = 2.0**-24  # relative: one rounding
KELVIN = (205.0, 260.0, 300.0, 310.0, 450.0, 700.0, 1200.0, 1900.0)
TOLERANCE = 0.005  # K: a tenth of what good thermal cameras can tell apart (50 mK)
RANGES = (  # sensor, um, K: how far the formula may be off
    ("BOX", 3.0, 5.0, 0.005),
    ("BOX", 8.0, 14.0, 0.005),
    ("BOX", 7.5, 14.0, 0.005),
    ("BOX", 0.9, 1.7, 0.01),
    ("INSB", 3.0, 5.0, 0.005),
    ("HGCDTE", 8.0, 11.5, 0.005),
    ("MICROBOLOMETER", 7.5, 14.0, 0.005),
    ("INSB", 3.0, 14.0, 0.005),  # most bands are blind
)


def temperature(radiance, calibration):
    """The formula of a Calibration, K."""
    v = np.log(1.0 + calibration.scale / radiance)
    x = np.clip(calibration.slope * np.log(v) + calibration.offset, 0.0, 1.0)
    return np.polynomial.polynomial.polyval(x, calibration.coefficients) / v


@pytest.mark.parametrize("sensor, low, high, tolerance", RANGES)
def test_the_formula_inverts_planck(sensor, low, high, tolerance):
    edges = uniform_edges(low, high, 16)
    weights = band_weights(BUILT_IN[sensor]() if sensor in BUILT_IN else None, edges)
    kelvin = np.geomspace(200.0, 2000.0, 2001)
    shown = temperature(sensor_radiance(edges, weights, kelvin), calibrate(edges, weights))
    np.testing.assert_allclose(shown, kelvin, rtol=0, atol=tolerance)


def test_the_formula_is_exact_for_a_narrow_band():
    edges = np.array([10.0, 10.0 + 1e-6])
    kelvin = np.geomspace(100.0, 5000.0, 50)  # outside the fit, too
    radiance = band_radiance(edges, kelvin)[:, 0]
    # The band is 1e-7 of its wavelength wide; the fit's own rounding is far below
    np.testing.assert_allclose(temperature(radiance, calibrate(edges, np.ones(1))), kelvin, rtol=1e-7)


# In Blender -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def infrared(reset_blender):
    """A row of cubes from cold to hot before a cold sky; every pixel of the picture shows one of them."""
    camera(width=len(KELVIN), height=2)
    bpy.context.scene.camera.data.type = "ORTHO"
    bpy.context.scene.camera.data.ortho_scale = len(KELVIN)
    for i, kelvin in enumerate(KELVIN):
        link(f"Cube {i}", cube_mesh(), temperature=kelvin).location.x = i + 0.5 - len(KELVIN) / 2
    for obj in bpy.context.scene.objects:
        obj.scale.y = 4.0
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads = 2, 1000, 1
    infrared.default_emissivity = 0.9
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    return infrared


def show(group_node):
    """Let the compositor's picture be (Radiance, Temperature, 0) of the group."""
    tree = group_node.id_data
    both = tree.nodes.new("CompositorNodeCombineColor")
    tree.links.new(group_node.outputs["Radiance"], both.inputs["Red"])
    tree.links.new(group_node.outputs["Temperature"], both.inputs["Green"])
    output = next(node for node in tree.nodes if node.bl_idname in ("CompositorNodeComposite", "NodeGroupOutput"))
    tree.links.new(both.outputs[0], output.inputs["Image"])


def group_nodes():
    tree = sensor_image.compositor_tree(bpy.context.scene)
    return [node for node in tree.nodes if node.bl_idname == "CompositorNodeGroup"]


def composite(folder):
    """(radiance, temperature) from the compositor and the passes of the same render."""
    layers = render_to_exr(folder)
    picture = next(images["Combined"] for name, images in layers.items() if name != "ViewLayer")
    return picture[..., 0], picture[..., 1], layers["ViewLayer"]


@pytest.mark.parametrize("bands", [1, 16, 256])
def test_an_ideal_sensor_sees_radiance_and_temperature_of_the_engine(infrared, tmp_path, bands):
    infrared.band_count = bands
    assert_nodes_agree(infrared, tmp_path)


@pytest.mark.parametrize("sensor", ["HGCDTE", "MICROBOLOMETER", "CUSTOM"])
def test_the_scenes_sensor_sees_radiance_and_temperature_of_the_engine(infrared, tmp_path, sensor):
    bpy.context.scene["sensor_response"] = [8.0, 0.0, 10.0, 1.0, 12.0, 1.0, 13.5, 0.2]
    infrared.sensor = sensor
    assert_nodes_agree(infrared, tmp_path)


def test_temperatures_are_corrected_alike(infrared, tmp_path):
    infrared.sensor, infrared.assumed_emissivity, infrared.reflected_temperature = "MICROBOLOMETER", 0.9, 150.0
    assert_nodes_agree(infrared, tmp_path)


def test_air_and_optics_are_corrected_alike(infrared, tmp_path):
    infrared.air_transmission, infrared.air_temperature = 0.95, 160.0
    infrared.optics_transmission, infrared.optics_temperature = 0.9, 150.0
    assert_nodes_agree(infrared, tmp_path)


def assert_nodes_agree(infrared, folder):
    """The group shows what the engine's own passes do."""
    assert bpy.ops.infrared.sensor_image() == {"FINISHED"}
    (node,) = group_nodes()
    assert len(node.inputs) == len(bands_of(infrared)) - 1 and all(socket.is_linked for socket in node.inputs)
    show(node)
    radiance, temperature, passes = composite(folder)
    # Each product and sum rounds, and so do the passes and weights
    np.testing.assert_allclose(radiance, passes["Radiance"], rtol=(len(node.inputs) + 4) * FLOAT32)
    np.testing.assert_allclose(temperature, passes["Temperature"], rtol=0, atol=TOLERANCE)
    assert np.ptp(passes["Temperature"]) > 1000.0  # the picture shows the row of cubes


def bands_of(infrared):
    return uniform_edges(infrared.wavelength_min, infrared.wavelength_max, infrared.band_count)


def test_another_sensor_than_the_scenes(infrared, tmp_path):
    """Its image is that of a render through it."""
    assert bpy.ops.infrared.sensor_image(sensor="HGCDTE") == {"FINISHED"}
    (node,) = group_nodes()
    show(node)
    radiance, temperature, ideal = composite(tmp_path)
    infrared.sensor = "HGCDTE"
    *_, passes = composite(tmp_path)
    np.testing.assert_allclose(radiance, passes["Radiance"], rtol=(len(node.inputs) + 4) * FLOAT32)
    np.testing.assert_allclose(temperature, passes["Temperature"], rtol=0, atol=TOLERANCE)
    assert np.all(radiance < 0.9 * ideal["Radiance"])  # the ideal sensor sees more


def test_what_emits_nothing_has_no_temperature(infrared, tmp_path):
    for obj in bpy.context.scene.objects:
        obj["temperature"] = 0.0
    bpy.ops.infrared.sensor_image()
    show(group_nodes()[0])
    radiance, temperature, _ = composite(tmp_path)
    assert not radiance.any() and not temperature.any()


def test_again_it_follows_the_bands_and_keeps_what_is_linked(infrared):
    bpy.ops.infrared.sensor_image()
    (node,) = group_nodes()
    show(node)
    infrared.band_count = 5
    bpy.ops.infrared.sensor_image()
    assert group_nodes() == [node] and len(node.inputs) == 5
    assert all(socket.is_linked for socket in [*node.inputs, *node.outputs])


def test_a_senseless_sensor_is_told(infrared):
    with pytest.raises(RuntimeError, match="sensor_response is None"):
        bpy.ops.infrared.sensor_image(sensor="CUSTOM")
    with pytest.raises(RuntimeError, match="'InSb' does not respond between 7.5 and 14 um"):
        bpy.ops.infrared.sensor_image(sensor="INSB")
    assert not any(sensor_image.MARK in group for group in bpy.data.node_groups)


@pytest.mark.parametrize(
    "tree, engine, shown",
    [("CompositorNodeTree", "INFRARED_PHOTONS", True), ("ShaderNodeTree", "INFRARED_PHOTONS", False),
     ("CompositorNodeTree", "CYCLES", False)],
)  # fmt: skip
def test_the_add_menu_of_the_compositor_has_it(infrared, tree, engine, shown):
    menu, context = MagicMock(), MagicMock()
    context.space_data.tree_type, context.scene.render.engine = tree, engine
    sensor_image.draw_add_menu(menu, context)
    assert menu.layout.operator.called == shown
    assert sensor_image.draw_add_menu in bpy.types.NODE_MT_add._dyn_ui_initialize()
