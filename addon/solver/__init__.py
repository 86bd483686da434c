# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral photon mapping of thermal infrared, without Blender: build a Scene, call render, get a Film."""

from .kernel_cache import keep_kernels

keep_kernels()  # before the first kernel is defined, so before the imports below

from .film import Film  # noqa: E402
from .render import render  # noqa: E402
from .scene import (  # noqa: E402
    AreaLight,
    Camera,
    Light,
    Material,
    PointLight,
    Scene,
    SceneError,
    SpotLight,
    SunLight,
)
from .settings import Settings  # noqa: E402

__all__ = [
    "AreaLight",
    "Camera",
    "Film",
    "Light",
    "Material",
    "PointLight",
    "Scene",
    "SceneError",
    "Settings",
    "SpotLight",
    "SunLight",
    "render",
]
