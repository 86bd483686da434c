# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes at several times, without Blender: against many sharp pictures, and against the exponential of a lag."""

import dataclasses
from functools import cache, reduce

import numpy as np
import pytest

from addon.solver import Film, Material, SceneError, Settings, render
from addon.solver.checkpoint import fingerprint
from addon.solver.moments import at_moment, moment_of, moment_times, step_of, wave_count, waves, weight_before
from addon.solver.physics.spectrum import band_radiance
from tests.helpers.marks import long
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
WIDTH, HEIGHT, SHARP = 24, 18, 64
QUICK = Settings(passes=32, photons_per_pass=2000, threads=2)
CAMERA = look((0.0, -4.0, 1.0), (0.0, 0.0, 1.0), WIDTH, HEIGHT)


def floor():
    return (*quad((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 3.0, 0.0)), 295.0, 0)


def pictured(mesh, materials):
    """A scene of vertices, triangles, temperatures and materials under a sky of 285 K."""
    return make_scene(*mesh[:3], materials, CAMERA, EDGES, mesh[3], world_temperature=285.0)


def hot_sphere(time, temperature=400.0):
    """A hot sphere that flies by over a floor that reflects half of it, at a time from 0 to 1."""
    points, triangles = sphere(2, 0.35)
    mesh = join((points + (1.6 * time - 0.8, 0.0, 0.8), triangles, temperature, 1), floor())
    return pictured(mesh, (Material("floor", 0.5), Material("paint", 0.9)))


def fan(time):
    """Four blades that turn by a right angle and a half from 0 to 1, in front of a wall."""
    blades = []
    for angle in np.pi * (0.75 * time + np.arange(4) / 2):
        along = np.array([np.cos(angle), 0.0, np.sin(angle)])
        across = np.array([-along[2], 0.0, along[0]])
        blades.append((*quad(np.array([0.0, 0.0, 1.0]) + 0.5 * along, 0.35 * along, 0.12 * across), 340.0, 1))
    wall = (*quad((0.0, 1.0, 1.0), (3.0, 0.0, 0.0), (0.0, 0.0, 2.0)), 290.0, 0)
    mesh = join(*blades, wall)
    return pictured(mesh, (Material("wall", 0.8), Material("blade", 0.95)))


def moving(at, times, middle=0.5):
    """The scene that `at` gives at a time, with moments at times; planned at a time in the middle."""
    base = at(middle)
    return dataclasses.replace(base, moments=tuple(moment_of(at(time), base) for time in times))


def shutter(count):
    return moment_times(0.0, 1.0, 0.0, count)


@cache
def accumulated(at):
    """Mean radiance of many sharp pictures over the shutter, and its standard error."""
    times = enumerate(shutter(SHARP))
    films = [render(at(time), dataclasses.replace(QUICK, passes=2, seed=100 + i)) for i, time in times]
    radiance = np.mean([film.radiance().astype(np.float64) for film in films], axis=0)
    return radiance, np.sqrt(np.mean([radiance_error(film) ** 2 for film in films], axis=0) / SHARP)


def radiance_error(film):
    """(h, w) standard error of a film's radiance: that of the temperature, which is small, times the slope."""
    kelvin, step = film.temperature().astype(np.float64), 0.01
    above, below = (_blackbody(kelvin + sign * step) for sign in (1.0, -1.0))
    return film.noise() * (above - below) / (2.0 * step)


def _blackbody(kelvin):
    return band_radiance(EDGES, kelvin.ravel()).sum(axis=1).reshape(kelvin.shape)


@pytest.mark.parametrize("at", [hot_sphere, long(fan)])
def test_spread_passes_see_the_mean_of_sharp_pictures(at):
    """Within three stated errors: of a normal distribution 0.3 % of the pixels are beyond, here at most 1 %, as stated
    errors are estimates themselves. In the mean over the picture the error averages out: 16 bands of a region lie
    within 5 of its own."""
    film = render(moving(at, shutter(32)), QUICK)
    sharp, error = accumulated(at)
    off = film.radiance() - sharp
    stated = np.hypot(radiance_error(film), error)
    beyond = np.abs(off) > 3.0 * stated + 1e-6 * sharp
    assert beyond.mean() <= 0.01
    assert abs(off.mean()) < 5.0 * np.sqrt((stated**2).mean() / off.size) + 1e-6 * sharp.mean()
    standing = render(at(0.5), QUICK)
    assert (np.abs(standing.radiance() - sharp) > 3.0 * stated).mean() > 0.1  # a picture of the middle is another one


