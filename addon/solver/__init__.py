# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectral photon mapping of thermal infrared, without Blender: build a Scene, call render, get a Film."""

from .kernel_cache import kept_kernels

with kept_kernels():
    from .film import Correction, Film
    from .first_hits import first_hit_images
    from .recombine import LayeredImage, layered_image
    from .render import render
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
