# SPDX-License-Identifier: GPL-3.0-or-later
"""Direct light by shadow rays and what shares it: lights and hot parts against closed forms, through the whole render;
where shadow rays go; and whose caustics photons find.

A flat floor at 0 K under a 0 K sky shows nothing but the direct light it reflects, L = rho E / pi. Tolerances are 4
standard errors of the mean (from the spread of the passes), which are themselves bounded, and 0.1 % for how far E is
from linear over the 4 cm that the camera looks at.
"""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from addon.solver import AreaLight, Camera, Material, PointLight, Settings, SpotLight, SunLight, render
from addon.solver.camera.shadow_rays import Lighting, direct_irradiance, lamp_points
from addon.solver.geometry.segments import hidden_from_lobes
from addon.solver.geometry.surfaces import build_geometry, unit_normal
from addon.solver.geometry.triangles import Corners, areas
from addon.solver.photons.lights import light_spectrum
from addon.solver.physics.lobes import ggx_albedo, interpolate_albedo
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning import lamps
from addon.solver.planning.preparation import prepare
from addon.solver.sampling.heuristics import BEST
from addon.solver.sampling.rng import CACHE, pass_key
from addon.solver.sampling.rng import LAMPS as LAMP_POINTS
from tests.helpers.marks import long
from tests.helpers.paper_estimator import changed, lights_alone
from tests.helpers.path_tracer import trace_paths
from tests.helpers.scenes import box, join, look, make_scene, mean_and_error, quad, sphere, stored_photons

pytestmark = pytest.mark.once

EDGES = np.array([8.0, 10.0, 12.0])
GREY, BLACK = Material("grey", 0.5), Material("black", 1.0)
MIRROR = Material("mirror", 0.2, specular=1.0)
HOT = 900.0  # K
LINEAR = 0.001
DOWN = np.array([0.0, 0.0, -1.0])


def ball(centre, radius):
    """An icosphere with the surface, so the mean projected area, of a sphere of this radius (Cauchy)."""
    vertices, triangles = sphere(3)
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return vertices * radius * math.sqrt(4 * math.pi / area) + centre, triangles


FLOOR = (*quad((0, 0, 0), (10, 0, 0), (0, 10, 0)), 0.0, 0)


def above(spot, half):
    """The square of the floor with its middle at (x, y) and these half sides (m), from 0.4 m above."""
    frame = (-half, half, -half, half)
    return Camera(6, 6, look((*spot, 0.4), (*spot, 0.0)).matrix, "ORTHOGRAPHIC", frame=frame)


def floor_scene(spot, *parts, materials=(GREY, BLACK, MIRROR), half=0.02, **options):
    vertices, triangles, temperature, material = join(FLOOR, *parts)
    return make_scene(vertices, triangles, temperature, materials, above(spot, half), EDGES, material, **options)


def irradiance(scene, passes=64, photons=2000, reference=0.0):
    """Irradiance of the floor in the picture, W m-2 over all bands, and its standard error: E = pi L / rho.

    reference: T0, K; at that of floor and sky only the lamps have an excess.
    """
    settings = Settings(passes=passes, photons_per_pass=photons, reference_temperature=reference)
    mean, error = mean_and_error(scene, settings)
    return math.pi * mean / 0.5, math.pi * error / 0.5


def agree(scene, truth, most=0.005, **settings):
    value, error = irradiance(scene, **settings)
    print(f"{value / truth - 1:+.3%} +- {error / truth:.3%}")
    assert error < most * truth
    assert abs(value - truth) < 4 * error + LINEAR * truth


def band_power(light):
    """What of 1 W, or 1 W/m2, of a light lies in the bands."""
    return light_spectrum(light, EDGES).sum()


# Lights


def round_irradiance(light, spot, intensity):
    """Irradiance of the floor at (x, y), W m-2, from a sphere of radiance I(direction) / (pi r^2): a fine sum over the
    cone that it fills. intensity(cosine): I, W/sr, under an angle from the axis DOWN.
    """
    towards = np.asarray(light.position) - (*spot, 0.0)
    distance = np.linalg.norm(towards)
    towards = towards / distance
    across = np.cross(towards, (0.6, 0.64, 0.48))
    across /= np.linalg.norm(across)
    n = 600
    height = 1 - (1 - math.sqrt(1 - (light.radius / distance) ** 2)) * (np.arange(n)[:, None] + 0.5) / n
    angle = 2 * math.pi * (np.arange(n) + 0.5) / n
    sine = np.sqrt(1 - height**2)
    direction = height[..., None] * towards + (sine * np.cos(angle))[..., None] * across
    direction += (sine * np.sin(angle))[..., None] * np.cross(towards, across)
    solid_angle = 2 * math.pi * (1 - math.sqrt(1 - (light.radius / distance) ** 2))
    cosine = np.maximum(direction[..., 2], 0.0)
    radiance = intensity(direction[..., 2]) / (math.pi * light.radius**2)
    return solid_angle * np.mean(cosine * radiance)


@pytest.mark.parametrize("spot", [(0.0, 0.0), (1.5, -0.7)])
@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_point_light(radius, spot):
    """E = Phi cos / (4 pi d^2), for a sphere as for a point (Lambertian sphere: F = (r / d)^2 cos)."""
    light = PointLight(np.array([0.2, 0.1, 2.0]), 1000.0, radius)
    towards = light.position - (*spot, 0.0)
    distance = np.linalg.norm(towards)
    truth = 1000.0 * towards[2] / (4 * math.pi * distance**3) * band_power(light)
    agree(floor_scene(spot, lights=(light,)), truth, passes=200)


