# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes in Blender: what OpenVDB files, geometry nodes and smoke domains hold arrives cell by cell where it is."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading import volumes  # noqa: E402
from addon.reading.warnings import Warnings  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver import SceneError, Settings, memory, render  # noqa: E402
from addon.solver.physics.spectrum import band_radiance  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402

SHIFT = 0.5 if bpy.app.version >= (5, 0) else 0.0  # cells by which OpenVDB's integers lie behind the corners of cells
LOW = np.array([-5, 7, 0])  # index of the first cell of the arrays
DENSITY = np.random.default_rng(1).uniform(0.5, 2.0, (9, 3, 12)).astype(np.float32)
KELVIN = np.random.default_rng(2).uniform(300.0, 900.0, (9, 3, 12)).astype(np.float32)
MATRIX = np.array([[0.1, 0.02, 0, 1.0], [0, 0.2, 0, -2.0], [0, 0, 0.3, 0.5], [0, 0, 0, 1.0]])


@pytest.fixture
def scene(reset_blender):
    """A floor at 300 K and a camera that looks down on it, in a world of 300 K."""
    camera(width=4, height=3).data.angle = 1e-3
    floor = link("Floor", cube_mesh("Floor"), temperature=300.0)
    floor.scale, floor.location = (10.0, 10.0, 0.1), (0.0, 0.0, -2.0)
    floor.data.materials.append(material("Black", emissivity=1.0))
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world["temperature"] = 300.0
    bpy.context.scene.infrared.band_count = 1


def write(path, matrix=MATRIX, low=LOW, **arrays):
    """An OpenVDB file of grids by name, with cells of 0 inactive."""
    module, grids = volumes.openvdb(), []
    for name, values in arrays.items():
        grid = module.FloatGrid()
        grid.copyFromArray(np.ascontiguousarray(values, np.float32), ijk=tuple(int(i) for i in low))
        grid.name, grid.transform = name, module.createLinearTransform(matrix.T.tolist())
        grids.append(grid)
    module.write(str(path), grids=grids)
    return str(path)


def volume(path, name="Plume", **properties):
    """A Volume object of a file, filled with a grey gas."""
    data = bpy.data.volumes.new(name)
    data.filepath = str(path)
    data.materials.append(material("Gas", absorption=0.5))
    return link(name, data, **properties)


def cells(grid, name):
    """World position of the centre of each cell with gas, (n, 3), and its value of a quantity, (n,), sorted."""
    holds = grid.density > 0.0
    leaf, *cell = np.nonzero(holds)
    centre = 8 * grid.leaves[leaf] + np.stack(cell, axis=1) + 0.5
    order = np.lexsort(np.floor(centre).T)
    return (centre @ grid.matrix[:3, :3].T + grid.matrix[:3, 3])[order], getattr(grid, name)[holds][order]


def expected(values, world, matrix=MATRIX, low=LOW):
    """The same from what was written. world: (4, 4), of the object."""
    index = np.stack(np.nonzero(np.ones(values.shape)), axis=1)
    centre = index + low + 0.5 - SHIFT  # in OpenVDB's index space
    order = np.lexsort(index.T)
    whole = world @ matrix
    return (centre @ whole[:3, :3].T + whole[:3, 3])[order], values[tuple(index.T)][order]


def test_a_file_arrives_cell_by_cell(scene, tmp_path):
    """Under a turned object of uneven scale and a grid whose own transform shears: values exactly, positions to
    float32."""
    plume = volume(write(tmp_path / "a.vdb", density=DENSITY, temperature=KELVIN, velocity_x=DENSITY))
    plume.location, plume.scale, plume.rotation_euler = (1.0, 2.0, 3.0), (1.0, 2.0, -0.5), (0.3, 0.2, 0.1)
    (medium,), warnings = read()[0].media, read()[1]
    assert warnings == [] and medium.absorption == 0.5 and medium.name == "Plume: Gas"
    world = np.array(plume.matrix_world, float)
    for name, values in (("density", DENSITY), ("temperature", KELVIN)):
        position, found = cells(medium.grid, name)
        where, truth = expected(values, world)
        np.testing.assert_array_equal(found, truth)
        np.testing.assert_allclose(position, where, atol=2e-6)


def test_cells_lie_where_blender_shows_them(scene, tmp_path):
    """One cell of a metre at index 0, as Cycles renders it: around the origin from Blender 5.0 on, before beside it."""
    volume(write(tmp_path / "one.vdb", np.eye(4), (0, 0, 0), density=np.ones((1, 1, 1))), temperature=400.0)
    position, _ = cells(read()[0].media[0].grid, "density")
    np.testing.assert_allclose(position, np.full((1, 3), 0.5 - SHIFT))


