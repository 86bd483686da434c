# SPDX-License-Identifier: GPL-3.0-or-later
"""Data sets of pairs by the command infrared_pairs: files read back by other libraries, resumed, split, and drawn."""

import csv
import json
import math
import shutil
from unittest.mock import Mock

import numpy as np
import OpenEXR
import pytest
from PIL import Image

bpy = pytest.importorskip("bpy")

from pycocotools.coco import COCO  # noqa: E402

from addon import commands, properties  # noqa: E402
from addon.kept import Kept  # noqa: E402
from addon.output.kitti import truncation  # noqa: E402
from addon.output.png import KelvinScale, write_png16  # noqa: E402
from addon.pairs import frames, ranges  # noqa: E402
from addon.pairs.changes import bind  # noqa: E402
from addon.pairs.constraints import check_constraints  # noqa: E402
from addon.pairs.ranges import read_rules, uniform  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from docs.tools import plot_pairs  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, custom_properties, link, material, read  # noqa: E402

pytestmark = [
    pytest.mark.usefixtures("reset_blender"),
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),  # by COCO's library
]
WIDTH, HEIGHT = 32, 24
RULES = {
    "objects": [
        {"category": "person", "temperature": [300, 310], "move": {"x": [-0.5, 0.5]}, "visible": 0.7},
        {"name": "Painted", "warmer": [-5, 5], "turn": {"z": [0, 90]}, "scale": [0.8, 1.2]},
    ],
    "materials": [{"name": "Pai*", "emissivity": [0.8, 0.95]}],
    "world": {"warmer": [-10, 10]},
    "camera": {"move": {"z": [-0.5, 0.5]}, "focal_length": [30, 50]},
}


@pytest.fixture
def scene(tmp_path):
    """Two persons and a painted car before a camera, in a file of its own."""
    mesh, painted = cube_mesh("Person"), cube_mesh("Painted")
    for each in (mesh, painted):
        each.materials.append(material("Paint", emissivity=0.9))
    for name, x in (("Anna", -1.2), ("Ben", 1.2)):
        person = link(name, mesh, temperature=305.0)
        person["category"], person.location = "person", (x, 0.0, 0.0)
    car = link("Painted", painted)
    car["category"], car.location = "sports car", (0.0, 1.2, -0.5)
    kelvin = painted.attributes.new("temperature", "FLOAT", "POINT")
    kelvin.data.foreach_set("value", np.linspace(290, 297, 8, dtype=np.float32))
    camera((0.0, 0.0, 6.0), WIDTH, HEIGHT)
    lamp = link("Sun", bpy.data.lights.new("Sun", "SUN"))
    lamp["temperature"] = 0.0
    scene = bpy.context.scene
    scene.render.engine, scene.world = "BLENDER_WORKBENCH", bpy.data.worlds.new("Sky")
    scene.world["temperature"] = 270.0
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 500, 2, 1
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    return bpy.context.scene


@pytest.fixture
def ranges_file(tmp_path):
    path = tmp_path / "ranges.json"
    path.write_text(json.dumps(RULES))
    return path


def run(folder, *more):
    return commands.pairs(["--output", str(folder), *map(str, more)])


def rows(folder):
    with open(folder / "manifest.csv", newline="") as file:
        return list(csv.DictReader(file))


