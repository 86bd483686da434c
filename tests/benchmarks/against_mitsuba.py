# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole families of hard scenes (families.py) against path tracers: are images right, and are they as sure as they say?

    python -m tests.benchmarks.against_mitsuba [--families NAME ...] [--members N] [--passes M ...] [--brute]

Mitsuba renders the reference of the excess over the ambient, in a process of its own; --python names the interpreter
that has it, if it is another. With --brute, and always where there is gas, which does not shine in Mitsuba, references
are by the path tracer of the tests, slower by far where small things are hot; pixels that none of its paths lit then
seem to be known exactly. References are kept in the user's cache
folder as independent images; a run that wants a longer one adds to them.

Of each member it prints, for each number of passes:

mean: error of the picture's mean, K, and over its own standard error. Passes are independent, so their spread tells it.
rms: root mean square over the pixels of the error over the stated one; 1 is honest. The stated one is film.noise(),
    with the reference's own standard error in quadrature. Pixels that seem to be known exactly do not count.
>3, >5: share of pixels whose error is more than 3 and 5 stated ones, these with ALLOWANCE in quadrature, too.
block: the block of 4 x 4 pixels that is off the most in its own standard errors (spread of passes, with the same in
    quadrature), and where (column and row from the top); and the one that is off the most in K.
noise: that the median pixel states, K.
check: what the engine itself finds that its recalled light misses, K, in the region of 4 x 4 regions where that is the
    most over its standard error, and that ratio (Film.missed).

With --twice each member is rendered once more with another seed: root mean square of the difference of the two over
their stated errors, and the share of pixels that differ by more than 3 and 5 of these. That tells whether noise is what
it states where references are noisier than we are, as those of the path tracer are, but no bias.

It ends with an error where that ratio is above SIGNIFICANT and the reference agrees: the picture's mean is more than 3,
or a block more than SIGNIFICANT, of its standard errors off. By itself the check may be wrong where light is rare: the
few rays that look for it mostly find less than is recalled. Its standard error has a fifth of ALLOWANCE in quadrature.

Errors are differences of apparent temperatures; those of means are errors of radiance over dB/dT at the pixel's
apparent temperature. With --excess LEFT TOP RIGHT BOTTOM the mean excess of a window is printed, too: radiance less
that of a blackbody at the ambient temperature, over dB/dT there, in K.
"""

import argparse
import hashlib
import pickle
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from addon.solver import Settings, render
from addon.solver.image.pooling import pooled_variance
from addon.solver.image.self_check import GRID, region_means, regions
from addon.solver.physics.spectrum import apparent_temperature
from tests.benchmarks.families import FAMILIES, member
from tests.benchmarks.peers.problem import build_problem
from tests.benchmarks.speed_vs_error import run_peer, user_cache
from tests.helpers.exact_cases import PHOTONS
from tests.helpers.path_tracer import black_radiance, black_slope, standard_error, trace_paths

ALLOWANCE = 0.002  # K, of what is not noise
SIGNIFICANT = 5.0  # standard errors: of 2000 regions and more none by chance
BLOCK = 4
_EXACT = 1e-5  # K, below which images in float32 tell nothing of an error
_CHUNK, _BRUTE_CHUNK = 2.0, 5.0  # s of each independent image of a reference, by Mitsuba and by the tests' path tracer:
# they count alike, and their spread tells its standard error
_SIZE = 1000.0  # that Mitsuba's scenes are enlarged to: it moves rays off a surface by 1e-4 of (1 + coordinate)


@dataclass
class Truth:
    """excess (n, height, width): independent images of the excess radiance over the ambient, W m-2 sr-1.

    edges of the band, um, and ambient, K. From them: radiance (height, width), its temperature, K, slope dB/dT there,
    and error, the standard error in K, told by neighbours, too, as in Film.noise: a pixel that no path of the reference
    lit has no spread of its own.
    """

    excess: np.ndarray
    edges: np.ndarray
    ambient: float

    def __post_init__(self):
        self.radiance = self.excess.mean(axis=0) + black_radiance(self.edges, self.ambient)[0]
        self.temperature = apparent_temperature(self.radiance, self.edges)
        self.slope = slope(self.temperature, self.edges)
        deviation = self.excess - self.excess.mean(axis=0)
        powers = (np.sum(deviation**power, axis=0) for power in (2, 4))
        variance = pooled_variance(*powers, np.ones(self.slope.shape, np.bool_), len(self.excess)) / len(self.excess)
        self.error = np.sqrt(variance) / self.slope


def slope(kelvin, edges):
    """dB/dT, W m-2 sr-1 K-1, at apparent temperatures of any shape."""
    step = 1e-3 * kelvin
    return (black_radiance(edges, kelvin + step) - black_radiance(edges, kelvin - step))[..., 0] / (2 * step)


# References


def load_truth(name, scene, options):
    """Truth of a member from the cache folder, with as many seconds of rendering as are wanted added to it."""
    brute = options.brute or len(scene.media) > 0
    problem = None if brute else mitsuba_problem(scene)
    kept_as = f"brute-{digest(scene)}" if brute else f"mitsuba-{problem.digest()}"
    path = options.cache / "families" / f"{name}-{kept_as}.npz"
    images = np.empty((0, scene.camera.height, scene.camera.width))
    if path.exists():
        with np.load(path) as kept:
            images = kept["images"]
    count = max(8, round(options.seconds / (_BRUTE_CHUNK if brute else _CHUNK))) - len(images)
    if count > 0:
        more = brute_images(scene, count, len(images), options) if brute else mitsuba_images(problem, count, options)
        images = np.concatenate((images, more))
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, images=images)
    return Truth(images, scene.band_edges, ambient(scene))


def ambient(scene):
    """T0 of the reference, K: the surroundings', or of a sky the lowest, as Mitsuba samples no sky that is negative."""
    return scene.world_temperature if scene.sky is None else float(scene.sky.kelvin.min())


