# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and points as triangles: their shape against round hairs and spheres."""

import numpy as np
import pytest

from addon.reading.spheres import Points, levels_of, solid, solids
from addon.reading.strands import simplified
from addon.reading.tubes import (
    COMPACT,
    SIDES,
    Strands,
    catmull_rom_handles,
    closed,
    prisms,
    rounded,
    shortened,
    sides_of,
    thinned,
)


def strands(*hairs, radius=0.01, temperature=None):
    """Hairs through points, each (n, 3), of one radius."""
    points = np.concatenate([np.asarray(hair, np.float64) for hair in hairs])
    first = np.cumsum([0, *map(len, hairs)])
    return Strands(points, np.full(len(points), radius), first, np.zeros(len(hairs), np.int32), temperature)


def areas(mesh):
    a, b, c = mesh.vertices[mesh.triangles].swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def projected(mesh, direction):
    """(m,) areas of triangles as seen from a direction."""
    a, b, c = mesh.vertices[mesh.triangles].swapaxes(0, 1)
    return 0.5 * np.abs(np.cross(b - a, c - a) @ direction)


def directions(count=4000):
    """Unit vectors spread evenly."""
    z = (np.arange(count) + 0.5) / count * 2.0 - 1.0
    turn = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    return np.column_stack((np.sqrt(1.0 - z**2) * np.cos(turn), np.sqrt(1.0 - z**2) * np.sin(turn), z))


@pytest.mark.parametrize("sides", SIDES)
def test_a_prism_has_the_surface_and_the_mean_shadow_of_the_round_hair(sides):
    length, radius = 1.7, 0.02
    mesh = prisms(strands([(0, 0, 0), (length, 0, 0)], radius=radius), np.array([sides]))
    side = areas(mesh)[: 2 if sides == 2 else 2 * sides]
    faces = 2.0 if sides == 2 else 1.0  # a ribbon has two sides
    np.testing.assert_allclose(faces * side.sum(), 2.0 * np.pi * radius * length, rtol=1e-12)
    across = np.linspace(0.0, np.pi, 2000, endpoint=False)  # Cauchy: the mean width is the perimeter / pi
    seen = [
        projected(mesh, np.array([0.0, np.cos(a), np.sin(a)]))[: len(side)].sum() * (1.0 if sides == 2 else 0.5)
        for a in across
    ]
    np.testing.assert_allclose(np.mean(seen), 2.0 * radius * length, rtol=1e-3)


def test_ribbons_of_many_hairs_hide_what_round_hairs_do_from_one_direction():
    """Each is turned by an irrational angle more than the one before, so that their mean is that over all angles."""
    count, radius = 1000, 0.01
    hairs = strands(*[[(0, i, 0), (1, i, 0)] for i in range(count)], radius=radius)
    mesh = prisms(hairs, np.full(count, 2))
    for direction in ((0.0, 0.0, 1.0), (0.0, 0.6, 0.8)):
        np.testing.assert_allclose(projected(mesh, np.array(direction)).sum(), count * 2.0 * radius, rtol=0.01)


