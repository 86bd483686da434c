# SPDX-License-Identifier: GPL-3.0-or-later
"""Categories of objects for labels: the custom property `category` of an object, of a collection that it is in, or of
the Empty that places the collection."""

from __future__ import annotations

from itertools import chain

import bpy

from .custom_properties import describe
from .warnings import Warnings

KEY = "category"


class Categories:
    """The category of each object. An object's own wins over that of the Empty that places it as part of a collection,
    and both over those of their collections, of which the first by name counts."""

    def __init__(self, warnings: Warnings):
        self.warnings = warnings
        self._of_collections = {}
        for collection in bpy.data.collections:
            category = self._read(collection)
            for obj in collection.all_objects if category else ():
                self._of_collections.setdefault(obj, category)

    def of(self, obj, instancer=None) -> str:
        """The category of an evaluated object, an empty text for none. instancer: the object, evaluated, that it is an
        instance of; what is strewn over a surface is not of the surface's category."""
        owners = [obj] + [instancer] * (instancer is not None and instancer.instance_type == "COLLECTION")
        of_collections = (self._of_collections.get(each.original, "") for each in owners)
        return next(filter(None, chain(map(self._read, owners), of_collections)), "")

    def _read(self, block) -> str:
        value = block.get(KEY)
        if value is None or isinstance(value, str):
            return value if value and not value.isspace() else ""
        self.warnings.add(block.name, f"category is {describe(value)}, expected a name; it has none")
        return ""


def numbered_categories() -> dict[str, int]:
    """Numbers from 1 of all categories of the file, in the order of their names: the same in all frames."""
    blocks = (*bpy.data.objects, *bpy.data.collections)
    names = {block.get(KEY) for block in blocks if isinstance(block.get(KEY), str)}
    return {name: number for number, name in enumerate(sorted(filter(str.strip, names)), start=1)}
