# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's way through a real Blender: install the zip, render the demo from the command line, read it back."""

import csv
import json
import re
import shutil
import subprocess
import sys
import time
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from scipy.constants import c, h, k

import run
from addon.output.group_exr import write_group_exr
from addon.solver.image.recombine import LayeredImage
from addon.solver.physics import library
from addon.solver.physics.layers import Layer
from docs.tools.paths import DEMO, ROOT
from tests.helpers import tiles
from tests.helpers.real_blender import LAUNCHER, WORK, blender, facts, module, needs_real_blender

SMALL_WINDOW = "--window-geometry", 0, 100, 900, 800  # in the upper left corner of a screen of 1600 x 900

pytestmark = needs_real_blender


def report(*arguments) -> dict:
    """What the real Blender says about itself, the extension and the scene it has open; see report.py."""
    lines = blender(*arguments, *module("report")).splitlines()
    return json.loads(next(line for line in lines if line.startswith("REPORT "))[7:])


def render(output: Path) -> tuple[dict[str, np.ndarray], float]:
    """Render the demo small from the command line; returns its passes and the seconds it took."""
    start = time.monotonic()
    options = ("-E", "INFRARED_PHOTONS", "-F", "OPEN_EXR_MULTILAYER", "-o", f"{output}_####", "-f", "1")
    text = blender(DEMO, *module("small", before=options))
    seconds = time.monotonic() - start
    assert "ERROR" not in text, text
    return read_passes(output.with_name(f"{output.name}_0001.exr")), seconds


def read_passes(path: Path) -> dict[str, np.ndarray]:
    """The passes of a multilayer EXR as float32 images by name, (height, width) or (height, width, 4)."""
    passes = {}
    for part in OpenEXR.File(str(path)).parts:
        for channel in part.channels.values():
            assert channel.pixels.dtype == np.float32
            layer, name = re.fullmatch(r"(\w+)\.(.+?)(\.[A-Z])?", channel.name).groups()[:2]
            assert layer == "ViewLayer"
            passes[name] = channel.pixels
    return passes


@pytest.fixture(scope="module")
def installed():
    """The extension, built for the real Blender's Python, in an empty user folder; returns the zip."""
    subprocess.run([LAUNCHER, "setup"], cwd=ROOT, check=True, stdin=subprocess.DEVNULL)
    shutil.rmtree(WORK, ignore_errors=True)
    (WORK / "home").mkdir(parents=True)
    its_own = report("--factory-startup")["python"]
    # A zip for another Python is made, too, to see that Blender takes the fitting one.
    pythons = dict.fromkeys([run.supported_pythons()[-1], its_own])
    run.package(Path(sys.executable), pythons, ["linux-x64"], WORK / "dist")  # by this Python: it has all that it takes
    run.package_template(WORK / "dist" / "template")
    archive = WORK / "dist" / run.archive_name("linux-x64", its_own)
    text = blender(
        "--command", "extension", "install-file", "-r", "user_default", "--enable", archive, check_scripts=False
    )
    assert 'Installed "infrared_photons"' in text
    return archive


@pytest.fixture(scope="module")
def first(installed):
    """Passes and seconds of the first render after installing, which compiles the kernels that it needs."""
    rendered = render(WORK / "first")
    blender(*module("settle"))
    return rendered


@pytest.fixture(scope="module")
def passes(first):
    return first[0]


@pytest.fixture(scope="module")
def scene(installed):
    return report(DEMO)


def test_zip_is_valid(installed):
    assert "Success" in blender("--command", "extension", "validate", installed, check_scripts=False)


def test_zip_holds_only_the_addon(installed):
    with zipfile.ZipFile(installed) as content:
        names = set(content.namelist())
    sources = {path.relative_to(ROOT / "addon").as_posix() for path in (ROOT / "addon").rglob("*.py")}
    assert sources | {"LICENSE", "blender_manifest.toml"} <= names
    assert not [name for name in names if "__pycache__" in name or "test" in name]


def test_extension_registers_and_brings_its_libraries(installed, scene):
    assert "INFRARED_PHOTONS" in scene["engines"]
    for name in ("numba", "llvmlite", "embreex", "OpenEXR"):
        assert Path(scene["libraries"][name]).is_relative_to(WORK / "user")
    assert not Path(scene["libraries"]["numpy"]).is_relative_to(WORK / "user")


