# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures for the path tracer: images over triangles, looked up by its own code."""

from typing import NamedTuple

import numba
import numpy as np

from tests.helpers.compiled import COMPILED


class Painted(NamedTuple):
    """row (m,): of the next five for each triangle, -1 for none. uv (r, 3, 2), kelvin_image, mixed (r,), share (r, 3),
    share_image (r,): as scene.Textures has them. images (i, height, width): padded to one size; size (i, 2): height and
    width. extension (i,) str, closest (i,) bool: as codes."""

    row: np.ndarray
    uv: np.ndarray
    kelvin_image: np.ndarray
    mixed: np.ndarray
    share: np.ndarray
    share_image: np.ndarray
    images: np.ndarray
    size: np.ndarray
    extension: np.ndarray
    closest: np.ndarray


_CODES = {"REPEAT": 0, "MIRROR": 1, "EXTEND": 2, "CLIP": 3}


def build_painted(textures, triangles):
    """The Painted of scene.Textures, or of None, in a scene of so many triangles."""
    row = np.full(triangles, -1)
    if textures is None:
        nothing = np.empty(0, np.int64)
        three = np.empty((0, 3, 2)), nothing, nothing, np.empty((0, 3)), nothing
        return Painted(row, *three, np.empty((0, 1, 1)), np.empty((0, 2), np.int64), nothing, np.empty(0, np.bool_))
    row[textures.triangle] = np.arange(len(textures.triangle))
    size = np.array([image.values.shape for image in textures.images], np.int64).reshape(-1, 2)
    images = np.zeros((len(size), *(size.max(axis=0) if len(size) else (1, 1))))
    for padded, image in zip(images, textures.images, strict=True):
        padded[: image.values.shape[0], : image.values.shape[1]] = image.values
    return Painted(
        row,
        textures.uv.astype(float),
        textures.temperature_image.astype(np.int64),
        textures.mixed.astype(np.int64),
        textures.share.astype(float),
        textures.share_image.astype(np.int64),
        images,
        size,
        np.array([_CODES[image.extension] for image in textures.images], np.int64),
        np.array([image.closest for image in textures.images], np.bool_),
    )


@numba.njit(**COMPILED)
def kelvin_at(painted, t, u, v):
    """Temperature in the image of triangle t at (u, v), NaN where none says it."""
    r = painted.row[t]
    return _look(painted, painted.kelvin_image[r], r, u, v) if r >= 0 else np.nan


@numba.njit(**COMPILED)
def mixed_at(painted, t, u, v):
    """The material that is mixed in at (u, v) of triangle t, and its share; -1 and 0 for none."""
    r = painted.row[t]
    if r < 0 or painted.mixed[r] < 0:
        return -1, 0.0
    share = _look(painted, painted.share_image[r], r, u, v)
    if np.isnan(share):
        a, b, c = painted.share[r]
        share = a + u * (b - a) + v * (c - a)
    return painted.mixed[r], share


@numba.njit(**COMPILED)
def _look(painted, image, r, u, v):
    if image < 0:
        return np.nan
    a, b, c = painted.uv[r]
    at = a + u * (b - a) + v * (c - a)
    height, width = painted.size[image]
    if painted.extension[image] == 3 and not (0.0 <= at[0] < 1.0 and 0.0 <= at[1] < 1.0):
        return np.nan
    x, y = at[0] * width, at[1] * height
    if painted.closest[image]:
        return _texel(painted, image, np.floor(x), np.floor(y))
    x, y = x - 0.5, y - 0.5
    total = 0.0
    for i in range(2):
        for j in range(2):
            column, row = np.floor(x) + i, np.floor(y) + j
            weight = (1.0 - abs(x - column)) * (1.0 - abs(y - row))
            total += weight * _texel(painted, image, column, row)
    return total


@numba.njit(**COMPILED)
def _texel(painted, image, column, row):
    height, width = painted.size[image]
    kind = painted.extension[image]
    return painted.images[image, int(_fold(row, height, kind)), int(_fold(column, width, kind))]


@numba.njit(**COMPILED)
def _fold(place, count, kind):
    if kind == 0:
        return place - count * np.floor(place / count)
    if kind == 1:
        place = place - 2 * count * np.floor(place / (2 * count))
        return min(place, 2 * count - 1 - place)
    return min(max(place, 0.0), count - 1.0)
