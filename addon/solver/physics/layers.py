# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers: an image kept apart by what emitted, so that temperature groups can get new temperatures afterwards.

Transport is linear in what is emitted. With E_l the image of all that layer l emitted at the temperature R_l, and
X_l(T) what its surfaces emit in excess of the reference T0, in each band:

    L = B(T0) + sum over l of  X_l(T_l) / X_l(R_l)  E_l

is the image with the layers at any temperatures T_l. The ratio is the same for all surfaces whose emissivity is
constant within each band, whatever its value. Each spectrum that varies within a band needs a layer of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..scene import Scene, SceneError, check_temperature
from .spectrum import band_radiance

MOST_LAYERS = 256  # a photon keeps the number of its layer in a byte
# Least difference (K) between T0 and the temperature at which a layer is traced: closer to T0 the layer would emit next
# to nothing, and its transport would stay unknown.
LEAST_EXCESS = 10.0
_FLAT = 1e-6  # largest change of an emissivity within a band that still counts as constant
_FAINT = 1e-30  # W m-2 sr-1: less does not survive as the power of a float32 photon


class Layer(NamedTuple):
    """What one layer of an image holds.

    group: name of the temperature group; '' for the first layer, which holds all that is in no group.
    material: name of the material whose spectrum the layer has; '' where emissivities are constant within each band.
    curve: wavelengths (n,) um and emissivities (n,) of that material, float64; of a blackbody without such a material.
    temperature: K, in the scene. traced: K, at which the layer was traced. Both have no meaning for the first layer.
    """

    group: str = ""
    material: str = ""
    curve: tuple[np.ndarray, np.ndarray] = (np.array([1.0]), np.array([1.0]))
    temperature: float = 0.0
    traced: float = 0.0

    @property
    def name(self) -> str:
        """The name of the layer in files and messages."""
        return f"{self.group}, {self.material}" if self.material else self.group or "no group"


SINGLE = (Layer(),)  # the layers of a scene without groups


def scene_layers(scene: Scene) -> tuple[tuple[Layer, ...], np.ndarray | None]:
    """The layers of a scene, and the layer of each triangle, (m,) uint8; None instead if there is but one layer.

    `traced` is the scene's own temperature, see `trace_apart`. Raises SceneError if there are too many layers, or if
    two spectra are mixed in a group.
    """
    if not scene.groups:
        return SINGLE, None
    of_material = _spectra(scene)
    _check_mixed(scene, of_material)
    spectrum = of_material[scene.material]
    kinds = len(scene.materials) + 1
    keys = np.where(scene.group >= 0, kinds * scene.group.astype(np.int64) + spectrum + 1, -1)
    of_world = [kinds * scene.world_group] if scene.world_group >= 0 else []
    found = np.unique(np.concatenate((keys, of_world)))
    found = found[found >= 0].astype(np.int64)
    if len(found) >= MOST_LAYERS:
        raise SceneError(
            f"The {len(scene.groups)} temperature groups need {len(found) + 1} layers, one for each spectrum in a "
            f"group; at most {MOST_LAYERS} are possible"
        )
    layers = list(SINGLE)
    for key in found:
        group, material = int(key) // kinds, int(key) % kinds - 1
        kelvin = scene.group_temperature(group)
        spectral = Layer()[1:3]
        if material >= 0:
            spectral = scene.materials[material].name or "unnamed", scene.materials[material].curve
        layers.append(Layer(scene.groups[group], *spectral, kelvin, kelvin))
    layer = np.where(keys >= 0, np.searchsorted(found, keys) + 1, 0)
    return tuple(layers), layer.astype(np.uint8)


def _check_mixed(scene: Scene, spectra: np.ndarray) -> None:
    """Raise SceneError if materials of different spectra are mixed within a group: one layer cannot hold both. spectra:
    see _spectra."""
    if scene.textures is None:
        return
    triangle, mixed = scene.textures.triangle, scene.textures.mixed
    bad = (mixed >= 0) & (scene.group[triangle] >= 0) & (spectra[scene.material[triangle]] != spectra[mixed])
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        own, other = scene.material[triangle[first]], mixed[first]
        raise SceneError(
            f"Temperature group '{scene.groups[scene.group[triangle[first]]]}' holds a mix of the materials "
            f"'{scene.materials[own].name}' and '{scene.materials[other].name}', whose spectra differ; a group keeps "
            "one spectrum for each triangle"
        )