def test_every_band_is_there(passes, scene):
    edges = band_edges(scene)
    names = [f"{low:.2f}-{high:.2f}um" for low, high in zip(edges, edges[1:], strict=False)]
    assert set(passes) == {*names, "Combined", "Radiance", "Temperature", "Noise"}
    assert all(np.isfinite(image).all() for image in passes.values())
    assert all(image.shape[:2] == (48, 64) for image in passes.values())


def test_temperatures_lie_between_the_coldest_and_the_hottest_thing(passes, scene):
    """Bodies emit at most what a blackbody of the hottest one does, and at least nothing."""
    temperature = passes["Temperature"]
    assert temperature.min() >= 0
    assert temperature.max() <= max(scene["temperatures"])
    assert np.ptp(temperature) > 1  # K: there is something to see
    assert (passes["Noise"] >= 0).all()
    assert passes["Noise"].max() > 0


def test_radiance_is_the_sum_of_the_bands(passes, scene):
    edges = band_edges(scene)
    widths = np.diff(edges)
    bands = [passes[f"{low:.2f}-{high:.2f}um"] for low, high in zip(edges, edges[1:], strict=False)]
    total = sum(band.astype(float) * width for band, width in zip(bands, widths, strict=True))
    # Every image is rounded to float32, 6e-8 of its value; the bands add up to about the same.
    np.testing.assert_allclose(passes["Radiance"], total, rtol=1e-5, atol=1e-6 * total.max())


def test_temperature_is_that_of_a_blackbody_of_the_same_radiance(passes, scene):
    """Planck's law, integrated here by the midpoint rule, whose error at 20,000 steps is below 1e-8."""
    edges = band_edges(scene)
    radiance, temperature = passes["Radiance"].ravel(), passes["Temperature"].ravel().astype(float)
    chosen = np.linspace(0, radiance.size - 1, 50).astype(int)
    step = (edges[-1] - edges[0]) / 20_000
    wavelength = (edges[0] + step * (np.arange(20_000) + 0.5)) * 1e-6  # m
    for pixel in chosen[temperature[chosen] > 0]:
        spectral = 2 * h * c**2 / wavelength**5 / np.expm1(h * c / (wavelength * k * temperature[pixel]))
        # A temperature rounded to float32 moves the radiance by d ln L / d ln T, at most 30 here, times 6e-8.
        assert np.sum(spectral) * step * 1e-6 == pytest.approx(radiance[pixel], rel=1e-5)


def test_a_command_recombines_temperature_groups(installed):
    """Two layers of known radiance, from Blender's command line without a file."""
    layers = Layer(), Layer("motor", temperature=300.0, traced=310.0)
    edges, excess = np.array([8.0, 10.0, 14.0]), np.random.default_rng(0).random((2, 2, 6, 8), np.float32)
    image = LayeredImage(excess, layers, edges, 295.0, np.ones(2))
    facts = {"referenceTemperature": 295.0, "bandWeights": "1.0 1.0", "assumedEmissivity": 1.0}
    write_group_exr(WORK / "groups.exr", image, facts | {"reflectedTemperature": 293.0})
    (WORK / "series.csv").write_text("frame,motor\n3,320\n4,350\n")
    command = ("--command", "infrared_recombine", WORK / "groups.exr", WORK / "series_##")
    text = blender(*command, "--series", WORK / "series.csv", "--pictures", check_scripts=False)
    assert "2 images written" in text
    for frame, kelvin in ((3, 320.0), (4, 350.0)):
        channels = OpenEXR.File(str(WORK / f"series_{frame:02d}.exr"), separate_channels=True).channels()
        shown = [channels[f"{name}um.V"].pixels[::-1] for name in ("8,00-10,00", "10,00-14,00")]
        np.testing.assert_allclose(shown, image.recombined({"motor": kelvin}), rtol=1e-6)
        assert (WORK / f"series_{frame:02d}.png").stat().st_size > 100


def test_rendering_again_gives_the_same_bits_without_compiling(first, capsys):
    passes, seconds = first
    again, seconds_again = render(WORK / "second")
    with capsys.disabled():
        print(f" [first render {seconds:.1f} s with compiling, second {seconds_again:.1f} s]", end=" ")
    assert all(np.array_equal(passes[name], again[name]) for name in passes)
    assert seconds_again < seconds


