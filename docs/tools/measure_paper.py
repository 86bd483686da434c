# SPDX-License-Identifier: GPL-3.0-or-later
"""Repeat the results of the paper (docs/method.md names it): write the tables of docs/paper.md and draw its pictures.

python -m docs.tools.measure_paper [PART ...]
python -m docs.tools.measure_paper thousand-million [--folder FOLDER] [--passes N]

Parts are tube, times, passes, noise, estimators and blur; without any, all of these.

Times are processor time of one thread: other work on the machine then hardly counts. thousand-million can be stopped
at any time and goes on where it was. Needs the environment of run.py.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from addon.output.exr import channel_name
from addon.output.palette import display, robust_range, thermal
from addon.solver import Film, Material, PointLight, Scene, Settings, render
from addon.solver import passes as pass_loop
from addon.solver.camera import eye_paths
from addon.solver.physics.spectrum import apparent_temperature
from docs.tools.pages import table, write_blocks
from docs.tools.paths import DEMO, DOCS, IMAGES, ROOT
from docs.tools.plots import pyplot
from tests.helpers.paper_estimator import PAPER, changed, papers_estimator
from tests.helpers.process import resident
from tests.helpers.scenes import join, look, make_scene, quad

PAGE, SCRIPT = DOCS / "paper.md", "docs/tools/measure_paper.py"

SIZE = 256  # pixels on each side of a picture, as in the paper
PHOTONS = 30_000_000  # thrown in all, of which about a tenth is stored: the paper's 3,000,000
TIMED = (1, 2, 5, 10, 30, 60)  # passes of figure 2
GATHERED = 600  # photons that all maps together count in one estimate, figure 2
SEEDS = 5  # of figure 3, to tell chance
NOISE_PHOTONS, NOISE_NEIGHBOURS = 30_000_000, 500  # of a pass of figure 4; a tenth of the photons is stored
NOISE_PASSES = (1, 5, 20, 250)  # of its pictures
TUBE_PHOTONS, TUBE_PASSES = 1_360_000, 100  # thrown in one pass of figure 1, of which a million are stored
COMPARED = Settings(passes=30, photons_per_pass=1_000_000, neighbours=51)  # both estimators
TRUTH = Settings(passes=40, photons_per_pass=1_000_000, seed=1000)
MANY_PASSES, MANY_PHOTONS = 200, 5_000_000  # of thousand-million


# The scenes -----------------------------------------------------------------------------------------------------------

BANDS = np.linspace(7.5, 13.5, 16)  # um
METAL = Material("oxidised metal", np.array([[7.5, 0.24], [9.0, 0.20], [11.0, 0.17], [13.5, 0.15]]), specular=1.0)


def wall(radius: float, low: float, high: float, segments: int = 512):
    """Vertices and triangles of a cylinder around the z axis without ends. m."""
    angle = 2.0 * np.pi * np.arange(segments) / segments
    circle = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
    return np.concatenate([np.column_stack((circle, np.full(segments, z))) for z in (low, high)]), strip(segments)


def disk(inner: float, outer: float, height: float, segments: int = 512):
    """Vertices and triangles of a level ring of no thickness. m."""
    vertices, triangles = wall(1.0, 0.0, 1.0, segments)
    scale = np.where(vertices[:, 2] == 0.0, outer, inner)
    return np.column_stack((vertices[:, :2] * scale[:, None], np.full(len(vertices), height))), triangles


def strip(segments: int) -> np.ndarray:
    """Triangles that join two circles of so many points, one behind the other."""
    here = np.arange(segments)
    there = (here + 1) % segments
    lower = np.stack((here, there, there + segments), axis=1)
    return np.concatenate((lower, np.stack((here, there + segments, here + segments), axis=1)))


def ring_scene() -> Scene:
    """Section 5.2: an emissive specular ring on a diffuse plane, with a point light that throws a caustic into it.

    The sizes are those of the demo. Space around is at 0 K: what flies off is lost, as in the paper.
    """
    plane = quad((0, 0, 0), (0.6, 0, 0), (0, 0.6, 0))
    ring = [wall(0.1, 0.0, 0.05), wall(0.106, 0.0, 0.05), disk(0.1, 0.106, 0.05)]
    parts = [(*plane, 293.0, 0), *((*part, 340.0, 1) for part in ring)]
    vertices, triangles, temperature, material = join(*parts)
    azimuth = math.radians(245.0)
    light = PointLight(np.array([0.1 * math.cos(azimuth), 0.1 * math.sin(azimuth), 0.13]), 400.0, temperature=1000.0)
    camera = look((0, -0.36, 0.46), (0, -0.01, 0.01), SIZE, SIZE, tangent=18 / 58)
    materials = [Material("slate", 0.7), METAL]
    return make_scene(
        vertices, triangles, temperature, materials, camera, BANDS, material, lights=(light,), world_temperature=0.0
    )


def tube_scene() -> Scene:
    """Figure 1: an emissive and specular tube, alone in space at 0 K. Half of what it reflects is diffuse.

    What is seen in it is its own light, reflected again and again.
    """
    vertices, triangles = wall(0.1, 0.0, 0.25)
    tube = Material("metal, half dull", METAL.emissivity, specular=0.5)
    camera = look((0.0, -0.35, 0.62), (0.0, -0.01, 0.13), SIZE, SIZE, tangent=0.28)
    return make_scene(vertices, triangles, 340.0, [tube], camera, BANDS, world_temperature=0.0)


# Both estimators ------------------------------------------------------------------------------------------------------


def papers(scene: Scene, on_pass: Callable[[Film], None] | None = None, **settings) -> Film:
    """Render with the paper's estimator in one thread. neighbours: photons that count; the engine asks for one more."""
    settings["neighbours"] += 1
    with papers_estimator():
        return render(scene, Settings(threads=1, **PAPER | settings), on_pass)


