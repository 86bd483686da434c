# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with an exact solution, for test_exact.py (short renders) and docs/tools/measure_accuracy.py (long ones).

A builder makes a Scene and the truth: the mean radiance of the image in each band, (b,) W m-2 sr-1. Its docstring is
printed in docs/accuracy.md. Truths share no code with the solver: Planck's law, view factors and lobes are written
here a second time, from the sources that the docstrings name.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from addon.solver import AreaLight, Camera, Material, PointLight, Scene, Settings, SpotLight, SunLight
from tests.helpers.scenes import box, join, look, make_scene, quad, sphere

NARROW = np.array([9.99, 10.01])  # um, one narrow band
WINDOWS = np.array([3.0, 5.0, 8.0, 12.0, 14.0])  # um
THERMAL = np.array([8.0, 9.0, 10.0, 12.0])  # um
ALL = np.array([0.3, 3000.0])  # um, all wavelengths: 1e-7 of a blackbody of 300 K lies outside
SIGMA = 5.670374419e-8  # Stefan-Boltzmann constant, W m-2 K-4 (CODATA 2018)
C1, C2 = 1.191042972e8, 14387.768775  # 2 h c^2 in W um^4 m-2 sr-1, h c / k in um K (CODATA 2018)
FLOAT32 = 1e-6  # relative; images are float32
PHOTONS = 30_000  # in a pass
ALBEDO = 1e-4  # of the table of a rough lobe's albedo, absolute: what radiometry.py states


@dataclass(frozen=True)
class Case:
    """A scene with an exact solution: build(**arguments) returns the Scene and the truth (see above).

    settings: of the render, beside passes and seed. tolerance: relative deviation that is not noise.
    short: whether the tests render it, too.
    """

    name: str
    build: Callable[..., tuple[Scene, np.ndarray]]
    arguments: dict = field(default_factory=dict)
    settings: dict = field(default_factory=dict)
    tolerance: float = FLOAT32
    short: bool = True

    @property
    def title(self) -> str:
        """Of the group of cases with this builder: the first line of its docstring."""
        return self.build.__doc__.split("\n")[0].rstrip(".")

    @property
    def explanation(self) -> str:
        """The rest of that docstring, in lines as they stand there."""
        return "\n".join(line.strip() for line in self.build.__doc__.split("\n")[1:]).strip()

    def render_settings(self, **options) -> Settings:
        """Settings of a render of the case."""
        return Settings(**{"photons_per_pass": PHOTONS, **self.settings, **options})


# Formulas


def blackbody(edges, temperature):
    """Radiance of a blackbody in each band, s + (b,) W m-2 sr-1, at temperatures of shape s, K, above 0.

    Planck's law, integrated over ln(wavelength) by Gauss and Legendre with 200 nodes a band.
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    low, high = np.log(edges[:-1, None]), np.log(edges[1:, None])
    wavelength = np.exp(low + (high - low) * (nodes + 1) / 2)
    x = C2 / (wavelength * np.asarray(temperature, float)[..., None, None])
    spectral = C1 / wavelength**5 * np.exp(-x) / -np.expm1(-x)
    return np.sum(spectral * wavelength * weights, axis=-1) * (high - low)[:, 0] / 2


def mean_over(frame, function, count=8):
    """Mean of function(points (n, 3)) -> (n,) over the rectangle (x0, x1, y0, y1) at z = 0 (Gauss and Legendre)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x, y = (low + (high - low) * (nodes + 1) / 2 for low, high in (frame[:2], frame[2:]))
    points = np.stack((*np.meshgrid(x, y, indexing="ij"), np.zeros((count, count))), axis=-1)
    return np.outer(weights, weights).ravel() / 4 @ function(points.reshape(-1, 3))


def polygon_factor(points, vertices, triangles):
    """View factors (n,) from horizontal elements at points (n, 3) to triangles above them that do not overlap.

    Lambert's contour integral, exact for polygons: over the edges, 1 / (2 pi) times the angle that an edge spans and
    the cosine between the element's normal and that of the plane through element and edge (Modest, chapter 4).
    """
    corners = vertices[triangles]
    total = 0.0
    for i in range(3):
        a, b = (corners[:, k % 3] - points[:, None] for k in (i, i + 1))
        normal = np.cross(a, b)
        length = np.linalg.norm(normal, axis=-1)
        total = total + np.arctan2(length, np.sum(a * b, axis=-1)) * normal[..., 2] / np.maximum(length, 1e-300)
    return np.abs(total).sum(axis=1) / (2 * math.pi)


def disk_factor(receiver, emitter, distance):
    """From a disk to a coaxial one, radii and distance in m (Howell, factor C-41)."""
    r1, r2 = receiver / distance, emitter / distance
    x = 1 + (1 + r2**2) / r1**2
    return (x - math.sqrt(x**2 - 4 * (r2 / r1) ** 2)) / 2


def parallel_factor(a, b, c):
    """Between rectangles a x b that face each other at distance c (Howell, factor C-11)."""
    x, y = a / c, b / c
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    total = math.log(p * q / math.sqrt(1 + x * x + y * y)) - x * math.atan(x) - y * math.atan(y)
    return 2 / (math.pi * x * y) * (total + x * q * math.atan(x / q) + y * p * math.atan(y / p))