def temperature(path):
    """(h, w) K of an EXR, the top row first."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return file.channels()["Temperature.V"].pixels


def pixels(path):
    with Image.open(path) as image:
        return np.array(image)


def everything(scene):
    """All that a user could find changed afterwards."""
    return {
        "blocks": [
            (block.name, custom_properties(block)) for block in (*bpy.data.objects, *bpy.data.materials, scene.world)
        ],
        "shown": [{key: obj.id_properties_ui(key).as_dict() for key, _ in obj.items()} for obj in bpy.data.objects],
        "poses": [
            (obj.matrix_basis.copy(), obj.rotation_mode, obj.hide_render, getattr(obj.data, "name", ""))
            for obj in bpy.data.objects
        ],
        "data": [(data.name, data.users) for data in (*bpy.data.meshes, *bpy.data.hair_curves, *bpy.data.pointclouds)],
        "lens": scene.camera.data.lens,
        "render": settings(scene.render) | settings(scene.render.image_settings),
        "own": settings(scene.infrared) | settings(scene.cycles) | settings(scene.eevee),
        "frame": scene.frame_current,
        "layers": [layer.use for layer in scene.view_layers],
    }


def settings(group):
    plain = (bool, int, float, str)
    names = (each.identifier for each in group.bl_rna.properties if not each.is_readonly)
    values = {name: getattr(group, name) for name in names}
    return {name: value for name, value in values.items() if isinstance(value, plain)}


def test_files_of_a_data_set(scene, tmp_path, ranges_file):
    """Pictures are read back by other libraries: EXR and 16 bits agree to half a step, both have the format of the RGB,
    labels are those of COCO and say the same as KITTI's text. The scene is as before, to the last setting."""
    before, folder = everything(scene), tmp_path / "pairs"
    assert run(folder, "--frames", "3-4", "--randomize", ranges_file, "--kitti", "--offset", 200, "--step", 0.005) == 0
    assert everything(scene) == before
    about, manifest = json.loads((folder / "pairs.json").read_text()), rows(folder)
    assert about["scale"] == {
        "formula": "K = offset + value * step", "offset": 200.0, "step": 0.005, "pass": "Temperature",
    }  # fmt: skip
    assert [row["frame"] for row in manifest] == ["3", "4"]
    coco = COCO(str(folder / "labels.json"))
    assert coco.getImgIds() == [3, 4]
    assert {each["name"] for each in coco.loadCats(coco.getCatIds())} == {"person", "sports car"}
    for row in manifest:
        rgb, counts, kelvin = (pixels(folder / row["rgb"]), pixels(folder / row["thermal_png"]),
                               temperature(folder / row["thermal_exr"]))  # fmt: skip
        assert rgb.shape == (HEIGHT, WIDTH, 3) and rgb.dtype == np.uint8 and rgb.std() > 0
        assert counts.shape == kelvin.shape == (HEIGHT, WIDTH)
        told = float(row["offset"]) + float(row["step"]) * counts.astype(float)
        np.testing.assert_allclose(told, kelvin, atol=0.0025 + 3e-5)  # half a step, and float32 at 300 K
        assert float(row["coldest"]) == pytest.approx(kelvin.min(), abs=1e-3)
        assert float(row["hottest"]) == pytest.approx(kelvin.max(), abs=1e-3)
        assert row["passes"] == "2" and row["beyond_scale"] == "0" and float(row["noise"]) >= 0
        number = int(row["frame"])
        found = coco.loadAnns(coco.getAnnIds(imgIds=[number]))
        (image,) = coco.loadImgs([number])
        assert image["file_name"] == f"frame_{number:04d}.png"
        pose = np.array(image["camera"]["camera_to_world"])
        place = [float(row[f"camera_{axis}"]) for axis in "xyz"]
        np.testing.assert_allclose(place, pose[:3, 3], rtol=1e-8)
        for each in found:
            mask = coco.annToMask(each).astype(bool)
            assert kelvin[mask].max() == pytest.approx(each["temperature"]["maximum"], abs=1e-4)
        lines = (folder / "kitti" / f"frame_{number:04d}.txt").read_text().splitlines()
        assert len(lines) == len(found) > 0
        for line, each in zip(lines, found, strict=True):
            kind, *numbers = line.split(" ")
            assert len(numbers) == 14 and kind in ("person", "sports_car")
            left, top, right, bottom = map(float, numbers[3:7])
            x, y, width, height = each["bbox"]
            assert (left, top, right - left + 1, bottom - top + 1) == (x, y, width, height)
            assert 0.0 <= float(numbers[0]) <= 1.0


@pytest.mark.parametrize(("kind", "height"), [("PERSP", 6.0), ("PANO", 1.5)])
def test_the_rgb_picture_is_that_of_cycles_from_the_same_pose(scene, tmp_path, kind, height):
    """Where labels see a thing, the RGB picture does, too: its mask is bright before a black world."""
    scene.camera.data.type, scene.camera.data.panorama_type = kind, "EQUIRECTANGULAR"
    scene.camera.location.z = height
    scene.world.color = (0.0, 0.0, 0.0)
    bpy.data.objects["Sun"].data.energy = 5.0
    bpy.ops.wm.save_mainfile()
    assert run(tmp_path / "pairs", "--frames", "1", "--samples", 8) == 0
    coco = COCO(str(tmp_path / "pairs" / "labels.json"))
    seen = sum(coco.annToMask(each) for each in coco.loadAnns(coco.getAnnIds())) > 0
    bright = pixels(tmp_path / "pairs" / "rgb" / "frame_0001.png").max(axis=2) > 60
    assert 0.05 < seen.mean() < 0.9
    edges = np.count_nonzero(np.diff(seen, axis=0)) + np.count_nonzero(np.diff(seen, axis=1))
    assert np.count_nonzero(bright != seen) <= edges  # pixels at edges alone may be either
    middles = [np.argwhere(mask).mean(axis=0) for mask in (seen, bright)]
    np.testing.assert_allclose(*middles, atol=0.5)


def test_a_killed_run_goes_on(scene, tmp_path, ranges_file, monkeypatch):
    """Killed between the pictures of the second frame: what is there stays, to the byte, and nothing of it is rendered
    again; the rest is as in a run that was not killed."""
    arguments = "--frames", "1-3", "--randomize", ranges_file
    assert run(tmp_path / "whole", *arguments) == 0
    real, folder = frames._render_thermal, tmp_path / "killed"

    def killed(scene, files, scale):
        if files.png.stem == "frame_0002":
            raise KeyboardInterrupt
        return real(scene, files, scale)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(frames, "_render_thermal", killed)
        run(folder, *arguments)
    there = {path: path.stat().st_mtime_ns for path in folder.rglob("frame_*")}
    assert {path.relative_to(folder).as_posix() for path in there} == {
        "rgb/frame_0001.png", "thermal/frame_0001.exr", "thermal/frame_0001.png", "labels/frame_0001.json",
        "rgb/frame_0002.png",
    }  # fmt: skip
    assert run(folder, *arguments) == 0
    assert {path: path.stat().st_mtime_ns for path in there} == there
    assert_same(folder, tmp_path / "whole")
    monkeypatch.setattr(frames, "_render_frame", Mock(side_effect=AssertionError("a frame was rendered")))
    assert run(folder, *arguments, "--kitti") == 0
    assert len(list((folder / "kitti").iterdir())) == 3


