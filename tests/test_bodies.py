# SPDX-License-Identifier: GPL-3.0-or-later
"""Gas in closed meshes of several bodies: where a ray is inside."""

import numpy as np
import pytest

from addon.solver import Material, Medium, Settings
from addon.solver.geometry.closed import _layers, fault_of
from addon.solver.planning.preparation import prepare
from tests.helpers.grids import atmosphere
from tests.helpers.scenes import box, look, make_scene, quad

EDGES = np.array([9.99, 10.01])


def joined(*meshes):
    """Vertices and triangles of several meshes in one."""
    vertices, triangles = zip(*meshes, strict=True)
    first = np.cumsum([0, *map(len, vertices[:-1])])
    return np.concatenate(vertices), np.concatenate(
        [each + start for each, start in zip(triangles, first, strict=True)]
    )


def storey(low, high, inset=0.0, inverted=False):
    """A box between two heights, 1 m wide, or less by an inset on each side."""
    vertices, triangles = box((1.0 - 2.0 * inset, 1.0 - 2.0 * inset, high - low))
    return vertices + (inset, inset, low), triangles[:, ::-1] if inverted else triangles


BODIES = {  # a mesh, and from where to where a line in its middle is inside
    "hollow": (joined(storey(0, 3), storey(1, 2, 0.2, inverted=True)), [(0, 1), (2, 3)]),
    "hollow, inside out": (joined(storey(0, 3, inverted=True), storey(1, 2, 0.2)), [(0, 1), (2, 3)]),
    "in one another": (joined(storey(0, 3), storey(1, 2, 0.2)), [(0, 3)]),
    "overlapping": (joined(storey(0, 2), storey(1.5, 3)), [(0, 3)]),
    "touching": (joined(storey(0, 1), storey(1, 2), storey(2, 3)), [(0, 3)]),
    "touching, one inside out": (joined(storey(0, 1), storey(1, 2, inverted=True), storey(2, 3)), [(0, 3)]),
    "apart": (joined(storey(0, 1), storey(2, 3)), [(0, 1), (2, 3)]),
    "the same twice": (joined(storey(0, 1), storey(0, 1)), [(0, 1)]),
    "flat": (storey(1, 1), []),
    "as good as flat": (storey(1, 1 + 1e-7), []),
    "a flat one and another": (joined(storey(2, 2), storey(0, 1)), [(0, 1)]),
}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("start", [-5.0, 0.4, 1.6, 2.4, 8.0])
@pytest.mark.parametrize("up", [1.0, -1.0])
def test_bodies_of_a_mesh_may_lie_anywhere(name, start, up):
    """In, beside and across one another, seen from outside and from inside; a ray's limit cuts what is behind it."""
    (vertices, triangles), inside = BODIES[name]
    air = atmosphere((Medium("gas", 1.0, vertices=vertices, triangles=triangles),), EDGES, 300.0)
    ends = [sorted(up * (height - start) for height in span) for span in inside]
    for limit in (np.inf, 3.3):
        found = air.cross(np.float32([[0.43, 0.57, start]]), np.float32([[0, 0, up]]), np.float32([limit]))
        met = [(max(begin, 0.0), min(end, limit)) for begin, end in sorted(ends)]
        met = [(begin, end) for begin, end in met if begin < end]
        assert (found.end - found.begin).sum() == pytest.approx(sum(end - begin for begin, end in met), abs=1e-5)
        if met:
            assert (found.begin.min(), found.end.max()) == pytest.approx((met[0][0], met[-1][1]), abs=1e-5)


def test_many_bodies_take_few_trees():
    """3000 cubes, many of which touch or overlap: as many layers as one place has neighbours, not one for each."""
    low = np.random.default_rng(1).integers(0, 40, (3000, 3)).astype(float)
    layer = _layers(low, low + 1.0)
    assert layer.max() < 20
    for number in range(layer.max() + 1):
        some = low[layer == number]
        gaps = np.abs(some[:, None] - some).max(axis=2)
        assert (gaps[~np.eye(len(some), dtype=bool)] > 1.0).all()


def test_a_flat_mesh_is_told(caplog):
    vertices, triangles = storey(1, 1)
    floor = quad((0, 0, -1), (5, 0, 0), (0, 5, 0))
    scene = make_scene(
        *floor, 300.0, [Material("black", 1.0)], look((0, 0, 4), (0, 0, -1), 4, 3, 0.5), EDGES,
        media=(Medium("gas", 1.0, vertices=vertices, triangles=triangles),),
    )  # fmt: skip
    prepare(scene, Settings())
    assert "Medium 'gas': its mesh is flat, so there is no gas in it" in caplog.text


def test_faults_are_told_apart():
    vertices, triangles = storey(0, 1)
    assert fault_of(vertices, triangles) == ""
    assert fault_of(vertices, triangles[1:]).startswith("open at (")
    one_turned = np.concatenate((triangles[:1, ::-1], triangles[1:]))
    assert "where the normals of faces disagree" in fault_of(vertices, one_turned)
