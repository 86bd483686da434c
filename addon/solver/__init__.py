# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral photon mapping of thermal infrared, without Blender: build a Scene, call render, get a Film.

What needs compiled kernels is loaded when it is first asked for: Numba is large, and a Scene does without.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

from .correction import Correction
from .scene import (
    AreaLight,
    Camera,
    Light,
    Material,
    PointLight,
    Response,
    Scene,
    SceneError,
    SpotLight,
    SunLight,
)
from .settings import Settings

if TYPE_CHECKING:
    from .film import Film
    from .first_hits import first_hit_images
    from .recombine import LayeredImage, layered_image
    from .render import render

_WITH_KERNELS = {  # name -> its module
    "Film": "film",
    "LayeredImage": "recombine",
    "first_hit_images": "first_hits",
    "layered_image": "recombine",
    "render": "render",
}

__all__ = [
    "AreaLight",
    "Camera",
    "Correction",
    "Film",
    "LayeredImage",
    "Light",
    "Material",
    "PointLight",
    "Response",
    "Scene",
    "SceneError",
    "Settings",
    "SpotLight",
    "SunLight",
    "first_hit_images",
    "layered_image",
    "render",
]


class _Package(ModuleType):
    """Importing a module makes it an attribute of its package; `render` stays the function all the same."""

    def __setattr__(self, name: str, value):
        of_that_name = name in _WITH_KERNELS and isinstance(value, ModuleType)
        super().__setattr__(name, getattr(value, name) if of_that_name else value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str):
    if name not in _WITH_KERNELS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_WITH_KERNELS[name]}", __name__), name)