def assert_same(folder, whole):
    """All pictures and labels are equal, and all of the manifest but how long it took."""
    names = {path.relative_to(whole) for path in whole.rglob("frame_*")}
    assert {path.relative_to(folder) for path in folder.rglob("frame_*")} == names
    for name in names:
        if name.suffix == ".png":
            np.testing.assert_array_equal(pixels(folder / name), pixels(whole / name))
        elif name.suffix == ".exr":
            np.testing.assert_array_equal(temperature(folder / name), temperature(whole / name))
    timeless = [
        [{key: value for key, value in row.items() if not key.startswith("seconds")} for row in rows(each)]
        for each in (folder, whole)
    ]
    assert timeless[0] == timeless[1]
    labels = [json.loads((each / "labels.json").read_text()) for each in (folder, whole)]
    for each in labels:
        for image in each["images"]:
            del image["seconds_rgb"], image["seconds_thermal"]
    assert labels[0] == labels[1]


def test_ranges_of_frames_are_the_whole(scene, tmp_path, ranges_file):
    """Two runs, in whichever order, as by two machines in one folder."""
    assert run(tmp_path / "whole", "--frames", "1-3", "--randomize", ranges_file) == 0
    for some in ("2-3", "1"):
        assert run(tmp_path / "parts", "--frames", some, "--randomize", ranges_file) == 0
    assert_same(tmp_path / "parts", tmp_path / "whole")
    assert plot_pairs.draw(tmp_path / "whole").size == (2 * WIDTH, len(plot_pairs.FRAMES) * HEIGHT)


def test_the_picture_of_16_bits_is_the_cameras(scene, tmp_path):
    """With Camera Effects it shows what the camera delivers, with its noise; the EXR has both. A light of 0 K, for the
    RGB picture alone, is in none."""
    infrared = scene.infrared
    infrared.use_detector, infrared.detector_netd, infrared.detector_bits = True, 2.0, 0
    bpy.ops.wm.save_mainfile()
    folder = tmp_path / "pairs"
    assert run(folder, "--frames", "1") == 0
    assert json.loads((folder / "pairs.json").read_text())["scale"]["pass"] == "Camera Temperature"
    with OpenEXR.File(str(folder / "thermal" / "frame_0001.exr"), separate_channels=True) as file:
        seen, told = (file.channels()[f"{name}.V"].pixels for name in ("Temperature", "Camera Temperature"))
    np.testing.assert_allclose(pixels(folder / "thermal" / "frame_0001.png") * 0.01, told, atol=0.005 + 3e-5)
    assert (told - seen).std() > 0.5
    assert read()[0].lights == ()


def test_other_options_in_a_folder_are_refused_by_name(scene, tmp_path, ranges_file, capsys):
    folder = tmp_path / "pairs"
    assert run(folder, "--frames", "1") == 0
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    for more, told in (
        (["--seed", 5], "seed (0, now 5)"),
        (["--samples", 2], "samples (1, now 2)"),
        (["--step", 0.02], "scale ("),
        (["--randomize", ranges_file], "randomize ("),
    ):
        assert run(folder, "--frames", "1-2", *more) == 1
        assert told in capsys.readouterr().err
    scene.infrared.photons_per_pass += 1
    assert run(folder, "--frames", "1-2") == 1
    assert "photons_per_pass (500, now 501)" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before


def test_a_folder_with_other_files_is_refused(scene, tmp_path, capsys):
    assert run(tmp_path, "--frames", "1") == 1  # of the scene's file
    assert "holds files, but no pairs" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {"scene.blend"}


def test_copies_and_leftovers_of_labels_are_no_frames(scene, tmp_path, capsys):
    """Neither what programs that synchronise folders add, nor labels without pictures."""
    folder = tmp_path / "pairs"
    assert run(folder, "--frames", "1-2") == 0
    for name in ("frame_0001 (1)", "frame_0001-conflict", "frame_1", "frame_0007"):
        shutil.copy(folder / "labels" / "frame_0001.json", folder / "labels" / f"{name}.json")
    capsys.readouterr()
    assert run(folder, "--frames", "1-2", "--kitti") == 0
    assert "2 frames are complete" in capsys.readouterr().out
    assert [row["frame"] for row in rows(folder)] == ["1", "2"]
    assert len(json.loads((folder / "labels.json").read_text())["images"]) == 2
    assert {path.name for path in (folder / "kitti").iterdir()} == {"frame_0001.txt", "frame_0002.txt"}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "Expecting value"),
        ("{}", "it has no 'images'"),
        ("[]", "list indices"),
        ('{"images": []}', "not enough values"),
        ('{"images": [{"frame": 2}], "categories": [], "annotations": []}', "it is of frame 2"),
        ('{"images": [{"frame": 1}], "categories": [], "annotations": []}', "it has no 'camera'"),
    ],
)
def test_damaged_labels_are_rendered_again_once_they_are_deleted(scene, tmp_path, content, told, capsys):
    folder = tmp_path / "pairs"
    assert run(folder, "--frames", "1") == 0
    labels = folder / "labels" / "frame_0001.json"
    whole = json.loads(labels.read_text())["annotations"]
    labels.write_text(content)
    assert run(folder, "--frames", "1") == 1
    error = capsys.readouterr().err
    assert f"'{labels}' is damaged: {told}" in error and "Delete it, and a run with --frames 1 renders" in error
    labels.unlink()
    assert run(folder, "--frames", "1") == 0
    assert json.loads(labels.read_text())["annotations"] == whole


