# SPDX-License-Identifier: GPL-3.0-or-later
"""How long it takes to read a Volume object with a density and a temperature in every cell, and to make it ready to
render, and how much memory that takes.

python -m tests.benchmarks.grid_reading [--cells N]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from addon.reading.volumes import VolumeReader, openvdb
from addon.reading.warnings import Warnings
from addon.solver.geometry.grids import fill_cells, place_grids
from addon.solver.physics.heat import build_heat_table
from addon.solver.physics.radiometry import reference_radiance
from addon.solver.physics.spectrum import uniform_edges
from tests.helpers.process import forget_peak, resident


def write(path: str, cells: int) -> None:
    """An OpenVDB file of random values."""
    module, rng, grids = openvdb(), np.random.default_rng(1), []
    for name, low, high in (("density", 0.1, 1.0), ("temperature", 300.0, 900.0)):
        grid = module.FloatGrid()
        grid.copyFromArray(rng.uniform(low, high, (cells, cells, cells)).astype(np.float32))
        grid.name = name
        grids.append(grid)
    module.write(path, grids=grids)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=256, help="along each axis")
    cells = parser.parse_args().cells
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "random.vdb")
        write(path, cells)
        data, paint = bpy.data.volumes.new("Volume"), bpy.data.materials.new("Gas")
        data.filepath, paint["absorption"] = path, 0.5
        obj = bpy.data.objects.new("Volume", data)
        bpy.context.scene.collection.objects.link(obj)
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        forget_peak()
        before, started = resident("VmRSS"), time.perf_counter()
        medium = VolumeReader(Warnings()).read(evaluated, np.eye(4), paint, 300.0, 1.0)
        read = time.perf_counter()
        edges = uniform_edges(7.5, 14.0, 16)
        heat = build_heat_table((medium,), edges, 300.0, reference_radiance(edges, 300.0))
        fill_cells(place_grids((medium,), np.zeros(3)), (medium,), heat)
        done = time.perf_counter()
    print(f"{cells}^3 cells: read in {read - started:.1f} s, made ready in {done - read:.1f} s")
    more = ((resident(key) - before) / 1e9 for key in ("VmRSS", "VmHWM"))
    print("memory: {:.2f} GB more than before, {:.2f} GB at most".format(*more))


if __name__ == "__main__":
    main()
