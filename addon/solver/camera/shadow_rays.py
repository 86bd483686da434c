# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light by shadow rays: to points on lamps and lights, and from open sides to the surroundings."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import (
    LEAST_COSINE,
    Interaction,
    emit_at,
    emit_towards,
    leave,
    stand_at,
)
from ..geometry.see_through import unshadowed
from ..geometry.segments import ENDLESS, FROM_DIFFUSE, FROM_GLOSSY, TO_LIGHT, RayBatch
from ..geometry.stage import (
    emission_at,
    enter,
    fill_emission,
    layer_at,
    lobes_at,
    nothing_emitted,
)
from ..geometry.surfaces import clear_of, sheet_of
from ..geometry.triangles import CLEAR, area_of
from ..photons import cells
from ..photons.emission import Surroundings
from ..photons.irradiance_cache import FARTHEST, put_near
from ..photons.lights import (
    AFAR,
    ELLIPSE,
    RECTANGLE,
    SKY,
    SPOT,
    SUN,
    area_brightness,
    area_light_normal,
    area_light_point,
    spot_brightness,
)
from ..photons.side_table import first_found, found_from, number_in, power_of, side_at
from ..physics.fresnel import ENTERING, FACET, reflectance_of
from ..physics.lobes import (
    DIFFUSE,
    FRESNEL,
    Lobes,
    diffuse_share,
    evaluate_diffuse,
    evaluate_glossy,
    facet_cosine,
    follows_fresnel,
    glossy_density,
)
from ..physics.radiometry import absolute_sum
from ..physics.sky import choose_direction, density_towards, fill_sky, radiance_from
from ..planning.lamps import Lamps, lamp_density, share_of_sky
from ..planning.pilot import SKY_RAYS
from ..sampling.heuristics import CANDIDATES, TYPICAL_RAYS, Looking, balance, rays_to
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import difference, dot, moved, put_vector, scaled, vector
from ..sampling.warps import cone_direction, cosine_stratum, to_world
from ..system.kernels import KERNEL, njit
from .streams import SEEING

_SIDE = math.isqrt(SKY_RAYS)  # strata on each side of the unit square, of the rays to the surroundings
POINTS = 4096  # lamp points of one pass
_FROM_POINTS = 4  # shadow rays from each point of the irradiance cache
_FAR = 2.0**30  # m, distance of suns and the sky: beyond all surfaces
_DARKEST = 1e-30  # brightness of points that emit nothing, and are never chosen
_COMPARING, _SHADOWING = 15, 16  # random numbers of such a point: for lamp_distances, and the first for shadow rays


class LampPoints(NamedTuple):
    """n points on lamps and lights for one pass, in the order of Lamps.

    position, normal: (n, 3) float64, m; for suns and the sky position is _FAR times the direction towards them, from
    wherever it is seen; normal is zero for suns and for point lights without a radius. side_id: (n,) int32, the side,
    or -1 - i for light i. u, v: (n,) float64, barycentric coordinates on a lamp's triangle. density: (n,) float64, m-2,
    lamp points that compete for a shadow ray; 0 on lights, but of the sky on each m2 of a sphere with the radius _FAR.
    brightness: (n,) float64, what the point emits over the mean of its triangle, where that varies by textures, or of
    the sky, else 1. power: (n,) float64, W, of the side or light, lowered where it is often hidden. strength: (n,)
    float64, W, this times the brightness, over the chance of the point.
    """

    position: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray
    u: np.ndarray
    v: np.ndarray
    density: np.ndarray
    brightness: np.ndarray
    power: np.ndarray
    strength: np.ndarray


class Lighting(NamedTuple):
    """What finds light in one pass, besides photons: surroundings, lamps, and the points on lamps. looking: rays that
    do, too, from each sheet. layers: of the image. hidden: (m,) uint8, see Scene; (0,) if nothing is."""

    surroundings: Surroundings
    lamps: Lamps
    points: LampPoints
    looking: Looking
    layers: int
    hidden: np.ndarray


def lamp_points(lamps, stage, surroundings, key) -> LampPoints:
    """The LampPoints of a pass, POINTS of them, none without lamps. key: of the pass's lamps."""
    count = POINTS if lamps.light_end[-1] > 0.0 else 0
    points = LampPoints(
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count, np.int32),
        np.zeros(count),
        np.zeros(count),
        np.zeros(count),
        np.ones(count),
        np.zeros(count),
        np.zeros(count),
    )
    bands = stage.radiometry.reference.size
    _fill_points(lamps, stage, surroundings, key, (nothing_emitted(bands, np.float64), np.empty(bands)), points)
    return points


