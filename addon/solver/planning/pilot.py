# SPDX-License-Identifier: GPL-3.0-or-later
"""A short deterministic look at the scene before the first pass: what the image can depend on, and how open it is.

Every run of a scene repeats it identically, so passes rendered elsewhere belong to the same image.
"""

import math
from typing import NamedTuple

import numpy as np

from ..camera.lamps import SKY_RAYS
from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.surfaces import Surfaces, Tracer, facing_side, point, put_ray, sheet_count, start_ray, unit_normal
from ..sampling.rng import PILOT, pass_key, path_key, strata, uniform
from ..sampling.warps import cosine_direction, mirror, triangle_point
from ..system.kernels import KERNEL, njit

_CAMERA_PATHS = 4096
_BOUNCES = 8
_PROBES = 8192  # rays from sides that no camera path met
# Chance of a side that seems out of the image's reach, against one within: nothing can be missed for good.
DEFENSIVE = 1.0 / 64.0
_OPEN = 0.95  # share of the paths from a sheet that leave the scene above which it is open
_TYPICAL_PHOTONS = 50  # of a gather
_LEAST_ERROR = 0.1  # weight of surroundings that seem to be free of everything: a few paths cannot tell
_LEAST_OPEN = 16  # paths that must have been sent from it
_LEAST_DENSITY = 1.0 / 4.0  # of sides that matter, over their mean
_PRIOR = 4.0  # paths that the mean density is worth on a sheet


class Pilot(NamedTuple):
    """What camera paths found.

    matters: (t, 2) bool, sides that the image can depend on.
    weight: (t, 2) float64, factor on the chance that a side emits: 1 on average, more where much of what the image
        gathers comes from, at least DEFENSIVE. arrival: the same for photons from the surroundings to arrive there.
    open: (t, 2) bool, sides from which nearly every direction leaves the scene: a ray says more than photons there.
    importance: (t,) float64, how much of the light that the image gathers comes from each triangle, were all equally
        bright; sky: how much comes from the surroundings, less where open sides see them. Together at most 1.
    openness: share of cosine-distributed directions from the sides that matter that leave the scene, 0 if none does.
    view: m, width of the frame where the camera's rays meet the scene (median); infinite if they meet nothing.
    place, facing: (r, 3) float64, points where camera paths gather and the normals there. code: (r,) int32, 2 triangle
        + side. carried: (r,) float64, share of a pixel that their reflected light makes up.
    left, met: (p,) int32, label of the sheet that camera paths left, mirrored or in a random direction, and triangle
        that they met, -1 for the surroundings.
    """

    matters: np.ndarray
    weight: np.ndarray
    arrival: np.ndarray
    open: np.ndarray
    importance: np.ndarray
    sky: float
    openness: float
    view: float
    place: np.ndarray
    facing: np.ndarray
    code: np.ndarray
    carried: np.ndarray
    left: np.ndarray
    met: np.ndarray


