# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes: into which directions a surface reflects what it does not emit.

A surface has a diffuse lobe, a specular lobe, or both; each takes a share of the reflectance rho. For every lobe, this
module draws directions, gives the density of these directions, evaluates the BRDF from one direction to another, and
gives the albedo: how much of rho the lobe reflects in all. What a lobe loses at grazing angles is emitted instead, so
that an enclosure of one temperature is exactly black (docs/method.md).

Where a surface is shaded smooth, lobes are turned around the shading normal, but light falls on the triangle. So BRDFs
are given with respect to the geometric normal: what they reflect of irradiance on the triangle (Veach 1997, section
5.3). Then photons and camera paths see the same BRDF, and only densities of directions tell the two normals apart.

A new lobe gets a flag, a property of scene.Material, a column of LobeTable, and a branch in each kernel below.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..sampling.vectors import dot, moved, scaled
from ..sampling.warps import cosine_direction, to_local, to_world, turn
from ..scene import Material
from ..system.kernels import INLINED, njit

# Kinds of lobes, as flags that can be joined (pbrt's BxDFFlags): a mirror's lobe is SPECULAR, a rough one GLOSSY, and
# WIDE, too, if rays find what it throws about. FRESNEL: what both lobes reflect depends on the angle (see fresnel).
# STRAIGHT_THROUGH: a thin sheet, of which a part of the light passes as if it were not there.
DIFFUSE, GLOSSY, SPECULAR, WIDE, FRESNEL, STRAIGHT_THROUGH = 1, 2, 4, 8, 16, 32
# alpha of a WIDE lobe. What a rough lobe throws onto other surfaces is found by rays that meet it, and shadow rays
# there, or by photons, with their blur. With roughness .08 (alpha .0066) rays have 7 times the error of photons, with
# .15 (.0225) 0.97 of it, without the bias of the picture's mean (members 1 and 0 of the family "rough" after 64 passes,
# with this at 0 and at infinity: `python -m tests.benchmarks.against_mitsuba --families rough --passes 64`).
_WIDE = 0.02
ALBEDO_NODES = 64
_ALBEDO_SAMPLES = 128  # per axis; quadrature error of the lobe's albedo about 1e-4
_LEAN_NODES, _KEPT_STEPS = 256, 128  # cosines between the normals, and steps per axis, of evaluate_diffuse's q


class LobeTable(NamedTuple):
    """The lobes of m materials.

    flags: (m,) uint8, the kinds of lobes that a material has, joined. specular: (m,) float32, share of the reflectance
    that the specular or glossy lobe takes; the diffuse lobe takes the rest. alpha: (m,) float32, GGX width, 0 for
    mirrors. albedo: (m, ALBEDO_NODES) float64, of the glossy lobe at cosines (i / (n - 1))^2; ones for mirrors.
    """

    flags: np.ndarray
    specular: np.ndarray
    alpha: np.ndarray
    albedo: np.ndarray


class Lobes(NamedTuple):
    """The lobes at one point of a surface; see LobeTable."""

    flags: int
    specular: float
    alpha: float


class LobeSample(NamedTuple):
    """A direction drawn from a lobe: unit vector away from the surface, and the weight f cos / density, with f the BRDF
    of the lobe for a reflectance of 1. The weight is 0 where the direction points into the surface."""

    direction: tuple[float, float, float]
    weight: float


def build_lobe_table(materials: tuple[Material, ...]) -> LobeTable:
    """The lobes of the materials."""
    alpha = np.array([material.alpha if material.specular > 0 else 0.0 for material in materials])
    specular = np.array([material.specular for material in materials], np.float32)
    sharp = np.where(alpha >= _WIDE, GLOSSY | WIDE, np.where(alpha > 0.0, GLOSSY, SPECULAR))
    flags = np.where(specular < 1.0, DIFFUSE, 0) | np.where(specular > 0.0, sharp, 0)
    flags |= np.where([material.follows_fresnel for material in materials], FRESNEL, 0)
    flags |= np.where([material.transmits for material in materials], STRAIGHT_THROUGH, 0)
    albedo = [ggx_albedo(float(width)) if width > 0.0 else np.ones(ALBEDO_NODES) for width in alpha]
    return LobeTable(flags.astype(np.uint8), specular, alpha.astype(np.float32), np.array(albedo))


