# SPDX-License-Identifier: GPL-3.0-or-later
"""What it brings to choose directions by the brightness of a sky: hot spots of several sizes over a half-open corner.

python -m tests.benchmarks.hot_sky [--passes 32] [--seeds 2]

Prints, for each spot, the mean square of the sky's radiance over the square of its mean, and 1 / (noise^2 x processor
time) with such directions over that without, in the median of the noisy pixels: of diffuse surfaces, and with a rough
wall.
"""

import argparse
import dataclasses
import time

import numpy as np

from addon.solver import Material, Settings, render
from addon.solver.physics import sky as sky_module
from tests.helpers.hot_skies import EDGES, lit_corner, with_spot

SPOTS = ((1.5, 2000.0), (3.0, 1200.0), (6.0, 900.0), (6.0, 500.0), (12.0, 500.0), (20.0, 400.0))  # degrees, K
DULL = Material("dull", 0.3)
WALLS = {
    "diffuse": (Material("grey", 0.2), Material("grey", 0.4), DULL, Material("plain", 0.5)),
    "rough wall": (Material("grey", 0.2), Material("rough", 0.1, 0.7, 0.4), DULL, Material("plain", 0.5, 0.3, 0.15)),
}


def main():
    """Render all spots with both kinds of walls."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    for degrees, kelvin in SPOTS:
        scene = lit_corner(with_spot(kelvin, degrees, rows=180))
        gains = {name: _gain(dataclasses.replace(scene, materials=walls), options) for name, walls in WALLS.items()}
        told = ", ".join(f"{name} {gain:.2f}" for name, gain in gains.items())
        print(f"{degrees:g} degrees, {kelvin:g} K, concentration {_concentration(scene.sky):.0f}: {told}", flush=True)


def _concentration(sky):
    table = np.abs(sky_module.build_sky_table(sky, EDGES, sky_module.band_radiance(EDGES, 281.0))).sum(axis=2)
    rows = np.diff(np.cos(np.pi * np.arange(len(table) + 1) / len(table)))
    weight = np.broadcast_to(-rows[:, None] / (2.0 * table.shape[1]), table.shape)
    return float(np.sum(table**2 * weight) / np.sum(table * weight) ** 2)


def _gain(scene, options):
    """Efficiency with directions chosen by the sky, over that without."""
    usual, found = sky_module._CONCENTRATED, []
    for least in (0.0, np.inf):
        sky_module._CONCENTRATED = least
        render(scene, Settings(passes=1))
        began, squares = time.process_time(), []
        for seed in range(options.seeds):
            noise = render(scene, Settings(passes=options.passes, photons_per_pass=20_000, seed=seed)).noise()
            squares.append(np.median(noise[noise > 0.0]) ** 2)
        found.append(1.0 / (np.mean(squares) * (time.process_time() - began)))
    sky_module._CONCENTRATED = usual
    return found[0] / found[1]


if __name__ == "__main__":
    main()
