# SPDX-License-Identifier: GPL-3.0-or-later
"""What a trial pass and the pilot tell of every sheet beforehand: how many photons come, and how noisy what they say
is, and what rays from there meet."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.point_tree import empty_walk
from ..geometry.surfaces import (
    NO_WALL,
    PATCH_LIMIT,
    Surfaces,
    Tracer,
    patch_in_ball,
    put_ray,
    region_area,
    sheet_count,
    temperature_at,
)
from ..physics.radiometry import Radiometry, excess
from ..sampling.low_discrepancy import lattice_point
from ..sampling.rng import path_key, uniform
from ..sampling.warps import cosine_direction, to_world
from ..system.kernels import KERNEL, njit
from .pilot import Pilot

FALL = 1.25  # exponent at which rays' variance falls with their number: 1.5 at straight edges, 1 for small parts
_PRIOR = 4.0  # samples that the mean of all sheets is worth on each
_PLACES = 1024  # at which the extent of sheets is measured
_LATTICES, _OF_RAYS = 1024, 16  # that say how much less noisy rays of a lattice are than random ones


class Sheets(NamedTuple):
    """What a trial pass and the pilot tell of the noise of gathers, by label of the sheet, (labels,) float64 each.

    density: m-2, photons of a pass expected. photon_noise: W2 sr-2 m-2, variance of the radiance (of all bands) that a
    perfect reflector reflects, times the area that the photons are gathered from. ray_noise: W2 sr-2 m-4, variance of
    the radiance that a ray from there meets. span: m2, area of the sheet within the largest disk. disk: m2, that of a
    gather in the open. reflected: W sr-1 m-2, mean radiance that a perfect reflector reflects, and lit, the same of the
    photons' powers without their signs. caustic_noise: W2 sr-2 m-4, variance that caustics leave whatever is chosen.
    evenness: of the whole scene: the variance of n rays of a lattice is that of one times evenness n^-FALL.
    """

    density: np.ndarray
    photon_noise: np.ndarray
    ray_noise: np.ndarray
    span: np.ndarray
    disk: np.ndarray
    reflected: np.ndarray
    lit: np.ndarray
    caustic_noise: np.ndarray
    evenness: float


class Trial(NamedTuple):
    """What a trial pass of so many photons stored, n hits: place (n, 3) float32, m; code (n,) int32, 2 triangle +
    side; power (n,) float64, W over all bands; caustic (n,) bool, see Photons."""

    photons: int
    place: np.ndarray
    code: np.ndarray
    power: np.ndarray
    caustic: np.ndarray


def measure_sheets(
    surfaces: Surfaces,
    tracer: Tracer,
    radiometry: Radiometry,
    surroundings: np.ndarray,
    shines: np.ndarray,
    pilot: Pilot,
    trial: Trial,
    area: np.ndarray,
    reach2: float,
    neighbours: int,
    photons: int,
    key: np.uint64,
) -> Sheets:
    """What the trial pass and the pilot's paths tell of each sheet.

    surroundings: (b,) float64, their excess radiance. shines: (t, 2) bool, lamps, which rays leave to shadow rays.
    area: (t,) m2. reach2, neighbours: see Estimate. photons: of a pass. key: of random numbers.
    """
    sheet, labels = surfaces.sheet, sheet_count(surfaces)
    size = np.maximum(np.bincount(sheet.ravel(), np.repeat(area, 2), labels), 1e-30)
    hit = sheet[trial.code >> 1, trial.code & 1]
    squares = trial.power**2 * (trial.photons / photons) / math.pi**2
    # where few photons or none came, as on small parts, sheets are taken to be like all others that matter
    near = pilot.matters[trial.code >> 1, trial.code & 1]
    other = _PRIOR * float((area[:, None] * pilot.matters).sum()) / max(1, near.sum())  # m2, that so many hits take
    mean_square = float((squares * near * ~trial.caustic).sum()) / max(1, near.sum())
    density = (np.bincount(hit, minlength=labels) + _PRIOR) / (size + other) * (photons / trial.photons)
    photon_noise = (np.bincount(hit, squares * ~trial.caustic, labels) + _PRIOR * mean_square) / (size + other)
    reflected = np.bincount(hit, trial.power, labels) / size / math.pi
    strength = np.abs(trial.power)
    mean_strength = float((strength * near).sum()) / max(1, near.sum())
    lit = (np.bincount(hit, strength, labels) + _PRIOR * mean_strength) / (size + other) / math.pi
    radiance = np.append(_radiance(surfaces, radiometry), surroundings.sum())
    radiance[:-1][shines.any(axis=1)] = 0.0
    met = radiance[pilot.met]
    mean = _means(pilot.left, met, labels, met.mean() if met.size else 0.0)
    ray_noise = _means(pilot.left, (met - mean[pilot.left]) ** 2, labels, met.var() if met.size else 0.0)
    places = sheet[pilot.code >> 1, pilot.code & 1]
    some = slice(None, None, max(1, len(places) // _PLACES))
    spans = _spans(surfaces, pilot.code[some], pilot.place[some], reach2)
    span = _means(places[some], spans, labels, math.pi * reach2, 1e-9)
    disk = np.minimum(span, neighbours / np.maximum(density, 1e-30))
    caustic, caustic_noise = trial.caustic, np.zeros(len(spans))
    k = neighbours * trial.photons / photons  # as dense as photons of the trial are
    _fill_caustics(
        places[some], pilot.place[some], hit[caustic], trial.place[caustic], squares[caustic], reach2, k, caustic_noise
    )
    caustic_noise = _means(places[some], caustic_noise, labels, 0.0, 1e-9)
    evenness = _evenness(surfaces, tracer, pilot, radiance, key)
    return Sheets(density, photon_noise, ray_noise, span, disk, reflected, lit, caustic_noise, evenness)


def dark_sheets(labels: int) -> Sheets:
    """Of a scene without photons."""
    return Sheets(*np.zeros((8, labels)), 1.0)


def _evenness(surfaces, tracer, pilot, radiance, key):
    """Variance of lattices of n rays at some of the pilot's places, over that of as many random rays, times n^(FALL -
    1). radiance: (t + 1,) of what rays meet, last the surroundings. key: of the random numbers."""
    some = np.arange(0, len(pilot.place), max(1, 2 * len(pilot.place) // _LATTICES))
    origin, direction = np.empty((2, 2 * _OF_RAYS * len(some), 3), np.float32)
    _start_lattices(surfaces, pilot.place, pilot.facing, pilot.code, some, key, origin, direction)
    met = radiance[tracer.trace(origin, direction)[0]].reshape(len(some), 2, _OF_RAYS)
    pairs = float(np.mean(np.diff(met.mean(axis=2), axis=1) ** 2)) / 2.0 if len(some) else 0.0
    alone = float(np.mean(met.reshape(len(some), -1).var(axis=1))) / _OF_RAYS if len(some) else 0.0
    return _OF_RAYS ** (FALL - 1.0) * (min(pairs / alone, 1.0) if alone > 0.0 else 1.0)


@njit(**KERNEL)
def _start_lattices(surfaces, place, facing, code, some, key, origin, direction):
    row = 0
    for n in range(some.size):
        i = some[n]
        x, y, z = place[i]
        nx, ny, nz = facing[i]
        for lattice in range(2):
            path = path_key(key, 2 * n + lattice)
            for ray in range(_OF_RAYS):
                u, v = lattice_point(ray, _OF_RAYS, uniform(path, 0), uniform(path, 1))
                lx, ly, lz = cosine_direction(u, v)
                dx, dy, dz = to_world(lx, ly, lz, nx, ny, nz)
                put_ray(surfaces, code[i] >> 1, x, y, z, nx, ny, nz, dx, dy, dz, origin, direction, row)
                row += 1


def _means(label: np.ndarray, value: np.ndarray, labels: int, prior: float, worth: float = _PRIOR) -> np.ndarray:
    """Mean value (labels,) of each label; where there are few it is drawn to the prior, which is worth some samples."""
    return (np.bincount(label, value, labels) + worth * prior) / (np.bincount(label, minlength=labels) + worth)


def _radiance(surfaces, radiometry):
    """(t,) float64 excess radiance of all bands, W m-2 sr-1, that triangles emit at their centroids."""
    radiance = np.empty(surfaces.material.size)
    _fill_radiance(surfaces, radiometry, radiance, np.empty(radiometry.reference.size))
    return radiance


@njit(**KERNEL)
def _fill_radiance(surfaces, radiometry, radiance, value):
    for t in range(radiance.size):
        kelvin = temperature_at(surfaces.temperature, t, 1.0 / 3.0, 1.0 / 3.0)
        excess(radiometry, surfaces.material[t], kelvin, 2.0 / 3.0, value)
        radiance[t] = value.sum()


@njit(**KERNEL)
def _fill_caustics(label, place, hit, hit_place, square, reach2, k, noise):
    """Variance at places (n, 3) on sheets (n,) of what caustics' photons say, of trial hits (h, 3) on sheets (h,) with
    these squares (h,); k of them are gathered at most."""
    for i in range(label.size):
        found, total = 0, 0.0
        for j in range(hit.size):
            if hit[j] == label[i]:
                distance2 = 0.0
                for axis in range(3):
                    distance2 += (place[i, axis] - hit_place[j, axis]) ** 2
                if distance2 < reach2:
                    found += 1
                    total += square[j]
        area = math.pi * reach2
        noise[i] = total / area / (area * min(1.0, k / max(found, 1)))


def _spans(surfaces, code, place, reach2):
    """(n,) float64 areas, m2, of the sheets around places (n, 3) within the largest disk."""
    spans = np.empty(code.size)
    _fill_spans(surfaces, code, place, reach2, spans, np.empty(PATCH_LIMIT, np.int32), empty_walk())
    return spans


@njit(**KERNEL)
def _fill_spans(surfaces, code, place, reach2, spans, patch, walk):
    for i in range(code.size):
        t, side = code[i] >> 1, code[i] & 1
        x, y, z = place[i]
        members, area = patch_in_ball(surfaces.corners, surfaces.neighbours, t, side, x, y, z, reach2, NO_WALL, patch)
        if members == 0:
            area = region_area(surfaces, t, side, x, y, z, reach2, NO_WALL, walk)
        spans[i] = area
