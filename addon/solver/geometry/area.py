# SPDX-License-Identifier: GPL-3.0-or-later
"""The area of the surface inside a ball, on this side of a wall: the power of photons is divided by this area."""

import math
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import difference, dot
from ..system.kernels import FAST_KERNEL, INLINED, KERNEL, njit
from .mesh import SAME_SURFACE
from .point_tree import WIDTH, open_node, start_walk
from .surfaces import AREA, LONGEST, NORMAL_UNIT, sheet_of, unit_normal
from .triangles import corner, normal

# Most triangles whose area inside the disk of a gather is summed one by one; in finer meshes region_area measures.
PATCH_LIMIT = 64
# Area of the disk over twice the area of a triangle and its neighbours; above, the disk touches more than PATCH_LIMIT.
_TOO_FINE = 6.0


class Ball(NamedTuple):
    """A ball around a point of a surface, up to a wall.

    center: m. radius2: m2, squared radius. wall: (3,) floats, 1 / m, a vector towards the wall, which is a plane at the
    distance 1 / |wall| from the center; nothing beyond it counts. Zeros where there is no wall (see FreeSpace).
    """

    center: tuple[float, float, float]
    radius2: float
    wall: tuple[float, float, float]


@njit(**KERNEL)
def _wedge(ax, ay, bx, by, r2):
    """Signed area of the disk around the origin inside the triangle (origin, a, b)."""
    cross = ax * by - ay * bx
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0 or cross == 0.0:
        return 0.0
    along = -(ax * dx + ay * dy) / length2  # parameter, along the edge, of the point nearest to the origin
    gap2 = cross * cross / length2  # squared distance of that point
    if gap2 >= r2:
        return 0.5 * r2 * math.atan2(cross, ax * bx + ay * by)
    half = math.sqrt((r2 - gap2) / length2)
    t0, t1 = max(0.0, along - half), min(1.0, along + half)
    if t0 >= t1:
        return 0.5 * r2 * math.atan2(cross, ax * bx + ay * by)
    px, py, qx, qy = ax + t0 * dx, ay + t0 * dy, ax + t1 * dx, ay + t1 * dy
    area = 0.5 * (px * qy - py * qx)
    if t0 > 0.0:
        area += 0.5 * r2 * math.atan2(ax * py - ay * px, ax * px + ay * py)
    if t1 < 1.0:
        area += 0.5 * r2 * math.atan2(qx * by - qy * bx, qx * bx + qy * by)
    return area


NO_WALL = (np.float32(0.0),) * 3


@njit(**INLINED)
def beyond(wall, way):
    """How far beyond a wall a point lies, over the wall's distance; negative on this side. way: m, from the center to
    the point. wall: see Ball.
    """
    return way[0] * wall[0] + way[1] * wall[1] + way[2] * wall[2] - np.float32(1.0)


@njit(**INLINED)
def _reach2(wall, r2):
    """Squared radius r2 (m2) of a disk over the squared distance of a wall."""
    return (wall[0] * wall[0] + wall[1] * wall[1] + wall[2] * wall[2]) * r2


@njit(**INLINED)
def is_cut_off(wall, r2):
    """Whether a wall cuts the disk of squared radius r2 (m2) around the center."""
    return _reach2(wall, r2) > 1.0


@njit(**INLINED)
def disk_before(wall, r2):
    """Area (m2) of the disk of squared radius r2 (m2) on this side of a wall: the disk without a circular segment."""
    if not is_cut_off(wall, r2):
        return math.pi * r2
    near = 1.0 / math.sqrt(_reach2(wall, r2))  # distance over the radius
    return r2 * (math.pi - math.acos(near) + near * math.sqrt(1.0 - near * near))


@njit(**KERNEL)
def area_in_ball(corners, t, ball):
    """Area of triangle t inside a ball, on this side of its wall, m2; exact."""
    n, double_area = normal(corners, t)
    if double_area == 0.0:
        return 0.0
    a = difference(corner(corners, t, 0), ball.center)
    b = difference(corner(corners, t, 1), ball.center)
    c = difference(corner(corners, t, 2), ball.center)
    height = dot(a, n)
    r2 = ball.radius2 - height * height
    if r2 <= 0.0:
        return 0.0
    # coordinates in the plane, along the first edge and across it
    e = difference(b, a)
    inverse = 1.0 / math.sqrt(dot(e, e))
    e = (e[0] * inverse, e[1] * inverse, e[2] * inverse)
    f = (n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0])
    a = (dot(a, e), dot(a, f), beyond(ball.wall, a))
    b = (dot(b, e), dot(b, f), beyond(ball.wall, b))
    c = (dot(c, e), dot(c, f), beyond(ball.wall, c))
    area, out, back = 0.0, a, a  # points where the outline leaves this side of the wall and where it comes back
    for p, q in ((a, b), (b, c), (c, a)):
        if p[2] > 0.0 and q[2] > 0.0:
            continue
        if (p[2] > 0.0) != (q[2] > 0.0):
            s = p[2] / (p[2] - q[2])
            at = (p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1]), 0.0)
            if p[2] > 0.0:
                p = back = at
            else:
                q = out = at
        area += _wedge(p[0], p[1], q[0], q[1], r2)
    return area + _wedge(out[0], out[1], back[0], back[1], r2)


@njit(**INLINED)
def _edge_distance2(corners, t, i, point):
    """Squared distance of a point from edge i of triangle t."""
    a = corner(corners, t, i)
    d, p = difference(corner(corners, t, (i + 1) % 3), a), difference(point, a)
    length2 = dot(d, d)
    s = min(1.0, max(0.0, dot(p, d) / length2)) if length2 > 0.0 else 0.0
    p = (p[0] - s * d[0], p[1] - s * d[1], p[2] - s * d[2])
    return dot(p, p)