def digest(scene):
    """Twelve letters that change with the scene."""
    of = hashlib.sha256()
    for value in (scene.vertices, scene.triangles, scene.material, scene.temperature, scene.camera.matrix):
        of.update(np.round(np.ascontiguousarray(value, np.float64), 7).tobytes())
    surfaces = [(material.emissivity, material.specular, material.roughness) for material in scene.materials]
    of.update(repr((surfaces, scene.camera, scene.band_edges, scene.world_temperature)).encode())
    varies = [material.transmittance for material in scene.materials], scene.textures, scene.corner_normals, scene.sky
    if any(material.transmits for material in scene.materials) or any(one is not None for one in varies[1:]):
        of.update(pickle.dumps(varies))
    if scene.media:
        of.update(pickle.dumps((scene.media, scene.world_depth)))
    return of.hexdigest()[:12]


def mitsuba_problem(scene):
    """The problem of the excess, enlarged to _SIZE."""
    problem = build_problem(scene, ambient(scene), all_lobes=True)
    centre = 0.5 * (problem.vertices.min(axis=0) + problem.vertices.max(axis=0))
    scale = _SIZE / np.abs(problem.vertices - centre).max()
    problem.vertices, problem.matrix = (problem.vertices - centre) * scale, np.array(problem.matrix, float)
    problem.matrix[:3, 3] = (problem.matrix[:3, 3] - centre) * scale
    for skin in problem.skins:
        skin.corners = (skin.corners - centre) * scale
    return problem


def mitsuba_images(problem, count, options):
    """(count, height, width) independent images of the excess, of _CHUNK seconds each."""
    budgets = [_CHUNK] * count
    images, _ = run_peer("mitsuba", problem, options.threads, "processor", budgets, polite=True, python=options.python)
    return images[..., 0] - problem.offset[0]


def brute_images(scene, count, first, options):
    """The same by the tests' path tracer."""
    trace_paths(scene, 1, 1)  # compiles
    started = time.perf_counter()
    trace_paths(scene, 32, 1)
    rate = 32 / (time.perf_counter() - started)
    samples = max(1, round(options.threads * rate * _BRUTE_CHUNK))
    return trace_paths(scene, samples, count, seed=1, first_batch=first, threads=options.threads).images[..., 0]


# Our images


@dataclass
class Ours:
    """Of a film after some passes: temperature and noise (height, width), K; radiance (height, width) W m-2 sr-1; and
    passes (n, height / 4, width / 4), K: mean over each block of the radiance of each pass over the truth's slope.
    missed (2, GRID, GRID): see Film.missed, but in K."""

    temperature: np.ndarray
    noise: np.ndarray
    radiance: np.ndarray
    passes: np.ndarray
    missed: np.ndarray


