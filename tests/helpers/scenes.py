# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes that the tests share, built without Blender."""

import numpy as np

from addon.solver import Camera, Scene, render
from addon.solver.geometry.triangles import Corners
from addon.solver.photons.emission import Batch
from addon.solver.photons.transport import trace_photons

_BOX_FACES = {  # quads seen from inside are back faces or front faces alike: both sides emit and reflect
    "-x": (0, 1, 3, 2),
    "+x": (4, 6, 7, 5),
    "-y": (0, 4, 5, 1),
    "+y": (2, 3, 7, 6),
    "-z": (0, 2, 6, 4),
    "+z": (1, 5, 7, 3),
}


def look(position, target, width=24, height=18, tangent=0.5, **options):
    """Perspective camera at a position that looks at a target; tangent: of half the horizontal field of view."""
    position, target = np.asarray(position, float), np.asarray(target, float)
    backward = (position - target) / np.linalg.norm(position - target)
    up = np.array([0.0, 0.0, 1.0]) if abs(backward[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack((right, np.cross(backward, right), backward))
    matrix[:3, 3] = position
    vertical = tangent * height / width
    return Camera(width, height, matrix, frame=(-tangent, tangent, -vertical, vertical), **options)


def box(size=(1.0, 1.0, 1.0)):
    """Vertices (8, 3), triangles (12, 3) of a box from the origin; two triangles a face in the order of _BOX_FACES."""
    x, y, z = size
    vertices = np.array([(i * x, j * y, k * z) for i in (0, 1) for j in (0, 1) for k in (0, 1)], float)
    triangles = [t for a, b, c, d in _BOX_FACES.values() for t in ((a, b, c), (a, c, d))]
    return vertices, np.array(triangles, np.int32)


def join(*parts):
    """Vertices, triangles, temperatures and material indices of (vertices, triangles, temperature, material) parts."""
    firsts = np.cumsum([0] + [len(points) for points, *_ in parts])
    triangles = [np.asarray(corners) + first for (_, corners, *_), first in zip(parts, firsts, strict=False)]
    temperature = np.concatenate([np.full(len(corners), kelvin) for _, corners, kelvin, _ in parts])
    material = np.concatenate([np.full(len(corners), index) for _, corners, _, index in parts])
    vertices = np.concatenate([np.asarray(points, float) for points, *_ in parts])
    return vertices, np.concatenate(triangles).astype(np.int32), temperature, material


def quad(centre, half_u, half_v):
    """Vertices and triangles of a rectangle whose front looks along cross(half_u, half_v)."""
    c, u, v = (np.asarray(a, float) for a in (centre, half_u, half_v))
    return np.array([c - u - v, c + u - v, c + u + v, c - u + v]), np.array([(0, 1, 2), (0, 2, 3)])


def sphere(subdivisions, radius=1.0):
    """Icosphere: vertices (n, 3) and triangles (m, 3), m = 20 * 4^subdivisions."""
    g = (1 + 5**0.5) / 2
    vertices = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    vertices += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
    faces += [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
    faces += [(8, 6, 7), (9, 8, 1)]
    points = np.array(vertices, float)
    triangles = np.array(faces, np.int32)
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate((triangles[:, :2], triangles[:, 1:], triangles[:, ::2])), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = (len(points) + inverse.reshape(3, -1)).astype(np.int32)
        points = np.concatenate((points, points[unique].mean(axis=1)))
        ab, bc, ca = middle
        a, b, c = triangles.T
        triangles = np.concatenate([np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True), triangles


def cylinder(count, radius, length):
    """Closed cylinder of so many sides, from the origin up the z axis: vertices and triangles, those of sides first.

    The caps are fans from one corner.
    """
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), 0 * angle))
    a = np.arange(count)
    b = (a + 1) % count
    fan = np.column_stack((0 * a, a, b))[1:-1]
    sides = np.column_stack((a, b, b + count)), np.column_stack((a, b + count, a + count))
    return np.concatenate((ring, ring + (0, 0, length))), np.concatenate((*sides, fan, fan + count)).astype(np.int32)


def loose(corners):
    """Corners of triangles (m, 3, 3) that share no vertices."""
    vertices = np.ascontiguousarray(corners).reshape(-1, 3)
    return Corners(vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))


def make_scene(vertices, triangles, temperature, materials, camera, band_edges, material=None, **options):
    """Scene with one material index per triangle (default 0) and one temperature per triangle (or for all)."""
    count = len(triangles)
    material = np.zeros(count, np.int32) if material is None else np.asarray(material, np.int32)
    temperature = np.broadcast_to(np.asarray(temperature, np.float32), (count,)).copy()
    return Scene(
        vertices, triangles, material, temperature, tuple(materials), camera, np.asarray(band_edges), **options
    )


def stored_photons(model, count, key=1, on_hits=None):
    """What a pass of so many photons stores: a list of Photons, one a bounce. on_hits: see trace_photons."""
    batch = Batch(np.uint64(key), 0, count, count)
    return list(trace_photons(model.tracer, model.stage, model.emitters, model.optics, batch, on_hits=on_hits))


def pass_means(scene, settings):
    """Mean radiance of the image in each band in each pass of a render, (passes, b) float64, W m-2 sr-1.

    The pixels of a pass share its photons. Passes are independent of each other, so it is their spread that tells the
    standard error of an image's mean.
    """
    sums = [np.zeros(scene.band_count)]
    render(scene, settings, lambda film: sums.append(film.passes * film.bands().mean(axis=(1, 2), dtype=float)))
    return np.diff(sums, axis=0) * np.diff(scene.band_edges)


def mean_and_error(scene, settings):
    """Mean radiance of the image over all bands (W m-2 sr-1), and its standard error."""
    passes = pass_means(scene, settings).sum(axis=1)
    return passes.mean(), passes.std(ddof=1) / np.sqrt(len(passes))
