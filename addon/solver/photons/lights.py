# SPDX-License-Identifier: GPL-3.0-or-later
"""Light objects for the kernels: points, spots, areas and suns. Lights shine, and are never seen themselves."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.triangles import CLEAR
from ..physics.constants import SIGMA
from ..physics.spectrum import band_radiance
from ..sampling.vectors import cross, dot, moved, scaled, vector
from ..sampling.warps import basis, cone_direction, cosine_direction, to_world, turn
from ..scene import AreaLight, Light, PointLight, SpotLight, SunLight
from ..system.kernels import INLINED, njit

POINT, SPOT, RECTANGLE, ELLIPSE, SUN, SKY = range(6)

_RIM_POINTS = 32  # at which the fading rim of a square spot is summed
AFAR = (SUN, SKY)  # kinds that light all points from the same directions


class LightTable(NamedTuple):
    """The lights of a scene, l of them.

    kind: (l,) int32, POINT to SUN; the sky is one more, SKY, where shadow rays are sent to it. position: (l, 3)
    float64, m, in solver coordinates. axis: (l, 3) float64, unit direction in which spots and suns shine; without
    meaning for points. half_u, half_v: (l, 3) float64, half axes of areas, m; of square spots unit directions across
    two sides, else 0. cos_cone: (l,) float64, cosine of half the angle of a spot's cone (of a square spot of the cone
    that holds its beam), of a sun's disk or of an area's spread; -1 for points. edge: (l,) float64, cosine at which a
    spot ends, of a square one in the middle of a side. radius: (l,) float64, m, of points and spots. blend: (l,)
    float64, width in cosine over which a spot fades at its rim. fullness: (l,) float64, power in the cone of a spot or
    an area over the power without fading. power: (l, b) float64, W in each band; for suns W m-2 across each direction
    from which they shine, for the sky the integral over all of them. scene_radius: m, of a sphere around the origin
    that holds the scene.
    """

    kind: np.ndarray
    position: np.ndarray
    axis: np.ndarray
    half_u: np.ndarray
    half_v: np.ndarray
    cos_cone: np.ndarray
    edge: np.ndarray
    radius: np.ndarray
    blend: np.ndarray
    fullness: np.ndarray
    power: np.ndarray
    scene_radius: float


def build_light_table(lights: tuple[Light, ...], edges: np.ndarray, centre: np.ndarray, radius: float) -> LightTable:
    """The table of some lights. edges: (b + 1,) um. centre: (3,) m, subtracted. radius: see LightTable.scene_radius."""
    count = len(lights)
    table = LightTable(
        np.zeros(count, np.int32), *np.zeros((4, count, 3)), *np.zeros((5, count)), np.zeros((count, len(edges) - 1)),
        radius,
    )  # fmt: skip
    for i, light in enumerate(lights):
        table.power[i] = _flux(light) * light_spectrum(light, edges)
        _put_shape(light, centre, table, i)
    return table


def with_sky(lights: LightTable, flux: np.ndarray) -> LightTable:
    """The table with a sky behind the lights. flux: (b,) W m-2, integral over all directions of its radiance, as far as
    shadow rays look for it."""
    *columns, radius = lights
    sky = [np.zeros((1, *column.shape[1:]), column.dtype) for column in columns]
    table = LightTable(*map(np.concatenate, zip(columns, sky, strict=True)), radius)
    table.kind[-1], table.power[-1] = SKY, flux
    return table


def no_lights(lights: LightTable) -> LightTable:
    """The table without its lights."""
    return LightTable(*(column[:0] for column in lights[:-1]), lights.scene_radius)


def light_spectrum(light: Light, edges: np.ndarray) -> np.ndarray:
    """(b,) share of a light's total flux in each band: that of a blackbody at its temperature."""
    total = SIGMA * light.temperature**4
    if total == 0.0:  # at 0 K, and so near to it that float64 rounds T^4 to 0
        return np.zeros(len(edges) - 1)
    return math.pi * band_radiance(edges, light.temperature) / total


