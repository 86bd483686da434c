# SPDX-License-Identifier: GPL-3.0-or-later
"""Which surfaces are lamps, to which shadow rays are sent: small hot parts, which photons would show with the noise of
their number.

A wall that spans half the sky is the photon map's business. A source that is small against its distance is not: one
shadow ray says nearly all about it, while k photons still err by 1 / sqrt(k). Its photons are then kept only from
their second surface on (Jensen 2001, section 7.4; docs/estimators.md).
"""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.interaction import emit_at, leave
from ..geometry.point_tree import morton_order
from ..geometry.segments import Tracer, empty_ray_batch
from ..geometry.surfaces import Surfaces, clear_of
from ..geometry.triangles import CLEAR, centroids
from ..photons.emission import Emitters
from ..photons.lights import LightTable, light_totals
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import difference, dot, moved, vector
from ..sampling.warps import triangle_point
from ..system.kernels import KERNEL, njit
from .pilot import Pilot

_MOST = 64  # surfaces that may become lamps: those of most power
_RECEIVERS = 512  # points at which they are judged
_COMPACT = 0.3  # radius over distance, in the mean over what it lights, up to which a surface is a lamp
_LEAST_SHARE = 0.03  # share of the light in the picture above which a surface is a lamp
_LEAST_OF_ALL = 0.3  # share of all lamps below which shadow rays do not pay
_AIMED, _AIMED_FROM = 8, 256  # points on a lamp to which rays are tried, and of how many receivers
_UNSURE = 0.05  # see _unsureness: what is hidden in part more often is shown better by photons and rays


class Lamps(NamedTuple):
    """What shadow rays are sent to, as entries of one discrete distribution, lights last.

    cumulative: (e + 1,) float64, from 0 to 1. side_id: (n,) int32 of entries 0..n-1. lights: see LightTable. power: W,
    of all entries. shines: (t, 2) bool, sides of triangles that shadow rays are sent to.
    """

    cumulative: np.ndarray
    side_id: np.ndarray
    lights: LightTable
    power: float
    shines: np.ndarray


