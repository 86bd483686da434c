# SPDX-License-Identifier: GPL-3.0-or-later
"""Convert simulation results to meshes with temperatures that Blender imports. Works without Blender, with meshio:

    python -m addon.convert results.vtu ... --output part.ply

Of volume cells it takes the outer skin. Temperatures become the vertex property `temperature`, K, of a PLY file, which
Blender imports as the mesh attribute of that name. A time series becomes one file for each step.
"""

from __future__ import annotations

import argparse
import glob
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .output.formats import numbered, replaced
from .solver.physics.humidity import FREEZING
from .solver.system.files import replacing

USUAL_FIELDS = ("temperature", "temp", "t", "nt11")  # in lower case; Abaqus has the last one
MESHIO_MISSING = "meshio is missing: install it into this Python by 'pip install meshio[all]'"
NO_CGNS_FIELDS = "meshio reads no fields of CGNS files; save them as VTU, with ParaView for one"
NO_OPENFOAM = "meshio reads no OpenFOAM cases; 'foamToVTK' writes VTU files of them"
MOST = float(np.finfo(np.float32).max)
# Corners of the faces of a cell, numbered as in VTK and meshio; those of higher order begin with the same corners.
FACES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2, 3),),
}
FLAT = {"triangle", "quad", "polygon"}  # cells that are faces themselves
WITHOUT_FACES = {"vertex", "line"}
EXODUS_CELLS = {"TET": "tetra", "HEX": "hexahedron", "WED": "wedge", "PYR": "pyramid", "TRI": "triangle"}


class ConvertError(ValueError):
    """A file cannot be converted; the message names it and says why."""


@dataclass(frozen=True)
class Step:
    """Results of one time step. points: (n, 2) or (n, 3), in the file's unit. cells: (type as meshio calls it, corners)
    of each block: (m, k) numbers of points, of polyhedra a list of lists of faces. point_data: (n,) by name. cell_data:
    (m,) of each block by name. time: s, None if it is not told."""

    points: np.ndarray
    cells: list[tuple[str, Sequence]]
    point_data: Mapping[str, np.ndarray]
    cell_data: Mapping[str, Sequence[np.ndarray]]
    time: float | None = None


@dataclass(frozen=True)
class Surface:
    """A mesh with temperatures. points: (n, 3) float32. faces: (m, k) numbers of points, an array for each number k of
    corners. kelvin: (n,) float32."""

    points: np.ndarray
    faces: list[np.ndarray]
    kelvin: np.ndarray


# The skin -------------------------------------------------------------------------------------------------------------


def shape_of(cell_type: str) -> str:
    """What a type of cells is, whatever its order: 'tetra' of 'tetra10' and 'VTK_LAGRANGE_TETRAHEDRON'."""
    shape = re.sub(r"\d+$", "", cell_type.removeprefix("VTK_LAGRANGE_").lower())
    return {"tetrahedron": "tetra", "quadrilateral": "quad"}.get(shape, shape)


def faces_of(cell_type: str, corners: Sequence) -> list[tuple[np.ndarray, np.ndarray]]:
    """The faces of m cells: (faces (f, k) numbers of points, (f,) cell that each belongs to), for each number k of
    corners. Raises ConvertError if the type is not known."""
    kind = shape_of(cell_type)
    if kind in WITHOUT_FACES:
        return []
    if kind == "polyhedron":
        return _faces_of_polyhedra(corners)
    corners = np.asarray(corners, np.int64)
    numbers = np.arange(len(corners))
    if kind == "polygon":
        return [(corners, numbers)]
    if kind not in FACES:
        raise ConvertError(f"cells of the type '{cell_type}' are not known")
    found = []
    for size in sorted(set(map(len, FACES[kind]))):
        of_size = np.array([face for face in FACES[kind] if len(face) == size])
        found.append((corners[:, of_size].reshape(-1, size), np.repeat(numbers, len(of_size))))
    return found