def test_a_bent_prism_is_as_wide_behind_the_bend():
    """A mitre keeps both arms prisms, whose surface is their perimeter times the length of their middle."""
    radius, corner = 0.01, [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    mesh = prisms(strands(corner, radius=radius), np.array([12]))
    np.testing.assert_allclose(areas(mesh)[:48].sum(), 2.0 * np.pi * radius * 2.0, rtol=1e-9)


def test_prisms_are_closed_and_their_normals_point_outwards():
    helix = np.linspace(0.0, 4.0 * np.pi, 40)
    points = np.column_stack((np.cos(helix), np.sin(helix), 0.1 * helix))
    mesh = prisms(strands(points, radius=0.05), np.array([8]))
    edges = np.concatenate([mesh.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges) and all((b, a) in there for a, b in there)
    a, b, c = mesh.vertices[mesh.triangles].swapaxes(0, 1)
    assert np.einsum("ni,ni->n", a, np.cross(b, c)).sum() > 0.0  # its volume, six times
    smooth = np.linalg.norm(mesh.normals, axis=2).all(axis=1)
    assert np.count_nonzero(~smooth) == 2 * 6  # the caps
    facing = np.einsum("nij,nj->ni", mesh.normals, np.cross(b - a, c - a))
    assert (facing[smooth] > 0.0).all()


@pytest.mark.parametrize("turns", [0.5, 1.0])
def test_frames_survive_hairs_that_turn_round_and_double_points(turns):
    back = [(0, 0, 0), (1, 0, 0), (0, 0, 0), (0, 1, turns)]
    mesh = prisms(strands(back), np.array([3]))
    assert np.isfinite(mesh.vertices).all() and np.abs(mesh.vertices).max() < 1.1


def test_straight_hairs_in_all_directions_are_round_prisms():
    """Whatever rounding makes of the bends between their spans, of which there are none."""
    ways = np.linspace(0.0, 1.0, 5)[:, None] * directions(500)[:, None]
    mesh = prisms(strands(*ways, radius=0.01), np.full(500, 4))
    side = areas(mesh).reshape(-1)[: 500 * 4 * 8].sum()
    np.testing.assert_allclose(side, 500 * 2.0 * np.pi * 0.01, rtol=1e-9)


def test_straight_hairs_become_one_span_and_bent_ones_stay_within_the_tolerance():
    way = np.linspace(0.0, 1.0, 65)
    straight = np.column_stack((way, way, way))
    arc = np.column_stack((np.sin(way * 3.0), np.cos(way * 3.0), 0.0 * way))
    tolerance = 1e-3
    thin = thinned(strands(straight, arc, straight[:7]), np.full(3, tolerance))
    counts = np.diff(thin.first)
    assert counts[0] == counts[2] == 2
    # A chord over an angle a leaves a unit arc by 1 - cos(a / 2); spans are halved, so they may be half as long.
    longest = 2.0 * np.arccos(1.0 - tolerance)
    assert 3.0 / longest <= counts[1] - 1 <= 2.0 * 3.0 / longest + 1
    middle = 0.5 * (thin.points[2 : 1 + counts[1]] + thin.points[3 : 2 + counts[1]])
    assert (1.0 - np.linalg.norm(middle, axis=1)).max() <= tolerance
    np.testing.assert_array_equal(thin.points[[0, 1]], straight[[0, -1]])


def test_thinning_keeps_temperatures_and_radii_that_vary_along_straight_hairs():
    way = np.linspace(0.0, 1.0, 33)
    straight = np.column_stack((way, 0.0 * way, 0.0 * way))
    bump = (300.0 + 10.0 * np.sin(np.pi * way)).astype(np.float32)
    thin = thinned(strands(straight, temperature=bump), np.array([1.0]))
    np.testing.assert_allclose(np.interp(way, thin.points[:, 0], thin.temperature), bump, atol=0.03)
    ramp = (300.0 + 10.0 * way).astype(np.float32)
    assert len(thinned(strands(straight, temperature=ramp), np.array([1.0])).points) == 2
    thick = strands(straight)
    thick.radius[16] = 0.05
    assert 0.05 in thinned(thick, np.array([1.0])).radius


def test_curves_are_rounded_within_the_tolerance():
    """Through points of a unit circle, which a curve of Catmull and Rom itself leaves by less than its step cubed."""
    angle = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    ring = closed(strands(np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))), np.array([True]))
    ring = Strands(ring.points, ring.radius, ring.first, ring.slot, None, catmull_rom_handles(ring, np.array([True])))
    for tolerance in (1e-3, 1e-4):
        fine = rounded(ring, np.array([tolerance]))
        middle = 0.5 * (fine.points[1:] + fine.points[:-1])
        assert (1.0 - np.linalg.norm(middle, axis=1)).max() < tolerance + 2e-5
        np.testing.assert_array_equal(fine.points[0], fine.points[-1])
    assert len(fine.points) > 3 * 33


def test_the_number_of_sides_keeps_prisms_within_a_quarter_of_a_pixel():
    radius = np.array([0.2, 0.4, 1.0, 3.0, 10.0, 50.0])
    sides = sides_of(radius, np.ones(6))
    assert sides[0] == 2 and (np.diff(sides) > 0).all()
    inside = radius * (1.0 - np.pi / (sides * np.tan(np.pi / sides)))  # of a prism with the perimeter of the circle
    assert (inside[1:] < 0.26).all()
    assert (sides_of(radius, None) == 3).all()


