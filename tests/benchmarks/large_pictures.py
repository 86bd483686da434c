# SPDX-License-Identifier: GPL-3.0-or-later
"""Error after equal time beside path tracers at the size that people render, on the scenes of speed_scenes.py.

    python -m tests.benchmarks.large_pictures [--scene NAME ...] [--peers NAME ...] [--size WIDTH HEIGHT] [--seconds S]

A reference with less noise than ours would take hours at this size. But two independent renders of an engine tell its
noise: the variance is half of the mean square of their difference. What they have in common is a bias, which their
difference does not hold. So the table also shows how far both engines are apart in blocks of 32 x 32 pixels, in the
temperature of the mean radiance, root mean square over the blocks, beside what the noise of both would give.

Errors are root mean squares of the apparent temperatures of every band, K, without the worst 2 %. Each engine has the
seconds for all bands: a peer renders three in a run, and its time is that of its runs, without loading and compilation.
Ours is all of render(), planning included, after a first render that compiles; the last pass that ends in time counts.
The last column is how many times longer the best peer would need for our error: the squared ratio of the errors, at
equal time.
"""

import argparse

import numpy as np

from addon.solver import Settings, render
from tests.benchmarks.peers.__main__ import CLOCKS
from tests.benchmarks.speed_scenes import GAS_SCENES, SCENES, build
from tests.benchmarks.speed_vs_error import KEPT, band_temperatures, film_image, peer_problem, run_peer

BLOCK = 32  # pixels


def our_image(scene, seed, options):
    """Radiances (height, width, bands) of the last pass that ended in time, and s and number of passes until then."""
    clock = CLOCKS[options.clock](options.threads)
    kept, started = [], clock()

    def on_pass(film):
        spent = clock() - started
        if not kept or spent <= options.seconds:
            kept[:] = film_image(film), spent, film.passes

    def out_of_time():
        return bool(kept) and clock() - started > options.seconds

    render(scene, Settings(0, time_limit=1e6, seed=seed, threads=options.threads), on_pass, out_of_time)
    return kept


def noise(pair):
    """Trimmed error (K) of two independent images of temperatures (2, height, width, bands)."""
    squares = np.sort(np.diff(pair, axis=0).ravel() ** 2) / 2.0
    return np.sqrt(squares[: int(KEPT * squares.size)].mean())


def blocks(images, size=BLOCK):
    """(n, rows, columns, bands) means over whole blocks of so many pixels of images (n, height, width, bands)."""
    images = np.asarray(images)
    rows, columns = images.shape[1] // size, images.shape[2] // size
    whole = images[:, : rows * size, : columns * size]
    return whole.reshape(len(images), rows, size, columns, size, -1).mean(axis=(2, 4))


def block_temperatures(images, edges, size=BLOCK):
    """(n, rows, columns, bands) K of the mean radiance of ``blocks``."""
    return np.array([band_temperatures(means, edges) for means in blocks(images, size)])


def apart(one, other):
    """How far two pairs (2, ...) of independent values are apart, root mean square, and what their noise gives."""
    distance = np.sqrt(np.mean((one.mean(axis=0) - other.mean(axis=0)) ** 2))
    return distance, np.sqrt(sum(np.mean(np.diff(each, axis=0) ** 2) / 4.0 for each in (one, other)))


def compare(name, options):
    """Print the rows of one scene."""
    scene = build(name, options.size)
    render(build(name), Settings(passes=2, threads=options.threads))  # compiles
    ours = [our_image(scene, seed, options) for seed in (0, 1)]
    spent, passes = np.mean([each[1] for each in ours]), min(each[2] for each in ours)
    temperatures = np.stack([band_temperatures(each[0], scene.band_edges) for each in ours])
    error = noise(temperatures)
    own_blocks = block_temperatures([each[0] for each in ours], scene.band_edges)
    for peer in options.peers:
        problem = peer_problem(peer, scene)
        budgets = [options.seconds] * 2
        images, seconds = run_peer(peer, problem, options.threads, options.clock, budgets, python=options.python)
        others = np.stack([band_temperatures(image, scene.band_edges) for image in images])
        equal = noise(others) * np.sqrt(np.mean(seconds) / spent)
        gap, by_noise = apart(own_blocks, block_temperatures(images, scene.band_edges))
        print(
            f"| {name} | {peer} | {equal:.4f} | {spent:.1f} | {passes} | {error:.5f} | {gap:.5f} | {by_noise:.5f} | "
            f"{np.format_float_positional((equal / error) ** 2, 3, fractional=False, trim='-')} |",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument(
        "--scene", nargs="+", choices=[*SCENES, *GAS_SCENES], default=list(SCENES), help="scenes (all without gas)"
    )
    parser.add_argument(
        "--peers", nargs="+", default=["mitsuba"], help="engines of tests/benchmarks/peers (%(default)s)"
    )
    parser.add_argument("--size", nargs=2, type=int, default=(640, 480), help="pixels, 4 : 3 (%(default)s)")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each engine for all bands (%(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="of every engine (%(default)s)")
    parser.add_argument(
        "--clock", choices=CLOCKS, default="wall", help="'processor' for a machine that is busy otherwise"
    )
    parser.add_argument("--python", help="interpreter that has the peers, where it is not this one")
    options = parser.parse_args()
    print(
        "| scene | peer | its error, K | s | our passes | our error, K | blocks apart, K | by noise, K | longer |\n"
        "|---|---|--:|--:|--:|--:|--:|--:|--:|"
    )
    for name in options.scene:
        compare(name, options)


if __name__ == "__main__":
    main()
