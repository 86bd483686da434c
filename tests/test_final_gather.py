# SPDX-License-Identifier: GPL-3.0-or-later
"""Final gathers: exact where photon disks would blur, the same mean as photons, in numbers that are well chosen."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import t as student

from addon.solver import Camera, Material, PointLight, Settings, SunLight, passes, render
from addon.solver.camera import eye_paths
from addon.solver.camera.final_gather import _WINDOW, Finals, share
from addon.solver.camera.gathers import part_near
from addon.solver.camera.rays import ALONE, BLIND, Bounce, Rows, empty_rays, empty_rows
from addon.solver.geometry.segments import Hits
from addon.solver.geometry.surfaces import build_surfaces
from addon.solver.image.tiles import TILE, tiles
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning import preparation
from addon.solver.planning.splitting import FEWEST_SHARED, noise_and_time, plan_splitting, ray_variance, spread_in
from addon.solver.sampling.rng import path_key
from tests.helpers.marks import long
from tests.helpers.paper_estimator import ALWAYS_RECALL, changed, lights_alone, no_final_gathers, rays_everywhere
from tests.helpers.scenes import box, join, look, make_scene, mean_and_error, quad, sphere

pytestmark = pytest.mark.once

EDGES = np.array([8.0, 10.0, 12.0])
GREY, BLACK = Material("grey", 0.5), Material("black", 1.0)
MIRROR = Material("mirror", 0.1, specular=1.0)
ROUGH = Material("rough", 0.2, specular=0.7, roughness=0.4)


def wall_factor(distance, width, height):
    """Share of the sky of a point of the floor that a wall on the floor fills: width (m) to both sides, height (m).

    Twice the configuration factor of a plane element to a rectangle at right angles with a corner beside it (Howell,
    factor B-4): (atan(1 / Y) - Y / sqrt(X^2 + Y^2) atan(1 / sqrt(X^2 + Y^2))) / (2 pi), X = height / width.
    """
    x, y = height / width, distance / width
    root = np.hypot(x, y)
    return (np.arctan(1 / y) - y / root * np.arctan(1 / root)) / math.pi


def test_floor_beside_a_hot_wall_is_exact():
    """No disk of photons can hold half of what it counts behind a wall, or be smaller the nearer it is.

    The wall is black, floor and surroundings have the reference temperature: what the floor reflects of the wall is all
    the excess, E / pi times 0.5. 4 standard errors a column of pixels, which are themselves below 4 %.
    """
    wall = quad((0, 0, 0.1), (0, 1, 0), (0, 0, 0.1))
    floor = quad((0, 0, 0), (2, 0, 0), (0, 2, 0))
    camera = Camera(32, 12, look((0.16, 0, 1), (0.16, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.16, 0.16, -0.3, 0.3))
    *parts, material = join((*floor, 300.0, 0), (*wall, 400.0, 1))
    scene = make_scene(*parts, (GREY, BLACK), camera, EDGES, material, world_temperature=300.0)
    images = np.array(
        [render(scene, Settings(passes=12, photons_per_pass=20_000, seed=seed)).radiance() for seed in range(16)]
    ).mean(axis=1)  # over the rows, along the wall
    background = band_radiance(EDGES, 300.0).sum()
    excess = 0.5 * (band_radiance(EDGES, 400.0).sum() - background)
    x = (np.arange(3200) + 0.5) / 3200 * 0.32
    y = (np.arange(60) + 0.5) / 60 * 0.6 - 0.3
    half = [wall_factor(x[:, None], 1.0 + sign * y, 0.2) for sign in (-1, 1)]
    truth = excess * (0.5 * (half[0] + half[1])).mean(axis=1).reshape(32, 100).mean(axis=1)
    value = images.mean(axis=0) - background
    error = images.std(axis=0, ddof=1) / math.sqrt(len(images))
    print(np.column_stack((value / truth - 1, error / truth)).round(4))
    assert np.all(error < 0.04 * truth)
    # 32 columns, 15 degrees of freedom: by chance alone one test in 1000 fails
    assert np.all(np.abs(value - truth) < student.ppf(1 - 5e-4 / 32, 15) * error)


def pane_factor(x, height):
    """Share of the sky of a point of the floor, at x (m), that a pane above it hides: from -1 m to 0 and, along its
    edge, 1 m to both sides, height (m) above the floor.

    Sum over its corners of the configuration factor of a plane element to a parallel rectangle with a corner straight
    above it (Howell, factor B-3), which is odd in both lengths.
    """

    def corner(a):
        a, b = a / height, 1.0 / height
        root_a, root_b = np.hypot(1.0, a), np.hypot(1.0, b)
        return (a / root_a * np.arctan(b / root_a) + b / root_b * np.arctan(a / root_b)) / (2.0 * math.pi)

    return 2.0 * (corner(-x) - corner(-1.0 - x))


def test_floor_below_the_edge_of_a_pane_is_exact():
    """A pane 2 cm above a floor, both at T0 under a cold sky, seen from above with pixels of 4 cm: how much of the sky
    it hides changes within a pixel. A gather whose rays meet the pane knows that its neighbours are lit otherwise; the
    others must not take its light for theirs.

    The mean over all columns of pixels is within 4 standard errors of the formula, over 64 passes of 4 seeds. A column
    may also differ by 5 % of the change to its neighbours, which shared rays blur (see splitting.NEAR).
    """
    height, cold = 0.02, 200.0
    camera = Camera(32, 12, look((0.32, 0, 1), (0.32, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.64, 0.64, -0.24, 0.24))
    pane, floor = quad((-0.5, 0, height), (0.5, 0, 0), (0, 1, 0)), quad((0, 0, 0), (3, 0, 0), (0, 3, 0))
    *parts, material = join((*floor, 300.0, 0), (*pane, 300.0, 1))
    scene = make_scene(*parts, (GREY, BLACK), camera, EDGES, material, world_temperature=cold)
    columns = []
    for seed in range(4):
        sums = [np.zeros((12, 32))]
        settings = Settings(passes=64, photons_per_pass=20_000, seed=seed, reference_temperature=300.0)
        render(scene, settings, lambda film, sums=sums: sums.append(film.passes * film.radiance().astype(float)))
        columns.extend(np.diff(sums, axis=0).mean(axis=1)[:, 8:])
    values = np.column_stack((columns, np.mean(columns, axis=1)))
    warm, sky = (band_radiance(EDGES, kelvin).sum() for kelvin in (300.0, cold))
    x = (np.arange(2400) + 0.5) / 2400 * 0.96
    truth = warm + 0.5 * (sky - warm) * (1.0 - pane_factor(x, height)).reshape(24, 100).mean(axis=1)
    change = np.abs(np.diff(truth, prepend=truth[0], append=truth[-1]))
    blur = np.append(0.05 * np.maximum(change[:-1], change[1:]), 0.0)
    truth = np.append(truth, truth.mean())
    mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / math.sqrt(len(values))
    print(np.column_stack((mean, truth, (mean - truth) / error)).round(4))
    assert np.all(np.abs(mean - truth) < 4.0 * error + blur)


@pytest.mark.long
def test_floor_beside_a_mirror_is_exact():
    """A mirror stands on a floor that goes on behind it, in its shadow. Close to it the floor has twice the light of a
    ball before it: rays from the ball, and photons by way of the mirror, of which none may be sought behind it.

    A sphere lights a point at the distance d with pi B (r / d)^2 cos(theta), whatever its size. Its mesh counts as the
    sphere of the same area (mean shadow of a convex body: a quarter of its surface, Cauchy), to 0.3 %; and 4 standard
    errors of a column.
    """
    floor, mirror = quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), quad((0, 0, 0.5), (0, 1, 0), (0, 0, 0.5))
    ball = sphere(3, 0.05)
    ball = ball[0] + (0.4, 0.0, 0.3), ball[1]
    *parts, material = join((*floor, 300.0, 0), (*mirror, 300.0, 1), (*ball, 900.0, 2))
    camera = Camera(
        6, 64, look((0.006, 0, 0.2), (0.006, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.006, 0.006, -0.4, 0.4)
    )
    scene = make_scene(
        *parts, (GREY, Material("silver", 0.0, specular=1.0), BLACK), camera, EDGES, material, world_temperature=300.0
    )
    images = np.array(
        [render(scene, Settings(passes=32, photons_per_pass=2000, seed=seed)).radiance() for seed in range(16)]
    ).mean(axis=1)
    background = band_radiance(EDGES, 300.0).sum()
    corners = ball[0][ball[1]]
    surface = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    x, y = (np.arange(1200) + 0.5) / 1200 * 0.012, (np.arange(800) + 0.5) / 800 * 0.8 - 0.4
    factor = 0.0
    for side in (-1, 1):  # the ball and its image
        d2 = (x[:, None] - side * 0.4) ** 2 + y**2 + 0.3**2
        factor = factor + surface / (4 * math.pi) * 0.3 / d2**1.5
    truth = 0.5 * (band_radiance(EDGES, 900.0).sum() - background) * factor.mean(axis=1).reshape(6, 200).mean(axis=1)
    value = images.mean(axis=0) - background
    error = images.std(axis=0, ddof=1) / math.sqrt(len(images))
    print(np.column_stack((value / truth - 1, error / truth)).round(4))
    assert np.all(error < 0.04 * truth)
    # 6 columns, 15 degrees of freedom: by chance alone one test in 1000 fails
    assert np.all(np.abs(value - truth) < student.ppf(1 - 5e-4 / 6, 15) * error + 0.003 * truth)


def corner(kind):
    """A corner of floor and walls with things in it that light it in every way there is."""
    if kind == "outside":
        return outside()
    vertices, triangles = box((2.0, 2.0, 1.5))
    kelvin = np.repeat([290.0, 300.0, 310.0, 295.0, 285.0, 305.0], 2)
    parts = [(vertices, triangles[2 * f : 2 * f + 2], kelvin[2 * f], 0) for f in range(6 if kind != "open" else 5)]
    ball_points, ball = sphere(2, 0.05)
    lights = ()
    if "lamp" in kind:
        parts.append((ball_points + (0.6, 0.9, 0.5), ball, 900.0, 1))
    if "mirror" in kind:
        parts.append((*quad((0.15, 0.95, 0.65), (0, 0.75, 0), (0.05, 0, 0.6)), 290.0, 2))
    if "rough" in kind:
        parts.append((*quad((0.15, 0.95, 0.65), (0, 0.75, 0), (0.05, 0, 0.6)), 290.0, 3))
    if "light" in kind:
        lights = (PointLight(np.array([0.7, 1.1, 0.6]), 3000.0, 0.05),)
    if "sun" in kind:
        lights = (SunLight(np.array([0.3, 0.1, -1.0]), 500.0),)
    vertices, triangles, temperature, material = join(*parts)
    camera = look((1.7, 1.6, 1.2), (0.2, 0.3, 0.2), 8, 6, 0.7)
    return make_scene(
        vertices, triangles, temperature, (GREY, BLACK, MIRROR, ROUGH), camera, EDGES, material,
        lights=lights, world_temperature=250.0,
    )  # fmt: skip


def outside():
    """A box on a wide plain under the sky: what its sides see of the sky they see directly, and by way of the plain,
    which looks for the sky with rays of its own."""
    vertices, triangles = box((0.5, 0.5, 0.5))
    plain = quad((0, 0, 0), (3, 0, 0), (0, 3, 0))
    *parts, material = join((vertices, triangles, 290.0, 0), (*plain, 290.0, 0))
    camera = look((2.0, -1.5, 0.5), (0.3, 0.2, 0.25), 8, 6, 0.12)
    return make_scene(*parts, (GREY,), camera, EDGES, material, world_temperature=250.0)


@pytest.mark.parametrize(
    "kind, passes",
    [
        ("closed", 32),
        ("open", 32),
        long("outside", 200),
        ("lamp", 32),
        long("lamp mirror", 64),
        long("light mirror", 32),
        long("lamp rough", 64),
        ("light rough", 32),
        ("light mirror rough", 32),
    ],
)
def test_final_gathers_and_photons_agree(kind, passes, monkeypatch):
    """Every path of light is counted once, by ray or photon. 4 standard errors; these are below 0.5 %, outside 1 %."""
    scene = corner(kind)
    settings = Settings(passes=passes, photons_per_pass=20_000, reference_temperature=290.0)
    results = []
    for choose in (rays_everywhere, no_final_gathers):
        monkeypatch.setattr(eye_paths, "choose_splits", choose)
        results.append(mean_and_error(scene, settings))
    (gathered, gathered_error), (photons, photons_error) = results
    error = math.hypot(gathered_error, photons_error)
    print(f"{kind}: {gathered / photons - 1:+.3%} +- {error / photons:.3%}")
    assert error < (0.01 if kind == "outside" else 0.005) * photons
    assert abs(gathered - photons) < 4 * error


@pytest.mark.parametrize("second, expected", [(0.1, 1), (1.0, 2)])
def test_rays_with_other_colours_keep_theirs(second, expected, monkeypatch):
    """One pixel sees a floor in two mirrors. A final gather for both is right only if both have the same colour, as its
    rays, from all of the floor that the pixel sees, are multiplied by one throughput."""
    mirrors = [
        Material("mirror", np.array([(9.99, below), (10.01, 1.1 - below)]), specular=1.0) for below in (0.1, second)
    ]
    floor, hot = quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), quad((-1, 0, 1), (0, 2, 0), (0, 0, 1))
    left, right = (quad((x, 0, 0.8), (0.05, 0, 0), (0, 0.05, 0)) for x in (-0.05, 0.05))
    *parts, material = join((*floor, 300.0, 0), (*hot, 320.0, 0), (*left, 300.0, 1), (*right, 300.0, 2))
    camera = look((0.0, 0.0, 0.4), (0.0, 0.0, 0.8), 1, 1, 0.1)
    scene = make_scene(*parts, (GREY, *mirrors), camera, EDGES, material, world_temperature=250.0)
    choose, groups = eye_paths.choose_splits, []

    def watch(stage, estimate, pixels, bounce, gathers):
        if not bounce.rays.final.any():
            groups.append(gathers.of)
        return choose(stage, estimate, pixels, bounce, gathers)

    monkeypatch.setattr(eye_paths, "choose_splits", watch)
    render(scene, Settings(passes=1, photons_per_pass=20_000))
    (group,) = (of for of in groups if np.any(of >= 0))
    assert np.all(group >= 0)  # all rays, those of mirrors
    assert len(set(group)) == expected


def test_all_that_reflects_diffusely_sends_rays(monkeypatch):
    """However little noise counts, photons alone never stand for what a gather of the camera reflects."""
    sent, choose = [], eye_paths.choose_splits

    def watch(stage, estimate, pixels, bounce, gathers):
        kept = choose(stage, estimate, pixels, bounce, gathers)
        sent.extend(zip(bounce.rays.final[kept.ray], kept.rays, strict=True))
        return kept

    def plan(*arguments):
        return plan_splitting(*arguments)._replace(price=math.inf)

    monkeypatch.setattr(preparation, "plan_splitting", plan)
    monkeypatch.setattr(eye_paths, "choose_splits", watch)
    render(corner("light mirror"), Settings(passes=1, photons_per_pass=20_000))
    is_end, rays = np.transpose(sent).astype(int)
    assert np.any(is_end == 0) and set(rays[is_end == 0]) == {FEWEST_SHARED}
    assert not np.any(rays[is_end == 1])  # ends recall, or go on by one ray


def test_what_is_near_goes_to_a_row_of_its_own():
    """Of rays of final gathers that share their rays with neighbours; their closeness counts wherever they add to. Not
    of rays that miss, go on, come from a mirror or belong to no final gather: nobody parts what these meet. Rays that
    look for what is near are as many as one gather sends."""
    nothing, near, fewer = -1, 0.2, 0.25
    rows = {  # row: triangle, distance (m), final, continued, density; whether it is parted, and its closeness counts
        2: (5, 0.5 * near, True, False, 1.0, True, True),
        3: (5, 2.0 * near, True, False, 1.0, False, True),
        4: (nothing, 0.1, True, False, 1.0, False, False),
        5: (5, 0.1, True, True, 1.0, False, False),
        6: (5, 0.5, True, False, BLIND, False, True),
        7: (5, 0.1, False, False, ALONE, False, False),
    }
    triangle, distance, final, continued, density, parted, counts = zip(*rows.values(), strict=True)
    bounce, filled = some_rays(list(rows), triangle, distance, (near, fewer), apart=10)
    bounce.rays.final[:], bounce.rays.continued[:], bounce.rays.density[:] = final, continued, density
    part_near(bounce, filled)
    assert bounce.rays.pixel.tolist() == [row + 10 * is_parted for row, is_parted in zip(rows, parted, strict=True)]
    np.testing.assert_allclose(bounce.rays.density[:2], (fewer, 1.0), rtol=1e-6)
    expected = np.where(counts, 1.0 / np.float32(distance), 0.0)
    np.testing.assert_allclose(filled.closeness[list(rows)], expected, rtol=1e-6)


def test_half_of_what_is_neither_near_nor_far_is_shared():
    """At the distance `near` half of the rays go to the row of their own; 4 standard errors of that share. So many rays
    look for it: the mean of both."""
    count, near, fewer = 10_000, 0.2, 0.25
    bounce, filled = some_rays(np.zeros(count, int), np.full(count, 5), np.full(count, near), (near, fewer), apart=1)
    bounce.rays.final[:], bounce.rays.continued[:], bounce.rays.density[:] = True, False, 1.0
    part_near(bounce, filled)
    assert abs(bounce.rays.pixel.mean() - 0.5) < 4 * 0.5 / math.sqrt(count)
    np.testing.assert_allclose(bounce.rays.density, 0.5 * (1.0 + fewer), rtol=1e-4)


def some_rays(row, triangle, distance, looking, apart):
    """A Bounce of rays, and Rows, in which all rows have the same near and fewer (looking) and apart."""
    count, total = len(row), max(row) + 1 + apart
    rays = empty_rays(count, 1)
    rays.pixel[:], rays.path[:] = row, [path_key(np.uint64(1), i) for i in range(count)]
    hits = Hits(np.array(triangle, np.int32), *np.zeros((2, count), np.float32), np.array(distance, np.float32))
    near, fewer = np.full((2, total), np.transpose([looking]), np.float32)
    rows = Rows(np.zeros((total, 1), np.float32), near, np.full(total, apart, np.int32), fewer, np.zeros(total))
    return Bounce(1, rays, hits, np.zeros(count, np.bool_), np.zeros(count, np.float32)), rows


def test_neighbours_share_their_rays():
    """The weighted mean over final gathers on the same side of the same sheet, within the disks of both and the window;
    less where it bends, and within 5 % of the mean distance to what is around. Where a rim cuts the disk they count in
    pairs, in pixels on opposite sides. What is not shared is added as it is.

    Against a plain sum over all pairs; 1e-5: sums of some ten float32.
    """
    random = np.random.default_rng(3)
    meshes = [quad((-3, 0, 0), (0.9, 0, 0), (0, 2, 0)), sphere(2, 1.0)]
    vertices, triangles, kelvin, material = join(*((*mesh, 300.0, 0) for mesh in meshes))
    camera = look((0, 0, 5), (0, 0, 0))
    surfaces, _, _ = build_surfaces(make_scene(vertices, triangles, kelvin, (GREY,), camera, EDGES, material))
    rows, columns, count, bands, shrink2 = 7, 12, 400, 2, 0.5
    triangle = np.where(random.random(count) < 0.5, random.integers(0, 2, count), random.integers(2, 40, count))
    corners = surfaces.corners.of(triangle).astype(float)
    point = corners.mean(axis=1)
    side_id = (2 * triangle + (random.random(count) < 0.3)).astype(np.int32)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) * np.where(side_id % 2, -1, 1)[:, None]
    point += random.uniform(-0.2, 0.2, point.shape)
    pixel = random.integers(0, rows * columns, count).astype(np.int32)
    rays = random.choice([16, 32, 128], count).astype(np.int32)
    contribution, factor = random.uniform(0.01, 1, count), random.uniform(0, 1, (count, bands)).astype(np.float32)
    radius2, is_cut = random.uniform(0, 4, count), random.random(count) < 0.5
    near, fewer = np.zeros(count, np.float32), np.ones(count, np.float32)
    finals = Finals(pixel, point, side_id, rays, radius2, is_cut, near, fewer, rows * columns, contribution, factor)
    image = random.normal(size=(rows * columns + 2 * count, bands)).astype(np.float32)
    sheet = surfaces.sheet[side_id >> 1, side_id & 1]
    d2 = np.sum((point[:, None] - point) ** 2, axis=-1)
    x, y = pixel % columns, pixel // columns
    near = (np.abs(x[:, None] - x) <= _WINDOW) & (np.abs(y[:, None] - y) <= _WINDOW) & (sheet[:, None] == sheet)
    closeness = rays / random.uniform(1, 50, count)
    radius2 = np.minimum(radius2, shrink2 * (0.05 * rays / closeness) ** 2)
    bend2 = np.sum((normal[:, None] - normal) ** 2, axis=-1)
    left = np.maximum(1 - d2 / np.minimum(radius2[:, None], radius2) - bend2 / (0.1 * shrink2), 0.0)
    np.fill_diagonal(left, 1.0)
    weight = np.where(near, left, 0.0) * rays
    met = np.zeros((count, 3 * rows, 3 * columns), np.bool_)  # pixels that hold others, with a margin on each side
    ours, others = np.nonzero(weight)
    met[ours, rows + y[others], columns + x[others]] = True
    has_opposite = met[np.arange(count)[:, None], rows + 2 * y[:, None] - y, columns + 2 * x[:, None] - x]
    alone = is_cut[:, None] & ~has_opposite & (weight > 0)
    assert alone.any() and np.any(np.count_nonzero(weight * ~alone, axis=1)[is_cut] > 1)
    weight = np.where(alone, 0.0, weight)
    shared, alone = image[rows * columns :].reshape(2, count, bands) / contribution[:, None]
    mean = weight @ shared / weight.sum(axis=1, keepdims=True) + alone
    expected = image[: rows * columns].astype(float)
    np.add.at(expected, pixel, factor * mean)
    assert np.mean(np.count_nonzero(weight, axis=1) > 1) > 0.5  # most do share
    assert np.any((left > 0) & (left < 1) & (bend2 > 0))  # and some around a bend
    total = np.zeros(len(image))
    total[rows * columns : rows * columns + count] = closeness
    share(surfaces, finals, shrink2, (rows, columns), empty_rows(image)._replace(closeness=total))
    np.testing.assert_allclose(image[: rows * columns], expected, rtol=1e-5, atol=1e-5)


def test_tiles_cover_the_window_and_move():
    """Each pixel is in one tile of a pass, and in TILE passes in every row and column of a tile once, but near the
    window's edges, where tiles begin and end with it."""
    x0, y0, x1, y1 = window = np.array([3, 5, 3 + 3 * TILE + 2, 5 + 2 * TILE + 7])
    height, width = y1 - y0, x1 - x0
    within = []
    for index in range(40, 40 + TILE):
        position, covered = np.zeros((height * width, 2), int), np.zeros(height * width, int)
        for pixels in tiles(window, index, np.uint64(2**63 + 12345)):
            assert min(pixels.shape) > 0 and max(pixels.shape) <= TILE
            covered[pixels] += 1
            position[pixels] = np.stack(np.indices(pixels.shape), axis=-1)
        assert np.all(covered == 1)
        within.append(position.reshape(height, width, 2)[TILE : height - TILE, TILE : width - TILE])
    assert np.all(np.sort(within, axis=0) == np.arange(TILE)[:, None, None, None])
    assert tiles(np.array([0, 0, 1, 1]), 7, np.uint64(5))[0].tolist() == [[0]]


