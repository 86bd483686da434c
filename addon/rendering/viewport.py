# SPDX-License-Identifier: GPL-3.0-or-later
"""The Rendered mode of a 3D viewport: Blender's thread reads the scene and draws, threads in the background render.

Only Blender's thread touches Blender's data, and only the others run the solver. It hands them requests, and they hand
it pictures; of both only the newest counts.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import os
import sys
import threading
import time
import weakref
from collections.abc import Callable

import numpy as np

from ..compiling.watch import COMPILING, compiles_now
from ..heat_settings import read_scale
from ..measuring.correcting import Sensor
from ..output.temperature_scale import TemperatureScale
from ..reading.camera import camera_frame, read_view
from ..reading.scene_reader import read_contents
from ..reading.settings import read_settings, with_correction
from ..reading.surfaces import SurfaceReader
from ..reading.warnings import Warnings
from ..solver import Camera, Correction, Film, Scene, SceneError, Settings, render
from ..solver.geometry.surfaces import Geometry, build_geometry
from ..solver.physics.spectrum import apparent_temperature
from .coarse import coarser, hasty, steps
from .gpu_pictures import draw_temperatures, temperature_texture
from .live_pictures import Picture, viewports
from .painting import working_primaries
from .readings import fitted, temperature_now
from .smoothing import may_be_smoothed, smoothed

log = logging.getLogger(__name__)

STATUS = "Infrared Photons status"  # name of the thread that tells of compiling
THREAD = "Infrared Photons viewport"  # name of the background threads
PREPARING = "Preparing the first picture"
LOOK = 0.2  # s between two looks at whether kernels are compiled
WAIT = 0.25  # s that a request waits for the one before it to end; then it starts beside it
IMAGE_COPIES = 2  # of the images of a film, at most: the picture, and what it is computed with


@dataclasses.dataclass(frozen=True)
class Request:
    """What a viewport wants to see, through a camera of its own, whose frame lies in the region as Picture tells."""

    scene: Scene
    settings: Settings
    camera: Camera
    frame: tuple[float, float, float, float] | None = None


def same(a, b) -> bool:
    """Whether two requests, or parts of requests, are equal, arrays in them too."""
    if dataclasses.is_dataclass(a) and type(a) is type(b):
        return a is b or all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return a == b


def picture_of(film: Film, request: Request, step: int, origin: tuple[int, int]) -> Picture:
    """The picture of a film as it is now."""
    temperature = film.temperature()
    # After one pass a film would say that the error is as large as the value: there is no need to ask it.
    noise = film.noise() if film.passes > 1 else temperature
    sensor = Sensor(film.band_edges, film.weights)
    fitted(TemperatureScale(), temperature)  # here, in the background: whoever draws it finds its range
    return Picture(step, origin, film.radiance(), temperature, noise, sensor, request.frame)


def for_the_eye(picture: Picture, radiance: np.ndarray) -> Picture:
    """A picture that is drawn with another radiance (h, w), W m-2 sr-1."""
    temperature = apparent_temperature(radiance, *picture.sensor).astype(np.float32)
    return dataclasses.replace(picture, for_the_eye=(radiance, temperature))


def explain(error: Exception, known: str = "") -> str:
    """What users read of an error. An unexpected one is written to the log with its traceback.

    known: what they read before; the same error is not written to the log again.
    """
    if isinstance(error, SceneError | MemoryError):
        return str(error) or "Out of memory"
    message = f"The solver failed: {error!r}; the system console has the details"
    if message != known:
        log.error("The viewport failed", exc_info=error)
    return message


class ViewportRender:
    """Renders the newest request in the background: first coarsely, then finer, then pass by pass.

    picture: the newest, or None. status: what users read of it.
    """

    def __init__(self, redraw: Callable[[], None]):
        """redraw: called in a background thread whenever picture or status are new."""
        self.picture: Picture | None = None
        self.status = ""
        self._redraw = redraw
        self._newest: Request | None = None  # the last one that was submitted
        self._latest: Request | None = None  # the last one that a thread has begun
        self._geometry: Geometry | None = None  # of the last request
        self._working = 0  # threads
        self._changed = threading.Condition()

    def submit(self, request: Request | None) -> None:
        """Render this from now on; None is nothing. Returns at once."""
        with self._changed:
            self._newest = request
            self._changed.notify_all()
        if request is not None:
            threading.Thread(target=self._run, args=(request,), name=THREAD, daemon=True).start()

    def stop(self) -> None:
        """Render nothing any more. Threads end as soon as they can; a kernel being compiled cannot be stopped."""
        self.submit(None)

    def _run(self, request: Request) -> None:
        if sys.platform == "linux":  # elsewhere threads have no niceness of their own
            os.nice(10)  # this thread and those that it starts give way to Blender's window
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not request or not self._working, WAIT)
            if self._newest is not request:
                return
            self._working, self._latest = self._working + 1, request
        try:
            self._geometry = build_geometry(request.scene, self._geometry)
            self._refine(request, self._geometry)
        except Exception as error:  # the next request has its own thread
            if request is self._newest:  # of others nobody wants to know, least of all once the add-on is removed
                self._fail(request, explain(error))
        finally:
            with self._changed:
                self._working -= 1
                self._changed.notify_all()

    def _refine(self, request: Request, geometry: Geometry) -> None:
        """Render a request until it is complete or out of date."""
        shown = []
        if self.picture is None:
            self._tell(PREPARING)
            threading.Thread(target=self._tell_of_compiling, args=(request,), name=STATUS, daemon=True).start()

        ended = False

        def cancelled() -> bool:
            nonlocal ended
            ended = ended or is_out_of_date()  # render() relies on it that this stays so
            return ended

        def is_out_of_date() -> bool:
            if self._newest is request:
                return False
            # While the view moves, requests follow each other so fast that none would show a picture. So one that has
            # begun may show its first picture even if there is a newer request.
            return bool(shown) or self._latest is not request or self._newest is None

        for step in steps(request.camera):
            scene = dataclasses.replace(request.scene, camera=coarser(request.camera, step))
            settings = request.settings if step == 1 else hasty(request.settings, step)

            def show(film, scene=scene, step=step, settings=settings) -> None:
                if cancelled():
                    return
                picture = picture_of(film, request, step, tuple(step * start for start in scene.camera.pixels[:2]))
                if film.passes == 1 and may_be_smoothed(scene):
                    seen = smoothed(picture.radiance, scene, picture.sensor, geometry, settings.workers, cancelled)
                    if not cancelled():
                        picture = for_the_eye(picture, seen)
                shown.append(film.passes)
                self.picture = picture
                total = f"/{settings.passes}" if settings.passes else ""
                self._tell(f"Pass {film.passes}{total}" if step == 1 else f"1/{step} of the resolution")

            render(scene, settings, show, cancelled, image_copies=IMAGE_COPIES, geometry=geometry)
            if cancelled():
                return

    def _tell_of_compiling(self, request: Request) -> None:
        """Until there is a picture: say so while it is compiling that takes so long."""
        while self._newest is request and self.status.startswith(PREPARING):
            status = PREPARING + COMPILING * compiles_now()
            with self._changed:
                changed = self.status != status and self.status.startswith(PREPARING)
                if changed:
                    self.status = status
            if changed:
                self._redraw()
            time.sleep(LOOK)

    def _tell(self, status: str) -> None:
        with self._changed:
            self.status = status
        self._redraw()

    def _fail(self, request: Request, message: str) -> None:
        if request is self._newest:
            self.picture = None
            self._tell(message)


class Viewport:
    """A 3D viewport in Rendered mode, on Blender's thread: reads the scene, asks for pictures and draws them."""

    def __init__(self, engine):
        """engine: Blender's, one for each viewport, which keeps this."""
        self._render = ViewportRender(_redraw_of(engine))
        self._meshes, self._images = {}, {}  # read earlier, see SurfaceReader
        self._wanted = self._request = None  # what to render, but for the view, and the last request
        self.shown: Picture | None = None
        self._drawn = self._texture = None  # the last temperatures, and the texture made of them
        self._problem = ""

    def read(self, depsgraph, space) -> None:
        """Read what changed in Blender's scene."""
        for update in depsgraph.updates:
            if update.is_updated_geometry:
                name = update.id.name_full
                self._meshes = {key: mesh for key, mesh in self._meshes.items() if key[0] != name}
        surfaces = SurfaceReader(depsgraph, Warnings(), self._meshes, kept_images=self._images)
        try:
            infrared = depsgraph.scene_eval.infrared
            scene = Scene(**read_contents(depsgraph, surfaces, space), camera=Camera())
            # The correction is applied where the picture is drawn.
            settings = with_correction(read_settings(infrared), Correction())
            wanted = Request(scene, settings, Camera())
            if not same(wanted, self._wanted):  # a selection changes nothing
                self._wanted = wanted
            self._problem = ""
        except Exception as error:  # Blender would print each of them, and leave an old picture as if it were true
            self._wanted, self._problem = None, explain(error, self._problem)
        self._meshes, self._images = surfaces.kept, surfaces.textures.kept

    def draw(self, engine, context, depsgraph) -> None:
        """Draw the newest picture; if the scene or the view changed, ask for another."""
        self._ask(context, depsgraph)
        engine.update_stats("", self._problem or self._render.status)
        picture = self.shown = self._render.picture if self._request is not None else None
        viewports[context.region.as_pointer()] = self
        if picture is None:
            return
        infrared = context.scene.infrared
        temperature = temperature_now(picture.drawn, infrared)
        if temperature is not self._drawn:
            self._drawn, self._texture = temperature, temperature_texture(temperature)
        scale = fitted(read_scale(infrared), temperature_now(picture.measured, infrared))  # that of the bar
        draw_temperatures(self._texture, scale, picture.place, working_primaries())

    def stop(self) -> None:
        """End what goes on in the background, without waiting for it."""
        self._render.stop()

    def _ask(self, context, depsgraph) -> None:
        """Hand the scene and the view to the solver if they are not those that it has."""
        request = self._wanted
        if request is not None:
            camera = read_view(depsgraph, context.space_data, context.region, context.region_data)
            x0, y0, x1, y1 = camera.pixels
            frame = camera_frame(depsgraph.scene_eval, context.space_data, context.region, context.region_data)
            request = dataclasses.replace(request, camera=camera, frame=frame) if x0 < x1 and y0 < y1 else None
        if not same(request, self._request):
            self._request = request
            self._render.submit(request)


def _redraw_of(engine) -> Callable[[], None]:
    """A function for any thread that has the engine's viewport drawn again, as long as there is one.

    It does not keep the engine alive. Blender frees an engine only after Python has let go of it, and this holds the
    interpreter while it uses it.
    """
    reference = weakref.ref(engine)

    def redraw() -> None:
        engine = reference()
        if engine is not None:
            with contextlib.suppress(ReferenceError):  # Blender has just removed it
                engine.tag_redraw()

    return redraw
