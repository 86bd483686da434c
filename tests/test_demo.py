# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo: its file keeps to the contract, its script renders it, and the caustic is where geometry puts it."""

import re
import subprocess
import sys

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
Image = pytest.importorskip("PIL.Image")
OpenEXR = pytest.importorskip("OpenEXR")

from addon.output.colour_bar import ColourBar  # noqa: E402
from addon.output.exr import channel_name  # noqa: E402
from addon.output.heat_picture import LEAST_HEIGHT  # noqa: E402
from addon.output.palette import display  # noqa: E402
from addon.output.temperature_scale import KELVIN, TemperatureScale  # noqa: E402
from addon.solver.physics.spectrum import apparent_temperature, band_names  # noqa: E402
from docs.tools import make_demo  # noqa: E402
from docs.tools.paths import DEMO, ROOT  # noqa: E402
from tests.helpers.blender import describe  # noqa: E402

WIDTH, HEIGHT, PASSES, PHOTONS = 160, 120, 40, 100_000
EDGES = np.linspace(7.5, 13.5, 16)  # um, of the demo's bands


@pytest.fixture
def demo():
    """The demo's scene, opened."""
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    return bpy.context.scene


# demo.blend


def test_the_file_keeps_to_the_contract(demo):
    ring, plane, heater = (bpy.data.objects[name] for name in ("Ring", "Plane", "Heater"))
    assert demo.render.engine == "INFRARED_PHOTONS" and demo.camera.type == "CAMERA"
    assert demo.world["temperature"] == 250 and plane["temperature"] == 293 and ring["temperature"] == 340
    metal, slate = ring.data.materials[0], plane.data.materials[0]
    assert metal["specular"] == 1 and metal["roughness"] == 0 and slate["specular"] == 0
    emissivity = np.array(metal["emissivity"].to_list()).reshape(-1, 2)
    assert np.all(np.diff(emissivity[:, 0]) > 0) and np.all((emissivity[:, 1] > 0) & (emissivity[:, 1] < 1))
    assert heater.data.type == "POINT" and heater.data.energy > 0 and heater["temperature"] == 1000


def test_the_file_is_what_its_script_makes(demo):
    stored = describe(demo)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    make_demo.build()
    bpy.context.view_layer.update()
    assert describe(bpy.context.scene) == stored


# render.py


def run_script(*options, timeout):
    """The process of `python run.py demo` with these options, when it has ended."""
    command = [sys.executable, "-m", "docs.demo.render", *map(str, options)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=timeout)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Folder with the demo rendered small by its script, and the last line the script printed."""
    folder = tmp_path_factory.mktemp("demo") / "new" / "folder"
    options = ["--passes", PASSES, "--photons", PHOTONS, "--resolution", f"{WIDTH}x{HEIGHT}", "--output", folder]
    run = run_script(*options, timeout=600)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder, run.stdout.strip().splitlines()[-1]


@pytest.fixture(scope="module")
def images(rendered):
    """The band EXR's images by pass name, row 0 at the bottom."""
    with OpenEXR.File(str(rendered[0] / "demo-bands.exr")) as file:
        channels = file.channels()
        names = [*band_names(EDGES), "Radiance", "Temperature", "Noise"]
        assert set(channels) == {channel_name(name) for name in names}
        return {name: channels[channel_name(name)].pixels[::-1].copy() for name in names}


def test_the_line_of_figures_tells_what_was_done(rendered, images):
    number = r"([\d.,]+)"
    line = re.fullmatch(
        rf"{number} passes, {number} photons, {number} s, {number} MB at most \(with Blender\), "
        rf"noise {number} K \(median\), {number} K \(95 % of the pixels are below\)",
        rendered[1],
    )
    passes, photons, seconds, memory, median, most = (float(group.replace(",", "")) for group in line.groups())
    assert (passes, photons) == (PASSES, PASSES * PHOTONS)
    assert seconds > 0 and 100 < memory < 4000
    assert [median, most] == pytest.approx(np.percentile(images["Noise"], [50, 95]), abs=6e-4)  # three decimals


