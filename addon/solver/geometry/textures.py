# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures: what varies over a triangle is looked up where light meets it.

A mixed material is a fine grain of two materials: every point has one of them, which a hash of the point chooses with
the local share as its chance. So lobes are never blended, whatever kinds they are, and all that ask at one point agree.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..sampling.rng import path_key, uniform
from ..scene import EXTENSIONS, Texture, Textures
from ..system.kernels import INLINED, KERNEL, njit

# The three functions that look up or hash are calls and not inlined, unlike those around them: what every Interaction
# asks stays small where nothing is textured.
REPEAT, EXTEND, CLIP, MIRROR = range(len(EXTENSIONS))
_NOTHING = -1e30  # what an image shows where it is clipped
_FRACTIONS = 2.0**32  # barycentric coordinates as whole numbers; float32 has no finer ones from 2^-9 on
MATERIAL, PASSING = 0, 1  # what the hash of a point decides: its material, and whether rays pass


class TextureTable(NamedTuple):
    """Textures for the kernels.

    row: (m,) int32, row of the next five for each triangle, -1 for none; (0,) if no triangle has one. uv,
    temperature_image, mixed, share, share_image: see scene.Textures.
    texel: (texels,) float32 of all images, one behind the other. first: (images,) int64, where each begins. size:
    (images, 2) int64, width and height. extension: (images,) uint8, index into EXTENSIONS. closest: (images,) bool.
    """

    row: np.ndarray
    uv: np.ndarray
    temperature_image: np.ndarray
    mixed: np.ndarray
    share: np.ndarray
    share_image: np.ndarray
    texel: np.ndarray
    first: np.ndarray
    size: np.ndarray
    extension: np.ndarray
    closest: np.ndarray


_NONE = Textures(
    np.empty(0, np.int32),
    np.empty((0, 3, 2), np.float32),
    *(np.empty(0, np.int32) for _ in range(2)),
    np.empty((0, 3), np.float32),
    np.empty(0, np.int32),
)


def build_textures(textures: Textures | None, kept: np.ndarray | None, triangles: int) -> TextureTable:
    """The TextureTable of the triangles that are kept, (m,) indices of the scene's, of which there are so many; None
    for all."""
    textures = textures or _NONE
    row = np.full(triangles if len(textures.triangle) else 0, -1, np.int32)
    row[textures.triangle] = np.arange(len(textures.triangle))
    sizes = np.array([image.values.shape[::-1] for image in textures.images], np.int64).reshape(-1, 2)
    return TextureTable(
        row[kept] if row.size and kept is not None else row,
        np.ascontiguousarray(textures.uv, np.float32),
        *(np.ascontiguousarray(index, np.int32) for index in (textures.temperature_image, textures.mixed)),
        np.ascontiguousarray(textures.share, np.float32),
        np.ascontiguousarray(textures.share_image, np.int32),
        np.concatenate([np.empty(0, np.float32), *(_texels(image) for image in textures.images)]),
        np.concatenate(([0], np.cumsum(sizes.prod(axis=1))))[:-1].astype(np.int64),
        sizes,
        np.array([EXTENSIONS.index(image.extension) for image in textures.images], np.uint8),
        np.array([image.closest for image in textures.images], np.bool_),
    )


def _texels(image: Texture) -> np.ndarray:
    return np.ascontiguousarray(image.values, np.float32).ravel()


@njit(**INLINED)
def row_of(table, t):
    """Row of triangle t in the table, -1 if nothing varies over it but what its corners say."""
    return np.int64(table.row[t]) if table.row.size else np.int64(-1)


@njit(**KERNEL)
def temperature_in_image(table, r, u, v):
    """Temperature (K) at (u, v) of the triangle in row r of the table; -1 where no image says it."""
    if r < 0 or table.temperature_image[r] < 0:
        return -1.0
    return max(-1.0, _look_up(table, table.temperature_image[r], _coordinates(table, r, u, v)))


@njit(**KERNEL)
def mixed_share(table, r, u, v):
    """How much of the mixed material there is at (u, v) of the triangle in row r of the table, 0..1."""
    if r < 0 or table.mixed[r] < 0:
        return 0.0
    if table.share_image[r] >= 0:
        value = _look_up(table, table.share_image[r], _coordinates(table, r, u, v))
        if value != _NOTHING:
            return value
    share = table.share
    return (1.0 - u - v) * share[r, 0] + u * share[r, 1] + v * share[r, 2]


@njit(**KERNEL)
def grain(triangle, u, v, what):
    """Number in [0, 1) that belongs to a point of a triangle and decides on MATERIAL or PASSING there."""
    return uniform(path_key(path_key(np.uint64(triangle), np.int64(u * _FRACTIONS)), np.int64(v * _FRACTIONS)), what)


@njit(**INLINED)
def _coordinates(table, r, u, v):
    """Texture coordinates at (u, v) of the triangle in row r."""
    w, uv = 1.0 - u - v, table.uv
    return w * uv[r, 0, 0] + u * uv[r, 1, 0] + v * uv[r, 2, 0], w * uv[r, 0, 1] + u * uv[r, 1, 1] + v * uv[r, 2, 1]


@njit(**INLINED)
def _look_up(table, image, at):
    """Value of an image at texture coordinates, _NOTHING where it is clipped."""
    width, height = table.size[image, 0], table.size[image, 1]
    x, y, extension = at[0] * width, at[1] * height, table.extension[image]
    if extension == CLIP and not (0.0 <= x < width and 0.0 <= y < height):
        return _NOTHING
    if table.closest[image]:
        return _texel(table, image, np.int64(math.floor(x)), np.int64(math.floor(y)))
    column, row = math.floor(x - 0.5), math.floor(y - 0.5)
    right, up, column, row = x - 0.5 - column, y - 0.5 - row, np.int64(column), np.int64(row)
    below = (1.0 - right) * _texel(table, image, column, row) + right * _texel(table, image, column + 1, row)
    above = (1.0 - right) * _texel(table, image, column, row + 1) + right * _texel(table, image, column + 1, row + 1)
    return (1.0 - up) * below + up * above


@njit(**INLINED)
def _texel(table, image, column, row):
    extension = table.extension[image]
    column = _inside(column, table.size[image, 0], extension)
    row = _inside(row, table.size[image, 1], extension)
    return np.float64(table.texel[table.first[image] + row * table.size[image, 0] + column])


@njit(**INLINED)
def _inside(index, count, extension):
    """The column or row that an image of so many shows at an index that may lie outside."""
    if 0 <= index < count:
        return index
    if extension == REPEAT:
        return index % count
    if extension == MIRROR:
        index %= 2 * count
        return index if index < count else 2 * count - 1 - index
    return min(max(index, 0), count - 1)
