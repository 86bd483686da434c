# SPDX-License-Identifier: GPL-3.0-or-later
"""Hairs as triangles: arithmetic on arrays, no Blender.

A hair of radius r becomes a prism of n sides whose perimeter is the round hair's, 2 pi r = 2 n R sin(pi / n), R the
radius of its corners. So it has the surface, and emits the power, of the round hair. After Cauchy (1841) the mean
width of a convex cross-section over all directions is its perimeter / pi, so that on average it also hides as much.
With n = 2 the prism is a ribbon of width pi r, which hides from pi r down to nothing where the round hair hides 2 r;
each hair is turned differently about its length, so that many hairs hide what round ones do from any direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .meshes import MeshData

ALLOWED = 0.25  # of a pixel: how far triangles may lie beside the round hair
ALLOWED_MIDDLE = 0.5  # of a pixel: how far the middle of a prism may lie beside the hair's
OF_RADIUS = 0.25  # the same over the radius, however small a pixel is
ALLOWED_KELVIN = 0.02  # how far temperatures between the points kept may lie beside the given ones
SIDES = (2, 3, 4, 6, 8, 12, 16, 24, 32)  # of prisms
UNSEEN = 3  # sides without a camera that tells the size of a pixel
SMOOTH_FROM = 4  # sides from which on prisms are shaded smooth; thinner ones are smaller than a pixel
COMPACT = 4.0  # length of a piece of hair over its thickness; shorter ones help rays no more
MOST_PIECES = 16  # of a span between two points
# Turn of a hair about its length against the one before: its multiples spread evenly, and have nothing to do with the
# golden angle, by which generators place hairs.
_ROLL = 2.0 * np.pi * 2.0**0.5
_SHARPEST = 0.5  # least cosine of half a bend at which a prism is still mitred


@dataclass(frozen=True)
class Strands:
    """c hairs of n points in all, in the space of their object.

    points: (n, 3) float64. radius: (n,) float64. first: (c + 1,) int64, where the points of each hair begin; each has
    two or more. slot: (c,) int32, material slot. temperature: (n,) float32 K at the points, or None. handles:
    (n, 2, 3) float64, the control points before and behind each point of cubic Bezier curves; None of polylines.
    """

    points: np.ndarray
    radius: np.ndarray
    first: np.ndarray
    slot: np.ndarray
    temperature: np.ndarray | None = None
    handles: np.ndarray | None = None

    @property
    def owner(self) -> np.ndarray:
        """(n,) int64 the hair of each point."""
        return np.repeat(np.arange(len(self.slot)), np.diff(self.first))

    @property
    def begins(self) -> np.ndarray:
        """Numbers of the points that begin a span: all but the last of each hair."""
        inner = np.ones(len(self.points), bool)
        inner[self.first[1:] - 1] = False
        return np.flatnonzero(inner)

    @property
    def thickest(self) -> np.ndarray:
        """(c,) float64 largest radius of each hair."""
        return np.maximum.reduceat(self.radius, self.first[:-1]) if len(self.slot) else np.empty(0)

    def kept_points(self, kept: np.ndarray) -> Strands:
        """Those of the points for which kept, (n,) bool, is true, and the hairs that have two or more of them."""
        counts = np.bincount(self.owner[kept], minlength=len(self.slot))
        kept = kept & (counts >= 2)[self.owner]
        temperature, handles = (None if each is None else each[kept] for each in (self.temperature, self.handles))
        first = np.concatenate(([0], np.cumsum(counts[counts >= 2])))
        return Strands(self.points[kept], self.radius[kept], first, self.slot[counts >= 2], temperature, handles)


def tolerances(strands: Strands, pixel: np.ndarray | None) -> np.ndarray:
    """(c,) float64, how far the middle of a prism may lie beside that of its hair. pixel: (c,) size of a pixel at each
    hair, None where it is unknown."""
    by_radius = OF_RADIUS * strands.thickest
    return by_radius if pixel is None else np.maximum(by_radius, ALLOWED_MIDDLE * pixel)


def sides_of(radius: np.ndarray, pixel: np.ndarray | None) -> np.ndarray:
    """(c,) int64, how many sides hairs of these radii get.

    The sides of a prism with the perimeter of a circle lie up to r (pi / n)^2 / 3 inside it.
    """
    if pixel is None:
        return np.full(len(radius), UNSEEN)
    wanted = np.pi * np.sqrt(radius / (3.0 * ALLOWED * pixel))
    return np.array(SIDES)[np.searchsorted(SIDES[:-1], wanted)]


def joined_strands(parts: list[Strands]) -> Strands:
    """The hairs of several in one; none of them tells temperatures, all have handles."""
    if not parts:
        return Strands(np.empty((0, 3)), np.empty(0), np.zeros(1, np.int64), np.empty(0, np.int32))
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    return Strands(
        points=np.concatenate([part.points for part in parts]),
        radius=np.concatenate([part.radius for part in parts]),
        first=np.concatenate([*map(_shifted, parts, starts), starts[-1:]]),
        slot=np.concatenate([part.slot for part in parts]),
        handles=np.concatenate([part.handles for part in parts]),
    )


def _shifted(part: Strands, start: int) -> np.ndarray:
    return part.first[:-1] + start


def closed(strands: Strands, cyclic: np.ndarray) -> Strands:
    """Hairs of which those for which cyclic, (c,) bool, is true end at their first point once more."""
    lengths = np.diff(strands.first)
    again = cyclic & (lengths > 1)
    first = np.concatenate(([0], np.cumsum(lengths + again)))
    source = np.arange(first[-1]) - np.repeat(np.cumsum(again) - again, lengths + again)
    source[first[1:][again] - 1] = strands.first[:-1][again]
    return replace(
        strands,
        points=strands.points[source],
        radius=strands.radius[source],
        first=first,
        temperature=None if strands.temperature is None else strands.temperature[source],
        handles=None if strands.handles is None else strands.handles[source],
    )


def rounded(strands: Strands, tolerance: np.ndarray) -> Strands:
    """Hairs as polylines that lie within a tolerance, (c,), of their curves.

    A chord over 1 / s of a span leaves the curve by at most |p''| / (8 s^2); p'' is largest at an end of the span.
    """
    handles = strands.handles
    if handles is None or len(strands.slot) == 0:
        return replace(strands, handles=None)
    begin = strands.begins
    a, b, c, d = strands.points[begin], handles[begin, 1], handles[begin + 1, 0], strands.points[begin + 1]
    bend = 6.0 * np.sqrt(np.maximum(((a - 2.0 * b + c) ** 2).sum(1), ((b - 2.0 * c + d) ** 2).sum(1)))
    allowed = np.maximum(tolerance[strands.owner[begin]], 1e-300)
    pieces = np.ones(len(strands.points), np.int64)
    pieces[begin] = np.clip(np.ceil(np.sqrt(bend / (8.0 * allowed))), 1, MOST_PIECES).astype(np.int64)
    source, after, t = _places(strands, pieces)
    weights = (1.0 - t) ** 3, 3.0 * t * (1.0 - t) ** 2, 3.0 * t**2 * (1.0 - t), t**3
    control = strands.points[source], handles[source, 1], handles[after, 0], strands.points[after]
    points = sum(weight[:, None] * point for weight, point in zip(weights, control, strict=True))
    return replace(_between(strands, pieces), points=points)


def shortened(strands: Strands, most: int) -> Strands:
    """Hairs whose spans are cut into pieces that are at most COMPACT times as long as the hair is thick, but not into
    more pieces than `most` in all.

    Rays ask each box around a triangle that they cross. That around a long piece that lies askew is nearly empty, so
    that many are crossed for each hit (tests/benchmarks/hair.py).
    """
    begin = strands.begins
    length = np.linalg.norm(strands.points[begin + 1] - strands.points[begin], axis=1)
    wanted = 2.0 * COMPACT * strands.thickest[strands.owner[begin]]
    longest = np.maximum(wanted, length.sum() / max(1, most - len(begin)))
    pieces = np.ones(len(strands.points), np.int64)
    pieces[begin] = np.ceil(length / longest)
    return _between(strands, np.maximum(pieces, 1))


def _places(strands: Strands, pieces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where points lie if the span behind each point is cut into (n,) pieces: the point before and that after each, and
    how far it is between them, 0 to 1."""
    source = np.repeat(np.arange(len(pieces)), pieces)
    t = (np.arange(len(source)) - (np.cumsum(pieces) - pieces)[source]) / pieces[source]
    return source, np.minimum(source + 1, len(pieces) - 1), t


