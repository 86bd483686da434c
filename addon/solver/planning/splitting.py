# SPDX-License-Identifier: GPL-3.0-or-later
"""Splitting: with which chance roulette keeps a gather of a camera path, how many rays it sends, and at which of their
ends roulette stops.

Variance and time can be foreseen. The best choice makes the product of variance and time least. There, a further ray
saves the same variance everywhere in the image: the variance of the image over its time, called the price of a ray
(Rath et al. 2022 split paths by this rule). So a gather sends more rays where the contributions of these rays differ
more, and is kept less often where it contributes little.
"""

import math
from typing import NamedTuple

import numpy as np

from ..image.tiles import TILE
from ..sampling.heuristics import Looking
from ..sampling.low_discrepancy import LATTICES
from ..sampling.rng import PILOT, PRICED_CELLS, PRICED_PIXELS, pass_key, strata
from ..system.kernels import KERNEL, njit
from .antialiasing import FEWEST, camera_variance, choose_samples, least_price
from .sheets import Sheets
from .survey import Cells, Survey

# Times, in units of the time of one ray of a final gather (tests/benchmarks/throughput.py)
_CAMERA = 0.75  # of a camera ray
_FIXED = 8.0  # of a pixel, however many rays it sends
_GATHER = 12.0  # of a gather, however many rays it sends
_END = 4.0  # of a gather at the end of a ray, for shadow rays alone
_PHOTON = 3.0  # of a photon, traced and sorted, and its share of the cache
_RECALL = 1.6  # of recalling irradiance; more than measured, as neighbouring pixels share the noise of its roulette
_FEWEST, _MOST = min(LATTICES), max(LATTICES)  # rays of a final gather
# Rays that a gather over _LITTLE sends at least: the survey does not see light that comes by way of specular surfaces.
# Gathers with fewer share none: so few do not tell how near surfaces are, which limits sharing.
FEWEST_SHARED = 8
_SHARING = 0.25  # area of the disk in which final gathers share rays, over the area of the photons' disk
_ALONE = 0.25  # distance below which what a ray meets is not shared, over that harmonic mean distance
NEAR = 0.05  # largest radius of that disk, over the harmonic mean distance to what the rays meet: about 5 % of change
# n final gathers in the disk, with weights w = 1 - r^2 / R^2, are worth _EQUAL n of equal weight: the ratio is
# (sum of w)^2 / (n sum of w^2).
_EQUAL = 0.75
_EQUAL_MOST = 28.0  # final gathers of equal weight that those in the window of pixels are worth, at most
_PASSES = 32.0  # after which the price weighs the variance from edges, which falls faster than all other: the default
_UNKNOWN = 64.0  # rays of a final gather that are assumed where the survey found no gathers at all
_LEAST_CHANCE = 1.0 / 8.0  # of recalling, as the mean radiance of a sheet does not tell the radiance at each point
_LITTLE = 1.0 / 32.0  # share of a pixel over which a gather is always kept, as sheets do not tell where caustics lie
_PIXELS, _CELLS = 4096, 1 << 16  # pixels and cells, at most, on which prices are tried
_USUAL = 0.95  # share of the gathers that count in _usual
_PRICES = np.geomspace(1e-6, 1.0, 37)  # that are tried, over the price with as few rays as possible


class Splitting(NamedTuple):
    """All that the number of rays rests on.

    sheets: see Sheets. cells: see Cells. block (p,) int32, sensitivity (p,) float64: by pixel, see Survey. price: W2
    sr-2 m-4, variance times squared sensitivity that a ray should save.
    """

    sheets: Sheets
    cells: Cells
    block: np.ndarray
    sensitivity: np.ndarray
    price: float


class Spread(NamedTuple):
    """Expected radiance that rays from one point meet, and density of the gathers that share these rays: see Cells."""

    brightness: float
    ray_noise: float
    met: float
    closeness: float
    density: float


@njit(inline="always")
def spread_around(splitting, pixel, sheet):
    """The Spread of a gather on a sheet that a pixel of the window shows. Where no sample of the survey in the pixel's
    block met the sheet (as it is small, or seen in many mirrors), it is that of the whole sheet, and rays are not
    shared."""
    key = splitting.block[pixel] * np.int64(splitting.sheets.density.size) + sheet
    keys = splitting.cells.key
    low, high = 0, keys.size
    while low < high:
        middle = (low + high) >> 1
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    if low < keys.size and keys[low] == key:
        return spread_in(splitting.cells, low)
    return Spread(1.0, splitting.sheets.ray_noise[sheet], splitting.sheets.met[sheet], 0.0, 0.0)


@njit(inline="always")
def spread_in(cells, cell):
    """The Spread of one cell."""
    return Spread(
        cells.brightness[cell], cells.ray_noise[cell], cells.met[cell], cells.closeness[cell], cells.density[cell]
    )


