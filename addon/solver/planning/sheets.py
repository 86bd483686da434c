# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets: what a trial pass and the pilot tell of every sheet beforehand. How many photons arrive, how noisy their
estimate is, and what rays from the sheet meet."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.area import NO_WALL, PATCH_LIMIT, Ball, patch_in_ball, region_area
from ..geometry.interaction import emit_at, leave
from ..geometry.point_tree import empty_walk
from ..geometry.segments import FROM_DIFFUSE, Tracer, empty_ray_batch
from ..geometry.stage import Stage, emission_at, nothing_emitted
from ..geometry.surfaces import Surfaces, sheet_count
from ..photons.emission import Surroundings
from ..photons.photon_map import few_neighbours
from ..sampling.low_discrepancy import lattice_point
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import vector
from ..sampling.warps import cosine_direction, to_world
from ..system.kernels import KERNEL, njit, thinned
from .lamps import Lamps
from .pilot import Pilot

_PRIOR = 4.0  # samples that the mean of all sheets counts as on each sheet
_POINTS = 1024  # at which the extent of sheets is measured
# Rays of lattices that are compared with random rays, and numbers of these lattices
_FEW_RAYS, _LATTICES_OF_FEW = 16, 1024
_MANY_RAYS, _LATTICES_OF_MANY = 128, 256
_STEEPEST = 2.0  # fall of smooth light, see Sheets; 1.5 at straight edges, 1 for small parts and random rays
_CENTROID = 1.0 / 3.0  # barycentric coordinates
_TYPICAL_COSINE = 2.0 / 3.0  # mean of cosine-distributed directions


class Sheets(NamedTuple):
    """Expected noise of gathers, by label of the sheet, (labels,) float64 each. Radiance is the sum over all bands.

    density: m-2, expected photons of a pass. photon_noise: W2 sr-2 m-2, variance of the radiance that a perfect
    reflector reflects, estimated from photons, times the area of the disk. ray_noise: W2 sr-2 m-4, variance of the
    radiance that single rays from the sheet meet. met: W m-2 sr-1, mean of that radiance. span: m2, area of the sheet
    within the largest disk. disk: m2, area of the disk of a gather without walls around. reflected: W sr-1 m-2, mean
    radiance that a perfect reflector reflects; lit: the same from the absolute values of the photons' powers.
    caustic_noise: W2 sr-2 m-4, variance from the photons of caustics, which is there with photons and with rays.
    evenness, fall: numbers for the whole scene: n rays of a lattice have the variance of one times evenness n^-fall.
    """

    density: np.ndarray
    photon_noise: np.ndarray
    ray_noise: np.ndarray
    met: np.ndarray
    span: np.ndarray
    disk: np.ndarray
    reflected: np.ndarray
    lit: np.ndarray
    caustic_noise: np.ndarray
    evenness: float
    fall: float


class Trial(NamedTuple):
    """The n hits that a trial pass stored. photons: emitted in the pass. point: (n, 3) float32, m. side_id: (n,) int32.
    power: (n,) float64, W over all bands. caustic: (n,) bool, see Photons."""

    photons: int
    point: np.ndarray
    side_id: np.ndarray
    power: np.ndarray
    caustic: np.ndarray


class Excess(NamedTuple):
    """What rays of final gathers meet: the surroundings, and lamps, whose light is left to shadow rays in part."""

    surroundings: Surroundings
    lamps: Lamps


class Gathering(NamedTuple):
    """How photons are gathered. reach2: m2, squared radius of the largest disk. neighbours: k, see Estimate. photons:
    of a pass."""

    reach2: float
    neighbours: int
    photons: int


class _Points(NamedTuple):
    """Points on surfaces: point, normal (n, 3) float64, side_id (n,) int32."""

    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray


