# SPDX-License-Identifier: GPL-3.0-or-later
"""Chains of plates, in which light can take one way alone: from the emitter over every plate in turn to the camera.

Plates lie in two parallel planes, turn by turn in the floor and in the ceiling, each one width further on. A plate sees
those before and after it, and none else: the next but one lies in its own plane, and a baffle, up to half of the
height, hides those beyond. All else is black and has the reference temperature, so nothing else brings an excess. Light
may still go back and forth between two plates; these are longer kinds of paths.
"""

import dataclasses
import itertools
import re

import numpy as np

from addon.solver import AreaLight, Material
from addon.solver.physics.constants import SIGMA
from tests.helpers.path_tracer import black_radiance
from tests.helpers.scenes import join, look, make_scene, quad

EDGES = np.array([8.0, 12.0])
COLD, HOT = 300.0, 500.0  # K
EMITTERS = ("plate", "lamp", "sky", "light")  # a plate or an opening that fills a view, a small lamp, a Blender light
LOBES = {
    "D": Material("diffuse", 0.2),
    "G": Material("rough", 0.2, specular=1.0, roughness=0.5),
    "S": Material("mirror", 0.2, specular=1.0),
    "d": Material("diffuse and rough", 0.2, specular=0.5, roughness=0.5),
    "s": Material("diffuse and mirror", 0.2, specular=0.5),
}
_ONE_OF = {"d": "DG", "s": "DS"}  # lobes of the plates that have two
_BLACK = Material("black", 1.0)
_WIDTH, _HEIGHT = 1.5, 0.7  # half of the width of the plates, and between the planes, m; plates are 1 m long
_LAMP = 0.2  # half of the edge of a lamp, m
_CLEAR = 0.002  # m, in front of which lamps and lights hang
FILM = 0.6  # transmittance of films, see with_film
_PIXELS = 8  # on each side of the picture
LENGTH = 4  # lobes of the longest kinds
BEHIND = re.compile("[GS]*D([GS]+)")  # what rays of a visible point's gather find by way of further lobes


def chain(lobes, emitter):
    """The Scene of the paths that meet these lobes (see LOBES) from the eye on, and of the emitter, one of EMITTERS.

    The lamp hangs in an opening to surroundings at the reference temperature, so that one side of it alone counts. The
    light is as large and as bright as the plate, so that the same paths bring the same radiance of both.
    """
    count = len(lobes)
    parts = [*_panels(lobes, emitter), *_baffles(count), *_ends(count)]
    side = count % 2  # 0: the emitter is part of the floor and shines up
    centre = np.array((count + 0.5, 0.0, _HEIGHT * side + _CLEAR * (1 - 2 * side)))
    if emitter == "lamp":
        parts.append((*quad(centre, (_LAMP, 0.0, 0.0), (0.0, _LAMP, 0.0)), HOT, 0))
    *arrays, material = join(*parts)
    camera = look((-0.5, 0.0, 0.98 * _HEIGHT), (0.5, 0.0, 0.0), _PIXELS, _PIXELS, tangent=0.15)
    return make_scene(
        *arrays,
        (_BLACK, *LOBES.values()),
        camera,
        EDGES,
        material,
        world_temperature=HOT if emitter == "sky" else COLD,
        lights=(_light(centre, side),) if emitter == "light" else (),
    )


def with_film(scene, count):
    """A chain of so many plates with a film across its middle, which every leg of every path crosses once. The film has
    the reference temperature and reflects nothing."""
    vertices, triangles = quad((0.5 * count, 0, 0.55 * _HEIGHT), (0.5 * count + 0.99, 0, 0), (0, 0.99 * _WIDTH, 0))
    return dataclasses.replace(
        scene,
        vertices=np.concatenate((scene.vertices, vertices)),
        triangles=np.concatenate((scene.triangles, triangles + len(scene.vertices))).astype(np.int32),
        material=np.append(scene.material, [len(scene.materials)] * 2).astype(np.int32),
        temperature=np.append(scene.temperature, [COLD] * 2).astype(np.float32),
        materials=(*scene.materials, Material("film", 1.0 - FILM, transmittance=FILM)),
    )


def kinds_of(lobes):
    """The kinds of paths (see path_tracer.py) that meet every plate of a chain once: one, but where plates have two
    lobes."""
    return ["".join(choice) for choice in itertools.product(*(_ONE_OF.get(lobe, lobe) for lobe in lobes))]


def _panels(lobes, emitter):
    """The parts of floor and ceiling: plates, the emitter behind the last, and black panels."""
    for place, plane in itertools.product(range(-1, len(lobes) + 1), (0, 1)):
        panel = quad((place + 0.5, 0.0, _HEIGHT * plane), (0.5, 0.0, 0.0), (0.0, _WIDTH, 0.0))
        if place < 0 or plane != place % 2:
            yield *panel, COLD, 0
        elif place < len(lobes):
            yield *panel, COLD, 1 + list(LOBES).index(lobes[place])
        elif emitter in ("plate", "light"):
            yield *panel, HOT if emitter == "plate" else COLD, 0


def _baffles(count):
    """The parts that hide plates from those further away than the next."""
    for place in range(count - 1):
        centre = place + 1.5, 0.0, _HEIGHT * (0.25 if place % 2 == 0 else 0.75)
        yield *quad(centre, (0.0, _WIDTH, 0.0), (0.0, 0.0, 0.25 * _HEIGHT)), COLD, 0


def _ends(count):
    """The four walls around."""
    middle, half, upwards = 0.5 * count, 0.5 * count + 1.0, (0.0, 0.0, 0.5 * _HEIGHT)
    for side in (-1.0, 1.0):
        yield *quad((middle + side * half, 0.0, 0.5 * _HEIGHT), (0.0, _WIDTH, 0.0), upwards), COLD, 0
        yield *quad((middle, side * _WIDTH, 0.5 * _HEIGHT), (half, 0.0, 0.0), upwards), COLD, 0


def _light(centre, side):
    """An area light with the excess radiance of a black plate."""
    hot, cold = black_radiance(EDGES, HOT)[0], black_radiance(EDGES, COLD)[0]
    power = SIGMA * HOT**4 * 4.0 * 0.5 * _WIDTH * (hot - cold) / hot
    v = (0.0, _WIDTH if side else -_WIDTH, 0.0)
    return AreaLight(centre, np.array((0.5, 0.0, 0.0)), np.array(v), power, temperature=HOT)


def is_compared(lobes, emitter, forced=False):
    """Whether a chain is rendered. Lights are not seen in mirrors alone, and as planned rays hardly ever find a lamp
    behind mirrors that other surfaces show: in their place the plate tells, and lamps where they are forced to throw
    caustics. The longest of these chains are rendered with the plate, whose light rays find, and with the light."""
    if emitter == "light":
        return not any(set(kind) <= {"S"} for kind in kinds_of(lobes))
    if len(lobes) == LENGTH and BEHIND.match(lobes):
        return emitter == "plate"
    hidden = "D[GS]+$" if len(lobes) == LENGTH else "^[GS]*D[GS]*S$"
    return forced or emitter != "lamp" or not re.search(hidden, lobes)