def _between(strands: Strands, pieces: np.ndarray) -> Strands:
    """Polylines whose straight spans behind each point are cut into (n,) pieces."""
    source, after, t = _places(strands, pieces)
    of_points = strands.points, strands.radius, strands.temperature
    points, radius, temperature = (
        None if each is None else ((1.0 - t) * each[source].T + t * each[after].T).T for each in of_points
    )
    first = np.concatenate(([0], np.cumsum(pieces)))[strands.first]
    temperature = None if temperature is None else temperature.astype(np.float32)
    return Strands(points, radius, first, strands.slot, temperature)


def catmull_rom_handles(strands: Strands, cyclic: np.ndarray | None = None) -> np.ndarray:
    """(n, 2, 3) handles of the curves of Catmull and Rom (1974) through the points, which end as if the second point
    were mirrored beyond the first. cyclic: (c,) bool, of hairs that are closed, see `closed`, and end as they begin."""
    points, index = strands.points, np.arange(len(strands.points))
    lengths, local = np.diff(strands.first), index - strands.first[strands.owner]
    is_first, is_last = local == 0, local == np.repeat(lengths, lengths) - 1
    before, after = points[np.where(is_first, index, index - 1)], points[np.where(is_last, index, index + 1)]
    before = np.where(is_first[:, None], 2.0 * points - after, before)
    after = np.where(is_last[:, None], 2.0 * points - before, after)
    if cyclic is not None:
        first, last = strands.first[:-1][cyclic], strands.first[1:][cyclic] - 1
        before[first], after[last] = points[last - 1], points[first + 1]
    sixth = (after - before) / 6.0
    return np.stack((points - sixth, points + sixth), axis=1)


