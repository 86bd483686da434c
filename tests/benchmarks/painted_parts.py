# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes whose surfaces vary, for scenes of benchmarks: images of temperatures, mixed materials, smooth shading."""

from dataclasses import dataclass, replace

import numpy as np

from addon.solver import Material, Texture, Textures
from tests.benchmarks.speed_scenes import Parts, revolve

NOTHING = Material("nothing", 0.0, transmittance=1.0)
_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)


@dataclass
class Coat:
    """uv: (n, 3, 2) texture coordinates of n triangles. kelvin: an image of temperatures, K, or None. mixed: a material
    that is there in part, as the image share says; None for none."""

    uv: np.ndarray
    kelvin: Texture | None = None
    mixed: Material | None = None
    share: Texture | None = None


class PaintedParts(Parts):
    """Parts that may have a coat, and normals (m, 3, 3) at the corners of their triangles."""

    def __init__(self):
        super().__init__()
        self.coats, self.normals = [], []

    def add(self, mesh, temperature, material, at=(0.0, 0.0, 0.0), coat=None, normals=None):
        super().add(mesh, temperature, material, at)
        self.coats.append(coat)
        self.normals.append(np.zeros((len(mesh[1]), 3, 3)) if normals is None else normals)
        if coat is not None and coat.mixed is not None and coat.mixed not in self.materials:
            self.materials.append(coat.mixed)

    def scene(self, camera, edges, world_temperature):
        normals = np.concatenate(self.normals).astype(np.float32)
        scene = super().scene(camera, edges, world_temperature)
        return replace(scene, textures=self._textures(), corner_normals=normals if normals.any() else None)

    def _textures(self):
        """The Textures of all parts with a coat, None without."""
        ends = np.cumsum([len(triangles) for triangles in self.triangles])
        images, rows = [], []
        for coat, end, triangles in zip(self.coats, ends, self.triangles, strict=True):
            if coat is None:
                continue
            index = [-1, -1, -1 if coat.mixed is None else self.materials.index(coat.mixed)]
            for i, image in enumerate((coat.kelvin, coat.share)):
                if image is not None and all(image is not other for other in images):
                    images.append(image)
                if image is not None:
                    index[i] = next(place for place, other in enumerate(images) if other is image)
            own = np.arange(end - len(triangles), end)
            rows.append((own, coat.uv, np.repeat([index], len(own), axis=0)))
        if not rows:
            return None
        triangle, uv, index = (np.concatenate(of) for of in zip(*rows, strict=True))
        kelvin, share, mixed = index.T.astype(np.int32)
        nowhere = np.zeros((len(triangle), 3), np.float32)
        return Textures(triangle.astype(np.int32), uv.astype(np.float32), kelvin, mixed, nowhere, share, tuple(images))


def whole_square():
    """(2, 3, 2) texture coordinates of a `quad`, which an image fills."""
    return _SQUARE[[[0, 1, 2], [0, 2, 3]]]


def random_square(rng):
    """(2, 3, 2) texture coordinates of a `quad` on which an image lies turned, moved, and up to twice beside itself."""
    turn, (across, along) = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 2.0, 2)
    turned = np.array([(np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn))])
    return whole_square() * (across, along) @ turned.T + rng.uniform(-1, 1, 2)


def turned_profile(profile, segments):
    """Vertices, triangles, and normals (m, 3, 3) at their corners, of a surface of revolution of (n, 2) pairs of radius
    and height (m), radii above 0: normals are across the mean direction of both neighbours of a point."""
    vertices, triangles = revolve(profile, segments)
    along = np.gradient(np.asarray(profile, float), axis=0)
    out = np.column_stack((along[:, 1], -along[:, 0]))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    around = vertices[:segments, :2] / np.linalg.norm(vertices[:segments, :2], axis=1, keepdims=True)
    rings = out[:, :1, None] * around, np.repeat(out[:, 1:, None], segments, axis=1)
    return vertices, triangles, np.concatenate(rings, axis=-1).reshape(-1, 3)[triangles]
