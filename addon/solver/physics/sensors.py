# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral responses of thermal cameras, and the weight of each band in them.

The built-in responses are models of the physics of each kind of detector, with the parameters below, and no copies of
the curve of a camera. docs/sensors.md derives them.

A photon detector gives the same current for each absorbed photon. A watt of long waves is more photons than one of
short waves, so the response to a watt grows with the wavelength, up to that of the semiconductor's gap energy E_g:

    R = lambda * eta(E),    eta = 1 / (1 + exp((E_g - E) / w)),    E = h c / lambda

w is the softness of the edge. A bolometer responds to an absorbed watt alike at all wavelengths; its absorber and its
window limit what is absorbed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..scene import Response
from .spectrum import band_emissivity, band_radiance, faintest

WEIGHTING = 300.0  # K: blackbody whose spectrum averages a response over a band

_PHOTON = 1.239841984  # h c in eV um (CODATA 2018)
_COOLED = 77.0  # K: liquid nitrogen
_EDGE = 0.002  # eV, w: the response falls from 90 % to 10 % within 4.4 w, 0.2 um at 5.5 um. Chosen, not measured
_STEP = 0.02  # um between points
_CAVITY = 2.5  # um, gap of a quarter wave at 10 um below a microbolometer (Wood 1997)
_CUT_ON, _CUT_OFF = 7.5, 13.5  # um, half response: the maker's figures for uncooled cores (FLIR)
_CUT_ON_EDGE, _CUT_OFF_EDGE = 0.1, 0.3  # um: falls from 90 % to 10 % within 4.4 times that. Chosen, not measured


def band_weights(response: Response | None, edges: np.ndarray) -> np.ndarray:
    """(b,) response in each band: its mean over the band, weighted with a blackbody at WEIGHTING; 1 without a response.

    edges: (b + 1,) um. The weights depend on sensor and bands alone, so that they are the same for all frames and
    scenes.
    """
    return np.ones(len(edges) - 1) if response is None else band_emissivity(edges, WEIGHTING, response.curve)


def share_outside(response: Response, low: float, high: float, temperature: float) -> float:
    """The share, 0..1, of a sensor's signal from a blackbody (K) that lies outside low..high um."""
    curve = response.curve
    first, last = curve[0][0], curve[0][-1]
    temperature = max(temperature, faintest(first))
    whole = band_radiance(np.array([first, last]), temperature, curve)[0]
    low, high = max(low, first), min(high, last)
    return 1.0 - float(band_radiance(np.array([low, high]), temperature, curve)[0] / whole) if low < high else 1.0


def insb() -> Response:
    """Indium antimonide photodiode at 77 K. Gap after Varshni with the parameters of Vurgaftman, Meyer and Ram-Mohan,
    J. Appl. Phys. 89, 5815 (2001): 0.2273 eV, 5.45 um."""
    gap = 0.235 - 0.32e-3 * _COOLED**2 / (_COOLED + 170.0)
    return Response("InSb", _photon_detector(gap, 1.0, 6.4))


def hgcdte() -> Response:
    """Mercury cadmium telluride at 77 K with a cadmium share of x = 0.22. Gap after Hansen, Schmit and Casselman,
    J. Appl. Phys. 53, 7099 (1982): 0.1153 eV, 10.8 um."""
    x = 0.22
    gap = -0.302 + 1.93 * x - 0.81 * x**2 + 0.832 * x**3 + 5.35e-4 * _COOLED * (1.0 - 2.0 * x)
    return Response("HgCdTe", _photon_detector(gap, 2.0, 14.0))


def microbolometer() -> Response:
    """Uncooled vanadium oxide microbolometer behind its window.

    The absorber is a sheet of 377 ohm, matched to free space, over a mirror at a distance d (a Salisbury screen):
    A = 4 / (4 + cot^2(2 pi d / lambda)). R. A. Wood, Semiconductors and Semimetals 47 (1997), has d = 2.5 um.
    """
    wavelength = _steps(6.5, 17.0)
    absorbed = 4.0 / (4.0 + np.tan(2.0 * np.pi * _CAVITY / wavelength) ** -2.0)
    passed = _edge(wavelength - _CUT_ON, _CUT_ON_EDGE) * _edge(_CUT_OFF - wavelength, _CUT_OFF_EDGE)
    return Response("Microbolometer", np.column_stack((wavelength, absorbed * passed)))


BUILT_IN: dict[str, Callable[[], Response]] = {"INSB": insb, "HGCDTE": hgcdte, "MICROBOLOMETER": microbolometer}


def _photon_detector(gap: float, shortest: float, longest: float) -> np.ndarray:
    """(n, 2) points of R = lambda eta between two wavelengths (um). gap: E_g, eV."""
    wavelength = _steps(shortest, longest)
    return np.column_stack((wavelength, wavelength * _edge(_PHOTON / wavelength - gap, _EDGE)))


def _edge(above: np.ndarray, width: float) -> np.ndarray:
    """The logistic function: 0 far below an edge, 1/2 on it, 1 far above."""
    return 1.0 / (1.0 + np.exp(-above / width))


def _steps(low: float, high: float) -> np.ndarray:
    """Wavelengths (n,) from low to high, um, about _STEP apart."""
    return np.linspace(low, high, round((high - low) / _STEP) + 1)
