# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot: a few camera paths before the first pass tell what the image can depend on, and how open the scene is.

Every run of a scene repeats the pilot identically, so that passes rendered on other machines belong to the same image.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.interaction import emit_at, interact, leave
from ..geometry.segments import Hits, RayBatch, Tracer, empty_ray_batch
from ..geometry.stage import Stage, lobes_at, one_reflectance_at
from ..geometry.surfaces import Surfaces, facing_side, sheet_count, sheet_of
from ..physics.fresnel import BELOW, TOTAL
from ..physics.lobes import SPECULAR, diffuse_share, follows_fresnel, sample_diffuse, sample_specular
from ..sampling.rng import OPENNESS, PATH_PIXELS, PATHS, PILOT, PROBES, pass_key, path_key, strata, uniform
from ..sampling.vectors import put_vector, vector
from ..sampling.warps import triangle_point
from ..system.kernels import KERNEL, njit

SKY_RAYS = 4  # rays to the surroundings that a gather from an open side sends
# Chance that an unreachable side emits, over the chance of a reachable one. It is above 0, so that nothing which the
# pilot failed to see is missing in the image.
DEFENSIVE = 1.0 / 64.0
_CAMERA_PATHS = 4096
_BOUNCES = 8  # of a camera path
_PROBES = 8192  # rays from sides that no camera path met
_OPEN = 0.95  # a sheet is open if more than this share of the paths that left it also left the scene
_LEAST_OPEN = 16  # paths that must have left a sheet for it to be called open
_TYPICAL_PHOTONS = 50  # of a gather
_LEAST_ERROR = 0.1  # least weight in _hidden: a few paths cannot tell that nothing at all hides the surroundings
_LEAST_DENSITY = 1.0 / 4.0  # of reachable sides, over their mean density
_PRIOR = 4.0  # paths that the mean density counts as on each sheet


class Pilot(NamedTuple):
    """What the pilot's camera paths found, p steps of paths and r gathers.

    reachable: (t, 2) bool, sides that the image can depend on.
    weight: (t, 2) float64, factor on the probability that a side emits: 1 on average over reachable sides, more where
        much of the light in the image comes from, at least DEFENSIVE. arrival: (t, 2) float64, the same factor for
        photons from the surroundings that arrive on a side.
    open: (t, 2) bool, sides from which nearly every direction leaves the scene: there a ray says more than photons.
    importance: (t,) float64, share of the light in the image that comes from each triangle, if all triangles and the
        surroundings were equally bright. sky: the share of the surroundings, lowered for open sides, which find the
        surroundings by rays. The sum of all shares is at most 1.
    openness: share of cosine-distributed directions from reachable sides that leave the scene; 0 without such sides.
    background: share of the camera's rays that meet nothing.
    view: m, width of the frame at the median distance where camera rays meet the scene; infinite if they meet nothing.
    point, normal: (r, 3) float64, points where camera paths gather, m, and the normals there. side_id: (r,) int32,
    sides
        of these points. throughput: (r,) float64, share of a pixel that the light reflected there makes up.
    left: (p,), label of the sheet that a path left, mirrored or in a random direction. met: (p,) int32, triangle that
        the path met next, -1 for the surroundings.
    """

    reachable: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    open: np.ndarray
    importance: np.ndarray
    sky: float
    openness: float
    background: float
    view: float
    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    throughput: np.ndarray
    left: np.ndarray
    met: np.ndarray


class _Paths(NamedTuple):
    """n camera paths. origin, direction: (n, 3) float32. throughput: (n,) float64. label: (n,) int64, the sheet that
    the path left last, -1 for paths that come from the camera or have left the scene."""

    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    label: np.ndarray


class _Gathers(NamedTuple):
    """Where each of n camera paths gathers: the first point where the path is not reflected by a mirror.

    found: (n,) bool, whether the path has such a point yet. The other fields: see Pilot, undefined where not found.
    """

    found: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    throughput: np.ndarray


class _Tally(NamedTuple):
    """Sums over camera paths.

    reached: (labels,) bool, sheets that a path met. importance: (t + 1,) float64, throughput of the paths that met each
    triangle; last, of those that met the surroundings. The other fields are (labels,) float64. sources: throughput of
    the paths that met the sheet. escapes: throughput of the paths that left the scene from the sheet. left: number of
    paths that left the sheet. escaped: number of paths that left the scene from the sheet.
    """

    reached: np.ndarray
    importance: np.ndarray
    sources: np.ndarray
    escapes: np.ndarray
    left: np.ndarray
    escaped: np.ndarray