def corner_factor(width, height, edge):
    """From a rectangle of this width to one of this height at right angles; common edge (Howell, factor C-14)."""
    w, h = (width / edge) ** 2, (height / edge) ** 2
    total = sum(sign * math.sqrt(s) * math.atan(1 / math.sqrt(s)) for sign, s in ((1, w), (1, h), (-1, w + h)))
    product = math.log((1 + w) * (1 + h) / (1 + w + h))
    product += w * math.log(w * (1 + w + h) / ((1 + w) * (w + h)))
    product += h * math.log(h * (1 + w + h) / ((1 + h) * (w + h)))
    return (total + product / 4) / (math.pi * math.sqrt(w))


def smith(alpha, cosine):
    """Lambda of Smith's shadowing for GGX (Heitz 2014, eq. 72)."""
    return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2


def ggx(alpha, light, eye):
    """BRDF (sr-1) of the rough lobe, D G2 / (4 cos cos), for unit vectors (..., 3) with z up (Heitz 2014)."""
    half = light + eye
    cos2 = half[..., 2] ** 2 / np.sum(half**2, axis=-1)
    density = alpha**2 / (math.pi * (cos2 * (alpha**2 - 1) + 1) ** 2)
    shadowing = 1 / (1 + smith(alpha, light[..., 2]) + smith(alpha, eye[..., 2]))
    return density * shadowing / (4 * light[..., 2] * eye[..., 2])


def lobe_albedo(alpha, cosine, count=1500):
    """Share of light from a direction with this cosine that the rough lobe reflects: integral of BRDF times cosine.

    Over facets, by the midpoint rule: u = 1 - g^2 is the cumulative distribution of their slopes weighted with D cos,
    so D drops out (the solver samples another distribution, that of visible facets).
    """
    g = (np.arange(count)[:, None] + 0.5) / count
    turn = 2 * math.pi * (np.arange(count) + 0.5) / count
    tan = alpha * np.sqrt(1 / g**2 - 1)
    upward = 1 / np.sqrt(1 + tan**2)  # cosine of the facet
    on_facet = upward * (math.sqrt(1 - cosine**2) * tan * np.cos(turn) + cosine)
    out = 2 * on_facet * upward - cosine
    lit = (on_facet > 0) & (out > 0)
    shadowing = 1 / (1 + smith(alpha, cosine) + smith(alpha, np.where(lit, out, 1.0)))
    return float(np.mean(np.where(lit, 2 * g * shadowing * on_facet / (cosine * upward), 0.0)))


# Parts of scenes

WHITE, BLACK = Material("floor", 0.5), Material("black", 1.0)
HOT = 400.0  # K


def stepped(edges, values):
    """Emissivity that is constant inside each band, so that a band's mean of it does not depend on any temperature."""
    return np.column_stack((np.column_stack((edges[:-1] * (1 + 1e-9), edges[1:])).ravel(), np.repeat(values, 2)))


def above(frame, height, pixels=24):
    """Orthographic camera that looks down from a height at exactly the rectangle (x0, x1, y0, y1) of the floor."""
    return Camera(pixels, pixels, look((0, 0, height), (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=frame)


def rectangle(x0, x1, y0, y1, z=0.0):
    """Horizontal quad."""
    return quad(((x0 + x1) / 2, (y0 + y1) / 2, z), ((x1 - x0) / 2, 0, 0), (0, (y1 - y0) / 2, 0))


def disk(radius, height=0.0, corners=256):
    """Regular polygon with the area of a disk, without needles; corners: a power of 2."""
    angle = 2 * math.pi * np.arange(corners) / corners
    radius *= math.sqrt(2 * math.pi / corners / math.sin(2 * math.pi / corners))
    points = np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.full(corners, height)))
    steps = [2**k for k in range(corners.bit_length() - 2)]
    return points, np.array([(i, i + s, (i + 2 * s) % corners) for s in steps for i in range(0, corners, 2 * s)])


def areas(corners):
    """Of triangles (n, 3, 3), m2, (n,)."""
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def on_floor(floor, frame, parts, height, share, materials=(WHITE, BLACK), edges=NARROW, **options):
    """Scene and truth of a floor at 0 K that reflects half of what it receives, in the frame of a camera above.

    parts: as for `join`, black at HOT unless they say otherwise. share: of the blackbody radiance at HOT that the frame
    receives in the mean, E / (pi B).
    """
    *mesh, material = join((*floor, 0.0, 0), *[(*part, HOT, 1)[:4] for part in parts])
    scene = make_scene(*mesh, materials, above(frame, height), edges, material, **options)
    return scene, 0.5 * share * blackbody(edges, HOT)


# Enclosures


def black_plane(temperature):
    """A blackbody.

    A black plane fills the picture: Planck's law, integrated over each band (Modest, chapter 1).
    """
    scene = make_scene(*rectangle(-1, 1, -1, 1), temperature, [BLACK], above((-0.5, 0.5, -0.5, 0.5), 1.0), WINDOWS)
    return scene, blackbody(WINDOWS, temperature)


def isothermal(material, ball=None):
    """Enclosures at one temperature.

    Any closed box at 300 K, with or without a ball inside, is black at 300 K, whatever its surfaces (Kirchhoff). The
    subtraction makes this exact by construction, so it is also switched off, or given a wrong T0.
    """
    parts = [(*box((1.0, 0.8, 0.6)), 300.0, 0)]
    if ball is not None:
        vertices, triangles = sphere(2, 0.15)
        parts.append((vertices + (0.3, 0.35, 0.3), triangles, 300.0, 1))
    *mesh, index = join(*parts)
    camera = look((0.8, 0.6, 0.4), (0.1, 0.1, 0.1))
    return make_scene(*mesh, [material, ball or BLACK], camera, NARROW, index), blackbody(NARROW, 300.0)


