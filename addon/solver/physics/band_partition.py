# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bands should end: edges that make the error of band-averaged transport least (docs/bands.md).

A band reflects with one number rho_b, a real surface with rho(lambda). The error is a covariance over the band. Its
mean over the light that one material sends to another is at most the mean variance of the reflectances of both,

    error(low, high) = mean over materials of  integral of (rho - rho_b)^2 w d lambda        W m-2 sr-1

w is the radiance that arrives. Dividing a range into bands with the least sum of such errors is the optimal partition
of an interval: W. Fisher, On grouping for maximum homogeneity, J. Am. Stat. Assoc. 53 (1958); by dynamic programming
R. Bellman, On the approximation of curves by line segments using dynamic programming, Comm. ACM 4 (1961).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..scene import SceneError, check_band_edges
from .spectrum import band_radiance, faintest, planck

MOST_BANDS = 256  # for a tolerance
_CELLS = 512  # candidates for edges, at least
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)  # on -1..1, for the integrals between two candidates
_EVEN = 1e-9  # weight of a term that prefers equal widths: it decides where no spectrum does
_LEAST_SPREAD = 10.0  # K, least difference between hottest and coldest: even a scene of one temperature may have lights

Curve = tuple[np.ndarray, np.ndarray]  # wavelengths (n,) um ascending and values (n,), linear between, constant outside


class Partition(NamedTuple):
    """edges: (b + 1,) float64 um, ascending. error: expected error of the apparent temperature, K, see choose_bands."""

    edges: np.ndarray
    error: float


def choose_bands(
    low: float,
    high: float,
    curves: Sequence[Curve],
    temperatures: Sequence[float],
    lights: Sequence[float] = (),
    count: int = 0,
    tolerance: float = 0.0,
    response: Curve | None = None,
) -> Partition:
    """The bands between low and high (um) with the least error of band-averaged transport.

    curves: emissivities of the materials. temperatures: of surfaces and surroundings, K, at least one.
    lights: temperatures of lights, K. count: number of bands; 0 takes the fewest bands whose expected error is at most
    tolerance (K). response: of the sensor, over wavelength, any scale; None is a box.

    The expected error is the sum over bands of the error above, in kelvin of a blackbody at the median temperature: the
    error of one reflection between two surfaces of one material, averaged over the materials that are not grey.
    Edges other than low and high are multiples of a round number. Raises SceneError if low and high are no range, if
    the response is 0 everywhere between them, or if even MOST_BANDS bands do not meet the tolerance.
    """
    check_band_edges(np.array([low, high]))
    candidates = candidate_edges(low, high, count or MOST_BANDS)
    cost = error_table(candidates, curves, (min(temperatures), max(temperatures)), lights, response)
    one_kelvin = _radiance_of_one_kelvin(low, high, float(np.median(temperatures)), response)
    chosen, error = optimal_partition(cost, count or MOST_BANDS, -math.inf if count else tolerance * one_kelvin)
    if not count and error > tolerance * one_kelvin:
        raise SceneError(
            f"Bands: a tolerance of {tolerance:g} K needs more than {MOST_BANDS} bands; with these the error is about "
            f"{error / one_kelvin:.2g} K"
        )
    return Partition(candidates[chosen], error / one_kelvin)


def candidate_edges(low: float, high: float, most: int) -> np.ndarray:
    """Candidates for edges, (g + 1,) um from low to high: multiples of 1, 2 or 5 times a power of ten between them.

    There are at least 512, and a quarter more than `most` bands need.
    """
    widest = (high - low) / max(_CELLS, 1.25 * most)
    power = math.floor(math.log10(widest))
    step = max(factor * 10.0**power for factor in (1, 2, 5) if factor * 10.0**power <= widest)
    inner = np.arange(math.ceil(low / step + 0.5), math.floor(high / step - 0.5) + 1)  # no cell below half a step
    return np.concatenate(([low], np.round(inner * step, -power), [high]))


