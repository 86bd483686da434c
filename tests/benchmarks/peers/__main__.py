# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a problem with one peer:

    python -m tests.benchmarks.peers ENGINE PROBLEM.npz IMAGES.npz THREADS CLOCK SECONDS [SECONDS ...]

One image (height, width, bands; row 0 is the bottom) for every number of seconds, independent of one another. An image
takes one run for every three bands, which share the seconds. Loading and compilation do not count.
"""

import importlib
import sys
import time

import numpy as np

from tests.benchmarks.peers.problem import Problem

ENGINES = {  # module and the variant of the engine in it
    "mitsuba": ("mitsuba_peer", "path"),
    "luxcore-path": ("luxcore_peer", "PATHCPU"),
    "luxcore-bidir": ("luxcore_peer", "BIDIRCPU"),
    "cycles": ("cycles_peer", "CYCLES"),
}
CLOCKS = {  # s, for a number of threads
    "wall": lambda threads: time.perf_counter,
    "processor": lambda threads: lambda: time.process_time() / threads,
}
_CALIBRATION = 0.25  # s that the run lasts from which the rate of samples is taken


def sample_rate(peer, seconds: float, seed: int) -> float:
    """Samples (of every pixel) a second, from trials no longer than so many seconds."""
    samples = 4
    peer.render(samples, seed)  # compiles
    while True:
        seed += 1
        _, spent = peer.render(samples, seed)
        if 4 * spent > seconds or spent > _CALIBRATION:
            return samples / spent
        samples *= 4


def main():
    engine, problem_path, result_path, threads, clock, *budgets = sys.argv[1:]
    module, variant = ENGINES[engine]
    load = importlib.import_module(f".{module}", __package__).load
    problem = Problem.load(problem_path)
    budgets = [float(b) for b in budgets]
    images = np.empty((len(budgets), problem.height, problem.width, len(problem.world)))
    seconds = np.zeros(len(budgets))
    runs = len(problem.groups)
    base = int.from_bytes(np.random.default_rng().bytes(3), "little")
    for run, bands in enumerate(problem.groups):
        part, scale = problem.of_bands(bands)
        peer = load(variant, part, int(threads), CLOCKS[clock](int(threads)))
        rate = sample_rate(peer, min(budgets) / runs, base + 500 + 1000 * run)
        for i, budget in enumerate(budgets):
            samples = max(1, round(rate * budget / runs))
            image, spent = peer.render(samples, base + 1000 * run + i)
            images[i, ..., bands] = np.moveaxis(image * scale, -1, 0)[: len(bands)]
            seconds[i] += spent
        peer.close()
    np.savez(result_path, images=images + problem.offset, seconds=seconds)


if __name__ == "__main__":
    main()
