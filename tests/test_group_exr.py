# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of temperature groups: they hold the layers to the last bit, and damaged ones are refused by name."""

import json

import numpy as np
import OpenEXR
import pytest

from addon.output.formats import numbered
from addon.output.group_exr import read_group_exr, write_group_exr, write_recombined
from addon.solver.image.film import Correction
from addon.solver.image.recombine import LayeredImage
from addon.solver.physics.layers import Layer, to_json
from addon.solver.physics.spectrum import apparent_temperature, band_radiance
from addon.solver.scene import SceneError

EDGES = np.array([8.0, 9.5, 14.0])
WEIGHTS = np.array([0.25, 1.0])
CURVE = np.array([8.0, 12.0]), np.array([0.9, 0.1])
LAYERS = Layer(), Layer("motor", temperature=300.0, traced=310.0), Layer("Gerät, ä", "Glass", CURVE, 400.0, 400.0)
FACTS = {
    "referenceTemperature": 300.0, "bandWeights": "0.25 1.0", "assumedEmissivity": 0.8, "reflectedTemperature": 280.0,
    "passes": 7,
}  # fmt: skip


def layered(seed=0):
    excess = np.random.default_rng(seed).normal(size=(3, 2, 5, 4)).astype(np.float32)
    return LayeredImage(excess, LAYERS, EDGES, 300.0, WEIGHTS, Correction(0.8, 280.0))


@pytest.fixture
def path(tmp_path):
    write_group_exr(tmp_path / "groups.exr", layered(), FACTS)
    return tmp_path / "groups.exr"


def test_what_is_read_is_what_was_written(path):
    image, facts = read_group_exr(path)
    assert np.array_equal(image.excess, layered().excess) and image.excess.dtype == np.float32
    assert np.array_equal(image.band_edges, EDGES) and np.array_equal(image.weights, WEIGHTS)
    assert (image.reference_temperature, image.correction) == (300.0, Correction(0.8, 280.0))
    assert image.temperatures == {"motor": 300.0, "Gerät, ä": 400.0} and facts["passes"] == "7"
    assert np.array_equal(image.layers[2].curve, CURVE)
    temperatures = {"motor": 350.0}
    assert np.array_equal(image.recombined(temperatures), layered().recombined(temperatures))


def test_a_correction_for_air_and_optics_is_kept_and_older_files_have_none(tmp_path):
    stated = {"airTransmission": 0.9, "airTemperature": 285.0, "opticsTransmission": 0.8, "opticsTemperature": 295.0}
    write_group_exr(tmp_path / "groups.exr", layered(), FACTS | stated)
    assert read_group_exr(tmp_path / "groups.exr")[0].correction == Correction(0.8, 280.0, 0.9, 285.0, 0.8, 295.0)


def test_other_tools_find_a_part_for_each_layer(path):
    parts = OpenEXR.File(str(path), separate_channels=True).parts
    assert [part.name() for part in parts] == ["0 no group", "1 motor", "2 Gerät, ä, Glass"]
    for part, bands in zip(parts, layered().excess, strict=True):
        for name, band in zip(("8,00-9,50um.V", "9,50-14,00um.V"), bands, strict=True):
            assert np.array_equal(part.channels[name].pixels[::-1], band)
        assert [each["group"] for each in json.loads(part.header["layers"])] == ["", "motor", "Gerät, ä"]
        assert part.header["bandEdges"] == "8.0 9.5 14.0"


