# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures and mixed materials that vary over triangles, by images or from corner to corner."""

import dataclasses

import numpy as np
import pytest

from addon.solver import Camera, Film, Material, SceneError, Settings, Texture, Textures, render
from addon.solver.camera.first_hits import first_hit_images
from addon.solver.geometry.interaction import emit_at
from addon.solver.geometry.stage import emission_at, nothing_emitted
from addon.solver.geometry.surfaces import build_surfaces
from addon.solver.geometry.textures import MATERIAL, build_textures, grain, mixed_share, temperature_in_image
from addon.solver.photons.emission import Batch, emit
from addon.solver.photons.wave import empty_wave
from addon.solver.physics.layers import scene_layers
from addon.solver.planning.preparation import prepare
from tests.helpers.path_tracer import black_radiance, standard_error
from tests.helpers.scenes import box, join, look, make_scene, pass_means, quad
from tests.helpers.traced_textures import build_painted, kelvin_at, mixed_at

pytestmark = pytest.mark.once

EDGES = np.array([8.0, 10.0, 12.0])
CORNERS = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32)  # uv of the triangles of a quad


def textures(*images, kelvin=-1, mixed=-1, share=(0.0, 0.0, 0.0), share_image=-1, uv=CORNERS):
    """Textures of the first triangles of a scene, which are all alike but for their uv (n, 3, 2)."""
    count = len(uv)
    index = [np.full(count, of, np.int32) for of in (kelvin, mixed, share_image)]
    corner_share = np.broadcast_to(np.float32(share), (count, 3)).copy()
    return Textures(
        np.arange(count, dtype=np.int32), np.float32(uv), index[0], index[1], corner_share, index[2], images
    )


def plate(materials, painted, width=8, height=8, kelvin=300.0):
    """A square of 2 m from straight above, every texel of an image of this size in a pixel of its own."""
    vertices, triangles = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    matrix = np.eye(4)
    matrix[2, 3] = 2.0
    camera = Camera(width, height, matrix, "ORTHOGRAPHIC", frame=(-1, 1, -1, 1))
    scene = make_scene(vertices, triangles, kelvin, materials, camera, EDGES, world_temperature=kelvin)
    return dataclasses.replace(scene, textures=painted)


def bands_of(scene, passes=2):
    """(height, width, b) radiance in each band, W m-2 sr-1."""
    film = render(scene, Settings(passes=passes, photons_per_pass=2_000, threads=1))
    return film.bands().transpose(1, 2, 0) * np.diff(EDGES)


def random_image(shape, extension="REPEAT", closest=True, low=280.0, high=420.0, seed=0):
    values = np.random.default_rng(seed).uniform(low, high, shape).astype(np.float32)
    return Texture(values, extension, closest)


def test_every_texel_is_seen():
    """Two triangles show each texel of an image at its own size, to the rounding of float32."""
    image = random_image((60, 50))
    scene = plate([Material("paint", 0.7)], textures(image, kelvin=0), 50, 60)
    expected = 0.7 * black_radiance(EDGES, image.values) + 0.3 * black_radiance(EDGES, 300.0)
    assert bands_of(scene) == pytest.approx(expected, rel=2e-6)


def test_a_large_image_is_seen():
    """2048 x 2048 texels on two triangles, each of which the middle of a pixel sees."""
    image = random_image((2048, 2048))
    scene = plate([Material("paint", 0.7)], textures(image, kelvin=0), 2048, 2048)
    seen = first_hit_images(scene, ("surface_temperature",), threads=2)["surface_temperature"]
    assert np.array_equal(seen, image.values)


