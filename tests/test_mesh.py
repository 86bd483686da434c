# SPDX-License-Identifier: GPL-3.0-or-later
"""How triangles are connected, against what a dictionary of all edges says: small random meshes, in which many share an
edge or all three corners, and fans, of which very many share a vertex."""

from collections import defaultdict

import numpy as np
import pytest

from addon.solver.geometry.mesh import _FEW, distinct, find_neighbours, label_sheets


def random_triangles(vertices, count, seed):
    """(count, 3) int32, of which no two corners are the same."""
    rng = np.random.default_rng(seed)
    return np.array([rng.choice(vertices, 3, replace=False) for _ in range(count)], np.int32)


def fan(count):
    """Triangles around vertex 0, each next to the one before; the first one also from behind, and again at the end."""
    rim = np.arange(1, count + 1)
    around = np.column_stack((np.zeros(count, int), rim, rim % count + 1))
    return np.concatenate((around, around[:1, ::-1], around[-1:])).astype(np.int32)


MESHES = {
    "dense": (random_triangles(6, 40, 1), np.arange(6, dtype=np.int32)),
    "sparse": (random_triangles(200, 150, 2), np.arange(200, dtype=np.int32)),
    "same points": (random_triangles(40, 60, 3), np.minimum(np.arange(40), 35).astype(np.int32)),
    "fan": (fan(3 * _FEW), np.arange(3 * _FEW + 1, dtype=np.int32)),
    "few": (fan(4), np.arange(5, dtype=np.int32)),
}


@pytest.mark.parametrize("name", MESHES)
def test_the_first_of_triangles_with_the_same_corners_counts(name):
    triangles, first = MESHES[name]
    seen, expected = set(), []
    for triangle in first[triangles]:
        expected.append(frozenset(triangle) not in seen)
        seen.add(frozenset(triangle))
    np.testing.assert_array_equal(distinct(triangles, first), expected)


@pytest.mark.parametrize("name", MESHES)
def test_neighbours_share_an_edge_of_two(name):
    triangles, first = MESHES[name]
    of_edge = defaultdict(list)
    for t, triangle in enumerate(first[triangles]):
        for i in range(3):
            of_edge[frozenset((triangle[i], triangle[(i + 1) % 3]))].append((t, i, triangle[i]))
    expected = np.full(triangles.shape, -1)
    for edge, faces in of_edge.items():
        if len(faces) == 2 and len(edge) == 2:
            (t, i, start), (other, j, begin) = faces
            expected[t, i], expected[other, j] = 2 * other + (start == begin), 2 * t + (start == begin)
    found = find_neighbours(triangles, first)
    flat = first[triangles] == np.roll(first[triangles], -1, axis=1)  # edges from a point to itself
    np.testing.assert_array_equal(np.where(flat, -1, found), expected)


def test_sheets_are_numbered_in_the_order_of_their_first_sides():
    """Of four triangles in one plane the first and the last are joined, the last turned over; the others are alone."""
    neighbours = np.full((4, 3), -1, np.int32)
    neighbours[0, 1], neighbours[3, 2] = 2 * 3 + 1, 2 * 0 + 1
    plane = np.array([(0, 0, 1, 0), (0, 0, 1, 0), (0, 0, 1, 0), (0, 0, -1, 0)], np.float32)
    np.testing.assert_array_equal(label_sheets(plane, neighbours), [(0, 1), (2, 3), (4, 5), (1, 0)])
