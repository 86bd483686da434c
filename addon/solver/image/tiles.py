# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles: pieces of the image that threads render; the paths of all pixels of a tile are followed together."""

import itertools

import numpy as np

from ..sampling.rng import uniform

# Pixels on each side of a tile. Every bounce costs some ten calls of kernels, however many paths the tile has, so small
# tiles are slow. Large tiles leave threads idle at the end of a pass, and hold more rays at once (see memory).
TILE = 32


def tiles(window: np.ndarray, index: int, key: np.uint64) -> list[np.ndarray]:
    """Numbers of the pixels in a window x0, y0, x1, y1, as an array (h, w) for each tile, h and w at most TILE.

    Final gathers share rays within their tile only, so at a border with neighbours on one side alone (see
    final_gather.share). Therefore the borders move from pass to pass. index: of the pass. key: of a random start. In
    TILE passes each pixel is once in every row and column of a tile, so that both sides count alike in the mean.
    """
    x0, y0, x1, y1 = window
    numbers = np.arange((x1 - x0) * (y1 - y0)).reshape(y1 - y0, x1 - x0)
    rows, columns = (
        _pieces(length, (int(uniform(key, i) * TILE) + 7 * index) % TILE) for i, length in enumerate(numbers.shape)
    )
    return [numbers[y, x] for y, x in itertools.product(rows, columns)]


def _pieces(length: int, first: int) -> list[slice]:
    """A length cut into pieces of TILE, but for a first piece of `first` (none if 0) and the last piece."""
    ends = [0, *range(first or TILE, length, TILE), length]
    return [slice(a, b) for a, b in itertools.pairwise(ends)]