def test_compiled_kernels_are_kept_in_the_extensions_own_folder(first):
    user = WORK / "user" / "extensions"
    kernels = list(WORK.rglob("*.nbc"))
    assert kernels
    assert all(path.is_relative_to(user / ".user" / "user_default" / "infrared_photons") for path in kernels)


def test_bpy_renders_the_same_image(passes):
    """The add-on from the source, in another Blender and Python, with the same seed.

    Photons go the same ways; the tolerance is for two versions of numpy that round differently in the last bits.
    """
    output = WORK / "bpy.exr"
    command = [sys.executable, "-m", "tests.real_blender.render_with_bpy", DEMO, output]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout + done.stderr
    other = read_passes(output)
    assert set(other) == set(passes)
    for name, image in passes.items():
        np.testing.assert_allclose(other[name], image, rtol=1e-4, err_msg=name)


@pytest.mark.long
def test_renders_disturbed_at_any_moment_end(first):
    """Esc, undo, another file, a second F12 and a scene emptied, in a window, at random moments of a render: Blender
    neither crashes nor hangs, no traceback is printed, and the solver's thread ends."""
    text = blender(DEMO, *module("interrupt"), window=True)
    assert "ALL DISTURBED" in text, text
    running = [int(count) for count in re.findall(r"DISTURBED \w+ (\d+)", text)]
    assert len(running) == 12 and sum(running) > 6, text  # most were disturbed while the solver was at work


def test_viewport_follows_an_artist_at_work(first, capsys):
    """Rendered mode in a window: moved views, edits, undo, a second viewport, other engines and files, and quitting.

    Each brings a new picture, on the pixels of Blender's own overlays. Times depend on the machine: they are printed.
    An F12 while the viewport refines gives the image that it gives alone, and so does the viewport.
    """
    text = blender(*SMALL_WINDOW, DEMO, *module("viewport"), window=True)
    steps = re.findall(r"PICTURE (\w+) ([\d.]+) ([\d.]+)", text)
    assert len(steps) == 18, text
    mismatches = [float(pixels) for pixels in re.findall(r"VIEW \w+ ([\d.]+)", text)]
    # Blender's matrices are float32, 6e-8 of places 10 m away, over pixels of at least 0.0005 m: 0.0012 of a pixel
    assert len(mismatches) == 13 and max(mismatches) < 0.01, text
    beside = json.loads(re.search("BESIDE (.*)", text)[1])
    assert beside["running"] == [1, 1]  # the viewport's renders when F12 began and when it had ended
    assert beside["later"] > 0 and beside["said"] == "Pass 2/2"  # the viewport went on, and came to its end
    assert beside["same"] == [True, True], beside
    assert "THREADS ENDED" in text and "QUIT WITH" in text, text
    with capsys.disabled():
        times = [float(seconds) for _, seconds, _ in steps[1:]]
        calls = [float(seconds) for _, _, seconds in steps[1:]]
        print(f" [first picture after {np.median(times):.2f} s, at most {max(times):.2f} s;", end=" ")
        print(f"Blender's thread held for {np.median(calls):.3f} s, at most {max(calls):.3f} s]", end=" ")


@pytest.mark.long
def test_spot_meter_and_bar_tell_what_the_screen_shows(first):
    """In the viewport and, at any zoom and offset, in the Image Editor: the pixel that is read is the one that is seen.

    The tiles are black, so that their pictures hold their temperatures, but for float32 and the step of a table.
    """
    found = facts(blender(*SMALL_WINDOW, "--enable-event-simulate", *module("readings"), window=True))
    assert found.get("end")
    assert found["cursor"] and found["meter ended"]
    value, sign, error, unit = found["reading"].split()
    assert (sign, error, unit) == ("±", "0.00", "K") and abs(float(value) - found["truth"]) < 0.005 + 1e-3
    rows, shift = found["bar"]
    assert rows > 300 and shift == 0  # it fits best where it should be: sRGB is drawn a little brighter in the dark
    zooms = [counts for name, counts in found.items() if name.startswith("zoom")]
    assert len(zooms) == 10 and all(read > 1000 and other == 0 for read, other in zooms), found


# From a repository of extensions --------------------------------------------------------------------------------------


