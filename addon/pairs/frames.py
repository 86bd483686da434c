# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a data set of pairs: each frame by one of Blender's engines and by this one, from the same pose."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path

import bpy
import numpy as np

from ..interface import ENGINE
from ..kept import Kept
from ..output.coco import write_content
from ..output.formats import write_file
from ..output.png import KelvinScale, write_png16
from ..reading.settings import read_settings
from ..rendering.checks import scene_checks
from ..rendering.last_render import finished_layers
from ..solver.scene import SceneError
from ..solver.system.kernel_cache import source_digest
from .changes import Change, apply_draws, bind, used_cameras
from .constraints import check_constraints
from .folder import Folder, FrameFiles
from .ranges import frame_seed, read_rules

# Ids of Blender's engines by the names that options give them; that of EEVEE differs between versions of Blender
RGB_ENGINES = {"cycles": ("CYCLES",), "eevee": ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")}
_FILES = "band_exr_path", "group_exr_path", "checkpoint_path", "film_path"  # which the command writes in its own way
_NOT_SETTINGS = {"seed", "threads", "pass_offset", "time_limit"}  # they are chosen here, or change no image
_BANDS = "band_mode", "wavelength_min", "wavelength_max", "band_count", "band_edges"


@dataclass(frozen=True)
class PairOptions:
    """What is asked for. rgb: a key of RGB_ENGINES. samples: None for those of the scene. randomize: file of ranges.

    scale: of the 16-bit pictures.
    """

    folder: Path
    frames: Sequence[int]
    rgb: str = "cycles"
    samples: int | None = None
    seed: int = 0
    randomize: Path | None = None
    scale: KelvinScale = KelvinScale()
    kitti: bool = False


def render_pairs(scene, options: PairOptions) -> int:
    """Render the frames that are not complete yet; returns how many frames the folder has then. The scene is as before
    when this ends, however it does.

    Raises SceneError or RuntimeError, which Blender's own render raises, if it cannot be rendered, OSError if a file
    cannot be read or written.
    """
    rules = read_rules(options.randomize) if options.randomize else []
    layer = next((each for each in scene.view_layers if each.use), scene.view_layers[0])
    folder, frame, subframe = Folder(options.folder), scene.frame_current, scene.frame_subframe
    try:
        with Kept() as kept:
            _choose_settings(scene, layer, options, kept)
            scene.frame_set(options.frames[0])
            _check_panoramas(scene, options.rgb)
            changes = bind(rules, scene, layer)
            check_constraints(changes, scene, layer)
            _check(scene, layer, changes)
            folder.prepare(_about(scene, options))
            for number in options.frames:
                if not folder.is_complete(number):
                    _render_frame(scene, number, changes, options, folder.files(number))
    finally:
        scene.frame_set(frame, subframe=subframe)
    return folder.finish(options.kitti)


def _choose_settings(scene, layer, options: PairOptions, kept: Kept) -> None:
    """What both renders of all frames have in common, and files of other kinds turned off."""
    picture, image, infrared = scene.render, scene.render.image_settings, scene.infrared
    kept.keep(picture, "engine", "filepath")
    kept.set(picture, use_compositing=False, use_sequencer=False, use_multiview=False, use_file_extension=True)
    if picture.use_border:
        kept.set(picture, use_crop_to_border=True)
    kept.keep(image, *(["media_type"] if hasattr(image, "media_type") else []), "file_format", "color_mode")
    kept.keep(image, "color_depth")
    if hasattr(image, "media_type"):  # Blender 5
        image.media_type = "IMAGE"
    image.file_format, image.color_mode, image.color_depth = "PNG", "RGB", "8"
    for other in scene.view_layers:
        kept.set(other, use=other == layer)
    kept.set(infrared, **dict.fromkeys(_FILES, ""), pass_offset=0)
    kept.keep(infrared, "label_path", "seed")
    if infrared.passes or infrared.target_noise:
        kept.set(infrared, time_limit=0.0)  # how fast a machine is must not change the pairs
    _choose_engine(scene, options.rgb)
    if options.rgb == "cycles":
        kept.keep(scene.cycles, "seed")
    if options.samples is not None:
        owner, name = _samples(scene, options.rgb)
        kept.set(owner, **{name: options.samples})


def _samples(scene, rgb: str) -> tuple[object, str]:
    """Where an engine keeps its number of samples: settings and name."""
    return (scene.cycles, "samples") if rgb == "cycles" else (scene.eevee, "taa_render_samples")


def _check_panoramas(scene, rgb: str) -> None:
    """Raise SceneError if one of the scene's cameras is a panorama that both engines do not render alike."""
    for camera in used_cameras(scene):
        if camera.type != "CAMERA" or camera.data.type != "PANO":
            continue
        if rgb != "cycles":
            raise SceneError(f"Camera '{camera.name}' is a panorama, which only cycles renders")
        kind = camera.data.bl_rna.properties["panorama_type"].enum_items[camera.data.panorama_type]
        if kind.identifier != "EQUIRECTANGULAR":
            raise SceneError(
                f"Camera '{camera.name}': of panoramas of the type {kind.name} the RGB picture and the thermal one "
                "would not be aligned; choose Equirectangular"
            )


def _check(scene, layer, changes: Sequence[Change]) -> None:
    """Raise SceneError if the scene cannot be rendered, or not at one of the ends of what is drawn, or if something
    else sets what is drawn."""
    for end in (0, 1):
        with Kept() as kept:
            for change in changes:
                try:
                    change.apply(kept, change.end(end))
                except SceneError as error:
                    raise SceneError(f"{change.where}: {error}") from None
            scene.frame_set(scene.frame_current)
            if overwritten := kept.overwritten():
                raise SceneError(
                    f"{', '.join(overwritten)} is animated or driven, so that nothing can be drawn for it; draw for a "
                    "parent instead"
                )
            layer.update()
            errors = [check.text for check in scene_checks(scene, layer) if check.level == "ERROR"]
            if errors:
                which = f" with the {('low', 'high')[end]} ends of all ranges" if changes else ""
                raise SceneError(f"The scene cannot be rendered{which}: {errors[0]}")


def _about(scene, options: PairOptions) -> dict[str, object]:
    """All that pairs depend on, by name, but for the frame; with what the 16-bit pictures mean."""
    if not bpy.data.filepath:
        raise SceneError("Save the file first: a folder of pairs remembers which file they are of")
    settings, picture = read_settings(scene.infrared), scene.render
    ours = {
        each.name: repr(getattr(settings, each.name)) for each in fields(settings) if each.name not in _NOT_SETTINGS
    }
    files = [bpy.data.filepath, *sorted({bpy.path.abspath(each.filepath) for each in bpy.data.libraries})]
    return {
        "scene file": _digest(b"".join(Path(each).read_bytes() for each in files if Path(each).is_file())),
        "scene": scene.name,
        "resolution": [picture.resolution_x, picture.resolution_y, picture.resolution_percentage],
        "rgb": options.rgb,
        "samples": getattr(*_samples(scene, options.rgb)),
        "seed": options.seed,
        "randomize": _digest(options.randomize.read_bytes()) if options.randomize else "",
        "engine": source_digest(),
        "Blender": "{}.{}".format(*bpy.app.version),
        **{name: getattr(scene.infrared, name) for name in _BANDS},
        **ours,
        "scale": {
            "formula": "K = offset + value * step",
            "offset": options.scale.offset,
            "step": options.scale.step,
            "pass": _thermal_pass(scene),
        },
    }


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _thermal_pass(scene) -> str:
    """The pass that the 16-bit picture shows: what the camera delivers, if the scene has Camera Effects."""
    return "Camera Temperature" if scene.infrared.use_detector else "Temperature"


def _render_frame(scene, frame: int, changes: Sequence[Change], options: PairOptions, files: FrameFiles) -> None:
    """Render what is missing of a frame's files."""
    scene.frame_set(frame)
    seed = frame_seed(options.seed, frame)
    with Kept() as kept:
        drawn = apply_draws(changes, kept, options.seed, frame)
        scene.infrared.seed = seed
        if options.rgb == "cycles":
            scene.cycles.seed = seed
        seconds = None if files.rgb.exists() else _render_rgb(scene, options.rgb, files.rgb)
        facts = _render_thermal(scene, files, options.scale)
    facts |= {"seed": seed, "seconds_rgb": seconds, "drawn": drawn}
    _complete_labels(files, facts)
    print(f"Frame {frame}: RGB {seconds or 0.0:.1f} s, thermal {facts['seconds_thermal']:.1f} s, "
          f"noise {facts['noise']:.3g} K, {facts['coldest']:.1f} to {facts['hottest']:.1f} K", flush=True)  # fmt: skip


def _choose_engine(scene, name: str) -> None:
    """Let the next render be by one of Blender's engines. Raises SceneError if this Blender does not have it."""
    for each in RGB_ENGINES[name]:
        with suppress(TypeError):
            scene.render.engine = each
            return
    raise SceneError(f"This Blender has no engine '{name}', or its add-on is disabled")


def _render_rgb(scene, engine: str, path: Path) -> float:
    """Render by one of Blender's engines; returns the seconds that it took."""
    start, unfinished = time.monotonic(), path.with_name(f".{path.stem}.{os.getpid()}.png")
    _choose_engine(scene, engine)
    scene.render.filepath = str(unfinished)
    try:
        bpy.ops.render.render(write_still=True)
        os.replace(unfinished, path)
    except FileNotFoundError:
        raise SceneError(f"'{engine}' has written no picture; without a graphics card use cycles") from None
    finally:
        unfinished.unlink(missing_ok=True)
    return round(time.monotonic() - start, 2)


def _render_thermal(scene, files: FrameFiles, scale: KelvinScale) -> dict[str, object]:
    """Render by this engine and write its files but for the labels, which are not complete yet; returns the facts."""
    start, unfinished = time.monotonic(), _unfinished_labels(files)
    scene.render.engine, scene.infrared.label_path = ENGINE, str(unfinished)
    bpy.ops.render.render()
    images = next(iter(finished_layers.values()), None)
    if images is None or not unfinished.exists():
        raise SceneError("The render was ended early")
    name = _thermal_pass(scene)
    kelvin = images["temperature"] if name == "Temperature" else images["further"][name].image
    values, beyond = scale.values(kelvin)
    write_file("BAND_EXR", files.exr, images)
    texts = {"Description": f"{name}: K = {scale.offset:g} + {scale.step:g} * value"}
    write_png16(files.png, values, texts)
    return {
        "coldest": round(float(kelvin.min()), 3),
        "hottest": round(float(kelvin.max()), 3),
        "beyond_scale": beyond,
        "offset": scale.offset,
        "step": scale.step,
        "noise": round(float(np.percentile(images["noise"], 95)), 4),
        "passes": images["metadata"]["passes"],
        "seconds_thermal": round(time.monotonic() - start, 2),
    }


def _unfinished_labels(files: FrameFiles) -> Path:
    return files.labels.with_name(f".{files.labels.stem}.{os.getpid()}.json")


def _complete_labels(files: FrameFiles, facts: Mapping[str, object]) -> None:
    """Write the labels of a frame, with the facts about it: the last of its files."""
    unfinished = _unfinished_labels(files)
    content = json.loads(unfinished.read_text(encoding="utf-8"))
    (image,) = content["images"]
    image |= {"id": image["frame"], "file_name": files.png.name, **facts}
    for annotation in content["annotations"]:
        annotation["image_id"] = image["id"]
    write_content(files.labels, content)
    unfinished.unlink()
