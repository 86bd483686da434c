# SPDX-License-Identifier: GPL-3.0-or-later
"""Sobol' points and lattices: as even as they should be, in all and in part."""

import numpy as np
import pytest
from numba import njit

from addon.solver.sampling.low_discrepancy import LATTICES, lattice_point, scrambled, unevenness
from addon.solver.sampling.rng import path_key
from addon.solver.sampling.warps import cosine_direction

COUNTS = tuple(count for count in LATTICES if count >= 8)
PLANES, SHIFTS = 300, 60


@njit
def sobol(key, count):
    path = path_key(key, 0)
    found = np.empty((count, 2))
    for i in range(count):
        found[i] = scrambled(i, path, 0), scrambled(i, path, 1)
    return found


@njit
def lattice(u, v, count, first, last):
    found = np.empty((last - first, 2))
    for i in range(first, last):
        found[i - first] = lattice_point(i, count, u, v)
    return found


@njit
def beyond(points, angle, distance):
    """Share of cosine-distributed directions whose shadow in the unit disk lies beyond a line."""
    above = 0
    for i in range(len(points)):
        x, y, _ = cosine_direction(points[i, 0], points[i, 1])
        above += x * np.cos(angle) + y * np.sin(angle) > distance
    return above / len(points)


def spread(points):
    """Variance of what lies beyond random lines, for sets that points(random) makes, over that of as many random
    points; its relative standard error is less than 3 %."""
    random = np.random.default_rng(1)
    variances, expected = [], []
    for _ in range(PLANES):
        angle, distance = random.uniform(0, 2 * np.pi), random.uniform(-0.8, 0.8)
        sets = [points(random) for _ in range(SHIFTS)]
        variances.append(np.var([beyond(each, angle, distance) for each in sets], ddof=1))
        share = (np.arccos(distance) - distance * np.sqrt(1 - distance**2)) / np.pi
        expected.append(share * (1 - share) / len(sets[0]))
    return np.mean(variances) / np.mean(expected)


@pytest.mark.parametrize("count", COUNTS)
def test_sobol_points_are_a_net(count):
    """In every way to cut the square in `count` equal boxes of powers of two, each box holds one point."""
    for key in range(20):
        found = sobol(np.uint64(key), count)
        for power in range(count.bit_length()):
            columns, rows = 2**power, count // 2**power
            box = np.floor(found * (columns, rows)).astype(int)
            assert len(np.unique(box[:, 0] * rows + box[:, 1])) == count


@pytest.mark.parametrize("count", LATTICES)
def test_lattice_has_a_point_in_every_stratum(count):
    for u, v in np.random.default_rng(0).random((20, 2)):
        found = lattice(u, v, count, 0, count)
        assert np.all((found >= 0) & (found < 1))
        strata = np.floor((found - (u, v)) % 1.0 * count + 0.5) % count  # those between the points of the lattice
        assert all(len(np.unique(column)) == count for column in strata.T)


@pytest.mark.parametrize("count", COUNTS)
def test_lattice_is_as_even_as_a_scrambled_net(count):
    """Less variance than Sobol' points with Owen's scrambling have, for the light behind a straight edge."""
    key = iter(range(PLANES * SHIFTS))
    net = spread(lambda _: sobol(np.uint64(next(key)), count))
    shifted = spread(lambda random: lattice(*random.random(2), count, 0, count))
    print(f"{count} points: lattice {shifted:.4f}, net {net:.4f} of the variance of random points")
    assert shifted < net


@pytest.mark.parametrize("count", [2, 4])
def test_few_points_are_more_even_than_random_ones(count):
    found = spread(lambda random: lattice(*random.random(2), count, 0, count))
    print(f"{count} points: {found:.3f} of the variance of random points")
    assert found < 0.9


@pytest.mark.parametrize("part", [4, 2])
@pytest.mark.parametrize("count", COUNTS)
def test_points_that_follow_one_another_are_even(count, part):
    """So rays that leave one point of a pixel are, too. Random points would have 1, and it has to be clearly less."""
    run = count // part
    firsts = iter(np.random.default_rng(2).integers(0, count - run + 1, PLANES * SHIFTS))

    def points(random):
        first = next(firsts)
        return lattice(*random.random(2), count, first, first + run)

    found = spread(points)
    print(f"{run} of {count} points: {found:.3f} of the variance of random points")
    assert found < 0.75


@pytest.mark.parametrize("count", [64, 256, 512])
def test_points_of_a_lattice_in_a_disk(count):
    """unevenness, for disks at random places in the view of cosine-distributed directions, within a factor of 1.5: a
    rule of thumb, as the lattices differ. 4000 disks each tell the variance to 4 %."""
    random, tried, ratios = np.random.default_rng(2), 4000, []
    for hits in (0.1, 1.0, 10.0, 30.0):
        radius = np.sqrt(hits / count)
        away, turn = np.sqrt(random.random(tried)) * (1.0 - radius), 2.0 * np.pi * random.random(tried)
        found = np.empty(tried)
        for i in range(tried):
            u, v = lattice(*random.random(2), count, 0, count).T
            x, y = np.sqrt(u) * np.cos(2.0 * np.pi * v), np.sqrt(u) * np.sin(2.0 * np.pi * v)
            inside = (x - away[i] * np.cos(turn[i])) ** 2 + (y - away[i] * np.sin(turn[i])) ** 2 < radius**2
            found[i] = np.count_nonzero(inside)
        ratios.append(found.var() / hits / unevenness(hits))
    print("variance over what is foreseen", ratios)
    assert np.all(np.abs(np.log(ratios)) < np.log(1.5))