def test_recombined_images_follow_the_formula(path, tmp_path):
    """L = B(T0) + sum X(T) / X(R) E, and the sensor's temperature of it."""
    image, facts = read_group_exr(path)
    temperature = write_recombined(tmp_path / "new.exr", image, {"motor": 350.0}, facts)
    widths = np.diff(EDGES)
    reference, traced, new = band_radiance(EDGES, np.array([300.0, 310.0, 350.0]))
    factor = ((new - reference) / (traced - reference))[:, None, None]
    expected = (reference / widths)[:, None, None] + image.excess[0] + factor * image.excess[1] + image.excess[2]
    file = OpenEXR.File(str(tmp_path / "new.exr"), separate_channels=True)
    header, channels = file.header(), file.channels()
    found = np.array([channels[name].pixels[::-1] for name in ("8,00-9,50um.V", "9,50-14,00um.V")])
    np.testing.assert_allclose(found, expected, rtol=2e-6)
    assert json.loads(header["groupTemperatures"]) == {"motor": 350.0, "Gerät, ä": 400.0}
    assert "Noise.V" not in channels and header["passes"] == "7"
    radiance = np.tensordot(WEIGHTS * widths, expected, 1)
    reflected = 0.2 * WEIGHTS @ band_radiance(EDGES, 280.0)
    corrected = apparent_temperature((radiance - reflected) / 0.8, EDGES, WEIGHTS)
    np.testing.assert_allclose(channels["Radiance.V"].pixels[::-1], radiance, rtol=2e-6)
    np.testing.assert_allclose(channels["Temperature.V"].pixels[::-1], corrected, rtol=2e-6)
    assert np.array_equal(channels["Temperature.V"].pixels[::-1], temperature)


def test_files_that_end_early_are_refused(path):
    """Wherever: with a message that names the file."""
    whole = path.read_bytes()
    for at in range(0, len(whole), 23):
        path.write_bytes(whole[:at])
        with pytest.raises(SceneError) as error:
            read_group_exr(path)
        assert str(path) in str(error.value)


def test_damaged_files_are_refused(path):
    """A byte that is wrong is refused, with a message that names the file, or has no effect on what is read."""
    whole, (image, facts) = path.read_bytes(), read_group_exr(path)
    refused, places = 0, range(0, len(whole), 7)
    for at in places:
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            found, told = read_group_exr(path)
        except SceneError as error:
            assert str(path) in str(error)
            refused += 1
        else:
            assert (
                np.array_equal(found.excess, image.excess)
                and told == facts
                and to_json(found.layers) == to_json(LAYERS)
            )
            assert found.reference_temperature == 300.0 and found.correction == image.correction
    print(f"of {len(places)} bytes {refused} are refused")
    assert refused > 0.8 * len(places)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"referenceTemperature": "warm"}, "warm"),
        ({"referenceTemperature": "nan"}, "reference"),
        ({"bandWeights": "1.0"}, "1 bandWeights for 2 bands"),
        ({"assumedEmissivity": "0"}, "assumedEmissivity"),
        ({"airTransmission": "1.5"}, "airTransmission is 1.5"),
        ({"opticsTemperature": "-1"}, "opticsTemperature"),
        ({"layers": to_json(LAYERS[:1])}, "3 parts for 1 layers"),
    ],
)
def test_impossible_facts_are_refused(path, tmp_path, change, message):
    file = OpenEXR.File(str(path), separate_channels=True)
    parts = [OpenEXR.Part({**part.header, **change}, dict(part.channels), part.name()) for part in file.parts]
    OpenEXR.File(parts).write(str(tmp_path / "changed.exr"))
    with pytest.raises(SceneError, match=message) as caught:
        read_group_exr(tmp_path / "changed.exr")
    assert "changed.exr" in str(caught.value)


def test_missing_and_unwritable_files_are_named(tmp_path):
    with pytest.raises(OSError, match="Cannot read the temperature groups from .*nowhere.exr"):
        read_group_exr(tmp_path / "nowhere.exr")
    (tmp_path / "text.exr").write_text("no image")
    with pytest.raises(SceneError, match="text.exr' holds no temperature groups, or is damaged"):
        read_group_exr(tmp_path / "text.exr")
    with pytest.raises(OSError, match="no such folder"):
        write_group_exr(tmp_path / "none" / "groups.exr", layered(), FACTS)


def test_files_are_numbered():
    assert numbered("/a/out_##.exr", ".exr", 7, False).as_posix() == "/a/out_07.exr"
    assert numbered("/a/out.exr", ".exr", 7, True).as_posix() == "/a/out0007.exr"
    assert numbered("/a.b/out", ".exr", 7, False).as_posix() == "/a.b/out.exr"
    assert numbered("/a.b/", ".exr", 7, False, "_B").as_posix() == "/a.b/0007_B.exr"
    assert numbered("/a/.exr", ".exr", 7, True).as_posix() == "/a/0007.exr"
