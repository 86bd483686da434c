# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against time: this engine beside path tracers, on the scenes of speed_scenes.py.

    python -m tests.benchmarks.speed_vs_error [--scene NAME ...] [--peers NAME ...] [--out FOLDER] [--paper]
    python -m tests.benchmarks.speed_vs_error --check | --slope PASSES

Prints a table in Markdown and writes speed_vs_error.png. Needs what the peers are: the packages mitsuba (and LLVM 19),
pyluxcore and bpy, all with Python 3.13, and matplotlib for the plot. Each peer runs in a process of its own, with as
many threads as we.

Error is the root mean square, over the pixels, of the error of the apparent temperature (K) of the radiance of all
bands together: "trimmed" without the worst 2 % of the pixels, and over all of them. "each band" is the same of the
apparent temperatures of every band, over pixels and bands. A peer renders three bands a run, and its time is that of
its runs without loading and compilation; ours is all of render(), after a first render that compiles.
The best peer's error after about 10 s of its time sets the mark; our time is that of the first pass that reaches it,
the median over seeds. Its target is a fraction of that peer's time.

Of the scenes with gas, which no LuxCore renders, Mitsuba takes those where all gas has one temperature: it renders the
excess over that, which the gas does not emit. References are rendered once, by Mitsuba or, where its gas would have to
emit, by Cycles, in two independent halves, and kept in the user's cache folder. Of the scene Mitsuba renders the excess
over an isothermal one (negative radiance too), which converges sooner and has the same mean.
"""

import argparse
import contextlib
import functools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from addon.solver import Settings, render
from addon.solver.physics.spectrum import apparent_temperature
from docs.tools.pages import MADE_AT
from docs.tools.paths import ROOT
from docs.tools.plots import pyplot
from tests.benchmarks.peers.__main__ import CLOCKS, ENGINES
from tests.benchmarks.peers.problem import build_problem
from tests.benchmarks.speed_scenes import GAS_SCENES, SCENES, build
from tests.helpers.paper_estimator import PAPER, photons_alone

ROOM, OTHER = (200, 20), (10, 10)  # trimmed, all pixels
TARGETS = {
    "room": ROOM,
    "ring": OTHER,
    "cavity": OTHER,
    "engine": OTHER,
    "office": ROOM,
    "bay": OTHER,
    "fog": (20, 20),
    "plume": (20, 20),
    "clear": (100, 100),
}  # trimmed, all pixels
# K of the isothermal scene that the reference subtracts (0: none), and the s that it takes.
REFERENCES = {
    "room": (291.0, 100),
    "ring": (230.0, 250),
    "cavity": (300.0, 400),
    "engine": (290.0, 250),
    "street": (277.0, 80),
    "office": (291.0, 110),
    "bay": (300.0, 150),
    "fog": (291.0, 200),
    "plume": (0.0, 400),
    "clear": (296.0, 120),
}
OTHER_REFERENCE = (0.0, 600)  # of scenes that are not in the list
KEPT = 0.98  # share of the pixels in the trimmed error
ERRORS = ("trimmed", "all", "each band, trimmed", "each band, all")
PEER_SECONDS = (1.0, 3.0)  # of a peer's curve, before the point that counts


# Our modes: settings and what else changes. The paper is Boudet et al. 2004; + are our feelers.
MODES = {"ours": ({}, contextlib.nullcontext), "paper+": (PAPER, photons_alone)}


def user_cache() -> Path:
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "infrared_photons" / "benchmarks"


def run_peer(engine, problem, threads, clock, seconds, polite=False, python=None):
    """Images (n, height, width, bands) W m-2 sr-1 per band and s (n,), one for each of n budgets in seconds.

    python: the interpreter that has the peer, if it is not this one.
    """
    with tempfile.TemporaryDirectory() as folder:
        problem.save(f"{folder}/problem.npz")
        files = [f"{folder}/{name}.npz" for name in ("problem", "images")]
        command = [python or sys.executable, "-m", "tests.benchmarks.peers", engine, *files]
        done = subprocess.run(
            [*command, str(threads), clock, *map(str, seconds)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            preexec_fn=functools.partial(os.nice, 19) if polite else None,
        )
        if not Path(f"{folder}/images.npz").exists():
            raise RuntimeError(f"{engine} failed:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
        with np.load(f"{folder}/images.npz") as result:
            return result["images"], result["seconds"]


class Reference:
    """Two independent halves of a converged image: `halves` (2, height, width, bands), W m-2 sr-1 per band."""

    def __init__(self, scene, halves):
        self.halves, self.edges = halves, scene.band_edges
        self.temperatures = apparent_temperature(halves.sum(axis=-1), self.edges)  # (2, height, width)
        self.temperature = apparent_temperature(halves.mean(axis=0).sum(axis=-1), self.edges)
        self.band_temperatures = band_temperatures(halves.mean(axis=0), self.edges)
        self.standard_error = np.sqrt(np.mean((0.5 * np.diff(self.temperatures, axis=0)) ** 2))

    def errors(self, image):
        """ERRORS (K) of an image of radiances (height, width, bands)."""
        together = apparent_temperature(image.sum(axis=-1), self.edges) - self.temperature
        return np.concatenate(
            [_errors(each) for each in (together, band_temperatures(image, self.edges) - self.band_temperatures)]
        )

    def own_errors(self, temperature):
        """The same without the reference's own share."""
        order = np.argsort(np.abs(temperature - self.temperature).ravel())
        products = self.own_squares(temperature).ravel()[order]
        return np.sqrt(np.maximum([products[: int(KEPT * products.size)].mean(), products.mean()], 0.0))

    def own_squares(self, temperature):
        """(height, width) K2, whose mean is the mean square error without the reference's own share: the product of the
        differences from two independent halves."""
        return np.prod(temperature - self.temperatures, axis=0)

    def gain_of_all_bands_at_once(self, images, groups):
        """How much less time a path tracer would need at best for all bands together if one path carried all of them.

        images: (n, height, width, bands) of one that renders the bands of each of the groups in a run. Errors e of its
        runs are independent, so that of all bands together is sqrt(sum of e^2). If one path carried all, it would be
        the sum of e, but there would be as many times more paths as there are runs.
        """
        deviation = images - self.halves.mean(axis=0)
        runs = np.add.reduceat(deviation, [bands[0] for bands in groups], axis=-1)
        squares = np.mean(runs**2, axis=(0, 1, 2))
        return squares.size * squares.sum() / np.sqrt(squares).sum() ** 2


