# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons leave surfaces, surroundings and lights, each class in proportion to its excess power."""

import math
from typing import NamedTuple

import numpy as np

from ..geometry.surfaces import CLEAR, Surfaces, layer_of, scene_radius, start_ray, temperature_at
from ..physics.radiometry import Radiometry, excess
from ..physics.spectrum import band_radiance
from ..sampling.rng import path_key, uniform
from ..sampling.warps import basis, cone_direction, cosine_direction, to_world, triangle_point, turn
from ..scene import AreaLight, Light, PointLight, Scene, SpotLight, SunLight
from ..system.kernels import FAST_KERNEL, njit
from .guide import DIMENSIONS, Guide, even_guide
from .wave import LIT_BY_LAMP, LIT_BY_LIGHT

_SIGMA = 5.670374419e-8  # Stefan-Boltzmann constant, W m-2 K-4 (CODATA 2018)

# Photons from the surroundings, over all others, where the scene seems closed.
_SKY_DEFENSIVE = 1.0 / 64.0
# Photons from all that seems out of the image's reach, at most, over all others: next to a closed furnace its small
# chance would still take nearly all.
_HIDDEN = 1.0 / 16.0

POINT, SPOT, RECTANGLE, ELLIPSE, SUN = range(5)


class Emitters(NamedTuple):
    """Everything that emits, as entries of one discrete distribution: surface sides, surroundings, lights.

    cumulative: (e + 1,) float64, from 0 to 1, the cumulative probability of an entry; zeros where nothing emits.
    surface: (n,) int32 codes 2 triangle + side of entries 0..n-1, which emit. lamp: (n,) bool, whether shadow rays see
        to their direct light.
    sky: (m,) int32 codes of entries n..n+m-1, on which photons from the surroundings arrive. open: (t, 2) bool, sides
        that look for the surroundings with rays of their own, so that those photons are not stored there.
    area: (t,) float64, of the triangles, m2.
    surroundings: (b,) float64, excess radiance of the surroundings, W m-2 sr-1. sky_layer: the layer of the image that
        they add to (see layers); lights add to the first.
    light: (l, 16) float64 shapes (see _light_row), light_power: (l, b) float64 W (sun: W m-2), entries n+m...
    radius: of a sphere around the origin that holds the scene, m.
    guide: density of the five numbers that choose an emission.
    """

    cumulative: np.ndarray
    surface: np.ndarray
    lamp: np.ndarray
    sky: np.ndarray
    open: np.ndarray
    area: np.ndarray
    surroundings: np.ndarray
    sky_layer: int
    light: np.ndarray
    light_power: np.ndarray
    radius: float
    guide: Guide


def light_spectrum(light: Light, edges: np.ndarray) -> np.ndarray:
    """(b,) share of a light's total flux in each band: that of a blackbody at its temperature."""
    total = _SIGMA * light.temperature**4
    if total == 0.0:  # at 0 K, and where float64 cannot tell it from that
        return np.zeros(len(edges) - 1)
    return math.pi * band_radiance(edges, light.temperature) / total


def _light_row(light: Light, centre: np.ndarray) -> np.ndarray:
    """Shape of a light: kind, position or direction, two axes or a cone, radius."""
    row = np.zeros(16)
    if isinstance(light, SunLight):
        row[0], row[4:7] = SUN, np.asarray(light.direction) / np.linalg.norm(light.direction)
        row[10] = math.cos(0.5 * light.angle)
        return row
    row[1:4] = np.asarray(light.position, np.float64) - centre
    facing, extent = np.zeros(3), 0.0
    if isinstance(light, AreaLight):
        row[0] = ELLIPSE if light.ellipse else RECTANGLE
        row[4:7], row[7:10] = light.axis_u, light.axis_v
        facing, extent = np.cross(row[7:10], row[4:7]), np.abs(row[4:10]).max()
        facing /= np.linalg.norm(facing)
    elif isinstance(light, SpotLight):
        row[0], row[4:7] = SPOT, np.asarray(light.direction) / np.linalg.norm(light.direction)
        outer = math.cos(0.5 * light.cone_angle)
        row[10], row[11], row[12] = outer, light.radius, (1.0 - outer) * light.blend
        # mean of smoothstep over its own width is 1/2, so the cone holds this share of a full one
        row[13] = 1.0 - 0.5 * light.blend
        facing = row[4:7]
    elif isinstance(light, PointLight):
        row[0], row[10], row[11] = POINT, -1.0, light.radius
        row[4:7] = (0.0, 0.0, 1.0)
    # a light that is set flush into a ceiling is to shine into the room: clear of that plane, as rays' origins are
    row[1:4] += CLEAR * (np.abs(row[1:4]).max() + extent) * facing
    return row


