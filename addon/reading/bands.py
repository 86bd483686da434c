# SPDX-License-Identifier: GPL-3.0-or-later
"""The spectral bands of a scene: uniform ones, those that a user lists, or those that suit the scene best."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache

import numpy as np

from ..solver.physics.band_partition import Partition, choose_bands
from ..solver.physics.spectrum import uniform_edges
from ..solver.physics.transmission import transmittance
from ..solver.scene import SceneError, check_band_edges, check_depth
from .custom_properties import read_number
from .lights import light_temperature, metres_per_unit
from .materials import read_material
from .media import is_medium, read_gas_alone, read_pressure
from .objects import SURFACE_TYPES, layers_objects
from .sensor import read_response
from .shown import as_typed
from .surface_temperature import object_temperatures
from .textures import with_mixed
from .world import layer_world, world_temperature

_WAVELENGTHS = 2048  # at which it is asked what gases absorb


def read_band_edges(infrared) -> np.ndarray:
    """Band edges (b + 1,) in um from scene.infrared. Raises SceneError if they are no ascending numbers above 0."""
    if infrared.band_mode == "UNIFORM":
        return uniform_edges(*_typed_ends(infrared), infrared.band_count)
    if infrared.band_mode == "ADAPTIVE":
        return read_adaptive_bands(infrared).edges
    words = [word.strip() for word in infrared.band_edges.split(",")]
    edges = []
    for word in words:
        try:
            edges.append(float(word))
        except ValueError:
            raise SceneError(
                f"Band edges: '{word}' is not a number; expected um between commas, as in 3, 5, 8, 14"
            ) from None
    edges = np.array(edges)
    check_band_edges(edges)
    return edges


def read_band_range(infrared) -> tuple[float, float]:
    """Shortest and longest wavelength of the bands, um. Raises SceneError as read_band_edges does.

    It is quick in any mode: the edges of adaptive bands depend on all objects, their ends do not.
    """
    adaptive = infrared.band_mode == "ADAPTIVE"
    edges = uniform_edges(*_typed_ends(infrared), 1) if adaptive else read_band_edges(infrared)
    return float(edges[0]), float(edges[-1])


def _typed_ends(infrared) -> tuple[float, float]:
    """Shortest and longest wavelength of bands that are not custom ones, um."""
    return as_typed(infrared.wavelength_min), as_typed(infrared.wavelength_max)


def read_adaptive_bands(infrared) -> Partition:
    """The bands that suit the spectra and temperatures of a scene best. Raises SceneError as choose_bands does.

    Blender registers the passes of a scene once, and then renders all frames and view layers into them. So the bands
    follow from the scene as the interface shows it, and not as it is evaluated for a frame. Values that cannot be
    rendered are passed over here: the render reports them.
    """
    scene = infrared.id_data.original
    infrared = scene.infrared
    tolerance = as_typed(infrared.band_tolerance)
    response = read_response(infrared)
    return _choose_bands(
        *_typed_ends(infrared),
        *_scene_spectra(scene),
        count=0 if tolerance > 0 else infrared.band_count,
        tolerance=tolerance,
        response=None if response is None else np.array(response.curve).tobytes(),
    )


def _scene_spectra(scene) -> tuple[tuple[bytes, ...], tuple[float, ...], tuple[float, ...]]:
    """The emissivity and transmittance curves in a scene ((2, n) float64 arrays as bytes), of gases that of all they
    absorb on a way through them; the temperatures of its surfaces, gases and worlds, and those of its lights, K; each
    in ascending order.
    """
    infrared = scene.infrared
    materials = {layer.material_override for layer in scene.view_layers}
    curves, temperatures, lights = set(), [], set()
    for world in {layer_world(scene, layer) for layer in scene.view_layers}:
        with suppress(SceneError):
            temperatures.append(world_temperature(world))
            if is_medium(world):
                depth = read_number(world, "depth", 0.0, "World", " in metres")
                check_depth(depth)
                curves.add(_absorptance(infrared, world, world, temperatures[-1], depth))
    for obj in layers_objects(scene.view_layers):
        with suppress(SceneError):
            if obj.type in SURFACE_TYPES:
                own = {slot.material for slot in obj.material_slots}
                materials |= own
                kelvin = object_temperatures(obj, infrared.ambient_temperature)
                temperatures += kelvin
                through = min(obj.dimensions) * metres_per_unit(scene)
                curves |= {_absorptance(infrared, gas, obj, kelvin[-1], through) for gas in own if is_medium(gas)}
            elif obj.type == "LIGHT" and obj.data.energy > 0:
                lights.add(light_temperature(obj))
    for material in with_mixed(materials):
        with suppress(SceneError):
            if not is_medium(material):
                read = read_material(material, infrared.default_emissivity)
                shown = (read.curve, read.transmitted_curve) if read.transmits else (read.curve,)
                curves |= {np.array(curve).tobytes() for curve in shown}
    return tuple(sorted(curves)), tuple(sorted(temperatures or [0.0])), tuple(sorted(lights))


def _absorptance(infrared, block, filled, kelvin: float, length: float) -> bytes:
    """Curve of the share of light that a length (m) of the gas of a material or world takes, (2, n) float64 as bytes.

    filled: the object or world whose pressure the gas has. kelvin: its temperature.
    """
    wavelengths = np.geomspace(*_typed_ends(infrared), _WAVELENGTHS)
    gas = read_gas_alone(block, block.name, kelvin, read_pressure(filled, filled.name))
    return np.array((wavelengths, 1.0 - transmittance(gas, wavelengths, length))).tobytes()


@lru_cache(maxsize=8)
def _choose_bands(low, high, curves: tuple[bytes, ...], temperatures, lights, count, tolerance, response) -> Partition:
    """choose_bands, which takes 0.1 s, once for each scene. curves, response: (2, n) float64 arrays as bytes."""

    def unpacked(curve: bytes):
        return tuple(np.frombuffer(curve).reshape(2, -1))

    seen = None if response is None else unpacked(response)
    return choose_bands(low, high, [unpacked(curve) for curve in curves], temperatures, lights, count, tolerance, seen)