def band_temperatures(image, edges):
    """(height, width, bands) apparent temperature, K, of the radiances of each band."""
    bands = (apparent_temperature(image[..., band], edges[band : band + 2]) for band in range(image.shape[-1]))
    return np.stack(list(bands), axis=-1)


def _errors(differences):
    """Root mean square, without the worst 2 % and of all."""
    squares = np.sort(differences.ravel() ** 2)
    return np.sqrt([squares[: int(KEPT * squares.size)].mean(), squares.mean()])


def peer_problem(peer, scene):
    """The problem that a peer renders: Mitsuba, whose gas cannot emit, the excess over the gas's temperature."""
    quiet = scene.media[0].typical_temperature if scene.media and peer == "mitsuba" else 0.0
    return build_problem(scene, quiet)


def load_reference(name, scene, folder, threads):
    """Reference of a scene from the folder, rendered there first if it is missing or the scene has changed."""
    subtracted, seconds = REFERENCES.get(name, OTHER_REFERENCE)
    problem = build_problem(scene, subtracted)
    path = Path(folder) / f"{name}-{problem.digest()}.npy"
    if not path.exists():
        # Mitsuba renders negative radiance too, but no gas that emits
        peer = "cycles" if problem.gas is not None and problem.gas.emits else "mitsuba"
        print(f"{name}: rendering the reference with {peer}, about {seconds} s", flush=True)
        chunks = max(2, 2 * round(seconds / 40))  # many short images, so that the halves are alike
        images, _ = run_peer(peer, problem, threads, "processor", [seconds / chunks] * chunks, polite=True)
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, np.stack((images[::2].mean(axis=0), images[1::2].mean(axis=0))))
    return Reference(scene, np.load(path))


def our_curve(scene, settings, measure, clock, limit=np.inf, enough=0.0):
    """Passes (n,), s (n,) and errors (n, m) of one render, until `limit` s or until all errors are small enough.

    measure: m errors of a film. Measuring does not count as time.
    """
    passes, seconds, errors = [], [], []
    paused = 0.0
    started = clock()

    def on_pass(film):
        nonlocal paused
        now = clock()
        if film.passes <= 32 or film.passes >= 1.05 * passes[-1] or film.passes == settings.passes:
            passes.append(film.passes)
            seconds.append(now - started - paused)
            errors.append(measure(film))
        paused += clock() - now

    def finished():
        out_of_time = clock() - started - paused > limit
        return bool(passes) and (out_of_time or bool(np.all(errors[-1] < enough)))

    render(scene, settings, on_pass, finished)
    return np.array(passes), np.array(seconds), np.array(errors)


