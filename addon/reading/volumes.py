# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes: gas in the grids of Volume objects, of OpenVDB files and of geometry nodes, and in smoke domains.

Blender shows the voxels of a Volume object to no script, but it writes them into a file, which the module `openvdb`
reads that comes with Blender.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import itertools
import sys
import tempfile
from collections.abc import Iterable
from functools import lru_cache, reduce
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

from ..solver.scene import LEAF, MOLECULES, SPECIES, Grid, Medium, SceneError, check_spread, in_leaves
from .custom_properties import read_temperature
from .media import build_medium, is_medium, read_optics, read_pressure
from .warnings import Warnings

_GAS = "density", *SPECIES  # grids with the name of a species are mole fractions, of soot the volume fraction
_KNOWN = "density", "temperature", *SPECIES
_BLOCK = 256  # cells along an edge of the dense arrays through which grids are read
_SMOKE_KELVIN = 1000.0  # K, what 1 stands for in the temperatures of smoke
_LEFT_OUT = "the volume is left out"
_NO_VALUE = -(2.0**127)  # while a grid is read; no quantity has such a value. OpenVDB gives some cells its negative


class VolumeReader:
    """Reads each volume once, however many instances it has."""

    def __init__(self, warnings: Warnings):
        self.warnings = warnings
        # (object, address of the evaluated volume, K) -> Grid in the object's space, or None, and _most_together of it
        self._grids = {}

    def read(self, obj, matrix: np.ndarray, material, ambient: float, metres: float) -> Medium | None:
        """The gas in a Volume object or an instance of one; None, and a warning, if it cannot be rendered.

        matrix: (4, 4) float64, object to world. material: that counts. ambient: K, where nothing is set. metres: see
        read_optics.
        """
        kelvin = read_temperature(obj, ambient, f"Object '{obj.name}'")
        key = obj.name_full, obj.data.as_pointer(), kelvin
        if key not in self._grids:
            grid = self._read_file(obj, kelvin)
            self._grids[key] = grid, 0.0 if grid is None else _most_together(grid)
        grid, together = self._grids[key]
        if grid is None or not (grid.fractions or self._is_gas(obj, material, "volumes are")):
            return None
        if grid.temperature is None and obj.get("temperature") is None:
            self.warnings.add(obj.name, f"no temperature; the ambient {ambient:.5g} K counts")
        medium = self._medium(obj, _moved(grid, matrix), material, kelvin, metres)
        together += sum(medium.gas.get(name, 0.0) for name in MOLECULES if name not in grid.fractions)
        if together > 1.0 + 1e-6:
            message = f"the mole fractions in one of its cells add up to {together:.3g}; they count as they are"
            self.warnings.add(obj.name, message)
        return medium

    def read_smoke(self, obj, matrix: np.ndarray, material, ambient: float, metres: float) -> Medium | None:
        """The gas in a smoke domain, see read. Smoke and flames together are the density; the temperature of the
        simulation, times 1000 K, counts where it is above that of the object."""
        if not self._is_gas(obj, material, "smoke and fire are"):
            return None
        settings, kelvin = _gas_domain(obj), read_temperature(obj, ambient, f"Object '{obj.name}'")
        size = tuple(settings.domain_resolution)
        density, flame, heat = (_smoke_values(settings, name, size) for name in ("density", "flame", "temperature"))
        gas = sum(each for each in (density, flame) if each is not None)
        if not np.any(gas):
            self.warnings.add(obj.name, "there is neither smoke nor fire in this frame: is the simulation baked?")
            return None
        hot = None if heat is None else np.maximum(_SMOKE_KELVIN * heat, kelvin)
        corners = np.array(obj.bound_box, np.float64)  # the evaluated mesh is the box around the cells
        low, high = corners.min(axis=0), corners.max(axis=0)
        inside = np.diag([*(high - low) / size, 1.0])
        inside[:3, 3] = low
        return self._medium(obj, Grid.from_arrays(matrix @ inside, gas, hot), material, kelvin, metres)

    def _is_gas(self, obj, material, what: str) -> bool:
        """Whether a material makes cells a gas; a warning if not. what: they are, and a verb."""
        if not is_medium(material):
            self.warnings.add(obj.name, f"{what} not rendered without absorption or scattering in their material")
        return is_medium(material)

    def _medium(self, obj, grid: Grid, material, kelvin: float, metres: float) -> Medium:
        name, block = (obj.name, {}) if material is None else (f"{obj.name}: {material.name}", material)
        optics = read_optics(block, f"Material '{getattr(material, 'name', '')}'", metres)
        pressure = read_pressure(obj, f"Object '{obj.name}'")
        return build_medium(name, temperature=kelvin, grid=grid, pressure=pressure, **optics)

    def _read_file(self, obj, kelvin: float) -> Grid | None:
        """The Grid of a Volume object in its own space. kelvin: where it has no temperature."""
        module = openvdb()
        if module is None:
            self.warnings.add(obj.name, f"this Blender has no module openvdb, which reads volumes; {_LEFT_OUT}")
            return None
        volume = obj.data.grids
        if not volume.load():
            self.warnings.add(
                obj.name, f"the file '{obj.data.filepath}' cannot be read, {_LEFT_OUT}: {volume.error_message}"
            )
            return None
        names = [grid.name for grid in volume]
        if not set(names) & set(_KNOWN):
            found = ", ".join(map(repr, names)) or "none"
            self.warnings.add(obj.name, f"no grid has a name of {', '.join(_KNOWN)}, {_LEFT_OUT}; it has {found}")
            return None
        with tempfile.TemporaryDirectory() as folder:
            path = str(Path(folder) / "volume.vdb")
            try:
                volume.save(path)
                grids = {grid.name: grid for grid in module.readAll(path)[0] if grid.name in _KNOWN}
            except RuntimeError as error:
                self.warnings.add(obj.name, f"its grids cannot be read, {_LEFT_OUT}: {str(error).strip()}")
                return None
            return self._assemble(obj, grids, kelvin)

    def _assemble(self, obj, grids: dict, kelvin: float) -> Grid | None:
        """The Grid of grids of OpenVDB by name: those that lie as the first one does. Where density or a species has
        cells there is gas, without these where the temperature has."""
        matrix, first, numbers = _lie_alike(grids)
        if first and matrix is None:
            self.warnings.add(obj.name, f"the cells of its grid '{first}' are no parallelepipeds, {_LEFT_OUT}")
            return None
        for name in _of_numbers(grids).keys() - numbers.keys():
            self.warnings.add(obj.name, f"its grid '{name}' does not lie as '{first}' does, and is left out")
        leaves, values, background = np.empty((0, 3), np.int32), {}, 0.0
        if _hold_cells(numbers):
            _check_memory(numbers, f"Object '{obj.name}'")
            background = numbers["temperature"].background if "temperature" in numbers else 0.0
            leaves, values, bad = _read_leaves(numbers, f"Object '{obj.name}'")
            for message in _describe_bad(bad):
                self.warnings.add(obj.name, message)
        if not len(leaves):  # so Blender reads a file that ends in the middle
            self.warnings.add(obj.name, f"its grids {', '.join(map(repr, grids))} hold no numbers, {_LEFT_OUT}")
            return None
        kelvin = background if 0.0 < background < np.inf else kelvin
        for name in values:
            if not numbers[name].activeVoxelCount():
                counts = f"{kelvin:.5g} K counts" if name == "temperature" else "it counts as 0"
                self.warnings.add(obj.name, f"its grid '{name}' has no cells (is the file whole?); {counts}")
        if "density" in values:
            density = _or_none(values["density"])
        else:
            density = _hold_any(values[name] for name in _gas(values)).astype(np.float32)
        if np.any(density < 0.0):
            self.warnings.add(obj.name, "its densities below 0 count as 0")
            np.maximum(density, 0.0, out=density)
        temperature = values.pop("temperature", None)
        if temperature is not None:
            temperature[np.isnan(temperature)] = kelvin
        fractions = {name: _or_none(values[name]) for name in SPECIES if name in values}
        return Grid(leaves, matrix, density, temperature, fractions)


