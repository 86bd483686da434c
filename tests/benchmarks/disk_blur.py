# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the disks of the first passes move an image's mean: no noise tells, and no reference is needed.

    python -m tests.benchmarks.disk_blur [SCENE ...]

Disks shrink from pass to pass, in pass 1,000,000 to a tenth of their first radius. So the difference between a render
of the first passes and one of passes that late is nine tenths of what the first ones blur. Prints it by material of the
scenes of speed_scenes.py (all of them), with the standard error between seeds; pixels at edges are left out.
"""

import sys

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from addon.solver import Settings, first_hit_images, render
from docs.tools.pages import MADE_AT
from tests.benchmarks.speed_scenes import SCENES

LATE, PASSES, SEEDS = 1_000_000, 6, range(1, 7)


def main():
    for name in sys.argv[1:] or SCENES:
        scene = SCENES[name]()
        shown = first_hit_images(scene, [], {"material": scene.material + 1})["material"]  # 0 is the sky
        shown[minimum_filter(shown, 3) != maximum_filter(shown, 3)] = 0
        blur = np.array([image(scene, seed, 0) - image(scene, seed, LATE) for seed in SEEDS])
        print(f"\n{name}: blur of the first {PASSES} passes, K")
        for index in np.unique(shown[shown > 0]).astype(int):
            means = blur[:, shown == index].mean(axis=1)
            error = means.std(ddof=1) / np.sqrt(len(means))
            print(f"  {scene.materials[index - 1].name:12s} {means.mean():+.4f} +- {error:.4f}", flush=True)
    print(f"\n{MADE_AT}")


def image(scene, seed, first):
    """Temperatures (height, width), K, after PASSES passes."""
    return render(scene, Settings(passes=PASSES, seed=seed, pass_offset=first)).temperature().astype(float)


if __name__ == "__main__":
    main()
