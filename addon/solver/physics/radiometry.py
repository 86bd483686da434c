# SPDX-License-Identifier: GPL-3.0-or-later
"""What surfaces emit and reflect in each band, as tables for the kernels.

Radiance here is integrated over each band (W m-2 sr-1), and in excess of the reference: with a reference temperature T0
the solver traces dL = L - B(T0). In these terms a surface emits e(T) - e(T0) (docs/method.md).
"""

import math
from typing import NamedTuple

import numpy as np

from ..scene import Material, Texture
from ..system.kernels import FAST_INLINED, INLINED, njit
from .fresnel import FresnelTable, build_fresnel_table, fill_emissivity, no_fresnel
from .lobes import LobeTable, build_lobe_table, emitted_complement
from .spectrum import band_emissivity, band_radiance, faintest

# Step in ln T of the emission table: cubic Hermite errs by (step x)^4 / 384 with x = c2 / (lambda T), 4e-8 at x = 16.
_LOG_STEP = 0.004
COLDEST = 1.0  # K, see emission_range
_ALMOST = 1.0 - 2.0**-20  # largest mean transmittance of what is there at all
NONE, STRAIGHT, ALL = range(3)  # which photons a material stores, each more than the one before, see stored_photons


class Radiometry(NamedTuple):
    """Materials (m of them) in b bands.

    reflectance: (m, b) float32, 1 - eps - tau, with eps and tau averaged with what arrives as weight, see
        excess_emissivity. transmittance: (m, b) float32, tau, of thin sheets.
    stores: (m,) uint8, see stored_photons.
    lobes: into which directions each material reflects, see lobes.
    fresnel: how much, and what is emitted, at each angle, for materials that follow Fresnel's law.
    emission: (m + n + 1, t, b) float64, integral of eps B at the table's temperatures, and of (1 - tau) B for n rough
        sheets; the last row is a blackbody. full: (m,) int32, row of what a material emits if it reflects nothing.
    slope: the same, d/d(ln T) times the step.
    log_start: ln of the first temperature. base: (m + n + 1, b) float64, integral of eps B at T0, or zeros.
    reference: (b,) float64, last row of base: B(T0). quiet: T0, K: surfaces at exactly this temperature have no excess.
    """

    reflectance: np.ndarray
    transmittance: np.ndarray
    stores: np.ndarray
    lobes: LobeTable
    fresnel: FresnelTable
    emission: np.ndarray
    slope: np.ndarray
    full: np.ndarray
    log_start: float
    base: np.ndarray
    reference: np.ndarray
    quiet: float


def stored_photons(materials: tuple[Material, ...], edges: np.ndarray) -> np.ndarray:
    """(materials,) uint8, which photons each material stores. NONE: it is a mirror, or reflects nothing between the
    first and the last edge (um). STRAIGHT: it has nothing but a rough lobe, and stores photons straight from lights.
    Else ALL."""
    stores = np.full(len(materials), ALL, np.uint8)
    for i, material in enumerate(materials):
        um, kept = _not_reflected(material)
        ends = np.interp(edges[[0, -1]], um, kept)
        inside = kept[(um > edges[0]) & (um < edges[-1])]
        if min(*ends, *inside) == 1.0:
            stores[i] = NONE
        elif np.float32(material.specular) == 1.0:
            stores[i] = STRAIGHT if material.alpha > 0.0 else NONE
    return stores


def build_radiometry(
    materials: tuple[Material, ...],
    edges: np.ndarray,
    temperatures: tuple[float, float],
    weighting: float,
    reference: float,
) -> Radiometry:
    """Tables of the materials over bands.

    temperatures: lowest (above 0) and highest temperature of any surface, K.
    weighting: K, temperature of what lights the surfaces: its excess over the reference averages reflectance in a band.
    reference: T0 in K, 0 for no subtraction.
    """
    low, high = temperatures
    nodes = table_rows(temperatures)
    log_start = math.log(low) if high > 0 else 0.0
    table = np.exp(log_start + _LOG_STEP * np.arange(nodes))
    rough = [i for i, material in enumerate(materials) if material.transmits and material.alpha > 0.0]
    curves = [material.curve for material in materials]
    curves += [_complement(materials[i].transmitted_curve) for i in rough]
    emission = np.empty((len(curves) + 1, nodes, len(edges) - 1))
    slope = np.empty_like(emission)
    black, black_slope = band_radiance(edges, table), band_radiance(edges, table, derivative=True)
    emission[-1], slope[-1] = black, black_slope * _LOG_STEP
    base = np.tile(reference_radiance(edges, reference), (len(curves) + 1, 1))
    for i, curve in enumerate(curves):
        if len(curve[0]) == 1:
            emission[i], slope[i] = curve[1][0] * emission[-1], curve[1][0] * slope[-1]
            base[i] *= curve[1][0]
        else:
            emission[i] = band_radiance(edges, table, curve)
            slope[i] = band_radiance(edges, table, curve, derivative=True) * _LOG_STEP
            base[i] *= band_emissivity(edges, reference, curve)
    full = np.full(len(materials), len(curves), np.int32)
    full[rough] = len(materials) + np.arange(len(rough))

    def averaged(curve) -> np.ndarray:
        grey = np.full(len(edges) - 1, curve[1][0])
        return grey if len(curve[0]) == 1 else excess_emissivity(edges, weighting, reference, curve)

    reflectance = np.array([1.0 - averaged(_not_reflected(material)) for material in materials])
    transmittance = np.array([averaged(material.transmitted_curve) for material in materials])
    return Radiometry(
        reflectance=np.clip(reflectance, 0.0, 1.0).astype(np.float32),
        transmittance=np.clip(transmittance, 0.0, 1.0).astype(np.float32),
        stores=stored_photons(materials, edges),
        lobes=build_lobe_table(materials),
        fresnel=build_fresnel_table(materials, edges, temperatures, weighting, reference),
        emission=emission,
        slope=slope,
        full=full,
        log_start=log_start,
        base=base,
        reference=base[-1],
        quiet=reference,
    )


