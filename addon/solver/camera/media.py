# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths in media: what these emit along a ray is added without noise, and where they scatter, a ray may leave
its way to the surface and go on in a new direction."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.flight import ARRIVED, NUMBERS, walk
from ..geometry.segments import FROM_DIFFUSE, Tracer, glow, traverse, ways
from ..geometry.stage import Stage
from ..photons.photon_map import neighbours_room
from ..photons.thrown import Receiver, ThrownMap, add_thrown
from ..physics.media import mean_phase, weigh_phase
from ..sampling.heuristics import CANDIDATES, SINGLE_RAY, balance
from ..sampling.rng import path_key
from ..sampling.vectors import dot, put_vector, scaled, vector
from ..system.kernels import KERNEL, njit
from .rays import ASTRAY, Bounce, Rays, empty_rays
from .shadow_rays import (
    LampRoom,
    Lighting,
    Shadows,
    add_unshadowed,
    choose_point,
    competing,
    empty_shadows,
    light_of,
    towards_from,
)
from .streams import WALK_NUMBERS, WALKING


class _Vertex(NamedTuple):
    """Where a camera path is scattered. point: (3,) floats, m. along: unit direction before. anisotropy: of the
    medium, as in its table. rays: to which the path belongs, and i, its row, with the throughput that it has before it
    is deflected. dimension: the first of its random numbers that is free."""

    point: tuple
    along: tuple
    anisotropy: np.ndarray
    rays: Rays
    i: int
    dimension: int


def cross_media(
    tracer: Tracer, stage: Stage, lighting: Lighting, bounce: Bounce, images: tuple, thrown: ThrownMap
) -> Rays | None:
    """Add to the rows what media along the rays of a bounce emit, and take from the rays what media take. Those that
    are scattered meet nothing and carry nothing any more: they go on as the rays that are returned, if media scatter.
    images: (n, layers * b) float32, of all rays and of steady ones, see meet. thrown: of the pass.
    """
    count, bands = len(bounce.hits.triangle), bounce.rays.throughput.shape[1]
    air = tracer.cross(bounce.rays.origin[:count], bounce.rays.direction[:count], ways(bounce.hits))
    if not tracer.scatters:
        _cross(air, bounce, *images)
        return None
    scattered = empty_rays(count, bands, len(bounce.rays.passed) > 0)
    shadows = empty_shadows(count if len(lighting.points.side_id) else 0, bands)
    rooms = LampRoom(np.empty(CANDIDATES), np.empty(bands)), neighbours_room(thrown.neighbours)
    found, sent = _scatter(air, stage, (lighting, thrown), bounce, images[0], (scattered, shadows), rooms)
    if sent:
        add_unshadowed(tracer, stage, Shadows(*(column[:sent] for column in shadows)), images[0])
    return Rays(*(column[:found] for column in scattered))


@njit(**KERNEL)
def _cross(air, bounce, image, steady):
    rays = bounce.rays
    for i in range(bounce.hits.triangle.size):
        out = steady[rays.pixel[i]] if rays.steady[i] else image[rays.pixel[i]]
        traverse(air, i, rays.throughput[i], out)


@njit(**KERNEL)
def _scatter(air, stage, light, bounce, image, onward, rooms):
    (lighting, thrown), (room, neighbours), (scattered, shadows) = light, rooms, onward
    rays, hits = bounce.rays, bounce.hits
    found, sent = np.int64(0), np.int64(0)
    for i in range(hits.triangle.size):
        glow(air, i, rays.throughput[i], image[rays.pixel[i]])
        first = WALKING + WALK_NUMBERS * bounce.number
        out = scattered.origin, scattered.direction, found, scattered.throughput[found]
        end = walk(air, i, (rays.origin, rays.direction), rays.throughput[i], (rays.path[i], first), out)
        if end == ARRIVED:
            continue
        hits.triangle[i] = -1
        if end >= 0:
            anisotropy, along = air.table.anisotropy[end], scaled(vector(rays.direction, i), 1.0 / air.length[i])
            scattered.pixel[found], scattered.final[found] = rays.pixel[i], rays.final[i]
            scattered.continued[found], scattered.doubts[found] = rays.continued[i], rays.doubts[i]
            scattered.density[found], scattered.kind[found] = ASTRAY, FROM_DIFFUSE
            scattered.path[found] = path_key(rays.path[i], first + NUMBERS)
            if thrown.points.straight.size:
                at, before = vector(scattered.origin, found), rays.throughput[i]
                receiver = Receiver(at, along, anisotropy, before, not rays.final[i])
                add_thrown(thrown, receiver, neighbours, image[rays.pixel[i]])
            if shadows.reach.size:
                vertex = _Vertex(vector(scattered.origin, found), along, anisotropy, rays, i, first + NUMBERS + 1)
                scattered.density[found] = -SINGLE_RAY * mean_phase(
                    anisotropy, rays.throughput[i], dot(along, vector(scattered.direction, found))
                )
                sent += _send_shadow(lighting, stage, vertex, room, shadows, sent)
            found += 1
        rays.throughput[i, :] = np.float32(0.0)
    return found, sent


@njit(inline="always")
def _send_shadow(lighting, stage, vertex, room, shadows, n):
    """Fill shadow ray n, to a point on a lamp or light, from where a path is scattered; returns 1, or 0 if none shines
    there. As from surfaces, see shadow_rays.send_shadow, with the phase function for the BRDF and its cosine; the
    scattered ray shares what it finds."""
    throughput, numbers = vertex.rays.throughput[vertex.i], (vertex.rays.path[vertex.i], vertex.dimension)
    i, total = choose_point(_brought_to_vertex, lighting, vertex, numbers, room.weight)
    if not total > 0.0:
        return 0
    way, shadows.reach[n], shadows.layer[n] = light_of(lighting, stage, i, vertex.point, total, room.value)
    put_vector(vertex.point, shadows.origin, n)
    put_vector(way, shadows.direction, n)
    shadows.pixel[n], shadows.kind[n] = vertex.rays.pixel[vertex.i], FROM_DIFFUSE
    for b in range(room.value.size):
        shadows.radiance[n, b] = throughput[b] * room.value[b]
    if vertex.anisotropy.size > 1:
        cosine = dot(vertex.along, way) / math.sqrt(dot(way, way))
        weigh_phase(vertex.anisotropy, mean_phase(vertex.anisotropy, throughput, cosine), cosine, shadows.radiance[n])
    return 1


@njit(inline="always")
def _brought_to_vertex(lighting, vertex, i):
    """Scattered light that lamp point i is expected to bring to a _Vertex, as if visible."""
    points, (way, received, distance) = lighting.points, towards_from(lighting, i, vertex.point)
    if not received > 0.0:
        return 0.0
    cosine = dot(vertex.along, way) / distance
    scattered = mean_phase(vertex.anisotropy, vertex.rays.throughput[vertex.i], cosine)
    share = balance(competing(points, i, way, distance), SINGLE_RAY * scattered) if points.density[i] > 0.0 else 1.0
    return received * points.strength[i] * scattered * share
