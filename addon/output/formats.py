# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of files that a frame can be written to. OpenEXR is not loaded before a file needs it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path

from .envi import write_envi
from .frame import FrameImages
from .tiff import write_camera_tiff, write_temperature_tiff


@dataclass(frozen=True)
class FileFormat:
    """A format: how users read of it, how the names of its files end (so that one path serves several formats), and the
    function that writes a frame to a file of it.
    """

    name: str
    description: str
    ending: str
    write: Callable[[Path, FrameImages], None]

    @property
    def extension(self) -> str:
        """The last part of the ending, which all programs know, such as '.exr'."""
        return self.ending[self.ending.rindex(".") :]


def _write_band_exr(path: Path, images: FrameImages) -> None:
    from .exr import write_band_exr

    write_band_exr(path, images)


def _write_spectral_exr(path: Path, images: FrameImages) -> None:
    from .exr import write_spectral_exr

    write_spectral_exr(path, images)


FORMATS = {
    "BAND_EXR": FileFormat(
        "Band EXR",
        "OpenEXR with every band, Radiance, Temperature, Noise and passes that were asked for",
        ".exr",
        _write_band_exr,
    ),
    "SPECTRAL_EXR": FileFormat(
        "Spectral EXR",
        "OpenEXR in the published layout for spectral images: W m-2 sr-1 nm-1",
        "_spectral.exr",
        _write_spectral_exr,
    ),
    "ENVI": FileFormat("ENVI Cube", "Header (.hdr) and bands (.raw) for remote-sensing tools", ".hdr", write_envi),
    "TIFF": FileFormat(
        "Temperature TIFF", "Apparent temperature in kelvin, 32-bit float", ".tif", write_temperature_tiff
    ),
    "CAMERA_TIFF": FileFormat(
        "Camera TIFF",
        "Apparent temperature in hundredths of a kelvin, 16-bit, as thermal cameras write it; up to 655 K",
        "_16bit.tif",
        write_camera_tiff,
    ),
}
ENUM_ITEMS = tuple((key, each.name, each.description) for key, each in FORMATS.items())
EXTENSIONS = {each.extension for each in FORMATS.values()}
_NOT_IN_NAMES = r"[\x00-,./:-@\[-^`{-\xfe]"  # what Blender's bpy.path.clean_name replaces by '_'


def without_extension(path: str, extensions: Collection[str] = EXTENSIONS) -> str:
    """A path without its extension, if that is one of these; any other dot belongs to the name, as in run_293.2."""
    stem, extension = os.path.splitext(path)
    return stem if extension.lower() in extensions else path


def replaced(targets: Iterable[Path], sources: Iterable[Path]) -> Path | None:
    """The first of the files that are read (sources) that writing the targets would replace, by whatever name or link;
    None if it would replace none."""
    known = {_identity(path): path for path in sources if path.exists()}
    return next((known[_identity(path)] for path in targets if path.exists() and _identity(path) in known), None)


def clash(targets: Iterable[tuple[str, Path]]) -> tuple[str, str, Path] | None:
    """The first two of the names that would write the same file, and the file; None if each has its own. targets: names
    with their files, of which one name may have several."""
    owners = {}
    for name, path in targets:
        owner = owners.setdefault(os.path.normcase(os.path.abspath(path)), name)
        if owner != name:
            return owner, name, path
    return None


def _identity(path: Path) -> tuple[int, int]:
    about = path.stat()
    return about.st_dev, about.st_ino


def numbered(path: str, extension: str, frame: int, several: bool, suffix: str = "") -> Path:
    """File of a frame: '####' becomes its number, and suffix and extension end the name.

    several: whether there are other frames; then the number is added where the path has no '#'. suffix: that of a view
    layer. A path that ends with a slash is a folder; a file in it is called after its number alone, as Blender's are.
    """
    stem = path[: -len(extension)] if path.lower().endswith(extension) else path
    if not os.path.basename(stem) or (several and "#" not in Path(stem).name):
        stem += "####"
    name = re.sub("#+", lambda digits: f"{frame:0{len(digits[0])}d}", Path(stem).name)
    return Path(stem).parent / f"{name}{suffix}{extension}"


def layer_suffixes(layers: Iterable[str]) -> dict[str, str]:
    """What is added to the names of each view layer's files, such as '_ViewLayer'; nothing if there is only one layer.

    Suffixes are distinct even if the names of layers differ only in characters that file names cannot have (A.1 and
    A_1), or in upper and lower case, which some disks do not tell apart.
    """
    suffixes = {}
    for layer in dict.fromkeys(layers):
        clean, taken = "_" + re.sub(_NOT_IN_NAMES, "_", layer), {each.lower() for each in suffixes.values()}
        names = chain([clean], (f"{clean}_{number}" for number in count(2)))
        suffixes[layer] = next(name for name in names if name.lower() not in taken)
    return suffixes if len(suffixes) > 1 else dict.fromkeys(suffixes, "")


def write_file(file_format: str, path: Path, images: Mapping) -> None:
    """Write a frame. file_format: a key of FORMATS; images: the fields of FrameImages by name.

    Only OpenEXR has a place for `further` images; the other formats leave them out.
    Raises OSError naming the path if it cannot be written, ValueError naming the format if there is none of this key.
    """
    if file_format not in FORMATS:
        raise ValueError(f"There is no file format '{file_format}', only {', '.join(FORMATS)}")
    FORMATS[file_format].write(path, FrameImages(**images))