@pytest.mark.long
@pytest.mark.parametrize("moving", [True, False])
def test_tiles_leave_no_steps(moving, monkeypatch):
    """What a grey floor reflects of a hot wall, all else being black, is exact on both sides of tiles' borders, as they
    move; were these where they are in the first pass (moving is False), it would not be.

    In pixels: the step over the change from one to the next. Four standard errors, from the spread of the renders.
    """

    def still(window, *_):
        return tiles(window, 0, np.uint64(0))

    if not moving:
        monkeypatch.setattr(passes, "tiles", still)
    vertices, triangles = box((4.0, 4.0, 3.0))
    faces = np.repeat(np.arange(6), 2)
    kelvin, material = np.where(faces == 0, 400.0, 300.0), np.where(faces == 4, 0, 1)  # x = 0, z = 0
    camera = Camera(2 * TILE, 8, look((1, 2, 2.9), (1, 2, 0)).matrix, "ORTHOGRAPHIC", frame=(-0.8, 0.8, -0.1, 0.1))
    scene = make_scene(vertices, triangles, kelvin, (GREY, BLACK), camera, EDGES, material)
    settings = Settings(passes=TILE, photons_per_pass=1000, reference_temperature=300.0)
    images = [render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(6)]
    profile = np.mean(images, axis=1)
    x = 0.2 + 1.6 * (np.arange(6400) + 0.5) / 6400
    background, hot = (band_radiance(EDGES, kelvin).sum() for kelvin in (300.0, 400.0))
    y = (np.arange(8) + 0.5) / 8 * 0.2 - 0.1
    half = [wall_factor(x[:, None], 2.0 + sign * y, 3.0) for sign in (-1, 1)]
    factor = (0.5 * (half[0] + half[1])).mean(axis=1).reshape(2 * TILE, -1).mean(axis=1)
    truth = background + 0.5 * (hot - background) * factor
    error = (profile - truth) / np.gradient(truth)
    borders = sorted({pixels.min() % (2 * TILE) for pixels in still(camera.pixels)} - {0})
    steps = (error[:, borders] - error[:, np.subtract(borders, 1)]).mean(axis=1)
    step, error = steps.mean(), steps.std(ddof=1) / math.sqrt(len(steps))
    print(f"moving {moving}: step {step:.3f} +- {error:.3f} pixels")
    assert (abs(step) < 4 * error) == moving


