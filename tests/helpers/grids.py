# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids of random cells, rays through them, and which cells these cross."""

import numpy as np

from addon.solver import Grid
from addon.solver.geometry.media import Atmosphere
from addon.solver.geometry.segments import Tracer, transmit, traverse
from addon.solver.physics.heat import build_heat_table
from addon.solver.physics.media import build_medium_table
from addon.solver.physics.molecules import Draws
from addon.solver.physics.radiometry import reference_radiance
from addon.solver.system.kernels import KERNEL, njit


def placed(low, high, cells):
    """(4, 4) from the index space of so many cells on each axis to the world, where they fill a box."""
    matrix = np.diag([*np.subtract(high, low) / np.array(cells), 1.0])
    matrix[:3, 3] = low
    return matrix


def turned(seed):
    """A (4, 4) matrix that turns, stretches unevenly, shears, mirrors and moves."""
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shear = np.eye(3) + np.triu(rng.uniform(-0.4, 0.4, (3, 3)), 1)
    matrix[:3, :3] = turn @ shear @ np.diag([0.11, -0.06, 0.17])
    matrix[:3, 3] = rng.uniform(-1, 1, 3)
    return matrix


def random_grid(seed, reach=3, filled=0.4):
    """Leaves at random, some without neighbours, with empty cells in them."""
    rng = np.random.default_rng(seed)
    places = np.array(np.meshgrid(*3 * [np.arange(-reach, reach)], indexing="ij")).reshape(3, -1).T
    leaves = places[rng.uniform(size=len(places)) < filled].astype(np.int32)
    shape = len(leaves), 8, 8, 8
    density = rng.exponential(1.0, shape) * (rng.uniform(size=shape) < 0.7)
    return Grid(leaves, turned(seed), density.astype(np.float32), rng.uniform(250, 900, shape).astype(np.float32))


def cells_on_ray(grid, origin, direction, limit):
    """Distances of all planes between cells on a ray, and a function that tells density and temperature at others."""
    inverse = np.linalg.inv(grid.matrix)
    o, d = inverse[:3, :3] @ origin + inverse[:3, 3], inverse[:3, :3] @ direction
    leaves = {tuple(leaf): number for number, leaf in enumerate(grid.leaves)}
    planes = [(np.arange(-400, 401) - o[axis]) / d[axis] for axis in range(3)]
    planes = np.concatenate(planes)

    def at(t):
        cell = np.floor(o + t * d).astype(int)
        leaf = leaves.get(tuple(cell // 8))
        if leaf is None:
            return 0.0, 300.0
        return tuple(float(values[leaf, *(cell % 8)]) for values in (grid.density, grid.temperature))

    return planes[(planes > 0) & (planes < limit)], at


@njit(**KERNEL)
def traverse_all(air, throughput, radiance):
    """traverse of every segment; throughput, radiance: (n, b)."""
    for i in range(air.length.size):
        traverse(air, i, throughput[i], radiance[i])


@njit(**KERNEL)
def transmit_all(air, power):
    """transmit of every segment; power: (n, b)."""
    for i in range(air.length.size):
        transmit(air, i, power[i])


def atmosphere(media, edges, quiet, centre=(0.0, 0.0, 0.0)):
    """The Atmosphere of media, with surfaces far away."""
    away = Tracer(np.float32([[900, 900, 900], [900, 900, 901], [900, 901, 900]]), np.int32([[0, 1, 2]]))
    found, reference = Atmosphere(away, media, np.asarray(centre), 5.0), reference_radiance(edges, quiet)
    arguments = media, edges, quiet, reference
    found.fill(build_medium_table(*arguments), build_heat_table(*arguments))
    return found


def random_rays(count, seed=4):
    """Rays through the middle from inside and outside, some along an axis of the world, of any length of direction."""
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(count, 3)) * rng.choice([0.5, 5.0], (count, 1))
    direction = (rng.normal(size=(count, 3)) - origin) * rng.uniform(0.1, 10.0, (count, 1))
    axes = np.arange(0, count, 10)
    direction[axes] = np.sign(direction[axes]) * np.eye(3)[rng.integers(0, 3, len(axes))]
    origin[axes] = rng.normal(size=(len(axes), 3)) * 0.5
    return origin.astype(np.float32), direction.astype(np.float32)


def draws_of(sampler, index):
    """The Draws of one pass, of shape (b,)."""
    several = sampler.draw(np.array([index]))
    return Draws(several.wavenumber[0], several.g[:, 0])
