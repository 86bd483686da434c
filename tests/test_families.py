# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of the families of tests/benchmarks/families.py in which caches and photon maps once were off by several
percent: thin warm plates side by side, a tube over a floor, rough metal beside a small hot ball.

References are of the path tracer of tests/helpers, made with

    python -m tests.test_families

which prints them: radiance in excess of the surroundings, W m-2 sr-1, in blocks of the picture, and standard errors.
"""

import argparse
import dataclasses

import numpy as np
import pytest

from addon.solver import Settings, render
from addon.solver.physics.spectrum import band_radiance
from tests.benchmarks.families import AMBIENT, BAND, comb, rough, tube
from tests.helpers.path_tracer import standard_error, trace_paths
from tests.helpers.scenes import look

pytestmark = pytest.mark.once

WIDTH, HEIGHT, BLOCK = 16, 12, 4  # pixels


def short_tube():
    """A tube of 0.6 m that ends close above the floor, and the floor under it: paths often find the ball inside."""
    scene = tube(bottom=0.15, top=0.75, ball=(0.6, 0.05, 1000.0))
    return dataclasses.replace(scene, camera=look((0.35, -0.5, 0.2), (0, 0, 0.05), WIDTH, HEIGHT, 0.35))


SCENES = {"comb": comb, "tube": short_tube, "rough": rough}

SAMPLES = {"comb": 1500, "tube": 4000, "rough": 4000}  # of a pixel, in each of 32 batches of the reference
REFERENCES = {  # values, standard errors
    "comb": (
        (0.00296, 0.004582, 0.005356, 0.004621, 0.02226, 0.1186,
         0.1028, 0.03777, 0.0004833, 0.02453, 0.007596, 0.002324),
        (1.746e-05, 2.34e-05, 2.188e-05, 1.835e-05, 5.269e-05, 0.0001224,
         0.0001084, 6.517e-05, 9.457e-06, 5.336e-05, 3.417e-05, 2.483e-05),
    ),
    "tube": (
        (0.02341, 0.05568, 0.05518, 0.02325, 0.01292, 0.04523,
         0.04555, 0.0132, 1.145e-05, 0.001446, 0.001411, 1.402e-05),
        (0.0002152, 0.0003701, 0.0003056, 0.0002033, 0.0001792, 0.0003331,
         0.0002925, 0.0001873, 5.367e-06, 7.657e-05, 7.583e-05, 7.596e-06),
    ),
    "rough": (
        (0.0007955, 0.0006463, 0.0005679, 0.0009377, 0.0009188, 0.001053,
         0.1794, 0.004854, 0.0003258, 0.002192, 0.2203, 0.0009954),
        (4.463e-05, 3.885e-05, 3.707e-05, 4.473e-05, 4.499e-05, 4.379e-05,
         0.000573, 9.619e-05, 2.27e-05, 7.514e-05, 0.001048, 3.801e-05),
    ),
}  # fmt: skip


def small(name):
    """The scene with a picture of a few pixels."""
    scene = SCENES[name]()
    return dataclasses.replace(scene, camera=dataclasses.replace(scene.camera, width=WIDTH, height=HEIGHT))


def blocks(images):
    """Means (n, blocks) over blocks of pixels of images (n, height, width)."""
    n = len(images)
    return (
        images.reshape(n, HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK).mean(axis=(2, 4), dtype=float).reshape(n, -1)
    )


def print_reference(name, samples, threads):
    traced = trace_paths(small(name), samples, batches=32, threads=threads)
    values = blocks(traced.images.sum(axis=-1))
    print(f'    "{name}": (')
    for row in (values.mean(axis=0), standard_error(values)):
        print(f"        ({', '.join(f'{value:.4g}' for value in row)}),")
    print("    ),", flush=True)


@pytest.mark.parametrize("name", SCENES)
def test_nothing_is_off_as_it_was(name):
    """Each block of the picture in which the reference is known to 1.5 %, to 4 standard errors of both."""
    scene = small(name)
    truth, its_error = np.array(REFERENCES[name])
    background = band_radiance(BAND, AMBIENT).sum()
    settings = Settings(passes=8, photons_per_pass=50_000, reference_temperature=AMBIENT)
    images = [render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(16)]
    values = blocks(np.asarray(images, float) - background)
    error = np.hypot(standard_error(values), its_error)
    known = its_error < 0.015 * truth
    deviation, error = (values.mean(axis=0) / truth - 1.0)[known], (error / truth)[known]
    print(np.column_stack((np.flatnonzero(known), deviation, error)))
    assert np.all(error < 0.025)
    assert np.all(np.abs(deviation) < 4 * error)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--threads", type=int, default=2, help="(%(default)s)")
    for member in SCENES:
        print_reference(member, SAMPLES[member], parser.parse_args().threads)
