# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render: Blender's thread reads the scene and shows the image, a background thread runs the solver."""

from __future__ import annotations

import atexit
import logging
import math
import sys
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import takewhile
from pathlib import Path

import bpy
import numpy as np

from ..compiling.watch import COMPILING, compiles_now
from ..heat_settings import read_scale
from ..output.description import how_rendered
from ..output.formats import FORMATS
from ..output.frame import FurtherImage
from ..reading.bands import read_band_edges
from ..reading.camera import render_size, rendered_size
from ..reading.motion import CancelledError, read_exposure, read_moving_scene
from ..reading.settings import read_settings
from ..reading.world import WHERE_TO_SET, layer_world, unset_surroundings
from ..solver import Film, coverage_image, first_hit_images, layered_image, render
from ..solver.checkpoint import (
    CheckpointError,
    fingerprint,
    go_on,
    load,
    render_with_checkpoints,
    save,
    set_aside,
)
from ..solver.geometry.surfaces import Geometry, build_geometry
from ..solver.memory import check_memory, memory_beforehand, memory_of_images
from ..solver.system.files import check_writable
from .camera_effects import CameraEffects, read_detector
from .coarse import coarser, enlarged, hasty, steps
from .cryptomatte import Mattes
from .frame_tools import keep_frame, write_frames
from .labels import write_labels
from .last_render import (
    FinishedFrame,
    finished_frames,
    finished_groups,
    finished_layers,
    forget_last_render,
    last_ends,
    last_warnings,
)
from .painting import cut_out, thermal_picture, working_primaries
from .render_files import (
    check_paths,
    checkpoint_path,
    file_path,
    film_path,
    group_path,
    label_path,
    layer_suffixes,
    write_layer,
)
from .render_passes import RenderPass, data_passes, further_passes, render_passes

try:
    import resource
except ImportError:  # on Windows
    resource = None

log = logging.getLogger(__name__)

FILM, LABELS = "the film", "the labels"  # names, in messages, of files
LEAST_STEP = 4  # pixels on each side of one of a first picture: finer ones take more than a sixteenth of a pass
POLL = 0.05  # s between looks at Esc and at the solver
LAST_WAIT = 30.0  # s, most that Blender waits at its end for passes to be saved
LIVE_INTERVAL = 0.5  # s, least time between two updates of the image
LIVE_SHARE = 0.1  # most of the time that updates may take
LEAST_OPENNESS = 1e-3  # share of rays that leave a scene; fewer may slip through where the walls of a room meet
IMAGE_COPIES = 5  # of all passes that are held at once: a live one, the last one, Blender's own and some on their way
LAYER_COPIES = 2  # of all passes that a finished view layer keeps: Blender's, and one for the export


# Checkpoint -> the last render that saves its passes there; it is alive for a while after Esc.
_saving: weakref.WeakValueDictionary[Path, RenderJob] = weakref.WeakValueDictionary()


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