def time_to_reach(curve, error, which):
    """s of the first pass whose error is as small, inf if there is none."""
    _, seconds, errors = curve
    reached = np.flatnonzero(errors[:, which] <= error)
    return seconds[reached[0]] if len(reached) else np.inf


def compare(name, options):
    """Of one scene: rows of the table, {engine: (seconds, errors)} for the plot, and what the best peer would gain by
    paths that carry all bands."""
    scene = build(name, options.size)
    reference = load_reference(name, scene, options.cache, options.threads)
    print(f"\n{name}: {len(scene.triangles)} triangles, {scene.band_count} bands")
    print(f"  reference: standard error {reference.standard_error:.4g} K over all pixels")
    curves, marks, gains = {}, [], {}
    budgets = [*PEER_SECONDS, *[options.seconds] * options.repeats]
    for peer in options.peers:
        problem = peer_problem(peer, scene)
        images, seconds = run_peer(peer, problem, options.threads, options.clock, budgets)
        errors = np.array([reference.errors(image) for image in images])
        ends = slice(len(PEER_SECONDS), None)
        mark = (np.median(seconds[ends]), *np.median(errors[ends], axis=0))
        marks.append((peer, *mark))
        gains[peer] = reference.gain_of_all_bands_at_once(images[ends], problem.groups)
        early = len(PEER_SECONDS)
        curves[peer] = (np.append(seconds[:early], mark[0]), np.vstack((errors[:early], mark[1:])))
        cells = "   ".join(f"{label} {error:.4g} K" for label, error in zip(ERRORS, mark[1:], strict=True))
        print(f"  {peer:14s} {mark[0]:6.2f} s   {cells}   all bands at once: 1/{gains[peer]:.1f}", flush=True)
    # their seconds differ a little; the error of each falls as their square root
    numbers = range(len(ERRORS))
    best = [min(marks, key=lambda mark, at=2 + which: mark[at] * np.sqrt(mark[1])) for which in numbers]
    enough = [best[which][2 + which] for which in numbers]
    targets = dict(zip(ERRORS, TARGETS.get(name, ()), strict=False))  # none for single bands
    rows = []
    for mode in MODES if options.paper else ("ours",):
        ours = our_curves(scene, mode, lambda film: reference.errors(film_image(film)), enough, options)
        curves[mode] = ours[0][1:]
        for which, label in enumerate(ERRORS):
            peer, seconds, *_ = best[which]
            spent = np.median([time_to_reach(curve, enough[which], which) for curve in ours])
            last = np.median([curve[2][-1, which] for curve in ours])
            target = targets.get(label) if mode == "ours" else None
            rows.append((name, label, peer, seconds, enough[which], mode, spent, last, target))
            print(f"  {label}: {mode} reaches {enough[which]:.4g} K in {spent:.3f} s", flush=True)
    return rows, curves, gains[best[0][0]]


def our_curves(scene, mode, measure, enough, options):
    """Curves (see our_curve) of all seeds in a mode."""
    changed, context = MODES[mode]
    clock = CLOCKS[options.clock](options.threads)
    curves = []
    with context():
        render(scene, Settings(passes=2, threads=options.threads, **changed))  # compiles
        for seed in range(options.seeds):
            settings = Settings(0, time_limit=1e6, threads=options.threads, seed=seed, **changed, **options.settings)
            goal = 0.0 if seed == 0 else enough  # the first one draws the plot
            curves.append(our_curve(scene, settings, measure, clock, options.seconds, goal))
    return curves