@pytest.mark.parametrize("content", ["", "[]"])
def test_a_damaged_description_of_a_folder_is_copied_from_another(scene, tmp_path, content, capsys):
    """As the message says; without the file, the folder is refused."""
    folder, other = tmp_path / "pairs", tmp_path / "other"
    assert run(folder, "--frames", "1") == run(other, "--frames", "2") == 0
    (folder / "pairs.json").write_text(content)
    assert run(folder, "--frames", "1") == 1
    assert "pairs.json' is damaged: " in (error := capsys.readouterr().err)
    assert "copy this file from one that the same command begins" in error
    shutil.copy(other / "pairs.json", folder)
    assert run(folder, "--frames", "1") == 0


def test_a_folder_whose_description_could_not_be_written_stays_empty(scene, tmp_path, monkeypatch):
    """So the command can be started again once the disk has room."""
    with monkeypatch.context() as patch:
        patch.setattr("addon.pairs.folder.write_text", Mock(side_effect=OSError("No space left")))
        assert run(tmp_path / "pairs", "--frames", "1") == 1
    assert run(tmp_path / "pairs", "--frames", "1") == 0


@pytest.mark.parametrize(
    ("kind", "rgb", "told"),
    [
        ("FISHEYE_EQUISOLID", "cycles", "Camera 'Second': of panoramas of the type Fisheye Equisolid"),
        ("EQUIRECTANGULAR", "eevee", "Camera 'Second' is a panorama, which only cycles renders"),
    ],
)
def test_panoramas_that_would_not_be_aligned_are_refused(scene, tmp_path, kind, rgb, told, capsys, monkeypatch):
    """Also those of cameras that a marker turns on later."""
    monkeypatch.setattr(frames, "_choose_engine", lambda scene, name: None)  # without a graphics card there is no EEVEE
    second = link("Second", bpy.data.cameras.new("Second"))
    second.data.type, second.data.panorama_type = "PANO", kind
    scene.timeline_markers.new("Second", frame=2).camera = second
    assert run(tmp_path / "pairs", "--frames", "1", "--rgb", rgb) == 1
    assert told in capsys.readouterr().err and not (tmp_path / "pairs").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["--frames", "4-2"],
        ["--step", "0"],
        ["--samples", "-1"],
        ["--seed", "-1"],
        ["--rgb", "povray"],
        ["--offset", "inf"],
        ["--offset", "nan"],
    ],
)
def test_nonsense_is_refused(scene, tmp_path, arguments, capsys):
    with pytest.raises(SystemExit):
        run(tmp_path / "pairs", *arguments)
    assert arguments[1] in capsys.readouterr().err
    assert not (tmp_path / "pairs").exists()


# What is drawn --------------------------------------------------------------------------------------------------------


def test_draws_fill_their_range_and_depend_on_seed_frame_and_name():
    """The mean of n even draws has the standard error 1 / sqrt(12 n); of 20 ranges, none is beyond 4 of these."""
    draws = np.array([[uniform(3, frame, f"thing {i}") for frame in range(500)] for i in range(20)])
    assert draws.min() >= 0.0 and draws.max() < 1.0 and len(np.unique(draws)) == draws.size
    assert np.abs(draws.mean(axis=1) - 0.5).max() < 4 / math.sqrt(12 * 500)
    correlations = np.corrcoef(draws)[np.triu_indices(20, 1)]
    assert np.abs(correlations).max() < 4.5 / math.sqrt(500)  # of 190
    assert uniform(3, 7, "thing 0") == draws[0, 7] != uniform(4, 7, "thing 0")


def write(tmp_path, content, name="bad.json"):
    path = tmp_path / name
    text = content if isinstance(content, str | bytes) else json.dumps(content)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_what_is_drawn_is_told_and_lies_in_its_range(scene, tmp_path):
    rules = read_rules(write(tmp_path, RULES))
    changes = bind(rules, scene, scene.view_layers[0])
    seen = set()
    for frame in range(40):
        with Kept() as kept:
            told = frames.apply_draws(changes, kept, 1, frame)
            anna, car = bpy.data.objects["Anna"], bpy.data.objects["Painted"]
            assert 300 <= anna["temperature"] == told["Anna.temperature"] <= 310
            assert (
                anna.location.x == pytest.approx(-1.2 + told["Anna.move.x"], abs=1e-6)
                and abs(told["Anna.move.x"]) <= 0.5
            )
            assert anna.hide_render == (told["Anna.visible"] >= 0.7)
            painted = np.empty(8, np.float32)
            car.data.attributes["temperature"].data.foreach_get("value", painted)
            np.testing.assert_allclose(painted, np.linspace(290, 297, 8) + told["Painted.warmer"], atol=1e-4)
            assert math.degrees(car.rotation_euler.z) == pytest.approx(told["Painted.turn.z"], abs=1e-4)
            assert 0.8 <= car.scale.x <= 1.2 and scene.camera.data.lens == pytest.approx(told["camera.focal_length"])
            assert scene.world["temperature"] == 270 + told["Sky.warmer"]
            seen.add(anna.hide_render)
    assert seen == {True, False} and bpy.data.objects["Painted"].data.name == "Painted"


