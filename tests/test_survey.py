# SPDX-License-Identifier: GPL-3.0-or-later
"""What the survey tells before the first pass, of all that the camera sees, in mirrors too."""

import dataclasses
import math

import numpy as np
import pytest

from addon.solver import Camera, Material, Medium, Settings
from addon.solver.physics.spectrum import band_radiance
from addon.solver.planning import preparation
from addon.solver.planning import survey as survey_module
from addon.solver.planning.antialiasing import FEWEST, UNKNOWN
from addon.solver.planning.preparation import prepare
from addon.solver.planning.survey import Cells, survey_pixels
from tests.helpers.scenes import join, look, make_scene, quad, sphere

EDGES = np.linspace(8.0, 12.0, 3)
SIZE = 32  # pixels on each side
REFLECTANCE = 0.8
GREY, MIRROR = Material("grey", 0.5), Material("mirror", 1.0 - REFLECTANCE, specular=1.0)
DENSITY, COUNT, CONTRIBUTION2 = map(Cells._fields.index, ("density", "count", "contribution2"))


def floor():
    """Grey, and a warm plate to the side above it: vertices, triangles, K, material."""
    return [(*quad((0, 0, 0), (20, 0, 0), (0, 20, 0)), 300.0, 0), (*quad((12, 0, 9), (0, 2, 0), (2, 0, 0)), 320.0, 0)]


def cells_of(parts, camera):
    """The columns of Cells, of those on the front of the first part alone."""
    *mesh, material = join(*parts)
    scene = make_scene(*mesh, [GREY, MIRROR], camera, EDGES, material, world_temperature=250.0)
    model = prepare(scene, Settings(photons_per_pass=20_000))
    cells, sheets = model.splitting.cells, model.splitting.sheets.density.size
    seen = cells.key % sheets == model.stage.surfaces.sheet[0, 0]
    return [value[seen] for value in cells]


def shown_area(cells):
    """m2 of all pixels together: each shows one gather's share."""
    return np.sum(cells[COUNT] / cells[DENSITY])


def above(z):
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


@pytest.mark.parametrize(
    "kind, frame, area",
    [
        ("PERSPECTIVE", (-1.5, 1.5, -1.0, 1.0), 6.0 * 4.0**2),
        ("PERSPECTIVE", (0.5, 1.5, 0.0, 2.0), 2.0 * 4.0**2),
        ("ORTHOGRAPHIC", (-3.0, 1.0, -2.0, 2.0), 16.0),
    ],
)
def test_pixels_cover_the_area_that_the_camera_sees(kind, frame, area):
    """Of a floor 4 m below: a pixel covers as much of it anywhere. To float32's rounding of rays."""
    found = shown_area(cells_of(floor(), Camera(SIZE, SIZE, above(4.0), kind, frame)))
    assert found == pytest.approx(area, rel=1e-4)


@pytest.mark.parametrize("top, least", [(1.1, 0.97), (math.pi / 2, 0.45)])
def test_pixels_of_a_panorama_cover_less_near_the_poles(top, least):
    """From within a sphere: the area between two parallels, to what its 1280 flat triangles, whose cosines lie within
    1 % of 1, and the rows of pixels leave open. At a pole it is less, as densities are averaged, not areas: rows at i =
    1 .. n from it have the harmonic mean of i, n / (ln n + 0.58), for (n + 1) / 2, at worst: 0.48 of it for 32."""
    vertices, triangles = sphere(3, 2.0)
    camera = Camera(SIZE, SIZE, np.eye(4), "PANORAMA", frame=(0.0, 1.0, top - 0.1, top))
    found = shown_area(cells_of([(vertices, triangles[:, ::-1], 300.0, 0)], camera))
    truth = (math.sin(top) - math.sin(top - 0.1)) * 2.0**2
    print(f"{found / truth:.3f}")
    assert least < found / truth < 1.03


