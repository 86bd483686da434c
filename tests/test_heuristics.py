# SPDX-License-Identifier: GPL-3.0-or-later
"""Multiple importance sampling: whatever two ways send, together they count all light once."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.geometry.interaction import Interaction
from addon.solver.geometry.surfaces import Surfaces
from addon.solver.photons.cells import no_cells
from addon.solver.photons.side_table import unweighted
from addon.solver.photons.wave import FORWARDS, empty_wave, stored_share
from addon.solver.physics.lobes import diffuse_density, sample_diffuse
from addon.solver.planning.lamps import Lamps, share_of_ray
from addon.solver.sampling.heuristics import TYPICAL_RAYS, balance

densities = st.floats(1e-30, 1e30)


@settings(deadline=None)  # the first call compiles
@given(densities, densities)
def test_the_shares_sum_to_one(mine, other):
    """And each is in proportion to the square of what its way sends."""
    share = balance(mine, other)
    assert share + balance(other, mine) == pytest.approx(1.0, rel=1e-15)
    assert share == pytest.approx(mine**2 / (mine**2 + other**2), rel=1e-15) and 0.0 <= share <= 1.0


@settings(deadline=None)  # the first call compiles
@given(densities)
def test_a_lone_way_counts_all(mine):
    """That of the other is none, whatever is sent; infinitely many of the other leave nothing."""
    assert balance(mine, 0.0) == 1.0 and balance(0.0, mine) == 0.0
    assert balance(mine, math.inf) == 0.0


def met(distance, cosine):
    """An Interaction with the second side of triangle 1, at a distance (m) and with a cosine."""
    zero, up = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    return Interaction(
        np.int64(1), np.int32(3), zero, up, up, 1.0, np.int32(0), 0.0, 0.0, (0.0, 0.0, -1.0), cosine, cosine, distance
    )


@settings(deadline=None)  # the first call compiles
@given(st.floats(0.01, 100.0), st.floats(0.01, 1.0), st.floats(0.01, 1.0), st.floats(1e-3, 1e6))
def test_rays_and_photons_leave_as_much_to_shadow_rays(distance, at_lamp, at_floor, density):
    """One way of light, from a lamp to a floor, of which each side has its cosine. A ray of a final gather is denser
    where its cosine on the floor is larger, a lamp point is seen under d^2 / cos; photons count alike."""
    lamps = Lamps(*[None] * len(Lamps._fields))
    sides, surfaces = (
        unweighted(np.array([0.0, 2.0], np.float32)),
        Surfaces(*[None] * len(Surfaces._fields)),
    )
    lamps = lamps._replace(sides=sides, share=np.array([0.0, density / 2.0]), cells=no_cells())
    surfaces = surfaces._replace(sheet=np.array([(0, 0), (0, 1)], np.int32))
    by_rays = share_of_ray(TYPICAL_RAYS * at_floor / math.pi, lamps, surfaces, met(distance, at_lamp))
    wave = empty_wave(1, 1, False)
    wave.aimed[0], wave.arrival[0] = density / at_lamp, FORWARDS
    by_photons = stored_share(wave, 0, met(distance, at_floor))
    expected = 1.0 / (1.0 + (math.pi * density * distance**2 / (TYPICAL_RAYS * at_floor * at_lamp)) ** 2)
    assert by_rays == pytest.approx(expected, rel=1e-6)
    assert by_photons == pytest.approx(expected, rel=1e-5)  # float32


def test_density_of_diffuse_directions_is_theirs():
    """The integral of 1 / density over the directions that are drawn is the solid angle of the hemisphere; grazing ones
    alone weigh much, so they are left out: those with cosines above c fill 2 pi (1 - c)."""
    normal, least = (0.36, 0.48, 0.8), 0.2
    numbers = np.random.default_rng(2).random((20_000, 2))
    density = np.array([diffuse_density(normal, sample_diffuse(normal, *pair)) for pair in numbers])
    weight = np.where(density > least / math.pi, 1.0 / np.maximum(density, 1e-12), 0.0)
    error = weight.std(ddof=1) / math.sqrt(len(weight))
    assert error < 0.01 * weight.mean()
    assert abs(weight.mean() - 2 * math.pi * (1 - least)) < 4 * error
    assert diffuse_density(normal, (-0.36, -0.48, -0.8)) == 0.0
