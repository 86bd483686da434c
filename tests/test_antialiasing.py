# SPDX-License-Identifier: GPL-3.0-or-later
"""How many rays a pixel sends, and what that does to the image."""

from dataclasses import replace

import numpy as np
import pytest

from addon.solver import Camera, Material, Settings, render
from addon.solver.planning import antialiasing
from addon.solver.planning.antialiasing import FEWEST
from addon.solver.planning.preparation import prepare
from tests.helpers.scenes import box, join, look, make_scene, quad

EDGES = np.linspace(8.0, 12.0, 3)
SIZE = 32  # pixels on each side


def plate(angle=0.3, half=(7.3, 5.1), kelvin=320.0, ground=300.0):
    """A black rectangle, turned in the image, over black ground; one metre is a pixel."""
    c, s = np.cos(angle), np.sin(angle)
    parts = (
        (*quad((16.2, 15.7, 1.0), (half[0] * c, half[0] * s, 0), (-half[1] * s, half[1] * c, 0)), kelvin, 0),
        (*quad((16, 16, 0), (100, 0, 0), (0, 100, 0)), ground, 0),
    )
    vertices, triangles, temperature, material = join(*parts)
    above = np.eye(4)
    above[:3, 3] = 0, 0, 10
    camera = Camera(SIZE, SIZE, above, "ORTHOGRAPHIC", frame=(0, SIZE, 0, SIZE))
    return make_scene(vertices, triangles, temperature, [Material("black", 1.0)], camera, EDGES, material)


def distance_to_edge(angle=0.3, half=(7.3, 5.1)):
    """Of the centres of pixels (SIZE, SIZE), from the rim of the plate; negative within."""
    x, y = np.meshgrid(np.arange(SIZE) + 0.5 - 16.2, np.arange(SIZE) + 0.5 - 15.7)
    c, s = np.cos(angle), np.sin(angle)
    along, across = np.abs(c * x + s * y) - half[0], np.abs(c * y - s * x) - half[1]
    outside = np.hypot(np.maximum(along, 0), np.maximum(across, 0))
    return outside + np.minimum(np.maximum(along, across), 0)


def samples_of(scene):
    return prepare(scene, Settings()).samples.reshape(SIZE, SIZE)


def test_edges_send_most_rays_and_plain_surfaces_fewest():
    samples, distance = samples_of(plate()), np.abs(distance_to_edge())
    assert np.all(samples[distance < 0.2] == samples.max()) and samples.max() >= 128  # the edge passes near the centre
    assert np.all(samples[distance > 2.5] == FEWEST)  # not even the pixels around hold it


def test_what_differs_in_emission_alone_is_an_edge():
    """One temperature, but paint on metal."""
    materials = (Material("paint", 0.95), Material("metal", 0.1))
    scene = replace(plate(kelvin=300.0), materials=materials, material=np.array([0, 0, 1, 1], np.int32))
    samples = samples_of(scene)
    assert np.all(samples[np.abs(distance_to_edge()) < 0.3] > FEWEST)


def test_a_wire_thinner_than_a_pixel_is_found():
    """A tenth of a pixel wide: few of sixteen samples in a pixel meet it, those in the pixels around help."""
    samples = samples_of(plate(angle=0.3, half=(12.0, 0.05), kelvin=900.0))
    on = np.abs(distance_to_edge(0.3, (11.0, 0.05))) < 0.2
    found = np.mean(samples[on] >= 128)
    print(f"{found:.2f} of {on.sum()} pixels")
    # the pixel and the two next along the wire have 48 samples, each meets it with a chance of a tenth
    assert found > 1 - 0.9**48 - 3 * (0.9**48 / on.sum()) ** 0.5


def test_equal_surfaces_are_one():
    """No edges where everything emits alike, whatever its shape."""
    assert np.all(samples_of(plate(kelvin=300.0)) == FEWEST)