def test_rays_by_way_of_half_mirrors_beat_photons(monkeypatch):
    """An open box at 340 K in empty space, of metal that reflects half of its light diffusely: rays serve only where
    they are less noisy than photons. It fails if roulette ends rays of final gathers on mirrors because each carries
    little of its pixel: there are many. The root mean square of the spread of 8 renders, over what shows metal."""
    vertices, triangles = box((0.2, 0.2, 0.2))
    metal = Material("metal", 0.2, specular=0.5)
    inside = triangles[: 2 * 5]  # all faces but the last, at the top
    camera = look((0.1, 0.02, 0.6), (0.1, 0.1, 0.0), 24, 24, 0.4)
    scene = make_scene(vertices, inside, 340.0, (metal,), camera, EDGES, world_temperature=0.0)

    def spread():
        settings = Settings(passes=1, photons_per_pass=20_000)
        images = np.array([render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(8)])
        mean = images.mean(axis=0)
        return math.sqrt(np.mean(images.var(axis=0, ddof=1)[mean > 0.5 * mean.max()]))

    default = spread()
    monkeypatch.setattr(eye_paths, "choose_splits", no_final_gathers)
    photons = spread()
    print(f"{default:.3f} W m-2 sr-1, by photons alone {photons:.3f}")
    assert default < photons


