# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths through thin sheets: what passes goes straight on, as the same ray.

To all that shares the light with the ray, such as shadow rays, a sheet on its way changes nothing but what gets
through. So the ray keeps its density and the length of its way, and is to what it meets as far from its origin as the
shadow rays are.
"""

import numpy as np

from ..geometry.interaction import interact, pass_on
from ..geometry.segments import ENDLESS
from ..geometry.stage import Stage, is_passed, passing_at
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, vector
from ..system.kernels import FAST_KERNEL, njit
from .onward import full_throughput
from .rays import Bounce, Rays, empty_rays, largest_throughput
from .streams import PASSING


def pass_through(stage: Stage, bounce: Bounce, samples: np.ndarray, reach: np.ndarray) -> tuple[Rays, np.ndarray]:
    """The rays of a bounce that go on behind the thin sheets that they met, and their reach. Of weak ones roulette ends
    some. All distances of the bounce's hits become those from where the rays set out.

    samples: (pixels,), camera rays of each pixel. reach: (n,) float32 of the bounce's rays, in units of the direction's
    length; the rays that go on have directions of unit length.
    """
    count = len(bounce.hits.triangle)
    bands = bounce.rays.throughput.shape[1]
    passed, left, room = empty_rays(count, bands, True), np.empty(count, np.float32), np.empty(bands, np.float32)
    found = _pass_through(stage, bounce, samples, reach, (passed, left), room)
    bounce.hits.distance[:] += bounce.rays.passed[:count]
    return Rays(*(column[:found] for column in passed)), left[:found]


@njit(**FAST_KERNEL)
def _pass_through(stage, bounce, samples, reach, out, room):
    rays, hits, (passed, left), found = bounce.rays, bounce.hits, out, np.int64(0)
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0 or not is_passed(stage, np.int64(hits.triangle[i])):
            continue
        at, way = interact(stage.surfaces, hits, i, rays.direction), vector(rays.direction, i)
        tau, path = passing_at(stage, at, room), path_key(rays.path[i], PASSING + bounce.number)
        through = largest_throughput(rays.throughput[i], tau)
        if through <= 0.0:
            continue
        survival = min(1.0, through / full_throughput(rays, i, samples))
        if uniform(path, 0) >= survival:
            continue
        pass_on(stage.surfaces, at, passed, found)
        passed.pixel[found], passed.path[found], passed.density[found] = rays.pixel[i], path, rays.density[i]
        passed.final[found], passed.continued[found] = rays.final[i], rays.continued[i]
        passed.kind[found], passed.steady[found] = rays.kind[i], rays.steady[i] and survival >= 1.0
        passed.doubts[found], passed.passed[found] = rays.doubts[i], rays.passed[i] + np.float32(at.distance)
        remaining = (reach[i] - hits.distance[i]) * np.float32(np.sqrt(dot(way, way)))
        left[found] = remaining if reach[i] < ENDLESS else ENDLESS
        for b in range(tau.size):
            passed.throughput[found, b] = rays.throughput[i, b] * tau[b] * np.float32(1.0 / survival)
        found += 1
    return found
