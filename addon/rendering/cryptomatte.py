# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte passes: rays through each pixel tell which objects, materials and assets cover it, and how much."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ..output.cryptomatte import as_float, attributes, murmur_hash, ranked
from ..solver import Camera, first_hit_images
from ..solver.geometry.surfaces import Geometry
from .render_passes import cryptomatte_kinds, cryptomatte_passes

SAMPLES = 16  # rays through a pixel
_STRIP = 1 << 18  # pixels whose samples are held at once
_PIECE = 1 << 14  # pixels that are ranked at once


class Mattes:
    """The cryptomatte passes of a view layer that its user asks for."""

    def __init__(self, view_layer, surfaces):
        """surfaces: the reader that has read the scene."""
        self.layer, self.passes = view_layer.name, cryptomatte_passes(view_layer)
        self.names, self._labels = {}, {}  # by kind: names of the things, and (triangles,) 1 + which of them
        for kind in cryptomatte_kinds(view_layer):
            self.names[kind], self._labels[kind] = surfaces.mattes(kind)
        self.images: dict[str, np.ndarray] = {}  # by pass, once looked at

    def look(self, scene, geometry: Geometry, threads: int, cancelled: Callable[[], bool]) -> None:
        """Fill the images. threads, cancelled: see first_hit_images."""
        x0, y0, x1, y1 = scene.camera.pixels
        self.images = {each.name: np.zeros((y1 - y0, x1 - x0, 4), np.float32) for each in self.passes}
        ids = {kind: as_float([murmur_hash(name) for name in names]) for kind, names in self.names.items()}
        height = max(1, _STRIP // (x1 - x0))
        for start in range(y0, y1, height):
            end = min(start + height, y1)
            cameras = jittered(replace(scene.camera, window=(x0, start, x1, end)))
            seen = [
                first_hit_images(replace(scene, camera=camera), [], self._labels, geometry, threads, cancelled)
                for camera in cameras
            ]
            for kind in self.names:
                samples = np.stack([images[kind].ravel() for images in seen]).astype(np.int32)
                of_kind = [self.images[each.name] for each in self.passes if each.name.startswith(kind)]
                pieces = (samples[:, i : i + _PIECE] for i in range(0, samples.shape[1], _PIECE))
                strip = np.concatenate([ranked(piece, ids[kind], 2 * len(of_kind)) for piece in pieces])
                strip = strip.reshape(end - start, x1 - x0, -1)
                for level, image in enumerate(of_kind):
                    image[start - y0 : end - y0] = strip[..., 4 * level : 4 * level + 4]

    def attributes(self, prefix: str = "") -> dict[str, str]:
        """The attributes of files with these passes. prefix: what stands before the names of their channels."""
        named = (attributes(prefix + kind, names) for kind, names in self.names.items())
        return {key: value for each in named for key, value in each.items()}

    def stamp(self, render_result) -> None:
        """Tell Blender, for its compositor and its files, what the passes mean."""
        for key, value in self.attributes(f"{self.layer}.").items():
            render_result.stamp_data_add_field(key, value)


def jittered(camera: Camera, samples: int = SAMPLES) -> Iterator[Camera]:
    """Cameras whose middles of pixels are spread over each pixel of this one: at as many different distances from its
    left and from its lower edge, by Hammersley's points (the pixel is the image filter)."""
    left, right, bottom, top = camera.frame
    width, height = (right - left) / camera.width, (top - bottom) / camera.height
    for i in range(samples):
        across = ((i + 0.5) / samples - 0.5) * width
        up = (_radical_inverse(i) + 0.5 / samples - 0.5) * height
        yield replace(camera, frame=(left + across, right + across, bottom + up, top + up))


def _radical_inverse(i: int) -> float:
    """The binary digits of i, mirrored at the point: 0, 1/2, 1/4, 3/4 ..."""
    return int(f"{i:b}"[::-1], 2) / (1 << i.bit_length()) if i else 0.0
