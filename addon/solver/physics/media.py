# SPDX-License-Identifier: GPL-3.0-or-later
"""Media: what gases absorb, emit and scatter in each band, and into which directions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..sampling.warps import to_world, turn
from ..scene import SOOT, Medium
from ..system.kernels import FAST_INLINED, INLINED, njit
from .mixtures import MixtureTable, empty_mixtures
from .soot import soot_curve
from .spectrum import band_radiance

_COLD = 200.0  # K: below, the blackbody that weighs the absorption in a band is taken at this temperature
_OPAQUE = 32.0  # optical depth that lets through 1e-14
THIN = 0.125  # optical depth, see absorbed_if_thin
_SHARPEST = 0.999  # anisotropy where bands differ: a band that went straight on would share no direction with others
# Anisotropy of a cone that directions in float32 still hold: with 1 - 1e-7 some light is lost, with 1 nearly all of it
# (excess of a ball in such fog: .99 and .04 of the truth, 1.00 +- .003 with this one).
_STRAIGHT = 1.0 - 1e-6
_ISOTROPIC = 1e-3  # anisotropy below which Henyey and Greenstein's inverse is 0 / 0 in float64


class MediumTable(NamedTuple):
    """m media in b bands. absorption, scattering, extinction (the sum of both): (m, b) float64, 1/m. anisotropy: (m, b)
    float64, or (m, 1) if none differs by band. excess: (m, b) float64, W m-2 sr-1, radiance of a blackbody at a
    medium's temperature over that at T0. mixtures: of media whose spectrum changes over a grid; the absorption of these
    is that of their typical gas."""

    absorption: np.ndarray
    scattering: np.ndarray
    extinction: np.ndarray
    anisotropy: np.ndarray
    excess: np.ndarray
    mixtures: MixtureTable


def build_medium_table(
    media: tuple[Medium, ...], edges: np.ndarray, quiet: float, reference: np.ndarray
) -> MediumTable:
    """The MediumTable of media, but for their molecules (see molecules). quiet: T0, K, 0 for none. reference: (b,)
    W m-2 sr-1, radiance of a blackbody at T0."""
    absorption, scattering = (
        np.array([band_coefficient(medium, quantity, edges) for medium in media])
        for quantity in ("absorption", "scattering")
    )
    excess = np.zeros_like(absorption)
    for i, medium in enumerate(media):
        if medium.typical_gas.get(SOOT, 0.0) > 0.0:
            absorption[i] += medium.typical_gas[SOOT] * _soot_coefficient(medium, medium.typical_temperature, edges)
        if medium.temperature != quiet:  # else light would carry the rounding of the reference and nothing else
            excess[i] = band_radiance(edges, medium.temperature) - reference
    anisotropy = np.array([band_anisotropy(medium, edges) for medium in media])
    if np.all(anisotropy == anisotropy[:, :1]):
        anisotropy = np.ascontiguousarray(anisotropy[:, :1]).clip(-_STRAIGHT, _STRAIGHT)
    else:
        anisotropy = anisotropy.clip(-_SHARPEST, _SHARPEST)
    mixtures = _build_mixtures(media, edges)
    return MediumTable(absorption, scattering, absorption + scattering, anisotropy, excess, mixtures)


def _build_mixtures(media: tuple[Medium, ...], edges: np.ndarray) -> MixtureTable:
    """The MixtureTable of media, but for their molecules."""
    mixtures = empty_mixtures(media, len(edges) - 1)
    for first, kelvin, medium in zip(mixtures.first[:-1], mixtures.kelvin, media, strict=True):
        for c, component in enumerate(medium.components, first):
            soot = medium.species_of(component).get(SOOT, 0.0)
            if component == "density":
                mixtures.absorption[c] = band_coefficient(medium, "absorption", edges)
            if soot > 0.0:
                mixtures.absorption[c] += soot * np.array([_soot_coefficient(medium, each, edges) for each in kelvin])
    return mixtures


def _soot_coefficient(medium: Medium, kelvin: float, edges: np.ndarray) -> np.ndarray:
    """(b,) float64 absorption coefficient of a volume fraction of 1 of soot, one over a unit of the scene."""
    return medium.metres * band_mean(*soot_curve(), kelvin, edges)


def band_coefficient(medium: Medium, quantity: str, edges: np.ndarray) -> np.ndarray:
    """(b,) float64 "absorption" or "scattering" coefficient in each band, 1/m: the mean over the band, weighted with
    what a blackbody at the medium's typical temperature emits (Planck mean: exact for the emission of a thin medium;
    Modest, section 10.8)."""
    return band_mean(*medium.curve(quantity), medium.typical_temperature, edges)


def band_anisotropy(medium: Medium, edges: np.ndarray) -> np.ndarray:
    """(b,) float64 anisotropy in each band: the mean over what a medium scatters of the light of a blackbody at its own
    temperature."""
    grid, values = medium.curve("anisotropy")
    if len(grid) == 1:
        return np.full(len(edges) - 1, values[0])
    grid = np.union1d(grid, medium.curve("scattering")[0])
    scattering = np.interp(grid, *medium.curve("scattering"))
    onwards = scattering * 0.5 * (1.0 + np.interp(grid, *medium.curve("anisotropy")))  # at least 0, as band_mean needs
    total, part = (band_mean(grid, each, medium.typical_temperature, edges) for each in (scattering, onwards))
    return np.clip(2.0 * part / np.where(total > 0.0, total, 1.0) - 1.0, -1.0, 1.0)


def band_mean(wavelengths: np.ndarray, values: np.ndarray, kelvin: float, edges: np.ndarray) -> np.ndarray:
    """(b,) float64 mean in each band of a coefficient with values (n,) at wavelengths (n,) um, weighted with what a
    blackbody emits."""
    if len(wavelengths) == 1:
        return np.full(len(edges) - 1, values[0])
    kelvin = max(kelvin, _COLD)
    largest = max(float(values.max()), 1e-300)  # the integral takes curves from 0 to 1
    return largest * band_radiance(edges, kelvin, (wavelengths, values / largest)) / band_radiance(edges, kelvin)


@njit(**FAST_INLINED)
def absorbed_if_thin(depth):
    """1 - exp(-depth), what a medium of an optical depth from 0 to THIN takes, to 1e-9 of it: the power series."""
    return depth * (1.0 - depth * (1 / 2 - depth * (1 / 6 - depth * (1 / 24 - depth * (1 / 120 - depth * (1 / 720))))))


@njit(**FAST_INLINED)
def absorbed(depth):
    """1 - exp(-depth) of any optical depth of at least 0, to 1e-9 of it: that of a 256th of the depth, and then eight
    times a(2 x) = a(x) (2 - a(x)). Without a branch or a call, so that loops over bands run on vectors."""
    a = absorbed_if_thin(min(depth, _OPAQUE) / 256.0)
    for _ in range(8):
        a *= 2.0 - a
    return a


@njit(**INLINED)
def phase(anisotropy, cosine):
    """Henyey and Greenstein's phase function, 1 / sr, at the cosine of the angle between the directions before and
    after (Henyey and Greenstein 1941)."""
    g = anisotropy
    square = max(1.0 + g * g - 2.0 * g * cosine, 1e-30)
    return (1.0 - g * g) / (4.0 * math.pi * square * math.sqrt(square))


@njit(**INLINED)
def mean_phase(anisotropy, weight, cosine):
    """The mean of `phase` over bands, in proportion to |weight| (b,). anisotropy: (b,), or (1,) for all bands."""
    if anisotropy.size == 1:
        return phase(anisotropy[0], cosine)
    total, mean = 0.0, 0.0
    for b in range(weight.size):
        total += abs(weight[b])
        mean += abs(weight[b]) * phase(anisotropy[b], cosine)
    return mean / total if total > 0.0 else 0.0


@njit(**INLINED)
def weigh_phase(anisotropy, mean, cosine, weight):
    """Multiply weights (b,) by the phase function of each band over `mean`, which mean_phase has found for that
    cosine."""
    if anisotropy.size > 1:
        for b in range(weight.size):
            weight[b] *= phase(anisotropy[b], cosine) / mean


@njit(**INLINED)
def deflect(anisotropy, direction, u, v):
    """A direction after scattering, with the density of `phase`. direction: of unit length, before. u, v: numbers in
    [0, 1)."""
    g = anisotropy
    if abs(g) < _ISOTROPIC:
        cosine = 1.0 - 2.0 * u + 1.5 * g * (1.0 - (1.0 - 2.0 * u) ** 2)  # to first order in g
    else:
        s = (1.0 - g * g) / (1.0 + g - 2.0 * g * u)
        cosine = (1.0 + g * g - s * s) / (2.0 * g)
    cosine = min(1.0, max(-1.0, cosine))
    sine, (c, s) = math.sqrt(1.0 - cosine * cosine), turn(v)
    return to_world((sine * c, sine * s, cosine), direction)
