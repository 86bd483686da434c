# SPDX-License-Identifier: GPL-3.0-or-later
"""Photon maps of points on a square that is cut as finely as a test wants, and on other simple surfaces."""

from typing import NamedTuple

import numpy as np

from addon.solver import Material
from addon.solver.geometry.surfaces import Surfaces, build_surfaces
from addon.solver.photons.photon_map import Photons, PhotonStore, build_photon_map
from tests.helpers.scenes import look, make_scene

UNMARKED = np.empty((0, 3), np.float32), np.empty(0, bool), np.empty(0, np.uint8)  # no directions, caustics, layers


def surfaces_of(vertices, triangles):
    """Surfaces of a mesh whose bounding box is centred on the origin, so that coordinates stay as they are."""
    scene = make_scene(
        np.asarray(vertices, float), triangles, 300.0, [Material()], look((0, 0, 5), (0, 0, 0)), [8.0, 12.0]
    )
    surfaces, _, centre = build_surfaces(scene)
    assert np.all(centre == 0)
    return surfaces


def square(cells=1):
    """Square of side 1 around the origin, cells x cells quads of two triangles (0, 1 in the first cell, row by row)."""
    line = np.linspace(-0.5, 0.5, cells + 1)
    vertices = [(x, y, 0.0) for y in line for x in line]
    corner = [j * (cells + 1) + i for j in range(cells) for i in range(cells)]
    row = cells + 1
    triangles = [t for c in corner for t in ((c, c + 1, c + row + 1), (c, c + row + 1, c + row))]
    return surfaces_of(vertices, np.array(triangles, np.int32))


def triangle_under(points, cells):
    """Index (n,) of the triangle of square(cells) that holds each point."""
    scaled = np.clip((points[:, :2] + 0.5) * cells, 0, cells * (1 - 1e-12))
    i, j = scaled.astype(int).T
    upper = scaled[:, 1] - j > scaled[:, 0] - i
    return 2 * (j * cells + i) + upper


def side_under(points, cells):
    """Side_id (n,) of the front of square(cells) that each point lies on."""
    return 2 * triangle_under(np.asarray(points), cells)


class Map(NamedTuple):
    """A photon map with the surfaces it lies on."""

    photons: object
    surfaces: Surfaces


def photon_map(points, surfaces, side_ids=0, power=None, batches=1, store=None):
    """Map of photons at (n, 3) points on sides, stored in so many batches of about equal size."""
    n = len(points)
    position = np.asarray(points, np.float32).reshape(n, 3)
    side_ids = np.broadcast_to(np.asarray(side_ids, np.int32), (n,))
    power = np.ones((n, 1), np.float32) if power is None else power
    store = store or PhotonStore(power.shape[1], False, False)
    for part in np.array_split(np.arange(n), batches):
        store.append(Photons(position[part], side_ids[part], power[part], *UNMARKED))
    return Map(build_photon_map(store.photons, surfaces), surfaces)