def test_things_that_go_together_share_a_draw(scene, tmp_path):
    content = {
        "objects": [{"name": "*n*", "warmer": [0, 10], "together": "weather"}],
        "world": {"warmer": [0, 20], "together": "weather"},
    }
    changes = bind(read_rules(write(tmp_path, content)), scene, scene.view_layers[0])
    drawn = {change.thing: change.drawn(0, 5)[""] for change in changes}
    assert drawn["Anna"] == drawn["Ben"] == drawn["Painted"] == drawn["Sky"] / 2


@pytest.mark.parametrize("suffix", ["table", "list", "image"])
def test_a_sky_gets_warmer(scene, tmp_path, suffix):
    from addon.reading.world import read_sky

    world = scene.world
    if suffix == "table":
        world["temperature_table"] = {"zenith": [0.0, 90.0], "wavelength": [10.0], "kelvin": [250.0, 280.0]}
    elif suffix == "list":
        world["temperature"] = [0.0, 250.0, 90.0, 280.0]
    else:
        image = bpy.data.images.new("Sky", 2, 2, float_buffer=True, is_data=True)
        image.pixels.foreach_set(np.full(16, 260.0, np.float32))
        world["temperature_image"] = image
    before, stored = read_sky(world).kelvin.copy(), custom_properties(world)
    (change,) = bind(read_rules(write(tmp_path, {"world": {"warmer": [4, 4]}})), scene, scene.view_layers[0])
    with Kept() as kept:
        change.apply(kept, change.drawn(0, 1))
        np.testing.assert_allclose(read_sky(world).kelvin, before + 4, atol=1e-4)
    assert custom_properties(world) == stored