@lru_cache(maxsize=16)
def bad_values(path: str, stamp: tuple) -> list[str]:
    """What a render will say of values in an OpenVDB file that are NaN or infinite. It is read once; nothing is said of
    one that cannot be read. stamp: size and time of the file, so that a new one is read anew."""
    module = openvdb()
    if module is None:
        return []
    try:
        grids = {grid.name: grid for grid in module.readAll(path)[0] if grid.name in _KNOWN}
        numbers = _lie_alike(grids)[-1]
        return _describe_bad(_read_leaves(numbers, path)[-1]) if _hold_cells(numbers) else []
    except (RuntimeError, OSError, LookupError, SceneError):  # a file that is being written may be any of these
        return []


def _describe_bad(bad: dict[str, int]) -> list[str]:
    """What a render does with values that are NaN or infinite. bad: number of cells by grid."""
    instead = dict.fromkeys(_gas(bad), "they count as empty")
    there = "they have the temperature of cells without one"
    return [
        f"cells of its grid '{name}' that are NaN or infinite: {count}; {instead.get(name, there)}"
        for name, count in sorted(bad.items(), key=lambda item: _KNOWN.index(item[0]))
        if count
    ]


def openvdb() -> ModuleType | None:
    """The module that comes with Blender; None where there is none. Where Blender is a module of Python's, Python does
    not look into the folder of its modules."""
    if "openvdb" not in sys.modules:
        folders = map(str, (Path(bpy.utils.resource_path("LOCAL")) / "python").glob("**/site-packages"))
        finder, name = importlib.machinery.PathFinder, "openvdb"
        spec = importlib.util.find_spec(name) or finder.find_spec(name, list(folders))
        if spec is None or spec.loader is None:
            return None
        try:
            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
        except ImportError:
            return None
        sys.modules["openvdb"] = module
    return sys.modules["openvdb"]