def light_totals(lights: LightTable) -> np.ndarray:
    """(l,) float64 power of the lights over all bands, W; of those afar through the disk that covers the scene."""
    return lights.power.sum(axis=1) * np.where(np.isin(lights.kind, AFAR), math.pi * lights.scene_radius**2, 1.0)


def _flux(light: Light) -> float:
    """Power, W; of a sun W m-2 across each direction from which it shines."""
    if isinstance(light, SunLight):
        mean_cosine = 0.5 * (1.0 + math.cos(0.5 * light.angle))
        return light.irradiance / mean_cosine
    return light.power


def _put_shape(light: Light, centre: np.ndarray, table: LightTable, i: int) -> None:
    """Fill row i of a table with the shape of a light."""
    if isinstance(light, SunLight):
        table.kind[i], table.axis[i] = SUN, np.asarray(light.direction) / np.linalg.norm(light.direction)
        table.cos_cone[i] = math.cos(0.5 * light.angle)
        return
    position, facing, extent = np.asarray(light.position, np.float64) - centre, np.zeros(3), 0.0
    if isinstance(light, AreaLight):
        table.kind[i] = ELLIPSE if light.ellipse else RECTANGLE
        table.half_u[i], table.half_v[i] = light.axis_u, light.axis_v
        if light.spread < math.pi:
            half = 0.5 * light.spread
            # the integral of (1 - tan x / tan a) cos x sin x from 0 to a, over that of cos x sin x to pi / 2
            table.cos_cone[i], table.fullness[i] = math.cos(half), 1.0 - half / math.tan(half)
        facing = np.cross(table.half_v[i], table.half_u[i])
        extent = max(np.abs(table.half_u[i]).max(), np.abs(table.half_v[i]).max())
        facing /= np.linalg.norm(facing)
    elif isinstance(light, SpotLight):
        table.kind[i], table.axis[i] = SPOT, np.asarray(light.direction) / np.linalg.norm(light.direction)
        outer = math.cos(0.5 * light.cone_angle)
        table.edge[i], table.radius[i], table.blend[i] = outer, light.radius, (1.0 - outer) * light.blend
        # the mean of smoothstep over its own width is 1/2, so the cone holds this share of the power of a full cone
        table.cos_cone[i], table.fullness[i] = outer, 1.0 - 0.5 * light.blend
        if light.square is not None:
            _put_square(np.asarray(light.square, np.float64), table, i)
        facing = table.axis[i]
    elif isinstance(light, PointLight):
        table.kind[i], table.cos_cone[i], table.radius[i] = POINT, -1.0, light.radius
        table.axis[i] = (0.0, 0.0, 1.0)
    # A light set flush into a ceiling must shine into the room: move it clear of the plane, as is done with the origins
    # of rays
    table.position[i] = position + CLEAR * (np.abs(position).max() + extent) * facing


def _put_square(across: np.ndarray, table: LightTable, i: int) -> None:
    """Make a round spot of row i a square one. across: (3,) direction of one of its sides.

    Where the farther sides are under a cosine c to the axis, seen from their middles, the square's solid angle is
    4 asin(1 - c^2); that and the fading rim give the power (by Gauss and Legendre's rule, as a function of c).
    """
    side = np.cross(table.axis[i], across)
    table.half_u[i] = side / np.linalg.norm(side)
    table.half_v[i] = np.cross(table.half_u[i], table.axis[i])
    edge, blend = table.edge[i], table.blend[i]
    # a corner is as far as twice the square of the tangent
    table.cos_cone[i] = edge / math.sqrt(2.0 - edge * edge)
    t, weight = np.polynomial.legendre.leggauss(_RIM_POINTS)
    t, weight = 0.5 * (t + 1.0), 0.5 * weight
    inside = 4.0 * np.arcsin(1.0 - (edge + blend * t) ** 2)  # sr, where the brightness is above that at t
    held = weight @ (inside * 6.0 * t * (1.0 - t))
    table.fullness[i] = held / (2.0 * math.pi * (1.0 - table.cos_cone[i]))