def plates(view, hot=0.8, cold=0.4, specular=0.0, edges=NARROW):
    """Infinite parallel plates.

    400 K below, 300 K above; four perfect mirrors at the sides make them infinite. J1 = (e1 B1 + (1 - e1) e2 B2) /
    (1 - (1 - e1)(1 - e2)), and the like for J2, in each band; the same for diffuse and for specular plates (Modest,
    chapters 5 and 6). "Both": a level camera sees the plates in the mirrors, one in each half of its picture.
    """
    e1, e2 = (np.broadcast_to(np.asarray(e, float), len(edges) - 1) for e in (hot, cold))
    mirror = Material("mirror", 0.0, specular=1.0)
    materials = [mirror, Material("hot", stepped(edges, e1), specular), Material("cold", stepped(edges, e2), specular)]
    target = {"hot": (0.5, 0.5, 0.0), "cold": (0.5, 0.5, 0.5), "both": (1.0, 0.6, 0.25)}[view]
    camera = look((0.5, 0.45, 0.25), target)
    temperature = [300.0] * 8 + [400.0] * 2 + [300.0] * 2
    scene = make_scene(*box((1.0, 1.0, 0.5)), temperature, materials, camera, edges, [0] * 8 + [1] * 2 + [2] * 2)
    b1, b2 = blackbody(edges, 400.0), blackbody(edges, 300.0)
    closed = 1 - (1 - e1) * (1 - e2)
    j1, j2 = (e1 * b1 + (1 - e1) * e2 * b2) / closed, (e2 * b2 + (1 - e2) * e1 * b1) / closed
    return scene, {"hot": j1, "cold": j2, "both": (j1 + j2) / 2}[view]


def closed_sphere(view, cap=0.3, rest=0.9, edges=NARROW, hottest=None, **mesh):
    """A closed diffuse sphere.

    A cap of a quarter of the area at 400 K, the rest at 300 K. E / pi = sum of f e B over sum of f e at every point, f
    the shares of the area; L = e B + (1 - e) E / pi (Modest, chapter 5; on a sphere every point has the same view
    factor to an element of area). f is that of the mesh, which is that of the sphere to 1e-4. "Ramp": the cap's
    temperature grows linearly with z inside each triangle, up to 500 K, and B is integrated over the triangles
    (midpoints of edges).
    """
    vertices, triangles, is_cap = globe(0.5, **mesh)
    corners = vertices[triangles]
    area = areas(corners)
    cap, rest = (np.broadcast_to(np.asarray(e, float), len(edges) - 1) for e in (cap, rest))
    materials = [Material("cap", stepped(edges, cap)), Material("rest", stepped(edges, rest))]
    camera = look((0, 0, 0), (0, 0, 1.0 if view == "cap" else -1.0), tangent=0.3)
    kelvin = np.where(is_cap, 400.0, 300.0)
    scene = make_scene(vertices, triangles, kelvin, materials, camera, edges, np.where(is_cap, 0, 1))
    emitted = blackbody(edges, np.array([300.0, 400.0]))[is_cap.astype(int)]
    if hottest is not None:
        kelvin = np.where(is_cap[:, None], 300.0 + (hottest - 300.0) * np.maximum(2 * corners[..., 2] - 1, 0.0), 300.0)
        scene = replace(scene, temperature=kelvin.astype(np.float32))
        emitted = blackbody(edges, (kelvin + np.roll(kelvin, 1, axis=1)) / 2).mean(axis=1)
    emissivity = np.where(is_cap[:, None], cap, rest)
    incident = (area @ (emissivity * emitted)) / (area @ emissivity)
    e, kelvin = (cap, 400.0) if view == "cap" else (rest, 300.0)
    return scene, e * blackbody(edges, kelvin) + (1 - e) * incident


def concentric(view, inner=0.8, outer=0.4, edges=NARROW, subdivisions=4):
    """Concentric diffuse spheres.

    Radii 1 and 2 m, 400 K inside and 300 K outside. With q = (B1 - B2) / (1 / e1 + (1 / e2 - 1) A1 / A2) the surfaces
    show J1 = B1 - q (1 / e1 - 1) and J2 = B2 + q (1 / e2 - 1) A1 / A2 (Modest, chapter 5). Over all wavelengths pi q is
    610.6557 W/m2.
    """
    e1, e2 = (np.broadcast_to(np.asarray(e, float), len(edges) - 1) for e in (inner, outer))
    materials = [Material("inner", stepped(edges, e1)), Material("outer", stepped(edges, e2))]
    *mesh, index = join((*sphere(subdivisions, 1.0), 400.0, 0), (*sphere(subdivisions, 2.0), 300.0, 1))
    target, tangent = {"inner": (0.0, 0.6), "outer": (2.0, 1.2)}[view]
    camera = look((1.2, 0, 0), (target, 0, 0), tangent=tangent)
    b1, b2 = blackbody(edges, 400.0), blackbody(edges, 300.0)
    q = (b1 - b2) / (1 / e1 + (1 / e2 - 1) / 4)
    truth = {"inner": b1 - q * (1 / e1 - 1), "outer": b2 + q / 4 * (1 / e2 - 1)}[view]
    return make_scene(*mesh, materials, camera, edges, index), truth


