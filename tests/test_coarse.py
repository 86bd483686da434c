# SPDX-License-Identifier: GPL-3.0-or-later
"""Coarse pictures: where their pixels lie, and that a final render begins with them."""

import dataclasses
from functools import partial

import numpy as np
import pytest

from tests.helpers.scenes import box, look, make_scene

pytest.importorskip("bpy")

from addon.rendering import coarse  # noqa: E402
from addon.rendering.coarse import FIRST_PHOTONS, FIRST_PIXELS, coarser, enlarged, hasty, steps  # noqa: E402
from addon.rendering.render_job import RenderJob  # noqa: E402
from addon.rendering.solvers import solver_with_first_pictures  # noqa: E402
from addon.solver import Camera, Material, Settings, render  # noqa: E402


@pytest.mark.parametrize("size", [(1, 1), (640, 480), (1919, 1081), (5, 4000)])
def test_coarse_pictures_cover_the_image_exactly(size):
    """A point of the frame lies at the same place of the image in every step."""
    camera = Camera(*size, frame=(-0.5, 0.7, -0.2, 0.4))
    for step in steps(camera):
        picture = coarser(camera, step)
        assert picture.width * step >= size[0] and picture.height * step >= size[1]
        for place, edges, pixels, whole in ((0, 0, picture.width, size[0]), (1, 2, picture.height, size[1])):
            low, high = camera.frame[edges : edges + 2]
            point = low + 0.3 * (high - low)
            coarse_low, coarse_high = picture.frame[edges : edges + 2]
            screen = step * pixels * (point - coarse_low) / (coarse_high - coarse_low)
            assert screen == pytest.approx(0.3 * whole, rel=1e-12), place


def test_the_last_step_is_every_pixel_and_the_first_is_quick():
    for size in ((10, 10), (640, 480), (3840, 2160)):
        camera = Camera(*size)
        sizes = list(steps(camera))
        assert sizes[-1] == 1 and all(a == 2 * b for a, b in zip(sizes, sizes[1:], strict=False))
        assert size[0] * size[1] / sizes[0] ** 2 <= FIRST_PIXELS
    assert coarser(camera, 1).frame == camera.frame


def test_windows_of_coarse_pictures_hold_the_render_region():
    camera = Camera(100, 80, window=(13, 7, 50, 80))
    assert coarser(camera, 4).window == (3, 1, 13, 20)
    assert coarser(camera, 1).window == camera.window


def test_first_pictures_take_few_photons_but_never_more_than_asked():
    assert hasty(Settings(photons_per_pass=1_000_000), 4).photons_per_pass == 62_500
    assert hasty(Settings(photons_per_pass=100_000), 8).photons_per_pass == FIRST_PHOTONS
    assert hasty(Settings(photons_per_pass=500), 8).photons_per_pass == 500


def test_enlarged_pictures_lie_where_the_image_does():
    """A ramp over the whole frame is at each pixel of the image that of the coarse pixel around it."""
    camera = Camera(100, 80, window=(13, 7, 50, 80))
    x0, y0, x1, y1 = coarser(camera, 4).pixels
    place = np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=-1).astype(np.float32)
    large = enlarged(place, camera, 4)
    x, y = np.meshgrid(np.arange(13, 50), np.arange(7, 80))
    np.testing.assert_array_equal(large, np.stack((x // 4, y // 4), axis=-1))
    assert enlarged(place[..., 0], camera, 4).shape == (73, 37)


class WatchedJob(RenderJob):
    """Keeps the coarse pictures that it shows: (step, images)."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.shown = []

    def _on_pass(self, film, step=1):
        super()._on_pass(film, step)
        if step > 1:
            assert self.status().startswith("Preparing") and self.progress() == 0.0
            self.shown.append((step, self.take_images()))


@pytest.mark.once
def test_a_final_render_begins_with_coarse_pictures(monkeypatch):
    """In its size and all its passes, and like the image that comes: a pixel on one wall shows that wall. This is the
    same without them, to the last bit.
    """
    monkeypatch.setattr(coarse, "FIRST_PIXELS", 1024)
    vertices, triangles = box((4.0, 3.0, 2.5))
    kelvin = np.repeat([280.0, 290.0, 300.0, 310.0, 320.0, 330.0], 2)
    camera = dataclasses.replace(
        look((0.5, 0.4, 1.5), (2.0, 1.5, 0.6)), width=250, height=200, window=(10, 30, 247, 199)
    )
    scene = make_scene(vertices, triangles, kelvin, (Material(emissivity=0.9),), camera, (8.0, 10.0, 12.0))
    settings = Settings(passes=1, photons_per_pass=2000)
    job = WatchedJob(scene, settings, partial(solver_with_first_pictures(render), image_copies=0))
    plain = RenderJob(scene, settings, render)
    job.start()
    plain.start()
    images, expected = job.final_images(), plain.final_images()
    assert [step for step, _ in job.shown] == [8, 4]
    for name, image in expected.items():
        np.testing.assert_array_equal(images[name], image)
        for step, picture in job.shown:
            assert picture[name].shape == image.shape and picture[name].dtype == image.dtype
            wrong = np.abs(picture["Temperature"] - expected["Temperature"]) > 4.0
            assert wrong.mean() < 0.02 * step  # those on an edge between walls: up to half a step to either side


def test_small_images_need_no_coarse_pictures():
    scene = make_scene(*box(), np.full(12, 300.0), (Material(),), Camera(200, 200), (8.0, 12.0))
    shown = []
    solve = solver_with_first_pictures(lambda *_, **options: shown.append(options["geometry"]))
    solve(scene, Settings(), lambda *_: pytest.fail("It has pixels enough"), lambda: False, 0)
    assert shown == [None]
