# SPDX-License-Identifier: GPL-3.0-or-later
"""How warm the sky looks, by zenith angle and wavelength, from the weather at the ground.

Published: how much the whole sky radiates. M. Martin and P. Berdahl, Characteristics of infrared sky radiation in the
United States, Solar Energy 33, 321 (1984), found for clear skies, with the dew point D in hundreds of deg C,

    emissivity = 0.711 + 0.56 D + 0.73 D^2

of a sky at the temperature of the air near the ground, the mean of day and night at sea level. A cloud adds, of what
lacks to 1, the product of its cover, its emissivity and exp(-h / 8.2 km) for a base at the height h; its emissivity is
1 below 4 km, 0.74 - 0.084 (h - 4 km) from there to 11 km, and 0.15 above. As in M. Martin and P. Berdahl, Summary of
results from the spectral and angular sky radiation measurement program, Solar Energy 33, 241 (1984), what lacks to 1 in
any direction and at any wavelength falls in proportion to what lacks in total.

Ours: where that radiation comes from. Their tables of spectral factors are not used. An atmosphere of layers is seen
through the narrow bands of water vapour, carbon dioxide and methane (narrow_bands, by Malkmus' law over paths that are
not uniform with mean parameters, after Curtis and Godson; Goody and Yung 1989, Atmospheric Radiation, section 6.4), the
continuum of water vapour (continuum), ozone and haze:

    temperature   falls by 6.5 K/km to 216.65 K, as in the US Standard Atmosphere 1976
    pressure      by e in 8 km
    vapour        its density by e in 2 km
    ozone         0.345 cm at 273 K and 1 atm, all of it at 216.65 K and near 50 hPa; band at 1042 cm-1 of the
                  strength 376 cm-2 atm-1, width 30 cm-1 and one line in 0.1 cm-1 (I. M. Vardavas and F. W. Taylor,
                  Radiation and Climate, 2007, section 4.5); half-width of its lines 0.0046 cm-1, as at that pressure
    haze          grey, vertical optical depth 0.1, falls by e in 1.2 km: chosen so that dry air has in its window what
                  was measured (tests/test_clear_sky.py)

One number is then free, the amount of vapour: it is multiplied until the total is Martin and Berdahl's. In usual
weather the factor is 1.1 to 1.5 (docs/temperatures.md), so the atmosphere is about right without it.

Layers are flat: at the horizon their path has no end, and the sky is as warm as the air. Below it, too: what stands on
the ground, and the ground, are geometry of the scene.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..scene import SceneError
from .constants import C1, C2, SIGMA
from .continuum import water_continuum
from .humidity import FREEZING, saturation_pressure
from .narrow_bands import coefficient_and_overlap
from .spectrum import apparent_temperature, planck

ZENITH = np.array([0, 10, 20, 30, 40, 50, 60, 65, 70, 75, 80, 82.5, 85, 87, 88, 89, 90, 180], float)  # degrees
WAVELENGTHS = np.geomspace(2.0, 30.0, 200)  # um
DEW_POINTS = FREEZING - 38.0, FREEZING + 35.0  # K: Martin and Berdahl's parabola turns below and exceeds 1 above
HOTTEST_AIR = FREEZING + 60.0  # K

_SLANTED = ZENITH < 90.0
_SECANT = 1.0 / np.cos(np.radians(ZENITH[_SLANTED]))[:, None, None]
_WAVENUMBERS = 1e4 / WAVELENGTHS

_HEIGHTS = np.array(
    [0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.3, 1.6, 2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 10, 12, 15, 20, 30]
)
_LAPSE, _TROPOPAUSE = 6.5, 216.65  # K/km; K
_AIR_SCALE, _VAPOUR_SCALE, _HAZE_SCALE = 8.0, 2.0, 1.2  # km
_DRY = {"CO2": 420e-6, "CH4": 1.9e-6}  # mole fractions of today
_HAZE = 0.1
_ATMOSPHERE = 101325.0  # Pa
_OZONE_DEPTH = 0.345 * 376.0 / 30.0  # vertical, at the centre of the band
_OZONE_CENTRE, _OZONE_WIDTH, _OZONE_OVERLAP = 1042.0, 15.0, 0.0046 / 0.1  # cm-1; cm-1; width of lines over spacing
_POINTS = 2001  # of the trapezoidal rule over a band
_FACTORS = 0.02, 50.0  # between which the factor of the vapour is sought


class Layers(NamedTuple):
    """The atmosphere in l layers, the lowest first, at m wavelengths; depths are vertical and of all layers up to each.

    kelvin: (l,). fixed: (a, l, m) optical depths along a slanted ways of all but water vapour. lines: (l, m) optical
    depth of water vapour's lines if they were thin. overlap: (l, m) their half-width over their spacing. by_air,
    by_itself: (l, m) optical depth of its continuum, by collisions with air and with itself. ozone: (a, m)
    transmittance of ozone, above all of them.
    """

    kelvin: np.ndarray
    fixed: np.ndarray
    lines: np.ndarray
    overlap: np.ndarray
    by_air: np.ndarray
    by_itself: np.ndarray
    ozone: np.ndarray

    def radiance(self, factor: float) -> np.ndarray:
        """(a, m) spectral radiance of the sky, W m-2 sr-1 um-1, with `factor` times the vapour."""
        depth = self.fixed + _malkmus(factor * self.lines, self.overlap)
        depth += factor * (self.by_air + factor * self.by_itself) * _SECANT
        left = np.exp(-depth)
        lost = -np.diff(left, axis=1, prepend=1.0)
        below = np.einsum("alm,lm->am", lost, planck(WAVELENGTHS, self.kelvin[:, None]))
        return below + left[:, -1] * (1.0 - self.ozone) * planck(WAVELENGTHS, _TROPOPAUSE)


def clear_sky(
    air: float, dew: float, cover: float = 0.0, base: float = 1000.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Apparent temperatures of the sky: ZENITH (n,) degrees, WAVELENGTHS (m,) um, and (n, m) kelvin, all float64.

    air, dew: temperature of the air near the ground and its dew point, K. cover: of clouds, 0 to 1. base: height of
    their base, m. Raises SceneError if a value makes no sense or is outside of what Martin and Berdahl's law is fit
    for.
    """
    check_weather(air, dew, cover, base)
    layers, factor = _solve(air, dew)
    black, radiance = planck(WAVELENGTHS, air), layers.radiance(factor)
    radiance += cloud_share(cover, base) * (black - radiance)
    kelvin = np.full((len(ZENITH), len(WAVELENGTHS)), float(air))
    kelvin[_SLANTED] = np.minimum(_brightness(radiance), air)  # never above it by rounding
    return ZENITH.copy(), WAVELENGTHS.copy(), kelvin


