# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with gas whose radiance is known, for tests/benchmarks/gas_values.py.

What an image tells is a weighted mean of its pixels' radiance over a scale, such as a share of a blackbody's radiance.
Radiance that falls onto a plane is read off a probe: a small white plate, as bright as the light that falls on it is in
the mean over the cosine. Truths: E_n are exponential integrals (Modest, Radiative Heat Transfer, chapters 10, 14);
numbers of scattering slabs are solutions of the transport equation for isotropic scattering, to the digits that stand
here; H is Chandrasekhar's.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.special import expn

from addon.solver import Camera, Grid, Material, Medium, Scene
from addon.solver.physics.spectrum import apparent_temperature
from tests.helpers.exact_cases import ALL, NARROW, SIGMA, blackbody
from tests.helpers.grids import placed
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

MIRROR, BLACK, WHITE = Material("mirror", 0.0, 1.0), Material("black", 1.0), Material("probe", 0.0)
HOT = 400.0  # K, of what shines where nothing else does
WIDTH, HEIGHT = 64, 48  # of images of gas that scatters: only camera rays tell of it
FEW = 24, 18  # pixels of images of surfaces, each of which sends many rays
_PROBE, _GAP = 1e-3, 0.02  # m, half the width of a probe, and how far from it the camera is
_CELLS = 64
PHOTONS = {"photons_per_pass": 10_000}  # where surfaces that reflect light each other


@dataclass(frozen=True)
class GasCase:
    """scene; truth: of the image's value, the sum over pixels of weights (height, width) times radiance, over scale (W
    m-2 sr-1). weights: None is the mean. settings: of the render. tolerance: relative, of what is not noise."""

    name: str
    scene: Scene
    truth: float
    scale: float
    weights: np.ndarray | None = None
    settings: dict = field(default_factory=dict)
    tolerance: float = 1e-5


def black(kelvin, edges=NARROW):
    return float(blackbody(edges, kelvin)[0])


def slab(low, high, *coefficients):
    """A Medium between two heights, wider than the mirrors around. coefficients: as of Medium, from absorption on."""
    vertices, triangles = box((2.0, 2.0, high - low))
    return Medium("gas", *coefficients, vertices=vertices + (-0.5, -0.5, low), triangles=triangles)


def endless(media, camera, height=1.2, below=0.0, probe=None, edges=NARROW, **options):
    """A layer between black plates at z = 0, of so many K, and z = height, of 0 K, made endless by mirrors around 1 m
    of it. probe: its height, and 1 if it looks up, -1 if down."""
    vertices, triangles = box((1.0, 1.0, height))
    parts = [(vertices, triangles[:8, ::-1], 0.0, 0), (vertices, triangles[8:10, ::-1], below, 1)]
    parts.append((vertices, triangles[10:, ::-1], 0.0, 1))
    if probe is not None:
        parts.append((*small_plate(0.5, 0.5, *probe), 0.0, 2))
    vertices, triangles, temperature, material = join(*parts)
    return make_scene(
        vertices, triangles, temperature, [MIRROR, BLACK, WHITE], camera, edges, material, media=media, **options
    )


def small_plate(x, y, z, up):
    return quad((x, y, z), (_PROBE, 0, 0), (0, up * _PROBE, 0))


def at_probe(x, y, z, up):
    """A camera that sees a probe and nothing else."""
    return look((x, y, z + up * _GAP), (x, y, z), *FEW, 0.5 * _PROBE / _GAP)


def straight_down(height):
    return look((0.5, 0.5, height), (0.5, 0.5, 0.0), WIDTH, HEIGHT, 1e-3)


# Clear gas


def isothermal_room(**settings):
    """Grey, mirror and rough walls, air and a plume that scatter, all at one temperature: a blackbody."""
    vertices, triangles = box((2.0, 3.0, 2.5))
    materials = [Material("grey", 0.3), Material("mirror", 0.2, 1.0), Material("rough", 0.4, 0.7, 0.4)]
    inner, faces = box((1.0, 1.0, 1.8))
    plume = Medium("plume", 1.0, 350.0, 2.0, -0.3, vertices=inner + (0.5, 1, 0.2), triangles=faces)
    scene = make_scene(
        vertices, triangles[:, ::-1], 350.0, materials, look((1, 0.2, 1.2), (1, 3, 1), 32, 24, 0.6), NARROW,
        np.repeat([0, 1, 2, 0, 0, 0], 2), world_depth=5.0, media=(Medium("air", 0.1, 350.0, 0.3, 0.5), plume),
    )  # fmt: skip
    name = {"reference_subtraction": "without subtraction", "reference_temperature": "T0 of 400 K"}
    how = ", ".join(name[key] for key in settings) or "with subtraction"
    return GasCase(f"room of one temperature, {how}", scene, 1.0, black(350.0), settings=PHOTONS | settings)


