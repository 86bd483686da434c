# SPDX-License-Identifier: GPL-3.0-or-later
"""Choice of the reference temperature T0 of the subtraction L = B(T0) + dL, and the typical temperature behind dL."""

from typing import NamedTuple

import numpy as np

from ..geometry.surfaces import Surfaces
from ..physics.spectrum import band_radiance
from ..scene import Scene
from .pilot import Pilot

_GROUPS = 512  # groups of about equal temperature, at most, that the choice distinguishes


class Sources(NamedTuple):
    """What lights the image, by temperature: groups of surfaces, and last the surroundings.

    temperature: (n,) float64 K. share: (n, b) float64, importance (see Pilot) times emissivity. radiance: (n, b)
    float64, of a blackbody, W m-2 sr-1.
    """

    temperature: np.ndarray
    share: np.ndarray
    radiance: np.ndarray


def gather_sources(scene: Scene, surfaces: Surfaces, pilot: Pilot, emissivity: np.ndarray) -> Sources:
    """The sources of a scene, of the triangles that the pilot's paths met; the coldest one if they met none.
    emissivity: (m, b) of each material in each band."""
    met, importance = pilot.met[pilot.met >= 0], pilot.importance[pilot.met >= 0]
    if not len(met):
        met, importance = surfaces.temperature.mean(axis=1).argmin(keepdims=True), np.zeros(1)
    temperature, group = np.unique(surfaces.temperature[met].mean(axis=1, dtype=np.float32), return_inverse=True)
    group = group.ravel()
    if temperature.size > _GROUPS:
        merge = np.arange(temperature.size) * _GROUPS // temperature.size
        group = merge[group]
        temperature = temperature[np.searchsorted(merge, np.arange(_GROUPS))]
    materials = len(scene.materials)
    both = np.bincount(group * materials + surfaces.material[met], importance, temperature.size * materials)
    emitting = np.einsum("tm,mb->tb", both.reshape(-1, materials), emissivity)
    kelvin = np.append(temperature.astype(np.float64), scene.world_temperature)
    emitting = np.vstack((emitting, np.full(scene.band_count, pilot.sky)))
    return Sources(kelvin, emitting, band_radiance(scene.band_edges, kelvin))


def choose_reference(sources: Sources) -> float:
    """T0 (K) with the least total |excess| of the light in the image, the surroundings included.

    The cost is the sum of |B(T) - B(T0)| weighted with the pilot's importance, so it is least at one of the
    temperatures of the scene: only these are tried. The group of surfaces that lights most of the image then often
    needs no photons at all.
    """
    cost = [float(np.sum(sources.share * np.abs(sources.radiance - candidate))) for candidate in sources.radiance]
    return float(sources.temperature[int(np.argmin(cost))])


def typical_source(sources: Sources, edges: np.ndarray, reference: float) -> float:
    """Mean temperature (K) of the sources, weighted with their excess over the reference (K).

    edges: (b + 1,) um. The reference itself where nothing has an excess.
    """
    excess = np.sum(sources.share * np.abs(sources.radiance - band_radiance(edges, reference)), axis=1)
    return float(np.average(sources.temperature, weights=excess)) if excess.any() else reference
