# SPDX-License-Identifier: GPL-3.0-or-later
"""How camera paths go on: in specular lobes, as rays of final gathers, and continued from the ends of such rays."""

import numpy as np

from ..geometry.curved import reflecting
from ..geometry.interaction import interact, leave
from ..geometry.segments import FROM_DIFFUSE, FROM_GLOSSY
from ..geometry.stage import (
    diffuse_reflectance_at,
    enter,
    is_grainy,
    lobe_reflectance_at,
    lobes_at,
    lobes_met,
    reflectance_at,
)
from ..geometry.surfaces import clear_of, sheet_of
from ..photons.transport import MAX_SURVIVAL
from ..physics.lobes import (
    diffuse_density,
    diffuse_share,
    evaluate_diffuse,
    glossy_density,
    is_specular,
    sample_diffuse,
    sample_specular,
)
from ..sampling.heuristics import ALONE, SINGLE_RAY
from ..sampling.low_discrepancy import lattice_point
from ..sampling.rng import path_key, uniform
from ..sampling.vectors import dot, put_vector, vector
from ..system.kernels import FAST_INLINED, FAST_KERNEL, INLINED, njit
from .rays import ASTRAY, BLIND, is_astray, largest_throughput, shares_by_lobe
from .streams import CONTINUING, DIMENSIONS, DOUBTING, LOBE, SPLITTING, SURVIVAL

_SURE = 8  # bounces in which roulette ends weak paths alone, so that the view in a mirror has no noise from it
_DOUBTED = 256.0  # rays of final gathers of which about one is sent twice more, to check what rays recall
_WEAK = 1.0 / 16.0  # share of a camera ray's throughput below which a path is weak: roulette decides on it


def follow(stage, together, bounce, samples, gathers, onward) -> int:
    """Fill onward with the next rays: specular reflections, rays of final gathers, continued rays (see recall), and
    rays that check what is recalled; returns their number. together: see Looking, by sheet. samples: (pixels,), camera
    rays of each pixel."""
    shares = np.zeros(len(gathers.ray))  # of each gather: throughput of the rays of its group so far
    first = np.empty(len(gathers.ray), np.int64)  # of each gather: index of the first of its rays in onward
    room = np.empty(onward.throughput.shape[1], np.float32)
    return _follow(stage, together, bounce, samples, gathers, onward, (shares, first, room))


@njit(**FAST_KERNEL)
def _follow(stage, together, bounce, samples, gathers, onward, groups):
    rays, hits, sent, (shares, first, room) = bounce.rays, bounce.hits, np.int64(0), groups
    for i in range(hits.triangle.size):
        if hits.triangle[i] >= 0 and is_specular(lobes_met(stage, hits, i)):
            at = interact(stage.surfaces, hits, i, rays.direction)
            full, alike = full_throughput(rays, i, samples), SINGLE_RAY
            if not rays.final[i]:
                alike *= samples[rays.pixel[i]]
            sent += _reflect_specularly(stage, at, bounce, i, (full, alike), (onward, room), sent)
        if bounce.goes_on[i] > 0.0:
            _go_on(stage, interact(stage.surfaces, hits, i, rays.direction), bounce, i, (onward, room), sent)
            sent += 1
    for g in range(first.size):  # the rays of a gather lie one behind the other, whatever points they start from
        first[g] = sent
        sent += gathers.rays[g]
    for i in range(hits.triangle.size):
        g = gathers.of[i]
        if g >= 0 and gathers.rays[g] > 0:
            at = interact(stage.surfaces, hits, i, rays.direction)
            before = shares[g]
            shares[g] += largest_throughput(rays.throughput[i], reflectance_at(stage, at, room))
            part = before / gathers.throughput[g], shares[g] / gathers.throughput[g]
            path = path_key(rays.path[gathers.ray[g]], SPLITTING + bounce.number)
            looking = float(together[sheet_of(stage.surfaces, at.side_id)])
            _split(stage, at, gathers, g, (part, path, looking), first[g], onward)
    for g in range(first.size):
        if gathers.rays[g] > 0:
            sent += _doubt(stage, bounce, (gathers, g, first[g]), samples.size, (onward, room), sent)
    return sent