@pytest.mark.long  # all kernels are compiled once more, for minutes
def test_blender_takes_its_zip_from_the_repository_compiles_by_itself_and_the_first_picture_is_there_at_once(
    installed, capsys
):
    """And removing the extension while it compiles leaves nothing at work. Times depend on the machine and what else
    it does: they are printed."""
    pictures = WORK / "pictures"
    pictures.mkdir()
    with empty_user_folder(kernels=False):
        command = "--online-mode", "--command", "extension"
        index = (WORK / "dist" / "index.json").as_uri()
        blender(*command, "repo-add", "--url", index, "--name", "Infrared", "infrared", check_scripts=False)
        text = blender(*command, "install", "--sync", "--enable", "infrared_photons", check_scripts=False)
        assert 'Installed "infrared_photons"' in text
        (folder,) = (WORK / "user" / "extensions").glob("*/infrared_photons")
        with zipfile.ZipFile(installed) as content:
            names = {name for name in content.namelist() if name.startswith("wheels/")}
        assert {f"wheels/{path.name}" for path in (folder / "wheels").iterdir()} == names  # those of its own Python
        text = blender(*SMALL_WINDOW, *module("start_up", pictures), window=True)
    found = facts(text)
    assert found.get("end"), text
    assert found["complete"] and found["problem"] == "" and found["processes"] > 0
    assert found["loads"] == []  # Blender itself has loaded nothing large
    assert found["kernels compiled by the render"] == 0
    assert found["processes when removed"] == 0 and found["modules when removed"] == []
    with capsys.disabled():
        print(f" [{found['processes']} processes compiled {found['kernels']} kernels in", end=" ")
        print(f"{found['compiled in']:.0f} s; F12 after a minute of it showed 640 x 480 after", end=" ")
        print(
            f"{found['first picture after']:.1f} s, and compiled {found['kernels compiled by the first picture']}]",
            end=" ",
        )


# Measuring ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench(first):
    """A thermographer's work on a finished picture, by simulated events; returns what the script found out."""
    folder = WORK / "bench"
    folder.mkdir()
    found = facts(blender("--enable-event-simulate", *module("bench", folder), window=True))
    assert found.get("end"), found
    return found


def signal(kelvin):
    """Radiance of blackbodies from 7.5 to 14 um, W m-2 sr-1, by Planck's law in the middles of steps of 3 nm; kelvin:
    any shape."""
    wavelength = np.linspace(7.5, 14.0, 2001)[:-1] + 6.5 / 4000  # um
    x = h * c / (wavelength * 1e-6 * k * np.asarray(kelvin)[..., None])
    return (2e-6 * h * c**2 / (wavelength * 1e-6) ** 5 / np.expm1(x)).mean(axis=-1) * 6.5


def object_temperature(kelvin, emissivity, reflected):
    """What a correction makes of tiles that look like blackbodies at these temperatures, K; by bisection."""
    wanted = (signal(kelvin) - (1.0 - emissivity) * signal(reflected)) / emissivity
    low, high = np.full(len(kelvin), 100.0), np.full(len(kelvin), 1000.0)
    for _ in range(40):  # to 1e-9 K
        middle = 0.5 * (low + high)
        below = signal(middle) < wanted
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return low


@pytest.mark.long
def test_the_colour_bar_is_dragged(bench):
    """By as many kelvin as the way of the mouse is of the bar; the middle moves both ends; undo and a double click."""
    mode, low, high, share = bench["upper end dragged"]
    assert bench["range at first"] == ["FIXED", tiles.LOW, tiles.HIGH]
    assert [mode, low] == ["FIXED", tiles.LOW]
    assert high == pytest.approx(tiles.HIGH + share * (tiles.HIGH - tiles.LOW), abs=1e-3)
    _, lower, same = bench["lower end dragged"]
    assert same == high and lower > tiles.LOW + 1.0
    _, *moved = bench["middle dragged"]
    assert moved[1] - moved[0] == pytest.approx(same - lower, abs=1e-3) and moved[0] < lower - 1.0
    assert bench["undone"] == bench["lower end dragged"]
    assert bench["double click"] == ["AUTOMATIC"]


