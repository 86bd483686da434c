# SPDX-License-Identifier: GPL-3.0-or-later
"""The rays of camera paths, and what one bounce of these rays meets."""

from typing import NamedTuple

import numpy as np

from ..geometry.segments import FROM_CAMERA, Hits
from ..physics.lobes import is_glossy, is_wide
from ..planning.antialiasing import MOST
from ..planning.splitting import Splitting
from ..sampling.heuristics import ALONE
from ..sampling.rng import path_key
from ..system.kernels import FAST_INLINED, INLINED, KERNEL, njit

BLIND, ASTRAY = np.float32(2e30), np.float32(3e30)  # see Rays.density


class Estimate(NamedTuple):
    """Choices of the radiance estimate in one pass.

    neighbours: k. few: k where photons of caustics alone count. reach2: m2, squared radius of the largest disk.
    shrink2: factor on the squared radius in this pass. photons: whether passes emit photons (a pass may still store
    none). straight: whether rough lobes need photons straight from lights. splitting: what decides between photons and
    rays. layers: number of layers of the image (see layers).
    """

    neighbours: int
    few: int
    reach2: float
    shrink2: float
    photons: bool
    straight: bool
    splitting: Splitting
    layers: int = 1


class Rays(NamedTuple):
    """n rays of camera paths, the rays of a pixel one behind the other.

    origin, direction: (n, 3) float32. throughput: (n, b) float32. pixel: (n,) int32, row of the image to which the ray
    adds. path: (n,) uint64, key of the random numbers. final: (n,) bool, whether the ray belongs to a final gather.
    continued: (n,) bool, whether it continues such a ray from its end (see recall). density: (n,) float32, sr-1, how
    many rays look in its direction, if shadow rays could find what it meets, too; ALONE where they cannot, and BLIND
    where photons find the light of the lamps that throw caustics. After media have scattered it, until it is reflected
    diffusely, photons are no part of a caustic: negative where shadow rays could find what it meets, else ASTRAY.
    doubts: (n,) bool, whether the ray goes on from its end though the cache resolves the light there, see onward.doubt.
    steady: (n,) bool, whether nothing but the place in the pixel and in the lens decides what the ray meets, and with
    which throughput: it comes from the camera by way of mirrors and thin sheets alone, and roulette played nowhere.
    kind: (n,) uint8, see Tracer.seen_from. passed: (n,) float32, length of the way, in units of the direction's length,
    that the ray had come before it passed the thin sheet at its origin; (0,) in a scene without thin sheets.
    """

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    pixel: np.ndarray
    path: np.ndarray
    final: np.ndarray
    continued: np.ndarray
    density: np.ndarray
    doubts: np.ndarray
    steady: np.ndarray
    kind: np.ndarray
    passed: np.ndarray


def empty_rays(count: int, bands: int, passes: bool = False) -> Rays:
    """Room for count rays. passes: whether light passes through any surface."""
    return Rays(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint64),
        np.empty(count, np.bool_),
        np.empty(count, np.bool_),
        np.empty(count, np.float32),
        np.zeros(count, np.bool_),
        np.zeros(count, np.bool_),
        np.empty(count, np.uint8),
        np.zeros(count if passes else 0, np.float32),
    )


def join(onward: Rays, count: int, more: Rays) -> tuple[Rays, int]:
    """The first `count` rays of onward, and behind them more of them; and how many there are."""
    rays = (np.concatenate((column[:count], added)) for column, added in zip(onward, more, strict=True))
    return Rays(*rays), count + len(more.pixel)


@njit(**KERNEL)
def start_paths(key, samples, pixels, steady, rays):
    """Fill in pixel, key and throughput of camera rays; each has an even share of its pixel. steady: see Rays."""
    row = 0
    rays.kind[:], rays.steady[:] = FROM_CAMERA, steady
    for i in range(pixels.size):
        for sample in range(samples[i]):
            rays.pixel[row], rays.final[row], rays.continued[row] = i, False, False
            rays.density[row] = ALONE
            rays.path[row] = path_key(key, MOST * pixels[i] + sample)
            rays.throughput[row, :] = np.float32(1.0) / samples[i]
            row += 1


class Bounce(NamedTuple):
    """One bounce of n rays. number: from 0. hits: of the rays.

    unresolved: (n,) bool, set for rays of final gathers at whose end the cache does not resolve the light (see recall).
    goes_on: (n,) float32, for those of them that roulette continues the factor on their throughput, else 0.
    """

    number: int
    rays: Rays
    hits: Hits
    unresolved: np.ndarray
    goes_on: np.ndarray


class Rows(NamedTuple):
    """What rays add to: the pixels of a tile, followed by a row for each final gather.

    image: (rows, layers * b) float32, W m-2 sr-1. near: (rows,) float32, m, and apart: (rows,) int32: what a ray of a
    final gather meets nearer than about this adds to the row that lies so many rows further, and is not shared. fewer:
    (rows,) float32, factor on the density of rays for that, see Looking. closeness: (rows,) float64, 1 / m, sum of the
    inverse distances to what the rays of a final gather meet.
    """

    image: np.ndarray
    near: np.ndarray
    apart: np.ndarray
    fewer: np.ndarray
    closeness: np.ndarray


def empty_rows(image: np.ndarray) -> Rows:
    """Rows with this image, none of which is of a final gather."""
    count = len(image)
    return Rows(
        image, np.zeros(count, np.float32), np.zeros(count, np.int32), np.zeros(count, np.float32), np.zeros(count)
    )


@njit(**INLINED)
def is_astray(rays, i):
    """Whether media have scattered the path of ray i, and no surface has reflected it diffusely since: see
    Rays.density."""
    return rays.density[i] == ASTRAY or rays.density[i] < 0.0


@njit(**INLINED)
def shares_by_lobe(lobes, final):
    """Whether a ray in a rough lobe shares what it finds with a shadow ray: from visible points always, from what rays
    of a final gather meet if the lobe is wide. What narrow lobes throw about, photons of caustics find."""
    return is_wide(lobes) or (is_glossy(lobes) and not final)


@njit(**FAST_INLINED)
def largest_throughput(throughput, rho):
    """Largest throughput of any band after a reflection. throughput: (b,) before. rho: (b,) reflectance."""
    largest = np.float32(0.0)
    for b in range(rho.size):
        largest = max(largest, throughput[b] * rho[b])
    return float(largest)