def test_point_light_that_the_horizon_cuts():
    """A sphere half below the floor's plane: only what is above lights it."""
    light = PointLight(np.array([1.5, 0.0, 0.05]), 1000.0, 0.3)
    truth = round_irradiance(light, (0.0, 0.0), lambda cosine: 1000.0 / (4 * math.pi)) * band_power(light)
    flat = 1000.0 * 0.05 / (4 * math.pi * 1.5**3) * band_power(light)
    assert truth > 1.05 * flat  # the case differs from that of a whole sphere
    agree(floor_scene((0.0, 0.0), lights=(light,)), truth, passes=400)


def spot_intensity(light, cosine):
    """W/sr: the cone holds the power; smoothstep in the cosine over the outer `blend` of it, whose mean is 1/2."""
    outer = math.cos(0.5 * light.cone_angle)
    t = np.clip((cosine - outer) / ((1 - outer) * max(light.blend, 1e-9)), 0.0, 1.0)
    share = t * t * (3 - 2 * t) if light.blend > 0 else np.where(cosine >= outer, 1.0, 0.0)
    return light.power * share / (2 * math.pi * (1 - outer) * (1 - 0.5 * light.blend))


@pytest.mark.parametrize("x", [0.0, 0.6, 1.0])  # the cone ends at 2 tan 0.5 = 1.09; blend 0.5 begins at 0.75
@pytest.mark.parametrize("radius", [0.0, 0.15])
@pytest.mark.parametrize("blend", [0.5, *map(long, (0.0, 1.0))])
def test_spot_light(blend, radius, x):
    light = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, 1000.0, 1.0, blend, radius)
    if radius > 0:
        truth = round_irradiance(light, (x, 0.0), lambda cosine: spot_intensity(light, cosine))
    else:
        around = x + 0.02 * (np.arange(40) + 0.5) / 20 - 0.02  # smoothstep is not linear over the picture
        cosine = 2 / np.hypot(2.0, around)
        truth = np.mean(spot_intensity(light, cosine) * cosine**3) / 4.0
    agree(floor_scene((x, 0.0), lights=(light,)), truth * band_power(light), passes=200)


@pytest.mark.parametrize("blend", [0.0, 0.5])
def test_spot_light_ends_with_its_cone(blend):
    light = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, 1000.0, 1.0, blend)
    assert irradiance(floor_scene((1.2, 0.0), lights=(light,)), passes=4)[0] == 0.0


@pytest.mark.parametrize("ellipse", [False, True])
@pytest.mark.parametrize("spot", [(0.0, 0.0), (0.8, -0.5)])
def test_area_light(spot, ellipse):
    """E = (M / pi) integral of cos cos / d^2 over the light, by a fine sum; it is tilted and not square."""
    axis_u, axis_v = np.array([0.5, 0.0, 0.1]), np.array([-0.02, 0.3, 0.1])
    light = AreaLight(np.array([0.1, 0.0, 1.0]), axis_u, axis_v, 300.0, ellipse)
    n = 400
    a = 2 * (np.arange(n) + 0.5) / n - 1
    a, b = (grid.ravel() for grid in np.meshgrid(a, a))
    if ellipse:
        a, b = a[a**2 + b**2 < 1], b[a**2 + b**2 < 1]
    normal = np.cross(axis_v, axis_u)
    normal /= np.linalg.norm(normal)
    towards = light.position + a[:, None] * axis_u + b[:, None] * axis_v - (*spot, 0.0)
    distance = np.linalg.norm(towards, axis=1)
    factor = np.mean(towards[:, 2] * np.maximum(-towards @ normal, 0.0) / (math.pi * distance**4))
    agree(floor_scene(spot, lights=(light,)), 300.0 * factor * band_power(light))


def test_area_light_shines_from_one_face():
    away = AreaLight(np.array([0.0, 0.0, 1.0]), np.array([0.5, 0, 0]), np.array([0, -0.5, 0]), 300.0)
    assert irradiance(floor_scene((0.0, 0.0), lights=(away,)), passes=4)[0] == 0.0


def grid_irradiance(light, spot):
    """Irradiance of the floor at (x, y), W m-2, from an area light through its grid, by a fine sum over the light:
    what 1 - tan x / tan a of Lambert's law brings, over the share 1 - a / tan a of the power that this leaves."""
    n, half = 400, 0.5 * light.spread
    a, b = (grid.ravel() for grid in np.meshgrid(*2 * [2 * (np.arange(n) + 0.5) / n - 1]))
    normal = np.cross(light.axis_v, light.axis_u)
    normal /= np.linalg.norm(normal)
    towards = light.position + a[:, None] * light.axis_u + b[:, None] * light.axis_v - (*spot, 0.0)
    distance = np.linalg.norm(towards, axis=1)
    cosine = -towards @ normal / distance
    passed = np.maximum(1.0 - np.tan(np.arccos(cosine)) / math.tan(half), 0.0) / (1.0 - half / math.tan(half))
    return light.power * np.mean(passed * cosine * towards[:, 2] / (math.pi * distance**3))


def below_a_mirror(light, spot):
    """The floor, and a mirror 1 m above it, from which the light comes that shines upwards."""
    ceiling = (*quad((0, 0, 1), (3, 0, 0), (0, 3, 0)), 0.0, 2)
    return floor_scene(spot, ceiling, lights=(light,))


