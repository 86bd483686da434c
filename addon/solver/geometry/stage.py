# SPDX-License-Identifier: GPL-3.0-or-later
"""The stage: surfaces and what they emit and reflect at an Interaction.

Callers ask the functions here and never index a table by material themselves. So a property can later vary over a
surface, or differ between its sides, with changes in this file alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..physics.fresnel import BELOW, ENTERING, FACET, TOTAL, fill_reflectance, multiply_reflectance, reflectance_of
from ..physics.lobes import facet_cosine, is_angular, lobes_of, transmits
from ..physics.radiometry import Radiometry, excess
from ..system.kernels import FAST_INLINED, INLINED, njit
from .interaction import mixed_at
from .surfaces import Surfaces, layer_of, material_at, other_material
from .textures import row_of, temperature_in_image


class Stage(NamedTuple):
    """All that light meets: surfaces, and the tables of what their materials emit and reflect."""

    surfaces: Surfaces
    radiometry: Radiometry


def transmits_anywhere(stage: Stage) -> bool:
    """Whether light passes straight through any surface."""
    return bool(stage.radiometry.transmittance.any())


# What a surface reflects is a row of the table of materials, and nothing is computed, unless it follows Fresnel's law.
# All functions that return rows are inlined, see kernels.


@njit(inline="always")
def reflectance_at(stage, at, room):
    """(b,) float32 reflectance in each band at an Interaction, of all lobes together, for light along its ray: a row of
    a table, or the room (b,), of the same dtype, where it depends on the angle."""
    return _reflectance_of(stage, at, TOTAL, at.cosine, room)


@njit(inline="always")
def diffuse_reflectance_at(stage, at, room):
    """As reflectance_at, of the diffuse lobe, over its share (see lobes.diffuse_share)."""
    return _reflectance_of(stage, at, BELOW, at.cosine, room)


@njit(inline="always")
def lobe_reflectance_at(stage, at, lobes, direction, room):
    """As reflectance_at, of the specular lobe, over its share, where it reflects the ray in a unit direction: that of
    the facet that does."""
    return _reflectance_of(stage, at, FACET, facet_cosine(lobes, at, direction), room)


@njit(inline="always")
def _reflectance_of(stage, at, kind, cosine, room):
    """In the room, the row of a kind of the FresnelTable at a cosine; of a material without one, its reflectance."""
    angular = stage.radiometry.fresnel.row[at.material]
    row = stage.radiometry.reflectance[at.material]
    if angular >= 0:
        fill_reflectance(stage.radiometry.fresnel, angular, kind, cosine, room)
        row = room
    return row


@njit(**INLINED)
def one_reflectance_at(stage, at, kind, cosine):
    """Reflectance at an Interaction in a stage that has but one band, of the FresnelTable's kind at a cosine."""
    angular = stage.radiometry.fresnel.row[at.material]
    if angular >= 0:
        return reflectance_of(stage.radiometry.fresnel, angular, kind, cosine, 0)
    return float(stage.radiometry.reflectance[at.material, 0])


@njit(**FAST_INLINED)
def enter(stage, at, cosine, value):
    """Multiply value (b,), light that arrives under a cosine, by how much more of it gets to the diffuse lobe at an
    Interaction than of light from all sides: 1 but under a lobe that follows Fresnel's law."""
    angular = stage.radiometry.fresnel.row[at.material]
    if angular >= 0:
        multiply_reflectance(stage.radiometry.fresnel, angular, ENTERING, cosine, value)


@njit(inline="always")
def transmittance_at(stage, at):
    """(b,) float32 transmittance in each band of the thin sheet at an Interaction, at every angle."""
    return stage.radiometry.transmittance[at.material]


@njit(**FAST_INLINED)
def shine_through(stage, at, value):
    """Multiply value (b,) by the transmittance at an Interaction; returns whether anything is left."""
    tau, left = stage.radiometry.transmittance, False
    for b in range(value.size):
        value[b] *= tau[at.material, b]
        left |= value[b] != 0.0
    return left


@njit(inline="always")
def passing_at(stage, at, room):
    """As transmittance_at, of a mixed material the mean over its grains, so that these bring no noise to what is seen
    through them: a row of a table, or the room (b,) float32."""
    (other, share), tau = mixed_at(stage.surfaces, at), stage.radiometry.transmittance
    row = tau[at.material]
    if 0.0 < share < 1.0:
        own = stage.surfaces.material[at.triangle]
        for b in range(room.size):
            room[b] = tau[own, b] + np.float32(share) * (tau[other, b] - tau[own, b])
        row = room
    return row