@njit(**KERNEL)
def _fill_points(lamps, stage, surroundings, key, rooms, points):
    """Fill in the LampPoints. rooms: for emission, and for the sky's radiance."""
    (emitted, from_sky), surfaces, count = rooms, stage.surfaces, points.side_id.size
    of_sides, total, light = lamps.light_end[0], lamps.light_end[-1], np.int64(0)
    found = first_found(lamps.sides, 0.0)
    for i in range(count):
        path = path_key(key, i)
        number, s, w = number_in((i + uniform(path, 0)) / count, total), uniform(path, 1), uniform(path, 2)
        if number < of_sides:
            found = found_from(surfaces, lamps.sides, number, found)
            side_id = np.int32(side_at(lamps.sides, found.entry))
            u, v, dense = cells.choose_point(lamps.cells, side_id >> 1, s, w)
            at = emit_at(surfaces, side_id, u, v, 1.0)
            put_vector(clear_of(surfaces, side_id, at.point), points.position, i)
            put_vector(at.normal, points.normal, i)
            points.side_id[i], points.u[i], points.v[i] = side_id, u, v
            power = power_of(surfaces, lamps.sides, at.triangle)
            points.power[i] = power * lamps.visible[sheet_of(surfaces, side_id)]
            points.strength[i] = points.power[i] / (found.high - found.low) * total
            points.density[i] = dense * lamp_density(lamps, surfaces, side_id)
            mean = cells.mean_radiance(lamps.cells, at.triangle)
            if mean > 0.0:
                points.brightness[i] = max(absolute_sum(emission_at(stage, at, emitted)) / mean, _DARKEST)
                points.strength[i] *= points.brightness[i] / dense
            continue
        while lamps.light_end[light + 1] <= number:
            light += 1
        points.side_id[i], points.power[i] = -1 - light, lamps.light_power[light]
        points.strength[i] = points.power[i] / (lamps.light_end[light + 1] - lamps.light_end[light]) * total
        if lamps.lights.kind[light] == SKY:
            _put_sky_point(lamps, surroundings, (s, w), from_sky, points, i)
        else:
            position, n = _light_point(lamps.lights, light, s, w)
            put_vector(position, points.position, i)
            put_vector(n, points.normal, i)


@njit(inline="always")
def _put_sky_point(lamps, surroundings, numbers, from_sky, points, i):
    """Fill point i with a direction of the sky, by two numbers in [0, 1)."""
    cells = surroundings.cells
    direction = choose_direction(cells, *numbers)
    dense, radiance = density_towards(cells, direction), radiance_from(surroundings, direction, from_sky)
    put_vector(scaled(direction, _FAR), points.position, i)
    put_vector(scaled(direction, -1.0), points.normal, i)
    points.density[i] = lamps.afar * dense / (_FAR * _FAR)
    points.brightness[i] = max(absolute_sum(radiance) / cells.mean, _DARKEST)
    points.strength[i] *= points.brightness[i] / (4.0 * math.pi * dense)


@njit(inline="always")
def _light_point(lights, light, s, w):
    """Point on a light and the normal there, by two numbers in [0, 1): see LampPoints."""
    if lights.kind[light] == SUN:
        towards = to_world(cone_direction(s, w, lights.cos_cone[light]), vector(lights.axis, light))
        return scaled(towards, -_FAR), (0.0, 0.0, 0.0)
    if lights.kind[light] in (RECTANGLE, ELLIPSE):
        return area_light_point(lights, light, s, w), area_light_normal(lights, light)
    n, radius = (0.0, 0.0, 0.0), lights.radius[light]  # a sphere of even radiance, or a point
    if radius > 0.0:
        n = cone_direction(s, w, -1.0)
    return moved(vector(lights.position, light), radius, n), n


