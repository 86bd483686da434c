# SPDX-License-Identifier: GPL-3.0-or-later
"""ENVI cubes, which remote-sensing tools read: a text header (.hdr) and beside it the bands as raw floats (.raw).

The header's fields are those of NV5's 'ENVI Header Files'; own ones follow it, in its style (lower case), which readers
skip or show. A band's `fwhm` is its width, as its response is a box.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from ..solver.physics.spectrum import band_names
from ..solver.system.files import replacing
from .description import BAND_UNIT, describe
from .frame import FrameImages

WHAT = "the band images"


def write_envi(path: str | os.PathLike, images: FrameImages) -> None:
    """Write the bands of one frame as an ENVI cube (BSQ, float32, little endian); values are kept to the last bit.

    path: of the header; the data take the same name with the ending .raw. Errors are those of `exr.write_band_exr`.
    The header is written last, so that a full disk leaves an older pair as it was.
    """
    path, bands, band_edges = Path(path), list(images.bands), images.band_edges
    shapes = {np.shape(band) for band in bands}
    if len(shapes) != 1 or len(bands) != len(band_edges) - 1:
        raise ValueError(f"'{path}' needs one image for each band and one shape, got {len(bands)} of {shapes}")
    height, width = shapes.pop()
    header = _header(width, height, band_edges, describe(f"bands: {BAND_UNIT}", band_edges, images.metadata))
    with replacing(path.with_suffix(".raw"), WHAT) as unfinished, open(unfinished, "wb") as file:
        for band in bands:
            file.write(np.ascontiguousarray(band[::-1], "<f4"))  # the top row first
    with replacing(path, WHAT) as unfinished:
        unfinished.write_text(header, encoding="ascii")


def _header(width: int, height: int, band_edges: np.ndarray, facts: Mapping[str, str]) -> str:
    edges = np.asarray(band_edges, np.float64)
    fields = {
        "description": "{Spectral radiance, averaged over each band}",
        "samples": width,
        "lines": height,
        "bands": edges.size - 1,
        "header offset": 0,
        "file type": "ENVI Standard",
        "data type": 4,  # float32
        "interleave": "bsq",
        "byte order": 0,  # little endian
        "wavelength units": "Micrometers",
        "wavelength": _list(0.5 * (edges[:-1] + edges[1:])),
        "fwhm": _list(np.diff(edges)),
        "band names": _list(band_names(edges)),
        "data units": BAND_UNIT,
        "z plot titles": f"{{Wavelength (um), Radiance ({BAND_UNIT})}}",
    }
    fields |= {re.sub("[A-Z]", lambda letter: " " + letter[0].lower(), name): value for name, value in facts.items()}
    return "ENVI\n" + "".join(f"{name} = {value}\n" for name, value in fields.items())


def _list(values: Iterable) -> str:
    return "{" + ", ".join(map(str, np.asarray(values).tolist())) + "}"
