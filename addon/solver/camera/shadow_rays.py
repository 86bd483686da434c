# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light by shadow rays: to points on lamps and lights, and from open sides to the surroundings."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import Interaction, emit_at, leave
from ..geometry.segments import transmit
from ..geometry.stage import fill_emission, layer_at, lobes_at, reflectance_at
from ..geometry.surfaces import clear_of
from ..geometry.triangles import CLEAR, normal
from ..photons.emission import Surroundings
from ..photons.lights import (
    ELLIPSE,
    RECTANGLE,
    SPOT,
    SUN,
    area_light_normal,
    area_light_point,
    spot_brightness,
)
from ..physics.lobes import diffuse_share, evaluate_glossy, is_glossy
from ..planning.lamps import Lamps
from ..planning.pilot import SKY_RAYS
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import difference, dot, moved, put_vector, scaled, vector
from ..sampling.warps import cone_direction, cosine_stratum, to_world, triangle_point
from ..system.kernels import KERNEL, njit

_SIDE = math.isqrt(SKY_RAYS)  # strata on each side of the unit square, of the rays to the surroundings
POINTS = 4096  # lamp points of one pass
CANDIDATES = 32  # lamp points that compete for a shadow ray


class LampPoints(NamedTuple):
    """n points on lamps and lights for one pass, in proportion to power, in the order of the entries of Lamps.

    position, normal: (n, 3) float64, m; for suns position is the unit direction towards the sun; normal is zero for
    suns and for point lights without a radius. entry: (n,) int32, of Lamps. u, v: (n,) float64, barycentric coordinates
    on a lamp's triangle.
    """

    position: np.ndarray
    normal: np.ndarray
    entry: np.ndarray
    u: np.ndarray
    v: np.ndarray


class Lighting(NamedTuple):
    """What camera paths find light by in one pass, besides photons: surroundings, lamps, and the points on lamps."""

    surroundings: Surroundings
    lamps: Lamps
    points: LampPoints


@njit(cache=True, nogil=True)
def lamp_points(lamps, surfaces, key):
    """The LampPoints of a pass, POINTS of them, none without lamps. key: of the pass's lamps."""
    count = POINTS if lamps.power > 0.0 else 0
    points = LampPoints(
        np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count, np.int32), np.zeros(count), np.zeros(count)
    )
    last = lamps.cumulative.size - 2
    entry = 0
    for i in range(count):
        path = path_key(key, i)
        pick = (i + uniform(path, 0)) / count
        while entry < last and lamps.cumulative[entry + 1] <= pick:
            entry += 1
        points.entry[i] = entry
        s, w = uniform(path, 1), uniform(path, 2)
        if entry < lamps.side_id.size:
            u, v = triangle_point(s, w)
            at = emit_at(surfaces, lamps.side_id[entry], u, v, 1.0)
            put_vector(clear_of(surfaces, at.side_id, at.point), points.position, i)
            put_vector(at.normal, points.normal, i)
            points.u[i], points.v[i] = u, v
        else:
            position, n = _light_point(lamps.lights, entry - lamps.side_id.size, s, w)
            put_vector(position, points.position, i)
            put_vector(n, points.normal, i)
    return points


@njit(inline="always")
def _light_point(lights, light, s, w):
    """Point on a light and the normal there, by two numbers in [0, 1): see LampPoints."""
    if lights.kind[light] == SUN:
        towards = to_world(cone_direction(s, w, lights.cos_cone[light]), vector(lights.axis, light))
        return scaled(towards, -1.0), (0.0, 0.0, 0.0)
    if lights.kind[light] in (RECTANGLE, ELLIPSE):
        return area_light_point(lights, light, s, w), area_light_normal(lights, light)
    n, radius = (0.0, 0.0, 0.0), lights.radius[light]  # a sphere of even radiance, or a point
    if radius > 0.0:
        n = cone_direction(s, w, -1.0)
    return moved(vector(lights.position, light), radius, n), n


@njit(inline="always")
def _received(lighting, i, at):
    """Irradiance at an Interaction from lamp point i, as if visible, m-2, for 1 W of power of the lamp."""
    lamps, points = lighting.lamps, lighting.points
    lights, light = lamps.lights, points.entry[i] - lamps.side_id.size
    position, n = vector(points.position, i), vector(points.normal, i)
    kind = lights.kind[light] if light >= 0 else RECTANGLE
    if kind == SUN:
        return max(0.0, dot(position, at.normal)) / (math.pi * lights.scene_radius * lights.scene_radius)
    way = difference(position, at.point)
    d2 = dot(way, way)
    cos_hit, cos_lamp = dot(way, at.normal), -dot(way, n)  # both cosines times the distance
    if cos_hit <= 0.0:
        return 0.0
    if kind in (RECTANGLE, ELLIPSE):
        return max(0.0, cos_lamp) * cos_hit / (math.pi * d2 * d2)
    inverse = 1.0 / math.sqrt(d2)
    intensity = 1.0 / (2.0 * math.pi * (1.0 - lights.cos_cone[light]))
    if kind == SPOT:
        intensity *= spot_brightness(lights, light, -dot(way, vector(lights.axis, light)) * inverse)
    if lights.radius[light] > 0.0:  # a sphere shows each direction the disk pi r^2 of its 4 pi r^2
        intensity *= 4.0 * max(0.0, cos_lamp) * inverse
    return intensity * cos_hit * inverse / d2


class Shadows(NamedTuple):
    """n shadow rays. origin, direction: (n, 3) float32. reach: (n,) float32, in units of the direction's length, up to
    the lamp. radiance: (n, b) float32, what the pixel gets if the lamp is visible. pixel: (n,) int32. layer: (n,)
    uint8, of the image (see layers).
    """

    origin: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    radiance: np.ndarray
    pixel: np.ndarray
    layer: np.ndarray


