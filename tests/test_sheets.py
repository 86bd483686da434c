# SPDX-License-Identifier: GPL-3.0-or-later
"""What is foreseen of the noise of each sheet, against hand-made trials and rays whose truth one can compute.

Where few photons came, sheets are drawn to the mean of all that matter, which is worth PRIOR photons; with N hits that
is PRIOR / N of the value at most. All hits lie on one sheet in most tests: its own mean is that of all, so nothing is
drawn anywhere.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

from addon.solver import Material
from addon.solver.geometry.segments import Tracer
from addon.solver.geometry.stage import Stage
from addon.solver.geometry.surfaces import build_surfaces, sheet_count
from addon.solver.geometry.triangles import areas, centroids
from addon.solver.photons.emission import Surroundings
from addon.solver.photons.photon_map import few_neighbours
from addon.solver.physics.radiometry import build_radiometry, emission_range
from addon.solver.physics.sky import no_sky_cells
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.lamps import Lamps
from addon.solver.planning.pilot import Pilot
from addon.solver.planning.sheets import _PRIOR, Excess, Gathering, Trial, measure_sheets
from addon.solver.sampling.low_discrepancy import lattice_point
from addon.solver.sampling.rng import PILOT, SHEETS, pass_key
from addon.solver.sampling.warps import cosine_direction
from tests.helpers.scenes import join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
REFERENCE, HOT = 300.0, 400.0  # K
EMITTED = float(np.sum(band_radiance(EDGES, HOT) - band_radiance(EDGES, REFERENCE)))  # W m-2 sr-1 in excess, by black
TRIAL, PASS = 1000, 20_000  # photons
REACH2, NEIGHBOURS = 0.04, 50  # m2


class World(NamedTuple):
    """The triangles of a scene, and the centre that was subtracted."""

    stage: Stage
    tracer: Tracer
    centre: np.ndarray

    @property
    def surfaces(self):
        return self.stage.surfaces

    def upper(self):
        """(t, 2) bool, sides that face upwards."""
        height = self.surfaces.plane[:, 2]
        return np.column_stack((height > 0, height < 0))

    def side_id(self, triangle):
        """2 t + side, of the upper side of a triangle."""
        return 2 * triangle + int(self.upper()[triangle, 1])

    def label(self, triangle, below=0):
        """Of the sheet that the upper side of a triangle belongs to, or of that below it."""
        return int(self.surfaces.sheet.ravel()[self.side_id(triangle) ^ below])

    def at(self, point):
        """The side_id of the upper side of the ground, triangles 0 and 1, at a point of the scene."""
        return next(
            self.side_id(t) for t in (0, 1) if is_in(self.surfaces.corners.of(t), np.array(point) - self.centre)
        )


def is_in(corners, point):
    """Whether a point lies in a level triangle, or on its edge."""
    a, b, c = corners[:, :2]
    u, v = np.linalg.solve(np.column_stack((b - a, c - a)), point[:2] - a)
    return min(u, v, 1 - u - v) >= -1e-6


def world_of(*parts):
    """Of black parts (vertices, triangles, kelvin)."""
    vertices, triangles, temperature, material = join(*((*part, 0) for part in parts))
    scene = make_scene(
        vertices, triangles, temperature, (Material("black", 1.0),), look((0, 0, 9), (0, 0, 0)), EDGES, material
    )
    surfaces, tracer, centre = build_surfaces(scene)
    radiometry = build_radiometry(scene.materials, EDGES, emission_range(surfaces.temperature), HOT, REFERENCE)
    return World(Stage(surfaces, radiometry), tracer, centre)


def no_hits():
    return Trial(TRIAL, np.zeros((0, 3), np.float32), np.zeros(0, np.int32), np.zeros(0), np.zeros(0, bool))


def hits(world, side_id, power, point=None, caustic=False):
    """A trial in which these sides (n,) got these powers (n,), W, at points of the scene (n, 3)."""
    side_id = np.asarray(side_id, np.int32)
    point = np.zeros((len(side_id), 3)) if point is None else np.asarray(point) - world.centre
    power = np.broadcast_to(np.asarray(power, float), side_id.shape)
    return Trial(TRIAL, point.astype(np.float32), side_id, power, np.broadcast_to(caustic, side_id.shape))


def measured(world, trial=None, sky=0.0, left_to_rays=None, **found):
    """The Sheets of a trial and of what a pilot found.

    sky: W m-2 sr-1, excess of the surroundings. left_to_rays: (t,) share of the light of triangles that is not left to
    shadow rays, all if there is nothing else. found: the pilot's reachable sides, all if
    there is nothing else; point (n, 3) in the scene and side_id (n,), where paths gather, facing upwards; left and met,
    from which sheets rays went and what they met.
    """
    labels = sheet_count(world.surfaces)
    extent = np.bincount(world.surfaces.sheet.ravel(), np.repeat(areas(world.surfaces.corners), 2), labels)
    found_share = np.ones(labels)
    if left_to_rays is not None:
        found_share[world.surfaces.sheet] = np.asarray(left_to_rays)[:, None]
    lamps = Lamps(*[None] * len(Lamps._fields))._replace(found=found_share)
    point = np.reshape(found.get("point", ()), (-1, 3)) - world.centre
    told = {name: np.asarray(found.get(name, ()), np.int32) for name in ("side_id", "left", "met")}
    pilot = Pilot(*[None] * len(Pilot._fields))._replace(
        reachable=np.isin(np.arange(labels), world.surfaces.sheet[found.get("reachable", world.surfaces.sheet >= 0)]),
        extent=extent,
        point=point,
        normal=np.tile((0.0, 0.0, 1.0), (len(point), 1)),
        **told,
    )
    surroundings = np.full(len(EDGES) - 1, sky / (len(EDGES) - 1))
    flux = math.pi * surroundings.sum()
    no_sky = np.empty((0, 0, len(surroundings)))
    excess = Excess(
        Surroundings(surroundings, no_sky, surroundings, no_sky_cells(), flux, 0, np.zeros(labels, bool)), lamps
    )
    gathering = Gathering(REACH2, NEIGHBOURS, PASS)
    key = pass_key(0, SHEETS, PILOT)
    return measure_sheets(world.stage, world.tracer, excess, pilot, trial or no_hits(), gathering, key)


GROUND = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))  # 4 m2
BESIDE = quad((4, 0, 0), (0.5, 0, 0), (0, 0.5, 0))  # 1 m2


@pytest.fixture
def ground():
    return world_of((*GROUND, REFERENCE))


@pytest.fixture
def two():
    """The ground and a smaller one beside it, that cannot see each other."""
    return world_of((*GROUND, REFERENCE), (*BESIDE, REFERENCE))


# What photons say -----------------------------------------------------------------------------------------------------


def test_density_is_photons_of_a_pass_per_area(ground):
    """100 of the trial's 1000 photons came: 2000 of a pass on 4 m2. The upper side alone is reachable."""
    trial = hits(ground, np.repeat([ground.side_id(0), ground.side_id(1)], 50), 1.0)
    sheets = measured(ground, trial, reachable=ground.upper())
    assert sheets.density[ground.label(0)] == pytest.approx(100 * PASS / TRIAL / 4.0)
    # the lower side got none: as dense as what is reachable, but for what it says itself, no hit on 4 m2
    drawn = _PRIOR / (4.0 + _PRIOR / (100 / 4.0))
    assert sheets.density[ground.label(0, below=1)] == pytest.approx(drawn * PASS / TRIAL)


