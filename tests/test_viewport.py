# SPDX-License-Identifier: GPL-3.0-or-later
"""The background half of a viewport: pictures get finer, the newest request wins, nobody waits for long."""

import dataclasses
import threading
import time

import numpy as np
import pytest

from tests.helpers.scenes import box, join, look, make_scene, quad

bpy = pytest.importorskip("bpy")

from addon.rendering import viewport  # noqa: E402
from addon.solver import Film, Material, SceneError, Settings, render  # noqa: E402

PATIENCE = 300.0  # s; kernels may have to be compiled


@pytest.fixture(scope="module")
def scene():
    """A room with a hot plate in it."""
    plate = quad((2.0, 1.5, 0.6), (0.3, 0, 0), (0, 0.3, 0))
    vertices, triangles, kelvin, material = join((*box((4.0, 3.0, 2.5)), 293.0, 0), (*plate, 350.0, 0))
    camera = look((0.5, 0.4, 1.5), (2.0, 1.5, 0.6))
    return make_scene(vertices, triangles, kelvin, (Material(emissivity=0.6),), camera, (8.0, 12.0), material)


def request(scene, camera=None, **settings):
    settings = {"passes": 1, "photons_per_pass": 1000, "neighbours": 20} | settings
    return viewport.Request(scene, Settings(**settings), camera or scene.camera)


class Watcher:
    """Collects what a ViewportRender shows, at every call of redraw."""

    def __init__(self):
        self.pictures, self.states = [], []
        self._changed = threading.Condition()
        self.render = viewport.ViewportRender(self._redraw)

    def _redraw(self):
        with self._changed:
            self.states.append(self.render.status)
            if not self.pictures or self.pictures[-1] is not self.render.picture:
                self.pictures.append(self.render.picture)
            self._changed.notify()

    @property
    def last(self):
        """The newest status."""
        return self.states[-1] if self.states else ""

    def wait(self, condition):
        """Wait until a condition on this holds."""
        with self._changed:
            assert self._changed.wait_for(lambda: condition(self), PATIENCE), self.states


@pytest.fixture
def watcher():
    result = Watcher()
    yield result
    result.render.stop()


@pytest.fixture
def stand_in(monkeypatch):
    """A solver that takes no time but what `busy` says, and what it was asked for."""
    asked, busy = [], threading.Event()
    busy.set()

    def solve(scene, settings, on_pass, cancelled, image_copies=0, geometry=None):
        asked.append((scene, settings, geometry))
        film = Film(scene.camera.width, scene.camera.height, scene.band_edges, 293.0)
        while not busy.wait(0.001):
            if cancelled():
                return film
        pixels = film.width * film.height
        film.add_pass(np.zeros((pixels, 1), np.float32), np.zeros(pixels, np.float32), 0)
        on_pass(film)
        return film

    monkeypatch.setattr(viewport, "render", solve)
    return asked, busy


def test_the_final_picture_is_that_of_a_render(scene, watcher):
    """Coarse pictures come first, each once; then the passes of a render with these settings, to the last bit."""
    camera = dataclasses.replace(scene.camera, width=200, height=150)
    wanted = request(scene, camera, passes=2)
    watcher.render.submit(wanted)
    watcher.wait(lambda w: w.last == "Pass 2/2")
    assert [picture.step for picture in watcher.pictures if picture] == [2, 1, 1]
    film = render(dataclasses.replace(scene, camera=camera), wanted.settings)
    picture = watcher.render.picture
    for name in ("radiance", "temperature", "noise"):
        np.testing.assert_array_equal(getattr(picture, name), getattr(film, name)())


@pytest.mark.once
def test_first_pictures_are_smoothed_for_the_eye_alone(scene, watcher):
    """Those of one pass, coarse or not. What is measured is the render's own; later ones are drawn as they are."""
    camera = dataclasses.replace(scene.camera, width=200, height=150)
    wanted = request(scene, camera, passes=2)
    watcher.render.submit(wanted)
    watcher.wait(lambda w: w.last == "Pass 2/2")
    coarse, first, second = [picture for picture in watcher.pictures if picture]
    one_pass = dataclasses.replace(wanted.settings, passes=1)
    film = render(dataclasses.replace(scene, camera=camera), one_pass)
    np.testing.assert_array_equal(first.measured.radiance, film.radiance())
    np.testing.assert_array_equal(first.measured.temperature, film.temperature())
    for picture in (coarse, first):
        assert (picture.drawn.radiance != picture.measured.radiance).mean() > 0.5
        assert picture.drawn.temperature.shape == picture.measured.temperature.shape
    assert second.drawn == second.measured


@pytest.mark.once
def test_a_window_is_drawn_where_it_lies(scene, watcher):
    camera = dataclasses.replace(scene.camera, width=400, height=300, window=(31, 17, 300, 290))
    watcher.render.submit(request(scene, camera))
    watcher.wait(lambda w: w.last == "Pass 1/1")
    shown = [(p.step, p.origin, p.temperature.shape) for p in watcher.pictures if p]
    assert shown == [(4, (28, 16), (69, 68)), (2, (30, 16), (137, 135)), (1, (31, 17), (273, 269))]


