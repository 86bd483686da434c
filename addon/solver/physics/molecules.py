# SPDX-License-Identifier: GPL-3.0-or-later
"""Molecular gases: absorption by lines that are far narrower than the bands of a render.

In a narrow band of mean coefficient k, whose lines have half-widths that are a times their spacing, Malkmus's random
model lets through, over a length s (Malkmus 1967, J. Opt. Soc. Am. 57, 323; Modest, section 11.8),

    exp(-2 a (sqrt(1 + k s / a) - 1))

That is the mean of exp(-k' s) over coefficients k' that are distributed by an inverse Gaussian of mean k and shape
parameter 2 a k (Taine and Soufiani 1999, Adv. Heat Transfer 33, 295). So k'(g), the quantile of that distribution at g
in 0..1, is the coefficient that stands for the share g of the narrow band that is clearest, and the mean over g gives
the law back (k-distribution).

Each pass draws, in each band of the render, one wavenumber, in proportion to what a blackbody emits there, and one g
for each molecule. All rays and photons of the pass meet the same coefficients, so that segments in a row multiply as
they do in nature. Where temperatures differ along a ray, the same g is the same part of the spectrum (correlated k);
different molecules have lines at independent places, and so independent g.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..sampling.low_discrepancy import scrambled
from ..sampling.rng import ALL_PASSES, GAS, pass_key, path_key
from ..scene import ATMOSPHERE, MOLECULES, Medium
from ..system.kernels import INLINED, KERNEL, njit
from .continuum import water_continuum
from .heat import temperature_range
from .media import MediumTable
from .narrow_bands import COLDEST, KELVIN, coefficient_and_overlap
from .spectrum import apparent_temperature, band_radiance, faintest

log = logging.getLogger(__name__)

_CELLS = 128  # parts of a band, in whose proportion wavenumbers are drawn
_FIRST = 1 << 30  # pass from which on draws stand for endless ones; no render has so many passes
_DRAWS = 1 << 16  # of all bands together, that stand for endless ones
_WARM = 250.0  # K, below which the data, from 300 K on, may be far from the truth
_FAINT = 200.0  # K: behind media, colder things count as so warm; before 0 K any error is large in kelvin
_LENGTHS = 8  # each half of the one before
_PROBED, _SHARES = 3, (0.25, 1.0)  # media that noise looks through, at most, and over which shares of their extent
_TYPICAL, _FEW = 64, 16  # draws behind the table of what is planned, and of components at many temperatures
_ROOT_PI = math.sqrt(math.pi)


class Draws(NamedTuple):
    """What is drawn of spectra. wavenumber: any shape s, cm-1. g: (molecules,) + s, of each of MOLECULES, in (0, 1)."""

    wavenumber: np.ndarray
    g: np.ndarray


class Sampler:
    """Draws of passes: a scrambled Sobol' sequence over the absolute pass number, one for each band."""

    def __init__(self, edges: np.ndarray, kelvin: float, seed: int):
        """edges: (b + 1,) um. kelvin: of the blackbody in whose proportion wavenumbers are drawn."""
        self.key = pass_key(seed, ALL_PASSES, GAS)
        kelvin = max(kelvin, faintest(float(edges[0])))
        self._wavelength = np.geomspace(edges[:-1], edges[1:], _CELLS + 1, axis=1)
        cells = (band_radiance(row, kelvin) for row in self._wavelength)
        self._below = np.array([np.concatenate(([0.0], np.cumsum(each) / each.sum())) for each in cells])
        self.radiance = band_radiance(edges, kelvin)  # (b,) of that blackbody

    def draw(self, passes: np.ndarray) -> Draws:
        """Draws of shape (n, b) of absolute pass numbers (n,)."""
        u = np.empty((1 + len(MOLECULES), len(passes), len(self._below)))
        _draw(self.key, np.ascontiguousarray(passes, np.int64), u)
        columns = zip(u[0].T, self._below, self._wavelength, strict=True)
        wavelength = np.array([np.interp(each, below, points) for each, below, points in columns]).T
        return Draws(1e4 / wavelength, u[1:])