def _kept(lean: np.ndarray) -> np.ndarray:
    """(n,) q of evaluate_diffuse, at cosines (n,) between the normals: by the midpoint rule, to 1e-4."""
    steps = (np.arange(_KEPT_STEPS) + 0.5) / _KEPT_STEPS
    received, around = np.sqrt(steps)[:, None], np.cos(np.pi * steps)  # even in received^2: cosine-distributed light
    mean = []
    for cosine in lean:
        shaded = np.maximum(cosine * received + np.sqrt((1.0 - cosine**2) * (1.0 - received**2)) * around, 1e-12)
        g = np.minimum(1.0, received / (shaded * max(cosine, 1e-12)))
        mean.append(np.mean(shaded / received * (g + g**2 - g**3)))
    return np.array(mean)


_KEPT = _kept(1.0 - (np.arange(_LEAN_NODES) / (_LEAN_NODES - 1.0)) ** 2)  # linear between nodes


@njit(**INLINED)
def lobes_of(table, material):
    """The Lobes of a material."""
    return Lobes(int(table.flags[material]), float(table.specular[material]), float(table.alpha[material]))


@njit(**INLINED)
def diffuse_share(lobes):
    """Share of the reflectance that the diffuse lobe takes."""
    return 1.0 - lobes.specular


@njit(**INLINED)
def is_glossy(lobes):
    """Whether there is a rough lobe."""
    return lobes.flags & GLOSSY != 0


@njit(**INLINED)
def is_angular(lobes):
    """Whether emission depends on the angle: with a rough lobe, or with Fresnel's law."""
    return lobes.flags & (GLOSSY | FRESNEL) != 0


@njit(**INLINED)
def follows_fresnel(lobes):
    """Whether what the lobes reflect depends on the angle by Fresnel's law."""
    return lobes.flags & FRESNEL != 0


@njit(**INLINED)
def facet_cosine(lobes, at, direction):
    """Cosine of the angle at which the specular lobe's facet reflects the ray of an Interaction in a unit direction."""
    if lobes.alpha == 0.0:
        return at.cosine
    return math.sqrt(max(0.0, 0.5 * (1.0 - dot(at.incoming, direction))))


@njit(**INLINED)
def is_wide(lobes):
    """Whether there is a rough lobe that is so wide that rays find what it throws about."""
    return lobes.flags & WIDE != 0


@njit(**INLINED)
def transmits(lobes):
    """Whether light passes straight through."""
    return lobes.flags & STRAIGHT_THROUGH != 0


@njit(**INLINED)
def is_specular(lobes):
    """Whether there is a specular lobe, sharp or rough."""
    return lobes.flags & (GLOSSY | SPECULAR) != 0


@njit(**INLINED)
def evaluate_diffuse(at, direction):
    """The diffuse BRDF at an Interaction for light from a unit direction, over that of a flat surface, 1 / pi.

    With n the normal, s the shading normal and w the direction it is s.w / n.w, as if the surface were turned, but
    less where this grows beyond bounds, at the edge of what the triangle can receive:

        s.w / n.w * (g + g^2 - g^3) / q,    g = min(1, n.w / (s.w s.n))

    (Chiang et al. 2019, "Taming the shadow terminator"). q makes up for what is taken: the mean over even light is 1.
    """
    if at.lean == 1.0:
        return 1.0
    received, shaded = dot(direction, at.normal), dot(direction, at.shading_normal)
    if received <= 0.0 or shaded <= 0.0:
        return 0.0
    position = math.sqrt(1.0 - at.lean) * (_LEAN_NODES - 1.0)
    i = min(int(position), _LEAN_NODES - 2)
    kept = _KEPT[i] + (position - i) * (_KEPT[i + 1] - _KEPT[i])
    g = min(1.0, received / (shaded * at.lean))
    return shaded / received * (g + g * g - g * g * g) / kept


@njit(**INLINED)
def sample_diffuse(normal, s, w):
    """Unit direction with density cos / pi around the normal, from two numbers in [0, 1)."""
    return to_world(cosine_direction(s, w), normal)


@njit(**INLINED)
def diffuse_density(normal, direction):
    """Density, sr^-1, with which sample_diffuse draws a unit direction."""
    return max(0.0, dot(normal, direction)) / math.pi


@njit(**INLINED)
def sample_specular(lobes, at, s, w):
    """The LobeSample of the specular or glossy lobe at an Interaction, from two numbers in [0, 1). What a smooth-shaded
    surface would reflect through its triangle goes along the triangle, or in a rough lobe back from it."""
    if lobes.alpha == 0.0:
        direction = mirrored(at.incoming, at.shading_normal, at.cosine)
        return LobeSample(direction if at.lean == 1.0 else _along(direction, at.normal), 1.0)
    local, weight = sample_ggx(_viewer(at), lobes.alpha, s, w)
    direction = to_world(local, at.shading_normal)
    below = dot(direction, at.normal)
    if at.lean < 1.0 and below < 0.0:
        direction = moved(direction, -2.0 * below, at.normal)
    return LobeSample(direction, weight)