def our_images(scene, truth, options, seed):
    """{passes: Ours} of one render."""
    sums, kept = [np.zeros(truth.slope[::BLOCK, ::BLOCK].shape)], {}

    def note(film):
        excess = film.layer_means().reshape(truth.slope.shape)
        sums.append(film.passes * blocks(excess / truth.slope))
        if film.passes in options.passes:
            radiance = excess + black_radiance(scene.band_edges, film.reference_temperature)[0]
            over = region_means(truth.slope.ravel(), regions(film.width, film.height)).reshape(GRID, GRID)
            missed = np.stack(film.missed()) / over
            kept[film.passes] = Ours(film.temperature(), film.noise(), radiance, np.diff(sums, axis=0), missed)

    settings = Settings(max(options.passes), photons_per_pass=options.photons, seed=seed, threads=options.threads)
    render(scene, settings, note)
    return kept


def blocks(image):
    """Means (..., height / 4, width / 4) of blocks of 4 x 4 pixels."""
    *rest, height, width = image.shape
    return image.reshape(*rest, height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(-3, -1))


# Comparison


@dataclass
class Comparison:
    """See the module's docstring. All in K or numbers; where: column and row of a block's first pixel, from the top."""

    mean: float
    mean_ratio: float
    rms: float
    beyond3: float
    beyond5: float
    block: float
    block_ratio: float
    where: tuple[int, int]
    largest: float
    largest_where: tuple[int, int]
    missed: float
    missed_ratio: float

    @property
    def recalls_wrongly(self):
        is_off = abs(self.mean_ratio) > 3.0 or abs(self.block_ratio) > SIGNIFICANT
        return is_off and abs(self.missed_ratio) > SIGNIFICANT

    def __str__(self):
        return (
            f"mean {self.mean:+8.4f} K ({self.mean_ratio:+6.1f})   rms {self.rms:6.2f}   >3 {self.beyond3:6.2%}   "
            f">5 {self.beyond5:6.2%}   block {self.block_ratio:+7.1f}, {self.block:+8.3f} K at {self.where}   "
            f"largest {self.largest:+8.3f} K at {self.largest_where}   "
            f"check {self.missed:+8.4f} K ({self.missed_ratio:+5.1f})"
        )


def compare(ours, truth):
    """Comparison of our image with the truth."""
    stated = np.hypot(ours.noise, truth.error)
    rms, beyond3, beyond5 = far_off(ours.temperature - truth.temperature, stated)
    difference = blocks((ours.radiance - truth.radiance) / truth.slope)
    reference = blocks(truth.excess / truth.slope)
    error = np.hypot(standard_error(ours.passes), standard_error(reference))
    mean_error = np.hypot(*(standard_error(each.mean(axis=(1, 2))) for each in (ours.passes, reference)))
    ratios = difference / np.hypot(error, ALLOWANCE)
    missed, its_error = ours.missed
    # with ALLOWANCE, as regions in which next to nothing is recalled have no error to speak of
    over = missed / np.hypot(its_error, ALLOWANCE / SIGNIFICANT)
    worst, largest, check = (np.unravel_index(np.argmax(np.abs(of)), of.shape) for of in (ratios, difference, over))
    return Comparison(
        difference.mean(),
        difference.mean() / np.hypot(mean_error, 0.1 * ALLOWANCE),
        rms,
        beyond3,
        beyond5,
        difference[worst],
        ratios[worst],
        place(worst, difference.shape),
        difference[largest],
        place(largest, difference.shape),
        missed[check],
        over[check],
    )


def far_off(difference, stated):
    """Root mean square of differences (K) over their stated errors, and the shares beyond 3 and 5; see the module."""
    known, ratio = stated < _EXACT, np.abs(difference) / np.hypot(stated, ALLOWANCE)
    return np.sqrt(np.mean(np.square(difference[~known] / stated[~known]))), np.mean(ratio > 3), np.mean(ratio > 5)


def place(block, shape):
    """Column and row from the top of the first pixel of a block (row from the bottom, column)."""
    return int(BLOCK * block[1]), int(BLOCK * (shape[0] - 1 - block[0]))


def window_excess(excess, truth, window):
    """Mean over a window (left, top, right, bottom; ends are inside), K, of images (..., height, width)."""
    left, top, right, bottom = window
    rows = slice(excess.shape[-2] - 1 - bottom, excess.shape[-2] - top)
    return excess[..., rows, left : right + 1].mean(axis=(-2, -1)) / black_slope(truth.edges, truth.ambient)