def ours(scene: Scene, on_pass: Callable[[Film], None] | None = None, **settings) -> Film:
    """Render with the engine's estimator, as it is by default, in one thread if not told otherwise."""
    return render(scene, Settings(**{"threads": 1} | settings), on_pass)


@dataclass
class Phases:
    """Processor time of the phases of a render, s, and what it stored. gathering: the part of rendering that looks for
    photons; the rest is camera rays.
    """

    tracing: float = 0.0
    sorting: float = 0.0
    rendering: float = 0.0
    gathering: float = 0.0
    stored: int = 0
    _end: float = field(default=0.0, repr=False)

    @property
    def total(self) -> float:
        return self.tracing + self.sorting + self.rendering

    @contextmanager
    def watch(self) -> Iterator[Callable[[Film], None]]:
        """Add up what is rendered meanwhile; gives the on_pass of that render."""
        prepare, build, reflect = pass_loop.prepare, pass_loop.build_photon_map, eye_paths.reflect

        def after_prepare(*arguments):
            model = prepare(*arguments)
            self._end = time.process_time()
            return model

        def timed_build(photons, *arguments):
            begin = time.process_time()
            self.tracing += begin - self._end
            photon_map = build(photons, *arguments)
            self._end = time.process_time()
            self.sorting += self._end - begin
            self.stored += len(photons.surface)
            return photon_map

        def timed_reflect(*arguments):
            begin = time.process_time()
            reflect(*arguments)
            self.gathering += time.process_time() - begin

        def on_pass(film: Film) -> None:
            now = time.process_time()
            self.rendering += now - self._end
            self._end = now

        changes = {
            "passes.prepare": after_prepare,
            "passes.build_photon_map": timed_build,
            "camera.eye_paths.reflect": timed_reflect,
        }
        with changed(changes):
            yield on_pass


# Figures --------------------------------------------------------------------------------------------------------------


Panels = list[tuple[str, np.ndarray]]  # a row of images (h, w), row 0 at the bottom, and their titles