@pytest.mark.long
def test_tools_are_drawn_where_the_mouse_is_and_read_the_tiles_there(bench):
    """To 1 mK of sums by hand. A press and a release are half a pixel of the screen from where they were meant."""
    kinds = [kind for kind, _ in bench["tools"]]
    assert kinds == ["SPOT", "LINE", "BOX", "ELLIPSE", "POLYGON"]
    assert [bench[f"toolbar {kind}"] for kind in kinds] == [f"infrared.measure_{kind.lower()}" for kind in kinds]
    spot, line, box, ellipse, polygon = bench["readings"]
    assert spot["mean"] == pytest.approx(tiles.kelvin[30, 10], abs=1e-3)  # where bench.py clicks
    assert line["count"] == 36 and polygon["count"] > 80  # from column 5 to 40
    values = tiles.measured("BOX", bench["tools"][2][1])
    assert box["count"] == values.size == 15 * 10 + 10  # corners in the middles of pixels fall to either side
    for name, expected in (("minimum", values.min()), ("maximum", values.max()), ("mean", values.mean())):
        assert box[name] == pytest.approx(expected, abs=1e-3)
    assert box["deviation"] == pytest.approx(values.std(), abs=1e-3)
    assert tiles.kelvin[tuple(ellipse["place_of_maximum"])] == pytest.approx(ellipse["maximum"], abs=1e-3)


@pytest.mark.long
def test_a_tools_emissivity_is_typed_and_moves_its_temperature_alone(bench):
    """To 1 mK of Planck's law by hand."""
    own, emissivity, reflected = bench["own emissivity"]
    assert own and bench["chosen"] == 2 and [emissivity, reflected] == [pytest.approx(0.8), 280.0]
    expected = object_temperature(tiles.measured("BOX", bench["tools"][2][1]), 0.8, 280.0)
    box = bench["readings with it"][2]
    assert box["mean"] == pytest.approx(expected.mean(), abs=1e-3) and box["mean"] > bench["readings"][2]["mean"] + 1.0
    assert box["maximum"] == pytest.approx(expected.max(), abs=1e-3)
    others = [
        [each for index, each in enumerate(bench[name]) if index != 2] for name in ("readings", "readings with it")
    ]
    assert others[0] == others[1]


@pytest.mark.long
def test_tools_are_moved_and_removed(bench):
    (before, after), (moved, kept) = bench["tools"][2][1], bench["moved box"]
    assert kept == after and moved[0] < before[0] and moved[1] < before[1]
    assert bench["box after undo"] == [before, after]
    assert bench["kinds after X"] == ["LINE", "BOX", "ELLIPSE", "POLYGON"]


