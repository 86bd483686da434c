# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the outlines and handles of measuring tools lie in a region, and which of them a click means.

Places are (x, y) in the region's pixels. A handle is two indices into a tool's points: whose u and whose v it moves, so
that all four corners of a box can be taken hold of.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...output.marks import Place, is_closed, outline

REACH = 8  # pixels at a scale of 1: a click so near to a tool means it


def handles(kind: str, count: int) -> list[tuple[int, int]]:
    """The handles of a tool with so many points."""
    if kind in ("BOX", "ELLIPSE") and count > 1:
        return [(0, 0), (1, 0), (1, 1), (0, 1)]
    return [(index, index) for index in range(count)]


class Hit(NamedTuple):
    """What a click means. tool: its index. handle: which one, or None for the tool as a whole."""

    tool: int
    handle: tuple[int, int] | None


def hit(tools: Sequence[tuple[str, Sequence[Place]]], at: Place, reach: float, chosen: int = -1) -> Hit | None:
    """What a click at a place means: the nearest handle within reach, those of the chosen tool first; else the nearest
    outline within reach; None if there is neither. tools: kind and places of each.
    """
    order = sorted(range(len(tools)), key=lambda index: index != chosen)
    found = [
        (math.dist((places[a][0], places[b][1]), at), Hit(index, (a, b)))
        for index in order
        for kind, places in [tools[index]]
        for a, b in handles(kind, len(places))
    ]
    for near in ([each for each in found if each[1].tool == chosen], found):
        least = min(near, key=lambda each: each[0], default=None)
        if least is not None and least[0] <= reach:
            return least[1]
    lines = [(_distance(*tools[index], at), Hit(index, None)) for index in order]
    least = min(lines, key=lambda each: each[0], default=None)
    return least[1] if least is not None and least[0] <= reach else None


def _distance(kind: str, places: Sequence[Place], at: Place) -> float:
    """From a place to an outline, pixels; infinity if there is no line."""
    corners = outline(kind, places)
    if len(corners) < 2:
        return math.inf
    starts = np.array(corners if is_closed(kind) else corners[:-1])
    ends = np.array(corners[1:] + corners[:1] if is_closed(kind) else corners[1:])
    along, away = ends - starts, np.array(at) - starts
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip((along * away).sum(axis=1) / length, 0.0, 1.0)[:, None]
    return float(np.linalg.norm(away - share * along, axis=1).min())
