# SPDX-License-Identifier: GPL-3.0-or-later
"""The photon map: the photons it finds are the nearest, and their density is estimated without bias."""

import numpy as np
import pytest
from numba import njit
from scipy.spatial import cKDTree

from addon.solver.geometry.area import NO_WALL
from addon.solver.photons.photon_map import (
    Disk,
    Photons,
    PhotonStore,
    Query,
    build_photon_map,
    gather,
    irradiance,
    neighbours_room,
    search,
)
from tests.helpers.marks import long
from tests.helpers.photon_maps import Map, photon_map, side_under, square, surfaces_of, triangle_under
from tests.helpers.scenes import box

UP = (np.float32(0.0), np.float32(0.0), np.float32(1.0))
DISK = Disk(neighbours=50, reach2=1.0, shrink2=1.0, wall=NO_WALL, only_caustic=False)


@njit
def search_all(photon_map, k, points, normal, bound):
    """Squared distance within which the k nearest of every point lie, and how many photons are listed within it."""
    room = neighbours_room(k)
    distance2, within = np.empty(len(points), np.float32), np.empty(len(points), np.int64)
    for i in range(len(points)):
        query = Query((points[i, 0], points[i, 1], points[i, 2]), normal, np.float32(0.0))
        count, r2 = search(photon_map, query, k, bound, room)
        distance2[i] = r2
        within[i] = 0
        for j in range(count):
            within[i] += room.distance2[j] <= r2
    return distance2, within


@njit
def gather_all(photon_map, surfaces, side_ids, points, walls, disk, guess):
    """Number of photons and area of a gather at every point, each before its wall and starting from the same guess."""
    room = neighbours_room(disk.neighbours)
    kept, area = np.empty(len(points), np.int64), np.empty(len(points))
    for i in range(len(points)):
        x, y, z = points[i]
        wall = walls[i, 0], walls[i, 1], walls[i, 2]
        cut = Disk(disk.neighbours, disk.reach2, disk.shrink2, wall, disk.only_caustic)
        kept[i], area[i], _ = gather(photon_map, surfaces, side_ids[i], (x, y, z), cut, guess, room)
    return kept, area


def gathers(built, side_ids, points, disk=DISK, guess=1.0, walls=NO_WALL):
    """Number of photons and area of gathers at (n, 3) points on sides. walls: one for each, or for all."""
    points = np.atleast_2d(np.asarray(points, np.float32))
    side_ids = np.broadcast_to(np.asarray(side_ids, np.int32), (len(points),))
    walls = np.ascontiguousarray(np.broadcast_to(np.asarray(walls, np.float32), (len(points), 3)))
    return gather_all(built.photons, built.surfaces, side_ids, points, walls, disk, guess)


def gather_one(built, side_id, point, disk=DISK, guess=1.0):
    """Numbers (sorted) of the photons of one gather in the map's order, the area, and the next guess."""
    room = neighbours_room(disk.neighbours)
    x, y, z = (float(c) for c in point)
    kept, area, following = gather(built.photons, built.surfaces, side_id, (x, y, z), disk, guess, room)
    return np.sort(room.index[:kept]), area, following


# Neighbours


def clusters(rng, count):
    """Clusters 10,000 times denser than the space between them."""
    centre = rng.uniform(-0.5, 0.5, (20, 3))
    tight = centre[rng.integers(20, size=count)] + rng.normal(scale=1e-3, size=(count, 3))
    return np.where(rng.random((count, 1)) < 0.8, tight, rng.uniform(-0.5, 0.5, (count, 3)))


SETS = {
    "volume": lambda rng: rng.uniform(-0.5, 0.5, (5000, 3)),
    "clusters": lambda rng: clusters(rng, 5000),
    "plane": lambda rng: rng.uniform(-0.5, 0.5, (5000, 3)) * (1, 1, 0),
    "line": lambda rng: rng.uniform(-0.5, 0.5, (5000, 3)) * (0, 1, 0),
    "lattice with equal distances": lambda rng: rng.integers(-8, 8, (5000, 3)) / 16,
    "outside the bounds": lambda rng: rng.normal(scale=3, size=(5000, 3)),
    "one leaf, full": lambda rng: rng.uniform(-0.5, 0.5, (16, 3)),
    "one more than a leaf": lambda rng: rng.uniform(-0.5, 0.5, (17, 3)),
    "one more than a node": lambda rng: rng.uniform(-0.5, 0.5, (257, 3)),
    "fewer than k": lambda rng: rng.uniform(-0.5, 0.5, (5, 3)),
    "one photon": lambda rng: np.zeros((1, 3)),
}


