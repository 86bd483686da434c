# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases in Blender: materials that fill closed meshes, the world's own, and what is said of those that cannot be."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.solver import SceneError, Settings, render  # noqa: E402
from addon.solver.physics.spectrum import band_radiance  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402


@pytest.fixture
def scene(reset_blender):
    """A black floor at 300 K, a cube of gas at 600 K over it, and a camera that looks down through both."""
    camera(width=4, height=3).data.angle = 1e-3
    floor = link("Floor", cube_mesh("Floor"), temperature=300.0)
    floor.scale, floor.location = (10.0, 10.0, 0.1), (0.0, 0.0, -2.0)
    floor.data.materials.append(material("Black", emissivity=1.0))
    gas = link("Plume", cube_mesh("Plume"), temperature=600.0)
    gas.data.materials.append(material("Gas", absorption=0.5))
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world["temperature"] = 300.0
    bpy.context.scene.infrared.band_count = 1
    return gas


def seen(scene):
    """Mean radiance of the image over that of a blackbody of 300 K and one of 600 K."""
    radiance = float(render(scene, Settings(passes=1, photons_per_pass=1000)).radiance().mean())
    return (radiance - black(scene, 300.0)) / (black(scene, 600.0) - black(scene, 300.0))


def black(scene, kelvin):
    return float(band_radiance(scene.band_edges, kelvin).sum())


def test_a_material_with_absorption_fills_its_mesh(scene):
    """1 m of optical depth 0.5 before a floor at the temperature of the surroundings."""
    read_scene, warnings = read()
    assert warnings == [] and len(read_scene.media) == 1
    assert len(read_scene.triangles) == 12  # the floor
    assert seen(read_scene) == pytest.approx(1.0 - np.exp(-0.5), rel=1e-5)


def test_lengths_follow_the_unit_scale(scene):
    """A cube of one unit, which is a millimetre."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    scene.data.materials[0]["absorption"] = 500.0
    assert seen(read()[0]) == pytest.approx(1.0 - np.exp(-0.5), rel=1e-5)


def test_absorption_may_depend_on_the_wavelength(scene):
    """Twice the coefficient at the end of the band: the mean between both, weighted with what the gas emits."""
    low, high = read()[0].band_edges[[0, -1]]
    scene.data.materials[0]["absorption"] = [float(low), 0.5, float(high), 1.0]
    assert 1.0 - np.exp(-0.5) < seen(read()[0]) < 1.0 - np.exp(-1.0)


def test_the_world_holds_a_gas(scene):
    """At the temperature of the floor and the sky, so that it dims the cube's light and no more. The camera sees from
    its clip start on, 0.1 m."""
    world = bpy.context.scene.world
    world["absorption"], world["depth"] = 0.1, 100.0
    read_scene, warnings = read()
    assert warnings == [] and [medium.temperature for medium in read_scene.media] == [600.0, 300.0]
    assert read_scene.world_depth == 100.0
    own = 0.5 / 0.6 * (1.0 - np.exp(-0.6)) * np.exp(-0.1 * 4.4)  # the cube begins 4.5 m from the camera
    assert seen(read_scene) == pytest.approx(own, rel=1e-5)


def test_a_gas_may_scatter(scene):
    """Lengths in millimetres: coefficients are still those of a metre."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    paint = scene.data.materials[0]
    paint["scattering"], paint["anisotropy"] = [8.0, 100.0, 12.0, 300.0], 0.6
    (medium,) = read()[0].media
    assert medium.scatters and medium.anisotropy == 0.6
    np.testing.assert_allclose(medium.scattering, [[8.0, 0.1], [12.0, 0.3]])


def test_a_gas_may_be_a_mixture(scene):
    """By its species, at the object's pressure; lengths in millimetres are converted by the solver."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    scene["pressure"] = 2e5
    paint = scene.data.materials[0]
    del paint["absorption"]
    paint["gas"] = {"H2O": 0.12, "CO2": 0.1, "soot": 1e-7}
    read_scene, warnings = read()
    (medium,) = read_scene.media
    assert warnings == [] and medium.gas == {"H2O": 0.12, "CO2": 0.1, "soot": 1e-7}
    assert medium.pressure == 2e5 and medium.metres == pytest.approx(0.001)
    assert medium.absorption == 0.0 and medium.temperature == 600.0


def test_a_gas_may_have_a_name(scene):
    """Of the library, letter case ignored; the world's as well, at its own pressure, beside what it absorbs."""
    scene.data.materials[0]["gas"] = "exhaust, PETROL"
    world = bpy.context.scene.world
    world["gas"], world["pressure"], world["depth"] = "Air, 20 C, 50 % humidity", 9e4, 10.0
    plume, air = read()[0].media
    assert plume.gas == {"H2O": 0.132, "CO2": 0.125, "CO": 0.005} and plume.absorption == 0.5
    assert plume.pressure == 101325.0 and air.pressure == 9e4 and set(air.gas) == {"H2O", "CO2"}
    assert 0.3 < seen(read()[0]) < 1.0


