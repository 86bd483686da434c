# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimator of the paper (docs/method.md names it), made of the engine: what the paper does not have, switched off.

Two steps, both with the settings PAPER:

- photons_alone: all reflected light is the density of photons. docs/benchmarks.md calls it paper+, because the engine
  still knows which photons matter and how far a disk may reach.
- papers_estimator: that is off, too. docs/paper.md repeats the paper's results with it, and says what stays.
"""

import importlib
import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from unittest import mock

import numpy as np

from addon.solver.camera.final_gather import choose_splits
from addon.solver.geometry.free_space import unlimited
from addon.solver.photons.emission import emit
from addon.solver.planning.lamps import build_lamps
from addon.solver.planning.pilot import DEFENSIVE

PAPER = {"reference_subtraction": False, "roulette": "BAND_AVERAGE", "shrink": False}  # of Settings


def no_final_gathers(stage, estimate, pixels, bounce, gathers):
    """Gathers that nobody has chosen ask photons."""
    return gathers


def rays_everywhere(stage, estimate, pixels, bounce, gathers):
    """The opposite, that tests and benchmarks set against it: every gather that sends rays sends as many."""
    kept = choose_splits(stage, estimate, pixels, bounce, gathers)
    kept.rays[kept.rays > 0] = 32
    return kept


def without_sides(table):
    """A SideTable in which no side weighs anything."""
    return table._replace(factor=np.zeros_like(table.factor), before=np.zeros_like(table.before))


def no_lamps(*arguments):
    """Nothing that shadow rays are sent to: rays and photons count all that they find."""
    lamps, worth = build_lamps(*arguments)
    lamps = lamps._replace(
        sides=without_sides(lamps.sides),
        light_end=np.zeros_like(lamps.light_end),
        share=np.zeros_like(lamps.share),
        found=np.ones_like(lamps.found),
        caustic=np.zeros_like(lamps.caustic),
    )
    return lamps, worth


def lights_alone(*arguments):
    """Shadow rays are sent to lights alone: rays and photons count all that they find of surfaces."""
    lamps, worth = build_lamps(*arguments)
    lamps = lamps._replace(
        sides=without_sides(lamps.sides),
        light_end=lamps.light_end - lamps.light_end[0],
        share=np.zeros_like(lamps.share),
        found=np.ones_like(lamps.found),
    )
    return lamps, worth


def emit_all(emitters, stage, batch, wave):
    """Emit photons whose direct light counts, that of lights and of the surroundings, too: no shadow rays bring it."""
    emit(emitters, stage, batch, wave)
    wave.aimed[:] = 0.0


def by_power_alone(count, extent, reachable):
    """Every reachable sheet emits by its power alone."""
    return np.where(reachable, 1.0, DEFENSIVE)


def no_walls(tracer, surfaces, reach2, point, *_):
    return unlimited(len(point), reach2)


# Ends of rays recall from the nearest cached point on this side of walls, however wide its disk is.
ALWAYS_RECALL = {"photons.irradiance_cache._RESOLVED": math.inf}


def any_reach(pilot, photons, neighbours):
    """Disks as wide as the k-th neighbour is far: their limit holds k even where only 1 % of the photons are stored."""
    return 100.0 * neighbours * float(pilot.extent.sum() / 2.0) / (math.pi * photons)


# What changes: "room.module.name" in addon.solver
PHOTONS_ALONE = {
    "camera.eye_paths.choose_splits": no_final_gathers,
    "passes.cache_points": lambda *_: 1,  # nobody asks the irradiance cache then
    "planning.preparation.build_lamps": no_lamps,
    "photons.transport.emit": emit_all,
    "planning.pilot._OPEN": 1.0,  # no rays to the surroundings
}
PAPERS_ESTIMATOR = PHOTONS_ALONE | {
    "planning.pilot._density": by_power_alone,
    "planning.preparation.gather_reach": any_reach,
    "camera.eye_paths.free_space": no_walls,
}


@contextmanager
def changed(changes: dict[str, object]) -> Iterator[None]:
    """Change the solver's constants and functions, each a "room.module.name", for a while."""
    with ExitStack() as stack:
        for target, value in changes.items():
            module, _, name = target.rpartition(".")
            stack.enter_context(mock.patch.object(importlib.import_module(f"addon.solver.{module}"), name, value))
        yield


def photons_alone():
    """All reflected light from the photon map, as in section 4.3 of the paper: no final gathers, no cache that they
    recall from, no shadow rays, no rays to the surroundings."""
    return changed(PHOTONS_ALONE)


def papers_estimator():
    """Photons alone, thrown in proportion to power, and as many neighbours as asked for, however far they are."""
    return changed(PAPERS_ESTIMATOR)
