# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a pass goes, as ratios measured in one run.

    python -m tests.benchmarks.throughput [threads]

Prints (1) the rate of rays while photons are traced, stored and scattered over the rate of Embree alone on the same
rays, and (2) the time for the photon index and the gathers at what the camera meets over the time for tracing, if no
final gathers are made where photons can be asked. Beside them what else there is: the irradiance cache, what is done
for the camera without gathers (its rays, what they see, feelers), and the same with final gathers as planned. The last
line backs the times in splitting.py. 16 bands, 100,000 photons, 128x96 pixels, 81,932 triangles: a room with a ball in
the middle. Best of several repetitions, interleaved.
"""

import math
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from addon.solver import Material, Settings
from addon.solver.camera import eye_paths
from addon.solver.camera.eye_paths import CameraPass, render_pixels
from addon.solver.camera.rays import Estimate
from addon.solver.camera.shadow_rays import Lighting, lamp_points
from addon.solver.image.tiles import tiles
from addon.solver.passes import PHOTON_CHUNK, Work, cache_irradiance
from addon.solver.photons.emission import Batch
from addon.solver.photons.photon_map import PhotonStore, build_photon_map
from addon.solver.photons.transport import trace_photons
from addon.solver.planning.preparation import prepare
from addon.solver.sampling.rng import CAMERA, LAMPS, PHOTONS, pass_key
from tests.helpers.scenes import box, look, make_scene, sphere

PHOTONS_PER_PASS = 100_000
REPETITIONS = 9


class Recorder:
    """Stands in for the tracer and keeps the rays it is given."""

    def __init__(self, tracer):
        self.tracer, self.rays = tracer, []

    def trace(self, origin, direction, reach=None):
        self.rays.append((origin.copy(), direction.copy()))
        return self.tracer.trace(origin, direction, reach)


def room(bands=16):
    """A room of 6 x 5 x 3 m with a ball: every surface differs from the reference, 60 % emissivity."""
    walls, wall_triangles = box((6.0, 5.0, 3.0))
    ball, ball_triangles = sphere(6, 0.8)
    vertices = np.concatenate((walls, ball + (3.0, 2.5, 1.2)))
    triangles = np.concatenate((wall_triangles, ball_triangles + len(walls))).astype(np.int32)
    material = np.concatenate((np.zeros(12), np.ones(len(ball_triangles)))).astype(np.int32)
    temperature = np.where(material == 1, 320.0, np.resize([285.0, 290.0, 295.0], len(material)))
    curve = np.array([[7.0, 0.5], [9.0, 0.7], [14.0, 0.6]])
    materials = (Material("walls", curve), Material("ball", 0.6))
    camera = look((0.5, 0.5, 1.5), (4, 3, 1), 128, 96, 0.9)
    return make_scene(vertices, triangles, temperature, materials, camera, np.linspace(7.5, 14, bands + 1), material)


def is_of_camera_rays(bounce, asking):
    """Whether what asks photons are gathers of camera rays, and not ends of final gathers."""
    rays = asking.gathers.ray
    return not asking.are_ends and len(rays) > 0 and not bounce.rays.final[rays[0]]


def seconds(function):
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result


def main():
    threads = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    scene, settings = room(), Settings(photons_per_pass=PHOTONS_PER_PASS)
    model = prepare(scene, settings)
    key = pass_key(0, 0, PHOTONS)
    camera_keys = (pass_key(0, 2**32 - 1, CAMERA), pass_key(0, 0, CAMERA))
    shining = lamp_points(model.lamps, model.stage.surfaces, pass_key(0, 0, LAMPS))
    firsts = range(0, PHOTONS_PER_PASS, PHOTON_CHUNK)

    def trace_chunk(first, tracer=model.tracer):
        batch = Batch(key, first, min(PHOTON_CHUNK, PHOTONS_PER_PASS - first), PHOTONS_PER_PASS)
        return list(trace_photons(tracer, model.stage, model.emitters, model.optics, batch))

    recorder = Recorder(model.tracer)
    chunks = []
    for first in firsts:
        start = len(recorder.rays)
        trace_chunk(first, recorder)
        chunks.append(recorder.rays[start:])
    rays = sum(len(origin) for origin, _ in recorder.rays)

    def embree_chunk(chunk):
        for origin, direction in chunk:
            model.tracer.trace(origin, direction)

    with ThreadPoolExecutor(threads) as pool:
        store = PhotonStore(16, False, False)
        work = Work(store, pool, lambda: False)
        times = {"trace": [], "embree": [], "index": [], "gather": [], "cache": [], "camera": [], "final gathers": []}
        for _ in range(REPETITIONS):
            store.clear()

            def trace():
                for chunk in pool.map(trace_chunk, firsts):
                    for batch in chunk:
                        store.append(batch)

            times["trace"].append(seconds(trace)[0])
            times["embree"].append(seconds(lambda: list(pool.map(embree_chunk, chunks)))[0])
            spent, photon_map = seconds(lambda: build_photon_map(store.photons, model.stage.surfaces, pool.map))
            times["index"].append(spent)
            photons_alone = model.splitting._replace(price=math.inf)
            estimate = Estimate(settings.neighbours, model.reach2, 1.0, True, False, photons_alone)
            spent, cache = seconds(lambda p=photon_map, e=estimate: cache_irradiance(model, p, e, camera_keys[1], work))
            times["cache"].append(spent)

            shared = CameraPass(
                tracer=model.tracer,
                stage=model.stage,
                lighting=Lighting(model.emitters.surroundings, model.lamps, shining),
                eye=model.eye,
                samples=model.samples,
                photon_map=photon_map,
                cache=cache,
                estimate=estimate,
                keys=camera_keys,
                index=0,
                weights=model.weights.astype(np.float32),
            )

            def camera(pixels, shared=shared):
                render_pixels(shared, pixels, lambda: False)

            pixels = tiles(model.eye.window, 0, camera_keys[0])
            reflected, reflect = [], eye_paths.reflect
            eye_paths.reflect = lambda *arguments, kept=reflected: kept.append(arguments)
            times["camera"].append(seconds(lambda c=camera, p=pixels: list(pool.map(c, p)))[0])
            asked = [a for a in reflected if is_of_camera_rays(*a[3:5])]
            times["gather"].append(seconds(lambda g=asked, r=reflect: list(pool.map(lambda call: r(*call), g)))[0])
            gathers = sum(len(asking.gathers.ray) for *_, asking, _ in asked)
            sent, choose, opened = [], eye_paths.choose_splits, eye_paths.open_finals

            def planned(stage, estimate, *rest, choose=choose):
                choose(stage, estimate._replace(splitting=model.splitting), *rest)

            def counted(*arguments, kept=sent, opened=opened):
                finals = opened(*arguments)
                kept.append(int(finals.rays.sum()))
                return finals

            eye_paths.choose_splits, eye_paths.open_finals = planned, counted
            times["final gathers"].append(seconds(lambda c=camera, p=pixels: list(pool.map(c, p)))[0])
            eye_paths.reflect, eye_paths.choose_splits, eye_paths.open_finals = reflect, choose, opened
    best = {name: min(values[1:]) for name, values in times.items()}
    print(f"{threads} threads, {rays} rays, {store.count} photons stored, {settings.neighbours} neighbours")
    print("  ".join(f"{name} {1e3 * value:.1f} ms" for name, value in best.items()))
    print(
        f"rays while tracing and scattering / rays of Embree alone: {best['embree'] / best['trace']:.2f}  (target 0.60)"
    )
    ratio = (best["index"] + best["gather"]) / best["trace"]
    print(f"index and gather / tracing: {ratio:.2f}  (target 1.00)")
    ray = (best["final gathers"] - best["camera"]) / sum(sent)
    photon = (best["trace"] + best["index"]) / PHOTONS_PER_PASS
    print(
        f"in the time of one of {sum(sent)} rays of final gathers: a gather {best['gather'] / gathers / ray:.1f}, its "
        f"camera rays {best['camera'] / gathers / ray:.1f}, a photon {photon / ray:.1f}"
    )


if __name__ == "__main__":
    main()
