# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that makes meshes with temperatures of simulation results: skins, fields, series, and what it refuses."""

import subprocess
import sys
from pathlib import Path

import meshio
import netCDF4
import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from addon.convert import FACES, by_number, main, outer_skin

ROOT = Path(__file__).resolve().parent.parent
CELLS = 3, 2, 2  # of a box, along x, y, z
SLOPE, AT_ORIGIN = np.array([8.0, -4.0, 2.0]), 300.0  # K/m and K: exact in float32 at multiples of 1/4


def box():
    """A box of hexahedra: points (n, 3) and cells (m, 8)."""
    shape = np.array(CELLS) + 1
    points = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.stack(np.meshgrid(*map(np.arange, CELLS), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    around = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    return points.astype(float), np.ravel_multi_index(np.moveaxis(corner + around, 2, 0), shape)


def linear(points):
    """K, linear in space."""
    return AT_ORIGIN + points @ SLOPE


def results(path, **fields):
    """A VTU file of the box with the temperature T, or with other fields of its points."""
    points, cells = box()
    meshio.Mesh(points, [("hexahedron", cells)], point_data=fields or {"T": linear(points)}).write(path)
    return path


def convert(*arguments):
    assert main([str(each) for each in arguments]) == 0


def refused(capsys, *arguments):
    """What the command says when it cannot convert something."""
    assert main([str(each) for each in arguments]) == 1
    told = capsys.readouterr().err
    assert told.startswith("Error: ")
    return told


def faces_in(cells):
    """The faces of a skin: each the set of its points."""
    return [frozenset(face.tolist()) for faces, _ in outer_skin(cells) for face in faces]


def volume_inside(points, cells):
    """Of a closed skin, by the divergence theorem; negative if its faces are turned inwards."""
    total = 0.0
    for faces, _ in outer_skin(cells):
        for i in range(1, faces.shape[1] - 1):
            total += np.linalg.det(points[faces[:, [0, i, i + 1]]]).sum() / 6.0
    return total


# The skin -------------------------------------------------------------------------------------------------------------


def test_the_skin_of_a_box_of_hexahedra_is_its_six_sides(tmp_path):
    points, cells = box()
    x, y, z = CELLS
    ((faces, owner),) = outer_skin([("hexahedron", cells)])
    assert faces.shape == (2 * (x * y + y * z + z * x), 4)
    sides = points[faces]
    on_a_side = ((sides == 0.0) | (sides == np.array(CELLS))).all(axis=1)
    assert (on_a_side.sum(axis=1) == 1).all()  # all four corners in one of the planes
    assert all(set(face) <= set(cells[cell]) for face, cell in zip(faces.tolist(), owner.tolist(), strict=True))
    assert volume_inside(points, [("hexahedron", cells)]) == pytest.approx(x * y * z)


def test_the_skin_of_tetrahedra_is_their_convex_hull():
    points = np.random.default_rng(1).random((60, 3))
    skin = faces_in([("tetra", Delaunay(points).simplices)])
    assert sorted(map(sorted, skin)) == sorted(sorted(each) for each in ConvexHull(points).simplices.tolist())


@pytest.mark.parametrize("shape", ["tetra", "hexahedron", "wedge", "pyramid"])
def test_one_cell_is_closed_and_turned_outwards(shape):
    corners = {
        "tetra": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
        "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]],
    }[shape]
    points = np.array(corners, float)
    cells = [(shape, [range(len(points))])]
    assert len(faces_in(cells)) == len(FACES[shape])
    assert volume_inside(points, cells) == pytest.approx(ConvexHull(points).volume)


def test_cells_of_several_types_share_faces():
    """A cube with a pyramid on top and a wedge beside; one of the triangles is the cube's side by another name."""
    cube, pyramid, wedge = range(8), (4, 5, 6, 7, 8), (0, 9, 1, 4, 10, 5)
    skin = faces_in([("hexahedron", [cube]), ("pyramid", [pyramid]), ("wedge", [wedge])])
    assert len(skin) == len(set(skin)) == (6 - 2) + 4 + 4
    assert frozenset((4, 5, 6, 7)) not in skin and frozenset((0, 1, 4, 5)) not in skin


def test_corners_of_higher_order_cells_count_and_points_between_them_do_not(tmp_path):
    points = np.random.default_rng(2).random((10, 3))
    path = tmp_path / "fine.vtu"
    meshio.Mesh(points, [("tetra10", [list(range(10))])], point_data={"T": np.arange(300.0, 310.0)}).write(path)
    convert(path)
    np.testing.assert_array_equal(meshio.read(tmp_path / "fine.ply").point_data["temperature"], np.arange(300.0, 304.0))
    assert faces_in([("VTK_LAGRANGE_TETRAHEDRON", [range(20)])]) == faces_in([("tetra", [range(4)])])


def test_flat_cells_count_unless_they_are_faces_of_volumes():
    """A patch on the boundary and one between two cells are there already; a fin is not."""
    points, cells = box()
    ((faces, _),) = outer_skin([("hexahedron", cells)])
    inner = sorted(set(cells[0].tolist()) & set(cells[1].tolist()))
    patches, fin = [faces[0][::-1].tolist(), inner], [[0, len(points), len(points) + 1]]
    skin = outer_skin([("hexahedron", cells), ("quad", patches), ("triangle", fin)])
    assert [each.shape for each, _ in skin] == [(1, 3), faces.shape]
    assert skin[0][1].tolist() == [len(cells) + 2] and len(outer_skin([("triangle", fin)])) == 1


def test_polyhedra_are_their_faces(tmp_path):
    """The two halves of a prism with six corners at its ends."""
    ends = [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9, 10, 11], [12, 13, 14, 15, 16, 17]]
    cells = [
        [low, high, *([low[i], low[i - 1], high[i - 1], high[i]] for i in range(6))]
        for low, high in zip(ends, ends[1:], strict=False)
    ]
    skin = outer_skin([("polyhedron12", cells)])
    assert [faces.shape for faces, _ in skin] == [(12, 4), (2, 6)]
    assert skin[1][1].tolist() == [0, 1]


# Fields ---------------------------------------------------------------------------------------------------------------


def test_temperatures_of_points_are_those_of_the_file(tmp_path):
    convert(results(tmp_path / "box.vtu"))
    mesh = meshio.read(tmp_path / "box.ply")
    np.testing.assert_array_equal(mesh.point_data["temperature"], linear(mesh.points))
    points, cells = box()
    assert len(mesh.points) == len(
        np.unique(np.concatenate([faces for faces, _ in outer_skin([("hexahedron", cells)])]))
    )


def test_temperatures_of_cells_are_kept_face_by_face(tmp_path):
    points, cells = box()
    kelvin = linear(points[cells].mean(axis=1))
    path = tmp_path / "cells.vtu"
    meshio.Mesh(points, [("hexahedron", cells)], cell_data={"temperature": [kelvin]}).write(path)
    convert(path)
    mesh = meshio.read(tmp_path / "cells.ply")
    (faces,) = (block.data for block in mesh.cells)
    of_corners = mesh.point_data["temperature"][faces]
    assert (of_corners == of_corners[:, :1]).all() and faces.size == len(mesh.points)
    middle = mesh.points[faces].mean(axis=1)
    inwards = np.where(middle == 0.0, 0.5, np.where(middle == np.array(CELLS), -0.5, 0.0))
    np.testing.assert_allclose(of_corners[:, 0], linear(middle + inwards), rtol=1e-7)  # float32


def test_celsius_and_millimetres(tmp_path):
    points, _ = box()
    convert(results(tmp_path / "c.vtu", Temp=linear(points) - 273.15), "--celsius", "--scale", "0.5")
    mesh = meshio.read(tmp_path / "c.ply")
    np.testing.assert_allclose(mesh.point_data["temperature"], linear(mesh.points / 0.5), rtol=1e-7)


def test_a_field_is_found_by_its_usual_name_or_asked_for(tmp_path):
    points, _ = box()
    path = results(tmp_path / "two.vtu", p=np.full(len(points), 1e5), TEMP=linear(points), Tsolid=linear(points) + 1.0)
    convert(path)
    convert(path, "--field", "Tsolid", "--output", tmp_path / "solid.ply")
    found, solid = (meshio.read(tmp_path / name).point_data["temperature"] for name in ("two.ply", "solid.ply"))
    np.testing.assert_array_equal(solid, found + 1.0)


# Series ---------------------------------------------------------------------------------------------------------------


def first_temperatures(folder, stem):
    """(temperature of the first point, comment of the time) of each file of a series."""
    found = []
    for path in sorted(folder.glob(f"{stem}*.ply")):
        header = path.read_bytes().partition(b"end_header")[0].decode().splitlines()
        time = [line.removeprefix("comment time ") for line in header if line.startswith("comment time ")]
        found.append((float(meshio.read(path).point_data["temperature"][0]), *map(float, time)))
    return found


def test_a_series_of_files_is_in_the_order_of_their_numbers(tmp_path):
    points, _ = box()
    for number in (1, 2, 10):
        results(tmp_path / f"step{number}.vtu", T=linear(points) + number)
    convert(tmp_path / "step*.vtu", "--output", tmp_path / "out_##.ply")
    assert [path.name for path in sorted(tmp_path.glob("*.ply"))] == ["out_01.ply", "out_02.ply", "out_03.ply"]
    assert first_temperatures(tmp_path, "out") == [(301.0,), (302.0,), (310.0,)]
    assert sorted(["a10b2", "a2", "a10b1", "a"], key=by_number) == ["a", "a2", "a10b1", "a10b2"]


def test_a_list_of_paraview_has_times(tmp_path):
    points, _ = box()
    entries = ""
    for time, add in ((0.5, 1.0), (2.0, 5.0)):
        results(tmp_path / f"{time}.vtu", T=linear(points) + add)
        entries += f'<DataSet timestep="{time}" part="0" file="{time}.vtu"/>'
    path = tmp_path / "all.pvd"
    path.write_text(f'<VTKFile type="Collection"><Collection>{entries}</Collection></VTKFile>')
    convert(path)
    assert first_temperatures(tmp_path, "all") == [(301.0, 0.5), (305.0, 2.0)]


def test_time_steps_of_xdmf(tmp_path):
    points, cells = box()
    path = tmp_path / "steps.xdmf"
    with meshio.xdmf.TimeSeriesWriter(path, data_format="XML") as writer:
        writer.write_points_cells(points, [("hexahedron", cells)])
        for time in (0.0, 0.25):
            writer.write_data(time, point_data={"T": linear(points) + 8.0 * time})
    convert(path)
    assert first_temperatures(tmp_path, "steps") == [(300.0, 0.0), (302.0, 0.25)]


def exodus(path, kind="TET4"):
    """A file with two blocks of tetrahedra, two steps, a field of the points and one of the cells."""
    sizes = {"num_nodes": 5, "num_el_blk": 2, "time_step": None, "len_name": 8, "one": 1, "four": 4}
    with netCDF4.Dataset(path, "w") as file:

        def variable(name, kind, *dimensions):
            return file.createVariable(name, kind, dimensions)

        for name, size in sizes.items():
            file.createDimension(name, size)
        for axis, values in zip("xyz", ([0, 1, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, -1]), strict=True):
            variable(f"coord{axis}", "f8", "num_nodes")[:] = values
        for block, corners in ((1, [1, 2, 3, 4]), (2, [1, 3, 2, 5])):
            connect = variable(f"connect{block}", "i4", "one", "four")
            connect[:], connect.elem_type = [corners], kind
        for key, name in (("nod", "temp"), ("elem", "T_cell")):
            variable(f"name_{key}_var", "S1", "one", "len_name")[0, : len(name)] = list(name)
        times, of_points = (
            variable("time_whole", "f8", "time_step"),
            variable("vals_nod_var1", "f8", "time_step", "num_nodes"),
        )
        of_cells = [variable(f"vals_elem_var1eb{block}", "f8", "time_step", "one") for block in (1, 2)]
        for step in range(2):
            times[step], of_points[step] = 10.0 * step, 300.0 + step + np.arange(5.0)
            of_cells[0][step], of_cells[1][step] = 350.0 + step, 360.0 + step
    return path


def test_all_time_steps_of_exodus(tmp_path):
    path = exodus(tmp_path / "solid.e")
    convert(path)
    assert first_temperatures(tmp_path, "solid") == [(300.0, 0.0), (301.0, 10.0)]
    mesh = meshio.read(tmp_path / "solid0002.ply")
    assert len(mesh.points) == 5 and len(mesh.cells[0].data) == 6  # two tetrahedra share one of their four faces
    convert(path, "--field", "T_cell", "--output", tmp_path / "cell_#.ply")
    kelvin = meshio.read(tmp_path / "cell_2.ply").point_data["temperature"]
    assert np.unique(kelvin, return_counts=True)[1].tolist() == [9, 9] and set(kelvin) == {351.0, 361.0}


# What it refuses ------------------------------------------------------------------------------------------------------


def test_refusals_name_the_file_and_say_why(tmp_path, capsys):
    points, cells = box()
    path = results(tmp_path / "r.vtu")
    assert "r.vtu': there is no field 'heat'; it has 'T'" in refused(capsys, path, "--field", "heat")
    other = results(tmp_path / "p.vtu", p=np.ones(len(points)))
    assert "no field with a usual name of a temperature (--field names another); it has 'p'" in refused(capsys, other)
    kelvin = linear(points)
    kelvin[0] = np.nan
    assert "the field 'T' is not finite at 1 of" in refused(capsys, results(tmp_path / "nan.vtu", T=kelvin))
    cold = results(tmp_path / "cold.vtu", T=linear(points) - 320.0)
    assert "goes down to -28 K; --celsius takes it for degrees Celsius" in refused(capsys, cold)
    hot = results(tmp_path / "hot.vtu", T=linear(points) * 1e37)
    assert "the field 'T' goes up to " in refused(capsys, hot)
    assert "points of the skin lie beyond 3.4e+38 m" in refused(capsys, path, "--scale", "1e39")
    vector = results(tmp_path / "v.vtu", T=np.ones((len(points), 3)))
    assert "the field 'T' has 3 values at each place" in refused(capsys, vector)
    meshio.Mesh(points, [("line", [[0, 1]])], point_data={"T": linear(points)}).write(tmp_path / "lines.vtu")
    assert "lines.vtu': there are no faces, only line" in refused(capsys, tmp_path / "lines.vtu")
    assert "missing.vtu': there is no such file" in refused(capsys, tmp_path / "missing.vtu")
    (tmp_path / "broken.vtu").write_text("nothing")
    assert "broken.vtu': meshio cannot read it" in refused(capsys, tmp_path / "broken.vtu")
    assert "no such folder" in refused(capsys, path, "--output", tmp_path / "nowhere" / "a.ply")
    assert "cells of the type 'strange4' are not known" in refused(capsys, exodus(tmp_path / "strange.e", "STRANGE4"))
    parts = '<DataSet timestep="0" part="0" file="r.vtu"/><DataSet timestep="0" part="1" file="r.vtu"/>'
    (tmp_path / "parts.pvd").write_text(f"<VTKFile><Collection>{parts}</Collection></VTKFile>")
    assert "several parts at one time" in refused(capsys, tmp_path / "parts.pvd")
    assert not list(tmp_path.glob("*.ply")) and not list(tmp_path.glob("*.tmp"))


def skin(path, add=0.0):
    """A PLY file, which the command can also read, with temperatures of its points."""
    points, cells = box()
    kelvin = (linear(points) + add).astype(np.float32)
    meshio.Mesh(points, [("quad", cells[:, :4].astype(np.int32))], point_data={"temperature": kelvin}).write(path)
    return path


def test_a_file_that_is_read_is_never_replaced(tmp_path, capsys):
    """Nor is any file of a series, of which each would be lost before it is read."""
    own, files = skin(tmp_path / "own.ply"), [skin(tmp_path / f"z_{i:04d}.ply", i) for i in range(4)]
    before = {path.name: path.read_bytes() for path in (own, *files)}
    told = "is read, and would be replaced: --output names another"
    assert f"'{own}' {told}" in refused(capsys, own, "--celsius")
    assert f"'{own}' {told}" in refused(capsys, own, "--output", tmp_path / ".." / tmp_path.name / "own.ply")
    assert f"'{files[1]}' {told}" in refused(capsys, tmp_path / "z_*.ply", "--output", tmp_path / "z_####.ply")
    assert f"'{files[1]}' {told}" in refused(capsys, tmp_path / "z_*.ply", "--output", tmp_path / "z_")
    (tmp_path / "link.ply").symlink_to(own)
    assert f"'{own}' {told}" in refused(capsys, own, "--output", tmp_path / "link.ply")
    (tmp_path / "link.ply").unlink()
    entries = "".join(f'<DataSet timestep="{i}" file="{path.name}"/>' for i, path in enumerate(files))
    (tmp_path / "z_.pvd").write_text(f"<VTKFile><Collection>{entries}</Collection></VTKFile>")
    assert f"'{files[1]}' {told}" in refused(capsys, tmp_path / "z_.pvd")
    assert before == {path.name: path.read_bytes() for path in tmp_path.glob("*.ply")}
    convert(tmp_path / "z_*.ply", "--output", tmp_path / "y_####.ply")
    assert first_temperatures(tmp_path, "y_") == [(300.0,), (301.0,), (302.0,), (303.0,)]


def test_a_part_that_is_missing_is_named(tmp_path, capsys):
    (tmp_path / "all.pvd").write_text('<VTKFile><Collection><DataSet file="gone.vtu"/></Collection></VTKFile>')
    told = refused(capsys, tmp_path / "all.pvd")
    assert f"'{tmp_path / 'all.pvd'}': its part '{tmp_path / 'gone.vtu'}': there is no such file" in told


def test_odd_names_are_told_too(capsys):
    assert "'.': meshio reads no OpenFOAM cases" in refused(capsys, ".")
    assert "'1²2.vtu': there is no such file" in refused(capsys, "1²2.vtu", "1²10.vtu")


@pytest.mark.parametrize("name, why", [("a.cgns", "no fields of CGNS"), ("a.foam", "'foamToVTK' writes VTU")])
def test_what_meshio_does_not_read_is_said(tmp_path, capsys, name, why):
    (tmp_path / name).touch()
    assert why in refused(capsys, tmp_path / name)


def test_meshio_still_reads_no_fields_of_cgns(tmp_path):
    """Else the refusal has to go. That of OpenFOAM likewise."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    mesh = meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])], point_data={"T": np.arange(4.0)})
    mesh.write(tmp_path / "a.cgns")
    assert meshio.read(tmp_path / "a.cgns").point_data == {}
    assert not {".foam", ".openfoam"} & set(meshio.extension_to_filetypes)


def run_without(modules, *arguments):
    """The command in a Python that lacks some modules."""
    code = f"import runpy, sys; sys.modules.update(dict.fromkeys({modules!r}));"
    code += "runpy.run_module('addon.convert', run_name='__main__')"
    return subprocess.run([sys.executable, "-c", code, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True)


def test_it_needs_meshio_and_numpy_alone(tmp_path):
    path = results(tmp_path / "box.vtu")
    done = run_without(["bpy", "numba", "llvmlite", "embreex", "OpenEXR"], path)
    assert done.returncode == 0 and "32 faces, 292 to 328 K" in done.stdout, done.stderr
    done = run_without(["meshio"], path)
    assert done.returncode == 1 and "pip install meshio[all]" in done.stderr and "Traceback" not in done.stderr
