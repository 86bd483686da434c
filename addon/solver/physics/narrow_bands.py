# SPDX-License-Identifier: GPL-3.0-or-later
"""Narrow bands of molecules: how strongly each absorbs, how close its lines lie and how wide they are.

A narrow band, some cm-1 wide, holds many lines at random. Its mean absorption coefficient and the ratio of the lines'
half-width to their spacing say what it lets through (see molecules). Both are RADCAL's, software of the National
Institute of Standards and Technology (Grosshandler 1993, NIST Technical Note 1402), which has them from the Handbook of
Infrared Radiation from Combustion Gases (Ludwig, Malkmus, Reardon and Thomson 1973, NASA SP-3080):

    H2O     table, 50 to 9300 cm-1
    CO2     table at 15 um; at 4.3 and 2.7 um sums over the vibrational states of a rotating oscillator (Malkmus 1963
            and 1964, J. Opt. Soc. Am. 53, 951, and 54, 751), at 10 and 2 um just-overlapping lines (Penner 1959)
    CO      such a sum (Malkmus and Thomson 1962, JQSRT 2, 17)
    CH4     tables at 7.7 and 3.3 um (Brosmer and Tien 1985, JQSRT 33, 521); 2.4 um by Gray and Penner 1965

The tables stand in narrow_bands.csv. Wavenumbers are in cm-1 in here, pressures in atm, as in all of these.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

TABLES_FILE = Path(__file__).with_name("narrow_bands.csv")
KELVIN = np.arange(300.0, 2501.0, 25.0)  # temperatures of the data; the nearest counts outside
_C2 = 1.4388  # cm K, as RADCAL has it
_COLD = 300.0  # K, at which strengths of whole bands are given
_STP = 273.0  # K, at whose density coefficients are given
COLDEST = 200.0  # K: molecules do not get denser below

# Half-widths of lines at 273 K and 1 atm, cm-1, by what they collide with; "itself" is the resonant part, which falls
# as 1 / T, the others as T^-1/2 (NASA SP-3080, table 5-18). CH4's is a mean of its air-broadened lines.
_AIR = {"N2": 0.79, "O2": 0.21}  # what is left of a mixture
_WIDTHS = {
    "H2O": {"CO2": 0.12, "H2O": 0.09, "CO": 0.10, "O2": 0.04, "N2": 0.09, "CH4": 0.09, "itself": 0.44},
    "CO2": {"CO2": 0.09, "H2O": 0.07, "CO": 0.06, "O2": 0.055, "N2": 0.07, "CH4": 0.07, "itself": 0.01},
    "CO": {"CO2": 0.07, "H2O": 0.06, "CO": 0.06, "O2": 0.05, "N2": 0.06, "CH4": 0.06, "itself": 0.0},
    "CH4": {"CO2": 0.06, "H2O": 0.06, "CO": 0.06, "O2": 0.06, "N2": 0.06, "CH4": 0.078, "itself": 0.0},
}
_MASSES = {"H2O": 18.0, "CO2": 44.0, "CO": 28.0, "CH4": 16.04}  # g / mol


class Lines(NamedTuple):
    """Narrow bands of one molecule, at temperatures KELVIN (t,) and wavenumbers first, first + step, ... (n,).

    strength: (t, n) mean absorption coefficient, cm-1 atm-1 at 273 K and 1 atm. density: (t, n) lines in a cm-1, cm.
    """

    first: float
    step: float
    strength: np.ndarray
    density: np.ndarray


@cache
def lines(species: str) -> Lines:
    """The Lines of a molecule, made when they are first needed."""
    return {"H2O": _water, "CO2": _carbon_dioxide, "CO": _carbon_monoxide, "CH4": _methane}[species]()


def strength_and_density(species: str, wavenumber: np.ndarray, kelvin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strength and line density of Lines, (t,) + s each. wavenumber: shape s, cm-1. kelvin: (t,).

    Linear in both, as RADCAL does it. A molecule has no strength outside its wavenumbers.
    """
    of = lines(species)
    row, low = _position((np.clip(kelvin, KELVIN[0], KELVIN[-1]) - KELVIN[0]) / (KELVIN[1] - KELVIN[0]), len(KELVIN))
    column, left = _position((wavenumber - of.first) / of.step, of.strength.shape[1])
    inside = (left >= 0.0) & (left <= 1.0)
    column, left = column.ravel(), np.clip(left, 0.0, 1.0).ravel()
    shape = np.shape(kelvin) + np.shape(wavenumber)

    def between(table: np.ndarray) -> np.ndarray:
        rows = table[row] * (1.0 - low[:, None]) + table[row + 1] * low[:, None]
        return (rows[:, column] * (1.0 - left) + rows[:, column + 1] * left).reshape(shape)

    return np.where(inside, between(of.strength), 0.0), between(of.density)