@pytest.mark.parametrize("k", [2, 50, 300])
@pytest.mark.parametrize("name", SETS)
def test_nearest_are_those_of_a_kd_tree(name, k):
    rng = np.random.default_rng(11)
    points = SETS[name](rng).astype(np.float32)
    queries = np.concatenate((points[:50] + rng.normal(scale=0.01, size=points[:50].shape), rng.normal(size=(50, 3))))
    queries = queries.astype(np.float32)
    bound = np.float32(4.0)
    built = photon_map(points, square())
    distance2, within = search_all(built.photons, k, queries, UP, bound)
    tree = cKDTree(np.unique(points, axis=0))  # those at one point count as one
    expected = np.minimum(tree.query(queries, [k])[0][:, 0] ** 2, bound)
    # three float32 differences, squared and summed: 6 roundings of 2^-24
    np.testing.assert_allclose(distance2, expected, rtol=6 * 2.0**-24)
    least = [len(near) for near in tree.query_ball_point(queries, np.sqrt(expected) * (1 - 1e-6))]
    most = [len(near) for near in tree.query_ball_point(queries, np.sqrt(expected) * (1 + 1e-6))]
    assert np.all((least <= within) & (within <= most))


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_nearest_in_tiny_and_huge_scenes(size):
    rng = np.random.default_rng(12)
    points = (rng.uniform(-size, size, (2000, 3))).astype(np.float32)
    queries = points[:100] + np.float32(0.01 * size)
    corners = square().corners
    corners = corners._replace(vertices=corners.vertices * np.float32(size))
    built = photon_map(points, square()._replace(corners=corners))
    distance2, _ = search_all(built.photons, 50, queries, UP, np.float32(4 * size**2))
    np.testing.assert_allclose(distance2, cKDTree(points).query(queries, [50])[0][:, 0] ** 2, rtol=6 * 2.0**-24)


def test_gather_lists_all_nearer_than_the_kth():
    rng = np.random.default_rng(13)
    points = rng.uniform(-0.5, 0.5, (3000, 3)) * (1, 1, 0)
    surfaces, k = square(), 40
    built = photon_map(points, surfaces, side_under(points, 1))
    position = built.photons.photons.position
    disk = DISK._replace(neighbours=k)
    for query in rng.uniform(-0.3, 0.3, (20, 3)) * (1, 1, 0):
        side_id = side_under(query[None], 1)[0]
        index, area, _ = gather_one(built, side_id, query.astype(np.float32), disk)
        distance, nearest = cKDTree(position).query(query.astype(np.float32), k)
        assert set(index) == set(nearest[:-1])  # the k-th bounds the disk and does not count
        assert area == pytest.approx(np.pi * distance[-1] ** 2, rel=1e-6)
        shrunk, shrunk_area, _ = gather_one(built, side_id, query.astype(np.float32), disk._replace(shrink2=0.3))
        assert set(shrunk) == set(nearest[distance**2 < 0.3 * distance[-1] ** 2])
        assert shrunk_area == pytest.approx(0.3 * area, rel=1e-6)


def test_fewer_than_k_in_reach_all_count():
    points = np.array([(0.01 * i, 0.0, 0.0) for i in range(10)])
    built = photon_map(points, square())
    index, area, _ = gather_one(built, 0, (0, 0, 0), DISK._replace(reach2=0.055**2))
    assert len(index) == 6
    assert area == pytest.approx(np.pi * 0.055**2, rel=1e-6)


def test_no_photons():
    built = photon_map(np.empty((0, 3)), square(), power=np.empty((0, 4), np.float32))
    index, area, following = gather_one(built, 0, (0, 0, 0), DISK._replace(reach2=0.04))
    assert len(index) == 0 and area == pytest.approx(np.pi * 0.04, rel=1e-6) and following > 0