def render_view_layer(engine, depsgraph) -> None:
    """Render the depsgraph's view layer into the render result, and into the files that the scene wants.

    Raises SceneError if the scene cannot be rendered, OSError if a file cannot be written; the images are in the render
    result even then.
    """
    engine.update_stats("", "Reading the scene")
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    layer = view_layer.name
    layers = [each.name for each in depsgraph.scene.view_layers if each.use]  # scene_eval would list its own first
    # Blender also renders scenes that the compositor of the shown one needs. Those do not get into the render result.
    shown = all(frame.scene == scene.name for frame in finished_frames.values())
    if shown and layer in layers[:1] and not scene.render.use_single_layer:
        forget_last_render()
    elif shown:
        finished_layers.pop(layer, None)
    check_paths(scene.infrared)
    settings, edges = read_settings(scene.infrared), read_band_edges(scene.infrared)
    passes, further = render_passes(scene, view_layer), further_passes(scene, view_layer)
    copies = (IMAGE_COPIES + LAYER_COPIES * (len(layers) - 1)) * size_beside_usual(passes, further)
    foreseen, name = images_beforehand(scene.render, len(edges) - 1, copies)
    check_memory(foreseen, name)  # before the scene is read, which may take long
    log.info("%s: bands between %s um", layer, ", ".join(f"{edge:.6g}" for edge in edges))
    try:
        solver_scene, warnings, surfaces = read_moving_scene(engine, depsgraph)
    except CancelledError:
        return
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval  # evaluated anew, if the scene moves
    needed = foreseen | memory_beforehand(solver_scene, copies)
    check_memory(needed, name, solver_scene.media)  # before Blender takes room for the images
    detector = read_detector(scene, (engine.camera_override or scene.camera).evaluated_get(depsgraph))
    effects = CameraEffects(detector, solver_scene.camera, scene.frame_current) if detector else None
    if scene.infrared.group_exr_path and not solver_scene.groups:
        warnings.append("Nothing is in a temperature group: no file of them is written")
    for warning in warnings:
        _warn(engine, warning)
    suffix = layer_suffixes([*layers, layer])[layer] if len(layers) > 1 else ""  # in the names of its files
    path = kept = saved = None
    if scene.infrared.film_path:
        kept = film_path(scene, suffix, engine.is_animation)
        check_writable(kept, FILM)
        saved = _saved_passes(engine, kept, solver_scene, settings)
    solve = render if saved is None else partial(go_on, saved=saved)
    if scene.infrared.checkpoint_path:
        path = checkpoint_path(scene, suffix, engine.is_animation)
        if not _await_last_save(engine, path):
            return
        saved = _saved_passes(engine, path, solver_scene, settings) or saved
        interval = 60.0 * scene.infrared.checkpoint_minutes
        solve = partial(render_with_checkpoints, path=path, interval=interval, saved=saved)
    if not (bpy.app.background or engine.is_animation):  # somebody is waiting for it
        solve = _solver_with_first_pictures(solve)
    fillers = [effects] if effects else []
    data, seen = data_passes(scene, view_layer), {}
    labels = {name: surfaces.labels(name) for name in surfaces.pass_indices if name in data}
    if scene.infrared.label_path:
        labels["instance"] = surfaces.labels("instance")
        check_writable(label_path(scene, suffix, engine.is_animation), LABELS)
    if data or labels:
        fillers.append(lambda film, images: {asked.name: seen[name] for name, asked in data.items()})
        names = [name for name in data if name not in labels]
        solve = _solver_after(solve, lambda scene, *rest: seen.update(first_hit_images(scene, names, labels, *rest)))
    mattes = Mattes(view_layer, surfaces)
    if mattes.passes:
        fillers.append(lambda film, images: mattes.images)
        solve = _solver_after(solve, mattes.look)
    if scene.render.film_transparent or solver_scene.holdout is not None:
        fillers.append(lambda film, images: {"Combined": cut_out(images["Combined"], seen["alpha"])})
        transparent = scene.render.film_transparent
        solve = _solver_after(solve, lambda scene, *rest: seen.update(alpha=coverage_image(scene, transparent, *rest)))
    if scene.render.use_persistent_data:  # then Blender keeps the engine between frames and renders, as for Cycles
        solve = _solver_with_kept_geometry(solve, engine.geometries, layer)
    else:
        engine.geometries.clear()
    for each in passes[1:]:  # Combined is there already
        engine.add_pass(each.name, len(each.channels), each.channels, layer=layer)
    scale, slot = read_scale(scene.infrared), render_slot()
    paint = partial(thermal_picture, scale=scale, primaries=working_primaries())
    job = RenderJob(solver_scene, settings, partial(solve, image_copies=copies), paint, fillers)
    if path:
        _saving[path] = job
    images = _render(engine, job, layer)
    if mattes.passes:
        mattes.stamp(engine.get_result())
    log.info("%s: %s", layer, job.status())
    if effects and effects.warning():
        _warn(engine, f"{layer}: {effects.warning()}")
    unset = unset_surroundings(layer_world(scene, view_layer))
    if images and unset and job.film.openness > LEAST_OPENNESS:
        _warn(engine, f"{layer}: {unset}, and the scene is open: rays that leave it see 0 K. Set it in {WHERE_TO_SET}")
    if kept and job.film is not None and job.film.passes:
        _keep_film(kept, job, layer, scene.frame_current)
    if images:
        facts = {"frame": scene.frame_current, **_motion_facts(scene), **(effects.facts() if effects else {})}
        finished = layer_images(job, images, further, facts) | {"attributes": mattes.attributes()}
        if shown:
            frame = finished_frame(scene, slot, solver_scene.camera, job.film)
            last_ends[layer] = job.end()
            _keep([each.name for each in depsgraph.scene.view_layers], layer, finished, frame)
        if not job.cancelled:  # whoever asked for a file wants all passes; an export writes those that there are
            if shown and engine.is_animation:
                _follow_tools(engine, scene, layer, finished, frame)
            if scene.infrared.label_path:
                path = label_path(scene, suffix, engine.is_animation)
                picture = file_path(scene, suffix, engine.is_animation) if scene.infrared.band_exr_path else path
                found = seen["instance"], images["Temperature"]
                write_labels(path, picture.with_suffix(".exr").name, scene, surfaces, solver_scene, found)
            groups = _write_files(scene, layer, suffix, engine.is_animation, finished, job.film)
            if shown and groups:
                finished_groups[layer] = groups


