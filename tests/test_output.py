# SPDX-License-Identifier: GPL-3.0-or-later
"""The thermal palette and the band EXR file, which is read back by readers that share no code with the writer."""

import itertools
import resource
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from addon.output.exr import channel_name, write_band_exr
from addon.output.frame import FrameImages
from addon.output.palette import display, robust_range, thermal
from addon.solver.physics.spectrum import band_names

EDGES = np.array([7.5, 7.9, 8.3, 9.1])
SHAPE = (37, 53)  # neither a multiple of ZIP's block of 16 rows
METADATA = {"passes": 12, "photons": 2**40 + 1, "seed": 7, "referenceTemperature": 293.15, "software": "test 1.0"}


def lightness(linear):
    """CIE L* of linear Rec.709 colours (..., 3), from their luminance alone."""
    luminance = linear @ np.array([0.2126729, 0.7151522, 0.0721750])
    return np.where(luminance > 216 / 24389, 116 * np.cbrt(luminance) - 16, luminance * 24389 / 27)


# palette


def test_lightness_grows_evenly_from_black_to_white():
    levels = lightness(thermal(np.linspace(0, 1, 256), 0, 1))
    assert levels[0] == 0 and levels[-1] == pytest.approx(100, abs=0.01)
    # Clipping to the gamut may bend the straight line by the smallest step an eye can see, about 1.
    assert np.abs(levels - np.linspace(0, 100, 256)).max() < 1.0
    assert np.diff(levels).min() > 0


def test_shape_and_type_follow_the_values():
    assert thermal(np.zeros((3, 4, 5)), 0, 1).shape == (3, 4, 5, 3)
    assert thermal(300.0, 290, 310).shape == (3,)
    assert thermal(np.zeros((2, 2), np.float64)).dtype == np.float32


def test_values_outside_and_not_finite_get_the_ends():
    black, white = thermal(np.array([0.0, 1.0]), 0, 1)
    colours = thermal(np.array([-5.0, -np.inf, np.nan, 7.0, np.inf, 1e38]), 0, 1)
    np.testing.assert_array_equal(colours, [black, black, black, white, white, white])


@pytest.mark.parametrize("value", [0.0, 293.15, -4.0, 1e30])
def test_a_constant_image_has_one_finite_colour_that_is_not_an_end(value):
    colours = thermal(np.full((4, 4), value))
    assert np.isfinite(colours).all() and len(np.unique(colours.reshape(-1, 3), axis=0)) == 1
    assert 30 < lightness(colours[0, 0]) < 70


@pytest.mark.parametrize("values", [np.full((2, 2), np.nan), np.full((2, 2), np.inf), np.empty((0, 5))])
def test_images_without_a_finite_value_have_finite_colours(values):
    colours = thermal(values)
    assert colours.shape == values.shape + (3,) and np.isfinite(colours).all()


def test_the_robust_range_ignores_outliers_and_what_is_not_finite():
    values = np.linspace(280, 300, 10001, dtype=np.float32)
    values[:5] = 1e6
    values[5:30] = np.nan
    low, high = robust_range(values)
    assert 280 <= low < 280.5 and 299.5 < high <= 300.5
    np.testing.assert_array_equal(thermal(values), thermal(values, low, high))


def test_display_encodes_srgb():
    # Values of IEC 61966-2-1: mid grey 0.5 encodes to 188, 0.0031308 to 10.
    np.testing.assert_array_equal(display(np.array([-1, 0, 0.0031308, 0.5, 1, 2])), [0, 0, 10, 188, 255, 255])


# band EXR


@pytest.fixture
def images():
    """Random bit patterns: every exponent, denormals and infinities, so that any loss of a bit shows."""
    rng = np.random.default_rng(3)
    bits = rng.integers(0, 2**32, (len(EDGES) + 2,) + SHAPE, dtype=np.uint32)
    values = bits.view(np.float32)
    return np.where(np.isnan(values), np.float32(np.inf), values)


def write(path, images, metadata=METADATA):
    write_band_exr(path, FrameImages(images[:-3], EDGES, *images[-3:], metadata))


def expected_channels(images):
    names = [channel_name(name) for name in [*band_names(EDGES), "Radiance", "Temperature", "Noise"]]
    return {name: image[::-1] for name, image in zip(names, images, strict=True)}  # top row first


def check(channels, images):
    expected = expected_channels(images)
    assert set(channels) == set(expected)
    for name, image in expected.items():
        np.testing.assert_array_equal(np.asarray(channels[name]).view(np.uint32), image.view(np.uint32), err_msg=name)


