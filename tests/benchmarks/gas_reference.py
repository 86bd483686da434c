# SPDX-License-Identifier: GPL-3.0-or-later
"""Error with the reference temperature of the gas that fills a room, over that with the walls'.

    python -m tests.benchmarks.gas_reference

Root mean squares of the difference of two independent renders, K. The room is 2 m wide, its walls have 300 K, the gas
1000 K.
"""

from dataclasses import replace

import numpy as np

from addon.solver import Medium, Settings, render
from tests.benchmarks.families import AMBIENT, BAND, Parts, block, grey, view
from tests.helpers.scenes import box

HOT = 1000.0


def furnace(absorption, scattering):
    parts = Parts()
    parts.add(box((2, 2, 2)), AMBIENT, grey(0.5))
    parts.add(block((0.4, 0.4, 0.4)), AMBIENT, grey(0.5), (1.0, 1.2, 0.5))
    vertices, triangles = box((1.8, 1.8, 1.8))
    gas = Medium("hot", absorption, HOT, scattering, vertices=vertices + 0.1, triangles=triangles)
    return replace(parts.scene(view((1.0, 0.05, 1.0), (1.0, 2.0, 0.8)), BAND, AMBIENT), media=(gas,))


def error(scene, reference):
    films = [render(scene, Settings(passes=6, seed=seed, reference_temperature=reference)) for seed in (0, 1)]
    difference = films[0].temperature().astype(float) - films[1].temperature()
    return np.sqrt(np.mean(difference**2) / 2.0)


def main():
    print(
        "| absorption, 1/m | scattering, 1/m | chosen, K | error, walls', K | gas's, K | ratio |\n"
        "|--:|--:|--:|--:|--:|--:|"
    )
    for absorption, scattering in ((0.1, 0.0), (0.5, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)):
        scene = furnace(absorption, scattering)
        chosen = render(scene, Settings(passes=1, photons_per_pass=100)).reference_temperature
        cold, hot = error(scene, AMBIENT), error(scene, HOT)
        print(
            f"| {absorption:g} | {scattering:g} | {chosen:g} | {cold:.4f} | {hot:.4f} | {hot / cold:.2f} |", flush=True
        )


if __name__ == "__main__":
    main()
