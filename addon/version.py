# SPDX-License-Identifier: GPL-3.0-or-later
"""The version, as the manifest states it."""

import tomllib
from functools import cache
from pathlib import Path


@cache
def version() -> str:
    """Version of the add-on, from blender_manifest.toml: in the installed extension's folder, or above the sources."""
    here = Path(__file__).parent
    manifest = next(
        path for path in (here / "blender_manifest.toml", here.parent / "blender_manifest.toml") if path.exists()
    )
    return tomllib.loads(manifest.read_text(encoding="utf-8"))["version"]