def _index_to_object(grid) -> np.ndarray | None:
    """(4, 4) float64, from the index space of a grid of OpenVDB, with corners of cells at integers, to the object;
    None if it is not linear.

    In OpenVDB centres of cells are at integers. Blender before 5.0 renders grids half a cell further, and lays those
    that it makes half a cell back.
    """
    transform = grid.transform
    if not transform.isLinear:
        return None
    origin = np.array(transform.indexToWorld((0, 0, 0)))
    axes = [np.array(transform.indexToWorld(tuple(axis))) - origin for axis in np.eye(3, dtype=int).tolist()]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.column_stack(axes), origin
    if bpy.app.version >= (5, 0):
        matrix[:3, 3] -= 0.5 * matrix[:3, :3].sum(axis=1)
    return matrix


def _of_numbers(grids: dict) -> dict:
    """Of grids of OpenVDB by name those of numbers."""
    return {name: grid for name, grid in grids.items() if grid.valueTypeName in ("float", "double")}


def _lie_alike(grids: dict) -> tuple[np.ndarray | None, str, dict]:
    """Of grids of OpenVDB by name those of numbers that lie as the first of them does; before them how that lies, see
    _index_to_object, and its name, empty if there is none."""
    numbers = _of_numbers(grids)
    first = next((name for name in _KNOWN if name in numbers), "")
    matrix = _index_to_object(numbers[first]) if first else None
    if matrix is None:
        return None, first, {}
    near = {"rtol": 1e-6, "atol": 1e-6 * np.abs(matrix).max()}
    others = ((name, grid, _index_to_object(grid)) for name, grid in numbers.items())
    return matrix, first, {n: g for n, g, other in others if other is not None and np.allclose(other, matrix, **near)}


def _hold_cells(grids: dict) -> bool:
    """Whether any grid that says where there is gas has cells."""
    return any(grid.activeVoxelCount() for name, grid in grids.items() if name in _gas(grids))


def _gas(names: Iterable[str]) -> list[str]:
    """Of names of grids, those that say where there is gas."""
    return [name for name in _GAS if name in names] or ["temperature"]


def _or_none(values: np.ndarray) -> np.ndarray:
    """Values with 0 for NaN, where there is none."""
    return np.where(np.isnan(values), np.float32(0.0), values)


def _hold_any(several: Iterable[np.ndarray]) -> np.ndarray:
    """Where any of several arrays has values that are not NaN, bool."""
    return reduce(np.logical_or, (~np.isnan(values) for values in several))