def half_width(
    species: str, wavenumber: np.ndarray, kelvin: np.ndarray, atm: float, mixture: Mapping[str, float]
) -> np.ndarray:
    """(t,) + s mean half-width at half height of the lines of a molecule, cm-1, by collisions and Doppler's effect.

    mixture: mole fractions; what they leave is air. Both kinds together by Olivero and Longbothum 1977, JQSRT 17, 233.
    """
    molecules = {name: fraction for name, fraction in mixture.items() if name in _MASSES}
    rest = 1.0 - sum(molecules.values())
    parts = molecules | {name: share * rest for name, share in _AIR.items()}
    of = _WIDTHS[species]
    ratio = _STP / np.asarray(kelvin, float).reshape(-1, *[1] * np.ndim(wavenumber))
    foreign = sum(of[name] * fraction for name, fraction in parts.items())
    collision = atm * (foreign * np.sqrt(ratio) + of["itself"] * mixture.get(species, 0.0) * ratio)
    doppler = 5.94e-6 * wavenumber / np.sqrt(ratio * _MASSES[species])
    return 0.5346 * collision + np.sqrt(0.2166 * collision**2 + doppler**2)


def coefficient_and_overlap(
    species: str, wavenumber: np.ndarray, kelvin: np.ndarray, atm: float, mixture: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """What Malkmus' law asks of a narrow band, (t,) + s each: mean absorption coefficient per unit of mole fraction,
    1/m, and the half-width of lines over their spacing. kelvin: (t,), at least COLDEST. Others: see half_width."""
    strength, density = strength_and_density(species, wavenumber, kelvin)
    column = np.reshape(kelvin, (-1, *[1] * np.ndim(wavenumber)))
    mean = 100.0 * strength * (_STP / column) * atm  # 1/m for 1/cm
    return mean, half_width(species, wavenumber, kelvin, atm, mixture) * density


def _position(x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Index of the point below x among points 0, 1, ... count - 1, and the distance to it: 0 to 1 between the points,
    else outside of that."""
    below = np.clip(np.floor(x), 0, count - 2).astype(np.int64)
    return below, x - below


@cache
def _tables() -> dict[str, dict[float, tuple[list[float], list[float]]]]:
    """By species and wavenumber: temperatures and coefficients."""
    tables: dict = {}
    with TABLES_FILE.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(line for line in file if not line.startswith("#"))
        next(rows)
        for species, *numbers in rows:
            wavenumber, kelvin, coefficient = map(float, numbers)
            points = tables.setdefault(species, {}).setdefault(wavenumber, ([], []))
            points[0].append(kelvin)
            points[1].append(coefficient)
    return tables


def _tabulated(species: str, wavenumber: np.ndarray) -> np.ndarray:
    """(t, n) strength at KELVIN from the table, 0 where it has no row. Linear between its temperatures."""
    table, strength = _tables()[species], np.zeros((len(KELVIN), len(wavenumber)))
    for column, at in enumerate(wavenumber.tolist()):
        if at in table:
            strength[:, column] = np.interp(KELVIN, *table[at])
    return strength


def _water() -> Lines:
    wavenumber = np.arange(50.0, 9301.0, 25.0)
    T = KELVIN[:, None]
    density = np.exp(0.7941 * np.sin(0.0036 * wavenumber - 8.043) - 2.294 + 3.004e-3 * T - 3.66e-7 * T**2)
    return Lines(50.0, 25.0, _tabulated("H2O", wavenumber), density)


def _methane() -> Lines:
    """Methane's lines lie at equal distances. Alone, such lines take as much light as random ones that are 4 / pi times
    as dense (Elsasser's model against Malkmus's)."""
    wavenumber = np.arange(1150.0, 5001.0, 25.0)
    strength, T = _tabulated("CH4", wavenumber), KELVIN[:, None]
    hot = T / _STP
    # width over spacing at 1 atm by Brosmer and Tien, over the width in air
    density = np.where(wavenumber < 2000.0, 0.0243 * hot**0.8, 0.00734 * np.exp(1.02 * (hot - 1.0)) / np.sqrt(hot))
    density = density / (0.06 / np.sqrt(hot))
    short = wavenumber >= 3400.0
    strength[:, short] = _methane_overtones(wavenumber[short])
    density[:, short] = 1.0 / 5.74
    return Lines(1150.0, 25.0, strength, 4.0 / math.pi * density)


def _methane_overtones(wavenumber: np.ndarray) -> np.ndarray:
    """(t, n) strength at 2.4 um: four combinations of the fundamentals (Gray and Penner 1965, eq. 6)."""
    fundamentals, T = np.array([2914.2, 1526.0, 3020.3, 1306.2]), KELVIN[:, None]
    rotation, spacing = 5.248, 5.74
    width = _C2 * rotation / (T * spacing**2)
    total = 0.0
    for area, quanta in ((0.64, (0, 1, 0, 2)), (17.6, (1, 0, 0, 1)), (14.8, (0, 0, 1, 1)), (5.04, (0, 1, 1, 0))):
        centre = float(fundamentals @ quanta)
        states = np.prod((1.0 - np.exp(-_C2 * fundamentals / T)) ** quanta, axis=1, keepdims=True)
        area = area * (1.0 - np.exp(-_C2 * centre / T)) / states
        away = (wavenumber - centre) ** 2
        total = total + area * 2.0 / math.sqrt(math.pi) * width**1.5 * away * np.exp(-width * away)
    return total


class _Oscillator(NamedTuple):
    """One vibration-rotation band. area: integrated strength at 300 K, cm-2 atm-1. rotation, coupling: constants B and
    alpha of the molecule, cm-1. unpopulated: 1 over the partition function of its vibrations, as a function of T.
    states: of each lower state its energy, cm-1, its weight, how many lines coincide, B - alpha (v + 1) and the centre
    of its band, cm-1."""

    area: float
    rotation: float
    coupling: float
    unpopulated: Callable[[np.ndarray | float], np.ndarray | float]
    states: list[tuple[float, float, float, float, float]]


def _sum_over_states(band: _Oscillator, wavenumber: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(t, n) the sums over S / d and over sqrt(S) / d of an oscillator's lines, S the strength of a line and d the
    spacing in its series. The first is the mean coefficient; the square of the second over it is the density of equal
    lines in place of these (NASA SP-3080, section 5).

    The line of either branch at a wavenumber follows from the band's parabola (Fortrat's), without a sum over J.
    """
    T = KELVIN[:, None]
    scale = band.area * band.rotation * _C2 / band.coupling / band.unpopulated(_COLD)
    scale = scale * band.unpopulated(T) * (1.0 - np.exp(-_C2 * wavenumber / T)) * wavenumber * _COLD / T**2
    weak, strong = np.zeros_like(scale), np.zeros_like(scale)
    for energy, weight, coincide, gamma, centre in band.states:
        delta = band.coupling * (wavenumber - centre)
        spacing = 2.0 * np.sqrt(np.maximum(gamma**2 - delta, 0.0))  # 0 at the head of the band, beyond it no line
        exists = spacing > 1e-6
        spacing = np.where(exists, spacing, 1.0)
        steep = _C2 * gamma / (band.coupling**2 * T)
        factor = scale * weight * np.exp(-energy * _C2 / T) / (centre * (1.0 - np.exp(-_C2 * centre / T)))
        for root in (gamma - 0.5 * spacing, gamma + 0.5 * spacing):
            exponent = steep * (delta * (1.0 + 0.5 * band.coupling / gamma) - 2.0 * gamma * root)
            line = np.where(exists, factor * np.abs(root) * np.exp(np.minimum(exponent, 50.0)), 0.0)
            weak += line / spacing
            strong += np.sqrt(coincide * line) / spacing
    return weak, strong


def _strength_and_density(weak: np.ndarray, strong: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Strength and density of Lines from _sum_over_states; coefficients at 273 K instead of T."""
    density = np.divide(strong**2, weak, out=np.ones_like(weak), where=weak > 1e-30)
    return weak * KELVIN[:, None] / _STP, density


def _carbon_monoxide() -> Lines:
    wavenumber = np.arange(1600.0, 2401.0, 5.0)
    omega, anharmonic, cubic = 2170.21, 13.461, 0.0308
    rotation, coupling = 1.93139, 0.017485
    fundamental = omega - 2.0 * anharmonic + 3.25 * cubic
    states = []
    for v in range(1, 21):  # of the upper state
        centre = omega - 2.0 * v * anharmonic + (3.0 * v * v + 0.25) * cubic
        states.append(((v - 1) * omega, v, 1.0, rotation - coupling * v, centre))

    def unpopulated(T):
        return (1.0 - np.exp(-_C2 * fundamental / T)) ** 2

    sums = _sum_over_states(_Oscillator(260.0, rotation, coupling, unpopulated, states), wavenumber)
    return Lines(1600.0, 5.0, *_strength_and_density(*sums))


# CO2: fundamentals, the mean quantum of stretching and bending, anharmonicities, rotation, all cm-1
_OMEGA = 1354.91, 673.0, 2396.49
_OMEGA_12 = 0.5 * (0.5 * _OMEGA[0] + _OMEGA[1])
_X13, _X23, _X33 = -19.37, -12.53, -12.63
_ROTATION, _COUPLING = 0.391635, 0.0030875


def _carbon_dioxide() -> Lines:
    wavenumber = np.arange(500.0, 5726.0, 5.0)
    strength, density = np.zeros((len(KELVIN), len(wavenumber))), np.ones((len(KELVIN), len(wavenumber)))
    below = wavenumber <= 880.0  # 15 um
    strength[:, below] = _tabulated("CO2", wavenumber[below])
    density[:, below] = _bending_density(KELVIN)[:, None]
    ten = (wavenumber > 880.0) & (wavenumber <= 1100.0)
    strength[:, ten], density[:, ten] = _ten_micrometres(wavenumber[ten]), 1.0 / (4.0 * _ROTATION)
    stretching = (wavenumber > 1975.0) & (wavenumber <= 2474.0)  # 4.3 um
    sums = _sum_over_states(_stretching(), wavenumber[stretching])
    strength[:, stretching], density[:, stretching] = _strength_and_density(*sums)
    combined = (wavenumber > 3050.0) & (wavenumber <= 3800.0)  # 2.7 um
    sums = [_sum_over_states(band, wavenumber[combined]) for band in _combinations()]
    strength[:, combined], density[:, combined] = _strength_and_density(*np.sum(sums, axis=0))
    two = wavenumber > 4550.0
    strength[:, two], density[:, two] = _two_micrometres(wavenumber[two]), 1.0 / (4.0 * _ROTATION)
    return Lines(500.0, 5.0, strength, density)


def _bending_density(kelvin: np.ndarray) -> np.ndarray:
    """(t,) density of lines at 15 um: a parabola through three temperatures."""
    return np.polyval(np.polyfit((300.0, 550.0, 830.0), (1.2, 8.0, 30.0), 2), kelvin)


def _just_overlapping(area: np.ndarray, centre: float, wavenumber: np.ndarray) -> np.ndarray:
    """(t, n) coefficient of a band whose lines just overlap (Penner 1959, eq. 11-44). area: (t, 1) cm-2 atm-1."""
    slope = _C2 / (4.0 * _ROTATION * KELVIN[:, None])
    away = wavenumber - centre
    return area * slope * np.abs(away) * np.exp(-slope * away**2)


def _ten_micrometres(wavenumber: np.ndarray) -> np.ndarray:
    """(t, n) strength of the two hot bands that lasers use, from states (100) and (020) to (001)."""
    T, upper = KELVIN[:, None], _OMEGA[2]
    lower = 0.5 * (_OMEGA[0] + 2.0 * _OMEGA[1])
    populated = np.exp(_C2 * lower * (1.0 / _COLD - 1.0 / T)) * (1.0 - np.exp(-_C2 * (upper - lower) / T))
    populated = populated / ((1.0 - np.exp(-_C2 * upper / T)) * (1.0 - np.exp(-_C2 * lower / T))) * _COLD / _STP
    return sum(
        _just_overlapping(area * populated, centre, wavenumber) for area, centre in ((0.0219, 960.8), (0.0532, 1063.6))
    )


def _two_micrometres(wavenumber: np.ndarray) -> np.ndarray:
    """(t, n) strength of three bands of overtones (areas by Penner and Varanasi 1964, JQSRT 4, 799)."""
    T, total = KELVIN[:, None], 0.0
    bands = (0.272, 4860.5, (0, 4, 1)), (1.01, 4983.5, (1, 2, 1)), (0.426, 5109.0, (2, 0, 1))
    for area, centre, quanta in bands:
        states = np.prod([(1.0 - np.exp(-_C2 * w / T)) ** n for w, n in zip(_OMEGA, quanta, strict=True)], axis=0)
        quantum = float(np.dot(_OMEGA, quanta))
        area = area * (1.0 - np.exp(-_C2 * quantum / T)) * states**-1.0 * _COLD / _STP
        total = total + _just_overlapping(area, centre, wavenumber)
    return total


def _unpopulated(quantum: float) -> Callable:
    """1 over the partition function of a band of CO2 that absorbs a quantum (cm-1), as a function of T."""

    def of(T):
        third, mean = np.exp(-_C2 * _OMEGA[2] / T), np.exp(-_C2 * _OMEGA_12 / T)
        return (1.0 - third) * (1.0 - mean) ** 3 * (1.0 + mean) * (1.0 - np.exp(-_C2 * quantum / T))

    return of


def _degeneracy(v: int) -> float:
    """Mean number of states in which v mean quanta are stretching and bending."""
    return 0.25 * (v + 1) * (v + 3) if v % 2 else 0.25 * (v + 2) ** 2


def _stretching() -> _Oscillator:
    """4.3 um: one quantum of the asymmetric stretching vibration."""
    states = []
    for v in range(20):
        for v3 in range(10):
            centre = _OMEGA[2] + 0.5 * _X13 + _X23 + 2.0 * _X33 + 0.5 * (0.5 * _X13 + _X23) * v + 2.0 * _X33 * v3
            energy = v3 * _OMEGA[2] + v * _OMEGA_12
            g = _degeneracy(v)
            states.append((energy, (v3 + 1) * g, 0.5 * g, _ROTATION - _COUPLING * (v3 + 1), centre))
    return _Oscillator(2700.0, _ROTATION, _COUPLING, _unpopulated(_OMEGA[2]), states)


def _combinations() -> list[_Oscillator]:
    """2.7 um: (000)-(021) and (000)-(101)."""
    bands = []
    parameters = (
        (28.5, 2.0 * _OMEGA[1] + _OMEGA[2], 3613.0, 3598.0, 18.0),
        (42.3, _OMEGA[0] + _OMEGA[2], 3715.0, 3728.0, 5.0),
    )
    for area, quantum, first, others, per_quantum in parameters:
        states = []
        for v in range(20):
            g = _degeneracy(v)
            mean = (v + 5) / 6.0 if v % 2 else (v + 3) * (v + 4) / (6.0 * (v + 2))
            for v3 in range(10):
                centre = (others - per_quantum * v if v else first) - 47.0 * v3
                energy = v3 * _OMEGA[2] + v * _OMEGA_12
                states.append((energy, (v3 + 1) * g * mean, 0.5 * g, _ROTATION - _COUPLING * (v3 + 1), centre))
        bands.append(_Oscillator(area, _ROTATION, _COUPLING, _unpopulated(quantum), states))
    return bands
