# SPDX-License-Identifier: GPL-3.0-or-later
"""A short deterministic look at the scene before the first pass: what the image can depend on, and how open it is.

Every run of a scene repeats it identically, so passes rendered elsewhere belong to the same image.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.interaction import emit_at, interact, leave
from ..geometry.segments import Hits, RayBatch, Tracer, empty_ray_batch
from ..geometry.stage import Stage, lobes_at, reflectance_at
from ..geometry.surfaces import Surfaces, facing_side, sheet_count, sheet_of
from ..physics.lobes import SPECULAR, sample_diffuse, sample_specular
from ..sampling.rng import OPENNESS, PATH_PIXELS, PATHS, PILOT, PROBES, pass_key, path_key, strata, uniform
from ..sampling.vectors import put_vector, vector
from ..sampling.warps import triangle_point
from ..system.kernels import KERNEL, njit

SKY_RAYS = 4  # rays to the surroundings that a gather from an open side sends
# Chance of a side that seems out of the image's reach, against one within: nothing can be missed for good.
DEFENSIVE = 1.0 / 64.0
_CAMERA_PATHS = 4096
_BOUNCES = 8
_PROBES = 8192  # rays from sides that no camera path met
_OPEN = 0.95  # share of the paths from a sheet that leave the scene above which it is open
_TYPICAL_PHOTONS = 50  # of a gather
_LEAST_ERROR = 0.1  # weight of surroundings that seem to be free of everything: a few paths cannot tell
_LEAST_OPEN = 16  # paths that must have been sent from it
_LEAST_DENSITY = 1.0 / 4.0  # of reachable sides, over their mean
_PRIOR = 4.0  # paths that the mean density is worth on a sheet


class Pilot(NamedTuple):
    """What camera paths found.

    reachable: (t, 2) bool, sides that the image can depend on.
    weight: (t, 2) float64, factor on the chance that a side emits: 1 on average, more where much of what the image
        gathers comes from, at least DEFENSIVE. arrival: the same for photons from the surroundings to arrive there.
    open: (t, 2) bool, sides from which nearly every direction leaves the scene: a ray says more than photons there.
    importance: (t,) float64, how much of the light that the image gathers comes from each triangle, were all equally
        bright; sky: how much comes from the surroundings, less where open sides see them. Together at most 1.
    openness: share of cosine-distributed directions from reachable sides that leave the scene, 0 if there are none.
    view: m, width of the frame where the camera's rays meet the scene (median); infinite if they meet nothing.
    point, normal: (r, 3) float64, points where camera paths gather and the normals there. side_id: (r,) int32 of the
        sides they lie on. throughput: (r,) float64, share of a pixel that the light reflected there makes up.
    left, met: (p,) int32, label of the sheet that camera paths left, mirrored or in a random direction, and triangle
        that they met, -1 for the surroundings.
    """

    reachable: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    open: np.ndarray
    importance: np.ndarray
    sky: float
    openness: float
    view: float
    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    throughput: np.ndarray
    left: np.ndarray
    met: np.ndarray


class _Paths(NamedTuple):
    """Camera paths, n of them. origin, direction: (n, 3) float32. throughput: (n,) float64. label: (n,) int64 of the
    sheet that each left, -1 for the camera and for paths that have left the scene."""

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    label: np.ndarray


class _Gathers(NamedTuple):
    """Where each of n camera paths gathers: the first point where something else than a mirror reflects it.

    found: (n,) bool, whether there is one yet. The others: see Pilot, undefined where there is none.
    """

    found: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    throughput: np.ndarray


class _Tally(NamedTuple):
    """What camera paths met.

    reached: (labels,) bool, sheets. importance: (t + 1,) float64, throughput of those that met each triangle, last the
    surroundings. By label of the sheet, float64: sources, throughput of those that met it, escapes, of those that left
    the scene from there; left, how many left the sheet, and escaped, how many of them left the scene.
    """

    reached: np.ndarray
    importance: np.ndarray
    sources: np.ndarray
    escapes: np.ndarray
    left: np.ndarray
    escaped: np.ndarray


def explore(stage: Stage, tracer: Tracer, eye: Eye, area: np.ndarray) -> Pilot:
    """Follow camera paths that never end; the connected sheets of surface that they meet are reachable.

    A sheet is reachable, too, if something reachable is seen from it, so that small sources are not overlooked.
    stage: in one band, see grey_radiometry. area: (t,) float64, m2.
    The seed has no part in it: renders of one scene with different seeds can be merged.
    """
    surfaces, sheet = stage.surfaces, stage.surfaces.sheet
    paths, reach = _camera_paths(eye)
    gathers = _Gathers(
        np.zeros(_CAMERA_PATHS, np.bool_),
        np.empty((_CAMERA_PATHS, 3)),
        np.empty((_CAMERA_PATHS, 3)),
        np.empty(_CAMERA_PATHS, np.int32),
        np.empty(_CAMERA_PATHS),
    )
    labels = sheet_count(surfaces)
    tally = _Tally(np.zeros(labels, np.bool_), np.zeros(len(sheet) + 1), *np.zeros((4, labels)))
    view, sights = math.inf, []
    for bounce in range(_BOUNCES):
        hits = tracer.trace(paths.origin, paths.direction, reach)
        if bounce == 0:
            view = _view_width(surfaces, eye, hits)
        on_way = paths.label >= 0
        sights.append((paths.label[on_way], hits.triangle[on_way]))
        _bounce(stage, pass_key(0, PATHS, PILOT), bounce, hits, paths, gathers, tally)
        reach = np.full(_CAMERA_PATHS, 1e37, np.float32)
    _reach_further(surfaces, tracer, tally.reached)
    reachable = tally.reached[sheet]
    is_open = (tally.left >= _LEAST_OPEN) & (tally.escaped > _OPEN * tally.left)
    importance = tally.importance / max(tally.importance.sum(), 1e-300)
    return Pilot(
        reachable=reachable,
        weight=_density(tally.sources, sheet, area, reachable),
        arrival=_density(tally.escapes, sheet, area, reachable),
        open=is_open[sheet],
        importance=importance[:-1],
        sky=float(importance[-1] * _hidden(tally, is_open)),
        openness=_openness(surfaces, tracer, area, reachable),
        view=view,
        point=gathers.point[gathers.found],
        normal=gathers.normal[gathers.found],
        side_id=gathers.side_id[gathers.found],
        throughput=gathers.throughput[gathers.found],
        left=np.concatenate([label for label, _ in sights]),
        met=np.concatenate([triangle for _, triangle in sights]),
    )


def _camera_paths(eye: Eye) -> tuple[_Paths, np.ndarray]:
    """Paths that start at the camera, and how far their rays reach, (n,) float32, see eye_rays."""
    pixels = int((eye.window[2] - eye.window[0]) * (eye.window[3] - eye.window[1]))
    chosen, samples = np.unique(strata(pass_key(0, PATH_PIXELS, PILOT), _CAMERA_PATHS, pixels), return_counts=True)
    origin, direction, reach = empty_eye_rays(_CAMERA_PATHS)
    eye_rays(eye, pass_key(0, PATHS, PILOT), 0, samples.astype(np.uint16), chosen, origin, direction, reach)
    return _Paths(origin, direction, np.ones(_CAMERA_PATHS), np.full(_CAMERA_PATHS, -1)), reach


def _hidden(tally: _Tally, is_open: np.ndarray) -> float:
    """Weight of the surroundings in what the image gathers, where open sheets (labels,) send rays to them: 1 where all
    of their light comes as photons.

    Rays to the surroundings leave an error of sqrt((1 - V) / (V n)), V the share of them that is free, n their number
    (stratified, they count double); photons leave 1 / sqrt(k). The weight of an open sheet is the ratio of both.
    """
    visible = tally.escaped / np.maximum(tally.left, 1.0)
    error = np.sqrt((1.0 - visible) / np.maximum(visible, 1e-9) * (_TYPICAL_PHOTONS / (2.0 * SKY_RAYS)))
    weight = np.where(is_open, np.clip(error, _LEAST_ERROR, 1.0), 1.0)
    return float(np.sum(tally.escapes * weight)) / max(tally.escapes.sum(), 1e-300)


def _density(count: np.ndarray, sheet: np.ndarray, area: np.ndarray, reachable: np.ndarray) -> np.ndarray:
    """(t, 2) density of what was counted on every sheet, over the mean of the reachable sides.

    A sheet that few paths could meet is taken to be like the mean: the mean of a gamma posterior with that prior.
    """
    size = np.bincount(sheet.ravel(), (area[:, None] * reachable).ravel(), count.size)
    mean = count.sum() / max(size.sum(), 1e-300)
    if mean == 0.0:
        return np.where(reachable, 1.0, DEFENSIVE)
    count = count * (_CAMERA_PATHS / count.sum())  # as many as were met, about, whatever their throughputs
    density = (count + _PRIOR) / (size * (_CAMERA_PATHS / max(size.sum(), 1e-300)) + _PRIOR)
    return np.where(reachable, np.maximum(density, _LEAST_DENSITY)[sheet], DEFENSIVE)


def _view_width(surfaces: Surfaces, eye: Eye, hits: Hits) -> float:
    """Median width of the frame (m) at the points that camera rays hit; a radian's width for panoramas."""
    hit = hits.triangle >= 0
    if not hit.any():
        return math.inf
    corners = surfaces.corners[hits.triangle[hit]]
    u, v = hits.u[hit, None], hits.v[hit, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    distance = float(np.median(np.linalg.norm(points - eye.matrix[:, 3], axis=1)))
    width = float(eye.frame[1] - eye.frame[0])
    return (width * distance, width, distance)[eye.kind]


def _openness(surfaces: Surfaces, tracer: Tracer, area: np.ndarray, reachable: np.ndarray) -> float:
    """Share of cosine-distributed directions from the reachable sides that leave the scene, 0 if there are none."""
    cumulative = np.cumsum((area[:, None] * reachable).ravel())
    if cumulative[-1] == 0.0:
        return 0.0
    chosen = np.searchsorted(cumulative, cumulative[-1] * (np.arange(_CAMERA_PATHS) + 0.5) / _CAMERA_PATHS)
    triangle, _ = _probe(surfaces, tracer, pass_key(0, OPENNESS, PILOT), chosen.astype(np.int32))
    return float(np.mean(triangle < 0))


def _reach_further(surfaces: Surfaces, tracer: Tracer, reached: np.ndarray) -> None:
    """Mark the sheets, reached (labels,) bool, from which a reached sheet is seen, as far as probes tell."""
    for stream in PROBES:
        side_id = _unreached_sides(surfaces.sheet, reached)
        if side_id.size == 0:
            break
        triangle, rays = _probe(surfaces, tracer, pass_key(0, stream, PILOT), side_id)
        before = reached.sum()
        _reach_back(surfaces, side_id, triangle, rays, reached)
        if reached.sum() == before:
            break


def _unreached_sides(sheet: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Side_ids (n,) int32 of sheets that are not reached, some of every sheet, in all about _PROBES."""
    labels = sheet.ravel()
    side_id = np.flatnonzero(~reached[labels]).astype(np.int32)
    side_id = side_id[np.argsort(labels[side_id], kind="stable")]
    _, starts, sizes = np.unique(labels[side_id], return_index=True, return_counts=True)
    if starts.size == 0:
        return side_id
    each = min(64, max(1, _PROBES // starts.size))
    chosen = starts[:, None] + (np.arange(each) + 0.5) / each * sizes[:, None]
    return side_id[chosen.astype(np.int64).ravel()]


def _probe(surfaces: Surfaces, tracer: Tracer, key: np.uint64, side_id: np.ndarray) -> tuple[np.ndarray, RayBatch]:
    """Which triangles (n,) cosine-distributed rays from these sides (n,) meet, -1 for none, and the rays."""
    rays = empty_ray_batch(side_id.size)
    _start_probes(surfaces, key, side_id, rays)
    return tracer.trace(*rays).triangle, rays


@njit(**KERNEL)
def _start_probes(surfaces, key, side_id, rays):
    """Start a ray from each of the sides (n,), anywhere on it."""
    for i in range(side_id.size):
        path = path_key(key, i)
        u, v = triangle_point(uniform(path, 0), uniform(path, 1))
        at = emit_at(surfaces, side_id[i], u, v, 1.0)
        leave(surfaces, at.side_id, at.point, sample_diffuse(at.normal, uniform(path, 2), uniform(path, 3)), rays, i)


@njit(**KERNEL)
def _bounce(stage, key, bounce, hits, paths, gathers, tally):
    """Mark the sheets that rays meet, add up what they would bring to the image, and send them on.

    Those that left the scene stay outside. Rough lobes count as diffuse.
    """
    surfaces = stage.surfaces
    for i in range(hits.triangle.size):
        t = hits.triangle[i]
        if bounce > 0:
            tally.importance[t if t >= 0 else tally.importance.size - 1] += paths.throughput[i]
        if t < 0:
            if paths.label[i] >= 0:
                tally.escapes[paths.label[i]] += paths.throughput[i]
                tally.escaped[paths.label[i]] += 1.0
            paths.throughput[i], paths.label[i] = 0.0, -1
            continue
        at = interact(surfaces, hits, i, paths)
        label = sheet_of(surfaces, at.side_id)
        tally.reached[label] = True
        if bounce > 0:
            tally.sources[label] += paths.throughput[i]
        paths.label[i] = label
        tally.left[label] += 1.0
        paths.throughput[i] *= reflectance_at(stage, at)[0]
        lobes, path = lobes_at(stage, at), path_key(key, i)
        s, w = uniform(path, 3 * bounce + 9), uniform(path, 3 * bounce + 10)
        if lobes.flags & SPECULAR and uniform(path, 3 * bounce + 8) < lobes.specular:
            leave(surfaces, at.side_id, at.point, sample_specular(lobes, at, s, w).direction, paths, i)
            continue
        if not gathers.found[i]:
            put_vector(at.point, gathers.point, i)
            put_vector(at.normal, gathers.normal, i)
            gathers.found[i], gathers.side_id[i], gathers.throughput[i] = True, at.side_id, paths.throughput[i]
        leave(surfaces, at.side_id, at.point, sample_diffuse(at.normal, s, w), paths, i)


@njit(**KERNEL)
def _reach_back(surfaces, side_id, triangle, rays, reached):
    """A sheet from which a reached sheet is seen can send it photons, so it is reached too. triangle: (n,) int32, what
    rays from the sides (n,) met."""
    for i in range(side_id.size):
        if triangle[i] >= 0:
            seen = facing_side(surfaces, triangle[i], vector(rays.direction, i))
            if reached[sheet_of(surfaces, seen)]:
                reached[sheet_of(surfaces, side_id[i])] = True


def gather_reach(area: np.ndarray, pilot: Pilot, photons: int, neighbours: int) -> float:
    """Squared radius (m2) of the largest gather disk.

    Where photons lie one ninth as dense as on average over the reachable surfaces, the disk holds k of them; in
    sparser places it keeps its size and holds fewer: more noise, which the image says, rather than more blur, which it
    does not. For the same reason it is no wider than an eighth of the picture, but for pictures so small that such a
    disk would hold less than one photon (a camera may touch what it sees).
    """
    reachable = float(np.sum(area * pilot.reachable.sum(axis=1)))
    one = max(reachable, 1e-30) / (math.pi * photons)  # holds one photon on average
    return min(9.0 * neighbours * one, max((pilot.view / 16.0) ** 2, one))
