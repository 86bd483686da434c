# SPDX-License-Identifier: GPL-3.0-or-later
"""Where media are: which part of each segment lies in which medium.

A closed mesh bounds a medium. Its triangles are no surfaces: they stand in a BVH of their own, so that media may
overlap, touch each other and hold surfaces, and a surface between two media may be anywhere. Every crossing of a ray
with that mesh is found, one after the other, to infinity: between an entry and the next exit the ray is inside, and if
the first crossing is an exit, it has been inside from its start on.

That holds of a mesh whose parts lie apart. Parts that overlap, touch or lie in each other stand in BVHs of their own
(closed.Shell), and a ray is in the gas where it is in more parts whose normals point outwards than in such whose
normals point inwards, or in fewer: what overlaps counts once, and the inner wall of a hollow body leaves a cavity.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from ..physics.heat import HeatTable
from ..physics.media import MediumTable
from ..scene import Medium, SceneError
from ..system.kernels import KERNEL, njit
from .closed import fault_of, shells
from .grids import cross_boxes, empty_ahead, empty_march, fill_cells, place_grids
from .segments import FROM_CAMERA, Air, Hits, Peaks, RayBatch, Tracer, empty_bands
from .triangles import CLEAR

# A ray that runs within a face would meet it again after every step over it. So steps grow, by 2 in so many crossings:
# after 200 they are 76 times as long, 1e-4 of the mesh's size, and after 1000 longer than the mesh.
_DOUBLED_IN = 32
_FAR = np.float32(1e30)  # a ray that reaches farther leaves the scene
# First steps over a crossing between parts of a mesh that lie apart: rays from far away take longer ones.
_APART = 4.0


class _Crossings(NamedTuple):
    """n crossings of rays with one mesh. ray: int64. distance: float32, in units of the direction's length. leaves:
    bool, whether the ray leaves the mesh there."""

    ray: np.ndarray
    distance: np.ndarray
    leaves: np.ndarray


class _Stretches(NamedTuple):
    """n ways of rays inside a mesh. ray: int64. begin, end: float64, in units of the direction's length."""

    ray: np.ndarray
    begin: np.ndarray
    end: np.ndarray


class _Body:
    """A closed mesh: its shells and their signs, see closed.Shell; none if it is flat, thinner than rays can tell."""

    def __init__(self, medium: Medium, centre: np.ndarray):
        """centre: see Atmosphere. Raises SceneError, naming the medium, if its mesh is open."""
        fault = fault_of(medium.vertices, medium.triangles)
        if fault:
            raise SceneError(f"Medium '{medium.name}': its mesh is {fault}; a gas fills closed meshes")
        vertices = np.asarray(medium.vertices, np.float64) - centre
        step = CLEAR * float(np.abs(vertices[medium.triangles]).max())
        found = shells(vertices, medium.triangles, _APART * step)
        self.shells, self.signs = [_Shell(shell.corners, step) for shell in found], [shell.sign for shell in found]

    def stretches(self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray) -> _Stretches:
        """Where rays (n, 3) float32 are inside, in any order. limit: (n,) float32, where they end."""
        found = [shell.stretches(origin, direction, limit) for shell in self.shells]
        if len(found) == 1:
            return found[0]
        return _together(found, self.signs)


def _together(shells: list[_Stretches], signs: list[int]) -> _Stretches:
    """Where rays are in more shells of one sign than of the other. signs: of each shell."""
    none = np.empty(0)
    ray = np.concatenate([none.astype(np.int64), *(np.tile(shell.ray, 2) for shell in shells)])
    at = np.concatenate([none, *(end for shell in shells for end in (shell.begin, shell.end))])
    turn = np.concatenate(
        [none, *(np.repeat((sign, -sign), len(shell.ray)) for shell, sign in zip(shells, signs, strict=True))]
    )
    order = np.lexsort((at, ray))
    ray, at = ray[order], at[order]
    inside = np.flatnonzero(np.cumsum(turn[order])[:-1])  # 0 behind the last shell of each ray
    inside = inside[at[inside + 1] > at[inside]]
    return _Stretches(ray[inside], at[inside], at[inside + 1])