@njit(inline="always")
def choose_rays(splitting, sheet, spread, brings, reach2, k, shrink2):
    """Number of rays that a gather should send, a power of two, the chance with which roulette should keep it, and the
    variance: of all choices that for which the variance, and the time at its price, are least.

    spread: around the gather. brings: its contribution, see Gathers, and the same with what all lobes reflect. reach2,
    k, shrink2: see Estimate.
    """
    sheets, price, (contribution, whole) = splitting.sheets, splitting.price, brings
    light2 = whole * whole * (_recalled2(sheets, sheet) + spread.met * spread.met)
    noise = contribution * contribution * sheets.evenness * spread.ray_noise
    shared = contribution * contribution * ray_variance(sheets, sheet, spread, reach2, k, shrink2)
    rays, surely = _FEWEST, whole / _LITTLE
    while rays < FEWEST_SHARED * min(surely, 1.0):
        rays *= 2
    best, least = (rays, 1.0, noise * rays**-sheets.fall), math.inf
    while rays <= _MOST:
        left = (noise if rays < FEWEST_SHARED else shared) * rays**-sheets.fall
        chance = _chance(left + light2, _GATHER + rays, price, surely)
        variance = left / chance + light2 * (1.0 / chance - 1.0)
        cost = variance + price * chance * (_GATHER + rays)
        if cost < least:
            best, least = (rays, chance, variance), cost
        elif rays >= FEWEST_SHARED:
            break
        rays *= 2
    return best


@njit(inline="always")
def disk_area(sheets, sheet, spread, reach2, k, shrink2):
    """Area (m2) of a gather's disk: it holds k photons, or fills the free space of this squared radius (m2); shrunk."""
    area, density = min(math.pi * reach2, sheets.span[sheet]), spread.brightness * sheets.density[sheet]
    if density * area > k:
        area = k / density
    return max(area * shrink2, 1e-30)


@njit(inline="always")
def shared_area(sheets, sheet, spread, reach2, k, shrink2):
    """Area (m2) of the disk in which final gathers share rays, before surfaces close by limit it (see NEAR)."""
    return _SHARING * disk_area(sheets, sheet, spread, reach2, k, shrink2)


@njit(inline="always")
def sharing(sheets, sheet, spread, reach2, k, shrink2):
    """How many final gathers of equal weight share rays in the disk around one of them; below 1, none share."""
    near = NEAR / max(spread.closeness, 1e-30)
    area = min(shared_area(sheets, sheet, spread, reach2, k, shrink2), math.pi * near * near * shrink2)
    return min(_EQUAL_MOST, _EQUAL * spread.density * area)


@njit(inline="always")
def ray_variance(sheets, sheet, spread, reach2, k, shrink2):
    """Variance (W2 sr-2 m-4) of the radiance that a perfect reflector reflects, estimated from n rays of each final
    gather that shares, times n^fall."""
    return sheets.evenness * spread.ray_noise / max(1.0, sharing(sheets, sheet, spread, reach2, k, shrink2))


@njit(inline="always")
def recall_chance(splitting, sheet, throughput):
    """Chance with which a final ray's end on a sheet recalls irradiance. throughput: after the reflection there."""
    return _chance(
        throughput * throughput * _recalled2(splitting.sheets, sheet), _RECALL, splitting.price, _LEAST_CHANCE
    )


@njit(inline="always")
def end_chance(splitting, sheet, throughput):
    """Chance with which the end of a final ray on a sheet keeps a gather, for shadow rays alone. throughput: after the
    reflection there."""
    light2 = _recalled2(splitting.sheets, sheet) + splitting.sheets.met[sheet] ** 2
    return _chance(throughput * throughput * light2, _END, splitting.price, throughput / _LITTLE)


@njit(inline="always")
def _recalled2(sheets, sheet):
    """Mean square (W2 sr-2 m-4) of the radiance that a perfect reflector reflects from photons."""
    return sheets.reflected[sheet] ** 2 + sheets.photon_noise[sheet] / sheets.disk[sheet]


@njit(inline="always")
def _chance(square, time, price, least):
    """Best chance q of roulette on a contribution with this mean square: it adds a variance of the square times 1 / q -
    1, and saves 1 - q of the time. Never 0, as one divides by it."""
    return min(1.0, max(least, math.sqrt(square / (time * price)), 1e-30))


def plan_splitting(sheets: Sheets, survey: Survey, reach2: float, neighbours: int, photons: int) -> Splitting:
    """The Splitting with the price at which variance times time is least. For the arguments see measure_sheets."""
    splitting = Splitting(sheets, survey.cells, survey.block, survey.sensitivity, math.inf)
    pixels = len(survey.block)
    some = strata(pass_key(0, PRICED_PIXELS, PILOT), min(_PIXELS, pixels), pixels)
    variance, unknown = survey.variance[some], survey.unknown[some]
    least = least_price(variance, survey.in_fog)
    rest = _usual(survey.cells.contribution2 * survey.cells.rest, survey.cells.count) / pixels
    fixed = _FIXED + _PHOTON * photons / pixels
    usual, pixels = _fewer_cells(splitting, pixels)
    noise, time = noise_and_time(usual, pixels, reach2, neighbours)
    tried = []
    noise += float(camera_variance(variance, np.full(len(variance), FEWEST), survey.in_fog, _PASSES).mean()) + rest
    for price in max(noise, 1e-300) / (fixed + time + _CAMERA * FEWEST) * _PRICES:
        noise, time = noise_and_time(usual._replace(price=price), pixels, reach2, neighbours)
        samples = choose_samples(variance, unknown, max(price, least), survey.in_fog)
        noise += float(camera_variance(variance, samples, survey.in_fog, _PASSES).mean()) + rest
        tried.append((noise * (fixed + time + _CAMERA * samples.mean()), price))
    return splitting._replace(price=min(tried)[1])