@njit(**KERNEL)
def _draw(key, passes, u):
    """Fill u (dimensions, n, b) with the points of passes (n,), in (0, 1)."""
    for b in range(u.shape[2]):
        path = path_key(key, b)
        for i in range(passes.size):
            for d in range(u.shape[0]):
                u[d, i, b] = scrambled(np.uint32(passes[i]), path, d) + 2.0**-33


def species_coefficients(
    draws: Draws, kelvin: np.ndarray, pressure: float, mixture: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """For each molecule of a mixture its absorption coefficient per unit of its mole fraction, 1/m, (t,) + s float64.

    draws: of shape s. kelvin: (t,) temperatures. pressure: Pa. mixture: typical mole fractions, by which lines are
    broadened, and by which water vapour's continuum is more than proportional to its fraction.
    """
    kelvin, atm = np.maximum(kelvin, COLDEST), pressure / ATMOSPHERE
    coefficients = {}
    for name, g in zip(MOLECULES, draws.g, strict=True):
        if name not in mixture:
            continue
        mean, overlap = coefficient_and_overlap(name, draws.wavenumber, kelvin, atm, mixture)
        coefficients[name] = mean * inverse_gaussian(np.broadcast_to(g, overlap.shape), 2.0 * overlap)
        if name == "H2O":
            column = kelvin.reshape(-1, *[1] * draws.wavenumber.ndim)
            coefficients[name] += water_continuum(draws.wavenumber, column, atm, mixture[name])
    return coefficients


def inverse_gaussian(g: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """The quantiles at g of inverse Gaussian distributions of mean 1, float64, shaped as both. g: in (0, 1). shape:
    their shape parameters, above 0; the variance is 1 / shape."""
    flat = [np.array(each, np.float64).ravel() for each in (g, shape)]  # copies, which can be written: see kernels
    quantile = np.empty(flat[0].size)
    _quantiles(*flat, quantile)
    return quantile.reshape(np.shape(g))


@njit(**KERNEL)
def _quantiles(g, shape, quantile):
    for i in range(g.size):
        quantile[i] = _quantile(g[i], min(max(shape[i], 1e-12), 1e12))


@njit(**INLINED)
def _quantile(g, shape):
    """Newton's method in the logarithm of the quantile, within bounds that close in.

    The distribution's tails fall as exp(-shape (x - 1)^2 / 2 x), and end where that is exp(-50).
    """
    s = 50.0 / shape
    high = math.log(1.0 + s + math.sqrt(s * s + 2.0 * s))
    low, y = -high, 0.0
    for _ in range(100):
        x = math.exp(y)
        root = math.sqrt(0.5 * shape / x)
        a, b = root * (x - 1.0), root * (x + 1.0)
        error = 0.5 * math.erfc(-a) + 0.5 * math.exp(-a * a) * _scaled_erfc(b) - g
        if error > 0.0:
            high = y
        else:
            low = y
        slope = root / _ROOT_PI * math.exp(-a * a)  # x times the density
        step = -error / slope if slope > 0.0 else np.inf
        following = y + step
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - y) < 1e-13 * max(1.0, abs(y)):
            break
        y = following
    return math.exp(y)


@njit(**INLINED)
def _scaled_erfc(x):
    """exp(x^2) erfc(x), x at least 0, without overflow."""
    if x < 25.0:
        return math.exp(x * x) * math.erfc(x)
    y = 0.5 / (x * x)
    return (1.0 - y * (1.0 - 3.0 * y * (1.0 - 5.0 * y * (1.0 - 7.0 * y)))) / (x * _ROOT_PI)


class MolecularMedia:
    """Media of which some have lines: their table in each pass."""

    def __init__(self, media: tuple[Medium, ...], table: MediumTable, sampler: Sampler):
        """table: of what they have besides molecules."""
        self.media = media
        self.sampler, self._table = sampler, table

    def table(self, index: int) -> MediumTable:
        """The MediumTable of an absolute pass number."""
        passes = np.array([index])
        return self._with(self._absorption(passes)[:, 0], self._components(passes)[:, 0])

    def typical_table(self, length: float) -> MediumTable:
        """A table for what is planned: with coefficients that let through over a length (units of the scene) what
        passes do in the mean."""
        passes = np.arange(_TYPICAL) + _FIRST
        few = passes[:: _TYPICAL // _FEW]
        every = [medium.typical_gas.get(name, 1.0) or 1.0 for medium in self.media for name in medium.components]
        amount = np.array(every).reshape(-1, 1, 1)
        components = _let_through(amount[:, None] * self._components(few), length) / amount
        return self._with(_let_through(self._absorption(passes), length), components)

    def extinctions(self, count: int) -> np.ndarray:
        """(m, count, b) extinction of the media in draws that stand for endless ones, one over a unit of the scene."""
        return self._absorption(np.arange(count) + _FIRST) + self._table.extinction[:, None]

    def transmittances(self, first: int, count: int, lengths: np.ndarray) -> np.ndarray:
        """(lengths, m, b) mean transmittance of each medium over lengths (units of the scene), over passes from `first`
        on."""
        k = self._absorption(first + np.arange(count)) + self._table.absorption[:, None]
        return np.array([np.exp(-k * length).mean(axis=1) for length in lengths])

    def exact_transmittances(self, lengths: np.ndarray) -> np.ndarray:
        """`transmittances` of so many passes that more would not change them much."""
        return self.transmittances(_FIRST, self._draws(), lengths)

    def _draws(self) -> int:
        return min(max(_DRAWS // self._table.absorption.shape[1], 512), 8192)

    def probes(self, passes: np.ndarray, length: float, weights: np.ndarray) -> np.ndarray:
        """(n, j) what passes (n,) let a sensor see of a blackbody through media: the first _PROBED, each over two
        lengths. length: of media without a mesh. weights: (b,) response of the sensor."""
        k = self._absorption(passes) + self._table.absorption[:, None]
        signal = weights * self.sampler.radiance
        ways = [(i, share * _thickness(self.media[i], length)) for i in _probed(self.media) for share in _SHARES]
        return np.stack([np.exp(-k[i] * way) @ signal for i, way in ways], axis=1)

    def exact_probes(self, length: float, weights: np.ndarray) -> np.ndarray:
        """(j,) mean of `probes` over so many passes that more would not change it much."""
        return self.probes(_FIRST + np.arange(self._draws()), length, weights).mean(axis=0)

    def quadrature_error(
        self,
        first: int,
        count: int,
        length: float,
        extremes: tuple[float, float],
        sensor: tuple[np.ndarray, np.ndarray],
    ) -> float:
        """How far count passes from `first` on are off by their draws: apparent temperature, K, of a blackbody seen
        through a medium, the worst of all media, of ways of `length` (units of the scene) and shorter, and of
        blackbodies at both extremes (K). sensor: edges (b + 1,) um of the bands, and the weight (b,) of each."""
        lengths = length * 0.5 ** np.arange(_LENGTHS)
        edges, weights = sensor
        found, exact = self.transmittances(first, count, lengths), self.exact_transmittances(lengths)
        own = band_radiance(edges, np.array([medium.typical_temperature for medium in self.media]))
        worst = 0.0
        for behind in band_radiance(edges, np.maximum(extremes, _FAINT)):
            seen = [(own + (behind - own) * through) @ weights for through in (found, exact)]
            kelvin = [apparent_temperature(radiance, edges, weights) for radiance in seen]
            worst = max(worst, float(np.abs(kelvin[0] - kelvin[1]).max()))
        return worst

    def _absorption(self, passes: np.ndarray) -> np.ndarray:
        """(m, n, b) absorption coefficients of typical molecules in passes (n,), one over a unit of the scene."""
        draws = self.sampler.draw(passes)
        absorption = np.zeros((len(self.media), *draws.wavenumber.shape))
        for i, medium in enumerate(self.media):
            mixture = medium.molecules
            if mixture:
                parts = species_coefficients(draws, np.array([medium.typical_temperature]), medium.pressure, mixture)
                absorption[i] = medium.metres * sum(mixture[name] * part[0] for name, part in parts.items())
        return absorption

    def _components(self, passes: np.ndarray) -> np.ndarray:
        """(c, n, t, b) absorption coefficients of the molecules in a unit of each component of MixtureTable, in passes
        (n,), one over a unit of the scene."""
        draws, mixtures = self.sampler.draw(passes), self._table.mixtures
        count, nodes, bands = mixtures.absorption.shape
        absorption = np.zeros((count, len(passes), nodes, bands))
        for first, kelvin, medium in zip(mixtures.first[:-1], mixtures.kelvin, self.media, strict=True):
            if medium.components:
                known = kelvin[: np.argmax(kelvin) + 1]
                parts = species_coefficients(draws, known, medium.pressure, medium.molecules)
            for c, component in enumerate(medium.components, first):
                for name, fraction in medium.species_of(component).items():
                    if name in parts:
                        absorption[c, :, : len(known)] += medium.metres * fraction * parts[name].swapaxes(0, 1)
        return absorption

    def _with(self, absorption: np.ndarray, components: np.ndarray) -> MediumTable:
        """The table with molecules that absorb (m, b), and in components (c, t, b)."""
        table, mixtures = self._table, self._table.mixtures
        return table._replace(
            absorption=table.absorption + absorption,
            extinction=table.extinction + absorption,
            mixtures=mixtures._replace(absorption=mixtures.absorption + components),
        )


def _let_through(absorption: np.ndarray, length: float) -> np.ndarray:
    """Coefficients that let through over a length what those along axis 1 do in the mean."""
    depth = absorption * length
    thinnest = depth.min(axis=1, keepdims=True)  # taken out: a mean of exp(-1000) would be 0
    beyond = np.log(np.mean(np.exp(thinnest - depth), axis=1))
    return (thinnest[:, 0] - beyond) / length


def _probed(media: tuple[Medium, ...]) -> list[int]:
    """Which media `probes` looks through."""
    return [i for i, medium in enumerate(media) if medium.molecules][:_PROBED]


def probe_count(media: tuple[Medium, ...]) -> int:
    """How many numbers `probes` gives for a pass."""
    return len(_probed(media)) * len(_SHARES)


def _thickness(medium: Medium, length: float) -> float:
    """The least extent of a medium along an axis; a length for one without a mesh."""
    return length if medium.outline is None else float(np.ptp(medium.outline, axis=0).min())


def build_molecular_media(
    media: tuple[Medium, ...], table: MediumTable, edges: np.ndarray, kelvin: float, seed: int
) -> MolecularMedia | None:
    """The MolecularMedia of a scene, None if no medium has molecules.

    table: see MolecularMedia. edges: (b + 1,) um. kelvin: of what lights the scene; in a band, wavenumbers are drawn as
    the hottest of that and the media with molecules emits.
    """
    molecular = [medium for medium in media if medium.molecules]
    if not molecular:
        return None
    hottest = max(kelvin, *(_extremes(medium)[-1] for medium in molecular))
    return MolecularMedia(media, table, Sampler(edges, hottest, seed))


def warn_of_temperatures(media: tuple[Medium, ...]) -> None:
    """Log which media with molecules are colder or hotter than the data are good for."""
    for medium in media:
        outside = [each for each in _extremes(medium) if not _WARM <= each <= KELVIN[-1]] if medium.molecules else []
        if outside:
            log.warning(
                "Medium '%s': at %g K its molecules absorb as at the nearest of %g to %g K",
                medium.name, outside[-1], KELVIN[0], KELVIN[-1],
            )  # fmt: skip


def _extremes(medium: Medium) -> tuple[float, ...]:
    """Lowest and highest temperature in a medium, K."""
    return (medium.temperature,) if medium.grid is None else temperature_range(medium)