def test_irradiance_is_power_over_area():
    rng = np.random.default_rng(14)
    points, power = rng.uniform(-0.1, 0.1, (30, 3)) * (1, 1, 0), rng.normal(size=(30, 3)).astype(np.float32)
    built = photon_map(points, square(), side_under(points, 1), power)
    room = neighbours_room(50)
    kept, area, _ = gather(built.photons, built.surfaces, 0, (0.0, 0.0, 0.0), DISK._replace(reach2=0.16), 0.16, room)
    out = np.empty(3)
    irradiance(built.photons, room, kept, area, out)
    np.testing.assert_allclose(out, power.sum(axis=0, dtype=float) / (np.pi * 0.16), rtol=1e-6)


@pytest.mark.parametrize("guess", [1e-12, 1e-6, 1e-3, 0.02, 1.0, 1e6])
def test_the_first_guess_changes_nothing(guess):
    rng = np.random.default_rng(15)
    points = clusters(rng, 3000) * (1, 1, 0)
    points = points[np.abs(points).max(axis=1) < 0.5]
    queries = np.concatenate((points[:50], rng.uniform(-0.5, 0.5, (50, 3)) * (1, 1, 0)))
    built = photon_map(points, square(10), side_under(points, 10))
    disk = DISK._replace(reach2=0.05, shrink2=0.7)
    expected = gathers(built, side_under(queries, 10), queries, disk, guess=0.05)
    found = gathers(built, side_under(queries, 10), queries, disk, guess=guess)
    assert np.array_equal(found[0], expected[0]) and np.array_equal(found[1], expected[1])


# Surfaces


