# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies with a hot spot, and what they light."""

import numpy as np

from addon.solver import Material, Sky
from tests.helpers.scenes import join, look, make_scene, quad

EDGES = np.array([8.0, 9.0, 10.5, 12.0])


def with_spot(kelvin, degrees, rows=60, zenith=50.0, azimuth=-60.0, even=280.0):
    """An even sky but for a hot spot of a radius in degrees."""
    elevation = np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    turn = np.pi * (1.0 - (np.arange(2 * rows) + 0.5) / rows)
    (z, a), up = np.radians((zenith, azimuth)), elevation[:, None]
    cosine = np.cos(up) * np.cos(turn - a) * np.sin(z) + np.sin(up) * np.cos(z)
    return Sky(np.where(cosine > np.cos(np.radians(degrees)), kelvin, even).astype(np.float32))


def lit_corner(sky):
    """A half-open corner of grey, rough and mirror walls, whose roof shades a part of it, with a tilted rough plate."""
    *mesh, index = join(
        (*quad((0, 0, -1), (1, 0, 0), (0, 1, 0)), 290.0, 0), (*quad((-0.4, 0, 1), (0.6, 0, 0), (0, 1, 0)), 290.0, 0),
        (*quad((-1, 0, 0), (0, 1, 0), (0, 0, 1)), 290.0, 1), (*quad((0, 1, 0), (1, 0, 0), (0, 0, 1)), 290.0, 2),
        (*quad((0.3, -0.2, -0.6), (0.2, 0, 0), (0, 0.2, 0.1)), 310.0, 3),
    )  # fmt: skip
    materials = [
        Material("grey", 0.2),
        Material("rough", 0.1, 0.7, 0.4),
        Material("mirror", 0.1, 1.0),
        Material("plain", 0.5, 0.3, 0.15),
    ]
    camera = look((0.9, -0.9, 0.3), (-0.5, 0.5, -0.4), 12, 9, 0.8)
    return make_scene(*mesh, materials, camera, EDGES, index, sky=sky, world_temperature=280.0)