def globe(cut, rings=96, segments=256):
    """Unit sphere by latitude and longitude with a ring of edges at height `cut`: vertices, triangles, and which of
    them lie above it. What lies above has the share (1 - cut) / 2 of the area, as on a sphere, to 1e-4 of it."""
    middle = math.acos(cut)
    above = max(2, round(rings * middle / math.pi))
    polar = np.concatenate((np.linspace(0, middle, above + 1), np.linspace(middle, math.pi, rings - above + 1)[1:]))
    turn = 2 * math.pi * np.arange(segments) / segments
    sine, cosine = np.sin(polar)[1:-1, None], np.cos(polar)[1:-1, None]
    circles = np.stack(np.broadcast_arrays(sine * np.cos(turn), sine * np.sin(turn), cosine), axis=-1)
    vertices = np.concatenate((circles.reshape(-1, 3), [(0, 0, 1), (0, 0, -1)]))
    here = np.arange(segments)
    there, last = (here + 1) % segments, segments * (rings - 2)
    strip = np.concatenate(
        [np.stack((here, here + segments, there), 1), np.stack((there, here + segments, there + segments), 1)]
    )
    north = np.stack((np.full(segments, len(vertices) - 2), here, there), 1)
    south = np.stack((last + there, last + here, np.full(segments, len(vertices) - 1)), 1)
    strips = (strip + segments * np.arange(rings - 2)[:, None, None]).reshape(-1, 3)
    triangles = np.concatenate((north, strips, south)).astype(np.int32)
    return vertices, triangles, vertices[triangles].mean(axis=1)[:, 2] > cut


def cavity(cut, emissivity=0.5, sky=0.0, edges=NARROW, **mesh):
    """Spherical cavities.

    A diffuse sphere at 300 K without its cap above z = cut, the share f = (1 - cut) / 2 of the area. Its effective
    emissivity is e / (e + (1 - e) f) at every point (Modest, chapter 5); it reflects the rest of the sky. The mesh has
    a ring of edges at the rim, and its f is that of the sphere to 1e-4.
    """
    vertices, triangles, is_cap = globe(cut, **mesh)
    e = np.broadcast_to(np.asarray(emissivity, float), len(edges) - 1)
    effective = e / (e + (1 - e) * (1 - cut) / 2)
    wall = Material("wall", stepped(edges, e))
    camera = look((0, 0, 0.5), (0, 0, -1))
    scene = make_scene(vertices, triangles[~is_cap], 300.0, [wall], camera, edges, world_temperature=sky)
    outside = blackbody(edges, sky) if sky else 0.0
    return scene, effective * blackbody(edges, 300.0) + (1 - effective) * outside


# View factors


def disks(receiver, emitter, distance):
    """Coaxial disks.

    A black disk at 400 K over a diffuse one at 0 K that reflects half: L = 0.5 F B with F from the receiver to the
    emitter (Howell, C-41). The camera, between them, sees the whole receiver and nothing else that shines, so its mean
    is that over the area. Polygons of 256 corners with the area of the disk; F changes by less than 1e-5.
    """
    frame = receiver * 1.01 * np.array((-1.0, 1.0, -1.0, 1.0))
    share = disk_factor(receiver, emitter, distance) * math.pi / (2 * 1.01) ** 2
    return on_floor(disk(receiver), tuple(frame), [disk(emitter, distance)], distance / 2, share)


def disks_image(distance, inside=40):
    """The scene of disks of radius 1, the truth of each pixel, (24, 24) W m-2 sr-1, and the share that the disk fills.

    From an element to a parallel disk of radius 1 at the distance r from its axis: (1 - (h^2 + r^2 - 1) / sqrt((h^2 +
    r^2 + 1)^2 - 4 r^2)) / 2 (Howell, B-13). inside: squared, points in each pixel.
    """
    scene, _ = disks(1, 1, distance)
    x = 1.01 * (2 * (np.arange(24 * inside) + 0.5) / (24 * inside) - 1)
    r2 = x[:, None] ** 2 + x**2
    total = distance**2 + r2
    factor = np.where(r2 < 1, (1 - (total - 1) / np.sqrt((total + 1) ** 2 - 4 * r2)) / 2, 0.0)
    factor, cover = (of.reshape(24, inside, 24, inside).mean(axis=(1, 3)) for of in (factor, r2 < 1))
    return scene, 0.5 * factor * blackbody(NARROW, HOT), cover


def parallel(a, b, distance):
    """Parallel rectangles.

    A black rectangle at 400 K over a diffuse one at 0 K of the same size: L = 0.5 F B (Howell, C-11).
    """
    frame = (-a / 2, a / 2, -b / 2, b / 2)
    share = parallel_factor(a, b, distance)
    return on_floor(rectangle(*frame), frame, [rectangle(*frame, distance)], distance / 2, share)


def parallel_image(distance):
    """The scene of parallel squares, and the truth of each pixel, (24, 24) W m-2 sr-1: Lambert's contour integral."""
    scene, _ = parallel(1, 1, distance)
    emitter, steps = rectangle(-0.5, 0.5, -0.5, 0.5, distance), np.linspace(-0.5, 0.5, 25)
    factor = [
        [mean_over((x, x + 1 / 24, y, y + 1 / 24), lambda at: polygon_factor(at, *emitter), 2) for x in steps[:-1]]
        for y in steps[:-1]
    ]
    return scene, 0.5 * np.array(factor) * blackbody(NARROW, HOT)


