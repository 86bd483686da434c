# SPDX-License-Identifier: GPL-3.0-or-later
"""The photon index against scipy's kd-tree, as ratios measured in one run on one thread.

    python -m tests.benchmarks.photon_index

Ours is what a pass does: sort the photons with their 16 bands, build the tree, and for every point that the camera
sees find its 50 neighbours on the same side, walk the patch of surface in the disk, measure its area and keep the
photons on it. cKDTree only has to build over the positions and find the 50 nearest, whatever their side, within the
same largest distance; it is timed as it comes and with its fastest build (neither balanced nor compact).

Scenes: the room of throughput.py with the photons and camera hits of a pass; and a plane with a caustic, where nearly
all photons lie on a thin curve and in a focus. Best of several repetitions, interleaved.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from addon.solver import Material, Settings
from addon.solver.geometry.area import NO_WALL
from addon.solver.geometry.eye import empty_eye_rays, eye_rays
from addon.solver.geometry.interaction import interact
from addon.solver.geometry.segments import RayBatch
from addon.solver.geometry.surfaces import Surfaces, build_surfaces
from addon.solver.passes import PHOTON_CHUNK
from addon.solver.photons.emission import Batch
from addon.solver.photons.photon_map import Disk, Photons, PhotonStore, build_photon_map, gather, neighbours_room
from addon.solver.photons.transport import trace_photons
from addon.solver.planning.preparation import prepare
from addon.solver.sampling.rng import CAMERA, PHOTONS, pass_key
from tests.benchmarks.throughput import room, seconds
from tests.helpers.scenes import look, make_scene

COUNTS = 10_000, 100_000, 1_000_000  # photons emitted; the room stores more
NEIGHBOURS = 50
BANDS = 16
WIDTH, HEIGHT = 128, 96
REPETITIONS = 5
TREES = {
    "cKDTree": {},
    "cKDTree, fastest build": {"balanced_tree": False, "compact_nodes": False},
}


class Case(NamedTuple):
    """Photons and the points at which they are gathered: side_id (q,) int32, point (q, 3) float32."""

    name: str
    photons: Photons
    surfaces: Surfaces
    reach2: float
    side_id: np.ndarray
    point: np.ndarray


@njit
def hit_points(surfaces, hits, rays):
    """Side and point of every hit."""
    side_id, point = np.empty(hits.triangle.size, np.int32), np.empty((hits.triangle.size, 3), np.float32)
    for i in range(hits.triangle.size):
        at = interact(surfaces, hits, i, rays.direction)
        side_id[i], point[i] = at.side_id, at.point
    return side_id, point


@njit(nogil=True)
def gather_all(photon_map, surfaces, side_id, point, disk):
    """Sum over the points of photons per area, so that no work is left out."""
    room, guess, density = neighbours_room(disk.neighbours), disk.reach2, 0.0
    for i in range(side_id.size):
        x, y, z = point[i]
        kept, area, guess = gather(photon_map, surfaces, side_id[i], (x, y, z), disk, guess, room)
        density += kept / area
    return density


def room_case(count):
    """Photons and camera hits of one pass in the room."""
    m = prepare(room(BANDS), Settings(photons_per_pass=count, neighbours=NEIGHBOURS))
    store, key = PhotonStore(BANDS, False, False), pass_key(0, 0, PHOTONS)
    for first in range(0, count, PHOTON_CHUNK):
        batch = Batch(key, first, min(PHOTON_CHUNK, count - first), count)
        for stored in trace_photons(m.tracer, m.stage, m.emitters, m.optics, batch):
            store.append(stored)
    pixels = WIDTH * HEIGHT
    origin, direction, reach = empty_eye_rays(pixels)
    once = np.ones(pixels, np.uint8)
    eye_rays(m.eye, pass_key(0, 0, CAMERA), 0, once, np.arange(pixels), origin, direction, reach)
    hits = m.tracer.trace(origin, direction, reach)
    side_id, point = hit_points(m.stage.surfaces, hits, RayBatch(origin, direction))
    return Case("room", store.photons, m.stage.surfaces, m.reach2, side_id, point)


def caustic_case(count):
    """A square metre: 60 % of the photons along a cardioid 2 mm wide, 30 % in a focus of 1 mm, 10 % anywhere.

    Half of the points form a grid as a camera above sees it, half lie where photons are, row by row like pixels.
    """
    rng = np.random.default_rng(0)
    turn = rng.uniform(0, 2 * math.pi, count)
    radius = 0.2 * (1 - np.cos(turn)) + rng.exponential(0.002, count)
    curve = np.column_stack((radius * np.cos(turn) + 0.2, radius * np.sin(turn)))
    focus = rng.normal((0.2, 0.0), 0.001, (count, 2))
    kind = rng.random(count)[:, None]
    plane = np.where(kind < 0.6, curve, np.where(kind < 0.9, focus, rng.uniform(-0.5, 0.5, (count, 2))))
    position = np.zeros((count, 3), np.float32)
    position[:, :2] = np.clip(plane, -0.5, 0.5)
    corners = np.array([(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)])
    triangles = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    scene = make_scene(corners, triangles, 300.0, [Material()], look((0, 0, 2), (0, 0, 0)), [8.0, 12.0])
    surfaces, _, _ = build_surfaces(scene)
    grid = np.stack(np.meshgrid(np.linspace(-0.49, 0.49, WIDTH), np.linspace(-0.49, 0.49, HEIGHT // 2)), axis=-1)
    point = np.zeros((WIDTH * HEIGHT, 3), np.float32)
    point[: WIDTH * HEIGHT // 2, :2] = grid.reshape(-1, 2)
    near = position[rng.integers(count, size=WIDTH * HEIGHT // 2)]
    point[WIDTH * HEIGHT // 2 :] = near[np.lexsort((near[:, 0], (near[:, 1] * HEIGHT).round()))]
    photons = Photons(
        position, 2 * (position[:, 1] > position[:, 0]).astype(np.int32), np.ones((count, BANDS), np.float32),
        np.empty((0, 3), np.float32), np.empty(0, bool), np.empty(0, np.uint8),
    )  # fmt: skip
    side_id = 2 * (point[:, 1] > point[:, 0]).astype(np.int32)
    return Case("caustic", photons, surfaces, 9 * NEIGHBOURS / (math.pi * count), side_id, point)


def measure(case):
    """Best seconds to build and to query, for ours and for each kd-tree."""
    times = {name: [] for name in ("ours", *TREES)}
    position = case.photons.position.copy()  # before ours sorts them
    disk, reach = Disk(NEIGHBOURS, case.reach2, 1.0, NO_WALL, False), math.sqrt(case.reach2)
    for _ in range(REPETITIONS):
        photons = Photons(*(array.copy() for array in case.photons))
        build, photon_map = seconds(lambda p=photons: build_photon_map(p, case.surfaces))
        query, _ = seconds(lambda m=photon_map: gather_all(m, case.surfaces, case.side_id, case.point, disk))
        times["ours"].append((build, query))
        for name, options in TREES.items():
            build, tree = seconds(lambda o=options: cKDTree(position, **o))
            query, _ = seconds(lambda t=tree: t.query(case.point, NEIGHBOURS, distance_upper_bound=reach, workers=1))
            times[name].append((build, query))
    return {name: np.min(spent, axis=0) for name, spent in times.items()}


def shuffled(case):
    """The same points in random order, as after a rough reflection: the last disk says nothing of the next."""
    order = np.random.default_rng(1).permutation(len(case.point))
    return case._replace(
        name=case.name + " with points in random order",
        side_id=case.side_id[order],
        point=case.point[order],
    )


def cases():
    for make in (room_case, caustic_case):
        for count in COUNTS:
            yield make(count)
        yield shuffled(make(COUNTS[1]))


def main():
    measure(caustic_case(1000))  # compile
    print(f"{WIDTH * HEIGHT} points, {NEIGHBOURS} neighbours, {BANDS} bands, one thread; ms, and kd-tree / ours")
    for case in cases():
        best = measure(case)
        ours = best["ours"]
        print(f"{case.name}, {len(case.photons.surface)} photons")
        print(f"  {'ours':24}build {1e3 * ours[0]:8.1f}  query {1e3 * ours[1]:8.1f}")
        for name in TREES:
            ratio = best[name] / ours
            print(
                f"  {name:24}build {1e3 * best[name][0]:8.1f}  query {1e3 * best[name][1]:8.1f}"
                f"  ratio: build {ratio[0]:.2f}  query {ratio[1]:.2f}  both {best[name].sum() / ours.sum():.2f}"
            )


if __name__ == "__main__":
    main()
