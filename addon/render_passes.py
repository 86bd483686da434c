# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a view layer has: one list for Blender, for the images of a render and for its files."""

from __future__ import annotations

from dataclasses import dataclass

from .output.description import BAND_UNIT
from .scene_reader import read_band_edges
from .solver.spectrum import band_names


@dataclass(frozen=True)
class RenderPass:
    """A pass by its name in Blender. channels: a letter for each of its channels. unit: of its values, empty for none.

    Its image is (height, width) float32, or (height, width, channels) if it has several.
    """

    name: str
    channels: str = "V"
    unit: str = ""

    @property
    def kind(self) -> str:
        """What the compositor makes of it."""
        return {"RGBA": "COLOR", "XYZ": "VECTOR"}.get(self.channels, "VALUE")


def render_passes(scene, view_layer) -> list[RenderPass]:
    """Every pass of a view layer; raises SceneError if the bands are wrong or a name would be too long for Blender."""
    return [
        RenderPass("Combined", "RGBA"),
        *(RenderPass(name, unit=BAND_UNIT) for name in band_names(read_band_edges(scene.infrared))),
        RenderPass("Radiance", unit="W m-2 sr-1"),
        RenderPass("Temperature", unit="K"),
        RenderPass("Noise", unit="K"),
        *further_passes(scene, view_layer),
    ]


def further_passes(scene, view_layer) -> list[RenderPass]:
    """The passes that a view layer has because its user asks for them.

    What fills them is given to `final_render.RenderJob`; files take them as `description.FurtherImage`.
    """
    return []