@njit(cache=True, nogil=True)
def side_power(surfaces, radiometry, area):
    """(t,) float64 |excess| power of a side of each triangle, over all bands, W: the mean over corners and centre."""
    power = np.empty(area.size)
    value = np.empty(radiometry.reference.size)
    varying = surfaces.temperature.shape[1] == 3
    for t in range(area.size):
        total = 0.0
        for sample in range(4 if varying else 1):
            u = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 2 else 0.0)
            v = 1.0 / 3.0 if sample == 0 else (1.0 if sample == 3 else 0.0)
            kelvin = temperature_at(surfaces.temperature, t, u, v)
            excess(radiometry, surfaces.material[t], kelvin, 2.0 / 3.0, value)
            for b in range(value.size):
                total += abs(value[b])
        power[t] = math.pi * area[t] * total / (4 if varying else 1)
    return power


def build_emitters(
    scene: Scene,
    surfaces: Surfaces,
    radiometry: Radiometry,
    centre: np.ndarray,
    matters: np.ndarray,
    weight: np.ndarray,
    arrival: np.ndarray,
    openness: float,
    area: np.ndarray,
    power: np.ndarray,
    lamp: np.ndarray,
    open_: np.ndarray,
    world_temperature: float,
    sky_layer: int,
) -> Emitters:
    """Distribution of the emitters.

    area: (t,) float64, m2. power: (t,) float64, W, see side_power. lamp: (t, 2) bool, sides that shadow rays are sent
    to. open_: see Emitters.
    matters: (t, 2) bool, sides that the image can depend on, as far as known.
    weight, arrival: (t, 2) float64, factors on the probability that a side emits, or that photons from the surroundings
        arrive there.
    openness: share of the directions from those sides that leave the scene, 0..1.
    world_temperature: K, of the surroundings as they are traced. sky_layer: see Emitters.
    """
    surroundings = np.zeros_like(radiometry.reference)
    if world_temperature != radiometry.quiet:  # else rounding of the reference would be all that photons carry
        surroundings = band_radiance(scene.band_edges, world_temperature) - radiometry.reference
    sky_flux = math.pi * np.abs(surroundings).sum()
    sky_area = (area[:, None] * arrival).ravel()
    sky = np.flatnonzero(sky_area > 0).astype(np.int32) if sky_flux > 0 else np.empty(0, np.int32)
    sky_power = sky_flux * sky_area[sky]
    radius = scene_radius(surfaces.corners)
    light_power = np.array([_flux(light) * light_spectrum(light, scene.band_edges) for light in scene.lights])
    light_power = light_power.reshape(len(scene.lights), radiometry.reference.size)
    light = np.array([_light_row(light, centre) for light in scene.lights]).reshape(-1, 16)
    light_total = light_totals(light, light_power, radius)
    surface_power = power[:, None] * weight
    hidden, others = surface_power[~matters].sum(), surface_power[matters].sum() + light_total.sum()
    if hidden > _HIDDEN * others > 0.0:
        surface_power[~matters] *= _HIDDEN * others / hidden
    surface_power = surface_power.ravel()
    surface = np.flatnonzero(surface_power > 0).astype(np.int32)
    # Of the photons from the surroundings only the share `openness` arrives; for the least variance at a given number
    # of photons a class is then chosen in proportion to power / sqrt(share) (Lagrange). A scene that seems closed still
    # sends some: the pilot may have missed a hole.
    others = surface_power.sum() + light_total.sum()
    if openness > 0:
        sky_chosen = sky_power * math.sqrt(openness)
    else:
        sky_chosen = sky_power * (_SKY_DEFENSIVE * others / sky_power.sum() if others > 0 and sky.size else 1.0)
    chosen = np.concatenate((surface_power[surface], sky_chosen, light_total))
    cumulative = np.concatenate(([0.0], np.cumsum(chosen)))
    if cumulative[-1] > 0:
        cumulative /= cumulative[-1]
    return Emitters(
        cumulative=cumulative,
        surface=surface,
        lamp=lamp.ravel()[surface],
        sky=sky,
        open=open_,
        area=area,
        surroundings=surroundings,
        sky_layer=sky_layer,
        light=light,
        light_power=light_power,
        radius=radius,
        guide=even_guide(),
    )