def mirrored(light):
    """Where a mirror 1 m above the floor shows the light."""
    flip = np.array([1.0, 1.0, -1.0])
    turned = {name: flip * getattr(light, name) for name in ("axis_u", "direction") if hasattr(light, name)}
    if hasattr(light, "axis_v"):
        turned["axis_u"], turned["axis_v"] = light.axis_v * flip, turned["axis_u"]  # a mirror swaps left and right
    return replace(light, position=flip * light.position + (0, 0, 2), **turned)


# The middle of the light, 1 m above; from 0.42 m on a light of 20 degrees and half a width of 0.24 m sends nothing
@pytest.mark.parametrize(
    ("degrees", "spot"), [(150.0, (0.5, 0.2)), (90.0, (0.0, 0.0)), (90.0, (0.5, 0.0)), (20.0, (0.2, 0.1))]
)
def test_area_light_through_a_grid(degrees, spot):
    light = AreaLight(
        np.array([0.0, 0.0, 1.0]), np.array([0.2, 0, 0]), np.array([0, 0.1, 0]), 300.0, spread=math.radians(degrees)
    )
    agree(floor_scene(spot, lights=(light,)), grid_irradiance(light, spot) * band_power(light), passes=200)


def test_area_light_sends_nothing_beyond_its_spread():
    light = AreaLight(
        np.array([0.0, 0.0, 1.0]), np.array([0.2, 0, 0]), np.array([0, 0.1, 0]), 300.0, spread=math.radians(20.0)
    )
    assert irradiance(floor_scene((0.42, 0.0), lights=(light,)), passes=4)[0] == 0.0


@pytest.mark.long
def test_photons_of_an_area_light_leave_through_its_grid():
    """By way of a mirror, where photons find the light, it brings what its mirror image would."""
    light = AreaLight(
        np.array([0.0, 0.0, 0.5]), np.array([0.1, 0, 0]), np.array([0, -0.1, 0]), 300.0, spread=math.radians(60.0)
    )
    truth = 0.8 * grid_irradiance(mirrored(light), (0.3, 0.0)) * band_power(light)
    agree(below_a_mirror(light, (0.3, 0.0)), truth, most=0.02, passes=100, photons=50_000)


def square_intensity(light, way):
    """W/sr of a square spot along ways (n, 3) that need no unit length: as of a round one, at the angle across the
    nearest side, over the power that the fading rim leaves, by a fine sum over the square that the beam lights."""
    n, half = 2000, 0.5 * light.cone_angle
    x = math.tan(half) * (2 * (np.arange(n) + 0.5) / n - 1)

    def share(farther):
        cosine, outer = 1.0 / np.sqrt(1.0 + farther**2), math.cos(half)
        t = np.clip((cosine - outer) / ((1 - outer) * max(light.blend, 1e-12)), 0.0, 1.0)
        return t * t * (3 - 2 * t)

    u, v = np.meshgrid(x, x)
    held = np.sum(share(np.maximum(abs(u), abs(v))) / (1 + u * u + v * v) ** 1.5) * (x[1] - x[0]) ** 2
    axis = light.direction / np.linalg.norm(light.direction)
    side = np.cross(axis, light.square) / np.linalg.norm(np.cross(axis, light.square))
    along = way @ axis
    across = np.maximum(abs(way @ side), abs(way @ np.cross(axis, side))) / along
    return light.power * np.where(along > 0.0, share(across), 0.0) / held


# The beam ends at 2 tan 0.5 = 1.09 across a side, and in its corners at 1.54; blend 0.5 begins at 0.75
@pytest.mark.parametrize("spot", [(0.0, 0.0), (0.6, 0.9), (1.0, 1.0)])
@pytest.mark.parametrize("blend", [0.5, *map(long, (0.0, 1.0))])
def test_square_spot(blend, spot):
    light = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, 1000.0, 1.0, blend, square=np.array([1.0, 0.0, 0.0]))
    n = 40
    around = 0.04 * (np.arange(n) + 0.5) / n - 0.02  # smoothstep is not linear over the picture
    x, y = (grid.ravel() for grid in np.meshgrid(spot[0] + around, spot[1] + around))
    way = np.column_stack((x, y, np.full(n * n, -2.0)))
    cosine = 2.0 / np.linalg.norm(way, axis=1)
    truth = np.mean(square_intensity(light, way) * cosine**3) / 4.0
    agree(floor_scene(spot, lights=(light,)), truth * band_power(light), passes=200)


def test_square_spot_ends_with_its_square():
    light = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, 1000.0, 1.0, 0.5, square=np.array([1.0, 1.0, 0.0]))
    assert irradiance(floor_scene((1.2, 0.0), lights=(light,)), passes=4)[0] > 0.0  # a corner
    assert irradiance(floor_scene((0.8, 0.8), lights=(light,)), passes=4)[0] == 0.0


@pytest.mark.long
def test_photons_of_a_square_spot():
    """By way of a mirror, where photons find the light, it brings what its mirror image would, in a corner of it."""
    light = SpotLight(np.array([0.0, 0.0, 0.5]), -DOWN, 300.0, 1.0, 0.5, square=np.array([1.0, 0.0, 0.0]))
    spot = (0.6, 0.6)
    way = np.array([[*spot, -1.5]])
    truth = 0.8 * square_intensity(mirrored(light), way)[0] * 1.5 / np.linalg.norm(way) ** 3 * band_power(light)
    agree(below_a_mirror(light, spot), truth, most=0.02, passes=150, photons=50_000)


FLUSH = {  # lights that shine down, by their height (m)
    "rectangle": lambda z: AreaLight(np.array([1.7, 1.1, z]), np.array([0.3, 0, 0]), np.array([0, 0.2, 0]), 1000.0),
    "ellipse": lambda z: AreaLight(np.array([1.7, 1.1, z]), np.array([0.3, 0, 0]), np.array([0, 0.2, 0]), 1000.0, True),
    "spot": lambda z: SpotLight(np.array([1.7, 1.1, z]), DOWN, 1000.0, 2.0),
}


