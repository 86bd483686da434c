# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiny scenes whose renders between them use every kernel, with every combination of types that renders have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..solver import (
    Camera,
    Grid,
    Material,
    Medium,
    PointLight,
    Scene,
    Settings,
    Sky,
    Texture,
    Textures,
)
from ..solver.image.detector import Detector, expose
from ..solver.scene import Hidden

_SETTINGS = Settings(passes=2, photons_per_pass=2_000, threads=1)
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_WALLS = 12  # triangles of the room; those of the box in it follow
_FLOOR = (8, 9)  # of them


def render_tiny_scene(name: str) -> None:
    """Render one of `TINY_SCENES`, and make all images of it."""
    # here, as Blender asks for the names of the scenes at its start
    from ..solver import coverage_image, first_hit_images, render
    from ..solver.camera.first_hits import QUANTITIES

    scene = TINY_SCENES[name]()
    film = render(scene, _SETTINGS)
    film.noise()
    first_hit_images(scene, sorted(QUANTITIES), {})
    coverage_image(scene, True)
    expose(list(film.bands()), film.band_edges, film.weights, Detector(f_number=1.0), scene.camera, 1, film.correction)


def _room() -> Scene:
    """A room with a warm box of a glossy metal in it, and a lamp: photons, shadow rays, caches and noise."""
    vertices, triangles = _box((0.0, 0.0, 0.0), (2.0, 2.0, 1.5))
    inner, more = _box((0.8, 0.9, 0.2), (1.3, 1.4, 0.7))
    vertices, triangles = np.concatenate((vertices, inner)), np.concatenate((triangles, more + len(vertices)))
    which = np.repeat([0, 1], [_WALLS, len(more)])
    return Scene(
        vertices,
        triangles.astype(np.int32),
        which.astype(np.int32),
        np.array([293.0, 340.0], np.float32)[which],
        (Material("Paint", 0.6), Material("Metal", 0.3, specular=0.5, roughness=0.3)),
        Camera(16, 12, _camera_matrix()),
        np.array([8.0, 11.0, 14.0]),
        world_temperature=293.0,
        lights=(PointLight(np.array([0.5, 1.5, 1.2]), 100.0),),
    )


def _box(low: tuple, high: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (8, 3) and triangles (12, 3) of a box between two corners, m."""
    ends = np.array((low, high))
    vertices = np.array([(ends[i, 0], ends[j, 1], ends[k, 2]) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return vertices, np.array([corners for a, b, c, d in _QUADS for corners in ((a, b, c), (a, c, d))])


def _camera_matrix() -> np.ndarray:
    """A camera in the corner of the room, which looks at the box, (4, 4)."""
    backward = np.array([-0.8, -0.8, 0.6]) / np.sqrt(1.64)
    right = np.cross((0.0, 0.0, 1.0), backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack((right, np.cross(backward, right), backward, (0.2, 0.2, 1.2)))
    return matrix


def _open() -> Scene:
    """The box on its floor, without walls, under a sky by zenith angle."""
    room, kept = _room(), [*_FLOOR, *range(_WALLS, 2 * _WALLS)]
    parts = {name: getattr(room, name)[kept] for name in ("triangles", "material", "temperature")}
    return replace(room, **parts, sky=Sky(np.array([250.0, 290.0]), np.array([0.0, 90.0])))


def _far() -> Scene:
    """The open scene in air, so far away that the box is a speck; smooth, and hidden from some rays."""
    scene = _open()
    matrix = scene.camera.matrix.copy()
    matrix[:3, 3] += 50.0 * matrix[:3, 2]
    edges = np.diff(scene.vertices[scene.triangles], axis=1)
    flat = np.cross(edges[:, 0], edges[:, 1])
    tilted = flat[:, None] / np.linalg.norm(flat, axis=1)[:, None, None] + 0.1 * np.eye(3)
    return replace(
        scene,
        camera=replace(scene.camera, matrix=matrix),
        corner_normals=tilted.astype(np.float32),
        hidden=np.where(scene.material == 1, Hidden.DIFFUSE, 0).astype(np.uint8),
        media=(Medium("Air", 0.01, 293.0),),
        world_depth=10.0,
    )


def _fresnel() -> Scene:
    """Surfaces that reflect by Fresnel's law, one of them a mirror."""
    gloss = Material("Gloss", 0.5, 1.0, 0.3, fresnel=True)
    return replace(_room(), materials=(gloss, Material("Mirror", 0.3, 1.0, 0.0, fresnel=True)))


def _sheet() -> Scene:
    """A box that lets part of the light pass."""
    room = _room()
    return replace(room, materials=(room.materials[0], Material("Film", 0.3, transmittance=0.5)))


def _textures() -> Scene:
    """An image of temperatures on a wall, and materials that are mixed."""
    uv = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32)
    index, mixed, none = np.zeros(2, np.int32), np.ones(2, np.int32), np.full(2, -1, np.int32)
    image = Texture(np.linspace(280.0, 320.0, 64, dtype=np.float32).reshape(8, 8))
    share = np.full((2, 3), 0.5, np.float32)
    return replace(_room(), textures=Textures(np.arange(2, dtype=np.int32), uv, index, mixed, share, none, (image,)))


def _groups() -> Scene:
    """What the box sends is kept apart."""
    room = _room()
    return replace(room, groups=("box",), group=np.where(room.material == 1, 0, -1).astype(np.int16))


def _gas() -> Scene:
    """Air of molecules that absorbs and scatters, and a plume in cells."""
    ones = np.ones((8, 8, 8), np.float32)
    place = np.diag([0.1, 0.1, 0.1, 1.0])
    grid = Grid.from_arrays(place, ones, 400.0 * ones, {"soot": 1e-7 * ones, "CO2": 0.01 * ones})
    air = Medium("Air", 0.01, 293.0, scattering=0.01, anisotropy=0.5, gas={"H2O": 0.01})
    return replace(_room(), media=(Medium("Plume", 0.5, 400.0, grid=grid), air), world_depth=10.0)


def _air() -> Scene:
    """Air that only absorbs."""
    return replace(_room(), media=(Medium("Air", 0.01, 293.0),), world_depth=10.0)


def _fog() -> Scene:
    """A mesh filled with what absorbs, and air that only scatters, into which a mirror throws the lamp's light."""
    vertices, triangles = _box((0.5, 0.5, 0.1), (0.7, 0.7, 0.4))
    cloud = Medium("Cloud", 0.1, 400.0, vertices=vertices, triangles=triangles.astype(np.int32))
    room, media = _room(), (cloud, Medium("Fog", 0.0, 293.0, scattering=0.01))
    mirror = Material("Mirror", 0.3, specular=1.0)
    return replace(room, materials=(room.materials[0], mirror), media=media, world_depth=10.0)


# By name, what nearly every render needs first. Each builds a Scene.
TINY_SCENES: dict[str, Callable[[], Scene]] = {
    "room": _room,
    "open": _open,
    "far": _far,
    "fresnel": _fresnel,
    "sheet": _sheet,
    "textures": _textures,
    "groups": _groups,
    "air": _air,
    "fog": _fog,
    "gas": _gas,
}