def light_totals(light: np.ndarray, light_power: np.ndarray, radius: float) -> np.ndarray:
    """(l,) float64 W of the lights over all bands, a sun's through the disk that holds the scene. See Emitters."""
    return light_power.sum(axis=1) * np.where(light[:, 0] == SUN, math.pi * radius**2, 1.0)


def _flux(light: Light) -> float:
    """W; of a sun W m-2 across each of the directions that it shines from, which reach a plane facing it aslant."""
    if isinstance(light, SunLight):
        mean_cosine = 0.5 * (1.0 + math.cos(0.5 * light.angle))
        return light.irradiance / mean_cosine
    return light.power


@njit(inline="always")
def _next_cell(guide, cell, pick):
    """The guide's cell that holds a photon; picks ascend from photon to photon, cell is that of the one before."""
    while cell < guide.density.size - 1 and guide.cumulative[cell + 1] <= pick:
        cell += 1
    return cell


@njit(inline="always")
def _choose(guide, cell, pick, path):
    """The five numbers of a photon: evenly over the cell, the first in step with the pick."""
    low, size = guide.low[cell], guide.size[cell]
    along = (pick - guide.cumulative[cell]) / (guide.cumulative[cell + 1] - guide.cumulative[cell])
    return (
        low[0] + size[0] * min(along, 0.9999999999999999),
        low[1] + size[1] * uniform(path, 0),
        low[2] + size[2] * uniform(path, 1),
        low[3] + size[3] * uniform(path, 2),
        low[4] + size[4] * uniform(path, 3),
    )


@njit(cache=True, nogil=True)
def chosen_numbers(guide, key, total):
    """The (total, 5) numbers that choose the emissions of a pass, and the density of each, (total,) float64."""
    numbers, density = np.empty((total, DIMENSIONS)), np.empty(total)
    shift, cell = uniform(key, 0), 0
    for photon in range(total):
        pick = (photon + shift) / total
        cell = _next_cell(guide, cell, pick)
        numbers[photon] = _choose(guide, cell, pick, path_key(key, photon))
        density[photon] = guide.density[cell]
    return numbers, density


def emit(emitters, surfaces, radiometry, key, first, total, wave):
    """Fill the wave with photons first, first + 1, ... of the `total` of a pass. key: of the pass's photons."""
    _emit(emitters, surfaces, radiometry, key, first, total, wave, np.empty(radiometry.reference.size))


@njit(**FAST_KERNEL)
def _emit(emitters, surfaces, radiometry, key, first, total, wave, value):
    # One random shift places all photons evenly over the guide's cells and the emitters within (systematic sampling).
    # Positions and directions are independent: the k-nearest estimate rests on photons that lie at random, and is off
    # by -1/2 in k where a sequence of low discrepancy lays them out evenly (measured under a point light).
    guide = emitters.guide
    shift = uniform(key, 0)
    surface_end = emitters.surface.size
    sky_end = surface_end + emitters.sky.size
    last = emitters.cumulative.size - 2
    cell = entry = 0
    known, known_kelvin = -1, -1.0  # material and temperature whose excess `value` holds: neighbours mostly share it
    for i in range(wave.photon.size):
        photon = first + i
        path = path_key(key, photon)
        pick = (photon + shift) / total
        before = cell
        cell = _next_cell(guide, cell, pick)
        number, s0, s1, s2, s3 = _choose(guide, cell, pick, path)
        if i == 0 or cell != before:
            entry = min(last, np.searchsorted(emitters.cumulative, number, side="right") - 1)
        while entry < last and emitters.cumulative[entry + 1] <= number:
            entry += 1
        probability = emitters.cumulative[entry + 1] - emitters.cumulative[entry]
        share = 1.0 / (total * probability * guide.density[cell])
        wave.photon[i] = photon
        lamp = entry < surface_end and emitters.lamp[entry]
        wave.chain[i] = LIT_BY_LIGHT if entry >= sky_end else LIT_BY_LAMP if lamp else 0
        wave.direct[i] = wave.chain[i] != 0
        wave.arrival[i] = -1
        layer = 0
        if entry < sky_end:
            code = emitters.surface[entry] if entry < surface_end else emitters.sky[entry - surface_end]
            t = code >> 1
            layer = layer_of(surfaces.layer, t) if entry < surface_end else emitters.sky_layer
            u, v = triangle_point(s0, s1)
            lx, ly, lz = cosine_direction(s2, s3)
            scale = math.pi * emitters.area[t] * share
            if entry < surface_end:
                kelvin = temperature_at(surfaces.temperature, t, u, v)
                material = surfaces.material[t]
                if material != known or kelvin != known_kelvin:
                    excess(radiometry, material, kelvin, lz, value)
                    known = -1 if radiometry.alpha[material] > 0.0 else material
                    known_kelvin = kelvin
                for b in range(value.size):
                    wave.power[i, b] = value[b] * scale
            else:
                wave.arrival[i] = code
                wave.direct[i] = emitters.open[t, code & 1]
                wave.u[i], wave.v[i] = u, v
                for b in range(value.size):
                    wave.power[i, b] = emitters.surroundings[b] * scale
            start_ray(surfaces, code, u, v, lx, ly, lz, wave.origin, wave.direction, i)
        else:
            light = entry - sky_end
            brightness = _leave_light(emitters, light, s0, s1, s2, s3, wave, i)
            for b in range(value.size):
                wave.power[i, b] = emitters.light_power[light, b] * brightness * share
        if wave.layer.size:
            wave.layer[i] = layer


