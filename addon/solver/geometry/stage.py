# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage: surfaces and what they emit and reflect at an Interaction.

Callers ask the functions here and never index a table by material themselves. So a property can later vary over a
surface, or differ between its sides, with changes in this file alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..physics.lobes import is_glossy, lobes_of
from ..physics.radiometry import Radiometry, excess
from ..system.kernels import FAST_INLINED, INLINED, njit
from .surfaces import Surfaces, layer_of


class Stage(NamedTuple):
    """All that light meets: surfaces, and the tables of what their materials emit and reflect."""

    surfaces: Surfaces
    radiometry: Radiometry


@njit(inline="always")  # as it returns a row, see kernels
def reflectance_at(stage, at):
    """(b,) float32 reflectance in each band at an Interaction."""
    return stage.radiometry.reflectance[at.material]


@njit(inline="always")
def lobes_at(stage, at):
    """The Lobes at an Interaction, see physics.lobes."""
    return lobes_of(stage.radiometry.lobes, at.material)


@njit(inline="always")
def lobes_met(stage, hits, i):
    """The Lobes where ray i met a triangle, for those who only then need the Interaction, which takes longer."""
    return lobes_of(stage.radiometry.lobes, stage.surfaces.material[hits.triangle[i]])


@njit(inline="always")
def stored_at(stage, at):
    """Which photons are stored at an Interaction: NONE, ALL or STRAIGHT, see radiometry.stored_photons."""
    return stage.radiometry.stores[at.material]


@njit(**INLINED)
def temperature_at(stage, at):
    """Temperature at an Interaction, K, linear between the triangle's corners."""
    temperature, t = stage.surfaces.temperature, at.triangle
    if temperature.shape[1] == 1:
        return float(temperature[t, 0])
    return (1.0 - at.u - at.v) * temperature[t, 0] + at.u * temperature[t, 1] + at.v * temperature[t, 2]


@njit(inline="always")
def layer_at(stage, at):
    """The layer of the image to which emission at an Interaction belongs."""
    return layer_of(stage.surfaces.layer, at.triangle)


@njit(**FAST_INLINED)
def fill_emission(stage, at, out):
    """Fill out (b,) float64 with the radiance emitted at an Interaction against the incoming direction, in excess of
    the radiance at T0, W m-2 sr-1."""
    excess(stage.radiometry, at.material, temperature_at(stage, at), at.cosine, out)


class Emitted(NamedTuple):
    """A cache of emission: scenes have few pairs of material and temperature, and rays meet the same pairs many times.
    Each pair can be in one slot only.

    material: (slots,) int32, -1 for an empty slot. kelvin: (slots,) float64. radiance: (slots, b), excess, W m-2 sr-1.
    room: (b,) float64.
    """

    material: np.ndarray
    kelvin: np.ndarray
    radiance: np.ndarray
    room: np.ndarray


_SLOTS, _PER_KELVIN = 64, 17.0  # slots, and how many slots further the same material lies with each kelvin


def nothing_emitted(bands: int, dtype: type = np.float32) -> Emitted:
    """An empty cache. dtype: of the radiance."""
    return Emitted(np.full(_SLOTS, -1, np.int32), np.empty(_SLOTS), np.empty((_SLOTS, bands), dtype), np.empty(bands))


@njit(inline="always")
def emission_at(stage, at, emitted):
    """(b,) radiance emitted at an Interaction against the incoming direction, in excess of the radiance at T0, W m-2
    sr-1: a row of the cache, valid until the next call."""
    return emitted.radiance[_emit_into_slot(stage, at, emitted)]


@njit(**FAST_INLINED)
def _emit_into_slot(stage, at, emitted):
    """Fill a slot of the cache with the emission at an Interaction, if it is not there yet; returns the slot."""
    kelvin, glossy = temperature_at(stage, at), is_glossy(lobes_at(stage, at))
    slot = (at.material + int(_PER_KELVIN * kelvin)) % _SLOTS
    if glossy or at.material != emitted.material[slot] or kelvin != emitted.kelvin[slot]:
        excess(stage.radiometry, at.material, kelvin, at.cosine, emitted.room)
        # with a glossy lobe emission depends on the cosine, too, so the slot is not reused
        emitted.material[slot], emitted.kelvin[slot] = -1 if glossy else at.material, kelvin
        for b in range(emitted.room.size):
            emitted.radiance[slot, b] = emitted.room[b]
    return slot
