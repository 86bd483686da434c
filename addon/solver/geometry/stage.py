# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage: surfaces and what they emit and reflect, asked for at an Interaction.

Callers ask here and never index a table by material themselves, so that what a surface does may come to vary over it,
or differ between its sides, in this file alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..physics.lobes import is_glossy, lobes_of
from ..physics.radiometry import Radiometry, excess
from ..system.kernels import FAST_INLINED, INLINED, njit
from .surfaces import Surfaces, layer_of


class Stage(NamedTuple):
    """What light travels in: surfaces, and the tables of what their materials emit and reflect."""

    surfaces: Surfaces
    radiometry: Radiometry


@njit(inline="always")  # as it returns a row, see kernels
def reflectance_at(stage, at):
    """(b,) float32 reflectance in each band."""
    return stage.radiometry.reflectance[at.material]


@njit(**INLINED)
def lobes_at(stage, at):
    """The Lobes, see physics.lobes."""
    return lobes_of(stage.radiometry.lobes, at.material)


@njit(**INLINED)
def stored_at(stage, at):
    """Which photons are stored: NONE, ALL or STRAIGHT, see radiometry.stored_photons."""
    return stage.radiometry.stores[at.material]


@njit(**INLINED)
def temperature_at(stage, at):
    """Temperature, linear between the triangle's corners, K."""
    temperature, t = stage.surfaces.temperature, at.triangle
    if temperature.shape[1] == 1:
        return float(temperature[t, 0])
    return (1.0 - at.u - at.v) * temperature[t, 0] + at.u * temperature[t, 1] + at.v * temperature[t, 2]


@njit(**INLINED)
def layer_at(stage, at):
    """The layer of the image that the emission belongs to."""
    return layer_of(stage.surfaces.layer, at.triangle)


@njit(**FAST_INLINED)
def fill_emission(stage, at, out):
    """Fill out (b,) float64 with the radiance that is emitted towards where the ray came from, in excess of that at T0,
    W m-2 sr-1."""
    excess(stage.radiometry, at.material, temperature_at(stage, at), at.cosine, out)


class Emitted(NamedTuple):
    """What was emitted at the points that were asked about last: scenes have few pairs of material and temperature, and
    rays meet them again and again. Each pair has one slot that it can be in.

    material: (slots,) int32, -1 for none. kelvin: (slots,) float64. radiance: (slots, b) excess, W m-2 sr-1. room: (b,)
    float64.
    """

    material: np.ndarray
    kelvin: np.ndarray
    radiance: np.ndarray
    room: np.ndarray


_SLOTS, _PER_KELVIN = 64, 17.0  # and how far apart a material's temperatures lie in them


def nothing_emitted(bands: int, dtype: type = np.float32) -> Emitted:
    """Without anything asked for yet. dtype: of the radiance."""
    return Emitted(np.full(_SLOTS, -1, np.int32), np.empty(_SLOTS), np.empty((_SLOTS, bands), dtype), np.empty(bands))


@njit(inline="always")
def emission_at(stage, at, emitted):
    """(b,) radiance emitted towards where the ray came from, in excess of that at T0, W m-2 sr-1: a row of emitted,
    which stays as it is until the next question."""
    return emitted.radiance[_emit_into_slot(stage, at, emitted)]


@njit(**FAST_INLINED)
def _emit_into_slot(stage, at, emitted):
    """The slot of emitted that holds the emission at an Interaction now."""
    kelvin, glossy = temperature_at(stage, at), is_glossy(lobes_at(stage, at))
    slot = (at.material + int(_PER_KELVIN * kelvin)) % _SLOTS
    if glossy or at.material != emitted.material[slot] or kelvin != emitted.kelvin[slot]:
        excess(stage.radiometry, at.material, kelvin, at.cosine, emitted.room)
        # that of a glossy lobe depends on the cosine, too, so it is asked for anew
        emitted.material[slot], emitted.kelvin[slot] = -1 if glossy else at.material, kelvin
        for b in range(emitted.room.size):
            emitted.radiance[slot, b] = emitted.room[b]
    return slot
