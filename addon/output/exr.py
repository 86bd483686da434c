# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's own export: one OpenEXR file per frame with every band, 32-bit float, lossless.

A pass '7.50-7.90um' is the channel '7,50-7,90um.V' here, and 'Temperature' is 'Temperature.V'. OpenEXR separates layers
with dots: with the dots kept, Blender, Nuke and others read '50-7' of a layer '7', and Blender drops one-word channels
altogether. A comma for the decimal point follows Fichet et al. 2021, 'An OpenEXR layout for spectral images'; '.V' is
what Blender's own files end in.

Header attributes are text, because OpenEXR's Python module writes numbers as float32 and int32 (and 0 for larger
ones): `bandEdges` (um, space separated, float64 to the last digit), `wavelengthRange` (um), `units`, and the caller's.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from ..solver.files import replacing
from ..solver.spectrum import band_names

UNITS = "bands: W m-2 sr-1 um-1; Radiance: W m-2 sr-1; Temperature: K; Noise: K; bandEdges, wavelengthRange: um"


def channel_name(pass_name: str) -> str:
    """Channel of a pass in the file: '7.50-7.90um' is '7,50-7,90um.V'."""
    return pass_name.replace(".", ",") + ".V"


def write_band_exr(
    path: str | os.PathLike,
    bands: Iterable[np.ndarray],
    band_edges: np.ndarray,
    radiance: np.ndarray,
    temperature: np.ndarray,
    noise: np.ndarray,
    metadata: Mapping[str, object] | None = None,
) -> None:
    """Write every image of one frame to an EXR file; the values are kept to the last bit.

    bands: (h, w) float32 for each band, spectral radiance, W m-2 sr-1 um-1. band_edges: (b + 1,) um.
    radiance: (h, w) W m-2 sr-1. temperature, noise: (h, w) K. Row 0 is the bottom, as in Blender.
    metadata: more header attributes, written as text: passes, photons, seed, referenceTemperature (K), software.

    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written,
    ValueError if the images differ in shape or are not one per band.
    """
    path = Path(path)
    images = dict(zip(band_names(band_edges), bands, strict=True))
    images |= {"Radiance": radiance, "Temperature": temperature, "Noise": noise}
    shapes = {name: np.shape(image) for name, image in images.items()}
    if len(set(shapes.values())) != 1 or len(shapes["Radiance"]) != 2:
        raise ValueError(f"The images for '{path}' need one shape (height, width), got {shapes}")
    # EXR stores the top row first.
    channels = {channel_name(name): np.ascontiguousarray(image[::-1], np.float32) for name, image in images.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    file = OpenEXR.File(header | _attributes(band_edges, metadata or {}), channels)
    with replacing(path, "the band images") as unfinished:
        file.write(str(unfinished))


def _attributes(band_edges: np.ndarray, metadata: Mapping[str, object]) -> dict[str, str]:
    edges = [str(float(edge)) for edge in band_edges]
    attributes = {"bandEdges": " ".join(edges), "wavelengthRange": f"{edges[0]} {edges[-1]}", "units": UNITS}
    return attributes | {name: str(value) for name, value in metadata.items()}
