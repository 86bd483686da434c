# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare renders with exact solutions (tests/helpers/exact_cases.py): the tables of docs/accuracy.md and its plots.

python -m docs.tools.measure_accuracy [--processes N] [--only WORD]

Takes about an hour on two cores. --only prints the cases whose title or name holds the word, and writes
nothing. Exit code 1 says that an image is wrong (see `wrong`). Needs the environment of run.py.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from addon.solver import Material, Scene, Settings, render
from docs.tools.pages import table, write_blocks
from docs.tools.paths import DOCS, IMAGES
from docs.tools.plots import pyplot
from tests.helpers.exact_cases import (
    CASES,
    PHOTONS,
    Case,
    cavity,
    closed_sphere,
    concentric,
    parallel_image,
    plates,
)
from tests.helpers.scenes import mean_and_error, pass_means

PAGE, PLOT, SCRIPT = DOCS / "accuracy.md", IMAGES / "accuracy.png", "docs/tools/measure_accuracy.py"
PILOT, PILOT_SEED = 24, 1000  # passes that say how noisy a case is; not part of the result
SEEDS, AGAIN = (1, 2), (5, 6)  # of a row, and of the second, longer run of a row that missed
CURVE_SEEDS, CURVE_PASSES = (1, 2, 3, 4), 512  # of the plotted cases
MODEL_PASSES = 128  # of the tables of what the model costs
FEWEST, MOST = 64, 4096  # passes of each seed
WANTED = 2.8e-4  # relative standard error that the passes are chosen for
NOISE, DEVIATION = 3.0, 1e-3  # the verdict: standard errors, and relative
HEAD = ("case", "band, um", "passes", "truth", "image", "deviation", "standard error", "ratio", "verdict")
PLOTTED = {  # group: case
    "Enclosures at one temperature": "spectral walls, subtraction off",
    "A closed diffuse sphere": "cap, e = 0.3 / 0.9, subtraction off",
    "Spherical cavities": "f = 0.1, e = 0.5",
    "Coaxial disks": "radii 1 and 1 m, distance 1 m",
    "Parallel rectangles": "1 x 1 m, distance 1 m",
    "A floor beside mirrors": "one mirror",
}


@dataclass(frozen=True)
class Row:
    """One band of one case: radiances in W m-2 sr-1, passes of all seeds together."""

    case: Case
    band: str
    passes: int
    value: float
    truth: float
    error: float
    again: bool = False

    @property
    def deviation(self) -> float:
        return self.value / self.truth - 1.0

    @property
    def exact(self) -> bool:
        """A render without noise."""
        return self.error < 1e-6 * self.truth

    @property
    def within(self) -> bool:
        """Whether chance explains the deviation."""
        return abs(self.deviation) <= max(NOISE * self.error / self.truth, self.case.tolerance)

    @property
    def close(self) -> bool:
        return abs(self.deviation) <= DEVIATION

    @property
    def right(self) -> bool:
        return self.within and self.close

    @property
    def verdict(self) -> str:
        if self.right:
            return "yes"
        return "NO: " + ", ".join(
            text for text, holds in (("beyond chance", self.within), ("beyond 0.1 %", self.close)) if not holds
        )


def passes_of(case: Case, seeds: tuple[int, ...], passes: int) -> np.ndarray:
    """(seeds, passes, b) mean radiance of the image, W m-2 sr-1; in one thread."""
    scene, _ = case.build(**case.arguments)
    return np.array([pass_means(scene, case.render_settings(passes=passes, seed=seed, threads=1)) for seed in seeds])


def passes_needed(case: Case, truth: np.ndarray) -> int:
    """Passes of each of SEEDS that bring the noisiest band's standard error to WANTED."""
    pilot = passes_of(case, (PILOT_SEED,), PILOT)[0]
    spread = float(np.max(pilot.std(axis=0, ddof=1) / truth))
    return int(np.clip(math.ceil((spread / WANTED) ** 2 / len(SEEDS)), FEWEST, MOST))


