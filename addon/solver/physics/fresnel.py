# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's law: how the reflectance of a smooth face depends on the angle, and what follows for all lobes.

Light that arrives at the angle theta, of which half is polarised in each plane (Born and Wolf, Principles of Optics,
section 1.5.3), on a body of the complex index m = n + i k:

    R(theta) = (|r_s|^2 + |r_p|^2) / 2,    cos' = sqrt(1 - sin(theta)^2 / m^2)
    r_s = (cos - m cos') / (cos + m cos'),    r_p = (m cos - cos') / (m cos + cos')

Of a material with optical constants n and k, R is what they give; else the index is real, that of a dielectric with the
reflectance F0 of the specular lobe along the normal: n = (1 + sqrt(F0)) / (1 - sqrt(F0)).

The lobe's albedo A(theta) is R itself for a mirror. For a rough lobe it is the mean of R over the facets that are met,
each under its own angle. What A leaves reaches what lies below and is reflected diffusely there, on the way in and on
the way out by the same share 1 - A (docs/surfaces.md):

    f(i, o) = f_lobe(i, o) + beta / pi (1 - A(i)) (1 - A(o)) / t,    t = mean of 1 - A over a cosine distribution
    albedo(theta) = A(theta) + beta (1 - A(theta))

beta makes the albedo 1 - eps along the normal, for a mirror's lobe. f is the same if i and o are exchanged, and no
albedo exceeds 1. What is not reflected is absorbed: eps(theta) = 1 - albedo(theta).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..scene import Material
from ..system.kernels import FAST_INLINED, INLINED, njit
from .lobes import sample_ggx
from .spectrum import faintest, planck

ANGLES = 256  # cosines of the tables, (i / (n - 1))^2: dense where surfaces are seen at grazing angles
_STEP = 0.1  # largest step in ln T between the temperatures of the emissivity's table
_NODES = 8  # of Gauss and Legendre's quadrature, in each piece of a band
_PIECE = 1.06  # largest ratio of the wavelengths at the ends of a piece
_FACETS = 96  # per axis, by which the facets of a rough lobe are sampled
# Rows of FresnelTable.reflectance.
TOTAL, FACET, BELOW, ENTERING = 0, 1, 2, 3


class FresnelTable(NamedTuple):
    """What f of m materials reflect and emit at each angle, those that follow Fresnel's law, in b bands.

    row: (m,) int32, of a material in the other tables, -1 for one that does not follow it. reflectance: (f, 4, ANGLES,
    b) float32, averaged as in Radiometry. TOTAL: of all lobes together, towards a direction. FACET: of a smooth face,
    over the specular share of the material. BELOW: of the diffuse lobe, towards a direction, over its share of the
    reflectance. ENTERING: how much more of the light from a direction gets below than of light that comes evenly from
    all sides. emissivity: (f, 1 + k, ANGLES, b) float32, at 0 K and at k temperatures, weighted with the excess over
    T0. log_start, log_step: ln T of the first of them, and the steps in ln T.
    """

    row: np.ndarray
    reflectance: np.ndarray
    emissivity: np.ndarray
    log_start: float
    log_step: float