class _Shell:
    """Its BVH, normals that point outwards, and how far to step over a first crossing, m."""

    def __init__(self, corners: np.ndarray, step: float):
        """corners: see closed.Shell."""
        points = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
        self.tracer = Tracer(points, np.arange(len(points), dtype=np.int32).reshape(-1, 3))
        self.normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.step = step

    def stretches(self, origin: np.ndarray, direction: np.ndarray, limit: np.ndarray) -> _Stretches:
        """See _Body."""
        crossings = self.crossings(origin, direction)
        ray, ends = np.empty(len(crossings.ray), np.int64), np.empty((len(crossings.ray), 2))
        kept = _pair(crossings, limit, ray, ends)
        return _Stretches(ray[:kept], ends[:kept, 0], ends[:kept, 1])

    def crossings(self, origin: np.ndarray, direction: np.ndarray) -> _Crossings:
        """All crossings of rays (n, 3) float32, those of a ray in order of their distance."""
        found, ray = [], np.arange(len(origin))
        begin = np.zeros(len(origin), np.float32)
        step = self.step / np.maximum(np.linalg.norm(direction, axis=1), 1e-30).astype(np.float32)
        while len(ray):
            start = origin[ray] + begin[ray, None] * direction[ray]
            hits = self.tracer.trace(start, direction[ray])
            met = hits.triangle >= 0
            ray, triangle = ray[met], hits.triangle[met]
            distance = begin[ray] + hits.distance[met]
            leaves = np.einsum("ri,ri->r", direction[ray], self.normal[triangle]) > 0.0
            found.append(_Crossings(ray, distance, leaves))
            begin[ray] = distance * np.float32(1.0 + CLEAR) + step[ray]
            step *= np.float32(2.0 ** (1.0 / _DOUBLED_IN))
        if not found:
            return _Crossings(np.empty(0, np.int64), np.empty(0, np.float32), np.empty(0, np.bool_))
        every = _Crossings(*map(np.concatenate, zip(*found, strict=True)))
        order = np.argsort(every.ray, kind="stable")
        return _Crossings(*(column[order] for column in every))


def radius_of_media(media: tuple[Medium, ...], centre: np.ndarray) -> float:
    """Radius (m) of a sphere around the centre (3,) that holds all media: 0 without any, infinite for the world's.
    A camera ray that began inside it, and not at its camera, would miss some of them."""
    outlines = [medium.outline for medium in media]
    if any(outline is None for outline in outlines):
        return np.inf
    return max((float(np.linalg.norm(outline - centre, axis=1).max()) for outline in outlines), default=0.0)