def test_what_is_missing_in_a_grid_is_filled(scene, tmp_path):
    """A temperature alone is gas where it has cells; where it has none, the object's own counts; so does a species."""
    hot, wet = KELVIN.copy(), np.full_like(DENSITY, 0.25)
    hot[2] = 0.0
    volume(write(tmp_path / "t.vdb", temperature=hot), temperature=444.0)
    volume(write(tmp_path / "d.vdb", density=DENSITY, temperature=hot, H2O=wet), "Wet", temperature=555.0)
    one, other = (medium.grid for medium in read()[0].media)
    assert set(np.unique(one.density)) == {0.0, 1.0} and one.density.sum() == np.count_nonzero(hot)
    _, found = cells(other, "temperature")
    _, truth = expected(np.where(hot > 0, hot, np.float32(555.0)), np.eye(4))
    np.testing.assert_array_equal(found, truth)
    assert set(other.fractions) == {"H2O"} and other.fractions["H2O"].max() == 0.25


def test_species_arrive_cell_by_cell(scene, tmp_path):
    """Gas is where the density or a species has cells; a volume with species needs no material."""
    carbon, thin = np.zeros_like(DENSITY), DENSITY.copy()
    carbon[6:] = np.random.default_rng(3).uniform(0.01, 0.2, (3, 3, 12))
    thin[3:] = 0.0
    path = write(tmp_path / "f.vdb", density=thin, temperature=KELVIN, CO2=carbon)
    plume = volume(path, temperature=350.0, pressure=2e5)
    plume.data.materials.clear()
    (medium,), warnings = read()[0].media, read()[1]
    assert warnings == [] and medium.name == "Plume" and medium.absorption == 0.0 and medium.pressure == 2e5
    assert medium.components == ("density", "CO2")
    position, _ = expected(DENSITY, np.eye(4))
    gas = (thin + carbon > 0.0).transpose(2, 1, 0).ravel()  # in the order of `expected`
    whole = dataclasses.replace(medium.grid, density=medium.grid.holds.astype(np.float32))
    where, _ = cells(whole, "density")
    np.testing.assert_allclose(where, position[gas], atol=2e-6)
    given = {"temperature": KELVIN, "density": thin, "CO2": carbon}
    read_back = {"temperature": medium.grid.temperature, "density": medium.grid.density, **medium.grid.fractions}
    for name, values in given.items():
        _, found = cells(dataclasses.replace(whole, temperature=read_back[name]), "temperature")
        np.testing.assert_array_equal(found, values.transpose(2, 1, 0).ravel()[gas])


def test_a_volume_is_rendered(scene, tmp_path):
    """2 m of gas at 600 K, coefficient 0.5 times a density of 0.4, before a floor at the temperature of all else. The
    unit scale makes lengths millimetres, and coefficients stay those of a metre."""
    bpy.context.scene.unit_settings.scale_length = 0.001
    matrix = np.diag([0.25, 0.25, 0.125, 1.0])
    plume = volume(
        write(tmp_path / "u.vdb", matrix, (-8, -8, -8), density=np.full((16, 16, 16), 0.4)), temperature=600.0
    )
    plume.data.materials[0]["absorption"] = 500.0
    found, warnings = read()
    radiance = float(render(found, Settings(passes=1, photons_per_pass=1000)).radiance().mean())
    cold, hot = (float(band_radiance(found.band_edges, kelvin).sum()) for kelvin in (300.0, 600.0))
    assert warnings == [] and (radiance - cold) / (hot - cold) == pytest.approx(-np.expm1(-0.4), rel=1e-5)


def cube_of_nodes(paint):
    """A node group that makes a volume of 4 x 4 x 4 cells from -1 to 1, filled with a gas."""
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    cube, paints, out = (
        group.nodes.new(kind) for kind in ("GeometryNodeVolumeCube", "GeometryNodeSetMaterial", "NodeGroupOutput")
    )
    for axis in "XYZ":
        cube.inputs[f"Resolution {axis}"].default_value = 4
    paints.inputs["Material"].default_value = paint
    group.links.new(cube.outputs[0], paints.inputs[0])
    group.links.new(paints.outputs[0], out.inputs[0])
    return group


