# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lamps throw caustics: small hot surfaces whose light, after specular surfaces alone, photons find.

A ray that a mirror reflects seldom meets a source that is small against its distance, while its photons find the
mirror. The light of a wall that spans half the view is found by rays.
"""

import math

import numpy as np

from ..geometry.surfaces import Surfaces
from .lamps import Receivers, spheres
from .pilot import Pilot

_MOST = 64  # candidates: the sheets with most power
_RECEIVERS = 512  # points at which candidates are judged
_COMPACT = 0.3  # largest ratio of radius to distance of a lamp, in the mean over the points that it lights
_LEAST_SHARE = 0.03  # share of the light in the image that a lamp contributes at least
_LEAST_OF_ALL = 0.3  # share that all lamps contribute at least


def choose_caustic_lamps(surfaces: Surfaces, power: np.ndarray, pilot: Pilot, lit: float) -> np.ndarray:
    """Choose the sheets that throw caustics: small against their distance, and a good part of the light in the image.

    power: (labels,) float64 |excess| power of each sheet, W. pilot: tells which sheets can light the image (the inside
    of a closed lamp cannot), and where camera paths gather. lit: W m-2, mean irradiance from all surfaces where camera
    paths gather, as far as known.
    Returns (labels,) bool, which sheets are such lamps.
    """
    power = np.where(pilot.reachable, power, 0.0)
    chosen = np.zeros(power.size, np.bool_)
    labels = np.argsort(-power, kind="stable")[:_MOST]
    labels = labels[power[labels] > 0]
    if len(pilot.point) == 0 or len(labels) == 0:
        return chosen
    receivers = Receivers(pilot.point, pilot.normal, pilot.side_id).thinned(_RECEIVERS)
    irradiance, nearness = _judge(surfaces, labels, power, receivers)
    compact = (irradiance > 0) & (nearness < _COMPACT)
    lit = max(lit, irradiance[compact].sum())
    compact &= irradiance > _LEAST_SHARE * lit
    if irradiance[compact].sum() > _LEAST_OF_ALL * lit:
        chosen[labels[compact]] = True
    return chosen


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
