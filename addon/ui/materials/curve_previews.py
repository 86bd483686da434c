# SPDX-License-Identifier: GPL-3.0-or-later
"""Icons of emissivity curves for Blender's interface."""

from __future__ import annotations

from collections.abc import Callable

import bpy.utils.previews
import numpy as np

from .curve_image import draw_curve

THUMBNAIL_RANGE = 2.0, 16.0  # um: both thermal windows
THUMBNAIL_SIZE = 32, 32  # small, so that the line stays visible at the size of text
PANEL_SIZE = 256, 256

_previews = None  # bpy.utils.previews' collection while the add-on is registered
_drawn = {}  # name of a preview -> what it shows, to draw it again only when that differs


def curve_icon(name: str, points: np.ndarray, size=THUMBNAIL_SIZE, edges: np.ndarray | None = None) -> int:
    """The icon's number for a layout. It is drawn at first and whenever its points or bands differ.

    name: one icon for each. points: (n, 2) [um, emissivity]. size: (w, h) pixels. edges: (b + 1,) um, bands to show,
    which also set the range of wavelengths; None shows THUMBNAIL_RANGE.
    """
    shown = points.tobytes(), None if edges is None else edges.tobytes()
    low, high = THUMBNAIL_RANGE if edges is None else shown_range(edges)
    return image_icon(name, shown, lambda: draw_curve(points, low, high, size, edges))


def image_icon(name: str, shown, draw: Callable[[], np.ndarray]) -> int:
    """The number of an icon for a layout. It is drawn at first and whenever what it shows differs.

    name: one icon for each. shown: any value. draw: returns its image, see fill_preview.
    """
    preview = _previews.get(name) or _previews.new(name)
    if _drawn.get(name) != shown:
        fill_preview(preview, draw())
        _drawn[name] = shown
    return preview.icon_id


def shown_range(edges: np.ndarray) -> tuple[float, float]:
    """Shortest and longest wavelength (um) of a picture of bands: a tenth of their range more on both sides."""
    margin = 0.1 * (edges[-1] - edges[0])
    return max(0.0, float(edges[0] - margin)), float(edges[-1] + margin)


def fill_preview(preview, image: np.ndarray) -> None:
    """Give a preview, large and small, an image: (h, w, 4) float32, row 0 at the bottom."""
    preview.image_size = preview.icon_size = image.shape[1], image.shape[0]
    flat = np.ascontiguousarray(image, dtype=np.float32).ravel()
    preview.image_pixels_float.foreach_set(flat)
    preview.icon_pixels_float.foreach_set(flat)


def register():
    global _previews
    _previews = bpy.utils.previews.new()


def unregister():
    global _previews
    bpy.utils.previews.remove(_previews)
    _previews = None
    _drawn.clear()