def draw(name: str, rows: list[Panels], unit: str) -> None:
    """Rows of images in images/, with the colours of the very last one's range."""
    from matplotlib.colors import ListedColormap

    plt = pyplot()
    low, high = robust_range(rows[-1][-1][1])
    colours = ListedColormap(display(thermal(np.linspace(0, 1, 256), 0, 1)) / 255)
    columns = max(map(len, rows))
    size = (3.6 * columns + 0.8, 3.8 * len(rows))
    figure, axes = plt.subplots(len(rows), columns, figsize=size, layout="constrained", squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for row, panels in zip(axes, rows, strict=True):
        for axis, (title, image) in zip(row, panels, strict=False):  # a row may be shorter
            axis.set_title(title, fontsize=10)
            shown = axis.imshow(image, colours, vmin=low, vmax=high, origin="lower", interpolation="nearest")
    figure.colorbar(shown, ax=axes, shrink=0.7, label=unit)
    figure.savefig(IMAGES / f"paper-{name}.png", dpi=80)
    plt.close(figure)


RADIANCE = "radiance, W m-2 sr-1"


class Blocks:
    """Noise of the mean of so many passes, from the spread of the blocks of that size that one render falls into."""

    def __init__(self, sizes: tuple[int, ...]):
        self.images = {size: [] for size in sizes}
        self._sums = dict.fromkeys(sizes, 0.0)

    def add(self, film: Film) -> None:
        """To be called after every pass."""
        total = film.passes * film.radiance().astype(np.float64)
        for size, images in self.images.items():
            if film.passes % size == 0:
                images.append(((total - self._sums[size]) / size).astype(np.float32))
                self._sums[size] = total

    def noise(self, size: int) -> float:
        """Root mean square over the pixels, W m-2 sr-1; NaN if there is one block only."""
        if len(self.images[size]) < 2:
            return math.nan
        return float(np.sqrt(np.var(self.images[size], axis=0, ddof=1).mean()))


def keep(counts: tuple[int, ...], who: str, panels: Panels) -> Callable[[Film], None]:
    """To be called after every pass: add the images after so many passes to the panels."""

    def on_pass(film: Film) -> None:
        if film.passes in counts:
            panels.append((f"{who}, {film.passes} pass{'es' * (film.passes > 1)}", film.radiance()))

    return on_pass


def ours_after(counts: tuple[int, ...], scene: Scene, photons: int, blocks: Blocks) -> Panels:
    """Images of the engine's estimator after so many passes, each of so many photons. blocks: to be filled."""
    panels = []
    keep_panels = keep(counts, "here", panels)

    def on_pass(film):
        blocks.add(film)
        keep_panels(film)

    ours(scene, on_pass, passes=counts[-1], photons_per_pass=photons, threads=0)
    return panels


def tube() -> str:
    """Figure 1: few and many photons."""
    counts, scene, phases = (1, TUBE_PASSES), tube_scene(), Phases()
    blocks, of_ours = (Blocks((1, TUBE_PASSES // 2)) for _ in range(2))
    stored, theirs = [], []
    keep_theirs = keep(counts, "paper", theirs)
    with phases.watch() as add_times:

        def on_pass(film):
            add_times(film)
            blocks.add(film)
            keep_theirs(film)
            stored.append(phases.stored)

        papers(scene, on_pass, passes=TUBE_PASSES, photons_per_pass=TUBE_PHOTONS, neighbours=50)
    draw("tube", [theirs, ours_after(counts, scene, TUBE_PHOTONS, of_ours)], RADIANCE)

    def noises(passes):
        return f"{blocks.noise(passes):.3f}", f"{of_ours.noise(passes):.3f}"

    return table(
        ("passes", "photons stored", "paper: photons in the map", "noise, W m-2 sr-1", "noise of ours"),
        (1, f"{stored[0]:,}", "1,000,000", *noises(1)),
        (TUBE_PASSES // 2, f"{stored[-1] // 2:,}", "", *noises(TUBE_PASSES // 2)),
        (TUBE_PASSES, f"{stored[-1]:,}", "about 100,000,000", "", ""),
    )


def times() -> str:
    """Figure 2: the same photons in more and more passes."""
    scene, theirs, here = ring_scene(), {}, {}
    papers(scene, passes=1, photons_per_pass=1000, neighbours=10)  # loads the kernels
    ours(scene, passes=1, photons_per_pass=1000)
    for passes in TIMED:
        settings = {"passes": passes, "photons_per_pass": PHOTONS // passes}
        theirs[passes], here[passes] = Phases(), Phases()
        with theirs[passes].watch() as on_pass:
            papers(scene, on_pass, neighbours=GATHERED // passes, **settings)
        with here[passes].watch() as on_pass:
            ours(scene, on_pass, **settings)
    draw_times(theirs, here)
    head = ("tracing", "sorting", "rendering", "of it gathers", "of it camera rays", "all", "all but camera rays")
    rows = []
    for m, p in theirs.items():
        camera = p.rendering - p.gathering
        spent = (p.tracing, p.sorting, p.rendering, p.gathering, camera, p.total, p.total - camera)
        spent += (here[m].tracing, here[m].sorting, here[m].rendering, here[m].total)
        rows.append((m, f"{p.stored:,}", GATHERED // m, *(f"{seconds:.1f}" for seconds in spent)))
    head += tuple(f"ours: {name}" for name in ("tracing", "sorting", "rendering", "all"))
    seconds = (f"{name}, s" for name in head)
    return table(("passes", "photons stored", "neighbours", *seconds), *rows)


def draw_times(theirs: dict[int, Phases], here: dict[int, Phases]) -> None:
    """Times of the paper's estimator and of ours against passes in images/."""
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    for name in ("tracing", "sorting", "rendering", "gathering", "total"):
        axis.plot(list(theirs), [getattr(phases, name) for phases in theirs.values()], "o-", label=name)
    axis.plot(list(here), [phases.total for phases in here.values()], "k--", label="our estimator, total")
    axis.set(xlabel="passes", ylabel="processor time of one thread, s", ylim=(0, None), xlim=(0, None))
    axis.grid(color="0.9")
    axis.legend()
    figure.savefig(IMAGES / "paper-times.png", dpi=80)
    plt.close(figure)


def passes() -> str:
    """Figure 3: one pass against thirty, with the neighbours of section 4.3, with those of the figure, and ours."""
    scene = ring_scene()
    cases = {
        "1 pass, 600 neighbours": (papers, 1, {"neighbours": 600}),
        "30 passes, 20": (papers, 30, {"neighbours": 20}),
        "30 passes, 50": (papers, 30, {"neighbours": 50}),
        "here, 1 pass": (ours, 1, {}),
        "here, 30 passes": (ours, 30, {}),
    }
    images = {
        name: [
            draw_it(scene, passes=m, photons_per_pass=PHOTONS // m, seed=seed, **settings).radiance().astype(float)
            for seed in range(SEEDS)
        ]
        for name, (draw_it, m, settings) in cases.items()
    }
    panels = [(name, images[name][0]) for name in cases]
    draw("passes", [panels[:3], panels[3:]], RADIANCE)
    statistics = {}
    for name, of_seeds in images.items():
        mean, deviation = np.mean(of_seeds, axis=(1, 2)), np.std(of_seeds, axis=(1, 2))
        statistics[name] = np.array([mean, deviation])

    def cell(values):
        return f"{values.mean():.4f} +- {values.std(ddof=1) / SEEDS**0.5:.4f}"

    def change(values, one):  # of independent seeds
        error = math.hypot(*(v.std(ddof=1) / SEEDS**0.5 / v.mean() for v in (values, one)))
        return f"{values.mean() / one.mean() - 1:+.3%} +- {error:.3%}"

    one, *many = statistics.values()
    return table(
        ("", *cases, "paper: 1 pass", "paper: 30 passes"),
        ("mean", *(cell(mean) for mean, _ in statistics.values()), "1.39736", "1.39929"),
        ("standard deviation", *(cell(deviation) for _, deviation in statistics.values()), "1.19078", "1.19402"),
        ("mean, against the first", "", *(change(other[0], one[0]) for other in many), "", "+0.138%"),
        ("standard deviation, against the first", "", *(change(other[1], one[1]) for other in many), "", "+0.272%"),
    )


def noise() -> str:
    """Figure 4: more and more passes."""
    most = NOISE_PASSES[-1]
    sizes = (*NOISE_PASSES[:-1], 2 * NOISE_PASSES[1], 2 * NOISE_PASSES[2], most // 2)
    scene, theirs = ring_scene(), []
    blocks, of_ours = (Blocks(tuple(sorted(sizes))) for _ in range(2))
    keep_theirs = keep(NOISE_PASSES, "paper", theirs)

    def on_pass(film):
        blocks.add(film)
        keep_theirs(film)

    papers(scene, on_pass, passes=most, photons_per_pass=NOISE_PHOTONS, neighbours=NOISE_NEIGHBOURS)
    draw("noise", [theirs, ours_after(NOISE_PASSES, scene, NOISE_PHOTONS, of_ours)], RADIANCE)

    def noises(of, passes):
        return f"{of.noise(passes):.4f}", f"{of.noise(passes) / of.noise(1):.4f}"

    head = "noise, W m-2 sr-1", "over that of 1 pass", "1 / root of the passes", "paper: 1 / passes"
    return table(
        ("passes", "blocks", *head, "noise of ours", "over that of 1 pass"),
        *(
            (m, len(images), *noises(blocks, m), f"{m**-0.5:.4f}", f"{1 / m:.4f}", *noises(of_ours, m))
            for m, images in blocks.images.items()
        ),
    )


def estimators() -> str:
    """The paper's estimator and the engine's, as it is by default, on the paper's scene."""
    scene = ring_scene()
    truth = render(scene, TRUTH)
    exact = apparent_temperature(truth.radiance().astype(float), BANDS)
    own = float(np.sqrt(np.mean(truth.noise() ** 2)))
    ours(scene, passes=1, photons_per_pass=1000)  # loads the kernels, as above
    papers(scene, passes=1, photons_per_pass=1000, neighbours=10)
    rows, shown = [], []

    def measure(name, draw_it):
        phases = Phases()
        with phases.watch() as on_pass:
            film = draw_it(on_pass)
        error = film.temperature() - exact
        sizes = np.sort(np.abs(error.ravel()))
        rows.append(
            (
                name,
                film.passes,
                f"{film.photons / 1e6:g} million",
                f"{phases.total:.1f}",
                f"{film.radiance().mean(dtype=float):.3f}",
                f"{math.sqrt(max(0.0, np.mean(error**2) - own**2)):.3f}",
                f"{np.median(sizes):.3f}",
            )
        )
        shown.append((f"{name}, {film.passes} passes", film.temperature()))
        return phases.total

    values = {name: getattr(COMPARED, name) for name in ("passes", "photons_per_pass")}
    spent = measure("paper", lambda on_pass: papers(scene, on_pass, neighbours=COMPARED.neighbours - 1, **values))
    measure("here, same photons", lambda on_pass: ours(scene, on_pass, **values))
    limit = time.process_time() + spent
    measure(
        "here, same time",
        lambda on_pass: render(
            scene, Settings(threads=1, passes=10**6), on_pass, cancelled=lambda: time.process_time() > limit
        ),
    )
    draw("estimators", [shown[:2], [shown[2], ("truth", exact)]], "apparent temperature, K")
    head = ("estimator", "passes", "photons thrown", "processor time, s", "mean, W m-2 sr-1", "error, K", "median, K")
    last = f"Truth: {truth.passes} passes of {TRUTH.photons_per_pass:,} photons of another seed, mean "
    last += f"{truth.radiance().mean(dtype=float):.3f} W m-2 sr-1, noise {own:.3f} K (root mean square)."
    return f"{table(head, *rows)}\n\n{last}"


def blur() -> str:
    """The mean of the paper's estimator with smaller and smaller disks of the same maps."""
    scene, rows = ring_scene(), []
    for neighbours in (667, 67, 7):
        film = papers(scene, passes=3, photons_per_pass=PHOTONS // 3, neighbours=neighbours, seed=7)
        rows.append((neighbours, f"{math.sqrt(neighbours / 667):.2f}", f"{film.radiance().mean(dtype=float):.3f}"))
    return table(("neighbours", "radius of the disk, over the first", "mean, W m-2 sr-1"), *rows)


# A thousand million photons in Blender --------------------------------------------------------------------------------

BLENDER_ALONE = """
import bpy
from tests.helpers.process import resident
bpy.ops.wm.open_mainfile(filepath={blend!r}, load_ui=False)
class Blank(bpy.types.RenderEngine):
    bl_idname, bl_label = "BLANK", "A render result of the same passes, without a solver"
    def update_render_passes(self, scene=None, renderlayer=None):
        for name in {names!r}:
            self.register_pass(scene, renderlayer, name, 1, "V", "VALUE")
    def render(self, depsgraph):
        for name in {names!r}:
            self.add_pass(name, 1, "V")
        self.end_result(self.begin_result(0, 0, {size}, {size}))
bpy.utils.register_class(Blank)
scene = bpy.context.scene
scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "BLANK", {size}, {size}
bpy.ops.render.render()
bpy.utils.unregister_class(Blank)
print("peak", resident("VmHWM"))
"""


def run_python(script: str) -> str:
    """What a script prints in a process of its own, whose memory is not ours."""
    command = [sys.executable, "-c", script]
    return subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True, timeout=600).stdout


def memory_of_blender(names: list[str]) -> float:
    """Peak memory of Blender that opens the demo and makes a render result of these passes, MiB."""
    script = BLENDER_ALONE.format(blend=str(DEMO), names=names, size=SIZE)
    return float(run_python(script).split("peak")[-1]) / 2**20


def render_photons(folder: Path, passes: int) -> dict[str, float]:
    """Render the demo as F12 does, into folder, and go on from the checkpoint that is there; what it took.

    seconds, processor: of the passes rendered now, as many as `passes` says. peak: MiB.
    """
    import bpy

    from docs.tools.blender import open_demo, registered

    with registered():
        scene = open_demo()
        scene.render.resolution_x = scene.render.resolution_y = SIZE
        infrared = scene.infrared
        infrared.passes, infrared.photons_per_pass, infrared.threads = passes, MANY_PHOTONS, 1
        infrared.checkpoint_path, infrared.checkpoint_minutes = str(folder / "passes.npz"), 2.0
        infrared.band_exr_path = str(folder / "image.exr")
        begin = time.monotonic(), time.process_time()
        bpy.ops.render.render()
        spent = time.monotonic() - begin[0], time.process_time() - begin[1]
        return {"seconds": spent[0], "processor": spent[1], "peak": resident("VmHWM") / 2**20}


def compile_kernels() -> None:
    """Render a little elsewhere: the compiler's memory is not the renderer's."""
    run_python("""
from docs.tools import measure_paper as paper
paper.render(paper.ring_scene(), paper.Settings(passes=1, photons_per_pass=1000))
""")


def thousand_million(folder: Path, passes: int) -> str:
    """Render so many passes into folder; the picture, and the memory that it took."""
    import OpenEXR

    folder.mkdir(parents=True, exist_ok=True)
    compile_kernels()
    figures = render_photons(folder, passes)
    with OpenEXR.File(str(folder / "image.exr")) as file:
        channels, photons = file.channels(), int(file.header()["photons"])
        radiance, noise = (channels[channel_name(name)].pixels[::-1] for name in ("Radiance", "Noise"))
    draw("thousand-million", [[(f"{photons:,} photons", apparent_temperature(radiance, BANDS))]], "K")
    alone = memory_of_blender(list(channels))
    return table(
        ("", "here", "wanted"),
        ("photons", f"{photons:,}", "1,000,000,000"),
        ("passes", passes, ""),
        ("peak memory of Blender alone, MiB", f"{alone:.0f}", ""),
        ("peak memory with the render, MiB", f"{figures['peak']:.0f}", ""),
        ("above Blender, MiB", f"{figures['peak'] - alone:.0f}", "at most 512"),
        ("minutes, and of processor time", f"{figures['seconds'] / 60:.0f}, {figures['processor'] / 60:.0f}", ""),
        (
            "noise, K: median of the pixels; 95 % are below",
            f"{np.median(noise):.4f}; {np.percentile(noise, 95):.4f}",
            "",
        ),
    )


# The page -------------------------------------------------------------------------------------------------------------

PARTS = {"tube": tube, "times": times, "passes": passes, "noise": noise, "estimators": estimators, "blur": blur}


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} or thousand-million")
    parser.add_argument("--folder", type=Path, default=ROOT / "render" / "thousand-million")
    parser.add_argument("--passes", type=int, default=MANY_PASSES, help="of thousand-million, if not %(default)s")
    options = parser.parse_args(arguments)
    parts = PARTS | {"thousand-million": lambda: thousand_million(options.folder, options.passes)}
    for name in options.parts or PARTS:
        if name not in parts:
            parser.error(f"there is no part '{name}'")
        text = parts[name]()
        write_blocks(PAGE, SCRIPT, {name: text})
        print(f"{name}\n\n{text}\n", flush=True)


if __name__ == "__main__":
    main()
