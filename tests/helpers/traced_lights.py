# SPDX-License-Identifier: GPL-3.0-or-later
"""Light objects for the plain path tracer (path_tracer.py): spheres, rectangles and suns that paths meet by chance, so
they have an extent. No code of the solver is used but its data classes.
"""

from typing import NamedTuple

import numba
import numpy as np

from addon.solver import AreaLight, PointLight, SpotLight, SunLight
from tests.helpers.compiled import COMPILED
from tests.helpers.exact_cases import SIGMA, blackbody

SPHERE, PLATE, SUN = range(3)


class Lights(NamedTuple):
    """l lights. kind: (l,). position: (l, 3) m. axis: (l, 3), unit direction in which spots, plates and suns shine. u,
    v: (l, 3) m, half axes of plates. radius: (l,) m, of spheres. edge: (l,) cosine at which a beam ends, and blend:
    (l,) over which cosines it fades before. radiance: (l, b) W m-2 sr-1, where it does not fade."""

    kind: np.ndarray
    position: np.ndarray
    axis: np.ndarray
    u: np.ndarray
    v: np.ndarray
    radius: np.ndarray
    edge: np.ndarray
    blend: np.ndarray
    radiance: np.ndarray


def build_lights(lights, edges, centre):
    """The Lights of a scene. edges: (b + 1,) um. centre: (3,) m, subtracted. ValueError for what is not traced."""
    count = len(lights)
    table = Lights(
        np.zeros(count, np.int64), *np.zeros((4, count, 3)), *np.zeros((3, count)), np.zeros((count, len(edges) - 1))
    )
    for i, light in enumerate(lights):
        share = np.pi * blackbody(edges, light.temperature) / (SIGMA * light.temperature**4)
        table.edge[i] = -1.0
        if isinstance(light, SunLight):
            table.kind[i], table.axis[i] = SUN, np.asarray(light.direction) / np.linalg.norm(light.direction)
            table.edge[i] = cosine = np.cos(0.5 * light.angle)
            # over its disk the cosine is (1 + cosine) / 2 in the mean; the disk takes 2 pi (1 - cosine) sr
            table.radiance[i] = share * light.irradiance / (np.pi * (1.0 - cosine**2)) if cosine < 1.0 else np.nan
            continue
        table.position[i] = np.asarray(light.position) - centre
        if isinstance(light, AreaLight):
            table.kind[i], table.u[i], table.v[i] = PLATE, light.axis_u, light.axis_v
            across = np.cross(light.axis_v, light.axis_u)
            table.axis[i] = across / np.linalg.norm(across)
            table.radiance[i] = share * light.power / (4.0 * np.pi * np.linalg.norm(across))
            if light.ellipse or light.spread < np.pi:
                raise ValueError("Round area lights and spread are not traced")
            continue
        intensity, table.radius[i] = 1.0 / (4.0 * np.pi), light.radius
        if isinstance(light, SpotLight):
            table.axis[i] = np.asarray(light.direction) / np.linalg.norm(light.direction)
            outer = np.cos(0.5 * light.cone_angle)
            table.edge[i], table.blend[i] = outer, light.blend * (1.0 - outer)
            # smoothstep is 1/2 in the mean over where it rises
            intensity = 1.0 / (2.0 * np.pi * (1.0 - outer) * (1.0 - 0.5 * light.blend))
        elif not isinstance(light, PointLight):
            raise ValueError(f"A {type(light).__name__} is not traced")
        table.radiance[i] = share * light.power * intensity / (np.pi * light.radius**2) if light.radius else np.nan
    if np.isnan(table.radiance).any():
        raise ValueError("Lights without an extent are not traced")
    return table


@numba.njit(**COMPILED)
def light_met(lights, i, origin, direction):
    """Distance at which a ray of unit direction meets light i, m, infinite for suns and -1 if it does not, and what
    part of its full radiance comes from there."""
    along = np.dot(direction, lights.axis[i])
    if lights.kind[i] == SUN:
        return (np.inf, 1.0) if -along >= lights.edge[i] else (-1.0, 0.0)
    way = lights.position[i] - origin
    if lights.kind[i] == PLATE:
        if along >= 0.0:  # its back is dark
            return -1.0, 0.0
        t = np.dot(way, lights.axis[i]) / along
        at = origin + t * direction - lights.position[i]
        u, v = lights.u[i], lights.v[i]
        inside = abs(np.dot(at, u)) <= np.dot(u, u) and abs(np.dot(at, v)) <= np.dot(v, v)
        return (t, 1.0) if inside and t > 0.0 else (-1.0, 0.0)
    middle = np.dot(way, direction)
    square = lights.radius[i] ** 2 - np.dot(way, way) + middle * middle
    t = middle - np.sqrt(max(square, 0.0))
    if square <= 0.0 or t <= 0.0:
        return -1.0, 0.0
    if lights.edge[i] == -1.0:
        return t, 1.0
    if lights.blend[i] == 0.0:
        return (t, 1.0) if -along >= lights.edge[i] else (-1.0, 0.0)
    s = min(1.0, max(0.0, (-along - lights.edge[i]) / lights.blend[i]))
    return t, s * s * (3.0 - 2.0 * s)
