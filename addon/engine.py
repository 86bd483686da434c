# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: Blender's thread reads the scene and shows the image, a background thread runs the solver."""

from __future__ import annotations

import logging
import threading
import time

import bpy
import numpy as np

from .panels import ENGINE
from .scene_reader import SceneError, read_band_edges, read_scene, read_settings
from .solver.spectrum import band_names

log = logging.getLogger(__name__)

POLL = 0.05  # s between looks at Esc and at the solver
LIVE_INTERVAL = 0.5  # s, least time between two updates of the image
LIVE_SHARE = 0.1  # most of the time that updates may take


def render_passes(band_edges):
    """Every pass of a view layer as (name, channels, channel ids, kind, function of the film that gives the image).

    The one list from which passes are registered, added and filled. Images are (height, width[, channels]) float32.
    Raises SceneError if a name would be too long for Blender.
    """
    yield "Combined", 4, "RGBA", "COLOR", thermal_picture
    for band, name in enumerate(band_names(band_edges)):
        yield name, 1, "X", "VALUE", lambda film, band=band: film.band_radiance(band)
    yield "Radiance", 1, "X", "VALUE", lambda film: film.radiance()
    yield "Temperature", 1, "X", "VALUE", lambda film: film.temperature()
    yield "Noise", 1, "X", "VALUE", lambda film: film.noise()


def thermal_picture(film) -> np.ndarray:
    """The apparent temperature in a thermal palette, (height, width, 4) float32, linear RGB and alpha 1."""
    from .output.palette import thermal

    picture = np.ones((film.height, film.width, 4), dtype=np.float32)
    picture[..., :3] = thermal(film.temperature())
    return picture


class InfraredPhotonsEngine(bpy.types.RenderEngine):
    """Multi-pass spectral photon mapping of thermal infrared."""

    bl_idname = ENGINE
    bl_label = "Infrared Photons"
    bl_use_postprocess = True
    bl_use_eevee_viewport = True  # for the Material Preview; there is no Rendered viewport of our own
    bl_use_shading_nodes_custom = False

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell Blender, and so the compositor's sockets, which passes this engine fills."""
        try:
            for name, channels, channel_ids, kind, _image in render_passes(read_band_edges(scene.infrared)):
                self.register_pass(scene, renderlayer, name, channels, channel_ids, kind)
        except SceneError:
            pass  # the panel shows what is wrong, and the render reports it

    def render(self, depsgraph):
        """Render one view layer; Blender calls this for each."""
        try:
            self._render(depsgraph)
        except SceneError as error:
            self._fail(str(error))
        except ImportError as error:
            self._fail(f"A library of the solver is missing: {error}. Install the extension from its zip file again")
        except Exception as error:  # a mistake of ours: Blender alone would end with an empty image and no message
            self._fail(f"The solver failed: {error!r}; the system console has the details")
            log.exception("The solver failed")

    def _render(self, depsgraph):
        self.update_stats("", "Reading the scene")
        infrared = depsgraph.scene_eval.infrared
        settings = read_settings(infrared)
        passes = tuple(render_passes(read_band_edges(infrared)))
        scene, warnings = read_scene(depsgraph, self.camera_override)
        if depsgraph.scene_eval.render.use_multiview:
            warnings.append("Stereoscopy is not supported: all views show the picture of the active camera")
        for warning in warnings:
            log.warning(warning)
            self.report({"WARNING"}, warning)
        layer = depsgraph.view_layer_eval.name
        for name, channels, channel_ids, _kind, _image in passes[1:]:  # Combined is always there
            self.add_pass(name, channels, channel_ids, layer=layer)
        job = RenderJob(scene, settings, passes)
        x0, y0, x1, y1 = scene.camera.pixels
        result = self.begin_result(0, 0, x1 - x0, y1 - y0, layer=layer)
        try:
            job.start()
            self._watch(job, result)
            images = job.final_images()
            if images:
                write_images(result, images)
        finally:
            self.end_result(result)
        log.info("%s: %s", layer, job.status())

    def _watch(self, job: RenderJob, result) -> None:
        """Show progress and image until the job ends; Esc cancels it, however long it takes to notice."""
        next_image = time.monotonic() + LIVE_INTERVAL
        while job.is_alive():
            if self.test_break():
                job.cancel()
                return
            now = time.monotonic()
            images = job.take_images()
            if images:
                write_images(result, images)
                self.update_result(result)
                cost = job.snapshot_seconds + time.monotonic() - now
                next_image = now + max(LIVE_INTERVAL, cost / LIVE_SHARE)
            elif now >= next_image:
                job.request_images()
            self.update_progress(job.progress())
            self.update_stats("", job.status())
            job.join(POLL)

    def _fail(self, message: str) -> None:
        """Show the error: in the image's header, and as an exception to a script that called the render operator."""
        self.error_set(message)
        self.report({"ERROR"}, message)