@pytest.mark.parametrize("thickness", [0.0, 1e-4])
def test_photons_behind_a_thin_wall_do_not_count(thickness):
    """Two sides of one triangle pair, or two walls back to back; either way the query lies in front."""
    rng = np.random.default_rng(16)
    front, back = rng.uniform(-0.5, 0.5, (2, 2000, 3)) * (1, 1, 0)
    if thickness:
        vertices = [(x, y, z) for z in (thickness / 2, -thickness / 2) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        triangles = np.array([(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6)], np.int32)
        surfaces, front_side = surfaces_of(vertices, triangles), side_under(front, 1)
        front[:, 2], back[:, 2] = thickness / 2, -thickness / 2
        back_side = 2 * np.where(triangle_under(back, 1) == 0, 2, 3)
    else:
        surfaces = square()
        front_side, back_side = side_under(front, 1), side_under(back, 1) + 1
    built = photon_map(np.concatenate((front, back)), surfaces, np.concatenate((front_side, back_side)))
    index, area, _ = gather_one(built, 0, (0.1, -0.2, thickness / 2))
    assert len(index) == 49
    assert not np.any(np.isin(built.photons.photons.surface[index], back_side))
    assert len(index) / area == pytest.approx(2000, rel=0.6)  # 4 standard errors of 50 photons: not both sides' 4000


def test_photons_round_the_corner_do_not_count():
    """In a box the nearest photons of a point by an edge lie on two walls; only its own wall's may count."""
    vertices, triangles = box()
    surfaces = surfaces_of(vertices - 0.5, triangles)
    rng = np.random.default_rng(17)
    triangle = np.repeat(np.arange(12), 500)
    u, v = rng.random((2, len(triangle)))
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    a, b, c = surfaces.corners.of(triangle).transpose(1, 0, 2)
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    built = photon_map(points, surfaces, 2 * triangle)
    index, area, _ = gather_one(built, 2 * 8, (0.0, 0.49, -0.5), DISK._replace(neighbours=100))
    assert len(index) > 0
    assert np.all(np.isin(built.photons.photons.surface[index], (16, 18)))  # the floor's two triangles
    assert np.all(built.photons.photons.position[index, 2] == -0.5)


# Density


def density_ratio(region, cells, k, reach_share, shrink2, maps=1200, mean_photons=1000, queries=8):
    """Mean of (estimated / true density) over independent maps of Poisson points on a square, and its standard error.

    region(rng, n): points (n, 2) in the unit square. reach_share: area of the largest disk over that of k photons.
    """
    rng = np.random.default_rng(18)
    surfaces = square(cells)
    reach2 = reach_share * k / (np.pi * mean_photons)
    disk = DISK._replace(neighbours=k, reach2=reach2, shrink2=shrink2)
    ratios = []
    for _ in range(maps):
        points = rng.random((rng.poisson(mean_photons), 3)) * (1, 1, 0) - (0.5, 0.5, 0)
        built = photon_map(points, surfaces, side_under(points, cells))
        asked = np.column_stack((region(rng, queries) - 0.5, np.zeros(queries)))
        kept, area = gathers(built, side_under(asked, cells), asked, disk, reach2)
        ratios.append(np.mean(kept / area) / mean_photons)
    return np.mean(ratios), np.std(ratios, ddof=1) / np.sqrt(maps)


def anywhere(rng, n):
    return rng.random((n, 2))


def by_an_edge(rng, n):
    return rng.random((n, 2)) * (1.0, 0.02)


def in_a_corner(rng, n):
    return 1.0 - rng.random((n, 2)) * 0.02


@pytest.mark.parametrize("cells", [1, 10, 60])  # 60: too fine to walk over, region_area measures
@pytest.mark.parametrize("region", [anywhere, by_an_edge, in_a_corner])
@pytest.mark.parametrize(
    "k, reach_share, shrink2",
    [
        (20, 9.0, 1.0),
        (20, 1.0, 1.0),
        long(20, 0.5, 1.0),
        long(20, 1.0, 0.3),
        long(5, 2.0, 0.5),
    ],
)
def test_density_estimate_is_unbiased(region, cells, k, reach_share, shrink2):
    """k / area would be 5 % too high at k = 20, a disk not cut at the edges 50 % too low there, 75 % in a corner."""
    mean, error = density_ratio(region, cells, k, reach_share, shrink2)
    assert error < 0.025
    assert abs(mean - 1) < 3 * error


@pytest.mark.parametrize("cells", [1, 60])
@pytest.mark.parametrize("radius", [0.1, 1.0, 30.0, 1000.0])
def test_density_on_a_plate_much_smaller_than_the_disk(radius, cells):
    """All photons of the plate count, over all of its area: 1 m2. Too fine to walk over, it is measured by triangles,
    which count as a whole: hence the plate's middle, where those at the disk's rim are few against those inside."""
    rng = np.random.default_rng(7)
    points = rng.random((2000, 3)) * (1, 1, 0) - (0.5, 0.5, 0)
    built = photon_map(points, square(cells), side_under(points, cells))
    disk = DISK._replace(neighbours=4000, reach2=radius**2)
    kept, area = gathers(built, side_under(np.zeros((1, 3)), cells), np.zeros(3), disk, radius**2)
    inside = np.count_nonzero(np.sum(points**2, axis=1) < radius**2)
    assert kept[0] == inside
    assert area[0] == pytest.approx(min(1.0, np.pi * radius**2), rel=1e-6 if radius >= 1.0 or cells == 1 else 0.1)


@pytest.mark.parametrize("beyond", [0.0, 3.0])
@pytest.mark.parametrize("cells", [1, 60])
def test_density_beside_a_wall_is_that_of_this_side(beyond, cells):
    """A wall that crosses the square aslant; beyond it there are `beyond` times as many photons. 3 standard errors."""
    rng = np.random.default_rng(20)
    surfaces, normal, mean = square(cells), np.array((0.8, 0.6, 0.0)), 2000
    disk, ratios = DISK._replace(neighbours=20, reach2=0.01, shrink2=0.7), []
    for _ in range(400):
        points = rng.random((rng.poisson(3 * mean), 3)) * (1, 1, 0) - (0.5, 0.5, 0)
        kept = rng.random(len(points)) < np.where(points @ normal < 0, 1 / 3, beyond / 3)
        built = photon_map(points[kept], surfaces, side_under(points[kept], cells))
        distance = rng.random((8, 1)) * 0.1  # some of these are further than the disk reaches
        along = rng.uniform(-0.2, 0.2, (8, 1)) * (-0.6, 0.8, 0.0)
        asked = along - distance * normal
        kept, area = gathers(built, side_under(asked, cells), asked, disk, disk.reach2, walls=normal / distance)
        ratios.append(np.mean(kept / area) / mean)
    error = np.std(ratios, ddof=1) / np.sqrt(len(ratios))
    print(f"density over truth {np.mean(ratios):.4f} +- {error:.4f}")
    assert error < 0.02 and abs(np.mean(ratios) - 1) < 3 * error


@pytest.mark.parametrize("cells", [1, 10, 60])
@pytest.mark.parametrize("region", [anywhere, by_an_edge, in_a_corner])
def test_density_between_walls_and_edges(region, cells):
    """Walls in any direction, of which some cut what the edges leave of a disk: the area is that of both. 3 standard
    errors."""
    rng = np.random.default_rng(21)
    surfaces, mean, ratios = square(cells), 1000, []
    disk = DISK._replace(neighbours=20, reach2=0.01, shrink2=0.7)
    for _ in range(400):
        points = rng.random((rng.poisson(mean), 3)) * (1, 1, 0) - (0.5, 0.5, 0)
        built = photon_map(points, surfaces, side_under(points, cells))
        asked = np.column_stack((region(rng, 8) - 0.5, np.zeros(8)))
        angle = rng.uniform(0, 2 * np.pi, 8)
        walls = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(8))) / rng.uniform(0.005, 0.1, (8, 1))
        kept, area = gathers(built, side_under(asked, cells), asked, disk, disk.reach2, walls=walls)
        ratios.append(np.mean(kept / area) / mean)
    error = np.std(ratios, ddof=1) / np.sqrt(len(ratios))
    print(f"density over truth {np.mean(ratios):.4f} +- {error:.4f}")
    assert error < 0.05 and abs(np.mean(ratios) - 1) < 3 * error