@pytest.mark.parametrize("turned", [False, long(True)])
@pytest.mark.parametrize("light", ["ellipse", *map(long, ("rectangle", "spot"))])
def test_light_flush_with_a_ceiling(light, turned):
    """It lights the room as one a millimetre lower does, to about that part of the room's height."""
    size = np.array([4.0, 3.0, 2.5])
    camera = look((1.5, 1.5, 1.2), (2.0, 1.5, 0.0))
    vertices, triangles = box(size)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0] if turned else np.eye(3)
    turn *= np.linalg.det(turn)
    around = np.eye(4)
    around[:3, :3] = turn

    def rendered(height):
        lamp = FLUSH[light](height)
        ways = {name: turn @ getattr(lamp, name) for name in ("axis_u", "axis_v", "direction") if hasattr(lamp, name)}
        lamp = replace(lamp, position=turn @ lamp.position, **ways)
        view = replace(camera, width=6, height=6, matrix=around @ camera.matrix)
        scene = make_scene(vertices @ turn.T, triangles, 0.0, [Material("grey", 0.4)], view, EDGES, lights=(lamp,))
        return mean_and_error(scene, Settings(passes=48, photons_per_pass=4000))

    (flush, flush_error), (lower, lower_error) = rendered(size[2]), rendered(size[2] - 0.001)
    assert max(flush_error, lower_error) < 0.005 * lower
    assert abs(flush - lower) < 4 * math.hypot(flush_error, lower_error) + 0.001 * lower


@pytest.mark.parametrize("slope, angle", [(0.0, 0.0), (0.0, 0.1), (0.0, 1.0), (0.0, 3.0), (1.2, 0.1), (1.2, 0.7)])
def test_sun_light(slope, angle):
    """E = S cos, exactly, while all of the disk is above the horizon."""
    light = SunLight(np.array([math.sin(slope), 0.0, -math.cos(slope)]), 500.0, angle)
    agree(floor_scene((0.0, 0.0), lights=(light,)), 500.0 * math.cos(slope) * band_power(light))


def test_lights_together():
    """The sum of lights of all kinds and of a hot ball, each with another spectrum."""
    spot = (0.3, 0.0)
    point = PointLight(np.array([1.0, 0.5, 1.5]), 200.0, 0.1, 1500.0)
    cone = SpotLight(np.array([0.0, 0.0, 2.0]), DOWN, 300.0, 1.0, 0.0, 0.0, 3000.0)
    sun = SunLight(np.array([0.5, 0.0, -1.0]), 800.0)
    towards = point.position - (*spot, 0.0)
    cosine = 2 / math.hypot(2.0, 0.3)
    truth = point.power * towards[2] / (4 * math.pi * np.linalg.norm(towards) ** 3) * band_power(point)
    truth += spot_intensity(cone, cosine) * cosine**3 / 4 * band_power(cone)
    truth += 800.0 / math.sqrt(1.25) * band_power(sun)
    scene = floor_scene(spot, (*ball((-0.8, 0.4, 1.2), 0.05), HOT, 1), lights=(point, cone, sun))
    towards = np.array((-0.8, 0.4, 1.2)) - (*spot, 0.0)
    truth += math.pi * band_radiance(EDGES, HOT).sum() * 0.05**2 * towards[2] / np.linalg.norm(towards) ** 3
    agree(scene, truth, most=0.01, passes=400)


# Small hot parts


def caustic_triangles(scene, reference=0.0):
    """Triangles with a side whose caustics photons find."""
    return np.unique(caustic_sides(prepare(scene, Settings(reference_temperature=reference))) >> 1)


def caustic_sides(model):
    """Sides whose caustics photons find."""
    return np.flatnonzero(model.lamps.caustic[model.stage.surfaces.sheet])


def sphere_factor(centre, radius, spot):
    """View factor of a sphere from a horizontal element: (r / d)^2 cos."""
    towards = np.asarray(centre, float) - (*spot, 0.0)
    return radius**2 * towards[2] / np.linalg.norm(towards) ** 3


@pytest.mark.parametrize("spot", [(0.0, 0.0), (0.9, 0.4)])
def test_hot_ball(spot):
    """E = pi L F, exact for a sphere of any size; over directions the mesh's projected area varies by 0.1 %."""
    scene = floor_scene(spot, (*ball((0.0, 0.0, 1.0), 0.2), HOT, 1))
    agree(scene, math.pi * band_radiance(EDGES, HOT).sum() * sphere_factor((0, 0, 1), 0.2, spot))


def test_cold_ball():
    """Under a warm sky a ball at 0 K takes light away: E = pi L (1 - F)."""
    spot = (0.3, 0.0)
    vertices, triangles, temperature, material = join(FLOOR, (*ball((0.0, 0.0, 1.0), 0.2), 0.0, 1))
    scene = make_scene(
        vertices, triangles, temperature, (GREY, BLACK), above(spot, 0.02), EDGES, material, world_temperature=300.0
    )  # fmt: skip
    sky = math.pi * band_radiance(EDGES, 300.0).sum()
    # the floor itself, 0 K, is a deficit too, but lights nothing: the ball reflects nothing
    agree(scene, sky * (1 - sphere_factor((0, 0, 1), 0.2, spot)), reference=300.0)


ROUGH = Material("rough", 0.1, specular=1.0, roughness=1.0)