def test_densities_of_two_sheets_are_their_own(two):
    """300 hits on 4 m2 and 600 on 1 m2, and PRIOR more on as much as these have of their mean, 900 on 5 m2."""
    side_id = np.concatenate((np.full(300, two.side_id(0)), np.full(600, two.side_id(2))))
    density = measured(two, hits(two, side_id, 1.0), reachable=two.upper()).density * TRIAL / PASS
    for triangle, count, area in ((0, 300, 4.0), (2, 600, 1.0)):
        drawn = (count + _PRIOR) / (area + _PRIOR / (900 / 5.0))
        assert density[two.label(triangle)] == pytest.approx(drawn)
        assert drawn == pytest.approx(count / area, rel=0.05)


def test_reflected_and_lit_are_irradiance_over_pi(ground):
    """On a perfect reflector; signs count in what is reflected alone."""
    irradiance = 7.0  # W m-2
    side_id = np.full(100, ground.side_id(0))
    power = np.where(np.arange(100) < 75, 1.0, -1.0) * irradiance * 4.0 / 50  # W: +75 and -25 are 50
    sheets = measured(ground, hits(ground, side_id, power), reachable=ground.upper())
    label = ground.label(0)
    assert sheets.reflected[label] == pytest.approx(irradiance / math.pi)
    assert sheets.lit[label] == pytest.approx(2 * irradiance / math.pi)


