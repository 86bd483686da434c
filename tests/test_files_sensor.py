# SPDX-License-Identifier: GPL-3.0-or-later
"""Compositor nodes that make a sensor's image of the bands, rendered through and compared with the engine's own."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender_helpers import camera, cube_mesh, link, render_to_exr  # noqa: E402

from addon import sensor_image  # noqa: E402
from addon.output.sensor import band_weights, calibrate  # noqa: E402
from addon.solver.spectrum import band_radiance, uniform_edges  # noqa: E402

FLOAT32 = 2.0**-24  # relative: one rounding
KELVIN = (205.0, 260.0, 300.0, 310.0, 450.0, 700.0, 1200.0, 1900.0)
TOLERANCE = 0.005  # K: a tenth of what good thermal cameras can tell apart (50 mK)


def mean_over(function, low, high, count=20_000):
    """Mean of a function over an interval, by midpoints."""
    return float(np.mean(function(low + (high - low) * (np.arange(count) + 0.5) / count)))


def test_weights_are_the_integrals_of_the_response():
    edges = np.array([3.0, 5.0, 8.0, 9.5, 14.0])
    response = np.array([[4.0, 0.2], [8.5, 1.0], [9.0, 0.5], [20.0, 0.0]])
    expected = [
        (high - low) * mean_over(lambda um: np.interp(um, *response.T), low, high)
        for low, high in zip(edges[:-1], edges[1:], strict=True)
    ]
    # Midpoints are exact for straight pieces but for the four intervals that hold a kink
    np.testing.assert_allclose(band_weights(edges, response), expected, rtol=1e-7)
    np.testing.assert_array_equal(band_weights(edges), np.diff(edges))


def temperature(radiance, calibration):
    """The formula of a Calibration, K."""
    v = np.log(1.0 + calibration.scale / radiance)
    x = np.clip(calibration.slope * np.log(v) + calibration.offset, 0.0, 1.0)
    return np.polynomial.polynomial.polyval(x, calibration.coefficients) / v


@pytest.mark.parametrize("low, high, tolerance", [(3, 5, 0.005), (8, 14, 0.005), (7.5, 14, 0.005), (0.9, 1.7, 0.01)])
@pytest.mark.parametrize("response", [None, [[1.0, 0.3], [1.3, 1.0], [4.0, 1.0], [9.0, 0.4], [12.0, 1.0], [14.0, 0.1]]])
def test_the_formula_inverts_planck(low, high, tolerance, response):
    edges = uniform_edges(low, high, 16)
    weights = band_weights(edges, None if response is None else np.array(response))
    kelvin = np.geomspace(200.0, 2000.0, 2001)
    radiance = band_radiance(edges, kelvin) @ (weights / np.diff(edges))
    np.testing.assert_allclose(temperature(radiance, calibrate(edges, weights)), kelvin, rtol=0, atol=tolerance)


def test_the_formula_is_exact_for_a_narrow_band():
    edges = np.array([10.0, 10.0 + 1e-6])
    kelvin = np.geomspace(100.0, 5000.0, 50)  # outside the fit, too
    radiance = band_radiance(edges, kelvin)[:, 0]
    # The band is 1e-7 of its wavelength wide; the fit's own rounding is far below
    np.testing.assert_allclose(temperature(radiance, calibrate(edges, np.diff(edges))), kelvin, rtol=1e-7)


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
def test_a_flat_sensor_sees_radiance_and_temperature_of_the_engine(infrared, tmp_path, bands):
    infrared.band_count = bands
    assert bpy.ops.infrared.sensor_image() == {"FINISHED"}
    (node,) = group_nodes()
    assert len(node.inputs) == bands and all(socket.is_linked for socket in node.inputs)
    show(node)
    radiance, temperature, passes = composite(tmp_path)
    # Each product and sum rounds, and so do the passes and weights
    np.testing.assert_allclose(radiance, passes["Radiance"], rtol=(bands + 4) * FLOAT32)
    np.testing.assert_allclose(temperature, passes["Temperature"], rtol=0, atol=TOLERANCE)
    assert np.ptp(passes["Temperature"]) > 1000.0  # the picture shows the row of cubes


def test_a_response_weights_the_bands(infrared, tmp_path):
    infrared.band_count = 8
    assert bpy.ops.infrared.sensor_image(response="8, 0, 10, 1, 12, 1, 13.5, 0.2") == {"FINISHED"}
    (node,) = group_nodes()
    show(node)
    radiance, temperature, passes = composite(tmp_path)
    edges = uniform_edges(7.5, 14.0, 8)
    weights = band_weights(edges, np.array([[8, 0], [10, 1], [12, 1], [13.5, 0.2]]))
    bands = [passes[socket.name] for socket in node.inputs]
    expected = np.tensordot(weights, np.array(bands, float), 1)
    np.testing.assert_allclose(radiance, expected, rtol=12 * FLOAT32)
    # What the nodes call the temperature is that of the blackbody which this sensor would see alike
    blackbody = band_radiance(edges, temperature.astype(float)) @ (weights / np.diff(edges))
    warmer = band_radiance(edges, temperature.astype(float) + TOLERANCE) @ (weights / np.diff(edges))
    assert np.all(np.abs(blackbody - expected) < warmer - blackbody)


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


@pytest.mark.parametrize(
    "response, message",
    [("8, 1, 9", "no list of pairs"), ("9, 1, 8, 1", "rise from pair to pair"), ("8, -1", "0 or more"),
     ("8, x", "no list of pairs"), ("8, 0", "sees nothing between 7.5 and 14 um")],
)  # fmt: skip
def test_a_senseless_response_is_told(infrared, response, message):
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.infrared.sensor_image(response=response)
    assert not any(sensor_image.MARK in group for group in bpy.data.node_groups)
