# SPDX-License-Identifier: GPL-3.0-or-later
"""Specks: surfaces that the camera sees straight, so small in the picture, or so thin, that no ray may meet them.

A thing that fills a thousandth of a pixel, such as a person a kilometre away or a power line, is met by few rays, and
none may be among the first thousands. Then nothing in the pixel tells of it. But the plan knows where it is. So the
sheets that span few pixels, or are narrow, are projected into the picture, and rays to points on their triangles tell
which are seen. They add to the variance by which camera rays are chosen, and to the error of pixels that have not met
them yet (Film.expected). Where the temperature or the material changes from one triangle to the next, a sheet falls
into parts: hot faces of a large mesh are specks, too.

What is seen of them in mirrors and through thin sheets is not looked for, nor what is seen through narrow gaps; a lens
is taken as a pinhole. Hot texels of an image, and small hot gas, are no specks.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, empty_eye_rays, rays_through
from ..geometry.interaction import interact
from ..geometry.mesh import label_sheets
from ..geometry.see_through import transmit_all
from ..geometry.segments import Tracer, ways
from ..geometry.stage import Stage, emission_at, nothing_emitted
from ..geometry.surfaces import Surfaces, facing_side
from ..geometry.triangles import corner
from ..image.pooling import REACH
from ..sampling.vectors import difference
from ..sampling.warps import triangle_point
from ..system.kernels import INLINED, KERNEL, njit, thinned
from .antialiasing import camera_variance

_LARGEST = 2.0 * REACH + 1.0  # pixels that a speck spans at most: of larger things neighbours tell, see pooling
_NARROW = (
    0.25  # pixels, mean width of larger ones: the survey's 16 rays through a pixel miss what is wider 1 time in 100
)
_DENSITY, _POINTS = 16.0, 1 << 14  # points on a triangle for each pixel that it is long, and at most
_RAYS = 1 << 18  # triangles, at most, each of which then stands for several; and points on them, about, at most
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class Specks(NamedTuple):
    """Specks by pixel of the window (p,), float64. share: of the pixel's area. radiance: W m-2 sr-1 of all bands, mean
    excess that they emit, 0 where there are none. width: pixels, mean width of their parts."""

    share: np.ndarray
    radiance: np.ndarray
    width: np.ndarray


def variance_of_specks(specks: Specks, samples: int) -> np.ndarray:
    """(p,) variance of the radiance that single camera rays see by specks, as far as so many samples of each pixel,
    which did not look for them, do not tell. specks: with the contrast to what is around them for their radiance."""
    unmet = (1.0 - specks.share) ** samples
    return unmet * specks.share * (1.0 - specks.share) * specks.radiance**2


def what_to_expect(specks: Specks, variance: np.ndarray, samples: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Film.expected. specks: as in variance_of_specks. variance: (p,) of the radiance that single camera rays see.
    samples: (p,) camera rays of a pass. weights: (b,) response of the sensor, of which the mean counts."""
    met, response = np.where(specks.share > 0.0, specks.width**2 * samples, np.inf), weights.mean()
    of_pass = camera_variance(variance, samples, False, 1.0)
    added = specks.share * specks.radiance * response
    return np.stack((response**2 * of_pass, added, specks.share * samples, met))


class _Projected(NamedTuple):
    """Triangles (t,) in the picture. area: pixels, 0 if it is not all before the camera. length: pixels, along the axis
    of the picture along which it is longer. Both are float32. label: int32, of the part of a sheet on the side towards
    the camera."""

    area: np.ndarray
    length: np.ndarray
    label: np.ndarray


