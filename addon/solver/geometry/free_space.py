# SPDX-License-Identifier: GPL-3.0-or-later
"""Free space around points on surfaces: how wide a disk of photons may be before it reaches a wall.

A disk that reached beyond a wall would count light from the other side of the wall, and close to other surfaces light
changes quickly (Ward's harmonic distance says the same). So short rays along the surface, the feelers, look for other
surfaces. An overhang low over the surface is a wall, too, at the line of its rim. Close beside a wall a disk cannot be
as small as the free space: it is then wider, and the wall cuts it. One bounce later, in the irradiance cache, the
change of the light counts less than the noise of few photons: there the nearest wall cuts the disk, and only other
walls limit its radius.
"""

import math
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import cross, difference, dot, put_vector, scaled, vector
from ..sampling.warps import to_world, turn
from ..system.kernels import INLINED, KERNEL, njit
from .interaction import interact, leave
from .segments import Tracer, empty_ray_batch
from .surfaces import Surfaces, sheet_of, unit_normal
from .triangles import corner

_TURNS = 8  # directions along the surface
_RISES = (0.02, 0.1)  # rise over length of the two feelers in each direction; the low one finds low steps and overhangs
_BEYOND = 4.0  # length of feelers over the largest radius: under an overhang a feeler meets it well beyond its rim
_FEELERS = _TURNS * len(_RISES)
_HALF = math.sqrt(0.5)
_NEAREST = math.cos(math.pi / 8) ** 2  # a straight wall stands at most 22.5 degrees away from the nearest feeler,
_OTHERS = 0.5  # and, if another wall is in the way of that feeler, 45 degrees from the next one: squared cosines
_ALONG = 0.9  # share of the distance to the nearest wall from which on the end of a feeler lies on that wall
_STEEP = 0.5  # least sine of the angle between wall and surface; flatter ones do not end what lies beyond them
_RIM_STEPS = 64  # triangles of an overhang, at most, in the walk to its rim
LEAST_FREE = 1.0 / 36.0  # least area of a disk, however close the walls, over the area of the largest disk


class FreeSpace(NamedTuple):
    """The space around n points.

    radius2: (n,) float32, m2, squared radius of the disk that reaches no wall. cut2: (n,) float32, m2, squared radius
    of the disk that reaches none but the nearest wall. wall: (n, 3) float32, 1 / m, the nearest wall: a point p is
    beyond it, seen from the point x, if (p - x) . wall > 1; zeros where there is no wall.
    """

    radius2: np.ndarray
    cut2: np.ndarray
    wall: np.ndarray


def unlimited(count: int, reach2: float) -> FreeSpace:
    """The free space around count points without walls."""
    return FreeSpace(*np.full((2, count), reach2, np.float32), np.zeros((count, 3), np.float32))


@njit(**INLINED)
def wall_of(space, i):
    """The nearest wall of point i: three float32, 1 / m, see area.Ball."""
    return space.wall[i, 0], space.wall[i, 1], space.wall[i, 2]


def free_space(
    tracer: Tracer,
    surfaces: Surfaces,
    reach2: float,
    point: np.ndarray,
    side_id: np.ndarray,
    turns: np.ndarray,
    felt: np.ndarray | None = None,
) -> FreeSpace:
    """The free space around points, of at most sqrt(reach2) m.

    point: (n, 3) float64, m. side_id: (n,) int32, sides of the points. turns: (n,) float64 in [0, 1), angle, in turns,
    of the first feeler around each point. felt: indices of the points for which feelers are sent, the space around the
    others is unlimited; None for all.
    """
    space = unlimited(len(point), reach2)
    if felt is not None:
        known = free_space(tracer, surfaces, reach2, point[felt], side_id[felt], turns[felt])
        for column, values in zip(space, known, strict=True):
            column[felt] = values
        return space
    rays = empty_ray_batch(_FEELERS * len(point))
    _start_feelers(surfaces, point, side_id, turns, rays)
    reach = np.full(len(rays.origin), _BEYOND * math.sqrt(reach2), np.float32)
    hits = tracer.trace(*rays, reach)
    ways = np.empty((_FEELERS, 3))  # along the surface, to what the feelers of a point meet
    _narrow(surfaces, side_id, hits, rays, space, ways)
    return space


@njit(**KERNEL)
def _start_feelers(surfaces, point, side_id, turns, rays):
    """Fill _FEELERS rays for each point."""
    for i in range(side_id.size):
        start, n = vector(point, i), unit_normal(surfaces, side_id[i])
        c, s = turn(turns[i])
        row = _FEELERS * i
        for _ in range(_TURNS):
            for rise in _RISES:
                leave(surfaces, side_id[i], start, to_world((c, s, rise), n), rays, row)
                row += 1
            c, s = _HALF * (c - s), _HALF * (c + s)  # by 45 degrees


