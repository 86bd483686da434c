# SPDX-License-Identifier: GPL-3.0-or-later
"""Radiometric TIFF files of the apparent temperature, which thermal and mapping tools read.

`write_temperature_tiff`: kelvin as 32-bit floats, to the last bit. `write_camera_tiff`: hundredths of a kelvin as
16-bit numbers, as thermal cameras write them (FLIR's 'TLinear' TIFF with 0.01 K a count: degrees Celsius are
0.01 count - 273.15). TIFF 6.0, uncompressed, one page, the facts (`description.py`) as lines of the tag
ImageDescription. Unit and scale are also in GDAL's tag, so that QGIS and others based on GDAL show kelvin in both.
"""

from __future__ import annotations

import logging
import os
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..solver.system.files import replacing
from .description import describe
from .frame import FrameImages

log = logging.getLogger(__name__)

COUNT = 0.01  # K in the 16-bit file
SHORT, LONG, ASCII, RATIONAL = 3, 4, 2, 5  # types of TIFF
GDAL_METADATA = 42112


def write_temperature_tiff(path: str | os.PathLike, images: FrameImages) -> None:
    """Write the apparent temperature of a frame as float32 kelvin; values are kept to the last bit.

    Raises OSError naming the path if it cannot be written, ValueError if the image has more than 4 GB.
    """
    facts = describe("Temperature: K", images.band_edges, images.metadata)
    _write(path, np.asarray(images.temperature, "<f4"), 1.0, facts)


def write_camera_tiff(path: str | os.PathLike, images: FrameImages) -> None:
    """Write the apparent temperature of a frame as 16-bit counts of 0.01 K, rounded.

    Above 655.35 K the counts end, as a camera's do; the log says how many pixels that are.
    Raises as `write_temperature_tiff` does.
    """
    counts = np.rint(np.asarray(images.temperature, np.float64) / COUNT)
    largest = np.iinfo(np.uint16).max
    beyond = np.count_nonzero(counts > largest)
    if beyond:
        log.warning("'%s': %d pixels are hotter than %g K, where 16-bit TIFF files end", path, beyond, largest * COUNT)
    counts = np.clip(counts, 0, largest).astype("<u2")
    _write(path, counts, COUNT, describe(f"Temperature: {COUNT} K a count", images.band_edges, images.metadata))


def _write(path: str | os.PathLike, image: np.ndarray, scale: float, facts: Mapping[str, str]) -> None:
    """image: (h, w) '<f4' or '<u2', row 0 at the bottom. scale: K a count."""
    path, (height, width) = Path(path), image.shape
    if image.nbytes >= 1 << 32:
        raise ValueError(f"'{path}': a TIFF file ends at 4 GB, this image has {image.nbytes / 1e9:.1f} GB")
    tags = {  # number -> (type, value)
        256: (LONG, width),
        257: (LONG, height),
        258: (SHORT, 8 * image.itemsize),  # BitsPerSample
        259: (SHORT, 1),  # Compression: none
        262: (SHORT, 1),  # PhotometricInterpretation: black is zero
        270: (ASCII, "\n".join(f"{name}: {value}" for name, value in facts.items())),  # ImageDescription
        273: (LONG, 8),  # StripOffsets: after the file's header
        277: (SHORT, 1),  # SamplesPerPixel
        278: (LONG, height),  # RowsPerStrip
        279: (LONG, image.nbytes),  # StripByteCounts
        282: (RATIONAL, 1),  # XResolution
        283: (RATIONAL, 1),  # YResolution
        296: (SHORT, 1),  # ResolutionUnit: none
        339: (SHORT, 3 if image.dtype.kind == "f" else 1),  # SampleFormat: float, unsigned
        GDAL_METADATA: (ASCII, _gdal_metadata(scale)),
    }
    pixels = np.ascontiguousarray(image[::-1])  # the top row first
    directory = 8 + image.nbytes + image.nbytes % 2  # begins at an even byte
    with replacing(path, "the temperature image") as unfinished, open(unfinished, "wb") as file:
        file.write(struct.pack("<2sHI", b"II", 42, directory))
        file.write(pixels)
        file.write(bytes(image.nbytes % 2) + _directory(tags, directory))


def _directory(tags: Mapping[int, tuple[int, object]], begin: int) -> bytes:
    """An image file directory at the byte `begin` of a file, the values that do not fit into it right behind it."""
    entries, behind = b"", b""
    after = begin + 2 + 12 * len(tags) + 4
    for tag, (kind, value) in sorted(tags.items()):
        count = 1
        if kind == ASCII:
            data = str(value).encode("ascii") + b"\0"
            count = len(data)
        elif kind == RATIONAL:
            data = struct.pack("<II", value, 1)
        else:
            data = struct.pack("<I", value)  # a SHORT lies in the first two bytes
        if len(data) > 4:
            offset = after + len(behind)
            behind += data + bytes(len(data) % 2)
            data = struct.pack("<I", offset)
        entries += struct.pack("<HHI", tag, kind, count) + data.ljust(4, b"\0")
    return struct.pack("<H", len(tags)) + entries + bytes(4) + behind


def _gdal_metadata(scale: float) -> str:
    items = {"SCALE": scale, "OFFSET": 0, "UNITTYPE": "K"}
    lines = (f'<Item name="{name}" sample="0" role="{name.lower()}">{value}</Item>' for name, value in items.items())
    return f"<GDALMetadata>{''.join(lines)}</GDALMetadata>"
