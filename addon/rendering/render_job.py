# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver in a background thread, and the images of its film. Nothing here touches Blender's data."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..compiling.watch import COMPILING, compiles_now
from ..output.description import how_rendered
from .coarse import enlarged
from .painting import thermal_picture

try:
    import resource
except ImportError:  # on Windows
    resource = None


def film_images(film, paint: Callable, further: Sequence[Callable] = ()) -> dict[str, np.ndarray]:
    """The image of every pass by its name, (height, width[, channels]) float32.

    paint: `thermal_picture`, or a function like it. further: functions of the film and of the images so far; each
    returns the images of some of the `further_passes`.
    """
    with ThreadPoolExecutor(2) as pool:  # Esc must not wait for large images
        noise, bands = pool.submit(film.noise), pool.submit(film.bands)
        temperature = film.temperature()
        images = {"Combined": paint(temperature), "Radiance": film.radiance(), "Temperature": temperature}
        images |= {**dict(zip(film.band_names, bands.result(), strict=True)), "Noise": noise.result()}
    for make in further:
        images |= make(film, images)
    return images


class RenderJob(threading.Thread):
    """The solver in a background thread. It touches no Blender data, and hands images over on request."""

    def __init__(
        self, scene, settings, solve: Callable, paint: Callable = thermal_picture, further: Sequence[Callable] = ()
    ):
        """solve, paint: `render` and `thermal_picture`, or functions like them. further: see film_images."""
        super().__init__(name="Infrared Photons", daemon=True)  # a kernel being compiled cannot be stopped
        self.scene, self.settings, self.film, self._solve, self._paint = scene, settings, None, solve, paint
        self._further = further
        self.snapshot_seconds = 0.0
        self._cancel, self._request = threading.Event(), threading.Event()
        self._images = self._latest = self._error = self._noise = None
        self._passes = self._photons = 0
        self._begin = time.monotonic()

    def run(self):
        try:
            self._solve(self.scene, self.settings, self._on_pass, self._cancel.is_set)
        except BaseException as error:  # raised again on Blender's thread
            self._error = error

    def _on_pass(self, film, step: int = 1) -> None:
        """Take a film. step: width of its pixels in pixels of the image."""
        if step > 1:
            images = film_images(film, self._paint)
            self._images = {name: enlarged(image, self.scene.camera, step) for name, image in images.items()}
            return
        self.film, self._passes, self._photons = film, film.passes, film.photons
        if self._request.is_set():
            self._request.clear()
            self._images = self._snapshot(film)

    def _snapshot(self, film) -> dict[str, np.ndarray]:
        begin = time.monotonic()
        with film.lock:
            if self._latest is None or self._latest[0] != film.passes:  # only once for a pass
                self._latest = film.passes, film_images(film, self._paint, self._further)
        passes, images = self._latest
        self._noise = float(np.percentile(images["Noise"], 95)) if passes > 1 else None
        self.snapshot_seconds = time.monotonic() - begin
        return images

    def request_images(self) -> None:
        """Ask for the images of the next finished pass."""
        self._request.set()

    def take_images(self) -> dict[str, np.ndarray] | None:
        """The images asked for, by pass name, once."""
        images, self._images = self._images, None
        return images

    def cancel(self) -> None:
        """End the render; the finished passes are kept."""
        self._cancel.set()

    @property
    def cancelled(self) -> bool:
        """True if the render was ended before its time."""
        return self._cancel.is_set()

    def final_images(self, patience: float = 0.2) -> dict[str, np.ndarray] | None:
        """The images at the end, by pass name; None if no pass was finished. Raises what the solver raised.

        patience: s to wait for a cancelled solver. It may be compiling or sorting for longer, and then goes on alone;
        the film already has the passes that it finished.
        """
        self.join(patience if self.cancelled else None)
        if self._error is not None:
            raise self._error
        return self._snapshot(self.film) if self.film is not None else None

    def facts(self) -> dict[str, object]:
        """How the film was rendered, by the names that files give that."""
        response = self.scene.response
        return {"sensor": response.name if response else "Ideal", **how_rendered(self.film, self.settings)}

    def progress(self) -> float:
        """Share of the render that is done, by the stop condition that is nearest, 0..1."""
        settings = self.settings
        by_passes = self._passes / settings.passes if settings.passes else 0.0
        by_time = (time.monotonic() - self._begin) / settings.time_limit if settings.time_limit else 0.0
        return min(1.0, max(by_passes, by_time))

    def end(self) -> str:
        """What users read of it afterwards."""
        noise = "" if self._noise is None else f", noise {self._noise:.3g} K"
        return f"{self._passes} pass{'es' * (self._passes != 1)}{noise}"

    def status(self) -> str:
        """What users read while they wait."""
        if self._passes == 0:
            return "Preparing the scene and the first pass" + COMPILING * compiles_now()
        total = f"/{self.settings.passes}" if self.settings.passes else ""
        noise = "" if self._noise is None else f" | Noise {self._noise:.3g} K"
        memory = process_memory()
        peak = f" | Peak {memory:.0f} MB" if memory else ""
        return f"Pass {self._passes}{total} | {self._photons:,} photons{noise}{peak}"


def process_memory() -> float:
    """Peak memory of the whole process in MB; 0 on Windows, whose Python does not tell."""
    if resource is None:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / (1 << 10)
