# SPDX-License-Identifier: GPL-3.0-or-later
"""A render that uses all of the solver, to see what becomes of it when things go wrong."""

import numpy as np

from addon.solver import Grid, Material, Medium, PointLight, Settings, Texture, Textures
from tests.helpers.scenes import box, join, look, make_scene, sphere

QUICK = Settings(passes=4, photons_per_pass=20_000, threads=2)  # two pieces of photons


def wallpaper(size):
    """Textures of two triangles of the room, with an image of temperatures of size x size texels."""
    values = np.linspace(280.0, 320.0, size * size, dtype=np.float32).reshape(size, size)
    uv = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32)
    image, none = np.zeros(2, np.int32), np.full(2, -1, np.int32)
    share = np.zeros((2, 3), np.float32)
    return Textures(np.arange(2, dtype=np.int32), uv, image, none, share, none, (Texture(values),))


def plume(cells, **fractions):
    """Hot gas in a grid of cells^3 cells in the room, with even fractions of species."""
    shape = cells, cells, cells
    ones, transform = np.ones(shape, np.float32), np.diag([1.0 / cells, 1.0 / cells, 1.0 / cells, 1.0])
    several = {name: value * ones for name, value in fractions.items()}
    return Medium("Plume", 0.5, 400.0, grid=Grid.from_arrays(transform, ones, 400.0 * ones, several))


def room(radiator=340.0, width=24, bands=3, emissivity=0.6, subdivisions=1, **options):
    """A box with a warm ball and a lamp in it: photons, shadow rays, caches and noise."""
    ball, triangles = sphere(subdivisions, 0.3)
    parts = (*box((2.0, 2.0, 1.5)), 293.0, 0), (ball + (1.0, 1.2, 0.5), triangles, radiator, 1)
    vertices, triangles, temperature, material = join(*parts)
    materials = [Material("Paint", emissivity), Material("Metal", 0.3, specular=0.5, roughness=0.3)]
    camera = look((0.2, 0.3, 1.2), (1.0, 1.0, 0.5), width, width * 3 // 4, 0.8)
    edges, lamp = np.linspace(8.0, 14.0, bands + 1), PointLight(np.array([0.5, 1.5, 1.2]), 100.0)
    options = {"world_temperature": 293.0, "lights": (lamp,)} | options
    return make_scene(vertices, triangles, temperature, materials, camera, edges, material, **options)