@njit(**INLINED)
def adjoint(at, direction):
    """Factor on the weight of sample_specular for a photon, which travels the other way than a camera path. On a
    smooth-shaded surface it is (s.i n.o) / (n.i s.o), with i and o the directions, n and s the normals (Veach 1997, eq.
    5.19); 0 where no camera path could come from there."""
    if at.lean == 1.0:
        return 1.0
    out, shaded = dot(direction, at.normal), dot(direction, at.shading_normal)
    if out <= 0.0 or shaded <= 0.0:
        return 0.0
    return (at.cosine * out) / (at.geometric_cosine * shaded)


@njit(**INLINED)
def _along(direction, normal):
    """A unit direction, turned into the plane across the normal if it points below."""
    below = dot(direction, normal)
    if below >= 0.0:
        return direction
    flat = moved(direction, -below, normal)
    return scaled(flat, 1.0 / math.sqrt(max(dot(flat, flat), 1e-30)))


@njit(**INLINED)
def _viewer(at):
    """Local unit direction back along the ray of an Interaction, above the shading normal's horizon."""
    x, y, _ = to_local(at.incoming, at.shading_normal)
    if at.lean < 1.0:
        stretch = math.sqrt((1.0 - at.cosine * at.cosine) / max(x * x + y * y, 1e-30))
        x, y = stretch * x, stretch * y
    return -x, -y, at.cosine


@njit(**INLINED)
def evaluate_glossy(lobes, at, direction):
    """BRDF of the glossy lobe between the ray of an Interaction and a unit direction, sr^-1; 0 for mirrors, as a given
    direction never is exactly the mirrored one."""
    if lobes.alpha == 0.0:
        return 0.0
    local, viewer = to_local(direction, at.shading_normal), _viewer(at)
    if at.lean == 1.0:
        return evaluate_ggx(local, viewer, lobes.alpha)
    received = dot(direction, at.normal)
    if received <= 0.0:
        return 0.0
    back = to_local(moved(direction, -2.0 * received, at.normal), at.shading_normal)
    brdf = local[2] * evaluate_ggx(local, viewer, lobes.alpha) + back[2] * evaluate_ggx(back, viewer, lobes.alpha)
    return brdf / received


@njit(**INLINED)
def glossy_density(lobes, at, direction):
    """Density, sr^-1, with which sample_specular draws a unit direction from the glossy lobe; 0 for mirrors."""
    if lobes.alpha == 0.0:
        return 0.0
    local, viewer = to_local(direction, at.shading_normal), _viewer(at)
    if at.lean == 1.0:
        return ggx_density(viewer, local, lobes.alpha)
    received = dot(direction, at.normal)
    if received <= 0.0:
        return 0.0
    back = to_local(moved(direction, -2.0 * received, at.normal), at.shading_normal)
    return ggx_density(viewer, local, lobes.alpha) + ggx_density(viewer, back, lobes.alpha)


@njit(**INLINED)
def mirrored(incoming, normal, cosine):
    """Direction of a ray after reflection in a mirror. cosine: > 0, between the reversed ray and the normal."""
    twice = 2.0 * cosine
    return incoming[0] + twice * normal[0], incoming[1] + twice * normal[1], incoming[2] + twice * normal[2]


@njit(**INLINED)
def emitted_complement(table, material, cosine):
    """Share of the reflectance that the lobes lose at a cosine. It is emitted: eps(theta) = eps + rho times this share.
    0 for diffuse lobes and mirrors, which lose nothing."""
    if table.alpha[material] == 0.0:
        return 0.0
    return table.specular[material] * (1.0 - interpolate_albedo(table.albedo, material, cosine))


# The GGX lobe --------------------------------------------------------------------------------------------------------


@njit(**INLINED)
def _lambda(alpha, z):
    """Smith's auxiliary function of GGX for a direction with cosine z > 0 (Heitz 2014, eq. 72)."""
    tan2 = max(0.0, 1.0 - z * z) / (z * z)
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * tan2) - 1.0)