def _motion_facts(scene) -> dict[str, object]:
    """When a picture saw its scene, by the names that files give it; nothing if it was at one time."""
    exposure = read_exposure(scene)
    if not exposure.times:
        return {}
    frames = {"shutterOpen": exposure.opened, "shutterClose": exposure.closed}
    return {**frames, "sensorLag": scene.infrared.sensor_lag, "motionSteps": len(exposure.times)}


def _render(engine, job: RenderJob, layer: str) -> dict[str, np.ndarray] | None:
    """Run a job and show its images in the render result, which end there; None if no pass was finished."""
    x0, y0, x1, y1 = job.scene.camera.pixels
    result = engine.begin_result(0, 0, x1 - x0, y1 - y0, layer=layer)
    try:
        job.start()
        _watch(engine, job, result)
        images = job.final_images()
        if images:
            write_images(result, images)
    finally:
        engine.end_result(result)
    return images


def _keep(order: Sequence[str], layer: str, images: dict, frame: FinishedFrame) -> None:
    """Add a finished view layer to those of the last render, in the order in which Blender shows them.

    order: names of the scene's view layers. When a layer is rendered alone, Blender keeps the others of the same scene,
    slot and size, and so does this.
    """
    result = frame.scene, frame.slot, frame.size
    frames = {name: each for name, each in finished_frames.items() if (each.scene, each.slot, each.size) == result}
    frames = {name: replace(each, composited=frame.composited) for name, each in frames.items()} | {layer: frame}
    layers, groups = finished_layers | {layer: images}, dict(finished_groups)
    warnings, ends = dict(last_warnings), dict(last_ends)
    forget_last_render()
    finished_layers.update({name: layers[name] for name in order if name in frames and name in layers})
    finished_frames.update({name: frames[name] for name in order if name in frames})
    finished_groups.update({name: path for name, path in groups.items() if name in frames and name != layer})
    last_warnings.update(warnings)
    last_ends.update({name: end for name, end in ends.items() if name in frames})


def _follow_tools(engine, scene, layer: str, images: dict, frame: FinishedFrame) -> None:
    """Keep what the measuring tools read in a frame of an animation, and write it. A table that cannot be written, as a
    spreadsheet may hold it open, ends no render."""
    keep_frame(scene, layer, images, frame)
    try:
        write_frames(scene)
    except OSError as error:
        _warn(engine, f"{error}. The render goes on; Export Table writes the readings afterwards")


def _write_files(scene, layer: str, suffix: str, animation: bool, images: dict, film) -> Path | None:
    """Write the files that the scene asks for of a finished view layer; returns that of its temperature groups, if any.

    suffix: see layer_suffixes. images: see layer_images.
    """
    if scene.infrared.band_exr_path:
        for file_format in (each for each in FORMATS if each in scene.infrared.file_formats):
            write_layer(file_path(scene, suffix, animation, file_format), layer, images, file_format)
    if len(film.layers) == 1:
        return None
    path = group_path(scene, suffix, animation)
    write_groups(path, layer, images, film)
    return path


