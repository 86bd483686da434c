# SPDX-License-Identifier: GPL-3.0-or-later
"""How many photons should tell a caustic: few blur its edges less, many are less noisy.

    python -m tests.benchmarks.caustic_neighbours --threads 2

Renders scenes with caustics with different shares of the neighbours that other estimates look for (`few_neighbours`),
64 passes of 30,000 photons, and compares them with Mitsuba, as against_mitsuba.py does. Then the ring of
speed_scenes.py, which its caustic fills: the root mean square of the difference of two renders over the root of 2, so
what both blur alike is not in it. Options are those of against_mitsuba.py.
"""

import sys

import numpy as np

from addon.solver import Settings, render
from docs.tools.pages import MADE_AT
from tests.benchmarks import against_mitsuba, speed_scenes
from tests.benchmarks.families import member
from tests.helpers.paper_estimator import changed

SHARES = 1.0, 0.4, 0.2
MEMBERS = *(("mirrors", index) for index in (5, 6, 7)), *(("rough", index) for index in (1, 2))
PASSES, RING = 64, (1, 4, 16)


def of_members(share, options):
    """Rows of a table: the members with this share."""
    for family, index in MEMBERS:
        scene = member(family, index)
        truth = against_mitsuba.load_truth(f"{family}{index}", scene, options)
        ours = against_mitsuba.our_images(scene, truth, options, options.seed)[PASSES]
        found = against_mitsuba.compare(ours, truth)
        error = np.sqrt(np.mean((ours.temperature - truth.temperature) ** 2))
        yield (
            f"| {family} {index} | {share:g} | {error:.4f} | {found.beyond3:.2%} | {found.beyond5:.2%} | "
            f"{found.block_ratio:+.1f} | {found.block:+.3f} |"
        )


def of_ring(threads):
    """{passes: error, K} of the ring."""
    seen = []
    for seed in (1, 2):
        images = {}

        def note(film, images=images):
            if film.passes in RING:
                images[film.passes] = film.temperature().astype(float)

        render(speed_scenes.build("ring"), Settings(max(RING), seed=seed, threads=threads), note)
        seen.append(images)
    return {passes: np.sqrt(np.mean((seen[0][passes] - seen[1][passes]) ** 2) / 2.0) for passes in RING}


def main():
    options = against_mitsuba.parse_options(["--passes", str(PASSES), *sys.argv[1:]])
    rows, rings = [], []
    for share in SHARES:
        with changed({"photons.photon_map._FEWER": share}):
            rows += of_members(share, options)
            rings.append(of_ring(options.threads))
    print("| scene | share | error, K | >3 | >5 | worst block, ratio | K |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    print("\n".join(sorted(rows)))
    print("\n| share | " + " | ".join(f"ring after {passes}, K" for passes in RING) + " |")
    print("|--:" * (1 + len(RING)) + "|")
    for share, ring in zip(SHARES, rings, strict=True):
        print(f"| {share:g} | " + " | ".join(f"{error:.3f}" for error in ring.values()) + " |")
    print(f"\n{MADE_AT}")


if __name__ == "__main__":
    main()
