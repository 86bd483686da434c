# SPDX-License-Identifier: GPL-3.0-or-later
"""Films in files: parts of a render, from several machines, merge into the images of one."""

import dataclasses

import numpy as np
import OpenEXR
import pytest

from addon import merge
from addon.solver import Material, Settings, render
from addon.solver.checkpoint import fingerprint, read, save
from addon.solver.image.film import Film
from addon.solver.physics.correction import Correction
from tests.helpers.scenes import box, look, make_scene

EDGES = np.array([8.0, 10.0, 12.0])
SETTINGS = Settings(passes=8, photons_per_pass=2000, threads=2)
PARTS = ((0, 3), (3, 4), (4, 8))  # first pass and the one behind the last


def room():
    vertices, triangles = box((2.0, 3.0, 2.5))
    kelvin = np.repeat([290.0, 330.0, 295.0, 300.0, 280.0, 310.0], 2)
    camera = look((0.3, 0.4, 1.0), (1.5, 2.5, 1.2), 12, 8, 0.7)
    return make_scene(vertices, triangles, kelvin, [Material("wall", 0.7)], camera, EDGES)


@pytest.fixture(scope="module")
def whole():
    return render(room(), SETTINGS)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Files of the parts, in no order."""
    folder, scene, files = tmp_path_factory.mktemp("films"), room(), []
    for first, stop in (PARTS[2], PARTS[0], PARTS[1]):
        settings = dataclasses.replace(SETTINGS, passes=stop - first, pass_offset=first)
        files.append(folder / f"part{first}.npz")
        about = {"layer": "ViewLayer", "frame": 7, "facts": {"sensor": "Ideal", "passes": stop - first}}
        save(files[-1], render(scene, settings), fingerprint(scene, settings), about)
    return files


def images(path):
    """(h, w) by channel, the bottom row first, by OpenEXR's own reader."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels[::-1] for name, channel in file.channels().items()}, dict(file.header())


def test_parts_are_the_whole(parts, whole, tmp_path, capsys):
    """To the rounding of float32, noise included. A frame's number stands in the name of the file."""
    assert merge.main([*map(str, parts), "--output", str(tmp_path / "out_####.exr")]) == 0
    found, header = images(tmp_path / "out_0007.exr")
    for name, image in {"Radiance.V": whole.radiance(), "Temperature.V": whole.temperature(),
                        "Noise.V": whole.noise(), "8,00-10,00um.V": whole.band_radiance(0)}.items():  # fmt: skip
        np.testing.assert_allclose(found[name], image, rtol=3e-6)
    assert header["passes"] == "8" and header["firstPass"] == "0" and header["frame"] == "7"
    assert "Frame 7, ViewLayer: 8 passes of 3 films" in capsys.readouterr().out


def test_merged_films_merge_on(parts, whole, tmp_path):
    some = str(tmp_path / "some.npz")
    assert merge.main([str(parts[1]), str(parts[2]), "--film", some]) == 0
    assert read(tmp_path / "some.npz").film.ranges == [(0, 0, 4)]
    assert merge.main([some, str(parts[0]), "--film", str(tmp_path / "all.npz")]) == 0
    film = read(tmp_path / "all.npz").film
    np.testing.assert_allclose(film.noise(), whole.noise(), rtol=3e-6)
    longer = render(room(), dataclasses.replace(SETTINGS, passes=10), film=film)  # and are extended
    np.testing.assert_allclose(
        longer.temperature(), render(room(), dataclasses.replace(SETTINGS, passes=10)).temperature(), rtol=1e-6
    )


def test_two_options_never_write_the_same_file(parts, tmp_path, capsys):
    same = tmp_path / "out.exr"
    error = refused(capsys, *parts, "--output", same, "--groups", tmp_path / "x" / ".." / "out")
    assert "Two options would both write" in error and "give --groups another path" in error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.npz", "a"])
def test_a_film_that_is_read_is_never_replaced(parts, tmp_path, capsys, name):
    own = tmp_path / "a.npz"
    own.write_bytes(parts[0].read_bytes())
    error = refused(capsys, own, *parts[1:], "--film", tmp_path / name, "--output", tmp_path / "out.exr")
    assert f"'{own}' is read, and would be replaced: --film names another" in error
    assert own.read_bytes() == parts[0].read_bytes() and not list(tmp_path.glob("*.exr"))