def normal_emissivity(tau):
    """1 - exp(-tau)."""
    scene = endless((slab(0.1, 1.1, tau, HOT),), straight_down(1.15))
    return GasCase(f"slab, tau {tau:g}: normal emissivity", scene, -math.expm1(-tau), black(HOT))


def hemispherical_emissivity(tau):
    """1 - 2 E3(tau)."""
    scene = endless((slab(0.1, 1.1, tau, HOT),), at_probe(0.5, 0.5, 0.05, 1), probe=(0.05, 1))
    truth = 1.0 - 2.0 * float(expn(3, tau))
    return GasCase(f"slab, tau {tau:g}: hemispherical emissivity", scene, truth, black(HOT))


def slab_flux(tau):
    """sigma T^4 (1 - 2 E3(tau)) of a slab whose sigma T^4 is 148.9709 kW/m2."""
    kelvin = (148970.9 / SIGMA) ** 0.25
    scene = endless((slab(0.1, 1.1, tau, kelvin),), at_probe(0.5, 0.5, 0.05, 1), probe=(0.05, 1), edges=ALL)
    truth = 148.9709 * (1.0 - 2.0 * float(expn(3, tau)))
    return GasCase(f"slab, tau {tau:g}: flux, kW/m2", scene, truth, 1e3 / math.pi)


def ball_on_its_wall(t):
    """A ball of gas, of an optical diameter t, shines 1 - (2/t^2) (1 - (1 + t) exp(-t)) onto its wall. A camera just
    above the probe sees it through a little gas."""
    vertices, triangles = round_mesh()
    z = -0.5 + 1e-4  # m, no facet of the ball lies further inwards
    scene = make_scene(
        *small_plate(0.0, 0.0, z, 1), 0.0, [WHITE], at_probe(0.0, 0.0, z, 1), NARROW,
        media=(Medium("gas", t, HOT, vertices=vertices, triangles=triangles),),
    )  # fmt: skip
    truth = ball_emissivity(t) * math.exp(-t * _GAP) - math.expm1(-t * _GAP)
    return GasCase(f"ball of gas, k D {t:g}: onto its wall", scene, truth, black(HOT), tolerance=2e-4)


def ball_emissivity(t):
    """In the mean over the cosine."""
    return 1.0 - 2.0 / t**2 * (1.0 - (1.0 + t) * math.exp(-t))


def round_mesh():
    """A sphere of 1 m whose facets lie at the right distance in the mean."""
    vertices, triangles = sphere(5, 0.5)
    return vertices * (0.5 / np.linalg.norm(vertices[triangles].mean(axis=1), axis=1).mean()), triangles


def full_sphere(along_diameter):
    """A diffuse sphere (e .5, B 1) full of gas (B 2, k D 1): J = [e Bw + (1-e) eg Bg] / [1 - (1-e) (1-eg)]."""
    vertices, triangles = round_mesh()
    kelvin = apparent_temperature(np.array([2.0 * black(350.0)]), NARROW)[0]
    near = 0.5 - 1e-3
    camera = look((0, 0, -near if along_diameter else near), (0, 0, 1), *FEW, 0.05)
    scene = make_scene(
        vertices, triangles[:, ::-1], 350.0, [Material("wall", 0.5)], camera, NARROW,
        media=(Medium("gas", 1.0, kelvin),), world_depth=1.0,
    )  # fmt: skip
    of_gas = ball_emissivity(1.0)
    radiosity = (0.5 + 0.5 * of_gas * 2.0) / (1.0 - 0.5 * (1.0 - of_gas))
    way = 0.5 + near if along_diameter else 0.5 - near
    truth = radiosity * math.exp(-way) - 2.0 * math.expm1(-way)
    name = "along the diameter" if along_diameter else "at the wall"
    return GasCase(f"grey sphere full of gas: {name}", scene, truth, black(350.0), settings=PHOTONS, tolerance=5e-4)


