# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of the image that threads render, each with the paths of all its pixels together."""

import itertools

import numpy as np

from ..sampling.rng import uniform

# Pixels on each side. Every bounce of a tile's paths costs some ten calls of kernels, whatever their number, so small
# tiles are slow; large ones leave threads idle at the end of a pass, and hold more rays at once (see memory).
TILE = 32


def tiles(window: np.ndarray, index: int, key: np.uint64) -> list[np.ndarray]:
    """Numbers of the pixels in a window x0, y0, x1, y1, by tile of (h, w), each at most TILE.

    Gathers share rays with those of their tile only, thus from one side alone at its borders (see final_gather.share).
    So the borders move from pass `index` to pass, from where key says, and TILE passes have each pixel in every row and
    column of a tile once: as many look to one side as to the other.
    """
    x0, y0, x1, y1 = window
    numbers = np.arange((x1 - x0) * (y1 - y0)).reshape(y1 - y0, x1 - x0)
    rows, columns = (
        _pieces(length, (int(uniform(key, i) * TILE) + 7 * index) % TILE) for i, length in enumerate(numbers.shape)
    )
    return [numbers[y, x] for y, x in itertools.product(rows, columns)]


def _pieces(length: int, first: int) -> list[slice]:
    """A length in pieces of TILE, but the first (none at 0) and last."""
    ends = [0, *range(first or TILE, length, TILE), length]
    return [slice(a, b) for a, b in itertools.pairwise(ends)]