def band_temperatures(sky: tuple[np.ndarray, np.ndarray, np.ndarray], low: float, high: float) -> np.ndarray:
    """(n,) temperatures, K, of blackbodies that radiate as a sky does between two wavelengths, um, by zenith angle.

    sky: as clear_sky gives it; linear between wavelengths, held constant outside.
    """
    _, wavelengths, kelvin = sky
    fine = np.linspace(low, high, _POINTS)
    radiance = [_integral(planck(fine, np.interp(fine, wavelengths, row)), fine) for row in kelvin]
    return apparent_temperature(np.array(radiance), np.array([low, high]))


def vapour_factor(air: float, dew: float) -> float:
    """By how much the vapour is multiplied so that the sky radiates what Martin and Berdahl found; see clear_sky."""
    check_weather(air, dew, 0.0, 0.0)
    return _solve(air, dew)[1]


def sky_emissivity(dew: float, cover: float = 0.0, base: float = 1000.0) -> float:
    """What a horizontal surface receives from the sky, over what a blackbody of the air's temperature radiates (Martin
    and Berdahl 1984). Arguments: see clear_sky."""
    hundreds = (dew - FREEZING) / 100.0
    clear = 0.711 + 0.56 * hundreds + 0.73 * hundreds**2
    return clear + (1.0 - clear) * cloud_share(cover, base)


def cloud_share(cover: float, base: float) -> float:
    """Share of what lacks a clear sky to a blackbody that clouds add. cover: 0 to 1. base: m."""
    return cover * cloud_emissivity(base) * math.exp(-base / 8200.0)


def cloud_emissivity(base: float) -> float:
    """Emissivity of a cloud by the height of its base, m."""
    kilometres = base / 1000.0
    if kilometres < 4.0:
        return 1.0
    return 0.74 - 0.084 * (kilometres - 4.0) if kilometres <= 11.0 else 0.15


def _solve(air: float, dew: float) -> tuple[Layers, float]:
    """The atmosphere, and the factor of its vapour with which it radiates as Martin and Berdahl found."""
    layers, wanted = _layers(air, dew), sky_emissivity(dew)
    low, high = np.log(_FACTORS)
    for _ in range(40):
        middle = 0.5 * (low + high)
        if _total(layers.radiance(math.exp(middle)), air) < wanted:
            low = middle
        else:
            high = middle
    return layers, math.exp(middle)


def check_weather(air: float, dew: float, cover: float, base: float) -> None:
    """Raise SceneError if a sky of this weather cannot be told. Arguments: see clear_sky."""
    coldest, wettest = DEW_POINTS
    if not coldest <= dew <= wettest:
        raise SceneError(
            f"Clear sky: dew point {dew:g} K; Martin and Berdahl's law is for {coldest:g} to {wettest:g} K"
        )
    if not dew <= air:
        raise SceneError(f"Clear sky: dew point {dew:g} K above the air temperature {air:g} K")
    if not air <= HOTTEST_AIR:
        raise SceneError(f"Clear sky: air temperature {air:g} K; at most {HOTTEST_AIR:g} K are possible")
    if not 0.0 <= cover <= 1.0:
        raise SceneError(f"Clear sky: cloud cover {cover:g}; it is 0 to 1")
    if not 0.0 <= base <= 20000.0:
        raise SceneError(f"Clear sky: cloud base {base:g} m; it is 0 to 20000 m high")


