# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a pass of the benchmark's room takes with a plume in a grid, over that without.

python -m tests.benchmarks.grid_cost [--cells N] [--passes N] [--rounds N]

Times are those of the processor, all threads together. The scenes take turns, so that other load on the machine meets
all alike; printed are the medians over the rounds. Where media scatter, a pass sends more camera rays, as that pays
(tests/benchmarks/fog_rays.py); so the plume that scatters is rendered with no more than the others, too.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from addon.solver import Grid, Medium, Scene, Settings, render
from addon.solver.planning import antialiasing
from tests.benchmarks.speed_scenes import plume_grid, room

AS_FEW = "fog plume, camera rays as without scattering"


def with_exhaust(grid: Grid) -> Grid:
    """The plume as water vapour, carbon dioxide and soot."""
    exhaust = {"H2O": 0.1, "CO2": 0.1, "soot": 1e-7}
    fractions = {name: np.float32(fraction) * grid.density for name, fraction in exhaust.items()}
    return replace(grid, density=np.zeros_like(grid.density), fractions=fractions)


def scenes(cells: int) -> dict[str, Scene]:
    """The room: empty, with a clear grey gas everywhere, and with plumes: grey, of molecules and soot, and one that
    scatters."""
    empty, grid = room(), plume_grid(cells)
    return {
        "empty": empty,
        "gas": replace(empty, media=(Medium("air", 0.02, 300.0),), world_depth=5.0),
        "plume": replace(empty, media=(Medium("plume", 1.0, 300.0, grid=grid),)),
        "exhaust plume": replace(empty, media=(Medium("plume", 0.0, 300.0, grid=with_exhaust(grid)),)),
        "fog plume": replace(empty, media=(Medium("plume", 0.5, 300.0, 0.5, 0.3, grid=grid),)),
    }


def seconds_per_pass(scene: Scene, passes: int) -> float:
    """CPU time, median over the passes but the first, which compiles or loads kernels."""
    clock = []
    render(scene, Settings(passes=passes + 1), lambda film: clock.append(time.process_time()))
    return float(np.median(np.diff(clock)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=128, help="along each axis of the plume")
    parser.add_argument("--passes", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    every = scenes(options.cells)
    measured = {name: [] for name in (*every, AS_FEW)}
    for _ in range(options.rounds):
        for name, scene in every.items():
            measured[name].append(seconds_per_pass(scene, options.passes))
        with patch.object(antialiasing, "_MEAN_IN_FOG", antialiasing._MEAN):
            measured[AS_FEW].append(seconds_per_pass(every["fog plume"], options.passes))
    for name, seconds in measured.items():
        ratios = np.divide(seconds, measured["empty"])
        print(f"{name}: {np.median(seconds):.2f} s of CPU time a pass, {np.median(ratios):.2f} times the empty room")


if __name__ == "__main__":
    main()
