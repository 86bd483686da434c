# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last render left, for windows that are drawn and operators that export it. This loads no solver."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..solver.physics.correction import Correction


@dataclass(frozen=True)
class FinishedFrame:
    """How the images of a finished picture lie in Blender's render result, and what its temperatures are of."""

    scene: str  # its name
    slot: int  # of the render result, from 0
    size: tuple[int, int]  # width and height of the render result, pixels
    origin: tuple[int, int]  # pixel of the render result that the lower left pixel of the images is
    composited: bool  # the first layer of the render result is the compositor's
    weights: np.ndarray  # (b,) the sensor's response in each band
    correction: Correction  # of the temperatures when it was rendered
    told: bool = False  # Blender tells of the render in a line of text at the top of the editor
    layer: str = ""  # the view layer
    view: str = ""  # one of several pictures of it, see reading.views; else empty


# Pictures are named after their view layer; with stereoscopy there is one for each of its views, see
# final_render.picture_name. A render in the background may change these at any time: to use more than one entry, take a
# copy.
finished_layers: dict[str, dict] = {}  # picture -> its images and facts, see final_render.layer_images
finished_frames: dict[str, FinishedFrame] = {}  # picture -> how it lies in Blender's render result
finished_groups: dict[str, Path] = {}  # picture -> file of its temperature groups
last_warnings: dict[str, None] = {}  # what it warned of, in order, each once
last_ends: dict[str, str] = {}  # picture -> how many passes it has, and what noise, in words
last_failures: dict[str, str] = {}  # name of the scene -> why its render failed
TABLES = (finished_layers, finished_frames, finished_groups, last_warnings, last_ends, last_failures)


def forget_last_render() -> None:
    """Empty all of them: a new render begins, or another file is open."""
    for table in TABLES:
        table.clear()
