# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of diffuse and mirror materials as any renderer can take it: radiances and reflectances in numbers."""

import hashlib
from dataclasses import dataclass, fields, replace

import numpy as np

from tests.benchmarks.peers.gas import Gas, build_gas
from tests.benchmarks.peers.skins import Skin, build_skins, interpolation, lets_through, needs_skin, take_skins

_WALKS, _BOUNCES, _SHIFT = 200_000, 12, 1e-5
_SLIPS = 1e-4  # share of rays that slip through edges, which do not count
_LOOKS, _SIGHT = 32, 0.05  # rays from a side that no walk met, and share of them that must meet sides that walks did
_SKY = 1024  # zenith angles and azimuths of the radiance of a sky, at least


@dataclass
class Problem:
    """Everything a peer needs, arrays only, so that it travels in an npz file.

    vertices (n, 3) m. triangles (m, 3) int32, fronts (counter-clockwise) are what can be seen; the few that are seen
    from both sides are there twice, the last `twins` of them behind their twins. part (m,) int32. Of each part p, in
    each of B bands: emission (p, B) W m-2 sr-1 and reflectance (p, B); mirror (p,) bool, else diffuse. world (B,)
    radiance of the surroundings. matrix (4, 4) camera to world; tangent: of half the horizontal field of view. offset
    (B,) radiance that the images get on top. lobes (p, 2): share of the reflectance that is specular, and its alpha;
    None where `mirror` says all, as most peers need it.
    gas: between the surfaces, None without. skins: surfaces that vary; they are not among the triangles. sky (h, w, B):
    radiance by direction, as Mitsuba's `envmap` has it with +z up, in place of world; None where that is the same.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    part: np.ndarray
    emission: np.ndarray
    reflectance: np.ndarray
    mirror: np.ndarray
    world: np.ndarray
    matrix: np.ndarray
    tangent: float
    width: int
    height: int
    offset: np.ndarray
    lobes: np.ndarray | None = None
    gas: Gas | None = None
    skins: tuple[Skin, ...] = ()
    sky: np.ndarray | None = None
    twins: int = 0

    def arrays(self) -> dict[str, np.ndarray]:
        """All that it consists of, by name."""
        own = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in ("gas", "skins")}
        arrays = {name: array for name, array in own.items() if array is not None}
        for i, skin in enumerate(self.skins):
            arrays |= skin.arrays(i)
        return arrays | (self.gas.arrays() if self.gas else {})

    def digest(self) -> str:
        """Twelve letters that change with the problem: references are kept under this name."""
        of = hashlib.sha256()
        for name, value in self.arrays().items():
            is_text = np.asarray(value).dtype.kind == "U"
            of.update(f"{name} {value}".encode() if is_text else np.round(np.asarray(value, float), 7).tobytes())
        return of.hexdigest()[:12]

    def save(self, path):
        np.savez(path, **self.arrays())

    @classmethod
    def load(cls, path):
        with np.load(path) as file:
            arrays = {name: array[()] for name, array in file.items()}
        gas, skins = Gas.from_arrays(arrays), take_skins(arrays)
        return cls(**arrays, gas=gas, skins=skins)

    @property
    def groups(self) -> list[list[int]]:
        """Bands of each run, three at a time."""
        count = len(self.world)
        return [list(range(first, min(first + 3, count))) for first in range(0, count, 3)]

    def of_bands(self, bands: list[int]) -> tuple["Problem", np.ndarray]:
        """The problem of three bands (the last repeated if there are fewer), and the unit (3,) of its radiances.

        These are in units of the largest in the band, so that they are near 1.
        """
        three = (bands + [bands[-1]] * 2)[:3]
        others = *(skin.emission for skin in self.skins), *(() if self.sky is None else (self.sky,))
        radiances = np.vstack([each.reshape(-1, len(self.world)) for each in (self.emission, self.world, *others)])
        scale = np.abs(radiances[:, three]).max(axis=0)
        if self.gas is not None:
            scale = np.maximum(scale, self.gas.brightest()[three])
        scale[scale == 0] = 1.0
        part = replace(
            self,
            emission=self.emission[:, three] / scale,
            reflectance=self.reflectance[:, three],
            world=self.world[three] / scale,
            offset=self.offset[three] / scale,
            gas=self.gas and self.gas.of_bands(three, scale),
            skins=tuple(skin.of_bands(three, scale) for skin in self.skins),
            sky=None if self.sky is None else self.sky[..., three] / scale,
        )
        return part, scale

    def meshes(self, twins: bool = True):
        """(part, vertices (n, 3) float32, triangles (m, 3) int32) of every part, with twins or without."""
        count = len(self.triangles) - (0 if twins else self.twins)
        for part in range(len(self.mirror)):
            corners, triangles = np.unique(self.triangles[:count][self.part[:count] == part], return_inverse=True)
            yield part, self.vertices[corners].astype(np.float32), triangles.reshape(-1, 3).astype(np.int32)

    @property
    def camera(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, a point ahead and the direction up, (3,) each.

        The point is as far away as the scene is large: peers subtract the position in float32. In a scene of 1000 m a
        point 1 m ahead would turn the camera by up to 1e-4, a hundredth of a pixel of 64 in the width.
        """
        right, up, backward, position = self.matrix[:3].T
        return position, position - np.abs(self.vertices).max() * backward, up


