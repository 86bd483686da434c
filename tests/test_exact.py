# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with an exact solution, rendered through the camera.

The mean of the image must lie within 3 standard errors (from the spread of the passes) of the truth, and within 0.3 %,
after PASSES passes of PHOTONS photons. Reference values: closed forms for enclosures (Modest, Radiative Heat Transfer,
chapter 5).
"""

import numpy as np
import pytest
from scenes import box, look, make_scene, mean_and_error, sphere

from addon.solver import Material, Settings, render
from addon.solver.spectrum import band_radiance, planck
from addon.solver.surfaces import areas

PASSES, PHOTONS = 150, 30_000
NARROW = np.array([9.99, 10.01])  # um: one narrow band, so that the closed forms for one wavelength hold to 1e-6
SUBTRACTION = [
    pytest.param({}, id="subtraction"),
    pytest.param({"reference_subtraction": False}, id="no-subtraction"),
    pytest.param({"reference_temperature": 333.0}, id="wrong-T0"),
]


def black(temperature):
    return band_radiance(NARROW, temperature)[0]


def check(scene, truth, **settings):
    mean, error = mean_and_error(scene, Settings(passes=PASSES, photons_per_pass=PHOTONS, **settings))
    deviation, error = mean / truth - 1.0, error / truth
    print(f"deviation {deviation:+.5%}, standard error {error:.5%}")
    assert abs(deviation) <= max(3 * error, 1e-6)  # 1e-6: float32 images
    assert abs(deviation) < 0.003


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize(
    "material",
    [
        Material("grey", 0.6),
        Material("spectral", np.array([[9.9, 0.1], [10.0, 0.8], [10.1, 0.3]])),
        Material("mirror and diffuse", 0.4, specular=0.5),
        Material("rough", 0.5, specular=0.7, roughness=0.6),
        Material("very rough", 0.3, specular=1.0, roughness=1.0),
    ],
    ids=lambda material: material.name,
)
def test_isothermal_enclosure(material, settings):
    """Black at its temperature, whatever the walls (Kirchhoff); with the right reference exactly so, in every pixel."""
    vertices, triangles = box((1.0, 0.8, 0.6))
    scene = make_scene(vertices, triangles, 300.0, [material], look((0.8, 0.6, 0.4), (0.1, 0.1, 0.1)), NARROW)
    check(scene, black(300.0), **settings)
    if not settings:
        film = render(scene, Settings(passes=2, photons_per_pass=1000))
        np.testing.assert_allclose(film.temperature(), 300.0, rtol=1e-6)
        assert np.all(film.noise() == 0)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("target, truth", [(0.0, 31.41425), (0.5, 22.81816)], ids=["hot", "cold"])
def test_infinite_plates(target, truth, settings):
    """Two plates between mirrors: 400 K, eps 0.8 below and 300 K, eps 0.4 above; radiosity / pi at 10 um."""
    vertices, triangles = box((1.0, 1.0, 0.5))
    materials = [Material("mirror", 0.0, specular=1.0), Material("hot", 0.8), Material("cold", 0.4)]
    index = [0] * 8 + [1, 1, 2, 2]
    temperature = [300.0] * 8 + [400.0, 400.0, 300.0, 300.0]
    camera = look((0.5, 0.45, 0.25), (0.5, 0.5, target))
    scene = make_scene(vertices, triangles, temperature, materials, camera, NARROW, index)
    at_ten_micrometres = black(400.0) / planck(10.0, 400.0)  # width of the band as the closed form sees it
    check(scene, truth * at_ten_micrometres, **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("target", [1.0, -1.0], ids=["hot", "cold"])
def test_closed_sphere(target, settings):
    """Diffuse sphere with a hot cap: E / pi = sum f e B / sum f e at every point. The areas are those of the mesh."""
    vertices, triangles = sphere(4)
    hot = vertices[triangles].mean(axis=1)[:, 2] > 0.5
    area = areas(vertices[triangles].astype(np.float32))
    share = area[hot].sum() / area.sum()
    assert share == pytest.approx(0.25, abs=0.01)
    incident = (share * 0.3 * black(400.0) + (1 - share) * 0.9 * black(300.0)) / (share * 0.3 + (1 - share) * 0.9)
    truth = 0.3 * black(400.0) + 0.7 * incident if target > 0 else 0.9 * black(300.0) + 0.1 * incident
    materials = [Material("cap", 0.3), Material("rest", 0.9)]
    camera = look((0, 0, 0), (0, 0, target), tangent=0.3)
    scene = make_scene(vertices, triangles, np.where(hot, 400, 300), materials, camera, NARROW, np.where(hot, 0, 1))
    check(scene, truth, **settings)


@pytest.mark.parametrize("settings", SUBTRACTION)
@pytest.mark.parametrize("cut", [0.98, 0.8])
def test_spherical_cavity(cut, settings):
    """Sphere with its cap removed under a 0 K sky: effective emissivity e / (e + (1 - e) f), f the cap's share."""
    vertices, triangles = sphere(4)
    area = areas(vertices[triangles].astype(np.float32))
    keep = vertices[triangles].mean(axis=1)[:, 2] < cut
    share = area[~keep].sum() / area.sum()
    truth = 0.5 / (0.5 + 0.5 * share) * black(300.0)
    camera = look((0, 0, 0.5), (0, 0, -1))
    check(make_scene(vertices, triangles[keep], 300.0, [Material("wall", 0.5)], camera, NARROW), truth, **settings)