def test_photon_noise_is_the_variance_of_photons_in_a_disk(ground):
    """Of so many passes with Poisson numbers of photons, the radiance that a disk's photons say is reflected.

    The variance of a variance from n passes is 2 / n of its square, and that of Poisson numbers of photons, and of the
    hits that foresee it, adds their fourth moment: 4 standard deviations of both.
    """
    rng = np.random.default_rng(1)
    strength = rng.uniform(0.5, 2.0, 2000) * rng.choice((-1, 1), 2000)
    sheets = measured(ground, hits(ground, np.full(2000, ground.side_id(0)), strength), reachable=ground.upper())
    foreseen = sheets.photon_noise[ground.label(0)]
    disk, passes = 0.02, 4000  # m2
    mean = 2000 * PASS / TRIAL * disk / 4.0  # photons of a pass in the disk
    said = [
        rng.choice(strength, rng.poisson(mean)).sum() * TRIAL / PASS / (math.pi * disk) for _ in range(passes)
    ]  # W m-2 sr-1
    assert foreseen / disk == pytest.approx(np.var(said), rel=4 * math.sqrt(2 / passes + 1 / 2000))


def test_disk_holds_the_neighbours_or_ends_at_its_reach(ground):
    """In the middle of the ground: all of the largest disk is there, and it takes less for so many photons."""
    point = (0.25, 0.1, 0.0)
    whole = math.pi * REACH2
    for count in (10, 1000):
        trial = hits(ground, np.full(count, ground.side_id(0)), 1.0)
        sheets = measured(ground, trial, reachable=ground.upper(), point=[point], side_id=[ground.at(point)])
        label, density = ground.label(0), count * PASS / TRIAL / 4.0
        assert sheets.span[label] == pytest.approx(whole, rel=1e-6)
        assert sheets.disk[label] == pytest.approx(min(whole, NEIGHBOURS / density), rel=1e-6)
    assert NEIGHBOURS / density < whole < NEIGHBOURS / (10 * PASS / TRIAL / 4.0)  # both were met


@pytest.mark.parametrize(
    "point, share",
    [((0.0, 0.2, 0.0), 1.0), ((1.0, 0.1, 0.0), 1 / 2), ((0.9, -1.0, 0.0), None), ((1.0, 1.0, 0.0), 1 / 4)],
)
def test_span_is_what_lies_on_the_sheet(ground, point, share):
    """The largest disk around a point in the middle, at an edge, near a corner and in one."""
    radius = math.sqrt(REACH2)
    if share is None:  # half a disk less what is beyond x = 1, half a segment
        angle = math.acos(0.1 / radius)
        share = 1 / 2 - (angle - 0.5 * math.sin(2 * angle)) / (2 * math.pi)
    sheets = measured(ground, point=[point], side_id=[ground.at(point)])
    assert sheets.span[ground.label(0)] == pytest.approx(share * math.pi * REACH2, rel=1e-5)