def test_lamp_emits_by_direction():
    """A plate of a rough metal, edge on: its emissivity grows towards grazing angles, eps + rho (1 - albedo(theta)).

    Normal emission would be half of it. The plate is 2 cm at 0.8 m: one direction, to second order.
    """
    spot, centre = np.array([0.0, 0.0, 0.0]), np.array([0.15, 0.0, 0.8])
    plate = (*quad(centre, (0, 0.02, 0), (0, 0, 0.02)), HOT, 3)  # looks along +x and -x
    scene = floor_scene((0.0, 0.0), plate, materials=(GREY, BLACK, MIRROR, ROUGH))
    towards = centre - spot
    distance = np.linalg.norm(towards)
    cosine = towards[0] / distance
    albedo = interpolate_albedo(ggx_albedo(ROUGH.alpha)[None], 0, cosine)
    emissivity = 0.1 + 0.9 * (1 - albedo)
    assert emissivity > 2 * 0.1
    solid_angle = 0.04**2 * cosine / distance**2
    truth = emissivity * band_radiance(EDGES, HOT).sum() * solid_angle * towards[2] / distance
    agree(scene, truth)


@pytest.mark.parametrize("source", ["point", "area", "ball"])
def test_wall_hides_a_lamp(source):
    """Behind a black wall nothing arrives, to the last bit; beside it everything."""
    wall = (*quad((0, 0, 0.6), (0.5, 0, 0), (0, 0.5, 0)), 0.0, 1)
    lights = {
        "point": (PointLight(np.array([0.0, 0.0, 1.0]), 1000.0),),
        "area": (AreaLight(np.array([0.0, 0.0, 1.0]), np.array([0.1, 0, 0]), np.array([0, 0.1, 0]), 1000.0),),
        "ball": (),
    }[source]
    parts = (wall, (*ball((0, 0, 1), 0.1), HOT, 1)) if source == "ball" else (wall,)
    settings = Settings(passes=8, photons_per_pass=5000, reference_temperature=0.0)
    assert np.all(render(floor_scene((0.0, 0.0), *parts, lights=lights), settings).radiance() == 0.0)
    # the wall's shadow of the highest point of the ball ends at x = 0.5 * 1.1 / 0.5
    assert np.all(render(floor_scene((1.5, 0.0), *parts, lights=lights), settings).radiance() > 0.0)


def test_half_hidden_lamp():
    """A wall that hides exactly the half of an area light, by symmetry."""
    light = AreaLight(np.array([0.0, 0.0, 1.0]), np.array([0.2, 0, 0]), np.array([0, 0.2, 0]), 1000.0)
    wall = (*quad((0.5, 0, 0.6), (0.5, 0, 0), (0, 0.5, 0)), 0.0, 1)  # x > 0
    whole, error = irradiance(floor_scene((0.0, 0.0), lights=(light,)))
    half, half_error = irradiance(floor_scene((0.0, 0.0), wall, lights=(light,)), passes=1000)
    assert half_error < 0.01 * half
    # over the picture, 4 cm in x, the shadow's edge on the light runs symmetrically about its middle
    assert abs(2 * half - whole) < 4 * math.hypot(2 * half_error, error) + 2 * LINEAR * whole


# Lamps against photons


@pytest.mark.parametrize("source", ["ball", long("point")])
def test_caustic_of_a_mirror_counts_once(source):
    """Direct light by shadow rays plus that of the mirror image by photons: E = E_direct + rho E_image, over 60 cm.

    rho E_image is 1/8 of it, so the 1 % of standard error here are 8 % of the caustic.
    """
    spot, half = (0.9, 0.0), 0.3
    direct, image = (0.5, 0.0, 1.0), (2.5, 0.0, 1.0)
    mirror = (*quad((1.5, 0, 1.01), (0, 1.5, 0), (0, 0, 1.0)), 0.0, 2)
    radius = 0.1 if source == "ball" else 1.0
    steps = half * (2 * (np.arange(40) + 0.5) / 40 - 1)
    factor = [
        np.mean([[sphere_factor(centre, radius, (spot[0] + x, y)) for x in steps] for y in steps])
        for centre in (direct, image)
    ]
    if source == "ball":
        scene = floor_scene(spot, mirror, (*ball(direct, radius), HOT, 1), half=half)
        assert len(caustic_triangles(scene)) == 1280
        flux = math.pi * band_radiance(EDGES, HOT).sum()
    else:
        light = PointLight(np.array(direct), 1000.0)
        scene = floor_scene(spot, mirror, lights=(light,), half=half)
        flux = 1000.0 * band_power(light) / (4 * math.pi)
    agree(scene, flux * (factor[0] + 0.8 * factor[1]), passes=200, photons=30_000)


def room_with_stove(**options):
    """A closed room with a hot ball, a mirror on one wall, a rough metal plate and a hidden corner."""
    vertices, triangles = box((3.0, 2.5, 2.0))
    parts = (
        (vertices, triangles, 290.0, 0),
        (*ball((1.0, 1.2, 0.7), 0.12), 700.0, 1),
        (*quad((2.9, 1.25, 1.0), (0, 0.8, 0), (0, 0, 0.6)), 290.0, 2),
        (*quad((1.6, 1.2, 0.3), (0.3, 0, 0), (0, 0.3, 0)), 290.0, 3),
        (*quad((1.5, 0.6, 0.4), (0.4, 0, 0), (0, 0, 0.4)), 280.0, 0),
    )
    vertices, triangles, temperature, material = join(*parts)
    rough = Material("rough", 0.3, specular=0.6, roughness=0.6)
    camera = look((0.2, 0.2, 1.6), (2.0, 1.5, 0.3), 24, 18, 0.8)
    return make_scene(
        vertices, triangles, temperature, (GREY, BLACK, MIRROR, rough), camera, EDGES, material, **options
    )