@pytest.mark.parametrize(
    "at, steps, passes, least",
    [
        (hot_sphere, 32, 32, 0.3),
        long(hot_sphere, 32, 20, 0.3),
        long(hot_sphere, 64, 64, 0.3),
        long(fan, 32, 32, 0.2),
        (hot_sphere, 8, 32, 0.15),
    ],
)
def test_noise_is_not_below_the_error(at, steps, passes, least):
    """Over seeds, against sharp pictures, of the pixels that see the motion: the root mean square of the error over the
    stated one is at most 1, and at least what is given. Times are stratified, so the picture errs less than the spread
    of the passes tells, as far as that does not follow slow waves of the time; and less still with more passes than
    times."""
    ratio = np.sqrt(np.mean(np.square(errors_in_motion(at, steps, passes))))
    print(f"{at.__name__}, {passes} passes at {steps} times: {ratio:.2f}")
    assert least < ratio < 1.0


def errors_in_motion(at, steps, passes, share=0.1):
    """Errors over stated errors of the pixels that see the motion, more than a share of the picture, over three seeds,
    against sharp pictures."""
    sharp, error = accumulated(at)
    standing = render(at(0.5), dataclasses.replace(QUICK, passes=2)).radiance()
    moved = np.abs(standing - sharp) > 0.02 * sharp.mean()
    assert moved.mean() > share
    scene, ratios = moving(at, shutter(steps)), []
    for seed in range(3):
        film = render(scene, dataclasses.replace(QUICK, passes=passes, seed=seed))
        ratios.append((film.radiance() - sharp)[moved] / np.hypot(radiance_error(film), error)[moved])
    return np.concatenate(ratios)


def random_motion(seed):
    """A function of time as `hot_sphere`: one to four balls and blades that fly, turn and some of which warm up, over
    the floor and before a wall that may be a mirror."""
    rng = np.random.default_rng(seed)
    parts = [
        {
            "ball": rng.random() < 0.5,
            "place": rng.uniform((-1.0, -0.6, 0.3), (1.0, 0.6, 1.6)),
            "speed": rng.uniform(-1.6, 1.6, 3) * (1.0, 0.4, 0.5),
            "size": rng.uniform(0.08, 0.4),
            "turns": np.pi * rng.uniform(0.0, 3.0),
            "kelvin": rng.uniform(310.0, 600.0),
            "warming": rng.uniform(0.0, 100.0) * (rng.random() < 0.3),
        }
        for _ in range(rng.integers(1, 5))
    ]
    wall = Material("wall", 0.1, specular=1.0) if rng.random() < 0.3 else Material("wall", 0.8)
    materials = (Material("floor", rng.uniform(0.3, 0.95)), Material("paint", 0.9), wall)

    def at(time):
        meshes = [floor(), (*quad((0.0, 1.2, 1.0), (3.0, 0.0, 0.0), (0.0, 0.0, 2.0)), 290.0, 2)]
        for part in parts:
            place = part["place"] + part["speed"] * (time - 0.5)
            along = np.array([np.cos(part["turns"] * time), 0.0, np.sin(part["turns"] * time)])
            across = np.array([-along[2], 0.0, along[0]])
            points, triangles = sphere(2, part["size"])
            blade = quad(place, part["size"] * along, 0.4 * part["size"] * across)
            shape = (points + place, triangles) if part["ball"] else blade
            meshes.append((*shape, part["kelvin"] + part["warming"] * (time - 0.5), 1))
        return pictured(join(*meshes), materials)

    at.__name__ = f"member {seed}"
    return at


@pytest.mark.long
@pytest.mark.parametrize("passes, steps", [(7, 32), (12, 32), (13, 32), (20, 32), (32, 32), (40, 16)])
def test_noise_of_random_motion(passes, steps):
    """Of the pixels of six members that see the motion, at most 0.1 % are beyond 5 stated errors, and one more at
    most by chance; and the root mean square of error over stated error is at most 1.1, as `Noise` has its own error."""
    ratios = np.concatenate([errors_in_motion(random_motion(seed), steps, passes, 0.05) for seed in range(6)])
    ratio = np.sqrt(np.mean(np.square(ratios)))
    print(f"{passes} passes at {steps} times: {ratio:.2f}, beyond 5: {100.0 * np.mean(np.abs(ratios) > 5.0):.2f} %")
    assert (np.abs(ratios) > 5.0).sum() <= 0.001 * ratios.size + 1
    assert 0.3 < ratio < 1.1


def test_waves_average_out():
    """Over all moments the mean of each cosine is 0, and no two of them are alike; one moment has none."""
    for moments in (1, 2, 5, 32):
        values = np.array([waves(step, moments) for step in range(moments)])
        assert values.shape == (moments, wave_count(moments))
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=1e-14)
        np.testing.assert_allclose(values.T @ values, 0.5 * moments * np.eye(wave_count(moments)), atol=1e-12)