def size_beside_usual(passes: Sequence[RenderPass], further: Sequence[RenderPass]) -> float:
    """Size of the images of all passes divided by that of the passes which every render has.

    further: those of the passes which not every render has.
    """
    total, asked = (sum(len(each.channels) for each in some) for some in (passes, further))
    return total / (total - asked)


def images_beforehand(render, bands: int, copies: float) -> tuple[dict[str, float], str]:
    """Bytes of all images of a render by part, Blender's own among them, and what messages call this render.

    render: Blender's render settings. copies: number of float32 copies of all passes that are held at once.
    """
    width, height = rendered_size(render)
    frame = (width, height) if render.use_crop_to_border else render_size(render)
    around = math.prod(frame) - width * height  # Blender pastes what is rendered into its whole frame
    name = f"This render of {width:,} x {height:,} pixels" + (f" of {frame[0]:,} x {frame[1]:,}" if around else "")
    return memory_of_images(width * height, bands, copies, around=around), f"{name} and {bands} bands"


def _warn(engine, message: str) -> None:
    last_warnings[message] = None
    log.warning(message)
    engine.report({"WARNING"}, message)


def _await_last_save(engine, path: Path) -> bool:
    """Wait until a render that was ended by Esc has saved its passes in a checkpoint; False if Esc ends this wait.

    Its solver may be in the middle of a pass, and writing takes seconds: until then the file is missing or outdated.
    """
    job = _saving.get(path)
    if job is not None and job.is_alive():
        engine.update_stats("", "Saving the passes of the last render")
    while job is not None and job.is_alive():
        if engine.test_break():
            return False
        job.join(POLL)
    return True


def _finish_saving() -> None:
    """When Blender quits: end the renders that save their passes, and wait for those with a pass to save."""
    deadline = time.monotonic() + LAST_WAIT
    for job in list(_saving.values()):
        job.cancel()
        if job.film is not None:
            job.join(max(0.0, deadline - time.monotonic()))


# atexit would come too late: by then thread pools accept no work, and the solver needs one to end its pass. The hook
# that Python itself uses before that has no public name.
getattr(threading, "_register_atexit", atexit.register)(_finish_saving)


def _saved_passes(engine, path: Path, solver_scene, settings) -> Film | None:
    """The first passes of this render in a checkpoint or a film; None if there are none.

    A damaged file, or that of another render, is renamed, and the user is told.
    """
    try:
        return load(path, solver_scene, settings) if path.exists() else None
    except CheckpointError as error:
        _warn(engine, f"{error}. The render starts anew; the old file is kept as '{set_aside(path)}'")
        return None


def _keep_film(path: Path, job: RenderJob, layer: str, frame: int) -> None:
    """Write the film of a view layer, with what its images are called and how they are rendered. Raises OSError."""
    film, settings = job.film, job.settings
    with film.lock:
        about = {"layer": layer, "frame": frame, "facts": job.facts(), "correction": settings.correction._asdict()}
        save(path, film, fingerprint(job.scene, settings), about, FILM)
    log.info("%s: %d passes kept in %s", layer, film.passes, path)


def _solver_with_first_pictures(solve: Callable) -> Callable:
    """A function like `render` that first calls on_pass with films of large pixels, and with how large they are (step).

    The first pass of a large image takes long; these films are there at once.
    """

    def look_and_solve(scene, settings, on_pass, cancelled, image_copies, geometry=None):
        for step in takewhile(lambda step: step >= LEAST_STEP, steps(scene.camera)):
            geometry = build_geometry(scene, geometry)
            coarse = replace(scene, camera=coarser(scene.camera, step), moments=())
            render(coarse, hasty(settings, step), partial(on_pass, step=step), cancelled, geometry=geometry)
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return look_and_solve


