# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot: a few camera paths before the first pass tell what the image can depend on, and how open the scene is.

Every run of a scene repeats the pilot identically, so that passes rendered on other machines belong to the same image.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.curved import reflecting
from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.interaction import emit_at, interact, leave
from ..geometry.segments import FROM_CAMERA, FROM_DIFFUSE, Hits, RayBatch, Tracer, empty_ray_batch
from ..geometry.stage import Stage, lobes_at, one_reflectance_at
from ..geometry.surfaces import Surfaces, facing_side, sheet_count, sheet_of
from ..geometry.triangles import area_of
from ..photons.side_table import build_side_table, first_found, found_from, number_in, side_at
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
    """What the pilot's camera paths found, p steps of paths and r gathers. The sides of a sheet are all alike.

    reachable: (labels,) bool, sheets that the image can depend on.
    weight: (labels,) float64, factor on the probability that a sheet emits: 1 on average over reachable ones, more
        where much of the light in the image comes from, at least DEFENSIVE. arrival: (labels,) float64, the same factor
        for photons from the surroundings that arrive on a sheet.
    open: (labels,) bool, sheets from which nearly every direction leaves the scene: there a ray says more than photons.
    extent: (labels,) float64, m2, area of each sheet.
    sky: share of the light in the image that comes from the surroundings, if all triangles and the surroundings were
        equally bright, lowered for open sheets, which find the surroundings by rays.
    openness: share of cosine-distributed directions from reachable sides that leave the scene; 0 without such sides.
    background: share of the camera's rays that meet nothing.
    view: m, width of the frame at the median distance where camera rays meet the scene; infinite if they meet nothing.
    point, normal: (r, 3) float64, points where camera paths gather, m, and the normals there. side_id: (r,) int32,
    sides
        of these points. throughput: (r,) float64, share of a pixel that the light reflected there makes up.
    left: (p,), label of the sheet that a path left, mirrored or in a random direction. met: (p,) int32, triangle that
        the path met next, -1 for the surroundings. importance: (p,) float64, share of the light in the image that comes
        from there this way, if all triangles and the surroundings were equally bright; together 1, or 0 if nothing is
        reflected.
    """

    reachable: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    open: np.ndarray
    extent: np.ndarray
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
    importance: np.ndarray


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

    reached: (labels,) bool, sheets that a path met. The other fields are (labels,) float64. sources: throughput of the
    paths that met the sheet. escapes: throughput of the paths that left the scene from the sheet. left: number of paths
    that left the sheet. escaped: number of paths that left the scene from the sheet.
    """

    reached: np.ndarray
    sources: np.ndarray
    escapes: np.ndarray
    left: np.ndarray
    escaped: np.ndarray


def explore(stage: Stage, tracer: Tracer, eye: Eye) -> Pilot:
    """Follow camera paths without roulette; the sheets that they meet are reachable.

    A sheet is reachable, too, if a reachable sheet is visible from it, so that small sources are not overlooked.
    stage: in one band, see grey_radiometry.
    The seed of the render is not used, so that renders of one scene with different seeds can be merged.
    """
    surfaces = stage.surfaces
    paths, reach = _camera_paths(eye)
    gathers = _Gathers(
        np.zeros(_CAMERA_PATHS, np.bool_),
        np.empty((_CAMERA_PATHS, 3)),
        np.empty((_CAMERA_PATHS, 3)),
        np.empty(_CAMERA_PATHS, np.int32),
        np.empty(_CAMERA_PATHS),
    )
    labels = sheet_count(surfaces)
    tally = _Tally(np.zeros(labels, np.bool_), *np.zeros((4, labels)))
    view, background, sights = math.inf, 0.0, []
    for bounce in range(_BOUNCES):
        hits = tracer.seen_from(FROM_DIFFUSE if bounce else FROM_CAMERA).trace(paths.origin, paths.direction, reach)
        if bounce == 0:
            view, background = _view_width(surfaces, eye, hits), float(np.mean(hits.triangle < 0))
        on_way = paths.label >= 0
        sights.append((paths.label[on_way], hits.triangle[on_way], paths.throughput[on_way]))
        _bounce(stage, pass_key(0, PATHS, PILOT), bounce, hits, paths, gathers, tally)
        reach = np.full(_CAMERA_PATHS, 1e37, np.float32)
    extent, sides = np.zeros(labels), np.zeros(labels, np.int64)
    _add_extent(surfaces, extent, sides)
    _reach_further(surfaces, tracer, sides, tally.reached)
    reachable = tally.reached
    is_open = (tally.left >= _LEAST_OPEN) & (tally.escaped > _OPEN * tally.left)
    left, met, importance = map(np.concatenate, zip(*sights, strict=True))
    importance /= max(importance.sum(), 1e-300)
    return Pilot(
        reachable=reachable,
        weight=_density(tally.sources, extent, reachable),
        arrival=_density(tally.escapes, extent, reachable),
        open=is_open,
        extent=extent,
        sky=float(importance[met < 0].sum() * _hidden(tally, is_open)),
        openness=_openness(surfaces, tracer, reachable),
        background=background,
        view=view,
        point=gathers.point[gathers.found],
        normal=gathers.normal[gathers.found],
        side_id=gathers.side_id[gathers.found],
        throughput=gathers.throughput[gathers.found],
        left=left,
        met=met,
        importance=importance,
    )


@njit(**KERNEL)
def _add_extent(surfaces, extent, sides):
    """Add to extent (labels,) the area of each sheet, m2, and to sides (labels,) how many sides it has."""
    for t in range(surfaces.sheet.shape[0]):
        area = area_of(surfaces.corners, t)
        for side in range(2):
            extent[surfaces.sheet[t, side]] += area
            sides[surfaces.sheet[t, side]] += 1


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


def _density(count: np.ndarray, extent: np.ndarray, reachable: np.ndarray) -> np.ndarray:
    """(labels,) float64 density of the counts (labels,) on each sheet, over the mean density of the reachable sheets.

    A sheet so small that few paths could meet it is taken to be like the mean: this is the mean of the posterior with
    a gamma distribution as prior.
    """
    size = extent * reachable
    mean = count.sum() / max(size.sum(), 1e-300)
    if mean == 0.0:
        return np.where(reachable, 1.0, DEFENSIVE)
    count = count * (_CAMERA_PATHS / count.sum())  # about as many as there were paths, whatever their throughputs
    density = (count + _PRIOR) / (size * (_CAMERA_PATHS / max(size.sum(), 1e-300)) + _PRIOR)
    return np.where(reachable, np.maximum(density, _LEAST_DENSITY), DEFENSIVE)


def _view_width(surfaces: Surfaces, eye: Eye, hits: Hits) -> float:
    """Width of the frame (m) at the median distance where camera rays hit; for panoramas of a radian."""
    hit = hits.triangle >= 0
    if not hit.any():
        return math.inf
    corners = surfaces.corners.of(hits.triangle[hit])
    u, v = hits.u[hit, None], hits.v[hit, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    distance = float(np.median(np.linalg.norm(points - eye.matrix[:, 3], axis=1)))
    width = float(eye.frame[1] - eye.frame[0])
    return (width * distance, width, distance)[eye.kind]


def _openness(surfaces: Surfaces, tracer: Tracer, reachable: np.ndarray) -> float:
    """Share of cosine-distributed directions from the reachable sides that leave the scene, 0 if there are none."""
    table, chosen = build_side_table(surfaces, reachable), np.empty(_CAMERA_PATHS, np.int32)
    if table.before[-1] == 0.0:
        return 0.0
    _choose_evenly(surfaces, table, chosen)
    triangle, _ = _probe(surfaces, tracer, pass_key(0, OPENNESS, PILOT), chosen)
    return float(np.mean(triangle < 0))


@njit(**KERNEL)
def _choose_evenly(surfaces, table, chosen):
    """Fill chosen (n,) with sides at equal steps through a SideTable."""
    found = first_found(table, 0.0)
    for i in range(chosen.size):
        found = found_from(surfaces, table, number_in((i + 0.5) / chosen.size, table.before[-1]), found)
        chosen[i] = side_at(table, found.entry)


def _reach_further(surfaces: Surfaces, tracer: Tracer, sides: np.ndarray, reached: np.ndarray) -> None:
    """Mark in reached (labels,) bool the sheets from which a reached sheet is visible, as far as probes tell. sides:
    (labels,) int64, how many each sheet has."""
    for stream in PROBES:
        side_id = _unreached_sides(surfaces.sheet, sides, reached)
        if side_id.size == 0:
            break
        triangle, rays = _probe(surfaces, tracer, pass_key(0, stream, PILOT), side_id)
        before = reached.sum()
        _reach_back(surfaces, side_id, triangle, rays, reached)
        if reached.sum() == before:
            break


def _unreached_sides(sheet: np.ndarray, sides: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Side_ids (n,) int32 of sheets that are not reached: some sides of every sheet, in all about _PROBES."""
    unreached = np.flatnonzero(~reached)
    each = min(64, max(1, _PROBES // max(1, len(unreached))))
    wanted = ((np.arange(each) + 0.5) / each * sides[unreached, None]).astype(np.int32)
    row, chosen = np.full(len(reached), -1, np.int32), np.empty((len(unreached), each), np.int32)
    row[unreached] = np.arange(len(unreached))
    _choose_by_number(sheet, row, wanted, np.zeros((2, len(unreached)), np.int32), chosen)
    return chosen.ravel()


@njit(**KERNEL)
def _choose_by_number(sheet, row, wanted, room, chosen):
    """Fill chosen (n, k) with the sides of n sheets that have these numbers (n, k), ascending, among all of the sheet.

    row: (labels,) int32, of a sheet, or -1. room: (2, n) int32 zeros: how many sides passed, and are chosen.
    """
    missing = chosen.size
    for side_id in range(2 * sheet.shape[0]):
        if missing == 0:
            break
        n = row[sheet[side_id >> 1, side_id & 1]]
        if n < 0:
            continue
        while room[1, n] < wanted.shape[1] and wanted[n, room[1, n]] == room[0, n]:
            chosen[n, room[1, n]] = side_id
            room[1, n] += 1
            missing -= 1
        room[0, n] += 1


def _probe(surfaces: Surfaces, tracer: Tracer, key: np.uint64, side_id: np.ndarray) -> tuple[np.ndarray, RayBatch]:
    """Triangles (n,) that cosine-distributed rays from sides (n,) meet, -1 for none, and the rays."""
    rays = empty_ray_batch(side_id.size)
    _start_probes(surfaces, key, side_id, rays)
    return tracer.seen_from(FROM_DIFFUSE).trace(*rays).triangle, rays


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
            direction = sample_specular(lobes, reflecting(surfaces, lobes, at), s, w).direction
            leave(surfaces, at.side_id, at.point, direction, paths, i)
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


def gather_reach(pilot: Pilot, photons: int, neighbours: int) -> float:
    """Squared radius (m2) of the largest gather disk.

    Where photons are nine times sparser than on average over the reachable surfaces, this disk holds k photons. Where
    they are sparser still, the disk stays as large and holds fewer: this means more noise, which the image tells, and
    not more blur, which it does not tell. For the same reason the disk is no wider than an eighth of the view, unless
    the view is so small (as of a camera that touches what it sees) that such a disk would hold less than one photon.
    """
    reachable = float(pilot.extent[pilot.reachable].sum())
    one = max(reachable, 1e-30) / (math.pi * photons)  # holds one photon on average
    return min(9.0 * neighbours * one, max((pilot.view / 16.0) ** 2, one))