def refused(capsys, *arguments):
    assert merge.main(list(map(str, arguments))) == 1
    return capsys.readouterr().err


def test_what_is_missing_is_listed(parts, tmp_path, capsys):
    error = refused(capsys, parts[0], "--output", tmp_path / "out.exr")
    assert "Passes 4 to 7 are there; missing are 0 to 3" in error
    error = refused(capsys, parts[0], parts[1], "--output", tmp_path / "out.exr")
    assert "Passes 0 to 2 and 4 to 7 are there; missing are 3" in error
    assert not list(tmp_path.iterdir())
    assert merge.main([str(parts[0]), str(parts[1]), "--partial", "--output", str(tmp_path / "out.exr")]) == 0


def test_the_same_pass_twice_is_refused(parts, tmp_path, capsys):
    twice = tmp_path / "copy.npz"
    twice.write_bytes(parts[0].read_bytes())
    error = refused(capsys, *parts, twice, "--output", tmp_path / "out.exr")
    assert "Both films hold pass 4" in error and f"'{twice}' has passes 4 to 7" in error


def test_films_of_other_renders_are_refused(parts, tmp_path, capsys):
    scene, other = room(), tmp_path / "other.npz"
    settings = dataclasses.replace(SETTINGS, passes=1, pass_offset=8)
    warmer = dataclasses.replace(scene, temperature=scene.temperature + np.float32(1.0))
    about = {"layer": "ViewLayer", "frame": 7}
    save(other, render(warmer, settings), fingerprint(warmer, settings), about)
    error = refused(capsys, *parts, other, "--output", tmp_path / "out.exr")
    assert "are of different renders: temperature differ" in error and str(other) in error
    other.write_bytes(other.read_bytes()[:1000])
    assert "damaged" in refused(capsys, *parts, other, "--output", tmp_path / "out.exr")
    assert "no.npz" in refused(capsys, tmp_path / "no.npz", "--output", tmp_path / "out.exr")


def test_films_that_are_corrected_differently_are_refused(parts, tmp_path, capsys):
    """Else the picture would depend on which one is named first."""
    other = tmp_path / "other.npz"
    stored = read(parts[1])
    correction = Correction(emissivity=0.5, reflected_temperature=300.0)
    save(other, stored.film, stored.marks, {**stored.about, "correction": correction._asdict()})
    for order in ((parts[0], other, parts[2]), (other, parts[2], parts[0])):
        error = refused(capsys, *order, "--output", tmp_path / "out.exr")
        assert str(other) in error and str(parts[0]) in error or str(parts[2]) in error
        assert "corrected differently: assumedEmissivity" in error and "reflectedTemperature" in error
    assert "assumedEmissivity 0.5 and 1, reflectedTemperature 300 and 293.15" in error
    assert not list(tmp_path.glob("*.exr"))
    assert merge.main([str(other), "--partial", "--output", str(tmp_path / "one.exr")]) == 0
    assert images(tmp_path / "one.exr")[1]["temperatureCalibration"]


def test_frames_and_layers_are_apart(parts, tmp_path):
    for frame, layer in ((7, "A/B"), (8, "ViewLayer")):
        for part in parts:
            stored = read(part)
            path = tmp_path / f"{frame} {layer[0]} {part.name}"
            save(path, stored.film, stored.marks, {**stored.about, "frame": frame, "layer": layer})
    assert merge.main([str(tmp_path / "*.npz"), *map(str, parts), "--output", str(tmp_path / "out.exr")]) == 0
    names = {path.name for path in tmp_path.glob("*.exr")}
    assert names == {"out0007_ViewLayer.exr", "out0007_A_B.exr", "out0008_ViewLayer.exr"}