def error_table(
    edges: np.ndarray,
    curves: Sequence[Curve],
    temperatures: tuple[float, float],
    lights: Sequence[float] = (),
    response: Curve | None = None,
) -> np.ndarray:
    """(g + 1, g + 1) error, W m-2 sr-1, of a band from edge i to edge j > i, infinite elsewhere.

    edges: (g + 1,) um. temperatures: coldest and hottest, K. For the other arguments see choose_bands.
    """
    middle, half = (edges[1:, None] + edges[:-1, None]) / 2.0, np.diff(edges)[:, None] / 2.0
    wavelength = middle + half * _NODES
    weight = arriving_light(wavelength, temperatures, lights)
    if response is not None:
        weight *= np.interp(wavelength, *response)
    weight *= half * _WEIGHTS
    if not weight.sum() > 0:
        raise SceneError(f"Bands: the sensor does not respond to light from {edges[0]:g} to {edges[-1]:g} um")
    light = _between(weight)
    table = _EVEN * weight.sum() * ((edges - edges[:, None]) / (edges[-1] - edges[0])) ** 3
    coloured = [np.interp(wavelength, *curve) for curve in curves if np.ptp(np.interp(wavelength, *curve)) > 0]
    for emissivity in coloured:
        deviation = emissivity - np.average(emissivity, weights=weight)  # small numbers keep the difference exact
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = _between(deviation**2 * weight) - _between(deviation * weight) ** 2 / light
        table += np.maximum(np.nan_to_num(variance), 0.0) / len(coloured)  # 0 where no light arrives
    table[np.tril_indices(len(edges))] = np.inf
    return table


def arriving_light(
    wavelength: np.ndarray, temperatures: tuple[float, float], lights: Sequence[float] = ()
) -> np.ndarray:
    """Spectral radiance that arrives in excess of a scene of one temperature, shaped as wavelength (um), up to a scale.

    B(hottest) - B(coldest), plus the same amount from all lights together, as their true amount is unknown here.
    """
    coldest, hottest = temperatures
    least = faintest(float(wavelength.min()))
    hottest = max(hottest, coldest + _LEAST_SPREAD, least)
    excess = planck(wavelength, hottest) - (planck(wavelength, coldest) if coldest > 0 else 0.0)
    lamps = [planck(wavelength, max(kelvin, least)) for kelvin in lights]
    return excess + sum(lamp * (excess.sum() / lamp.sum()) / len(lamps) for lamp in lamps)


def optimal_partition(cost: np.ndarray, most: int, enough: float = -math.inf) -> tuple[np.ndarray, float]:
    """Indices (k + 1,) int64 of the edges with the least sum of costs, and that sum.

    cost: (g + 1, g + 1), [i, j] of a band from candidate i to candidate j, infinite unless i < j.
    k is `most`, or less if so many make the sum at most `enough`. At most g bands are possible.

    best_k(j) = min over i of best_{k-1}(i) + cost(i, j) is the least sum of k bands up to candidate j (Bellman).
    """
    up_to = np.ascontiguousarray(cost.T)  # row j: bands that end there
    rows = np.arange(len(cost))
    best, before = up_to[:, 0], []
    while len(before) + 1 < min(most, len(cost) - 1) and best[-1] > enough:
        total = up_to + best
        before.append(total.argmin(axis=1))
        best = total[rows, before[-1]]
    chosen = [len(cost) - 1]
    for step in reversed(before):
        chosen.append(step[chosen[-1]])
    return np.array([0, *reversed(chosen)]), float(best[-1])


def _between(values: np.ndarray) -> np.ndarray:
    """(g + 1, g + 1) sums of the rows of values (g, n) from row i to row j - 1."""
    below = np.concatenate(([0.0], np.cumsum(values.sum(axis=1))))
    return below - below[:, None]


def _radiance_of_one_kelvin(low: float, high: float, temperature: float, response: Curve | None) -> float:
    """By how much a blackbody at a temperature (K) gains for each kelvin from low to high um, W m-2 sr-1 K-1."""
    temperature = max(temperature, faintest(low))
    return float(band_radiance(np.array([low, high]), temperature, response, derivative=True)[0]) / temperature