def test_caustics_are_counted_apart(ground):
    """Within reach of a point they are so many hits whatever is chosen; none of them is noise of what is chosen."""
    point = np.array((0.2, 0.1, 0.0))
    near, far = np.tile(point + (0.05, 0, 0), (30, 1)), np.tile(point + (0.5, 0, 0), (30, 1))
    side_id = np.full(60, ground.side_id(0))
    trial = hits(ground, side_id, 2.0, np.concatenate((near, far)), caustic=True)
    sheets = measured(ground, trial, point=[point], side_id=side_id[:1])
    label, square = ground.label(0), (2.0 / math.pi) ** 2 * TRIAL / PASS
    few = few_neighbours(NEIGHBOURS)
    largest, gathered = math.pi * REACH2 * few / NEIGHBOURS, few * TRIAL / PASS / 30  # share of those near that count
    assert sheets.caustic_noise[label] == pytest.approx(30 * square / largest**2 / gathered)
    assert sheets.photon_noise[label] == 0.0 and sheets.reflected[label] == pytest.approx(60 * 2.0 / 4.0 / math.pi)
    plain = measured(ground, trial._replace(caustic=np.zeros(60, bool)), point=[point], side_id=side_id[:1])
    assert plain.caustic_noise[label] == 0.0 and plain.photon_noise[label] > 0.0


# What rays meet -------------------------------------------------------------------------------------------------------


def half_hot():
    """The ground through the middle of a black sphere, one half of which is hot."""
    points, triangles = sphere(3)
    is_hot = points[triangles].mean(axis=1)[:, 0] > 0
    ground = quad((0, 0, 0), (1.2, 0, 0), (0, 1.2, 0))
    return world_of((*ground, REFERENCE), (points, triangles[is_hot], HOT), (points, triangles[~is_hot], REFERENCE))


def rays_from(world, point, count=4096, seed=0):
    """Triangles (count,) that cosine-distributed rays from a point on the ground meet, -1 for none."""
    numbers = np.random.default_rng(seed).random((count, 2))
    direction = np.array([cosine_direction(*pair) for pair in numbers], np.float32)
    origin = np.tile(np.asarray(point) - world.centre + (0, 0, 1e-4), (count, 1)).astype(np.float32)
    return world.tracer.trace(origin, direction)[0]


def test_ray_noise_of_a_half_hot_hemisphere():
    """Half of the rays meet what is EMITTED and half nothing: the variance is EMITTED^2 / 4, and little less if not
    quite half of them do."""
    world = half_hot()
    met = rays_from(world, (0, 0, 0))
    assert met.min() >= 2  # all meet the sphere
    share = np.mean(centroids(world.surfaces.corners)[met, 0] + world.centre[0] > 0)
    assert abs(share - 0.5) < 4 * 0.5 / math.sqrt(len(met))
    label = world.label(0)
    noise = measured(world, left=np.full(len(met), label), met=met).ray_noise[label]
    assert noise == pytest.approx(EMITTED**2 / 4, rel=4 * (4 * 0.25 / len(met)) + 1e-4)  # and the table of emission


@pytest.mark.parametrize("sky", [0.0, 0.7 * EMITTED, -2.0])
def test_ray_noise_counts_the_sky(sky):
    """A quarter of the rays of one sheet meet something hot, the others the sky; all of the other sheet's meet the sky.
    Their means and variances are drawn to those of all rays by PRIOR of these."""
    world = world_of((*GROUND, REFERENCE), (*BESIDE, HOT))
    one, other = world.label(0), world.label(2)
    met = np.where(np.arange(800) < 100, 2, -1)
    left = np.where(np.arange(800) < 400, one, other)
    noise = measured(world, left=left, met=met, sky=sky).ray_noise / (EMITTED - sky) ** 2
    share = _PRIOR / (400 + _PRIOR)
    shift = share / 8  # of the mean: both differ by 1/8 from that of all rays
    of_all = 1 / 8 * 7 / 8
    for label, own in ((one, 1 / 4 * 3 / 4), (other, 0.0)):
        expected = (1 - share) * (own + shift**2) + share * of_all
        assert noise[label] == pytest.approx(expected, rel=1e-4)  # of the table of emission


