# SPDX-License-Identifier: GPL-3.0-or-later
"""Print a hash of what each benchmark scene and each exact case renders to, small: to see whether a change of the code
changes a picture.

python -m docs.tools.film_hashes [--only NAME ...] [--keep FILE] [--against FILE]

--keep writes the images and their errors into a file; --against compares with those of another version of the code,
in standard errors of the pixels: where only the order of sums differs, most pixels differ by nothing to speak of.
"""

from __future__ import annotations

import argparse
import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from addon.solver import Film, Scene, Settings, render
from tests.benchmarks.speed_scenes import SCENES
from tests.helpers.exact_cases import CASES

WIDTH, HEIGHT = 48, 36  # of the benchmark scenes
PASSES, PHOTONS = 3, 4000


def cases() -> dict[str, tuple[Scene, Settings]]:
    """What is rendered, by name: the benchmark scenes, and each exact case that the tests render, too."""
    quick = {"passes": PASSES, "photons_per_pass": PHOTONS}
    found = {}
    for name, build in SCENES.items():
        scene = build()
        found[name] = replace(scene, camera=replace(scene.camera, width=WIDTH, height=HEIGHT)), Settings(**quick)
    for case in CASES:
        if case.short:
            name = f"{case.build.__name__}, {case.name}"
            found[name] = case.build(**case.arguments)[0], case.render_settings(**quick)
    return found


def digest(film: Film) -> str:
    """12 hexadecimal digits of the images of all bands, the temperature and its noise, to the last bit."""
    content = hashlib.sha256()
    for image in (film.bands(), film.temperature(), film.noise()):
        content.update(np.ascontiguousarray(image).tobytes())
    return content.hexdigest()[:12]


def difference(film: Film, temperature: np.ndarray, noise: np.ndarray) -> str:
    """How far two images are apart, in the standard error of their difference.

    temperature, noise: (h, w) float32 K, of the other image.
    """
    error = np.hypot(film.noise(), noise)
    apart = np.abs(film.temperature() - temperature) / np.where(error > 0, error, 1e-6)
    return f"rms {np.sqrt(np.mean(apart**2)):.2g}, mean {apart.mean():.2g}, largest {apart.max():.2g} standard errors"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[""], help="cases whose names contain one of these")
    parser.add_argument("--keep", type=Path, help="file to write the images into (.npz)")
    parser.add_argument("--against", type=Path, help="file of another run to compare with")
    options = parser.parse_args()
    others = dict(np.load(options.against)) if options.against else {}
    kept, digests = {}, hashlib.sha256()
    for name, (scene, settings) in cases().items():
        if not any(part in name for part in options.only):
            continue
        film = render(scene, settings)
        digests.update(digest(film).encode())
        line = f"{digest(film)}  {name}"
        kept |= {f"{name} temperature": film.temperature(), f"{name} noise": film.noise()}
        if f"{name} temperature" in others:
            before = others[f"{name} temperature"], others[f"{name} noise"]
            same = np.array_equal(film.temperature(), before[0]) and np.array_equal(film.noise(), before[1])
            line += ": the same" if same else f": {difference(film, *before)}"
        print(line, flush=True)
    print(f"{digests.hexdigest()[:12]}  all of them")
    if options.keep:
        np.savez(options.keep, **kept)


if __name__ == "__main__":
    main()