@pytest.mark.long
def test_the_bench_exports_what_its_tools_read(bench):
    """Picture, table and report, written by mouse; figures by hand to 1 mK. The box has an emissivity of its own."""
    with open(WORK / "bench" / "wall.csv", encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["Kind"].upper() for row in rows] == [kind for kind, _ in bench["tools"]]
    for row, (kind, places) in zip(rows, bench["tools"], strict=True):
        if kind == "LINE":
            continue
        emissivity, reflected = float(row["Emissivity"]), float(row["Reflected Temperature (K)"])
        values = object_temperature(tiles.measured(kind, places), emissivity, reflected)
        assert int(row["Pixels"]) == len(values)
        for title, value in (("Minimum", values.min()), ("Maximum", values.max()), ("Mean", values.mean())):
            assert float(row[f"{title} (K)"]) == pytest.approx(value, abs=1e-3), (kind, title)
        assert float(row["Standard Deviation (K)"]) == pytest.approx(values.std(), abs=1e-3)
    assert (rows[2]["Emissivity"], rows[2]["Reflected Temperature (K)"]) == ("0.8", "280.0000")
    page = (WORK / "bench" / "wall.html").read_text(encoding="utf-8")
    assert all(f"<td>{row['Mean (K)']}</td>" in page for row in rows)
    assert (WORK / "bench" / "wall.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.long
def test_a_browser_shows_the_report(bench):
    """The tiles are in the picture that it draws: far more colours than a page without it has."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("there is no Chromium")
    shot, page = WORK / "bench" / "page.png", WORK / "bench" / "wall.html"
    options = "--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1000,700"
    subprocess.run([browser, *options, f"--screenshot={shot}", page.as_uri()], check=True, capture_output=True)
    pytest.importorskip("bpy")
    from tests.helpers.blender import read_png  # here, as it needs Blender as a module

    colours = np.unique(read_png(shot).reshape(-1, 3), axis=0)
    assert len(colours) > 1000  # 2655 tiles of different temperatures; greys of letters are 256 at most


# By mouse and keyboard ------------------------------------------------------------------------------------------------


@contextmanager
def empty_user_folder(kernels=True):
    """For a while: empty but for the compiled kernels, which belong to this very place and take a minute to compile.

    kernels: False is without them, too.
    """
    kept = Path("extensions", ".user", "user_default", "infrared_photons", "kernels")
    before = (WORK / "user").rename(WORK / "user before")
    try:
        if kernels:
            shutil.copytree(before / kept, WORK / "user" / kept)
        yield
    finally:
        shutil.rmtree(WORK / "user")
        before.rename(WORK / "user")


@pytest.fixture(scope="module")
def hour(first, installed):
    """An artist's first hour at a window, by simulated events; returns what the script found out."""
    results = WORK / "results"
    results.mkdir()
    options = "--factory-startup", "--offline-mode", "--enable-event-simulate"
    begin = time.monotonic()
    with empty_user_folder():
        text = blender(*options, *module("end_to_end", installed, DEMO, results), window=True)
    found = facts(text)
    assert found.get("end"), text
    return found | {"seconds": time.monotonic() - begin}


@pytest.fixture(scope="module")
def exported(hour):
    """The band EXR that the artist exported: header, and images (48, 64) by channel."""
    (part,) = OpenEXR.File(str(WORK / "results" / "bands.exr")).parts
    return part.header, {name: channel.pixels for name, channel in part.channels.items()}


def test_an_artist_comes_through(hour, capsys):
    assert hour["objects"] == ["Camera", "Plane", "Ring"]
    assert hour["temperature"] == 310.5  # typed into the panel
    assert hour["material"] == "Granite"  # found by the library's search
    assert hour["render"][0] == "complete"
    assert hour["passes"] == 1_000_000 and hour["cancelled"][0] == "cancelled"
    with capsys.disabled():
        print(f" [{hour['seconds']:.0f} s; Esc took {hour['cancelled'][1]:.2f} s]", end=" ")


def test_exported_bands_are_those_of_the_picture(exported):
    shown, images = read_passes(WORK / "results" / "shown.exr"), exported[1]
    for name, image in shown.items():
        if name != "Combined":
            np.testing.assert_array_equal(images[name.replace(".", ",") + ".V"], image, name)


def test_exported_bands_obey_plancks_law(hour, exported):
    """In the picture's corners the table emits, and reflects the sky and a little of the ring, which is never colder
    than the sky nor brighter than a blackbody at its own temperature (the table is colder)."""
    header, images = exported
    edges = np.array([float(edge) for edge in header["bandEdges"].split()])
    table, sky, ring, heater = hour["temperature"], 250.0, 340.0, 1000.0  # K; all but the first as the file has it
    reference = float(header["referenceTemperature"])
    radius, height, nearest = 0.106, 0.05, hour["nearest corner"] - 0.01  # m, outer ring; 0.01: more than two pixels
    # share of the hemisphere, by cosine, of a sector as wide as the ring and as high as its near side
    share = np.arcsin(radius / nearest) / np.pi * np.sin(np.arctan(height / (nearest - radius))) ** 2
    corner = np.s_[[0, 0, -1, -1], [0, -1, 0, -1]]
    points = library.find("Granite")
    for low, high in zip(edges, edges[1:], strict=False):
        wavelength = np.linspace(low, high, 2001)[:-1] + (high - low) / 4000  # um, midpoints
        emissivity = np.interp(wavelength, *points.T)

        def mean(share, kelvin, wavelength=wavelength * 1e-6):
            return np.mean(share * 2e-6 * h * c**2 / wavelength**5 / np.expm1(h * c / (wavelength * k * kelvin)))

        # a band's reflectance is one mean, weighted by what lights the image, and light counts by what it differs from
        # that at T0 (docs/surfaces.md, and docs/method.md, section 3)
        reflectance = [mean(1 - emissivity, source) / mean(1.0, source) for source in (table, sky, ring, heater)]
        even = mean(1.0, reference) + mean(emissivity, table) - mean(emissivity, reference)
        lit = np.array([mean(1.0, sky), mean(1.0, sky) + share * (mean(1.0, ring) - mean(1.0, sky))])
        possible = even + np.outer(reflectance, lit - mean(1.0, reference))
        least, most = possible[:, 0].min(), possible[:, 1].max()
        image = images[f"{low:.2f}-{high:.2f}um".replace(".", ",") + ".V"][corner]
        kelvin = 3 * images["Noise.V"][corner]  # standard errors
        slack = kelvin * (mean(1.0, table + 0.5) - mean(1.0, table - 0.5)) + 1e-6 * least  # float32
        assert (image > least - slack).all() and (image < most + slack).all(), (low, image, least, most, slack)


# The application template ---------------------------------------------------------------------------------------------


def rendered_template(*arguments) -> None:
    """Run template.py with arguments to Blender, and check that what it has open is the template and renders."""
    found = facts(blender(*arguments))
    assert [found["template"], found["engine"]] == ["Infrared_Photons", "INFRARED_PHOTONS"]
    assert found["objects"] == ["Camera", "Cube", "Floor", "Mirror Ball"]
    low, high = found["temperatures"]
    assert 260 <= low < high - 5 and high <= 320  # K: sky and cube are the ends; there is something to see


def test_the_template_renders_from_the_menu_and_from_the_command_line(first):
    rendered_template(*module("template", WORK / "dist" / "template" / "infrared_photons_template.zip"))
    assert (WORK / "user" / "scripts" / "startup" / "bl_app_templates_user" / "Infrared_Photons").is_dir()
    rendered_template("--app-template", "Infrared_Photons", *module("template"))


def test_the_template_says_that_the_extension_is_missing(first):
    with empty_user_folder():
        template = WORK / "user" / "scripts" / "startup" / "bl_app_templates_user" / "Infrared_Photons"
        shutil.copytree(ROOT / "docs" / "template" / "Infrared_Photons", template)
        text = blender("--app-template", "Infrared_Photons", *module("template"))
    assert "This template needs the extension Infrared Photons" in text
    assert facts(text)["engine"] == "BLENDER_EEVEE"


# From installing to removing ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def newer(installed):
    """The same extension as a zip of a higher version."""
    path = WORK / "dist" / "newer.zip"
    with zipfile.ZipFile(installed) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "blender_manifest.toml":
                content, count = re.subn(rb"(?m)^version = .*$", b'version = "9.0.0"', content)
                assert count == 1
            new.writestr(name, content)
    return path


def test_installing_upgrading_and_removing_leave_no_trace(first, installed, newer):
    """In one Blender, offline: another engine, disabling and an upgrade keep what the artist set and the same image."""
    with empty_user_folder():
        text = blender("--factory-startup", "--offline-mode", *module("life_cycle", installed, newer))
    found = facts(text)
    assert found.get("end"), text
    assert not re.search("error|warning: add-on", text, re.IGNORECASE), text
    version = run.read_toml(ROOT / "blender_manifest.toml")["version"]
    assert [found["version"], found["newer version"]] == [[int(part) for part in version.split(".")], [9, 0, 0]]
    assert found["seen when installed"]  # the look for traces finds what is there
    assert found["range"][1] > found["range"][0] > 0  # there is an image that could differ
    same = [name for name in found if name.startswith("same after")]
    assert len(same) == 4 and all(found[name] is True for name in same), found
    assert set(found["left when disabled"]) == {"files"}, found
    assert found["left when removed"] == {}
    assert found["files when removed"] == ["datafiles/infrared_photons"]
    assert found["my materials of an earlier version at once"] == []  # the file appears while the extension is enabled
    assert found["my materials of an earlier version"] == ["Oak"]
    for when in ("", " after the upgrade", " when installed again"):
        assert found[f"my materials{when}"] == ["Oak", "Beech"], found
    assert found["earlier file when removed"] is False  # Blender does this: the copy is what remains
    assert found["temperature of an object"] == 330.0  # K: files keep what they hold


def test_extension_can_be_removed(installed):
    blender("--command", "extension", "remove", "infrared_photons", check_scripts=False)
    assert "INFRARED_PHOTONS" not in report()["engines"]


def band_edges(scene: dict) -> np.ndarray:
    """The band edges of the scene in um."""
    assert scene["band_mode"] == "UNIFORM"
    low, high, count = scene["bands"]
    return np.linspace(low, high, count + 1)


@pytest.mark.parametrize("adaptive", [0, 1])
def test_smoke_is_read_where_it_is(tmp_path, adaptive):
    """Gas and fire are where the ball is from which they come, in a domain that is stretched, within two cells of 0.17
    m, as they rise; fire is hotter than it ignites, and nothing is colder than the object."""
    found = facts(blender(*module("smoke", adaptive, tmp_path)))
    np.testing.assert_allclose(found["centre"], (1.3, 2.2, 2.0), atol=0.34)
    assert 1500.0 < found["hottest"] < 3500.0 and found["coldest"] == 300.0