def test_geometry_nodes_and_instances(scene):
    """A volume of nodes lies around the middle of its object in every Blender; an instance shares its cells."""
    maker = link("Nodes", bpy.data.meshes.new("Empty"), temperature=400.0)
    maker.modifiers.new("Nodes", "NODES").node_group = cube_of_nodes(material("Gas", absorption=0.5))
    maker.location = (5.0, 0.0, 0.0)
    (medium,), warnings = read()[0].media, read()[1]
    position, density = cells(medium.grid, "density")
    assert warnings == [] and medium.temperature == 400.0 and len(density) == 64 and np.all(density == 1.0)
    np.testing.assert_allclose(position.mean(axis=0), (5.0, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(np.ptp(position, axis=0), 2.0, atol=1e-6)


def test_instances_of_a_file_share_their_cells(scene, tmp_path):
    group = bpy.data.collections.new("Group")
    plume = volume(write(tmp_path / "a.vdb", density=DENSITY), temperature=400.0)
    group.objects.link(plume)
    instance = link("Instance")
    instance.instance_type, instance.instance_collection, instance.location = "COLLECTION", group, (0.0, 0.0, 3.0)
    one, other = (medium.grid for medium in read()[0].media)
    assert one.density is other.density and one.leaves is other.leaves
    np.testing.assert_allclose(other.matrix[:3, 3] - one.matrix[:3, 3], (0.0, 0.0, 3.0), atol=1e-6)


def test_sparse_files_stay_sparse(scene, tmp_path):
    """Two cells 3000 apart are two leaves."""
    module = volumes.openvdb()
    grid = module.FloatGrid()
    grid.name = "density"
    for index in ((0, 0, 0), (3000, 5, 5)):
        grid.copyFromArray(np.ones((1, 1, 1), np.float32), ijk=index)
    module.write(str(tmp_path / "s.vdb"), grids=[grid])
    volume(tmp_path / "s.vdb", temperature=400.0)
    (medium,) = read()[0].media
    np.testing.assert_array_equal(medium.grid.leaves, [[0, 0, 0], [375, 0, 0]])


@pytest.mark.parametrize("what, warning", [
    ("names", "H2O, CO2, CO, CH4, soot, the volume is left out; it has 'foam'"),
    ("no file", "'Plume': the file '//missing.vdb' cannot be read, the volume is left out"),
    ("nonsense", "cannot be read, the volume is left out"),
    ("cut", "'Plume': its grids 'density' hold no numbers, the volume is left out"),
    ("empty", "'Plume': no grid has a name of"),
    ("no module", "'Plume': this Blender has no module openvdb, which reads volumes; the volume is left out"),
    ("no gas", "'Plume': volumes are not rendered without absorption or scattering in their material"),
    ("no temperature", "'Plume': no temperature; the ambient"),
    ("apart", "'Plume': its grid 'temperature' does not lie as 'density' does, and is left out"),
    ("negative", "'Plume': its densities below 0 count as 0"),
])  # fmt: skip
def test_what_a_volume_lacks_is_named(scene, tmp_path, monkeypatch, what, warning):
    path = tmp_path / "a.vdb"
    write(path, density=DENSITY)
    plume = volume(path)
    if what != "no temperature":
        plume["temperature"] = 400.0
    if what == "names":
        write(path, foam=DENSITY)
    elif what == "no file":
        plume.data.filepath = "//missing.vdb"
    elif what == "nonsense":
        path.write_bytes(b"no grids")
    elif what == "cut":
        path.write_bytes(path.read_bytes()[:-800])
    elif what == "empty":
        plume.data.filepath = ""
    elif what == "no module":
        monkeypatch.setattr(volumes, "openvdb", lambda: None)
    elif what == "no gas":
        del plume.data.materials[0]["absorption"]
    elif what == "apart":
        module = volumes.openvdb()
        grids = [module.FloatGrid(), module.FloatGrid()]
        for grid, name, size in zip(grids, ("density", "temperature"), (0.1, 0.2), strict=True):
            grid.copyFromArray(DENSITY)
            grid.name, grid.transform = name, module.createLinearTransform(size)
        module.write(str(path), grids=grids)
    elif what == "negative":
        write(path, density=np.where(DENSITY > 1.9, -1.0, DENSITY))
    found, warnings = read()
    assert len(warnings) == 1 and warning in warnings[0]
    assert len(found.media) == (1 if what in ("no temperature", "apart", "negative") else 0)


def test_a_volume_that_does_not_fit_into_memory_is_named(scene, tmp_path, monkeypatch):
    """1024 x 1024 x 1024 cells that one tile of the file holds, and a temperature, of 4 bytes each, twice."""
    module, grids = volumes.openvdb(), []
    for name in ("density", "temperature"):
        grid = module.FloatGrid()
        grid.name = name
        grid.fill((0, 0, 0), (1023, 1023, 1023), 1.0)
        grids.append(grid)
    module.write(str(tmp_path / "large.vdb"), grids=grids)
    volume(tmp_path / "large.vdb")
    monkeypatch.setattr(memory, "available_memory", lambda: 15e9)
    with pytest.raises(
        SceneError, match="Object 'Plume' needs about 17.2 GB of memory, 15.0 GB are available. The cel"
    ):
        read()


def write_cells(path, background=0.0, **several):
    """An OpenVDB file of grids by name that have these values in cells (0, 0, i), NaN and infinity among them."""
    module, grids = volumes.openvdb(), []
    for name, values in several.items():
        grid = module.FloatGrid(background)
        grid.name, accessor = name, grid.getAccessor()
        for i, value in enumerate(values):
            accessor.setValueOn((0, 0, i), value)
        grids.append(grid)
    module.write(str(path), grids=grids)
    return str(path)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("background, fallback", [(0.0, 400.0), (350.0, 350.0), (INF, 400.0), (NAN, 400.0)])
def test_values_that_are_no_numbers_are_told_and_left_out(scene, tmp_path, background, fallback):
    """In the render's report and in the checks, by grid; cells without a value are none of them."""
    density, kelvin, water = (1.0, NAN, INF, 2.0), (NAN, 500.0, INF, -INF, 600.0), (NAN, 0.2, 0.3, 0.4)
    path = write_cells(tmp_path / "a.vdb", background, density=density, temperature=kelvin, H2O=water)
    volume(path, temperature=400.0)
    (medium,), warnings = read()[0].media, read()[1]
    expected = [
        "cells of its grid 'density' that are NaN or infinite: 2; they count as empty",
        "cells of its grid 'temperature' that are NaN or infinite: 3; they have the temperature of cells without one",
        "cells of its grid 'H2O' that are NaN or infinite: 1; they count as empty",
    ]
    assert warnings == [f"'Plume': {each}" for each in expected]
    checks = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert [each.text for each in checks if each.level == "WARNING"] == [f"Object 'Plume': {each}" for each in expected]
    leaf, *cell = np.nonzero(medium.grid.holds)
    k = cell[2][np.argsort(cell[2])]
    np.testing.assert_array_equal(medium.grid.density[0, 0, 0, k], (1.0, 0.0, 0.0, 2.0))
    np.testing.assert_array_equal(medium.grid.temperature[0, 0, 0, k], (fallback, 500.0, fallback, fallback))
    np.testing.assert_array_equal(medium.grid.fractions["H2O"][0, 0, 0, k], np.float32((0.0, 0.2, 0.3, 0.4)))


def test_a_grid_without_cells_is_told(scene, tmp_path):
    """So Blender reads a file that ends in the middle: the temperature would be that of the object without a word."""
    nothing = np.zeros_like(KELVIN)
    volume(write(tmp_path / "cut.vdb", density=DENSITY, temperature=nothing, CO2=nothing), temperature=600.0)
    (medium,), warnings = read()[0].media, read()[1]
    assert sorted(warnings) == [
        "'Plume': its grid 'CO2' has no cells (is the file whole?); it counts as 0",
        "'Plume': its grid 'temperature' has no cells (is the file whole?); 600 K counts",
    ]
    assert np.all(medium.grid.temperature == 600.0)


def test_fractions_above_1_together_are_told(scene, tmp_path):
    """Those of grids, and of the material where these have none."""
    most = np.full_like(DENSITY, 0.7)
    plume = volume(write(tmp_path / "a.vdb", density=DENSITY, H2O=most), temperature=600.0)
    assert read()[1] == []
    plume.data.materials[0]["gas"] = {"CO2": 0.5}
    assert read()[1] == ["'Plume': the mole fractions in one of its cells add up to 1.2; they count as they are"]


@pytest.mark.parametrize("damage, message", [
    (lambda plume: plume.data.materials[0].__setitem__("absorption", -1.0), "Medium 'Gas': absorption -1 1/m"),
    (lambda plume: plume.data.materials[0].__setitem__("gas", {"NH3": 0.1}), "Medium 'Gas': unknown species 'NH3'"),
    (lambda plume: plume.__setitem__("temperature", float("nan")), "Object 'Plume': temperature nan"),
])  # fmt: skip
def test_checks_know_before_the_render(scene, tmp_path, damage, message):
    plume = volume(write(tmp_path / "a.vdb", density=DENSITY), temperature=600.0)
    damage(plume)
    bpy.context.view_layer.update()
    checks = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert [message in check.text for check in checks if check.level == "ERROR"] == [True]


def test_a_file_that_is_being_written_does_not_stop_the_checks(scene, tmp_path):
    path = tmp_path / "a.vdb"
    volume(write(path, density=DENSITY), temperature=600.0).data.grids.load()
    path.write_bytes(b"x" * 100)
    scene_checks(bpy.context.scene, bpy.context.view_layer)


def test_a_volume_of_no_numbers_is_left_out(scene, tmp_path):
    """A temperature alone says where there is gas: without one a cell is empty."""
    volume(write_cells(tmp_path / "a.vdb", temperature=(NAN, INF)), temperature=400.0)
    found, warnings = read()
    assert found.media == () and warnings == [
        "'Plume': cells of its grid 'temperature' that are NaN or infinite: 2; they count as empty",
        "'Plume': its grids 'temperature' hold no numbers, the volume is left out",
    ]


def test_a_background_is_the_temperature_of_cells_without_a_value(scene, tmp_path):
    volume(write_cells(tmp_path / "a.vdb", 350.0, density=(1.0, 1.0), temperature=(500.0,)), temperature=400.0)
    (medium,), warnings = read()[0].media, read()[1]
    assert warnings == [] and sorted(medium.grid.temperature[medium.grid.density > 0.0]) == [350.0, 500.0]


@pytest.mark.parametrize("values, message", [
    ({"temperature": -KELVIN}, "Medium 'Plume: Gas': temperature -"),
    ({"density": DENSITY, "CO2": 2.0 * np.ones_like(DENSITY)}, "Medium 'Plume: Gas': fraction of CO2 2 in a cell"),
])  # fmt: skip
def test_values_that_make_no_sense_are_errors(scene, tmp_path, values, message):
    volume(write(tmp_path / "a.vdb", **values), temperature=400.0)
    with pytest.raises(SceneError) as error:
        read()
    assert message in str(error.value)


# Smoke domains. Blender as a Python module does not simulate: its solver stops the process. So what a simulation gives
# is made up here; test_real_blender asks for a true one.


@pytest.fixture
def domain(scene):
    """A cube of 2 x 4 x 6 m that is the domain of a gas simulation."""
    smoke = link("Smoke", cube_mesh("Smoke"), temperature=350.0)
    smoke.scale, smoke.location = (2.0, 4.0, 6.0), (1.0, 0.0, 0.0)
    smoke.data.materials.append(material("Gas", absorption=0.5))
    fluid = smoke.modifiers.new("Fluid", "FLUID")
    fluid.show_viewport = fluid.show_render = False  # so that nothing is simulated
    fluid.fluid_type = "DOMAIN"
    fluid.domain_settings.domain_type = "GAS"
    return smoke


def test_a_smoke_domain_is_no_surface(domain):
    """Without a simulation a warning says so; without a gas, too."""
    found, warnings = read()
    assert found.media == () and len(found.triangles) == 12  # the floor
    assert warnings == ["'Smoke': there is neither smoke nor fire in this frame: is the simulation baked?"]
    del domain.data.materials[0]["absorption"]
    assert read()[1] == ["'Smoke': smoke and fire are not rendered without absorption or scattering in their material"]


def test_smoke_and_fire_are_gas(domain, monkeypatch):
    """x runs fastest; smoke and flames add; 1 stands for 1000 K, and nothing is colder than the object."""
    smoke, flame, heat = np.zeros((3, 6, 4, 2))  # z, y, x
    smoke[5, 0, 1], flame[5, 0, 1], flame[0, 3, 0] = 0.25, 0.5, 1.0
    heat[5, 0, 1], heat[0, 3, 0] = 0.2, 1.5
    settings = SimpleNamespace(
        domain_resolution=(2, 4, 6), density_grid=smoke.ravel(), flame_grid=flame.ravel(), temperature_grid=heat.ravel()
    )
    monkeypatch.setattr(volumes, "_gas_domain", lambda obj: settings)
    bpy.context.view_layer.update()
    matrix, warnings = np.array(domain.matrix_world, float), Warnings()
    medium = volumes.VolumeReader(warnings).read_smoke(domain, matrix, domain.data.materials[0], 300.0, 1.0)
    position, density = cells(medium.grid, "density")
    np.testing.assert_allclose(position, [[0.5, 1.5, -2.5], [1.5, -1.5, 2.5]], atol=1e-6)
    np.testing.assert_allclose(density, [1.0, 0.75])
    np.testing.assert_allclose(cells(medium.grid, "temperature")[1], [1500.0, 350.0])
    assert warnings.messages() == []