@pytest.mark.long
@pytest.mark.parametrize("lights", [(), (PointLight(np.array([2.5, 0.5, 1.5]), 300.0, 0.05),)], ids=len)
def test_lamps_do_not_change_the_mean(lights):
    """The image's mean with shadow rays to all that emits, and with all light of surfaces by photons and rays, within 4
    standard errors."""
    scene = room_with_stove(lights=lights)
    mean, error = mean_and_error(scene, Settings(passes=16, photons_per_pass=30_000))
    with changed({"planning.preparation.build_lamps": lights_alone}):
        other, other_error = mean_and_error(scene, Settings(passes=64, photons_per_pass=30_000))
    print(f"{mean / other - 1:+.3%} +- {np.hypot(error, other_error) / mean:.3%}")
    assert np.hypot(error, other_error) < 0.002 * mean
    assert abs(mean - other) < 4 * np.hypot(error, other_error)


# Where shadow rays go


def slats():
    """As wide as the gaps between them, half a metre above the floor."""
    return [(*quad((0.08 * i, 0, 0.5), (0.02, 0, 0), (0, 1, 0)), 0.0, 1) for i in range(-12, 13)]


def judged(scene, reference=0.0):
    """The Model, and need, visible and met (by label of the sheet) and the variance, see _need; and what a shadow ray
    is worth, see _best_worth."""
    seen = {}

    def watched(name, function):
        def watch(*arguments):
            seen[name] = function(*arguments)
            return seen[name]

        return mock.patch.object(lamps, name, watch)

    with watched("_need", lamps._need), watched("_best_worth", lamps._best_worth):
        model = prepare(scene, Settings(reference_temperature=reference))
    return model, *seen["_need"], seen["_best_worth"]


def chances(model):
    """(t, 2) chances with which shadow rays go to the sides of triangles."""
    sides, surfaces = model.lamps.sides, model.stage.surfaces
    power = areas(surfaces.corners) * sides.exitance
    return power[:, None] * sides.factor[surfaces.sheet] / model.lamps.light_end[-1]


def densities(model):
    """(t, 2) m-2, lamp points that compete for a shadow ray, on each m2 of a side."""
    return model.lamps.sides.exitance[:, None] * model.lamps.share[model.stage.surfaces.sheet]


def by_part(model, *counts):
    """Chance with which shadow rays go to each part of a scene, whose triangles lie one behind the other: of the parts
    behind the floor, which have these numbers of triangles."""
    of_triangle = chances(model).sum(axis=1)
    assert len(of_triangle) == 2 + sum(counts)
    return np.add.reduceat(of_triangle, 2 + np.cumsum((0, *counts[:-1])))


def sheet_under(model, triangle):
    """Label of the sheet to which the side of a triangle that shadow rays are sent to belongs."""
    return model.stage.surfaces.sheet[triangle, np.argmax(chances(model)[triangle])]


def test_shadow_rays_to_a_lone_ball_leave_nothing_to_chance():
    """Nothing hides it and nothing else shines: a shadow ray finds what it looks for, and only how its candidates fall
    is random. What it is worth, in rays of a final gather, falls to the ball's triangles by their area, and the rest is
    left to those rays."""
    scene = floor_scene((0.0, 0.0), (*ball((0.0, 0.0, 1.0), 0.2), HOT, 1), half=0.3)
    model, need, visible, met, variance, worth_all = judged(scene)
    label = sheet_under(model, 2)
    assert visible[label] == 1.0 and variance < 1e-6
    worth = densities(model) * areas(model.stage.surfaces.corners)[:, None]
    assert np.count_nonzero(chances(model)) == 1280 and np.count_nonzero(worth) == 1280
    assert BEST / 4 <= worth_all <= BEST
    assert worth.sum() == pytest.approx(worth_all, rel=1e-5)
    np.testing.assert_allclose(densities(model)[worth > 0], worth_all / areas_of(scene, 2), rtol=0.01)
    # TYPICAL_RAYS F of those rays meet it: F = (r / d)^2 cos, on a floor of 0.6 m from 0.64 of what it is below it
    assert 0.5 * 256 * 0.2**2 < met[label] < 256 * 0.2**2
    assert model.lamps.found[label] == pytest.approx(met[label] ** 2 / (met[label] ** 2 + worth_all**2), rel=1e-3)
    # irradiance for each W, 1 / (4 pi d^2), without what those rays find of it
    assert need[label] == pytest.approx(1.0 / (4 * math.pi) / (1.0 + met[label]), rel=0.1)


def areas_of(scene, first):
    """m2 of all triangles from one on, together."""
    return areas(Corners(scene.vertices, scene.triangles[first:])).sum()


def test_shadow_rays_avoid_a_hidden_ball():
    """Of two alike, a lid hides one from all of the floor that is seen: it hardly counts, but is never left out."""
    seen, hidden = ball((-0.5, 0.0, 1.0), 0.1), ball((0.5, 0.0, 1.0), 0.1)
    lid = (*quad((0.5, 0, 0.8), (0.35, 0, 0), (0, 0.6, 0)), 0.0, 1)
    scene = floor_scene((0.0, 0.0), (*seen, HOT, 1), (*hidden, HOT, 1), lid, half=0.05)
    model, _, visible, _, variance, _ = judged(scene)
    assert visible[sheet_under(model, 2)] == 1.0
    assert visible[sheet_under(model, 2 + 1280)] < 0.001
    chances = by_part(model, 1280, 1280, 2)
    assert 0.0 < chances[1] < chances[0] / 64
    assert variance < 0.05