@njit(**KERNEL)
def patch_in_ball(surfaces, side_id, ball, patch):
    """The patch of surface around the center of a ball, a point on a side, whose photons a gather in the ball may
    count.

    Walks from the side over shared edges to the triangles that reach into the ball and face the same way. Fills patch
    (PATCH_LIMIT,) int32 with side_ids of these members. Returns the number of members and their area (m2) inside the
    ball, on this side of its wall. Returns 0 members for a mesh too fine to walk over, or probably too fine: where the
    triangle and its neighbours are small and none of its edges is a rim. There `region_area` measures.
    """
    corners, neighbours, r2, t = surfaces.corners, surfaces.neighbours, ball.radius2, side_id >> 1
    n, around = normal(corners, t)
    if side_id & 1 == 1:
        n = (-n[0], -n[1], -n[2])
    patch[0] = side_id
    disk = disk_before(ball.wall, r2)
    crossed = False
    for i in range(3):
        crossed |= _edge_distance2(corners, t, i, ball.center) < r2
    if not crossed:
        return 1, disk
    rim = False
    for i in range(3):
        rim |= neighbours[t, i] < 0
        if neighbours[t, i] >= 0:
            m, double_area = normal(corners, neighbours[t, i] >> 1)
            rim |= abs(dot(n, m)) < SAME_SURFACE
            around += double_area
    if not rim and math.pi * r2 > _TOO_FINE * around:  # rather than walk PATCH_LIMIT triangles in vain
        return 0, disk
    count, done, area = 1, 0, 0.0
    while done < count:
        current, current_side = patch[done] >> 1, patch[done] & 1
        done += 1
        area += area_in_ball(corners, current, ball)
        for i in range(3):
            other = neighbours[current, i]
            if other < 0 or _edge_distance2(corners, current, i, ball.center) >= r2:
                continue
            other ^= current_side  # the same side of the sheet
            facing = dot(n, normal(corners, other >> 1)[0])
            if (facing if other & 1 == 0 else -facing) < SAME_SURFACE:
                continue
            known = False
            for j in range(count):
                known |= patch[j] == other
            if not known:
                if count == PATCH_LIMIT:
                    return 0, disk
                patch[count] = other
                count += 1
    return count, abs(area)


@njit(inline="always")
def is_small(longest, disk2):
    """Whether a triangle with this longest edge (m) is so small, against a disk of this squared radius (m2), that it
    may count as inside or outside as a whole, by its centroid. Needles are never small. All float32.
    """
    return np.float32(8.0) * longest * longest <= disk2


@njit(inline="always")
def in_slab(height, disk2):
    """Whether a point at this height (m) over the tangent plane, on a small triangle, counts as surface of the disk.

    The same rule is used for photons and for area, so that their ratio is unbiased whatever the rule. float32.
    """
    return np.float32(16.0) * height * height < disk2


@njit(**FAST_KERNEL)
def region_area(surfaces, side_id, ball, walk):
    """Area (m2) inside a ball around a point on a side, on this side of its wall, of the triangles of the side's sheet
    that face the same way.

    Most triangles are small here, and a small one counts as a whole if its centroid is inside: the area errs by a few
    percent at random, but not in the mean. Of larger triangles the area inside is exact. The result is at least the
    area that the side's own triangle has inside. walk: room, see Walk.
    """
    tree, near, wall = surfaces.mesh, walk.near, ball.wall
    least = abs(area_in_ball(surfaces.corners, side_id >> 1, ball))
    x, y, z = np.float32(ball.center[0]), np.float32(ball.center[1]), np.float32(ball.center[2])
    nx, ny, nz = unit_normal(surfaces, side_id)
    nx, ny, nz, r2 = np.float32(nx), np.float32(ny), np.float32(nz), np.float32(ball.radius2)
    sheet, facing = np.int16(sheet_of(surfaces, side_id)), np.float32(SAME_SURFACE * NORMAL_UNIT)
    total = 0.0
    depth = start_walk(tree, walk)
    while depth > 0:
        depth, children = open_node(tree, walk, depth, (x, y, z), r2)
        for c in range(children):
            leaf = walk.stack[depth + c]
            p, n = tree.leaves[leaf], surfaces.leaf_facing[leaf]
            part, large = np.float32(0.0), np.int32(0)
            for j in range(WIDTH):  # no branch, so that a register holds the leaf
                dx, dy, dz = p[0, j] - x, p[1, j] - y, p[2, j] - z
                cosine = np.float32(n[0, j]) * nx + np.float32(n[1, j]) * ny + np.float32(n[2, j]) * nz
                height = dx * nx + dy * ny + dz * nz
                front = (cosine > facing) & (n[3, j] == sheet)
                back = (cosine < -facing) & (n[4, j] == sheet)
                small = is_small(p[LONGEST, j], r2)
                inside = small & (dx * dx + dy * dy + dz * dz < r2) & in_slab(height, r2)
                inside &= beyond(wall, (dx, dy, dz)) <= np.float32(0.0)
                part += p[AREA, j] if (front | back) & inside else np.float32(0.0)
                near[j] = np.float32((front | back) & ~small)
                large += np.int32((front | back) & ~small)
            total += part
            for j in range(WIDTH if large else 0):
                if near[j]:
                    total += area_in_ball(surfaces.corners, np.int64(surfaces.leaf_triangle[leaf * WIDTH + j]), ball)
    return max(total, least)
