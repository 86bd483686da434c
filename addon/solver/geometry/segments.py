# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments: the straight ways of light between two points, and what lies between the two.

Camera rays, rays of final gathers, shadow rays and photons all cross one segment at a time. Embree says here where a
segment ends and how long it is. Only here is asked what a segment takes from the light on it, and what it adds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from ..physics.heat import between_nodes
from ..physics.media import THIN, MediumTable, absorbed, absorbed_if_thin
from ..scene import Hidden
from ..system.kernels import FAST_INLINED, INLINED, njit
from .grids import AHEAD, Ahead, GridTable, March, begin_march, enter_grid, look_ahead, march_on, next_cell

ENDLESS = np.float32(1e37)  # reach of rays that end nowhere
# Kinds of rays by where they set out, from the eye on: bits of Hidden, see Tracer.seen_from. Light goes the other way.
FROM_CAMERA, FROM_DIFFUSE, FROM_GLOSSY, TO_LIGHT = range(len(Hidden))
_FAINTEST = 1e-300  # depth added where there may be none
_VECTORS = FAST_INLINED | {
    "error_model": "numpy"
}  # a check for division by 0 would keep LLVM from vectorising the loop


class RayBatch(NamedTuple):
    """n rays: origin, direction (n, 3) float32."""

    origin: np.ndarray
    direction: np.ndarray


def empty_ray_batch(count: int) -> RayBatch:
    """Room for count rays."""
    return RayBatch(*np.empty((2, count, 3), np.float32))


class Hits(NamedTuple):
    """Where n rays meet triangles first.

    triangle: (n,) int32, -1 where a ray meets none. u, v: (n,) float32, barycentric coordinates of corners 1 and 2.
    distance: (n,) float32, in units of the length of the ray's direction; where a ray meets nothing, its reach.
    """

    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    distance: np.ndarray


