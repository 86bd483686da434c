# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons in flight, from one surface to the next."""

from typing import NamedTuple

import numpy as np

from ..system.kernels import INLINED, njit

LIT_BY_LIGHT, LIT_BY_LAMP = 1, 2


class Wave(NamedTuple):
    """Rays in flight, n of them.

    origin, direction: (n, 3) float32. power: (n, b) float32. photon: (n,) int64 number in the pass.
    direct: (n,) bool, on the way from a lamp or light, whose direct light is not the photons' task. chain: (n,) int8,
    LIT_BY_LIGHT or LIT_BY_LAMP where only specular reflections (of lights: only mirrors) lie between, else 0.
    arrival: (n,) int32, code of the side that a photon from the surroundings arrives on if the way back to them (the
    ray) is free; -1 for photons on their way. u, v: where on it. layer: (n,) uint8 as in Photons.
    """

    origin: np.ndarray
    direction: np.ndarray
    power: np.ndarray
    photon: np.ndarray
    direct: np.ndarray
    chain: np.ndarray
    arrival: np.ndarray
    u: np.ndarray
    v: np.ndarray
    layer: np.ndarray


def empty_wave(count: int, bands: int, layer: bool) -> Wave:
    """Room for count rays. layer: see photon_arrays."""
    return Wave(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int64),
        np.empty(count, np.bool_),
        np.empty(count, np.int8),
        np.empty(count, np.int32),
        np.empty(count, np.float32),
        np.empty(count, np.float32),
        np.empty(count if layer else 0, np.uint8),
    )


@njit(**INLINED)
def arrived(wave, i, t, u, v):
    """Where ray i of a wave brings its photon, if it meets triangle t there (-1: none): the triangle, the place on it
    and the photon's direction. Triangle -1 if it is gone: past the scene or, of one from the surroundings, as the way
    back to them is not free.
    """
    dx, dy, dz = float(wave.direction[i, 0]), float(wave.direction[i, 1]), float(wave.direction[i, 2])
    if wave.arrival[i] < 0:
        return t, u, v, dx, dy, dz
    return -1 if t >= 0 else wave.arrival[i] >> 1, wave.u[i], wave.v[i], -dx, -dy, -dz