def explore(stage: Stage, tracer: Tracer, eye: Eye, area: np.ndarray) -> Pilot:
    """Follow camera paths without roulette; the sheets that they meet are reachable.

    A sheet is reachable, too, if a reachable sheet is visible from it, so that small sources are not overlooked.
    stage: in one band, see grey_radiometry. area: (t,) float64, m2.
    The seed of the render is not used, so that renders of one scene with different seeds can be merged.
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
    view, background, sights = math.inf, 0.0, []
    for bounce in range(_BOUNCES):
        hits = (tracer if bounce else tracer.camera).trace(paths.origin, paths.direction, reach)
        if bounce == 0:
            view, background = _view_width(surfaces, eye, hits), float(np.mean(hits.triangle < 0))
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
        background=background,
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
    """Factor, at most 1, on the importance of the surroundings, as open sheets (labels,) find them by rays: 1 where all
    light of the surroundings comes as photons.

    n rays to the surroundings leave a relative error of sqrt((1 - V) / (V n)), where V is the visible share of the
    surroundings (stratified rays count double); photons leave 1 / sqrt(k). The weight of an open sheet is the ratio of
    the two errors.
    """
    visible = tally.escaped / np.maximum(tally.left, 1.0)
    error = np.sqrt((1.0 - visible) / np.maximum(visible, 1e-9) * (_TYPICAL_PHOTONS / (2.0 * SKY_RAYS)))
    weight = np.where(is_open, np.clip(error, _LEAST_ERROR, 1.0), 1.0)
    return float(np.sum(tally.escapes * weight)) / max(tally.escapes.sum(), 1e-300)


def _density(count: np.ndarray, sheet: np.ndarray, area: np.ndarray, reachable: np.ndarray) -> np.ndarray:
    """(t, 2) float64 density of the counts (labels,) on each sheet, over the mean density of the reachable sides.

    A sheet so small that few paths could meet it is taken to be like the mean: this is the mean of the posterior with
    a gamma distribution as prior.
    """
    size = np.bincount(sheet.ravel(), (area[:, None] * reachable).ravel(), count.size)
    mean = count.sum() / max(size.sum(), 1e-300)
    if mean == 0.0:
        return np.where(reachable, 1.0, DEFENSIVE)
    count = count * (_CAMERA_PATHS / count.sum())  # about as many as there were paths, whatever their throughputs
    density = (count + _PRIOR) / (size * (_CAMERA_PATHS / max(size.sum(), 1e-300)) + _PRIOR)
    return np.where(reachable, np.maximum(density, _LEAST_DENSITY)[sheet], DEFENSIVE)


def _view_width(surfaces: Surfaces, eye: Eye, hits: Hits) -> float:
    """Width of the frame (m) at the median distance where camera rays hit; for panoramas of a radian."""
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
    """Mark in reached (labels,) bool the sheets from which a reached sheet is visible, as far as probes tell."""
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
    """Side_ids (n,) int32 of sheets that are not reached: some sides of every sheet, in all about _PROBES."""
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
    """Triangles (n,) that cosine-distributed rays from sides (n,) meet, -1 for none, and the rays."""
    rays = empty_ray_batch(side_id.size)
    _start_probes(surfaces, key, side_id, rays)
    return tracer.trace(*rays).triangle, rays


@njit(**KERNEL)
def _start_probes(surfaces, key, side_id, rays):
    """Start a ray from each of the sides (n,), at a random point."""
    for i in range(side_id.size):
        path = path_key(key, i)
        u, v = triangle_point(uniform(path, 0), uniform(path, 1))
        at = emit_at(surfaces, side_id[i], u, v, 1.0)
        leave(surfaces, at.side_id, at.point, sample_diffuse(at.normal, uniform(path, 2), uniform(path, 3)), rays, i)


@njit(**KERNEL)
def _bounce(stage, key, bounce, hits, paths, gathers, tally):
    """Mark the sheets that paths meet, add the throughputs to the tally, and send the paths on.

    Paths that left the scene stay outside. Rough lobes count as diffuse.
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
        at = interact(surfaces, hits, i, paths.direction)
        label = sheet_of(surfaces, at.side_id)
        tally.reached[label] = True
        if bounce > 0:
            tally.sources[label] += paths.throughput[i]
        paths.label[i] = label
        tally.left[label] += 1.0
        lobes, path, total = lobes_at(stage, at), path_key(key, i), one_reflectance_at(stage, at, TOTAL, at.cosine)
        paths.throughput[i] *= total
        specular = lobes.specular
        if follows_fresnel(lobes) and total > 0.0:
            specular = 1.0 - diffuse_share(lobes) * one_reflectance_at(stage, at, BELOW, at.cosine) / total
        s, w = uniform(path, 3 * bounce + 9), uniform(path, 3 * bounce + 10)
        if lobes.flags & SPECULAR and uniform(path, 3 * bounce + 8) < specular:
            leave(surfaces, at.side_id, at.point, sample_specular(lobes, at, s, w).direction, paths, i)
            continue
        if not gathers.found[i]:
            put_vector(at.point, gathers.point, i)
            put_vector(at.normal, gathers.normal, i)
            gathers.found[i], gathers.side_id[i], gathers.throughput[i] = True, at.side_id, paths.throughput[i]
        leave(surfaces, at.side_id, at.point, sample_diffuse(at.normal, s, w), paths, i)


@njit(**KERNEL)
def _reach_back(surfaces, side_id, triangle, rays, reached):
    """Mark sheets from which a reached sheet is visible: they can send photons there. triangle: (n,) int32, met by the
    rays from the sides (n,)."""
    for i in range(side_id.size):
        if triangle[i] >= 0:
            seen = facing_side(surfaces, triangle[i], vector(rays.direction, i))
            if reached[sheet_of(surfaces, seen)]:
                reached[sheet_of(surfaces, side_id[i])] = True


def gather_reach(area: np.ndarray, pilot: Pilot, photons: int, neighbours: int) -> float:
    """Squared radius (m2) of the largest gather disk.

    Where photons are nine times sparser than on average over the reachable surfaces, this disk holds k photons. Where
    they are sparser still, the disk stays as large and holds fewer: this means more noise, which the image tells, and
    not more blur, which it does not tell. For the same reason the disk is no wider than an eighth of the view, unless
    the view is so small (as of a camera that touches what it sees) that such a disk would hold less than one photon.
    """
    reachable = float(np.sum(area * pilot.reachable.sum(axis=1)))
    one = max(reachable, 1e-30) / (math.pi * photons)  # holds one photon on average
    return min(9.0 * neighbours * one, max((pilot.view / 16.0) ** 2, one))