class Tracer:
    """Embree's BVH over the triangles. Embree looks for hits from distance 0 on, so the origin of a ray must be clear
    of the surface that it leaves (see `clear_of`).

    All methods release the GIL.

    holds_media, scatters: whether there are media between the surfaces, and whether any scatters. Only if there are, a
    tracer is asked what segments cross; it then is a media.Atmosphere.
    """

    holds_media = scatters = False

    hidden: np.ndarray | None = None
    _parts: tuple[Tracer, ...] = ()

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, hidden: np.ndarray | None = None):
        """vertices (n, 3) float32, triangles (m, 3) int32. hidden: (m,) uint8, see Scene. Builds the BVH at once, so
        threads never race for it."""
        self._scene = EmbreeScene()  # robust: no ray slips between two triangles that share an edge
        TriangleMesh(self._scene, vertices, triangles)
        Tracer.trace(self, np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
        if hidden is not None and hidden.any():
            self.hidden, self._parts = hidden, self._without_hidden(vertices, triangles, hidden)

    def _without_hidden(self, vertices, triangles, hidden) -> tuple[Tracer, ...]:
        """The tracers of each kind of rays; kinds that pass the same have one."""
        seen = [hidden & flag == 0 for flag in Hidden]
        of = {each.tobytes(): each for each in seen}
        made = {
            k: self if part.all() else _PartTracer(vertices, triangles, np.flatnonzero(part)) for k, part in of.items()
        }
        return tuple(made[each.tobytes()] for each in seen)

    def seen_from(self, kind: int) -> Tracer:
        """The tracer of a kind of rays, FROM_CAMERA to TO_LIGHT: itself, unless something is hidden from them."""
        return self._parts[kind] if self._parts else self

    @property
    def camera(self) -> Tracer:
        """The tracer of rays that come straight from the camera."""
        return self.seen_from(FROM_CAMERA)

    @property
    def hides(self) -> bool:
        """Whether light between surfaces passes any of them, see Hidden."""
        return any(self.seen_from(kind) is not self for kind in (FROM_DIFFUSE, FROM_GLOSSY, TO_LIGHT))

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        """The first Hits of rays, origin and direction (n, 3) float32. reach: (n,) float32, in units of the direction's
        length, overwritten; None is without limit."""
        hits = self._scene.run(origin, direction, reach, output=True)
        return Hits(hits["primID"], hits["u"], hits["v"], hits["tfar"])

    def trace_uncut(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        """As `trace`, also where a surface has a hole, see see_through."""
        return self.trace(origin, direction, reach)

    def visible(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """(n,) bool, visibility of the ends of shadow rays: whether they meet nothing on the way; see `trace`."""
        return self.trace(origin, direction, reach).triangle < 0


class _PartTracer(Tracer):
    """A tracer that meets some of the triangles, by a BVH of these alone: what is not in it costs no ray anything, and
    a surface that touches it is seen exactly."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, part: np.ndarray):
        """part: (p,) int64, rows of the triangles."""
        super().__init__(vertices, triangles[part])
        self._row = np.append(part, -1).astype(np.int32)  # the last of them for rays that meet nothing

    def trace(self, origin: np.ndarray, direction: np.ndarray, reach: np.ndarray | None = None) -> Hits:
        hits = super().trace(origin, direction, reach)
        return hits._replace(triangle=self._row[hits.triangle])


def hidden_from_lobes(tracer: Tracer) -> np.ndarray:
    """(m,) uint8, what is hidden from which rays, see Scene; (0,) if nothing is but from the camera."""
    return tracer.hidden if tracer.hides else np.empty(0, np.uint8)


def trace_by_kind(
    tracer: Tracer,
    kind: np.ndarray,
    rays: tuple[np.ndarray, np.ndarray],
    reach: np.ndarray | None = None,
    uncut: bool = False,
) -> Hits:
    """The Hits of rays, origin and direction (n, 3) float32, each of its kind (n,) uint8, see Tracer.seen_from.

    reach: see Tracer.trace. uncut: whether to trace_uncut.
    """
    count = len(kind)
    hits = Hits(np.empty(count, np.int32), *np.empty((3, count), np.float32))
    for each in range(len(Hidden)):
        of_kind, part = np.flatnonzero(kind == each), tracer.seen_from(each)
        if len(of_kind):
            trace = part.trace_uncut if uncut else part.trace
            found = trace(*(column[of_kind] for column in rays), None if reach is None else reach[of_kind])
            for column, values in zip(hits, found, strict=True):
                column[of_kind] = values
    return hits


class Bands(NamedTuple):
    """Room for what kernels know of a segment in each band, (b,) float64.

    depth, scattered: optical depth, of extinction and of scattering. scattering: coefficient at the present place, 1/m.
    excess: radiance of a blackbody, emission: what a thin medium emits, W m-2 sr-1. throughput, radiance: of light on
    the way.
    """

    depth: np.ndarray
    scattered: np.ndarray
    scattering: np.ndarray
    excess: np.ndarray
    emission: np.ndarray
    throughput: np.ndarray
    radiance: np.ndarray


def empty_bands(count: int) -> Bands:
    """Room for count bands."""
    return Bands(*np.empty((7, count)))


class Peaks(NamedTuple):
    """The largest coefficients of any band, 1/m: scattering (m,) of media, absorption (c, t) of what a MixtureTable
    holds."""

    scattering: np.ndarray
    absorption: np.ndarray


class Air(NamedTuple):
    """What n segments cross.

    first: (n + 1,) int64, where the stretches of each segment begin in medium, row, begin and end. medium: (s,) int64.
    row: (s,) int64, of absorption, scattering, extinction, share and thickest: the medium's; where a medium has
    components (see MixtureTable), one behind all media, which only this stretch of the segment uses, see _mix; and one
    behind these where a medium only scatters.
    begin, end: (s,) float64, of the stretch of a segment in a medium, in units of the direction's length; stretches in
    several media may overlap. length: (n,) of the direction. rays: the segments'. table: of the media, see MediumTable.
    share: (rows, b) float64, absorption over extinction. thickest: (rows,) float64, 1/m, no less than the extinction of
    any band. peaks: see Peaks. grids: of media that vary, see GridTable.
    Kernels keep what they know here: march, see March, ahead, see Ahead, and bands, see Bands.
    """

    first: np.ndarray
    medium: np.ndarray
    row: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    length: np.ndarray
    rays: RayBatch
    table: MediumTable
    share: np.ndarray
    thickest: np.ndarray
    peaks: Peaks
    grids: GridTable
    march: March
    ahead: Ahead
    bands: Bands


def ways(hits: Hits) -> np.ndarray:
    """(n,) float32, how far rays go: to what they meet, or without end."""
    return np.where(hits.triangle < 0, np.float32(np.inf), hits.distance)


@njit(**INLINED)
def set_out(air, i):
    """Begin at the origin of segment i; returns the distance up to which all is constant, infinite in a vacuum."""
    for s in range(air.first[i], air.first[i + 1]):
        air.march.amount[s], air.march.until[s] = AHEAD, air.begin[s]
    return go_on(air, i, 0.0)


@njit(**INLINED)
def go_on(air, i, t):
    """Enter what segment i enters at a distance t, in units of the direction's length, and leave what it leaves there;
    returns the distance up to which all is constant, infinite behind the last medium."""
    march, stop = air.march, np.inf
    for s in range(air.first[i], air.first[i + 1]):
        if march.until[s] <= t:
            _enter_or_leave(air, i, s, t)
        stop = min(stop, march.until[s])
    return stop


@njit(**INLINED)
def _enter_or_leave(air, i, s, t):
    """Bring stretch s up to distance t, where something changes in it."""
    march, g = air.march, air.grids.number[air.medium[s]]
    if t >= air.end[s]:
        march.amount[s], march.until[s] = 0.0, np.inf
    elif g < 0:
        march.amount[s], march.until[s] = 1.0, air.end[s]
    else:
        if march.amount[s] == AHEAD:
            begin_march(air.grids, g, march, s, (air.rays.origin[i], air.rays.direction[i]), t)
        march_on(air.grids, g, march, s, t, air.end[s])
        if air.row[s] != air.medium[s] and march.amount[s] > 0.0:
            _mix(air, s, march.place[s])


@njit(**_VECTORS)
def _mix(air, s, place):
    """Write the row of stretch s: what the mixture in its cell absorbs and scatters. Here alone it is said what the
    coefficients of such a cell are. place: see Gas."""
    table, grids, m, row, peaks = air.table, air.grids, air.medium[s], air.row[s], air.peaks
    mixtures = table.mixtures
    node = min(int(grids.cells[place + 2]), mixtures.absorption.shape[1] - 2)
    up = float(grids.cells[place + 2]) - node
    bands, first, end = air.share.shape[1], mixtures.first[m], mixtures.first[m + 1]
    density = float(grids.cells[place + 3])
    thickest = density * peaks.scattering[m]
    for b in range(bands):
        table.absorption[row, b] = 0.0
    for c in range(first, end):
        amount = float(grids.cells[place + 3 + c - first])
        below, above = amount * (1.0 - up), amount * up
        if amount > 0.0:
            thickest += below * peaks.absorption[c, node] + above * peaks.absorption[c, node + 1]
            for b in range(bands):
                between = below * mixtures.absorption[c, node, b] + above * mixtures.absorption[c, node + 1, b]
                table.absorption[row, b] += between
    if peaks.scattering[m] > 0.0:
        for b in range(bands):
            table.scattering[row, b] = density * table.scattering[m, b]
            table.extinction[row, b] = table.absorption[row, b] + table.scattering[row, b]
            air.share[row, b] = table.absorption[row, b] / (table.extinction[row, b] + _FAINTEST)
    else:
        for b in range(bands):
            table.scattering[row, b], air.share[row, b] = 0.0, 1.0
            table.extinction[row, b] = table.absorption[row, b]
    air.thickest[row] = thickest


@njit(**_VECTORS)
def _add_coefficients(of, row, amount, out):
    """Add to out (b,) a coefficient, times an amount of gas, in m of amount 1. of: (rows, b) float64, 1/m, of the
    table."""
    for b in range(out.size):
        out[b] += amount * of[row, b]


@njit(**INLINED)
def add_depth(air, i, of, way, out):
    """Add to out (b,) the optical depth of a way on segment i that is constant: media that overlap add. way: in units
    of the direction's length. of: see _add_coefficients."""
    for s in range(air.first[i], air.first[i + 1]):
        if air.march.amount[s] > 0.0:
            _add_coefficients(of, air.row[s], air.march.amount[s] * way * air.length[i], out)


@njit(**INLINED)
def measure_depth(air, i, of, out):
    """Fill out (b,) with the optical depth of segment i. of: see _add_coefficients."""
    out[:] = 0.0
    if air.first[i] + 1 == air.first[i + 1]:
        _measure_along_one(air, i, of, out)
        return
    t, stop = 0.0, set_out(air, i)
    while stop < np.inf:
        add_depth(air, i, of, stop - t, out)
        t, stop = stop, go_on(air, i, stop)


@njit(**INLINED)
def _measure_along_one(air, i, of, out):
    """Add to out (b,) the optical depth of the only stretch of segment i: see _shine_along_one."""
    s = air.first[i]
    t, end, g, row = air.begin[s], air.end[s], air.grids.number[air.medium[s]], air.row[s]
    if g < 0:
        _add_coefficients(of, row, (end - t) * air.length[i], out)
        return
    line, cell = enter_grid(air.grids, g, (air.rays.origin[i], air.rays.direction[i]), t)
    ahead = air.ahead
    while t < end:
        cells, cell, t = look_ahead(air.grids, g, line, cell, (t, end), ahead)
        for n in range(cells):
            if row != air.medium[s]:
                _mix(air, s, ahead.place[n])
            _add_coefficients(of, row, ahead.amount[n] * air.length[i], out)


@njit(**_VECTORS)
def _fill_excess(air, s, steps, out):
    """Fill out (b,) with the excess radiance of a blackbody at the temperature of a place in stretch s. steps: see
    Gas."""
    m, heat = air.medium[s], air.grids.heat
    if air.grids.number[m] < 0:
        for b in range(out.size):
            out[b] = air.table.excess[m, b]
    else:
        r, (h0, d0, h1, d1) = between_nodes(heat, steps)
        for b in range(out.size):
            excess = h0 * heat.excess[r, b] + d0 * heat.slope[r, b]
            out[b] = excess + h1 * heat.excess[r + 1, b] + d1 * heat.slope[r + 1, b]


@njit(**INLINED)
def is_plain(air, i):
    """Whether segment i crosses but one stretch, in a medium whose coefficients have one ratio everywhere: what it
    takes is then told by how much gas there is."""
    s = air.first[i]
    return s + 1 == air.first[i + 1] and air.row[s] == air.medium[s]


@njit(**INLINED)
def pass_gas(air, i, limit):
    """Go along a plain segment until it has passed as much gas as the limit says, in m of amount 1; returns how much it
    has passed, the amount here, and the distance, in units of the direction's length, infinite behind the stretch."""
    s, passed = air.first[i], 0.0
    t, end, limit = air.begin[s], air.end[s], limit / air.length[i]
    g = air.grids.number[air.medium[s]]
    if g < 0:
        return (limit * air.length[i], 1.0, t + limit) if end - t > limit else ((end - t) * air.length[i], 0.0, np.inf)
    line, cell = enter_grid(air.grids, g, (air.rays.origin[i], air.rays.direction[i]), t)
    while t < end:
        gas, cell = next_cell(air.grids, g, line, cell, t, end)
        more = gas.amount * (gas.until - t)
        if passed + more > limit:
            return limit * air.length[i], gas.amount, t + (limit - passed) / gas.amount
        t, passed = gas.until, passed + more
    return passed * air.length[i], 0.0, np.inf


@njit(**INLINED)
def transmit(air, i, power):
    """Lower power (b,), or a radiance or throughput, by what segment i absorbs and scatters (Bouguer's law). Both
    directions lose alike."""
    if air.first[i] == air.first[i + 1]:
        return
    if is_plain(air, i):
        passed, row = pass_gas(air, i, np.inf)[0], air.row[air.first[i]]
        for b in range(power.size):
            power[b] *= math.exp(-passed * air.table.extinction[row, b])
        return
    depth = air.bands.depth
    measure_depth(air, i, air.table.extinction, depth)
    for b in range(power.size):
        power[b] *= math.exp(-depth[b])


@njit(**INLINED)
def glow(air, i, throughput, radiance):
    """Add to radiance (b,) what media on segment i emit towards its origin, times the throughput (b,) there."""
    bands, stretches = air.bands, air.first[i + 1] - air.first[i]
    if stretches == 0:
        return
    for b in range(throughput.size):
        bands.throughput[b], bands.radiance[b] = throughput[b], 0.0
    if stretches == 1:
        _shine_along_one(air, i)
    else:
        _shine_along_all(air, i)
    for b in range(throughput.size):
        radiance[b] += bands.radiance[b]


@njit(**INLINED)
def traverse(air, i, throughput, radiance):
    """`glow` and `transmit` in one."""
    if air.first[i] == air.first[i + 1]:
        return
    glow(air, i, throughput, radiance)
    for b in range(throughput.size):
        throughput[b] = air.bands.throughput[b]


@njit(**INLINED)
def _shine_along_one(air, i):
    """Add to the radiance of bands what the only stretch of segment i emits, and lower their throughput by what it
    takes. _shine_along_all can do this, too, but takes twice as long, as it keeps in memory where it is on each
    stretch."""
    s = air.first[i]
    t, end, g = air.begin[s], air.end[s], air.grids.number[air.medium[s]]
    if g < 0:
        _shine_alone(air, s, 0.0, (end - t) * air.length[i])
        return
    line, cell = enter_grid(air.grids, g, (air.rays.origin[i], air.rays.direction[i]), t)
    ahead = air.ahead
    while t < end:
        cells, cell, t = look_ahead(air.grids, g, line, cell, (t, end), ahead)
        for n in range(cells):
            if air.row[s] != air.medium[s]:
                _mix(air, s, ahead.place[n])
            _shine_alone(air, s, ahead.steps[n], ahead.amount[n] * air.length[i])


@njit(**INLINED)
def _shine_along_all(air, i):
    """_shine_along_one for any number of stretches."""
    t, stop = 0.0, set_out(air, i)
    while stop < np.inf:
        _shine(air, i, stop - t)
        t, stop = stop, go_on(air, i, stop)


@njit(**INLINED)
def _shine(air, i, way):
    """Add what media emit on a way on segment i that is constant, see add_depth, and take what they take.

    A stretch of optical depth tau between media of one temperature each brings dL = j / k (1 - exp(-tau)), j their
    emission and k their extinction (Modest, section 10.4). No step is random.
    """
    count, only = 0, np.int64(-1)
    for s in range(air.first[i], air.first[i + 1]):
        if air.march.amount[s] > 0.0:
            count, only = count + 1, s
    if count == 1:
        _shine_alone(air, only, air.march.steps[only], way * air.length[i] * air.march.amount[only])
    elif count > 1:
        _shine_together(air, i, way)


@njit(**_VECTORS)
def _shine_alone(air, s, steps, amount):
    """_shine where there is but one medium, that of stretch s. steps: see Gas. amount: of gas on the way, in m of
    amount 1."""
    bands, extinction, share, row = air.bands, air.table.extinction, air.share, air.row[s]
    _fill_excess(air, s, steps, bands.excess)
    if amount * air.thickest[row] < THIN:
        for b in range(bands.excess.size):
            lost = absorbed_if_thin(amount * extinction[row, b])
            bands.radiance[b] += bands.throughput[b] * (lost * share[row, b] * bands.excess[b])
            bands.throughput[b] *= 1.0 - lost
    else:
        for b in range(bands.excess.size):
            lost = absorbed(amount * extinction[row, b])
            bands.radiance[b] += bands.throughput[b] * (lost * share[row, b] * bands.excess[b])
            bands.throughput[b] *= 1.0 - lost


@njit(**_VECTORS)
def _shine_together(air, i, way):
    """_shine where several media overlap."""
    bands, absorption = air.bands, air.table.absorption
    depth, emission, excess = bands.depth, bands.emission, bands.excess
    depth[:], emission[:] = 0.0, 0.0
    add_depth(air, i, air.table.extinction, way, depth)
    for s in range(air.first[i], air.first[i + 1]):
        amount = way * air.length[i] * air.march.amount[s]
        if amount > 0.0:
            _fill_excess(air, s, air.march.steps[s], excess)
            for b in range(excess.size):
                emission[b] += amount * absorption[air.row[s], b] * excess[b]
    for b in range(depth.size):
        lost = absorbed(depth[b])
        bands.radiance[b] += bands.throughput[b] * (lost * emission[b] / (depth[b] + _FAINTEST))
        bands.throughput[b] *= 1.0 - lost