@njit(inline="always")
def _towards(lighting, i, at):
    """The way from an Interaction to lamp point i (m), and the irradiance from there, as if
    visible, m-2, for 1 W of power of the lamp."""
    lamps, points = lighting.lamps, lighting.points
    lights, light = lamps.lights, -1 - points.side_id[i]
    position, n = vector(points.position, i), vector(points.normal, i)
    kind = lights.kind[light] if light >= 0 else RECTANGLE
    if kind in AFAR:
        received = max(0.0, dot(position, at.normal)) / (math.pi * lights.scene_radius * lights.scene_radius)
        return position, received / _FAR
    way = difference(position, at.point)
    d2 = dot(way, way)
    cos_hit, cos_lamp = dot(way, at.normal), -dot(way, n)  # both cosines times the distance
    if cos_hit <= 0.0:
        return way, 0.0
    if kind in (RECTANGLE, ELLIPSE):
        received = max(0.0, cos_lamp) * cos_hit / (math.pi * d2 * d2)
        if light >= 0:
            received *= area_brightness(lights, light, cos_lamp / math.sqrt(d2))
        return way, received
    inverse = 1.0 / math.sqrt(d2)
    intensity = 1.0 / (2.0 * math.pi * (1.0 - lights.cos_cone[light]))
    if kind == SPOT:
        intensity *= spot_brightness(
            lights, light, scaled(way, -inverse), -dot(way, vector(lights.axis, light)) * inverse
        )
    if lights.radius[light] > 0.0:  # a sphere shows each direction the disk pi r^2 of its 4 pi r^2
        intensity *= 4.0 * max(0.0, cos_lamp) * inverse
    return way, intensity * cos_hit * inverse / d2


class _Facing(NamedTuple):
    """A point, and a normal that faces a lamp: what an Interaction is to _towards."""

    point: tuple
    normal: tuple


@njit(inline="always")
def towards_from(lighting, i, point):
    """_towards from a point in a medium, which receives what comes from any side: also returns the way's length."""
    position, light = vector(lighting.points.position, i), -1 - lighting.points.side_id[i]
    is_afar = light >= 0 and lighting.lamps.lights.kind[light] in AFAR
    way = position if is_afar else difference(position, point)
    distance = math.sqrt(dot(way, way))
    return way, _towards(lighting, i, _Facing(point, scaled(way, 1.0 / max(distance, 1e-30))))[1], distance


@njit(inline="always")
def competing(points, i, way, distance):
    """Lamp points that compete for a shadow ray, sr-1, along the way to lamp point i; 0 on lights."""
    lamp_cosine = max(0.0, -dot(way, vector(points.normal, i))) / distance
    return points.density[i] * distance * distance / max(lamp_cosine, LEAST_COSINE)


@njit(inline="always")
def _shared_brdfs(receiver, way, distance, aimed):
    """BRDF of the receiver's lobes between its ray and the way to a lamp, sr-1, for a reflectance of 1: diffuse, and
    specular. Each lobe counts times the share of the light from there that is left to shadow rays, see share_of_ray.
    aimed: lamp points that compete, sr-1; 0 for lights, which no ray meets."""
    at, lobes, diffuse, glossy, direction = receiver.at, receiver.lobes, 0.0, 0.0, scaled(way, 1.0 / distance)
    if receiver.looking.together > 0.0:
        cosine = max(0.0, dot(way, at.normal)) / distance
        met = rays_to(receiver.looking, distance) * cosine / math.pi if aimed > 0.0 else 0.0
        diffuse = diffuse_share(lobes) / math.pi * evaluate_diffuse(at, direction) * balance(aimed, met)
    rays, weight = receiver.in_lobe
    if rays > 0.0:
        met = rays * glossy_density(lobes, at, direction) if aimed > 0.0 else 0.0
        glossy = weight * lobes.specular * evaluate_glossy(lobes, at, direction) * balance(aimed, met)
    return diffuse, glossy


class Shadows(NamedTuple):
    """n shadow rays. origin, direction: (n, 3) float32. reach: (n,) float32, in units of the direction's length, up to
    the lamp. radiance: (n, b) float32, what the pixel gets if the lamp is visible. pixel: (n,) int32. layer: (n,)
    uint8, of the image (see layers). kind: (n,) uint8, see Tracer.seen_from.
    """

    origin: np.ndarray
    direction: np.ndarray
    reach: np.ndarray
    radiance: np.ndarray
    pixel: np.ndarray
    layer: np.ndarray
    kind: np.ndarray


