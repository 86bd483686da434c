# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral photon mapping of thermal infrared, without Blender: build a Scene, call render, get a Film.

Names that need compiled kernels are loaded at their first use: Numba is large, and a Scene does not need it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from .physics.aerosols import mix_in
from .physics.correction import Correction
from .scene import (
    AreaLight,
    Camera,
    Grid,
    Light,
    Material,
    Medium,
    PointLight,
    Response,
    Scene,
    SceneError,
    Sky,
    SpotLight,
    SunLight,
    Texture,
    Textures,
)
from .settings import Settings

if TYPE_CHECKING:
    from .camera.coverage import coverage_image
    from .camera.first_hits import first_hit_images
    from .image.film import Film
    from .image.recombine import LayeredImage, layered_image
    from .passes import render

_WITH_KERNELS = {  # name -> its module
    "Film": "image.film",
    "LayeredImage": "image.recombine",
    "coverage_image": "camera.coverage",
    "first_hit_images": "camera.first_hits",
    "layered_image": "image.recombine",
    "render": "passes",
}

__all__ = [
    "AreaLight",
    "Camera",
    "Correction",
    "Film",
    "Grid",
    "LayeredImage",
    "Light",
    "Material",
    "Medium",
    "PointLight",
    "Response",
    "Scene",
    "SceneError",
    "Settings",
    "Sky",
    "SpotLight",
    "SunLight",
    "Texture",
    "Textures",
    "coverage_image",
    "first_hit_images",
    "layered_image",
    "mix_in",
    "render",
]


def __getattr__(name: str):
    if name not in _WITH_KERNELS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_WITH_KERNELS[name]}", __name__), name)
