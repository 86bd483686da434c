# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files of a render's layers, one for each temperature group, from which it is recombined.

A part for each layer, with a channel for each band, '8,00-8,50um.V', as `exr.write_band_exr` names them: W m-2 sr-1
um-1 beyond a blackbody at `referenceTemperature`, of what the layer emits at the temperature that it was traced at.
`layers` in the header of each part says in JSON, for each, its group, the spectrum of its material, its temperature in
the scene and while it was traced. The other facts are those of every file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from ..solver.files import replacing
from ..solver.film import Correction
from ..solver.layers import from_json, to_json
from ..solver.recombine import LayeredImage
from ..solver.scene import SceneError, check_band_edges
from ..solver.spectrum import band_names
from .description import BAND_UNIT, describe
from .exr import channel_name

WHAT = "the temperature groups"


def write_group_exr(path: str | os.PathLike, image: LayeredImage, metadata: Mapping[str, object] | None = None) -> None:
    """Write the layers of a render; values are kept to the last bit.

    metadata: more header attributes, among them those of `description.how_rendered`.
    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    path = Path(path)
    units = f"all channels: {BAND_UNIT}, in excess of a blackbody at referenceTemperature"
    facts = describe(units, image.band_edges, metadata) | {"layers": to_json(image.layers)}
    names = [channel_name(name) for name in band_names(image.band_edges)]
    # ZIP would take off a tenth, as noise is hard to compress, and seconds for each image
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage} | facts
    parts = []
    for number, (layer, bands) in enumerate(zip(image.layers, image.excess, strict=True)):
        channels = {name: np.ascontiguousarray(band[::-1]) for name, band in zip(names, bands, strict=True)}
        parts.append(OpenEXR.Part(header, channels, f"{number} {layer.name}"))
    with replacing(path, WHAT) as unfinished:
        OpenEXR.File(parts).write(str(unfinished))


def read_group_exr(path: str | os.PathLike) -> tuple[LayeredImage, dict[str, str]]:
    """The layers in such a file, and the facts that are not about this file alone, as text by name.

    Raises OSError naming the path if it cannot be read, SceneError if it is damaged or another kind of file.
    """
    path = Path(path)
    try:
        path.open("rb").close()
        file = OpenEXR.File(str(path), separate_channels=True)
        facts = {name: value for name, value in file.header().items() if isinstance(value, str)}
        edges = _numbers(facts["bandEdges"])
        check_band_edges(edges)
        layers = from_json(facts["layers"])
        names = [channel_name(name) for name in band_names(edges)]
        channels = [[file.channels(number)[name].pixels[::-1] for name in names] for number in range(len(layers))]
        image = LayeredImage(
            np.array(channels, np.float32),
            layers,
            edges,
            float(facts["referenceTemperature"]),
            _numbers(facts["bandWeights"]),
            Correction(float(facts["assumedEmissivity"]), float(facts["reflectedTemperature"])),
        )
        if len(image.weights) != len(names):
            raise ValueError(f"{len(image.weights)} bandWeights for {len(names)} bands")
        if not np.isfinite(image.excess.sum()):
            raise ValueError("it holds values that are not finite")
    except OSError as error:
        raise OSError(f"Cannot read {WHAT} from '{path}': {error.strerror or error}") from error
    except Exception as error:  # whatever the readers of images and text meet in a damaged file
        raise SceneError(f"'{path}' holds no temperature groups, or is damaged: {error!r}") from error
    return image, {name: value for name, value in facts.items() if name not in ("layers", "name", "units")}


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])
