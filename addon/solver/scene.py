# SPDX-License-Identifier: GPL-3.0-or-later
"""The immutable input of a render: surfaces, materials, lights, camera and bands.

Units everywhere: metres, kelvin, micrometres, watts. World coordinates are right-handed, as in Blender.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np

SUN_TEMPERATURE = 5772.0  # K, nominal effective temperature of the Sun (IAU 2015 resolution B3)
HOTTEST = 1e6  # K: apparent temperatures are tabulated to twice that
_NARROWEST_CONE = 1e-7  # rad; below, rounding leaves nothing of 1 - cos of half of it
NARROWEST_SPREAD = np.pi / 180.0  # rad, of area lights: shadow rays seldom find what shines into less
LAMP_TEMPERATURE = 2856.0  # K, CIE standard illuminant A: an incandescent lamp


class SceneError(ValueError):
    """The scene cannot be rendered; the message names the object and the value."""


# Alpha of the GGX lobe below which a surface is a mirror: the lobe is then narrower than a float32 direction resolves.
MIRROR_ALPHA = 1e-4
MOLECULES = "H2O", "CO2", "CO", "CH4"  # whose lines a gas may have
SOOT = "soot"
SPECIES = *MOLECULES, SOOT
ATMOSPHERE = 101325.0  # Pa
_ROUNDING = 1e-6  # of sums of properties that were given in float32
_STEP = 1e-9  # width of the step to 0 at the ends of a response, as a share of the wavelength
LEAF = 8  # cells along an edge of a leaf of a grid, as in OpenVDB
_WIDEST = 1 << 24  # leaves in the box around those of a grid, at most: 2048^3 cells; 4 bytes are kept for each


@dataclass(frozen=True)
class Material:
    """A surface: emissivity eps, transmittance tau, reflectance 1 - eps - tau (Kirchhoff). Two lobes share the
    reflectance.

    name: shown in messages.
    emissivity: a float (grey), or an (n, 2) array of [wavelength um, emissivity], wavelengths ascending,
        linear between the points and held constant outside. 0..1. With Fresnel's law it is that along the normal.
    transmittance: likewise, what passes straight through a thin sheet, from both sides alike and at every angle; 0 for
        what is opaque. eps + tau is at most 1 at every wavelength.
    specular: share of the reflectance in the specular lobe, 0..1; the rest is diffuse.
    roughness: 0 is a mirror, 1 the roughest GGX lobe (alpha = roughness^2).
    fresnel: whether the specular lobe follows Fresnel's law, see physics.fresnel.
    constants: (n, 3) array of [wavelength um, n, k], for Fresnel's law; the emissivity then follows from them. None: a
        dielectric, with the index that gives the lobe's reflectance along the normal.
    """

    name: str = "Material"
    emissivity: float | np.ndarray = 0.95
    specular: float = 0.0
    roughness: float = 0.0
    fresnel: bool = False
    constants: np.ndarray | None = None
    transmittance: float | np.ndarray = 0.0

    @property
    def alpha(self) -> float:
        """Width of the GGX lobe; 0 for a mirror, and where there is no specular lobe."""
        alpha = self.roughness**2
        return alpha if self.specular > 0 and alpha > MIRROR_ALPHA else 0.0

    @property
    def follows_fresnel(self) -> bool:
        """Whether emission and reflection depend on the angle by Fresnel's law: it is that of the specular lobe."""
        return self.fresnel and self.specular > 0

    @property
    def transmits(self) -> bool:
        """Whether light passes straight through, at some wavelength."""
        return bool(np.any(self.transmitted_curve[1] > 0.0))

    def __post_init__(self):
        for label in ("emissivity", "transmittance"):
            _check_curve(np.asarray(getattr(self, label), dtype=np.float64), f"Material '{self.name}': {label}")
        for label in ("specular", "roughness"):
            value = getattr(self, label)
            if not 0.0 <= value <= 1.0:
                raise SceneError(f"Material '{self.name}': {label} {value:g} is outside 0..1")
        if self.constants is not None:
            _check_constants(np.asarray(self.constants, dtype=np.float64), self.name, self.fresnel)
        if self.transmits:
            self._check_transmittance()

    def _check_transmittance(self) -> None:
        if self.follows_fresnel:
            raise SceneError(f"Material '{self.name}': a thin sheet with a transmittance cannot follow Fresnel's law")
        curves = self.curve, self.transmitted_curve
        um = np.unique(np.concatenate([wavelengths for wavelengths, _ in curves]))
        emitted, passed = (np.interp(um, *curve) for curve in curves)
        worst = int(np.argmax(emitted + passed))
        if emitted[worst] + passed[worst] > 1.0 + _ROUNDING:
            at = f"at {um[worst]:g} um " if len(um) > 1 else ""
            raise SceneError(
                f"Material '{self.name}': {at}the emissivity {emitted[worst]:g} and the transmittance "
                f"{passed[worst]:g} are more than 1 together"
            )

    @property
    def curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths (n,) in um and emissivities (n,) along the normal, float64; a grey material has one point."""
        if self.constants is not None:
            wavelengths, n, k = np.asarray(self.constants, dtype=np.float64).T
            return np.ascontiguousarray(wavelengths), 4.0 * n / ((n + 1.0) ** 2 + k * k)
        return _points_of(self.emissivity)

    @property
    def transmitted_curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths (n,) in um and transmittances (n,), float64; one point if it is the same at all."""
        return _points_of(self.transmittance)


