# SPDX-License-Identifier: GPL-3.0-or-later
"""The wave: photons in flight from one surface to the next."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import interact, interact_at
from ..sampling.heuristics import TYPICAL_RAYS, balance
from ..sampling.vectors import scaled, vector
from ..system.kernels import INLINED, njit

STRAIGHT_FROM_LIGHT, CAUSTIC, MIRRORED, OF_LIGHT = 1, 2, 4, 8  # flags, see Wave.chain
FORWARDS, FROM_SUN = -1, -2  # see Wave.arrival
EITHER, ONLY_DIFFUSE, ONLY_GLOSSY = range(3)  # see Wave.lobe


class Wave(NamedTuple):
    """n photons in flight.

    origin, direction: (n, 3) float32. power: (n, b) float32, W. photon: (n,) int64, number in the pass.
    aimed: (n,) float32, m-2, points that compete for a shadow ray on each m2 across the direction of the emission,
    where the next hit is direct light, see stored_share; 0 where shadow rays find nothing of the light, infinite where
    they find all; sr-1 for photons from the surroundings. chain: (n,) int8, STRAIGHT_FROM_LIGHT where the photon has
    met nothing but mirrors since a light emitted it, CAUSTIC where it has met nothing but specular surfaces, rough ones
    too but no wide one first, since a light or a lamp that throws caustics emitted it, else 0. MIRRORED once it has met
    one of these, OF_LIGHT if a light emitted it.
    arrival: (n,) int32. A photon from the surroundings starts where it arrives, on the side with this side_id, and its
    ray leads back: it arrives if that ray leaves the scene. FORWARDS for photons that travel so, FROM_SUN for those of
    them that have met nothing yet since a sun sent them. u, v: (n,) float32, barycentric coordinates on that side.
    layer: (n,) uint8 as in Photons. passed: (n,) float32, m, length of the way up to the last thin sheet that it has
    passed since its emission or reflection; (0,) in a scene without thin sheets.
    lobe: (n,) uint8, which lobes reflect the photon where it arrives, EITHER or one alone; start: (n,) int32, triangle
    that it has left, -1 for none; both (0,) where nothing is hidden from the rays of either lobe (see sight).
    """

    origin: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    photon: np.ndarray
    aimed: np.ndarray
    chain: np.ndarray
    arrival: np.ndarray
    u: np.ndarray
    v: np.ndarray
    layer: np.ndarray
    passed: np.ndarray
    lobe: np.ndarray
    start: np.ndarray


def empty_wave(count: int, bands: int, layer: bool, passes: bool = False, hides: bool = False) -> Wave:
    """Room for count rays. layer: see photon_arrays. passes: whether light passes through any surface. hides: see
    Tracer."""
    return Wave(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int64),
        np.empty(count, np.float32),
        np.empty(count, np.int8),
        np.empty(count, np.int32),
        np.empty(count, np.float32),
        np.empty(count, np.float32),
        np.empty(count if layer else 0, np.uint8),
        np.zeros(count if passes else 0, np.float32),
        np.full(count if hides else 0, EITHER, np.uint8),
        np.full(count if hides else 0, -1, np.int32),
    )


@njit(**INLINED)
def has_arrived(wave, i, triangle):
    """Whether photon i has arrived on a surface. triangle: that its ray met, -1 for none. A photon that left the scene
    has not; a photon from the surroundings has if its ray met nothing (see Wave)."""
    return (triangle >= 0) == (wave.arrival[i] < 0)


@njit(**INLINED)
def arrive(surfaces, hits, i, wave):
    """The Interaction of photon i, which has arrived."""
    if wave.arrival[i] < 0:
        return interact(surfaces, hits, i, wave.direction)
    u, v, back = wave.u[i], wave.v[i], scaled(vector(wave.direction, i), -1.0)
    return interact_at(surfaces, np.int64(wave.arrival[i] >> 1), u, v, back, hits.distance[i])


@njit(**INLINED)
def stored_share(wave, i, at):
    """Share of the light of photon i that is left to photons at an Interaction, and not to shadow rays."""
    distance = at.distance + (wave.passed[i] if wave.passed.size else 0.0)
    if wave.arrival[i] >= 0:
        distance = 1.0
    return balance(TYPICAL_RAYS * at.geometric_cosine / math.pi, wave.aimed[i] * distance * distance)