def slope(name, options):
    """Print the error after 1, 2, 4, ... passes and its slope against passes."""
    scene = build(name, options.size)
    reference = load_reference(name, scene, options.cache, options.threads)
    settings = Settings(passes=options.slope, threads=options.threads, **options.settings)
    last = []

    def measure(film):
        last[:] = [film.temperature()]
        return reference.own_errors(last[0])

    passes, _, errors = our_curve(scene, settings, measure, time.perf_counter)
    wanted = sorted({2**i for i in range(int(np.log2(options.slope)) + 1)} | {options.slope})
    chosen = [int(np.argmin(np.abs(passes - p))) for p in wanted]
    print(f"\n{name}: error without the reference's own (its standard error is {reference.standard_error:.3g} K)")
    print("  passes  " + " ".join(f"{p:8d}" for p in passes[chosen]) + "   slope, last decade")
    for which, label in enumerate(("trimmed", "all")):
        error = errors[chosen, which]
        # below, the noise of the product (and where the worst are left out, their choice) hides the error
        known = error > (1.0, 0.3)[which] * reference.standard_error
        late = known & (passes[chosen] >= options.slope / 10)
        fits = [_slope(passes[chosen][part], error[part]) for part in (known, late)]
        cells = (f"{e:8.4f}" if k else f"{'-':>8s}" for e, k in zip(error, known, strict=True))
        print(f"  {label:7s} " + " ".join(cells) + f"   {fits[0]:.2f} {fits[1]:.2f}", flush=True)
    squares = np.sort(reference.own_squares(last[0]).ravel())
    spread, largest = squares.std() / np.sqrt(squares.size), squares[-10:].sum() / squares.sum()
    print(f"  mean square at the end {squares.mean():.2e} +- {spread:.1e} K2 (10 of the pixels make {largest:.0%})")


def _slope(x, y):
    return np.polyfit(np.log(x), np.log(y), 1)[0] if len(x) > 1 else np.nan


def check(name, options):
    """Print how far every engine's long-run image is from the reference, in the mean and pixel by pixel."""
    scene = build(name, options.size)
    reference = load_reference(name, scene, options.cache, options.threads)
    runs = 8
    print(f"\n{name}: deviations of {runs} runs from the reference, in brackets over their standard error")
    for engine in [*options.peers, "ours"]:
        if engine == "ours":
            images = np.array([our_image(scene, seed, options) for seed in range(runs)])
        else:
            problem = peer_problem(engine, scene)
            images, _ = run_peer(engine, problem, options.threads, options.clock, [options.seconds] * runs, polite=True)
        print(f"  {engine:14s} " + _deviations(images, reference), flush=True)


def our_image(scene, seed, options):
    """Image (height, width, bands), W m-2 sr-1 per band, after as many s as a peer gets."""
    settings = Settings(0, seed=seed, time_limit=options.seconds, threads=options.threads, **options.settings)
    return film_image(render(scene, settings))


def film_image(film):
    """Image (height, width, bands), W m-2 sr-1 per band, of a film."""
    return np.moveaxis(film.bands(), 0, -1) * np.diff(film.band_edges)


def _deviations(images, reference):
    """Of the image's mean in all bands and in the worst one, of the worst block of 8x8 pixels and of the pixels."""
    halves, runs = reference.halves, len(images)
    truth = halves.mean(axis=(0, 1, 2))
    bands = 100 * (images.mean(axis=(1, 2)) / truth - 1)  # (runs, bands), %
    truth_error = 50 * np.abs(np.diff(halves.mean(axis=(1, 2)), axis=0)[0]) / truth
    band_error = np.hypot(bands.std(axis=0, ddof=1) / np.sqrt(runs), truth_error)
    band, worst_band = bands.mean(axis=0), np.argmax(np.abs(bands.mean(axis=0)))
    temperature = apparent_temperature(images.sum(axis=-1), reference.edges)
    mean = apparent_temperature(images.mean(axis=0).sum(axis=-1), reference.edges)
    block = _blocks((mean - reference.temperature)[None])[0]
    block_error = np.hypot(
        _blocks(temperature).std(axis=0, ddof=1) / np.sqrt(runs),
        0.5 * _blocks(np.diff(reference.temperatures, axis=0)).std(),
    )
    row, column = np.unravel_index(np.argmax(np.abs(block)), block.shape)
    noise = np.hypot(np.sqrt((temperature.var(axis=0, ddof=1) / runs).mean()), reference.standard_error)
    return (
        f"mean {band.mean():+.4f} %, band {worst_band} {band[worst_band]:+.4f} % "
        f"({band[worst_band] / band_error[worst_band]:+.1f}), block at column {8 * column} row {8 * row} "
        f"{block[row, column]:+.4f} K ({block[row, column] / block_error[row, column]:+.1f}), "
        f"pixels {_errors(mean - reference.temperature)[1]:.4f} K (noise {noise:.4f})"
    )


