# SPDX-License-Identifier: GPL-3.0-or-later
"""What the middle of each pixel sees: positions, temperatures and emissivities that are known exactly."""

import dataclasses
import math

import numpy as np
import pytest

from addon.solver import Grid, Material, Medium, Response, Settings, first_hit_images, render
from addon.solver.camera.first_hits import FAR, QUANTITIES
from addon.solver.physics.sensors import WEIGHTING, band_weights, microbolometer
from addon.solver.physics.spectrum import band_radiance, faintest, planck, sensor_radiance
from addon.solver.physics.transmission import transmittance
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0, 14.0])
FLOAT32 = 2.0**-22  # relative to the largest length that takes part: a few roundings of float32
GREY = Material("Grey", emissivity=0.8)
CURVE = np.array([[8.0, 0.2], [10.0, 0.9], [14.0, 0.3]])  # um, emissivity


def floor(camera, temperature=300.0, material=GREY, **options):
    """A square of 4 m in the plane z = 0. temperature: K, for both triangles or at each corner of them."""
    vertices, triangles = quad((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    scene = make_scene(vertices, triangles, 0.0, [material], camera, EDGES, **options)
    temperature = np.broadcast_to(np.float32(temperature), (2,) if np.ndim(temperature) == 0 else (2, 3))
    return dataclasses.replace(scene, temperature=np.array(temperature))


def room(camera, **options):
    """A box of 2 x 3 x 4 m around the origin, each triangle with a temperature of its own."""
    vertices, triangles = box((2.0, 3.0, 4.0))
    return make_scene(vertices - (1.0, 1.5, 2.0), triangles, 300.0 + np.arange(12), [GREY], camera, EDGES, **options)


CAMERAS = {
    "perspective": look((0.3, -0.4, 0.2), (-0.5, 0.9, -0.3), 40, 30),
    "shifted": dataclasses.replace(look((0.3, -0.4, 0.2), (-0.5, 0.9, -0.3), 40, 30), frame=(-0.2, 0.7, 0.1, 0.8)),
    "orthographic": dataclasses.replace(
        look((0.3, -0.4, 0.2), (-0.5, 0.9, -0.3), 40, 30), kind="ORTHOGRAPHIC", frame=(-0.4, 0.4, -0.3, 0.3)
    ),
    "panorama": dataclasses.replace(
        look((0.3, -0.4, 0.2), (-0.5, 0.9, -0.3), 40, 20), kind="PANORAMA", frame=(-np.pi, np.pi, -1.57, 1.57)
    ),
}


def in_camera(camera, position):
    """Points (h, w, 3) of the world in camera space."""
    return (position.astype(float) - camera.matrix[:3, 3]) @ camera.matrix[:3, :3]


def in_frame(camera, position):
    """Pixels (h, w, 2) from the frame's lower left that points of the world are at."""
    x, y, z = np.moveaxis(in_camera(camera, position), -1, 0)
    if camera.kind == "PERSPECTIVE":
        x, y = x / -z, y / -z
    elif camera.kind == "PANORAMA":
        x, y = np.arctan2(x, -z), np.arcsin(y / np.sqrt(x * x + y * y + z * z))
    left, right, bottom, top = camera.frame
    return np.stack(((x - left) / (right - left) * camera.width, (y - bottom) / (top - bottom) * camera.height), -1)


# Where ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", CAMERAS)
def test_positions_are_on_the_surface_in_the_middle_of_the_pixel(kind):
    camera = CAMERAS[kind]
    position = first_hit_images(room(camera), ["position"])["position"]
    assert position.shape == (camera.height, camera.width, 3) and position.dtype == np.float32
    to_walls = np.abs(np.abs(position) - (1.0, 1.5, 2.0))
    np.testing.assert_allclose(to_walls.min(axis=-1), 0.0, atol=4.0 * FLOAT32)
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    # a position errs by some roundings, of the 4 m that are around; a pixel is at least 7 mm there
    np.testing.assert_allclose(in_frame(camera, position), np.stack((x, y), -1), atol=4.0 * FLOAT32 / 0.007)


@pytest.mark.parametrize("kind", CAMERAS)
def test_depth_is_along_the_view_axis_and_in_panoramas_the_distance(kind):
    images = first_hit_images(room(CAMERAS[kind]), ["depth", "position"])
    seen = in_camera(CAMERAS[kind], images["position"])
    expected = np.linalg.norm(seen, axis=-1) if kind == "panorama" else -seen[..., 2]
    np.testing.assert_allclose(images["depth"], expected, atol=4.0 * FLOAT32)


@pytest.mark.parametrize("kind", CAMERAS)
def test_normals_face_the_camera_whichever_side_is_seen(kind):
    """Some of the box's triangles are seen from behind."""
    camera = CAMERAS[kind]
    images = first_hit_images(room(camera), ["normal", "position"])
    to_walls = np.abs(np.abs(images["position"]) - (1.0, 1.5, 2.0))
    axis = np.argmin(to_walls, axis=-1)[..., None]
    inward = np.zeros_like(images["normal"])
    np.put_along_axis(inward, axis, -np.sign(np.take_along_axis(images["position"], axis, -1)), -1)
    np.testing.assert_allclose(images["normal"], inward, atol=FLOAT32)


def test_a_sphere_has_each_position_on_the_triangle_that_is_named():
    vertices, triangles = sphere(2, radius=1.5)
    scene = make_scene(vertices, triangles, 300.0, [GREY], look((0, -6, 1), (0, 0, 0), 48, 36), EDGES)
    numbers = np.arange(len(triangles))
    images = first_hit_images(scene, ["position", "normal", "depth"], {"number": numbers})
    hit = images["depth"] < FAR
    assert 100 < np.count_nonzero(hit) < hit.size
    a, b, c = np.moveaxis(vertices[triangles[images["number"][hit].astype(int)]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    point = images["position"][hit]
    assert np.abs(((point - a) * normal).sum(axis=1)).max() < 1.5 * FLOAT32
    np.testing.assert_allclose(images["normal"][hit], normal, atol=FLOAT32)
    inner = np.abs((vertices[triangles].mean(axis=1) * normals(vertices, triangles)).sum(axis=1)).min()
    radius = np.linalg.norm(point, axis=1)
    assert inner - 1.5 * FLOAT32 < radius.min() and radius.max() < 1.5 * (1.0 + FLOAT32)


def normals(vertices, triangles):
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def test_surroundings_are_far_and_else_nothing():
    camera = look((0.0, -6.0, 0.1), (0.0, 0.0, 3.0), 16, 12)  # above the horizon
    images = first_hit_images(floor(camera), QUANTITIES, {"number": np.array([7, 8])})
    sky = images["depth"] == np.float32(FAR)
    assert sky[-1].all() and np.isfinite(images["emissivity"]).all()
    for name, image in images.items():
        assert name == "depth" or (image[sky] == (1.0 if name == "transmittance" else 0.0)).all()


def test_a_window_is_a_part_of_the_whole():
    camera = CAMERAS["perspective"]
    part = dataclasses.replace(camera, window=(5, 7, 31, 22))
    whole, cut = (first_hit_images(room(each), QUANTITIES) for each in (camera, part))
    for name in QUANTITIES:
        np.testing.assert_array_equal(cut[name], whole[name][7:22, 5:31])


def test_what_is_out_of_focus_is_seen_sharp():
    camera = CAMERAS["perspective"]
    blurred = dataclasses.replace(camera, lens_radius=0.5, focus_distance=0.3, blades=5)
    sharp, same = (first_hit_images(room(each), QUANTITIES) for each in (camera, blurred))
    for name in QUANTITIES:
        np.testing.assert_array_equal(same[name], sharp[name])


def test_what_is_clipped_is_not_seen():
    camera = dataclasses.replace(look((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 8, 6, tangent=0.3), clip=(0.1, 4.9))
    assert (first_hit_images(floor(camera), ["depth"])["depth"] == np.float32(FAR)).all()
    camera = dataclasses.replace(camera, clip=(0.1, 5.1))
    np.testing.assert_allclose(first_hit_images(floor(camera), ["depth"])["depth"], 5.0, rtol=FLOAT32)


def test_images_are_the_same_for_any_number_of_threads():
    camera = dataclasses.replace(CAMERAS["panorama"], width=300, height=150)  # several pieces of work
    one, three = (first_hit_images(room(camera), QUANTITIES, threads=threads) for threads in (1, 3))
    for name in QUANTITIES:
        np.testing.assert_array_equal(one[name].view(np.uint32), three[name].view(np.uint32))


def test_cancelled_it_looks_at_nothing_more():
    images = first_hit_images(room(CAMERAS["perspective"]), ["depth"], cancelled=lambda: True)
    assert (images["depth"] == np.float32(FAR)).all()


# What -----------------------------------------------------------------------------------------------------------------


def test_temperatures_between_corners_are_linear():
    """T = 300 K + 10 K/m x - 20 K/m y on the floor."""
    vertices, triangles = quad((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    kelvin = 300.0 + vertices @ (10.0, -20.0, 0.0)
    scene = floor(look((0.5, -1.0, 2.0), (0.0, 0.0, 0.0), 20, 15), kelvin[triangles])
    images = first_hit_images(scene, ["surface_temperature", "position"])
    hit = images["surface_temperature"] > 0.0
    expected = 300.0 + images["position"][hit].astype(float) @ (10.0, -20.0, 0.0)
    # roundings of the temperature itself, and of the position
    tolerance = 400.0 * 2.0**-24 + 20.0 * 4.0 * FLOAT32
    np.testing.assert_allclose(images["surface_temperature"][hit], expected, atol=tolerance)


def test_a_mirror_shows_its_own_temperature_and_emissivity():
    mirror = Material("Mirror", emissivity=0.05, specular=1.0)
    camera = look((0.0, -1.0, 3.0), (0.0, 0.0, 0.0), 8, 6)
    hot = quad((0.0, 3.0, 2.0), (2.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    plate = quad((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    vertices, triangles, kelvin, material = join((*plate, 293.15, 0), (*hot, 600.0, 1))
    scene = make_scene(vertices, triangles, kelvin, [mirror, GREY], camera, EDGES, material)
    images = first_hit_images(scene, ["surface_temperature", "emissivity"])
    assert (images["surface_temperature"] == np.float32(293.15)).all()
    np.testing.assert_allclose(images["emissivity"], 0.05, rtol=FLOAT32)


def test_of_triangles_that_lie_on_each_other_the_first_is_seen():
    scene = floor(look((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 8, 6), 300.0)
    scene = dataclasses.replace(
        scene,
        triangles=scene.triangles[[0, 0, 1, 1]],
        material=np.array([0, 1, 1, 0], np.int32),
        temperature=np.array([300.0, 310.0, 320.0, 330.0], np.float32),
        materials=(GREY, Material("Dark", emissivity=0.3)),
    )
    images = first_hit_images(scene, ["surface_temperature", "emissivity"], {"number": np.array([5, 6, 7, 8])})
    assert set(images["number"].ravel()) == {5.0, 7.0}
    first = images["number"] == 5.0
    assert (images["surface_temperature"] == np.where(first, np.float32(300.0), np.float32(320.0))).all()
    np.testing.assert_allclose(images["emissivity"], np.where(first, 0.8, 0.3), rtol=FLOAT32)


def weighted(kelvin, response):
    """Emissivity of CURVE at a temperature, by the trapezoidal rule: sum of w_b times the band's radiance."""
    emitted = most = 0.0
    for weight, low, high in zip(band_weights(response, EDGES), EDGES[:-1], EDGES[1:], strict=True):
        wavelength = np.linspace(low, high, 20_001)
        black = planck(wavelength, kelvin)
        middles = 0.5 * (black[1:] + black[:-1])
        emissivity = np.interp(0.5 * (wavelength[1:] + wavelength[:-1]), *CURVE.T)
        emitted += weight * (high - low) * (middles * emissivity).mean()
        most += weight * (high - low) * middles.mean()
    return emitted / most


@pytest.mark.parametrize("kelvin", [120.0, 293.15, 2000.0])
@pytest.mark.parametrize("response", [None, microbolometer(), Response("Edge", np.array([[8.0, 0.0], [9.0, 1.0]]))])
def test_emissivity_is_weighted_with_the_response_and_the_surfaces_own_spectrum(kelvin, response):
    material = Material("Curve", emissivity=CURVE)
    scene = floor(look((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 4, 3), kelvin, material, response=response)
    image = first_hit_images(scene, ["emissivity"])["emissivity"]
    np.testing.assert_allclose(image, weighted(float(np.float32(kelvin)), response), rtol=1e-6)  # float32, and the rule


@pytest.mark.parametrize("kelvin", [0.0, 1e-3, 3.0])
def test_emissivity_of_what_is_too_cold_to_send_anything_is_finite(kelvin):
    scene = floor(look((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 4, 3), kelvin, Material("Curve", emissivity=CURVE))
    image = first_hit_images(scene, ["emissivity"])["emissivity"]
    np.testing.assert_allclose(image, weighted(faintest(8.0), None), rtol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 60.0, 80.0])
@pytest.mark.parametrize("material", [
    Material("Gloss", emissivity=0.3, specular=1.0, roughness=0.8),
    Material("Half", emissivity=CURVE, specular=0.5, roughness=0.5),
    GREY,
])  # fmt: skip
def test_emissivity_times_a_blackbody_is_what_the_renderer_sees(material, angle):
    """A plate alone in space at 0 K reflects nothing: its image is what it emits in the camera's direction."""
    angle = np.radians(angle)
    camera = look((0.0, -5.0 * np.sin(angle), 5.0 * np.cos(angle)), (0.0, 0.0, 0.0), 4, 3)
    camera = dataclasses.replace(camera, kind="ORTHOGRAPHIC", frame=(-0.02, 0.02, -0.015, 0.015))
    scene = floor(camera, 320.0, material)
    images = first_hit_images(scene, ["surface_temperature", "emissivity"])
    black = sensor_radiance(EDGES, np.ones(3), images["surface_temperature"])
    film = render(scene, Settings(passes=1, photons_per_pass=100, reference_subtraction=False))
    np.testing.assert_allclose(images["emissivity"] * black, film.radiance(), rtol=2e-6)  # sums of float32
    if material.alpha and angle > 1.0:
        flat = floor(camera, 320.0, dataclasses.replace(material, specular=0.0))
        assert images["emissivity"].min() > 1.02 * first_hit_images(flat, ["emissivity"])["emissivity"].max()


# Through gas ----------------------------------------------------------------------------------------------------------


def slab(low, high, width=10.0, **medium):
    """A gas between two heights, m."""
    vertices, triangles = box((width, width, high - low))
    return Medium("gas", vertices=vertices + (-width / 2, -width / 2, low), triangles=triangles, **medium)


def through(*media, height=3.0, target=(0.0, 0.0, 0.0), **options):
    """The transmittance between a camera above the floor and what it sees; all pixels see nearly the same."""
    scene = floor(look((0.0, 0.0, height), target, 4, 3, tangent=1e-3), media=media, **options)
    return first_hit_images(scene, ["transmittance"])["transmittance"]


def test_without_gas_all_is_let_through():
    assert (through() == 1.0).all()


def test_media_let_through_what_bouguers_law_says():
    """Absorption and scattering alike, in 1 m and 0.5 m before the floor, of which 0.25 m overlap; what lies behind the
    floor does not count."""
    one = slab(1.0, 2.0, absorption=0.3, scattering=0.2, temperature=500.0)
    other = slab(0.75, 1.25, absorption=0.4, temperature=300.0)
    behind = slab(-2.0, -1.0, absorption=5.0, temperature=300.0)
    np.testing.assert_allclose(through(one, other, behind), math.exp(-0.5 - 0.2), rtol=2e-6)


def test_the_air_before_a_distant_camera_counts():
    air = Medium("air", 0.01, 300.0)
    np.testing.assert_allclose(through(air, height=500.0), math.exp(-5.0), rtol=1e-5)  # positions in float32


def test_the_sky_is_seen_through_the_depth_of_the_air():
    air = Medium("air", 0.05, 300.0)
    seen = through(air, slab(4.0, 5.0, absorption=0.5, temperature=300.0), target=(0.0, 0.0, 9.0), world_depth=40.0)
    np.testing.assert_allclose(seen, math.exp(-2.0 - 0.5), rtol=2e-6)


def test_cells_let_through_by_their_density():
    """Layers of cells 0.25 m high, of which two hold gas."""
    density, transform = np.zeros((4, 4, 8), np.float32), np.diag((2.5, 2.5, 0.25, 1.0))
    density[:, :, 2], density[:, :, 5], transform[:3, 3] = 1.0, 0.5, (-5.0, -5.0, 0.5)
    cells = Medium("cells", 1.2, 400.0, 0.4, grid=Grid.from_arrays(transform, density))
    np.testing.assert_allclose(through(cells), math.exp(-1.6 * 0.25 * 1.5), rtol=2e-6)


def test_species_in_cells_let_through_what_they_do_in_a_mesh():
    """CO2 at one temperature, 1 m of it: by as many draws as these take, both are within 1 %."""
    cells, transform = np.full((8, 8, 8), 0.1, np.float32), np.diag((1.25, 1.25, 0.125, 1.0))
    transform[:3, 3] = -5.0, -5.0, 0.5
    grid = Grid.from_arrays(transform, fractions={"CO2": cells})
    mesh = slab(0.5, 1.5, gas={"CO2": 0.1}, temperature=600.0)
    np.testing.assert_allclose(through(Medium("cells", temperature=600.0, grid=grid)), through(mesh), rtol=0.01)


@pytest.mark.parametrize("response", [None, microbolometer()])
def test_bands_count_as_the_sensor_sees_a_blackbody(response):
    """A coefficient that is constant in each band."""
    points = [(8.0, 0.1), (9.9999999, 0.1), (10.0, 1.0), (11.9999999, 1.0), (12.0, 0.3), (14.0, 0.3)]
    gas = slab(0.0, 2.0, absorption=np.array(points), temperature=400.0)
    signal = band_weights(response, EDGES) * band_radiance(EDGES, WEIGHTING)
    expected = np.average(np.exp(-2.0 * np.array([0.1, 1.0, 0.3])), weights=signal)
    np.testing.assert_allclose(through(gas, response=response), expected, rtol=2e-6)


def test_molecules_let_the_mean_over_the_spectrum_through():
    """Malkmus' law over wavenumbers without any draw, for 290 m of air; a unit of the scene is 100 m. Two slabs of the
    same gas are one: what the first has taken of the spectrum, the second cannot take again."""
    air = {"gas": {"H2O": 0.012, "CO2": 4.2e-4}, "temperature": 293.0, "metres": 100.0}
    wavelength = np.linspace(EDGES[0], EDGES[-1], 20_001)
    whole = slab(0.0, 2.9, **air)
    expected = np.average(transmittance(whole, wavelength, 2.9), weights=planck(wavelength, WEIGHTING))
    assert 0.7 < expected < 0.95
    one = through(whole)
    np.testing.assert_allclose(one, expected, rtol=2e-3)  # of 341 draws
    np.testing.assert_allclose(through(slab(0.0, 1.0, **air), slab(1.0, 2.9, **air)), one, rtol=1e-6)


def test_the_transmittance_is_the_share_of_a_walls_light_that_arrives():
    """A black floor at the temperature that weighs the bands, seen through gas too cold to shine."""
    scene = floor(
        look((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), 4, 3, tangent=1e-3), WEIGHTING, Material("Black", 1.0),
        media=(slab(0.0, 1.0, absorption=np.array([[8.0, 0.1], [14.0, 2.0]]), temperature=1.0),), world_temperature=1.0,
    )  # fmt: skip
    seen = render(scene, Settings(passes=1, photons_per_pass=100, reference_subtraction=False)).radiance()
    whole = sensor_radiance(EDGES, np.ones(3), np.float64(WEIGHTING))
    np.testing.assert_allclose(first_hit_images(scene, ["transmittance"])["transmittance"], seen / whole, rtol=2e-6)
