# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render: Blender's thread reads the scene and shows the image, a background thread runs the solver."""

from __future__ import annotations

import atexit
import logging
import math
import threading
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ..heat_settings import read_scale
from ..output.formats import layer_suffixes
from ..output.frame import FurtherImage
from ..reading.bands import read_band_edges
from ..reading.camera import render_size, rendered_size
from ..reading.motion import CancelledError, read_exposure, read_moving_scene
from ..reading.settings import read_settings
from ..reading.surfaces import SurfaceReader
from ..reading.views import view_names
from ..reading.world import WHERE_TO_SET, layer_world, unset_surroundings
from ..solver import Camera, Film, Scene, Settings, coverage_image, first_hit_images, layered_image, render
from ..solver.checkpoint import (
    CheckpointError,
    fingerprint,
    go_on,
    load,
    render_with_checkpoints,
    save,
    set_aside,
)
from ..solver.memory import check_memory, memory_beforehand, memory_of_images
from ..solver.system.files import check_writable
from .camera_effects import CameraEffects, read_detector
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
    view_suffixes,
    write_layer,
    written_formats,
)
from .render_job import RenderJob
from .render_passes import RenderPass, data_passes, further_passes, render_passes
from .solvers import solver_after, solver_with_first_pictures, solver_with_kept_geometry

log = logging.getLogger(__name__)

FILM, LABELS = "the film", "the labels"  # names, in messages, of files
POLL = 0.05  # s between looks at Esc and at the solver
LAST_WAIT = 30.0  # s, most that Blender waits at its end for passes to be saved
LIVE_INTERVAL = 0.5  # s, least time between two updates of the image
LIVE_SHARE = 0.1  # most of the time that updates may take
LEAST_OPENNESS = 1e-3  # share of rays that leave a scene; fewer may slip through where the walls of a room meet
IMAGE_COPIES = 5  # of all passes that are held at once: a live one, the last one, Blender's own and some on their way
LAYER_COPIES = 2  # of all passes that a finished view layer keeps: Blender's, and one for the export


# Checkpoint -> the last render that saves its passes there; it is alive for a while after Esc.
_saving: weakref.WeakValueDictionary[Path, RenderJob] = weakref.WeakValueDictionary()


def render_view_layer(engine, depsgraph) -> None:
    """Render the depsgraph's view layer into the render result, and into the files that the scene wants.

    Raises SceneError if the scene cannot be rendered, OSError if a file cannot be written; the images are in the render
    result even then.
    """
    engine.update_stats("", "Reading the scene")
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    layer, views = view_layer.name, view_names(scene.render)
    layers = [each.name for each in depsgraph.scene.view_layers if each.use]  # scene_eval would list its own first
    # Blender also renders scenes that the compositor of the shown one needs. Those do not get into the render result.
    shown = all(frame.scene == scene.name for frame in finished_frames.values())
    if shown and layer in layers[:1] and not scene.render.use_single_layer:
        forget_last_render()
    elif shown:
        for view in views:
            finished_layers.pop(picture_name(layer, view), None)
    if not scene.render.use_persistent_data:  # else Blender keeps the engine between frames and renders, as for Cycles
        engine.geometries.clear()
    check_paths(scene.infrared, engine.is_animation)
    settings, edges = read_settings(scene.infrared), read_band_edges(scene.infrared)
    passes, further = render_passes(scene, view_layer), further_passes(scene, view_layer)
    others = max(1, len(layers)) * len(views) - 1
    copies = (IMAGE_COPIES + LAYER_COPIES * others) * size_beside_usual(passes, further)
    foreseen, name = images_beforehand(scene.render, len(edges) - 1, copies)
    check_memory(foreseen, name)  # before the scene is read, which may take long
    log.info("%s: bands between %s um", layer, ", ".join(f"{edge:.6g}" for edge in edges))
    try:
        scenes, warnings, surfaces = read_moving_scene(engine, depsgraph, views)
    except CancelledError:
        return
    scene = depsgraph.scene_eval  # evaluated anew, if the scene moves
    needed = foreseen | memory_beforehand(scenes[0], copies)
    check_memory(needed, name, scenes[0].media)  # before Blender takes room for the images
    if scene.infrared.group_exr_path and not scenes[0].groups:
        warnings.append("Nothing is in a temperature group: no file of them is written")
    for warning in warnings:
        _warn(engine, warning)
    for each in passes[1:]:  # Combined is there already
        engine.add_pass(each.name, len(each.channels), each.channels, layer=layer)
    suffix = layer_suffixes([*layers, layer])[layer] if len(layers) > 1 else ""  # in the names of its files
    order = [picture_name(each.name, view) for each in depsgraph.scene.view_layers for view in views]
    render_of_layer = LayerRender(engine, depsgraph, surfaces, settings, copies, order if shown else [])
    for number, (view, ending) in enumerate(view_suffixes(scene.render).items()):
        if not render_of_layer.picture(scenes[number], view, number, suffix + ending):
            return


