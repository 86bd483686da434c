# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of one frame as the writers of files take them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class FurtherImage(NamedTuple):
    """An image that only some renders have. image: (h, w) float32, or (h, w, n), row 0 at the bottom. channels: n
    letters. unit: of its values, empty for none.
    """

    image: np.ndarray
    channels: str = "V"
    unit: str = ""


@dataclass(frozen=True)
class FrameImages:
    """All images of one frame, and the facts that its files state. Images are (h, w) float32, row 0 at the bottom.

    bands: an image for each band, spectral radiance averaged over the band, W m-2 sr-1 um-1. band_edges: (b + 1,) um.
    radiance: through the sensor, W m-2 sr-1. temperature: apparent, K. noise: its standard error, K; None if unknown.
    metadata: facts by name, which are written as text, see `description.how_rendered`.
    further: more images, by the name of their pass. attributes: what OpenEXR files say about those, text by name.
    """

    bands: Iterable[np.ndarray]
    band_edges: np.ndarray
    radiance: np.ndarray
    temperature: np.ndarray
    noise: np.ndarray | None = None
    metadata: Mapping[str, object] = field(default_factory=dict)
    further: Mapping[str, FurtherImage] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