@njit(inline="always")
def _split(stage, at, gathers, g, group, first, onward):
    """Send, from the point `at` of one ray of the group, that ray's part of the rays of final gather g. These are
    cosine-distributed and add to the gather's row.

    part: cumulative share in the group's throughput before this ray and after it, in [0, 1]. The rays between these two
    shares, after a random start that is the same for the group, fall to this ray (systematic resampling). All
    directions are points of one lattice; each ray of the group gets points that follow one another. group: this part,
    the key of the group's random numbers, and how many rays look together. first: index in onward of the first ray of
    the gather.
    """
    count, row, (part, path, together) = gathers.rays[g], gathers.row[g], group
    origin, throughput = clear_of(stage.surfaces, at.side_id, at.point), np.float32(gathers.contribution[g] / count)
    start, shift_u, shift_v = uniform(path, 0), uniform(path, 1), uniform(path, 2)
    for ray in range(_resampled(part[0], count, start), _resampled(part[1], count, start)):
        u, v = lattice_point(ray, count, shift_u, shift_v)
        put_vector(origin, onward.origin, first + ray)
        direction = sample_diffuse(at.normal, u, v)
        put_vector(direction, onward.direction, first + ray)
        onward.density[first + ray] = together * diffuse_density(at.normal, direction)
        onward.pixel[first + ray], onward.path[first + ray] = row, path_key(path, 3 + ray)
        onward.final[first + ray], onward.continued[first + ray] = True, False
        onward.kind[first + ray] = FROM_DIFFUSE
        onward.throughput[first + ray, :] = throughput * np.float32(evaluate_diffuse(at, direction))
        enter(stage, at, dot(direction, at.shading_normal), onward.throughput[first + ray])


@njit(inline="always")
def _doubt(stage, bounce, gather, pixels, out, sent):
    """Send one ray of some final gathers twice more, as rays `sent` and `sent` + 1 of onward; returns 2, or 0.

    The second of the two is like any ray; the first goes on from its end, whatever is recalled there. They add to rows
    of their own, `pixels` and 2 `pixels` further than the pixel. The random numbers are the same, so the rows differ
    only by what a continued ray finds in place of what is recalled: in the mean, by the bias of recalling.
    gather: gathers, the number of one of them, and the index in onward of its first ray. out: onward, and a room (b,).
    """
    (gathers, g, first), (onward, room) = gather, out
    rays, i, count = bounce.rays, gathers.ray[g], gathers.rays[g]
    chance, number = min(1.0, count / _DOUBTED), uniform(rays.path[i], DOUBTING + bounce.number)
    if number >= chance:
        return 0
    at, ray = interact(stage.surfaces, bounce.hits, i, rays.direction), first + int(number / chance * count)
    received = evaluate_diffuse(at, vector(onward.direction, ray))
    weight = gathers.weight[g] * diffuse_share(lobes_at(stage, at)) * received
    rho, scale = diffuse_reflectance_at(stage, at, room), np.float32(weight / chance)
    for twin in range(2):
        put_vector(vector(onward.origin, ray), onward.origin, sent + twin)
        put_vector(vector(onward.direction, ray), onward.direction, sent + twin)
        onward.pixel[sent + twin], onward.path[sent + twin] = rays.pixel[i] + (1 + twin) * pixels, onward.path[ray]
        onward.final[sent + twin], onward.continued[sent + twin] = True, False
        onward.kind[sent + twin] = FROM_DIFFUSE
        onward.density[sent + twin], onward.doubts[sent + twin] = onward.density[ray], twin == 0
        for b in range(rho.size):
            onward.throughput[sent + twin, b] = rays.throughput[i, b] * rho[b] * scale
        enter(stage, at, dot(vector(onward.direction, ray), at.shading_normal), onward.throughput[sent + twin])
    return 2


@njit(inline="always")
def _resampled(share, count, start):
    """How many of `count` rays fall to a cumulative share. start: in [0, 1). All rays fall to a share of 1, even where
    rounding leaves it a little below."""
    return min(count, int(share * count + start)) if share < 1.0 - 1e-9 else count