def measure_sheets(
    stage: Stage,
    tracer: Tracer,
    excess: Excess,
    pilot: Pilot,
    trial: Trial,
    gathering: Gathering,
    key: np.uint64,
) -> Sheets:
    """The Sheets, as the trial pass and the pilot's paths tell of them. key: of random numbers."""
    surfaces, labels = stage.surfaces, sheet_count(stage.surfaces)
    reach2, neighbours, photons = gathering
    squares = trial.power**2 * (trial.photons / photons) / math.pi**2
    density, photon_noise, reflected, lit = _measure_photons(surfaces, pilot, trial, squares, photons)
    met = _met(stage, excess, pilot.met)
    mean = drawn_means(pilot.left, met, labels, met.mean() if met.size else 0.0)
    ray_noise = drawn_means(pilot.left, (met - mean[pilot.left]) ** 2, labels, met.var() if met.size else 0.0)
    some = _some_points(pilot, max(1, len(pilot.point) // _POINTS))
    sheet = _sheets_of(surfaces, some.side_id)
    span = drawn_means(sheet, _spans(surfaces, some, reach2), labels, math.pi * reach2, 1e-9)
    few = few_neighbours(neighbours)
    caustic = _caustic_noise(surfaces, some, trial, squares, reach2 * few / neighbours, few * trial.photons / photons)
    evenness, fall = _evenness(stage, tracer, pilot, excess, key)
    return Sheets(
        density=density,
        photon_noise=photon_noise,
        ray_noise=ray_noise,
        met=mean,
        span=span,
        disk=np.minimum(span, neighbours / np.maximum(density, 1e-30)),
        reflected=reflected,
        lit=lit,
        caustic_noise=drawn_means(sheet, caustic, labels, 0.0, 1e-9),
        evenness=evenness,
        fall=fall,
    )


def _measure_photons(surfaces, pilot, trial, squares, photons):
    """density, photon_noise, reflected and lit of Sheets. squares: (n,) float64, what each hit adds to the variance of
    the radiance from photons of a pass, times the area from which they are gathered."""
    labels, size = sheet_count(surfaces), np.maximum(pilot.extent, 1e-30)
    hit, strength = _sheets_of(surfaces, trial.side_id), np.abs(trial.power)
    # where few photons or none arrived, as on small parts, a sheet is taken to be like all other reachable sheets
    near = pilot.reachable[hit]
    other = _PRIOR * float(pilot.extent[pilot.reachable].sum()) / max(1, near.sum())  # m2, area of _PRIOR hits
    mean_square = float((squares * near * ~trial.caustic).sum()) / max(1, near.sum())
    mean_strength = float((strength * near).sum()) / max(1, near.sum())
    return (
        (np.bincount(hit, minlength=labels) + _PRIOR) / (size + other) * (photons / trial.photons),
        (np.bincount(hit, squares * ~trial.caustic, labels) + _PRIOR * mean_square) / (size + other),
        np.bincount(hit, trial.power, labels) / size / math.pi,
        (np.bincount(hit, strength, labels) + _PRIOR * mean_strength) / (size + other) / math.pi,
    )


def _sheets_of(surfaces: Surfaces, side_id: np.ndarray) -> np.ndarray:
    """(n,) int32 labels of the sheets that sides (n,) belong to."""
    return surfaces.sheet[side_id >> 1, side_id & 1]


def _some_points(pilot: Pilot, step: int) -> _Points:
    """Every step-th point where the pilot's paths gather."""
    return _Points(*thinned((pilot.point, pilot.normal, pilot.side_id), step))


def dark_sheets(labels: int) -> Sheets:
    """The Sheets of a scene without photons: zeros."""
    return Sheets(*np.zeros((9, labels)), 1.0, 1.0)


def _evenness(stage, tracer, pilot, excess, key):
    """evenness and fall of Sheets, from lattices of few and of many rays. key: of the random numbers."""
    few = _noise_of_lattices(stage, tracer, pilot, excess, (key, _FEW_RAYS, _LATTICES_OF_FEW))
    many = _noise_of_lattices(stage, tracer, pilot, excess, (key, _MANY_RAYS, _LATTICES_OF_MANY))
    fall = 1.0 + math.log(few / many) / math.log(_MANY_RAYS / _FEW_RAYS)
    fall = min(max(fall, 1.0), _STEEPEST)
    return few * _FEW_RAYS ** (fall - 1.0), fall


def _noise_of_lattices(stage, tracer, pilot, excess, lattices):
    """Variance of the mean over a lattice of rays, at some of the pilot's points, over that with as many random rays; 1
    if lattices seem to be no better. lattices: key of the random numbers, rays of each, and number of lattices."""
    key, each, number = lattices
    some = _some_points(pilot, max(1, 2 * len(pilot.point) // number))
    count = len(some.point)
    if count == 0:
        return 1.0
    rays = empty_ray_batch(2 * each * count)
    _start_lattices(stage.surfaces, some, key, np.int64(each), rays)
    met = _met(stage, excess, tracer.seen_from(FROM_DIFFUSE).trace(*rays).triangle).reshape(count, 2, each)
    pairs = float(np.mean(np.diff(met.mean(axis=2), axis=1) ** 2)) / 2.0
    alone = float(np.mean(met.reshape(count, -1).var(axis=1))) / each
    return max(min(pairs / alone, 1.0), 1e-30) if alone > 0.0 else 1.0


@njit(**KERNEL)
def _start_lattices(surfaces, points, key, each, rays):
    """Start two lattices of so many rays each from each of the points, each lattice shifted at random."""
    row = 0
    for i in range(points.side_id.size):
        start, n = vector(points.point, i), vector(points.normal, i)
        for lattice in range(2):
            path = path_key(key, 2 * i + lattice)
            for ray in range(each):
                u, v = lattice_point(ray, each, uniform(path, 0), uniform(path, 1))
                leave(surfaces, points.side_id[i], start, to_world(cosine_direction(u, v), n), rays, row)
                row += 1


def drawn_means(label: np.ndarray, value: np.ndarray, labels: int, prior, worth: float = _PRIOR) -> np.ndarray:
    """Mean value (labels,) of each label, drawn to the prior, a number or (labels,), which counts as `worth`
    samples."""
    return (np.bincount(label, value, labels) + worth * prior) / (np.bincount(label, minlength=labels) + worth)


def _met(stage, excess, triangle):
    """(n,) float64 excess radiance of all bands, W m-2 sr-1, of what rays meet, as far as it is left to rays: of
    triangles (n,) at their centroids, or of the surroundings, -1."""
    found, sheet = excess.lamps.found, stage.surfaces.sheet[triangle]
    left = np.minimum(found[sheet[:, 0]], found[sheet[:, 1]])  # the ray's side is not known; mostly but one is a lamp
    radiance = triangle_radiance(stage, triangle) * left
    return np.where(triangle < 0, excess.surroundings.radiance.sum(), radiance)


def triangle_radiance(stage, triangle):
    """(n,) float64 excess radiance of all bands, W m-2 sr-1, that triangles (n,) emit at their centroids; 0 for -1."""
    radiance = np.zeros(len(triangle))
    _fill_radiance(stage, triangle, radiance, nothing_emitted(stage.radiometry.reference.size, np.float64))
    return radiance


@njit(**KERNEL)
def _fill_radiance(stage, triangle, radiance, emitted):
    for i in range(radiance.size):
        if triangle[i] >= 0:
            at = emit_at(stage.surfaces, 2 * triangle[i], _CENTROID, _CENTROID, _TYPICAL_COSINE)
            radiance[i] = emission_at(stage, at, emitted).sum()


def _caustic_noise(surfaces, points, trial, squares, reach2, k):
    """(n,) float64 variance, at points, of the radiance from photons of caustics. squares: (h,) of the trial's hits,
    see _measure_photons. k: hits, in the density of the trial, on which an estimate rests at most."""
    noise, hits = np.zeros(len(points.point)), trial.caustic
    where, hit = _sheets_of(surfaces, points.side_id), _sheets_of(surfaces, trial.side_id)[hits]
    _fill_caustics(where, points.point, hit, trial.point[hits], squares[hits], reach2, k, noise)
    return noise


@njit(**KERNEL)
def _fill_caustics(sheet, point, hit_sheet, hit_point, square, reach2, k, noise):
    """Fill noise (n,) for points (n, 3) on sheets (n,), from hits (h, 3) on sheets (h,) with these squares (h,). See
    _caustic_noise."""
    for i in range(sheet.size):
        found, total = 0, 0.0
        for j in range(hit_sheet.size):
            if hit_sheet[j] == sheet[i]:
                distance2 = 0.0
                for axis in range(3):
                    distance2 += (point[i, axis] - hit_point[j, axis]) ** 2
                if distance2 < reach2:
                    found += 1
                    total += square[j]
        area = math.pi * reach2
        noise[i] = total / area / (area * min(1.0, k / max(found, 1)))


def _spans(surfaces, points, reach2):
    """(n,) float64 areas, m2, of the sheets around points within the largest disk."""
    spans = np.empty(len(points.point))
    _fill_spans(surfaces, points, reach2, spans, np.empty(PATCH_LIMIT, np.int32), empty_walk())
    return spans


@njit(**KERNEL)
def _fill_spans(surfaces, points, reach2, spans, patch, walk):
    for i in range(spans.size):
        ball = Ball(vector(points.point, i), reach2, NO_WALL)
        members, area = patch_in_ball(surfaces, points.side_id[i], ball, patch)
        if members == 0:
            area = region_area(surfaces, points.side_id[i], ball, walk)
        spans[i] = area