def test_a_sky_is_drawn_from_the_weather(scene, tmp_path):
    content = {"world": {"clear_sky": {"air": [280, 280], "humidity": [50, 50]}}}
    (change,) = bind(read_rules(write(tmp_path, content)), scene, scene.view_layers[0])
    with Kept() as kept:
        change.apply(kept, change.drawn(0, 1))
        drawn = custom_properties(scene.world)["temperature_table"]
    bpy.ops.infrared.clear_sky(air=280.0, humidity=50.0, replace=True)
    np.testing.assert_allclose(drawn["kelvin"], scene.world["temperature_table"]["kelvin"], atol=1e-3)  # float32 air


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{", "cannot be read"),
        (b'{"materials": [{"name": "K\xe4se"}]}', "bad.json' cannot be read: it is no text in UTF-8"),
        ('{"world": {"warmer": [0, 1]}}'.encode("utf-16"), "bad.json' cannot be read: it is no text in UTF-8"),
        ("[" * 100_000, "cannot be read: "),
        ('{"objects": [], "world": {}, "objects": []}', 'bad.json\' cannot be read: the key "objects" is given twice'),
        ('{"world": {"warmer": [0, 1], "warmer": [0, 2]}}', 'the key "warmer" is given twice'),
        (f'{{"world": {{"temperature": [300, 1{"0" * 400}]}}}}', "world.temperature is [300, 1000"),
        (f'{{"world": {{"temperature": [300, 1{"0" * 5000}]}}}}', "cannot be read: "),
        (f'{{"objects": [{{"name": "Anna", "visible": 1{"0" * 400}}}]}}', "objects[0].visible is 1000"),
        ({"things": []}, 'unknown key "things"'),
        ({"objects": {}}, "objects is {}, expected a list"),
        ({"objects": [{"name": "Anna", "temprature": [1, 2]}]}, 'objects[0] has an unknown key "temprature"'),
        ({"objects": [{"temperature": [1, 2]}]}, "objects[0] says of nothing"),
        ({"objects": [{"name": "Anna"}]}, "objects[0] draws nothing"),
        ({"objects": [{"name": 3, "warmer": [1, 2]}]}, "objects[0].name is 3, expected a text"),
        ({"objects": [{"name": [], "warmer": [1, 2]}]}, "objects[0].name is [], expected a text"),
        ({"world": {"warmer": [1, 2], "together": 1}}, "world.together is 1, expected a text"),
        ({"objects": [{"name": "Anna", "temperature": [310, 300]}]}, "objects[0].temperature is [310, 300], an empty"),
        ({"objects": [{"name": "Anna", "temperature": [-1, 300]}]}, "objects[0].temperature is [-1, 300], expected"),
        ({"objects": [{"name": "Anna", "temperature": 300}]}, "is 300, expected a range [low, high]"),
        ('{"objects": [{"name": "Anna", "warmer": [NaN, 1]}]}', "expected a range"),
        ({"objects": [{"name": "Anna", "move": {"w": [0, 1]}}]}, 'objects[0].move has an unknown key "w"'),
        ({"objects": [{"name": "Anna", "move": {}}]}, "objects[0].move is {}, expected x, y, z in it"),
        ({"objects": [{"name": "Anna", "scale": [0, 1]}]}, "objects[0].scale is [0, 1]"),
        ({"objects": [{"name": "Anna", "visible": 2}]}, "objects[0].visible is 2, expected a probability"),
        ({"objects": [{"name": "Nobody*", "warmer": [0, 1]}]}, "objects[0]: no object has name 'Nobody*'"),
        ({"objects": [{"category": "tree", "warmer": [0, 1]}]}, "no object has category 'tree'"),
        ({"objects": [{"name": "Painted", "temperature": [1, 2]}]}, "the attribute of 'Painted' says how warm it is"),
        ({"objects": [{"name": "Anna", "warmer": [-400, 0]}]}, "cannot be rendered with the low ends of all ranges"),
        (
            {"objects": [{"name": "Anna", "warmer": [0, 1]}, {"category": "person", "temperature": [300, 301]}]},
            "objects[1].temperature: objects[0].warmer draws the same of 'Anna'",
        ),
        (
            {
                "objects": [{"name": "Camera", "move": {"x": [0, 1]}}],
                "camera": {"location": {"x": [0, 1], "y": [0, 1]}},
            },
            "camera.location: objects[0].move draws the same of 'Camera'",
        ),
        (
            {"objects": [{"name": "Camera", "warmer": [0, 1]}]},
            "objects[0].warmer: 'Camera' (Camera) has no temperature; choose objects that have one",
        ),
        ({"materials": [{"name": "Gold", "emissivity": [0, 1]}]}, "no material has name 'Gold'"),
        ({"materials": [{"name": "Paint", "emissivity": [0.5, 1.5]}]}, "materials[0].emissivity is [0.5, 1.5]"),
        ({"world": {"clear_sky": {"air": [280, 290]}}}, "expected humidity in it"),
        ({"world": {"clear_sky": {"air": [280, 400], "humidity": [50, 60]}}}, "world.clear_sky: Clear sky: "),
        ({"camera": {"focal_length": [0, 50]}}, "camera.focal_length is [0, 50]"),
    ],
)
def test_mistakes_are_told_before_the_first_frame(scene, tmp_path, content, told, capsys):
    before = everything(scene)
    assert run(tmp_path / "pairs", "--frames", "1", "--randomize", write(tmp_path, content)) == 1
    assert told in capsys.readouterr().err
    assert not (tmp_path / "pairs").exists() and everything(scene) == before


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("world: {warmer: [0, 1]}\nobjects: []\nworld: {}", 'the key "world" is given twice'),
        ("objects: &a\n - *a", "the alias of line 1 stands for what it is in"),
        ("objects:\n - &a\n  name: *a\n  warmer: [0, 1]", "the alias of line 2 stands for what it is in"),
        ("objects: {2024-01-01: 1}", "objects is {"),
        ("world: {warmer: 2024-13-45}", "cannot be read: "),
    ],
)
def test_mistakes_of_yaml_are_told(tmp_path, content, told):
    pytest.importorskip("yaml")
    with pytest.raises(SceneError, match="bad.yaml'") as caught:
        read_rules(write(tmp_path, content, "bad.yaml"))
    assert told in str(caught.value)


def test_what_is_written_once_may_stand_for_more(tmp_path):
    """Aliases, and a mark of UTF-8 at the beginning, as some editors write it."""
    pytest.importorskip("yaml")
    text = "\ufeffobjects:\n - &a {name: Anna, warmer: [0, 1]}\n - {<<: *a, name: Ben}"
    rules = read_rules(write(tmp_path, text, "ranges.yaml"))
    assert [rule.selectors["name"] for rule in rules] == [("Anna",), ("Ben",)]
    assert rules[0].ranges == rules[1].ranges == {"warmer": {"": (0.0, 1.0)}}


def test_what_is_always_visible_hides_nothing(scene, tmp_path):
    """Nor at the end of its range, which is checked."""
    path = write(tmp_path, {"objects": [{"name": "*", "visible": 1}]})
    assert run(tmp_path / "pairs", "--frames", "1", "--randomize", path) == 0


def test_what_is_animated_is_not_drawn(scene, tmp_path, capsys):
    anna = bpy.data.objects["Anna"]
    anna.keyframe_insert("location", frame=1)
    path = write(tmp_path, {"objects": [{"name": "Anna", "move": {"x": [0.1, 1]}}]})
    assert run(tmp_path / "pairs", "--frames", "1", "--randomize", path) == 1
    assert "'Anna': location is animated or driven" in capsys.readouterr().err