@njit(**KERNEL)
def _narrow(surfaces, side_id, hits, rays, space, ways):
    """Narrow the space (n points), unlimited so far, to what feelers meet. A feeler on a hollow surface may meet the
    same sheet: that is no wall. ways: (_FEELERS, 3) room."""
    for i in range(side_id.size):
        n, own = unit_normal(surfaces, side_id[i]), sheet_of(surfaces, side_id[i])
        nearest = math.inf  # m, to the plane of a wall
        met, reach2 = 0, float(space.radius2[i])
        for row in range(_FEELERS * i, _FEELERS * (i + 1)):
            if hits.triangle[row] < 0:
                continue
            at = interact(surfaces, hits, row, rays.direction)
            if sheet_of(surfaces, at.side_id) == own:
                continue
            feeler = difference(at.point, vector(rays.origin, row))
            share, across, distance = _wall(surfaces, at, n, feeler)
            free = scaled(_along_surface(feeler, n), share)
            if dot(free, free) > reach2:
                continue
            put_vector(free, ways, met)
            met += 1
            if 0.0 < abs(distance) < nearest:
                nearest = abs(distance)
                space.wall[i, 0], space.wall[i, 1] = across[0] / distance, across[1] / distance
                space.wall[i, 2] = across[2] / distance
        others = _OTHERS if nearest < math.inf else _NEAREST
        for each in range(met):
            way = vector(ways, each)
            length2 = dot(way, way)
            space.radius2[i] = min(space.radius2[i], np.float32(_NEAREST * length2))
            if dot(way, wall_of(space, i)) < _ALONG:
                space.cut2[i] = min(space.cut2[i], np.float32(others * length2))


@njit(**INLINED)
def _along_surface(way, n):
    """The part of a way (m) that runs along the surface with normal n."""
    height = dot(way, n)
    return way[0] - height * n[0], way[1] - height * n[1], way[2] - height * n[2]


@njit(**KERNEL)
def _wall(surfaces, at, n, feeler):
    """The wall that a feeler found on a surface with normal n. at: the Interaction that the feeler met. feeler: m, from
    its start to that Interaction.

    The wall is an upright plane, in which a surface stands or the rim of an overhang hangs. Returns the share of the
    feeler that is free, the unit normal of the plane, along the surface, and the plane's distance, m: negative where
    the normal points back to the start, 0 if there is no wall.
    """
    if _is_steep(surfaces, at.triangle, n):
        w = unit_normal(surfaces, 2 * at.triangle)
        upright, ahead = dot(w, n), dot(feeler, w)
        sine = math.sqrt(1.0 - upright * upright)
        across = ((w[0] - upright * n[0]) / sine, (w[1] - upright * n[1]) / sine, (w[2] - upright * n[2]) / sine)
        return 1.0, across, ahead / sine
    share, across = _rim(surfaces, at, n, feeler)
    return share, across, share * dot(feeler, across)


@njit(**KERNEL)
def _rim(surfaces, at, n, feeler):
    """Where a feeler came in under the low overhang, or the ramp, that it met.

    Seen along the normal n of the surface below, walks back along the feeler over the triangles of the overhang, to its
    rim or to the line where it stands on the surface. Returns the share of the feeler up to that line, and the unit
    normal of the line, along the surface; 1 and zeros where the overhang reaches back over the feeler's start.
    """
    t, height = at.triangle, dot(feeler, n)
    back = difference(scaled(n, height), feeler)  # along the surface, as long as the feeler
    aside = cross(n, back)
    length2 = max(dot(back, back), 1e-30)
    begin = 0.0  # on the way back, of the feeler's length
    for _ in range(_RIM_STEPS):
        edge, end, edge_along, edge_across = -1, begin, 0.0, 0.0
        for k in range(3):
            p = difference(corner(surfaces.corners, t, k), at.point)
            q = difference(corner(surfaces.corners, t, (k + 1) % 3), at.point)
            across, after = dot(p, aside), dot(q, aside)
            if (across < 0.0) != (after < 0.0):
                along, on = dot(p, back) / length2, dot(q, back) / length2
                met = along + (on - along) * across / (across - after)
                if met >= end:
                    edge, end, edge_along, edge_across = k, met, on - along, (after - across) / length2
        if edge < 0:
            break
        w = unit_normal(surfaces, 2 * t)
        u, v = dot(w, back), dot(w, aside)
        fall = u / dot(w, n)  # of the overhang's height, over the feeler's length
        if fall > 0.0 and height < fall * (end - begin):
            end, edge = begin + height / fall, -1
        height -= fall * (end - begin)
        if end >= 1.0:
            break
        onward = surfaces.neighbours[t, edge] if edge >= 0 else -1
        if onward < 0 or _is_steep(surfaces, onward >> 1, n):
            if edge >= 0:
                u, v = edge_across, -edge_along
            scale = 1.0 / math.sqrt(max((u * u + v * v) * length2, 1e-300))
            line = (u * back[0] + v * aside[0], u * back[1] + v * aside[1], u * back[2] + v * aside[2])
            return 1.0 - end, scaled(line, scale)
        begin, t = end, onward >> 1
    return 1.0, (0.0, 0.0, 0.0)


@njit(inline="always")
def _is_steep(surfaces, t, n):
    """Whether triangle t stands so steep on a surface with normal n that it is a wall itself."""
    return 1.0 - dot(unit_normal(surfaces, 2 * t), n) ** 2 >= _STEEP * _STEEP


@njit(inline="always")
def largest_disk(free2, estimate):
    """Squared radius (m2) of the largest disk in free space of squared radius free2 (m2), before the disk shrinks."""
    return min(estimate.reach2, max(float(free2) / estimate.shrink2, LEAST_FREE * estimate.reach2))
