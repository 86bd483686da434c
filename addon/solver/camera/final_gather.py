# SPDX-License-Identifier: GPL-3.0-or-later
"""Final gathers: which gathers of camera paths are kept, how many rays they send, and how neighbouring pixels share
these rays.

Final gathers of neighbouring pixels on one sheet, within a disk, average the radiance that their rays meet. The disk is
a part of the disk from which photons would be gathered. It is small where surfaces are close or bent, as irradiance
changes quickly there (Ward et al. 1988). It shrinks from pass to pass, until a gather has its own rays alone, so that
the blur by sharing vanishes as the blur of the photon map does.
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.area import NO_WALL, PATCH_LIMIT, Ball, patch_in_ball
from ..geometry.interaction import interact
from ..geometry.stage import diffuse_reflectance_at, lobes_at
from ..geometry.surfaces import sheet_of, unit_normal
from ..physics.lobes import DIFFUSE, diffuse_share
from ..planning.splitting import FEWEST_SHARED, NEAR, choose_rays, end_chance, shared_area, sharing, spread_around
from ..sampling.heuristics import looking_from
from ..sampling.rng import uniform
from ..sampling.vectors import dot, put_vector
from ..system.kernels import FAST_INLINED, FAST_KERNEL, KERNEL, njit
from .gathers import Gathers, first_gathers
from .streams import GATHERING

_WHOLE = 0.95  # a rim cuts a disk if less than this share of it lies on the sheet: photons would lie to one side
_BENT = 0.1  # squared difference of two unit normals from which on no rays are shared
_WINDOW = 3  # pixels on each side, within which final gathers share rays


def choose_splits(stage, estimate, pixels, bounce, gathers) -> Gathers:
    """Let roulette decide which gathers to keep; choose how many rays these send, and within which disk neighbours
    share the rays. Returns the gathers that are kept.

    The choice rests on what is known before the pass, not on the photons of the pass, so it leaves the mean of the
    image alone. pixels: (n,) int64, numbers, in the window, of the tile's pixels.
    """
    count = len(gathers.ray)
    if count == 0:
        return gathers
    rooms = np.empty(PATCH_LIMIT, np.int32), np.empty(bounce.rays.throughput.shape[1], np.float32)
    kept = _choose_splits(stage, estimate, pixels, bounce, gathers, np.full(count, -1, np.int32), rooms)
    return first_gathers(gathers, kept)


@njit(**KERNEL)
def _choose_splits(stage, estimate, pixels, bounce, gathers, kept_as, rooms):
    rays, (patch, room), kept = bounce.rays, rooms, np.int64(0)
    for g in range(gathers.ray.size):
        i = gathers.ray[g]
        at = interact(stage.surfaces, bounce.hits, i, rays.direction)
        if rays.final[i]:
            chance = end_chance(estimate.splitting, sheet_of(stage.surfaces, at.side_id), gathers.throughput[g])
            contribution, count, area = 0.0, 0, 0.0
        else:
            pixel = pixels[rays.pixel[i]]
            chance, contribution, count, area = _plan(stage, estimate, pixel, at, rays.throughput[i], gathers, g, room)
        if uniform(rays.path[i], GATHERING + bounce.number) >= chance:
            continue
        kept_as[g] = kept
        gathers.ray[kept], gathers.weight[kept] = i, gathers.weight[g] / chance
        gathers.throughput[kept], gathers.contribution[kept] = gathers.throughput[g], contribution / chance
        gathers.rays[kept], gathers.radius2[kept] = count, area / math.pi
        gathers.is_cut[kept] = area > 0.0 and _is_cut(stage.surfaces, at, area, patch)
        kept += 1
    for i in range(gathers.of.size):
        if gathers.of[i] >= 0:
            gathers.of[i] = kept_as[gathers.of[i]]
    return kept


@njit(inline="always")
def _plan(stage, estimate, pixel, at, throughput, gathers, g, room):
    """The plan for gather g at what a pixel of the window shows, `at`: the chance with which roulette keeps it, its
    contribution, how many rays it sends, and the area (m2) of the disk within which it shares them, or 0.

    throughput: (b,) of its ray. room: (b,) float32.
    """
    splitting, k, shrink2, reach2 = estimate.splitting, estimate.neighbours, estimate.shrink2, estimate.reach2
    sheet, lobes, sensitivity = sheet_of(stage.surfaces, at.side_id), lobes_at(stage, at), splitting.sensitivity[pixel]
    rho, spread = diffuse_reflectance_at(stage, at, room), spread_around(splitting, pixel, sheet)
    contribution = sensitivity * _reflected_share(rho, throughput, gathers.weight[g], diffuse_share(lobes))
    brings = contribution, sensitivity * gathers.throughput[g]
    count, chance, _ = choose_rays(splitting, sheet, spread, brings, reach2, k, shrink2)
    if lobes.flags & DIFFUSE == 0:
        return chance, contribution, 0, 0.0
    area = 0.0
    if count >= FEWEST_SHARED and sharing(splitting.sheets, sheet, spread, reach2, k, shrink2) >= 1.0:
        area = shared_area(splitting.sheets, sheet, spread, reach2, k, shrink2)
    return chance, contribution, count, area


@njit(inline="always")
def _is_cut(surfaces, at, area, patch):
    """Whether the rim of a sheet cuts a disk of this area (m2) around an Interaction. No, if the disk holds more
    triangles than patch has room for."""
    members, inside = patch_in_ball(surfaces, at.side_id, Ball(at.point, area / math.pi, NO_WALL), patch)
    return members > 0 and inside < _WHOLE * area


class Finals(NamedTuple):
    """The n final gathers of one bounce.

    pixel: (n,) int32, in the tile. point: (n, 3) float64, m. side_id: (n,) int32. rays: (n,) int32, number of rays.
    radius2: (n,) float64, m2, squared radius of the disk within which neighbours share rays. is_cut: (n,) bool, whether
    a rim cuts this disk. near: (n,) float32, m, and fewer: (n,) float32, see Rows.
    row: the first of 2 n rows in the image: one for each gather, of what it shares, and n rows further one for what it
    does not share. A row holds the mean radiance that the rays meet, times `contribution` (n,) float64, see Gathers: so
    the throughput of these rays says how much they count in the image, and roulette can go by it. factor: (n, layers *
    b) float32, by which the mean radiance is added to the pixel, the same for each layer.
    """

    pixel: np.ndarray
    point: np.ndarray
    side_id: np.ndarray
    rays: np.ndarray
    radius2: np.ndarray
    is_cut: np.ndarray
    near: np.ndarray
    fewer: np.ndarray
    row: int
    contribution: np.ndarray
    factor: np.ndarray


@njit(cache=True, nogil=True)
def open_finals(stage, lighting, bounce, gathers, row):
    """The final gathers among the gathers. Their rows in the image start at `row`."""
    chosen = np.flatnonzero(gathers.rays)
    count, bands = chosen.size, stage.radiometry.reference.size
    room = np.empty(bands, np.float32)
    finals = Finals(
        np.empty(count, np.int32), np.empty((count, 3)), np.empty(count, np.int32), gathers.rays[chosen],
        gathers.radius2[chosen], gathers.is_cut[chosen], np.empty(count, np.float32),
        np.empty(count, np.float32), row, gathers.contribution[chosen],
        np.empty((count, lighting.layers * bands), np.float32),
    )  # fmt: skip
    for n in range(count):
        g = chosen[n]
        gathers.row[g] = row + n
        i = gathers.ray[g]
        at = interact(stage.surfaces, bounce.hits, i, bounce.rays.direction)
        put_vector(at.point, finals.point, n)
        finals.pixel[n], finals.side_id[n] = bounce.rays.pixel[i], at.side_id
        looking = looking_from(lighting.looking, sheet_of(stage.surfaces, at.side_id))
        finals.near[n], finals.fewer[n] = looking.near, looking.alone / looking.together
        rho, diffuse = diffuse_reflectance_at(stage, at, room), gathers.weight[g] * diffuse_share(lobes_at(stage, at))
        for b in range(bands):
            finals.factor[n, b] = diffuse * bounce.rays.throughput[i, b] * rho[b]
        for b in range(bands, finals.factor.shape[1]):
            finals.factor[n, b] = finals.factor[n, b - bands]
    return finals


@njit(**FAST_INLINED)
def _reflected_share(rho, throughput, weight, diffuse):
    """Share of a pixel that a gather's diffuse reflection makes up, mean of all bands. rho: (b,), of which the diffuse
    lobe has this share. throughput: (b,) of its ray."""
    total = np.float32(0.0)
    for b in range(rho.size):
        total += throughput[b] * rho[b]
    return weight * diffuse * total / rho.size


def share(surfaces, finals, shrink2, shape, rows) -> None:
    """Add to the pixels of a tile of this shape what their final gathers reflect, sharing rays with gathers around.

    A gather takes the weighted mean over all final gathers on its sheet within its disk, which shrinks from pass to
    pass until the gather is alone. Where a rim cuts the disk, another gather counts only if there is also one at the
    opposite pixel: neighbours on one side alone would see other light in the mean. rows: see Rows.

    Two gathers share if each lies in the disk of the other. What a gather's own rays met says how large its disk is, so
    one that met something near keeps that for itself. If the others took it into their means all the same, it would
    count twice.
    """
    first, following = np.full(shape[0] * shape[1], -1, np.int32), np.empty(len(finals.pixel), np.int32)
    room = np.empty(len(finals.pixel)), np.empty(rows.image.shape[1], np.float32)
    _share(surfaces, finals, shrink2, shape, rows, (first, following), room)


@njit(**FAST_KERNEL)
def _share(surfaces, finals, shrink2, shape, rows, chain, room):
    (first, following), (height, width), image = chain, shape, rows.image
    disk2, mean = room
    limits = disk2, _BENT * shrink2
    for n in range(finals.pixel.size - 1, -1, -1):
        following[n], first[finals.pixel[n]] = first[finals.pixel[n]], n
        near = NEAR * finals.rays[n] / max(rows.closeness[finals.row + n], 1e-30)
        disk2[n] = max(min(finals.radius2[n], near * near * shrink2), 1e-30)
    for n in range(finals.pixel.size):
        x, y = finals.pixel[n] % width, finals.pixel[n] // width
        mean[:], total, window = 0.0, 0.0, _WINDOW if finals.radius2[n] > 0.0 else 0
        for row in range(max(0, y - window), min(height, y + window + 1)):
            for column in range(max(0, x - window), min(width, x + window + 1)):
                other = first[row * width + column]
                if finals.is_cut[n]:
                    i, j = 2 * y - row, 2 * x - column  # of the pixel on the opposite side
                    if not (0 <= i < height and 0 <= j < width):
                        continue
                    if not _is_met(surfaces, finals, n, first[i * width + j], following, limits):
                        continue
                while other >= 0:
                    weight = _weight(surfaces, finals, n, other, limits)
                    if weight > 0.0:
                        total += weight
                        scale = np.float32(weight / finals.contribution[other])
                        for b in range(mean.size):
                            mean[b] += scale * image[finals.row + other, b]
                    other = following[other]
        own, alone = np.float32(1.0 / finals.contribution[n]), finals.row + finals.pixel.size + n
        for b in range(mean.size):
            met = mean[b] / np.float32(total) + own * image[alone, b]
            image[finals.pixel[n], b] += finals.factor[n, b] * met


@njit(inline="always")
def _is_met(surfaces, finals, n, other, following, limits):
    """Whether gather n shares rays with gather `other` (-1 for none) or one that follows `other` in the same pixel."""
    while other >= 0 and _weight(surfaces, finals, n, other, limits) == 0.0:
        other = following[other]
    return other >= 0


@njit(inline="always")
def _weight(surfaces, finals, n, other, limits):
    """Weight of another final gather for gather n, at the centre of the disk: the other's number of rays, times 1 minus
    squared distance over squared radius, the smaller of the two, minus squared difference of the normals over its
    limit. limits: the squared radii (n,) in m2, and the limit of the squared difference.
    """
    if n == other:
        return float(finals.rays[n])
    mine, its = finals.side_id[n], finals.side_id[other]
    if sheet_of(surfaces, its) != sheet_of(surfaces, mine):
        return 0.0
    p, q = finals.point[n], finals.point[other]
    distance2 = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
    bend2 = 2.0 - 2.0 * dot(unit_normal(surfaces, mine), unit_normal(surfaces, its))
    return finals.rays[other] * max(0.0, 1.0 - distance2 / min(limits[0][n], limits[0][other]) - bend2 / limits[1])
