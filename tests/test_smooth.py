# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that are shaded smooth, by the normals at the corners of their triangles."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Material, SceneError, Settings, render
from addon.solver.camera.first_hits import first_hit_images
from addon.solver.geometry.interaction import Interaction
from addon.solver.physics.lobes import (
    Lobes,
    adjoint,
    evaluate_diffuse,
    evaluate_glossy,
    glossy_density,
    sample_specular,
)
from tests.helpers.marks import long
from tests.helpers.scenes import box, join, look, make_scene, sphere

pytestmark = pytest.mark.once

EDGES = np.array([8.0, 9.0, 12.0])
GLOSSY = 2


def leaning(degrees, view=(0.3, 0.2, -1.0)):
    """An Interaction whose shading normal leans so far from the normal (0, 0, 1), towards +x."""
    angle, incoming = np.radians(degrees), np.asarray(view) / np.linalg.norm(view)
    up, shading = (0.0, 0.0, 1.0), (float(np.sin(angle)), 0.0, float(np.cos(angle)))
    cosine = max(1e-6, -float(np.dot(incoming, shading)))
    lean = 1.0 if degrees == 0 else float(np.cos(angle))
    return Interaction(
        0, 0, (0.0, 0.0, 0.0), up, shading, lean, 0, 0.0, 0.0, tuple(incoming), cosine, -float(incoming[2]), 1.0
    )


def hemisphere(count):
    """(n, 3) cosine-distributed directions, evenly spread."""
    u, v = (np.arange(count) + 0.5) / count, (np.arange(count) * 0.6180339887498949) % 1.0
    r, turn = np.sqrt(1.0 - u), 2.0 * np.pi * v
    return np.column_stack((r * np.cos(turn), r * np.sin(turn), np.sqrt(u)))


@pytest.mark.parametrize("degrees", [0, 0.2, 1, 5, 11, 25, 45, 70, 83])
def test_diffuse_brdf_keeps_the_energy(degrees):
    """The mean over even light is 1, to what 20,000 directions tell, and nothing comes through the back."""
    at, ways = leaning(degrees), hemisphere(20_000)
    brdf = np.array([evaluate_diffuse(at, tuple(way)) for way in ways])
    error = 0.25 * brdf.std() / len(ways) ** 0.5  # a quarter of that of random directions, as these are even
    assert abs(brdf.mean() - 1.0) < 3e-4 + error and brdf.min() >= 0.0
    assert degrees == 0 or evaluate_diffuse(at, (0.6, 0.0, -0.8)) == 0.0


@pytest.mark.parametrize("degrees", [2, 11, 25])
def test_diffuse_brdf_is_that_of_the_turned_surface(degrees):
    """Where light falls well above the triangle it is s.w / n.w, times what makes up for the rest. At the edge of what
    the triangle receives it stays finite, so a triangle just before the light's horizon is as dark as its neighbour
    beyond it."""
    at, ways = leaning(degrees), hemisphere(2000)
    ways = ways[(ways[:, 2] > 0.7) & (ways[:, 0] < 0.0)]
    ratio = [evaluate_diffuse(at, tuple(way)) * way[2] / np.dot(way, at.shading_normal) for way in ways]
    assert max(ratio) / min(ratio) < 1.0 + 1e-9 and 1.0 <= min(ratio) < 1.0 + np.tan(np.radians(degrees))
    edge = (np.sqrt(1.0 - 1e-6), 0.0, 1e-3)
    assert evaluate_diffuse(at, edge) < 1.25 / at.lean * max(ratio) + 1e-9


