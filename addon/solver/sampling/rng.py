# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers as a function of (seed, pass, path, dimension): no state, so that neither threads nor order
change the result."""

import numpy as np

from ..system.kernels import KERNEL, njit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_TO_UNIT = 2.0**-53

# Streams of one pass. No two streams share a random number.
PHOTONS, CAMERA, PILOT, TRIAL, LAMPS, CACHE, GAS, MOMENTS = range(8)
ALL_PASSES = 2**32 - 1  # instead of a pass index: for sequences that all passes share

# Streams of what is planned before the first pass, the same for every seed: pass_key(0, one of these, PILOT).
PATHS = 0  # the pilot's camera paths
PROBES = 1, 2, 3  # rounds of rays from sides that no camera path met
PRICED_PIXELS = 7  # pixels whose camera rays are counted to find the best price
PATH_PIXELS = 8  # where the pilot's camera paths start
OPENNESS = 9  # rays that tell how much of the scene is open to the surroundings
SURVEY = 10  # rays that survey every pixel, and the rays of final gathers that are tried there
SHEETS = 11  # lattices of rays that tell how even they are
LAMP_CHOICE = 12  # shadow rays that tell which surfaces are lamps
AFAR = 15  # photons that tell how much light arrives from media and surroundings
THROUGH_MEDIA = 16  # rays that tell how much light media take
CANDIDATE_CHOICE = 14  # points of lamps that tell how evenly triangles shine
PRICED_CELLS = 13  # cells whose gathers are counted to find the best price


@njit(**KERNEL)
def _mix(z):
    """Finaliser of SplitMix64 (Steele, Lea and Flood 2014), a bijection of 64-bit integers."""
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(**KERNEL)
def _pass_key(seed, index, stream):
    z = _mix(seed + _GOLDEN)
    z = _mix(z ^ index)
    return _mix(z ^ stream)


def pass_key(seed: int, index: int, stream: int) -> np.uint64:
    """Key of one stream of one pass. A numpy integer, so that kernels are compiled for a single type of key."""
    return np.uint64(_pass_key(np.uint64(seed), np.uint64(index), np.uint64(stream)))


@njit(**KERNEL)
def path_key(key, path):
    """Key of one path (photon or camera ray) of a stream."""
    return _mix(key + _GOLDEN * np.uint64(path + 1))


@njit(**KERNEL)
def uniform(key, dimension):
    """Number in [0, 1) for one dimension of a path, float64."""
    return float(_mix(key + _GOLDEN * np.uint64(dimension + 1)) >> np.uint64(11)) * _TO_UNIT


@njit(cache=True, nogil=True)
def path_keys(key, paths):
    """(n,) uint64 keys of paths (n,) int64."""
    keys = np.empty(paths.size, np.uint64)
    for i in range(paths.size):
        keys[i] = path_key(key, paths[i])
    return keys


@njit(cache=True, nogil=True)
def uniforms(key, first, count):
    """Numbers in [0, 1), (count,) float64, one for each of the paths first, first + 1, ..."""
    numbers = np.empty(count)
    for i in range(count):
        numbers[i] = uniform(path_key(key, first + i), 0)
    return numbers


def strata(key: np.uint64, count: int, total: int) -> np.ndarray:
    """(count,) int64 ascending numbers below `total`: one number, at random, from each of `count` equal parts. At equal
    steps the numbers could fall in step with a period of what is numbered, such as the columns of an image."""
    return np.minimum((np.arange(count) + uniforms(key, 0, count)) * total / count, total - 1).astype(np.int64)