def _blocks(images):
    """Means of blocks of 8x8 pixels of (n, height, width) images."""
    n, height, width = images.shape
    return images[:, : height // 8 * 8, : width // 8 * 8].reshape(n, height // 8, 8, width // 8, 8).mean(axis=(2, 4))


def print_table(rows):
    print("\n| scene | error | best peer | its time | error, K | engine | its time | ratio | target |")
    print("|---|---|---|--:|--:|---|--:|--:|--:|")
    for scene, label, peer, seconds, error, mode, spent, last, target in rows:
        reached = np.isfinite(spent)
        ours = (f"{spent:.3f} s", f"1/{seconds / spent:.1f}") if reached else (f"never; {last:.4f} K at the end", "-")
        wanted = f"1/{target}" if target else "-"
        cells = (scene, label, peer, f"{seconds:.2f} s", f"{error:.4f}", mode, *ours, wanted)
        print(f"| {' | '.join(cells)} |")


def print_peers(curves, gains):
    """ERRORS, K, of every peer at the end of its run; and of the best one, see gain_of_all_bands_at_once."""
    peers = [engine for engine in next(iter(curves.values())) if engine in ENGINES]
    print(f"\n| scene | {' | '.join(peers)} | all bands at once |\n|---|{'--:|' * len(peers)}--:|")
    for scene, engines in curves.items():
        cells = ["{:.3g}, {:.3g}; {:.3g}, {:.3g}".format(*engines[peer][1][-1]) for peer in peers]
        print(f"| {scene} | {' | '.join(cells)} | 1/{gains[scene]:.1f} |")


def plot(curves, path):
    """Error against time: a row for each scene, trimmed on the left and all pixels on the right."""
    figure, axes = pyplot().subplots(
        len(curves), 2, figsize=(11, 3.6 * len(curves)), squeeze=False, layout="constrained"
    )
    for row, (name, engines) in zip(axes, curves.items(), strict=True):
        for which, (axis, label) in enumerate(zip(row, ("trimmed", "all pixels"), strict=True)):
            for engine, (seconds, errors) in engines.items():
                colour = {"ours": "black", "paper+": "0.6"}.get(engine)
                style = {"color": colour, "linewidth": 2} if colour else {"marker": "o"}
                axis.loglog(seconds, errors[:, which], label=engine, **style)
            axis.set(title=f"{name}, {label}", xlabel="time, s", ylabel="error, K")
            axis.grid(True, which="both", alpha=0.3)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=6)
    figure.savefig(path, dpi=100)
    print(f"\nplot: {path}")


def parse_options():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument(
        "--scene", nargs="+", choices=[*SCENES, *GAS_SCENES], default=list(SCENES), help="scenes (all without gas)"
    )
    parser.add_argument("--size", type=int, nargs=2, metavar=("WIDTH", "HEIGHT"), help="pixels (the scene's own)")
    parser.add_argument("--peers", nargs="+", choices=ENGINES, default=list(ENGINES), help="peers (all of them)")
    parser.add_argument("--out", type=Path, default=Path.cwd(), help="folder for the plot (the current one)")
    parser.add_argument("--cache", type=Path, default=user_cache(), help="folder of the references (%(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="of every engine (%(default)s)")
    parser.add_argument(
        "--clock",
        choices=CLOCKS,
        default="wall",
        help="'processor' counts the processor's time over the threads, for all: for a machine that is busy otherwise",
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="of the peers' runs together (%(default)s)")
    parser.add_argument("--repeats", type=int, default=3, help="of the peers at those seconds (%(default)s)")
    parser.add_argument("--seeds", type=int, default=5, help="of ours (%(default)s)")
    parser.add_argument("--photons", type=int, help="of ours in a pass (the engine's default)")
    parser.add_argument("--paper", action="store_true", help="also paper+, see docs/benchmarks.md")
    parser.add_argument("--slope", type=int, metavar="PASSES", help="only print our error from 1 to PASSES passes")
    parser.add_argument("--check", action="store_true", help="only compare the long-run images of all engines")
    parser.add_argument("--references", action="store_true", help="only render the references that are missing")
    options = parser.parse_args()
    options.settings = {"photons_per_pass": options.photons} if options.photons else {}
    return options


def main():
    options = parse_options()
    rows, curves, gains = [], {}, {}
    for name in options.scene:
        if options.references:
            reference = load_reference(name, build(name, options.size), options.cache, options.threads)
            print(f"{name}: reference with a standard error of {reference.standard_error:.4g} K")
        elif options.check:
            check(name, options)
        elif options.slope:
            slope(name, options)
        else:
            scene_rows, curves[name], gains[name] = compare(name, options)
            rows += scene_rows
    if rows:
        print_table(rows)
        print_peers(curves, gains)
        options.out.mkdir(parents=True, exist_ok=True)
        plot(curves, options.out / "speed_vs_error.png")
    print(f"\n{MADE_AT}")


if __name__ == "__main__":
    main()