@pytest.mark.parametrize("level", range(5))
def test_solids_have_the_surface_and_the_mean_shadow_of_a_sphere(level):
    points = Points(
        np.array([[1.0, 2.0, 3.0]]), np.array([0.2]), np.array([3], np.int32), np.array([310.0], np.float32)
    )
    mesh = solids(points, np.array([level]))
    np.testing.assert_allclose(areas(mesh).sum(), 4.0 * np.pi * 0.2**2, rtol=1e-12)
    shadow = np.mean([0.5 * projected(mesh, direction).sum() for direction in directions()])
    np.testing.assert_allclose(shadow, np.pi * 0.2**2, rtol=1e-3)
    a, b, c = (mesh.vertices[mesh.triangles] - points.position).swapaxes(0, 1)
    assert (np.einsum("ni,ni->n", a, np.cross(b, c)) > 0.0).all()  # wound outwards
    assert (mesh.slot == 3).all() and (mesh.temperature == 310.0).all()
    assert (mesh.normals is None) == (len(mesh.triangles) < 80)


def test_many_octahedra_hide_what_spheres_do_from_one_direction():
    """Each is turned differently. One alone hides from 0.907 to 1.155 of its sphere, so its standard deviation is
    below 0.25; a low-discrepancy sequence does better than 500 independent ones, whose mean is known to 0.011."""
    count = 500
    points = Points(np.zeros((count, 3)), np.ones(count), np.zeros(count, np.int32))
    mesh = solids(points, np.zeros(count, np.int64))
    np.testing.assert_allclose(0.5 * projected(mesh, np.array([0.0, 0.0, 1.0])).sum() / count, np.pi, rtol=0.011)


def test_the_level_of_a_sphere_keeps_it_within_a_quarter_of_a_pixel():
    radius = np.array([0.1, 1.0, 10.0, 60.0])
    levels = levels_of(radius, np.ones(4))
    assert levels[0] == 0 and (np.diff(levels) > 0).all()
    for r, level in zip(radius[:-1], levels[:-1], strict=True):
        assert r * (np.linalg.norm(solid(int(level))[0], axis=1).max() - 1.0) <= 0.25


@pytest.mark.parametrize("count", [1000, 20_000])
def test_a_share_of_many_thin_hairs_and_points_stands_for_all(count):
    """Of more than 1000. One of each run of them is picked, so the number is known to 1."""
    hairs = strands(*[[(0, i, 0), (1, i, 0)] for i in range(count)], radius=0.01)
    fewer, pixel = simplified(hairs, np.full(count, 0.4))  # a quarter of a pixel is 0.1: a fifth of the hairs
    picks = count if count == 1000 else count // 5  # some of them twice
    assert 0.85 * picks <= len(fewer.slot) == len(pixel) <= picks
    assert fewer.radius[::2].sum() == pytest.approx(0.01 * count, rel=1.5 * 5 / count)
    points = Points(np.zeros((count, 3)), np.full(count, 0.01), np.zeros(count, np.int32))
    fewer, _ = simplified(points, np.full(count, 0.4))
    assert len(fewer.radius) <= 1000
    assert (fewer.radius**2).sum() == pytest.approx(0.01**2 * count, rel=1.5 * 20 / count)


@pytest.mark.parametrize("angle", [np.pi * (3.0 - 5.0**0.5), 1.0, 2.0 * np.pi / 5.0])
def test_the_share_is_even_whatever_the_order_of_hairs(angle):
    """Hairs around a head, by the golden angle as generators do, and by others. In each quarter 1000 of 4000 hairs are
    kept, with a standard deviation below the 32 of independent picks."""
    turn = angle * np.arange(20_000)
    root = np.column_stack((np.cos(turn), np.sin(turn), 0.0 * turn))
    hairs = strands(*np.stack((root, 2.0 * root), axis=1), radius=0.01)
    fewer, _ = simplified(hairs, np.full(20_000, 0.4))
    before, after = (np.arctan2(*each.points[each.first[:-1], :2].T) // (np.pi / 2.0) for each in (hairs, fewer))
    width = fewer.radius[fewer.first[:-1]]
    for quarter in range(-2, 2):
        expected = np.count_nonzero(before == quarter)
        assert width[after == quarter].sum() / 0.01 == pytest.approx(expected, abs=4 * 32 * 5)


STRIPS = 21_000  # hairs in a row
LAYS = {
    "even": lambda count, rng: np.arange(count),
    "random": lambda count, rng: rng.uniform(0.0, count, count),
    "random, in order": lambda count, rng: np.sort(rng.uniform(0.0, count, count)),
}


def covered(hairs):
    """The share of the row that straight hairs along y cover, seen from above."""
    x, radius = hairs.points[hairs.first[:-1], 0], hairs.radius[hairs.first[:-1]]
    order = np.argsort(x - radius)
    begin, end = (x - radius)[order], np.maximum.accumulate((x + radius)[order])
    return 1.0 - np.maximum(begin[1:] - end[:-1], 0.0).sum() / STRIPS


@pytest.mark.parametrize("times", [1.3, 2.5, 3.0, 6.0, 10.0])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.75, 1.0])
def test_strips_that_stand_for_all_cover_as_much(share, times):
    """Hairs in a row, laid evenly and at random, and so many times fewer. Of strips of the length a thrown at random on
    the length L, the cover 1 - exp(-c) has the variance 2 a / L exp(-2 c) ((exp(c) - 1) / c - 1)."""
    error = np.sqrt(2.0 * times * share / STRIPS * np.exp(-2.0 * share) * (np.expm1(share) / share - 1.0))
    expected = {"even": share, "random": -np.expm1(-share)}
    for name, lay in LAYS.items():
        x = lay(STRIPS, np.random.default_rng(5))
        hairs = strands(*[[(each, 0, 0), (each, 1, 0)] for each in x], radius=0.5 * share)
        before, after = covered(hairs), covered(simplified(hairs, np.full(STRIPS, 4.0 * times * share))[0])
        print(f"{times:g} times fewer strips: cover {before:.3f} becomes {after:.3f}, {after / before:.3f}: {name}")
        if name in expected:
            tolerance = 4.0 * error if name == "random" else times / STRIPS + 1e-9  # the strips at the ends
            assert before == pytest.approx(expected[name], abs=tolerance)
            assert after == pytest.approx(before, abs=np.sqrt(2.0) * tolerance)


