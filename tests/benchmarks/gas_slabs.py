# SPDX-License-Identifier: GPL-3.0-or-later
"""Do we and the peers that know gas agree on slabs whose radiance is known?

    python -m tests.benchmarks.gas_slabs [--case NAME ...] [--seconds S] [--runs N] [--threads N]

An endless slab (mirrors around 1 m of it) over a black plate, under one of 0 K, seen straight down, in three bands near
10 um that differ in what the gas does. Printed for each engine: the deviation from the exact radiance in each band, %,
its standard error, from independent runs, and in brackets the one over the other; where there is no exact value, the
same over ours. "none" is what has no noise. Mitsuba, whose gas cannot emit, renders the excess over the gas's
temperature, and has no case where that differs from place to place.

Exact values: Bouguer's and Planck's laws; those of isotropically scattering slabs are numbers of the transport equation
to 6 digits (as in tests/test_media.py).
"""

import argparse
from dataclasses import dataclass

import numpy as np

from addon.solver import Grid, Material, Medium, Scene, Settings, render
from addon.solver.physics.spectrum import band_radiance
from tests.benchmarks.speed_vs_error import film_image, peer_problem, run_peer
from tests.helpers.exact_cases import stepped
from tests.helpers.scenes import box, look, make_scene

EDGES = np.linspace(9.9997, 10.0003, 4)  # um, so narrow that formulas for one wavelength hold
CELLS = 64
_NONE = 1e-5  # share of the radiance below which float32 rounds and nothing is noise
ALBEDOS = 1.0, 0.9, 0.5


def black(kelvin: float) -> np.ndarray:
    return band_radiance(EDGES, kelvin)


def endless(medium: Medium, below: float, width: int = 16, height: int = 12) -> Scene:
    """A column of 1 m with mirrors around, filled with the medium, over a black plate at `below`, K."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    materials = [Material("mirror", 0.0, 1.0), Material("black", 1.0)]
    return make_scene(
        vertices,
        triangles[:, ::-1],
        np.repeat([0.0] * 4 + [below, 0.0], 2),
        materials,
        look((0.5, 0.5, 1.0 - 1e-6), (0.5, 0.5, 0.0), width, height, 1e-3),
        EDGES,
        np.repeat([0, 0, 0, 0, 1, 1], 2),
        media=(medium,),
        world_depth=1.0,
    )


def column(temperature=None) -> Grid:
    """Cells of the middle of the column, without touching its sides, of a density that makes them 1 m of gas."""
    density = np.full((8, 8, CELLS), 1.0 / 0.8)
    transform = np.diag([0.1, 0.1, 0.8 / CELLS, 1.0])
    transform[:3, 3] = 0.1
    return Grid.from_arrays(transform, density, None if temperature is None else temperature + 0.0 * density)


@dataclass
class Case:
    """exact: (3,) radiance, W m-2 sr-1 in each band, None where only ours is there to compare with."""

    scene: Scene
    exact: np.ndarray | None
    peers: tuple[str, ...] = ("cycles", "mitsuba")


def clear(grid: Grid | None = None) -> Case:
    """Gas of 600 K and optical depths of 0.1, 1 and 3 before 400 K."""
    depth = np.array([0.1, 1.0, 3.0])
    medium = Medium("gas", stepped(EDGES, depth), 600.0, grid=grid)
    return Case(endless(medium, 400.0), black(600.0) * -np.expm1(-depth) + black(400.0) * np.exp(-depth))


def linear() -> Case:
    """Gas whose blackbody radiance grows linearly away from the camera to twice of what it is there, before 0 K."""
    depth = np.array([0.5, 1.0, 2.0])
    near = 400.0
    kelvins = np.linspace(300.0, 700.0, 40_001)
    middle = 2.0 - (np.arange(CELLS) + 0.5) / CELLS  # from the plate up
    temperature = np.interp(middle, band_radiance(EDGES, kelvins)[:, 1] / black(near)[1], kelvins)
    medium = Medium("gas", stepped(EDGES, depth), 300.0, grid=column(temperature))
    radiance = black(near) * (1.0 - 2.0 * np.exp(-depth) + -np.expm1(-depth) / depth)
    return Case(endless(medium, 0.0), radiance, ("cycles",))


def scattering(below: float, gas: float, exact, anisotropy: float = 0.0) -> Case:
    """Optical depth 1 and albedos of 1, 0.9 and 0.5; exact: over the radiance of a blackbody at 400 K."""
    albedo = np.array(ALBEDOS)
    medium = Medium("fog", stepped(EDGES, 1.0 - albedo), gas, stepped(EDGES, albedo), anisotropy)
    return Case(endless(medium, below), None if exact is None else np.array(exact) * black(400.0))


CASES = {
    "clear": clear,
    "clear, grid": lambda: clear(column()),
    "linear, grid": linear,
    "scattering, plate": lambda: scattering(400.0, 0.0, (0.658671, 0.591625, 0.446058)),
    "scattering, gas": lambda: scattering(0.0, 400.0, (0.0, 0.140965, 0.454822)),
    "scattering forward, both": lambda: scattering(400.0, 300.0, None, 0.8),
}


def images_of(engine: str, case: Case, options) -> np.ndarray:
    """(runs, bands) mean radiance of independent images."""
    if engine == "ours":
        images = [film_image(render(case.scene, our_settings(seed, options))) for seed in range(options.runs)]
    else:
        images, _ = run_peer(
            engine, peer_problem(engine, case.scene), options.threads, "wall", [options.seconds] * options.runs
        )
    return np.mean(images, axis=(1, 2))


def our_settings(seed: int, options) -> Settings:
    return Settings(0, seed=seed, time_limit=options.seconds, threads=options.threads)


def deviations(means: np.ndarray, truth: np.ndarray, error: np.ndarray) -> str:
    """Of (runs, bands) radiances from the true ones (bands,), known but for an error (bands,)."""
    unit = np.where(truth > 0.0, truth, black(400.0))
    off = means.mean(axis=0) - truth
    noise = np.hypot(means.std(axis=0, ddof=1) / np.sqrt(len(means)), error)
    return "   ".join(
        f"{o / u:+.4%} +- {n / u:.4%} ({o / n:+.1f})" if n > _NONE * u else f"{o / u:+.4%} +- none"
        for o, n, u in zip(off, noise, unit, strict=True)
    )


def compare(name: str, options) -> None:
    case = CASES[name]()
    means = images_of("ours", case, options)
    truth, error = case.exact, 0.0
    print(f"\n{name}:")
    if truth is None:
        truth, error = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))
        print(
            f"  ours           {' '.join(f'{t:.6g} +- {e:.2g}' for t, e in zip(truth, error, strict=True))} W m-2 sr-1"
        )
    else:
        print(f"  ours           {deviations(means, truth, error)}")
    for peer in case.peers:
        print(f"  {peer:14s} {deviations(images_of(peer, case, options), truth, error)}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--case", nargs="+", choices=CASES, default=list(CASES), help="cases (all of them)")
    parser.add_argument("--seconds", type=float, default=0.7, help="of each run (%(default)s)")
    parser.add_argument("--runs", type=int, default=8, help="of each engine (%(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="of every engine (%(default)s)")
    options = parser.parse_args()
    for name in options.case:
        compare(name, options)


if __name__ == "__main__":
    main()
