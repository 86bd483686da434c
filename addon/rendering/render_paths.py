# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the files of a render lie, and those that are exported of it."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from itertools import chain, count
from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper

from ..output.formats import EXTENSIONS, FORMATS, numbered, without_extension
from ..solver.scene import SceneError


def check_paths(infrared) -> None:
    """Raise SceneError if a file is to lie beside a blend file that was never saved.

    Blender takes such a path for one in the folder that it happened to be started in.
    """
    for path in (infrared.band_exr_path, infrared.group_exr_path, infrared.checkpoint_path):
        if path.startswith("//") and not bpy.data.filepath:
            raise SceneError(f"Save the file first: '{path}' starts at its folder")


def layer_suffixes(layers: Iterable[str]) -> dict[str, str]:
    """What the names of files get for each view layer, such as '_ViewLayer'; nothing if there is only one.

    They are distinct even where layers differ in nothing but characters that these names do not keep (A.1 and A_1), or
    in upper and lower case, which some disks take for the same.
    """
    suffixes = {}
    for layer in dict.fromkeys(layers):
        clean, taken = f"_{bpy.path.clean_name(layer)}", {each.lower() for each in suffixes.values()}
        names = chain([clean], (f"{clean}_{number}" for number in count(2)))
        suffixes[layer] = next(name for name in names if name.lower() not in taken)
    return suffixes if len(suffixes) > 1 else dict.fromkeys(suffixes, "")


def file_path(scene, suffix: str, animation: bool, file_format: str = "BAND_EXR") -> Path:
    """File of this frame in a format (a key of FORMATS); suffix: as `_output_path` has it."""
    path = without_extension(scene.infrared.band_exr_path)
    return _output_path(scene, path, FORMATS[file_format].ending, suffix, animation)


def group_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's temperature groups; suffix: as `_output_path` has it."""
    return _output_path(scene, scene.infrared.group_exr_path, ".exr", suffix, animation)


def checkpoint_path(scene, suffix: str, animation: bool) -> Path:
    """File of this frame's finished passes; suffix: as `_output_path` has it."""
    return _output_path(scene, scene.infrared.checkpoint_path, ".npz", suffix, animation)


def _output_path(scene, path: str, ending: str, suffix: str, animation: bool) -> Path:
    """File of this frame: '//' and '####' resolved, then its view layer's suffix (see layer_suffixes), the ending."""
    file = numbered(bpy.path.abspath(path), ending, scene.frame_current, animation)
    return file.with_name(f"{file.name.removesuffix(ending)}{suffix}{ending}")


class Exporter(ExportHelper):
    """An ExportHelper that replaces known extensions alone: Blender's makes run_293.exr of run_293.2 and of run_293.7.

    extensions: those that it replaces.
    """

    extensions: Collection[str] = EXTENSIONS

    def target(self, suffix: str = "") -> str:
        """Path of a file: what was chosen, a view layer's suffix, the extension."""
        return f"{without_extension(self.filepath, self.extensions)}{suffix}{self.filename_ext}"

    def check(self, _context):
        chosen = self.filepath
        if os.path.basename(chosen):
            self.filepath = self.target()
        return self.filepath != chosen