def thinned(strands: Strands, tolerance: np.ndarray) -> Strands:
    """Hairs without the points that matter less than a tolerance, (c,): where the polyline of the points kept lies
    closer than that to all others, their radii included, and tells their temperature to ALLOWED_KELVIN.

    Spans of 2, 4, 8... points are looked at; one becomes straight if both of its halves did.
    """
    count, owner = np.diff(strands.first), strands.owner
    local = np.arange(len(owner)) - strands.first[owner]
    last = strands.first[1:][owner] - 1
    kept, stride = np.ones(len(owner), bool), 1
    straight = np.ones(len(owner), bool)  # whether the span of `stride` that begins at a point is straight
    while len(count) and stride < count.max() - 1:
        stride *= 2
        start = strands.first[owner] + local // stride * stride
        stop = np.minimum(start + stride, last)
        wrong = _leaves_chord(strands, start, stop, tolerance[owner])
        bent = np.bincount(start[wrong], minlength=len(owner)) > 0
        middle = start + stride // 2
        halves = straight[start] & ((middle >= last) | straight[np.minimum(middle, last)])
        straight = halves & ~bent[start]  # of all points of the span; that at its start counts
        kept &= ~(straight & (local % stride == stride // 2) & (np.arange(len(owner)) < last))
    return strands.kept_points(kept)


def _leaves_chord(strands: Strands, start: np.ndarray, stop: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """(n,) bool, which points lie further than a tolerance (n,) from the chord between two others."""
    a, chord = strands.points[start], strands.points[stop] - strands.points[start]
    square = np.einsum("ni,ni->n", chord, chord)
    along = np.einsum("ni,ni->n", strands.points - a, chord) / np.where(square > 0.0, square, 1.0)
    along = along.clip(0.0, 1.0)
    away = strands.points - a - along[:, None] * chord
    radius = strands.radius[start] * (1.0 - along) + strands.radius[stop] * along
    wrong = (np.einsum("ni,ni->n", away, away) > tolerance**2) | ((square == 0.0) & (start < stop))
    wrong |= np.abs(strands.radius - radius) > np.minimum(tolerance, OF_RADIUS * np.maximum(strands.radius, radius))
    if strands.temperature is not None:
        kelvin = strands.temperature[start] * (1.0 - along) + strands.temperature[stop] * along
        wrong |= np.abs(strands.temperature - kelvin) > ALLOWED_KELVIN
    return wrong


def prisms(strands: Strands, sides: np.ndarray) -> MeshData:
    """The triangles of hairs with these numbers of sides, (c,); those of more than two sides are closed at their ends.
    Triangles without an area, as at a pointed tip, are left out."""
    if len(sides) == 0:
        return joined_meshes([])
    frames, parts, vertex_count = _frames(strands), [], 0
    for number in np.unique(sides):
        chosen = (sides == number)[strands.owner]
        part = _prisms_of(strands.kept_points(chosen), tuple(each[chosen] for each in frames), int(number))
        parts.append(replace(part, triangles=part.triangles + np.int32(vertex_count)))
        vertex_count += len(part.vertices)
    return joined_meshes(parts)


def triangle_count(strands: Strands, sides: np.ndarray) -> int:
    """At most how many triangles `prisms` makes of hairs."""
    spans = np.diff(strands.first) - 1
    return int((spans * np.where(sides == 2, 2, 2 * sides) + np.where(sides == 2, 0, 2 * (sides - 2))).sum())


def joined_meshes(parts: list[MeshData]) -> MeshData:
    """Meshes in one; their triangles already count the vertices of all."""
    if not parts:
        return MeshData(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32), None)
    normals = None
    if any(part.normals is not None for part in parts):
        flat = np.zeros((1, 3, 3), np.float32)
        normals = np.concatenate(
            [np.repeat(flat, len(each.triangles), axis=0) if each.normals is None else each.normals for each in parts]
        )
    known = parts[0].temperature is not None
    return MeshData(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.triangles for part in parts]),
        np.concatenate([part.slot for part in parts]),
        np.concatenate([part.temperature for part in parts]) if known else None,
        normals,
    )