def explore(
    surfaces: Surfaces,
    tracer: Tracer,
    eye: Eye,
    reflectance: np.ndarray,
    specular: np.ndarray,
    is_mirror: np.ndarray,
    area: np.ndarray,
) -> Pilot:
    """Follow camera paths that never end; the connected sheets of surface they meet matter.

    A sheet also matters if something that matters is seen from it, so that small sources are not overlooked.
    reflectance, specular: (m,) float64 of each material, is_mirror: (m,) bool, whether its specular lobe is sharp.
    area: (t,) float64, m2.
    The seed has no part in it: renders of one scene with different seeds can be merged.
    """
    key = pass_key(0, 0, PILOT)
    sheet = surfaces.sheet
    labels = sheet_count(surfaces)
    reached = np.zeros(labels, np.bool_)
    count = _CAMERA_PATHS
    pixels = int((eye.window[2] - eye.window[0]) * (eye.window[3] - eye.window[1]))
    origin, direction, reach = empty_eye_rays(count)
    chosen, samples = np.unique(strata(pass_key(0, 8, PILOT), count, pixels), return_counts=True)
    eye_rays(eye, key, 0, samples.astype(np.uint16), chosen, origin, direction, reach)
    paths = _Paths(
        origin, direction, np.ones(count), np.full(count, -1), np.zeros(count, np.bool_),
        np.empty((count, 3)), np.zeros((count, 3)), np.empty(count, np.int32), np.empty(count),
    )  # fmt: skip
    importance = np.zeros(len(sheet) + 1)
    sources, escapes, left, escaped = np.zeros((4, labels))
    looks = (reflectance, specular, is_mirror)
    sights = []
    for bounce in range(_BOUNCES):
        triangle, u, v = tracer.trace(origin, direction, reach)
        if bounce == 0:
            view = _view_width(surfaces, eye, triangle, u, v)
        on_way = paths.label >= 0
        sights.append((paths.label[on_way], triangle[on_way]))
        _bounce(
            surfaces, looks, key, bounce, triangle, u, v, paths, reached, importance, sources, escapes, left, escaped
        )
        reach = np.full(count, 1e37, np.float32)
    for round_ in range(3):
        codes = _probe_codes(sheet, reached)
        if codes.size == 0:
            break
        triangle, direction = _probe(surfaces, tracer, pass_key(0, 1 + round_, PILOT), codes)
        before = reached.sum()
        _reach_back(surfaces, sheet, codes, triangle, direction, reached)
        if reached.sum() == before:
            break
    matters = reached[sheet]
    chosen = np.cumsum((area[:, None] * matters).ravel())
    openness = 0.0
    if chosen[-1] > 0:
        picks = np.searchsorted(chosen, chosen[-1] * (np.arange(_CAMERA_PATHS) + 0.5) / _CAMERA_PATHS)
        triangle, _ = _probe(surfaces, tracer, pass_key(0, 9, PILOT), picks.astype(np.int32))
        openness = float(np.mean(triangle < 0))
    is_open = (left >= _LEAST_OPEN) & (escaped > _OPEN * left)
    importance /= max(importance.sum(), 1e-300)
    # Rays to the surroundings leave an error of sqrt((1 - V) / (V n)), V the share of them that is free, n their number
    # (stratified, they count double); photons leave 1 / sqrt(k). The weight of an open side is the ratio of both.
    visible = escaped / np.maximum(left, 1.0)
    error = np.sqrt((1.0 - visible) / np.maximum(visible, 1e-9) * (_TYPICAL_PHOTONS / (2.0 * SKY_RAYS)))
    weight = np.where(is_open, np.clip(error, _LEAST_ERROR, 1.0), 1.0)
    hidden = float(np.sum(escapes * weight)) / max(escapes.sum(), 1e-300)
    gathers = np.any(paths.facing != 0.0, axis=1)
    return Pilot(
        matters,
        _density(sources, sheet, area, matters),
        _density(escapes, sheet, area, matters),
        is_open[sheet],
        importance[:-1],
        float(importance[-1] * hidden),
        openness,
        view,
        paths.place[gathers],
        paths.facing[gathers],
        paths.code[gathers],
        paths.carried[gathers],
        *map(np.concatenate, zip(*sights, strict=True)),
    )


class _Paths(NamedTuple):
    """Camera paths: rays (n, 3) float32; weight (n,); label (n,) of the sheet they left,
    -1 for the camera; whether they have been reflected other than by mirrors (n,) bool;
    where that was first, place and facing (n, 3), zeros where it was not, code (n,) and what it carried (n,).
    """

    origin: np.ndarray
    direction: np.ndarray
    weight: np.ndarray
    label: np.ndarray
    scattered: np.ndarray
    place: np.ndarray
    facing: np.ndarray
    code: np.ndarray
    carried: np.ndarray


def _density(count: np.ndarray, sheet: np.ndarray, area: np.ndarray, matters: np.ndarray) -> np.ndarray:
    """(t, 2) density of what was counted on every sheet, over the mean of the sides that matter.

    A sheet that few paths could meet is taken to be like the mean: the mean of a gamma posterior with that prior.
    """
    size = np.bincount(sheet.ravel(), (area[:, None] * matters).ravel(), count.size)
    mean = count.sum() / max(size.sum(), 1e-300)
    if mean == 0.0:
        return np.where(matters, 1.0, DEFENSIVE)
    count = count * (_CAMERA_PATHS / count.sum())  # as many as were met, about, whatever their weights
    density = (count + _PRIOR) / (size * (_CAMERA_PATHS / max(size.sum(), 1e-300)) + _PRIOR)
    return np.where(matters, np.maximum(density, _LEAST_DENSITY)[sheet], DEFENSIVE)