@njit(inline="always")
def _leave(surfaces, at, direction, pixel, path, onward, row):
    leave(surfaces, at.side_id, at.point, direction, onward, row)
    onward.pixel[row], onward.path[row] = pixel, path


@njit(inline="always")
def _go_on(stage, at, bounce, i, out, sent):
    """Continue ray i of a final gather in one diffuse direction, as ray `sent` of onward. out: onward, and a room."""
    rays, (onward, room) = bounce.rays, out
    rho, path = diffuse_reflectance_at(stage, at, room), path_key(rays.path[i], CONTINUING + bounce.number)
    direction = sample_diffuse(at.normal, uniform(path, 0), uniform(path, 1))
    _leave(stage.surfaces, at, direction, rays.pixel[i], path, onward, sent)
    onward.final[sent] = onward.continued[sent] = True
    onward.kind[sent] = FROM_DIFFUSE
    onward.density[sent] = SINGLE_RAY * diffuse_density(at.normal, direction)
    scale = np.float32(diffuse_share(lobes_at(stage, at)) * evaluate_diffuse(at, direction) * bounce.goes_on[i])
    for b in range(rho.size):
        onward.throughput[sent, b] = rays.throughput[i, b] * rho[b] * scale
    enter(stage, at, dot(direction, at.shading_normal), onward.throughput[sent])


@njit(**FAST_INLINED)
def _largest(throughput):
    largest = np.float32(0.0)
    for b in range(throughput.size):
        largest = max(largest, throughput[b])
    return float(largest)


@njit(**INLINED)
def full_throughput(rays, i, samples):
    """Throughput after a surface from which on roulette does not end ray i. Rays of a final gather have little from the
    start: roulette goes by what the surface leaves of it. samples: (pixels,), camera rays of each pixel."""
    return _largest(rays.throughput[i]) if rays.final[i] else _WEAK / samples[rays.pixel[i]]


@njit(inline="always")
def _reflect_specularly(stage, at, bounce, i, counts, out, sent):
    """Send ray i on in one direction of the specular lobe, as ray `sent` of onward; returns 1 if it survives roulette,
    else 0. counts: with a throughput of at least the first after the reflection it survives for sure, but for many
    bounces; the second is the number of rays that share the light with one shadow ray, see shadow_rays. out: onward,
    and a room (b,)."""
    rays, lobes, (full, alike), (onward, room) = bounce.rays, lobes_at(stage, at), counts, out
    path, dimension = rays.path[i], DIMENSIONS * bounce.number
    s, w = uniform(path, dimension + LOBE), uniform(path, dimension + LOBE + 1)
    direction, weight = sample_specular(lobes, reflecting(stage.surfaces, lobes, at), s, w)
    rho, scale = lobe_reflectance_at(stage, at, lobes, direction, room), lobes.specular * weight
    left = scale * largest_throughput(rays.throughput[i], rho)
    if left <= 0.0:  # full may be 0, too: float32 knows nothing of what gets through gas of a depth above 100
        return 0
    survival = min(MAX_SURVIVAL if bounce.number >= _SURE else 1.0, left / full)
    if uniform(path, dimension + SURVIVAL) >= survival:
        return 0
    _leave(stage.surfaces, at, direction, rays.pixel[i], path, onward, sent)
    onward.final[sent], onward.continued[sent] = rays.final[i], rays.continued[i]
    onward.doubts[sent], onward.kind[sent] = rays.doubts[i], FROM_GLOSSY
    onward.steady[sent] = rays.steady[i] and survival >= 1.0 and lobes.alpha == 0.0 and not is_grainy(stage, at)
    astray = is_astray(rays, i)
    onward.density[sent] = ASTRAY if astray else BLIND if rays.final[i] else ALONE
    if shares_by_lobe(lobes, rays.final[i]):
        density = alike * glossy_density(lobes, at, direction)
        onward.density[sent] = -density if astray else density
    for b in range(rho.size):
        onward.throughput[sent, b] = rays.throughput[i, b] * rho[b] * (scale / survival)
    return 1
