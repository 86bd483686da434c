# SPDX-License-Identifier: GPL-3.0-or-later
"""Print the figures that docs/method.md quotes, each from a small experiment of its own. Takes about a minute.

python -m docs.tools.measure
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import qmc

from addon.solver import Material, Settings, render
from tests.helpers.scenes import box, look, make_scene, mean_and_error

BANDS = np.linspace(7.5, 13.5, 17)  # um
PHOTONS = 20_000


def nearest_neighbours(points: int = 4096, rounds: int = 400) -> None:
    """Mean of the k-nearest estimate of a density that is 1, with points at random and points of low discrepancy."""
    print(f"k-nearest estimate (k - 1) / (pi r^2) of {points} points in a unit square whose edges join, at one place:")
    rng = np.random.default_rng(1)
    for k in (10, 50):
        means = []
        for kind in ("random", "lattice"):
            estimates = []
            for _ in range(rounds):
                if kind == "random":
                    places = rng.random((points, 2))
                else:
                    places = qmc.Sobol(2, scramble=True, rng=rng).random(points)
                asked = rng.random((64, 2))
                radius = cKDTree(places, boxsize=1.0).query(asked, k=[k])[0][:, 0]
                estimates.append(np.mean((k - 1) / (points * np.pi * radius**2)))
            means.append(f"{kind} {np.mean(estimates):.4f} +- {np.std(estimates) / np.sqrt(rounds):.4f}")
        print(f"  k = {k}: " + ", ".join(means))


def room():
    """A closed room at 293 K with a 279 K window wall and a 338 K radiator."""
    vertices, triangles = box((5.0, 4.0, 2.5))
    radiator = np.array([(0.1, 1.0, 0.2), (0.1, 2.2, 0.2), (0.1, 2.2, 0.9), (0.1, 1.0, 0.9)])
    corners = np.concatenate((vertices, radiator))
    faces = np.concatenate((triangles, [(8, 9, 10), (8, 10, 11)])).astype(np.int32)
    temperature = np.full(len(faces), 293.0)
    temperature[2:4], temperature[-2:] = 279.0, 338.0
    plaster = Material("plaster", np.array([[7.5, 0.95], [9.5, 0.80], [13.5, 0.93]]))
    camera = look((4.6, 3.6, 1.6), (0.5, 1.0, 0.9), width=64, height=48, tangent=0.7)
    return make_scene(corners, faces, temperature, [plaster], camera, BANDS)


def noise(scene, **settings) -> float:
    """Median standard error of the apparent temperature, K."""
    return float(np.median(render(scene, Settings(photons_per_pass=PHOTONS, **settings)).noise()))


def reference_subtraction() -> None:
    """Noise of the room with and without the subtraction, after the same passes."""
    scene = room()
    with_it, without = noise(scene, passes=64), noise(scene, passes=64, reference_subtraction=False)
    print(f"closed room, 64 passes, median noise: {with_it:.4f} K with the subtraction, {without:.4f} K without,")
    print(f"  {without / with_it:.0f} times as much")


def passes() -> None:
    """How noise falls with the number of passes, with a radius that shrinks and one that does not."""
    scene = room()
    for shrink in (False, True):
        few, many = noise(scene, passes=64, shrink=shrink), noise(scene, passes=256, shrink=shrink)
        print(
            f"closed room, {'shrinking' if shrink else 'fixed'} radius, median noise: "
            f"{few:.4f} K after 64 passes, {many:.4f} K after 256, {few / many:.2f} times less"
        )


def roulette() -> None:
    """Error of the image's mean with both roulettes between walls that reflect in few bands.

    The noise of a pixel would not do: the roulettes store different numbers of photons, so their k lie on other areas.
    """
    stripes = Material("stripes", np.array([[7.5, 0.9], [10.0, 0.9], [10.1, 0.05], [10.6, 0.05], [10.7, 0.9]]))
    scene = dataclasses.replace(room(), materials=(stripes,))
    print("room whose walls reflect 95 % in one or two bands and 10 % elsewhere, mean of the image:")
    for kind, subtraction in (("POWER", True), ("POWER", False), ("BAND_AVERAGE", False)):
        settings = Settings(passes=512, photons_per_pass=PHOTONS, roulette=kind, reference_subtraction=subtraction)
        mean, error = mean_and_error(scene, settings)
        print(f"  {kind}{', subtraction' * subtraction}: {mean:.4f} +- {error:.4f} W m-2 sr-1")


if __name__ == "__main__":
    nearest_neighbours()
    reference_subtraction()
    passes()
    roulette()
