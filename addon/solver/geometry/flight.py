# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight: how light flies along a segment in media that scatter, and where it goes on from there."""

from __future__ import annotations

import math

import numpy as np

from ..physics.media import deflect, mean_phase, weigh_phase
from ..physics.radiometry import absolute_sum
from ..sampling.rng import uniform
from ..sampling.vectors import dot, put_vector, scaled, vector
from ..system.kernels import INLINED, njit
from .segments import add_depth, go_on, is_plain, pass_gas, set_out

ARRIVED, LOST = -1, -2  # see walk
NUMBERS = 8  # random numbers of a segment
_MOST = 1.0 - 1.0 / 4096.0  # largest chance with which a walk goes on, so that each ends


@njit(**INLINED)
def walk(air, i, rays, weight, numbers, out):
    """Let light with these weights (b,) fly along segment i: it has ARRIVED at its end, is LOST by roulette, with a
    chance that is the share of |w| that was absorbed on the way, or the number of the medium is returned that scatters
    it. The weights follow (see fly). Where it is scattered, its new origin and direction, of unit length, are put into
    row n of out, and the weights that it goes on with into its last array, which may be `weight`. Where anisotropies
    differ, the direction is that of a band c picked with P_c, the share of |w|, and with the phase functions p

        w_b <- w_b p_b / sum over c of P_c p_c

    rays: origin, direction (n, 3) of the segments. numbers: key and first dimension of NUMBERS random numbers.
    out: origin, direction, n and weights (b,).
    """
    if air.first[i] == air.first[i + 1]:
        return ARRIVED
    (origin, direction), (path, first), (new_origin, new_direction, n, onward) = rays, numbers, out
    before = absolute_sum(weight)
    end = fly(air, i, weight, uniform(path, first), uniform(path, first + 1))
    if not end < np.inf:
        return ARRIVED
    medium = scatterer(air, i, weight, uniform(path, first + 2))
    after = absolute_sum(weight)
    survival = min(_MOST, after / before) if after > 0.0 else 0.0
    if medium < 0 or uniform(path, first + 3) >= survival:
        return LOST
    for b in range(weight.size):
        weight[b] /= survival
    way, start = vector(direction, i), vector(origin, i)
    put_vector((start[0] + end * way[0], start[1] + end * way[1], start[2] + end * way[2]), new_origin, n)
    g, c, along = air.table.anisotropy[medium], 0, scaled(way, 1.0 / air.length[i])
    if g.size > 1:
        c = pick_band(weight, uniform(path, first + 6) * absolute_sum(weight))
    turned = deflect(g[c], along, uniform(path, first + 4), uniform(path, first + 5))
    put_vector(turned, new_direction, n)
    cosine = dot(along, turned)
    mean = mean_phase(g, weight, cosine)
    for b in range(weight.size):
        onward[b] = weight[b]
    weigh_phase(g, mean, cosine, onward)
    return medium


@njit(**INLINED)
def pick_band(weight, u):
    """The band in which the sum of |weight| (b,) up to it reaches u."""
    c, left = 0, u - abs(weight[0])
    while c < weight.size - 1 and left >= 0.0:
        c += 1
        left -= abs(weight[c])
    return c


@njit(**INLINED)
def fly(air, i, weight, u, v):
    """Let light with these weights (b,) fly along segment i; returns the distance at which it is scattered, in units of
    the direction's length, infinite if it arrives at the end, and lowers the weights by what is absorbed.

    A band c is picked with P_c = |w_c| / sum of |w|, and the optical depth of its flight is distributed like exp(-tau).
    With s the scattering coefficients, S and A the depths of scattering and of absorption so far,

        w_b <- w_b exp(-A_b) s_b exp(-S_b) / sum over c of P_c s_c exp(-S_c)    where it is scattered, and
        w_b <- w_b exp(-A_b) exp(-S_b) / sum over c of P_c exp(-S_c)            where it arrives,

    so the sum of |w| never grows: this is the twin of the roulette by power. u, v: numbers in [0, 1).
    """
    total = absolute_sum(weight)
    if not total > 0.0:
        return np.inf
    c, left = pick_band(weight, u * total), -math.log1p(-v)
    depth, scattered, scattering = air.bands.depth, air.bands.scattered, air.bands.scattering
    t, collides = _advance_plainly(air, i, c, left) if is_plain(air, i) else advance(air, i, c, left, np.inf)
    if not collides:
        scattering[:] = 1.0
    mean = 0.0
    for b in range(weight.size):
        mean += abs(weight[b]) / total * math.exp(-scattered[b]) * scattering[b]
    for b in range(weight.size):
        weight[b] *= math.exp(-depth[b]) * scattering[b] / mean
    return t if collides else np.inf