# Degenerate sets


@pytest.mark.parametrize("count", [1, 49, 50, 51, 300, 5000])
@pytest.mark.parametrize("query", [(0.2, 0.1, 0.0), (0.25 + 1e-7, 0.1, 0.0), (0.25, 0.1, 0.0)])
def test_coincident_photons(count, query):
    """All at one point, seen from elsewhere and from there: they count as one, and all of their power is spread over
    the largest disk, the second time from the guess that the first search left, too."""
    power = np.arange(count, dtype=np.float32)[:, None]
    built = photon_map(np.tile((0.25, 0.1, 0.0), (count, 1)), square(), power=power)
    assert len(built.photons.photons.surface) == 1
    kept, area, following = gather_one(built, 0, query, DISK._replace(reach2=0.01))
    assert len(kept) == 1 and area == pytest.approx(np.pi * 0.01, rel=1e-6)
    assert built.photons.photons.power[0, 0] == count * (count - 1) // 2
    assert gather_one(built, 0, query, DISK._replace(reach2=0.01), following)[1] == area


def test_photons_that_coincide_on_other_sides_stay_apart():
    """Those of both sides, of two layers, and caustics and others; and in each, however they come, all become one."""
    rng = np.random.default_rng(19)
    n = 4000
    side_ids, caustic, layer = rng.integers(0, 2, n).astype(np.int32), rng.random(n) < 0.5, rng.integers(0, 2, n)
    order = np.lexsort((layer, caustic, side_ids))  # those that are alike lie together
    side_ids, caustic, layer = side_ids[order], caustic[order], layer[order].astype(np.uint8)
    store = PhotonStore(1, True, True, True)
    power = rng.integers(1, 10, (n, 1)).astype(np.float32)
    store.append(Photons(np.zeros((n, 3), np.float32), side_ids, power, np.zeros((n, 3), np.float32), caustic, layer))
    photons = build_photon_map(store.photons, square()).photons
    kinds = np.stack((side_ids, caustic, layer), 1)
    expected = {tuple(kind): power[np.all(kinds == kind, axis=1)].sum() for kind in np.unique(kinds, axis=0)}
    found = zip(photons.surface, photons.caustic, photons.layer, strict=True)
    assert dict(zip(map(tuple, found), photons.power[:, 0], strict=True)) == expected


@pytest.mark.parametrize("count", [1, 50, 300, 5000])
def test_photons_nearer_than_float32_resolves(count):
    """Around the point itself, from where all distances are nothing: a finite estimate, the second time as well."""
    points = np.random.default_rng(19).uniform(-1e-20, 1e-20, (count, 3)) * (1, 1, 0)
    built = photon_map(points, square())
    _, area, following = gather_one(built, 0, (0, 0, 0), DISK._replace(reach2=0.01))
    assert np.isfinite(area) and area > 0
    _, again, _ = gather_one(built, 0, (0, 0, 0), DISK._replace(reach2=0.01), following)
    assert again == area


