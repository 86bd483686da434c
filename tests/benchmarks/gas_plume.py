# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is right in the plume: this engine and Cycles beside the path tracer of the tests, in blocks of pixels.

    python -m tests.benchmarks.gas_plume [--passes N] [--seconds S] [--samples N]

The scene is the plume of speed_scenes.py, but grey, as the path tracer takes no other gas: 1 / m where the density is
1. Each renders two independent pictures of 128 x 96 pixels. Printed is for each two of the three how far they are
apart, root mean square over blocks of 8 x 8 pixels of the apparent temperature, K, mean of all bands, beside what the
noise of both gives. The path tracer takes 2 GB and most of the time.
"""

import argparse
from dataclasses import replace
from itertools import combinations

from addon.solver import Settings, render
from tests.benchmarks.large_pictures import apart, block_temperatures
from tests.benchmarks.speed_scenes import build
from tests.benchmarks.speed_vs_error import film_image, peer_problem, run_peer
from tests.helpers.path_tracer import trace_paths

WIDTH, HEIGHT, BLOCK = 128, 96, 8


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--passes", type=int, default=64, help="of this engine (%(default)s)")
    parser.add_argument("--seconds", type=float, default=150.0, help="of Cycles for all bands (%(default)s)")
    parser.add_argument("--samples", type=int, default=64, help="of the path tracer (%(default)s)")
    options = parser.parse_args()
    scene = build("plume", (WIDTH, HEIGHT))
    scene = replace(scene, media=tuple(replace(medium, absorption=1.0) for medium in scene.media))
    seeds = 0, 1
    cycles, _ = run_peer("cycles", peer_problem("cycles", scene), 2, "wall", [options.seconds] * len(seeds))
    pictures = {
        "this engine": [film_image(render(scene, Settings(options.passes, seed=seed))) for seed in seeds],
        "cycles": cycles,
        "path tracer": [trace_paths(scene, options.samples, 2, seed, threads=2).radiance() for seed in seeds],
    }
    kelvin = {
        name: block_temperatures(images, scene.band_edges, BLOCK).mean(axis=-1) for name, images in pictures.items()
    }
    for one, other in combinations(kelvin, 2):
        distance, noise = apart(kelvin[one], kelvin[other])
        print(f"{one} and {other}: {distance:.4f} K apart, by noise {noise:.4f} K", flush=True)


if __name__ == "__main__":
    main()