@njit(**INLINED)
def sample_ggx(local, alpha, u, v):
    """Reflect a local direction, z > 0, at a microfacet of the GGX normals visible from it (Heitz 2018).

    Returns local direction and weight f cos / pdf = G2 / G1 <= 1; weight 0 where the facet points into the surface.
    """
    x, y, z = local
    # stretch to the hemisphere configuration
    hx, hy, hz = alpha * x, alpha * y, z
    inverse = 1.0 / math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx * inverse, hy * inverse, hz * inverse
    square = hx * hx + hy * hy
    if square > 1e-24:
        inverse = 1.0 / math.sqrt(square)
        ax, ay = -hy * inverse, hx * inverse
    else:
        ax, ay = 1.0, 0.0
    bx, by, bz = -hz * ay, hz * ax, hx * ay - hy * ax
    r = math.sqrt(u)
    c, s = turn(v)
    p, q = r * c, r * s
    s = 0.5 * (1.0 + hz)
    q = (1.0 - s) * math.sqrt(max(0.0, 1.0 - p * p)) + s * q
    n = math.sqrt(max(0.0, 1.0 - p * p - q * q))
    mx, my, mz = p * ax + q * bx + n * hx, p * ay + q * by + n * hy, q * bz + n * hz
    mx, my, mz = alpha * mx, alpha * my, max(1e-12, mz)
    inverse = 1.0 / math.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = mx * inverse, my * inverse, mz * inverse
    twice = 2.0 * (x * mx + y * my + z * mz)
    ox, oy, oz = twice * mx - x, twice * my - y, twice * mz - z
    if oz <= 1e-9:
        return (ox, oy, oz), 0.0
    lambda_in = _lambda(alpha, z)
    return (ox, oy, oz), (1.0 + lambda_in) / (1.0 + lambda_in + _lambda(alpha, oz))


@njit(**INLINED)
def evaluate_ggx(incoming, outgoing, alpha):
    """GGX BRDF without Fresnel factor, sr^-1, for two local directions: D G2 / (4 cos cos)."""
    (ix, iy, iz), (ox, oy, oz) = incoming, outgoing
    if iz <= 1e-9 or oz <= 1e-9:
        return 0.0
    mx, my, mz = ix + ox, iy + oy, iz + oz
    square = mx * mx + my * my + mz * mz
    cos2 = mz * mz / square
    alpha2 = alpha * alpha
    d = cos2 * (alpha2 - 1.0) + 1.0
    return alpha2 / (math.pi * d * d * (1.0 + _lambda(alpha, iz) + _lambda(alpha, oz)) * 4.0 * iz * oz)


@njit(**INLINED)
def ggx_density(incoming, outgoing, alpha):
    """Density, sr^-1, with which sample_ggx draws the outgoing for an incoming local direction: G1 D / (4 cos), cos of
    the incoming direction (Heitz 2018, eq. 17)."""
    (ix, iy, iz), (ox, oy, oz) = incoming, outgoing
    if iz <= 1e-9 or oz <= 1e-9:
        return 0.0
    mx, my, mz = ix + ox, iy + oy, iz + oz
    cos2 = mz * mz / (mx * mx + my * my + mz * mz)
    alpha2 = alpha * alpha
    d = cos2 * (alpha2 - 1.0) + 1.0
    return alpha2 / (math.pi * d * d * (1.0 + _lambda(alpha, iz)) * 4.0 * iz)


@lru_cache(maxsize=256)
def ggx_albedo(alpha: float) -> np.ndarray:
    """(ALBEDO_NODES,) float64 albedo of the GGX lobe of this width, see LobeTable; error about 1e-4."""
    return _ggx_albedo(alpha, _ALBEDO_SAMPLES)


@njit(cache=True, nogil=True)
def _ggx_albedo(alpha, samples):
    """Albedo of the GGX lobe, (ALBEDO_NODES,) float64, at cosines (i / (n - 1))^2: the mean weight of sample_ggx.

    It is below 1 where facets shadow each other; the surface emits what the lobe loses. samples: per axis.
    """
    albedo = np.empty(ALBEDO_NODES)
    for i in range(ALBEDO_NODES):
        z = max(1e-4, (i / (ALBEDO_NODES - 1.0)) ** 2)
        x = math.sqrt(max(0.0, 1.0 - z * z))
        total = 0.0
        for j in range(samples):
            g = 1.0 - (j + 0.5) / samples  # u = 1 - g^2: dense where facets stand steep and most is lost
            for k in range(samples):
                total += 2.0 * g * sample_ggx((x, 0.0, z), alpha, 1.0 - g * g, (k + 0.5) / samples)[1]
        albedo[i] = total / (samples * samples)
    return albedo


@njit(**INLINED)
def interpolate_albedo(albedo, row, cosine):
    """Lobe albedo of a material (row of the table) at a cosine, linear between the nodes."""
    position = math.sqrt(min(1.0, max(0.0, cosine))) * (ALBEDO_NODES - 1.0)
    i = min(int(position), ALBEDO_NODES - 2)
    t = position - i
    return (1.0 - t) * albedo[row, i] + t * albedo[row, i + 1]
