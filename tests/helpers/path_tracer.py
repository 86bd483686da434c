# SPDX-License-Identifier: GPL-3.0-or-later
"""A plain path tracer, slow and hard to get wrong, as a reference for any scene of surfaces, surroundings, lights with
an extent and grey gas.

Paths start in the camera and run until roulette ends them. There are no shadow rays, no cache, no guide, and no code of
the solver but its data classes: Planck's law is that of exact_cases.py, rough lobes are drawn by another method. It
traces the excess over an isothermal scene at T0 (docs/method.md, section 3). The samples of a pixel and batch spread
evenly up to their first bounce (Sobol' points, scrambled in each batch and shifted in each pixel). Both change the
noise alone.

What a rough lobe loses is emitted instead. The lobe's albedo is the mean weight of its samples, so a sample of weight w
lets the surface emit 1 - w of a blackbody: no table of albedos is needed, and without roulette every single path in an
isothermal enclosure brings exactly the blackbody's radiance.

Under Fresnel's law the facets that a sample meets reflect by their angle, and the diffuse lobe gets what others, drawn
anew, let through on the way in and on the way out: so no table of albedos is needed there, either.

A thin sheet lets a path pass straight on, or reflects it, in proportion to what it transmits and reflects. A mixed
material is one of its two, by chance. Neither is told apart in the kinds of paths.

Along a ray all distances are known at which gas may change: where it crosses a mesh or a plane between cells of a grid.
Between two of them everything is constant, and what is there is asked in the middle. A path collects what gas emits on
its way and loses what it absorbs, both exactly; where it is scattered is drawn.
"""

import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numba
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scipy.stats import qmc

from addon.solver import SunLight
from addon.solver.scene import Hidden
from tests.helpers.compiled import COMPILED
from tests.helpers.exact_cases import C1, C2, blackbody
from tests.helpers.traced_gas import Bodies, Gas, build_gas, check_gas
from tests.helpers.traced_lights import Lights, build_lights, light_met
from tests.helpers.traced_textures import Painted, build_painted, kelvin_at, mixed_at

LOBES = "DGS"  # diffuse, glossy (a rough lobe), specular (a mirror)
KIND_LENGTH = 4  # lobes that are told apart in a path
LONGER = "longer"
_CODES = 4**KIND_LENGTH + 1  # base 4, a digit for each lobe from the eye on; the last is for all longer paths
_WAVE = 2**17  # paths that are followed together
_NODES = 32  # of Planck's law in a band, where the temperature runs over a triangle
_CLEARANCE = 1e-6  # of the scene's size, by which a ray leaves a surface: some 16 roundings of float32
_ROULETTE_FROM = 4  # bounces that no path is ended before
_MOST_SURVIVE = 0.98
# random numbers of a bounce: lobe or medium, direction (2), roulette, free path in gas, facets (4), sheet, mixture
_UNIFORMS = 11
_COATINGS = 200_000  # samples of what gets through a rough lobe, in the mean of all directions


class _Tables(NamedTuple):
    """corners (m, 3, 3) m and normal (m, 3) of triangles; material (m,). black (m, b): radiance of a blackbody at their
    temperature less that at T0. kelvin (m, 3), varies (m,) bool: where it is to be taken at the point instead, with
    wavelength (b, n) um and weight (b, n) of Planck's law, and at_reference (b,). emissivity, transmittance (k, b),
    specular (k,), alpha (k,) of materials. fresnel (k,) bool, whether the specular lobe follows Fresnel's law: with
    face (k, b), complex, the index, and share (k,), a factor on what a face reflects; beneath (k, b), what the body
    below reflects, over the mean (k, b) of what gets through the lobe. world (rows, columns, b) excess radiance of the
    surroundings, an equirectangular image whose first row is the lowest. clearance: m. painted: textures. lights: see
    there.
    """

    corners: np.ndarray
    normal: np.ndarray
    material: np.ndarray
    black: np.ndarray
    kelvin: np.ndarray
    varies: np.ndarray
    wavelength: np.ndarray
    weight: np.ndarray
    at_reference: np.ndarray
    emissivity: np.ndarray
    transmittance: np.ndarray
    specular: np.ndarray
    alpha: np.ndarray
    fresnel: np.ndarray
    face: np.ndarray
    share: np.ndarray
    beneath: np.ndarray
    world: np.ndarray
    clearance: float
    gas: Gas
    painted: Painted
    lights: Lights