def _faces_of_polyhedra(cells: Sequence) -> list[tuple[np.ndarray, np.ndarray]]:
    """As faces_of. cells: for each a list of its faces, which are lists of points."""
    faces = list(chain.from_iterable(cells))
    owner = np.repeat(np.arange(len(cells)), list(map(len, cells)))
    sizes, points = np.array(list(map(len, faces))), np.concatenate(faces)
    first = np.cumsum(sizes) - sizes
    return [
        (points[first[sizes == size][:, None] + np.arange(size)], owner[sizes == size])
        for size in np.unique(sizes).tolist()
    ]


def outer_skin(cells: Sequence[tuple[str, Sequence]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """What is seen of cells from outside: (faces (f, k), (f,) cell of each, counted over all blocks), for each number k
    of corners. cells: see Step.

    Faces that two volume cells share are inside. A flat cell counts where no volume cell has that face. Raises
    ConvertError if there is no face, or a type of cells is not known.
    """
    by_size, start = {}, 0
    for cell_type, corners in cells:
        for faces, owner in faces_of(cell_type, corners):
            known = by_size.setdefault(faces.shape[1], ([], [], []))
            for column, values in zip(
                known, (faces, owner + start, np.full(len(faces), shape_of(cell_type) in FLAT)), strict=True
            ):
                column.append(values)
        start += len(corners)
    if not by_size:
        raise ConvertError(
            "there are no faces, only " + (" and ".join(sorted({each for each, _ in cells})) or "points")
        )
    return [_once(*map(np.concatenate, columns)) for _, columns in sorted(by_size.items())]


def _once(faces: np.ndarray, owner: np.ndarray, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The faces (f, k) that one volume cell has, or none but a flat one, and their owners."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort((flat, *corners.T))  # of equal faces those of volume cells come first
    in_order = corners[order]
    new = np.append(True, (in_order[1:] != in_order[:-1]).any(axis=1))
    volumes = np.add.reduceat((~flat[order]).astype(int), np.flatnonzero(new))
    kept = np.sort(order[new][volumes <= 1])
    return faces[kept], owner[kept]


# Temperatures ---------------------------------------------------------------------------------------------------------


def find_field(step: Step, name: str | None) -> tuple[str, np.ndarray, bool]:
    """The field of temperatures: its name, (n,) values, and whether they are of points, else of all cells. Of two, that
    of the points. name: None for a usual one. Raises ConvertError if there is none."""
    of_points = {**dict.fromkeys(step.cell_data, False), **dict.fromkeys(step.point_data, True)}
    if name is None:
        usual = {each.lower(): each for each in of_points if each.lower() in USUAL_FIELDS}
        name = next((usual[each] for each in USUAL_FIELDS if each in usual), None)
    if name not in of_points:
        asked = f"no field '{name}'" if name else "no field with a usual name of a temperature (--field names another)"
        raise ConvertError(f"there is {asked}; it has {', '.join(map(repr, of_points)) or 'none'}")
    values = step.point_data[name] if of_points[name] else np.concatenate(list(map(np.asarray, step.cell_data[name])))
    values = np.asarray(values, np.float64)
    if values.size != len(values):
        raise ConvertError(f"the field '{name}' has {values.shape[1]} values at each place, expected 1")
    return name, values.ravel(), of_points[name]


def surface_of(step: Step, field: str | None = None, celsius: bool = False, scale: float = 1.0) -> Surface:
    """The skin of a step's cells with its temperatures. Those of cells are kept exactly: then faces share no points.

    field: its name, None for a usual one. celsius: whether it is in degrees Celsius, else K. scale: m in a unit of the
    file. Raises ConvertError if there are no faces, or no temperatures that can be rendered.
    """
    name, values, of_points = find_field(step, field)
    skin = outer_skin(step.cells)
    corners = np.concatenate([faces.ravel() for faces, _ in skin])
    if of_points:
        used, numbers = np.unique(corners, return_inverse=True)
        kelvin = values[used]
    else:
        used, numbers = corners, np.arange(len(corners))
        kelvin = np.concatenate([np.repeat(values[owner], faces.shape[1]) for faces, owner in skin])
    kelvin = kelvin + FREEZING if celsius else kelvin
    _check(kelvin, name, celsius)
    places = np.asarray(step.points, np.float64)[used] * scale
    if not (np.abs(places) <= MOST).all():
        raise ConvertError(f"points of the skin lie beyond {MOST:.3g} m, or nowhere; PLY files hold float32")
    points = np.zeros((len(used), 3), np.float32)
    points[:, : step.points.shape[1]] = places
    ends = np.cumsum([faces.size for faces, _ in skin])[:-1]
    numbers = np.split(numbers.ravel(), ends)
    faces = [each.reshape(faces.shape).astype(np.int32) for each, (faces, _) in zip(numbers, skin, strict=True)]
    return Surface(points, faces, kelvin.astype(np.float32))


def _check(kelvin: np.ndarray, name: str, celsius: bool) -> None:
    bad = ~np.isfinite(kelvin)
    if bad.any():
        raise ConvertError(f"the field '{name}' is not finite at {bad.sum()} of {bad.size} points of the skin")
    if kelvin.min() < 0.0:
        hint = "" if celsius else "; --celsius takes it for degrees Celsius"
        raise ConvertError(f"the field '{name}' goes down to {kelvin.min():.6g} K{hint}")
    if kelvin.max() > MOST:
        raise ConvertError(f"the field '{name}' goes up to {kelvin.max():.6g} K; PLY files hold float32")


# Files ----------------------------------------------------------------------------------------------------------------


def read_steps(path: Path) -> Iterator[Step]:
    """The time steps of a file, one after the other. Raises ConvertError if it cannot be read."""
    suffix = path.suffix.lower()
    if suffix == ".cgns":
        raise ConvertError(NO_CGNS_FIELDS)
    if suffix == ".foam" or path.is_dir():
        raise ConvertError(NO_OPENFOAM)
    if not path.is_file():
        raise ConvertError("there is no such file")
    reader = {".pvd": _read_collection, ".xdmf": _read_xdmf, ".xmf": _read_xdmf}.get(suffix, _read_one)
    if suffix in (".e", ".exo", ".ex2"):
        reader = _read_exodus
    try:
        yield from reader(path)
    except ConvertError:
        raise
    except ImportError as error:
        raise ConvertError(f"{error.name} is missing: install it by 'pip install {error.name}'") from error
    except Exception as error:  # meshio raises what happens to it, such as KeyError and AssertionError
        raise ConvertError(f"meshio cannot read it: {type(error).__name__} {error}") from error


def _meshio():
    """The library, which only this command needs. Raises ConvertError if it is missing."""
    try:
        import meshio
    except ImportError as error:
        raise ConvertError(MESHIO_MISSING) from error
    return meshio


def _step(points, blocks, point_data, cell_data, time: float | None) -> Step:
    return Step(np.asarray(points), [(block.type, block.data) for block in blocks], point_data, cell_data, time)


def _read_one(path: Path) -> Iterator[Step]:
    try:
        mesh = _meshio().read(path)
    except SystemExit as error:  # so meshio ends, once it has printed why
        raise ConvertError("meshio cannot read it") from error
    told = next((mesh.field_data[each] for each in ("TimeValue", "TIME") if each in mesh.field_data), None)
    time = None if told is None else float(np.ravel(told)[0])
    yield _step(mesh.points, mesh.cells, mesh.point_data, mesh.cell_data, time)


def _entries(path: Path) -> list[tuple[float, Path]]:
    """Times and files in ParaView's list of them."""
    found = ElementTree.parse(path).iter("DataSet")
    return [(float(entry.get("timestep", 0.0)), path.parent / entry.attrib["file"]) for entry in found]


def _read_collection(path: Path) -> Iterator[Step]:
    """ParaView's list of files with their times."""
    entries = _entries(path)
    if len({time for time, _ in entries}) < len(entries):
        raise ConvertError("it has several parts at one time; save each time as one VTU file")
    for time, part in entries:
        try:
            for step in read_steps(part):
                yield replace(step, time=time)
        except ConvertError as error:
            raise ConvertError(f"its part '{part}': {error}") from error


def _read_xdmf(path: Path) -> Iterator[Step]:
    meshio = _meshio()
    if b'CollectionType="Temporal"' not in path.read_bytes():
        yield from _read_one(path)
        return
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        for number in range(reader.num_steps):
            time, point_data, cell_data = reader.read_data(number)
            yield _step(points, cells, point_data, cell_data, time)


def _read_exodus(path: Path) -> Iterator[Step]:
    """Exodus II by netCDF4: meshio has the first step alone, and no TET4. Sources: meshio's own reader, and
    https://sandialabs.github.io/seacas-docs/exodusII-new.pdf, appendix A."""
    import netCDF4

    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        variables = file.variables
        if "coord" in variables:
            points = variables["coord"][:].T
        else:
            points = np.column_stack([variables[f"coord{axis}"][:] for axis in "xyz" if f"coord{axis}" in variables])
        blocks, cells = [], []
        for number in range(1, 1 + len(file.dimensions.get("num_el_blk", ()))):
            if f"connect{number}" in variables:
                blocks.append(number)
                cells.append(_exodus_cells(variables[f"connect{number}"]))
        times = variables["time_whole"][:] if "time_whole" in variables else [None]
        of_points, of_cells = (_exodus_names(variables, f"name_{kind}_var") for kind in ("nod", "elem"))
        for step in range(len(times)):
            point_data = {name: variables[f"vals_nod_var{i}"][step] for i, name in enumerate(of_points, 1)}
            cell_data = {}
            for i, name in enumerate(of_cells, 1):
                keys = [f"vals_elem_var{i}eb{number}" for number in blocks]
                cell_data[name] = [  # a block may be without a field
                    variables[key][step] if key in variables else np.full(len(each), np.nan)
                    for key, (_, each) in zip(keys, cells, strict=True)
                ]
            yield Step(points, cells, point_data, cell_data, None if times[step] is None else float(times[step]))


def _exodus_cells(connect) -> tuple[str, np.ndarray]:
    """A block of cells: its type as meshio calls it, and (m, k) numbers of points from 0."""
    corners, told = connect[:] - 1, connect.elem_type.upper()
    if told.startswith(("QUAD", "SHELL")):
        return "triangle" if corners.shape[1] in (3, 6) else "quad", corners
    if told.startswith(("BAR", "BEAM", "TRUSS", "EDGE")):
        return "line", corners
    if told.startswith(("SPHERE", "CIRCLE")):
        return "vertex", corners
    return EXODUS_CELLS.get(told[:3], told.lower()), corners


def _exodus_names(variables, key: str) -> list[str]:
    rows = variables[key][:] if key in variables else ()
    return [b"".join(row).decode("utf-8", "replace").strip("\0 ") for row in rows]


def write_ply(path: Path, surface: Surface, time: float | None = None) -> None:
    """Write a surface as a binary PLY file, with the vertex property `temperature`, K. time: s, goes into a comment.

    Raises OSError naming the path if it cannot be written.
    """
    lines = ["ply", "format binary_little_endian 1.0", "comment temperature is in kelvin"]
    lines += [] if time is None else [f"comment time {time!r}"]
    lines += [f"element vertex {len(surface.points)}", *(f"property float {name}" for name in ("x", "y", "z"))]
    lines += ["property float temperature", f"element face {sum(map(len, surface.faces))}"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    with replacing(path, "the mesh") as unfinished, unfinished.open("wb") as file:
        file.write("\n".join([*lines, ""]).encode("ascii"))
        file.write(np.column_stack((surface.points, surface.kelvin)).astype("<f4").tobytes())
        for faces in surface.faces:
            rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", (faces.shape[1],))])
            rows["count"], rows["corners"] = faces.shape[1], faces
            file.write(rows.tobytes())


# The command ----------------------------------------------------------------------------------------------------------


def by_number(name: str) -> list:
    """What sorts names by the numbers in them: step2 before step10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def parser() -> argparse.ArgumentParser:
    """Of the command's arguments."""
    result = argparse.ArgumentParser("addon.convert", description=__doc__.partition("\n")[0])
    result.add_argument("files", nargs="+", help="results, in the order of the numbers in their names; wildcards too")
    result.add_argument("--output", help="PLY file; '####' is the number of the step, from 1")
    result.add_argument("--field", help="name of the temperatures; without it a usual name is looked for")
    result.add_argument("--celsius", action="store_true", help="the field is in degrees Celsius, not in kelvin")
    result.add_argument("--scale", type=float, default=1.0, help="metres in a unit of the file: 0.001 for millimetres")
    return result


def converted(paths: Iterable[Path], options) -> Iterator[tuple[Path, Surface, float | None]]:
    """The surfaces of all steps of files, with their times. options: those of `parser`. Raises ConvertError."""
    for path in paths:
        try:
            for step in read_steps(path):
                yield path, surface_of(step, options.field, options.celsius, options.scale), step.time
        except ConvertError as error:
            raise ConvertError(f"'{path}': {error}") from error


def check_output(paths: Sequence[Path], output: str) -> None:
    """Raise ConvertError if files that are read would be replaced by those that are written. All of these are looked
    at beforehand, so that no part of a series is lost when the next one turns out to be in the way."""
    sources = list(chain.from_iterable(map(_sources, paths)))
    targets = (numbered(output, ".ply", number, True) for number in range(1, len(sources) + 1))
    if source := replaced(chain([numbered(output, ".ply", 1, False)], targets), sources):
        raise ConvertError(f"'{source}' is read, and would be replaced: --output names another")


def _sources(path: Path) -> list[Path]:
    """A file, and those that it lists."""
    if path.suffix.lower() != ".pvd":
        return [path]
    try:
        return [path, *(part for _, part in _entries(path))]
    except (OSError, ValueError, LookupError, ElementTree.ParseError):  # told when it is read
        return [path]


def main(arguments: Sequence[str] | None = None) -> int:
    """Convert results; returns the exit code: 0, or 1 if they cannot be converted."""
    options = parser().parse_args(arguments)
    if not 0.0 < options.scale < float("inf"):
        parser().error(f"--scale is {options.scale:g}, expected a number above 0")
    named = chain.from_iterable(glob.glob(each) or [each] for each in options.files)
    paths = sorted(map(Path, dict.fromkeys(named)), key=lambda path: by_number(str(path)))
    output = options.output or f"{os.path.splitext(paths[0])[0]}.ply"
    try:
        check_output(paths, output)
        _write_all(converted(paths, options), output)
    except (ConvertError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    return 0


def _write_all(steps: Iterator[tuple[Path, Surface, float | None]], output: str) -> None:
    """Write each step as soon as it is read: a long series is larger than memory. Only the first waits for the second,
    as without one it has no number."""
    waiting, count = None, 0
    for count, step in enumerate(steps, 1):
        if count == 1:
            waiting = step
            continue
        if count == 2:
            _write(waiting, numbered(output, ".ply", 1, True))
        _write(step, numbered(output, ".ply", count, True))
    if count == 1:
        _write(waiting, numbered(output, ".ply", 1, False))


def _write(step: tuple[Path, Surface, float | None], path: Path) -> None:
    source, surface, time = step
    write_ply(path, surface, time)
    count, kelvin = sum(map(len, surface.faces)), surface.kelvin
    when = "" if time is None else f", {time:g} s"
    print(f"{source}{when}: {count} faces, {kelvin.min():.6g} to {kelvin.max():.6g} K, in {path}")


if __name__ == "__main__":
    sys.exit(main())
