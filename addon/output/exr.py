# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files with every band of a frame, 32-bit float, lossless: one for Blender, one in the published layout.

`write_band_exr`: a pass '7.50-7.90um' is the channel '7,50-7,90um.V', and 'Temperature' is 'Temperature.V'. OpenEXR
separates layers with dots: with the dots kept, Blender, Nuke and others read '50-7' of a layer '7', and Blender drops
one-word channels altogether. '.V' is what Blender's own files end in.

`write_spectral_exr`: the layout of A. Fichet, R. Pacanowski and A. Wilkie, 'An OpenEXR layout for spectral images',
Journal of Computer Graphics Techniques 10 (2021). A band is the channel 'S0.7700,000000nm', its middle in nm with a
comma for the decimal point, and holds W m-2 sr-1 nm-1. An attribute of the channel's name holds the band's response.

All other facts (`description.py`) are text attributes, because OpenEXR's Python module writes numbers as float32 and
int32 (and 0 for larger ones).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from ..solver.physics.spectrum import band_names
from ..solver.system.files import replacing
from .console import without_harmless_messages
from .description import BAND_UNIT, describe
from .frame import FrameImages, FurtherImage
from .temperature_scale import TemperatureScale

IMAGE_UNITS = "Radiance: W m-2 sr-1; Temperature: K; Noise: K"
NM_PER_UM = np.float32(1000.0)


def channel_name(pass_name: str, channel: str = "V") -> str:
    """A channel of a pass in the file: that of '7.50-7.90um' is '7,50-7,90um.V'."""
    return f"{pass_name.replace('.', ',')}.{channel}"


def write_band_exr(path: str | os.PathLike, images: FrameImages, compressed: bool = True) -> None:
    """Write every image of one frame to an EXR file; the values are kept to the last bit.

    compressed: without loss; it takes most of the time.
    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written,
    ValueError if the images differ in shape or are not one per band.
    """
    names = [channel_name(name) for name in band_names(images.band_edges)]
    channels = dict(zip(names, images.bands, strict=True)) | _other_channels(images)
    facts = describe(f"bands: {BAND_UNIT}; {_units(images.further)}", images.band_edges, images.metadata)
    _write(path, channels, {**facts, **images.attributes}, compressed)


def write_spectral_exr(path: str | os.PathLike, images: FrameImages) -> None:
    """Write one frame in the published Spectral OpenEXR layout; errors are those of `write_band_exr`.

    The values of a band are those of its image divided by 1000, in float32. The others go along as in `write_band_exr`,
    and the layout's preview (R, G, B) shows Temperature in the default palette.
    """
    names = spectral_channel_names(images.band_edges)
    per_nm = (np.asarray(image, np.float32) / NM_PER_UM for image in images.bands)
    channels = dict(zip(names, per_nm, strict=True)) | _other_channels(images)
    preview = TemperatureScale().colours(images.temperature)
    channels |= {channel: preview[..., i] for i, channel in enumerate("RGB")}
    facts = describe(f"S0: W m-2 sr-1 nm-1; {_units(images.further)}", images.band_edges, images.metadata)
    layout = {"spectralLayoutVersion": "1.0", "emissiveUnits": "W.m^-2.sr^-1", "EV": 0.0}  # names and units are fixed
    edges = [np.format_float_positional(1000.0 * edge, precision=9, trim="-") for edge in images.band_edges]
    boxes = (f"{low}nm:1;{high}nm:1;" for low, high in zip(edges[:-1], edges[1:], strict=True))
    about = {**facts, **layout, **images.attributes, **dict(zip(names, boxes, strict=True))}
    _write(path, channels, about)


def spectral_channel_names(band_edges: np.ndarray) -> list[str]:
    """Channels in the published layout, such as 'S0.7700,000000nm': the middle of each band in nm.

    Six decimals as its authors' own files, and more where they would not tell two bands apart.
    """
    edges = np.asarray(band_edges, np.float64)
    middles = 500.0 * (edges[:-1] + edges[1:])
    for decimals in range(6, 64):
        values = [f"{middle:.{decimals}f}".replace(".", ",") for middle in middles]
        if len(set(values)) == len(values):
            break
    return [f"S0.{value}nm" for value in values]


def _other_channels(images: FrameImages) -> dict[str, np.ndarray]:
    """(h, w) by channel: all images of a frame but its bands."""
    named = {"Radiance": images.radiance, "Temperature": images.temperature, "Noise": images.noise}
    channels = {channel_name(name): image for name, image in named.items() if image is not None}
    for name, (image, letters, _unit) in images.further.items():
        planes = np.moveaxis(np.reshape(image, (*np.shape(image)[:2], len(letters))), -1, 0)
        channels |= {channel_name(name, letter): plane for letter, plane in zip(letters, planes, strict=True)}
    return channels


def _units(further: Mapping[str, FurtherImage]) -> str:
    """The units of all images but the bands, as files state them."""
    units = {name: each.unit for name, each in further.items() if each.unit}
    return "; ".join([IMAGE_UNITS, *(f"{name}: {unit}" for name, unit in units.items())])


def _write(
    path: str | os.PathLike,
    images: Mapping[str, np.ndarray],
    attributes: Mapping[str, object],
    compressed: bool = True,
) -> None:
    """images: (h, w) by channel, row 0 at the bottom."""
    path = Path(path)
    shapes = {name: np.shape(image) for name, image in images.items()}
    if len(set(shapes.values())) != 1 or len(next(iter(shapes.values()))) != 2:
        raise ValueError(f"The images for '{path}' need one shape (height, width), got {shapes}")
    # EXR stores the top row first.
    channels = {name: np.ascontiguousarray(image[::-1], np.float32) for name, image in images.items()}
    compression = OpenEXR.ZIP_COMPRESSION if compressed else OpenEXR.NO_COMPRESSION
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    file = OpenEXR.File(header | attributes, channels)
    with replacing(path, "the band images") as unfinished, without_harmless_messages():
        file.write(str(unfinished))