def _not_reflected(material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,) um and emissivity and transmittance together, (n,)."""
    (um, emitted), (other, passed) = material.curve, material.transmitted_curve
    if not material.transmits:
        return um, emitted
    if len(um) == len(other) == 1:
        return um, emitted + passed
    both = np.union1d(um, other)
    return both, np.interp(both, um, emitted) + np.interp(both, other, passed)


def _complement(curve: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return curve[0], 1.0 - curve[1]


def mean_transmittance(materials: tuple[Material, ...], edges: np.ndarray) -> np.ndarray:
    """(m,) float64 mean transmittance of materials between the first and the last edge (um), 1 only where it is 1 at
    all wavelengths."""
    um = np.unique(np.concatenate([edges, *(material.transmitted_curve[0] for material in materials)]))
    um = um[(um >= edges[0]) & (um <= edges[-1])]
    values = np.array([np.interp(um, *material.transmitted_curve) for material in materials])
    whole = np.sum(np.diff(um) * (values[:, 1:] + values[:, :-1]) / 2.0, axis=1) / (um[-1] - um[0])
    return np.where(values.min(axis=1) >= 1.0, 1.0, np.minimum(whole, _ALMOST))


def grey_radiometry(
    materials: tuple[Material, ...], emissivity: np.ndarray, fresnel: FresnelTable | None = None
) -> Radiometry:
    """Tables of one band in which each material has one emissivity (m,) and nothing emits: for the pilot's paths.

    Before the reference temperature is chosen nothing more is known, and it suffices for the throughput of a path.
    fresnel: of one band; None where no material follows Fresnel's law.
    """
    nothing = np.zeros((len(materials) + 1, 2, 1))
    return Radiometry(
        reflectance=(1.0 - emissivity)[:, None],
        transmittance=np.zeros((len(materials), 1)),
        stores=np.full(len(materials), ALL, np.uint8),
        lobes=build_lobe_table(materials),
        fresnel=no_fresnel(len(materials)) if fresnel is None else fresnel,
        emission=nothing,
        slope=nothing,
        full=np.full(len(materials), len(materials), np.int32),
        log_start=0.0,
        base=np.zeros((len(materials) + 1, 1)),
        reference=nothing[-1, 0],
        quiet=0.0,
    )


def table_rows(temperatures: tuple[float, float]) -> int:
    """Number t of temperatures in the emission table. temperatures: lowest and highest of any surface, K (see
    emission_range)."""
    low, high = temperatures
    return max(2, math.ceil(math.log(high / low) / _LOG_STEP) + 2) if high > 0 else 2


def reference_radiance(edges: np.ndarray, temperature: float) -> np.ndarray:
    """(b,) float64 B(T0) of each band, W m-2 sr-1, rounded to float32. Where a ray sees 0 K, an image holds -B(T0) in
    float32: adding B(T0) must then give exactly 0.
    """
    return band_radiance(edges, temperature).astype(np.float32).astype(np.float64)


def excess_emissivity(edges: np.ndarray, one: float, other: float, curve: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(b,) emissivity of each band, weighted with the excess of a blackbody at one temperature (K) over the other.

    (e(T1) - e(T0)) / (B(T1) - B(T0)), see docs/bands.md. Temperatures that are equal to 0.1 % are moved apart, so that
    this is nearly the ratio of the derivatives.
    """
    cold = min(one, other)
    kelvin = np.array([cold, max(one, other, 1.001 * cold, faintest(float(edges[0])))])
    emitted, black = band_radiance(edges, kelvin, curve), band_radiance(edges, kelvin)
    return (emitted[1] - emitted[0]) / (black[1] - black[0])