def corner(width, height, edge):
    """Perpendicular rectangles.

    A black wall at 400 K beside a diffuse floor at 0 K, with a common edge: L = 0.5 F B (Howell, C-14).
    """
    frame = (0.0, width, 0.0, edge)
    wall = quad((0, edge / 2, height / 2), (0, edge / 2, 0), (0, 0, height / 2))
    return on_floor(rectangle(*frame), frame, [wall], 2 * height, corner_factor(width, height, edge))


def strips(angle=None, distance=1.0):
    """Infinite strips.

    A black strip at 400 K over, or at an angle beside, a diffuse one at 0 K, both 1 m wide: crossed strings, F =
    sqrt(1 + d^2) - d or 1 - sin(angle / 2) (Modest, chapter 4). Two perfect mirrors at the ends make them infinite.
    """
    floor = (0.0, 1.0, 0.0, 1.0)
    if angle is None:
        emitter, share, height = rectangle(*floor, distance), math.sqrt(1 + distance**2) - distance, distance / 2
    else:
        c, s = math.cos(angle) / 2, math.sin(angle) / 2
        emitter, share, height = quad((c, 0.5, s), (c, 0, s), (0, 0.5, 0)), 1 - math.sin(angle / 2), 2.0
    mirrors = [(*quad((0.5, y, 0.5), (2, 0, 0), (0, 0, 2)), 0.0, 2) for y in (0.0, 1.0)]
    materials = (WHITE, BLACK, Material("mirror", 0.0, specular=1.0))
    return on_floor(rectangle(*floor), floor, [emitter, *mirrors], height, share, materials)


def ball(centre, radius):
    """A ball over a floor.

    A black ball at 400 K, an icosphere of 5120 triangles, over a diffuse floor at 0 K: polygon by polygon by Lambert's
    contour integral (Modest, chapter 4), so no tessellation is neglected.
    """
    vertices, triangles = sphere(4, radius)
    vertices = vertices + centre
    frame = (-0.1, 0.1, -0.1, 0.1)
    # a line that meets a closed convex surface meets two of its triangles
    share = mean_over(frame, lambda points: polygon_factor(points, vertices, triangles) / 2, 4)
    return on_floor(rectangle(-1, 1, -1, 1), frame, [(vertices, triangles)], 0.3, share)


def shaded(distance):
    """Blocked sky.

    A black square at 0 K over a diffuse one at 0 K, under a sky at 400 K: L = 0.5 (1 - F) B (Howell, C-11).
    """
    frame = (-0.5, 0.5, -0.5, 0.5)
    cold = (*rectangle(*frame, distance), 0.0, 1)
    share = 1 - parallel_factor(1, 1, distance)
    return on_floor(rectangle(*frame), frame, [cold], distance / 2, share, world_temperature=HOT)


# Temperature that varies over a triangle


def ramp(low, high):
    """Temperature over a triangle: what is seen.

    A black square of two triangles, whose temperature is linear from one side to the other, seen as a whole: the mean
    of Planck's law over it (Gauss and Legendre).
    """
    frame = (0.0, 1.0, 0.0, 1.0)
    vertices, triangles = rectangle(*frame)
    scene = make_scene(vertices, triangles, low, [BLACK], above(frame, 1.0), NARROW)
    scene = replace(scene, temperature=(low + (high - low) * vertices[triangles][..., 0]).astype(np.float32))
    return scene, np.array([mean_over(frame, lambda at: blackbody(NARROW, low + (high - low) * at[:, 0])[:, 0], 24)])


def ramp_over_floor(low, high):
    """Temperature over a triangle: what it lights.

    The same square 1 m over a diffuse one at 0 K. The kernel cos cos / (pi d^2) times Planck's law, integrated over
    both (Gauss and Legendre).
    """
    frame = (0.0, 1.0, 0.0, 1.0)
    floor, emitter = rectangle(*frame), rectangle(*frame, 1.0)
    scene, _ = on_floor(floor, frame, [emitter], 0.5, 1.0)
    kelvin = np.zeros((4, 3))
    kelvin[2:] = low + (high - low) * emitter[0][emitter[1]][..., 0]

    def from_floor(at):
        def received(points):
            squares = 1.0 + np.sum((points - at[:, None]) ** 2, axis=2)
            return (1 / (math.pi * squares**2) * blackbody(NARROW, low + (high - low) * points[:, 0])[:, 0]).T

        return mean_over(frame, received, 16)

    return replace(scene, temperature=kelvin.astype(np.float32)), 0.5 * np.array([mean_over(frame, from_floor, 16)])


# Mirrors


def mirrors(count):
    """A floor beside mirrors.

    A black rectangle at 400 K over a diffuse floor at 0 K, with one upright mirror that reflects 80 %, or between two:
    the sum over its mirror images, each by Lambert's contour integral and 0.8 for each reflection.
    """
    frame, at = (-0.25, 0.25, -0.5, 0.5), 0.3
    upright = [(*quad((x, 0, 0.5), (0, 2, 0), (0, 0, 0.5)), 0.0, 2) for x in (at, -at)[:count]]
    # with two mirrors the images lie at all multiples of their distance: the rectangle is symmetric between them
    images = [(0, 0), (1, 1)] if count == 1 else [(n, abs(n)) for n in range(-80, 81)]

    def received(points):
        parts = [(0.8**k, rectangle(2 * at * n - 0.2, 2 * at * n + 0.2, -0.6, 0.6, 1.0)) for n, k in images]
        return sum(weight * polygon_factor(points, *part) for weight, part in parts)

    materials = (WHITE, BLACK, Material("mirror", 0.2, specular=1.0))
    parts = [rectangle(-0.2, 0.2, -0.6, 0.6, 1.0), *upright]
    return on_floor(rectangle(*frame), frame, parts, 0.5, mean_over(frame, received), materials)