def test_the_newest_request_wins(scene, watcher, stand_in):
    """Requests that come while one is at work are skipped but for the last, and the one at work ends."""
    asked, busy = stand_in
    busy.clear()
    requests = [request(scene, seed=seed) for seed in range(5)]
    watcher.render.submit(requests[0])
    while not asked:
        time.sleep(0.001)
    for each in requests[1:]:
        watcher.render.submit(each)
    while asked[-1][1].seed == 0:
        time.sleep(0.001)
    while sum(thread.name == viewport.THREAD for thread in threading.enumerate()) > 1:
        time.sleep(0.001)
    busy.set()
    watcher.wait(lambda w: w.last == "Pass 1/1")
    assert [settings.seed for _, settings, _ in asked] == [0, 4]


def test_first_pictures_are_shown_during_a_motion(scene, watcher, stand_in):
    """Then a new request comes with every frame: if each gave up the one before, nothing would be seen."""
    asked, busy = stand_in
    busy.clear()
    camera = dataclasses.replace(scene.camera, width=400, height=300)
    for seed in range(20):
        watcher.render.submit(request(scene, camera, seed=seed))
        while not asked:
            time.sleep(0.001)
    busy.set()
    watcher.wait(lambda w: w.last == "Pass 1/1")
    # of the first one coarse picture, then those of the newest
    assert [settings.seed for _, settings, _ in asked] == [0, 19, 19, 19]
    assert [picture.step for picture in watcher.pictures if picture] == [4, 4, 2, 1]


def test_geometry_is_kept_while_the_shape_is_the_same(scene, watcher, stand_in):
    asked, _ = stand_in
    moved = dataclasses.replace(scene, vertices=scene.vertices + 1.0)
    hotter = dataclasses.replace(scene, temperature=scene.temperature + np.float32(1.0))
    for count, each in enumerate((scene, hotter, moved), 1):
        watcher.render.submit(request(each, seed=count))
        watcher.wait(lambda w, count=count: len(asked) == count and w.states.count("Pass 1/1") == count)
    first, second, third = (geometry for _, _, geometry in asked)
    assert first is second and third is not second


def test_problems_are_told_and_the_next_request_is_rendered(scene, watcher, monkeypatch):
    def fail(*_, **__):
        raise problem

    monkeypatch.setattr(viewport, "render", fail)
    for number, problem in enumerate((SceneError("Too hot"), MemoryError(), KeyError("mistake"))):
        watcher.render.submit(request(scene, seed=number))
        expected = str(problem) if number == 0 else "Out of memory" if number == 1 else "The solver failed: KeyError"
        watcher.wait(lambda w, text=expected: w.last.startswith(text))
        assert watcher.render.picture is None
    monkeypatch.undo()
    watcher.render.submit(request(scene))
    watcher.wait(lambda w: w.last == "Pass 1/1")


def test_stopping_ends_the_threads_without_waiting_for_them(scene, watcher, stand_in):
    asked, busy = stand_in
    busy.clear()
    watcher.render.submit(request(scene))
    while not asked:
        time.sleep(0.001)
    begin = time.monotonic()
    watcher.render.stop()
    assert time.monotonic() - begin < 0.05  # s: what a window may be late without being felt
    while any(thread.name == viewport.THREAD for thread in threading.enumerate()):
        assert time.monotonic() - begin < PATIENCE
        time.sleep(0.001)


def test_a_request_does_not_wait_for_a_solver_that_does_not_listen(scene, watcher, stand_in, monkeypatch):
    """Preparing a large view takes a second, in which the solver cannot be stopped. The next one starts beside it."""
    asked, busy = stand_in
    solve, deaf = viewport.render, threading.Event()

    def solve_deaf(scene, settings, *rest, **options):
        if settings.seed == 0:
            assert deaf.wait(PATIENCE)
        return solve(scene, settings, *rest, **options)

    monkeypatch.setattr(viewport, "render", solve_deaf)
    watcher.render.submit(request(scene))
    watcher.wait(lambda w: w.states)
    watcher.render.submit(request(scene, seed=1))
    watcher.wait(lambda w: w.last == "Pass 1/1")
    shown = watcher.render.picture
    deaf.set()
    while any(thread.name == viewport.THREAD for thread in threading.enumerate()):
        time.sleep(0.001)
    assert watcher.render.picture is shown and [settings.seed for _, settings, _ in asked] == [1, 0]


def test_a_viewport_that_showed_nothing_stops_too(watcher, monkeypatch):
    """Nothing is begun, told or drawn on the way."""
    started = []
    monkeypatch.setattr(threading.Thread, "start", lambda thread: started.append(thread))
    watcher.render.stop()
    assert not started and not watcher.states
    assert watcher.render.picture is None and watcher.render.status == ""


def test_requests_are_compared_by_value(scene):
    one, copy = request(scene), request(dataclasses.replace(scene, vertices=scene.vertices.copy()))
    assert viewport.same(one, copy) and not viewport.same(one, None)
    others = (
        request(dataclasses.replace(scene, temperature=scene.temperature + np.float32(0.01))),
        request(dataclasses.replace(scene, materials=(Material(emissivity=np.array([[8.0, 0.6], [9.0, 0.5]])),))),
        request(dataclasses.replace(scene, world_temperature=1.0)),
        request(scene, dataclasses.replace(scene.camera, clip=(0.0, 5.0))),
        request(scene, seed=1),
        dataclasses.replace(one, frame=(0.0, 0.0, 1.0, 1.0)),
    )
    assert not any(viewport.same(one, other) for other in others)
