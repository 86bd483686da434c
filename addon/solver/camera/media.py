# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera paths in media: what these emit along a ray is added without noise, and where they scatter, a ray may leave
its way to the surface and go on in a new direction."""

import numpy as np

from ..geometry.flight import ARRIVED, NUMBERS, walk
from ..geometry.segments import Tracer, glow, traverse, ways
from ..physics.media import phase
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, put_vector, vector
from ..system.kernels import KERNEL, njit
from .rays import ASTRAY, Bounce, Rays, Rows, empty_rays
from .shadow_rays import POINTS, Lighting, Shadows, add_unshadowed, empty_shadows, light_from
from .streams import WALK_NUMBERS, WALKING


def cross_media(tracer: Tracer, lighting: Lighting, bounce: Bounce, rows: Rows) -> Rays | None:
    """Add to the rows what media along the rays of a bounce emit, and take from the rays what media take. Those that
    are scattered meet nothing and carry nothing any more: they go on as the rays that are returned, if media scatter.
    """
    count, rays = len(bounce.hits.triangle), bounce.rays
    air = tracer.cross(rays.origin[:count], rays.direction[:count], ways(bounce.hits))
    if not tracer.scatters:
        _cross(air, bounce, rows.image)
        return None
    scattered = empty_rays(count, rays.throughput.shape[1])
    # no ray can meet a light, so shadow rays find it from where rays are scattered
    first_light = int(np.searchsorted(lighting.points.entry, len(lighting.lamps.side_id)))
    shadows = empty_shadows(count if first_light < len(lighting.points.entry) else 0, rays.throughput.shape[1])
    found, sent = _scatter(air, (lighting, first_light), bounce, rows.image, scattered, shadows)
    if sent:
        add_unshadowed(tracer, Shadows(*(column[:sent] for column in shadows)), rows.image)
    return Rays(*(column[:found] for column in scattered))


@njit(**KERNEL)
def _cross(air, bounce, image):
    rays = bounce.rays
    for i in range(bounce.hits.triangle.size):
        traverse(air, i, rays.throughput[i], image[rays.pixel[i]])


@njit(**KERNEL)
def _scatter(air, lights, bounce, image, scattered, shadows):
    rays, hits, found, sent = bounce.rays, bounce.hits, np.int64(0), np.int64(0)
    for i in range(hits.triangle.size):
        glow(air, i, rays.throughput[i], image[rays.pixel[i]])
        first = WALKING + WALK_NUMBERS * bounce.number
        numbers, out = (rays.path[i], first), (scattered.origin, scattered.direction, found)
        end = walk(air, i, (rays.origin, rays.direction), rays.throughput[i], numbers, out)
        if end == ARRIVED:
            continue
        hits.triangle[i] = -1
        if end >= 0:
            for b in range(rays.throughput.shape[1]):
                scattered.throughput[found, b] = rays.throughput[i, b]
            scattered.pixel[found], scattered.final[found] = rays.pixel[i], rays.final[i]
            scattered.continued[found], scattered.doubts[found] = rays.continued[i], rays.doubts[i]
            scattered.density[found], scattered.path[found] = ASTRAY, path_key(rays.path[i], first + NUMBERS)
            if shadows.reach.size:
                vertex = vector(scattered.origin, found), vector(rays.direction, i), air.length[i]
                anisotropy = air.table.anisotropy[end]
                sent += _send_shadow(lights, vertex, anisotropy, (rays, i, first + NUMBERS + 1), shadows, sent)
            found += 1
        rays.throughput[i, :] = np.float32(0.0)
    return found, sent


@njit(inline="always")
def _send_shadow(lights, vertex, anisotropy, ray, shadows, n):
    """Fill shadow ray n, to a point on a light, from where ray i is scattered; returns 1, or 0 if no light comes from
    there. lights: Lighting, and number of the first point on a light. vertex: point, and the ray's direction and its
    length. ray: the rays, i, and the first dimension of its random numbers that is free."""
    (lighting, first), (point, along, length), (rays, i, dimension) = lights, vertex, ray
    points, lamps = lighting.points, lighting.lamps
    count = points.entry.size - first
    p = first + int(count * uniform(rays.path[i], dimension))
    way, received, distance, reach = light_from(lighting, p, point)
    if not received > 0.0:
        return 0
    light, entry = points.entry[p] - lamps.side_id.size, points.entry[p]
    chance = lamps.cumulative[entry + 1] - lamps.cumulative[entry]
    scale = received * phase(anisotropy, dot(along, way) / (length * distance)) * count / (POINTS * chance)
    put_vector(point, shadows.origin, n)
    put_vector(way, shadows.direction, n)
    shadows.reach[n], shadows.pixel[n], shadows.layer[n] = reach, rays.pixel[i], 0
    for b in range(rays.throughput.shape[1]):
        shadows.radiance[n, b] = rays.throughput[i, b] * (lamps.lights.power[light, b] * scale)
    return 1


def join(onward: Rays, count: int, scattered: Rays) -> tuple[Rays, int]:
    """The first `count` rays of onward, and behind them those that were scattered; and how many there are."""
    rays = (np.concatenate((column[:count], more)) for column, more in zip(onward, scattered, strict=True))
    return Rays(*rays), count + len(scattered.pixel)
