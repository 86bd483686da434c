# SPDX-License-Identifier: GPL-3.0-or-later
"""What a few rays tell of every pixel before the first pass: how much differs within it, how much its temperature
depends on its radiance, and how noisy final gathers are there.

These rays are of a sequence of their own, the same for every seed, so what is decided by them leaves the mean alone.
"""

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.surfaces import (
    Surfaces,
    Tracer,
    facing_side,
    inverse_distance,
    point,
    put_ray,
    start_ray,
    temperature_at,
    unit_normal,
)
from ..physics.radiometry import Radiometry, excess
from ..physics.spectrum import apparent_temperature
from ..sampling.rng import path_key, uniform
from ..sampling.warps import cosine_direction, mirror, reflect_in_lobe
from ..system.kernels import KERNEL, njit
from .sheets import Sheets

_LOOKS = 16  # rays that look at a pixel
_BOUNCES = 8  # on specular surfaces, that a look follows
_FAINT = 1.0 / 64.0  # share of a look below which it does not go on
_EDGE, _BLOCKS = 8, 4096  # pixels on each side of a block, at least; and blocks of an image, at most
_TRIED = 256  # rays of final gathers that are tried in a block, of those after as many bounces
_TOGETHER = 1 << 10  # pixels that are looked at together
_STEP = 1e-3  # of the radiance, to see how the temperature changes with it
_FAINTEST = 0.05  # of the image's mean radiance: fainter pixels are taken to have that, as 0 K has no slope
_AROUND = 1.0 / 16.0  # of the variance in the pixels around that a pixel may hold without having been seen to
_PRIOR = 32.0  # rays that the spread over a whole sheet is worth in a block: fewer, and what they missed would rule
_DIMENSION = 1 << 16  # of the random numbers of a look after its start, four for each surface


class Cells(NamedTuple):
    """Final gathers on one sheet in one block of pixels, by cell (c,).

    key: int64, ascending, block * number of sheets + label of the sheet. brightness: of what rays from there meet,
    over what photons of the trial pass say of the whole sheet. ray_noise: W2 sr-2 m-4, variance of the radiance that a
    ray from there meets, and of what it recalls. closeness: 1 / m, mean to what it meets. density: 1 / m2, gathers of a
    pass. rest: W2 sr-2 m-4, variance that photons leave however many rays ask for what they say, and that of caustics.
    count: of gathers, one for each pixel and number of bounces that shows the sheet. carried2: mean square of what they
    bring, as a share of the pixel times its sensitivity.
    """

    key: np.ndarray
    brightness: np.ndarray
    ray_noise: np.ndarray
    closeness: np.ndarray
    density: np.ndarray
    rest: np.ndarray
    count: np.ndarray
    carried2: np.ndarray


class Looks(NamedTuple):
    """What the looks found, by pixel of the window (p,).

    sensitivity: float64, how much the apparent temperature depends on the radiance, with a mean square of 1.
    variance: float64, W2 sr-2 m-4 of the radiance that single camera rays see, times the square of the sensitivity; or
    a sixteenth of those in the pixels around together, if that is more.
    unknown: bool, whether it shows a rough lobe, of which a few looks do not say all, or a specular surface from which
    a look did not go on, as little was left of it or it was the last of many. block: int32, number of the block it lies
    in.
    """

    sensitivity: np.ndarray
    variance: np.ndarray
    unknown: np.ndarray
    block: np.ndarray
    cells: Cells


class _Sight(NamedTuple):
    """Rays that look, straight from the camera or by way of specular surfaces, those of a pixel one behind the other.

    origin, direction: (n, 3) float32. look: (n,) int64, of which look each is a part. share: (n,) float64, of what they
    see that reaches the camera. way: (n,) float64, m from the camera to the origin. angle: (n,) float64, sr, solid
    angle of the pixel; for parallel rays m2.
    """

    origin: np.ndarray
    direction: np.ndarray
    look: np.ndarray
    share: np.ndarray
    way: np.ndarray
    angle: np.ndarray


