# SPDX-License-Identifier: GPL-3.0-or-later
# ruff: noqa: N999  Blender's menus show the folder's name
"""The template's own script: Blender runs it when it starts or makes a new file with the template."""

from __future__ import annotations

import sys
from pathlib import Path

import addon_utils
import bpy

EXTENSION = "infrared_photons"
MISSING = "This template needs the extension Infrared Photons: install its zip and open the template again"


def register():
    """Enable the extension: a Blender that starts with a template has the template's add-ons, not the artist's."""
    module = installed_module()
    if module is None:
        print(MISSING)
        if not bpy.app.background:
            bpy.app.timers.register(show_missing, first_interval=1.0)
    elif is_starting():
        if module not in bpy.context.preferences.addons:
            bpy.context.preferences.addons.new().module = module  # Blender enables those that it finds here
    elif not addon_utils.check(module)[1]:
        addon_utils.enable(module, default_set=True)


def unregister():
    """Leave the extension enabled: other files may need it."""


def installed_module() -> str | None:
    """The name of the extension's module, or None if it is not installed."""
    repositories = [repo for repo in bpy.context.preferences.extensions.repos if repo.enabled]
    found = (repo.module for repo in repositories if Path(repo.directory, EXTENSION, "blender_manifest.toml").exists())
    return next((f"bl_ext.{repository}.{EXTENSION}" for repository in found), None)


def is_starting() -> bool:
    """Whether Blender starts and has not come to its add-ons yet; it cannot import extensions until then."""
    return "bl_ext" not in sys.modules


def show_missing() -> None:
    """Say it in the window, too."""
    bpy.context.window_manager.popup_menu(
        lambda popup, _context: popup.layout.label(text=MISSING), title="Infrared Photons", icon="ERROR"
    )
