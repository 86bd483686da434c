# SPDX-License-Identifier: GPL-3.0-or-later
"""Choice of the reference temperature T0 of the subtraction L = B(T0) + dL."""

import numpy as np

from .pilot import Pilot
from .scene import Scene
from .spectrum import band_radiance
from .surfaces import Surfaces

_GROUPS = 512  # groups of equal temperature that the choice distinguishes


def choose_reference(scene: Scene, surfaces: Surfaces, pilot: Pilot, emissivity: np.ndarray) -> float:
    """T0 (K) with the least total |excess| in what the image gathers, the surroundings included.

    emissivity: (m, b) of each material in each band. The cost is a sum of |B(T) - B(T0)| with the pilot's importance,
    so its minimum lies at one of the temperatures of the scene: only these are tried. The group of surfaces that lights
    most of the image then often needs no photons at all.
    """
    temperature, group = np.unique(surfaces.temperature.mean(axis=1, dtype=np.float32), return_inverse=True)
    group = group.ravel()
    if temperature.size > _GROUPS:
        merge = np.arange(temperature.size) * _GROUPS // temperature.size
        group = merge[group]
        temperature = temperature[np.searchsorted(merge, np.arange(_GROUPS))]
    emitting = np.zeros((temperature.size, scene.band_count))  # importance times emissivity
    for index in range(len(scene.materials)):
        chosen = surfaces.material == index
        if chosen.any():
            share = np.bincount(group[chosen], pilot.importance[chosen], temperature.size)
            emitting += share[:, None] * emissivity[index]
    kelvin = np.append(temperature.astype(np.float64), scene.world_temperature)
    emitting = np.vstack((emitting, np.full(scene.band_count, pilot.sky)))
    radiance = band_radiance(scene.band_edges, kelvin)
    cost = [float(np.sum(emitting * np.abs(radiance - candidate))) for candidate in radiance]
    return float(kelvin[int(np.argmin(cost))])
