# SPDX-License-Identifier: GPL-3.0-or-later
"""How spheres, and aggregates of tiny spheres, absorb and scatter.

Spheres: Mie's series (Bohren and Huffman 1983, Absorption and Scattering of Light by Small Particles, chapter 4).
Aggregates: Rayleigh, Debye and Gans's approximation (Sorensen 2001, Aerosol Sci. Technol. 35, 648).
"""

from __future__ import annotations

import numpy as np

DIMENSION = 1.8  # fractal dimension of aggregates: the number of their spheres goes as this power of the radius


def efficiencies(size: np.ndarray, index: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Extinction and scattering efficiencies (cross sections over that of the shadow) and asymmetries (mean cosine of
    the scattering angle) of spheres, each (m,) float64.

    size: (m,) circumferences over the wavelength, ascending, from about 0.01 on. index: of refraction, n + i k.
    """
    terms = np.rint(size + 4.0 * np.cbrt(size) + 2.0).astype(int)  # of the series, for each sphere
    derivatives = _logarithmic_derivatives(index * size, int(terms[-1]))
    psi, chi = (np.sin(size), np.cos(size)), (np.cos(size), -np.sin(size))  # Riccati and Bessel's, orders 0 and -1
    extinction, scattering, cosine = np.zeros((3, size.size))
    before = np.zeros((2, size.size), complex)  # a and b of the order before
    for n in range(1, int(terms[-1]) + 1):
        first = int(np.searchsorted(terms, n))  # smaller spheres have converged; further orders would overflow
        open_ = slice(first, None)
        x, dropped = size[open_], len(psi[0]) - (size.size - first)
        psi, chi = (_next_order(n, x, [each[dropped:] for each in pair]) for pair in (psi, chi))
        d = derivatives[n, open_]
        slopes = np.array([d / index + n / x, d * index + n / x])
        both = (slopes * psi[0] - psi[1]) / (slopes * (psi[0] - 1j * chi[0]) - (psi[1] - 1j * chi[1]))  # a and b
        extinction[open_] += (2 * n + 1) * both.real.sum(axis=0)
        scattering[open_] += (2 * n + 1) * (np.abs(both) ** 2).sum(axis=0)
        cosine[open_] += (2 * n + 1) / (n * (n + 1)) * (both[0] * both[1].conj()).real
        cosine[open_] += (n - 1) * (n + 1) / n * (before[:, open_] * both.conj()).real.sum(axis=0)
        before[:, open_] = both
    return 2.0 * extinction / size**2, 2.0 * scattering / size**2, 2.0 * cosine / scattering


def _next_order(n: int, x: np.ndarray, last: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Riccati and Bessel's functions of orders n and n - 1 at x (m,), from those of n - 1 and n - 2."""
    return (2 * n - 1) / x * last[0] - last[1], last[0]


def _logarithmic_derivatives(z: np.ndarray, highest: int) -> np.ndarray:
    """(highest + 1, m) complex: psi' / psi of Riccati and Bessel at z (m,), by order, by downward recurrence from an
    order so high that its start does not matter."""
    largest = max(highest, float(np.abs(z).max()))
    derivatives = np.zeros((int(largest + 8.0 * np.cbrt(largest)) + 17, z.size), complex)
    for n in range(len(derivatives) - 1, 0, -1):
        derivatives[n - 1] = n / z - 1.0 / (derivatives[n] + n / z)
    return derivatives[: highest + 1]


def aggregate(size: float, index: complex, count: float, gyration: float) -> tuple[float, float, float]:
    """Extinction and scattering efficiencies of an aggregate of `count` spheres, each far smaller than the wavelength,
    over the shadows of all of them, and its asymmetry.

    size: circumference of one sphere over the wavelength. index: n + i k. gyration: the aggregate's radius of gyration
    over the radius of a sphere.
    """
    contrast = (index**2 - 1.0) / (index**2 + 2.0)
    cosine, weight = np.polynomial.legendre.leggauss(64)
    change = 2.0 * size * gyration * np.sqrt(0.5 * (1.0 - cosine))  # of the wave vector, times the radius of gyration
    together = (1.0 + 2.0 / 3.0 / DIMENSION * change**2) ** (-0.5 * DIMENSION)  # 1: all spheres scatter in phase
    phase = 0.375 * weight * (1.0 + cosine**2) * together
    scattering = 8.0 / 3.0 * size**4 * abs(contrast) ** 2 * count * float(phase.sum())
    return 4.0 * size * contrast.imag + scattering, scattering, float(phase @ cosine / phase.sum())