PANES = {
    "one": ([quad((0, 0, 5), (0, 3, 0), (3, 0, 0))], (0, 0, 3), (0, 0, 5), 7.0),  # looks up into it: 2 m and 5 m
    "two": (  # to the right, by one to the left, by the other down: 6 m, 5 m and 6 m
        [quad((0, 0, 6), (0, 0, 3), (2, 2, 0)), quad((0, 5, 6), (0, 5, -5), (5, 0, 0))], (-6, 0, 6), (0, 0, 6), 17.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("panes, position, target, way", PANES.values(), ids=PANES)
def test_mirrors_show_what_their_images_would(panes, position, target, way):
    """A camera that sees the floor by way of mirrors counts the same gathers on as much of it as one straight above,
    as far away as the way is long, each contributing the mirrors' share less. To float32's rounding of rays."""
    straight = cells_of(floor(), look((0, 0, way), (0, 0, 0), SIZE, SIZE, 0.2))
    mirrors = [(*pane, 300.0, 1) for pane in panes]
    reflected = cells_of([*floor(), *mirrors], look(position, target, SIZE, SIZE, 0.2))
    assert shown_area(reflected) == pytest.approx(shown_area(straight), rel=1e-4)
    assert np.sum(reflected[COUNT]) == np.sum(straight[COUNT]) == SIZE * SIZE
    share = np.average(reflected[CONTRIBUTION2], weights=reflected[COUNT]) ** 0.5
    assert share == pytest.approx(0.5 * REFLECTANCE ** len(panes), rel=1e-4)


def test_what_samples_do_not_follow_is_told():
    """Pixels of a surface that hardly reflects send more rays, as nobody knows what it shows; those of a mirror that
    shows a plain floor as many as that takes."""
    panes = [(*quad((x, 0, 5), (0, 3, 0), (1, 0, 0)), 300.0, material) for x, material in ((-1.0, 1), (1.0, 2))]
    *mesh, material = join(*floor(), *panes)
    materials = [GREY, MIRROR, Material("faint", 0.99, specular=1.0)]
    camera = look((0, 0, 3), (0, 0, 5), SIZE, SIZE, 0.2)
    samples = prepare(make_scene(*mesh, materials, camera, EDGES, material), Settings()).samples.reshape(SIZE, SIZE)
    assert np.all(samples[:, :10] >= UNKNOWN) and np.all(samples[:, -10:] == FEWEST)  # who looks up sees +x at the left


def test_rough_lobes_send_as_many_rays_as_what_they_show_differs():
    """A rough pane that shows a small hot plate in a cold sky needs many rays where it is near the plate's image, and
    fewer far away. Of a lobe samples do not tell all, so those are 16."""
    pane, plate = (
        (*quad((0, 0, 0), (3, 0, 0), (0, 3, 0)), 300.0, 1),
        (*quad((-2, 0, 1), (0, 0.2, 0), (0.2, 0, 0)), 600.0, 0),
    )
    *mesh, material = join(pane, plate)
    materials = [Material("black", 1.0), Material("rough", 0.2, specular=1.0, roughness=0.4)]
    camera = Camera(SIZE, SIZE, above(4.0), "ORTHOGRAPHIC", frame=(-3, 3, -3, 3))
    scene = make_scene(*mesh, materials, camera, EDGES, material, world_temperature=250.0)
    samples = prepare(scene, Settings()).samples.reshape(SIZE, SIZE)
    beside = samples[12:20, 8:11]  # 0.5 m from the plate, in x
    far = samples[:, -6:]
    print(f"{beside.mean():.0f} rays near it, {far.mean():.1f} far off")
    assert beside.mean() > 4 * far.mean() and np.all(far >= UNKNOWN)


def survey_of(scene, settings, monkeypatch):
    """The Survey that prepare makes of a scene."""
    kept = []
    monkeypatch.setattr(preparation, "survey_pixels", lambda *args: kept.append(survey(*args)) or kept[0])
    survey = survey_pixels
    prepare(scene, settings)
    return kept[0]


def test_what_clear_gas_dims_varies_less(monkeypatch):
    """An edge seen through a clear gas of optical depth 1: its variance is exp(-2) of that in a vacuum, to float32's
    rounding of the radiance of lens samples; the gas itself adds the same everywhere."""
    pane = quad((0.3, 0.1, 0), (1, 0.2, 0), (-0.2, 1, 0))
    camera = Camera(SIZE, SIZE, above(4.0), "ORTHOGRAPHIC", frame=(-2, 2, -2, 2))
    scene = make_scene(*pane, 400.0, [Material("black", 1.0)], camera, EDGES, world_temperature=250.0)
    gas = Medium("gas", 0.25, 320.0)  # 4 m to the pane; and to what is behind it
    settings = Settings(reference_subtraction=False)
    monkeypatch.setattr(survey_module, "_AROUND", 0.0)  # each pixel's own variance
    clear = survey_of(scene, settings, monkeypatch)
    dimmed = survey_of(dataclasses.replace(scene, media=(gas,), world_depth=4.0), settings, monkeypatch)
    edge = clear.variance > 0.1 * clear.variance.max()
    assert edge.sum() > 20
    ratio = (dimmed.variance / dimmed.sensitivity**2)[edge] / (clear.variance / clear.sensitivity**2)[edge]
    np.testing.assert_allclose(ratio, math.exp(-2.0), rtol=1e-3)


def test_fog_shows_what_is_around_it(monkeypatch):
    """Fog that only scatters is as bright as the even surroundings, on whichever way light comes: what varies is
    roulette alone, which ends 1 of 4096 walks at each scattering, and what is left after 8 of them. Of fog the samples
    do not tell all, and no pixel sends fewer rays than that takes."""
    plate = quad((0, 0, 9), (0.1, 0, 0), (0, 0.1, 0))  # behind the camera
    camera = Camera(SIZE, SIZE, above(4.0), "ORTHOGRAPHIC", frame=(-2, 2, -2, 2))
    scene = make_scene(*plate, 300.0, [Material("black", 1.0)], camera, EDGES, world_temperature=300.0)
    vertices, triangles = sphere(2, 1.0)
    fog = Medium("fog", 0.0, 0.0, 0.5, vertices=vertices, triangles=triangles)
    settings = Settings(reference_subtraction=False)
    survey = survey_of(dataclasses.replace(scene, media=(fog,)), settings, monkeypatch)
    radiance = band_radiance(EDGES, 300.0).sum()
    relative = np.sqrt(survey.variance / survey.sensitivity**2) / radiance
    assert np.median(relative) < 1e-6 and np.sqrt(np.mean(relative**2)) < 2.0 * np.sqrt(1.0 / 4096.0)
    x, y = np.meshgrid(*2 * [(np.arange(SIZE) + 0.5) / SIZE * 4.0 - 2.0])
    unknown, inside = survey.unknown.reshape(SIZE, SIZE), np.hypot(x, y)
    assert unknown[inside < 0.8].mean() > 0.99 and not unknown[inside > 1.1].any()  # exp(-16 * .6) see no scattering
