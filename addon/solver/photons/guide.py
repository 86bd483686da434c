# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide: photons are sent where trial photons contributed to the image.

Five numbers in [0, 1) choose an emission: the emitter (1 number), the point on it (2) and the direction (2). A trial
photon's score is what it leaves where camera paths gather. The cube of the five numbers is cut into cells, and each
cell is sampled in proportion to the root mean square of the scores within: importance sampling in primary sample space
(Guo et al. 2018). A photon's weight is divided by the density with which its numbers were drawn, and a part of the
density is spread evenly over the cube. So the mean of the image is exact whatever the trial photons missed; the guide
changes its noise alone. Thanks to the guide photons from the surroundings find the opening of a cavity, photons of a
large floor find the few things that it lights, and photons of a sun find the scene.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.mesh import SAME_SURFACE
from ..geometry.point_tree import (
    WIDTH,
    PointTree,
    build_tree,
    empty_leaves,
    empty_walk,
    morton_order,
    open_node,
    start_walk,
)
from ..geometry.stage import reflectance_at, stored_at
from ..physics.radiometry import NONE
from ..system.kernels import KERNEL, njit
from .wave import arrive, has_arrived, stored_share

DIMENSIONS = 5
CELLS = 1024
_EVENLY = 0.5  # share of the density that is spread evenly: so no weight is above 2, however wrong the guide
_LEAST = 64  # samples that a cell needs to be cut
_PRIOR = 16.0  # samples that the whole cell counts as in the estimate of each half
_GAIN = 1e-3  # least share of the sum over all cells (see _cut) that a cut must save


class Guide(NamedTuple):
    """Cells of the cube, n of them, in the order of their emitters.

    low, size: (n, 5) float64, lower corner and edges. cumulative: (n + 1,) float64, cumulative probability. density:
    (n,) float64, probability over volume.
    """

    low: np.ndarray
    size: np.ndarray
    cumulative: np.ndarray
    density: np.ndarray


def even_guide() -> Guide:
    """One cell: every emission in proportion to its power."""
    return Guide(np.zeros((1, DIMENSIONS)), np.ones((1, DIMENSIONS)), np.array([0.0, 1.0]), np.ones(1))


def build_guide(samples: np.ndarray, score: np.ndarray, density: np.ndarray) -> tuple[Guide, float]:
    """Guide from trial emissions, and the factor, at least 1, by which it should lower the noise.

    samples: (n, 5) float64, the numbers that chose the emissions. score: (n,) float64, what the photon left where
    camera paths gather, weighted as in even sampling. density: (n,) float64, with which the numbers were drawn.
    """
    squares = score**2 / density
    low, size, mass = np.zeros((CELLS, DIMENSIONS)), np.ones((CELLS, DIMENSIONS)), np.zeros(CELLS)
    count = _cut(samples, squares, density, low, size, mass)
    low, size, mass = low[:count], size[:count], mass[:count]
    if mass.sum() <= 0:
        return even_guide(), 1.0
    volume = size.prod(axis=1)
    probability = (1.0 - _EVENLY) * mass / mass.sum() + _EVENLY * volume
    order = np.argsort(low[:, 0], kind="stable")
    low, size, probability, volume = low[order], size[order], probability[order], volume[order]
    cumulative = np.concatenate(([0.0], np.cumsum(probability)))
    gain = math.sqrt(np.mean(squares)) / mass.sum()
    return Guide(low, size, cumulative / cumulative[-1], probability / cumulative[-1] / volume), gain