@pytest.mark.parametrize("closest", [True, False])
@pytest.mark.parametrize("extension", ["REPEAT", "MIRROR", "EXTEND", "CLIP"])
def test_look_ups_agree_with_those_of_the_path_tracer(extension, closest):
    """At random points of random triangles, whose corners may lie far outside of the image: to float32's rounding of
    coordinates, in units of a texel."""
    random = np.random.default_rng(3)
    image = random_image((7, 5), extension, closest)
    shares = Texture(random.random((4, 9)).astype(np.float32), extension, closest)
    painted = textures(
        image, shares, kelvin=0, mixed=1, share=(0.1, 0.5, 0.9), share_image=1, uv=random.uniform(-2.5, 3.5, (40, 3, 2))
    )
    table, other = build_textures(painted, np.arange(50), 50), build_painted(painted, 50)
    unlike = 0
    for t in range(40):
        for u, v in random.dirichlet((1, 1, 1), 50)[:, :2]:
            kelvin, expected = temperature_in_image(table, t, u, v), kelvin_at(other, t, u, v)
            unlike += not (kelvin == -1.0 if np.isnan(expected) else abs(kelvin - expected) < 0.01)
            unlike += abs(mixed_share(table, t, u, v) - mixed_at(other, t, u, v)[1]) > 1e-4
    assert unlike <= 4  # of 4000, points that rounding takes over the edge of a texel or of the image


def test_where_an_image_is_clipped_the_surface_shows():
    image = Texture(np.full((2, 2), 400.0, np.float32), "CLIP", True)
    scene = plate([Material("paint", 1.0)], textures(image, kelvin=0, uv=2.0 * CORNERS), kelvin=310.0)
    seen = first_hit_images(scene, ("surface_temperature",))["surface_temperature"]
    expected = np.full((8, 8), 310.0)
    expected[:4, :4] = 400.0
    assert np.array_equal(seen, expected)


def test_emission_of_a_mixture_has_no_noise():
    """It is the mean over the grains, at every point, and so is the emissivity that data passes show."""
    share = random_image((8, 8), low=0.0, high=1.0)
    materials = [Material("paint", 0.9), Material("rust", np.array([[8.0, 0.2], [12.0, 0.6]]))]
    scene = plate(materials, textures(share, mixed=1, share_image=0), kelvin=350.0)
    scene = dataclasses.replace(scene, world_temperature=0.0)
    alone = [bands_of(dataclasses.replace(scene, textures=None, material=np.full(2, i, np.int32))) for i in range(2)]
    weight = share.values[..., None]
    assert bands_of(scene) == pytest.approx((1 - weight) * alone[0] + weight * alone[1], rel=3e-6)
    grey = plate([Material("paint", 0.9), Material("rust", 0.3)], scene.textures)
    seen = first_hit_images(grey, ("emissivity",))["emissivity"]
    assert seen == pytest.approx(0.9 - 0.6 * share.values, rel=1e-5)


def test_grains_have_their_share():
    """The share of random points with the other material is that of the corners, within 4 standard errors; a share of 0
    or 1 leaves none out."""
    random, count = np.random.default_rng(1), 20_000
    points = random.dirichlet((1, 1, 1), count)[:, :2].astype(np.float32)
    numbers = np.array([grain(7, u, v, MATERIAL) for u, v in points])
    assert numbers.min() >= 0.0 and numbers.max() < 1.0 and len(np.unique(numbers)) == count
    for share in (0.1, 0.5):
        assert abs(np.mean(numbers < share) - share) < 4.0 * (share * (1.0 - share) / count) ** 0.5
    assert abs(np.corrcoef(numbers, points[:, 0])[0, 1]) < 4.0 / count**0.5