@njit(**INLINED)
def absolute_sum(value):
    """Sum over the bands of the absolute values of a radiance, a power or a weight (b,), float64."""
    total = 0.0
    for b in range(value.size):
        total += abs(value[b])
    return total


@njit(inline="always")
def locate(radiometry, temperature):
    """Row of the emission table below a temperature, and the fraction of the way to the next row, 0..1. Row -1 for
    temperatures far below the table."""
    if temperature <= 0.0:
        return -1, 0.0
    position = (math.log(temperature) - radiometry.log_start) / _LOG_STEP
    if position < -0.5:  # the table reaches to the coldest surface, but for rounding: see emission_range
        return -1, 0.0
    row = min(max(math.floor(position), 0), radiometry.emission.shape[1] - 2)
    return row, position - row


@njit(**FAST_INLINED)
def excess(radiometry, material, temperature, cosine, out):
    """Fill out (b,) with the radiance that a surface emits at a cosine, in excess of the radiance at T0, W m-2 sr-1.

    What lobes lose at grazing angles is emitted: eps(theta) = eps + rho times the loss (see lobes).
    """
    if temperature == radiometry.quiet:
        out[:] = 0.0
        return
    (row, t), full = locate(radiometry, temperature), radiometry.full[material]
    angular = radiometry.fresnel.row[material]
    if angular >= 0:
        fill_emissivity(radiometry.fresnel, angular, temperature, cosine, out)
        _times_black_excess(radiometry, row, t, out)
        return
    h0 = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t)
    h1 = t * t * (3.0 - 2.0 * t)
    d0 = t * (1.0 - t) * (1.0 - t)
    d1 = t * t * (t - 1.0)
    lost = emitted_complement(radiometry.lobes, material, cosine)
    e, s = radiometry.emission, radiometry.slope
    for b in range(out.size):
        value = -radiometry.base[material, b]
        if row >= 0:
            value += h0 * e[material, row, b] + h1 * e[material, row + 1, b]
            value += d0 * s[material, row, b] + d1 * s[material, row + 1, b]
        if lost > 0.0:
            extra = radiometry.base[material, b] - radiometry.base[full, b]
            if row >= 0:
                extra += h0 * (e[full, row, b] - e[material, row, b]) + h1 * (
                    e[full, row + 1, b] - e[material, row + 1, b]
                )
                extra += d0 * (s[full, row, b] - s[material, row, b]) + d1 * (
                    s[full, row + 1, b] - s[material, row + 1, b]
                )
            value += lost * extra
        out[b] = value


@njit(**FAST_INLINED)
def _times_black_excess(radiometry, row, t, out):
    """Multiply out (b,) by the radiance of a blackbody in excess of that at T0. row, t: see locate."""
    black = radiometry.emission.shape[0] - 1
    e, s = radiometry.emission[black], radiometry.slope[black]
    h0, h1 = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t), t * t * (3.0 - 2.0 * t)
    d0, d1 = t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0)
    for b in range(out.size):
        value = -radiometry.base[black, b]
        if row >= 0:
            value += h0 * e[row, b] + h1 * e[row + 1, b] + d0 * s[row, b] + d1 * s[row + 1, b]
        out[b] *= value


def typical_emissivity(materials: tuple[Material, ...], edges: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """(m, b) emissivity of each material in each band, weighted at the mean of the surfaces' temperatures (K)."""
    kelvin = float(temperature.mean(dtype=np.float64))
    found = np.array([band_emissivity(edges, kelvin, material.curve) for material in materials])
    return np.clip(found, 0.0, 1.0)  # a quadrature of a curve that is 1 may give 1 + 2e-16


def emission_range(temperature: np.ndarray, images: tuple[Texture, ...] = ()) -> tuple[float, float]:
    """Lowest temperature above 0 K and highest temperature of an array and of images, K: the emission table must reach
    from one to the other.

    Where the temperature varies over a triangle from below COLDEST on, the lowest is COLDEST, below which no band holds
    radiance to speak of: at 1 K and 1 mm x = c2 / (lambda T) is 14, and it grows with 1 / T.
    """
    every = [temperature, *(image.values for image in images)]
    low, high = min(float(values.min()) for values in every), max(float(values.max()) for values in every)
    if low < COLDEST <= high:
        runs = temperature.shape[-1] > 1 or len(images) > 0
        low = COLDEST if runs else float(temperature[temperature >= COLDEST].min())
    elif low == 0.0 < high:
        low = min(float(values[values > 0.0].min(initial=high)) for values in every)
    return low, high
