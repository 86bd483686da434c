# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a render: where they lie, and writing the images of a view layer."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import bpy

from ..output.formats import FORMATS, clash, layer_suffixes, numbered, without_extension, write_file
from ..reading.views import view_names, views_of
from ..solver.scene import SceneError

log = logging.getLogger(__name__)

PATHS = {  # settings of a scene, and what users read of them
    "band_exr_path": "Band Images",
    "group_exr_path": "Temperature Groups",
    "checkpoint_path": "Checkpoint",
    "film_path": "Keep Film",
    "label_path": "Labels",
}
_OUTPUT = "Blender's Output"


def check_paths(infrared, animation: bool = False) -> None:
    """Raise SceneError if two settings, or one and Blender itself, would write the same file, or if a path starts at
    the folder of the blend file ('//'), but that was never saved: Blender would then take the folder that it happened
    to be started in."""
    for path in (getattr(infrared, name) for name in PATHS):
        if path.startswith("//") and not bpy.data.filepath:
            raise SceneError(f"Save the file first: '{path}' starts at its folder")
    if both := clash(_files(infrared.id_data, animation)):
        *names, path = both
        called = " and ".join(PATHS.get(name, name) for name in names)
        raise SceneError(f"{called} would both write '{path}'; give one of them another path")


def _files(scene, animation: bool) -> Iterator[tuple[str, Path]]:
    """The settings with a path, and the files of this frame that they ask for, without suffixes of view layers."""
    for file_format in written_formats(scene.infrared):
        yield "band_exr_path", file_path(scene, "", animation, file_format)
    others = {"group_exr_path": group_path, "checkpoint_path": checkpoint_path}
    others |= {"film_path": film_path, "label_path": label_path}
    for name, path in others.items():
        if getattr(scene.infrared, name):
            yield name, path(scene, "", animation)
    if animation:  # of a still picture Blender does not say whether it will be written
        yield _OUTPUT, Path(bpy.path.abspath(scene.render.frame_path(frame=scene.frame_current)))


def written_formats(infrared) -> list[str]:
    """The formats, keys of FORMATS, in which a render writes band images; none without a path."""
    return [each for each in FORMATS if infrared.band_exr_path and each in infrared.file_formats]


def view_suffixes(render) -> dict[str, str]:
    """What the names of each view's files end with: Blender's suffixes, such as '_L', as Blender's own files do.

    With only one view it is nothing. If two views share a suffix, all have their names instead, see layer_suffixes.
    """
    suffixes = {each.name: each.file_suffix for each in views_of(render)}
    if len(suffixes) < 2:
        return dict.fromkeys(view_names(render), "")
    clash = len({each.lower() for each in suffixes.values()}) < len(suffixes)
    return layer_suffixes(suffixes) if clash else suffixes


def picture_suffixes(scene) -> list[str]:
    """What the names of the files of each picture of a render end with: of each view layer, and of each view of it."""
    layers = layer_suffixes(each.name for each in scene.view_layers if each.use).values()
    return [layer + view for layer in layers for view in view_suffixes(scene.render).values()]


def file_path(scene, suffix: str, animation: bool, file_format: str = "BAND_EXR") -> Path:
    """File of this frame in a format (a key of FORMATS); suffix: of its view layer, see layer_suffixes."""
    path = without_extension(scene.infrared.band_exr_path)
    return _output_path(scene, path, FORMATS[file_format].ending, suffix, animation)


def group_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's temperature groups; suffix: of its view layer, see layer_suffixes."""
    return _output_path(scene, scene.infrared.group_exr_path, ".exr", suffix, animation)


def checkpoint_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's finished passes; suffix: of its view layer, see layer_suffixes."""
    return _output_path(scene, scene.infrared.checkpoint_path, ".npz", suffix, animation)


def label_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's labels; suffix: of its view layer, see layer_suffixes."""
    return _output_path(scene, scene.infrared.label_path, ".json", suffix, animation)


def film_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's film; suffix: of its view layer, see layer_suffixes."""
    return _output_path(scene, scene.infrared.film_path, ".npz", suffix, animation)


def _output_path(scene, path: str, ending: str, suffix: str, animation: bool) -> Path:
    """File of this frame: the path with '//' and '####' resolved, then the view layer's suffix, then the ending."""
    return numbered(bpy.path.abspath(path), ending, scene.frame_current, animation, suffix)


def write_layer(path: Path, layer: str, images: dict, file_format: str) -> None:
    """Write a finished view layer. images: the fields of FrameImages. file_format: a key of FORMATS. Raises OSError."""
    write_file(file_format, path, images)
    log.info("%s: %s written to %s", layer, FORMATS[file_format].name, path)
