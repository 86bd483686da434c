# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantities of single triangles, from the Corners of all triangles."""

import math
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import cross, difference, dot, scaled, vector
from ..system.kernels import INLINED, njit

CLEAR = 2.0**-20  # distance from a plane that float32 tells for sure, over the largest coordinate or length involved


class Corners(NamedTuple):
    """The corners of m triangles. vertices: (n, 3) float32, m. triangles: (m, 3) int32, indices of vertices. Most
    vertices belong to six triangles: the coordinates of all corners would take six times the memory."""

    vertices: np.ndarray
    triangles: np.ndarray

    def of(self, triangle: np.ndarray | slice | int = slice(None)) -> np.ndarray:
        """(..., 3, 3) float32 coordinates, m, of the corners of some triangles, of all by default."""
        return self.vertices[self.triangles[triangle]]


@njit(**INLINED)
def corner(corners, t, i):
    """Corner i of triangle t, m, float64."""
    return vector(corners.vertices, corners.triangles[t, i])


@njit(**INLINED)
def normal(corners, t):
    """Unit normal of triangle t and twice its area, m2, float64."""
    a = corner(corners, t, 0)
    n = cross(difference(corner(corners, t, 1), a), difference(corner(corners, t, 2), a))
    length = math.sqrt(dot(n, n))
    return scaled(n, 1.0 / length if length > 0.0 else 0.0), length


@njit(**INLINED)
def point(corners, t, u, v):
    """Point of triangle t, m, with barycentric coordinates u, v of corners 1 and 2."""
    a, b, c, w = corner(corners, t, 0), corner(corners, t, 1), corner(corners, t, 2), 1.0 - u - v
    return w * a[0] + u * b[0] + v * c[0], w * a[1] + u * b[1] + v * c[1], w * a[2] + u * b[2] + v * c[2]


@njit(**INLINED)
def barycentric(corners, t, at):
    """Barycentric coordinates u, v of corners 1 and 2 of a point in the plane of triangle t; 0 without an area."""
    a = corner(corners, t, 0)
    e, f, way = difference(corner(corners, t, 1), a), difference(corner(corners, t, 2), a), difference(at, a)
    n = cross(e, f)
    square = dot(n, n)
    if not square > 0.0:
        return 0.0, 0.0
    return dot(cross(way, f), n) / square, dot(cross(e, way), n) / square


@njit(**INLINED)
def centroid(corners, t):
    """Centroid of triangle t, m, float64."""
    third = 1.0 / 3.0
    return point(corners, t, third, third)


@njit(**INLINED)
def area_of(corners, t):
    """Area of triangle t, m2, float64."""
    return 0.5 * normal(corners, t)[1]


@njit(cache=True, nogil=True)
def areas(corners):
    """(m,) float64 areas, m2."""
    area = np.empty(corners.triangles.shape[0])
    for t in range(area.size):
        area[t] = area_of(corners, t)
    return area


@njit(cache=True, nogil=True)
def extended(corners):
    """(m,) bool, whether triangles have an area."""
    has_area = np.empty(corners.triangles.shape[0], np.bool_)
    for t in range(has_area.size):
        has_area[t] = area_of(corners, t) > 0.0
    return has_area


@njit(cache=True, nogil=True)
def centroids(corners):
    """(m, 3) float32 centroids, m."""
    middle = np.empty((corners.triangles.shape[0], 3), np.float32)
    for t in range(middle.shape[0]):
        middle[t, 0], middle[t, 1], middle[t, 2] = centroid(corners, t)
    return middle


@njit(cache=True, nogil=True)
def scene_radius(corners):
    """Radius (m) of the smallest sphere around the origin that holds all triangles."""
    most = 0.0
    for t in range(corners.triangles.shape[0]):
        for i in range(3):
            at = corner(corners, t, i)
            most = max(most, dot(at, at))
    return math.sqrt(most)


@njit(**INLINED)
def _edge(corners, t, i):
    """Length of the edge of triangle t from corner i to the next, m, float64."""
    edge = difference(corner(corners, t, (i + 1) % 3), corner(corners, t, i))
    return math.sqrt(dot(edge, edge))


@njit(**INLINED)
def longest_edge(corners, t):
    """Length of the longest edge of triangle t, m, float64."""
    longest = 0.0
    for i in range(3):
        longest = max(longest, _edge(corners, t, i))
    return longest


@njit(inline="always")
def offset(corners, t):
    """Distance along the normal (m) that takes a ray's origin clear of triangle t in float32.

    The plane of a triangle is known to a few units of rounding of its coordinates. Embree computes with differences
    between origin and corners, so the error grows with the largest coordinate. The normal is the cross product of a
    short edge a and a long edge c. This product errs by a c units, relative to its length by a c / (2 A), A the area,
    which moves the plane at the far end by a c^2 / (2 A): as a + b >= c, at most 4 times the circumradius a b c / (4
    A). So needles with a right angle, such as the sides of a pipe, are as exact as other triangles; obtuse needles are
    not (tests/test_surfaces.py).
    """
    reach, edges = 0.0, 1.0
    for i in range(3):
        edges *= _edge(corners, t, i)
        x, y, z = corner(corners, t, i)
        reach = max(reach, abs(x), abs(y), abs(z))
    double_area = normal(corners, t)[1]
    if double_area > 0.0:
        reach = max(reach, edges / (2.0 * double_area))
    return reach * CLEAR


@njit(cache=True, nogil=True)
def planes(corners):
    """(m, 4) float32 unit normal and clearance (m, see `offset`) of each triangle."""
    plane = np.empty((corners.triangles.shape[0], 4), np.float32)
    for t in range(plane.shape[0]):
        plane[t, 0], plane[t, 1], plane[t, 2] = normal(corners, t)[0]
        plane[t, 3] = offset(corners, t)
    return plane