def rows_of(case: Case, means: np.ndarray, again: bool = False) -> list[Row]:
    """Rows of (seeds, passes, b) means."""
    scene, truth = case.build(**case.arguments)
    flat = means.reshape(-1, means.shape[2])
    values, errors = flat.mean(axis=0), flat.std(axis=0, ddof=1) / math.sqrt(len(flat))
    edges = scene.band_edges
    return [
        Row(case, f"{low:g}-{high:g}", len(flat), value, exact, error, again)
        for low, high, value, exact, error in zip(edges[:-1], edges[1:], values, truth, errors, strict=True)
    ]


def measure(case: Case) -> tuple[list[Row], np.ndarray]:
    """Rows of a case and the means they come from. A row that is not right is followed by one of new seeds, 4 times as
    many passes.
    """
    if PLOTTED.get(case.title) == case.name:
        seeds, passes = CURVE_SEEDS, CURVE_PASSES
    else:
        _, truth = case.build(**case.arguments)
        seeds, passes = SEEDS, passes_needed(case, truth)
    means = passes_of(case, seeds, passes)
    rows = rows_of(case, means)
    if not all(row.right for row in rows):
        longer = rows_of(case, passes_of(case, AGAIN, 4 * passes), again=True)
        rows = [row for pair in zip(rows, longer, strict=True) for row in pair[: 1 if pair[0].right else 2]]
    return rows, means


def side_by_side(function: Callable, tasks: Iterable, processes: int) -> Iterator:
    """What a function gives for each task, in order. In processes: images are so small that threads would idle."""
    if processes == 1:
        yield from map(function, tasks)
        return
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        yield from pool.map(function, tasks)


def cells(row: Row) -> tuple[str, ...]:
    """A row of a table, as in HEAD."""
    name = row.case.name + (", again" if row.again else "")
    noise = "none" if row.exact else f"{row.error / row.truth:.4%}"
    ratio = "" if row.exact else f"{row.deviation * row.truth / row.error:+.1f}"
    return (
        name,
        row.band,
        str(row.passes),
        f"{row.truth:.6g}",
        f"{row.value:.6g}",
        f"{row.deviation:+.4%}",
        noise,
        ratio,
        row.verdict,
    )


def tables(rows: list[Row]) -> str:
    """A section for each builder of cases."""
    sections = []
    for title, group in itertools.groupby(rows, lambda row: row.case.title):
        of_title = list(group)
        sections += [f"### {title}", of_title[0].case.explanation, table(HEAD, *map(cells, of_title))]
    return "\n\n".join(sections)


def wrong(rows: list[Row]) -> list[Row]:
    """Rows that say that an image is wrong: not right with new seeds and more passes either.

    Of 96 noisy bands chance takes one beyond 3 standard errors in every fourth run of all cases, so one such row says
    little. Twice it does that in one of a thousand runs, about (96 * 0.0027^2, and a little for bands whose 3 standard
    errors are more than 0.1 %).
    """
    return [row for row in rows if row.again and not row.right]


def summary(rows: list[Row]) -> str:
    """How the deviations are distributed, in words and a table."""
    first = [row for row in rows if not row.again]
    noisy = np.array([row.deviation * row.truth / row.error for row in first if not row.exact])
    quiet = [row for row in first if row.exact]
    again = [row for row in rows if row.again]
    outcome = "Verdict *NO*: none."
    if again:
        outcome = (
            f"Verdict *NO*: {len(again)}, of which {len(again) - len(wrong(rows))} are *yes* with new seeds and four "
            "times the passes (rows marked *again*)."
        )
    shares = []
    for most in (1, 2, 3):
        expected, found = math.erf(most / math.sqrt(2)), np.mean(np.abs(noisy) <= most)
        shares.append((f"{most} standard error{'s' * (most > 1)}", f"{expected:.1%}", f"{found:.1%}"))
    lines = [
        f"{len({id(row.case) for row in first})} cases, {len(first)} bands in all. {len(noisy)} are noisy; of their "
        "deviations chance alone should bring",
        "",
        table(("within", "expected", "found"), *shares),
        "",
        f"Mean of (deviation / standard error): {noisy.mean():+.2f} +- {1 / math.sqrt(len(noisy)):.2f}; mean square: "
        f"{np.mean(noisy**2):.2f} +- {math.sqrt(2 / len(noisy)):.2f} (expected 0 and 1). Largest deviation of a noisy "
        f"band: {max(abs(row.deviation) for row in first if not row.exact):.3%}; largest standard error: "
        f"{max(row.error / row.truth for row in first):.3%}. The {len(quiet)} others have no noise; their largest "
        f"deviation is {max((abs(row.deviation) for row in quiet), default=0.0):.4%}.",
        "",
        outcome,
    ]
    return "\n".join(lines)


