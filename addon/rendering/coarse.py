# SPDX-License-Identifier: GPL-3.0-or-later
"""Coarse pictures of an image, with large pixels, which are there long before the first pass of the image itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from ..solver import Camera, Settings

FIRST_PIXELS = 16_384  # most that the first picture may have
FIRST_PHOTONS = 10_000  # least that a pass may have


def steps(camera: Camera) -> Iterator[int]:
    """Width of the pixels of picture after picture, in pixels of the image: half as large each time, down to 1."""
    x0, y0, x1, y1 = camera.pixels
    step = 1
    while (x1 - x0) * (y1 - y0) > FIRST_PIXELS * step**2:
        step *= 2
    while step >= 1:
        yield step
        step //= 2


def coarser(camera: Camera, step: int) -> Camera:
    """The camera with pixels as large as step x step of its own. They may reach beyond its right and upper edge."""
    x0, y0, x1, y1 = camera.pixels
    left, right, bottom, top = camera.frame
    width, height = -(-camera.width // step), -(-camera.height // step)
    return dataclasses.replace(
        camera,
        width=width,
        height=height,
        frame=(
            left,
            left + (right - left) * (width * step / camera.width),
            bottom,
            bottom + (top - bottom) * (height * step / camera.height),
        ),
        window=(x0 // step, y0 // step, -(-x1 // step), -(-y1 // step)),
    )


def hasty(settings: Settings, step: int) -> Settings:
    """Settings of one pass at 1/step of the resolution, with as many photons for each pixel, or FIRST_PHOTONS."""
    photons = max(min(settings.photons_per_pass, FIRST_PHOTONS), settings.photons_per_pass // step**2)
    return dataclasses.replace(settings, passes=1, photons_per_pass=photons)


def enlarged(image: np.ndarray, camera: Camera, step: int) -> np.ndarray:
    """An image (h, w[, channels]) of coarser(camera, step), repeated over the camera's own pixels."""
    x0, y0, x1, y1 = camera.pixels
    rows, columns = (np.arange(first, end) // step - first // step for first, end in ((y0, y1), (x0, x1)))
    return image[rows[:, None], columns]
