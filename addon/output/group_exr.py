# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files of a render's layers, one for each temperature group, from which it is recombined.

A part for each layer, with a channel for each band, '8,00-8,50um.V', as `exr.write_band_exr` names them: W m-2 sr-1
um-1 beyond a blackbody at `referenceTemperature`, of what the layer emits at the temperature that it was traced at.
`layers` in the header of each part says in JSON, for each, its group, the spectrum of its material, its temperature in
the scene and while it was traced. `checksum` is the CRC-32 of all pixels and texts, as OpenEXR guards neither. The
other facts are those of every file.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR

from ..solver import LayeredImage
from ..solver.image.film import Correction
from ..solver.physics.layers import from_json, to_json
from ..solver.physics.spectrum import band_names
from ..solver.scene import SceneError, check_band_edges, check_temperature
from ..solver.system.files import replacing
from .console import without_harmless_messages
from .description import BAND_UNIT, CORRECTION_FACTS, describe
from .exr import channel_name, write_band_exr
from .frame import FrameImages

WHAT = "the temperature groups"


def write_group_exr(path: str | os.PathLike, image: LayeredImage, metadata: Mapping[str, object]) -> None:
    """Write the layers of a render; values are kept to the last bit.

    metadata: more header attributes, among them those of `description.how_rendered`.
    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    path = Path(path)
    units = f"all channels: {BAND_UNIT}, in excess of a blackbody at referenceTemperature"
    facts = describe(units, image.band_edges, metadata) | {"layers": to_json(image.layers)}
    facts["checksum"] = _checksum(image.excess, facts)
    names = [channel_name(name) for name in band_names(image.band_edges)]
    # ZIP would take off a tenth, as noise is hard to compress, and seconds for each image
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage} | facts
    parts = []
    for number, (layer, bands) in enumerate(zip(image.layers, image.excess, strict=True)):
        channels = {name: np.ascontiguousarray(band[::-1]) for name, band in zip(names, bands, strict=True)}
        parts.append(OpenEXR.Part(dict(header), channels, f"{number} {layer.name}"))
    with replacing(path, WHAT) as unfinished, without_harmless_messages():
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
        if len(file.parts) != len(layers):
            raise ValueError(f"{len(file.parts)} parts for {len(layers)} layers")
        channels = [[part.channels[name].pixels[::-1] for name in names] for part in file.parts]
        image = LayeredImage(
            np.array(channels, np.float32),
            layers,
            edges,
            float(facts["referenceTemperature"]),
            _numbers(facts["bandWeights"]),
            _correction(facts),
        )
        check_temperature(image.reference_temperature, "The reference")
        if len(image.weights) != len(names) or not np.all((image.weights >= 0.0) & (image.weights < np.inf)):
            raise ValueError(f"{len(image.weights)} bandWeights for {len(names)} bands: {facts['bandWeights']}")
        if not np.isfinite(image.excess.sum()):
            raise ValueError("it holds values that are not finite")
        if facts.pop("checksum") != _checksum(image.excess, facts):
            raise ValueError("its values are not those that were written")
    except OSError as error:
        raise OSError(f"Cannot read {WHAT} from '{path}': {error.strerror or error}") from error
    except Exception as error:  # whatever the readers of images and text meet in a damaged file
        raise SceneError(f"'{path}' holds no temperature groups, or is damaged: {error}") from error
    return image, {name: value for name, value in facts.items() if name not in ("layers", "name", "units")}


def write_recombined(
    path: str | os.PathLike,
    image: LayeredImage,
    temperatures: Mapping[str, float],
    metadata: Mapping[str, object] | None = None,
) -> np.ndarray:
    """Write the band images of a render for other temperatures, without compression, which would take most of the time.

    temperatures: K, by group; the header states them. metadata: the facts that were read with the layers.
    Returns the apparent temperature (h, w) float32, K. Errors: those of `LayeredImage.factors` and `write_band_exr`.
    """
    bands = image.recombined(temperatures)
    radiance = image.radiance(bands)
    temperature = image.temperature(radiance)
    facts = dict(metadata or {}, groupTemperatures=json.dumps(image.temperatures | dict(temperatures)))
    write_band_exr(path, FrameImages(bands, image.band_edges, radiance, temperature, metadata=facts), compressed=False)
    return temperature


def _checksum(excess: np.ndarray, facts: Mapping[str, object]) -> str:
    """CRC-32 of the pixels (layers, b, h, w) float32 and the facts that are text, but for a part's name."""
    texts = {name: value for name, value in facts.items() if isinstance(value, str) and name != "name"}
    code = zlib.crc32(json.dumps(texts, sort_keys=True).encode())
    return f"{zlib.crc32(np.ascontiguousarray(excess), code):08x}"


def _correction(facts: Mapping[str, str]) -> Correction:
    """The correction that facts state. Raises SceneError or ValueError if one of them makes no sense."""
    correction = Correction(**{field: float(facts[fact]) for fact, field in CORRECTION_FACTS.items() if fact in facts})
    for fact, field in CORRECTION_FACTS.items():
        value = getattr(correction, field)
        if fact.endswith("Temperature"):
            check_temperature(value, fact)
        elif not 0.0 < value <= 1.0:
            raise ValueError(f"{fact} is {value:g}")
    return correction


def _numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])