@pytest.mark.parametrize(
    "degrees, view",
    [
        (11, (0.3, 0.2, -1)),
        long(25, (1, 0, -0.2)),
        long(25, (-1, 0, -0.3)),
        (40, (-1, 0.3, -0.1)),
    ],
)
@pytest.mark.parametrize("alpha", [long(0.05), 0.3])
def test_rough_lobe_draws_what_it_evaluates(degrees, view, alpha):
    """The weights of directions that are drawn are f cos / density, all directions lie above the triangle, and the
    density is one: its integral over the hemisphere is the chance to be drawn, within 4 standard errors."""
    at, lobes = leaning(degrees, view), Lobes(GLOSSY, 1.0, alpha)
    rng = np.random.default_rng(5)
    samples = [sample_specular(lobes, at, *rng.random(2)) for _ in range(4000)]
    drawn = [sample for sample in samples if sample.weight > 0.0]
    for sample in drawn[:200]:
        assert np.linalg.norm(sample.direction) == pytest.approx(1.0, abs=1e-9) and sample.direction[2] > 0.0
    inside = np.mean([sample.weight > 0.0 and abs(sample.direction[0]) < 0.5 for sample in samples])
    ways = hemisphere(100_000)
    density = np.array([glossy_density(lobes, at, tuple(way)) for way in ways]) * np.pi / ways[:, 2]
    density *= np.abs(ways[:, 0]) < 0.5
    assert abs(inside - density.mean()) < 4 * np.hypot(0.5 / len(samples) ** 0.5, density.std() / len(ways) ** 0.5)
    weight = np.array([sample.weight for sample in samples])
    albedo = np.array([evaluate_glossy(lobes, at, tuple(way)) for way in ways]) * np.pi
    error = np.hypot(weight.std() / len(samples) ** 0.5, albedo.std() / len(ways) ** 0.5)
    assert abs(weight.mean() - albedo.mean()) < 4 * error


@pytest.mark.parametrize("degrees, towards", [(8, (0.3, 0.4, 0.86)), (15, (-0.5, 0.1, 0.85)), (25, (0.2, -0.4, 0.9))])
def test_photons_see_the_brdf_that_the_camera_sees(degrees, towards):
    """What a rough lobe reflects of a photon into a part of the hemisphere is the integral there of the BRDF between
    each direction, as the viewer's, and where the photon comes from. Within 4 standard errors; with alpha .2, so far
    from the horizon, less than .01 would be reflected through the triangle, where camera paths turn back."""
    lobes, rng = Lobes(GLOSSY, 1.0, 0.2), np.random.default_rng(7)
    towards = np.array(towards) / np.linalg.norm(towards)
    at = leaning(degrees, -towards)
    drawn = [sample_specular(lobes, at, *rng.random(2)) for _ in range(20_000)]
    ways = hemisphere(40_000)
    brdf = np.array([evaluate_glossy(lobes, leaning(degrees, -way), tuple(towards)) for way in ways]) * np.pi
    for name, part in {"all": lambda way: way[2] > 0.3, "aside": lambda way: way[0] > 0.3}.items():
        reflected = np.array([each.weight * adjoint(at, each.direction) * part(each.direction) for each in drawn])
        expected = np.array([value * part(way) for value, way in zip(brdf, ways, strict=True)])
        error = np.hypot(reflected.std() / len(drawn) ** 0.5, expected.std() / len(ways) ** 0.5)
        print(f"{name}: {reflected.mean():.4f} for {expected.mean():.4f} +- {error:.4f}")
        assert abs(reflected.mean() - expected.mean()) < 4 * error + 0.01