def picture_name(layer: str, view: str) -> str:
    """What the picture of a view layer is called. view: one of several with stereoscopy, else empty."""
    return f"{layer} {view}" if view else layer


@dataclass
class LayerRender:
    """Renders the pictures of a view layer, one for each of its views.

    engine: Blender's. surfaces: the reader that has read the scene. copies: number of float32 copies of all passes that
    are held at once. order: the names of all pictures in the order in which Blender shows them; none if they are not of
    the render result.
    """

    engine: bpy.types.RenderEngine
    depsgraph: bpy.types.Depsgraph
    surfaces: SurfaceReader
    settings: Settings
    copies: float
    order: Sequence[str]

    @property
    def scene(self) -> bpy.types.Scene:
        """The evaluated scene."""
        return self.depsgraph.scene_eval

    def picture(self, solver_scene: Scene, view: str, number: int, suffix: str) -> bool:
        """Render the picture of a view into the render result and into files; False if its user ended it.

        number: of the view. suffix: at the end of the names of its files. Raises as render_view_layer does.
        """
        engine, scene, layer = self.engine, self.scene, self.depsgraph.view_layer_eval.name
        if view:
            engine.active_view_set(view)
        name, effects = picture_name(layer, view), self._camera_effects(solver_scene.camera, number)
        stored = self._stored_passes(solver_scene, suffix)
        if stored is None:
            return False
        solve, kept, checkpoint = stored
        if not (bpy.app.background or engine.is_animation):  # somebody is waiting for it
            solve = solver_with_first_pictures(solve)
        sight = self._first_sight(solver_scene, suffix)
        for look in sight.looks:
            solve = solver_after(solve, look)
        solve = solver_with_kept_geometry(solve, engine.geometries, layer)
        scale, slot = read_scale(scene.infrared), render_slot()
        paint = partial(thermal_picture, scale=scale, primaries=working_primaries())
        fillers = [effects] * bool(effects) + sight.fillers
        job = RenderJob(solver_scene, self.settings, partial(solve, image_copies=self.copies), paint, fillers)
        if checkpoint:
            _saving[checkpoint] = job
        images = _render(engine, job, layer, view)
        if sight.mattes.passes:
            sight.mattes.stamp(engine.get_result())
        log.info("%s: %s", name, job.status())
        self._warn_at_end(name, job, effects)
        facts = ({"view": view} if view else {}) | _motion_facts(scene)
        if kept and job.film is not None and job.film.passes:
            _keep_film(kept, job, name, scene.frame_current, facts)
        if images:
            facts |= {"frame": scene.frame_current, **(effects.facts() if effects else {})}
            further = further_passes(scene, self.depsgraph.view_layer_eval)
            finished = layer_images(job, images, further, facts) | {"attributes": sight.mattes.attributes()}
            frame = finished_frame(scene, slot, solver_scene.camera, job.film, (layer, view))
            self._finish(job, finished, frame, sight.images.get("instance"), suffix)
        return not job.cancelled

    def _camera_effects(self, camera: Camera, number: int) -> CameraEffects | None:
        """The effects of a view's camera, if there are to be any. Cameras of views are detectors of their own, so each
        has other noise. number: of the view."""
        obj = (self.engine.camera_override or self.scene.camera).evaluated_get(self.depsgraph)
        detector = read_detector(self.scene, obj)
        if detector is None:
            return None
        return CameraEffects(replace(detector, seed=detector.seed + number), camera, self.scene.frame_current)

    def _stored_passes(self, solver_scene: Scene, suffix: str) -> tuple[Callable, Path | None, Path | None] | None:
        """A function like `render` that starts from the passes that files hold and saves them, the file of the film
        that is to be kept, and that of the checkpoint; None if the user ends the wait for it."""
        engine, scene, infrared = self.engine, self.scene, self.scene.infrared
        kept = path = saved = None
        if infrared.film_path:
            kept = film_path(scene, suffix, engine.is_animation)
            check_writable(kept, FILM)
            saved = _saved_passes(engine, kept, solver_scene, self.settings)
        solve = render if saved is None else partial(go_on, saved=saved)
        if infrared.checkpoint_path:
            path = checkpoint_path(scene, suffix, engine.is_animation)
            if not _await_last_save(engine, path):
                return None
            saved = _saved_passes(engine, path, solver_scene, self.settings) or saved
            interval = 60.0 * infrared.checkpoint_minutes
            solve = partial(render_with_checkpoints, path=path, interval=interval, saved=saved)
        return solve, kept, path

    def _first_sight(self, solver_scene: Scene, suffix: str) -> FirstSight:
        """What is asked for of what the camera sees first."""
        engine, scene, view_layer = self.engine, self.scene, self.depsgraph.view_layer_eval
        sight = FirstSight(Mattes(view_layer, self.surfaces))
        data, seen = data_passes(scene, view_layer), sight.images
        labels = {name: self.surfaces.labels(name) for name in self.surfaces.pass_indices if name in data}
        if scene.infrared.label_path:
            labels["instance"] = self.surfaces.labels("instance")
            check_writable(label_path(scene, suffix, engine.is_animation), LABELS)
        if data or labels:
            names = [name for name in data if name not in labels]
            sight.looks.append(lambda scene, *rest: seen.update(first_hit_images(scene, names, labels, *rest)))
            sight.fillers.append(lambda film, images: {asked.name: seen[name] for name, asked in data.items()})
        if sight.mattes.passes:
            sight.looks.append(sight.mattes.look)
            sight.fillers.append(lambda film, images: sight.mattes.images)
        transparent = scene.render.film_transparent
        if transparent or solver_scene.holdout is not None:
            sight.looks.append(lambda scene, *rest: seen.update(alpha=coverage_image(scene, transparent, *rest)))
            sight.fillers.append(lambda film, images: {"Combined": cut_out(images["Combined"], seen["alpha"])})
        return sight

    def _warn_at_end(self, name: str, job: RenderJob, effects: CameraEffects | None) -> None:
        """Warn of what only the picture tells. name: of the picture."""
        if effects and effects.warning():
            _warn(self.engine, f"{name}: {effects.warning()}")
        unset = unset_surroundings(layer_world(self.scene, self.depsgraph.view_layer_eval))
        if unset and job.film is not None and job.film.passes and job.film.openness > LEAST_OPENNESS:
            text = f"{name}: {unset}, and the scene is open: rays that leave it see 0 K. Set it in {WHERE_TO_SET}"
            _warn(self.engine, text)

    def _finish(self, job: RenderJob, images: dict, frame: FinishedFrame, instances, suffix: str) -> None:
        """Keep a finished picture, and write its files unless it was ended early: whoever asked for a file wants all
        passes, and an export writes those that there are.

        images: see layer_images. instances: (h, w) their numbers, if labels are to be written.
        """
        engine, scene, name, shown = self.engine, self.scene, picture_name(frame.layer, frame.view), bool(self.order)
        if shown:
            last_ends[name] = job.end()
            _keep(self.order, name, images, frame)
        if job.cancelled:
            return
        if shown and engine.is_animation:
            _follow_tools(engine, scene, name, images, frame)
        if scene.infrared.label_path:
            path = label_path(scene, suffix, engine.is_animation)
            formats = written_formats(scene.infrared)
            picture = file_path(scene, suffix, engine.is_animation, formats[0]) if formats else path.with_suffix(".exr")
            found = instances, images["temperature"]
            write_labels(path, picture.name, scene, self.surfaces, job.scene, found)
        groups = _write_files(scene, name, suffix, engine.is_animation, images, job.film)
        if shown and groups:
            finished_groups[name] = groups