def test_view_layers_do_not_overwrite_one_another(parts, whole, tmp_path):
    """Though their names differ only in what file names do not keep, or in upper and lower case."""
    temperature = whole.temperature()
    for number, layer in enumerate(("A.1", "A_1", "a 1")):
        for part in parts:
            stored = read(part)
            stored.film._mean *= 1.0 + number
            save(tmp_path / f"{number} {part.name}", stored.film, stored.marks, {**stored.about, "layer": layer})
    arguments = "--output", str(tmp_path / "out.exr"), "--film", str(tmp_path / "film")
    assert merge.main([str(tmp_path / "*part*.npz"), *arguments]) == 0
    stems = "_A_1", "_A_1_2", "_a_1_3"
    assert {path.name for path in tmp_path.glob("out*")} == {f"out{stem}.exr" for stem in stems}
    assert {path.name for path in tmp_path.glob("film*")} == {f"film{stem}.npz" for stem in stems}
    assert [read(tmp_path / f"film{stem}.npz").about["layer"] for stem in stems] == ["A.1", "A_1", "a 1"]
    np.testing.assert_allclose(images(tmp_path / "out_A_1.exr")[0]["Temperature.V"], temperature, rtol=3e-6)
    assert (images(tmp_path / "out_a_1_3.exr")[0]["Temperature.V"] > temperature).all()


def test_how_many_passes_a_target_needs(parts, whole, tmp_path, capsys):
    """As the error falls with the root of their number."""
    noise = float(np.percentile(whole.noise(), 95))
    arguments = [*map(str, parts), "--output", str(tmp_path / "out.exr"), "--target-noise"]
    assert merge.main([*arguments, f"{0.51 * noise:.9g}"]) == 2
    assert "; 23 more passes are needed" in capsys.readouterr().out
    assert merge.main([*arguments, f"{1.1 * noise:.9g}"]) == 0
    assert (tmp_path / "out.exr").exists()


def test_a_single_pass_tells_no_noise(parts, tmp_path, capsys):
    arguments = [str(parts[2]), "--partial", "--film", str(tmp_path / "one.npz")]
    assert merge.main(arguments) == 0
    assert "Frame 7, ViewLayer: a single pass, whose noise is not known\n" in capsys.readouterr().out
    assert merge.main([*arguments, "--target-noise", "0.5"]) == 2
    assert "not known; more passes are needed to tell whether it is below 0.5 K" in capsys.readouterr().out


@pytest.mark.parametrize("target", ["nan", "inf", "-1", "1e-300"])
def test_nonsense_for_a_target_is_refused_before_anything_is_written(parts, tmp_path, capsys, target):
    with pytest.raises(SystemExit):
        merge.main([*map(str, parts), "--output", str(tmp_path / "out.exr"), f"--target-noise={target}"])
    assert f"--target-noise is {target} K, expected 0 or at least 1e-06" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_groups_of_films_without_any_are_told(parts, tmp_path, capsys):
    groups = "--groups", tmp_path / "groups.exr"
    told = "Frame 7, ViewLayer: the films have no temperature groups"
    assert f"Error: {told}, so there is nothing to write" in refused(capsys, *parts, *groups)
    assert merge.main([str(each) for each in (*parts, *groups, "--output", tmp_path / "out.exr")]) == 0
    assert f"Warning: {told}; no file of them is written" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["out.exr"]


@pytest.mark.parametrize(
    ("ranges", "missing"),
    [
        ([(0, 0, 8)], ""),
        ([(0, 2, 8)], "0 to 1"),
        ([(0, 0, 1), (0, 2, 3), (0, 9, 12)], "1 and 3 to 8"),
    ],
)
def test_missing_passes_are_told(ranges, missing):
    film = Film(2, 2, EDGES)
    film.ranges = ranges
    assert merge.missing_passes(film) == missing


@pytest.mark.parametrize(
    ("ranges", "wanted", "missing"),
    [
        ([(0, 0, 8)], range(8), ""),
        ([(0, 0, 8)], range(10), "8 to 9"),
        ([(0, 0, 8)], range(2, 5), ""),
        ([(0, 4, 5), (0, 6, 9)], range(3, 7), "3 and 5"),
        ([(0, 4, 5), (0, 8, 9)], range(0, 7), "0 to 3 and 5 to 6"),
    ],
)
def test_missing_passes_of_those_wanted(ranges, wanted, missing):
    film = Film(2, 2, EDGES)
    film.ranges = ranges
    assert merge.missing_passes(film, wanted) == missing
