# SPDX-License-Identifier: GPL-3.0-or-later
"""Choice of the reference temperature T0 of the subtraction L = B(T0) + dL."""

import math

import numpy as np

from .pilot import Pilot
from .radiometry import band_emissivity
from .scene import Scene
from .spectrum import band_radiance
from .surfaces import Surfaces, areas

_GROUPS = 512  # groups of equal temperature that the choice distinguishes


def choose_reference(scene: Scene, surfaces: Surfaces, pilot: Pilot) -> float:
    """T0 (K) with the least total |excess| power of what the image can depend on, the surroundings included.

    The cost is a sum of |B(T) - B(T0)|, so its minimum lies at one of the temperatures of the scene: only these are
    tried. The largest group of triangles at one temperature then often needs no photons at all.
    """
    area = areas(surfaces.corners) * pilot.weight.sum(axis=1)
    temperature, group = np.unique(surfaces.temperature.mean(axis=1, dtype=np.float32), return_inverse=True)
    group = group.ravel()
    if temperature.size > _GROUPS:
        merge = np.arange(temperature.size) * _GROUPS // temperature.size
        group = merge[group]
        temperature = temperature[np.searchsorted(merge, np.arange(_GROUPS))]
    bands = scene.band_count
    emitting = np.zeros((temperature.size, bands))  # area times emissivity, m2
    grand = float(np.average(temperature, weights=np.bincount(group, area, temperature.size) + 1e-30))
    for index, material in enumerate(scene.materials):
        chosen = surfaces.material == index
        if chosen.any():
            emissivity = band_emissivity(scene.band_edges, grand, material.curve)
            emitting += np.bincount(group[chosen], area[chosen], temperature.size)[:, None] * emissivity
    kelvin = np.append(temperature.astype(np.float64), scene.world_temperature)
    emitting = np.vstack((emitting, np.full(bands, area.sum() * pilot.openness)))
    radiance = band_radiance(scene.band_edges, kelvin)
    cost = [math.pi * float(np.sum(emitting * np.abs(radiance - candidate))) for candidate in radiance]
    return float(kelvin[int(np.argmin(cost))])
