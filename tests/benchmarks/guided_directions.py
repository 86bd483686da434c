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

from addon.solver import Settings, passes
from addon.solver.geometry.surfaces import SAME_SURFACE, put_ray
from addon.solver.planning.sheets import _radiance
from addon.solver.sampling.warps import cosine_direction, to_world
from tests.benchmarks.speed_scenes import SCENES

CELLS = 8  # on each side of the square of directions
TRUTH = 64  # rays on each side that tell the truth
TESTED = 300  # places
EVENLY = 0.5  # share of the rays


@njit
def start_rays(surfaces, code, place, facing, jitter, origin, direction):
    """Rays (side * side) from a place, one in each stratum. jitter: (side, side, 2) in [0, 1)."""
    side = len(jitter)
    for i in range(side):
        for j in range(side):
            x, y, z = cosine_direction((i + jitter[i, j, 0]) / side, (j + jitter[i, j, 1]) / side)
            nx, ny, nz = facing
            dx, dy, dz = to_world(x, y, z, nx, ny, nz)
            px, py, pz = place
            put_ray(surfaces, code >> 1, px, py, pz, nx, ny, nz, dx, dy, dz, origin, direction, i * side + j)


def gains(name: str, points: int, rays: int) -> tuple[float, float]:
    """Factor on the variance that cells learnt at so many points by so many rays bring, and what full knowledge would.

    rays: the square of a multiple of CELLS.
    """
    pilots = []

    def explore(*inputs):
        pilots.append(original(*inputs))
        return pilots[0]

    original = passes.explore
    with patch.object(passes, "explore", explore):
        model = passes.prepare(SCENES[name](), Settings())
    (pilot,), surfaces, random = pilots, model.surfaces, np.random.default_rng(0)
    radiance = np.append(_radiance(surfaces, model.radiometry), model.emitters.surroundings.sum())

    def look(place: int, side: int) -> np.ndarray:
        """(CELLS^2, n) radiance that rays meet, by cell."""
        origin, direction = np.empty((2, side * side, 3), np.float32)
        jitter = random.random((side, side, 2))
        start_rays(surfaces, pilot.code[place], pilot.place[place], pilot.facing[place], jitter, origin, direction)
        met, _, _ = model.tracer.trace(origin, direction, np.full(side * side, 1e37, np.float32))
        cells = radiance[met].reshape(CELLS, side // CELLS, CELLS, side // CELLS)
        return cells.transpose(0, 2, 1, 3).reshape(CELLS * CELLS, -1)

    order = random.permutation(len(pilot.place))
    tested, learning = order[:TESTED], order[TESTED:][:points]
    learnt = np.array([np.sqrt(np.mean(look(place, round(rays**0.5)) ** 2, axis=1)) for place in learning])
    sheet = surfaces.sheet[pilot.code >> 1, pilot.code & 1]
    even = guided = best = 0.0
    for place in tested:
        variance, worth = look(place, TRUTH).var(axis=1), pilot.carried[place] ** 2
        distance = np.linalg.norm(pilot.place[learning] - pilot.place[place], axis=1)
        alike = pilot.facing[learning] @ pilot.facing[place] > SAME_SURFACE
        distance[~(alike & (sheet[learning] == sheet[place]))] = np.inf
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
