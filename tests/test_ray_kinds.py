# SPDX-License-Identifier: GPL-3.0-or-later
"""What is hidden from rays of some kinds (scene.Hidden): camera, diffuse, glossy, and those to light objects.

Which rays pass what is said from the eye on, as the path tracer of helpers/path_tracer.py goes; photons go the other
way, and shadow rays and rays of final gathers share what they find. All must come to the same.
"""

import dataclasses

import numpy as np
import pytest

from addon.solver import Material, Medium, PointLight, SceneError, Settings, Sky, render
from addon.solver.geometry.segments import FROM_CAMERA, FROM_DIFFUSE, FROM_GLOSSY, TO_LIGHT
from addon.solver.geometry.surfaces import build_geometry
from addon.solver.physics.spectrum import band_radiance
from addon.solver.scene import Hidden
from tests.helpers.marks import long
from tests.helpers.path_tracer import standard_error, trace_paths
from tests.helpers.scenes import join, look, make_scene, quad, sphere

EDGES = np.array([8.0, 10.0, 12.0])
MATERIALS = (
    Material("grey", 0.5),
    Material("black", 1.0),
    Material("mirror", 0.2, specular=1.0),
    Material("rough", 0.2, specular=1.0, roughness=0.3),
    Material("both", 0.3, specular=0.5, roughness=0.4),
    Material("film", 0.2, transmittance=0.7),
    Material("glazed", 0.6, specular=0.1, fresnel=True),
)
GREY, BLACK, MIRROR, ROUGH, BOTH, FILM, GLAZED = range(len(MATERIALS))
NONE, EVERY = Hidden(0), Hidden.DIFFUSE | Hidden.GLOSSY
FLOAT32 = 3e-6  # of radiance: the film's image is summed in float32


def scene_of(*parts, camera, **options):
    """Parts (vertices, triangles, kelvin, material, Hidden)."""
    vertices, triangles, temperature, material = join(*(part[:4] for part in parts))
    hidden = np.concatenate([np.full(len(part[1]), int(part[4]), np.uint8) for part in parts])
    return make_scene(vertices, triangles, temperature, MATERIALS, camera, EDGES, material, hidden=hidden, **options)


def plate(centre, half_u, half_v, kelvin, material, hidden=NONE):
    return (*quad(centre, half_u, half_v), kelvin, material, hidden)


def ball(centre, radius, kelvin, material, hidden=NONE):
    vertices, triangles = sphere(2, radius)
    return vertices + centre, triangles, kelvin, material, hidden


def bench(seed, lobe=GREY, **options):
    """A floor, a wall of two lobes, a mirror and a rough plate around a hot ball, with a screen between; the seed draws
    which rays pass what. lobe: material of the floor."""
    rng = np.random.default_rng(seed)

    def flags():
        return Hidden(int(rng.integers(0, 8)) << 1)

    parts = [
        plate((0, 0, 0), (2, 0, 0), (0, 2, 0), 300.0, lobe),
        plate((0, 1.5, 1), (1.5, 0, 0), (0, 0, 1), 290.0, BOTH, flags()),
        plate((-1.2, 0, 0.8), (0, 1, 0), (0, 0, 0.8), 300.0, MIRROR, flags()),
        plate((1.2, 0, 0.8), (0, 1, 0), (0.2, 0, 0.8), 310.0, ROUGH, flags()),
        ball((0.1, 0.1, 0.9), 0.15, rng.uniform(500, 900), BLACK, flags()),
        plate((0.1, 0.1, 0.45), (0.3, 0, 0), (0, 0.3, 0), 280.0, GREY, flags()),
        ball((0.5, -0.5, 0.5), 0.2, 320.0, GREY, flags()),
    ]
    if "film" in options:
        parts.append(plate((0, 0.5, 0.9), (1.0, 0, 0), (0, 0.3, 0.5), 305.0, FILM, flags()))
        del options["film"]
    camera = look((0.3, -3.2, 2.2), (0, 0.2, 0.5), 16, 12)
    return scene_of(*parts, camera=camera, **({"world_temperature": 260.0} | options))


def check_against_paths(scene, passes, samples, photons=3000):
    """Means of six blocks of the picture against the path tracer, to 4 standard errors of both together, and these at
    most 2.5 % of the light that is reflected or the surroundings'."""
    settings, means = Settings(passes, photons, threads=2), []
    render(scene, settings, lambda film: means.append(film.passes * film.layer_means().reshape(12, 16, 2)))
    ours = np.diff(np.array([np.zeros_like(means[0]), *means]), axis=0)
    reference = render(scene, dataclasses.replace(settings, passes=1)).reference_temperature
    paths = trace_paths(scene, samples, batches=32, threads=2, reference=reference).images

    def by_block(images):
        return images.sum(axis=-1).reshape(len(images), 2, 6, 2, 8).mean(axis=(2, 4))

    ours, paths = by_block(ours), by_block(paths)
    error = np.hypot(standard_error(ours), standard_error(paths))
    difference = ours.mean(axis=0) - paths.mean(axis=0)
    print(np.round(difference / error, 1), np.round(error / np.abs(paths.mean(axis=0)), 4))
    assert (error < 0.025 * np.abs(paths.mean(axis=0)) + 0.01).all()
    assert (np.abs(difference) < 4.0 * error).all()