class RenderJob(threading.Thread):
    """The solver in a background thread. It touches no Blender data; images are handed over on request."""

    def __init__(self, scene, settings, passes):
        super().__init__(name="Infrared Photons", daemon=True)  # a kernel being compiled cannot be stopped
        self.scene, self.settings, self.image_functions = scene, settings, passes
        self.snapshot_seconds = 0.0
        self._cache_dir = numba_cache_dir()
        self._cancelled, self._requested = threading.Event(), threading.Event()
        self._images = self._film = self._error = None
        self._passes, self._photons, self._noise = 0, 0, None
        self._started = time.monotonic()

    def run(self):
        try:
            self._film = load_solver(self._cache_dir)(self.scene, self.settings, self._on_pass, self._cancelled.is_set)
        except BaseException as error:  # raised again on Blender's thread
            self._error = error

    def _on_pass(self, film) -> None:
        self._passes, self._photons = film.passes, film.photons
        if self._requested.is_set():
            self._requested.clear()
            self._images = self._snapshot(film)

    def _snapshot(self, film) -> dict[str, np.ndarray]:
        start = time.monotonic()
        images = {name: image(film) for name, _channels, _ids, _kind, image in self.image_functions}
        self._noise = float(np.percentile(images["Noise"], 95)) if film.passes > 1 else None
        self.snapshot_seconds = time.monotonic() - start
        return images

    def request_images(self) -> None:
        """Ask for the images of the next finished pass."""
        self._requested.set()

    def take_images(self) -> dict[str, np.ndarray] | None:
        """The images asked for, by pass name, once."""
        images, self._images = self._images, None
        return images

    def cancel(self) -> None:
        """End the render; the finished passes are kept."""
        self._cancelled.set()

    def final_images(self, patience: float = 0.3) -> dict[str, np.ndarray] | None:
        """The images at the end, by pass name; None if no pass was finished. Raises what the solver raised.

        patience: s to wait for a cancelled solver, which may be compiling and is then left to itself.
        """
        self.join(patience if self._cancelled.is_set() else None)
        if self._error is not None:
            raise self._error
        return self._snapshot(self._film) if self._film is not None and self._film.passes else None

    def progress(self) -> float:
        """Share of the render that is done, by the stop condition that is nearest, 0..1."""
        settings = self.settings
        by_passes = self._passes / settings.passes if settings.passes else 0.0
        by_time = self._seconds() / settings.time_limit if settings.time_limit else 0.0
        return min(1.0, max(by_passes, by_time))

    def status(self) -> str:
        """What users read while they wait."""
        if self._passes == 0:
            return "Preparing kernels (compiled once on first use)"
        total = f"/{self.settings.passes}" if self.settings.passes else ""
        noise = "" if self._noise is None else f" | Noise {self._noise:.3g} K"
        return f"Pass {self._passes}{total} | {self._photons:,} photons{noise} | peak {process_memory():.0f} MB"

    def _seconds(self) -> float:
        return time.monotonic() - self._started


def write_images(result, images: dict[str, np.ndarray]) -> None:
    """Fill the passes of a render result, in bulk."""
    for render_pass in result.layers[0].passes:
        if render_pass.name in images:
            render_pass.rect.foreach_set(images[render_pass.name].reshape(-1))


def load_solver(cache_dir: str | None):
    """The solver's render function. The first call takes a second or two: numba is large.

    cache_dir: where numba keeps compiled kernels; None leaves the place to numba.
    """
    import numba

    if cache_dir:
        numba.config.CACHE_DIR = cache_dir
    from .solver.render import render

    return render


def numba_cache_dir() -> str | None:
    """The extension's own writable folder; None if this is not an installed extension."""
    try:
        return bpy.utils.extension_path_user(__package__, path="numba", create=True)
    except (ValueError, OSError):
        return None


def process_memory() -> float:
    """Peak memory of the process in MB; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / (1 << 10)


register, unregister = bpy.utils.register_classes_factory((InfraredPhotonsEngine,))