@pytest.mark.parametrize("period", [2, 3, 6])
@pytest.mark.parametrize("what", ["temperature", "length", "material", "radius"])
def test_hairs_in_a_row_that_differ_in_turn_are_kept_in_their_shares(what, period):
    """One of two, three or six is another one, and about a third is kept, of thicker ones more. The share among 7000
    picks or more is known to the standard deviation of as many independent ones, and so is the sum of all widths, but
    for the last of them."""
    other = np.arange(STRIPS) % period == 0
    points = np.stack([[(each, 0, 0), (each, 3 if what == "length" and o else 1, 0)] for each, o in enumerate(other)])
    kelvin = np.repeat(np.where(other, 310.0, 300.0), 2).astype(np.float32) if what == "temperature" else None
    slot = (other & (what == "material")).astype(np.int32)
    radius = np.where(other & (what == "radius"), 0.35, 0.25)
    hairs = Strands(points.reshape(-1, 3), np.repeat(radius, 2), np.arange(STRIPS + 1) * 2, slot, kelvin)
    # at this size of a pixel one of either radius could stand for two, if they were taken for even
    fewer, _ = simplified(hairs, np.full(STRIPS, 5.8))
    kept = other[fewer.points[fewer.first[:-1], 0].astype(np.int64)]
    width = fewer.radius[fewer.first[:-1]]
    expected = radius[other].sum() / radius.sum()
    error = np.sqrt(3.0 / STRIPS * (1.0 - expected) * expected)
    assert (width * kept).sum() / width.sum() == pytest.approx(expected, abs=4.0 * error)
    spread = width.std() * np.sqrt(len(width))
    assert width.sum() == pytest.approx(radius.sum(), abs=4.0 * spread + width.max())


def test_thick_hairs_are_never_left_out():
    hairs = strands(*[[(0, i, 0), (1, i, 0)] for i in range(2000)], radius=0.3)
    assert simplified(hairs, np.ones(2000))[0].kept_points(np.ones(4000, bool)).radius.max() == 0.3
    assert len(simplified(hairs, np.ones(2000))[0].slot) == 2000


def test_pieces_of_hair_are_compact_and_not_too_many():
    way = np.linspace(0.0, 1.0, 3)[:, None] * [1.0, 1.0, 0.0]
    hairs = strands(way, way, radius=0.01, temperature=np.float32([300, 310, 320, 300, 310, 320]))
    short = shortened(hairs, 10_000)
    length = np.linalg.norm(np.diff(short.points[: short.first[1]], axis=0), axis=1)
    assert length.max() <= COMPACT * 0.02 * (1.0 + 1e-9) and length.sum() == pytest.approx(np.sqrt(2.0))
    np.testing.assert_allclose(short.temperature, 300.0 + 20.0 * short.points[:, 0], rtol=1e-6)
    assert len(shortened(hairs, 10).begins) <= 10
    np.testing.assert_array_equal(short.slot, hairs.slot)
