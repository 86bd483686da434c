# SPDX-License-Identifier: GPL-3.0-or-later
"""Variants of the estimator side by side: error after equal time, on the scenes of speed_scenes.py.

    python -m tests.benchmarks.estimators [--scene NAME ...] [--variant NAME ...] [--seconds S | --passes N]
    python -m tests.benchmarks.estimators --passes N --size W H [--scene NAME ...] [--variant NAME ...]

A variant changes settings, or constants and functions of the solver's modules, in a process of its own. Kernels are
compiled with the constants of the moment and kept, so variants that change what kernels read have folders of kernels
of their own.

Time is processor time of all threads, preparation included: other work on the machine then hardly counts. Variants
take turns, seed by seed, and ratios are to the default with the same seed; the table shows medians over the seeds.

Error is the root mean square of the error of the apparent temperature (K) of the radiance of all bands: "trimmed"
without the worst 2 % of the pixels, and over all. References are those of speed_vs_error.py, rendered by a peer; their
own noise is no part of the error. With equal passes, error^2 x time is the time to one error, over the default's.

With --size there is no reference: pictures of that size are rendered with two seeds, and half of the mean square of
their difference is the variance. Rays are counted, too, which no other work on the machine changes. A bias does not
show, so the last column tells how far the means of variant and default over blocks of 32 x 32 pixels are apart, root
mean square, over the default's error of a pixel. Time is that of the whole render, planning included.
"""

import argparse
import hashlib
import importlib
import itertools
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from addon.solver import Settings, render
from addon.solver.geometry.point_tree import morton_order
from addon.solver.photons.side_table import build_side_table
from addon.solver.system.kernel_cache import FOLDER_VARIABLE
from docs.tools.pages import MADE_AT
from tests.benchmarks.large_pictures import blocks
from tests.benchmarks.speed_scenes import SCENES, build
from tests.benchmarks.speed_vs_error import KEPT, load_reference, user_cache
from tests.helpers.counting import counted_rays, total
from tests.helpers.paper_estimator import (
    ALWAYS_RECALL,
    by_power_alone,
    lights_alone,
    no_final_gathers,
    no_walls,
    rays_everywhere,
)

WALLS = {  # K, see the scenes
    "room": 292.5, "ring": 288.0, "cavity": 300.0, "engine": 304.0, "street": 277.0, "office": 291.0, "bay": 305.0,
}  # fmt: skip


def camera_samples(count):
    """Every pixel sends as many, but that those which show a specular surface send 16 at least."""
    return {"planning.antialiasing.FEWEST": count, "planning.antialiasing.MOST": count}


def in_mesh_order(surfaces, factor, exitance, order):
    """The SideTable of lamps in the order of the triangles' numbers."""
    return build_side_table(surfaces, factor, exitance, np.arange(len(order), dtype=np.int32))