def empty_shadows(count: int, bands: int) -> Shadows:
    """Room for count shadow rays."""
    return Shadows(
        np.empty((count, 3), np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.float32),
        np.empty((count, bands), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint8),
        np.empty(count, np.uint8),
    )


class Receiver(NamedTuple):
    """Where a camera path asks for direct light.

    at: the Interaction. lobes, reflectance (b,) float32: there. looking: rays of the diffuse lobe that look for light,
    too; none where it does not ask. in_lobe: number of those of the rough lobe, and a factor on what this lobe
    reflects. throughput: (b,) float32, of the path so far. weight: a factor on the throughput. path: key of the random
    numbers. dimension: the first one that is free. pixel: row of the image.
    """

    at: Interaction
    lobes: Lobes
    reflectance: np.ndarray
    looking: Looking
    in_lobe: tuple[float, float]
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

    Of CANDIDATES points one is chosen in proportion to the reflected light that it is expected to bring (resampled
    importance sampling, Talbot et al. 2005). This is unbiased, and what is left to chance is mostly the visibility of
    the point.
    """
    at, value = receiver.at, room.value
    numbers = receiver.path, receiver.dimension
    i, total = choose_point(_brought_to_surface, lighting, receiver, numbers, room.weight)
    if total <= 0.0:
        return 0
    start = clear_of(stage.surfaces, at.side_id, at.point)
    way, reach, layer = light_of(lighting, stage, i, start, receiver.weight * total, value)
    _start(stage.surfaces, receiver, way, reach, layer, shadows, count)
    share = 1.0
    if lighting.hidden.size or follows_fresnel(receiver.lobes):
        share = _share_of_diffuse(lighting, receiver, i)
    if lighting.hidden.size:
        lamp = lighting.points.side_id[i]
        if lamp < 0 and lighting.lamps.lights.kind[-1 - lamp] != SKY:
            shadows.kind[count] = TO_LIGHT
        else:  # what lies on the way may hang on the lobe: one of them asks, as often as it brings its share
            share = 1.0 if uniform(receiver.path, SEEING + receiver.dimension) < share else 0.0
            shadows.kind[count] = FROM_DIFFUSE if share > 0.0 else FROM_GLOSSY
            if lamp >= 0 and lighting.hidden[lamp >> 1] >> shadows.kind[count] & 1:
                return 0
    if follows_fresnel(receiver.lobes):
        _weigh_lobes(lighting, stage, receiver, i, share, value)
        for b in range(value.size):
            shadows.radiance[count, b] = receiver.throughput[b] * value[b]
        return 1
    for b in range(value.size):
        shadows.radiance[count, b] = receiver.throughput[b] * receiver.reflectance[b] * value[b]
    return 1


@njit(inline="always")
def _share_of_diffuse(lighting, receiver, i):
    """Share of the diffuse lobe in what is reflected from lamp point i, for lobes of one reflectance."""
    way, _ = _towards(lighting, i, receiver.at)
    distance = math.sqrt(dot(way, way))
    diffuse, glossy = _shared_brdfs(receiver, way, distance, competing(lighting.points, i, way, distance))
    total = diffuse + glossy
    return diffuse / total if total > 0.0 else 0.0  # rounding may choose a point that brings nothing


@njit(inline="always")
def _weigh_lobes(lighting, stage, receiver, i, share, value):
    """Multiply value (b,), from lamp point i, by the reflectances of the lobes, of which the diffuse one has this share
    in what they bring. Fresnel's law must hold: the lamp point was chosen as for lobes of one reflectance."""
    at, table = receiver.at, stage.radiometry.fresnel
    way, _ = _towards(lighting, i, at)
    direction, row = scaled(way, 1.0 / math.sqrt(dot(way, way))), table.row[at.material]
    cosine, facet = dot(direction, at.shading_normal), facet_cosine(receiver.lobes, at, direction)
    for b in range(value.size):
        below = receiver.reflectance[b] * reflectance_of(table, row, ENTERING, cosine, b)
        value[b] *= share * below + (1.0 - share) * reflectance_of(table, row, FACET, facet, b)


