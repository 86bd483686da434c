# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases in Blender's interface: species as rows, the library of mixtures with its pictures, and the checks."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.rendering.checks import material_checks, object_checks, scene_checks, world_gas_checks  # noqa: E402
from addon.solver.physics.aerosols import aerosols  # noqa: E402
from addon.solver.physics.gases import find_gas, gases  # noqa: E402
from addon.solver.physics.transmission import transmittance  # noqa: E402
from addon.solver.scene import MOLECULES, SOOT, Medium  # noqa: E402
from addon.ui import panels  # noqa: E402
from addon.ui.gases import pictures, species  # noqa: E402
from addon.ui.materials import curve_image, curve_previews  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
operators = bpy.ops.infrared


@pytest.fixture(params=["MATERIAL", "WORLD"])
def block(request):
    """A material or a world, and Blender's context while its panel is shown."""
    if request.param == "WORLD":
        found = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    else:
        found = material("Gas")
    with bpy.context.temp_override(**{request.param.lower(): found}):
        yield found, request.param


# Pressure


def rows(monkeypatch, obj):
    """Keys of the custom properties that the panel of an object has a row for."""
    shown = []
    monkeypatch.setattr(panels, "draw_custom_property", lambda *args: shown.append(args[3]))
    monkeypatch.setattr(panels, "draw_object_checks", lambda *_: None)  # which need a window

    class Layout:
        def __getattr__(self, _name):
            return lambda *_, **__: Layout()

    nothing = dict.fromkeys(("draw_surface", "draw_heat_map"), lambda *_: None)
    context = SimpleNamespace(scene=bpy.context.scene, view_layer=bpy.context.view_layer, object=obj)
    panels.INFRARED_PT_object.draw(SimpleNamespace(layout=Layout(), column=Layout, **nothing), context)
    return shown


@pytest.mark.parametrize("paint", [None, "Gas"])
def test_the_pressure_of_a_volume_has_a_row(monkeypatch, paint):
    """As a mesh of gas has; a volume with species in its grids needs no material."""
    volume = link("Volume", bpy.data.volumes.new("Volume"))
    if paint:
        volume.data.materials.append(material(paint, absorption=0.1))
    assert rows(monkeypatch, volume) == ["temperature", "pressure"]
    bpy.context.view_layer.objects.active = volume
    operators.property_add(owner="OBJECT", key="pressure")
    assert volume["pressure"] == 101325.0
    volume["pressure"] = -5.0
    assert [each.text for each in object_checks(volume, bpy.context.scene.infrared, bpy.context.view_layer)] == [
        "Medium 'Volume': pressure -5 Pa; it is finite and above 0"
    ]


def test_a_surface_has_no_row_of_pressure(monkeypatch):
    assert rows(monkeypatch, link("Cube", cube_mesh("Cube"))) == ["temperature"]


# Species


def test_species_are_added_changed_and_removed(block):
    gas, owner = block
    operators.species_set(owner=owner, species="H2O", amount=120_000.0)
    operators.species_set(owner=owner, species="soot", amount=0.01)
    assert gas["gas"].to_dict() == {"H2O": 0.12, "soot": 1e-8}
    operators.species_set(owner=owner, species="H2O", amount=420.0)
    assert gas["gas"].to_dict() == {"H2O": 0.00042, "soot": 1e-8}
    operators.species_remove(owner=owner, species="H2O")
    operators.species_remove(owner=owner, species="soot")
    assert "gas" not in gas


def test_a_mixture_is_used_by_its_name_and_becomes_a_list(block):
    gas, owner = block
    operators.gas_library(owner=owner, name="Breath")
    assert gas["gas"] == "Breath"
    operators.species_set(owner=owner, species="CO2", amount=50_000.0)
    assert gas["gas"].to_dict() == {"H2O": 0.062, "CO2": 0.05}
    operators.gas_library(owner=owner, name="Flame, sooty")
    operators.species_make(owner=owner)
    assert gas["gas"].to_dict() == find_gas("Flame, sooty")


def test_what_is_no_mixture_is_refused(block):
    gas, owner = block
    with pytest.raises(RuntimeError, match="the library has no gas 'Laughing gas'"):
        operators.gas_library(owner=owner, name="Laughing gas")
    gas["gas"] = "Laughing gas"
    with pytest.raises(RuntimeError, match="The library has no gas 'Laughing gas'"):
        operators.species_make(owner=owner)
    assert gas["gas"] == "Laughing gas"


