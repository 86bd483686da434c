# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the tables of docs/bands.md: what bands lose between parallel plates, and what other edges and weights spare.

python -m docs.tools.measure_bands
"""

import numpy as np

from addon.solver.physics.band_partition import choose_bands
from addon.solver.physics.radiometry import band_emissivity, excess_emissivity
from addon.solver.physics.spectrum import apparent_temperature, band_radiance, uniform_edges
from docs.tools.pages import table
from tests.helpers.band_cases import (
    COLD,
    HOT,
    SETS,
    compared,
    curve,
    finer,
    plate,
    plate_errors,
    plates,
    spectral_error,
    summed,
)

COUNTS = (8, 12, 16, 24, 32)
RANGES = ((3.0, 14.0), (7.5, 14.0))


def reference_alone(edges, _hot, cold, points):
    """Weights of a blackbody at the reference temperature, as before."""
    return band_emissivity(edges, cold, points)


def plates_in_colour(hot, cold, edges):
    """As `plates`, with the colour of what emits in the weight, too: that of the hot plate, as T0 is COLD."""
    fine = finer(edges)
    (emitted, r1), (_, r2) = (plate(name, fine.tobytes(), excess_emissivity) for name in (hot, cold))
    r1, r2 = (summed(r * emitted, edges) / summed(emitted, edges) for r in (r1, r2))
    excess = summed(emitted, edges) * np.array([np.ones_like(r2), r2]) / (1.0 - r1 * r2)
    return excess + band_radiance(edges, COLD)


def edges_table():
    """Adaptive beside uniform bands: ratio of the mean spectral errors, and of those of the worst pair."""
    for low, high in RANGES:
        rows = []
        for label, names in SETS.items():
            pairs = [compared(names, low, high, count) for count in COUNTS]
            rows.append((label, *(f"{a.mean() / u.mean():.2f}, {a.max() / u.max():.2f}" for u, a in pairs)))
        print()
        print(table((f"{low:g} to {high:g} um", *(f"{count} bands" for count in COUNTS)), *rows))


def size_table(low=7.5, high=14.0):
    """How large these errors are, in kelvin of the radiance of all bands, and what is foreseen."""
    one = np.array([low, high])
    rows = []
    slope = band_radiance(one, COLD)[0] / (apparent_temperature(1.01 * band_radiance(one, COLD), one)[0] - COLD) * 0.01
    for label, names in SETS.items():
        for count in (4, 8, 16):
            uniform, adaptive = (
                errors * band_radiance(one, COLD)[0] / slope for errors in compared(names, low, high, count)
            )
            foreseen = choose_bands(low, high, [curve(name) for name in names], (COLD, HOT), count=count).error
            cells = [f"{errors.mean():.2g} K, {errors.max():.2g} K" for errors in (uniform, adaptive)]
            rows.append((label, count, *cells, f"{foreseen:.2g} K"))
    head = ("bands", "uniform, mean and worst", "adaptive, mean and worst", "foreseen")
    print()
    print(table((f"{low:g} to {high:g} um", *head), *rows))


def weights_table(low=7.5, high=14.0):
    """Mean spectral error in uniform bands by the weight of the reflectance."""
    rows = []
    for label, weight in (("blackbody at T0", reference_alone), ("excess over T0", excess_emissivity)):
        errors = [plate_errors(SETS["all"], uniform_edges(low, high, count), weight).mean() for count in COUNTS]
        rows.append((label, *(f"{error:.1e}" for error in errors)))
    errors = []
    for count in COUNTS:
        edges = uniform_edges(low, high, count)
        pairs = [(hot, cold) for hot in SETS["all"] for cold in SETS["all"]]
        found = [spectral_error(plates_in_colour(*pair, edges), plates(*pair, finer(edges)), edges) for pair in pairs]
        errors.append(np.mean(found))
    rows.append(("excess times what emits", *(f"{error:.1e}" for error in errors)))
    print()
    print(table((f"{low:g} to {high:g} um, uniform bands", *COUNTS), *rows))


if __name__ == "__main__":
    edges_table()
    size_table()
    weights_table()
