# SPDX-License-Identifier: GPL-3.0-or-later
"""What varies over surfaces as any renderer can take it: images of radiances and shares, normals of corners."""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

_PREFIX = "skin"  # of their arrays beside those of the rest of a problem
_FINEST = (
    512  # texels along an edge of the images that peers get, at least: bilinear temperatures in steps of one texel
)


@dataclass
class Skin:
    """Surfaces that look alike, of n triangles that both sides show, arrays only, in B bands or in three.

    corners (n, 3, 3) m; uv (n, 3, 2) texture coordinates. normals (n, 3, 3) at the corners, where shaded smooth, else
    None. emission (h, w, B): excess radiance that is emitted, W m-2 sr-1, over the unit square, row 0 at v = 0,
    constant over each texel. share (h, w): of the second surface in place of the first. wrap: of both beyond the
    square, in Mitsuba's words. Of the two surfaces: reflectance (2, B), lobes (2, 2) as Problem has them, and
    transmittance (2,).
    """

    corners: np.ndarray
    uv: np.ndarray
    emission: np.ndarray
    share: np.ndarray
    wrap: str
    reflectance: np.ndarray
    lobes: np.ndarray
    transmittance: np.ndarray
    normals: np.ndarray | None = None

    def arrays(self, index: int) -> dict[str, np.ndarray]:
        """By the names that a file of a whole problem gives those of the skin with this index."""
        named = {f"{_PREFIX}{index}_{field.name}": getattr(self, field.name) for field in fields(self)}
        return {name: array for name, array in named.items() if array is not None}

    def of_bands(self, bands: list[int], scale: np.ndarray) -> "Skin":
        """Its bands of this index, with the emission in units of the scale (b,)."""
        return replace(self, emission=self.emission[..., bands] / scale, reflectance=self.reflectance[:, bands])


def take_skins(named: dict[str, np.ndarray]) -> tuple[Skin, ...]:
    """Takes the arrays of all skins out of those of a whole problem."""
    skins = []
    while own := [name for name in named if name.startswith(f"{_PREFIX}{len(skins)}_")]:
        arrays = {name.partition("_")[2]: named.pop(name) for name in own}
        skins.append(Skin(**arrays | {"wrap": str(arrays["wrap"])}))
    return tuple(skins)


def needs_skin(scene) -> np.ndarray:
    """(m,) bool, which triangles are textured, thin sheets, or shaded smooth."""
    needs = np.array([material.transmits for material in scene.materials])[scene.material]
    if scene.textures is not None:
        needs[scene.textures.triangle] = True
    if scene.corner_normals is not None:
        needs |= scene.corner_normals.any(axis=(1, 2))
    return needs


def lets_through(scene) -> np.ndarray:
    """(m,) bool, which triangles let light pass straight through, at least in part."""
    sheets = np.array([material.transmits for material in scene.materials])
    passes = sheets[scene.material]
    if scene.textures is not None:
        passes[scene.textures.triangle] |= (scene.textures.mixed >= 0) & sheets[scene.textures.mixed]
    return passes


def build_skins(scene, reflectance: np.ndarray, black: np.ndarray) -> tuple[Skin, ...]:
    """Skins of all triangles that need one. reflectance (k, B) of materials, black (B,) radiance at the reference."""
    keys, uv, share = _keys_of(scene)
    own = np.flatnonzero(needs_skin(scene))
    kinds, kind = np.unique(keys[own], axis=0, return_inverse=True)
    skins = []
    for i, key in enumerate(kinds):
        members = own[kind.ravel() == i]
        if key[_SHARE] < 0 and np.ptp(share[members]) > 0.0:
            raise ValueError("Peers take shares of mixed materials from images, or one for all corners")
        skins.append(_skin(scene, (members, uv[members]), key, float(share[members[0], 0]), (reflectance, black)))
    return tuple(skins)


_MATERIAL, _MIXED, _KELVIN, _SHARE, _SMOOTH, _TEMPERATURE, _CONSTANT = range(7)  # of a key


