# SPDX-License-Identifier: GPL-3.0-or-later
"""What droplets of water do to infrared light: absorption and scattering of fog and steam, by Mie's theory.

    python -m docs.examples.droplets

prints a table for droplets of three sizes.
"""

from __future__ import annotations

import numpy as np

# um, n, k of water at 25 C: Hale and Querry, Applied Optics 12, 555 (1973)
WATER = np.array(
    [
        (3.0, 1.371, 0.272), (3.1, 1.467, 0.192), (3.2, 1.478, 0.0924), (3.3, 1.450, 0.0368), (3.4, 1.420, 0.0195),
        (3.5, 1.400, 0.0094), (3.6, 1.385, 0.00515), (3.8, 1.364, 0.0034), (4.0, 1.351, 0.0046), (4.2, 1.342, 0.00688),
        (4.4, 1.334, 0.0103), (4.6, 1.330, 0.0147), (4.8, 1.330, 0.0150), (5.0, 1.325, 0.0124), (8.0, 1.291, 0.0343),
        (8.4, 1.281, 0.0361), (8.8, 1.269, 0.0385), (9.2, 1.255, 0.0415), (9.6, 1.239, 0.0454), (10.0, 1.218, 0.0508),
        (10.5, 1.185, 0.0662), (11.0, 1.153, 0.0968), (11.5, 1.126, 0.142), (12.0, 1.111, 0.199), (13.0, 1.146, 0.305),
        (14.0, 1.210, 0.370),
    ]
)  # fmt: skip
DENSITY = 1e6  # g/m3, of water


def mie(index: complex, size: float) -> tuple[float, float, float]:
    """Extinction and scattering of a sphere as shares of its cross section, and the mean cosine of scattering.

    index: n + ik. size: circumference over wavelength. Bohren and Huffman, *Absorption and Scattering of Light by Small
    Particles*, 1983, chapter 4.
    """
    terms = int(size + 4 * size ** (1 / 3) + 2)
    inner = index * size
    slope = np.zeros(max(terms, int(abs(inner))) + 16, complex)  # D_n: psi_n' / psi_n in the sphere
    for n in range(len(slope) - 1, 0, -1):
        slope[n - 1] = n / inner - 1 / (slope[n] + n / inner)
    before, psi = np.exp(1j * size), np.sin(size) - 1j * np.cos(size)  # xi_-1, xi_0; their real parts are psi
    a, b = np.zeros((2, terms + 1), complex)
    for n in range(1, terms + 1):
        before, psi = psi, (2 * n - 1) / size * psi - before
        for result, factor in ((a, slope[n] / index), (b, slope[n] * index)):
            factor = factor + n / size
            result[n] = (factor * psi.real - before.real) / (factor * psi - before)
    n = np.arange(1, terms + 1)
    a, b = a[1:], b[1:]
    extinction = 2 / size**2 * np.sum((2 * n + 1) * (a + b).real)
    scattering = 2 / size**2 * np.sum((2 * n + 1) * (abs(a) ** 2 + abs(b) ** 2))
    mixed = np.sum((2 * n + 1) / (n * (n + 1)) * (a * b.conj()).real)
    neighbours = a[:-1] * a[1:].conj() + b[:-1] * b[1:].conj()
    cosine = 4 / size**2 * (mixed + np.sum((n * (n + 2) / (n + 1))[:-1] * neighbours.real))
    return extinction, scattering, cosine / scattering


def droplets(radius: float, water: float, low: float, high: float) -> dict:
    """Properties of a gas with droplets for `modelling.fill`, between two wavelengths (um).

    radius: um. water: liquid water, g/m3. The anisotropy, one number, is the mean weighted with the scattering.
    """
    wavelength, n, k = WATER[(low <= WATER[:, 0]) & (WATER[:, 0] <= high)].T
    sphere = np.array([mie(complex(*nk), 2 * np.pi * radius / um) for um, *nk in zip(wavelength, n, k, strict=True)])
    area = 0.75 * water / (DENSITY * radius * 1e-6)  # 1/m: cross sections of all droplets in a cubic metre
    extinction, scattering, cosine = sphere.T
    points = {"absorption": extinction - scattering, "scattering": scattering}
    curves = {
        name: [float(f"{number:.4g}") for pair in zip(wavelength, area * share, strict=True) for number in pair]
        for name, share in points.items()
    }
    return curves | {"anisotropy": round(float(np.average(cosine, weights=scattering)), 3)}


if __name__ == "__main__":
    print("radius, um   wavelength, um   extinction, 1/km at 1 g/m3   albedo   mean cosine")
    for radius in (1, 5, 10):
        for um in (4, 8, 10, 12):
            extinction, scattering, cosine = mie(complex(*WATER[WATER[:, 0] == um][0, 1:]), 2 * np.pi * radius / um)
            per_km = 750 / radius * extinction
            print(f"{radius:10} {um:16} {per_km:27.0f} {scattering / extinction:10.2f} {cosine:12.2f}")