@pytest.mark.parametrize("closest", [True, False])
def test_photons_leave_in_proportion(closest):
    """From a plate of which half is hot, and the other at T0: all power, and that of each quarter, within 3 standard
    errors and 0.1 %; nearly all photons start on the hot half."""
    image = Texture(np.array([[300.0, 400.0]], np.float32), "EXTEND", closest)
    scene = plate([Material("paint", 0.7)], textures(image, kelvin=0))
    count = 400_000
    model = prepare(scene, Settings(reference_temperature=300.0, photons_per_pass=count, threads=1))
    wave = empty_wave(count, 2, False)
    emit(model.emitters, model.stage, Batch(np.uint64(5), 0, count, count), wave)
    x, power = wave.origin[:, 0], wave.power * (wave.direction[:, 2:] > 0.0).astype(float)  # of the side that is seen
    u = (np.arange(4000) + 0.5) / 4000
    kelvin = np.where(u < 0.5, 300.0, 400.0) if closest else np.interp(u, [0.25, 0.75], [300.0, 400.0])
    excess = 0.7 * np.pi * 4.0 * (black_radiance(EDGES, kelvin) - black_radiance(EDGES, 300.0))
    for low, high in ((-1.0, 1.0), (-1.0, -0.5), (-0.5, 0.0), (0.0, 0.5), (0.5, 1.0)):
        inside = (x >= low) & (x < high)
        truth = np.mean(excess * ((2 * u - 1 >= low) & (2 * u - 1 < high))[:, None], axis=0)
        total = np.sum(power * inside[:, None], axis=0)
        error = np.sqrt(count) * (power * inside[:, None]).std(axis=0)
        assert np.all(np.abs(total - truth) <= np.maximum(3.0 * error, 1e-3 * truth) + 1e-9)
    seen = wave.direction[:, 2] > 0.0
    assert np.mean(power[seen, 0] > 0.0) > 0.85
    assert np.all(power[seen].std(axis=0) < 0.6 * power[seen].mean(axis=0))  # at random places it would be 1.0 or more


def test_a_hot_texel_is_found_like_a_lamp():
    """One of 256 x 256 texels of a floor is hot. What it brings to the room is that of a small plate in its place,
    within 4 standard errors of both, and its error no more than twice that of the plate: shadow rays go there."""
    values = np.full((256, 256), 300.0, np.float32)
    values[100, 60] = 2000.0
    walls, faces = box((2.0, 2.0, 1.0))
    floor, texel = quad((1, 1, 0.01), (1, 0, 0), (0, 1, 0)), 2.0 / 256
    spot = quad((60.5 * texel, 100.5 * texel, 0.01001), (texel / 2, 0, 0), (0, texel / 2, 0))
    camera = look((1.9, 1.9, 0.3), (0.1, 1.5, 0.7), 12, 9, tangent=0.3)  # it does not see the floor
    materials = [Material("plate", 1.0), Material("wall", 0.5)]

    def excess(*parts, painted=None):
        *mesh, index = join((*floor, 300.0, 0), (walls, faces, 300.0, 1), *parts)
        scene = make_scene(*mesh, materials, camera, EDGES, index, world_temperature=300.0)
        settings = Settings(passes=16, photons_per_pass=5_000, reference_temperature=300.0, threads=1)
        means = pass_means(dataclasses.replace(scene, textures=painted), settings) - black_radiance(EDGES, 300.0)
        return means.mean(axis=0), standard_error(means)

    ours, error = excess(painted=textures(Texture(values, "EXTEND", True), kelvin=0))
    truth, its_error = excess((*spot, 2000.0, 0))
    print(ours / truth - 1.0, error / truth, its_error / truth)
    assert np.all(np.abs(ours - truth) < 4.0 * np.hypot(error, its_error))
    assert np.all(error < np.maximum(2.0 * its_error, 0.01 * truth))