def plate_against_a_wall(caustic):
    """A warm plate at the foot of a cold wall, under a colder sky; the picture is a strip along the crease. Or with a
    lamp before a mirror, which throws its light there, too."""
    plate = quad((0, -0.5, 0), (1, 0, 0), (0, 0.5, 0))
    wall = quad((0, 0, 0.25), (1, 0, 0), (0, 0, 0.25))
    mirror = quad((0, -1.2, 0.5), (1, 0, 0), (0, 0, 0.5))
    *parts, material = join((*plate, 302.0, 0), (*wall, 278.0, 0), *([(*mirror, 290.0, 1)] if caustic else []))
    camera = look((0, -0.8, 0.4), (0, 0, 0.02), 64, 8, 0.6)
    lights = (PointLight(np.array([0.0, -0.6, 1.2]), 5.0, temperature=600.0),) if caustic else ()
    return make_scene(
        *parts, (Material("metal", 0.3), MIRROR), camera, EDGES, material, world_temperature=235.0, lights=lights
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("caustic", [False, True])
def test_a_corner_is_not_blurred_by_what_rays_recall(caustic, monkeypatch):
    """On both sides of a crease, in the rows of pixels next to it, rays end within the disks of the photons that they
    ask. The first passes agree with passes whose disks are a tenth as wide, which would not do without going on.

    Means of 32 renders each, to 4 standard errors, from the spread between them. Without the lamp, whose caustic is
    noisier than all else, these are small enough for the blur to be seen: without going on it is more than 4 of them.
    """
    scene = plate_against_a_wall(caustic)
    monkeypatch.setattr(eye_paths, "choose_splits", rays_everywhere)

    def rows(first, seeds):
        settings = Settings(passes=4, photons_per_pass=5000, pass_offset=first)
        images = [render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in seeds]
        means = np.mean(images, axis=2, dtype=float)[:, 2:4]
        return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(len(means))

    truth, its_error = rows(1_000_000, range(32))
    found, error = rows(0, range(32, 64))
    with changed(ALWAYS_RECALL):
        blurred, _ = rows(0, range(32, 64))
    error = np.hypot(error, its_error)
    print("deviation", found - truth, "+-", error, "without going on", blurred - truth)
    assert np.all(np.abs(found - truth) < 4 * error)
    assert caustic or np.max((truth - blurred) / error) > 4


def variance_at(price, scene, settings, monkeypatch):
    """Variance between the pixels of 24 renders planned at this price of noise, in kelvins as splitting counts them;
    and the plan: Splitting, Survey, and what plan_splitting got besides."""
    plans = []

    def plan(sheets, survey, *rest):
        plans.append((plan_splitting(sheets, survey, *rest)._replace(price=price), survey, *rest))
        return plans[-1][0]

    monkeypatch.setattr(preparation, "plan_splitting", plan)
    images = [render(scene, dataclasses.replace(settings, seed=seed)).radiance() for seed in range(24)]
    return np.mean(np.var(images, axis=0, ddof=1).ravel() * plans[-1][1].sensitivity ** 2), plans[-1]


def test_noise_is_foreseen_where_a_small_part_of_a_floor_is_lit(monkeypatch):
    """A panel of 1 m over a floor of 30 m, and the picture shows no more than what is under it.

    To a factor of 1.5 in the standard deviation, as below; without shadow rays, whose noise is not foreseen.
    """
    monkeypatch.setattr(preparation, "build_lamps", lights_alone)
    floor, panel = quad((0, 0, 0), (15, 0, 0), (0, 15, 0)), quad((0, 0, 1), (0.5, 0, 0), (0, 0.5, 0))
    *parts, material = join((*floor, 293.0, 0), (*panel, 400.0, 1))
    camera = look((0, -0.8, 0.6), (0, 0, 0), 16, 16, 0.8)
    scene = make_scene(*parts, (GREY, BLACK), camera, EDGES, material, world_temperature=293.0)
    found, (splitting, survey, reach2, neighbours, _) = variance_at(
        math.inf, scene, Settings(passes=1, reference_temperature=293.0), monkeypatch
    )
    foreseen, _ = noise_and_time(splitting, len(survey.block), reach2, neighbours)
    print(f"foreseen over found {math.sqrt(foreseen / found):.2f}")
    assert 1.5**-2 < foreseen / found < 1.5**2


@pytest.mark.long
@pytest.mark.parametrize("kind", ["closed", "open"])
def test_noise_of_rays_is_foreseen(kind, monkeypatch):
    """To a factor of 1.5 in the standard deviation: rays in number as a spread that is wrong by that take at most 8 %
    more time for the same noise, (1.5 + 1 / 1.5) / 2. The camera sees nothing but floor, so no edges add to the noise.
    Nor do shadow rays, whose noise is not foreseen.
    """
    scene = dataclasses.replace(corner(kind), camera=look((1.0, 1.0, 1.4), (1.1, 0.9, 0.0), 64, 48, 0.3))
    settings = Settings(passes=1, photons_per_pass=20_000, reference_temperature=290.0)
    monkeypatch.setattr(eye_paths, "choose_splits", rays_everywhere)
    monkeypatch.setattr(preparation, "build_lamps", lights_alone)
    found, (splitting, survey, reach2, neighbours, _) = variance_at(1e-30, scene, settings, monkeypatch)  # no roulette
    pixels, cells = len(survey.block), survey.cells
    sheets, labels = splitting.sheets, cells.key % len(splitting.sheets.density)
    spreads = [spread_in(cells, cell) for cell in range(len(labels))]
    ray = np.array(
        [
            ray_variance(sheets, label, spread, reach2, neighbours, 1.0)
            for label, spread in zip(labels, spreads, strict=True)
        ]
    )
    assert ray.mean() < 0.5 * sheets.evenness * cells.ray_noise.mean()  # several gathers share
    foreseen = np.sum(cells.count * cells.contribution2 * (ray * 32**-sheets.fall + cells.rest)) / pixels
    print(f"{kind}: foreseen over found {math.sqrt(foreseen / found):.2f}")
    assert 1.5**-2 < foreseen / found < 1.5**2
