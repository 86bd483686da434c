# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects a view layer renders, as the interface tells it without an evaluation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

STRAND_TYPES = {"CURVES", "POINTCLOUD"}  # types of the objects that are hair or points, which become faces here
SURFACE_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META", *STRAND_TYPES}  # types of the objects that have faces


def layer_objects(layer_collection) -> Iterator:
    """The objects in a view layer's collection and those in it, without collections that are hidden from renders."""
    if not layer_collection.collection.hide_render:
        if not layer_collection.exclude:
            yield from layer_collection.collection.objects
        for child in layer_collection.children:
            yield from layer_objects(child)


def rendered_objects(objects: Iterable) -> dict:
    """Those of these objects, and of objects in collections that they instance, that are not hidden from renders.

    They are the keys, each once and in order.
    """
    found, new = {}, objects
    while new:
        shown = {obj: None for obj in new if not obj.hide_render}
        found |= shown
        collections = {obj.instance_collection: None for obj in shown if obj.instance_type == "COLLECTION"}
        collections.pop(None, None)
        new = [obj for collection in collections for obj in collection.all_objects if obj not in found]
    return found


def layers_objects(layers: Iterable) -> dict:
    """The objects that one or more of these view layers render: keys, each once and in order."""
    shown = (layer_objects(layer.layer_collection) for layer in layers)
    return rendered_objects(dict.fromkeys(obj for objects in shown for obj in objects))


def may_have_faces(obj) -> bool:
    """False if an object certainly has no face. That is known without an evaluation, which may take long."""
    if obj.type not in SURFACE_TYPES or len(obj.modifiers):
        return len(obj.modifiers) > 0
    if obj.type in STRAND_TYPES:
        return len(obj.data.points) > 0
    return obj.type != "MESH" or len(obj.data.polygons) > 0 or obj.data.is_editmode