@njit(inline="always")
def light_of(lighting, stage, i, start, total, value):
    """Of a shadow ray from a start to lamp point i, chosen among candidates that together bring `total` with 1 W each:
    its direction, how far it goes in units of that, and the layer of the image. Fills value (b,) with the light that it
    brings."""
    lamps, points = lighting.lamps, lighting.points
    position, chosen = vector(points.position, i), points.side_id[i]
    way, reach = difference(position, start), 1.0
    distance = math.sqrt(dot(way, way))
    factor, light, layer = total / (CANDIDATES * points.power[i]), -1 - chosen, 0
    if light < 0:
        cosine = abs(dot(way, vector(points.normal, i))) / distance
        back = scaled(way, -1.0 / distance)
        lamp = emit_towards(stage.surfaces, chosen, points.u[i], points.v[i], back, cosine)
        layer = layer_at(stage, lamp)
        fill_emission(stage, lamp, value)
        factor *= area_of(stage.surfaces.corners, lamp.triangle) * math.pi / points.brightness[i]
    else:
        kind, scene_radius = lamps.lights.kind[light], lamps.lights.scene_radius
        if kind in AFAR:
            factor *= math.pi * scene_radius * scene_radius  # its power is per square metre
            way, reach, distance = scaled(position, 1.0 / _FAR), ENDLESS, 1.0
        if kind == SKY:
            factor *= 4.0 * math.pi / points.brightness[i]
            layer = lighting.surroundings.layer
            fill_sky(lighting.surroundings.sky, way, value)
        else:
            for b in range(value.size):
                value[b] = lamps.lights.power[light, b]
    for b in range(value.size):
        value[b] *= factor
    # The end of a long ray is uncertain in float32, so it is moved away from the lamp: else the lamp's own surface, or
    # one that the lamp is flush with, might hide the point.
    return moved(way, CLEAR * distance, vector(points.normal, i)), reach, layer


@njit(inline="always")
def choose_point(brought, lighting, receiver, numbers, weight):
    """The lamp point that is chosen for a receiver, and the sum of the light that all candidates are expected to
    bring.

    brought: a kernel of lighting, receiver and number of a point, the light that this is expected to bring. numbers:
    key and first dimension of two random numbers. weight: room for (CANDIDATES,).
    """
    (path, dimension), stride, total, c = numbers, POINTS // CANDIDATES, 0.0, 0
    offset = int(stride * uniform(path, dimension))
    for candidate in range(CANDIDATES):
        total += brought(lighting, receiver, offset + stride * candidate)
        weight[candidate] = total
    chosen = total * uniform(path, dimension + 1)
    while c < CANDIDATES - 1 and weight[c] <= chosen:
        c += 1
    return offset + stride * c, total


@njit(inline="always")
def _brought_to_surface(lighting, receiver, i):
    """Reflected light that lamp point i is expected to bring to a Receiver, as if visible."""
    way, received = _towards(lighting, i, receiver.at)
    if not received > 0.0:
        return 0.0
    distance = math.sqrt(dot(way, way))
    aimed = competing(lighting.points, i, way, distance)
    diffuse, glossy = _shared_brdfs(receiver, way, distance, aimed)
    return received * lighting.points.strength[i] * (diffuse + glossy)


@njit(inline="always")
def send_sky(lighting, stage, receiver, room, shadows, count):
    """Fill SKY_RAYS shadow rays from `count` on towards the surroundings, cosine-distributed and stratified."""
    at, path, rho, surroundings = receiver.at, receiver.path, receiver.reflectance, lighting.surroundings
    # where the receiver asks for no lamps, cached points have, see direct_irradiance
    rays = receiver.looking.together if receiver.looking.together > 0.0 else TYPICAL_RAYS
    scale = receiver.weight * diffuse_share(receiver.lobes) / SKY_RAYS
    for stratum in range(SKY_RAYS):
        dimension = receiver.dimension + 2 + 2 * stratum
        local = cosine_stratum(stratum, _SIDE, uniform(path, dimension), uniform(path, dimension + 1))
        direction = to_world(local, at.normal)
        _start(stage.surfaces, receiver, direction, ENDLESS, surroundings.layer, shadows, count + stratum)
        received, around = scale * evaluate_diffuse(at, direction), radiance_from(surroundings, direction, room.value)
        received *= share_of_sky(rays * local[2] / math.pi, lighting.lamps, surroundings, direction)
        for b in range(rho.size):
            radiance = around[b] * received
            shadows.radiance[count + stratum, b] = receiver.throughput[b] * rho[b] * radiance
        enter(stage, at, local[2], shadows.radiance[count + stratum])