def _view_width(surfaces: Surfaces, eye: Eye, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> float:
    """Median width of the frame (m) at the points that camera rays hit; a radian's width for panoramas."""
    hit = triangle >= 0
    if not hit.any():
        return math.inf
    corners = surfaces.corners[triangle[hit]]
    u, v = u[hit, None], v[hit, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    distance = float(np.median(np.linalg.norm(points - eye.matrix[:, 3], axis=1)))
    width = float(eye.frame[1] - eye.frame[0])
    return (width * distance, width, distance)[eye.kind]


def _probe_codes(sheet: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """Sides (codes 2 t + side) of sheets that are not reached, some of every sheet, in all about _PROBES."""
    labels = sheet.ravel()
    codes = np.flatnonzero(~reached[labels]).astype(np.int32)
    order = np.argsort(labels[codes], kind="stable")
    codes = codes[order]
    _, starts, sizes = np.unique(labels[codes], return_index=True, return_counts=True)
    if starts.size == 0:
        return codes
    each = min(64, max(1, _PROBES // starts.size))
    picks = starts[:, None] + (np.arange(each) + 0.5) / each * sizes[:, None]
    return codes[picks.astype(np.int64).ravel()]


def _probe(surfaces: Surfaces, tracer: Tracer, key: int, codes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What cosine-distributed rays from these sides hit, and their directions."""
    origin, direction = np.empty((codes.size, 3), np.float32), np.empty((codes.size, 3), np.float32)
    _start_probes(surfaces, key, codes, origin, direction)
    return tracer.trace(origin, direction)[0], direction


@njit(**KERNEL)
def _start_probes(surfaces, key, codes, origin, direction):
    for i in range(codes.size):
        path = path_key(key, i)
        u, v = triangle_point(uniform(path, 0), uniform(path, 1))
        x, y, z = cosine_direction(uniform(path, 2), uniform(path, 3))
        start_ray(surfaces, codes[i], u, v, x, y, z, origin, direction, i)


@njit(**KERNEL)
def _bounce(surfaces, looks, key, bounce, triangle, u, v, paths, reached, importance, sources, escapes, left, escaped):
    """Mark the sheets that rays meet, add up what they would carry to the image, and send them on.

    Those that left the scene stay outside. importance: (t + 1,), the last entry for the surroundings. sources, escapes:
    by label of the sheet that sends light to the path, or that the path left the scene from; left, escaped: the same as
    numbers of paths.
    """
    reflectance, specular, is_mirror = looks
    for i in range(triangle.size):
        t = triangle[i]
        if bounce > 0:
            importance[t if t >= 0 else importance.size - 1] += paths.weight[i]
        if t < 0:
            if paths.label[i] >= 0:
                escapes[paths.label[i]] += paths.weight[i]
                escaped[paths.label[i]] += 1.0
            paths.weight[i], paths.label[i] = 0.0, -1
            continue
        side = facing_side(surfaces, t, paths.direction, i)
        label = surfaces.sheet[t, side]
        reached[label] = True
        if bounce > 0:
            sources[label] += paths.weight[i]
        paths.label[i] = label
        left[label] += 1.0
        material = surfaces.material[t]
        paths.weight[i] *= reflectance[material]
        path = path_key(key, i)
        nx, ny, nz = unit_normal(surfaces, t, side)
        if is_mirror[material] and uniform(path, 3 * bounce + 8) < specular[material]:
            dx, dy, dz = paths.direction[i]
            ox, oy, oz = mirror(dx, dy, dz, nx, ny, nz, -(dx * nx + dy * ny + dz * nz))
            x, y, z = point(surfaces.corners, t, u[i], v[i])
            put_ray(surfaces, t, x, y, z, nx, ny, nz, ox, oy, oz, paths.origin, paths.direction, i)
            continue
        if not paths.scattered[i]:
            paths.scattered[i] = True
            paths.place[i] = point(surfaces.corners, t, u[i], v[i])
            paths.facing[i, 0], paths.facing[i, 1], paths.facing[i, 2] = nx, ny, nz
            paths.code[i], paths.carried[i] = 2 * t + side, paths.weight[i]
        x, y, z = cosine_direction(uniform(path, 3 * bounce + 9), uniform(path, 3 * bounce + 10))
        start_ray(surfaces, 2 * t + side, u[i], v[i], x, y, z, paths.origin, paths.direction, i)


@njit(**KERNEL)
def _reach_back(surfaces, sheet, codes, triangle, direction, reached):
    """A sheet from which a reached sheet is seen can send it photons, so it is reached too."""
    for i in range(codes.size):
        if triangle[i] >= 0:
            side = facing_side(surfaces, triangle[i], direction, i)
            if reached[sheet[triangle[i], side]]:
                reached[sheet[codes[i] >> 1, codes[i] & 1]] = True


def gather_reach(area: np.ndarray, pilot: Pilot, photons: int, neighbours: int) -> float:
    """Squared radius (m2) of the largest gather disk.

    Where photons lie one ninth as dense as on average over the surfaces that matter, the disk holds k of them; in
    sparser places it keeps its size and holds fewer: more noise, which the image says, rather than more blur, which it
    does not. For the same reason it is no wider than an eighth of the picture, but for pictures so small that such a
    disk would hold less than one photon (a camera may touch what it sees).
    """
    matters = float(np.sum(area * pilot.matters.sum(axis=1)))
    one = max(matters, 1e-30) / (math.pi * photons)  # holds one photon on average
    return min(9.0 * neighbours * one, max((pilot.view / 16.0) ** 2, one))