@njit(cache=True, nogil=True)
def _cut(samples, squares, density, low, size, mass):
    """Cut cells in halves where a cut lowers the sum over cells of volume times root mean square of the score.

    The sum is the standard deviation that is left when every cell is sampled in proportion to its part of the sum.
    Returns the number of cells.
    """
    n = squares.size
    order = np.arange(n)
    first, last = np.zeros(CELLS, np.int64), np.zeros(CELLS, np.int64)
    mean = np.empty(CELLS)  # of squares over the cell
    last[0], mean[0], mass[0] = n, squares.mean(), math.sqrt(squares.mean())
    total = mass[0]
    count, cell = 1, 0
    sums, volumes = np.empty(2), np.empty(2)
    while cell < count:  # a cut leaves the lower half under the number of the whole cell, and that half is tried next
        best, best_mass, best_mean = -1, 0.0, (0.0, 0.0)
        lowest = mass[cell] - _GAIN * total
        volume = 1.0
        for d in range(DIMENSIONS):
            volume *= size[cell, d]
        if count < CELLS and last[cell] - first[cell] >= _LEAST:
            for d in range(DIMENSIONS):
                middle = low[cell, d] + 0.5 * size[cell, d]
                sums[:] = 0.0
                volumes[:] = 0.0
                for i in range(first[cell], last[cell]):
                    half = 1 if samples[order[i], d] >= middle else 0
                    sums[half] += squares[order[i]]
                    volumes[half] += 1.0 / density[order[i]]
                prior = _PRIOR * (volumes[0] + volumes[1]) / (last[cell] - first[cell])
                means = (
                    (sums[0] + prior * mean[cell]) / (volumes[0] + prior),
                    (sums[1] + prior * mean[cell]) / (volumes[1] + prior),
                )
                together = 0.5 * volume * (math.sqrt(means[0]) + math.sqrt(means[1]))
                if together < lowest:
                    best, lowest, best_mass, best_mean = d, together, together, means
        if best < 0:
            cell += 1
            continue
        middle = low[cell, best] + 0.5 * size[cell, best]
        i, j = first[cell], last[cell] - 1
        while i <= j:
            if samples[order[i], best] < middle:
                i += 1
            else:
                order[i], order[j] = order[j], order[i]
                j -= 1
        total += best_mass - mass[cell]
        size[cell, best] *= 0.5
        low[count], size[count] = low[cell], size[cell]
        low[count, best] = middle
        first[count], last[count], last[cell] = i, last[cell], i
        mean[cell], mean[count] = best_mean
        mass[cell], mass[count] = 0.5 * volume * math.sqrt(mean[cell]), 0.5 * volume * math.sqrt(mean[count])
        count += 1
    return count


class GatherTree(NamedTuple):
    """Points where camera paths gather: a tree, whose leaves hold positions and normals. radius2: m2."""

    tree: PointTree
    radius2: float


def build_gather_tree(point: np.ndarray, normal: np.ndarray, radius2: float) -> GatherTree:
    """The GatherTree of points. point, normal: (r, 3) float64, m. radius2: m2, squared distance from a point up to
    which photons count."""
    points = point.astype(np.float32)
    order, to = morton_order(points), np.arange(len(points))
    leaves = empty_leaves(len(points), 6)
    leaves[to // WIDTH, :3, to % WIDTH] = points[order]
    leaves[to // WIDTH, 3:, to % WIDTH] = normal[order]
    return GatherTree(build_tree(leaves), radius2)


def add_scores(gather_tree: GatherTree, stage, hits, wave, score: np.ndarray) -> None:
    """Add to score (n,) what the photons of a wave contribute to the noise of the image where they arrive.

    The contribution is the reflected power times the square root of the number of gathers around: each of these gathers
    adds the square of that power to the variance.
    """
    _add_scores(gather_tree, stage, hits, wave, score, empty_walk())


@njit(**KERNEL)
def _add_scores(gather_tree, stage, hits, wave, score, walk):
    for i in range(hits.triangle.size):
        if not has_arrived(wave, i, hits.triangle[i]):
            continue
        at = arrive(stage.surfaces, hits, i, wave)
        if stored_at(stage, at) == NONE:
            continue
        rho, power = reflectance_at(stage, at), 0.0
        for b in range(rho.size):
            power += abs(wave.power[i, b]) * rho[b]
        score[wave.photon[i]] += stored_share(wave, i, at) * power * math.sqrt(_count(gather_tree, at, walk))


@njit(inline="always")
def _count(gather_tree, at, walk):
    """Number of gathers around an Interaction that face the same way."""
    tree, bound = gather_tree.tree, np.float32(gather_tree.radius2)
    x, y, z = np.float32(at.point[0]), np.float32(at.point[1]), np.float32(at.point[2])
    nx, ny, nz = np.float32(at.normal[0]), np.float32(at.normal[1]), np.float32(at.normal[2])
    count = 0
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, (x, y, z), bound)
        for c in range(children):
            p = tree.leaves[walk.stack[depth + c]]
            for j in range(WIDTH):
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                cosine = p[3, j] * nx + p[4, j] * ny + p[5, j] * nz
                inside = dx * dx + dy * dy + dz * dz < bound
                count += 1 if inside & (cosine > np.float32(SAME_SURFACE)) else 0
    return count