def find_specks(stage: Stage, tracer: Tracer, eye: Eye) -> Specks:
    """The Specks that an eye sees."""
    surfaces, (x0, y0, x1, y1) = stage.surfaces, (int(end) for end in eye.window)
    parts = find_parts(surfaces)
    specks, count = Specks(*np.zeros((3, (x1 - x0) * (y1 - y0)))), len(surfaces.sheet)
    seen, place = _Projected(*np.empty((2, count), np.float32), np.empty(count, np.int32)), np.empty((3, 2))
    ends = np.full((int(parts.max()) + 1, 4), -math.inf)  # of each part: -x, -y, x and y where it reaches farthest
    total = np.zeros(len(ends))
    _project(surfaces, parts, eye, place, seen, (ends, total))
    extent = (ends[:, :2] + ends[:, 2:]).max(axis=1)
    small = (extent < _LARGEST) | ((total < _NARROW * extent) & (extent < math.inf))
    chosen = np.flatnonzero((seen.area > 0.0) & small[seen.label])
    every = max(1, -(-len(chosen) // _RAYS))
    (chosen,) = thinned((chosen,), every)
    points = np.clip(np.ceil(_DENSITY * seen.length[chosen]), 1, _POINTS)
    points = np.ceil(points * min(1.0, _RAYS / max(points.sum(), 1.0))).astype(np.int64)
    x, y = np.empty((2, points.sum()))
    _spread(surfaces, eye, (chosen, points), place, x, y)
    inside = np.flatnonzero((x0 <= x) & (x < x1) & (y0 <= y) & (y < y1))
    if len(inside) == 0:
        return specks
    (x, y), of = (x[inside], y[inside]), np.repeat(np.arange(len(chosen)), points)[inside]
    *rays, reach = empty_eye_rays(len(inside))
    rays_through(eye._replace(lens_radius=0.0), x, y, *rays, reach)
    hits = tracer.camera.trace(*rays, reach)
    bands = stage.radiometry.reference.size
    through = np.ones((len(inside), bands), np.float32)
    if tracer.holds_media:
        transmit_all(tracer.cross(*rays, ways(hits)), through)
    pixel = np.floor(x).astype(np.int64) - x0 + (np.floor(y).astype(np.int64) - y0) * (x1 - x0)
    label, width = seen.label[chosen[of]], total / np.maximum(extent, 1e-300)
    wanted = label, pixel, every * (seen.area[chosen] / points)[of], width[label]
    _add(stage, parts, hits, rays[1], wanted, (nothing_emitted(bands, np.float64), through), specks)
    for column in specks[1:]:
        column /= np.maximum(specks.share, 1e-300)
    np.minimum(specks.share, 1.0, out=specks.share)
    return specks


def find_parts(surfaces: Surfaces) -> np.ndarray:
    """(m, 2) int32 label of the part of a sheet to which each side of each triangle belongs: of connected surface, over
    which neither the temperature nor the material jumps. The sheets themselves where none does."""
    if not _jumps_anywhere(surfaces):
        return surfaces.sheet
    neighbours = surfaces.neighbours.copy()
    _cut(surfaces, neighbours)
    return label_sheets(surfaces.plane, neighbours)


@njit(**KERNEL)
def _jumps_anywhere(surfaces):
    for t in range(surfaces.sheet.shape[0]):
        for i in range(3):
            if _jumps(surfaces, t, surfaces.neighbours[t, i]):
                return True
    return False


@njit(**KERNEL)
def _cut(surfaces, neighbours):
    """Part the triangles between which the temperature or the material jumps. neighbours: (m, 3), copy of Surfaces'."""
    for t in range(neighbours.shape[0]):
        for i in range(3):
            if _jumps(surfaces, t, surfaces.neighbours[t, i]):
                neighbours[t, i] = -1


@njit(**INLINED)
def _jumps(surfaces, t, neighbour):
    """Whether a triangle does not emit what its neighbour (see Surfaces) does. Where temperatures run from corner to
    corner they are taken to be the same along the edge."""
    if neighbour < 0:
        return False
    kelvin, other = surfaces.temperature, neighbour >> 1
    changes = kelvin[t, 0] != kelvin[other, 0] and _is_even(kelvin, t) and _is_even(kelvin, other)
    return changes or surfaces.material[t] != surfaces.material[other]


@njit(**INLINED)
def _is_even(kelvin, t):
    """Whether triangle t has one temperature. kelvin: (m, 1) or (m, 3), of corners."""
    last = kelvin.shape[1] - 1
    return kelvin[t, 0] == kelvin[t, last] and kelvin[t, 0] == kelvin[t, last // 2]


@njit(**KERNEL)
def _project(surfaces, parts, eye, place, seen, whole):
    """Fill seen, and of whole parts ends (labels, 4), see find_specks, and the total area (labels,), in pixels. place:
    room for (3, 2) float64."""
    ends, total = whole
    for t in range(seen.area.size):
        is_before = _put_corners(surfaces, eye, t, place)
        side_id = facing_side(surfaces, t, _towards(eye, corner(surfaces.corners, t, 0)))
        label = parts[side_id >> 1, side_id & 1]
        seen.label[t], seen.area[t], seen.length[t] = label, 0.0, 0.0
        if not is_before:  # the sheet has no size in the picture
            ends[label, :] = np.inf
            continue
        ux, uy = place[1, 0] - place[0, 0], place[1, 1] - place[0, 1]
        vx, vy = place[2, 0] - place[0, 0], place[2, 1] - place[0, 1]
        seen.area[t] = 0.5 * abs(ux * vy - uy * vx)
        total[label] += seen.area[t]
        for axis in range(2):
            low = min(place[0, axis], min(place[1, axis], place[2, axis]))
            high = max(place[0, axis], max(place[1, axis], place[2, axis]))
            seen.length[t] = max(seen.length[t], high - low)
            ends[label, axis] = max(ends[label, axis], -low)
            ends[label, 2 + axis] = max(ends[label, 2 + axis], high)


@njit(**KERNEL)
def _spread(surfaces, eye, chosen, place, x, y):
    """Fill x and y, pixels, with points that lie evenly on triangles in the picture. chosen: these, and how many points
    on each. place: as in _project."""
    (triangles, points), n = chosen, np.int64(0)
    for i in range(triangles.size):
        _put_corners(surfaces, eye, triangles[i], place)
        for k in range(points[i]):
            u, v = triangle_point((k + 0.5) / points[i], (k + 0.5) * _GOLDEN % 1.0)
            x[n] = (1.0 - u - v) * place[0, 0] + u * place[1, 0] + v * place[2, 0]
            y[n] = (1.0 - u - v) * place[0, 1] + u * place[1, 1] + v * place[2, 1]
            n += 1


@njit(**INLINED)
def _put_corners(surfaces, eye, t, place):
    """Fill place (3, 2) with where the corners of a triangle are in the picture; returns whether all lie before the
    camera."""
    is_before = True
    for k in range(3):
        place[k, 0], place[k, 1], before = _place(eye, corner(surfaces.corners, t, k))
        is_before &= before
    return is_before


@njit(**INLINED)
def _towards(eye, point):
    """A direction in which the eye looks at a point."""
    m = eye.matrix
    if eye.kind == 1:
        return (-m[0, 2], -m[1, 2], -m[2, 2])
    return difference(point, (m[0, 3], m[1, 3], m[2, 3]))


@njit(**INLINED)
def _place(eye, point):
    """Where a point is in the picture, in pixels from the lower left, and whether it lies before the camera."""
    m = eye.matrix
    way = difference(point, (m[0, 3], m[1, 3], m[2, 3]))
    x = way[0] * m[0, 0] + way[1] * m[1, 0] + way[2] * m[2, 0]
    y = way[0] * m[0, 1] + way[1] * m[1, 1] + way[2] * m[2, 1]
    ahead = -(way[0] * m[0, 2] + way[1] * m[1, 2] + way[2] * m[2, 2])
    is_before = eye.kind != 0 or ahead > 0.0
    if eye.kind == 0:
        x, y = x / max(ahead, 1e-30), y / max(ahead, 1e-30)
    elif eye.kind == 2:
        x, y = math.atan2(x, ahead), math.atan2(y, math.sqrt(x * x + ahead * ahead))
    left, right, bottom, top = eye.frame[0], eye.frame[1], eye.frame[2], eye.frame[3]
    return (x - left) / (right - left) * eye.width, (y - bottom) / (top - bottom) * eye.height, is_before


@njit(**KERNEL)
def _add(stage, parts, hits, direction, wanted, rooms, specks):
    """Add to the pixels what rays meet on the parts that they were sent to, radiance and width times the area. wanted:
    label of the part, pixel, area and width in pixels. rooms: for emission, and what media let through (n, b)."""
    (labels, pixel, area, width), (emitted, through) = wanted, rooms
    for i in range(labels.size):
        if hits.triangle[i] < 0:
            continue
        at = interact(stage.surfaces, hits, i, direction)
        if parts[at.side_id >> 1, at.side_id & 1] == labels[i]:
            radiance, total = emission_at(stage, at, emitted), 0.0
            for b in range(radiance.size):
                total += through[i, b] * radiance[b]
            specks.share[pixel[i]] += area[i]
            specks.radiance[pixel[i]] += area[i] * total
            specks.width[pixel[i]] += area[i] * width[i]