def test_a_mirror_does_not_show_what_is_hidden_from_it():
    """It shows what lies behind; the camera sees the plate itself as ever."""
    camera = look((0, 0, 3), (0, 0, 0), 4, 4, 0.05)
    half = (50, 0, 0), (0, 50, 0)
    parts = (
        plate((0, 0, 0), (5, 0, 0), (0, 5, 0), 300.0, MIRROR),
        plate((0, 0, 5), *half, 400.0, BLACK, Hidden.GLOSSY),
        plate((0, 0, 6), *half, 350.0, BLACK),
    )
    film = render(scene_of(*parts, camera=camera), Settings(2, 2000, threads=1))
    expected = 0.2 * band_radiance(EDGES, 300.0) + 0.8 * band_radiance(EDGES, 350.0)
    seen = np.stack(list(film.bands()), axis=-1) * np.diff(EDGES)
    np.testing.assert_allclose(seen, np.broadcast_to(expected, (4, 4, 2)), rtol=FLOAT32)


def test_what_is_hidden_from_diffuse_surfaces_does_not_heat_them():
    """A hot ball over a floor, which shows nothing of it; the mirror beside it does."""
    camera = look((0, 0, 3), (0, 0, 0), 8, 8, 0.05)
    parts = plate((0, 0, 0), (5, 0, 0), (0, 5, 0), 300.0, GREY), ball((1, 0, 1), 0.3, 900.0, BLACK, Hidden.DIFFUSE)
    scene = scene_of(*parts, camera=camera, world_temperature=300.0)
    np.testing.assert_allclose(render(scene, Settings(4, 2000, threads=1)).temperature(), 300.0, rtol=1e-6)


@pytest.mark.parametrize("flag", Hidden)
def test_an_isothermal_scene_stays_black(flag):
    scene = bench(1, world_temperature=300.0)
    temperature = np.full(len(scene.triangles), 300.0)
    scene = dataclasses.replace(scene, temperature=temperature, hidden=np.full(len(temperature), flag, np.uint8))
    scene.hidden[:2] = 0
    film = render(scene, Settings(2, 2000, threads=1))
    np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)
    assert film.photons == 0


LIGHTS = (PointLight(np.array((0.3, -0.2, 1.6)), 200.0, 0.05, 2500.0),)
AIR = Medium("air", 0.3, 330.0)
WARM = np.linspace(230.0, 300.0, 8)[:, None] * np.ones((1, 16))


@pytest.mark.once
@pytest.mark.parametrize(
    ("seed", "options"),
    [
        long(2, {}),
        long(3, {"lobe": BOTH}),
        long(4, {"lobe": GLAZED}),
        long(5, {"film": True}),
        long(6, {"media": (AIR,), "world_depth": 5.0}),
        long(7, {"media": (AIR,), "world_depth": 5.0, "film": True}),
        long(8, {"lights": LIGHTS, "lobe": BOTH}),
        long(9, {"lights": LIGHTS, "film": True}),
        long(10, {"sky": Sky(WARM)}),
        (11, {"sky": Sky(WARM), "film": True, "lobe": BOTH}),
    ],
)
def test_photons_and_rays_pass_what_paths_pass(seed, options):
    check_against_paths(bench(seed, **options), passes=48, samples=256)


def test_kinds_that_pass_the_same_share_a_tree():
    scene = bench(2)
    scene.hidden[:] = 0
    scene.hidden[-4:] = EVERY
    tracer = build_geometry(scene).tracer
    assert tracer.seen_from(FROM_CAMERA) is tracer and tracer.seen_from(TO_LIGHT) is tracer
    assert tracer.seen_from(FROM_DIFFUSE) is tracer.seen_from(FROM_GLOSSY) is not tracer
    assert tracer.hides


def test_where_gas_scatters_only_the_camera_passes():
    scene = bench(2, media=(Medium("fog", 0.1, 300.0, 0.2),), world_depth=5.0)
    shown = dataclasses.replace(scene, hidden=scene.hidden & np.uint8(Hidden.CAMERA))
    settings = Settings(2, 2000, threads=1)
    np.testing.assert_array_equal(render(scene, settings).temperature(), render(shown, settings).temperature())


def test_flags_that_do_not_exist_are_refused():
    scene = bench(2)
    with pytest.raises(SceneError, match="hidden holds 16; sums of Hidden are at most 15"):
        dataclasses.replace(scene, hidden=np.full(len(scene.triangles), 16, np.uint8))
