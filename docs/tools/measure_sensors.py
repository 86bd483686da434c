# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor's response loses in wide bands, for docs/sensors.md:

    python -m docs.tools.measure_sensors

Surfaces of library materials in black surroundings, whose spectral radiance is known. The apparent temperature from the
bands, each with one weight, against that from 512 bands.
"""

from addon.solver.physics import library, sensors
from addon.solver.physics.spectrum import (
    apparent_temperature,
    band_radiance,
    sensor_radiance,
    uniform_edges,
)
from docs.tools.pages import table

MATERIALS = ("Fused silica", "Glass, window", "Paint, dark green on metal")
RANGES = {"INSB": (1.5, 5.6), "HGCDTE": (7.5, 12.0), "MICROBOLOMETER": (7.5, 14.0)}
FINE = 512
COUNTS = (8, 16, 32)
KELVIN = ((340.0, 293.0), (293.0, 340.0), (1000.0, 293.0))  # of the surface, and of what it reflects


def surface(edges, curve, kelvin, reflected):
    """Radiance of each band, (b,) W m-2 sr-1: what a surface emits, and what it reflects of black surroundings."""
    return (
        band_radiance(edges, kelvin, curve) + band_radiance(edges, reflected) - band_radiance(edges, reflected, curve)
    )


def worst_error(response, low, high, count, kelvin, reflected):
    """Largest error (K) of the apparent temperature over the materials."""
    fine, edges = uniform_edges(low, high, FINE), uniform_edges(low, high, count)
    weights, fine_weights = (sensors.band_weights(response, each) for each in (edges, fine))
    errors = []
    for name in MATERIALS:
        radiance = surface(fine, tuple(library.find(name).T), kelvin, reflected)
        bands = radiance.reshape(count, -1).sum(axis=1)
        shown = apparent_temperature(bands @ weights, edges, weights).item()
        gain = float(sensor_radiance(fine, fine_weights, shown, derivative=True)) / shown  # for each kelvin
        errors.append(abs(float(sensor_radiance(fine, fine_weights, shown)) - radiance @ fine_weights) / gain)
    return max(errors)


def main():
    rows = []
    for name, (low, high) in RANGES.items():
        response = sensors.BUILT_IN[name]()
        for kelvin, reflected in KELVIN:
            errors = (worst_error(response, low, high, count, kelvin, reflected) for count in COUNTS)
            cells = (f"{response.name}, {low:g} to {high:g} um", f"{kelvin:g} K, {reflected:g} K")
            rows.append((*cells, *(f"{error:.2g} K" for error in errors)))
    print(table(("sensor, bands", "surface, surroundings", *(f"{count} bands" for count in COUNTS)), *rows))


if __name__ == "__main__":
    main()
