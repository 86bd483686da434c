# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeing through: rays that pass some points of surfaces as if nothing were there.

Where a mixed material transmits everything, as between the leaves on a card, there is a hole, and no ray but a photon's
knows of a surface: a photon is counted on the whole card, and then goes on. Where but some grains transmit everything,
as at the blurred edge of a leaf, the rays of a render meet the surface: what is emitted and passes there is the mean
over the grains, so these bring no noise. While a render is planned, before it is known in which band sheets transmit
how much, rays pass by chance: such grains, and of thin sheets as large a share as they transmit in the mean.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..sampling.vectors import moved, put_vector, vector
from ..scene import Hidden
from ..system.kernels import INLINED, KERNEL, njit
from .interaction import interact, mixed_at, pass_on, pass_towards
from .segments import ENDLESS, Hits, RayBatch, Tracer, empty_ray_batch, trace_by_kind, transmit
from .stage import Stage, shine_through, transmits_anywhere
from .surfaces import Surfaces, used_materials
from .textures import PASSING, grain


class SeeingThrough(Tracer):
    """A tracer of rays that pass the points of surfaces with a chance that hangs on the material there."""

    def __init__(self, tracer: Tracer, surfaces: Surfaces, chance: np.ndarray, certain: bool):
        """tracer: of these surfaces. For chance and certain see with_holes."""
        self._uncut, self._surfaces, self._chance, self._certain = tracer, surfaces, chance, certain
        self._may = _may_pass(surfaces, chance)
        self.hidden = tracer.hidden
        parts = [tracer.seen_from(kind) for kind in range(len(Hidden))]
        if any(part is not tracer for part in parts):
            self._parts = tuple(
                self if part is tracer else SeeingThrough(part, surfaces, chance, certain) for part in parts
            )

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        ends = np.full(len(origin), ENDLESS) if reach is None else reach.copy()
        hits = self._uncut.trace(origin, direction, reach)
        ray, onward, met = np.arange(len(origin)), RayBatch(origin, direction), hits
        while len(ray):
            room = empty_ray_batch(len(ray))
            rays, passing = (origin, direction, ends), (self._may, self._chance, self._certain)
            passed = _pass(self._surfaces, passing, met, onward, rays, room, ray)
            ray, onward = ray[:passed], RayBatch(*(column[:passed] for column in room))
            unit = np.where(ends[ray] < ENDLESS, ends[ray] - hits.distance[ray], np.float32(1.0))
            met = self._uncut.trace(*onward, np.where(ends[ray] < ENDLESS, np.float32(1.0), ENDLESS))
            for column, found in zip(hits[:3], met, strict=False):
                column[ray] = found
            hits.distance[ray] = np.minimum(hits.distance[ray] + unit * met.distance, ENDLESS)
        return hits

    def trace_uncut(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        return self._uncut.trace(origin, direction, reach)


def let_through(
    trace: Callable[..., Hits],
    stage: Stage,
    hits: Hits,
    rays: tuple[RayBatch, np.ndarray],
    value: np.ndarray,
    among: np.ndarray,
) -> None:
    """Let rays go on through the thin sheets that they met, and lower what they bring by what these take. In hits,
    those that then meet nothing more have met nothing at all.

    trace: of a Tracer, with holes or without. hits: of the rays, with their reach (n,) float32, ENDLESS or in units of
    the direction's length. value: (n, b) float32. among: (k,) int64, which rays those are; overwritten.
    """
    whole, reach = rays
    onward, met = RayBatch(*(column[among] for column in whole)), Hits(*(column[among] for column in hits))
    while len(among):
        passed = _go_on(stage, met, onward, rays, value, among)
        among, onward = among[:passed], RayBatch(*(column[:passed] for column in onward))
        met = trace(*onward, np.where(reach[among] < ENDLESS, np.float32(1.0), ENDLESS))
        stopped = met.triangle >= 0
        hits.triangle[among[~stopped]], hits.distance[among[~stopped]] = -1, reach[among[~stopped]]
        among, onward = among[stopped], RayBatch(*(column[stopped] for column in onward))
        met = Hits(*(column[stopped] for column in met))


def unshadowed(
    tracer: Tracer, stage: Stage, rays: RayBatch, reach: np.ndarray, value: np.ndarray, kind: np.ndarray | None = None
) -> np.ndarray:
    """(n,) bool, which shadow rays meet nothing but thin sheets. Lowers what they bring by what these and media take.

    reach, value: see let_through; reach is overwritten. kind: (n,) uint8, of the rays, see Tracer.seen_from; None if
    nothing is hidden from them.
    """
    passes = transmits_anywhere(stage)
    if kind is None or not tracer.hides:
        hits = tracer.trace(*rays, reach.copy() if passes else reach)
        if passes:
            let_through(tracer.trace, stage, hits, (rays, reach), value, np.flatnonzero(hits.triangle >= 0))
    else:
        hits = trace_by_kind(tracer, kind, rays, reach)
        for each in range(len(Hidden)) if passes else ():
            met = np.flatnonzero((hits.triangle >= 0) & (kind == each))
            let_through(tracer.seen_from(each).trace, stage, hits, (rays, reach), value, met)
    if tracer.holds_media:
        transmit_all(tracer.cross(*rays, hits.distance), value)
    return hits.triangle < 0


@njit(**KERNEL)
def transmit_all(air, value):
    """Lower value (n, b) by what n segments take, see transmit."""
    for i in range(air.length.size):
        transmit(air, i, value[i])


@njit(**KERNEL)
def _go_on(stage, hits, onward, rays, value, among):
    """Lower value by what the surfaces take that n rays met, and send those of which anything is left on behind these,
    as the first rays; returns how many. onward, among: (n,), moved alike. Others: see let_through."""
    (whole, reach), kept = rays, np.int64(0)
    for i in range(hits.triangle.size):
        at, of = interact(stage.surfaces, hits, i, onward.direction), among[i]
        if shine_through(stage, at, value[of]):
            _set_out(stage.surfaces, at, (whole.origin, whole.direction, reach), of, onward, kept)
            among[kept] = of
            kept += 1
    return kept


@njit(inline="always")
def _set_out(surfaces, at, whole, of, onward, i):
    """Let a ray go on behind the surface at an Interaction, as ray i: towards where it ends, or in its direction.
    whole: origin, direction and reach of the rays from their beginning, of which this is number `of`."""
    origin, direction, reach = whole
    if reach[of] < ENDLESS:
        end = moved(vector(origin, of), reach[of], vector(direction, of))
        pass_towards(surfaces, at, end, onward, i)
    else:
        pass_on(surfaces, at, onward, i)
        put_vector(vector(direction, of), onward.direction, i)  # distances are in units of its length


def with_holes(tracer: Tracer, surfaces: Surfaces, chance: np.ndarray, certain: bool = False) -> Tracer:
    """The tracer of surfaces whose materials let rays pass with this chance, (materials,) float64, 0..1, 1 for holes;
    itself if none does. certain: rays pass only where all grains of a mixed material have one chance."""
    return SeeingThrough(tracer, surfaces, chance, certain) if chance[used_materials(surfaces)].any() else tracer


def _may_pass(surfaces: Surfaces, chance: np.ndarray) -> np.ndarray:
    """(m,) bool, triangles of which rays may pass some points."""
    may, table = chance[surfaces.material] > 0.0, surfaces.textures
    if table.row.size:
        mixed = np.flatnonzero(table.row >= 0)
        other = table.mixed[table.row[mixed]]
        may[mixed] |= (other >= 0) & (chance[other] > 0.0)
    return may


@njit(**INLINED)
def _is_sure(surfaces, at, chance):
    """Whether all grains at an Interaction let rays pass with the same chance."""
    other, share = mixed_at(surfaces, at)
    return not 0.0 < share < 1.0 or chance[other] == chance[surfaces.material[at.triangle]]


@njit(**KERNEL)
def _pass(surfaces, passing, hits, rays, whole, onward, ray):
    """Fill onward with those of n rays that pass what they meet, moved behind it, and move ray (n,) alike; returns how
    many. Where a ray has an end, the direction of the ray onward leads to it.

    passing: see SeeingThrough. whole: origin, direction and reach of all rays, of which these are rows `ray`.
    """
    (may, chance, certain), count = passing, np.int64(0)
    for i in range(hits.triangle.size):
        t, of = hits.triangle[i], ray[i]
        if t < 0 or not may[t]:
            continue
        at = interact(surfaces, hits, i, rays.direction)
        chosen = chance[at.material]
        if certain and not _is_sure(surfaces, at, chance):
            continue
        if chosen < 1.0 and grain(t, hits.u[i], hits.v[i], PASSING) >= chosen:
            continue
        _set_out(surfaces, at, whole, of, onward, count)
        ray[count] = of
        count += 1
    return count
