# SPDX-License-Identifier: GPL-3.0-or-later
"""Random rooms with thin sheets, cut-outs, temperature images and mixed materials."""

import dataclasses

import numpy as np

from addon.solver import Material, Medium, Texture, Textures
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
NOTHING = Material("nothing", 0.0, transmittance=1.0)
_EXTENSIONS = "REPEAT", "EXTEND", "CLIP", "MIRROR"


def steps(low, high):
    """A curve that is constant in each of the two bands."""
    return np.array([[8.0, low], [9.9999999, low], [10.0000001, high], [12.0, high]])


def random_material(random, name, sheet=False):
    """Of random emissivities and lobes; a thin sheet transmits a random part of the rest."""
    emissivity = random.uniform(0.1, 0.8, 2)
    transmittance = random.uniform(0.2, 0.9, 2) * (1.0 - emissivity) if sheet else np.zeros(2)
    specular, roughness = random.choice([0.0, 0.0, 0.6, 1.0]), random.choice([0.0, 0.3, 0.6])
    return Material(
        name, steps(*emissivity), specular, roughness, transmittance=steps(*transmittance) if sheet else 0.0
    )


def random_painted_room(random):
    """A room in which all that varies: an image of temperatures, with some hot texels, on one wall; a mixed material on
    another, by an image or from corner to corner; two thin sheets, one of them partly holes, before a hot ball; and, of
    every other room, one wall less, so that colder surroundings are seen through a sheet there."""
    materials = [random_material(random, f"material {i}") for i in range(9)]
    materials += [random_material(random, f"sheet {i}", sheet=True) for i in range(3)] + [NOTHING]
    walls, faces = box((1.0, 0.8, 0.6))
    sides = [[walls, faces[2 * i : 2 * i + 2], float(random.uniform(285, 315)), i] for i in range(6)]
    if random.random() < 0.5:
        sides[int(random.integers(6))][3] = 11
    ball = sphere(1, 0.1)
    card = quad((0.55, 0.3, 0.3), (0.15, 0.1, 0.0), (0.0, 0.05, 0.25))
    film = quad((0.3, 0.55, 0.3), (0.2, 0.0, 0.05), (0.0, 0.0, 0.2))
    *mesh, index = join(*sides, (ball[0] + (0.35, 0.3, 0.2), ball[1], 450.0, 6), (*card, 300.0, 9), (*film, 320.0, 10))
    camera = look((0.9, 0.7, 0.5), (0.3, 0.3, 0.2), 24, 16, tangent=0.7)
    scene = make_scene(*mesh, materials, camera, EDGES, index, world_temperature=float(random.choice([300.0, 240.0])))
    return dataclasses.replace(scene, textures=_textures(random, index))


def with_fog(scene, random):
    """The room, filled with grey gas that absorbs and every other time scatters, out to its windows and beyond."""
    vertices, triangles = box((1.3, 1.2, 0.7))
    extinction, albedo = random.uniform(0.5, 2.0), random.choice([0.0, 0.6])
    fog = Medium(
        "fog",
        extinction * (1.0 - albedo),
        random.uniform(280.0, 360.0),
        scattering=extinction * albedo,
        vertices=vertices - (0.15, 0.2, 0.05),
        triangles=triangles,
    )
    return dataclasses.replace(scene, media=(fog,))


def _textures(random, index):
    """Textures of two walls, of the card (half of it holes) and of the film, which is mixed from corner to corner."""
    hot = np.where(random.random((12, 10)) < 0.06, 600.0, random.uniform(280, 330, (12, 10)))
    mask = (random.random((7, 5)) < 0.5).astype(np.float32)
    images = [
        Texture(np.float32(hot), str(random.choice(_EXTENSIONS)), bool(random.integers(2))),
        Texture(np.float32(random.random((9, 11)) ** 0.5), str(random.choice(_EXTENSIONS)), bool(random.integers(2))),
        Texture(mask, "EXTEND", True),
    ]
    of = {0: (0, 7, -1), 2: (-1, 8, 1), 9: (-1, 12, 2), 10: (-1, 8, -1)}  # material: kelvin, mixed, share
    triangle = np.flatnonzero(np.isin(index, list(of)))
    kelvin, mixed, share = (np.array([of[index[t]][i] for t in triangle], np.int32) for i in range(3))
    uv = random.uniform(-0.6, 1.6, (len(triangle), 3, 2)).astype(np.float32)
    return Textures(
        triangle.astype(np.int32), uv, kelvin, mixed, random.random((len(triangle), 3)).astype(np.float32), share,
        tuple(images),
    )  # fmt: skip