class Atmosphere(Tracer):
    """The tracer of a scene with media: it also tells which media segments cross."""

    holds_media = True

    def __init__(self, surfaces: Tracer, media: tuple[Medium, ...], centre: np.ndarray, depth: float):
        """surfaces: tracer of the scene. centre: (3,) m, subtracted from world coordinates. depth: m, length in a
        medium without a mesh, the world's, of rays that leave the scene."""
        self._surfaces = surfaces
        self._bodies = [None if medium.triangles is None else _Body(medium, centre) for medium in media]
        self._media, self._grids = media, place_grids(media, centre)
        self._depth = depth
        self._everywhere = np.array([body is None for body in self._bodies]) & (self._grids.number < 0)
        self._optics = self._peaks = self.before_scene = None
        self.scatters = any(medium.scatters for medium in media)
        bodies = zip(media, self._bodies, strict=True)
        self.flat = [medium.name for medium, body in bodies if body is not None and not body.shells]

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        return self._surfaces.trace(origin, direction, reach)

    def trace_uncut(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        return self._surfaces.trace_uncut(origin, direction, reach)

    def seen_from(self, kind: int) -> Tracer:
        """Finds surfaces alone; what lies before them this tracer tells. Where media scatter, nothing is hidden but
        from the camera: what rays from a point in a medium pass is not said."""
        part = self._surfaces.seen_from(kind)
        return self if part is self._surfaces or (self.scatters and kind != FROM_CAMERA) else part

    @property
    def hidden(self) -> np.ndarray | None:
        return self._surfaces.hidden

    def between(self, surfaces: Tracer) -> Atmosphere:
        """The same media between surfaces that another tracer finds."""
        other = copy.copy(self)
        other._surfaces = surfaces
        return other

    def fill(self, table: MediumTable, heat: HeatTable | None = None) -> None:
        """Say what the media absorb, emit and scatter; before_scene is then the optical depth (b,) that the world's has
        before suns and surroundings. heat: of temperatures in grids; None if there are none, or where it stays as it
        is."""
        share = table.absorption / np.where(table.extinction > 0.0, table.extinction, 1.0)
        self._optics = table, share, table.extinction.max(axis=1)
        self._peaks = Peaks(table.scattering.max(axis=1), table.mixtures.absorption.max(axis=2))
        self.before_scene = self._depth * table.extinction[self._everywhere].sum(axis=0)
        if heat is not None:
            self._grids = fill_cells(self._grids, self._media, heat)

    def cross(
        self, origin: np.ndarray, direction: np.ndarray, distance: np.ndarray, from_sun: np.ndarray | None = None
    ) -> Air:
        """What segments cross: rays, origin and direction (n, 3) float32, up to a distance (n,) float32, in units of
        the direction's length, infinite for rays that leave the scene. from_sun: (n,) bool, rays to which the world's
        medium does nothing but scatter; None for none of them."""
        length = np.linalg.norm(direction, axis=1)
        leaves = distance > _FAR
        parts = []
        for number, body in enumerate(self._bodies):
            if self._grids.number[number] >= 0:
                ray, ends = np.empty(len(length), np.int64), np.empty((len(length), 2))
                kept = cross_boxes(self._grids, self._grids.number[number], (origin, direction), distance, ray, ends)
                parts.append((np.full(kept, number), ray[:kept], ends[:kept, 0], ends[:kept, 1]))
            elif body is None:
                end = np.where(leaves, self._depth / np.maximum(length, 1e-30), distance)
                if from_sun is not None:  # those that miss all cross the scene, as far behind its middle as before it
                    through = -2.0 * np.einsum("ri,ri->r", origin, direction) / np.maximum(length, 1e-30) ** 2
                    end = np.where(leaves & from_sun, through, end)
                begin, end = np.zeros(len(end)), end.astype(np.float64)
                parts.append((np.full(len(end), number), np.arange(len(end)), begin, end))
            else:
                inside = body.stretches(origin, direction, distance)
                parts.append((np.full(len(inside.ray), number), *inside))
        medium, ray, begin, end = map(np.concatenate, zip(*parts, strict=True))
        order = np.argsort(ray, kind="stable")
        first = np.searchsorted(ray[order], np.arange(len(length) + 1))
        medium, ray = medium[order], ray[order]
        lit = None if from_sun is None else from_sun[ray] & self._everywhere[medium]
        row, *optics = self._rows(first, medium, lit)
        stretches = medium, row, begin[order], end[order]
        march, bands = empty_march(len(ray), len(self._grids.first) > 0), self._optics[0].extinction.shape[1]
        room = march, empty_ahead(), empty_bands(bands)
        return Air(first, *stretches, length, RayBatch(origin, direction), *optics, self._peaks, self._grids, *room)

    def _rows(self, first: np.ndarray, medium: np.ndarray, lit: np.ndarray | None) -> tuple:
        """`row`, `table`, `share` and `thickest` of Air: with rows for as many stretches as the segment with the most
        has, if any medium has components, and one for each medium that only scatters, if any stretch is lit. first,
        medium: see Air. lit: (s,) bool, stretches where a medium only scatters, None for no such."""
        table, share, thickest = self._optics
        varies = np.diff(table.mixtures.first) > 0
        if not varies.any() and lit is None:
            return medium, table, share, thickest
        stretches = np.diff(first)
        row = np.where(varies[medium], len(varies) + np.arange(len(medium)) - np.repeat(first[:-1], stretches), medium)
        rows, clear = int(stretches.max(initial=0)) if varies.any() else 0, 0
        if lit is not None:
            row[lit], clear = len(varies) + rows + medium[lit], len(varies)

        def with_room(of: np.ndarray) -> np.ndarray:
            return np.concatenate((of, np.zeros((rows + clear, *of.shape[1:]))))

        wide = {name: with_room(getattr(table, name)) for name in ("absorption", "scattering", "extinction")}
        wide["scattering"][len(varies) + rows :] = table.scattering[:clear]
        return row, table._replace(**wide), with_room(share), with_room(thickest)


@njit(**KERNEL)
def _pair(crossings, limit, ray, ends):
    """Fill ray (n,) and ends (n, 2) with the stretches inside the mesh, up to a limit (rays,); returns how many."""
    count = np.int64(0)
    inside, begin = False, 0.0
    for c in range(crossings.ray.size):
        r = crossings.ray[c]
        starts = c == 0 or crossings.ray[c - 1] != r
        if starts:
            inside, begin = bool(crossings.leaves[c]), 0.0
        if crossings.leaves[c]:
            if inside and begin < limit[r]:
                ray[count], ends[count, 0], ends[count, 1] = r, begin, min(crossings.distance[c], limit[r])
                count += 1
            inside = False
        elif not inside:
            inside, begin = True, crossings.distance[c]
    return count
