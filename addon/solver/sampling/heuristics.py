# SPDX-License-Identifier: GPL-3.0-or-later
"""Multiple importance sampling: how two ways to find the same light share it (Veach 1997, chapter 9).

The ledger. Every kind of light path is counted once (docs/method.md, "One ledger"; tests/test_ledger.py). From the eye
on, D diffuse, G rough, S mirror; "visible" where G and S alone lie before, an "end" where a gather's ray is:

- seen, or in mirrors: the camera ray, in full (Rays.density ALONE).
- visible G: its own ray against a shadow ray. Lights: the shadow ray. Lights behind mirrors: photons straight from the
  light.
- visible D: rays of the gather against a shadow ray. Lights: the shadow ray. By way of a wide G next to the source: its
  ray against a shadow ray there. By way of others: the ray, but for lights and caustic lamps, which photons of caustics
  bring (BLIND).
- an end that recalls: first-hit photons against shadow rays of the cached point, all later photons in full. The sky:
  photons, on open sheets rays.
- a sky of which a small part is bright: as a surface, in all of these, see planning.lamps.
- an end that is continued: its one ray against a shadow ray, and photons of caustics, as at a visible D.
- where a medium scatters a camera path: its one ray against a shadow ray. Lights: the shadow ray. By way of specular
  surfaces: the ray; lights: as at a visible G or D, but by photons thrown into the medium for those of caustics.

Two that stand against each other take their shares from `balance`, with the same density of shadow rays (Lamps.density)
and the same number of rays (Looking, TYPICAL_RAYS, SINGLE_RAY) on both sides.
"""

import math
from typing import NamedTuple

import numpy as np

from ..system.kernels import INLINED, njit

# Rays of final gathers that look from one point, where nothing better is known: for the plan, and in place of photons,
# as the share must be the same for all photons.
TYPICAL_RAYS = 256.0
CANDIDATES = 32  # lamp points that compete for a shadow ray
BEST = 256.0  # rays that a shadow ray to a lamp which nothing hides is worth, where the light varies little over lamps
# Single rays, of rough lobes and continued ones, count as so many: where the light varies much over the lamps, as in a
# narrow lobe, a shadow ray is worth no more than its candidates, and a larger share would make it noisy beyond bounds.
SINGLE_RAY = BEST / CANDIDATES
ALONE = np.float32(1e30)  # density, sr-1, of rays that share what they find with no shadow ray: beyond any other


@njit(**INLINED)
def balance(mine, other):
    """Share of the light that is left to one of two ways, which send so many samples, sr^-1, in its direction: Veach's
    power heuristic (eq. 9.13, with the exponent 2). A way that sends few samples gets next to nothing, as its rare
    finds would be noise that no pass foresees."""
    if not other > 0.0:
        return 1.0
    ratio = other / mine if mine > 0.0 else math.inf
    return 1.0 / (1.0 + ratio * ratio)


class Looking(NamedTuple):
    """How many rays of the diffuse lobe look for light from a point, or, as arrays, from a point on each sheet.

    together: of all final gathers that share rays. alone: of one gather, which has what lies nearer than about `near`,
    m, for itself, see shared_part. The heuristic counts with these numbers, which are the same for all gathers on a
    sheet, whatever each sends: those that share rays must agree on the share of shadow rays.
    """

    near: float
    alone: float
    together: float


@njit(**INLINED)
def rays_to(looking, distance):
    """Number of rays that may meet what lies so far away, m."""
    return looking.alone + shared_part(looking.near, distance) * (looking.together - looking.alone)


@njit(**INLINED)
def shared_part(near, distance):
    """Part of the light from so far away, m, that neighbours share: from 0 at half of near to 1 at twice near. What is
    shared is averaged over neighbours, so it must not bend: a sudden change at `near` would, where a wall lies there.
    """
    if near <= 0.0:
        return 1.0
    t = min(1.0, max(0.0, 0.5 + 0.5 * math.log2(max(distance / near, 1e-30))))
    return t * t * (3.0 - 2.0 * t)


@njit(**INLINED)
def looking_from(looking, sheet):
    """The Looking from one sheet."""
    return Looking(
        np.float64(looking.near[sheet]), np.float64(looking.alone[sheet]), np.float64(looking.together[sheet])
    )


def typical_looking(sheets: int) -> Looking:
    """The Looking from each of so many sheets, where nothing is known of them."""
    return Looking(*(np.full(sheets, of, np.float32) for of in (0.0, TYPICAL_RAYS, TYPICAL_RAYS)))