class _Paths(NamedTuple):
    """n paths: pixel (n,), origin and direction (n, 3), throughput (n, b), kind (n,): code of the lobes so far, bounces
    (n,); unseen (n,): whether they have met nothing but mirrors, in which lights are not seen; lobe (n,): the last one,
    0 for those straight from the camera, else 1, 2, 3: D, G, S."""

    pixel: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    throughput: np.ndarray
    kind: np.ndarray
    bounces: np.ndarray
    unseen: np.ndarray
    lobe: np.ndarray


@dataclass
class PathTraced:
    """images (batches, height, width, b): independent images of the mean excess radiance over a blackbody at
    `reference` (K), W m-2 sr-1, row 0 the bottom. kinds (batches, codes, height, width): the same over all bands by
    kinds of paths, no codes if they were not asked for.
    """

    images: np.ndarray
    edges: np.ndarray
    reference: float
    kinds: np.ndarray = field(repr=False)

    def excess(self) -> np.ndarray:
        """(height, width, b) mean of the excess radiance, W m-2 sr-1."""
        return self.images.mean(axis=0)

    def standard_error(self) -> np.ndarray:
        """(height, width, b) standard error of `excess`, of the spread of the batches."""
        return standard_error(self.images)

    def radiance(self) -> np.ndarray:
        """(height, width, b) mean radiance, W m-2 sr-1."""
        return self.excess() + black_radiance(self.edges, self.reference)

    def excess_kelvin(self) -> tuple[np.ndarray, np.ndarray]:
        """Excess of all bands together over dB/dT at the reference, and its standard error, (height, width) each, K."""
        kelvin = self.images.sum(axis=-1) / black_slope(self.edges, self.reference)
        return kelvin.mean(axis=0), standard_error(kelvin)

    def by_kind(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Mean excess radiance of all bands and its standard error, (height, width) each, of every kind of path that
        brought any: the lobes from the eye on, such as "DS"; "" is what is seen directly, LONGER all other paths."""
        codes = np.flatnonzero(np.any(self.kinds, axis=(0, 2, 3)))
        return {kind_name(c): (self.kinds[:, c].mean(axis=0), standard_error(self.kinds[:, c])) for c in codes}


def standard_error(samples):
    """Of the mean over the first axis of independent samples."""
    return samples.std(axis=0, ddof=1) / np.sqrt(len(samples))


def black_radiance(edges, kelvin):
    """exact_cases.blackbody, s + (b,), where temperatures of shape s may be 0 K."""
    kelvin = np.asarray(kelvin, float)
    return np.where(kelvin[..., None] > 0, blackbody(edges, np.maximum(kelvin, 1.0)), 0.0)


def black_slope(edges, kelvin):
    """dB/dT of all bands together, W m-2 sr-1 K-1."""
    step = 1e-3 * kelvin
    return np.diff(black_radiance(edges, np.array([kelvin - step, kelvin + step])).sum(axis=-1))[0] / (2 * step)


def kind_name(code):
    """Lobes from the eye on of a code of _Paths.kind."""
    if code == _CODES - 1:
        return LONGER
    digits = itertools.takewhile(bool, (code // 4**i for i in range(KIND_LENGTH)))
    return "".join(LOBES[digit % 4 - 1] for digit in digits)[::-1]


def trace_paths(scene, samples, batches=16, seed=0, first_batch=0, threads=1, reference=None, kinds=False):
    """PathTraced of a Scene with so many samples of every pixel in each of the batches.

    A batch depends on seed and its index alone, so that renders can be continued and shared. Emissivities are constant
    within each band, which makes one reflectance exact. reference: T0, K; that of the surroundings if it is None.
    """
    _check(scene)
    reference = float(scene.world_temperature if reference is None else reference)
    centre = 0.5 * (np.min(scene.vertices, axis=0) + np.max(scene.vertices, axis=0))
    tables = _tables(scene, reference, centre)
    corners = tables.corners.astype(np.float32)
    tracers = _Sights(corners, scene.hidden), Bodies(scene.media, centre, np.abs(corners).max())

    def trace(index):
        return _batch(scene.camera, centre, tables, tracers, samples, np.random.default_rng((seed, index)), kinds)

    with ThreadPoolExecutor(threads) as pool:
        images, tallies = zip(*pool.map(trace, range(first_batch, first_batch + batches)), strict=True)
    return PathTraced(np.array(images), np.asarray(scene.band_edges), reference, np.array(tallies))


class _Sights:
    """What paths see, by their last lobe: surfaces that are not hidden from them (scene.Hidden). Lights are seen past
    others."""

    def __init__(self, corners, hidden):
        """corners: (m, 3, 3) float32. hidden: see Scene."""
        flags = 0, Hidden.CAMERA, Hidden.DIFFUSE, Hidden.GLOSSY, Hidden.LIGHTS
        seen = [
            np.flatnonzero((0 if hidden is None else hidden) & flag == np.zeros(len(corners), int)) for flag in flags
        ]
        self.hides, self._seen, self._scenes = hidden is not None, seen, [EmbreeScene() for _ in seen]
        for scene, part in zip(self._scenes, seen, strict=True):
            points = corners[part].reshape(-1, 3)
            if len(part):
                TriangleMesh(scene, points, np.arange(len(points), dtype=np.int32).reshape(-1, 3))
            # builds the tree before threads need it
            scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def hits(self, paths):
        """triangle, u, v, distance (n,) of what paths meet, and how far (n,) they would get on the way to a light."""
        origin, direction = paths.origin.astype(np.float32), paths.direction.astype(np.float32)
        if not self.hides:
            found = self._run(0, origin, direction)
            return *found, found[3]
        found = np.empty(len(origin), np.int64), *np.empty((3, len(origin)))
        for scene, lobes in ((1, (0,)), (2, (1,)), (3, (2, 3))):
            rows = np.flatnonzero(np.isin(paths.lobe, lobes))
            for column, values in zip(found, self._run(scene, origin[rows], direction[rows]), strict=True):
                column[rows] = values
        lit = self._run(4, origin, direction)
        return *found, np.where(lit[0] < 0, np.inf, lit[3])

    def _run(self, number, origin, direction):
        hits, part = self._scenes[number].run(origin, direction, output=True), np.append(self._seen[number], -1)
        return part[hits["primID"]], hits["u"], hits["v"], hits["tfar"]


def _check(scene):
    if scene.groups or scene.response is not None:
        raise ValueError("Groups and responses are not traced")
    if any(isinstance(light, SunLight) for light in scene.lights) and any(m.outline is None for m in scene.media):
        raise ValueError("Suns are not traced through gas of the world")
    if scene.corner_normals is not None or (scene.sky is not None and scene.sky.zenith is not None):
        raise ValueError("Smooth shading and skies by angle are not traced")
    check_gas(scene.media)
    camera = scene.camera
    if camera.kind == "PANORAMA" or camera.lens_radius or camera.window or camera.clip != (0.0, np.inf):
        raise ValueError("Only whole pictures of pinhole and orthographic cameras without clipping are traced")


def _tables(scene, reference, centre):
    edges = np.asarray(scene.band_edges, float)
    corners = (np.asarray(scene.vertices, float) - centre)[scene.triangles].astype(np.float32).astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    kelvin = np.asarray(scene.temperature, float)
    kelvin = kelvin if kelvin.ndim == 2 else np.repeat(kelvin[:, None], 3, axis=1)
    unique, index = np.unique(kelvin[:, 0], return_inverse=True)
    at_reference = black_radiance(edges, reference)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    log = np.log(edges)[:, None]
    wavelength = np.exp(log[:-1] + np.diff(log, axis=0) * (nodes + 1) / 2)
    materials = scene.materials
    surroundings = np.full((1, 1), scene.world_temperature) if scene.sky is None else scene.sky.kelvin

    def excess(kelvin):
        return black_radiance(edges, kelvin) - at_reference

    world = excess(surroundings)
    return _Tables(
        corners,
        normal,
        np.asarray(scene.material, np.int64),
        excess(unique)[index.ravel()],
        kelvin,
        np.ptp(kelvin, axis=1) > 0,
        wavelength,
        C1 / wavelength**4 * weights * np.diff(log, axis=0) / 2,
        at_reference,
        np.array([_in_bands(material.curve, material, edges) for material in materials]),
        np.array([_in_bands(material.transmitted_curve, material, edges) for material in materials]),
        np.array([material.specular for material in materials], float),
        np.array([material.alpha for material in materials], float),
        *_coatings(materials, edges),
        world,
        _CLEARANCE * np.abs(corners).max(),
        build_gas(scene.media, scene.world_depth, centre, world[0, 0], excess),
        build_painted(scene.textures, len(scene.triangles)),
        build_lights(scene.lights, edges, centre),
    )


def _in_bands(curve, material, edges):
    """(b,) values of a curve of a material, which must be constant within each band."""
    wavelengths, values = curve
    inside = np.linspace(edges[:-1] * (1 + 1e-8), edges[1:] * (1 - 1e-8), 101)
    curve = np.interp(inside, wavelengths, values)
    if np.any(np.ptp(curve, axis=0) > 1e-6):
        raise ValueError(f"A property of '{material.name}' varies within a band")
    return curve[0]


def _coatings(materials, edges):
    """fresnel, face, share and beneath of _Tables."""
    bands, count = len(edges) - 1, len(materials)
    fresnel = np.array([bool(material.fresnel and material.specular) for material in materials])
    face, share, beneath = np.ones((count, bands), complex), np.ones(count), np.zeros((count, bands))
    for i in np.flatnonzero(fresnel):
        material = materials[i]
        normal = 1.0 - _in_bands(material.curve, material, edges)
        if material.constants is None:
            root = np.sqrt(material.specular * normal)
            face[i] = (1.0 + root) / (1.0 - root)
        else:
            constants = np.atleast_2d(material.constants)
            if len(constants) > 1:
                raise ValueError(f"The optical constants of '{material.name}' vary")
            face[i], share[i] = constants[0, 1] + 1j * constants[0, 2], material.specular
        random, through = np.random.default_rng(i).random((_COATINGS, 3)), np.zeros(bands)
        _mean_through(face[i], share[i], float(material.alpha), random, through)
        below = (1.0 - material.specular) * normal / (1.0 - material.specular * normal)
        beneath[i] = below / through if material.specular < 1.0 else 0.0
    return fresnel, face, share, beneath


@numba.njit(**COMPILED)
def _mean_through(face, share, alpha, random, through):
    """Add to through (b,) the mean of 1 - albedo over cosine-distributed directions."""
    z = np.array((0.0, 0.0, 1.0))
    for i in range(random.shape[0]):
        cosine = np.sqrt((i + 0.5) / random.shape[0])
        towards = np.array((np.sqrt(1.0 - cosine * cosine), 0.0, cosine))
        for band in range(through.size):
            kept = 1.0 - _lobe_sample(face[band], share, z, towards, alpha, random[i, 1], random[i, 2])
            through[band] += kept / random.shape[0]


@numba.njit(**COMPILED)
def _lobe_sample(face, share, z, towards, alpha, s, t):
    """What a facet that is seen from a direction reflects: in the mean the lobe's albedo."""
    cosine = np.dot(z, towards)
    if alpha == 0.0:
        return share * _face_reflectance(face, cosine)
    facet = _visible_facet(z, towards, alpha, s, t)
    met = np.dot(facet, towards)
    after = np.dot(2.0 * met * facet - towards, z)
    if after <= 1e-9:
        return 0.0
    before = _smith(alpha, max(cosine, 1e-9))
    return share * _face_reflectance(face, met) * (1.0 + before) / (1.0 + before + _smith(alpha, after))


@numba.njit(**COMPILED)
def _face_reflectance(index, cosine):
    """Of a smooth face of a complex index, for unpolarised light, by the impedances of both polarisations (Modest,
    section 2.5)."""
    square = index * index
    root = np.sqrt(square - (1.0 - cosine * cosine))
    across, along = (cosine - root) / (cosine + root), (square * cosine - root) / (square * cosine + root)
    return 0.5 * (abs(across) ** 2 + abs(along) ** 2)


def _batch(camera, centre, tables, tracers, samples, random, kinds):
    """Image (height, width, b) of so many samples a pixel, and its parts by kind (codes, height, width). tracers: of
    surfaces and of the meshes of gas."""
    sights, bodies = tracers
    pixels, bands = camera.width * camera.height, tables.world.shape[-1]
    image, tally = np.zeros((pixels, bands)), np.zeros((_CODES if kinds else 0, pixels))
    even = qmc.Sobol(2 + _UNIFORMS, rng=random).random_base2(int(samples - 1).bit_length())
    for first in range(0, pixels * samples, _WAVE):
        pixel, sample = np.divmod(np.arange(first, min(first + _WAVE, pixels * samples)), samples)
        moved = random.random((pixel[-1] - pixel[0] + 1, even.shape[1]))[pixel - pixel[0]]  # each pixel's by itself
        begin = (even[sample] + moved) % 1.0
        paths = _camera_paths(camera, centre, pixel, bands, begin[:, :2])
        count = len(pixel)
        while count:
            paths = _Paths(*(array[:count] for array in paths))
            hits = sights.hits(paths)
            crossings = bodies.crossings(paths.origin, paths.direction)
            uniforms = random.random((count, _UNIFORMS)) if begin is None else begin[:, 2:]
            count, begin = _bounce(tables, paths, hits, crossings, uniforms, image, tally), None
    shape = camera.height, camera.width
    return image.reshape(*shape, bands) / samples, tally.reshape(-1, *shape) / samples


def _camera_paths(camera, centre, pixel, bands, place):
    """Paths through pixels (n,), at places (n, 2) from 0 to 1 in them."""
    left, right, bottom, top = camera.frame
    s, t = place.T
    x = left + (right - left) * (pixel % camera.width + s) / camera.width
    y = bottom + (top - bottom) * (pixel // camera.width + t) / camera.height
    matrix, zero, one = np.asarray(camera.matrix, float), np.zeros(len(pixel)), np.ones(len(pixel))
    through, ahead = (
        ((zero, zero, zero), (x, y, -one)) if camera.kind == "PERSPECTIVE" else ((x, y, zero), (zero, zero, -one))
    )
    direction = np.column_stack(ahead) @ matrix[:3, :3].T
    return _Paths(
        pixel,
        np.column_stack(through) @ matrix[:3, :3].T + matrix[:3, 3] - centre,
        direction / np.linalg.norm(direction, axis=1, keepdims=True),
        np.ones((len(pixel), bands)),
        np.zeros(len(pixel), np.int64),
        np.zeros(len(pixel), np.int64),
        np.ones(len(pixel), np.bool_),
        np.zeros(len(pixel), np.int64),
    )


@numba.njit(**COMPILED)
def _bounce(tables, paths, hits, crossings, uniforms, image, tally):
    """Add what is emitted where paths arrive, and on their way there, and send them on; those that go on move to the
    front; their number."""
    triangle, u, v, distance, lit = hits
    kept, has_gas = 0, tables.gas.absorption.size > 0
    black, factor = np.empty(image.shape[1]), np.empty(image.shape[1])
    brought, one = np.empty(image.shape[1]), np.ones(image.shape[1])
    for i in range(triangle.size):
        t, pixel, kind = triangle[i], paths.pixel[i], paths.kind[i]
        throughput, unseen = paths.throughput[i], paths.unseen[i]
        ray, way = (paths.origin[i], paths.direction[i]), float(distance[i]) if t >= 0 else np.inf
        clear = float(lit[i]) if lit[i] < 1e30 else np.inf
        drawn = uniforms[i, 4], uniforms[i, 0]
        for light in range(0 if unseen else tables.lights.kind.size):
            to_light, share = light_met(tables.lights, light, *ray)
            if share <= 0.0 or to_light < 0.0 or to_light > clear or (to_light == np.inf and clear < np.inf):
                continue
            factor[:] = throughput
            medium = -1
            if has_gas:
                _, medium = _fly(tables.gas, crossings, i, ray, to_light, factor, drawn, brought)
            if medium < 0:
                _add(factor, share * tables.lights.radiance[light], pixel, kind, image, tally)
        if has_gas:
            free, medium = _fly(tables.gas, crossings, i, ray, way, throughput, drawn, brought)
            _add(one, brought, pixel, kind, image, tally)
            if medium >= 0:
                survival = min(_MOST_SURVIVE, throughput.max())
                if uniforms[i, 3] < survival:
                    paths.pixel[kept], paths.kind[kept], paths.bounces[kept] = pixel, _CODES - 1, paths.bounces[i] + 1
                    paths.unseen[kept], paths.lobe[kept] = False, 1
                    paths.origin[kept] = paths.origin[i] + free * paths.direction[i]
                    g = tables.gas.anisotropy[medium]
                    paths.direction[kept] = _deflected(paths.direction[i], g, uniforms[i])
                    paths.throughput[kept] = throughput / survival
                    kept += 1
                continue
        if t < 0:
            _see_world(tables.world, paths.direction[i], brought)
            _add(throughput, brought, pixel, kind, image, tally)
            continue
        material, (other, share) = tables.material[t], mixed_at(tables.painted, t, u[i], v[i])
        if uniforms[i, 10] < share:
            material = other
        _black_at(tables, t, u[i], v[i], black)
        tau = tables.transmittance[material]
        through = tau.max() / (tau.max() + (1.0 - tau - tables.emissivity[material]).max() + 1e-300)
        if uniforms[i, 9] < through:
            _add(throughput, tables.emissivity[material] * black, pixel, kind, image, tally)
            throughput *= tau / through
            survival = 1.0 if paths.bounces[i] < _ROULETTE_FROM else min(_MOST_SURVIVE, throughput.max())
            if throughput.max() > 0.0 and uniforms[i, 3] < survival:
                paths.pixel[kept], paths.kind[kept], paths.bounces[kept] = pixel, kind, paths.bounces[i]
                paths.unseen[kept], paths.lobe[kept] = unseen, paths.lobe[i]
                ahead = paths.direction[i].copy()
                _leave(tables, t, (u[i], v[i]), ahead, paths, kept)
                paths.throughput[kept] = throughput / survival
                kept += 1
            continue
        direction, lobe, weight = _reflect(tables, material, t, paths.direction[i], uniforms[i])
        rho = 1.0 - tau - tables.emissivity[material]
        factor[:] = rho * weight
        if tables.fresnel[material]:
            _coat(tables, material, t, paths.direction[i], (direction, lobe, weight), uniforms[i], factor)
        # A sample of a rough lobe stands for what the lobe loses, too.
        lost = (rho - factor) / (1.0 - through)
        _add(throughput, (tables.emissivity[material] + lost) * black, pixel, kind, image, tally)
        throughput *= factor / (1.0 - through)
        survival = 1.0 if paths.bounces[i] < _ROULETTE_FROM else min(_MOST_SURVIVE, throughput.max())
        if throughput.max() <= 0.0 or uniforms[i, 3] >= survival:
            continue
        paths.pixel[kept] = pixel
        paths.kind[kept] = min(4 * kind + lobe, _CODES - 1) if paths.bounces[i] < KIND_LENGTH else _CODES - 1
        paths.bounces[kept], paths.unseen[kept], paths.lobe[kept] = paths.bounces[i] + 1, unseen and lobe == 3, lobe
        _leave(tables, t, (u[i], v[i]), direction, paths, kept)
        paths.throughput[kept] = throughput / survival
        kept += 1
    return kept


@numba.njit(**COMPILED)
def _see_world(world, direction, seen):
    """Fill seen (b,) with the excess radiance of the surroundings, linear between the middles of pixels."""
    height, width = world.shape[:2]
    x, y, z = direction
    v = min(max((np.arcsin(min(max(z, -1.0), 1.0)) / np.pi + 0.5) * height - 0.5, 0.0), height - 1.0)
    u = (0.5 - np.arctan2(y, x) / (2.0 * np.pi)) * width - 0.5
    row, column = int(v), int(np.floor(u))
    above, beside = min(row + 1, height - 1), (column + 1) % width
    low = (1.0 - (u - column)) * world[row, column % width] + (u - column) * world[row, beside]
    high = (1.0 - (u - column)) * world[above, column % width] + (u - column) * world[above, beside]
    seen[:] = (1.0 - (v - row)) * low + (v - row) * high


@numba.njit(**COMPILED)
def _leave(tables, t, at, direction, paths, kept):
    """Let path `kept` set out from a point of a triangle in a direction."""
    (a, b, c), (u, v) = tables.corners[t], at
    away = 1.0 if np.dot(direction, tables.normal[t]) > 0.0 else -1.0
    paths.origin[kept] = a + u * (b - a) + v * (c - a) + away * tables.clearance * tables.normal[t]
    paths.direction[kept] = direction


@numba.njit(**COMPILED)
def _fly(gas, crossings, i, ray, limit, throughput, uniforms, brought):
    """Follow path i up to a limit (m, infinite if it leaves the scene); returns the distance at which it is scattered,
    and by which medium, or infinity and -1. Fills brought (b,) with what gas on its way sends to the eye, and takes
    from the throughput (b,) what it absorbs.

    ray: origin and unit direction (3,). uniforms: free path, medium.
    """
    t, left, emission = 0.0, -np.log1p(-uniforms[0]), np.empty(brought.size)
    line, cells = _in_cells(gas, ray), np.empty(gas.absorption.size, np.int64)
    brought[:] = 0.0
    while t < limit:
        stop = min(limit, _next_change(gas, crossings, i, line, t, limit))
        if stop == np.inf:
            break
        way, absorption, scattering = stop - t, 0.0, 0.0
        emission[:] = 0.0
        for m in range(gas.absorption.size):
            cell = _cell_at(gas, crossings, m, i, line, 0.5 * (t + stop), limit)
            cells[m] = cell
            if cell >= 0:
                absorption += gas.density[cell] * gas.absorption[m]
                scattering += gas.density[cell] * gas.scattering[m]
                for b in range(emission.size):
                    emission[b] += gas.density[cell] * gas.absorption[m] * gas.excess[cell, b]
        scatters = scattering * way > left
        if scatters:
            way = left / scattering
        left -= scattering * way
        lost = -np.expm1(-absorption * way)
        for b in range(emission.size if lost > 0.0 else 0):
            brought[b] += throughput[b] * (lost / absorption) * emission[b]
            throughput[b] *= 1.0 - lost
        if scatters:
            return t + way, _pick(gas, cells, uniforms[1] * scattering)
        t = stop
    return np.inf, -1


@numba.njit(**COMPILED)
def _pick(gas, cells, sought):
    """The medium in whose share the sought part of the scattering coefficient (1/m) lies. cells: (m,), see _cell_at."""
    chosen = -1
    for m in range(cells.size):
        scattering = gas.density[cells[m]] * gas.scattering[m] if cells[m] >= 0 else 0.0
        if scattering > 0.0 and sought >= 0.0:
            chosen = m
            sought -= scattering
    return chosen


@numba.njit(**COMPILED)
def _in_cells(gas, ray):
    """(m, 3, 4): of a ray in the space of the cells of each grid, along each axis: its origin and direction there, and
    where it enters and leaves the box around all cells, the same for all axes, m."""
    (origin, direction), line = ray, np.zeros((gas.absorption.size, 3, 4))
    for m in range(gas.absorption.size):
        enters, ends = -np.inf, np.inf
        for axis in range(3 if gas.count[m, 0] > 0 else 0):
            o, d = gas.to_index[m, axis, 3], 0.0
            for k in range(3):
                o += gas.to_index[m, axis, k] * origin[k]
                d += gas.to_index[m, axis, k] * direction[k]
            line[m, axis, 0], line[m, axis, 1] = o, d
            if d != 0.0:
                low, high = -o / d, (gas.count[m, axis] - o) / d
                enters, ends = max(enters, min(low, high)), min(ends, max(low, high))
            elif not 0.0 < o < gas.count[m, axis]:
                ends = -np.inf
        line[m, :, 2], line[m, :, 3] = enters, ends
    return line


@numba.njit(**COMPILED)
def _next_change(gas, crossings, i, line, t, limit):
    """The next distance behind t at which the ray may enter or leave a medium or a cell. line: see _in_cells."""
    found = np.inf
    for m in range(gas.absorption.size):
        if gas.everywhere[m] and limit == np.inf and gas.depth > t:
            found = min(found, gas.depth)
        for k in range(crossings.distance.shape[2]):
            if crossings.distance[m, i, k] > t:
                found = min(found, crossings.distance[m, i, k])
                break
        enters, ends = line[m, 0, 2], line[m, 0, 3]
        if t < enters < ends:
            found = min(found, enters)
        elif enters <= t < ends:
            for axis in range(3):
                found = min(found, _next_plane(line[m, axis, 0], line[m, axis, 1], t))
    return found


@numba.njit(**COMPILED)
def _next_plane(o, d, t):
    """The next distance behind t at which a ray crosses a plane between cells, across one axis."""
    if d == 0.0:
        return np.inf
    step = 1.0 if d > 0.0 else -1.0
    plane = np.floor(o + t * d)
    while (plane - o) / d <= t:  # once or twice, whatever rounding does
        plane += step
    return (plane - o) / d


@numba.njit(**COMPILED)
def _cell_at(gas, crossings, m, i, line, t, limit):
    """Cell of medium m at a distance t that is no border, -1 if the medium is not there."""
    if gas.everywhere[m]:
        return gas.first[m] if limit < np.inf or t < gas.depth else -1
    if gas.count[m, 0] == 0:
        for k in range(crossings.distance.shape[2]):
            if crossings.distance[m, i, k] > t:
                return gas.first[m] if crossings.leaves[m, i, k] and crossings.distance[m, i, k] < np.inf else -1
        return -1
    cell = 0
    for axis in range(3):
        at = int(np.floor(line[m, axis, 0] + t * line[m, axis, 1]))
        if at < 0 or at >= gas.count[m, axis]:
            return -1
        cell = cell * gas.count[m, axis] + at
    return gas.first[m] + cell


@numba.njit(**COMPILED)
def _add(throughput, emitted, pixel, kind, image, tally):
    total = 0.0
    for band in range(throughput.size):
        image[pixel, band] += throughput[band] * emitted[band]
        total += throughput[band] * emitted[band]
    if tally.shape[0] > 0:
        tally[kind, pixel] += total


@numba.njit(**COMPILED)
def _black_at(tables, t, u, v, black):
    """Set the excess of a blackbody at a point of a triangle, (b,)."""
    black[:], kelvin = tables.black[t], kelvin_at(tables.painted, t, u, v)
    if np.isnan(kelvin):
        if not tables.varies[t]:
            return
        a, b, c = tables.kelvin[t]
        kelvin = a + u * (b - a) + v * (c - a)
    for band in range(black.size):
        black[band] = -tables.at_reference[band]
        for node in range(tables.wavelength.shape[1]):
            x = C2 / (tables.wavelength[band, node] * max(kelvin, 1.0))
            black[band] += tables.weight[band, node] / np.expm1(x) if x < 700.0 else 0.0


@numba.njit(**COMPILED)
def _reflect(tables, material, t, incoming, uniforms):
    """Direction (3,), lobe (1, 2, 3: D, G, S) and weight: BRDF times cosine over density at a reflectance of 1."""
    z = tables.normal[t] if np.dot(tables.normal[t], incoming) < 0.0 else -tables.normal[t]
    if uniforms[0] >= tables.specular[material]:
        return _onto_hemisphere(z, uniforms[1], uniforms[2]), 1, 1.0
    alpha = tables.alpha[material]
    if alpha == 0.0:
        mirrored = incoming - 2.0 * np.dot(incoming, z) * z
        return mirrored / np.sqrt(np.dot(mirrored, mirrored)), 3, 1.0
    facet = _visible_facet(z, -incoming, alpha, uniforms[1], uniforms[2])
    out = incoming - 2.0 * np.dot(incoming, facet) * facet
    out /= np.sqrt(np.dot(out, out))
    cosine = np.dot(out, z)
    if cosine <= 1e-9:
        return out, 2, 0.0
    before, after = _smith(alpha, max(-np.dot(incoming, z), 1e-9)), _smith(alpha, cosine)
    return out, 2, (1.0 + before) / (1.0 + before + after)


@numba.njit(**COMPILED)
def _coat(tables, material, t, incoming, reflected, uniforms, factor):
    """Set factor (b,) to BRDF times cosine over density of a material that follows Fresnel's law. reflected: what
    _reflect returned."""
    direction, lobe, weight = reflected
    z = tables.normal[t] if np.dot(tables.normal[t], incoming) < 0.0 else -tables.normal[t]
    specular, alpha, share = tables.specular[material], tables.alpha[material], tables.share[material]
    for band in range(factor.size):
        face = tables.face[material, band]
        if lobe != 1:
            met = np.sqrt(max(0.0, 0.5 - 0.5 * np.dot(incoming, direction)))
            factor[band] = share * _face_reflectance(face, met) * weight / specular
            continue
        out = 1.0 - _lobe_sample(face, share, z, -incoming, alpha, uniforms[5], uniforms[6])
        into = 1.0 - _lobe_sample(face, share, z, direction, alpha, uniforms[7], uniforms[8])
        factor[band] = tables.beneath[material, band] * out * into / (1.0 - specular)


@numba.njit(**COMPILED)
def _deflected(direction, g, uniforms):
    """Direction after scattering by the phase function of Henyey and Greenstein (Witt 1977, eq. 19)."""
    cosine = 1.0 - 2.0 * uniforms[1]
    if g != 0.0:
        ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * uniforms[1])
        cosine = (1.0 + g * g - ratio * ratio) / (2.0 * g)
    helper = np.array((1.0, 0.0, 0.0)) if abs(direction[0]) < 0.6 else np.array((0.0, 1.0, 0.0))
    x = np.cross(helper, direction)
    x /= np.sqrt(np.dot(x, x))
    sine, turn = np.sqrt(max(0.0, 1.0 - cosine * cosine)), 2.0 * np.pi * uniforms[2]
    return cosine * direction + sine * (np.cos(turn) * x + np.sin(turn) * np.cross(direction, x))


@numba.njit(**COMPILED)
def _onto_hemisphere(z, s, t):
    """Direction with density cos / pi around z: a point of the unit sphere that stands on the surface."""
    height, turn = 2.0 * s - 1.0, 2.0 * np.pi * t
    radius = np.sqrt(max(0.0, 1.0 - height * height))
    direction = z + np.array((radius * np.cos(turn), radius * np.sin(turn), height))
    length = np.sqrt(np.dot(direction, direction))
    return direction / length if length > 1e-12 else z.copy()


@numba.njit(**COMPILED)
def _visible_facet(z, towards, alpha, s, t):
    """Normal of a facet of a GGX surface that is seen from a direction: spherical caps (Dupuy and Benyoub 2023)."""
    helper = np.array((1.0, 0.0, 0.0)) if abs(z[0]) < 0.6 else np.array((0.0, 1.0, 0.0))
    x = np.cross(helper, z)
    x /= np.sqrt(np.dot(x, x))
    y = np.cross(z, x)
    view = np.array((alpha * np.dot(towards, x), alpha * np.dot(towards, y), np.dot(towards, z)))
    view /= np.sqrt(np.dot(view, view))
    height = (1.0 - t) * (1.0 + view[2]) - view[2]
    radius, turn = np.sqrt(max(0.0, 1.0 - height * height)), 2.0 * np.pi * s
    half = np.array((radius * np.cos(turn), radius * np.sin(turn), height)) + view
    facet = alpha * half[0] * x + alpha * half[1] * y + max(half[2], 1e-12) * z
    return facet / np.sqrt(np.dot(facet, facet))


@numba.njit(**COMPILED)
def _smith(alpha, cosine):
    """Lambda of Smith's shadowing for GGX (Heitz 2014, eq. 72)."""
    tangent = alpha * np.sqrt(max(0.0, 1.0 - cosine * cosine)) / cosine
    return 0.5 * (np.sqrt(1.0 + tangent * tangent) - 1.0)