def compare_member(family, index, options):
    """{passes: Comparison}, which are printed."""
    scene = member(family, index)
    truth = load_truth(f"{family}{index}", scene, options)
    print(
        f"{family} {index}: {len(scene.triangles)} triangles; reference: standard error {np.median(truth.error):.4f} K "
        f"in the median pixel, {np.sqrt(np.mean(truth.error**2)):.4f} K rms"
    )
    found = {}
    other = our_images(scene, truth, options, options.seed + 1) if options.twice else {}
    for passes, ours in our_images(scene, truth, options, options.seed).items():
        found[passes] = compare(ours, truth)
        print(f"  {passes:5d} passes: {found[passes]}   noise {np.median(ours.noise):.4f} K", flush=True)
        if passes in other:
            twin = other[passes]
            apart = far_off(ours.temperature - twin.temperature, np.hypot(ours.noise, twin.noise))
            print("        two seeds: rms {:.2f}   >3 {:.2%}   >5 {:.2%}".format(*apart), flush=True)
        if options.excess:
            excess = ours.radiance - black_radiance(truth.edges, truth.ambient)[0]
            exact = window_excess(truth.excess, truth, options.excess)
            print(
                f"        excess in the window: {window_excess(excess, truth, options.excess):.4f} K, "
                f"reference {exact.mean():.4f} +- {standard_error(exact):.4f} K"
            )
    return found


def print_summary(results):
    """One row for each family and number of passes: means of squares over the members, and the worst."""
    columns = "family", "passes", "members", "mean, rms of ratios", "rms", ">3", ">5", "worst block, ratio"
    columns += "worst block, K", "check"
    print("\n|", " | ".join(columns), "|\n|---|" + (len(columns) - 1) * "--:|")
    for family, members in results.items():
        for passes in members[0]:
            of = [each[passes] for each in members]
            ratio, rms = (np.sqrt(np.mean(np.square(v))) for v in ([c.mean_ratio for c in of], [c.rms for c in of]))
            far = [np.mean([getattr(c, name) for c in of]) for name in ("beyond3", "beyond5")]
            worst = [
                max((getattr(c, name) for c in of), key=abs) for name in ("block_ratio", "largest", "missed_ratio")
            ]
            print(
                f"| {family} | {passes} | {len(of)} | {ratio:.1f} | {rms:.2f} | {far[0]:.2%} | {far[1]:.2%} | "
                f"{worst[0]:+.1f} | {worst[1]:+.3f} | {worst[2]:+.1f} |"
            )


def parse_options(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES), help="all of them")
    parser.add_argument("--members", type=int, default=3, help="of each family (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="index of the first member (%(default)s)")
    parser.add_argument("--passes", type=int, nargs="+", default=[64, 512], help="of ours (%(default)s)")
    parser.add_argument("--photons", type=int, default=PHOTONS, help="of ours in a pass (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of ours (%(default)s)")
    parser.add_argument("--seconds", type=float, default=40.0, help="of each reference (%(default)s)")
    parser.add_argument("--brute", action="store_true", help="references by the tests' path tracer")
    parser.add_argument("--twice", action="store_true", help="compare two seeds of ours, too")
    parser.add_argument("--threads", type=int, default=1, help="of all (%(default)s)")
    parser.add_argument("--python", help="interpreter that has Mitsuba, where it is not this one")
    parser.add_argument("--cache", type=Path, default=user_cache(), help="folder of the references (%(default)s)")
    parser.add_argument("--excess", type=int, nargs=4, metavar=("LEFT", "TOP", "RIGHT", "BOTTOM"), help="a window")
    return parser.parse_args(arguments)


def main():
    options = parse_options()
    results = {}
    for family in options.families:
        indices = range(options.first, options.first + options.members)
        results[family] = [compare_member(family, index, options) for index in indices]
    print_summary(results)
    wrong = [
        f"{family} {options.first + i} after {passes} passes"
        for family, members in results.items()
        for i, of in enumerate(members)
        for passes, comparison in of.items()
        if comparison.recalls_wrongly
    ]
    if wrong:
        raise SystemExit(f"Light that is recalled is wrong in {', '.join(wrong)}")


if __name__ == "__main__":
    main()
