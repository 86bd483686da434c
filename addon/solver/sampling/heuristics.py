# SPDX-License-Identifier: GPL-3.0-or-later
"""Multiple importance sampling: how two ways to find the same light share it (Veach 1997, chapter 9).

The direct light of a lamp at a point is found by shadow rays, and also by rays of a final gather or of a rough lobe
that meet the lamp by chance, or by photons. Each way counts the share of the light that this heuristic gives it, so
that all light is counted once, and each way finds what it finds best.
"""

import math

from ..system.kernels import INLINED, njit

# Rays of a final gather that the heuristic counts with, also in place of photons. It is one number, whatever a gather
# sends: the share must be the same for all gathers that share rays, and for all photons.
TYPICAL_RAYS = 256.0
CANDIDATES = 32  # lamp points that compete for a shadow ray
BEST = 256.0  # rays that a shadow ray to a lamp which nothing hides is worth, where the light varies little over lamps
# Single rays, of rough lobes and continued ones, count as so many: where the light varies much over the lamps, as in a
# narrow lobe, a shadow ray is worth no more than its candidates, and a larger share would make it noisy beyond bounds.
SINGLE_RAY = BEST / CANDIDATES


@njit(**INLINED)
def balance(mine, other):
    """Share of the light that is left to one of two ways, which send so many samples, sr^-1, in its direction: Veach's
    power heuristic (eq. 9.13, with the exponent 2). A way that sends few samples gets next to nothing, as its rare finds
    would be noise that no pass foresees."""
    if not other > 0.0:
        return 1.0
    ratio = other / mine if mine > 0.0 else math.inf
    return 1.0 / (1.0 + ratio * ratio)