def plan_looking(splitting: Splitting, reach2: float, neighbours: int) -> Looking:
    """The Looking from each sheet, (labels,) float32 each: means over the gathers on it. near is a share of the
    harmonic mean distance to what their rays meet."""
    cells, labels = splitting.cells, len(splitting.sheets.density)
    sheet = cells.key % labels
    rays, *_ = _in_cells(splitting, reach2, neighbours)
    sharing = np.zeros(len(rays))
    _share_in_cells(splitting, reach2, neighbours, sharing)
    count = np.maximum(np.bincount(sheet, cells.count, labels), 1e-30)
    closeness, alone, together = (
        np.bincount(sheet, cells.count * of, labels) / count for of in (cells.closeness, rays, rays * sharing)
    )
    near = _ALONE / np.maximum(closeness, 1e-30)
    return Looking(*(of.astype(np.float32) for of in (near, np.maximum(alone, _FEWEST), np.maximum(together, _FEWEST))))


@njit(**KERNEL)
def _share_in_cells(splitting, reach2, k, shared):
    cells, labels = splitting.cells, splitting.sheets.density.size
    for cell in range(shared.size):
        sheet, spread = cells.key[cell] % labels, spread_in(cells, cell)
        shared[cell] = max(1.0, sharing(splitting.sheets, sheet, spread, reach2, k, 1.0))


def _fewer_cells(splitting: Splitting, pixels: int) -> tuple[Splitting, float]:
    """The splitting with at most _CELLS of its cells, and the number of pixels that would have so many."""
    cells = splitting.cells
    if len(cells.key) <= _CELLS:
        return splitting, pixels
    some = strata(pass_key(0, PRICED_CELLS, PILOT), _CELLS, len(cells.key))
    return splitting._replace(cells=Cells(*(column[some] for column in cells))), pixels * _CELLS / len(cells.key)


def _usual(value: np.ndarray, count: np.ndarray) -> float:
    """Sum of values (c,), each counted so many times, without the largest: their sheets got too few photons."""
    order = np.argsort(value)
    value, count = value[order], count[order]
    kept = np.clip(_USUAL * count.sum() - (np.cumsum(count) - count), 0.0, count)
    return float(np.sum(value * kept))


def noise_and_time(splitting: Splitting, pixels: float, reach2: float, neighbours: int) -> tuple[float, float]:
    """Mean over the pixels of the variance and of the time of their gathers, without walls around."""
    rays, chance, variance = _in_cells(splitting, reach2, neighbours)
    count = splitting.cells.count
    return float(np.sum(count * variance)) / pixels, float(np.sum(count * chance * (_GATHER + rays))) / pixels


def most_rays(splitting: Splitting, samples: np.ndarray, unknown: np.ndarray, reach2: float, neighbours: int) -> float:
    """Mean number of rays of a pixel, camera rays and rays of final gathers, in the blocks that send most, as many
    blocks as cover a tile. samples: (p,) camera rays. unknown: (p,) bool, pixels that may show surfaces that are in no
    cell; a gather on these is assumed to send as many rays as gathers do on average."""
    rays, chance, _ = _in_cells(splitting, reach2, neighbours)
    rays = rays * chance
    pixels, cells = np.bincount(splitting.block), splitting.cells
    sent = np.bincount(splitting.block, samples, len(pixels))
    sent += np.bincount(cells.key // len(splitting.sheets.density), cells.count * rays, len(pixels))
    typical = np.average(rays, weights=cells.count) if len(rays) else _UNKNOWN
    sent += np.bincount(splitting.block, unknown * typical, len(pixels))
    order = np.argsort(-sent / np.maximum(pixels, 1))
    most = order[: np.searchsorted(np.cumsum(pixels[order]), TILE * TILE) + 1]
    return float(sent[most].sum() / pixels[most].sum())


def _in_cells(splitting, reach2, k):
    """Rays (c,) of a gather in each cell, its chance (c,), and the variance (c,)."""
    chosen = np.zeros((3, len(splitting.cells.key)))
    _choose_in_cells(splitting, reach2, k, chosen)
    return chosen


@njit(**KERNEL)
def _choose_in_cells(splitting, reach2, k, chosen):
    cells, labels = splitting.cells, splitting.sheets.density.size
    for cell in range(cells.key.size):
        sheet, contribution = cells.key[cell] % labels, math.sqrt(cells.contribution2[cell])
        brings, spread = (contribution, contribution), spread_in(cells, cell)
        rays, chance, variance = choose_rays(splitting, sheet, spread, brings, reach2, k, 1.0)
        chosen[0, cell], chosen[1, cell], chosen[2, cell] = rays, chance, variance