def test_blenders_own_file_holds_the_same_images(rendered, images):
    with OpenEXR.File(str(rendered[0] / "demo.exr"), separate_channels=True) as file:
        channels = {name: c.pixels[::-1] for part in file.parts for name, c in part.channels.items()}
        for name, image in images.items():
            (match,) = [key for key in channels if key.startswith(f"ViewLayer.{name}.")]
            np.testing.assert_array_equal(channels[match], image, err_msg=name)


def test_the_images_belong_together(images):
    widths = np.diff(EDGES)
    radiance = sum(
        images[name].astype(np.float64) * width for name, width in zip(band_names(EDGES), widths, strict=True)
    )
    np.testing.assert_allclose(images["Radiance"], radiance, rtol=1e-5)  # float32 sums of 15 bands
    np.testing.assert_allclose(images["Temperature"], apparent_temperature(radiance, EDGES), rtol=1e-5)


def test_the_picture_shows_the_temperatures_and_their_bar(rendered, images):
    picture = np.asarray(Image.open(rendered[0] / "demo.png"))
    scale = TemperatureScale().fitted(images["Temperature"])
    bar = ColourBar(scale, KELVIN, WIDTH, 0, LEAST_HEIGHT)
    assert picture.shape == (LEAST_HEIGHT, WIDTH + bar.panel_width(bar.text), 3)
    np.testing.assert_array_equal(picture[:HEIGHT, :WIDTH], display(scale.colours(images["Temperature"]))[::-1])
    left, bottom, width, height = bar.bar
    drawn = picture[::-1][bottom : bottom + height, left + width // 2]
    np.testing.assert_array_equal(drawn, display(bar.colours()))


def at(scene, image, points):
    """Values of an image at the pixels that see points (n, 3) of the world."""
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    seen = np.array([world_to_camera_view(scene, scene.camera, Vector(point)) for point in points])
    column, row = (seen[:, 0] * WIDTH).astype(int), (seen[:, 1] * HEIGHT).astype(int)
    return image[row, column]


def test_the_caustic_is_where_geometry_puts_it(demo, images):
    """In plan the light stands on the ring's circle of radius R, so the caustic is a cardioid (the wall is vertical, so
    mirrored rays look in plan like the mirror problem in two dimensions): with the light on the x axis
    (R/3) (2 cos t + cos 2t, 2 sin t + sin 2t).
    """
    demo.render.resolution_x, demo.render.resolution_y = WIDTH, HEIGHT
    bpy.context.view_layer.update()
    x, y, _ = bpy.data.objects["Heater"].location
    radius = np.hypot(x, y)
    t = np.radians([*range(100, 145, 5), *range(220, 265, 5)])[:, None]  # the two branches that the ring does not hide
    curve = (np.exp(1j * t) * 2 + np.exp(2j * t)) / 3  # as complex numbers, in units of R
    outwards = np.exp(1.5j * t)  # the normal: the tangent is i (exp(it) + exp(2it)), in the direction of i exp(1.5it)
    offset = np.linspace(-0.2, 0.2, 41)
    plan = (curve + offset * outwards).ravel() * complex(x, y)
    points = np.stack((plan.real, plan.imag, np.zeros(plan.size)), axis=1)
    temperature, noise = (at(demo, images[name], points).reshape(t.size, -1) for name in ("Temperature", "Noise"))
    # The disk that gathers 20 of the photons in the ring (a tenth of all) blurs the first pass; a pixel adds its size.
    blur = np.sqrt(20 / (0.1 * PHOTONS)) + 0.6 / WIDTH / radius
    brightest = offset[np.argmax(temperature, axis=1)]
    assert np.abs(brightest).max() < blur, brightest
    # Beside the curve the plane sees the light just as well: what it lacks there is the caustic.
    on = offset.size // 2
    for beside in (0, -1):
        excess = temperature[:, on] - temperature[:, beside]
        assert np.all(excess > 5 * np.hypot(noise[:, on], noise[:, beside])), excess


@pytest.mark.once
def test_bad_options_are_told_without_a_traceback(tmp_path):
    (tmp_path / "file").write_text("in the way")
    for options, message in (
        (["--passes", "0"], "0 is not above 0"),
        (["--resolution", "320"], "'320' is not a width and a height"),
        (["--output", str(tmp_path / "file" / "folder")], "Not a directory"),
    ):
        run = run_script(*options, timeout=120)
        assert run.returncode != 0 and message in run.stderr and "Traceback" not in run.stderr