def _check_memory(grids: dict, owner: str) -> None:
    """Raise SceneError, naming the owner, if there is not enough memory to read grids by name: at least all cells of
    the largest that says where there is gas, once in blocks and once as a whole."""
    from ..solver.memory import check_memory  # here, as it loads numba, which checks have no need of

    several = [grids[name] for name in _gas(grids)]
    cells = (LEAF**3 * g.leafCount() + g.activeVoxelCount() - g.activeLeafVoxelCount() for g in several)
    check_memory({"grids": 8.0 * len(grids) * max(cells)}, owner)


def _read_leaves(grids: dict, owner: str) -> tuple[np.ndarray, dict[str, np.ndarray], dict[str, int]]:
    """Leaves (n, 3) int32 in which a grid has values that says where there is gas; the values (n, 8, 8, 8) float32 of
    all grids by name, NaN where they have none; and how many cells around there were NaN or infinite, which count as
    without a value. Block by block, so that a sparse grid is never dense as a whole."""
    gas = _gas(grids)
    boxes = np.array([grids[name].evalActiveVoxelBoundingBox() for name in gas if grids[name].activeVoxelCount()])
    for grid in grids.values():
        grid.background = _NO_VALUE  # inactive cells then have it, too
    low, high = boxes[:, 0].min(axis=0) // LEAF * LEAF, (boxes[:, 1].max(axis=0) // LEAF + 1) * LEAF
    check_spread((high - low) // LEAF, owner)
    found, bad = {name: [] for name in grids} | {"": []}, dict.fromkeys(grids, 0)
    for start in itertools.product(*(range(a, b, _BLOCK) for a, b in zip(low.tolist(), high.tolist(), strict=True))):
        size = np.minimum(high - start, _BLOCK)
        values = {name: _dense(grid, start, size) for name, grid in grids.items()}
        for name, each in values.items():
            bad[name] += _drop_bad(each)
        used = _hold_any(values[name] for name in gas).any(axis=(1, 2, 3))
        for name, each in values.items():
            found[name].append(each[used])
        found[""].append(np.argwhere(used.reshape(size // LEAF)) + np.array(start) // LEAF)
    leaves = np.concatenate(found.pop("")).astype(np.int32)
    return leaves, {name: np.concatenate(each) for name, each in found.items()}, bad


def _dense(grid, start: tuple[int, int, int], size: np.ndarray) -> np.ndarray:
    """(n, 8, 8, 8) float32, the values of a grid in a block of whole leaves."""
    values = np.empty(size, np.float32)
    grid.copyToArray(values, ijk=start)
    return in_leaves(values, start)


def _drop_bad(values: np.ndarray) -> int:
    """Write NaN where there is no value, and where it is infinite; returns how many were NaN or infinite."""
    bad = ~np.isfinite(values)
    values[bad | (np.abs(values) == -_NO_VALUE)] = np.nan
    return int(np.count_nonzero(bad))


def _most_together(grid: Grid) -> float:
    """The largest sum of mole fractions in a cell of a grid."""
    several = [grid.fractions[name] for name in MOLECULES if name in grid.fractions]
    return float(reduce(np.add, several).max()) if several else 0.0


def _moved(grid: Grid, matrix: np.ndarray) -> Grid:
    """A Grid with the same arrays in another space."""
    return Grid(grid.leaves, matrix @ grid.transform, grid.density, grid.temperature, grid.fractions)


def is_gas_domain(obj) -> bool:
    """Whether a mesh is only the box around a smoke simulation."""
    return _gas_domain(obj) is not None


def _gas_domain(obj):
    """The settings of the smoke simulation whose box an object is, None if it is none."""
    for modifier in obj.modifiers:
        if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
            return modifier.domain_settings if modifier.domain_settings.domain_type == "GAS" else None
    return None


def _smoke_values(settings, name: str, size: tuple[int, int, int]) -> np.ndarray | None:
    """(x, y, z) float32 of a grid of a smoke simulation, None if there is none. In Blender x runs fastest."""
    values = getattr(settings, f"{name}_grid")
    if len(values) != np.prod(size) or not len(values):  # Blender 4.5 crashes if asked for a part of an empty one
        return None
    return np.array(values[:], np.float32).reshape(size[::-1]).transpose()
