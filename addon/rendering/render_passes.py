# SPDX-License-Identifier: GPL-3.0-or-later
"""Which passes a view layer has: one list for Blender, for the images of a render and for its files."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..output.description import BAND_UNIT
from ..reading.bands import read_band_edges
from ..solver.physics.spectrum import band_names
from ..solver.scene import SceneError


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
        return {"RGBA": "COLOR", "XYZ": "VECTOR"}.get(self.channels.upper(), "VALUE")


CAMERA_TEMPERATURE = "Camera Temperature"
# Names and channels are those of Cycles: Blender 5 renamed two.
_OBJECT_INDEX, _MATERIAL_INDEX = (
    ("Object Index", "Material Index") if bpy.app.version >= (5, 0, 0) else ("IndexOB", "IndexMA")
)
# Passes of what the middle of each pixel sees first: quantity -> (its switch in a view layer, its pass)
LAYER_SWITCHES = {
    "depth": ("use_pass_z", RenderPass("Depth", "Z", "m")),
    "position": ("use_pass_position", RenderPass("Position", "XYZ", "m")),
    "normal": ("use_pass_normal", RenderPass("Normal", "XYZ")),
    "object_index": ("use_pass_object_index", RenderPass(_OBJECT_INDEX, "X")),
    "material_index": ("use_pass_material_index", RenderPass(_MATERIAL_INDEX, "X")),
}
# Others: quantity -> (its switch in scene.infrared, its pass)
SCENE_SWITCHES = {
    "surface_temperature": ("use_surface_temperature", RenderPass("Surface Temperature", unit="K")),
    "emissivity": ("use_emissivity", RenderPass("Emissivity")),
    "transmittance": ("use_transmittance", RenderPass("Transmittance")),
}
# Cryptomatte: what the names of its passes begin with -> its switch in a view layer. Channels are those of Cycles.
CRYPTOMATTE_SWITCHES = {
    "CryptoObject": "use_pass_cryptomatte_object",
    "CryptoMaterial": "use_pass_cryptomatte_material",
    "CryptoAsset": "use_pass_cryptomatte_asset",
}


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


def register_passes(engine, scene, view_layer) -> None:
    """Register the passes of the scene's bands; none if the bands are wrong: the panel and the render report that."""
    try:
        passes = render_passes(scene, view_layer)
    except SceneError:
        return
    for each in passes:
        engine.register_pass(scene, view_layer, each.name, len(each.channels), each.channels, each.kind)


def further_passes(scene, view_layer) -> list[RenderPass]:
    """The passes that a view layer has because its user asks for them.

    What fills them is given to `final_render.RenderJob`; files take them as `frame.FurtherImage`.
    """
    return [
        *data_passes(scene, view_layer).values(),
        *cryptomatte_passes(view_layer),
        *camera_passes(scene),
    ]


def camera_passes(scene) -> list[RenderPass]:
    """The passes that `camera_effects.CameraEffects` fills, if they are asked for."""
    infrared = scene.infrared
    unit = "digital number" if infrared.detector_bits else "W m-2 sr-1"
    passes = [RenderPass("Camera Signal", unit=unit), RenderPass(CAMERA_TEMPERATURE, unit="K")]
    return passes if infrared.use_detector else []


def cryptomatte_kinds(view_layer) -> list[str]:
    """The keys of CRYPTOMATTE_SWITCHES that the user asks for."""
    return [kind for kind, switch in CRYPTOMATTE_SWITCHES.items() if getattr(view_layer, switch)]


def cryptomatte_passes(view_layer) -> list[RenderPass]:
    """The passes that `cryptomatte.Mattes` fills: for each kind so many that its levels fit, two in each."""
    count = (view_layer.pass_cryptomatte_depth + 1) // 2
    return [RenderPass(f"{kind}{i:02d}", "rgba") for kind in cryptomatte_kinds(view_layer) for i in range(count)]


def data_passes(scene, view_layer) -> dict[str, RenderPass]:
    """The passes of what the middle of each pixel sees first, by quantity; those that the user asks for.

    A quantity is one of `solver.camera.first_hits.QUANTITIES`, or an index that `surfaces.SurfaceReader` knows.
    """
    switches = ((view_layer, LAYER_SWITCHES), (scene.infrared, SCENE_SWITCHES))
    return {
        quantity: asked
        for owner, listed in switches
        for quantity, (switch, asked) in listed.items()
        if getattr(owner, switch)
    }