def test_a_gas_may_hold_aerosols(scene):
    """By g/m3, beside molecules and what is given by coefficients; lengths in millimetres; or a mixture by its name."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    scene.data.materials[0]["gas"] = {"H2O": 0.02, "Water droplets 5 um": 2.0}
    (medium,) = read()[0].media
    assert medium.gas == {"H2O": 0.02} and medium.scatters
    extinction = sum(np.interp(10.0, *medium.curve(each)) for each in ("absorption", "scattering"))
    assert extinction == pytest.approx(5e-4 + 2.0 * 172e-6, rel=0.005)  # of 1 mm: 0.5 1/m, and 172 1/km for 1 g/m3
    assert np.interp(10.0, *medium.curve("anisotropy")) == pytest.approx(0.83, abs=0.01)
    scene.data.materials[0]["gas"] = "Fog"
    (medium,) = read()[0].media
    assert medium.scatters and set(medium.gas) == {"H2O", "CO2"}


@pytest.mark.parametrize("value, message", [
    ("petrol exhaust", "Material 'Gas': the library has no gas 'petrol exhaust'; close names: 'Exhaust, "),
    (0.3, "Material 'Gas': gas is 0.3, expected the name of a gas of the library, or mole fractions such as"),
    ({"CO2": "much"}, "Material 'Gas': gas is {'CO2': 'much'}, expected the name"),
    ({"Water droplets": 0.1}, "Medium 'Plume: Gas': unknown species 'Water droplets'; known are H2O, CO2, CO, CH4, "),
    ({"Ice 10 um": -1.0}, "Medium 'Plume: Gas': -1 g/m3 of Ice 10 um; it is finite and at least 0"),
    ({"NH3": 0.1}, "Medium 'Plume: Gas': unknown species 'NH3'; known are H2O"),
    ({"CO2": 1.5}, "Medium 'Plume: Gas': the fraction of CO2 is 1.5; it is from 0 to 1"),
    ({"CO2": 0.7, "H2O": 0.7}, "Medium 'Plume: Gas': the mole fractions add up to 1.4"),
])  # fmt: skip
def test_mixtures_that_make_no_sense_are_errors(scene, value, message):
    scene.data.materials[0]["gas"] = value
    with pytest.raises(SceneError) as error:
        read()
    assert message in str(error.value)


@pytest.mark.parametrize("value, message", [
    (-5.0, "Medium 'Plume: Gas': pressure -5 Pa; it is finite and above 0"),
    ("high", "Object 'Plume': pressure is 'high', expected a number in pascals"),
])  # fmt: skip
def test_pressure_that_makes_no_sense_is_an_error(scene, value, message):
    scene["pressure"] = value
    with pytest.raises(SceneError) as error:
        read()
    assert message in str(error.value)


def test_without_gas_there_are_no_media(scene):
    bpy.data.objects.remove(scene)
    assert read()[0].media == ()


@pytest.mark.parametrize("change, warning", [
    ("open", "'Plume': the mesh of a gas must be closed, but it is open at ("),
    ("no depth", "'Sky': its gas has no depth, so rays that leave the scene cross none of it"),
    ("no temperature", "'Plume': no temperature; the ambient"),
    ("attribute", "'Plume': a gas has one temperature; the mean of its mesh counts"),
])  # fmt: skip
def test_what_a_gas_lacks_is_named(scene, change, warning):
    if change == "open":
        import bmesh

        shape = bmesh.new()
        shape.from_mesh(scene.data)
        bmesh.ops.delete(shape, geom=[next(iter(shape.faces))], context="FACES_ONLY")
        shape.to_mesh(scene.data)
    elif change == "no depth":
        bpy.context.scene.world["absorption"] = 0.1
    elif change == "no temperature":
        del scene["temperature"]
    else:
        values = scene.data.attributes.new("temperature", "FLOAT", "FACE").data
        values.foreach_set("value", np.float32([500, 500, 500, 700, 700, 700]))
    read_scene, warnings = read()
    assert any(each.startswith(warning) for each in warnings), warnings
    if change == "open":
        assert read_scene.media == ()
    elif change == "attribute":
        assert read_scene.media[0].temperature == 600.0


@pytest.mark.parametrize("owner, value, message", [
    ("gas", -1.0, "Medium 'Plume: Gas': absorption -1 1/m; it is finite and at least 0"),
    ("gas", "air", "Material 'Gas': absorption is 'air', expected a number"),
    ("gas", [4.0, 1.0, 5.0], "Material 'Gas': the absorption list has 3 numbers"),
    ("anisotropy", 2.0, "Medium 'Plume: Gas': anisotropy 2 is outside -1..1"),
    ("world", float("nan"), "Medium 'World 'Sky'': absorption nan 1/m"),
])  # fmt: skip
def test_absorption_that_makes_no_sense_is_an_error(scene, owner, value, message):
    block = bpy.context.scene.world if owner == "world" else scene.data.materials[0]
    block["anisotropy" if owner == "anisotropy" else "absorption"] = value
    with pytest.raises(SceneError) as error:
        read()
    assert message in str(error.value)
