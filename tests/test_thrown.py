# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of light objects that mirrors throw into gas."""

from dataclasses import replace

import numpy as np
import pytest

from addon.solver import Material, Medium, PointLight, Settings, SpotLight, render
from addon.solver.photons.thrown import build_thrown_map, leave_points
from addon.solver.photons.wave import MIRRORED, OF_LIGHT, STRAIGHT_FROM_LIGHT, empty_wave
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning.preparation import prepare
from tests.helpers.marks import long
from tests.helpers.scenes import box, join, look, make_scene, quad

pytestmark = pytest.mark.once

EDGES, KELVIN = np.array([3.0, 5.0]), 300.0  # um; K, of all but the light
MIRROR, PLATE, BLACK = Material("mirror", 0.0, 1.0), Material("plate", 0.4), Material("black", 1.0)
FAR = (*quad((0, 50, 200), (0.01, 0, 0), (0, 0.01, 0)), KELVIN, 2)  # out of sight: a scene needs a surface
SETTINGS = Settings(passes=32, photons_per_pass=5000, reference_temperature=KELVIN, threads=2)


def spot(side):
    """A spot light above the plane z = 0, or below, and then it is the first one's image in a mirror there."""
    towards = np.array((1.0, 0.1, -side))
    return SpotLight(np.array((-0.9, 0.0, 0.9 * side)), towards, 2e4, 0.5, 0.2, temperature=1500.0)


def plate(side):
    return *quad((0.85, 0.3, side), (0.0, 0.3, 0.0), (0.2, 0.0, 0.25 * side)), KELVIN, 1


def fog(low, scattering):
    """A block of fog beside the light, up to 1.9 m."""
    vertices, triangles = box((1.6, 1.6, 1.9 - low))
    return Medium("fog", 0.1 * scattering, KELVIN, scattering, 0.3, vertices + (-0.4, -0.8, low), triangles)


def before_a_mirror(scattering):
    """A spot light shines onto a mirror, which throws its beam through fog onto a diffuse plate."""
    mirror = *quad((0, 0, 0), (40, 0, 0), (0, 40, 0)), KELVIN, 0
    return scene((mirror, FAR, plate(1)), (spot(1),), fog(-0.5, scattering))


def without_the_mirror(scattering):
    """The same, with an image of all behind the mirror's plane in place of the mirror."""
    return scene((FAR, plate(1), plate(-1)), (spot(1), spot(-1)), fog(-1.9, scattering))


def scene(parts, lights, medium):
    *mesh, index = join(*parts)
    camera = look((0.3, -2.6, 1.3), (0.1, 0, 0.75), 16, 12, 0.5)
    return make_scene(
        *mesh, [MIRROR, PLATE, BLACK], camera, EDGES, index, media=(medium,), lights=lights, world_temperature=KELVIN
    )


def blocks(image):
    """Means of 4 x 3 blocks of an image of 16 x 12 pixels."""
    return image.reshape(3, 4, 4, 4).mean(axis=(1, 3)).ravel()


def excess_of_passes(of):
    """(passes, 12) excess radiance of blocks in each pass."""
    totals = [np.zeros(12)]
    render(of, SETTINGS, lambda film: totals.append(blocks(film.radiance().astype(float)) * film.passes))
    return np.diff(totals, axis=0) - band_radiance(EDGES, KELVIN).sum()


@pytest.mark.parametrize("scattering", [0.4, long(2.0)])
def test_a_mirror_throws_light_into_fog_as_an_image_of_the_light_would(scattering):
    """The method of images: beams in fog, what they light, all orders of scattering and the plate, which gets the beam
    and the fog's light. Within 4 standard errors in each of 12 blocks; a tenth, or less, where the beam is."""
    ours, images = (excess_of_passes(build(scattering)) for build in (before_a_mirror, without_the_mirror))
    (mean, error), (truth, of_truth) = ((x.mean(axis=0), x.std(axis=0, ddof=1) / len(x) ** 0.5) for x in (ours, images))
    both, bright = np.hypot(error, of_truth), truth > truth.mean()
    print(f"scattering {scattering}: ratios {mean / truth} +- {both / truth}")
    assert np.all(abs(mean - truth) <= 4.0 * both)  # no pass may have met the fog at the edge of a block
    assert np.median((both / truth)[bright]) < 0.1