def test_what_a_mixture_reflects_is_the_mean():
    """A floor half mirror, half white paint, from grain to grain, below a warm ceiling: the mean of the two, within 4
    standard errors."""
    floor, ceiling = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), quad((0, 0, 1), (1, 0, 0), (0, -1, 0))
    camera = look((0.8, 0, 0.6), (0, 0, 0), 8, 6, tangent=0.4)
    materials = [Material("mirror", 0.1, specular=1.0), Material("paint", 0.4), Material("ceiling", 0.9)]
    *mesh, index = join((*floor, 300.0, 0), (*ceiling, 360.0, 2))
    scene = make_scene(*mesh, materials, camera, EDGES, index, world_temperature=300.0)
    settings = Settings(passes=24, photons_per_pass=5_000, threads=1)
    mixed = pass_means(dataclasses.replace(scene, textures=textures(mixed=1, share=(0.3, 0.3, 0.3))), settings)
    pure = [
        pass_means(dataclasses.replace(scene, material=np.where(index == 0, i, 2).astype(np.int32)), settings)
        for i in range(2)
    ]
    expected = 0.7 * pure[0].mean(axis=0) + 0.3 * pure[1].mean(axis=0)
    error = np.sqrt(sum((w * standard_error(m)) ** 2 for w, m in ((1.0, mixed), (0.7, pure[0]), (0.3, pure[1]))))
    print(mixed.mean(axis=0) / expected - 1.0, error / expected)
    # Light goes back and forth between floor and ceiling, which reflects .1, so the mean is not quite exact: it is off
    # by .1 w (1 - w) times the differences of the floors' reflectances, .3, and of their radiance, at most .3 of the
    # ceiling's, of which they show four fifths.
    twice = 0.1 * 0.21 * 0.3 * 0.3 / 0.8 * (expected - black_radiance(EDGES, 300.0))
    assert np.all(np.abs(mixed.mean(axis=0) - expected) < 4.0 * error + twice)


def over_a_floor(share, floor, leaf):
    """Scene of a leaf at 330 K, with this share of nothing in it, 0.5 m over a floor at 300 K."""
    below, above = quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), quad((0, 0, 0.5), (2, 0, 0), (0, 2, 0))
    materials = [Material("leaf", leaf), Material("nothing", 0.0, transmittance=1.0), Material("floor", floor)]
    *mesh, index = join((*above, 330.0, 0), (*below, 300.0, 2))
    camera = look((0, 0, 2.0), (0, 0, 0), 8, 6, tangent=0.4)
    scene = make_scene(*mesh, materials, camera, EDGES, index, world_temperature=280.0)
    return dataclasses.replace(scene, textures=textures(mixed=1, share=(share, share, share)))


@pytest.mark.parametrize("subtraction", [True, False])
@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.8, 1.0])
def test_as_much_passes_as_there_is_nothing(share, subtraction):
    """Of black bodies, to the rounding of float32: neither what is emitted nor what passes hangs on the grains."""
    settings = Settings(passes=2, photons_per_pass=2_000, threads=1, reference_subtraction=subtraction)
    film = render(over_a_floor(share, 1.0, 1.0), settings)
    expected = share * black_radiance(EDGES, 300.0) + (1.0 - share) * black_radiance(EDGES, 330.0)
    assert film.bands().transpose(1, 2, 0) * np.diff(EDGES) == pytest.approx(np.tile(expected, (6, 8, 1)), rel=3e-6)


@pytest.mark.parametrize("metal", [0.0, 1.0])
def test_what_passes_a_mixture_is_as_sure_as_it_says(metal):
    """True over stated errors of bright bodies, root mean square over 12 seeds, as in the families of scenes. The
    leaf's other half is diffuse, or a mirror."""
    scene = over_a_floor(0.5, 0.5, 0.7)
    scene = dataclasses.replace(
        scene, materials=(Material("leaf", 0.7, specular=metal), *scene.materials[1:]), world_temperature=250.0
    )
    films = [render(scene, Settings(passes=32, photons_per_pass=2_000, threads=1, seed=seed)) for seed in range(12)]
    kelvin, stated = (np.array([of(film) for film in films], float) for of in (Film.temperature, Film.noise))
    ratio = np.sqrt(np.mean(kelvin.var(axis=0, ddof=1)) / np.mean(stated**2))
    print(f"{ratio:.2f}")
    assert 0.7 < ratio < 1.2


def test_nothing_of_it_is_there_without_textures():
    surfaces, *_ = build_surfaces(plate([Material("paint", 0.7)], None))
    assert surfaces.textures.row.size == surfaces.textures.texel.size == 0