@dataclass
class FirstSight:
    """What is asked for of what the camera sees first.

    mattes: the cryptomatte passes. looks: functions for solver_after. fillers: the further ones of film_images, which
    need them. images: what they have seen, by quantity.
    """

    mattes: Mattes
    looks: list[Callable] = field(default_factory=list)
    fillers: list[Callable] = field(default_factory=list)
    images: dict[str, np.ndarray] = field(default_factory=dict)


def _motion_facts(scene) -> dict[str, object]:
    """When a picture saw its scene, by the names that files give it; nothing if it was at one time."""
    exposure = read_exposure(scene)
    if not exposure.times:
        return {}
    frames = {"shutterOpen": exposure.opened, "shutterClose": exposure.closed}
    return {**frames, "sensorLag": scene.infrared.sensor_lag, "motionSteps": len(exposure.times)}


def _render(engine, job: RenderJob, layer: str, view: str) -> dict[str, np.ndarray] | None:
    """Run a job and show its images in the render result, which end there; None if no pass was finished."""
    x0, y0, x1, y1 = job.scene.camera.pixels
    result = engine.begin_result(0, 0, x1 - x0, y1 - y0, layer=layer, view=view)
    try:
        job.start()
        _watch(engine, job, result, f"{view}: " if view else "")
        images = job.final_images()
        if images:
            write_images(result, images)
    finally:
        engine.end_result(result)
    return images