@njit(inline="always")
def _start(surfaces, receiver, direction, reach, layer, shadows, count):
    leave(surfaces, receiver.at.side_id, receiver.at.point, direction, shadows, count)
    shadows.reach[count], shadows.kind[count] = reach, FROM_DIFFUSE
    shadows.pixel[count], shadows.layer[count] = receiver.pixel, layer


def add_unshadowed(tracer, stage, shadows, image) -> None:
    """Add to the image (n, layers * b) the radiance of the shadow rays that meet nothing, as far as it gets through
    thin sheets and media."""
    rays = RayBatch(shadows.origin, shadows.direction)
    _add(unshadowed(tracer, stage, rays, shadows.reach, shadows.radiance, shadows.kind), shadows, image)


@njit(**KERNEL)
def _add(arrives, shadows, image):
    bands = shadows.radiance.shape[1]
    for i in range(arrives.size):
        if arrives[i]:
            row, first = image[shadows.pixel[i]], bands * shadows.layer[i]
            for b in range(bands):
                row[first + b] += shadows.radiance[i, b]


def lamp_distances(surfaces, lighting, points, key, first) -> np.ndarray:
    """(n, 4) float64, how near lamps are to points, see Vicinity: inverse squared distances are weighted with the light
    that lamps would bring if nothing hid them. points, key, first: see direct_irradiance."""
    near = np.tile((FARTHEST, 0.0, 0.0, 0.0), (len(points[1]), 1))
    if len(lighting.points.side_id):
        _lamp_distances(surfaces, lighting, points, (key, first), near)
    return near


@njit(**KERNEL)
def _lamp_distances(surfaces, lighting, points, keys, near):
    (point, side_id), (key, first), lamps = points, keys, lighting.points
    stride = POINTS // CANDIDATES
    for i in range(side_id.size):
        at, offset = stand_at(surfaces, side_id[i], vector(point, i)), uniform(path_key(key, first + i), _COMPARING)
        total, mean2, change = 0.0, 0.0, (0.0, 0.0, 0.0)
        for c in range(CANDIDATES):
            lamp = int(stride * offset) + stride * c
            way, received = _towards(lighting, lamp, at)
            brought, inverse2 = received * lamps.strength[lamp], 1.0 / max(dot(way, way), 1e-30)
            total += brought
            mean2 += brought * inverse2
            change = moved(change, brought * inverse2 * inverse2, way)
        if total > 0.0:
            put_near(mean2 / total, scaled(change, 1.0 / total), near, i)


def direct_irradiance(stage, tracer, lighting, points, key, first) -> np.ndarray:
    """The part of the direct light at points that is left to shadow rays and not to photons, see stored_share.

    points: (n, 3) float32, m, and side_ids (n,) int32. key: of the random numbers of the points, which are number
    first, first + 1, ... Returns the irradiance (n, layers * b) float32, W m-2.
    """
    bands, layers = stage.radiometry.reference.size, lighting.layers
    value = np.zeros((len(points[1]), layers * bands), np.float32)
    shadows = empty_shadows(_FROM_POINTS * len(value) if len(lighting.points.side_id) else 0, bands)
    if len(shadows.reach):
        room = LampRoom(np.empty(CANDIDATES), np.empty(bands))
        sent = _send_from_points(stage, lighting, points, (key, first), np.ones(bands, np.float32), shadows, room)
        shadows = Shadows(*(column[:sent] for column in shadows))
        add_unshadowed(tracer, stage, shadows, value)
    return value


@njit(**KERNEL)
def _send_from_points(stage, lighting, points, keys, white, shadows, room):
    (point, side_id), (key, first) = points, keys
    sent = np.int64(0)
    for i in range(side_id.size):
        at, path = stand_at(stage.surfaces, side_id[i], vector(point, i)), path_key(key, first + i)
        lobes = Lobes(DIFFUSE | (lobes_at(stage, at).flags & FRESNEL), 0.0, 0.0)
        for ray in range(_FROM_POINTS):
            receiver = Receiver(
                at,
                lobes,
                white,
                Looking(0.0, TYPICAL_RAYS, TYPICAL_RAYS),
                (0.0, 1.0),
                white,
                math.pi / _FROM_POINTS,
                path,
                _SHADOWING + 2 * ray,
                i,
            )
            sent += send_shadow(lighting, stage, receiver, room, shadows, sent)
    return sent
