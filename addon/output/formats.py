# SPDX-License-Identifier: GPL-3.0-or-later
"""The formats of files that a frame can be written to. Light to import: the writers are loaded when they write."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class FileFormat:
    """A format: how users read of it, and how its files' names end (so that one path serves several formats)."""

    name: str
    description: str
    ending: str

    @property
    def extension(self) -> str:
        """What such files end in in any case, such as '.exr'."""
        return self.ending[self.ending.rindex(".") :]


FORMATS = {
    "BAND_EXR": FileFormat(
        "Band EXR", "OpenEXR with every band, Radiance, Temperature, Noise and passes that were asked for", ".exr"
    ),
    "SPECTRAL_EXR": FileFormat(
        "Spectral EXR", "OpenEXR in the published layout for spectral images: W m-2 sr-1 nm-1", "_spectral.exr"
    ),
    "ENVI": FileFormat("ENVI Cube", "Header (.hdr) and bands (.raw) for remote-sensing tools", ".hdr"),
    "TIFF": FileFormat("Temperature TIFF", "Apparent temperature in kelvin, 32-bit float", ".tif"),
    "CAMERA_TIFF": FileFormat(
        "Camera TIFF",
        "Apparent temperature in hundredths of a kelvin, 16-bit, as thermal cameras write it; up to 655 K",
        "_16bit.tif",
    ),
}
ENUM_ITEMS = tuple((key, each.name, each.description) for key, each in FORMATS.items())
EXTENSIONS = {each.extension for each in FORMATS.values()}


def without_extension(path: str, extensions: Collection[str] = EXTENSIONS) -> str:
    """A path without the extension, if it has one of these; what else follows a dot belongs to the name: run_293.2"""
    stem, extension = os.path.splitext(path)
    return stem if extension.lower() in extensions else path


def numbered(path: str, extension: str, frame: int, several: bool) -> Path:
    """File of a frame: '####' becomes its number, which is added if there are several, and the extension at the end."""
    stem = path[: -len(extension)] if path.lower().endswith(extension) else path
    if several and "#" not in Path(stem).name:
        stem += "####"
    name = re.sub("#+", lambda digits: f"{frame:0{len(digits[0])}d}", Path(stem).name)
    return Path(stem).parent / f"{name}{extension}"


def write_file(file_format: str, path: Path, images: Mapping) -> None:
    """Write a frame. file_format: a key of FORMATS; images: the arguments of `exr.write_band_exr`, but for its path.

    Only OpenEXR has a place for `further` images; the other formats leave them out.
    Raises OSError naming the path if it cannot be written, ValueError naming the format if there is none of this key.
    """
    described = {name: images[name] for name in ("band_edges", "metadata")}
    match file_format:
        case "BAND_EXR":
            from .exr import write_band_exr

            write_band_exr(path, **images)
        case "SPECTRAL_EXR":
            from .exr import write_spectral_exr

            write_spectral_exr(path, **images)
        case "ENVI":
            from .envi import write_envi

            write_envi(path, images["bands"], **described)
        case "TIFF":
            from .tiff import write_temperature_tiff

            write_temperature_tiff(path, images["temperature"], **described)
        case "CAMERA_TIFF":
            from .tiff import write_camera_tiff

            write_camera_tiff(path, images["temperature"], **described)
        case _:
            raise ValueError(f"There is no file format '{file_format}', only {', '.join(FORMATS)}")