@pytest.mark.parametrize("half", [(7.3, 5.1), (12.0, 0.05)])
def test_covered_area_is_exact(half):
    """The mean over the image is that of the areas, to the standard error over seeds."""
    scene = plate(half=half, kelvin=320.0)
    means = [render(scene, Settings(passes=2, seed=seed)).radiance().mean(dtype=float) for seed in range(16)]
    hot, cold = (plate(kelvin=kelvin, ground=kelvin) for kelvin in (320.0, 300.0))
    hot, cold = (render(scene, Settings(passes=1)).radiance().mean(dtype=float) for scene in (hot, cold))
    covered = 4 * half[0] * half[1] / SIZE**2
    error = np.std(means, ddof=1) / np.sqrt(len(means))
    assert abs(np.mean(means) - (covered * hot + (1 - covered) * cold)) < 3 * error + 1e-6 * hot  # float32


def test_rays_at_edges_beat_as_many_everywhere(monkeypatch):
    """Root mean square error of the image against as many rays in all, or up to twice as many, spread evenly."""
    scene = plate()
    adaptive = prepare(scene, Settings()).samples
    truth = render(scene, Settings(passes=64)).temperature()
    error = [np.sqrt(np.mean((render(scene, Settings(passes=1)).temperature() - truth) ** 2, dtype=float))]
    even = int(2 ** np.ceil(np.log2(adaptive.mean())))
    monkeypatch.setattr(antialiasing, "FEWEST", even)
    monkeypatch.setattr(antialiasing, "MOST", even)
    error.append(np.sqrt(np.mean((render(scene, Settings(passes=1)).temperature() - truth) ** 2, dtype=float)))
    print(f"{adaptive.mean():.1f} rays {error[0]:.4f} K, {even} everywhere {error[1]:.4f} K")
    assert error[0] < 0.5 * error[1]  # 0.35 for 4 times as many rays at edges, as their error falls with n^-3/4


def test_edges_in_a_mirror_are_as_smooth():
    """The plate seen in a mirror, by a camera that looks away from it, against the same view straight. Root mean square
    errors of the edges after one pass, of six seeds: some 60 pixels each, so each is known to 4 %, and their ratio to
    3 standard errors of 5 %. Were rays of a pixel that sends many weak, roulette would end them in the mirror.
    """
    straight = plate()
    pane = quad((16, 16, 20), (0, 40, 0), (40, 0, 0))
    parts = ((straight.vertices, straight.triangles, 0.0, 0), (*pane, 300.0, 1))
    *mesh, temperature, material = join(*parts)
    temperature[:4] = straight.temperature
    up = np.diag([1.0, -1.0, -1.0, 1.0])
    up[1, 3], up[2, 3] = SIZE, 10
    camera = replace(straight.camera, matrix=up)
    materials = [straight.materials[0], Material("mirror", 0.02, specular=1.0)]
    mirrored = make_scene(*mesh, temperature, materials, camera, EDGES, material)

    def error(scene):
        truth = render(scene, Settings(passes=64, seed=100)).radiance()
        images = [render(scene, Settings(passes=1, seed=seed)).radiance() for seed in range(6)]
        return np.sqrt(np.mean((np.array(images) - truth) ** 2, dtype=float))

    ratio = error(mirrored) / (0.98 * error(straight))
    print(f"error in the mirror over straight {ratio:.2f}")
    assert abs(ratio - 1.0) < 3 * 0.05


def test_seed_and_pass_have_no_part_in_it():
    """So passes rendered elsewhere belong to the same image."""
    vertices, triangles = box((2.0, 2.0, 1.5))
    temperature = np.repeat([290.0, 300.0, 280.0, 290.0, 310.0, 290.0], 2)
    camera = look((0.2, 0.2, 1.3), (1.3, 1.3, 0.2), 12, 9, 0.7)
    scene = make_scene(vertices, triangles, temperature, [Material("grey", 0.5)], camera, EDGES)
    first, other = (prepare(scene, settings).samples for settings in (Settings(), Settings(seed=7, pass_offset=3)))
    assert np.array_equal(first, other)
    assert len(np.unique(first)) > 1