def test_triangles_that_are_left_out_take_their_textures_along():
    """The second of three triangles is there twice: rows of the others stay with them."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 0, 0)], float)
    triangles = np.array([(0, 1, 2), (0, 1, 2), (1, 4, 3)], np.int32)
    camera = look((1, 1, 3), (1, 1, 0))
    scene = make_scene(vertices, triangles, 300.0, [Material("paint", 0.5)], camera, EDGES)
    images = [Texture(np.full((1, 1), kelvin, np.float32)) for kelvin in (310.0, 320.0, 330.0)]
    painted = dataclasses.replace(
        textures(*images, uv=np.zeros((3, 3, 2))), temperature_image=np.arange(3, dtype=np.int32)
    )
    model = prepare(dataclasses.replace(scene, textures=painted), Settings(threads=1, reference_temperature=1.0))
    emitted = nothing_emitted(2, np.float64)
    seen = [
        emission_at(model.stage, emit_at(model.stage.surfaces, 2 * t, 0.2, 0.2, 1.0), emitted).sum() for t in (0, 1)
    ]
    assert seen == pytest.approx([0.5 * black_radiance(EDGES, kelvin).sum() for kelvin in (310.0, 330.0)], rel=1e-6)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"uv": np.zeros((2, 2, 2), np.float32)}, r"uv has shape \(2, 2, 2\), expected \(2, 3, 2\)"),
        ({"uv": np.full((2, 3, 2), np.nan, np.float32)}, "Triangle 0: its texture coordinates are not finite"),
        ({"triangle": np.array([0, 5], np.int32)}, "triangle runs from 0 to 5, of 2"),
        ({"triangle": np.array([1, 0], np.int32)}, "triangles must ascend"),
        ({"temperature_image": np.array([0, 1], np.int32)}, "temperature_image runs from 0 to 1, of 1"),
        ({"mixed": np.array([-1, 3], np.int32)}, "mixed runs from -1 to 3, of 1"),
        ({"share": np.full((2, 3), 1.5, np.float32)}, "Shares of a mixed material run from 1.5 to 1.5, beyond 0..1"),
        ({"images": (Texture(np.array([[np.nan]], np.float32)),)}, "Image of temperatures: temperature nan K"),
        ({"images": (Texture(np.array([[-4.0]], np.float32)),)}, "Image of temperatures: temperature -4 K"),
    ],
)
def test_bad_textures_are_named(change, message):
    painted = textures(Texture(np.full((1, 1), 300.0, np.float32)), kelvin=0)
    with pytest.raises(SceneError, match=message):
        plate([Material("paint", 0.7)], dataclasses.replace(painted, **change))


def test_bad_images_are_named():
    with pytest.raises(SceneError, match="A texture needs values"):
        Texture(np.zeros(3, np.float32))
    with pytest.raises(SceneError, match="Extension 'WRAP' of a texture is none of REPEAT"):
        Texture(np.zeros((1, 1), np.float32), "WRAP")


def test_groups_hold_no_mix_of_spectra_and_no_image():
    """Grey materials may be mixed in a group; curves that vary in a band may not, and images are refused."""
    rust = Material("rust", np.array([[8.0, 0.2], [12.0, 0.6]]))
    grouped = {"groups": ("body",), "group": np.zeros(2, np.int16)}
    grey = plate([Material("paint", 0.9), Material("grime", 0.5)], textures(mixed=1, share=(0.5, 0.5, 0.5)))
    assert len(scene_layers(dataclasses.replace(grey, **grouped))[0]) == 2
    mixed = dataclasses.replace(grey, materials=(grey.materials[0], rust), **grouped)
    with pytest.raises(SceneError, match="Temperature group 'body' holds a mix of the materials 'paint' and 'rust'"):
        scene_layers(mixed)
    with pytest.raises(SceneError, match="Temperature group 'body' holds an image of temperatures"):
        dataclasses.replace(plate([rust], textures(random_image((2, 2)), kelvin=0)), **grouped)
