# SPDX-License-Identifier: GPL-3.0-or-later
"""Categories of objects for labels: the custom property `category` of an object or of a collection that it is in."""

from __future__ import annotations

import bpy

from .custom_properties import describe
from .warnings import Warnings

KEY = "category"


class Categories:
    """The category of each object. An object's own wins over those of its collections, of which the first by name
    counts."""

    def __init__(self, warnings: Warnings):
        self.warnings = warnings
        self._of_collections = {}
        for collection in bpy.data.collections:
            category = self._read(collection)
            for obj in collection.all_objects if category else ():
                self._of_collections.setdefault(obj, category)

    def of(self, obj) -> str:
        """The category of an evaluated object, an empty text for none."""
        return self._read(obj) or self._of_collections.get(obj.original, "")

    def _read(self, block) -> str:
        value = block.get(KEY)
        if value is None or isinstance(value, str):
            return value or ""
        self.warnings.add(block.name, f"category is {describe(value)}, expected a name; it has none")
        return ""


def numbered_categories() -> dict[str, int]:
    """Numbers from 1 of all categories of the file, in the order of their names: the same in all frames."""
    blocks = (*bpy.data.objects, *bpy.data.collections)
    names = {block.get(KEY) for block in blocks if isinstance(block.get(KEY), str)}
    return {name: number for number, name in enumerate(sorted(names - {""}), start=1)}
