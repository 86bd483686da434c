# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials as assets: with the picture of their curve, their source as description, and a catalogue for each category.

A catalogue is a line of the text file blender_assets.cats.txt that lies in the folder of the asset library, or beside
the .blend file; see "Asset Catalogs" in Blender's manual.
"""

from __future__ import annotations

import uuid
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Operator

from ...reading.materials import read_material
from ...solver.physics import library
from ...solver.scene import SceneError
from ...solver.system.files import replacing
from .curve_image import draw_curve
from .curve_previews import PANEL_SIZE, THUMBNAIL_RANGE, fill_preview
from .material_library import MaterialOperator, active_material

CATALOGUE_FILE = "blender_assets.cats.txt"
ROOT = "Infrared Photons"
CATALOGUES = uuid.uuid5(uuid.NAMESPACE_DNS, "infrared_photons")  # the name space of our catalogues' identifiers


def catalogue_id(category: str) -> str:
    """The same for the same category in every file, so that assets of several files meet in one catalogue."""
    return str(uuid.uuid5(CATALOGUES, category))


def mark_asset(material, default_emissivity: float) -> str:
    """Make the material an asset; returns its category. Raises SceneError if its emissivity makes no sense."""
    value = material.get("emissivity")
    points = np.column_stack(read_material(material, default_emissivity).curve)
    known = library.get(value) if isinstance(value, str) else None
    category = known.category if known else library.USER_CATEGORY
    if known:
        description = f"{known.name}, {known.kind}: {known.source}"
    elif len(points) > 1:
        description = f"Emissivity of {len(points)} points from {points[0, 0]:g} to {points[-1, 0]:g} um"
    else:
        description = f"Emissivity {points[0, 1]:g} at all wavelengths"
    material.asset_mark()
    data = material.asset_data
    data.description, data.catalog_id = description, catalogue_id(category)
    for tag in ("infrared", category):
        data.tags.new(tag, skip_if_exists=True)
    fill_preview(material.preview_ensure(), draw_curve(points, *THUMBNAIL_RANGE, PANEL_SIZE))
    return category


def catalogue_folder(blend: Path, libraries: list[Path]) -> Path:
    """Where the catalogues of a .blend file are kept: its asset library, else the folder above it that has some, else
    its own folder."""
    folders = [folder for folder in blend.parents if folder in libraries or (folder / CATALOGUE_FILE).exists()]
    return folders[0] if folders else blend.parent


def add_catalogue(folder: Path, category: str) -> None:
    """Name the category's catalogue in the folder's file, unless it is there. Raises OSError if that fails."""
    path, identifier = folder / CATALOGUE_FILE, catalogue_id(category)
    text = path.read_text(encoding="utf-8") if path.exists() else "VERSION 1\n\n"
    if identifier in text:
        return
    line = f"{identifier}:{ROOT}/{category}:{ROOT}-{category.replace(' ', '-')}\n"
    with replacing(path, "the asset catalogues") as unfinished:
        unfinished.write_text(text + ("" if text.endswith("\n") else "\n") + line, encoding="utf-8")


class INFRARED_OT_material_asset(MaterialOperator, Operator):
    """Mark this material as an asset, with the picture of its curve, its source and a catalogue"""

    bl_idname = "infrared.material_asset"
    bl_label = "Mark as Asset"

    def execute(self, context):
        material = active_material(context)
        try:
            category = mark_asset(material, context.scene.infrared.default_emissivity)
        except SceneError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not bpy.data.filepath:
            self.report({"WARNING"}, "Save the file and mark again: its catalogue is named in a text file beside it")
            return {"FINISHED"}
        libraries = [Path(library.path) for library in context.preferences.filepaths.asset_libraries]
        try:
            add_catalogue(catalogue_folder(Path(bpy.data.filepath), libraries), category)
        except OSError as error:
            self.report({"WARNING"}, f"The material is an asset, but has no catalogue: {error}")
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_material_asset,))