def _keys_of(scene):
    """Of triangles: (m, 7) float keys, equal where they look alike; (m, 3, 2) texture coordinates; (m, 3) shares."""
    count, textures = len(scene.triangles), scene.textures
    keys = np.full((count, 7), -1.0)
    uv, share = np.zeros((count, 3, 2)), np.zeros((count, 3))
    keys[:, _MATERIAL], keys[:, _TEMPERATURE] = scene.material, scene.temperature
    if textures is not None:
        at = textures.triangle
        keys[at, _MIXED], keys[at, _KELVIN] = textures.mixed, textures.temperature_image
        keys[at, _SHARE] = textures.share_image
        uv[at], share[at] = textures.uv, np.where(textures.mixed[:, None] >= 0, textures.share, 0.0)
    keys[:, _CONSTANT] = share[:, 0]
    if scene.corner_normals is not None:
        keys[:, _SMOOTH] = scene.corner_normals.any(axis=(1, 2))
    return keys, uv, share


def _skin(scene, triangles, key, share, optics):
    """The Skin of a key. triangles: index (n,) and texture coordinates. share: without an image. optics: see above."""
    (members, uv), (reflectance, black) = triangles, optics
    first, second, kelvin_image, share_image = (int(key[i]) for i in (_MATERIAL, _MIXED, _KELVIN, _SHARE))
    pair = [first, second if second >= 0 else first]
    used = [scene.textures.images[i] for i in (kelvin_image, share_image) if i >= 0]
    kelvin = np.full((1, 1), key[_TEMPERATURE]) if kelvin_image < 0 else _fine(used[0], used)
    mixed = np.full((1, 1), share) if share_image < 0 else _fine(used[-1], used)
    emitted = [_emission(scene, material, kelvin, reflectance[material], black) for material in pair]
    smooth = key[_SMOOTH] > 0
    if smooth and any(np.any(np.abs(each) > 1e-6 * black) for each in emitted):
        raise ValueError("Smooth surfaces are to be at the reference: Mitsuba samples lamps by their shading normals")
    materials = [scene.materials[material] for material in pair]
    return Skin(
        np.asarray(scene.vertices, float)[scene.triangles[members]],
        uv,
        (1.0 - mixed[..., None]) * emitted[0] + mixed[..., None] * emitted[1],
        mixed,
        _wrap(used),
        reflectance[pair],
        np.array([(material.specular, material.alpha) for material in materials]),
        np.array([_grey_transmittance(material) for material in materials]),
        scene.corner_normals[members].astype(float) if smooth else None,
    )


def _emission(scene, material, kelvin, reflectance, black):
    """(h, w, B) excess radiance that a material emits at temperatures (h, w)."""
    from addon.solver.physics.spectrum import band_radiance

    surface = scene.materials[material]
    levels, level = np.unique(kelvin, return_inverse=True)
    excess = band_radiance(scene.band_edges, levels, surface.curve)
    excess = excess - (1.0 - reflectance - _grey_transmittance(surface)) * black
    return excess[level.ravel()].reshape(*kelvin.shape, -1)


def _grey_transmittance(material):
    values = material.transmitted_curve[1]
    if np.ptp(values) > 0.0:
        raise ValueError(f"Peers take sheets of the same transmittance at all wavelengths, not {material.name}")
    return float(values[0])


def _wrap(images):
    """Mitsuba's word for what is beyond images."""
    words = {"REPEAT": "repeat", "EXTEND": "clamp", "MIRROR": "mirror"}
    extensions = {image.extension for image in images} or {"REPEAT"}
    if len(extensions) > 1 or not extensions <= set(words):
        raise ValueError(f"Peers take one extension for all images of a surface, of {', '.join(words)}: {extensions}")
    return words[extensions.pop()]


def _fine(image, images):
    """Values of a Texture on a grid fine enough for all images, and for steps in place of bilinear values."""
    rows, columns = (_weights(image, axis, math.lcm(*(one.values.shape[axis] for one in images))) for axis in (0, 1))
    return rows @ image.values.astype(float) @ columns.T


def _weights(image, axis, common):
    """(n, size) weights of an image's values along an axis in the middles of n texels, a multiple of a number."""
    size, count = image.values.shape[axis], common * math.ceil(_FINEST / common)
    place = (np.arange(count) + 0.5) * size / count - 0.5
    return interpolation(np.rint(place) if image.closest else place, size, image.extension == "REPEAT")


def interpolation(place, size, periodic):
    """(n, size) weights of values at 0, 1, ... between which all is linear, at places (n,). Beyond the ends is the
    other end, or the end itself (as in a mirror, where values are in the middles of texels)."""
    low = np.floor(place).astype(int)
    weights, each = np.zeros((len(place), size)), np.arange(len(place))
    for index, weight in ((low, 1.0 - (place - low)), (low + 1, place - low)):
        np.add.at(weights, (each, index % size if periodic else np.clip(index, 0, size - 1)), weight)
    return weights