def read_zip_exr(path):
    """A second implementation of the file format: text attributes and channels of a ZIP scan line file of floats.

    After 'OpenEXR File Layout' of the OpenEXR documentation.
    """
    data = Path(path).read_bytes()
    assert struct.unpack_from("<II", data) == (20000630, 2)  # magic number; version 2, one part, short names
    attributes, at = {}, 8
    while data[at]:
        name, kind = (part.decode() for part in data[at : at + 600].split(b"\0", 2)[:2])
        at += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = kind, data[at + 4 : at + 4 + size]
        at += 4 + size
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"][1])
    width, height = right - left + 1, bottom - top + 1
    assert attributes["compression"][1] == b"\x03" and attributes["lineOrder"][1] == b"\0"  # ZIP, top row first
    names, raw = [], attributes["channels"][1]
    while raw[0]:
        name, rest = raw.split(b"\0", 1)
        assert struct.unpack_from("<i4x2i", rest) == (2, 1, 1)  # 32-bit float, not subsampled
        names.append(name.decode())
        raw = rest[16:]
    rows = np.empty((height, len(names), width), np.float32)
    for offset in struct.unpack_from(f"<{-(-height // 16)}Q", data, at + 1):
        first, size = struct.unpack_from("<ii", data, offset)
        block = rows[first - top : first - top + 16]
        packed = data[offset + 8 : offset + 8 + size]
        if size < block.nbytes:  # else the block did not shrink and was stored as it is
            deltas = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
            deltas[1:] -= 128
            halves = np.cumsum(deltas).astype(np.uint8)
            middle = (halves.size + 1) // 2
            interleaved = np.empty_like(halves)
            interleaved[0::2], interleaved[1::2] = halves[:middle], halves[middle:]
            packed = interleaved.tobytes()
        block[...] = np.frombuffer(packed, "<f4").reshape(block.shape)
    text = {name: value.decode() for name, (kind, value) in attributes.items() if kind == "string"}
    return text, {name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(names)}


def smooth(images):
    """Values that compress: ramps, as rendered images."""
    ramp = np.linspace(280, 310, images[0].size, dtype=np.float32).reshape(SHAPE)
    return np.stack([ramp * (i + 1) for i in range(len(images))])


@pytest.mark.parametrize("content", ["random", "smooth"])
def test_every_bit_comes_back_through_a_second_implementation(tmp_path, images, content):
    images = images if content == "random" else smooth(images)
    write(tmp_path / "a.exr", images)
    _, channels = read_zip_exr(tmp_path / "a.exr")
    check(channels, images)


def test_every_bit_comes_back_through_openexr_and_openimageio(tmp_path, images):
    write(tmp_path / "a.exr", images)
    import OpenEXR

    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        check({name: channel.pixels for name, channel in file.channels().items()}, images)
    oiio = pytest.importorskip("OpenImageIO")
    file = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    pixels = file.read_image(oiio.FLOAT)
    check({name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(file.spec().channelnames)}, images)


def test_the_header_tells_bands_units_and_how_it_was_rendered(tmp_path, images):
    write(tmp_path / "a.exr", images)
    text, _ = read_zip_exr(tmp_path / "a.exr")
    assert [float(edge) for edge in text["bandEdges"].split()] == EDGES.tolist()
    assert [float(edge) for edge in text["wavelengthRange"].split()] == [7.5, 9.1]
    for part in ("W m-2 sr-1 um-1", "Temperature: K", "bandEdges, wavelengthRange: um"):
        assert part in text["units"]
    assert {name: text[name] for name in METADATA} == {name: str(value) for name, value in METADATA.items()}


def test_edges_closer_than_float32_can_tell_stay_apart(tmp_path, images):
    edges = 10.0 * (1 + 1e-9 * np.arange(4))
    write_band_exr(tmp_path / "a.exr", FrameImages(images[:3], edges, *images[3:]))
    text, channels = read_zip_exr(tmp_path / "a.exr")
    assert [float(edge) for edge in text["bandEdges"].split()] == edges.tolist()
    assert len(channels) == 6


def test_blender_finds_every_image_by_its_name(tmp_path, images):
    """In a process of its own, because Blender keeps state between tests."""
    pytest.importorskip("bpy")
    write(tmp_path / "a.exr", images)
    script = (
        "import bpy, sys\n"
        "image = bpy.data.images.load(sys.argv[1])\n"
        "node = bpy.data.node_groups.new('n', 'CompositorNodeTree').nodes.new('CompositorNodeImage')\n"
        "node.image = image\n"
        "print('sockets:', *[socket.name for socket in node.outputs], sep='\\t')\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "a.exr")], capture_output=True, text=True, check=True, timeout=120
    )
    (line,) = [line for line in run.stdout.splitlines() if line.startswith("sockets:")]
    names = [name.removesuffix(".V") for name in expected_channels(images)]
    assert set(line.split("\t")[1:]) == set(names)


def test_an_existing_file_is_replaced_and_nothing_else_is_left(tmp_path, images):
    write(tmp_path / "a.exr", smooth(images))
    write(tmp_path / "a.exr", images)
    check(read_zip_exr(tmp_path / "a.exr")[1], images)
    assert [file.name for file in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("place", ["missing/a.exr", "file/a.exr", "folder"])
def test_a_path_that_cannot_be_written_is_an_oserror_that_names_it(tmp_path, images, place):
    (tmp_path / "file").write_text("a file, not a folder")
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(OSError) as caught:
        write(tmp_path / place, images)
    assert str((tmp_path / place).parent) in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_full_disk_leaves_the_old_file_whole(tmp_path, images):
    """A limit on the size of files stands in for the full disk: the write fails half way in the same manner."""
    path = tmp_path / "a.exr"
    write(path, smooth(images))
    old = path.read_bytes()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
    try:
        with pytest.raises(OSError, match="a.exr"):
            write(path, images)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == old
    assert [file.name for file in tmp_path.iterdir()] == ["a.exr"]


def test_images_of_different_shapes_and_wrong_counts_are_refused(tmp_path, images):
    with pytest.raises(ValueError, match="shape"):
        write_band_exr(tmp_path / "a.exr", FrameImages(images[:3], EDGES, images[3][:-1], *images[4:]))
    with pytest.raises(ValueError):
        write_band_exr(tmp_path / "a.exr", FrameImages(itertools.repeat(images[0], 2), EDGES, *images[3:]))
    assert not list(tmp_path.iterdir())