def globe(segments, rings):
    """Vertices, triangles and corner normals of a sphere of radius 1 with so many meridians and rings of faces."""
    polar, around = np.pi * np.arange(rings + 1) / rings, 2.0 * np.pi * np.arange(segments) / segments
    vertices = np.array([(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for t in polar for p in around])
    a = np.arange(rings * segments).reshape(rings, segments)
    b = np.roll(a, -1, axis=1)
    upper, lower = np.stack((a, a + segments, b), -1)[1:], np.stack((b, a + segments, b + segments), -1)[:-1]
    triangles = np.concatenate((upper.reshape(-1, 3), lower.reshape(-1, 3))).astype(np.int32)
    return vertices, triangles, vertices[triangles].astype(np.float32)


def with_normals(scene, *normals):
    """The scene with normals of its first triangles, part by part; the others are flat."""
    given = np.concatenate(normals)
    flat = np.zeros((len(scene.triangles) - len(given), 3, 3), np.float32)
    return dataclasses.replace(scene, corner_normals=np.concatenate((given, flat)))


EYE = np.array((1.0, -4.0, 2.0))


def in_gradient(vertices, triangles, material, eye=EYE):
    """Such an object in a large black shell that is 330 K above and 270 K below, as K of z, seen from a point."""
    shell, faces = sphere(4, 100.0)
    points, all_triangles, _, index = join((vertices, triangles, 300.0, 0), (shell, faces[:, ::-1], 300.0, 1))
    kelvin = 300.0 + 0.3 * points[all_triangles][:, :, 2]
    kelvin[: len(triangles)] = 300.0
    materials, camera = [material, Material("black", 1.0)], look(eye, (0, 0, 0), 96, 96, 0.3)
    scene = make_scene(points, all_triangles, 300.0, materials, camera, EDGES, index)
    return dataclasses.replace(scene, temperature=kelvin.astype(np.float32))


def camera_rays(camera, across=8):
    """Unit directions (height, width, across^2, 3) spread evenly over each pixel of a camera."""
    matrix, (left, right, bottom, top) = np.asarray(camera.matrix), camera.frame
    x, y = ((np.arange(across * size) + 0.5) / (across * size) for size in (camera.width, camera.height))
    x, y = np.meshgrid(left + x * (right - left), bottom + y * (top - bottom))
    ways = np.stack((x, y, -np.ones_like(x)), -1) @ matrix[:3, :3].T
    ways = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
    pixels = ways.reshape(camera.height, across, camera.width, across, 3).swapaxes(1, 2)
    return pixels.reshape(camera.height, camera.width, across**2, 3)


def surrounded(mask):
    """The pixels of a mask whose eight neighbours are in it, too."""
    inner = np.zeros_like(mask)
    height, width = mask.shape
    shifted = [mask[i : height - 2 + i, j : width - 2 + j] for i in range(3) for j in range(3)]
    inner[1:-1, 1:-1] = np.all(shifted, axis=0)
    return inner


def reflected_temperature(ways, eye, side=1.0):
    """K that a mirror sphere of radius 1 shows in unit directions (..., 3) from a point, in the gradient of
    in_gradient, NaN beside it; and the height z at which the reflected ray crosses the sphere again. side: -1 for its
    inner side, behind."""
    along = ways @ eye
    with np.errstate(invalid="ignore"):
        point = eye - (along + side * np.sqrt(along**2 - eye @ eye + 1.0))[..., None] * ways
    out = ways - 2.0 * np.sum(ways * point, -1)[..., None] * point
    ahead = np.sum(point * out, -1)
    end = point + (np.sqrt(ahead**2 + 100.0**2 - 1.0) - ahead)[..., None] * out
    return 300.0 + 0.3 * end[..., 2], (point - 2.0 * ahead[..., None] * out)[..., 2]


def test_a_smooth_mirror_sphere_reflects_as_a_sphere():
    """A mirror of 16 x 8 faces in a world of 60 K from top to bottom, against the exact sphere in its place, in all
    pixels that are filled by both: rms error at most a tenth of the facets', no pixel further off than 2 K."""
    vertices, triangles, normals = globe(16, 8)
    scene = in_gradient(vertices, triangles, Material("mirror", 0.0, specular=1.0))
    settings = Settings(passes=1, reference_temperature=300.0)
    flat = render(scene, settings).temperature().astype(float)
    smooth = render(with_normals(scene, normals), settings).temperature().astype(float)
    seen = first_hit_images(with_normals(scene, normals), ("position", "normal"))
    position = seen["position"].astype(float)
    on_it = np.linalg.norm(position, axis=-1) < 1.01
    radial = position / np.linalg.norm(position, axis=-1, keepdims=True)
    np.testing.assert_allclose(seen["normal"][on_it], radial[on_it], atol=0.03)  # between corners 11 degrees away
    exact = reflected_temperature(camera_rays(scene.camera), EYE)[0].mean(axis=-1)
    inside = surrounded(on_it) & np.isfinite(exact)
    errors = {name: (image - exact)[inside] for name, image in (("flat", flat), ("smooth", smooth))}
    rms = {name: np.sqrt(np.mean(error**2)) for name, error in errors.items()}
    print(f"rms flat {rms['flat']:.2f} K, smooth {rms['smooth']:.2f} K, at most {np.abs(errors['smooth']).max():.2f} K")
    assert np.count_nonzero(inside) > 0.9 * np.count_nonzero(on_it)  # but for the outermost pixels
    assert rms["smooth"] < 0.1 * rms["flat"] and np.abs(errors["smooth"]).max() < 2.0


@pytest.mark.parametrize("turned", [False, True])
def test_a_hollow_mirror_reflects_as_a_sphere(turned):
    """The bottom of a sphere, up to z = -0.7, seen from above, askew: its triangles lie before the mirror that they
    stand for. Left out is where it shows itself, or nearly so."""
    vertices, triangles, normals = globe(16, 8)
    below = vertices[triangles][:, :, 2].max(axis=1) < -0.7
    triangles, normals = triangles[below], normals[below]
    if turned:
        triangles, normals = triangles[:, ::-1], -normals[:, ::-1]
    eye = np.array((1.0, -2.0, 3.0))
    scene = in_gradient(vertices, triangles, Material("mirror", 0.0, specular=1.0), eye)
    settings = Settings(passes=1, reference_temperature=300.0)
    flat = render(scene, settings).temperature().astype(float)
    smooth = render(with_normals(scene, normals), settings).temperature().astype(float)
    on_it = np.linalg.norm(first_hit_images(scene, ("position",))["position"], axis=-1) < 1.01
    exact, again = reflected_temperature(camera_rays(scene.camera), eye, -1.0)
    exact, inside = exact.mean(axis=-1), surrounded(on_it) & (again.min(axis=-1) > -0.6)
    rms = [np.sqrt(np.mean((image - exact)[inside] ** 2)) for image in (flat, smooth)]
    worst = np.abs((smooth - exact)[inside]).max()
    print(f"{np.count_nonzero(inside)} pixels: rms flat {rms[0]:.2f} K, smooth {rms[1]:.2f} K, at most {worst:.2f} K")
    assert rms[1] < 0.1 * rms[0] and worst < 2.0


LOBES = {"diffuse": (0.0, 0.0), "mirror": (1.0, 0.0), "rough": (1.0, 0.4), "both": (0.5, 0.3)}


@pytest.mark.parametrize("specular, roughness", LOBES.values(), ids=LOBES)
@pytest.mark.parametrize("reference", [None, 250.0])
def test_a_room_of_one_temperature_is_black(specular, roughness, reference):
    """With smooth surfaces of any lobe in it: exactly with T0 there, else the mean within 4 standard errors."""
    room, faces = box((3.0, 3.0, 3.0))
    vertices, triangles, normals = globe(8, 4)
    material = Material("smooth", 0.3, specular=specular, roughness=roughness)
    mesh = join((0.7 * vertices + 1.4, triangles, 300.0, 0), (room, faces[:, ::-1], 300.0, 1))
    scene = make_scene(
        *mesh[:3], [material, Material("wall", 0.6)], look((0.3, 0.3, 0.8), (1.4, 1.4, 1.4)), EDGES, mesh[3]
    )
    kelvin = []
    film = render(
        with_normals(scene, normals), Settings(passes=12, photons_per_pass=20_000, reference_temperature=reference),
        lambda film: kelvin.append(float(film.radiance().sum()) * film.passes),
    )  # fmt: skip
    if reference is None:
        np.testing.assert_allclose(film.temperature(), 300.0, atol=1e-4)
        return
    passes = np.diff([0.0, *kelvin])
    truth = render(dataclasses.replace(scene, materials=(Material("a", 1.0), Material("b", 1.0))), Settings(passes=1))
    error = passes.std(ddof=1) / len(passes) ** 0.5
    assert abs(passes.mean() - truth.radiance().sum()) < 4 * error + 1e-6 * truth.radiance().sum()


def test_normals_without_a_direction_are_refused():
    vertices, triangles, normals = globe(8, 4)
    scene = make_scene(vertices, triangles, 300.0, [Material()], look((0, -4, 0), (0, 0, 0)), EDGES)
    normals[3, 1] = np.nan
    with pytest.raises(SceneError, match="Triangle 3"):
        dataclasses.replace(scene, corner_normals=normals)
    with pytest.raises(SceneError, match=r"corner_normals has shape \(5, 3, 3\)"):
        dataclasses.replace(scene, corner_normals=normals[:5])


def test_normals_of_triangles_themselves_change_nothing():
    """A flat surface given with normals, or with none for any triangle: the same image to the last bit."""
    scene = in_gradient(*globe(8, 4)[:2], Material("rough", 0.3, specular=0.6, roughness=0.3))
    settings = Settings(passes=2, photons_per_pass=5000)
    corners = np.asarray(scene.vertices, float)[scene.triangles]
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own = np.repeat(own[:, None], 3, axis=1).astype(np.float32)
    flat = render(scene, settings).radiance()
    for normals in (own, 0.0 * own):
        given = render(dataclasses.replace(scene, corner_normals=normals), settings)
        assert np.array_equal(flat, given.radiance())
