# SPDX-License-Identifier: GPL-3.0-or-later
"""Final gathers: which of the camera's gathers send rays of their own, and how those of neighbouring pixels share them.

Neighbours on one sheet, within a disk that is a part of the one that photons would be gathered from, average what
their rays meet. The disk is small where surfaces are close or bent, as irradiance changes quickly there (Ward et al.
1988). It shrinks from pass to pass, in the end to none but a gather's own rays, so what this blurs vanishes as the blur
of the photon map does.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.free_space import LEAST_FREE
from ..geometry.surfaces import NO_WALL, PATCH_LIMIT, patch_in_ball, unit_normal
from ..planning.splitting import NEAR, disk_area, rays_alone, rays_beside, shared_area, sharing, spread_around
from ..system.kernels import FAST_INLINED, FAST_KERNEL, KERNEL, njit

_BESIDE_WALLS = 32  # least rays where there is no room for photons; a power of two
_WHOLE = 0.95  # share of a disk below which a rim cuts it: photons would lie on one side, where the light differs
_BENT = 0.1  # squared difference of the unit normals at which no rays are shared
_WINDOW = 3  # pixels around, in which final gathers share rays


def choose_splits(surfaces, radiometry, estimate, pixels, place, code, rays, gathers, free2, chosen):
    """Choose which gathers send rays, how many, and in which disk neighbours share them.

    The choice rests on what is known before the pass, not on its photons, so it leaves the mean alone. pixels: (n,)
    int64, numbers in the window of the tile's. free2: (gathers,) float32, m2, of the free space around. chosen: (c,)
    int64, the gathers that are asked about. Returns the number of rays of all.
    """
    patch = np.empty(PATCH_LIMIT, np.int32)
    _choose_splits(surfaces, radiometry, estimate, pixels, place, code, rays, gathers, free2, chosen, patch)
    return int(gathers.rays.sum())


@njit(**KERNEL)
def _choose_splits(surfaces, radiometry, estimate, pixels, place, code, rays, gathers, free2, chosen, patch):
    splitting, k, shrink2 = estimate.splitting, estimate.neighbours, estimate.shrink2
    for g in chosen:
        i, t, side = gathers.ray[g], code[g] >> 1, code[g] & 1
        if rays.gathered[i] or radiometry.specular[surfaces.material[t]] == 1.0:
            continue
        sheet, pixel, around2 = surfaces.sheet[t, side], pixels[rays.pixel[i]], float(free2[g])
        carried = carried_by(radiometry, surfaces.material[t], rays, i, gathers.weight[g])
        brought, spread = splitting.sensitivity[pixel] * carried, spread_around(splitting, pixel, sheet)
        count, _ = rays_beside(splitting, sheet, spread, brought, around2, k, shrink2)
        if count == 0:
            disk = disk_area(splitting.sheets, sheet, spread, around2, k, shrink2)
            if _is_cut(surfaces, code[g], place[g], disk, patch):
                count, _ = rays_alone(splitting, sheet, spread, brought, around2, k, shrink2)
        if free2[g] < np.float32(LEAST_FREE * estimate.reach2):
            count = max(count, _BESIDE_WALLS)
        gathers.brought[g], gathers.rays[g], gathers.radius2[g] = brought, count, 0.0
        if count > 0 and sharing(splitting.sheets, sheet, spread, around2, k, shrink2) >= 1.0:
            shared = shared_area(splitting.sheets, sheet, spread, around2, k, shrink2)
            gathers.radius2[g] = shared / math.pi
            gathers.is_cut[g] = _is_cut(surfaces, code[g], place[g], shared, patch)


@njit(inline="always")
def _is_cut(surfaces, code, place, area, patch):
    """Whether the rim of a sheet cuts a disk of this area (m2) around a place on it. A mesh that is finer than what
    patch can hold counts as whole."""
    x, y, z = place
    r2 = area / math.pi
    members, inside = patch_in_ball(
        surfaces.corners, surfaces.neighbours, code >> 1, code & 1, x, y, z, r2, NO_WALL, patch
    )
    return members > 0 and inside < _WHOLE * area


class Finals(NamedTuple):
    """Final gathers of one bounce, n of them: pixel (n,) int32 in the tile, place (n, 3) float64, m, code (n,) int32,
    2 triangle + side, rays (n,) int32, their number, radius2 (n,) float64, m2, of the disk within which they share,
    is_cut (n,) bool, whether a rim cuts it.

    row: the first of their n rows in the image. Each holds the mean radiance that the rays meet, times `brought` (n,)
    float64, see Gathers, so that roulette on the way knows what matters. factor: (n, layers * b) float32, what the
    pixel gets of that mean, the same for each layer.
    """

    pixel: np.ndarray
    place: np.ndarray
    code: np.ndarray
    rays: np.ndarray
    radius2: np.ndarray
    is_cut: np.ndarray
    row: int
    brought: np.ndarray
    factor: np.ndarray


@njit(cache=True, nogil=True)
def open_finals(surfaces, radiometry, estimate, place, code, rays, gathers, row):
    """The final gathers among the gathers, which get rows from `row` on."""
    chosen = np.flatnonzero(gathers.rays)
    count, bands = chosen.size, radiometry.reference.size
    finals = Finals(
        np.empty(count, np.int32), place[chosen], code[chosen], gathers.rays[chosen], gathers.radius2[chosen],
        gathers.is_cut[chosen], row, gathers.brought[chosen],
        np.empty((count, estimate.layers * bands), np.float32),
    )  # fmt: skip
    for n in range(count):
        g = chosen[n]
        gathers.row[g] = row + n
        i, material = gathers.ray[g], surfaces.material[code[g] >> 1]
        finals.pixel[n] = rays.pixel[i]
        diffuse = gathers.weight[g] * (1.0 - radiometry.specular[material])
        for b in range(bands):
            finals.factor[n, b] = diffuse * rays.throughput[i, b] * radiometry.reflectance[material, b]
        for b in range(bands, finals.factor.shape[1]):
            finals.factor[n, b] = finals.factor[n, b - bands]
    return finals


@njit(**FAST_INLINED)
def carried_by(radiometry, material, rays, i, weight):
    """Share of a pixel that is reflected diffusely in a gather of ray i, the mean of all bands."""
    total = np.float32(0.0)
    for b in range(rays.throughput.shape[1]):
        total += rays.throughput[i, b] * radiometry.reflectance[material, b]
    return weight * (1.0 - radiometry.specular[material]) * total / rays.throughput.shape[1]


@njit(**FAST_INLINED)
def largest_throughput(throughput, rho):
    """Largest throughput of any band after a reflection."""
    largest = np.float32(0.0)
    for b in range(rho.size):
        largest = max(largest, throughput[b] * rho[b])
    return float(largest)


def share(surfaces, finals, shrink2, rows, columns, closeness, image):
    """Add to the pixels of a tile of rows by columns what their final gathers and those around reflect.

    The mean of those on one sheet within the disk, which shrinks to none but their own. Where a rim cuts the disk, only
    those count that have another on the opposite side: from one side alone comes other light. closeness: by row of the
    image, sum over a gather's rays of 1 / m to what they met.
    """
    first, following = np.full(rows * columns, -1, np.int32), np.empty(len(finals.pixel), np.int32)
    mean = np.empty(image.shape[1], np.float32)
    _share(surfaces, finals, shrink2, rows, columns, closeness, image, first, following, mean)


@njit(**FAST_KERNEL)
def _share(surfaces, finals, shrink2, rows, columns, closeness, image, first, following, mean):
    for n in range(finals.pixel.size - 1, -1, -1):
        following[n], first[finals.pixel[n]] = first[finals.pixel[n]], n
    for n in range(finals.pixel.size):
        x, y = finals.pixel[n] % columns, finals.pixel[n] // columns
        t, side = finals.code[n] >> 1, finals.code[n] & 1
        sheet, normal = surfaces.sheet[t, side], unit_normal(surfaces, t, side)
        near = NEAR * finals.rays[n] / max(closeness[finals.row + n], 1e-30)
        limits = max(min(finals.radius2[n], near * near * shrink2), 1e-30), _BENT * shrink2
        mean[:], total = 0.0, 0.0
        for row in range(max(0, y - _WINDOW), min(rows, y + _WINDOW + 1)):
            for column in range(max(0, x - _WINDOW), min(columns, x + _WINDOW + 1)):
                other = first[row * columns + column]
                if finals.is_cut[n]:
                    i, j = 2 * y - row, 2 * x - column  # of the pixel on the opposite side
                    if not (0 <= i < rows and 0 <= j < columns):
                        continue
                    if not _is_met(surfaces, finals, n, first[i * columns + j], following, sheet, normal, limits):
                        continue
                while other >= 0:
                    weight = _weight(surfaces, finals, n, other, sheet, normal, limits)
                    if weight > 0.0:
                        total += weight
                        scale = np.float32(weight / finals.brought[other])
                        for b in range(mean.size):
                            mean[b] += scale * image[finals.row + other, b]
                    other = following[other]
        for b in range(mean.size):
            image[finals.pixel[n], b] += finals.factor[n, b] * mean[b] / np.float32(total)


@njit(inline="always")
def _is_met(surfaces, finals, n, other, following, sheet, normal, limits):
    """Whether gather n shares rays with `other` (-1 for none) or one of those that follow it in its pixel."""
    while other >= 0 and _weight(surfaces, finals, n, other, sheet, normal, limits) == 0.0:
        other = following[other]
    return other >= 0


@njit(inline="always")
def _weight(surfaces, finals, n, other, sheet, normal, limits):
    """Weight of another final gather for gather n, in the centre of its disk: what is left of 1 of it after the
    squares of distance over radius and of the normals' difference over its limit. sheet, normal: of gather n. limits:
    the squared radius (m2) and the squared limit.
    """
    if n == other:
        return float(finals.rays[n])
    t, side = finals.code[other] >> 1, finals.code[other] & 1
    if surfaces.sheet[t, side] != sheet:
        return 0.0
    p, q = finals.place[n], finals.place[other]
    distance2 = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
    ox, oy, oz = unit_normal(surfaces, t, side)
    bend2 = 2.0 - 2.0 * (normal[0] * ox + normal[1] * oy + normal[2] * oz)
    return finals.rays[other] * max(0.0, 1.0 - distance2 / limits[0] - bend2 / limits[1])