_OPEN = {"planning.pilot._OPEN": -1.0, "planning.pilot._LEAST_OPEN": 0}
# What each variant changes: "room.module.name" in addon.solver, or a field of Settings (a value, or a function of the
# name and the scene).
VARIANTS = {
    "default": {},
    "4 camera rays": camera_samples(4),
    "16 camera rays": camera_samples(16),
    "64 camera rays": camera_samples(64),
    "16 to 64 camera rays": {"planning.antialiasing.FEWEST": 16},
    "shadow rays to lights alone": {"planning.preparation.build_lamps": lights_alone},
    "nothing throws caustics": {"planning.caustics._LEAST_OF_ALL": 1e9},
    "everything throws caustics": {
        "planning.caustics._MOST": 10**6,
        "planning.caustics._COMPACT": 1e9,
        "planning.caustics._LEAST_SHARE": 0.0,
        "planning.caustics._LEAST_OF_ALL": -1.0,
    },
    "wide lamps throw caustics, too": {"planning.caustics._COMPACT": 1e9},
    "all gathers' noise counts in the price": {"planning.splitting._USUAL": 1.0},
    "no roulette on ends": {"planning.splitting._LEAST_CHANCE": 1.0},
    "lamps by power alone": {"planning.lamps._LEAST_NEED": 1e9},
    "shadow rays worth a quarter": {"planning.lamps.BEST": 64.0},
    "1 lamp candidate": {
        "camera.shadow_rays.CANDIDATES": 1,
        "camera.reflection.CANDIDATES": 1,
        "planning.lamps.CANDIDATES": 1,
    },
    "lamps in mesh order": {"planning.lamps.build_side_table": in_mesh_order},
    "no final gathers": {"camera.eye_paths.choose_splits": no_final_gathers},
    "32 rays everywhere": {"camera.eye_paths.choose_splits": rays_everywhere},
    "rays not shared": {"planning.splitting._SHARING": 1e-12},
    "what is near is shared": {"planning.splitting._ALONE": 0.0},
    "at most 64 rays": {"planning.splitting._MOST": 64},
    "spread of each block": {"planning.survey._PRIOR": 4.0},
    "spread of each sheet": {"planning.survey._PRIOR": 1e9},
    "radiance counts, not kelvins": {"planning.survey._sensitivity": lambda radiance, edges: np.ones_like(radiance)},
    "at most 128 camera rays": {"planning.antialiasing.MOST": 128},
    "edges weighed as after one pass": {"planning.antialiasing._PASSES": 1.0},
    "edges weighed as after 32 passes": {"planning.antialiasing._PASSES": 32.0},
    "edges weighed as after 8 passes": {"planning.antialiasing._PASSES": 8.0, "planning.splitting._PASSES": 8.0},
    "recall wherever a cached point is near": ALWAYS_RECALL,
    "a quarter of the cache": {"photons.irradiance_cache._SHARE": 1.0 / 64.0},
    "cache in Morton order": {"photons.irradiance_cache.kd_order": morton_order},
    "4 times the cache": {"photons.irradiance_cache._SHARE": 1.0 / 4.0},
    "no roulette on gathers": {"planning.splitting._LITTLE": 1e-30},
    "a gather takes the time of 2 rays": {"planning.splitting._GATHER": 2.0},
    "no sky rays": {"planning.pilot._OPEN": 2.0},
    "sky rays everywhere": _OPEN,
    "emission by power alone": {"planning.pilot._density": by_power_alone},
    "no feelers": {"camera.eye_paths.free_space": no_walls, "photons.irradiance_cache.free_space": no_walls},
    "20 neighbours": {"neighbours": 20},
    "150 neighbours": {"neighbours": 150},
    "fixed radius": {"shrink": False},
    "T0 of the sky": {"reference_temperature": lambda name, scene: scene.world_temperature},
    "T0 of the walls": {"reference_temperature": lambda name, scene: WALLS[name]},
    "no subtraction": {"reference_subtraction": False},
    "band-average roulette": {"roulette": "BAND_AVERAGE"},
}


def apply(variant):
    """Change the solver's constants and functions in this process."""
    for target, value in VARIANTS[variant].items():
        if "." in target:
            module, _, name = target.rpartition(".")
            module = importlib.import_module(f"addon.solver.{module}")
            getattr(module, name)  # a name that is gone is an error
            setattr(module, name, value)


def measure(variant, name, seed, options):
    """Image of temperatures (K), passes, processor time (s): of a pass behind the first, or of all with a size; and
    how many rays all took."""
    scene = build(name, options.size)
    chosen = {key: value for key, value in VARIANTS[variant].items() if "." not in key}
    chosen = {key: value(name, scene) if callable(value) else value for key, value in chosen.items()}
    limits = {"passes": options.passes, "time_limit": 0.0 if options.passes else 1e6}
    ends, start = [], time.process_time()
    with counted_rays() as calls:
        film = render(
            scene,
            Settings(seed=seed, threads=options.threads, **limits, **chosen),
            lambda film: ends.append(time.process_time() - start),
            lambda: not options.passes and time.process_time() - start > options.seconds,
        )
    each = (ends[-1] - ends[0]) / (len(ends) - 1) if len(ends) > 1 else np.nan
    if options.size:
        each = ends[-1]
    return film.temperature(), film.passes, each, total(calls).rays


def kernel_globals():
    """Names of the globals that the solver's kernels read."""
    modules = [module for name, module in sys.modules.items() if name.startswith("addon.solver.")]
    kernels = [value for module in modules for value in vars(module).values() if hasattr(value, "py_func")]
    return {name for kernel in kernels for name in kernel.py_func.__code__.co_names}