# Rough specular surfaces


def rough_view(degrees, pixels):
    """Orthographic camera at an angle from the normal, unit vector (3,) towards it, rectangle of the floor it sees."""
    angle, half = math.radians(degrees), 0.02
    towards = np.array((math.sin(angle), 0.0, math.cos(angle)))
    camera = Camera(
        pixels, pixels, look(3 * towards, (0, 0, 0)).matrix, "ORTHOGRAPHIC", frame=(-half, half, -half, half)
    )
    return camera, towards, (-half / towards[2], half / towards[2], -half, half)


def rough_plate(degrees, roughness, plate, sky, specular=1.0, emissivity=0.3):
    """Rough lobes: directional emissivity and reflectance.

    A rough plate, seen under an angle from its normal. Warm under a 0 K sky it shows its directional emissivity 1 - rho
    (1 - s + s a), cold under a warm sky its directional reflectance; a, the lobe's albedo, is the integral of the GGX
    BRDF (Heitz 2014), by a quadrature of its own. What a surface emits has no noise; the solver takes a from a table
    that is right to 1e-4, which here is the tolerance for warm plates.
    """
    camera, towards, _ = rough_view(degrees, 24)
    material = Material("rough", emissivity, specular, roughness)
    scene = make_scene(*rectangle(-2, 2, -2, 2), plate, [material], camera, NARROW, world_temperature=sky)
    reflectance = (1 - emissivity) * (1 - specular + specular * lobe_albedo(roughness**2, towards[2]))
    emitted = (1 - reflectance) * blackbody(NARROW, plate) if plate else 0.0
    return scene, emitted + (reflectance * blackbody(NARROW, sky) if sky else 0.0)


def rough_mirror(source, degrees=50.0, roughness=0.6, specular=0.8):
    """Rough lobes: what they mirror.

    A rough plate at 0 K reflects a black rectangle at 400 K, or a point light: the integral of the GGX BRDF (Heitz
    2014) and the diffuse one over the rectangle, and over what the camera sees of the plate (Gauss and Legendre).
    """
    camera, towards, frame = rough_view(degrees, 48)
    material = Material("rough", 0.3, specular, roughness)

    def brdf(light):
        return 0.7 * (specular * ggx(roughness**2, light, towards) + (1 - specular) / math.pi)

    floor = rectangle(-0.2, 0.2, -0.2, 0.2)
    if source == "point light":
        lamp = PointLight(np.array((-1.2, 0.3, 1.2)), 1000.0, temperature=1000.0)
        scene = make_scene(*floor, 0.0, [material], camera, NARROW, lights=(lamp,))

        def reflected(points):
            way = lamp.position - points
            distance = np.linalg.norm(way, axis=1)[:, None]
            return brdf(way / distance) * way[:, 2] / distance[:, 0] ** 3 * lamp.power / (4 * math.pi)

        return scene, mean_over(frame, reflected, 6) * light_share(lamp)
    *mesh, index = join((*floor, 0.0, 0), (*quad((-1.2, 0.1, 1.0), (0, 1.2, 0), (0.6, 0, 0.6)), HOT, 1))

    def seen(points):
        def from_rectangle(uv):
            at = np.array((-1.2, 0.1, 1.0)) + uv[:, :1] * (0.0, 1.2, 0.0) + uv[:, 1:2] * (0.6, 0.0, 0.6)
            way = at - points[:, None]
            distance = np.linalg.norm(way, axis=2)
            way = way / distance[..., None]
            facing = np.abs(way @ (1, 0, -1)) / math.sqrt(2)
            area = 4 * 1.2 * math.hypot(0.6, 0.6)
            return (brdf(way) * way[..., 2] * facing / distance**2 * area).T

        return mean_over((-1.0, 1.0, -1.0, 1.0), from_rectangle, 32)

    scene = make_scene(*mesh, [material, BLACK], camera, NARROW, index)
    return scene, mean_over(frame, seen, 4) * blackbody(NARROW, HOT)


def rough_emitter():
    """Rough lobes: what they light.

    An upright rough plate at 400 K (e = 0.1) lights a small diffuse floor at 0 K at an angle, with its directional
    emissivity, integrated over both (Gauss and Legendre). Less than 1e-5 comes back by way of the plate.
    """
    frame, half, centre = (-0.02, 0.02, -0.02, 0.02), 0.1, np.array((0.4, 0.0, 0.8))
    plate = quad(centre, (0, half, 0), (0, 0, half))
    cosines = np.linspace(0.3, 0.6, 31)
    emissivity = [1 - 0.9 * lobe_albedo(1.0, cosine) for cosine in cosines]

    def received(points):
        def from_plate(uv):
            way = centre + half * np.column_stack((np.zeros(len(uv)), uv[:, :2])) - points[:, None]
            distance = np.linalg.norm(way, axis=2)
            facing, rise = way[..., 0] / distance, way[..., 2] / distance
            return (np.interp(facing, cosines, emissivity) * facing * rise / (math.pi * distance**2)).T

        return mean_over((-1.0, 1.0, -1.0, 1.0), from_plate, 16) * (2 * half) ** 2

    materials = (WHITE, Material("rough", 0.1, 1.0, 1.0))
    return on_floor(rectangle(*frame), frame, [plate], 0.3, mean_over(frame, received, 4), materials)


