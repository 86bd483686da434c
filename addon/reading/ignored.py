# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of Blender and its other engines that this engine does not follow, and what it does instead."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

RAYS = ("camera", "diffuse", "glossy", "shadow")  # kinds that Blender's objects can be hidden from


def ignored_scene_settings(scene, layer) -> Iterator[str]:
    """What the settings of a scene and a view layer ask for and the engine does not do, and what it does instead."""
    if scene.render.use_multiview:
        yield "Stereoscopy is not supported: all views show the active camera's picture"
    if scene.render.use_motion_blur:
        yield "Motion blur is ignored: everything stands still in a picture"
    if scene.render.film_transparent:
        yield "A transparent film is ignored: what is behind the objects is seen at the temperature of the surroundings"
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
    if obj.holdout_get(view_layer=layer) or obj.is_shadow_catcher:
        yield "holdout and shadow catcher are ignored; the object is rendered like any other"
    hidden = [ray for ray in RAYS if not getattr(obj, f"visible_{ray}")]
    if obj.indirect_only_get(view_layer=layer) and "camera" not in hidden:
        hidden.insert(0, "camera")
    if hidden:
        yield f"ray visibility is ignored (off: {', '.join(hidden)}); all rays meet the object"


def _ignored_light_settings(light) -> Iterator[str]:
    if tuple(light.color) != (1.0, 1.0, 1.0) or getattr(light, "use_temperature", False):  # Blender 5
        yield "the light's color is ignored; its spectrum is a blackbody's at the object's temperature"
    if getattr(light, "exposure", 0.0) != 0:
        yield "the light's exposure is ignored; its energy alone is its power"
    if light.type == "AREA" and light.spread < np.pi - 1e-4:
        yield "the area light's spread is ignored; it shines after Lambert's law"
    if not getattr(light, "normalize", True):
        yield "that the light is not normalized is ignored; its energy is its power, whatever its size"
    if not light.use_shadow:
        yield "that the light casts no shadow is ignored; surfaces hide it"
    if light.type == "SPOT" and light.use_square:
        yield "the spot's square shape is ignored; its cone is round"