def test_what_is_left_to_shadow_rays_is_not_of_rays():
    """Rays that meet a lamp bring the share of its light that is left to them: the variance goes as its square, and
    without the only hot thing nothing is uncertain."""
    world = half_hot()
    met = rays_from(world, (0, 0, 0))
    label = world.label(0)
    left = np.full(len(met), label)
    whole = measured(world, left=left, met=met).ray_noise[label]
    for share in (0.0, 0.3):
        shares = np.full(len(world.surfaces.material), share)  # of what is not hot, too, but it emits nothing
        noise = measured(world, left=left, met=met, left_to_rays=shares).ray_noise[label]
        assert noise == pytest.approx(share**2 * whole, rel=1e-6)


def half_hot_lattices(points, shifts, rays):
    """Variance of the share of a lattice's rays that meet the hot half of the sphere, from points on the ground (n, 2),
    over that of random rays: from so many lattices of each point, each shifted at random."""
    shifts = np.random.default_rng(4).random((len(points) * shifts, 2))
    numbers = [lattice_point(ray, rays, *shift) for shift in shifts for ray in range(rays)]
    direction = np.array([cosine_direction(*pair) for pair in numbers]).reshape(len(points), -1, 3)
    along = np.einsum("ik,ijk->ij", points, direction[..., :2])
    distance = -along + np.sqrt(along**2 + 1 - np.sum(points**2, axis=1)[:, None])
    hot = points[:, :1] + distance * direction[..., 0] > 0
    shares = hot.reshape(len(points), -1, rays).mean(axis=2)
    share = shares.mean(axis=1)
    return shares.var(axis=1, ddof=1).mean() / (share * (1 - share) / rays).mean()


@pytest.mark.parametrize("rays, tried", [(16, 512), (128, 128)])
def test_evenness_and_fall_are_how_much_less_noisy_a_lattice_is(rays, tried):
    """Where one half of what is around is hot, against a count of rays (the ground's own frame is the world's). Where
    each ray meets something else there is nothing to gain.

    The mean of as many squares as points are tried, which are as spread as those of normal numbers, is known to the
    root of 2 over their number.
    """
    world, tolerance = half_hot(), 4 * math.sqrt(2 / tried)
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (1000, 2))
    on_ground = np.column_stack((points, np.zeros(len(points))))
    side_id = [world.at(each) for each in on_ground]

    def noise_of_a_lattice(of):
        sheets = measured(of, point=on_ground, side_id=side_id)
        return sheets.evenness * rays ** (1.0 - sheets.fall)

    expected = half_hot_lattices(points[:: rays // 16], 20, rays)
    print(f"{noise_of_a_lattice(world):.3f}, counted {expected:.3f}")
    assert noise_of_a_lattice(world) == pytest.approx(expected, rel=tolerance) and expected < 0.5
    points, triangles = sphere(4)
    kelvin = np.random.default_rng(3).choice((REFERENCE, HOT), len(triangles))
    parts = [(points, triangles[kelvin == each], each) for each in (REFERENCE, HOT)]
    speckled = world_of((*quad((0, 0, 0), (1.2, 0, 0), (0, 1.2, 0)), REFERENCE), *parts)
    # a patch of the sphere holds less than a thousandth of the hemisphere, a stratum a sixteenth or 128th
    assert noise_of_a_lattice(speckled) == pytest.approx(1.0, rel=tolerance)


def test_nothing_known_is_nothing_foreseen(ground):
    """Neither hits nor rays: no number is invented, and none fails."""
    sheets = measured(ground)
    assert all(len(value) == sheet_count(ground.surfaces) for value in sheets[:-2])
    for name in ("photon_noise", "ray_noise", "reflected", "lit", "caustic_noise"):
        assert not getattr(sheets, name).any()
    assert np.all(np.isfinite(sheets.density)) and np.all(sheets.span == pytest.approx(math.pi * REACH2))
