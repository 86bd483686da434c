# SPDX-License-Identifier: GPL-3.0-or-later
"""Suns and the world's air: its depth takes from all light of a sun, direct or indirect, what Bouguer's law says."""

import numpy as np
import pytest

from addon.solver import Material, Medium, Settings, SunLight
from addon.solver.passes import prepare
from addon.solver.photons.emission import Batch, emit
from addon.solver.photons.walk import collect, fly_photons
from addon.solver.photons.wave import empty_wave
from addon.solver.physics.spectrum import band_radiance
from tests.helpers.scenes import box, look, make_scene, mean_and_error

EDGES, KELVIN, DEPTH = np.array([8.0, 10.0, 12.0]), 300.0, 1.2  # um; K, of everything; optical depth of the air
PHOTONS = 40_000


def sunny_box(air=None, metres=0.0):
    """A white box without a lid, with the sun on its floor and one wall, all at one temperature."""
    vertices, triangles = box((2.0, 2.0, 1.5))
    sun = SunLight(np.array((0.6, 0.0, -0.8)), 1e5)
    return make_scene(
        vertices, triangles[:-2], KELVIN, [Material("White", 0.1)], look((0.1, 1.0, 1.3), (1.5, 1.0, 0.2), 16, 12),
        EDGES, world_temperature=KELVIN, lights=(sun,), media=() if air is None else (air,), world_depth=metres,
    )  # fmt: skip


def air(metres, albedo=0.0):
    """Air of that depth in metres, at the temperature of all else."""
    return Medium("Air", (1.0 - albedo) * DEPTH / metres, KELVIN, albedo * DEPTH / metres), metres


def test_indirect_sunlight_has_crossed_the_depth_of_the_air():
    """So thin air, and so much of it, that only the way to the sun counts: ways in the box take 3e-4 at most."""
    settings, excess = Settings(passes=8, photons_per_pass=PHOTONS, threads=1), []
    for scene in (sunny_box(), sunny_box(*air(1e5))):
        mean, error = mean_and_error(scene, settings)
        excess.append((mean - band_radiance(EDGES, KELVIN).sum(), error))
    (clear, error), (dimmed, error_of_dimmed) = excess
    print(f"dimmed / clear {dimmed / clear:.4f}, exp(-{DEPTH}) = {np.exp(-DEPTH):.4f}, error {error / clear:.4f}")
    expected = clear * np.exp(-DEPTH)
    within = 4.0 * np.hypot(error_of_dimmed, error * np.exp(-DEPTH)) + 3e-4 * expected
    assert abs(dimmed - expected) < within < 0.03 * expected


@pytest.mark.parametrize("albedo", [0.0, 0.3])
@pytest.mark.parametrize("metres", [1.0, 30.0])
def test_photons_of_suns_have_crossed_the_depth_of_the_air(metres, albedo):
    """Where they meet a surface they have lost what the depth takes, however long their way, and all along it the air
    scatters its coefficient times what is left: that is what shadow rays find of the sun there."""
    medium, _ = air(metres, albedo)
    model = prepare(sunny_box(medium, metres), Settings(photons_per_pass=PHOTONS, threads=1))
    wave, scattered = empty_wave(PHOTONS, 2, False), empty_wave(PHOTONS, 2, False)
    key = np.uint64(1)
    emit(model.emitters, model.stage, Batch(key, 0, PHOTONS, PHOTONS), wave)
    left = wave.power[:, 0] * np.exp(-DEPTH)
    collect(model.tracer, model.stage, wave, key, model.emitters.surroundings)
    hits = model.tracer.trace(wave.origin, wave.direction)
    met = hits.triangle >= 0
    way = np.where(met, hits.distance, -2.0 * np.einsum("ri,ri->r", wave.origin, wave.direction))
    found = fly_photons(model.tracer, hits, wave, (key, 0), scattered)
    assert 0.1 < np.mean(met) < 0.9  # some pass beside the box
    if albedo == 0.0:
        np.testing.assert_allclose(wave.power[met, 0], left[met], rtol=1e-5)
        assert found == 0
        return
    again = np.zeros(PHOTONS)
    again[scattered.photon[:found]] = scattered.power[:found, 0]
    for given, expected in ((wave.power[met, 0], left[met]), (again, left * albedo * DEPTH / metres * way)):
        difference = given.astype(float) - expected
        assert abs(difference.mean()) < 4.0 * difference.std() / np.sqrt(len(difference))
        assert difference.std() / np.sqrt(len(difference)) < 0.03 * expected.mean()