def _solver_after(solve: Callable, look: Callable) -> Callable:
    """A function like `render` that first calls look(scene, geometry, threads, cancelled), which fills images of what
    the camera sees."""

    def look_and_solve(scene, settings, on_pass, cancelled, image_copies, geometry=None):
        geometry = build_geometry(scene, geometry)
        look(scene, geometry, settings.workers, cancelled)
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return look_and_solve


def _solver_with_kept_geometry(solve: Callable, geometries: dict[str, Geometry], layer: str) -> Callable:
    """A function like `render` that reuses a layer's geometry if no vertex and no triangle differs.

    geometries: by view layer, those of earlier renders; this one's is added.
    """

    def solve_and_keep(scene, settings, on_pass, cancelled, image_copies):
        geometry = geometries[layer] = build_geometry(scene, geometries.get(layer))
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return solve_and_keep


def _watch(engine, job: RenderJob, result) -> None:
    """Show progress and image until the job ends; Esc cancels it."""
    next_image, shown, shown_at = time.monotonic() + LIVE_INTERVAL, None, 0.0
    while job.is_alive():
        if engine.test_break():
            job.cancel()
            return
        now = time.monotonic()
        images = job.take_images()
        if images:
            write_images(result, images)
            engine.update_result(result)
            cost = job.snapshot_seconds + time.monotonic() - now
            next_image = now + max(LIVE_INTERVAL, cost / LIVE_SHARE)
        elif now >= next_image:
            job.request_images()
        engine.update_progress(job.progress())
        status = job.status()
        if status != shown or now - shown_at > 1.0:  # not each time: without a window Blender prints a line
            engine.update_stats("", status)
            shown, shown_at = status, now
        job.join(POLL)


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


def render_slot() -> int:
    """The slot of the render result that a render started now goes to, from 0."""
    image = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    return image.render_slots.active_index if image else 0


def finished_frame(scene, slot: int, camera, film) -> FinishedFrame:
    """The FinishedFrame of a solver's camera and film in the render result of a Blender scene."""
    x0, y0, x1, y1 = camera.pixels
    cropped = scene.render.use_border and scene.render.use_crop_to_border
    size, origin = ((x1 - x0, y1 - y0), (0, 0)) if cropped else ((camera.width, camera.height), (x0, y0))
    nodes = scene.compositing_node_group if hasattr(scene, "compositing_node_group") else scene.use_nodes  # Blender 5
    composited = scene.render.use_compositing and bool(nodes)
    told = bpy.app.is_job_running("RENDER")  # not so if a script waits for the render
    return FinishedFrame(scene.name, slot, size, origin, composited, film.weights, film.correction, told)


def write_images(result, images: dict[str, np.ndarray]) -> None:
    """Fill the passes of a render result, in bulk."""
    for render_pass in result.layers[0].passes:
        if render_pass.name in images:
            render_pass.rect.foreach_set(images[render_pass.name].reshape(-1))


def process_memory() -> float:
    """Peak memory of the whole process in MB; 0 on Windows, whose Python does not tell."""
    if resource is None:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / (1 << 10)


# Files ----------------------------------------------------------------------------------------------------------------


def layer_images(
    job: RenderJob, images: dict[str, np.ndarray], further: Sequence[RenderPass], facts: dict[str, object]
) -> dict:
    """The images of a finished view layer and the facts about them: the fields of FrameImages by name.

    further: the passes that not every render has. facts: more facts, by the names that files give them.
    """
    film = job.film
    return {
        "bands": [images[name] for name in film.band_names],
        "band_edges": film.band_edges,
        "radiance": images["Radiance"],
        "temperature": images["Temperature"],
        "noise": images["Noise"],
        "metadata": {**job.facts(), **facts},
        "further": {each.name: FurtherImage(images[each.name], each.channels, each.unit) for each in further},
    }


def write_groups(path: Path, layer: str, images: dict, film) -> None:
    """Write the temperature groups of a view layer's finished film. images: see layer_images. Raises OSError."""
    from ..output.group_exr import write_group_exr  # here, as OpenEXR is only for renders that write files

    write_group_exr(path, layered_image(film), images["metadata"])
    log.info("%s: %d layers of temperature groups written to %s", layer, len(film.layers), path)