def build_problem(scene, reference: float = 0.0, all_lobes: bool = False) -> Problem:
    """The scene's problem; with a reference (K), that of its excess over an isothermal scene, to which it is equal by
    linearity: emission is e(T) - eps B(T0) and offset B(T0).

    all_lobes: also surfaces that are specular in part, and rough ones at the reference. What a rough lobe loses is
    emitted at an angle, which no peer can; at the reference it is no excess. And skins and a sky, as Mitsuba has them.
    """
    from addon.solver import Settings
    from addon.solver.physics.spectrum import band_radiance
    from addon.solver.planning.preparation import prepare

    bad = [] if all_lobes else [m.name for m in scene.materials if m.specular % 1.0 or (m.specular and m.roughness)]
    rough = np.array([m.alpha > 0.0 for m in scene.materials])[scene.material]
    bad += ["rough surfaces that are not at the reference"] if np.any(scene.temperature[rough] != reference) else []
    skinned = needs_skin(scene)
    bad += ["skins or a sky"] if not all_lobes and (skinned.any() or scene.sky is not None) else []
    if bad or scene.lights or scene.temperature.ndim > 1:
        raise ValueError(f"Only diffuse and mirror materials, emitting geometry and one temperature a triangle: {bad}")
    edges = scene.band_edges
    reflectance = prepare(scene, Settings(threads=2)).stage.radiometry.reflectance.astype(float)
    pairs = np.column_stack((scene.material, scene.temperature))[~skinned]
    parts, part = np.unique(pairs, axis=0, return_inverse=True)
    material = parts[:, 0].astype(int)
    black = band_radiance(edges, reference)
    emission = [band_radiance(edges, t, scene.materials[int(m)].curve) for m, t in parts]
    vertices, triangles, part, lost = _fronts(scene, part.ravel().astype(np.int32), ~skinned)
    if lost > _SLIPS and any(medium.outline is None for medium in scene.media):
        raise ValueError("Peers get the gas of the world in a box around the scene, which must let no ray out")
    return Problem(
        vertices,
        triangles,
        part,
        np.reshape(emission, (-1, len(black))) - (1 - reflectance[material]) * black,
        reflectance[material],
        np.array([scene.materials[m].specular == 1.0 for m in material]),
        band_radiance(edges, scene.world_temperature) - black,
        scene.camera.matrix,
        scene.camera.frame[1],
        scene.camera.width,
        scene.camera.height,
        black,
        np.array([(scene.materials[m].specular, scene.materials[m].alpha) for m in material]) if all_lobes else None,
        build_gas(scene, black),
        build_skins(scene, reflectance, black),
        _sky_radiance(scene.sky, edges, black),
        len(triangles) - np.count_nonzero(~skinned),
    )