def _keep(order: Sequence[str], name: str, images: dict, frame: FinishedFrame) -> None:
    """Add a finished picture to those of the last render.

    order: names of all pictures, as Blender shows them. name: of this one. When a layer is rendered alone, Blender
    keeps the others of the same scene, slot and size, and so does this.
    """
    result = frame.scene, frame.slot, frame.size
    frames = {key: each for key, each in finished_frames.items() if (each.scene, each.slot, each.size) == result}
    frames = {key: replace(each, composited=frame.composited) for key, each in frames.items()} | {name: frame}
    layers, groups = finished_layers | {name: images}, dict(finished_groups)
    warnings, ends = dict(last_warnings), dict(last_ends)
    forget_last_render()
    finished_layers.update({key: layers[key] for key in order if key in frames and key in layers})
    finished_frames.update({key: frames[key] for key in order if key in frames})
    finished_groups.update({key: path for key, path in groups.items() if key in frames and key != name})
    last_warnings.update(warnings)
    last_ends.update({key: end for key, end in ends.items() if key in frames})


def _follow_tools(engine, scene, name: str, images: dict, frame: FinishedFrame) -> None:
    """Keep what the measuring tools read in a frame of an animation, and write it. A table that cannot be written, as a
    spreadsheet may hold it open, ends no render."""
    keep_frame(scene, name, images, frame)
    try:
        write_frames(scene)
    except OSError as error:
        _warn(engine, f"{error}. The render goes on; Export Table writes the readings afterwards")


def _write_files(scene, name: str, suffix: str, animation: bool, images: dict, film) -> Path | None:
    """Write the files that the scene asks for of a finished picture; returns that of its temperature groups, if any.

    suffix: at the end of their names. images: see layer_images.
    """
    for file_format in written_formats(scene.infrared):
        write_layer(file_path(scene, suffix, animation, file_format), name, images, file_format)
    if len(film.layers) == 1:
        return None
    path = group_path(scene, suffix, animation)
    write_groups(path, name, images, film)
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


def _keep_film(path: Path, job: RenderJob, name: str, frame: int, facts: Mapping[str, object]) -> None:
    """Write the film of a picture, with what its images are called and how they are rendered. facts: more of these, by
    the names that files give them. Raises OSError."""
    film, settings = job.film, job.settings
    with film.lock:
        told = {**job.facts(), **facts}
        about = {"layer": name, "frame": frame, "facts": told, "correction": settings.correction._asdict()}
        save(path, film, fingerprint(job.scene, settings), about, FILM)
    log.info("%s: %d passes kept in %s", name, film.passes, path)


def _watch(engine, job: RenderJob, result, of: str) -> None:
    """Show progress and image until the job ends; Esc cancels it. of: what the status begins with."""
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
        status = of + job.status()
        if status != shown or now - shown_at > 1.0:  # not each time: without a window Blender prints a line
            engine.update_stats("", status)
            shown, shown_at = status, now
        job.join(POLL)


def render_slot() -> int:
    """The slot of the render result that a render started now goes to, from 0."""
    image = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    return image.render_slots.active_index if image else 0


def finished_frame(scene, slot: int, camera, film, layer_and_view: tuple[str, str]) -> FinishedFrame:
    """The FinishedFrame of a solver's camera and film in the render result of a Blender scene."""
    x0, y0, x1, y1 = camera.pixels
    cropped = scene.render.use_border and scene.render.use_crop_to_border
    size, origin = ((x1 - x0, y1 - y0), (0, 0)) if cropped else ((camera.width, camera.height), (x0, y0))
    nodes = scene.compositing_node_group if hasattr(scene, "compositing_node_group") else scene.use_nodes  # Blender 5
    composited = scene.render.use_compositing and bool(nodes)
    told = bpy.app.is_job_running("RENDER")  # not so if a script waits for the render
    return FinishedFrame(
        scene.name, slot, size, origin, composited, film.weights, film.correction, told, *layer_and_view
    )


def write_images(result, images: dict[str, np.ndarray]) -> None:
    """Fill the passes of a render result, in bulk."""
    for render_pass in result.layers[0].passes:
        if render_pass.name in images:
            render_pass.rect.foreach_set(images[render_pass.name].reshape(-1))


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