# How errors fall


def curve_counts() -> np.ndarray:
    """Numbers of passes (n,) at which curves are drawn."""
    return 2 ** np.arange(int(math.log2(CURVE_PASSES)) + 1)


def curve(means: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of passes (n,), relative error of the radiance over all bands for each seed (seeds, n), and the standard
    error that those passes tell (n,).

    means: (seeds, passes, b). truth: (b,).
    """
    relative = means.sum(axis=2) / truth.sum() - 1.0
    counts = curve_counts()
    errors = np.array([relative[:, :count].mean(axis=1) for count in counts]).T
    variance = [np.nan] + [relative[:, :count].var(axis=1, ddof=1).mean() / count for count in counts[1:]]
    return counts, errors, np.sqrt(variance)


def image_errors(seed: int) -> list[float]:
    """Root mean square error over pixels after each of curve_counts(), relative to the mean of the image."""
    scene, truth = parallel_image(1.0)
    counts, found = curve_counts(), []

    def note(film):
        if film.passes in counts:
            found.append(math.sqrt(np.mean((film.radiance() - truth) ** 2)) / truth.mean())

    render(scene, Settings(passes=CURVE_PASSES, photons_per_pass=PHOTONS, seed=seed, threads=1), note)
    return found


def slopes(counts: np.ndarray, errors: np.ndarray, first: int = 8) -> str:
    """Slope of log error over log passes, from `first` passes on: mean over the seeds and its standard error."""
    late = counts >= first
    fitted = [np.polyfit(np.log(counts[late]), np.log(error[late]), 1)[0] for error in errors]
    return f"{np.mean(fitted):.3f} +- {np.std(fitted, ddof=1) / math.sqrt(len(fitted)):.3f}"


def draw(curves: dict[str, tuple], image: tuple[np.ndarray, np.ndarray], path: Path) -> None:
    """A panel for each of the curves, and a last one for the image."""
    figure, axes = pyplot().subplots(2, 4, figsize=(15, 7), sharex=True, layout="constrained")
    for axis, (name, (counts, errors, standard)) in zip(axes.flat, curves.items(), strict=False):
        for error in errors:
            axis.loglog(counts, np.abs(error), ".", color="0.6", markersize=5)
        axis.loglog(counts, np.sqrt(np.mean(errors**2, axis=0)), "o-", color="C0", label="error, root mean square")
        axis.loglog(counts, standard, "--", color="C3", label="standard error")
        axis.set_title(name, fontsize=9)
    counts, errors = image
    last = axes.flat[len(curves)]
    for error in errors:
        last.loglog(counts, error, ".", color="0.6", markersize=5)
    mean = np.sqrt(np.mean(errors**2, axis=0))
    last.loglog(counts, mean, "o-", color="C0", label="error of pixels, root mean square")
    last.loglog(counts, mean[-1] * np.sqrt(counts[-1] / counts), ":", color="0.2", label="slope -1/2")
    last.set_title("Single pixels of parallel rectangles\n1 x 1 m, distance 1 m", fontsize=9)
    for axis in (axes.flat[0], last):
        axis.legend(fontsize=8)
    for axis in axes.flat[len(curves) + 1 :]:
        axis.set_axis_off()
    for axis in axes.flat[: len(curves) + 1]:
        axis.grid(color="0.9")
        axis.tick_params(labelbottom=True)
        axis.axhline(DEVIATION, color="0.8", linewidth=3, zorder=0)
    figure.supxlabel("passes")
    figure.supylabel("relative error (grey line: 0.1 %)")
    figure.savefig(path, dpi=80)


# What the engine's model costs, by design


def mean_of(scene: Scene) -> tuple[float, float]:
    """Mean radiance of the image of a scene and its standard error."""
    return mean_and_error(scene, Settings(passes=MODEL_PASSES, photons_per_pass=PHOTONS, threads=1))


def deviations(scenes: list[Scene], truths: list[float], processes: int) -> list[tuple[str, str]]:
    """Cells of tables: how far images are from the truths, and their standard errors."""
    results = zip(side_by_side(mean_of, scenes, processes), truths, strict=True)
    return [(f"{mean / truth - 1:+.3%}", f"{error / truth:.3%}") for (mean, error), truth in results]


def band_averages(processes: int) -> str:
    """Plates of which one has an emissivity that varies over wavelength, in fewer and more bands: a table.

    The truth is the closed form of `plates` in 1500 bands, each with the emissivity of its middle.
    """
    curve = np.array([[8.0, 0.9], [10.0, 0.2], [12.0, 0.7], [14.0, 0.3]])
    fine = np.linspace(8.0, 14.0, 1501)
    _, truth = plates("hot", 0.5, np.interp((fine[1:] + fine[:-1]) / 2, *curve.T), edges=fine)
    counts, scenes = (1, 2, 4, 8, 16, 32), []
    for count in counts:
        scene, _ = plates("hot", 0.5, 0.5, edges=np.linspace(8.0, 14.0, count + 1))
        scenes.append(replace(scene, materials=(*scene.materials[:2], Material("cold", curve))))
    found = deviations(scenes, [truth.sum()] * len(counts), processes)
    rows = [(count, *cells) for count, cells in zip(counts, found, strict=True)]
    return table(("bands in 8-14 um", "deviation", "standard error"), *rows)


def tessellation(processes: int) -> str:
    """Coarser and finer spheres against the closed form of the sphere: a table."""
    names, cases = [], []
    for rings, segments in ((6, 16), (12, 32), (24, 64), (96, 256)):
        count = 2 * segments * (rings - 1)
        names += [(count, "closed sphere"), (count, "cavity, f = 0.1")]
        cases += [
            closed_sphere("rest", rings=rings, segments=segments),
            cavity(0.8, rings=rings, segments=segments),
        ]
    for subdivisions in (1, 2, 3, 4):
        names.append((20 * 4**subdivisions, "concentric spheres"))
        cases.append(concentric("inner", subdivisions=subdivisions))
    found = deviations([scene for scene, _ in cases], [truth.sum() for _, truth in cases], processes)
    rows = [(*name, *cells) for name, cells in zip(names, found, strict=True)]
    return table(("triangles of a sphere", "case", "deviation", "standard error"), *rows)


def main(arguments: list[str] | None = None) -> int:
    """Exit code: whether an image is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--processes", type=int, default=0, help="side by side; 0: as many as cores")
    parser.add_argument("--only", metavar="WORD")
    options = parser.parse_args(arguments)
    processes = options.processes or os.cpu_count() or 1
    cases = [case for case in CASES if not options.only or options.only in f"{case.title}: {case.name}"]
    rows, curves = [], {}
    for case, (found, means) in zip(cases, side_by_side(measure, cases, processes), strict=True):
        for row in found:
            print(f"{case.title}: {' | '.join(cells(row))}", flush=True)
        rows += found
        if PLOTTED.get(case.title) == case.name:
            curves[f"{case.title}\n{case.name}"] = curve(means, case.build(**case.arguments)[1])
    if not options.only:
        write_page(rows, curves, processes)
    for row in wrong(rows):
        print(f"Wrong: {row.case.title}: {' | '.join(cells(row))}", file=sys.stderr)
    return 1 if wrong(rows) else 0


def write_page(rows: list[Row], curves: dict[str, tuple], processes: int) -> None:
    """Render what the page shows beside the cases; write its tables, draw its plots."""
    image = curve_counts(), np.array(list(side_by_side(image_errors, CURVE_SEEDS, processes)))
    draw(curves, image, PLOT)
    parts = {
        "summary": summary(rows),
        "slope": f"Slope of the pixels' error from 8 to {CURVE_PASSES} passes: {slopes(*image)}.",
        "bands": band_averages(processes),
        "tessellation": tessellation(processes),
        "tables": tables(rows),
    }
    write_blocks(PAGE, SCRIPT, parts)


if __name__ == "__main__":
    sys.exit(main())
