# SPDX-License-Identifier: GPL-3.0-or-later
"""Make aerosols.csv in addon/solver/physics from published optical constants.

    python -m docs.tools.make_aerosols <refractiveindex.info database>

The argument is the folder `database/data` of a clone of github.com/polyanskiy/refractiveindex.info-database (CC0). It
is not part of this project; what is kept is what is computed from it. docs/gas.md, "Aerosols", says what is assumed.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from addon.solver.physics.aerosols import AEROSOLS_FILE, HEADER
from addon.solver.physics.soot import soot_index
from docs.tools.make_library import read_constants
from docs.tools.mie import DIMENSION, aggregate, efficiencies

WAVELENGTHS = np.geomspace(0.8, 30.0, 363)  # um
VARIANCE = 0.1  # of the sizes of drops, see `spheres`
TOLERANCE = 0.01  # of linear interpolation between the kept points: relative of the coefficients, absolute of g
SOOT_DENSITY, SOOT_PREFACTOR = 1.8, 1.3  # g / cm3; count = prefactor * (radius of gyration / radius)^dimension

NOTICE = """\
What aerosols absorb and scatter, m2 per gram, and their asymmetry (mean cosine of the scattering angle), by wavelength.
Water droplets and ice: Mie's theory for spheres. The number in the name is the effective radius, um. Radii follow a
gamma distribution of effective variance 0.1 (Hansen and Travis 1974, Space Sci. Rev. 16, 527). Refractive indices:
water at 25 C of G. M. Hale and M. R. Querry, Appl. Opt. 12, 555 (1973), doi:10.1364/AO.12.000555; ice at -7 C of
S. G. Warren and R. E. Brandt, J. Geophys. Res. 113, D14220 (2008), doi:10.1029/2007JD009744; both as tabulated in the
database of refractiveindex.info, which is in the public domain (CC0 1.0).
Soot: aggregates of 100 spheres of radius 15 nm (small) and 2000 of 25 nm (large), 1.8 g/cm3, by the theory of Rayleigh,
Debye and Gans (C. M. Sorensen, Aerosol Sci. Technol. 35, 648, 2001; fractal dimension 1.8, prefactor 1.3). Refractive
index: formula of H. Y. Chang and T. T. Charalampopoulos, Proc. R. Soc. A 430, 577 (1990).
Made by docs/tools/make_aerosols.py, which is part of this project."""

Curves = np.ndarray  # (n, 3): absorption and scattering, m2/g, and asymmetry, at WAVELENGTHS


def spheres(path: str, density: float, radius: float) -> Callable[[Path], Curves]:
    """Curves of spheres of a gamma distribution, r^((1 - 3 b) / b) exp(-r / (a b)), of effective radius a (um) and
    effective variance b. path: of their optical constants in the database. density: g/cm3."""

    def curves(database: Path) -> Curves:
        wavelength, n, k = read_constants(database / f"{path}.yml")
        index = np.interp(WAVELENGTHS, wavelength, n) + 1j * np.interp(WAVELENGTHS, wavelength, k)
        radii = radius * np.linspace(0.02, 4.0, 400)
        shadow = np.pi * radii ** ((1.0 - 3.0 * VARIANCE) / VARIANCE + 2.0) * np.exp(-radii / (radius * VARIANCE))
        mass = density * 4.0 / 3.0 * radii @ shadow  # um2 g/cm3 um, which is um2 g/m2
        return np.array([
            _per_gram(shadow / mass, *efficiencies(2.0 * np.pi * radii / wavelength, m))
            for wavelength, m in zip(WAVELENGTHS, index, strict=True)
        ])  # fmt: skip

    return curves


def _per_gram(shadow: np.ndarray, extinction: np.ndarray, scattering: np.ndarray, asymmetry: np.ndarray):
    """Absorption and scattering, in units of shadow (m,), and asymmetry, of spheres of (m,) sizes together."""
    total = shadow @ scattering
    return shadow @ (extinction - scattering), total, shadow @ (scattering * asymmetry) / total


def soot(count: float, radius: float) -> Callable[[Path], Curves]:
    """Curves of aggregates of `count` spheres of a radius, um."""
    gyration = (count / SOOT_PREFACTOR) ** (1.0 / DIMENSION)
    per_gram = np.array([3.0 / (4.0 * SOOT_DENSITY * radius)])  # m2 / g, shadow of a sphere

    def curves(_database: Path) -> Curves:
        of_each = zip(WAVELENGTHS, soot_index(WAVELENGTHS), strict=True)
        values = (aggregate(2.0 * np.pi * radius / wavelength, m, count, gyration) for wavelength, m in of_each)
        return np.array([_per_gram(per_gram, *np.array(each)[:, None]) for each in values])

    return curves


AEROSOLS = {
    **{f"Water droplets {radius} um": spheres("main/H2O/nk/Hale", 0.997, radius) for radius in (1, 2, 5, 10, 20)},
    **{f"Ice {radius} um": spheres("main/H2O/nk/Warren-2008", 0.917, radius) for radius in (10, 30)},
    "Soot, small aggregates": soot(100, 0.015),
    "Soot, large aggregates": soot(2000, 0.025),
}


def simplify(curves: Curves) -> list[int]:
    """Rows to keep, by bisection (Ramer, Douglas, Peucker), so that linear interpolation is within TOLERANCE."""
    scale = np.column_stack([np.abs(curves[:, :2]), np.ones(len(curves))]) * TOLERANCE
    scale[:, 0] = np.maximum(scale[:, 0], 1e-4 * curves[:, 1])  # where next to nothing is absorbed
    keep, spans = {0, len(curves) - 1}, [(0, len(curves) - 1)]
    while spans:
        first, last = spans.pop()
        inner = slice(first + 1, last)
        if last - first < 2:
            continue
        share = ((WAVELENGTHS[inner] - WAVELENGTHS[first]) / (WAVELENGTHS[last] - WAVELENGTHS[first]))[:, None]
        line = (1.0 - share) * curves[first] + share * curves[last]
        excess = (np.abs(line - curves[inner]) / scale[inner]).max(axis=1)
        worst = first + 1 + int(np.argmax(excess))
        if excess.max() > 1.0:
            keep.add(worst)
            spans += [(first, worst), (worst, last)]
    return sorted(keep)


def main(database: Path) -> None:
    with AEROSOLS_FILE.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}\n" for line in NOTICE.splitlines())
        table = csv.writer(file, lineterminator="\n")
        table.writerow(HEADER)
        for name, recipe in AEROSOLS.items():
            curves = recipe(database)
            for i in simplify(curves):
                table.writerow([name, f"{WAVELENGTHS[i]:.4g}", *(f"{value:.4g}" for value in curves[i])])


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