def plates_with_mirrors(side):
    """Plates of 400 K (e .8) and 300 K (e .4), gas of 600 K and tau .2 between them, mirrors around, at 10 um: J over
    pi, W m-2 sr-1 um-1, J the radiosity. 2 E3(tau) gets through."""
    through, gas = 2.0 * float(expn(3, 0.2)), black(600.0)
    plates = (0.8, black(400.0)), (0.4, black(300.0))
    matrix = np.array([[1.0, -(1 - plates[0][0]) * through], [-(1 - plates[1][0]) * through, 1.0]])
    radiosity = np.linalg.solve(matrix, [e * of + (1 - e) * gas * (1 - through) for e, of in plates])
    vertices, triangles = box((1.0, 1.0, 1.0))
    way = 1e-4
    scene = make_scene(
        vertices, triangles[:, ::-1], np.repeat([300.0] * 4 + [400.0, 300.0], 2),
        [MIRROR, Material("hot", 0.8), Material("cold", 0.4)],
        look((0.5, 0.5, abs(side - way)), (0.5, 0.5, side), *FEW, 0.2), NARROW,
        np.repeat([0, 0, 0, 0, 1, 2], 2), media=(Medium("gas", 0.2, 600.0),), world_depth=1.0,
    )  # fmt: skip
    truth = (radiosity[side] * math.exp(-0.2 * way) - gas * math.expm1(-0.2 * way)) / 0.02
    return GasCase(
        f"plates, mirrors, gas: J / pi of the {('first', 'second')[side]}", scene, truth, 0.02, settings=PHOTONS
    )


def linear_radiance(tau):
    """Blackbody radiance from 2 (near) to 1 (far), in cells: 1 + tau-weighted mean, 2 - exp(-tau) - (1 - (1 + tau)
    exp(-tau)) / tau."""
    z = (np.arange(_CELLS) + 0.5) / _CELLS
    kelvin = apparent_temperature(black(HOT) * (1.0 + z), NARROW)
    grid = Grid.from_arrays(placed((-0.5, -0.5, 0.1), (1.5, 1.5, 1.1), (1, 1, _CELLS)), temperature=kelvin[None, None])
    scene = endless((Medium("gas", tau, grid=grid),), straight_down(1.15))
    truth = -2.0 * math.expm1(-tau) - (1.0 - (1.0 + tau) * math.exp(-tau)) / tau
    return GasCase(f"linear blackbody radiance, tau {tau:g}", scene, truth, black(HOT), tolerance=4e-5)


def cube_of_burns_and_christon(x):
    """Absorption 0.9 (1 - 2|x|) (1 - 2|y|) (1 - 2|z|) + 0.1 in a cold black cube of 1 m, gas of one temperature (Burns
    and Christon, Numerical Heat Transfer B 31, 1997): mean radiance at (x, 0, 0), by a quadrature over all rays."""
    # where absorption has its ridges, cells are too low by their width: 64 on a side are off by 0.18 %, 160 by 0.03 %
    low = [np.linspace(-0.5, 0.5, 161)] * 3
    mean = [1.0 - np.abs(edges[1:] + edges[:-1]) for edges in low]  # exact in cells, as kinks lie between two
    density = 0.9 * mean[0][:, None, None] * mean[1][:, None] * mean[2] + 0.1
    grid = Grid.from_arrays(placed((-0.5,) * 3, (0.5,) * 3, density.shape), density)
    vertices, triangles = box((1.0, 1.0, 1.0))
    camera, weights = all_around((x, 0.0, 0.0))
    scene = make_scene(
        vertices - 0.5, triangles[:, ::-1], 0.0, [BLACK], camera, NARROW, media=(Medium("gas", 1.0, HOT, grid=grid),)
    )
    name = f"Burns and Christon's cube, x = {x:g} m: mean radiance"
    return GasCase(name, scene, mean_from_all_sides(x), black(HOT), weights, tolerance=5e-4)


def mean_from_all_sides(x, latitudes=64, steps=400):
    """Mean over directions of 1 - exp(-tau) from (x, 0, 0) in that cube (Gauss and Legendre; midpoints along rays)."""
    height, weight = np.polynomial.legendre.leggauss(latitudes)
    turn = 2 * np.pi * (np.arange(4 * latitudes) + 0.5) / (4 * latitudes)
    across = np.sqrt(1.0 - height**2)[:, None]
    direction = np.stack(np.broadcast_arrays(across * np.cos(turn), across * np.sin(turn), height[:, None]), axis=-1)
    origin = np.array([x, 0.0, 0.0])
    way = np.min((0.5 - np.sign(direction) * origin) / np.abs(direction), axis=-1)
    at = (np.arange(steps) + 0.5) / steps
    depth = sum(0.9 * np.prod(1.0 - 2.0 * np.abs(origin + s * way[..., None] * direction), axis=-1) + 0.1 for s in at)
    return float(np.sum(weight * -np.expm1(-depth * way / steps).mean(axis=1)) / 2.0)


# Scattering


def scattered(omega, tau, kelvin=0.0, low=0.1):
    return slab(low, low + 1.0, (1.0 - omega) * tau, kelvin, omega * tau)