def look_at_pixels(
    surfaces: Surfaces,
    tracer: Tracer,
    radiometry: Radiometry,
    surroundings: np.ndarray,
    shines: np.ndarray,
    is_open: np.ndarray,
    sheets: Sheets,
    eye: Eye,
    edges: np.ndarray,
    key: np.uint64,
    threads: int,
    cancelled: Callable[[], bool],
) -> Looks:
    """Look at every pixel, and try a few rays of the final gathers that it might send.

    surroundings: (b,) float64, their excess radiance. shines: (t, 2) bool, lamps, which final gathers leave to shadow
    rays. is_open: (t, 2) bool, sides on which no photons from the surroundings are stored. edges: (b + 1,) um, of the
    bands. key: of the rays. cancelled: once it is true, what is returned tells nothing.
    """
    x0, y0, x1, y1 = (int(end) for end in eye.window)
    width, height = x1 - x0, y1 - y0
    edge = _EDGE
    while -(-width // edge) * -(-height // edge) > _BLOCKS:
        edge += 1
    block = _blocks(width, height, edge)
    mean, variance, unknown = np.zeros(len(block)), np.zeros(len(block)), np.zeros(len(block), np.bool_)
    reflectance = radiometry.reflectance.mean(axis=1)
    share = (1.0 - radiometry.specular) * reflectance
    seen_lamps = np.zeros_like(shines)
    open_sheets = np.zeros(len(sheets.lit), np.bool_)
    open_sheets[surfaces.sheet[is_open]] = True
    stride = max(1, round(_LOOKS * len(block) / (_TRIED * (block[-1] + 1))))

    def see(hits, direction, hidden):
        seen = np.empty(len(direction))
        room, sky = np.empty(len(surroundings)), float(surroundings.sum())
        _see(surfaces, radiometry, share, sky, sheets.reflected, hidden, *hits, direction, seen, room)
        return seen

    def try_gathers(first, bounce, hits, sight):
        sheet, carried, footprint = np.empty((3, len(sight.look)))
        _locate(surfaces, share, eye.kind == 1, *hits, sight, sheet, carried, footprint)
        label, pixel = sheet.astype(np.int32), (first + sight.look // _LOOKS).astype(np.int32)
        tried = np.flatnonzero(sheet >= 0)
        tried = tried[(_LOOKS * first + sight.look[tried]) % stride == 0]
        origin, onward = np.empty((2, len(tried), 3), np.float32)
        _start_gathers(surfaces, key, _LOOKS * first, bounce, tried, *hits, sight, origin, onward)
        ends, (noise, closeness, rest) = tracer.trace(origin, onward), np.zeros((3, len(tried)))
        stored = (ends[0] >= 0) | ~open_sheets[label[tried]]
        met = see(ends, onward, shines)
        _measure(surfaces, sheets, share, *ends, origin, onward, closeness, noise, rest)
        _group(sight.look, sheet, carried)
        shown = np.flatnonzero(carried)
        density = 1.0 / footprint[tried]
        return (
            (pixel[shown], label[shown], carried[shown]),
            (pixel[tried], label[tried], met, np.abs(met) * stored, noise, closeness, density, rest),
        )

    def look(first: int):
        pixels = np.arange(first, first if cancelled() else min(first + _TOGETHER, len(block)))
        sight, reach = _straight(eye, key, pixels)
        seen, unclear = np.zeros(len(sight.look)), np.zeros(len(sight.look), np.bool_)
        found = []
        for bounce in range(_BOUNCES + 1):
            hits = tracer.trace(sight.origin, sight.direction, reach)
            seen[sight.look] += sight.share * see(hits, sight.direction, seen_lamps)
            found.append(try_gathers(first, bounce, hits, sight))
            onward = _Sight(*map(np.empty_like, sight))
            sent = _follow(
                surfaces, radiometry, reflectance, key, _LOOKS * first, bounce, *hits, sight, unclear, onward
            )  # fmt: skip
            sight = _Sight(*(column[:sent] for column in onward))
            if len(sight.look) == 0:
                break
            reach = np.full(len(sight.look), 1e37, np.float32)
        each = seen.reshape(-1, _LOOKS)
        mean[pixels], variance[pixels] = each.mean(axis=1), each.var(axis=1, ddof=1)
        unknown[pixels] = unclear.reshape(-1, _LOOKS).any(axis=1)
        return found

    with ThreadPoolExecutor(threads) as pool:
        found = itertools.chain.from_iterable(pool.map(look, range(0, len(block), _TOGETHER)))
        gathers, rays = (tuple(map(np.concatenate, zip(*part, strict=True))) for part in zip(*found, strict=True))
    sensitivity = _sensitivity(radiometry.reference.sum() + mean, edges)
    cells = _cells(sheets, block, sensitivity, gathers, rays)
    variance *= sensitivity**2
    around = np.pad(variance.reshape(height, width), 1)
    around = sum(around[y : y + height, x : x + width] for y in range(3) for x in range(3)).ravel()
    return Looks(sensitivity, np.maximum(variance, _AROUND * around), unknown, block, cells)


def _straight(eye: Eye, key: np.uint64, pixels: np.ndarray) -> tuple[_Sight, np.ndarray]:
    """The looks of some pixels (n,), and the reach of each: float32, see eye_rays."""
    count = _LOOKS * len(pixels)
    origin, direction, reach = empty_eye_rays(count)
    eye_rays(eye, key, 0, np.full(len(pixels), _LOOKS, np.uint16), pixels, origin, direction, reach)
    way, angle = np.empty((2, count))
    _open(eye, origin, direction, way, angle)
    return _Sight(origin, direction, np.arange(count), np.ones(count), way, angle), reach


@njit(**KERNEL)
def _open(eye, origin, direction, way, angle):
    """The way that camera rays (n,) have come where they start, and the solid angle of the pixels around them."""
    high = (eye.frame[3] - eye.frame[2]) / eye.height
    size = (eye.frame[1] - eye.frame[0]) / eye.width * high
    for i in range(way.size):
        square = length2 = right = back = 0.0
        for axis in range(3):
            d = float(direction[i, axis])
            square += (origin[i, axis] - eye.matrix[axis, 3]) ** 2
            length2 += d * d
            right += d * eye.matrix[axis, 0]
            back += d * eye.matrix[axis, 2]
        way[i], angle[i] = np.sqrt(square), size
        if eye.kind == 0:
            angle[i] /= length2 * np.sqrt(length2)
        elif eye.kind == 2:  # circles of latitude are shorter; next to a pole as in the middle of a pixel
            angle[i] *= max(np.sqrt(right * right + back * back), 0.5 * high)


def _blocks(width: int, height: int, edge: int) -> np.ndarray:
    """(pixels,) int32 number of the block of edge x edge pixels that each lies in."""
    rows, columns = np.arange(height, dtype=np.int32) // edge, np.arange(width, dtype=np.int32) // edge
    return (rows[:, None] * -(-width // edge) + columns).ravel()


def _sensitivity(radiance: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(p,) change of the apparent temperature with the radiance (p,), W m-2 sr-1, with a mean square of 1; ones where
    so little is seen that it has no temperature."""
    mean = float(radiance.mean())
    radiance = np.maximum(radiance, max(_FAINTEST * mean, 0.0))
    warmer, kelvin = (apparent_temperature(factor * radiance, edges) for factor in (1.0 + _STEP, 1.0))
    change = warmer - kelvin
    if not change.all():
        return np.ones_like(change)
    slope = change * (mean / radiance)
    return slope / np.sqrt(np.mean(slope**2))


def _cells(sheets, block, sensitivity, gathers, rays):
    """Gathers (pixel, sheet, carried) and tried rays (pixel, sheet, met, bright, noise, closeness, density, rest) by
    cell. bright: what photons would say of what they met, without its sign."""
    pixel, sheet, carried = gathers
    ray_pixel, ray_sheet, met, bright, noise, closeness, density, rest = rays
    labels = len(sheets.lit)
    key, cell = np.unique(block[pixel].astype(np.int64) * labels + sheet, return_inverse=True)
    ray_cell = np.searchsorted(key, block[ray_pixel].astype(np.int64) * labels + ray_sheet)
    count, tried = np.bincount(cell, minlength=len(key)), np.bincount(ray_cell, minlength=len(key))
    carried2 = np.bincount(cell, (carried * sensitivity[pixel]) ** 2, len(key)) / np.maximum(count, 1)
    cell_sheet = key % labels
    _, spread = _moments(ray_sheet, met, labels)
    _, local = _moments(ray_cell, met, len(key))
    free = np.maximum(tried - 1, 0)
    ray_noise = (local * free + _PRIOR * spread[cell_sheet]) / (free + _PRIOR)

    def mean_of(value):
        """In each cell, drawn to that of all that is seen of the sheet."""
        of_sheet = _moments(ray_sheet, value, labels)[0][cell_sheet]
        return (np.bincount(ray_cell, value, len(key)) + _PRIOR * of_sheet) / (tried + _PRIOR)

    bright, noise, closeness, density, rest = map(mean_of, (bright, noise, closeness, density, rest))
    lit = sheets.lit[cell_sheet]
    brightness = np.where((bright > 0.0) & (lit > 0.0), bright / np.maximum(lit, 1e-300), 1.0)
    rest = rest + sheets.caustic_noise[cell_sheet]
    return Cells(key, brightness, ray_noise + noise, closeness, density, rest, count, carried2)


def _moments(label: np.ndarray, value: np.ndarray, labels: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (labels,) of the values of each label; 0 where there are none, or one."""
    count = np.bincount(label, minlength=labels)
    mean = np.bincount(label, value, labels) / np.maximum(count, 1)
    return mean, np.bincount(label, (value - mean[label]) ** 2, labels) / np.maximum(count - 1, 1)


@njit(**KERNEL)
def _see(surfaces, radiometry, share, surroundings, reflected, hidden, triangle, u, v, direction, seen, emitted):
    """Fill in the excess radiance (n,) of all bands, W m-2 sr-1, that rays see, its reflected part as the sheet's mean,
    without what its specular lobe shows.

    share: see _locate. hidden: (t, 2) bool, whose emission does not count. emitted: (b,) room.
    """
    known, known_kelvin = -1, -1.0  # material and temperature whose excess `emitted` holds
    for i in range(triangle.size):
        t = triangle[i]
        if t < 0:
            seen[i] = surroundings
            continue
        material, kelvin = surfaces.material[t], temperature_at(surfaces.temperature, t, u[i], v[i])
        if material != known or kelvin != known_kelvin:
            excess(radiometry, material, kelvin, 1.0, emitted)
            known, known_kelvin = material, kelvin
        side = facing_side(surfaces, t, direction, i)
        seen[i] = share[material] * reflected[surfaces.sheet[t, side]]
        if not hidden[t, side]:
            seen[i] += emitted.sum()


@njit(**KERNEL)
def _locate(surfaces, share, is_parallel, triangle, u, v, sight, sheet, carried, footprint):
    """Where looks (n,) meet surfaces that reflect diffusely: the label of the sheet, else -1; the share of the pixel
    that one of them carries after it; and how much surface a pixel covers there, m2.

    share: (materials,), mean diffuse reflectance of all bands. is_parallel: whether the camera's rays are.
    """
    for i in range(triangle.size):
        t = triangle[i]
        sheet[i], carried[i], footprint[i] = -1.0, 0.0, 0.0
        if t < 0 or share[surfaces.material[t]] == 0.0:
            continue
        sheet[i] = surfaces.sheet[t, facing_side(surfaces, t, sight.direction, i)]
        carried[i] = sight.share[i] * share[surfaces.material[t]] / _LOOKS
        way = 1.0 if is_parallel else _way(surfaces, sight, i, t, u[i], v[i])
        footprint[i] = max(sight.angle[i] * way * way / max(_cosine(surfaces, sight, i, t), 1e-3), 1e-30)


@njit(inline="always")
def _way(surfaces, sight, i, t, u, v):
    """m from the camera to where look i meets triangle t."""
    return sight.way[i] + 1.0 / inverse_distance(surfaces, t, u, v, sight.origin[i])


@njit(inline="always")
def _cosine(surfaces, sight, i, t):
    """Of the angle at which look i meets triangle t."""
    nx, ny, nz = unit_normal(surfaces, t)
    dx, dy, dz = float(sight.direction[i, 0]), float(sight.direction[i, 1]), float(sight.direction[i, 2])
    return abs(nx * dx + ny * dy + nz * dz) / np.sqrt(dx * dx + dy * dy + dz * dz)


@njit(**KERNEL)
def _follow(surfaces, radiometry, reflectance, key, first, bounce, triangle, u, v, sight, unclear, onward):
    """Send looks on that meet a specular surface, in one direction of its lobe; returns how many.

    reflectance: (materials,), mean of all bands. unclear: (looks,) bool, set for those that end there and for those
    that met a rough lobe, which differs from ray to ray.
    """
    sent = 0
    for i in range(triangle.size):
        t = triangle[i]
        if t < 0 or radiometry.specular[surfaces.material[t]] == 0.0:
            continue
        material, path = surfaces.material[t], path_key(key, first + sight.look[i])
        nx, ny, nz = unit_normal(surfaces, t, facing_side(surfaces, t, sight.direction, i))
        dx, dy, dz = float(sight.direction[i, 0]), float(sight.direction[i, 1]), float(sight.direction[i, 2])
        inverse, weight, alpha = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz), 1.0, float(radiometry.alpha[material])
        dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
        cosine = max(1e-6, -(nx * dx + ny * dy + nz * dz))
        if alpha == 0.0:
            dx, dy, dz = mirror(dx, dy, dz, nx, ny, nz, cosine)
        else:
            s, w = uniform(path, _DIMENSION + 4 * bounce + 2), uniform(path, _DIMENSION + 4 * bounce + 3)
            dx, dy, dz, weight = reflect_in_lobe(dx, dy, dz, nx, ny, nz, cosine, alpha, s, w)
        share = sight.share[i] * radiometry.specular[material] * reflectance[material] * weight
        ends = share < _FAINT or bounce == _BOUNCES
        unclear[sight.look[i]] |= ends or alpha > 0.0
        if ends:
            continue
        x, y, z = point(surfaces.corners, t, u[i], v[i])
        put_ray(surfaces, t, x, y, z, nx, ny, nz, dx, dy, dz, onward.origin, onward.direction, sent)
        onward.look[sent], onward.share[sent], onward.angle[sent] = sight.look[i], share, sight.angle[i]
        onward.way[sent] = _way(surfaces, sight, i, t, u[i], v[i])
        sent += 1
    return sent


@njit(**KERNEL)
def _start_gathers(surfaces, key, first, bounce, tried, triangle, u, v, sight, origin, onward):
    """Start a ray of a final gather from each of the tried looks."""
    for row in range(tried.size):
        i = tried[row]
        path, t, dimension = path_key(key, first + sight.look[i]), triangle[i], _DIMENSION + 4 * bounce
        x, y, z = cosine_direction(uniform(path, dimension), uniform(path, dimension + 1))
        code = 2 * t + facing_side(surfaces, t, sight.direction, i)
        start_ray(surfaces, code, u[i], v[i], x, y, z, origin, onward, row)


@njit(**KERNEL)
def _measure(surfaces, sheets, share, triangle, u, v, origin, direction, closeness, noise, rest):
    """Of rays, where they meet a surface: 1 / m to it; and the variance, W2 sr-2 m-4, of what they would recall there,
    for each, and for the mean of all from a place.

    Each photon around reaches that place once, by the share of its view that a m2 around the photon takes; but no less
    blurred than over the disk of the cache.
    """
    for i in range(triangle.size):
        t = triangle[i]
        if t < 0:
            continue
        closeness[i] = inverse_distance(surfaces, t, u[i], v[i], origin[i])
        side = facing_side(surfaces, t, direction, i)
        nx, ny, nz = unit_normal(surfaces, t, side)
        cosine = -(nx * direction[i, 0] + ny * direction[i, 1] + nz * direction[i, 2])
        sheet, diffuse = surfaces.sheet[t, side], share[surfaces.material[t]]
        disk = sheets.disk[sheet]
        if disk > 0.0:
            photons = diffuse * diffuse * sheets.photon_noise[sheet]
            noise[i] = photons / disk
            rest[i] = photons * min(cosine * closeness[i] * closeness[i] / np.pi, 1.0 / disk)


@njit(**KERNEL)
def _group(look, sheet, carried):
    """Looks of one pixel at one sheet gather together: the first carries what all do, the others nothing."""
    for i in range(look.size):
        if sheet[i] < 0.0:
            continue
        j = i + 1
        while j < look.size and look[j] // _LOOKS == look[i] // _LOOKS:
            if sheet[j] == sheet[i]:
                carried[i] += carried[j]
                carried[j] = 0.0
            j += 1
