# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lamps throw caustics: small hot surfaces whose light, after specular surfaces alone, photons find.

A ray that a mirror reflects seldom meets a source that is small against its distance, while its photons find the
mirror. The light of a wall that spans half the view is found by rays.
"""

import math

import numpy as np

from ..geometry.interaction import emit_at, leave
from ..geometry.segments import Tracer, empty_ray_batch
from ..geometry.surfaces import Surfaces, clear_of
from ..geometry.triangles import CLEAR
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import difference, dot, moved, vector
from ..sampling.warps import triangle_point
from ..system.kernels import KERNEL, njit
from .lamps import Receivers, spheres
from .pilot import Pilot

_MOST = 64  # candidates: the sheets with most power
_RECEIVERS = 512  # points at which candidates are judged
_COMPACT = 0.3  # largest ratio of radius to distance of a lamp, in the mean over the points that it lights
_LEAST_SHARE = 0.03  # share of the light in the image that a lamp contributes at least
_LEAST_OF_ALL = 0.3  # share that all lamps contribute at least; below it shadow rays do not pay
_AIMED, _AIMED_FROM = 8, 256  # trial shadow rays to each candidate: how many from a receiver, and how many receivers
_UNSURE = 0.05  # largest _unsureness of a lamp: sources that are often hidden in part are left to photons and rays


def choose_caustic_lamps(
    surfaces: Surfaces, tracer: Tracer, side_power: np.ndarray, pilot: Pilot, lit: float, key: np.uint64
) -> np.ndarray:
    """Choose the sheets that are lamps: small against their distance, a good part of the light in the image, and seldom
    hidden in part.

    side_power: (t,) float64 |excess| power of one side of each triangle, W. pilot: tells which sides can light the
    image (the inside of a closed lamp cannot), and where camera paths gather. lit: W m-2, mean irradiance from all
    surfaces where camera paths gather, as far as known. key: of the random numbers.
    Returns (t, 2) bool, which sides of triangles belong to a lamp.
    """
    sheet = surfaces.sheet
    power = np.bincount(sheet.ravel(), (side_power[:, None] * pilot.reachable).ravel())
    chosen = np.zeros(power.size, np.bool_)
    labels = np.argsort(-power, kind="stable")[:_MOST]
    labels = labels[power[labels] > 0]
    if len(pilot.point) == 0 or len(labels) == 0:
        return chosen[sheet]
    receivers = Receivers(pilot.point, pilot.normal, pilot.side_id).thinned(_RECEIVERS)
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
    """Judge the sheets with these labels (n,): their mean irradiance (n,) at the receivers, W m-2, as if all were
    visible, and the ratio of radius to distance (n,), averaged with the irradiance as weight. power: (sheets,) W."""
    row = np.full(power.size, -1, np.int32)
    row[labels] = np.arange(labels.size)
    centre, radius = spheres(surfaces.corners, surfaces.sheet, row, labels.size)
    towards = centre[:, None] - receivers.point
    distance = np.maximum(np.linalg.norm(towards, axis=2), radius[:, None])
    cosine = np.maximum(np.sum(towards * receivers.normal, axis=2), 0.0) / distance
    received = power[labels, None] * cosine / (4.0 * math.pi * distance**2)
    nearness = np.sum(received * radius[:, None] / distance, axis=1) / np.maximum(received.sum(axis=1), 1e-300)
    return received.mean(axis=1), nearness


def _unsureness(surfaces, tracer, side_power, label, receivers, key) -> float:
    """Variance of shadow rays to one sheet because other surfaces hide a part of it, over the mean square of the
    irradiance that these rays find at the receivers.

    A shadow ray chooses a point in proportion to the irradiance that this point would cause (see send_shadow). Let G be
    the mean irradiance over all points of the sheet, and E the mean with 0 for hidden points. A shadow ray then finds G
    with probability E / G and else 0: its variance is E (G - E).
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
    """Fill rays from each receiver to _AIMED points on a sheet, and caused (rays,) float64, m-2, the irradiance that
    the point would cause for 1 W of the sheet's power. sides: (n,) side_ids of the sheet. cumulative: (n,) float64,
    cumulative share of the sides' power, up to 1."""
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
        # the ray ends a little beyond the point, or the lamp would hide its own point: see send_shadow
        leave(surfaces, side_id, point, moved(way, CLEAR * math.sqrt(d2), lamp.normal), rays, i)
