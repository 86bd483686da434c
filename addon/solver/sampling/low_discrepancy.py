# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that lie more evenly than random points: the Sobol' sequence, scrambled, and lattices, shifted at random."""

import math

import numpy as np

from ..system.kernels import INLINED, KERNEL, njit
from .rng import uniform

# Primitive polynomial (degree, coefficients) and first direction numbers of dimensions 2 to 5 (Joe and Kuo 2008).
_SOBOL = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)), (3, 2, (1, 1, 1)))


def _direction_numbers() -> np.ndarray:
    """(5, 32) uint32 direction numbers of the Sobol' sequence, the first dimension van der Corput's."""
    numbers = np.ones((1 + len(_SOBOL), 32), np.uint64)
    for row, (degree, coefficients, first) in zip(numbers[1:], _SOBOL, strict=True):
        row[:degree] = first
        for i in range(degree, 32):
            row[i] = row[i - degree] ^ (row[i - degree] << np.uint64(degree))
            for k in range(1, degree):
                if coefficients >> (degree - 1 - k) & 1:
                    row[i] ^= row[i - k] << np.uint64(k)
    return (numbers << np.arange(31, -1, -1, dtype=np.uint64)).astype(np.uint32)


# The direction numbers with their bits from last to first, as scrambling needs them.
_DIRECTIONS = np.array([[int(f"{number:032b}"[::-1], 2) for number in row] for row in _direction_numbers()], np.uint32)


@njit(**KERNEL)
def reversed_sobol(index, dimension):
    """Coordinate of point `index` of the Sobol' sequence (uint32, modulo its 2^32 points) as a fraction of 2^32 with
    its bits from last to first. dimension: 0 to 4.
    """
    x = np.uint32(0)
    bit = 0
    while index > 0:
        if index & 1:
            x ^= _DIRECTIONS[dimension, bit]
        index >>= 1
        bit += 1
    return x


@njit(**INLINED)
def _reverse(x):
    """The bits of a uint32 from last to first."""
    x = np.uint32((x >> np.uint32(16)) | (x << np.uint32(16)))
    x = ((x & np.uint32(0xFF00FF00)) >> np.uint32(8)) | ((x & np.uint32(0x00FF00FF)) << np.uint32(8))
    x = ((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4)) | ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4))
    x = ((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2)) | ((x & np.uint32(0x33333333)) << np.uint32(2))
    return ((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1)) | ((x & np.uint32(0x55555555)) << np.uint32(1))


@njit(**INLINED)
def _permute(x, seed):
    """Owen's nested permutation of uint32 with reversed bits: a hash of all lower bits decides whether a bit is
    flipped.

    Burley 2020, "Practical hash-based Owen scrambling", listing 2. numba widens products, so each is cut to 32 bits.
    """
    x = np.uint32(x ^ (x * np.uint32(0x3D20ADEA)))
    x = np.uint32((x + seed) * ((seed >> np.uint32(16)) | np.uint32(1)))
    x = np.uint32(x ^ (x * np.uint32(0x05526C56)))
    return np.uint32(x ^ (x * np.uint32(0x53A22864)))


@njit(**INLINED)
def scrambled(index, path, dimension):
    """Coordinate of point `index` of the Sobol' sequence in [0, 1), scrambled by key `path`. dimension: 0 to 4.

    Scrambling keeps the sequence stratified. Unlike a digital shift it also smooths edges along a pixel's diagonal.
    """
    seed = np.uint32(uniform(path, dimension) * 4294967296.0)
    return float(_reverse(_permute(reversed_sobol(index, dimension), seed))) * 2.0**-32


# Korobov's lattices: number of points -> (generator, step from point to point). Of all generators these have nearly the
# least variance for what lies on one side of a random plane. Of all steps these have nearly the least variance for runs
# of consecutive points (tests/test_low_discrepancy.py). Fewer than 8 points leave no choice: they lie on a diagonal.
LATTICES = {1: (1, 1), 2: (1, 1), 4: (1, 1), 8: (5, 1), 16: (39, 1), 32: (39, 11), 64: (39, 7)}
LATTICES |= {128: (39, 31), 256: (75, 209), 512: (149, 415)}
_GENERATORS, _STEPS = np.zeros((2, max(LATTICES) // 8 + 1), np.int64)  # 1 to 4 points share one entry
for _count, (_generator, _step) in LATTICES.items():
    _GENERATORS[_count >> 3], _STEPS[_count >> 3] = _generator, _step

_RIM = 0.27  # see unevenness; between 0.22 and 0.30 for disks that 1 to 100 of 64 to 512 points meet (same tests)


@njit(**INLINED)
def lattice_point(index, count, u, v):
    """Point in [0, 1)^2 of Korobov's lattice of count points (see LATTICES), shifted by (u, v) in [0, 1)^2.

    Each coordinate has one point in every stratum of width 1 / count. Consecutive points lie evenly, too.
    """
    step = index * _STEPS[count >> 3] & (count - 1)
    x, y = u + step / count, v + (_GENERATORS[count >> 3] * step & (count - 1)) / count
    return x - math.floor(x), y - math.floor(y)


@njit(**INLINED)
def unevenness(hits):
    """Variance of the number of points of a lattice in a disk, over that of as many random points. hits: their mean
    number. Points along the rim alone are uncertain, h^(1/2) of h, so the ratio falls as h^(-1/2) (Mitchell 1996)."""
    return min(1.0, _RIM / math.sqrt(max(hits, 1e-30)))