def test_every_species_has_a_row():
    assert [identifier for identifier, *_ in species.SPECIES] == [*MOLECULES, SOOT, *aerosols()] == list(species.NEW)


# Pictures


def test_pictures_show_what_physics_says():
    """In each column of pixels the middle of the line is at the mean of the transmittance there."""
    gas = pictures.mixture("Exhaust, petrol", 600.0)
    points = pictures.gas_points(gas, 0.3, 3.0, 5.0, 128)
    fine = np.linspace(3.0, 5.0, 128 * 100 + 1)
    fine = 0.5 * (fine[:-1] + fine[1:])
    expected = transmittance(gas, fine, 0.3).reshape(128, 100).mean(axis=1)
    np.testing.assert_allclose(points[:, 1], expected, atol=0.01)
    assert expected.min() < 0.3 and expected.max() > 0.99  # CO2 at 4.3 um, and a window
    image = curve_image.draw_curve(points, 3.0, 5.0, (128, 128))
    line = (image == np.float32(curve_image.CURVE)).all(axis=-1)
    for column in (np.argmin(expected), np.argmax(expected)):
        rows = np.flatnonzero(line[:, column])
        assert rows.min() / 128 - 0.05 < 0.04 + 0.92 * expected[column] < rows.max() / 128 + 0.05


@pytest.mark.parametrize("name", gases())
def test_every_mixture_has_a_picture(name):
    for kelvin in (300.0, 1800.0):
        points = pictures.gas_points(pictures.mixture(name, kelvin), 10.0, *curve_previews.THUMBNAIL_RANGE, 32)
        assert np.all((points[:, 1] >= 0.0) & (points[:, 1] <= 1.0))
        assert points[:, 1].min() < 1.0
        pictures.mixture_icon(name, kelvin, 10.0)
        assert tuple(curve_previews._previews[f"mixture {name}"].image_size) == curve_previews.THUMBNAIL_SIZE


def test_the_picture_follows_the_length():
    edges = np.array([8.0, 14.0])
    fog = Medium("fog", 0.1, 290.0, 0.1)
    pictures.gas_icon("test", fog, 1.0, edges)
    first = list(curve_previews._previews["test"].image_pixels_float)
    pictures.gas_icon("test", fog, 10.0, edges)
    assert list(curve_previews._previews["test"].image_pixels_float) != first


def test_pictures_need_no_numba():
    """Which takes seconds to load, and Blender draws panels all the time."""
    code = (
        "import sys, addon; addon.register()\n"
        "from addon.ui.gases.pictures import mixture_icon\n"
        "from addon.rendering.checks import material_checks\n"
        "import bpy; gas = bpy.data.materials.new('Gas'); gas['gas'] = 'Breath'\n"
        "mixture_icon('Breath', 300.0, 1.0); material_checks(gas, bpy.context.scene.infrared)\n"
        "sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


# Checks


@pytest.fixture
def plume():
    """A cube of gas over a floor, of which nothing is to be said."""
    camera()
    floor = link("Floor", cube_mesh("Floor"), temperature=300.0)
    floor.location.z = -2.0
    floor.data.materials.append(material("Paint", emissivity=0.9))
    plume = link("Plume", cube_mesh("Plume"), temperature=600.0)
    plume.data.materials.append(material("Gas", gas={"CO2": 0.1}, absorption=0.1))
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    world["temperature"] = 280.0
    assert found() == []
    return plume


def found(*levels):
    """Texts of the checks of these levels, all but hints without any."""
    bpy.context.view_layer.update()
    levels = levels or ("ERROR", "WARNING")
    checks = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in checks if check.level in levels]


def open_mesh(plume):
    mesh = plume.data
    faces = [list(face.vertices) for face in mesh.polygons][1:]
    points = [list(vertex.co) for vertex in mesh.vertices]
    mesh.clear_geometry()
    mesh.from_pydata(points, [], faces)


def turn_a_face(plume):
    plume.data.polygons[0].flip()
    plume.data.update()


def take_the_floor_away(_plume):
    bpy.data.objects.remove(bpy.data.objects["Floor"])


def fill_world(**properties):
    def fill(_plume):
        for key, value in properties.items():
            bpy.context.scene.world[key] = value

    return fill


def change(**properties):
    """A function that changes the gas; without a value the property is removed."""

    def edit(plume):
        paint = plume.data.materials[0]
        for key, value in properties.items():
            if value is None:
                del paint[key]
            else:
                paint[key] = value

    return edit


def group_world(plume):
    bpy.context.scene.infrared.group_exr_path = "/tmp/never_written.exr"
    fill_world(temperature_group="sky", absorption=0.1, depth=10.0)(plume)