def test_a_pass_depends_on_its_index_alone():
    """Neither on threads nor on which other passes are rendered: films of ranges merge into the whole, noise
    included."""
    scene = moving(hot_sphere, shutter(8))
    settings = dataclasses.replace(QUICK, passes=12)
    whole = render(scene, settings)
    single = render(scene, dataclasses.replace(settings, threads=1))
    assert np.array_equal(whole.bands(), single.bands())
    assert np.array_equal(whole.noise(), single.noise())
    parts = [
        render(scene, dataclasses.replace(settings, passes=count, pass_offset=first))
        for first, count in ((5, 4), (0, 5), (9, 3))
    ]
    merged = reduce(Film.merge, parts)
    assert np.allclose(merged.bands(), whole.bands(), rtol=1e-6, atol=0.0)
    assert np.allclose(merged.noise(), whole.noise(), rtol=1e-4, atol=1e-6)
    assert merged.ranges == whole.ranges
    kept = Film.from_state(whole.state())
    assert np.array_equal(kept.noise(), whole.noise())
    going_on = render(scene, settings, film=parts[1])
    assert np.array_equal(going_on.bands(), whole.bands())


def test_films_of_other_motion_are_refused():
    films = [render(moving(hot_sphere, shutter(steps)), dataclasses.replace(QUICK, passes=1)) for steps in (2, 4)]
    with pytest.raises(ValueError, match="move otherwise"):
        films[0].merge(films[1])


def test_the_fingerprint_knows_all_times():
    first, other = moving(hot_sphere, shutter(4)), moving(hot_sphere, [*shutter(4)[:3], 1.0])
    mark, another = fingerprint(first, QUICK), fingerprint(other, QUICK)
    assert {name for name in mark if mark[name] != another[name]} == {"moments"}
    assert fingerprint(moving(hot_sphere, shutter(4)), QUICK) == mark


def test_what_stands_still_costs_nothing():
    """With nothing else at any time, the picture is that without moments, to the last bit."""
    scene = hot_sphere(0.5)
    still = dataclasses.replace(scene, moments=(moment_of(hot_sphere(0.5), scene),) * 4)
    settings = dataclasses.replace(QUICK, passes=3)
    assert still.moments == ((),) * 4
    assert np.array_equal(render(still, settings).bands(), render(scene, settings).bands())


def test_changing_temperatures():
    """A surface without reflections shows the mean radiance of its temperatures."""
    kelvin = np.array([300.0, 320.0, 340.0, 360.0])

    def plate(temperature):
        mesh = quad((0.0, 0.0, 1.0), (9.0, 0.0, 0.0), (0.0, 0.0, 9.0))
        return make_scene(*mesh, temperature, (Material("black", 1.0),), CAMERA, EDGES)

    film = render(moving(plate, kelvin, 330.0), dataclasses.replace(QUICK, passes=4))
    assert film.radiance() == pytest.approx(_blackbody(kelvin).mean(), rel=1e-5)


def test_a_moment_keeps_only_what_differs():
    base, later = hot_sphere(0.5), hot_sphere(0.75, 410.0)
    moment = moment_of(later, base)
    changes = {change.part: change for change in moment}
    assert set(changes) == {"vertices", "temperature"}
    assert changes["temperature"].values.shape[0] == len(base.triangles) - 2 or changes["temperature"].rows is None
    back = at_moment(base, moment)
    for field in dataclasses.fields(base):
        ours, theirs = getattr(back, field.name), getattr(later, field.name)
        assert np.array_equal(ours, theirs) if isinstance(ours, np.ndarray) else ours == theirs, field.name


