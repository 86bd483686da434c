# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time of a pass goes, as ratios measured in one run.

    python -m tests.benchmarks.throughput [threads]

Prints (1) the rate of rays while photons are traced, stored and scattered over the rate of Embree alone on the same
rays, and (2) the time for the photon index and for gathers of photons at what the camera meets over the time for
tracing. Such gathers tell caustics alone in a render, where rays of final gathers find the rest. Beside them what else
there is: the irradiance cache, what is done for the camera without gathers (its rays, and what they see), and all that
is done for it, with final gathers as planned and what their ends recall. The last two lines back the times in
splitting.py.
16 bands, 100,000 photons, 128x96 pixels, 81,932 triangles: a room with a ball in the middle. Best of several
repetitions, interleaved.
"""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from addon.solver import Material, Settings
from addon.solver.camera.eye_paths import CameraPass, render_pixels
from addon.solver.camera.final_gather import choose_splits, open_finals
from addon.solver.camera.gathers import first_gathers
from addon.solver.camera.rays import Estimate
from addon.solver.camera.reflection import reflect
from addon.solver.camera.shadow_rays import Lighting, lamp_points
from addon.solver.geometry.segments import Tracer, hidden_from_lobes
from addon.solver.image.tiles import tiles
from addon.solver.passes import PHOTON_CHUNK, Work, cache_irradiance
from addon.solver.photons.emission import Batch
from addon.solver.photons.photon_map import build_photon_map, few_neighbours
from addon.solver.photons.transport import trace_photons
from addon.solver.planning.preparation import photon_store, prepare
from addon.solver.sampling.rng import CACHE, CAMERA, LAMPS, PHOTONS, pass_key
from tests.helpers.paper_estimator import changed, no_final_gathers, no_walls
from tests.helpers.scenes import box, look, make_scene, sphere

PHOTONS_PER_PASS = 100_000
REPETITIONS = 9
SENT = 0, 1, 8, 32  # rays of each gather, whose times tell the time of a gather


class Recorder(Tracer):
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


# Neither photons nor rays of final gathers find what is reflected.
CAMERA_ALONE = {
    "camera.eye_paths.choose_splits": no_final_gathers,
    "camera.eye_paths.free_space": no_walls,
    "camera.eye_paths.reflect": lambda *_: None,
}


def asks_of_camera(camera):
    """What `reflect` is given for the gathers of camera rays if they ask photons for all that is reflected."""
    kept = []
    watched = {"camera.eye_paths.reflect": lambda *given: kept.append(given)}
    with changed({"camera.eye_paths.choose_splits": no_final_gathers} | watched):
        camera()
    return [given for given in kept if len(given[-2].gathers.ray)]


def rays_of_final_gathers(camera):
    """How many rays all final gathers of a pass send."""
    sent = []

    def opened(*arguments):
        finals = open_finals(*arguments)
        sent.append(int(finals.rays.sum()))
        return finals

    with changed({"camera.eye_paths.open_finals": opened}):
        camera()
    return sum(sent)


def sending(rays, counts):
    """Instead of choose_splits: gathers that send so many rays each, and share none; none are kept for no rays. Appends
    to counts how many gathers, rays, and gathers at the ends of rays there are."""

    def choose(stage, estimate, pixels, bounce, gathers):
        kept = choose_splits(stage, estimate, pixels, bounce, gathers)
        if rays == 0:
            kept.of[:] = -1
            return first_gathers(kept, 0)
        kept.rays[kept.rays > 0], kept.radius2[:] = rays, 0.0
        split = np.count_nonzero(kept.rays)
        counts.append((split, rays * split, len(kept.rays) - split))
        return kept

    return choose


def times_of_gathers(camera):
    """Seconds of a gather, of one of its rays alone, and of a gather at the end of a ray, by least squares from renders
    with SENT; and the time of one more ray with what follows from it."""
    spent, told = np.zeros(len(SENT)), np.zeros((len(SENT), 3))
    for i, rays in enumerate(SENT):
        counts = []
        with changed({"camera.eye_paths.choose_splits": sending(rays, counts)}):
            spent[i] = min(seconds(camera)[0] for _ in range(REPETITIONS))
        told[i] = np.sum(counts or [(0, 0, 0)], axis=0) / REPETITIONS
    found = np.linalg.lstsq(told[1:], spent[1:] - spent[0], rcond=None)[0]
    return *found, (spent[-1] - spent[-2]) / (told[-1, 1] - told[-2, 1])


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
    shining = lamp_points(model.lamps, model.stage, model.emitters.surroundings, pass_key(0, 0, LAMPS))
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
        store = photon_store(scene.band_count, model.optics)
        work = Work(store, pool, lambda: False)
        around, hidden = model.emitters.surroundings, hidden_from_lobes(model.tracer)
        lighting = Lighting(around, model.lamps, shining, model.looking, len(model.layers), hidden)
        straight = model.optics.keep_incoming
        k = settings.neighbours
        few = few_neighbours(k)
        estimate = Estimate(k, few, model.reach2, 1.0, True, straight, model.splitting, lighting.layers)
        pixels = tiles(model.eye.window, 0, camera_keys[0])
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
            spent, cache = seconds(
                lambda p=photon_map: cache_irradiance(model, p, estimate, lighting, pass_key(0, 0, CACHE), work)
            )
            times["cache"].append(spent)

            shared = CameraPass(
                tracer=model.tracer,
                stage=model.stage,
                lighting=lighting,
                eye=model.eye,
                samples=model.samples,
                photon_map=photon_map,
                cache=cache,
                estimate=estimate,
                keys=camera_keys,
                index=0,
                weights=model.layer_weights.astype(np.float32).ravel(),
            )

            def camera(shared=shared):
                list(pool.map(lambda tile: render_pixels(shared, tile, lambda: False), pixels))

            asked = asks_of_camera(camera)
            times["gather"].append(seconds(lambda a=asked: list(pool.map(lambda ask: reflect(*ask), a)))[0])
            with changed(CAMERA_ALONE):
                times["camera"].append(seconds(camera)[0])
            times["final gathers"].append(seconds(camera)[0])
        a_gather, alone, an_end, further = times_of_gathers(camera)
        sent, gathers = rays_of_final_gathers(camera), sum(len(asking.gathers.ray) for *_, asking, _ in asked)
    best = {name: min(values[1:]) for name, values in times.items()}
    print(f"{threads} threads, {rays} rays, {store.count} photons stored, {settings.neighbours} neighbours")
    print("  ".join(f"{name} {1e3 * value:.1f} ms" for name, value in best.items()))
    print(
        f"rays while tracing and scattering / rays of Embree alone: {best['embree'] / best['trace']:.2f}  (target 0.60)"
    )
    ratio = (best["index"] + best["gather"]) / best["trace"]
    print(f"index and gather / tracing: {ratio:.2f}  (target 1.00)")
    ray = (best["final gathers"] - best["camera"]) / sent
    photon = (best["trace"] + best["index"] + best["cache"]) / PHOTONS_PER_PASS
    print(
        f"in the time of one of {sent} rays of final gathers: a gather {best['gather'] / gathers / ray:.1f}, "
        f"{model.samples.mean():.1f} camera rays of a pixel {best['camera'] / model.samples.size / ray:.1f}, a photon "
        f"with its share of index and cache {photon / ray:.1f}"
    )
    print(
        f"in the time of one more ray of a gather that shares none: the gather {a_gather / further:.1f}, the ray alone "
        f"{alone / further:.1f}, a gather for shadow rays at an end {an_end / further:.1f}"
    )


if __name__ == "__main__":
    main()