class _Receivers(NamedTuple):
    """Points (r, 3), normals (r, 3), float64, and side_ids (r,) int32 at which lamps are judged."""

    point: np.ndarray
    normal: np.ndarray
    side_id: np.ndarray

    def thinned(self, most: int) -> "_Receivers":
        """About so many of them."""
        some = slice(None, None, max(1, len(self.point) // most))
        return _Receivers(*(column[some] for column in self))


def choose_lamps(
    surfaces: Surfaces, tracer: Tracer, side_power: np.ndarray, pilot: Pilot, lit: float, key: np.uint64
) -> np.ndarray:
    """Sheets of surface that are lamps: small against their distance, a good part of the light in the picture, and
    hidden or not, but seldom in part.

    side_power: (t,) float64 |excess| power of one side of each triangle, W. pilot: says which sides can light the image
    (the inside of a closed lamp cannot), and where camera paths gather. lit: W m-2, mean irradiance there from all
    surfaces, as far as known. key: of the random numbers.
    Returns (m, 2) bool, which sides of triangles belong to a lamp.
    """
    sheet = surfaces.sheet
    power = np.bincount(sheet.ravel(), (side_power[:, None] * pilot.reachable).ravel())
    chosen = np.zeros(power.size, np.bool_)
    labels = np.argsort(-power, kind="stable")[:_MOST]
    labels = labels[power[labels] > 0]
    if len(pilot.point) == 0 or len(labels) == 0:
        return chosen[sheet]
    receivers = _Receivers(pilot.point, pilot.normal, pilot.side_id).thinned(_RECEIVERS)
    irradiance, nearness = _judge(surfaces, labels, power, receivers)
    compact = (irradiance > 0) & (nearness < _COMPACT)
    lit = max(lit, irradiance[compact].sum())
    compact &= irradiance > _LEAST_SHARE * lit
    receivers = receivers.thinned(_AIMED_FROM)
    for lamp in np.flatnonzero(compact):
        compact[lamp] = _unsureness(surfaces, tracer, side_power, labels[lamp], receivers, key) < _UNSURE
    if irradiance[compact].sum() > _LEAST_OF_ALL * lit:
        chosen[labels[compact]] = True
    return chosen[sheet]


def _judge(surfaces, labels, power, receivers) -> tuple[np.ndarray, np.ndarray]:
    """Of the sheets with these labels (n,): mean irradiance (n,) at the receivers were nothing between, W m-2, and
    their radius over distance (n,), weighted with that. power: (sheets,) W."""
    row = np.full(power.size, -1, np.int32)
    row[labels] = np.arange(labels.size)
    centre, radius = _spheres(surfaces.corners, surfaces.sheet, row, labels.size)
    towards = centre[:, None] - receivers.point
    distance = np.maximum(np.linalg.norm(towards, axis=2), radius[:, None])
    cosine = np.maximum(np.sum(towards * receivers.normal, axis=2), 0.0) / distance
    received = power[labels, None] * cosine / (4.0 * math.pi * distance**2)
    nearness = np.sum(received * radius[:, None] / distance, axis=1) / np.maximum(received.sum(axis=1), 1e-300)
    return received.mean(axis=1), nearness


def _unsureness(surfaces, tracer, side_power, label, receivers, key) -> float:
    """Variance that shadow rays to one sheet have as other things hide a part of it, over the mean square of what they
    bring to the receivers.

    A shadow ray goes to a point in proportion to what it would cause (see send_shadow). With G the mean of that, and E
    that of the points from which the way is free, it brings G with the chance E / G: a variance of E (G - E).
    """
    sides = np.flatnonzero(surfaces.sheet.ravel() == label)
    cumulative = np.cumsum(side_power[sides >> 1])
    rays = empty_ray_batch(_AIMED * len(receivers.point))
    caused = np.empty(len(rays.origin))
    _aim(surfaces, sides, cumulative / cumulative[-1], receivers, key, rays, caused)
    free = tracer.visible(*rays, np.ones(len(caused), np.float32)).reshape(-1, _AIMED)
    caused = caused.reshape(-1, _AIMED)
    unhidden, seen = caused.mean(axis=1), (caused * free).mean(axis=1)
    total = float(np.sum(seen**2))
    return float(np.sum(seen * (unhidden - seen))) / total if total > 0.0 else math.inf


@njit(**KERNEL)
def _aim(surfaces, sides, cumulative, receivers, key, rays, caused):
    """Rays from each receiver to _AIMED points on a sheet, and the irradiance, m-2, for 1 W of its power, that they
    would cause. sides: (n,) side_ids of the sheet. cumulative: (n,) float64, of their power, up to 1."""
    for i in range(caused.size):
        path, receiver = path_key(key, i), i // _AIMED
        chosen = sides[min(np.searchsorted(cumulative, uniform(path, 0)), sides.size - 1)]
        u, v = triangle_point(uniform(path, 1), uniform(path, 2))
        lamp = emit_at(surfaces, chosen, u, v, 1.0)
        point, side_id, n = vector(receivers.point, receiver), receivers.side_id[receiver], receivers.normal[receiver]
        way = difference(clear_of(surfaces, chosen, lamp.point), clear_of(surfaces, side_id, point))
        cos_hit, cos_lamp = dot(way, n), -dot(way, lamp.normal)  # times the distance
        d2 = dot(way, way)
        caused[i] = max(0.0, cos_hit) * max(0.0, cos_lamp) / (math.pi * d2 * d2)
        # further, or the lamp's own surface hides it, see send_shadow
        leave(surfaces, side_id, point, moved(way, CLEAR * math.sqrt(d2), lamp.normal), rays, i)


@njit(cache=True, nogil=True)
def _spheres(corners, sheet, row, count):
    """Centre (n, 3) and radius (n,) of spheres that hold sheets. row: (labels,) int32, the sphere of a label or -1."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    for axis in range(3):
                        low[n, axis] = min(low[n, axis], corners[t, i, axis])
                        high[n, axis] = max(high[n, axis], corners[t, i, axis])
    centre, square = 0.5 * (low + high), np.zeros(count)
    for t in range(sheet.shape[0]):
        for side in range(2):
            n = row[sheet[t, side]]
            if n >= 0:
                for i in range(3):
                    distance2 = 0.0
                    for axis in range(3):
                        distance2 += (corners[t, i, axis] - centre[n, axis]) ** 2
                    square[n] = max(square[n], distance2)
    return centre, np.sqrt(square)


def build_lamps(emitters: Emitters, surfaces: Surfaces, side_power: np.ndarray, shines: np.ndarray) -> Lamps:
    """The emitters that shadow rays are sent to: those marked as lamps, and all lights. shines: see Lamps."""
    side_id = emitters.surface[emitters.lamp]
    # in the order of a curve through space: points at equal steps along it lie all around a lamp
    side_id = side_id[morton_order(centroids(surfaces.corners[side_id >> 1]))]
    power = np.concatenate((side_power[side_id >> 1], light_totals(emitters.lights)))
    cumulative = np.concatenate(([0.0], np.cumsum(power)))
    total = float(cumulative[-1])
    if total > 0:
        cumulative /= total
    return Lamps(cumulative, side_id, emitters.lights, total, shines)