def _points_of(value: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (n,) in um and values (n,), float64, of a number or of pairs."""
    points = np.asarray(value, dtype=np.float64)
    if points.ndim == 0:
        return np.array([1.0]), points[None]
    return np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])


def _check_curve(points: np.ndarray, owner: str) -> None:
    """Raise SceneError unless points are one number or pairs of wavelength and value, 0..1. owner: as messages begin,
    with the property's name last."""
    name = owner.rpartition(" ")[2]
    if points.ndim == 2 and points.shape[1] == 2 and len(points):
        wavelengths, values = points[:, 0], points[:, 1]
        check_wavelengths(wavelengths, owner)
    elif points.ndim == 0:
        values = points[None]
    else:
        raise SceneError(f"{owner} must be a number or pairs of um and {name}, got an array of shape {points.shape}")
    outside = ~((values >= 0.0) & (values <= 1.0))  # also true for NaN
    if np.any(outside):
        raise SceneError(f"{owner} {values[outside][0]:g} is outside 0..1")


def _check_constants(table: np.ndarray, name: str, fresnel: bool) -> None:
    owner = f"Material '{name}': optical constants"
    if table.ndim != 2 or table.shape[1] != 3 or not len(table):
        raise SceneError(f"{owner} must be rows of um, n and k, got an array of shape {table.shape}")
    check_wavelengths(table[:, 0], owner)
    bad = ~((table[:, 1] > 0.0) & (table[:, 2] >= 0.0) & np.isfinite(table).all(axis=1))
    if np.any(bad):
        um, n, k = table[bad][0]
        raise SceneError(f"{owner} at {um:g} um: n {n:g} must be above 0 and k {k:g} not below 0")
    if not fresnel:
        raise SceneError(f"{owner} are given, but no Fresnel's law")


EXTENSIONS = "REPEAT", "EXTEND", "CLIP", "MIRROR"


@dataclass(frozen=True)
class Texture:
    """An image of numbers over the unit square of texture coordinates, u to the right and v upwards.

    values: (height, width) float32; row 0 is the lowest. extension: what there is outside the square, one of
        EXTENSIONS: the image again, its edge, nothing, or the image mirrored; where there is nothing, what a surface
        has without the image counts. closest: whether values are constant over each texel; else they are bilinear
        between the middles of texels.
    """

    values: np.ndarray
    extension: str = "REPEAT"
    closest: bool = False

    def __post_init__(self):
        if self.values.ndim != 2 or self.values.size == 0:
            raise SceneError(f"A texture needs values (height, width), got an array of shape {self.values.shape}")
        if self.extension not in EXTENSIONS:
            raise SceneError(f"Extension '{self.extension}' of a texture is none of {', '.join(EXTENSIONS)}")


@dataclass(frozen=True)
class Textures:
    """What varies over r of a scene's triangles, sampled where light meets them.

    triangle: (r,) int32, ascending, which triangles. uv: (r, 3, 2) float32, texture coordinates at their corners.
    temperature_image: (r,) int32, index into images, of kelvin; -1 where the scene's temperature counts.
    mixed: (r,) int32, material that is there in part, in place of the triangle's own; -1 for none.
    share: (r, 3) float32, 0..1, how much of it, at the corners; linear between. share_image: (r,) int32, index into
        images, which say how much instead; -1 for none.
    images: see Texture.
    """

    _INDICES = "temperature_image", "share_image", "mixed"

    triangle: np.ndarray
    uv: np.ndarray
    temperature_image: np.ndarray
    mixed: np.ndarray
    share: np.ndarray
    share_image: np.ndarray
    images: tuple[Texture, ...] = ()

    @property
    def temperatures(self) -> tuple[Texture, ...]:
        """The images of temperatures."""
        return self._used(self.temperature_image)

    def _used(self, index: np.ndarray) -> tuple[Texture, ...]:
        return tuple(self.images[i] for i in np.unique(index[index >= 0]))

    def check(self, triangles: int, materials: int) -> None:
        """Raise SceneError for what makes no sense in a scene of so many triangles and materials."""
        count = len(self.triangle)
        for name, shape in (("uv", (3, 2)), ("share", (3,)), *((index, ()) for index in self._INDICES)):
            if getattr(self, name).shape != (count, *shape):
                raise SceneError(f"Textures: {name} has shape {getattr(self, name).shape}, expected {(count, *shape)}")
        limits = (triangles, len(self.images), len(self.images), materials)
        for name, low, stop in zip(("triangle", *self._INDICES), (0, -1, -1, -1), limits, strict=True):
            index = getattr(self, name)
            if count and not (low <= index.min() and index.max() < stop):
                raise SceneError(f"Textures: {name} runs from {index.min()} to {index.max()}, of {stop}")
        if np.any(np.diff(self.triangle) <= 0):
            raise SceneError("Textures: triangles must ascend")
        if not np.isfinite(self.uv).all():
            bad = self.triangle[int(np.flatnonzero(~np.isfinite(self.uv).all(axis=(1, 2)))[0])]
            raise SceneError(f"Triangle {bad}: its texture coordinates are not finite")
        for kelvin in (end for image in self.temperatures for end in (image.values.min(), image.values.max())):
            check_temperature(float(kelvin), "Image of temperatures")  # NaN is both ends
        for values in (self.share, *(image.values for image in self._used(self.share_image))):
            if values.size and not (values.min() >= 0.0 and values.max() <= 1.0):
                raise SceneError(
                    f"Shares of a mixed material run from {values.min():g} to {values.max():g}, beyond 0..1"
                )


@dataclass(frozen=True)
class Sky:
    """What rays that leave the scene see, by direction: apparent temperatures, with +z up.

    kelvin: (n,) float, K, by zenith angle; or (n, m) by zenith angle and wavelength; or, without zenith angles, an
        equirectangular image (height, width), whose row 0 looks straight down and whose middle looks along +x, as
        Blender has it.
    zenith: (n,) degrees, ascending, 0 straight up; linear between, held constant outside. None of an image.
    wavelengths: (m,) um, ascending; likewise. None where the apparent temperature is the same at all.

    Raises SceneError if a value makes no sense.
    """

    kelvin: np.ndarray
    zenith: np.ndarray | None = None
    wavelengths: np.ndarray | None = None

    def __post_init__(self):
        shape = self.kelvin.shape
        if self.zenith is None:
            if self.kelvin.ndim != 2 or 0 in shape or self.wavelengths is not None:
                raise SceneError(f"World: an image of temperatures has two dimensions, not the shape {shape}")
        else:
            expected = (len(self.zenith),) if self.wavelengths is None else (len(self.zenith), len(self.wavelengths))
            if shape != expected or 0 in shape:
                raise SceneError(f"World: temperatures of the sky have the shape {shape}, expected {expected}")
            self._check_axes()
        for at in (np.argmin(self.kelvin), np.argmax(self.kelvin)):  # NaN is both
            check_temperature(float(self.kelvin.flat[at]), "World, sky")

    def _check_axes(self) -> None:
        bad = ~((self.zenith >= 0.0) & (self.zenith <= 180.0))
        if bad.any():
            raise SceneError(
                f"World: temperature at zenith angle {self.zenith[bad][0]:g}; 0 is straight up, 180 straight down"
            )
        if np.any(np.diff(self.zenith) <= 0):
            at = int(np.flatnonzero(np.diff(self.zenith) <= 0)[0])
            one, other = self.zenith[at], self.zenith[at + 1]
            raise SceneError(f"World: temperature: zenith angles must increase, but {one:g} is followed by {other:g}")
        if self.wavelengths is not None:
            check_wavelengths(self.wavelengths, "World: temperature of the sky")

    def temperature_at(self, zenith: np.ndarray) -> np.ndarray:
        """Mean temperature, K, at zenith angles (degrees, any shape): around them, and over all wavelengths alike."""
        by_angle, angles = self.kelvin.reshape(len(self.kelvin), -1).mean(axis=1, dtype=np.float64), self.zenith
        if angles is None:  # rows of an image, the last of which looks up
            angles, by_angle = (np.arange(len(by_angle)) + 0.5) * 180.0 / len(by_angle), by_angle[::-1]
        return np.interp(zenith, angles, by_angle)

    @property
    def mean_temperature(self) -> float:
        """Mean over all directions, K."""
        angle = np.linspace(0.5, 179.5, 180)
        return float(np.average(self.temperature_at(angle), weights=np.sin(np.radians(angle))))


@dataclass(frozen=True)
class Grid:
    """Where a gas is and how hot it is there, in n leaves of 8 x 8 x 8 cells. Between the leaves there is none.

    Cell (i, j, k) fills the cube from (i, j, k) to (i + 1, j + 1, k + 1) of index space: integer coordinates are
    corners of cells, not their centres. Everything is constant in a cell.

    leaves: (n, 3) int32, each once; leaf l holds cells 8 l to 8 l + 7 along each axis.
    transform: (4, 4) or (3, 4) float64, from index space to the world, m; it may turn, shear, mirror and stretch.
    density: (n, 8, 8, 8) float32, at least 0, factor on the medium's coefficients; None is 1 in every cell of a leaf.
    temperature: (n, 8, 8, 8) float32, K; None is the medium's own. Where there is no gas it does not count.
    fractions: (n, 8, 8, 8) float32, 0..1, by species: mole fraction, of SOOT the volume fraction, whatever the density.
    """

    leaves: np.ndarray
    transform: np.ndarray
    density: np.ndarray | None = None
    temperature: np.ndarray | None = None
    fractions: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def from_arrays(
        cls,
        transform: np.ndarray,
        density: np.ndarray | None = None,
        temperature: np.ndarray | None = None,
        fractions: dict[str, np.ndarray] | None = None,
        low: tuple[int, int, int] = (0, 0, 0),
    ) -> Grid:
        """A grid from dense arrays (a, b, c) of one shape; leaves without density and species are left out.

        low: index of the first cell. density: None is 1 everywhere in the arrays.
        """
        given = {f"fraction {name}": values for name, values in (fractions or {}).items()}
        given |= {"density": density, "temperature": temperature}
        given = {name: np.asarray(values, np.float32) for name, values in given.items() if values is not None}
        shape = next(iter(given.values())).shape
        given.setdefault("density", np.ones(shape, np.float32))
        parts = {name: in_leaves(values, low) for name, values in given.items()}
        first = np.floor_divide(low, LEAF)
        count = np.floor_divide(np.add(low, shape) - 1, LEAF) - first + 1
        gas = [name for name in parts if name != "temperature"]
        used = reduce(np.logical_or, (parts[name].any(axis=(1, 2, 3)) for name in gas))
        leaves = (np.indices(count).reshape(3, -1).T + first)[used].astype(np.int32)
        kept = {name: values[used] for name, values in parts.items()}
        named = {name: kept[f"fraction {name}"] for name in fractions or {}}
        return cls(leaves, transform, kept["density"], kept.get("temperature"), named)

    @property
    def matrix(self) -> np.ndarray:
        """(4, 4) float64, from index space to the world."""
        matrix = np.eye(4)
        matrix[: len(self.transform)] = self.transform
        return matrix

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest leaf coordinates (3,) int64, and how many leaves (3,) the box around all holds along each axis."""
        low, high = self.leaves.min(axis=0).astype(np.int64), self.leaves.max(axis=0).astype(np.int64)
        return low, high - low + 1

    @property
    def mean_density(self) -> float:
        """Density in the mean over that box; where there is none it is 0."""
        return float(self.density.sum(dtype=np.float64)) / (LEAF**3 * float(self.box[1].prod()))

    @property
    def corners(self) -> np.ndarray:
        """(8, 3) float64 corners of that box in the world, m."""
        low, count = self.box
        ends = LEAF * np.stack((low, low + count)).astype(np.float64)
        index = np.array([[ends[(k >> axis) & 1, axis] for axis in range(3)] for k in range(8)])
        return index @ self.matrix[:3, :3].T + self.matrix[:3, 3]

    def check(self, owner: str) -> None:
        """Raise SceneError for what makes no sense. owner: how messages name the medium."""
        leaves, transform = np.asarray(self.leaves), np.asarray(self.transform)
        if leaves.ndim != 2 or leaves.shape[1] != 3 or not len(leaves):
            raise SceneError(f"{owner}: a grid needs leaves, coordinates (n, 3), got an array of shape {leaves.shape}")
        if transform.shape not in ((4, 4), (3, 4)) or not np.isfinite(transform).all():
            raise SceneError(f"{owner}: the transform of a grid is a finite matrix, 4 x 4 or 3 x 4, got {transform}")
        if not abs(np.linalg.det(transform[:3, :3])) > 0.0:
            raise SceneError(f"{owner}: the transform of its grid is flat, {transform[:3, :3].tolist()}")
        _, count = self.box
        check_spread(count, owner)
        if len(np.unique(leaves, axis=0)) < len(leaves):
            raise SceneError(f"{owner}: a leaf of its grid is given twice")
        for name in self.fractions:
            check_species(name, owner)
        for name, values, high in self._quantities():
            if values.shape != (len(leaves), LEAF, LEAF, LEAF):
                raise SceneError(
                    f"{owner}: {name} has shape {values.shape}, expected ({len(leaves)}, {LEAF}, {LEAF}, {LEAF})"
                )
            for value in (values.min(), values.max()):  # NaN is both
                if not 0.0 <= value <= high or value == np.inf:
                    limit = "finite and at least 0" if high == np.inf else f"from 0 to {high:g}"
                    raise SceneError(f"{owner}: {name} {value:g} in a cell of its grid; it is {limit}")

    def _quantities(self) -> list[tuple[str, np.ndarray, float]]:
        """What varies: name, values and highest value."""
        every = [("density", self.density, np.inf), ("temperature", self.temperature, HOTTEST)]
        every += [(f"fraction of {name}", values, 1.0) for name, values in self.fractions.items()]
        return [each for each in every if each[1] is not None]

    @property
    def holds(self) -> np.ndarray | bool:
        """(n, 8, 8, 8) bool, which cells hold gas; True if all do."""
        if self.density is None:
            return True
        return reduce(np.logical_or, (values > 0.0 for values in self.fractions.values()), self.density > 0.0)

    def amounts(self, component: str) -> np.ndarray | None:
        """(n, 8, 8, 8) float32 of "density" or of a species; None is 1 in every cell."""
        return self.density if component == "density" else self.fractions[component]

    def mean_temperature(self, own: float) -> float:
        """K, the mean over all cells, weighted with density and fractions. own: of the medium, K."""
        if self.temperature is None:
            return own
        weight = np.ones_like(self.temperature) if self.density is None else self.density
        weight = sum(self.fractions.values(), weight)
        total = weight.sum(dtype=np.float64)
        return float(np.vdot(weight, self.temperature) / total) if total > 0.0 else own


def check_species(name: str, owner: str) -> None:
    """Raise SceneError if no species has this name."""
    if name not in SPECIES:
        raise SceneError(f"{owner}: unknown species '{name}'; known are {', '.join(MOLECULES)} and {SOOT}")


def check_spread(count: np.ndarray, owner: str) -> None:
    """Raise SceneError if the box around a grid, so many leaves (3,) along each axis, is absurdly large."""
    if np.prod(count.astype(np.float64)) > _WIDEST:
        raise SceneError(
            f"{owner}: the leaves of its grid are scattered over {' x '.join(str(LEAF * n) for n in count)} cells; "
            f"at most {_WIDEST * LEAF**3:.2g} cells may lie between the outermost ones"
        )


def in_leaves(values: np.ndarray, low: tuple[int, int, int]) -> np.ndarray:
    """(n, 8, 8, 8) of a dense array (a, b, c) whose first cell is `low`: all leaves of the box around it, the last axis
    fastest, with 0 around the array."""
    before = np.mod(low, LEAF)
    after = -(before + values.shape) % LEAF
    padded = np.pad(values, list(zip(before, after, strict=True)))
    a, b, c = (size // LEAF for size in padded.shape)
    return padded.reshape(a, LEAF, b, LEAF, c, LEAF).transpose(0, 2, 4, 1, 3, 5).reshape(-1, LEAF, LEAF, LEAF)


@dataclass(frozen=True)
class Medium:
    """A gas: it absorbs, emits what it absorbs (Kirchhoff), and may scatter. Media that overlap add.

    name: shown in messages.
    absorption: coefficient in 1/m, a float (grey), or an (n, 2) array of [wavelength um, 1/m], wavelengths ascending,
        linear between the points and held constant outside. At least 0.
    temperature: K.
    gas: what it consists of, by name: mole fractions of MOLECULES, and the volume fraction of SOOT. What they leave is
        air without lines. They absorb in addition to `absorption`. In a grid the density is a factor on them, and the
        grid's own fractions of a species count instead. pressure: Pa, of the mixture. metres: length of a
        unit of the scene, as lines absorb by the metre whatever the unit.
    scattering: coefficient in 1/m, in the same form. anisotropy: of Henyey and Greenstein's phase function, the mean
        cosine of the angle by which it deflects light, -1 to 1; a float, or (n, 2) over wavelength in the same form.
    vertices: (n, 3) m, and triangles: (m, 3) int, of the closed mesh that it fills; None for the world's medium, which
        is everywhere, and for a grid.
    grid: the Grid that it fills instead of a mesh.
    """

    name: str = "Medium"
    absorption: float | np.ndarray = 0.0
    temperature: float = 0.0
    scattering: float | np.ndarray = 0.0
    anisotropy: float | np.ndarray = 0.0
    vertices: np.ndarray | None = None
    triangles: np.ndarray | None = None
    gas: Mapping[str, float] = field(default_factory=dict)
    pressure: float = ATMOSPHERE
    metres: float = 1.0
    grid: Grid | None = None

    def __post_init__(self):
        owner = f"Medium '{self.name}'"
        self._check_gas(owner)
        fractions = {name: float(self.gas[name]) for name in SPECIES if name in self.gas}
        object.__setattr__(self, "gas", fractions)  # in one order, as a fingerprint needs them
        for quantity in ("absorption", "scattering"):
            wavelengths, values = self.curve(quantity)
            check_wavelengths(wavelengths, f"{owner}: {quantity}")
            outside = ~((values >= 0.0) & (values < np.inf))  # also true for NaN
            if np.any(outside):
                raise SceneError(f"{owner}: {quantity} {values[outside][0]:g} 1/m; it is finite and at least 0")
        wavelengths, values = self.curve("anisotropy")
        check_wavelengths(wavelengths, f"{owner}: anisotropy")
        outside = ~(np.abs(values) <= 1.0)  # also true for NaN
        if np.any(outside):
            raise SceneError(f"{owner}: anisotropy {values[outside][0]:.9g} is outside -1..1")
        check_temperature(self.temperature, owner)
        object.__setattr__(self, "temperature", float(np.float32(self.temperature)))  # as of surfaces
        if self.grid is not None:
            if self.triangles is not None:
                raise SceneError(f"{owner}: a medium fills a mesh or a grid, not both")
            self.grid.check(owner)
        self._check_mesh(owner)

    def _check_mesh(self, owner: str) -> None:
        """Whether the mesh is closed, geometry.closed says."""
        if (self.vertices is None) != (self.triangles is None):
            raise SceneError(f"{owner}: a mesh has both vertices and triangles; the world's medium has neither")
        if self.triangles is None:
            return
        if len(self.triangles) == 0:
            raise SceneError(f"{owner}: its mesh has no triangles")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise SceneError(f"{owner}: a triangle names a vertex that does not exist")
        finite = np.isfinite(self.vertices).all(axis=1)
        if not finite.all():
            bad = int(np.argmin(finite))
            raise SceneError(f"{owner}: vertex {bad} is not finite: {self.vertices[bad].tolist()}")

    @property
    def outline(self) -> np.ndarray | None:
        """(n, 3) m: points whose convex hull holds the medium; None for the world's, which has no end."""
        return self.vertices if self.grid is None else self.grid.corners

    @cached_property
    def typical_temperature(self) -> float:
        """K: its own, or the mean over its grid."""
        return self.temperature if self.grid is None else self.grid.mean_temperature(self.temperature)

    def _check_gas(self, owner: str) -> None:
        for name, fraction in self.gas.items():
            check_species(name, owner)
            if not 0.0 <= fraction <= 1.0:  # also false for NaN
                raise SceneError(f"{owner}: the fraction of {name} is {fraction:g}; it is from 0 to 1")
        total = sum(self.gas.get(name, 0.0) for name in MOLECULES)
        if total > 1.0 + 1e-6:  # as fractions that were given to 6 digits may add up
            raise SceneError(f"{owner}: the mole fractions add up to {total:g}; they are at most 1 together")
        if not 0.0 < self.pressure < np.inf:
            raise SceneError(f"{owner}: pressure {self.pressure:g} Pa; it is finite and above 0")

    @cached_property
    def typical_gas(self) -> dict[str, float]:
        """`gas` with the fractions that the species of a grid typically meet themselves in: their means, weighted with
        themselves, scaled down where there are more than 1 of molecules together."""
        given = {} if self.grid is None else self.grid.fractions
        means = self.gas | {name: _mean_met(values) for name, values in given.items()}
        crowded = max(1.0, sum(means.get(name, 0.0) for name in MOLECULES))
        return {name: means[name] / (1.0 if name == SOOT else crowded) for name in SPECIES if name in means}

    @property
    def molecules(self) -> dict[str, float]:
        """Typical mole fractions of what has lines."""
        return {name: self.typical_gas[name] for name in MOLECULES if self.typical_gas.get(name, 0.0) > 0.0}

    @cached_property
    def components(self) -> tuple[str, ...]:
        """What absorbs by amounts and a temperature of its own in each cell of the grid: "density", all that comes with
        the grid's density, and each species that has fractions there. Empty if the spectrum is one everywhere, so that
        the density says it all."""
        if self.grid is None or not (self.grid.fractions or (self.gas and self.grid.temperature is not None)):
            return ()
        return "density", *(name for name in SPECIES if name in self.grid.fractions)

    def species_of(self, component: str) -> dict[str, float]:
        """Fractions of the species in a unit of a component."""
        if component != "density":
            return {component: 1.0}
        return {name: fraction for name, fraction in self.gas.items() if name not in self.grid.fractions}

    @property
    def scatters(self) -> bool:
        return bool(np.any(self.curve("scattering")[1] > 0.0))

    def curve(self, quantity: str) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths (n,) in um and values (n,), float64, of "absorption" or "scattering", in 1/m, or "anisotropy"; a
        grey gas has one point."""
        points = np.asarray(getattr(self, quantity), dtype=np.float64)
        if points.ndim == 0:
            return np.array([1.0]), points[None]
        if points.ndim != 2 or points.shape[1] != 2 or not len(points):
            raise SceneError(
                f"Medium '{self.name}': {quantity} must be a number or pairs of um and values, "
                f"got an array of shape {points.shape}"
            )
        return np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])


def _mean_met(fraction: np.ndarray) -> float:
    """The mean of a fraction in cells, weighted with itself; 0 where there is none."""
    total = fraction.sum(dtype=np.float64)
    return float(np.square(fraction, dtype=np.float64).sum() / total) if total > 0.0 else 0.0


@dataclass(frozen=True)
class Response:
    """Spectral response of a sensor: its signal for a watt of radiation, over wavelength.

    name: shown in messages and kept in files.
    points: (n, 2) [wavelength um, response], wavelengths ascending, responses at least 0 in any unit: the largest
        counts as 1. Linear between the points, 0 outside.
    """

    name: str
    points: np.ndarray

    def __post_init__(self):
        owner, points = f"Sensor '{self.name}'", np.asarray(self.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise SceneError(f"{owner}: the response needs two or more pairs of um and response")
        wavelengths, values = points.T
        check_wavelengths(wavelengths, f"{owner}: response")
        if not np.all((values >= 0.0) & (values < np.inf)):
            bad = values[~((values >= 0.0) & (values < np.inf))][0]
            raise SceneError(f"{owner}: response {bad:g}; responses are finite and at least 0")
        if not values.max() > 0.0:
            raise SceneError(f"{owner}: the response is 0 at every wavelength")

    @property
    def curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Wavelengths (n + 2,) in um and responses (n + 2,) from 0 to 1, float64; 0 at both ends, and so outside."""
        wavelengths, values = np.asarray(self.points, dtype=np.float64).T
        ends = wavelengths[0] * (1.0 - _STEP), wavelengths[-1] * (1.0 + _STEP)
        curve = np.concatenate(([ends[0]], wavelengths, [ends[1]])), np.concatenate(([0.0], values, [0.0]))
        return curve[0], curve[1] / values.max()


@dataclass(frozen=True)
class PointLight:
    """A sphere that radiates `power` W (all wavelengths) evenly in all directions, spectrum of a blackbody."""

    position: np.ndarray  # (3,) m
    power: float  # W over all wavelengths
    radius: float = 0.0  # m
    temperature: float = LAMP_TEMPERATURE  # K
    name: str = "Point"


@dataclass(frozen=True)
class SpotLight:
    """`power` W (all wavelengths) inside a cone; intensity falls to zero over the outer `blend` share of it.

    With `square` it is a pyramid on a square instead, whose opposite faces open by cone_angle; one pair of them is
    parallel to this direction.
    """

    position: np.ndarray  # (3,) m
    direction: np.ndarray  # (3,) axis, from the light outwards
    power: float  # W
    cone_angle: float  # rad, full opening angle (Blender's spot_size)
    blend: float = 0.0  # 0..1 (Blender's spot_blend)
    radius: float = 0.0  # m
    temperature: float = LAMP_TEMPERATURE  # K
    name: str = "Spot"
    square: np.ndarray | None = None  # (3,) across the axis; None is round


@dataclass(frozen=True)
class AreaLight:
    """A rectangle or ellipse that radiates `power` W from one face.

    axis_u and axis_v are the half axes; the light shines towards cross(axis_v, axis_u) (Blender's local -Z for
    axis_u = +X and axis_v = +Y). It shines after Lambert's law or, with a spread of 2 a below pi, through a grid of
    slats as of a soft box: at an angle x to its normal that lets 1 - tan x / tan a through, and nothing from a on. The
    power is what comes out of the grid. That is how Cycles has it (area_light_spread_attenuation in its
    kernel/light/area.h, normalize_spread in its scene/light.cpp).
    """

    position: np.ndarray  # (3,) m, centre
    axis_u: np.ndarray  # (3,) m, half extent
    axis_v: np.ndarray  # (3,) m, half extent
    power: float  # W
    ellipse: bool = False
    temperature: float = LAMP_TEMPERATURE  # K
    name: str = "Area"
    spread: float = np.pi  # rad, full opening angle (Blender's spread)


@dataclass(frozen=True)
class SunLight:
    """Parallel light of `irradiance` W/m2 (all wavelengths) on a plane facing it; `angle` is its angular diameter."""

    direction: np.ndarray  # (3,) the way the light travels
    irradiance: float  # W/m2
    angle: float = 0.0  # rad
    temperature: float = SUN_TEMPERATURE  # K
    name: str = "Sun"


Light = PointLight | SpotLight | AreaLight | SunLight


@dataclass(frozen=True)
class Camera:
    """Where the image is taken from. The image filter is a box of one pixel.

    kind: 'PERSPECTIVE', 'ORTHOGRAPHIC' or 'PANORAMA' (equirectangular).
    width, height: pixels of the whole frame.
    matrix: (4, 4) camera to world; the camera looks along its local -Z, +Y is up. Rotation and translation only.
    frame: (left, right, bottom, top) edges of the whole frame in camera space. PERSPECTIVE: x/-z and y/-z (tangents);
        ORTHOGRAPHIC: metres; PANORAMA: longitude and latitude, rad (0, 0 looks along -Z; longitude grows rightwards).
    window: (x0, y0, x1, y1) pixels of the frame to render, origin at the lower left; None is the whole frame.
    clip: (start, end) m, depth along the view axis (PANORAMA: distance). What lies outside is not seen.
    lens_radius: m, 0 is a pinhole. focus_distance: m, depth that is in focus.
    blades: corners of the aperture, under 3 is a disk; blade_rotation: rad; lens_ratio: anamorphic squeeze.
    """

    width: int = 128
    height: int = 96
    matrix: np.ndarray = field(default_factory=lambda: np.eye(4))
    kind: str = "PERSPECTIVE"
    frame: tuple[float, float, float, float] = (-0.36, 0.36, -0.27, 0.27)
    window: tuple[int, int, int, int] | None = None
    clip: tuple[float, float] = (0.0, np.inf)
    lens_radius: float = 0.0
    focus_distance: float = 1.0
    blades: int = 0
    blade_rotation: float = 0.0
    lens_ratio: float = 1.0

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """(x0, y0, x1, y1) of what is rendered."""
        return (0, 0, self.width, self.height) if self.window is None else self.window


class Change(NamedTuple):
    """What of a scene is otherwise at another time. part: name of the Scene's field. rows: (k,) int64, which rows of an
    array; None for the whole field. values: the rows, or the field."""

    part: str
    rows: np.ndarray | None
    values: object


Moment = tuple[Change, ...]


class Hidden(enum.IntFlag):
    """Rays that pass a triangle as if it were not there: those from the camera, also behind thin sheets; those that a
    diffuse lobe reflected, or a specular one, smooth or rough (from the eye on: light goes the other way); and those to
    light objects."""

    CAMERA = 1
    DIFFUSE = 2
    GLOSSY = 4
    LIGHTS = 8


@dataclass(frozen=True)
class Scene:
    """Everything a render needs. Arrays are not copied: do not write to them afterwards.

    vertices: (n, 3) float32 or float64, m.
    triangles: (m, 3) int32, indices of vertices. Front side: counter-clockwise. Both sides emit and reflect alike.
    material: (m,) int32, index into materials.
    temperature: (m,) or (m, 3) float32, K, per triangle or per triangle corner (interpolated linearly).
    materials: Material for each index.
    band_edges: (b + 1,) um, ascending: b bands side by side.
    world_temperature: K, what rays that leave the scene see. sky: what they see by direction, instead; then
        world_temperature is its mean.
    lights: they light surfaces, and the camera never sees them.
    response: of the sensor, through which all bands together are seen; None counts all wavelengths alike.
    groups: names of temperature groups, whose light the film keeps apart (see layers); each has one temperature.
    group: (m,) int16, the group of each triangle, -1 for none; required with groups. world_group: of the surroundings.
    media: gases between the surfaces. world_depth: m, how far those without a mesh reach along rays that leave the
        scene.
    textures: what varies over triangles, by images or from corner to corner; None if nothing does but `temperature`.
    corner_normals: (m, 3, 3) float32, normals at the corners of triangles, on their front side, of a surface that is
        shaded smooth; zero, or the triangle's own, where it is flat. None if all are.
    hidden: (m,) uint8, sums of Hidden: which rays pass each triangle as if it were not there. (m,) bool are those that
        the camera does not see. None if there are none.
    holdout: (m,) bool, triangles that are a hole in the picture, see coverage_image; radiance is as without. None if
        there are none.
    moments: what is otherwise at the times that passes see, in the order of time (see moments); all else is planned by
        the scene as it is here. Nothing if all passes see it so.

    Raises SceneError if a value cannot be rendered.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    material: np.ndarray
    temperature: np.ndarray
    materials: tuple[Material, ...]
    camera: Camera
    band_edges: np.ndarray
    world_temperature: float = 0.0
    lights: tuple[Light, ...] = ()
    response: Response | None = None
    groups: tuple[str, ...] = ()
    group: np.ndarray | None = None
    world_group: int = -1
    media: tuple[Medium, ...] = ()
    world_depth: float = 0.0
    corner_normals: np.ndarray | None = None
    sky: Sky | None = None
    textures: Textures | None = None
    hidden: np.ndarray | None = None
    holdout: np.ndarray | None = None
    moments: tuple[Moment, ...] = ()

    def __post_init__(self):
        check_band_edges(self.band_edges)
        check_response(self.response, self.band_edges)
        count = len(self.triangles)
        if count == 0:
            raise SceneError("The scene has no triangles to render")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise SceneError("A triangle names a vertex that does not exist")
        if not np.isfinite([self.vertices.min(), self.vertices.max()]).all():  # NaN is both; neither takes a copy
            bad = int(np.flatnonzero(~np.isfinite(self.vertices).all(axis=1))[0])
            raise SceneError(f"Vertex {bad} is not finite: {self.vertices[bad].tolist()}")
        if len(self.material) != count or self.material.min() < 0 or self.material.max() >= len(self.materials):
            raise SceneError("Every triangle needs the index of a material")
        if self.temperature.shape not in ((count,), (count, 3)):
            raise SceneError(f"temperature has shape {self.temperature.shape}, expected ({count},) or ({count}, 3)")
        for at in (self.temperature.argmin(), self.temperature.argmax()):  # NaN is both
            check_temperature(self.temperature.flat[at], f"Triangle {at * count // self.temperature.size}")
        if self.sky is not None:
            if self.world_group >= 0:
                raise SceneError("World: a temperature that depends on the direction cannot be in a temperature group")
            object.__setattr__(self, "world_temperature", self.sky.mean_temperature)
            if self.sky.kelvin.min() == self.sky.kelvin.max():
                object.__setattr__(self, "sky", None)
        check_temperature(self.world_temperature, "World")
        # rounded as surfaces' temperatures are, so that equal temperatures stay equal
        object.__setattr__(self, "world_temperature", float(np.float32(self.world_temperature)))
        check_depth(self.world_depth)
        for light in self.lights:
            _check_light(light)
        if self.groups:
            self._check_groups()
        if self.corner_normals is not None:
            _check_corner_normals(self.corner_normals, count)
        if self.textures is not None:
            self._check_textures()
        for name, usual in (("hidden", np.uint8), ("holdout", np.bool_)):
            marks = getattr(self, name)
            if marks is not None and (marks.shape != (count,) or marks.dtype not in (usual, np.bool_)):
                wanted = f"({count},) {np.dtype(usual)}"
                raise SceneError(f"{name} has shape {marks.shape} and dtype {marks.dtype}, not {wanted}")
        if self.hidden is not None:
            object.__setattr__(self, "hidden", self.hidden.astype(np.uint8, copy=False))
            if self.hidden.max() > sum(Hidden):
                raise SceneError(f"hidden holds {self.hidden.max()}; sums of Hidden are at most {sum(Hidden)}")

    @property
    def images_of_temperature(self) -> tuple[Texture, ...]:
        """The images of temperatures over surfaces."""
        return self.textures.temperatures if self.textures else ()

    @property
    def temperature_range(self) -> tuple[float, float]:
        """Lowest and highest temperature of any surface, K."""
        every = self.temperature, *(image.values for image in self.images_of_temperature)
        return min(float(values.min()) for values in every), max(float(values.max()) for values in every)

    @property
    def band_count(self) -> int:
        return len(self.band_edges) - 1

    def group_temperature(self, group: int) -> float:
        """The temperature (K) of a group. Raises SceneError if it has several, or nothing is in the group."""
        of_surfaces = self.temperature[self.group == group]
        of_world = [self.world_temperature] if self.world_group == group else []
        kelvin = np.concatenate((of_surfaces.ravel(), of_world))
        if kelvin.size == 0:
            raise SceneError(f"Nothing is in the temperature group '{self.groups[group]}'")
        if kelvin.min() < kelvin.max():
            raise SceneError(
                f"Temperature group '{self.groups[group]}' runs from {kelvin.min():g} to {kelvin.max():g} K; all in a "
                "group have one temperature"
            )
        return float(kelvin[0])

    def _check_textures(self) -> None:
        self.textures.check(len(self.triangles), len(self.materials))
        varies = self.textures.triangle[self.textures.temperature_image >= 0]
        if self.groups and len(varies) and self.group[varies].max() >= 0:
            raise SceneError(
                f"Temperature group '{self.groups[self.group[varies].max()]}' holds an image of temperatures; all in a "
                "group have one temperature"
            )

    def _check_groups(self) -> None:
        if not all(self.groups) or len(set(self.groups)) < len(self.groups):
            raise SceneError(f"Temperature groups need names that differ, got {', '.join(map(repr, self.groups))}")
        count = len(self.groups)
        if self.group is None or self.group.shape != (len(self.triangles),):
            raise SceneError("With temperature groups every triangle needs the index of one, or -1")
        if not -1 <= min(self.group.min(), self.world_group) <= max(self.group.max(), self.world_group) < count:
            raise SceneError(f"A triangle or the world is in a temperature group that does not exist, of {count}")
        for group in range(count):
            self.group_temperature(group)


def check_depth(value: float) -> None:
    """Raise SceneError unless value is a depth, m, of the world's gas."""
    if not 0.0 <= value < np.inf:
        raise SceneError(f"World: depth {value:g} m; the depth of its gas is finite and at least 0 m")


def check_response(response: Response | None, edges: np.ndarray) -> None:
    """Raise SceneError if a sensor does not respond anywhere between the first and the last edge (um)."""
    if response is None:
        return
    low, high = float(edges[0]), float(edges[-1])
    wavelengths, values = response.curve
    inside = np.concatenate(([low], wavelengths[(wavelengths > low) & (wavelengths < high)], [high]))
    at = np.interp(inside, wavelengths, values)
    if not np.diff(inside) @ (at[1:] + at[:-1]) / 2.0 > 1e-6 * (high - low):  # more than the step at its end
        raise SceneError(
            f"Sensor '{response.name}' does not respond between {low:.4g} and {high:.4g} um, where the bands are; it "
            f"responds from {wavelengths[0]:.4g} to {wavelengths[-1]:.4g} um"
        )


def check_temperature(value: float, owner: str) -> None:
    """Raise SceneError unless value is a temperature in kelvin; owner is how messages name the thing it belongs to."""
    if not (np.isfinite(value) and value >= 0.0):
        raise SceneError(f"{owner}: temperature {value:g} K; temperatures are finite and at least 0 K")
    if value > HOTTEST:
        raise SceneError(f"{owner}: temperature {value:g} K; at most {HOTTEST:g} K are possible")


def check_wavelengths(wavelengths: np.ndarray, owner: str) -> None:
    """Raise SceneError unless wavelengths (um) are finite, above 0 and ascending; owner: the curve, in messages."""
    if not (np.all(np.isfinite(wavelengths)) and np.all(wavelengths > 0)):
        bad = wavelengths[~(np.isfinite(wavelengths) & (wavelengths > 0))][0]
        raise SceneError(f"{owner} at {bad:g} um; wavelengths are finite and above 0")
    if np.any(np.diff(wavelengths) <= 0):
        at = int(np.flatnonzero(np.diff(wavelengths) <= 0)[0])
        raise SceneError(
            f"{owner} wavelengths must increase, but {wavelengths[at]:g} um is followed by {wavelengths[at + 1]:g} um"
        )


def _check_light(light: Light) -> None:
    """Raise SceneError, naming the light, for a power, direction or size that makes no sense."""
    owner = f"Light '{light.name}'"
    check_temperature(light.temperature, owner)
    flux = light.irradiance if isinstance(light, SunLight) else light.power
    if not (np.isfinite(flux) and flux >= 0):
        raise SceneError(f"{owner}: power {flux:g}; lights radiate a finite power of 0 or more")
    if isinstance(light, SpotLight | SunLight) and not 0 < np.linalg.norm(light.direction) < np.inf:
        raise SceneError(f"{owner}: direction {light.direction} points nowhere")
    if isinstance(light, AreaLight) and not 0 < np.linalg.norm(np.cross(light.axis_u, light.axis_v)) < np.inf:
        raise SceneError(f"{owner}: an area light needs a size above 0")
    if isinstance(light, AreaLight) and not NARROWEST_SPREAD <= light.spread <= np.pi:
        raise SceneError(f"{owner}: a spread of {light.spread:g} rad; area lights spread from 1 to 180 degrees")
    square = light.square if isinstance(light, SpotLight) else None
    if square is not None and not 0 < np.linalg.norm(np.cross(square, light.direction)) < np.inf:
        raise SceneError(f"{owner}: its square beam has no side across its direction {light.direction}")
    if isinstance(light, PointLight | SpotLight) and not 0 <= light.radius < np.inf:
        raise SceneError(f"{owner}: radius {light.radius:g} m; a radius is finite and at least 0")
    if isinstance(light, SpotLight) and not (_NARROWEST_CONE <= light.cone_angle <= np.pi and 0 <= light.blend <= 1):
        raise SceneError(
            f"{owner}: a cone of {light.cone_angle:g} rad and a blend of {light.blend:g}; cones open by "
            f"{_NARROWEST_CONE:g} to pi, blends are from 0 to 1"
        )
    if isinstance(light, SunLight) and not 0 <= light.angle <= np.pi:
        raise SceneError(f"{owner}: angle {light.angle:g} rad; a sun's diameter is from 0 to pi")
    if not isinstance(light, SunLight) and not np.all(np.isfinite(light.position)):
        raise SceneError(f"{owner}: position {light.position} is not finite")


def check_band_edges(edges: np.ndarray) -> None:
    """Raise SceneError unless edges (um) are two or more, finite, above 0 and ascending."""
    edges = np.asarray(edges, dtype=np.float64)
    if edges.ndim != 1 or len(edges) < 2:
        raise SceneError("Bands need at least two edges (um)")
    if not (np.all(np.isfinite(edges)) and np.all(edges > 0)):
        raise SceneError(
            f"Band edges must be finite and above 0 um, got {edges[~(np.isfinite(edges) & (edges > 0))][0]:g}"
        )
    if np.any(np.diff(edges) <= 0):
        at = int(np.flatnonzero(np.diff(edges) <= 0)[0])
        raise SceneError(f"Band edges must ascend: {edges[at]:g} um is followed by {edges[at + 1]:g} um")


def _check_corner_normals(normals: np.ndarray, count: int) -> None:
    """Raises SceneError if normals are not (count, 3, 3), or if a triangle has some without a direction."""
    if normals.shape != (count, 3, 3):
        raise SceneError(f"corner_normals has shape {normals.shape}, expected ({count}, 3, 3)")
    square = np.einsum("mij,mij->mi", normals, normals)
    bad = ~((square > 0.0) & (square < np.inf)).all(axis=1) & (square != 0.0).any(axis=1)  # also true for NaN
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise SceneError(f"Triangle {first}: a normal of its corners has no direction: {normals[first].tolist()}")