@njit(**INLINED)
def is_passed(stage, t):
    """Whether light passes any grain of triangle t straight on."""
    lobes, other = stage.radiometry.lobes, other_material(stage.surfaces, t)
    return transmits(lobes_of(lobes, stage.surfaces.material[t])) or (other >= 0 and transmits(lobes_of(lobes, other)))


@njit(**INLINED)
def is_grainy(stage, at):
    """Whether it hangs on the grain what happens at an Interaction."""
    return 0.0 < mixed_at(stage.surfaces, at)[1] < 1.0


@njit(inline="always")
def lobes_at(stage, at):
    """The Lobes at an Interaction, see physics.lobes."""
    return lobes_of(stage.radiometry.lobes, at.material)


@njit(inline="always")
def lobes_met(stage, hits, i):
    """The Lobes where ray i met a triangle, for those who only then need the Interaction, which takes longer."""
    return lobes_of(
        stage.radiometry.lobes, material_at(stage.surfaces, np.int64(hits.triangle[i]), hits.u[i], hits.v[i])
    )


@njit(**INLINED)
def stored_at(stage, at):
    """Which photons are stored at an Interaction: NONE, STRAIGHT or ALL, see radiometry.stored_photons. Of a mixed
    material both grains store what either does: photons are counted on areas that hold both."""
    stores = stage.radiometry.stores
    kept, other = stores[stage.surfaces.material[at.triangle]], other_material(stage.surfaces, at.triangle)
    return max(kept, stores[other]) if other >= 0 else kept


@njit(**INLINED)
def asked_at(stage, at):
    """Which stored photons what is reflected at an Interaction asks for, see stored_at."""
    return stage.radiometry.stores[at.material]


@njit(**INLINED)
def temperature_at(stage, at):
    """Temperature at an Interaction, K, by the triangle's image, else linear between its corners."""
    temperature, t, textures = stage.surfaces.temperature, at.triangle, stage.surfaces.textures
    if textures.row.size:
        kelvin = temperature_in_image(textures, row_of(textures, t), at.u, at.v)
        if kelvin >= 0.0:
            return kelvin
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
    the radiance at T0, W m-2 sr-1: of a mixed material that of the grain there."""
    excess(stage.radiometry, at.material, temperature_at(stage, at), at.cosine, out)


@njit(**FAST_INLINED)
def leave_out(stage, at, cosine, value):
    """Undo `enter`."""
    angular = stage.radiometry.fresnel.row[at.material]
    if angular >= 0:
        for b in range(value.size):
            value[b] /= np.float32(reflectance_of(stage.radiometry.fresnel, angular, ENTERING, cosine, b))


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
    sr-1: a row of the cache, valid until the next call. Of a mixed material it is the mean over its grains, so that
    these bring no noise to what is seen."""
    return emitted.radiance[_emit_into_slot(stage, at, emitted)]


@njit(**FAST_INLINED)
def _emit_into_slot(stage, at, emitted):
    """Fill a slot of the cache with the emission at an Interaction, if it is not there yet; returns the slot."""
    kelvin, angular = temperature_at(stage, at), is_angular(lobes_at(stage, at))
    (other, share), own = mixed_at(stage.surfaces, at), stage.surfaces.material[at.triangle]
    slot = (own + int(_PER_KELVIN * kelvin)) % _SLOTS
    if angular or share > 0.0 or own != emitted.material[slot] or kelvin != emitted.kelvin[slot]:
        excess(stage.radiometry, own, kelvin, at.cosine, emitted.room)
        # where emission depends on more than material and temperature the slot is not reused
        emitted.material[slot], emitted.kelvin[slot] = -1 if angular or share > 0.0 else own, kelvin
        for b in range(emitted.room.size):
            emitted.radiance[slot, b] = emitted.room[b]
        if share > 0.0:
            excess(stage.radiometry, other, kelvin, at.cosine, emitted.room)
            for b in range(emitted.room.size):
                emitted.radiance[slot, b] += share * (emitted.room[b] - emitted.radiance[slot, b])
    return slot