@njit(**INLINED)
def area_light_point(lights, i, u, v):
    """Point of an area light, even over its area."""
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    if lights.kind[i] == ELLIPSE:
        r = math.sqrt(u)
        a, b = turn(v)
        a, b = r * a, r * b
    return moved(moved(vector(lights.position, i), a, vector(lights.half_u, i)), b, vector(lights.half_v, i))


@njit(**INLINED)
def area_light_normal(lights, i):
    """Unit normal of an area light on the side that shines: along cross(half_v, half_u)."""
    n = cross(vector(lights.half_v, i), vector(lights.half_u, i))
    return scaled(n, 1.0 / math.sqrt(dot(n, n)))


@njit(**INLINED)
def area_brightness(lights, i, cosine):
    """Radiance of area light i at the cosine to its normal, over that of one of the same power after Lambert's law."""
    cos_cone = lights.cos_cone[i]
    if cos_cone <= 0.0:
        return 1.0
    if cosine <= cos_cone:
        return 0.0
    tangents = math.sqrt(max(0.0, 1.0 - cosine * cosine) / (1.0 - cos_cone * cos_cone)) * cos_cone / cosine
    return (1.0 - tangents) / lights.fullness[i]


@njit(**INLINED)
def spot_brightness(lights, i, direction, cosine):
    """Intensity of spot light i in a unit direction, with this cosine to its axis, over the intensity of an even cone
    of the same power: of its own cone, or of the one that holds its square beam."""
    if lights.edge[i] > lights.cos_cone[i]:  # a square: by the angle in the plane across the nearest side
        across = max(abs(dot(direction, vector(lights.half_u, i))), abs(dot(direction, vector(lights.half_v, i))))
        cosine /= math.sqrt(cosine * cosine + across * across)
    if cosine < lights.edge[i]:
        return 0.0
    if lights.blend[i] <= 0.0:
        return 1.0 / lights.fullness[i]
    t = min(1.0, (cosine - lights.edge[i]) / lights.blend[i])
    return t * t * (3.0 - 2.0 * t) / lights.fullness[i]


@njit(**INLINED)
def light_ray(lights, i, numbers):
    """A ray that light i sends out, by four numbers in [0, 1): origin, unit direction, and a factor on the light's
    power (whose mean over all rays is 1; of suns the disk's area, m2)."""
    s0, s1, s2, s3 = numbers
    kind, brightness = lights.kind[i], 1.0
    if kind in (RECTANGLE, ELLIPSE):
        local, cos_cone = cosine_direction(s2, s3), lights.cos_cone[i]
        if cos_cone > 0.0:  # as many by the cosine, but of the cone alone
            share = 1.0 - cos_cone * cos_cone
            local = cosine_direction(share * s2, s3)
            brightness = share * area_brightness(lights, i, local[2])
        return area_light_point(lights, i, s0, s1), to_world(local, area_light_normal(lights, i)), brightness
    local = cone_direction(s0, s1, lights.cos_cone[i])
    direction, origin = to_world(local, vector(lights.axis, i)), vector(lights.position, i)
    if kind == SPOT:
        brightness = spot_brightness(lights, i, direction, local[2])
    # A sphere (or the sun) seen from a direction is a disk: the ray starts anywhere on the disk
    radius = lights.scene_radius if kind == SUN else lights.radius[i]
    if radius > 0.0:
        r, (p, q), (t, b) = radius * math.sqrt(s2), turn(s3), basis(direction)
        origin = moved(moved(origin, r * p, t), r * q, b)
    if kind == SUN:
        origin = moved(origin, -1.01 * radius, direction)
        brightness = math.pi * radius * radius
    return origin, direction, brightness