def _sky_radiance(sky, edges, black):
    """(h, w, B) excess radiance of a sky. Row 0 is straight up, the last one down; columns start half of one from -x
    and go on by way of +y. None without a sky. Of an image all values are among them, so that no kink is rounded.
    """
    from addon.solver.physics.spectrum import band_radiance

    if sky is None:
        return None
    if sky.wavelengths is not None:
        raise ValueError("Peers take skies of the same apparent temperature at all wavelengths")
    if sky.zenith is not None:
        of_rows = band_radiance(edges, np.interp(np.linspace(0.0, 180.0, _SKY), sky.zenith, sky.kelvin))
        return np.repeat(of_rows[:, None] - black, 4, axis=1)
    height, width = sky.kelvin.shape
    rows, columns = 2 * height * -(-_SKY // (2 * height)) + 1, width * (2 * (_SKY // (2 * width)) + 1)
    down, turn = np.linspace(0.0, 1.0, rows), (np.arange(columns) + 0.5) / columns
    up = interpolation(np.clip((1.0 - down) * height - 0.5, 0.0, height - 1.0), height, False)
    around = interpolation(turn * width - 0.5, width, True)
    excess = band_radiance(edges, sky.kelvin.ravel().astype(float)).reshape(height, width, -1) - black
    return np.einsum("rh,hwb,cw->rcb", up, excess, around, optimize=True)


def _fronts(scene, part, kept):
    """The triangles kept (m,) of a scene, with their parts, turned so that the sides that paths from the camera reach
    are fronts (most renderers' lights shine from fronts only); where both sides are reached, two triangles, a hair
    apart. And the share of the paths that get lost.
    """
    vertices, triangles = np.asarray(scene.vertices, float), np.asarray(scene.triangles, np.int32)
    reached, lost = _reached_sides(scene, vertices, triangles)
    triangles, reached = triangles[kept], reached[kept]
    both = reached.all(axis=1)
    back_only = ~reached[:, 0]
    triangles = np.where(back_only[:, None], triangles[:, ::-1], triangles)
    a, b, c = vertices[triangles[both]].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal *= _SHIFT * np.ptp(vertices, axis=0).min() / np.linalg.norm(normal, axis=1, keepdims=True)
    behind = (vertices[triangles[both]] - normal[:, None])[:, ::-1].reshape(-1, 3)
    twins = len(vertices) + np.arange(len(behind), dtype=np.int32).reshape(-1, 3)
    both_sides = (vertices, behind), (triangles, twins), (part, part[both])
    return *map(np.concatenate, both_sides), lost


def _reached_sides(scene, vertices, triangles):
    """(m, 2) bool: whether walks from the camera, bouncing at random, meet the front and the back of each triangle, or
    would, if there were more; the front, if neither. And the share of the walks that leave the scene."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    random = np.random.default_rng(0)
    embree = EmbreeScene()
    TriangleMesh(embree, vertices.astype(np.float32), triangles)
    normals = np.cross(*(vertices[triangles[:, i]] - vertices[triangles[:, 0]] for i in (1, 2)))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    left, right, bottom, top = scene.camera.frame
    direction = np.column_stack(
        (random.uniform(left, right, _WALKS), random.uniform(bottom, top, _WALKS), -np.ones(_WALKS))
    )
    direction = direction @ scene.camera.matrix[:3, :3].T
    origin = np.broadcast_to(scene.camera.matrix[:3, 3], direction.shape)
    counts, open_ones = np.zeros((len(triangles), 2), int), lets_through(scene)
    for _ in range(_BOUNCES):
        hits = embree.run(origin.astype(np.float32), direction.astype(np.float32), output=True)
        hit = hits["primID"] >= 0
        triangle, origin, direction = hits["primID"][hit], origin[hit], direction[hit]
        normal = normals[triangle]
        back = np.sum(direction * normal, axis=1) > 0
        np.add.at(counts, (triangle, back.astype(int)), 1)
        normal = np.where(back[:, None], -normal, normal)
        passes = open_ones[triangle] & (random.random(len(triangle)) < 0.5)
        distance, normal = np.asarray(hits["tfar"])[hit], np.where(passes[:, None], -normal, normal)
        origin = origin + distance[:, None] * direction + 1e-5 * np.ptp(vertices, axis=0).min() * normal
        scattered = random.normal(size=origin.shape)
        diffuse = normal + scattered / np.linalg.norm(scattered, axis=1, keepdims=True)
        mirrored = direction - 2 * np.sum(direction * normal, axis=1, keepdims=True) * normal
        is_mirror = np.array([m.specular for m in scene.materials])[scene.material[triangle]] == 1
        direction = np.where(passes[:, None], direction, np.where(is_mirror[:, None], mirrored, diffuse))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    reached = counts > _SLIPS * np.maximum(counts.sum(axis=1, keepdims=True), 1)
    reached[:, 0] |= ~reached.any(axis=1)
    _reach_on(embree, (vertices, triangles, normals), reached, random)
    return reached, 1.0 - len(origin) / _WALKS


def _reach_on(embree, mesh, reached, random):
    """Add to reached (m, 2) the sides of open meshes that see sides which are reached: the gap behind a pane, some
    streets away, is met by no walk, and is in the picture all the same. mesh: vertices, triangles and their normals."""
    vertices, triangles, normals = mesh
    is_open = ~on_closed_meshes(vertices, triangles)
    while True:
        t, side = np.nonzero(~reached & is_open[:, None])
        ray = np.repeat(np.arange(len(t)), _LOOKS)
        outwards = normals[t] * np.where(side, -1.0, 1.0)[:, None]
        share = np.sort(random.random((2, len(ray))), axis=0)
        share = np.stack((share[0], share[1] - share[0], 1.0 - share[1]))  # even over the triangle
        origin = np.einsum("kr,rki->ri", share, vertices[triangles[t[ray]]])
        origin += 1e-5 * np.ptp(vertices, axis=0).min() * outwards[ray]
        scattered = random.normal(size=origin.shape)
        direction = outwards[ray] + scattered / np.linalg.norm(scattered, axis=1, keepdims=True)
        found = embree.run(origin.astype(np.float32), direction.astype(np.float32))
        back = np.einsum("ri,ri->r", direction, normals[found]) > 0
        sees = (found >= 0) & reached[found, back.astype(int)]
        new = np.bincount(ray, sees, len(t)) > _SIGHT * _LOOKS
        if not new.any():
            return
        reached[t[new], side[new]] = True


def on_closed_meshes(vertices, triangles):
    """(m,) bool, which triangles are part of a closed mesh (see open_edge): of all that vertices connect."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    from addon.solver.geometry.closed import open_edge

    corner = np.unique(vertices, axis=0, return_inverse=True)[1].ravel()[triangles]
    ends = corner[:, [0, 0]].ravel(), corner[:, 1:].ravel()
    size = (len(vertices),) * 2
    mesh = connected_components(coo_array((np.ones(len(ends[0])), ends), shape=size), directed=False)[1][corner[:, 0]]
    corners = {each: vertices[triangles[mesh == each]].reshape(-1, 3) for each in np.unique(mesh)}
    is_closed = (open_edge(own, np.arange(len(own)).reshape(-1, 3)) is None for own in corners.values())
    return np.isin(mesh, [each for each, closed in zip(corners, is_closed, strict=True) if closed])
