# SPDX-License-Identifier: GPL-3.0-or-later
"""Splitting: how many rays a gather of a camera path sends, and at which of their ends roulette stops.

Variance and time can be foreseen. The best choice makes the product of variance and time least. There, a further ray
saves the same variance everywhere in the image: the variance of the image over its time, called the price of a ray
(Rath et al. 2022 split paths by this rule). So a gather sends more rays where the contributions of these rays differ
more.
"""

import math
from typing import NamedTuple

import numpy as np

from ..image.tiles import TILE
from ..sampling.heuristics import Looking
from ..sampling.low_discrepancy import LATTICES
from ..sampling.rng import PILOT, PRICED_CELLS, PRICED_PIXELS, pass_key, strata
from ..system.kernels import KERNEL, njit
from .antialiasing import FEWEST, choose_samples, edge_variance, least_price
from .sheets import FALL, Sheets
from .survey import Cells, Survey

# Times, in units of the time of one ray of a final gather (tests/benchmarks/throughput.py)
_CAMERA = 0.75  # of a camera ray
_FIXED = 4.0  # of a pixel, however many rays it sends
_PHOTON = 2.0  # of a photon, traced and sorted, and its share of the cache
_RECALL = 1.6  # of recalling irradiance; more than measured, as neighbouring pixels share the noise of its roulette
_FEWEST, _MOST = min(LATTICES), max(LATTICES)  # rays of a final gather
_SHARING = 0.25  # area of the disk in which final gathers share rays, over the area of the photons' disk
_ALONE = 0.25  # distance below which what a ray meets is not shared, over that harmonic mean distance
NEAR = 0.05  # largest radius of that disk, over the harmonic mean distance to what the rays meet: about 5 % of change
# n final gathers in the disk, with weights w = 1 - r^2 / R^2, are worth _EQUAL n of equal weight: the ratio is
# (sum of w)^2 / (n sum of w^2).
_EQUAL = 0.75
_EQUAL_MOST = 28.0  # final gathers of equal weight that those in the window of pixels are worth, at most
_UNKNOWN = 64.0  # rays of a final gather that are assumed where the survey found no gathers at all
_LEAST_CHANCE = 1.0 / 8.0  # of roulette, as the mean radiance of a sheet does not tell the radiance at each point
_PIXELS, _CELLS = 4096, 1 << 16  # pixels and cells, at most, on which prices are tried
_USUAL = 0.95  # share of the gathers that count in _usual
_PRICES = np.geomspace(1e-4, 1e1, 31)  # that are tried, over the price if all gathers asked photons


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
    return Spread(1.0, splitting.sheets.ray_noise[sheet], 0.0, 0.0)


@njit(inline="always")
def spread_in(cells, cell):
    """The Spread of one cell."""
    return Spread(cells.brightness[cell], cells.ray_noise[cell], cells.closeness[cell], cells.density[cell])


@njit(inline="always")
def rays_alone(splitting, sheet, spread, contribution, reach2, k, shrink2):
    """Number of rays that a gather should send, a power of two, and the variance.

    spread: around the gather. contribution: see Gathers. reach2, k, shrink2: see Estimate.
    """
    noise = contribution * contribution * ray_variance(splitting.sheets, sheet, spread, reach2, k, shrink2)
    best = (FALL * noise / splitting.price) ** (1.0 / (1.0 + FALL))
    rays = 1 << int(math.log2(min(max(best, float(_FEWEST)), float(_MOST))) + 0.5)
    return rays, noise * rays**-FALL


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
    gather that shares, times n^FALL."""
    return sheets.evenness * spread.ray_noise / max(1.0, sharing(sheets, sheet, spread, reach2, k, shrink2))


@njit(inline="always")
def recall_chance(splitting, sheet, throughput):
    """Chance with which a final ray's end on a sheet recalls irradiance. throughput: after the reflection there."""
    return _chance(splitting, sheet, throughput, _RECALL)


@njit(inline="always")
def _chance(splitting, sheet, throughput, time):
    """Best chance q of roulette: on a contribution y it adds variance y^2 (1 / q - 1) and saves 1 - q of the time."""
    sheets = splitting.sheets
    # mean square of the radiance from photons
    square = sheets.reflected[sheet] ** 2 + sheets.photon_noise[sheet] / sheets.disk[sheet]
    return min(1.0, max(_LEAST_CHANCE, throughput * math.sqrt(square / (time * splitting.price))))


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
    noise, _ = noise_and_time(usual, pixels, reach2, neighbours)
    tried = []
    for price in max(noise + rest, 1e-300) / (fixed + _CAMERA * FEWEST) * _PRICES:
        noise, time = noise_and_time(usual._replace(price=price), pixels, reach2, neighbours)
        samples = choose_samples(variance, unknown, max(price, least))
        noise += float(edge_variance(variance, samples).mean()) + rest
        tried.append((noise * (fixed + time + _CAMERA * samples.mean()), price))
    return splitting._replace(price=min(tried)[1])


def plan_looking(splitting: Splitting, reach2: float, neighbours: int) -> Looking:
    """The Looking from each sheet, (labels,) float32 each: means over the gathers on it. near is a share of the
    harmonic mean distance to what their rays meet."""
    cells, labels = splitting.cells, len(splitting.sheets.density)
    sheet = cells.key % labels
    rays, _ = _in_cells(splitting, reach2, neighbours)
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
    rays, variance = _in_cells(splitting, reach2, neighbours)
    count = splitting.cells.count
    return float(np.sum(count * variance)) / pixels, float(np.sum(count * rays)) / pixels


def most_rays(splitting: Splitting, samples: np.ndarray, unknown: np.ndarray, reach2: float, neighbours: int) -> float:
    """Mean number of rays of a pixel, camera rays and rays of final gathers, in the blocks that send most, as many
    blocks as cover a tile. samples: (p,) camera rays. unknown: (p,) bool, pixels that may show surfaces that are in no
    cell; a gather on these is assumed to send as many rays as gathers do on average."""
    rays, _ = _in_cells(splitting, reach2, neighbours)
    pixels, cells = np.bincount(splitting.block), splitting.cells
    sent = np.bincount(splitting.block, samples, len(pixels))
    sent += np.bincount(cells.key // len(splitting.sheets.density), cells.count * rays, len(pixels))
    typical = np.average(rays, weights=cells.count) if len(rays) else _UNKNOWN
    sent += np.bincount(splitting.block, unknown * typical, len(pixels))
    order = np.argsort(-sent / np.maximum(pixels, 1))
    most = order[: np.searchsorted(np.cumsum(pixels[order]), TILE * TILE) + 1]
    return float(sent[most].sum() / pixels[most].sum())


def _in_cells(splitting, reach2, k):
    """Rays (c,) of a gather in each cell, and the variance (c,)."""
    rays, variance = np.zeros((2, len(splitting.cells.key)))
    _choose_in_cells(splitting, reach2, k, rays, variance)
    return rays, variance


@njit(**KERNEL)
def _choose_in_cells(splitting, reach2, k, rays, variance):
    cells, labels = splitting.cells, splitting.sheets.density.size
    for cell in range(rays.size):
        sheet, contribution = cells.key[cell] % labels, math.sqrt(cells.contribution2[cell])
        spread = spread_in(cells, cell)
        rays[cell], variance[cell] = rays_alone(splitting, sheet, spread, contribution, reach2, k, 1.0)