# Lights


def light_share(light):
    """What of 1 W, or 1 W/m2, of a light lies in the band NARROW: that of a blackbody."""
    return math.pi * blackbody(NARROW, light.temperature) / (SIGMA * light.temperature**4)


def light(kind):
    """Lights on a floor.

    A diffuse floor reflects half of the irradiance E: I cos / d^2 under a point light, a sphere or a spot light (I the
    power over the solid angle), S cos under a sun, M F under a square or round area light (M the power over the area, F
    by Lambert's contour integral). The band gets pi B / (sigma T^4) of it.
    """
    frame, at = (0.2, 0.6, -0.2, 0.2), np.array((0.0, 0.1, 1.5))
    down = np.array((0.0, 0.0, -1.0))

    def from_point(intensity):
        def received(points):
            return intensity * at[2] / np.sum((at - points) ** 2, axis=1) ** 1.5

        return received

    everywhere = from_point(1000.0 / (4 * math.pi))
    half = 0.4
    lamp, received = {
        "point": (PointLight(at, 1000.0), everywhere),
        "sphere": (PointLight(at, 1000.0, radius=0.3), everywhere),
        "spot": (SpotLight(at, down, 1000.0, 1.4), from_point(1000.0 / (2 * math.pi * (1 - math.cos(0.7))))),
        "sun": (SunLight(np.array((0.6, 0.0, -0.8)), 800.0), lambda points: np.full(len(points), 800.0 * 0.8)),
        "square": (
            AreaLight(at, np.array((half, 0, 0)), np.array((0, half, 0)), 1000.0),
            lambda points: 1000.0 / (4 * half**2) * polygon_factor(points - (*at[:2], 0), *square_at(half, at[2])),
        ),
        "disk": (
            AreaLight(at, np.array((half, 0, 0)), np.array((0, half, 0)), 1000.0, ellipse=True),
            lambda points: 1000.0 / (math.pi * half**2) * polygon_factor(points - (*at[:2], 0), *disk(half, at[2])),
        ),
    }[kind]
    scene = make_scene(*rectangle(-3, 3, -3, 3), 0.0, [WHITE], above(frame, 1.0), NARROW, lights=(lamp,))
    return scene, 0.5 / math.pi * mean_over(frame, received) * light_share(lamp)


def square_at(half, height):
    """Horizontal square around the z axis."""
    return rectangle(-half, half, -half, half, height)


OFF, WRONG = {"reference_subtraction": False}, {"reference_temperature": 333.0}
FEW = {"photons_per_pass": 1000}  # where shadow rays bring the light, and photons none
SETTINGS = {"": {}, ", subtraction off": OFF, ", wrong T0": WRONG}
GREY, STRIPES = Material("grey", 0.6), Material("spectral", np.array([[9.9, 0.1], [10.0, 0.8], [10.1, 0.3]]))
HALF = Material("mirror and diffuse", 0.4, specular=0.5)
ROUGH, VERY_ROUGH = Material("rough", 0.5, 0.7, 0.6), Material("very rough", 0.3, 1.0, 1.0)
ONE, OTHER = (0.2, 0.9, 0.5), (0.5, 0.9, 0.2)  # emissivities in THERMAL


def in_all_settings(name, build, **arguments):
    """A case with the subtraction, without it and with a wrong T0."""
    return [Case(name + label, build, arguments, settings) for label, settings in SETTINGS.items()]


