# SPDX-License-Identifier: GPL-3.0-or-later
"""Chains of plates, in which light can take one way alone: from the emitter over every plate in turn to the camera.

Plates lie in two parallel planes, turn by turn in the floor and in the ceiling, each one width further on. A plate sees
those before and after it, and none else: the next but one lies in its own plane, and a baffle, up to half of the
height, hides those beyond. All else is black and has the reference temperature, so nothing else brings an excess. Light
may still go back and forth between two plates; these are longer kinds of paths.
"""

import numpy as np

from addon.solver import AreaLight, Material
from addon.solver.physics.constants import SIGMA
from tests.helpers.path_tracer import black_radiance
from tests.helpers.scenes import join, look, make_scene, quad

EDGES = np.array([8.0, 12.0])
COLD, HOT = 300.0, 500.0  # K
EMITTERS = ("plate", "lamp", "sky", "light")
LOBES = {
    "D": Material("diffuse", 0.2),
    "G": Material("rough", 0.2, specular=1.0, roughness=0.5),
    "S": Material("mirror", 0.2, specular=1.0),
    "d": Material("diffuse and rough", 0.2, specular=0.5, roughness=0.5),
    "s": Material("diffuse and mirror", 0.2, specular=0.5),
}
_BLACK = Material("black", 1.0)
_WIDTH, _HEIGHT = 1.5, 0.7  # half of the width of the plates, and between the planes, m; plates are 1 m long
_LAMP = 0.2  # half of the edge of a lamp, m
_CLEAR = 0.002  # m, in front of which lamps and lights hang


def chain(kind, emitter, pixels=8):
    """The Scene of the paths that meet these lobes (see LOBES) from the eye on, and of the emitter, one of EMITTERS."""
    parts, count = [], len(kind)
    for place in range(-1, count + 1):
        for plane in (0, 1):
            is_plate = place >= 0 and plane == place % 2
            if is_plate and place < count:
                parts.append((*_panel(place, plane), COLD, 1 + list(LOBES).index(kind[place])))
            elif not is_plate or emitter in ("lamp", "light"):
                parts.append((*_panel(place, plane), COLD, 0))
            elif emitter == "plate":
                parts.append((*_panel(place, plane), HOT, 0))
    for place in range(count - 1):
        centre = place + 1.5, 0.0, _HEIGHT * (0.25 if place % 2 == 0 else 0.75)
        parts.append((*quad(centre, (0.0, _WIDTH, 0.0), (0.0, 0.0, 0.25 * _HEIGHT)), COLD, 0))
    middle, half = 0.5 * count, 0.5 * count + 1.0
    for side in (-1.0, 1.0):
        end = quad((middle + side * half, 0.0, 0.5 * _HEIGHT), (0.0, _WIDTH, 0.0), (0.0, 0.0, 0.5 * _HEIGHT))
        flank = quad((middle, side * _WIDTH, 0.5 * _HEIGHT), (half, 0.0, 0.0), (0.0, 0.0, 0.5 * _HEIGHT))
        parts += [(*end, COLD, 0), (*flank, COLD, 0)]
    side = count % 2
    centre = count + 0.5, 0.0, _HEIGHT * side + _CLEAR * (1 - 2 * side)
    if emitter == "lamp":
        parts.append((*quad(centre, (_LAMP, 0.0, 0.0), (0.0, _LAMP, 0.0)), HOT, 0))
    lights = (_light(centre, side),) if emitter == "light" else ()
    *arrays, material = join(*parts)
    camera = look((-0.5, 0.0, 0.98 * _HEIGHT), (0.5, 0.0, 0.0), pixels, pixels, tangent=0.15)
    world = HOT if emitter == "sky" else COLD
    return make_scene(
        *arrays, (_BLACK, *LOBES.values()), camera, EDGES, material, world_temperature=world, lights=lights
    )


def _panel(place, plane):
    """A plate's or a panel's quad, in the floor (plane 0) or in the ceiling (1)."""
    return quad((place + 0.5, 0.0, _HEIGHT * plane), (0.5, 0.0, 0.0), (0.0, _WIDTH, 0.0))


def _light(centre, side):
    """An area light with the excess radiance of a black plate."""
    hot, cold = black_radiance(EDGES, HOT)[0], black_radiance(EDGES, COLD)[0]
    power = SIGMA * HOT**4 * 4.0 * 0.5 * _WIDTH * (hot - cold) / hot
    v = (0.0, _WIDTH if side else -_WIDTH, 0.0)
    return AreaLight(np.array(centre), np.array((0.5, 0.0, 0.0)), np.array(v), power, temperature=HOT)
