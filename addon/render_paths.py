# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the files of a render lie."""

from __future__ import annotations

from pathlib import Path

import bpy

from .output.formats import FORMATS, numbered, without_extension
from .solver.scene import SceneError


def check_paths(infrared) -> None:
    """Raise SceneError if a file is to lie beside a blend file that was never saved.

    Blender takes such a path for one in the folder that it happened to be started in.
    """
    for path in (infrared.band_exr_path, infrared.group_exr_path, infrared.checkpoint_path):
        if path.startswith("//") and not bpy.data.filepath:
            raise SceneError(f"Save the file first: '{path}' starts at its folder")


def file_path(scene, layer: str, animation: bool, file_format: str = "BAND_EXR") -> Path:
    """File of this frame in a format (a key of FORMATS); layer: as `_output_path` has it."""
    path = without_extension(scene.infrared.band_exr_path)
    return _output_path(scene, path, FORMATS[file_format].ending, layer, animation)


def group_path(scene, layer: str, animation: bool) -> Path:
    """File of this frame's temperature groups; layer: as `_output_path` has it."""
    return _output_path(scene, scene.infrared.group_exr_path, ".exr", layer, animation)


def checkpoint_path(scene, layer: str, animation: bool) -> Path:
    """File of this frame's finished passes; layer: as `_output_path` has it."""
    return _output_path(scene, scene.infrared.checkpoint_path, ".npz", layer, animation)


def _output_path(scene, path: str, extension: str, layer: str, animation: bool) -> Path:
    """File of this frame: '//' and '####' resolved, the layer's name added if it is given, the extension at the end."""
    file = numbered(bpy.path.abspath(path), extension, scene.frame_current, animation)
    return file.with_name(f"{file.stem}_{bpy.path.clean_name(layer)}{extension}") if layer else file