@pytest.mark.parametrize("ties", [255, 260, 264, 266, 270, 1000])
def test_nearer_photons_outlast_many_at_one_distance(ties):
    """More photons at exactly one distance than a search has room for must not push out the nearer ones.

    They lie at one point, but each on another triangle, so they stay apart.
    """
    cells = 23
    near = np.column_stack((0.03 + 0.001 * np.arange(10), np.full(10, 0.02), np.zeros(10)))
    points = np.concatenate((np.tile((-0.25, -0.125, 0.0), (ties, 1)), near))
    side_ids = np.concatenate((2 * np.arange(ties), side_under(near, cells)))
    built = photon_map(points, square(cells), side_ids)
    kept, _ = gathers(built, side_under(np.zeros((1, 3)), cells), [(0, 0, 0)])
    assert kept[0] == 10


# Determinism


def test_result_depends_on_the_order_of_photons_alone():
    """Not on how they come in batches, nor on what the store held before; equal Morton side_ids keep their order."""
    rng = np.random.default_rng(20)
    points = rng.uniform(-0.5, 0.5, (4000, 3)) * (1, 1, 0)
    points[:500] = points[500:1000]  # coincident pairs, whose power is added
    power = rng.normal(size=(4000, 2)).astype(np.float32)
    side_ids = side_under(points, 1)
    reference = photon_map(points, square(), side_ids, power)
    used = PhotonStore(2, False, False)
    photon_map(points[:3000], square(), side_ids[:3000], power[:3000], store=used)
    used.clear()
    assert len(used.photons.surface) == 0
    for batches, store in ((7, None), (400, None), (7, used)):
        built = photon_map(points, square(), side_ids, power, batches, store)
        for array, expected in zip(built.photons.tree, reference.photons.tree, strict=True):
            assert np.array_equal(array, expected)
        for array, expected in zip(built.photons.photons, reference.photons.photons, strict=True):
            assert np.array_equal(array, expected)


def test_photons_stay_together():
    """Position, side, power, direction, mark and layer of a photon move as one."""
    rng = np.random.default_rng(21)
    n = 1000
    points = (rng.uniform(-0.5, 0.5, (n, 3)) * (1, 1, 0)).astype(np.float32)
    side_ids = side_under(points, 1).astype(np.int32)
    store = PhotonStore(1, True, True, True)
    for part in np.array_split(np.arange(n), 9):
        marks = part % 3 == 0, (part % 200).astype(np.uint8)
        number = part.astype(np.float32)[:, None]
        store.append(Photons(points[part], side_ids[part], number, points[part, ::-1].copy(), *marks))
    surfaces = square()
    photons = build_photon_map(store.photons, surfaces).photons
    order = photons.power[:, 0].astype(int)
    assert np.array_equal(np.sort(order), np.arange(n))
    assert np.array_equal(photons.position, points[order])
    assert np.array_equal(photons.surface, side_ids[order])
    assert np.array_equal(photons.incoming, points[order, ::-1])
    assert np.array_equal(photons.caustic, order % 3 == 0)
    assert np.array_equal(photons.layer, order % 200)
    # a gather of caustics alone lists the marked ones of the same disk
    built = Map(build_photon_map(store.photons, surfaces), surfaces)
    point = (0.1, 0.05, 0.0)
    (side_id,) = side_under([point], 1)
    every, area, _ = gather_one(built, side_id, point)
    marked, same_area, _ = gather_one(built, side_id, point, DISK._replace(only_caustic=True))
    caustic = built.photons.photons.caustic
    assert same_area == area and 5 < len(marked) < len(every)
    assert np.array_equal(marked, every[caustic[every]])


def test_no_surface_before_a_wall_has_no_photons():
    """A point that float32 puts beyond the rim, at the foot of a wall: the disk before that holds no surface, and what
    is found there would be divided by nothing."""
    rim = np.float32(0.5)
    point = (np.nextafter(rim, np.float32(1.0)), 0.1, 0.0)
    wall = (-1.0 / (0.25 * (float(point[0]) - 0.5)), 0.0, 0.0)  # a quarter of the way back to the rim
    built = photon_map(np.random.default_rng(0).uniform(-0.5, 0.5, (500, 3)) * (1, 1, 0), square())
    kept, area = gathers(built, 0, point, DISK._replace(neighbours=10), walls=wall)
    assert kept[0] == 0 and area[0] > 0