@njit(**INLINED)
def advance(air, i, c, left, goal):
    """Go along segment i up to a depth of scattering in band c, or to a distance, in units of the direction's length,
    which may lie before it or beyond all media; the other is infinite. Returns the distance, and whether it was come to
    in the media. air.bands then tell depth, scattered and scattering, 1/m, there."""
    table, bands, t, stop = air.table, air.bands, 0.0, set_out(air, i)
    bands.depth[:], bands.scattered[:], bands.scattering[:] = 0.0, 0.0, 0.0
    arrived = goal <= 0.0
    while stop < np.inf and not arrived:
        of_c, end = _scattering_in(air, i, c) * air.length[i], stop
        if of_c * (stop - t) > left:
            end, arrived = t + left / of_c, True
        if goal <= end:
            end, arrived = goal, True
        left -= of_c * (end - t)
        add_depth(air, i, table.extinction, end - t, bands.depth)
        add_depth(air, i, table.scattering, end - t, bands.scattered)
        t = end
        if arrived:
            add_depth(air, i, table.scattering, 1.0 / air.length[i], bands.scattering)
        else:
            stop = go_on(air, i, stop)
    return (goal if goal < np.inf else t), arrived


@njit(**INLINED)
def _advance_plainly(air, i, c, left):
    """`advance` to a depth of scattering on a plain segment, see is_plain: no step from cell to cell asks for each
    band."""
    s, table, bands = air.first[i], air.table, air.bands
    row = air.row[s]
    limit = left / table.scattering[row, c] if table.scattering[row, c] > 0.0 else np.inf
    passed, air.march.amount[s], t = pass_gas(air, i, limit)
    for b in range(bands.depth.size):
        bands.depth[b], bands.scattered[b] = passed * table.extinction[row, b], passed * table.scattering[row, b]
    bands.scattering[:] = 0.0
    add_depth(air, i, table.scattering, 1.0 / air.length[i], bands.scattering)
    return t, t < np.inf


@njit(**INLINED)
def _scattering_in(air, i, c):
    """Scattering coefficient in band c at the present place of segment i, 1/m."""
    total = 0.0
    for s in range(air.first[i], air.first[i + 1]):
        if air.march.amount[s] > 0.0:
            total += air.march.amount[s] * air.table.scattering[air.row[s], c]
    return total


@njit(**INLINED)
def scatterer(air, i, weight, u):
    """The medium that scatters light with these weights (b,) where fly has ended on segment i, -1 if there is none.

    Where several overlap, one is picked with P_m, the share of |w| that it scatters, and w_b <- w_b s_mb / s_b / P_m.
    u: number in [0, 1).
    """
    total, medium, of, amount, chance = absolute_sum(weight), np.int64(-1), np.int64(-1), 0.0, 1.0
    table, scattering, pick = air.table, air.bands.scattering, u * total
    for s in range(air.first[i], air.first[i + 1]):
        if air.march.amount[s] > 0.0 and pick >= 0.0:
            share, row = 0.0, air.row[s]
            for b in range(weight.size):
                if table.scattering[row, b] > 0.0:
                    share += abs(weight[b]) * (air.march.amount[s] * table.scattering[row, b] / scattering[b])
            if share > 0.0:
                medium, of, amount, chance = air.medium[s], row, air.march.amount[s], share / total
                pick -= share
    if medium >= 0:
        for b in range(weight.size):
            if weight[b] != 0.0:
                weight[b] *= amount * table.scattering[of, b] / scattering[b] / chance
    return medium