def _layers(air: float, dew: float) -> Layers:
    """The Layers over air of a temperature and a dew point, K."""
    thick, middle = 1000.0 * np.diff(_HEIGHTS), 0.5 * (_HEIGHTS[1:] + _HEIGHTS[:-1])
    kelvin = np.maximum(air - _LAPSE * middle, _TROPOPAUSE)
    atm = np.exp(-middle / _AIR_SCALE)
    vapour = saturation_pressure(dew) / _ATMOSPHERE * np.exp(-middle / _VAPOUR_SCALE) * kelvin / air / atm
    parts = {name: ([], []) for name in ("H2O", *_DRY)}  # optical depth and overlap of each layer
    by_air, by_itself = [], []
    for metres, T, pressure, fraction in zip(thick, kelvin, atm, vapour, strict=True):
        mixture = {"H2O": float(fraction), **_DRY}
        for name, (depth, overlap) in parts.items():
            mean, ratio = coefficient_and_overlap(name, _WAVENUMBERS, np.array([T]), pressure, mixture)
            depth.append(mean[0] * mixture[name] * metres)
            overlap.append(ratio[0])
        pure, mixed = (water_continuum(_WAVENUMBERS, T, pressure, each) * fraction * metres for each in (0.0, fraction))
        by_air.append(pure)
        by_itself.append(mixed - pure)
    fixed = _HAZE * -np.expm1(-_HEIGHTS[1:, None] / _HAZE_SCALE) * _SECANT
    for name in _DRY:
        fixed = fixed + _malkmus(*_curtis_godson(*parts[name]))
    water = _curtis_godson(*parts["H2O"])
    return Layers(kelvin, fixed, *water, np.cumsum(by_air, axis=0), np.cumsum(by_itself, axis=0), _ozone())


def _curtis_godson(depth: list, overlap: list) -> tuple[np.ndarray, np.ndarray]:
    """Optical depth and overlap (l, m) of all layers up to each, from those of the single layers."""
    depth, overlap = np.array(depth), np.array(overlap)
    total = np.cumsum(depth, axis=0)
    return total, np.divide(np.cumsum(depth * overlap, axis=0), total, out=np.ones_like(total), where=total > 0)


def _malkmus(depth: np.ndarray, overlap: np.ndarray) -> np.ndarray:
    """(a, l, m) optical depth of narrow bands along slanted ways, of which the vertical ones are (l, m)."""
    return 2.0 * overlap * (np.sqrt(1.0 + depth * _SECANT / overlap) - 1.0)


def _ozone() -> np.ndarray:
    """(a, m) transmittance of all ozone; a band whose strength falls by e over its half width, on either side."""
    depth = _OZONE_DEPTH * np.exp(-np.abs(_WAVENUMBERS - _OZONE_CENTRE) / _OZONE_WIDTH)
    return np.exp(-_malkmus(depth[None], np.full((1, 1), _OZONE_OVERLAP))[:, 0])


def _integral(values: np.ndarray, places: np.ndarray) -> float:
    """By the trapezoidal rule, of values (n,) at places (n,). NumPy's function has another name before 2.0."""
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(places)))


def _total(radiance: np.ndarray, air: float) -> float:
    """Emissivity of the whole sky from its spectral radiance (a, m). Beyond the last wavelength it is as warm as there,
    as tables go on; little is before the first one."""
    received = _hemisphere(np.vstack((radiance, planck(WAVELENGTHS, air))))
    last = float(_brightness(received)[-1])
    beyond = SIGMA * last**4 / math.pi - _integral(planck(WAVELENGTHS, last), WAVELENGTHS)
    return (_integral(received, WAVELENGTHS) + beyond) / (SIGMA * air**4 / math.pi)


def _hemisphere(radiance: np.ndarray) -> np.ndarray:
    """(m,) what a horizontal surface receives, over pi, of radiance (n, m) at zenith angles from 0 to 90 degrees: the
    integral of it with sin(2 z), exact where it is linear between them."""
    angle = np.radians(ZENITH[ZENITH <= 90.0])
    slopes = np.diff(-0.25 * np.sin(2.0 * angle)) / np.diff(angle)
    return np.diff(slopes, prepend=-0.5, append=0.5) @ radiance


def _brightness(radiance: np.ndarray) -> np.ndarray:
    """Temperature, K, of a blackbody of a spectral radiance (a, m) at WAVELENGTHS."""
    return C2 / (WAVELENGTHS * np.log1p(C1 / (WAVELENGTHS**5 * radiance)))