def _spectra(scene: Scene) -> np.ndarray:
    """(materials,) int64: -1 where emissivity is constant within each band, else the first material with that curve."""
    first, spectra = {}, []
    for index, material in enumerate(scene.materials):
        wavelengths, values = material.curve
        points = np.union1d(wavelengths, scene.band_edges)
        at = np.interp(points, wavelengths, values)
        flat = all(
            np.ptp(at[(points >= low) & (points <= high)]) <= _FLAT
            for low, high in zip(scene.band_edges[:-1], scene.band_edges[1:], strict=True)
        )
        key = wavelengths.tobytes() + values.tobytes()
        spectra.append(-1 if flat else first.setdefault(key, index))
    return np.array(spectra)


def trace_apart(layers: tuple[Layer, ...], reference: float) -> tuple[Layer, ...]:
    """The layers with the temperatures at which they are traced: their own, or warmer if near the reference (K)."""

    def apart(kelvin: float) -> float:
        near = abs(kelvin - reference) < LEAST_EXCESS
        return float(np.float32(reference + LEAST_EXCESS)) if near else kelvin

    return tuple(each._replace(traced=apart(each.temperature)) if each.group else each for each in layers)


def traced_temperature(temperature: np.ndarray, layer: np.ndarray, layers: tuple[Layer, ...]) -> np.ndarray:
    """The surfaces' temperatures, float32 K; for surfaces in groups the temperatures at which their layers are traced.

    temperature: (m, 1) or (m, 3) float32 K. layer: (m,) uint8, see Surfaces.
    """
    if not layer.size:
        return temperature
    traced = np.array([each.traced for each in layers], np.float32)
    return np.where(layer[:, None] > 0, traced[layer][:, None], temperature)


def sky_layer(scene: Scene, layers: tuple[Layer, ...]) -> int:
    """The layer of the surroundings, which radiate like a blackbody."""
    if scene.world_group < 0:
        return 0
    of_sky = scene.groups[scene.world_group], ""
    return next(i for i, each in enumerate(layers) if (each.group, each.material) == of_sky)


def group_temperatures(layers: tuple[Layer, ...]) -> dict[str, float]:
    """The temperature (K) of each group in the scene."""
    return {layer.group: layer.temperature for layer in layers if layer.group}


def layer_factors(
    layers: tuple[Layer, ...], edges: np.ndarray, reference: float, temperatures: Mapping[str, float] | None = None
) -> np.ndarray:
    """(layers, b) float64: X_l(T) / X_l(R_l), by which the bands of the layers are multiplied at other temperatures.

    edges: (b + 1,) um. reference: T0, K. temperatures: K, by group; groups that are not named keep their temperatures
    of the scene. Raises SceneError for an unknown group, for a value that is no temperature, and for a layer that was
    traced so cold that a band holds no radiance which could be scaled.
    """
    wanted = group_temperatures(layers)
    for group, kelvin in (temperatures or {}).items():
        if group not in wanted:
            raise SceneError(f"There is no temperature group '{group}', only {', '.join(map(repr, wanted)) or 'none'}")
        check_temperature(kelvin, f"Temperature group '{group}'")
        wanted[group] = float(kelvin)
    factors = np.ones((len(layers), len(edges) - 1))
    for row, layer in zip(factors, layers, strict=True):
        if not layer.group or wanted[layer.group] == layer.traced:
            continue
        kelvin = np.array([reference, layer.traced, wanted[layer.group]])
        base, traced, new = band_radiance(edges, kelvin, layer.curve)
        known = np.abs(traced - base) > _FAINT
        if np.any(np.abs(new - base)[~known] > _FAINT):
            raise SceneError(
                f"Temperature group '{layer.group}' was rendered at {layer.traced:g} K, where its bands hold no "
                f"radiance to scale up to {kelvin[2]:g} K: render it warmer"
            )
        row[:] = np.divide(new - base, traced - base, out=np.zeros_like(new), where=known)
    return factors


def to_json(layers: tuple[Layer, ...]) -> str:
    """The layers as text, every number with all its digits."""
    plain = ({**each._asdict(), "curve": [values.tolist() for values in each.curve]} for each in layers)
    return json.dumps(list(plain))


def from_json(text: str) -> tuple[Layer, ...]:
    """The layers in a text made by `to_json`. Raises ValueError for any other text, and for impossible values."""
    try:
        layers = tuple(Layer(**{**each, "curve": tuple(map(np.array, each["curve"]))}) for each in json.loads(text))
        for each in layers:
            wavelengths, values = each.curve
            whole = len(wavelengths) == len(values) > 0 and np.all(np.diff(wavelengths) > 0) and wavelengths[0] > 0
            numbers = [*wavelengths, *values, each.temperature, each.traced]
            if not (whole and all(math.isfinite(number) and number >= 0 for number in numbers)):
                raise ValueError(f"'{each.name}' holds impossible numbers")
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"{error!r}") from error
    if not layers or layers[0].group or not all(each.group for each in layers[1:]):
        raise ValueError("the first layer, and no other, is that of no group")
    return layers
