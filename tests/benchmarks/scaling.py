# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost against size: how time and memory of a render grow with triangles, pixels, bands, photons and threads.

    python -m tests.benchmarks.scaling [--only "SERIES" ...] [--passes N]

Prints the Markdown of docs/benchmarks.md and draws docs/images/scaling.png (needs matplotlib; not with --only). Takes
about ten minutes on two cores, and 7 GB of memory for the largest mesh. Linux only, as it reads /proc.

The scene is a closed room with eight balls, one of them a mirror, all of other temperatures. One size changes at a
time, the others are those of BASE. Each row is measured in a process of its own, after a small render that loads or
compiles the kernels.
"""

import argparse
import importlib.metadata
import importlib.util
import itertools
import os
import platform
import sys
import textwrap
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from addon.solver import Material, Medium, Settings, render
from addon.solver import passes as pass_loop
from addon.solver.memory import memory_beforehand, memory_of_passes
from docs.tools.pages import MADE_AT
from docs.tools.paths import IMAGES
from docs.tools.plots import pyplot
from tests.benchmarks.speed_scenes import Parts
from tests.helpers.process import forget_peak, resident
from tests.helpers.scenes import box, look, sphere

CORES = os.cpu_count() or 1
PACKAGES = ("numpy", "numba", "llvmlite", "embreex", "mitsuba", "pyluxcore", "bpy")


class Size(NamedTuple):
    """What a row measures. subdivisions: of the icospheres, s of them make 20 * 4^s triangles a ball. fog: its
    scattering coefficient, 1/m, with a tenth of that in absorption."""

    subdivisions: int = 4
    width: int = 128  # pixels, at 4 : 3
    bands: int = 16
    photons: int = 100_000
    threads: int = CORES
    fog: float = 0.0


BASE = Size()
FOGGY = {"photons in fog": {"fog": 0.3}}  # what else differs from BASE in a series
SMALL = Size(subdivisions=1, width=32)  # loads the kernels
# The field of Size that changes, its values, and the number that it stands for in the tables.
SERIES = {
    "triangles": ("subdivisions", range(1, 9), lambda s: 12 + 8 * 20 * 4**s),
    "pixels": ("width", (32, 64, 128, 256, 512), lambda width: width * width * 3 // 4),
    "bands": ("bands", (1, 2, 4, 8, 16, 32, 64, 128, 256), int),
    "photons": ("photons", (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000), int),
    "photons in fog": ("photons", (30_000, 100_000, 300_000, 1_000_000), int),
    "threads": ("threads", sorted({2**i for i in range(CORES.bit_length())} | {CORES}), int),
}


class Cost(NamedTuple):
    """Of one row: times in s, memory in MB. A pass is the median of those rendered."""

    prepare: float  # processor time of all threads
    prepare_wall: float
    one_pass: float  # processor time of all threads
    one_pass_wall: float
    peak: float  # largest resident memory of the process
    used: float  # what of it came after the scene was there
    foreseen: float  # what memory.py foresees for that


MEASURED = Cost._fields[:-1]  # what has an exponent


def room(size):
    """A room of 6 x 5 x 3 m at 285 to 295 K with eight balls of 300 to 328 K."""
    parts = Parts()
    plaster, paint = Material("plaster", np.array([[7.0, 0.5], [9.0, 0.7], [14.0, 0.6]])), Material("paint", 0.9)
    mirror = Material("mirror", 0.1, specular=1.0)
    vertices, triangles = box((6.0, 5.0, 3.0))
    parts.add((vertices, triangles), np.resize([285.0, 290.0, 295.0], 12), plaster)
    ball = sphere(size.subdivisions, 0.35)
    for i, place in enumerate(itertools.product((1.5, 4.5), (1.4, 3.6), (0.8, 2.1))):
        parts.add(ball, 300.0 + 4 * i, mirror if i == 2 else paint, place)
    camera = look((0.4, 0.5, 1.6), (4, 3.2, 1.2), size.width, size.width * 3 // 4, 0.9)
    scene = parts.scene(camera, np.linspace(7.5, 14.0, size.bands + 1), 285.0)
    if size.fog == 0.0:
        return scene
    return replace(scene, media=(Medium("fog", 0.1 * size.fog, 290.0, size.fog, 0.8),), world_depth=5.0)


def settings_of(size, passes):
    return Settings(passes=passes, photons_per_pass=size.photons, threads=size.threads)


def measure(size, passes):
    """Cost of a render in this process."""
    render(room(SMALL._replace(fog=size.fog)), settings_of(SMALL, 1))
    scene, settings = room(size), settings_of(size, passes)
    forget_peak()
    before = resident("VmRSS") / 1e6
    marks = []  # processor and wall time: at the start, after the preparation, after each pass
    foreseen = []  # MB

    def mark(*_):
        marks.append((time.process_time(), time.perf_counter()))

    def prepare(*inputs):
        model = prepare_as_ever(*inputs)
        mark()
        known = model.hits_per_photon, model.rays_per_pixel
        parts = memory_beforehand(scene) | memory_of_passes(scene, settings, 0, *known)
        foreseen.append(sum(parts.values()) / 1e6)
        return model

    prepare_as_ever = pass_loop.prepare
    mark()
    with patch.object(pass_loop, "prepare", prepare):
        render(scene, settings, mark)
    spent = np.diff(marks, axis=0)
    peak = resident("VmHWM") / 1e6
    return Cost(*spent[0], *np.median(spent[1:], axis=0), peak, peak - before, foreseen[0])


def in_own_process(function, *arguments):
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def measure_series(name, passes):
    """Sizes (n,) and their costs, one Cost for each."""
    field, values, count = SERIES[name]
    costs = []
    for value in values:
        costs.append(in_own_process(measure, BASE._replace(**{field: value}, **FOGGY.get(name, {})), passes))
        print(f"{name} {count(value)}: {costs[-1].one_pass:.3f} s a pass", file=sys.stderr, flush=True)
    return np.array([count(value) for value in values]), costs


def exponents(sizes, costs):
    """p of cost = size^p, by least squares over all rows, and between the last two."""
    x, y = np.log(sizes), np.log(costs)
    return np.polyfit(x, y, 1)[0], (y[-1] - y[-2]) / (x[-1] - x[-2])


def table(name, sizes, costs):
    """Markdown of one series."""
    field, _, count = SERIES[name]
    base = costs[list(sizes).index(count(getattr(BASE, field)))]
    lines = [
        f"| {name} | prepare, s | wall, s | pass, s | wall, s | ratio | wall | peak, MB | render, MB | foreseen, MB |",
        "|--:" * 10 + "|",
    ]
    for size, cost in zip(sizes, costs, strict=True):
        lines.append(
            f"| {size:,} | {cost.prepare:.3f} | {cost.prepare_wall:.3f} | {cost.one_pass:.3f} | "
            f"{cost.one_pass_wall:.3f} | {cost.one_pass / base.one_pass:.2f} | "
            f"{cost.one_pass_wall / base.one_pass_wall:.2f} | {cost.peak:.0f} | {cost.used:.0f} | {cost.foreseen:.0f} |"
        )
    if len(sizes) > 1:
        slopes = np.transpose([exponents(sizes, [getattr(cost, key) for cost in costs]) for key in MEASURED])
        for label, (*times, peak, used) in zip(("exponent", "last pair"), slopes, strict=True):
            cells = [*(f"{p:.2f}" for p in times), "", "", f"{peak:.2f}", f"{used:.2f}", ""]
            lines.append(f"| *{label}* | {' | '.join(cells)} |")
    return "\n".join(lines)


def machine():
    """Markdown: what this was measured on."""
    processor = Path("/proc/cpuinfo").read_text().split("model name")[1].split(":")[1].split("\n")[0].strip()
    memory = int(Path("/proc/meminfo").read_text().split()[1]) * 1024 / 1e9
    versions = [f"{name} {importlib.metadata.version(name)}" for name in PACKAGES if importlib.util.find_spec(name)]
    text = (
        f"{processor}, {CORES} cores, {memory:.0f} GB of memory; "
        f"{platform.freedesktop_os_release()['PRETTY_NAME']}, Linux {'.'.join(platform.release().split('.')[:2])}; "
        f"Python {platform.python_version()}, {', '.join(versions)}. "
        f"Load of the machine before (mean number of waiting threads in 1, 5 and 15 minutes): "
        f"{', '.join(f'{load:.1f}' for load in os.getloadavg())}."
    )
    return textwrap.fill(text, 120)


def unchanged():
    """What the rows share but for the size that changes."""
    values = [f"{count(getattr(BASE, field)):,} {name}" for name, (field, _, count) in SERIES.items()]
    return f"Unless a table says otherwise: {', '.join(values)}."


def draw(results, path):
    """A panel with the times of each series in the room without fog; and one with the memory of all of these."""
    results = {name: result for name, result in results.items() if name not in FOGGY}
    figure, axes = pyplot().subplots(2, 3, figsize=(13, 7.5), layout="constrained")
    *panels, last = axes.flat
    for axis, (name, (sizes, costs)) in zip(panels, results.items(), strict=True):
        for key, label in (("one_pass", "a pass"), ("prepare", "preparation")):
            axis.loglog(sizes, [getattr(cost, key) for cost in costs], "o-", label=f"{label}, processor")
        axis.loglog(sizes, [cost.one_pass_wall for cost in costs], "o--", color="C0", alpha=0.5, label="a pass, wall")
        if name == "threads":
            axis.loglog(sizes, costs[0].one_pass_wall / sizes, ":", color="0.4", label="a pass, wall, at best")
        else:
            axis.loglog(sizes, costs[-1].one_pass * sizes / sizes[-1], ":", color="0.4", label="in proportion")
        axis.set(title=name, xlabel=name, ylabel="s")
        last.loglog(sizes / sizes[0], [cost.used for cost in costs], "o-", label=name)
        axis.legend(fontsize=8)
    last.set(title="memory of the render", xlabel="size over the smallest", ylabel="MB")
    last.legend(fontsize=8)
    for axis in axes.flat:
        axis.grid(color="0.9")
    figure.savefig(path, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--only", nargs="+", choices=SERIES, metavar="SERIES", help=f"some of {', '.join(SERIES)}")
    parser.add_argument("--passes", type=int, default=3, help="of each row (%(default)s)")
    options = parser.parse_args()
    print(f"{machine()}\n\n{unchanged()}")
    in_own_process(measure, SMALL, 1)  # compiles, so that no row's memory counts the compiler
    results = {name: measure_series(name, options.passes) for name in options.only or SERIES}
    for name, (sizes, costs) in results.items():
        print(f"\n### {name.capitalize()}\n\n{table(name, sizes, costs)}")
    print(f"\n{MADE_AT}")
    if not options.only:
        draw(results, IMAGES / "scaling.png")


if __name__ == "__main__":
    main()
