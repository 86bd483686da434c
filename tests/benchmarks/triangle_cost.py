# SPDX-License-Identifier: GPL-3.0-or-later
"""What a triangle costs: bytes of memory, and seconds before the first pass.

    python -m tests.benchmarks.triangle_cost [--subdivisions S ...] [--limit GB]

Prints the table of docs/benchmarks.md. The scene is the room of scaling.py: eight balls of 20 * 4^S triangles each, in
64x48 pixels, one pass. A process of its own loads the scene from a file, so that nothing counts that making it takes,
after a small render that loads or compiles the kernels. Memory is counted from before the scene is loaded on, so it
holds the scene, too. --limit ends a render that takes more, in 10^9 bytes of address space. Linux only, as it reads
/proc.
"""

import argparse
import ctypes
import gc
import resource
import tempfile
import time
from collections import Counter
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from addon.solver import Settings, render
from addon.solver import passes as pass_loop
from addon.solver.geometry import surfaces
from addon.solver.memory import memory_of_triangles
from docs.tools.pages import MADE_AT
from tests.benchmarks.scaling import CORES, Size, in_own_process, room
from tests.helpers.process import resident

SMALL = Size(subdivisions=1, width=64)
ARRAYS = ("vertices", "triangles", "material", "temperature")  # of the scene, that grow with the triangles
LEAST = 0.5  # bytes for each triangle that a part is listed from on


class Cost(NamedTuple):
    """Memory in bytes for each triangle: at most, while the passes run, and what the guard foresees beyond the scene.
    Time in seconds for each million triangles: of all threads' processors, on the wall, and what of that Embree takes
    to copy the mesh and to build its tree. parts: memory by array."""

    peak: float
    kept: float
    foreseen: float
    prepare: float
    prepare_wall: float
    embree_wall: float
    one_pass: float  # s, wall
    parts: dict[str, float]


def keep_scene(subdivisions: int, path: Path) -> int:
    """Write the arrays of the room; returns its number of triangles."""
    scene = room(SMALL._replace(subdivisions=subdivisions))
    np.savez(path, **{name: getattr(scene, name) for name in ARRAYS})
    return len(scene.triangles)


def measure(path: Path, limit: float | None) -> Cost:
    """The Cost of a render in this process. limit: 10^9 bytes of address space, None for no limit."""
    settings = Settings(passes=1, photons_per_pass=SMALL.photons, threads=CORES)
    small = room(SMALL)
    render(small, settings)
    gc.collect()
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_AS, (int(limit * 1e9),) * 2)
    before = resident("VmRSS")
    with np.load(path) as arrays:
        scene = replace(small, **dict(arrays))
    count = len(scene.triangles)
    seen = {}

    def prepare(*inputs):
        start = time.process_time(), time.perf_counter()
        model = prepare_as_ever(*inputs)
        ctypes.CDLL(None).malloc_trim(0)
        seen.update(
            prepare=time.process_time() - start[0],
            prepare_wall=time.perf_counter() - start[1],
            kept=resident("VmRSS") - before,
            parts=parts_of({"scene": scene, "model": model}, count),
        )
        return model

    def trace(*inputs):
        start = time.perf_counter()
        tracer = tracer_as_ever(*inputs)
        seen.update(embree=time.perf_counter() - start)
        return tracer

    prepare_as_ever, tracer_as_ever = pass_loop.prepare, surfaces.Tracer
    with patch.object(pass_loop, "prepare", prepare), patch.object(surfaces, "Tracer", trace):
        start = time.perf_counter()
        render(scene, settings)
        both = time.perf_counter() - start
    millions, kept = count / 1e6, seen["kept"] / count
    parts = seen["parts"] | {"Embree and what is small": kept - sum(seen["parts"].values())}
    return Cost(
        peak=(resident("VmHWM") - before) / count,
        kept=kept,
        foreseen=memory_of_triangles(count) / count,
        prepare=seen["prepare"] / millions,
        prepare_wall=seen["prepare_wall"] / millions,
        embree_wall=seen["embree"] / millions,
        one_pass=both - seen["prepare_wall"],
        parts=parts,
    )


def parts_of(holders: dict[str, object], count: int) -> dict[str, float]:
    """Bytes for each of `count` triangles of the arrays that some objects hold, by name; an array that several hold is
    counted once."""
    sizes, known, waiting = Counter(), set(), list(holders.items())
    for name, value in waiting:
        if isinstance(value, np.ndarray):
            address = value.__array_interface__["data"][0]
            if address not in known:
                known.add(address)
                sizes[name] += value.nbytes / count
        elif is_dataclass(value):
            waiting += [(f"{name}.{each.name}", getattr(value, each.name)) for each in fields(value)]
        elif hasattr(value, "_fields"):
            waiting += [(f"{name}.{each}", getattr(value, each)) for each in value._fields]
    return {name: size for name, size in sizes.most_common() if size >= LEAST}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--subdivisions", type=int, nargs="+", default=[5, 6, 7], help="of the balls (5 6 7)")
    parser.add_argument("--limit", type=float, help="10^9 bytes of address space that the process may take")
    options = parser.parse_args()
    rows, costs = [], []
    for subdivisions in options.subdivisions:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.npz"
            count = in_own_process(keep_scene, subdivisions, path)
            costs.append(in_own_process(measure, path, options.limit))
        cost = costs[-1]
        rows.append(
            f"| {count:,} | {cost.peak:.0f} | {cost.kept:.0f} | {cost.foreseen:.0f} | {cost.prepare:.2f} | "
            f"{cost.prepare_wall:.2f} | {cost.embree_wall:.2f} | {cost.one_pass:.2f} |"
        )
    print("| triangles | peak, bytes each | kept | foreseen | prepare, s per million | wall | Embree | pass, s |")
    print("|--:" * 8 + "|")
    print("\n".join(rows))
    print("\n| of these, kept | bytes per triangle |\n|---|--:|")
    for name, size in costs[-1].parts.items():
        print(f"| {name} | {size:.1f} |")
    print(f"\n{MADE_AT}")


if __name__ == "__main__":
    main()