def constrained(obj, kind, **settings):
    """A constraint of an object that follows an Empty in the origin."""
    constraint = obj.constraints.new(kind)
    constraint.target = bpy.data.objects.get("Target") or link("Target")
    for name, value in settings.items():
        setattr(constraint, name, value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"camera": {"turn": {"x": [20, 20]}}}, "camera.turn.x: the constraints of 'Camera' (Track To) leave nothing"),
        ({"camera": {"rotation": {"z": [-180, 180]}}}, "camera.rotation.z: the constraints of 'Camera' (Track To)"),
        (
            {"objects": [{"name": "Anna", "move": {"y": [0, 1], "x": [1, 2]}}]},
            "objects[0].move.x: the constraints of 'Anna' (Copy Location) leave nothing of it",
        ),
        (
            {"objects": [{"name": "Ben", "scale": [1, 2]}]},
            "objects[0].scale: the constraints of 'Ben' (Limit Scale) leave nothing of it",
        ),
    ],
)
def test_poses_that_constraints_overwrite_are_told(scene, tmp_path, content, told, capsys):
    constrained(scene.camera, "TRACK_TO", track_axis="TRACK_NEGATIVE_Z", up_axis="UP_Y")
    constrained(bpy.data.objects["Anna"], "COPY_LOCATION", use_y=False)
    limit = bpy.data.objects["Ben"].constraints.new("LIMIT_SCALE")
    limit.use_max_x = limit.use_max_y = limit.use_max_z = True
    limit.max_x = limit.max_y = limit.max_z = 0.5
    before = everything(scene)
    assert run(tmp_path / "pairs", "--frames", "1", "--randomize", write(tmp_path, content)) == 1
    assert told in capsys.readouterr().err
    assert not (tmp_path / "pairs").exists() and everything(scene) == before


def test_poses_that_constraints_leave_are_drawn(scene, tmp_path):
    """A camera that looks at its target from elsewhere; what moves with an offset or beside a path; and what a muted
    constraint would hold. Of the camera that a marker chooses later, constraints count as well."""
    constrained(scene.camera, "TRACK_TO", track_axis="TRACK_NEGATIVE_Z", up_axis="UP_Y")
    constrained(bpy.data.objects["Anna"], "COPY_LOCATION", use_y=False)
    constrained(bpy.data.objects["Ben"], "CHILD_OF")
    constrained(bpy.data.objects["Painted"], "COPY_ROTATION", mute=True)
    poses = {"move": {"x": [-1, 1], "y": [0, 0], "z": [1, 2]}, "turn": {"x": [0, 0], "z": [-180, 180]}}
    content = {
        "objects": [
            {"name": "Anna", "move": {"y": [-1, 1]}, "turn": {"z": [0, 360]}},
            {"name": ["Ben", "Painted"], **poses, "scale": [1, 2]},
        ],
        "camera": {"move": {"x": [-1, 1]}, "focal_length": [30, 50]},
    }
    layer = scene.view_layers[0]
    check_constraints(bind(read_rules(write(tmp_path, content)), scene, layer), scene, layer)
    second = link("Second", bpy.data.cameras.new("Second"))
    constrained(second, "COPY_LOCATION")
    scene.timeline_markers.new("Second", frame=9).camera = second
    first = scene.camera
    with pytest.raises(SceneError, match=r"camera.move.x: the constraints of 'Second' \(Copy Location\)"):
        check_constraints(bind(read_rules(write(tmp_path, content)), scene, layer), scene, layer)
    assert scene.camera == first


def fluff(kind, kelvin):
    """Hair or points with the attribute of temperatures."""
    if kind == "CURVES":
        data = bpy.data.hair_curves.new("Fluff")
        data.add_curves([2])
        data.attributes["position"].data.foreach_set("vector", [0.0, 0.0, 1.0, 0.0, 0.5, 1.0])
        obj = link("Fluff", data, temperature=300.0)
    else:  # Blender 4.5 makes points of a mesh alone
        mesh = bpy.data.meshes.new("Fluff")
        mesh.from_pydata([(0.0, 0.0, 1.0), (0.0, 0.5, 1.0)], [], [])
        obj = link("Fluff", mesh, temperature=300.0)
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
        bpy.ops.object.convert(target="POINTCLOUD")
    for name, value in (("temperature", kelvin), ("radius", 0.1)):
        attribute = obj.data.attributes.get(name) or obj.data.attributes.new(name, "FLOAT", "POINT")
        attribute.data.foreach_set("value", [value, value])
    return obj


@pytest.mark.parametrize("kind", ["CURVES", "POINTCLOUD"])
def test_hair_and_points_get_warmer(scene, tmp_path, kind):
    obj = fluff(kind, 330.0)
    assert obj.type == kind
    before = everything(scene)
    changes = bind(read_rules(write(tmp_path, {"objects": [{"name": "Fluff", "warmer": [20, 20]}]})), scene, None)
    with Kept() as kept:
        frames.apply_draws(changes, kept, 0, 1)
        assert obj["temperature"] == 320.0
        assert read()[0].temperature.max() == pytest.approx(350.0)
    assert everything(scene) == before and read()[0].temperature.max() == pytest.approx(330.0)


def test_lamps_get_warmer_than_they_count_without_a_temperature(scene, tmp_path):
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    changes = bind(read_rules(write(tmp_path, {"objects": [{"name": "Lamp", "warmer": [20, 20]}]})), scene, None)
    own = properties.initial_value(lamp, "temperature", scene)
    with Kept() as kept:
        frames.apply_draws(changes, kept, 0, 1)
        assert lamp["temperature"] == own + 20