CASES = [
    *[Case(f"{kelvin:g} K", black_plane, {"temperature": kelvin}) for kelvin in (293.15, 300.0, 500.0, 1000.0)],
    *in_all_settings("grey walls", isothermal, material=GREY),
    *in_all_settings("spectral walls", isothermal, material=STRIPES),
    *in_all_settings("half mirrors", isothermal, material=HALF),
    *in_all_settings("rough walls", isothermal, material=ROUGH),
    *in_all_settings("very rough walls", isothermal, material=VERY_ROUGH),
    Case("grey walls, rough ball, subtraction off", isothermal, {"material": GREY, "ball": ROUGH}, OFF, short=False),
    Case("rough walls, half mirror ball, wrong T0", isothermal, {"material": ROUGH, "ball": HALF}, WRONG, short=False),
    *in_all_settings("hot, e = 0.8 / 0.4", plates, view="hot"),
    *in_all_settings("cold, e = 0.8 / 0.4", plates, view="cold"),
    Case("both in the mirrors, e = 0.8 / 0.4", plates, {"view": "both"}, short=False),
    Case("cold, e = 0.1 / 0.05", plates, {"view": "cold", "hot": 0.1, "cold": 0.05}, short=False),
    Case("hot, half mirrors", plates, {"view": "hot", "specular": 0.5}, short=False),
    Case("cold, mirrors", plates, {"view": "cold", "specular": 1.0}, short=False),
    Case("hot, three bands", plates, {"view": "hot", "hot": ONE, "cold": OTHER, "edges": THERMAL}),
    *in_all_settings("cap, e = 0.3 / 0.9", closed_sphere, view="cap"),
    *in_all_settings("rest, e = 0.3 / 0.9", closed_sphere, view="rest"),
    Case("rest, e = 0.05 / 0.05", closed_sphere, {"view": "rest", "cap": 0.05, "rest": 0.05}, short=False),
    Case("rest, three bands", closed_sphere, {"view": "rest", "cap": ONE, "rest": OTHER, "edges": THERMAL}),
    Case("rest, ramp", closed_sphere, {"view": "rest", "rest": 0.4, "hottest": 500.0}),
    Case("inner, e = 0.8 / 0.4", concentric, {"view": "inner"}),
    Case("outer, e = 0.8 / 0.4", concentric, {"view": "outer"}, short=False),
    Case("outer, e = 0.8 / 0.4, subtraction off", concentric, {"view": "outer"}, OFF, short=False),
    Case("inner, all wavelengths", concentric, {"view": "inner", "edges": ALL}, short=False),
    Case("outer, all wavelengths", concentric, {"view": "outer", "edges": ALL}, short=False),
    Case("inner, three bands", concentric, {"view": "inner", "inner": ONE, "outer": OTHER, "edges": THERMAL}),
    Case("outer, three bands", concentric, {"view": "outer", "inner": ONE, "outer": OTHER, "edges": THERMAL}),
    *in_all_settings("f = 0.01, e = 0.5", cavity, cut=0.98),
    *in_all_settings("f = 0.1, e = 0.5", cavity, cut=0.8),
    Case("f = 0.5, e = 0.5", cavity, {"cut": 0.0}, short=False),
    Case("f = 0.1, e = 0.1, sky 270 K", cavity, {"cut": 0.8, "emissivity": 0.1, "sky": 270.0}, short=False),
    Case("f = 0.1, three bands", cavity, {"cut": 0.8, "emissivity": ONE, "edges": THERMAL}, short=False),
    Case("radii 1 and 1 m, distance 1 m", disks, {"receiver": 1, "emitter": 1, "distance": 1}),
    Case("radii 1 and 1 m, distance 2 m", disks, {"receiver": 1, "emitter": 1, "distance": 2}, short=False),
    Case("radii 1 and 1 m, distance 0.25 m", disks, {"receiver": 1, "emitter": 1, "distance": 0.25}, short=False),
    Case("radii 1 and 0.5 m, distance 0.5 m", disks, {"receiver": 1, "emitter": 0.5, "distance": 0.5}, short=False),
    Case("radii 0.5 and 2 m, distance 0.5 m", disks, {"receiver": 0.5, "emitter": 2, "distance": 0.5}),
    Case("radii 1 and 1 m, distance 5 m", disks, {"receiver": 1, "emitter": 1, "distance": 5}, short=False),
    Case("1 x 1 m, distance 1 m", parallel, {"a": 1, "b": 1, "distance": 1}),
    Case("1 x 1 m, distance 2 m", parallel, {"a": 1, "b": 1, "distance": 2}, short=False),
    Case("1 x 1 m, distance 0.25 m", parallel, {"a": 1, "b": 1, "distance": 0.25}),
    Case("2 x 0.5 m, distance 0.4 m", parallel, {"a": 2, "b": 0.5, "distance": 0.4}, short=False),
    Case("floor 1 m, wall 1 m, edge 1 m", corner, {"width": 1, "height": 1, "edge": 1}),
    Case("floor 2 m, wall 0.5 m, edge 1 m", corner, {"width": 2, "height": 0.5, "edge": 1}, short=False),
    Case("floor 0.3 m, wall 1 m, edge 2 m", corner, {"width": 0.3, "height": 1, "edge": 2}, short=False),
    Case("parallel, distance 1 m", strips, short=False),
    Case("parallel, distance 0.3 m", strips, {"distance": 0.3}),
    Case("at 90 degrees", strips, {"angle": math.pi / 2}, short=False),
    Case("at 120 degrees", strips, {"angle": 2 * math.pi / 3}, short=False),
    Case("radius 0.2 m, 1 m above", ball, {"centre": (0, 0, 1), "radius": 0.2}, FEW),
    Case("radius 0.4 m, at an angle", ball, {"centre": (0.8, 0.3, 0.7), "radius": 0.4}, short=False),
    Case("distance 1 m", shaded, {"distance": 1.0}, short=False),
    Case("distance 0.25 m", shaded, {"distance": 0.25}),
    Case("280 to 320 K", ramp, {"low": 280.0, "high": 320.0}),
    Case("250 to 500 K", ramp, {"low": 250.0, "high": 500.0}),
    Case("250 to 500 K", ramp_over_floor, {"low": 250.0, "high": 500.0}),
    Case("one mirror", mirrors, {"count": 1}, short=False),
    Case("two mirrors", mirrors, {"count": 2}, short=False),
    *[
        Case(f"{label}, {angle} degrees, roughness {roughness}", rough_plate,
             {"degrees": angle, "roughness": roughness, "plate": plate, "sky": sky}, settings, tolerance)
        for label, plate, sky, settings, tolerance in (
            ("warm", 300.0, 0.0, {}, ALBEDO * 0.7 / 0.3), ("cold", 0.0, 300.0, OFF, FLOAT32)
        )
        for angle, roughness in ((0, 0.5), (60, 0.5), (80, 0.5), (60, 1.0), (80, 1.0))
    ],
    Case("rectangle", rough_mirror, {"source": "rectangle"}, FEW),
    Case("rectangle, narrow lobe", rough_mirror, {"source": "rectangle", "roughness": 0.3}, FEW, short=False),
    Case("point light", rough_mirror, {"source": "point light"}, FEW),
    Case("upright plate", rough_emitter, {}, FEW),
    *[Case(kind, light, {"kind": kind}, FEW) for kind in ("point", "spot", "sun", "square", "disk")],
    Case("sphere", light, {"kind": "sphere"}, FEW, short=False),
]  # fmt: skip