@njit(inline="always")
def area_light_point(row, u, v):
    """Point of an area light, even over its area."""
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    if int(row[0]) == ELLIPSE:
        r = math.sqrt(u)
        a, b = turn(v)
        a, b = r * a, r * b
    return row[1] + a * row[4] + b * row[7], row[2] + a * row[5] + b * row[8], row[3] + a * row[6] + b * row[9]


@njit(inline="always")
def area_light_normal(row):
    """Unit normal of an area light on the side that shines: along cross(axis_v, axis_u)."""
    nx = row[8] * row[6] - row[9] * row[5]
    ny = row[9] * row[4] - row[7] * row[6]
    nz = row[7] * row[5] - row[8] * row[4]
    inverse = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * inverse, ny * inverse, nz * inverse


@njit(inline="always")
def spot_brightness(row, cosine):
    """Intensity of a spot light under an angle from its axis over that of an evenly lit cone of the same power."""
    if cosine < row[10]:
        return 0.0
    if row[12] <= 0.0:
        return 1.0
    t = min(1.0, (cosine - row[10]) / row[12])
    return t * t * (3.0 - 2.0 * t) / row[13]


@njit(inline="always")
def _leave_light(emitters, light, s0, s1, s2, s3, wave, i):
    """Start ray i at a light; returns the factor on its power (1 on average over what the light emits)."""
    row = emitters.light[light]
    kind = int(row[0])
    brightness = 1.0
    x, y, z = row[1], row[2], row[3]
    if kind in (RECTANGLE, ELLIPSE):
        x, y, z = area_light_point(row, s0, s1)
        nx, ny, nz = area_light_normal(row)
        lx, ly, lz = cosine_direction(s2, s3)
        dx, dy, dz = to_world(lx, ly, lz, nx, ny, nz)
    else:
        lx, ly, lz = cone_direction(s0, s1, row[10])
        dx, dy, dz = to_world(lx, ly, lz, row[4], row[5], row[6])
        if kind == SPOT:
            brightness = spot_brightness(row, lz)
        # A sphere (or the sun) seen from a direction is a disk: start anywhere on it
        radius = emitters.radius if kind == SUN else row[11]
        if radius > 0.0:
            r = radius * math.sqrt(s2)
            p, q = turn(s3)
            p, q = r * p, r * q
            tx, ty, tz, bx, by, bz = basis(dx, dy, dz)
            x, y, z = x + p * tx + q * bx, y + p * ty + q * by, z + p * tz + q * bz
        if kind == SUN:
            x, y, z = x - 1.01 * radius * dx, y - 1.01 * radius * dy, z - 1.01 * radius * dz
            brightness = math.pi * radius * radius
    wave.origin[i, 0], wave.origin[i, 1], wave.origin[i, 2] = x, y, z
    wave.direction[i, 0], wave.direction[i, 1], wave.direction[i, 2] = dx, dy, dz
    return brightness