def _frames(strands: Strands) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At each point: two unit vectors across the hair, (n, 3) each, which turn about its length as little as possible
    from one point to the next (Bishop 1975), and (n, 3) what stretches a vector v across to v + (v . m) m at a bend, so
    that the prism is as wide on both sides of it."""
    count = len(strands.points)
    step = np.diff(strands.points, axis=0, append=strands.points[-1:])
    length = np.linalg.norm(step, axis=1, keepdims=True)
    step /= np.where(length > 0.0, length, 1.0)
    ahead, behind = step.copy(), np.roll(step, 1, axis=0)
    first, last = strands.first[:-1], strands.first[1:] - 1
    behind[first], ahead[last] = ahead[first], behind[last]
    both = ahead + behind
    double = np.linalg.norm(both, axis=1)
    back = double < 1e-9  # the hair turns round
    tangent = np.where(back[:, None], ahead, both / np.where(back, 1.0, double)[:, None])
    bend = behind - ahead
    size = np.linalg.norm(bend, axis=1)
    cosine = np.clip(0.5 * double, _SHARPEST, 1.0)
    mitre = bend * (np.sqrt(1.0 / cosine - 1.0) * (size > 0.0) / np.where(size > 0.0, size, 1.0))[:, None]
    turn = _turns(tangent, strands, count)
    across = _perpendicular(tangent[first])
    angle = _ROLL * np.arange(len(first))
    other = np.cross(tangent[first], across)
    rolled = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * other
    u = _turned(turn, rolled[strands.owner])
    u -= np.einsum("ni,ni->n", u, tangent)[:, None] * tangent
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(tangent, u), mitre


def _turns(tangent: np.ndarray, strands: Strands, count: int) -> np.ndarray:
    """(n, 4) unit quaternions, w first, that take the tangent of a hair's first point to that of each point by the
    smallest turns from point to point. Their products are found by doubling (Hillis and Steele 1986)."""
    before = np.roll(tangent, 1, axis=0)
    half = np.column_stack((1.0 + np.einsum("ni,ni->n", before, tangent), np.cross(before, tangent)))
    back = half[:, 0] < 1e-9
    half[back] = np.column_stack((np.zeros(np.count_nonzero(back)), _perpendicular(tangent[back])))
    turn = half / np.linalg.norm(half, axis=1, keepdims=True)
    turn[strands.first[:-1]] = 1.0, 0.0, 0.0, 0.0
    local = np.arange(count) - strands.first[strands.owner]
    stride = 1
    while stride <= local.max():
        later = np.flatnonzero(local >= stride)
        turn[later] = _product(turn[later], turn[later - stride])
        stride *= 2
    return turn


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products (n, 4) of quaternions: turns by q, then by p."""
    w = p[:, 0] * q[:, 0] - np.einsum("ni,ni->n", p[:, 1:], q[:, 1:])
    return np.column_stack((w, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])))