def test_shadow_rays_leave_out_the_side_of_a_plate_that_looks_away():
    """It is as near as the side that lights the floor, and no trial ray faces it. A mirror shows it, so it is not out
    of the question."""
    plate = (*quad((0, 0, 1), (0.2, 0, 0), (0, 0.2, 0)), HOT, 1)
    mirror = (*quad((0, 0, 3), (1, 0, 0), (0, 1, 0)), 0.0, 1)
    model = judged(floor_scene((0.0, 0.0), plate, mirror, half=0.3))[0]
    chance = chances(model).ravel()
    up = [chance[side] > 0 and unit_normal(model.stage.surfaces, side)[2] > 0 for side in range(chance.size)]
    assert 0.0 < chance[up].sum() < 0.01


def test_half_hidden_ball_leaves_half_to_chance():
    """Slats as wide as the gaps between them hide half of a ball: a shadow ray finds twice the mean or nothing."""
    scene = floor_scene((0.0, 0.0), (*ball((0.0, 0.0, 1.0), 0.2), HOT, 1), *slats(), half=0.3)
    model, _, visible, _, variance, _ = judged(scene)
    assert visible[sheet_under(model, 2)] == pytest.approx(0.5, abs=0.05)
    assert variance == pytest.approx(1.0, abs=0.15)


def test_hot_and_cold_balls_leave_their_difference_to_chance():
    """Two balls that give and take alike, at equal distances: a shadow ray brings all of the one or of the other, with
    either sign, so its variance is the square of what it brings. Both take half of them.

    The variance is of some 16 trial rays from each receiver, spread evenly over the lamps: up to 1 / 8 too large.
    """
    kelvin = np.linspace(300.0, 800.0, 50_001)
    radiance = band_radiance(EDGES, kelvin).sum(axis=1)
    reference, hot = 700.0, 800.0
    at = band_radiance(EDGES, reference).sum()
    cold = np.interp(2 * at - band_radiance(EDGES, hot).sum(), radiance, kelvin)
    vertices, triangles, temperature, material = join(
        (*FLOOR[:2], reference, 0), (*ball((-0.5, 0, 1), 0.1), hot, 1), (*ball((0.5, 0, 1), 0.1), cold, 1)
    )
    scene = make_scene(
        vertices, triangles, temperature, (GREY, BLACK), above((0.0, 0.0), 0.02), EDGES, material,
        world_temperature=reference,
    )  # fmt: skip
    model, _, visible, _, variance, worth_all = judged(scene, reference)
    np.testing.assert_allclose(by_part(model, 1280, 1280), 0.5, atol=0.01)
    assert 0.95 < variance < 1.15
    # which makes a shadow ray worth less than where nothing is left to chance
    assert worth_all < BEST
    worth = densities(model) * areas(model.stage.surfaces.corners)[:, None]
    assert worth.sum() == pytest.approx(worth_all, rel=1e-4)


def test_photons_and_shadow_rays_together_are_the_irradiance(monkeypatch):
    """Of cached points on a floor under a ball, of whose light both find a good part: F = (r / d)^2 cos, exactly.

    A part by photons, from all that fall on a square, and a part by shadow rays to random points of it, which are
    worth so many rays that both count. 4 standard errors.
    """
    monkeypatch.setattr(lamps, "_best_worth", lambda *_: 32.0)
    centre, radius, half = np.array((0.0, 0.0, 0.8)), 0.15, 0.3
    scene = floor_scene((0.0, 0.0), (*ball(centre, radius), HOT, 1), half=half)
    model = prepare(scene, Settings(reference_temperature=0.0))
    surfaces, middle = model.stage.surfaces, build_geometry(scene).centre
    rng, passes = np.random.default_rng(1), 16
    by_photons, by_shadows = np.zeros((2, passes))
    up = [int(unit_normal(surfaces, 2 * t)[2] < 0) for t in (0, 1)]
    for i in range(passes):
        for batch in stored_photons(model, 40_000, key=i + 1):
            within = np.all(np.abs(batch.position[:, :2] + middle[:2]) < half, axis=1) & (batch.surface >> 1 < 2)
            by_photons[i] += batch.power[within].sum() / (2 * half) ** 2
        point = np.column_stack((rng.uniform(-half, half, (2000, 2)), np.zeros(2000)))
        side_id = np.where(point[:, 1] > point[:, 0], 2 + up[1], up[0]).astype(np.int32)
        around = model.emitters.surroundings
        lit = lamp_points(model.lamps, model.stage, around, pass_key(i, 0, LAMP_POINTS))
        lighting = Lighting(around, model.lamps, lit, model.looking, 1, hidden_from_lobes(model.tracer))
        key = pass_key(i, 0, CACHE)
        told = direct_irradiance(
            model.stage, model.tracer, lighting, ((point - middle).astype(np.float32), side_id), key, 0
        )
        by_shadows[i] = told.sum(axis=1).mean()
    steps = half * (2 * (np.arange(200) + 0.5) / 200 - 1)
    x, y = np.meshgrid(steps, steps)
    factor = np.mean(radius**2 * centre[2] / (x**2 + y**2 + centre[2] ** 2) ** 1.5)
    truth = math.pi * band_radiance(EDGES, HOT).sum() * factor
    total = by_photons + by_shadows
    error = total.std(ddof=1) / math.sqrt(passes)
    print(
        f"photons {by_photons.mean() / truth:.3f}, shadow rays {by_shadows.mean() / truth:.3f}, +- {error / truth:.3%}"
    )
    assert min(by_photons.mean(), by_shadows.mean()) > 0.2 * truth
    assert error < 0.005 * truth
    assert abs(total.mean() - truth) < 4 * error + LINEAR * truth


