# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of Blender's window for the pages, by ImageMagick; for what runs inside Blender."""

import subprocess

import bpy

from docs.tools.paths import IMAGES
from tests.real_blender.screen import capture

EDGE = 4  # pixels of an editor's own frame


def screenshot():
    """The whole screen, as PNG."""
    return capture("png:-")


def cropping(region, edge=EDGE):
    """ImageMagick's options that keep a region, or an area, of a screenshot."""
    top = bpy.context.window.height - region.y - region.height
    part = f"{region.width - 2 * edge}x{region.height - 2 * edge}+{region.x + edge}+{top + edge}"
    return ["-crop", part, "+repage"]


def keep(picture, name, *steps):
    """Write a screenshot, changed by ImageMagick's options, among the pages' images."""
    subprocess.run(["convert", "png:-", *steps, IMAGES / f"{name}.png"], check=True, input=picture)