def test_points_tell_the_light_along_a_way():
    """Their sum is the integral of what is left of the power along the way in fog and half a metre around it, in each
    band, whether it scatters or not: within 4 standard errors. Photons that met no mirror, or that no light sent, leave
    none. Points know how far the surface is where the way ends."""
    count, depth, reach, power = 4000, 3.0, 0.5, np.array([2.0, 1.0, 0.5], np.float32)
    edges = np.array([3.0, 4.0, 5.0, 6.0])
    absorption = np.array([[3.0, 0.1], [4.0, 0.1], [4.001, 1.0], [6.0, 1.0]])
    scattering = np.array([[3.0, 0.3], [4.0, 0.3], [4.001, 2.0], [5.0, 2.0], [5.001, 0.0], [6.0, 0.0]])
    vertices, triangles = box((2.0, 2.0, depth))
    medium = Medium("fog", absorption, KELVIN, scattering, 0.0, vertices - (1.0, 1.0, 0.0), triangles)
    lamp = PointLight(np.array((0.0, 0.0, -1.0)), 10.0, temperature=1500.0)
    lit = make_scene(
        *quad((0, 0, 9), (1, 0, 0), (0, 1, 0)), KELVIN, [MIRROR], look((0, -5, 0), (0, 0, 0)), edges,
        media=(medium,), lights=(lamp,), world_temperature=KELVIN,
    )  # fmt: skip
    model = prepare(lit, Settings(photons_per_pass=1000))
    centre = model.stage.surfaces.corners.of().reshape(-1, 3).mean(axis=0) - (0.0, 0.0, 9.0)  # of solver coordinates
    wave = empty_wave(count, 3, False)
    wave.origin[:], wave.direction[:], wave.power[:] = centre - (0.0, 0.0, 10.0), (0.0, 0.0, 1.0), power
    wave.origin[:, 0] += 0.1  # not where two triangles meet
    wave.photon[:], wave.arrival[:] = np.arange(count), -1
    wave.chain[:] = OF_LIGHT | MIRRORED | STRAIGHT_FROM_LIGHT
    wave.chain[: count // 4], wave.chain[count // 4 : count // 2] = OF_LIGHT | STRAIGHT_FROM_LIGHT, MIRRORED
    hits = model.tracer.trace(wave.origin, wave.direction)
    throwing = model.throwing._replace(reach=reach, left=[])
    air = model.tracer.cross(wave.origin, wave.direction, hits.distance)
    leave_points(model.tracer, hits, air, wave, (np.uint64(3), 1), throwing)
    (points,) = throwing.left
    assert len(points.straight) == 4 * count // 2 and points.straight.all()
    each = points.power.reshape(-1, 4, 3).sum(axis=1, dtype=float)
    extinction = np.array([0.4, 3.0, 1.0])
    left = np.exp(-extinction * depth)
    truth = power * (reach + (1.0 - left) / extinction + reach * left)
    error = each.std(axis=0, ddof=1) / len(each) ** 0.5
    print(each.mean(axis=0) / truth, error / truth)
    assert np.all(abs(each.mean(axis=0) - truth) < 4.0 * error) and np.all(error < 0.03 * truth)
    assert np.all(points.height[:, 0] > 0.0)
    np.testing.assert_allclose(points.height[:, 1], 9.0 + centre[2] - points.position[:, 2], atol=1e-4)
    np.testing.assert_allclose(points.normal[:, 1], np.broadcast_to((0.0, 0.0, -1.0), (len(each) * 4, 3)), atol=1e-6)
    found = build_thrown_map(points, 50, reach, 0.5)
    order, again = np.lexsort(points.position.T), np.lexsort(found.points.position.T)
    np.testing.assert_array_equal(points.power[order], found.points.power[again])


def test_threads_leave_no_trace():
    settings = replace(SETTINGS, passes=2)
    of = [render(before_a_mirror(0.4), replace(settings, threads=count)).radiance() for count in (1, 2)]
    np.testing.assert_array_equal(*of)
