# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a camera path asks the photons around it, and where it sends rays of its own, and how many.

Both have a noise and a time that can be told beforehand. What lowers noise times time is best, and at that optimum a
further ray saves the same variance anywhere: the noise of the image over its time (Rath et al. 2022 split paths by this
rule). So rays go in number as the spread of what they contribute, and photons serve where they are better than those.
"""

import math
from typing import NamedTuple

import numpy as np

from ..image.tiles import TILE
from ..sampling.low_discrepancy import LATTICES
from ..sampling.rng import PILOT, PRICED_CELLS, PRICED_PIXELS, pass_key, strata
from ..system.kernels import KERNEL, njit
from .antialiasing import FEWEST, choose_samples, edge_variance, least_price
from .sheets import FALL, Sheets
from .survey import Cells, Survey

# Times, in that of one ray of a final gather (tests/benchmarks/throughput.py)
_GATHER = 6.0  # of k photons
_CAMERA = 0.75  # of a camera ray
_FIXED = 4.0  # of a pixel, whatever its rays
_PHOTON = 2.0  # traced, sorted, and its share of the cache
_RECALL = 1.6  # of what a ray's end reflects; more than it takes, as neighbours share what roulette adds to the noise
_FEWEST, _MOST = min(LATTICES), max(LATTICES)  # rays of a final gather
_SHARING = 0.25  # area of the disk in which final gathers share rays, over that of photons: they blur less
NEAR = 0.05  # radius of that disk, over the harmonic mean distance of what the rays meet: 5 % of change, about
_EQUAL = 0.75  # share of them that with equal weights would bring as much: (sum of w)^2 / sum of w^2, w = 1 - r^2 / R^2
_EQUAL_MOST = 28.0  # the number of those within the window of pixels
_UNKNOWN = 64.0  # rays of a final gather that are foreseen where the survey tells of none
_LEAST_CHANCE = 1.0 / 8.0  # of roulette: the mean of a sheet is not the light at each point
_PIXELS, _CELLS = 4096, 1 << 16  # whose rays are counted to find the best price, at most
_USUAL = 0.95  # share of the gathers by which is told what photons leave in the end
_PRICES = np.geomspace(1e-4, 1e1, 31)  # tried, over that of photons alone


class Splitting(NamedTuple):
    """What gathers are chosen by.

    sheets: see Sheets. cells: see Cells. block (p,) int32, sensitivity (p,) float64: by pixel, see Survey. price: W2
    sr-2 m-4, variance, times the square of the sensitivity, that a ray should save.
    """

    sheets: Sheets
    cells: Cells
    block: np.ndarray
    sensitivity: np.ndarray
    price: float


class Spread(NamedTuple):
    """What rays from one point would meet, and how many gathers there are to share them: see Cells."""

    brightness: float
    ray_noise: float
    closeness: float
    density: float


@njit(inline="always")
def spread_around(splitting, pixel, sheet):
    """The Spread of a gather on a sheet that a pixel of the window shows. On sheets that no sample of the survey around
    met (small, or seen by many mirrors) it is that of the whole sheet, and nobody shares."""
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
def rays_beside(splitting, sheet, spread, contribution, free2, k, shrink2):
    """Rays that a gather should send, a power of two, or 0 if photons are better; and the variance.

    spread: around it. contribution: see Gathers. free2: m2, squared radius of the free space around. k, shrink2: see
    Estimate.
    """
    area = disk_area(splitting.sheets, sheet, spread, free2, k, shrink2)
    by_photons = contribution * contribution * spread.brightness * splitting.sheets.photon_noise[sheet] / area
    rays, by_rays = rays_alone(splitting, sheet, spread, contribution, free2, k, shrink2)
    if by_photons + _GATHER * splitting.price > by_rays + rays * splitting.price:
        return rays, by_rays
    return 0, by_photons


@njit(inline="always")
def rays_alone(splitting, sheet, spread, contribution, free2, k, shrink2):
    """Rays that a gather should send where photons cannot serve, a power of two, and the variance. See rays_beside."""
    noise = contribution * contribution * ray_variance(splitting.sheets, sheet, spread, free2, k, shrink2)
    best = (FALL * noise / splitting.price) ** (1.0 / (1.0 + FALL))
    rays = 1 << int(math.log2(min(max(best, float(_FEWEST)), float(_MOST))) + 0.5)
    return rays, noise * rays**-FALL


@njit(inline="always")
def disk_area(sheets, sheet, spread, free2, k, shrink2):
    """Area (m2) of the disk of a gather: that of k photons, in free space of this squared radius (m2), shrunk."""
    area, density = min(math.pi * free2, sheets.span[sheet]), spread.brightness * sheets.density[sheet]
    if density * area > k:
        area = k / density
    return max(area * shrink2, 1e-30)


@njit(inline="always")
def shared_area(sheets, sheet, spread, free2, k, shrink2):
    """Area (m2) of the disk in which final gathers share rays, but for what is closer to them (see NEAR)."""
    return _SHARING * disk_area(sheets, sheet, spread, free2, k, shrink2)


@njit(inline="always")
def sharing(sheets, sheet, spread, free2, k, shrink2):
    """How many final gathers of equal weight share rays, those in the disk around one of them; below 1 none but it."""
    near = NEAR / max(spread.closeness, 1e-30)
    area = min(shared_area(sheets, sheet, spread, free2, k, shrink2), math.pi * near * near * shrink2)
    return min(_EQUAL_MOST, _EQUAL * spread.density * area)


@njit(inline="always")
def ray_variance(sheets, sheet, spread, free2, k, shrink2):
    """Variance (W2 sr-2 m-4) of what a perfect reflector reflects by n rays of each final gather around, times
    n^FALL."""
    return sheets.evenness * spread.ray_noise / max(1.0, sharing(sheets, sheet, spread, free2, k, shrink2))


@njit(inline="always")
def recall_chance(splitting, sheet, throughput):
    """Chance that the end of a ray on a sheet should recall what it reflects, a share `throughput` of a pixel."""
    return _chance(splitting, sheet, throughput, _RECALL)


@njit(inline="always")
def gather_chance(splitting, sheet, throughput):
    """The same where nothing is near that it could recall, so that it has to ask photons itself."""
    return _chance(splitting, sheet, throughput, _GATHER)


@njit(inline="always")
def _chance(splitting, sheet, throughput, time):
    """Roulette with chance q adds the variance y^2 (1 / q - 1) to what carries y, and saves 1 - q of its time."""
    sheets = splitting.sheets
    square = sheets.reflected[sheet] ** 2 + sheets.photon_noise[sheet] / sheets.disk[sheet]  # mean, of what photons say
    return min(1.0, max(_LEAST_CHANCE, throughput * math.sqrt(square / (time * splitting.price))))


def plan_splitting(sheets: Sheets, survey: Survey, reach2: float, neighbours: int, photons: int) -> Splitting:
    """Find the price at which photons, rays and camera rays lower noise times time most. See measure_sheets."""
    splitting = Splitting(sheets, survey.cells, survey.block, survey.sensitivity, math.inf)
    pixels = len(survey.block)
    some = strata(pass_key(0, PRICED_PIXELS, PILOT), min(_PIXELS, pixels), pixels)
    variance, unknown, least = survey.variance[some], survey.unknown[some], least_price(survey.variance[some])
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


def _fewer_cells(splitting: Splitting, pixels: int) -> tuple[Splitting, float]:
    """The same with _CELLS of its cells at most, and the pixels that have as many."""
    cells = splitting.cells
    if len(cells.key) <= _CELLS:
        return splitting, pixels
    some = strata(pass_key(0, PRICED_CELLS, PILOT), _CELLS, len(cells.key))
    return splitting._replace(cells=Cells(*(column[some] for column in cells))), pixels * _CELLS / len(cells.key)


def _usual(value: np.ndarray, count: np.ndarray) -> float:
    """Sum of the values (c,), each so many times, but the largest: little is known of sheets that few photons reach."""
    order = np.argsort(value)
    value, count = value[order], count[order]
    kept = np.clip(_USUAL * count.sum() - (np.cumsum(count) - count), 0.0, count)
    return float(np.sum(value * kept))


def noise_and_time(splitting: Splitting, pixels: float, reach2: float, neighbours: int) -> tuple[float, float]:
    """Mean variance and time that gathers in free space bring to each of the pixels."""
    rays, variance = _in_cells(splitting, reach2, neighbours)
    count = splitting.cells.count
    return float(np.sum(count * variance)) / pixels, float(np.sum(count * np.where(rays, rays, _GATHER))) / pixels


def most_rays(splitting: Splitting, samples: np.ndarray, unknown: np.ndarray, reach2: float, neighbours: int) -> float:
    """Rays that a pixel sends, camera rays (p,) and final gathers: the mean of as many blocks as a tile has pixels of,
    those that send most. unknown: (p,) bool, pixels that may show what is in no cell; it is taken to send as many as
    a cell does on average."""
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
    """Rays (c,) of the gathers in each cell in the open, 0 for photons, and their variance."""
    rays, variance = np.zeros((2, len(splitting.cells.key)))
    _choose_in_cells(splitting, reach2, k, rays, variance)
    return rays, variance


@njit(**KERNEL)
def _choose_in_cells(splitting, reach2, k, rays, variance):
    cells, labels = splitting.cells, splitting.sheets.density.size
    for cell in range(rays.size):
        sheet, contribution = cells.key[cell] % labels, math.sqrt(cells.contribution2[cell])
        rays[cell], variance[cell] = rays_beside(splitting, sheet, spread_in(cells, cell), contribution, reach2, k, 1.0)