def start(variant, folder):
    """A process for a variant."""
    names = {key: key.rpartition(".")[2] for key in VARIANTS[variant] if "." in key}
    compiled = {key: VARIANTS[variant][key] for key, name in names.items() if name in kernel_globals()}
    digest = hashlib.sha256(repr(compiled).encode()).hexdigest()[:12]
    os.environ[FOLDER_VARIABLE] = str(folder / "kernels" / digest)
    context = multiprocessing.get_context("spawn")  # imports the solver anew, with that folder
    pool = ProcessPoolExecutor(1, context, apply, (variant,))
    for name in ("room", "ring"):  # loads or compiles the kernels; 12 bands and 16, with mirrors and without
        pool.submit(measure, variant, name, 0, argparse.Namespace(passes=1, threads=1, size=None)).result()
    return pool


def compare(name, pools, options):
    """Print the table of one scene."""
    reference = load_reference(name, SCENES[name](), options.cache, options.threads)
    results = {variant: [] for variant in pools}
    for seed, variant in itertools.product(range(options.seeds), pools):
        image, passes, each, _ = pools[variant].submit(measure, variant, name, seed, options).result()
        results[variant].append((*(reference.own_errors(image) if passes else (np.nan, np.nan)), passes, each))
    table = {variant: np.array(rows) for variant, rows in results.items()}
    head = "error, trimmed", "all pixels", "time of a pass", "error^2 x time", "the same, all pixels"
    print(f"\n**{name}**\n\n| variant | passes | {' | '.join(head)} |\n|---|{'--:|' * 6}", flush=True)
    for variant, rows in table.items():
        trimmed, everywhere, passes, _ = np.median(rows, axis=0)
        ratio = np.median(rows / table["default"], axis=0)
        print(
            f"| {variant} | {passes:.0f} | {trimmed:.4f} K, x{ratio[0]:.2f} | {everywhere:.4f} K, x{ratio[1]:.2f} | "
            f"x{ratio[3]:.2f} | x{ratio[0] ** 2 * ratio[3]:.2f} | x{ratio[1] ** 2 * ratio[3]:.2f} |",
            flush=True,
        )


def compare_pairs(name, pools, options):
    """The same without a reference, by pairs of seeds."""
    head = "error^2 x time", "error^2 x rays", "the same, all pixels", "time", "rays", "blocks apart"
    print(f"\n**{name}**\n\n| variant | {' | '.join(head)} |\n|---|{'--:|' * 6}", flush=True)
    default = None
    for variant, pool in pools.items():
        renders = [pool.submit(measure, variant, name, seed, options).result() for seed in (0, 1)]
        images = np.stack([render[0] for render in renders])
        spent = np.mean([render[2:] for render in renders], axis=0)  # time, rays
        squares = np.sort(np.diff(images, axis=0).ravel() ** 2) / 2.0
        variance = np.array([squares[: int(KEPT * squares.size)].mean(), squares.mean()])
        default = default or (variance, spent, images.mean(axis=0))
        (trimmed, everywhere), (longer, more) = variance / default[0], spent / default[1]
        apart = blocks((images.mean(axis=0) - default[2])[None, ..., None])
        off = np.sqrt(np.mean(apart**2) / default[0][0])
        ratios = trimmed * longer, trimmed * more, everywhere * more, longer, more
        print(f"| {variant} | {' | '.join(f'x{ratio:.2f}' for ratio in ratios)} | {off:.3f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--scene", nargs="+", choices=SCENES, default=list(SCENES), help="scenes (all of them)")
    parser.add_argument("--variant", nargs="+", choices=VARIANTS, default=list(VARIANTS), help="(all of them)")
    parser.add_argument("--seconds", type=float, default=2.0, help="of processor time, for each render (%(default)s)")
    parser.add_argument("--passes", type=int, default=0, help="equal passes instead of equal time")
    parser.add_argument("--seeds", type=int, default=3, help="renders of each variant and scene (%(default)s)")
    parser.add_argument("--size", nargs=2, type=int, metavar="PIXELS", help="of pictures that are compared in pairs")
    parser.add_argument("--threads", type=int, default=2, help="(%(default)s)")
    parser.add_argument("--cache", type=Path, default=user_cache(), help="folder of references, kernels (%(default)s)")
    options = parser.parse_args()
    chosen = ["default", *(variant for variant in options.variant if variant != "default")]
    pools = {variant: start(variant, options.cache.absolute()) for variant in chosen}
    for name in options.scene:
        (compare_pairs if options.size else compare)(name, pools, options)
    print(f"\n{MADE_AT}")


if __name__ == "__main__":
    main()