def reflectance(omega, tau, truth):
    """Of a slab for diffuse light."""
    scene = endless((scattered(omega, tau),), at_probe(0.5, 0.5, 0.05, 1), below=HOT, probe=(0.05, 1))
    return GasCase(f"scattering slab, albedo {omega:g}, tau {tau:g}: reflectance", scene, truth, black(HOT))


def transmittance(omega, tau, truth):
    """Of a slab for diffuse light."""
    scene = endless((scattered(omega, tau),), at_probe(0.5, 0.5, 1.15, -1), below=HOT, probe=(1.15, -1))
    return GasCase(f"scattering slab, albedo {omega:g}, tau {tau:g}: transmittance", scene, truth, black(HOT))


def normal_transmitted(omega, tau, truth):
    """Radiance at a right angle behind a slab that diffuse light falls on."""
    scene = endless((scattered(omega, tau),), straight_down(1.15), below=HOT)
    name = f"scattering slab, albedo {omega:g}, tau {tau:g}: normal radiance let through"
    return GasCase(name, scene, truth, black(HOT))


def scattering_emissivity(omega, tau, truth):
    """Normal emissivity of a slab that scatters; sqrt(1 - omega) H(1) of a half-space."""
    scene = endless((scattered(omega, tau, HOT),), straight_down(1.15))
    name = f"scattering slab, albedo {omega:g}, tau {tau:g}: normal emissivity"
    return GasCase(name, scene, truth, black(HOT))


def scattering_box(sides, anisotropy, is_duct=False):
    """One black face of a box of pure scattering shines: the mean radiance in the middle is one over the number of
    faces, by symmetry and superposition, whatever the phase function. Of a duct two faces are mirrors."""
    vertices, triangles = box((1.0, 1.0, 1.0))
    camera, weights = all_around((0.5, 0.5, 0.5))
    scene = make_scene(
        vertices, triangles[:, ::-1], np.repeat([HOT, 0.0, 0.0, 0.0, 0.0, 0.0], 2), [BLACK, MIRROR], camera, NARROW,
        np.repeat([0, 0, 0, 0, *(2 * [int(is_duct)])], 2), world_depth=1.0,
        media=(Medium("fog", 0.0, 0.0, 2.0, anisotropy),),
    )  # fmt: skip
    name = f"{'duct' if is_duct else 'cube'} of pure scattering, g = {anisotropy:g}: mean radiance in the middle"
    return GasCase(name, scene, 1.0 / sides, black(HOT), weights, tolerance=2e-4)


def all_around(position):
    """A panorama, and the share of the sphere that each pixel covers. Rays are even in latitude within a pixel, not on
    the sphere: with 64 rows that is off by 1e-4 of the differences between rows."""
    width, height = 128, 64
    matrix = look(position, np.add(position, (0.0, 1.0, 0.0))).matrix
    camera = Camera(width, height, matrix, "PANORAMA", (-np.pi, np.pi, -0.5 * np.pi, 0.5 * np.pi))
    share = np.diff(np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, height + 1))) / (2.0 * width)
    return camera, np.broadcast_to(share[:, None], (height, width))


def gas_cases():
    """All cases."""
    cases = []
    for tau in (0.1, 1.0):
        cases += [normal_emissivity(tau), hemispherical_emissivity(tau)]
    cases += [slab_flux(tau) for tau in (0.01, 0.1, 0.5, 1.0, 10.0)]
    cases += [ball_on_its_wall(0.5), ball_on_its_wall(1.0), full_sphere(False), full_sphere(True)]
    cases += [plates_with_mirrors(0), plates_with_mirrors(1), *(linear_radiance(tau) for tau in (0.5, 1.0, 2.0))]
    cases += [cube_of_burns_and_christon(0.0), cube_of_burns_and_christon(0.4)]
    for omega, *truths in (
        (1.0, 0.446594, 0.553406, 0.658671),
        (0.9, 0.352712, 0.474746, 0.591625),
        (0.5, 0.134165, 0.306709, 0.446058),
    ):
        of = reflectance, transmittance, normal_transmitted
        cases += [build(omega, 1.0, truth) for build, truth in zip(of, truths, strict=True)]
    emissivities = (0.9, 1.0, 0.140965), (0.5, 1.0, 0.454822), (0.5, 40.0, 0.884774), (0.9, 40.0, 0.585053)
    cases += [scattering_emissivity(*each) for each in emissivities]
    cases += [scattering_box(4, 0.0, is_duct=True), *(scattering_box(6, g) for g in (0.0, 0.8, -0.5))]
    rooms = {}, {"reference_subtraction": False}, {"reference_temperature": 400.0}
    return cases + [isothermal_room(**each) for each in rooms]