def group_plume(plume):
    bpy.context.scene.infrared.group_exr_path = "/tmp/never_written.exr"
    plume["temperature_group"] = "plume"


@pytest.mark.parametrize("damage, level, message", [
    (open_mesh, "WARNING", "Object 'Plume': the mesh of a gas must be closed, but it is open at (-0.5, "),
    (lambda plume: plume.pop("temperature"), "WARNING", "Object 'Plume': its gas has no temperature; the ambient 293"),
    (lambda plume: plume.__setitem__("pressure", -5.0), "ERROR", "Medium 'Plume': pressure -5 Pa"),
    (lambda plume: plume.__setitem__("pressure", "high"), "ERROR", "Object 'Plume': pressure is 'high', expected a"),
    (change(absorption=-1.0), "ERROR", "Medium 'Gas': absorption -1 1/m; it is finite and at least 0"),
    (turn_a_face, "WARNING", "Object 'Plume': the mesh of a gas must be closed, but it is twisted at ("),
    (take_the_floor_away, "ERROR", "has nothing to render: no visible object has faces, but of gas, which needs a"),
    (change(absorption=[3.0, 0.1, 4.2, 50.0]), "WARNING", "'Gas': absorption is known from 3 to 4.2 µm; the bands rea"),
    (change(scattering=float("nan")), "ERROR", "Medium 'Gas': scattering nan 1/m"),
    (change(anisotropy=3.0), "ERROR", "Medium 'Gas': anisotropy 3 is outside -1..1"),
    (change(gas="Exhaust, petrl"), "ERROR", "the library has no gas 'Exhaust, petrl'; close names: 'Exhaust, petrol'"),
    (change(gas={"NH3": 0.1}), "ERROR", "Medium 'Gas': unknown species 'NH3'; known are H2O"),
    (change(gas={"CO2": 0.7, "H2O": 0.7}), "ERROR", "the mole fractions add up to 1.4"),
    (change(gas={"CO": 0.1}, absorption=None), "WARNING", "'Gas': its gas absorbs and scatters nothing from 7.5 to 14"),
    (change(gas=None, absorption=0.0), "WARNING", "Material 'Gas': its gas absorbs and scatters nothing from 7.5 to"),
    (fill_world(absorption=0.1), "WARNING", "World 'Sky': its gas has no depth, so rays that leave the scene"),
    (fill_world(absorption=0.1, depth=-3.0), "ERROR", "World: depth -3 m; the depth of its gas is finite and at least"),
    (fill_world(absorption=0.1, depth="far"), "ERROR", "World 'Sky': depth is 'far', expected a number in metres"),
    (fill_world(absorption=-0.1, depth=3.0), "ERROR", "Medium 'Sky': absorption -0.1 1/m"),
    (fill_world(scattering=0.0, depth=3.0), "WARNING", "World 'Sky': its gas absorbs and scatters nothing from"),
    (group_world, "WARNING", "World 'Sky': its gas is in no temperature group: recombined for other surroundings, the"),
    (group_plume, "WARNING", "Object 'Plume': temperature groups are for surfaces; the gas stays as it is"),
])  # fmt: skip
def test_checks_name_what_is_wrong_with_gas(plume, damage, level, message):
    damage(plume)
    texts = found()
    assert len(texts) == 1 and message in texts[0] and texts == found(level), texts


def test_air_without_a_temperature_is_told(plume):
    del bpy.context.scene.world["temperature"]
    fill_world(absorption=0.1, depth=10.0)(plume)
    expected = "its gas has no temperature; it absorbs, and emits nothing, as at 0 K"
    assert any(expected in text for text in found("WARNING"))
    assert any(expected in text for text in read()[1])


def test_the_reader_tells_of_groups_too(plume):
    group_world(plume)
    assert any("'Sky': its gas is in no temperature group" in text for text in read()[1])


def test_panels_have_the_checks_of_their_own(plume):
    infrared = bpy.context.scene.infrared
    assert material_checks(plume.data.materials[0], infrared) == []
    assert world_gas_checks(bpy.context.scene.world, infrared) == [] == world_gas_checks(None, infrared)


def test_of_a_mesh_with_a_surface_the_gas_alone_is_looked_at(plume):
    """One face is painted: what is left of the gas is open."""
    plume.data.materials.append(bpy.data.materials["Paint"])
    assert found() == []
    plume.data.polygons[0].material_index = 1
    plume.data.update()
    assert "Object 'Plume': the mesh of a gas must be closed" in found("WARNING")[0]