def test_an_object_appears_and_another_topology():
    """Of 8 moments 2 have a box more: the mean holds a quarter of it."""
    points, triangles = box((0.5, 0.5, 0.5))
    wall = (*quad((0.0, 1.0, 1.0), (5.0, 0.0, 0.0), (0.0, 0.0, 5.0)), 290.0, 0)

    def at(time):
        thing = (points + (-0.25, -0.25, 0.75), triangles, 350.0, 0)
        mesh = join(*([thing] if time > 0.75 else []), wall)
        return pictured(mesh, (Material("black", 1.0),))

    film = render(moving(at, shutter(8), 0.0), dataclasses.replace(QUICK, passes=8))
    expected = 0.75 * _blackbody(np.array([290.0])) + 0.25 * _blackbody(np.array([350.0]))
    assert film.radiance()[HEIGHT // 2, WIDTH // 2] == pytest.approx(float(expected[0]), rel=1e-5)


def test_pictures_of_other_sizes_or_groups_are_refused():
    base = hot_sphere(0.5)
    wide = dataclasses.replace(base, camera=dataclasses.replace(CAMERA, width=WIDTH + 1))
    with pytest.raises(SceneError, match="size of the picture"):
        moment_of(wide, base)
    group = np.where(base.material == 1, 0, -1).astype(np.int16)
    grouped = dataclasses.replace(base, groups=("ball",), group=group)
    warmer = dataclasses.replace(hot_sphere(0.5, 401.0), groups=("ball",), group=group)
    with pytest.raises(SceneError, match="ball.*keeps its temperature"):
        moment_of(warmer, grouped)
    assert [change.part for change in moment_of(hot_sphere(0.6), base)] == ["vertices"]


# Times ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("first", [0, 32, 160])
def test_any_number_of_passes_covers_the_times_evenly(seed, first):
    """A block of 2^k passes sees each of 2^k moments once, and any run of passes leaves no large gap: the largest
    distance of shares, as of a van der Corput sequence, is below (log2 n + 2) / n (Niederreiter 1992, theorem 3.6)."""
    steps = [step_of(first + i, seed, 32) for i in range(32)]
    assert sorted(steps) == list(range(32))
    for count in (3, 5, 11, 23):
        below = np.sort(steps[:count])
        shares = np.arange(1, count + 1) / count - (below + 1) / 32
        assert np.abs(shares).max() < (np.log2(count) + 2) / count


def test_other_seeds_see_the_times_in_another_order():
    orders = {tuple(step_of(i, seed, 16) for i in range(16)) for seed in range(8)}
    assert len(orders) > 4


def test_a_shutter_weighs_all_times_alike():
    assert moment_times(-0.25, 0.25, 0.0, 4) == pytest.approx([-0.1875, -0.0625, 0.0625, 0.1875])


@pytest.mark.parametrize("opened, closed", [(0.0, 0.0), (-0.3, 0.2)])
def test_a_lag_weighs_the_past_by_an_exponential(opened, closed):
    """The times in the middle of equal parts have the mean of the distribution, the middle of the shutter less the time
    constant; the last part of an endless exponential has a mean, not a middle, so a part in 4 m of tau is missing."""
    lag, count = 0.4, 64
    times = moment_times(opened, closed, lag, count)
    assert np.all(np.diff(times) > 0.0)
    assert times.mean() == pytest.approx(0.5 * (opened + closed) - lag, abs=lag / count)
    drawn = np.random.default_rng(1).uniform(opened, closed, 200_000)
    drawn -= np.random.default_rng(2).exponential(lag, drawn.size)
    for at in (-1.0, -0.2, 0.0):
        share = (drawn <= at).mean()  # standard error at most 0.5 / 447
        assert weight_before(np.array([at]), opened, closed, lag)[0] == pytest.approx(share, abs=0.005)


def test_the_trail_of_a_plate_is_an_exponential():
    """A hot plate moves to the right at one speed. Behind its trailing edge, which was at x a time (edge - x) / v ago,
    the detector still shows exp(-(edge - x) / (v tau)) of it; the leading edge rises as fast. 64 moments tell a share
    to half of 1 / 64, pixels to the change within them."""
    lag, speed, edge, length = 0.3, 2.0, 0.5, 0.6  # s, m/s, m, m
    camera = dataclasses.replace(CAMERA, kind="ORTHOGRAPHIC", frame=(-1.6, 1.6, -0.1, 0.1), width=64, height=2)

    def at(time):  # s, the picture is of time 0
        centre = edge + speed * time + 0.5 * length
        plate = (*quad((centre, 0.0, 1.0), (0.5 * length, 0.0, 0.0), (0.0, 0.0, 3.0)), 350.0, 0)
        wall = (*quad((0.0, 1.0, 1.0), (60.0, 0.0, 0.0), (0.0, 0.0, 3.0)), 290.0, 0)
        mesh = join(plate, wall)
        return dataclasses.replace(pictured(mesh, (Material("black", 1.0),)), camera=camera)

    scene = moving(at, moment_times(0.0, 0.0, lag, 64), 0.0)
    film = render(scene, dataclasses.replace(QUICK, passes=64))
    cold, hot = _blackbody(np.array([290.0, 350.0]))
    found = (film.radiance().mean(axis=0) - cold) / (hot - cold)
    x = -1.6 + 3.2 * (np.arange(64) + 0.5) / 64
    entered, left = ((end - x) / (speed * lag) for end in (edge + length, edge))  # ago, in time constants
    shown = np.exp(-np.maximum(left, 0.0)) - np.exp(-np.maximum(entered, 0.0))
    assert np.abs(found - shown).max() < 0.5 / 64 + 0.5 * 0.05 / (speed * lag)
    assert shown.max() > 0.6