def _turned(turn: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) turned by unit quaternions (n, 4)."""
    double = 2.0 * np.cross(turn[:, 1:], vector)
    return vector + turn[:, :1] * double + np.cross(turn[:, 1:], double)


def _perpendicular(direction: np.ndarray) -> np.ndarray:
    """(n, 3) unit vectors perpendicular to others."""
    axis = np.zeros_like(direction)
    np.put_along_axis(axis, np.abs(direction).argmin(axis=1)[:, None], 1.0, axis=1)
    across = np.cross(direction, axis)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def _prisms_of(strands: Strands, frames: tuple, sides: int) -> MeshData:
    """The prisms of hairs that all have the same number of sides; frames: their rows of `_frames`."""
    u, v, mitre = frames
    owner = strands.owner
    angle = 2.0 * np.pi * np.arange(sides) / sides
    outward = np.cos(angle)[:, None] * u[:, None] + np.sin(angle)[:, None] * v[:, None]  # (n, sides, 3)
    corner = np.pi / (sides * np.sin(np.pi / sides)) * strands.radius
    stretch = np.einsum("nsi,ni->ns", outward, mitre)[:, :, None] * mitre[:, None]
    vertices = strands.points[:, None] + corner[:, None, None] * (outward + stretch)
    begin = strands.begins
    side = np.arange(1 if sides == 2 else sides)
    following = (side + 1) % sides
    a, b = sides * begin[:, None] + side, sides * begin[:, None] + following
    c, d = b + sides, a + sides
    thick = strands.radius > 0.0
    from_root, to_tip = np.broadcast_to(thick[begin, None], a.shape), np.broadcast_to(thick[begin + 1, None], a.shape)
    triangles = np.concatenate((np.stack((a, b, c), -1)[from_root], np.stack((a, c, d), -1)[to_tip]))
    hair = np.concatenate([np.broadcast_to(owner[begin, None], a.shape)[each] for each in (from_root, to_tip)])
    caps, of_caps = _caps(strands, sides)
    normals = None
    if sides >= SMOOTH_FROM:
        normals = np.concatenate((outward.reshape(-1, 3)[triangles], np.zeros((len(caps), 3, 3)))).astype(np.float32)
    triangles, hair = np.concatenate((triangles, caps)).astype(np.int32), np.concatenate((hair, of_caps))
    temperature = None if strands.temperature is None else strands.temperature[triangles // sides]
    return MeshData(vertices.reshape(-1, 3), triangles, strands.slot[hair], temperature, normals)


def _caps(strands: Strands, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) triangles that close the ends of prisms, and (k,) the hairs that they are of; none of ribbons."""
    if sides == 2:
        return np.empty((0, 3), np.int64), np.empty(0, np.int64)
    fan = np.stack(np.broadcast_arrays(0, np.arange(1, sides - 1), np.arange(2, sides)), axis=-1)
    root, tip = strands.first[:-1], strands.first[1:] - 1
    hair = np.arange(len(root))
    caps, of_caps = [], []
    for end, shape in ((root, fan[:, ::-1]), (tip, fan)):
        open_ = strands.radius[end] > 0.0
        caps.append((sides * end[open_, None, None] + shape).reshape(-1, 3))
        of_caps.append(np.repeat(hair[open_], len(shape)))
    return np.concatenate(caps), np.concatenate(of_caps)