def test_an_empty_is_moved_but_not_heated(scene, tmp_path):
    """Where a pattern chooses it along with others; named, it is refused with what to choose."""
    group = bpy.data.collections.new("Crowd")
    empty = link("Annas")
    empty.instance_type, empty.instance_collection = "COLLECTION", group
    content = {"objects": [{"name": "Anna*", "warmer": [1, 2], "move": {"x": [0, 1]}}]}
    changes = bind(read_rules(write(tmp_path, content)), scene, None)
    assert {(change.thing, change.key) for change in changes} == {
        ("Anna", "warmer"), ("Anna", "move"), ("Annas", "move"),
    }  # fmt: skip
    for key in ("warmer", "temperature"):
        rules = read_rules(write(tmp_path, {"objects": [{"name": ["Anna", "Annas"], key: [1, 2]}]}))
        with pytest.raises(SceneError, match=rf"0\].{key}: 'Annas' \(Empty\) has no temp.* in its collection 'Crowd'"):
            bind(rules, scene, None)


def test_things_of_one_name_from_two_libraries_have_draws_of_their_own(scene, tmp_path):
    for library in ("a", "b"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        mesh, group = cube_mesh("Body"), bpy.data.collections.new(library)
        bpy.context.scene.collection.children.link(group)
        mesh.materials.append(material("Coat", emissivity=0.9))
        link("Body", mesh, group, temperature=300.0)["category"] = "person"
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / f"{library}.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    for library in ("a", "b"):
        with bpy.data.libraries.load(str(tmp_path / f"{library}.blend"), link=True) as (_, wanted):
            wanted.collections = [library]
        empty = link(f"Instance of {library}")
        empty.instance_type, empty.instance_collection = "COLLECTION", wanted.collections[0]
    content = {
        "objects": [{"name": "Body", "category": "person", "warmer": [0, 5], "visible": 0.5}],
        "materials": [{"name": "Coat", "emissivity": [0.5, 0.6]}],
    }
    changes = bind(read_rules(write(tmp_path, content)), scene, scene.view_layers[0])
    with Kept() as kept:
        told = frames.apply_draws(changes, kept, 0, 1)
        for library in ("a.blend", "b.blend"):
            own = bpy.data.objects["Body", str(tmp_path / library)]["temperature"]
            assert own == 300.0 + told[f"Body [{library}].warmer"]
    names = [f"Body [{each}.blend].{key}" for each in "ab" for key in ("warmer", "visible")]
    assert told.keys() == {*names, "Coat [a.blend].emissivity", "Coat [b.blend].emissivity"}
    assert len({*told.values()}) == 6
    content = {"objects": [{"name": "Body [a.blend]", "warmer": [0, 5]}]}
    (change,) = bind(read_rules(write(tmp_path, content)), scene, scene.view_layers[0])
    assert change.thing == "Body [a.blend]"


def test_a_quaternion_stays_one(scene, tmp_path):
    car = bpy.data.objects["Painted"]
    car.rotation_mode, car.rotation_quaternion = "QUATERNION", (0.6, 0.0, 0.0, 0.8)
    before = everything(scene)
    rules = read_rules(write(tmp_path, {"objects": [{"name": "Painted", "turn": {"z": [90, 90]}}]}))
    with Kept() as kept:
        frames.apply_draws(bind(rules, scene, scene.view_layers[0]), kept, 0, 1)
        turned = math.degrees(car.matrix_basis.to_euler().z)
        assert turned == pytest.approx(2 * math.degrees(math.acos(0.6)) + 90 - 360, abs=1e-3)
    assert everything(scene) == before


def test_yaml_says_the_same(scene, tmp_path):
    yaml = pytest.importorskip("yaml")
    path = write(tmp_path, yaml.safe_dump(RULES, sort_keys=False), "ranges.yaml")
    assert read_rules(path) == read_rules(write(tmp_path, RULES))


def test_without_pyyaml_json_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(ranges, "yaml", None)
    with pytest.raises(SceneError, match=r"ranges.yml' is YAML, which needs .* PyYAML"):
        read_rules(write(tmp_path, "objects: []", "ranges.yml"))


# Formats --------------------------------------------------------------------------------------------------------------


def test_pictures_of_16_bits(tmp_path):
    """Every number comes back, also where the scale ends; Pillow reads the text of the scale."""
    kelvin = np.array([[250.0, 300.004], [300.006, 5000.0], [100.0, 905.35]])
    values, beyond = KelvinScale(250.0, 0.01).values(kelvin)
    assert beyond == 2 and KelvinScale(250.0, 0.01).hottest == pytest.approx(905.35)
    write_png16(tmp_path / "a.png", values, {"Description": "K"})
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "I;16" and image.text == {"Description": "K"}
        np.testing.assert_array_equal(np.array(image)[::-1], [[0, 5000], [5001, 65535], [0, 65535]])


def test_how_much_of_a_box_is_cut_off():
    assert truncation([10, 10, 20, 10], 40, 30) == 0.0
    assert truncation([-10, 10, 20, 10], 40, 30) == 0.5
    assert truncation([30, 25, 20, 10], 40, 30) == 0.75
    assert str(truncation([3.1, 4.7, 5.3, 6.9], 40, 30)) == "0.0"  # not -0.0 by rounding
    assert truncation(None, 40, 30) == -1.0
