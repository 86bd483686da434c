# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of Blender and its other engines that this engine does not follow, and what it does instead."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..solver.scene import NARROWEST_SPREAD
from .media import is_medium
from .views import ignored_view_settings
from .visibility import SEEN, read_visibility
from .volumes import is_gas_domain

# Kinds of Blender's rays that there are none of here: what passes a thin sheet, or is scattered, keeps its kind.
RAYS = "transmission", "volume_scatter"


def ignored_scene_settings(scene, layer) -> Iterator[str]:
    """What the settings of a scene and a view layer ask for and the engine does not do, and what it does instead."""
    yield from ignored_view_settings(scene)
    if scene.render.use_motion_blur and scene.render.motion_blur_shutter == 0.0:
        yield "Motion blur: the shutter is open for 0 frames, so it blurs nothing"
    if layer.samples != 0:
        yield f"View layer '{layer.name}': its {layer.samples} samples are ignored; all layers have the same passes"


PENCILS = {"GREASEPENCIL", "GPENCIL"}


def left_out(obj) -> str:
    """What of an object is not rendered at all; an empty text if it is, or if there is nothing to render."""
    return "grease pencil is not rendered" if obj.type in PENCILS else ""


def left_out_instance(instance) -> str:
    """As left_out, of an instance in a depsgraph."""
    obj, parent = instance.object, instance.parent
    if obj.type == "CURVE" and parent is not None and parent.original == obj.original:
        return "curves of its geometry nodes have no faces and are not rendered; Curve to Mesh gives them some"
    return left_out(obj)


def ignored_settings(obj, layer) -> Iterator[str]:
    """What an object asks for and the engine does not do, and what it does instead.

    layer: the view layer, whose collections may ask for more.
    """
    if obj.light_linking.receiver_collection or obj.light_linking.blocker_collection:
        yield "light linking is ignored; what it sends reaches all objects, and all of them hide it"
    if obj.type == "LIGHT":
        yield from _ignored_light_settings(obj.data)
        return
    if obj.is_shadow_catcher:
        yield "shadow catcher is ignored; the object is rendered like any other"
    hidden = [ray.replace("_", " ") for ray in RAYS if not getattr(obj, f"visible_{ray}")]
    if hidden:
        yield f"ray visibility is ignored for {' and '.join(hidden)}; diffuse, glossy, camera and shadow rays have one"
    if read_visibility(obj, obj, layer) != SEEN and _holds_gas(obj):
        yield "gas cannot be hidden or held out; it is rendered like any other"


def _holds_gas(obj) -> bool:
    return obj.type == "VOLUME" or is_gas_domain(obj) or any(is_medium(slot.material) for slot in obj.material_slots)


def _ignored_light_settings(light) -> Iterator[str]:
    if tuple(light.color) != (1.0, 1.0, 1.0) or getattr(light, "use_temperature", False):  # Blender 5
        yield "the light's color is ignored; its spectrum is a blackbody's at the object's temperature"
    if light.type == "AREA" and light.spread < NARROWEST_SPREAD:
        yield f"the area light's spread of {np.degrees(light.spread):g} degrees is too narrow; it spreads by 1 degree"
    if not light.use_shadow:
        yield "that the light casts no shadow is ignored; surfaces hide it"
