# SPDX-License-Identifier: GPL-3.0-or-later
"""How many camera rays a pass should send through fog: what the cap on their mean brings.

python -m tests.benchmarks.fog_rays [--scenes room street steam plume] [--caps 32 64 100 200] [--rays N] [--photons N]

Prints, for each scene and cap, the camera rays of a pixel and pass, and 1 / (noise^2 x processor time), with the mean
square of the noise of all pixels, over that of the first cap. Every render has about as many camera rays in all.
"""

import argparse
import dataclasses
import time

import numpy as np

from addon.solver import Material, Medium, Settings, render
from addon.solver.passes import prepare
from addon.solver.planning import antialiasing
from tests.benchmarks.grid_cost import scenes
from tests.benchmarks.speed_scenes import fog
from tests.helpers.hot_skies import lit_corner, with_spot
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere


def room():
    """The benchmarks' room full of dense fog."""
    return _small(fog())


def street():
    """A warm ball over ground in thin fog, under an open sky."""
    ball, ground = sphere(3, 0.3), quad((0, 0, 0), (20, 0, 0), (0, 20, 0))
    mesh = join((ball[0] + (0, 0, 0.5), ball[1], 310.0, 0), (*ground, 285.0, 1))
    mist = Medium("mist", 0.005, 284.0, scattering=0.05, anisotropy=0.8)
    return make_scene(
        *mesh[:3], [Material("warm", 0.9), Material("ground", 0.7)], look((0, -6, 1.5), (0, 0, 0.6), 64, 48, 0.5),
        np.array([8.0, 10.0, 12.0]), mesh[3], media=(mist,), world_depth=100.0, world_temperature=270.0,
    )  # fmt: skip


def steam():
    """Warm steam before grey and mirror walls, under a sky with a hot spot."""
    scene = lit_corner(with_spot(1200.0, 3.0))
    vertices, triangles = box((0.8, 0.8, 1.2))
    cloud = Medium("steam", 0.5, 330.0, 1.5, 0.6, vertices - (0.4, 0.4, 0.9), triangles)
    return _small(dataclasses.replace(scene, media=(cloud,)))


def plume():
    """A plume that scatters in a grid, in the benchmarks' room."""
    return _small(scenes(128)["fog plume"])


def _small(scene):
    return dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, width=64, height=48))


def efficiency(scene, cap, options):
    """Camera rays of a pixel and pass, and 1 / (noise^2 x time), under a cap."""
    antialiasing._MEAN_IN_FOG = cap
    settings = Settings(passes=1, photons_per_pass=options.photons, threads=1)
    rays = float(prepare(scene, settings).samples.mean())
    render(scene, settings)
    films, spent = [], []
    for seed in range(2):
        began = time.process_time()
        films.append(render(scene, dataclasses.replace(settings, passes=max(8, round(options.rays / rays)), seed=seed)))
        spent.append(time.process_time() - began)
    return rays, 1.0 / (np.mean([np.mean(film.noise() ** 2) for film in films]) * np.mean(spent))


def main():
    """Render each scene with all caps."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--caps", type=float, nargs="+", default=[32.0, 64.0, 100.0, 200.0])
    parser.add_argument("--rays", type=int, default=1024)
    parser.add_argument("--photons", type=int, default=100_000)
    builders = {build.__name__: build for build in (room, street, steam, plume)}
    parser.add_argument("--scenes", nargs="+", choices=builders, default=list(builders))
    options = parser.parse_args()
    for name in options.scenes:
        told = [efficiency(builders[name](), cap, options) for cap in options.caps]
        print(f"{name:8}", *(f"{rays:6.1f} rays {each / told[0][1]:5.2f}" for rays, each in told), flush=True)


if __name__ == "__main__":
    main()