@pytest.mark.parametrize("roughness", [0.15, *map(long, (0.4, 0.8))])
def test_rough_lobe_beside_a_hot_ball(roughness):
    """Rays of the lobe and shadow rays share the light of a ball that a rough plate shows, against a path tracer that
    knows rays of the lobe alone: each half of the picture, to 4 standard errors of both."""
    plate = (*quad((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), 300.0, 0)
    *parts, material = join(plate, (*ball((0.2, 0.1, 0.2), 0.06), HOT, 1))
    rough = Material("rough", 0.2, specular=0.8, roughness=roughness)
    camera = look((-0.5, -0.3, 0.4), (0.0, 0.0, 0.0), 8, 6, 0.3)
    scene = make_scene(*parts, (rough, BLACK), camera, EDGES, material, world_temperature=300.0)
    background = band_radiance(EDGES, 300.0).sum()
    traced = trace_paths(scene, 4000, batches=16, threads=2).images.sum(axis=-1)
    settings = Settings(passes=8, photons_per_pass=2000, reference_temperature=300.0)
    ours = [render(scene, replace(settings, seed=seed)).radiance() - background for seed in range(16)]
    halves = [np.asarray(images, float).reshape(16, 6, 2, 4).mean(axis=(1, 3)) for images in (traced, ours)]
    truth, found = (each.mean(axis=0) for each in halves)
    error = np.hypot(*(each.std(axis=0, ddof=1) / 4.0 for each in halves))
    print(found / truth - 1.0, error / truth, [each.std(axis=0, ddof=1) / 4.0 / truth for each in halves])
    assert np.all(error < 0.01 * truth)
    assert np.all(np.abs(found - truth) < 4 * error)


# Whose caustics photons find


def chosen(parts, target, position=(0.2, 0.2, 1.6)):
    """Triangles that throw caustics, with the automatic reference."""
    vertices, triangles, temperature, material = join(*parts)
    camera = look(position, target, 24, 18, 0.8)
    return caustic_triangles(make_scene(vertices, triangles, temperature, (GREY, BLACK), camera, EDGES, material), None)


WALLS = (*box((3.0, 2.5, 2.0)), 290.0, 0)


def test_small_hot_ball_in_a_room_throws_caustics():
    found = chosen((WALLS, (*ball((2.0, 1.2, 0.7), 0.12), 500.0, 1)), (2.0, 1.5, 0.3))
    assert np.array_equal(found, 12 + np.arange(1280))


def test_small_hot_ball_under_the_sky_throws_caustics():
    """The reference is the sky's or the ground's: with the ball's own every ray to the sky that it stops would err."""
    ground = (*quad((0, 0, 0), (5, 0, 0), (0, 5, 0)), 290.0, 0)
    vertices, triangles, temperature, _ = join(ground, (*ball((0, 0, 1), 0.15), 900.0, 0))
    camera = look((3, -3, 2), (0, 0, 0.3), 32, 24, 0.5)
    scene = make_scene(
        vertices, triangles, temperature, [Material("paint", 0.9)], camera, EDGES, world_temperature=250.0
    )
    assert np.array_equal(caustic_triangles(scene, None), 2 + np.arange(1280))


@pytest.mark.parametrize("hot", range(6))
def test_walls_of_a_room_throw_none(hot):
    temperature = np.repeat([330.0 if face == hot else 290.0 for face in range(6)], 2)
    vertices, triangles = box((3.0, 2.5, 2.0))
    scene = make_scene(vertices, triangles, temperature, [GREY], look((0.2, 0.2, 1.6), (2, 1.5, 0.3)), EDGES)
    assert caustic_triangles(scene, None).size == 0


def test_small_ball_of_little_power_throws_none():
    """Among walls of many temperatures its caustics would be lost."""
    vertices, triangles = box((3.0, 2.5, 2.0))
    temperature = np.repeat([280.0, 285.0, 290.0, 300.0, 310.0, 290.0], 2)
    walls = [(vertices, triangles[i : i + 1], temperature[i], 0) for i in range(12)]
    assert chosen((*walls, (*ball((2.0, 1.2, 0.7), 0.05), 320.0, 1)), (2.0, 1.5, 0.3)).size == 0


def test_inside_of_a_closed_ball_throws_none():
    """Neither seen from within, nor that side of a ball seen from without."""
    shell = (*ball((0.0, 0.0, 0.0), 1.0), 400.0, 0)
    patch = (*quad((0.0, 0.0, -0.5), (0.3, 0, 0), (0, 0.3, 0)), 290.0, 0)
    assert chosen((shell, patch), (0, 0, -0.5), position=(0.2, 0.1, 0.5)).size == 0
    vertices, triangles, temperature, material = join(WALLS, (*ball((2.0, 1.2, 0.7), 0.12), 500.0, 1))
    camera = look((0.2, 0.2, 1.6), (2.0, 1.5, 0.3), 24, 18, 0.8)
    scene = make_scene(vertices, triangles, temperature, (GREY, BLACK), camera, EDGES, material)
    sides = caustic_sides(prepare(scene, Settings()))
    corners = vertices[triangles[sides >> 1]]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards *= np.where(sides & 1, -1.0, 1.0)[:, None]
    assert np.all(np.sum(outwards * (corners.mean(axis=1) - (2.0, 1.2, 0.7)), axis=1) > 0)
