# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a camera path asks the photons around it, and where it sends rays of its own, and how many.

Both have a noise and a time that can be told beforehand. What lowers noise times time is best, and at that optimum a
further ray saves the same variance anywhere: the noise of the image over its time (Rath et al. 2022 split paths by this
rule). So rays go in number as the spread of what they bring, and photons serve where they are better than those.
"""

import math
from typing import NamedTuple

import numpy as np

from .kernels import KERNEL, njit
from .pilot import Pilot
from .point_tree import empty_walk
from .radiometry import Radiometry, excess
from .surfaces import (
    NO_WALL,
    PATCH_LIMIT,
    SAME_SURFACE,
    Surfaces,
    patch_in_ball,
    region_area,
    sheet_count,
    temperature_at,
)

# Times, in that of one ray of a final gather (tests/benchmarks/throughput.py)
_GATHER = 6.0  # of k photons
_FIXED = 16.0  # of a gather's share of camera rays
_PHOTON = 2.0  # traced, sorted, and its share of the cache
_RECALL = 1.6  # of what a ray's end reflects; more than it takes, as neighbours share what roulette adds to the noise
_FEWEST, _MOST = 16, 128  # rays of a final gather; powers of two
_SHARING = 0.25  # area of the disk in which final gathers share rays, over that of photons: they blur less
_EQUAL = 0.75  # share of them that with equal weights would bring as much: (sum of w)^2 / sum of w^2, w = 1 - r^2 / R^2
_EQUAL_MOST = 28.0  # the number of those within the window of pixels
_STRATIFIED = 0.6  # variance of so many rays in strata, over that of as many at random
_LEAST_CHANCE = 1.0 / 8.0  # of roulette: the mean of a sheet is not the light of each place
_PRIOR = 4.0  # samples that the mean of all sheets is worth on each
_PRICES = np.geomspace(1e-3, 1e1, 25)  # tried, over that of photons alone
_PLACES = 1024  # at which the extent of sheets is measured and prices are tried


class Splitting(NamedTuple):
    """What is known beforehand of the noise of gathers, by label of the sheet, (labels,) float64 each.

    density: m-2, photons of a pass expected. photon_noise: W2 sr-2 m-2, variance of the radiance (of all bands) that a
    perfect reflector reflects, times the area that the photons are gathered from. ray_noise: W2 sr-2 m-4, variance of
    the radiance that a ray from there meets. span: m2, area of the sheet within the largest disk. gathers: m-2, final
    gathers of a pass that would share rays. reflected: W sr-1 m-2, mean radiance that a perfect reflector reflects.
    recalled: W sr-1 m-2, root mean square of what the photons say of it. price: W2 sr-2 m-4, variance that a ray should
    save.
    """

    density: np.ndarray
    photon_noise: np.ndarray
    ray_noise: np.ndarray
    span: np.ndarray
    gathers: np.ndarray
    reflected: np.ndarray
    recalled: np.ndarray
    price: float


class Trial(NamedTuple):
    """What a trial pass of so many photons stored, n hits: code (n,) int32, 2 triangle + side; power (n,) float64, W
    over all bands; caustic (n,) bool, see Photons."""

    photons: int
    code: np.ndarray
    power: np.ndarray
    caustic: np.ndarray


@njit(inline="always")
def rays_beside(splitting, sheet, carried, free2, k, shrink2):
    """Rays that a gather should send, a power of two, or 0 if photons are better; and the variance.

    carried: share of a pixel that its reflected light makes up. free2: m2, squared radius of the free space around. k,
    shrink2: see Estimate.
    """
    area = disk_area(splitting, sheet, free2, k, shrink2)
    by_photons = carried * carried * splitting.photon_noise[sheet] / area
    rays, by_rays = rays_alone(splitting, sheet, carried, free2, k, shrink2)
    if by_photons + _GATHER * splitting.price > by_rays + rays * splitting.price:
        return rays, by_rays
    return 0, by_photons


@njit(inline="always")
def rays_alone(splitting, sheet, carried, free2, k, shrink2):
    """Rays that a gather should send where photons cannot serve, a power of two, and the variance. See rays_beside."""
    by_ray = carried * carried * ray_variance(splitting, sheet, free2, k, shrink2)
    best = min(max(math.sqrt(by_ray / splitting.price), float(_FEWEST)), float(_MOST))
    rays = 1 << int(math.log2(best) + 0.5)
    return rays, by_ray / rays


@njit(inline="always")
def disk_area(splitting, sheet, free2, k, shrink2):
    """Area (m2) of the disk of a gather: that of k photons, in free space of this squared radius (m2), shrunk."""
    area = min(math.pi * free2, splitting.span[sheet])
    if splitting.density[sheet] * area > k:
        area = k / splitting.density[sheet]
    return max(area * shrink2, 1e-30)


@njit(inline="always")
def shared_area(splitting, sheet, free2, k, shrink2):
    """Area (m2) of the disk in which final gathers share rays."""
    return _SHARING * disk_area(splitting, sheet, free2, k, shrink2)


@njit(inline="always")
def ray_variance(splitting, sheet, free2, k, shrink2):
    """Variance (W2 sr-2 m-4) of what a perfect reflector reflects if each final gather around sends one ray."""
    sharing = _EQUAL * splitting.gathers[sheet] * shared_area(splitting, sheet, free2, k, shrink2)
    return _STRATIFIED * splitting.ray_noise[sheet] / max(1.0, min(_EQUAL_MOST, sharing))


@njit(inline="always")
def recall_chance(splitting, sheet, carried):
    """Chance that the end of a ray on a sheet should recall what it reflects, a share `carried` of a pixel.

    Roulette with chance q adds the variance y^2 (1 / q - 1) to what carries y, and saves 1 - q of its time.
    """
    chance = carried * splitting.recalled[sheet] / math.sqrt(_RECALL * splitting.price)
    return min(1.0, max(_LEAST_CHANCE, chance))


def plan_splitting(
    surfaces: Surfaces,
    radiometry: Radiometry,
    surroundings: np.ndarray,
    shines: np.ndarray,
    pilot: Pilot,
    trial: Trial,
    area: np.ndarray,
    reach2: float,
    neighbours: int,
    photons: int,
    pixels: int,
) -> Splitting:
    """Find the price at which rays and photons together lower noise times time most.

    surroundings: (b,) float64, their excess radiance. shines: (t, 2) bool, lamps, which rays leave to shadow rays.
    area: (t,) m2. reach2, neighbours: see Estimate. photons, pixels: of a pass.
    """
    sheet, labels = surfaces.sheet, sheet_count(surfaces)
    size = np.maximum(np.bincount(sheet.ravel(), np.repeat(area, 2), labels), 1e-30)
    hit = sheet[trial.code >> 1, trial.code & 1]
    squares = trial.power**2 * (trial.photons / photons) / math.pi**2
    # where few photons or none came, as on small parts, sheets are taken to be like all others that matter
    near = pilot.matters[trial.code >> 1, trial.code & 1]
    other = _PRIOR * float((area[:, None] * pilot.matters).sum()) / max(1, near.sum())  # m2, that so many hits take
    mean_square = float((squares * near * ~trial.caustic).sum()) / max(1, near.sum())
    density = (np.bincount(hit, minlength=labels) + _PRIOR) / (size + other) * (photons / trial.photons)
    photon_noise = (np.bincount(hit, squares * ~trial.caustic, labels) + _PRIOR * mean_square) / (size + other)
    caustic_noise = np.bincount(hit, squares * trial.caustic, labels) / size
    reflected = np.bincount(hit, trial.power, labels) / size / math.pi
    radiance = np.append(_radiance(surfaces, radiometry), surroundings.sum())
    radiance[:-1][shines.any(axis=1)] = 0.0
    met = radiance[pilot.met]
    mean = _means(pilot.left, met, labels, met.mean() if met.size else 0.0)
    ray_noise = _means(pilot.left, (met - mean[pilot.left]) ** 2, labels, met.var() if met.size else 0.0)
    places = sheet[pilot.code >> 1, pilot.code & 1]
    some = slice(None, None, max(1, len(places) // _PLACES))
    spans = _spans(surfaces, pilot.code[some], pilot.place[some], reach2)
    span = _means(places[some], spans, labels, math.pi * reach2, 1e-9)
    crowds = _crowds(places, pilot.place, pilot.facing, some.step, reach2) * (pilot.gathering * pixels)
    gathers = _means(places[some], crowds / (max(1, len(places)) * spans), labels, 0.0, 1e-9)
    disk = np.minimum(span, neighbours / np.maximum(density, 1e-30))
    recalled = np.sqrt(reflected**2 + photon_noise / disk)
    tables = (density, photon_noise, ray_noise, span, gathers, reflected, recalled)
    splitting = Splitting(*tables, math.inf)
    # photons of caustics are gathered whatever is chosen
    rest = float(np.mean(pilot.carried**2 * (caustic_noise / disk)[places])) if len(places) else 0.0
    fixed = _FIXED + _PHOTON * photons / max(1.0, pilot.gathering * pixels)
    places, carried = places[some], pilot.carried[some]
    noise, _ = _mean_of(splitting, places, carried, reach2, neighbours)
    tried = []
    for price in max(noise + rest, 1e-300) / fixed * _PRICES:
        noise, time = _mean_of(splitting._replace(price=price), places, carried, reach2, neighbours)
        tried.append(((noise + rest) * (fixed + time), price))
    return splitting._replace(price=min(tried)[1])


def _means(label: np.ndarray, value: np.ndarray, labels: int, prior: float, worth: float = _PRIOR) -> np.ndarray:
    """Mean value (labels,) of each label; where there are few it is drawn to the prior, which is worth some samples."""
    return (np.bincount(label, value, labels) + worth * prior) / (np.bincount(label, minlength=labels) + worth)


def _radiance(surfaces, radiometry):
    """(t,) float64 excess radiance of all bands, W m-2 sr-1, that triangles emit at their centroids."""
    radiance = np.empty(surfaces.material.size)
    _fill_radiance(surfaces, radiometry, radiance, np.empty(radiometry.reference.size))
    return radiance


@njit(**KERNEL)
def _fill_radiance(surfaces, radiometry, radiance, value):
    for t in range(radiance.size):
        kelvin = temperature_at(surfaces.temperature, t, 1.0 / 3.0, 1.0 / 3.0)
        excess(radiometry, surfaces.material[t], kelvin, 2.0 / 3.0, value)
        radiance[t] = value.sum()


def _spans(surfaces, code, place, reach2):
    """(n,) float64 areas, m2, of the sheets around places (n, 3) within the largest disk."""
    spans = np.empty(code.size)
    _fill_spans(surfaces, code, place, reach2, spans, np.empty(PATCH_LIMIT, np.int32), empty_walk())
    return spans


@njit(**KERNEL)
def _fill_spans(surfaces, code, place, reach2, spans, patch, walk):
    for i in range(code.size):
        t, side = code[i] >> 1, code[i] & 1
        x, y, z = place[i]
        members, area = patch_in_ball(surfaces.corners, surfaces.neighbours, t, side, x, y, z, reach2, NO_WALL, patch)
        if members == 0:
            area = region_area(surfaces, t, side, x, y, z, reach2, NO_WALL, walk)
        spans[i] = area


def _crowds(label, place, facing, step, reach2):
    """How many places (n, 3) lie in the largest disk around every step-th of them, on its sheet and facing its way."""
    crowds = np.zeros(len(label[::step]))
    _fill_crowds(label, place, facing, step, reach2, crowds)
    return crowds


@njit(**KERNEL)
def _fill_crowds(label, place, facing, step, reach2, crowds):
    for i in range(crowds.size):
        j = i * step
        for other in range(label.size):
            if label[other] == label[j]:
                distance2 = cosine = 0.0
                for axis in range(3):
                    distance2 += (place[other, axis] - place[j, axis]) ** 2
                    cosine += facing[other, axis] * facing[j, axis]
                crowds[i] += 1.0 if distance2 < reach2 and cosine > SAME_SURFACE else 0.0


@njit(**KERNEL)
def _mean_of(splitting, sheets, carried, reach2, k):
    """Mean variance and time of gathers on sheets that carry so much of a pixel, (n,) each, in free space."""
    noise = time = 0.0
    for i in range(sheets.size):
        rays, variance = rays_beside(splitting, sheets[i], carried[i], reach2, k, 1.0)
        noise += variance
        time += rays if rays else _GATHER
    return noise / max(1, sheets.size), time / max(1, sheets.size)
