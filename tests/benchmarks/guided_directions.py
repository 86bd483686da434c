# SPDX-License-Identifier: GPL-3.0-or-later
"""What final gathers would gain if they sent more rays where more light comes from. Tried; docs/estimators.md.

python -m tests.benchmarks.guided_directions [--points N] [--rays N] [--scene NAME ...]

The square of directions is cut into 8 x 8 cells. Some points where camera paths gather learn the root mean square of
the radiance in each cell; other such points take the cells of the nearest one that lies on their sheet and faces their
way, and half of their rays follow these, half go evenly. Printed is the variance of even rays over that of such
rays, both in strata within the cells, weighted as in the image, beside what full knowledge would bring.
"""

from __future__ import annotations

import argparse
from unittest.mock import patch

import numpy as np
from numba import njit

from addon.solver import Settings
from addon.solver.geometry.interaction import leave
from addon.solver.geometry.mesh import SAME_SURFACE
from addon.solver.geometry.segments import empty_ray_batch
from addon.solver.planning import preparation
from addon.solver.planning.sheets import triangle_radiance
from addon.solver.sampling.vectors import vector
from addon.solver.sampling.warps import cosine_direction, to_world
from tests.benchmarks.speed_scenes import SCENES

CELLS = 8  # on each side of the square of directions
TRUTH = 64  # rays on each side that tell the truth
TESTED = 300  # points
EVENLY = 0.5  # share of the rays


@njit
def start_rays(surfaces, pilot, i, jitter, rays):
    """Rays (side * side) from point i of the pilot, one in each stratum. jitter: (side, side, 2) in [0, 1)."""
    side = len(jitter)
    for row in range(side):
        for column in range(side):
            u, v = (row + jitter[row, column, 0]) / side, (column + jitter[row, column, 1]) / side
            direction = to_world(cosine_direction(u, v), vector(pilot.normal, i))
            leave(surfaces, pilot.side_id[i], vector(pilot.point, i), direction, rays, row * side + column)


def gains(name: str, points: int, rays: int) -> tuple[float, float]:
    """Factor on the variance that cells learnt at so many points by so many rays bring, and what full knowledge would.

    rays: the square of a multiple of CELLS.
    """
    pilots = []

    def explore(*inputs):
        pilots.append(original(*inputs))
        return pilots[0]

    original = preparation.explore
    with patch.object(preparation, "explore", explore):
        model = preparation.prepare(SCENES[name](), Settings())
    (pilot,), surfaces, random = pilots, model.stage.surfaces, np.random.default_rng(0)
    every = np.arange(len(surfaces.material), dtype=np.int32)
    radiance = np.append(triangle_radiance(model.stage, every), model.emitters.surroundings.radiance.sum())

    def look(i: int, side: int) -> np.ndarray:
        """(CELLS^2, n) radiance that rays from point i of the pilot meet, by cell."""
        rays = empty_ray_batch(side * side)
        start_rays(surfaces, pilot, i, random.random((side, side, 2)), rays)
        met = model.tracer.trace(*rays).triangle
        cells = radiance[met].reshape(CELLS, side // CELLS, CELLS, side // CELLS)
        return cells.transpose(0, 2, 1, 3).reshape(CELLS * CELLS, -1)

    order = random.permutation(len(pilot.point))
    tested, learning = order[:TESTED], order[TESTED:][:points]
    learnt = np.array([np.sqrt(np.mean(look(i, round(rays**0.5)) ** 2, axis=1)) for i in learning])
    sheet = surfaces.sheet[pilot.side_id >> 1, pilot.side_id & 1]
    even = guided = best = 0.0
    for i in tested:
        variance, worth = look(i, TRUTH).var(axis=1), pilot.throughput[i] ** 2
        distance = np.linalg.norm(pilot.point[learning] - pilot.point[i], axis=1)
        alike = pilot.normal[learning] @ pilot.normal[i] > SAME_SURFACE
        distance[~(alike & (sheet[learning] == sheet[i]))] = np.inf
        nearest, density = distance.argmin(), np.ones(CELLS * CELLS)
        if distance[nearest] < np.inf and learnt[nearest].any():
            density = EVENLY + (1.0 - EVENLY) * learnt[nearest] / learnt[nearest].mean()
        even += worth * variance.mean()
        guided += worth * (variance / density).mean()
        best += worth * np.sqrt(variance).mean() ** 2
    return even / guided, even / best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--rays", type=int, default=256, help="at each point")
    parser.add_argument("--scene", nargs="+", default=list(SCENES), choices=SCENES, metavar="NAME")
    options = parser.parse_args()
    print("| scene | learnt | full knowledge |\n|---|--:|--:|")
    for name in options.scene:
        learnt, full = gains(name, options.points, options.rays)
        print(f"| {name} | {learnt:.2f} | {full:.2f} |", flush=True)


if __name__ == "__main__":
    main()
