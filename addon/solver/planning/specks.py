# SPDX-License-Identifier: GPL-3.0-or-later
"""Specks: surfaces that the camera sees straight, so small in the picture that no ray may meet them.

A thing that fills a thousandth of a pixel, such as a person a kilometre away, is met by few rays, of which none may be
among the first thousands. Then nothing in the pixel tells of it. But the plan knows where it is. So the sheets that
span few pixels are projected into the picture, and a ray to each of their triangles tells which are seen. They add to
the variance by which camera rays are chosen, and to the error of pixels that have not met them yet (Film.specks).

What mirrors and thin sheets show of them is not looked for, and a lens is taken as a pinhole.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, empty_eye_rays, rays_through
from ..geometry.interaction import interact
from ..geometry.segments import Tracer, transmit, ways
from ..geometry.stage import Stage, emission_at, nothing_emitted
from ..geometry.surfaces import facing_side, sheet_count, sheet_of
from ..geometry.triangles import corner
from ..image.pooling import REACH
from ..sampling.vectors import difference
from ..system.kernels import INLINED, KERNEL, njit

_LARGEST = 2.0 * REACH + 1.0  # pixels that a speck spans at most: of larger things neighbours tell, see pooling
_RAYS = 1 << 20  # triangles, at most, to which rays are sent; each then stands for several


class Specks(NamedTuple):
    """Specks by pixel of the window (p,), float64. share: of the pixel's area. radiance: W m-2 sr-1 of all bands, mean
    excess that they emit, 0 where there are none."""

    share: np.ndarray
    radiance: np.ndarray


def variance_of_specks(specks: Specks, samples: int) -> np.ndarray:
    """(p,) variance of the radiance that single camera rays see by specks, as far as so many samples of each pixel,
    which did not look for them, do not tell. specks: with the contrast to what is around them for their radiance."""
    unmet = (1.0 - specks.share) ** samples
    return unmet * specks.share * (1.0 - specks.share) * specks.radiance**2


def added_by_specks(specks: Specks, samples: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
    """Film.specks; None if there are none. specks: as in variance_of_specks. samples: (p,) camera rays of a pass.
    weights: (b,) response of the sensor, of which the mean counts."""
    if not specks.share.any():
        return None
    return np.stack((specks.share * specks.radiance * weights.mean(), specks.share * samples))


class _Projected(NamedTuple):
    """Triangles (t,) in the picture. x, y: of the middle, in pixels from the lower left. area: pixels, 0 if it cannot
    be seen. label: int32, of the sheet of the side towards the camera."""

    x: np.ndarray
    y: np.ndarray
    area: np.ndarray
    label: np.ndarray


def find_specks(stage: Stage, tracer: Tracer, eye: Eye) -> Specks:
    """The Specks that an eye sees."""
    surfaces, (x0, y0, x1, y1) = stage.surfaces, (int(end) for end in eye.window)
    specks, count = Specks(*np.zeros((2, (x1 - x0) * (y1 - y0)))), len(surfaces.sheet)
    seen = _Projected(*np.empty((3, count)), np.empty(count, np.int32))
    ends = np.full((sheet_count(surfaces), 4), -math.inf)  # of each sheet: -x, -y, x and y where it reaches farthest
    _project(surfaces, eye, np.empty((3, 2)), seen, ends)
    small = np.maximum(ends[:, 2] + ends[:, 0], ends[:, 3] + ends[:, 1]) < _LARGEST
    inside = (x0 <= seen.x) & (seen.x < x1) & (y0 <= seen.y) & (seen.y < y1)
    chosen = np.flatnonzero((seen.area > 0.0) & inside & small[seen.label])
    every = -(-len(chosen) // _RAYS)
    chosen = chosen[:: max(every, 1)]
    if len(chosen) == 0:
        return specks
    *rays, reach = empty_eye_rays(len(chosen))
    rays_through(eye, seen.x[chosen], seen.y[chosen], *rays, reach)
    hits = tracer.camera.trace(*rays, reach)
    bands, through = stage.radiometry.reference.size, np.ones((len(chosen), stage.radiometry.reference.size))
    if tracer.holds_media:
        _transmit(tracer.cross(*rays, ways(hits)), through)
    pixel = np.floor(seen.x[chosen]).astype(np.int64) - x0
    pixel += (np.floor(seen.y[chosen]).astype(np.int64) - y0) * (x1 - x0)
    area = every * seen.area[chosen]
    _add(stage, hits, rays[1], (seen.label[chosen], pixel, area), (nothing_emitted(bands, np.float64), through), specks)
    specks.radiance[:] /= np.maximum(specks.share, 1e-300)
    np.minimum(specks.share, 1.0, out=specks.share)
    return specks


@njit(**KERNEL)
def _transmit(air, through):
    for i in range(air.length.size):
        transmit(air, i, through[i])


@njit(**KERNEL)
def _project(surfaces, eye, place, seen, ends):
    """Fill seen, and ends (labels, 4), see find_specks. place: room for (3, 2) float64."""
    for t in range(seen.x.size):
        middle, is_before = (0.0, 0.0, 0.0), True
        for k in range(3):
            at = corner(surfaces.corners, t, k)
            middle = (middle[0] + at[0] / 3.0, middle[1] + at[1] / 3.0, middle[2] + at[2] / 3.0)
            place[k, 0], place[k, 1], before = _place(eye, at)
            is_before &= before
        label = sheet_of(surfaces, facing_side(surfaces, t, _towards(eye, middle)))
        seen.label[t], seen.area[t] = label, 0.0
        seen.x[t] = (place[0, 0] + place[1, 0] + place[2, 0]) / 3.0
        seen.y[t] = (place[0, 1] + place[1, 1] + place[2, 1]) / 3.0
        if not is_before:  # the sheet has no size in the picture
            ends[label, :] = np.inf
            continue
        ux, uy, vx, vy = (
            place[1, 0] - place[0, 0],
            place[1, 1] - place[0, 1],
            place[2, 0] - place[0, 0],
            place[2, 1] - place[0, 1],
        )
        seen.area[t] = 0.5 * abs(ux * vy - uy * vx)
        for k in range(3):
            for axis in range(2):
                ends[label, axis] = max(ends[label, axis], -place[k, axis])
                ends[label, 2 + axis] = max(ends[label, 2 + axis], place[k, axis])


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
def _add(stage, hits, direction, wanted, rooms, specks):
    """Add to the pixels what rays meet on the sheets that they were sent to. wanted: label of the sheet, pixel and area
    in pixels. rooms: for emission, and what media let through (n, b)."""
    (labels, pixel, area), (emitted, through) = wanted, rooms
    for i in range(labels.size):
        if hits.triangle[i] < 0:
            continue
        at = interact(stage.surfaces, hits, i, direction)
        if sheet_of(stage.surfaces, at.side_id) == labels[i]:
            radiance, total = emission_at(stage, at, emitted), 0.0
            for b in range(radiance.size):
                total += through[i, b] * radiance[b]
            specks.share[pixel[i]] += area[i]
            specks.radiance[pixel[i]] += area[i] * total