def fresnel_reflectance(n: np.ndarray, k: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Reflectance of a smooth face for unpolarised light from vacuum, 0..1, float64; formula above.

    n, k: optical constants of the body. cosine: of the angle to the normal, 0..1. All of any shapes that broadcast.
    """
    m, cosine = np.asarray(n, np.float64) + 1j * np.asarray(k, np.float64), np.asarray(cosine, np.float64)
    inside = np.sqrt(1.0 - (1.0 - cosine * cosine) / (m * m))
    across = (cosine - m * inside) / (cosine + m * inside)
    along = (m * cosine - inside) / (m * cosine + inside)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)


def dielectric_index(reflectance: np.ndarray) -> np.ndarray:
    """Index n of the transparent body that reflects this much along its normal, 0..1; at most 4e6."""
    root = np.sqrt(np.minimum(reflectance, 1.0 - 1e-6))
    return (1.0 + root) / (1.0 - root)


def facet_reflectance(material: Material, wavelength: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """(wavelengths, cosines) float64 reflectance of the lobe of a material, of a single smooth face of it.

    wavelength: um. Between the points of optical constants the reflectance is linear, as is that along the normal.
    """
    if material.constants is None:
        normal = material.specular * (1.0 - np.interp(wavelength, *material.curve))
        return fresnel_reflectance(dielectric_index(normal)[:, None], 0.0, cosine)
    um, n, k = np.asarray(material.constants, np.float64).T
    at_points = fresnel_reflectance(n[:, None], k[:, None], cosine)
    columns = (np.interp(wavelength, um, column) for column in at_points.T)
    return material.specular * np.stack(list(columns), axis=1)


def angles() -> np.ndarray:
    """(ANGLES,) float64 cosines of the tables."""
    return (np.arange(ANGLES) / (ANGLES - 1.0)) ** 2


def build_fresnel_table(
    materials: tuple[Material, ...],
    edges: np.ndarray,
    temperatures: tuple[float, float],
    weighting: float,
    reference: float,
) -> FresnelTable:
    """The FresnelTable of the materials; for the arguments see radiometry.build_radiometry."""
    follow = [i for i, material in enumerate(materials) if material.follows_fresnel]
    row = np.full(len(materials), -1, np.int32)
    row[follow] = np.arange(len(follow))
    low, high = temperatures
    steps = _steps(temperatures)
    step, start = (math.log(high / low) / steps, math.log(low)) if high > low > 0.0 else (1.0, math.log(max(low, 1.0)))
    bands = len(edges) - 1
    reflectance = np.empty((len(follow), 4, ANGLES, bands), np.float32)
    emissivity = np.empty((len(follow), 2 + steps, ANGLES, bands), np.float32)
    kelvin = [weighting, 0.0, *np.exp(start + step * np.arange(steps + 1))]
    for f, i in enumerate(follow):
        for node, averaged in enumerate(_band_averages(materials[i], np.asarray(edges, np.float64), kelvin, reference)):
            below, albedo = _layered(materials[i], averaged)
            if node == 0:
                reflectance[f] = _reflectances(materials[i], averaged[0], albedo, below)
            else:
                emissivity[f, node - 1] = 1.0 - (albedo + below * (1.0 - albedo))
    return FresnelTable(row, reflectance, emissivity, start, step)


def _steps(temperatures: tuple[float, float]) -> int:
    """Number of steps of the emissivity's table from the lowest to the highest temperature (K)."""
    low, high = temperatures
    return max(1, math.ceil(math.log(high / low) / _STEP)) if high > low > 0.0 else 1


def bytes_of_fresnel(materials: tuple[Material, ...], temperatures: tuple[float, float], bands: int) -> float:
    """Bytes of the FresnelTable of materials in so many bands. temperatures: see build_fresnel_table."""
    follow = sum(material.follows_fresnel for material in materials)
    return 4.0 * ANGLES * follow * bands * (6 + _steps(temperatures))


def no_fresnel(count: int) -> FresnelTable:
    """The table of so many materials, none of which follows Fresnel's law."""
    nothing = np.empty((0, 4, ANGLES, 1), np.float32)
    return FresnelTable(np.full(count, -1, np.int32), nothing, nothing, 0.0, 1.0)


def in_one_band(table: FresnelTable) -> FresnelTable:
    """The table with one column of reflectance, the mean over the bands."""
    return table._replace(reflectance=table.reflectance.mean(axis=-1, keepdims=True))


def _band_averages(material, edges, kelvin, reference):
    """For each temperature (K): facet_reflectance (ANGLES, b) averaged over each band and 1 - eps (b,), with the excess
    of a blackbody over the reference (K) as weight."""
    inner = material.curve[0]
    points = np.union1d(edges, inner[(inner > edges[0]) & (inner < edges[-1])])
    counts = np.ceil(np.log(points[1:] / points[:-1]) / math.log(_PIECE)).astype(int).clip(1)
    pairs = zip(points[:-1], points[1:], counts, strict=True)
    cuts = np.unique(np.concatenate([np.geomspace(a, b, count + 1) for a, b, count in pairs]))
    cuts[np.searchsorted(cuts, points)] = points
    roots, shares = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * np.diff(cuts)[:, None]
    wavelength, share = (cuts[:-1, None] + half * (1.0 + roots)).ravel(), (half * shares).ravel()
    band = np.searchsorted(edges, wavelength) - 1
    facet = facet_reflectance(material, wavelength, angles())
    normal = 1.0 - np.interp(wavelength, *material.curve)
    first = np.flatnonzero(np.diff(band, prepend=-1))
    for one in kelvin:
        weight = share * _excess_weight(wavelength, float(edges[0]), one, reference)
        total = np.add.reduceat(weight, first)
        averaged = np.add.reduceat(weight[:, None] * facet, first) / total[:, None]
        yield averaged.T, np.add.reduceat(weight * normal, first) / total


def _excess_weight(wavelength, shortest, one, other):
    """Excess of a blackbody at one temperature (K) over the other, as in radiometry.excess_emissivity."""
    cold = min(one, other)
    warm = max(one, other, 1.001 * cold, faintest(shortest))
    return planck(wavelength, warm) - (planck(wavelength, cold) if cold > 0.0 else 0.0)


def _layered(material, averaged):
    """beta (b,), and the lobe's albedo (ANGLES, b), of band averages."""
    facet, normal = averaged
    below = (1.0 - material.specular) * normal / np.maximum(1.0 - facet[-1], 1e-12)
    return below, lobe_matrix(material.alpha) @ facet if material.alpha > 0.0 else facet


def _reflectances(material, facet, albedo, below):
    """(4, ANGLES, b), see FresnelTable."""
    share, through = max(1.0 - material.specular, 1e-12), 1.0 - albedo
    nodes, weights = np.polynomial.legendre.leggauss(4)
    edges = angles()
    cosine = edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (1.0 + nodes)
    weight = np.diff(edges)[:, None] * weights * cosine  # 2 cosine d cosine
    place = np.sqrt(cosine) * (ANGLES - 1.0) - np.arange(ANGLES - 1)[:, None]
    mean = np.einsum(
        "in,inb->b", weight, through[:-1, None] * (1 - place[..., None]) + through[1:, None] * place[..., None]
    )
    entering = np.divide(through, mean, out=np.ones_like(through), where=(mean > 0.0) & (material.specular < 1.0))
    return albedo + below * through, facet / material.specular, below * through / share, entering


@lru_cache(maxsize=64)
def lobe_matrix(alpha: float) -> np.ndarray:
    """(ANGLES, ANGLES) float64: the albedo of a rough lobe at each cosine of the tables is this times the reflectance
    of a single facet at each of them."""
    matrix = np.zeros((ANGLES, ANGLES))
    _fill_lobe_matrix(alpha, _FACETS, matrix)
    return matrix


@njit(cache=True, nogil=True)
def _fill_lobe_matrix(alpha, samples, matrix):
    """As lobes.ggx_albedo, with the weight of each sample laid on the cosines next to that of its facet."""
    for i in range(ANGLES):
        z = max(1e-4, (i / (ANGLES - 1.0)) ** 2)
        x = math.sqrt(max(0.0, 1.0 - z * z))
        for j in range(samples):
            g = 1.0 - (j + 0.5) / samples  # u = 1 - g^2: dense where facets stand steep
            for k in range(samples):
                out, weight = sample_ggx((x, 0.0, z), alpha, 1.0 - g * g, (k + 0.5) / samples)
                column, t = place(math.sqrt(max(0.0, 0.5 * (1.0 + x * out[0] + z * out[2]))))
                weight *= 2.0 * g / (samples * samples)
                matrix[i, column] += (1.0 - t) * weight
                matrix[i, column + 1] += t * weight


@njit(**INLINED)
def place(cosine):
    """Index in the tables of the cosine next below a cosine, and the fraction of the way to the next one."""
    position = math.sqrt(min(1.0, max(0.0, cosine))) * (ANGLES - 1.0)
    i = min(int(position), ANGLES - 2)
    return i, position - i


@njit(**INLINED)
def reflectance_of(table, row, kind, cosine, band):
    """One of the reflectances TOTAL, FACET, BELOW or ENTERING at a cosine, in one band."""
    i, t = place(cosine)
    return (1.0 - t) * table.reflectance[row, kind, i, band] + t * table.reflectance[row, kind, i + 1, band]


@njit(**FAST_INLINED)
def fill_reflectance(table, row, kind, cosine, out):
    """Fill out (b,) with one of the reflectances TOTAL, FACET, BELOW or ENTERING at a cosine."""
    i, t = place(cosine)
    values, t = table.reflectance[row, kind], np.float32(t)
    for b in range(out.size):
        out[b] = values[i, b] + t * (values[i + 1, b] - values[i, b])


@njit(**FAST_INLINED)
def multiply_reflectance(table, row, kind, cosine, out):
    """As fill_reflectance, multiplying out (b,) instead."""
    i, t = place(cosine)
    values, t = table.reflectance[row, kind], np.float32(t)
    for b in range(out.size):
        out[b] *= values[i, b] + t * (values[i + 1, b] - values[i, b])


@njit(**FAST_INLINED)
def fill_emissivity(table, row, kelvin, cosine, out):
    """Fill out (b,) float64 with the emissivity at a temperature, K, and a cosine."""
    (i, t), node, s = place(cosine), 0, 0.0
    if kelvin > 0.0:
        last = table.emissivity.shape[1] - 2
        position = min(max((math.log(kelvin) - table.log_start) / table.log_step, 0.0), float(last))
        node = min(int(position), last - 1)
        s, node = position - node, node + 1
    one, other = table.emissivity[row, node], table.emissivity[row, node + 1]
    for b in range(out.size):
        at_one = one[i, b] + t * (one[i + 1, b] - one[i, b])
        at_other = other[i, b] + t * (other[i + 1, b] - other[i, b])
        out[b] = at_one + s * (at_other - at_one)