def empty_shadows(count: int, bands: int) -> Shadows:
    """Room for count shadow rays."""
    return Shadows(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint8),
    )


class Receiver(NamedTuple):
    """Where a camera path asks for direct light.

    at: the Interaction. throughput: (b,) float32, of the path so far. weight: a factor on the throughput. path: key of
    the random numbers. dimension: the first one that is free. pixel: row of the image.
    """

    at: Interaction
    throughput: np.ndarray
    weight: float
    path: int
    dimension: int
    pixel: int


class LampRoom(NamedTuple):
    """Room for choosing a lamp point: weight (CANDIDATES,) float64 and value (b,) float64."""

    weight: np.ndarray
    value: np.ndarray


@njit(inline="always")
def send_shadow(lighting, stage, receiver, room, shadows, count):
    """Choose a point on a lamp for a receiver and fill shadow ray `count`; returns 1, or 0 if no lamp shines there.

    Of CANDIDATES points, spread evenly over the lamps' power, one is chosen in proportion to the irradiance that it
    would cause (resampled importance sampling, Talbot et al. 2005). This is unbiased, and what is left to chance is
    mostly the visibility of the point.
    """
    lamps, points, value = lighting.lamps, lighting.points, room.value
    at = receiver.at
    i, total = _choose_point(lighting, receiver, room.weight)
    if total <= 0.0:
        return 0
    position, chosen = vector(points.position, i), points.entry[i]
    way, reach = difference(position, clear_of(stage.surfaces, at.side_id, at.point)), 1.0
    distance = math.sqrt(dot(way, way))
    probability = lamps.cumulative[chosen + 1] - lamps.cumulative[chosen]
    factor = receiver.weight * total / (CANDIDATES * probability)
    rho, lobes, light, layer = reflectance_at(stage, at), lobes_at(stage, at), chosen - lamps.side_id.size, 0
    brdf = diffuse_share(lobes) / math.pi
    if light < 0:
        # diffuse lobe alone: camera paths that follow the specular lobe meet the lamp themselves
        cosine = abs(dot(way, vector(points.normal, i))) / distance
        lamp = emit_at(stage.surfaces, lamps.side_id[chosen], points.u[i], points.v[i], cosine)
        layer = layer_at(stage, lamp)
        fill_emission(stage, lamp, value)
        factor *= 0.5 * normal(stage.surfaces.corners, lamp.triangle)[1] * math.pi
    else:
        for b in range(value.size):
            value[b] = lamps.lights.power[light, b]
        if lamps.lights.kind[light] == SUN:
            scene_radius = lamps.lights.scene_radius
            factor *= math.pi * scene_radius * scene_radius  # its power is per square metre
            way, reach, distance = position, 1e37, 1.0
        if is_glossy(lobes):
            brdf += lobes.specular * evaluate_glossy(lobes, at, scaled(way, 1.0 / math.sqrt(dot(way, way))))
    # The end of a long ray is uncertain in float32, so it is moved away from the lamp: else the lamp's own surface, or
    # one that the lamp is flush with, might hide the point.
    end = moved(way, CLEAR * distance, vector(points.normal, i))
    _start(stage.surfaces, receiver, end, reach, layer, shadows, count)
    for b in range(value.size):
        shadows.radiance[count, b] = receiver.throughput[b] * rho[b] * (value[b] * brdf * factor)
    return 1


@njit(inline="always")
def _choose_point(lighting, receiver, weight):
    """The lamp point that is chosen for a receiver, and the sum of the irradiances that all candidates would cause."""
    stride = POINTS // CANDIDATES
    offset = int(stride * uniform(receiver.path, receiver.dimension))
    total = 0.0
    for c in range(CANDIDATES):
        total += _received(lighting, offset + stride * c, receiver.at)
        weight[c] = total
    pick = total * uniform(receiver.path, receiver.dimension + 1)
    c = 0
    while c < CANDIDATES - 1 and weight[c] <= pick:
        c += 1
    return offset + stride * c, total


@njit(inline="always")
def send_sky(surroundings, stage, receiver, shadows, count):
    """Fill SKY_RAYS shadow rays from `count` on towards the surroundings, cosine-distributed and stratified."""
    at, path = receiver.at, receiver.path
    rho = reflectance_at(stage, at)
    scale = receiver.weight * diffuse_share(lobes_at(stage, at)) / SKY_RAYS
    for stratum in range(SKY_RAYS):
        dimension = receiver.dimension + 2 + 2 * stratum
        local = cosine_stratum(stratum, _SIDE, uniform(path, dimension), uniform(path, dimension + 1))
        direction = to_world(local, at.shading_normal)
        _start(stage.surfaces, receiver, direction, 1e37, surroundings.layer, shadows, count + stratum)
        for b in range(rho.size):
            radiance = surroundings.radiance[b] * scale
            shadows.radiance[count + stratum, b] = receiver.throughput[b] * rho[b] * radiance


@njit(inline="always")
def _start(surfaces, receiver, direction, reach, layer, shadows, count):
    leave(surfaces, receiver.at.side_id, receiver.at.point, direction, shadows, count)
    shadows.reach[count] = reach
    shadows.pixel[count], shadows.layer[count] = receiver.pixel, layer


@njit(**KERNEL)
def add_unshadowed(stage, hits, shadows, image):
    """Add to the image (n, layers * b) the radiance of the shadow rays that met nothing (triangle < 0)."""
    bands = shadows.radiance.shape[1]
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0:
            transmit(stage, shadows.origin[i], shadows.direction[i], hits.distance[i], shadows.radiance[i])
            row, first = image[shadows.pixel[i]], bands * shadows.layer[i]
            for b in range(bands):
                row[first + b] += shadows.radiance[i, b]
